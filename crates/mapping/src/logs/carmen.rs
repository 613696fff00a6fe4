//! CARMEN's text logs: one message a line, its kind first.
//!
//! ```text
//! FLASER n r1 … rn x y theta odom_x odom_y odom_theta ipc_time host logger_time
//! ODOM x y theta tv rv accel ipc_time host logger_time
//! ```
//!
//! Metres, radians, seconds. `FLASER` is a scan of the laser that looks ahead, over 180° but for the 401 ranges of a quarter of a
//! degree each. The pose used is `odom_x odom_y odom_theta`, the robot's odometry; the other one is whatever the program that wrote the log
//! made of it. The laser is taken to sit where the odometry is. `ODOM` is checked and counted. All other kinds, and comments, are passed over
//! and counted.
//!
//! A range at or above the largest is a missing return.

use std::collections::BTreeMap;

use bikebot_dynamics::LaserScan;
use bikebot_geometry::Pose2;

use super::error::shorten;
use super::{
    Clock, FARTHEST, LogError, LogFormat, LogOptions, LogProblem, LoggedScan, MOST_BEAMS, ScanLog,
    level_laser,
};

/// Ranges from this on are missing returns, m, unless told otherwise: SICK's lasers say 81.83 m.
const MAX_RANGE: f64 = 80.0;
/// Fields of a scan beside its ranges.
const AROUND: usize = 11;
/// Most kinds of other lines that are told apart.
const MOST_KINDS: usize = 64;

/// The fields of a line, from which numbers are read.
struct Line<'a> {
    name: &'a str,
    number: usize,
    fields: Vec<&'a str>,
}

impl Line<'_> {
    fn fail(&self, problem: LogProblem) -> LogError {
        LogError::new(self.name, Some(self.number), problem)
    }

    fn need(&self, expected: usize, what: &str) -> Result<(), LogError> {
        let found = self.fields.len();
        if found < expected {
            return Err(self.fail(LogProblem::CutShort {
                found,
                expected,
                what: what.to_owned(),
            }));
        }
        Ok(())
    }

    fn field(&self, at: usize, expected: &'static str) -> LogError {
        self.fail(LogProblem::Field {
            field: at + 1,
            found: shorten(self.fields[at]),
            expected,
        })
    }

    fn number(
        &self,
        at: usize,
        expected: &'static str,
        is_good: impl Fn(f64) -> bool,
    ) -> Result<f64, LogError> {
        match self.fields[at].parse::<f64>() {
            Ok(value) if is_good(value) => Ok(value),
            _ => Err(self.field(at, expected)),
        }
    }

    /// Three fields: a pose.
    fn pose(&self, at: usize) -> Result<Pose2, LogError> {
        let coordinate =
            |at| self.number(at, "a coordinate within ±1e6 m", |v| v.abs() <= FARTHEST);
        let heading = self.number(at + 2, "a finite angle in rad", f64::is_finite)?;
        Ok(Pose2::new(coordinate(at)?, coordinate(at + 1)?, heading))
    }

    fn time(&self, at: usize) -> Result<f64, LogError> {
        self.number(at, "a finite time in s", f64::is_finite)
    }
}

/// First angle and step of a scan of so many ranges, rad.
fn angles(beams: usize) -> (f64, f64) {
    let degrees = match beams {
        1 => return (0.0, 0.0),
        180 | 181 => 1.0,
        360 | 361 => 0.5,
        401 => return (-50_f64.to_radians(), 0.25_f64.to_radians()),
        _ => 180.0 / (beams - 1) as f64,
    };
    (-90_f64.to_radians(), degrees.to_radians())
}

