//! The largest curvature and the length, between bounds.

use super::interval::{Bernstein, Interval};
use super::piece::{Piece, curvature};
use super::{CURVATURE_TOLERANCE, LENGTH_TOLERANCE, MOST_HALVINGS, Place, SHORTEST};
use bikebot_geometry::{FergusonCurve, Point2};

/// An upper bound of |σ| over all segments, 1/m, and where it is all but reached; infinite at a cusp, or if not proven.
pub(super) fn largest_curvature(segments: &[FergusonCurve]) -> (f64, Option<Place>) {
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
pub(super) fn length(curve: &FergusonCurve) -> (f64, f64) {
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
