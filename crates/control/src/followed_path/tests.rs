use super::*;
use bikebot_geometry::{FergusonCurve, angle};

const LIMITS: RideLimits = RideLimits {
    wheelbase: 1.12,
    steer_rate: 2.0,
    lateral_acceleration: 3.0,
    curvature: 0.9,
};
const AHEAD: f64 = 0.5;

/// A straight, a left bend of about 0.7 1/m and a straight: curvature jumps at both joints.
fn bend() -> CurvePath {
    let radius = 1.0 / 0.7;
    let (a, b) = (Pose2::new(0.0, 0.0, 0.0), Pose2::new(2.0, 0.0, 0.0));
    let c = Pose2::new(2.0 + radius * 1f64.sin(), radius * (1.0 - 1f64.cos()), 1.0);
    let d = c.compose(&Pose2::new(2.0, 0.0, 0.0));
    CurvePath::new(vec![
        FergusonCurve::straight(a.position, b.position),
        FergusonCurve::between(b, c, radius),
        FergusonCurve::straight(c.position, d.position),
    ])
    .unwrap()
}

#[test]
fn where_the_own_point_is_leads_back_to_the_rear_contact_and_no_number_to_none() {
    let path = FollowedPath::new(&bend(), &FollowParams::default(), &LIMITS, AHEAD).unwrap();
    for i in -100..700 {
        let rear = 0.01 * f64::from(i) + 0.003;
        let back = path.rear_at(path.own_at(rear)).0;
        assert!((back - rear).abs() < 1e-9, "{rear}: {back}");
    }
    assert_eq!(path.own_at(f64::INFINITY), f64::INFINITY);
    assert_eq!(path.own_at(f64::NEG_INFINITY), f64::NEG_INFINITY);
    assert!(path.own_at(f64::NAN).is_nan());
}

#[test]
fn refuses_a_path_of_no_length() {
    let path = CurvePath::new(vec![FergusonCurve::straight(
        Point2::origin(),
        Point2::new(0.1, 0.0),
    )])
    .unwrap();
    assert!(matches!(
        FollowedPath::new(&path, &FollowParams::default(), &LIMITS, AHEAD),
        Err(ControlError::PathTooShort { .. })
    ));
}

#[test]
fn on_a_straight_the_curve_runs_the_look_ahead_in_front() {
    let path = CurvePath::new(vec![FergusonCurve::straight(
        Point2::origin(),
        Point2::new(5.0, 0.0),
    )])
    .unwrap();
    for track in [Track::RearContact, Track::LookAheadPoint] {
        let params = FollowParams {
            track,
            ..FollowParams::default()
        };
        let followed = FollowedPath::new(&path, &params, &LIMITS, AHEAD).unwrap();
        let end = followed.sample(followed.length()).position;
        // Sums of 500 steps.
        assert!((end - Point2::new(5.5, 0.0)).norm() < 1e-9);
        assert!(followed.remaining(Point2::new(4.9, 0.0), followed.length() - 0.1) - 0.1 < 1e-9);
        assert!((followed.project(Point2::new(2.0, 0.03), 2.0, 1.0).lateral - 0.03).abs() < 1e-12);
    }
}

#[test]
fn a_rear_contact_that_trails_the_curve_stays_on_the_plan() {
    let path = bend();
    let params = FollowParams::default();
    let followed = FollowedPath::new(&path, &params, &LIMITS, AHEAD).unwrap();
    // Drag a rod of the look-ahead's length along the curve: its tail is the rear contact.
    let (mut heading, mut worst, mut steepest) = (0.0f64, 0.0f64, 0.0f64);
    let (step, mut before) = (0.001, 0.0);
    let n = (followed.length() / step) as usize;
    for i in 0..n {
        let sample = followed.sample(i as f64 * step);
        let slip = sample.heading - heading;
        let steer = (LIMITS.wheelbase * slip.tan() / params.look_ahead).atan();
        if i > 0 {
            steepest = steepest.max((steer - before).abs() / step * sample.speed);
        }
        before = steer;
        heading += slip.sin() / params.look_ahead * step;
        let rear = sample.position - Vector2::new(heading.cos(), heading.sin()) * params.look_ahead;
        worst = worst.max(path.project(rear, 0.0, path.length()).distance);
    }
    // Averaging over 0.6 m moves a bend of 0.7 1/m by 0.7 (0.36 + 0.04)/24 = 12 mm.
    assert!(worst < 0.014, "{worst}");
    // The speed profile keeps the steering within its rate; the linear table adds a little.
    assert!(steepest < LIMITS.steer_rate, "{steepest}");
}

#[test]
fn the_riding_speed_ends_at_standstill_and_never_exceeds_the_profile() {
    let followed = FollowedPath::new(&bend(), &FollowParams::default(), &LIMITS, AHEAD).unwrap();
    let length = followed.length();
    assert_eq!(followed.riding_sample(length).speed, 0.0);
    assert_eq!(followed.riding_sample(length + 1.0).speed, 0.0);
    for i in 0..200 {
        let s = length * f64::from(i) / 200.0;
        assert!(followed.riding_sample(s).speed <= followed.sample(s).speed);
    }
    // From 0.3 m/s at half a metre per second squared: 9 cm.
    assert!((followed.braking_speed(0.09) - 0.3).abs() < 1e-12);
}

