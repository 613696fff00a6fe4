//! Refined guides of the planner's own, and the rows against finite differences.

use super::objective::curvature_rate_and_gradient;
use super::rows::{Demands, RowMaker, curvature_and_gradient};
use super::spline::{Clamp, Spline};
use super::survey::centre;
use super::*;
use crate::birrt;
use crate::budget::Budget;
use crate::chance::{Chance, Purpose};
use crate::end_arcs::{self, GuideEnd};
use crate::problem::{EndPose, GoalRegion};
use crate::search::PointQuery;
use crate::shortcut;
use crate::test_scenes::{Scene, block, load, room};
use bikebot_geometry::{CurvePath, ParametricCurve, Polyline, Pose2};
use bikebot_world::{Footprint, World};

/// A scene with everything the stage needs.
struct Case {
    scene: Scene,
    params: PlannerParams,
    footprint: Footprint,
    headings: bool,
}

impl Case {
    fn new(name: &str, scale: f64, max_curvature: f64, footprint: Footprint) -> Self {
        Self {
            scene: load(name),
            params: PlannerParams {
                scale,
                max_curvature,
                ..PlannerParams::default()
            },
            footprint,
            headings: true,
        }
    }

    fn problem(&self) -> PlanningProblem<'_> {
        let heading = |pose: &Pose2| self.headings.then_some(pose.heading);
        PlanningProblem {
            world: &self.scene.world,
            footprint: self.footprint.clone(),
            start: EndPose {
                position: self.scene.start.position,
                heading: heading(&self.scene.start),
                curvature: None,
            },
            goal: GoalRegion {
                position: self.scene.goal.position,
                heading: heading(&self.scene.goal),
                tolerance: 0.0,
            },
            max_curvature: self.params.max_curvature,
        }
    }

    fn checker(&self) -> MotionChecker<'_> {
        let resolution = self.params.clearance_resolution();
        MotionChecker::new(&self.scene.world, &self.footprint, 0.0, resolution)
    }

    /// BiRRT and shortcut.
    fn guide(&self, seed: u64) -> Vec<Point2> {
        let checker = self.checker();
        let discs = checker.inscribed();
        let problem = self.problem();
        let mut meter = Meter::new(&Budget::unlimited());
        let query = PointQuery {
            checker: &discs,
            start: problem.start.position,
            goal: problem.goal.position,
            goal_mode: GoalMode::Pose,
            tolerance: 0.0,
            max_step: self.params.max_step(),
            max_samples: 100_000,
            shorter_than: f64::INFINITY,
        };
        let mut chance = Chance::new(seed, Purpose::Birrt, 0);
        let mut path = birrt::search(&query, true, &mut chance, &mut meter)
            .path
            .unwrap();
        let mut chance = Chance::new(seed, Purpose::Shortcut, 0);
        shortcut::apply(&mut path, 2000, &discs, &mut chance, &mut meter);
        path
    }

    /// The same with end arcs.
    fn bent_guide(&self, seed: u64) -> Vec<Point2> {
        let guide = Polyline::new(self.guide(seed)).unwrap();
        let (checker, problem) = (self.checker(), self.problem());
        let mut meter = Meter::new(&Budget::unlimited());
        let mut arc = |end, pose: &Pose2| {
            end_arcs::find(
                &guide,
                end,
                pose,
                problem.max_curvature,
                self.params.max_step(),
                &|curve| {
                    curve.is_within_curvature(problem.max_curvature) && checker.is_curve_free(curve)
                },
                &mut meter,
            )
        };
        let start = arc(GuideEnd::Start, &self.scene.start);
        let goal = arc(GuideEnd::Goal, &self.scene.goal);
        end_arcs::bend_guide(&guide, start.as_ref(), goal.as_ref())
            .vertices()
            .to_vec()
    }

    fn refine(&self, guide: &[Point2]) -> Option<Refined> {
        let mut meter = Meter::new(&Budget::unlimited());
        apply(
            &self.problem(),
            &self.params,
            &self.checker(),
            guide,
            &mut meter,
            &mut |_, _| {},
        )
    }

    /// Checks what is promised of every refined curve, and returns it as a path.
    fn check(&self, refined: &Refined) -> CurvePath {
        let problem = self.problem();
        let checker = self.checker();
        let path = CurvePath::new(refined.curves.clone()).unwrap();
        assert_eq!(path.start_pose().position, problem.start.position);
        assert_eq!(path.end_pose().position, problem.goal.position);
        for (pose, end) in [
            (path.start_pose(), problem.start.heading),
            (path.end_pose(), problem.goal.heading),
        ] {
            if let Some(heading) = end {
                assert!(bikebot_geometry::angle::difference(pose.heading, heading).abs() < 1e-12);
            }
        }
        assert!(path.max_curvature() <= problem.max_curvature);
        assert!(
            path.max_curvature_jump() <= 1e-9,
            "{}",
            path.max_curvature_jump()
        );
        assert!(path.max_heading_jump() <= 1e-12);
        // Independent of the motion check: no contact at places 1 cm apart.
        for place in path.sample(0.01) {
            let pose = Pose2 {
                position: place.position,
                heading: place.heading,
            };
            assert!(checker.pose_clearance(&pose) > 0.0);
            assert!(place.curvature.abs() <= problem.max_curvature * (1.0 + 1e-9));
        }
        path
    }
}

