//! `bikebot verify`: plans proved, and what does not hold.

use std::fs;

use serde_json::Value;

use crate::common::{SCENE, call, err, folder, good, out};

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
