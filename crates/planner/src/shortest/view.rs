//! What can be seen from an arc.

use super::graph::{Freedom, Leg, Target};
use super::search::{ANGLE_SLACK, Search};
use super::shadows::Shadows;
use super::tangent::{Sense, offset, polar, wrap_about};
use bikebot_geometry::{Point2, Vector2};
use bikebot_world::Bounds;
use std::f64::consts::TAU;

/// A leg as seen from an arc.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    pub(super) normal: f64,
    pub(super) progress: f64,
    pub(super) tested_progress: f64,
    pub(super) length: f64,
}

/// What one looks out from: an arc, the sense, and the range of progress.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub(super) arc: u32,
    pub(super) center: Point2,
    pub(super) radius: f64,
    pub(super) tested_radius: f64,
    pub(super) sense: Sense,
    pub(super) shift: f64,
    pub(super) from: f64,
    pub(super) to: f64,
    /// No path that leaves in this range has come less far, m.
    pub(super) cost: f64,
    /// The largest radius added to corners.
    pub(super) swell: f64,
}

impl View {
    pub(super) fn new(
        search: &Search<'_>,
        arc: u32,
        sense: Sense,
        from: f64,
        to: f64,
        cost: f64,
    ) -> Self {
        let here = &search.arcs[arc as usize];
        let circle = &search.circles[here.circle as usize];
        Self {
            arc,
            center: circle.center,
            radius: circle.radius,
            tested_radius: circle.tested_radius,
            sense,
            shift: here.span.shift(sense),
            from,
            to,
            // A later arrival, farther along the arc, may have saved part of the arc: no more than twice its length, since the
            // straight ways to the goal differ by no more than the arc.
            cost: cost - 2.0 * circle.radius * (to - from),
            swell: search.scales.radius + search.scales.spare,
        }
    }

    pub(super) fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// Progress of the line in the direction `gamma` of something that is to pass it at x.
    pub(super) fn progress(&self, gamma: f64, x_over_distance: f64) -> f64 {
        wrap_about(
            self.sense.sign() * gamma - x_over_distance.acos() + self.shift,
            self.middle(),
        )
    }

    /// The leg to a circle, if there is one within the range.
    pub(super) fn leg(
        &self,
        center: Point2,
        radius: f64,
        tested_radius: f64,
        same: bool,
    ) -> Option<Sight> {
        let (gamma, distance) = polar(center - self.center);
        let x = offset(self.radius, radius, same);
        if distance <= x.abs() {
            return None;
        }
        let turn = (x / distance).acos();
        let sign = self.sense.sign();
        let progress = wrap_about(sign * gamma - turn + self.shift, self.middle());
        if progress < self.from - ANGLE_SLACK || progress > self.to + ANGLE_SLACK {
            return None;
        }
        let tested = offset(self.tested_radius, tested_radius, same);
        Some(Sight {
            normal: gamma - sign * turn,
            progress,
            // Within the range, where alone it is known what is in shadow.
            tested_progress: self
                .progress(gamma, (tested / distance).clamp(-1.0, 1.0))
                .clamp(self.from, self.to),
            length: ((distance - x) * (distance + x)).sqrt(),
        })
    }

    pub(super) fn to(&self, sight: Sight, target: Target) -> Leg {
        Leg {
            arc: self.arc,
            sense: self.sense,
            normal: sight.normal,
            progress: sight.progress,
            target,
            length: sight.length,
            cost: f64::INFINITY,
            arrival: 0,
            rest: 0.0,
            freedom: Freedom::Unknown,
        }
    }

    /// Whether a leg to the circle about `corner` can lie in the range at all.
    pub(super) fn may_see(&self, corner: Point2) -> bool {
        match self.stopped(corner, self.swell) {
            Some((a, b)) => [-TAU, 0.0, TAU].into_iter().any(|turn| {
                b + turn >= self.from - ANGLE_SLACK && a + turn <= self.to + ANGLE_SLACK
            }),
            None => true,
        }
    }

    /// Between which progresses a disc stops the lines that leave the arc; `None` if it is too near for that to be said.
    pub(super) fn stopped(&self, center: Point2, radius: f64) -> Option<(f64, f64)> {
        let (gamma, distance) = polar(center - self.center);
        if distance <= self.tested_radius + radius {
            return None;
        }
        let gamma = self.sense.sign() * gamma + self.shift;
        let first = gamma - ((self.tested_radius - radius) / distance).acos();
        let last = gamma - ((self.tested_radius + radius) / distance).acos();
        let first = wrap_about(first, self.middle());
        Some((first, wrap_about(last, first)))
    }

    /// Announces the shadow of a side, widened by `room`, if it faces the arc.
    pub(super) fn side(&self, a: Point2, b: Point2, room: f64, shadows: &mut Shadows) {
        let (u, v) = (a - self.center, b - self.center);
        let span = b - a;
        let length = span.norm();
        // Solid on the left: it faces those on its right. Where its line comes near the circle it can be seen at any angle.
        if u.perp(&v) >= -(self.tested_radius + room) * length {
            return;
        }
        let (Some(one), Some(other)) = (self.stopped(a, room), self.stopped(b, room)) else {
            return;
        };
        let shift = wrap_about(other.0, one.0) - other.0;
        let (first, last) = (one.0.min(other.0 + shift), one.1.max(other.1 + shift));
        shadows.announce(u.norm().max(v.norm()) + room, first, last);
    }

    /// Least and largest distance (m) of the arc's centre to a box.
    pub(super) fn distances(&self, b: &Bounds) -> (f64, f64) {
        let c = self.center;
        let least = Vector2::new(
            (b.min.x - c.x).max(c.x - b.max.x).max(0.0),
            (b.min.y - c.y).max(c.y - b.max.y).max(0.0),
        );
        let most = Vector2::new(
            (c.x - b.min.x).max(b.max.x - c.x),
            (c.y - b.min.y).max(b.max.y - c.y),
        );
        (least.norm(), most.norm())
    }

    /// Whether something in a box can be seen, and be part of a path that is not too long.
    pub(super) fn is_of_use(
        &self,
        b: &Bounds,
        least: f64,
        shadows: &Shadows,
        search: &Search<'_>,
    ) -> bool {
        if search.upper.is_finite() {
            let g = search.goal;
            let to_goal = Vector2::new(
                (b.min.x - g.x).max(g.x - b.max.x).max(0.0),
                (b.min.y - g.y).max(g.y - b.max.y).max(0.0),
            )
            .norm();
            let near = self.radius + 2.0 * self.swell;
            if self.cost + least + to_goal - near - search.tolerance > search.upper {
                return false;
            }
        }
        let half = (b.max - b.min) * 0.5;
        // Half again as much as the rounding of a tangent could ask for.
        let radius = half.norm() + self.swell * (1.0 + 1e-9);
        match self.stopped(b.min + half, radius) {
            Some((first, last)) => !shadows.cover(first - ANGLE_SLACK, last + ANGLE_SLACK),
            None => true,
        }
    }
}
