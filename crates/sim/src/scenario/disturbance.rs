//! `[[disturbance]]`: what the world does to the bike and what breaks on it, as written in a scenario.
//!
//! Every kind says how much, where on the bike, and when. *When* is a time (`time_s`) or a place
//! (`from_s_m`, arc length of the rear contact along the path); without either it begins with the ride.
//! It lasts `duration_s`, or until the rear contact has passed `to_s_m`, or to the end of the ride.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One `[[disturbance]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Disturbance {
    /// A push at a point of the frame.
    Push(PushSection),
    /// A steady roll moment, such as a load off centre.
    Moment(MomentSection),
    /// A climb or a descent.
    Slope(SlopeSection),
    /// Wind.
    Gust(GustSection),
    /// Ground with other friction than the bike's tyres expect.
    Friction(FrictionSection),
    /// Something on the bike breaks.
    Fault(FaultSection),
}

/// When a disturbance acts: the keys that all kinds share.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct When {
    /// Begins at this time, s.
    pub time: Option<f64>,
    /// Begins when the rear contact passes this arc length of the path, m.
    pub from_s: Option<f64>,
    /// Lasts this long, s.
    pub duration: Option<f64>,
    /// Ends when the rear contact passes this arc length of the path, m.
    pub to_s: Option<f64>,
}

