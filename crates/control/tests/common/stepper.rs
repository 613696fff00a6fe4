//! The closed loop of a [`Ride`] tick by tick, for tests that act on the controller on the way.

use bikebot_control::{ControlOutput, RideController};
use bikebot_dynamics::{
    Actuators, Bike, BikeInput, BikeState, Integrator, Measurement, Rk4, SensorParams, Sensors,
};
use bikebot_geometry::{CurvePath, FergusonCurve, Pose2};

use super::{CONTROL_PERIOD, PLANT_STEP, Ride, end_of_arc, rand_chacha_stream};

/// The noise of the ride tests: a gyro, encoders, and a localiser at 10 Hz, 100 ms late, carried on by odometry.
pub fn noisy() -> SensorParams {
    SensorParams {
        roll_sigma_deg: 0.3,
        roll_rate_sigma: 0.02,
        steer_sigma_deg: 0.5,
        speed_sigma: 0.05,
        position_sigma: 0.005,
        heading_sigma_deg: 0.3,
        pose_rate: 10.0,
        pose_delay: 0.1,
        odometry_replay: true,
        ..SensorParams::default()
    }
}

/// A straight of `straight` m and then an arc of `curvature`, 1/m, over `arc` m.
pub fn straight_then_arc(straight: f64, curvature: f64, arc: f64) -> CurvePath {
    let mut pose = Pose2::new(0.0, 0.0, 0.0);
    let mut segments = Vec::new();
    let mut push = |curvature: f64, length: f64| {
        let end = end_of_arc(pose, curvature, length);
        let turn = curvature * length;
        // The tangent that lets a cubic meet its circle half way.
        let tangent = if turn == 0.0 {
            length
        } else {
            4.0 * (turn / 4.0).tan() / curvature
        };
        segments.push(FergusonCurve::between(pose, end, tangent));
        pose = end;
    };
    push(0.0, straight);
    let pieces = (arc / 0.8).ceil();
    for _ in 0..pieces as usize {
        push(curvature, arc / pieces);
    }
    CurvePath::new(segments).unwrap()
}

/// A ride that can be stopped, looked at and told things between two ticks.
pub struct Stepper {
    pub controller: RideController,
    pub state: BikeState,
    pub time: f64,
    /// Ticks in which the energy account did not add up.
    pub violations: usize,
    pub fell: bool,
    /// Largest |roll|, rad.
    pub roll_max: f64,
    bike: Bike,
    actuators: Actuators,
    sensors: Sensors,
    slope_force: f64,
    airborne: usize,
    sliding: usize,
}

impl Stepper {
    pub fn new(ride: &Ride, path: &CurvePath) -> Self {
        let state = BikeState::upright(path.start_pose(), ride.speed);
        let controller = RideController::new(
            &ride.bike,
            ride.mode,
            &ride.follow,
            &ride.balance,
            path,
            &Measurement::ideal(&state, 0.0),
            CONTROL_PERIOD,
        )
        .unwrap();
        Self {
            controller,
            state,
            time: 0.0,
            violations: 0,
            fell: false,
            roll_max: 0.0,
            bike: Bike::new(ride.truth),
            actuators: Actuators::new(&ride.truth),
            sensors: Sensors::new(
                &ride.sensors,
                &ride.truth,
                CONTROL_PERIOD,
                rand_chacha_stream(),
            ),
            slope_force: ride.slope_force,
            airborne: 0,
            sliding: 0,
        }
    }

    pub fn tick(&mut self) -> ControlOutput {
        let m = self
            .sensors
            .measure(self.time, &self.state, self.actuators.steer_rate());
        let out = self.controller.tick(&m).unwrap();
        if let Some(energy) = &out.energy {
            self.violations += usize::from(energy.is_violated(CONTROL_PERIOD));
        }
        let mut input = BikeInput {
            offset: out.offset,
            slope_force: self.slope_force,
            ..BikeInput::default()
        };
        for _ in 0..2 {
            let s = &self.state;
            let applied = self
                .actuators
                .apply(&out.command, s.steer, s.balancer_rate, PLANT_STEP);
            input.drive_force = applied.drive_force;
            input.steer_rate = applied.steer_rate;
            input.balancer_torque = applied.balancer_torque;
            let forces = self.bike.contact_forces(s, &input);
            let mu = self.bike.params.friction;
            let friction = forces
                .friction_use_rear(mu)
                .max(forces.friction_use_front(mu));
            self.airborne = if forces.both_wheels_down() {
                0
            } else {
                self.airborne + 1
            };
            self.sliding = if friction > 1.0 { self.sliding + 1 } else { 0 };
            self.state = Rk4.step(&self.bike, self.time, s, &input, PLANT_STEP);
        }
        self.time += CONTROL_PERIOD;
        self.roll_max = self.roll_max.max(self.state.roll.abs());
        self.fell |= self.state.roll.is_nan()
            || self.state.roll.abs() > 0.7
            || self.airborne > (0.05 / PLANT_STEP) as usize
            || self.sliding > (0.02 / PLANT_STEP) as usize;
        out
    }

    /// Ticks until `done`, or for `longest` s; whether it was done.
    pub fn until(
        &mut self,
        longest: f64,
        mut done: impl FnMut(&mut Self, &ControlOutput) -> bool,
    ) -> bool {
        let ticks = (longest / CONTROL_PERIOD) as usize;
        (0..ticks).any(|_| {
            let out = self.tick();
            done(self, &out)
        })
    }

    /// Arc length of the true rear contact on `path`, m; looked for within half a metre of `near`, on beyond the ends.
    pub fn rear_on(&self, path: &CurvePath, near: f64) -> f64 {
        let foot = path.project(self.state.pose.position, near - 0.5, near + 0.5);
        let at = path.at(foot.s);
        let beyond = (self.state.pose.position - at.position)
            .dot(&Pose2::new(0.0, 0.0, at.heading).direction());
        foot.s + beyond
    }
}
