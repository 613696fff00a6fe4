//! The world against closed forms, brute force, and the laws a distance obeys.

use super::*;
use crate::grid::Cell;
use crate::primitive::{point_segment_distance_squared, ring_contains};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, SQRT_2};

fn p(x: f64, y: f64) -> Point2 {
    Point2::new(x, y)
}

fn block(x0: f64, y0: f64, x1: f64, y1: f64) -> Obstacle {
    Obstacle::Block {
        min: p(x0, y0),
        max: p(x1, y1),
    }
}

/// A star-shaped, usually non-convex ring about `centre`.
fn star(centre: Point2, radii: &[f64]) -> Vec<Point2> {
    let step = 2.0 * PI / radii.len() as f64;
    radii
        .iter()
        .enumerate()
        .map(|(i, r)| {
            let (sin, cos) = (step * i as f64).sin_cos();
            centre + Vector2::new(cos, sin) * *r
        })
        .collect()
}

/// Signed distance to a ring by trying every side.
fn ring_distance(ring: &[Point2], q: Point2) -> f64 {
    let n = ring.len();
    let squared = (0..n)
        .map(|i| point_segment_distance_squared(q, ring[i], ring[(i + 1) % n]))
        .fold(f64::INFINITY, f64::min);
    if ring_contains(ring, q) {
        -squared.sqrt()
    } else {
        squared.sqrt()
    }
}

/// A number in [0, 1) from a counter, for scenes that need no generator.
fn hashed(k: u64) -> f64 {
    let mut z = k.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
}

#[test]
fn clearance_of_disc_wall_corner_and_edge_has_its_closed_form() {
    let world = World::new(
        Bounds::new(0.0, 0.0, 20.0, 20.0),
        vec![
            Obstacle::Disc {
                center: p(10.0, 10.0),
                radius: 2.0,
            },
            block(15.0, 3.0, 16.0, 17.0),
        ],
    )
    .expect("valid");
    let cases = [
        (p(10.0, 14.0), 2.0),
        (p(10.0, 10.5), -1.5),
        (p(10.0 + 1.8, 10.0 + 2.4), 1.0),
        (p(13.5, 5.0), 1.5),
        (p(12.0, -1.0 + 0.0), -1.0),
        (p(17.0, 18.0), SQRT_2),
        (p(0.5, 10.0), 0.5),
        (p(15.25, 10.0), -0.25),
        (p(-3.0, -4.0), -5.0),
    ];
    for (q, expected) in cases {
        let found = world.clearance(q);
        assert!(
            (found - expected).abs() < 1e-12,
            "{q}: {found} for {expected}"
        );
        assert!(world.clearance_lower_bound(q) <= found);
    }
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(world.clearance(p(bad, 1.0)), f64::NEG_INFINITY);
        assert!(world.overlaps(&Footprint::Point, &Pose2::new(bad, 0.0, 0.0)));
        let shapeless = Footprint::Disc { radius: bad };
        assert!(world.overlaps(&shapeless, &Pose2::new(5.0, 5.0, 0.0)));
    }
}

#[test]
fn the_nearest_obstacle_point_is_at_the_distance_of_the_clearance() {
    let ring = star(p(5.0, 5.0), &[3.0, 1.0, 2.5, 0.8, 3.2, 1.5]);
    let world = World::new(
        Bounds::new(0.0, 0.0, 10.0, 10.0),
        vec![Obstacle::Polygon { vertices: ring }],
    )
    .expect("valid");
    for k in 0..2_000 {
        let q = p(hashed(2 * k) * 12.0 - 1.0, hashed(2 * k + 1) * 12.0 - 1.0);
        let near = world.nearest_obstacle_point(q);
        assert!(((near - q).norm() - world.clearance(q).abs()).abs() < 1e-12);
        assert!(world.clearance(near).abs() < 1e-12);
    }
}

