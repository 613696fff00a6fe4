//! map_server's YAML description of an image: keys, checks and warnings.

use std::collections::BTreeMap;

use bikebot_geometry::Pose2;

use super::Draft;
use super::error::{MapError, MapProblem, quoted};
use super::image::{self, Mode, Thresholds, UNKNOWN_GREY};
use super::yaml::{self, Entry, Value};
use crate::grid::{Cell, OccupancyGrid};

/// The grey that map_saver writes for free cells, of 255.
const FREE_GREY: u8 = 254;

/// The keys there are, with a line that would do for each.
const KEYS: [(&str, &str); 7] = [
    ("image", "image: map.pgm"),
    ("mode", "mode: trinary"),
    ("resolution", "resolution: 0.05"),
    ("origin", "origin: [0.0, 0.0, 0.0]"),
    ("negate", "negate: 0"),
    ("occupied_thresh", "occupied_thresh: 0.65"),
    ("free_thresh", "free_thresh: 0.196"),
];

/// A map_server description, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct MapServerFile {
    /// The image file as written, relative to the description.
    pub image: String,
    /// Line of the `image` key.
    pub image_line: usize,
    /// m per cell.
    pub resolution: f64,
    /// Pose of the lower-left corner of the lower-left cell (m, rad).
    pub origin: Pose2,
    /// The rule for shades.
    pub thresholds: Thresholds,
    /// What looks wrong but does not hinder.
    pub warnings: Vec<String>,
}

/// Reads a description; `name` is the file's name for messages.
///
/// # Errors
///
/// Syntax beyond the flat YAML such files need, a missing key, a value that is not what the key
/// wants or not finite — with file, line and key.
pub fn parse(name: &str, bytes: &[u8]) -> Result<MapServerFile, MapError> {
    let entries = yaml::parse(name, bytes)?;
    let keys = Keys {
        name,
        entries: &entries,
    };
    let (image_line, image) = keys.text("image")?;
    if image.is_empty() {
        return Err(keys.malformed("image", "nothing".into(), "the name of an image file"));
    }
    let resolution = keys.number("resolution", "m per cell, such as 0.05")?;
    if !(resolution > 0.0 && resolution <= 1e6) {
        return Err(keys.malformed(
            "resolution",
            resolution.to_string(),
            "a number above 0, in m per cell",
        ));
    }
    let origin = keys.origin()?;
    let negate = keys.flag("negate")?;
    let occupied = keys.fraction("occupied_thresh")?;
    let free = keys.fraction("free_thresh")?;
    if free >= occupied {
        return Err(keys.malformed(
            "free_thresh",
            free.to_string(),
            &format!("a number below occupied_thresh, which is {occupied}"),
        ));
    }
    let mode = match entries.get("mode") {
        None => Mode::Trinary,
        Some(entry) => match &entry.value {
            Value::Scalar(s) if s == "trinary" => Mode::Trinary,
            Value::Scalar(s) if s == "scale" => Mode::Scale,
            Value::Scalar(s) if s == "raw" => Mode::Raw,
            other => {
                return Err(keys.malformed("mode", other.describe(), "trinary, scale or raw"));
            }
        },
    };
    let mut warnings = Vec::new();
    for (key, entry) in &entries {
        if !KEYS.iter().any(|(known, _)| known == key) {
            let hint = nearest_key(key)
                .map(|known| format!("; did you mean `{known}`?"))
                .unwrap_or_default();
            warnings.push(format!(
                "{name}:{}: unknown key {} is ignored{hint}",
                entry.line,
                quoted(key)
            ));
        }
    }
    if negate && mode == Mode::Raw {
        warnings.push(format!("{name}: negate has no effect in mode raw"));
    }
    Ok(MapServerFile {
        image: image.to_owned(),
        image_line,
        resolution,
        origin,
        thresholds: Thresholds {
            mode,
            negate,
            occupied,
            free,
        },
        warnings,
    })
}

/// A grid as the two files map_server reads: the description, and the image it names `image`, in one line.
///
/// Thresholds and greys are map_saver's, so what is read back is the same grid, cell by cell.
#[must_use]
pub fn write(grid: &OccupancyGrid, image: &str) -> (String, Vec<u8>) {
    let Pose2 { position, heading } = grid.origin;
    let thresholds = Thresholds::default();
    // Single quotes keep every character but themselves, which are doubled. `{}` of a number reads back as the same number.
    let description = format!(
        "image: '{}'\nmode: trinary\nresolution: {}\norigin: [{}, {}, {}]\nnegate: 0\noccupied_thresh: {}\nfree_thresh: {}\n",
        image.replace('\'', "''"),
        grid.resolution,
        position.x,
        position.y,
        heading,
        thresholds.occupied,
        thresholds.free
    );
    let mut pixels = format!("P5\n{} {}\n255\n", grid.width, grid.height).into_bytes();
    for row in grid.cells.chunks(grid.width.max(1)).rev() {
        pixels.extend(row.iter().map(|cell| match cell {
            Cell::Free => FREE_GREY,
            Cell::Occupied => 0,
            Cell::Unknown => UNKNOWN_GREY as u8,
        }));
    }
    (description, pixels)
}

