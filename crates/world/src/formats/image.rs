//! Grey images as occupancy, with the semantics of map_server.
//!
//! Decisions, since readers differ on them:
//!
//! * Colour: the shade is the mean of red, green and blue. Palettes are looked up first.
//! * Depth: 16-bit images keep their 16 bits; thresholds are compared as fractions.
//! * Alpha: a pixel that is not fully opaque says nothing: the cell is unknown, in every mode.
//!   Otherwise alpha has no part in the shade.
//! * Modes: `trinary` and `scale` compare the darkness p (1 is black; `negate` turns it round)
//!   with the thresholds: above `occupied_thresh` occupied, below `free_thresh` free, else
//!   unknown. What `scale` grades between the thresholds is not known to be free, so it is
//!   unknown too. `raw` takes a pixel of 0 to 100 (of 255) as the probability in percent,
//!   compares it with the same thresholds, ignores `negate`, and reads all others as unknown.
//! * Rows: the first row of the picture is the top of the map, whichever way a file stores it.

use bikebot_geometry::Pose2;

use super::error::{MapError, MapProblem};
use super::{Draft, bmp, pgm, png};
use crate::error::{MAX_GRID_CELLS, MAX_GRID_SIDE};
use crate::grid::{Cell, OccupancyGrid};

/// The grey that map_saver writes for unknown cells, of 255.
pub(crate) const UNKNOWN_GREY: u16 = 205;

/// How shades become cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Occupied, free, or unknown by two thresholds.
    Trinary,
    /// Like trinary; the grading between the thresholds reads as unknown.
    Scale,
    /// The pixel is the probability of occupancy in percent.
    Raw,
}

/// The rule by which shades become cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// How shades are read.
    pub mode: Mode,
    /// White is occupied instead of black.
    pub negate: bool,
    /// Darkness above this is occupied, 0 to 1.
    pub occupied: f64,
    /// Darkness below this is free, 0 to 1.
    pub free: f64,
}

impl Default for Thresholds {
    /// What map_saver writes: trinary, 0.65 and 0.196.
    fn default() -> Self {
        Self {
            mode: Mode::Trinary,
            negate: false,
            occupied: 0.65,
            free: 0.196,
        }
    }
}

impl Thresholds {
    /// The cell for a shade from 0 (black) to 65 535 (white).
    #[must_use]
    pub fn cell(&self, shade: u16) -> Cell {
        let white = f64::from(shade) / 65_535.0;
        let occupancy = match self.mode {
            Mode::Trinary | Mode::Scale if self.negate => white,
            Mode::Trinary | Mode::Scale => 1.0 - white,
            Mode::Raw => {
                let percent = (white * 255.0).round();
                if percent > 100.0 {
                    return Cell::Unknown;
                }
                percent / 100.0
            }
        };
        if occupancy > self.occupied {
            Cell::Occupied
        } else if occupancy < self.free {
            Cell::Free
        } else {
            Cell::Unknown
        }
    }
}

/// The image formats read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Pgm,
    Png,
    Bmp,
}

impl Kind {
    /// By the first bytes.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [b'P', b'1'..=b'7', b'\t' | b'\n' | b'\r' | b' ' | b'#', ..] => Some(Self::Pgm),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            // Two letters alone would claim many a text; the reserved zeros make it certain.
            [b'B', b'M', _, _, _, _, 0, 0, 0, 0, ..] => Some(Self::Bmp),
            _ => None,
        }
    }
}

/// A decoded image, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Image {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// 0 black to 65 535 white.
    pub(crate) shade: Vec<u16>,
    /// Which pixels are not fully opaque; empty if all are.
    pub(crate) transparent: Vec<bool>,
}

/// An 8-bit value on the 16-bit scale, exactly: 255 becomes 65 535.
pub(crate) fn widen(v: u8) -> u16 {
    u16::from(v) * 257
}

/// Mean of three channels, rounded.
pub(crate) fn mean(r: u16, g: u16, b: u16) -> u16 {
    ((u32::from(r) + u32::from(g) + u32::from(b) + 1) / 3) as u16
}

/// Refuses an absurd size before anything is allocated for it.
pub(crate) fn check_size(name: &str, width: u64, height: u64) -> Result<(), MapError> {
    let side = MAX_GRID_SIDE as u64;
    if width == 0 || height == 0 {
        return Err(MapError::new(
            name,
            MapProblem::Malformed {
                found: format!("an image of {width} x {height} pixels"),
                expected: "at least one pixel".into(),
            },
        ));
    }
    if width > side || height > side || width * height > MAX_GRID_CELLS as u64 {
        return Err(MapError::new(
            name,
            MapProblem::TooManyCells { width, height },
        ));
    }
    Ok(())
}