fn line_length(guide: &[Point2]) -> f64 {
    guide.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

#[test]
fn the_yard_is_ridden_smoothly_at_nearly_the_length_of_its_guide() {
    let case = Case::new("fig6", 1.0, 1.0, Footprint::Point);
    // Of these guides the one in the class of the shortest path (174.7 m).
    let guide = (0..6)
        .map(|seed| case.guide(seed))
        .min_by(|a, b| line_length(a).total_cmp(&line_length(b)))
        .unwrap();
    let refined = case.refine(&guide).unwrap();
    let path = case.check(&refined);
    assert!(path.length() <= 177.5, "{}", path.length());
    assert!(path.length() <= 1.01 * line_length(&guide));
    let roughness = path.bending() / path.length().powi(2);
    assert!(roughness <= 3e-6, "{roughness}");
    assert!(path.max_curvature() <= 0.4, "{}", path.max_curvature());

    let mut meter = Meter::new(&Budget::unlimited());
    let polished = polish(
        &case.problem(),
        &case.params,
        &case.checker(),
        &refined.curves,
        1.0,
        &mut meter,
        &mut |_, _| {},
    )
    .unwrap();
    case.check(&polished);
    assert!(polished.cost <= 1.001 * refined.cost);
}

#[test]
fn every_scene_is_certified_from_every_guide() {
    for (name, scale, max_curvature, footprint) in [
        ("fig6", 1.0, 1.0, Footprint::Point),
        ("fig7", 0.4, 1.0, Footprint::Point),
        ("narrow", 1.0, 1.0, Footprint::Point),
        ("maze", 1.0, 1.0, Footprint::Point),
        ("fig7-ride", 0.4, 0.8, Footprint::bike()),
        ("fig6", 1.0, 0.8, Footprint::bike()),
        (
            "fig7-ride",
            0.4,
            0.8,
            "polygon:-0.3,-0.3;1.2,-0.3;1.4,0;1.2,0.3;0.1,0.2;-0.3,0.3"
                .parse()
                .unwrap(),
        ),
    ] {
        let case = Case::new(name, scale, max_curvature, footprint);
        for seed in 0..3 {
            // Bent guides leave and arrive along the headings; the others do not, and need not.
            for guide in [case.guide(seed), case.bent_guide(seed)] {
                let refined = case.refine(&guide);
                let refined = refined.unwrap_or_else(|| panic!("{name}, seed {seed}"));
                let path = case.check(&refined);
                // Eight nodes a segment: the length is good to a thousandth even with segments as long as turns are wide.
                assert!((path.length() - refined.length).abs() < 1e-3 * refined.length);
            }
        }
    }
}

#[test]
fn a_guide_backwards_out_of_the_start_is_never_ridden_backwards() {
    // A corridor in which the prescribed heading points away from the goal.
    let world = room(20.0, vec![]);
    let problem = PlanningProblem {
        world: &world,
        footprint: Footprint::Point,
        start: EndPose::pose(10.0, 10.0, 3.0),
        goal: GoalRegion {
            position: Point2::new(18.0, 10.0),
            heading: Some(0.0),
            tolerance: 0.0,
        },
        max_curvature: 1.0,
    };
    let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
    let guide = [problem.start.position, problem.goal.position];
    let params = PlannerParams::default();
    let mut meter = Meter::new(&Budget::unlimited());
    if let Some(refined) = apply(
        &problem,
        &params,
        &checker,
        &guide,
        &mut meter,
        &mut |_, _| {},
    ) {
        let heading = refined.curves[0].start_pose().heading;
        assert!(bikebot_geometry::angle::difference(heading, 3.0).abs() < 1e-12);
    }
}

#[test]
fn free_headings_are_chosen_and_a_ball_ends_where_the_guide_does() {
    let mut case = Case::new("fig6", 1.0, 1.0, Footprint::Disc { radius: 0.3 });
    case.headings = false;
    let mut guide = case.guide(4);
    let refined = case.refine(&guide).unwrap();
    case.check(&refined);
    guide.pop();
    case.params.goal = GoalMode::Ball;
    let refined = case.refine(&guide).unwrap();
    let last = refined.curves[refined.curves.len() - 1];
    assert_eq!(last.end_point(), guide[guide.len() - 1]);
}

#[test]
fn the_iterations_allowed_decide_the_curve_and_nothing_else_does() {
    let case = Case::new("fig6", 1.0, 1.0, Footprint::Point);
    let guide = case.guide(4);
    let within = |budget: &Budget<'_>| {
        let mut meter = Meter::new(budget);
        let refined = apply(
            &case.problem(),
            &case.params,
            &case.checker(),
            &guide,
            &mut meter,
            &mut |_, _| {},
        );
        (refined, meter.iterations())
    };
    let (unlimited, iterations) = within(&Budget::unlimited());
    assert_eq!(
        within(&Budget::unlimited()),
        (unlimited.clone(), iterations)
    );
    assert_eq!(within(&Budget::of_iterations(iterations)).0, unlimited);
    let (none, used) = within(&Budget::of_iterations(Meter::CHECK_EVERY));
    assert!(none.is_none() && used == Meter::CHECK_EVERY);
    let stop = || Some(crate::budget::StopReason::Cancelled);
    assert_eq!(within(&Budget::until(&stop)), (None, 0));
    // Stopped at any question, also in the midst of a round: the best there was by then, and the same as for as many iterations.
    let questions = {
        let asked = std::sync::atomic::AtomicU64::new(0);
        let never = || {
            asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            None
        };
        within(&Budget::until(&never));
        asked.into_inner()
    };
    let (mut found, mut before) = (0, 0);
    for last in 0..questions {
        let asked = std::sync::atomic::AtomicU64::new(0);
        let stop = || {
            let question = asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            (question == last).then_some(crate::budget::StopReason::Deadline)
        };
        let (stopped, used) = within(&Budget::until(&stop));
        found += u32::from(stopped.is_some());
        assert!(used >= before && used < iterations);
        before = used;
        assert_eq!(within(&Budget::of_iterations(used)), (stopped, used));
    }
    assert!(found > 0);
}

