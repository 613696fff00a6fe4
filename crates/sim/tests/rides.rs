//! Whole rides: that they end as they should, and report what applies and nothing else.

mod common;

use bikebot_sim::{RunOutcome, RunReport};

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
    common::ride(&common::setup(text, changes), &mut ())
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

#[test]
fn a_kinematic_ride_reports_nothing_of_a_balance_it_does_not_keep() {
    let metrics = assert_arrives(&["plant.model=kinematic"]).metrics;
    let found: Vec<&str> = metrics.iter().map(|(name, _)| name).collect();
    let absent = |name: &&str| {
        ["roll", "balanc", "decoupling", "friction", "wheel"]
            .iter()
            .any(|part| name.starts_with(part))
    };
    assert!(!found.iter().any(absent), "{found:?}");
    for name in ["distance_m", "lateral_error_max_m", "corner_speed_mps"] {
        assert!(found.contains(&name), "{name} is missing");
    }
}

#[test]
fn a_bike_that_stands_reports_no_way_and_no_speed() {
    let report = ride_of(
        "format = 1\nname = \"stand\"\n[start]\nroll_deg = 2.0\n[plant]\nmodel = \"two_link\"\n[run]\nduration_s = 7.0\n",
        &[],
    );
    assert_eq!(report.outcome, RunOutcome::Arrived);
    assert_eq!(report.metrics.distance_m, None);
    assert_eq!(report.metrics.speed_max_mps, None);
    assert!(report.metrics.roll_max_deg.is_some_and(|roll| roll >= 2.0));
}

#[test]
fn the_end_is_measured_against_the_goal_and_not_the_end_of_the_path() {
    let metrics =
        assert_arrives(&["goal.x_m=8.0", "goal.y_m=8.1", "goal.heading_deg=80.0"]).metrics;
    assert!(
        metrics
            .end_position_error_m
            .is_some_and(|error| (error - 0.1).abs() < 0.01)
    );
    assert!(
        metrics
            .end_heading_error_deg
            .is_some_and(|error| (error - 10.0).abs() < 1.0)
    );
}

#[test]
fn no_metric_of_a_ride_that_lifts_a_wheel_is_infinite() {
    // The offset mass, spun up by a start from 8 degrees, lifts the bike off a wheel (§12.7).
    let report = ride(&["bike.mode=balancer", "start.roll_deg=8.0"]);
    assert_eq!(report.reason, "wheel_lift", "{:?}", report.metrics);
    for (name, value) in report.metrics.iter() {
        assert!(value.is_finite(), "{name} is {value}");
    }
    assert!(report.metrics.friction_use_rear_max.is_some());
    assert!(
        report
            .metrics
            .wheel_load_min_n
            .is_some_and(|load| load < 0.0)
    );
}

#[test]
fn mode_changes_follow_each_other_however_long_the_first_has_to_wait() {
    // The first change waits for the straight; the second is due before it has ended.
    let report = assert_arrives(&[
        "bike.mode_change=[{time_s=2.0,mode=\"balancer\",duration_s=1.5},{time_s=3.6,mode=\"flywheel\",duration_s=1.5}]",
    ]);
    assert!(report.metrics.roll_max_deg.is_some_and(|roll| roll < 10.0));
}

#[test]
fn a_flywheel_that_is_out_of_balance_is_felt() {
    let nominal = assert_arrives(&[]).metrics;
    // 5 mm of 12 kg: at rest 0.6 N m.
    let unbalanced = assert_arrives(&["plant.bike.d_flywheel_m=0.005"]).metrics;
    assert_ne!(
        nominal.balancer_torque_rms_nm,
        unbalanced.balancer_torque_rms_nm
    );
}

#[test]
fn an_encoder_that_trembles_does_not_keep_a_bike_from_being_at_rest() {
    let report = assert_arrives(&["noise.speed_sigma_mps=0.05", "noise.steer_sigma_deg=0.5"]);
    assert!(
        report
            .metrics
            .end_position_error_m
            .is_some_and(|e| e < 0.03)
    );
}