/// Reads a description and the image it names.
pub(crate) fn read(
    name: &str,
    bytes: &[u8],
    open: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<Draft, MapError> {
    let file = parse(name, bytes)?;
    let pixels = open(&file.image).map_err(|reason| {
        MapError::at_key(
            name,
            file.image_line,
            "image",
            MapProblem::Unreadable {
                named: file.image.clone(),
                reason,
            },
        )
    })?;
    let image = image::decode(&file.image, &pixels)?;
    // Freed before the grid doubles the memory: an image may have 64 Mi pixels.
    drop(pixels);
    let rule = file.thresholds;
    let (grid, census, found) =
        image::to_grid(&file.image, &image, &rule, file.resolution, file.origin)?;
    let mut warnings = file.warnings;
    warnings.extend(found);
    if census.unknown_grey_read_free > 0 {
        warnings.push(format!(
            "{name}: free_thresh {} makes {} cells of the usual unknown grey ({UNKNOWN_GREY}) free; 0.196 keeps them unknown",
            rule.free, census.unknown_grey_read_free
        ));
    }
    Ok(Draft::of_grid(grid, warnings))
}

/// The entries, with errors that know where they belong.
struct Keys<'a> {
    name: &'a str,
    entries: &'a BTreeMap<String, Entry>,
}

impl<'a> Keys<'a> {
    fn entry(&self, key: &str) -> Result<&'a Entry, MapError> {
        self.entries.get(key).ok_or_else(|| {
            let example = KEYS
                .iter()
                .find(|(known, _)| *known == key)
                .map_or("", |(_, example)| example);
            // A misspelt key is the likeliest place of a missing one.
            let line = self
                .entries
                .iter()
                .find(|(given, _)| nearest_key(given) == Some(key))
                .map(|(_, entry)| entry.line);
            MapError {
                key: Some(key.to_owned()),
                line,
                ..MapError::new(self.name, MapProblem::Missing { example })
            }
        })
    }

    fn malformed(&self, key: &str, found: String, expected: &str) -> MapError {
        let line = self.entries.get(key).map_or(1, |e| e.line);
        MapError::at_key(
            self.name,
            line,
            key,
            MapProblem::Malformed {
                found,
                expected: expected.to_owned(),
            },
        )
    }

    fn text(&self, key: &str) -> Result<(usize, &'a str), MapError> {
        let entry = self.entry(key)?;
        match &entry.value {
            Value::Scalar(s) => Ok((entry.line, s)),
            other => Err(self.malformed(key, other.describe(), "a single value")),
        }
    }

    fn parse_number(&self, key: &str, text: &str, expected: &str) -> Result<f64, MapError> {
        // YAML writes .inf and .nan, C++ streams -nan(ind): none of them is a length.
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(v),
            Ok(_) => {
                Err(self.malformed(key, quoted(text), &format!("a finite number: {expected}")))
            }
            Err(_) => Err(self.malformed(
                key,
                if text.is_empty() {
                    "nothing".into()
                } else {
                    quoted(text)
                },
                &format!("a number: {expected}"),
            )),
        }
    }

    fn number(&self, key: &str, expected: &str) -> Result<f64, MapError> {
        let (_, text) = self.text(key)?;
        self.parse_number(key, text, expected)
    }

    fn fraction(&self, key: &str) -> Result<f64, MapError> {
        let v = self.number(key, "a probability from 0 to 1")?;
        if (0.0..=1.0).contains(&v) {
            Ok(v)
        } else {
            Err(self.malformed(key, v.to_string(), "a probability from 0 to 1"))
        }
    }

    fn flag(&self, key: &str) -> Result<bool, MapError> {
        match self.text(key)?.1 {
            "0" | "false" | "False" => Ok(false),
            "1" | "true" | "True" => Ok(true),
            other => Err(self.malformed(key, quoted(other), "0 or 1")),
        }
    }

    fn origin(&self) -> Result<Pose2, MapError> {
        const WANTED: &str = "[x, y, yaw] in m and rad";
        let entry = self.entry("origin")?;
        let Value::List(items) = &entry.value else {
            return Err(self.malformed("origin", entry.value.describe(), WANTED));
        };
        let [x, y, yaw] = items.as_slice() else {
            let found = format!("a list of {}", items.len());
            return Err(self.malformed("origin", found, WANTED));
        };
        let number = |text: &String| {
            let v = self.parse_number("origin", text, WANTED)?;
            if v.abs() <= 1e7 {
                Ok(v)
            } else {
                Err(self.malformed("origin", quoted(text), "coordinates within ±1e7 m"))
            }
        };
        Ok(Pose2::new(number(x)?, number(y)?, number(yaw)?))
    }
}

