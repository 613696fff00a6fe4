//! Curvature-bounded path planning: BiRRT, shortcutting, corridor RRT*.
//!
//! Algorithm 1 of the paper and the plain planners of its Table 2, over a
//! `World` and a footprint. Lengths are metres, angles radians counter-clockwise from +x,
//! curvatures 1/m. Nothing here reads a clock, opens a file or draws from a global source of chance:
//! equal inputs and an equal seed give an equal report, bit for bit.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

pub mod baseline;
pub mod birrt;
pub mod budget;
pub mod certificate;
pub mod chance;
pub mod connection;
pub mod connectivity;
pub mod corridor;
mod corridor_ends;
pub mod cost;
pub mod dead_end;
pub mod end_arcs;
pub mod error;
mod full;
pub mod guide;
mod in_order;
pub mod kd_tree;
pub mod lattice;
pub mod metrics;
pub mod motion;
pub mod params;
pub mod pipeline;
pub mod planner;
mod point_tree;
pub mod problem;
pub mod refine;
pub mod replan;
pub mod report;
pub mod rrt;
pub mod rrt_star;
pub mod sampler;
pub mod search;
pub mod seeds;
pub mod shortcut;
pub mod shortest;
pub mod steer;
pub mod taut;
#[cfg(test)]
mod test_scenes;
pub mod tree;
#[cfg(test)]
mod visibility;

pub use budget::{Budget, CutShort, Enough, Meter, StopReason};
pub use certificate::{
    Certificate, PathKind, Place, Promises, Terms, Verdict, Violation, ViolationKind, verify,
};
pub use error::{End, PlanError};
pub use metrics::PathMetrics;
pub use motion::MotionChecker;
pub use params::{
    CostRule, Errata, GoalMode, GridParams, Method, MpcParams, PlannerParams, TangentRule,
};
pub use pipeline::{plan, plan_observed};
pub use planner::{Better, Planner};
pub use problem::{EndPose, GoalRegion, PlanningProblem};
pub use replan::{Blockage, Decision, Previous, Replan, ReplanParams, Validity, replan};
pub use report::{Outcome, PlanReport, PlannedPath, Reason, Stage, Stages, TraceEntry};
pub use shortest::{Shortest, shortest};
