//! `bikebot map info` and `bikebot map build`.

use std::fs;

use crate::common::{call, err, folder, good, json, names};

#[test]
fn map_info_tells_size_and_cells() {
    let folder = folder();
    fs::write(
        folder.path().join("yard.yaml"),
        "image: yard.pgm\nresolution: 0.5\norigin: [-1.0, 2.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\nnegate: 0\n",
    )
    .unwrap();
    fs::write(
        folder.path().join("yard.pgm"),
        "P2\n4 3\n255\n254 254 254 0\n254 254 254 0\n205 254 254 0\n",
    )
    .unwrap();
    let info = json(&good(folder.path(), "map info yard.yaml --json"));
    assert_eq!(info["grid"]["width"], 4);
    assert_eq!(info["grid"]["height"], 3);
    assert_eq!(info["grid"]["resolution_m"], 0.5);
    assert_eq!(info["grid"]["occupied"], 3);
    assert_eq!(info["grid"]["unknown"], 1);
    assert_eq!(info["grid"]["free"], 8);
    assert_eq!(info["bounds_m"], json("[-1.0, 2.0, 1.0, 3.5]"));
    let text = good(folder.path(), "map info yard.yaml");
    assert!(text.contains("4 × 3 cells of 0.500 m"), "{text}");
    let scene = json(&good(folder.path(), "map info yard.json --json"));
    assert_eq!(scene["start"], json("[1.0, 1.0, 0.0]"));
    assert_eq!(scene["obstacles"], 1);
}

/// A CARMEN log of a robot that looks at a wall 3 m ahead, and says so `scans` times.
fn log_of_a_wall(scans: u32) -> String {
    let mut text = String::from("# made up\nPARAM robot_width 0.5 host 0\n");
    for scan in 0..scans {
        let ranges: Vec<String> = (-90..=90_i32)
            .map(|degrees| {
                format!(
                    "{:.3}",
                    3.05 / f64::from(degrees).to_radians().cos().max(0.1)
                )
            })
            .collect();
        text += &format!(
            "FLASER 181 {} 0 0 0 0 0 0 {scan}.5 host 0\n",
            ranges.join(" ")
        );
    }
    text
}

#[test]
fn a_map_built_from_a_log_is_the_one_that_map_info_reads() {
    let folder = folder();
    fs::write(folder.path().join("wall.log"), log_of_a_wall(5)).unwrap();
    let built = json(&good(
        folder.path(),
        "map build wall.log -o wall.yaml --json",
    ));
    assert_eq!(
        (&built["scans"], &built["format"]),
        (&json("5"), &json("\"carmen\""))
    );
    assert_eq!(built["poses"], "odometry");
    assert_eq!(built["skipped"], json(r##"{"#": 1, "PARAM": 1}"##));
    assert!(names(folder.path()).is_superset(&["wall.yaml", "wall.pgm"].map(str::to_owned).into()));
    let info = json(&good(folder.path(), "map info wall.yaml --json"));
    for key in ["width", "height", "free", "occupied", "unknown"] {
        assert_eq!(info["grid"][key], built[key], "{key}");
    }
    assert!(built["free"].as_u64() > Some(200) && built["occupied"].as_u64() > Some(20));
    // What is there is kept, image or description, unless told otherwise.
    for gone in ["wall.yaml", "wall.pgm"] {
        fs::remove_file(folder.path().join(gone)).unwrap();
        let refused = call(folder.path(), "map build wall.log -o wall.yaml");
        assert_eq!(refused.status.code(), Some(2));
        assert!(
            err(&refused).contains("already exists"),
            "{}",
            err(&refused)
        );
        let text = good(
            folder.path(),
            "map build wall.log -o wall.yaml --force --resolution 0.05",
        );
        assert!(text.contains("cells of 0.0500 m"), "{text}");
    }
    assert!(
        !names(folder.path())
            .iter()
            .any(|name| name.ends_with(".part"))
    );
}

#[test]
fn thresholds_that_make_unknown_cells_free_are_warned_of() {
    let folder = folder();
    fs::write(
        folder.path().join("depot.yaml"),
        "image: depot.pgm\nresolution: 0.5\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\nnegate: 0\n",
    )
    .unwrap();
    fs::write(
        folder.path().join("depot.pgm"),
        "P2\n3 2\n255\n254 254 0\n205 205 254\n",
    )
    .unwrap();
    let output = call(folder.path(), "map info depot.yaml");
    assert_eq!(output.status.code(), Some(0));
    assert!(err(&output).starts_with("warning: "), "{}", err(&output));
    assert!(err(&call(folder.path(), "map info depot.yaml -q")).is_empty());
}
