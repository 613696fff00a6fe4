//! The figure of a ride at some moments, side by side: what was believed of the field, which path was in force, and what had been ridden by then.

use bikebot_geometry::{Point2, Pose2};
use bikebot_sim::record::Trace;
use bikebot_world::{Bounds, Footprint, Obstacle, OccupancyGrid};

use crate::axis::{MapFrame, significant};
use crate::drawing::{Area, Drawing, Item, Outline, Style};
use crate::error::ReportError;
use crate::legend::{Legend, Swatch};
use crate::palette;
use crate::scenery::{self, Ground};
use crate::sheet::{headed, ticks};

/// Width of the sheet, px.
const WIDTH: f64 = 1200.0;
/// Room left of a panel for its numbers, between panels, and above them for the heading, px.
const LEFT: f64 = 62.0;
const GAP: f64 = 58.0;
const HEADING: f64 = 30.0;
/// Below a panel for the numbers and the name of the axis, px.
const FOOT: f64 = 48.0;
/// Highest panel, px.
const HIGHEST: f64 = 560.0;
const TOP: f64 = 84.0;

/// One moment of a ride.
#[derive(Debug, Clone)]
struct Moment {
    /// s.
    time: f64,
    /// Which plan is in force, from 1.
    plan: usize,
    path: Vec<[f64; 2]>,
    ridden: Vec<[f64; 2]>,
    pose: Pose2,
    belief: Option<OccupancyGrid>,
    /// What is not on the map and stands or moves somewhere now.
    others: Vec<Obstacle>,
}

/// A ride at some moments.
#[derive(Debug, Clone)]
pub struct Moments {
    moments: Vec<Moment>,
    goal: Option<(Point2, Option<f64>)>,
    start: Pose2,
    body: Outline,
}

impl Moments {
    /// Out of what was recorded, at `times` (s), which are brought to the nearest that was recorded; `others` tells what stands or moves at
    /// a time (s) besides the map.
    ///
    /// # Errors
    ///
    /// [`ReportError::NothingRidden`] without a state.
    pub fn new(
        trace: &Trace,
        times: &[f64],
        footprint: &Footprint,
        others: &dyn Fn(f64) -> Vec<Obstacle>,
    ) -> Result<Self, ReportError> {
        let state = &trace.state;
        let pose = |i: usize| Pose2::new(state.x_m[i], state.y_m[i], state.heading_rad[i]);
        let last = state.time_s.len().checked_sub(1);
        let last = last.ok_or(ReportError::NothingRidden)?;
        let moments = times.iter().map(|&wanted| {
            let now = state
                .time_s
                .partition_point(|&time| time < wanted)
                .min(last);
            let time = state.time_s[now];
            let plan = trace.plans.partition_point(|plan| plan.time_s <= time);
            let path = plan.checked_sub(1).map(|index| &trace.plans[index].path);
            let seen = trace.beliefs.partition_point(|seen| seen.time_s <= time);
            let belief = seen
                .checked_sub(1)
                .map(|index| trace.beliefs[index].grid.clone());
            Moment {
                time,
                plan,
                path: path.map_or_else(Vec::new, |path| path.iter().map(|p| [p.x, p.y]).collect()),
                ridden: (0..=now).map(|i| [state.x_m[i], state.y_m[i]]).collect(),
                pose: pose(now),
                belief,
                others: others(time),
            }
        });
        let goal = trace.plans.last().and_then(|plan| plan.goal);
        Ok(Self {
            moments: moments.collect(),
            goal: goal.map(|goal| {
                (
                    Point2::new(goal.position[0], goal.position[1]),
                    goal.heading,
                )
            }),
            start: pose(0),
            body: scenery::footprint_outline(footprint),
        })
    }

    /// The rectangle around all that was ridden and believed, m.
    fn extent(&self) -> Bounds {
        let ridden = self.moments.iter().flat_map(|moment| &moment.ridden);
        let places = ridden.map(|[x, y]| Point2::new(*x, *y));
        let places = places.filter(|p| p.x.is_finite() && p.y.is_finite());
        let around = Bounds::around(places).unwrap_or(Bounds::new(0.0, 0.0, 0.0, 0.0));
        Bounds::new(
            around.min.x - 2.0,
            around.min.y - 2.0,
            around.max.x + 2.0,
            around.max.y + 2.0,
        )
    }
}

