//! Where something is at each moment, and which way it faces.

use bikebot_geometry::{Point2, Pose2, angle};

use crate::scenario::{ObstacleSection, Repeat};

/// A piece of the way: a straight line, a turn on the spot, or a wait.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    /// Since it set off, s.
    start: f64,
    /// s.
    duration: f64,
    from: Pose2,
    to: Point2,
    /// How far it turns, rad, counter-clockwise.
    turn: f64,
}

impl Leg {
    fn pose(&self, time: f64) -> Pose2 {
        let share = if self.duration > 0.0 {
            ((time - self.start) / self.duration).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let position = self.from.position + share * (self.to - self.from.position);
        Pose2::new(
            position.x,
            position.y,
            self.from.heading + share * self.turn,
        )
    }

    /// The same way back, to be begun at `start`.
    fn reversed(&self, start: f64) -> Self {
        let end = self.pose(self.start + self.duration);
        Self {
            start,
            duration: self.duration,
            from: end,
            to: self.from.position,
            turn: -self.turn,
        }
    }
}

/// When something is there, and the way it goes meanwhile: an exact function of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Itinerary {
    appears: f64,
    disappears: f64,
    first: Pose2,
    legs: Vec<Leg>,
    duration: f64,
    repeats: bool,
}

impl Itinerary {
    /// The itinerary of an obstacle; `faces_ahead` where its outline shows which way it is turned.
    #[must_use]
    pub fn new(section: &ObstacleSection, faces_ahead: bool) -> Self {
        let points = way_points(section);
        let directions: Vec<f64> = points
            .windows(2)
            .map(|pair| {
                let way = pair[1] - pair[0];
                way.y.atan2(way.x)
            })
            .collect();
        let fixed = section.heading_deg.map(f64::to_radians);
        let heading = fixed.or(directions.first().copied()).unwrap_or(0.0);
        let first = points.first().copied().unwrap_or_else(Point2::origin);
        let mut way = Way {
            legs: Vec::new(),
            at: Pose2::new(first.x, first.y, heading),
            time: 0.0,
        };
        let turns = fixed.is_none() && faces_ahead;
        for (i, (pair, direction)) in points.windows(2).zip(&directions).enumerate() {
            if i > 0 {
                way.wait(section.pause_s);
            }
            if turns {
                way.turn_to(*direction, section.turn_rate_radps);
            }
            way.go_to(pair[1], section.speed_mps);
        }
        let repeats = section.repeat != Repeat::No && !way.legs.is_empty();
        match section.repeat {
            Repeat::No => {}
            Repeat::Loop => {
                way.wait(section.pause_s);
                if turns {
                    way.turn_to(heading, section.turn_rate_radps);
                }
            }
            Repeat::BackAndForth => {
                let there = way.legs.clone();
                way.wait(section.pause_s);
                for leg in there.iter().rev() {
                    way.legs.push(leg.reversed(way.time));
                    way.time += leg.duration;
                }
                way.at = Pose2::new(first.x, first.y, heading);
                way.wait(section.pause_s);
            }
        }
        Self {
            appears: section.appear_s,
            disappears: section.disappear_s.unwrap_or(f64::INFINITY),
            first: Pose2::new(first.x, first.y, heading),
            legs: way.legs,
            duration: way.time,
            repeats,
        }
    }

    /// Whether it never moves, whenever it is there.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.legs.is_empty()
    }

    /// Whether it is there at `time` (s).
    #[must_use]
    pub fn is_there(&self, time: f64) -> bool {
        time >= self.appears && time < self.disappears
    }

    /// When it appears, s.
    #[must_use]
    pub fn appears(&self) -> f64 {
        self.appears
    }

    /// When it is gone, s; infinite if never.
    #[must_use]
    pub fn disappears(&self) -> f64 {
        self.disappears
    }

    /// Its pose at `time` (s), world frame; `None` while it is not there.
    #[must_use]
    pub fn pose(&self, time: f64) -> Option<Pose2> {
        if !self.is_there(time) {
            return None;
        }
        let since = time - self.appears;
        let since = if self.repeats && self.duration > 0.0 {
            since.rem_euclid(self.duration)
        } else {
            since
        };
        let after = self.legs.partition_point(|leg| leg.start <= since);
        Some(match after.checked_sub(1) {
            Some(index) => self.legs[index].pose(since),
            None => self.first,
        })
    }
}

/// The way points; one that repeats the last is no way. A loop ends where it began.
fn way_points(section: &ObstacleSection) -> Vec<Point2> {
    let mut points: Vec<Point2> = section
        .waypoints_m
        .iter()
        .map(|[x, y]| Point2::new(*x, *y))
        .collect();
    if section.repeat == Repeat::Loop
        && let Some(first) = points.first().copied()
    {
        points.push(first);
    }
    points.dedup();
    points
}

/// A way as it is laid.
struct Way {
    legs: Vec<Leg>,
    at: Pose2,
    time: f64,
}

impl Way {
    fn add(&mut self, duration: f64, to: Point2, turn: f64) {
        if duration > 0.0 {
            let leg = Leg {
                start: self.time,
                duration,
                from: self.at,
                to,
                turn,
            };
            self.legs.push(leg);
            self.time += duration;
        }
        self.at = Pose2::new(to.x, to.y, self.at.heading + turn);
    }

