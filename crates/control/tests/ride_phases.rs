//! Setting off, stopping, standing, and changing mode on the way.

mod common;

use bikebot_control::ControlError;
use bikebot_dynamics::{BalancerMode, BikeParams, Measurement};
use bikebot_geometry::{CurvePath, FergusonCurve, Point2};
use common::{CONTROL_PERIOD, Ride, Until, demo_course};

const MODES: [BalancerMode; 2] = [BalancerMode::Flywheel, BalancerMode::Balancer];

fn straight(length: f64) -> CurvePath {
    CurvePath::new(vec![FergusonCurve::straight(
        Point2::new(0.0, 0.0),
        Point2::new(length, 0.0),
    )])
    .unwrap()
}

#[test]
fn starts_from_rest_and_stops_with_the_rear_contact_on_the_goal() {
    for mode in MODES {
        for speed in [0.0, 0.1, 0.3, 0.6] {
            for path in [demo_course(), straight(3.0), straight(0.4)] {
                let mut ride = Ride::new(mode);
                ride.speed = speed;
                let got = ride.run(&path);
                let what = format!(
                    "{mode:?} from {speed} m/s over {:.1} m: {got:#?}",
                    path.length()
                );
                assert!(got.at_rest && !got.fell && got.violations == 0, "{what}");
                // 0.6 m/s needs 36 cm at half a metre per second squared: the short path just allows it.
                assert!(got.end_error < 0.03, "{what}");
                assert!(got.end_heading_error.abs() < 3.0, "{what}");
            }
        }
    }
}

#[test]
fn keeps_standing_once_it_stands() {
    for mode in MODES {
        let mut ride = Ride::new(mode);
        ride.until = Until::Duration;
        ride.duration = 60.0;
        let got = ride.run(&demo_course());
        assert!(got.at_rest && !got.fell, "{got:#?}");
        assert!(
            got.end_speed.abs() < 1e-3 && got.end_roll.abs() < 0.01 && got.end_error < 0.03,
            "{got:#?}"
        );
    }
}

#[test]
fn stops_and_stands_on_a_slope() {
    for mode in MODES {
        for grade in [-0.05, 0.05] {
            let mut ride = Ride::new(mode);
            ride.slope_force = grade * 50.0 * 9.81;
            ride.until = Until::Duration;
            ride.duration = 40.0;
            let got = ride.run(&demo_course());
            assert!(
                got.at_rest && !got.fell && got.end_error < 0.03,
                "{mode:?} {grade}: {got:#?}"
            );
            assert!(got.end_speed.abs() < 1e-3, "{mode:?} {grade}: {got:#?}");
        }
    }
}

#[test]
fn comes_to_rest_with_a_biased_roll_sensor() {
    for mode in MODES {
        let mut ride = Ride::new(mode);
        ride.sensors.roll_bias_deg = 1.0;
        assert!(ride.run(&demo_course()).at_rest);
    }
}

#[test]
fn changes_mode_on_a_straight_and_rides_on() {
    for (from, to) in [(MODES[0], MODES[1]), (MODES[1], MODES[0])] {
        let mut ride = Ride::new(from);
        ride.mode_request = Some((1.0, to, 1.5));
        let mut path = straight(14.0);
        let got = ride.run(&path);
        assert!(got.at_rest && !got.fell && got.mode == Some(to), "{got:#?}");
        assert!(got.roll_max < 3.0 && got.violations == 0, "{got:#?}");
        // On the winding course the shift waits for the balancer to be quiet.
        path = demo_course();
        let got = ride.run(&path);
        assert!(got.at_rest && !got.fell && got.roll_max < 9.0, "{got:#?}");
    }
}

#[test]
fn refuses_measurements_that_are_no_numbers() {
    let bike = BikeParams::default();
    let state = bikebot_dynamics::BikeState::upright(demo_course().start_pose(), 0.0);
    let start = Measurement::ideal(&state, 0.0);
    let new = |start: &Measurement, period: f64| {
        bikebot_control::RideController::new(
            &bike,
            BalancerMode::Flywheel,
            &Default::default(),
            &Default::default(),
            &demo_course(),
            start,
            period,
        )
    };
    let mut controller = new(&start, CONTROL_PERIOD).unwrap();
    let broken = Measurement {
        roll: f64::NAN,
        ..start
    };
    assert!(matches!(
        controller.tick(&broken),
        Err(ControlError::NotFinite {
            quantity: "roll",
            ..
        })
    ));
    assert!(matches!(
        new(&broken, CONTROL_PERIOD),
        Err(ControlError::NotFinite { .. })
    ));
    assert!(matches!(
        new(&start, 0.0),
        Err(ControlError::ControlPeriod { .. })
    ));
    assert!(matches!(
        new(&start, f64::NAN),
        Err(ControlError::ControlPeriod { .. })
    ));
}
