//! Problems with known properties, the oracle, and an independent check of optimality: shared by
//! the tests and the bench.
#![allow(dead_code, clippy::cast_precision_loss)]

use bikebot_qp::{BandedQp, DenseQp};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver as _, SolverStatus, SupportedConeT,
};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Uniform numbers from a seed.
pub struct Chance(ChaCha8Rng);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.0.next_u64() >> 11) as f64 * 2f64.powi(-53);
        low + (high - low) * unit
    }

    /// Uniform in low..high.
    pub fn index(&mut self, low: usize, high: usize) -> usize {
        (self.between(low as f64, high as f64) as usize).min(high - 1)
    }

    pub fn happens(&mut self, probability: f64) -> bool {
        self.between(0.0, 1.0) < probability
    }
}

/// a·x ≤ bound on unknowns `first..`, elastic if `weight` is finite.
#[derive(Debug, Clone)]
pub struct RowCase {
    pub first: usize,
    pub a: Vec<f64>,
    pub bound: f64,
    pub weight: f64,
}

impl RowCase {
    pub fn times(&self, x: &[f64]) -> f64 {
        self.a
            .iter()
            .zip(&x[self.first..])
            .map(|(a, x)| a * x)
            .sum()
    }
}

/// One problem in plain lists.
#[derive(Debug, Clone, Default)]
pub struct Case {
    pub n: usize,
    /// (i, j, value) with i ≥ j; repeated entries add up.
    pub hessian: Vec<(usize, usize, f64)>,
    pub gradient: Vec<f64>,
    pub rows: Vec<RowCase>,
    pub equalities: Vec<(Vec<(usize, f64)>, f64)>,
    /// Empty, or one per unknown.
    pub boxes: Vec<(f64, f64)>,
}

/// What the oracle says.
pub struct Oracle {
    pub status: SolverStatus,
    pub x: Vec<f64>,
}

impl Case {
    pub fn banded<const W: usize>(&self) -> BandedQp<W> {
        let mut qp = BandedQp::new(self.n, self.rows.len(), self.equalities.len());
        self.fill_banded(&mut qp);
        qp
    }

    pub fn fill_banded<const W: usize>(&self, qp: &mut BandedQp<W>) {
        qp.reset(self.n).unwrap();
        for &(i, j, v) in &self.hessian {
            qp.add_hessian(i, j, v).unwrap();
        }
        for (i, &g) in self.gradient.iter().enumerate() {
            qp.add_gradient(i, g).unwrap();
        }
        for row in &self.rows {
            if row.weight.is_finite() {
                qp.add_elastic_row(row.first, &row.a, row.bound, row.weight)
                    .unwrap();
            } else {
                qp.add_row(row.first, &row.a, row.bound).unwrap();
            }
        }
        for (entries, target) in &self.equalities {
            qp.add_equality(entries, *target).unwrap();
        }
    }

    pub fn dense(&self) -> DenseQp {
        let mut qp = DenseQp::new(self.n, self.rows.len(), self.equalities.len());
        self.fill_dense(&mut qp);
        qp
    }

    pub fn fill_dense(&self, qp: &mut DenseQp) {
        let n = self.n;
        qp.clear_rows();
        let mut h = vec![0.0; n * n];
        for &(i, j, v) in &self.hessian {
            h[i * n + j] += v;
            if i != j {
                h[j * n + i] += v;
            }
        }
        qp.set_hessian(&h).unwrap();
        qp.set_gradient(&self.gradient).unwrap();
        let mut full = vec![0.0; n];
        for row in &self.rows {
            full.fill(0.0);
            full[row.first..row.first + row.a.len()].copy_from_slice(&row.a);
            if row.weight.is_finite() {
                qp.add_elastic_row(&full, row.bound, row.weight).unwrap();
            } else {
                qp.add_row(&full, row.bound).unwrap();
            }
        }
        for (entries, target) in &self.equalities {
            full.fill(0.0);
            for &(i, v) in entries {
                full[i] += v;
            }
            qp.add_equality(&full, *target).unwrap();
        }
        for (i, &(lower, upper)) in self.boxes.iter().enumerate() {
            qp.set_box(i, lower, upper).unwrap();
        }
    }

