//! A* over legs and arcs. See the module's head for the idea.

use super::freedom::{self, Wall};
use super::graph::{Arc, Arrival, Circle, Freedom, Goal, Leg, Open, Target};
use super::shadows::Shadows;
use super::tangent::{Round, Sense, Span, arrival_normal, bitangent, unit, wrap_about};
use super::view::View;
use crate::budget::Meter;
use bikebot_geometry::Point2;
use bikebot_world::{BoundaryPiece, World};
use std::cell::Cell;
use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::TAU;

/// Normals (rad) are compared with this much slack: it covers the rounding of the angles, and only ever adds legs.
pub(super) const ANGLE_SLACK: f64 = 1e-8;
/// Costs (relative) closer than this are equal.
const COST_SLACK: f64 = 1e-12;
/// The surroundings of a circle are looked at ring by ring; each is so many times as large as the one before.
const RING_GROWTH: f64 = 1.6;
/// The first ring, in cells of the clearance grid.
const FIRST_RING: f64 = 4.0;
/// Boxes and pieces looked at that count as one iteration of the budget.
const LOOKS_PER_ITERATION: u32 = 256;
/// Arcs of the returned path are cut into pieces no longer than this, rad.
const ARC_STEP: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// How a search ended.
pub(super) enum End {
    /// The shortest path.
    Found { length: f64, path: Vec<Point2> },
    /// No path is shorter than this, m; infinite if there is none at all.
    Bound(f64),
}

/// Lengths the search works with, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scales {
    /// ρ.
    pub(super) radius: f64,
    /// How much room a gap must have to spare to count as one.
    pub(super) spare: f64,
    /// Rounding.
    pub(super) rounding: f64,
}

pub(super) struct Search<'a> {
    world: &'a World,
    walls: Vec<Wall>,
    pub(super) scales: Scales,
    start: Point2,
    pub(super) goal: Point2,
    pub(super) tolerance: f64,
    pub(super) upper: f64,
    pub(super) circles: Vec<Circle>,
    /// By number of the boundary piece and corner of it.
    numbers: HashMap<(u32, u8), u32>,
    pub(super) arcs: Vec<Arc>,
    legs: Vec<Leg>,
    arrivals: Vec<Arrival>,
    goals: Vec<Goal>,
    open: BinaryHeap<Open>,
    shadows: Shadows,
    /// Distance (m) to be kept by legs from the start and to the goal, where that is less than elsewhere.
    start_room: f64,
    goal_room: f64,
}

impl<'a> Search<'a> {
    /// `start` must be clear by the radius; `upper` is finite or infinite, not NaN.
    pub(super) fn new(
        world: &'a World,
        scales: Scales,
        start: Point2,
        goal: Point2,
        tolerance: f64,
        upper: f64,
    ) -> Self {
        let walls = freedom::walls(world);
        let mut goals = vec![Goal {
            position: goal,
            shortened: tolerance,
        }];
        if tolerance > 0.0 {
            let room = scales.radius + scales.spare;
            let corners = freedom::ball_corners(world, &walls, goal, tolerance, room);
            goals.extend(corners.into_iter().map(|position| Goal {
                position,
                shortened: 0.0,
            }));
        }
        let goal_room = if tolerance > 0.0 {
            f64::INFINITY
        } else {
            world.clearance(goal)
        };
        Self {
            walls,
            scales,
            start,
            goal,
            tolerance,
            upper: upper * (1.0 + 1e-9),
            circles: Vec::new(),
            numbers: HashMap::new(),
            arcs: Vec::new(),
            legs: Vec::new(),
            arrivals: Vec::new(),
            goals,
            open: BinaryHeap::new(),
            shadows: Shadows::default(),
            start_room: world.clearance(start),
            goal_room,
            world,
        }
    }

    /// The straight way from `p` into the goal's ball, m.
    fn rest(&self, p: Point2) -> f64 {
        ((self.goal - p).norm() - self.tolerance).max(0.0)
    }

    /// The distance all but the first and last legs keep, m.
    fn room(&self) -> f64 {
        self.scales.radius + self.scales.spare - self.scales.rounding
    }