/// Declares the section of one kind: its own keys and the four that say when.
macro_rules! section {
    (
        $(#[$about:meta])*
        $name:ident {
            $( $(#[$doc:meta])* $field:ident : $kind:ty = $default:expr ),* $(,)?
        }
        lasts $lasts:expr
    ) => {
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        $(#[$about])*
        pub struct $name {
            $( $(#[$doc])* pub $field: $kind, )*
            /// Begins at this time, s.
            #[serde(skip_serializing_if = "Option::is_none")]
            #[schemars(range(min = 0.0, max = 86400.0))]
            pub time_s: Option<f64>,
            /// Begins when the rear contact passes this arc length of the path, m.
            #[serde(skip_serializing_if = "Option::is_none")]
            #[schemars(range(min = 0.0, max = 1.0e6))]
            pub from_s_m: Option<f64>,
            /// Lasts this long, s.
            #[serde(skip_serializing_if = "Option::is_none")]
            #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 86400.0))]
            pub duration_s: Option<f64>,
            /// Ends when the rear contact passes this arc length of the path, m.
            #[serde(skip_serializing_if = "Option::is_none")]
            #[schemars(range(min = 0.0, max = 1.0e6))]
            pub to_s_m: Option<f64>,
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $( $field: $default, )*
                    time_s: None,
                    from_s_m: None,
                    duration_s: None,
                    to_s_m: None,
                }
            }
        }

        impl $name {
            fn when(&self) -> When {
                let lasts: Option<f64> = $lasts;
                When {
                    time: self.time_s,
                    from_s: self.from_s_m,
                    duration: self.duration_s.or(lasts.filter(|_| self.to_s_m.is_none())),
                    to_s: self.to_s_m,
                }
            }
        }
    };
}

/// How long a push lasts unless it says so, s.
const PUSH_DURATION: f64 = 0.1;
/// How long a gust lasts unless it says so, s.
const GUST_DURATION: f64 = 1.0;

section! {
    /// `kind = "push"`: a level force on a point of the frame; 0.1 s unless `duration_s` says otherwise.
    PushSection {
        /// Momentum it brings, N s: force times duration. Negative: the other way.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -1000.0, max = 1000.0))]
        impulse_ns: Option<f64> = None,
        /// Force, N, instead of the impulse.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -10000.0, max = 10000.0))]
        force_n: Option<f64> = None,
        /// How high up the frame it acts, m.
        #[schemars(range(min = 0.0, max = 3.0))]
        height_m: f64 = 0.6,
        /// How far ahead of the rear contact it acts, m. Left out: at the centre of gravity.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -2.0, max = 4.0))]
        ahead_m: Option<f64> = None,
        /// Where it drives the bike, from the heading, counter-clockwise, degrees: 90 to the left, -90 to the right.
        #[schemars(range(min = -360.0, max = 360.0))]
        direction_deg: f64 = -90.0,
    }
    lasts Some(PUSH_DURATION)
}

section! {
    /// `kind = "moment"`: a steady roll moment.
    MomentSection {
        /// Roll moment, N m, positive to the right.
        #[schemars(range(min = -1000.0, max = 1000.0))]
        moment_nm: f64 = 0.0,
    }
    lasts None
}

section! {
    /// `kind = "slope"`: the ground climbs in the direction of travel.
    SlopeSection {
        /// Rise over run: 0.05 climbs 5 %, -0.05 descends.
        #[schemars(range(min = -0.5, max = 0.5))]
        grade: f64 = 0.0,
    }
    lasts None
}

/// How a gust comes and goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GustProfile {
    /// Half of 1 − cos over its duration: none, the full force in the middle, none.
    #[default]
    OneMinusCosine,
    /// The full force from beginning to end.
    Constant,
}

section! {
    /// `kind = "gust"`: wind; 1 s unless `duration_s` says otherwise.
    GustSection {
        /// Greatest force, N.
        #[schemars(range(min = -10000.0, max = 10000.0))]
        force_n: f64 = 0.0,
        /// Height of its centre of pressure up the frame, m.
        #[schemars(range(min = 0.0, max = 3.0))]
        height_m: f64 = 0.6,
        /// How far ahead of the rear contact its centre of pressure lies, m. Left out: at the centre of gravity.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -2.0, max = 4.0))]
        ahead_m: Option<f64> = None,
        /// Where the wind blows to, in the world, from +x, counter-clockwise, degrees.
        #[schemars(range(min = -360.0, max = 360.0))]
        direction_deg: f64 = -90.0,
        /// How it comes and goes.
        profile: GustProfile = GustProfile::OneMinusCosine,
    }
    lasts Some(GUST_DURATION)
}

section! {
    /// `kind = "friction"`: ground with another coefficient of friction.
    FrictionSection {
        /// Coefficient of friction there: 0.05 is wet ice, 0.3 wet leaves.
        #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 5.0))]
        friction: f64 = 0.3,
        /// The ground it covers, `[min x, min y, max x, max y]`, m; judged for each wheel. Left out: all of it.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(inner(range(min = -1.0e6, max = 1.0e6)))]
        region_m: Option<[f64; 4]> = None,
    }
    lasts None
}

/// What on the bike a fault befalls: its motors and its sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultOf {
    /// The steering motor.
    #[default]
    Steering,
    /// The balancer motor.
    Balancer,
    /// The drive.
    Drive,
    /// The sensor of the roll angle.
    Roll,
    /// The gyro of the roll rate.
    RollRate,
    /// Roll and roll rate together.
    Imu,
    /// The sensor of the speed.
    Speed,
    /// The encoder of the steering: angle and rate.
    SteerEncoder,
    /// The encoder of the balancer: angle and rate.
    BalancerEncoder,
    /// The localiser.
    Pose,
}

impl FaultOf {
    /// The name as written in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Steering => "steering",
            Self::Balancer => "balancer",
            Self::Drive => "drive",
            Self::Roll => "roll",
            Self::RollRate => "roll_rate",
            Self::Imu => "imu",
            Self::Speed => "speed",
            Self::SteerEncoder => "steer_encoder",
            Self::BalancerEncoder => "balancer_encoder",
            Self::Pose => "pose",
        }
    }

    /// A motor, and not a sensor.
    #[must_use]
    pub fn is_motor(self) -> bool {
        matches!(self, Self::Steering | Self::Balancer | Self::Drive)
    }
}

/// What happens to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultIs {
    /// Steering or balancer do not move against the frame any more.
    #[default]
    Stuck,
    /// A motor follows its command through a first-order lag of `lag_s`, on top of its own.
    Lag,
    /// A motor gives no more than `limit_share` of what it could.
    Limit,
    /// A sensor repeats what it said last; a localiser with odometry goes on by that.
    Dropout,
    /// A sensor's reading is off by `bias_deg`, `bias_radps`, `bias_mps` or `bias_m`.
    Bias,
    /// A sensor says everything `delay_s` late.
    Delay,
}

