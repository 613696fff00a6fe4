//! Ends with a prescribed heading: a Dubins word from the end pose onto the guide.
//!
//! A guide of straight segments leaves the start in whatever direction is shortest. Where that differs much from the
//! start's heading, the corridor about it holds no way to turn, and a search inside finds nothing. So the guide's
//! end is replaced by a turn, a straight and a turn (Dubins 1957; the words LSL, RSR, LSR and RSL) that leaves along the
//! prescribed heading and arrives on the guide along it (D11). The goal is the same problem travelled backwards.
//!
//! Circles of the word have 1.02 times the smallest radius: the cubics that follow them are tighter than a circle by less
//! than that.

use crate::budget::Meter;
use crate::connection::arc_speed;
use bikebot_geometry::{FergusonCurve, Point2, Polyline, Pose2, Vector2, angle};
use std::f64::consts::{PI, TAU};

/// Radius of the circles in units of the smallest allowed.
const RADIUS_FACTOR: f64 = 1.02;

/// Longest piece of an arc that one cubic follows, rad. With tangents of [`arc_speed`] a cubic over 30° exceeds the
/// curvature of its circle by less than a hundredth.
const MAX_PIECE: f64 = PI / 6.0;

/// Turns this close to a full circle are rounding of no turn at all, rad.
const FULL_CIRCLE_TOLERANCE: f64 = 1e-9;

/// Most pieces of one part of a word, where steps are far too short for it.
const MOST_PIECES: f64 = 1000.0;

/// Most places on a guide at which an arc may join, where turns are far too tight for it.
const MOST_JOINTS: f64 = 10_000.0;

/// A turn to the left or to the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    Left,
    Right,
}

impl Turn {
    fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}

/// A turn, a straight and a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DubinsWord {
    start: Pose2,
    radius: f64,
    turns: [Turn; 2],
    /// Angles of the two turns, rad, in [0, 2π).
    angles: [f64; 2],
    /// Length of the straight, m.
    straight: f64,
}

impl DubinsWord {
    /// The words that lead from `start` to `end` with circles of `radius` (m), shortest first.
    ///
    /// LSR and RSL exist only where their circles do not overlap; LSL and RSR always do.
    #[must_use]
    pub fn between(start: &Pose2, end: &Pose2, radius: f64) -> Vec<Self> {
        let mut words: Vec<_> = [
            [Turn::Left, Turn::Left],
            [Turn::Right, Turn::Right],
            [Turn::Left, Turn::Right],
            [Turn::Right, Turn::Left],
        ]
        .into_iter()
        .filter_map(|turns| Self::new(start, end, radius, turns))
        .collect();
        // A stable sort: equal lengths keep the order above.
        words.sort_by(|a, b| a.length().total_cmp(&b.length()));
        words
    }

    fn new(start: &Pose2, end: &Pose2, radius: f64, turns: [Turn; 2]) -> Option<Self> {
        let centre =
            |pose: &Pose2, turn: Turn| pose.position + pose.left_normal() * (radius * turn.sign());
        let between = centre(end, turns[1]) - centre(start, turns[0]);
        let distance = between.norm();
        let (heading, straight) = if turns[0] == turns[1] {
            // The outer tangent is parallel to the line of centres; coinciding centres leave no straight.
            if distance > 1e-12 * radius {
                (direction(between), distance)
            } else {
                (start.heading, 0.0)
            }
        } else {
            // The inner tangent crosses the line of centres at an angle of sine 2r/distance.
            let squared = distance * distance - 4.0 * radius * radius;
            if squared.is_nan() || squared < 0.0 {
                return None;
            }
            let lean = (2.0 * radius / distance).min(1.0).asin();
            (direction(between) + turns[0].sign() * lean, squared.sqrt())
        };
        let word = Self {
            start: *start,
            radius,
            turns,
            angles: [
                turn_angle(turns[0], start.heading, heading),
                turn_angle(turns[1], heading, end.heading),
            ],
            straight,
        };
        word.length().is_finite().then_some(word)
    }

