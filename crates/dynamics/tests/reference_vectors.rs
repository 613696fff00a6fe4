//! The models against reference vectors of independent origin; how each was computed stands
//! in `tests/data/vectors/README.md`. Nothing there shares an equation with this crate: the
//! two-link numbers come from symbolic differentiation, those of the bike from a
//! seven-coordinate Lagrangian with multipliers.

use bikebot_dynamics::{
    Bike, BikeInput, BikeParams, BikeState, Integrator, Offset, Plant, Rk4, State, TwoLink,
    TwoLinkInput, TwoLinkState,
};
use bikebot_geometry::Pose2;
use serde_json::Value;

/// Relative tolerance of a single evaluation, as suggested with the vectors.
const SINGLE: f64 = 1e-10;

fn vectors(file: &str) -> Value {
    let path = format!(
        "{}/../../tests/data/vectors/{file}",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("no number {key} in {value}"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

#[track_caller]
fn close(what: &str, got: f64, want: f64, tolerance: f64) {
    // Relative to at least one unit: sums of terms of order 1 to 100 that cancel.
    let error = (got - want).abs() / want.abs().max(1.0);
    assert!(
        error <= tolerance,
        "{what}: got {got}, want {want}, relative error {error:e}"
    );
}

fn params(vector: &Value) -> BikeParams {
    let n = |key| number(vector, key);
    BikeParams {
        m1: n("m1"),
        h1: n("h1"),
        x1: n("x1"),
        i1x: n("I1x"),
        i1y: n("I1y"),
        i1z: n("I1z"),
        i1xz: n("I1xz"),
        m2: n("m2"),
        l: n("l"),
        x2: n("x2"),
        i2x: n("I2x"),
        i2y: n("I2y"),
        i2z: n("I2z"),
        flywheel_offset: n("d_flywheel"),
        balancer_offset: n("d_balancer"),
        wheelbase: n("w"),
        wheel_radius: n("rw"),
        friction: n("mu"),
        balancer_torque_max: n("tau_max"),
        balancer_speed_max: n("bdot_max"),
        steer_max_deg: n("psi_max").to_degrees(),
        steer_rate_max: n("psidot_max"),
        steer_lag: 0.03,
        drive_force_max: n("F_max"),
    }
}

fn preset(name: &str) -> BikeParams {
    match name {
        "default" => BikeParams::default(),
        "lowpivot" => BikeParams::low_pivot(),
        other => panic!("unknown parameter set {other}"),
    }
}

#[test]
fn the_presets_are_the_parameter_sets_of_the_vectors() {
    let sets = &vectors("two_link.json")["parameters"];
    assert_eq!(params(&sets["default"]), BikeParams::default());
    assert_eq!(params(&sets["lowpivot"]), BikeParams::low_pivot());
}

#[test]
fn the_two_link_model_agrees_with_the_symbolic_lagrangian() {
    let file = vectors("two_link.json");
    let cases = file["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 24);
    for case in cases {
        let n = |key| number(case, key);
        let model = TwoLink::new(&preset(case["params"].as_str().unwrap()), n("d"));
        let state = TwoLinkState {
            roll: n("alpha"),
            balancer: n("beta"),
            roll_rate: n("alpha_dot"),
            balancer_rate: n("beta_dot"),
        };
        let mass = model.mass_matrix(state.balancer);
        let coriolis = model.coriolis(&state);
        let gravity = model.gravity(&state);
        let input = TwoLinkInput {
            balancer_torque: n("tau_in"),
            roll_moment: 0.0,
        };
        let accelerations = model.accelerations(&state, &input);
        for i in 0..2 {
            for j in 0..2 {
                close("M", mass[(i, j)], case["M"][i][j].as_f64().unwrap(), SINGLE);
            }
            close(
                "coriolis",
                coriolis[i],
                case["coriolis"][i].as_f64().unwrap(),
                SINGLE,
            );
            close(
                "gravity",
                gravity[i],
                case["gravity"][i].as_f64().unwrap(),
                SINGLE,
            );
            let want = case["accel_for_tau_in"][i].as_f64().unwrap();
            close("acceleration", accelerations[i], want, SINGLE);
        }
        close(
            "kinetic",
            model.kinetic_energy(&state),
            n("kinetic"),
            SINGLE,
        );
        close(
            "potential",
            model.potential_energy(&state),
            n("potential"),
            SINGLE,
        );
        close("sigma", model.momentum(&state), n("sigma"), SINGLE);
        close(
            "sigma rate",
            model.momentum_rate(&state, 0.0),
            n("sigma_dot"),
            SINGLE,
        );
    }
}

#[test]
fn the_linearisation_and_its_numbers_agree() {
    let file = vectors("two_link_linear.json");
    for case in file.as_array().unwrap() {
        let bike = preset(case["params"].as_str().unwrap());
        let d = number(case, "d");
        let lumped = bike.lumped(d);
        close("a0", lumped.a0, number(case, "a0"), SINGLE);
        close("a2", lumped.a2, number(case, "a2"), SINGLE);
        close("a3", lumped.a3, number(case, "a3"), SINGLE);
        close("b1", lumped.b1, number(case, "b1"), SINGLE);
        close("b2", lumped.b2, number(case, "b2"), SINGLE);
        close(
            "D",
            bike.upright_decoupling(d),
            number(case, "D_upright"),
            SINGLE,
        );
        close(
            "lambda",
            bike.roll_rate(d),
            number(case, "lambda_roll"),
            SINGLE,
        );

        let linear = TwoLink::new(&bike, d).linearisation();
        for i in 0..4 {
            close("B", linear.b[i], case["B"][i].as_f64().unwrap(), SINGLE);
            for j in 0..4 {
                close(
                    "A",
                    linear.a[(i, j)],
                    case["A"][i][j].as_f64().unwrap(),
                    SINGLE,
                );
            }
        }
        // λ solves λ⁴ − tr(K) λ² + det(K) = 0 with K the lower left block of A.
        let k = linear.a.fixed_view::<2, 2>(2, 0);
        for lambda in numbers(&case["eigenvalues"]) {
            let square = lambda * lambda;
            let residual = square * square - k.trace() * square + k.determinant();
            // Scaled by the largest term; the eigenvalues are double precision.
            let scale = square * square + k.trace().abs() * square + 1.0;
            assert!(
                (residual / scale).abs() < 1e-12,
                "eigenvalue {lambda}: {residual:e}"
            );
        }
    }
}

#[test]
fn the_bike_agrees_with_the_multiplier_model() {
    let file = vectors("bike3d.json");
    let cases = file["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 12);
    for case in cases {
        let bike = Bike::new(BikeParams {
            i1xz: number(case, "I1xz"),
            ..params(&file["parameters"])
        });
        let s = |key| number(&case["state"], key);
        let state = BikeState {
            pose: Pose2::new(s("x"), s("y"), s("th")),
            steer: s("psi"),
            roll: s("al"),
            balancer: s("be"),
            speed: s("v"),
            roll_rate: s("ald"),
            balancer_rate: s("bed"),
        };
        let n = |key| number(case, key);
        let input = BikeInput {
            drive_force: n("F_drive"),
            steer_rate: n("psi_dot"),
            balancer_torque: n("tau"),
            roll_moment: n("T_ext_roll"),
            offset: Offset::fixed(n("d")),
            ..BikeInput::default()
        };
        let a = bike.accelerations(&state, &input);
        close("omega", bike.yaw_rate(&state), n("omega"), SINGLE);
        close("v_dot", a.speed, n("v_dot"), SINGLE);
        close("omega_dot", a.yaw, n("omega_dot"), SINGLE);
        close("alpha_ddot", a.roll, n("alpha_ddot"), SINGLE);
        close("beta_ddot", a.balancer, n("beta_ddot"), SINGLE);
        let forces = bike.contact_forces(&state, &input);
        close(
            "F_rear_lateral",
            forces.rear_lateral,
            n("F_rear_lateral"),
            SINGLE,
        );
        close(
            "F_front_normal",
            forces.front_normal,
            n("F_front_normal"),
            SINGLE,
        );
        close("N_front", forces.front_load, n("N_front"), SINGLE);
        close("N_rear", forces.rear_load, n("N_rear"), SINGLE);
        close(
            "kinetic",
            bike.kinetic_energy(&state, &input.offset),
            n("kinetic"),
            SINGLE,
        );
        close(
            "potential",
            bike.potential_energy(&state, &input.offset),
            n("potential"),
            SINGLE,
        );
    }
}

/// The bike under the open-loop inputs of `bike3d_trajectory.json`, which vary in time.
struct OpenLoop(Bike);

impl Plant for OpenLoop {
    type State = BikeState;
    type Input = BikeInput;
    fn rate(&self, t: f64, state: &BikeState, held: &BikeInput) -> <BikeState as State>::Rate {
        let input = BikeInput {
            steer_rate: 0.2 * t.cos(),
            balancer_torque: -3.0 * (2.0 * t).sin(),
            ..*held
        };
        self.0.rate(t, state, &input)
    }
}

fn trajectory_error(steps_per_sample: u32) -> f64 {
    let file = vectors("bike3d_trajectory.json");
    assert_eq!(file["tau"], "-3 sin(2 t)");
    assert_eq!(file["psi_dot"], "0.2 cos t");
    // The run belongs to the default set, without the product of inertia of bike3d.json.
    let plant = OpenLoop(Bike::new(BikeParams::default()));
    let held = BikeInput {
        drive_force: number(&file, "F_drive"),
        offset: Offset::fixed(number(&file, "d")),
        ..BikeInput::default()
    };
    let rows: Vec<Vec<f64>> = file["z"].as_array().unwrap().iter().map(numbers).collect();
    let times = numbers(&file["t"]);
    let z = &rows[0];
    let mut state = BikeState {
        pose: Pose2::new(z[0], z[1], z[2]),
        roll: z[3],
        balancer: z[4],
        speed: z[5],
        roll_rate: z[6],
        balancer_rate: z[7],
        steer: z[8],
    };
    let mut worst = 0.0_f64;
    for (row, span) in rows[1..].iter().zip(times.windows(2)) {
        let dt = (span[1] - span[0]) / f64::from(steps_per_sample);
        for i in 0..steps_per_sample {
            state = Rk4.step(&plant, span[0] + f64::from(i) * dt, &state, &held, dt);
        }
        let got = [
            state.pose.position.x,
            state.pose.position.y,
            state.pose.heading,
            state.roll,
            state.balancer,
            state.speed,
            state.roll_rate,
            state.balancer_rate,
            state.steer,
        ];
        for (got, want) in got.iter().zip(row) {
            worst = worst.max((got - want).abs());
        }
    }
    worst
}

#[test]
fn runge_kutta_rides_the_reference_trajectory() {
    let error = trajectory_error(200);
    assert!(error < 1e-8, "largest error {error:e}");
}

#[test]
fn runge_kutta_is_of_fourth_order_on_the_bike() {
    // Steps of 20 and 10 ms: large enough that rounding and the reference do not show.
    let order = (trajectory_error(5) / trajectory_error(10)).log2();
    assert!(order > 3.8, "measured order {order}");
}
