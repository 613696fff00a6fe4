//! The laser and what moves in the true world, on whole rides.

mod common;

use bikebot_sim::record::Trace;
use bikebot_sim::{RunOutcome, RunReport, ScenarioFile, SetupError};
use common::{resolve, setup};

/// A straight way of 9 m along y = 5 with a wall far to the left of it.
const STRAIGHT: &str = "\
format = 1
name = \"straight\"
plant.model = \"kinematic\"
[map]
bounds_m = [0, 0, 14, 10]
box = [{ min_m = [4, 8], max_m = [9, 9] }]
[start]
x_m = 1
y_m = 5
heading_deg = 0
speed_mps = 1.0
[path]
waypoints = [[1, 5, 0], [10, 5, 0]]
[laser]
beams = 91
rate_hz = 10
";

fn ride(more: &str, changes: &[&str]) -> (RunReport, Trace) {
    let setup = setup(&format!("{STRAIGHT}{more}"), changes);
    let mut trace = Trace::with_scans();
    let report = common::ride(&setup, &mut trace);
    (report, trace)
}

#[track_caller]
fn assert_refuses(more: &str, key: &str, says: &str) {
    match resolve(&format!("{STRAIGHT}{more}"), &[]) {
        Err(SetupError::Scenario(error)) => {
            assert_eq!(error.key.as_deref(), Some(key), "{more}: {error}");
            assert!(error.to_string().contains(says), "{more}: {error}");
            assert!(error.span.is_some() && error.help.is_some(), "{error}");
        }
        other => panic!("{more}: {other:?}"),
    }
}

#[test]
fn a_noisy_laser_leaves_the_truth_as_it_is_to_the_last_bit() {
    let crossing = "[[obstacle]]\nshape = \"disc:0.3\"\nwaypoints_m = [[6, 1], [6, 3]]\n";
    let noisy = [
        "laser.range_sigma_m=0.05",
        "laser.range_sigma_m_per_m=0.01",
        "laser.dropout_probability=0.1",
    ];
    for plant in ["kinematic", "bike3d"] {
        let model = format!("plant.model={plant}");
        let (quiet, without) = ride(crossing, &[&model]);
        let (told, with) = ride(crossing, &[&model, noisy[0], noisy[1], noisy[2]]);
        assert_eq!(quiet.outcome, RunOutcome::Arrived, "{}", quiet.reason);
        assert_eq!(quiet.result_hash, told.result_hash, "{plant}");
        for name in ["x_m", "y_m", "heading_rad", "roll_rad", "clearance_m"] {
            let bits = |trace: &Trace| -> Vec<u64> {
                let values = trace.column(name).expect("a column").1;
                values.iter().map(|value| value.to_bits()).collect()
            };
            assert!(bits(&without) == bits(&with), "{plant}: {name}");
        }
        // And it was noisy.
        assert_eq!(without.scans.len(), with.scans.len());
        assert!(without.scans[3].ranges != with.scans[3].ranges);
    }
}

#[test]
fn scans_come_late_and_lie_on_what_is_there() {
    let (report, trace) = ride("", &["laser.latency_s=0.08"]);
    assert_eq!(report.outcome, RunOutcome::Arrived);
    // A sweep of 270° takes three quarters of a tenth of a second; its stamp is its middle.
    let end = trace.state.time_s.last().copied().expect("a state");
    let expected = ((end - 0.155) / 0.1 + 1e-6).floor() as usize + 1;
    assert_eq!(trace.scans.len(), expected);
    let (times, x) = trace.column("x_m").expect("a column");
    for (k, scan) in trace.scans.iter().enumerate() {
        assert!((scan.time_s - (0.1 * k as f64 + 0.0375)).abs() < 2e-9);
        // The middle beam looks straight ahead at the field's end, 14 m: the bike stood there at its stamp.
        let after = times.partition_point(|time| *time < scan.time_s);
        let (t0, t1) = (times[after - 1], times[after]);
        let share = (scan.time_s - t0) / (t1 - t0);
        let at = x[after - 1] + share * (x[after] - x[after - 1]);
        let range = scan.ranges[45];
        assert!(
            (range - (14.0 - 1.2 - at)).abs() < 1e-6,
            "{k}: {range} at {at}"
        );
    }
}

