//! Stop lines and greatest speeds on the way: stops in time, waits upright, sets off again.

mod common;

use bikebot_control::{FollowController, Phase};
use bikebot_dynamics::BalancerMode;
use common::stepper::{Stepper, noisy, straight_then_arc};
use common::{Ride, demo_course, slalom};

const MODES: [BalancerMode; 2] = [BalancerMode::Flywheel, BalancerMode::Balancer];
const WEIGHT: f64 = 50.0 * 9.81;

/// One stop from `speed`, m/s, in a bend of `curvature`, 1/m, as soon as the bike rides there at that speed.
#[derive(Debug, Clone, Copy)]
struct Case {
    mode: BalancerMode,
    speed: f64,
    curvature: f64,
    slope: f64,
    is_emergency: bool,
    noise: bool,
    controller: FollowController,
}

/// How far beyond the line the rear contact came, m, while stopping and waiting, and where it stands.
struct Stop {
    beyond: f64,
    rest: f64,
}

fn stop(case: &Case) -> Stop {
    let mut ride = Ride::new(case.mode);
    ride.follow.controller = case.controller;
    ride.follow.max_speed = case.speed;
    // The bend shall be ridden at that speed: a little above the default's 0.8.
    ride.follow.lateral_acceleration = 0.85;
    ride.slope_force = -case.slope * WEIGHT;
    if case.noise {
        ride.sensors = noisy();
    }
    // Speeding up at 0.3 m/s^2, and a second of its own.
    let run_up = (case.speed * case.speed - 0.09).max(0.0) / 0.6 + 2.0 * case.speed + 1.0;
    let path = straight_then_arc(run_up, case.curvature, 9.0);
    let mut bike = Stepper::new(&ride, &path);
    let mut s = 0.0;
    let into = if case.curvature == 0.0 { -1.0 } else { 1.5 };
    let there = bike.until(60.0, |bike, _| {
        s = bike.rear_on(&path, s);
        s > run_up + into
    });
    assert!(there && !bike.fell, "{case:?}");
    let speed = bike.state.speed;
    // Stanley's own speed is that of the front wheel, a third more in such a bend.
    assert!(speed > 0.7 * case.speed, "{case:?}: {speed}");
    let controller = &mut bike.controller;
    let distance = if case.is_emergency {
        controller.least_stopping_distance(speed)
    } else {
        controller.stopping_distance(speed)
    };
    // From where the bike truly is: what the navigator proves is about the world.
    let line = s + distance;
    controller.set_stop(Some(line));
    let mut beyond = f64::NEG_INFINITY;
    let waits = bike.until(12.0, |bike, out| {
        s = bike.rear_on(&path, s);
        beyond = beyond.max(s - line);
        out.waiting
    });
    assert!(waits && !bike.fell, "{case:?}: {s} of {line}");
    // And goes on waiting.
    bike.until(8.0, |bike, out| {
        s = bike.rear_on(&path, s);
        beyond = beyond.max(s - line);
        assert!(out.waiting && !out.arrived, "{case:?}");
        bike.fell
    });
    assert!(!bike.fell && bike.violations == 0, "{case:?}");
    assert!(bike.state.roll.abs() < 0.03, "{case:?}");
    Stop {
        beyond,
        rest: line - s,
    }
}

#[test]
fn stops_before_the_line_as_promised() {
    let bends = [
        (0.0, &[0.3, 0.7, 1.0, 1.5, 2.0, 2.5][..]),
        (0.3, &[0.3, 1.0, 1.6]),
        (-0.8, &[0.3, 1.0]),
    ];
    let mut worst = f64::NEG_INFINITY;
    let mut shortest = f64::NEG_INFINITY;
    for mode in MODES {
        for (curvature, speeds) in bends {
            for (i, speed) in speeds.iter().enumerate() {
                for (is_emergency, noise) in
                    [(false, false), (false, true), (true, false), (true, true)]
                {
                    let case = Case {
                        mode,
                        speed: *speed,
                        curvature,
                        slope: if noise {
                            [-0.05, 0.0, 0.05][i % 3]
                        } else {
                            0.0
                        },
                        is_emergency,
                        noise,
                        controller: FollowController::Pvfc,
                    };
                    let got = stop(&case);
                    worst = worst.max(got.beyond);
                    shortest = shortest.max(got.rest);
                }
            }
        }
    }
    assert!(worst <= 0.0, "{worst}");
    assert!(shortest < 0.15, "{shortest}");
}

