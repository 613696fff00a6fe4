//! What is drawn: outline, obstacles, and the stages of a plan.

use std::f64::consts::TAU;

use foxglove::messages::{
    ArrowPrimitive, Color, CubePrimitive, CylinderPrimitive, KeyValuePair, LinePrimitive, Point3,
    SceneEntity, SceneUpdate, TriangleListPrimitive, line_primitive,
};

use super::super::event::{BikeGeometry, PathSample, PlanEvent, Shape, StateSample};
use super::super::scene::triangulate;
use super::{ABOVE_GROUND, MAP, pose, timestamp, turn, vector};
use crate::clock::SimTime;

/// Entity id of the obstacles that stand.
pub(in crate::record) const STANDING: &str = "standing";
/// Entity id of the obstacles that move.
pub(in crate::record) const MOVING: &str = "moving";

/// How high obstacles are drawn, m. The plane models know no height.
const OBSTACLE_HEIGHT: f64 = 2.0;

const GREY: [f64; 4] = [0.45, 0.45, 0.5, 0.35];
const ORANGE: [f64; 4] = [0.95, 0.6, 0.1, 0.9];
const BLUE: [f64; 4] = [0.15, 0.45, 0.9, 0.9];
const GREEN: [f64; 4] = [0.1, 0.7, 0.3, 1.0];
const VIOLET: [f64; 4] = [0.6, 0.3, 0.8, 0.9];
const STONE: [f64; 4] = [0.55, 0.45, 0.35, 0.8];
const RED: [f64; 4] = [0.85, 0.2, 0.2, 0.9];
const SKY: [f64; 4] = [0.2, 0.7, 0.9, 0.9];

fn point(at: [f64; 2], z: f64) -> Point3 {
    Point3 {
        x: at[0],
        y: at[1],
        z,
    }
}

fn color([r, g, b, a]: [f64; 4]) -> Color {
    Color { r, g, b, a }
}

fn entity(time: SimTime, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        id: id.to_owned(),
        ..SceneEntity::default()
    }
}

fn scene(entities: Vec<SceneEntity>) -> SceneUpdate {
    SceneUpdate {
        deletions: Vec::new(),
        entities,
    }
}

fn line(
    kind: line_primitive::Type,
    points: impl Iterator<Item = [f64; 2]>,
    z: f64,
    thickness: f64,
    rgba: [f64; 4],
) -> LinePrimitive {
    LinePrimitive {
        r#type: kind as i32,
        pose: Some(pose(vector(0.0, 0.0, 0.0), turn(0.0, 0.0))),
        thickness,
        scale_invariant: false,
        points: points.map(|at| point(at, z)).collect(),
        color: Some(color(rgba)),
        ..LinePrimitive::default()
    }
}

/// The footprint flat on the ground under the bike, whatever its lean.
pub(in crate::record) fn footprint(
    time: SimTime,
    state: &StateSample,
    bike: &BikeGeometry,
) -> SceneUpdate {
    let (sin, cos) = state.heading_rad.sin_cos();
    let outline = bike
        .footprint
        .iter()
        .map(|&[x, y]| [state.x_m + cos * x - sin * y, state.y_m + sin * x + cos * y]);
    let mut shape = entity(time, "footprint");
    let z = 1.5 * ABOVE_GROUND;
    let kind = line_primitive::Type::LineLoop;
    shape.lines = vec![line(kind, outline, z, 0.03, SKY)];
    scene(vec![shape])
}

/// Obstacles as solid bodies under one entity id, which replaces the last.
pub(in crate::record) fn obstacles(time: SimTime, id: &str, shapes: &[Shape]) -> SceneUpdate {
    let mut solid = entity(time, id);
    let rgba = if id == STANDING { STONE } else { RED };
    for shape in shapes {
        match shape {
            Shape::Disc { center, radius } => solid.cylinders.push(CylinderPrimitive {
                pose: Some(pose(
                    vector(center[0], center[1], 0.5 * OBSTACLE_HEIGHT),
                    turn(0.0, 0.0),
                )),
                size: Some(vector(2.0 * radius, 2.0 * radius, OBSTACLE_HEIGHT)),
                bottom_scale: 1.0,
                top_scale: 1.0,
                color: Some(color(rgba)),
            }),
            Shape::Block { min, max } => solid.cubes.push(CubePrimitive {
                pose: Some(pose(
                    vector(
                        0.5 * (min[0] + max[0]),
                        0.5 * (min[1] + max[1]),
                        0.5 * OBSTACLE_HEIGHT,
                    ),
                    turn(0.0, 0.0),
                )),
                size: Some(vector(max[0] - min[0], max[1] - min[1], OBSTACLE_HEIGHT)),
                color: Some(color(rgba)),
            }),
            Shape::Polygon { vertices } => solid.triangles.push(prism(vertices, rgba)),
        }
    }
    scene(vec![solid])
}

