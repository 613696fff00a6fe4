//! Tunables of the follower and of the balancer: the scenario's `[follow]` and `[balance]`.

use nalgebra::Vector4;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::lqr::Weights;
use bikebot_dynamics::BalancerMode;

/// Which law follows the path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FollowController {
    /// Passive velocity field control of a point ahead of the rear contact.
    #[default]
    Pvfc,
    /// Pure pursuit: the rear contact steers along the circle through a point of the curve ahead.
    PurePursuit,
    /// Stanley: the front wheel is steered along the curve and against its distance from it.
    Stanley,
    /// Linear-quadratic feedback of lateral and heading error of the rear contact, with curvature
    /// feed-forward.
    Lqr,
}

/// Pure pursuit: the scenario's `[follow.pure_pursuit]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PurePursuitParams {
    /// `L_0`, m: how far ahead on the curve the pursued point lies at standstill. Shorter follows
    /// closer and swings sooner.
    #[serde(rename = "distance_m")]
    #[schemars(range(min = 0.05, max = 20.0))]
    pub distance: f64,
    /// `T_L`, s: the pursued point moves ahead by the speed times this.
    #[serde(rename = "time_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub time: f64,
    /// `k_psi`, 1/s: how fast the steering turns to the angle that is wanted.
    #[serde(rename = "steering_gain_per_s")]
    #[schemars(range(min = 0.5, max = 50.0))]
    pub steering_gain: f64,
}

impl Default for PurePursuitParams {
    fn default() -> Self {
        Self {
            distance: 0.3,
            time: 0.15,
            steering_gain: 10.0,
        }
    }
}

/// The Stanley law: the scenario's `[follow.stanley]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StanleyParams {
    /// `k`, 1/s: how hard the front wheel steers against its distance from the curve.
    #[serde(rename = "gain_per_s")]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub gain: f64,
    /// `v_0`, m/s: softens the law at low speed.
    #[serde(rename = "softening_mps")]
    #[schemars(range(min = 0.01, max = 5.0))]
    pub softening: f64,
    /// `k_psi`, 1/s: how fast the steering turns to the angle that is wanted.
    #[serde(rename = "steering_gain_per_s")]
    #[schemars(range(min = 0.5, max = 50.0))]
    pub steering_gain: f64,
}

impl Default for StanleyParams {
    fn default() -> Self {
        Self {
            gain: 4.0,
            softening: 0.3,
            steering_gain: 20.0,
        }
    }
}

/// Linear-quadratic path following: the scenario's `[follow.lqr]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LateralLqrParams {
    /// `q_e`: weight on the lateral error, 1/m^2.
    #[serde(rename = "lateral_weight_per_m2")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub lateral: f64,
    /// `q_theta`: weight on the heading error, 1/rad^2.
    #[serde(rename = "heading_weight_per_rad2")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub heading: f64,
    /// `r`: weight on the steering beyond the feed-forward, 1/rad^2.
    #[serde(rename = "steer_weight_per_rad2")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub steer: f64,
    /// How far ahead the curvature of the feed-forward is read, s: the lag of the steering.
    #[serde(rename = "lead_s")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub lead: f64,
    /// `k_psi`, 1/s: how fast the steering turns to the angle that is wanted.
    #[serde(rename = "steering_gain_per_s")]
    #[schemars(range(min = 0.5, max = 50.0))]
    pub steering_gain: f64,
}

impl Default for LateralLqrParams {
    fn default() -> Self {
        Self {
            lateral: 25.0,
            heading: 1.0,
            steer: 1.0,
            lead: 0.1,
            steering_gain: 10.0,
        }
    }
}

/// Which point of the bike is to stay on the planned path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Track {
    /// The rear contact: the followed curve is where the follower's own point is while the rear
    /// contact rides a smoothed version of the planned path. Curvature jumps of the plan
    /// become ramps that the steering can follow, and the rear does not cut corners.
    #[default]
    RearContact,
    /// The follower's own point: the planned path is the followed curve as it stands, and the
    /// rear contact of a point `ell` ahead cuts corners by about `ell^2 curvature / 2`.
    LookAheadPoint,
}

