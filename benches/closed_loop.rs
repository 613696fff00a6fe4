//! Claim: the closed loop with the 3D bike (plant 2.5 ms, control 5 ms) runs at least 100 times faster than
//! real time, and a planned ride takes well under a second.
//!
//! `one_simulated_second` is the loop alone on the reference course; the group's baseline is one second of
//! bare plant integration (no controller, no recorder), measured in the same run: the ratio of the two is
//! what the loop adds to the physics.

use bikebot::dynamics::{Bike, BikeInput, BikeParams, BikeState, Integrator, Rk4};
use bikebot::geometry::Pose2;
use bikebot::sim::{Override, RunControl, ScenarioFile, Setup, run};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::path::PathBuf;

fn setup(name: &str, overrides: &[Override]) -> Setup {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let text = std::fs::read_to_string(folder.join(name)).expect("a shipped scenario");
    let file = ScenarioFile::parse(&text, overrides).expect("a valid scenario");
    Setup::resolve(&file, &mut |name| {
        std::fs::read(folder.join(name)).map_err(|error| error.to_string())
    })
    .expect("a scenario that resolves")
}

fn play(setup: &Setup) -> String {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(setup, &mut (), control).expect("a run").result_hash
}

fn closed_loop(c: &mut Criterion) {
    let mut group = c.benchmark_group("closed_loop");
    group.throughput(Throughput::Elements(1));
    group.bench_function("plant_only_one_second", |b| {
        let bike = Bike::new(BikeParams::default());
        let input = BikeInput::default();
        b.iter(|| {
            let mut state = BikeState::upright(Pose2::new(0.0, 0.0, 0.0), 1.0);
            for step in 0..400 {
                state = Rk4.step(
                    &bike,
                    f64::from(step) * 0.0025,
                    &state,
                    black_box(&input),
                    0.0025,
                );
            }
            state
        });
    });
    let one_second = setup("course.toml", &[Override::new("run.duration_s", 1.0)]);
    group.bench_function("one_simulated_second", |b| {
        b.iter(|| play(black_box(&one_second)))
    });
    group.finish();

    let mut group = c.benchmark_group("whole_run");
    group.sample_size(10);
    let fig7 = setup("fig7.toml", &[]);
    group.bench_function("fig7", |b| b.iter(|| play(black_box(&fig7))));
    group.finish();
}

criterion_group!(benches, closed_loop);
criterion_main!(benches);
