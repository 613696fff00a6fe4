//! BreezySLAM's `.dat` logs: one scan a line, numbers between blanks.
//!
//! | field, from 1 | is |
//! |---|---|
//! | 1 | time, µs |
//! | 3, 4 | counts of the left and the right wheel's encoder |
//! | 25 … | ranges, mm, counter-clockwise; 0: no return, below 20: an error code of the device |
//!
//! The robot is that of the Mines ParisTech data set, for which the format was made (Steux & El Hamzaoui, *CoreSLAM: a SLAM
//! algorithm in less than 200 lines of C code*, ICARCV 2010); its constants are those published with it:
//!
//! | | |
//! |---|---|
//! | wheels | radius 77 mm, 330 mm apart, 2000 counts a turn |
//! | laser | Hokuyo URG-04LX, 145 mm ahead of the axle, 1024 beams a turn of 0.1 s, good to 4 m |
//! | beams not used | the 70 at either end, which may look at the robot |
//!
//! The middle range of the line looks straight ahead. The wheels of a log of another robot mean something else, and its map comes
//! out wrong.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use bikebot_dynamics::LaserScan;
use bikebot_geometry::Pose2;

use super::error::shorten;
use super::{
    Clock, FARTHEST, LogError, LogFormat, LogOptions, LogProblem, LoggedScan, MOST_BEAMS, ScanLog,
    level_laser,
};

/// Fields before the ranges.
const HEADER: usize = 24;

/// Wheel radius, m.
const WHEEL_RADIUS: f64 = 0.077;
/// From wheel to wheel, m.
const TRACK: f64 = 0.330;
/// Counts of a turn of a wheel.
const COUNTS: f64 = 2000.0;
/// Laser ahead of the axle, m.
const LASER_AHEAD: f64 = 0.145;
/// Beams of a full turn of the laser.
const BEAMS_PER_TURN: f64 = 1024.0;
/// Largest range the device is good for, m.
const MAX_RANGE: f64 = 4.0;
/// Beams at either end that are not used.
const UNUSED: usize = 70;

/// Where two wheels have carried the robot.
#[derive(Debug, Clone, Copy)]
struct Odometer {
    counts: (i64, i64),
    pose: Pose2,
}

impl Odometer {
    /// Along the arc that the two wheels roll.
    fn advance(&mut self, counts: (i64, i64)) {
        let way = |now: i64, before: i64| {
            // As real numbers: no two counts are too far apart for them.
            (now as f64 - before as f64) / COUNTS * TAU * WHEEL_RADIUS
        };
        let left = way(counts.0, self.counts.0);
        let right = way(counts.1, self.counts.1);
        let turn = (right - left) / TRACK;
        let way = 0.5 * (left + right);
        // The chord of the arc: sin(x) / x of the half angle.
        let half = 0.5 * turn;
        let chord = if half.abs() < 1e-9 {
            way
        } else {
            way * half.sin() / half
        };
        let step = Pose2::new(chord * half.cos(), chord * half.sin(), turn);
        self.pose = self.pose.compose(&step);
        self.counts = counts;
    }
}