#[test]
fn clutter_of_polygons_agrees_with_trying_every_side() {
    let rings: Vec<Vec<Point2>> = (0..300)
        .map(|k| {
            let centre = p(hashed(31 * k) * 100.0, hashed(31 * k + 1) * 100.0);
            let radii: Vec<f64> = (0..3 + k % 7)
                .map(|i| 0.4 + 3.0 * hashed(31 * k + 2 + i))
                .collect();
            star(centre, &radii)
        })
        .collect();
    let world = World::new(
        Bounds::new(0.0, 0.0, 100.0, 100.0),
        rings
            .iter()
            .map(|r| Obstacle::Polygon {
                vertices: r.clone(),
            })
            .collect(),
    )
    .expect("valid");
    for k in 0..20_000 {
        let q = p(
            hashed(k ^ 0xABCD) * 102.0 - 1.0,
            hashed(k ^ 0x1234_5678) * 102.0 - 1.0,
        );
        let expected = rings
            .iter()
            .map(|r| ring_distance(r, q))
            .fold(world.edge.distance(q), f64::min);
        let found = world.clearance(q);
        assert!(
            (found - expected).abs() < 1e-12,
            "{q}: {found} for {expected}"
        );
        let (direct, _) = crate::clearance_field::exact_without_field(&world.scene, &world.edge, q);
        assert!((found - direct).abs() < 1e-12);
        let bound = world.clearance_lower_bound(q);
        assert!(bound <= found);
        assert!(bound > found - 2.0 * world.clearance_cell_size());
    }
}

/// A patchy grid with solid blobs, holes and single cells.
fn patchy(width: usize, height: usize, resolution: f64, origin: Pose2) -> OccupancyGrid {
    let cells = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let blob = hashed(((x / 3) * 1000 + y / 3) as u64) < 0.3;
            let speck = hashed((i as u64) << 20) < 0.05;
            match (blob, speck) {
                (true, false) => Cell::Occupied,
                (false, true) => Cell::Unknown,
                _ => Cell::Free,
            }
        })
        .collect();
    OccupancyGrid::new(width, height, resolution, origin, cells).expect("valid")
}

#[test]
fn a_grid_agrees_with_trying_every_cell_inside_and_out() {
    let grid = patchy(24, 17, 0.5, Pose2::new(-3.0, 2.0, 0.0));
    let world = World::from_grid(grid.clone()).expect("valid");
    let to_cells = |q: Point2, solid: bool| {
        let mut least = f64::INFINITY;
        for y in 0..grid.height {
            for x in 0..grid.width {
                if (grid.cell(x, y) != Some(Cell::Free)) == solid {
                    let c = grid.cell_centre(x, y);
                    let half = Vector2::repeat(0.25);
                    least = least.min(crate::primitive::block_distance(c - half, c + half, q));
                }
            }
        }
        least
    };
    for k in 0..4_000 {
        let q = p(-3.0 + 12.0 * hashed(k), 2.0 + 8.5 * hashed(k + 777_777));
        let outside = to_cells(q, true);
        let to_edge = world.edge.distance(q);
        let expected = if outside > 0.0 {
            outside.min(to_edge)
        } else {
            // Out of the solid leads to a free cell or off the grid.
            -to_cells(q, false).min(to_edge)
        };
        let found = world.clearance(q);
        assert!(
            (found - expected).abs() < 1e-12,
            "{q}: {found} for {expected}"
        );
    }
}

#[test]
fn a_turned_grid_has_the_clearances_and_ranges_of_the_straight_one() {
    let straight =
        World::from_grid(patchy(20, 14, 0.25, Pose2::new(0.0, 0.0, 0.0))).expect("valid");
    let frame = Pose2::new(4.0, -2.0, 1.0);
    let turned = World::from_grid(patchy(20, 14, 0.25, frame)).expect("valid");
    for k in 0..3_000 {
        let q = p(5.0 * hashed(k), 3.5 * hashed(k + 999_999));
        let moved = frame.transform(q);
        let (a, b) = (straight.clearance(q), turned.clearance(moved));
        assert!((a - b).abs() < 1e-12, "{q}: {a} and {b}");
        let angle = 7.0 * hashed(k + 5_555_555);
        let ranges = (
            straight.cast_ray(q, angle, 9.0),
            turned.cast_ray(moved, angle + 1.0, 9.0),
        );
        match ranges {
            (Some(a), Some(b)) => assert!((a - b).abs() < 1e-9, "{q} {angle}: {a} and {b}"),
            (None, None) => {}
            other => panic!("{q} at {angle}: {other:?}"),
        }
    }
}

