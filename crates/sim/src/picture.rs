//! Tells a recorder what does not change while riding: the bike, the map, the plan.

use crate::clock::SimTime;
use crate::record::{
    BikeGeometry, CellState, Event, GoalSample, GridSample, MapEvent, PathSample, PlanEvent,
    RecordError, Recorder, Shape,
};
use crate::setup::Setup;
use bikebot_geometry::{CurvePath, Point2, Pose2, angle};
use bikebot_planner::PlanReport;
use bikebot_world::{Cell, Footprint, FootprintPolygon, Obstacle};

/// Spacing of the recorded path, m.
const PATH_STEP: f64 = 0.05;
/// Corners with which a round end of the footprint is drawn.
const ROUND: usize = 16;

/// The bike's outline and the map, at time zero.
pub(crate) fn scene(setup: &Setup, recorder: &mut dyn Recorder) -> Result<(), RecordError> {
    let bike = &setup.true_bike;
    let laser = &setup.laser;
    let geometry = BikeGeometry {
        wheelbase: bike.wheelbase,
        wheel_radius: bike.wheel_radius,
        pivot_x: bike.x2,
        pivot_height: bike.l,
        laser_position: [laser.mount_x, laser.mount_y, laser.mount_z],
        laser_yaw: laser.mount_yaw_deg.to_radians(),
        laser_pitch: laser.mount_pitch_deg.to_radians(),
        laser_is_level: !laser.tilts_with_roll,
        footprint: outline(&setup.footprint),
    };
    recorder.record(SimTime::ZERO, &Event::Bike(&geometry))?;
    let Some(world) = &setup.world else {
        return Ok(());
    };
    let bounds = world.bounds();
    let shapes: Vec<Shape> = world.obstacles().iter().map(shape).collect();
    let cells: Vec<CellState> = world
        .grid()
        .map(|grid| grid.cells.iter().map(|cell| cell_state(*cell)).collect())
        .unwrap_or_default();
    let grid = world.grid().map(|grid| GridSample {
        width: grid.width,
        height: grid.height,
        resolution: grid.resolution,
        origin: [grid.origin.position.x, grid.origin.position.y],
        yaw: grid.origin.heading,
        cells: &cells,
    });
    recorder.record(
        SimTime::ZERO,
        &Event::Map(MapEvent {
            bounds: [[bounds.min.x, bounds.min.y], [bounds.max.x, bounds.max.y]],
            shapes: &shapes,
            grid,
        }),
    )
}

/// The plan with its stages, or the path that counts from `time` on.
pub(crate) fn plan(
    setup: &Setup,
    report: Option<&PlanReport>,
    path: Option<&CurvePath>,
    time: SimTime,
    recorder: &mut dyn Recorder,
) -> Result<(), RecordError> {
    if report.is_none() && path.is_none() {
        return Ok(());
    }
    let samples: Vec<PathSample> = path.map(path_samples).unwrap_or_default();
    let plain = |points: &[Point2]| points.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>();
    let stages = report.map(|report| &report.stages);
    let tree: Vec<[[f64; 2]; 2]> = stages
        .map(|stages| {
            stages
                .tree
                .iter()
                .map(|edge| [[edge[0].x, edge[0].y], [edge[1].x, edge[1].y]])
                .collect()
        })
        .unwrap_or_default();
    let line = |polyline: Option<&bikebot_geometry::Polyline>| {
        polyline
            .map(|line| plain(line.vertices()))
            .unwrap_or_default()
    };
    let coarse = line(stages.and_then(|stages| stages.coarse.as_ref()));
    let guide = line(stages.and_then(|stages| stages.guide.as_ref()));
    recorder.record(
        time,
        &Event::Plan(PlanEvent {
            path: &samples,
            tree: &tree,
            coarse: &coarse,
            guide: &guide,
            corridor_half_width: stages.and_then(|stages| stages.corridor_half_width),
            goal: setup.goal.map(|goal| GoalSample {
                position: [goal.position.x, goal.position.y],
                heading: goal.heading,
                tolerance: setup.goal_tolerance,
            }),
        }),
    )
}

fn path_samples(path: &CurvePath) -> Vec<PathSample> {
    let mut samples: Vec<PathSample> = path
        .sample(PATH_STEP)
        .into_iter()
        .map(|point| PathSample {
            x: point.position.x,
            y: point.position.y,
            heading: point.heading,
            curvature: point.curvature,
            s: point.s,
            speed: f64::NAN,
        })
        .collect();
    samples.dedup_by(|a, b| a.s == b.s);
    samples
}

