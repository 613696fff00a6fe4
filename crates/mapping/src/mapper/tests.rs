use super::*;
use bikebot_dynamics::LaserScanner;
use bikebot_dynamics::laser::Prisms;
use bikebot_world::{Bounds, Obstacle, World};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(5)
}

fn bounds(half: f64) -> Bounds {
    Bounds {
        min: Point2::new(-half, -half),
        max: Point2::new(half, half),
    }
}

fn room(half: f64, obstacles: Vec<Obstacle>) -> World {
    World::new(bounds(half), obstacles).unwrap()
}

fn block(x0: f64, y0: f64, x1: f64, y1: f64) -> Obstacle {
    Obstacle::Block {
        min: Point2::new(x0, y0),
        max: Point2::new(x1, y1),
    }
}

/// The cells that the coordinates in these tests are made for.
fn decimetres() -> MapperParams {
    MapperParams {
        cell: 0.1,
        ..MapperParams::default()
    }
}

fn mapper_of(params: &MapperParams, laser: &LaserParams, half: f64) -> Mapper {
    let belief = BeliefGrid::over(bounds(half), params.cell).unwrap();
    Mapper::new(params, laser, Some(&Footprint::bike()), belief).unwrap()
}

fn decimetre_mapper(half: f64) -> Mapper {
    mapper_of(&decimetres(), &LaserParams::default(), half)
}

/// Scans `world` from a bike that stands at `pose`.
fn look(mapper: &mut Mapper, laser: &LaserParams, world: &World, pose: Pose2, roll: f64) -> usize {
    let scan = LaserScanner::new(laser)
        .unwrap()
        .scan(world, &pose, roll, &mut rng());
    mapper.insert(&scan, |_| (pose, roll)).unwrap().len()
}

#[test]
fn a_wall_becomes_occupied_the_way_to_it_free_and_what_lies_behind_stays_unknown() {
    let world = room(10.0, vec![block(4.03, -3.0, 5.0, 3.0)]);
    let mut mapper = decimetre_mapper(10.0);
    let laser = LaserParams::default();
    let pose = Pose2::new(-2.0, 0.0, 0.0);
    for _ in 0..5 {
        look(&mut mapper, &laser, &world, pose, 0.0);
    }
    let belief = mapper.belief();
    for y in [-2.0, -1.0, 0.0, 1.0, 2.0] {
        assert_eq!(belief.at(Point2::new(4.05, y)), Some(Cell::Occupied), "{y}");
        assert_eq!(belief.at(Point2::new(4.45, y)), Some(Cell::Unknown), "{y}");
        assert_eq!(belief.at(Point2::new(3.85, y)), Some(Cell::Free), "{y}");
        assert_eq!(belief.at(Point2::new(6.0, 0.3 * y)), Some(Cell::Unknown));
    }
    assert_eq!(
        belief.at(Point2::new(-6.0, 0.0)),
        Some(Cell::Unknown),
        "out of view"
    );
}

#[test]
fn a_free_cell_doubts_after_one_hit_and_believes_after_two() {
    let mut mapper = decimetre_mapper(10.0);
    let laser = LaserParams::default();
    let pose = Pose2::new(-2.0, 0.0, 0.0);
    let (empty, blocked) = (
        room(10.0, vec![]),
        room(10.0, vec![block(1.0, -0.5, 1.5, 0.5)]),
    );
    let place = Point2::new(1.05, 0.0);
    for _ in 0..40 {
        look(&mut mapper, &laser, &empty, pose, 0.0);
    }
    assert_eq!(mapper.belief().at(place), Some(Cell::Free));
    look(&mut mapper, &laser, &blocked, pose, 0.0);
    assert_eq!(mapper.belief().at(place), Some(Cell::Unknown));
    look(&mut mapper, &laser, &blocked, pose, 0.0);
    assert_eq!(mapper.belief().at(place), Some(Cell::Occupied));
}

