//! Python values as TOML, for changes to a scenario.

use bikebot_sim::Override;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString, PyTuple};
use toml::Value;

use crate::arguments::type_name;
use crate::errors::{kind, value};

/// Deepest nesting of a value.
const MAX_DEPTH: usize = 16;

/// `object` as a TOML value; `name` is what messages call it.
pub fn of(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Value> {
    nested(name, object, 0)
}

fn nested(name: &str, object: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if depth > MAX_DEPTH {
        return Err(value(format!(
            "{name} is nested deeper than {MAX_DEPTH} levels"
        )));
    }
    if object.is_none() {
        return Err(value(format!(
            "{name} is None, which a scenario has no word for: leave the key out"
        )));
    }
    if let Ok(flag) = object.cast::<PyBool>() {
        return Ok(Value::Boolean(flag.is_true()));
    }
    if object.is_instance_of::<PyInt>() {
        let number: i64 = object
            .extract()
            .map_err(|_| value(format!("{name} does not fit 64 bits")))?;
        return Ok(Value::Integer(number));
    }
    if object.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(object.extract()?));
    }
    if object.is_instance_of::<PyString>() {
        let text: String = object
            .extract()
            .map_err(|_| value(format!("{name} is no text that can be written as UTF-8")))?;
        return Ok(Value::String(text));
    }
    if let Ok(map) = object.cast::<PyDict>() {
        let mut table = toml::Table::new();
        for (key, item) in map.iter() {
            let key = key_text(name, &key)?;
            let inner = nested(&format!("{name}.{key}"), &item, depth + 1)?;
            table.insert(key, inner);
        }
        return Ok(Value::Table(table));
    }
    if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
        let mut list = Vec::new();
        for (index, item) in object.try_iter()?.enumerate() {
            list.push(nested(&format!("{name}[{index}]"), &item?, depth + 1)?);
        }
        return Ok(Value::Array(list));
    }
    // numpy scalars and arrays, and whatever else turns itself into plain values.
    if let Ok(list) = object.call_method0("tolist")
        && !list.is(object)
    {
        return nested(name, &list, depth + 1);
    }
    Err(kind(format!(
        "{name} is of type {}: a scenario holds bool, int, float, str, lists of these and dicts",
        type_name(object)
    )))
}

fn key_text(name: &str, key: &Bound<'_, PyAny>) -> PyResult<String> {
    key.extract::<String>().map_err(|_| {
        kind(format!(
            "{name} has a key of type {}: keys are str",
            type_name(key)
        ))
    })
}

/// The changes that `sections` amount to: `{"follow": {"max_speed_mps": 2.0}}` or `{"follow.max_speed_mps": 2.0}`.
pub fn changes(sections: &Bound<'_, PyAny>) -> PyResult<Vec<Override>> {
    let map = sections.cast::<PyMapping>().map_err(|_| {
        kind(format!(
            "changes are given as a dict, not {}",
            type_name(sections)
        ))
    })?;
    let mut found = Vec::new();
    for pair in map.items()?.iter() {
        let (key, item) = pair.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
        let key = key_text("the dict of changes", &key)?;
        section(&key, &item, &mut found, 0)?;
    }
    Ok(found)
}

fn section(
    key: &str,
    item: &Bound<'_, PyAny>,
    found: &mut Vec<Override>,
    depth: usize,
) -> PyResult<()> {
    if key.is_empty() || key.split('.').any(|part| part.trim().is_empty()) {
        return Err(value(format!("{key:?} is no key of a scenario")));
    }
    match item.cast::<PyDict>() {
        Ok(map) if depth < MAX_DEPTH => {
            for (inner, item) in map.iter() {
                let inner = key_text(key, &inner)?;
                section(&format!("{key}.{inner}"), &item, found, depth + 1)?;
            }
        }
        _ => found.push(Override::new(key, of(key, item)?)),
    }
    Ok(())
}
