//! Incremental kd-tree over positions: `Nearest` (line 9) and `Near` (line 15) of Algorithm 1.
//!
//! Keys are positions in the plane; what else a caller's state holds (a heading, say) is tested
//! afterwards by the caller. Everything lives in flat arenas: no pointer, and no allocation in a query
//! other than growth of the caller's buffer.
//!
//! Leaves hold `LEAF` points and split at the median of the wider axis. Splitting alone degenerates
//! when points come in sorted order, as samples along a path do: every new point lands in the last
//! leaf and the tree becomes a list. So an insertion that ends too deep rebuilds the smallest subtree
//! that is deeper than its size excuses (Galperin & Rivest 1993, scapegoat trees), provided that
//! subtree has grown by half since it was built; that proviso bounds the amortised cost even
//! where equal coordinates make a balanced split impossible.
//!
//! Ties in distance are won by the lower id, and no query depends on the shape of the tree, so results
//! depend only on the points inserted.

use bikebot_geometry::Point2;

/// Points per leaf: wide enough that a scan of one leaf costs about as much as the descent to it.
const LEAF: usize = 24;
/// "No block", the end of a chain of blocks.
const NONE: u32 = u32::MAX;
/// Marks a node as a leaf where an interior node keeps its axis.
const IS_LEAF: u8 = 2;

/// One answer of a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbor {
    /// The id given at insertion.
    pub id: u32,
    /// Squared distance to the query point, m².
    pub distance_squared: f64,
}

impl Neighbor {
    /// Nearer first, then lower id: the order of every result.
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        // Squared distances are not negative, so their bits are ordered as they are.
        let key = |n: &Self| (n.distance_squared.to_bits(), n.id);
        key(self).cmp(&key(other))
    }
}

#[derive(Debug, Clone, Copy)]
struct Item {
    at: [f64; 2],
    id: u32,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    /// Points with a coordinate below this go left, all others right.
    split: f64,
    /// Left child; in a leaf the newest block of its chain.
    left: u32,
    /// Right child; unused in a leaf.
    right: u32,
    /// Points below this node.
    count: u32,
    /// Points there were when this node was last built.
    built: u32,
    /// 0 for x, 1 for y, [`IS_LEAF`] for a leaf.
    axis: u8,
}

/// Incremental kd-tree of points in the plane, each with an id chosen by the caller.
///
/// ```
/// use bikebot_planner::kd_tree::KdTree;
/// use bikebot_geometry::Point2;
///
/// let mut tree = KdTree::new();
/// tree.insert(Point2::new(0.0, 0.0), 0);
/// tree.insert(Point2::new(3.0, 4.0), 1);
/// let nearest = tree.nearest(Point2::new(3.0, 3.0)).unwrap();
/// assert_eq!((nearest.id, nearest.distance_squared), (1, 1.0));
/// ```
#[derive(Debug, Clone, Default)]
pub struct KdTree {
    nodes: Vec<Node>,
    /// Block `b` is `positions[24 b ..]` and `ids[24 b ..]`.
    positions: Vec<[f64; 2]>,
    ids: Vec<u32>,
    /// The block that a leaf overflowed from, if its points coincide.
    next_block: Vec<u32>,
    free_nodes: Vec<u32>,
    free_blocks: Vec<u32>,
    /// Nodes from the root to the leaf of the insertion under way.
    path: Vec<u32>,
    scratch: Vec<Item>,
    keys: Vec<f64>,
}

impl KdTree {
    /// An empty tree.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty tree with room for `points` points.
    #[must_use]
    pub fn with_capacity(points: usize) -> Self {
        // A leaf is between half full and full.
        let blocks = points.div_ceil(LEAF / 2) + 1;
        Self {
            nodes: Vec::with_capacity(2 * blocks),
            positions: Vec::with_capacity(blocks * LEAF),
            ids: Vec::with_capacity(blocks * LEAF),
            next_block: Vec::with_capacity(blocks),
            ..Self::default()
        }
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.first().map_or(0, |root| root.count as usize)
    }

