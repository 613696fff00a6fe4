//! `bikebot table2` in every format.

use std::collections::BTreeSet;
use std::fs;

use crate::common::{folder, good, json, keys};

#[test]
fn table_2_is_measured_from_anywhere_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    // Larger cells, so that the linear programme is a small one.
    let table = "table2 --runs 2 --set planner.grid.cell_scales=2";
    let text = good(path, table);
    assert!(text.starts_with("Table 2 on planning-fig6, 2 runs from seed 1\n"));
    assert!(
        text.contains("reconstruction") && text.contains("1/m^5"),
        "{text}"
    );
    let table_json = json(&good(path, &format!("{table} --json --jobs 2")));
    let rows = table_json["rows"].as_array().unwrap();
    let names: Vec<&str> = rows
        .iter()
        .map(|row| row["method"].as_str().unwrap())
        .collect();
    for name in [
        "laplace",
        "linear_program",
        "rrt",
        "rrt_star",
        "birrt",
        "birrt_smooth",
        "mpc_laplace",
        "mpc_linear_program",
        "paper",
    ] {
        assert!(names.contains(&name), "{name}");
    }
    for row in rows {
        for key in ["curvature_limited", "runs", "found"] {
            assert!(row.get(key).is_some(), "{key} is missing in {row}");
        }
        for key in ["time_s", "length_m", "roughness", "roughness_fixed_step"] {
            assert_eq!(
                keys(&row[key]),
                BTreeSet::from(["mean", "median", "p05", "p95"]),
                "{row}"
            );
        }
        if let Some(paper) = row.get("paper") {
            assert!(keys(paper).is_superset(&BTreeSet::from(["length_m", "roughness"])));
        }
        assert_eq!(
            (&row["runs"], &row["found"]),
            (&2.into(), &2.into()),
            "{row}"
        );
        assert_eq!(
            row.get("max_curvature_per_m").is_some(),
            row["curvature_limited"].as_bool().unwrap()
        );
    }
    good(path, &format!("{table} --format csv -o table.csv"));
    let csv = fs::read_to_string(path.join("table.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + rows.len());
    let markdown = good(path, &format!("{table} --format markdown"));
    assert!(markdown.starts_with("| method | length, m |"), "{markdown}");
    assert!(markdown.contains("| `paper_taut` |"));
}

#[test]
fn table_2_of_another_field_says_nothing_of_a_reconstruction() {
    let folder = folder();
    fs::write(
        folder.path().join("yard.toml"),
        "format = 1\nname = \"small\"\nmap.file = \"yard.json\"\nplanner = { footprint = \"point\", scale_m = 0.4 }\n",
    )
    .unwrap();
    let text = good(folder.path(), "table2 yard.toml --runs 2");
    assert!(text.starts_with("Table 2 on small") && !text.contains("reconstruction"));
}
