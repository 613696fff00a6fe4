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
