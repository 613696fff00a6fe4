//! Lines 6–38 of Algorithm 1: RRT* over poses, in a corridor about the guide, through curves the bike can ride.
//!
//! What the listing prints and what we do (D1–D5, each a switch of [`PlannerParams`]):
//!
//! * Edges run from parent to child (D4); lines 11 and 19 print the arguments the other way round.
//! * The heading drawn for a sample belongs to the sample's place. Where Steer (line 10) has moved it, it is drawn again.
//! * Line 34 returns at the first arrival; we run all iterations and return the cheapest path (D5).
//! * 𝒳_goal is a ball of radius l; with [`GoalMode::Pose`] the path ends at the goal itself, by one more curve.
//!
//! What the listing leaves open: parents are examined in the order of a lower bound of the cost through them, so that the
//! first to pass the tests is usually the last to be tested; a node that cannot lie on a cheaper path than the one known is
//! not added (branch and bound); ends with a heading are first joined to the guide by arcs ([`crate::end_arcs`], D11);
//! and the first samples may be poses laid out along the guide (structured seeds, D12).

use crate::budget::Meter;
use crate::chance::Chance;
use crate::connection::{Connection, Connector, DirectedPose};
use crate::corridor_ends::Ends;
use crate::kd_tree::{KdTree, Neighbor};
use crate::motion::MotionChecker;
use crate::params::{GoalMode, PlannerParams};
use crate::problem::PlanningProblem;
use crate::sampler::{HeadingPrior, PathWidthSampler};
use crate::seeds;
use crate::steer::steer;
use crate::tree::{NodeId, Tree};
use bikebot_geometry::{FergusonCurve, Point2, Polyline, Pose2, angle};

/// Distance to the goal, in steps ε, within which a new node is joined to it.
const GOAL_REACH: f64 = 1.2;

/// Candidates beyond the limit to be gathered, at least, before they are cut back.
const CUT_BACK: usize = 64;

/// Candidates brought into order at once.
const SORTED_AT_ONCE: usize = 16;

/// Of sums of a few costs, relative.
const ROUNDING: f64 = 1e-12;

/// Headings that count as equal where a node lies on the goal already, rad: rounding of a wrapped angle.
const SAME_HEADING: f64 = 1e-12;

/// A better path found on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Improvement {
    /// Iterations of the whole plan so far.
    pub iteration: u64,
    /// Cost of the path, Eq. (5) summed over its edges.
    pub cost: f64,
    /// Its length, m.
    pub length: f64,
}

/// What the search in one corridor came to.
#[derive(Debug, Clone)]
pub struct CorridorSearch {
    /// The cheapest path's curves from start to arrival; `None` if there was no arrival, no curve where the start is one.
    pub path: Option<Vec<FergusonCurve>>,
    /// Cost of that path; infinite without one.
    pub cost: f64,
    /// Middle of the corridor that was searched: the guide given, its ends bent onto the prescribed headings.
    pub guide: Polyline,
    /// All edges of the tree, each from parent to child.
    pub edges: Vec<FergusonCurve>,
    /// Each time a cheaper path was known than before.
    pub improvements: Vec<Improvement>,
    /// Iterations made.
    pub iterations: u64,
}

