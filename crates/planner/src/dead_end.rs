//! Proof that no curve within the curvature limit gets away from an end along the heading prescribed there.
//!
//! A curve of curvature at most κ that leaves the origin along +x has turned by no more than κs after the length s. Up to a quarter turn,
//! s ≤ π/(2κ), it is therefore in the box
//!
//! ```text
//!     B(s) = [ sin(κs)/κ, s ] × [ −Y(s), Y(s) ],      Y(s) = (1 − cos κs)/κ,
//! ```
//!
//! and a disc that the footprint contains, `a ≥ 0` ahead of the reference point, has its centre in
//!
//! ```text
//!     [ sin(κs)/κ + a cos κs, s + a ] × [ −Y(s) − a sin κs, Y(s) + a sin κs ].
//! ```
//!
//! So if a flood through cells in which that disc may stand, started at the end and confined to the boxes up to some s, comes to none of the
//! cells in B(s), there is no such curve of length s: the wall is too near to turn off. Goals are the same, travelled
//! backwards. Cells are blocked only where no point of them can be free, which the clearance of their centres tells. The converse
//! does not hold: what is not proven impossible may be so.

use crate::budget::Meter;
use crate::motion::MotionChecker;
use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Footprint, FootprintDisc};
use std::f64::consts::FRAC_PI_2;

/// Pieces of the quarter turn, and cells per turning radius. Finer ones prove tighter cases.
const PIECES: usize = 24;
const CELLS_PER_RADIUS: f64 = 20.0;
/// Most cells: where discs stand far ahead of the reference point, cells are larger.
const MOST_CELLS: f64 = 20_000.0;
/// Cells that count as one iteration of the budget.
const CELLS_PER_ITERATION: usize = 64;

/// Whether it is proven that no curve of at least the length `at_least` (m), with curvature up to `max_curvature` (1/m), leaves `end` along
/// its heading. `false` proves nothing.
#[must_use]
pub fn is_proven(
    checker: &MotionChecker<'_>,
    end: &Pose2,
    max_curvature: f64,
    at_least: f64,
    meter: &mut Meter<'_>,
) -> bool {
    let quarter = FRAC_PI_2 / max_curvature;
    let longest = quarter.min(at_least);
    let ahead = end.position + end.direction() * quarter;
    if !(longest > 0.0 && longest.is_finite()) || checker.is_segment_free(end.position, ahead) {
        return false;
    }
    inner_discs(checker).into_iter().any(|disc| {
        let boxes = Boxes::new(max_curvature, disc.offset, longest);
        boxes.confine(checker, end, disc.radius, meter)
    })
}

/// Discs that the footprint contains, at or ahead of its reference point.
fn inner_discs(checker: &MotionChecker<'_>) -> Vec<FootprintDisc> {
    let own = FootprintDisc {
        offset: 0.0,
        lateral: 0.0,
        radius: checker.inscribed_radius(),
    };
    let front = match checker.footprint() {
        Footprint::Capsule { front, radius, .. } => Some(FootprintDisc {
            offset: *front,
            lateral: 0.0,
            radius: *radius,
        }),
        Footprint::Rectangle {
            rear,
            front,
            half_width,
        } => {
            let radius = half_width.min(0.5 * (front - rear));
            Some(FootprintDisc {
                offset: front - radius,
                lateral: 0.0,
                radius,
            })
        }
        _ => None,
    };
    let mut discs = vec![own];
    discs.extend(front.filter(|disc| disc.offset > 0.0));
    discs
}

/// Where the centre of a disc may be along the first quarter turn, piece by piece.
struct Boxes {
    /// Disc's distance ahead of the reference point, m.
    offset: f64,
    /// Of piece k: from x, to x, and |y| up to, m.
    pieces: Vec<[f64; 3]>,
}

impl Boxes {
    fn new(max_curvature: f64, offset: f64, longest: f64) -> Self {
        let forward = |s: f64| {
            let turn = max_curvature * s;
            turn.sin() / max_curvature + offset * turn.cos()
        };
        let pieces = (0..PIECES)
            .map(|k| {
                let [from, to] = [k, k + 1].map(|k| longest * k as f64 / PIECES as f64);
                let turn = max_curvature * to;
                [
                    // Concave in s, so that it is least at one of the ends.
                    forward(from).min(forward(to)),
                    to + offset,
                    (1.0 - turn.cos()) / max_curvature + offset * turn.sin(),
                ]
            })
            .collect();
        Self { offset, pieces }
    }

