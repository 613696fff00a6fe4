//! How a ride ended, in words, and how near it came to each limit.

use std::collections::BTreeMap;

use bikebot_sim::Setup;
use bikebot_sim::monitor::FALL_ROLL;
use bikebot_sim::record::Trace;

use super::number;

/// What the headline looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tone {
    /// Arrived, and nothing that was expected failed.
    Good,
    /// Ended otherwise, as the scenario expects.
    Expected,
    /// Ended otherwise than wanted.
    Bad,
    /// Nobody knows how it ended.
    Open,
}

/// The margin that a plan may use up.
pub(super) const CURVATURE: &str = "Sharpest curvature";
/// The margin without a limit but zero.
const CLEARANCE: &str = "Least clearance";

/// One quantity and the limit it should keep from.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Margin {
    pub(super) name: &'static str,
    /// With its unit.
    pub(super) value: String,
    /// The limit in words.
    pub(super) limit: String,
    /// Share of the limit in use, where that makes sense.
    pub(super) used: Option<f64>,
    /// Whether the limit was kept.
    pub(super) kept: Option<bool>,
}

/// How a ride ended.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    pub(super) tone: Tone,
    pub(super) headline: String,
    /// Why, in a sentence or two.
    pub(super) why: Vec<String>,
    pub(super) margins: Vec<Margin>,
    /// What the scenario expected, and whether it held.
    pub(super) expected: Vec<(String, bool)>,
    /// Every metric, by name.
    pub(super) metrics: BTreeMap<String, f64>,
    /// Whether the metrics were recorded, or are counted from the rows here.
    pub(super) metrics_are_recorded: bool,
}

impl Verdict {
    /// Out of the record of the result, or, without one, of what was recorded until it broke off.
    pub(super) fn of(
        result: Option<&BTreeMap<String, String>>,
        trace: &Trace,
        setup: Option<&Setup>,
    ) -> Self {
        let entry = |key: &str| result.and_then(|it| it.get(key)).map_or("", String::as_str);
        let metrics = match result {
            Some(result) => recorded(result),
            None => counted(trace),
        };
        let expected: Vec<(String, bool)> = result
            .into_iter()
            .flatten()
            .filter_map(|(key, ok)| Some((key.strip_prefix("expect.")?.to_owned(), ok == "true")))
            .collect();
        let (outcome, reason) = (entry("outcome"), entry("reason"));
        let holds = expected.iter().all(|check| check.1);
        let tone = match (outcome, holds, expected.is_empty()) {
            ("", ..) => Tone::Open,
            ("arrived", true, _) => Tone::Good,
            (_, true, false) => Tone::Expected,
            _ => Tone::Bad,
        };
        let mut why = vec![sentence(outcome, reason, &metrics, setup)];
        why.retain(|text| !text.is_empty());
        let failed = expected.iter().filter(|check| !check.1).count();
        if failed > 0 {
            let of = expected.len();
            why.push(format!(
                "{failed} of the scenario's {of} expectations failed."
            ));
        } else if tone == Tone::Expected {
            why.push("That is how the scenario expects it to end.".into());
        }
        let margins = margins(&metrics, trace, setup);
        if let Some(tightest) = tightest(&margins) {
            why.push(tightest);
        }
        Self {
            tone,
            headline: headline(outcome, reason),
            why,
            margins,
            expected,
            metrics,
            metrics_are_recorded: result.is_some(),
        }
    }
}

fn headline(outcome: &str, reason: &str) -> String {
    match (outcome, reason) {
        ("arrived", "recovered") => "Recovered its balance".into(),
        ("arrived", _) => "Arrived".into(),
        ("fell", _) => "Fell".into(),
        ("collided", _) => "Collided".into(),
        ("no_path", _) => "Found no path".into(),
        ("timed_out", _) => "Ran out of time".into(),
        ("interrupted", _) => "Was interrupted".into(),
        ("stopped", _) => "Stopped short of its goal".into(),
        ("", _) => "Was cut off".into(),
        (other, _) => other.replace('_', " "),
    }
}

