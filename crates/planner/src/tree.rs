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

/// "No node", where a link leads nowhere.
const NONE: u32 = u32::MAX;

/// How a node hangs in the tree.
#[derive(Debug, Clone, Copy)]
struct Links {
    parent: u32,
    first_child: u32,
    next_sibling: u32,
    previous_sibling: u32,
}

impl Links {
    const NOWHERE: Self = Self {
        parent: NONE,
        first_child: NONE,
        next_sibling: NONE,
        previous_sibling: NONE,
    };
}

/// A rooted tree whose nodes carry a `T`: a position, a pose.
///
/// What is asked of many nodes at once, their costs, lies apart from what is asked of few, so that a search among neighbours in a
/// tree of a million nodes reads eight bytes of each. A node takes 32 bytes and its `T`, and half of that again at most
/// where the arrays have just grown.
///
/// All functions that take a [`NodeId`] panic if it comes from another, larger tree.
#[derive(Debug, Clone)]
pub struct Tree<T> {
    costs: Vec<f64>,
    edge_costs: Vec<f64>,
    links: Vec<Links>,
    values: Vec<T>,
    /// Nodes whose cost is still to be recomputed; kept so that rewiring does not allocate.
    pending: Vec<u32>,
}

impl<T> Tree<T> {
    /// A tree of the root alone, with cost zero.
    #[must_use]
    pub fn new(root: T) -> Self {
        Self {
            costs: vec![0.0],
            edge_costs: vec![0.0],
            links: vec![Links::NOWHERE],
            values: vec![root],
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
        assert!(self.len() < NONE as usize, "the tree is full");
        let id = NodeId(self.len() as u32);
        let cost = self.costs[parent.index()] + edge_cost;
        push(&mut self.costs, cost);
        push(&mut self.edge_costs, edge_cost);
        push(&mut self.links, Links::NOWHERE);
        push(&mut self.values, value);
        self.attach(id.0, parent.0);
        id
    }

    /// Makes `node` a child of `parent` if that strictly lowers its cost-to-come, and passes the gain on to
    /// all descendants. Returns whether it did.
    ///
    /// With edge costs ≥ 0 no descendant of `node` can offer a strictly lower cost, so no cycle can arise.
    /// The root is never moved.
    pub fn rewire(&mut self, node: NodeId, parent: NodeId, edge_cost: f64) -> bool {
        debug_assert!(edge_cost >= 0.0, "edge cost {edge_cost}");
        let cost = self.costs[parent.index()] + edge_cost;
        if node == NodeId::ROOT || cost.is_nan() || cost >= self.costs[node.index()] {
            return false;
        }
        self.detach(node.0);
        self.attach(node.0, parent.0);
        self.edge_costs[node.index()] = edge_cost;
        self.costs[node.index()] = cost;
        self.pending.push(node.0);
        while let Some(id) = self.pending.pop() {
            let from = self.costs[id as usize];
            let mut child = self.links[id as usize].first_child;
            while child != NONE {
                let links = self.links[child as usize];
                self.costs[child as usize] = from + self.edge_costs[child as usize];
                if links.first_child != NONE {
                    self.pending.push(child);
                }
                child = links.next_sibling;
            }
        }
        true
    }

    fn attach(&mut self, node: u32, parent: u32) {
        let head = std::mem::replace(&mut self.links[parent as usize].first_child, node);
        if head != NONE {
            self.links[head as usize].previous_sibling = node;
        }
        let links = &mut self.links[node as usize];
        links.parent = parent;
        links.next_sibling = head;
        links.previous_sibling = NONE;
    }

    fn detach(&mut self, node: u32) {
        let Links {
            parent,
            next_sibling,
            previous_sibling,
            ..
        } = self.links[node as usize];
        if next_sibling != NONE {
            self.links[next_sibling as usize].previous_sibling = previous_sibling;
        }
        if previous_sibling != NONE {
            self.links[previous_sibling as usize].next_sibling = next_sibling;
        } else if parent != NONE {
            self.links[parent as usize].first_child = next_sibling;
        }
    }

    /// Number of nodes, the root included; at least 1.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a tree always has its root")]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// What the node carries.
    #[must_use]
    pub fn value(&self, node: NodeId) -> &T {
        &self.values[node.index()]
    }

    /// What the node carries, to be changed: after a rewiring, the curve that leads there.
    pub fn value_mut(&mut self, node: NodeId) -> &mut T {
        &mut self.values[node.index()]
    }

    /// `Cost(x)`: the sum of edge costs from the root.
    #[must_use]
    pub fn cost_to_come(&self, node: NodeId) -> f64 {
        self.costs[node.index()]
    }

    /// Cost of the edge from the parent; 0 at the root.
    #[must_use]
    pub fn edge_cost(&self, node: NodeId) -> f64 {
        self.edge_costs[node.index()]
    }

    /// `Parent(x)`; `None` at the root.
    #[must_use]
    pub fn parent(&self, node: NodeId) -> Option<NodeId> {
        linked(self.links[node.index()].parent)
    }

    /// The node's children, latest attached first.
    pub fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        let first = linked(self.links[node.index()].first_child);
        std::iter::successors(first, |c| linked(self.links[c.index()].next_sibling))
    }

    /// All nodes in the order they were added.
    pub fn ids(&self) -> impl Iterator<Item = NodeId> + use<T> {
        (0..self.values.len() as u32).map(NodeId)
    }

    /// The nodes from the root to `node`, both included.
    #[must_use]
    pub fn path_to(&self, node: NodeId) -> Vec<NodeId> {
        let mut path: Vec<_> = std::iter::successors(Some(node), |n| self.parent(*n)).collect();
        path.reverse();
        path
    }
}

fn linked(node: u32) -> Option<NodeId> {
    (node != NONE).then_some(NodeId(node))
}

/// Appends `item`; a full array grows by half, where the standard library's would double.
fn push<T>(items: &mut Vec<T>, item: T) {
    if items.len() == items.capacity() {
        items.reserve_exact((items.len() / 2).max(64));
    }
    items.push(item);
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