    /// Whether there is no point yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a point. Ids need be neither ordered nor unique.
    ///
    /// Returns `false`, and adds nothing, if a coordinate is not finite or the tree holds
    /// `u32::MAX − 1` points.
    pub fn insert(&mut self, position: Point2, id: u32) -> bool {
        // Adding zero turns −0 into +0, so that the order of the sort is that of `<`.
        let at = [position.x + 0.0, position.y + 0.0];
        if !(at[0].is_finite() && at[1].is_finite()) || self.len() >= (u32::MAX - 1) as usize {
            return false;
        }
        if self.nodes.is_empty() {
            let block = self.new_block();
            self.nodes.push(Node {
                split: 0.0,
                left: block,
                right: 0,
                count: 0,
                built: 0,
                axis: IS_LEAF,
            });
        }
        self.path.clear();
        let mut current = 0u32;
        loop {
            self.path.push(current);
            let node = &mut self.nodes[current as usize];
            node.count += 1;
            if node.axis == IS_LEAF {
                break;
            }
            current = if at[node.axis as usize] < node.split {
                node.left
            } else {
                node.right
            };
        }
        self.add_to_leaf(current, Item { at, id });
        self.rebalance();
        true
    }

    /// The nearest point, or `None` from an empty tree or for a query that is not a number.
    #[must_use]
    pub fn nearest(&self, query: Point2) -> Option<Neighbor> {
        if self.is_empty() || query.x.is_nan() || query.y.is_nan() {
            return None;
        }
        let mut best = Neighbor {
            id: u32::MAX,
            distance_squared: f64::INFINITY,
        };
        self.visit_nearest(0, [query.x, query.y], [0.0; 2], &mut best);
        Some(best)
    }

    /// Every point not farther than `radius` (m) from `query`, into `found`, which is emptied first.
    ///
    /// The order is that of the arena: repeatable, but of no meaning. Sort if it matters.
    pub fn within(&self, query: Point2, radius: f64, found: &mut Vec<Neighbor>) {
        found.clear();
        if self.is_empty() || radius.is_nan() || radius < 0.0 {
            return;
        }
        self.visit_within(0, [query.x, query.y], [0.0; 2], radius * radius, found);
    }

    /// The `limit` nearest points not farther than `radius` (m), nearest first, into `found`, which is
    /// emptied first. Pass `f64::INFINITY` for no radius.
    pub fn nearest_within(
        &self,
        query: Point2,
        limit: usize,
        radius: f64,
        found: &mut Vec<Neighbor>,
    ) {
        found.clear();
        if self.is_empty() || limit == 0 || radius.is_nan() || radius < 0.0 {
            return;
        }
        let mut bound = radius * radius;
        self.visit_limited(0, [query.x, query.y], [0.0; 2], limit, &mut bound, found);
        if found.len() > limit {
            found.select_nth_unstable_by(limit - 1, Neighbor::order);
            found.truncate(limit);
        }
        found.sort_unstable_by(Neighbor::order);
    }

    /// Levels of the tree, the leaf included; logarithmic in [`KdTree::len`].
    #[must_use]
    pub fn depth(&self) -> usize {
        let mut deepest = 0;
        let mut stack = vec![(0u32, 1usize)];
        while let Some((index, level)) = stack.pop() {
            let Some(node) = self.nodes.get(index as usize) else {
                continue;
            };
            deepest = deepest.max(level);
            if node.axis != IS_LEAF {
                stack.push((node.left, level + 1));
                stack.push((node.right, level + 1));
            }
        }
        deepest
    }

    // ----- queries

