//! What is drawn against time: the rows of a recording, and which of its quantities share a chart.

use bikebot_geometry::angle;
use bikebot_sim::Setup;
use bikebot_sim::record::{PathSample, Trace};
use serde::Serialize;

use super::encoding::{self, Column};

/// Quantities of the recording that a page carries; `heading_error_rad` and `steer_reference_rad` are worked out here.
const KEPT: [&str; 40] = [
    "x_m",
    "y_m",
    "heading_rad",
    "steer_rad",
    "steer_rate_radps",
    "roll_rad",
    "balancer_rad",
    "balancer_rate_radps",
    "speed_mps",
    "curvature_per_m",
    "distance_m",
    "drive_force_n",
    "balancer_torque_nm",
    "roll_moment_nm",
    "slope_force_n",
    "rear_load_n",
    "front_load_n",
    "friction_use_rear",
    "friction_use_front",
    "clearance_m",
    "drive_force_command_n",
    "balancer_torque_command_nm",
    "steer_rate_command_radps",
    "phase",
    "desired_x_m",
    "desired_y_m",
    "path_curvature_per_m",
    "speed_reference_mps",
    "roll_reference_rad",
    "lateral_error_m",
    "rear_error_m",
    "decoupling_ratio",
    "roll_moment_estimate_nm",
    "stored_energy_j",
    "energy_tank_j",
    "passivity_excess_j",
    "balancer_saturated",
    "fallback",
    HEADING_ERROR,
    STEER_REFERENCE,
];

/// The bike's heading less that of the nearest point of the planned path.
const HEADING_ERROR: &str = "heading_error_rad";
/// The steering angle that holds the curvature of the followed curve: atan(wheelbase times curvature).
const STEER_REFERENCE: &str = "steer_reference_rad";

/// The rows of a recording, thinned where there are very many.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Rows {
    /// s.
    pub(super) time: Vec<f64>,
    /// Name and values of what has a number anywhere.
    pub(super) columns: Vec<(&'static str, Vec<f64>)>,
    /// Every so many-th row of the recording is here.
    pub(super) every: usize,
}

/// Rows as they stand in a page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct PackedRows {
    count: usize,
    every: usize,
    time: String,
    columns: std::collections::BTreeMap<&'static str, Column>,
}

impl Rows {
    /// At most `most` rows of `trace`; the last is always one of them. The wheelbase is that of `setup`.
    pub(super) fn of(trace: &Trace, setup: Option<&Setup>, most: usize) -> Self {
        let count = trace.state.len();
        let every = count.div_ceil(most.max(2) - 1).max(1);
        let mut picked: Vec<usize> = (0..count).step_by(every).collect();
        if let Some(last) = count.checked_sub(1)
            && picked.last() != Some(&last)
        {
            picked.push(last);
        }
        picked.retain(|row| trace.state.time_s[*row].is_finite());
        let time: Vec<f64> = picked.iter().map(|row| trace.state.time_s[*row]).collect();
        let control = &trace.control.time_s;
        let beside: Vec<Option<usize>> = time
            .iter()
            .map(|now| {
                control
                    .partition_point(|it| *it <= now + 1e-9)
                    .checked_sub(1)
            })
            .collect();
        let heading_error = heading_errors(trace, &picked);
        let columns = KEPT.iter().filter_map(|&name| {
            let beside_state = |column: &[f64]| -> Vec<f64> {
                let value = |row: &Option<usize>| row.map_or(f64::NAN, |row| column[row]);
                beside.iter().map(value).collect()
            };
            let values: Vec<f64> = if name == HEADING_ERROR {
                heading_error.clone()
            } else if name == STEER_REFERENCE {
                let wheelbase = setup?.true_bike.wheelbase;
                let curvature = beside_state(trace.control.column("path_curvature_per_m")?);
                curvature.iter().map(|it| (wheelbase * it).atan()).collect()
            } else if let Some(column) = trace.state.column(name) {
                picked.iter().map(|row| column[*row]).collect()
            } else {
                beside_state(trace.control.column(name)?)
            };
            let has_numbers = values.iter().any(|value| value.is_finite());
            has_numbers.then_some((name, values))
        });
        Self {
            columns: columns.collect(),
            time,
            every,
        }
    }

    /// The column of that name.
    pub(super) fn column(&self, name: &str) -> Option<&[f64]> {
        let found = self.columns.iter().find(|column| column.0 == name)?;
        Some(&found.1)
    }