/// Searches the corridor of half width w about `guide`; `motion` decides what is free.
///
/// Draws everything from `chance` and counts every iteration on `meter`; stops after n iterations, when the meter runs
/// out, or at the first arrival if the parameters say so. `observe` is told of every improvement as it is made.
pub fn search(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    motion: &MotionChecker<'_>,
    guide: &Polyline,
    chance: &mut Chance,
    meter: &mut Meter<'_>,
    observe: &mut dyn FnMut(&Improvement),
) -> CorridorSearch {
    let connector = Connector::new(params, problem.max_curvature, motion);
    let ends = Ends::new(problem, params, guide, &connector, meter);
    let guide = &ends.guide;
    let half_width = params.corridor_half_width();
    let prior = HeadingPrior::new(guide, half_width, params.errata.continuous_heading_prior);
    let sampler = PathWidthSampler::new(guide, half_width, params.heading_spread(), prior);
    let mut seeds = if params.structured_seeds {
        seeds::along(guide, half_width, params.max_step(), problem.max_curvature)
    } else {
        Vec::new()
    }
    .into_iter();

    let mut search = Search::new(problem, params, &connector, &ends);
    search.report_improvement(meter, observe);
    let mut iterations = 0;
    // Nothing is cheaper than having arrived at the start.
    while search.best > 0.0 && iterations < params.iterations && meter.step() {
        iterations += 1;
        let seed = seeds.next();
        let sample = seed.unwrap_or_else(|| sampler.draw(chance));
        let Some(nearest) = search.index.nearest(sample.position) else {
            break;
        };
        let new = if seed.is_some() {
            sample
        } else {
            let from = search.position(NodeId(nearest.id));
            let position = steer(from, sample.position, params.max_step());
            let has_moved = position != sample.position;
            let heading = if has_moved && params.errata.heading_drawn_after_steer {
                sampler.draw_heading(position, chance)
            } else {
                sample.heading
            };
            Pose2 { position, heading }
        };
        search.extend(&DirectedPose::from(new), nearest);
        search.report_improvement(meter, observe);
        if search.has_arrived() && !params.errata.run_all_iterations {
            break;
        }
    }
    search.finish(iterations)
}

/// How the curve was laid that leads to a node. From this and the poses of the node and its parent the curve can be made
/// again, equal to the last bit: 64 bytes that a node need not carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Laid {
    /// From parent to child; at the root there is none.
    Ahead,
    /// As lines 11 and 19 print it (D4).
    Backwards,
    /// It is one of the arcs at the start.
    Trunk,
}

/// A way into one entry.
#[derive(Debug, Clone, Copy)]
struct Arrival {
    node: NodeId,
    /// The last curve of the search, unless the node itself is the arrival.
    connection: Option<Connection>,
    entry: usize,
}

/// A neighbour of a new pose.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    /// Least cost that a path through it to the new pose may have.
    bound: f64,
    /// Least cost of the edge between the two.
    edge: f64,
    node: NodeId,
}

impl Candidate {
    /// The cheapest bound first; the node added earlier, if they are equal.
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.bound
            .total_cmp(&other.bound)
            .then(self.node.cmp(&other.node))
    }
}

/// The state of lines 6–38.
struct Search<'a> {
    problem: &'a PlanningProblem<'a>,
    params: &'a PlannerParams,
    connector: &'a Connector<'a>,
    ends: &'a Ends,
    tree: Tree<DirectedPose>,
    /// Beside each node of the tree.
    laid: Vec<Laid>,
    index: KdTree,
    arrivals: Vec<Arrival>,
    /// Volume of the corridor, m³: length, width and range of headings times ε.
    measure: f64,
    /// Cheapest path known.
    best: f64,
    /// Cost that was last reported.
    reported: f64,
    improvements: Vec<Improvement>,
    near: Vec<Neighbor>,
    /// Neighbours, at most as many as the parameters allow, those of the least bounds.
    candidates: Vec<Candidate>,
}

impl<'a> Search<'a> {
    fn new(
        problem: &'a PlanningProblem<'a>,
        params: &'a PlannerParams,
        connector: &'a Connector<'a>,
        ends: &'a Ends,
    ) -> Self {
        let width = 2.0 * params.corridor_half_width();
        let headings = 2.0 * params.heading_spread() * params.max_step();
        let mut search = Self {
            problem,
            params,
            connector,
            ends,
            tree: Tree::new(ends.root),
            laid: vec![Laid::Ahead],
            index: KdTree::new(),
            arrivals: Vec::new(),
            measure: ends.guide.length() * width * headings,
            best: f64::INFINITY,
            reported: f64::INFINITY,
            improvements: Vec::new(),
            near: Vec::new(),
            candidates: Vec::new(),
        };
        search.index.insert(ends.root.pose.position, NodeId::ROOT.0);
        search.arrive(NodeId::ROOT);
        let mut parent = NodeId::ROOT;
        for connection in &ends.trunk {
            let pose = connection.curve.end_pose();
            parent = search.add(parent, &pose.into(), connection, Laid::Trunk);
        }
        search
    }

