//! Line 11 of Algorithm 1: the curve that joins two nodes, judged once.
//!
//! A [`Connection`] exists only if the curve costs less than what is already known, keeps to σ_MAX, and sweeps the
//! footprint past all obstacles. The tests run in that order, cheapest first.

use crate::cost::EdgeCost;
use crate::motion::MotionChecker;
use crate::params::{PlannerParams, TangentRule};
use bikebot_geometry::{FergusonCurve, Pose2, Vector2, angle};

/// A pose with its direction, so that sine and cosine are taken once per node and not once per edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectedPose {
    /// Position (m) and heading (rad).
    pub pose: Pose2,
    /// Unit vector along the heading.
    pub direction: Vector2,
}

impl From<Pose2> for DirectedPose {
    fn from(pose: Pose2) -> Self {
        Self {
            pose,
            direction: pose.direction(),
        }
    }
}

/// An edge that can be ridden: from parent to child, in the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Connection {
    /// Eq. (3)–(4) between the two nodes.
    pub curve: FergusonCurve,
    /// Its length L, m.
    pub length: f64,
    /// Its bending J = ∫ (dσ/ds)² ds, 1/m³.
    pub bending: f64,
    /// Its cost, Eq. (5).
    pub cost: f64,
}

/// Makes connections under one set of parameters.
#[derive(Debug)]
pub struct Connector<'a> {
    tangent: TangentRule,
    tangent_speed: f64,
    max_curvature: f64,
    cost: EdgeCost,
    motion: &'a MotionChecker<'a>,
}

impl<'a> Connector<'a> {
    /// Connections of curvature up to `max_curvature` (σ_MAX, 1/m), free by `motion`.
    #[must_use]
    pub fn new(params: &PlannerParams, max_curvature: f64, motion: &'a MotionChecker<'a>) -> Self {
        Self {
            tangent: params.tangent,
            tangent_speed: params.tangent_speed,
            max_curvature,
            cost: EdgeCost::new(params),
            motion,
        }
    }

    /// The cost by which connections are judged.
    #[must_use]
    pub fn cost(&self) -> &EdgeCost {
        &self.cost
    }

    /// What says whether a motion is free.
    #[must_use]
    pub fn motion(&self) -> &MotionChecker<'a> {
        self.motion
    }

    /// The edge `from` → `to`, if it is cheaper than `cheaper_than`, within the curvature limit and free.
    #[must_use]
    pub fn connect(
        &self,
        from: &DirectedPose,
        to: &DirectedPose,
        cheaper_than: f64,
    ) -> Option<Connection> {
        // Before a curve is made: none is shorter than its chord. `judge` asks again, for a curve given.
        let chord = (to.pose.position - from.pose.position).norm();
        if self.cost.lower_bound(chord) >= cheaper_than {
            return None;
        }
        self.judge(self.curve(from, to), cheaper_than)
    }

    /// Eq. (3)–(4) from `from` to `to`: the curve of the edge that [`Self::connect`] makes.
    #[must_use]
    pub fn curve(&self, from: &DirectedPose, to: &DirectedPose) -> FergusonCurve {
        curve_between(from, to, self.tangent_speed(from, to))
    }

    /// The curve of the edge that [`Self::connect_as_printed`] makes.
    #[must_use]
    pub fn curve_as_printed(&self, parent: &DirectedPose, child: &DirectedPose) -> FergusonCurve {
        self.curve(child, parent).reversed()
    }

    /// The edge `parent` → `child` as lines 11 and 19 print it: the curve is laid from the child to the parent, along
    /// *their* headings, and travelled backwards (D4).
    #[must_use]
    pub fn connect_as_printed(
        &self,
        parent: &DirectedPose,
        child: &DirectedPose,
        cheaper_than: f64,
    ) -> Option<Connection> {
        self.judge(self.curve_as_printed(parent, child), cheaper_than)
    }

    /// A given curve as an edge, under the same tests.
    #[must_use]
    pub fn judge(&self, curve: FergusonCurve, cheaper_than: f64) -> Option<Connection> {
        let chord = (curve.end_point() - curve.start_point()).norm();
        // Not `>=` on the negation: a cost that is not a number is no cost.
        if chord <= 0.0
            || self.cost.lower_bound(chord) >= cheaper_than
            || curve.exceeds_curvature_at_an_end(self.max_curvature)
        {
            return None;
        }
        let (length, bending) = curve.length_and_bending();
        let cost = self.cost.of(length, bending);
        let is_cheaper = cost < cheaper_than;
        if is_cheaper
            && curve.is_within_curvature(self.max_curvature)
            && self.motion.is_curve_free(&curve)
        {
            return Some(Connection {
                curve,
                length,
                bending,
                cost,
            });
        }
        None
    }

    /// The magnitude k of both tangents.
    fn tangent_speed(&self, from: &DirectedPose, to: &DirectedPose) -> f64 {
        let chord = (to.pose.position - from.pose.position).norm();
        match self.tangent {
            TangentRule::Constant => self.tangent_speed,
            TangentRule::Chord => chord,
            TangentRule::ChordSec2 => arc_speed(chord, to.pose.heading - from.pose.heading),
        }
    }
}