    /// As text.
    pub(super) fn packed(&self) -> PackedRows {
        let columns = self.columns.iter();
        PackedRows {
            count: self.time.len(),
            every: self.every,
            time: encoding::times(&self.time),
            columns: columns.map(|(name, it)| (*name, Column::of(it))).collect(),
        }
    }
}

/// For each picked row; NaN where no path is in force or the bike is off both its ends.
fn heading_errors(trace: &Trace, picked: &[usize]) -> Vec<f64> {
    /// How far along the path, and how far from it, the nearest point is looked for: samples, m.
    const WINDOW: usize = 60;
    const NEAR: f64 = 1.0;
    let state = &trace.state;
    let (mut plan_index, mut at) = (usize::MAX, 0);
    picked
        .iter()
        .map(|&row| {
            let now = state.time_s[row];
            let plan = trace.plans.partition_point(|plan| plan.time_s <= now);
            let plan = plan.checked_sub(1)?;
            let path = &trace.plans[plan].path;
            let place = [state.x_m[row], state.y_m[row]];
            let off = |index: usize| (path[index].x - place[0]).hypot(path[index].y - place[1]);
            // A new path is searched as a whole, a known one from where the bike was on it.
            let window = if plan == plan_index {
                at..(at + WINDOW).min(path.len())
            } else {
                0..path.len()
            };
            plan_index = plan;
            let nearest = window.min_by(|a, b| off(*a).total_cmp(&off(*b)))?;
            at = nearest;
            // Between samples the heading turns evenly; off both ends it stays.
            let ahead = nearest + usize::from(along(&path[nearest], place) > 0.0);
            let (before, ahead) = (ahead.saturating_sub(1), ahead.min(path.len() - 1));
            let gap = path[ahead].s - path[before].s;
            let share = if gap > 0.0 {
                (along(&path[before], place) / gap).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let bend = angle::wrap(path[ahead].heading - path[before].heading);
            let heading = path[before].heading + share * bend;
            let error = angle::wrap(state.heading_rad[row] - heading);
            (off(nearest) < NEAR).then_some(error)
        })
        .map(|error| error.unwrap_or(f64::NAN))
        .collect()
}

/// How far `place` lies ahead of a sample, along its heading, m.
fn along(sample: &PathSample, place: [f64; 2]) -> f64 {
    let (sin, cos) = sample.heading.sin_cos();
    cos * (place[0] - sample.x) + sin * (place[1] - sample.y)
}

/// What a series of a chart is, which decides how its line looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Role {
    /// What was.
    Is,
    /// What was to be.
    Wanted,
    /// A second quantity of equal rank.
    Other,
}

/// One line of a chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Series {
    column: &'static str,
    label: &'static str,
    role: Role,
}

/// A level that a quantity should keep off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Level {
    /// In the unit of the chart.
    value: f64,
    label: String,
}

/// One chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Chart {
    id: &'static str,
    title: &'static str,
    unit: &'static str,
    /// From the recording's unit to the chart's.
    factor: f64,
    series: Vec<Series>,
    levels: Vec<Level>,
}