#[test]
fn ranges_in_a_room_with_a_pillar_have_their_closed_form() {
    let world = World::new(
        Bounds::new(0.0, 0.0, 10.0, 6.0),
        vec![
            Obstacle::Disc {
                center: p(5.0, 3.0),
                radius: 0.5,
            },
            block(8.0, 4.0, 9.0, 5.0),
        ],
    )
    .expect("valid");
    let o = p(1.0, 3.0);
    let near = |found: Option<f64>, expected: f64| {
        let found = found.expect("a hit");
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    };
    near(world.cast_ray(o, 0.0, 30.0), 3.5);
    near(world.cast_ray(o, PI, 30.0), 1.0);
    near(world.cast_ray(o, FRAC_PI_2, 30.0), 3.0);
    near(world.cast_ray(o, FRAC_PI_4, 30.0), 3.0 * SQRT_2);
    // Straight at the corner (8, 4), and along the face y = 4 of the block.
    near(
        world.cast_ray(o, (1.0_f64).atan2(7.0), 30.0),
        50.0_f64.sqrt(),
    );
    near(world.cast_ray(p(1.0, 4.0), 0.0, 30.0), 7.0);
    // Into the room's own corner.
    near(
        world.cast_ray(o, (-3.0_f64).atan2(-1.0), 30.0),
        10.0_f64.sqrt(),
    );
    assert_eq!(world.cast_ray(o, 0.0, 3.4), None);
    assert_eq!(world.cast_ray(p(5.1, 3.0), 1.0, 30.0), Some(0.0));
    assert_eq!(world.cast_ray(p(-1.0, 3.0), 0.0, 30.0), Some(0.0));
    assert_eq!(world.cast_ray(o, f64::NAN, 30.0), None);
    assert_eq!(world.cast_ray(o, 0.0, f64::NAN), None);
}

#[test]
fn a_grid_ends_without_a_wall_for_rays_but_not_for_riders() {
    let grid =
        OccupancyGrid::filled(10, 10, 1.0, Pose2::new(0.0, 0.0, 0.0), Cell::Free).expect("valid");
    let world = World::from_grid(grid).expect("valid");
    assert_eq!(world.cast_ray(p(5.0, 5.0), 0.3, 100.0), None);
    assert_eq!(world.clearance(p(5.0, 9.0)), 1.0);
    assert!(world.overlaps(
        &"disc:0.5".parse().expect("valid"),
        &Pose2::new(0.4, 5.0, 0.0)
    ));
}

#[test]
fn a_bike_beside_a_wall_has_its_closed_form_clearance() {
    let world = World::new(
        Bounds::new(-50.0, -50.0, 50.0, 50.0),
        vec![block(-20.0, 2.0, 20.0, 3.0)],
    )
    .expect("valid");
    let bike = Footprint::bike();
    let clear =
        |x: f64, y: f64, heading: f64| world.footprint_clearance(&bike, &Pose2::new(x, y, heading));
    assert!((clear(0.0, 0.0, 0.0) - 1.7).abs() < 1e-12);
    assert!((clear(0.0, 0.0, FRAC_PI_2) - (2.0 - 1.16 - 0.3)).abs() < 1e-12);
    // Tip 0.1 m into the wall, seen from below.
    assert!((clear(0.0, 0.64, FRAC_PI_2) + 0.1).abs() < 1e-12);
    // Axis on the wall's middle line: half the wall and the radius to go.
    assert!((clear(0.0, 2.5, 0.0) + 0.8).abs() < 1e-12);
    let cart: Footprint = "box:2x1".parse().expect("valid");
    let turned = Pose2::new(0.0, 0.0, FRAC_PI_4);
    let expected = 2.0 - 1.5 / SQRT_2;
    assert!((world.footprint_clearance(&cart, &turned) - expected).abs() < 1e-12);
    let out = world.footprint_clearance(&cart, &Pose2::new(49.5, 0.0, 0.0));
    assert!((out + 0.5).abs() < 1e-12);
}

