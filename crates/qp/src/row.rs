//! One inequality row inside the interior point, with its elasticity eliminated by hand.
//!
//! The row a·x ≤ b + e, e ≥ 0 at price ρ has a slack s, a multiplier z, and a multiplier
//! v = ρ − z of e ≥ 0 (the *reserve*: what is left of the price):
//!
//! ```text
//!     a·x + s − e − b = 0,     z + v = ρ,     s z = μ,   e v = μ,     s, e, z, v ≥ 0.
//! ```
//!
//! Newton for a step (dx, ds, de, dz, dv = −dz), with p the residual of the first equation and the
//! right-hand sides of the complementarity pairs called r_s and r_e:
//!
//! ```text
//!     a·dx + ds − de = −p,     z ds + s dz = r_s,     v de − e dz = r_e
//!     ds = (r_s − s dz)/z,     de = (r_e + e dz)/v
//!     dz = D (a·dx + q),       D = 1/(s/z + e/v),     q = p + r_s/z − r_e/v
//! ```
//!
//! D carries one more term, `PROXIMAL`, which is the proximal method of multipliers for z: it
//! bounds D, and so the condition of H + GᵀDG, where rows leave no interior and multipliers are not
//! unique; p is measured afresh at every iteration, so that it moves no limit.
//!
//! So a row only adds D a aᵀ to the Hessian and −D q a to the right-hand side: e costs no unknown.
//! A hard row is the limit ρ → ∞, where the terms with e vanish. v is carried along by v ← v − α dz
//! instead of being formed as ρ − z, which would lose its digits as z → ρ.

/// δ of D = 1/(s/z + e/v + δ), in the scaled problem. At 1e-12 its trace in p is δ dz per step,
/// below every tolerance; without it one random problem in a thousand whose hard rows meet in a
/// single point ends in overflow, with it one in forty thousand runs out of iterations.
const PROXIMAL: f64 = 1e-12;

/// State and step of one row, in the scaled problem.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Row {
    /// ρ, infinite for a hard row.
    weight: f64,
    slack: f64,
    violation: f64,
    dual: f64,
    reserve: f64,
    /// p.
    residual: f64,
    target_slack: f64,
    target_violation: f64,
    stiffness: f64,
    d_slack: f64,
    d_violation: f64,
    d_dual: f64,
}

impl Row {
    /// The row at a point with margin w = b − a·x, on the central path of height μ where it can be.
    ///
    /// *Elastic:* s = μ/z and e = μ/(ρ − z) with s − e = w exactly, hence
    /// w z² − (wρ + 2μ) z + μρ = 0 and z = 2μρ / (wρ + 2μ + √(w²ρ² + 4μ²)), which has no
    /// cancellation for w ≥ 0; for w < 0 the same formula with −w gives v instead.
    ///
    /// *Hard:* s = max(w, √μ), z = μ/s; a violated row starts with a residual.
    pub fn centred(margin: f64, weight: f64, mu: f64) -> Self {
        let mut row = Self {
            weight,
            reserve: 1.0,
            ..Self::default()
        };
        if row.is_elastic() {
            let pull = margin.abs() * weight;
            let smaller = 2.0 * mu * weight / (pull + 2.0 * mu + pull.hypot(2.0 * mu));
            let larger = weight - smaller;
            (row.dual, row.reserve) = if margin >= 0.0 {
                (smaller, larger)
            } else {
                (larger, smaller)
            };
            row.slack = mu / row.dual;
            row.violation = mu / row.reserve;
        } else {
            row.slack = margin.max(mu.sqrt());
            row.dual = mu / row.slack;
        }
        row
    }

    pub fn is_elastic(&self) -> bool {
        self.weight < f64::INFINITY
    }

    /// z.
    pub fn dual(&self) -> f64 {
        self.dual
    }

    /// Complementarity pairs: the number of barrier terms.
    pub fn pairs(&self) -> f64 {
        if self.is_elastic() { 2.0 } else { 1.0 }
    }

    /// s z + e v.
    pub fn complementarity(&self) -> f64 {
        self.slack * self.dual + self.violation * self.reserve
    }

    /// The same after a step of length α.
    pub fn complementarity_after(&self, alpha: f64) -> f64 {
        (self.slack + alpha * self.d_slack) * (self.dual + alpha * self.d_dual)
            + (self.violation + alpha * self.d_violation) * (self.reserve - alpha * self.d_dual)
    }

    /// Sets and returns p, given w = b − a·x.
    pub fn measure(&mut self, margin: f64) -> f64 {
        self.residual = self.slack - self.violation - margin;
        self.residual
    }

