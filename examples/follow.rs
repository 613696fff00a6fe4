//! Follow: the whole bike rides a winding path, from rest to rest.
//!
//! `cargo run --release --example follow`

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::control::{BalanceParams, FollowParams, RideController};
use bikebot::dynamics::{
    Actuators, BalancerMode, Bike, BikeInput, BikeParams, BikeState, Integrator, Measurement, Rk4,
};
use bikebot::geometry::{CurvePath, FergusonCurve, Pose2};

const CONTROL_PERIOD: f64 = 0.005;
const PLANT_STEP: f64 = 0.0025;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // ANCHOR: path
    // Poses, joined by Ferguson curves: the way of the rear contact.
    let poses = [
        Pose2::new(0.0, 0.0, 0.0),
        Pose2::new(4.0, 1.5, 0.8),
        Pose2::new(6.0, 5.0, 0.8),
        Pose2::new(9.0, 6.0, 0.0),
    ];
    let curves = poses
        .windows(2)
        .map(|p| FergusonCurve::between(p[0], p[1], 1.2 * (p[1].position - p[0].position).norm()))
        .collect();
    let path = CurvePath::new(curves)?;
    // ANCHOR_END: path

    let bike = BikeParams::default();
    let plant = Bike::new(bike);
    let mut motors = Actuators::new(&bike);
    let mut state = BikeState::upright(path.start_pose(), 0.0);
    let mut controller = RideController::new(
        &bike,
        BalancerMode::Flywheel,
        &FollowParams::default(),
        &BalanceParams::default(),
        &path,
        &Measurement::ideal(&state, 0.0),
        CONTROL_PERIOD,
    )?;

    println!("  time s  phase     x m    y m  speed m/s  error mm  roll deg  torque N m");
    let mut tick = 0;
    loop {
        let time = CONTROL_PERIOD * f64::from(tick);
        // ANCHOR: tick
        let measured = Measurement::ideal(&state, motors.steer_rate());
        let out = controller.tick(&measured)?;
        for _ in 0..2 {
            let applied = motors.apply(&out.command, state.steer, state.balancer_rate, PLANT_STEP);
            let input = BikeInput {
                drive_force: applied.drive_force,
                steer_rate: applied.steer_rate,
                balancer_torque: applied.balancer_torque,
                offset: out.offset,
                ..BikeInput::default()
            };
            state = Rk4.step(&plant, time, &state, &input, PLANT_STEP);
        }
        // ANCHOR_END: tick
        if tick % 100 == 0 || out.at_rest {
            println!(
                "{time:8.2}  {:6} {:6.2} {:6.2} {:10.2} {:9.1} {:9.2} {:11.1}",
                format!("{:?}", out.phase),
                state.pose.position.x,
                state.pose.position.y,
                state.speed,
                1e3 * out.lateral_error,
                state.roll.to_degrees(),
                out.command.balancer_torque
            );
        }
        if out.at_rest || state.roll.abs() > 0.7 {
            break;
        }
        tick += 1;
    }
    let missed = (state.pose.position - path.end_pose().position).norm();
    println!("standing {:.0} mm from the goal", 1e3 * missed);
    Ok(())
}