/// The known key at most two edits away from `given`.
fn nearest_key(given: &str) -> Option<&'static str> {
    KEYS.iter()
        .map(|(known, _)| (edit_distance(given, known), *known))
        .filter(|(distance, _)| (1..=2).contains(distance))
        .min()
        .map(|(_, known)| known)
}

/// Insertions, deletions, replacements and swaps of neighbours between two words.
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(64).collect(), b.chars().collect());
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            rows[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let replace = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let mut least = replace.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
                if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                    least = least.min(rows[i - 2][j - 2] + 1);
                }
                least
            };
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GOOD: &str = "image: m.pgm\nresolution: 0.05\norigin: [-1.5, 2, 0.25]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

    proptest! {
        #[test]
        fn a_written_map_reads_back_as_the_same_grid(
            width in 1_usize..9,
            height in 1_usize..9,
            seed: u64,
            resolution in 0.01..3.0_f64,
            (x, y, yaw) in (-1e3..1e3_f64, -1e3..1e3_f64, -3.0..3.0_f64),
            name in prop::sample::select(vec!["map.pgm", "it's: a # map.pgm", "naïve map.pgm"]),
        ) {
            let cells = (0..width * height)
                .map(|i| [Cell::Free, Cell::Occupied, Cell::Unknown][(seed >> (i % 60)) as usize % 3])
                .collect();
            let grid =
                OccupancyGrid::new(width, height, resolution, Pose2::new(x, y, yaw), cells).unwrap();
            let (description, pixels) = write(&grid, name);
            let draft = read("m.yaml", description.as_bytes(), &mut |named| {
                assert_eq!(named, name);
                Ok(pixels.clone())
            })
            .unwrap();
            prop_assert_eq!(draft.warnings, Vec::<String>::new());
            prop_assert_eq!(draft.grid.unwrap(), grid);
        }
    }

    #[test]
    fn a_file_without_mode_is_trinary() {
        let file = parse("m.yaml", GOOD.as_bytes()).expect("valid");
        assert_eq!(file.thresholds, Thresholds::default());
        assert_eq!(file.origin, Pose2::new(-1.5, 2.0, 0.25));
        assert_eq!(file.resolution, 0.05);
        assert!(file.warnings.is_empty());
    }

    #[test]
    fn a_wrong_value_is_named_with_file_line_and_key() {
        for (from, to, line) in [
            ("resolution: 0.05", "resolution: coarse", 2),
            ("resolution: 0.05", "resolution: -1", 2),
            ("resolution: 0.05", "resolution: .inf", 2),
            ("resolution: 0.05", "resolution: 1e400", 2),
            ("resolution: 0.05", "resolution:", 2),
            ("[-1.5, 2, 0.25]", "[-nan, 0, 0]", 3),
            ("[-1.5, 2, 0.25]", "[0, 0]", 3),
            ("[-1.5, 2, 0.25]", "0", 3),
            ("[-1.5, 2, 0.25]", "[0, 1e300, 0]", 3),
            ("negate: 0", "negate: 2", 4),
            ("0.65", "65", 5),
            ("0.196", "0.7", 6),
            ("0.196", "NaN", 6),
        ] {
            let text = GOOD.replace(from, to);
            let error = parse("m.yaml", text.as_bytes()).expect_err(to);
            assert_eq!(error.line, Some(line), "{error}");
            let key = text.lines().nth(line - 1).and_then(|l| l.split(':').next());
            assert_eq!(error.key.as_deref(), key);
            assert!(error.to_string().starts_with(&format!("m.yaml:{line}: `")));
        }
    }

    #[test]
    fn a_misspelt_key_is_pointed_at() {
        let missing = GOOD.replace("resolution", "resoluton");
        let error = parse("m.yaml", missing.as_bytes()).expect_err("missing");
        assert_eq!(error.line, Some(2));
        assert!(error.to_string().contains("resolution: 0.05"));
        let extra = format!("{GOOD}mdoe: scale\n");
        let file = parse("m.yaml", extra.as_bytes()).expect("valid");
        assert!(
            file.warnings[0].contains("did you mean `mode`"),
            "{:?}",
            file.warnings
        );
    }

    #[test]
    fn a_missing_image_is_an_error_of_the_line_that_names_it() {
        let error = read("m.yaml", GOOD.as_bytes(), &mut |_| {
            Err("no such file".into())
        })
        .expect_err("no image");
        assert_eq!(
            error.to_string(),
            "m.yaml:1: `image`: cannot read \"m.pgm\": no such file"
        );
    }

    #[test]
    fn unknown_grey_read_as_free_is_counted() {
        let text = GOOD.replace("0.196", "0.25");
        let draft = read("m.yaml", text.as_bytes(), &mut |_| {
            Ok(b"P5 3 1 255\n\xcd\xcd\x00".to_vec())
        })
        .expect("valid");
        assert_eq!(draft.warnings.len(), 1);
        assert!(
            draft.warnings[0].contains("2 cells"),
            "{:?}",
            draft.warnings
        );
    }
}