#[test]
fn what_has_moved_away_is_free_again_after_a_few_scans() {
    let mut mapper = decimetre_mapper(10.0);
    let laser = LaserParams::default();
    let pose = Pose2::new(-2.0, 0.0, 0.0);
    let (empty, blocked) = (
        room(10.0, vec![]),
        room(10.0, vec![block(1.0, -0.5, 1.5, 0.5)]),
    );
    for _ in 0..100 {
        look(&mut mapper, &laser, &blocked, pose, 0.0);
    }
    let place = Point2::new(1.05, 0.0);
    assert_eq!(mapper.belief().at(place), Some(Cell::Occupied));
    let scans = (1..=20)
        .find(|_| {
            look(&mut mapper, &laser, &empty, pose, 0.0);
            mapper.belief().at(place) == Some(Cell::Free)
        })
        .expect("it is free in the end");
    // From 2.5 to −1 by 0.5 a scan, and the blur of 0.3° at 2 m takes a hair of it.
    assert!((7..=9).contains(&scans), "{scans}");
}

#[test]
fn changes_are_the_difference_between_before_and_after() {
    let world = room(6.0, vec![block(1.0, -0.7, 1.6, 0.4)]);
    let mut mapper = decimetre_mapper(6.0);
    let laser = LaserParams {
        range_sigma: 0.05,
        dropout_probability: 0.1,
        ..LaserParams::default()
    };
    let scanner = LaserScanner::new(&laser).unwrap();
    let mut rng = rng();
    for step in 0..30 {
        let pose = Pose2::new(-4.0 + 0.1 * f64::from(step), -2.0, 0.02 * f64::from(step));
        let mut before = mapper.belief().grid().clone();
        let scan = scanner.scan(&world, &pose, 0.05, &mut rng);
        let changes = mapper.insert(&scan, |_| (pose, 0.05)).unwrap().to_vec();
        for (x, y, cell) in changes {
            assert_ne!(before.cell(x, y), Some(cell));
            before.set(x, y, cell);
        }
        assert_eq!(&before, mapper.belief().grid());
    }
}

#[test]
fn the_order_of_the_beams_does_not_matter() {
    let world = room(
        8.0,
        vec![block(1.0, -0.7, 1.6, 0.4), block(-1.0, 3.0, 2.0, 3.5)],
    );
    let laser = LaserParams::default();
    let pose = Pose2::new(-3.0, -1.0, 0.3);
    let scan = LaserScanner::new(&laser)
        .unwrap()
        .scan(&world, &pose, 0.1, &mut rng());
    let mut turned = scan.clone();
    turned.ranges.reverse();
    turned.angle_min = scan.angle_min + scan.angle_step * 1080.0;
    turned.angle_step = -scan.angle_step;
    let (mut one, mut other) = (decimetre_mapper(8.0), decimetre_mapper(8.0));
    for _ in 0..3 {
        one.insert(&scan, |_| (pose, 0.1)).unwrap();
        other.insert(&turned, |_| (pose, 0.1)).unwrap();
    }
    let different = one
        .belief()
        .grid()
        .cells
        .iter()
        .zip(&other.belief().grid().cells)
        .filter(|(a, b)| a != b)
        .count();
    // The beams' angles differ in the last digit, so a beam through a corner may pass on its other side.
    assert!(different <= 5, "{different}");
}

#[test]
fn the_ground_is_no_obstacle_and_hides_nothing() {
    // Leaning 20° to the right: to the right the beams meet the ground at 0.7 cos / sin = 1.92 m.
    let roll = 20_f64.to_radians();
    let laser = LaserParams {
        mount_x: 0.0,
        ..LaserParams::default()
    };
    let mut mapper = mapper_of(&decimetres(), &laser, 10.0);
    let pose = Pose2::new(0.0, 0.0, 0.0);
    let scanner = LaserScanner::new(&laser).unwrap();
    let scan = scanner.scan(&room(10.0, vec![]), &pose, roll, &mut rng());
    for _ in 0..5 {
        mapper.insert(&scan, |_| (pose, roll)).unwrap();
    }
    let belief = mapper.belief();
    for (x, y, cell) in cells(belief) {
        let centre = belief.grid().cell_centre(x, y);
        let is_wall = centre.x.abs().max(centre.y.abs()) > 9.8;
        assert!(cell != Cell::Occupied || is_wall, "{centre} is no obstacle");
    }
    // On the right the ground is reached 1.9 m from the mount, which hangs 0.24 m to the right: free only to 1.7 m of
    // it, with a degree in hand, and nothing is known beyond. On the left the beams pass over 2 m at 3.9 m.
    let at = |x, y| belief.at(Point2::new(x, y));
    assert_eq!(at(0.05, -1.6), Some(Cell::Free));
    assert_eq!(at(0.05, -2.3), Some(Cell::Unknown));
    assert_eq!(at(0.05, 2.9), Some(Cell::Free));
    assert_eq!(at(0.05, 4.2), Some(Cell::Unknown));
    assert_eq!(
        at(9.0, 0.05),
        Some(Cell::Free),
        "straight ahead nothing tilts"
    );
}

