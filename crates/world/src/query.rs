//! Nearest obstacle, first obstacle along a ray, overlap with a footprint.
//!
//! The **only** file that names parry; its types stop here. parry supplies the bounding-volume
//! trees and the decomposition of polygons into convex parts. The distances themselves are the
//! closed forms of [`crate::primitive`]: exact to rounding, also inside non-convex solids,
//! where an iterative pair query would be good to 1e-6 m. The tests hold the two against each
//! other. The cells of a grid are in no tree: [`crate::solid_cells`] answers for them.

use std::sync::{Arc, OnceLock};

use bikebot_geometry::{Point2, Vector2};
use parry2d_f64::bounding_volume::Aabb;
use parry2d_f64::math::Vector as ParryVector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, TraversalAction};
use parry2d_f64::shape::TriMesh;

use crate::boundary::BoundaryPiece;
use crate::footprint::Core;
use crate::grid::{Cell, CellRectangle, OccupancyGrid};
use crate::obstacle::{Bounds, Obstacle};
use crate::primitive::{
    Corner, Edge, Primitive, inverse_direction, point_segment_distance_squared, ring_contains, slab,
};
use crate::solid_cells::{CellId, SolidCells};

/// Boxes in the trees are this much larger (m) than what they hold, so that a ray through a
/// common corner of two edges is not lost between two boxes without thickness.
const BOX_MARGIN: f64 = 1e-9;

/// Set in the number of a piece of the boundary that belongs to the grid. There are fewer primitives than that, and four sides to each of
/// at most 64 Mi cells.
const OF_GRID: u32 = 1 << 31;

/// A polygon of the scene.
#[derive(Debug)]
struct Polygon {
    ring: Vec<Point2>,
    /// Convex parts, made when a footprint first lies in the polygon.
    parts: OnceLock<Vec<Vec<Point2>>>,
}

/// One solid of the scene.
#[derive(Debug, Clone)]
enum Solid {
    /// A block or disc: a primitive by itself.
    Primitive(u32),
    Polygon {
        polygon: Arc<Polygon>,
        /// Its edges among the primitives.
        edges: (u32, u32),
    },
}

impl Solid {
    /// First and one past the last of its primitives.
    fn primitives(&self) -> std::ops::Range<u32> {
        match self {
            Self::Primitive(index) => *index..index + 1,
            Self::Polygon { edges, .. } => edges.0..edges.1,
        }
    }
}

/// What decides the clearance of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Decider {
    /// The field's edge, or whatever set the limit of the search.
    Limit,
    /// A primitive, by its index.
    Primitive(u32),
    /// A cell of the grid.
    Cell(CellId),
}

/// A grid, all solid cells of which are one solid.
#[derive(Debug, Clone)]
struct GridSolid {
    cells: Arc<OccupancyGrid>,
    solid: SolidCells,
}

/// All solids, with the trees that find the ones that matter.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    solids: Vec<Solid>,
    /// Which of the solids each obstacle of the world is, in its order; those taken away are in no tree.
    live: Vec<u32>,
    live_primitives: usize,
    solid_tree: Bvh,
    primitives: Vec<Primitive>,
    tree: Bvh,
    grid: Option<GridSolid>,
}

fn to_aabb(b: Bounds) -> Aabb {
    Aabb::new(
        ParryVector::new(b.min.x - BOX_MARGIN, b.min.y - BOX_MARGIN),
        ParryVector::new(b.max.x + BOX_MARGIN, b.max.y + BOX_MARGIN),
    )
}

fn build_tree(boxes: &[Aabb]) -> Bvh {
    Bvh::from_leaves(BvhBuildStrategy::default(), boxes)
}

/// Squared distance (m²) from `p` to a node's box; 0 inside.
#[inline]
fn node_distance_squared(node: &BvhNode, p: Point2) -> f64 {
    let (min, max) = (node.mins(), node.maxs());
    let dx = (min.x - p.x).max(p.x - max.x).max(0.0);
    let dy = (min.y - p.y).max(p.y - max.y).max(0.0);
    dx * dx + dy * dy
}

