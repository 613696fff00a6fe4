//! One asymmetric map in every format: the same cells in the world frame; broken copies of it
//! that must never panic; and real files, where they are at hand.

use std::path::PathBuf;

use ::png::{BitDepth, ColorType, Encoder};
use proptest::prelude::*;

use super::bmp::tests::bmp;
use super::*;
use crate::map_text::to_text;

/// No mirror image or half turn of it is itself.
const GOLDEN: [&str; 3] = ["#..?#", ".#...", "###.."];

fn golden_text() -> String {
    GOLDEN.map(|row| format!("{row}\n")).concat()
}

/// The golden cells from the top left, as one value each.
fn shades(occupied: u8, free: u8, unknown: u8) -> Vec<u8> {
    GOLDEN
        .concat()
        .bytes()
        .map(|c| match c {
            b'#' => occupied,
            b'.' => free,
            _ => unknown,
        })
        .collect()
}

fn yaml(image: &str, extra: &str) -> String {
    format!(
        "image: {image}\nresolution: 0.5\norigin: [1.0, -2.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n{extra}"
    )
}

fn load_yaml(text: &str, image: &[u8]) -> Result<LoadedMap, MapError> {
    load(
        "golden.yaml",
        text.as_bytes(),
        &MapOptions::default(),
        &mut |_| Ok(image.to_vec()),
    )
}

fn pgm(shades: &[u8]) -> Vec<u8> {
    let mut file = b"P5\n# golden\n5 3\n255\n".to_vec();
    file.extend(shades);
    file
}

fn png(
    colour: ColorType,
    depth: BitDepth,
    palette: Option<&[u8]>,
    alpha: Option<&[u8]>,
    data: &[u8],
) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, 5, 3);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if let Some(palette) = palette {
        encoder.set_palette(palette.to_vec());
    }
    if let Some(alpha) = alpha {
        encoder.set_trns(alpha.to_vec());
    }
    let mut writer = encoder.write_header().expect("a valid header");
    writer
        .write_image_data(data)
        .expect("as many bytes as pixels");
    writer.finish().expect("written to memory");
    file
}

/// The golden picture as an image file of every kind, with its name.
fn images() -> Vec<(&'static str, Vec<u8>)> {
    let grey = shades(0, 254, 205);
    let spread = |per_pixel: &dyn Fn(u8) -> Vec<u8>| -> Vec<u8> {
        grey.iter().flat_map(|v| per_pixel(*v)).collect()
    };
    let plain = {
        let mut text = String::from("P2\n5 3 # golden\n255\n");
        for v in &grey {
            text.push_str(&format!("{v} "));
        }
        text.into_bytes()
    };
    let deep_pgm = {
        let mut file = b"P5 5 3 65535\n".to_vec();
        file.extend(spread(&|v| vec![v, v]));
        file
    };
    let rgb = spread(&|v| vec![v, v, v]);
    let deep_rgb = spread(&|v| vec![v; 6]);
    // Unknown drawn as nothing at all, whatever colour lies beneath.
    let see_through = |v: u8| if v == 205 { (254, 0) } else { (v, 255) };
    let rgba = spread(&|v| {
        let (shade, alpha) = see_through(v);
        vec![shade, shade, shade, alpha]
    });
    let grey_alpha = spread(&|v| {
        let (shade, alpha) = see_through(v);
        vec![shade, alpha]
    });
    let index = spread(&|v| {
        vec![match v {
            0 => 2,
            254 => 0,
            _ => 1,
        }]
    });
    let palette = [254, 254, 254, 205, 205, 205, 0, 0, 0];
    let clear_palette = [254, 254, 254, 254, 254, 254, 0, 0, 0];
    let bmp_rows = |bytes_per_pixel: usize| {
        let mut rows = Vec::new();
        for row in (0..3).rev() {
            let mut line: Vec<u8> = grey[row * 5..row * 5 + 5]
                .iter()
                .flat_map(|v| vec![*v; bytes_per_pixel])
                .collect();
            line.resize(line.len().next_multiple_of(4), 0);
            rows.extend(line);
        }
        rows
    };
    let grey_palette: Vec<u8> = (0..=255).flat_map(|v| [v, v, v, 0]).collect();
    use BitDepth::{Eight, Sixteen};
    vec![
        ("binary.pgm", pgm(&grey)),
        ("plain.pgm", plain),
        ("deep.pgm", deep_pgm),
        (
            "grey.png",
            png(ColorType::Grayscale, Eight, None, None, &grey),
        ),
        (
            "deep.png",
            png(
                ColorType::Grayscale,
                Sixteen,
                None,
                None,
                &spread(&|v| vec![v, v]),
            ),
        ),
        ("rgb.png", png(ColorType::Rgb, Eight, None, None, &rgb)),
        (
            "deep-rgb.png",
            png(ColorType::Rgb, Sixteen, None, None, &deep_rgb),
        ),
        ("rgba.png", png(ColorType::Rgba, Eight, None, None, &rgba)),
        (
            "grey-alpha.png",
            png(ColorType::GrayscaleAlpha, Eight, None, None, &grey_alpha),
        ),
        (
            "palette.png",
            png(ColorType::Indexed, Eight, Some(&palette), None, &index),
        ),
        (
            "clear-palette.png",
            png(
                ColorType::Indexed,
                Eight,
                Some(&clear_palette),
                Some(&[255, 0, 255]),
                &index,
            ),
        ),
        ("eight.bmp", bmp(5, 3, 8, 0, &grey_palette, &bmp_rows(1))),
        ("24.bmp", bmp(5, 3, 24, 0, &[], &bmp_rows(3))),
        ("32.bmp", bmp(5, 3, 32, 0, &[], &bmp_rows(4))),
    ]
}

