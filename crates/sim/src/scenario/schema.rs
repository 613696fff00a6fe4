//! The JSON Schema of the scenario file, generated from the types.

use super::Scenario;

/// JSON Schema (draft 2020-12) of a scenario, for editors and for `bikebot schema`.
///
/// The same schema is what [`super::ScenarioFile::parse`] holds a file against: keys,
/// types, names and ranges have this one definition.
#[must_use]
pub fn json_schema() -> serde_json::Value {
    schemars::schema_for!(Scenario).to_value()
}