/// Squared distance (m²) between a node's box and another box; 0 where they overlap.
#[inline]
fn node_gap_squared(node: &BvhNode, b: &Bounds) -> f64 {
    let (min, max) = (node.mins(), node.maxs());
    let dx = (min.x - b.max.x).max(b.min.x - max.x).max(0.0);
    let dy = (min.y - b.max.y).max(b.min.y - max.y).max(0.0);
    dx * dx + dy * dy
}

impl Scene {
    /// `obstacles` must be normalised: counter-clockwise simple polygons. `None` if `stop` said so before all was sorted.
    pub(crate) fn new(
        obstacles: Vec<Obstacle>,
        grid: Option<Arc<OccupancyGrid>>,
        stop: &dyn Fn() -> bool,
    ) -> Option<Self> {
        let mut scene = Self {
            solids: Vec::with_capacity(obstacles.len()),
            live: Vec::with_capacity(obstacles.len()),
            live_primitives: 0,
            solid_tree: Bvh::new(),
            primitives: Vec::new(),
            tree: Bvh::new(),
            grid: None,
        };
        let mut boxes = Vec::with_capacity(obstacles.len());
        for obstacle in obstacles {
            boxes.extend(scene.push(obstacle).map(to_aabb));
        }
        let primitive_boxes: Vec<Aabb> = scene
            .primitives
            .iter()
            .map(|p| to_aabb(p.bounds()))
            .collect();
        if stop() {
            return None;
        }
        scene.solid_tree = build_tree(&boxes);
        scene.tree = build_tree(&primitive_boxes);
        if let Some(cells) = grid {
            let solid = SolidCells::new(&cells, stop)?;
            scene.grid = Some(GridSolid { cells, solid });
        }
        Some(scene)
    }

    /// Appends a solid and its primitives, but not to the trees; its extent, unless it has none.
    fn push(&mut self, obstacle: Obstacle) -> Option<Bounds> {
        let bounds = obstacle.bounds()?;
        let shape = self.solids.len() as u32;
        let next = self.primitives.len() as u32;
        self.solids.push(match obstacle {
            Obstacle::Disc { center, radius } => {
                self.primitives.push(Primitive::Disc { center, radius });
                Solid::Primitive(next)
            }
            Obstacle::Block { min, max } => {
                self.primitives.push(Primitive::Block { min, max });
                Solid::Primitive(next)
            }
            Obstacle::Polygon { vertices } => {
                self.primitives
                    .extend(ring_edges(&vertices, shape).map(Primitive::Edge));
                Solid::Polygon {
                    polygon: Arc::new(Polygon {
                        ring: vertices,
                        parts: OnceLock::new(),
                    }),
                    edges: (next, self.primitives.len() as u32),
                }
            }
        });
        self.live.push(shape);
        self.live_primitives += self.primitives.len() - next as usize;
        Some(bounds)
    }

    /// Takes away the obstacles with these indices, ascending and without repetition, and adds others after the rest. The
    /// primitives of all others keep their indices. The extents of what has changed go to `changed`.
    pub(crate) fn change(
        &mut self,
        removed: &[usize],
        added: Vec<Obstacle>,
        changed: &mut Vec<Bounds>,
    ) {
        for &index in removed.iter().rev() {
            let shape = self.live.remove(index);
            self.solid_tree.remove(shape);
            let mut corners = Vec::new();
            for primitive in self.solids[shape as usize].primitives() {
                let Bounds { min, max } = self.primitive(primitive).bounds();
                corners.extend([min, max]);
                self.tree.remove(primitive);
                self.live_primitives -= 1;
            }
            changed.extend(Bounds::around(corners));
        }
        for obstacle in added {
            let (shape, first) = (self.solids.len() as u32, self.primitives.len());
            if let Some(bounds) = self.push(obstacle) {
                self.solid_tree.insert(to_aabb(bounds), shape);
                changed.push(bounds);
            }
            for index in first..self.primitives.len() {
                let bounds = self.primitives[index].bounds();
                self.tree.insert(to_aabb(bounds), index as u32);
            }
        }
    }