fn cells(belief: &BeliefGrid) -> impl Iterator<Item = (usize, usize, Cell)> {
    let grid = belief.grid();
    (0..grid.height)
        .flat_map(move |y| (0..grid.width).map(move |x| (x, y, grid.cells[y * grid.width + x])))
}

#[test]
fn returns_from_the_bike_itself_neither_hit_nor_clear() {
    let laser = LaserParams {
        beams: 3,
        fov_deg: 2.0,
        ..LaserParams::default()
    };
    let mut mapper = mapper_of(&decimetres(), &laser, 5.0);
    let pose = Pose2::new(0.0, 0.0, 0.0);
    // The outline ends 1.46 m ahead of the rear contact, 0.26 m ahead of the laser.
    let scan = LaserScan {
        angle_min: 0.0,
        angle_step: 0.01,
        ranges: vec![0.2, 0.25, 0.2],
        ..LaserScan::default()
    };
    for _ in 0..5 {
        assert_eq!(mapper.insert(&scan, |_| (pose, 0.0)).unwrap(), []);
    }
    assert_eq!(mapper.hits(), []);
    let beyond = LaserScan {
        ranges: vec![0.28, 0.28, 0.28],
        ..scan
    };
    mapper.insert(&beyond, |_| (pose, 0.0)).unwrap();
    assert_eq!(mapper.hits().len(), 3);
}

#[test]
fn lost_returns_do_not_clear_a_wall_nor_what_is_behind_it() {
    let world = room(15.0, vec![block(3.0, -6.0, 5.0, 6.0)]);
    let laser = LaserParams {
        dropout_probability: 0.2,
        ..LaserParams::default()
    };
    let mut mapper = mapper_of(&decimetres(), &laser, 15.0);
    let scanner = LaserScanner::new(&laser).unwrap();
    let mut rng = rng();
    let pose = Pose2::new(-2.0, 0.0, 0.0);
    for _ in 0..200 {
        let scan = scanner.scan(&world, &pose, 0.0, &mut rng);
        mapper.insert(&scan, |_| (pose, 0.0)).unwrap();
    }
    for (x, y, cell) in cells(mapper.belief()) {
        let p = mapper.belief().grid().cell_centre(x, y);
        let is_inside = (3.05..5.0).contains(&p.x) && p.y.abs() < 5.9;
        assert!(!is_inside || cell != Cell::Free, "{p}");
    }
    assert_eq!(
        mapper.belief().at(Point2::new(3.05, 0.0)),
        Some(Cell::Occupied)
    );
}

#[test]
fn nothing_is_cleared_where_something_too_near_to_return_may_stand() {
    // Blind up to 1 m, while the outline reaches 0.26 m ahead: no return may mean a wall at 0.5 m.
    let laser = LaserParams {
        range_min: 1.0,
        ..LaserParams::default()
    };
    let mut mapper = mapper_of(&decimetres(), &laser, 10.0);
    let scan = LaserScan {
        angle_min: -0.5,
        angle_step: 0.01,
        ranges: vec![f64::INFINITY; 101],
        ..LaserScan::default()
    };
    let pose = Pose2::new(0.0, 0.0, 0.0);
    for _ in 0..5 {
        assert_eq!(mapper.insert(&scan, |_| (pose, 0.0)).unwrap(), []);
    }
    let mut sharp = decimetre_mapper(10.0);
    for _ in 0..5 {
        sharp.insert(&scan, |_| (pose, 0.0)).unwrap();
    }
    assert_eq!(sharp.belief().at(Point2::new(9.0, 0.0)), Some(Cell::Free));
}

#[test]
fn the_bike_stands_on_free_ground() {
    let mut mapper = decimetre_mapper(5.0);
    let pose = Pose2::new(1.0, -1.0, 2.0);
    let changed = mapper.declare_free(&Footprint::bike(), &pose).len();
    // 1.2 m by 0.6 m and a disc: 1.0 m² or 100 cells, and those its edge of 4.3 m crosses in part.
    assert!((100..190).contains(&changed), "{changed}");
    assert_eq!(mapper.declare_free(&Footprint::bike(), &pose), []);
    let world = World::from_grid(mapper.belief().grid().clone()).unwrap();
    assert!(!world.overlaps(&Footprint::bike(), &pose));
}

