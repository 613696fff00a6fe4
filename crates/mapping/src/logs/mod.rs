//! Logs of real laser scans: bytes in, scans with the poses of the robot's own odometry out.
//!
//! | format | recognised by | one scan is | poses |
//! |---|---|---|---|
//! | [`breezy`] | a first line of numbers | a line | from the counts of two wheels |
//! | [`carmen`] | a first line that begins with a word | a line `FLASER` | as the line says |
//!
//! The poses are **odometry and nothing else**: no scan is matched with another, no loop is closed (this is not SLAM). Odometry drifts,
//! so walls that are seen again later come out double.
//!
//! A log that is cut short, or says something impossible, is refused with the line, what was found and what would do.

pub mod breezy;
mod build;
pub mod carmen;
mod error;

pub use build::{BuildOptions, BuildSummary, build};
pub use error::{LogError, LogProblem};

use std::collections::BTreeMap;
use std::fmt;

use bikebot_dynamics::{LaserParams, LaserScan};
use bikebot_geometry::Pose2;

/// Most bytes a log may have. Read, it takes four times as much at the most: a range of one digit and a blank becomes eight bytes.
pub const MAX_LOG_BYTES: usize = 128 * 1024 * 1024;

/// Most ranges a line may hold.
const MOST_BEAMS: usize = 100_000;
/// Largest coordinate of a pose, m.
const FARTHEST: f64 = 1e6;

/// The formats read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogFormat {
    /// BreezySLAM's `.dat`.
    Breezy,
    /// CARMEN's text log.
    Carmen,
}

impl fmt::Display for LogFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Breezy => "BreezySLAM log",
            Self::Carmen => "CARMEN log",
        })
    }
}

/// What the reader of a log needs to be told, as the log does not say it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LogOptions {
    /// Ranges from this on are missing returns, m; none: 4 m for BreezySLAM's laser, 80 m for CARMEN's.
    pub max_range: Option<f64>,
}

/// One scan of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedScan {
    /// Line it was read from, from 1.
    pub line: usize,
    /// When it was taken, by the clock of the log, s.
    pub time: f64,
    /// The scan; all its beams count as fired at once.
    pub scan: LaserScan,
    /// Where the robot's odometry had it then, m and rad.
    pub pose: Pose2,
}

/// A log, read.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanLog {
    /// Which format it was.
    pub format: LogFormat,
    /// The laser and its mount, as far as mapping needs them.
    pub laser: LaserParams,
    /// The scans, in order of time; at least one.
    pub scans: Vec<LoggedScan>,
    /// Kinds of lines that were passed over, and how many of each.
    pub skipped: BTreeMap<String, usize>,
    /// Poses given by lines of their own, beside the scans.
    pub odometry_lines: usize,
}

impl ScanLog {
    /// Time from the first scan to the last, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match (self.scans.first(), self.scans.last()) {
            (Some(first), Some(last)) => last.time - first.time,
            _ => 0.0,
        }
    }

    /// Way of the robot by its odometry, m.
    #[must_use]
    pub fn distance(&self) -> f64 {
        let steps = self.scans.windows(2);
        // Not `sum`, to which nothing is −0.
        steps
            .map(|pair| (pair[1].pose.position - pair[0].pose.position).norm())
            .fold(0.0, |way, step| way + step)
    }
}

/// Reads a log. `name` is the file's name, for messages; without a `format` it is told by the first line.
///
/// # Errors
///
/// [`LogError`]: which line, what was found and what would do.
pub fn read(
    name: &str,
    bytes: &[u8],
    format: Option<LogFormat>,
    options: &LogOptions,
) -> Result<ScanLog, LogError> {
    let fail = |problem| LogError::new(name, None, problem);
    if bytes.len() > MAX_LOG_BYTES {
        return Err(fail(LogProblem::TooManyBytes {
            found: bytes.len(),
            limit: MAX_LOG_BYTES,
        }));
    }
    if let Some(max_range) = options.max_range
        && !(max_range > LEAST_RANGE && max_range <= 10_000.0)
    {
        return Err(fail(LogProblem::MaxRange { found: max_range }));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        LogError::new(name, Some(line), LogProblem::NotText)
    })?;
    if first_telling_line(text).is_none() {
        return Err(fail(LogProblem::Empty));
    }
    let format = format
        .or_else(|| recognise(text))
        .ok_or_else(|| fail(LogProblem::UnknownFormat))?;
    let log = match format {
        LogFormat::Breezy => breezy::parse(name, text, options)?,
        LogFormat::Carmen => carmen::parse(name, text, options)?,
    };
    if log.scans.is_empty() {
        return Err(fail(LogProblem::NoScans {
            expected: match format {
                LogFormat::Breezy => "lines of a time, two wheel counts and ranges",
                LogFormat::Carmen => "lines that begin with FLASER",
            },
        }));
    }
    Ok(log)
}