    pub fn hessian_times(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.n];
        for &(i, j, v) in &self.hessian {
            out[i] += v * x[j];
            if i != j {
                out[j] += v * x[i];
            }
        }
        out
    }

    /// The objective with every elastic violation at its price.
    pub fn objective(&self, x: &[f64]) -> f64 {
        let hx = self.hessian_times(x);
        let mut f: f64 = x.iter().zip(&hx).map(|(x, h)| 0.5 * x * h).sum();
        f += x
            .iter()
            .zip(&self.gradient)
            .map(|(x, g)| x * g)
            .sum::<f64>();
        for row in self.rows.iter().filter(|r| r.weight.is_finite()) {
            f += row.weight * (row.times(x) - row.bound).max(0.0);
        }
        f
    }

    /// A size the objective's rounding is relative to: the sum of the terms' sizes.
    pub fn objective_size(&self, x: &[f64]) -> f64 {
        let hx = self.hessian_times(x);
        let quadratic: f64 = x.iter().zip(&hx).map(|(x, h)| 0.5 * x * h).sum();
        let linear: f64 = x.iter().zip(&self.gradient).map(|(x, g)| x * g).sum();
        let price: f64 = self
            .rows
            .iter()
            .filter(|r| r.weight.is_finite())
            .map(|r| r.weight * (r.times(x) - r.bound).max(0.0))
            .sum();
        quadratic.abs() + linear.abs() + price
    }

    /// The largest violation of what is hard.
    pub fn violation(&self, x: &[f64]) -> f64 {
        let mut worst = 0.0f64;
        for row in self.rows.iter().filter(|r| r.weight.is_infinite()) {
            worst = worst.max(row.times(x) - row.bound);
        }
        for (entries, target) in &self.equalities {
            let ax: f64 = entries.iter().map(|&(i, v)| v * x[i]).sum();
            worst = worst.max((ax - target).abs());
        }
        for (&(lower, upper), &x) in self.boxes.iter().zip(x) {
            worst = worst.max(lower - x).max(x - upper);
        }
        worst
    }

    /// Largest violation of the Karush–Kuhn–Tucker conditions, each relative to the size of what it
    /// compares; written from the definition.
    pub fn kkt_error(&self, x: &[f64], z: &[f64], y: &[f64], boxes: &[f64]) -> f64 {
        let mut gradient = self.hessian_times(x);
        let mut size: f64 = gradient.iter().fold(1e-300, |m, v| m.max(v.abs()));
        for (out, g) in gradient.iter_mut().zip(&self.gradient) {
            *out += g;
            size = size.max(g.abs());
        }
        let mut worst = 0.0f64;
        for (row, &z) in self.rows.iter().zip(z) {
            for (k, a) in row.a.iter().enumerate() {
                gradient[row.first + k] += a * z;
            }
            let norm = row.a.iter().map(|a| a * a).sum::<f64>().sqrt();
            size = size.max(norm * z.abs());
            worst = worst.max(-z * norm / size);
            if row.weight.is_finite() {
                worst = worst.max((z - row.weight) / row.weight);
            }
        }
        for ((entries, _), &y) in self.equalities.iter().zip(y) {
            for &(i, v) in entries {
                gradient[i] += v * y;
                size = size.max((v * y).abs());
            }
        }
        for (i, &m) in boxes.iter().enumerate() {
            gradient[i] += m;
            size = size.max(m.abs());
        }
        let stationarity = gradient.iter().fold(0.0f64, |m, v| m.max(v.abs())) / size;
        worst = worst.max(stationarity);

        // complementarity, relative to the objective
        let f = self.objective_size(x).max(1e-300);
        for (row, &z) in self.rows.iter().zip(z) {
            let slack = row.bound - row.times(x);
            worst = worst.max(z * slack / f);
            if row.weight.is_finite() {
                worst = worst.max((row.weight - z) * -slack / f);
            }
        }
        for ((&(lower, upper), &m), &x) in self.boxes.iter().zip(boxes).zip(x) {
            if upper > lower {
                let slack = if m > 0.0 { upper - x } else { x - lower };
                if slack.is_finite() {
                    worst = worst.max(m.abs() * slack / f);
                }
            }
        }
        let length = x.iter().fold(1e-300, |m: f64, v| m.max(v.abs()));
        worst.max(self.violation(x) / length)
    }

    /// The same problem for Clarabel: unknowns (x, e), equalities, then inequalities.
    pub fn clarabel(&self, tolerance: f64) -> DefaultSolver<f64> {
        let elastic: Vec<usize> = (0..self.rows.len())
            .filter(|&k| self.rows[k].weight.is_finite())
            .collect();
        let n = self.n + elastic.len();
        let mut q = self.gradient.clone();
        q.extend(elastic.iter().map(|&k| self.rows[k].weight));

        let (mut pi, mut pj, mut pv) = (vec![], vec![], vec![]);
        for &(i, j, v) in &self.hessian {
            pi.push(j.min(i));
            pj.push(j.max(i));
            pv.push(v);
        }
        let p = CscMatrix::new_from_triplets(n, n, pi, pj, pv);

        let (mut ai, mut aj, mut av, mut b) = (vec![], vec![], vec![], vec![]);
        let mut put = |i: usize, j: usize, v: f64| {
            ai.push(i);
            aj.push(j);
            av.push(v);
        };
        for (entries, target) in &self.equalities {
            for &(j, v) in entries {
                put(b.len(), j, v);
            }
            b.push(*target);
        }
        let equalities = b.len();
        let mut next_elastic = self.n;
        for row in &self.rows {
            for (k, &a) in row.a.iter().enumerate() {
                put(b.len(), row.first + k, a);
            }
            if row.weight.is_finite() {
                put(b.len(), next_elastic, -1.0);
                b.push(row.bound);
                put(b.len(), next_elastic, -1.0);
                b.push(0.0);
                next_elastic += 1;
            } else {
                b.push(row.bound);
            }
        }
        for (i, &(lower, upper)) in self.boxes.iter().enumerate() {
            if upper.is_finite() {
                put(b.len(), i, 1.0);
                b.push(upper);
            }
            if lower.is_finite() {
                put(b.len(), i, -1.0);
                b.push(-lower);
            }
        }
        let cones = [
            SupportedConeT::ZeroConeT(equalities),
            SupportedConeT::NonnegativeConeT(b.len() - equalities),
        ];
        let a = CscMatrix::new_from_triplets(b.len(), n, ai, aj, av);
        let settings = DefaultSettings {
            verbose: false,
            presolve_enable: false,
            tol_gap_abs: tolerance,
            tol_gap_rel: tolerance,
            tol_feas: tolerance,
            max_iter: 200,
            ..DefaultSettings::default()
        };
        DefaultSolver::new(&p, &q, &a, &b, &cones, settings).unwrap()
    }

    pub fn oracle(&self, tolerance: f64) -> Oracle {
        let mut solver = self.clarabel(tolerance);
        solver.solve();
        Oracle {
            status: solver.solution.status,
            x: solver.solution.x[..self.n].to_vec(),
        }
    }

    /// Adds ½ weight (a·x − target)².
    pub fn square(&mut self, first: usize, a: &[f64], target: f64, weight: f64) {
        for (i, ai) in a.iter().enumerate() {
            for (j, aj) in a[..=i].iter().enumerate() {
                self.hessian.push((first + i, first + j, weight * ai * aj));
            }
            self.gradient[first + i] -= weight * target * ai;
        }
    }
}

