//! What can go wrong with a run that made sense on paper.

use crate::clock::ClockError;
use crate::record::RecordError;
use bikebot_control::ControlError;
use bikebot_dynamics::DynamicsError;
use bikebot_mapping::MappingError;
use bikebot_planner::PlanError;
use bikebot_world::WorldError;

/// Why a run could not be carried out. A fall or an empty search is not among them: see
/// [`crate::outcome::RunOutcome`].
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Start or goal make no sense for the planner.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The controller refuses the bike, the path or the gains.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// The laser or the bike refuses its parameters.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// The belief cannot be laid over the field, or a scan or a pose is not finite.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// No world can be made of what is believed.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The recording could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Rates that do not fit each other.
    #[error(transparent)]
    Clock(ClockError),
    /// The scenario has no map or no goal.
    #[error("the scenario has nothing to plan: it needs a map and a goal")]
    NothingToPlan,
    /// A follower was lent for a ride on no path.
    #[error("the scenario has no path to follow: it needs a map and a goal, or [path]")]
    NothingToFollow,
}
