//! The path followers side by side on the shipped courses; `--nocapture` prints the table of
//! docs/following.md.

#![expect(clippy::print_stdout, reason = "a table is what this prints")]

mod common;

use bikebot_sim::RunOutcome;
use bikebot_sim::outcome::Metrics;

const COURSE: &str = include_str!("../../../scenarios/course.toml");
const SMOOTH: &str = include_str!("../../../scenarios/course-smooth.toml");
const EIGHT: &str = include_str!("../../../scenarios/figure-eight.toml");
const CONTROLLERS: [&str; 4] = ["pvfc", "pure_pursuit", "stanley", "lqr"];

fn ride(text: &str, changes: &[&str]) -> Metrics {
    let report = common::ride(&common::setup(text, changes), &mut ());
    assert_eq!(
        report.outcome,
        RunOutcome::Arrived,
        "{changes:?}: {} {:?}",
        report.reason,
        report.metrics
    );
    report.metrics
}

fn value(metric: Option<f64>) -> f64 {
    metric.expect("a bike that rides has this metric")
}

fn mm(metric: Option<f64>) -> f64 {
    1e3 * value(metric)
}

#[test]
fn the_velocity_field_has_the_least_error_of_the_four() {
    for (name, text) in [
        ("course", COURSE),
        ("course, smooth", SMOOTH),
        ("figure of eight", EIGHT),
    ] {
        for mode in ["flywheel", "balancer"] {
            let rides = CONTROLLERS.map(|controller| {
                ride(
                    text,
                    &[
                        &format!("bike.mode={mode}"),
                        &format!("follow.controller={controller}"),
                    ],
                )
            });
            for (controller, m) in CONTROLLERS.iter().zip(&rides) {
                println!(
                    "| {name} | {mode} | {controller} | {:.1} / {:.1} | {:.1} | {:.1} | {:.1} / {:.2} | {:.1} | {:.1} |",
                    mm(m.lateral_error_max_m),
                    mm(m.lateral_error_rms_m),
                    mm(m.rear_error_max_m),
                    value(m.roll_max_deg),
                    value(m.balancer_torque_max_nm),
                    value(m.balancer_torque_rms_nm),
                    value(m.time_s),
                    value(m.end_heading_error_deg),
                );
            }
            let [field, others @ ..] = &rides;
            for other in others {
                assert!(
                    field.lateral_error_max_m < other.lateral_error_max_m
                        && field.lateral_error_rms_m < other.lateral_error_rms_m,
                    "{name}, {mode}"
                );
            }
        }
    }
}

#[test]
fn rear_wheel_and_followed_point_are_both_where_they_should_be() {
    for mode in ["bike.mode=flywheel", "bike.mode=balancer"] {
        // Torque of the design note, 1.4 and 6.6 N m rms over the ride.
        let most = if mode.ends_with("flywheel") { 1.4 } else { 6.6 };
        for (text, followed) in [(SMOOTH, 5.0), (COURSE, 30.0)] {
            let m = ride(text, &[mode]);
            assert!(mm(m.rear_error_max_m) <= 15.0, "{mode}: {m:?}");
            assert!(mm(m.lateral_error_max_m) <= followed, "{mode}: {m:?}");
            assert!(value(m.balancer_torque_rms_nm) <= most, "{mode}: {m:?}");
            assert_eq!(m.passivity_violations, Some(0), "{mode}: {m:?}");
            // Without an average over the end the heading there is the planned one.
            assert!(value(m.end_heading_error_deg) < 0.5, "{mode}: {m:?}");
        }
    }
}

#[test]
fn the_energy_balances_on_slopes_with_the_tank_and_without() {
    for (name, text) in [
        ("course", COURSE),
        ("course, smooth", SMOOTH),
        ("figure of eight", EIGHT),
    ] {
        for grade in [-0.05, 0.05] {
            for tank in [true, false] {
                let slope = format!("disturbance=[{{kind=\"slope\",grade={grade}}}]");
                let tank = format!("follow.energy_tank={tank}");
                let m = ride(text, &[&slope, &tank]);
                let what = format!("{name}, {grade}, {tank}: {m:?}");
                // Every tick to 1e-9 J.
                assert_eq!(m.passivity_violations, Some(0), "{what}");
                assert!(mm(m.lateral_error_max_m) < 5.0, "{what}");
            }
        }
    }
}
