//! The figures of a plan: the map with all that the search made, curvature along the path, and the search against time.

mod curvature_profile;
#[cfg(test)]
mod tests;

use bikebot_geometry::{CurvePath, FergusonCurve, ParametricCurve, Point2};
use bikebot_world::Footprint;

use crate::axis::{Axis, Chart, MapFrame, duration, significant};
use crate::drawing::{Area, Drawing, Item, Label, Outline, Style};
use crate::error::ReportError;
use crate::label;
use crate::legend::{Legend, Swatch};
use crate::palette::{self, Colour};
use crate::plan_file::{PlanFile, TraceStep};
use crate::scenery::{self, Ground};
use crate::sheet::{headed, lay_paper, put_map, ticks};
use curvature_profile::CurvatureProfile;

/// Most edges of a tree that are drawn; of more, every second, third, … one.
const MAX_EDGES: usize = 20_000;
/// Pieces into which a curve is cut to be coloured by its curvature.
const PIECES: usize = 12;

/// Which figure of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanView {
    /// All of it on one sheet.
    Sheet,
    /// The map alone.
    Map,
    /// Curvature along the path.
    Curvature,
    /// Length of the best path against time.
    Search,
}

/// How the figures of a plan are drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PlanStyle {
    /// Colours the path by its curvature.
    pub colour_by_curvature: bool,
}

/// A plan with everything worked out that its figures need.
#[derive(Debug)]
pub struct PlanFigure<'a> {
    plan: &'a PlanFile,
    ground: Ground<'a>,
    style: PlanStyle,
    name: String,
    path: Option<CurvePath>,
    footprint: Footprint,
}

impl<'a> PlanFigure<'a> {
    /// For `plan` on `ground`; `name` is what the title calls the map.
    ///
    /// # Errors
    ///
    /// [`ReportError::NotAPlan`] when the segments do not join to a path, [`ReportError::Footprint`].
    pub fn new(
        plan: &'a PlanFile,
        ground: Ground<'a>,
        name: impl Into<String>,
        style: PlanStyle,
    ) -> Result<Self, ReportError> {
        let segments = plan.segments();
        let path = if segments.is_empty() {
            None
        } else {
            let path = CurvePath::new(segments).map_err(|error| ReportError::NotAPlan {
                what: format!("segments: {error}"),
                line: None,
            })?;
            Some(path)
        };
        Ok(Self {
            plan,
            ground,
            style,
            name: name.into(),
            path,
            footprint: plan.footprint()?,
        })
    }

    /// The views this plan has something to show in.
    #[must_use]
    pub fn views(&self) -> Vec<PlanView> {
        let mut views = vec![PlanView::Map];
        views.extend(self.has_curvature().then_some(PlanView::Curvature));
        views.extend(self.has_search().then_some(PlanView::Search));
        views
    }

    fn has_curvature(&self) -> bool {
        self.path.is_some() && self.plan.max_curvature_per_m.is_some()
    }

    fn has_search(&self) -> bool {
        self.plan.trace.len() > 1
    }

    /// Draws it.
    #[must_use]
    pub fn draw(&self, view: PlanView) -> Drawing {
        match view {
            PlanView::Sheet => self.sheet(),
            PlanView::Map => self.map_alone(),
            PlanView::Curvature => {
                self.strip_alone(&|this, drawing, area| this.curvature(drawing, area))
            }
            PlanView::Search => self.strip_alone(&|this, drawing, area| this.search(drawing, area)),
        }
    }