/// How the rows of a random case behave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flavour {
    /// Hard rows only.
    Hard,
    /// Elastic rows only, many of which cannot all be met.
    Elastic,
    /// Some of each.
    Mixed,
}

/// A strictly convex problem with rows on windows of `window` unknowns, of which at least x₀ meets
/// all that is hard.
pub fn random_case(
    chance: &mut Chance,
    n: usize,
    window: usize,
    rows: usize,
    equalities: usize,
    flavour: Flavour,
) -> Case {
    let mut case = Case {
        n,
        gradient: (0..n).map(|_| chance.between(-3.0, 3.0)).collect(),
        ..Case::default()
    };
    for i in 0..n {
        case.hessian.push((i, i, chance.between(0.05, 1.0)));
    }
    let vector = |chance: &mut Chance, first: usize| -> Vec<f64> {
        let length = chance.index(1, window.min(n - first) + 1);
        (0..length).map(|_| chance.between(-1.0, 1.0)).collect()
    };
    for _ in 0..n {
        let first = chance.index(0, n);
        let (a, target) = (vector(chance, first), chance.between(-2.0, 2.0));
        let weight = 10f64.powf(chance.between(-1.0, 1.5));
        case.square(first, &a, target, weight);
    }
    let x0: Vec<f64> = (0..n).map(|_| chance.between(-1.0, 1.0)).collect();
    for _ in 0..rows {
        let first = chance.index(0, n);
        let a = vector(chance, first);
        let mut row = RowCase {
            first,
            a,
            bound: 0.0,
            weight: f64::INFINITY,
        };
        let at = row.times(&x0);
        if flavour == Flavour::Elastic || flavour == Flavour::Mixed && chance.happens(0.5) {
            row.weight = 10f64.powf(chance.between(-1.0, 3.0));
            row.bound = at + chance.between(-1.5, 0.5);
        } else {
            // a third of them tight at x₀
            row.bound = at + chance.between(-0.25, 0.5).max(0.0);
        }
        case.rows.push(row);
    }
    for _ in 0..equalities {
        let mut entries: Vec<(usize, f64)> = vec![];
        for _ in 0..chance.index(1, 5) {
            entries.push((chance.index(0, n), chance.between(-1.0, 1.0)));
        }
        let target = entries.iter().map(|&(i, v)| v * x0[i]).sum();
        case.equalities.push((entries, target));
    }
    case
}

