//! New paths taken over on the way, without a bump.

mod common;

use bikebot_control::{ControlError, ControlOutput, FollowController, Track};
use bikebot_dynamics::BalancerMode;
use bikebot_geometry::{CurvePath, FergusonCurve, Pose2};
use common::stepper::{Stepper, noisy, straight_then_arc};
use common::{Ride, demo_course};

const FOLLOWERS: [FollowController; 4] = [
    FollowController::Pvfc,
    FollowController::PurePursuit,
    FollowController::Stanley,
    FollowController::Lqr,
];

/// A winding course that begins straight, heading 0.5 (1 - cos(s/1.5)), in short curves without jumps to speak of.
fn smooth_course() -> CurvePath {
    let pose = |s: f64| {
        let steps = 200;
        let h = s / f64::from(steps);
        let heading = |s: f64| 0.5 * (1.0 - (s / 1.5).cos());
        let (mut x, mut y) = (0.0, 0.0);
        for i in 0..steps {
            let middle = heading((f64::from(i) + 0.5) * h);
            x += h * middle.cos();
            y += h * middle.sin();
        }
        Pose2::new(x, y, heading(s))
    };
    let step = 0.4;
    CurvePath::new(
        (0..35)
            .map(|i| {
                let s = f64::from(i) * step;
                FergusonCurve::between(pose(s), pose(s + step), step)
            })
            .collect(),
    )
    .unwrap()
}

/// The piece of `path` from `from` m on.
fn rest_of(path: &CurvePath, from: f64) -> CurvePath {
    let (segment, t) = path.locate(from);
    let mut segments = vec![path.segments()[segment].sub_curve(t, 1.0)];
    segments.extend_from_slice(&path.segments()[segment + 1..]);
    CurvePath::new(segments).unwrap()
}

/// Largest differences of drive force, N, steering rate, rad/s, lean reference, rad, and torque, N m.
fn differences(a: &ControlOutput, b: &ControlOutput) -> [f64; 4] {
    [
        (a.command.drive_force - b.command.drive_force).abs(),
        (a.command.steer_rate - b.command.steer_rate).abs(),
        (a.lean_reference - b.lean_reference).abs(),
        (a.command.balancer_torque - b.command.balancer_torque).abs(),
    ]
}

#[test]
fn the_same_path_again_changes_nothing() {
    for track in [Track::RearContact, Track::LookAheadPoint] {
        for controller in FOLLOWERS {
            let mut ride = Ride::new(BalancerMode::Balancer);
            ride.follow.controller = controller;
            ride.follow.track = track;
            let path = demo_course();
            let (mut kept, mut swapped) = (Stepper::new(&ride, &path), Stepper::new(&ride, &path));
            let mut worst = [0f64; 4];
            for tick in 0..3000 {
                if tick % 37 == 0 {
                    let near = swapped.controller.rear_arc_length();
                    swapped.controller.replace_path(&path, near).unwrap();
                }
                let (a, b) = (kept.tick(), swapped.tick());
                for (worst, d) in worst.iter_mut().zip(differences(&a, &b)) {
                    *worst = worst.max(d);
                }
                assert_eq!(
                    a.phase, b.phase,
                    "{controller:?} {track:?} {tick} {worst:?} {} {}",
                    a.remaining, b.remaining
                );
            }
            assert!(kept.tick().arrived && swapped.tick().arrived);
            assert!(worst.iter().all(|d| *d < 1e-9), "{controller:?}: {worst:?}");
            assert_eq!(swapped.violations, 0);
        }
    }
}

#[test]
fn the_rest_of_the_path_is_ridden_on_without_a_bump() {
    for controller in FOLLOWERS {
        let mut ride = Ride::new(BalancerMode::Balancer);
        ride.follow.controller = controller;
        let path = smooth_course();
        let (mut kept, mut swapped) = (Stepper::new(&ride, &path), Stepper::new(&ride, &path));
        let mut worst = [0f64; 4];
        let mut shift = 0.0;
        for tick in 0..2400 {
            if tick % 100 == 99 {
                let s = swapped.controller.rear_arc_length() + shift;
                let from = (s - 1.0).max(0.0);
                let rest = rest_of(&path, from);
                swapped.controller.replace_path(&rest, s - from).unwrap();
                shift = from;
            }
            let (a, b) = (kept.tick(), swapped.tick());
            for (worst, d) in worst.iter_mut().zip(differences(&a, &b)) {
                *worst = worst.max(d);
            }
        }
        // The table's samples lie elsewhere: its chords are off by a hundredth of a millimetre.
        let bounds = [1.0, 0.03, 5e-4, 0.3];
        assert!(
            worst.iter().zip(bounds).all(|(d, most)| *d < most),
            "{controller:?}: {worst:?}"
        );
        assert_eq!(swapped.violations, 0);
    }
}

