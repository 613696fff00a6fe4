//! Balance alone, on the two-link plant: how far it recovers, and through a mode change.

use bikebot_control::supervisor::{ShiftConditions, Supervisor};
use bikebot_control::{BalanceController, BalanceParams, RollModel};
use bikebot_dynamics::{
    Actuators, BalancerMode, BikeParams, Integrator, Offset, Rk4, TwoLink, TwoLinkInput,
    TwoLinkState,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const CONTROL: f64 = 0.002;

/// What a run came to; roll in degrees.
#[derive(Debug, Default)]
struct Outcome {
    fell: bool,
    recovered: bool,
    roll_max: f64,
    speed_max: f64,
    torque_max: f64,
    end: TwoLinkState,
}

/// One run.
struct Run {
    control: f64,
    bike: BikeParams,
    balance: BalanceParams,
    start: TwoLinkState,
    duration: f64,
    roll_moment: f64,
    roll_bias: f64,
    roll_noise: f64,
}

impl Run {
    /// Nothing happens to a bike in flywheel mode.
    fn of(bike: BikeParams) -> Self {
        Self {
            control: CONTROL,
            bike,
            balance: BalanceParams::default(),
            start: TwoLinkState::default(),
            duration: 10.0,
            roll_moment: 0.0,
            roll_bias: 0.0,
            roll_noise: 0.0,
        }
    }
}

/// Runs it; `offset` gives the balancer's offset at each control tick.
fn run(run: Run, mut offset_at: impl FnMut(f64, &TwoLinkState) -> Offset) -> Outcome {
    let mut controller =
        BalanceController::new(&run.bike, BalancerMode::Flywheel, &run.balance, run.control)
            .unwrap();
    let motor = Actuators::new(&run.bike);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut uniform = || (rng.next_u64() >> 11) as f64 * 0.5f64.powi(53);
    let mut state = run.start;
    let mut out = Outcome {
        recovered: true,
        ..Outcome::default()
    };
    for tick in 0..(run.duration / run.control).round() as usize {
        let t = tick as f64 * run.control;
        let offset = offset_at(t, &state);
        controller.set_offset(offset.d);
        // Twelve uniforms less six: unit variance, close enough to normal.
        let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut measured = state;
        measured.roll += run.roll_bias + run.roll_noise * noise;
        let command = controller.torque(&measured).torque;
        let model = TwoLink::new(&run.bike, offset);
        for _ in 0..2 {
            let (balancer_torque, _, _) = motor.balancer_torque(command, state.balancer_rate);
            out.torque_max = out.torque_max.max(balancer_torque.abs());
            let input = TwoLinkInput {
                balancer_torque,
                roll_moment: run.roll_moment,
            };
            state = Rk4.step(&model, t, &state, &input, 0.5 * run.control);
        }
        out.roll_max = out.roll_max.max(state.roll.abs().to_degrees());
        out.speed_max = out.speed_max.max(state.balancer_rate.abs());
        if state.roll.abs() > 0.7 {
            out.fell = true;
            break;
        }
    }
    out.recovered =
        !out.fell && state.roll.abs().to_degrees() < 0.5 && state.roll_rate.abs() < 0.05;
    out.end = state;
    out
}

fn without_observer() -> BalanceParams {
    BalanceParams {
        observer: false,
        ..BalanceParams::default()
    }
}

fn recover(mode: BalancerMode, degrees: f64) -> Outcome {
    let bike = BikeParams::default();
    let offset = Offset {
        d: bike.offset(mode),
        ..Offset::default()
    };
    let what = Run {
        balance: without_observer(),
        start: TwoLinkState {
            roll: degrees.to_radians(),
            ..TwoLinkState::default()
        },
        duration: 8.0,
        ..Run::of(bike)
    };
    run(what, |_, _| offset)
}

#[test]
fn recovers_from_as_much_roll_as_the_actuator_allows() {
    // Peak speed, rad/s, and torque, N m, of the design note; None where it falls.
    let flywheel = [
        (1.0, Some((3.0, 19.0))),
        (3.0, Some((8.0, 57.0))),
        (5.0, Some((14.0, 70.0))),
        (8.0, Some((26.0, 70.0))),
        (9.0, Some((32.0, 70.0))),
        (10.0, Some((39.0, 70.0))),
        (11.0, Some((40.0, 70.0))),
        (12.0, None),
    ];
    let balancer = [
        (1.0, Some((2.0, 20.0))),
        (3.0, Some((7.0, 52.0))),
        (5.0, Some((13.0, 70.0))),
        (8.0, Some((21.0, 70.0))),
        (9.0, Some((27.0, 70.0))),
        (10.0, None),
        (12.0, None),
    ];
    let rows = flywheel
        .iter()
        .map(|row| (BalancerMode::Flywheel, row))
        .chain(balancer.iter().map(|row| (BalancerMode::Balancer, row)));
    for (mode, (degrees, expected)) in rows {
        let out = recover(mode, *degrees);
        match expected {
            None => assert!(!out.recovered, "{mode:?} {degrees} deg: {out:?}"),
            Some((speed, torque)) => {
                assert!(
                    !out.fell && out.end.roll.abs().to_degrees() < 0.5,
                    "{mode:?} {degrees} deg: {out:?}"
                );
                // The table is rounded to whole numbers; half a unit and a quarter on top.
                assert!(
                    out.speed_max <= 1.25 * speed + 0.5,
                    "{mode:?} {degrees} deg: {out:?}"
                );
                assert!(
                    out.torque_max <= (1.25 * torque + 0.5f64).min(70.0),
                    "{mode:?} {degrees} deg: {out:?}"
                );
            }
        }
    }
}

#[test]
fn zero_dynamics_decay_at_kappa() {
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        let bike = BikeParams::default();
        let offset = Offset {
            d: bike.offset(mode),
            ..Offset::default()
        };
        let model = RollModel::new(&bike, offset.d);
        let rate = |control: f64| {
            let p_after = |duration: f64| {
                let what = Run {
                    control,
                    balance: without_observer(),
                    start: TwoLinkState {
                        roll: 1f64.to_radians(),
                        ..TwoLinkState::default()
                    },
                    duration,
                    ..Run::of(bike)
                };
                let out = run(what, |_, _| offset);
                out.end.roll + model.inertia.value(out.end.balancer)
            };
            // By 12 s what is left of the output's triple pole is below 1e-6 of the slow mode.
            (p_after(12.0) / p_after(14.0)).ln() / 2.0
        };
        // Holding the torque over a period shifts the rate in proportion to the period, by 2.5 %
        // at 2 ms in balancer mode; extrapolated to none it is kappa.
        let (held, fine) = (rate(CONTROL), rate(0.1 * CONTROL));
        assert!((held - 1.0).abs() < 0.03, "{mode:?}: {held}");
        let continuous = (10.0 * fine - held) / 9.0;
        assert!((continuous - 1.0).abs() < 5e-4, "{mode:?}: {continuous}");
    }
}

