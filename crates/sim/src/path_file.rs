//! Paths given as files: a plan written by `bikebot plan -o`, or a centre line as CSV.
//!
//! A plan carries its Ferguson-Coons curves themselves and is taken as it is. A centre line is a
//! list of points, through which curves are laid whose headings follow the neighbours.

use bikebot_geometry::{FergusonCurve, Point2, Pose2, Vector2};
use serde::Deserialize;

/// Most points or segments a path file may have.
const MAX_ENTRIES: usize = 200_000;

/// Why a path file was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PathFileError {
    /// What was found.
    pub message: String,
    /// Line of the file, counted from 1, where one is at fault.
    pub line: Option<usize>,
    /// What would do.
    pub help: String,
}

fn refuse<T>(
    message: impl Into<String>,
    line: Option<usize>,
    help: &str,
) -> Result<T, PathFileError> {
    Err(PathFileError {
        message: message.into(),
        line,
        help: help.to_owned(),
    })
}

/// Reads the curves of a path from `plan.json` or a centre line `.csv`, by the ending of `name`.
///
/// `tangent_per_chord` scales the tangents laid through a centre line.
///
/// # Errors
///
/// [`PathFileError`] naming the line where there is one.
pub fn parse(
    name: &str,
    bytes: &[u8],
    tangent_per_chord: f64,
) -> Result<Vec<FergusonCurve>, PathFileError> {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return refuse(
            "the file is not text",
            None,
            "it takes a plan.json or a .csv of points",
        );
    };
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
    match ending.to_ascii_lowercase().as_str() {
        "json" => plan(text),
        "csv" => centre_line(text, tangent_per_chord),
        other => refuse(
            format!("its ending `.{other}` is neither .json nor .csv"),
            None,
            "it takes a plan.json as written by `bikebot plan -o`, or a .csv of points",
        ),
    }
}

#[derive(Deserialize)]
struct PlanFile {
    outcome: Option<String>,
    segments: Option<Vec<[f64; 8]>>,
}

fn plan(text: &str) -> Result<Vec<FergusonCurve>, PathFileError> {
    const HELP: &str = "it takes a plan as written by `bikebot plan -o plan.json`";
    let plan: PlanFile = match serde_json::from_str(text) {
        Ok(plan) => plan,
        Err(error) => return refuse(error.to_string(), Some(error.line().max(1)), HELP),
    };
    match plan.segments {
        Some(segments) if !segments.is_empty() && segments.len() <= MAX_ENTRIES => {
            if segments.iter().flatten().any(|value| !value.is_finite()) {
                return refuse("a segment has a number that is not finite", None, HELP);
            }
            Ok(segments
                .into_iter()
                .map(FergusonCurve::from_array)
                .collect())
        }
        Some(segments) if segments.len() > MAX_ENTRIES => refuse(
            format!("it has {} segments", segments.len()),
            None,
            "a path has at most 200000 segments",
        ),
        _ => refuse(
            format!(
                "the plan has no `segments` (its outcome is {})",
                plan.outcome.as_deref().unwrap_or("missing")
            ),
            None,
            "only a plan that was found, by a method that yields curves, can be ridden",
        ),
    }
}

fn centre_line(text: &str, tangent_per_chord: f64) -> Result<Vec<FergusonCurve>, PathFileError> {
    let mut points: Vec<Point2> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line_number = Some(index + 1);
        let line = line.trim().trim_start_matches('\u{feff}');
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let mut fields = line.split([',', ';', '\t']).map(str::trim);
        let (x, y) = (fields.next().unwrap_or(""), fields.next().unwrap_or(""));
        match (x.parse::<f64>(), y.parse::<f64>()) {
            (Ok(x), Ok(y)) if x.is_finite() && y.is_finite() => points.push(Point2::new(x, y)),
            // A first line of column names is not a mistake.
            _ if points.is_empty()
                && x.chars().any(char::is_alphabetic)
                && !x.eq_ignore_ascii_case("nan") => {}
            _ => {
                return refuse(
                    format!("`{line}` does not begin with two finite numbers"),
                    line_number,
                    "each line holds x and y in metres, separated by a comma",
                );
            }
        }
        if points.len() > MAX_ENTRIES {
            return refuse(
                "it has too many points",
                line_number,
                "a path has at most 200000 points",
            );
        }
        if let [.., a, b] = points[..]
            && (b - a).norm() < 1e-6
        {
            return refuse(
                "the point repeats the one before",
                line_number,
                "neighbouring points must differ",
            );
        }
    }
    if points.len() < 2 {
        return refuse(
            format!("it has {} points", points.len()),
            None,
            "a path needs at least two",
        );
    }
    let headings = headings(&points);
    Ok((1..points.len())
        .map(|i| {
            let chord = (points[i] - points[i - 1]).norm();
            let pose = |i: usize| Pose2::new(points[i].x, points[i].y, headings[i]);
            FergusonCurve::between(pose(i - 1), pose(i), tangent_per_chord * chord)
        })
        .collect())
}

/// Heading at each point: the tangent of the circle through it and its neighbours; at the ends, the
/// heading that continues the neighbour's arc.
fn headings(points: &[Point2]) -> Vec<f64> {
    let angle = |v: Vector2| v.y.atan2(v.x);
    let last = points.len() - 1;
    let mut headings: Vec<f64> = (0..points.len())
        .map(|i| {
            if i == 0 || i == last {
                let (a, b) = if i == 0 { (0, 1) } else { (last - 1, last) };
                return angle(points[b] - points[a]);
            }
            let (before, after) = (points[i] - points[i - 1], points[i + 1] - points[i]);
            let (l0, l1) = (before.norm(), after.norm());
            // The tangent of the circle through three points weighs each chord's direction by the other's length.
            angle(before / l0 * l1 + after / l1 * l0)
        })
        .collect();
    if points.len() > 2 {
        let mirrored = |chord: Vector2, neighbour: f64| {
            let chord = angle(chord);
            chord + bikebot_geometry::angle::difference(chord, neighbour)
        };
        headings[0] = mirrored(points[1] - points[0], headings[1]);
        headings[last] = mirrored(points[last] - points[last - 1], headings[last - 1]);
    }
    headings
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::CurvePath;

    #[test]
    fn a_centre_line_on_a_circle_has_the_circles_curvature() {
        let radius = 20.0;
        let csv: String = (0..40)
            .map(|i| {
                let angle = f64::from(i) * 0.05;
                format!("{}, {}, 5, 5\n", radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        let curves = parse(
            "circle.csv",
            format!("# x_m,y_m,w,w\n{csv}").as_bytes(),
            1.0,
        )
        .expect("points on a circle");
        let path = CurvePath::new(curves).expect("a connected path");
        // Headings are exact on a circle; chord tangents leave an error of order (turn per chord)².
        assert!(
            (path.max_curvature() - 1.0 / radius).abs() < 2e-4,
            "{}",
            path.max_curvature()
        );
        assert!((path.length() - radius * 39.0 * 0.05).abs() < 1e-3);
    }

    #[test]
    fn a_broken_line_is_named() {
        let error = parse("a.csv", b"0,0\n1,0\n1,nan\n", 1.0).expect_err("nan is refused");
        assert_eq!(error.line, Some(3));
    }

    #[test]
    fn a_plan_without_segments_cannot_be_ridden() {
        let error =
            parse("plan.json", br#"{"outcome":"exhausted"}"#, 1.0).expect_err("nothing to ride");
        assert!(error.message.contains("exhausted"), "{}", error.message);
    }
}
