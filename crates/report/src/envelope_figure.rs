//! An envelope map: over two varied values, where the bike recovers and what it fails for elsewhere.
//!
//! One cell for each combination, recovered cells light, failed ones in the colour of their cause; a third
//! value makes panels side by side. The colours are those of Okabe and Ito, and every failed colour is darker
//! than the recovered one, so that the map can be read in grey as well.

use crate::axis::{Axis, Chart};
use crate::drawing::{Area, Drawing, Item, Label, Outline, Style};
use crate::error::ReportError;
use crate::legend::{Legend, Swatch};
use crate::palette::{self, CAUSES, Colour, OTHER_CAUSE, RECOVERED};
use std::collections::BTreeMap;

/// Most cells that are drawn, over all panels.
const MAX_CELLS: usize = 250_000;

/// One of the two varied values.
#[derive(Debug, Clone, PartialEq)]
pub struct Dimension {
    /// Its name with its unit.
    pub name: String,
    /// Its values, growing.
    pub values: Vec<f64>,
}

impl Dimension {
    /// Named after a key of a scenario: `start.roll_deg` is "roll, °".
    #[must_use]
    pub fn of_key(key: &str, values: Vec<f64>) -> Self {
        Self {
            name: name_of_key(key),
            values,
        }
    }

    /// Edges of the cells: half way between the values, and as far again beyond the first and the last.
    fn edges(&self) -> Vec<f64> {
        let v = &self.values;
        let Some((first, last)) = v.first().zip(v.last()) else {
            return vec![0.0, 1.0];
        };
        if v.len() == 1 {
            return vec![first - 0.5, first + 0.5];
        }
        let mut edges = vec![first - 0.5 * (v[1] - first)];
        edges.extend(v.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
        edges.push(last + 0.5 * (last - v[v.len() - 2]));
        edges
    }
}

/// The last part of a dotted key in words, with the unit that its ending promises.
#[must_use]
pub fn name_of_key(key: &str) -> String {
    const UNITS: [(&str, &str); 14] = [
        ("_radps", "rad/s"),
        ("_mps2", "m/s²"),
        ("_kgm2", "kg m²"),
        ("_per_m", "1/m"),
        ("_per_s", "1/s"),
        ("_mps", "m/s"),
        ("_deg", "°"),
        ("_rad", "rad"),
        ("_nm", "N m"),
        ("_ns", "N s"),
        ("_kg", "kg"),
        ("_n", "N"),
        ("_s", "s"),
        ("_m", "m"),
    ];
    let last = key.rsplit('.').next().unwrap_or(key);
    UNITS
        .iter()
        .find_map(|(ending, unit)| Some((last.strip_suffix(ending)?, unit)))
        .map_or(last.replace('_', " "), |(name, unit)| {
            format!("{}, {unit}", name.replace('_', " "))
        })
}

/// How the runs of one cell ended.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cell {
    /// Runs that recovered.
    pub recovered: usize,
    /// Runs that did not, by their cause.
    pub failed: BTreeMap<String, usize>,
}

impl Cell {
    /// Adds a run: what it failed for, or nothing.
    pub fn add(&mut self, cause: Option<&str>) {
        match cause {
            None => self.recovered += 1,
            Some(cause) => *self.failed.entry(cause.to_owned()).or_default() += 1,
        }
    }

    /// The most frequent cause; the first by name among equals.
    fn cause(&self) -> Option<&str> {
        self.failed
            .iter()
            .max_by(|a, b| a.1.cmp(b.1).then(b.0.cmp(a.0)))
            .map(|(cause, _)| cause.as_str())
    }
}

/// The map for one value of everything else.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// What is particular to it; empty where there is only one.
    pub name: String,
    /// Cells, the first dimension running fastest.
    pub cells: Vec<Cell>,
}

/// An envelope map.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvelopeFigure {
    /// What was varied of what.
    pub title: String,
    /// The axis to the right.
    pub x: Dimension,
    /// The axis upwards.
    pub y: Dimension,
    /// One map for each value of the rest.
    pub panels: Vec<Panel>,
}

fn colour_of(cause: &str) -> Colour {
    CAUSES
        .iter()
        .find(|(name, _)| *name == cause)
        .map_or(OTHER_CAUSE, |(_, colour)| *colour)
}

/// Width and height of a panel's map, px, and the room round it.
const MAP: [f64; 2] = [345.0, 300.0];
const LEFT: f64 = 62.0;
const TOP: f64 = 66.0;
const GAP: f64 = 58.0;
const BELOW: f64 = 48.0;
const COLUMNS: usize = 3;
const LEGEND_ROW: f64 = 21.0;

