//! Whole rides: that they end as they should, and report what applies and nothing else.

use bikebot_sim::{Override, RunControl, RunOutcome, RunReport, ScenarioFile, Setup, run};

/// The course of the design note, §11.2.
const COURSE: &str = r#"
format = 1
name = "course"
[start]
speed_mps = 0.3
[path]
waypoints = [[1.0, 1.0, 0.0], [4.8, 2.2, 55.0], [7.0, 5.6, 30.0], [8.0, 8.0, 90.0]]
[run]
duration_s = 30.0
"#;

fn ride_of(text: &str, changes: &[&str]) -> RunReport {
    let changes: Vec<Override> = changes
        .iter()
        .map(|change| change.parse().expect("key=value"))
        .collect();
    let file = ScenarioFile::parse(text, &changes).expect("a scenario");
    let setup = Setup::resolve(&file, &mut |name| Err(format!("no file {name}")))
        .unwrap_or_else(|error| panic!("{changes:?}: {error}"));
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(&setup, &mut (), control).unwrap_or_else(|error| panic!("{changes:?}: {error}"))
}

fn ride(changes: &[&str]) -> RunReport {
    ride_of(COURSE, changes)
}

#[track_caller]
fn assert_arrives(changes: &[&str]) -> RunReport {
    let report = ride(changes);
    assert_eq!(
        (report.outcome, report.reason.as_str()),
        (RunOutcome::Arrived, "at_goal"),
        "{changes:?}: {:?}",
        report.metrics
    );
    report
}

#[test]
fn noise_in_the_roll_sensor_does_not_keep_a_bike_from_being_at_rest() {
    for mode in ["flywheel", "balancer"] {
        let report = assert_arrives(&[
            &format!("bike.mode={mode}"),
            "noise.roll_sigma_deg=0.3",
            "noise.roll_rate_sigma_radps=0.02",
        ]);
        // §11.2, row roll_noise_0.3deg_rate_0.02: 3 mm and 27 or 43 N m, with a quarter to spare.
        assert!(
            report
                .metrics
                .lateral_error_max_m
                .is_some_and(|e| e < 0.004)
        );
        assert!(
            report
                .metrics
                .balancer_torque_max_nm
                .is_some_and(|torque| torque < 54.0)
        );
    }
}

#[test]
fn a_bike_that_is_not_the_believed_one_arrives() {
    for mode in ["flywheel", "balancer"] {
        for (m1, m2) in [(45.6, 14.4), (30.4, 9.6)] {
            assert_arrives(&[
                &format!("bike.mode={mode}"),
                &format!("plant.bike.m1_kg={m1}"),
                &format!("plant.bike.m2_kg={m2}"),
            ]);
        }
        assert_arrives(&[
            &format!("bike.mode={mode}"),
            "plant.bike.h1_m=0.416", // 20 % lower
        ]);
    }
}

#[test]
fn late_poses_cost_nothing_with_odometry_and_a_lot_without() {
    let late = ["noise.pose_rate_hz=10", "noise.pose_delay_s=0.1"];
    let error = |changes: &[&str]| assert_arrives(changes).metrics.lateral_error_max_m;
    // §11.2: 3 mm with odometry replay, 80 mm without.
    assert!(error(&late).is_some_and(|error| error < 0.004));
    let blind = error(&[late[0], late[1], "noise.odometry_replay=false"]);
    assert!(blind.is_some_and(|error| (0.05..0.12).contains(&error)));
}

#[test]
fn a_ride_begins_from_rest_in_both_modes() {
    for mode in ["flywheel", "balancer"] {
        assert_arrives(&[&format!("bike.mode={mode}"), "start.speed_mps=0.0"]);
    }
}
