//! When something that moves may be where the bike will ride: a check in arc length and time.
//!
//! The path ahead is cut into pieces. To each belongs what the outline covers while the rear contact is within the piece: the outline
//! in its middle, grown by how far any point of it moves over half a piece. Against this the disc of a [`Mover`] is held over an interval of time
//! at once, at its largest and grown by what it moves; an interval in which they may meet is cut in two until it is short. So a
//! conflict may be found a little too early, or end a little too late; none is missed.

use bikebot_geometry::{CurvePath, Point2};
use bikebot_world::Footprint;

use super::mover::Mover;
use crate::online::hull::{Posed, RoundedBox};

/// Length of a piece, m.
pub(crate) const PIECE: f64 = 0.1;
/// Intervals of time are not cut shorter than this, s.
const SHORTEST: f64 = 0.1;

/// All lead times, s, at which something may be on a piece lie within.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    pub first: f64,
    pub last: f64,
}

/// What the bike covers on the way ahead, piece by piece.
#[derive(Debug, Clone)]
pub(crate) struct Corridor {
    pieces: Vec<Vec<Posed>>,
}

impl Corridor {
    /// Of the outline, grown by `allowance` (m), on `path` from arc length `from` to `to` (m), cut at the path's end; at least one piece.
    pub fn new(path: &CurvePath, from: f64, to: f64, outline: &Footprint, allowance: f64) -> Self {
        let body = RoundedBox::of(outline, allowance);
        let way = to.min(path.length()) - from;
        let count = (way / PIECE).ceil().max(1.0) as usize;
        let mut bend = (usize::MAX, 0.0);
        let pieces = (0..count)
            .map(|k| {
                let begin = from + k as f64 * PIECE;
                let (first, last) = (path.locate(begin).0, path.locate(begin + PIECE).0);
                let curvature = (first..=last)
                    .map(|segment| {
                        if bend.0 != segment {
                            bend = (segment, path.segments()[segment].max_curvature());
                        }
                        bend.1
                    })
                    .fold(0.0, f64::max);
                let place = path.at(begin + 0.5 * PIECE);
                let turned = place.heading.sin_cos();
                body.iter()
                    .map(|part| {
                        let part = RoundedBox {
                            radius: part.radius + 0.5 * PIECE * part.speed_bound(curvature),
                            ..*part
                        };
                        Posed::new(part, place.position.coords, turned)
                    })
                    .collect()
            })
            .collect();
        Self { pieces }
    }

    /// How many pieces there are.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// When `mover` may be on each piece, within `horizon` (s).
    pub fn windows(&self, mover: &Mover, horizon: f64) -> Vec<Option<Window>> {
        self.pieces
            .iter()
            .map(|parts| {
                let gap = |p: Point2| {
                    parts
                        .iter()
                        .map(|part| part.gap(p.coords))
                        .fold(f64::INFINITY, f64::min)
                };
                let is_clear = |early: f64, late: f64| mover.is_clear_of(gap, early, late);
                let first = first(&is_clear, 0.0, horizon)?;
                let last = last(&is_clear, first, horizon).unwrap_or(horizon);
                Some(Window { first, last })
            })
            .collect()
    }
}

/// Begin of the first short interval that is not clear.
fn first(is_clear: &impl Fn(f64, f64) -> bool, early: f64, late: f64) -> Option<f64> {
    if is_clear(early, late) {
        return None;
    }
    if late - early <= SHORTEST {
        return Some(early);
    }
    let middle = 0.5 * (early + late);
    first(is_clear, early, middle).or_else(|| first(is_clear, middle, late))
}