    pub(super) fn run(&mut self, meter: &mut Meter<'_>) -> End {
        let mut bound = self.rest(self.start);
        self.circles.push(Circle {
            center: self.start,
            radius: 0.0,
            tested_radius: 0.0,
            span: Span::FULL,
            arcs: Some((0, 1)),
        });
        self.add_arc(0, Span::FULL);
        if !meter.step_dearly() || !self.arrive(0, Sense::Left, 0.0, 0.0, None, meter) {
            return End::Bound(bound);
        }
        while let Some(Open { total, cost, leg }) = self.open.pop() {
            bound = bound.max(total);
            let (target, known) = {
                let leg = &self.legs[leg as usize];
                if cost > leg.cost {
                    continue;
                }
                (leg.target, leg.freedom)
            };
            if !meter.step() {
                return End::Bound(bound);
            }
            if known == Freedom::Unknown {
                self.legs[leg as usize].freedom = if self.is_clear(leg) {
                    Freedom::Clear
                } else {
                    Freedom::Blocked
                };
            }
            if self.legs[leg as usize].freedom == Freedom::Blocked {
                continue;
            }
            match target {
                Target::Goal(goal) => {
                    return End::Found {
                        length: cost,
                        path: self.path(leg, self.goals[goal as usize]),
                    };
                }
                Target::Circle(circle, sense) => {
                    let Leg {
                        normal,
                        sense: from,
                        ..
                    } = self.legs[leg as usize];
                    let normal = arrival_normal(normal, from, sense);
                    let (first, last) = self.arcs_of(circle);
                    let arc = (first..last)
                        .find(|a| self.arcs[*a as usize].span.contains(normal, ANGLE_SLACK));
                    if let Some(arc) = arc
                        && !self.arrive(arc, sense, normal, cost, Some(leg), meter)
                    {
                        return End::Bound(bound);
                    }
                }
            }
        }
        // Whatever was left out for the length of the known path is longer than that.
        End::Bound(bound.max(self.upper / (1.0 + 1e-9)))
    }

    fn add_arc(&mut self, circle: u32, span: Span) {
        self.arcs.push(Arc {
            circle,
            span,
            arrivals: Vec::new(),
            sides: Default::default(),
        });
    }

    fn arcs_of(&mut self, circle: u32) -> (u32, u32) {
        let Circle {
            center,
            tested_radius,
            span,
            arcs,
            ..
        } = self.circles[circle as usize];
        if let Some(arcs) = arcs {
            return arcs;
        }
        let room = self.room();
        let parts =
            freedom::clear_parts(self.world, &self.walls, center, tested_radius, span, room);
        let first = self.arcs.len() as u32;
        for part in parts {
            self.add_arc(circle, part);
        }
        let range = (first, self.arcs.len() as u32);
        self.circles[circle as usize].arcs = Some(range);
        range
    }

    /// A path of length `cost` arrives at an arc. `false`: the budget ended before all that follows from it was seen.
    fn arrive(
        &mut self,
        arc: u32,
        sense: Sense,
        normal: f64,
        cost: f64,
        leg: Option<u32>,
        meter: &mut Meter<'_>,
    ) -> bool {
        let here = &self.arcs[arc as usize];
        let span = here.span;
        let radius = self.circles[here.circle as usize].radius;
        let progress = span.progress(normal, sense);
        let slack = COST_SLACK * (1.0 + cost);
        // Another path gets here along the arc, at no more cost.
        let is_beaten = here.arrivals.iter().any(|other| {
            let other = &self.arrivals[*other as usize];
            let way = progress - span.progress(other.normal, sense);
            if span.is_full() {
                let way = way.rem_euclid(TAU);
                (other.sense == sense && other.cost + radius * way <= cost + slack)
                    || other.cost + radius * way.min(TAU - way) < cost - slack
            } else {
                (other.sense == sense
                    && way >= -ANGLE_SLACK
                    && other.cost + radius * way.max(0.0) <= cost + slack)
                    || other.cost + radius * way.abs() < cost - slack
            }
        });
        if is_beaten {
            return true;
        }
        let number = self.arrivals.len() as u32;
        self.arrivals.push(Arrival {
            leg,
            normal,
            sense,
            cost,
        });
        self.arcs[arc as usize].arrivals.push(number);
        let side = &mut self.arcs[arc as usize].sides[sense as usize];
        let range = match side.known_from {
            None if span.is_full() => Some((progress, progress + TAU)),
            None => Some((progress.min(span.width), span.width)),
            Some(known) if !span.is_full() && progress < known => Some((progress, known)),
            Some(_) => None,
        };
        if let Some((from, to)) = range {
            side.known_from = Some(from);
            if !meter.step_dearly() || !self.look_around(arc, sense, from, to, cost, meter) {
                return false;
            }
        }
        self.leave(arc, sense, progress, number);
        true
    }

