//! Problems at the edge of sense: nothing to obey, too much to obey, no room, no scale, no numbers.

mod common;

use bikebot_qp::{BandedQp, Breakdown, DenseQp, QpError, Settings, Status};
use common::{Case, Chance, Flavour, boxed_case, difference, random_case, spline_case};
use proptest::prelude::*;

fn settings() -> Settings {
    Settings::default()
}

#[test]
fn without_rows_the_answer_is_the_linear_systems() {
    // H = [[2, 1], [1, 2]], g = (−4, −5): x = (1, 2)
    let mut banded = BandedQp::<2>::new(2, 0, 0);
    let mut dense = DenseQp::new(2, 0, 0);
    for (i, j, v) in [(0, 0, 2.0), (1, 0, 1.0), (1, 1, 2.0)] {
        banded.add_hessian(i, j, v).unwrap();
    }
    banded.add_gradient(0, -4.0).unwrap();
    banded.add_gradient(1, -5.0).unwrap();
    dense.set_hessian(&[2.0, 1.0, 1.0, 2.0]).unwrap();
    dense.set_gradient(&[-4.0, -5.0]).unwrap();
    for (summary, x) in [
        (banded.solve(&settings()), banded.x()),
        (dense.solve(&settings()), dense.x()),
    ] {
        assert!(summary.is_solved() && summary.iterations <= 1);
        // the dense solver's proximal term is 1e-12 of the diagonal
        assert!((x[0] - 1.0).abs() < 1e-11 && (x[1] - 2.0).abs() < 1e-11);
        assert!((summary.objective + 7.0).abs() < 1e-12);
    }
}

#[test]
fn with_equalities_only_the_answer_is_the_projection() {
    // nearest point of x₀ + x₁ + x₂ = 3 and x₀ = x₂ to the origin: (1, 1, 1)
    let mut qp = BandedQp::<1>::new(3, 0, 2);
    qp.add_diagonal(1.0).unwrap();
    qp.add_equality(&[(0, 1.0), (1, 1.0), (2, 1.0)], 3.0)
        .unwrap();
    qp.add_equality(&[(0, 1.0), (2, -1.0)], 0.0).unwrap();
    let summary = qp.solve(&settings());
    assert!(summary.is_solved() && summary.iterations <= 1);
    assert!(
        qp.x().iter().all(|x| (x - 1.0).abs() < 1e-14),
        "{:?}",
        qp.x()
    );
    assert!((qp.equality_multipliers()[0] + 1.0).abs() < 1e-10);
}

#[test]
fn an_elastic_row_costs_its_price_at_most() {
    // min ½x² + ρ max(0, 1 − x): x = min(ρ, 1), z = x
    for price in [0.25, 0.999, 1.0, 1.5, 1e6] {
        let mut qp = BandedQp::<1>::new(1, 1, 0);
        qp.add_diagonal(1.0).unwrap();
        qp.add_elastic_row(0, &[-1.0], -1.0, price).unwrap();
        assert!(qp.solve(&settings()).is_solved());
        assert!(
            (qp.x()[0] - price.min(1.0)).abs() < 1e-6,
            "{price}: {:?}",
            qp.x()
        );
        assert!((qp.multipliers()[0] - price.min(1.0)).abs() < 1e-5);
    }
}

#[test]
fn redundant_rows_and_equalities_change_nothing() {
    for seed in 0..20 {
        let mut chance = Chance::new(seed);
        let case = random_case(&mut chance, 25, 8, 20, 2, Flavour::Mixed);
        let mut doubled = case.clone();
        doubled
            .rows
            .extend(case.rows.iter().filter(|r| r.weight.is_infinite()).cloned());
        doubled.equalities.extend(case.equalities.iter().cloned());
        for (entries, target) in &case.equalities {
            let scaled = entries.iter().map(|&(i, v)| (i, -3.0 * v)).collect();
            doubled.equalities.push((scaled, -3.0 * target));
        }
        let (mut once, mut twice, mut dense) =
            (case.banded::<8>(), doubled.banded::<8>(), doubled.dense());
        assert!(once.solve(&settings()).is_solved());
        let summary = twice.solve(&settings());
        assert!(summary.is_solved(), "seed {seed}: {summary:?}");
        assert!(dense.solve(&settings()).is_solved(), "seed {seed}");
        assert!(difference(once.x(), twice.x()) <= 1e-6, "seed {seed}");
        assert!(difference(once.x(), dense.x()) <= 1e-6, "seed {seed}");
    }
}

