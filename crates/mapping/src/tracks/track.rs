//! One thing that moves: constant velocity with a drift.

use bikebot_geometry::{Point2, Vector2};

use super::cluster::Disc;
use super::params::TrackerParams;

/// How much a new measurement of the radius counts.
const RADIUS_GAIN: f64 = 0.2;
/// Farther than so many standard deviations of a measured centre from where it was first, it has moved.
const GONE: f64 = 5.0;

/// A moving thing as it is believed to be: a disc that goes straight on.
///
/// Both axes have the same noise, so one covariance of position and velocity serves both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    id: u64,
    born: f64,
    /// Where it was seen first, m.
    origin: Point2,
    /// Time of the last measurement, s.
    time: f64,
    position: Point2,
    velocity: Vector2,
    radius: f64,
    /// Of position and velocity along an axis: m², m²/s, m²/s².
    covariance: [f64; 3],
    seen: u32,
    confirmed: bool,
}

impl Track {
    pub(crate) fn born(id: u64, disc: &Disc, params: &TrackerParams) -> Self {
        Self {
            id,
            born: disc.time,
            origin: disc.centre,
            time: disc.time,
            position: disc.centre,
            velocity: Vector2::zeros(),
            radius: disc.radius,
            covariance: [
                disc.sigma * disc.sigma,
                0.0,
                params.birth_speed * params.birth_speed,
            ],
            seen: 1,
            confirmed: false,
        }
    }

    /// A number of its own: no two tracks of a ride have the same.
    #[must_use]
    pub fn id(&self) -> u64 {
        self.id
    }

    /// When it was last seen, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// From first to last sight, s.
    #[must_use]
    pub fn age(&self) -> f64 {
        self.time - self.born
    }

    /// Centre when it was last seen, world frame, m.
    #[must_use]
    pub fn position(&self) -> Point2 {
        self.position
    }

    /// World frame, m/s.
    #[must_use]
    pub fn velocity(&self) -> Vector2 {
        self.velocity
    }

    /// m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Where its centre will be, or was, at a time (s), if it goes straight on, m.
    #[must_use]
    pub fn position_at(&self, time: f64) -> Point2 {
        self.position + self.velocity * (time - self.time)
    }

    /// Standard deviation of that along each axis, m; `params` are those of the tracker.
    #[must_use]
    pub fn position_sigma_at(&self, time: f64, params: &TrackerParams) -> f64 {
        predicted(self.covariance, time - self.time, params)[0].sqrt()
    }

    /// Standard deviation of the position when it was last seen, along each axis, m.
    #[must_use]
    pub fn position_sigma(&self) -> f64 {
        self.covariance[0].sqrt()
    }

    /// Standard deviation of the velocity along each axis, m/s.
    #[must_use]
    pub fn velocity_sigma(&self) -> f64 {
        self.covariance[2].sqrt()
    }

    pub(crate) fn is_confirmed(&self) -> bool {
        self.confirmed
    }

    pub(crate) fn is_alive(&self, now: f64, params: &TrackerParams) -> bool {
        // A thing that has not shown twice in a row that it is there is given up at once.
        let patience = if self.confirmed {
            params.forget
        } else {
            0.3 * params.forget
        };
        now - self.time <= patience
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position.coords.norm().is_finite() && self.velocity.norm().is_finite()
    }

    /// From the prediction to a disc, in standard deviations.
    pub(crate) fn distance(&self, disc: &Disc, params: &TrackerParams) -> f64 {
        let off = disc.centre - self.position_at(disc.time);
        let variance =
            predicted(self.covariance, disc.time - self.time, params)[0] + disc.sigma * disc.sigma;
        off.norm() / variance.sqrt()
    }

    /// Kalman's update with a measured disc.
    pub(crate) fn update(&mut self, disc: &Disc, params: &TrackerParams) {
        let [pp, pv, vv] = predicted(self.covariance, disc.time - self.time, params);
        let off = disc.centre - self.position_at(disc.time);
        let innovation = pp + disc.sigma * disc.sigma;
        let (gain, velocity_gain) = (pp / innovation, pv / innovation);
        self.position = self.position_at(disc.time) + off * gain;
        self.velocity += off * velocity_gain;
        self.covariance = [
            pp * (1.0 - gain),
            pv * (1.0 - gain),
            vv - velocity_gain * pv,
        ];
        self.radius += RADIUS_GAIN * (disc.radius - self.radius);
        self.time = disc.time;
        self.seen += 1;
        let enough = params.confirm_speed.max(3.0 * self.velocity_sigma());
        let is_fast = self.velocity.norm() > enough;
        // Who is slower than the velocity is known shows it by going away.
        let way = (self.position - self.origin).norm();
        let has_gone = way > GONE * params.position_sigma
            && way > params.confirm_speed * self.age()
            && self.velocity.norm() > params.confirm_speed;
        if self.seen >= params.confirm_scans && (is_fast || has_gone) {
            self.confirmed = true;
        }
    }
}

/// Position and velocity covariance of an axis after `dt` (s), which may lie in the past: then it is taken as it is.
fn predicted([pp, pv, vv]: [f64; 3], dt: f64, params: &TrackerParams) -> [f64; 3] {
    let dt = dt.max(0.0);
    // White acceleration of this spectral density, m²/s³.
    let q = params.velocity_drift * params.velocity_drift;
    [
        pp + dt * (2.0 * pv + dt * vv) + q * dt * dt * dt / 3.0,
        pv + dt * vv + 0.5 * q * dt * dt,
        vv + q * dt,
    ]
}