    fn position(&self, node: NodeId) -> Point2 {
        self.tree.value(node).pose.position
    }

    fn has_arrived(&self) -> bool {
        self.best < f64::INFINITY
    }

    /// Lines 9–32 for one new pose.
    fn extend(&mut self, new: &DirectedPose, nearest: Neighbor) {
        let motion = self.connector.motion();
        if !motion.is_pose_free(&new.pose) {
            return;
        }
        let to_goal = self.least_cost_to_go(new.pose.position);
        // Only parents through which the path would be cheaper than the best one are of use.
        let cheaper_than = self.best - to_goal;
        if !self.collect_near(new.pose.position, nearest, cheaper_than) {
            return;
        }
        let Some((parent, connection)) = self.cheapest_parent(new, cheaper_than) else {
            return;
        };
        let cost = self.tree.cost_to_come(parent) + connection.cost;
        if cost + to_goal >= self.best {
            return;
        }
        let laid = if self.params.errata.curves_run_from_parent_to_child {
            Laid::Ahead
        } else {
            Laid::Backwards
        };
        let node = self.add(parent, new, &connection, laid);
        self.rewire(node);
    }

    /// Neighbours within r, and the nearest, as candidates. `false` if a path through any of them to `new` costs no less than
    /// `cheaper_than`.
    fn collect_near(&mut self, new: Point2, nearest: Neighbor, cheaper_than: f64) -> bool {
        let radius = self.rewire_radius();
        self.index.within(new, radius, &mut self.near);
        if nearest.distance_squared > radius * radius {
            self.near.push(nearest);
        }
        let limit = self.params.near_limit;
        let Some(last) = limit.checked_sub(1) else {
            return false;
        };
        // In a crowded tree most neighbours are beyond the limit. Cutting back now and then costs less than sorting all.
        let room = limit.saturating_mul(2).max(limit.saturating_add(CUT_BACK));
        let mut most = f64::INFINITY;
        let mut least = f64::INFINITY;
        self.candidates.clear();
        for neighbor in &self.near {
            let node = NodeId(neighbor.id);
            let distance = neighbor.distance_squared.sqrt();
            let edge = self.connector.cost().lower_bound(distance);
            let bound = self.tree.cost_to_come(node) + edge;
            if bound > most {
                continue;
            }
            least = least.min(bound);
            self.candidates.push(Candidate { bound, edge, node });
            if self.candidates.len() == room {
                self.candidates
                    .select_nth_unstable_by(last, Candidate::order);
                most = self.candidates[last].bound;
                self.candidates.truncate(limit);
            }
        }
        if least >= cheaper_than {
            return false;
        }
        if self.candidates.len() > limit {
            self.candidates
                .select_nth_unstable_by(last, Candidate::order);
            self.candidates.truncate(limit);
        }
        true
    }

    /// r, or what is left of it at the present size of the tree: γ (ln m / m)^(1/3) in the three dimensions of a pose, with
    /// Karaman and Frazzoli's γ for the measure of the corridor, headings counted as ε per rad.
    fn rewire_radius(&self) -> f64 {
        let radius = self.params.rewire_radius();
        if !self.params.rewire_radius_shrinks {
            return radius;
        }
        let nodes = self.tree.len().max(2) as f64;
        let unit_ball = 4.0 / 3.0 * std::f64::consts::PI;
        let gamma = 2.0 * (4.0 / 3.0 * self.measure / unit_ball).cbrt();
        radius.min(gamma * (nodes.ln() / nodes).cbrt())
    }

