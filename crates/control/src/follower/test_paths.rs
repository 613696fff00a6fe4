//! Curves whose followers are known in closed form.

use bikebot_geometry::{CurvePath, FergusonCurve, Point2, Pose2};

use crate::followed_path::{FollowedPath, RideLimits};
use crate::params::{FollowParams, Track};

fn as_it_stands(curves: Vec<FergusonCurve>) -> FollowedPath {
    let limits = RideLimits {
        wheelbase: 1.12,
        steer_rate: 2.0,
        lateral_acceleration: 3.0,
        curvature: 0.9,
    };
    let params = FollowParams {
        track: Track::LookAheadPoint,
        ..FollowParams::default()
    };
    FollowedPath::new(&CurvePath::new(curves).unwrap(), &params, &limits, 0.0).unwrap()
}

/// Twenty metres along x.
pub fn straight() -> FollowedPath {
    as_it_stands(vec![FergusonCurve::straight(
        Point2::origin(),
        Point2::new(20.0, 0.0),
    )])
}

/// A full circle to the left from the origin, of eight curves.
pub fn circle(radius: f64) -> FollowedPath {
    let turn = std::f64::consts::FRAC_PI_4;
    let pose = |i: u8| {
        let angle = turn * f64::from(i);
        Pose2::new(radius * angle.sin(), radius * (1.0 - angle.cos()), angle)
    };
    // The tangent that lets a cubic meet its circle half way.
    let tangent = 4.0 * (turn / 4.0).tan() * radius;
    as_it_stands(
        (0..8)
            .map(|i| FergusonCurve::between(pose(i), pose(i + 1), tangent))
            .collect(),
    )
}