#[test]
fn a_longer_corner_is_smoother() {
    let mut case = Case::new("fig6", 1.0, 1.0, Footprint::Point);
    let guide = case.guide(4);
    let mut before = f64::INFINITY;
    for corner in [7.0, 12.0, 21.0] {
        case.params.corner_length_scales = corner;
        let bending = case.check(&case.refine(&guide).unwrap()).bending();
        assert!(bending < before);
        before = bending;
    }
    // ℓ_c = 12 m ⇒ w_J ≈ 10 m⁴, and the fourth power.
    assert!((jerk_weight(12.0) - 10.9).abs() < 0.1);
    assert!((jerk_weight(24.0) / jerk_weight(12.0) - 16.0).abs() < 1e-9);
}

#[test]
fn nonsense_and_hopeless_guides_yield_nothing() {
    let world = room(10.0, vec![block(4.0, -1.0, 6.0, 11.0)]);
    let problem = |start: EndPose| PlanningProblem {
        world: &world,
        footprint: Footprint::Point,
        start,
        goal: GoalRegion {
            position: Point2::new(9.0, 5.0),
            heading: None,
            tolerance: 0.0,
        },
        max_curvature: 1.0,
    };
    let run = |start: EndPose, guide: &[(f64, f64)], params: &PlannerParams| {
        let checker = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let guide: Vec<_> = guide.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        let mut meter = Meter::new(&Budget::unlimited());
        apply(
            &problem(start),
            params,
            &checker,
            &guide,
            &mut meter,
            &mut |_, _| {},
        )
    };
    let params = PlannerParams::default();
    let start = EndPose::pose(1.0, 5.0, 0.0);
    for guide in [
        &[][..],
        &[(1.0, 5.0)],
        &[(1.0, 5.0), (1.0, 5.0)],
        &[(1.0, 5.0), (f64::NAN, 5.0), (9.0, 5.0)],
        &[(1.0, 5.0), (1e300, 5.0), (9.0, 5.0)],
        // through the wall
        &[(1.0, 5.0), (9.0, 5.0)],
    ] {
        assert_eq!(run(start, guide, &params), None, "{guide:?}");
    }
    let nowhere = EndPose::point(f64::NAN, 5.0);
    assert_eq!(run(nowhere, &[(1.0, 5.0), (9.0, 5.0)], &params), None);
    for corner_length_scales in [0.0, f64::NAN, 1e300] {
        let params = PlannerParams {
            corner_length_scales,
            ..PlannerParams::default()
        };
        assert_eq!(run(start, &[(1.0, 5.0), (9.0, 5.0)], &params), None);
    }
}