/// A reason of the closed lists, in words.
fn words(reason: &str) -> &str {
    match reason {
        "slip" => "a tyre used more than its grip",
        "wheel_lift" => "a wheel left the ground",
        "balancer_stuck" => "the balancer was stuck",
        "steering_stuck" => "the steering was stuck",
        "sensor_fault" => "a sensor was faulty",
        "balancer_saturated" => "the balancer was at the limit of its torque or speed",
        "roll" => "it leaned further than could be caught",
        "not_finite" => "the simulated state was no longer a number",
        "control_failed" => "the controller gave up",
        "obstacle" => "it met an obstacle of the map",
        "moving_obstacle" => "it met something that moves, appeared or was hidden",
        "disconnected" => "it is proved that no way leads to the goal",
        "curvature_infeasible" => {
            "it is proved that no path within the curvature limit leaves this place or reaches the goal"
        }
        "no_curve" | "no_path" => "no path was found",
        "goal_blocked" => "something stands at the goal",
        "blocked_ahead" => "something stands before any place where a new path could begin",
        "unknown_ahead" => "what lies ahead cannot be seen from anywhere the bike may go",
        "deadline" => "the time for planning was over",
        "iterations" => "the planner's iterations were used up",
        _ => "",
    }
}

fn sentence(
    outcome: &str,
    reason: &str,
    metrics: &BTreeMap<String, f64>,
    setup: Option<&Setup>,
) -> String {
    let metric = |name: &str| metrics.get(name).copied();
    let time = metric("time_s").map(|it| format!("{} s", number(it)));
    let way = metric("distance_m").map(|it| format!("{} m", number(it)));
    let after = match (time, way) {
        (Some(time), Some(way)) => format!("after {time} and {way}"),
        (Some(time), None) => format!("after {time}"),
        _ => String::new(),
    };
    let from_goal = metric("end_position_error_m").map(length);
    let tolerance = setup.map(|setup| length(setup.goal_tolerance));
    let because = match (words(reason), reason) {
        ("", "") => String::new(),
        ("", other) => format!(": {}", other.replace('_', " ")),
        (words, _) => format!(": {words}"),
    };
    let text = match (outcome, from_goal) {
        ("arrived", Some(off)) if reason == "at_goal" => {
            let allowed = tolerance.map_or_else(String::new, |it| format!(" ({it} allowed)"));
            let heading = metric("end_heading_error_deg").map_or_else(String::new, |it| {
                format!(", its heading {}° off", number(it))
            });
            format!("It stands {off} from the goal{allowed}{heading}, {after}.")
        }
        ("arrived", _) if reason == "recovered" => format!("It stands upright {after}."),
        ("arrived", _) => format!("It is at the end of its path, at rest, {after}."),
        ("stopped", Some(off)) => {
            format!("It stands upright, {off} from the goal, {after}{because}.")
        }
        ("no_path", _) => format!("Nothing was ridden{because}."),
        ("timed_out", _) => format!("The scenario was over {after}, and the goal not reached."),
        ("interrupted", _) => format!("Someone stopped the run {after}."),
        ("", _) => format!("The recording does not tell how it ended; it breaks off {after}."),
        _ => format!("It ended {after}{because}."),
    };
    text.replace(" , ", ", ")
        .replace(" .", ".")
        .replace(" :", ":")
}

/// A length as people say it: below a tenth of a metre in millimetres.
pub(super) fn length(metres: f64) -> String {
    if metres.abs() < 0.1 {
        format!("{} mm", number(1e3 * metres))
    } else {
        format!("{} m", number(metres))
    }
}

/// The metrics that were recorded.
fn recorded(result: &BTreeMap<String, String>) -> BTreeMap<String, f64> {
    let metrics = result.iter().filter_map(|(key, value)| {
        let name = key.strip_prefix("metrics.")?;
        Some((name.to_owned(), value.parse().ok()?))
    });
    metrics.collect()
}