/// Solid exactly where the picture says, seen through the world's own frame.
fn assert_golden(map: &LoadedMap, origin: Pose2, resolution: f64, unknown_is_solid: bool) {
    for (row, cells) in GOLDEN.iter().rev().enumerate() {
        for (column, cell) in cells.chars().enumerate() {
            let local = Point2::new(
                (column as f64 + 0.5) * resolution,
                (row as f64 + 0.5) * resolution,
            );
            let solid = cell == '#' || (cell == '?' && unknown_is_solid);
            let clearance = map.world.clearance(origin.transform(local));
            assert_eq!(
                clearance < 0.0,
                solid,
                "{}: column {column}, row {row}",
                map.name
            );
        }
    }
}

#[test]
fn every_image_format_gives_the_same_cells_in_the_world_frame() {
    for (name, image) in images() {
        let map = load_yaml(&yaml(name, "negate: 0\n"), &image).expect(name);
        let grid = map.world.grid().expect("a grid");
        assert_eq!(to_text(grid), golden_text(), "{name}");
        assert_golden(&map, Pose2::new(1.0, -2.0, 0.0), 0.5, true);
        let bare = load(
            name,
            &image,
            &MapOptions {
                meters_per_cell: Some(0.5),
                ..MapOptions::default()
            },
            &mut |_| Err("an image names no file".into()),
        )
        .expect(name);
        assert_eq!(bare.kind, MapKind::Image);
        assert_golden(&bare, Pose2::new(0.0, 0.0, 0.0), 0.5, true);
    }
}

#[test]
fn modes_negation_and_yaw_keep_the_cells_where_they_belong() {
    let cases = [
        ("negate: 0\n", shades(0, 254, 205)),
        ("negate: 0\nmode: trinary\n", shades(0, 254, 205)),
        ("negate: 0\nmode: scale\n", shades(0, 254, 205)),
        ("negate: 1\n", shades(255, 0, 50)),
        ("negate: true\nmode: scale\n", shades(255, 0, 50)),
        ("negate: 0\nmode: raw\n", shades(100, 0, 255)),
    ];
    for (extra, shades) in cases {
        let map = load_yaml(&yaml("g.pgm", extra), &pgm(&shades)).expect(extra);
        assert_eq!(
            to_text(map.world.grid().expect("a grid")),
            golden_text(),
            "{extra}"
        );
        let turned = yaml("g.pgm", extra).replace("-2.0, 0.0]", "-2.0, 0.7]");
        let map = load_yaml(&turned, &pgm(&shades)).expect(extra);
        assert_golden(&map, Pose2::new(1.0, -2.0, 0.7), 0.5, true);
    }
}

