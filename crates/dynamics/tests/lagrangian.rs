//! The reduced equations against a second derivation: rigid bodies in space, positioned by
//! rotation matrices, with Lagrange's equations differentiated numerically.
//!
//! Seven coordinates `(x, y, z, yaw, pitch, roll, balancer)`; heave and pitch are held at
//! zero, and the force that holds them is the wheel load. The accelerations come from the
//! model under test; what has to vanish is the residual of Lagrange's equations in every
//! direction the bike may move in, and what remains in the others are the contact forces.

use bikebot_dynamics::constants::GRAVITY;
use bikebot_dynamics::{
    Bike, BikeInput, BikeParams, BikeState, Offset, Plant, Push, State, TwoLink, TwoLinkInput,
    TwoLinkState,
};
use bikebot_geometry::Pose2;
use nalgebra::{Matrix3, Rotation3, SVector, Vector3};
use proptest::prelude::*;

type Coordinates = SVector<f64, 7>;

/// Offset and its rate at one instant.
type Arm = (f64, f64);

/// Kinetic minus potential energy of the two rigid bodies.
fn lagrangian(p: &BikeParams, q: &Coordinates, u: &Coordinates, (d, d_dot): Arm) -> f64 {
    let yaw = Rotation3::from_axis_angle(&Vector3::z_axis(), q[3]);
    let heading = yaw * Rotation3::from_axis_angle(&Vector3::y_axis(), q[4]);
    let frame = heading * Rotation3::from_axis_angle(&Vector3::x_axis(), q[5]);
    let balancer = heading * Rotation3::from_axis_angle(&Vector3::x_axis(), q[5] + q[6]);
    let base = Vector3::z() * u[3] + yaw * Vector3::y() * u[4];
    let spin1 = base + heading * Vector3::x() * u[5];
    let spin2 = base + heading * Vector3::x() * (u[5] + u[6]);

    let origin = q.fixed_rows::<3>(0).into_owned();
    let origin_rate = u.fixed_rows::<3>(0).into_owned();
    let r1 = frame * Vector3::new(p.x1, 0.0, p.h1);
    let v1 = origin_rate + spin1.cross(&r1);
    let pivot = frame * Vector3::new(p.x2, 0.0, p.l);
    let up = balancer * Vector3::z();
    let r2 = pivot + up * d;
    let v2 = origin_rate + spin1.cross(&pivot) + spin2.cross(&(up * d)) + up * d_dot;

    let inertia1 = Matrix3::new(p.i1x, 0.0, -p.i1xz, 0.0, p.i1y, 0.0, -p.i1xz, 0.0, p.i1z);
    let inertia2 = Matrix3::from_diagonal(&Vector3::new(p.i2x, p.i2y, p.i2z));
    let body1 = frame.inverse() * spin1;
    let body2 = balancer.inverse() * spin2;
    let kinetic = 0.5
        * (p.m1 * v1.norm_squared()
            + p.m2 * v2.norm_squared()
            + body1.dot(&(inertia1 * body1))
            + body2.dot(&(inertia2 * body2)));
    kinetic - GRAVITY * (p.m1 * (origin + r1).z + p.m2 * (origin + r2).z)
}

/// Central difference of sixth order with step `h`.
fn derivative(h: f64, f: impl Fn(f64) -> f64) -> f64 {
    (45.0 * (f(h) - f(-h)) - 9.0 * (f(2.0 * h) - f(-2.0 * h)) + f(3.0 * h) - f(-3.0 * h))
        / (60.0 * h)
}

/// Step of the differences in angle and time: truncation (h⁶) and rounding (ε/h) meet here.
const H: f64 = 1e-3;

