//! What the search tells on the way, and what it has found so far.

use crate::refine::Refined;
use crate::report::{Stage, Stages};
use crate::taut::Pulled;
use bikebot_geometry::{FergusonCurve, Point2};

/// What the search tells while it is under way.
pub(crate) struct Step<'a> {
    pub stage: Stage,
    /// Iterations of all stages until then.
    pub iteration: u64,
    /// m.
    pub length: f64,
    pub cost: f64,
    /// A certified path, cheaper than all before it; `None` of a polyline on the way to one.
    pub curves: Option<&'a [FergusonCurve]>,
}

/// Told of every step.
pub(super) type Tell<'t> = &'t mut dyn FnMut(&Step<'_>);

/// What the search came to.
#[derive(Default)]
pub(crate) struct FullSearch {
    pub best: Option<Best>,
    /// It is proven that nothing connects start and goal.
    pub disconnected: bool,
    /// A polyline was found.
    pub has_way: bool,
    /// No path is shorter, m.
    pub lower_bound: f64,
    /// Whether that is the length of the shortest way, headings and curvature ignored.
    pub(super) is_exact: bool,
    /// What the best path was made from; what was found last, if there is none.
    pub stages: Stages,
    /// Lengths of the taut polylines, m.
    pub(super) rivals: Vec<f64>,
    /// Corridors searched.
    pub(super) corridors: u32,
}

/// The cheapest certified path so far.
pub(crate) struct Best {
    pub curves: Vec<FergusonCurve>,
    pub cost: f64,
    pub(super) spacing: f64,
    /// Whether its curvature is continuous.
    pub(super) smooth: bool,
    pub(super) polished: bool,
}

/// A polyline, as it was found and pulled tight.
pub(super) struct Way {
    pub(super) number: u32,
    pub(super) tree: Vec<[Point2; 2]>,
    pub(super) coarse: Vec<Point2>,
    pub(super) pulled: Pulled,
}

impl FullSearch {
    /// Of the best path; infinite without one.
    pub(super) fn cost(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |best| best.cost)
    }

    pub(super) fn is_beaten_by(&self, cost: f64) -> bool {
        cost < self.cost()
    }
}

impl From<Refined> for Best {
    fn from(refined: Refined) -> Self {
        Self {
            curves: refined.curves,
            cost: refined.cost,
            spacing: refined.spacing,
            smooth: true,
            polished: false,
        }
    }
}

pub(super) fn step(iteration: u64, refined: &Refined) -> Step<'_> {
    Step {
        stage: Stage::Refine,
        iteration,
        length: refined.length,
        cost: refined.cost,
        curves: Some(&refined.curves),
    }
}
