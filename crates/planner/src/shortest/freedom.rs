//! Exact tests whether a straight leg, or a piece of a circle, keeps its distance from everything.

use super::tangent::{Span, polar, wrap_about};
use bikebot_geometry::{Point2, Vector2};
use bikebot_world::{BoundaryPiece, Bounds, World};

/// Blocked pieces of a circle narrower than this (rad) are rounding.
const NARROWEST: f64 = 1e-9;

/// A half plane n · x ≤ c that contains the field; n of unit length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wall {
    pub(super) normal: Vector2,
    pub(super) offset: f64,
}

/// The edges of the field: its bounds, and those of a turned grid.
pub(super) fn walls(world: &World) -> Vec<Wall> {
    let b = world.bounds();
    let mut walls: Vec<_> = [
        (Vector2::x(), b.max.x),
        (-Vector2::x(), -b.min.x),
        (Vector2::y(), b.max.y),
        (-Vector2::y(), -b.min.y),
    ]
    .into_iter()
    .map(|(normal, offset)| Wall { normal, offset })
    .collect();
    if let Some(grid) = world.grid().filter(|g| g.origin.heading != 0.0) {
        let corners = grid.corners();
        walls.extend((0..4).map(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            let along = (b - a).normalize();
            let normal = Vector2::new(along.y, -along.x);
            Wall {
                normal,
                offset: normal.dot(&a.coords),
            }
        }));
    }
    walls
}

/// Corners of a block, counter-clockwise.
pub(super) fn block_corners(min: Point2, max: Point2) -> [Point2; 4] {
    [
        min,
        Point2::new(max.x, min.y),
        max,
        Point2::new(min.x, max.y),
    ]
}