/// The panels of a ride on its ground.
#[derive(Debug)]
pub struct MomentsFigure<'a> {
    ride: &'a Moments,
    ground: Option<Ground<'a>>,
    title: String,
    facts: String,
}

impl<'a> MomentsFigure<'a> {
    /// Of `ride`, on the true `ground` where there is one, under a title and a line of facts.
    pub fn new(
        ride: &'a Moments,
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
        let bounds = self
            .ground
            .map_or_else(|| self.ride.extent(), |ground| ground.bounds);
        let count = self.ride.moments.len().max(1);
        let aspect = bounds.height() / bounds.width();
        // A long street is drawn in one column, a yard in two or three.
        let columns = if aspect < 0.3 {
            1
        } else {
            count.min(if aspect < 0.8 { 2 } else { 3 })
        };
        let width = (WIDTH - LEFT - 24.0 - (columns - 1) as f64 * GAP) / columns as f64;
        let frame_of = |index: usize, height: f64| {
            let (column, row) = (index % columns, index / columns);
            let left = LEFT + column as f64 * (width + GAP);
            let top = TOP + HEADING + row as f64 * (height + HEADING + FOOT);
            MapFrame::fitting(bounds, Area::new(left, top, width, HIGHEST))
        };
        let height = frame_of(0, 0.0).area.height;
        let rows = count.div_ceil(columns);
        let legend = self.legend();
        let legend_columns = 4;
        let legend_top = TOP + rows as f64 * (height + HEADING + FOOT) + 4.0;
        let mut drawing = headed(
            [WIDTH, legend_top + legend.height(legend_columns) + 16.0],
            LEFT,
            &self.title,
            &self.facts,
            format!("{}: {}", self.title, self.facts),
        );
        for (index, moment) in self.ride.moments.iter().enumerate() {
            let frame = frame_of(index, height);
            let chart = frame.chart();
            drawing.shape(Outline::rectangle(frame.area), Style::fill(palette::PAPER));
            chart.data(&mut drawing, self.items(moment, &frame));
            let is_last_row = index / columns + 1 == rows;
            let name = if is_last_row { "x, m" } else { "" };
            chart.frame(
                &mut drawing,
                ticks(frame.area.width, 80.0, 12),
                ticks(frame.area.height, 80.0, 12),
                name,
            );
            let remark = match moment.plan {
                0 => "no plan".to_owned(),
                number => format!("plan {number}"),
            };
            let time = format!("after {} s", significant(moment.time, 3));
            chart.heading(&mut drawing, &time, &remark);
        }
        let room = Area::new(
            LEFT,
            legend_top,
            WIDTH - LEFT - 24.0,
            legend.height(legend_columns),
        );
        legend.draw(&mut drawing, room, legend_columns);
        drawing
    }

