//! The scenario file, format 1: exactly what was written, with every default filled.
//!
//! A scenario is TOML. [`ScenarioFile::parse`] takes the text and the overrides of the
//! command line, refuses what the schema does not know or allow, and remembers where
//! each value came from. What the values *mean* (maps read, degrees turned into
//! radians, rates checked) is the business of [`crate::setup`].
//!
//! The sections of the file are the parameter structs of the crates that use them, so
//! each number, its unit, its range and its default have one definition.

pub mod disturbance;
mod document;
pub mod obstacle;
mod schema;
mod schema_check;

pub use disturbance::Disturbance;
pub(crate) use document::to_table;
pub use document::{Explained, Origin, Override, ScenarioError, ScenarioFile};
pub use obstacle::{ObstacleSection, Repeat};
pub use schema::json_schema;

use crate::online::OnlineParams;
use crate::outcome::Expect;
use crate::record::RecordOptions;
use bikebot_control::{BalanceParams, FollowParams, SupervisorParams};
use bikebot_dynamics::{BalancerMode, BikeParams, LaserParams, SensorParams, SteeringGeometry};
use bikebot_mapping::MapperParams;
use bikebot_planner::PlannerParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest scenario text that is read, bytes.
pub const MAX_SCENARIO_BYTES: usize = 1 << 20;

/// A scenario: one ride (or one plan) with everything that decides its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "bikebot scenario")]
pub struct Scenario {
    /// Version of this file format; this program reads 1.
    #[schemars(range(min = 1, max = 1))]
    pub format: u32,
    /// Name of the scenario, used in the names of recordings.
    #[schemars(length(min = 1, max = 80))]
    pub name: String,
    /// The field: a map file, shapes, or both. May be absent with `[path]` or the `two_link` plant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapSection>,
    /// Where and how the bike starts.
    #[serde(default)]
    pub start: StartSection,
    /// Where it shall stop. May be absent with `[path]` or the `two_link` plant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<GoalSection>,
    /// The bike as the controller believes it to be.
    #[serde(default)]
    pub bike: BikeSection,
    /// How a path is planned.
    #[serde(default)]
    pub planner: PlannerParams,
    /// A given path, ridden instead of planning one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathSection>,
    /// Path following.
    #[serde(default)]
    pub follow: FollowParams,
    /// Balance.
    #[serde(default)]
    pub balance: BalanceParams,
    /// Watching the margins while riding.
    #[serde(default)]
    pub supervisor: SupervisorParams,
    /// Laser range finder.
    #[serde(default)]
    pub laser: LaserParams,
    /// How the laser's scans become a map where the bike does not know its field.
    #[serde(default)]
    pub mapper: MapperParams,
    /// Planning while riding, from what the laser has shown.
    #[serde(default)]
    pub online: OnlineParams,
    /// What stands or moves in the field beside the map.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 1000))]
    pub obstacle: Vec<ObstacleSection>,
    /// The simulated truth.
    #[serde(default)]
    pub plant: PlantSection,
    /// Imperfections of the sensors.
    #[serde(default)]
    pub noise: SensorParams,
    /// Pushes, moments, slopes, gusts, slippery ground and faults, on the simulated truth only.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 1000))]
    pub disturbance: Vec<Disturbance>,
    /// Duration and seed.
    #[serde(default)]
    pub run: RunSection,
    /// How densely the run is recorded.
    #[serde(default)]
    pub record: RecordOptions,
    /// What the run has to show; the verdict is part of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expect: Option<Expect>,
}

/// `[map]`: what is in the way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapSection {
    /// Map file, relative to the scenario: map_server YAML, PNG, PGM, BMP, MovingAI `.map`, or a
    /// polygon scene `.json`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Side of a cell, m; only for formats that do not say.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 1000.0))]
    pub meters_per_cell: Option<f64>,
    /// Stretches the map to bike scale, factor: the file where there is one (shapes beside it are in metres
    /// of the stretched map), else the shapes and their field.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 1000.0))]
    pub scale: Option<f64>,
    /// Whether the planner is given the map. `false`: it knows the field's extent and what the laser shows while riding, no more.
    #[serde(skip_serializing_if = "Clone::clone")]
    pub known: bool,
    /// Reads unknown cells of a grid map as free instead of solid.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub unknown_is_free: bool,
    /// Field of a map made of shapes: `[min x, min y, max x, max y]`, m. Its edge is a wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1.0e6, max = 1.0e6)))]
    pub bounds_m: Option<[f64; 4]>,
    /// Round obstacles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub disc: Vec<DiscShape>,
    /// Polygonal obstacles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub polygon: Vec<PolygonShape>,
    /// Axis-aligned boxes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[serde(rename = "box")]
    pub block: Vec<BoxShape>,
}