/// The charts of a recording: those of whose quantities it has any.
pub(super) fn charts(rows: &Rows, setup: Option<&Setup>) -> Vec<Chart> {
    use Role::{Is, Other, Wanted};
    let degrees = 1_f64.to_degrees();
    // A ride that stays within centimetres is told in millimetres.
    let most = |name: &str| {
        let values = rows.column(name).unwrap_or_default().iter();
        values
            .filter(|it| it.is_finite())
            .fold(0.0_f64, |most, it| most.max(it.abs()))
    };
    let (error_unit, error_factor) = if most("lateral_error_m").max(most("rear_error_m")) < 0.2 {
        ("mm", 1e3)
    } else {
        ("m", 1.0)
    };
    type Line = (&'static str, &'static str, Role);
    let specification: [(&str, &str, &str, f64, &[Line]); 14] = [
        (
            "speed",
            "Speed",
            "m/s",
            1.0,
            &[
                ("speed_mps", "ridden", Is),
                ("speed_reference_mps", "asked for", Wanted),
            ],
        ),
        (
            "roll",
            "Roll, right positive",
            "°",
            degrees,
            &[
                ("roll_rad", "roll", Is),
                ("roll_reference_rad", "asked for", Wanted),
            ],
        ),
        (
            "steer",
            "Steering, left positive",
            "°",
            degrees,
            &[
                ("steer_rad", "steering", Is),
                (STEER_REFERENCE, "for the curve", Wanted),
            ],
        ),
        (
            "curvature",
            "Curvature, left positive",
            "1/m",
            1.0,
            &[
                ("curvature_per_m", "ridden", Is),
                ("path_curvature_per_m", "of the curve", Wanted),
            ],
        ),
        (
            "lateral",
            "Off the curve, left positive",
            error_unit,
            error_factor,
            &[
                ("lateral_error_m", "followed point", Is),
                ("rear_error_m", "rear wheel, off the path", Other),
            ],
        ),
        (
            "heading",
            "Heading off the path",
            "°",
            degrees,
            &[(HEADING_ERROR, "heading", Is)],
        ),
        (
            "balancer",
            "Balancer angle",
            "°",
            degrees,
            &[("balancer_rad", "balancer", Is)],
        ),
        (
            "torque",
            "Balancer torque",
            "N m",
            1.0,
            &[
                ("balancer_torque_nm", "acting", Is),
                ("balancer_torque_command_nm", "asked for", Wanted),
            ],
        ),
        (
            "drive",
            "Drive force",
            "N",
            1.0,
            &[
                ("drive_force_n", "acting", Is),
                ("drive_force_command_n", "asked for", Wanted),
            ],
        ),
        (
            "steer_rate",
            "Steering rate, left positive",
            "°/s",
            degrees,
            &[
                ("steer_rate_radps", "acting", Is),
                ("steer_rate_command_radps", "asked for", Wanted),
            ],
        ),
        (
            "clearance",
            "Clearance",
            "m",
            1.0,
            &[("clearance_m", "outline to obstacles", Is)],
        ),
        (
            "grip",
            "Grip in use",
            "%",
            100.0,
            &[
                ("friction_use_rear", "rear", Is),
                ("friction_use_front", "front", Other),
            ],
        ),
        (
            "load",
            "Wheel load",
            "N",
            1.0,
            &[
                ("rear_load_n", "rear", Is),
                ("front_load_n", "front", Other),
            ],
        ),
        (
            "moment",
            "Outside roll moment",
            "N m",
            1.0,
            &[
                ("roll_moment_nm", "acting", Is),
                ("roll_moment_estimate_nm", "as observed", Wanted),
            ],
        ),
    ];
    let energy: (&str, &str, &str, f64, &[Line]) = (
        "energy",
        "Energy of the follower",
        "J",
        1.0,
        &[
            ("stored_energy_j", "stored", Is),
            ("energy_tank_j", "tank", Other),
        ],
    );
    specification
        .into_iter()
        .chain([energy])
        .filter_map(|(id, title, unit, factor, lines)| {
            let lines = lines.iter().filter(|line| {
                let values = rows.column(line.0).unwrap_or_default();
                // What is zero all along, such as the observer of a ride nobody pushed, says nothing.
                values.iter().any(|it| it.is_finite() && *it != 0.0)
            });
            let series: Vec<Series> = lines
                .map(|&(column, label, role)| Series {
                    column,
                    label,
                    role,
                })
                .collect();
            let is_worth = series.iter().any(|line| line.role != Wanted);
            is_worth.then(|| Chart {
                id,
                title,
                unit,
                factor,
                series,
                levels: levels(id, setup),
            })
        })
        .collect()
}

