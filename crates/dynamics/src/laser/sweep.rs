//! Scan after scan along a ride: beams fired in between the ticks, scans handed out late.

use std::collections::VecDeque;

use bikebot_geometry::{Pose2, angle};
use rand_chacha::ChaCha8Rng;

use super::ray::RayScene;
use super::scan::LaserScan;
use super::scanner::LaserScanner;

/// What two sums of the same times may differ by, s: less than the nanosecond that clocks count.
const SAME_TIME: f64 = 0.5e-9;

/// Where the bike was at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Placed {
    time: f64,
    pose: Pose2,
    roll: f64,
}

impl Placed {
    /// Pose and roll at `time` (s) between `self` and `next`, by straight lines between the two.
    fn towards(&self, next: &Self, time: f64) -> (Pose2, f64) {
        let share = (time - self.time) / (next.time - self.time);
        // Without a time in between, and where sums of times round beyond the ends.
        let share = if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            1.0
        };
        if share == 1.0 {
            return (next.pose, next.roll);
        }
        let position = self.pose.position + share * (next.pose.position - self.pose.position);
        let heading = angle::interpolate(self.pose.heading, next.pose.heading, share);
        (
            Pose2::new(position.x, position.y, heading),
            self.roll + share * (next.roll - self.roll),
        )
    }
}

/// A laser that turns while the bike rides: scan number k begins at k over its rate.
///
/// Fed with where the bike is, tick by tick; each beam is cast from between the two ticks about its own time.
#[derive(Debug, Clone)]
pub struct SweepingLaser {
    scanner: LaserScanner,
    rng: ChaCha8Rng,
    /// Number of the scan under way, or of the next.
    number: u64,
    scan: LaserScan,
    last: Option<Placed>,
    finished: VecDeque<LaserScan>,
}

impl SweepingLaser {
    /// The laser before its first scan; noise and dropouts are drawn from `rng`.
    #[must_use]
    pub fn new(scanner: LaserScanner, rng: ChaCha8Rng) -> Self {
        Self {
            scan: scanner.blank(0.0),
            scanner,
            rng,
            number: 0,
            last: None,
            finished: VecDeque::new(),
        }
    }

    /// The scanner that turns.
    #[must_use]
    pub fn scanner(&self) -> &LaserScanner {
        &self.scanner
    }

    /// Tells where the bike is at `time` (s), fires the beams that were due since it was told last, and hands out the
    /// oldest scan whose latency is over, if there is one.
    ///
    /// `roll` in rad, positive to the right. Where time stands still or goes back nothing is fired. A scan that began before
    /// the first call is left out.
    pub fn advance(
        &mut self,
        scene: &(impl RayScene + ?Sized),
        time: f64,
        pose: &Pose2,
        roll: f64,
    ) -> Option<LaserScan> {
        let now = Placed {
            time,
            pose: *pose,
            roll,
        };
        let before = self.last.unwrap_or_else(|| {
            self.number = self.first_scan_from(time);
            self.scan = self.scanner.blank(self.start_of(self.number));
            now
        });
        let beams = self.scanner.params().beams as usize;
        loop {
            let beam = self.scan.ranges.len();
            let due = self.scan.beam_time(beam);
            let is_due = time.is_finite() && due <= time + SAME_TIME;
            if !is_due {
                break;
            }
            let (pose, roll) = before.towards(&now, due);
            let angle = self.scan.beam_angle(beam);
            let range = self
                .scanner
                .fire(scene, due, angle, &pose, roll, &mut self.rng);
            self.scan.ranges.push(range);
            if self.scan.ranges.len() == beams {
                self.number += 1;
                let next = self.scanner.blank(self.start_of(self.number));
                self.finished
                    .push_back(std::mem::replace(&mut self.scan, next));
            }
        }
        if time.is_finite() && self.last.is_none_or(|last| time > last.time) {
            self.last = Some(now);
        }
        let latency = self.scanner.params().latency;
        let is_over = self
            .finished
            .front()
            .is_some_and(|scan| scan.end() + latency <= time + SAME_TIME);
        is_over.then(|| self.finished.pop_front()).flatten()
    }

    fn start_of(&self, number: u64) -> f64 {
        number as f64 / self.scanner.params().rate
    }

    fn first_scan_from(&self, time: f64) -> u64 {
        // The cast saturates: before time zero the first scan is number zero.
        ((time - SAME_TIME) * self.scanner.params().rate).ceil() as u64
    }
}
