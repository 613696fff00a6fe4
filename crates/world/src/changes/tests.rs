//! A changed world against the same one built afresh.

use super::*;
use crate::footprint::Footprint;
use bikebot_geometry::Pose2;
use proptest::prelude::*;

fn p(x: f64, y: f64) -> Point2 {
    Point2::new(x, y)
}

/// A number in [0, 1) from a counter.
fn hashed(k: u64) -> f64 {
    let mut z = k.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
}

fn shape(k: u64) -> Obstacle {
    let centre = p(60.0 * hashed(k), 40.0 * hashed(k + 1_000));
    let size = 0.3 + 2.0 * hashed(k + 2_000);
    match k % 3 {
        0 => Obstacle::Disc {
            center: centre,
            radius: size,
        },
        1 => Obstacle::Block {
            min: centre,
            max: centre + Vector2::new(size, 0.5 * size),
        },
        _ => Obstacle::Polygon {
            vertices: (0..6)
                .map(|i| {
                    let (sin, cos) = f64::from(i).sin_cos();
                    centre + Vector2::new(cos, sin) * size * (0.5 + hashed(k + 31 * i as u64))
                })
                .collect(),
        },
    }
}

fn grid(yaw: f64) -> OccupancyGrid {
    let cells = (0..120 * 80)
        .map(|i| match hashed(i + 50_000) < 0.01 {
            true => Cell::Occupied,
            false => Cell::Free,
        })
        .collect();
    OccupancyGrid::new(120, 80, 0.5, Pose2::new(0.0, 0.0, yaw), cells).expect("valid")
}

fn world(shapes: u64, with_grid: Option<f64>) -> World {
    let bounds = Bounds::new(0.0, 0.0, 60.0, 40.0);
    World::build(
        bounds,
        (0..shapes).map(shape).collect(),
        with_grid.map(grid),
    )
    .expect("valid")
}

/// All that can be asked, as bits.
fn answers(world: &World, k: u64) -> Vec<u64> {
    let q = p(66.0 * hashed(k) - 3.0, 46.0 * hashed(k + 88_888) - 3.0);
    let pose = Pose2::new(q.x, q.y, 6.0 * hashed(k + 5));
    let mut bits = vec![
        world.clearance(q),
        world.clearance_lower_bound(q),
        world.footprint_clearance(&Footprint::bike(), &pose),
        world.cast_ray(q, pose.heading, 30.0).unwrap_or(-1.0),
    ];
    if let Some((column, row)) = world.clearance_cell(q) {
        bits.push(world.clearance_cell_centre(column, row).1);
    }
    bits.into_iter().map(f64::to_bits).collect()
}

fn afresh(world: &World, changes: &WorldChanges) -> World {
    let mut grid = world.grid().cloned();
    for (x, y, cell) in &changes.cells {
        if let Some(grid) = &mut grid {
            grid.set(*x, *y, *cell);
        }
    }
    let stay = world
        .obstacles()
        .iter()
        .enumerate()
        .filter(|(i, _)| !changes.removed.contains(i))
        .map(|(_, o)| o.clone());
    let obstacles = stay.chain(changes.added.iter().cloned()).collect();
    World::build(world.bounds(), obstacles, grid).expect("valid")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_changed_world_answers_as_one_built_afresh_to_the_last_bit(
        shapes in 0..60_u64,
        kind in 0..3,
        rounds in prop::collection::vec(
            (
                prop::collection::vec((0..20_usize, 0..20_usize, any::<bool>()), 0..30),
                (0..100_usize, 0..60_usize),
                prop::collection::vec(0..1000_usize, 0..4),
                prop::collection::vec(100..10_000_u64, 0..4),
            ),
            1..4,
        ),
    ) {
        let mut current = world(shapes, [None, Some(0.0), Some(0.3)][kind as usize]);
        // Some of it is filled before the first change, and more between changes.
        for k in 0..300 {
            answers(&current, k);
        }
        for (cells, (x0, y0), removed, added) in rounds {
            let count = current.obstacles().len();
            let changes = WorldChanges {
                cells: match current.grid() {
                    None => Vec::new(),
                    Some(_) => cells
                        .iter()
                        .map(|(x, y, solid)| {
                            (x0 + x, y0 + y, if *solid { Cell::Occupied } else { Cell::Free })
                        })
                        .collect(),
                },
                removed: removed.iter().filter(|_| count > 0).map(|i| i % count.max(1)).collect(),
                added: added.iter().map(|k| shape(*k)).collect(),
            };
            let next = current.with_changes(&changes).expect("valid changes");
            let fresh = afresh(&current, &changes);
            prop_assert_eq!(next.obstacles(), fresh.obstacles());
            prop_assert_eq!(next.grid(), fresh.grid());
            for k in 0..400 {
                prop_assert_eq!(answers(&next, k), answers(&fresh, k));
            }
            current = next;
        }
    }
}

#[test]
fn what_a_change_cannot_reach_is_kept() {
    let world = world(0, Some(0.0));
    assert!(world.prepare(&|| false));
    let all = world.prepared_cells();
    let changes = WorldChanges {
        cells: vec![(10, 10, Cell::Occupied), (11, 10, Cell::Occupied)],
        ..WorldChanges::default()
    };
    let next = world.with_changes(&changes).expect("valid");
    let kept = next.prepared_cells();
    assert!(kept > all / 2 && kept < all, "{kept} of {all}");
    // Saying again what is there already changes nothing.
    let same = next.with_changes(&changes).expect("valid");
    assert_eq!(same.prepared_cells(), kept);
}

#[test]
fn changes_of_what_is_not_there_are_refused() {
    let world = world(3, Some(0.0));
    let cells = |column, row| WorldChanges {
        cells: vec![(column, row, Cell::Free)],
        ..WorldChanges::default()
    };
    assert!(world.with_changes(&cells(119, 79)).is_ok());
    for (column, row) in [(120, 0), (0, 80), (usize::MAX, 0)] {
        assert!(matches!(
            world.with_changes(&cells(column, row)),
            Err(WorldError::NoSuchCell { width: 120, .. })
        ));
    }
    let removed = |obstacle| WorldChanges {
        removed: vec![0, obstacle],
        ..WorldChanges::default()
    };
    assert!(world.with_changes(&removed(2)).is_ok());
    assert_eq!(
        world.with_changes(&removed(3)).err(),
        Some(WorldError::NoSuchObstacle {
            obstacle: 3,
            count: 3
        })
    );
    let nonsense = WorldChanges {
        added: vec![Obstacle::Disc {
            center: p(1.0, 1.0),
            radius: -1.0,
        }],
        ..WorldChanges::default()
    };
    assert!(matches!(
        world.with_changes(&nonsense),
        Err(WorldError::Radius { obstacle: 3, .. })
    ));
}

#[test]
fn a_world_changed_over_and_over_does_not_grow_without_end() {
    let mut current = world(40, None);
    let mut most = 0;
    for k in 0..2_000 {
        let changes = WorldChanges {
            removed: vec![0],
            added: vec![shape(k)],
            ..WorldChanges::default()
        };
        current = current.with_changes(&changes).expect("valid");
        most = most.max(current.prepared_bytes());
    }
    assert_eq!(current.obstacles().len(), 40);
    assert!(most < 1_000_000, "{most}");
}
