use super::*;
use crate::budget::{Budget, StopReason};
use crate::pipeline::plan;
use crate::test_scenes::{Scene, block, load, room};
use crate::{
    EndPose, GoalMode, GoalRegion, Method, Outcome, PlannerParams, PlanningProblem, visibility,
};
use bikebot_geometry::{Polyline, Pose2};
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI, TAU};
use std::sync::atomic::{AtomicU64, Ordering};

fn search(
    world: &World,
    radius: f64,
    start: Point2,
    goal: Point2,
    tolerance: f64,
    upper: Option<f64>,
) -> Shortest {
    let mut meter = Meter::new(&Budget::unlimited());
    shortest(world, radius, start, goal, tolerance, upper, &mut meter)
}

fn between(world: &World, radius: f64, start: Point2, goal: Point2) -> Shortest {
    search(world, radius, start, goal, 0.0, None)
}

fn p(x: f64, y: f64) -> Point2 {
    Point2::new(x, y)
}

fn disc(x: f64, y: f64, radius: f64) -> Obstacle {
    Obstacle::Disc {
        center: p(x, y),
        radius,
    }
}

/// Asserts a closed form to rounding.
fn assert_exact(found: &Shortest, exact: f64) {
    assert!(found.is_exact, "{found:?}");
    assert!((found.length - exact).abs() < 1e-9, "{found:?} {exact}");
}

fn of_scene(scene: &Scene, upper: Option<f64>) -> Shortest {
    let (start, goal) = (scene.start.position, scene.goal.position);
    search(&scene.world, 0.0, start, goal, 0.0, upper)
}

#[test]
fn for_a_point_it_is_the_visibility_graphs_path() {
    for (name, _) in visibility::KNOWN {
        let scene = load(name);
        let oracle = visibility::shortest_length_of(&scene);
        let found = of_scene(&scene, None);
        assert!(found.is_exact);
        // The oracle's corners are moved outward by a µm, which costs less than a tenth of a millimetre.
        assert!(
            found.length <= oracle && found.length > oracle - 1e-4,
            "{name}: {} {oracle}",
            found.length
        );
    }
}

#[test]
fn in_clutter_it_has_the_length_known_from_elsewhere() {
    for (name, exact) in [("clutter200", 1373.862), ("clutter2000", 1388.943)] {
        let scene = load(name);
        for upper in [None, Some(1.01 * exact)] {
            let found = of_scene(&scene, upper);
            // Known to the millimetre.
            assert!(
                found.is_exact && (found.length - exact).abs() < 1e-3,
                "{name} {found:?}"
            );
        }
    }
}

#[test]
fn around_a_disc_it_is_two_tangents_and_an_arc() {
    let world = room(20.0, vec![disc(10.0, 8.0, 2.0)]);
    let (start, goal) = (p(4.0, 8.0), p(16.0, 8.0));
    for radius in [0.0, 0.5, 1.7] {
        let r = 2.0 + radius;
        let tangent = (36.0_f64 - r * r).sqrt();
        let arc = r * (PI - 2.0 * (r / 6.0).acos());
        assert_exact(&between(&world, radius, start, goal), 2.0 * tangent + arc);
    }
}

#[test]
fn around_a_corner_it_is_two_tangents_and_an_arc() {
    let world = room(20.0, vec![block(10.0, 0.0, 20.0, 7.0)]);
    let (start, goal) = (p(8.0, 2.0), p(16.0, 9.0));
    for radius in [0.0, 0.4, 1.5] {
        let corner = p(10.0, 7.0);
        let leg = |q: Point2| {
            let apart = (q - corner).norm();
            (
                (apart * apart - radius * radius).sqrt(),
                (radius / apart).acos(),
            )
        };
        let ((a, alpha), (b, beta)) = (leg(start), leg(goal));
        let (u, v) = (start - corner, goal - corner);
        // The angle at the corner on the free side, less what the two tangents take of it.
        let turn = TAU - u.angle(&v) - alpha - beta;
        let exact = a + b + radius * turn;
        let found = between(&world, radius, start, goal);
        assert!(
            found.is_exact && (found.length - exact).abs() < 1e-9,
            "{radius} {found:?} {exact}"
        );
    }
}

