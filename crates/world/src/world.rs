//! The world: a bounded field and what stands in it.

use std::sync::{Arc, OnceLock};

use bikebot_geometry::{Point2, Pose2, Vector2};

use crate::bottlenecks::Bottlenecks;
use crate::boundary::BoundaryPiece;
use crate::clearance_field::ClearanceField;
use crate::error::WorldError;
use crate::field_edge::FieldEdge;
use crate::footprint::{Core, Footprint};
use crate::free_regions::FreeRegions;
use crate::grid::OccupancyGrid;
use crate::obstacle::{Bounds, Obstacle};
use crate::query::Scene;

/// A bounded field with solid obstacles: built once, immutable, shared between threads.
///
/// The edge of the field is a wall for clearance and overlap: nothing may stand half outside.
/// To a ray it is a wall in a world of shapes (an arena), and nothing in a world with a grid,
/// whose edge is only where the map ends.
///
/// Overlapping obstacles are each a solid of their own: inside several of them the clearance
/// is the depth in the one that is deepest. All solid cells of a grid are one solid.
#[derive(Debug)]
pub struct World {
    pub(crate) obstacles: Vec<Obstacle>,
    pub(crate) grid: Option<Arc<OccupancyGrid>>,
    pub(crate) edge: FieldEdge,
    pub(crate) scene: Scene,
    pub(crate) field: ClearanceField,
    pub(crate) regions: OnceLock<FreeRegions>,
    pub(crate) bottlenecks: OnceLock<Bottlenecks>,
}

impl World {
    /// A field with shapes in it. Shapes may stick out of the field.
    ///
    /// # Errors
    ///
    /// If the bounds have no area, or an obstacle is empty, crosses itself, or has a coordinate
    /// that is not finite; see [`WorldError`].
    pub fn new(bounds: Bounds, obstacles: Vec<Obstacle>) -> Result<Self, WorldError> {
        Self::build(bounds, obstacles, None)
    }

    /// The world a grid describes. Its field is the grid; unknown cells are solid (see
    /// [`OccupancyGrid::with_unknown_as`] to have them free).
    ///
    /// # Errors
    ///
    /// If the grid's size, resolution or origin make no sense.
    pub fn from_grid(grid: OccupancyGrid) -> Result<Self, WorldError> {
        grid.check()?;
        Self::build(grid.bounds(), Vec::new(), Some(grid))
    }

