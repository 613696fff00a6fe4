//! MovingAI grid benchmarks: `.map` files and their `.scen` problem lists.
//!
//! N. Sturtevant, "Benchmarks for Grid-Based Pathfinding", TCIAIG 2012. Row 0 is the top row;
//! (0, 0) is the upper left cell. Passable are `.`, `G` and `S` (swamp); `@`, `O`, `T` (trees)
//! and `W` (water) are not.

use bikebot_geometry::{Point2, Pose2};

use super::error::{MapError, MapProblem, quoted, shorten};
use super::{Draft, basename, text_of};
use crate::error::{MAX_GRID_CELLS, MAX_GRID_SIDE};
use crate::grid::{Cell, OccupancyGrid};

/// Reads a `.map` at the given cell size (m), its lower-left corner at the origin.
///
/// # Errors
///
/// A header of another kind, absurd sizes, rows of another length than declared, unknown
/// characters — with the line.
pub fn parse_map(name: &str, bytes: &[u8], resolution: f64) -> Result<OccupancyGrid, MapError> {
    if bytes.len() > super::MAX_TEXT_BYTES {
        return Err(MapError::new(
            name,
            MapProblem::TooManyBytes {
                found: bytes.len(),
                limit: super::MAX_TEXT_BYTES,
            },
        ));
    }
    let mut lines = bytes
        .split(|b| *b == b'\n')
        .map(|l| l.strip_suffix(b"\r").unwrap_or(l))
        .enumerate()
        .map(|(index, line)| (index + 1, line));
    let malformed = |line: usize, found: String, expected: &str| {
        MapError::at_line(
            name,
            line,
            MapProblem::Malformed {
                found,
                expected: expected.to_owned(),
            },
        )
    };
    let shown = |line: &[u8]| quoted(&String::from_utf8_lossy(&line[..line.len().min(80)]));
    let (mut kind, mut height, mut width) = (false, None, None);
    let mut last = 1;
    loop {
        let Some((number, line)) = lines.next() else {
            return Err(malformed(
                last,
                "the end of the file".into(),
                "the lines `type octile`, `height H`, `width W` and `map`",
            ));
        };
        last = number;
        let text = String::from_utf8_lossy(&line[..line.len().min(80)]);
        let mut words = text.split_whitespace();
        let size = |word: Option<&str>| {
            word.and_then(|w| w.parse::<u64>().ok())
                .filter(|v| *v > 0)
                .ok_or_else(|| malformed(number, shown(line), "a whole number of cells above 0"))
        };
        match (words.next(), words.next(), words.next()) {
            (Some("type"), Some("octile"), None) => kind = true,
            (Some("height"), value, None) => height = Some(size(value)?),
            (Some("width"), value, None) => width = Some(size(value)?),
            (Some("map"), None, None) => break,
            (None, ..) if number > 1 => {}
            _ => {
                return Err(malformed(
                    number,
                    shown(line),
                    "a MovingAI header: `type octile`, `height H`, `width W`, `map`",
                ));
            }
        }
    }
    let (Some(height), Some(width), true) = (height, width, kind) else {
        let missing = match (kind, height) {
            (false, _) => "type octile",
            (_, None) => "height 512",
            _ => "width 512",
        };
        return Err(MapError::at_line(
            name,
            last,
            MapProblem::Missing { example: missing },
        ));
    };
    let side = MAX_GRID_SIDE as u64;
    if height > side || width > side || height * width > MAX_GRID_CELLS as u64 {
        return Err(MapError::at_line(
            name,
            last,
            MapProblem::TooManyCells { width, height },
        ));
    }
    let (width, height) = (width as usize, height as usize);
    if bytes.len() < width * height {
        return Err(MapError::new(
            name,
            MapProblem::Short {
                what: "rows",
                expected: (width * height) as u64,
                found: bytes.len() as u64,
            },
        ));
    }
    let mut cells = vec![Cell::Free; width * height];
    for row in (0..height).rev() {
        // What follows the last line feed is no row.
        let Some((number, line)) = lines.next().filter(|(_, line)| !line.is_empty()) else {
            return Err(malformed(
                last,
                format!("{} rows", height - 1 - row),
                &format!("{height}, as the header says"),
            ));
        };
        last = number;
        if line.len() != width {
            let problem = MapProblem::RowLength {
                expected: width,
                found: line.len(),
            };
            return Err(MapError::at_line(name, number, problem));
        }
        let target = &mut cells[row * width..(row + 1) * width];
        for (x, (cell, byte)) in target.iter_mut().zip(line).enumerate() {
            *cell = match byte {
                b'.' | b'G' | b'S' => Cell::Free,
                b'@' | b'O' | b'T' | b'W' => Cell::Occupied,
                other => {
                    return Err(MapError::at_line(
                        name,
                        number,
                        MapProblem::Character {
                            column: x + 1,
                            found: char::from(*other),
                            expected: ". G S (passable) or @ O T W (blocked)",
                        },
                    ));
                }
            };
        }
    }
    if let Some((number, line)) = lines.find(|(_, l)| !l.trim_ascii().is_empty()) {
        return Err(malformed(
            number,
            format!("{} after the last row", shown(line)),
            &format!("{height} rows, as the header says"),
        ));
    }
    OccupancyGrid::new(width, height, resolution, Pose2::new(0.0, 0.0, 0.0), cells)
        .map_err(|e| MapError::new(name, MapProblem::World(e)))
}

