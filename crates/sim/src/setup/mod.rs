//! What a scenario means: maps read, degrees turned into radians, rates checked.
//!
//! After [`Setup::resolve`] nothing is optional that the run needs and nothing is checked again.

mod bike;
mod disturbances;
mod ends;
mod laser;
mod maps;
mod obstacles;
mod online;
mod path_source;
mod rates;

pub use online::OnlineSetup;

use crate::clock::{Period, SimTime};
use crate::outcome::Expect;
use crate::record::RecordOptions;
use crate::scenario::{Disturbance, PlantModel, Scenario, ScenarioError, ScenarioFile};
use crate::traffic::Traffic;
use bikebot_control::{BalanceParams, FollowParams, FollowedPath, SupervisorParams};
use bikebot_dynamics::{
    BalancerMode, BikeParams, BikeState, LaserParams, SensorParams, SteeringGeometry,
};
use bikebot_geometry::CurvePath;
use bikebot_mapping::MapperParams;
use bikebot_planner::{EndPose, GoalRegion, PlannerParams, PlanningProblem};
use bikebot_world::formats::MapError;
use bikebot_world::{Footprint, World};

/// Reads a file named in the scenario, by its path as written there (relative to the scenario).
/// The error is what the operating system said.
pub type ReadFile<'a> = &'a mut dyn FnMut(&str) -> Result<Vec<u8>, String>;

/// Why a scenario could not be resolved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// A value of the scenario that is in range but makes no sense in its context.
    #[error(transparent)]
    Scenario(Box<ScenarioError>),
    /// The map file is at fault; the error says where in it.
    #[error("{error}")]
    Map {
        /// What is wrong with the map.
        error: Box<MapError>,
        /// The key of the scenario that names it.
        key: &'static str,
    },
}

impl From<ScenarioError> for SetupError {
    fn from(error: ScenarioError) -> Self {
        Self::Scenario(Box::new(error))
    }
}

/// Longest path a scenario may give, m.
pub const MAX_PATH_LENGTH: f64 = FollowedPath::MAX_LENGTH;
/// A start farther than this from the beginning of a given path is worth a word, m.
const FAR_FROM_PATH: f64 = 1.0;
/// Most control ticks a scenario may ask for: five times a day at 200 Hz.
pub const MAX_TICKS: u64 = 100_000_000;

/// Where the path comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum PathSource {
    /// Planned from start to goal.
    Planned,
    /// Given in the scenario.
    Given(CurvePath),
    /// None: the bike stands and balances.
    Standing,
}

/// A mode change to come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScheduledModeChange {
    /// Earliest time, s.
    pub time: f64,
    /// The mode to change to.
    pub mode: BalancerMode,
    /// How long the shift takes, s.
    pub duration: f64,
}

/// A scenario, resolved: everything in SI units and radians.
#[derive(Debug)]
pub struct Setup {
    /// Name of the scenario.
    pub name: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// What is known to be in the way; `None` where the scenario has no map.
    pub world: Option<World>,
    /// What else is in the way, for some of the time or unknown to the planner.
    pub traffic: Traffic,
    /// The map files that were read, by the path written in the scenario (or in the map file).
    pub files: Vec<(String, Vec<u8>)>,
    /// What a user should know about the inputs; nothing that stops the run.
    pub warnings: Vec<String>,
    /// State at time zero.
    pub start: BikeState,
    /// The start as a planner sees it (its heading may be free).
    pub start_pose: Option<EndPose>,
    /// Where to come to rest.
    pub goal: Option<GoalRegion>,
    /// Tolerance within which the rear contact has to stop, m.
    pub goal_tolerance: f64,
    /// Where the path comes from.
    pub path: PathSource,
    /// The bike's outline, for collision.
    pub footprint: Footprint,
    /// The outline planned with: grown by what the follower is allowed, where it is the bike's own.
    pub planning_footprint: Footprint,
    /// The planner's parameters.
    pub planner: PlannerParams,
    /// The bike as the controller believes it.
    pub bike: BikeParams,
    /// The bike as it is.
    pub true_bike: BikeParams,
    /// Mode at the start.
    pub mode: BalancerMode,
    /// Mode changes, in order of time.
    pub mode_changes: Vec<ScheduledModeChange>,
    /// Path following.
    pub follow: FollowParams,
    /// Balance.
    pub balance: BalanceParams,
    /// Watching the margins.
    pub supervisor: SupervisorParams,
    /// Laser.
    pub laser: LaserParams,
    /// How its scans become a belief.
    pub mapper: MapperParams,
    /// How the ride plans from what its laser shows; `None` where the path is made once and for all.
    pub online: Option<OnlineSetup>,
    /// Sensors.
    pub noise: SensorParams,
    /// What the world does to the true bike, and what breaks on it.
    pub disturbances: Vec<Disturbance>,
    /// Which model moves the bike.
    pub plant: PlantModel,
    /// How the rigid-body model hangs its front wheel.
    pub steering_geometry: SteeringGeometry,
    /// Integration step.
    pub step: Period,
    /// Control period.
    pub control: Period,
    /// End of the run.
    pub duration: SimTime,
    /// How densely to record.
    pub record: RecordOptions,
    /// What the run has to show.
    pub expect: Option<Expect>,
    /// The scenario as TOML, overrides applied.
    pub scenario_text: String,
    /// Keys that overrides gave.
    pub overridden: Vec<String>,
}

