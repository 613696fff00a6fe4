//! Riding on what the laser has shown: plan, promise, plan again.
//!
//! ```text
//! changed cells ─▶ Navigator ─▶ { new path | keep } and { stop_at } ─▶ follower
//! ```
//!
//! | file | what it holds |
//! |---|---|
//! | `belief` | what is known of each cell, and the optimistic world that is planned in |
//! | `hull` | an outline as rounded boxes, and which cells it meets |
//! | `sweep` | which cells a path covers, and from where on |
//! | `navigator` | keep, repair, afresh, improve, or stop |
//! | `giving_way` | what moves: go first, go behind, or wait |
//! | `status` | orders, and why a bike has to stop |
//! | `lookout` | scans in, orders out: mapper and navigator on the ride |
//! | `params` | the scenario's `[online]` |

mod belief;
mod giving_way;
mod hull;
mod lookout;
mod navigator;
mod params;
mod status;
mod sweep;

pub use giving_way::GivingWayParams;
pub(crate) use giving_way::{Course, Decision};
pub(crate) use lookout::{Lookout, Riding};
pub use navigator::{Motion, Navigator, Task};
pub use params::OnlineParams;
pub use status::{Cause, Halt, NewPath, Order, Searched, Status};

#[cfg(test)]
mod tests;