#[test]
fn what_crosses_the_way_is_seen_and_met() {
    // The bike is at x = 5 with its nose at 6.46 when it walks in from the left.
    let crossing =
        "[[obstacle]]\nshape = \"disc:0.3\"\nwaypoints_m = [[6, 8], [6, 2]]\nspeed_mps = 0.7\n";
    let mut ends = Vec::new();
    for changes in [
        &[][..],
        &["plant.model=bike3d"],
        #[cfg(feature = "rapier")]
        &["plant.model=rapier3d"],
    ] {
        let (report, trace) = ride(crossing, changes);
        assert_eq!(report.outcome, RunOutcome::Collided, "{changes:?}");
        assert_eq!(report.reason, "moving_obstacle", "{changes:?}");
        let notice = trace.notices.last().expect("a notice");
        assert_eq!(notice.kind, "collision");
        assert!(notice.text.contains("obstacle 1"), "{}", notice.text);
        ends.push(notice.time_s);
        // It was seen well before, where it was.
        let scan = trace
            .scans
            .iter()
            .find(|scan| scan.time_s > 2.0)
            .expect("a scan");
        assert!(scan.ranges.iter().any(|range| *range < 4.0));
        let clearance = trace.column("clearance_m").expect("a column").1;
        assert!(clearance[0] > 0.5 && clearance.last().is_some_and(|least| *least < 0.01));
    }
    // One after another: the plants ride alike.
    assert!(
        ends.iter().all(|end| (end - ends[0]).abs() < 0.2),
        "{ends:?}"
    );
}

#[test]
fn what_appears_on_the_bike_is_a_collision_at_that_moment() {
    let block = "[[obstacle]]\nshape = \"box:0.4x0.4\"\nwaypoints_m = [[3.5, 5]]\nappear_s = 2.5\n";
    let (report, trace) = ride(block, &[]);
    assert_eq!(report.outcome, RunOutcome::Collided);
    assert_eq!(report.reason, "moving_obstacle");
    assert!((trace.notices.last().expect("a notice").time_s - 2.5).abs() < 0.011);
    // Gone again before the bike comes, or after it has passed: nothing happens.
    for times in ["disappear_s = 0.5", "appear_s = 5.5"] {
        let block =
            format!("[[obstacle]]\nshape = \"box:0.4x0.4\"\nwaypoints_m = [[4.5, 5]]\n{times}\n");
        let (report, _) = ride(&block, &[]);
        assert_eq!(
            report.outcome,
            RunOutcome::Arrived,
            "{times}: {}",
            report.reason
        );
    }
}

#[test]
fn the_map_knows_what_stands_in_the_open_and_nothing_else() {
    let known = |text: &str| {
        let setup = resolve(&format!("{STRAIGHT}[[obstacle]]\n{text}"), &[]).expect("a setup");
        let world = setup.world.expect("a map");
        (world.obstacles().len() - 1, setup.traffic.obstacles().len())
    };
    let stands = "shape = \"box:1.0x0.6\"\nwaypoints_m = [[6, 2]]\n";
    assert_eq!(known(stands), (1, 0));
    assert_eq!(known(&format!("{stands}hidden = true")), (0, 1));
    assert_eq!(known(&format!("{stands}appear_s = 1")), (0, 1));
    assert_eq!(known(&format!("{stands}disappear_s = 9")), (0, 1));
    assert_eq!(
        known("shape = \"disc:0.2\"\nwaypoints_m = [[6, 2], [7, 2]]"),
        (0, 1)
    );
    // Turned as it is told.
    let turned = format!("{STRAIGHT}[[obstacle]]\n{stands}heading_deg = 90");
    let world = resolve(&turned, &[])
        .expect("a setup")
        .world
        .expect("a map");
    let above = world.clearance(bikebot_geometry::Point2::new(6.0, 3.0));
    assert!((above - 0.5).abs() < 1e-9, "{above}");
}

#[test]
fn obstacles_that_make_no_sense_are_refused_by_name() {
    let one = |text: &str| format!("[[obstacle]]\n{text}");
    let shape = |shape: &str| one(&format!("shape = \"{shape}\"\nwaypoints_m = [[6, 2]]\n"));
    for bad in [
        "cube:1",
        "disc:x",
        "disc:-1",
        "disc:0",
        "box:1",
        "polygon:0,0;1,1",
        "capsule:1.8x0.6",
        "point",
        "bike",
        "polygon:0,0;1,0;0,1~0.1",
        "disc:500",
        "polygon:0,0;1,1;1,0;0,1",
    ] {
        assert_refuses(&shape(bad), "obstacle.0.shape", "shape");
    }
    let way = "shape = \"disc:0.3\"\n";
    assert_refuses(
        &one(&format!("{way}waypoints_m = [[1.5, 5], [6, 2]]")),
        "obstacle.0.waypoints_m",
        "starts on the bike",
    );
    assert_refuses(
        &one(&format!(
            "{way}waypoints_m = [[6, 2]]\nhidden = true\nrepeat = \"loop\""
        )),
        "obstacle.0.repeat",
        "one way point",
    );
    assert_refuses(
        &one(&format!(
            "{way}waypoints_m = [[6, 2]]\nappear_s = 3\ndisappear_s = 2"
        )),
        "obstacle.0.disappear_s",
        "not after",
    );
    assert_refuses(
        &one(&format!("{way}waypoints_m = [[6, 2]]\nheight_m = 1")),
        "obstacle.0.height_m",
        "as high as",
    );
    // The second one is named as such.
    assert_refuses(
        &format!(
            "{}{}",
            shape("disc:0.3"),
            one("shape = \"disc:0.3\"\nwaypoints_m = [[1, 5.2]]\nhidden = true")
        ),
        "obstacle.1.waypoints_m",
        "obstacle 2 starts on the bike",
    );
    let course = "format = 1\nname = \"course\"\n[path]\nwaypoints = [[1, 1, 0], [5, 1, 0]]\n[[obstacle]]\nshape = \"disc:0.3\"\nwaypoints_m = [[3, 3]]\n";
    let error = resolve(course, &[]).expect_err("no map");
    assert!(error.to_string().contains("no [map]"), "{error}");
}