    /// Exchanges the grid for one that differs in these cells.
    pub(crate) fn change_grid(&mut self, cells: Arc<OccupancyGrid>, changes: &[(usize, usize)]) {
        if let Some(grid) = &mut self.grid {
            for &(x, y) in changes {
                let is_solid = cells.cell(x, y).is_some_and(|c| c != Cell::Free);
                grid.solid.set(x, y, is_solid);
            }
            grid.cells = cells;
        }
    }

    /// Primitives of the obstacles that are there.
    pub(crate) fn live_primitives(&self) -> usize {
        self.live_primitives
    }

    /// Primitives of obstacles that were taken away, whose room is not yet used again.
    pub(crate) fn dead_primitives(&self) -> usize {
        self.primitives.len() - self.live_primitives
    }

    /// Bytes held on the heap, but for the vertices of polygons.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.solids)
            + size_of_val(&*self.primitives)
            + size_of_val(&*self.live)
            + self.tree.heap_memory_size()
            + self.solid_tree.heap_memory_size()
            + self.grid.as_ref().map_or(0, |g| g.solid.bytes())
    }

    /// The solid cells of the grid, if there is one.
    pub(crate) fn solid_cells(&self) -> Option<&SolidCells> {
        self.grid.as_ref().map(|g| &g.solid)
    }

    pub(crate) fn primitives(&self) -> &[Primitive] {
        &self.primitives
    }

    fn primitive(&self, index: u32) -> &Primitive {
        &self.primitives[index as usize]
    }

    /// Calls `visit` for each solid whose box overlaps `b`; stops when it returns false.
    fn solids_near(&self, b: &Bounds, mut visit: impl FnMut(u32, &Solid) -> bool) {
        self.solid_tree.traverse(|node| {
            if node_gap_squared(node, b) > 0.0 {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data()
                && !visit(leaf, &self.solids[leaf as usize])
            {
                return TraversalAction::EarlyExit;
            }
            TraversalAction::Continue
        });
    }

    /// Whether `p` lies inside any solid.
    pub(crate) fn contains(&self, p: Point2) -> bool {
        let mut inside = self.grid.as_ref().is_some_and(|g| g.solid.contains(p));
        if !inside {
            self.solids_near(&Bounds { min: p, max: p }, |_, solid| {
                inside = match solid {
                    Solid::Primitive(index) => self.primitive(*index).distance(p) < 0.0,
                    Solid::Polygon { polygon, .. } => ring_contains(&polygon.ring, p),
                };
                !inside
            });
        }
        inside
    }

    /// The primitive nearest to `p` (blocks and discs count as 0 from within), closer than
    /// `limit` (m), and its squared distance (m²). With `only`, edges of that solid alone.
    fn nearest_primitive(&self, p: Point2, limit: f64, only: Option<u32>) -> Option<(u32, f64)> {
        self.tree.find_best(
            limit * limit,
            |node, _| node_distance_squared(node, p),
            |leaf, _| {
                let primitive = self.primitive(leaf);
                match (only, primitive) {
                    (None, _) => Some(primitive.distance_squared_outside(p)),
                    (Some(shape), Primitive::Edge(edge)) if edge.shape == shape => {
                        Some(edge.distance_squared(p))
                    }
                    _ => None,
                }
            },
        )
    }

    /// The smaller of `limit` and the signed distance (m) from `p` to the nearest solid, and
    /// what decides it.
    pub(crate) fn nearest(&self, p: Point2, limit: f64) -> (f64, Decider) {
        let best = self.nearest_shape(p, limit);
        let Some(grid) = &self.grid else {
            return best;
        };
        let (distance, cell) = grid.solid.signed_distance(p, best.0, CellId::NONE);
        if distance < best.0 {
            (distance, Decider::Cell(cell))
        } else {
            best
        }
    }

    /// [`Scene::nearest`] for the shapes alone.
    pub(crate) fn nearest_shape(&self, p: Point2, limit: f64) -> (f64, Decider) {
        let mut best = (limit, Decider::Limit);
        if self.primitives.is_empty() {
            return best;
        }
        let mut inside = false;
        self.solids_near(&Bounds { min: p, max: p }, |shape, solid| {
            let (depth, decides) = match solid {
                Solid::Primitive(index) => (self.primitive(*index).distance(p), *index),
                Solid::Polygon { polygon, .. } if ring_contains(&polygon.ring, p) => {
                    match self.nearest_primitive(p, f64::INFINITY, Some(shape)) {
                        Some((index, squared)) => (-squared.sqrt(), index),
                        None => return true,
                    }
                }
                Solid::Polygon { .. } => return true,
            };
            if depth <= 0.0 {
                inside = true;
                if depth < best.0 {
                    best = (depth, Decider::Primitive(decides));
                }
            }
            true
        });
        if !inside
            && limit > 0.0
            && let Some((index, squared)) = self.nearest_primitive(p, limit, None)
        {
            best = (squared.sqrt(), Decider::Primitive(index));
        }
        best
    }

    /// The point (m) of the boundary nearest to `p`, given what decides its clearance; `None` for a limit.
    pub(crate) fn nearest_point(&self, p: Point2, decider: Decider) -> Option<Point2> {
        match decider {
            Decider::Limit => None,
            Decider::Primitive(index) => Some(self.primitive(index).nearest_boundary_point(p)),
            Decider::Cell(cell) => Some(self.grid.as_ref()?.solid.nearest_point(p, cell)),
        }
    }

    /// Calls `visit` with every primitive whose box comes within `radius` (m) of `p`.
    pub(crate) fn primitives_within(&self, p: Point2, radius: f64, mut visit: impl FnMut(u32)) {
        let radius_squared = radius * radius;
        self.tree.traverse(|node| {
            if node_distance_squared(node, p) > radius_squared {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                visit(leaf);
            }
            TraversalAction::Continue
        });
    }

    /// Calls `visit` with every piece of the boundary all of whose boxes `keep` holds for, until it returns false.
    pub(crate) fn visit(
        &self,
        mut keep: impl FnMut(&Bounds) -> bool,
        mut visit: impl FnMut(u32, BoundaryPiece) -> bool,
    ) {
        let mut goes_on = true;
        self.tree.traverse(|node| {
            let (min, max) = (node.mins(), node.maxs());
            if !keep(&Bounds::new(min.x, min.y, max.x, max.y)) {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                let piece = match *self.primitive(leaf) {
                    Primitive::Disc { center, radius } => BoundaryPiece::Disc { center, radius },
                    Primitive::Block { min, max } => BoundaryPiece::Block { min, max },
                    Primitive::Edge(edge) => BoundaryPiece::Side {
                        start: edge.start,
                        end: edge.end(),
                        begins_convex: edge.begins_convex(),
                    },
                };
                goes_on = visit(leaf, piece);
                if !goes_on {
                    return TraversalAction::EarlyExit;
                }
            }
            TraversalAction::Continue
        });
        if let Some(grid) = &self.grid
            && goes_on
        {
            grid.solid.visit_sides(&mut keep, &mut |number, piece| {
                visit(OF_GRID | number, piece)
            });
        }
    }

    /// The direction in which the boundary arrives where the side with this number begins, which must be a convex corner; not of unit
    /// length. None for what is no side.
    pub(crate) fn direction_before(&self, number: u32) -> Option<Vector2> {
        if number & OF_GRID != 0 {
            let grid = self.grid.as_ref()?;
            return Some(grid.solid.direction_before_side(number & !OF_GRID));
        }
        let Primitive::Edge(edge) = self.primitives.get(number as usize)? else {
            return None;
        };
        // The edges of a ring follow each other; before the first comes the last.
        let ring = self.solids[edge.shape as usize].primitives();
        let before = if number == ring.start {
            ring.end - 1
        } else {
            number - 1
        };
        match self.primitive(before) {
            Primitive::Edge(before) => Some(before.span),
            _ => None,
        }
    }

    /// Distance (m) along the unit vector `direction` to the first boundary met, if below
    /// `limit`. The origin is taken to be outside of every solid.
    ///
    /// `hint` is the primitive the previous ray of a fan met, and becomes the one this ray
    /// meets: neighbours mostly meet the same, and knowing that range prunes the tree.
    pub(crate) fn cast_ray(
        &self,
        origin: Point2,
        direction: Vector2,
        mut limit: f64,
        hint: &mut Option<u32>,
    ) -> Option<f64> {
        let mut best = None;
        if let Some(grid) = &self.grid
            && let Some(distance) = grid.solid.cast_ray(origin, direction, limit)
        {
            limit = distance;
            best = Some(distance);
        }
        if self.primitives.is_empty() {
            return best;
        }
        if let Some(index) = *hint
            && let Some(distance) = self.primitive(index).ray_hit(origin, direction)
            && distance < limit
        {
            limit = distance;
            best = Some(distance);
        }
        let inverse = inverse_direction(direction);
        let nearer = self.tree.find_best(
            limit,
            |node, _| {
                let (min, max) = (node.mins(), node.maxs());
                let (near, far) = slab(
                    Point2::new(min.x, min.y),
                    Point2::new(max.x, max.y),
                    origin,
                    inverse,
                );
                if near <= far && far >= 0.0 {
                    near.max(0.0)
                } else {
                    f64::MAX
                }
            },
            |leaf, _| self.primitive(leaf).ray_hit(origin, direction),
        );
        match nearer {
            Some((index, distance)) => {
                *hint = Some(index);
                Some(distance)
            }
            None => {
                if best.is_none() {
                    *hint = None;
                }
                best
            }
        }
    }

    /// The smaller of `limit` and the distance (m) from the core to the nearest solid; 0 where
    /// the core meets one, also if it lies wholly inside.
    pub(crate) fn core_distance(&self, core: &Core, limit: f64) -> f64 {
        if limit <= 0.0 {
            return limit.max(0.0);
        }
        let around = core_bounds(core);
        let nearest = self.tree.find_best(
            limit * limit,
            |node, _| node_gap_squared(node, &around),
            |leaf, _| Some(core_distance_squared(core.vertices(), self.primitive(leaf))),
        );
        let mut least = nearest.map_or(limit * limit, |(_, squared)| squared);
        let of_shapes = least;
        if let Some(grid) = &self.grid
            && least > 0.0
        {
            least = grid
                .solid
                .least_distance_squared(core.vertices(), least, |ring| {
                    convex_distance_squared(core.vertices(), ring)
                });
        }
        // Clear of every edge, the core can still lie in the midst of a solid.
        if least == 0.0 || self.contains(core.vertices()[0]) {
            0.0
        } else if nearest.is_some() || least < of_shapes {
            least.sqrt()
        } else {
            limit
        }
    }

    /// How far (m) the core must move to leave the convex part it is deepest in; 0 if it is in
    /// none.
    pub(crate) fn core_depth(&self, core: &Core) -> f64 {
        let vertices = core.vertices();
        let around = core_bounds(core);
        let depth_in = |part: &[Point2]| -separation(vertices, part);
        let mut deepest = 0.0_f64;
        self.solids_near(&around, |_, solid| {
            let depth = match solid {
                Solid::Primitive(index) => match self.primitive(*index) {
                    Primitive::Block { min, max } => depth_in(&block_ring(*min, *max)),
                    Primitive::Disc { center, radius } => {
                        let gap = core_distance_squared_to_point(vertices, *center).sqrt();
                        let signed = if gap > 0.0 {
                            gap
                        } else {
                            separation(vertices, &[*center])
                        };
                        radius - signed
                    }
                    Primitive::Edge(_) => 0.0,
                },
                Solid::Polygon { polygon, .. } => polygon
                    .parts
                    .get_or_init(|| convex_parts(&polygon.ring))
                    .iter()
                    .map(|part| depth_in(part))
                    .fold(0.0, f64::max),
            };
            deepest = deepest.max(depth);
            true
        });
        if let Some(grid) = &self.grid {
            for part in grid_parts(&grid.cells, vertices) {
                deepest = deepest.max(depth_in(&part));
            }
        }
        deepest
    }
}

