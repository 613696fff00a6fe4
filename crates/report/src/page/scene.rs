//! What the top view shows besides the bike: ground, what moves, plans, followed curves.

use bikebot_geometry::Pose2;
use bikebot_sim::Setup;
use bikebot_sim::record::Trace;
use bikebot_sim::record::trace::PlanTrace;
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid};
use serde::Serialize;

use super::encoding::{Column, Line, thinned};
use crate::grid_outline;
use crate::scenery;

/// Lines on the ground may be off by this much, m: less than a pixel of any screen.
const LINE_TOLERANCE: f64 = 0.002;
/// Most edges of the trees of all plans of a ride.
const MAX_EDGES: usize = 24_000;
/// Samples a second of what moves.
const MOVING_RATE: f64 = 20.0;
/// Most samples of all that moves on a ride.
const MAX_MOVING: usize = 120_000;

/// A solid shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Solid {
    /// x, y, radius, m.
    Disc([f64; 3]),
    /// Corners, m.
    Polygon(Vec<[f64; 2]>),
}

impl Solid {
    fn of(obstacle: &Obstacle) -> Self {
        match obstacle {
            Obstacle::Disc { center, radius } => Self::Disc([center.x, center.y, *radius]),
            Obstacle::Polygon { vertices } => {
                Self::Polygon(vertices.iter().map(|p| [p.x, p.y]).collect())
            }
            Obstacle::Block { min, max } => Self::Polygon(vec![
                [min.x, min.y],
                [max.x, min.y],
                [max.x, max.y],
                [min.x, max.y],
            ]),
        }
    }
}

/// The map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Map {
    solids: Vec<Solid>,
    /// Rims of occupied and of unknown cells, to be filled even-odd.
    occupied: Vec<Line>,
    unknown: Vec<Line>,
}

impl Map {
    /// The map of the scenario; where that is not known, the cells of the recording.
    pub(super) fn of(setup: Option<&Setup>, trace: &Trace) -> Option<Self> {
        match setup {
            Some(setup) => setup
                .world
                .as_ref()
                .map(|world| Self::drawn(world.obstacles(), world.grid())),
            None => trace.map.as_ref().map(|grid| Self::drawn(&[], Some(grid))),
        }
    }

    fn drawn(obstacles: &[Obstacle], grid: Option<&OccupancyGrid>) -> Self {
        let rims = |wanted: Cell| -> Vec<Line> {
            let Some(grid) = grid else {
                return Vec::new();
            };
            let rims = grid_outline::rims(grid, |cell| cell == wanted).into_iter();
            rims.map(|rim| {
                let corners: Vec<[f64; 2]> = rim
                    .into_iter()
                    .map(|[x, y]| {
                        let p = grid.from_cell_coordinates(bikebot_geometry::Vector2::new(x, y));
                        [p.x, p.y]
                    })
                    .collect();
                Line::of(&corners)
            })
            .collect()
        };
        Self {
            solids: obstacles.iter().map(Solid::of).collect(),
            occupied: rims(Cell::Occupied),
            unknown: rims(Cell::Unknown),
        }
    }
}

/// Something that moves, appears or is hidden.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Moving {
    /// About its own reference point.
    shape: Solid,
    /// First sample, and from one to the next, s.
    start: f64,
    step: f64,
    count: usize,
    /// Without a number while it is not there.
    x: Column,
    y: Column,
    heading: Column,
}

/// All that moves, from 0 to `end` (s).
pub(super) fn moving(setup: &Setup, end: f64) -> Vec<Moving> {
    let obstacles = setup.traffic.obstacles();
    let most = MAX_MOVING / obstacles.len().max(1);
    let wanted = (end * MOVING_RATE).clamp(0.0, MAX_MOVING as f64).ceil() as usize + 1;
    let count = wanted.clamp(2, most.max(2));
    let step = (end / (count - 1) as f64).max(1e-9);
    obstacles
        .iter()
        .map(|obstacle| {
            let poses: Vec<Option<Pose2>> = (0..count)
                .map(|i| obstacle.itinerary().pose(i as f64 * step))
                .collect();
            let part = |value: fn(&Pose2) -> f64| {
                let values = poses.iter();
                let values: Vec<f64> = values
                    .map(|pose| pose.as_ref().map_or(f64::NAN, value))
                    .collect();
                Column::of(&values)
            };
            Moving {
                shape: Solid::of(obstacle.outline()),
                start: 0.0,
                step,
                count,
                x: part(|pose| pose.position.x),
                y: part(|pose| pose.position.y),
                heading: part(|pose| pose.heading),
            }
        })
        .collect()
}

