//! What figures have in common: paper, a heading, a map with its frame.

use crate::axis::MapFrame;
use crate::drawing::{Area, Drawing, Item, Label, Outline, Style};
use crate::label;
use crate::palette;

/// Room to the right of what is drawn, px.
const RIGHT: f64 = 24.0;

/// Paper with a title and, below it, a line of facts, both from `left` on (px) and as far as there is room. Where the
/// height becomes known later only, [`lay_paper`] is called again.
pub(crate) fn headed(
    [width, height]: [f64; 2],
    left: f64,
    title: &str,
    facts: &str,
    description: String,
) -> Drawing {
    let mut drawing = Drawing::new(width, height, description);
    lay_paper(&mut drawing);
    for (text, y, size, colour) in [
        (title, 36.0, 21.0, palette::INK),
        (facts, 60.0, 13.0, palette::GREY),
    ] {
        let text = label::fitted(text, size, width - left - RIGHT);
        drawing.label(Label::new(text, [left, y], size, colour));
    }
    drawing
}

/// Lays the paper under what was drawn, at the size the sheet has now.
pub(crate) fn lay_paper(drawing: &mut Drawing) {
    let paper = Item::Shape(
        Outline::rectangle(Area::new(0.0, 0.0, drawing.width, drawing.height)),
        Style::fill(palette::PAPER),
    );
    let is_laid = matches!(
        drawing.items.first(),
        Some(Item::Shape(_, style)) if *style == Style::fill(palette::PAPER)
    );
    if is_laid {
        drawing.items[0] = paper;
    } else {
        drawing.items.insert(0, paper);
    }
}

/// Puts `items` on the field of a map, and its frame about them.
pub(crate) fn put_map(drawing: &mut Drawing, frame: &MapFrame, items: Vec<Item>) {
    let chart = frame.chart();
    let area = frame.area;
    drawing.shape(Outline::rectangle(area), Style::fill(palette::FIELD));
    chart.data(drawing, items);
    let (x_ticks, y_ticks) = (ticks(area.width, 90.0, 12), ticks(area.height, 90.0, 12));
    chart.frame(drawing, x_ticks, y_ticks, "x, m");
    let name_at = [area.left, area.top - 8.0];
    drawing.label(Label::new("y, m", name_at, 12.5, palette::INK));
}

/// How many ticks an axis of `pixels` takes that asks `each` of them for one, two at least and `most` at most.
pub(crate) fn ticks(pixels: f64, each: f64, most: usize) -> usize {
    ((pixels / each) as usize).clamp(2, most)
}