#[test]
fn a_way_that_parts_ahead_is_taken_smoothly() {
    for controller in FOLLOWERS {
        for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
            let mut ride = Ride::new(mode);
            ride.follow.controller = controller;
            let straight = straight_then_arc(20.0, 0.0, 1.0);
            let mut bike = Stepper::new(&ride, &straight);
            bike.until(7.0, |_, _| false);
            let what = format!("{controller:?} {mode:?}");
            let s = bike.controller.rear_arc_length();
            // From 2 m ahead of the bike on, a way to the left whose curvature grows from nothing.
            let joint = Pose2::new(s + 2.0, 0.0, 0.0);
            let aside = Pose2::new(s + 6.0, 1.5, 0.6);
            let on = aside.compose(&Pose2::new(6.0, 0.0, 0.0));
            let path = CurvePath::new(vec![
                FergusonCurve::between(Pose2::new(s - 1.0, 0.0, 0.0), joint, 3.0),
                FergusonCurve::between(joint, aside, 4.4),
                FergusonCurve::between(aside, on, 6.0),
            ])
            .unwrap();
            let mut kept = Stepper::new(&ride, &straight);
            kept.until(7.0, |_, _| false);
            bike.controller.replace_path(&path, 1.0).unwrap();
            let d = differences(&kept.tick(), &bike.tick());
            // Drive and steering see nothing yet; what the preview sees enters the lean over its settling time.
            assert!(d[0] < 8.0 && d[1] < 0.05, "{what}: {d:?}");
            assert!(d[2] < 1e-3 && d[3] < 3.0, "{what}: {d:?}");
            assert!(bike.until(40.0, |_, out| out.arrived), "{what}");
            let off = (bike.state.pose.position - on.position).norm();
            assert!(
                off < 0.03 && !bike.fell && bike.violations == 0,
                "{what}: {off}"
            );
            assert!(bike.roll_max < 0.12, "{what}: {}", bike.roll_max);
        }
    }
}

#[test]
fn rides_on_from_a_goal_that_has_moved() {
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        let ride = Ride::new(mode);
        let short = straight_then_arc(3.0, 0.0, 1.0);
        let long = straight_then_arc(12.0, 0.0, 1.0);
        let mut bike = Stepper::new(&ride, &short);
        assert!(bike.until(30.0, |_, out| out.arrived && out.at_rest));
        bike.controller.replace_path(&long, 4.0).unwrap();
        let mut tank = None;
        assert!(bike.until(30.0, |_, out| {
            tank = out.energy.map(|e| e.tank);
            out.arrived
        }));
        assert!((bike.state.pose.position.x - 13.0).abs() < 0.03);
        // The longer path is ridden faster: its field's energy came with it.
        assert!(bike.violations == 0 && tank.is_some_and(|t| t >= 0.0));
    }
}

#[test]
fn new_paths_under_noise_keep_the_bike_upright_and_the_books_true() {
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        for controller in FOLLOWERS {
            let mut ride = Ride::new(mode);
            ride.follow.controller = controller;
            ride.sensors = noisy();
            let path = smooth_course();
            let mut bike = Stepper::new(&ride, &path);
            let (mut shift, mut tick) = (0.0, 0);
            let arrived = bike.until(60.0, |bike, out| {
                tick += 1;
                if tick % 20 == 0 && !out.arrived {
                    let s = bike.controller.rear_arc_length() + shift;
                    let from = (s - 1.0).max(0.0);
                    let rest = rest_of(&path, from);
                    bike.controller.replace_path(&rest, s - from).unwrap();
                    let line = s - from + 2.5;
                    bike.controller
                        .set_stop((line < rest.length()).then_some(line));
                    shift = from;
                }
                out.arrived
            });
            let what = format!("{mode:?} {controller:?}");
            assert!(arrived && !bike.fell, "{what}");
            assert_eq!(bike.violations, 0, "{what}");
            let off = (bike.state.pose.position - path.end_pose().position).norm();
            assert!(off < 0.05, "{what}: {off}");
        }
    }
}

#[test]
fn refuses_a_path_that_does_not_lead_past_the_bike_and_stays_on_its_own() {
    let ride = Ride::new(BalancerMode::Flywheel);
    let path = demo_course();
    let mut bike = Stepper::new(&ride, &path);
    bike.until(3.0, |_, _| false);
    let before = bike.controller.clone();
    let far = straight_then_arc(5.0, 0.0, 1.0);
    assert!(matches!(
        bike.controller.replace_path(&far, 50.0),
        Err(ControlError::PathElsewhere { .. })
    ));
    let back = CurvePath::new(vec![FergusonCurve::straight(
        bike.state.pose.position + bike.state.pose.direction() * 3.0,
        bike.state.pose.position - bike.state.pose.direction() * 3.0,
    )])
    .unwrap();
    assert!(matches!(
        bike.controller.replace_path(&back, 2.5),
        Err(ControlError::PathElsewhere { turn, .. }) if turn.abs() > 3.0
    ));
    assert!(bike.controller == before);
    assert!(bike.until(40.0, |_, out| out.arrived));
}
