//! What callers hand in, checked: every refusal names the argument and what would do.

use std::f64::consts::TAU;
use std::path::PathBuf;

use bikebot_geometry::Point2;
use bikebot_planner::{EndPose, Method};
use bikebot_world::Footprint;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyComplex, PyFloat, PyString};

use crate::errors::{kind, value};

/// Largest seed: what a scenario may hold.
pub const MAX_SEED: u64 = i64::MAX as u64;
/// Largest coordinate, m.
const MAX_COORDINATE: f64 = 1e9;

/// Name of an object's type, for messages.
pub fn type_name(object: &Bound<'_, PyAny>) -> String {
    object
        .get_type()
        .name()
        .map_or_else(|_| "an object".into(), |name| name.to_string())
}

/// A finite number.
pub fn number(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    if let Ok(plain) = object.cast_exact::<PyFloat>()
        && plain.value().is_finite()
    {
        return Ok(plain.value());
    }
    let refuse = || kind(format!("{name} takes a number, not {}", type_name(object)));
    // numpy would drop the imaginary part with a warning.
    let is_complex =
        object.is_instance_of::<PyComplex>() || type_name(object).starts_with("complex");
    if object.is_instance_of::<PyBool>() || is_complex {
        return Err(refuse());
    }
    let found: f64 = object.extract().map_err(|_| refuse())?;
    if found.is_finite() {
        Ok(found)
    } else {
        Err(value(format!(
            "{name} is {found}: it takes a finite number"
        )))
    }
}

/// A number above 0.
pub fn positive(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    at_least(name, object, f64::MIN_POSITIVE, "above 0")
}

/// A number of 0 or more.
pub fn not_negative(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    at_least(name, object, 0.0, "of 0 or more")
}

fn at_least(name: &str, object: &Bound<'_, PyAny>, least: f64, words: &str) -> PyResult<f64> {
    let found = number(name, object)?;
    if found >= least {
        Ok(found)
    } else {
        Err(value(format!(
            "{name} is {found}: it takes a number {words}"
        )))
    }
}

/// A whole number from `least` to `most`.
pub fn count(name: &str, object: &Bound<'_, PyAny>, least: u64, most: u64) -> PyResult<u64> {
    let range = || format!("it takes a whole number from {least} to {most}");
    if object.is_instance_of::<PyBool>()
        || object.hasattr("__float__")? && !object.hasattr("__index__")?
    {
        return Err(kind(format!(
            "{name} is of type {}: {}",
            type_name(object),
            range()
        )));
    }
    match object.extract::<i128>() {
        Ok(found) if found >= i128::from(least) && found <= i128::from(most) => Ok(found as u64),
        Ok(found) => Err(value(format!("{name} is {found}: {}", range()))),
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyOverflowError>(object.py()) => {
            Err(value(format!("{name} is out of range: {}", range())))
        }
        Err(_) => Err(kind(format!(
            "{name} is of type {}: {}",
            type_name(object),
            range()
        ))),
    }
}

/// A seed.
pub fn seed(object: &Bound<'_, PyAny>) -> PyResult<u64> {
    count("seed", object, 0, MAX_SEED)
}

/// An angle, rad. Beyond a full turn it is taken for degrees, and refused.
pub fn angle(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    let found = number(name, object)?;
    if found.abs() <= TAU + 1e-9 {
        Ok(found)
    } else {
        Err(value(format!(
            "{name} is {found} rad, beyond ±2π; angles are in radians, so if this is in degrees give math.radians({found})"
        )))
    }
}

/// The numbers of a short sequence or a one-dimensional array.
fn items<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
    most: usize,
    form: &str,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let refuse = || kind(format!("{name} takes {form}, not {}", type_name(object)));
    if object.is_instance_of::<PyString>() || object.is_instance_of::<PyBytes>() {
        return Err(refuse());
    }
    if let Ok(array) = object.cast::<PyUntypedArray>()
        && array.ndim() != 1
    {
        return Err(value(format!(
            "{name} is an array of shape {:?}: it takes {form}",
            array.shape()
        )));
    }
    let mut found = Vec::with_capacity(most);
    for item in object.try_iter().map_err(|_| refuse())? {
        found.push(item?);
        if found.len() > most {
            break;
        }
    }
    Ok(found)
}

