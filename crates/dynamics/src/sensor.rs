//! What the bike's sensors say about its own state.
//!
//! A laser or another localiser gives the pose at its own rate and late; encoders and an
//! inertial unit give the rest at every control tick. Odometry replay carries the last pose
//! from its stamp to the present with the measured speed and steering angle. The default is
//! ideal: the measurement is the truth.
//!
//! Sensors only read the truth; whatever they add stays in the [`Measurement`].

use std::collections::VecDeque;

use bikebot_geometry::{Pose2, angle};
use rand_chacha::ChaCha8Rng;

use crate::bike::BikeState;
use crate::chance::standard_normals;
use crate::params::BikeParams;

/// The state as the sensors report it; signs and units as in [`BikeState`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Rear contact point (m) and heading (rad, counter-clockwise from x).
    pub pose: Pose2,
    /// Speed of the rear contact along the heading, m/s.
    pub speed: f64,
    /// Ground-projected steering angle, rad, positive to the left.
    pub steer: f64,
    /// Steering rate, rad/s.
    pub steer_rate: f64,
    /// Roll, rad, positive to the right.
    pub roll: f64,
    /// Roll rate, rad/s.
    pub roll_rate: f64,
    /// Balancer angle relative to the frame, rad; counts turns.
    pub balancer: f64,
    /// Balancer rate, rad/s.
    pub balancer_rate: f64,
}

impl Measurement {
    /// What perfect sensors say; `steer_rate` (rad/s) belongs to the servo, not to the state.
    #[must_use]
    pub fn ideal(truth: &BikeState, steer_rate: f64) -> Self {
        Self {
            pose: truth.pose,
            speed: truth.speed,
            steer: truth.steer,
            steer_rate,
            roll: truth.roll,
            roll_rate: truth.roll_rate,
            balancer: truth.balancer,
            balancer_rate: truth.balancer_rate,
        }
    }
}

/// Noise, bias, rates and delays of the sensors. The default is ideal sensors.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct SensorParams {
    /// Standard deviation of the roll angle, degrees, fresh at every control tick.
    #[schemars(range(min = 0.0, max = 45.0))]
    pub roll_sigma_deg: f64,
    /// Constant error of the roll angle, degrees, positive to the right.
    #[schemars(range(min = -45.0, max = 45.0))]
    pub roll_bias_deg: f64,
    /// Standard deviation of the roll rate, rad/s.
    #[serde(rename = "roll_rate_sigma_radps")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub roll_rate_sigma: f64,
    /// Constant error of the roll rate, rad/s.
    #[serde(rename = "roll_rate_bias_radps")]
    #[schemars(range(min = -10.0, max = 10.0))]
    pub roll_rate_bias: f64,
    /// Standard deviation of the steering angle, degrees.
    #[schemars(range(min = 0.0, max = 45.0))]
    pub steer_sigma_deg: f64,
    /// Standard deviation of the speed, m/s.
    #[serde(rename = "speed_sigma_mps")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub speed_sigma: f64,
    /// Standard deviation of the position along each axis, m, fresh at every pose stamp.
    #[serde(rename = "position_sigma_m")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub position_sigma: f64,
    /// Standard deviation of the heading, degrees, fresh at every pose stamp.
    #[schemars(range(min = 0.0, max = 180.0))]
    pub heading_sigma_deg: f64,
    /// How often a pose is taken, Hz; 0 takes one at every control tick.
    #[serde(rename = "pose_rate_hz")]
    #[schemars(range(min = 0.0, max = 10000.0))]
    pub pose_rate: f64,
    /// Time from taking a pose until the controller has it, s.
    #[serde(rename = "pose_delay_s")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub pose_delay: f64,
    /// Whether the last pose is carried to the present by odometry. Without it the controller
    /// works with the pose as it was when taken.
    pub odometry_replay: bool,
}

impl Default for SensorParams {
    fn default() -> Self {
        Self {
            roll_sigma_deg: 0.0,
            roll_bias_deg: 0.0,
            roll_rate_sigma: 0.0,
            roll_rate_bias: 0.0,
            steer_sigma_deg: 0.0,
            speed_sigma: 0.0,
            position_sigma: 0.0,
            heading_sigma_deg: 0.0,
            pose_rate: 0.0,
            pose_delay: 0.0,
            odometry_replay: true,
        }
    }
}

/// A pose on its way to the controller.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    /// When it was taken, s.
    time: f64,
    /// What the localiser saw.
    pose: Pose2,
    /// The odometer's reading at the same moment.
    odometry: Pose2,
}

/// Slack when comparing times, s: far below any tick, far above the rounding of `k · dt`.
const TIME_SLACK: f64 = 1e-9;

