//! Energy from nowhere: the augmented system with its tank, on the flat and on slopes.

mod common;

use bikebot_dynamics::BalancerMode;
use common::{Report, Ride, demo_course, slalom};

const WEIGHT: f64 = 50.0 * 9.81;

/// A few hundred joules carry rounding of 1e-13 J; a tick that made up a thousandth of what the
/// regulator moves in one would show a million times that.
fn assert_books(got: &Report, what: &str) {
    assert!(got.residual_max < 1e-11, "{what}: {got:#?}");
    assert_eq!(got.violations, 0, "{what}");
    if let Some(start) = got.tank_start {
        assert!(got.tank_min >= 0.0, "{what}: {got:#?}");
        // Over the whole ride: what was stored and what is left differ by what came from outside.
        assert!(start.is_finite() && got.supplied.is_finite(), "{what}");
    }
}

fn ride(mode: BalancerMode, slope: f64) -> Ride {
    Ride {
        slope_force: -slope * WEIGHT,
        ..Ride::new(mode)
    }
}

#[test]
fn every_tick_of_a_ride_balances_on_the_flat_and_on_slopes() {
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        for (name, path) in [("course", demo_course()), ("slalom", slalom())] {
            for slope in [-0.05, 0.0, 0.05] {
                for tank in [true, false] {
                    let mut ride = ride(mode, slope);
                    ride.follow.energy_tank = tank;
                    let got = ride.run(&path);
                    let what = format!("{name}, {mode:?}, slope {slope}, tank {tank}");
                    assert!(got.at_rest && !got.fell, "{what}: {got:#?}");
                    assert_books(&got, &what);
                    assert_eq!(got.tank_start.is_some(), tank);
                }
            }
        }
    }
}

#[test]
fn strict_passivity_costs_neither_time_nor_accuracy() {
    let free = Ride::new(BalancerMode::Flywheel);
    let mut strict = free.clone();
    let mut dry = free.clone();
    let mut loose = free;
    loose.follow.energy_tank = false;
    strict.follow.energy_tank = true;
    dry.follow.tank_start = 0.0;
    let [loose, strict, dry] = [loose, strict, dry].map(|ride| ride.run(&demo_course()));
    for got in [&strict, &dry] {
        assert!((got.rest_time - loose.rest_time).abs() < 0.2);
        assert!((got.error_max - loose.error_max).abs() < 2e-4);
    }
}

#[test]
fn a_climb_that_nothing_compensates_empties_the_tank_and_stops_the_bike_in_order() {
    // Without the drive observer the field has to lift the bike out of its own energy.
    let mut ride = ride(BalancerMode::Flywheel, 0.05);
    ride.follow.drive_observer_rate = 0.0;
    ride.duration = 40.0;
    let got = ride.run(&demo_course());
    assert_books(&got, "starving");
    assert!(!got.fell && got.tank_min < 1e-9, "{got:#?}");
    let mut fed = ride.clone();
    fed.follow.energy_tank = false;
    let fed = fed.run(&demo_course());
    // The regulator alone makes up energy without end, and gets there.
    assert!(fed.end_error < 0.1 && got.end_error > 1.0, "{fed:#?}");
}