/// One curve, so that nothing jumps but the steering's start.
fn curving() -> CurvePath {
    CurvePath::new(vec![FergusonCurve::between(
        Pose2::new(0.0, 0.0, 0.0),
        Pose2::new(6.0, 2.5, 0.9),
        6.5,
    )])
    .unwrap()
}

#[test]
fn where_curvature_is_continuous_the_curve_is_the_trace_of_the_own_point() {
    let path = curving();
    for ahead in [0.5, 1.12] {
        let followed = FollowedPath::new(&path, &FollowParams::default(), &LIMITS, ahead).unwrap();
        // From the end backwards: the arc length of the trace is the integral of sqrt(1 + (l kappa)^2).
        let (mut s, mut arc, h) = (path.length(), followed.length(), 1e-3);
        while s > 1.8 {
            let at = path.at(s);
            let (sin, cos) = at.heading.sin_cos();
            let trace = at.position + Vector2::new(cos, sin) * ahead;
            let got = followed.sample(arc);
            // The table's chords of a centimetre: kappa h^2/8.
            assert!((got.position - trace).norm() < 2e-5, "at {s}");
            let k = at.curvature;
            let stretch = (1.0 + (ahead * k).powi(2)).sqrt();
            let heading = at.heading + (ahead * k).atan();
            assert!(
                angle::difference(got.heading, heading).abs() < 1e-4,
                "at {s}"
            );
            if s < path.length() - 0.05 {
                let slope = (path.at(s + h).curvature - path.at(s - h).curvature) / (2.0 * h);
                let wanted = (k + ahead * slope / (stretch * stretch)) / stretch;
                assert!(
                    (got.curvature - wanted).abs() < 1e-3,
                    "at {s}: {} for {wanted}",
                    got.curvature
                );
            }
            let middle = path.at(s - 0.5 * h).curvature;
            arc -= h * (1.0 + (ahead * middle).powi(2)).sqrt();
            s -= h;
        }
    }
}

#[test]
fn the_curve_ends_the_look_ahead_in_front_of_the_goal_pose() {
    let path = curving();
    let goal = path.end_pose();
    let followed = FollowedPath::new(&path, &FollowParams::default(), &LIMITS, AHEAD).unwrap();
    let end = followed.sample(followed.length());
    assert!((end.position - (goal.position + goal.direction() * AHEAD)).norm() < 1e-9);
    // The rear contact's way to the goal, as the own point stands there.
    assert!(followed.remaining(goal.position, followed.length()).abs() < 1e-12);
}

#[test]
fn the_foot_stays_on_its_branch_where_the_curve_crosses_itself() {
    // A loop: out along x, round to the left and back across the way out.
    let poses = [
        Pose2::new(0.0, 0.0, 0.0),
        Pose2::new(6.0, 2.0, std::f64::consts::FRAC_PI_2),
        Pose2::new(4.0, 4.0, std::f64::consts::PI),
        Pose2::new(2.0, 2.0, -std::f64::consts::FRAC_PI_2),
        Pose2::new(2.0, -4.0, -std::f64::consts::FRAC_PI_2),
    ];
    let curve = |p: &[Pose2]| {
        FergusonCurve::between(p[0], p[1], 1.2 * (p[1].position - p[0].position).norm())
    };
    let path = CurvePath::new(poses.windows(2).map(curve).collect()).unwrap();
    let followed = FollowedPath::new(&path, &FollowParams::default(), &LIMITS, 0.0).unwrap();
    let (mut s, mut near) = (0.0, 0.0);
    while s < followed.length() {
        let sample = followed.sample(s);
        let left = Vector2::new(-sample.heading.sin(), sample.heading.cos());
        let point = sample.position + left * 0.1;
        let wide = followed.project(point, s, 0.5);
        let quick = followed.project_near(point, near);
        near = quick.s;
        for foot in [wide, quick] {
            assert!((foot.s - s).abs() < 2e-3, "at {s}: {foot:?}");
            assert!((foot.lateral - 0.1).abs() < 1e-4, "at {s}: {foot:?}");
        }
        s += 0.02;
    }
}

#[test]
fn straight_on_beyond_both_ends() {
    let followed = FollowedPath::new(&bend(), &FollowParams::default(), &LIMITS, AHEAD).unwrap();
    let end = followed.sample(followed.length());
    let beyond = followed.sample(followed.length() + 2.0);
    let gone = beyond.position - end.position;
    assert!(
        (gone.norm() - 2.0).abs() < 1e-12 && (gone.y.atan2(gone.x) - end.heading).abs() < 1e-12
    );
    let before = followed.sample(-1.0).position - followed.sample(0.0).position;
    assert!((before.norm() - 1.0).abs() < 1e-12);
}
