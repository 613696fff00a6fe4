//! Plane geometry and curves of the bike robot.
//!
//! Lengths are metres, angles radians, curvatures 1/m. The world frame has x to the
//! right and y up; headings are counter-clockwise from +x. Nothing here knows about
//! obstacles, randomness or files.
//!
//! * [`angle`] and [`Pose2`]: headings and poses of the plane.
//! * [`ParametricCurve`] and [`FergusonCurve`]: the curve that joins two tree nodes,
//!   Sect. 3.2, Eq. (3)–(4), with its exact largest curvature.
//! * [`ArcLength`] and [`CurvePath`]: travelling along curves by distance, Eq. (6)–(7).
//! * [`Polyline`]: the guide of a corridor, with projection onto it.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

pub mod angle;
mod arc_length;
mod bernstein;
mod curve;
mod curve_path;
mod error;
mod ferguson;
mod polyline;
mod pose;
pub mod quadrature;

pub use arc_length::ArcLength;
pub use curve::ParametricCurve;
pub use curve_path::{CurvePath, PathPoint, PathProjection};
pub use error::GeometryError;
pub use ferguson::FergusonCurve;
pub use polyline::{Polyline, Projection};
pub use pose::Pose2;

/// A point of the plane, m.
pub type Point2 = nalgebra::Point2<f64>;

/// A displacement, a velocity or a direction in the plane.
pub type Vector2 = nalgebra::Vector2<f64>;

/// The z component of the cross product `a × b`: positive when `b` lies to the left of `a`.
#[must_use]
#[inline]
pub fn cross(a: Vector2, b: Vector2) -> f64 {
    a.x * b.y - a.y * b.x
}