/// Following a path: the scenario's `[follow]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FollowParams {
    /// Which law follows the path.
    pub controller: FollowController,
    /// Which point of the bike is to stay on the planned path.
    pub track: Track,
    /// Highest speed of the followed point, m/s.
    #[serde(rename = "max_speed_mps")]
    #[schemars(range(min = 0.2, max = 10.0))]
    pub max_speed: f64,
    /// Highest lateral acceleration in a corner, m/s^2; half the friction limit caps it. 0.8 leans
    /// the bike by 4.7 deg.
    #[serde(rename = "lateral_acceleration_max_mps2")]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub lateral_acceleration: f64,
    /// Speeding up and slowing down along the path, m/s^2.
    #[serde(rename = "longitudinal_acceleration_mps2")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub longitudinal_acceleration: f64,
    /// Speed of the profile at both ends of the path, m/s; braking takes over from there.
    #[serde(rename = "end_speed_mps")]
    #[schemars(range(min = 0.1, max = 1.0))]
    pub end_speed: f64,
    /// Deceleration of the final braking, m/s^2: 0.3 m/s are gone within 9 cm by default.
    #[serde(rename = "braking_deceleration_mps2")]
    #[schemars(range(min = 0.1, max = 1.0))]
    pub braking_deceleration: f64,
    /// `ell`, m: how far ahead of the rear contact the followed point lies. Shorter cuts corners less
    /// and asks more of the steering.
    #[serde(rename = "look_ahead_m")]
    #[schemars(range(min = 0.15, max = 2.0))]
    pub look_ahead: f64,
    /// Window over which the curvature of feed-forward is averaged when the look-ahead point itself
    /// follows the plan, m.
    #[serde(rename = "curvature_window_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub curvature_window: f64,
    /// Window over which the planned path is averaged before the rear contact rides it, m: a jump of
    /// curvature becomes a ramp of this length. 0.6 m moves a corner of 0.8 1/m by 13 mm.
    #[serde(rename = "smoothing_window_m")]
    #[schemars(range(min = 0.05, max = 2.0))]
    pub smoothing_window: f64,
    /// Share of the greatest steering rate that the speed profile may use on such a ramp.
    #[serde(rename = "steer_rate_share")]
    #[schemars(range(min = 0.1, max = 1.0))]
    pub steer_rate_share: f64,
    /// `Gamma`, 1/s: how fast the field closes the contour error.
    #[serde(rename = "contour_gain_per_s")]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub contour_gain: f64,
    /// `Gamma_s`, 1/s: how much the virtual time waits for a bike that lags.
    #[serde(rename = "virtual_time_gain_per_s")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub virtual_time_gain: f64,
    /// `e_max`, m: beyond this distance the pull of the field stays constant.
    #[serde(rename = "error_max_m")]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub error_max: f64,
    /// `gamma`: strength of the coupling that turns the velocity into the field, s/(kg m^2).
    #[serde(rename = "coupling_gain")]
    #[schemars(range(min = 0.001, max = 0.2))]
    pub coupling_gain: f64,
    /// `k_E`, 1/s: how fast the energy level is restored; zero never restores it, and stops on a climb.
    #[serde(rename = "energy_gain_per_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub energy_gain: f64,
    /// Take the energy that restores the level from a tank with a finite content, which is filled by what is
    /// taken off too high a level: strictly passive. Without it the energy regulator may inject what it likes.
    #[serde(rename = "energy_tank")]
    pub energy_tank: bool,
    /// Energy in the tank at the start, J: what the ride may cost beyond what the surroundings give. A climb of
    /// 5 % takes 5 J, until the drive observer has found it.
    #[serde(rename = "energy_tank_start_j")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tank_start: f64,
    /// Most energy the tank holds, J; what comes beyond it is given up.
    #[serde(rename = "energy_tank_capacity_j")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tank_capacity: f64,
    /// `beta`: speed level, the velocity settles at this multiple of the field.
    #[serde(rename = "speed_level")]
    #[schemars(range(min = 0.2, max = 2.0))]
    pub speed_level: f64,
    /// Energy of the field as a multiple of the least that it needs.
    #[serde(rename = "energy_margin")]
    #[schemars(range(min = 1.05, max = 10.0))]
    pub energy_margin: f64,
    /// `m_p`, kg: mass of the followed point in the augmented system.
    #[serde(rename = "point_mass_kg")]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub point_mass: f64,
    /// `m_s`, kg: inertia of the virtual time.
    #[serde(rename = "virtual_mass_kg")]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub virtual_mass: f64,
    /// `m_f`, kg: inertia of the fictitious flywheel.
    #[serde(rename = "flywheel_mass_kg")]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub flywheel_mass: f64,
    /// Lowest speed the steering law divides by, m/s: what makes a start from rest possible.
    #[serde(rename = "steering_speed_floor_mps")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub steering_speed_floor: f64,
    /// Greatest commanded acceleration, m/s^2.
    #[serde(rename = "drive_acceleration_max_mps2")]
    #[schemars(range(min = 0.1, max = 3.0))]
    pub drive_acceleration: f64,
    /// Greatest commanded deceleration, m/s^2.
    #[serde(rename = "drive_deceleration_max_mps2")]
    #[schemars(range(min = 0.1, max = 3.0))]
    pub drive_deceleration: f64,
    /// `w_o`, 1/s: poles of the drive observer, which takes up slopes and drag.
    #[serde(rename = "drive_observer_per_s")]
    #[schemars(range(min = 0.0, max = 20.0))]
    pub drive_observer_rate: f64,
    /// `k_v`, 1/s: how fast pure pursuit, Stanley and LQR correct the speed.
    #[serde(rename = "speed_gain_per_s")]
    #[schemars(range(min = 0.1, max = 20.0))]
    pub speed_gain: f64,
    /// Pure pursuit.
    pub pure_pursuit: PurePursuitParams,
    /// The Stanley law.
    pub stanley: StanleyParams,
    /// Linear-quadratic path following.
    pub lqr: LateralLqrParams,
}