#[test]
fn a_bent_scan_is_straightened_by_the_poses_of_its_beams() {
    // A bike that turns at 2 rad/s while a quarter of a turn is scanned in 12.5 ms: 1.4° from first to last beam.
    let world = room(12.0, vec![block(9.03, -12.0, 12.0, 12.0)]);
    let laser = LaserParams {
        fov_deg: 90.0,
        ..LaserParams::default()
    };
    let scanner = LaserScanner::new(&laser).unwrap();
    let motion = |t: f64| (Pose2::new(0.0, 0.0, 2.0 * t), 0.0);
    let scene = Prisms {
        world: &world,
        height: 2.0,
    };
    let scan = scanner.sweep(&scene, 0.0, motion, &mut rng());
    let straight = |mapper: &Mapper| {
        let xs = mapper.hits().iter().map(|hit| hit.point.x);
        xs.fold(0.0, |worst: f64, x| worst.max((x - 9.03).abs()))
    };
    let mut mapper = mapper_of(&decimetres(), &laser, 12.0);
    mapper.insert(&scan, motion).unwrap();
    // The same ray cast, up to rounding.
    assert!(straight(&mapper) < 1e-9, "{}", straight(&mapper));
    mapper.insert(&scan, |_| motion(0.0)).unwrap();
    assert!(straight(&mapper) > 0.2, "{}", straight(&mapper));
}

#[test]
fn nonsense_is_refused_or_passed_over_and_changes_nothing() {
    let mut mapper = decimetre_mapper(5.0);
    let pose = Pose2::new(0.0, 0.0, 0.0);
    let scan = LaserScan {
        angle_min: 0.0,
        angle_step: 0.01,
        ranges: vec![f64::NAN, -1.0, 0.0, f64::NEG_INFINITY],
        ..LaserScan::default()
    };
    assert_eq!(mapper.insert(&scan, |_| (pose, 0.0)).unwrap(), []);
    assert_eq!(
        mapper
            .insert(&LaserScan::default(), |_| (pose, 0.0))
            .unwrap(),
        []
    );
    let good = LaserScan {
        ranges: vec![2.0; 4],
        ..scan
    };
    let mut calls = 0;
    let refused = mapper.insert(&good, |_| {
        calls += 1;
        (
            Pose2::new(0.0, 0.0, 0.0),
            if calls == 3 {
                f64::NAN
            } else {
                0.001 * f64::from(calls)
            },
        )
    });
    assert!(
        matches!(refused, Err(MappingError::Pose { beam: 2, .. })),
        "{refused:?}"
    );
    let bent = LaserScan {
        angle_step: f64::NAN,
        ..good
    };
    let refused = mapper.insert(&bent, |_| (pose, 0.0));
    assert!(matches!(refused, Err(MappingError::Scan { .. })));
    assert_eq!(mapper.belief().grid().count(Cell::Unknown), 100 * 100);
    // Far off the grid, and farther than any grid.
    for far in [1e3, 1e18] {
        let pose = Pose2::new(far, -far, 0.0);
        assert_eq!(mapper.insert(&good_scan(), |_| (pose, 0.0)).unwrap(), []);
    }
}

fn good_scan() -> LaserScan {
    LaserScan {
        angle_min: -1.0,
        angle_step: 0.02,
        ranges: vec![3.0; 101],
        ..LaserScan::default()
    }
}

/// Obstacles that do not hold the places the bike looks from.
fn scene() -> impl Strategy<Value = (Vec<Obstacle>, Vec<Pose2>)> {
    let disc =
        (-7.0..7.0_f64, -7.0..7.0_f64, 0.2..1.0_f64).prop_map(|(x, y, radius)| Obstacle::Disc {
            center: Point2::new(x, y),
            radius,
        });
    let wall = (-7.0..6.0_f64, -7.0..6.0_f64, 0.2..2.5_f64, 0.2..2.5_f64)
        .prop_map(|(x, y, w, h)| block(x, y, x + w, y + h));
    let pose =
        (-7.0..7.0_f64, -7.0..7.0_f64, -3.2..3.2_f64).prop_map(|(x, y, h)| Pose2::new(x, y, h));
    (
        prop::collection::vec(prop_oneof![disc, wall], 1..8),
        prop::collection::vec(pose, 1..5),
    )
}

