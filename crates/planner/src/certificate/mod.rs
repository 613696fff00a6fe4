//! What a path promises, proven again from nothing but its curves, the obstacles and the outline.
//!
//! No code is shared with the planner's own checks: not the motion checker, not the closed form of the largest curvature, not the
//! clearance field. What is said about a whole piece of curve comes from interval arithmetic with outward rounding on
//! Bernstein coefficients (whose hull contains the polynomial), and pieces are halved until that decides.
//!
//! * **Curvature.** With N = P′ × P″ and D = |P′|², |σ| ≤ L on a piece if no Bernstein coefficient of L²D³ − N² (degree 12) is
//!   negative and none of D is zero. L is the largest curvature seen at any point, and [`CURVATURE_TOLERANCE`] more.
//! * **Clearance.** A vertex w = P + R(θ)a of the outline leaves the straight way between its places at both ends of a piece, h
//!   long, by no more than e = h²/8 max |w″|, |w″| ≤ |P″| + |a| (|θ″| + θ′²), θ′ = N/D, θ″ = (N′D − ND′)/D². So the piece sweeps
//!   nothing outside of the convex hull of both places and e about it, whose distance to every obstacle is a closed form.
//!   Pieces with the least such bound are halved first.
//! * **Length.** Between chord and control polygon.
//!
//! Rounding of the closed forms is taken off each clearance: 64 units in the last place of the largest coordinate.

mod clearance;
mod interval;
mod measure;
mod obstacles;
mod piece;
#[cfg(test)]
mod tests;

use crate::problem::PlanningProblem;
use bikebot_geometry::{FergusonCurve, Vector2, cross};
use clearance::{Body, Search};
use measure::{largest_curvature, length};
use obstacles::Obstacles;
use piece::curvature;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// A curvature is known to this part of itself, and may exceed a limit by it.
pub const CURVATURE_TOLERANCE: f64 = 1e-8;
/// The proven clearance is at most this much below the true one, m, if the work allowed suffices.
pub const CLEARANCE_TOLERANCE: f64 = 1e-4;
/// A promised clearance must be proven to this, m.
pub const CLEARANCE_SLACK: f64 = 1e-7;
/// Part of itself by which a promised length may be off.
pub const LENGTH_TOLERANCE: f64 = 1e-6;
/// Largest gap between curves that are joined, and distance from an end, m.
pub const POSITION_TOLERANCE: f64 = 1e-9;
/// Largest turn on the spot between curves, and at an end, rad.
pub const HEADING_TOLERANCE: f64 = 1e-9;
/// Part of itself by which a promised curvature may be lower than what there is: the planner finds its own by other means.
pub const PROMISE_TOLERANCE: f64 = 1e-6;

/// Most halvings in proof of the curvature, and of the clearance, of one path.
const MOST_HALVINGS: usize = 400_000;
/// A piece so short that no halving helps: 2⁻⁴⁰ of its curve.
const SHORTEST: f64 = 1e-12;

/// Curves with continuous heading, or straight legs of a method that ignores headings and curvature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathKind {
    /// The outline is carried along curves; heading and curvature count.
    Curves,
    /// Only the largest disc about the reference point is carried; curvature is unbounded.
    Polyline,
}

/// Figures that came with a path; absent ones are not held against it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Promises {
    /// Largest |σ|, 1/m.
    pub max_curvature: Option<f64>,
    /// Largest jump of σ between neighbours, 1/m.
    pub curvature_jump: Option<f64>,
    /// Clearance that is nowhere undercut, m.
    pub min_clearance: Option<f64>,
    /// m.
    pub length: Option<f64>,
}

/// What is asked of a path beside its problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms {
    /// What it is made of.
    pub kind: PathKind,
    /// Clearance asked for, m.
    pub margin: f64,
    /// The path may end this far from the goal, with any heading, m; 0: at the goal itself.
    pub goal_radius: f64,
    /// What it claims.
    pub promises: Promises,
}