/// Decodes an image of any known kind.
pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Image, MapError> {
    match Kind::of(bytes) {
        Some(Kind::Pgm) => pgm::decode(name, bytes),
        Some(Kind::Png) => png::decode(name, bytes),
        Some(Kind::Bmp) => bmp::decode(name, bytes),
        None => Err(MapError::new(
            name,
            MapProblem::Malformed {
                found: if bytes.is_empty() {
                    "an empty file".into()
                } else {
                    let head = &bytes[..bytes.len().min(8)];
                    format!("a file that begins with {head:02x?}")
                },
                expected: "a PGM (P2, P5), PNG or BMP image".into(),
            },
        )),
    }
}

/// What turning an image into cells found on the way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Census {
    pub(crate) unknown: usize,
    pub(crate) transparent: usize,
    /// Pixels of map_saver's unknown grey that came out free.
    pub(crate) unknown_grey_read_free: usize,
}

/// The image as cells, bottom row first.
pub(crate) fn to_cells(image: &Image, rule: &Thresholds) -> (Vec<Cell>, Census) {
    let mut census = Census::default();
    let mut cells = Vec::with_capacity(image.shade.len());
    let unknown_grey = UNKNOWN_GREY * 257;
    for row in (0..image.height).rev() {
        let range = row * image.width..(row + 1) * image.width;
        for index in range {
            let shade = image.shade[index];
            let cell = if image.transparent.get(index) == Some(&true) {
                census.transparent += 1;
                Cell::Unknown
            } else {
                rule.cell(shade)
            };
            if cell == Cell::Unknown {
                census.unknown += 1;
            } else if cell == Cell::Free && shade == unknown_grey && !rule.negate {
                census.unknown_grey_read_free += 1;
            }
            cells.push(cell);
        }
    }
    (cells, census)
}

/// A grid from an image, and warnings about what is in it.
pub(crate) fn to_grid(
    name: &str,
    image: &Image,
    rule: &Thresholds,
    resolution: f64,
    origin: Pose2,
) -> Result<(OccupancyGrid, Census, Vec<String>), MapError> {
    let (cells, census) = to_cells(image, rule);
    let grid = OccupancyGrid::new(image.width, image.height, resolution, origin, cells)
        .map_err(|e| MapError::new(name, MapProblem::World(e)))?;
    let mut warnings = Vec::new();
    if census.transparent > 0 {
        warnings.push(format!(
            "{name}: {} of {} pixels are transparent; they are read as unknown",
            census.transparent,
            image.shade.len()
        ));
    }
    Ok((grid, census, warnings))
}

/// An image by itself: map_saver's thresholds, lower-left corner at the origin.
pub(crate) fn read_bare(name: &str, bytes: &[u8], resolution: f64) -> Result<Draft, MapError> {
    let image = decode(name, bytes)?;
    let rule = Thresholds::default();
    let origin = Pose2::new(0.0, 0.0, 0.0);
    let (grid, census, mut warnings) = to_grid(name, &image, &rule, resolution, origin)?;
    if census.unknown > census.transparent {
        warnings.push(format!(
            "{name}: {} of {} pixels are neither dark enough to be occupied (darkness above {}) nor light enough to be free (below {}); they are read as unknown. A map_server .yaml beside the image can set other thresholds",
            census.unknown - census.transparent,
            image.shade.len(),
            rule.occupied,
            rule.free
        ));
    }
    Ok(Draft::of_grid(grid, warnings))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_modes_read_the_same_grey_differently() {
        let rule = |mode, negate| Thresholds {
            mode,
            negate,
            occupied: 0.65,
            free: 0.196,
        };
        let cell = |mode, negate, v: u8| rule(mode, negate).cell(widen(v));
        for mode in [Mode::Trinary, Mode::Scale] {
            assert_eq!(cell(mode, false, 0), Cell::Occupied);
            assert_eq!(cell(mode, false, 254), Cell::Free);
            assert_eq!(cell(mode, false, 205), Cell::Unknown);
            assert_eq!(cell(mode, false, 128), Cell::Unknown);
            assert_eq!(cell(mode, true, 0), Cell::Free);
            assert_eq!(cell(mode, true, 254), Cell::Occupied);
        }
        for negate in [false, true] {
            assert_eq!(cell(Mode::Raw, negate, 0), Cell::Free);
            assert_eq!(cell(Mode::Raw, negate, 40), Cell::Unknown);
            assert_eq!(cell(Mode::Raw, negate, 100), Cell::Occupied);
            assert_eq!(cell(Mode::Raw, negate, 101), Cell::Unknown);
            assert_eq!(cell(Mode::Raw, negate, 255), Cell::Unknown);
        }
    }

    #[test]
    fn a_text_that_begins_with_bm_is_no_bitmap() {
        assert_eq!(Kind::of(b"BMW: a text"), None);
        assert_eq!(Kind::of(b"P5\n1 1\n255\n"), Some(Kind::Pgm));
        assert_eq!(Kind::of(b"P50"), None);
        assert_eq!(Kind::of(b""), None);
    }
}
