//! Every verb as its users call it: what it prints, what it writes, how it ends.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// A ride of two seconds without a map: the shortest there is.
const SHORT: &str = "\
format = 1
name = \"short\"
start.roll_deg = 1
plant = { model = \"two_link\", step_s = 0.001, control_s = 0.002 }
run.duration_s = 2
";

/// A field with one block.
const SCENE: &str = r#"{"name": "yard", "unit": "m", "width": 10, "height": 10,
"start": [1, 1, 0], "goal": [8, 8, 90], "obstacles": [{"polygon": [[4, 0], [5, 0], [5, 4], [4, 4]]}]}"#;

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("short.toml"), SHORT).unwrap();
    fs::write(folder.path().join("yard.json"), SCENE).unwrap();
    folder
}

fn bikebot(folder: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("bikebot"));
    for name in ["BIKEBOT_SEED", "BIKEBOT_LOG", "NO_COLOR"] {
        command.env_remove(name);
    }
    command.current_dir(folder);
    command
}

fn call(folder: &Path, line: &str) -> Output {
    bikebot(folder)
        .args(line.split_whitespace())
        .output()
        .unwrap()
}

fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Calls, and demands success.
fn good(folder: &Path, line: &str) -> String {
    let output = call(folder, line);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{line}\n{}{}",
        out(&output),
        err(&output)
    );
    out(&output)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn keys(value: &Value) -> BTreeSet<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

fn names(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn the_scenario_of_init_runs_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    assert_eq!(good(path, "init"), "wrote scenario.toml\n");
    assert_eq!(good(path, "check scenario.toml"), "scenario.toml: ok\n");
    let summary = good(path, "run scenario.toml");
    assert!(summary.starts_with("yard: arrived"), "{summary}");
    for line in summary.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert_eq!(
        names(path),
        BTreeSet::from(["scenario.toml".into(), "yard-1.mcap".into()])
    );
}

#[test]
fn init_makes_the_folder_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    good(folder.path(), "init a/b");
    assert!(folder.path().join("a/b/scenario.toml").is_file());
    assert_eq!(call(folder.path(), "init a/b").status.code(), Some(2));
    good(folder.path(), "init a/b --force");
}

#[test]
fn a_run_as_json_has_the_promised_keys() {
    let folder = folder();
    let run = json(&good(folder.path(), "run short.toml --seed 5 --json"));
    for key in [
        "outcome",
        "reason",
        "scenario",
        "seed",
        "plant",
        "mode",
        "log",
        "result_hash",
        "run_id",
        "metrics",
        "expect",
    ] {
        assert!(run.get(key).is_some(), "{key} is missing in {run}");
    }
    assert_eq!(run["outcome"], "arrived");
    assert_eq!(run["seed"], 5);
    assert_eq!(run["plant"], "two_link");
    assert_eq!(run["log"], "short-5.mcap");
    // Nothing was followed, so nothing is said of following: absent, not zero.
    assert!(run["metrics"].get("lateral_error_max_m").is_none());
    assert!(run["metrics"]["roll_max_deg"].as_f64().unwrap() >= 1.0);
}

#[test]
fn recordings_without_a_name_are_numbered_and_never_replaced() {
    let folder = folder();
    for _ in 0..3 {
        good(folder.path(), "run short.toml");
    }
    let names = names(folder.path());
    for name in ["short-1.mcap", "short-1.2.mcap", "short-1.3.mcap"] {
        assert!(names.contains(name), "{names:?}");
    }
    assert!(names.iter().all(|name| !name.ends_with(".part")));
}

#[test]
fn an_existing_recording_is_replaced_only_by_force() {
    let folder = folder();
    let path = folder.path().join("a.mcap");
    fs::write(&path, "old").unwrap();
    assert_eq!(
        call(folder.path(), "run short.toml -o a.mcap")
            .status
            .code(),
        Some(2)
    );
    assert_eq!(fs::read(&path).unwrap(), b"old");
    good(folder.path(), "run short.toml -o a.mcap --force");
    assert_ne!(fs::read(&path).unwrap(), b"old");
}

