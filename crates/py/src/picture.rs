//! What `bikebot.plot` draws with: colours, outlines and names as the figures of `bikebot_report` have them.

use bikebot_report::drawing::Step;
use bikebot_report::{envelope_name, footprint_outline, palette};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments;
use crate::scenario::PyScenario;
use crate::search;

/// Straight legs in the place of a cubic: of a quarter circle of radius 1 they are off by less than 1e-3.
const LEGS: usize = 16;
/// Curvature for which the outline "bike" is grown where nothing says so, 1/m: that of `plan`.
const MAX_CURVATURE: f64 = 0.8;

/// Colours as "#rrggbb" by name; "ramp" is a list, from straight to the curvature limit; "causes" a dict, in the order of the legend.
#[pyfunction]
pub fn _palette(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let colours = PyDict::new(py);
    for (name, colour) in [
        ("paper", palette::PAPER),
        ("field", palette::FIELD),
        ("obstacle", palette::OBSTACLE),
        ("unknown", palette::UNKNOWN),
        ("ink", palette::INK),
        ("grey", palette::GREY),
        ("rule", palette::RULE),
        ("blue", palette::BLUE),
        ("sky", palette::SKY),
        ("vermilion", palette::VERMILION),
        ("green", palette::GREEN),
        ("purple", palette::PURPLE),
        ("orange", palette::ORANGE),
        ("recovered", palette::RECOVERED),
        ("other_cause", palette::OTHER_CAUSE),
    ] {
        colours.set_item(name, colour.0)?;
    }
    let ramp: Vec<&str> = palette::RAMP.iter().map(|colour| colour.0).collect();
    colours.set_item("ramp", ramp)?;
    let causes = PyDict::new(py);
    for (cause, colour) in palette::CAUSES {
        causes.set_item(cause, colour.0)?;
    }
    colours.set_item("causes", causes)?;
    Ok(colours)
}

/// The last part of a dotted key in words, with its unit.
#[pyfunction]
pub fn _name_of_key(key: &str) -> String {
    envelope_name(key)
}

/// The rim of a footprint in the body frame, m: closed pieces of shape (n, 2), none for a point. A scenario stands for its bike.
#[pyfunction]
pub fn _outline<'py>(
    py: Python<'py>,
    of: &Bound<'py, PyAny>,
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let footprint = match of.cast::<PyScenario>() {
        Ok(scenario) => scenario.get().0.setup.footprint.clone(),
        Err(_) => arguments::footprint(of, || search::bike(MAX_CURVATURE))?,
    };
    let mut pieces: Vec<Vec<f64>> = Vec::new();
    let mut here = [0.0, 0.0];
    for step in footprint_outline(&footprint).steps() {
        match *step {
            Step::Move(to) => {
                pieces.push(to.to_vec());
                here = to;
            }
            Step::Line(to) => {
                pieces.last_mut().into_iter().for_each(|it| it.extend(to));
                here = to;
            }
            Step::Cubic(a, b, to) => {
                for leg in 1..=LEGS {
                    let t = leg as f64 / LEGS as f64;
                    let u = 1.0 - t;
                    let weights = [u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t];
                    let at = |axis: usize| {
                        let handles = [here[axis], a[axis], b[axis], to[axis]];
                        weights.iter().zip(handles).map(|(w, it)| w * it).sum()
                    };
                    let point: [f64; 2] = [at(0), at(1)];
                    pieces
                        .last_mut()
                        .into_iter()
                        .for_each(|it| it.extend(point));
                }
                here = to;
            }
            Step::Close => {}
        }
    }
    pieces
        .into_iter()
        .map(|piece| {
            let count = piece.len() / 2;
            PyArray1::from_vec(py, piece).reshape([count, 2])
        })
        .collect()
}