impl EnvelopeFigure {
    /// Draws it.
    ///
    /// # Errors
    ///
    /// [`ReportError::TooMany`] beyond 250 000 cells.
    pub fn draw(&self) -> Result<Drawing, ReportError> {
        let count = self.panels.len() * self.x.values.len() * self.y.values.len();
        if count > MAX_CELLS {
            return Err(ReportError::TooMany {
                count,
                what: "cells",
                most: MAX_CELLS,
            });
        }
        let columns = self.panels.len().clamp(1, COLUMNS);
        let rows = self.panels.len().div_ceil(columns).max(1);
        let legend = self.legend();
        let (legend_columns, panel_height) = (columns.max(2), MAP[1] + BELOW + 30.0);
        let width = LEFT + columns as f64 * (MAP[0] + GAP) - GAP + 24.0;
        let legend_top = TOP + rows as f64 * panel_height;
        let height = legend_top + legend.height(legend_columns).max(LEGEND_ROW) + 16.0;
        let mut drawing = Drawing::new(width, height, self.title.clone());
        drawing.label(Label::new(
            self.title.clone(),
            [LEFT, 26.0],
            15.0,
            palette::INK,
        ));
        for (index, panel) in self.panels.iter().enumerate() {
            let left = LEFT + (index % columns) as f64 * (MAP[0] + GAP);
            let top = TOP + (index / columns) as f64 * panel_height;
            self.panel(&mut drawing, panel, Area::new(left, top, MAP[0], MAP[1]));
        }
        let room = Area::new(LEFT, legend_top, width - LEFT - 16.0, height - legend_top);
        legend.draw(&mut drawing, room, legend_columns);
        Ok(drawing)
    }

    fn panel(&self, drawing: &mut Drawing, panel: &Panel, area: Area) {
        let (xs, ys) = (self.x.edges(), self.y.edges());
        let span = |edges: &[f64]| {
            let (first, last) = (edges[0], edges[edges.len() - 1]);
            Axis::linear(first.min(last), first.max(last))
        };
        let chart = Chart {
            area,
            x: span(&xs),
            y: span(&ys),
        };
        let mut items = Vec::new();
        // One outline for each colour keeps the file small.
        let mut fields: BTreeMap<&'static str, Outline> = BTreeMap::new();
        let mut marks: BTreeMap<&'static str, Outline> = BTreeMap::new();
        for (index, cell) in panel.cells.iter().enumerate() {
            let (i, j) = (index % self.x.values.len(), index / self.x.values.len());
            if j + 1 >= ys.len() {
                break;
            }
            let (a, b) = (chart.at(xs[i], ys[j]), chart.at(xs[i + 1], ys[j + 1]));
            let place = Area::new(
                a[0].min(b[0]),
                a[1].min(b[1]),
                (b[0] - a[0]).abs(),
                (b[1] - a[1]).abs(),
            );
            let colour = match cell.cause() {
                Some(cause) if cell.recovered == 0 => colour_of(cause),
                Some(cause) => {
                    // Some runs recover and some do not: the cause as a patch in the middle.
                    let side = 0.45 * place.width.min(place.height);
                    let middle = Area::new(
                        place.left + 0.5 * (place.width - side),
                        place.top + 0.5 * (place.height - side),
                        side,
                        side,
                    );
                    marks
                        .entry(colour_of(cause).0)
                        .or_default()
                        .append(Outline::rectangle(middle));
                    RECOVERED
                }
                None if cell.recovered > 0 => RECOVERED,
                None => continue,
            };
            fields
                .entry(colour.0)
                .or_default()
                .append(Outline::rectangle(place));
        }
        for (colour, outline) in fields.into_iter().chain(marks) {
            items.push(Item::Shape(outline, Style::fill(Colour(colour))));
        }
        drawing.shape(Outline::rectangle(area), Style::fill(palette::PAPER));
        chart.data(drawing, items);
        chart.frame(drawing, 6, 6, &self.x.name);
        let remark = match panel.name.as_str() {
            "" => self.share(panel),
            name => format!("{name} · {}", self.share(panel)),
        };
        chart.heading(drawing, &self.y.name, &remark);
    }

    /// How much of the map is recovered, in words.
    fn share(&self, panel: &Panel) -> String {
        let (good, all) = panel.cells.iter().fold((0, 0), |(good, all), cell| {
            let failed: usize = cell.failed.values().sum();
            (good + cell.recovered, all + cell.recovered + failed)
        });
        if all == 0 {
            return "nothing was run".into();
        }
        format!("{:.1} % recovered", 100.0 * good as f64 / all as f64)
    }