/// Where on a path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Place {
    /// Index of the segment, from 0.
    pub segment: usize,
    /// Parameter T on it, 0 to 1.
    pub parameter: f64,
}

/// Figures of a path, each proven or exact to rounding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Certificate {
    /// Nowhere is |σ| larger, 1/m; larger than the true maximum by at most [`CURVATURE_TOLERANCE`] of it. Infinite at a cusp;
    /// absent for a polyline.
    #[serde(rename = "max_curvature_per_m")]
    pub max_curvature: Option<f64>,
    /// Where it is largest.
    pub max_curvature_at: Option<Place>,
    /// Largest |σ(1) − σ(0)| between neighbours, 1/m; absent for a polyline.
    #[serde(rename = "curvature_jump_per_m")]
    pub curvature_jump: Option<f64>,
    /// Largest turn on the spot between neighbours, rad; absent for a polyline.
    #[serde(rename = "heading_gap_rad")]
    pub heading_gap: Option<f64>,
    /// Largest distance from the end of a segment to the start of the next, m.
    #[serde(rename = "position_gap_m")]
    pub position_gap: f64,
    /// Nowhere does the outline come nearer to anything, m. 0 or less: it was not proven free.
    #[serde(rename = "min_clearance_m")]
    pub min_clearance: f64,
    /// There is a pose no clearer than this, m: the truth lies between.
    #[serde(rename = "min_clearance_at_most_m")]
    pub min_clearance_at_most: f64,
    /// Where that is.
    pub min_clearance_at: Option<Place>,
    /// The length is at least this, m.
    #[serde(rename = "length_at_least_m")]
    pub length_at_least: f64,
    /// The length is at most this, m.
    #[serde(rename = "length_at_most_m")]
    pub length_at_most: f64,
    /// Distance of the first point from the start, m.
    #[serde(rename = "start_gap_m")]
    pub start_gap: f64,
    /// Turn from the start's heading, rad; absent if that is free.
    #[serde(rename = "start_turn_rad")]
    pub start_turn: Option<f64>,
    /// Distance of the last point from the goal's position, m.
    #[serde(rename = "goal_gap_m")]
    pub goal_gap: f64,
    /// Turn to the goal's heading, rad; absent if that is free.
    #[serde(rename = "goal_turn_rad")]
    pub goal_turn: Option<f64>,
}

/// What a path can fail in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ViolationKind {
    /// A number of a curve is not finite.
    NotFinite,
    /// A segment starts elsewhere than the one before ends.
    PositionGap,
    /// The heading jumps at a joint.
    HeadingGap,
    /// The curve stands still and has no heading there.
    Cusp,
    /// The curvature exceeds the limit.
    Curvature,
    /// The clearance is below what is asked for, or could not be proven.
    Clearance,
    /// The path starts elsewhere.
    StartPosition,
    /// The path starts in another direction.
    StartHeading,
    /// The path starts with another curvature than is prescribed there.
    StartCurvature,
    /// The path ends elsewhere.
    EndPosition,
    /// The path ends in another direction.
    EndHeading,
    /// The curvature is larger than promised.
    CurvaturePromise,
    /// The curvature jumps more than promised.
    JumpPromise,
    /// The clearance is less than promised, or could not be proven.
    ClearancePromise,
    /// The length is another than promised.
    LengthPromise,
}

/// One thing that does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Violation {
    /// What.
    pub kind: ViolationKind,
    /// Index of the segment; absent where the path as a whole is meant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segment: Option<usize>,
    /// Parameter T on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<f64>,
    /// What is allowed less what there is, negative, in the unit of the figure.
    pub margin: f64,
}

/// The figures, and what does not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// Absent if the path is no path: a number is not finite.
    pub certificate: Option<Certificate>,
    /// In the order in which they were looked for.
    pub violations: Vec<Violation>,
}

impl Verdict {
    /// Whether everything asked for and promised is proven.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.violations.is_empty()
    }
}