#[test]
fn the_balancer_comes_to_rest_under_a_constant_moment_and_a_biased_sensor() {
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        for (moment, bias, roll_max, speed_max) in match mode {
            BalancerMode::Flywheel => [(5.0, 0.0, 1.39, 5.7), (0.0, 1.0, 1.14, 6.0)],
            BalancerMode::Balancer => [(5.0, 0.0, 4.71, 4.9), (0.0, 1.0, 3.80, 5.3)],
        } {
            let bike = BikeParams::default();
            let offset = Offset {
                d: bike.offset(mode),
                ..Offset::default()
            };
            let what = Run {
                balance: without_observer(),
                duration: 20.0,
                roll_moment: moment,
                roll_bias: f64::to_radians(bias),
                ..Run::of(bike)
            };
            let out = run(what, |_, _| offset);
            assert!(
                !out.fell && out.end.balancer_rate.abs() < 0.01,
                "{mode:?}: {out:?}"
            );
            assert!(
                out.roll_max <= 1.25 * roll_max && out.speed_max <= 1.25 * speed_max,
                "{mode:?}: {out:?}"
            );
        }
    }
}

/// To balancer mode and back, each shift as soon as its conditions hold, back after 1 s.
fn there_and_back(roll: f64, duration: f64, noise: f64) -> (Outcome, Supervisor) {
    let bike = BikeParams::default();
    let mut supervisor = Supervisor::new(&bike, BalancerMode::Flywheel);
    supervisor
        .request(BalancerMode::Balancer, duration)
        .unwrap();
    let mut arrived = None;
    let lambda = bike.roll_rate(0.0);
    let what = Run {
        start: TwoLinkState {
            roll: roll.to_radians(),
            ..TwoLinkState::default()
        },
        duration: 25.0,
        roll_noise: f64::to_radians(noise),
        ..Run::of(bike)
    };
    let out = run(what, |t, state| {
        supervisor.tick(
            &ShiftConditions {
                acceleration: 0.0,
                divergent: state.roll + state.roll_rate / lambda,
                balancer: state.balancer,
                balancer_rate: state.balancer_rate,
            },
            CONTROL,
        );
        if arrived.is_none() && supervisor.mode() == BalancerMode::Balancer {
            arrived = Some(t);
        }
        if arrived.is_some_and(|at| t > at + 1.0) && supervisor.change().is_none() {
            supervisor
                .request(BalancerMode::Flywheel, duration)
                .unwrap();
        }
        supervisor.offset()
    });
    (out, supervisor)
}