/// `d/dt ∂L/∂q̇ − ∂L/∂q` at `q, u` while accelerating at `a`.
fn residual(
    p: &BikeParams,
    q: &Coordinates,
    u: &Coordinates,
    a: &Coordinates,
    offset: &Offset,
) -> Coordinates {
    let arm = |t: f64| {
        (
            offset.d + offset.rate * t + 0.5 * offset.acceleration * t * t,
            offset.rate + offset.acceleration * t,
        )
    };
    let unit = |i: usize| Coordinates::ith(i, 1.0);
    Coordinates::from_fn(|i, _| {
        // L is quadratic in the velocities: a difference over a whole unit is exact.
        let momentum = |t: f64| {
            let (qt, ut) = (q + u * t + a * (0.5 * t * t), u + a * t);
            0.5 * (lagrangian(p, &qt, &(ut + unit(i)), arm(t))
                - lagrangian(p, &qt, &(ut - unit(i)), arm(t)))
        };
        derivative(H, momentum) - derivative(H, |h| lagrangian(p, &(q + unit(i) * h), u, arm(0.0)))
    })
}

prop_compose! {
    fn bikes()(
        i1xz in -0.5..0.5, low in any::<bool>(), scale in 0.8..1.2,
    ) -> BikeParams {
        let base = if low { BikeParams::low_pivot() } else { BikeParams::default() };
        BikeParams { i1xz, m1: base.m1 * scale, h1: base.h1 / scale, ..base }
    }
}

prop_compose! {
    fn states()(
        heading in -3.0..3.0, steer in -0.7..0.7, roll in -0.5..0.5, balancer in -4.0..4.0,
        speed in -1.0..3.0, roll_rate in -1.0..1.0, balancer_rate in -3.0..3.0,
    ) -> BikeState {
        BikeState {
            pose: Pose2::new(0.7, -0.4, heading),
            steer, roll, balancer, speed, roll_rate, balancer_rate,
        }
    }
}

prop_compose! {
    fn offsets()(d in 0.0..0.3, rate in -0.3..0.3, acceleration in -0.5..0.5) -> Offset {
        Offset { d, rate, acceleration }
    }
}

prop_compose! {
    fn inputs()(
        drive_force in -50.0..50.0, steer_rate in -1.0..1.0, balancer_torque in -40.0..40.0,
        roll_moment in -10.0..10.0, slope_force in -40.0..40.0, offset in offsets(),
        push in (-50.0..50.0, -200.0..200.0, -0.5..1.5, 0.0..1.5),
    ) -> BikeInput {
        BikeInput {
            drive_force, steer_rate, balancer_torque, roll_moment, slope_force, offset,
            push: Push::at(push.0, push.1, push.2, push.3),
        }
    }
}