/// A range below this, m, is an error code of the device and not a distance.
pub(crate) const LEAST_RANGE: f64 = 0.02;

/// Tells the format by the first line that says anything.
fn recognise(text: &str) -> Option<LogFormat> {
    let word = first_telling_line(text)?.split_ascii_whitespace().next()?;
    if word.bytes().all(|byte| byte.is_ascii_digit()) {
        Some(LogFormat::Breezy)
    } else if word.starts_with(|c: char| c.is_ascii_uppercase())
        && word
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    {
        Some(LogFormat::Carmen)
    } else {
        None
    }
}

/// The first line that is neither blank nor a comment.
fn first_telling_line(text: &str) -> Option<&str> {
    text.lines()
        .map(str::trim)
        .find(|line| !line.is_empty() && !line.starts_with('#'))
}

/// A robot's laser, level and at a height where nothing is passed over.
fn level_laser(max_range: f64, ahead: f64) -> LaserParams {
    LaserParams {
        range_min: LEAST_RANGE,
        range_max: max_range,
        mount_x: ahead,
        mount_y: 0.0,
        mount_z: 0.5,
        mount_yaw_deg: 0.0,
        tilts_with_roll: false,
        ..LaserParams::default()
    }
}

/// Times that may not go back.
#[derive(Debug, Default)]
struct Clock {
    last: Option<(f64, usize)>,
}

impl Clock {
    fn advance(&mut self, name: &str, line: usize, time: f64) -> Result<(), LogError> {
        if let Some((last, last_line)) = self.last
            && time < last
        {
            return Err(LogError::new(
                name,
                Some(line),
                LogProblem::TimeWentBack {
                    time,
                    last,
                    last_line,
                },
            ));
        }
        self.last = Some((time, line));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_format_is_told_by_the_first_line_that_says_anything() {
        assert_eq!(
            recognise("# CARMEN Logfile\n\nPARAM x 1"),
            Some(LogFormat::Carmen)
        );
        assert_eq!(
            recognise("  361431443 14554 234835"),
            Some(LogFormat::Breezy)
        );
        assert_eq!(recognise("FLASER 3 1 2 3"), Some(LogFormat::Carmen));
        for unknown in [
            "",
            "# only\n# comments",
            "angle_rad,range_m",
            "{\"a\": 1}",
            "-1 2",
        ] {
            assert_eq!(recognise(unknown), None, "{unknown}");
        }
    }

    #[test]
    fn what_is_no_log_is_refused_with_a_reason() {
        let read = |bytes: &[u8]| {
            read("a.log", bytes, None, &LogOptions::default())
                .expect_err("no log")
                .to_string()
        };
        for nothing in [&b""[..], b"\n# a log\n"] {
            assert!(read(nothing).contains("nothing in it"), "{}", read(nothing));
        }
        assert!(
            read(b"?").contains("BreezySLAM or CARMEN"),
            "{}",
            read(b"?")
        );
        let binary = read(b"FLASER\n\xff\xfe");
        assert!(binary.starts_with("a.log:2: "), "{binary}");
        let empty = read(b"PARAM robot_length 1 nohost 0\n");
        assert!(empty.contains("FLASER"), "{empty}");
    }

    #[test]
    fn a_robot_that_is_seen_once_has_gone_no_way() {
        let text = b"FLASER 1 1.0 0 0 0 5 0 0 1 h 1\n";
        let log = read("a.log", text, None, &LogOptions::default()).expect("a log");
        assert_eq!(format!("{} {}", log.distance(), log.duration()), "0 0");
    }

    #[test]
    fn a_largest_range_that_is_none_is_refused() {
        for max_range in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let options = LogOptions {
                max_range: Some(max_range),
            };
            let refused = read("a.log", b"FLASER", None, &options).expect_err("no range");
            assert!(matches!(refused.problem, LogProblem::MaxRange { .. }));
        }
    }
}
