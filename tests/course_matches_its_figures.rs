//! The reference course (`scenarios/course.toml`), ridden in both modes, against figures computed
//! independently (`tests/data/vectors/acceptance.json`, rows `nominal` and `no_preview`).

mod common;

use bikebot::sim::{Metrics, RunOutcome};

/// The reference row of a case.
fn reference(case: &str) -> serde_json::Value {
    let path = common::root().join("tests/data/vectors/acceptance.json");
    let text = std::fs::read_to_string(path).expect("the reference figures");
    let all: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    all["closed_loop"][case].clone()
}

/// A quarter more than the reference is allowed; less is welcome.
fn within(row: &serde_json::Value, key: &str, found: Option<f64>) {
    let wanted = row[key].as_f64().expect("a number in the reference");
    let found = found.unwrap_or_else(|| panic!("{key} was not measured"));
    assert!(found <= 1.25 * wanted, "{key}: {found} against {wanted}");
}

fn nominal(mode: &str) -> (serde_json::Value, Metrics) {
    let (report, _) = common::ride("course.toml", &[&format!("bike.mode=\"{mode}\"")]);
    assert_eq!(report.outcome, RunOutcome::Arrived, "{}", report.reason);
    assert_eq!(report.metrics.passivity_violations, Some(0));
    (reference(&format!("{mode}/nominal")), report.metrics)
}

fn holds_the_nominal_row(mode: &str) {
    let (row, found) = nominal(mode);
    within(&row, "lat_own_max", found.lateral_error_max_m);
    within(&row, "lat_own_rms", found.lateral_error_rms_m);
    within(&row, "lat_rear_max", found.rear_error_max_m);
    within(&row, "roll_max_deg", found.roll_max_deg);
    within(&row, "tau_max", found.balancer_torque_max_nm);
    within(&row, "tau_rms", found.balancer_torque_rms_nm);
}

#[test]
fn flywheel_mode_holds_the_nominal_row() {
    holds_the_nominal_row("flywheel");
}

#[test]
fn balancer_mode_holds_the_nominal_row() {
    holds_the_nominal_row("balancer");
}

/// What a turn asks of the balancer when nobody leans into it beforehand.
#[test]
fn without_preview_the_flywheel_works_nine_times_as_hard() {
    let (with, _) = common::ride("course.toml", &[]);
    let (without, _) = common::ride("course.toml", &["balance.preview=false"]);
    assert_eq!(without.outcome, RunOutcome::Arrived, "{}", without.reason);
    let row = reference("flywheel/no_preview");
    let torque = |metrics: &Metrics| metrics.balancer_torque_max_nm.expect("measured");
    within(&row, "tau_max", without.metrics.balancer_torque_max_nm);
    assert!(torque(&without.metrics) > 0.75 * row["tau_max"].as_f64().expect("a number"));
    assert!(torque(&without.metrics) > 5.0 * torque(&with.metrics));
}

#[test]
fn without_preview_balancer_mode_falls() {
    let (report, _) = common::ride(
        "course.toml",
        &["bike.mode=\"balancer\"", "balance.preview=false"],
    );
    assert_eq!(report.outcome, RunOutcome::Fell, "{}", report.reason);
}
