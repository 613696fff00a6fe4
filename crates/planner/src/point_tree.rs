//! A search tree of positions with its kd-tree: what RRT, RRT* and BiRRT grow.

use crate::kd_tree::{KdTree, Neighbor};
use crate::search::PointQuery;
use crate::tree::{NodeId, Tree};
use bikebot_geometry::Point2;

/// Positions joined by straight edges; the cost of an edge is its length, m.
#[derive(Debug, Clone)]
pub(crate) struct PointTree {
    pub(crate) tree: Tree<Point2>,
    index: KdTree,
}

impl PointTree {
    pub(crate) fn new(root: Point2) -> Self {
        let mut index = KdTree::new();
        index.insert(root, NodeId::ROOT.0);
        Self {
            tree: Tree::new(root),
            index,
        }
    }

    pub(crate) fn position(&self, node: NodeId) -> Point2 {
        *self.tree.value(node)
    }

    /// `Nearest(X, x)`, line 9. The root answers where the query is not a number.
    pub(crate) fn nearest(&self, query: Point2) -> NodeId {
        self.index
            .nearest(query)
            .map_or(NodeId::ROOT, |n| NodeId(n.id))
    }

    /// `Near(X, x, r)`, into `found`.
    pub(crate) fn within(&self, query: Point2, radius: f64, found: &mut Vec<Neighbor>) {
        self.index.within(query, radius, found);
    }

    pub(crate) fn add(&mut self, parent: NodeId, position: Point2) -> NodeId {
        let edge = (position - self.position(parent)).norm();
        let node = self.tree.add(parent, edge, position);
        self.index.insert(position, node.0);
        node
    }

    /// Positions from the root to `node`.
    pub(crate) fn path_to(&self, node: NodeId) -> Vec<Point2> {
        self.tree
            .path_to(node)
            .into_iter()
            .map(|n| self.position(n))
            .collect()
    }

    /// The path by `node`, if it may end there or one more edge leads to the goal.
    pub(crate) fn arrival(
        &mut self,
        node: NodeId,
        query: &PointQuery<'_, '_>,
    ) -> Option<Vec<Point2>> {
        let position = self.position(node);
        if query.is_arrival(position) {
            return Some(self.path_to(node));
        }
        query.reaches_goal(position).then(|| {
            let goal = self.add(node, query.goal);
            self.path_to(goal)
        })
    }

    /// Every edge, parent first, in the order the children were added.
    pub(crate) fn edges(&self) -> impl Iterator<Item = [Point2; 2]> + '_ {
        self.tree
            .ids()
            .filter_map(|node| Some([self.position(self.tree.parent(node)?), self.position(node)]))
    }
}