    fn sheet(&self) -> Drawing {
        let strips: Vec<Strip<'_>> = [
            self.has_curvature().then_some(Self::curvature as Strip<'_>),
            self.has_search().then_some(Self::search as Strip<'_>),
        ]
        .into_iter()
        .flatten()
        .collect();
        let mut map = Vec::new();
        let bounds = self.ground.bounds;
        if bounds.width() > 1.5 * bounds.height() {
            // A wide map above, the strips and the legend side by side below it.
            let frame = MapFrame::fitting(bounds, Area::new(62.0, 96.0, 1114.0, 740.0));
            let legend = self.map_items(&frame, &mut map);
            let top = frame.area.bottom() + 82.0;
            let below = legend
                .height(1)
                .max(if strips.is_empty() { 0.0 } else { 216.0 });
            let mut drawing = self.begin(1200.0, top + below + 24.0);
            put_map(&mut drawing, &frame, map);
            let strip_width = 390.0;
            let mut left = 62.0;
            for strip in &strips {
                strip(self, &mut drawing, Area::new(left, top, strip_width, 166.0));
                left += strip_width + 66.0;
            }
            let columns = if strips.len() < 2 { 2 } else { 1 };
            let room = Area::new(left - 14.0, top - 12.0, 1176.0 - left + 14.0, below);
            legend.draw(&mut drawing, room, columns);
            drawing
        } else {
            // The map on the left, the strips and the legend in a column beside it.
            let frame = MapFrame::fitting(bounds, Area::new(62.0, 96.0, 738.0, 738.0));
            let legend = self.map_items(&frame, &mut map);
            let left = frame.area.right() + 76.0;
            let width = (1176.0 - left).max(300.0);
            let mut drawing = self.begin(left + width + 24.0, 0.0);
            put_map(&mut drawing, &frame, map);
            let mut top = 118.0;
            for strip in &strips {
                strip(self, &mut drawing, Area::new(left, top, width, 180.0));
                top += 180.0 + 92.0;
            }
            top -= if strips.is_empty() { 22.0 } else { 34.0 };
            let columns = if width > 480.0 { 2 } else { 1 };
            let room = Area::new(left, top, width, legend.height(columns));
            legend.draw(&mut drawing, room, columns);
            drawing.height = (frame.area.bottom() + 52.0).max(room.bottom() + 20.0);
            lay_paper(&mut drawing);
            drawing
        }
    }

    fn map_alone(&self) -> Drawing {
        let mut map = Vec::new();
        let frame = MapFrame::fitting(self.ground.bounds, Area::new(62.0, 96.0, 1114.0, 960.0));
        let legend = self.map_items(&frame, &mut map);
        let width = frame.area.right().max(760.0) + 24.0;
        let columns = (((width - 86.0) / 230.0) as usize).clamp(1, 4);
        let top = frame.area.bottom() + 56.0;
        let mut drawing = self.begin(width, top + legend.height(columns) + 20.0);
        put_map(&mut drawing, &frame, map);
        let room = Area::new(62.0, top, width - 86.0, legend.height(columns));
        legend.draw(&mut drawing, room, columns);
        drawing
    }

    fn strip_alone(&self, strip: &dyn Fn(&Self, &mut Drawing, Area)) -> Drawing {
        let mut drawing = self.begin(1000.0, 420.0);
        strip(self, &mut drawing, Area::new(70.0, 112.0, 906.0, 250.0));
        drawing
    }

    /// The sheet with its heading. Its height may be set later, before [`lay_paper`].
    fn begin(&self, width: f64, height: f64) -> Drawing {
        let plan = self.plan;
        let method = if plan.method.is_empty() {
            "plan"
        } else {
            &plan.method
        };
        let title = format!("{} · {method}", self.name);
        let mut facts = Vec::new();
        if self.path.is_none() {
            let reason = Some(plan.reason.replace('_', " ")).filter(|reason| !reason.is_empty());
            let reason = reason.map_or_else(String::new, |reason| format!(" ({reason})"));
            facts.push(format!("{}{reason}", plan.outcome.replace('_', " ")));
        }
        if let Some(length) = plan.length_m {
            facts.push(format!("length {} m", significant(length, 5)));
        }
        if let Some(bound) = plan.lower_bound_m.filter(|_| self.path.is_some()) {
            facts.push(format!(
                "no path is shorter than {} m",
                significant(bound, 5)
            ));
        }
        let limit = significant(plan.problem.max_curvature_per_m, 3);
        match plan.max_curvature_per_m {
            Some(most) => facts.push(format!(
                "curvature up to {} of {limit} /m",
                significant(most, 3)
            )),
            None if self.path.is_some() => {
                facts.push("straight legs, curvature unbounded".into());
            }
            None => facts.push(format!("curvature limit {limit} /m")),
        }
        if let Some(clearance) = plan.min_clearance_m {
            facts.push(format!("clearance {} m", significant(clearance, 3)));
        }
        facts.push(format!("footprint {}", self.footprint));
        facts.extend(plan.time_s.map(duration));
        facts.extend(plan.seed.map(|seed| format!("seed {seed}")));
        let description = format!("{title}: {}", facts.join(", "));
        headed(
            [width, height],
            62.0,
            &title,
            &facts.join("  ·  "),
            description,
        )
    }

    /// Everything on the map from the ground up, and what its colours mean.
    fn map_items(&self, frame: &MapFrame, items: &mut Vec<Item>) -> Legend {
        let mut legend = Legend::default();
        let stages = &self.plan.stages;
        let polyline = |points: &[[f64; 2]]| {
            Outline::through(points.iter().map(|&[x, y]| frame.at(Point2::new(x, y))))
        };
        let mut search = Legend::default();
        let middle = if stages.corridor_guide.len() > 1 {
            &stages.corridor_guide
        } else {
            &stages.guide
        };
        if let Some(half_width) = stages.corridor_half_width_m.filter(|_| middle.len() > 1) {
            // A line as wide as the corridor with round joints is the corridor.
            let width = 2.0 * frame.length(half_width);
            let style = Style::line(palette::SKY, width).faint(0.22);
            items.push(Item::Shape(polyline(middle), style));
            let patch = Style::fill(palette::SKY).faint(0.22);
            let text = format!("corridor, ±{} m", significant(half_width, 3));
            search.row(Swatch::Patch(patch), text);
        }
        let ground = self.ground.items(frame);
        if !ground.is_empty() {
            legend.row(Swatch::Patch(Style::fill(palette::OBSTACLE)), "obstacles");
        }
        items.extend(ground);
        let tree = Style::line(palette::BLUE, 0.8).faint(0.35);
        let edges = tree_outline(&stages.tree, &stages.corridor_tree, frame);
        if !edges.is_empty() {
            items.push(Item::Shape(edges, tree));
            let count = stages.tree.len() + stages.corridor_tree.len();
            search.row(Swatch::Line(tree), format!("search tree, {count} edges"));
        }
        for (points, text, style) in [
            (
                &stages.coarse,
                "coarse path",
                Style::line(palette::PURPLE, 1.8).dashed(&[1.0, 4.5]),
            ),
            (
                &stages.guide,
                "guide",
                Style::line(palette::GREEN, 1.8).dashed(&[7.0, 4.5]),
            ),
        ] {
            if points.len() > 1 {
                items.push(Item::Shape(polyline(points), style));
                search.row(Swatch::Line(style), text);
            }
        }
        if let Some(path) = &self.path {
            self.add_outlines(path, frame, items, &mut legend);
            self.add_path(path, frame, items, &mut legend);
        }
        legend.rows_of(search);
        self.add_ends(frame, items, &mut legend);
        legend
    }

    fn add_path(
        &self,
        path: &CurvePath,
        frame: &MapFrame,
        items: &mut Vec<Item>,
        legend: &mut Legend,
    ) {
        // A pale rim lifts the path from what lies below.
        let whole = curves_outline(path.segments(), frame);
        items.push(Item::Shape(
            whole.clone(),
            Style::line(palette::PAPER, 5.6).faint(0.75),
        ));
        if self.style.colour_by_curvature && self.has_curvature() {
            let limit = self.plan.problem.max_curvature_per_m;
            for (step, outline) in by_curvature(path.segments(), limit, frame)
                .into_iter()
                .enumerate()
            {
                if !outline.is_empty() {
                    let style = Style::line(palette::RAMP[step], 3.4);
                    items.push(Item::Shape(outline, style));
                }
            }
            let text = format!("path, curvature 0 to {} /m", significant(limit, 3));
            legend.row(Swatch::Ramp, text);
        } else {
            let style = Style::line(palette::VERMILION, 3.2);
            items.push(Item::Shape(whole, style));
            legend.row(Swatch::Line(style), "path");
        }
    }

    /// The robot at both ends and in between.
    fn add_outlines(
        &self,
        path: &CurvePath,
        frame: &MapFrame,
        items: &mut Vec<Item>,
        legend: &mut Legend,
    ) {
        let body = scenery::footprint_outline(&self.footprint);
        if body.is_empty() {
            return;
        }
        let long = scenery::footprint_length(&body).max(path.length() / 60.0);
        let stride = scenery::stride(0.8 * long);
        let mut all = Outline::new();
        let count = (path.length() / stride).floor() as usize;
        let places = (0..=count)
            .map(|i| i as f64 * stride)
            .filter(|s| path.length() - s > 0.4 * stride)
            .chain([path.length()]);
        for s in places {
            let place = path.at(s);
            let pose =
                bikebot_geometry::Pose2::new(place.position.x, place.position.y, place.heading);
            // One by one in one outline: where they overlap the rims cross, which is as it should be seen.
            all.append(scenery::carried(&body, pose, frame));
        }
        let style = Style::line(palette::ORANGE, 1.3);
        items.push(Item::Shape(all, style));
        legend.row(
            Swatch::Patch(Style::line(palette::ORANGE, 1.3)),
            format!("footprint every {} m", significant(stride, 2)),
        );
    }

    fn add_ends(&self, frame: &MapFrame, items: &mut Vec<Item>, legend: &mut Legend) {
        let problem = &self.plan.problem;
        let ball = frame.length(problem.tolerance_m);
        let ring = Style::line(palette::INK, 1.3).dashed(&[3.0, 4.0]);
        let has_ball = ball > 9.0;
        if has_ball {
            let circle = Outline::circle(frame.at(problem.goal.position()), ball);
            items.push(Item::Shape(circle, ring));
        }
        for (end, is_goal) in [(problem.start, false), (problem.goal, true)] {
            items.extend(scenery::pose_mark(
                end.position(),
                end.heading_rad,
                is_goal,
                palette::INK,
                frame,
            ));
        }
        let free = |heading: Option<f64>| {
            if heading.is_some() {
                ""
            } else {
                ", any heading"
            }
        };
        legend.row(
            Swatch::Dot(Style::fill(palette::INK)),
            format!("start{}", free(problem.start.heading_rad)),
        );
        legend.row(
            Swatch::Dot(Style::fill(palette::PAPER).edged(palette::INK, 2.6)),
            format!("goal{}", free(problem.goal.heading_rad)),
        );
        if has_ball {
            let text = format!("goal ball, {} m", significant(problem.tolerance_m, 3));
            legend.row(Swatch::Line(ring), text);
        }
    }

    /// σ along the path, with its limit and its largest value.
    fn curvature(&self, drawing: &mut Drawing, area: Area) {
        let Some(path) = &self.path else {
            return;
        };
        let limit = self.plan.problem.max_curvature_per_m;
        let profile = CurvatureProfile::of(path);
        let (most_s, most) = profile.most;
        let reach = 1.14 * limit.max(most.abs()).max(1e-9);
        let chart = Chart {
            area,
            x: Axis::linear(0.0, path.length()),
            y: Axis::linear(-reach, reach),
        };
        let x_ticks = ticks(area.width, 75.0, 10);
        chart.ground(drawing, x_ticks, 4);
        let line = |value: f64| chart.curve([[0.0, value], [path.length(), value]]);
        let limits = Style::line(palette::INK, 1.2).dashed(&[6.0, 4.0]);
        let mut bounds = line(limit);
        bounds.append(line(-limit));
        chart.data(
            drawing,
            vec![
                Item::Shape(line(0.0), Style::line(palette::GREY, 0.8)),
                Item::Shape(bounds, limits),
                Item::Shape(
                    chart.curve(profile.points),
                    Style::line(palette::VERMILION, 1.6),
                ),
            ],
        );
        chart.frame(drawing, x_ticks, 4, "arc length, m");
        let mark = Outline::circle(chart.at(most_s, most), 4.2);
        drawing.shape(mark, Style::line(palette::INK, 1.5));
        // The limit itself stands in the title.
        let text = format!(
            "largest {} at {} m",
            significant(most, 3),
            significant(most_s, 3)
        );
        chart.heading(drawing, "curvature σ, 1/m", &text);
    }

    /// Length of what the search had, against time.
    fn search(&self, drawing: &mut Drawing, area: Area) {
        let trace: Vec<&TraceStep> = self
            .plan
            .trace
            .iter()
            .filter(|step| step.time_s.is_finite() && step.cost.is_finite())
            .collect();
        let chart = Chart {
            area,
            x: Axis::decades(trace.iter().map(|step| step.time_s).chain(self.plan.time_s)),
            y: Axis::around(trace.iter().map(|step| step.cost), 0.08),
        };
        let x_ticks = ticks(area.width, 60.0, 10);
        chart.ground(drawing, x_ticks, 4);
        // The best so far, among what the method may return where the plan tells.
        let tells = trace.iter().any(|step| step.certified == Some(true));
        let mut best = f64::INFINITY;
        let mut stairs = Vec::new();
        for step in &trace {
            if tells && step.certified != Some(true) {
                continue;
            }
            if best.is_finite() {
                stairs.push([step.time_s, best]);
            }
            best = if tells {
                best.min(step.cost)
            } else {
                step.cost
            };
            stairs.push([step.time_s, best]);
        }
        if let (true, Some(end)) = (best.is_finite(), self.plan.time_s) {
            stairs.push([end, best]);
        }
        let mut stages: Vec<&str> = Vec::new();
        for step in &trace {
            if !stages.contains(&step.stage.as_str()) {
                stages.push(&step.stage);
            }
        }
        let mut items = vec![Item::Shape(
            chart.curve(stairs),
            Style::line(palette::GREY, 1.2),
        )];
        for stage in &stages {
            let mut dots = Outline::new();
            for step in trace.iter().filter(|step| step.stage == *stage) {
                dots.append(Outline::circle(chart.at(step.time_s, step.cost), 2.9));
            }
            items.push(Item::Shape(dots, Style::line(stage_colour(stage), 2.0)));
        }
        chart.data(drawing, items);
        chart.frame(drawing, x_ticks, 4, "time since the search began");
        chart.heading(drawing, "cost", "");
        // The stages in their colours, from the right.
        let mut right = area.right();
        for stage in stages.iter().rev() {
            let text = stage.replace('_', " ");
            let width = label::width(&text, 11.5);
            if right - width - 14.0 < area.left + 62.0 {
                break;
            }
            drawing.label(Label::new(
                text,
                [right - width, area.top - 9.0],
                11.5,
                palette::GREY,
            ));
            let dot = Outline::circle([right - width - 9.0, area.top - 13.0], 2.9);
            drawing.shape(dot, Style::line(stage_colour(stage), 2.0));
            right -= width + 26.0;
        }
    }
}

/// Draws a strip of the plan into an area.
type Strip<'a> = fn(&PlanFigure<'a>, &mut Drawing, Area);