    /// Lines 11–21: the parent through which `new` is reached at least cost, and at less than `cheaper_than`.
    fn cheapest_parent(
        &mut self,
        new: &DirectedPose,
        cheaper_than: f64,
    ) -> Option<(NodeId, Connection)> {
        let mut best = cheaper_than;
        let mut found = None;
        // The best is usually among the first: sorted are only as many as are examined, some at a time.
        let mut sorted = 0;
        for i in 0..self.candidates.len() {
            if i == sorted {
                let rest = &mut self.candidates[sorted..];
                let count = rest.len().min(SORTED_AT_ONCE);
                if count < rest.len() {
                    rest.select_nth_unstable_by(count - 1, Candidate::order);
                }
                rest[..count].sort_unstable_by(Candidate::order);
                sorted += count;
            }
            let Candidate { bound, node, .. } = self.candidates[i];
            if bound >= best {
                break;
            }
            let from = self.tree.value(node);
            let cost = self.tree.cost_to_come(node);
            let connection = if self.params.errata.curves_run_from_parent_to_child {
                self.connect_ahead(from, new, best - cost)
            } else {
                self.connector.connect_as_printed(from, new, best - cost)
            };
            if let Some(connection) = connection {
                best = cost + connection.cost;
                found = Some((node, connection));
            }
        }
        found
    }

    /// A connection to a pose that lies ahead; behind, every curve would have to turn back.
    fn connect_ahead(
        &self,
        from: &DirectedPose,
        to: &DirectedPose,
        cheaper_than: f64,
    ) -> Option<Connection> {
        let way = to.pose.position - from.pose.position;
        if way.dot(&from.direction) <= 0.0 {
            return None;
        }
        self.connector.connect(from, to, cheaper_than)
    }

    /// Lines 22–23, and the arrival if there is one.
    fn add(
        &mut self,
        parent: NodeId,
        at: &DirectedPose,
        connection: &Connection,
        laid: Laid,
    ) -> NodeId {
        let node = self.tree.add(parent, connection.cost, *at);
        self.laid.push(laid);
        self.index.insert(at.pose.position, node.0);
        self.arrive(node);
        node
    }

    /// The curve that leads to a node from its parent; `None` at the root.
    fn curve_to(&self, node: NodeId) -> Option<FergusonCurve> {
        let from = self.tree.value(self.tree.parent(node)?);
        let to = self.tree.value(node);
        Some(match self.laid[node.index()] {
            Laid::Ahead => self.connector.curve(from, to),
            Laid::Backwards => self.connector.curve_as_printed(from, to),
            // The trunk was added first, node by node after the root.
            Laid::Trunk => self.ends.trunk[node.index() - 1].curve,
        })
    }

    /// Lines 25–32: neighbours that are reached at less cost through `new`. All their descendants gain.
    fn rewire(&mut self, new: NodeId) {
        let from = *self.tree.value(new);
        let cost = self.tree.cost_to_come(new);
        // Those that even a straight edge would not help need not be looked up; a bound is off by rounding.
        self.candidates
            .retain(|c| cost + c.edge < (c.bound - c.edge) + ROUNDING * c.bound);
        self.candidates.sort_unstable_by(Candidate::order);
        let mut has_changed = false;
        for i in 0..self.candidates.len() {
            let node = self.candidates[i].node;
            let gain = self.tree.cost_to_come(node) - cost;
            if gain <= self.candidates[i].edge || node == NodeId::ROOT {
                continue;
            }
            let to = self.tree.value(node);
            if let Some(connection) = self.connect_ahead(&from, to, gain)
                && self.tree.rewire(node, new, connection.cost)
            {
                self.laid[node.index()] = Laid::Ahead;
                has_changed = true;
            }
        }
        if has_changed {
            self.refresh();
        }
    }

    /// Line 33: whether the goal is reached from `node`, and at what cost.
    fn arrive(&mut self, node: NodeId) {
        let at = *self.tree.value(node);
        let cost = self.tree.cost_to_come(node);
        if self.params.goal == GoalMode::Ball {
            if self.problem.goal.contains(at.pose.position) {
                self.arrive_on(node);
            }
            return;
        }
        if at.pose.position == self.problem.goal.position
            && self.problem.goal.heading.is_none_or(|heading| {
                angle::difference(heading, at.pose.heading).abs() <= SAME_HEADING
            })
        {
            self.arrive_on(node);
            return;
        }
        let reach = GOAL_REACH * self.params.max_step();
        for (i, entry) in self.ends.entries.iter().enumerate() {
            if (entry.position - at.pose.position).norm() > reach {
                continue;
            }
            let cheaper_than = self.best - cost - entry.cost_to_go;
            let connection = match &entry.pose {
                Some(pose) => self.connect_ahead(&at, pose, cheaper_than),
                None => self.connect_to_point(&at, entry.position, cheaper_than),
            };
            if connection.is_some() {
                self.arrivals.push(Arrival {
                    node,
                    connection,
                    entry: i,
                });
                self.refresh();
            }
        }
    }