impl Default for FollowParams {
    fn default() -> Self {
        Self {
            controller: FollowController::Pvfc,
            track: Track::RearContact,
            max_speed: 1.5,
            lateral_acceleration: 0.8,
            longitudinal_acceleration: 0.3,
            end_speed: 0.3,
            braking_deceleration: 0.5,
            look_ahead: 0.5,
            curvature_window: 0.3,
            smoothing_window: 0.6,
            steer_rate_share: 0.85,
            contour_gain: 1.2,
            virtual_time_gain: 0.6,
            error_max: 0.5,
            coupling_gain: 0.04,
            energy_gain: 1.0,
            energy_tank: true,
            tank_start: 20.0,
            tank_capacity: 40.0,
            speed_level: 1.0,
            energy_margin: 1.5,
            point_mass: 50.0,
            virtual_mass: 25.0,
            flywheel_mass: 25.0,
            steering_speed_floor: 0.25,
            drive_acceleration: 0.8,
            drive_deceleration: 1.0,
            drive_observer_rate: 4.0,
            speed_gain: 2.0,
            pure_pursuit: PurePursuitParams::default(),
            stanley: StanleyParams::default(),
            lqr: LateralLqrParams::default(),
        }
    }
}

/// Which law keeps the bike upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BalanceLawKind {
    /// Output zeroing with one-dimensional zero dynamics.
    #[default]
    OutputZeroing,
    /// Linear-quadratic feedback of the upright linearisation.
    Lqr,
    /// Prediction over a second with the limits of torque and speed: recovers from more than the
    /// other two, and costs some 30 µs a tick.
    Mpc,
}

