//! What a scenario file may say, and how it is told what it may not.

use bikebot_sim::scenario::Origin;
use bikebot_sim::{Override, ScenarioError, ScenarioFile, json_schema};

const RIDE: &str =
    "format = 1\nname = \"ride\"\n\n[follow]\nmax_speed_mps = 1.2\n\n[bike]\nm1_kg = 40.0\n";

fn refuse(text: &str, overrides: &[&str]) -> ScenarioError {
    let overrides: Vec<Override> = overrides
        .iter()
        .map(|text| text.parse().expect("key=value"))
        .collect();
    ScenarioFile::parse(text, &overrides).expect_err("this scenario makes no sense")
}

fn marked<'t>(text: &'t str, error: &ScenarioError) -> &'t str {
    &text[error.span.clone().expect("a place in the file")]
}

#[test]
fn an_unknown_key_is_refused_with_the_nearest_known_one() {
    let text = "format = 1\nname = \"a\"\n[follow]\nmax_sped_mps = 1.0\n";
    let error = refuse(text, &[]);
    assert_eq!(error.message, "unknown key `max_sped_mps` in [follow]");
    assert_eq!(error.help.as_deref(), Some("did you mean `max_speed_mps`?"));
    assert_eq!(marked(text, &error), "max_sped_mps");
}

#[test]
fn an_unknown_section_is_refused_too() {
    let text = "format = 1\nname = \"a\"\n[folow]\n";
    let error = refuse(text, &[]);
    assert_eq!(
        error.message,
        "unknown key `folow` at the top of the scenario"
    );
    assert_eq!(error.help.as_deref(), Some("did you mean `follow`?"));
}

#[test]
fn a_wrong_type_is_marked_at_the_value() {
    let text = "format = 1\nname = \"a\"\n[follow]\nmax_speed_mps = \"fast\"\n";
    let error = refuse(text, &[]);
    assert_eq!(
        error.message,
        "`follow.max_speed_mps` is the string \"fast\""
    );
    assert_eq!(error.help.as_deref(), Some("it takes a number (m/s)"));
    assert_eq!(marked(text, &error), "\"fast\"");
}

#[test]
fn a_wrong_name_lists_the_right_ones() {
    let text = "format = 1\nname = \"a\"\n[plant]\nmodel = \"bike3\"\n";
    let error = refuse(text, &[]);
    assert_eq!(error.message, "`plant.model` is \"bike3\"");
    assert!(
        error
            .help
            .as_deref()
            .is_some_and(|help| help.starts_with("did you mean \"bike3d\"?")),
        "{:?}",
        error.help
    );
}

#[test]
fn an_override_at_fault_is_named_and_not_the_file() {
    let error = refuse(RIDE, &["follow.max_speed_mps=nan"]);
    assert_eq!(
        error.from_override.as_deref(),
        Some("--set follow.max_speed_mps")
    );
    assert_eq!(error.span, None);
    assert!(
        error.message.contains("not a finite number"),
        "{}",
        error.message
    );
}

#[test]
fn a_missing_name_is_asked_for() {
    let error = refuse("format = 1\n", &[]);
    assert_eq!(error.message, "the scenario has no `name`");
}

#[test]
fn another_format_is_refused() {
    let error = refuse("format = 2\nname = \"a\"\n", &[]);
    assert!(
        error.message.starts_with("`format` is 2"),
        "{}",
        error.message
    );
}

#[test]
fn entries_of_lists_are_found_by_number() {
    let text = "format = 1\nname = \"a\"\n[[map.disc]]\ncenter_m = [1, 2]\nradius_m = 1.0\n[[map.disc]]\ncenter_m = [1, 2]\nradius_m = -1.0\n";
    let error = refuse(text, &[]);
    assert_eq!(error.key.as_deref(), Some("map.disc.1.radius_m"));
    assert_eq!(marked(text, &error), "-1.0");
}