/// To offset `to` and back along quintics of `duration` seconds, from 1 s, with 4 s between.
fn scheduled(bike: BikeParams, roll: f64, duration: f64, noise: f64, to: f64) -> Outcome {
    let share = |u: f64| {
        let u = u.clamp(0.0, 1.0);
        u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    };
    let at = |t: f64| to * (share((t - 1.0) / duration) - share((t - 5.0 - duration) / duration));
    let what = Run {
        balance: without_observer(),
        start: TwoLinkState {
            roll: roll.to_radians(),
            ..TwoLinkState::default()
        },
        duration: 20.0,
        roll_noise: f64::to_radians(noise),
        ..Run::of(bike)
    };
    run(what, |t, _| {
        let h = 1e-4;
        Offset {
            d: at(t),
            rate: (at(t + h) - at(t - h)) / (2.0 * h),
            acceleration: (at(t + h) - 2.0 * at(t) + at(t - h)) / (h * h),
        }
    })
}

#[test]
fn shifts_there_and_back_as_the_design_note_did() {
    // Start roll, shift time, noise; greatest roll, speed and torque of the design note.
    for (roll, duration, noise, roll_max, speed_max, torque_max) in [
        (0.0, 2.0, 0.0, 0.0, 0.0, 0.0),
        (2.0, 1.0, 0.0, 3.38, 5.4, 38.0),
        (5.0, 2.0, 0.0, 5.00, 13.8, 70.0),
        (5.0, 0.5, 0.0, 5.00, 13.8, 70.0),
        (0.0, 2.0, 0.2, 0.74, 0.3, 15.0),
    ] {
        let out = scheduled(BikeParams::default(), roll, duration, noise, 0.15);
        let what = format!("{roll} deg, {duration} s, {noise} deg noise: {out:?}");
        let slack = 1e-9;
        assert!(!out.fell, "{what}");
        assert!(out.roll_max <= 1.25 * roll_max + slack, "{what}");
        assert!(out.torque_max <= 1.25 * torque_max + slack, "{what}");
        if noise == 0.0 {
            assert!(out.speed_max <= 1.25 * speed_max + slack, "{what}");
            assert!(out.end.roll.abs().to_degrees() < 0.01, "{what}");
        }
    }
}

#[test]
fn shifts_there_and_back_when_the_conditions_hold() {
    for (roll, duration, noise) in [
        (0.0, 2.0, 0.0),
        (2.0, 1.0, 0.0),
        (5.0, 2.0, 0.0),
        (0.0, 2.0, 0.2),
    ] {
        let (out, supervisor) = there_and_back(roll, duration, noise);
        assert!(
            !out.fell && out.roll_max <= 5.0,
            "{roll} deg, {noise} deg noise: {out:?}"
        );
        assert_eq!(supervisor.mode(), BalancerMode::Flywheel);
        assert!(supervisor.change().is_none());
    }
}

#[test]
fn a_low_pivot_falls_on_the_way_to_a_large_offset_and_stands_as_flywheel() {
    assert!(scheduled(BikeParams::low_pivot(), 0.0, 2.0, 0.02, 0.2).fell);
    assert!(!scheduled(BikeParams::low_pivot(), 0.0, 2.0, 0.02, 0.0).fell);
}
