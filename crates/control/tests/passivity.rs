//! Energy from nowhere: the augmented system with its tank, on the flat and on slopes.

mod common;

use bikebot_dynamics::BalancerMode;
use common::stepper::{Stepper, noisy, straight_then_arc};
use common::{CONTROL_PERIOD, Report, Ride, demo_course, slalom};

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

#[test]
fn stops_and_new_paths_on_the_way_make_no_energy() {
    // Short at first, so that the longer path is ridden faster and brings its field's energy along.
    let (short, long) = (
        straight_then_arc(2.5, 0.3, 1.0),
        straight_then_arc(2.5, 0.3, 12.0),
    );
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        for slope in [-0.05, 0.05] {
            // On the climb with noise, whose own kinetic energy at rest is worth half a joule.
            let mut ride = ride(mode, slope);
            let allowance = if slope > 0.0 {
                ride.sensors = noisy();
                0.6
            } else {
                1e-3
            };
            let mut bike = Stepper::new(&ride, &short);
            let (mut tick, mut supplied, mut granted, mut given_up) = (0, 0.0, 0.0, 0.0);
            let mut first = None;
            let mut last = 0.0;
            let mut is_running = false;
            let mut waits = 0;
            let arrived = bike.until(90.0, |bike, out| {
                match tick {
                    400 => bike
                        .controller
                        .replace_path(&long, bike.controller.rear_arc_length())
                        .unwrap(),
                    800 => bike.controller.set_stop(Some(7.0)),
                    3200 => bike.controller.set_stop(Some(10.0)),
                    6400 => bike.controller.set_stop(None),
                    _ => {}
                }
                tick += 1;
                let energy = out.energy.unwrap();
                let total = energy.stored + energy.tank;
                first.get_or_insert(total);
                supplied += energy.supplied_power * CONTROL_PERIOD;
                granted += energy.granted;
                given_up += energy.given_up;
                if is_running && out.waiting {
                    waits += 1;
                }
                // Setting off again fills the flywheel from the tank: never more than there was.
                if !is_running && !out.waiting && tick > 1 {
                    assert!(total <= last + allowance, "{mode:?}: {total} after {last}");
                }
                is_running = !out.waiting;
                last = total;
                out.arrived
            });
            assert!(arrived && !bike.fell, "{mode:?} {slope}");
            assert_eq!(bike.violations, 0, "{mode:?} {slope}");
            assert_eq!(waits, 2, "{mode:?} {slope}");
            assert!(granted > 1.0, "{granted}");
            // The whole ride: what is there now came from somewhere.
            let made = last - first.unwrap() - supplied - granted;
            assert!(
                made < 2.0 * allowance,
                "{mode:?} {slope}: {made} J, {given_up} J given up"
            );
        }
    }
}
