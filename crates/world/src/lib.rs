//! Obstacles, grids, and the questions one can ask them.
//!
//! A [`World`] is a bounded piece of the plane with solid obstacles in it: discs, polygons and
//! blocks, an [`OccupancyGrid`], or both. It is built once, never changes, and may be asked from
//! any thread:
//!
//! | question | answer |
//! |---|---|
//! | [`World::clearance`] | signed distance (m) from a point to the nearest obstacle or field edge |
//! | [`World::clearance_lower_bound`] | a cheaper number that is never above it |
//! | [`World::footprint_clearance`] | the same for a [`Footprint`] carried by a pose |
//! | [`World::overlaps`] | does the footprint touch anything solid? |
//! | [`World::cast_ray`], [`World::cast_fan`] | how far does a beam travel? |
//! | [`World::are_in_separate_regions`], [`World::are_apart`] | is it proved that no way leads from one place to another? |
//! | [`World::visit_boundary`] | the sides, blocks and discs in a region |
//!
//! Building takes little more than a look at each cell and shape; what queries need beyond that is made as they come by, or at once
//! by [`World::prepare`]. [`World::with_changes`] gives the world after a change, and shares all the change cannot reach.
//!
//! [`formats`] turns the bytes of map files into worlds; this crate opens no file itself.
//!
//! Frame: x right, y up, metres; angles in radians, counter-clockwise from +x.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod bottlenecks;
mod boundary;
mod changes;
mod clearance_block;
mod clearance_field;
mod error;
mod field_edge;
mod footprint;
pub mod formats;
mod free_regions;
mod grid;
mod grid_traversal;
pub mod map_text;
mod obstacle;
mod primitive;
mod query;
mod solid_cells;
mod world;

pub use boundary::BoundaryPiece;
pub use changes::WorldChanges;
pub use error::WorldError;
pub use footprint::{Footprint, FootprintDisc, FootprintError, FootprintPolygon};
pub use grid::{Cell, CellRectangle, OccupancyGrid};
pub use grid_traversal::{GridTraversal, overlap_with_grid};
pub use obstacle::{Bounds, Obstacle};
pub use world::World;