fn coordinate(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    let found = number(name, object)?;
    if found.abs() <= MAX_COORDINATE {
        Ok(found)
    } else {
        Err(value(format!(
            "{name} is {found} m: it takes at most ±1e9 m"
        )))
    }
}

/// `(x, y)`, `(x, y, heading)` or `(x, y, None)`: metres, radians.
pub fn end(name: &str, object: &Bound<'_, PyAny>) -> PyResult<EndPose> {
    const FORM: &str =
        "(x, y) or (x, y, heading) in metres and radians, where a heading of None is any";
    let found = items(name, object, 3, FORM)?;
    let (x, y, heading) = match &found[..] {
        [x, y] => (x, y, None),
        [x, y, heading] => (x, y, (!heading.is_none()).then_some(heading)),
        other => {
            let many = if other.len() > 3 {
                "more than 3".into()
            } else {
                other.len().to_string()
            };
            return Err(value(format!("{name} has {many} numbers: it takes {FORM}")));
        }
    };
    let (x, y) = (
        coordinate(&format!("{name}[0] (x)"), x)?,
        coordinate(&format!("{name}[1] (y)"), y)?,
    );
    Ok(match heading {
        Some(heading) => EndPose::pose(x, y, angle(&format!("{name}[2] (heading)"), heading)?),
        None => EndPose::point(x, y),
    })
}

/// `N` finite numbers.
pub fn numbers<const N: usize>(
    name: &str,
    object: &Bound<'_, PyAny>,
    form: &str,
) -> PyResult<[f64; N]> {
    let found = items(name, object, N, form)?;
    if found.len() != N {
        return Err(value(format!("{name} takes {form}")));
    }
    let mut values = [0.0; N];
    for (index, (place, item)) in values.iter_mut().zip(&found).enumerate() {
        *place = number(&format!("{name}[{index}]"), item)?;
    }
    Ok(values)
}

/// Points `[[x, y], …]`, m.
pub fn points(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<Point2>> {
    const FORM: &str = "points [[x, y], …] in metres, as a list or an array of shape (n, 2)";
    if object.is_instance_of::<PyString>() {
        return Err(kind(format!("{name} takes {FORM}, not str")));
    }
    let iterator = object
        .try_iter()
        .map_err(|_| kind(format!("{name} takes {FORM}, not {}", type_name(object))))?;
    let mut found = Vec::new();
    for (index, item) in iterator.enumerate() {
        let [x, y] = numbers(
            &format!("{name}[{index}]"),
            &item?,
            "two numbers x, y in metres",
        )?;
        if x.abs() > MAX_COORDINATE || y.abs() > MAX_COORDINATE {
            return Err(value(format!(
                "{name}[{index}] is ({x}, {y}) m: coordinates are at most ±1e9 m"
            )));
        }
        found.push(Point2::new(x, y));
        if found.len() > 1_000_000 {
            return Err(value(format!("{name} has more than a million points")));
        }
    }
    Ok(found)
}

/// A planning method by its name.
pub fn method(object: &Bound<'_, PyAny>) -> PyResult<Method> {
    let names = || Method::ALL.map(|method| format!("\"{method}\"")).join(", ");
    let text: String = object.extract().map_err(|_| {
        kind(format!(
            "method takes one of the names {}, not {}",
            names(),
            type_name(object)
        ))
    })?;
    text.parse()
        .map_err(|_| value(format!("method is {text:?}: it takes one of {}", names())))
}

/// An outline: a name or a specification as on the command line, or the vertices of a simple polygon.
pub fn footprint(
    object: &Bound<'_, PyAny>,
    bike: impl FnOnce() -> Footprint,
) -> PyResult<Footprint> {
    let told = |error: bikebot_world::FootprintError| value(error.to_string());
    if let Ok(text) = object.extract::<String>() {
        if text.trim() == "bike" {
            return Ok(bike());
        }
        return text.parse().map_err(told);
    }
    let vertices = points("footprint", object)?;
    Footprint::polygon(&vertices).map_err(told)
}

/// A path of the file system: `str` or `os.PathLike`.
pub fn path(name: &str, object: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    object.extract().map_err(|_| {
        kind(format!(
            "{name} takes a path as str or os.PathLike, not {}",
            type_name(object)
        ))
    })
}