/// Reads the text of a log.
///
/// # Errors
///
/// [`LogError`].
pub(super) fn parse(name: &str, text: &str, options: &LogOptions) -> Result<ScanLog, LogError> {
    let max_range = options.max_range.unwrap_or(MAX_RANGE);
    let mut scans = Vec::new();
    let mut skipped = BTreeMap::new();
    let mut odometry_lines = 0;
    let (mut scan_clock, mut odometry_clock) = (Clock::default(), Clock::default());
    for (index, content) in text.lines().enumerate() {
        let words = content.split_ascii_whitespace();
        let Some(kind) = words.clone().next() else {
            continue;
        };
        // One more than a line may have tells that there are too many; it may be as long as the file.
        let line = || Line {
            name,
            number: index + 1,
            fields: words.clone().take(AROUND + MOST_BEAMS + 1).collect(),
        };
        match kind {
            "FLASER" => {
                let line = line();
                let logged = scan(&line)?;
                scan_clock.advance(name, line.number, logged.time)?;
                scans.push(logged);
            }
            "ODOM" => {
                let line = line();
                line.need(10, "ODOM x y theta tv rv accel ipc_time host logger_time")?;
                line.pose(1)?;
                odometry_clock.advance(name, line.number, line.time(7)?)?;
                odometry_lines += 1;
            }
            other => {
                let kind = if other.starts_with('#') { "#" } else { other };
                let kind = shorten(kind);
                // A file of noise must not fill the memory with kinds.
                let kind = if skipped.len() < MOST_KINDS || skipped.contains_key(&kind) {
                    kind
                } else {
                    "…".to_owned()
                };
                *skipped.entry(kind).or_insert(0) += 1;
            }
        }
    }
    let mut laser = level_laser(max_range, 0.0);
    let beams = scans.iter().map(|logged| logged.scan.ranges.len()).max();
    laser.beams = beams.unwrap_or(1) as u32;
    Ok(ScanLog {
        format: LogFormat::Carmen,
        laser,
        scans,
        skipped,
        odometry_lines,
    })
}

