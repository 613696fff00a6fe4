//! The laws against reference vectors evaluated independently of them.

use bikebot_control::followed_path::PathSample;
use bikebot_control::pvfc::coupling_force;
use bikebot_control::{
    FollowParams, FollowedPath, LookAhead, OutputReference, OutputZeroing, RideLimits, RollModel,
    Track, TurnMoment, VelocityField,
};
use bikebot_dynamics::{BikeParams, BikeState, Measurement, TwoLinkState};
use bikebot_geometry::{Point2, Pose2, Vector2};
use nalgebra::Vector4;
use serde_json::Value;

mod common;

fn read(name: &str) -> Value {
    let path = format!(
        "{}/../../tests/data/vectors/{name}",
        env!("CARGO_MANIFEST_DIR")
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn f(v: &Value) -> f64 {
    v.as_f64().unwrap()
}

fn array<const N: usize>(v: &Value) -> [f64; N] {
    std::array::from_fn(|i| f(&v[i]))
}

/// Single evaluations of doubles: relative 1e-10 of the larger of value and scale.
fn close(what: &str, got: f64, want: f64, scale: f64) {
    let error = (got - want).abs() / want.abs().max(scale);
    assert!(error < 1e-10, "{what}: {got} instead of {want}");
}

fn bike(name: &str) -> BikeParams {
    let mut bike = match name {
        "default" => BikeParams::default(),
        _ => BikeParams::low_pivot(),
    };
    // The vectors were made with the lean products of the default set.
    bike.i1xz = 0.0;
    bike
}

#[test]
fn output_zeroing_agrees_with_the_symbolic_derivatives() {
    for case in read("two_link.json")["cases"].as_array().unwrap() {
        let model = RollModel::new(&bike(case["params"].as_str().unwrap()), f(&case["d"]));
        let law = OutputZeroing::new(f(&case["kappa"]), array(&case["poles"]));
        let state = TwoLinkState {
            roll: f(&case["alpha"]),
            balancer: f(&case["beta"]),
            roll_rate: f(&case["alpha_dot"]),
            balancer_rate: f(&case["beta_dot"]),
        };
        let turn = TurnMoment::default();
        let d = law.derivatives(&model, &state, &turn, 0.0, &OutputReference::default());
        let w = law.balancer_acceleration(&d);
        close(
            "F",
            model.inertia.value(state.balancer),
            f(&case["F"]),
            1e-3,
        );
        close("K", law.output_gain(&model), f(&case["K"]), 1e-3);
        close("sigma", d.momentum, f(&case["sigma"]), 1.0);
        close("p", d.p, f(&case["p"]), 1e-2);
        close("y", d.y, f(&case["y"]), 1.0);
        close("y'", d.y1, f(&case["y_dot"]), 1.0);
        close("y''", d.y2, f(&case["y_ddot"]), 1.0);
        close("D", d.decoupling, f(&case["D"]), 1.0);
        close("L", d.drift, f(&case["L"]), 1.0);
        close("w", w, f(&case["w"]), 1.0);
        close(
            "tau",
            OutputZeroing::torque(&model, &state, &turn, &d, w),
            f(&case["tau"]),
            1.0,
        );
    }
}

#[test]
fn output_zeroing_agrees_while_turning() {
    for case in read("oz_turning.json").as_array().unwrap() {
        let model = RollModel::new(&bike(case["params"].as_str().unwrap()), f(&case["d"]));
        let law = OutputZeroing::new(f(&case["kappa"]), array(&case["poles"]));
        let [roll, balancer, roll_rate, balancer_rate] = array(&case["state"]);
        let state = TwoLinkState {
            roll,
            balancer,
            roll_rate,
            balancer_rate,
        };
        let turn = TurnMoment {
            centripetal: f(&case["v_omega"]),
            yaw_acceleration: f(&case["omega_dot"]),
            yaw_rate: f(&case["omega"]),
        };
        let [value, p1, p2, p3, p4] = array(&case["p_ref_and_derivatives"]);
        let reference = OutputReference {
            value,
            derivatives: [p1, p2, p3, p4],
        };
        let moment = model.turning(&state, &turn);
        close("E", moment.value, f(&case["E"]), 1.0);
        close("E_alpha", moment.a, f(&case["E_alpha"]), 1.0);
        close("E_beta", moment.b, f(&case["E_beta"]), 1.0);
        close("E_alpha_alpha", moment.aa, f(&case["E_alpha_alpha"]), 1.0);
        close("E_alpha_beta", moment.ab, f(&case["E_alpha_beta"]), 1.0);
        let d = law.derivatives(&model, &state, &turn, f(&case["Td"]), &reference);
        let w = law.balancer_acceleration(&d);
        for (name, got) in [
            ("G", d.moment),
            ("y", d.y),
            ("y1", d.y1),
            ("y2", d.y2),
            ("D", d.decoupling),
            ("Lr", d.drift),
            ("w", w),
            ("tau", OutputZeroing::torque(&model, &state, &turn, &d, w)),
            ("sigma", d.momentum),
            ("p", d.p),
            ("K", law.output_gain(&model)),
        ] {
            close(name, got, f(&case[name]), 0.1);
        }
    }
}

#[test]
fn field_and_coupling_force_agree_on_a_circle() {
    let file = read("pvfc.json");
    let radius = f(&file["circle_path"]["radius"]);
    for case in file["pvfc"].as_array().unwrap() {
        let params = FollowParams {
            contour_gain: f(&case["Gamma"]),
            virtual_time_gain: f(&case["Gamma_s"]),
            error_max: f(&case["e_max"]),
            ..FollowParams::default()
        };
        // rho = 1 + 0.2 sin(0.5 s) nowhere exceeds 1.2 m/s.
        let field = VelocityField::new(&params, 1.2);
        close("E", field.energy(), f(&case["E"]), 1.0);
        let (s, s_rate) = (f(&case["s"]), f(&case["s_dot"]));
        let angle = s / radius;
        let sample = PathSample {
            position: Point2::new(radius * angle.cos(), radius * angle.sin()),
            heading: angle + std::f64::consts::FRAC_PI_2,
            curvature: 1.0 / radius,
            speed: 1.0 + 0.2 * (0.5 * s).sin(),
            speed_slope: 0.1 * (0.5 * s).cos(),
        };
        let [px, py] = array(&case["P"]);
        let [vx, vy] = array(&case["P_dot"]);
        let value = field.evaluate(&sample, Point2::new(px, py), Vector2::new(vx, vy), s_rate);
        let velocity = Vector4::new(vx, vy, s_rate, f(&case["f_dot"]));
        let force = coupling_force(
            &field.inertia(),
            &velocity,
            &value,
            field.energy(),
            f(&case["gamma"]),
        );
        for (i, (v, (rate, tau))) in array::<4>(&case["V"])
            .into_iter()
            .zip(
                array::<4>(&case["V_dot"])
                    .into_iter()
                    .zip(array::<4>(&case["force"])),
            )
            .enumerate()
        {
            close("V", value.velocity[i], v, 1.0);
            close("V'", value.rate[i], rate, 1.0);
            close("force", force[i], tau, 10.0);
        }
        assert!(force.dot(&velocity).abs() < 1e-11, "the coupling does work");
    }
}

#[test]
fn acceleration_of_the_point_becomes_drive_and_steering() {
    for case in read("pvfc.json")["mapping"].as_array().unwrap() {
        let state = BikeState::upright(Pose2::new(0.3, -0.2, f(&case["theta"])), f(&case["v"]));
        let m = Measurement {
            steer: f(&case["psi"]),
            ..Measurement::ideal(&state, 0.0)
        };
        let look_ahead = LookAhead {
            distance: f(&case["ell"]),
            wheelbase: f(&case["wheelbase"]),
            speed_floor: 0.25,
        };
        let [ax, ay] = array(&case["accel_P"]);
        let forward = look_ahead.forward_acceleration(&m, Vector2::new(ax, ay));
        let yaw = look_ahead.yaw_acceleration(&m, Vector2::new(ax, ay));
        close("v'", forward, f(&case["v_dot"]), 0.1);
        close("omega'", yaw, f(&case["omega_dot"]), 0.1);
        close(
            "psi'",
            look_ahead.steer_rate(&m, forward, yaw),
            f(&case["psi_dot"]),
            0.1,
        );
    }
}

#[test]
fn the_demo_course_is_tabulated_with_its_speed_profile() {
    let file = read("demo_path.json");
    let params = FollowParams {
        track: Track::LookAheadPoint,
        // The vector lists the curvature as it is.
        curvature_window: 0.0,
        ..FollowParams::default()
    };
    let limits = RideLimits {
        wheelbase: 1.12,
        steer_rate: 2.0,
        lateral_acceleration: 0.5 * 0.7 * 9.81,
        curvature: 0.9,
    };
    let path =
        FollowedPath::new(&common::demo_course(), &params, &limits, params.look_ahead).unwrap();
    // Both tables divide the arc length, so 1e-3 covers how each measured it.
    assert!((path.length() - f(&file["length"])).abs() < 1e-3);
    for want in file["samples"].as_array().unwrap() {
        let got = path.sample(f(&want["s"]));
        assert!((got.position.x - f(&want["x"])).abs() < 1e-3);
        assert!((got.position.y - f(&want["y"])).abs() < 1e-3);
        assert!((got.heading - f(&want["theta"])).abs() < 1e-3);
        assert!((got.curvature - f(&want["kappa"])).abs() < 1e-3);
        assert!(
            (got.speed - f(&want["v"])).abs() < 1e-3,
            "at {}: {}",
            want["s"],
            got.speed
        );
    }
}