    /// An arrival at a node itself, without another curve.
    fn arrive_on(&mut self, node: NodeId) {
        self.arrivals.push(Arrival {
            node,
            connection: None,
            entry: 0,
        });
        self.refresh();
    }

    /// The cheapest of three ways to a goal of any heading: along an arc, or turning half as far.
    fn connect_to_point(
        &self,
        from: &DirectedPose,
        goal: Point2,
        cheaper_than: f64,
    ) -> Option<Connection> {
        let way = goal - from.pose.position;
        let chord = way.y.atan2(way.x);
        let lean = angle::difference(chord, from.pose.heading);
        let mut best = cheaper_than;
        let mut found = None;
        for turn in [lean, 0.5 * lean, 0.0] {
            let to = Pose2 {
                position: goal,
                heading: angle::wrap(chord + turn),
            };
            if let Some(connection) = self.connect_ahead(from, &to.into(), best) {
                best = connection.cost;
                found = Some(connection);
            }
        }
        found
    }

    /// A lower bound of the cost from `position` to the nearest admissible end.
    fn least_cost_to_go(&self, position: Point2) -> f64 {
        let distance = (self.problem.goal.position - position).norm();
        let radius = match self.params.goal {
            GoalMode::Pose => 0.0,
            GoalMode::Ball => self.problem.goal.tolerance,
        };
        self.connector
            .cost()
            .lower_bound((distance - radius).max(0.0))
    }

    /// The cost of the cheapest path, after arrivals or the costs of their ancestors have changed.
    fn refresh(&mut self) {
        if let Some(arrival) = self.best_arrival() {
            self.best = self.cost_of(&arrival);
        }
    }

    /// Notes a cheaper path than the last one reported, and tells the observer.
    fn report_improvement(&mut self, meter: &Meter<'_>, observe: &mut dyn FnMut(&Improvement)) {
        if self.best >= self.reported {
            return;
        }
        self.reported = self.best;
        let length = self.best_arrival().map_or(f64::INFINITY, |arrival| {
            self.curves_to(&arrival)
                .iter()
                .map(FergusonCurve::length)
                .sum()
        });
        let improvement = Improvement {
            iteration: meter.iterations(),
            cost: self.best,
            length,
        };
        observe(&improvement);
        self.improvements.push(improvement);
    }

    fn best_arrival(&self) -> Option<Arrival> {
        self.arrivals
            .iter()
            .copied()
            .min_by(|a, b| self.cost_of(a).total_cmp(&self.cost_of(b)))
    }

    fn cost_of(&self, arrival: &Arrival) -> f64 {
        self.tree.cost_to_come(arrival.node)
            + arrival.connection.map_or(0.0, |c| c.cost)
            + self.ends.entries[arrival.entry].cost_to_go
    }

    fn curves_to(&self, arrival: &Arrival) -> Vec<FergusonCurve> {
        let nodes = self.tree.path_to(arrival.node);
        let mut curves: Vec<_> = nodes
            .iter()
            .filter_map(|&node| self.curve_to(node))
            .collect();
        if let Some(connection) = arrival.connection {
            curves.push(connection.curve);
            curves.extend(&self.ends.entries[arrival.entry].rest);
        }
        curves
    }

    fn finish(mut self, iterations: u64) -> CorridorSearch {
        let best = self.best_arrival();
        // Its memory is worth having back before the edges are laid out.
        self.index = KdTree::new();
        let mut edges = Vec::with_capacity(self.tree.len() - 1);
        edges.extend(self.tree.ids().filter_map(|node| self.curve_to(node)));
        CorridorSearch {
            path: best.as_ref().map(|arrival| self.curves_to(arrival)),
            cost: best.as_ref().map_or(f64::INFINITY, |b| self.cost_of(b)),
            guide: self.ends.guide.clone(),
            edges,
            improvements: self.improvements,
            iterations,
        }
    }
}

#[cfg(test)]
mod tests;
