//! Maps as pictures made of characters, so that small ones can live in tests and diffs.
//!
//! One character is one cell, the top line is the top row: `#` occupied, `.` free, `?` unknown,
//! `S` and `G` mark start and goal on free cells. A mark of several cells stands for the centre
//! of their bounding box.

use bikebot_geometry::{Point2, Pose2, Vector2};

use crate::error::{MAX_GRID_CELLS, MAX_GRID_SIDE};
use crate::formats::{MapError, MapProblem};
use crate::grid::{Cell, OccupancyGrid};

/// A grid read from characters, with its marks in cell coordinates made world points.
#[derive(Debug, Clone, PartialEq)]
pub struct MapText {
    /// One metre per cell, lower-left corner at the origin.
    pub grid: OccupancyGrid,
    /// Centre of the cells marked `S`, m.
    pub start: Option<Point2>,
    /// Centre of the cells marked `G`, m.
    pub goal: Option<Point2>,
}

/// Reads a picture at one metre per cell; `name` is the file's name for error messages.
///
/// # Errors
///
/// An unknown character, a line of another length, an empty or absurdly large picture, each
/// with its line.
pub fn parse(name: &str, text: &str) -> Result<MapText, MapError> {
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    let last = lines.iter().rposition(|l| !l.is_empty());
    let rows = last.map_or(&[][..], |last| &lines[..=last]);
    let width = rows.first().map_or(0, |r| r.chars().count());
    let height = rows.len();
    if width == 0 {
        return Err(MapError::at_line(
            name,
            1,
            MapProblem::Malformed {
                found: "an empty first line".into(),
                expected: "a row of cells: # occupied, . free, ? unknown, S start, G goal".into(),
            },
        ));
    }
    if width > MAX_GRID_SIDE || height > MAX_GRID_SIDE || width * height > MAX_GRID_CELLS {
        return Err(MapError::new(
            name,
            MapProblem::TooManyCells {
                width: width as u64,
                height: height as u64,
            },
        ));
    }
    let mut cells = vec![Cell::Free; width * height];
    let mut marks: [Option<[usize; 4]>; 2] = [None, None];
    for (line, row) in rows.iter().enumerate() {
        let y = height - 1 - line;
        let found = row.chars().count();
        if found != width {
            return Err(MapError::at_line(
                name,
                line + 1,
                MapProblem::RowLength {
                    expected: width,
                    found,
                },
            ));
        }
        for (x, character) in row.chars().enumerate() {
            let mut mark = |which: usize| {
                let m = marks[which].get_or_insert([x, x, y, y]);
                *m = [m[0].min(x), m[1].max(x), m[2].min(y), m[3].max(y)];
                Cell::Free
            };
            cells[y * width + x] = match character {
                '#' => Cell::Occupied,
                '.' => Cell::Free,
                '?' => Cell::Unknown,
                'S' => mark(0),
                'G' => mark(1),
                other => {
                    return Err(MapError::at_line(
                        name,
                        line + 1,
                        MapProblem::Character {
                            column: x + 1,
                            found: other,
                            expected: "# occupied, . free, ? unknown, S start or G goal",
                        },
                    ));
                }
            };
        }
    }
    let grid = OccupancyGrid::new(width, height, 1.0, Pose2::new(0.0, 0.0, 0.0), cells)
        .map_err(|e| MapError::new(name, MapProblem::World(e)))?;
    let centre = |m: [usize; 4]| {
        let middle = |low: usize, high: usize| (low + high + 1) as f64 / 2.0;
        grid.from_cell_coordinates(Vector2::new(middle(m[0], m[1]), middle(m[2], m[3])))
    };
    Ok(MapText {
        start: marks[0].map(centre),
        goal: marks[1].map(centre),
        grid,
    })
}

/// The grid as a picture, top row first, each line ended by a line feed.
#[must_use]
pub fn to_text(grid: &OccupancyGrid) -> String {
    let mut text = String::with_capacity((grid.width + 1) * grid.height);
    for row in grid.cells.chunks(grid.width.max(1)).rev() {
        text.extend(row.iter().map(|cell| match cell {
            Cell::Occupied => '#',
            Cell::Free => '.',
            Cell::Unknown => '?',
        }));
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_read_and_drawn_again_is_the_same_picture() {
        let picture = "#..?.\n..#..\n##...\n";
        let map = parse("m.txt", picture).expect("a valid picture");
        assert_eq!(to_text(&map.grid), picture);
        assert_eq!(map.grid.cell(0, 0), Some(Cell::Occupied));
        assert_eq!(map.grid.cell(3, 2), Some(Cell::Unknown));
        assert_eq!((map.start, map.goal), (None, None));
    }

    #[test]
    fn marks_stand_for_the_centre_of_their_cells() {
        let map = parse("m.txt", "...GG\n...GG\nS....").expect("a valid picture");
        assert_eq!(map.start, Some(Point2::new(0.5, 0.5)));
        assert_eq!(map.goal, Some(Point2::new(4.0, 2.0)));
    }

    #[test]
    fn a_bad_character_and_a_short_row_are_named_with_their_line() {
        let bad = parse("m.txt", "...\n.x.\n").expect_err("x is no cell");
        assert_eq!(bad.line, Some(2));
        assert!(bad.to_string().contains("column 2"), "{bad}");
        let short = parse("m.txt", "...\n..\n...").expect_err("short row");
        assert_eq!(short.line, Some(2));
        assert!(parse("m.txt", "").is_err());
        assert!(parse("m.txt", "\n\n").is_err());
    }
}