/// The sensors, with the poses still on their way.
///
/// Measuring never allocates: the buffer is sized for the delay at construction.
#[derive(Debug, Clone)]
pub struct Sensors {
    params: SensorParams,
    wheelbase: f64,
    rng: ChaCha8Rng,
    in_flight: VecDeque<Stamp>,
    arrived: Option<Stamp>,
    odometer: Odometer,
    /// Time of the first measurement, s, and index of the next stamp since, so that the stamps
    /// do not drift against their rate.
    start: f64,
    stamps: u64,
}

impl Sensors {
    /// Sensors of a bike, asked once every `control_period` seconds and drawing their noise
    /// from `rng`.
    #[must_use]
    pub fn new(
        params: &SensorParams,
        bike: &BikeParams,
        control_period: f64,
        rng: ChaCha8Rng,
    ) -> Self {
        // Poses in flight: one per tick during the delay at most, and one at either end. The
        // cap only meets periods no loop has (the cast saturates, and NaN becomes zero).
        let ticks = (params.pose_delay / control_period).ceil() as usize;
        Self {
            params: *params,
            wheelbase: bike.wheelbase,
            rng,
            in_flight: VecDeque::with_capacity(ticks.min(MOST_IN_FLIGHT) + 2),
            arrived: None,
            odometer: Odometer::default(),
            start: 0.0,
            stamps: 0,
        }
    }

    /// What the sensors say at time `t` (s) about `truth`; `steer_rate` (rad/s) is the
    /// servo's own. To be called once per control tick, in order of time.
    ///
    /// The first call stamps a pose that is known at once: the bike is put down somewhere.
    pub fn measure(&mut self, t: f64, truth: &BikeState, steer_rate: f64) -> Measurement {
        // Always all numbers, in this order: one channel's noise cannot shift another's.
        let (roll, roll_rate) = standard_normals(&mut self.rng);
        let (steer, speed) = standard_normals(&mut self.rng);
        let (x, y) = standard_normals(&mut self.rng);
        let (heading, _) = standard_normals(&mut self.rng);
        let p = &self.params;

        let mut measured = Measurement::ideal(truth, steer_rate);
        measured.roll += p.roll_bias_deg.to_radians() + p.roll_sigma_deg.to_radians() * roll;
        measured.roll_rate += p.roll_rate_bias + p.roll_rate_sigma * roll_rate;
        measured.steer += p.steer_sigma_deg.to_radians() * steer;
        measured.speed += p.speed_sigma * speed;

        if p.pose_rate == 0.0 && p.pose_delay == 0.0 {
            // Nothing is old: no stamp to keep, and no rounding from carrying it here.
            measured.pose = self.seen(&truth.pose, x, y, heading);
            return measured;
        }
        let yaw_rate = measured.speed * measured.steer.tan() / self.wheelbase;
        self.odometer.advance(t, measured.speed, yaw_rate);
        let pose = self.seen(&truth.pose, x, y, heading);
        measured.pose = self.localise(t, pose);
        measured
    }

    /// What the localiser sees of a pose, given three standard normal numbers.
    fn seen(&self, pose: &Pose2, x: f64, y: f64, heading: f64) -> Pose2 {
        let sigma = self.params.position_sigma;
        Pose2::new(
            pose.position.x + sigma * x,
            pose.position.y + sigma * y,
            angle::wrap(pose.heading + self.params.heading_sigma_deg.to_radians() * heading),
        )
    }

    /// Takes a stamp if one is due, receives those that have arrived, and answers with the
    /// newest, carried to the present if odometry is replayed.
    fn localise(&mut self, t: f64, pose: Pose2) -> Pose2 {
        let stamp = Stamp {
            time: t,
            pose,
            odometry: self.odometer.pose,
        };
        let mut newest = match self.arrived {
            Some(newest) => newest,
            None => {
                self.start = t;
                self.stamps = 1;
                stamp
            }
        };
        let due = if self.params.pose_rate > 0.0 {
            self.start + self.stamps as f64 / self.params.pose_rate
        } else {
            t
        };
        if self.arrived.is_some() && t + TIME_SLACK >= due {
            // The next one after now: a rate above the control rate stamps every tick.
            let elapsed = t + TIME_SLACK - self.start;
            self.stamps = (elapsed * self.params.pose_rate) as u64 + 1;
            if self.in_flight.len() == self.in_flight.capacity() {
                self.in_flight.pop_front();
            }
            self.in_flight.push_back(stamp);
        }
        while let Some(&first) = self.in_flight.front() {
            if first.time + self.params.pose_delay > t + TIME_SLACK {
                break;
            }
            newest = first;
            self.in_flight.pop_front();
        }
        self.arrived = Some(newest);

        if self.params.odometry_replay {
            let moved = newest.odometry.inverse().compose(&self.odometer.pose);
            newest.pose.compose(&moved)
        } else {
            newest.pose
        }
    }
}

