//! Results as text for people: 80 columns, aligned, every number with its unit.

use std::fmt::Write as _;
use std::path::Path;

use bikebot_sim::{ExpectCheck, Metrics};

/// Columns of a summary.
const WIDTH: usize = 80;

/// Width of a column that holds all `cells` up to `most` characters; longer
/// cells stick out instead of widening all others.
pub fn column<'a>(cells: impl Iterator<Item = &'a str>, most: usize) -> usize {
    cells
        .map(|cell| cell.chars().count())
        .filter(|width| *width <= most)
        .max()
        .unwrap_or(0)
}

/// A length of time as people say it: `412 µs`, `2.1 ms`, `3.42 s`, `12 min 5 s`.
pub fn time(seconds: f64) -> String {
    if seconds < 1e-3 {
        format!("{:.0} µs", seconds * 1e6)
    } else if seconds < 1.0 {
        format!("{} ms", significant(seconds * 1e3))
    } else if seconds < 120.0 {
        format!("{} s", significant(seconds))
    } else {
        format!(
            "{:.0} min {:.0} s",
            (seconds / 60.0).floor(),
            seconds % 60.0
        )
    }
}

/// A size of a file: `812 bytes`, `34.1 kB`, `2.06 MB`.
pub fn bytes(count: u64) -> String {
    match count {
        0..1_000 => format!("{count} bytes"),
        1_000..1_000_000 => format!("{} kB", significant(count as f64 / 1e3)),
        _ => format!("{} MB", significant(count as f64 / 1e6)),
    }
}

/// `1 row`, `2 rows`.
pub fn count(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Three significant digits, without an exponent in the usual range.
pub fn significant(number: f64) -> String {
    if number == 0.0 || !number.is_finite() {
        return format!("{number}");
    }
    let magnitude = number.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{number:.2e}");
    }
    let digits = (2.0 - magnitude).clamp(0.0, 6.0) as usize;
    format!("{number:.digits$}")
}

/// A coordinate or an angle: to a tenth of a millimetre, without what arithmetic added.
pub fn coordinate(number: f64) -> String {
    let text = format!("{number:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".into()
    } else {
        text.into()
    }
}

/// Lines of `label   text`, wrapped at [`WIDTH`] with the text's column kept.
#[derive(Debug, Default)]
pub struct Sheet {
    text: String,
}

/// Columns of the labels of a [`Sheet`].
const LABEL: usize = 12;

impl Sheet {
    /// A sheet under a headline, with `aside` at the right margin.
    pub fn new(headline: &str, aside: &str) -> Self {
        let mut text = String::new();
        let gap = WIDTH.saturating_sub(headline.chars().count() + aside.chars().count());
        if gap >= 2 {
            let _ = writeln!(text, "{headline}{:gap$}{aside}", "");
        } else {
            let _ = writeln!(text, "{headline}\n  {aside}");
        }
        Self { text }
    }

    /// An empty line.
    pub fn gap(&mut self) {
        self.text.push('\n');
    }

    /// One line, wrapped between the `parts`, which are joined by commas. Nothing
    /// to say, no line.
    pub fn line(&mut self, label: &str, parts: &[String]) {
        if parts.is_empty() {
            return;
        }
        let mut line = format!("  {label:LABEL$}");
        let indent = line.chars().count();
        for (index, part) in parts.iter().enumerate() {
            let comma = if index + 1 < parts.len() { "," } else { "" };
            let begun = line.chars().count() > indent;
            let needed = part.chars().count() + comma.len() + usize::from(begun);
            if begun && line.chars().count() + needed > WIDTH {
                let _ = writeln!(self.text, "{}", line.trim_end());
                line = " ".repeat(indent);
            } else if begun {
                line.push(' ');
            }
            line.push_str(part);
            line.push_str(comma);
        }
        let _ = writeln!(self.text, "{}", line.trim_end());
    }

    /// As [`Sheet::line`], with one text.
    pub fn say(&mut self, label: &str, text: impl Into<String>) {
        self.line(label, &[text.into()]);
    }

    /// One line as it is.
    pub fn row(&mut self, text: &str) {
        let _ = writeln!(self.text, "{}", text.trim_end());
    }

    /// The whole text.
    pub fn finish(self) -> String {
        self.text
    }
}

