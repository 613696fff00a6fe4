//! Discs that cover a polygon and hardly more: set cover on a lattice.
//!
//! The plane about the polygon is cut into square cells of side g. A disc of radius r covers a cell whose centre lies within
//! r − g/√2 of its own, whatever part of the cell is polygon: so discs that cover all cells that touch the polygon cover
//! the polygon, exactly. A disc at c sticks out by no more than ε if its radius is d + ε, d the distance from c to the
//! outline; each candidate takes all of it. Of those the one that covers most of what is still bare is chosen, again
//! and again (a greedy cover is within ln n of the smallest, and in practice one or two discs off).

use std::collections::BinaryHeap;

use bikebot_geometry::Point2;

use super::FootprintDisc;
use super::polygon::signed_distance;
use crate::obstacle::{Bounds, signed_area};

/// How far the discs may stick out, as a part of the polygon's width.
const OVERSHOOT: f64 = 0.1;

/// Cells per overshoot allowed, along an axis.
const CELLS: f64 = 2.0;

/// Most cells that touch the polygon, about; a longer shape gets larger ones, and more overshoot.
const MOST_CELLS: f64 = 4000.0;

/// Most cells of the lattice about the polygon.
const MOST_LATTICE: f64 = 60_000.0;

/// Most discs; a very slender shape gets larger discs instead of more.
const MOST_DISCS: usize = 32;

/// A cover of the ring's inside, rear to front, then right to left.
pub(super) fn of(ring: &[Point2]) -> Vec<FootprintDisc> {
    let Some(bounds) = Bounds::around(ring.iter().copied()) else {
        return Vec::new();
    };
    let area = signed_area(ring).abs();
    let box_area = bounds.width() * bounds.height();
    let mut overshoot = (OVERSHOOT * width(ring, &bounds, area))
        .max(CELLS * (area / MOST_CELLS).sqrt())
        .max(CELLS * (box_area / MOST_LATTICE).sqrt());
    let mut discs = cover(ring, &bounds, overshoot);
    while discs.len() > MOST_DISCS {
        overshoot *= 1.4;
        discs = cover(ring, &bounds, overshoot);
    }
    discs.sort_by(|a, b| {
        a.offset
            .total_cmp(&b.offset)
            .then(a.lateral.total_cmp(&b.lateral))
    });
    discs
}

/// The diameter of about the largest disc inside, m.
fn width(ring: &[Point2], bounds: &Bounds, area: f64) -> f64 {
    let step = (bounds.width() * bounds.height() / 3000.0).sqrt();
    let inside = lattice(bounds, step)
        .map(|p| -signed_distance(ring, p))
        .fold(0.0, f64::max);
    let round = (0..ring.len()).map(|i| (ring[(i + 1) % ring.len()] - ring[i]).norm());
    // A strip too thin for the lattice: twice the area over the way around it.
    (2.0 * inside).max(2.0 * area / round.sum::<f64>())
}

/// Centres of the square cells of side `step` (m) that cover `bounds`, row by row.
fn lattice(bounds: &Bounds, step: f64) -> impl Iterator<Item = Point2> + use<> {
    let count = |extent: f64| (extent / step).ceil().max(1.0) as usize;
    let (columns, rows) = (count(bounds.width()), count(bounds.height()));
    let min = bounds.min;
    (0..rows).flat_map(move |row| {
        (0..columns).map(move |column| {
            Point2::new(
                min.x + (column as f64 + 0.5) * step,
                min.y + (row as f64 + 0.5) * step,
            )
        })
    })
}