    /// Carries an arrival on to the legs that leave its arc.
    fn leave(&mut self, arc: u32, sense: Sense, progress: f64, arrival: u32) {
        let Arc {
            circle,
            span,
            sides,
            ..
        } = &self.arcs[arc as usize];
        let radius = self.circles[*circle as usize].radius;
        let from = self.arrivals[arrival as usize].cost;
        for &number in &sides[sense as usize].legs {
            let leg = &mut self.legs[number as usize];
            let mut way = leg.progress - progress;
            if span.is_full() {
                way = way.rem_euclid(TAU);
                // Straight on is no full turn.
                if way > TAU - ANGLE_SLACK {
                    way = 0.0;
                }
            } else if way < -ANGLE_SLACK {
                continue;
            }
            let cost = from + radius * way.max(0.0) + leg.length;
            let total = cost + leg.rest;
            if cost < leg.cost && total <= self.upper && leg.freedom != Freedom::Blocked {
                leg.cost = cost;
                leg.arrival = arrival;
                self.open.push(Open {
                    total,
                    cost,
                    leg: number,
                });
            }
        }
    }

    /// Finds the legs that leave an arc between two progresses, but for those that are seen to be blocked, or too long for the
    /// known path if it takes `cost` to the first of them. `false`: the budget ended.
    fn look_around(
        &mut self,
        arc: u32,
        sense: Sense,
        from: f64,
        to: f64,
        cost: f64,
        meter: &mut Meter<'_>,
    ) -> bool {
        let view = View::new(self, arc, sense, from, to, cost);
        let mut found = Vec::new();
        for (number, goal) in (0u32..).zip(&self.goals) {
            if let Some(leg) = view.leg(goal.position, 0.0, 0.0, true) {
                let length = (leg.length - goal.shortened).max(0.0);
                if view.cost + length <= self.upper {
                    found.push(Leg {
                        length,
                        rest: 0.0,
                        ..view.to(leg, Target::Goal(number))
                    });
                }
            }
        }
        let mut shadows = std::mem::take(&mut self.shadows);
        shadows.clear(from, to);
        let mut inner = 0.0;
        let mut outer = FIRST_RING * self.world.clearance_cell_size() + view.tested_radius;
        let mut looks = 0;
        let mut in_time = true;
        loop {
            shadows.advance(inner - self.room());
            let is_more = Cell::new(false);
            let mut sides: Vec<(u32, BoundaryPiece)> = Vec::new();
            self.world.visit_boundary(
                |b| {
                    looks += 1;
                    if looks >= LOOKS_PER_ITERATION {
                        looks = 0;
                        in_time = meter.step();
                    }
                    if !in_time {
                        return false;
                    }
                    let (least, most) = view.distances(b);
                    if most < inner || !view.is_of_use(b, least, &shadows, self) {
                        return false;
                    }
                    if least >= outer {
                        is_more.set(true);
                        return false;
                    }
                    true
                },
                |number, piece| {
                    let (least, _) = view.distances(&piece.bounds());
                    if least >= outer {
                        is_more.set(true);
                    } else if least >= inner {
                        sides.push((number, piece));
                    }
                    true
                },
            );
            for (number, piece) in sides {
                self.examine(&view, number, piece, &mut shadows, &mut found);
            }
            if !in_time || !is_more.get() {
                break;
            }
            inner = outer;
            outer *= RING_GROWTH;
        }
        self.shadows = shadows;
        let first = self.legs.len() as u32;
        self.legs.append(&mut found);
        let last = self.legs.len() as u32;
        self.arcs[arc as usize].sides[sense as usize]
            .legs
            .extend(first..last);
        in_time
    }

    /// The legs to the circles of one piece of the boundary, and the shadow it casts.
    fn examine(
        &mut self,
        view: &View,
        number: u32,
        piece: BoundaryPiece,
        shadows: &mut Shadows,
        found: &mut Vec<Leg>,
    ) {
        let room = self.room();
        match piece {
            BoundaryPiece::Disc { center, radius } => {
                self.reach(
                    view,
                    (number, 0),
                    center,
                    radius,
                    Span::FULL,
                    shadows,
                    found,
                );
                if let Some((near, far)) = view.stopped(center, radius + room) {
                    // A line that passes within reach of the centre has met the disc before it is abreast of it.
                    let abreast = (center - view.center).norm().hypot(view.tested_radius);
                    shadows.announce(abreast, near, far);
                }
            }
            BoundaryPiece::Block { min, max } => {
                let ring = freedom::block_corners(min, max);
                for (i, corner) in (0u8..).zip(ring) {
                    let k = usize::from(i);
                    let span =
                        Span::of_corner(corner - ring[(k + 3) % 4], ring[(k + 1) % 4] - corner);
                    self.reach(view, (number, i), corner, 0.0, span, shadows, found);
                    view.side(corner, ring[(k + 1) % 4], room, shadows);
                }
            }
            BoundaryPiece::Side {
                start,
                end,
                begins_convex,
            } => {
                if begins_convex
                    && view.may_see(start)
                    && let Some(before) = self.world.direction_before_side(number)
                {
                    let span = Span::of_corner(before, end - start);
                    self.reach(view, (number, 0), start, 0.0, span, shadows, found);
                }
                view.side(start, end, room, shadows);
            }
        }
    }