/// The edges of a counter-clockwise ring.
fn ring_edges(ring: &[Point2], shape: u32) -> impl Iterator<Item = Edge> + '_ {
    let n = ring.len();
    let at = move |i: usize| ring[i % n];
    let corner = move |i: usize| Corner::between(at(i) - at(i + n - 1), at(i + 1) - at(i));
    (0..n).map(move |i| Edge::new(at(i), at(i + 1), shape, corner(i), corner(i + 1)))
}

fn block_ring(min: Point2, max: Point2) -> [Point2; 4] {
    [
        min,
        Point2::new(max.x, min.y),
        max,
        Point2::new(min.x, max.y),
    ]
}

/// Most vertices of a polygon that is cut into convex parts. Ear clipping takes the square of their number: seconds
/// at ten thousand, in the middle of somebody's search.
const MOST_CUT: usize = 1000;

/// A simple polygon in convex parts; its box, if it has too many vertices for that, or is too thin to be cut into ears in floating
/// point. Its edges still keep it solid; only the depth of an overlap is then measured against its box.
fn convex_parts(ring: &[Point2]) -> Vec<Vec<Point2>> {
    cut_into_convex(ring).unwrap_or_else(|| {
        Bounds::around(ring.iter().copied())
            .map(|b| vec![block_ring(b.min, b.max).to_vec()])
            .unwrap_or_default()
    })
}