#[test]
fn a_box_of_no_width_fixes_its_unknown_exactly() {
    let mut qp = DenseQp::new(2, 0, 0);
    qp.set_hessian(&[2.0, 1.0, 1.0, 2.0]).unwrap();
    qp.set_box(0, 0.1, 0.1).unwrap();
    let summary = qp.solve(&settings());
    assert!(summary.is_solved());
    assert_eq!(qp.x()[0], 0.1);
    assert!((qp.x()[1] + 0.05).abs() < 1e-12);
    // Hx + μ = 0
    assert!((qp.box_multipliers()[0] + 0.15).abs() < 1e-10);
    assert!(summary.dual_residual < 1e-10);
}

#[test]
fn a_hairs_width_of_a_box_is_enough() {
    for width in [1e-4, 1e-8, 1e-12] {
        let mut qp = DenseQp::new(3, 0, 0);
        qp.set_hessian(&[4.0, 1.0, 0.0, 1.0, 3.0, 1.0, 0.0, 1.0, 2.0])
            .unwrap();
        qp.set_gradient(&[1.0, -2.0, 3.0]).unwrap();
        qp.set_box(1, 0.5, 0.5 + width).unwrap();
        let summary = qp.solve(&settings());
        assert!(summary.is_solved(), "{width}: {summary:?}");
        // with x₁ = ½: x₀ = −3/8, x₂ = −7/4
        assert!((qp.x()[0] + 0.375).abs() <= width + 1e-8);
        assert!((qp.x()[2] + 1.75).abs() <= width + 1e-8);
    }
}

#[test]
fn all_unknowns_fixed_is_an_answer() {
    let mut qp = DenseQp::new(2, 0, 0);
    qp.set_hessian(&[1.0, 0.0, 0.0, 1.0]).unwrap();
    qp.set_box(0, 3.0, 3.0).unwrap();
    qp.set_box(1, -1.0, -1.0).unwrap();
    assert!(qp.solve(&settings()).is_solved());
    assert_eq!(qp.x(), [3.0, -1.0]);
    assert_eq!(qp.box_multipliers(), [-3.0, 1.0]);
}

#[test]
fn a_linear_programme_ends_in_its_corner() {
    // max x₀ + 2x₁ in the unit box under x₀ + x₁ ≤ 1.5: (½, 1)
    let mut qp = DenseQp::new(2, 1, 0);
    qp.set_gradient(&[-1.0, -2.0]).unwrap();
    qp.set_box(0, 0.0, 1.0).unwrap();
    qp.set_box(1, 0.0, 1.0).unwrap();
    qp.add_row(&[1.0, 1.0], 1.5).unwrap();
    let summary = qp.solve(&settings());
    assert!(summary.is_solved(), "{summary:?}");
    assert!((qp.x()[0] - 0.5).abs() < 1e-8 && (qp.x()[1] - 1.0).abs() < 1e-8);
    assert!((qp.multipliers()[0] - 1.0).abs() < 1e-7);
}

#[test]
fn a_programme_without_floor_is_unbounded() {
    let mut qp = DenseQp::new(2, 1, 0);
    qp.set_hessian(&[1.0, 0.0, 0.0, 0.0]).unwrap();
    qp.set_gradient(&[0.0, -1.0]).unwrap();
    qp.add_row(&[0.0, -1.0], 4.0).unwrap();
    assert_eq!(qp.solve(&settings()).status, Status::Unbounded);
}

