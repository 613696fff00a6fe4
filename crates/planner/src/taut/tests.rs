//! Against closed forms, and on fields with many obstacles.

use super::*;
use crate::birrt;
use crate::budget::{Budget, CutShort};
use crate::chance::{Chance, Purpose};
use crate::params::GoalMode;
use crate::search::PointQuery;
use crate::test_scenes::{block, load, room};
use crate::visibility;
use bikebot_world::{Footprint, Obstacle, World};
use proptest::prelude::*;

fn unlimited<'a>() -> Meter<'a> {
    Meter::new(&Budget::unlimited())
}

/// A path of BiRRT's, as far from taut as they come.
fn coarse(
    checker: &MotionChecker<'_>,
    start: Point2,
    goal: Point2,
    max_step: f64,
    number: u32,
) -> Option<Vec<Point2>> {
    let query = PointQuery {
        checker,
        start,
        goal,
        goal_mode: GoalMode::Pose,
        tolerance: 0.0,
        max_step,
        max_samples: 3000,
        shorter_than: f64::INFINITY,
    };
    let mut chance = Chance::new(1, Purpose::Birrt, number);
    birrt::search(&query, true, &mut chance, &mut unlimited()).path
}

fn points(list: &[(f64, f64)]) -> Vec<Point2> {
    list.iter().map(|&(x, y)| Point2::new(x, y)).collect()
}

#[test]
fn around_a_block_it_is_the_shortest_path_but_for_half_a_resolution() {
    let world = room(10.0, vec![block(4.0, 0.0, 6.0, 7.0)]);
    let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.01);
    let path = points(&[
        (1.0, 1.0),
        (1.0, 9.0),
        (3.0, 8.0),
        (5.0, 9.0),
        (9.0, 9.0),
        (9.0, 1.0),
    ]);
    let pulled = pull(&path, &Rivals::none(), &checker, &mut unlimited());
    let exact = 2.0 * 45.0_f64.sqrt() + 2.0;
    // Two corners, each passed 5 mm off.
    assert!(
        pulled.length > exact && pulled.length < exact + 0.02,
        "{pulled:?}"
    );
    assert_eq!(pulled.ending, Ending::Taut);
}

#[test]
fn around_a_pillar_it_follows_the_arc_of_the_footprint() {
    let pillar = Obstacle::Disc {
        center: Point2::new(5.0, 0.0),
        radius: 2.5,
    };
    let world = room(10.0, vec![pillar]);
    let checker = MotionChecker::new(&world, &Footprint::Disc { radius: 0.5 }, 0.0, 0.01);
    let path = points(&[(1.0, 0.6), (1.0, 9.0), (9.0, 9.0), (9.0, 0.6)]);
    let pulled = pull(&path, &Rivals::none(), &checker, &mut unlimited());
    // Two tangents and the arc between them, about a circle of 2.5 + 0.5 + 0.005 m.
    let (radius, distance) = (3.005_f64, 16.36_f64.sqrt());
    let tangent = (distance * distance - radius * radius).sqrt();
    let arc = std::f64::consts::PI - 2.0 * (0.6_f64.atan2(4.0) + (radius / distance).acos());
    let exact = 2.0 * tangent + radius * arc;
    assert!(pulled.length >= exact, "{pulled:?}, {exact}");
    assert!(pulled.length < 1.003 * exact, "{pulled:?}, {exact}");
}

#[test]
fn what_is_straight_or_a_point_is_left_alone() {
    let world = room(10.0, vec![]);
    let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.01);
    for path in [
        vec![],
        points(&[(1.0, 1.0)]),
        points(&[(1.0, 1.0), (9.0, 9.0)]),
    ] {
        let pulled = pull(&path, &Rivals::none(), &checker, &mut unlimited());
        assert_eq!((pulled.path, pulled.ending), (path, Ending::Taut));
    }
    let doubled = points(&[(1.0, 1.0), (1.0, 1.0), (9.0, 9.0), (9.0, 9.0)]);
    let pulled = pull(&doubled, &Rivals::none(), &checker, &mut unlimited());
    assert_eq!(pulled.path, points(&[(1.0, 1.0), (9.0, 9.0)]));
}

