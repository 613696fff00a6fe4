//! `bikebot report`: where the page goes, and what it is made of where there is little.

use std::fs;
use std::path::Path;

use crate::common::{call, err, folder, good, json, keys, names, out};

fn page(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn the_page_has_the_name_of_the_recording_and_replaces_nothing_unasked() {
    let folder = folder();
    let path = folder.path();
    good(path, "run short.toml -o short.mcap");
    let text = good(path, "report short.mcap");
    assert!(
        text.contains("short.html") && text.contains("short, seed 1: arrived"),
        "{text}"
    );
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let first = page(path, "short.html");
    assert!(first.contains("Recovered its balance") && !first.contains("class=\"banner\""));
    let output = call(path, "report short.mcap");
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("short.html already exists"));
    good(path, "report short.mcap --force");
    assert_eq!(page(path, "short.html"), first);
    let output = call(path, "report short.mcap -o no/where.html");
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(names(path).len(), 4, "{:?}", names(path));
}

#[test]
fn several_recordings_stand_on_one_page() {
    let folder = folder();
    let path = folder.path();
    good(path, "run short.toml -o a.mcap");
    good(path, "run short.toml --set start.roll_deg=2 -o b.mcap");
    let told = json(&good(path, "report a.mcap b.mcap --json"));
    assert_eq!(keys(&told), ["bytes", "report", "rides"].into());
    assert_eq!(told["report"], "report.html");
    let rides = told["rides"].as_array().unwrap();
    assert_eq!(rides.len(), 2);
    assert_eq!(
        keys(&rides[0]),
        ["log", "missing", "outcome", "reason", "scenario"].into()
    );
    let page = page(path, "report.html");
    assert_eq!(told["bytes"], page.len());
    assert!(page.contains("2 rides side by side") && page.contains("b.mcap"));
    assert!(page.contains("<code>start.roll_deg=2</code>"));
}

#[test]
fn a_cut_recording_is_shown_as_far_as_it_goes() {
    let folder = folder();
    let path = folder.path();
    good(path, "run short.toml -o short.mcap");
    let whole = fs::read(path.join("short.mcap")).unwrap();
    fs::write(path.join("cut.mcap.part"), &whole[..whole.len() / 2]).unwrap();
    let output = call(path, "report cut.mcap.part");
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(
        err(&output).contains("The file is broken at byte"),
        "{}",
        err(&output)
    );
    assert!(
        out(&output).contains("short, seed 1: was cut off"),
        "{}",
        out(&output)
    );
    let page = page(path, "cut.html");
    for says in [
        "class=\"banner\"",
        "Was cut off",
        "Counted from what was recorded",
    ] {
        assert!(page.contains(says), "{says}");
    }
    // However it is cut, there is a page or a reason.
    for share in 0..16 {
        let length = whole.len() * share / 16;
        fs::write(path.join("some.mcap"), &whole[..length]).unwrap();
        let output = call(path, "report some.mcap -o some.html --force");
        assert!(
            matches!(output.status.code(), Some(0 | 3)),
            "{share}: {}",
            err(&output)
        );
        assert!(
            !err(&output).contains("panicked"),
            "{share}: {}",
            err(&output)
        );
    }
}

#[test]
fn a_damaged_recording_never_makes_a_panic() {
    let folder = folder();
    let path = folder.path();
    good(path, "run short.toml -o short.mcap");
    let whole = fs::read(path.join("short.mcap")).unwrap();
    for case in 0..24_usize {
        let mut bytes = whole.clone();
        for k in 0..3 {
            // Spread over the file by a multiplier that has nothing to do with its length.
            let at = (case * 3 + k).wrapping_mul(2_654_435_761) % bytes.len();
            bytes[at] ^= 1 << (case % 8);
        }
        fs::write(path.join("bad.mcap"), &bytes).unwrap();
        let output = call(path, "report bad.mcap -o bad.html --force -q");
        assert!(
            matches!(output.status.code(), Some(0 | 3)),
            "{case}: {}",
            err(&output)
        );
    }
}

#[test]
fn a_recording_of_a_newer_version_is_shown_without_what_is_not_understood() {
    let folder = folder();
    let path = folder.path();
    good(path, "run short.toml -o short.mcap");
    let mut bytes = fs::read(path.join("short.mcap")).unwrap();
    let key = b"schema_version";
    let at = bytes
        .windows(key.len())
        .position(|window| window == key)
        .unwrap();
    // The key is followed by the length of its value, four bytes, and the value.
    bytes[at + key.len() + 4] = b'9';
    fs::write(path.join("newer.mcap"), &bytes).unwrap();
    let output = call(path, "report newer.mcap");
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(
        err(&output).contains("recorded by a newer bikebot"),
        "{}",
        err(&output)
    );
    let page = page(path, "newer.html");
    assert!(page.contains("recorded by a newer bikebot") && page.contains("two_link"));
    assert!(page.contains("obstacles and limits are not shown"));
}

#[test]
fn a_ride_of_a_newer_version_is_shown_on_its_recorded_map() {
    let folder = folder();
    let path = folder.path();
    let yard = "\
format = 1
name = \"yard\"
map.file = \"yard.json\"
run.duration_s = 1
expect.outcome = \"timed_out\"
";
    fs::write(path.join("yard.toml"), yard).unwrap();
    good(path, "run yard.toml -o ride.mcap");
    let mut bytes = fs::read(path.join("ride.mcap")).unwrap();
    let key = b"schema_version";
    let at = bytes
        .windows(key.len())
        .position(|window| window == key)
        .unwrap();
    bytes[at + key.len() + 4] = b'9';
    fs::write(path.join("newer.mcap"), &bytes).unwrap();
    let output = call(path, "report newer.mcap");
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let page = page(path, "newer.html");
    assert!(
        page.contains("obstacles as the cells of the recorded map"),
        "{}",
        err(&output)
    );
    assert!(page.contains("\"map\":{\"solids\":[],\"occupied\":[{"));
}

#[test]
fn a_ride_that_never_began_has_a_page_too() {
    let folder = folder();
    let path = folder.path();
    let walled = "\
format = 1
name = \"walled\"
map = { bounds_m = [0, 0, 12, 6], box = [{ min_m = [5, 0], max_m = [6, 6] }] }
start = { x_m = 2, y_m = 3, heading_deg = 0 }
goal = { x_m = 10, y_m = 3 }
";
    fs::write(path.join("walled.toml"), walled).unwrap();
    let output = call(path, "run walled.toml -o walled.mcap");
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    good(path, "report walled.mcap -q");
    let page = page(path, "walled.html");
    assert!(page.contains("Found no path") && page.contains("no way leads to the goal"));
    assert!(page.contains("nothing was ridden"));
}

#[test]
fn a_recording_of_another_program_makes_no_page() {
    let folder = folder();
    let path = folder.path();
    // The smallest MCAP file: header, end of data, footer.
    let magic = b"\x89MCAP0\r\n";
    let mut bytes = magic.to_vec();
    for (opcode, length) in [(0x01_u8, 8_u64), (0x0f, 4), (0x02, 20)] {
        bytes.push(opcode);
        bytes.extend(length.to_le_bytes());
        bytes.extend(vec![0; length as usize]);
    }
    bytes.extend(magic);
    fs::write(path.join("other.mcap"), &bytes).unwrap();
    let output = call(path, "report other.mcap");
    assert_eq!(output.status.code(), Some(3), "{}", err(&output));
    assert!(
        err(&output).contains("holds nothing that a report could show"),
        "{}",
        err(&output)
    );
    assert!(!path.join("other.html").exists() && !path.join("other.html.part").exists());
}