/// The metrics that the rows alone tell, for a recording without a result.
fn counted(trace: &Trace) -> BTreeMap<String, f64> {
    let mut metrics = BTreeMap::new();
    // The lateral error counts from a metre after the start, as in the metric of a whole ride.
    let way = &trace.state.distance_m;
    let begun = way
        .first()
        .map_or(0, |first| way.partition_point(|it| it - first < 1.0));
    let begun = trace
        .state
        .time_s
        .get(begun)
        .copied()
        .unwrap_or(f64::INFINITY);
    let finite = |name: &str| -> Vec<f64> {
        let (times, values) = trace.column(name).unwrap_or_default();
        let from = if name == "lateral_error_m" {
            begun
        } else {
            f64::NEG_INFINITY
        };
        let values = times
            .iter()
            .zip(values)
            .filter(|(time, it)| **time >= from && it.is_finite());
        values.map(|(_, it)| *it).collect()
    };
    for (metric, column, factor) in [
        ("lateral_error_max_m", "lateral_error_m", 1.0),
        ("rear_error_max_m", "rear_error_m", 1.0),
        ("roll_max_deg", "roll_rad", 1_f64.to_degrees()),
        ("balancer_torque_max_nm", "balancer_torque_nm", 1.0),
        ("balancer_speed_max_radps", "balancer_rate_radps", 1.0),
        ("balancer_angle_max_rad", "balancer_rad", 1.0),
        ("speed_max_mps", "speed_mps", 1.0),
        ("friction_use_rear_max", "friction_use_rear", 1.0),
        ("friction_use_front_max", "friction_use_front", 1.0),
    ] {
        let most = finite(column).into_iter().map(f64::abs).reduce(f64::max);
        metrics.extend(most.map(|it| (metric.to_owned(), factor * it)));
    }
    let least = |names: &[&str]| {
        let values = names.iter().flat_map(|name| finite(name));
        values.reduce(f64::min)
    };
    for (metric, value) in [
        ("min_clearance_m", least(&["clearance_m"])),
        ("wheel_load_min_n", least(&["rear_load_n", "front_load_n"])),
        ("time_s", finite("time_s").last().copied()),
        ("distance_m", finite("distance_m").last().copied()),
    ] {
        metrics.extend(value.map(|it| (metric.to_owned(), it)));
    }
    metrics
}

