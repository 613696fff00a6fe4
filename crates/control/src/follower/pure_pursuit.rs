//! Pure pursuit: steer along the circle that leads to a point of the curve ahead.
//!
//! The pursued point lies `L = L_0 + T_L v` further along the curve than the rear contact. With
//! `eta` the angle under which it is seen off the heading and `L_a` its distance, the circle
//! through it that is tangent to the heading has curvature `2 sin(eta)/L_a`, and
//!
//! ```text
//! psi = atan(2 w sin(eta) / L_a).
//! ```
//!
//! A bike on a circle sees the points of that circle under just this angle, so there is no error
//! in a steady turn. On a straight a small error obeys `e'' + (2/L) e' + (2/L^2) e = 0` along the
//! way: poles at `(-1 ± i)/L`.

use bikebot_geometry::{Pose2, cross};

use crate::followed_path::{FollowedPath, Projection};
use crate::params::PurePursuitParams;

/// Pure pursuit of a bike with wheelbase `w`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PurePursuit {
    distance: f64,
    time: f64,
    wheelbase: f64,
}

impl PurePursuit {
    /// With the look-ahead of `params`; `wheelbase` in m.
    #[must_use]
    pub fn new(params: &PurePursuitParams, wheelbase: f64) -> Self {
        Self {
            distance: params.distance,
            time: params.time,
            wheelbase,
        }
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
        let ahead = self.distance + self.time * speed.max(0.0);
        let to_target = path.sample(projection.s + ahead).position - pose.position;
        let direction = pose.direction();
        let (along, side) = (direction.dot(&to_target), cross(direction, to_target));
        let far = to_target.norm();
        // Sine of the bearing. A target abeam or behind asks for the tightest circle, not for a wider one again.
        let sin = match along {
            _ if far == 0.0 => 0.0,
            along if along < 0.0 => 1.0_f64.copysign(side),
            _ => side / far,
        };
        // Never nearer than a tenth of the look-ahead: a bike that stands on its target still turns finitely.
        let distance = far.max(0.1 * ahead);
        (2.0 * self.wheelbase * sin / distance).atan()
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_paths::{circle, straight};
    use super::*;
    use bikebot_geometry::Vector2;

    const WHEELBASE: f64 = 1.12;

    fn law() -> PurePursuit {
        let params = PurePursuitParams {
            distance: 0.3,
            time: 0.2,
            ..PurePursuitParams::default()
        };
        PurePursuit::new(&params, WHEELBASE)
    }

    #[test]
    fn a_bike_on_a_circle_steers_for_that_circle() {
        let (radius, path) = (2.5, circle(2.5));
        for s in [2.0, 3.0, 4.0] {
            let here = path.sample(s);
            let pose = Pose2::new(here.position.x, here.position.y, here.heading);
            let projection = Projection { s, lateral: 0.0 };
            let steer = law().steering_angle(&path, &pose, 1.0, &projection);
            // Ferguson curves of an eighth of a turn lie within 1e-5 of their circle.
            assert!(
                (steer.tan() / WHEELBASE - 1.0 / radius).abs() < 1e-4,
                "{steer}"
            );
        }
    }

    #[test]
    fn an_error_on_a_straight_decays_with_the_poles_of_the_note() {
        // e'' + (2/L) e' + (2/L^2) e = 0 along the way: e = e0 exp(-x/L) (cos x/L + sin x/L).
        let path = straight();
        let (law, speed) = (law(), 1.0);
        let look_ahead = 0.3 + 0.2 * speed;
        let (mut pose, e0, dx) = (Pose2::new(1.0, 0.01, 0.0), 0.01, 1e-4);
        for i in 0..15_000 {
            let x = f64::from(i) * dx / look_ahead;
            let expected = e0 * (-x).exp() * (x.cos() + x.sin());
            // Euler's rule over 1e-4 m, and the cube of a bearing of 0.02 rad.
            assert!((pose.position.y - expected).abs() < 1e-5, "at {x}");
            let projection = path.project_near(pose.position, pose.position.x);
            let steer = law.steering_angle(&path, &pose, speed, &projection);
            pose.position += Vector2::new(pose.heading.cos(), pose.heading.sin()) * dx;
            pose.heading += steer.tan() / WHEELBASE * dx;
        }
    }

    #[test]
    fn a_target_behind_is_turned_for_as_tightly_as_one_abeam() {
        let path = straight();
        let projection = Projection {
            s: 2.0,
            lateral: 0.0,
        };
        let towards = |heading: f64| {
            law().steering_angle(&path, &Pose2::new(2.0, 0.0, heading), 1.0, &projection)
        };
        let abeam = towards(-std::f64::consts::FRAC_PI_2);
        assert!((abeam - (2.0 * WHEELBASE / 0.5).atan()).abs() < 1e-12);
        assert!((towards(-3.0) - abeam).abs() < 1e-12);
    }
}