impl Default for MapSection {
    fn default() -> Self {
        Self {
            file: None,
            meters_per_cell: None,
            scale: None,
            known: true,
            unknown_is_free: false,
            bounds_m: None,
            disc: Vec::new(),
            polygon: Vec::new(),
            block: Vec::new(),
        }
    }
}

/// `[[map.disc]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DiscShape {
    /// Centre `[x, y]`, m.
    #[schemars(inner(range(min = -1.0e6, max = 1.0e6)))]
    pub center_m: [f64; 2],
    /// Radius, m.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 1.0e6))]
    pub radius_m: f64,
}

/// `[[map.polygon]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PolygonShape {
    /// Corners `[[x, y], …]` of a simple polygon in either orientation, m.
    #[schemars(length(min = 3, max = 10000), inner(inner(range(min = -1.0e6, max = 1.0e6))))]
    pub vertices_m: Vec<[f64; 2]>,
}

/// `[[map.box]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxShape {
    /// Lower left corner `[x, y]`, m.
    #[schemars(inner(range(min = -1.0e6, max = 1.0e6)))]
    pub min_m: [f64; 2],
    /// Upper right corner `[x, y]`, m.
    #[schemars(inner(range(min = -1.0e6, max = 1.0e6)))]
    pub max_m: [f64; 2],
}

/// `[start]`: the state at time zero. Position and heading are those of the rear contact.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StartSection {
    /// Rear contact, x, m. Taken from the map or the path where they say it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1.0e6, max = 1.0e6))]
    pub x_m: Option<f64>,
    /// Rear contact, y, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1.0e6, max = 1.0e6))]
    pub y_m: Option<f64>,
    /// Heading, counter-clockwise from +x, degrees. Left out in a scenario that is only planned: free.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub heading_deg: Option<f64>,
    /// Speed of the rear contact, m/s.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub speed_mps: f64,
    /// Roll α, positive to the right, degrees.
    #[schemars(range(min = -40.0, max = 40.0))]
    pub roll_deg: f64,
    /// Roll rate, rad/s.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub roll_rate_radps: f64,
    /// Balancer angle β relative to the frame, rad.
    #[schemars(range(min = -100.0, max = 100.0))]
    pub balancer_rad: f64,
    /// Balancer speed, rad/s.
    #[schemars(range(min = -100.0, max = 100.0))]
    pub balancer_rate_radps: f64,
    /// Ground-projected steering angle ψ, positive to the left, degrees.
    #[schemars(range(min = -60.0, max = 60.0))]
    pub steer_deg: f64,
}

/// `[goal]`: where the rear contact shall come to rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GoalSection {
    /// x, m. Taken from the map where it says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1.0e6, max = 1.0e6))]
    pub x_m: Option<f64>,
    /// y, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1.0e6, max = 1.0e6))]
    pub y_m: Option<f64>,
    /// Heading at the goal, degrees; left out: any heading.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub heading_deg: Option<f64>,
    /// How far from the goal point the rear contact may stop, m.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 100.0))]
    pub tolerance_m: f64,
}

impl Default for GoalSection {
    fn default() -> Self {
        Self {
            x_m: None,
            y_m: None,
            heading_deg: None,
            tolerance_m: 0.3,
        }
    }
}

/// `[bike]`: a named parameter set, single values of which may be overridden here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(extend("additionalProperties" = false))]
pub struct BikeSection {
    /// Named parameter set: "default" or "low_pivot".
    pub preset: String,
    /// Where the balancer's centre of gravity sits: "flywheel" (on the pivot) or "balancer" (offset).
    pub mode: BalancerMode,
    /// Mode changes while riding.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mode_change: Vec<ModeChange>,
    /// The parameters themselves.
    #[serde(flatten)]
    pub params: BikeParams,
}

impl Default for BikeSection {
    fn default() -> Self {
        Self {
            preset: "default".into(),
            mode: BalancerMode::Flywheel,
            mode_change: Vec::new(),
            params: BikeParams::default(),
        }
    }
}