/// A polygon drawn up to a solid: two faces and a wall for each edge.
fn prism(vertices: &[[f64; 2]], rgba: [f64; 4]) -> TriangleListPrimitive {
    let count = vertices.len() as u32;
    let floor = vertices.iter().map(|&at| point(at, 0.0));
    let roof = vertices.iter().map(|&at| point(at, OBSTACLE_HEIGHT));
    let mut indices = Vec::new();
    for [a, b, c] in triangulate(vertices) {
        let [a, b, c] = [a as u32, b as u32, c as u32];
        indices.extend([count + a, count + b, count + c]);
        indices.extend([a, c, b]);
    }
    for i in 0..count {
        let next = (i + 1) % count;
        indices.extend([i, next, count + next]);
        indices.extend([i, count + next, count + i]);
    }
    TriangleListPrimitive {
        pose: Some(pose(vector(0.0, 0.0, 0.0), turn(0.0, 0.0))),
        points: floor.chain(roof).collect(),
        color: Some(color(rgba)),
        indices,
        ..TriangleListPrimitive::default()
    }
}

/// A number beside a picture, as the shortest text that reads back as the same.
fn number(key: &str, value: f64) -> KeyValuePair {
    KeyValuePair {
        key: key.to_owned(),
        value: value.to_string(),
    }
}

/// The stages of a plan, each under an id of its own that a new plan replaces.
pub(in crate::record) fn plan_scene(time: SimTime, plan: &PlanEvent<'_>) -> SceneUpdate {
    let strip = line_primitive::Type::LineStrip;
    let drawn = |id: &str, lines: Vec<LinePrimitive>| {
        let mut shape = entity(time, id);
        shape.lines = lines;
        shape
    };
    let ground = ABOVE_GROUND;
    let edges = plan.tree.iter().flatten().copied();
    let tree = line(line_primitive::Type::LineList, edges, ground, 0.01, GREY);
    let coarse = line(
        strip,
        plan.coarse.iter().copied(),
        1.2 * ground,
        0.03,
        ORANGE,
    );
    let guide = line(strip, plan.guide.iter().copied(), 1.4 * ground, 0.03, BLUE);
    let path = plan.path.iter().map(|it| [it.x, it.y]);
    let path = line(strip, path, 1.8 * ground, 0.06, GREEN);
    let corridor = plan.corridor_half_width.map_or(Vec::new(), |half_width| {
        [half_width, -half_width]
            .map(|offset| {
                let side = offset_polyline(plan.guide, offset);
                line(strip, side.into_iter(), ground, 0.02, VIOLET)
            })
            .to_vec()
    });
    let mut corridor = drawn("corridor", corridor);
    let half_width = plan.corridor_half_width;
    corridor.metadata = half_width
        .map(|it| number("half_width_m", it))
        .into_iter()
        .collect();
    let mut goal = entity(time, "goal");
    if let Some(it) = plan.goal {
        let heading = it.heading.map(|it| number("heading_rad", it));
        goal.metadata = [
            number("x_m", it.position[0]),
            number("y_m", it.position[1]),
            number("tolerance_m", it.tolerance),
        ]
        .into_iter()
        .chain(heading)
        .collect();
        let ring = (0..36).map(|piece| {
            let (sin, cos) = (TAU * f64::from(piece) / 36.0).sin_cos();
            [
                it.position[0] + it.tolerance * cos,
                it.position[1] + it.tolerance * sin,
            ]
        });
        let kind = line_primitive::Type::LineLoop;
        goal.lines = vec![line(kind, ring, ground, 0.03, GREEN)];
        if let Some(heading) = it.heading {
            goal.arrows = vec![ArrowPrimitive {
                pose: Some(pose(
                    vector(it.position[0], it.position[1], ground),
                    turn(heading, 0.0),
                )),
                shaft_length: 0.6,
                shaft_diameter: 0.06,
                head_length: 0.2,
                head_diameter: 0.15,
                color: Some(color(GREEN)),
            }];
        }
    }
    scene(vec![
        drawn("tree", vec![tree]),
        drawn("coarse", vec![coarse]),
        drawn("guide", vec![guide]),
        corridor,
        drawn("path", vec![path]),
        goal,
    ])
}

/// The curve the follower was given, beside the plan's stages.
pub(in crate::record) fn followed_scene(time: SimTime, path: &[PathSample]) -> SceneUpdate {
    let mut shape = entity(time, "followed");
    let points = path.iter().map(|it| [it.x, it.y]);
    let kind = line_primitive::Type::LineStrip;
    shape.lines = vec![line(kind, points, 1.6 * ABOVE_GROUND, 0.03, SKY)];
    scene(vec![shape])
}

/// A polyline moved to its left by `offset`, corners mitred at most twice as far.
pub(super) fn offset_polyline(vertices: &[[f64; 2]], offset: f64) -> Vec<[f64; 2]> {
    let normals: Vec<[f64; 2]> = vertices
        .windows(2)
        .map(|pair| {
            let along = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = along[0].hypot(along[1]);
            if length > 0.0 {
                [-along[1] / length, along[0] / length]
            } else {
                [0.0; 2]
            }
        })
        .collect();
    let Some(last) = normals.len().checked_sub(1) else {
        return Vec::new();
    };
    vertices
        .iter()
        .enumerate()
        .map(|(i, vertex)| {
            let (a, b) = (normals[i.saturating_sub(1)], normals[i.min(last)]);
            let sum = [a[0] + b[0], a[1] + b[1]];
            // |sum|² / 2 = 1 + cos of the turn; the mitre is sum over that.
            let half_square = 0.5 * (sum[0] * sum[0] + sum[1] * sum[1]);
            let scale = offset / half_square.max(0.5);
            [vertex[0] + scale * sum[0], vertex[1] + scale * sum[1]]
        })
        .collect()
}