#[test]
fn a_recording_runs_again_to_the_same_bits() {
    let folder = folder();
    let first = json(&good(
        folder.path(),
        "run short.toml --seed 3 --set start.roll_deg=1.5 -o a.mcap --json",
    ));
    fs::remove_file(folder.path().join("short.toml")).unwrap();
    let again = json(&good(folder.path(), "run --from a.mcap -o b.mcap --json"));
    assert_eq!(first["result_hash"], again["result_hash"]);
    assert_eq!(first["run_id"], again["run_id"]);
    let other = json(&good(
        folder.path(),
        "run --from a.mcap --set start.roll_deg=2 -o c.mcap --json",
    ));
    assert_ne!(first["result_hash"], other["result_hash"]);
}

#[test]
fn a_recording_carries_the_map_it_was_run_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::create_dir(path.join("maps")).unwrap();
    fs::write(path.join("maps/yard.json"), SCENE).unwrap();
    let scenario = "format = 1\nname = \"mapped\"\nmap.file = \"maps/yard.json\"\nrun.duration_s = 1\n\
                    start.speed_mps = 0.3\nexpect.outcome = \"timed_out\"\n";
    fs::write(path.join("ride.toml"), scenario).unwrap();
    let first = json(&good(path, "run ride.toml -o a.mcap --json"));
    fs::remove_dir_all(path.join("maps")).unwrap();
    fs::remove_file(path.join("ride.toml")).unwrap();
    let again = json(&good(path, "run --from a.mcap -o b.mcap --json"));
    assert_eq!(first["result_hash"], again["result_hash"]);
}

