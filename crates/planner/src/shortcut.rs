//! Shortcutting, line 5 of Algorithm 1: cut corners between random pairs of points.

use crate::budget::Meter;
use crate::chance::Chance;
use crate::motion::MotionChecker;
use bikebot_geometry::Point2;

/// Tries `attempts` times to replace the part of `path` between two points, uniform by arc length, by their chord.
///
/// Attempts are counted whether they succeed or not, as printed; how many did is returned. Two points on one edge count as an
/// attempt too.
///
/// The points are drawn anywhere on the path, not among its vertices: pairs of vertices stall much earlier (207 m instead of
/// 193 m on the yard).
pub fn apply(
    path: &mut Vec<Point2>,
    attempts: u64,
    checker: &MotionChecker<'_>,
    chance: &mut Chance,
    meter: &mut Meter<'_>,
) -> u64 {
    let mut successes = 0;
    let mut cumulative = lengths(path);
    for _ in 0..attempts {
        if path.len() < 3 || !meter.step() {
            break;
        }
        let length = cumulative[cumulative.len() - 1];
        let (a, b) = (chance.between(0.0, length), chance.between(0.0, length));
        let (first, from) = locate(path, &cumulative, a.min(b));
        let (last, to) = locate(path, &cumulative, a.max(b));
        if first == last || !checker.is_segment_free(from, to) {
            continue;
        }
        // Leg `i` runs from vertex `i` to `i + 1`: the vertices between the two points go.
        path.splice(first + 1..=last, [from, to]);
        path.dedup();
        cumulative = lengths(path);
        successes += 1;
    }
    successes
}

/// Length from the first vertex to each, m.
fn lengths(path: &[Point2]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = Vec::with_capacity(path.len());
    all.push(0.0);
    for leg in path.windows(2) {
        sum += (leg[1] - leg[0]).norm();
        all.push(sum);
    }
    all
}

/// The leg on which arc length `s` lies, and the point there.
fn locate(path: &[Point2], cumulative: &[f64], s: f64) -> (usize, Point2) {
    let leg = cumulative
        .partition_point(|&c| c <= s)
        .clamp(1, path.len() - 1)
        - 1;
    let length = cumulative[leg + 1] - cumulative[leg];
    let part = if length > 0.0 {
        (s - cumulative[leg]) / length
    } else {
        0.0
    };
    (leg, path[leg] + (path[leg + 1] - path[leg]) * part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::chance::Purpose;
    use crate::test_scenes::{block, room};
    use bikebot_world::Footprint;

    fn length(path: &[Point2]) -> f64 {
        path.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
    }

    fn detour() -> Vec<Point2> {
        [
            (1.0, 1.0),
            (1.0, 9.0),
            (3.0, 5.0),
            (5.0, 9.0),
            (9.0, 9.0),
            (9.0, 1.0),
        ]
        .map(|(x, y)| Point2::new(x, y))
        .to_vec()
    }

    #[test]
    fn keeps_the_ends_and_stays_free_and_never_gets_longer() {
        let world = room(10.0, vec![block(4.0, 0.0, 6.0, 7.0)]);
        let checker = MotionChecker::new(&world, &Footprint::Disc { radius: 0.3 }, 0.0, 0.01);
        let mut path = detour();
        let mut before = length(&path);
        let mut chance = Chance::new(3, Purpose::Shortcut, 0);
        let mut meter = Meter::new(&Budget::unlimited());
        for _ in 0..200 {
            apply(&mut path, 1, &checker, &mut chance, &mut meter);
            let after = length(&path);
            assert!(after <= before + 1e-12);
            before = after;
        }
        assert_eq!((path[0], path[path.len() - 1]), (detour()[0], detour()[5]));
        assert!(
            path.windows(2)
                .all(|leg| checker.is_segment_free(leg[0], leg[1]))
        );
        // Around the block's two corners, 0.3 m off: 2 √(3² + 6²) + 2 m is the shortest for a point.
        assert!(before < 18.0, "{before}");
        assert_eq!(meter.iterations(), 200);
    }

    #[test]
    fn a_free_field_leaves_nearly_the_straight_line() {
        let world = room(10.0, vec![]);
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.01);
        let mut path = detour();
        let mut chance = Chance::new(1, Purpose::Shortcut, 0);
        let done = apply(
            &mut path,
            500,
            &checker,
            &mut chance,
            &mut Meter::new(&Budget::unlimited()),
        );
        assert!(done > 0);
        assert!(length(&path) < 8.1, "{}", length(&path));
    }

    #[test]
    fn a_straight_path_and_a_single_point_are_left_alone() {
        let world = room(10.0, vec![]);
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.01);
        let mut chance = Chance::new(1, Purpose::Shortcut, 0);
        for vertices in [1, 2] {
            let mut path = detour()[..vertices].to_vec();
            let mut meter = Meter::new(&Budget::unlimited());
            assert_eq!(apply(&mut path, 10, &checker, &mut chance, &mut meter), 0);
            assert_eq!(path, detour()[..vertices]);
        }
    }
}