#[test]
fn moving_ai_text_and_json_give_the_same_cells() {
    let options = MapOptions {
        meters_per_cell: Some(0.5),
        ..MapOptions::default()
    };
    let nothing = &mut |_: &str| Err("names no file".to_owned());
    let rows = golden_text().replace('#', "@").replace('?', ".");
    let file = format!("type octile\nheight 3\nwidth 5\nmap\n{rows}");
    let map = load("g.map", file.as_bytes(), &options, nothing).expect("valid");
    assert_eq!(map.kind, MapKind::MovingAi);
    assert!(map.warnings.is_empty());
    assert_golden(&map, Pose2::new(0.0, 0.0, 0.0), 0.5, false);

    let map = load("g.txt", golden_text().as_bytes(), &options, nothing).expect("valid");
    assert_golden(&map, Pose2::new(0.0, 0.0, 0.0), 0.5, true);

    let mut polygons = Vec::new();
    for (row, cells) in GOLDEN.iter().rev().enumerate() {
        for (x, _) in cells.char_indices().filter(|(_, c)| *c != '.') {
            let (x0, y0) = (x as f64 * 0.5, row as f64 * 0.5);
            let (x1, y1) = (x0 + 0.5, y0 + 0.5);
            polygons.push(format!(
                "{{\"polygon\": [[{x0},{y0}],[{x1},{y0}],[{x1},{y1}],[{x0},{y1}]]}}"
            ));
        }
    }
    let scene = format!(
        "{{\"width\": 2.5, \"height\": 1.5, \"obstacles\": [{}]}}",
        polygons.join(",")
    );
    let map = load("g.json", scene.as_bytes(), &MapOptions::default(), nothing).expect("valid");
    assert_golden(&map, Pose2::new(0.0, 0.0, 0.0), 0.5, true);
}

#[test]
fn unknown_can_be_asked_to_be_free_and_maps_to_be_stretched() {
    let options = MapOptions {
        scale: 2.0,
        unknown_is_free: true,
        ..MapOptions::default()
    };
    let file = yaml("g.pgm", "negate: 0\n");
    let map = load("g.yaml", file.as_bytes(), &options, &mut |_| {
        Ok(pgm(&shades(0, 254, 205)))
    })
    .expect("valid");
    assert_golden(&map, Pose2::new(2.0, -4.0, 0.0), 1.0, false);
}

#[test]
fn a_missing_cell_size_is_asked_for_by_key_and_flag() {
    let nothing = &mut |_: &str| Err(String::new());
    let options = MapOptions::default();
    for (name, bytes) in [
        ("m.pgm", pgm(&shades(0, 254, 205))),
        ("m.txt", golden_text().into_bytes()),
    ] {
        let error = load(name, &bytes, &options, nothing).expect_err("no cell size");
        let text = error.to_string();
        assert!(text.contains("meters_per_cell") && text.contains("--meters-per-cell"));
    }
    let file = b"type octile\nheight 1\nwidth 2\nmap\n.@\n";
    let map = load("m.map", file, &options, nothing).expect("1 m is assumed");
    assert_eq!(map.world.bounds().max, Point2::new(2.0, 1.0));
    assert!(map.warnings[0].contains("1 m per cell"));
    for (meters_per_cell, scale) in [(Some(0.0), 1.0), (Some(f64::NAN), 1.0), (None, -1.0)] {
        let options = MapOptions {
            meters_per_cell,
            scale,
            ..MapOptions::default()
        };
        let error = load("m.map", file, &options, nothing).expect_err("no size");
        assert!(error.key.is_some());
    }
}

#[test]
fn files_of_no_known_kind_are_told_what_would_do() {
    let nothing = &mut |_: &str| Err(String::new());
    for (name, bytes) in [
        ("m.svg", &b"<svg/>"[..]),
        ("m", b""),
        ("m.scen", b"version 1\n"),
        ("m.pgm", b"not an image"),
    ] {
        let options = MapOptions {
            meters_per_cell: Some(1.0),
            ..MapOptions::default()
        };
        let error = load(name, bytes, &options, nothing).expect_err(name);
        assert!(error.to_string().starts_with(name), "{error}");
    }
    // A folder with a dot is no extension, and content decides where there is none.
    let file = b"type octile\nheight 1\nwidth 2\nmap\n.@\n";
    let map = load("a.b/m", file, &MapOptions::default(), nothing).expect("known by content");
    assert_eq!((map.kind, map.name.as_str()), (MapKind::MovingAi, "m"));
}

/// Every kind of file, small and valid: its name and bytes.
fn seeds() -> Vec<(String, Vec<u8>)> {
    let mut seeds: Vec<(String, Vec<u8>)> = images()
        .into_iter()
        .map(|(name, bytes)| (name.to_owned(), bytes))
        .collect();
    let rows = golden_text().replace('#', "@").replace('?', ".");
    seeds.push((
        "m.map".into(),
        format!("type octile\nheight 3\nwidth 5\nmap\n{rows}").into_bytes(),
    ));
    seeds.push(("m.txt".into(), golden_text().into_bytes()));
    seeds.push((
        "m.json".into(),
        br#"{"name":"m","width":9,"height":8,"start":[1,1,0],"goal":[8,7],
            "obstacles":[{"polygon":[[2,2],[5,2],[5,5],[4,3],[2,5]],"label":"x"}]}"#
            .to_vec(),
    ));
    let yaml_file = yaml("'binary.pgm' # image", "negate: 0\nmode: \"trinary\"\n");
    seeds.push(("m.yaml".into(), yaml_file.into_bytes()));
    seeds.push((
        "m.yml".into(),
        b"image: g.pgm\norigin:\n- 1\n- 2\n- 0.1\nresolution: 1\nnegate: 0\noccupied_thresh: 1\nfree_thresh: 0\n".to_vec(),
    ));
    seeds.push((
        "m.scen".into(),
        b"version 1\n0\tm.map\t5\t3\t1\t0\t3\t1\t2.41421356\n1\tm.map\t5\t3\t1\t0\t3\t1\t2.4\n"
            .to_vec(),
    ));
    seeds
}