impl Setup {
    /// Resolves a scenario; `read` opens the files it names.
    ///
    /// # Errors
    ///
    /// [`SetupError`], with the key and place at fault.
    pub fn resolve(file: &ScenarioFile, read: ReadFile<'_>) -> Result<Self, SetupError> {
        Resolver {
            file,
            scenario: &file.scenario,
            read,
            files: Vec::new(),
            warnings: Vec::new(),
        }
        .resolve()
    }

    /// Name of the mode at the start, as written in scenarios.
    #[must_use]
    pub fn mode_name(&self) -> &'static str {
        match self.mode {
            BalancerMode::Flywheel => "flywheel",
            BalancerMode::Balancer => "balancer",
        }
    }

    /// The planning problem of the scenario, if it has a map and a goal.
    #[must_use]
    pub fn problem(&self) -> Option<PlanningProblem<'_>> {
        Some(PlanningProblem {
            world: self.world.as_ref()?,
            footprint: self.planning_footprint.clone(),
            start: self.start_pose?,
            goal: self.goal?,
            max_curvature: self.planner.max_curvature,
        })
    }
}

struct Resolver<'a> {
    file: &'a ScenarioFile,
    scenario: &'a Scenario,
    read: ReadFile<'a>,
    files: Vec<(String, Vec<u8>)>,
    warnings: Vec<String>,
}

impl Resolver<'_> {
    fn resolve(mut self) -> Result<Setup, SetupError> {
        let scenario = self.scenario;
        let (step, control) = self.rates()?;
        let mut field = self.field()?;
        let traffic = self.obstacles(&mut field)?;
        let laser = self.laser(control, field.world.is_some())?;
        let mapper = self.mapper()?;
        let path = self.path()?;
        self.start_fits_the_plant()?;
        let (start, start_pose) = self.start(&field, &path)?;
        if let PathSource::Given(path) = &path {
            let away = (start.pose.position - path.start_pose().position).norm();
            if away > FAR_FROM_PATH {
                self.warnings.push(format!(
                    "the bike starts {away:.1} m from the beginning of [path]"
                ));
            }
        }
        let disturbances = self.disturbances(&path)?;
        let goal = self.goal(&field, &path)?;
        let (footprint, planning_footprint) = self.footprints()?;
        self.starts_clear(&traffic, &footprint, &start.pose, start_pose.as_ref())?;
        let (true_bike, mode_changes) = self.bike()?;
        let online = self.online(&path, &laser, start_pose.as_ref(), field.world.as_ref())?;
        Ok(Setup {
            name: scenario.name.clone(),
            seed: scenario.run.seed,
            world: field.world,
            traffic,
            start,
            start_pose,
            goal,
            goal_tolerance: goal.map_or(
                scenario.goal.clone().unwrap_or_default().tolerance_m,
                |goal| goal.tolerance,
            ),
            path,
            footprint,
            planning_footprint,
            planner: scenario.planner.clone(),
            bike: scenario.bike.params,
            true_bike,
            mode: scenario.bike.mode,
            mode_changes,
            follow: scenario.follow.clone(),
            balance: scenario.balance.clone(),
            supervisor: scenario.supervisor.clone(),
            laser,
            mapper,
            online,
            noise: scenario.noise,
            disturbances,
            plant: scenario.plant.model,
            steering_geometry: scenario.plant.steering_geometry,
            step,
            control,
            duration: SimTime::from_seconds(scenario.run.duration_s),
            record: scenario.record.clone(),
            expect: scenario.expect.clone(),
            scenario_text: self.file.text_after_overrides(),
            overridden: self.file.overridden().to_vec(),
            files: self.files,
            warnings: self.warnings,
        })
    }

    fn refuse<T>(
        &self,
        key: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Result<T, SetupError> {
        Err(self.file.error_at(key, message, help).into())
    }
}
