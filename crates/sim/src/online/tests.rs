//! The navigator with an ideal scanner, a grid carved by its rays, and a rider that follows exactly.

use super::*;
use bikebot_geometry::{CurvePath, Point2, Pose2};
use bikebot_planner::{Budget, EndPose, GoalRegion, Outcome, PlannerParams, PlanningProblem, plan};
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid, World};

/// Side of a field, m, and of a cell.
const SIDE: f64 = 30.0;
const CELL: f64 = 0.1;
/// The rider: top speed, speeding up and braking, lateral acceleration.
const SPEED: f64 = 1.5;
const BRAKING: f64 = 0.5;
const LATERAL: f64 = 0.8;
/// Control and scan period, s.
const TICK: f64 = 0.01;
const SCAN: usize = 5;

/// A number in [0, 1) from a counter.
fn hashed(k: u64) -> f64 {
    let mut z = k.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
}

/// Discs, blocks and triangles, off the start and the goal.
fn field(seed: u64, count: usize) -> Vec<Obstacle> {
    let mut shapes = Vec::new();
    let mut k = seed.wrapping_mul(1_000_003);
    let mut next = || {
        k = k.wrapping_add(1);
        hashed(k)
    };
    while shapes.len() < count {
        let centre = Point2::new(SIDE * next(), SIDE * next());
        let size = 0.2 + 0.8 * next();
        let kind = next();
        let turn = std::f64::consts::TAU * next();
        let clear = |p: Point2| (centre - p).norm() > 1.5 * size + 2.2;
        if !(clear(start().0) && clear(goal().position)) {
            continue;
        }
        shapes.push(if kind < 0.4 {
            Obstacle::Disc {
                center: centre,
                radius: size,
            }
        } else if kind < 0.7 {
            let half = bikebot_geometry::Vector2::new(size, 0.3 + 0.7 * size * turn / 6.3);
            Obstacle::Block {
                min: centre - half,
                max: centre + half,
            }
        } else {
            Obstacle::Polygon {
                vertices: (0..3)
                    .map(|i| {
                        let angle = turn + std::f64::consts::TAU * f64::from(i) / 3.0;
                        centre
                            + bikebot_geometry::Vector2::new(angle.cos(), angle.sin()) * 1.3 * size
                    })
                    .collect(),
            }
        });
    }
    shapes
}

fn start() -> (Point2, f64) {
    (Point2::new(2.0, 2.0), std::f64::consts::FRAC_PI_4)
}

fn goal() -> GoalRegion {
    GoalRegion {
        position: Point2::new(27.5, 27.5),
        heading: None,
        tolerance: 0.3,
    }
}

fn bounds() -> Bounds {
    Bounds::new(0.0, 0.0, SIDE, SIDE)
}

fn planner() -> PlannerParams {
    PlannerParams {
        scale: 0.5,
        ..PlannerParams::default()
    }
}

/// Cells carved by the rays of an ideal scanner; what was hit once stays.
struct Carved {
    grid: OccupancyGrid,
    noise: f64,
    drawn: u64,
}

impl Carved {
    fn new(bounds: Bounds, noise: f64) -> Self {
        let count = |extent: f64| (extent / CELL).round() as usize;
        let origin = Pose2::new(bounds.min.x, bounds.min.y, 0.0);
        let (width, height) = (count(bounds.width()), count(bounds.height()));
        Self {
            grid: OccupancyGrid::filled(width, height, CELL, origin, Cell::Unknown).unwrap(),
            noise,
            drawn: 0,
        }
    }

