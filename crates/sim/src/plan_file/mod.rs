//! Plans as files: `plan.json`, whose keys are a promise to scripts and other programs.
//!
//! | | |
//! |---|---|
//! | [`PlanJson`] | what `plan --json` prints of a plan |
//! | [`PlanFile`] | what `plan -o` writes: that, the curves themselves, the problem, and what the stages made |
//! | [`StoredPlan`] | a file read back: a report again, or held against a problem by [`StoredPlan::mismatches`] |

mod read;
mod write;

pub use read::{Mismatch, PlanFileError, StoredPlan, StoredProblem};
pub use write::{PlanFile, PlanJson, Shapes, Times, TraceJson, map_hash, plan_hash, reason_of};