    /// Shapes, or a grid, or both. With a grid the field is what `bounds` and grid have in
    /// common: nothing is known beyond the grid's edge.
    ///
    /// # Errors
    ///
    /// As [`World::new`] and [`World::from_grid`], or if `bounds` and grid do not overlap.
    #[expect(
        clippy::expect_used,
        reason = "only a stop leaves nothing, and nobody stops"
    )]
    pub fn build(
        bounds: Bounds,
        obstacles: Vec<Obstacle>,
        grid: Option<OccupancyGrid>,
    ) -> Result<Self, WorldError> {
        Self::build_unless(bounds, obstacles, grid, &|| false)
            .map(|world| world.expect("a build that nobody stops is finished"))
    }

    /// [`World::build`], unless `stop` says so before it is done: then `None`. A large grid is gathered in pieces of some 0.1 ms,
    /// with the question after each.
    ///
    /// # Errors
    ///
    /// As [`World::build`].
    pub fn build_unless(
        bounds: Bounds,
        obstacles: Vec<Obstacle>,
        grid: Option<OccupancyGrid>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, WorldError> {
        bounds.check()?;
        let bounds = match &grid {
            None => bounds,
            Some(grid) => {
                grid.check()?;
                let common = bounds
                    .intersection(&grid.bounds())
                    .ok_or(WorldError::Disjoint)?;
                common.check()?;
                common
            }
        };
        let mut normalised = Vec::with_capacity(obstacles.len());
        for (index, obstacle) in obstacles.iter().enumerate() {
            if stop() {
                return Ok(None);
            }
            normalised.push(obstacle.normalised(index)?);
        }
        let grid = grid.map(Arc::new);
        let edge = FieldEdge::new(bounds, grid.as_deref());
        let Some(scene) = Scene::new(normalised, grid.clone(), stop) else {
            return Ok(None);
        };
        let field = ClearanceField::new(&bounds, &scene);
        Ok(Some(Self {
            obstacles,
            grid,
            edge,
            scene,
            field,
            regions: OnceLock::new(),
            bottlenecks: OnceLock::new(),
        }))
    }

    /// Makes now what queries would make as they come by, all of it; false if `stop` said so first, and what is done by then
    /// stays done, but for the last 50 ms of it on the largest of fields. It is asked every 0.5 ms or so. No answer depends on it,
    /// only how long the first ones take.
    pub fn prepare(&self, stop: &dyn Fn() -> bool) -> bool {
        self.regions(stop).is_some()
            && self.field.fill(&self.scene, &self.edge, stop)
            && self.bottlenecks(stop).is_some()
    }

    /// Bytes of memory held for answering, beside the obstacles and the grid as they were given.
    #[must_use]
    pub fn prepared_bytes(&self) -> usize {
        self.scene.bytes()
            + self.field.bytes()
            + self.regions.get().map_or(0, FreeRegions::bytes)
            + self.bottlenecks.get().map_or(0, Bottlenecks::bytes)
    }

    /// Whether the free cells of the grid prove that nothing at all leads from `a` to `b` (m): they lie in pieces that do not
    /// meet. False proves nothing, and is the answer without a grid, or if `stop` said so while the cells were labelled, which
    /// is done once and takes some 20 ms for 4096 × 4096.
    pub fn are_in_separate_regions(&self, a: Point2, b: Point2, stop: &dyn Fn() -> bool) -> bool {
        let place = |p: Point2| self.scene.solid_cells()?.free_cell(p);
        let (Some((ax, ay)), Some((bx, by))) = (place(a), place(b)) else {
            return false;
        };
        self.regions(stop)
            .is_some_and(|regions| regions.region(ax, ay) != regions.region(bx, by))
    }

    /// Whether the clearance grid proves that no way from `a` to `b` (m) keeps `clearance` (m, above 0) everywhere, both ends
    /// included. False proves nothing: walls thinner than two cells of that grid are not seen where `clearance` is less than
    /// a cell diagonal.
    ///
    /// The first question fills the grid, which takes some 0.4 s for a million cells; false, if `stop` said so before that was
    /// done. All others are answered in a microsecond, whatever the places and the clearance.
    pub fn are_apart(&self, a: Point2, b: Point2, clearance: f64, stop: &dyn Fn() -> bool) -> bool {
        let layout = self.field.layout();
        let (Some(a), Some(b)) = (layout.locate(a), layout.locate(b)) else {
            return false;
        };
        // Not a number is no clearance, and none at all can be kept through a seam.
        clearance > 0.0
            && self.bottlenecks(stop).is_some_and(|bottlenecks| {
                let index = |(column, row): (usize, usize)| row * layout.columns + column;
                bottlenecks.separate(index(a), index(b), clearance)
            })
    }

    /// The pieces of the grid's free cells. Without a grid there are none to be told apart, which takes no time.
    fn regions(&self, stop: &dyn Fn() -> bool) -> Option<&FreeRegions> {
        if self.regions.get().is_none() {
            let regions = match self.scene.solid_cells() {
                Some(cells) => FreeRegions::new(cells, stop)?,
                None => FreeRegions::none(),
            };
            // Another thread may have been first, with the same.
            let _ = self.regions.set(regions);
        }
        self.regions.get()
    }

    fn bottlenecks(&self, stop: &dyn Fn() -> bool) -> Option<&Bottlenecks> {
        if self.bottlenecks.get().is_none() {
            let bottlenecks = Bottlenecks::new(&self.field, &self.scene, &self.edge, stop)?;
            let _ = self.bottlenecks.set(bottlenecks);
        }
        self.bottlenecks.get()
    }

    /// Cells of the clearance grid that are filled so far.
    #[must_use]
    pub fn prepared_cells(&self) -> usize {
        self.field.filled_cells()
    }

    /// The field, m.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.edge.bounds
    }

    /// The shapes, as they were given. Cells of a grid are not among them.
    #[must_use]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// The grid, if the world has one.
    #[must_use]
    pub fn grid(&self) -> Option<&OccupancyGrid> {
        self.grid.as_deref()
    }

    /// Whether `p` (m) lies within the field, obstacle or not.
    #[must_use]
    pub fn is_inside(&self, p: Point2) -> bool {
        self.edge.distance(p) >= 0.0
    }

    /// Signed distance (m) from `p` to the nearest obstacle or to the field's edge; negative
    /// inside an obstacle or outside the field, −∞ for a point that is not finite.
    ///
    /// Exact to rounding. It changes by no more than the distance moved (1-Lipschitz), which is
    /// what makes certified collision checks of whole motions possible.
    #[must_use]
    #[inline]
    pub fn clearance(&self, p: Point2) -> f64 {
        self.field.clearance(&self.scene, &self.edge, p)
    }

    /// A number (m) that is never above [`World::clearance`], for less work; no more than a
    /// cell diagonal of the clearance grid below it.
    #[must_use]
    #[inline]
    pub fn clearance_lower_bound(&self, p: Point2) -> f64 {
        self.field.lower_bound(&self.scene, &self.edge, p)
    }

    /// The point (m) of an obstacle's boundary, or of the field's edge, that decides the
    /// clearance of `p`. Inside an obstacle it is the nearest way out of it.
    #[must_use]
    pub fn nearest_obstacle_point(&self, p: Point2) -> Point2 {
        let (_, decider) = self.field.nearest(&self.scene, &self.edge, p);
        self.scene
            .nearest_point(p, decider)
            .unwrap_or_else(|| self.edge.nearest_point(p))
    }

    /// Signed clearance (m) of a footprint: the distance of its nearest point to an obstacle or
    /// the field's edge, and where it overlaps, minus the way to the nearest free position with
    /// respect to the convex part it is deepest in.
    ///
    /// Exact to rounding outside. Zero where they just touch.
    #[must_use]
    pub fn footprint_clearance(&self, footprint: &Footprint, pose: &Pose2) -> f64 {
        if !(pose.is_finite() && footprint.reach().is_finite()) {
            return f64::NEG_INFINITY;
        }
        footprint.cores(pose).fold(f64::INFINITY, |least, core| {
            least.min(self.core_clearance(&core, least))
        })
    }

    /// Signed clearance (m) of one convex core with its radius; where it is above `limit`, any value above that.
    fn core_clearance(&self, core: &Core, limit: f64) -> f64 {
        if let [centre] = core.vertices() {
            return self.clearance(*centre) - core.radius;
        }
        let to_edge = core
            .vertices()
            .iter()
            .map(|v| self.edge.distance(*v))
            .fold(f64::INFINITY, f64::min);
        // The core can be no clearer than its own middle: the search need look no farther.
        let middle = self.clearance(core.middle()) * (1.0 + 1e-9) + 1e-9;
        let enough = (limit + core.radius).max(1e-9);
        let to_obstacle = self
            .scene
            .core_distance(core, to_edge.min(middle).min(enough));
        let signed = if to_obstacle > 0.0 {
            to_obstacle.min(to_edge)
        } else {
            to_edge.min(-self.scene.core_depth(core))
        };
        signed - core.radius
    }

    /// Whether the footprint reaches into an obstacle or beyond the field's edge. Touching is
    /// not overlapping: true exactly where [`World::footprint_clearance`] is negative.
    #[must_use]
    pub fn overlaps(&self, footprint: &Footprint, pose: &Pose2) -> bool {
        if !(pose.is_finite() && footprint.reach().is_finite()) {
            return true;
        }
        footprint.cores(pose).any(|core| self.core_overlaps(&core))
    }

    fn core_overlaps(&self, core: &Core) -> bool {
        // One point query decides most poses, inside or well outside.
        let middle = core.middle();
        let clearance = self.clearance(middle);
        if clearance < core.radius {
            return true;
        }
        let extent = core
            .vertices()
            .iter()
            .map(|v| (v - middle).norm_squared())
            .fold(0.0, f64::max)
            .sqrt();
        clearance < (extent + core.radius) * (1.0 + 1e-12)
            && self.core_clearance(core, f64::INFINITY) < 0.0
    }

    /// Calls `visit` with the pieces of the obstacles' boundary, each with its number, until it returns false. Pieces come in
    /// boxes within boxes, and what lies in a box (m) for which `keep` does not hold is passed over. The edge of the field is not
    /// among them.
    pub fn visit_boundary(
        &self,
        keep: impl FnMut(&Bounds) -> bool,
        visit: impl FnMut(u32, BoundaryPiece) -> bool,
    ) {
        self.scene.visit(keep, visit);
    }

    /// The direction (m, of any length) in which the boundary arrives at the convex corner where side `number` begins; `None` for a piece
    /// that is no side.
    #[must_use]
    pub fn direction_before_side(&self, number: u32) -> Option<Vector2> {
        self.scene.direction_before(number)
    }

    /// How far (m) a ray from `origin` along `angle` (rad) travels before it meets something
    /// solid; `None` if it meets nothing within `max_range` (m). 0 from inside an obstacle.
    #[must_use]
    pub fn cast_ray(&self, origin: Point2, angle: f64, max_range: f64) -> Option<f64> {
        let mut range = [f64::INFINITY];
        self.cast_fan(origin, angle, 0.0, max_range, &mut range);
        range[0].is_finite().then_some(range[0])
    }

    /// A fan of rays from one origin: ray i leaves along `angle_min + i · angle_step` (rad),
    /// and `ranges[i]` becomes its range (m), `f64::INFINITY` for nothing within `max_range`.
    pub fn cast_fan(
        &self,
        origin: Point2,
        angle_min: f64,
        angle_step: f64,
        max_range: f64,
        ranges: &mut [f64],
    ) {
        let usable = origin.x.is_finite()
            && origin.y.is_finite()
            && angle_min.is_finite()
            && angle_step.is_finite()
            && max_range > 0.0;
        if !usable {
            ranges.fill(f64::INFINITY);
            return;
        }
        let edge_is_wall = self.grid.is_none();
        if self.scene.contains(origin) || (edge_is_wall && !self.is_inside(origin)) {
            ranges.fill(0.0);
            return;
        }
        let mut hint = None;
        for (i, range) in ranges.iter_mut().enumerate() {
            let (sin, cos) = (angle_min + angle_step * i as f64).sin_cos();
            let direction = Vector2::new(cos, sin);
            let wall = if edge_is_wall {
                self.edge.exit(origin, direction)
            } else {
                f64::INFINITY
            };
            let hit = self
                .scene
                .cast_ray(origin, direction, wall.min(max_range), &mut hint)
                .unwrap_or(wall);
            *range = if hit <= max_range { hit } else { f64::INFINITY };
        }
    }

    /// The same world stretched about the origin by `factor`, grid and field included.
    ///
    /// # Errors
    ///
    /// If the factor is not a finite number above 0, or carries a coordinate beyond ±1e9 m.
    pub fn scaled(&self, factor: f64) -> Result<Self, WorldError> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(WorldError::Scale { factor });
        }
        let bounds = Bounds {
            min: self.edge.bounds.min * factor,
            max: self.edge.bounds.max * factor,
        };
        let obstacles = self.obstacles.iter().map(|o| o.scaled(factor)).collect();
        let grid = self.grid.as_deref().map(|g| {
            let position = g.origin.position * factor;
            OccupancyGrid {
                resolution: g.resolution * factor,
                origin: Pose2::new(position.x, position.y, g.origin.heading),
                ..g.clone()
            }
        });
        Self::build(bounds, obstacles, grid)
    }

    /// Side (m) of the cells of the grid that speeds up [`World::clearance`].
    #[must_use]
    pub fn clearance_cell_size(&self) -> f64 {
        self.field.layout().size
    }

    /// Columns and rows of that grid; it covers [`World::bounds`] from the lower-left corner.
    #[must_use]
    pub fn clearance_cells(&self) -> (usize, usize) {
        (self.field.layout().columns, self.field.layout().rows)
    }

    /// Column and row of the cell that holds `p` (m); `None` off the field.
    #[must_use]
    pub fn clearance_cell(&self, p: Point2) -> Option<(usize, usize)> {
        self.field.layout().locate(p)
    }

    /// Centre (m) of a cell and its exact clearance (m), which every cell keeps.
    ///
    /// # Panics
    ///
    /// If column or row are not below [`World::clearance_cells`].
    #[must_use]
    pub fn clearance_cell_centre(&self, column: usize, row: usize) -> (Point2, f64) {
        assert!(
            column < self.field.layout().columns && row < self.field.layout().rows,
            "no such clearance cell"
        );
        let clearance = self
            .field
            .centre_clearance(&self.scene, &self.edge, column, row);
        (self.field.layout().centre(column, row), clearance)
    }
}

#[cfg(test)]
mod tests;