/// Whatever the bytes: a map that can be asked, or an error that names the file.
fn try_bytes(name: &str, bytes: &[u8]) {
    let options = MapOptions {
        meters_per_cell: Some(0.5),
        ..MapOptions::default()
    };
    let image = pgm(&shades(0, 254, 205));
    match load(name, bytes, &options, &mut |_| Ok(image.clone())) {
        Ok(map) => {
            let clearance = map.world.clearance(map.world.bounds().centre());
            assert!(!clearance.is_nan());
        }
        Err(error) => assert!(!error.file.is_empty() && !error.to_string().is_empty()),
    }
    if let Ok(problems) = moving_ai::parse_scen(name, bytes) {
        assert!(problems.len() <= bytes.len());
    }
    // The same bytes behind a description.
    let _ = load_yaml(&yaml(name, "negate: 0\n"), bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]
    #[test]
    fn mutated_and_cut_files_never_panic(
        which in any::<prop::sample::Index>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        digits in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 0..3),
        cut in prop::option::of(any::<prop::sample::Index>()),
        doubled in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let seeds = seeds_once();
        let (name, seed) = &seeds[which.index(seeds.len())];
        let mut bytes = seed.clone();
        for (at, value) in edits.into_iter().chain(digits) {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(at) = doubled {
            let at = at.index(bytes.len());
            let tail = bytes[at..].to_vec();
            bytes.extend(tail);
        }
        if let Some(at) = cut {
            bytes.truncate(at.index(bytes.len()));
        }
        try_bytes(name, &bytes);
    }

    #[test]
    fn arbitrary_bytes_never_panic(
        which in any::<prop::sample::Index>(),
        keep in 0_usize..12,
        bytes in prop::collection::vec(any::<u8>(), 0..120),
    ) {
        let seeds = seeds_once();
        let (name, seed) = &seeds[which.index(seeds.len())];
        let mut file = seed[..keep.min(seed.len())].to_vec();
        file.extend(bytes);
        try_bytes(name, &file);
    }
}

fn seeds_once() -> &'static [(String, Vec<u8>)] {
    static SEEDS: std::sync::OnceLock<Vec<(String, Vec<u8>)>> = std::sync::OnceLock::new();
    SEEDS.get_or_init(seeds)
}

#[test]
fn every_truncation_of_every_format_is_an_answer() {
    for (name, seed) in seeds() {
        for length in 0..seed.len() {
            try_bytes(&name, &seed[..length]);
        }
    }
}

#[test]
fn a_yaml_full_of_keys_nesting_or_aliases_is_refused_at_once() {
    let keys: String = (0..4_000).map(|k| format!("k{k}: {k}\n")).collect();
    assert!(load_yaml(&keys, b"").is_err());
    assert!(load_yaml(&"- ".repeat(20_000), b"").is_err());
    assert!(load_yaml(&format!("k: {}", "[".repeat(5_000)), b"").is_err());
    let bomb = "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n";
    let error = load_yaml(bomb, b"").expect_err("anchors");
    assert_eq!(error.line, Some(1));
}

/// The folder of real files, or none, with the reason printed.
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn shared_data() -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if folder.is_dir() {
        Some(folder)
    } else {
        eprintln!("skipped: no real maps at {}", folder.display());
        None
    }
}

fn load_file(path: &std::path::Path, options: &MapOptions) -> Result<LoadedMap, MapError> {
    let bytes = std::fs::read(path).expect("a listed file");
    let folder = path.parent().expect("a file in a folder").to_owned();
    load(&path.to_string_lossy(), &bytes, options, &mut |image| {
        std::fs::read(folder.join(image)).map_err(|e| e.to_string())
    })
}