/// Proves a path against its problem and its promises.
///
/// The work is bounded whatever the input: what is not proven within it counts as a violation.
#[must_use]
pub fn verify(problem: &PlanningProblem<'_>, segments: &[FergusonCurve], terms: &Terms) -> Verdict {
    let mut violations = Vec::new();
    // Overflow of huge coordinates is as good as infinite.
    let usable = |c: &FergusonCurve| c.to_array().iter().all(|v| v.abs() <= 1e15);
    let bad = segments.iter().position(|c| !usable(c));
    let asked = [
        problem.max_curvature,
        problem.start.position.x,
        problem.start.position.y,
        problem.goal.position.x,
        problem.goal.position.y,
        terms.margin,
        terms.goal_radius,
    ];
    if bad.is_some() || !asked.iter().all(|v| v.is_finite()) || problem.footprint.check().is_err() {
        violations.push(Violation {
            kind: ViolationKind::NotFinite,
            segment: bad,
            parameter: None,
            margin: f64::NEG_INFINITY,
        });
        return Verdict {
            certificate: None,
            violations,
        };
    }
    let curved = terms.kind == PathKind::Curves;
    let mut check = |kind, place: Option<Place>, allowed: f64, found: f64| {
        // Not a number does not hold.
        if !matches!(
            found.partial_cmp(&allowed),
            Some(Ordering::Less | Ordering::Equal)
        ) {
            violations.push(Violation {
                kind,
                segment: place.map(|p| p.segment),
                parameter: place.map(|p| p.parameter),
                margin: allowed - found,
            });
        }
    };
    let at = |segment, parameter| Some(Place { segment, parameter });

    // Joints.
    let (mut position_gap, mut heading_gap, mut curvature_jump) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut jump_at = None;
    for (i, pair) in segments.windows(2).enumerate() {
        let (a, b) = (&pair[0], &pair[1]);
        let gap = (b.start_point() - a.end_point()).norm();
        position_gap = position_gap.max(gap);
        check(
            ViolationKind::PositionGap,
            at(i + 1, 0.0),
            POSITION_TOLERANCE,
            gap,
        );
        if curved {
            let turn = turn(a.end_tangent(), b.start_tangent());
            heading_gap = heading_gap.max(turn);
            check(
                ViolationKind::HeadingGap,
                at(i + 1, 0.0),
                HEADING_TOLERANCE,
                turn,
            );
            let jump = (curvature(b, 0.0) - curvature(a, 1.0)).abs();
            if jump > curvature_jump || jump.is_nan() {
                (curvature_jump, jump_at) = (jump, at(i + 1, 0.0));
            }
        }
    }

    // Ends.
    let last = segments.len().saturating_sub(1);
    let first_point = segments
        .first()
        .map_or(problem.start.position, |c| c.start_point());
    let last_point = segments
        .last()
        .map_or(problem.start.position, |c| c.end_point());
    let start_gap = (first_point - problem.start.position).norm();
    let goal_gap = (last_point - problem.goal.position).norm();
    check(
        ViolationKind::StartPosition,
        at(0, 0.0),
        POSITION_TOLERANCE,
        start_gap,
    );
    check(
        ViolationKind::EndPosition,
        at(last, 1.0),
        terms.goal_radius + POSITION_TOLERANCE,
        goal_gap,
    );
    let heading = |angle: f64| Vector2::new(angle.cos(), angle.sin());
    let start_turn = (problem
        .start
        .heading
        .filter(|_| curved)
        .zip(segments.first()))
    .map(|(asked, c)| turn(heading(asked), c.start_tangent()));
    let goal_turn = (problem
        .goal
        .heading
        .filter(|_| curved && terms.goal_radius == 0.0))
    .zip(segments.last())
    .map(|(asked, c)| turn(heading(asked), c.end_tangent()));
    if let Some(turn) = start_turn {
        check(
            ViolationKind::StartHeading,
            at(0, 0.0),
            HEADING_TOLERANCE,
            turn,
        );
    }
    if let (Some(asked), Some(first), true) = (problem.start.curvature, segments.first(), curved) {
        check(
            ViolationKind::StartCurvature,
            at(0, 0.0),
            CURVATURE_TOLERANCE * problem.max_curvature,
            (curvature(first, 0.0) - asked).abs(),
        );
    }
    if let Some(turn) = goal_turn {
        check(
            ViolationKind::EndHeading,
            at(last, 1.0),
            HEADING_TOLERANCE,
            turn,
        );
    }

    // Curvature.
    let (mut max_curvature, mut max_curvature_at) = (None, None);
    if curved {
        let (most, place) = largest_curvature(segments);
        (max_curvature, max_curvature_at) = (Some(most), place);
        if most.is_infinite() {
            check(ViolationKind::Cusp, place, problem.max_curvature, most);
        } else {
            // `most` is above what was seen by the tolerance already: allow that, and as much for rounding on both sides.
            let allowed = |limit: f64, part: f64| limit * (1.0 + part) + 2e-12;
            check(
                ViolationKind::Curvature,
                place,
                allowed(problem.max_curvature, 2.0 * CURVATURE_TOLERANCE),
                most,
            );
            if let Some(promised) = terms.promises.max_curvature {
                let allowed = allowed(promised, PROMISE_TOLERANCE);
                check(ViolationKind::CurvaturePromise, place, allowed, most);
            }
        }
        if let Some(promised) = terms.promises.curvature_jump {
            // Two curvatures, each right to a few units in the last place, are subtracted.
            let allowed = promised * (1.0 + PROMISE_TOLERANCE) + 1e-9 * problem.max_curvature;
            check(ViolationKind::JumpPromise, jump_at, allowed, curvature_jump);
        }
    }

    // Length.
    let (mut length_at_least, mut length_at_most) = (0.0, 0.0);
    for curve in segments {
        let (least, most) = length(curve);
        length_at_least += least;
        length_at_most += most;
    }
    if let Some(promised) = terms.promises.length {
        let slack = LENGTH_TOLERANCE * length_at_most + POSITION_TOLERANCE;
        let off = (length_at_least - promised).max(promised - length_at_most);
        let off = if promised.is_finite() { off } else { f64::NAN };
        check(ViolationKind::LengthPromise, None, slack, off);
    }

    // Clearance.
    let body = if curved {
        Body::of(&problem.footprint)
    } else {
        Body::disc(problem.footprint.inscribed_radius())
    };
    // A margin of nothing is not to be undercut at all.
    let least_allowed = terms.margin - CLEARANCE_SLACK.min(0.5 * terms.margin);
    let promised = terms.promises.min_clearance.unwrap_or(f64::NEG_INFINITY);
    let search = Search {
        obstacles: Obstacles::new(problem.world),
        body,
        segments,
        needed: least_allowed.max(promised - CLEARANCE_SLACK),
    };
    let (min_clearance, min_clearance_at_most, min_clearance_at) =
        search.least_clearance(problem.start.position);
    check(
        ViolationKind::Clearance,
        min_clearance_at,
        0.0,
        least_allowed - min_clearance,
    );
    if let Some(promised) = terms.promises.min_clearance {
        check(
            ViolationKind::ClearancePromise,
            min_clearance_at,
            CLEARANCE_SLACK,
            promised - min_clearance,
        );
    }
    Verdict {
        certificate: Some(Certificate {
            max_curvature,
            max_curvature_at,
            curvature_jump: curved.then_some(curvature_jump),
            heading_gap: curved.then_some(heading_gap),
            position_gap,
            min_clearance,
            min_clearance_at_most,
            min_clearance_at,
            length_at_least,
            length_at_most,
            start_gap,
            start_turn,
            goal_gap,
            goal_turn,
        }),
        violations,
    }
}

/// The angle between two directions, rad; not a number if one of them is none.
fn turn(a: Vector2, b: Vector2) -> f64 {
    if a == Vector2::zeros() || b == Vector2::zeros() {
        return f64::NAN;
    }
    cross(a, b).atan2(a.dot(&b)).abs()
}
