//! The figure of a ride's histories: speed and curvature against the same time, with the turns shaded in both.

use bikebot_sim::record::{PathSample, Trace};

use crate::axis::{Axis, Chart, significant};
use crate::drawing::{Area, Drawing, Item, Outline, Style};
use crate::error::ReportError;
use crate::legend::{Legend, Swatch};
use crate::palette;
use crate::sheet::{headed, ticks};

const LEFT: f64 = 78.0;
const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 210.0;
const TOP: f64 = 122.0;
const PITCH: f64 = 302.0;
/// Share of the curve's largest curvature from which on a place is a turn.
const TURN: f64 = 0.5;

const IS: Style = Style::line(palette::VERMILION, 2.2);
const WANTED: Style = Style::line(palette::BLUE, 1.6).dashed(&[6.0, 4.0]);
const TURNS: Style = Style::fill(palette::SKY).faint(0.18);

/// How far ahead of where it was last the bike is looked for on the plan, m: less than a loop.
const AHEAD: f64 = 1.0;

/// A quantity that is drawn: what is, and what was wanted, against time.
struct Panel {
    name: &'static str,
    unit: &'static str,
    is: Vec<[f64; 2]>,
    wanted: Vec<[f64; 2]>,
}

/// Speed and curvature of a ride against time.
#[derive(Debug)]
pub struct HistoriesFigure<'a> {
    trace: &'a Trace,
    end: f64,
    title: String,
    facts: String,
}

impl<'a> HistoriesFigure<'a> {
    /// Of a ride, under a title and a line of facts.
    ///
    /// # Errors
    ///
    /// [`ReportError::NothingRidden`] without a state.
    pub fn new(
        trace: &'a Trace,
        title: impl Into<String>,
        facts: impl Into<String>,
    ) -> Result<Self, ReportError> {
        let end = *trace
            .state
            .time_s
            .last()
            .ok_or(ReportError::NothingRidden)?;
        Ok(Self {
            trace,
            end,
            title: title.into(),
            facts: facts.into(),
        })
    }

    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Drawing {
        let mut legend = Legend::default();
        legend.row(Swatch::Line(IS), "ridden");
        legend.row(Swatch::Line(WANTED), "meant to be");
        legend.row(
            Swatch::Patch(TURNS),
            "turns: half of the largest curvature or more",
        );
        let panels = [
            Panel {
                name: "speed",
                unit: "m/s",
                is: self.pairs("speed_mps"),
                wanted: self.pairs("speed_reference_mps"),
            },
            Panel {
                name: "curvature, positive to the left",
                unit: "1/m",
                is: self.pairs("curvature_per_m"),
                wanted: self.planned_curvature(),
            },
        ];
        let legend_top = TOP + panels.len() as f64 * PITCH - 40.0;
        let mut drawing = headed(
            [LEFT + WIDTH + 24.0, legend_top + legend.height(3) + 18.0],
            LEFT,
            &self.title,
            &self.facts,
            format!("{}: {}", self.title, self.facts),
        );
        let turns = turns(&panels[1]);
        for (index, panel) in panels.iter().enumerate() {
            let top = TOP + index as f64 * PITCH;
            self.panel(
                &mut drawing,
                Area::new(LEFT, top, WIDTH, HEIGHT),
                panel,
                &turns,
            );
        }
        let room = Area::new(LEFT, legend_top, WIDTH, legend.height(3));
        legend.draw(&mut drawing, room, 3);
        drawing
    }

    fn pairs(&self, column: &str) -> Vec<[f64; 2]> {
        let found = self.trace.column(column);
        found.map_or_else(Vec::new, |(times, values)| {
            times.iter().zip(values).map(|(t, v)| [*t, *v]).collect()
        })
    }

    /// The curvature of the plan where the rear contact is. On a ride that was planned anew, that of the last plan from then on, which is all
    /// that one line can tell.
    fn planned_curvature(&self) -> Vec<[f64; 2]> {
        let state = &self.trace.state;
        let Some(plan) = self.trace.plans.last().filter(|plan| !plan.path.is_empty()) else {
            return Vec::new();
        };
        let path = &plan.path;
        let mut at = 0;
        let mut pairs = Vec::with_capacity(state.time_s.len());
        for (index, time) in state.time_s.iter().enumerate() {
            if *time < plan.time_s {
                continue;
            }
            let (x, y) = (state.x_m[index], state.y_m[index]);
            let far = |it: &PathSample| (it.x - x).hypot(it.y - y);
            let reach = path[at].s + AHEAD;
            let ahead = path[at..].iter().take_while(|it| it.s <= reach);
            let nearest = ahead
                .enumerate()
                .min_by(|(_, a), (_, b)| far(a).total_cmp(&far(b)));
            at += nearest.map_or(0, |(steps, _)| steps);
            pairs.push([*time, path[at].curvature]);
        }
        pairs
    }

