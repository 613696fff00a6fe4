//! Random problems of both kinds against an independent solver and against the optimality
//! conditions written from their definition.

mod common;

use bikebot_qp::{BandedQp, DenseQp, Settings};
use common::{
    Case, Chance, Flavour, assert_agreement, boxed_case, difference, random_case, spline_case,
};

const FLAVOURS: [Flavour; 3] = [Flavour::Hard, Flavour::Elastic, Flavour::Mixed];

/// Problems per flavour and kind.
const SEEDS: u64 = 60;

/// The conditions hold to some ten times the residual tolerance 1e-9: this check scales them
/// differently.
const KKT: f64 = 1e-8;

fn check_banded<const W: usize>(case: &Case, what: &str) -> bool {
    let mut qp: BandedQp<W> = case.banded();
    let summary = qp.solve(&Settings::default());
    assert!(summary.is_solved(), "{what}: {summary:?}");
    assert!(summary.iterations <= 40, "{what}: {summary:?}");
    let error = case.kkt_error(qp.x(), qp.multipliers(), qp.equality_multipliers(), &[]);
    assert!(error <= KKT, "{what}: KKT error {error:e}");
    check_report(case, qp.x(), &summary, what);
    assert_agreement(case, qp.x(), what)
}

fn check_dense(case: &Case, what: &str) -> bool {
    let mut qp: DenseQp = case.dense();
    let summary = qp.solve(&Settings::default());
    assert!(summary.is_solved(), "{what}: {summary:?}");
    assert!(summary.iterations <= 40, "{what}: {summary:?}");
    let error = case.kkt_error(
        qp.x(),
        qp.multipliers(),
        qp.equality_multipliers(),
        qp.box_multipliers(),
    );
    assert!(error <= KKT, "{what}: KKT error {error:e}");
    check_report(case, qp.x(), &summary, what);
    assert_agreement(case, qp.x(), what)
}

/// What the summary says of an answer is so.
fn check_report(case: &Case, x: &[f64], summary: &bikebot_qp::Summary, what: &str) {
    let size = 1.0 + case.objective_size(x);
    assert!(
        (summary.objective - case.objective(x)).abs() <= 1e-12 * size,
        "{what}"
    );
    assert!(
        (summary.primal_residual - case.violation(x).max(0.0)).abs() <= 1e-12,
        "{what}"
    );
    assert!(summary.gap.abs() <= 1e-9 * size, "{what}: {summary:?}");
}

#[test]
fn banded_programmes_have_the_oracles_optimum() {
    let mut compared = 0;
    for flavour in FLAVOURS {
        for equalities in [0, 3] {
            for seed in 0..SEEDS {
                let mut chance = Chance::new(seed);
                let (n, rows) = (chance.index(5, 80), chance.index(1, 60));
                let case = random_case(&mut chance, n, 8, rows, equalities, flavour);
                let what = format!("{flavour:?}, {equalities} equalities, seed {seed}");
                compared += usize::from(check_banded::<8>(&case, &what));
            }
        }
    }
    // the oracle reaches the sharper tolerance on nearly all
    assert!(compared >= 340, "x compared on {compared} of 360");
}

#[test]
fn a_window_narrower_or_wider_than_the_problem_is_as_good() {
    for seed in 0..20 {
        let mut chance = Chance::new(1000 + seed);
        let case = random_case(&mut chance, 30, 3, 25, 2, Flavour::Mixed);
        check_banded::<3>(&case, &format!("window 3, seed {seed}"));
        check_banded::<5>(&case, &format!("window 5, seed {seed}"));
        let case = random_case(&mut chance, 20, 1, 15, 0, Flavour::Mixed);
        check_banded::<1>(&case, &format!("window 1, seed {seed}"));
        let case = random_case(&mut chance, 4, 4, 6, 1, Flavour::Elastic);
        check_banded::<8>(
            &case,
            &format!("window wider than the problem, seed {seed}"),
        );
    }
}

#[test]
fn dense_programmes_have_the_oracles_optimum() {
    let mut compared = 0;
    for flavour in FLAVOURS {
        for equalities in [0, 3] {
            for seed in 0..SEEDS {
                let mut chance = Chance::new(seed);
                let (n, rows) = (chance.index(5, 41), chance.index(1, 101));
                let case = random_case(&mut chance, n, n, rows, equalities, flavour);
                let what = format!("{flavour:?}, {equalities} equalities, seed {seed}");
                compared += usize::from(check_dense(&case, &what));
            }
        }
    }
    assert!(compared >= 340, "x compared on {compared} of 360");
}

#[test]
fn dense_programmes_in_boxes_have_the_oracles_optimum() {
    let mut compared = 0;
    for flavour in FLAVOURS {
        for seed in 0..SEEDS {
            let mut chance = Chance::new(seed);
            let (n, rows) = (chance.index(3, 41), chance.index(1, 101));
            let case = boxed_case(&mut chance, n, rows, flavour);
            compared += usize::from(check_dense(&case, &format!("{flavour:?}, seed {seed}")));
        }
    }
    assert!(compared >= 160, "x compared on {compared} of 180");
}

#[test]
fn splines_among_obstacles_have_the_oracles_optimum() {
    for seed in 0..40 {
        let mut chance = Chance::new(seed);
        let (controls, rows) = (chance.index(20, 120), chance.index(5, 100));
        let case = spline_case(&mut chance, controls, rows);
        let mut qp = case.banded::<8>();
        let summary = qp.solve(&Settings::default());
        assert!(summary.is_solved(), "seed {seed}: {summary:?}");
        let oracle = case.oracle(1e-12);
        let (ours, theirs) = (case.objective(qp.x()), case.objective(&oracle.x));
        assert!((ours - theirs).abs() <= 1e-9 * theirs.abs(), "seed {seed}");
        // some 180 m of coordinates with a condition number of 1e6: 1e-5 is 2 mm
        let apart = difference(&oracle.x, qp.x());
        assert!(apart <= 1e-5, "seed {seed}: {apart:e}");
        assert!(
            case.violation(qp.x()) <= 1e-11,
            "the ends are met to rounding"
        );
    }
}

#[test]
fn the_two_solvers_agree_on_what_both_can_state() {
    for seed in 0..40 {
        let mut chance = Chance::new(500 + seed);
        let case = random_case(&mut chance, 24, 8, 30, 2, Flavour::Mixed);
        let (mut banded, mut dense) = (case.banded::<8>(), case.dense());
        assert!(banded.solve(&Settings::default()).is_solved());
        assert!(dense.solve(&Settings::default()).is_solved());
        assert!(difference(banded.x(), dense.x()) <= 1e-6, "seed {seed}");
    }
}

#[test]
fn a_start_near_the_answer_gives_the_same_answer_sooner() {
    let (mut cold, mut warm) = (0, 0);
    for seed in 0..20 {
        let mut chance = Chance::new(seed);
        let case = spline_case(&mut chance, 90, 60);
        let mut qp = case.banded::<8>();
        cold += qp.solve(&Settings::default()).iterations;
        let answer = qp.x().to_vec();
        let near: Vec<f64> = answer
            .iter()
            .map(|x| x + chance.between(-0.01, 0.01))
            .collect();
        qp.start_from(&near).unwrap();
        let summary = qp.solve(&Settings::default());
        assert!(summary.is_solved(), "seed {seed}: {summary:?}");
        assert!(difference(&answer, qp.x()) <= 1e-5, "seed {seed}");
        warm += summary.iterations;
    }
    assert!(warm < cold, "{warm} iterations warm, {cold} cold");
}
