//! How far the bike may lean and still be caught (`scenarios/balance-recover.toml`): the table of the
//! two-link model, from rest, for output zeroing in both modes.

mod common;

use bikebot::sim::{RunOutcome, RunReport};

fn from_lean(mode: &str, degrees: f64) -> RunReport {
    common::ride(
        "balance-recover.toml",
        &[
            &format!("bike.mode=\"{mode}\""),
            &format!("start.roll_deg={degrees:?}"),
        ],
    )
    .0
}

/// Peak balancer speed (rad/s) and torque (N m) of the reference, a quarter more allowed.
fn recovers(mode: &str, table: &[(f64, f64, f64)]) {
    for &(degrees, speed, torque) in table {
        let report = from_lean(mode, degrees);
        assert_eq!(
            report.outcome,
            RunOutcome::Arrived,
            "{mode} from {degrees}°: {}",
            report.reason
        );
        let found = (
            report.metrics.balancer_speed_max_radps.expect("measured"),
            report.metrics.balancer_torque_max_nm.expect("measured"),
        );
        assert!(
            found.0 <= 1.25 * speed && found.1 <= 1.25 * torque,
            "{mode} from {degrees}°: {found:?}"
        );
    }
}

#[test]
fn flywheel_mode_recovers_from_eleven_degrees_and_falls_from_twelve() {
    recovers(
        "flywheel",
        &[
            (1.0, 3.0, 19.0),
            (3.0, 8.0, 57.0),
            (5.0, 14.0, 70.0),
            (8.0, 26.0, 70.0),
            (9.0, 32.0, 70.0),
            (10.0, 39.0, 70.0),
            (11.0, 40.0, 70.0),
        ],
    );
    assert_eq!(from_lean("flywheel", 12.0).outcome, RunOutcome::Fell);
}

#[test]
fn balancer_mode_recovers_from_nine_degrees_and_falls_from_ten() {
    recovers(
        "balancer",
        &[
            (1.0, 2.0, 20.0),
            (3.0, 7.0, 52.0),
            (5.0, 13.0, 70.0),
            (8.0, 21.0, 70.0),
            (9.0, 27.0, 70.0),
        ],
    );
    for degrees in [10.0, 11.0, 12.0] {
        assert_eq!(
            from_lean("balancer", degrees).outcome,
            RunOutcome::Fell,
            "from {degrees}°"
        );
    }
}

#[test]
fn the_flywheel_comes_to_rest_by_itself() {
    let (report, trace) = common::ride("balance-recover.toml", &["run.duration_s=8.0"]);
    assert_eq!(report.outcome, RunOutcome::Arrived);
    let (_, speed) = trace.column("balancer_rate_radps").expect("recorded");
    assert!(
        speed.last().is_some_and(|last| last.abs() < 0.05),
        "{:?}",
        speed.last()
    );
}