/// Keeping the bike upright: the scenario's `[balance]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BalanceParams {
    /// Which law keeps the bike upright.
    pub controller: BalanceLawKind,
    /// Lean into a turn before it comes; without it the balancer has to hold the turn for a moment,
    /// which balancer mode does not survive.
    pub preview: bool,
    /// Estimate and compensate a constant roll moment (wind, a load off centre, a biased roll sensor).
    pub observer: bool,
    /// Steer into a fall as a last resort; costs path accuracy. With `output_zeroing` and `lqr`
    /// only of use in flywheel mode; `mpc` plans it together with the torque, in both.
    pub steering_assist: bool,
    /// `kappa`, 1/s: rate at which balancer angle and momentum return once the output is zero.
    #[serde(rename = "kappa_per_s")]
    #[schemars(range(min = 0.1, max = 5.0))]
    pub kappa: f64,
    /// Output poles `p1, p2, p3`, 1/s, positive; faster ones saturate the torque earlier.
    #[serde(rename = "poles_per_s")]
    #[schemars(inner(range(min = 0.5, max = 20.0)))]
    pub poles: [f64; 3],
    /// `q`, 1/s: poles of the roll-moment observer.
    #[serde(rename = "observer_per_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub observer_rate: f64,
    /// Greatest roll moment the observer may claim, N m.
    #[serde(rename = "observer_moment_max_nm")]
    #[schemars(range(min = 0.0, max = 200.0))]
    pub observer_moment_max: f64,
    /// Time step of the lean preview, s.
    #[serde(rename = "preview_step_s")]
    #[schemars(range(min = 0.005, max = 0.2))]
    pub preview_step: f64,
    /// Number of steps of the lean preview; together 1.8 s by default, 6.5 toppling times.
    #[schemars(range(min = 5, max = 400))]
    pub preview_steps: u32,
    /// Control ticks between two previews.
    #[schemars(range(min = 1, max = 100))]
    pub preview_ticks: u32,
    /// Over how long what the preview did not foresee (a late pose, a push off the path) enters the lean
    /// reference, s; zero lets it jump.
    #[serde(rename = "preview_settling_s")]
    #[schemars(range(min = 0.0, max = 0.2))]
    pub preview_settling: f64,
    /// Share of the upright decoupling term below which linear-quadratic feedback takes over.
    #[serde(rename = "decoupling_guard")]
    #[schemars(range(min = 0.0, max = 0.9))]
    pub decoupling_guard: f64,
    /// Linear-quadratic weight on the roll, 1/rad^2.
    #[serde(rename = "lqr_roll_weight")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub lqr_roll: f64,
    /// Linear-quadratic weight on the balancer angle in flywheel mode, 1/rad^2.
    #[serde(rename = "lqr_balancer_weight_flywheel")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub lqr_balancer_flywheel: f64,
    /// Linear-quadratic weight on the balancer angle in balancer mode, 1/rad^2.
    #[serde(rename = "lqr_balancer_weight_balancer")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub lqr_balancer_balancer: f64,
    /// Linear-quadratic weight on the roll rate, s^2/rad^2.
    #[serde(rename = "lqr_roll_rate_weight")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub lqr_roll_rate: f64,
    /// Linear-quadratic weight on the balancer rate, s^2/rad^2.
    #[serde(rename = "lqr_balancer_rate_weight")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub lqr_balancer_rate: f64,
    /// Linear-quadratic weight on the torque, 1/(N m)^2.
    #[serde(rename = "lqr_torque_weight")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub lqr_torque: f64,
    /// Predictive law: weight on the lean, 1/(s^4 rad^2), beside the squared balancer acceleration.
    /// It hardly matters below 1e5: the lean has to vanish anyway.
    #[serde(rename = "mpc_lean_weight")]
    #[schemars(range(min = 1.0, max = 1e7))]
    pub mpc_lean: f64,
    /// Predictive law: weight on the balancer angle in flywheel mode, 1/s^4; its fourth root is
    /// about the rate of the return.
    #[serde(rename = "mpc_balancer_weight_flywheel")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub mpc_balancer_flywheel: f64,
    /// Predictive law: weight on the balancer angle in balancer mode, 1/s^4.
    #[serde(rename = "mpc_balancer_weight_balancer")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub mpc_balancer_balancer: f64,
    /// Predictive law: weight on the balancer rate in flywheel mode, 1/s^2; more is stiffer and
    /// answers more to sensor noise.
    #[serde(rename = "mpc_balancer_rate_weight_flywheel")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub mpc_rate_flywheel: f64,
    /// Predictive law: weight on the balancer rate in balancer mode, 1/s^2.
    #[serde(rename = "mpc_balancer_rate_weight_balancer")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub mpc_rate_balancer: f64,
    /// `k_a`, 1/s: gain of the steering assist.
    #[serde(rename = "assist_gain_per_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub assist_gain: f64,
    /// Dead zone of the steering assist, rad of the divergent component of the roll.
    #[serde(rename = "assist_dead_zone_rad")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub assist_dead_zone: f64,
    /// Predictive law: price on steering in flywheel mode, 1/s^3 per rad of steering: high enough to
    /// be left alone while the balancer can do without.
    #[serde(rename = "assist_price_flywheel")]
    #[schemars(range(min = 1.0, max = 1e8))]
    pub assist_price_flywheel: f64,
    /// Predictive law: price on steering in balancer mode, 1/s^3 per rad of steering: low, because
    /// the turning offset mass soon takes the load off the wheels.
    #[serde(rename = "assist_price_balancer")]
    #[schemars(range(min = 1.0, max = 1e8))]
    pub assist_price_balancer: f64,
}

impl Default for BalanceParams {
    fn default() -> Self {
        Self {
            controller: BalanceLawKind::OutputZeroing,
            preview: true,
            observer: true,
            steering_assist: false,
            kappa: 1.0,
            poles: [3.0; 3],
            observer_rate: 1.0,
            observer_moment_max: 25.0,
            preview_step: 0.04,
            preview_steps: 45,
            preview_ticks: 4,
            preview_settling: 0.05,
            decoupling_guard: 0.1,
            lqr_roll: 100.0,
            lqr_balancer_flywheel: 0.01,
            lqr_balancer_balancer: 1.0,
            lqr_roll_rate: 10.0,
            lqr_balancer_rate: 0.1,
            lqr_torque: 0.1,
            mpc_lean: 1e3,
            mpc_balancer_flywheel: 3.0,
            mpc_balancer_balancer: 20.0,
            mpc_rate_flywheel: 10.0,
            mpc_rate_balancer: 5.0,
            assist_gain: 1.0,
            assist_dead_zone: 0.1,
            assist_price_flywheel: 1e5,
            assist_price_balancer: 3e3,
        }
    }
}

impl BalanceParams {
    /// The linear-quadratic weights of a mode.
    #[must_use]
    pub fn weights(&self, mode: BalancerMode) -> Weights {
        let balancer = match mode {
            BalancerMode::Flywheel => self.lqr_balancer_flywheel,
            BalancerMode::Balancer => self.lqr_balancer_balancer,
        };
        Weights {
            state: Vector4::new(
                self.lqr_roll,
                balancer,
                self.lqr_roll_rate,
                self.lqr_balancer_rate,
            ),
            torque: self.lqr_torque,
        }
    }
}
