//! The search tree of Algorithm 1: vertices X, edges E, `Parent` and `Cost` in one arena.
//!
//! A node's cost-to-come is the sum of edge costs from the root. It is kept exact after a rewiring by
//! recomputing every descendant from its parent (not by adding a difference, which would drift).

/// Index of a node in its [`Tree`]. Nodes are numbered in the order they were added; the root is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

impl NodeId {
    /// The root of every tree.
    pub const ROOT: Self = Self(0);

    /// As an index into arrays kept beside the tree.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

#[derive(Debug, Clone)]
struct Node<T> {
    value: T,
    cost_to_come: f64,
    edge_cost: f64,
    parent: Option<NodeId>,
    first_child: Option<NodeId>,
    next_sibling: Option<NodeId>,
    previous_sibling: Option<NodeId>,
}

/// A rooted tree whose nodes carry a `T`: a position, a pose, the curve that leads there.
///
/// All functions that take a [`NodeId`] panic if it comes from another, larger tree.
#[derive(Debug, Clone)]
pub struct Tree<T> {
    nodes: Vec<Node<T>>,
    /// Nodes whose cost is still to be recomputed; kept so that rewiring does not allocate.
    pending: Vec<NodeId>,
}

impl<T> Tree<T> {
    /// A tree of the root alone, with cost zero.
    #[must_use]
    pub fn new(root: T) -> Self {
        Self {
            nodes: vec![Node {
                value: root,
                cost_to_come: 0.0,
                edge_cost: 0.0,
                parent: None,
                first_child: None,
                next_sibling: None,
                previous_sibling: None,
            }],
            pending: Vec::new(),
        }
    }

    /// Adds a child of `parent` over an edge of cost `edge_cost` ≥ 0.
    ///
    /// # Panics
    ///
    /// If the tree would exceed `u32::MAX` nodes.
    pub fn add(&mut self, parent: NodeId, edge_cost: f64, value: T) -> NodeId {
        debug_assert!(edge_cost >= 0.0, "edge cost {edge_cost}");
        assert!(self.nodes.len() < u32::MAX as usize, "the tree is full");
        let id = NodeId(self.nodes.len() as u32);
        self.nodes.push(Node {
            value,
            cost_to_come: self.nodes[parent.index()].cost_to_come + edge_cost,
            edge_cost,
            parent: None,
            first_child: None,
            next_sibling: None,
            previous_sibling: None,
        });
        self.attach(id, parent);
        id
    }

    /// Makes `node` a child of `parent` if that strictly lowers its cost-to-come, and passes the gain on to
    /// all descendants. Returns whether it did.
    ///
    /// With edge costs ≥ 0 no descendant of `node` can offer a strictly lower cost, so no cycle can arise.
    /// The root is never moved.
    pub fn rewire(&mut self, node: NodeId, parent: NodeId, edge_cost: f64) -> bool {
        debug_assert!(edge_cost >= 0.0, "edge cost {edge_cost}");
        let cost = self.nodes[parent.index()].cost_to_come + edge_cost;
        if node == NodeId::ROOT || cost.is_nan() || cost >= self.nodes[node.index()].cost_to_come {
            return false;
        }
        self.detach(node);
        self.attach(node, parent);
        self.nodes[node.index()].edge_cost = edge_cost;
        self.pending.push(node);
        while let Some(id) = self.pending.pop() {
            let current = &self.nodes[id.index()];
            let from = current
                .parent
                .map_or(0.0, |p| self.nodes[p.index()].cost_to_come);
            let cost = from + current.edge_cost;
            let mut child = current.first_child;
            self.nodes[id.index()].cost_to_come = cost;
            while let Some(c) = child {
                self.pending.push(c);
                child = self.nodes[c.index()].next_sibling;
            }
        }
        true
    }

    fn attach(&mut self, node: NodeId, parent: NodeId) {
        let head = self.nodes[parent.index()].first_child.replace(node);
        if let Some(head) = head {
            self.nodes[head.index()].previous_sibling = Some(node);
        }
        let entry = &mut self.nodes[node.index()];
        entry.parent = Some(parent);
        entry.next_sibling = head;
        entry.previous_sibling = None;
    }

    fn detach(&mut self, node: NodeId) {
        let Node {
            parent,
            next_sibling,
            previous_sibling,
            ..
        } = self.nodes[node.index()];
        if let Some(next) = next_sibling {
            self.nodes[next.index()].previous_sibling = previous_sibling;
        }
        match (previous_sibling, parent) {
            (Some(previous), _) => self.nodes[previous.index()].next_sibling = next_sibling,
            (None, Some(parent)) => self.nodes[parent.index()].first_child = next_sibling,
            (None, None) => {}
        }
    }

    /// Number of nodes, the root included; at least 1.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a tree always has its root")]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// What the node carries.
    #[must_use]
    pub fn value(&self, node: NodeId) -> &T {
        &self.nodes[node.index()].value
    }

