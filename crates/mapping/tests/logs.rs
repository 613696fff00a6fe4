//! Whole logs become maps: a synthetic one of a known room, and a real one where it is at hand.

use std::io::Write;
use std::path::Path;

use bikebot_geometry::Point2;
use bikebot_mapping::logs::{self, BuildOptions, LogFormat, LogOptions, LogProblem};
use bikebot_world::Cell;
use proptest::prelude::*;

fn synthetic() -> Vec<u8> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/room.log");
    std::fs::read(path).expect("the log is part of the repository")
}

/// The log is of a robot that drives along y = 1 from x = 1 to x = 5 m in a room from (−0.05, −0.05) to (8.05, 5.05), with a pillar
/// of 1 m by 1 m whose near corner is at (5.55, 2.55); every ninth range is a missing return.
#[test]
fn a_synthetic_carmen_log_becomes_the_room_it_was_made_in() {
    let log = logs::read("room.log", &synthetic(), None, &LogOptions::default()).expect("a log");
    assert_eq!(log.format, LogFormat::Carmen);
    assert_eq!(log.scans.len(), 21);
    assert_eq!(log.odometry_lines, 21);
    assert!((log.distance() - 4.0).abs() < 1e-6);
    let (belief, summary) = logs::build("room.log", &log, &BuildOptions::default(), &mut |_| true)
        .expect("a map")
        .expect("not stopped");
    assert_eq!(summary.hits + summary.silent, 21 * 181);
    let at = |x: f64, y: f64| belief.at(Point2::new(x, y));
    for x in [1.55, 3.05, 4.55] {
        assert_eq!(at(x, 1.0), Some(Cell::Free), "the way at {x}");
        assert_eq!(at(x, 5.05), Some(Cell::Occupied), "the far wall at {x}");
        assert_eq!(at(x, 5.4), Some(Cell::Unknown), "behind it at {x}");
    }
    assert_eq!(at(8.05, 1.5), Some(Cell::Occupied), "the wall ahead");
    assert_eq!(
        at(5.55, 3.0),
        Some(Cell::Occupied),
        "the pillar's near side"
    );
    assert_eq!(at(6.05, 2.55), Some(Cell::Occupied), "its lower side");
    assert_eq!(at(6.05, 3.05), Some(Cell::Unknown), "its inside");
}

#[test]
fn a_build_stops_when_it_is_told_to() {
    let log = logs::read("room.log", &synthetic(), None, &LogOptions::default()).expect("a log");
    let mut asked = 0;
    let stopped = logs::build("room.log", &log, &BuildOptions::default(), &mut |scan| {
        asked += 1;
        scan < 5
    });
    assert_eq!(stopped, Ok(None));
    assert_eq!(asked, 6);
}

#[test]
fn a_field_too_large_for_its_cells_is_refused_before_anything_is_allocated() {
    let text = "FLASER 1 1.0 0 0 0 -900000 0 0 1 h 0\nFLASER 1 1.0 0 0 0 900000 0 0 2 h 0\n";
    let log = logs::read("far.log", text.as_bytes(), None, &LogOptions::default()).expect("a log");
    let refused = logs::build("far.log", &log, &BuildOptions::default(), &mut |_| true)
        .expect_err("too large");
    assert!(
        matches!(refused.problem, LogProblem::TooLarge { .. }),
        "{refused}"
    );
    for resolution in [0.0, -1.0, 1e-9, 1e9, f64::NAN, f64::INFINITY] {
        let refused = logs::build("far.log", &log, &BuildOptions { resolution }, &mut |_| true);
        let refused = refused.expect_err("no size of a cell").problem;
        assert!(
            matches!(refused, LogProblem::Resolution { .. }),
            "{refused}"
        );
    }
}

/// The real log, read in place. Its odometry is good enough for the corridor to come out as one.
#[test]
fn a_real_breezy_log_becomes_a_map_with_walls_and_rooms() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/laser/exp2.dat");
    let Ok(bytes) = std::fs::read(&path) else {
        let _ = writeln!(
            std::io::stderr(),
            "skipped: {} is not there",
            path.display()
        );
        return;
    };
    let log = logs::read("exp2.dat", &bytes, None, &LogOptions::default()).expect("a log");
    assert_eq!(log.format, LogFormat::Breezy);
    assert_eq!(log.scans.len(), 641);
    assert!((log.duration() - 63.16).abs() < 0.1, "{}", log.duration());
    // 177 534 and 179 420 counts of 0.242 mm on the two wheels make 43.2 m, and it goes back a little now and then.
    assert!((43.2..46.0).contains(&log.distance()), "{}", log.distance());
    let (belief, _) = logs::build("exp2.dat", &log, &BuildOptions::default(), &mut |_| true)
        .expect("a map")
        .expect("not stopped");
    let grid = belief.grid();
    let (free, occupied) = (grid.count(Cell::Free), grid.count(Cell::Occupied));
    // Of rooms walked through: tens of square metres of floor, and walls about it.
    assert!(free > 4000, "{free} cells of 0.01 m²");
    assert!((400..6000).contains(&occupied), "{occupied} cells");
    // The robot drove over floor, but for where drift has put a wall since.
    let on_floor = |scan: &&logs::LoggedScan| belief.at(scan.pose.position) == Some(Cell::Free);
    let driven = log.scans.iter().filter(on_floor).count();
    assert!(
        driven * 10 > log.scans.len() * 8,
        "{driven} of {}",
        log.scans.len()
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever is done to a log, it is read or refused.
    #[test]
    fn no_damage_to_a_log_is_fatal(at in 0_usize..20_000, byte: u8, cut in 0_usize..20_000) {
        let mut bytes = synthetic();
        let index = at % bytes.len();
        bytes[index] = byte;
        let damaged = [&bytes[..], &bytes[..cut % bytes.len()]];
        for bytes in damaged {
            if let Ok(log) = logs::read("room.log", bytes, None, &LogOptions::default()) {
                let coarse = BuildOptions { resolution: 0.5 };
                let _ = logs::build("room.log", &log, &coarse, &mut |index| index < 2);
            }
        }
    }
}
