//! What is on the wire: topics, their schemas, and events turned into messages.
//!
//! Well-known Foxglove messages where one fits, so that viewers draw them unasked;
//! flat messages of our own where numbers are all there is. Units are SI.

use std::f64::consts::TAU;

use foxglove::Encode;
use foxglove::messages::{
    ArrowPrimitive, Color, CubePrimitive, CylinderPrimitive, FrameTransform, FrameTransforms, Grid,
    JointState, JointStates, KeyValuePair, LaserScan, LinePrimitive, Log, PackedElementField,
    Point3, Pose, PoseInFrame, PosesInFrame, Quaternion, SceneEntity, SceneUpdate, Timestamp,
    TriangleListPrimitive, Vector2, Vector3, line_primitive, log, packed_element_field,
};

use super::event::{
    BikeGeometry, BikeState, CellState, ControlDebug, GridSample, LogLevel, PathSample, PlanEvent,
    ScanSample, Shape, StateSample,
};
use super::scene::triangulate;
use crate::clock::SimTime;

/// The fixed frame of the world.
pub(super) const MAP: &str = "map";
/// The bike's own frame, at the rear contact.
pub(super) const BASE: &str = "base_link";
/// The frame of the laser.
pub(super) const LASER: &str = "laser";
/// The frame of the steered front end.
const FORK: &str = "fork";
/// The frame of the balancer.
const BALANCER: &str = "balancer";

/// How high obstacles are drawn, m. The plane models know no height.
const OBSTACLE_HEIGHT: f64 = 2.0;
/// Lines on the ground are drawn this far above it, m, so that the map does not hide them.
const ABOVE_GROUND: f64 = 0.02;

const GREY: [f64; 4] = [0.45, 0.45, 0.5, 0.35];
const ORANGE: [f64; 4] = [0.95, 0.6, 0.1, 0.9];
const BLUE: [f64; 4] = [0.15, 0.45, 0.9, 0.9];
const GREEN: [f64; 4] = [0.1, 0.7, 0.3, 1.0];
const VIOLET: [f64; 4] = [0.6, 0.3, 0.8, 0.9];
const STONE: [f64; 4] = [0.55, 0.45, 0.35, 0.8];
const RED: [f64; 4] = [0.85, 0.2, 0.2, 0.9];
const SKY: [f64; 4] = [0.2, 0.7, 0.9, 0.9];

/// A topic of the recording; the order is that of the channels in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topic {
    Frames,
    Map,
    Occupancy,
    PlanPath,
    PlanScene,
    PlanSamples,
    Followed,
    Pose,
    Joints,
    State,
    Control,
    Footprint,
    Obstacles,
    Scan,
    Belief,
    Events,
    Log,
}

impl Topic {
    pub(super) const ALL: [Self; 17] = [
        Self::Frames,
        Self::Map,
        Self::Occupancy,
        Self::PlanPath,
        Self::PlanScene,
        Self::PlanSamples,
        Self::Followed,
        Self::Pose,
        Self::Joints,
        Self::State,
        Self::Control,
        Self::Footprint,
        Self::Obstacles,
        Self::Scan,
        Self::Belief,
        Self::Events,
        Self::Log,
    ];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Frames => "/tf",
            Self::Map => "/map",
            Self::Occupancy => "/map/occupancy",
            Self::PlanPath => "/plan/path",
            Self::PlanScene => "/plan/scene",
            Self::PlanSamples => "/plan/samples",
            Self::Followed => "/plan/followed",
            Self::Pose => "/bike/pose",
            Self::Joints => "/bike/joints",
            Self::State => "/bike/state",
            Self::Control => "/control/debug",
            Self::Footprint => "/bike/footprint",
            Self::Obstacles => "/obstacles",
            Self::Scan => "/scan",
            Self::Belief => "/belief",
            Self::Events => "/events",
            Self::Log => "/log",
        }
    }

    /// Whether its messages are placed in the world, other than saying where frames are.
    pub(super) const fn is_framed(self) -> bool {
        matches!(
            self,
            Self::Map
                | Self::Occupancy
                | Self::PlanPath
                | Self::PlanScene
                | Self::PlanSamples
                | Self::Followed
                | Self::Pose
                | Self::Footprint
                | Self::Obstacles
                | Self::Scan
                | Self::Belief
        )
    }

    /// The schema of the topic's messages and their encoding.
    pub(super) fn schema(self) -> (Option<foxglove::Schema>, String) {
        fn of<M: Encode>() -> (Option<foxglove::Schema>, String) {
            (M::get_schema(), M::get_message_encoding())
        }
        match self {
            Self::Frames => of::<FrameTransforms>(),
            Self::Map | Self::Occupancy | Self::Belief => of::<Grid>(),
            Self::PlanPath => of::<PosesInFrame>(),
            Self::PlanScene | Self::Footprint | Self::Obstacles => of::<SceneUpdate>(),
            Self::PlanSamples | Self::Followed => of::<PathTable>(),
            Self::Pose => of::<PoseInFrame>(),
            Self::Joints => of::<JointStates>(),
            Self::State => of::<BikeState>(),
            Self::Control => of::<ControlDebug>(),
            Self::Scan => of::<LaserScan>(),
            Self::Events => of::<RunEvent>(),
            Self::Log => of::<Log>(),
        }
    }
}