#[test]
fn over_a_block_it_is_two_quarter_arcs_and_the_way_between() {
    // Start and goal stand against the two sides, so that the legs are upright.
    let world = room(20.0, vec![block(8.0, 0.0, 12.0, 7.0)]);
    for radius in [0.25, 1.0, 2.0] {
        let (start, goal) = (p(8.0 - radius, 3.0), p(12.0 + radius, 4.0));
        let exact = 4.0 + 3.0 + 4.0 + PI * radius;
        assert_exact(&between(&world, radius, start, goal), exact);
    }
}

#[test]
fn a_gap_is_passed_by_what_fits_and_by_nothing_else() {
    let world = room(
        10.0,
        vec![block(5.0, 0.0, 5.5, 4.5), block(5.0, 5.5, 5.5, 10.0)],
    );
    let (start, goal) = (p(2.0, 5.0), p(8.0, 5.0));
    for radius in [0.0, 0.3, 0.4999] {
        assert_exact(&between(&world, radius, start, goal), 6.0);
    }
    for radius in [0.5001, 0.7] {
        let found = between(&world, radius, start, goal);
        assert!(found.length.is_infinite() && !found.is_exact && found.path.is_none());
    }
}

#[test]
fn nothing_slips_through_the_seam_of_two_walls() {
    let world = room(
        10.0,
        vec![
            block(4.0, 0.0, 5.0, 5.0),
            block(4.0, 5.0, 5.0, 9.0),
            // Touches the corner of the one before.
            block(5.0, 9.0, 6.0, 10.0),
        ],
    );
    for radius in [0.0, 0.1] {
        assert!(
            between(&world, radius, p(2.0, 5.0), p(8.0, 5.0))
                .length
                .is_infinite()
        );
    }
}

#[test]
fn the_edge_of_the_field_is_a_wall() {
    // Only between the block and the edge of the field is there a way.
    let world = room(10.0, vec![block(4.0, 1.0, 6.0, 10.0)]);
    let (start, goal) = (p(2.0, 5.0), p(8.0, 5.0));
    assert!(between(&world, 0.49, start, goal).is_exact);
    assert!(between(&world, 0.51, start, goal).length.is_infinite());
}

#[test]
fn a_ball_about_the_goal_shortens_the_way() {
    let open = room(10.0, vec![]);
    let (start, goal) = (p(1.0, 1.0), p(9.0, 1.0));
    assert_exact(&search(&open, 0.3, start, goal, 2.0, None), 6.0);
    assert_exact(&search(&open, 0.3, start, goal, 8.5, None), 0.0);
    assert_exact(&between(&open, 0.3, start, start), 0.0);
    // The goal stands close behind a wall, through which its ball reaches: it is entered where it leaves the wall.
    let world = room(10.0, vec![block(5.0, 0.0, 5.2, 9.0)]);
    let (start, goal) = (p(5.0 - 1e-3, 1.0), p(6.0, 5.0));
    let tolerance = 2.0;
    let edge = p(5.0, 5.0 - (tolerance * tolerance - 1.0_f64).sqrt());
    let found = search(&world, 0.0, start, goal, tolerance, None);
    // That corner of the ball has η = 10⁻⁷ m to spare.
    assert!(
        found.is_exact && (found.length - (edge - start).norm()).abs() < 1e-6,
        "{found:?}"
    );
}

#[test]
fn a_start_that_touches_can_leave() {
    let world = room(10.0, vec![block(4.0, 0.0, 6.0, 5.0), disc(1.0, 8.0, 0.5)]);
    // On the block's corner circle, and one rounding off the disc.
    assert_exact(&between(&world, 0.5, p(4.0, 5.5), p(9.0, 5.5)), 5.0);
    let found = between(&world, 0.5, p(2.0, 8.0), p(2.0, 9.0));
    assert_exact(&found, 1.0);
}

