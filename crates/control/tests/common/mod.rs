//! A small closed loop for the tests: the 3D bike, its actuators and sensors, RK4 at 2.5 ms,
//! control at 5 ms.

// Every test file takes what it needs of this module.
#![allow(dead_code)]

pub mod stepper;

use std::f64::consts::FRAC_PI_2;

use bikebot_control::{BalanceParams, ControlOutput, FollowParams, Phase, RideController};
use bikebot_dynamics::{
    Actuators, BalancerMode, Bike, BikeInput, BikeParams, BikeState, Integrator, Measurement, Rk4,
    SensorParams, Sensors,
};
use bikebot_geometry::{CurvePath, FergusonCurve, Point2, Pose2};

pub const PLANT_STEP: f64 = 0.0025;
pub const CONTROL_PERIOD: f64 = 0.005;

/// The hand-made course of the design note: waypoints, tangents of 1.2 chords.
pub fn demo_course() -> CurvePath {
    let poses = [
        Pose2::new(1.0, 1.0, 0.0),
        Pose2::new(4.8, 2.2, 0.959_931_088_596_881_3),
        Pose2::new(7.0, 5.6, 0.523_598_775_598_298_8),
        Pose2::new(8.0, 8.0, FRAC_PI_2),
    ];
    let segments = poses
        .windows(2)
        .map(|p| FergusonCurve::between(p[0], p[1], 1.2 * (p[1].position - p[0].position).norm()))
        .collect();
    CurvePath::new(segments).unwrap()
}

/// How long a ride lasts, within its duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Until {
    Braking,
    Rest,
    Duration,
}

/// One ride.
#[derive(Clone)]
pub struct Ride {
    pub mode: BalancerMode,
    pub follow: FollowParams,
    pub balance: BalanceParams,
    /// What the controller believes.
    pub bike: BikeParams,
    /// What the bike is.
    pub truth: BikeParams,
    pub sensors: SensorParams,
    pub speed: f64,
    pub roll: f64,
    /// Where the bike stands beside the start, m to the left, and its heading off it, rad.
    pub offset: f64,
    pub heading: f64,
    pub slope_force: f64,
    pub roll_moment: f64,
    /// Start, duration and moment of a push, s and N m.
    pub push: Option<(f64, f64, f64)>,
    pub mode_request: Option<(f64, BalancerMode, f64)>,
    pub duration: f64,
    pub until: Until,
}

impl Ride {
    pub fn new(mode: BalancerMode) -> Self {
        Self {
            mode,
            follow: FollowParams::default(),
            balance: BalanceParams::default(),
            bike: BikeParams::default(),
            truth: BikeParams::default(),
            sensors: SensorParams::default(),
            speed: 0.3,
            roll: 0.0,
            offset: 0.0,
            heading: 0.0,
            slope_force: 0.0,
            roll_moment: 0.0,
            push: None,
            mode_request: None,
            duration: 120.0,
            until: Until::Rest,
        }
    }

