//! The passive benchmark bicycle of Meijaard et al. (2007), built of Rapier's bodies and left to itself.
//!
//! Its motions are fitted, not its equations: four short rides from small disturbances give the matrix that takes
//! the state (roll, steer, and their rates) 20 ms further, by least squares; the logarithms of its eigenvalues are
//! those of the bicycle.
#![cfg(feature = "rapier")]
// What was measured, for `--nocapture`.
#![allow(clippy::print_stdout)]

use bikebot_dynamics::rigid::{BicycleParts, Drive, Loads, Mechanism, Placement};
use bikebot_dynamics::whipple::{Whipple, WhippleParams};
use nalgebra::{Complex, Matrix4, Vector3, Vector4};

const STEP: f64 = 1e-3;
/// Steps from one state to the next of the fit.
const STRIDE: usize = 20;
/// Steps until the wheels have settled on the ground, 5 µm into it.
const SETTLED: usize = 20;

fn coasting(gravity: f64) -> Loads {
    Loads {
        gravity: Vector3::new(0.0, 0.0, -gravity),
        force: Vector3::zeros(),
        moment: Vector3::zeros(),
        wheel: 0.0,
        steering: Drive::Torque(0.0),
        balancer: Drive::Torque(0.0),
        shift: 0.0,
    }
}

/// The passive bicycle's four eigenvalues at `speed` (m/s), as fitted to its motion, by rising real part.
fn eigenvalues(params: &WhippleParams, speed: f64, iterations: usize) -> Vec<Complex<f64>> {
    let loads = coasting(params.gravity);
    let small = 1e-3;
    let starts = [
        (small, 0.0, 0.0, 0.0),
        (0.0, small, 0.0, 0.0),
        (0.0, 0.0, 10.0 * small, 0.0),
        (0.0, 0.0, 0.0, 10.0 * small),
    ];
    let (mut before_before, mut after_before) = (Matrix4::zeros(), Matrix4::zeros());
    for (roll, steer, roll_rate, steer_rate) in starts {
        let placement = Placement {
            roll,
            steer,
            roll_rate,
            steer_rate,
            yaw_rate: speed * (steer * params.tilt.cos()).tan() / params.wheelbase,
            ..Placement::rolling(speed)
        };
        let mut bicycle = Mechanism::new(
            &BicycleParts::from(params),
            STEP,
            iterations,
            1.0,
            &placement,
        );
        let ride: Vec<Vector4<f64>> = (0..SETTLED + 300)
            .map(|_| {
                bicycle.step(&loads);
                let rear = bicycle.rear();
                Vector4::new(
                    rear.roll,
                    bicycle.steer(),
                    rear.roll_rate,
                    bicycle.steer_rate(),
                )
            })
            .skip(SETTLED)
            .collect();
        for (before, after) in ride.iter().zip(ride.iter().skip(STRIDE)) {
            before_before += before * before.transpose();
            after_before += after * before.transpose();
        }
    }
    let onward = after_before * before_before.try_inverse().expect("four different motions");
    let mut all: Vec<Complex<f64>> = onward
        .complex_eigenvalues()
        .iter()
        .map(|value| value.ln() / (STRIDE as f64 * STEP))
        .collect();
    all.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    all
}

/// Where `growth` (negative below, positive above, or the other way round) crosses zero between two speeds, m/s.
fn crossing(mut low: f64, mut high: f64, growth: impl Fn(f64) -> f64) -> f64 {
    let at_low = growth(low);
    assert!(
        at_low * growth(high) < 0.0,
        "no crossing in [{low}, {high}]"
    );
    while high - low > 0.002 {
        let middle = 0.5 * (low + high);
        if growth(middle) * at_low > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

fn oscillating(all: &[Complex<f64>]) -> Option<f64> {
    all.iter()
        .find(|value| value.im > 0.5)
        .map(|value| value.re)
}

/// Largest real part among the eigenvalues that do not oscillate.
fn largest_real(all: &[Complex<f64>]) -> f64 {
    all.iter()
        .filter(|value| value.im.abs() < 0.5)
        .map(|value| value.re)
        .fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn weave_and_capsize_speeds_are_those_of_the_benchmark() {
    let params = WhippleParams::benchmark();
    let weave = crossing(4.1, 4.5, |speed| {
        oscillating(&eigenvalues(&params, speed, 4)).expect("the weave oscillates here")
    });
    let capsize = crossing(5.8, 6.3, |speed| {
        largest_real(&eigenvalues(&params, speed, 4))
    });
    println!("weave {weave:.4} m/s, capsize {capsize:.4} m/s");
    assert!(
        (weave / 4.292_382_536 - 1.0).abs() < 0.02,
        "weave at {weave}"
    );
    assert!(
        (capsize / 6.024_262_015 - 1.0).abs() < 0.03,
        "capsize at {capsize}"
    );
}

#[test]
fn eigenvalues_are_those_of_the_linear_theory() {
    let params = WhippleParams::benchmark();
    let theory = Whipple::new(&params).unwrap();
    for (speed, tolerance) in [(3.0, 0.03), (5.0, 0.02), (7.0, 0.03)] {
        let mut expected = theory.eigenvalues(speed).unwrap().to_vec();
        expected.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
        let fitted = eigenvalues(&params, speed, 4);
        for (fitted, expected) in fitted.iter().zip(&expected) {
            println!("{speed} m/s: fitted {fitted:.4}, theory {expected:.4}");
            assert!(
                (fitted - expected).norm() < tolerance * expected.norm(),
                "{speed} m/s: {fitted} against {expected}"
            );
        }
    }
}

#[test]
fn a_stable_ride_keeps_its_energy() {
    let params = WhippleParams::benchmark();
    let loads = coasting(params.gravity);
    let placement = Placement {
        roll_rate: 0.05,
        ..Placement::rolling(5.0)
    };
    let mut bicycle = Mechanism::new(&BicycleParts::from(&params), STEP, 4, 1.0, &placement);
    let mut ride = |seconds: f64| {
        for _ in 0..(seconds / STEP) as usize {
            bicycle.step(&loads);
        }
        bicycle.energy(&loads.gravity)
    };
    let before = ride(0.1);
    let after = ride(8.0);
    // First order in the step: 3e-5 over 20 s measured. The weave's own 1e-3 J is dissipated on top.
    println!("energy {before:.5} J, 8 s later {after:.5} J");
    assert!((after / before - 1.0).abs() < 5e-5);
}