#[test]
fn what_makes_no_sense_claims_nothing() {
    let world = room(10.0, vec![block(4.0, 0.0, 6.0, 5.0)]);
    let inside = between(&world, 0.5, p(5.0, 3.0), p(9.0, 3.0));
    assert_eq!((inside.length, inside.is_exact), (4.0, false));
    for radius in [f64::NAN, -1.0, f64::INFINITY] {
        let found = between(&world, radius, p(1.0, 3.0), p(9.0, 3.0));
        assert_eq!((found.length, found.is_exact), (8.0, false));
    }
    let nowhere = between(&world, 0.5, p(f64::NAN, 3.0), p(9.0, 3.0));
    assert_eq!((nowhere.length, nowhere.is_exact), (0.0, false));
    let goal_inside = between(&world, 0.5, p(1.0, 3.0), p(5.0, 3.0));
    assert!(goal_inside.length.is_infinite());
}

#[test]
fn a_known_length_prunes_and_is_never_undercut_without_proof() {
    let scene = load("maze");
    let exact = of_scene(&scene, None).length;
    let same = of_scene(&scene, Some(exact));
    assert!((same.length - exact).abs() < 1e-6);
    // A length that no path has: all that is known then is that none is shorter.
    let low = of_scene(&scene, Some(0.9 * exact));
    assert_eq!((low.length, low.is_exact), (0.9 * exact, false));
}

#[test]
fn a_bound_holds_whenever_the_search_is_stopped_and_only_rises() {
    let scene = load("maze");
    let exact = of_scene(&scene, None).length;
    let straight = (scene.goal.position - scene.start.position).norm();
    let mut last = straight;
    for count in [0, 1, 2, 5, 10, 30, 100, 300, 1000, 3000, 10_000, 100_000] {
        let mut meter = Meter::new(&Budget::of_iterations(count));
        let (start, goal) = (scene.start.position, scene.goal.position);
        let found = shortest(&scene.world, 0.0, start, goal, 0.0, None, &mut meter);
        assert!(found.length >= last && found.length <= exact, "{count}");
        assert!(meter.iterations() <= count);
        last = found.length;
    }
    assert_eq!(last, exact);
}

#[test]
fn a_deadline_is_asked_for_all_along() {
    let scene = load("clutter2000");
    let asked = AtomicU64::new(0);
    let stop = || (asked.fetch_add(1, Ordering::Relaxed) == 20).then_some(StopReason::Deadline);
    let mut meter = Meter::new(&Budget::until(&stop));
    let (start, goal) = (scene.start.position, scene.goal.position);
    let found = shortest(&scene.world, 0.5, start, goal, 0.0, None, &mut meter);
    assert!(!found.is_exact && found.length >= (goal - start).norm());
    assert_eq!(asked.load(Ordering::Relaxed), 21);
}

/// The least clearance along a path, looked at every millimetre, m.
fn least_clearance(world: &World, path: &[Point2]) -> f64 {
    let mut least = f64::INFINITY;
    for leg in path.windows(2) {
        let steps = ((leg[1] - leg[0]).norm() / 1e-3).ceil().max(1.0);
        for k in 0..=steps as u64 {
            least = least.min(world.clearance(leg[0] + (leg[1] - leg[0]) * (k as f64 / steps)));
        }
    }
    least
}

#[test]
fn the_path_is_the_one_that_was_measured_and_is_free() {
    let world = room(
        20.0,
        vec![
            block(4.0, 0.0, 5.0, 13.0),
            disc(10.0, 14.0, 3.0),
            block(15.0, 8.0, 16.0, 20.0),
        ],
    );
    for radius in [0.0, 0.3, 1.0] {
        let (start, goal) = (p(1.5, 1.5), p(18.5, 18.5));
        let found = between(&world, radius, start, goal);
        let path = found.path.unwrap();
        assert_eq!((path[0], path[path.len() - 1]), (start, goal));
        let length = Polyline::new(path.clone()).unwrap().length();
        // A chord of 10° is shorter than its arc by 0.13 %; the arcs here are short of 4 m · π.
        assert!(length <= found.length + 1e-9 && length > found.length - 0.02);
        let least = least_clearance(&world, &path);
        // Chords about the disc dip by R + ρ times 1 − cos 5°.
        assert!(least > radius - 0.0039 * (3.0 + radius), "{least}");
    }
}