/// A greedy cover with at most `overshoot` (m) outside of the ring.
fn cover(ring: &[Point2], bounds: &Bounds, overshoot: f64) -> Vec<FootprintDisc> {
    let step = overshoot / CELLS;
    let half_diagonal = step * std::f64::consts::FRAC_1_SQRT_2;
    // A part in 10⁹ more, so that rounding cannot leave a sliver uncovered.
    let cells: Vec<(Point2, f64)> = lattice(bounds, step)
        .map(|p| (p, signed_distance(ring, p)))
        .filter(|(_, distance)| *distance <= half_diagonal * (1.0 + 1e-9))
        .collect();
    let mut is_bare = vec![true; cells.len()];
    let mut bare = cells.len();
    let covers = |candidate: usize, cell: usize| {
        let (centre, distance) = cells[candidate];
        let within = overshoot - distance - half_diagonal * (1.0 + 1e-9);
        (cells[cell].0 - centre).norm_squared() <= within * within
    };
    // What a candidate would cover only ever becomes less: an old count is an upper bound (lazy evaluation).
    let mut queue: BinaryHeap<(usize, std::cmp::Reverse<usize>)> = (0..cells.len())
        .map(|i| {
            let gain = (0..cells.len()).filter(|&j| covers(i, j)).count();
            (gain, std::cmp::Reverse(i))
        })
        .collect();
    let mut discs = Vec::new();
    while bare > 0
        && let Some((old, std::cmp::Reverse(i))) = queue.pop()
    {
        let gain = (0..cells.len())
            .filter(|&j| is_bare[j] && covers(i, j))
            .count();
        let is_best = queue.peek().is_none_or(|next| gain >= next.0);
        if gain < old && !is_best {
            queue.push((gain, std::cmp::Reverse(i)));
            continue;
        }
        let (centre, distance) = cells[i];
        for (j, is_bare) in is_bare.iter_mut().enumerate() {
            if *is_bare && covers(i, j) {
                *is_bare = false;
                bare -= 1;
            }
        }
        discs.push(FootprintDisc {
            offset: centre.x,
            lateral: centre.y,
            radius: overshoot - distance,
        });
    }
    discs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(points: &[(f64, f64)]) -> Vec<Point2> {
        points.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    fn outlines() -> Vec<(Vec<Point2>, f64)> {
        vec![
            // with the width of each
            (
                ring(&[(-0.4, -0.3), (1.4, -0.3), (1.4, 0.3), (-0.4, 0.3)]),
                0.6,
            ),
            (
                ring(&[
                    (0.0, 0.0),
                    (3.0, 0.0),
                    (3.0, 1.0),
                    (1.0, 1.0),
                    (1.0, 2.0),
                    (0.0, 2.0),
                ]),
                // the disc in the corner of the L: 2 (2 − √2)
                1.1716,
            ),
            // inradius of the right triangle: (3 + 4 − 5)/2
            (ring(&[(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)]), 2.0),
        ]
    }

    #[test]
    fn every_point_of_the_outline_and_its_inside_is_covered() {
        for (ring, _) in outlines() {
            let discs = of(&ring);
            let bounds = Bounds::around(ring.iter().copied()).unwrap();
            let fine = lattice(&bounds, 0.01).filter(|p| signed_distance(&ring, *p) <= 0.0);
            let n = ring.len();
            let edges = (0..n).flat_map(|i| {
                let (a, b) = (ring[i], ring[(i + 1) % n]);
                (0..=100).map(move |k| a + (b - a) * (f64::from(k) / 100.0))
            });
            for p in fine.chain(edges) {
                let covered = discs
                    .iter()
                    .any(|disc| (p - Point2::new(disc.offset, disc.lateral)).norm() <= disc.radius);
                assert!(covered, "{p} of {ring:?}");
            }
        }
    }

    #[test]
    fn no_disc_sticks_out_by_more_than_a_tenth_of_the_width() {
        for (ring, width) in outlines() {
            let discs = of(&ring);
            assert!(discs.len() <= 20, "{} discs", discs.len());
            for disc in &discs {
                let centre = Point2::new(disc.offset, disc.lateral);
                let out = disc.radius + signed_distance(&ring, centre);
                // The width itself is measured on a lattice, never larger than it is.
                assert!(out <= 0.1 * width + 1e-9, "{out} of {width}");
            }
        }
    }

    #[test]
    fn a_needle_gets_larger_discs_instead_of_more() {
        let needle = ring(&[(0.0, 0.0), (100.0, 60.0), (100.0, 60.1)]);
        let discs = of(&needle);
        assert!(!discs.is_empty() && discs.len() <= MOST_DISCS);
        assert!(discs.iter().all(|disc| disc.radius < 10.0));
    }
}