/// A simple counter-clockwise polygon in convex parts (ear clipping, then merging after Hertel & Mehlhorn).
pub(crate) fn cut_into_convex(ring: &[Point2]) -> Option<Vec<Vec<Point2>>> {
    let n = ring.len();
    let convex = (0..n).all(|i| {
        let (a, b, c) = (ring[i], ring[(i + 1) % n], ring[(i + 2) % n]);
        (b - a).perp(&(c - b)) >= 0.0
    });
    if convex {
        return Some(vec![ring.to_vec()]);
    }
    let cut = || TriMesh::from_polygon(ring.iter().map(|p| ParryVector::new(p.x, p.y)).collect());
    let mesh = (n <= MOST_CUT).then(cut).flatten()?;
    let parts = parry2d_f64::transformation::hertel_mehlhorn(mesh.vertices(), mesh.indices())
        .into_iter()
        .map(|part| part.iter().map(|v| Point2::new(v.x, v.y)).collect())
        .collect();
    Some(parts)
}

/// The solid cells near the core, merged to rectangles, as rings in the world frame.
fn grid_parts(grid: &OccupancyGrid, core: &[Point2]) -> Vec<[Point2; 4]> {
    let local = core
        .iter()
        .map(|v| Point2::from(grid.to_cell_coordinates(*v)));
    let Some(b) = Bounds::around(local) else {
        return Vec::new();
    };
    // As much again on every side, so that the way out of a thick wall is seen.
    let reach = 1.0 + b.width().max(b.height());
    let clamp = |v: f64, n: usize| v.clamp(0.0, n as f64) as usize;
    let (x0, y0) = (
        clamp((b.min.x - reach).floor(), grid.width),
        clamp((b.min.y - reach).floor(), grid.height),
    );
    let (x1, y1) = (
        clamp((b.max.x + reach).ceil(), grid.width),
        clamp((b.max.y + reach).ceil(), grid.height),
    );
    let window = CellRectangle { x0, y0, x1, y1 };
    grid.rectangles_within(window, |cell| cell != Cell::Free)
        .into_iter()
        .map(|r| {
            let at =
                |x: usize, y: usize| grid.from_cell_coordinates(Vector2::new(x as f64, y as f64));
            [
                at(r.x0, r.y0),
                at(r.x1, r.y0),
                at(r.x1, r.y1),
                at(r.x0, r.y1),
            ]
        })
        .collect()
}

