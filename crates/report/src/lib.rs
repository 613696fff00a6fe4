//! Pictures of what others made: plans, rides and eigenvalues, as SVG and PNG, and rides as a page of HTML. Nothing is planned or ridden here.
//!
//! ```text
//! plan.json ─▶ PlanFile ─▶ PlanFigure ┐
//! recording ┬▶ Ride ─────▶ RideFigure ┼▶ Drawing ─▶ svg::write ─▶ png::write
//!           └▶ Moments ▶ MomentsFigure ┤
//! Whipple ────▶ EigenvalueFigure ─────┘
//! recordings ─▶ page::Recording ─▶ page::write: a page of HTML that moves
//! ```
//!
//! A [`Drawing`](drawing::Drawing) is a list of outlines and labels in pixels. The same drawing always gives the same
//! bytes; labels are outlines too, so that a picture needs no fonts; and the curves of a path are drawn as the
//! cubics they are.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

pub mod axis;
pub mod drawing;
mod eigenvalue_figure;
mod envelope_figure;
mod error;
#[cfg(test)]
mod golden;
mod grid_outline;
mod ground_figure;
mod histories_figure;
pub mod label;
mod legend;
mod moments_figure;
pub mod page;
pub mod palette;
mod paths_figure;
mod plan_figure;
pub mod plan_file;
pub mod png;
pub mod reproduction;
mod ride_figure;
mod scenery;
mod sheet;
pub mod svg;

pub use eigenvalue_figure::EigenvalueFigure;
pub use envelope_figure::{Cell, Dimension, EnvelopeFigure, Panel, name_of_key as envelope_name};
pub use error::ReportError;
pub use ground_figure::ground_figure;
pub use histories_figure::HistoriesFigure;
pub use moments_figure::{Moments, MomentsFigure};
pub use paths_figure::{NamedPath, PathsFigure};
pub use plan_figure::{PlanFigure, PlanStyle, PlanView};
pub use plan_file::PlanFile;
pub use ride_figure::{Ride, RideFigure};
pub use scenery::{Ground, footprint_outline};
