//! The supervisor on whole rides: it leaves balancer mode before a margin is gone, slows down, and says so.

mod common;

use bikebot_sim::record::Trace;
use bikebot_sim::{RunOutcome, RunReport};

const COURSE: &str = "format = 1\nname = \"course\"\n[start]\nspeed_mps = 0.3\n[path]\nwaypoints = [[1.0, 1.0, 0.0], [4.8, 2.2, 55.0], [7.0, 5.6, 30.0], [8.0, 8.0, 90.0]]\n[run]\nduration_s = 60.0\n";

fn ride(changes: &[&str]) -> (RunReport, Trace) {
    ride_of(COURSE, changes)
}

fn ride_of(scenario: &str, changes: &[&str]) -> (RunReport, Trace) {
    common::traced(&common::setup(scenario, changes))
}

fn said(trace: &Trace) -> Vec<&str> {
    trace
        .notices
        .iter()
        .filter(|notice| notice.kind == "supervisor")
        .map(|notice| notice.text.as_str())
        .collect()
}

const HIGH: [&str; 2] = ["bike.mode=balancer", "plant.bike.h1_m=0.624"];

#[test]
fn a_bike_a_fifth_higher_than_believed_is_taken_out_of_balancer_mode() {
    // §11.2, height+20%: the balancer swings to 12.9 rad/s at 70 N m and takes half the load off the wheels.
    let (alone, _) = ride(&HIGH);
    let (watched, trace) = ride(&[HIGH[0], HIGH[1], "supervisor.enabled=true"]);
    assert_eq!(
        watched.outcome,
        RunOutcome::Arrived,
        "{:?} {:?}",
        watched.reason,
        said(&trace)
    );
    assert!(
        said(&trace)[0].starts_with("to flywheel mode"),
        "{:?}",
        said(&trace)
    );
    let last = trace.state.balancer_offset_m.last().expect("a state");
    assert_eq!(*last, 0.0);
    let calm = |report: &RunReport| report.metrics.balancer_torque_rms_nm.expect("measured");
    assert!(
        calm(&watched) < 0.5 * calm(&alone),
        "{} {}",
        calm(&watched),
        calm(&alone)
    );
    assert!(watched.metrics.wheel_load_min_n > alone.metrics.wheel_load_min_n);
}

#[test]
fn it_slows_down_without_a_bump_and_comes_back() {
    let gust = "disturbance=[{kind=\"push\",impulse_ns=18,time_s=3}]";
    let (report, trace) = ride(&[gust, "supervisor.enabled=true"]);
    assert_eq!(report.outcome, RunOutcome::Arrived, "{}", report.reason);
    let said = said(&trace);
    assert!(said.len() >= 2 && said[0].starts_with("slower"), "{said:?}");
    assert!(said[1].starts_with("back to speed"), "{said:?}");
    // The drive never brakes harder than the scenario's 1 m/s² allows, nor jumps.
    let speeds = &trace.state.speed_mps;
    assert!(
        speeds
            .windows(2)
            .all(|pair| (pair[1] - pair[0]).abs() < 1.1 * 0.005)
    );
    let drive = &trace.control.drive_force_command_n;
    let at = (3.2 / 0.005) as usize;
    assert!(
        drive[at..]
            .windows(2)
            .all(|pair| (pair[1] - pair[0]).abs() < 10.0)
    );
}

#[test]
fn a_quiet_ride_is_left_alone() {
    for mode in ["flywheel", "balancer"] {
        let mode = format!("bike.mode={mode}");
        let (plain, _) = ride(&[&mode]);
        let (watched, trace) = ride(&[&mode, "supervisor.enabled=true"]);
        assert_eq!(said(&trace), [""; 0]);
        assert_eq!(plain.result_hash, watched.result_hash);
    }
}

#[test]
fn the_shipped_mode_change_is_taken_back_by_the_supervisor() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scenarios/mode-change.toml"
    );
    let text = std::fs::read_to_string(file).expect("a shipped scenario");
    let (report, trace) = ride_of(&text, &[]);
    assert_eq!(report.outcome, RunOutcome::Arrived, "{}", report.reason);
    assert!(report.passed());
    assert!(
        said(&trace)
            .iter()
            .any(|text| text.starts_with("to flywheel mode")),
        "{:?}",
        said(&trace)
    );
    // It had been in balancer mode, and ends in flywheel mode.
    let offsets = &trace.state.balancer_offset_m;
    assert!(offsets.iter().any(|d| (d - 0.15).abs() < 1e-9));
    assert_eq!(offsets.last(), Some(&0.0));
}
