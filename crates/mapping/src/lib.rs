//! What the laser has shown: a belief about the field, made of scans.
//!
//! | file | holds |
//! |---|---|
//! | `belief` | [`BeliefGrid`]: log-odds of each cell, and the verdict free, occupied or unknown |
//! | `mapper` | [`Mapper`]: scans in, changed cells out |
//! | `params` | [`MapperParams`], `[mapper]` of a scenario |
//! | `beam` | where a beam of the leaning, moving laser went, and how high |
//! | `beside` | what is met beside each beam |
//! | `marks` | the cells a scan passed and hit, each once |
//! | `evidence` | how much a scan says, and when a cell changes its mind |
//! | [`logs`] | logs of real scans, and maps made of them |
//! | [`tracks`] | what moves: clusters of hits that the belief does not explain |
//! | `outline` | the bike's own outline among returns and cells |
//!
//! The answer of [`Mapper::insert`] is what [`bikebot_world::WorldChanges::cells`] takes, so the worlds that planning and
//! safety ask follow the belief change by change.
//!
//! What free, occupied and unknown are worth is told in `docs/mapping.md`.
//!
//! Nothing here corrects the poses: they are taken as measured, and their uncertainty is a parameter. SI units and radians; frames and
//! signs as in `docs/frames.md`.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod beam;
mod belief;
mod beside;
mod error;
mod evidence;
pub mod logs;
mod mapper;
mod marks;
mod outline;
mod params;
pub mod tracks;

pub use belief::BeliefGrid;
pub use error::MappingError;
pub use mapper::{Hit, Mapper};
pub use params::MapperParams;
pub use tracks::{Track, Tracker, TrackerParams};
