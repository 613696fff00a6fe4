//! The look-ahead point and the inputs that accelerate it.
//!
//! `P = (x + ell cos theta, y + ell sin theta)` has `P' = R(theta)(v, ell omega)` and
//! `P'' = R(theta)(v' - ell omega^2, ell omega' + v omega)`, so a commanded acceleration of `P`
//! is a forward and a yaw acceleration, and the latter a steering rate. Only standstill is
//! singular; a floor under the speed makes a start from rest possible. The heading is the only
//! internal motion, stable going forward.

use bikebot_dynamics::Measurement;
use bikebot_geometry::{Point2, Vector2};

/// The followed point of a bike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookAhead {
    /// `ell`, m: how far ahead of the rear contact.
    pub distance: f64,
    /// `w`, m.
    pub wheelbase: f64,
    /// Lowest speed the steering law divides by, m/s.
    pub speed_floor: f64,
}

impl LookAhead {
    /// `omega = v tan(psi)/w`, rad/s.
    #[must_use]
    pub fn yaw_rate(&self, m: &Measurement) -> f64 {
        m.speed * m.steer.tan() / self.wheelbase
    }

    /// `P`, world frame, m.
    #[must_use]
    pub fn point(&self, m: &Measurement) -> Point2 {
        m.pose.position + m.pose.direction() * self.distance
    }

    /// `P'`, world frame, m/s.
    #[must_use]
    pub fn velocity(&self, m: &Measurement) -> Vector2 {
        m.pose.direction() * m.speed + m.pose.left_normal() * (self.distance * self.yaw_rate(m))
    }

    /// `v'` that belongs to the acceleration `a` of the point, m/s^2.
    #[must_use]
    pub fn forward_acceleration(&self, m: &Measurement, a: Vector2) -> f64 {
        let yaw_rate = self.yaw_rate(m);
        a.dot(&m.pose.direction()) + self.distance * yaw_rate * yaw_rate
    }

    /// `omega'` that belongs to the acceleration `a` of the point, rad/s^2.
    #[must_use]
    pub fn yaw_acceleration(&self, m: &Measurement, a: Vector2) -> f64 {
        (a.dot(&m.pose.left_normal()) - m.speed * self.yaw_rate(m)) / self.distance
    }

    /// `psi'` that makes the yaw acceleration while the bike accelerates by `forward`, rad/s.
    #[must_use]
    pub fn steer_rate(&self, m: &Measurement, forward: f64, yaw: f64) -> f64 {
        let (sin, cos) = m.steer.sin_cos();
        (self.wheelbase * yaw * cos * cos - forward * sin * cos) / m.speed.max(self.speed_floor)
    }
}
