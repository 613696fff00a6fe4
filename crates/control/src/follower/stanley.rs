//! The Stanley law: the front wheel rolls along the curve and against its distance from it.
//!
//! With `e` the distance of the front contact to the left of the curve and `chi` the curve's
//! heading there,
//!
//! ```text
//! psi = (chi - theta) - atan(k e/(v_0 + v)).
//! ```
//!
//! The front contact moves in direction `theta + psi` with speed `v/cos(psi)`, so for any curve
//! `e' = -(v/cos psi) sin(atan(k e/(v_0 + v)))`: the error decays at about `k v/(v_0 + v)` and is
//! zero in a steady turn.

use bikebot_geometry::{Pose2, angle};

use crate::followed_path::{FollowedPath, Projection};
use crate::params::StanleyParams;

/// The Stanley law with its gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stanley {
    gain: f64,
    softening: f64,
}

impl Stanley {
    /// With the gains of `params`.
    #[must_use]
    pub fn new(params: &StanleyParams) -> Self {
        Self {
            gain: params.gain,
            softening: params.softening,
        }
    }

    /// The steering angle wanted, rad, with the front contact at `projection` beside `path`; `speed` in m/s.
    #[must_use]
    pub fn steering_angle(
        &self,
        path: &FollowedPath,
        pose: &Pose2,
        speed: f64,
        projection: &Projection,
    ) -> f64 {
        let along = angle::difference(path.sample(projection.s).heading, pose.heading);
        along - (self.gain * projection.lateral).atan2(self.softening + speed.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_paths::{circle, straight};
    use super::*;
    use bikebot_geometry::{Point2, Vector2};

    const WHEELBASE: f64 = 1.12;

    /// The front contact after `way` m of an ideal bike, its error at each step told to `visit`.
    fn roll(
        path: &FollowedPath,
        mut pose: Pose2,
        mut s: f64,
        way: f64,
        mut visit: impl FnMut(f64, f64),
    ) {
        let law = Stanley::new(&StanleyParams::default());
        let (speed, dx) = (1.0, 1e-4);
        for _ in 0..(way / dx) as usize {
            let front: Point2 = pose.position + pose.direction() * WHEELBASE;
            let projection = path.project_near(front, s);
            s = projection.s;
            let steer = law.steering_angle(path, &pose, speed, &projection);
            visit(projection.lateral, dx * speed / steer.cos());
            pose.position += Vector2::new(pose.heading.cos(), pose.heading.sin()) * dx;
            pose.heading += steer.tan() / WHEELBASE * dx;
        }
    }

    #[test]
    fn rides_a_circle_without_a_steady_error() {
        let path = circle(2.5);
        let start = path.sample(0.0);
        // The front wheel on the circle, the frame off it by a little.
        let pose = Pose2::new(start.position.x, start.position.y, start.heading - 0.2)
            .compose(&Pose2::new(-WHEELBASE, 0.0, 0.0));
        let mut last = f64::NAN;
        roll(&path, pose, 0.0, 8.0, |error, _| last = error);
        // What is left is Euler's rule and the centimetre table of the circle.
        assert!(last.abs() < 2e-5, "{last}");
    }

    #[test]
    fn the_error_obeys_its_own_equation_whatever_the_heading() {
        // de/dx = -sin(atan(k e/(v0 + v))) along the way of the front wheel.
        let mut expected = 0.2;
        roll(
            &straight(),
            Pose2::new(1.0, 0.2, 0.0),
            1.0 + WHEELBASE,
            3.0,
            |error, way| {
                assert!(
                    (error - expected).abs() < 1e-4,
                    "{error} against {expected}"
                );
                expected -= way * (4.0 * expected / 1.3f64).atan().sin();
            },
        );
        assert!(expected < 1e-3);
    }
}