fn stage_colour(stage: &str) -> Colour {
    match stage {
        "rrt" | "rrt_star" | "birrt" => palette::PURPLE,
        "guide" => palette::BLUE,
        "shortcut" => palette::GREEN,
        "taut" => palette::SKY,
        "corridor" => palette::ORANGE,
        _ => palette::VERMILION,
    }
}

/// Edges of both trees as one outline; of very many, a share spread evenly.
fn tree_outline(straight: &[[[f64; 2]; 2]], curved: &[[f64; 8]], frame: &MapFrame) -> Outline {
    let every = (straight.len() + curved.len()).div_ceil(MAX_EDGES).max(1);
    let mut outline = Outline::new();
    for edge in straight.iter().step_by(every) {
        outline.add_line(edge.map(|[x, y]| frame.at(Point2::new(x, y))));
    }
    for numbers in curved.iter().step_by(every) {
        frame.add_curve(&mut outline, &FergusonCurve::from_array(*numbers), false);
    }
    outline
}

/// The path as Bézier curves.
fn curves_outline(segments: &[FergusonCurve], frame: &MapFrame) -> Outline {
    let mut outline = Outline::new();
    for (index, segment) in segments.iter().enumerate() {
        frame.add_curve(&mut outline, segment, index > 0);
    }
    outline
}

/// The path cut by curvature: one outline for each step of the ramp.
fn by_curvature(segments: &[FergusonCurve], limit: f64, frame: &MapFrame) -> Vec<Outline> {
    let steps = palette::RAMP.len();
    let step_of = |curvature: f64| {
        let share = curvature.abs() / limit.max(1e-12);
        ((share * steps as f64) as usize).min(steps - 1)
    };
    let mut outlines = vec![Outline::new(); steps];
    // Where the last piece went, to continue it.
    let mut before = usize::MAX;
    for segment in segments {
        let at = |piece: usize| piece as f64 / PIECES as f64;
        let mut from = 0;
        while from < PIECES {
            let step = step_of(segment.curvature(at(from) + 0.5 / PIECES as f64));
            let mut to = from + 1;
            while to < PIECES && step_of(segment.curvature(at(to) + 0.5 / PIECES as f64)) == step {
                to += 1;
            }
            let piece = segment.sub_curve(at(from), at(to));
            frame.add_curve(&mut outlines[step], &piece, step == before);
            before = step;
            from = to;
        }
    }
    outlines
}