fn margins(metrics: &BTreeMap<String, f64>, trace: &Trace, setup: Option<&Setup>) -> Vec<Margin> {
    let metric = |name: &str| metrics.get(name).copied().filter(|it| it.is_finite());
    let expected = setup.and_then(|setup| setup.expect.as_ref());
    let mut margins = Vec::new();
    let mut add = |name, value: Option<String>, limit: String, used: Option<f64>, kept| {
        margins.extend(value.map(|value| Margin {
            name,
            value,
            limit,
            used,
            kept,
        }));
    };
    let share = |value: Option<f64>, limit: Option<f64>| Some(value? / limit?);
    let below = |used: Option<f64>| used.map(|it| it <= 1.0);

    let value = metric("lateral_error_max_m");
    let limit = expected.and_then(|it| it.lateral_error_max_m);
    let used = share(value, limit);
    let told = limit.map_or("no limit set".into(), |it| {
        format!("expected within {}", length(it))
    });
    add("Off the curve", value.map(length), told, used, below(used));

    let value = metric("end_position_error_m");
    let limit = setup
        .filter(|setup| setup.goal.is_some())
        .map(|it| it.goal_tolerance);
    let used = share(value, limit);
    let told = limit.map_or(String::new(), |it| format!("tolerance {}", length(it)));
    add(
        "From the goal at the end",
        value.map(length),
        told,
        used,
        below(used),
    );

    let value = metric("min_clearance_m");
    // No limit but zero: the bar is full at a touch, and empty a metre away.
    let used = value.map(|it| (1.0 - it).max(0.0));
    let kept = value.map(|it| it > 0.0);
    add(
        CLEARANCE,
        value.map(length),
        "touches at 0".into(),
        used,
        kept,
    );

    let value = metric("roll_max_deg");
    let limit = FALL_ROLL.to_degrees();
    let used = share(value, Some(limit));
    let told = format!("fallen at {}°", number(limit));
    add(
        "Most roll",
        value.map(|it| format!("{}°", number(it))),
        told,
        used,
        below(used),
    );

    for (name, key) in [
        ("Rear grip in use", "friction_use_rear_max"),
        ("Front grip in use", "friction_use_front_max"),
    ] {
        let used = metric(key);
        let told = used.map(|it| format!("{:.0} %", 100.0 * it));
        add(name, told, "slips at 100 %".into(), used, below(used));
    }

    let value = metric("wheel_load_min_n");
    let first = |name: &str| {
        trace
            .column(name)
            .and_then(|column| column.1.first().copied())
    };
    let standing = [first("rear_load_n"), first("front_load_n")];
    let standing = standing
        .into_iter()
        .flatten()
        .filter(|it| *it > 0.0)
        .reduce(f64::min);
    let used = share(value, standing).map(|it| (1.0 - it).max(0.0));
    let kept = value.map(|it| it > 0.0);
    add(
        "Least wheel load",
        value.map(|it| format!("{} N", number(it))),
        "lifts at 0".into(),
        used,
        kept,
    );

    let bike = setup.map(|setup| &setup.true_bike);
    for (name, key, unit, limit) in [
        (
            "Most balancer torque",
            "balancer_torque_max_nm",
            "N m",
            bike.map(|it| it.balancer_torque_max),
        ),
        (
            "Most balancer speed",
            "balancer_speed_max_radps",
            "rad/s",
            bike.map(|it| it.balancer_speed_max),
        ),
    ] {
        let value = metric(key);
        let used = share(value, limit);
        let told = limit.map_or(String::new(), |it| format!("limit {} {unit}", number(it)));
        // At its limit a motor saturates, and that alone is no failure.
        add(
            name,
            value.map(|it| format!("{} {unit}", number(it))),
            told,
            used,
            None,
        );
    }

    let value = metric("max_path_curvature_per_m");
    let limit = setup
        .filter(|setup| setup.goal.is_some())
        .map(|it| it.planner.max_curvature);
    let used = share(value, limit);
    let told = limit.map_or(String::new(), |it| format!("limit {} /m", number(it)));
    // A millionth for the rounding of the numbers themselves.
    let kept = used.map(|it| it <= 1.0 + 1e-6);
    let bends = value.filter(|it| *it > 1e-6);
    add(
        CURVATURE,
        bends.map(|it| format!("{} /m", number(it))),
        told,
        used,
        kept,
    );

    let value = metric("decoupling_margin_min");
    let used = value.map(|it| (1.0 - it).max(0.0));
    add(
        "Decoupling left",
        value.map(|it| format!("{:.0} %", 100.0 * it)),
        "balance is lost at 0 %".into(),
        used,
        value.map(|it| it > 0.0),
    );

    let value = metric("passivity_violations");
    let told = value.map(|it| match it {
        0.0 => "never".into(),
        1.0 => "once".into(),
        it => format!("{} times", number(it)),
    });
    add(
        "Passivity violated",
        told,
        "energy from nowhere".into(),
        None,
        value.map(|it| it == 0.0),
    );
    margins
}