    /// The legs to one circle, in both senses.
    #[expect(
        clippy::too_many_arguments,
        reason = "what a circle is, and where from and to"
    )]
    fn reach(
        &mut self,
        view: &View,
        key: (u32, u8),
        center: Point2,
        size: f64,
        span: Span,
        shadows: &Shadows,
        found: &mut Vec<Leg>,
    ) {
        let radius = size + self.scales.radius;
        let tested_radius = radius + self.scales.spare;
        for sense in Sense::BOTH {
            let same = sense == view.sense;
            let Some(leg) = view.leg(center, radius, tested_radius, same) else {
                continue;
            };
            let normal = arrival_normal(leg.normal, view.sense, sense);
            if !span.contains(normal, ANGLE_SLACK)
                || shadows.cover(leg.tested_progress, leg.tested_progress)
            {
                continue;
            }
            let rest = self.rest(center + unit(normal) * radius);
            if view.cost + leg.length + rest > self.upper {
                continue;
            }
            let circles = &mut self.circles;
            let circle = *self.numbers.entry(key).or_insert_with(|| {
                circles.push(Circle {
                    center,
                    radius,
                    tested_radius,
                    span,
                    arcs: None,
                });
                circles.len() as u32 - 1
            });
            found.push(Leg {
                rest,
                ..view.to(leg, Target::Circle(circle, sense))
            });
        }
    }

    /// Whether a leg touches nothing on its way.
    fn is_clear(&self, leg: u32) -> bool {
        let leg = &self.legs[leg as usize];
        let arc = &self.arcs[leg.arc as usize];
        let circle = &self.circles[arc.circle as usize];
        // An end that is itself too near for the full η is given what it can spare.
        let mut spare = self.scales.spare;
        if arc.circle == 0 {
            spare = spare.min(0.25 * (self.start_room - self.scales.radius));
        }
        if let Target::Goal(0) = leg.target {
            spare = spare.min(0.25 * (self.goal_room - self.scales.radius));
        }
        let spare = spare.max(0.0);
        let room = self.scales.radius + spare - self.scales.rounding;
        let tested = |circle: &Circle| match circle.tested_radius {
            0.0 => 0.0,
            _ => circle.radius + spare,
        };
        let from = Round {
            center: circle.center,
            radius: tested(circle),
            sense: leg.sense,
        };
        let (to, shortened) = match leg.target {
            Target::Circle(number, sense) => {
                let to = &self.circles[number as usize];
                let to = Round {
                    center: to.center,
                    radius: tested(to),
                    sense,
                };
                (to, 0.0)
            }
            Target::Goal(number) => {
                let goal = self.goals[number as usize];
                let to = Round {
                    center: goal.position,
                    radius: 0.0,
                    sense: leg.sense,
                };
                (to, goal.shortened)
            }
        };
        let Some((p, q)) = bitangent(from, to) else {
            return false;
        };
        let length = (q - p).norm();
        let q = p + (q - p) * (1.0 - shortened / length).max(0.0);
        // An end that touches already has no room to ask for; what is behind it is not looked at.
        room <= 0.0 || freedom::is_leg_clear(self.world, &self.walls, p, q, room)
    }

    /// The path that ends with `leg` at `goal`.
    fn path(&self, last: u32, goal: Goal) -> Vec<Point2> {
        let leg = &self.legs[last as usize];
        let circle = &self.circles[self.arcs[leg.arc as usize].circle as usize];
        let from = circle.center + unit(leg.normal) * circle.radius;
        let way = goal.position - from;
        let length = way.norm();
        let mut backwards = vec![from + way * (1.0 - goal.shortened / length).max(0.0)];
        let mut next = Some(last);
        while let Some(number) = next {
            let leg = &self.legs[number as usize];
            let arc = &self.arcs[leg.arc as usize];
            let circle = &self.circles[arc.circle as usize];
            let arrival = &self.arrivals[leg.arrival as usize];
            let mut turn = (leg.normal - arrival.normal) * leg.sense.sign();
            turn = wrap_about(
                turn,
                if arc.span.is_full() {
                    std::f64::consts::PI
                } else {
                    0.0
                },
            );
            if turn > TAU - ANGLE_SLACK {
                turn = 0.0;
            }
            let steps = if circle.radius > 0.0 {
                (turn.max(0.0) / ARC_STEP).ceil() as usize
            } else {
                0
            };
            for k in 0..=steps {
                let part = if steps == 0 {
                    0.0
                } else {
                    turn * (k as f64 / steps as f64)
                };
                let normal = leg.normal - leg.sense.sign() * part;
                backwards.push(circle.center + unit(normal) * circle.radius);
            }
            next = arrival.leg;
        }
        backwards.dedup();
        backwards.reverse();
        backwards
    }
}