#[test]
fn on_the_yard_one_start_in_the_mean_and_the_best_of_eight_are_as_short_as_they_should_be() {
    let scene = load("fig6");
    let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
    let exact = visibility::shortest_length_of(&scene);
    let starts = 64;
    let mut lengths = Vec::new();
    for number in 0..starts {
        let (start, goal) = (scene.start.position, scene.goal.position);
        let path = coarse(&checker, start, goal, 5.0, number).expect("the yard is connected");
        let pulled = pull(&path, &Rivals::none(), &checker, &mut unlimited());
        assert!(pulled.length >= exact);
        lengths.push(pulled.length);
    }
    let mean = lengths.iter().sum::<f64>() / f64::from(starts);
    let best_of_eight: Vec<_> = lengths
        .chunks(8)
        .map(|eight| eight.iter().copied().fold(f64::INFINITY, f64::min))
        .collect();
    let best = best_of_eight.iter().sum::<f64>() / best_of_eight.len() as f64;
    // The design study had 180.2 and 175.8 with another implementation and other draws.
    assert!(mean <= 181.0, "{mean}");
    assert!(best <= 176.5, "{best}");
}

#[test]
fn longer_and_known_ways_are_dropped() {
    let world = room(10.0, vec![block(4.0, 3.0, 6.0, 7.0)]);
    let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.01);
    let path = points(&[(1.0, 5.0), (1.0, 9.0), (9.0, 9.0), (9.0, 5.0)]);
    let pull = |lengths: &[f64]| {
        let rivals = Rivals {
            lengths,
            slack: 0.1,
        };
        super::pull(&path, &rivals, &checker, &mut unlimited())
    };
    let free = pull(&[]);
    assert_eq!(free.ending, Ending::Taut);
    assert_eq!(pull(&[1.2 * free.length]).ending, Ending::Taut);
    assert_eq!(
        pull(&[0.5 * free.length, 0.7 * free.length]).ending,
        Ending::Longer
    );
    assert_eq!(
        pull(&[1.2 * free.length, free.length]).ending,
        Ending::Repeated
    );
}

#[test]
fn an_ended_budget_leaves_a_free_path_no_longer_than_before() {
    let scene = load("fig6");
    let checker = MotionChecker::new(&scene.world, &Footprint::Point, 0.0, 0.02);
    let (start, goal) = (scene.start.position, scene.goal.position);
    let path = coarse(&checker, start, goal, 5.0, 0).expect("the yard is connected");
    let mut meter = unlimited();
    let whole = pull(&path, &Rivals::none(), &checker, &mut meter);
    let mut before = length_of(&path);
    for iterations in 0..meter.iterations() {
        let mut meter = Meter::new(&Budget::of_iterations(iterations));
        let pulled = pull(&path, &Rivals::none(), &checker, &mut meter);
        assert_eq!(pulled.ending, Ending::CutShort);
        assert_eq!(
            (meter.iterations(), meter.cut_short()),
            (iterations, Some(CutShort::Iterations))
        );
        assert!(pulled.length <= before + 1e-9);
        before = pulled.length;
        if iterations % 16 == 0 {
            assert!(
                pulled
                    .path
                    .windows(2)
                    .all(|leg| checker.is_segment_free(leg[0], leg[1]))
            );
        }
    }
    assert!(whole.length <= before);
}

fn cluttered(spots: &[(f64, f64, f64, bool)]) -> World {
    let obstacles = spots
        .iter()
        .map(|&(x, y, size, round)| {
            if round {
                Obstacle::Disc {
                    center: Point2::new(x, y),
                    radius: 0.5 * size,
                }
            } else {
                block(
                    x - 0.5 * size,
                    y - 0.3 * size,
                    x + 0.5 * size,
                    y + 0.3 * size,
                )
            }
        })
        .collect();
    room(20.0, obstacles)
}

proptest! {
    #[test]
    fn it_is_free_and_never_longer_and_always_the_same(
        spots in prop::collection::vec((3.0..17.0_f64, 3.0..17.0_f64, 0.2..4.0_f64, any::<bool>()), 0..20),
        radius in 0.0..0.5_f64,
        margin in 0.0..0.1_f64,
        resolution in 0.0..0.1_f64,
        number in 0..1000_u32,
    ) {
        let world = cluttered(&spots);
        let checker = MotionChecker::new(&world, &Footprint::Disc { radius }, margin, resolution);
        let (start, goal) = (Point2::new(1.0, 1.0), Point2::new(19.0, 19.0));
        let Some(path) = coarse(&checker, start, goal, 1.5, number) else {
            return Ok(());
        };
        let pulled = pull(&path, &Rivals::none(), &checker, &mut unlimited());
        prop_assert_eq!((pulled.path[0], pulled.path[pulled.path.len() - 1]), (start, goal));
        prop_assert!(pulled.length <= length_of(&path));
        prop_assert_eq!(pulled.length, length_of(&pulled.path));
        for leg in pulled.path.windows(2) {
            prop_assert!(checker.is_segment_free(leg[0], leg[1]));
        }
        prop_assert_eq!(pull(&path, &Rivals::none(), &checker, &mut unlimited()), pulled);
    }
}
