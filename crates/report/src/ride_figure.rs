//! The figure of a ride: the planned path and what was ridden on the map; speed, roll and lateral error against time.

use bikebot_geometry::{Point2, Pose2};
use bikebot_sim::record::Trace;
use bikebot_world::{Bounds, Footprint};

use crate::axis::{Axis, Chart, MapFrame, significant};
use crate::drawing::{Area, Drawing, Item, Outline, Style};
use crate::error::ReportError;
use crate::legend::{Legend, Swatch};
use crate::palette::{self, Colour};
use crate::scenery::{self, Ground};
use crate::sheet::{headed, put_map, ticks};

/// Most outlines of the robot on one map.
const MAX_OUTLINES: f64 = 60.0;
/// Most ticks of a strip upwards: with fewer an axis of ±4° would have one at 0 alone.
const Y_TICKS: usize = 6;
/// Lean from which an outline is drawn in full colour, rad.
const FULL_LEAN: f64 = 0.09;

/// Values against time.
#[derive(Debug, Clone, Default, PartialEq)]
struct Series {
    /// s.
    time: Vec<f64>,
    values: Vec<f64>,
}

impl Series {
    fn of(trace: &Trace, name: &str, factor: f64) -> Self {
        trace
            .column(name)
            .map(|(time, values)| Self {
                time: time.to_vec(),
                values: values.iter().map(|value| factor * value).collect(),
            })
            .unwrap_or_default()
    }

    fn pairs(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.time.iter().zip(&self.values).map(|(t, v)| [*t, *v])
    }

    fn has_numbers(&self) -> bool {
        self.values.iter().any(|value| value.is_finite())
    }

    /// The value farthest from 0.
    fn most(&self) -> f64 {
        let finite = self
            .values
            .iter()
            .copied()
            .filter(|value| value.is_finite());
        finite.fold(0.0, |most: f64, value| {
            if value.abs() > most.abs() {
                value
            } else {
                most
            }
        })
    }
}

/// What was ridden, as far as a picture needs it.
#[derive(Debug, Clone)]
pub struct Ride {
    /// s; x, y in m; heading and roll in rad.
    states: Vec<[f64; 5]>,
    planned: Vec<[f64; 2]>,
    tree: Vec<[[f64; 2]; 2]>,
    goal: Option<(Point2, Option<f64>, f64)>,
    speed: Series,
    speed_reference: Series,
    roll: Series,
    roll_reference: Series,
    lateral_error: Series,
    body: Outline,
}

impl Ride {
    /// Out of what was recorded, with the outline the robot has on the ground.
    ///
    /// # Errors
    ///
    /// [`ReportError::NothingRidden`] without a state.
    pub fn new(trace: &Trace, footprint: &Footprint) -> Result<Self, ReportError> {
        let state = &trace.state;
        let states: Vec<[f64; 5]> = (0..state.time_s.len())
            .map(|i| {
                [
                    state.time_s[i],
                    state.x_m[i],
                    state.y_m[i],
                    state.heading_rad[i],
                    state.roll_rad[i],
                ]
            })
            .collect();
        if states.is_empty() {
            return Err(ReportError::NothingRidden);
        }
        let plan = trace.plans.last();
        let degrees = 1_f64.to_degrees();
        Ok(Self {
            states,
            planned: plan
                .map(|plan| plan.path.iter().map(|p| [p.x, p.y]).collect())
                .unwrap_or_default(),
            tree: plan.map(|plan| plan.tree.clone()).unwrap_or_default(),
            goal: plan.and_then(|plan| plan.goal).map(|goal| {
                let [x, y] = goal.position;
                (Point2::new(x, y), goal.heading, goal.tolerance)
            }),
            speed: Series::of(trace, "speed_mps", 1.0),
            speed_reference: Series::of(trace, "speed_reference_mps", 1.0),
            roll: Series::of(trace, "roll_rad", degrees),
            roll_reference: Series::of(trace, "roll_reference_rad", degrees),
            lateral_error: Series::of(trace, "lateral_error_m", 1.0),
            body: scenery::footprint_outline(footprint),
        })
    }