fn core_bounds(core: &Core) -> Bounds {
    let mut b = Bounds {
        min: core.vertices()[0],
        max: core.vertices()[0],
    };
    for v in core.vertices() {
        b.min = Point2::new(b.min.x.min(v.x), b.min.y.min(v.y));
        b.max = Point2::new(b.max.x.max(v.x), b.max.y.max(v.y));
    }
    b
}

/// Signed gap (m) between two convex shapes of 1, 2 or more vertices, counter-clockwise: the
/// largest separation along an edge normal. Negative: they overlap, and this far one of them
/// must move. Positive: they are apart, by at least this much.
fn separation(a: &[Point2], b: &[Point2]) -> f64 {
    one_sided_separation(a, b).max(one_sided_separation(b, a))
}

fn one_sided_separation(a: &[Point2], b: &[Point2]) -> f64 {
    if a.len() < 2 {
        return f64::NEG_INFINITY;
    }
    let mut largest = f64::NEG_INFINITY;
    for (i, start) in a.iter().enumerate() {
        let span = a[(i + 1) % a.len()] - start;
        let length = span.norm();
        if length == 0.0 {
            continue;
        }
        let outward = Vector2::new(span.y, -span.x) / length;
        let gap = b
            .iter()
            .map(|v| outward.dot(&(v - start)))
            .fold(f64::INFINITY, f64::min);
        largest = largest.max(gap);
    }
    largest
}