/// Reads the text of a log.
///
/// # Errors
///
/// [`LogError`].
pub(super) fn parse(name: &str, text: &str, options: &LogOptions) -> Result<ScanLog, LogError> {
    let max_range = options.max_range.unwrap_or(MAX_RANGE);
    let mut scans: Vec<LoggedScan> = Vec::new();
    let mut odometer: Option<Odometer> = None;
    let mut clock = Clock::default();
    for (index, content) in text.lines().enumerate() {
        let line = index + 1;
        let words = content.split_ascii_whitespace();
        if words
            .clone()
            .next()
            .is_none_or(|word| word.starts_with('#'))
        {
            continue;
        }
        let fail = |problem| LogError::new(name, Some(line), problem);
        // Counted before they are kept: a line may be as long as the file.
        let count = words.clone().count();
        if count > HEADER + MOST_BEAMS {
            let found = count - HEADER;
            return Err(fail(LogProblem::TooManyBeams { found }));
        }
        let fields: Vec<&str> = words.collect();
        if fields.len() < HEADER {
            return Err(fail(LogProblem::CutShort {
                found: fields.len(),
                expected: HEADER + 1,
                what: "the time, two wheel counts in fields 3 and 4, ranges from field 25 on"
                    .into(),
            }));
        }
        let beams = fields.len() - HEADER;
        if beams == 0 {
            return Err(fail(LogProblem::NoBeams));
        }
        if let Some(first) = scans.first()
            && first.scan.ranges.len() != beams
        {
            return Err(fail(LogProblem::RangeCount {
                found: beams,
                expected: first.scan.ranges.len(),
                first_line: first.line,
            }));
        }
        let integer = |at: usize, expected: &'static str| {
            fields[at].parse::<i64>().map_err(|_| {
                fail(LogProblem::Field {
                    field: at + 1,
                    found: shorten(fields[at]),
                    expected,
                })
            })
        };
        let start = integer(0, "a time in whole microseconds")? as f64 * 1e-6;
        clock.advance(name, line, start)?;
        let wheel = "a whole number of wheel counts";
        let counts = (integer(2, wheel)?, integer(3, wheel)?);
        let odometer = odometer.get_or_insert(Odometer {
            counts,
            pose: Pose2::new(0.0, 0.0, 0.0),
        });
        odometer.advance(counts);
        let at = odometer.pose.position;
        let is_near = at.x.abs() <= FARTHEST && at.y.abs() <= FARTHEST;
        if !is_near {
            return Err(fail(LogProblem::Strayed { x: at.x, y: at.y }));
        }
        // A line this short is of some other device.
        let unused = if beams > 4 * UNUSED { UNUSED } else { 0 };
        let mut ranges = Vec::with_capacity(beams);
        for beam in 0..beams {
            let at = HEADER + beam;
            let millimetres = integer(at, "a range in whole millimetres, 0 or more")?;
            ranges.push(match millimetres {
                ..0 => {
                    return Err(fail(LogProblem::Field {
                        field: at + 1,
                        found: shorten(fields[at]),
                        expected: "a range in whole millimetres, 0 or more",
                    }));
                }
                _ if beam < unused || beam + unused >= beams => f64::NAN,
                0 => f64::INFINITY,
                some => some as f64 * 1e-3,
            });
        }
        let angle_step = TAU / BEAMS_PER_TURN;
        scans.push(LoggedScan {
            line,
            time: start,
            scan: LaserScan {
                angle_min: -0.5 * angle_step * (beams - 1) as f64,
                angle_step,
                ranges,
                ..LaserScan::default()
            },
            pose: odometer.pose,
        });
    }
    let mut laser = level_laser(max_range, LASER_AHEAD);
    laser.rate = 10.0;
    if let Some(first) = scans.first() {
        laser.beams = first.scan.ranges.len() as u32;
    }
    Ok(ScanLog {
        format: LogFormat::Breezy,
        laser,
        scans,
        skipped: BTreeMap::new(),
        odometry_lines: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Point2;

    /// A line of a log: time, wheels, ranges.
    fn line(time: u64, left: i64, right: i64, ranges: &str) -> String {
        let rest = "0 ".repeat(20);
        format!("{time} 14000 {left} {right} {rest}{ranges} \n")
    }

    fn read(text: &str) -> Result<ScanLog, LogError> {
        super::super::read("a.dat", text.as_bytes(), None, &LogOptions::default())
    }

    fn refused(text: &str) -> String {
        read(text).expect_err("a log with a fault").to_string()
    }

    #[test]
    fn wheels_that_turn_alike_go_straight_and_unlike_on_the_arc_between_them() {
        // Straight for one turn of the wheels, then on a quarter of a circle to the left whose middle is 1 m away: the inner wheel
        // goes 0.835 π / 2 m, the outer 1.165 π / 2 m.
        let counts = |way: f64| (way / (TAU * 0.077) * 2000.0).round() as i64;
        let quarter = TAU / 4.0;
        let (left, right) = (
            2000 + counts(0.835 * quarter),
            2000 + counts(1.165 * quarter),
        );
        let text = line(0, 0, 0, "1000")
            + &line(100_000, 2000, 2000, "1000")
            + &line(200_000, left, right, "1000");
        let log = read(&text).expect("a log");
        let straight = log.scans[1].pose;
        assert!((straight.position - Point2::new(TAU * 0.077, 0.0)).norm() < 1e-12);
        let turned = log.scans[2].pose;
        // Half a count of 0.24 mm on either wheel.
        let end = Point2::new(TAU * 0.077 + 1.0, 1.0);
        assert!((turned.position - end).norm() < 1e-3, "{}", turned.position);
        assert!((turned.heading - quarter).abs() < 1e-3);
        assert!((log.duration() - 0.2).abs() < 1e-12);
        assert!((log.distance() - (TAU * 0.077 + 2_f64.sqrt())).abs() < 2e-3);
    }

    #[test]
    fn ranges_are_millimetres_with_nothing_and_errors_told_apart() {
        let log = read(&line(1_000_000, 5, 5, "0 7 1500")).expect("a log");
        let scan = &log.scans[0];
        assert_eq!((scan.line, scan.time), (1, 1.0));
        assert_eq!(scan.scan.ranges, [f64::INFINITY, 0.007, 1.5]);
        // The middle one looks ahead; 0.007 m is below the least range, so it tells nothing.
        assert_eq!(scan.scan.angle_min, -TAU / 1024.0);
        assert!(log.laser.range_min > 0.007);
        assert_eq!(scan.pose, Pose2::new(0.0, 0.0, 0.0));
    }

    #[test]
    fn faults_are_named_with_their_line_and_what_would_do() {
        let good = line(1_000_000, 5, 5, "1000 1000 1000");
        for (bad, words) in [
            ("1000000 14000 5\n".to_owned(), "ends after 3 fields"),
            (line(2_000_000, 5, 5, ""), "no ranges"),
            (
                line(2_000_000, 5, 5, "1000 1000"),
                "2 ranges, where the first scan (line 1) has 3",
            ),
            (
                line(999_999, 5, 5, "1 1 1"),
                "the time 0.999999 s comes after 1 s (line 1)",
            ),
            (
                line(2_000_000, 5, 5, "1000 nan 1000"),
                "field 26 is \"nan\", expected a range",
            ),
            (line(2_000_000, 5, 5, "1000 -3 1000"), "field 26 is \"-3\""),
            (line(2_000_000, 5, 5, "1000 1e3 1000"), "whole millimetres"),
            (
                line(2_000_000, 5, 5, "1 1 1").replacen('5', "x", 1),
                "wheel counts",
            ),
            (
                line(2_000_000, i64::MAX, i64::MAX, "1 1 1"),
                "the wheel counts carry the robot to (",
            ),
            (
                line(2_000_000, 5, 5, &"1 ".repeat(100_001)),
                "a scan of 100001 ranges; at most 100000 are read",
            ),
        ] {
            let message = refused(&(good.clone() + &bad));
            assert!(message.starts_with("a.dat:2: "), "{message}");
            assert!(message.contains(words), "{message}");
        }
        let nothing = super::super::read(
            "a.dat",
            b"\n",
            Some(LogFormat::Breezy),
            &LogOptions::default(),
        );
        assert!(
            nothing
                .expect_err("nothing")
                .to_string()
                .contains("nothing in it")
        );
    }
}