    /// Length of the whole word, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.radius * (self.angles[0] + self.angles[1]) + self.straight
    }

    /// Poses along the word, both ends included: the ends of its pieces, arcs cut to at most 30° and the straight to at most
    /// `max_step` (m), though into no more than a thousand pieces each.
    #[must_use]
    pub fn poses(&self, max_step: f64) -> Vec<Pose2> {
        let mut poses = vec![self.start];
        let mut at = self.start;
        for part in 0..3 {
            if part == 1 {
                let pieces = (self.straight / max_step).ceil().clamp(1.0, MOST_PIECES);
                let step = self.straight / pieces;
                if self.straight <= 1e-9 * self.radius {
                    continue;
                }
                for _ in 0..pieces as usize {
                    at.position += at.direction() * step;
                    poses.push(at);
                }
            } else {
                let (turn, whole) = (self.turns[part / 2], self.angles[part / 2]);
                let longest = MAX_PIECE.min(max_step / self.radius);
                let pieces = (whole / longest).ceil().min(MOST_PIECES);
                for _ in 0..pieces as usize {
                    at = advance(&at, turn, whole / pieces, self.radius);
                    poses.push(at);
                }
            }
        }
        poses
    }
}

/// The pose after turning by `by` (rad) on a circle.
fn advance(from: &Pose2, turn: Turn, by: f64, radius: f64) -> Pose2 {
    let sign = turn.sign();
    let centre = from.position + from.left_normal() * (radius * sign);
    let heading = angle::wrap(from.heading + sign * by);
    let to = Pose2 {
        position: centre,
        heading,
    };
    Pose2 {
        position: centre - to.left_normal() * (radius * sign),
        heading,
    }
}

/// How far to turn one way round to get from one heading to another, rad, in [0, 2π).
fn turn_angle(turn: Turn, from: f64, to: f64) -> f64 {
    let by = (turn.sign() * (to - from)).rem_euclid(TAU);
    if by > TAU - FULL_CIRCLE_TOLERANCE {
        0.0
    } else {
        by
    }
}

fn direction(v: Vector2) -> f64 {
    v.y.atan2(v.x)
}

/// The first or last part of a path: from the start pose onto the guide, or from the guide to the goal pose.
#[derive(Debug, Clone, PartialEq)]
pub struct EndArc {
    /// The curves in the direction of travel; each within the curvature limit and free.
    pub curves: Vec<FergusonCurve>,
    /// Arc length on the guide where it joins (start) or leaves (goal), m.
    pub joint: f64,
}

/// Which end of the guide an arc is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GuideEnd {
    /// The guide's first vertex: an arc that leaves a pose there.
    Start,
    /// The guide's last vertex: an arc that arrives at a pose there.
    Goal,
}

/// The shortest admissible word between `pose` and the nearest place on `guide` that has one.
///
/// Places are tried at growing distances from that end of the guide, in steps of a quarter of the turning radius; words
/// that cost a detour of more than three radii and twice the replaced length are not considered. `is_admissible` judges each
/// curve in the direction of travel. `None` if no place on the guide can be joined, or `meter` runs out first: each place
/// counts as an iteration.
pub fn find(
    guide: &Polyline,
    end: GuideEnd,
    pose: &Pose2,
    max_curvature: f64,
    max_step: f64,
    is_admissible: &dyn Fn(&FergusonCurve) -> bool,
    meter: &mut Meter<'_>,
) -> Option<EndArc> {
    let smallest = 1.0 / max_curvature;
    let radius = RADIUS_FACTOR * smallest;
    let length = guide.length();
    let step = (0.25 * smallest).max(length / MOST_JOINTS);
    let mut distance: f64 = 0.5 * smallest;
    while distance <= length && meter.step_dearly() {
        let joint = match end {
            GuideEnd::Start => distance,
            GuideEnd::Goal => length - distance,
        };
        let on_guide = Pose2 {
            position: guide.point_at(joint),
            heading: guide.heading_at(joint),
        };
        let words = match end {
            GuideEnd::Start => DubinsWord::between(pose, &on_guide, radius),
            GuideEnd::Goal => DubinsWord::between(&on_guide, pose, radius),
        };
        for word in words {
            if word.length() > 3.0 * smallest + 3.0 * distance {
                break;
            }
            let last = match end {
                GuideEnd::Start => on_guide,
                GuideEnd::Goal => *pose,
            };
            let curves = follow(&word, last, max_step);
            if curves.iter().all(is_admissible) {
                return Some(EndArc { curves, joint });
            }
        }
        distance += step;
    }
    None
}

/// The word as curves. They end exactly in `last`, not where rounding left the word.
fn follow(word: &DubinsWord, last: Pose2, max_step: f64) -> Vec<FergusonCurve> {
    let mut poses = word.poses(max_step);
    if let Some(end) = poses.last_mut() {
        *end = last;
    }
    poses
        .windows(2)
        .map(|pair| {
            let chord = (pair[1].position - pair[0].position).norm();
            let turn = pair[1].heading - pair[0].heading;
            FergusonCurve::between(pair[0], pair[1], arc_speed(chord, turn))
        })
        .collect()
}