#[test]
fn every_follower_stops_before_the_line() {
    for controller in [
        FollowController::PurePursuit,
        FollowController::Stanley,
        FollowController::Lqr,
    ] {
        for mode in MODES {
            for (curvature, speed, is_emergency) in
                [(0.0, 1.5, false), (0.8, 0.9, false), (0.8, 0.9, true)]
            {
                let case = Case {
                    mode,
                    speed,
                    curvature,
                    slope: 0.0,
                    is_emergency,
                    noise: true,
                    controller,
                };
                let got = stop(&case);
                assert!(got.beyond <= 0.0, "{case:?}: {}", got.beyond);
            }
        }
    }
}

#[test]
fn waits_until_there_is_way_enough_and_arrives_in_the_end() {
    for mode in MODES {
        for controller in [
            FollowController::Pvfc,
            FollowController::PurePursuit,
            FollowController::Stanley,
            FollowController::Lqr,
        ] {
            let mut ride = Ride::new(mode);
            ride.follow.controller = controller;
            ride.sensors = noisy();
            let path = demo_course();
            let what = format!("{mode:?} {controller:?}");
            let mut bike = Stepper::new(&ride, &path);
            // In the middle of the first bend.
            bike.controller.set_stop(Some(2.5));
            assert!(bike.until(20.0, |_, out| out.waiting), "{what}");
            let mut s = bike.rear_on(&path, 2.5);
            assert!(s < 2.5 && s > 2.35, "{what}: {s}");
            // It does not creep after a line that crawls.
            bike.controller.set_stop(Some(2.85));
            assert!(!bike.until(4.0, |_, out| !out.waiting), "{what}");
            bike.controller.set_stop(Some(5.0));
            assert!(
                bike.until(20.0, |bike, out| out.waiting
                    && bike.controller.rear_arc_length() > 4.5),
                "{what}"
            );
            s = bike.rear_on(&path, 5.0);
            assert!(s < 5.0 && s > 4.85, "{what}: {s}");
            bike.controller.set_stop(None);
            let mut phases = Vec::new();
            assert!(
                bike.until(40.0, |_, out| {
                    if phases.last() != Some(&out.phase) {
                        phases.push(out.phase);
                    }
                    out.arrived
                }),
                "{what} {phases:?}"
            );
            assert_eq!(
                phases,
                [Phase::Start, Phase::Cruise, Phase::Brake, Phase::Hold],
                "{what}"
            );
            let off = (bike.state.pose.position - path.end_pose().position).norm();
            assert!(
                off < 0.03 && !bike.fell && bike.violations == 0,
                "{what}: {off}"
            );
        }
    }
}

#[test]
fn rides_at_sight_without_stopping() {
    // The line moves on with every scan, ten times a second, always 2 m ahead.
    for mode in MODES {
        for controller in [FollowController::Pvfc, FollowController::Lqr] {
            for noise in [false, true] {
                let mut ride = Ride::new(mode);
                ride.follow.controller = controller;
                if noise {
                    ride.sensors = noisy();
                }
                ride_at_sight(&ride, noise);
            }
        }
    }
}