    fn wait(&mut self, pause: f64) {
        self.add(pause, self.at.position, 0.0);
    }

    fn go_to(&mut self, to: Point2, speed: f64) {
        self.add((to - self.at.position).norm() / speed, to, 0.0);
    }

    fn turn_to(&mut self, heading: f64, rate: f64) {
        let turn = angle::difference(heading, self.at.heading);
        self.add(turn.abs() / rate, self.at.position, turn);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Rounding of positions of a few metres after a handful of operations.
    const EXACT: f64 = 1e-12;

    fn section(waypoints: &[[f64; 2]], more: &str) -> ObstacleSection {
        let text = format!("shape = \"box:1.0x0.6\"\nwaypoints_m = {waypoints:?}\n{more}");
        toml::from_str(&text).expect("a section")
    }

    #[track_caller]
    fn assert_at(itinerary: &Itinerary, time: f64, x: f64, y: f64, heading: f64) {
        let pose = itinerary.pose(time).expect("it is there");
        assert!(
            (pose.position - Point2::new(x, y)).norm() < EXACT
                && angle::difference(pose.heading, heading).abs() < EXACT,
            "at {time} s: {pose:?}"
        );
    }

    #[test]
    fn it_goes_at_its_speed_turns_on_the_spot_and_stays_at_the_end() {
        let way = section(
            &[[1.0, 0.0], [5.0, 0.0], [5.0, 0.0], [5.0, 3.0]],
            "speed_mps = 2.0\nappear_s = 10.0\npause_s = 0.5",
        );
        let way = Itinerary::new(&way, true);
        assert_eq!(way.pose(9.999), None);
        assert_at(&way, 10.0, 1.0, 0.0, 0.0);
        assert_at(&way, 11.5, 4.0, 0.0, 0.0);
        assert_at(&way, 12.25, 5.0, 0.0, 0.0);
        assert_at(&way, 13.0, 5.0, 0.0, 0.25 * PI);
        assert_at(&way, 14.5, 5.0, 2.0, FRAC_PI_2);
        assert_at(&way, 15.0, 5.0, 3.0, FRAC_PI_2);
        assert_at(&way, 1e6, 5.0, 3.0, FRAC_PI_2);
    }

    #[test]
    fn a_disc_or_a_fixed_heading_does_not_turn() {
        let corner = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]];
        let disc = Itinerary::new(&section(&corner, "speed_mps = 1.0"), false);
        assert_at(&disc, 3.0, 2.0, 1.0, 0.0);
        let fixed = section(&corner, "speed_mps = 1.0\nheading_deg = 30");
        let fixed = Itinerary::new(&fixed, true);
        assert_at(&fixed, 3.0, 2.0, 1.0, PI / 6.0);
    }

    #[test]
    fn back_and_forth_is_the_same_way_played_backwards() {
        let way = section(
            &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]],
            "speed_mps = 1.0\nrepeat = \"back_and_forth\"\npause_s = 0.25",
        );
        let way = Itinerary::new(&way, true);
        // There: 2 s, a wait of 0.25, a turn of 1 s, 2 s; then a wait at the end.
        assert_at(&way, 5.25, 2.0, 2.0, FRAC_PI_2);
        let cycle = 2.0 * 5.25 + 2.0 * 0.25;
        for i in 0..=50 {
            let time = 5.25 * f64::from(i) / 50.0;
            let there = way.pose(time).unwrap();
            assert_at(
                &way,
                cycle - 0.25 - time,
                there.position.x,
                there.position.y,
                there.heading,
            );
            assert_at(
                &way,
                3.0 * cycle + time,
                there.position.x,
                there.position.y,
                there.heading,
            );
        }
    }

    #[test]
    fn a_loop_closes_and_nothing_ever_jumps() {
        for more in [
            "repeat = \"loop\"\npause_s = 0.3",
            "repeat = \"back_and_forth\"",
            "repeat = \"no\"\npause_s = 1.0",
        ] {
            let way = section(&[[0.0, 0.0], [3.0, 1.0], [1.0, 4.0], [-2.0, 2.0]], more);
            let way = Itinerary::new(&way, true);
            let mut last = way.pose(0.0).unwrap();
            for i in 1..40_000 {
                let pose = way.pose(f64::from(i) * 1e-3).unwrap();
                // 1.2 m/s and a quarter turn a second, over a millisecond.
                assert!((pose.position - last.position).norm() < 1.2e-3 + EXACT);
                assert!(angle::difference(pose.heading, last.heading).abs() < 1.571e-3);
                last = pose;
            }
        }
    }

    #[test]
    fn what_stands_stands_while_it_is_there() {
        let still = section(
            &[[3.0, 4.0]],
            "appear_s = 2\ndisappear_s = 5\nheading_deg = 90",
        );
        let still = Itinerary::new(&still, true);
        assert!(still.stands());
        assert_eq!(still.pose(1.9), None);
        assert_at(&still, 2.0, 3.0, 4.0, FRAC_PI_2);
        assert_at(&still, 4.9, 3.0, 4.0, FRAC_PI_2);
        assert_eq!(still.pose(5.0), None);
        // Way points all in one place are no way.
        let still = section(&[[3.0, 4.0], [3.0, 4.0]], "repeat = \"loop\"");
        let still = Itinerary::new(&still, true);
        assert!(still.stands());
        assert_at(&still, 7.0, 3.0, 4.0, 0.0);
    }
}