    /// Calls `visit` with each occupied run of positions and ids of a leaf.
    #[inline]
    fn for_each_block(&self, leaf: &Node, mut visit: impl FnMut(&[[f64; 2]], &[u32])) {
        let mut block = leaf.left;
        // Only the newest block may be partly filled.
        let mut filled = (leaf.count as usize + LEAF - 1) % LEAF + 1;
        if leaf.count == 0 {
            return;
        }
        while block != NONE {
            let start = block as usize * LEAF;
            visit(
                &self.positions[start..start + filled],
                &self.ids[start..start + filled],
            );
            block = self.next_block[block as usize];
            filled = LEAF;
        }
    }

    // `offset` is how far the query lies outside the node's cell, per axis (Arya & Mount 1993). Rounding
    // is monotone, so the squared offset never exceeds the computed squared distance of a point inside.
    fn visit_nearest(&self, index: u32, query: [f64; 2], offset: [f64; 2], best: &mut Neighbor) {
        let node = &self.nodes[index as usize];
        if node.axis == IS_LEAF {
            self.for_each_block(node, |positions, ids| {
                for (at, &id) in positions.iter().zip(ids) {
                    let distance_squared = squared(query[0] - at[0], query[1] - at[1]);
                    if distance_squared < best.distance_squared
                        || (distance_squared == best.distance_squared && id < best.id)
                    {
                        *best = Neighbor {
                            id,
                            distance_squared,
                        };
                    }
                }
            });
            return;
        }
        let (near, far, far_offset) = node.sides(query, offset);
        self.visit_nearest(near, query, offset, best);
        // "Or equal" because an equally distant point with a lower id wins.
        if squared(far_offset[0], far_offset[1]) <= best.distance_squared {
            self.visit_nearest(far, query, far_offset, best);
        }
    }

    fn visit_within(
        &self,
        index: u32,
        query: [f64; 2],
        offset: [f64; 2],
        radius_squared: f64,
        found: &mut Vec<Neighbor>,
    ) {
        let node = &self.nodes[index as usize];
        if node.axis == IS_LEAF {
            self.for_each_block(node, |positions, ids| {
                collect(positions, ids, query, radius_squared, found);
            });
            return;
        }
        let (near, far, far_offset) = node.sides(query, offset);
        self.visit_within(near, query, offset, radius_squared, found);
        if squared(far_offset[0], far_offset[1]) <= radius_squared {
            self.visit_within(far, query, far_offset, radius_squared, found);
        }
    }

    // Candidates are gathered unsorted and cut back to `limit` by selection whenever the buffer has
    // doubled: cheaper than keeping a heap, because most of the bound is won in the first leaves.
    fn visit_limited(
        &self,
        index: u32,
        query: [f64; 2],
        offset: [f64; 2],
        limit: usize,
        bound: &mut f64,
        found: &mut Vec<Neighbor>,
    ) {
        let node = &self.nodes[index as usize];
        if node.axis == IS_LEAF {
            self.for_each_block(node, |positions, ids| {
                collect(positions, ids, query, *bound, found);
            });
            if found.len() >= limit + LEAF {
                found.select_nth_unstable_by(limit - 1, Neighbor::order);
                found.truncate(limit);
                *bound = found[limit - 1].distance_squared;
            }
            return;
        }
        let (near, far, far_offset) = node.sides(query, offset);
        self.visit_limited(near, query, offset, limit, bound, found);
        if squared(far_offset[0], far_offset[1]) <= *bound {
            self.visit_limited(far, query, far_offset, limit, bound, found);
        }
    }

    // ----- building

    fn new_block(&mut self) -> u32 {
        if let Some(block) = self.free_blocks.pop() {
            self.next_block[block as usize] = NONE;
            return block;
        }
        let block = self.next_block.len() as u32;
        self.next_block.push(NONE);
        self.positions.resize(self.positions.len() + LEAF, [0.0; 2]);
        self.ids.resize(self.ids.len() + LEAF, 0);
        block
    }

    fn new_node(&mut self) -> u32 {
        let empty = Node {
            split: 0.0,
            left: NONE,
            right: NONE,
            count: 0,
            built: 0,
            axis: IS_LEAF,
        };
        if let Some(node) = self.free_nodes.pop() {
            self.nodes[node as usize] = empty;
            return node;
        }
        self.nodes.push(empty);
        (self.nodes.len() - 1) as u32
    }

