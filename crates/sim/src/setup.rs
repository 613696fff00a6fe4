//! What a scenario means: maps read, degrees turned into radians, rates checked.
//!
//! After [`Setup::resolve`] nothing is optional that the run needs and nothing is checked again.

use crate::clock::{ClockError, Period, SimTime};
use crate::outcome::Expect;
use crate::path_file::{self, PathFileError};
use crate::record::RecordOptions;
use crate::scenario::{PathSection, PlantModel, Scenario, ScenarioError, ScenarioFile};
use bikebot_control::{BalanceParams, FollowParams, FollowedPath};
use bikebot_dynamics::{
    BalancerMode, BikeParams, BikeState, LaserParams, LaserScanner, SensorParams,
};
use bikebot_geometry::{CurvePath, FergusonCurve, Point2, Pose2};
use bikebot_planner::{EndPose, GoalMode, GoalRegion, PlannerParams, PlanningProblem};
use bikebot_world::formats::{self, MapError, MapOptions, MapPose};
use bikebot_world::{Bounds, Footprint, Obstacle, OccupancyGrid, World, WorldError};
use std::str::FromStr;

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
    /// What is in the way; `None` where the scenario has no map.
    pub world: Option<World>,
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
    /// Laser.
    pub laser: LaserParams,
    /// Sensors.
    pub noise: SensorParams,
    /// Which model moves the bike.
    pub plant: PlantModel,
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

/// A map with the ends it may name.
#[derive(Default)]
struct Field {
    world: Option<World>,
    start: Option<MapPose>,
    goal: Option<MapPose>,
}

