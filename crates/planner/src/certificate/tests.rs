use super::*;
use crate::test_scenes::{Scene, block, load, room};
use crate::{
    Budget, EndPose, GoalRegion, Method, MotionChecker, PlanReport, PlannedPath, PlannerParams,
    plan,
};
use bikebot_geometry::{ParametricCurve, Point2, Pose2};
use bikebot_world::{Footprint, World};
use proptest::prelude::*;

fn params(method: Method, scale: f64) -> PlannerParams {
    PlannerParams {
        method,
        scale,
        max_curvature: 1.0,
        ..PlannerParams::default()
    }
}

fn problem<'w>(
    scene: &'w Scene,
    footprint: Footprint,
    params: &PlannerParams,
) -> PlanningProblem<'w> {
    let pose = |p: Pose2| EndPose::pose(p.position.x, p.position.y, p.heading);
    PlanningProblem {
        world: &scene.world,
        footprint,
        start: pose(scene.start),
        goal: GoalRegion {
            position: scene.goal.position,
            heading: Some(scene.goal.heading),
            tolerance: 0.3,
        },
        max_curvature: params.max_curvature,
    }
}

fn planned(problem: &PlanningProblem<'_>, params: &PlannerParams) -> PlanReport {
    plan(problem, params, 7, &Budget::default()).expect("a sound problem")
}

fn terms_of(report: &PlanReport, params: &PlannerParams) -> Terms {
    let metrics = report.metrics.as_ref().expect("found");
    Terms {
        kind: match report.path {
            Some(PlannedPath::Curves(_)) => PathKind::Curves,
            _ => PathKind::Polyline,
        },
        margin: params.margin,
        goal_radius: 0.0,
        promises: Promises {
            max_curvature: metrics.max_curvature,
            curvature_jump: metrics.curvature_jump,
            min_clearance: Some(metrics.min_clearance),
            length: Some(metrics.length),
        },
    }
}

#[test]
fn plans_on_the_scenes_hold_and_agree_with_their_own_figures() {
    for (name, scale, footprint) in [
        ("fig6", 1.0, "point"),
        ("fig6", 1.0, "capsule:1.8x0.6"),
        (
            "fig6",
            1.0,
            "polygon:-0.4,-0.3;1.2,-0.3;1.4,0;1.2,0.3;0.1,0.2;-0.4,0.3",
        ),
        ("fig7", 0.4, "point"),
        ("narrow", 1.0, "disc:0.2"),
        ("maze", 1.0, "box:1.2x0.5@0.2"),
    ] {
        let scene = load(name);
        let params = params(
            if footprint == "point" {
                Method::Paper
            } else {
                Method::Full
            },
            scale,
        );
        let problem = problem(&scene, footprint.parse().unwrap(), &params);
        let report = planned(&problem, &params);
        let Some(path) = &report.path else {
            panic!("{name} {footprint}: {:?}", report.reason)
        };
        let verdict = verify(&problem, &path.segments(), &terms_of(&report, &params));
        assert!(
            verdict.holds(),
            "{name} {footprint}: {:?}",
            verdict.violations
        );
        let (c, m) = (verdict.certificate.unwrap(), report.metrics.unwrap());
        // Two proofs of the same figure, each within its tolerance of it.
        let apart = c.min_clearance - m.min_clearance;
        assert!(
            (-CLEARANCE_TOLERANCE
                ..=CLEARANCE_TOLERANCE
                    + (0.1 * params.clearance_resolution()).max(0.06 * c.min_clearance))
                .contains(&apart),
            "{name} {footprint}: {apart}"
        );
        assert!(c.min_clearance <= c.min_clearance_at_most);
        assert!(c.min_clearance_at_most - c.min_clearance <= CLEARANCE_TOLERANCE);
        let sigma = m.max_curvature.unwrap();
        assert!(
            (c.max_curvature.unwrap() - sigma).abs() <= 2.0 * CURVATURE_TOLERANCE * sigma + 2e-12
        );
        assert!(c.length_at_least <= m.length + 1e-6 && m.length <= c.length_at_most + 1e-6);
    }
}