pub(crate) fn read(
    name: &str,
    bytes: &[u8],
    meters_per_cell: Option<f64>,
) -> Result<Draft, MapError> {
    let mut warnings = Vec::new();
    let resolution = meters_per_cell.unwrap_or_else(|| {
        warnings.push(format!(
            "{name}: a MovingAI map has no unit; 1 m per cell is assumed (set meters_per_cell, flag --meters-per-cell)"
        ));
        1.0
    });
    Ok(Draft::of_grid(
        parse_map(name, bytes, resolution)?,
        warnings,
    ))
}

/// One line of a `.scen` file: a pair of cells of a named map.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenProblem {
    /// Line in the file.
    pub line: usize,
    /// Problems of like length share a bucket.
    pub bucket: u32,
    /// The map as the file names it; only its last part means anything elsewhere.
    pub map: String,
    /// Cells across.
    pub width: u32,
    /// Cells down.
    pub height: u32,
    /// Column and row (from the top) of the start.
    pub start: (u32, u32),
    /// Column and row (from the top) of the goal.
    pub goal: (u32, u32),
    /// Length of the shortest 8-connected path without cut corners, in cells.
    pub optimal_length: f64,
}

impl ScenProblem {
    /// The map's file name without folders.
    #[must_use]
    pub fn map_basename(&self) -> &str {
        basename(&self.map)
    }

    /// Centre of the start cell in the world frame of `grid` (m); `None` if it is off the grid.
    #[must_use]
    pub fn start_point(&self, grid: &OccupancyGrid) -> Option<Point2> {
        point(grid, self.start)
    }

    /// Centre of the goal cell in the world frame of `grid` (m); `None` if it is off the grid.
    #[must_use]
    pub fn goal_point(&self, grid: &OccupancyGrid) -> Option<Point2> {
        point(grid, self.goal)
    }

    /// Checks the problem against the map it is to be used with.
    ///
    /// # Errors
    ///
    /// If the map has another size, or an end lies on a blocked cell. `name` is the `.scen`
    /// file's name, `map_name` the map's.
    pub fn check(&self, name: &str, map_name: &str, grid: &OccupancyGrid) -> Result<(), MapError> {
        let fail = |found: String, expected: String| {
            MapError::at_line(name, self.line, MapProblem::Malformed { found, expected })
        };
        if basename(map_name) != self.map_basename() {
            return Err(fail(
                format!("a problem for {}", quoted(self.map_basename())),
                format!("one for {}", quoted(basename(map_name))),
            ));
        }
        if (self.width as usize, self.height as usize) != (grid.width, grid.height) {
            return Err(fail(
                format!("a map of {} x {} cells", self.width, self.height),
                format!("{} x {}, as {map_name} has", grid.width, grid.height),
            ));
        }
        for (end, cell) in [("start", self.start), ("goal", self.goal)] {
            let row = grid.height.checked_sub(cell.1 as usize + 1);
            match row.and_then(|row| grid.cell(cell.0 as usize, row)) {
                Some(Cell::Free) => {}
                _ => {
                    return Err(fail(
                        format!("{end} ({}, {}) on a blocked cell", cell.0, cell.1),
                        "a passable cell".into(),
                    ));
                }
            }
        }
        Ok(())
    }
}

fn point(grid: &OccupancyGrid, (x, y): (u32, u32)) -> Option<Point2> {
    let row = grid.height.checked_sub(y as usize + 1)?;
    grid.cell(x as usize, row)
        .map(|_| grid.cell_centre(x as usize, row))
}