    /// Puts `item` into the leaf whose count already includes it, splitting the leaf when it is full.
    fn add_to_leaf(&mut self, leaf: u32, item: Item) {
        let node = self.nodes[leaf as usize];
        let before = node.count as usize - 1;
        let slot = before % LEAF;
        if before == 0 || slot != 0 {
            let at = node.left as usize * LEAF + slot;
            self.positions[at] = item.at;
            self.ids[at] = item.id;
            // A leaf beyond one block holds coinciding points only; another point ends that.
            let differs = before > LEAF && self.positions[at - slot] != item.at;
            if differs {
                self.rebuild(leaf);
            }
            return;
        }
        // Every block is full. Chain another, then split unless the points coincide.
        let block = self.new_block();
        self.next_block[block as usize] = node.left;
        self.nodes[leaf as usize].left = block;
        let at = block as usize * LEAF;
        self.positions[at] = item.at;
        self.ids[at] = item.id;
        let mut coincide = true;
        self.for_each_block(&self.nodes[leaf as usize], |positions, _| {
            coincide &= positions.iter().all(|&p| p == item.at);
        });
        if !coincide {
            self.rebuild(leaf);
        }
    }

    /// Looks for a subtree deeper than its size excuses on the path of the last insertion.
    fn rebalance(&mut self) {
        let levels = self.path.len();
        if levels <= allowed_depth(self.len()) {
            return;
        }
        for (level, &index) in self.path.iter().enumerate().rev() {
            let node = &self.nodes[index as usize];
            let grown = u64::from(node.count) * 2 >= u64::from(node.built) * 3;
            if levels - level > allowed_depth(node.count as usize) && grown {
                self.rebuild(index);
                return;
            }
        }
    }

    /// Builds the subtree at `index` anew from its points; the index stays.
    fn rebuild(&mut self, index: u32) {
        let mut items = std::mem::take(&mut self.scratch);
        items.clear();
        self.gather(index, index, &mut items);
        self.build(index, &mut items);
        self.scratch = items;
    }

    /// Moves all points below `index` into `items` and frees nodes and blocks, but not node `keep`.
    fn gather(&mut self, index: u32, keep: u32, items: &mut Vec<Item>) {
        let node = self.nodes[index as usize];
        if node.axis == IS_LEAF {
            self.for_each_block(&node, |positions, ids| {
                items.extend(positions.iter().zip(ids).map(|(&at, &id)| Item { at, id }));
            });
            let mut block = node.left;
            while block != NONE {
                self.free_blocks.push(block);
                block = self.next_block[block as usize];
            }
        } else {
            self.gather(node.left, keep, items);
            self.gather(node.right, keep, items);
        }
        if index != keep {
            self.free_nodes.push(index);
        }
    }

    fn build(&mut self, index: u32, items: &mut [Item]) {
        let count = items.len() as u32;
        let split = if items.len() > LEAF {
            self.split(items)
        } else {
            None
        };
        let Some((axis, split, below)) = split else {
            self.fill_leaf(index, items);
            return;
        };
        let (left, right) = (self.new_node(), self.new_node());
        self.nodes[index as usize] = Node {
            split,
            left,
            right,
            count,
            built: count,
            axis: axis as u8,
        };
        let (low, high) = items.split_at_mut(below);
        self.build(left, low);
        self.build(right, high);
    }

    fn fill_leaf(&mut self, index: u32, items: &[Item]) {
        let mut head = NONE;
        // The last chunk may be short, and the newest block is the one that may be short.
        for chunk in items.chunks(LEAF) {
            let block = self.new_block();
            self.next_block[block as usize] = head;
            head = block;
            let start = block as usize * LEAF;
            for (offset, item) in chunk.iter().enumerate() {
                self.positions[start + offset] = item.at;
                self.ids[start + offset] = item.id;
            }
        }
        self.nodes[index as usize] = Node {
            split: 0.0,
            left: head,
            right: NONE,
            count: items.len() as u32,
            built: items.len() as u32,
            axis: IS_LEAF,
        };
    }