    fn legend(&self) -> Legend {
        let mut legend = Legend::default();
        legend.row(
            Swatch::Patch(Style::fill(RECOVERED).edged(palette::GREY, 0.6)),
            "recovered",
        );
        let cells = || self.panels.iter().flat_map(|panel| &panel.cells);
        let mut causes: Vec<&str> = cells()
            .flat_map(|cell| cell.failed.keys())
            .map(String::as_str)
            .collect();
        causes.sort_unstable();
        causes.dedup();
        let own = |cause: &str| CAUSES.iter().position(|(name, _)| *name == cause);
        causes.sort_by_key(|cause| own(cause).unwrap_or(usize::MAX));
        let mut others = Vec::new();
        for cause in causes {
            let words = cause.replace('_', " ");
            match own(cause) {
                Some(index) => {
                    legend.row(Swatch::Patch(Style::fill(CAUSES[index].1)), words);
                }
                None => others.push(words),
            }
        }
        if !others.is_empty() {
            legend.row(Swatch::Patch(Style::fill(OTHER_CAUSE)), others.join(", "));
        }
        if cells().any(|cell| cell.recovered > 0 && !cell.failed.is_empty()) {
            legend.row(
                Swatch::Dot(Style::fill(palette::GREY)),
                "a patch in a light cell: some seeds fail",
            );
        }
        legend
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::assert_is_as_kept;
    use crate::svg;

    fn cell(recovered: usize, failed: &[(&str, usize)]) -> Cell {
        Cell {
            recovered,
            failed: failed
                .iter()
                .map(|(cause, count)| ((*cause).to_owned(), *count))
                .collect(),
        }
    }

    fn small() -> EnvelopeFigure {
        let good = || cell(2, &[]);
        EnvelopeFigure {
            title: "push: impulse over speed".into(),
            x: Dimension::of_key("disturbance.0.impulse_ns", vec![0.0, 10.0, 20.0]),
            y: Dimension::of_key("follow.max_speed_mps", vec![1.0, 2.0]),
            panels: vec![
                Panel {
                    name: "mode flywheel".into(),
                    cells: vec![
                        good(),
                        good(),
                        cell(1, &[("slip", 1)]),
                        good(),
                        cell(0, &[("balancer_saturated", 2)]),
                        cell(0, &[("wheel_lift", 2)]),
                    ],
                },
                Panel {
                    name: "mode balancer".into(),
                    cells: vec![
                        good(),
                        cell(0, &[("roll", 1), ("slip", 1)]),
                        cell(0, &[("obstacle", 2)]),
                        good(),
                        cell(0, &[("control_failed", 2)]),
                        Cell::default(),
                    ],
                },
            ],
        }
    }

    #[test]
    fn a_small_map_is_drawn_byte_for_byte_as_it_was() {
        let now = svg::write(&small().draw().unwrap());
        assert_is_as_kept(&now, "envelope.svg");
    }

    #[test]
    fn a_key_is_read_with_its_unit() {
        assert_eq!(name_of_key("start.roll_deg"), "roll, °");
        assert_eq!(name_of_key("start.roll_rate_radps"), "roll rate, rad/s");
        assert_eq!(name_of_key("disturbance.0.impulse_ns"), "impulse, N s");
        assert_eq!(name_of_key("bike.friction"), "friction");
        assert_eq!(name_of_key("bike.m1_kg"), "m1, kg");
    }

    #[test]
    fn cells_reach_half_way_to_their_neighbours() {
        let uneven = Dimension::of_key("a_m", vec![0.0, 1.0, 3.0]);
        assert_eq!(uneven.edges(), [-0.5, 0.5, 2.0, 4.0]);
        assert_eq!(Dimension::of_key("a", vec![2.0]).edges(), [1.5, 2.5]);
    }

    #[test]
    fn the_most_frequent_cause_colours_a_cell() {
        assert_eq!(cell(0, &[("slip", 2), ("roll", 1)]).cause(), Some("slip"));
        assert_eq!(cell(0, &[("slip", 1), ("roll", 1)]).cause(), Some("roll"));
        assert_eq!(cell(3, &[]).cause(), None);
    }

    #[test]
    fn more_cells_than_can_be_seen_are_refused() {
        let mut figure = small();
        figure.x.values = (0..1000).map(f64::from).collect();
        figure.y.values = (0..1000).map(f64::from).collect();
        assert!(matches!(
            figure.draw(),
            Err(ReportError::TooMany {
                most: MAX_CELLS,
                ..
            })
        ));
    }

    #[test]
    fn every_failure_is_darker_than_recovery() {
        let light = |colour: Colour| {
            let part = |i: usize| f64::from(u8::from_str_radix(&colour.0[i..i + 2], 16).unwrap());
            0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
        };
        for (cause, colour) in CAUSES {
            assert!(light(colour) + 40.0 < light(RECOVERED), "{cause}");
        }
    }
}
