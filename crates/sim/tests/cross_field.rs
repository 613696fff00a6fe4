//! Scenarios whose values are each in range and make no sense together.

mod common;

use bikebot_sim::{Setup, SetupError};

const COURSE: &str =
    "format = 1\nname = \"course\"\n[path]\nwaypoints = [[1.0, 1.0, 0.0], [4.8, 2.2, 55.0]]\n";
const STAND: &str = "format = 1\nname = \"stand\"\n[plant]\nmodel = \"two_link\"\n";
const FIELD: &str = "format = 1\nname = \"field\"\n[map]\nbounds_m = [0, 0, 20, 20]\n[start]\nx_m = 2\ny_m = 3\n[goal]\nx_m = 17\ny_m = 16\n";

fn read(name: &str) -> Result<Vec<u8>, String> {
    match name {
        "scene.json" => Ok(br#"{"name": "scene", "unit": "m", "width": 20, "height": 20, "start": [5, 5, 90], "goal": [15, 15, 90], "obstacles": []}"#.to_vec()),
        "plan.json" => Ok(br#"{"outcome": "found", "segments": [[0,0,5,0,5,0,5,0]]}"#.to_vec()),
        "long.json" => Ok(br#"{"outcome": "found", "segments": [[0,0,1e6,0,1e6,0,1e6,0]]}"#.to_vec()),
        "huge.json" => Ok(br#"{"outcome": "found", "segments": [[0,0,1e308,0,1e308,0,-1e308,1e308]]}"#.to_vec()),
        "huge.csv" => Ok(b"0,0\n1e308,1\n-1e308,3\n".to_vec()),
        "small.csv" => Ok(b"0,0\n1,0\n2,1e-300\n".to_vec()),
        _ => Err("no such file".into()),
    }
}

fn resolve(text: &str, changes: &[&str]) -> Result<Setup, SetupError> {
    let file = common::parse(text, changes).expect("each value is in range");
    Setup::resolve(&file, &mut |name| read(name))
}

fn setup(text: &str, changes: &[&str]) -> Setup {
    resolve(text, changes).unwrap_or_else(|error| panic!("{changes:?}: {error}"))
}

#[track_caller]
fn assert_refuses(text: &str, changes: &[&str], key: &str) {
    match resolve(text, changes) {
        Err(SetupError::Scenario(error)) => {
            assert_eq!(error.key.as_deref(), Some(key), "{changes:?}: {error}");
            assert!(error.help.is_some(), "{changes:?}: {error}");
        }
        other => panic!("{changes:?}: {other:?}"),
    }
}

#[test]
fn a_laser_needs_a_map_to_look_at() {
    assert_refuses(STAND, &["laser.enabled=true"], "laser.enabled");
    assert_refuses(COURSE, &["laser.enabled=true"], "laser.enabled");
    assert!(!setup(COURSE, &[]).laser.enabled);
    assert_eq!(setup(COURSE, &["laser.rate_hz=10"]).warnings.len(), 1);
}

#[test]
fn a_bike_without_a_laser_may_have_any_control_period() {
    // 20 Hz is no whole number of periods of 3 ms, but nobody scans.
    let odd = ["plant.control_s=0.003", "plant.step_s=0.001"];
    assert!(resolve(STAND, &odd).is_ok());
    assert!(resolve(COURSE, &odd).is_ok());
    assert_refuses(FIELD, &odd, "laser.rate_hz");
    assert!(resolve(FIELD, &[odd[0], odd[1], "laser.enabled=false"]).is_ok());
}

#[test]
fn a_start_names_only_motions_that_the_plant_has() {
    assert_refuses(STAND, &["start.speed_mps=1"], "start.speed_mps");
    assert_refuses(STAND, &["start.steer_deg=1"], "start.steer_deg");
    let kinematic = "plant.model=kinematic";
    assert_refuses(COURSE, &[kinematic, "start.roll_deg=1"], "start.roll_deg");
    assert_refuses(
        COURSE,
        &[kinematic, "start.balancer_rate_radps=1"],
        "start.balancer_rate_radps",
    );
}

#[test]
fn the_steering_starts_within_its_stops() {
    assert_refuses(COURSE, &["start.steer_deg=50"], "start.steer_deg");
    assert!(resolve(COURSE, &["start.steer_deg=50", "bike.steer_max_deg=60"]).is_ok());
    // The stops that count are the true ones.
    assert_refuses(
        COURSE,
        &["start.steer_deg=40", "plant.bike.steer_max_deg=30"],
        "start.steer_deg",
    );
}

#[test]
fn a_plant_without_balance_knows_no_mode_change() {
    let change = "bike.mode_change=[{time_s=1.0,mode=\"balancer\",duration_s=2.0}]";
    assert_refuses(
        COURSE,
        &[change, "plant.model=kinematic"],
        "bike.mode_change.0",
    );
    assert!(resolve(COURSE, &[change]).is_ok());
}

#[test]
fn a_mode_change_quicker_than_the_law_allows_is_refused_before_the_ride() {
    let change = "bike.mode_change=[{time_s=1.0,mode=\"balancer\",duration_s=0.6}]";
    let error = common::parse(COURSE, &[change]).expect_err("0.6 s is too quick");
    assert!(error.message.contains("out of range"), "{error}");
}

#[test]
fn a_run_has_a_bounded_number_of_ticks() {
    assert!(resolve(COURSE, &["run.duration_s=86400"]).is_ok());
    let fine = [
        "run.duration_s=86400",
        "plant.control_s=1e-4",
        "plant.step_s=1e-4",
    ];
    assert_refuses(COURSE, &fine, "run.duration_s");
}

#[test]
fn a_path_has_a_bounded_and_finite_length() {
    let from = |name: &str| format!("format = 1\nname = \"a\"\n[path]\nfile = \"{name}\"\n");
    assert!(resolve(&from("plan.json"), &[]).is_ok());
    for name in ["long.json", "huge.json", "huge.csv"] {
        assert_refuses(&from(name), &[], "path.file");
    }
    assert!(resolve(&from("small.csv"), &[]).is_ok());
    assert_refuses(
        COURSE,
        &["path.waypoints=[[0,0,0],[0.1,0,0]]"],
        "path.waypoints",
    );
    assert_refuses(
        COURSE,
        &["path.waypoints=[[-1e6,0,0],[1e6,0,0]]"],
        "path.waypoints",
    );
}

#[test]
fn what_shapes_curves_is_refused_for_curves_that_are_given() {
    let text = "format = 1\nname = \"a\"\n[path]\nfile = \"plan.json\"\ntangent_per_chord = 1.1\n";
    assert_refuses(text, &[], "path.tangent_per_chord");
}

#[test]
fn what_reads_a_map_file_is_refused_without_one() {
    assert_refuses(FIELD, &["map.unknown_is_free=true"], "map.unknown_is_free");
    assert_refuses(FIELD, &["map.meters_per_cell=0.5"], "map.meters_per_cell");
}

#[test]
fn the_tolerance_that_is_written_holds_for_a_ball_too() {
    let ball = "planner.goal=ball";
    let tolerance = |changes: &[&str]| {
        let setup = setup(FIELD, changes);
        (setup.goal.expect("a goal").tolerance, setup.goal_tolerance)
    };
    // Table 1's l = 3 where nothing is said.
    assert_eq!(
        tolerance(&[ball, "planner.scale_m=0.4"]),
        (3.0 * 0.4, 3.0 * 0.4)
    );
    assert_eq!(tolerance(&[ball, "goal.tolerance_m=0.5"]), (0.5, 0.5));
    assert_eq!(tolerance(&[]), (0.3, 0.3));
}

#[test]
fn a_heading_that_a_map_names_belongs_to_its_own_place() {
    let text = "format = 1\nname = \"a\"\n[map]\nfile = \"scene.json\"\n";
    let heading = |changes: &[&str]| {
        setup(text, changes)
            .start_pose
            .and_then(|pose| pose.heading)
    };
    assert_eq!(heading(&[]), Some(90f64.to_radians()));
    assert_eq!(heading(&["start.x_m=3", "start.y_m=4"]), None);
    assert_eq!(heading(&["start.x_m=3", "start.heading_deg=0"]), Some(0.0));
}

#[test]
fn a_standing_bike_says_that_its_goal_has_no_effect() {
    let warnings = setup(STAND, &["goal.x_m=1"]).warnings;
    assert!(
        warnings.iter().any(|text| text.contains("[goal]")),
        "{warnings:?}"
    );
}

#[test]
fn a_start_far_from_the_path_is_worth_a_word() {
    assert!(setup(COURSE, &["start.x_m=0.5"]).warnings.is_empty());
    let warnings = setup(COURSE, &["start.x_m=9.0"]).warnings;
    assert!(
        warnings.iter().any(|text| text.contains("8.0 m")),
        "{warnings:?}"
    );
}
