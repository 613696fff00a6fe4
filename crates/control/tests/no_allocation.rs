//! A control tick does not touch the heap.

// A global allocator cannot be written without it.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bikebot_control::{
    BalanceController, BalanceLawKind, BalanceParams, FollowController, FollowParams, Phase,
    RideController,
};
use bikebot_dynamics::{
    BalancerMode, Bike, BikeInput, BikeParams, BikeState, Integrator, Measurement, Rk4,
    TwoLinkState,
};
use bikebot_geometry::{CurvePath, FergusonCurve, Pose2};

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed to the system allocator unchanged; counting touches only a
// thread-local cell that needs no allocation of its own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: the caller's obligations are the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn allocations() -> usize {
    ALLOCATIONS.with(Cell::get)
}

#[test]
fn a_ride_from_start_to_hold_allocates_nothing_in_its_ticks() {
    for law in [BalanceLawKind::OutputZeroing, BalanceLawKind::Mpc] {
        ride_from_start_to_hold(law, FollowController::Pvfc);
    }
    for follower in [
        FollowController::PurePursuit,
        FollowController::Stanley,
        FollowController::Lqr,
    ] {
        ride_from_start_to_hold(BalanceLawKind::OutputZeroing, follower);
    }
}

fn ride_from_start_to_hold(law: BalanceLawKind, follower: FollowController) {
    let before = allocations();
    drop(std::hint::black_box(vec![0u8; 16]));
    assert!(allocations() > before, "the counter does not count");

    let bike = BikeParams::default();
    let path = CurvePath::new(vec![
        FergusonCurve::between(Pose2::new(0.0, 0.0, 0.0), Pose2::new(3.0, 1.0, 0.7), 3.2),
        FergusonCurve::between(Pose2::new(3.0, 1.0, 0.7), Pose2::new(6.0, 2.0, 0.0), 3.2),
    ])
    .unwrap();
    let mut state = BikeState::upright(path.start_pose(), 0.0);
    let start = Measurement::ideal(&state, 0.0);
    let mut controller = RideController::new(
        &bike,
        BalancerMode::Flywheel,
        &FollowParams {
            controller: follower,
            ..FollowParams::default()
        },
        &BalanceParams {
            controller: law,
            steering_assist: true,
            ..BalanceParams::default()
        },
        &path,
        &start,
        0.005,
    )
    .unwrap();
    // A shift on the way rebuilds the roll model and the preview's weights at every tick.
    controller
        .request_mode(BalancerMode::Balancer, 1.0)
        .unwrap();
    let plant = Bike::new(bike);
    let mut ticks = 0;
    let (mut phases, mut steer_rate, mut waited) = ([false; 4], 0.0, false);
    for tick in 0..6000 {
        let m = Measurement::ideal(&state, steer_rate);
        let before = allocations();
        // A stop on the way, and the way on.
        match tick {
            100 => controller.set_stop(Some(3.0)),
            200 => controller.set_speed_cap(Some(0.8)),
            2500 => controller.set_stop(None),
            _ => {}
        }
        let out = controller.tick(&m).unwrap();
        ticks += allocations() - before;
        phases[out.phase as usize] = true;
        waited |= out.waiting;
        steer_rate = out.command.steer_rate;
        let input = BikeInput {
            drive_force: out.command.drive_force,
            steer_rate,
            balancer_torque: out.command.balancer_torque,
            offset: out.offset,
            ..BikeInput::default()
        };
        for _ in 0..2 {
            state = Rk4.step(&plant, 0.005 * f64::from(tick), &state, &input, 0.0025);
        }
        if out.at_rest && out.arrived {
            break;
        }
    }
    assert!(waited, "{follower:?}");
    assert_eq!(
        phases, [true; 4],
        "{follower:?}: not every phase was ridden"
    );
    assert_eq!(controller.phase(), Phase::Hold);
    assert_eq!(ticks, 0, "{follower:?}");
}

#[test]
fn balance_alone_allocates_nothing() {
    let bike = BikeParams::default();
    for law in [
        BalanceLawKind::OutputZeroing,
        BalanceLawKind::Lqr,
        BalanceLawKind::Mpc,
    ] {
        let params = BalanceParams {
            controller: law,
            ..BalanceParams::default()
        };
        let mut controller =
            BalanceController::new(&bike, BalancerMode::Balancer, &params, 0.002).unwrap();
        let before = allocations();
        for i in 0..100 {
            let roll = 0.005 * f64::from(i);
            std::hint::black_box(controller.torque(&TwoLinkState {
                roll,
                ..TwoLinkState::default()
            }));
        }
        assert_eq!(allocations(), before, "{law:?}");
    }
}