fn ride_at_sight(ride: &Ride, noise: bool) {
    let path = demo_course();
    let what = format!("{:?} {:?} {noise}", ride.mode, ride.follow.controller);
    let mut bike = Stepper::new(ride, &path);
    let (mut s, mut ticks, mut line) = (0.0, 0, 2.0);
    let (mut fastest, mut step): (f64, f64) = (0.0, 0.0);
    let mut before: Option<f64> = None;
    let arrived = bike.until(60.0, |bike, out| {
        s = bike.rear_on(&path, s);
        assert!(s <= line, "{what}: {s} of {line}");
        assert!(!out.waiting && !out.emergency, "{what} at {s}");
        if ticks % 20 == 0 {
            line = s + 2.0;
            bike.controller
                .set_stop((line < path.length()).then_some(line));
        }
        ticks += 1;
        fastest = fastest.max(bike.state.speed);
        if let Some(force) = before.filter(|_| out.phase == Phase::Cruise) {
            step = step.max((out.command.drive_force - force).abs());
        }
        before = Some(out.command.drive_force);
        out.arrived
    });
    assert!(arrived && !bike.fell && bike.violations == 0, "{what}");
    // Service braking from 1.3 m/s takes 1.7 m; the line has come 0.1 m nearer before it moves.
    assert!(fastest > 1.1 && fastest < 1.4, "{what}: {fastest}");
    // Between braking and speeding up there are 0.8 m/s^2, on 50 kg; noise of the speed makes more than that.
    assert!(noise || step < 40.0, "{what}: {step}");
}

#[test]
fn a_line_before_the_first_tick_keeps_it_standing() {
    for line in [-1.0, 0.0, 0.2, f64::NAN, f64::NEG_INFINITY] {
        let mut ride = Ride::new(BalancerMode::Flywheel);
        ride.speed = 0.0;
        let mut bike = Stepper::new(&ride, &demo_course());
        bike.controller.set_stop(Some(line));
        assert!(!bike.until(3.0, |_, out| !out.waiting), "{line}");
        assert!(bike.state.speed.abs() < 1e-3);
        bike.controller.set_stop(Some(f64::INFINITY));
        assert!(bike.until(40.0, |_, out| out.arrived), "{line}");
        assert_eq!(bike.violations, 0);
    }
}

#[test]
fn keeps_to_a_greatest_speed_and_comes_back_from_it_gently() {
    for mode in MODES {
        let ride = Ride::new(mode);
        let path = straight_then_arc(25.0, 0.0, 1.0);
        let mut bike = Stepper::new(&ride, &path);
        bike.until(8.0, |_, _| false);
        assert!((bike.state.speed - 1.5).abs() < 0.01);
        bike.controller.set_speed_cap(Some(0.6));
        let mut before = bike.state.speed;
        let mut hardest: f64 = 0.0;
        bike.until(4.0, |bike, _| {
            hardest = hardest.max((bike.state.speed - before).abs() / common::CONTROL_PERIOD);
            before = bike.state.speed;
            false
        });
        assert!(
            (bike.state.speed - 0.6).abs() < 0.01,
            "{}",
            bike.state.speed
        );
        // Service braking; the law rounds its corners with less.
        assert!(hardest < 0.6, "{hardest}");
        bike.controller.set_speed_cap(None);
        assert_eq!(bike.controller.speed_cap(), None);
        hardest = 0.0;
        bike.until(4.0, |bike, _| {
            hardest = hardest.max((bike.state.speed - before) / common::CONTROL_PERIOD);
            before = bike.state.speed;
            false
        });
        assert!(bike.state.speed > 1.4 && hardest < 0.45, "{hardest}");
        assert_eq!(bike.violations, 0);
    }
}

#[test]
fn a_line_may_appear_anywhere_at_any_moment() {
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut uniform =
        |a: f64, b: f64| a + (b - a) * ((rng.next_u64() >> 11) as f64 * (0.5f64).powi(53));
    let controllers = [
        FollowController::Pvfc,
        FollowController::PurePursuit,
        FollowController::Stanley,
        FollowController::Lqr,
    ];
    let mut beyond = [f64::NEG_INFINITY; 2];
    for i in 0..96 {
        let mut ride = Ride::new(MODES[i % 2]);
        ride.follow.controller = controllers[i / 2 % 4];
        ride.slope_force = WEIGHT * uniform(-0.05, 0.05);
        ride.sensors = noisy();
        ride.speed = 0.0;
        let path = if i % 3 == 0 { slalom() } else { demo_course() };
        let mut bike = Stepper::new(&ride, &path);
        let mut s = 0.0;
        bike.until(uniform(0.5, 9.0), |bike, _| {
            s = bike.rear_on(&path, s);
            false
        });
        let is_emergency = i % 2 == i / 8 % 2;
        let speed = bike.state.speed;
        let controller = &mut bike.controller;
        let line = s + if is_emergency {
            // First one that is far enough away, then it comes nearer.
            controller.set_stop(Some(s + 3.0));
            controller.least_stopping_distance(speed)
        } else {
            controller.stopping_distance(speed)
        };
        controller.set_stop(Some(line));
        bike.until(10.0, |bike, _| {
            s = bike.rear_on(&path, s);
            beyond[usize::from(is_emergency)] = beyond[usize::from(is_emergency)].max(s - line);
            false
        });
        let what = format!("{i}: {:?} {:?}", ride.mode, ride.follow.controller);
        let out = bike.tick();
        assert!(out.waiting || out.arrived, "{what}: {s} of {line}");
        assert!(!bike.fell && bike.violations == 0, "{what}");
    }
    assert!(beyond[0] <= 0.0 && beyond[1] <= 0.0, "{beyond:?}");
}

