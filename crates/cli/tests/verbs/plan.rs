//! `bikebot plan`: what it tells and writes, and how a search ends.

use std::collections::BTreeSet;
use std::fs;

use crate::common::{SCENE, call, folder, good, json, keys, out};

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