#[test]
fn every_value_knows_where_it_came_from() {
    let file =
        ScenarioFile::parse(RIDE, &["run.seed=7".parse().expect("key=value")]).expect("valid");
    let rows = file.explain();
    let origin = |key: &str| {
        rows.iter()
            .find(|row| row.key == key)
            .unwrap_or_else(|| panic!("{key} is not explained"))
            .origin
            .clone()
    };
    assert_eq!(origin("follow.max_speed_mps"), Origin::Line(5));
    assert_eq!(origin("bike.m1_kg"), Origin::Line(8));
    assert_eq!(origin("bike.m2_kg"), Origin::Preset("default".into()));
    assert_eq!(origin("run.seed"), Origin::Override);
    assert_eq!(origin("plant.step_s"), Origin::Default);
}

#[test]
fn a_preset_fills_what_the_file_leaves_out_and_no_more() {
    let text = "format = 1\nname = \"a\"\n[bike]\npreset = \"low_pivot\"\nm1_kg = 41.0\n";
    let bike = ScenarioFile::parse(text, &[])
        .expect("valid")
        .scenario
        .bike
        .params;
    let low = bikebot_dynamics::BikeParams::low_pivot();
    assert_eq!(bike.m1, 41.0);
    assert_eq!((bike.l, bike.i2x), (low.l, low.i2x));
}

#[test]
fn the_text_that_is_recorded_gives_the_same_scenario() {
    let overrides = [
        "follow.max_speed_mps=2.5",
        "bike.mode=\"balancer\"",
        "run.seed=9",
    ]
    .map(|text| text.parse::<Override>().expect("key=value"));
    let file = ScenarioFile::parse(RIDE, &overrides).expect("valid");
    let again = ScenarioFile::parse(&file.text_after_overrides(), &[]).expect("valid");
    assert_eq!(file.scenario, again.scenario);
}

/// Every numeric key of the format, read off the schema.
fn numeric_keys() -> Vec<String> {
    fn resolve<'s>(
        root: &'s serde_json::Value,
        mut schema: &'s serde_json::Value,
    ) -> &'s serde_json::Value {
        while let Some(reference) = schema.get("$ref").and_then(|r| r.as_str()) {
            schema = root
                .pointer(reference.trim_start_matches('#'))
                .expect("a definition");
        }
        if let Some(choices) = schema.get("anyOf").and_then(|c| c.as_array())
            && let Some(first) = choices
                .iter()
                .find(|c| c.get("type").and_then(|t| t.as_str()) != Some("null"))
        {
            return resolve(root, first);
        }
        schema
    }
    fn walk(
        root: &serde_json::Value,
        schema: &serde_json::Value,
        path: &str,
        keys: &mut Vec<String>,
    ) {
        let schema = resolve(root, schema);
        let is_number = |schema: &serde_json::Value| {
            let kinds = schema.get("type").cloned().unwrap_or_default();
            kinds == "number"
                || kinds
                    .as_array()
                    .is_some_and(|all| all.iter().any(|kind| kind == "number"))
        };
        if is_number(schema) {
            keys.push(path.to_owned());
        }
        for (name, property) in schema
            .get("properties")
            .and_then(|p| p.as_object())
            .into_iter()
            .flatten()
        {
            let path = if path.is_empty() {
                name.clone()
            } else {
                format!("{path}.{name}")
            };
            walk(root, property, &path, keys);
        }
    }
    let schema = json_schema();
    let mut keys = Vec::new();
    walk(&schema, &schema, "", &mut keys);
    keys
}

#[test]
fn what_is_not_finite_is_refused_in_every_key_by_name() {
    let keys = numeric_keys();
    assert!(
        keys.len() > 80,
        "only {} numeric keys were found",
        keys.len()
    );
    for key in keys {
        for value in ["nan", "-nan", "inf", "-inf", "1e308", "-1e308"] {
            let error = match ScenarioFile::parse(RIDE, &[Override::new(key.clone(), value)]) {
                Err(error) => error,
                Ok(_) => panic!("{key} = {value} was accepted"),
            };
            assert_eq!(
                error.key.as_deref(),
                Some(key.as_str()),
                "{key} = {value}: {error}"
            );
        }
    }
}