#[test]
fn hard_rows_that_exclude_each_other_are_infeasible() {
    let mut banded = BandedQp::<2>::new(2, 3, 0);
    banded.add_diagonal(1.0).unwrap();
    banded.add_row(0, &[1.0, 1.0], 1.0).unwrap();
    banded.add_row(0, &[-1.0, -1.0], -2.0).unwrap();
    banded.add_elastic_row(0, &[1.0], -5.0, 3.0).unwrap();
    let summary = banded.solve(&settings());
    assert_eq!(summary.status, Status::Infeasible);
    assert!(summary.iterations < 30, "{summary:?}");

    let mut dense = DenseQp::new(2, 1, 0);
    dense.set_hessian(&[1.0, 0.0, 0.0, 1.0]).unwrap();
    dense.set_box(0, 2.0, 2.0).unwrap();
    dense.set_box(1, 0.0, 9.0).unwrap();
    dense.add_row(&[1.0, 1.0], 1.0).unwrap();
    assert_eq!(dense.solve(&settings()).status, Status::Infeasible);
}

#[test]
fn equalities_that_contradict_are_infeasible() {
    let mut qp = BandedQp::<2>::new(3, 0, 3);
    qp.add_diagonal(1.0).unwrap();
    qp.add_equality(&[(0, 1.0), (2, 1.0)], 1.0).unwrap();
    qp.add_equality(&[(0, 2.0), (2, 2.0)], 3.0).unwrap();
    assert_eq!(qp.solve(&settings()).status, Status::Infeasible);

    qp.reset(3).unwrap();
    qp.add_diagonal(1.0).unwrap();
    qp.add_equality(&[], 1.0).unwrap();
    assert_eq!(qp.solve(&settings()).status, Status::Infeasible);
}

#[test]
fn elastic_rows_never_make_a_programme_infeasible() {
    // far apart, dear, and both lost
    let mut qp = BandedQp::<1>::new(1, 2, 0);
    qp.add_diagonal(1.0).unwrap();
    qp.add_elastic_row(0, &[1.0], -1e9, 1e3).unwrap();
    qp.add_elastic_row(0, &[-1.0], -1e9, 1e3).unwrap();
    let summary = qp.solve(&settings());
    assert!(summary.is_solved(), "{summary:?}");
    assert!(qp.x()[0].abs() < 1e-3, "{:?}", qp.x());
}

#[test]
fn an_empty_row_is_judged_by_its_bound() {
    for (bound, status) in [(0.5, Status::Solved), (-0.5, Status::Infeasible)] {
        let mut qp = BandedQp::<2>::new(2, 2, 0);
        qp.add_diagonal(1.0).unwrap();
        qp.add_row(1, &[0.0], bound).unwrap();
        qp.add_elastic_row(0, &[], -1.0, 2.0).unwrap();
        assert_eq!(qp.solve(&settings()).status, status);
    }
}

#[test]
fn a_hessian_that_is_not_definite_is_reported() {
    let mut banded = BandedQp::<2>::new(2, 1, 0);
    let broken = Status::NumericalError(Breakdown::NotPositiveDefinite);
    assert_eq!(banded.solve(&settings()).status, broken, "H = 0");
    for (i, j, v) in [(0, 0, 1.0), (1, 0, 2.0), (1, 1, 1.0)] {
        banded.add_hessian(i, j, v).unwrap();
    }
    banded.add_row(0, &[1.0, 1.0], 0.0).unwrap();
    assert_eq!(banded.solve(&settings()).status, broken);
    assert!(banded.x().iter().all(|x| x.is_finite()));

    let mut dense = DenseQp::new(2, 0, 0);
    for h in [
        [1.0, 2.0, 2.0, 1.0],
        [0.0, 1.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0, 1.0],
    ] {
        dense.set_hessian(&h).unwrap();
        dense.set_box(0, -1.0, 1.0).unwrap();
        dense.set_box(1, -1.0, 1.0).unwrap();
        assert_eq!(dense.solve(&settings()).status, broken, "{h:?}");
    }
}

