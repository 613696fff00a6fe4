//! The rooms of the house: who may use whom (`docs/architecture.md`, *Rooms*).
//!
//! Read off the crates' own manifests, so that the drawing cannot drift from the code.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Crate, and the crates of ours and the third-party room-mates it may name.
const ALLOWED: [(&str, &[&str]); 11] = [
    ("geometry", &["nalgebra", "thiserror"]),
    ("qp", &["nalgebra", "thiserror"]),
    (
        "world",
        &[
            "bikebot-geometry",
            "nalgebra",
            "parry2d-f64",
            "png",
            "serde",
            "serde_json",
            "thiserror",
        ],
    ),
    (
        "planner",
        &[
            "bikebot-qp",
            "bikebot-geometry",
            "bikebot-world",
            "clarabel",
            "nalgebra",
            "rand",
            "rand_chacha",
            "serde",
            "schemars",
            "thiserror",
        ],
    ),
    (
        "dynamics",
        &[
            "bikebot-geometry",
            "bikebot-world",
            "nalgebra",
            "rapier3d-f64",
            "rand",
            "rand_chacha",
            "serde",
            "schemars",
            "thiserror",
        ],
    ),
    (
        "mapping",
        &[
            "bikebot-geometry",
            "bikebot-world",
            "bikebot-dynamics",
            "nalgebra",
            "serde",
            "schemars",
            "thiserror",
        ],
    ),
    (
        "control",
        &[
            "bikebot-geometry",
            "bikebot-qp",
            "bikebot-dynamics",
            "nalgebra",
            "serde",
            "schemars",
            "thiserror",
        ],
    ),
    (
        "sim",
        &[
            "bikebot-geometry",
            "bikebot-world",
            "bikebot-planner",
            "bikebot-dynamics",
            "bikebot-control",
            "bikebot-mapping",
            "nalgebra",
            "crc32fast",
            "rand",
            "rand_chacha",
            "rayon",
            "serde",
            "serde_json",
            "schemars",
            "strsim",
            "toml",
            "foxglove",
            "mcap",
            "sha2",
            "thiserror",
        ],
    ),
    (
        "report",
        &[
            "bikebot-geometry",
            "bikebot-world",
            "bikebot-planner",
            "bikebot-dynamics",
            "bikebot-sim",
            "resvg",
            "serde",
            "serde_json",
            "serde_path_to_error",
            "thiserror",
        ],
    ),
    (
        "cli",
        &[
            "bikebot-report",
            "bikebot-geometry",
            "bikebot-world",
            "bikebot-planner",
            "bikebot-dynamics",
            "bikebot-mapping",
            "bikebot-sim",
            "annotate-snippets",
            "clap",
            "clap_complete",
            "clap_mangen",
            "ctrlc",
            "indicatif",
            "serde",
            "serde_json",
            "tempfile",
            "thiserror",
            "toml",
            "tracing",
            "tracing-subscriber",
        ],
    ),
    (
        "py",
        &[
            "bikebot-report",
            "bikebot-geometry",
            "bikebot-world",
            "bikebot-planner",
            "bikebot-dynamics",
            "bikebot-sim",
            "numpy",
            "pyo3",
            "serde",
            "serde_json",
            "toml",
        ],
    ),
];

/// Names in the `[dependencies]` section of a crate's manifest.
fn dependencies(name: &str) -> BTreeSet<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("crates")
        .join(name)
        .join("Cargo.toml");
    let text = std::fs::read_to_string(&path).expect("each room has a manifest");
    let section = text.split("\n[dependencies]").nth(1).unwrap_or_default();
    let section = section.split("\n[").next().unwrap_or_default();
    section
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .filter_map(|line| line.split(['.', '=', ' ']).next().map(str::to_owned))
        .collect()
}

#[test]
fn each_room_uses_only_what_the_drawing_allows() {
    for (name, allowed) in ALLOWED {
        let found = dependencies(name);
        assert!(
            !found.is_empty(),
            "crate {name} has no dependencies: was its manifest read?"
        );
        for dependency in found {
            assert!(
                allowed.contains(&dependency.as_str()),
                "crate {name} may not use {dependency}"
            );
        }
    }
}

#[test]
fn the_python_module_is_built_only_when_asked_for() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("Cargo.toml")).expect("the root manifest");
    let section = text.split("default-members").nth(1).unwrap_or_default();
    let section = section.split(']').next().unwrap_or_default();
    assert!(section.contains("crates/cli") && !section.contains("crates/py"));
    for (name, _) in ALLOWED {
        assert!(!dependencies(name).contains("bikebot-py"), "{name}");
    }
}

#[test]
fn every_crate_is_in_the_drawing() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    for entry in std::fs::read_dir(crates).expect("the crates' folder") {
        let name = entry.expect("an entry").file_name();
        let name = name.to_string_lossy();
        assert!(
            ALLOWED.iter().any(|(known, _)| *known == name),
            "crate {name} is missing from the drawing"
        );
    }
}

/// Source files under `crates/` that contain `name`.
fn naming(name: &str) -> Vec<PathBuf> {
    fn walk(folder: &Path, name: &str, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a source folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                walk(&path, name, found);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let text = std::fs::read_to_string(&path).expect("source text");
                if text.contains(name) {
                    found.push(path);
                }
            }
        }
    }
    let mut found = Vec::new();
    walk(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("crates"),
        name,
        &mut found,
    );
    found
}

#[test]
fn parry_is_named_in_one_file_only() {
    let mut found = naming("parry2d_f64");
    // The file and its own tests.
    let query = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/world/src/query");
    found.retain(|path| !path.starts_with(&query) && *path != query.with_extension("rs"));
    assert_eq!(found, Vec::<PathBuf>::new());
}

#[test]
fn rapier_is_named_in_one_folder_only() {
    let mut found = naming("rapier3d_f64");
    let rigid = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/dynamics/src/rigid");
    found.retain(|path| !path.starts_with(&rigid));
    assert_eq!(found, Vec::<PathBuf>::new());
}