/// A grid with the given cells occupied, 1 m each, turned by `yaw` about the origin.
fn grid(width: usize, height: usize, yaw: f64, solid: impl Fn(usize, usize) -> bool) -> World {
    let cells = (0..width * height)
        .map(|i| {
            if solid(i % width, i / width) {
                Cell::Occupied
            } else {
                Cell::Free
            }
        })
        .collect();
    let origin = Pose2::new(0.0, 0.0, yaw);
    World::from_grid(OccupancyGrid::new(width, height, 1.0, origin, cells).unwrap()).unwrap()
}

#[test]
fn a_grid_is_what_its_cells_are_as_blocks() {
    let solid = |x: usize, y: usize| {
        (x * 7 + y * 13 + x * y).is_multiple_of(5) && (x, y) != (0, 0) && (x + 2 < 20 || y + 2 < 20)
    };
    let mut blocks = Vec::new();
    for y in 0..20 {
        for x in 0..20 {
            if solid(x, y) {
                let (x, y) = (x as f64, y as f64);
                blocks.push(block(x, y, x + 1.0, y + 1.0));
            }
        }
    }
    let as_blocks = room(20.0, blocks);
    let straight = grid(20, 20, 0.0, solid);
    let turned = grid(20, 20, FRAC_PI_3, solid);
    let turn = |q: Point2| Pose2::new(0.0, 0.0, FRAC_PI_3).transform(q);
    for radius in [0.0, 0.2, 0.45] {
        let (start, goal) = (p(0.5, 0.5), p(19.3, 19.4));
        let one = between(&as_blocks, radius, start, goal);
        let two = between(&straight, radius, start, goal);
        let three = between(&turned, radius, turn(start), turn(goal));
        assert!(one.is_exact && two.is_exact && three.is_exact);
        assert!((one.length - two.length).abs() < 1e-9, "{radius}");
        assert!((one.length - three.length).abs() < 1e-9, "{radius}");
    }
}

#[test]
fn cells_that_meet_diagonally_are_closed() {
    let world = grid(8, 8, 0.0, |x, y| x + y == 7);
    assert!(
        between(&world, 0.0, p(1.0, 1.0), p(7.0, 7.0))
            .length
            .is_infinite()
    );
}

/// A convex obstacle, as its points and what is added around each.
#[derive(Debug, Clone)]
struct Convex {
    points: Vec<Point2>,
    radius: f64,
}

impl Convex {
    fn obstacle(&self) -> Obstacle {
        match self.points[..] {
            [center] => Obstacle::Disc {
                center,
                radius: self.radius,
            },
            _ => Obstacle::Polygon {
                vertices: self.points.clone(),
            },
        }
    }

    /// Grown by `radius`, with polygons of 47 sides for circles: inside them, or (`outside`) around them. Were the number
    /// even, the oracle's legs could pass from a corner to the opposite one without crossing a side.
    fn grown(&self, radius: f64, outside: bool) -> Obstacle {
        let sides = 47;
        let size = (self.radius + radius) / if outside { (PI / 47.0).cos() } else { 1.0 };
        let all = self.points.iter().flat_map(|c| {
            (0..sides).map(move |k| c + tangent::unit(TAU * f64::from(k) / f64::from(sides)) * size)
        });
        Obstacle::Polygon {
            vertices: hull(all.collect()),
        }
    }
}

/// The convex hull, counter-clockwise, by the monotone chain. Points are rounded to a nanometre, so that equal ones are equal.
fn hull(mut points: Vec<Point2>) -> Vec<Point2> {
    for q in &mut points {
        *q = q.map(|x| (x * 1e9).round() * 1e-9);
    }
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut chain: Vec<Point2> = Vec::new();
    for pass in 0..2 {
        let floor = chain.len().max(1);
        for &q in &points {
            while chain.len() > floor
                && (chain[chain.len() - 1] - chain[chain.len() - 2])
                    .perp(&(q - chain[chain.len() - 1]))
                    <= 1e-9
            {
                chain.pop();
            }
            if chain.last() != Some(&q) {
                chain.push(q);
            }
        }
        if pass == 0 {
            points.reverse();
        }
    }
    chain.pop();
    chain
}

