//! Balance: the bike stands on the spot, 5 degrees off upright, and levels itself.
//!
//! `cargo run --release --example balance`

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::control::{BalanceController, BalanceParams};
use bikebot::dynamics::{
    Actuators, BalancerMode, BikeParams, Integrator, Rk4, TwoLink, TwoLinkInput, TwoLinkState,
};

const CONTROL_PERIOD: f64 = 0.002;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bike = BikeParams::default();
    let mode = BalancerMode::Flywheel;

    // ANCHOR: setup
    // The controller believes in the same bike that it is given to balance.
    let plant = TwoLink::new(&bike, bike.offset(mode));
    let motor = Actuators::new(&bike);
    let mut controller =
        BalanceController::new(&bike, mode, &BalanceParams::default(), CONTROL_PERIOD)?;
    let mut state = TwoLinkState {
        roll: 5f64.to_radians(),
        ..TwoLinkState::default()
    };
    // ANCHOR_END: setup

    println!("  time s  roll deg  flywheel rad/s  torque N m");
    for tick in 0..4000 {
        let time = CONTROL_PERIOD * f64::from(tick);
        // ANCHOR: tick
        let wanted = controller.torque(&state).torque;
        // The motor may be unable to: 70 N m, and no faster than 40 rad/s.
        let (balancer_torque, _, _) = motor.balancer_torque(wanted, state.balancer_rate);
        let input = TwoLinkInput {
            balancer_torque,
            roll_moment: 0.0,
        };
        state = Rk4.step(&plant, time, &state, &input, CONTROL_PERIOD);
        // ANCHOR_END: tick
        if tick % 250 == 0 {
            println!(
                "{time:8.2} {:9.3} {:15.2} {balancer_torque:11.2}",
                state.roll.to_degrees(),
                state.balancer_rate
            );
        }
    }
    println!(
        "upright again: {:.4} deg, and the flywheel has given its speed back: {:.4} rad/s",
        state.roll.to_degrees(),
        state.balancer_rate
    );
    Ok(())
}