/// Which limit the ride came nearest to.
fn tightest(margins: &[Margin]) -> Option<String> {
    // A plan may use all the curvature there is, and a gap is as wide as it is.
    let ridden = margins
        .iter()
        .filter(|it| !matches!(it.name, CURVATURE | CLEARANCE) || it.kept == Some(false));
    let used = ridden.filter_map(|it| Some((it, it.used?)));
    let (margin, used) = used.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let name = margin.name.to_lowercase();
    Some(if used > 1.0 {
        format!(
            "A limit was passed: {name} {} ({}).",
            margin.value, margin.limit
        )
    } else if margin.value.ends_with('%') {
        format!(
            "Nearest to a limit: {name} {} ({}).",
            margin.value, margin.limit
        )
    } else {
        let percent = 100.0 * used;
        format!(
            "Nearest to a limit: {name} {} ({}), {percent:.0} % of it in use.",
            margin.value, margin.limit
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_sim::clock::SimTime;
    use bikebot_sim::record::{ControlSample, Event, Recorder, StateSample};

    fn result(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
        let pairs = pairs.iter();
        pairs
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
            .collect()
    }

    fn verdict(pairs: &[(&str, &str)]) -> Verdict {
        Verdict::of(Some(&result(pairs)), &Trace::default(), None)
    }

    #[test]
    fn an_arrival_tells_how_near_and_how_long() {
        let it = verdict(&[
            ("outcome", "arrived"),
            ("reason", "at_goal"),
            ("metrics.time_s", "12"),
            ("metrics.distance_m", "10.54"),
            ("metrics.end_position_error_m", "0.00072"),
            ("expect.outcome = arrived", "true"),
        ]);
        assert_eq!((it.tone, it.headline.as_str()), (Tone::Good, "Arrived"));
        assert_eq!(
            it.why[0],
            "It stands 0.72 mm from the goal, after 12 s and 10.5 m."
        );
    }

    #[test]
    fn a_fall_is_bad_unless_it_is_what_the_scenario_asks_for() {
        let fall = [
            ("outcome", "fell"),
            ("reason", "slip"),
            ("metrics.time_s", "2.81"),
        ];
        let it = verdict(&fall);
        assert_eq!(it.tone, Tone::Bad);
        assert_eq!(
            it.why[0],
            "It ended after 2.81 s: a tyre used more than its grip."
        );
        let mut asked = fall.to_vec();
        asked.push(("expect.outcome = fell", "true"));
        assert_eq!(verdict(&asked).tone, Tone::Expected);
        let arrived = [
            ("outcome", "arrived"),
            ("reason", "at_goal"),
            ("expect.x", "false"),
        ];
        assert_eq!(verdict(&arrived).tone, Tone::Bad);
    }

    #[test]
    fn the_limit_that_was_passed_is_named() {
        let it = verdict(&[
            ("outcome", "fell"),
            ("reason", "slip"),
            ("metrics.friction_use_rear_max", "1.25"),
            ("metrics.roll_max_deg", "2.8"),
        ]);
        assert_eq!(
            it.why.last().unwrap(),
            "A limit was passed: rear grip in use 125 % (slips at 100 %)."
        );
        let grip = it
            .margins
            .iter()
            .find(|it| it.name == "Rear grip in use")
            .unwrap();
        assert_eq!(grip.kept, Some(false));
    }

    #[test]
    fn a_recording_that_breaks_off_says_so() {
        let it = Verdict::of(None, &Trace::default(), None);
        assert_eq!((it.tone, it.headline.as_str()), (Tone::Open, "Was cut off"));
        assert_eq!(
            it.why,
            ["The recording does not tell how it ended; it breaks off."]
        );
        assert!(!it.metrics_are_recorded);
    }

    #[test]
    fn without_a_result_the_rows_are_counted_as_the_metrics_are() {
        let mut trace = Trace::default();
        for tick in 0..300_u64 {
            let time = SimTime::from_nanoseconds(10_000_000 * tick);
            let way = 0.01 * tick as f64;
            let state = StateSample {
                distance_m: way,
                roll_rad: -0.05,
                ..StateSample::default()
            };
            let control = ControlSample {
                lateral_error_m: if way < 0.99 { 0.4 } else { -0.02 },
                ..ControlSample::default()
            };
            trace.record(time, &Event::State(&state)).unwrap();
            trace.record(time, &Event::Control(&control)).unwrap();
        }
        let it = Verdict::of(None, &trace, None);
        assert_eq!(it.metrics["lateral_error_max_m"], 0.02);
        assert_eq!(it.metrics["distance_m"], 2.99);
        assert!((it.metrics["roll_max_deg"] - 2.864_788_975_654).abs() < 1e-9);
        assert!(!it.metrics.contains_key("min_clearance_m"));
    }

    #[test]
    fn a_reason_nobody_knows_is_told_as_it_is() {
        let it = verdict(&[("outcome", "melted"), ("reason", "too_hot")]);
        assert_eq!((it.headline.as_str(), it.tone), ("melted", Tone::Bad));
        assert_eq!(it.why, ["It ended: too hot."]);
    }
}