#[test]
fn a_polyline_is_held_to_its_clearance_and_ends_only() {
    let scene = load("fig6");
    let params = params(Method::Birrt, 1.0);
    let problem = problem(&scene, Footprint::bike(), &params);
    let report = planned(&problem, &params);
    let mut segments = report.path.as_ref().unwrap().segments();
    let terms = terms_of(&report, &params);
    assert_eq!(terms.kind, PathKind::Polyline);
    let verdict = verify(&problem, &segments, &terms);
    assert!(verdict.holds(), "{:?}", verdict.violations);
    assert_eq!(verdict.certificate.unwrap().max_curvature, None);
    segments.remove(1);
    let verdict = verify(&problem, &segments, &terms);
    assert_eq!(verdict.violations[0].kind, ViolationKind::PositionGap);
}

/// A room with one pillar, an S-curve around it in two segments, and its honest promises.
struct Case {
    world: World,
    footprint: Footprint,
    segments: Vec<FergusonCurve>,
    max_curvature: f64,
    terms: Terms,
    start: Pose2,
    goal: Pose2,
}

impl Case {
    fn sound() -> Self {
        let world = room(12.0, vec![block(5.0, 0.5, 7.0, 4.0)]);
        let (start, middle, goal) = (
            Pose2::new(2.0, 3.0, 0.6),
            Pose2::new(6.0, 5.2, 0.0),
            Pose2::new(10.0, 3.0, -0.6),
        );
        let segments = vec![
            FergusonCurve::between(start, middle, 4.6),
            FergusonCurve::between(middle, goal, 4.6),
        ];
        let mut case = Self {
            world,
            footprint: "capsule:1.2x0.4".parse().unwrap(),
            segments,
            max_curvature: 0.5,
            terms: Terms {
                kind: PathKind::Curves,
                margin: 0.1,
                goal_radius: 0.0,
                promises: Promises::default(),
            },
            start,
            goal,
        };
        let verdict = case.verdict();
        assert!(verdict.holds(), "{:?}", verdict.violations);
        let c = verdict.certificate.unwrap();
        case.terms.promises = Promises {
            max_curvature: c.max_curvature,
            curvature_jump: c.curvature_jump,
            min_clearance: Some(c.min_clearance),
            length: Some(0.5 * (c.length_at_least + c.length_at_most)),
        };
        assert!(case.verdict().holds(), "{:?}", case.verdict().violations);
        case
    }

    fn verdict(&self) -> Verdict {
        let pose = |p: Pose2| EndPose::pose(p.position.x, p.position.y, p.heading);
        let problem = PlanningProblem {
            world: &self.world,
            footprint: self.footprint.clone(),
            start: pose(self.start),
            goal: GoalRegion {
                position: self.goal.position,
                heading: Some(self.goal.heading),
                tolerance: 0.3,
            },
            max_curvature: self.max_curvature,
        };
        verify(&problem, &self.segments, &self.terms)
    }
}

/// Changes numbers of one segment: `[x0, y0, vx0, vy0, x1, y1, vx1, vy1]`.
fn with(curve: &FergusonCurve, change: impl Fn(&mut [f64; 8])) -> FergusonCurve {
    let mut numbers = curve.to_array();
    change(&mut numbers);
    FergusonCurve::from_array(numbers)
}