#[test]
fn a_footprint_wholly_inside_a_polygon_or_grid_overlaps() {
    let ring = star(p(0.0, 0.0), &[9.0, 8.0, 9.5, 8.0, 9.0]);
    let bounds = Bounds::new(-20.0, -20.0, 20.0, 20.0);
    let inside_polygon =
        World::new(bounds, vec![Obstacle::Polygon { vertices: ring }]).expect("valid");
    let grid = OccupancyGrid::filled(40, 40, 1.0, Pose2::new(-20.0, -20.0, 0.5), Cell::Occupied)
        .expect("valid");
    let inside_grid = World::from_grid(grid).expect("valid");
    for world in [inside_polygon, inside_grid] {
        for text in ["point", "disc:0.3", "bike", "box:1.8x0.6"] {
            let footprint: Footprint = text.parse().expect("valid");
            let pose = Pose2::new(0.2, 0.1, 0.7);
            assert!(world.overlaps(&footprint, &pose), "{text}");
            assert!(
                world.footprint_clearance(&footprint, &pose) < -1.0,
                "{text}"
            );
        }
    }
}

#[test]
fn scaling_scales_every_distance() {
    let world = World::build(
        Bounds::new(0.0, 0.0, 6.0, 4.0),
        vec![Obstacle::Disc {
            center: p(2.0, 2.0),
            radius: 0.5,
        }],
        Some(patchy(12, 8, 0.5, Pose2::new(0.0, 0.0, 0.0))),
    )
    .expect("valid");
    let double = world.scaled(2.0).expect("valid");
    for k in 0..500 {
        let q = p(6.0 * hashed(k), 4.0 * hashed(k + 99_999));
        assert!((2.0 * world.clearance(q) - double.clearance(q * 2.0)).abs() < 1e-12);
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        assert!(world.scaled(bad).is_err());
    }
}

#[test]
fn threads_asking_in_different_orders_get_the_same_bits() {
    let build = || World::from_grid(patchy(60, 60, 0.2, Pose2::new(0.0, 0.0, 0.3))).expect("valid");
    let points: Vec<Point2> = (0..4_000)
        .map(|k| p(10.0 * hashed(k) - 2.0, 12.0 * hashed(k + 31_337)))
        .collect();
    let alone = build();
    let expected: Vec<u64> = points
        .iter()
        .map(|q| alone.clearance(*q).to_bits())
        .collect();
    let shared = build();
    std::thread::scope(|scope| {
        for t in 0..4_usize {
            let (shared, points, expected) = (&shared, &points, &expected);
            scope.spawn(move || {
                for k in 0..points.len() {
                    let i = (k * (2 * t + 1) * 7 + t) % points.len();
                    assert_eq!(shared.clearance(points[i]).to_bits(), expected[i]);
                }
            });
        }
    });
}

/// Found in review: the cells of a field that underflows had no size, and their number no end.
#[test]
fn a_field_too_small_to_be_divided_is_refused() {
    for extent in [5e-324, 1e-200, 1e-13] {
        assert!(matches!(
            World::new(Bounds::new(0.0, 0.0, extent, extent), Vec::new()),
            Err(WorldError::Bounds { .. })
        ));
    }
    for (width, height) in [(1e-12, 1e-12), (1e-12, 1e9), (1e9, 1e-3)] {
        let world = World::new(Bounds::new(0.0, 0.0, width, height), Vec::new()).expect("valid");
        let (columns, rows) = world.clearance_cells();
        assert!(columns * rows <= 4 * 10_000);
        assert!(world.clearance(p(width / 2.0, height / 2.0)) > 0.0);
    }
}