#[test]
fn an_expectation_that_fails_is_told_and_ends_with_one() {
    let folder = folder();
    let output = call(
        folder.path(),
        "run short.toml --set expect.roll_max_deg=0.5",
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("FAILED"), "{}", out(&output));
    let output = call(folder.path(), "run short.toml --set expect.outcome=fell");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_fall_that_was_expected_is_a_success() {
    let folder = folder();
    let line = "run short.toml --set start.roll_deg=35 --set run.duration_s=5";
    assert_eq!(call(folder.path(), line).status.code(), Some(1));
    good(folder.path(), &format!("{line} --set expect.outcome=fell"));
}

#[test]
fn a_plan_as_json_has_the_promised_keys() {
    let folder = folder();
    let text = good(
        folder.path(),
        "plan yard.json --json --seed 7 --max-curvature 1",
    );
    let plan = json(&text);
    let promised = BTreeSet::from([
        "outcome",
        "reason",
        "method",
        "seed",
        "time_s",
        "first_s",
        "prepare_s",
        "iterations",
        "length_m",
        "lower_bound_m",
        "roughness",
        "roughness_fixed_step",
        "max_curvature_per_m",
        "curvature_jump_per_m",
        "min_clearance_m",
        "path",
        "trace",
        "result_hash",
        "version",
    ]);
    assert_eq!(keys(&plan), promised);
    assert_eq!(plan["outcome"], "found");
    assert_eq!(plan["seed"], 7);
    let path = plan["path"].as_array().unwrap();
    let point = |index: usize| -> Vec<f64> {
        path[index]
            .as_array()
            .unwrap()
            .iter()
            .map(|number| number.as_f64().unwrap())
            .collect()
    };
    assert_eq!(point(0)[..3], [1.0, 1.0, 0.0]);
    let last = point(path.len() - 1);
    assert_eq!(last[..2], [8.0, 8.0]);
    assert!((last[2] - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    assert!((last[4] - plan["length_m"].as_f64().unwrap()).abs() < 1e-6);
    assert!(plan["max_curvature_per_m"].as_f64().unwrap() <= 1.0);
    assert!(plan["lower_bound_m"].as_f64() <= plan["length_m"].as_f64());
    // Curvature is to be seen: no two samples further apart than a twentieth of the radius, where it turns.
    for pair in (1..path.len()).map(|index| (point(index - 1), point(index))) {
        let bent = pair.0[3].abs().max(pair.1[3].abs()) > 1e-3;
        assert!(!bent || pair.1[4] - pair.0[4] <= 0.05 + 1e-9, "{pair:?}");
    }
}

#[test]
fn many_plans_come_one_line_each_and_do_not_depend_on_threads() {
    let folder = folder();
    let hashes = |line: &str| -> Vec<(u64, String)> {
        good(folder.path(), line)
            .lines()
            .map(|line| {
                let plan = json(line);
                (
                    plan["seed"].as_u64().unwrap(),
                    plan["result_hash"].to_string(),
                )
            })
            .collect()
    };
    let alone = hashes("plan yard.json --max-curvature 1 --runs 4 --seed 10 --json");
    assert_eq!(
        alone.iter().map(|(seed, _)| *seed).collect::<Vec<_>>(),
        [10, 11, 12, 13]
    );
    assert_eq!(
        alone,
        hashes("plan yard.json --max-curvature 1 --runs 4 --seed 10 --threads 3 --json")
    );
    let last = hashes("plan yard.json --max-curvature 1 --seed 13 --json");
    assert_eq!(alone[3], last[0]);
}

#[test]
fn a_bare_map_and_a_scenario_that_says_the_same_give_the_same_plan() {
    let folder = folder();
    fs::write(
        folder.path().join("same.toml"),
        "format = 1\nname = \"same\"\nmap.file = \"yard.json\"\nplanner.footprint = \"point\"\nplanner.max_curvature_per_m = 1.0\n\
         [start]\nx_m = 1\ny_m = 1\nheading_deg = 0\n[goal]\nx_m = 8\ny_m = 8\n",
    )
    .unwrap();
    let bare = json(&good(
        folder.path(),
        "plan yard.json --start 1,1,0 --goal 8,8 --max-curvature 1 --json",
    ));
    let told = json(&good(folder.path(), "plan same.toml --json"));
    assert_eq!(bare["result_hash"], told["result_hash"]);
}

#[test]
fn a_search_that_ends_empty_is_an_outcome_with_code_one() {
    let folder = folder();
    let walled = SCENE.replace("[5, 4], [4, 4]", "[5, 10], [4, 10]");
    fs::write(folder.path().join("wall.json"), walled).unwrap();
    let output = call(folder.path(), "plan wall.json --json");
    assert_eq!(output.status.code(), Some(1));
    let plan = json(&out(&output));
    assert_eq!(
        (&plan["outcome"], &plan["reason"]),
        (&"no_path".into(), &"disconnected".into())
    );
    assert!(plan.get("length_m").is_none() && plan.get("path").is_none());
}

#[test]
fn a_search_cut_short_says_by_what() {
    let folder = folder();
    let output = call(
        folder.path(),
        "plan yard.json --max-curvature 1 --iterations 1 --json",
    );
    assert_eq!(output.status.code(), Some(1));
    let plan = json(&out(&output));
    assert_eq!(
        (&plan["outcome"], &plan["reason"]),
        (&"exhausted".into(), &"iterations".into())
    );
    let output = call(
        folder.path(),
        "plan yard.json --max-curvature 1 --time-limit 1us --json",
    );
    let plan = json(&out(&output));
    assert_eq!(
        (&plan["outcome"], &plan["reason"]),
        (&"timed_out".into(), &"deadline".into())
    );
}

#[test]
fn a_plan_written_is_a_path_that_can_be_ridden() {
    let folder = folder();
    good(
        folder.path(),
        "plan yard.json --max-curvature 0.8 -o plan.json",
    );
    let plan = json(&fs::read_to_string(folder.path().join("plan.json")).unwrap());
    for key in ["segments", "problem", "stages", "path", "result_hash"] {
        assert!(plan.get(key).is_some(), "{key}");
    }
    fs::write(
        folder.path().join("ride.toml"),
        "format = 1\nname = \"ride\"\n[start]\nspeed_mps = 0.3\n[path]\nfile = \"plan.json\"\n[run]\nduration_s = 2\n[expect]\noutcome = \"timed_out\"\n",
    )
    .unwrap();
    good(folder.path(), "run ride.toml");
}

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

#[test]
fn a_sweep_has_the_same_bytes_for_any_number_of_jobs() {
    let folder = folder();
    let sweep = "sweep short.toml --vary start.roll_deg=0.5:2:4 --vary bike.mode=[\"flywheel\",\"balancer\"] --runs 2";
    good(folder.path(), &format!("{sweep} --jobs 1 -o one.csv"));
    good(folder.path(), &format!("{sweep} --jobs 4 -o four.csv"));
    let one = fs::read_to_string(folder.path().join("one.csv")).unwrap();
    assert_eq!(
        one,
        fs::read_to_string(folder.path().join("four.csv")).unwrap()
    );
    assert_eq!(one.lines().count(), 1 + 4 * 2 * 2);
    let columns = one.lines().next().unwrap().split(',').count();
    assert!(one.lines().all(|line| line.split(',').count() == columns));
    // The row of a run says what the run itself says.
    let line = "run short.toml --set start.roll_deg=2.0 --set bike.mode=balancer --seed 2 --json";
    let run = json(&out(&call(folder.path(), line)));
    assert!(
        one.lines()
            .last()
            .unwrap()
            .contains(run["result_hash"].as_str().unwrap())
    );
}

#[test]
fn a_sweep_into_a_folder_makes_a_table_there() {
    let folder = folder();
    let summary = json(&good(
        folder.path(),
        "sweep short.toml --runs 3 -o out/ --json",
    ));
    assert_eq!(summary["rows"], 3);
    assert_eq!(summary["passed"], 3);
    assert!(folder.path().join("out/sweep.csv").is_file());
}

#[test]
fn explain_tells_every_value_and_where_it_comes_from() {
    let folder = folder();
    let explained = good(
        folder.path(),
        "explain short.toml --set start.roll_deg=1.25",
    );
    let line = |key: &str| {
        explained
            .lines()
            .find(|line| line.starts_with(key))
            .unwrap_or_else(|| panic!("{key} is missing"))
    };
    assert!(line("start.roll_deg ").ends_with("# --set"), "{explained}");
    assert!(line("run.duration_s ").ends_with("# line 5"), "{explained}");
    assert!(
        line("follow.max_speed_mps ").ends_with("# default"),
        "{explained}"
    );
    assert!(
        line("bike.m1_kg ").ends_with("# preset default"),
        "{explained}"
    );
    // What stands there can be given by --set, and changes nothing.
    let set: Vec<&str> = explained
        .lines()
        .filter_map(|line| line.split_once("  #"))
        // Asked for, a laser wants a map to look at; by default it does without.
        .filter(|(pair, _)| !pair.starts_with("laser.enabled"))
        .flat_map(|(pair, _)| ["--set", pair.trim()])
        .collect();
    let again = bikebot(folder.path())
        .args(["run", "short.toml", "--json"])
        .args(set)
        .output()
        .unwrap();
    let first = json(&good(
        folder.path(),
        "run short.toml --set start.roll_deg=1.25 --json",
    ));
    assert_eq!(first["result_hash"], json(&out(&again))["result_hash"]);
    let keys = json(&good(folder.path(), "explain short.toml --json"));
    assert!(keys["keys"].as_array().unwrap().len() > 50);
}

#[test]
fn the_schema_is_json_and_knows_the_sections() {
    let schema = json(&good(Path::new("."), "schema"));
    for section in [
        "map", "start", "goal", "bike", "planner", "follow", "balance", "plant", "run", "expect",
    ] {
        assert!(schema["properties"].get(section).is_some(), "{section}");
    }
}

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

#[test]
fn info_and_log_check_read_what_run_wrote() {
    let folder = folder();
    let run = json(&good(folder.path(), "run short.toml -o a.mcap --json"));
    let info = json(&good(folder.path(), "info a.mcap --json"));
    assert_eq!(info["outcome"], "arrived");
    assert_eq!(info["result_hash"], run["result_hash"]);
    assert_eq!(info["scenario"], "short");
    assert!(good(folder.path(), "info a.mcap").contains("short"));
    assert!(good(folder.path(), "log check a.mcap").contains("whole"));
}

#[test]
fn a_cut_recording_is_saved_with_losses_and_what_is_saved_is_whole() {
    let folder = folder();
    good(folder.path(), "run short.toml -o a.mcap");
    let bytes = fs::read(folder.path().join("a.mcap")).unwrap();
    let mut saved = 0;
    for eighth in 1..8 {
        let cut = folder.path().join("cut.mcap.part");
        fs::write(&cut, &bytes[..bytes.len() * eighth / 8]).unwrap();
        assert_eq!(
            call(folder.path(), "log check cut.mcap.part").status.code(),
            Some(3)
        );
        let output = call(
            folder.path(),
            "log recover cut.mcap.part -o saved.mcap --force",
        );
        // 0 where only the index behind the last message was lost.
        let expected = if out(&output).contains("lost        nothing") {
            0
        } else {
            3
        };
        assert_eq!(
            output.status.code(),
            Some(expected),
            "{}{}",
            out(&output),
            err(&output)
        );
        if folder.path().join("saved.mcap").exists() {
            good(folder.path(), "log check saved.mcap");
            saved += 1;
        }
    }
    assert!(saved >= 4, "only {saved} of 7 cuts left anything");
    // A whole one loses nothing.
    good(folder.path(), "log recover a.mcap -o copy.mcap");
    good(folder.path(), "log check copy.mcap");
}

#[test]
fn every_shell_gets_its_completions() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(good(Path::new("."), &format!("completions {shell}")).contains("recover"));
    }
}

#[test]
fn help_of_every_verb_fits_a_hundred_columns() {
    for verb in [
        "",
        "run",
        "plan",
        "sweep",
        "check",
        "explain",
        "schema",
        "init",
        "map",
        "map info",
        "map build",
        "info",
        "log",
        "log check",
        "log recover",
        "completions",
    ] {
        for flag in ["-h", "--help"] {
            let text = good(Path::new("."), &format!("{verb} {flag}"));
            for line in text.lines() {
                assert!(line.chars().count() <= 100, "{verb}: {line}");
            }
        }
    }
}

#[test]
fn the_seed_may_come_from_the_environment_and_the_flag_wins() {
    let folder = folder();
    let seed = |line: &str| {
        let output = bikebot(folder.path())
            .env("BIKEBOT_SEED", "42")
            .args(line.split_whitespace())
            .output()
            .unwrap();
        json(&out(&output))["seed"].as_u64()
    };
    assert_eq!(seed("run short.toml --json"), Some(42));
    assert_eq!(seed("run short.toml --seed 3 --json"), Some(3));
}

#[test]
fn a_scenario_may_come_from_standard_input() {
    let folder = folder();
    let file = fs::File::open(folder.path().join("short.toml")).unwrap();
    let output = bikebot(folder.path())
        .args(["check", "-"])
        .stdin(Stdio::from(file))
        .output()
        .unwrap();
    assert_eq!(out(&output), "<stdin>: ok\n", "{}", err(&output));
}

#[test]
fn messages_are_coloured_only_on_demand() {
    let folder = folder();
    let plain = call(folder.path(), "check nowhere.toml");
    assert!(!err(&plain).contains('\u{1b}'));
    let coloured = call(folder.path(), "check nowhere.toml --color always");
    assert!(err(&coloured).contains('\u{1b}'));
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = folder();
    good(folder.path(), "run short.toml -o a.mcap");
    for line in [
        "schema",
        "explain short.toml",
        "info a.mcap",
        "plan yard.json --json",
        "completions zsh",
    ] {
        let mut child = bikebot(folder.path())
            .args(line.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{line}");
        assert_eq!(err(&output), "", "{line}");
    }
}

#[test]
fn quiet_says_nothing_on_standard_error() {
    let folder = folder();
    for line in [
        "run short.toml -q",
        "sweep short.toml -o a.csv -q",
        "init x -q",
        "plan yard.json -q",
    ] {
        let output = call(folder.path(), line);
        assert_eq!(output.status.code(), Some(0), "{line}: {}", err(&output));
        assert_eq!(err(&output), "", "{line}");
    }
}

#[test]
fn a_bad_seed_of_the_environment_is_told_as_such() {
    let output = bikebot(Path::new("."))
        .env("BIKEBOT_SEED", "many")
        .args(["check", "x.toml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("BIKEBOT_SEED"), "{}", err(&output));
}

#[test]
fn more_is_logged_on_demand() {
    let folder = folder();
    fs::write(
        folder.path().join("ride.toml"),
        "format = 1\nname = \"ride\"\nmap.file = \"yard.json\"\n",
    )
    .unwrap();
    assert_eq!(err(&call(folder.path(), "check ride.toml")), "");
    assert!(err(&call(folder.path(), "check ride.toml -v")).contains("reading yard.json"));
    let output = bikebot(folder.path())
        .env("BIKEBOT_LOG", "info")
        .args(["check", "ride.toml"])
        .output()
        .unwrap();
    assert!(err(&output).contains("reading yard.json"));
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_are_names_too() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let name = OsStr::from_bytes(b"ride\xff.toml");
    fs::copy(folder.path().join("short.toml"), folder.path().join(name)).unwrap();
    let output = bikebot(folder.path())
        .arg("run")
        .arg(name)
        .arg("-o")
        .arg(OsStr::from_bytes(b"\xfe.mcap"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(folder.path().join(OsStr::from_bytes(b"\xfe.mcap")).exists());
}

#[test]
fn verify_proves_a_plan_and_names_what_does_not_hold() {
    let folder = folder();
    let path = folder.path();
    good(
        path,
        "plan yard.json --footprint disc:0.2 --max-curvature 1 -o plan.json",
    );
    let told = good(path, "verify plan.json yard.json");
    assert!(told.starts_with("plan.json: holds"), "{told}");
    let verdict: Value =
        serde_json::from_str(&good(path, "verify plan.json yard.json --json")).unwrap();
    assert_eq!(verdict["holds"], true);
    assert!(verdict["certificate"]["min_clearance_m"].as_f64() > Some(0.0));

    // A curve moved by a micrometre no longer meets its neighbours; a claim of more clearance is not proven.
    let plan: Value =
        serde_json::from_str(&fs::read_to_string(path.join("plan.json")).unwrap()).unwrap();
    let mut moved = plan.clone();
    let x = moved["segments"][3][0].as_f64().unwrap();
    moved["segments"][3][0] = Value::from(x + 1e-6);
    let mut boasted = plan.clone();
    boasted["min_clearance_m"] = Value::from(plan["min_clearance_m"].as_f64().unwrap() + 0.01);
    for (name, text, kind) in [
        ("moved", moved.to_string(), "position_gap"),
        ("boasted", boasted.to_string(), "clearance_promise"),
    ] {
        fs::write(path.join("other.json"), text).unwrap();
        let output = call(path, "verify other.json yard.json --json");
        assert_eq!(output.status.code(), Some(1), "{name}: {}", err(&output));
        let verdict: Value = serde_json::from_str(&out(&output)).unwrap();
        let kinds: Vec<_> = verdict["violations"]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v["kind"].clone())
            .collect();
        assert!(kinds.contains(&Value::from(kind)), "{name}: {kinds:?}");
    }

    // Another map is another problem, whatever the curves.
    fs::write(path.join("open.json"), SCENE.replace("[4, 4]", "[4, 3]")).unwrap();
    let output = call(path, "verify plan.json open.json");
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("another map"), "{}", out(&output));
}

#[test]
fn eigenvalues_of_the_benchmark_are_told_tabled_and_drawn() {
    let folder = folder();
    let path = folder.path();
    let text = good(
        path,
        "eigenvalues benchmark --speeds 0:10:11 -o b.csv -o b.svg -o b.png --zoom 0.5",
    );
    assert!(
        text.starts_with("benchmark: stable 4.2924 to 6.0243 m/s"),
        "{text}"
    );
    assert!(text.contains("4.292382536 m/s") && text.contains("6.024262015 m/s"));
    assert!(
        text.contains("-0.7753 ± 4.4649i    -0.3229   -14.0784  stable"),
        "{text}"
    );
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let csv = fs::read_to_string(path.join("b.csv")).unwrap();
    assert_eq!(csv.lines().count(), 12);
    assert!(csv.lines().all(|line| line.split(',').count() == 10));
    assert!(
        fs::read_to_string(path.join("b.svg"))
            .unwrap()
            .starts_with("<svg")
    );
    assert!(
        fs::read(path.join("b.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    // Never over what is there already, and nothing half written beside it.
    let again = call(path, "eigenvalues benchmark -o c.csv -o b.svg");
    assert_eq!(again.status.code(), Some(2));
    assert!(!names(path).iter().any(|name| name.starts_with("c.csv")));
}

#[test]
fn eigenvalues_as_json_have_the_promised_keys() {
    let folder = folder();
    for preset in ["benchmark", "default", "low_pivot"] {
        let line = format!("eigenvalues {preset} --speeds 5 --json");
        let found = json(&good(folder.path(), &line));
        for key in [
            "name",
            "parameters",
            "M",
            "C1",
            "K0",
            "K2",
            "weave_speed_mps",
            "capsize_speed_mps",
        ] {
            assert!(!found[key].is_null(), "{preset} {key}");
        }
        assert_eq!(found["eigenvalues"][0]["speed_mps"], 5.0);
        assert_eq!(found["eigenvalues"][0]["stable"], true, "{found}");
        assert!(found["stable"][0]["from_mps"].as_f64() < found["stable"][0]["to_mps"].as_f64());
    }
}

#[test]
fn a_bad_parameter_file_is_told_with_its_line() {
    let folder = folder();
    let path = folder.path();
    let good_file = "w = 1.02\nc = 0.08\nlam = 0.314\ng = 9.81\nrR = 0.3\nmR = 2\nIRxx = 0.0603\nIRyy = 0.12\n\
                     xB = 0.3\nzB = -0.9\nmB = 85+/-0.5\nIBxx = 9.2\nIByy = 11\nIBzz = 2.8\nIBxz = 2.4\nxH = 0.9\n\
                     zH = -0.7\nmH = 4\nIHxx = 0.05892\nIHyy = 0.06\nIHzz = 0.00708\nIHxz = -0.00756\nrF = 0.35\n\
                     mF = 3\nIFxx = 0.1405\nIFyy = 0.28\n";
    fs::write(path.join("good.txt"), good_file).unwrap();
    let text = good(path, "eigenvalues good.txt --speeds 1,2");
    assert!(text.contains("±") && text.contains("good.txt"), "{text}");
    for (from, to, parts) in [
        (
            "mB = 85",
            "mB = -85",
            &["mB = -85 kg must be at least 0", "good.txt:11"][..],
        ),
        ("c = 0.08", "c = 0.9", &["half the wheelbase", "good.txt:2"]),
        (
            "IHxz = -0.00756",
            "IHxz = 1",
            &["indefinite", "good.txt:22"],
        ),
        ("w = 1.02", "w = wide", &["`wide`", "good.txt:1"]),
        ("mH = 4\n", "", &["`mH` is missing", "good.txt"]),
    ] {
        fs::write(path.join("good.txt"), good_file.replace(from, to)).unwrap();
        let output = call(path, "eigenvalues good.txt");
        assert_eq!(output.status.code(), Some(2));
        for part in parts {
            assert!(
                err(&output).contains(part),
                "`{part}` is not in:\n{}",
                err(&output)
            );
        }
    }
    // A scenario stands for its bike.
    let text = good(path, "eigenvalues short.toml --speeds 1,5");
    assert!(
        text.starts_with("short: stable 4.1372 to 5.6299 m/s"),
        "{text}"
    );
    let light = format!("{SHORT}bike.m1_kg = 5\nbike.m2_kg = 1\n");
    fs::write(path.join("light.toml"), light).unwrap();
    for (line, code, part) in [
        (
            "eigenvalues light.toml",
            2,
            "once wheels and fork, 11.2 kg, are taken out",
        ),
        (
            "eigenvalues bench",
            2,
            "presets are benchmark, default, low_pivot",
        ),
        ("eigenvalues ./bench", 3, "no such file"),
        ("eigenvalues benchmark -o table.xls", 2, "says no format"),
        (
            "eigenvalues benchmark --speeds 5 -o one.svg",
            2,
            "makes no picture",
        ),
        ("eigenvalues benchmark --speeds 0:10", 2, "0:10:21"),
        (
            "eigenvalues benchmark --speeds -1:10:3",
            2,
            "-1 m/s is not from 0",
        ),
        ("eigenvalues yard.json", 2, "yard.json"),
    ] {
        let output = call(path, line);
        assert_eq!(output.status.code(), Some(code), "{line}\n{}", err(&output));
        assert!(err(&output).contains(part), "{line}\n{}", err(&output));
    }
}

/// A short straight ride without a map.
const STRAIGHT: &str = "\
format = 1
name = \"straight\"
start.speed_mps = 0.5
path = { waypoints = [[0, 0, 0], [3, 0, 0]], tangent_per_chord = 1 }
run.duration_s = 20
";

#[test]
fn a_comparison_tables_every_combination() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("straight.toml"), STRAIGHT).unwrap();
    let line = "compare straight.toml --plants bike3d,two_link,kinematic";
    let text = good(path, line);
    assert!(text.starts_with("straight: 3 runs at seed 1"), "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    for part in [
        "bike3d",
        "drive work, J",
        "two_link stands still",
        "the same",
    ] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    let found = json(&good(path, &format!("{line} --json --jobs 1")));
    assert_eq!(
        keys(&found),
        BTreeSet::from(["scenario", "seed", "columns", "interrupted", "version"])
    );
    let columns = found["columns"].as_array().unwrap();
    assert_eq!(columns.len(), 3);
    for column in columns {
        assert_eq!(column["outcome"], "arrived", "{column}");
        assert!(column["metrics"].is_object() && column["difference"].is_object());
    }
    assert_eq!(
        found,
        json(&good(path, &format!("{line} --format json --jobs 3")))
    );
    good(path, &format!("{line} --format csv -o table.csv"));
    let csv = fs::read_to_string(path.join("table.csv")).unwrap();
    assert_eq!(csv.lines().count(), 4);
    assert!(good(path, &format!("{line} --format markdown")).starts_with("| plant | `bike3d` |"));
}

#[test]
fn a_comparison_of_nonsense_is_refused() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("straight.toml"), STRAIGHT).unwrap();
    for (flags, code, part) in [
        ("", 2, "nothing to compare"),
        ("--plants bike3d", 2, "nothing to compare"),
        (
            "--plants bike3d,bike4d",
            2,
            "`bike4d` is no plant; known are ",
        ),
        ("--plants bike3d,bike3d", 2, "`bike3d` is named twice"),
        (
            "--controllers pid,pvfc",
            2,
            "`pid` is no path follower or balance law; known are ",
        ),
        (
            "--controllers lqr,pvfc",
            2,
            "lqr+ for the path follower, +lqr for the balance law",
        ),
        ("--controllers pvfc+,pvfc", 2, "named twice"),
        (
            "--plants bike3d,kinematic --set run.duration_s=-1",
            2,
            "run.duration_s",
        ),
        (
            "--plants bike3d,kinematic -o no/such/place.txt",
            3,
            "no folder",
        ),
    ] {
        let output = call(path, &format!("compare straight.toml {flags}"));
        assert_eq!(
            output.status.code(),
            Some(code),
            "{flags}\n{}{}",
            out(&output),
            err(&output)
        );
        assert!(err(&output).contains(part), "{flags}\n{}", err(&output));
    }
}