#[test]
fn twenty_four_corruptions_are_each_caught_by_their_kind() {
    use ViolationKind as K;
    type Corrupt = fn(&mut Case);
    let corruptions: &[(&str, K, Corrupt)] = &[
        ("node moved by 1e-6", K::PositionGap, |c| {
            c.segments[1] = with(&c.segments[1], |v| v[0] += 1e-6);
        }),
        ("node moved aside by 1e-6", K::PositionGap, |c| {
            c.segments[0] = with(&c.segments[0], |v| v[5] -= 1e-6);
        }),
        ("NaN position", K::NotFinite, |c| {
            c.segments[0] = with(&c.segments[0], |v| v[4] = f64::NAN);
        }),
        ("infinite tangent", K::NotFinite, |c| {
            c.segments[1] = with(&c.segments[1], |v| v[7] = f64::INFINITY);
        }),
        ("broken tangent", K::HeadingGap, |c| {
            c.segments[1] = with(&c.segments[1], |v| v[3] += 1e-6);
        }),
        ("tangent of no length", K::HeadingGap, |c| {
            c.segments[1] = with(&c.segments[1], |v| (v[2], v[3]) = (0.0, 0.0));
        }),
        ("first segment dropped", K::StartPosition, |c| {
            c.segments.remove(0);
        }),
        ("last segment dropped", K::EndPosition, |c| {
            c.segments.pop();
        }),
        ("segments swapped", K::PositionGap, |c| {
            c.segments.swap(0, 1)
        }),
        ("segment duplicated", K::PositionGap, |c| {
            c.segments.insert(0, c.segments[0]);
        }),
        ("segment reversed", K::PositionGap, |c| {
            c.segments[1] = c.segments[1].reversed();
        }),
        ("everything reversed", K::StartHeading, |c| {
            c.segments = c
                .segments
                .iter()
                .rev()
                .map(FergusonCurve::reversed)
                .collect();
            (c.start.position, c.goal.position) = (c.goal.position, c.start.position);
        }),
        ("a post between samples", K::Clearance, |c| {
            let p = c.segments[0].point(0.31771);
            let mut obstacles = c.world.obstacles().to_vec();
            obstacles.push(block(p.x - 5e-5, p.y - 5e-5, p.x + 5e-5, p.y + 5e-5));
            c.world = room(12.0, obstacles);
        }),
        ("through the pillar", K::Clearance, |c| {
            let low = Pose2::new(6.0, 4.1, 0.0);
            c.segments = vec![
                FergusonCurve::between(c.start, low, 4.6),
                FergusonCurve::between(low, c.goal, 4.6),
            ];
        }),
        ("curvature spike between samples", K::Curvature, |c| {
            // A node with next to no speed: all of the turn happens within a millimetre of it.
            let turn = |v: &mut [f64; 8], at: usize| {
                let speed = 2e-2 / v[at].hypot(v[at + 1]);
                v[at] *= speed;
                v[at + 1] *= speed;
            };
            c.segments[0] = with(&c.segments[0], |v| turn(v, 6));
            c.segments[1] = with(&c.segments[1], |v| turn(v, 2));
        }),
        ("wrong end heading by 1e-6", K::EndHeading, |c| {
            c.goal.heading += 1e-6
        }),
        ("wrong start heading by 1e-6", K::StartHeading, |c| {
            c.start.heading -= 1e-6
        }),
        ("goal moved by 1e-6", K::EndPosition, |c| {
            c.goal.position.x += 1e-6
        }),
        ("cusp", K::Cusp, |c| {
            // Out and back on one line: the curvature is zero wherever there is one.
            c.segments[0] = FergusonCurve::from_ends(
                c.segments[0].start_point(),
                c.start.direction() * 6.0,
                c.segments[0].start_point(),
                c.start.direction() * -6.0,
            );
        }),
        ("off the map", K::Clearance, |c| {
            let out = Pose2::new(6.0, 12.5, 0.0);
            c.segments = vec![
                FergusonCurve::between(c.start, out, 12.0),
                FergusonCurve::between(out, c.goal, 12.0),
            ];
        }),
        ("limit claimed smaller", K::CurvaturePromise, |c| {
            let promised = c.terms.promises.max_curvature.as_mut().unwrap();
            *promised *= 1.0 - 1e-5;
        }),
        ("jump claimed smaller", K::JumpPromise, |c| {
            c.segments[1] = with(&c.segments[1], |v| {
                v[2] *= 0.8;
                v[3] *= 0.8;
            });
            c.terms.promises.curvature_jump = Some(0.0);
        }),
        ("clearance claimed larger", K::ClearancePromise, |c| {
            let promised = c.terms.promises.min_clearance.as_mut().unwrap();
            *promised += 2e-4;
        }),
        ("length wrong", K::LengthPromise, |c| {
            let promised = c.terms.promises.length.as_mut().unwrap();
            *promised *= 1.0 - 1e-5;
        }),
        ("length not a number", K::LengthPromise, |c| {
            c.terms.promises.length = Some(f64::NAN);
        }),
        ("other map", K::Clearance, |c| {
            c.world = room(12.0, vec![block(5.0, 0.5, 7.0, 4.95)]);
        }),
        ("footprint swapped", K::Clearance, |c| {
            c.footprint = "box:1.2x2.4".parse().unwrap();
        }),
        ("a post inside the footprint", K::Clearance, |c| {
            // No side of the outline ever meets it in place: only what is inside tells.
            c.footprint = "polygon:-0.9,-0.9;0.9,-0.9;0.9,0.9;-0.9,0.9"
                .parse()
                .unwrap();
            let p = c.start.position;
            c.world = room(
                12.0,
                vec![block(p.x - 0.01, p.y - 0.01, p.x + 0.01, p.y + 0.01)],
            );
        }),
    ];
    assert!(corruptions.len() >= 24);
    for (name, kind, corrupt) in corruptions {
        let mut case = Case::sound();
        corrupt(&mut case);
        let verdict = case.verdict();
        let found = verdict.violations.iter().find(|v| v.kind == *kind);
        let Some(found) = found else {
            panic!("{name}: {:?}", verdict.violations)
        };
        // What is not a number is not there at all; everything else is short by so much.
        assert!(
            found.margin < 0.0 || found.margin.is_nan(),
            "{name}: {found:?}"
        );
    }
}

