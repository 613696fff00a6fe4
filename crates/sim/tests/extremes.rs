//! The least, the greatest and the tiniest value of every numeric key: refused with the key named, or ridden
//! to an outcome with numbers in every metric.

mod common;

use bikebot_sim::{Override, ScenarioFile, Setup, json_schema};
use serde_json::Value;

const RIDES: [&str; 3] = [
    "format = 1\nname = \"course\"\n[start]\nspeed_mps = 0.3\n[path]\nwaypoints = [[1.0, 1.0, 0.0], [4.8, 2.2, 55.0]]\n[map]\nbounds_m = [-5, -5, 15, 15]\n[laser]\nbeams = 10\n[run]\nduration_s = 0.5\n",
    "format = 1\nname = \"kinematic\"\n[start]\nspeed_mps = 0.3\n[path]\nwaypoints = [[1.0, 1.0, 0.0], [4.8, 2.2, 55.0]]\n[plant]\nmodel = \"kinematic\"\n[run]\nduration_s = 0.5\n",
    "format = 1\nname = \"stand\"\n[plant]\nmodel = \"two_link\"\n[run]\nduration_s = 0.5\n",
];

/// Every numeric key below `schema` with its least and greatest allowed value.
fn numbers(root: &Value, schema: &Value, prefix: &str, found: &mut Vec<(String, [f64; 2])>) {
    let mut schema = schema;
    while let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        schema = root
            .pointer(reference.trim_start_matches('#'))
            .expect("a definition");
    }
    let choices = schema.get("anyOf").and_then(Value::as_array);
    for choice in choices.into_iter().flatten() {
        numbers(root, choice, prefix, found);
    }
    for (key, value) in schema
        .get("properties")
        .and_then(Value::as_object)
        .into_iter()
        .flatten()
    {
        let key = if prefix.is_empty() {
            key.clone()
        } else {
            format!("{prefix}.{key}")
        };
        numbers(root, value, &key, found);
    }
    let types = match schema.get("type") {
        Some(Value::String(name)) => vec![name.as_str()],
        Some(Value::Array(names)) => names.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    if types.contains(&"number") || types.contains(&"integer") {
        let bound = |name: &str| schema.get(name).and_then(Value::as_f64);
        let least = bound("minimum").or(bound("exclusiveMinimum"));
        let most = bound("maximum").or(bound("exclusiveMaximum"));
        let (Some(least), Some(most)) = (least, most) else {
            panic!("`{prefix}` has no range");
        };
        found.push((prefix.to_owned(), [least, most]));
    }
}

#[test]
fn every_extreme_of_every_key_is_refused_by_name_or_ridden() {
    let schema = json_schema();
    let mut keys = Vec::new();
    numbers(&schema, &schema, "", &mut keys);
    assert!(keys.len() > 100, "{}", keys.len());
    for (key, [least, most]) in &keys {
        if key == "run.duration_s" || key.starts_with("expect.") {
            continue;
        }
        let mut values = vec![format!("{least:?}"), format!("{most:?}")];
        if *least <= 0.0 {
            values.push("5e-324".into());
        }
        for value in values {
            // A whole number is written without a fraction.
            let whole = value.trim_end_matches(".0").to_owned();
            for text in RIDES {
                for value in [&value, &whole] {
                    try_to_ride(text, key, value);
                }
            }
        }
    }
}

fn try_to_ride(text: &str, key: &str, value: &str) {
    let change = Override::new(key, value);
    let file = match ScenarioFile::parse(text, &[change]) {
        Ok(file) => file,
        Err(error) => {
            assert!(error.from_override.is_some(), "{key} = {value}: {error}");
            return;
        }
    };
    let setup = match Setup::resolve(&file, &mut |name| Err(format!("no file {name}"))) {
        Ok(setup) => setup,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    // An error is a refusal, too: a bike whose balancer has no authority.
    if let Ok(report) = common::try_ride(&setup, &mut ()) {
        for (name, found) in report.metrics.iter() {
            assert!(found.is_finite(), "{key} = {value}: {name} is {found}");
        }
    }
}