    fn panel(&self, drawing: &mut Drawing, area: Area, panel: &Panel, turns: &[[f64; 2]]) {
        let Panel {
            name,
            unit,
            is,
            wanted,
        } = panel;
        let all = is.iter().chain(wanted).map(|pair| pair[1]);
        let chart = Chart {
            area,
            x: Axis::linear(0.0, self.end),
            y: Axis::around(all.chain([0.0]), 0.08),
        };
        let x_ticks = ticks(area.width, 80.0, 14);
        chart.ground(drawing, x_ticks, 5);
        let mut items = Vec::new();
        for [from, to] in turns {
            let (left, right) = (chart.at(*from, 0.0)[0], chart.at(*to, 0.0)[0]);
            let band = Area::new(left, area.top, (right - left).max(1.0), area.height);
            items.push(Item::Shape(Outline::rectangle(band), TURNS));
        }
        let zero = chart.curve([[0.0, 0.0], [self.end, 0.0]]);
        items.push(Item::Shape(zero, Style::line(palette::GREY, 0.8)));
        let farthest = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        let most = is
            .iter()
            .map(|pair| pair[1])
            .filter(|value| value.is_finite())
            .fold(0.0, farthest);
        for (values, style) in [(wanted, WANTED), (is, IS)] {
            let line = chart.curve(values.iter().copied());
            if !line.is_empty() {
                items.push(Item::Shape(line, style));
            }
        }
        chart.data(drawing, items);
        chart.frame(drawing, x_ticks, 5, "time, s");
        let remark = format!("largest {} {unit}", significant(most, 3));
        chart.heading(drawing, &format!("{name}, {unit}"), &remark);
    }
}

/// When the plan, or without one the ride, turned sharply where the bike was, s.
fn turns(curvature: &Panel) -> Vec<[f64; 2]> {
    let values = if curvature.wanted.is_empty() {
        &curvature.is
    } else {
        &curvature.wanted
    };
    let finite = values.iter().map(|it| it[1]).filter(|it| it.is_finite());
    let most = finite.fold(0.0_f64, |most, value| most.max(value.abs()));
    let mut turns: Vec<[f64; 2]> = Vec::new();
    let mut is_open = false;
    for [time, value] in values {
        // A straight ride has no turns.
        if value.abs() >= TURN * most && most > 1e-3 {
            match turns.last_mut().filter(|_| is_open) {
                Some(turn) => turn[1] = *time,
                None => turns.push([*time, *time]),
            }
            is_open = true;
        } else {
            is_open = false;
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::assert_is_as_kept;
    use crate::svg;
    use bikebot_sim::clock::SimTime;
    use bikebot_sim::record::trace::PlanTrace;
    use bikebot_sim::record::{ControlSample, Event, Recorder, StateSample};

    /// A ride round one bend, slower in it.
    fn trace() -> Trace {
        let mut trace = Trace::default();
        let bend = |step: u64| (-((step as f64 - 100.0) / 20.0).powi(2)).exp();
        let plan = PlanTrace {
            time_s: 0.0,
            path: (0..=200)
                .map(|step| PathSample {
                    x: 0.05 * step as f64,
                    y: 0.0,
                    heading: 0.0,
                    curvature: 0.8 * bend(step),
                    s: 0.05 * step as f64,
                    speed: 1.0,
                })
                .collect(),
            tree: Vec::new(),
            coarse: Vec::new(),
            guide: Vec::new(),
            corridor_half_width: None,
            goal: None,
        };
        trace.plans.push(plan);
        for step in 0..=200_u64 {
            let time = SimTime::from_nanoseconds(50_000_000 * step);
            let bend = bend(step);
            let state = StateSample {
                x_m: 0.05 * step as f64,
                y_m: 0.0,
                speed_mps: 1.5 - 0.5 * bend,
                curvature_per_m: 0.75 * bend,
                ..StateSample::default()
            };
            let control = ControlSample {
                speed_reference_mps: 1.5 - 0.52 * bend,
                ..ControlSample::default()
            };
            trace.record(time, &Event::State(&state)).unwrap();
            trace.record(time, &Event::Control(&control)).unwrap();
        }
        trace
    }

    #[test]
    fn histories_are_drawn_as_they_always_were() {
        let trace = trace();
        let figure = HistoriesFigure::new(&trace, "one bend", "made by hand").unwrap();
        let drawing = figure.draw();
        let area = drawing.extent().unwrap();
        assert!(area.right() <= drawing.width && area.bottom() <= drawing.height);
        assert_is_as_kept(&svg::write(&drawing), "histories.svg");
    }

    #[test]
    fn the_turn_is_where_the_curve_has_half_its_curvature() {
        let trace = trace();
        let figure = HistoriesFigure::new(&trace, "", "").unwrap();
        let panel = Panel {
            name: "",
            unit: "",
            is: figure.pairs("curvature_per_m"),
            wanted: figure.planned_curvature(),
        };
        assert_eq!(panel.is.len(), panel.wanted.len());
        // exp(−u²) = ½ at u = 0.8326, 16.65 steps of 50 ms about the middle.
        let turns = turns(&panel);
        assert_eq!(turns.len(), 1, "{turns:?}");
        let half = 16.65 * 0.05;
        // To a step.
        assert!((turns[0][0] - (5.0 - half)).abs() < 0.051, "{turns:?}");
        assert!((turns[0][1] - (5.0 + half)).abs() < 0.051, "{turns:?}");
    }

    #[test]
    fn a_ride_of_nothing_is_refused() {
        assert!(HistoriesFigure::new(&Trace::default(), "", "").is_err());
    }
}