/// The case with unknown i measured in units of `units[i]`, rows multiplied by `rows[k]` and the
/// objective by `f`.
fn in_other_units(case: &Case, units: &[f64], rows: &[f64], f: f64) -> Case {
    let mut other = case.clone();
    for (i, j, v) in &mut other.hessian {
        *v *= f * units[*i] * units[*j];
    }
    for (g, u) in other.gradient.iter_mut().zip(units) {
        *g *= f * u;
    }
    for (row, r) in other.rows.iter_mut().zip(rows) {
        for (k, a) in row.a.iter_mut().enumerate() {
            *a *= r * units[row.first + k];
        }
        row.bound *= r;
        row.weight *= f / r;
    }
    for (entries, _) in &mut other.equalities {
        for (i, v) in entries {
            *v *= units[*i];
        }
    }
    for ((lower, upper), u) in other.boxes.iter_mut().zip(units) {
        (*lower, *upper) = (*lower / u, *upper / u);
    }
    other
}

#[test]
fn badly_scaled_problems_are_as_good_as_well_scaled_ones() {
    for seed in 0..30 {
        let mut chance = Chance::new(seed);
        let banded = random_case(&mut chance, 30, 8, 25, 2, Flavour::Mixed);
        let dense = boxed_case(&mut chance, 15, 25, Flavour::Mixed);
        let magnitude = |chance: &mut Chance| 10f64.powf(chance.between(-5.0, 5.0));
        let units: Vec<f64> = (0..30).map(|_| magnitude(&mut chance)).collect();
        let rows: Vec<f64> = (0..25).map(|_| magnitude(&mut chance)).collect();
        let f = 10f64.powf(chance.between(-12.0, 12.0));

        let (mut a, mut b) = (
            banded.banded::<8>(),
            in_other_units(&banded, &units, &rows, f).banded::<8>(),
        );
        assert!(a.solve(&settings()).is_solved());
        let summary = b.solve(&settings());
        assert!(summary.is_solved(), "seed {seed}: {summary:?}");
        let back: Vec<f64> = b.x().iter().zip(&units).map(|(x, u)| x * u).collect();
        assert!(difference(a.x(), &back) <= 1e-6, "seed {seed}");

        let (mut a, mut b) = (
            dense.dense(),
            in_other_units(&dense, &units, &rows, f).dense(),
        );
        assert!(a.solve(&settings()).is_solved());
        let summary = b.solve(&settings());
        assert!(summary.is_solved(), "seed {seed}: {summary:?}");
        let back: Vec<f64> = b.x().iter().zip(&units).map(|(x, u)| x * u).collect();
        assert!(difference(a.x(), &back) <= 1e-6, "seed {seed}");
    }
}

#[test]
fn scaling_by_powers_of_two_changes_no_bit() {
    for seed in 0..20 {
        let mut chance = Chance::new(seed);
        let case = random_case(&mut chance, 30, 8, 25, 2, Flavour::Mixed);
        // the objective by 4^7, so that its square root is a power of two as well
        let other = in_other_units(&case, &[1.0; 30], &[8.0; 25], 16384.0);
        let (mut a, mut b) = (case.banded::<8>(), other.banded::<8>());
        let (sa, sb) = (a.solve(&settings()), b.solve(&settings()));
        assert_eq!(sa.iterations, sb.iterations);
        assert_eq!(a.x(), b.x());
        assert_eq!(sa.objective * 16384.0, sb.objective);
    }
}

#[test]
fn the_same_problem_gives_the_same_bits() {
    for seed in 0..10 {
        let mut chance = Chance::new(seed);
        let (small, large) = (
            random_case(&mut chance, 10, 8, 12, 1, Flavour::Mixed),
            spline_case(&mut chance, 60, 40),
        );
        let mut fresh = large.banded::<8>();
        let first = fresh.solve(&settings());
        // a workspace that has held something else, larger and smaller, in between
        let mut used = BandedQp::<8>::new(200, 100, 8);
        for case in [&large, &small, &large] {
            case.fill_banded(&mut used);
            used.solve(&settings());
        }
        large.fill_banded(&mut used);
        let again = used.solve(&settings());
        assert_eq!(first, again);
        let bits = |x: &[f64]| x.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(fresh.x()), bits(used.x()));
        assert_eq!(bits(fresh.multipliers()), bits(used.multipliers()));
        assert_eq!(
            bits(fresh.equality_multipliers()),
            bits(used.equality_multipliers())
        );

        let case = boxed_case(&mut chance, 20, 30, Flavour::Mixed);
        let (mut a, mut b) = (case.dense(), case.dense());
        assert_eq!(a.solve(&settings()), b.solve(&settings()));
        a.solve(&settings());
        assert_eq!(bits(a.x()), bits(b.x()));
    }
}