#[test]
fn a_laser_inside_the_bike_is_refused_and_one_inside_the_outline_is_not() {
    let mounted = |mount: &str| resolve(&format!("{STRAIGHT}{mount}\n"), &[]);
    assert!(mounted("mount_x_m = 1.2").is_ok());
    for (mount, key, part) in [
        (
            "mount_x_m = 1.0\nmount_z_m = 0.3",
            "laser.mount_x_m",
            "front wheel",
        ),
        (
            "mount_x_m = 0.1\nmount_z_m = 0.2",
            "laser.mount_x_m",
            "rear wheel",
        ),
        ("mount_z_m = 0.4", "laser.mount_z_m", "front wheel"),
        (
            "mount_x_m = 0.5\nmount_z_m = 0.5",
            "laser.mount_x_m",
            "frame",
        ),
    ] {
        match mounted(mount) {
            Err(SetupError::Scenario(error)) => {
                assert_eq!(error.key.as_deref(), Some(key));
                assert!(error.to_string().contains(part), "{error}");
            }
            other => panic!("{mount}: {other:?}"),
        }
    }
    let none = ScenarioFile::parse(&STRAIGHT.replace("beams = 91", "beams = 0"), &[]);
    assert_eq!(
        none.expect_err("no beams").key.as_deref(),
        Some("laser.beams")
    );
}

#[cfg(feature = "rapier")]
#[test]
fn rapiers_bodies_and_the_map_with_its_traffic_look_the_same() {
    use bikebot_dynamics::laser::{Prisms, RayScene};
    use bikebot_dynamics::{LaserScanner, Offset};
    use bikebot_geometry::Pose2;
    use bikebot_sim::true_plant::TruePlant;
    use bikebot_sim::true_scene::TrueScene;

    let more = "\
[[obstacle]]
shape = \"box:1.2x0.5\"
waypoints_m = [[9, 1], [9, 7], [4, 7]]
[[obstacle]]
shape = \"disc:0.35\"
waypoints_m = [[4, 2], [8, 3]]
repeat = \"back_and_forth\"
height_m = 1.1
[[obstacle]]
shape = \"polygon:-0.4,-0.4;0.6,-0.4;0.1,0.1;-0.4,0.6\"
waypoints_m = [[11, 7]]
appear_s = 2
[[obstacle]]
shape = \"disc:0.4\"
waypoints_m = [[3, 8]]
";
    let setup = resolve(&format!("{STRAIGHT}{more}"), &["plant.model=rapier3d"]).expect("a setup");
    let plant = TruePlant::new(&setup, &setup.start, Offset::fixed(0.0)).expect("a bike");
    let bodies = TrueScene::new(&setup, &plant).expect("a map to look at");
    let world = setup.world.as_ref().expect("a map");
    let map = (Prisms { world, height: 2.0 }, &setup.traffic);
    let scanner = LaserScanner::new(&setup.laser).expect("a scanner");
    let (mut moving, mut differing) = (0, 0);
    for step in 0..40 {
        let time = 0.1 + 0.23 * f64::from(step);
        let pose = Pose2::new(1.0 + 0.15 * f64::from(step), 5.0, 0.1 * f64::from(step));
        for i in 0..180 {
            let angle = (2.0 * f64::from(i)).to_radians();
            let ray = scanner.ray(angle, &pose, 0.1 * f64::from(step - 20) / 20.0);
            let limit = ray.ground_range().min(30.0);
            let (a, b) = (bodies.cast(&ray, time, limit), map.cast(&ray, time, limit));
            let standing = map.0.cast(&ray, time, limit);
            moving += usize::from(b < standing);
            // A beam along a rim may fall either way.
            let same = a == b || (a - b).abs() < 1e-6;
            differing += usize::from(!same);
        }
    }
    assert!(moving > 300, "{moving}");
    assert!(differing <= 2, "{differing}");
}