/// A polygon with too many vertices to be cut up keeps every outline out; only how deep is not exact.
#[test]
fn a_polygon_of_thousands_of_vertices_is_solid() {
    let radii: Vec<f64> = (0..4000).map(|k| 3.0 + hashed(k)).collect();
    let world = World::new(
        Bounds::new(0.0, 0.0, 10.0, 10.0),
        vec![Obstacle::Polygon {
            vertices: star(p(5.0, 5.0), &radii),
        }],
    )
    .expect("valid");
    let bike = Footprint::bike();
    assert!(world.footprint_clearance(&bike, &Pose2::new(5.0, 5.0, 0.3)) < -0.3);
    // The front of the axis is in, the rear contact is not.
    assert!(world.footprint_clearance(&bike, &Pose2::new(9.5, 5.0, std::f64::consts::PI)) < -0.3);
    assert!(world.footprint_clearance(&bike, &Pose2::new(0.6, 0.5, 0.0)) > 0.0);
}

#[test]
fn an_empty_field_is_only_its_edge() {
    let world = World::new(Bounds::new(0.0, 0.0, 4.0, 2.0), Vec::new()).expect("valid");
    assert_eq!(world.clearance(p(2.0, 0.5)), 0.5);
    assert_eq!(world.cast_ray(p(1.0, 1.0), 0.0, 10.0), Some(3.0));
    assert_eq!(world.nearest_obstacle_point(p(2.0, 0.5)), p(2.0, 0.0));
    let bike = Footprint::bike();
    assert!(world.overlaps(&bike, &Pose2::new(0.1, 1.0, 0.0)));
    assert!(!world.overlaps(&bike, &Pose2::new(1.0, 1.0, 0.0)));
}

fn small_scene() -> impl Strategy<Value = (World, Vec<Obstacle>)> {
    let ring = (
        (0.0..10.0_f64, 0.0..10.0_f64),
        proptest::collection::vec(0.3..3.0_f64, 3..9),
    )
        .prop_map(|((x, y), radii)| Obstacle::Polygon {
            vertices: star(p(x, y), &radii),
        });
    let disc =
        (0.0..10.0_f64, 0.0..10.0_f64, 0.1..2.0_f64).prop_map(|(x, y, radius)| Obstacle::Disc {
            center: p(x, y),
            radius,
        });
    let cuboid = (0.0..9.0_f64, 0.0..9.0_f64, 0.1..3.0_f64, 0.1..3.0_f64)
        .prop_map(|(x, y, w, h)| block(x, y, x + w, y + h));
    let obstacle = prop_oneof![ring, disc, cuboid];
    proptest::collection::vec(obstacle, 0..6).prop_map(|obstacles| {
        let bounds = Bounds::new(0.0, 0.0, 10.0, 10.0);
        let world = World::new(bounds, obstacles.clone()).expect("star-shaped rings are simple");
        (world, obstacles)
    })
}

/// An L: 1.2 m long, 0.8 m high, arms 0.4 m wide, the reference point in the corner.
const L: &str = "polygon:-0.2,-0.2;1,-0.2;1,0.2;0.2,0.2;0.2,0.6;-0.2,0.6";

#[test]
fn a_post_fits_in_the_notch_of_an_l_and_not_in_its_arms() {
    let post = Obstacle::Disc {
        center: p(5.0, 5.0),
        radius: 0.1,
    };
    let world = World::new(Bounds::new(0.0, 0.0, 10.0, 10.0), vec![post]).expect("valid");
    let outline: Footprint = L.parse().expect("valid");
    let clear = |x: f64, y: f64| world.footprint_clearance(&outline, &Pose2::new(x, y, 0.0));
    // The post 0.3 m above the lower arm and 0.3 m right of the upright one.
    assert!((clear(4.5, 4.5) - 0.2).abs() < 1e-12);
    // In the middle of the lower arm: 0.2 m to its sides, and 0.1 m of post.
    assert!((clear(4.4, 5.0) + 0.3).abs() < 1e-12);
    assert!(world.overlaps(&outline, &Pose2::new(4.4, 5.0, 0.0)));
    assert!(!world.overlaps(&outline, &Pose2::new(4.5, 4.5, 0.0)));
}