/// A plan and what led to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Plan {
    /// In force from then on, s.
    time: f64,
    /// m.
    length: f64,
    path: Line,
    /// Ends of edges in turn.
    tree: Line,
    coarse: Line,
    guide: Line,
    /// m.
    corridor: Option<f64>,
    goal: Option<Goal>,
}

/// Where a plan was to end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Goal {
    x: f64,
    y: f64,
    heading: Option<f64>,
    tolerance: f64,
}

/// Every plan of a ride.
pub(super) fn plans(trace: &Trace) -> Vec<Plan> {
    let edges: usize = trace.plans.iter().map(|plan| plan.tree.len()).sum();
    let every = edges.div_ceil(MAX_EDGES).max(1);
    trace.plans.iter().map(|plan| packed(plan, every)).collect()
}

fn packed(plan: &PlanTrace, every: usize) -> Plan {
    let path: Vec<[f64; 2]> = plan.path.iter().map(|p| [p.x, p.y]).collect();
    let tree: Vec<[f64; 2]> = plan.tree.iter().step_by(every).flatten().copied().collect();
    Plan {
        time: plan.time_s,
        length: plan.path.last().map_or(0.0, |p| p.s),
        path: Line::of(&thinned(&path, LINE_TOLERANCE)),
        tree: Line::of(&tree),
        coarse: Line::of(&plan.coarse),
        guide: Line::of(&plan.guide),
        corridor: plan.corridor_half_width,
        goal: plan.goal.map(|goal| Goal {
            x: goal.position[0],
            y: goal.position[1],
            heading: goal.heading,
            tolerance: goal.tolerance,
        }),
    }
}

/// A curve the follower was given.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Followed {
    time: f64,
    path: Line,
}

/// Every followed curve of a ride.
pub(super) fn followed(trace: &Trace) -> Vec<Followed> {
    let curves = trace.followed.iter();
    curves
        .map(|curve| {
            let path: Vec<[f64; 2]> = curve.path.iter().map(|p| [p.x, p.y]).collect();
            Followed {
                time: curve.time_s,
                path: Line::of(&thinned(&path, LINE_TOLERANCE)),
            }
        })
        .collect()
}

/// What the bike looks like, m and rad.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct BikeShape {
    wheelbase: f64,
    wheel_radius: f64,
    pivot_x: f64,
    pivot_height: f64,
    /// Offset of the balancer's centre of gravity from its pivot at the start.
    balancer_offset: f64,
    /// x, y, z, yaw of the laser; nothing where it has none.
    laser: Option<[f64; 4]>,
    laser_tilts: bool,
    /// On the ground.
    footprint: Vec<[f64; 2]>,
}

impl BikeShape {
    /// The bike of the scenario, or the default one where the scenario is not known.
    pub(super) fn of(setup: Option<&Setup>) -> Self {
        let usual = bikebot_dynamics::BikeParams::default();
        let bike = setup.map_or(&usual, |setup| &setup.true_bike);
        let laser = setup.map(|setup| &setup.laser);
        let footprint = setup.map_or(Footprint::bike(), |setup| setup.footprint.clone());
        Self {
            wheelbase: bike.wheelbase,
            wheel_radius: bike.wheel_radius,
            pivot_x: bike.x2,
            pivot_height: bike.l,
            balancer_offset: match setup.map(|setup| setup.mode) {
                Some(bikebot_dynamics::BalancerMode::Balancer) => bike.balancer_offset,
                _ => bike.flywheel_offset,
            },
            laser: laser.filter(|laser| laser.enabled).map(|laser| {
                let yaw = laser.mount_yaw_deg.to_radians();
                [laser.mount_x, laser.mount_y, laser.mount_z, yaw]
            }),
            laser_tilts: laser.is_some_and(|laser| laser.tilts_with_roll),
            footprint: rim(&footprint),
        }
    }
}

