//! The envelope map of a sweep: its rows put into the cells of a picture.

use std::path::Path;

use bikebot_report::{Cell, Dimension, EnvelopeFigure, Panel, envelope_name};
use bikebot_sim::RunOutcome;
use bikebot_sim::sweep::{Row, Vary};

use crate::diag::Diagnostic;
use crate::exit::Failure;
use crate::picture;

/// Most panels of a map: beyond, nothing can be read.
const MAX_PANELS: usize = 24;

/// A map that is being filled.
#[derive(Debug)]
pub struct EnvelopeMap {
    format: picture::Format,
    axes: [Axis; 2],
    /// Names of the values that the panels stand for.
    rest: Vec<String>,
    panels: Vec<(Vec<String>, Vec<Cell>)>,
}

/// A varied value that is an axis: its values as typed, and as numbers in growing order.
#[derive(Debug)]
struct Axis {
    key: String,
    typed: Vec<String>,
    order: Vec<usize>,
    values: Vec<f64>,
}

impl Axis {
    fn of(vary: &Vary) -> Option<Self> {
        let numbers: Vec<f64> = vary
            .values
            .iter()
            .map(|value| value.parse().ok().filter(|number: &f64| number.is_finite()))
            .collect::<Option<_>>()?;
        let mut order: Vec<usize> = (0..numbers.len()).collect();
        order.sort_by(|a, b| numbers[*a].total_cmp(&numbers[*b]));
        let values: Vec<f64> = order.iter().map(|index| numbers[*index]).collect();
        if values.windows(2).any(|pair| pair[0] == pair[1]) {
            return None;
        }
        Some(Self {
            key: vary.key.clone(),
            typed: vary.values.clone(),
            order,
            values,
        })
    }

    /// Where a value as typed comes to lie.
    fn place(&self, typed: &str) -> Option<usize> {
        let index = self.typed.iter().position(|value| value == typed)?;
        self.order.iter().position(|place| *place == index)
    }
}

impl EnvelopeMap {
    /// A map over the first two of `varies`, to be written to `path`.
    pub fn over(path: &Path, varies: &[Vary]) -> Result<Self, Failure> {
        let refuse = |message: String, help: &str| {
            Err(Failure::usage(
                Diagnostic::error(message).help(help.to_owned()),
            ))
        };
        let Some(format) = picture::Format::of(path) else {
            return refuse(
                format!("--map {}: which format?", path.display()),
                "name a file that ends in .svg or .png",
            );
        };
        let [x, y, rest @ ..] = varies else {
            return refuse(
                "--map needs two --vary: what goes to the right and what goes upwards".into(),
                "such as --vary start.roll_deg=-16:16:33 --vary start.roll_rate_radps=-1:1:33",
            );
        };
        let mut axes = Vec::new();
        for vary in [x, y] {
            match Axis::of(vary) {
                Some(axis) => axes.push(axis),
                None => {
                    return refuse(
                        format!("--map: the values of `{}` are no axis", vary.key),
                        "the first two --vary take different numbers; names go into a third one",
                    );
                }
            }
        }
        let panels: usize = rest.iter().map(|vary| vary.values.len()).product();
        if panels > MAX_PANELS {
            return refuse(
                format!("--map would have {panels} panels; at most {MAX_PANELS} can be read"),
                "vary fewer values beyond the first two",
            );
        }
        let Ok(axes) = <[Axis; 2]>::try_from(axes) else {
            return refuse("--map needs two axes".into(), "give --vary twice");
        };
        Ok(Self {
            format,
            axes,
            rest: rest.iter().map(|vary| vary.key.clone()).collect(),
            panels: Vec::new(),
        })
    }

    /// Puts a row into its cell; a row that could not be run stays out.
    pub fn add(&mut self, row: &Row) {
        let value = |index: usize| {
            row.case
                .varied
                .get(index)
                .map(|change| change.value.as_str())
        };
        let [x, y] = &self.axes;
        let place = |axis: &Axis, index: usize| value(index).and_then(|typed| axis.place(typed));
        let (Some(i), Some(j), Ok(result)) = (place(x, 0), place(y, 1), &row.result) else {
            return;
        };
        let rest: Vec<String> = row
            .case
            .varied
            .iter()
            .skip(2)
            .map(|change| change.value.trim_matches('"').to_owned())
            .collect();
        let size = x.values.len() * y.values.len();
        let panel = match self.panels.iter().position(|(name, _)| *name == rest) {
            Some(panel) => panel,
            None => {
                self.panels.push((rest, vec![Cell::default(); size]));
                self.panels.len() - 1
            }
        };
        let cause = (result.outcome != RunOutcome::Arrived).then_some(result.reason.as_str());
        self.panels[panel].1[j * x.values.len() + i].add(cause);
    }

    /// The picture's bytes, in the format that its name asks for.
    pub fn picture(self, scenario: &str) -> Result<Vec<u8>, Failure> {
        let [x, y] = self.axes;
        let dimension = |axis: Axis| Dimension::of_key(&axis.key, axis.values);
        let rest = self.rest;
        let figure = EnvelopeFigure {
            title: format!("{scenario}: where it recovers"),
            x: dimension(x),
            y: dimension(y),
            panels: self
                .panels
                .into_iter()
                .map(|(values, cells)| Panel {
                    name: rest
                        .iter()
                        .zip(values)
                        .map(|(key, value)| format!("{} {value}", envelope_name(key)))
                        .collect::<Vec<_>>()
                        .join(", "),
                    cells,
                })
                .collect(),
        };
        let help = "vary fewer values";
        let drawing = figure
            .draw()
            .map_err(|error| Failure::usage(Diagnostic::error(error.to_string()).help(help)))?;
        self.format.write(&drawing, 2.0, help)
    }
}