impl Resolver<'_> {
    fn resolve(mut self) -> Result<Setup, SetupError> {
        let scenario = self.scenario;
        let (step, control) = self.rates()?;
        let field = self.field()?;
        let laser = self.laser(control, field.world.is_some())?;
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
        let goal = self.goal(&field, &path)?;
        let (footprint, planning_footprint) = self.footprints()?;
        let (true_bike, mode_changes) = self.bike()?;
        Ok(Setup {
            name: scenario.name.clone(),
            seed: scenario.run.seed,
            world: field.world,
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
            laser,
            noise: scenario.noise,
            plant: scenario.plant.model,
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

    fn rates(&self) -> Result<(Period, Period), SetupError> {
        let plant = &self.scenario.plant;
        let period = |key: &str, seconds: f64| {
            Period::from_seconds(seconds).or_else(|_| {
                self.refuse(
                    key,
                    format!("`{key}` is {seconds} s, which is not a whole number of nanoseconds"),
                    "use a value such as 0.0025",
                )
            })
        };
        let step = period("plant.step_s", plant.step_s)?;
        let control = period("plant.control_s", plant.control_s)?;
        if let Err(ClockError::DoesNotDivide { .. }) = control.in_steps_of(step) {
            return self.refuse(
                "plant.step_s",
                format!(
                    "`plant.step_s` = {} does not divide `plant.control_s` = {}",
                    plant.step_s, plant.control_s
                ),
                "choose the step so that the control period is a whole number of steps, such as 0.0025 in 0.005",
            );
        }
        let ticks = SimTime::from_seconds(self.scenario.run.duration_s).nanoseconds()
            / control.nanoseconds();
        if ticks > MAX_TICKS {
            return self.refuse(
                "run.duration_s",
                format!(
                    "`run.duration_s` = {} holds {ticks} control periods of {} s",
                    self.scenario.run.duration_s, plant.control_s
                ),
                format!("a run has at most {MAX_TICKS}; shorten it, or control less often"),
            );
        }
        Ok((step, control))
    }

    /// The laser as it is mounted: a bike without a map has nothing to look at and carries none.
    fn laser(&mut self, control: Period, has_map: bool) -> Result<LaserParams, SetupError> {
        let laser = self.scenario.laser;
        if !laser.enabled {
            return Ok(laser);
        }
        if !has_map {
            if self.file.is_written("laser.enabled") {
                return self.refuse(
                    "laser.enabled",
                    "`laser.enabled` is true, but the scenario has no [map] to look at",
                    "add [map], or remove it",
                );
            }
            if self.file.is_written("laser") {
                self.warnings
                    .push("[laser] has no effect: the scenario has no [map] to look at".into());
            }
            return Ok(LaserParams {
                enabled: false,
                ..laser
            });
        }
        if let Err(error) = LaserScanner::new(&laser) {
            return self.refuse(
                "laser",
                format!("[laser]: {error}"),
                "see the keys of [laser] in `bikebot schema`",
            );
        }
        let divides =
            Period::from_hertz(laser.rate).is_ok_and(|scan| scan.in_steps_of(control).is_ok());
        if !divides {
            return self.refuse(
                "laser.rate_hz",
                format!(
                    "`laser.rate_hz` = {} does not fit the control period of {} s",
                    laser.rate,
                    control.seconds()
                ),
                "one scan has to take a whole number of control periods, such as 10, 20 or 40 Hz with 0.005 s; \
                 or set laser.enabled = false",
            );
        }
        Ok(laser)
    }

    /// Refuses what the start says about motions that the plant does not have.
    fn start_fits_the_plant(&self) -> Result<(), SetupError> {
        let start = &self.scenario.start;
        let (model, still): (PlantModel, &[(&str, f64)]) = match self.scenario.plant.model {
            PlantModel::Bike3d => (PlantModel::Bike3d, &[]),
            PlantModel::TwoLink => (
                PlantModel::TwoLink,
                &[
                    ("speed_mps", start.speed_mps),
                    ("steer_deg", start.steer_deg),
                ],
            ),
            PlantModel::Kinematic => (
                PlantModel::Kinematic,
                &[
                    ("roll_deg", start.roll_deg),
                    ("roll_rate_radps", start.roll_rate_radps),
                    ("balancer_rad", start.balancer_rad),
                    ("balancer_rate_radps", start.balancer_rate_radps),
                ],
            ),
        };
        for (key, value) in still {
            if *value != 0.0 {
                let what = if model == PlantModel::TwoLink {
                    "stands still"
                } else {
                    "does not roll"
                };
                return self.refuse(
                    &format!("start.{key}"),
                    format!(
                        "`start.{key}` is {value}, but `plant.model` = \"{}\" {what}",
                        model.name()
                    ),
                    "remove it, or choose plant.model = \"bike3d\"",
                );
            }
        }
        Ok(())
    }

    // --- the field -----------------------------------------------------------------------------

    fn field(&mut self) -> Result<Field, SetupError> {
        let Some(map) = &self.scenario.map else {
            return Ok(Field::default());
        };
        let mut field = Field::default();
        if let Some(name) = &map.file {
            let loaded = self.load_map(name)?;
            field.start = loaded.start;
            field.goal = loaded.goal;
            field.world = Some(loaded.world);
        } else if let Some(key) = (map.meters_per_cell.map(|_| "map.meters_per_cell"))
            .or(map.unknown_is_free.then_some("map.unknown_is_free"))
        {
            return self.refuse(
                key,
                format!("`{key}` is given without `map.file`"),
                "remove it, or name a map file",
            );
        }
        let shapes = self.shapes();
        if shapes.is_empty() && map.bounds_m.is_none() {
            if field.world.is_none() {
                return self.refuse(
                    "map",
                    "[map] has neither a file nor shapes",
                    "add `file = \"maps/…\"`, or `bounds_m = [min x, min y, max x, max y]` with [[map.disc]], [[map.polygon]] or [[map.box]]",
                );
            }
            return Ok(field);
        }
        let scale = if map.file.is_none() {
            map.scale.unwrap_or(1.0)
        } else {
            1.0
        };
        let (mut obstacles, grid, file_bounds): (
            Vec<Obstacle>,
            Option<OccupancyGrid>,
            Option<Bounds>,
        ) = match field.world.take() {
            Some(world) => (
                world.obstacles().to_vec(),
                world.grid().cloned(),
                Some(world.bounds()),
            ),
            None => (Vec::new(), None, None),
        };
        let bounds = match (map.bounds_m, file_bounds) {
            (Some([x0, y0, x1, y1]), _) => Bounds {
                min: Point2::new(x0 * scale, y0 * scale),
                max: Point2::new(x1 * scale, y1 * scale),
            },
            (None, Some(bounds)) => bounds,
            (None, None) => {
                return self.refuse(
                    "map",
                    "[map] has shapes but no field",
                    "add `bounds_m = [min x, min y, max x, max y]`",
                );
            }
        };
        if bounds.min.x >= bounds.max.x || bounds.min.y >= bounds.max.y {
            return self.refuse(
                "map.bounds_m",
                "`map.bounds_m` is empty: its second corner is not above and right of its first",
                "write it as [min x, min y, max x, max y]",
            );
        }
        obstacles.extend(
            shapes
                .into_iter()
                .map(|(_, obstacle)| obstacle.scaled(scale)),
        );
        match World::build(bounds, obstacles, grid) {
            Ok(world) => field.world = Some(world),
            Err(error) => return self.refuse_world(&error),
        }
        Ok(field)
    }

    fn shapes(&self) -> Vec<(String, Obstacle)> {
        let Some(map) = &self.scenario.map else {
            return Vec::new();
        };
        let point = |p: [f64; 2]| Point2::new(p[0], p[1]);
        let discs = map.disc.iter().enumerate().map(|(i, disc)| {
            (
                format!("map.disc.{i}"),
                Obstacle::Disc {
                    center: point(disc.center_m),
                    radius: disc.radius_m,
                },
            )
        });
        let polygons = map.polygon.iter().enumerate().map(|(i, polygon)| {
            (
                format!("map.polygon.{i}"),
                Obstacle::Polygon {
                    vertices: polygon.vertices_m.iter().copied().map(point).collect(),
                },
            )
        });
        let boxes = map.block.iter().enumerate().map(|(i, block)| {
            (
                format!("map.box.{i}"),
                Obstacle::Block {
                    min: point(block.min_m),
                    max: point(block.max_m),
                },
            )
        });
        discs.chain(polygons).chain(boxes).collect()
    }

    /// Names the shape a world would not take.
    fn refuse_world<T>(&self, error: &WorldError) -> Result<T, SetupError> {
        let field = Bounds {
            min: Point2::new(-1e9, -1e9),
            max: Point2::new(1e9, 1e9),
        };
        for (key, shape) in self.shapes() {
            if let Err(error) = World::build(field, vec![shape], None) {
                return self.refuse(
                    &key,
                    format!("`{key}`: {error}"),
                    "a shape has a positive area and does not cross itself",
                );
            }
        }
        self.refuse(
            "map",
            format!("[map]: {error}"),
            "see the shapes of the map",
        )
    }

    fn load_map(&mut self, name: &str) -> Result<formats::LoadedMap, SetupError> {
        let bytes = match (self.read)(name) {
            Ok(bytes) => bytes,
            Err(reason) => {
                return self.refuse(
                    "map.file",
                    format!("map file `{name}`: {reason}"),
                    "the path is relative to the scenario file",
                );
            }
        };
        let map = self.scenario.map.clone().unwrap_or_default();
        let options = MapOptions {
            meters_per_cell: map.meters_per_cell,
            scale: map.scale.unwrap_or(1.0),
            unknown_is_free: map.unknown_is_free,
        };
        self.files.push((name.to_owned(), bytes.clone()));
        let (read, files) = (&mut self.read, &mut self.files);
        // Files named inside a map are relative to the map.
        let folder = name
            .rsplit_once('/')
            .map_or(String::new(), |(folder, _)| format!("{folder}/"));
        let mut inner = |inside: &str| {
            let path = if inside.starts_with('/') {
                inside.to_owned()
            } else {
                format!("{folder}{inside}")
            };
            let bytes = read(&path)?;
            files.push((path, bytes.clone()));
            Ok(bytes)
        };
        let loaded =
            formats::load(name, &bytes, &options, &mut inner).map_err(|error| SetupError::Map {
                error: Box::new(error),
                key: "map.file",
            })?;
        // They name the file themselves.
        self.warnings.extend(loaded.warnings.iter().cloned());
        Ok(loaded)
    }

    // --- the ends --------------------------------------------------------------------------------

    fn start(
        &self,
        field: &Field,
        path: &PathSource,
    ) -> Result<(BikeState, Option<EndPose>), SetupError> {
        let start = &self.scenario.start;
        let end = match path {
            PathSource::Given(path) => Some(named(path.start_pose())),
            PathSource::Planned => field.start,
            PathSource::Standing => Some(named(Pose2::new(0.0, 0.0, 0.0))),
        };
        let coordinate =
            |written: Option<f64>, named: Option<f64>, key: &str| match written.or(named) {
                Some(value) => Ok(value),
                None => self.refuse(
                    "start",
                    format!("the scenario has no `{key}`"),
                    "add [start] with x_m, y_m and heading_deg: where the rear wheel stands",
                ),
            };
        let x = coordinate(start.x_m, end.map(|pose| pose.position.x), "start.x_m")?;
        let y = coordinate(start.y_m, end.map(|pose| pose.position.y), "start.y_m")?;
        // The heading a map or a path names belongs to the place it names. A place of one's own leaves the
        // heading free to the plan; on a given path there is only the path's.
        let is_named = start.x_m.is_none() && start.y_m.is_none() || *path != PathSource::Planned;
        let heading = start
            .heading_deg
            .map(f64::to_radians)
            .or(end.filter(|_| is_named).and_then(|pose| pose.heading));
        let state = BikeState {
            pose: Pose2::new(x, y, heading.unwrap_or(0.0)),
            steer: start.steer_deg.to_radians(),
            roll: start.roll_deg.to_radians(),
            balancer: start.balancer_rad,
            speed: start.speed_mps,
            roll_rate: start.roll_rate_radps,
            balancer_rate: start.balancer_rate_radps,
        };
        let pose = EndPose {
            position: Point2::new(x, y),
            heading,
            curvature: None,
        };
        Ok((state, Some(pose)))
    }

    fn goal(&self, field: &Field, path: &PathSource) -> Result<Option<GoalRegion>, SetupError> {
        let section = self.scenario.goal.clone().unwrap_or_default();
        let end = match path {
            PathSource::Given(path) => Some(named(path.end_pose())),
            PathSource::Planned => field.goal,
            PathSource::Standing => return Ok(None),
        };
        let missing = |key: &str| {
            self.refuse(
                "goal",
                format!("the scenario has no `{key}`"),
                "add [goal] with x_m and y_m: where the rear wheel shall stop; or a [path] to ride",
            )
        };
        let Some(x) = section.x_m.or(end.map(|pose| pose.position.x)) else {
            return missing("goal.x_m");
        };
        let Some(y) = section.y_m.or(end.map(|pose| pose.position.y)) else {
            return missing("goal.y_m");
        };
        let heading = section.heading_deg.map(f64::to_radians).or_else(|| {
            // A goal written without heading is free; one taken from the map keeps the map's.
            (section.x_m.is_none() && section.y_m.is_none())
                .then(|| end.and_then(|pose| pose.heading))
                .flatten()
        });
        let tolerance = match self.scenario.planner.goal {
            // The paper's ball 𝒳_goal has radius l = 3 · scale, unless the scenario says another.
            GoalMode::Ball if !self.file.is_written("goal.tolerance_m") => {
                self.scenario.planner.table_goal_tolerance()
            }
            GoalMode::Ball | GoalMode::Pose => section.tolerance_m,
        };
        Ok(Some(GoalRegion {
            position: Point2::new(x, y),
            heading,
            tolerance,
        }))
    }

    // --- the path --------------------------------------------------------------------------------

    fn path(&mut self) -> Result<PathSource, SetupError> {
        let scenario = self.scenario;
        let Some(section) = &scenario.path else {
            if scenario.plant.model == PlantModel::TwoLink {
                if scenario.goal.is_some() {
                    self.warnings.push(
                        "[goal] has no effect: `plant.model` = \"two_link\" stands still".into(),
                    );
                }
                return Ok(PathSource::Standing);
            }
            if scenario.map.is_none() {
                return self.refuse(
                    "name",
                    "the scenario has neither [map] nor [path], so there is nothing to ride",
                    "add [map] and [goal] to plan a path, or [path] to give one",
                );
            }
            return Ok(PathSource::Planned);
        };
        if scenario.plant.model == PlantModel::TwoLink {
            return self.refuse(
                "path",
                "[path] is given, but `plant.model` = \"two_link\" stands still",
                "remove [path], or choose plant.model = \"bike3d\"",
            );
        }
        let curves = match (&section.waypoints, &section.file) {
            (Some(waypoints), None) => self.through(waypoints, section)?,
            (None, Some(name)) => self.read_path(&name.clone(), section)?,
            (Some(_), Some(_)) => {
                return self.refuse(
                    "path.file",
                    "[path] has both `waypoints` and `file`",
                    "keep one of the two",
                );
            }
            (None, None) => {
                return self.refuse(
                    "path",
                    "[path] has neither `waypoints` nor `file`",
                    "add `waypoints = [[x_m, y_m, heading_deg], …]` or `file = \"plan.json\"`",
                );
            }
        };
        let key = if section.file.is_some() {
            "path.file"
        } else {
            "path.waypoints"
        };
        match CurvePath::new(curves) {
            Ok(path) if path.length() < FollowedPath::MIN_LENGTH => self.refuse(
                key,
                format!("`{key}`: the path is {} m long", path.length()),
                format!("a path to ride has at least {} m", FollowedPath::MIN_LENGTH),
            ),
            Ok(path) if path.length() <= MAX_PATH_LENGTH => Ok(PathSource::Given(path)),
            Ok(path) => self.refuse(
                key,
                format!("`{key}`: the path is {:.0} m long", path.length()),
                format!(
                    "a path to ride has at most {MAX_PATH_LENGTH} m; are its points in metres?"
                ),
            ),
            Err(error) => self.refuse(
                key,
                format!("`{key}`: {error}"),
                "neighbouring points must differ",
            ),
        }
    }

    fn through(
        &self,
        waypoints: &[[f64; 3]],
        section: &PathSection,
    ) -> Result<Vec<FergusonCurve>, SetupError> {
        let factor = section.tangent_per_chord.unwrap_or(1.2);
        let mut curves = Vec::with_capacity(waypoints.len());
        for (index, pair) in waypoints.windows(2).enumerate() {
            let pose = |p: [f64; 3]| Pose2::new(p[0], p[1], p[2].to_radians());
            let (from, to) = (pose(pair[0]), pose(pair[1]));
            let chord = (to.position - from.position).norm();
            if chord < 1e-6 {
                return self.refuse(
                    &format!("path.waypoints.{}", index + 1),
                    format!(
                        "way points {} and {} of `path.waypoints` are the same point",
                        index + 1,
                        index + 2
                    ),
                    "neighbouring way points must differ",
                );
            }
            curves.push(FergusonCurve::between(from, to, factor * chord));
        }
        Ok(curves)
    }

    fn read_path(
        &mut self,
        name: &str,
        section: &PathSection,
    ) -> Result<Vec<FergusonCurve>, SetupError> {
        let bytes = match (self.read)(name) {
            Ok(bytes) => bytes,
            Err(reason) => {
                return self.refuse(
                    "path.file",
                    format!("path file `{name}`: {reason}"),
                    "the path is relative to the scenario file",
                );
            }
        };
        if section.tangent_per_chord.is_some() && name.to_ascii_lowercase().ends_with(".json") {
            return self.refuse(
                "path.tangent_per_chord",
                format!("`path.tangent_per_chord` has no effect on `{name}`: a plan carries its own curves"),
                "remove it; it is for way points and centre lines",
            );
        }
        match path_file::parse(name, &bytes, section.tangent_per_chord.unwrap_or(1.0)) {
            Ok(curves) => {
                self.files.push((name.to_owned(), bytes));
                Ok(curves)
            }
            Err(PathFileError {
                message,
                line,
                help,
            }) => {
                let place = line.map_or(String::new(), |line| format!(":{line}"));
                self.refuse(
                    "path.file",
                    format!("path file `{name}{place}`: {message}"),
                    help,
                )
            }
        }
    }

    // --- the bike --------------------------------------------------------------------------------

    fn footprints(&self) -> Result<(Footprint, Footprint), SetupError> {
        let written = &self.scenario.planner.footprint;
        let footprint = match Footprint::from_str(written) {
            Ok(footprint) => footprint,
            Err(error) => {
                return self.refuse(
                    "planner.footprint",
                    format!("`planner.footprint` is \"{written}\": {}", error.problem),
                    "it may be \"bike\", \"point\", \"disc:0.4\", \"capsule:1.8x0.6\", \"box:1.8x0.6\" or vertices, [[x, y], …]",
                );
            }
        };
        let planning = if written.trim() == "bike" {
            // The rear contact cuts a corner of curvature σ by ℓ²σ/2 (docs/paper.md, D14).
            footprint.grown(
                0.5 * self.scenario.follow.look_ahead.powi(2) * self.scenario.planner.max_curvature,
            )
        } else {
            footprint.clone()
        };
        Ok((footprint, planning))
    }

    fn bike(&self) -> Result<(BikeParams, Vec<ScheduledModeChange>), SetupError> {
        let section = &self.scenario.bike;
        if let Err(error) = section.params.check() {
            return self.refuse(
                "bike",
                format!("[bike]: {error}"),
                "see docs/frames.md for the meaning of the lengths",
            );
        }
        let mut changes: Vec<ScheduledModeChange> = Vec::new();
        for (index, change) in section.mode_change.iter().enumerate() {
            let model = self.scenario.plant.model;
            if model != PlantModel::Bike3d {
                return self.refuse(
                    &format!("bike.mode_change.{index}"),
                    format!("`plant.model` = \"{}\" knows no mode change", model.name()),
                    "remove [[bike.mode_change]], or choose plant.model = \"bike3d\"",
                );
            }
            let condition = section.params.mode_change_is_possible();
            if !condition.is_met() {
                return self.refuse(
                    &format!("bike.mode_change.{index}"),
                    format!(
                        "this bike cannot change its mode while riding: the centre of percussion of its body lies at {:.3} m, \
                         not below {:.3} m, so the balance law loses its grip on the way",
                        condition.percussion_height, condition.bound
                    ),
                    "remove [[bike.mode_change]], or raise the pivot (l_m) or the balancer's inertia (i2x_kgm2)",
                );
            }
            if changes
                .last()
                .is_some_and(|last| change.time_s < last.time + last.duration)
            {
                return self.refuse(
                    &format!("bike.mode_change.{index}.time_s"),
                    format!(
                        "mode change {} begins before the one above it has ended",
                        index + 1
                    ),
                    "list them in order of time, each after the end of the last",
                );
            }
            changes.push(ScheduledModeChange {
                time: change.time_s,
                mode: change.mode,
                duration: change.duration_s,
            });
        }
        let mut truth = crate::scenario::to_table(&section.params);
        for (key, value) in &self.scenario.plant.bike.0 {
            truth.insert(key.clone(), value.clone());
        }
        let true_bike: BikeParams = match toml::Value::Table(truth).try_into() {
            Ok(params) => params,
            Err(error) => {
                return self.refuse(
                    "plant.bike",
                    format!("[plant.bike]: {error}"),
                    "it takes keys of [bike]",
                );
            }
        };
        if let Err(error) = true_bike.check() {
            return self.refuse(
                "plant.bike",
                format!("[plant.bike]: {error}"),
                "see docs/frames.md for the meaning of the lengths",
            );
        }
        let steer = self.scenario.start.steer_deg;
        if steer.abs() > true_bike.steer_max_deg {
            return self.refuse(
                "start.steer_deg",
                format!(
                    "`start.steer_deg` is {steer}, beyond the steering's stop at {} degrees",
                    true_bike.steer_max_deg
                ),
                "choose an angle within the stops, or set bike.steer_max_deg",
            );
        }
        Ok((true_bike, changes))
    }
}

/// An end that a path or the origin names, with its heading.
fn named(pose: Pose2) -> MapPose {
    MapPose {
        position: pose.position,
        heading: Some(pose.heading),
    }
}