    fn look(&mut self, world: &World, pose: &Pose2) -> Vec<(usize, usize, Cell)> {
        const BEAMS: usize = 541;
        const RANGE: f64 = 30.0;
        let eye = pose.transform(Point2::new(1.2, 0.0));
        let step = 1.5 * std::f64::consts::PI / (BEAMS - 1) as f64;
        let first = pose.heading - 0.75 * std::f64::consts::PI;
        let mut ranges = vec![0.0; BEAMS];
        world.cast_fan(eye, first, step, RANGE, &mut ranges);
        for range in &mut ranges {
            self.drawn += 1;
            *range += self.noise * (2.0 * hashed(self.drawn) - 1.0);
        }
        let mut changes = Vec::new();
        let mut write = |grid: &mut OccupancyGrid, (x, y): (usize, usize), cell| {
            if grid.cell(x, y) != Some(cell) && grid.cell(x, y) != Some(Cell::Occupied) {
                grid.set(x, y, cell);
                changes.push((x, y, cell));
            }
        };
        for (i, range) in ranges.iter().enumerate() {
            let angle = first + step * i as f64;
            let along = bikebot_geometry::Vector2::new(angle.cos(), angle.sin());
            let hit = self.grid.world_to_cell(eye + along * (range + 1e-6));
            let cells: Vec<_> = self
                .grid
                .traverse(eye, eye + along * range.min(RANGE))
                .collect();
            for cell in cells {
                if range.is_infinite() || Some(cell) != hit {
                    write(&mut self.grid, cell, Cell::Free);
                }
            }
            if let (true, Some(cell)) = (range.is_finite(), hit) {
                write(&mut self.grid, cell, Cell::Occupied);
            }
        }
        changes
    }
}

/// How a ride went.
#[derive(Debug, Clone, PartialEq)]
struct Ridden {
    arrived: bool,
    collided: bool,
    halt: Option<Halt>,
    length: f64,
    time: f64,
    plans: u32,
    paths: Vec<(f64, Cause)>,
    /// Whether each plan passes x = 9.8 m above y = 4 m.
    sides: Vec<bool>,
    emergencies: u32,
    violations: u32,
    track: Vec<Pose2>,
}

fn stopping_distance(speed: f64) -> f64 {
    0.5 * speed * speed / BRAKING + 0.1 * speed
}

struct Case {
    obstacles: Vec<Obstacle>,
    /// Comes to stand here when the bike comes as near as this on its way, m.
    surprise: Option<f64>,
    bounds: Bounds,
    start: (Point2, f64),
    goal: GoalRegion,
    online: OnlineParams,
    /// Ranges are off by up to this much, m.
    noise: f64,
    seed: u64,
}

impl Case {
    fn random(seed: u64, count: usize) -> Self {
        Self {
            obstacles: field(seed, count),
            surprise: None,
            bounds: bounds(),
            start: start(),
            goal: goal(),
            online: OnlineParams::default(),
            noise: 0.0,
            seed,
        }
    }

    fn with_full_knowledge(&self) -> Option<f64> {
        let world = World::new(self.bounds, self.obstacles.clone()).unwrap();
        let problem = PlanningProblem {
            world: &world,
            footprint: Footprint::bike().grown(0.1),
            start: EndPose::pose(self.start.0.x, self.start.0.y, self.start.1).with_curvature(0.0),
            goal: self.goal,
            max_curvature: 0.8,
        };
        let report = plan(&problem, &planner(), 1, &Budget::of_iterations(200_000)).ok()?;
        (report.outcome == Outcome::Found).then(|| report.path.map(|path| path.length()))?
    }