    pub fn run(&self, path: &CurvePath) -> Report {
        let bike = Bike::new(self.truth);
        let mut actuators = Actuators::new(&self.truth);
        let begin = path
            .start_pose()
            .compose(&Pose2::new(0.0, self.offset, self.heading));
        let mut state = BikeState::upright(begin, self.speed);
        state.roll = self.roll;
        let rng = rand_chacha_stream();
        let mut sensors = Sensors::new(&self.sensors, &self.truth, CONTROL_PERIOD, rng);
        let start = Measurement::ideal(&state, 0.0);
        let mut controller = RideController::new(
            &self.bike,
            self.mode,
            &self.follow,
            &self.balance,
            path,
            &start,
            CONTROL_PERIOD,
        )
        .unwrap();
        let mut r = Report {
            start: state.pose.position,
            load_min: f64::INFINITY,
            tank_min: f64::INFINITY,
            ..Report::default()
        };
        let (mut square_error, mut error_count, mut square_torque, mut cruise_ticks) =
            (0.0, 0usize, 0.0, 0usize);
        let curvature_max = (0..=1000).fold((0.0, 0.0), |best: (f64, f64), i| {
            let s = path.length() * f64::from(i) / 1000.0;
            let k = path.at(s).curvature.abs();
            if s > 1.5 && s < path.length() - 1.5 && k > best.1 {
                (s, k)
            } else {
                best
            }
        });
        let mut rear_s = 0.0;
        let (mut airborne, mut sliding) = (0usize, 0usize);
        let ticks = (self.duration / CONTROL_PERIOD).round() as usize;
        for tick in 0..ticks {
            let t = tick as f64 * CONTROL_PERIOD;
            if let Some((at, mode, duration)) = self.mode_request
                && (t - at).abs() < 0.5 * CONTROL_PERIOD
            {
                controller.request_mode(mode, duration).unwrap();
            }
            let m = sensors.measure(t, &state, actuators.steer_rate());
            let out = controller.tick(&m).unwrap();
            let riding = matches!(out.phase, Phase::Start | Phase::Cruise);
            if !riding && self.until == Until::Braking {
                break;
            }
            r.watch(&out, &state);
            if riding {
                r.cruise_time = t;
                square_torque += out.command.balancer_torque.powi(2);
                cruise_ticks += 1;
            }
            if (state.pose.position - r.start).norm() > 1.0 || rear_s > 1.0 {
                r.error_max = r.error_max.max(out.lateral_error.abs());
                square_error += out.lateral_error.powi(2);
                error_count += 1;
            }
            let projected = path.project(state.pose.position, rear_s - 0.5, rear_s + 0.5);
            rear_s = projected.s;
            let beyond = projected.s >= path.length() - 1e-9 || projected.s <= 1e-9;
            r.rear_error_max = r.rear_error_max.max(if beyond {
                projected.lateral.abs()
            } else {
                projected.distance
            });
            if (rear_s - curvature_max.0).abs() < 0.05 {
                r.corner_speed = out.followed_speed;
            }
            let mut input = BikeInput {
                offset: out.offset,
                slope_force: self.slope_force,
                ..BikeInput::default()
            };
            for sub in 0..2 {
                let applied =
                    actuators.apply(&out.command, state.steer, state.balancer_rate, PLANT_STEP);
                input.drive_force = applied.drive_force;
                input.steer_rate = applied.steer_rate;
                input.balancer_torque = applied.balancer_torque;
                let now = t + f64::from(sub) * PLANT_STEP;
                input.roll_moment = self.roll_moment
                    + self.push.map_or(0.0, |(at, long, moment)| {
                        if now >= at - 1e-9 && now < at + long - 1e-9 {
                            moment
                        } else {
                            0.0
                        }
                    });
                let forces = bike.contact_forces(&state, &input);
                r.load_min = r.load_min.min(forces.rear_load).min(forces.front_load);
                let friction = forces
                    .friction_use_rear(self.truth.friction)
                    .max(forces.friction_use_front(self.truth.friction));
                r.friction_max = r.friction_max.max(friction);
                airborne = if forces.both_wheels_down() {
                    0
                } else {
                    airborne + 1
                };
                sliding = if friction > 1.0 { sliding + 1 } else { 0 };
                r.steer_rate_max = r.steer_rate_max.max(applied.steer_rate.abs());
                r.drive_max = r.drive_max.max(applied.drive_force.abs());
                r.steer_saturated |= applied.saturation.steer_rate || applied.saturation.steer_stop;
                state = Rk4.step(&bike, now, &state, &input, PLANT_STEP);
            }
            r.time = t;
            let fallen = state.roll.is_nan() || state.roll.abs() > 0.7;
            let lifted = airborne > (0.05 / PLANT_STEP) as usize;
            let slipped = sliding > (0.02 / PLANT_STEP) as usize;
            if fallen || lifted || slipped {
                r.fell = true;
                break;
            }
            if out.at_rest && !r.at_rest {
                r.at_rest = true;
                r.rest_time = t;
                if self.until == Until::Rest {
                    break;
                }
            }
        }
        r.error_rms = (square_error / error_count.max(1) as f64).sqrt();
        r.torque_rms = (square_torque / cruise_ticks.max(1) as f64).sqrt();
        let goal = path.end_pose();
        r.end_error = (state.pose.position - goal.position).norm();
        r.end_heading_error =
            bikebot_geometry::angle::difference(state.pose.heading, goal.heading).to_degrees();
        r.end_speed = state.speed;
        r.end_roll = state.roll.to_degrees();
        r.mode = Some(
            controller
                .tick(&sensors.measure(r.time + CONTROL_PERIOD, &state, 0.0))
                .unwrap()
                .mode,
        );
        r
    }
}

fn rand_chacha_stream() -> rand_chacha::ChaCha8Rng {
    use rand::SeedableRng;
    rand_chacha::ChaCha8Rng::seed_from_u64(7)
}

/// What one ride came to. SI units; roll in degrees.
#[derive(Clone, Debug, Default)]
pub struct Report {
    pub start: Point2,
    pub mode: Option<BalancerMode>,
    pub time: f64,
    pub cruise_time: f64,
    pub rest_time: f64,
    /// Rolled over, slipped for 20 ms or had a wheel off the ground for 50 ms.
    pub fell: bool,
    pub at_rest: bool,
    pub error_max: f64,
    pub error_rms: f64,
    pub rear_error_max: f64,
    pub roll_max: f64,
    pub torque_max: f64,
    pub torque_rms: f64,
    pub balancer_speed_max: f64,
    pub balancer_angle_max: f64,
    pub steer_max: f64,
    pub steer_rate_max: f64,
    pub steer_saturated: bool,
    pub drive_max: f64,
    pub friction_max: f64,
    pub load_min: f64,
    pub speed_max: f64,
    pub corner_speed: f64,
    pub decoupling_min: f64,
    pub fallbacks: usize,
    pub violations: usize,
    /// The worst tick of the energy account, J.
    pub residual_max: f64,
    /// Content of the energy tank, J.
    pub tank_start: Option<f64>,
    pub tank_min: f64,
    pub tank_end: f64,
    /// What the full tank gave up, J, and what the surroundings supplied.
    pub given_up: f64,
    pub supplied: f64,
    pub end_error: f64,
    pub end_heading_error: f64,
    pub end_speed: f64,
    pub end_roll: f64,
}

