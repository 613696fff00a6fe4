//! `bikebot eigenvalues`: benchmark, presets, parameter files.

use std::fs;

use crate::common::{SHORT, call, err, folder, good, json, names};

/// A bicycle in the format of BicycleParameters.
pub const MEASURED: &str = "w = 1.02\nc = 0.08\nlam = 0.314\ng = 9.81\nrR = 0.3\nmR = 2\nIRxx = 0.0603\nIRyy = 0.12\n\
    xB = 0.3\nzB = -0.9\nmB = 85+/-0.5\nIBxx = 9.2\nIByy = 11\nIBzz = 2.8\nIBxz = 2.4\nxH = 0.9\n\
    zH = -0.7\nmH = 4\nIHxx = 0.05892\nIHyy = 0.06\nIHzz = 0.00708\nIHxz = -0.00756\nrF = 0.35\n\
    mF = 3\nIFxx = 0.1405\nIFyy = 0.28\n";

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
    fs::write(path.join("good.txt"), MEASURED).unwrap();
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
        fs::write(path.join("good.txt"), MEASURED.replace(from, to)).unwrap();
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