    fn items(&self, moment: &Moment, frame: &MapFrame) -> Vec<Item> {
        let mut items = Vec::new();
        if let Some(belief) = &moment.belief {
            let seen = Ground {
                bounds: frame.bounds(),
                obstacles: &[],
                grid: Some(belief),
            };
            items.extend(seen.items(frame));
        }
        if let Some(ground) = self.ground {
            items.extend(ground.rims(frame, TRUTH));
        }
        for other in &moment.others {
            let outline = scenery::outline_of(other, frame);
            items.push(Item::Shape(outline, OTHER));
        }
        let line = |points: &[[f64; 2]]| {
            let points = points
                .iter()
                .filter(|p| p[0].is_finite() && p[1].is_finite());
            Outline::through(points.map(|[x, y]| frame.at(Point2::new(*x, *y))))
        };
        if moment.path.len() > 1 {
            items.push(Item::Shape(line(&moment.path), PLANNED));
        }
        items.push(Item::Shape(line(&moment.ridden), RIDDEN));
        let bike = scenery::carried(&self.ride.body, moment.pose, frame);
        items.push(Item::Shape(bike, BIKE));
        let start = self.ride.start.position;
        items.extend(scenery::pose_mark(start, None, false, palette::INK, frame));
        if let Some((place, heading)) = self.ride.goal {
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

    fn legend(&self) -> Legend {
        let mut legend = Legend::default();
        let moments = &self.ride.moments;
        if moments.iter().any(|moment| moment.belief.is_some()) {
            legend.row(Swatch::Patch(Style::fill(palette::UNKNOWN)), "not seen yet");
            legend.row(
                Swatch::Patch(Style::fill(palette::OBSTACLE)),
                "believed occupied",
            );
        }
        if self.ground.is_some() {
            legend.row(Swatch::Line(TRUTH), "what stands there in truth");
        }
        if moments.iter().any(|moment| !moment.others.is_empty()) {
            legend.row(Swatch::Patch(OTHER), "moves, or appeared");
        }
        legend.row(Swatch::Line(PLANNED), "path in force");
        legend.row(Swatch::Line(RIDDEN), "ridden by then");
        legend.row(Swatch::Patch(BIKE), "the bike");
        legend
    }
}

const PLANNED: Style = Style::line(palette::BLUE, 2.6);
const RIDDEN: Style = Style::line(palette::VERMILION, 2.0);
const BIKE: Style = Style::fill(palette::ORANGE).edged(palette::INK, 1.0);
const TRUTH: Style = Style::line(palette::INK, 0.9);
const OTHER: Style = Style::fill(palette::PURPLE).edged(palette::INK, 0.9);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::svg;
    use bikebot_sim::clock::SimTime;
    use bikebot_sim::record::{Event, Recorder, StateSample};
    use bikebot_world::Cell;

    fn trace() -> Trace {
        let mut trace = Trace::default().with_beliefs();
        let mut grid = OccupancyGrid::filled(20, 10, 0.5, Pose2::new(0.0, 0.0, 0.0), Cell::Unknown)
            .expect("a small grid");
        for tick in 0..=20_u64 {
            let time = SimTime::from_nanoseconds(100_000_000 * tick);
            let sample = StateSample {
                x_m: 1.0 + 0.1 * tick as f64,
                y_m: 2.0,
                ..StateSample::default()
            };
            trace.record(time, &Event::State(&sample)).expect("kept");
            grid.set(tick as usize % 20, 3, Cell::Free);
            trace.record(time, &Event::Belief(&grid)).expect("kept");
        }
        trace
    }

    #[test]
    fn a_moment_shows_what_was_known_and_ridden_by_then_and_no_more() {
        let nobody = |_: f64| Vec::new();
        let ride = Moments::new(&trace(), &[0.0, 1.0, 9.0], &Footprint::bike(), &nobody)
            .expect("something was ridden");
        let [first, second, last] = &ride.moments[..] else {
            panic!("three moments");
        };
        let free = |moment: &Moment| {
            let belief = moment.belief.as_ref().expect("a belief");
            belief
                .cells
                .iter()
                .filter(|cell| **cell == Cell::Free)
                .count()
        };
        assert_eq!((first.ridden.len(), free(first)), (1, 1));
        // Beliefs are kept every half second: after the eleventh tick.
        assert_eq!((second.ridden.len(), free(second)), (11, 11));
        // Later than the end is the end.
        assert_eq!((last.ridden.len(), last.time), (21, 2.0));
        let field = Ground {
            bounds: Bounds::new(0.0, 0.0, 10.0, 5.0),
            obstacles: &[],
            grid: None,
        };
        let draw = || svg::write(&MomentsFigure::new(&ride, Some(field), "ride", "facts").draw());
        assert_eq!(draw(), draw());
    }

    #[test]
    fn a_ride_without_a_state_is_refused() {
        let nobody = |_: f64| Vec::new();
        let refused = Moments::new(&Trace::default(), &[1.0], &Footprint::bike(), &nobody);
        assert!(matches!(refused, Err(ReportError::NothingRidden)));
    }
}
