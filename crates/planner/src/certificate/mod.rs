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

mod interval;
mod obstacles;
#[cfg(test)]
mod tests;

use crate::problem::PlanningProblem;
use bikebot_geometry::{FergusonCurve, Point2, Vector2, cross};
use bikebot_world::Footprint;
use interval::{Bernstein, Interval};
use obstacles::{Obstacles, convex_hull};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

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

/// P, P′ and P″ at `t`, from the Hermite basis.
fn at(curve: &FergusonCurve, t: f64) -> (Point2, Vector2, Vector2) {
    let (x0, v0) = (curve.start_point(), curve.start_tangent());
    let (x1, v1) = (curve.end_point(), curve.end_tangent());
    let (u, chord) = (1.0 - t, x1 - x0);
    let point = x0 + chord * (t * t * (3.0 - 2.0 * t)) + v0 * (t * u * u) - v1 * (t * t * u);
    let middle = chord * 3.0 - v0 - v1;
    let first = v0 * (u * u) + middle * (2.0 * u * t) + v1 * (t * t);
    let second = (middle - v0) * (2.0 * u) + (v1 - middle) * (2.0 * t);
    (point, first, second)
}

/// σ at `t`, 1/m; not a number where the curve stands still.
fn curvature(curve: &FergusonCurve, t: f64) -> f64 {
    let (_, first, second) = at(curve, t);
    cross(first, second) / first.norm().powi(3)
}

/// Enclosures of a piece of curve. The derivatives are those by the parameter of the whole curve.
#[derive(Debug, Clone, Copy)]
struct Piece {
    segment: usize,
    from: f64,
    to: f64,
    /// P′, by coordinates.
    first: [Bernstein<3>; 2],
    /// N = P′ × P″.
    turn: Bernstein<4>,
    /// D = |P′|².
    squared: Bernstein<5>,
}

impl Piece {
    fn whole(segment: usize, curve: &FergusonCurve) -> Self {
        let (x0, v0) = (curve.start_point(), curve.start_tangent());
        let (x1, v1) = (curve.end_point(), curve.end_tangent());
        let first = [0, 1].map(|i| {
            let [x0, v0, x1, v1] = [x0[i], v0[i], x1[i], v1[i]].map(Interval::of);
            Bernstein([v0, Interval::of(3.0) * (x1 - x0) - v0 - v1, v1])
        });
        let second = first.map(|f| {
            let two = Interval::of(2.0);
            Bernstein([two * (f.0[1] - f.0[0]), two * (f.0[2] - f.0[1])])
        });
        let [left, right]: [Bernstein<4>; 2] =
            [first[0].times(&second[1]), first[1].times(&second[0])];
        let [xx, yy]: [Bernstein<5>; 2] = [first[0].times(&first[0]), first[1].times(&first[1])];
        Self {
            segment,
            from: 0.0,
            to: 1.0,
            first,
            turn: Bernstein(std::array::from_fn(|i| left.0[i] - right.0[i])),
            squared: Bernstein(std::array::from_fn(|i| xx.0[i] + yy.0[i])),
        }
    }

    fn halves(&self) -> [Self; 2] {
        let middle = 0.5 * (self.from + self.to);
        let first = self.first.map(|f| f.halves());
        let (turn, squared) = (self.turn.halves(), self.squared.halves());
        [0, 1].map(|k| Self {
            segment: self.segment,
            from: if k == 0 { self.from } else { middle },
            to: if k == 0 { middle } else { self.to },
            first: [first[0][k], first[1][k]],
            turn: turn[k],
            squared: squared[k],
        })
    }

    fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// A point `reach` (m) from the reference point leaves the straight way between its places at both ends by no more
    /// than this, m.
    fn deviation(&self, reach: f64) -> f64 {
        let h = self.to - self.from;
        // Derivatives by the piece's own parameter are h times those by T.
        let steps = |b: &Bernstein<3>| {
            (b.0[1] - b.0[0])
                .magnitude()
                .max((b.0[2] - b.0[1]).magnitude())
        };
        let second = 2.0 * h * steps(&self.first[0]).hypot(steps(&self.first[1]));
        if reach == 0.0 {
            return 0.125 * second * (1.0 + 1e-12);
        }
        let squared = self.squared.hull();
        // Not a number is no proof of motion either.
        if squared.lo.is_nan() || squared.lo <= 0.0 {
            return f64::INFINITY;
        }
        let slope = |c: &[Interval]| {
            let steps = c.windows(2).map(|w| (w[1] - w[0]).magnitude());
            (c.len() - 1) as f64 * steps.fold(0.0, f64::max)
        };
        let turn = self.turn.hull().magnitude();
        let rate = h * turn / squared.lo;
        let change = h * (slope(&self.turn.0) * squared.hi + turn * slope(&self.squared.0))
            / (squared.lo * squared.lo);
        // and the direction at both ends is right to rounding of P′ only
        let largest = self.first[0].hull().magnitude() + self.first[1].hull().magnitude();
        let rounding = 16.0 * f64::EPSILON * largest / squared.lo.sqrt();
        (0.125 * (second + reach * (change + rate * rate)) + reach * rounding) * (1.0 + 1e-12)
    }
}

/// An upper bound of |σ| over all segments, 1/m, and where it is all but reached; infinite at a cusp, or if not proven.
fn largest_curvature(segments: &[FergusonCurve]) -> (f64, Option<Place>) {
    let mut best = 0.0;
    let mut place = None;
    let see = |segment: usize, t: f64, best: &mut f64, place: &mut Option<Place>| {
        let sigma = curvature(&segments[segment], t).abs();
        if sigma > *best {
            (*best, *place) = (
                sigma,
                Some(Place {
                    segment,
                    parameter: t,
                }),
            );
        }
    };
    for segment in 0..segments.len() {
        for k in 0..=16 {
            see(segment, f64::from(k) / 16.0, &mut best, &mut place);
        }
    }
    let mut open = Vec::new();
    for (segment, curve) in segments.iter().enumerate() {
        let piece = Piece::whole(segment, curve);
        let squared: Bernstein<9> = piece.squared.times(&piece.squared);
        let cubed: Bernstein<13> = squared.times(&piece.squared);
        let turn: Bernstein<7> = piece.turn.times(&piece.turn);
        let turn: Bernstein<13> = turn.times(&Bernstein([Interval::of(1.0); 7]));
        open.push((segment, 0.0, 1.0, piece.squared, cubed, turn));
    }
    let mut halvings = 0;
    while let Some((segment, from, to, squared, cubed, turn)) = open.pop() {
        let limit = best * (1.0 + CURVATURE_TOLERANCE) + 1e-12;
        let limit = Interval::of(limit) * Interval::of(limit);
        let within = (0..13).all(|i| (limit * cubed.0[i] - turn.0[i]).lo >= 0.0);
        if within && squared.hull().lo > 0.0 {
            continue;
        }
        halvings += 1;
        let middle = 0.5 * (from + to);
        if to - from < SHORTEST || halvings > MOST_HALVINGS {
            let parameter = middle;
            return (f64::INFINITY, Some(Place { segment, parameter }));
        }
        see(segment, middle, &mut best, &mut place);
        let (squared, cubed, turn) = (squared.halves(), cubed.halves(), turn.halves());
        open.push((segment, from, middle, squared[0], cubed[0], turn[0]));
        open.push((segment, middle, to, squared[1], cubed[1], turn[1]));
    }
    (best * (1.0 + CURVATURE_TOLERANCE) + 1e-12, place)
}