proptest! {
    #[test]
    fn clearance_is_one_lipschitz(
        (world, _) in small_scene(),
        ax in -1.0..11.0_f64, ay in -1.0..11.0_f64, bx in -1.0..11.0_f64, by in -1.0..11.0_f64,
        near in 0.0..1.0_f64,
    ) {
        let a = p(ax, ay);
        let b = a + (p(bx, by) - a) * near.powi(4);
        let change = (world.clearance(a) - world.clearance(b)).abs();
        prop_assert!(change <= (b - a).norm() + 1e-12);
        prop_assert!(world.clearance_lower_bound(a) <= world.clearance(a));
    }

    #[test]
    fn a_footprint_is_as_clear_as_its_closest_point(
        (world, _) in small_scene(),
        x in 0.0..10.0_f64, y in 0.0..10.0_f64, heading in -3.2..3.2_f64,
    ) {
        let pose = Pose2::new(x, y, heading);
        for text in ["bike", "box:1.2x0.5@0.2", L, "polygon:-0.3,-0.2;0.9,0;-0.3,0.2;0,0~0.05"] {
            let footprint: Footprint = text.parse().expect("valid");
            let clear = world.footprint_clearance(&footprint, &pose);
            let mut sampled = f64::INFINITY;
            const N: usize = 400;
            for core in footprint.cores(&pose) {
                let ring = core.vertices();
                for i in 0..ring.len() {
                    let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
                    for k in 0..=N {
                        let q = a + (b - a) * (k as f64 / N as f64);
                        sampled = sampled.min(world.clearance(q) - core.radius);
                    }
                }
            }
            if clear > 0.0 {
                // Sampling sees the closest point to within half a step, 1.5 mm.
                prop_assert!(sampled >= clear - 1e-12);
                prop_assert!(sampled <= clear + 2e-3, "{sampled} {clear}");
            } else {
                prop_assert!(sampled <= 2e-3 || footprint.reach() > 0.3);
            }
            prop_assert!(sampled >= 0.0 || clear < 0.0);
            prop_assert_eq!(world.overlaps(&footprint, &pose), clear < 0.0);
            // The cover contains the shape: it never promises more than the shape has.
            let covered = footprint
                .discs()
                .iter()
                .map(|d| world.clearance(pose.transform(p(d.offset, d.lateral))) - d.radius)
                .fold(f64::INFINITY, f64::min);
            prop_assert!(covered <= clear.max(0.0) + 1e-12);
        }
    }

    #[test]
    fn a_box_written_as_a_polygon_has_the_clearance_of_the_box(
        (world, _) in small_scene(),
        x in 0.0..10.0_f64, y in 0.0..10.0_f64, heading in -3.2..3.2_f64,
    ) {
        let pose = Pose2::new(x, y, heading);
        let cart: Footprint = "box:1.2x0.5@0.2".parse().expect("valid");
        let outline: Footprint = "polygon:-0.4,-0.25;0.8,-0.25;0.8,0.25;-0.4,0.25".parse().expect("valid");
        let (a, b) = (world.footprint_clearance(&cart, &pose), world.footprint_clearance(&outline, &pose));
        prop_assert!((a - b).abs() < 1e-12, "{a} {b}");
        prop_assert_eq!(cart.inscribed_radius(), outline.inscribed_radius());
        // A segment grown is a capsule; so is a needle of next to no width, to within that width.
        let capsule: Footprint = "capsule:1.8x0.6@0.3".parse().expect("valid");
        let needle: Footprint = "polygon:-0.3,0;0.9,-1e-8;0.9,1e-8~0.3".parse().expect("valid");
        let (a, b) = (world.footprint_clearance(&capsule, &pose), world.footprint_clearance(&needle, &pose));
        prop_assert!((a - b).abs() < 1e-7, "{a} {b}");
    }

    /// Brute force: the least clearance of a lattice of points of the outline, inside and edge.
    #[test]
    fn a_polygon_that_is_not_convex_is_as_clear_as_the_least_clear_of_its_points(
        (world, _) in small_scene(),
        x in 0.0..10.0_f64, y in 0.0..10.0_f64, heading in -3.2..3.2_f64,
    ) {
        let pose = Pose2::new(x, y, heading);
        let outline: Footprint = L.parse().expect("valid");
        let mut least = f64::INFINITY;
        for i in 0..=120 {
            for j in 0..=80 {
                let q = p(-0.2 + 0.01 * f64::from(i), -0.2 + 0.01 * f64::from(j));
                if q.x <= 0.2 || q.y <= 0.2 {
                    least = least.min(world.clearance(pose.transform(q)));
                }
            }
        }
        let found = world.footprint_clearance(&outline, &pose);
        if found > 0.0 {
            // The nearest lattice point is within 0.5 cm of the nearest point, on the outline.
            prop_assert!(least >= found - 1e-12 && least <= found + 5e-3, "{least} {found}");
        } else {
            prop_assert!(least <= 7.1e-3, "{least} {found}");
        }
    }

    #[test]
    fn a_ray_ends_where_something_solid_begins(
        (world, _) in small_scene(),
        x in 0.0..10.0_f64, y in 0.0..10.0_f64, angle in -7.0..7.0_f64,
    ) {
        let origin = p(x, y);
        let range = world.cast_ray(origin, angle, 30.0).expect("the field has an edge");
        if world.clearance(origin) < 0.0 {
            prop_assert_eq!(range, 0.0);
        } else {
            let direction = Vector2::new(angle.cos(), angle.sin());
            prop_assert!(world.clearance(origin + direction * range).abs() < 1e-9);
            for k in 0..200 {
                let q = origin + direction * (range * f64::from(k) / 200.0);
                prop_assert!(world.clearance(q) > -1e-9);
            }
        }
    }
}

