//! Search over poses and steering angles: slow and rough, but it knows from the first step on what a bike can ride.
//!
//! The other stages look for a way without headings first and for a curve along it afterwards. In a thicket, or with the nose to a wall, there
//! are many ways and no curve along most of them. Here the search is over (x, y, θ, κ): from every state lead short
//! [`Primitive`]s, each a curve of its own whose curvature begins where the last one ended; each is checked for the whole footprint. A* with the
//! length of the shortest way on a coarse grid as its bound, weighted, finds a first way and not the best: what is found is meant to be
//! refined or replaced later. States are told apart by cells of position, heading and curvature, one per cell: where the search ends
//! without a way there may still be one.

mod distance;
mod primitive;

pub use primitive::Primitive;

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::f64::consts::TAU;

use bikebot_geometry::{CurvePath, FergusonCurve, Pose2};

use self::distance::DistanceField;
use crate::budget::Meter;
use crate::motion::MotionChecker;
use crate::problem::PlanningProblem;

/// The tightest curvature of a primitive, as a part of the limit.
const TIGHTEST: f64 = 0.95;
/// Side of a cell of the coarse grid that bounds the way left, in turning radii.
const FIELD_CELL: f64 = 0.2;
/// What a metre costs more with full lock, and how much a change of curvature by a full lock costs, m.
const BENT: f64 = 0.2;
const STEERED: f64 = 0.1;
/// How much the bound counts: above 1 a way is found sooner, and may be longer by as much.
const EAGERNESS: f64 = 1.5;
/// From this near, in turning radii, the goal itself is tried.
const HOMING: f64 = 4.0;

/// How finely states are told apart, and how short a step is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Curvatures: so many to either side of straight.
    pub sides: i32,
    /// Length of a primitive, turning radii.
    pub length: f64,
    /// Side of a cell of position, turning radii.
    pub cell: f64,
    /// Cells of heading.
    pub headings: u32,
}

impl Grain {
    /// Quick: a primitive turns by up to half a radian.
    pub const COARSE: Self = Self {
        sides: 2,
        length: 0.5,
        cell: 0.2,
        headings: 48,
    };
    /// Thorough: twice as many steps for the same way, and places the coarse one steps over.
    pub const FINE: Self = Self {
        sides: 2,
        length: 0.25,
        cell: 0.1,
        headings: 96,
    };
}

/// What came of a search.
#[derive(Debug, Clone)]
pub struct LatticeSearch {
    /// From the start to the goal, of continuous curvature within the limit, free for the checker.
    pub path: Option<CurvePath>,
    /// States whose primitives were tried.
    pub expansions: u64,
}

/// One state that was reached.
struct Node {
    pose: Pose2,
    curvature: f64,
    /// −sides … sides; `None` at the start, whose curvature may be any.
    bend: Option<i32>,
    cost: f64,
    parent: u32,
    /// The curve that leads here.
    curve: Option<FergusonCurve>,
}

/// What is open: least estimate first, then the older.
#[derive(PartialEq)]
struct Open {
    estimate: f64,
    node: u32,
}