#[test]
fn typing_slips_of_every_key_are_put_right() {
    let mut right = 0;
    let mut all = 0;
    for key in numeric_keys() {
        let Some((section, name)) = key.split_once('.') else {
            continue;
        };
        if name.contains('.') || name.len() < 4 {
            continue;
        }
        // Leave out the letter in the middle.
        let slip: String = name
            .char_indices()
            .filter(|(i, _)| *i != name.len() / 2)
            .map(|(_, c)| c)
            .collect();
        let error = refuse(
            &format!("format = 1\nname = \"a\"\n[{section}]\n{slip} = 1.0\n"),
            &[],
        );
        all += 1;
        right += usize::from(error.help.as_deref() == Some(&format!("did you mean `{name}`?")));
    }
    assert!(right as f64 >= 0.95 * all as f64, "{right} of {all}");
}

#[test]
fn an_oversized_scenario_is_refused_before_it_is_read() {
    let text = format!("# {}\n", "x".repeat(2 << 20));
    let error = refuse(&text, &[]);
    assert!(error.message.contains("bytes"), "{}", error.message);
}

#[test]
fn a_number_that_is_hardly_more_than_nothing_is_refused() {
    let error = refuse(RIDE, &["bike.friction=5e-324"]);
    assert_eq!(
        error.message,
        "`bike.friction` is 5e-324, too small to count"
    );
    assert_eq!(
        error.help.as_deref(),
        Some("it takes a number above 0 and at most 5")
    );
}

#[test]
fn the_text_a_recording_carries_means_what_was_ridden() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut seen = 0;
    for folder in [folder.clone(), folder.join("planning")] {
        for entry in std::fs::read_dir(folder).expect("the scenarios") {
            let path = entry.expect("an entry").path();
            if path.extension().is_none_or(|ending| ending != "toml") {
                continue;
            }
            seen += 1;
            let text = std::fs::read_to_string(&path).expect("a scenario");
            let changes = [
                "run.seed=9",
                "bike.preset=low_pivot",
                "plant.bike.m1_kg=40",
                "start.roll_deg=1",
            ]
            .map(|change| change.parse::<Override>().expect("key=value"));
            for changes in [&changes[..], &[]] {
                let ridden = ScenarioFile::parse(&text, changes).expect("a scenario");
                let carried = ScenarioFile::parse(&ridden.text_after_overrides(), &[])
                    .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                assert_eq!(carried.scenario, ridden.scenario, "{}", path.display());
            }
        }
    }
    assert!(seen >= 13, "{seen}");
}

#[test]
fn presets_stand_behind_what_is_written_and_before_defaults() {
    let text = "format = 1\nname = \"a\"\n[bike]\npreset = \"low_pivot\"\nm1_kg = 40.0\n[plant.bike]\nh1_m = 0.7\n";
    let change = ["bike.l_m=0.5".parse().expect("key=value")];
    let file = ScenarioFile::parse(text, &change).expect("valid");
    let bike = &file.scenario.bike.params;
    let low = bikebot_dynamics::BikeParams::low_pivot();
    assert_eq!(
        (bike.m1, bike.l, bike.h1, bike.i2x),
        (40.0, 0.5, low.h1, low.i2x)
    );
    let origin = |key: &str| {
        let rows = file.explain();
        let row = rows.into_iter().find(|row| row.key == key);
        row.unwrap_or_else(|| panic!("{key} is not explained"))
            .origin
    };
    assert_eq!(origin("bike.m1_kg"), Origin::Line(5));
    assert_eq!(origin("bike.l_m"), Origin::Override);
    assert_eq!(origin("bike.h1_m"), Origin::Preset("low_pivot".into()));
    assert_eq!(origin("bike.mode"), Origin::Default);
    assert_eq!(origin("plant.bike.h1_m"), Origin::Line(7));
    // A preset chosen on the command line is no line of the file, and its values are the preset's.
    let change = ["bike.preset=default".parse().expect("key=value")];
    let file = ScenarioFile::parse(text, &change).expect("valid");
    assert_eq!(file.scenario.bike.params.h1, 0.52);
    assert_eq!(file.scenario.bike.params.m1, 40.0);
}
