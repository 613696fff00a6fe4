//! A tiny plan, drawn to the byte, and what must hold of every plan.

use super::*;
use crate::golden::assert_is_as_kept;
use crate::{png, svg};
use bikebot_world::Obstacle;

/// A straight leg, then a quarter turn, past a disc and a block.
const TINY: &str = r#"{"outcome": "found", "reason": "found", "method": "paper", "seed": 7, "time_s": 0.02,
        "length_m": 9.7, "max_curvature_per_m": 0.33, "min_clearance_m": 0.5, "unknown_key": 1,
        "trace": [{"time_s": 0.001, "stage": "birrt", "length_m": 12.0, "cost": 12.0},
                  {"time_s": 0.02, "stage": "corridor", "length_m": 9.7, "cost": 9.8}],
        "segments": [[1, 1, 5, 0, 6, 1, 5, 0], [6, 1, 4.97, 0, 9, 4, 0, 4.97]],
        "problem": {"map": "yard.json", "bounds_m": [0, 0, 10, 8], "grid": false,
            "shapes": {"discs": [[3, 4, 1]], "blocks": [[6, 3, 7, 8]], "polygons": [[[0, 6], [2, 6], [0, 8]]]},
            "footprint": "capsule:1.8x0.6", "max_curvature_per_m": 0.5, "tolerance_m": 0.4,
            "start": {"x_m": 1, "y_m": 1, "heading_rad": 0}, "goal": {"x_m": 9, "y_m": 4}},
        "stages": {"tree": [[[1, 1], [2, 2]]], "corridor_tree": [[1, 1, 5, 0, 6, 1, 5, 0]],
            "coarse": [[1, 1], [5, 2], [9, 4]], "guide": [[1, 1], [9, 4]], "corridor_half_width_m": 0.7}}"#;

fn drawings(text: &str, colour_by_curvature: bool) -> Vec<Drawing> {
    let plan = PlanFile::parse(text).unwrap();
    let obstacles: Vec<Obstacle> = plan.obstacles().unwrap();
    let ground = Ground {
        bounds: plan.bounds(),
        obstacles: &obstacles,
        grid: None,
    };
    let style = PlanStyle {
        colour_by_curvature,
    };
    let figure = PlanFigure::new(&plan, ground, "yard", style).unwrap();
    let views = [PlanView::Sheet].into_iter().chain(figure.views());
    views.map(|view| figure.draw(view)).collect()
}

#[test]
fn a_tiny_scene_is_drawn_as_it_always_was() {
    let now = svg::write(&drawings(TINY, false)[0]);
    assert_eq!(
        now,
        svg::write(&drawings(TINY, false)[0]),
        "the same bytes again"
    );
    assert_is_as_kept(&now, "tiny.svg");
}

#[test]
fn everything_lies_on_the_sheet() {
    let wide = TINY.replace("[0, 0, 10, 8]", "[-20, 0, 30, 8]");
    let tall = TINY.replace("[0, 0, 10, 8]", "[0, -30, 10, 30]");
    let failed = TINY.replace(
        "[[1, 1, 5, 0, 6, 1, 5, 0], [6, 1, 4.97, 0, 9, 4, 0, 4.97]]",
        "[]",
    );
    let crowded = TINY.replace("\"paper\"", "\"a method with a name that nobody would ever think of, and longer still, and longer, and longer\"");
    for text in [TINY, &wide, &tall, &failed, &crowded] {
        for drawing in drawings(text, true) {
            let area = drawing.extent().unwrap();
            assert!(
                area.left >= 0.0 && area.top >= 0.0,
                "{area:?}: {}",
                drawing.title
            );
            assert!(
                area.right() <= drawing.width && area.bottom() <= drawing.height,
                "{area:?} on {} × {}: {}",
                drawing.width,
                drawing.height,
                drawing.title
            );
            let svg = svg::write(&drawing);
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
    }
}

#[test]
fn each_view_shows_what_there_is() {
    assert_eq!(drawings(TINY, false).len(), 4);
    // Without a limit on curvature, or without a trace, there is no strip to show.
    let straight = TINY
        .replace("\"max_curvature_per_m\": 0.33,", "")
        .replace("\"trace\"", "\"other\"");
    assert_eq!(drawings(&straight, false).len(), 2);
}

#[test]
fn a_picture_has_its_size_and_is_not_blank() {
    let drawing = &drawings(TINY, false)[0];
    let bytes = png::write(drawing, 0.5).unwrap();
    let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(f64::from(info.width), (drawing.width / 2.0).ceil());
    let dark = pixels.chunks(4).filter(|p| p[0] < 128).count();
    assert!(dark > 1000, "{dark} dark pixels");
    for zoom in [1e-6, 1e3, f64::NAN] {
        assert!(matches!(
            png::write(drawing, zoom),
            Err(ReportError::TooLarge { .. })
        ));
    }
}

#[test]
fn the_largest_curvature_is_the_exact_one() {
    let path = CurvePath::new(PlanFile::parse(TINY).unwrap().segments()).unwrap();
    let most = CurvatureProfile::of(&path).most.1.abs();
    // Narrowed down by thirds to the rounding of the curvature itself.
    assert!((most - path.max_curvature()).abs() < 1e-9, "{most}");
}