#[test]
fn real_map_server_files_read_as_their_facts_say() {
    let Some(data) = shared_data() else { return };
    let ros = data.join("ros_maps");
    let options = MapOptions::default();

    let depot = load_file(&ros.join("nav2/depot.yaml"), &options).expect("valid");
    assert!(
        depot.warnings.iter().any(|w| w.contains("8894 cells")),
        "{:?}",
        depot.warnings
    );
    let turtle = load_file(&ros.join("turtlebot3_world/map.yaml"), &options).expect("valid");
    let grid = turtle.world.grid().expect("a grid");
    assert_eq!((grid.width, grid.height, grid.resolution), (384, 384, 0.05));
    assert!(turtle.warnings.is_empty(), "{:?}", turtle.warnings);

    let turned = load_file(&ros.join("nav2/testmap.yaml"), &options).expect("valid");
    let origin = turned.world.grid().expect("a grid").origin;
    assert_eq!(origin, Pose2::new(2.0, 3.0, 1.0));
    let ten = load_file(&ros.join("nav2/TenByTen.yaml"), &options).expect("valid");
    assert_eq!(ten.world.grid().expect("a grid").width, 10);
    let missing = load_file(&ros.join("nav2/invalid_image.yaml"), &options).expect_err("no image");
    assert_eq!(
        (missing.line, missing.key.as_deref()),
        (Some(1), Some("image"))
    );

    // The same picture as PGM, PNG and BMP.
    let bare = MapOptions {
        meters_per_cell: Some(0.1),
        ..options
    };
    let pictures: Vec<String> = ["pgm", "png", "bmp"]
        .iter()
        .map(|e| {
            let path = ros.join(format!("nav2/testmap.{e}"));
            let map = load_file(&path, &bare).expect(e);
            to_text(map.world.grid().expect("a grid"))
        })
        .collect();
    assert_eq!(pictures[0], pictures[1]);
    assert_eq!(pictures[0], pictures[2]);

    let deep = load_file(&data.join("bench_mr/freiburg.png"), &bare).expect("16-bit RGB");
    let grid = deep.world.grid().expect("a grid");
    assert_eq!((grid.width, grid.height), (911, 368));
    assert!(grid.count(Cell::Free) > 0 && grid.count(Cell::Occupied) > 0);
    load_file(&data.join("ir_sim/cave.png"), &bare).expect("8-bit grey");
}

#[test]
fn real_moving_ai_maps_and_problems_fit_each_other() {
    let Some(data) = shared_data() else { return };
    let folder = data.join("movingai");
    let shares = [
        ("Berlin_0_256", 27.0),
        ("Sydney_1_256", 26.0),
        ("Moscow_2_512", 25.0),
        ("32room_004", 10.0),
        ("random512-10-0", 10.0),
        ("warehouse-10-20-10-2-1", 44.0),
    ];
    for (name, percent) in shares {
        let map =
            load_file(&folder.join(format!("{name}.map")), &MapOptions::default()).expect(name);
        let grid = map.world.grid().expect("a grid");
        let share = 100.0 * grid.count(Cell::Occupied) as f64 / grid.cells.len() as f64;
        assert!((share - percent).abs() < 0.6, "{name}: {share}");
    }
    let mut checked = 0;
    for entry in std::fs::read_dir(&folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "scen") {
            continue;
        }
        let bytes = std::fs::read(&path).expect("a listed file");
        let name = path.to_string_lossy();
        let problems = moving_ai::parse_scen(&name, &bytes).expect("valid");
        let map = problems[0].map_basename().to_owned();
        let grid = moving_ai::parse_map(
            &map,
            &std::fs::read(folder.join(&map)).expect("its map"),
            1.0,
        )
        .expect("valid");
        for problem in &problems {
            problem.check(&name, &map, &grid).expect("both ends free");
            let (start, goal) = (problem.start_point(&grid), problem.goal_point(&grid));
            let straight = (goal.expect("on the map") - start.expect("on the map")).norm();
            assert!(straight <= problem.optimal_length + 1e-4);
            checked += 1;
        }
    }
    assert!(checked > 10_000);
}

#[test]
fn truncated_real_files_are_errors_that_name_the_file() {
    let Some(data) = shared_data() else { return };
    for file in [
        "ros_maps/nav2/depot.pgm",
        "ros_maps/nav2/testmap.png",
        "ros_maps/nav2/testmap.bmp",
        "ros_maps/nav2/testmap.yaml",
        "movingai/random-32-32-20.map",
        "bench_mr/freiburg.png",
    ] {
        let bytes = std::fs::read(data.join(file)).expect("a listed file");
        for k in 0..200 {
            let options = MapOptions {
                meters_per_cell: Some(1.0),
                ..MapOptions::default()
            };
            let cut = &bytes[..bytes.len() * k / 200];
            if let Err(error) = load(file, cut, &options, &mut |_| Err("not here".into())) {
                assert_eq!(error.file, file);
            }
        }
    }
}
