//! What is in the way, as bodies of the same Rapier world, and the hull that meets it.
//!
//! Obstacles are prisms from the ground up to one height. The hull is the bike's footprint as a low
//! prism on the frame: it meets an obstacle where and when the plane outline of the monitors does, but for the
//! few millimetres by which a leaning frame carries its lowest part aside.

use bikebot_geometry::Point2;
use bikebot_world::{Cell, Footprint, Obstacle, World};
use nalgebra::{Unit, Vector3};
use rapier3d_f64::prelude::{ColliderBuilder, Pose, Rotation, Vector};

/// The hull reaches from here, m: clear of the ground whatever the bike's pitch.
const HULL_BOTTOM: f64 = 0.02;
/// … to here, m.
const HULL_TOP: f64 = 0.12;
/// Edges that stand for a full turn of a rounded outline: the polygon stays within 1.5 mm of 0.3 m.
const EDGES: usize = 64;

/// Every obstacle of a world as high as `height` (m), its solid cells merged to rectangles, and the edge of its field.
pub(super) fn colliders(world: &World, height: f64) -> Vec<ColliderBuilder> {
    let obstacles = world.obstacles().iter();
    let mut all: Vec<ColliderBuilder> = obstacles.filter_map(|it| prism(it, height)).collect();
    if let Some(grid) = world.grid() {
        all.extend(
            grid.rectangles(|cell| cell != Cell::Free)
                .into_iter()
                .filter_map(|rectangle| prism(&grid.rectangle_obstacle(rectangle), height)),
        );
        if grid.origin.heading != 0.0 {
            let corners = grid.corners();
            for (i, corner) in corners.iter().enumerate() {
                let side = corners[(i + 1) % 4] - corner;
                all.extend(wall(*corner, side.y, -side.x));
            }
        }
    }
    let bounds = world.bounds();
    all.extend(wall(bounds.min, -1.0, 0.0));
    all.extend(wall(bounds.min, 0.0, -1.0));
    all.extend(wall(bounds.max, 1.0, 0.0));
    all.extend(wall(bounds.max, 0.0, 1.0));
    all
}

/// Everything beyond a line through `point`, on the side of the direction `(x, y)`.
fn wall(point: Point2, x: f64, y: f64) -> Option<ColliderBuilder> {
    let inward = Unit::try_new(Vector3::new(-x, -y, 0.0), 0.0)?;
    let normal = Unit::new_unchecked(Vector::new(inward.x, inward.y, 0.0));
    Some(ColliderBuilder::halfspace(normal).translation(Vector::new(point.x, point.y, 0.0)))
}

/// An obstacle from the ground up to `height` (m).
pub(super) fn prism(obstacle: &Obstacle, height: f64) -> Option<ColliderBuilder> {
    let half = 0.5 * height;
    match obstacle {
        Obstacle::Disc { center, radius } => {
            // Rapier's cylinders lie along y.
            let upright = Rotation::from_rotation_x(std::f64::consts::FRAC_PI_2);
            let pose = Pose::from_parts(Vector::new(center.x, center.y, half), upright);
            Some(ColliderBuilder::cylinder(half, *radius).position(pose))
        }
        Obstacle::Block { min, max } => {
            let size = 0.5 * (max - min);
            Some(
                ColliderBuilder::cuboid(size.x, size.y, half).translation(Vector::new(
                    0.5 * (min.x + max.x),
                    0.5 * (min.y + max.y),
                    half,
                )),
            )
        }
        // Its walls: whoever comes from outside meets them, convex or not.
        Obstacle::Polygon { vertices } => {
            let n = vertices.len();
            let corners = vertices
                .iter()
                .flat_map(|v| [0.0, height].map(|z| Vector::new(v.x, v.y, z)))
                .collect();
            let triangles = (0..n)
                .flat_map(|i| {
                    let [a, b] = [i, (i + 1) % n].map(|k| 2 * k as u32);
                    [[a, b, b + 1], [a, b + 1, a + 1]]
                })
                .collect();
            ColliderBuilder::trimesh(corners, triangles).ok()
        }
    }
}

/// The footprint as prisms in the frame of the rear contact, about the frame's centre of gravity `centre`.
pub(super) fn hull(footprint: &Footprint, centre: &Vector3<f64>) -> Vec<ColliderBuilder> {
    footprint
        .convex_parts()
        .into_iter()
        .filter_map(|(core, radius)| {
            let outline: Vec<Point2> = if radius > 0.0 {
                core.iter()
                    .flat_map(|v| {
                        (0..EDGES).map(move |i| {
                            let turn = std::f64::consts::TAU * i as f64 / EDGES as f64;
                            v + radius * bikebot_geometry::Vector2::new(turn.cos(), turn.sin())
                        })
                    })
                    .collect()
            } else {
                core
            };
            let points: Vec<Vector> = outline
                .iter()
                .flat_map(|v| {
                    [HULL_BOTTOM, HULL_TOP].map(|z| Vector::new(v.x - centre.x, v.y, z - centre.z))
                })
                .collect();
            // A point has no hull.
            ColliderBuilder::convex_hull(&points)
        })
        .collect()
}