fn any_convex() -> impl Strategy<Value = Convex> {
    let place = (1.0..9.0, 1.0..9.0);
    prop_oneof![
        (place.clone(), 0.3..1.2).prop_map(|((x, y), radius)| Convex {
            points: vec![p(x, y)],
            radius,
        }),
        (place.clone(), 0.2..2.0, 0.2..2.0, 0.0..FRAC_PI_2).prop_map(|((x, y), a, b, turn)| {
            let frame = Pose2::new(x, y, turn);
            let corner = |s: f64, t: f64| frame.transform(p(s * a, t * b));
            Convex {
                points: vec![
                    corner(-0.5, -0.5),
                    corner(0.5, -0.5),
                    corner(0.5, 0.5),
                    corner(-0.5, 0.5),
                ],
                radius: 0.0,
            }
        }),
        (place, 0.5..2.0, 0.0..TAU).prop_map(|((x, y), size, turn)| Convex {
            points: (0..3)
                .map(|k| p(x, y) + tangent::unit(turn + f64::from(k) * TAU / 3.0) * size)
                .collect(),
            radius: 0.0,
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Among obstacles grown by less the way is no longer, among obstacles grown by more no shorter.
    #[test]
    fn lies_between_the_visibility_graphs_of_obstacles_grown_by_polygons(
        obstacles in prop::collection::vec(any_convex(), 0..7),
        radius in 0.02..0.6_f64,
    ) {
        let world = room(10.0, obstacles.iter().map(Convex::obstacle).collect());
        let (start, goal) = (p(0.7, 0.8), p(9.3, 9.1));
        prop_assume!(world.clearance(start) > radius + 0.01 && world.clearance(goal) > radius + 0.01);
        let found = between(&world, radius, start, goal);
        let oracle = |outside| {
            let grown = obstacles.iter().map(|o| o.grown(radius, outside)).collect();
            let field = Bounds::new(radius, radius, 10.0 - radius, 10.0 - radius);
            visibility::shortest_length(&World::new(field, grown).unwrap(), start, goal)
        };
        // The oracle keeps a µm from everything.
        let (least, most) = (oracle(false) - 1e-4, oracle(true) + 1e-6);
        prop_assert!(found.length >= least && found.length <= most, "{} {found:?} {}", least, most);
        prop_assert!(found.is_exact || found.length.is_infinite());
        if let Some(path) = &found.path {
            // Chords dip into the largest circle by 0.39 %.
            prop_assert!(least_clearance(&world, path) > radius - 0.0039 * (1.2 + radius));
        }
    }

    #[test]
    fn no_path_that_is_found_is_shorter_and_the_straight_way_is_no_longer(
        obstacles in prop::collection::vec(any_convex(), 0..9),
        radius in prop_oneof![Just(0.0), 0.02..0.4_f64],
        taut_guide in any::<bool>(),
        tolerance in prop_oneof![Just(0.0), 0.1..2.0_f64],
        seed in 0u64..1000,
    ) {
        let world = room(10.0, obstacles.iter().map(Convex::obstacle).collect());
        let (start, goal) = (p(0.6, 0.7), p(9.2, 8.6));
        prop_assume!(world.clearance(start) > radius + 0.02 && world.clearance(goal) > radius + 0.02);
        let problem = PlanningProblem {
            world: &world,
            footprint: if radius > 0.0 { Footprint::Disc { radius } } else { Footprint::Point },
            start: EndPose::point(start.x, start.y),
            goal: GoalRegion { position: goal, heading: None, tolerance },
            max_curvature: 1.0,
        };
        let params = PlannerParams {
            method: Method::BirrtSmooth,
            goal: if tolerance > 0.0 { GoalMode::Ball } else { GoalMode::Pose },
            taut_guide,
            margin: 0.0,
            ..PlannerParams::default()
        };
        let report = plan(&problem, &params, seed, &Budget::of_iterations(20_000)).unwrap();
        let found = search(&world, radius, start, goal, tolerance, None);
        prop_assert!(found.length >= (goal - start).norm() - tolerance);
        if report.outcome == Outcome::Found {
            let length = report.path.unwrap().length();
            prop_assert!(found.is_exact && found.length <= length, "{} {found:?}", length);
            let with_upper = search(&world, radius, start, goal, tolerance, Some(length));
            prop_assert!((with_upper.length - found.length).abs() <= 1e-8 * length);
        }
    }
}
