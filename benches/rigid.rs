//! Claim: the rigid-body plant at 1 kHz with control at 200 Hz runs at least 20 times faster than real time on one core.
//!
//! `one_second_on_bike3d` is the same ride on the simplified bike, measured in the same run: the ratio of the two
//! is what the rigid bodies cost. `plant_only_one_second` is a thousand steps without controller or recorder,
//! with four and with two solver iterations.

use bikebot::dynamics::rigid::{RigidBike, RigidStep};
use bikebot::dynamics::{BikeInput, BikeParams, BikeState, Offset, SteeringGeometry};
use bikebot::geometry::Pose2;
use bikebot::sim::{Override, RunControl, ScenarioFile, Setup, run};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::path::PathBuf;

fn setup(model: &str) -> Setup {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios/course.toml");
    let text = std::fs::read_to_string(path).expect("a shipped scenario");
    let overrides = [
        Override::new("run.duration_s", 1.0),
        Override::new("plant.model", model),
    ];
    let file = ScenarioFile::parse(&text, &overrides).expect("a valid scenario");
    Setup::resolve(&file, &mut |name| Err(format!("no file {name}"))).expect("it resolves")
}

fn play(setup: &Setup) -> String {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(setup, &mut (), control).expect("a run").result_hash
}

fn rigid(c: &mut Criterion) {
    let mut group = c.benchmark_group("rigid");
    group.throughput(Throughput::Elements(1));
    group.sample_size(20);
    for iterations in [2, 4] {
        let id = BenchmarkId::new("plant_only_one_second", iterations);
        group.bench_function(id, |b| {
            let params = BikeParams::default();
            let geometry = SteeringGeometry::Realistic;
            let state = BikeState::upright(Pose2::new(0.0, 0.0, 0.0), 1.0);
            let step = RigidStep {
                iterations,
                ..RigidStep::default()
            };
            b.iter(|| {
                let mut bike = RigidBike::new(&params, geometry, &state, &Offset::fixed(0.0), step)
                    .expect("the default bike");
                for _ in 0..1000 {
                    bike.step(black_box(&BikeInput::default()));
                }
                *bike.state()
            });
        });
    }
    for model in ["bike3d", "rapier3d"] {
        let setup = setup(model);
        group.bench_function(format!("one_second_on_{model}"), |b| {
            b.iter(|| play(black_box(&setup)))
        });
    }
    group.finish();
}

criterion_group!(benches, rigid);
criterion_main!(benches);
