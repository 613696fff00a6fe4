//! Disturbances and faults on whole rides, and what of them is refused.

mod common;

use bikebot_sim::record::Trace;
use bikebot_sim::{Override, RunOutcome, RunReport, ScenarioFile, Setup, SetupError};

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
const STAND: &str = "format = 1\nname = \"stand\"\n[plant]\nmodel = \"two_link\"\n";

fn resolve(text: &str, disturbance: &str) -> Result<Setup, SetupError> {
    let change = Override::new("disturbance", disturbance);
    let file = ScenarioFile::parse(text, &[change])?;
    Setup::resolve(&file, &mut |name| Err(format!("no file {name}")))
}

fn ride(text: &str, disturbance: &str) -> (RunReport, Trace) {
    let setup = resolve(text, disturbance).unwrap_or_else(|error| panic!("{disturbance}: {error}"));
    common::traced(&setup)
}

#[track_caller]
fn arrives(disturbance: &str) -> (RunReport, Trace) {
    let (report, trace) = ride(COURSE, disturbance);
    assert_eq!(
        (report.outcome, report.reason.as_str()),
        (RunOutcome::Arrived, "at_goal"),
        "{disturbance}: {:?}",
        report.metrics
    );
    (report, trace)
}

/// Time and text of what the recording says of disturbances.
fn told(trace: &Trace) -> Vec<(f64, String)> {
    trace
        .notices
        .iter()
        .filter(|notice| notice.kind == "disturbance")
        .map(|notice| (notice.time_s, notice.text.clone()))
        .collect()
}

#[test]
fn a_push_on_the_straight_is_recovered_and_recorded() {
    let (report, trace) = arrives("[{kind=\"push\",impulse_ns=10,time_s=4.0}]");
    // §11.2, push10_straight: roll 6.3 deg, torque 63 N m, 12.2 rad/s. Here the push meets a bike that leans
    // against it.
    let m = &report.metrics;
    assert!(
        m.roll_max_deg
            .is_some_and(|roll| (4.0..8.0).contains(&roll)),
        "{m:?}"
    );
    assert!(
        m.balancer_speed_max_radps
            .is_some_and(|speed| (9.0..15.3).contains(&speed))
    );
    let told = told(&trace);
    assert_eq!(told.len(), 2, "{told:?}");
    assert!((told[0].0 - 4.0).abs() < 1e-9 && told[0].1 == "a push of 10 N s begins");
    assert!((told[1].0 - 4.1).abs() < 1e-9 && told[1].1 == "a push of 10 N s ends");
}

#[test]
fn slopes_moments_and_gusts_are_ridden_out() {
    arrives("[{kind=\"slope\",grade=0.05}]");
    arrives("[{kind=\"slope\",grade=-0.05,from_s_m=3.0,to_s_m=7.0}]");
    arrives("[{kind=\"moment\",moment_nm=5}]");
    let (windy, _) = arrives("[{kind=\"gust\",force_n=30,duration_s=2.0,time_s=3.0}]");
    let (calm, _) = arrives("[]");
    assert!(windy.metrics.balancer_speed_max_radps > calm.metrics.balancer_speed_max_radps);
}

#[test]
fn a_disturbance_that_waits_for_a_place_begins_there() {
    let (_, trace) = arrives("[{kind=\"moment\",moment_nm=3,from_s_m=4.0,to_s_m=6.0}]");
    let told = told(&trace);
    assert_eq!(told.len(), 2, "{told:?}");
    let way = |time: f64| {
        let tick = (time / 0.005).round() as usize;
        trace.state.distance_m[tick]
    };
    // Ridden way and arc length of the path differ by the following error only.
    assert!((way(told[0].0) - 4.0).abs() < 0.05 && (way(told[1].0) - 6.0).abs() < 0.05);
}

#[test]
fn weak_late_and_silent_parts_are_ridden_with() {
    for fault in [
        "of=\"balancer\",is=\"limit\",limit_share=0.5",
        "of=\"balancer\",is=\"lag\",lag_s=0.01",
        "of=\"steering\",is=\"lag\",lag_s=0.03",
        "of=\"drive\",is=\"limit\",limit_share=0.5",
        "of=\"imu\",is=\"delay\",delay_s=0.01",
        "of=\"imu\",is=\"dropout\",time_s=4,duration_s=0.05",
        "of=\"pose\",is=\"dropout\",time_s=3,duration_s=2",
        "of=\"speed\",is=\"bias\",bias_mps=0.05,time_s=3,duration_s=4",
        "of=\"roll\",is=\"bias\",bias_deg=1,time_s=3",
        "of=\"balancer_encoder\",is=\"bias\",bias_deg=20,time_s=3",
    ] {
        arrives(&format!("[{{kind=\"fault\",{fault}}}]"));
    }
}