    /// Sets and returns D.
    pub fn condense(&mut self) -> f64 {
        self.stiffness = 1.0 / (self.slack / self.dual + self.violation / self.reserve + PROXIMAL);
        self.stiffness
    }

    /// Aims at zero complementarity: the affine scaling (predictor) direction.
    pub fn aim_at_zero(&mut self) {
        self.target_slack = -self.slack * self.dual;
        self.target_violation = -self.violation * self.reserve;
    }

    /// Aims at the central path of height `mu`, with Mehrotra's second-order correction by the
    /// products of the predictor's own steps, times `trust`.
    pub fn aim_at_path(&mut self, mu: f64, trust: f64) {
        self.target_slack = mu - self.slack * self.dual - trust * self.d_slack * self.d_dual;
        if self.is_elastic() {
            self.target_violation =
                mu - self.violation * self.reserve + trust * self.d_violation * self.d_dual;
        }
    }

    /// D q, the row's share of the right-hand side.
    pub fn push(&self) -> f64 {
        self.stiffness * self.offset()
    }

    fn offset(&self) -> f64 {
        self.residual + self.target_slack / self.dual - self.target_violation / self.reserve
    }

    /// Recovers (ds, de, dz) from a·dx.
    pub fn step(&mut self, along: f64) {
        self.d_dual = self.stiffness * (along + self.offset());
        self.d_slack = (self.target_slack - self.slack * self.d_dual) / self.dual;
        self.d_violation = (self.target_violation + self.violation * self.d_dual) / self.reserve;
    }

    /// The largest α at which nothing becomes negative; infinite if nothing ever does.
    pub fn longest_step(&self) -> f64 {
        let mut alpha = to_zero(self.slack, self.d_slack).min(to_zero(self.dual, self.d_dual));
        if self.is_elastic() {
            alpha = alpha
                .min(to_zero(self.violation, self.d_violation))
                .min(to_zero(self.reserve, -self.d_dual));
        }
        alpha
    }

    /// Moves by α along the step.
    pub fn advance(&mut self, alpha: f64) {
        self.slack += alpha * self.d_slack;
        self.dual += alpha * self.d_dual;
        if self.is_elastic() {
            self.violation += alpha * self.d_violation;
            self.reserve -= alpha * self.d_dual;
        }
    }

    /// Whether the step is made of numbers.
    pub fn step_is_finite(&self) -> bool {
        (self.d_slack + self.d_dual + self.d_violation).is_finite()
    }
}

fn to_zero(value: f64, rate: f64) -> f64 {
    if rate < 0.0 {
        -value / rate
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_elastic_row_starts_exactly_on_the_central_path(
            margin in -1e3..1e3f64, log_weight in -4.0..6.0f64, log_mu in -8.0..3.0f64,
        ) {
            let (weight, mu) = (10f64.powf(log_weight), 10f64.powf(log_mu));
            let mut row = Row::centred(margin, weight, mu);
            prop_assert!(row.slack > 0.0 && row.violation > 0.0 && row.dual > 0.0 && row.reserve > 0.0);
            prop_assert!((row.slack * row.dual - mu).abs() <= 1e-12 * mu);
            prop_assert!((row.violation * row.reserve - mu).abs() <= 1e-12 * mu);
            prop_assert!((row.dual + row.reserve - weight).abs() <= 1e-12 * weight);
            // s − e = w up to the rounding of the larger of the two
            let size = row.slack.max(row.violation);
            prop_assert!(row.measure(margin).abs() <= 1e-9 * size);
        }

        #[test]
        fn a_step_solves_the_linearised_conditions(
            margin in -10.0..10.0f64, weight in 0.1..100.0f64, mu in 0.01..10.0f64, along in -5.0..5.0f64,
            hard: bool,
        ) {
            let weight = if hard { f64::INFINITY } else { weight };
            let mut row = Row::centred(margin, weight, mu);
            row.measure(margin + 0.3);
            row.condense();
            row.aim_at_zero();
            row.step(along);
            let size = 1.0 + row.d_slack.abs() + row.d_violation.abs() + row.d_dual.abs();
            prop_assert!((along + row.d_slack - row.d_violation + row.residual).abs() <= 1e-10 * size);
            prop_assert!(
                (row.dual * row.d_slack + row.slack * row.d_dual - row.target_slack).abs()
                    <= 1e-10 * size * (row.dual + row.slack)
            );
            if hard {
                prop_assert_eq!(row.d_violation, 0.0);
            } else {
                prop_assert!(
                    (row.reserve * row.d_violation - row.violation * row.d_dual - row.target_violation).abs()
                        <= 1e-10 * size * (row.reserve + row.violation)
                );
            }
        }
    }
}
