//! The parameter structs as sections of a scenario file: what their schemas promise.

use bikebot_dynamics::{BikeParams, LaserParams, SensorParams};
use serde_json::Value;

fn sections() -> [(&'static str, Value, Value); 3] {
    [
        (
            "bike",
            schemars::schema_for!(BikeParams).to_value(),
            serde_json::to_value(BikeParams::default()).unwrap(),
        ),
        (
            "noise",
            schemars::schema_for!(SensorParams).to_value(),
            serde_json::to_value(SensorParams::default()).unwrap(),
        ),
        (
            "laser",
            schemars::schema_for!(LaserParams).to_value(),
            serde_json::to_value(LaserParams::default()).unwrap(),
        ),
    ]
}

/// Quantities without a dimension, whose keys carry no unit.
const BARE: [&str; 3] = ["friction", "beams", "dropout_probability"];

const UNITS: [&str; 12] = [
    "_kg", "_m", "_kgm2", "_nm", "_radps", "_deg", "_s", "_n", "_mps", "_hz", "_m_per_m", "_rad",
];

#[test]
fn every_number_has_a_unit_a_meaning_and_a_range_that_holds_its_default() {
    for (section, schema, defaults) in sections() {
        let properties = schema["properties"].as_object().unwrap();
        assert_eq!(properties.len(), defaults.as_object().unwrap().len());
        for (key, property) in properties {
            let name = format!("[{section}] {key}");
            assert!(
                property["description"].is_string(),
                "{name} is not described"
            );
            let Some(default) = defaults[key].as_f64() else {
                continue;
            };
            let has_unit = UNITS.iter().any(|unit| key.ends_with(unit));
            assert!(
                has_unit || BARE.contains(&key.as_str()),
                "{name} has no unit"
            );
            let limit = |limit: &str| property.get(limit).and_then(Value::as_f64);
            let least = limit("minimum").unwrap_or(f64::NEG_INFINITY);
            let above = limit("exclusiveMinimum").unwrap_or(f64::NEG_INFINITY);
            let most = limit("maximum").expect("an upper limit");
            assert!(least.max(above).is_finite(), "{name} has no lower limit");
            assert!(
                least <= default && above < default && default <= most,
                "{name}"
            );
        }
    }
}

#[test]
fn unknown_keys_are_refused_in_every_section() {
    let stray = r#"{ "stray": 1 }"#;
    assert!(serde_json::from_str::<BikeParams>(stray).is_err());
    assert!(serde_json::from_str::<SensorParams>(stray).is_err());
    assert!(serde_json::from_str::<LaserParams>(stray).is_err());
}

#[test]
fn every_section_survives_being_written_and_read() {
    let params = BikeParams::low_pivot();
    let text = serde_json::to_string(&params).unwrap();
    assert_eq!(serde_json::from_str::<BikeParams>(&text).unwrap(), params);
    let text = serde_json::to_string(&LaserParams::default()).unwrap();
    assert_eq!(
        serde_json::from_str::<LaserParams>(&text).unwrap(),
        LaserParams::default()
    );
    let text = serde_json::to_string(&SensorParams::default()).unwrap();
    assert_eq!(
        serde_json::from_str::<SensorParams>(&text).unwrap(),
        SensorParams::default()
    );
}
