//! Linear-quadratic feedback of the lateral and the heading error of the rear contact.
//!
//! Beside the curve, small errors obey `e' = v theta_e`, `theta_e' = (v/w) u` with `u` the steering
//! beyond what the curvature asks for. The feedback of least `integral q_e e^2 + q_theta theta_e^2
//! + r u^2` is, at every speed,
//!
//! ```text
//! k_e = sqrt(q_e/r),     k_theta = sqrt((q_theta + 2 w sqrt(q_e r))/r),
//! psi = atan(w kappa(s + v T)) - k_e e - k_theta theta_e,
//! ```
//!
//! with the curvature read a time `T` ahead, the lag of the steering.

use bikebot_geometry::{Pose2, angle};

use crate::followed_path::{FollowedPath, Projection};
use crate::params::LateralLqrParams;

/// The feedback with its gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateralLqr {
    lateral_gain: f64,
    heading_gain: f64,
    lead: f64,
    wheelbase: f64,
}

impl LateralLqr {
    /// With the weights of `params`; `wheelbase` in m.
    #[must_use]
    pub fn new(params: &LateralLqrParams, wheelbase: f64) -> Self {
        let (q, p, r) = (params.lateral, params.heading, params.steer);
        Self {
            lateral_gain: (q / r).sqrt(),
            heading_gain: ((p + 2.0 * wheelbase * (q * r).sqrt()) / r).sqrt(),
            lead: params.lead,
            wheelbase,
        }
    }

    /// `(k_e, k_theta)`, rad/m and rad/rad.
    #[must_use]
    pub fn gains(&self) -> (f64, f64) {
        (self.lateral_gain, self.heading_gain)
    }

    /// The steering angle wanted, rad, with the rear contact at `projection` beside `path`; `speed` in m/s.
    #[must_use]
    pub fn steering_angle(
        &self,
        path: &FollowedPath,
        pose: &Pose2,
        speed: f64,
        projection: &Projection,
    ) -> f64 {
        let here = path.sample(projection.s);
        let ahead = path.sample(projection.s + speed.max(0.0) * self.lead);
        let heading_error = angle::difference(pose.heading, here.heading);
        (self.wheelbase * ahead.curvature).atan()
            - self.lateral_gain * projection.lateral
            - self.heading_gain * heading_error
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_paths::circle;
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    const WHEELBASE: f64 = 1.12;

    #[test]
    fn the_gains_solve_the_riccati_equation_at_every_speed() {
        let params = LateralLqrParams {
            lateral: 7.0,
            heading: 2.0,
            steer: 0.5,
            ..LateralLqrParams::default()
        };
        let (ke, kt) = LateralLqr::new(&params, WHEELBASE).gains();
        for v in [0.3, 1.0, 4.0] {
            let a = Matrix2::new(0.0, v, 0.0, 0.0);
            let b = Vector2::new(0.0, v / WHEELBASE);
            let q = Matrix2::new(params.lateral, 0.0, 0.0, params.heading);
            // K = B' P/r gives the lower row of P; the equation's corner gives the rest.
            let (p12, p22) = (params.steer * ke / b.y, params.steer * kt / b.y);
            let p11 = p12 * p22 * b.y * b.y / (params.steer * v);
            let p = Matrix2::new(p11, p12, p12, p22);
            let residual = a.transpose() * p + p * a - p * b * b.transpose() * p / params.steer + q;
            assert!(residual.norm() < 1e-12 * p.norm(), "{residual}");
            assert!(p11 > 0.0 && p.determinant() > 0.0);
        }
    }

    #[test]
    fn on_the_curve_only_its_curvature_steers() {
        let path = circle(2.5);
        let law = LateralLqr::new(&LateralLqrParams::default(), WHEELBASE);
        let here = path.sample(3.0);
        let pose = Pose2::new(here.position.x, here.position.y, here.heading);
        let projection = Projection {
            s: 3.0,
            lateral: 0.0,
        };
        let steer = law.steering_angle(&path, &pose, 1.0, &projection);
        assert!((steer - (WHEELBASE / 2.5f64).atan()).abs() < 1e-4);
    }
}