#[test]
fn no_solve_takes_more_iterations_than_allowed() {
    let case = spline_case(&mut Chance::new(3), 60, 40);
    let mut qp = case.banded::<8>();
    for most in 0..8 {
        let summary = qp.solve(&Settings {
            max_iterations: most,
            ..settings()
        });
        assert_eq!(summary.status, Status::MaxIterations);
        assert_eq!(summary.iterations, most);
        assert!(qp.x().iter().all(|x| x.is_finite()));
    }
    // a tolerance nothing can meet ends there too
    let summary = qp.solve(&Settings {
        residual_tolerance: 0.0,
        gap_tolerance: f64::NAN,
        max_iterations: 100,
    });
    assert_eq!(summary.iterations, 100);
    assert!(
        summary.dual_residual < 1e-8,
        "and does no harm: {summary:?}"
    );
}

#[test]
fn input_that_makes_no_sense_is_refused_and_changes_nothing() {
    let mut qp = BandedQp::<3>::new(4, 1, 1);
    qp.add_diagonal(1.0).unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(
            qp.add_hessian(0, 0, bad),
            Err(QpError::NotFinite { .. })
        ));
        assert!(matches!(
            qp.add_diagonal(bad),
            Err(QpError::NotFinite { .. })
        ));
        assert!(matches!(
            qp.add_gradient(0, bad),
            Err(QpError::NotFinite { .. })
        ));
        assert!(qp.add_square(0, &[bad], 0.0, 1.0).is_err());
        assert!(qp.add_square(0, &[1.0], bad, 1.0).is_err());
        assert!(qp.add_square(0, &[1.0], 0.0, bad).is_err());
        assert!(qp.add_row(0, &[1.0, bad], 0.0).is_err());
        assert!(qp.add_row(0, &[1.0], bad).is_err());
        assert!(matches!(
            qp.add_elastic_row(0, &[1.0], 0.0, bad),
            Err(QpError::Weight { .. })
        ));
        assert!(qp.add_equality(&[(0, bad)], 0.0).is_err());
        assert!(qp.add_equality(&[(0, 1.0)], bad).is_err());
        assert!(qp.start_from(&[0.0, 0.0, 0.0, bad]).is_err());
    }
    assert!(qp.add_elastic_row(0, &[1.0], 0.0, 0.0).is_err());
    assert!(matches!(
        qp.add_hessian(0, 3, 1.0),
        Err(QpError::OutsideBand { .. })
    ));
    assert!(matches!(
        qp.add_hessian(4, 4, 1.0),
        Err(QpError::IndexOutOfRange { .. })
    ));
    assert!(matches!(
        qp.add_gradient(4, 1.0),
        Err(QpError::IndexOutOfRange { .. })
    ));
    for (first, length) in [(0, 4), (2, 3), (4, 0), (usize::MAX, 1)] {
        assert!(matches!(
            qp.add_row(first, &vec![1.0; length], 0.0),
            Err(QpError::WindowOutOfRange { .. })
        ));
    }
    assert!(qp.start_from(&[0.0]).is_err());
    assert_eq!(qp.reset(0), Err(QpError::NoUnknowns));
    assert!(matches!(
        qp.reset(5),
        Err(QpError::Full {
            what: "unknowns",
            ..
        })
    ));
    assert_eq!(qp.rows(), 0);
    assert!(qp.solve(&settings()).is_solved());
    assert_eq!(qp.x(), [0.0; 4]);

    qp.add_row(0, &[1.0], 0.0).unwrap();
    assert!(matches!(
        qp.add_row(0, &[1.0], 0.0),
        Err(QpError::Full { .. })
    ));
    qp.add_equality(&[(0, 1.0)], 0.0).unwrap();
    assert!(qp.add_equality(&[(9, 1.0)], 0.0).is_err());
    assert!(matches!(
        qp.add_equality(&[(0, 1.0)], 0.0),
        Err(QpError::Full { .. })
    ));

    let mut dense = DenseQp::new(2, 1, 1);
    assert!(matches!(
        dense.set_hessian(&[1.0]),
        Err(QpError::Dimension { .. })
    ));
    assert!(matches!(
        dense.set_hessian(&[1.0, 0.5, 0.0, 1.0]),
        Err(QpError::NotSymmetric { .. })
    ));
    assert!(dense.set_hessian(&[1.0, 0.0, 0.0, f64::NAN]).is_err());
    assert!(dense.set_gradient(&[f64::NAN, 0.0]).is_err());
    for (lower, upper) in [
        (1.0, 0.0),
        (f64::NAN, 0.0),
        (0.0, f64::NAN),
        (f64::INFINITY, f64::INFINITY),
        (f64::NEG_INFINITY, f64::NEG_INFINITY),
    ] {
        assert!(matches!(
            dense.set_box(0, lower, upper),
            Err(QpError::EmptyBox { .. })
        ));
    }
    assert!(matches!(
        dense.set_box(2, 0.0, 1.0),
        Err(QpError::IndexOutOfRange { .. })
    ));
    assert!(dense.add_row(&[1.0], 0.0).is_err());
    assert!(matches!(
        dense.set_bound(0, 1.0),
        Err(QpError::NoSuchRow { .. })
    ));
    assert!(dense.add_equality(&[1.0, f64::INFINITY], 0.0).is_err());
    dense.add_row(&[1.0, 0.0], 0.0).unwrap();
    dense.set_bound(0, 1.0).unwrap();
    assert!(matches!(
        dense.add_row(&[1.0, 0.0], 0.0),
        Err(QpError::Full { .. })
    ));
}