/// Tangent magnitude that makes the curve over `chord` (m) with turn `turn` (rad) almost a circular arc:
/// chord / cos²(turn/4).
#[must_use]
pub fn arc_speed(chord: f64, turn: f64) -> f64 {
    let cos = (0.25 * angle::wrap(turn)).cos();
    chord / (cos * cos)
}

#[inline]
fn curve_between(from: &DirectedPose, to: &DirectedPose, speed: f64) -> FergusonCurve {
    FergusonCurve::from_ends(
        from.pose.position,
        from.direction * speed,
        to.pose.position,
        to.direction * speed,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{block, room};
    use bikebot_geometry::{ParametricCurve, Point2};
    use bikebot_world::{Footprint, World};
    use proptest::prelude::*;

    fn params() -> PlannerParams {
        PlannerParams {
            max_curvature: 1.0,
            ..PlannerParams::default()
        }
    }

    fn connect(
        world: &World,
        params: &PlannerParams,
        footprint: &Footprint,
        from: Pose2,
        to: Pose2,
        cheaper_than: f64,
    ) -> Option<Connection> {
        let motion = MotionChecker::new(world, footprint, 0.0, 0.02);
        Connector::new(params, 1.0, &motion).connect(&from.into(), &to.into(), cheaper_than)
    }

    #[test]
    fn a_gentle_bend_is_an_edge_with_its_own_figures() {
        let world = room(20.0, vec![]);
        let (from, to) = (Pose2::new(5.0, 5.0, 0.0), Pose2::new(9.0, 6.0, 0.4));
        let edge = connect(
            &world,
            &params(),
            &Footprint::Point,
            from,
            to,
            f64::INFINITY,
        )
        .unwrap();
        assert_eq!(edge.curve.start_point(), from.position);
        assert_eq!(edge.curve.end_point(), to.position);
        assert_eq!((edge.length, edge.bending), edge.curve.length_and_bending());
        assert!((edge.cost - (edge.length + edge.bending / edge.length.powi(2))).abs() < 1e-12);
    }

    #[test]
    fn what_is_too_tight_too_dear_or_blocked_is_no_edge() {
        let open = room(20.0, vec![]);
        let point = Footprint::Point;
        let (from, to) = (Pose2::new(5.0, 5.0, 0.0), Pose2::new(9.0, 5.0, 0.0));
        let u_turn = Pose2::new(5.0, 6.0, std::f64::consts::PI);
        assert!(connect(&open, &params(), &point, from, u_turn, f64::INFINITY).is_none());
        assert!(connect(&open, &params(), &point, from, to, 4.0).is_none());
        assert!(connect(&open, &params(), &point, from, to, 4.001).is_some());
        assert!(connect(&open, &params(), &point, from, from, f64::INFINITY).is_none());
        assert!(connect(&open, &params(), &point, from, to, f64::NAN).is_none());
        let closed = room(20.0, vec![block(6.9, 4.0, 7.1, 4.9)]);
        assert!(connect(&closed, &params(), &point, from, to, f64::INFINITY).is_some());
        let disc = Footprint::Disc { radius: 0.2 };
        assert!(connect(&closed, &params(), &disc, from, to, f64::INFINITY).is_none());
    }

    #[test]
    fn the_literal_tangent_refuses_what_the_chord_allows() {
        let world = room(20.0, vec![]);
        let (from, to) = (Pose2::new(5.0, 5.0, 0.2), Pose2::new(10.0, 5.0, -0.2));
        let point = Footprint::Point;
        assert!(connect(&world, &params(), &point, from, to, f64::INFINITY).is_some());
        let literal = PlannerParams::literal();
        assert!(connect(&world, &literal, &point, from, to, f64::INFINITY).is_none());
    }

    #[test]
    fn as_printed_the_curve_is_laid_from_the_child_to_the_parent() {
        let world = room(20.0, vec![]);
        let motion = MotionChecker::new(&world, &Footprint::Point, 0.0, 0.02);
        let connector = Connector::new(&PlannerParams::table_1(), 1.0, &motion);
        let at = |x: f64, heading: f64| DirectedPose::from(Pose2::new(x, 5.0, heading));
        // Two nodes that look along the way of travel: from child to parent the curve has to turn round twice.
        let (parent, child) = (at(5.0, 0.0), at(9.0, 0.0));
        assert!(
            connector
                .connect_as_printed(&parent, &child, f64::INFINITY)
                .is_none()
        );
        // Only nodes that look back are joined; travelled, the curve still runs from parent to child.
        let (parent, child) = (at(5.0, 3.1), at(9.0, -3.1));
        let edge = connector
            .connect_as_printed(&parent, &child, f64::INFINITY)
            .unwrap();
        assert_eq!(edge.curve.start_point(), parent.pose.position);
        assert_eq!(edge.curve.end_point(), child.pose.position);
    }

    #[test]
    fn arc_tangents_follow_a_circle() {
        // Over 30°, with the radius that end arcs use, below one per cent of excess curvature.
        for degrees in [1.0_f64, 10.0, 20.0, 30.0] {
            let turn = degrees.to_radians();
            let chord = 2.0 * (0.5 * turn).sin();
            let from = Pose2::new(0.0, 0.0, -0.5 * turn);
            let to = Pose2::new(chord, 0.0, 0.5 * turn);
            let curve = FergusonCurve::between(from, to, arc_speed(chord, turn));
            assert!(
                (curve.max_curvature() - 1.0).abs() < 0.01,
                "{}",
                curve.max_curvature()
            );
        }
    }

    proptest! {
        #[test]
        fn every_edge_keeps_the_limit_and_stays_clear(
            x in 0.5..9.5_f64, y in 0.5..9.5_f64, a in -1.5..1.5_f64, b in -1.5..1.5_f64,
        ) {
            let world = room(10.0, vec![block(4.0, 4.0, 5.0, 7.0)]);
            let bike = Footprint::Capsule { rear: 0.0, front: 0.6, radius: 0.2 };
            let (from, to) = (Pose2::new(2.0, 5.0, a), Pose2::new(x, y, b));
            if let Some(edge) = connect(&world, &params(), &bike, from, to, f64::INFINITY) {
                for i in 0..=500 {
                    let t = f64::from(i) / 500.0;
                    prop_assert!(edge.curve.curvature(t).abs() <= 1.0 + 1e-9);
                    let position: Point2 = edge.curve.point(t);
                    let pose = Pose2 { position, heading: edge.curve.heading(t) };
                    prop_assert!(world.footprint_clearance(&bike, &pose) > 0.0);
                }
            }
        }
    }
}