impl Report {
    fn watch(&mut self, out: &ControlOutput, state: &BikeState) {
        self.roll_max = self.roll_max.max(state.roll.to_degrees().abs());
        self.torque_max = self.torque_max.max(out.command.balancer_torque.abs());
        self.balancer_speed_max = self.balancer_speed_max.max(state.balancer_rate.abs());
        self.balancer_angle_max = self.balancer_angle_max.max(state.balancer.abs());
        self.steer_max = self.steer_max.max(state.steer.to_degrees().abs());
        self.speed_max = self.speed_max.max(out.followed_speed);
        self.fallbacks += usize::from(out.fallback);
        if let Some(energy) = &out.energy {
            self.violations += usize::from(energy.is_violated(CONTROL_PERIOD));
            self.residual_max = self.residual_max.max(energy.residual(CONTROL_PERIOD).abs());
            if energy.strict {
                self.tank_start.get_or_insert(energy.tank);
                self.tank_end = energy.tank;
                self.tank_min = self.tank_min.min(energy.tank);
                self.given_up += energy.given_up;
            }
            self.supplied += energy.supplied_power * CONTROL_PERIOD;
        }
        if self.decoupling_min == 0.0 || out.decoupling < self.decoupling_min {
            self.decoupling_min = out.decoupling;
        }
    }
}

/// A random path such as a sampling planner makes: Ferguson curves of 1 m and more that agree in
/// heading, curvature within 0.8 1/m, and jumps of curvature at every joint.
pub fn jumpy_path(seed: u64) -> CurvePath {
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut uniform =
        |a: f64, b: f64| a + (b - a) * ((rng.next_u64() >> 11) as f64 * (0.5f64).powi(53));
    let mut pose = Pose2::new(0.0, 0.0, 0.0);
    let mut segments = Vec::new();
    while segments.len() < 10 {
        let chord = uniform(1.0, 2.5);
        let bearing = uniform(-0.7, 0.7);
        let turn = 2.0 * bearing + uniform(-0.5, 0.5);
        let end = Pose2::new(
            pose.position.x + chord * (pose.heading + bearing).cos(),
            pose.position.y + chord * (pose.heading + bearing).sin(),
            pose.heading + turn,
        );
        let curve = FergusonCurve::between(pose, end, chord * uniform(0.9, 1.3));
        // Only curves near the limit are interesting, only those within it are allowed.
        let k = curve.max_curvature();
        if k <= 0.8 && k > 0.3 {
            segments.push(curve);
            pose = end;
        }
    }
    CurvePath::new(segments).unwrap()
}

/// Where an arc of `curvature`, 1/m, ends that leaves `pose` and is `length` m long.
fn end_of_arc(pose: Pose2, curvature: f64, length: f64) -> Pose2 {
    let turn = curvature * length;
    let (chord, bearing) = if turn == 0.0 {
        (length, pose.heading)
    } else {
        (
            2.0 / curvature * (0.5 * turn).sin(),
            pose.heading + 0.5 * turn,
        )
    };
    Pose2::new(
        pose.position.x + chord * bearing.cos(),
        pose.position.y + chord * bearing.sin(),
        pose.heading + turn,
    )
}

/// Arcs of 0.8 1/m to either side, joined with straight pieces of 1 m and with each other.
pub fn slalom() -> CurvePath {
    let mut pose = Pose2::new(0.0, 0.0, 0.0);
    let mut segments = Vec::new();
    let mut push = |curvature: f64, length: f64| {
        let end = end_of_arc(pose, curvature, length);
        segments.push(FergusonCurve::between(pose, end, length));
        pose = end;
    };
    for (curvature, length) in [
        (0.0, 2.0),
        (0.78, 1.2),
        (0.0, 1.0),
        (-0.78, 1.2),
        (0.0, 1.0),
        (0.78, 1.0),
        (-0.2, 1.0),
        (0.78, 1.0),
        (-0.78, 1.2),
        (0.0, 1.0),
        (0.78, 2.0),
        (0.0, 2.0),
    ] {
        push(curvature, length);
    }
    CurvePath::new(segments).unwrap()
}