    fn ride(&self) -> Ridden {
        let mut world = World::new(self.bounds, self.obstacles.clone()).unwrap();
        let mut carved = Carved::new(self.bounds, self.noise);
        let (at, heading) = self.start;
        let mut pose = Pose2::new(at.x, at.y, heading);
        carved.look(&world, &pose);
        let planner = planner();
        let task = Task {
            belief: &carved.grid,
            bounds: self.bounds,
            known: None,
            start: EndPose::pose(at.x, at.y, heading).with_curvature(0.0),
            goal: self.goal,
            bike: Footprint::bike(),
            outline: Footprint::bike().grown(0.1),
            planner: &planner,
            online: &self.online,
            seed: self.seed,
        };
        let mut navigator = Navigator::new(&task).unwrap();
        let mut ridden = Ridden {
            arrived: false,
            collided: false,
            halt: navigator.begin().unwrap().1,
            length: 0.0,
            time: 0.0,
            plans: 0,
            paths: Vec::new(),
            sides: Vec::new(),
            emergencies: 0,
            violations: 0,
            track: Vec::new(),
        };
        let Some(mut path) = navigator.path().cloned() else {
            return ridden;
        };
        ridden.sides.extend(side(&path, 0.0));
        let (mut s, mut speed) = (0.0_f64, 0.0_f64);
        let mut surprised = false;
        for tick in 0.. {
            let time = tick as f64 * TICK;
            if tick % SCAN == 0 {
                navigator.observe(&carved.look(&world, &pose));
            }
            let order = navigator.tick(&Motion {
                time,
                s,
                speed,
                stopping_distance: stopping_distance(speed),
            });
            ridden.plans += u32::from(order.search.is_some());
            ridden.emergencies += u32::from(order.is_emergency);
            if let Some(new) = order.path {
                assert!(new.joint >= s - 1e-9, "joint {} behind {s}", new.joint);
                let (before, after) = (path.at(s), new.curves.at(s));
                assert!((before.position - after.position).norm() < 1e-6);
                assert!(
                    new.curves.max_curvature_jump() < 1e-3,
                    "{}",
                    new.curves.max_curvature_jump()
                );
                assert!(new.curves.max_curvature() <= 0.8 * (1.0 + 1e-6));
                path = new.curves;
                ridden.sides.extend(side(&path, s));
                ridden.paths.push((time, new.cause));
            }
            if let Some(halt) = order.gives_up {
                ridden.halt = Some(halt);
                break;
            }
            let stop = order.stop_at.unwrap_or(path.length()).min(path.length());
            // The rider keeps what it was told if that is possible at all.
            let allowed = (2.0 * BRAKING * (stop - s).max(0.0)).sqrt();
            let corner = (LATERAL / path.at(s).curvature.abs().max(1e-9)).sqrt();
            let wanted = SPEED.min(allowed).min(corner.max(0.5));
            speed = wanted
                .clamp(speed - BRAKING * TICK * 1.05, speed + 0.3 * TICK)
                .max(0.0);
            if surprised_by(self.surprise, &mut surprised, s, speed) {
                let place = path.at(s + stopping_distance(speed) + self.surprise.unwrap() + 1.5);
                let half = bikebot_geometry::Vector2::new(0.4, 0.4);
                let mut obstacles = self.obstacles.clone();
                obstacles.push(Obstacle::Block {
                    min: place.position - half,
                    max: place.position + half,
                });
                world = World::new(self.bounds, obstacles).unwrap();
            }
            s += speed * TICK;
            let place = path.at(s);
            ridden.length += speed * TICK;
            pose = Pose2 {
                position: place.position,
                heading: place.heading,
            };
            ridden.track.push(pose);
            ridden.time = time;
            if world.overlaps(&Footprint::bike(), &pose) {
                ridden.collided = true;
                break;
            }
            if tick % 10 == 0 && !is_braking_safe(&path, s, speed, &carved.grid, &ridden) {
                ridden.violations += 1;
            }
            if (pose.position - self.goal.position).norm() < 0.1 && speed < 0.05 {
                ridden.arrived = true;
                break;
            }
            if time > 300.0 {
                break;
            }
        }
        ridden
    }
}

/// Whether a path still leads by x = 9.8 m above y = 4 m.
fn side(path: &CurvePath, from: f64) -> Option<bool> {
    let mut s = from;
    while s < path.length() {
        let place = path.at(s).position;
        if place.x >= 9.8 {
            return (s > from).then_some(place.y > 4.0);
        }
        s += 0.05;
    }
    None
}

fn surprised_by(surprise: Option<f64>, surprised: &mut bool, s: f64, speed: f64) -> bool {
    let comes = surprise.is_some() && !*surprised && s > 6.0 && speed > 0.8;
    *surprised |= comes;
    comes
}

/// Independent of the navigator: braking now along the path, the outline covers only cells known to be free, or those it covers already.
fn is_braking_safe(
    path: &CurvePath,
    s: f64,
    speed: f64,
    grid: &OccupancyGrid,
    ridden: &Ridden,
) -> bool {
    let stop = (s + stopping_distance(speed)).min(path.length());
    let near_start = |p: Point2| {
        ridden.track.first().is_some_and(|first| {
            let local = first.inverse().transform(p);
            (local.x - local.x.clamp(-0.04, 1.16)).hypot(local.y) < 0.65
        })
    };
    let here = path.at(s);
    let covers = |place: &bikebot_geometry::PathPoint, p: Point2, grown: f64| {
        let local = Pose2 {
            position: place.position,
            heading: place.heading,
        }
        .inverse()
        .transform(p);
        (local.x - local.x.clamp(-0.04, 1.16)).hypot(local.y) <= 0.3 + grown
    };
    let mut at = s;
    while at <= stop {
        let place = path.at(at);
        for i in 0..24 {
            for j in 0..9 {
                let local = Point2::new(
                    -0.34 + 1.8 * f64::from(i) / 23.0,
                    -0.3 + 0.6 * f64::from(j) / 8.0,
                );
                let p = Pose2 {
                    position: place.position,
                    heading: place.heading,
                }
                .transform(local);
                if !covers(&place, p, 0.0) || covers(&here, p, 0.25) || near_start(p) {
                    continue;
                }
                let cell = grid.world_to_cell(p);
                if cell.and_then(|(x, y)| grid.cell(x, y)) != Some(Cell::Free) {
                    return false;
                }
            }
        }
        at += 0.1;
    }
    true
}