/// Reads a `.scen` file.
///
/// # Errors
///
/// A line without its nine fields, a field that is not its number, an end outside the declared
/// map — with the line.
pub fn parse_scen(name: &str, bytes: &[u8]) -> Result<Vec<ScenProblem>, MapError> {
    let text = text_of(name, bytes)?;
    let mut problems = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        let trimmed = line.trim();
        if trimmed.is_empty() || (number == 1 && trimmed.starts_with("version")) {
            continue;
        }
        // Tabs separate the fields, so that a map's name may hold spaces; old files have
        // spaces throughout.
        let fields: Vec<&str> = if trimmed.contains('\t') {
            trimmed.split('\t').map(str::trim).collect()
        } else {
            trimmed.split_whitespace().collect()
        };
        let [bucket, map, width, height, sx, sy, gx, gy, optimal] = fields.as_slice() else {
            return Err(MapError::at_line(
                name,
                number,
                MapProblem::Malformed {
                    found: format!("{} fields", fields.len()),
                    expected:
                        "9: bucket, map, width, height, start x, y, goal x, y, optimal length"
                            .into(),
                },
            ));
        };
        let malformed = |key: &str, found: &str, expected: &str| {
            MapError::at_key(
                name,
                number,
                key,
                MapProblem::Malformed {
                    found: quoted(found),
                    expected: expected.to_owned(),
                },
            )
        };
        let whole = |key: &str, text: &str| {
            text.parse::<u32>()
                .map_err(|_| malformed(key, text, "a whole number"))
        };
        let optimal_length = match optimal.parse::<f64>() {
            Ok(v) if v.is_finite() && v >= 0.0 => v,
            _ => return Err(malformed("optimal length", optimal, "a length in cells")),
        };
        let problem = ScenProblem {
            line: number,
            bucket: whole("bucket", bucket)?,
            map: (*map).to_owned(),
            width: whole("width", width)?,
            height: whole("height", height)?,
            start: (whole("start x", sx)?, whole("start y", sy)?),
            goal: (whole("goal x", gx)?, whole("goal y", gy)?),
            optimal_length,
        };
        for (end, (x, y)) in [("start", problem.start), ("goal", problem.goal)] {
            if x >= problem.width || y >= problem.height {
                let size = format!("a cell of the {} x {} map", problem.width, problem.height);
                return Err(malformed(end, &shorten(&format!("({x}, {y})")), &size));
            }
        }
        problems.push(problem);
    }
    Ok(problems)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "type octile\nheight 3\nwidth 4\nmap\n@..T\n.GS.\nW..O\n";

    #[test]
    fn the_top_row_of_the_file_is_the_top_of_the_map() {
        let grid = parse_map("m.map", MAP.as_bytes(), 0.5).expect("valid");
        assert_eq!(crate::map_text::to_text(&grid), "#..#\n....\n#..#\n");
        assert_eq!(grid.resolution, 0.5);
        let crlf = MAP.replace('\n', "\r\n");
        assert_eq!(parse_map("m.map", crlf.as_bytes(), 0.5), Ok(grid));
        let swapped = MAP.replace("height 3\nwidth 4", "width 4\nheight 3");
        assert!(parse_map("m.map", swapped.as_bytes(), 1.0).is_ok());
    }

    #[test]
    fn another_game_s_format_and_broken_files_are_named_with_their_line() {
        for (text, line) in [
            ("BINARYMAP\x00\x01", Some(1)),
            ("", Some(1)),
            ("type octile\nheight 3\n", Some(3)),
            ("type tile\nheight 3\nwidth 4\nmap\n", Some(1)),
            (
                "type octile\nheight 1000000000\nwidth 1000000000\nmap\n",
                Some(4),
            ),
            ("type octile\nheight -3\nwidth 4\nmap\n", Some(2)),
            ("type octile\nheight 3\nmap\n", Some(3)),
            (
                "type octile\nheight 3\nwidth 4\nmap\n....\n...\n....\n",
                Some(6),
            ),
            (
                "type octile\nheight 3\nwidth 4\nmap\n....\n..x.\n....\n",
                Some(6),
            ),
            (
                "type octile\nheight 2\nwidth 4\nmap\n....\n....\n....\n",
                Some(7),
            ),
            ("type octile\nheight 9000\nwidth 7000\nmap\n....\n", None),
        ] {
            let error = parse_map("m.map", text.as_bytes(), 1.0).expect_err(text);
            assert_eq!(error.line, line, "{text:?}: {error}");
        }
    }

    #[test]
    fn a_problem_s_ends_are_turned_over_with_the_map() {
        let grid = parse_map("m.map", MAP.as_bytes(), 0.5).expect("valid");
        let scen = "version 1\n0\tmaps/x/m.map\t4\t3\t1\t0\t3\t1\t2.41421356\n";
        let problems = parse_scen("m.scen", scen.as_bytes()).expect("valid");
        assert_eq!(problems.len(), 1);
        let problem = &problems[0];
        assert_eq!(problem.map_basename(), "m.map");
        assert_eq!(problem.start_point(&grid), Some(Point2::new(0.75, 1.25)));
        assert_eq!(problem.goal_point(&grid), Some(Point2::new(1.75, 0.75)));
        assert_eq!(problem.check("m.scen", "here/m.map", &grid), Ok(()));
        assert!(problem.check("m.scen", "other.map", &grid).is_err());
        let mut blocked = problem.clone();
        blocked.start = (0, 0);
        let error = blocked.check("m.scen", "m.map", &grid).expect_err("a wall");
        assert_eq!(error.line, Some(2));
        assert!(error.to_string().contains("start (0, 0)"));
        let mut other = problem.clone();
        other.width = 5;
        assert!(other.check("m.scen", "m.map", &grid).is_err());
    }

    #[test]
    fn a_broken_problem_list_is_named_with_line_and_field() {
        for (text, line) in [
            ("version 1\n0\tm.map\t4\t3\t1\t0\t3\t1\n", 2),
            ("version 1\n0\tm.map\t4\t3\t9\t0\t3\t1\t2\n", 2),
            ("version 1\n\n0 m.map 4 3 1 0 3 1 nan\n", 3),
            ("0 m.map 4 3 1 0 3 -1 2\n", 1),
        ] {
            let error = parse_scen("m.scen", text.as_bytes()).expect_err(text);
            assert_eq!(error.line, Some(line), "{error}");
        }
    }
}