#[test]
fn a_hessian_that_overflows_in_the_making_is_reported() {
    let mut qp = BandedQp::<2>::new(2, 0, 0);
    qp.add_diagonal(1.0).unwrap();
    qp.add_square(0, &[1e200, 1e200], 1e200, 1e200).unwrap();
    let summary = qp.solve(&settings());
    assert_eq!(summary.status, Status::NumericalError(Breakdown::NotFinite));
    assert_eq!(qp.x(), [0.0, 0.0]);
    assert!(!summary.objective.is_nan() && !summary.gap.is_nan());
}

/// Found by chance: two rows that pull a fixed unknown either way with forces beyond the largest number left ∞ − ∞ as the
/// multiplier of its box.
#[test]
fn rows_that_overflow_against_each_other_leave_no_nan_in_a_box_multiplier() {
    let mut qp = DenseQp::new(4, 2, 0);
    let mut h = [0.0; 16];
    h[15] = 1.0;
    qp.set_hessian(&h).unwrap();
    qp.set_gradient(&[0.0, -8.552_931_541_423_038e153, 0.0, 0.0])
        .unwrap();
    for along in [-4.582_196_268_118_291e258, 1.216_841_008_844_951_6e184] {
        qp.add_row(&[0.0, 0.0, along, 0.0], 0.0).unwrap();
    }
    for i in 0..4 {
        qp.set_box(i, 0.0, 0.0).unwrap();
    }
    qp.solve(&settings());
    assert_eq!(qp.x(), [0.0; 4]);
    assert!(qp.box_multipliers().iter().all(|v| !v.is_nan()));
}