    /// The rectangle around all that was ridden, m; for rides without a map.
    fn extent(&self) -> Bounds {
        let places = self
            .states
            .iter()
            .map(|state| Point2::new(state[1], state[2]));
        let places = places.filter(|p| p.x.is_finite() && p.y.is_finite());
        let around = Bounds::around(places).unwrap_or(Bounds::new(0.0, 0.0, 0.0, 0.0));
        let margin = 1.0 + 0.05 * around.width().max(around.height());
        Bounds::new(
            around.min.x - margin,
            around.min.y - margin,
            around.max.x + margin,
            around.max.y + margin,
        )
    }
}

/// A ride on its ground.
#[derive(Debug)]
pub struct RideFigure<'a> {
    ride: &'a Ride,
    ground: Option<Ground<'a>>,
    title: String,
    facts: String,
}

/// One strip: name, unit, what is, what was to be.
type Quantity<'a> = (&'static str, &'static str, &'a Series, Option<&'a Series>);

impl<'a> RideFigure<'a> {
    /// Of `ride`, on `ground` where it had a map, under a title and a line of facts.
    pub fn new(
        ride: &'a Ride,
        ground: Option<Ground<'a>>,
        title: impl Into<String>,
        facts: impl Into<String>,
    ) -> Self {
        Self {
            ride,
            ground,
            title: title.into(),
            facts: facts.into(),
        }
    }

    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Drawing {
        let ride = self.ride;
        let strips: Vec<Quantity<'_>> = [
            ("speed", "m/s", &ride.speed, Some(&ride.speed_reference)),
            (
                "roll, positive to the right",
                "°",
                &ride.roll,
                Some(&ride.roll_reference),
            ),
            ("lateral error", "m", &ride.lateral_error, None),
        ]
        .into_iter()
        .filter(|strip| strip.2.has_numbers())
        .collect();
        let bounds = self
            .ground
            .map_or_else(|| ride.extent(), |ground| ground.bounds);
        let frame = MapFrame::fitting(bounds, Area::new(62.0, 96.0, 738.0, 738.0));
        let mut legend = Legend::default();
        let items = self.map_items(&frame, &mut legend);
        let left = frame.area.right() + 76.0;
        let width = (1176.0 - left).max(300.0);
        let (height, pitch) = (140.0, 222.0);
        let legend_top = 118.0 + strips.len() as f64 * pitch - 34.0;
        let columns = if width > 280.0 { 2 } else { 1 };
        let bottom = (frame.area.bottom() + 52.0).max(legend_top + legend.height(columns) + 20.0);
        let mut drawing = headed(
            [left + width + 24.0, bottom],
            62.0,
            &self.title,
            &self.facts,
            format!("{}: {}", self.title, self.facts),
        );
        put_map(&mut drawing, &frame, items);
        for (index, strip) in strips.iter().enumerate() {
            let area = Area::new(left, 118.0 + index as f64 * pitch, width, height);
            self.strip(&mut drawing, area, strip);
        }
        let room = Area::new(left, legend_top, width, legend.height(columns));
        legend.draw(&mut drawing, room, columns);
        drawing
    }

    fn strip(&self, drawing: &mut Drawing, area: Area, (name, unit, is, wanted): &Quantity<'_>) {
        let end = self.ride.states.last().map_or(1.0, |state| state[0]);
        let values = is
            .values
            .iter()
            .chain(wanted.iter().flat_map(|it| &it.values));
        let chart = Chart {
            area,
            x: Axis::linear(0.0, end),
            y: Axis::around(values.copied().chain([0.0]), 0.08),
        };
        let x_ticks = ticks(area.width, 60.0, 10);
        chart.ground(drawing, x_ticks, Y_TICKS);
        let line = |series: &Series, style| Item::Shape(chart.curve(series.pairs()), style);
        let zero = chart.curve([[0.0, 0.0], [end, 0.0]]);
        let mut items = vec![Item::Shape(zero, Style::line(palette::GREY, 0.8))];
        items.extend(wanted.map(|wanted| line(wanted, REFERENCE)));
        items.push(line(is, RIDDEN));
        chart.data(drawing, items);
        chart.frame(drawing, x_ticks, Y_TICKS, "time, s");
        let remark = format!("largest {} {unit}", significant(is.most(), 3));
        chart.heading(drawing, &format!("{name}, {unit}"), &remark);
    }

    fn map_items(&self, frame: &MapFrame, legend: &mut Legend) -> Vec<Item> {
        let ride = self.ride;
        let mut items = Vec::new();
        if let Some(ground) = self.ground {
            items.extend(ground.items(frame));
            if !items.is_empty() {
                legend.row(Swatch::Patch(Style::fill(palette::OBSTACLE)), "obstacles");
            }
        }
        if !ride.tree.is_empty() {
            let mut edges = Outline::new();
            let every = ride.tree.len().div_ceil(20_000);
            for edge in ride.tree.iter().step_by(every) {
                edges.add_line(edge.map(|[x, y]| frame.at(Point2::new(x, y))));
            }
            let style = Style::line(palette::BLUE, 0.8).faint(0.3);
            items.push(Item::Shape(edges, style));
            legend.row(Swatch::Line(style), "search tree");
        }
        self.add_outlines(frame, &mut items, legend);
        let line = |points: &mut dyn Iterator<Item = [f64; 2]>| {
            Outline::through(nearby(points.map(|[x, y]| frame.at(Point2::new(x, y)))))
        };
        if ride.planned.len() > 1 {
            let planned = line(&mut ride.planned.iter().copied());
            items.push(Item::Shape(planned, PLANNED));
            legend.row(Swatch::Line(PLANNED), "planned path");
        }
        let ridden = line(&mut ride.states.iter().map(|state| [state[1], state[2]]));
        items.push(Item::Shape(ridden, TRACK));
        legend.row(Swatch::Line(TRACK), "ridden");
        legend.row(Swatch::Line(REFERENCE), "meant to be");
        let first = ride.states[0];
        items.extend(scenery::pose_mark(
            Point2::new(first[1], first[2]),
            Some(first[3]),
            false,
            palette::INK,
            frame,
        ));
        if let Some((place, heading, tolerance)) = ride.goal {
            let ring = Style::line(palette::INK, 1.3).dashed(&[3.0, 4.0]);
            let ball = frame.length(tolerance);
            if ball > 9.0 {
                items.push(Item::Shape(Outline::circle(frame.at(place), ball), ring));
            }
            items.extend(scenery::pose_mark(
                place,
                heading,
                true,
                palette::INK,
                frame,
            ));
        }
        items
    }

    /// The robot as time goes by; the more it leans, the stronger its colour.
    fn add_outlines(&self, frame: &MapFrame, items: &mut Vec<Item>, legend: &mut Legend) {
        let states = &self.ride.states;
        if self.ride.body.is_empty() {
            return;
        }
        let (first, last) = (states[0][0], states[states.len() - 1][0]);
        let stride = scenery::stride(((last - first) / MAX_OUTLINES).max(1.0));
        let mut due = first;
        for [time, x, y, heading, roll] in states.iter().copied() {
            if time + 1e-9 < due {
                continue;
            }
            due += stride;
            let outline = scenery::carried(&self.ride.body, Pose2::new(x, y, heading), frame);
            let lean = (roll.abs() / FULL_LEAN).min(1.0);
            let fill = Style::fill(palette::ORANGE).faint(0.12 + 0.4 * lean);
            items.push(Item::Shape(outline.clone(), fill));
            items.push(Item::Shape(outline, Style::line(EDGE, 0.8)));
        }
        legend.row(
            Swatch::Patch(Style::fill(palette::ORANGE).faint(0.35)),
            format!("every {} s", significant(stride, 2)),
        );
    }
}

const EDGE: Colour = Colour("#b07800");
/// Broad and pale: the ridden line lies on it, and both are seen.
const PLANNED: Style = Style::line(palette::SKY, 6.0);
/// What was ridden, on the map.
const TRACK: Style = Style::line(palette::VERMILION, 2.2);
const RIDDEN: Style = Style::line(palette::VERMILION, 1.6);
const REFERENCE: Style = Style::line(palette::BLUE, 1.3).dashed(&[5.0, 4.0]);

/// Leaves out points less than a third of a pixel from the last one kept; the last stays.
fn nearby(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    let mut last = None;
    for point in points.filter(|point| point[0].is_finite() && point[1].is_finite()) {
        let is_far = kept
            .last()
            .is_none_or(|before| (point[0] - before[0]).hypot(point[1] - before[1]) > 0.33);
        if is_far {
            kept.push(point);
            last = None;
        } else {
            last = Some(point);
        }
    }
    kept.extend(last);
    kept
}
