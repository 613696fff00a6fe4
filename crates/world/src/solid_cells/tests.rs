//! The bits against the boundary's edges tried one by one, and the ray against every cell's square.

use super::*;
use crate::grid::Cell;
use bikebot_geometry::Pose2;
use proptest::prelude::*;

const GO: &dyn Fn() -> bool = &|| false;

/// A number in [0, 1) from a counter.
fn hashed(k: u64) -> f64 {
    let mut z = k.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
}

fn grid_of(
    width: usize,
    height: usize,
    origin: Pose2,
    solid: impl Fn(usize, usize) -> bool,
) -> OccupancyGrid {
    let cells = (0..width * height)
        .map(|i| match solid(i % width, i / width) {
            true => Cell::Occupied,
            false => Cell::Free,
        })
        .collect();
    OccupancyGrid::new(width, height, 0.25, origin, cells).expect("valid")
}

/// Noise of a density, in patches, so that there are specks, blobs, holes and wide empty places.
fn noise(width: usize, height: usize, origin: Pose2, density: f64, seed: u64) -> OccupancyGrid {
    let salt = seed << 40;
    grid_of(width, height, origin, |x, y| {
        let patch = hashed(salt ^ ((x / 9) * 1000 + y / 9) as u64);
        let speck = hashed(salt ^ ((x * 5000 + y) as u64 + 7_000_000));
        patch < density || speck < 0.2 * density * density
    })
}

/// The distance to the nearest edge of the boundary, with the sign of the cell that holds the point.
fn brute(grid: &OccupancyGrid, p: Point2) -> f64 {
    let edges = grid.boundary(0);
    let squared = edges
        .iter()
        .map(|e| e.distance_squared(p))
        .fold(f64::INFINITY, f64::min);
    let inside = grid
        .world_to_cell(p)
        .is_some_and(|(x, y)| grid.is_solid(x as isize, y as isize));
    if inside {
        -squared.sqrt()
    } else {
        squared.sqrt()
    }
}

#[test]
fn distances_are_those_to_the_boundary_edges_inside_outside_and_off_the_grid() {
    for (seed, density) in [(1, 0.02), (2, 0.3), (3, 0.9), (4, 1.0), (5, 0.0)] {
        for yaw in [0.0, 0.7] {
            // Sides that are no multiple of eight, more than one node of tiles.
            let grid = noise(149, 83, Pose2::new(3.0, -2.0, yaw), density, seed);
            let cells = SolidCells::new(&grid, GO).expect("not stopped");
            let mut hint = CellId::NONE;
            for k in 0..1_500 {
                let local = Vector2::new(
                    170.0 * hashed(k) - 10.0,
                    100.0 * hashed(k + 9_999_999) - 8.0,
                );
                let p = grid.from_cell_coordinates(local);
                let expected = brute(&grid, p);
                let (fresh, cell) = cells.signed_distance(p, f64::INFINITY, CellId::NONE);
                let (hinted, same) = cells.signed_distance(p, f64::INFINITY, hint);
                assert_eq!((fresh.to_bits(), cell), (hinted.to_bits(), same));
                if expected.is_finite() {
                    assert!(
                        (fresh - expected).abs() < 1e-12,
                        "{local}: {fresh} for {expected}"
                    );
                    let near = cells.nearest_point(p, cell);
                    assert!(((near - p).norm() - fresh.abs()).abs() < 1e-12);
                } else {
                    assert_eq!(cell, CellId::NONE);
                }
                // From outside nothing beyond the limit is an answer.
                let limit = 2.0 * hashed(k + 5);
                let (within, cell) = cells.signed_distance(p, limit, hint);
                if fresh < limit {
                    assert_eq!(within, fresh);
                } else {
                    assert_eq!((within, cell), (limit, CellId::NONE));
                }
                hint = same;
            }
        }
    }
}

#[test]
fn a_point_on_a_line_between_cells_touches_to_the_last_bit() {
    let grid = noise(60, 60, Pose2::new(0.1, 0.3, 0.0), 0.4, 8);
    let cells = SolidCells::new(&grid, GO).expect("not stopped");
    let mut touching = 0;
    for x in 1..60 {
        for y in 0..60 {
            let (a, b) = (cells.is_solid(x - 1, y), cells.is_solid(x, y));
            if a != b {
                let corner = grid.from_cell_coordinates(Vector2::new(x as f64, y as f64));
                let p = Point2::new(corner.x, corner.y + 0.1);
                let (distance, _) = cells.signed_distance(p, 1.0, CellId::NONE);
                assert_eq!(distance, 0.0, "{x} {y}");
                touching += 1;
            }
        }
    }
    assert!(touching > 100);
}