/// The metrics of a ride, grouped as a rider would ask for them.
pub fn metrics(sheet: &mut Sheet, metrics: &Metrics) {
    let number = |value: Option<f64>, text: &dyn Fn(String) -> String| {
        value.map(|value| text(significant(value)))
    };
    let mut line = |label: &str, parts: Vec<Option<String>>| {
        sheet.line(label, &parts.into_iter().flatten().collect::<Vec<_>>());
    };
    line(
        "ride",
        vec![
            number(metrics.time_s, &|n| format!("{n} s simulated")),
            number(metrics.distance_m, &|n| format!("{n} m ridden")),
            number(metrics.speed_max_mps, &|n| format!("top speed {n} m/s")),
            number(metrics.corner_speed_mps, &|n| {
                format!("{n} m/s in the sharpest turn")
            }),
        ],
    );
    line(
        "following",
        vec![
            number(metrics.lateral_error_max_m, &|n| {
                format!("at most {n} m off the curve")
            }),
            number(metrics.lateral_error_rms_m, &|n| format!("{n} m rms")),
            number(metrics.rear_error_max_m, &|n| {
                format!("rear wheel {n} m off the path")
            }),
        ],
    );
    line(
        "at the end",
        vec![
            number(metrics.end_position_error_m, &|n| {
                format!("{n} m from the goal")
            }),
            number(metrics.end_heading_error_deg, &|n| {
                format!("heading {n}° off")
            }),
        ],
    );
    line(
        "balance",
        vec![
            number(metrics.roll_max_deg, &|n| format!("roll up to {n}°")),
            number(metrics.balancer_torque_max_nm, &|n| {
                format!("torque up to {n} N m")
            }),
            number(metrics.balancer_torque_rms_nm, &|n| format!("{n} N m rms")),
            number(metrics.balancer_speed_max_radps, &|n| {
                format!("balancer up to {n} rad/s")
            }),
            number(metrics.balancer_angle_max_rad, &|n| format!("{n} rad")),
        ],
    );
    line(
        "margins",
        vec![
            number(metrics.min_clearance_m, &|n| format!("clearance {n} m")),
            metrics
                .friction_use_rear_max
                .map(|use_| format!("rear grip {:.0} % used", use_ * 100.0)),
            metrics
                .friction_use_front_max
                .map(|use_| format!("front {:.0} %", use_ * 100.0)),
            number(metrics.wheel_load_min_n, &|n| {
                format!("wheel load at least {n} N")
            }),
            number(metrics.decoupling_margin_min, &|n| {
                format!("decoupling at least {n}")
            }),
            metrics
                .passivity_violations
                .map(|n| count(n, "passivity violation")),
            metrics
                .balance_fallbacks
                .filter(|n| *n > 0)
                .map(|n| count(n, "balance fallback")),
            metrics
                .replans
                .filter(|n| *n > 0)
                .map(|n| count(n, "replan")),
        ],
    );
    line(
        "path",
        vec![number(metrics.max_path_curvature_per_m, &|n| {
            format!("curvature up to {n} /m")
        })],
    );
    line(
        "computing",
        vec![
            metrics
                .plan_time_s
                .map(|seconds| format!("planned in {}", time(seconds))),
            metrics
                .wall_time_s
                .map(|seconds| format!("{} in all", time(seconds))),
            number(metrics.real_time_factor, &|n| format!("{n} × real time")),
        ],
    );
}

/// What the scenario expected, and whether it held.
pub fn expectations(sheet: &mut Sheet, checks: &[ExpectCheck]) {
    for (index, check) in checks.iter().enumerate() {
        let label = if index == 0 { "expected" } else { "" };
        let verdict = if check.ok { "ok    " } else { "FAILED" };
        sheet.say(label, format!("{verdict}  {}", check.check));
    }
}

/// A path as shown to people: without a leading `./`.
pub fn path(path: &Path) -> String {
    path.strip_prefix(".").unwrap_or(path).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_that_count() {
        let cases = [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (1.0, "1.00"),
            (12.345, "12.3"),
            (1234.5, "1234"),
            (-0.5, "-0.500"),
            (1e-9, "1.00e-9"),
            (1e12, "1.00e12"),
        ];
        for (number, text) in cases {
            assert_eq!(significant(number), text);
        }
    }

    #[test]
    fn coordinates_are_short() {
        let cases = [
            (23.060000000000002, "23.06"),
            (-0.00001, "0"),
            (-7.14, "-7.14"),
            (10.0, "10"),
        ];
        for (number, text) in cases {
            assert_eq!(coordinate(number), text);
        }
    }

    #[test]
    fn times_and_sizes_read_as_people_say_them() {
        assert_eq!(time(0.000_412), "412 µs");
        assert_eq!(time(0.0021), "2.10 ms");
        assert_eq!(time(725.0), "12 min 5 s");
        assert_eq!(bytes(812), "812 bytes");
        assert_eq!(bytes(2_063_707), "2.06 MB");
    }

    #[test]
    fn no_line_is_longer_than_eighty_columns() {
        let mut sheet = Sheet::new("yard: arrived", "seed 1");
        let parts: Vec<String> = (0..20)
            .map(|i| format!("quantity {i} is 1.23 N m"))
            .collect();
        sheet.line("balance", &parts);
        let text = sheet.finish();
        assert!(text.lines().count() > 3);
        for line in text.lines() {
            assert!(line.chars().count() <= WIDTH, "{line}");
        }
    }
}
