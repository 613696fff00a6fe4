//! What the colours mean: a swatch and a word for each, outside of all data.

use crate::drawing::{Area, Drawing, Label, Outline, Style};
use crate::palette;

/// Size of the words, px.
const SIZE: f64 = 12.0;
/// From one row to the next, px.
const ROW: f64 = 21.0;
/// Room for the swatch, px.
const SWATCH: f64 = 34.0;

/// How a row's swatch is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Swatch {
    /// A patch of area.
    Patch(Style),
    /// A piece of line.
    Line(Style),
    /// A small disc.
    Dot(Style),
    /// The colours of a ramp side by side.
    Ramp,
}

/// Rows in the order they are read.
#[derive(Debug, Clone, Default)]
pub(crate) struct Legend {
    rows: Vec<(Swatch, String)>,
}

impl Legend {
    pub(crate) fn row(&mut self, swatch: Swatch, text: impl Into<String>) {
        self.rows.push((swatch, text.into()));
    }

    /// Adds the rows of `other`.
    pub(crate) fn rows_of(&mut self, other: Self) {
        self.rows.extend(other.rows);
    }

    /// Height with that many columns, px.
    pub(crate) fn height(&self, columns: usize) -> f64 {
        self.rows.len().div_ceil(columns.max(1)) as f64 * ROW
    }

    /// Draws it into the top of `room`, down the first column, then the next.
    pub(crate) fn draw(&self, drawing: &mut Drawing, room: Area, columns: usize) {
        let columns = columns.max(1);
        let per_column = self.rows.len().div_ceil(columns).max(1);
        for (index, (swatch, text)) in self.rows.iter().enumerate() {
            let column_width = room.width / columns as f64;
            let left = room.left + (index / per_column) as f64 * column_width;
            let middle = room.top + ((index % per_column) as f64 + 0.5) * ROW;
            let patch = Area::new(left, middle - 6.0, 24.0, 12.0);
            match *swatch {
                Swatch::Patch(style) => drawing.shape(Outline::rectangle(patch), style),
                Swatch::Line(style) => drawing.shape(
                    Outline::through([[patch.left, middle], [patch.right(), middle]]),
                    style,
                ),
                Swatch::Dot(style) => {
                    drawing.shape(Outline::circle([left + 12.0, middle], 5.2), style);
                }
                Swatch::Ramp => {
                    let width = patch.width / palette::RAMP.len() as f64;
                    for (step, colour) in palette::RAMP.into_iter().enumerate() {
                        let at = left + step as f64 * width;
                        let piece = Area::new(at, middle - 3.0, width, 6.0);
                        drawing.shape(Outline::rectangle(piece), Style::fill(colour));
                    }
                }
            }
            let text = crate::label::fitted(text, SIZE, column_width - SWATCH);
            let at = [left + SWATCH, middle + 4.3];
            drawing.label(Label::new(text, at, SIZE, palette::INK));
        }
    }
}
