//! Claim: one control tick of the whole bike takes at most 20 µs, a two-hundred-and-fiftieth of
//! its 5 ms period.
//!
//! `ride` is the mean over a ride of the demo course, previews included; `preview` the worst kind
//! of tick, in which the lean preview looks ahead; `balance` the balance law alone.

use std::hint::black_box;

use bikebot_control::{BalanceController, BalanceParams, FollowParams, RideController};
use bikebot_dynamics::{
    Actuators, BalancerMode, Bike, BikeInput, BikeParams, BikeState, Integrator, Measurement, Rk4,
    TwoLinkState,
};
use bikebot_geometry::{CurvePath, FergusonCurve, Pose2};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};

const PERIOD: f64 = 0.005;

fn course() -> CurvePath {
    let poses = [
        Pose2::new(1.0, 1.0, 0.0),
        Pose2::new(4.8, 2.2, 0.96),
        Pose2::new(7.0, 5.6, 0.52),
        Pose2::new(8.0, 8.0, std::f64::consts::FRAC_PI_2),
    ];
    let segments = poses
        .windows(2)
        .map(|p| FergusonCurve::between(p[0], p[1], 1.2 * (p[1].position - p[0].position).norm()))
        .collect();
    CurvePath::new(segments).expect("the waypoints join")
}

fn controller(balance: &BalanceParams, start: &Measurement) -> RideController {
    RideController::new(
        &BikeParams::default(),
        BalancerMode::Balancer,
        &FollowParams::default(),
        balance,
        &course(),
        start,
        PERIOD,
    )
    .expect("the course can be ridden")
}

/// What the sensors said on the way: 9 s of cruising.
fn measurements() -> Vec<Measurement> {
    let bike = Bike::new(BikeParams::default());
    let mut motors = Actuators::new(&bike.params);
    let mut state = BikeState::upright(course().start_pose(), 0.3);
    let start = Measurement::ideal(&state, 0.0);
    let mut controller = controller(&BalanceParams::default(), &start);
    (0..1800)
        .map(|tick| {
            let m = Measurement::ideal(&state, motors.steer_rate());
            let out = controller.tick(&m).expect("measurements are finite");
            for _ in 0..2 {
                let applied =
                    motors.apply(&out.command, state.steer, state.balancer_rate, 0.5 * PERIOD);
                let input = BikeInput {
                    drive_force: applied.drive_force,
                    steer_rate: applied.steer_rate,
                    balancer_torque: applied.balancer_torque,
                    offset: out.offset,
                    ..BikeInput::default()
                };
                state = Rk4.step(
                    &bike,
                    PERIOD * f64::from(tick),
                    &state,
                    &input,
                    0.5 * PERIOD,
                );
            }
            m
        })
        .collect()
}

fn control_tick(c: &mut Criterion) {
    let ride = measurements();
    let mut group = c.benchmark_group("control_tick");

    let mut along = controller(&BalanceParams::default(), &ride[0]);
    let mut i = 0;
    group.bench_function("ride", |b| {
        b.iter(|| {
            if i == ride.len() {
                along = controller(&BalanceParams::default(), &ride[0]);
                i = 0;
            }
            i += 1;
            along.tick(black_box(&ride[i - 1]))
        });
    });

    let fresh = controller(&BalanceParams::default(), &ride[0]);
    group.bench_function("preview", |b| {
        b.iter_batched_ref(
            || fresh.clone(),
            // The first tick of a ride looks ahead.
            |controller| controller.tick(black_box(&ride[0])),
            BatchSize::SmallInput,
        );
    });

    let mut balance = BalanceController::new(
        &BikeParams::default(),
        BalancerMode::Balancer,
        &BalanceParams::default(),
        PERIOD,
    )
    .expect("the default bike balances");
    let state = TwoLinkState {
        roll: 0.02,
        ..TwoLinkState::default()
    };
    group.bench_function("balance", |b| b.iter(|| balance.torque(black_box(&state))));
    group.finish();
}

criterion_group!(benches, control_tick);
criterion_main!(benches);
