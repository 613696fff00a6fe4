//! Gathers the metrics of a ride, tick by tick, from the true state.

use crate::monitor::{loaded_use_front, loaded_use_rear};
use crate::outcome::Metrics;
use crate::scenario::PlantModel;
use bikebot_dynamics::{BikeInput, BikeState, ContactForces};
use bikebot_geometry::{CurvePath, Point2, Pose2};

/// The error of the followed point counts from here on, m of way.
const ERROR_FROM: f64 = 1.0;
/// The sharpest corner is looked for farther than this from both ends, m.
const CORNER_MARGIN: f64 = 1.5;
/// Spacing at which the path is searched for its sharpest corner, m.
const CORNER_STEP: f64 = 0.01;

/// What one tick contributes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TickFacts<'a> {
    pub state: &'a BikeState,
    pub yaw_rate: f64,
    pub contact: Option<&'a ContactForces>,
    /// Of the ground under the rear and the front wheel.
    pub friction: [f64; 2],
    pub balancer_torque: f64,
    /// True followed point's distance from the followed curve, m; signed, positive to the left.
    pub lateral_error: Option<f64>,
    /// The true followed point and its distance ahead of the rear contact.
    pub followed_point: Option<(Point2, f64)>,
    pub clearance: Option<f64>,
    pub decoupling: Option<f64>,
    pub fallback: bool,
}

/// The running extremes and sums of a ride.
#[derive(Debug, Clone)]
pub(crate) struct RideMetrics {
    metrics: Metrics,
    /// The plant rolls and carries a balancer.
    balances: bool,
    /// The plant moves over the ground.
    travels: bool,
    distance: f64,
    last_position: Option<Point2>,
    error_sum: f64,
    error_count: u64,
    torque_sum: f64,
    ticks: u64,
    /// Work given out by the drive and by the balancer's motor, J.
    drive_work: f64,
    balancer_work: f64,
    corner: Option<f64>,
    corner_speed: Option<f64>,
    /// Progress of the rear contact and of the followed point along the planned path, m.
    rear_s: f64,
    front_s: f64,
}

impl RideMetrics {
    pub fn new(plant: PlantModel, path: Option<&CurvePath>) -> Self {
        let corner = path.and_then(sharpest_corner);
        Self {
            metrics: Metrics {
                max_path_curvature_per_m: path.map(CurvePath::max_curvature),
                ..Metrics::default()
            },
            balances: plant != PlantModel::Kinematic,
            travels: plant != PlantModel::TwoLink,
            distance: 0.0,
            last_position: None,
            error_sum: 0.0,
            error_count: 0,
            torque_sum: 0.0,
            ticks: 0,
            drive_work: 0.0,
            balancer_work: 0.0,
            corner,
            corner_speed: None,
            rear_s: 0.0,
            front_s: 0.0,
        }
    }

    /// Adds what the motors gave out in a step of `dt` seconds between two states. A motor that is driven takes
    /// nothing back, so its power counts only where it is positive.
    pub fn work(&mut self, from: &BikeState, to: &BikeState, input: &BikeInput, dt: f64) {
        let given = |force: f64, from: f64, to: f64| {
            0.5 * dt * ((force * from).max(0.0) + (force * to).max(0.0))
        };
        self.drive_work += given(input.drive_force, from.speed, to.speed);
        self.balancer_work += given(input.balancer_torque, from.balancer_rate, to.balancer_rate);
    }

    /// Adds one tick; returns the rear contact's distance from the planned path, m.
    pub fn add(&mut self, facts: &TickFacts<'_>, path: Option<&CurvePath>) -> Option<f64> {
        let state = facts.state;
        self.ticks += 1;
        let mut moved = 0.0;
        if let Some(last) = self.last_position {
            moved = (state.pose.position - last).norm();
            self.distance += moved;
        }
        self.last_position = Some(state.pose.position);
        self.torque_sum += facts.balancer_torque.powi(2);

        let m = &mut self.metrics;
        if self.balances {
            raise(&mut m.roll_max_deg, state.roll.abs().to_degrees());
            raise(&mut m.balancer_torque_max_nm, facts.balancer_torque.abs());
            raise(&mut m.balancer_speed_max_radps, state.balancer_rate.abs());
            raise(&mut m.balancer_angle_max_rad, state.balancer.abs());
            if let Some(decoupling) = facts.decoupling {
                lower(&mut m.decoupling_margin_min, decoupling.abs());
                *m.balance_fallbacks.get_or_insert(0) += u64::from(facts.fallback);
            }
        }
        if self.travels {
            raise(&mut m.speed_max_mps, state.speed);
        }
        if let Some(contact) = facts.contact {
            // A wheel off the ground has no friction to use; that it lifted is in the load.
            if let Some(used) = loaded_use_rear(contact, facts.friction[0]) {
                raise(&mut m.friction_use_rear_max, used);
            }
            if let Some(used) = loaded_use_front(contact, facts.friction[1]) {
                raise(&mut m.friction_use_front_max, used);
            }
            lower(
                &mut m.wheel_load_min_n,
                contact.rear_load.min(contact.front_load),
            );
        }
        if let Some(clearance) = facts.clearance {
            lower(&mut m.min_clearance_m, clearance);
        }
        if let Some(error) = facts.lateral_error.filter(|_| self.distance >= ERROR_FROM) {
            raise(&mut m.lateral_error_max_m, error.abs());
            self.error_sum += error * error;
            self.error_count += 1;
        }
        let path = path?;
        self.corner_speed(facts, path, moved);
        let rear = path.project(
            state.pose.position,
            self.rear_s - 0.5,
            self.rear_s + 1.0 + moved,
        );
        self.rear_s = rear.s;
        if self.rear_s > 0.0 && self.rear_s < path.length() {
            raise(&mut self.metrics.rear_error_max_m, rear.distance);
        }
        Some(rear.distance)
    }