/// Any finite number at all, of any size.
fn any_size() -> impl Strategy<Value = f64> {
    prop_oneof![
        -3.0..3.0f64,
        Just(0.0),
        (-300.0..300.0f64, any::<bool>()).prop_map(|(e, s)| if s {
            10f64.powf(e)
        } else {
            -(10f64.powf(e))
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn whatever_finite_numbers_go_in_no_nan_and_no_panic_come_out(
        diagonal in proptest::collection::vec(any_size(), 4),
        beside in proptest::collection::vec(any_size(), 3),
        gradient in proptest::collection::vec(any_size(), 4),
        rows in proptest::collection::vec((0usize..3, any_size(), any_size(), any_size(), any_size()), 0..5),
        equalities in proptest::collection::vec((0usize..4, any_size(), 0usize..4, any_size(), any_size()), 0..3),
        sides in proptest::collection::vec((any_size(), any_size()), 4),
    ) {
        let mut banded = BandedQp::<2>::new(4, 5, 3);
        let mut dense = DenseQp::new(4, 5, 3);
        let mut h = [0.0; 16];
        for (i, d) in diagonal.iter().enumerate() {
            banded.add_hessian(i, i, d.abs()).unwrap();
            h[5 * i] = d.abs();
        }
        for (i, &b) in beside.iter().enumerate() {
            banded.add_hessian(i + 1, i, b).unwrap();
            (h[4 * i + i + 1], h[4 * (i + 1) + i]) = (b, b);
        }
        for (i, &g) in gradient.iter().enumerate() {
            banded.add_gradient(i, g).unwrap();
        }
        dense.set_hessian(&h).unwrap();
        dense.set_gradient(&gradient).unwrap();
        for &(first, a, b, bound, weight) in &rows {
            let mut full = [0.0; 4];
            full[first..first + 2].copy_from_slice(&[a, b]);
            if weight > 0.0 {
                banded.add_elastic_row(first, &[a, b], bound, weight).unwrap();
                dense.add_elastic_row(&full, bound, weight).unwrap();
            } else {
                banded.add_row(first, &[a, b], bound).unwrap();
                dense.add_row(&full, bound).unwrap();
            }
        }
        for &(i, a, j, b, target) in &equalities {
            // two entries of the same unknown may not add up to infinity: 1e300 at most each
            banded.add_equality(&[(i, a), (j, b)], target).unwrap();
            let mut full = [0.0; 4];
            full[i] += a;
            full[j] += b;
            dense.add_equality(&full, target).unwrap();
        }
        for (i, &(a, b)) in sides.iter().enumerate() {
            dense.set_box(i, a.min(b), a.max(b)).unwrap();
        }
        for (summary, x, z, y) in [
            (banded.solve(&settings()), banded.x(), banded.multipliers(), banded.equality_multipliers()),
            (dense.solve(&settings()), dense.x(), dense.multipliers(), dense.equality_multipliers()),
        ] {
            prop_assert!(x.iter().chain(z).chain(y).all(|v| v.is_finite()), "{:?}", summary);
            for v in [summary.objective, summary.primal_residual, summary.dual_residual, summary.gap] {
                prop_assert!(!v.is_nan(), "{:?}", summary);
            }
            prop_assert!(summary.iterations <= settings().max_iterations);
        }
        prop_assert!(dense.box_multipliers().iter().all(|v| !v.is_nan()));
    }

    #[test]
    fn no_point_that_obeys_is_better(seed in 0u64..1_000_000) {
        let mut chance = Chance::new(seed);
        let case = boxed_case(&mut chance, 6, 8, Flavour::Elastic);
        let mut qp = case.dense();
        let summary = qp.solve(&settings());
        prop_assert!(summary.is_solved(), "{:?}", summary);
        let size = 1.0 + case.objective_size(qp.x());
        for _ in 0..20 {
            let apart = 10f64.powf(chance.between(-4.0, 0.5));
            let other: Vec<f64> = qp
                .x()
                .iter()
                .zip(&case.boxes)
                .map(|(x, &(lower, upper))| (x + apart * chance.between(-1.0, 1.0)).clamp(lower, upper))
                .collect();
            prop_assert!(case.objective(&other) >= summary.objective - 1e-9 * size);
        }
    }
}