/// A path as columns, with what a pose cannot carry.
#[derive(foxglove::Encode)]
pub(super) struct PathTable {
    time_s: f64,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Vec<f64>,
    curvature_per_m: Vec<f64>,
    s_m: Vec<f64>,
    speed_mps: Vec<f64>,
}

/// Something a program may want to find.
#[derive(foxglove::Encode)]
pub(super) struct RunEvent {
    pub(super) time_s: f64,
    pub(super) kind: String,
    pub(super) text: String,
    pub(super) value: f64,
}

pub(super) fn path_table(time: SimTime, path: &[PathSample]) -> PathTable {
    let column = |value: fn(&PathSample) -> f64| path.iter().map(value).collect();
    PathTable {
        time_s: time.seconds(),
        x_m: column(|it| it.x),
        y_m: column(|it| it.y),
        heading_rad: column(|it| it.heading),
        curvature_per_m: column(|it| it.curvature),
        s_m: column(|it| it.s),
        speed_mps: column(|it| it.speed),
    }
}

pub(super) fn timestamp(time: SimTime) -> Timestamp {
    let nanoseconds = time.nanoseconds();
    // The message counts 136 years; a simulation ends before that.
    let seconds = u32::try_from(nanoseconds / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (nanoseconds % 1_000_000_000) as u32)
}

fn vector(x: f64, y: f64, z: f64) -> Vector3 {
    Vector3 { x, y, z }
}

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

/// Turn about z by `yaw`, then about the turned x by `roll`.
fn turn(yaw: f64, roll: f64) -> Quaternion {
    let (sin_yaw, cos_yaw) = (0.5 * yaw).sin_cos();
    let (sin_roll, cos_roll) = (0.5 * roll).sin_cos();
    Quaternion {
        x: cos_yaw * sin_roll,
        y: sin_yaw * sin_roll,
        z: sin_yaw * cos_roll,
        w: cos_yaw * cos_roll,
    }
}

/// Turn about z by `yaw`, then about the turned y by `pitch`, nose down.
fn yaw_and_pitch(yaw: f64, pitch: f64) -> Quaternion {
    let (sin_yaw, cos_yaw) = (0.5 * yaw).sin_cos();
    let (sin_pitch, cos_pitch) = (0.5 * pitch).sin_cos();
    Quaternion {
        x: -sin_yaw * sin_pitch,
        y: cos_yaw * sin_pitch,
        z: sin_yaw * cos_pitch,
        w: cos_yaw * cos_pitch,
    }
}

/// First turned by `b` in the frame that `a` has turned.
fn product(a: &Quaternion, b: &Quaternion) -> Quaternion {
    Quaternion {
        x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    }
}

fn pose(position: Vector3, orientation: Quaternion) -> Pose {
    Pose {
        position: Some(position),
        orientation: Some(orientation),
    }
}

/// The angle of the handlebar about the body's own vertical.
///
/// `steer` is the angle between the wheels' tracks on the ground; the fork turns
/// about an axis that leans with the body: `tan psi_h = tan psi cos alpha`.
fn handlebar_angle(steer: f64, roll: f64) -> f64 {
    (steer.tan() * roll.cos()).atan()
}

