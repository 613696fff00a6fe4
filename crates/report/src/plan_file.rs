//! Plans as `bikebot plan -o plan.json` writes them, read for drawing. Keys that pictures do not need are passed over.

use bikebot_geometry::{FergusonCurve, Point2};
use bikebot_sim::plan_file::Shapes;
use bikebot_world::{Bounds, Footprint, Obstacle};
use serde::Deserialize;

use crate::error::ReportError;

/// Largest coordinate that is drawn, m: that of any world.
const MAX_COORDINATE: f64 = 1e9;
/// Most curves of a path that are drawn.
const MAX_SEGMENTS: usize = 200_000;

/// A plan and what it was planned for.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct PlanFile {
    /// `found`, or how else it ended.
    pub outcome: String,
    /// Why it ended so.
    #[serde(default)]
    pub reason: String,
    /// Which method planned.
    #[serde(default)]
    pub method: String,
    /// Its seed.
    #[serde(default)]
    pub seed: Option<u64>,
    /// What the search took, s.
    #[serde(default)]
    pub time_s: Option<f64>,
    /// Length of the path, m.
    #[serde(default)]
    pub length_m: Option<f64>,
    /// No path is shorter than this, m.
    #[serde(default)]
    pub lower_bound_m: Option<f64>,
    /// Largest curvature, 1/m; absent for methods that join straight legs.
    #[serde(default)]
    pub max_curvature_per_m: Option<f64>,
    /// Largest jump of curvature, 1/m.
    #[serde(default)]
    pub curvature_jump_per_m: Option<f64>,
    /// Least clearance of the footprint, m.
    #[serde(default)]
    pub min_clearance_m: Option<f64>,
    /// How the search went.
    #[serde(default)]
    pub trace: Vec<TraceStep>,
    /// Ferguson-Coons pieces of the path: `x0 y0 vx0 vy0 x1 y1 vx1 vy1`.
    #[serde(default)]
    segments: Option<Vec<[f64; 8]>>,
    /// What was asked.
    pub problem: Problem,
    /// What the stages of the search made.
    #[serde(default)]
    pub stages: Stages,
}

/// One step forward of the search.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct TraceStep {
    /// Since the search began, s.
    pub time_s: f64,
    /// The stage at work.
    #[serde(default)]
    pub stage: String,
    /// Length of what it had, m.
    pub length_m: f64,
    /// Its cost.
    pub cost: f64,
    /// Whether it was a path that the method may return.
    #[serde(default)]
    pub certified: Option<bool>,
}

/// What was asked.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Problem {
    /// The map file, as the planner found it.
    #[serde(default)]
    pub map: Option<String>,
    /// The field: min x, min y, max x, max y, m.
    pub bounds_m: [f64; 4],
    /// Discs, polygons and blocks of the map; absent in plans of version 0.1.0 and before.
    #[serde(default)]
    pub shapes: Option<Shapes>,
    /// Whether the map has a grid of cells too, which the plan does not carry.
    #[serde(default)]
    pub grid: Option<bool>,
    /// The footprint, as it is written in scenarios.
    pub footprint: String,
    /// Curvature limit, 1/m.
    pub max_curvature_per_m: f64,
    /// Where it begins.
    pub start: End,
    /// Where it ends.
    pub goal: End,
    /// Radius of the goal ball, m.
    #[serde(default)]
    pub tolerance_m: f64,
}

/// A place with or without a heading.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct End {
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// rad; absent: any.
    #[serde(default)]
    pub heading_rad: Option<f64>,
}

impl End {
    /// The place, m.
    #[must_use]
    pub fn position(&self) -> Point2 {
        Point2::new(self.x_m, self.y_m)
    }
}

/// What the stages of the search made; empty for what a method does not make.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Stages {
    /// Edges of the trees over positions, m.
    pub tree: Vec<[[f64; 2]; 2]>,
    /// Edges of the tree in the corridor, as Ferguson-Coons pieces.
    pub corridor_tree: Vec<[f64; 8]>,
    /// What the first search found, m.
    pub coarse: Vec<[f64; 2]>,
    /// The shortened way, m.
    pub guide: Vec<[f64; 2]>,
    /// Middle of the corridor where it is not the guide, m.
    pub corridor_guide: Vec<[f64; 2]>,
    /// Half width of the corridor, m.
    pub corridor_half_width_m: Option<f64>,
}

/// Reads a plan file as far as `T` asks for, and tells of what does not fit by line and key.
///
/// # Errors
///
/// [`ReportError::NotJson`], [`ReportError::NotAPlan`].
pub fn read_json<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, ReportError> {
    let mut json = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut json)
        .map_err(|error| refused(&error.path().to_string(), error.inner()))?;
    json.end().map_err(|error| refused(".", &error))?;
    Ok(value)
}

/// What serde has to say, with the key and the line, for those who write JSON and not Rust.
fn refused(key: &str, error: &serde_json::Error) -> ReportError {
    let line = error.line().max(1);
    let told = error.to_string();
    let what = told
        .rsplit_once(" at line ")
        .map_or(&*told, |(what, _)| what);
    if !error.is_data() {
        let what = what.to_owned();
        return ReportError::NotJson { what, line };
    }
    let what = what.replace("expected f64", "expected a number");
    ReportError::NotAPlan {
        what: match key {
            "." => what,
            key => format!("`{key}`: {what}"),
        },
        line: Some(line),
    }
}

