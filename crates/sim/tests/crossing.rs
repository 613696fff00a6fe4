//! Rides among things that move, with the real laser, mapper, tracker, controller and bike.

mod common;

use bikebot_sim::record::NoticeKind;
use bikebot_sim::study::crossing;
use bikebot_sim::{RunOutcome, RunReport};
use common::{Notices, noticed, setup};

fn ride(text: &str, changes: &[&str]) -> (RunReport, Notices) {
    noticed(&setup(text, changes))
}

/// A way of 18 m through an open yard, seen for the first time.
const YARD: &str = "\
format = 1
name = \"yard\"
[map]
known = false
bounds_m = [0, 0, 24, 14]
[start]
x_m = 2
y_m = 7
heading_deg = 0
[goal]
x_m = 20
y_m = 7
[planner]
scale_m = 0.5
[laser]
range_sigma_m = 0.01
dropout_probability = 0.01
[noise]
roll_sigma_deg = 0.1
roll_rate_sigma_radps = 0.01
speed_sigma_mps = 0.01
position_sigma_m = 0.01
heading_sigma_deg = 0.2
pose_rate_hz = 20.0
[run]
duration_s = 60
";

#[test]
fn who_crosses_is_given_way_to_in_both_modes() {
    let crosses = "[[obstacle]]\nshape = \"disc:0.3\"\nwaypoints_m = [[11, 0.5], [11, 13.5]]\nspeed_mps = 1.0\nappear_s = 2.0\n";
    for mode in ["flywheel", "balancer"] {
        let (report, notices) = ride(&format!("{YARD}{crosses}"), &[&format!("bike.mode={mode}")]);
        assert_eq!(report.outcome, RunOutcome::Arrived, "{:?}", notices.0);
        assert!(notices.count(NoticeKind::Yield) >= 1, "{:?}", notices.0);
        assert_eq!(notices.count(NoticeKind::Unavoidable), 0, "{:?}", notices.0);
    }
}

#[test]
fn the_shipped_crossing_is_ridden_without_a_touch() {
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/crossing.toml");
    let text = std::fs::read_to_string(scenario).expect("the scenario");
    let (report, notices) = ride(&text, &[]);
    assert!(report.passed(), "{:?} {:?}", report, notices.0);
    assert!(notices.count(NoticeKind::Yield) + notices.count(NoticeKind::Pass) >= 2);
}

#[test]
fn one_who_steps_out_before_the_wheel_is_reported_as_unavoidable() {
    // Comes from behind a wall 1.2 m beside the way, when the bike is there.
    let text = YARD.replace(
        "bounds_m = [0, 0, 24, 14]\n",
        "bounds_m = [0, 0, 24, 14]\nbox = [{ min_m = [8, 4.2], max_m = [11.5, 5.8] }]\n",
    );
    let (mut reported, mut early) = (0, f64::INFINITY);
    for appear in [5.0, 5.5, 6.0, 6.5, 7.0] {
        let steps = format!(
            "[[obstacle]]\nshape = \"disc:0.25\"\nwaypoints_m = [[11.9, 4.6], [11.9, 7.0], [11.9, 13]]\nspeed_mps = 1.5\nappear_s = {appear}\n"
        );
        let (report, notices) = ride(&format!("{text}{steps}"), &[]);
        if let Some(notice) = notices.0.iter().find(|n| n.1 == NoticeKind::Unavoidable) {
            reported += 1;
            early = early.min(notice.3);
        }
        let collided = report.outcome == RunOutcome::Collided;
        assert!(
            !collided || notices.count(NoticeKind::Unavoidable) > 0,
            "a collision that was not announced: {:?}",
            notices.0
        );
    }
    assert!(reported > 0 && early < 2.0, "{reported} {early}");
}

#[test]
fn whoever_leaves_room_is_not_met() {
    // A part of examples/crossing.rs.
    let rows = crossing::ride_all(0..8, 0).expect("rides");
    let text = crossing::text(&rows);
    assert!(!rows.iter().any(crossing::Row::is_violation), "{text}");
    assert!(
        !rows.iter().any(|row| row.outcome == RunOutcome::Fell),
        "{text}"
    );
    assert!(rows.iter().map(|row| row.yielded + row.passed).sum::<u32>() > 0);
}