impl FaultIs {
    /// The name as written in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stuck => "stuck",
            Self::Lag => "lag",
            Self::Limit => "limit",
            Self::Dropout => "dropout",
            Self::Bias => "bias",
            Self::Delay => "delay",
        }
    }
}

section! {
    /// `kind = "fault"`: a motor or a sensor breaks.
    // A fault of nothing in particular is a slip of the pen: which part it is has no default.
    #[schemars(extend("required" = ["of"]))]
    FaultSection {
        /// What breaks.
        of: FaultOf = FaultOf::Steering,
        /// How.
        is: FaultIs = FaultIs::Stuck,
        /// Time constant of a lag, s.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 10.0))]
        lag_s: Option<f64> = None,
        /// Share of the motor's limits that is left; 0 is dead.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0, max = 1.0))]
        limit_share: Option<f64> = None,
        /// How late a sensor is, s.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 5.0))]
        delay_s: Option<f64> = None,
        /// Bias of an angle (roll, steering, balancer, heading), degrees.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -180.0, max = 180.0))]
        bias_deg: Option<f64> = None,
        /// Bias of the roll rate, rad/s.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -10.0, max = 10.0))]
        bias_radps: Option<f64> = None,
        /// Bias of the speed, m/s.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -10.0, max = 10.0))]
        bias_mps: Option<f64> = None,
        /// Bias of the pose, m to the left of the heading.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -100.0, max = 100.0))]
        bias_m: Option<f64> = None,
    }
    lasts None
}

impl PushSection {
    /// The force, N: as given, or the impulse over the duration; zero where neither is.
    #[must_use]
    pub fn force(&self) -> f64 {
        self.force_n
            .or(self
                .impulse_ns
                .map(|impulse| impulse / self.duration_s.unwrap_or(PUSH_DURATION)))
            .unwrap_or(0.0)
    }
}

impl Disturbance {
    /// The kind as written in a scenario.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Push(_) => "push",
            Self::Moment(_) => "moment",
            Self::Slope(_) => "slope",
            Self::Gust(_) => "gust",
            Self::Friction(_) => "friction",
            Self::Fault(_) => "fault",
        }
    }

    /// When it acts.
    #[must_use]
    pub fn when(&self) -> When {
        match self {
            Self::Push(section) => section.when(),
            Self::Moment(section) => section.when(),
            Self::Slope(section) => section.when(),
            Self::Gust(section) => section.when(),
            Self::Friction(section) => section.when(),
            Self::Fault(section) => section.when(),
        }
    }

    /// Its size in its own unit (N s, N, N m, rise over run, coefficient), for events; NaN where there is none.
    #[must_use]
    pub fn size(&self) -> f64 {
        match self {
            Self::Push(push) => push.impulse_ns.unwrap_or_else(|| push.force()),
            Self::Moment(moment) => moment.moment_nm,
            Self::Slope(slope) => slope.grade,
            Self::Gust(gust) => gust.force_n,
            Self::Friction(friction) => friction.friction,
            Self::Fault(fault) => [
                fault.lag_s,
                fault.limit_share,
                fault.delay_s,
                fault.bias_deg,
                fault.bias_radps,
                fault.bias_mps,
                fault.bias_m,
            ]
            .into_iter()
            .flatten()
            .next()
            .unwrap_or(f64::NAN),
        }
    }

    /// What it is, in a few words, for events.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Push(push) => match push.impulse_ns {
                Some(impulse) => format!("a push of {impulse} N s"),
                None => format!("a push of {} N", push.force()),
            },
            Self::Moment(moment) => format!("a roll moment of {} N m", moment.moment_nm),
            Self::Slope(slope) => format!("a slope of {} %", 100.0 * slope.grade),
            Self::Gust(gust) => format!("a gust of {} N", gust.force_n),
            Self::Friction(friction) => format!("ground of friction {}", friction.friction),
            Self::Fault(fault) => match fault.is {
                FaultIs::Stuck => format!("a fault: {} stuck", fault.of.name()),
                is => format!("a fault: {} of {}", is.name(), fault.of.name()),
            },
        }
    }
}