impl PlanFile {
    /// Reads a plan.
    ///
    /// # Errors
    ///
    /// [`ReportError::NotJson`], [`ReportError::NotAPlan`], [`ReportError::NoSegments`]; [`ReportError::Number`],
    /// [`ReportError::Footprint`] and [`ReportError::TooMany`] for what no plan can have.
    pub fn parse(text: &str) -> Result<Self, ReportError> {
        let plan: Self = read_json(text)?;
        plan.check()?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), ReportError> {
        let Some(segments) = &self.segments else {
            return Err(ReportError::NoSegments);
        };
        if segments.len() > MAX_SEGMENTS {
            return Err(ReportError::TooMany {
                count: segments.len(),
                what: "segments",
                most: MAX_SEGMENTS,
            });
        }
        let problem = &self.problem;
        let coordinates = |what: &str, values: &mut dyn Iterator<Item = f64>| {
            for value in values {
                if !value.is_finite() || value.abs() > MAX_COORDINATE {
                    return Err(ReportError::Number {
                        what: what.to_owned(),
                        value,
                        expected: "coordinates lie within ±1e9 m",
                    });
                }
            }
            Ok(())
        };
        coordinates("problem.bounds_m", &mut problem.bounds_m.into_iter())?;
        for (side, [min, max]) in [("width", [0, 2]), ("height", [1, 3])] {
            let extent = problem.bounds_m[max] - problem.bounds_m[min];
            if extent < 1e-6 {
                return Err(ReportError::Number {
                    what: format!("the {side} of problem.bounds_m"),
                    value: extent,
                    expected: "a field has an extent",
                });
            }
        }
        for (what, end) in [
            ("problem.start", problem.start),
            ("problem.goal", problem.goal),
        ] {
            let mut values = [end.x_m, end.y_m].into_iter().chain(end.heading_rad);
            coordinates(what, &mut values)?;
        }
        for (what, value) in [
            ("problem.max_curvature_per_m", problem.max_curvature_per_m),
            ("problem.tolerance_m", problem.tolerance_m),
            (
                "stages.corridor_half_width_m",
                self.stages.corridor_half_width_m.unwrap_or_default(),
            ),
        ] {
            if !(0.0..=MAX_COORDINATE).contains(&value) {
                return Err(ReportError::Number {
                    what: what.into(),
                    value,
                    expected: "it takes a number from 0 to 1e9",
                });
            }
        }
        self.footprint()?;
        let stages = &self.stages;
        coordinates(
            "a number of `segments`",
            &mut segments.iter().flatten().copied(),
        )?;
        coordinates(
            "a number of stages.corridor_tree",
            &mut stages.corridor_tree.iter().flatten().copied(),
        )?;
        coordinates(
            "a number of stages.tree",
            &mut stages.tree.iter().flatten().flatten().copied(),
        )?;
        for (what, line) in [
            ("a number of stages.coarse", &stages.coarse),
            ("a number of stages.guide", &stages.guide),
            ("a number of stages.corridor_guide", &stages.corridor_guide),
        ] {
            coordinates(what, &mut line.iter().flatten().copied())?;
        }
        if let Some(shapes) = &problem.shapes {
            let discs = shapes.discs.iter().flatten();
            let polygons = shapes.polygons.iter().flatten().flatten();
            let blocks = shapes.blocks.iter().flatten();
            coordinates(
                "a number of problem.shapes",
                &mut discs.chain(polygons).chain(blocks).copied(),
            )?;
        }
        Ok(())
    }

    /// The curves of the path; none where none was found.
    #[must_use]
    pub fn segments(&self) -> Vec<FergusonCurve> {
        let segments = self.segments.as_deref().unwrap_or_default();
        segments
            .iter()
            .map(|numbers| FergusonCurve::from_array(*numbers))
            .collect()
    }

    /// The field.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let [x0, y0, x1, y1] = self.problem.bounds_m;
        Bounds::new(x0, y0, x1, y1)
    }

    /// The footprint that was planned for.
    ///
    /// # Errors
    ///
    /// [`ReportError::Footprint`] when it is not one.
    pub fn footprint(&self) -> Result<Footprint, ReportError> {
        self.problem
            .footprint
            .parse()
            .map_err(
                |error: bikebot_world::FootprintError| ReportError::Footprint {
                    what: error.to_string(),
                },
            )
    }

    /// The obstacles, where the plan carries all of them.
    #[must_use]
    pub fn obstacles(&self) -> Option<Vec<Obstacle>> {
        let has_grid = self.problem.grid.unwrap_or(true);
        let shapes = self.problem.shapes.as_ref().filter(|_| !has_grid)?;
        Some(shapes.obstacles())
    }

    /// By what factor a map with the field `map` was stretched to be the plan's.
    ///
    /// # Errors
    ///
    /// [`ReportError::OtherMap`] when no factor does it.
    pub fn scale_of(&self, map: Bounds) -> Result<f64, ReportError> {
        let plan = self.bounds();
        let factor = plan.width() / map.width();
        let (own, found) = (
            self.problem.bounds_m,
            [map.min.x, map.min.y, map.max.x, map.max.y],
        );
        let slack = 1e-6 * plan.width().max(plan.height());
        let fits = own
            .iter()
            .zip(found)
            .all(|(own, found)| (own - factor * found).abs() <= slack);
        if fits {
            Ok(factor)
        } else {
            Err(ReportError::OtherMap {
                map: found,
                plan: own,
            })
        }
    }
}