/// A spline that turns and changes speed.
fn wavy() -> Spline {
    let control = [
        (0.0, 0.0),
        (1.0, 0.4),
        (2.2, 0.1),
        (3.0, -0.9),
        (4.1, -0.7),
        (4.9, 0.3),
    ];
    Spline {
        control: control.map(|(x, y)| Point2::new(x, y)).to_vec(),
    }
}

/// Central differences of `f` by the control points of `segment`.
fn slope_of(segment: usize, f: &dyn Fn(&Spline) -> f64) -> [f64; 8] {
    let step = 1e-6;
    std::array::from_fn(|k| {
        let at = |by: f64| {
            let mut spline = wavy();
            spline.control[segment + k / 2][k % 2] += by;
            f(&spline)
        };
        (at(step) - at(-step)) / (2.0 * step)
    })
}

/// Central differences of step 1e-6 of quantities of order one err by some 1e-9.
const DIFFERENCE: f64 = 1e-7;

#[test]
fn curvature_and_its_rate_change_as_their_gradients_say() {
    for segment in 0..3 {
        for t in [0.0, 0.3, 0.5, 1.0] {
            let place = wavy().place(segment, t);
            let (sigma, gradient) = curvature_and_gradient(&place);
            let curve = |spline: &Spline| spline.curves(&ends_of(spline))[segment];
            assert!((sigma - curve(&wavy()).curvature(t)).abs() < 1e-12);
            let expected = slope_of(segment, &|s| curve(s).curvature(t));
            for (g, e) in gradient.iter().zip(expected) {
                assert!((g - e).abs() < DIFFERENCE * (1.0 + e.abs()), "{g} {e}");
            }
            let third = curve(&wavy()).third_derivative(t);
            let derivatives = [place.first, place.second, third];
            let (rate, gradient) = curvature_rate_and_gradient(&place.basis, &derivatives);
            assert!((rate - curve(&wavy()).curvature_rate(t)).abs() < 1e-12 * (1.0 + rate.abs()));
            let expected = slope_of(segment, &|s| curve(s).curvature_rate(t));
            for (g, e) in gradient.iter().zip(expected) {
                assert!(
                    (g - e).abs() < 10.0 * DIFFERENCE * (1.0 + e.abs()),
                    "{g} {e}"
                );
            }
        }
    }
}

