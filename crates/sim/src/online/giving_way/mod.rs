//! Riding among things that move: go first, go behind, or wait.
//!
//! | file | what it holds |
//! |---|---|
//! | `mover` | where something that moves may be in a while |
//! | `corridor` | when it may be where the bike will ride |
//! | `schedule` | when the bike will be where |
//! | `decision` | pass, slow down, yield, or brake as hard as can be |
//! | `withheld` | cells that something moving covers are no walls |
//! | `params` | the scenario's `[online.moving]` |

mod corridor;
mod decision;
mod mover;
mod params;
mod schedule;
mod withheld;

pub(crate) use decision::{Counsel, Course, Decision, GivingWay, Ride};
pub use params::GivingWayParams;
pub(crate) use withheld::Withheld;