/// A random case within boxes: wide, one-sided, absent, and of no width; hard rows and boxes share
/// a point.
pub fn boxed_case(chance: &mut Chance, n: usize, rows: usize, flavour: Flavour) -> Case {
    let mut case = random_case(chance, n, n, rows, 0, flavour);
    let x0: Vec<f64> = (0..n).map(|_| chance.between(-1.0, 1.0)).collect();
    for row in case.rows.iter_mut().filter(|r| r.weight.is_infinite()) {
        row.bound = row.times(&x0) + chance.between(-0.1, 0.5).max(0.0);
    }
    for &x in &x0 {
        let side = |chance: &mut Chance| {
            let apart = chance.between(0.0, 0.5);
            if chance.happens(0.3) {
                f64::INFINITY
            } else {
                apart
            }
        };
        case.boxes.push(if chance.happens(0.1) {
            (x, x)
        } else {
            (x - side(chance), x + side(chance))
        });
    }
    case
}

/// A smoothing spline among obstacles: `controls` control points in the plane, interleaved, of a
/// uniform cubic B-spline along a winding line; squared speed over speed (length), squared third
/// differences (curvature rate), a proximal term; `rows` clearance rows, of which about a third
/// push; both end points and the direction at both ends given.
pub fn spline_case(chance: &mut Chance, controls: usize, rows: usize) -> Case {
    let (length, curvature_rate, price) = (1.0, 10.0, 20.0);
    let n = 2 * controls;
    let step = 180.0 / controls as f64;
    let mut case = Case {
        n,
        gradient: vec![0.0; n],
        ..Case::default()
    };
    // the line as it is: corners every 15 points
    let mut current = vec![0.0; n];
    let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0f64);
    for i in 0..controls {
        if i % 15 == 7 {
            heading += chance.between(-1.2, 1.2);
        }
        current[2 * i] = x + chance.between(-0.05, 0.05) * step;
        current[2 * i + 1] = y + chance.between(-0.05, 0.05) * step;
        x += step * heading.cos();
        y += step * heading.sin();
    }
    let gauss = [
        (0.112_701_665, 5.0 / 18.0),
        (0.5, 8.0 / 18.0),
        (0.887_298_335, 5.0 / 18.0),
    ];
    for segment in 0..controls - 3 {
        for axis in 0..2 {
            let mut third = [0.0; 7];
            for (k, c) in [-1.0, 3.0, -3.0, 1.0].into_iter().enumerate() {
                third[2 * k] = c;
            }
            case.square(
                2 * segment + axis,
                &third,
                0.0,
                2.0 * curvature_rate / step.powi(5),
            );
        }
        for (t, weight) in gauss {
            let slope = basis_slope(t);
            let speed = (0..2)
                .map(|axis| {
                    (0..4)
                        .map(|k| slope[k] * current[2 * (segment + k) + axis])
                        .sum::<f64>()
                })
                .fold(0.0f64, f64::hypot);
            for axis in 0..2 {
                let mut row = [0.0; 7];
                for k in 0..4 {
                    row[2 * k] = slope[k];
                }
                case.square(2 * segment + axis, &row, 0.0, length * weight / speed);
            }
        }
    }
    for (i, c) in current.iter().enumerate() {
        case.square(i, &[1.0], *c, 0.02);
    }
    for _ in 0..rows {
        let segment = chance.index(1, controls - 4);
        let basis = basis(chance.between(0.0, 1.0));
        let direction = chance.between(-3.0, 3.0);
        let normal = [direction.cos(), direction.sin()];
        let a: Vec<f64> = (0..8).map(|i| -basis[i / 2] * normal[i % 2]).collect();
        let mut row = RowCase {
            first: 2 * segment,
            a,
            bound: 0.0,
            weight: price,
        };
        row.bound = row.times(&current) + chance.between(-0.5, 1.0);
        case.rows.push(row);
    }
    for end in [0, controls - 3] {
        for axis in 0..2 {
            let at = |k: usize| 2 * (end + k) + axis;
            let entries = vec![(at(0), 1.0 / 6.0), (at(1), 4.0 / 6.0), (at(2), 1.0 / 6.0)];
            let target = entries.iter().map(|&(i, v)| v * current[i]).sum();
            case.equalities.push((entries, target));
        }
        let forward = if end == 0 { 0.0 } else { heading };
        let normal = [-forward.sin(), forward.cos()];
        let entries = (0..4)
            .map(|k| {
                (
                    2 * (end + 2 * (k / 2)) + k % 2,
                    [-0.5, 0.5][k / 2] * normal[k % 2],
                )
            })
            .collect();
        case.equalities.push((entries, 0.0));
    }
    case
}

