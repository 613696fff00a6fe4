//! Claim: one step of the spline refinement (180 unknowns in a band of 8, 60 elastic rows, 6
//! equalities) takes at most 0.25 ms and a third of Clarabel's time; a predictive-control programme
//! (20 unknowns, boxes, 40 rows) fits many times into a control tick.
//!
//! Clarabel is measured in the same run at its default tolerance 1e-8 (ours: residuals 1e-9, gap
//! 1e-12). `clarabel` assembles its sparse matrices and sets up, as every new problem needs it to, and
//! compares with `filling included`; `clarabel, solve only` leaves that out. The answers have to
//! agree before anything is timed.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use bikebot_qp::Settings;
use clarabel::solver::IPSolver as _;
use common::{Case, Chance, Flavour, assert_agreement, boxed_case, spline_case};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};

fn spline(criterion: &mut Criterion) {
    let case = spline_case(&mut Chance::new(1), 90, 60);
    let settings = Settings::default();
    let mut qp = case.banded::<8>();
    assert!(qp.solve(&settings).is_solved());
    assert_agreement(&case, qp.x(), "bench");

    let mut group = criterion.benchmark_group("spline_180_unknowns_60_rows");
    group.bench_function("banded", |b| b.iter(|| black_box(qp.solve(&settings))));
    group.bench_function("banded, filling included", |b| {
        b.iter(|| {
            case.fill_banded(&mut qp);
            black_box(qp.solve(&settings))
        });
    });
    let near: Vec<f64> = qp
        .x()
        .iter()
        .enumerate()
        .map(|(i, x)| x + 0.01 * (i as f64).sin())
        .collect();
    group.bench_function("banded, warm", |b| {
        b.iter(|| {
            let _ = black_box(qp.start_from(&near));
            black_box(qp.solve(&settings))
        });
    });
    clarabel(&mut group, &case);
    group.finish();
}

fn predictive(criterion: &mut Criterion) {
    let case = boxed_case(&mut Chance::new(2), 20, 40, Flavour::Mixed);
    let settings = Settings::default();
    let mut qp = case.dense();
    assert!(qp.solve(&settings).is_solved());
    assert_agreement(&case, qp.x(), "bench");

    let mut group = criterion.benchmark_group("dense_20_unknowns_40_rows_boxes");
    group.bench_function("dense", |b| b.iter(|| black_box(qp.solve(&settings))));
    clarabel(&mut group, &case);
    group.finish();
}

fn clarabel(
    group: &mut criterion::BenchmarkGroup<'_, criterion::measurement::WallTime>,
    case: &Case,
) {
    group.bench_function("clarabel", |b| {
        b.iter(|| {
            let mut solver = case.clarabel(1e-8);
            solver.solve();
            black_box(solver.solution.obj_val)
        });
    });
    group.bench_function("clarabel, solve only", |b| {
        b.iter_batched_ref(
            || case.clarabel(1e-8),
            |solver| {
                solver.solve();
                black_box(solver.solution.obj_val)
            },
            BatchSize::SmallInput,
        );
    });
}

criterion_group!(benches, spline, predictive);
criterion_main!(benches);