    /// Whether a flood over places where a disc of this radius may be comes to no box of some piece.
    fn confine(
        &self,
        checker: &MotionChecker<'_>,
        end: &Pose2,
        radius: f64,
        meter: &mut Meter<'_>,
    ) -> bool {
        let [_, far, wide] = self.pieces[PIECES - 1];
        let near = self.pieces.iter().map(|p| p[0]).fold(self.offset, f64::min);
        let radius_of_turn = (far - self.offset) / FRAC_PI_2;
        let cell = (radius_of_turn / CELLS_PER_RADIUS)
            .max((2.0 * (far - near) * wide / MOST_CELLS).sqrt());
        let columns = ((far - near) / cell).ceil() as usize + 1;
        let rows = (2.0 * wide / cell).ceil() as usize + 1;
        let half_diagonal = 0.5 * cell * std::f64::consts::SQRT_2;
        let need = radius + checker.margin();
        let mut free = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                if free.len().is_multiple_of(CELLS_PER_ITERATION) && !meter.step() {
                    return false;
                }
                let [x, y] = [
                    near + (column as f64 + 0.5) * cell,
                    (row as f64 + 0.5) * cell - wide,
                ];
                let at = end.transform(Point2::new(x, y));
                let clearance = checker.world().clearance(at) + half_diagonal;
                // What is not a number is not blocked.
                free.push(clearance >= need || clearance.is_nan());
            }
        }
        // The least piece whose box a cell meets; a cell that meets none is out of reach.
        let touches = |piece: usize, column: usize, row: usize| {
            let [from, to, side] = self.pieces[piece];
            let left = near + column as f64 * cell;
            let low = row as f64 * cell - wide;
            left + cell >= from && left <= to && low + cell >= -side && low <= side
        };
        let start = {
            let column = ((self.offset - near) / cell) as usize;
            let row = (wide / cell) as usize;
            (column.min(columns - 1), row.min(rows - 1))
        };
        // Nearer walls are seen by shorter curves, before they fan out.
        (1..=4).any(|quarter| {
            let last = PIECES * quarter / 4 - 1;
            let mut seen = vec![false; columns * rows];
            let mut open = vec![start];
            seen[start.1 * columns + start.0] = true;
            while let Some((column, row)) = open.pop() {
                if touches(last, column, row) {
                    return false;
                }
                for next_row in row.saturating_sub(1)..=(row + 1).min(rows - 1) {
                    for next in column.saturating_sub(1)..=(column + 1).min(columns - 1) {
                        let index = next_row * columns + next;
                        if !seen[index]
                            && free[index]
                            && (0..=last).any(|piece| touches(piece, next, next_row))
                        {
                            seen[index] = true;
                            open.push((next, next_row));
                        }
                    }
                }
            }
            true
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::test_scenes::{block, room};
    use bikebot_world::World;

    fn proves(world: &World, footprint: &Footprint, end: Pose2, max_curvature: f64) -> bool {
        let checker = MotionChecker::new(world, footprint, 0.0, 0.01);
        let mut meter = Meter::new(&Budget::unlimited());
        is_proven(&checker, &end, max_curvature, 100.0, &mut meter)
    }

    /// Facing a long wall at right angles a curve of radius R gets by with the distance R, and with no less.
    #[test]
    fn a_wall_ahead_needs_a_turning_radius() {
        let world = room(40.0, vec![block(20.0, 0.0, 21.0, 40.0)]);
        for radius in [0.5, 2.0, 6.0] {
            for (part, proven) in [
                (0.3, true),
                (0.7, true),
                (0.9, true),
                (1.01, false),
                (2.0, false),
            ] {
                let end = Pose2::new(20.0 - part * radius, 20.0, 0.0);
                assert_eq!(
                    proves(&world, &Footprint::Point, end, 1.0 / radius),
                    proven,
                    "R = {radius}, at {part} R"
                );
            }
        }
    }

    #[test]
    fn the_front_of_a_long_outline_counts() {
        let world = room(40.0, vec![block(20.0, 0.0, 21.0, 40.0)]);
        let capsule = Footprint::Capsule {
            rear: 0.0,
            front: 3.0,
            radius: 0.3,
        };
        // The front disc swings out by less than it is ahead: a wall within its length and little more stops it.
        let at = |distance: f64| Pose2::new(20.0 - distance, 20.0, 0.0);
        assert!(proves(&world, &capsule, at(3.5), 0.5));
        assert!(!proves(&world, &capsule, at(6.5), 0.5));
    }

    #[test]
    fn a_pocket_is_a_dead_end_and_a_post_is_not() {
        let pocket = vec![
            block(10.0, 9.0, 12.0, 9.5),
            block(10.0, 10.5, 12.0, 11.0),
            block(12.0, 9.0, 12.5, 11.0),
        ];
        let inside = Pose2::new(11.0, 10.0, 0.0);
        assert!(proves(
            &room(20.0, pocket.clone()),
            &Footprint::Point,
            inside,
            0.5
        ));
        // Turned round, it leaves.
        let turned = Pose2::new(11.0, 10.0, std::f64::consts::PI);
        assert!(!proves(&room(20.0, pocket), &Footprint::Point, turned, 0.5));
        let post = vec![block(12.0, 9.9, 12.1, 10.1)];
        assert!(!proves(&room(20.0, post), &Footprint::Point, inside, 0.5));
    }

    #[test]
    fn a_curve_too_short_to_meet_the_wall_is_not_ruled_out() {
        let world = room(40.0, vec![block(20.0, 0.0, 21.0, 40.0)]);
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.01);
        let end = Pose2::new(19.0, 20.0, 0.0);
        let mut meter = Meter::new(&Budget::unlimited());
        assert!(!is_proven(&checker, &end, 0.25, 0.8, &mut meter));
        assert!(is_proven(&checker, &end, 0.25, 4.0, &mut meter));
    }
}