/// End of the last short interval that is not clear.
fn last(is_clear: &impl Fn(f64, f64) -> bool, early: f64, late: f64) -> Option<f64> {
    if is_clear(early, late) {
        return None;
    }
    if late - early <= SHORTEST {
        return Some(late);
    }
    let middle = 0.5 * (early + late);
    last(is_clear, middle, late).or_else(|| last(is_clear, early, middle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{FergusonCurve, Pose2, Vector2};
    use bikebot_world::{Bounds, Obstacle, World};
    use proptest::prelude::*;

    fn path(turn: f64) -> CurvePath {
        let (from, to) = (Pose2::new(0.0, 0.0, 0.0), Pose2::new(7.0, 3.0 * turn, turn));
        let speed = (to.position - from.position).norm();
        CurvePath::new(vec![FergusonCurve::between(from, to, speed)]).unwrap()
    }

    proptest! {
        // Each case compares some 20 000 places with the exact clearance.
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn no_conflict_is_missed(
            turn in -0.9..0.9_f64,
            x in -2.0..9.0_f64,
            y in -6.0..6.0_f64,
            speed in 0.0..3.0_f64,
            heading in -3.2..3.2_f64,
            base in 0.1..0.8_f64,
            growth in 0.0..0.4_f64,
            bend in 0.0..0.2_f64,
            from in 0.0..3.0_f64,
        ) {
            let path = path(turn);
            let velocity = Vector2::new(heading.cos(), heading.sin()) * speed;
            let mover = Mover::straight(0, Point2::new(x, y), velocity, [base, growth, bend]);
            let (allowance, horizon) = (0.05, 6.0);
            let outline = Footprint::bike();
            let corridor = Corridor::new(&path, from, f64::INFINITY, &outline, allowance);
            let windows = corridor.windows(&mover, horizon);
            let grown = outline.grown(allowance);
            let mut lead = 0.0;
            while lead <= horizon {
                let (center, radius) = mover.disc(lead);
                let disc = Obstacle::Disc { center, radius };
                let world = World::new(Bounds::new(-90.0, -90.0, 90.0, 90.0), vec![disc]).unwrap();
                let mut s = from;
                while s < path.length() {
                    let place = path.at(s);
                    let pose = Pose2 { position: place.position, heading: place.heading };
                    // Only what is nearer than both together can meet.
                    if (place.position - center).norm() < grown.reach() + radius
                        && world.overlaps(&grown, &pose)
                    {
                        let piece = ((s - from) / PIECE) as usize;
                        let window = windows[piece.min(windows.len() - 1)];
                        prop_assert!(
                            window.is_some_and(|w| w.first <= lead && lead <= w.last),
                            "s {} lead {}: {:?}", s, lead, window
                        );
                    }
                    s += 0.037;
                }
                lead += 0.043;
            }
        }
    }

    #[test]
    fn one_that_crosses_is_on_the_way_when_it_should_be() {
        // At 1 m/s across a straight path, 3 m before it.
        let line = CurvePath::new(vec![FergusonCurve::straight(
            Point2::new(0.0, 0.0),
            Point2::new(10.0, 0.0),
        )])
        .unwrap();
        let corridor = Corridor::new(&line, 0.0, 10.0, &Footprint::bike(), 0.0);
        let across = Mover::straight(
            1,
            Point2::new(6.0, -3.0),
            Vector2::new(0.0, 1.0),
            [0.3, 0.0, 0.0],
        );
        let windows = corridor.windows(&across, 8.0);
        // In the middle of the outline, 0.3 m wide to either side: from 2.4 to 3.6 s, a tenth and a piece early and late.
        let Window { first, last } = windows[55].unwrap();
        assert!(
            (2.2..=2.4).contains(&first) && (3.6..=3.8).contains(&last),
            "{first} {last}"
        );
        // The front reaches it at 6 − 1.16 − 0.6, the rear leaves at 6 + 0.4 + 0.6 or what the outline has.
        let touched: Vec<usize> = (0..windows.len())
            .filter(|k| windows[*k].is_some())
            .collect();
        assert!((41..=42).contains(&touched[0]), "{}", touched[0]);
        assert!(windows[20].is_none());
    }

    #[test]
    fn what_is_announced_bounds_what_the_track_leaves_open() {
        // Uncertain by 2 m/s, but announced to do no more than half a metre a second, and 4 m away.
        let lost = |fastest: f64| {
            let mover =
                Mover::straight(1, Point2::new(5.0, 4.0), Vector2::zeros(), [0.3, 2.0, 0.0]);
            mover.no_faster_than(fastest)
        };
        let corridor = Corridor::new(&path(0.0), 0.0, 6.0, &Footprint::bike(), 0.0);
        let touched = |mover: &Mover| corridor.windows(mover, 4.0).iter().flatten().count();
        assert!(touched(&lost(f64::INFINITY)) > 10);
        assert_eq!(touched(&lost(0.5)), 0);
    }
}
