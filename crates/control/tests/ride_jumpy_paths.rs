//! Paths as a sampling planner makes them: curvature up to 0.8 1/m that jumps at every joint.

mod common;

use bikebot_dynamics::BalancerMode;
use common::{Report, Ride, jumpy_path, slalom};

fn assert_ride(got: &Report, what: &str) {
    assert!(got.at_rest && !got.fell, "{what}: {got:#?}");
    assert!(
        got.error_max <= 0.020 && got.error_rms <= 0.006,
        "{what}: {got:#?}"
    );
    // The planning footprint is grown by 0.10 m for this.
    assert!(got.rear_error_max <= 0.03, "{what}: {got:#?}");
    assert!(got.roll_max <= 9.0, "{what}: {got:#?}");
    assert!(
        got.friction_max <= 0.4 && got.load_min > 50.0,
        "{what}: {got:#?}"
    );
    assert_eq!(got.violations, 0, "{what}: {got:#?}");
    assert_eq!(got.fallbacks, 0, "{what}: {got:#?}");
    assert!(
        got.end_error <= 0.05 && got.end_heading_error.abs() <= 10.0,
        "{what}: {got:#?}"
    );
}

#[test]
fn twenty_random_paths_in_both_modes() {
    for seed in 1..=20 {
        let path = jumpy_path(seed);
        assert!(
            path.max_curvature() <= 0.8 && path.max_curvature_jump() > 0.7,
            "seed {seed} is too tame"
        );
        for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
            assert_ride(
                &Ride::new(mode).run(&path),
                &format!("{mode:?}, seed {seed}"),
            );
        }
    }
}

#[test]
fn a_slalom_of_arcs_and_straights_from_rest() {
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        let mut ride = Ride::new(mode);
        ride.speed = 0.0;
        assert_ride(&ride.run(&slalom()), &format!("{mode:?}"));
    }
}
