//! Left alone, a plant keeps its energy: no motor, no slope, no push for a minute. And the integrator is of the fourth
//! order on the plants themselves, not only on a pendulum.
//!
//! The models have no ground to fall on: they tumble through, which is the fastest motion there is.

use bikebot_dynamics::{
    Bike, BikeInput, BikeParams, BikeState, Integrator, Offset, Plant, Rk4, TwoLink, TwoLinkInput,
    TwoLinkState,
};
use bikebot_geometry::Pose2;

/// A minute at the step every scenario has unless it says otherwise, s.
const STEP: f64 = 2.5e-3;
const MINUTE: u32 = 24_000;

/// Largest change of the energy within a minute, as a share of `scale` (J).
fn drift<P: Plant>(
    plant: &P,
    start: P::State,
    input: impl Fn(f64) -> P::Input,
    energy: impl Fn(&P::State) -> f64,
    scale: f64,
) -> f64
where
    P::State: Copy,
{
    let mut state = start;
    let mut worst = 0.0_f64;
    for i in 0..MINUTE {
        let t = f64::from(i) * STEP;
        state = Rk4.step(plant, t, &state, &input(t), STEP);
        let change = (energy(&state) - energy(&start)).abs();
        assert!(change.is_finite(), "at {t} s");
        worst = worst.max(change);
    }
    worst / scale
}

/// `log₂` of how much smaller the error of half the step is, against a step a sixteenth of it.
fn order<P: Plant>(
    plant: &P,
    start: P::State,
    input: &P::Input,
    distance: impl Fn(&P::State, &P::State) -> f64,
) -> f64
where
    P::State: Copy,
{
    let end = |steps: u32| {
        let dt = 1.0 / f64::from(steps);
        (0..steps).fold(start, |state, i| {
            Rk4.step(plant, f64::from(i) * dt, &state, input, dt)
        })
    };
    let exact = end(6400);
    (distance(&end(200), &exact) / distance(&end(400), &exact)).log2()
}

fn bike_start(speed: f64, steer: f64) -> BikeState {
    BikeState {
        roll: 0.05,
        balancer: 0.3,
        balancer_rate: 1.0,
        steer,
        ..BikeState::upright(Pose2::new(0.0, 0.0, 0.3), speed)
    }
}

#[test]
fn a_two_link_bike_left_alone_keeps_its_energy_for_a_minute() {
    let params = BikeParams::default();
    for offset in [0.0, 0.15] {
        let model = TwoLink::new(&params, offset);
        let start = TwoLinkState::from(&bike_start(0.0, 0.0));
        let scale = model.energy(&start).abs();
        let found = drift(
            &model,
            start,
            |_| TwoLinkInput::default(),
            |s| model.energy(s),
            scale,
        );
        assert!(found <= 1e-6, "d = {offset} m: {found:e}");
    }
}

#[test]
fn a_3d_bike_left_alone_keeps_its_energy_for_a_minute() {
    let bike = Bike::new(BikeParams::default());
    // Steering does no work either, so it may go to and fro.
    for (offset, steer, steer_rate) in [
        (0.0, 0.0, 0.0),
        (0.15, 0.0, 0.0),
        (0.0, 0.2, 0.0),
        (0.15, 0.1, 0.2),
    ] {
        let offset = Offset::fixed(offset);
        let start = bike_start(1.5, steer);
        let scale = bike.energy(&start, &offset).abs();
        let input = |t: f64| BikeInput {
            offset,
            steer_rate: steer_rate * t.cos(),
            ..BikeInput::default()
        };
        let found = drift(&bike, start, input, |s| bike.energy(s, &offset), scale);
        assert!(
            found <= 1e-6,
            "d = {} m, steer {steer}: {found:e}",
            offset.d
        );
    }
}

#[test]
fn the_step_is_of_fourth_order_on_the_two_link_bike() {
    for offset in [0.0, 0.15] {
        let model = TwoLink::new(&BikeParams::default(), offset);
        let start = TwoLinkState::from(&bike_start(0.0, 0.0));
        let input = TwoLinkInput {
            balancer_torque: 5.0,
            roll_moment: 2.0,
        };
        let distance =
            |a: &TwoLinkState, b: &TwoLinkState| (a.roll - b.roll).hypot(a.balancer - b.balancer);
        let found = order(&model, start, &input, distance);
        assert!((3.8..4.3).contains(&found), "d = {offset} m: {found}");
    }
}

#[test]
fn the_step_is_of_fourth_order_on_the_3d_bike() {
    let bike = Bike::new(BikeParams::default());
    for offset in [0.0, 0.15] {
        let input = BikeInput {
            drive_force: 10.0,
            balancer_torque: 5.0,
            steer_rate: 0.1,
            roll_moment: 2.0,
            offset: Offset::fixed(offset),
            ..BikeInput::default()
        };
        let distance = |a: &BikeState, b: &BikeState| {
            (a.pose.position - b.pose.position).norm()
                + (a.roll - b.roll).abs()
                + (a.balancer - b.balancer).abs()
        };
        let found = order(&bike, bike_start(1.5, 0.1), &input, distance);
        assert!((3.8..4.3).contains(&found), "d = {offset} m: {found}");
    }
}