/// Largest number of poses kept on their way.
const MOST_IN_FLIGHT: usize = 100_000;

/// Dead reckoning from measured speed and yaw rate.
#[derive(Debug, Clone, Copy)]
struct Odometer {
    /// Pose relative to where counting began.
    pose: Pose2,
    /// Time, speed and yaw rate of the last reading.
    last: Option<(f64, f64, f64)>,
}

impl Default for Odometer {
    fn default() -> Self {
        Self {
            pose: Pose2::new(0.0, 0.0, 0.0),
            last: None,
        }
    }
}

impl Odometer {
    /// Adds the motion since the last reading: the arc of the mean speed and mean yaw rate.
    fn advance(&mut self, t: f64, speed: f64, yaw_rate: f64) {
        if let Some((last, last_speed, last_yaw_rate)) = self.last {
            let dt = t - last;
            let distance = 0.5 * (last_speed + speed) * dt;
            let turn = 0.5 * (last_yaw_rate + yaw_rate) * dt;
            // The chord of an arc points along its middle heading; its length is that of the
            // arc to third order in the turn.
            let half = 0.5 * turn;
            let (sin, cos) = half.sin_cos();
            let chord = distance * (1.0 - half * half / 6.0);
            self.pose = self
                .pose
                .compose(&Pose2::new(chord * cos, chord * sin, turn));
        }
        self.last = Some((t, speed, yaw_rate));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bike::{Bike, BikeInput};
    use crate::integrator::{Integrator, Rk4};
    use rand::SeedableRng;

    const TICK: f64 = 0.005;

    fn sensors(params: &SensorParams) -> Sensors {
        let rng = ChaCha8Rng::seed_from_u64(11);
        Sensors::new(params, &BikeParams::default(), TICK, rng)
    }

    fn somewhere() -> BikeState {
        BikeState {
            steer: 0.2,
            roll: 0.05,
            balancer: 7.0,
            roll_rate: -0.1,
            balancer_rate: 2.0,
            ..BikeState::upright(Pose2::new(3.0, -2.0, 1.0), 1.4)
        }
    }

    /// A weaving ride of two seconds, held upright; calls `visit` at every control tick.
    fn ride(mut visit: impl FnMut(f64, &BikeState)) {
        let bike = Bike::new(BikeParams::default());
        let mut state = somewhere();
        for tick in 0..400 {
            let t = f64::from(tick) * TICK;
            visit(t, &state);
            let input = BikeInput {
                steer_rate: (3.0 * t).cos(),
                drive_force: 10.0,
                ..Default::default()
            };
            state = Rk4.step(&bike, t, &state, &input, TICK);
            state.roll = 0.0;
            state.roll_rate = 0.0;
        }
    }

    #[test]
    fn by_default_the_measurement_is_the_truth_to_the_last_bit() {
        let mut sensors = sensors(&SensorParams::default());
        ride(|t, truth| {
            assert_eq!(
                sensors.measure(t, truth, 0.3),
                Measurement::ideal(truth, 0.3)
            );
        });
    }

    #[test]
    fn noise_leaves_the_truth_bit_equal() {
        let noisy = SensorParams {
            roll_sigma_deg: 1.0,
            roll_bias_deg: 2.0,
            roll_rate_sigma: 0.1,
            position_sigma: 0.5,
            pose_rate: 10.0,
            pose_delay: 0.1,
            ..SensorParams::default()
        };
        let mut sensors = sensors(&noisy);
        let mut with = Vec::new();
        ride(|t, truth| {
            assert_ne!(sensors.measure(t, truth, 0.0).roll, truth.roll);
            with.push(*truth);
        });
        let mut without = Vec::new();
        ride(|_, truth| without.push(*truth));
        assert_eq!(with, without);
    }

    #[test]
    fn mean_and_spread_of_the_noise_are_those_asked_for() {
        let params = SensorParams {
            roll_sigma_deg: 0.3,
            roll_bias_deg: 0.5,
            roll_rate_sigma: 0.02,
            roll_rate_bias: -0.01,
            steer_sigma_deg: 0.2,
            speed_sigma: 0.05,
            position_sigma: 0.04,
            heading_sigma_deg: 1.5,
            ..SensorParams::default()
        };
        let mut sensors = sensors(&params);
        let truth = somewhere();
        let expected = [
            (0.5_f64.to_radians(), 0.3_f64.to_radians()),
            (-0.01, 0.02),
            (0.0, 0.2_f64.to_radians()),
            (0.0, 0.05),
            (0.0, 0.04),
            (0.0, 0.04),
            (0.0, 1.5_f64.to_radians()),
        ];
        let n = 100_000;
        let (mut sums, mut squares) = ([0.0; 7], [0.0; 7]);
        for i in 0..n {
            let m = sensors.measure(f64::from(i) * TICK, &truth, 0.0);
            let errors = [
                m.roll - truth.roll,
                m.roll_rate - truth.roll_rate,
                m.steer - truth.steer,
                m.speed - truth.speed,
                m.pose.position.x - truth.pose.position.x,
                m.pose.position.y - truth.pose.position.y,
                angle::difference(m.pose.heading, truth.pose.heading),
            ];
            for (k, error) in errors.iter().enumerate() {
                sums[k] += error;
                squares[k] += (error - expected[k].0).powi(2);
            }
        }
        let n = f64::from(n);
        for (k, (mean, sigma)) in expected.into_iter().enumerate() {
            // Three standard errors of a mean, σ/√n, and of a deviation, σ/√(2n).
            assert!(
                (sums[k] / n - mean).abs() < 3.0 * sigma / n.sqrt(),
                "mean of {k}"
            );
            let measured = (squares[k] / n).sqrt();
            assert!(
                (measured - sigma).abs() < 3.0 * sigma / (2.0 * n).sqrt(),
                "sigma of {k}"
            );
        }
    }

    #[test]
    fn one_channels_noise_does_not_change_anothers() {
        let quiet = SensorParams {
            roll_sigma_deg: 0.3,
            ..SensorParams::default()
        };
        let loud = SensorParams {
            speed_sigma: 1.0,
            position_sigma: 0.2,
            pose_rate: 10.0,
            ..quiet
        };
        let (mut quiet, mut loud) = (sensors(&quiet), sensors(&loud));
        ride(|t, truth| {
            let (a, b) = (quiet.measure(t, truth, 0.0), loud.measure(t, truth, 0.0));
            assert_eq!(a.roll, b.roll);
        });
    }

    #[test]
    fn a_slow_late_pose_without_replay_is_the_truth_of_its_stamp() {
        let params = SensorParams {
            pose_rate: 10.0,
            pose_delay: 0.1,
            odometry_replay: false,
            ..SensorParams::default()
        };
        let mut sensors = sensors(&params);
        let mut truths = Vec::new();
        ride(|t, truth| {
            truths.push(truth.pose);
            let tick = truths.len() - 1;
            // Stamps every 20 ticks, received 20 ticks later; the first is known at once.
            let stamp = (tick / 20).saturating_sub(1) * 20;
            assert_eq!(
                sensors.measure(t, truth, 0.0).pose,
                truths[stamp],
                "tick {tick}"
            );
        });
    }

    #[test]
    fn a_delay_alone_shifts_the_pose_by_whole_ticks() {
        let params = SensorParams {
            pose_delay: 7.0 * TICK,
            odometry_replay: false,
            ..SensorParams::default()
        };
        let mut sensors = sensors(&params);
        let mut truths = Vec::new();
        ride(|t, truth| {
            truths.push(truth.pose);
            let stamp = (truths.len() - 1).saturating_sub(7);
            assert_eq!(sensors.measure(t, truth, 0.0).pose, truths[stamp]);
        });
    }

    #[test]
    fn replayed_odometry_reconstructs_the_present_pose_from_an_old_stamp() {
        let params = SensorParams {
            pose_rate: 10.0,
            pose_delay: 0.1,
            ..SensorParams::default()
        };
        let mut sensors = sensors(&params);
        ride(|t, truth| {
            let pose = sensors.measure(t, truth, 0.0).pose;
            // 0.2 s of dead reckoning at 5 ms: the trapezoidal rule leaves dt² v̈ t/12 ~ 1e-6.
            assert!((pose.position - truth.pose.position).norm() < 5e-6);
            assert!(angle::difference(pose.heading, truth.pose.heading).abs() < 5e-6);
        });
    }

    #[test]
    fn a_slow_pose_rate_does_not_drift() {
        // 30 Hz does not divide 200 Hz: 60 stamps in two seconds all the same.
        let params = SensorParams {
            pose_rate: 30.0,
            odometry_replay: false,
            ..SensorParams::default()
        };
        let mut sensors = sensors(&params);
        let mut poses = Vec::new();
        ride(|t, truth| poses.push(sensors.measure(t, truth, 0.0).pose));
        poses.dedup();
        assert_eq!(poses.len(), 60);
    }

    #[test]
    fn measuring_never_outgrows_the_buffer() {
        let params = SensorParams {
            pose_delay: 0.1,
            ..SensorParams::default()
        };
        // Asked four times as often as announced: the oldest poses give way.
        let mut sensors = sensors(&params);
        let capacity = sensors.in_flight.capacity();
        for i in 0..1000 {
            sensors.measure(f64::from(i) * TICK / 4.0, &somewhere(), 0.0);
        }
        assert_eq!(sensors.in_flight.capacity(), capacity);
    }
}