/// Bounds on the length of a curve, m: chords and control polygons of pieces that differ by little.
fn length(curve: &FergusonCurve) -> (f64, f64) {
    let (x0, x1) = (curve.start_point(), curve.end_point());
    let whole = [
        x0,
        x0 + curve.start_tangent() / 3.0,
        x1 - curve.end_tangent() / 3.0,
        x1,
    ];
    let of = |b: &[Point2; 4]| {
        let polygon: f64 = b.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        ((b[3] - b[0]).norm(), polygon)
    };
    let (mut least, mut most) = (0.0, 0.0);
    let mut open = vec![(whole, 0)];
    while let Some((b, depth)) = open.pop() {
        let (chord, polygon) = of(&b);
        if polygon - chord <= 0.5 * LENGTH_TOLERANCE * polygon || depth == 12 {
            least += chord;
            most += polygon;
            continue;
        }
        let half = |p: Point2, q: Point2| nalgebra::center(&p, &q);
        let [p, q, r] = [half(b[0], b[1]), half(b[1], b[2]), half(b[2], b[3])];
        let [s, u] = [half(p, q), half(q, r)];
        let m = half(s, u);
        open.push(([b[0], p, s, m], depth + 1));
        open.push(([m, u, r, b[3]], depth + 1));
    }
    (least, most)
}

/// The outline as convex cores with one radius about them, in the body frame.
#[derive(Debug)]
struct Body {
    cores: Vec<Vec<Vector2>>,
    radius: f64,
    /// The boundary that the cores make up, where they leave out the inside.
    ring: Option<Vec<Vector2>>,
    /// Farthest vertex, m.
    reach: f64,
}

impl Body {
    fn disc(radius: f64) -> Self {
        Self::new(vec![vec![Vector2::zeros()]], radius, None)
    }

    fn new(cores: Vec<Vec<Vector2>>, radius: f64, ring: Option<Vec<Vector2>>) -> Self {
        let reach = cores.iter().flatten().map(|v| v.norm()).fold(0.0, f64::max);
        Self {
            cores,
            radius,
            ring,
            reach,
        }
    }

    fn of(footprint: &Footprint) -> Self {
        match footprint {
            Footprint::Point => Self::disc(0.0),
            Footprint::Disc { radius } => Self::disc(*radius),
            Footprint::Capsule {
                rear,
                front,
                radius,
            } => {
                let axis = [*rear, *front].map(|x| Vector2::new(x, 0.0));
                Self::new(vec![axis.to_vec()], *radius, None)
            }
            Footprint::Rectangle {
                rear,
                front,
                half_width: w,
            } => {
                let corners = [(*rear, -w), (*front, -w), (*front, *w), (*rear, *w)];
                let corners = corners.map(|(x, y)| Vector2::new(x, y)).to_vec();
                Self::new(vec![corners], 0.0, None)
            }
            Footprint::Polygon(polygon) => {
                let ring: Vec<Vector2> = polygon.vertices().iter().map(|v| v.coords).collect();
                let n = ring.len();
                let edges = (0..n).map(|i| vec![ring[i], ring[(i + 1) % n]]).collect();
                Self::new(edges, polygon.rounding(), Some(ring))
            }
            // A shape not known here is no larger than its reach.
            other => Self::disc(other.reach()),
        }
    }
}

/// The search for the least clearance.
struct Search<'s> {
    obstacles: Obstacles<'s>,
    body: Body,
    segments: &'s [FergusonCurve],
    /// What is to be decided, m: whether the clearance is nowhere below this.
    needed: f64,
}

/// A piece with a lower bound of the clearance on it; the least bound is the greatest entry of a heap.
struct Bounded {
    bound: f64,
    piece: Piece,
}

impl PartialEq for Bounded {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Bounded {}

impl PartialOrd for Bounded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Bounded {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |b: &Self| (b.piece.segment, b.piece.from.to_bits());
        other
            .bound
            .total_cmp(&self.bound)
            .then(place(other).cmp(&place(self)))
    }
}