/// The guide with its ends replaced by the arcs: the middle of the corridor to search.
#[must_use]
pub fn bend_guide(guide: &Polyline, start: Option<&EndArc>, goal: Option<&EndArc>) -> Polyline {
    let from = start.map_or(0.0, |arc| arc.joint);
    let to = goal.map_or(guide.length(), |arc| arc.joint);
    let mut vertices: Vec<Point2> = Vec::new();
    if let Some(arc) = start {
        vertices.extend(arc.curves.iter().map(FergusonCurve::start_point));
    }
    vertices.push(guide.point_at(from));
    for (i, &vertex) in guide.vertices().iter().enumerate() {
        let s = guide.cumulative(i);
        if s > from && s < to {
            vertices.push(vertex);
        }
    }
    if to > from {
        vertices.push(guide.point_at(to));
    }
    if let Some(arc) = goal {
        vertices.extend(arc.curves.iter().map(FergusonCurve::end_point));
    }
    // Points of a finite guide and of judged curves are finite, and there is at least one.
    Polyline::new(vertices).unwrap_or_else(|_| guide.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use bikebot_geometry::ParametricCurve;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Pose2> {
        (-6.0..6.0_f64, -6.0..6.0_f64, -PI..PI).prop_map(|(x, y, h)| Pose2::new(x, y, h))
    }

    #[test]
    fn straight_ahead_is_a_straight_line() {
        let (from, to) = (Pose2::new(1.0, 1.0, 0.5), Pose2::new(1.0, 1.0, 0.5));
        let ahead = Pose2 {
            position: to.position + to.direction() * 3.0,
            ..to
        };
        let words = DubinsWord::between(&from, &ahead, 1.0);
        assert!((words[0].length() - 3.0).abs() < 1e-9);
        // To the pose itself: nothing to do, and no full circle out of rounding.
        assert!(DubinsWord::between(&from, &to, 1.0)[0].length() < 1e-9);
    }

    #[test]
    fn a_u_turn_is_half_a_circle() {
        let words = DubinsWord::between(&Pose2::new(0.0, 0.0, 0.0), &Pose2::new(0.0, 4.0, PI), 2.0);
        assert!((words[0].length() - 2.0 * PI).abs() < 1e-9);
        let poses = words[0].poses(10.0);
        assert_eq!(poses.len(), 7);
        assert!((poses[3].position - Point2::new(2.0, 2.0)).norm() < 1e-12);
    }

    #[test]
    fn circles_that_overlap_have_no_inner_tangent() {
        let near = Pose2::new(0.5, 0.0, 0.0);
        let words = DubinsWord::between(&Pose2::new(0.0, 0.0, 0.0), &near, 1.0);
        assert!(words.iter().all(|w| w.length().is_finite()));
        assert!(words.len() >= 2);
    }

    proptest! {
        #[test]
        fn every_word_arrives(from in pose(), to in pose(), radius in 0.3..2.0_f64) {
            let words = DubinsWord::between(&from, &to, radius);
            prop_assert!(words.len() >= 2);
            for pair in words.windows(2) {
                prop_assert!(pair[0].length() <= pair[1].length());
            }
            for word in &words {
                prop_assert!(word.length() >= (to.position - from.position).norm() - 1e-9);
                let poses = word.poses(1.0);
                let last = poses[poses.len() - 1];
                // Some twenty steps, and up to 1e-9 rad of a turn left out.
                prop_assert!((last.position - to.position).norm() < 1e-7);
                prop_assert!(angle::difference(last.heading, to.heading).abs() < 1e-8);
            }
        }

        #[test]
        fn the_curves_that_follow_a_word_join_and_keep_the_limit(from in pose(), to in pose()) {
            let smallest = 1.25;
            for word in DubinsWord::between(&from, &to, RADIUS_FACTOR * smallest) {
                let curves = follow(&word, to, 2.0);
                for pair in curves.windows(2) {
                    prop_assert_eq!(pair[0].end_point(), pair[1].start_point());
                    let kink = angle::difference(pair[1].start_pose().heading, pair[0].end_pose().heading);
                    prop_assert!(kink.abs() < 1e-9);
                }
                for curve in &curves {
                    prop_assert!(curve.is_within_curvature(1.0 / smallest), "{}", curve.max_curvature());
                }
            }
        }
    }

    fn meter() -> Meter<'static> {
        Meter::new(&Budget::unlimited())
    }

    /// Found in review: with a turning radius of a micrometre (or of nothing) there were as many places as a guide has
    /// micrometres, and no deadline among them.
    #[test]
    fn the_places_tried_are_bounded_and_count_against_the_budget() {
        let pose = Pose2::new(0.0, 0.0, PI / 2.0);
        for max_curvature in [1e6, 1e300] {
            let mut meter = meter();
            let refuse = |_: &FergusonCurve| false;
            let arc = find(
                &guide(),
                GuideEnd::Start,
                &pose,
                max_curvature,
                5.0,
                &refuse,
                &mut meter,
            );
            assert!(arc.is_none());
            assert!(
                (9_000..=10_001).contains(&meter.iterations()),
                "{}",
                meter.iterations()
            );
        }
        let mut meter = Meter::new(&Budget::of_iterations(3));
        let arc = find(
            &guide(),
            GuideEnd::Start,
            &pose,
            0.8,
            5.0,
            &|_| false,
            &mut meter,
        );
        assert!(arc.is_none() && meter.iterations() == 3);
    }

    #[test]
    fn a_step_of_nothing_cuts_a_word_into_bounded_pieces() {
        let words =
            DubinsWord::between(&Pose2::new(0.0, 0.0, 1.0), &Pose2::new(9.0, 0.0, 0.0), 1.0);
        assert!(words[0].poses(1e-12).len() <= 3001);
    }

    /// A guide that leaves to the right of a bike looking left, and arrives from below at one looking right.
    fn guide() -> Polyline {
        Polyline::new(vec![
            Point2::new(0.0, 0.0),
            Point2::new(20.0, 0.0),
            Point2::new(20.0, 20.0),
        ])
        .unwrap()
    }

    #[test]
    fn the_start_is_joined_to_the_guide_along_both_headings() {
        let pose = Pose2::new(0.0, 0.0, PI / 2.0);
        let arc = find(
            &guide(),
            GuideEnd::Start,
            &pose,
            0.8,
            5.0,
            &|_| true,
            &mut meter(),
        )
        .unwrap();
        let (first, last) = (arc.curves[0], arc.curves[arc.curves.len() - 1]);
        assert_eq!(first.start_point(), pose.position);
        assert!((first.heading(0.0) - pose.heading).abs() < 1e-12);
        assert!((last.end_point() - Point2::new(arc.joint, 0.0)).norm() < 1e-12);
        assert!(last.end_pose().heading.abs() < 1e-9);
    }

    #[test]
    fn the_goal_is_joined_in_the_direction_of_travel() {
        let pose = Pose2::new(20.0, 20.0, 0.0);
        let arc = find(
            &guide(),
            GuideEnd::Goal,
            &pose,
            0.8,
            5.0,
            &|_| true,
            &mut meter(),
        )
        .unwrap();
        let (first, last) = (arc.curves[0], arc.curves[arc.curves.len() - 1]);
        assert!((first.start_point() - guide().point_at(arc.joint)).norm() < 1e-12);
        assert!((first.heading(0.0) - PI / 2.0).abs() < 1e-9);
        assert_eq!(last.end_point(), pose.position);
        assert!(last.end_pose().heading.abs() < 1e-12);
    }

    #[test]
    fn where_nothing_is_admissible_there_is_no_arc() {
        let pose = Pose2::new(0.0, 0.0, PI / 2.0);
        assert!(
            find(
                &guide(),
                GuideEnd::Start,
                &pose,
                0.8,
                5.0,
                &|_| false,
                &mut meter()
            )
            .is_none()
        );
        let point = Polyline::new(vec![Point2::origin()]).unwrap();
        assert!(
            find(
                &point,
                GuideEnd::Start,
                &pose,
                0.8,
                5.0,
                &|_| true,
                &mut meter()
            )
            .is_none()
        );
    }

    #[test]
    fn a_bent_guide_runs_along_its_arcs_and_else_where_it_ran() {
        let start = Pose2::new(0.0, 0.0, PI / 2.0);
        let goal = Pose2::new(20.0, 20.0, 0.0);
        let guide = guide();
        let first = find(
            &guide,
            GuideEnd::Start,
            &start,
            0.8,
            5.0,
            &|_| true,
            &mut meter(),
        );
        let last = find(
            &guide,
            GuideEnd::Goal,
            &goal,
            0.8,
            5.0,
            &|_| true,
            &mut meter(),
        );
        let bent = bend_guide(&guide, first.as_ref(), last.as_ref());
        assert_eq!(bent.vertices()[0], start.position);
        assert_eq!(bent.vertices()[bent.vertices().len() - 1], goal.position);
        assert!(bent.vertices().contains(&Point2::new(20.0, 0.0)));
        assert!(bent.project(Point2::new(15.0, 0.0)).distance < 1e-12);
        assert_eq!(bend_guide(&guide, None, None), guide);
    }
}