/// Corners of a footprint's rim, m; none for a point.
fn rim(footprint: &Footprint) -> Vec<[f64; 2]> {
    const HALF: usize = 16;
    let arc = |x: f64, radius: f64, from: f64| {
        (0..=HALF).map(move |i| {
            let (sin, cos) = (from + std::f64::consts::PI * i as f64 / HALF as f64).sin_cos();
            [x + radius * cos, radius * sin]
        })
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let capsule = |rear: f64, front: f64, radius: f64| -> Vec<[f64; 2]> {
        arc(front, radius, -quarter)
            .chain(arc(rear, radius, quarter))
            .collect()
    };
    match footprint {
        Footprint::Disc { radius } => capsule(0.0, 0.0, *radius),
        Footprint::Capsule {
            rear,
            front,
            radius,
        } => capsule(*rear, *front, *radius),
        Footprint::Rectangle {
            rear,
            front,
            half_width,
        } => vec![
            [*rear, -half_width],
            [*front, -half_width],
            [*front, *half_width],
            [*rear, *half_width],
        ],
        Footprint::Polygon(polygon) => scenery::rounded(polygon.vertices(), polygon.rounding()),
        // A point has no rim; shapes that `world` learns later are not drawn.
        _ => Vec::new(),
    }
}

/// Where the ride began, or was to begin, m.
pub(super) fn start(setup: Option<&Setup>, trace: &Trace) -> Option<[f64; 2]> {
    let state = &trace.state;
    let first = state.x_m.first().zip(state.y_m.first());
    let ridden = first.map(|(x, y)| [*x, *y]);
    let asked = setup.and_then(|setup| setup.start_pose.as_ref());
    let start = ridden.or_else(|| asked.map(|pose| [pose.position.x, pose.position.y]));
    start.filter(|at| at.iter().all(|it| it.is_finite()))
}

/// The rectangle to show: the field, or what was ridden, planned and mapped.
pub(super) fn extent(setup: Option<&Setup>, trace: &Trace) -> [f64; 4] {
    if let Some(world) = setup.and_then(|setup| setup.world.as_ref()) {
        let bounds = world.bounds();
        return [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y];
    }
    let state = &trace.state;
    let ridden = state.x_m.iter().zip(&state.y_m).map(|(x, y)| [*x, *y]);
    let planned = trace.plans.iter().flat_map(|plan| &plan.path);
    let mapped = trace.map.iter().filter(|_| setup.is_none());
    let corners = mapped.flat_map(|grid| {
        let [w, h] = [grid.width, grid.height].map(|it| it as f64);
        [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].map(|[x, y]| {
            let p = grid.from_cell_coordinates(bikebot_geometry::Vector2::new(x, y));
            [p.x, p.y]
        })
    });
    let places = ridden
        .chain(planned.map(|p| [p.x, p.y]))
        .chain(corners)
        .filter(|p| p.iter().all(|it| it.is_finite()))
        .map(|[x, y]| bikebot_geometry::Point2::new(x, y));
    let around = Bounds::around(places).unwrap_or(Bounds::new(0.0, 0.0, 0.0, 0.0));
    let margin = 1.5 + 0.05 * around.width().max(around.height());
    [
        around.min.x - margin,
        around.min.y - margin,
        around.max.x + margin,
        around.max.y + margin,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_of_the_bike_has_its_length_and_width() {
        let rim = rim(&Footprint::bike());
        let most = |axis: usize| {
            rim.iter()
                .map(|p| p[axis])
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let least = |axis: usize| rim.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        for (value, wanted) in [
            (most(0), 1.46),
            (least(0), -0.34),
            (most(1), 0.3),
            (least(1), -0.3),
        ] {
            assert!((value - wanted).abs() < 1e-9, "{value} {wanted}");
        }
        assert!(super::rim(&Footprint::Point).is_empty());
    }

    #[test]
    fn without_its_scenario_a_ride_is_shown_on_the_cells_that_were_recorded() {
        let corner = Pose2::new(-1.0, 2.0, 0.0);
        let mut grid = OccupancyGrid::filled(8, 4, 0.5, corner, Cell::Free).unwrap();
        grid.set(3, 1, Cell::Occupied);
        let mut trace = Trace::with_scans();
        trace.map = Some(grid);
        let map = Map::of(None, &trace).unwrap();
        assert_eq!((map.occupied.len(), map.unknown.len()), (1, 0));
        assert!(Map::of(None, &Trace::default()).is_none());
        let shown = extent(None, &trace);
        assert!(shown[0] < -1.0 && shown[1] < 2.0 && shown[2] > 3.0 && shown[3] > 4.0);
    }

    #[test]
    fn a_ride_without_a_map_is_shown_with_room_about_it() {
        assert_eq!(extent(None, &Trace::default()), [-1.5, -1.5, 1.5, 1.5]);
    }
}