    /// What the node carries, to be changed: after a rewiring, the curve that leads there.
    pub fn value_mut(&mut self, node: NodeId) -> &mut T {
        &mut self.nodes[node.index()].value
    }

    /// `Cost(x)`: the sum of edge costs from the root.
    #[must_use]
    pub fn cost_to_come(&self, node: NodeId) -> f64 {
        self.nodes[node.index()].cost_to_come
    }

    /// Cost of the edge from the parent; 0 at the root.
    #[must_use]
    pub fn edge_cost(&self, node: NodeId) -> f64 {
        self.nodes[node.index()].edge_cost
    }

    /// `Parent(x)`; `None` at the root.
    #[must_use]
    pub fn parent(&self, node: NodeId) -> Option<NodeId> {
        self.nodes[node.index()].parent
    }

    /// The node's children, latest attached first.
    pub fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        std::iter::successors(self.nodes[node.index()].first_child, |c| {
            self.nodes[c.index()].next_sibling
        })
    }

    /// All nodes in the order they were added.
    pub fn ids(&self) -> impl Iterator<Item = NodeId> + use<T> {
        (0..self.nodes.len() as u32).map(NodeId)
    }

    /// The nodes from the root to `node`, both included.
    #[must_use]
    pub fn path_to(&self, node: NodeId) -> Vec<NodeId> {
        let mut path: Vec<_> = std::iter::successors(Some(node), |n| self.parent(*n)).collect();
        path.reverse();
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Cost summed from the root, in the order of the path.
    fn recomputed<T>(tree: &Tree<T>, node: NodeId) -> f64 {
        tree.path_to(node)
            .iter()
            .fold(0.0, |sum, n| sum + tree.edge_cost(*n))
    }

    fn is_sound<T>(tree: &Tree<T>) {
        let mut seen = vec![0; tree.len()];
        let mut stack = vec![NodeId::ROOT];
        while let Some(node) = stack.pop() {
            seen[node.index()] += 1;
            for child in tree.children(node) {
                assert_eq!(tree.parent(child), Some(node));
                stack.push(child);
            }
        }
        assert!(
            seen.iter().all(|&n| n == 1),
            "each node hangs in the tree exactly once"
        );
        for node in tree.ids() {
            // Equal to the last bit: the propagation adds in the same order.
            assert_eq!(tree.cost_to_come(node), recomputed(tree, node));
        }
    }

    proptest! {
        #[test]
        fn costs_equal_a_recomputation_from_the_root_after_any_rewires(
            parents in prop::collection::vec((any::<prop::sample::Index>(), 0.0..10.0f64), 1..60),
            rewires in prop::collection::vec(
                (any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0.0..10.0f64), 0..60),
        ) {
            let mut tree = Tree::new(());
            for (parent, cost) in parents {
                let parent = NodeId(parent.index(tree.len()) as u32);
                tree.add(parent, cost, ());
            }
            for (node, parent, cost) in rewires {
                let node = NodeId(node.index(tree.len()) as u32);
                let parent = NodeId(parent.index(tree.len()) as u32);
                let (before, offered) = (tree.cost_to_come(node), tree.cost_to_come(parent) + cost);
                let moved = tree.rewire(node, parent, cost);
                prop_assert_eq!(moved, node != NodeId::ROOT && offered < before);
                is_sound(&tree);
            }
        }
    }

    #[test]
    fn a_rewiring_lowers_the_cost_of_all_descendants() {
        let mut tree = Tree::new("root");
        let a = tree.add(NodeId::ROOT, 5.0, "a");
        let b = tree.add(a, 1.0, "b");
        let c = tree.add(b, 1.0, "c");
        let short = tree.add(NodeId::ROOT, 1.0, "short");
        assert!(tree.rewire(a, short, 1.0));
        assert_eq!([a, b, c].map(|n| tree.cost_to_come(n)), [2.0, 3.0, 4.0]);
        assert_eq!(tree.path_to(c), [NodeId::ROOT, short, a, b, c]);
        is_sound(&tree);
    }

    #[test]
    fn a_descendant_can_never_become_the_parent() {
        let mut tree = Tree::new(());
        let a = tree.add(NodeId::ROOT, 1.0, ());
        let b = tree.add(a, 0.0, ());
        assert!(!tree.rewire(a, b, 0.0));
        assert!(!tree.rewire(NodeId::ROOT, b, 0.0));
        is_sound(&tree);
    }

    #[test]
    fn values_can_be_read_and_changed() {
        let mut tree = Tree::new(1);
        let child = tree.add(NodeId::ROOT, 1.0, 2);
        *tree.value_mut(child) = 3;
        assert_eq!((*tree.value(NodeId::ROOT), *tree.value(child)), (1, 3));
    }
}