/// `[[bike.mode_change]]`: shift the balancer's centre of gravity while riding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModeChange {
    /// When the shift may begin, s; it waits until the bike is calm enough.
    #[schemars(range(min = 0.0, max = 86400.0))]
    pub time_s: f64,
    /// The mode to change to.
    pub mode: BalancerMode,
    /// How long the shift takes, s. Below a second the shift motor shakes the balance.
    #[schemars(range(min = 1.0, max = 60.0))]
    pub duration_s: f64,
}

/// `[path]`: a given path for the rear contact, instead of planning.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PathSection {
    /// Way points `[[x_m, y_m, heading_deg], …]`, joined by Ferguson-Coons curves.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2, max = 10000), inner(inner(range(min = -1.0e6, max = 1.0e6))))]
    pub waypoints: Option<Vec<[f64; 3]>>,
    /// Length of the end tangents as a multiple of the chord (the paper's `k` over the chord).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub tangent_per_chord: Option<f64>,
    /// Refit the path by a curve with continuous curvature through points of it this far apart, m. Without
    /// it the path is ridden as given, and its jumps of curvature become ramps.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.05, max = 100.0))]
    pub refit_spacing_m: Option<f64>,
    /// A path file, relative to the scenario: `plan.json` as written by `bikebot plan -o`, or a
    /// centre line `.csv` with columns x, y in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

/// `[plant]`: the simulated truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlantSection {
    /// Which model moves the bike.
    pub model: PlantModel,
    /// How "rapier3d" hangs its front wheel: "matched" (no trail, a vertical axis, light wheels, as the simplified
    /// model has it) or "realistic" (an electric bicycle's trail, head angle, wheels and fork).
    pub steering_geometry: SteeringGeometry,
    /// Integration step, s; must divide the control period. Left out: 0.0025, with "rapier3d" 0.001.
    #[schemars(range(min = 1.0e-5, max = 0.05))]
    pub step_s: f64,
    /// Control period, s.
    #[schemars(range(min = 1.0e-4, max = 0.1))]
    pub control_s: f64,
    /// What the true bike differs in from what the controller believes: keys of `[bike]`.
    #[serde(skip_serializing_if = "BikeDifference::is_empty")]
    pub bike: BikeDifference,
}

impl Default for PlantSection {
    fn default() -> Self {
        Self {
            model: PlantModel::Bike3d,
            steering_geometry: SteeringGeometry::Matched,
            step_s: 0.0025,
            control_s: 0.005,
            bike: BikeDifference::default(),
        }
    }
}

/// The models a scenario can ride on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlantModel {
    /// The simplified 3D bike with contact forces.
    Bike3d,
    /// Roll and balancer only, standing still.
    TwoLink,
    /// No-slip plane motion only; cannot fall.
    Kinematic,
    /// Rigid bodies, joints and wheel contact in the Rapier engine, with the obstacles as bodies.
    Rapier3d,
}

impl PlantModel {
    /// The name as written in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Bike3d => "bike3d",
            Self::TwoLink => "two_link",
            Self::Kinematic => "kinematic",
            Self::Rapier3d => "rapier3d",
        }
    }

    /// The integration step a scenario gets that does not say one, s. Runge–Kutta is exact to 10⁻⁹ at 2.5 ms;
    /// the rigid bodies are of first order, and 1 ms is what their figures are measured at.
    #[must_use]
    pub fn default_step(self) -> f64 {
        match self {
            Self::Rapier3d => 0.001,
            Self::Bike3d | Self::TwoLink | Self::Kinematic => 0.0025,
        }
    }
}

/// `[plant.bike]`: single parameters in which the true bike differs from `[bike]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct BikeDifference(pub toml::Table);

impl BikeDifference {
    /// No difference: the true bike is the believed one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl JsonSchema for BikeDifference {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "BikeDifference".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        generator.subschema_for::<BikeParams>()
    }
}

/// `[run]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RunSection {
    /// Simulated time after which the run ends as timed out, s.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 86400.0))]
    pub duration_s: f64,
    /// Seed of every random choice: planner, sensors, laser. A scenario has one result per seed.
    #[schemars(range(min = 0, max = 9_223_372_036_854_775_807u64))]
    pub seed: u64,
}

impl Default for RunSection {
    fn default() -> Self {
        Self {
            duration_s: 60.0,
            seed: 1,
        }
    }
}