/// Free ends where the spline's are.
fn ends_of(spline: &Spline) -> [Clamp; 2] {
    let last = spline.segments() - 1;
    [spline.place(0, 0.0), spline.place(last, 1.0)].map(|place| Clamp {
        position: place.point,
        direction: None,
        curvature: None,
    })
}

#[test]
fn clearance_of_a_swinging_disc_changes_as_its_row_says() {
    // Outside beside a corner and an edge, and inside.
    for (x, y) in [(2.0, 0.6), (2.5, -3.0), (2.6, -0.6)] {
        let world = World::new(
            bikebot_world::Bounds::new(-10.0, -10.0, 10.0, 10.0),
            vec![block(x, y, x + 0.7, y + 0.7)],
        )
        .unwrap();
        let discs = [(0.0, 0.0), (0.9, 0.0), (-0.5, 0.0), (0.4, -0.3), (0.0, 0.5)].map(
            |(offset, lateral)| bikebot_world::FootprintDisc {
                offset,
                lateral,
                radius: 0.2,
            },
        );
        let rows = RowMaker {
            world: &world,
            discs: &discs,
            reach: 10.0,
            max_curvature: 1.0,
            price: 1.0,
            clamped: [false; 2],
            curvature_is_fixed: false,
        };
        let demands = Demands {
            clearance: vec![0.1; 3],
            curvature: vec![1.0; 3],
        };
        for segment in 0..3 {
            for t in [0.2, 0.5] {
                for (k, disc) in discs.iter().enumerate() {
                    let clearance = |spline: &Spline| {
                        let place = spline.place(segment, t);
                        world.clearance(centre(place.point, place.first, disc)) - disc.radius
                    };
                    let at = clearance(&wavy());
                    let row = rows
                        .clearance_row(&wavy(), segment, t, k, at, &demands)
                        .unwrap();
                    assert!((row.bound - (at - 0.1)).abs() < 1e-12);
                    let expected = slope_of(segment, &clearance);
                    for (c, e) in row.coefficients.iter().zip(expected) {
                        assert!((c + e).abs() < DIFFERENCE, "{c} {e}");
                    }
                }
            }
        }
    }
}

#[test]
fn on_a_boundary_the_row_points_to_where_clearance_grows() {
    let world = room(10.0, vec![block(4.0, 4.0, 6.0, 6.0)]);
    let spline = Spline::through(
        &[2.0, 3.0, 5.0, 7.0].map(|x| Point2::new(x, 6.0)),
        Vector2::new(1.0, 0.0),
        Vector2::new(1.0, 0.0),
    );
    let discs = Footprint::Point.discs();
    let rows = RowMaker {
        world: &world,
        discs: &discs,
        reach: 2.0,
        max_curvature: 1.0,
        price: 1.0,
        clamped: [false; 2],
        curvature_is_fixed: false,
    };
    let demands = Demands {
        clearance: vec![0.0; 3],
        curvature: vec![1.0; 3],
    };
    let row = rows
        .clearance_row(&spline, 2, 0.0, 0, 0.0, &demands)
        .unwrap();
    // Up: −B_k in y, nothing in x.
    assert!(row.coefficients[3] < -0.6 && row.coefficients[2].abs() < 1e-9);
}