    /// Goes over to another path, which begins as the old one did.
    pub fn replace_path(&mut self, path: &CurvePath) {
        let m = &mut self.metrics;
        raise(&mut m.max_path_curvature_per_m, path.max_curvature());
        *m.replans.get_or_insert(0) += 1;
        // Which corner of all paths was the sharpest says nothing.
        self.corner = None;
        m.corner_speed_mps = None;
        self.corner_speed = None;
    }

    /// How far the rear contact has come along the planned path, m.
    pub fn progress(&self) -> f64 {
        self.rear_s
    }

    fn corner_speed(&mut self, facts: &TickFacts<'_>, path: &CurvePath, moved: f64) {
        let (Some(corner), Some((point, ahead))) = (self.corner, facts.followed_point) else {
            return;
        };
        let before = self.front_s;
        self.front_s = path.project(point, before - 0.5, before + 1.0 + moved).s;
        if before < corner && self.front_s >= corner && self.corner_speed.is_none() {
            self.corner_speed = Some(facts.state.speed.hypot(ahead * facts.yaw_rate));
        }
    }

    /// Where the sharpest corner lies is decided by the planned path alone, so the errors at its end are
    /// taken from the state at rest.
    pub fn finish(
        mut self,
        time: f64,
        at_rest: Option<(&Pose2, Point2, Option<f64>)>,
        passivity: Option<u64>,
    ) -> Metrics {
        let m = &mut self.metrics;
        m.time_s = Some(time);
        if self.ticks > 0 && self.balances {
            m.balancer_torque_rms_nm = Some((self.torque_sum / self.ticks as f64).sqrt());
        }
        m.distance_m = self.travels.then_some(self.distance);
        m.drive_work_j = self.travels.then_some(self.drive_work);
        m.balancer_work_j = self.balances.then_some(self.balancer_work);
        if self.error_count > 0 {
            m.lateral_error_rms_m = Some((self.error_sum / self.error_count as f64).sqrt());
        }
        m.corner_speed_mps = self.corner_speed;
        m.passivity_violations = passivity;
        if let Some((pose, goal, heading)) = at_rest {
            m.end_position_error_m = Some((pose.position - goal).norm());
            m.end_heading_error_deg = heading.map(|heading| {
                bikebot_geometry::angle::difference(pose.heading, heading)
                    .abs()
                    .to_degrees()
            });
        }
        self.metrics
    }
}

/// Arc length of the largest |curvature| away from the ends, m; `None` on a path too short to have one.
fn sharpest_corner(path: &CurvePath) -> Option<f64> {
    let (from, to) = (CORNER_MARGIN, path.length() - CORNER_MARGIN);
    let steps = ((to - from) / CORNER_STEP).floor();
    if steps < 1.0 {
        return None;
    }
    (0..=steps as usize)
        .map(|i| path.at(from + CORNER_STEP * i as f64))
        // The first of equals, so that the answer does not depend on the order of comparison.
        .fold(None, |best: Option<(f64, f64)>, point| match best {
            Some((_, curvature)) if curvature >= point.curvature.abs() => best,
            _ => Some((point.s, point.curvature.abs())),
        })
        .map(|(s, _)| s)
}

fn raise(metric: &mut Option<f64>, value: f64) {
    *metric = Some(metric.map_or(value, |found| found.max(value)));
}

fn lower(metric: &mut Option<f64>, value: f64) {
    *metric = Some(metric.map_or(value, |found| found.min(value)));
}
