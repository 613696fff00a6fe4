//! What the search goes over: circles, the free arcs of them, legs between arcs, and arrivals by them.

use super::tangent::{Sense, Span};
use bikebot_geometry::Point2;
use std::cmp::Ordering;

/// A corner or a disc with the radius of the robot added. The start is a circle of radius 0.
#[derive(Debug)]
pub(super) struct Circle {
    pub(super) center: Point2,
    pub(super) radius: f64,
    /// The radius at which legs and arcs are tested: a hair more, but for the start.
    pub(super) tested_radius: f64,
    /// Normals at which a path may touch it.
    pub(super) span: Span,
    /// Arcs, once they are known: first and one past the last.
    pub(super) arcs: Option<(u32, u32)>,
}

/// A free piece of a circle.
#[derive(Debug)]
pub(super) struct Arc {
    pub(super) circle: u32,
    pub(super) span: Span,
    pub(super) arrivals: Vec<u32>,
    /// By sense.
    pub(super) sides: [Side; 2],
}

/// What is known of the legs that leave an arc in one sense.
#[derive(Debug, Default)]
pub(super) struct Side {
    /// Progress from which on they are known.
    pub(super) known_from: Option<f64>,
    pub(super) legs: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Target {
    Circle(u32, Sense),
    Goal(u32),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Freedom {
    Unknown,
    Clear,
    Blocked,
}

/// A straight leg from an arc to a circle or a goal.
#[derive(Debug)]
pub(super) struct Leg {
    pub(super) arc: u32,
    pub(super) sense: Sense,
    /// Normal at which it leaves the arc.
    pub(super) normal: f64,
    pub(super) progress: f64,
    pub(super) target: Target,
    pub(super) length: f64,
    /// Least length of a path to where it ends, so far, and the arrival that path comes from.
    pub(super) cost: f64,
    pub(super) arrival: u32,
    /// The straight way from its end to the goal.
    pub(super) rest: f64,
    pub(super) freedom: Freedom,
}

/// A path's arrival on an arc.
#[derive(Debug)]
pub(super) struct Arrival {
    /// The leg it came by; none at the start.
    pub(super) leg: Option<u32>,
    pub(super) normal: f64,
    pub(super) sense: Sense,
    pub(super) cost: f64,
}

/// A place to reach: the goal itself, of which the last `shortened` metres need not be gone, or a corner of its ball.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    pub(super) position: Point2,
    pub(super) shortened: f64,
}

/// A leg to be looked at; the heap yields the least total first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Open {
    pub(super) total: f64,
    pub(super) cost: f64,
    pub(super) leg: u32,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .total
            .total_cmp(&self.total)
            .then(self.cost.total_cmp(&other.cost))
            .then(other.leg.cmp(&self.leg))
    }
}
