//! Local repair: the old path, led around what has come to stand on it.

use crate::birrt;
use crate::budget::Meter;
use crate::chance::{Chance, Purpose};
use crate::motion::MotionChecker;
use crate::params::{GoalMode, PlannerParams};
use crate::replan::{Previous, Validity};
use crate::search::PointQuery;
use crate::taut::{self, Rivals};
use bikebot_geometry::{CurvePath, Point2};

/// Segments by which what is blocked is widened to both sides, and at least so many half widths of the corridor.
const WIDER_SEGMENTS: usize = 3;
const WIDER_HALF_WIDTHS: f64 = 2.0;
/// The way round is looked for in an ellipse of this many times the distance, and so many scales more.
const ELLIPSE: f64 = 1.6;
const ELLIPSE_SCALES: f64 = 12.0;
/// Searches for a way round, samples of the first, and of those that follow: in the ellipse of what is shorter than the best there is little
/// to be found, and it is found soon.
const STARTS: u32 = 6;
const SAMPLES: u64 = 3000;
const MORE_SAMPLES: u64 = 200;
/// A curve that is no free polyline is followed in steps halved at most so often.
const HALVINGS: u32 = 8;

/// A taut polyline from arc length `at` (m) on the old path to its end, around what blocks it; `None` if none was found.
///
/// `discs` ignores headings, as the stages that make guides do.
pub(super) fn way_round(
    path: &CurvePath,
    at: f64,
    validity: &Validity,
    params: &PlannerParams,
    discs: &MotionChecker<'_>,
    seed: u64,
    meter: &mut Meter<'_>,
) -> Option<Vec<Point2>> {
    let [from, to] = gap(path, at, validity, params)?;
    let mut before = follow(path, at, from, discs)?;
    let after = follow(path, to, path.length(), discs)?;
    let around = around(*before.last()?, *after.first()?, params, discs, seed, meter)?;
    before.pop();
    before.extend(around);
    before.extend(after.into_iter().skip(1));
    before.dedup();
    if before.len() < 2 {
        return None;
    }
    Some(taut::pull(&before, &Rivals::none(), discs, meter).path)
}

/// The way the old path leads from where it is left, as a taut polyline.
pub(super) fn same_way(
    previous: &Previous<'_>,
    discs: &MotionChecker<'_>,
    meter: &mut Meter<'_>,
) -> Option<Vec<Point2>> {
    let Previous { curves, at, .. } = *previous;
    let way = follow(curves, at, curves.length(), discs)?;
    (way.len() > 1).then(|| taut::pull(&way, &Rivals::none(), discs, meter).path)
}

/// Arc lengths between which the path is given up, m.
fn gap(path: &CurvePath, at: f64, validity: &Validity, params: &PlannerParams) -> Option<[f64; 2]> {
    let [first, last] = validity.blocked?;
    let wider = WIDER_HALF_WIDTHS * params.corridor_half_width();
    let count = path.segments().len();
    let from = path
        .segment_start(first.saturating_sub(WIDER_SEGMENTS))
        .min(path.segment_start(first) - wider);
    let to = path
        .segment_start((last + 1 + WIDER_SEGMENTS).min(count))
        .max(path.segment_start(last + 1) + wider);
    Some([from.max(at), to.min(path.length())])
}

/// The path between two arc lengths as a free polyline: joint to joint, or finer where it curves around something.
fn follow(path: &CurvePath, from: f64, to: f64, discs: &MotionChecker<'_>) -> Option<Vec<Point2>> {
    let position = |s: f64| path.at(s).position;
    let mut points = vec![position(from)];
    let mut s = from;
    let joints = (0..=path.segments().len()).map(|i| path.segment_start(i));
    for joint in joints.filter(|&s| s > from && s < to).chain([to]) {
        while s < joint {
            let mut next = joint;
            let mut halvings = 0;
            let here = points[points.len() - 1];
            while !discs.is_segment_free(here, position(next)) {
                halvings += 1;
                if halvings > HALVINGS {
                    return None;
                }
                next = s + 0.5 * (next - s);
            }
            points.push(position(next));
            s = next;
        }
    }
    Some(points)
}

/// The shortest of several taut ways between two places of the path.
fn around(
    from: Point2,
    to: Point2,
    params: &PlannerParams,
    discs: &MotionChecker<'_>,
    seed: u64,
    meter: &mut Meter<'_>,
) -> Option<Vec<Point2>> {
    let mut best: Option<Vec<Point2>> = None;
    let mut lengths: Vec<f64> = Vec::new();
    let mut shorter_than = ELLIPSE * (to - from).norm() + ELLIPSE_SCALES * params.scale;
    for start in 0..STARTS {
        let query = PointQuery {
            checker: discs,
            start: from,
            goal: to,
            goal_mode: GoalMode::Pose,
            tolerance: 0.0,
            max_step: params.max_step(),
            max_samples: if start == 0 { SAMPLES } else { MORE_SAMPLES }
                .min(params.search_iterations),
            shorter_than,
        };
        let mut chance = Chance::new(seed, Purpose::Repair, start);
        let search = birrt::search(&query, true, &mut chance, meter);
        let Some(coarse) = search.path else {
            // Another start would use up as many samples for nothing, or nearly.
            break;
        };
        let rivals = Rivals {
            lengths: &lengths,
            slack: 0.0,
        };
        let pulled = taut::pull(&coarse, &rivals, discs, meter);
        if lengths.iter().all(|length| pulled.length < *length) {
            shorter_than = shorter_than.min(pulled.length);
            best = Some(pulled.path);
        }
        lengths.push(pulled.length);
        // Nothing is shorter than the straight line.
        if coarse.len() == 2 || meter.cut_short().is_some() {
            break;
        }
    }
    best
}