impl Search<'_> {
    /// A vertex of the body on segment `i` at `t`.
    fn places(&self, i: usize, t: f64, vertices: &[Vector2], out: &mut Vec<Point2>) {
        let (point, first, _) = at(&self.segments[i], t);
        let along = if self.body.reach > 0.0 {
            first / first.norm()
        } else {
            Vector2::x()
        };
        out.extend(vertices.iter().map(|v| {
            Point2::new(
                point.x + along.x * v.x - along.y * v.y,
                point.y + along.y * v.x + along.x * v.y,
            )
        }));
    }

    /// Clearance at a pose, m, if below `cap`; minus the radius where the core meets something.
    fn clearance_at(&self, i: usize, t: f64, cap: f64) -> f64 {
        let mut vertices = Vec::new();
        if let Some(ring) = &self.body.ring {
            self.places(i, t, ring, &mut vertices);
            if self.obstacles.any_inside(&vertices) {
                return -self.body.radius;
            }
        }
        let mut least = cap;
        for core in &self.body.cores {
            vertices.clear();
            self.places(i, t, core, &mut vertices);
            let radius = self.body.radius;
            least = least.min(self.obstacles.distance(&vertices, least + radius) - radius);
        }
        least
    }

    /// A lower bound of the clearance on a piece, m; anything from `enough` on says no more than that.
    fn bound(&self, piece: &Piece, enough: f64) -> f64 {
        let deviation = piece.deviation(self.body.reach) + self.rounding(piece.segment);
        if !deviation.is_finite() {
            return f64::NEG_INFINITY;
        }
        let mut least = enough;
        let mut hull = Vec::new();
        for core in &self.body.cores {
            hull.clear();
            self.places(piece.segment, piece.from, core, &mut hull);
            self.places(piece.segment, piece.to, core, &mut hull);
            if !hull.iter().all(|v| v.x.is_finite() && v.y.is_finite()) {
                return f64::NEG_INFINITY;
            }
            convex_hull(&mut hull);
            let off = self.body.radius + deviation;
            least = least.min(self.obstacles.distance(&hull, least + off) - off);
        }
        least
    }

    /// What rounding of positions and distances may come to, m.
    fn rounding(&self, segment: usize) -> f64 {
        let largest = self.segments[segment]
            .to_array()
            .iter()
            .fold(0.0_f64, |a, b| a.max(b.abs()));
        64.0 * f64::EPSILON * (largest + self.body.reach + self.body.radius)
    }

    /// A proven lower bound of the clearance, the least clearance seen, m, and where.
    fn least_clearance(&self, start: Point2) -> (f64, f64, Option<Place>) {
        let mut best = (f64::INFINITY, None);
        for i in 0..self.segments.len() {
            for t in [0.0, 0.5, 1.0] {
                let clearance = self.clearance_at(i, t, best.0);
                if clearance < best.0 || clearance.is_nan() {
                    best = (
                        clearance,
                        Some(Place {
                            segment: i,
                            parameter: t,
                        }),
                    );
                }
            }
        }
        if self.segments.is_empty() {
            // A start that is an arrival, whatever the heading: no outline but the disc can be asked for.
            let clearance = self.obstacles.distance(&[start], f64::INFINITY) - self.body.radius;
            return (clearance, clearance, None);
        }
        let mut open = BinaryHeap::new();
        for (i, curve) in self.segments.iter().enumerate() {
            let piece = Piece::whole(i, curve);
            let bound = self.bound(&piece, best.0);
            open.push(Bounded { bound, piece });
        }
        let mut halvings = 0;
        let mut proven = best.0;
        while let Some(Bounded { bound, piece }) = open.pop() {
            proven = bound.min(best.0);
            halvings += 1;
            let decided = bound >= self.needed || best.0 < self.needed;
            let stuck = piece.to - piece.from < SHORTEST || halvings > MOST_HALVINGS;
            // Nothing is gained by knowing better how deep in an obstacle it is.
            let hopeless = best.0 <= -self.body.radius && best.0 < self.needed;
            if (best.0 - bound <= CLEARANCE_TOLERANCE && decided) || stuck || hopeless {
                break;
            }
            let t = piece.middle();
            let clearance = self.clearance_at(piece.segment, t, best.0);
            if clearance < best.0 || clearance.is_nan() {
                let segment = piece.segment;
                best = (
                    clearance,
                    Some(Place {
                        segment,
                        parameter: t,
                    }),
                );
            }
            for piece in piece.halves() {
                let bound = self.bound(&piece, best.0);
                open.push(Bounded { bound, piece });
            }
        }
        (proven, best.0, best.1)
    }
}
