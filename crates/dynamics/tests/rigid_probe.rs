use bikebot_dynamics::rigid::*;
use nalgebra::{Matrix3, Vector3};

pub fn benchmark() -> BicycleParts {
    // Meijaard et al. (2007), z down there: centres flip z, products of inertia flip sign.
    let tensor = |xx: f64, yy: f64, zz: f64, xz: f64| {
        Matrix3::new(xx, 0.0, -xz, 0.0, yy, 0.0, -xz, 0.0, zz)
    };
    BicycleParts {
        frame: Part { mass: 85.0, centre: Vector3::new(0.3, 0.0, 0.9), inertia: tensor(9.2, 11.0, 2.8, 2.4) },
        rear_wheel: Wheel { mass: 2.0, radius: 0.3, across: 0.0603, axial: 0.12 },
        fork: Part { mass: 4.0, centre: Vector3::new(0.9, 0.0, 0.7), inertia: tensor(0.05892, 0.06, 0.00708, -0.00756) },
        front_wheel: Wheel { mass: 3.0, radius: 0.35, across: 0.1405, axial: 0.28 },
        wheelbase: 1.02, trail: 0.08, tilt: std::f64::consts::PI / 10.0, balancer: None,
    }
}

#[test]
fn probe() {
    for (v, iters) in [(5.0, 4), (5.0, 1)] {
        let mut place = Placement::rolling(v);
        place.roll_rate = 0.01;
        let mut m = Mechanism::new(&benchmark(), 1e-3, iters, 1.0, &place);
        let loads = Loads { gravity: Vector3::new(0.0, 0.0, -9.81), force: Vector3::zeros(), moment: Vector3::zeros(), wheel: 0.0, steering: Drive::Torque(0.0), balancer: Drive::Torque(0.0), shift: 0.0 };
        let t0 = std::time::Instant::now();
        for i in 0..3000 {
            m.step(&loads);
            if i % 250 == 0 {
                let r = m.rear();
                println!("{i} roll {:.6} steer {:.6} v {:.6} pitch {:.6} y {:.6} side {:.2e} Nr {:.2} Nf {:.2} E {:.6}", r.roll, m.steer(), r.speed, r.pitch, r.contact.y, r.side_speed, m.rear_force().up, m.front_force().up, m.energy(&loads.gravity));
            }
        }
        println!("{:.1} us/step", t0.elapsed().as_secs_f64() / 3000.0 * 1e6);
    }
}