/// Two rooms with a wall of one cell between them, and a door of `door` cells at its middle.
fn two_rooms(cells: usize, door: usize, yaw: f64) -> OccupancyGrid {
    let middle = cells / 2;
    let is_door = |y: usize| y.abs_diff(middle) * 2 < door;
    let list = (0..cells * cells)
        .map(|i| match i % cells == middle && !is_door(i / cells) {
            true => Cell::Occupied,
            false => Cell::Free,
        })
        .collect();
    OccupancyGrid::new(cells, cells, 0.1, Pose2::new(1.0, 2.0, yaw), list).expect("valid")
}

#[test]
fn rooms_without_a_door_are_separate_however_thin_the_wall() {
    for yaw in [0.0, 0.6] {
        for (door, separate) in [(0, true), (1, false), (9, false)] {
            let grid = two_rooms(200, door, yaw);
            let at = |x: f64, y: f64| grid.from_cell_coordinates(Vector2::new(x, y));
            let (a, b, c) = (at(20.5, 30.5), at(180.5, 30.5), at(50.5, 150.5));
            let world = World::from_grid(grid.clone()).expect("valid");
            let go = || false;
            assert_eq!(world.are_in_separate_regions(a, b, &go), separate);
            assert!(!world.are_in_separate_regions(a, c, &go));
            assert!(!world.are_in_separate_regions(a, p(-99.0, 0.0), &go));
            let stopped = World::from_grid(grid).expect("valid");
            assert!(!stopped.are_in_separate_regions(a, b, &|| true));
        }
    }
}

#[test]
fn a_door_parts_two_rooms_for_what_is_wider_than_it() {
    for yaw in [0.0, 0.6] {
        // 0.9 m wide.
        let grid = two_rooms(200, 9, yaw);
        let at = |x: f64, y: f64| grid.from_cell_coordinates(Vector2::new(x, y));
        let (a, b, c) = (at(20.5, 30.5), at(180.5, 30.5), at(50.5, 150.5));
        let world = World::from_grid(grid.clone()).expect("valid");
        let apart = |a, b, clearance| world.are_apart(a, b, clearance, &|| false);
        let slack = std::f64::consts::SQRT_2 * world.clearance_cell_size();
        for clearance in [1e-6, 0.1, 0.44] {
            assert!(!apart(a, b, clearance));
        }
        assert!(apart(a, b, 0.46 + slack));
        assert!(!apart(a, c, 0.46 + slack));
        // Nobody has so much room anywhere, and no clearance at all can always be kept.
        assert!(apart(a, b, 50.0));
        for clearance in [0.0, -1.0, f64::NAN] {
            assert!(!apart(a, b, clearance));
        }
    }
}