fn basis(t: f64) -> [f64; 4] {
    let u = 1.0 - t;
    [
        u.powi(3) / 6.0,
        (3.0 * t.powi(3) - 6.0 * t * t + 4.0) / 6.0,
        (-3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0) / 6.0,
        t.powi(3) / 6.0,
    ]
}

fn basis_slope(t: f64) -> [f64; 4] {
    let u = 1.0 - t;
    [
        -0.5 * u * u,
        1.5 * t * t - 2.0 * t,
        -1.5 * t * t + t + 0.5,
        0.5 * t * t,
    ]
}

/// Compares an answer with the oracle's: optimal values to 1e-7, and x to 1e-6 where the oracle
/// reaches its tolerance 1e-13. That sharp it has to be: at 1e-11 its own x, compared with itself
/// at 1e-13, is off by up to 1e-5, since its gap is relative to an objective that contains the
/// price of rows lost. Returns whether x was compared.
pub fn assert_agreement(case: &Case, x: &[f64], what: &str) -> bool {
    let sharp = case.oracle(1e-13);
    let compare_x = sharp.status == SolverStatus::Solved;
    let oracle = if compare_x { sharp } else { case.oracle(1e-8) };
    assert_eq!(oracle.status, SolverStatus::Solved, "{what}: the oracle");
    let (ours, theirs) = (case.objective(x), case.objective(&oracle.x));
    assert!(
        (ours - theirs).abs() <= 1e-7 * (1.0 + theirs.abs()),
        "{what}: {ours} against {theirs}"
    );
    if compare_x {
        let apart = difference(&oracle.x, x);
        assert!(apart <= 1e-6, "{what}: x differs by {apart:e}");
    }
    compare_x
}

/// Largest difference of two vectors relative to 1 + the size of the first.
pub fn difference(a: &[f64], b: &[f64]) -> f64 {
    let size = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let worst = a
        .iter()
        .zip(b)
        .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    worst / (1.0 + size)
}
