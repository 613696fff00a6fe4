//! `bikebot schema`.

use std::path::Path;

use crate::common::{good, json};

#[test]
fn the_schema_is_json_and_knows_the_sections() {
    let schema = json(&good(Path::new("."), "schema"));
    for section in [
        "map", "start", "goal", "bike", "planner", "follow", "balance", "plant", "run", "expect",
    ] {
        assert!(schema["properties"].get(section).is_some(), "{section}");
    }
}