    /// Partitions `items` at the median of the wider axis: the axis, the value that separates, and how
    /// many lie below it. `None` if all points coincide.
    ///
    /// Equal coordinates must stay together, so the cut is the boundary of the median's run of equals that
    /// is nearer to the middle.
    fn split(&mut self, items: &mut [Item]) -> Option<(usize, f64, usize)> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for item in items.iter() {
            for axis in 0..2 {
                low[axis] = low[axis].min(item.at[axis]);
                high[axis] = high[axis].max(item.at[axis]);
            }
        }
        // Halved first: the extent of finite numbers may overflow.
        let extent = [0, 1].map(|axis: usize| high[axis] * 0.5 - low[axis] * 0.5);
        let axis = usize::from(extent[1] > extent[0] || high[0] == low[0]);
        if high[axis] == low[axis] {
            return None;
        }
        self.keys.clear();
        self.keys.extend(items.iter().map(|item| item.at[axis]));
        let middle = items.len() / 2;
        let (_, &mut median, above) = self.keys.select_nth_unstable_by(middle, f64::total_cmp);
        let next = above
            .iter()
            .copied()
            .filter(|&key| key > median)
            .fold(f64::INFINITY, f64::min);
        let below = items.iter().filter(|item| item.at[axis] < median).count();
        let up_to = items.iter().filter(|item| item.at[axis] <= median).count();
        let cut_above = below == 0 || (up_to < items.len() && up_to - middle < middle - below);
        let (split, below) = if cut_above {
            (next, up_to)
        } else {
            (median, below)
        };
        let mut front = 0;
        for i in 0..items.len() {
            if items[i].at[axis] < split {
                items.swap(front, i);
                front += 1;
            }
        }
        debug_assert_eq!(front, below);
        Some((axis, split, below))
    }
}

impl Node {
    /// The child on the query's side, the other one, and the query's offset from that other one's cell.
    #[inline]
    fn sides(&self, query: [f64; 2], offset: [f64; 2]) -> (u32, u32, [f64; 2]) {
        let axis = usize::from(self.axis == 1);
        let past = query[axis] - self.split;
        let mut far_offset = offset;
        far_offset[axis] = past;
        if past < 0.0 {
            (self.left, self.right, far_offset)
        } else {
            (self.right, self.left, far_offset)
        }
    }
}

/// Appends the points of one block within the bound. Every point is written and only some are kept: whether a
/// point lies inside is a coin toss near the rim, and a branch on it would be mispredicted half the time.
#[inline]
fn collect(
    positions: &[[f64; 2]],
    ids: &[u32],
    query: [f64; 2],
    bound: f64,
    found: &mut Vec<Neighbor>,
) {
    let start = found.len();
    let blank = Neighbor {
        id: 0,
        distance_squared: 0.0,
    };
    found.resize(start + positions.len(), blank);
    let room = &mut found[start..];
    let mut kept = 0;
    for (at, &id) in positions.iter().zip(ids) {
        let distance_squared = squared(query[0] - at[0], query[1] - at[1]);
        room[kept] = Neighbor {
            id,
            distance_squared,
        };
        kept += usize::from(distance_squared <= bound);
    }
    found.truncate(start + kept);
}

#[inline]
fn squared(x: f64, y: f64) -> f64 {
    x * x + y * y
}

/// Levels a subtree of `points` points may have before it counts as out of balance: one and a half times
/// those of a perfect one, and a few for small subtrees.
fn allowed_depth(points: usize) -> usize {
    let leaves = points.div_ceil(LEAF / 2).max(1);
    let perfect = usize::BITS - leaves.leading_zeros();
    (perfect + perfect / 2 + 3) as usize
}

#[cfg(test)]
mod tests;