/// map → base_link → {laser, fork, balancer}.
pub(super) fn frames(time: SimTime, state: &StateSample, bike: &BikeGeometry) -> FrameTransforms {
    let frame = |parent: &str, child: &str, translation, rotation| FrameTransform {
        timestamp: Some(timestamp(time)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(translation),
        rotation: Some(rotation),
    };
    let [x, y, z] = bike.laser_position;
    let on_mount = yaw_and_pitch(bike.laser_yaw, bike.laser_pitch);
    let laser = if bike.laser_is_level {
        product(&turn(0.0, -state.roll_rad), &on_mount)
    } else {
        on_mount
    };
    let fork = handlebar_angle(state.steer_rad, state.roll_rad);
    FrameTransforms {
        transforms: vec![
            frame(
                MAP,
                BASE,
                vector(state.x_m, state.y_m, 0.0),
                turn(state.heading_rad, state.roll_rad),
            ),
            frame(BASE, LASER, vector(x, y, z), laser),
            frame(
                BASE,
                FORK,
                vector(bike.wheelbase, 0.0, 0.0),
                turn(fork, 0.0),
            ),
            frame(
                BASE,
                BALANCER,
                vector(bike.pivot_x, 0.0, bike.pivot_height),
                turn(0.0, state.balancer_rad),
            ),
        ],
    }
}

pub(super) fn bike_pose(time: SimTime, state: &StateSample) -> PoseInFrame {
    PoseInFrame {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        pose: Some(pose(
            vector(state.x_m, state.y_m, 0.0),
            turn(state.heading_rad, 0.0),
        )),
    }
}

pub(super) fn joints(time: SimTime, state: &StateSample, bike: &BikeGeometry) -> JointStates {
    // An absent quantity is left out, as the schema provides.
    let known = |value: f64| value.is_finite().then_some(value);
    let joint =
        |name: &str, position: f64, velocity: f64, acceleration: f64, effort: f64| JointState {
            name: name.to_owned(),
            position: known(position),
            velocity: known(velocity),
            acceleration: known(acceleration),
            effort: known(effort),
        };
    let radius = bike.wheel_radius;
    let absent = f64::NAN;
    JointStates {
        timestamp: Some(timestamp(time)),
        joints: vec![
            joint(
                "steer",
                state.steer_rad,
                state.steer_rate_radps,
                absent,
                absent,
            ),
            joint(
                "balancer",
                state.balancer_rad,
                state.balancer_rate_radps,
                state.balancer_acceleration_radps2,
                state.balancer_torque_nm,
            ),
            joint(
                "rear_wheel",
                state.distance_m / radius,
                state.speed_mps / radius,
                state.acceleration_mps2 / radius,
                state.drive_force_n * radius,
            ),
            // The front contact runs along the steered wheel without slip; how far it
            // has come depends on the way taken, which the state does not keep.
            joint(
                "front_wheel",
                absent,
                state.speed_mps / (radius * state.steer_rad.cos()),
                absent,
                absent,
            ),
        ],
    }
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
pub(super) fn footprint(time: SimTime, state: &StateSample, bike: &BikeGeometry) -> SceneUpdate {
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
pub(super) fn obstacles(time: SimTime, id: &str, shapes: &[Shape]) -> SceneUpdate {
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

/// Entity id of the obstacles that stand.
pub(super) const STANDING: &str = "standing";
/// Entity id of the obstacles that move.
pub(super) const MOVING: &str = "moving";

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

pub(super) fn plan_path(time: SimTime, path: &[PathSample]) -> PosesInFrame {
    PosesInFrame {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        poses: path
            .iter()
            .map(|it| pose(vector(it.x, it.y, ABOVE_GROUND), turn(it.heading, 0.0)))
            .collect(),
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
pub(super) fn plan_scene(time: SimTime, plan: &PlanEvent<'_>) -> SceneUpdate {
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
pub(super) fn followed_scene(time: SimTime, path: &[PathSample]) -> SceneUpdate {
    let mut shape = entity(time, "followed");
    let points = path.iter().map(|it| [it.x, it.y]);
    let kind = line_primitive::Type::LineStrip;
    shape.lines = vec![line(kind, points, 1.6 * ABOVE_GROUND, 0.03, SKY)];
    scene(vec![shape])
}

/// A polyline moved to its left by `offset`, corners mitred at most twice as far.
fn offset_polyline(vertices: &[[f64; 2]], offset: f64) -> Vec<[f64; 2]> {
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

pub(super) fn scan(scan: &ScanSample<'_>) -> LaserScan {
    let steps = scan.ranges.len().saturating_sub(1) as f64;
    LaserScan {
        timestamp: Some(timestamp(scan.stamp)),
        frame_id: LASER.to_owned(),
        pose: Some(pose(vector(0.0, 0.0, 0.0), turn(0.0, 0.0))),
        start_angle: scan.start_angle,
        end_angle: scan.start_angle + scan.angle_step * steps,
        ranges: scan.ranges.to_vec(),
        intensities: Vec::new(),
    }
}

/// The map in colour: free light, occupied dark, unknown grey and half clear.
pub(super) fn map_colour(time: SimTime, map: &GridSample<'_>) -> Grid {
    let data: Vec<u8> = map
        .cells
        .iter()
        .flat_map(|cell| match cell {
            CellState::Free => [235, 235, 235, 255],
            CellState::Occupied => [40, 40, 48, 255],
            CellState::Unknown => [140, 140, 140, 128],
        })
        .collect();
    grid(time, map, &["red", "green", "blue", "alpha"], data)
}

/// The map as numbers: 0 free, 100 occupied, 255 unknown.
pub(super) fn map_occupancy(time: SimTime, map: &GridSample<'_>) -> Grid {
    let data = map
        .cells
        .iter()
        .map(|cell| match cell {
            CellState::Free => 0,
            CellState::Occupied => 100,
            CellState::Unknown => 255,
        })
        .collect();
    grid(time, map, &["occupancy"], data)
}

fn grid(time: SimTime, map: &GridSample<'_>, fields: &[&str], data: Vec<u8>) -> Grid {
    let stride = fields.len() as u32;
    Grid {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        pose: Some(pose(
            vector(map.origin[0], map.origin[1], 0.0),
            turn(map.yaw, 0.0),
        )),
        column_count: map.width as u32,
        cell_size: Some(Vector2 {
            x: map.resolution,
            y: map.resolution,
        }),
        row_stride: map.width as u32 * stride,
        cell_stride: stride,
        fields: (0..)
            .zip(fields)
            .map(|(offset, name)| PackedElementField {
                name: (*name).to_owned(),
                offset,
                r#type: packed_element_field::NumericType::Uint8 as i32,
            })
            .collect(),
        data: data.into(),
    }
}

pub(super) fn log_line(time: SimTime, level: LogLevel, text: &str) -> Log {
    let level = match level {
        LogLevel::Debug => log::Level::Debug,
        LogLevel::Info => log::Level::Info,
        LogLevel::Warning => log::Level::Warning,
        LogLevel::Error => log::Level::Error,
    };
    Log {
        timestamp: Some(timestamp(time)),
        level: level as i32,
        message: text.to_owned(),
        name: "bikebot".to_owned(),
        file: String::new(),
        line: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn rotate(q: &Quaternion, v: [f64; 3]) -> [f64; 3] {
        let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
            q.w, q.x, q.y, q.z,
        ));
        let v = q * nalgebra::Vector3::from(v);
        [v.x, v.y, v.z]
    }

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn a_point_of_the_body_lies_where_the_plane_model_puts_it() {
        // dynamics-and-control §1: at height h, Y = -h sin(roll), Z = h cos(roll).
        let (yaw, roll, height) = (0.7, 0.2, 0.52);
        let [x, y, z] = rotate(&turn(yaw, roll), [0.0, 0.0, height]);
        let left = -height * roll.sin();
        assert!(close(
            [x, y, z],
            [-yaw.sin() * left, yaw.cos() * left, height * roll.cos()]
        ));
        let forward = rotate(&turn(yaw, roll), [1.0, 0.0, 0.0]);
        assert!(close(forward, [yaw.cos(), yaw.sin(), 0.0]));
    }

    #[test]
    fn the_fork_of_a_leaning_bike_points_along_the_wheels_track() {
        // Turned about the leaning vertical, the wheel's axis of travel must have the
        // ground direction of the ground-projected steering angle.
        let (roll, steer) = (0.3f64, 0.5f64);
        let [x, y, z] = rotate(&turn(handlebar_angle(steer, roll), 0.0), [1.0, 0.0, 0.0]);
        let [x, y, z] = rotate(&turn(0.0, roll), [x, y, z]);
        // The wheel's plane meets the ground along the cross product of its axle with z.
        let axle = rotate(
            &turn(0.0, roll),
            rotate(&turn(handlebar_angle(steer, roll), 0.0), [0.0, 1.0, 0.0]),
        );
        assert!((axle[0] * x + axle[1] * y + axle[2] * z).abs() < 1e-12);
        let track = [axle[1], -axle[0]];
        assert!(((track[1]).atan2(track[0]) - steer).abs() < 1e-12);
    }

    #[test]
    fn frames_hang_together_from_the_map() {
        let bike = BikeGeometry {
            wheelbase: 1.12,
            wheel_radius: 0.33,
            pivot_x: 0.3,
            pivot_height: 0.8,
            laser_position: [0.9, 0.0, 0.6],
            laser_yaw: 0.1,
            laser_pitch: 0.0,
            laser_is_level: false,
            footprint: Vec::new(),
        };
        let sent = frames(SimTime::ZERO, &StateSample::default(), &bike);
        let names: Vec<_> = sent
            .transforms
            .iter()
            .map(|it| (it.parent_frame_id.as_str(), it.child_frame_id.as_str()))
            .collect();
        assert_eq!(
            names,
            [(MAP, BASE), (BASE, LASER), (BASE, FORK), (BASE, BALANCER)]
        );
    }

    #[test]
    fn beams_in_the_frame_of_the_laser_lie_where_the_scanner_fires_them() {
        let pose = bikebot_geometry::Pose2::new(2.0, -1.0, 0.6);
        let state = StateSample {
            x_m: 2.0,
            y_m: -1.0,
            heading_rad: 0.6,
            roll_rad: 0.2,
            ..StateSample::default()
        };
        for tilts_with_roll in [true, false] {
            let params = bikebot_dynamics::LaserParams {
                mount_y: 0.1,
                mount_yaw_deg: 20.0,
                mount_pitch_deg: 5.0,
                tilts_with_roll,
                ..bikebot_dynamics::LaserParams::default()
            };
            let scanner = bikebot_dynamics::LaserScanner::new(&params).unwrap();
            let bike = BikeGeometry {
                wheelbase: 1.12,
                wheel_radius: 0.33,
                pivot_x: 0.3,
                pivot_height: 0.8,
                laser_position: [params.mount_x, params.mount_y, params.mount_z],
                laser_yaw: params.mount_yaw_deg.to_radians(),
                laser_pitch: params.mount_pitch_deg.to_radians(),
                laser_is_level: !tilts_with_roll,
                footprint: Vec::new(),
            };
            let sent = frames(SimTime::ZERO, &state, &bike);
            let place = |frame: &FrameTransform, at: [f64; 3]| {
                let from = frame.translation.as_ref().unwrap();
                let [x, y, z] = rotate(frame.rotation.as_ref().unwrap(), at);
                [from.x + x, from.y + y, from.z + z]
            };
            for angle in [-2.0_f64, 0.0, 1.2] {
                let at = [3.0 * angle.cos(), 3.0 * angle.sin(), 0.0];
                let at = place(&sent.transforms[0], place(&sent.transforms[1], at));
                let expected = scanner.ray(angle, &pose, 0.2).at(3.0);
                assert!(close(at, [expected.x, expected.y, expected.z]), "{angle}");
            }
        }
    }

    #[test]
    fn the_map_keeps_its_rows_from_below_and_its_yaw() {
        let cells = [
            CellState::Free,
            CellState::Occupied,
            CellState::Unknown,
            CellState::Free,
            CellState::Free,
            CellState::Occupied,
        ];
        let map = GridSample {
            width: 3,
            height: 2,
            resolution: 0.5,
            origin: [1.0, -2.0],
            yaw: FRAC_PI_2,
            cells: &cells,
        };
        let numbers = map_occupancy(SimTime::ZERO, &map);
        assert_eq!(&numbers.data[..], [0, 100, 255, 0, 0, 100]);
        assert_eq!((numbers.column_count, numbers.row_stride), (3, 3));
        let colours = map_colour(SimTime::ZERO, &map);
        assert_eq!((colours.row_stride, colours.cell_stride), (12, 4));
        assert_eq!(&colours.data[4..8], [40, 40, 48, 255]);
        let corner = colours.pose.unwrap();
        let along = rotate(&corner.orientation.unwrap(), [1.0, 0.0, 0.0]);
        assert!(close(along, [0.0, 1.0, 0.0]));
    }

    #[test]
    fn the_corridor_keeps_its_distance_from_a_bent_guide() {
        let guide = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]];
        let left = offset_polyline(&guide, 0.5);
        let expected = [[0.0, 0.5], [3.5, 0.5], [3.5, 3.0]];
        for (got, want) in left.iter().zip(expected) {
            assert!((got[0] - want[0]).hypot(got[1] - want[1]) < 1e-12);
        }
        assert!(offset_polyline(&guide[..1], 0.5).is_empty());
        assert!(offset_polyline(&[], 0.5).is_empty());
    }

    #[test]
    fn an_absent_quantity_is_left_out_of_the_joints() {
        let bike = BikeGeometry {
            wheelbase: 1.0,
            wheel_radius: 0.5,
            pivot_x: 0.0,
            pivot_height: 0.0,
            laser_position: [0.0; 3],
            laser_yaw: 0.0,
            laser_pitch: 0.0,
            laser_is_level: false,
            footprint: Vec::new(),
        };
        let state = StateSample {
            speed_mps: 2.0,
            ..StateSample::default()
        };
        let sent = joints(SimTime::ZERO, &state, &bike);
        assert_eq!(sent.joints[2].velocity, Some(4.0));
        assert_eq!(sent.joints[2].position, None);
        assert_eq!(sent.joints[0].position, None);
    }
}
