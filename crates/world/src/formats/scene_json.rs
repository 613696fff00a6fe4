//! Polygon scenes in JSON: a field [0, width] × [0, height] m with simple polygons in it.
//!
//! `name`, `unit` ("m"), `width`, `height`, `start` and `goal` as [x, y] or [x, y, degrees],
//! `obstacles`: a list of `{ "polygon": [[x, y], …], "label"? }` in either orientation.

use bikebot_geometry::Point2;
use serde::{Deserialize, Serialize};

use super::error::{MapError, MapProblem, shorten};
use super::{Draft, MapPose, text_of};
use crate::obstacle::{Bounds, Obstacle};

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    unit: Option<String>,
    width: f64,
    height: f64,
    #[serde(default)]
    start: Option<Vec<f64>>,
    #[serde(default)]
    goal: Option<Vec<f64>>,
    #[serde(default)]
    obstacles: Vec<SceneObstacle>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneObstacle {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    label: Option<String>,
    polygon: Vec<[f64; 2]>,
}

pub(crate) fn read(name: &str, bytes: &[u8]) -> Result<Draft, MapError> {
    let text = text_of(name, bytes)?;
    let file: SceneFile = serde_json::from_str(text).map_err(|e| {
        let message = e.to_string();
        // serde_json ends its messages with the place, which we show in front.
        let found = message.split(" at line ").next().unwrap_or(&message);
        MapError::at_line(
            name,
            e.line().max(1),
            MapProblem::Json {
                problem: shorten(found),
                expected: "a scene: width, height, obstacles [{polygon: [[x, y], …]}], start, goal",
            },
        )
    })?;
    let malformed = |key: &str, found: String, expected: &str| MapError {
        key: Some(key.to_owned()),
        ..MapError::new(
            name,
            MapProblem::Malformed {
                found,
                expected: expected.to_owned(),
            },
        )
    };
    if let Some(unit) = file.unit.as_deref()
        && unit != "m"
    {
        return Err(malformed("unit", super::error::quoted(unit), "\"m\""));
    }
    for (key, value) in [("width", file.width), ("height", file.height)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(malformed(key, value.to_string(), "a length above 0 in m"));
        }
    }
    let pose = |key: &str, values: Option<Vec<f64>>| {
        let Some(values) = values else {
            return Ok(None);
        };
        let (x, y, heading) = match *values.as_slice() {
            [x, y] => (x, y, None),
            [x, y, degrees] => (x, y, Some(degrees.to_radians())),
            _ => {
                let found = format!("a list of {}", values.len());
                return Err(malformed(key, found, "[x, y] or [x, y, degrees]"));
            }
        };
        Ok(Some(MapPose {
            position: Point2::new(x, y),
            heading,
        }))
    };
    let (start, goal) = (pose("start", file.start)?, pose("goal", file.goal)?);
    let (labels, obstacles) = file
        .obstacles
        .into_iter()
        .map(|o| {
            let vertices = o.polygon.iter().map(|&[x, y]| Point2::new(x, y)).collect();
            (o.label, Obstacle::Polygon { vertices })
        })
        .unzip();
    Ok(Draft {
        bounds: Some(Bounds::new(0.0, 0.0, file.width, file.height)),
        obstacles,
        grid: None,
        start,
        goal,
        warnings: Vec::new(),
        name: file.name,
        labels,
    })
}

#[cfg(test)]
mod tests {
    use super::super::{MapKind, MapOptions, load};
    use super::*;

    fn scene(text: &str, options: &MapOptions) -> Result<super::super::LoadedMap, MapError> {
        load("s.json", text.as_bytes(), options, &mut |_| {
            Err("a scene names no file".into())
        })
    }

    #[test]
    fn a_scene_brings_its_ends_name_and_labels() {
        let text = r#"{"name": "yard", "unit": "m", "width": 10, "height": 8, "start": [1, 2, 90],
            "goal": [9, 7], "obstacles": [{"polygon": [[4, 4], [6, 4], [5, 6]], "label": "tree"}]}"#;
        let map = scene(text, &MapOptions::default()).expect("valid");
        assert_eq!((map.name.as_str(), map.kind), ("yard", MapKind::SceneJson));
        assert_eq!(map.labels, [Some("tree".to_owned())]);
        let start = map.start.expect("a start");
        assert_eq!(start.position, Point2::new(1.0, 2.0));
        assert_eq!(start.heading, Some(std::f64::consts::FRAC_PI_2));
        assert_eq!(map.goal.and_then(|g| g.heading), None);
        assert!(map.world.clearance(Point2::new(5.0, 4.5)) < 0.0);
        let options = MapOptions {
            scale: 0.5,
            ..MapOptions::default()
        };
        let half = scene(text, &options).expect("valid");
        assert_eq!(half.world.bounds().max, Point2::new(5.0, 4.0));
        assert_eq!(half.start.map(|s| s.position), Some(Point2::new(0.5, 1.0)));
    }

    #[test]
    fn a_broken_scene_is_named_with_its_line_or_key() {
        for text in [
            "{\"width\": 10,\n \"height\": }",
            "{\"width\": 10,\n \"height\": 1, \"hieght\": 2}",
            "{\"width\": 10,\n \"width\": 10, \"height\": 1}",
            "{\"width\": 10,\n \"height\": 1e999}",
        ] {
            let error = scene(text, &MapOptions::default()).expect_err(text);
            assert_eq!(error.line, Some(2), "{error}");
        }
        for text in [
            r#"{"width": -1, "height": 5}"#,
            r#"{"width": 1, "height": 5, "unit": "ft"}"#,
            r#"{"width": 1, "height": 5, "start": [1]}"#,
        ] {
            let error = scene(text, &MapOptions::default()).expect_err(text);
            assert!(error.key.is_some(), "{error}");
        }
        let crossing = r#"{"width": 9, "height": 9, "obstacles":
            [{"polygon": [[1, 1], [3, 3], [3, 1], [1, 3.5]]}]}"#;
        let error = scene(crossing, &MapOptions::default()).expect_err("a bow tie");
        assert!(error.to_string().contains("obstacle 0"), "{error}");
        let deep = "[".repeat(5_000);
        assert!(scene(&deep, &MapOptions::default()).is_err());
    }
}
