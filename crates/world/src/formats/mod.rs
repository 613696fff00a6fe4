//! Map files: bytes in, a world or a located error out.
//!
//! | kind | recognised by | cell size | start, goal |
//! |---|---|---|---|
//! | [`map_server`] YAML with a PGM, PNG or BMP image | `.yaml`, `.yml` | `resolution` | – |
//! | bare image, see [`image`] | its first bytes | must be given | – |
//! | [`moving_ai`] `.map` | first line `type octile` | given, else 1 m with a warning | – |
//! | [`scene_json`] | `.json`, or a leading `{` | metres | in the file |
//! | picture of characters, [`crate::map_text`] | `.txt` | must be given | `S`, `G` |
//!
//! All of them end in the same frame: x right, y up. A file whose first row is the top of the
//! picture is turned over; one asymmetric map written in every format proves it in the tests.
//!
//! Sizes are checked before anything is allocated for them: at most 16 384 cells a side and
//! 64 Mi in all.

mod bmp;
mod error;
pub mod image;
pub mod map_server;
pub mod moving_ai;
mod pgm;
mod png;
pub mod scene_json;
mod yaml;

use std::fmt;

use bikebot_geometry::{Point2, Pose2};

use crate::grid::{Cell, OccupancyGrid};
use crate::map_text;
use crate::obstacle::{Bounds, Obstacle};
use crate::world::World;

pub use error::{MapError, MapProblem};

/// Most bytes a text format (`.map`, `.json`, `.txt`, `.scen`) may have.
pub(crate) const MAX_TEXT_BYTES: usize = 128 * 1024 * 1024;

/// What the caller says about a map that the file may not say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapOptions {
    /// Size of a cell, m, for formats that do not carry it.
    pub meters_per_cell: Option<f64>,
    /// Stretches the map about its origin; 1 leaves it as it is.
    pub scale: f64,
    /// Reads unknown cells as free instead of solid.
    pub unknown_is_free: bool,
}

impl Default for MapOptions {
    fn default() -> Self {
        Self {
            meters_per_cell: None,
            scale: 1.0,
            unknown_is_free: false,
        }
    }
}

/// The kinds of map file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MapKind {
    /// map_server YAML and the image it names.
    MapServer,
    /// An image by itself.
    Image,
    /// MovingAI octile grid.
    MovingAi,
    /// Polygons in JSON.
    SceneJson,
    /// A picture of characters.
    Text,
}

impl fmt::Display for MapKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::MapServer => "map_server YAML",
            Self::Image => "image",
            Self::MovingAi => "MovingAI map",
            Self::SceneJson => "scene JSON",
            Self::Text => "text picture",
        })
    }
}

/// A start or goal a map file brings along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPose {
    /// m.
    pub position: Point2,
    /// rad; none: any.
    pub heading: Option<f64>,
}

/// A map, read.
#[derive(Debug)]
pub struct LoadedMap {
    /// The world the map describes, stretched by the scale asked for.
    pub world: World,
    /// Start the file names.
    pub start: Option<MapPose>,
    /// Goal the file names.
    pub goal: Option<MapPose>,
    /// One sentence each, for a person to read: what was assumed or looks wrong.
    pub warnings: Vec<String>,
    /// The map's own name, or the file's without folder and extension.
    pub name: String,
    /// Which format it was.
    pub kind: MapKind,
    /// Labels of the obstacles, in their order, where the file gives any.
    pub labels: Vec<Option<String>>,
}

/// What a format's reader hands over, before scaling.
#[derive(Debug)]
pub(crate) struct Draft {
    pub(crate) bounds: Option<Bounds>,
    pub(crate) obstacles: Vec<Obstacle>,
    pub(crate) grid: Option<OccupancyGrid>,
    pub(crate) start: Option<MapPose>,
    pub(crate) goal: Option<MapPose>,
    pub(crate) warnings: Vec<String>,
    pub(crate) name: Option<String>,
    pub(crate) labels: Vec<Option<String>>,
}

impl Draft {
    pub(crate) fn of_grid(grid: OccupancyGrid, warnings: Vec<String>) -> Self {
        Self {
            bounds: None,
            obstacles: Vec::new(),
            grid: Some(grid),
            start: None,
            goal: None,
            warnings,
            name: None,
            labels: Vec::new(),
        }
    }
}