fn assert_safe(ridden: &Ridden, name: &str) {
    assert!(!ridden.collided, "{name}");
    assert_eq!(ridden.violations, 0, "{name}");
}

#[test]
fn unknown_fields_are_crossed_nearly_as_shortly_as_known_ones() {
    for seed in 0..4 {
        let case = Case::random(seed, 60);
        let ridden = case.ride();
        assert_safe(&ridden, &format!("field {seed}"));
        assert!(ridden.arrived, "field {seed}: {:?}", ridden.halt);
        let shortest = case.with_full_knowledge().unwrap();
        assert!(
            ridden.length < 1.15 * shortest,
            "field {seed}: {} {shortest}",
            ridden.length
        );
    }
}

#[test]
fn what_comes_to_stand_a_metre_beyond_the_stopping_distance_is_not_touched() {
    for seed in 0..4 {
        let case = Case {
            surprise: Some(1.0),
            ..Case::random(seed, 30)
        };
        let ridden = case.ride();
        assert_safe(&ridden, &format!("field {seed}"));
        assert!(ridden.arrived || ridden.halt.is_some(), "field {seed}");
    }
}

/// A corridor along x, 20 m long and 8 m wide, with what stands in it.
fn corridor(obstacles: Vec<Obstacle>) -> Case {
    Case {
        obstacles,
        surprise: None,
        bounds: Bounds::new(0.0, 0.0, 20.0, 8.0),
        start: (Point2::new(1.0, 4.0), 0.0),
        goal: GoalRegion {
            position: Point2::new(18.0, 4.0),
            heading: None,
            tolerance: 0.3,
        },
        online: OnlineParams::default(),
        noise: 0.0,
        seed: 1,
    }
}

fn block(x0: f64, y0: f64, x1: f64, y1: f64) -> Obstacle {
    Obstacle::Block {
        min: Point2::new(x0, y0),
        max: Point2::new(x1, y1),
    }
}

#[test]
fn of_two_equal_sides_one_is_chosen_and_kept() {
    for seed in 0..3 {
        let case = Case {
            noise: 0.02,
            seed,
            ..corridor(vec![block(9.0, 3.2, 10.6, 4.8)])
        };
        let ridden = case.ride();
        assert_safe(&ridden, "corridor");
        assert!(ridden.arrived, "{:?}", ridden.halt);
        // Which side the plans in force led by, one after the other.
        let changes = ridden
            .sides
            .windows(2)
            .filter(|pair| pair[0] != pair[1])
            .count();
        assert!(changes <= 1, "{:?}", ridden.sides);
    }
}

#[test]
fn at_a_dead_end_the_bike_stops_upon_proof_and_says_why() {
    let case = corridor(vec![
        // A screen, and behind it a wall from side to side.
        block(8.0, 0.0, 8.4, 5.6),
        block(12.0, 0.0, 12.4, 8.0),
    ]);
    let ridden = case.ride();
    assert_safe(&ridden, "dead end");
    assert_eq!(ridden.halt, Some(Halt::Disconnected));
    let last = ridden.track.last().unwrap();
    // It went to see, and did not touch the wall: the foremost point of the outline lies before it.
    let front = last.transform(Point2::new(1.16, 0.0)).x + 0.3;
    assert!(last.position.x > 5.0 && front < 12.0, "{last:?}");
}

#[test]
fn a_ride_repeats_to_the_last_bit() {
    let case = Case {
        noise: 0.02,
        ..Case::random(1, 60)
    };
    assert_eq!(case.ride(), case.ride());
}

#[test]
fn a_goal_with_something_on_it_is_named_as_the_reason() {
    let mut case = corridor(vec![block(17.75, 3.75, 18.25, 4.25)]);
    case.online.give_up = 2.0;
    let ridden = case.ride();
    assert_safe(&ridden, "goal");
    assert_eq!(ridden.halt, Some(Halt::GoalBlocked));
}