/// Squared distance (m²) from a convex shape of 1, 2 or more vertices to a point; 0 inside.
fn core_distance_squared_to_point(core: &[Point2], p: Point2) -> f64 {
    match core {
        [a] => (p - a).norm_squared(),
        [a, b] => point_segment_distance_squared(p, *a, *b),
        ring => {
            if one_sided_separation(ring, &[p]) <= 0.0 {
                return 0.0;
            }
            sides(ring)
                .map(|(a, b)| point_segment_distance_squared(p, a, b))
                .fold(f64::INFINITY, f64::min)
        }
    }
}

/// Squared distance (m²) from a convex shape to a primitive; 0 where they meet.
fn core_distance_squared(core: &[Point2], primitive: &Primitive) -> f64 {
    match primitive {
        Primitive::Disc { center, radius } => {
            let gap = (core_distance_squared_to_point(core, *center).sqrt() - radius).max(0.0);
            gap * gap
        }
        Primitive::Edge(edge) => match core {
            [a] => edge.distance_squared(*a),
            _ => convex_distance_squared(core, &[edge.start, edge.end()]),
        },
        Primitive::Block { min, max } => match core {
            [a] => primitive.distance_squared_outside(*a),
            _ => convex_distance_squared(core, &block_ring(*min, *max)),
        },
    }
}

/// Squared distance (m²) between two convex shapes of 2 or more vertices; 0 where they meet.
fn convex_distance_squared(a: &[Point2], b: &[Point2]) -> f64 {
    if separation(a, b) <= 0.0 && !collinear_apart(a, b) {
        return 0.0;
    }
    // Apart: the distance is taken at a vertex of one of them.
    let to_sides = |vertices: &[Point2], ring: &[Point2]| {
        let mut least = f64::INFINITY;
        for v in vertices {
            for (s, e) in sides(ring) {
                least = least.min(point_segment_distance_squared(*v, s, e));
            }
        }
        least
    };
    to_sides(a, b).min(to_sides(b, a))
}

/// Two segments on one line have no edge normal that could separate them.
fn collinear_apart(a: &[Point2], b: &[Point2]) -> bool {
    let ([a0, a1], [b0, b1]) = (a, b) else {
        return false;
    };
    crate::primitive::segments_meet(*a0, *a1, *b0, *b1).is_none()
}

/// The sides of a ring; the single side of a segment.
fn sides(ring: &[Point2]) -> impl Iterator<Item = (Point2, Point2)> + '_ {
    let n = if ring.len() == 2 { 1 } else { ring.len() };
    (0..n).map(move |i| (ring[i], ring[(i + 1) % ring.len()]))
}

#[cfg(test)]
mod tests;