/// Reads a map of any known kind.
///
/// `name` is the file's name: its extension helps to recognise the kind, and it stands in every
/// message. `read` opens a file the map names inside, as the map writes it; resolving that
/// against the map's own folder, and refusing what lies outside, is the caller's part.
///
/// # Errors
///
/// [`MapError`]: which file, which line or key, what was found and what would do.
pub fn load(
    name: &str,
    bytes: &[u8],
    options: &MapOptions,
    read: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<LoadedMap, MapError> {
    for (key, value) in [
        ("meters_per_cell", options.meters_per_cell),
        ("scale", Some(options.scale)),
    ] {
        if let Some(value) = value
            && !(value > 0.0 && value.is_finite())
        {
            return Err(MapError {
                key: Some(key.into()),
                ..MapError::new(
                    name,
                    MapProblem::Malformed {
                        found: value.to_string(),
                        expected: "a finite number above 0".into(),
                    },
                )
            });
        }
    }
    let kind = recognise(name, bytes)?;
    let needs_cell_size = || {
        options
            .meters_per_cell
            .ok_or_else(|| MapError::new(name, MapProblem::MissingCellSize))
    };
    let mut draft = match kind {
        MapKind::MapServer => map_server::read(name, bytes, read)?,
        MapKind::Image => image::read_bare(name, bytes, needs_cell_size()?)?,
        MapKind::MovingAi => moving_ai::read(name, bytes, options.meters_per_cell)?,
        MapKind::SceneJson => scene_json::read(name, bytes)?,
        MapKind::Text => {
            let size = needs_cell_size()?;
            let map = map_text::parse(name, text_of(name, bytes)?)?;
            let pose = |p: Option<Point2>| {
                p.map(|p| MapPose {
                    position: p * size,
                    heading: None,
                })
            };
            let (start, goal) = (pose(map.start), pose(map.goal));
            let grid = OccupancyGrid {
                resolution: size,
                ..map.grid
            };
            Draft {
                start,
                goal,
                ..Draft::of_grid(grid, Vec::new())
            }
        }
    };
    if options.meters_per_cell.is_some() && matches!(kind, MapKind::MapServer | MapKind::SceneJson)
    {
        draft.warnings.push(format!(
            "{name}: meters_per_cell is ignored, a {kind} states its own scale; use `scale` to stretch it"
        ));
    }
    if options.unknown_is_free {
        draft.grid = draft.grid.map(|g| g.with_unknown_as(Cell::Free));
    }
    finish(name, kind, draft, options.scale)
}

/// Scales a draft and builds its world.
fn finish(name: &str, kind: MapKind, draft: Draft, scale: f64) -> Result<LoadedMap, MapError> {
    let grid = draft.grid.map(|g| {
        let position = g.origin.position * scale;
        OccupancyGrid {
            resolution: g.resolution * scale,
            origin: Pose2::new(position.x, position.y, g.origin.heading),
            ..g
        }
    });
    let obstacles = draft.obstacles.iter().map(|o| o.scaled(scale)).collect();
    let world = match (draft.bounds, grid) {
        (Some(b), grid) => World::build(
            Bounds {
                min: b.min * scale,
                max: b.max * scale,
            },
            obstacles,
            grid,
        ),
        (None, Some(grid)) => World::from_grid(grid),
        // Every reader gives bounds or a grid; an empty field says so if one ever did not.
        (None, None) => World::new(Bounds::new(0.0, 0.0, 0.0, 0.0), obstacles),
    }
    .map_err(|e| MapError::new(name, MapProblem::World(e)))?;
    let pose = |p: Option<MapPose>| {
        p.map(|p| MapPose {
            position: p.position * scale,
            heading: p.heading,
        })
    };
    Ok(LoadedMap {
        world,
        start: pose(draft.start),
        goal: pose(draft.goal),
        warnings: draft.warnings,
        name: draft.name.unwrap_or_else(|| stem(name).to_owned()),
        kind,
        labels: draft.labels,
    })
}

/// Which kind of map these bytes are: by what they begin with, else by the name's extension.
fn recognise(name: &str, bytes: &[u8]) -> Result<MapKind, MapError> {
    let extension = basename(name)
        .rsplit_once('.')
        .map(|(_, e)| e.to_ascii_lowercase())
        .unwrap_or_default();
    if image::Kind::of(bytes).is_some() {
        return Ok(MapKind::Image);
    }
    let start = bytes.trim_ascii_start();
    match extension.as_str() {
        "yaml" | "yml" => return Ok(MapKind::MapServer),
        "map" => return Ok(MapKind::MovingAi),
        "json" => return Ok(MapKind::SceneJson),
        "txt" => return Ok(MapKind::Text),
        // Named like an image, but not one: its reader says what is wrong with it.
        "pgm" | "png" | "bmp" => return Ok(MapKind::Image),
        _ => {}
    }
    if start.starts_with(b"type ") {
        return Ok(MapKind::MovingAi);
    }
    if start.starts_with(b"{") {
        return Ok(MapKind::SceneJson);
    }
    let found = match (bytes.is_empty(), extension.as_str()) {
        (true, _) => "an empty file".to_owned(),
        (_, "scen") => "a list of MovingAI problems; give the .map it belongs to".to_owned(),
        (_, "") => "no extension and no known first bytes".to_owned(),
        (_, other) => format!("extension .{}", error::shorten(other)),
    };
    Err(MapError::new(name, MapProblem::UnknownKind { found }))
}

/// The last part of a path, whichever way its separators lean.
pub(crate) fn basename(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// The last part of a path without its extension.
fn stem(path: &str) -> &str {
    let base = basename(path);
    match base.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem,
        _ => base,
    }
}

/// The bytes as text, if they are not too many and are UTF-8 without NUL.
pub(crate) fn text_of<'a>(name: &str, bytes: &'a [u8]) -> Result<&'a str, MapError> {
    if bytes.len() > MAX_TEXT_BYTES {
        return Err(MapError::new(
            name,
            MapProblem::TooManyBytes {
                found: bytes.len(),
                limit: MAX_TEXT_BYTES,
            },
        ));
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(MapError::at_line(
            name,
            1,
            MapProblem::Unsupported {
                found: "UTF-16 text".into(),
                instead: "save the file as UTF-8",
            },
        ));
    }
    let bytes = bytes.strip_prefix(&[0xEF, 0xBB, 0xBF]).unwrap_or(bytes);
    let line_at = |at: usize| 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let at = e.valid_up_to();
        MapError::at_line(
            name,
            line_at(at),
            MapProblem::Malformed {
                found: format!("byte 0x{:02x}, which is not UTF-8 text", bytes[at]),
                expected: "a text file in UTF-8".into(),
            },
        )
    })?;
    match text.find('\0') {
        Some(at) => Err(MapError::at_line(
            name,
            line_at(at),
            MapProblem::Malformed {
                found: "a NUL byte".into(),
                expected: "a text file in UTF-8".into(),
            },
        )),
        None => Ok(text),
    }
}

#[cfg(test)]
mod golden;