fn curves() -> impl Strategy<Value = FergusonCurve> {
    (
        (1.0..11.0, 1.0..11.0, -3.2..3.2_f64),
        (0.5..5.0, -1.2..1.2_f64, -1.5..1.5_f64),
    )
        .prop_map(|((x, y, heading), (chord, bearing, turn))| {
            let from = Pose2::new(x, y, heading);
            let along = heading + bearing;
            let to = Pose2::new(
                x + chord * along.cos(),
                y + chord * along.sin(),
                heading + turn,
            );
            FergusonCurve::between(from, to, chord)
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn both_least_clearances_agree_within_their_tolerances(curve in curves(), which in 0..5_usize) {
        prop_assume!(curve.is_within_curvature(5.0));
        let world = room(12.0, vec![
            block(4.0, 4.0, 6.0, 7.0),
            bikebot_world::Obstacle::Disc { center: Point2::new(9.0, 8.0), radius: 0.8 },
        ]);
        let footprint: Footprint = [
            "point", "disc:0.3", "bike", "box:1.2x0.5@0.2", "polygon:-0.2,-0.2;1,-0.2;1,0.2;0.2,0.2;0.2,0.6;-0.2,0.6",
        ][which].parse().unwrap();
        let problem = PlanningProblem {
            world: &world,
            footprint: footprint.clone(),
            start: EndPose { position: curve.start_point(), heading: None, curvature: None },
            goal: GoalRegion { position: curve.end_point(), heading: None, tolerance: 0.0 },
            max_curvature: 5.0,
        };
        let terms = Terms {
            kind: PathKind::Curves,
            margin: 0.0,
            goal_radius: 0.0,
            promises: Promises::default(),
        };
        let verdict = verify(&problem, &[curve], &terms);
        let c = verdict.certificate.unwrap();
        let path = bikebot_geometry::CurvePath::new(vec![curve]).unwrap();
        let checker = MotionChecker::new(&world, &footprint, 0.0, 0.02);
        let other = checker.least_clearance_of_path(&path, crate::motion::Tolerance::of(1e-4));
        if other > 1e-3 {
            prop_assert!((c.min_clearance - other).abs() <= 1e-4 + CLEARANCE_TOLERANCE, "{} {other}", c.min_clearance);
            prop_assert!(verdict.holds(), "{:?}", verdict.violations);
        } else if other < -1e-3 {
            prop_assert!(!verdict.holds());
        }
        let sampled = (0..=500)
            .map(|i| f64::from(i) / 500.0)
            .map(|t| checker.pose_clearance(&Pose2 { position: curve.point(t), heading: curve.heading(t) }))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(c.min_clearance <= sampled.max(0.0) + 1e-9, "{} {sampled}", c.min_clearance);
        let sigma = curve.max_curvature();
        let proven = c.max_curvature.unwrap();
        prop_assert!(proven >= sigma * (1.0 - 1e-12) && proven <= sigma * (1.0 + 2.0 * CURVATURE_TOLERANCE) + 2e-12);
    }
}
