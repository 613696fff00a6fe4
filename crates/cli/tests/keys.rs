//! Every key of the scenario file: what it refuses, and what is suggested for a slip.

use bikebot_sim::{Override, ScenarioError, ScenarioFile};

const SCENARIO: &str = include_str!("../templates/scenario.toml");

/// Every key that a scenario has by itself, with its value.
fn keys() -> Vec<(String, String)> {
    let file = ScenarioFile::parse(SCENARIO, &[]).expect("the template is sound");
    file.explain()
        .into_iter()
        .map(|row| (row.key, row.value))
        .collect()
}

fn refused(key: &str, value: &str) -> ScenarioError {
    match ScenarioFile::parse(SCENARIO, &[Override::new(key, value)]) {
        Ok(_) => panic!("{key} = {value} was accepted"),
        Err(error) => error,
    }
}

#[test]
fn every_number_refuses_what_is_none_and_tells_its_range() {
    let mut count = 0;
    for (key, value) in keys() {
        if value.parse::<f64>().is_err() {
            continue;
        }
        count += 1;
        for bad in ["nan", "inf", "-inf", "1e308", "-1e308"] {
            let error = refused(&key, bad);
            assert!(
                error.message.contains(&format!("`{key}`")),
                "{}",
                error.message
            );
            let help = error.help.unwrap_or_default();
            assert!(help.starts_with("it takes "), "{key} = {bad}: {help}");
        }
    }
    assert!(count > 60, "only {count} numbers were tried");
}

#[test]
fn every_key_refuses_a_value_of_another_type() {
    for (key, value) in keys() {
        let other = if value.starts_with('"') {
            "[[1]]"
        } else {
            "\"x\""
        };
        let error = refused(&key, other);
        assert!(
            error.message.contains(&format!("`{key}")),
            "{key}: {}",
            error.message
        );
        assert!(error.help.is_some(), "{key}");
    }
}

/// The last part of a key, misspelt in every simple way.
fn slips(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut slips = Vec::new();
    for at in 0..letters.len() {
        let mut dropped = letters.clone();
        dropped.remove(at);
        let mut doubled = letters.clone();
        doubled.insert(at, letters[at]);
        let mut swapped = letters.clone();
        swapped.swap(at, (at + 1).min(letters.len() - 1));
        for slip in [dropped, doubled, swapped] {
            slips.push(slip.into_iter().collect());
        }
    }
    slips.retain(|slip: &String| slip != name && !slip.is_empty());
    slips
}

#[test]
fn a_slip_of_the_pen_is_understood() {
    let keys = keys();
    let is_known = |key: &str| keys.iter().any(|(known, _)| known == key);
    let (mut tried, mut understood, mut missed) = (0, 0, Vec::new());
    for (key, value) in &keys {
        let Some((section, name)) = key.rsplit_once('.') else {
            continue;
        };
        for slip in slips(name) {
            let wrong = format!("{section}.{slip}");
            if is_known(&wrong) {
                continue;
            }
            tried += 1;
            let help = refused(&wrong, value).help.unwrap_or_default();
            if help == format!("did you mean `{name}`?") {
                understood += 1;
            } else {
                missed.push(format!("{wrong}: {help}"));
            }
        }
    }
    assert!(tried > 200);
    assert!(
        f64::from(understood) >= 0.95 * f64::from(tried),
        "{understood} of {tried}: {missed:#?}"
    );
}

#[test]
fn a_key_without_its_unit_is_understood() {
    for (wrong, right) in [
        ("follow.max_speed", "max_speed_mps"),
        ("bike.m1", "m1_kg"),
        ("start.heading", "heading_deg"),
        ("run.duration", "duration_s"),
        ("planner.max_curvature", "max_curvature_per_m"),
    ] {
        let help = refused(wrong, "1").help.unwrap_or_default();
        assert_eq!(help, format!("did you mean `{right}`?"));
    }
}