#[test]
fn lines_that_come_and_go_do_not_upset_the_bike() {
    use rand::{Rng, SeedableRng};
    for seed in 0..24 {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(100 + seed);
        let mut uniform =
            move |a: f64, b: f64| a + (b - a) * ((rng.next_u64() >> 11) as f64 * (0.5f64).powi(53));
        let mut ride = Ride::new(MODES[seed as usize % 2]);
        ride.follow.controller = [
            FollowController::Pvfc,
            FollowController::PurePursuit,
            FollowController::Stanley,
            FollowController::Lqr,
        ][seed as usize / 2 % 4];
        ride.sensors = noisy();
        let path = if seed % 3 == 0 {
            slalom()
        } else {
            demo_course()
        };
        let mut bike = Stepper::new(&ride, &path);
        let (mut s, mut next) = (0.0, 0.5);
        let what = format!("{seed}: {:?} {:?}", ride.mode, ride.follow.controller);
        // What nobody would do: every half second another line or none, near or far, and another speed.
        let mut worst: f64 = 0.0;
        bike.until(25.0, |bike, out| {
            s = bike.rear_on(&path, s);
            worst = worst.max(out.lateral_error.abs());
            if bike.time > next {
                next = bike.time + uniform(0.1, 1.0);
                let line = s + uniform(-0.5, 4.0);
                bike.controller
                    .set_stop((uniform(0.0, 1.0) < 0.7).then_some(line));
                bike.controller
                    .set_speed_cap((uniform(0.0, 1.0) < 0.3).then_some(uniform(0.0, 1.5)));
            }
            bike.fell
        });
        assert!(!bike.fell && bike.violations == 0, "{what}");
        bike.controller.set_stop(None);
        bike.controller.set_speed_cap(None);
        assert!(bike.until(40.0, |_, out| out.arrived), "{what}");
        let off = (bike.state.pose.position - path.end_pose().position).norm();
        assert!(off < 0.06, "{what}: {off}");
    }
}

#[test]
fn on_slippery_ground_it_promises_less_and_keeps_it() {
    for mode in MODES {
        for friction in [0.18, 0.25] {
            let mut ride = Ride::new(mode);
            ride.bike.friction = friction;
            ride.truth.friction = friction;
            let path = straight_then_arc(4.0, 0.7, 8.0);
            let mut bike = Stepper::new(&ride, &path);
            let limits = bike.controller.braking_limits();
            assert!(limits.emergency < 0.95 && limits.service <= 0.75 * limits.emergency);
            let mut s = 0.0;
            assert!(bike.until(20.0, |bike, _| {
                s = bike.rear_on(&path, s);
                s > 6.0
            }));
            let line = s + bike.controller.least_stopping_distance(bike.state.speed);
            bike.controller.set_stop(Some(line));
            assert!(bike.until(10.0, |_, out| out.waiting));
            s = bike.rear_on(&path, s);
            // A tyre that slides for 20 ms counts as a fall.
            assert!(
                !bike.fell && s <= line && s > line - 0.15,
                "{mode:?} {friction}: {s} of {line}"
            );
        }
    }
}