/// Against a flood over the same cells, for every threshold.
#[test]
fn the_bound_on_the_room_between_two_places_is_that_of_a_flood() {
    let world = World::from_grid(patchy(40, 30, 0.5, Pose2::new(0.0, 0.0, 0.2))).expect("valid");
    let (columns, rows) = world.clearance_cells();
    let half = 0.5 * SQRT_2 * world.clearance_cell_size();
    let bound = |i: usize| world.clearance_cell_centre(i % columns, i / columns).1 + half;
    for need in [0.05, 0.2, 0.31, 0.6] {
        let mut piece = vec![usize::MAX; columns * rows];
        for first in 0..piece.len() {
            if piece[first] != usize::MAX || bound(first) < need {
                continue;
            }
            let mut open = vec![first];
            piece[first] = first;
            while let Some(i) = open.pop() {
                let (x, y) = (i % columns, i / columns);
                for ny in y.saturating_sub(1)..(y + 2).min(rows) {
                    for nx in x.saturating_sub(1)..(x + 2).min(columns) {
                        let n = ny * columns + nx;
                        if piece[n] == usize::MAX && bound(n) >= need {
                            piece[n] = first;
                            open.push(n);
                        }
                    }
                }
            }
        }
        let inside: Vec<usize> = (0..piece.len())
            .filter(|i| piece[*i] != usize::MAX && (bound(*i) - need).abs() > 1e-6)
            .collect();
        for k in 0..3_000_u64 {
            let pick = |k: u64| inside[(hashed(k) * inside.len() as f64) as usize];
            let (a, b) = (pick(2 * k), pick(2 * k + 1));
            let centre = |i: usize| world.clearance_cell_centre(i % columns, i / columns).0;
            let apart = world.are_apart(centre(a), centre(b), need, &|| false);
            assert_eq!(apart, piece[a] != piece[b]);
        }
    }
}

#[test]
fn a_prepared_world_answers_as_one_that_is_not_and_preparing_can_be_stopped_and_resumed() {
    let build = || World::from_grid(patchy(90, 60, 0.2, Pose2::new(0.0, 0.0, 0.3))).expect("valid");
    let (lazy, eager) = (build(), build());
    let mut rounds = 0_u32;
    loop {
        // Stopped at ever later questions.
        rounds += 1;
        let left = std::cell::Cell::new(rounds);
        let stop = || {
            left.set(left.get().saturating_sub(1));
            left.get() == 0
        };
        let before = eager.prepared_bytes();
        if eager.prepare(&stop) {
            break;
        }
        assert!(eager.prepared_bytes() >= before);
    }
    assert!(rounds > 3);
    assert!(eager.prepared_bytes() > lazy.prepared_bytes());
    for k in 0..3_000 {
        let q = p(18.0 * hashed(k) - 2.0, 16.0 * hashed(k + 31_337));
        assert_eq!(lazy.clearance(q).to_bits(), eager.clearance(q).to_bits());
        assert_eq!(
            lazy.clearance_lower_bound(q).to_bits(),
            eager.clearance_lower_bound(q).to_bits()
        );
    }
}

#[test]
fn building_can_be_stopped() {
    let grid = patchy(600, 600, 0.2, Pose2::new(0.0, 0.0, 0.0));
    for questions in [1, 2] {
        let left = std::cell::Cell::new(questions);
        let stop = || {
            left.set(left.get() - 1);
            left.get() == 0
        };
        let built = World::build_unless(grid.bounds(), Vec::new(), Some(grid.clone()), &stop);
        assert!(matches!(built, Ok(None)));
    }
}
