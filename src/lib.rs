//! `bikebot`: plans, balances and rides a bike robot.
//!
//! One front door to the workspace: every crate under its short name.
//!
//! | module | holds |
//! |---|---|
//! | [`geometry`] | poses, Ferguson curves, paths |
//! | [`world`] | obstacles, maps, and the questions one can ask them |
//! | [`planner`] | curvature-bounded planning |
//! | [`dynamics`] | plant models, actuators and sensors |
//! | [`mapping`] | the belief made of laser scans, scan logs, tracks of what moves |
//! | [`control`] | balance by output zeroing, following by passive velocity fields |
//! | [`sim`] | scenario, closed loop, recordings |
//! | [`report`] | pictures of plans and rides |

pub use bikebot_control as control;
pub use bikebot_dynamics as dynamics;
pub use bikebot_geometry as geometry;
pub use bikebot_mapping as mapping;
pub use bikebot_planner as planner;
pub use bikebot_report as report;
pub use bikebot_sim as sim;
pub use bikebot_world as world;
