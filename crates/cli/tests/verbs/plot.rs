//! `bikebot plot`: pictures, and where they go.

use std::fs;

use crate::common::{call, err, folder, good, names};

#[test]
fn pictures_go_into_the_folder_named_and_it_is_made() {
    let folder = folder();
    let path = folder.path();
    good(path, "plan yard.json --max-curvature 1 -o plan.json");
    for format in ["svg", "png"] {
        let line = format!("plot plan.json -o deep/figures --format {format}");
        let text = good(path, &line);
        let picture = format!("deep/figures/plan.{format}");
        assert!(text.contains(&picture), "{text}");
        assert!(fs::metadata(path.join(picture)).unwrap().len() > 1000);
    }
    assert_eq!(names(&path.join("deep/figures")).len(), 2);
}

#[test]
fn a_picture_that_cannot_be_made_makes_no_folder() {
    let folder = folder();
    let path = folder.path();
    good(path, "plan yard.json --max-curvature 1 -o plan.json");
    let output = call(path, "plot plan.json -o figures --format png --zoom 1000");
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(!path.join("figures").exists());
}

#[test]
fn a_ride_is_shown_at_the_times_asked_for() {
    let folder = folder();
    let path = folder.path();
    let scenario = "\
format = 1
name = \"seen\"
map = { known = false, bounds_m = [0, 0, 12, 6] }
start = { x_m = 2, y_m = 3, heading_deg = 0 }
goal = { x_m = 10, y_m = 3 }
run = { duration_s = 1.5 }
";
    fs::write(path.join("seen.toml"), scenario).unwrap();
    let output = call(path, "run seen.toml -o seen.mcap");
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    good(path, "plot seen.mcap --at 0.2,1 -o .");
    let picture = fs::read_to_string(path.join("seen-moments.svg")).unwrap();
    let one = good(path, "plot seen.mcap --at 1 -o one").len();
    assert!(
        one > 0
            && picture.len()
                > fs::metadata(path.join("one/seen-moments.svg"))
                    .unwrap()
                    .len() as usize
    );
    for (line, says) in [
        ("plot seen.mcap --at -1", "not below 0"),
        (
            "plot seen.mcap --at soon",
            "`soon` is not a number of seconds",
        ),
        ("plot yard.json --at 1", "--at is for rides"),
    ] {
        let output = call(path, line);
        assert_eq!(output.status.code(), Some(2), "{line}");
        assert!(err(&output).contains(says), "{}", err(&output));
    }
}