/// Scans without noise from every place that is free, `times` each.
fn explored(
    obstacles: &[Obstacle],
    poses: &[Pose2],
    params: &MapperParams,
    times: usize,
) -> (World, Mapper) {
    let world = room(8.0, obstacles.to_vec());
    let laser = LaserParams::default();
    let mut mapper = mapper_of(params, &laser, 8.0);
    let scanner = LaserScanner::new(&laser).unwrap();
    for pose in poses {
        let mount = scanner.mount(pose, 0.0);
        if world.clearance(mount.position) < 0.2 {
            continue;
        }
        let scan = scanner.scan(&world, pose, 0.0, &mut rng());
        for _ in 0..times {
            mapper.insert(&scan, |_| (*pose, 0.0)).unwrap();
        }
    }
    (world, mapper)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A beam comes no nearer than the margin of 0.1 m to what it or a beam beside it has hit, and a free cell is crossed by one:
    /// what stands there reaches at most a cell's diagonal less the margin into it, 0.04 m, and the half beam's width that
    /// may be missed between two beams at 16 m, 0.04 m. From the centre that is the depth of 0.07 − 0.1 + 0.04 m.
    #[test]
    fn what_is_called_free_is_free((obstacles, poses) in scene()) {
        let (_, mapper) = explored(&obstacles, &poses, &decimetres(), 4);
        let alone = without_edge(&obstacles);
        for (x, y, cell) in cells(mapper.belief()) {
            if cell == Cell::Free {
                let centre = mapper.belief().grid().cell_centre(x, y);
                let clearance = alone.clearance(centre);
                prop_assert!(clearance > -0.01, "{centre} is free at {clearance}");
            }
        }
    }

    /// The same on cells of half a metre, as a map may have: all lengths but that between two beams grow with the cell.
    #[test]
    fn what_is_called_free_is_free_on_coarse_cells_too((obstacles, poses) in scene()) {
        let params = MapperParams { cell: 0.5, ..decimetres() };
        let (_, mapper) = explored(&obstacles, &poses, &params, 4);
        let alone = without_edge(&obstacles);
        for (x, y, cell) in cells(mapper.belief()) {
            if cell == Cell::Free {
                let centre = mapper.belief().grid().cell_centre(x, y);
                let clearance = alone.clearance(centre);
                // 0.354 − 0.5 + 0.04 m is above zero: the centre itself is free.
                prop_assert!(clearance > 0.0, "{centre} is free at {clearance}");
            }
        }
    }

    /// Whatever the margin, the inside of cells that are occupied altogether is never free.
    #[test]
    fn the_inside_of_an_obstacle_is_never_free((obstacles, poses) in scene()) {
        let params = MapperParams { surface_margin: 0.0, position_sigma: 0.0, heading_sigma_deg: 0.0, ..decimetres() };
        let (_, mapper) = explored(&obstacles, &poses, &params, 4);
        let alone = without_edge(&obstacles);
        for (x, y, cell) in cells(mapper.belief()) {
            let centre = mapper.belief().grid().cell_centre(x, y);
            // The whole square lies inside.
            if alone.clearance(centre) < -0.0708 {
                prop_assert!(cell != Cell::Free, "{centre}");
            }
        }
    }

    /// What was seen of obstacles stands on obstacles.
    #[test]
    fn what_is_called_occupied_holds_a_surface((obstacles, poses) in scene()) {
        let (world, mapper) = explored(&obstacles, &poses, &decimetres(), 2);
        for (x, y, cell) in cells(mapper.belief()) {
            if cell == Cell::Occupied {
                let centre = mapper.belief().grid().cell_centre(x, y);
                // Half a diagonal.
                prop_assert!(world.clearance(centre).abs() < 0.0708, "{centre}");
            }
        }
    }

    #[test]
    fn one_belief_grown_scan_by_scan_is_that_of_all_scans_afresh((obstacles, poses) in scene()) {
        let (_, once) = explored(&obstacles, &poses, &decimetres(), 3);
        let (_, again) = explored(&obstacles, &poses, &decimetres(), 3);
        prop_assert_eq!(once.belief(), again.belief());
    }
}

/// The obstacles in a field whose edge is far away.
fn without_edge(obstacles: &[Obstacle]) -> World {
    World::new(bounds(100.0), obstacles.to_vec()).unwrap()
}