pub(crate) fn shape(obstacle: &Obstacle) -> Shape {
    let plain = |p: &Point2| [p.x, p.y];
    match obstacle {
        Obstacle::Disc { center, radius } => Shape::Disc {
            center: plain(center),
            radius: *radius,
        },
        Obstacle::Polygon { vertices } => Shape::Polygon {
            vertices: vertices.iter().map(plain).collect(),
        },
        Obstacle::Block { min, max } => Shape::Block {
            min: plain(min),
            max: plain(max),
        },
    }
}

fn cell_state(cell: Cell) -> CellState {
    match cell {
        Cell::Free => CellState::Free,
        Cell::Occupied => CellState::Occupied,
        Cell::Unknown => CellState::Unknown,
    }
}

/// The outline of a polygon with a radius about it: arcs at its convex corners, at the others where the two sides meet.
fn rounded(polygon: &FootprintPolygon) -> Vec<[f64; 2]> {
    let (corners, radius) = (polygon.vertices(), polygon.rounding());
    if radius == 0.0 {
        return corners.iter().map(|v| [v.x, v.y]).collect();
    }
    let n = corners.len();
    // Outward normal of the side after corner i, as an angle.
    let normal = |i: usize| {
        let side = corners[(i + 1) % n] - corners[i % n];
        (-side.x).atan2(side.y)
    };
    let mut points = Vec::new();
    for (i, corner) in corners.iter().enumerate() {
        let from = normal(i + n - 1);
        let turn = angle::wrap(normal(i) - from);
        let (steps, reach) = if turn > 0.0 {
            (
                (turn / std::f64::consts::PI * ROUND as f64).ceil() as usize,
                radius,
            )
        } else {
            (0, radius / (0.5 * turn).cos())
        };
        for k in 0..=steps {
            let part = if steps == 0 {
                0.5
            } else {
                k as f64 / steps as f64
            };
            let (sin, cos) = (from + turn * part).sin_cos();
            points.push([corner.x + reach * cos, corner.y + reach * sin]);
        }
    }
    points
}

/// Corners of a footprint in the bike's frame, counter-clockwise, m.
fn outline(footprint: &Footprint) -> Vec<[f64; 2]> {
    let arc = |x: f64, radius: f64, from: f64, to: f64| {
        (0..=ROUND).map(move |i| {
            let angle = from + (to - from) * i as f64 / ROUND as f64;
            let p = Pose2::new(x, 0.0, angle);
            [x + radius * p.direction().x, radius * p.direction().y]
        })
    };
    use std::f64::consts::{FRAC_PI_2, PI};
    match footprint {
        Footprint::Point => Vec::new(),
        Footprint::Disc { radius } => arc(0.0, *radius, -PI, PI).skip(1).collect(),
        Footprint::Capsule {
            rear,
            front,
            radius,
        } => arc(*front, *radius, -FRAC_PI_2, FRAC_PI_2)
            .chain(arc(*rear, *radius, FRAC_PI_2, 3.0 * FRAC_PI_2))
            .collect(),
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
        Footprint::Polygon(polygon) => rounded(polygon),
        // Outlines added to `world` later are drawn as the discs that cover them.
        other => other
            .discs()
            .iter()
            .flat_map(|disc| {
                let centre = [disc.offset, disc.lateral];
                arc(0.0, disc.radius, -PI, PI)
                    .skip(1)
                    .map(move |[x, y]| [x + centre[0], y + centre[1]])
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_polygon_is_drawn_at_its_radius() {
        let l: Footprint = "polygon:0,0;3,0;3,1;1,1;1,2;0,2~0.25".parse().unwrap();
        let drawn = outline(&l);
        let Footprint::Polygon(polygon) = &l else {
            panic!("{l}")
        };
        let corners = polygon.vertices();
        for [x, y] in drawn {
            let p = Point2::new(x, y);
            let distance = (0..corners.len())
                .map(|i| {
                    let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                    let along = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
                    (p - (a + (b - a) * along)).norm()
                })
                .fold(f64::INFINITY, f64::min);
            assert!((distance - 0.25).abs() < 1e-12, "{p} {distance}");
        }
    }
}