fn point_segment_squared(p: Point2, a: Point2, b: Point2) -> f64 {
    let (span, offset) = (b - a, p - a);
    let length_squared = span.norm_squared();
    let t = if length_squared > 0.0 {
        (offset.dot(&span) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (offset - span * t).norm_squared()
}

/// Squared distance (m²) between two segments; 0 where they cross.
fn segments_squared(p: Point2, q: Point2, a: Point2, b: Point2) -> f64 {
    let (u, v) = (q - p, b - a);
    let (a_side, b_side) = (u.perp(&(a - p)), u.perp(&(b - p)));
    let (p_side, q_side) = (v.perp(&(p - a)), v.perp(&(q - a)));
    if a_side * b_side < 0.0 && p_side * q_side < 0.0 {
        return 0.0;
    }
    point_segment_squared(p, a, b)
        .min(point_segment_squared(q, a, b))
        .min(point_segment_squared(a, p, q))
        .min(point_segment_squared(b, p, q))
}

/// Whether all of the leg from `p` to `q` is at least `distance` (m) from the boundary of every obstacle and of the field.
pub(super) fn is_leg_clear(
    world: &World,
    walls: &[Wall],
    p: Point2,
    q: Point2,
    distance: f64,
) -> bool {
    let beyond = |x: Point2| {
        walls
            .iter()
            .any(|w| w.normal.dot(&x.coords) > w.offset - distance)
    };
    if beyond(p) || beyond(q) {
        return false;
    }
    let squared = distance * distance;
    let (min, max) = (p.inf(&q), p.sup(&q));
    let middle = p + (q - p) * 0.5;
    let half = (q - p) * 0.5;
    // Of the box only its extent across the leg matters here.
    let across = Vector2::new(half.y.abs(), half.x.abs());
    let reach = distance * half.norm();
    let near = |b: &Bounds| {
        if min.x - distance > b.max.x
            || max.x + distance < b.min.x
            || min.y - distance > b.max.y
            || max.y + distance < b.min.y
        {
            return false;
        }
        let box_half = (b.max - b.min) * 0.5;
        let off = b.min + box_half - middle;
        half.perp(&off).abs() <= across.dot(&box_half) + reach
    };
    let mut clear = true;
    world.visit_boundary(near, |_, piece| {
        clear = match piece {
            BoundaryPiece::Side { start, end, .. } => segments_squared(p, q, start, end) >= squared,
            BoundaryPiece::Disc { center, radius } => {
                let least = radius + distance;
                point_segment_squared(center, p, q) >= least * least
            }
            BoundaryPiece::Block { min, max } => {
                let ring = block_corners(min, max);
                (0..4).all(|i| segments_squared(p, q, ring[i], ring[(i + 1) % 4]) >= squared)
            }
        };
        clear
    });
    clear
}

/// The angles at which the circle about `center` of `radius` meets the line n · x = c.
fn meets_line(center: Point2, radius: f64, normal: Vector2, offset: f64, angles: &mut Vec<f64>) {
    let cos = (offset - normal.dot(&center.coords)) / radius;
    if cos.abs() <= 1.0 {
        let (towards, turn) = (normal.y.atan2(normal.x), cos.acos());
        angles.extend([towards - turn, towards + turn]);
    }
}

/// The angles at which it meets the circle about `other` of radius `reach`.
fn meets_circle(center: Point2, radius: f64, other: Point2, reach: f64, angles: &mut Vec<f64>) {
    let (towards, apart) = polar(other - center);
    let cos = (radius * radius + apart * apart - reach * reach) / (2.0 * radius * apart);
    if apart > 0.0 && cos.abs() <= 1.0 {
        let turn = cos.acos();
        angles.extend([towards - turn, towards + turn]);
    }
}

/// The parts of `span` on the circle about `center` of `radius` that lie in free space, at least `distance` (m) from every
/// boundary.
pub(super) fn clear_parts(
    world: &World,
    walls: &[Wall],
    center: Point2,
    radius: f64,
    span: Span,
    distance: f64,
) -> Vec<Span> {
    let mut blocked: Vec<(f64, f64)> = Vec::new();
    let mut angles = Vec::new();
    let at = |t: f64| center + super::tangent::unit(span.alpha + t) * radius;
    // Between the places where the circle meets the outline of what is too near, one place decides.
    let mut decide = |angles: &mut Vec<f64>, is_near: &dyn Fn(Point2) -> bool| {
        for angle in &mut *angles {
            *angle = wrap_about(*angle - span.alpha, 0.5 * span.width);
        }
        angles.retain(|t| *t > 0.0 && *t < span.width);
        angles.extend([0.0, span.width]);
        angles.sort_unstable_by(f64::total_cmp);
        for pair in angles.windows(2) {
            if pair[1] - pair[0] > NARROWEST && is_near(at(0.5 * (pair[0] + pair[1]))) {
                blocked.push((pair[0], pair[1]));
            }
        }
        angles.clear();
    };
    for wall in walls {
        meets_line(
            center,
            radius,
            wall.normal,
            wall.offset - distance,
            &mut angles,
        );
        decide(&mut angles, &|p| {
            wall.normal.dot(&p.coords) > wall.offset - distance
        });
    }
    let reach = radius + distance;
    let squared = distance * distance;
    let near = |b: &Bounds| {
        let dx = (b.min.x - center.x).max(center.x - b.max.x).max(0.0);
        let dy = (b.min.y - center.y).max(center.y - b.max.y).max(0.0);
        dx * dx + dy * dy <= reach * reach
    };
    world.visit_boundary(near, |_, piece| {
        let mut side = |a: Point2, b: Point2| {
            let length = (b - a).norm();
            if length == 0.0 || point_segment_squared(center, a, b) >= reach * reach {
                return;
            }
            let normal = Vector2::new(b.y - a.y, a.x - b.x) / length;
            let offset = normal.dot(&a.coords);
            meets_line(center, radius, normal, offset + distance, &mut angles);
            meets_line(center, radius, normal, offset - distance, &mut angles);
            meets_circle(center, radius, a, distance, &mut angles);
            meets_circle(center, radius, b, distance, &mut angles);
            decide(&mut angles, &|p| point_segment_squared(p, a, b) < squared);
        };
        match piece {
            BoundaryPiece::Side { start, end, .. } => side(start, end),
            BoundaryPiece::Block { min, max } => {
                let ring = block_corners(min, max);
                for i in 0..4 {
                    side(ring[i], ring[(i + 1) % 4]);
                }
            }
            BoundaryPiece::Disc {
                center: other,
                radius: size,
            } => {
                let least = size + distance;
                meets_circle(center, radius, other, least, &mut angles);
                decide(&mut angles, &|p| (p - other).norm() < least);
            }
        }
        true
    });
    blocked.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut parts = Vec::new();
    let mut from = 0.0;
    for (a, b) in blocked.into_iter().chain([(span.width, span.width)]) {
        if a > from || (span.width == 0.0 && parts.is_empty()) {
            parts.push((from, a));
        }
        from = f64::max(from, b);
    }
    // Away from every boundary it is inside or outside altogether.
    parts.retain(|(a, b)| world.clearance(at(0.5 * (a + b))) > 0.0);
    // On a full circle the last and the first are one.
    if span.is_full()
        && parts.len() > 1
        && let (Some(&(0.0, end)), Some(&(start, last))) = (parts.first(), parts.last())
        && last == span.width
    {
        parts.pop();
        parts[0] = (start - span.width, end);
    }
    parts
        .into_iter()
        .map(|(a, b)| Span {
            alpha: span.alpha + a,
            width: b - a,
        })
        .collect()
}

/// The places at distance `tolerance` (m) from `goal` that are `distance` from a boundary: where the edge of the goal's ball
/// leaves free space.
pub(super) fn ball_corners(
    world: &World,
    walls: &[Wall],
    goal: Point2,
    tolerance: f64,
    distance: f64,
) -> Vec<Point2> {
    let mut angles = Vec::new();
    for wall in walls {
        meets_line(
            goal,
            tolerance,
            wall.normal,
            wall.offset - distance,
            &mut angles,
        );
    }
    let reach = tolerance + distance;
    let near = |b: &Bounds| {
        let dx = (b.min.x - goal.x).max(goal.x - b.max.x).max(0.0);
        let dy = (b.min.y - goal.y).max(goal.y - b.max.y).max(0.0);
        dx * dx + dy * dy <= reach * reach
    };
    world.visit_boundary(near, |_, piece| {
        let mut side = |a: Point2, b: Point2| {
            let length = (b - a).norm();
            if length > 0.0 {
                let normal = Vector2::new(b.y - a.y, a.x - b.x) / length;
                let offset = normal.dot(&a.coords) + distance;
                meets_line(goal, tolerance, normal, offset, &mut angles);
                meets_circle(goal, tolerance, a, distance, &mut angles);
            }
        };
        match piece {
            BoundaryPiece::Side { start, end, .. } => side(start, end),
            BoundaryPiece::Block { min, max } => {
                let ring = block_corners(min, max);
                for i in 0..4 {
                    side(ring[i], ring[(i + 1) % 4]);
                }
            }
            BoundaryPiece::Disc { center, radius } => {
                meets_circle(goal, tolerance, center, radius + distance, &mut angles);
            }
        }
        true
    });
    // Rounding may put them a hair too near.
    let least = distance * (1.0 - 1e-6) - 1e-12 * goal.coords.amax();
    angles
        .into_iter()
        .map(|angle| goal + super::tangent::unit(angle) * tolerance)
        .filter(|p| world.clearance(*p) >= least)
        .collect()
}
