//! Scaling by powers of two, which commits no rounding.
//!
//! The caller's unknowns x, rows a·x ≤ b + e with price ρ, and objective f become
//!
//! ```text
//!     x = t d ∘ x̃,   H̃ = d H d,   g̃ = d g / t,                f = t² f̃,
//!     ã = (a ∘ d)/r, b̃ = b/(t r),  ρ̃ = ρ r / t,  e = t r ẽ,   z = (t / r) z̃,
//! ```
//!
//! with d_i near 1/√H_ii (unit diagonal), r near the norm of a ∘ d (unit rows) and one length t for
//! all: near the largest of |g̃|, of the distances by which rows and equalities exclude the
//! origin, each but a lower bound of what the answer's size can be. The solver's tolerances can
//! therefore be plain numbers, and multiplying a problem by any factor changes nothing but t.

/// The scales of one problem.
#[derive(Debug, Clone)]
pub(crate) struct Scaling {
    /// d.
    pub unknowns: Vec<f64>,
    /// r, one per row.
    pub rows: Vec<f64>,
    /// r, one per equality.
    pub equalities: Vec<f64>,
    /// t.
    pub length: f64,
}

impl Scaling {
    pub fn with_capacity(unknowns: usize, rows: usize, equalities: usize) -> Self {
        Self {
            unknowns: vec![1.0; unknowns],
            rows: vec![1.0; rows],
            equalities: vec![1.0; equalities],
            length: 1.0,
        }
    }

    /// The multiplier of row `k` in the caller's units.
    pub fn multiplier(&self, k: usize, scaled: f64) -> f64 {
        scaled * self.length / self.rows[k]
    }

    /// The multiplier of equality `k` in the caller's units.
    pub fn equality_multiplier(&self, k: usize, scaled: f64) -> f64 {
        scaled * self.length / self.equalities[k]
    }
}

/// The power of two at or below |x|; 1 for zero, so that it can always be divided by.
pub(crate) fn power_of_two(x: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let power = f64::from_bits(x.to_bits() & EXPONENT);
    if power > 0.0 { power } else { 1.0 }
}

/// Collects t.
pub(crate) struct NaturalLength(f64);

impl NaturalLength {
    pub fn new() -> Self {
        Self(0.0)
    }

    /// The pull of the gradient: at unit Hessian the origin would move this far.
    pub fn gradient(&mut self, g: f64) {
        self.0 = self.0.max(g.abs());
    }

    /// A unit row at `bound`: if negative, the origin is excluded and the answer is at least this
    /// far away, unless violating it at `weight` is cheaper.
    pub fn row(&mut self, bound: f64, weight: f64) {
        self.0 = self.0.max((-bound).min(weight));
    }

    /// A unit equality.
    pub fn equality(&mut self, target: f64) {
        self.0 = self.0.max(target.abs());
    }

    pub fn get(&self) -> f64 {
        power_of_two(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_exact_and_never_zero() {
        assert_eq!(power_of_two(1.0), 1.0);
        assert_eq!(power_of_two(-7.9), 4.0);
        assert_eq!(power_of_two(0.3), 0.25);
        assert_eq!(power_of_two(0.0), 1.0);
        assert_eq!(power_of_two(5e-324), 1.0);
    }
}