/// A line `FLASER`.
fn scan(line: &Line<'_>) -> Result<LoggedScan, LogError> {
    const WHAT: &str =
        "FLASER n r1 … rn x y theta odom_x odom_y odom_theta ipc_time host logger_time";
    line.need(2, WHAT)?;
    let beams: usize = line.fields[1]
        .parse()
        .map_err(|_| line.field(1, "the number of ranges that follow"))?;
    if beams == 0 {
        return Err(line.fail(LogProblem::NoBeams));
    }
    if beams > MOST_BEAMS {
        return Err(line.fail(LogProblem::TooManyBeams { found: beams }));
    }
    let expected = beams + AROUND;
    line.need(
        expected,
        &format!(
            "FLASER, {beams}, so many ranges, two poses of three numbers, a time, a host and a time"
        ),
    )?;
    if line.fields.len() > expected {
        // One range too many would be read as a coordinate.
        return Err(line.fail(LogProblem::TooManyFields {
            found: line.fields.len(),
            expected,
            beams,
        }));
    }
    let ranges = (2..2 + beams)
        .map(|at| {
            let is_range = |v: f64| v >= 0.0;
            line.number(at, "a range in m, 0 or more", is_range)
        })
        .collect::<Result<Vec<f64>, _>>()?;
    line.pose(2 + beams)?;
    let pose = line.pose(2 + beams + 3)?;
    let time = line.time(2 + beams + 6)?;
    let (angle_min, angle_step) = angles(beams);
    Ok(LoggedScan {
        line: line.number,
        time,
        scan: LaserScan {
            angle_min,
            angle_step,
            ranges,
            ..LaserScan::default()
        },
        pose,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ScanLog, LogError> {
        super::super::read("a.log", text.as_bytes(), None, &LogOptions::default())
    }

    const GOOD: &str = "FLASER 3 1.0 2.5 81.83 9 9 9 1.5 -2.0 0.25 10.0 host 0.0\n";

    #[test]
    fn a_scan_has_the_odometry_of_its_line() {
        let text = format!(
            "# CARMEN Logfile\nPARAM robot_width 0.5 host 0\nODOM 0 0 0 0.1 0 0 9.5 host 0\n{GOOD}SYNC a\n{}",
            GOOD.replace("10.0", "11.0")
        );
        let log = read(&text).expect("a log");
        assert_eq!(log.format, LogFormat::Carmen);
        assert_eq!(log.scans.len(), 2);
        let scan = &log.scans[0];
        assert_eq!((scan.line, scan.time), (4, 10.0));
        assert_eq!(scan.pose, Pose2::new(1.5, -2.0, 0.25));
        assert_eq!(scan.scan.ranges, [1.0, 2.5, 81.83]);
        assert_eq!(log.odometry_lines, 1);
        let skipped: Vec<_> = log.skipped.iter().map(|(k, n)| (k.as_str(), *n)).collect();
        assert_eq!(skipped, [("#", 1), ("PARAM", 1), ("SYNC", 1)]);
        assert!(log.laser.range_max < 81.83, "which is a missing return");
    }

    #[test]
    fn the_usual_numbers_of_ranges_have_their_usual_angles() {
        for (beams, first, step) in [
            (180, -90.0, 1.0),
            (181, -90.0, 1.0),
            (360, -90.0, 0.5),
            (361, -90.0, 0.5),
            (401, -50.0, 0.25),
            (91, -90.0, 2.0),
        ] {
            let (min, between) = angles(beams);
            assert!((min.to_degrees() - first).abs() < 1e-12);
            assert!((between.to_degrees() - step).abs() < 1e-12);
        }
        assert_eq!(angles(1), (0.0, 0.0));
    }

    #[test]
    fn faults_are_named_with_their_line_and_what_would_do() {
        for (bad, words) in [
            ("FLASER", "ends after 1 fields, 2 are needed"),
            ("FLASER 0 9 9 9 1 2 3 11 host 0", "no ranges"),
            (
                "FLASER 5 1 2 3 9 9 9 1 2 3 11 host 0",
                "16 are needed: FLASER, 5, so many ranges",
            ),
            (
                "FLASER 2 1 2 3 9 9 9 1 2 3 11 host 0",
                "the line has 14 fields, where 2 ranges make 13",
            ),
            ("FLASER 3 1 2", "ends after 4 fields, 14 are needed"),
            (
                "FLASER x 1 2 3",
                "field 2 is \"x\", expected the number of ranges",
            ),
            (
                "FLASER 3 1 nan 3 9 9 9 1 2 3 11 host 0",
                "field 4 is \"nan\", expected a range in m",
            ),
            ("FLASER 3 1 -2 3 9 9 9 1 2 3 11 host 0", "field 4 is \"-2\""),
            (
                "FLASER 3 1 2 3 9 9 9 1 inf 3 11 host 0",
                "a coordinate within",
            ),
            (
                "FLASER 3 1 2 3 9 9 9 1 2 3 9.5 host 0",
                "the time 9.5 s comes after 10 s (line 1)",
            ),
            (
                "FLASER 3 1 2 3 9 9 9 1 2 3 nan host 0",
                "a finite time in s",
            ),
            ("FLASER 100001 1", "100001 ranges; at most 100000"),
            (
                "ODOM 1 2 3",
                "ends after 4 fields, 10 are needed: ODOM x y theta",
            ),
            (
                "ODOM 1 2 nan 0 0 0 11 host 0",
                "field 4 is \"nan\", expected a finite angle",
            ),
        ] {
            let message = read(&format!("{GOOD}{bad}\n")).expect_err(bad).to_string();
            assert!(message.starts_with("a.log:2: "), "{message}");
            assert!(message.contains(words), "{message}");
        }
    }

    #[test]
    fn a_file_of_many_kinds_of_lines_is_counted_in_little_memory() {
        let mut text = GOOD.to_owned();
        for kind in 0..1000 {
            text.push_str(&format!("KIND{kind} 1 2 3\n"));
        }
        let log = read(&text).expect("a log");
        assert!(log.skipped.len() <= MOST_KINDS + 1);
        assert_eq!(log.skipped.values().sum::<usize>(), 1000);
    }
}