impl Eq for Open {}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .estimate
            .total_cmp(&self.estimate)
            .then_with(|| other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Looks for a path of `problem` that is free for `checker`; the start needs a heading, and a curvature or none (straight). Each state that is
/// looked at counts as one iteration.
#[must_use]
pub fn search(
    problem: &PlanningProblem<'_>,
    checker: &MotionChecker<'_>,
    grain: Grain,
    meter: &mut Meter<'_>,
) -> LatticeSearch {
    let mut expansions = 0;
    let path = find(problem, checker, grain, meter, &mut expansions);
    LatticeSearch { path, expansions }
}

fn find(
    problem: &PlanningProblem<'_>,
    checker: &MotionChecker<'_>,
    grain: Grain,
    meter: &mut Meter<'_>,
    expansions: &mut u64,
) -> Option<CurvePath> {
    let limit = problem.max_curvature;
    let radius = limit.recip();
    let start = Pose2 {
        position: problem.start.position,
        heading: problem.start.heading?,
    };
    let field = DistanceField::new(checker, problem.goal.position, FIELD_CELL * radius, meter)?;
    let bound = |pose: &Pose2| field.distance(pose.position);
    let length = grain.length * radius;
    let pieces = Pieces::new(grain.sides, length, limit);
    let cell = |pose: &Pose2, curvature: f64| grain.cell_of(pose, curvature, limit);

    let mut nodes = vec![Node {
        pose: start,
        curvature: problem.start.curvature.unwrap_or(0.0),
        bend: None,
        cost: 0.0,
        parent: u32::MAX,
        curve: None,
    }];
    let mut open = BinaryHeap::from([Open {
        estimate: bound(&start)?,
        node: 0,
    }]);
    let mut best: BTreeMap<[i32; 4], f64> = BTreeMap::new();
    while let Some(Open { node: index, .. }) = open.pop() {
        if !meter.step() {
            return None;
        }
        *expansions += 1;
        let (pose, curvature, bend, cost) = {
            let node = &nodes[index as usize];
            (node.pose, node.curvature, node.bend, node.cost)
        };
        let key = cell(&pose, curvature);
        if index > 0 && best.get(&key).is_some_and(|known| *known < cost) {
            continue;
        }
        let way = problem.goal.position - pose.position;
        if way.norm() <= HOMING * radius
            && let Some(last) = home(problem, checker, &pose, curvature)
        {
            return trace(&nodes, index, last);
        }
        pieces.from(bend, curvature, |to, piece| {
            let curve = piece.at(&pose);
            let end = pose.compose(&piece.end);
            let Some(left) = bound(&end) else {
                return;
            };
            let bent = piece.curvature.abs().max(curvature.abs()) / limit;
            let steered = (piece.curvature - curvature).abs() / limit;
            let cost = cost + length * (1.0 + BENT * bent) + STEERED * steered;
            let key = cell(&end, piece.curvature);
            if best.get(&key).is_some_and(|known| *known <= cost) || !checker.is_curve_free(&curve)
            {
                return;
            }
            best.insert(key, cost);
            open.push(Open {
                estimate: cost + EAGERNESS * left,
                node: nodes.len() as u32,
            });
            nodes.push(Node {
                pose: end,
                curvature: piece.curvature,
                bend: Some(to),
                cost,
                parent: index,
                curve: Some(curve),
            });
        });
    }
    None
}

/// The primitives, made once.
struct Pieces {
    /// From each bend to those at most a full lock away, the lowest first.
    between: Vec<Vec<(i32, Primitive)>>,
    sides: i32,
    length: f64,
    limit: f64,
}

impl Pieces {
    fn new(sides: i32, length: f64, limit: f64) -> Self {
        let bend = |to: i32| bend(to, sides, limit);
        let between = (-sides..=sides)
            .map(|from| {
                (-sides..=sides)
                    .filter(|to| (to - from).abs() <= sides)
                    .filter_map(|to| {
                        let (a, b) = (bend(from), bend(to));
                        Some((to, Primitive::new(a, b, length, limit)?))
                    })
                    .collect()
            })
            .collect();
        Self {
            between,
            sides,
            length,
            limit,
        }
    }

    /// Those that begin with a bend, or with the curvature of the start.
    fn from(&self, from: Option<i32>, curvature: f64, mut visit: impl FnMut(i32, &Primitive)) {
        match from {
            Some(from) => {
                for (to, piece) in &self.between[(from + self.sides) as usize] {
                    visit(*to, piece);
                }
            }
            None => {
                for to in -self.sides..=self.sides {
                    let target = bend(to, self.sides, self.limit);
                    let full_lock = bend(self.sides, self.sides, self.limit);
                    let is_near = (target - curvature).abs() <= 1.01 * full_lock;
                    let piece = is_near
                        .then(|| Primitive::new(curvature, target, self.length, self.limit))
                        .flatten();
                    if let Some(piece) = piece {
                        visit(to, &piece);
                    }
                }
            }
        }
    }
}

/// κ of one of `sides` bends to either side, 1/m.
fn bend(bend: i32, sides: i32, limit: f64) -> f64 {
    TIGHTEST * limit * f64::from(bend) / f64::from(sides)
}

impl Grain {
    fn cell_of(&self, pose: &Pose2, curvature: f64, limit: f64) -> [i32; 4] {
        let side = self.cell / limit;
        let headings = f64::from(self.headings);
        [
            (pose.position.x / side).floor() as i32,
            (pose.position.y / side).floor() as i32,
            (pose.heading.rem_euclid(TAU) / TAU * headings).round() as i32 % self.headings as i32,
            (curvature / limit * f64::from(self.sides)).round() as i32,
        ]
    }
}

/// A last curve that ends at the goal.
fn home(
    problem: &PlanningProblem<'_>,
    checker: &MotionChecker<'_>,
    pose: &Pose2,
    curvature: f64,
) -> Option<FergusonCurve> {
    let goal = &problem.goal;
    let fits = |curve: &FergusonCurve| {
        curve.is_finite()
            && curve.is_within_curvature(problem.max_curvature)
            && checker.is_curve_free(curve)
    };
    match goal.heading {
        None => primitive::homing(pose, curvature, goal.position).find(fits),
        Some(heading) => {
            let end = Pose2 {
                position: goal.position,
                heading,
            };
            primitive::arriving(pose, curvature, &end).find(fits)
        }
    }
}

fn trace(nodes: &[Node], last: u32, home: FergusonCurve) -> Option<CurvePath> {
    let mut curves = vec![home];
    let mut at = last as usize;
    while let Some(curve) = nodes[at].curve {
        curves.push(curve);
        at = nodes[at].parent as usize;
    }
    curves.reverse();
    CurvePath::new(curves).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::problem::{EndPose, GoalRegion};
    use bikebot_geometry::Point2;
    use bikebot_world::{Bounds, Footprint, Obstacle, World};

    fn block(x0: f64, y0: f64, x1: f64, y1: f64) -> Obstacle {
        Obstacle::Block {
            min: Point2::new(x0, y0),
            max: Point2::new(x1, y1),
        }
    }

    fn found(obstacles: Vec<Obstacle>, start: EndPose, goal: GoalRegion) -> LatticeSearch {
        let world = World::new(Bounds::new(0.0, 0.0, 12.0, 8.0), obstacles).unwrap();
        let problem = PlanningProblem {
            world: &world,
            footprint: Footprint::bike(),
            start,
            goal,
            max_curvature: 0.8,
        };
        let checker = MotionChecker::new(&world, &problem.footprint, 0.02, 0.01);
        let mut meter = Meter::new(&Budget::of_iterations(50_000));
        let search = search(&problem, &checker, Grain::COARSE, &mut meter);
        if let Some(path) = &search.path {
            assert!(
                path.max_curvature() <= 0.8 * (1.0 + 1e-9),
                "{}",
                path.max_curvature()
            );
            assert!(
                path.max_curvature_jump() < 1e-6,
                "{}",
                path.max_curvature_jump()
            );
            assert!(path.max_heading_jump() < 1e-9);
            assert!(
                path.segments()
                    .iter()
                    .all(|curve| checker.is_curve_free(curve))
            );
            assert!((path.end_pose().position - goal.position).norm() < 1e-9);
            let begin = path.at(0.0);
            assert!((begin.curvature - start.curvature.unwrap_or(0.0)).abs() < 1e-9);
        }
        search
    }

    fn to(x: f64, y: f64, heading: Option<f64>) -> GoalRegion {
        GoalRegion {
            position: Point2::new(x, y),
            heading,
            tolerance: 0.1,
        }
    }

    #[test]
    fn with_the_nose_to_a_wall_it_turns_about() {
        let wall = vec![block(6.0, 0.0, 6.5, 8.0)];
        let start = EndPose::pose(3.4, 2.5, 0.0).with_curvature(0.3);
        let search = found(wall, start, to(1.5, 6.0, None));
        assert!(search.path.is_some(), "{} states", search.expansions);
    }

    #[test]
    fn it_threads_a_slalom_to_a_pose() {
        let slalom = vec![
            block(3.5, 0.0, 4.0, 4.4),
            block(6.5, 3.6, 7.0, 8.0),
            block(9.0, 0.0, 9.4, 3.0),
        ];
        let search = found(
            slalom,
            EndPose::pose(1.0, 1.0, 0.0),
            to(10.6, 6.5, Some(1.2)),
        );
        assert!(search.path.is_some(), "{} states", search.expansions);
    }

    #[test]
    fn out_of_a_closed_room_it_finds_nothing() {
        let wall = vec![block(6.0, 0.0, 6.5, 8.0)];
        let search = found(wall, EndPose::pose(3.0, 4.0, 0.0), to(10.0, 4.0, None));
        assert!(search.path.is_none());
        // The coarse grid says so at once.
        assert_eq!(search.expansions, 0);
    }
}