/// What the quantities of a chart should keep off.
fn levels(id: &str, setup: Option<&Setup>) -> Vec<Level> {
    let level = |value: f64, label: String| Level { value, label };
    let both = |value: f64, unit: &str| {
        let gap = if unit == "°" { "" } else { " " };
        let label = format!("limit ±{}{gap}{unit}", super::number(value));
        vec![level(value, label.clone()), level(-value, label)]
    };
    match (id, setup) {
        ("clearance", _) => vec![level(0.0, "touches at 0".into())],
        ("grip", _) => vec![level(100.0, "slips at 100 %".into())],
        ("load", _) => vec![level(0.0, "lifts at 0".into())],
        ("torque", Some(setup)) => both(setup.true_bike.balancer_torque_max, "N m"),
        ("steer", Some(setup)) => both(setup.true_bike.steer_max_deg, "°"),
        ("steer_rate", Some(setup)) => both(setup.true_bike.steer_rate_max.to_degrees(), "°/s"),
        ("drive", Some(setup)) => both(setup.true_bike.drive_force_max, "N"),
        ("speed", Some(setup)) => {
            let most = setup.follow.max_speed;
            vec![level(most, format!("at most {} m/s", super::number(most)))]
        }
        ("curvature", Some(setup)) if setup.world.is_some() => {
            both(setup.planner.max_curvature, "/m")
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_sim::clock::SimTime;
    use bikebot_sim::record::{ControlSample, Event, PlanEvent, Recorder, StateSample};

    fn trace(ticks: u64) -> Trace {
        let mut trace = Trace::default();
        let path: Vec<PathSample> = (0..200)
            .map(|i| PathSample {
                x: 0.05 * f64::from(i),
                y: 0.0,
                heading: 0.0,
                curvature: 0.0,
                s: 0.05 * f64::from(i),
                speed: f64::NAN,
            })
            .collect();
        let plan = PlanEvent {
            path: &path,
            tree: &[],
            coarse: &[],
            guide: &[],
            corridor_half_width: None,
            goal: None,
        };
        trace.record(SimTime::ZERO, &Event::Plan(plan)).unwrap();
        for tick in 0..ticks {
            let time = SimTime::from_nanoseconds(10_000_000 * tick);
            let state = StateSample {
                x_m: 0.01 * tick as f64,
                y_m: 0.001,
                heading_rad: 0.02,
                roll_rad: 1e-3 * tick as f64,
                ..StateSample::default()
            };
            let control = ControlSample {
                lateral_error_m: 0.001,
                ..ControlSample::default()
            };
            trace.record(time, &Event::State(&state)).unwrap();
            if tick % 2 == 0 {
                trace.record(time, &Event::Control(&control)).unwrap();
            }
        }
        trace
    }

    #[test]
    fn the_last_row_is_kept_however_many_are_left_out() {
        for (ticks, most) in [(1, 10), (10, 10), (11, 10), (999, 100), (1000, 7)] {
            let rows = Rows::of(&trace(ticks), None, most);
            assert!(rows.time.len() <= most + 1, "{ticks} {most}");
            assert_eq!(rows.time.last(), Some(&(0.01 * (ticks - 1) as f64)));
            assert!(rows.columns.iter().all(|it| it.1.len() == rows.time.len()));
        }
        assert!(Rows::of(&Trace::default(), None, 10).time.is_empty());
    }

    #[test]
    fn a_control_sample_counts_until_the_next() {
        let rows = Rows::of(&trace(9), None, 100);
        let errors = rows.column("lateral_error_m").unwrap();
        assert!(errors.iter().all(|it| *it == 0.001));
    }

    #[test]
    fn the_heading_is_held_against_the_path_beneath_the_bike() {
        let rows = Rows::of(&trace(50), None, 100);
        let errors = rows.column(HEADING_ERROR).unwrap();
        assert!(errors.iter().all(|it| (it - 0.02).abs() < 1e-12));
    }

    #[test]
    fn on_a_circle_the_heading_error_is_smooth_between_samples() {
        let mut trace = Trace::default();
        let path: Vec<PathSample> = (0..60)
            .map(|i| {
                let angle = 0.05 * f64::from(i);
                PathSample {
                    x: angle.sin(),
                    y: 1.0 - angle.cos(),
                    heading: angle,
                    curvature: 1.0,
                    s: angle,
                    speed: f64::NAN,
                }
            })
            .collect();
        let plan = PlanEvent {
            path: &path,
            tree: &[],
            coarse: &[],
            guide: &[],
            corridor_half_width: None,
            goal: None,
        };
        trace.record(SimTime::ZERO, &Event::Plan(plan)).unwrap();
        for tick in 0..280_u64 {
            let angle = 0.01 * tick as f64;
            let state = StateSample {
                x_m: angle.sin(),
                y_m: 1.0 - angle.cos(),
                heading_rad: angle,
                ..StateSample::default()
            };
            let time = SimTime::from_nanoseconds(10_000_000 * tick);
            trace.record(time, &Event::State(&state)).unwrap();
        }
        let rows = Rows::of(&trace, None, 1000);
        let errors = rows.column(HEADING_ERROR).unwrap();
        // Along a sample's heading an arc of 0.05 rad is 0.05³/6 shorter; sampled headings would be off by 0.025.
        assert!(errors.iter().all(|it| it.abs() < 2.2e-5), "{errors:?}");
    }

    #[test]
    fn charts_are_made_of_what_was_recorded_and_of_no_more() {
        let charts = charts(&Rows::of(&trace(50), None, 100), None);
        let names: Vec<_> = charts.iter().map(|chart| chart.id).collect();
        assert_eq!(names, ["roll", "lateral", "heading"]);
        assert_eq!(charts[1].unit, "mm");
        assert!(super::charts(&Rows::default(), None).is_empty());
    }
}