#[test]
fn rays_end_where_the_boundary_edges_say() {
    for (seed, density) in [(1, 0.02), (2, 0.2), (3, 0.6)] {
        for yaw in [0.0, -2.0] {
            let grid = noise(149, 83, Pose2::new(3.0, -2.0, yaw), density, seed);
            let cells = SolidCells::new(&grid, GO).expect("not stopped");
            let edges: Vec<_> = grid
                .boundary(0)
                .into_iter()
                .map(crate::primitive::Primitive::Edge)
                .collect();
            for k in 0..400 {
                let local = Vector2::new(
                    190.0 * hashed(k) - 20.0,
                    120.0 * hashed(k + 9_999_999) - 18.0,
                );
                let p = grid.from_cell_coordinates(local);
                if cells.contains(p) {
                    continue;
                }
                let angle = match k % 4 {
                    0 => std::f64::consts::FRAC_PI_2 * (k / 4 % 4) as f64 + yaw,
                    _ => 7.0 * hashed(k + 31),
                };
                let direction = Vector2::new(angle.cos(), angle.sin());
                let expected = edges
                    .iter()
                    .filter_map(|e| e.ray_hit(p, direction))
                    .fold(f64::INFINITY, f64::min);
                let found = cells
                    .cast_ray(p, direction, f64::INFINITY)
                    .unwrap_or(f64::INFINITY);
                let agree = found == expected || (found - expected).abs() < 1e-9;
                assert!(agree, "{local} {angle}: {found} for {expected}");
                if found.is_finite() {
                    assert_eq!(cells.cast_ray(p, direction, found * 0.999), None);
                }
            }
        }
    }
}

#[test]
fn a_ray_does_not_slip_between_two_cells_that_share_a_corner() {
    let grid = grid_of(16, 16, Pose2::new(0.0, 0.0, 0.0), |x, y| x + y == 15);
    let cells = SolidCells::new(&grid, GO).expect("not stopped");
    let diagonal = Vector2::new(0.5, 0.5).normalize();
    for k in 0..12 {
        // Exactly through the corners, as closely as coordinates can say.
        let p = Point2::new(0.25 * f64::from(k), 0.0);
        assert!(cells.cast_ray(p, diagonal, 100.0).is_some());
    }
}

#[test]
fn the_distance_of_a_segment_is_that_of_the_nearest_edge() {
    for yaw in [0.0, 0.4] {
        let grid = noise(120, 90, Pose2::new(0.0, 0.0, yaw), 0.05, 3);
        let cells = SolidCells::new(&grid, GO).expect("not stopped");
        let edges = grid.boundary(0);
        for k in 0..300 {
            let a =
                grid.from_cell_coordinates(Vector2::new(120.0 * hashed(k), 90.0 * hashed(k + 77)));
            let b = a + Vector2::new(hashed(k + 1000) - 0.5, hashed(k + 2000) - 0.5) * 4.0;
            if cells.contains(a) {
                // In the midst of the solid no edge need be near.
                continue;
            }
            let squared = |s: Point2, e: Point2| {
                use crate::primitive::point_segment_distance_squared as to;
                if crate::primitive::segments_meet(a, b, s, e).is_some() {
                    return 0.0;
                }
                to(a, s, e)
                    .min(to(b, s, e))
                    .min(to(s, a, b))
                    .min(to(e, a, b))
            };
            let expected = edges
                .iter()
                .map(|e| squared(e.start, e.end()))
                .fold(9.0, f64::min);
            let found = cells.least_distance_squared(&[a, b], 9.0, |ring| {
                (0..4)
                    .map(|i| squared(ring[i], ring[(i + 1) % 4]))
                    .fold(f64::INFINITY, f64::min)
            });
            assert!(
                (found - expected).abs() < 1e-9,
                "{a} {b}: {found} {expected}"
            );
        }
    }
}

#[test]
fn gathering_the_bits_can_be_stopped() {
    let grid = grid_of(1024, 1024, Pose2::new(0.0, 0.0, 0.0), |x, _| x == 3);
    let asked = std::cell::Cell::new(0);
    let stop = || {
        asked.set(asked.get() + 1);
        asked.get() == 5
    };
    assert!(SolidCells::new(&grid, &stop).is_none());
    assert_eq!(asked.get(), 5);
}

#[test]
fn a_large_grid_takes_little_more_than_a_bit_a_cell() {
    let grid = grid_of(2048, 1024, Pose2::new(0.0, 0.0, 0.0), |x, y| {
        (x ^ y) & 31 == 0
    });
    let cells = SolidCells::new(&grid, GO).expect("not stopped");
    let bits = 8.0 * cells.bytes() as f64 / (2048.0 * 1024.0);
    assert!((1.0..1.04).contains(&bits), "{bits}");
}

proptest! {
    #[test]
    fn writing_cells_leaves_the_pyramid_of_a_grid_built_so(
        writes in prop::collection::vec((0..75_usize, 0..70_usize, any::<bool>()), 1..200),
        density in 0.0..1.0_f64,
    ) {
        let mut grid = noise(75, 70, Pose2::new(0.0, 0.0, 0.0), density, 11);
        let mut cells = SolidCells::new(&grid, GO).expect("not stopped");
        for (x, y, is_solid) in writes {
            grid.set(x, y, if is_solid { Cell::Unknown } else { Cell::Free });
            cells.set(x, y, is_solid);
        }
        let fresh = SolidCells::new(&grid, GO).expect("not stopped");
        for (a, b) in cells.levels.iter().zip(&fresh.levels) {
            prop_assert_eq!(&a.solid, &b.solid);
            prop_assert_eq!(&a.free, &b.free);
        }
    }
}
