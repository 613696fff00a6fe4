//! "The bike robot moves from (1, 1, 0°) to (8, 8, 90°) along the generated path": the path-following
//! experiment of the paper (Fig. 7), in both balancer modes, twenty seeds each.

mod common;

use bikebot::sim::RunOutcome;

fn twenty_rides(scenario: &str) {
    let mut failures = Vec::new();
    for seed in 1..=20 {
        let (report, _) = common::ride(scenario, &[&format!("run.seed={seed}")]);
        let m = &report.metrics;
        let least = |value: Option<f64>, bound: f64| value.is_some_and(|value| value > bound);
        let most = |value: Option<f64>, bound: f64| value.is_some_and(|value| value <= bound);
        let slows = match (m.corner_speed_mps, m.speed_max_mps) {
            (Some(corner), Some(top)) => corner <= 0.85 * top,
            _ => false,
        };
        let ok = report.outcome == RunOutcome::Arrived
            && most(m.lateral_error_max_m, 0.020)
            && most(m.lateral_error_rms_m, 0.006)
            && most(m.roll_max_deg, 9.0)
            && most(m.friction_use_rear_max, 0.4)
            && most(m.friction_use_front_max, 0.4)
            && least(m.wheel_load_min_n, 50.0)
            && slows
            && most(m.end_position_error_m, 0.3)
            && m.passivity_violations == Some(0)
            && least(m.min_clearance_m, 0.0);
        if !ok {
            failures.push(format!(
                "seed {seed}: {} ({}) {m:?}",
                report.outcome, report.reason
            ));
        }
    }
    assert!(
        failures.is_empty(),
        "{} of 20 rides of {scenario}:\n{}",
        failures.len(),
        failures.join("\n")
    );
}

#[test]
fn in_flywheel_mode() {
    twenty_rides("fig7.toml");
}

#[test]
fn in_balancer_mode() {
    twenty_rides("fig7-balancer.toml");
}