/// Absolute tolerance, N and N m: the differences leave about 1e-9 of forces near 500 N.
const FORCE: f64 = 2e-7;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_bike_obeys_lagranges_equations_of_the_rigid_bodies(
        p in bikes(), state in states(), input in inputs(),
    ) {
        let bike = Bike::new(p);
        let a = bike.accelerations(&state, &input);
        let forces = bike.contact_forces(&state, &input);
        let (v, omega) = (state.speed, bike.yaw_rate(&state));
        let (sin, cos) = state.pose.heading.sin_cos();

        let q = Coordinates::from([
            state.pose.position.x, state.pose.position.y, 0.0,
            state.pose.heading, 0.0, state.roll, state.balancer,
        ]);
        let u = Coordinates::from([
            v * cos, v * sin, 0.0, omega, 0.0, state.roll_rate, state.balancer_rate,
        ]);
        let qdd = Coordinates::from([
            a.speed * cos - v * omega * sin, a.speed * sin + v * omega * cos, 0.0,
            a.yaw, 0.0, a.roll, a.balancer,
        ]);
        let r = residual(&p, &q, &u, &qdd, &input.offset);

        // Where the slope pulls: the common centre of gravity, across and up.
        let d = input.offset.d;
        let phi = state.roll + state.balancer;
        let m = p.mass();
        let y = -(p.m1 * p.h1 * state.roll.sin()
            + p.m2 * (p.l * state.roll.sin() + d * phi.sin())) / m;
        let z = (p.m1 * p.h1 * state.roll.cos()
            + p.m2 * (p.l * state.roll.cos() + d * phi.cos())) / m;

        let forward = r[0] * cos + r[1] * sin;
        let sideways = -r[0] * sin + r[1] * cos;
        let front_lateral = forces.front_normal * state.steer.cos();
        // The front wheel's force also has a part along the heading, −F_f sin ψ.
        let expected_forward =
            input.drive_force + input.slope_force + input.push.forward
                - forces.front_normal * state.steer.sin();
        prop_assert!((forward - expected_forward).abs() < FORCE, "forward {forward}");
        let push = &input.push;
        prop_assert!((sideways - forces.rear_lateral - front_lateral - push.left).abs() < FORCE);
        prop_assert!((r[2] - forces.rear_load - forces.front_load).abs() < FORCE);
        // A point at height h of the leaning frame is at (x, −h sin α, h cos α).
        let (sin_roll, cos_roll) = state.roll.sin_cos();
        let yaw = p.wheelbase * front_lateral - input.slope_force * y
            + push.left_ahead + push.forward_height * sin_roll;
        prop_assert!((r[3] - yaw).abs() < FORCE, "yaw {} {yaw}", r[3]);
        let pitch = -p.wheelbase * forces.front_load + input.slope_force * z
            + push.forward_height * cos_roll;
        prop_assert!((r[4] - pitch).abs() < FORCE, "pitch {} {pitch}", r[4]);
        let roll = input.roll_moment - push.left_height * cos_roll;
        prop_assert!((r[5] - roll).abs() < FORCE, "roll {} {roll}", r[5]);
        prop_assert!((r[6] - input.balancer_torque).abs() < FORCE, "balancer {}", r[6]);
    }

    #[test]
    fn the_two_links_obey_lagranges_equations_and_the_shift_motor_closes_the_energy(
        p in bikes(), state in states(), offset in offsets(), torque in -40.0..40.0,
        moment in -10.0..10.0,
    ) {
        let model = TwoLink::new(&p, offset);
        let links = TwoLinkState::from(&state);
        let input = TwoLinkInput { balancer_torque: torque, roll_moment: moment };
        let a = model.accelerations(&links, &input);
        let q = Coordinates::from([0.0, 0.0, 0.0, 0.0, 0.0, links.roll, links.balancer]);
        let u =
            Coordinates::from([0.0, 0.0, 0.0, 0.0, 0.0, links.roll_rate, links.balancer_rate]);
        let qdd = Coordinates::from([0.0, 0.0, 0.0, 0.0, 0.0, a[0], a[1]]);
        let r = residual(&p, &q, &u, &qdd, &offset);
        prop_assert!((r[5] - moment).abs() < FORCE);
        prop_assert!((r[6] - torque).abs() < FORCE);

        // Energy and momentum along the motion, with the shift motor's work.
        let rate = model.rate(0.0, &links, &input);
        let at = |h: f64| {
            let arm = Offset {
                d: offset.d + offset.rate * h,
                rate: offset.rate + offset.acceleration * h,
                ..offset
            };
            (TwoLink::new(&p, arm), links.moved(&rate, h))
        };
        let energy_rate = derivative(H, |h| {
            let (model, state) = at(h);
            model.energy(&state)
        });
        let power = torque * links.balancer_rate
            + moment * links.roll_rate
            + model.shift_force(&links, &a) * offset.rate;
        prop_assert!((energy_rate - power).abs() < FORCE, "{energy_rate} {power}");
        let momentum_rate = derivative(H, |h| {
            let (model, state) = at(h);
            model.momentum(&state)
        });
        prop_assert!((momentum_rate - model.momentum_rate(&links, moment)).abs() < FORCE);
    }

    #[test]
    fn the_bikes_energy_changes_by_the_work_done_and_steering_does_none(
        p in bikes(), state in states(), mut input in inputs(),
    ) {
        input.offset = Offset::fixed(input.offset.d);
        input.slope_force = 0.0;
        input.push = Push::default();
        let bike = Bike::new(p);
        let rate = bike.rate(0.0, &state, &input);
        let energy_rate = derivative(H, |h| bike.energy(&state.moved(&rate, h), &input.offset));
        let power = input.drive_force * state.speed
            + input.balancer_torque * state.balancer_rate
            + input.roll_moment * state.roll_rate;
        prop_assert!((energy_rate - power).abs() < FORCE, "{energy_rate} {power}");
    }
}
