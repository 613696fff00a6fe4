//! Test oracle: the exact shortest path of a point among polygons, by Dijkstra's search over the visibility graph.
//!
//! A shortest path bends at convex corners only. They are moved outward by 1 µm, so that a path may pass between walls
//! that touch nothing, and legs along a wall do not count as crossing it.

use crate::test_scenes::Scene;
use bikebot_geometry::Point2;
use bikebot_world::{Obstacle, World};

/// How far a path keeps from the walls, m.
const OUTWARD: f64 = 1e-6;

fn cross(o: Point2, a: Point2, b: Point2) -> f64 {
    (a - o).perp(&(b - o))
}

/// The obstacle's corners, counter-clockwise.
fn ring(obstacle: &Obstacle) -> Vec<Point2> {
    let mut ring = match obstacle {
        Obstacle::Polygon { vertices } => vertices.clone(),
        Obstacle::Block { min, max } => vec![
            *min,
            Point2::new(max.x, min.y),
            *max,
            Point2::new(min.x, max.y),
        ],
        other => panic!("the oracle knows polygons only, not {other:?}"),
    };
    let area: f64 = (0..ring.len())
        .map(|i| ring[i].coords.perp(&ring[(i + 1) % ring.len()].coords))
        .sum();
    if area < 0.0 {
        ring.reverse();
    }
    ring
}

fn corners_moved_outward(ring: &[Point2]) -> impl Iterator<Item = Point2> + '_ {
    let n = ring.len();
    (0..n).filter_map(move |i| {
        let (a, p, b) = (ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]);
        if cross(a, p, b) <= 0.0 {
            return None;
        }
        let normal = |from: Point2, to: Point2| {
            let d = (to - from).normalize();
            bikebot_geometry::Vector2::new(d.y, -d.x)
        };
        let (m, n) = (normal(a, p), normal(p, b));
        Some(p + (m + n) * (OUTWARD / (1.0 + m.dot(&n))))
    })
}

fn contains(ring: &[Point2], p: Point2) -> bool {
    let n = ring.len();
    (0..n)
        .filter(|&i| {
            let (a, b) = (ring[i], ring[(i + 1) % n]);
            (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) * (b.x - a.x) / (b.y - a.y)
        })
        .count()
        % 2
        == 1
}

fn crosses(ring: &[Point2], p: Point2, q: Point2) -> bool {
    let n = ring.len();
    (0..n).any(|i| {
        let (a, b) = (ring[i], ring[(i + 1) % n]);
        cross(p, q, a) * cross(p, q, b) < 0.0 && cross(a, b, p) * cross(a, b, q) < 0.0
    })
}

/// Length (m) of the shortest path of a point from `start` to `goal`; infinite if there is none.
pub(crate) fn shortest_length(world: &World, start: Point2, goal: Point2) -> f64 {
    let rings: Vec<_> = world.obstacles().iter().map(ring).collect();
    let mut nodes = vec![start, goal];
    nodes.extend(
        rings
            .iter()
            .flat_map(|ring| corners_moved_outward(ring))
            .filter(|&p| world.is_inside(p) && !rings.iter().any(|ring| contains(ring, p))),
    );
    let mut length = vec![f64::INFINITY; nodes.len()];
    let mut open: Vec<usize> = (0..nodes.len()).collect();
    length[0] = 0.0;
    while let Some(place) =
        (0..open.len()).min_by(|&i, &j| length[open[i]].total_cmp(&length[open[j]]))
    {
        let node = open.swap_remove(place);
        if node == 1 || length[node].is_infinite() {
            break;
        }
        for &other in &open {
            let candidate = length[node] + (nodes[other] - nodes[node]).norm();
            if candidate < length[other]
                && !rings
                    .iter()
                    .any(|ring| crosses(ring, nodes[node], nodes[other]))
            {
                length[other] = candidate;
            }
        }
    }
    length[1]
}

/// The scenes whose exact lengths are known from elsewhere, and those lengths, m.
pub(crate) const KNOWN: [(&str, f64); 4] = [
    ("fig6", 174.737),
    ("narrow", 184.866),
    ("maze", 187.772),
    ("fig7", 9.963),
];

/// [`shortest_length`] between the ends of a scene.
pub(crate) fn shortest_length_of(scene: &Scene) -> f64 {
    shortest_length(&scene.world, scene.start.position, scene.goal.position)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{block, load, room};

    #[test]
    fn around_a_block_it_is_the_shorter_of_two_known_lengths() {
        let world = room(10.0, vec![block(4.0, 0.0, 6.0, 7.0)]);
        let length = shortest_length(&world, Point2::new(1.0, 1.0), Point2::new(9.0, 1.0));
        let exact = 2.0 * 45.0_f64.sqrt() + 2.0;
        // The corners were moved by a µm, which costs less than ten.
        assert!(length >= exact && length < exact + 1e-5, "{length}");
    }

    #[test]
    fn there_is_no_path_into_a_closed_room() {
        let world = room(10.0, vec![block(4.0, 0.0, 6.0, 10.0)]);
        let length = shortest_length(&world, Point2::new(1.0, 1.0), Point2::new(9.0, 1.0));
        assert!(length.is_infinite());
    }

    #[test]
    fn agrees_with_the_lengths_known_for_the_scenes() {
        for (name, exact) in KNOWN {
            let length = shortest_length_of(&load(name));
            // The known lengths are printed to the millimetre.
            assert!((length - exact).abs() < 1e-3, "{name}: {length}");
        }
    }
}
