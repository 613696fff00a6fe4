//! Curvature-bounded path planning: BiRRT, shortcutting, corridor RRT*.
//!
//! Algorithm 1 of the paper and the plain planners of its Table 2, over a
//! `World` and a footprint. Lengths are metres, angles radians counter-clockwise from +x,
//! curvatures 1/m. Nothing here reads a clock, opens a file or draws from a global source of chance:
//! equal inputs and an equal seed give an equal report, bit for bit.

pub mod budget;
pub mod chance;
pub mod cost;
pub mod error;
pub mod kd_tree;
pub mod params;
pub mod sampler;
pub mod steer;
pub mod tree;

pub use budget::{Budget, CutShort, Meter, StopReason};
pub use error::{End, PlanError};
pub use params::{CostRule, Errata, GoalMode, Method, PlannerParams, TangentRule};