#[test]
fn a_jammed_balancer_does_not_move_against_the_frame() {
    let (report, trace) = ride(
        COURSE,
        "[{kind=\"fault\",of=\"balancer\",is=\"stuck\",time_s=4.0}]",
    );
    assert_eq!(report.outcome, RunOutcome::Fell);
    let from = (4.1 / 0.005) as usize;
    let rates = &trace.state.balancer_rate_radps[from..];
    assert!(
        rates.len() > 20 && rates.iter().all(|rate| rate.abs() < 1e-3),
        "{rates:?}"
    );
}

#[test]
fn stuck_steering_does_not_turn() {
    let (_, trace) = ride(
        COURSE,
        "[{kind=\"fault\",of=\"steering\",is=\"stuck\",time_s=4.0}]",
    );
    let steer = &trace.state.steer_rad[(4.01 / 0.005) as usize..];
    assert!(steer.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn the_standing_bike_feels_pushes_too() {
    let (report, _) = ride(STAND, "[{kind=\"push\",impulse_ns=10,time_s=0.5}]");
    assert_eq!(report.outcome, RunOutcome::Arrived, "{report:?}");
    assert!(report.metrics.roll_max_deg.is_some_and(|roll| roll > 1.0));
}

#[test]
fn a_disturbed_ride_repeats_to_the_bit_and_an_undisturbed_one_is_as_before() {
    let gust = "[{kind=\"gust\",force_n=20,time_s=2.0}]";
    assert_eq!(
        ride(COURSE, gust).0.result_hash,
        ride(COURSE, gust).0.result_hash
    );
    // A disturbance of no size changes nothing.
    let nothing = "[{kind=\"push\",impulse_ns=0,time_s=2.0}]";
    assert_eq!(
        ride(COURSE, nothing).0.result_hash,
        ride(COURSE, "[]").0.result_hash
    );
}

#[track_caller]
fn assert_refuses(text: &str, disturbance: &str, key: &str) {
    match resolve(text, disturbance) {
        Err(SetupError::Scenario(error)) => {
            assert_eq!(error.key.as_deref(), Some(key), "{disturbance}: {error}");
            assert!(error.help.is_some(), "{disturbance}: {error}");
        }
        other => panic!("{disturbance}: {other:?}"),
    }
}

#[test]
fn what_says_nothing_or_too_much_is_refused() {
    for (disturbance, key) in [
        ("[{kind=\"push\"}]", "disturbance.0.kind"),
        (
            "[{kind=\"push\",impulse_ns=1,force_n=2}]",
            "disturbance.0.force_n",
        ),
        (
            "[{kind=\"moment\",time_s=1,from_s_m=2}]",
            "disturbance.0.from_s_m",
        ),
        (
            "[{kind=\"slope\",duration_s=1,to_s_m=2}]",
            "disturbance.0.to_s_m",
        ),
        (
            "[{kind=\"slope\",from_s_m=3,to_s_m=2}]",
            "disturbance.0.to_s_m",
        ),
        (
            "[{kind=\"friction\",region_m=[2,0,1,1]}]",
            "disturbance.0.region_m",
        ),
        (
            "[{kind=\"fault\",of=\"drive\",is=\"stuck\"}]",
            "disturbance.0.is",
        ),
        (
            "[{kind=\"fault\",of=\"roll\",is=\"lag\",lag_s=1}]",
            "disturbance.0.is",
        ),
        (
            "[{kind=\"fault\",of=\"roll\",is=\"bias\"}]",
            "disturbance.0.is",
        ),
        (
            "[{kind=\"fault\",of=\"speed\",is=\"bias\",bias_deg=1}]",
            "disturbance.0.bias_deg",
        ),
        (
            "[{kind=\"fault\",of=\"steering\",is=\"stuck\",lag_s=1}]",
            "disturbance.0.lag_s",
        ),
    ] {
        assert_refuses(COURSE, disturbance, key);
    }
}

#[test]
fn what_the_plant_does_not_feel_is_refused() {
    assert_refuses(STAND, "[{kind=\"slope\",grade=0.1}]", "disturbance.0.kind");
    assert_refuses(
        STAND,
        "[{kind=\"moment\",from_s_m=1}]",
        "disturbance.0.from_s_m",
    );
    assert_refuses(
        STAND,
        "[{kind=\"fault\",of=\"steering\"}]",
        "disturbance.0.of",
    );
    let kinematic = format!("{COURSE}[plant]\nmodel = \"kinematic\"\n");
    assert_refuses(
        &kinematic,
        "[{kind=\"push\",impulse_ns=3}]",
        "disturbance.0.kind",
    );
    assert!(resolve(&kinematic, "[{kind=\"slope\",grade=0.1}]").is_ok());
}

#[test]
fn a_fault_of_nothing_in_particular_is_refused() {
    for fault in ["{kind=\"fault\"}", "{kind=\"fault\",is=\"stuck\",time_s=1}"] {
        let error = resolve(COURSE, &format!("[{fault}]")).expect_err(fault);
        let text = error.to_string();
        assert!(text.contains("has no `of`"), "{fault}: {text}");
    }
    assert!(resolve(COURSE, "[{kind=\"fault\",of=\"steering\"}]").is_ok());
}
