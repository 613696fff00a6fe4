//! Intervals with outward rounding, and polynomials in Bernstein form over them.
//!
//! Each result contains the exact value for every choice from the operands: an end is moved one floating-point number outward
//! after each operation, more than its rounding could have lost.

use std::ops::{Add, Mul, Sub};

/// All numbers from `lo` to `hi`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub lo: f64,
    pub hi: f64,
}

impl Interval {
    pub const ZERO: Self = Self { lo: 0.0, hi: 0.0 };

    /// Exactly `x`.
    pub fn of(x: f64) -> Self {
        Self { lo: x, hi: x }
    }

    fn outward(lo: f64, hi: f64) -> Self {
        Self {
            lo: lo.next_down(),
            hi: hi.next_up(),
        }
    }

    /// The largest |x|.
    pub fn magnitude(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }

    /// Half of it, exact but for numbers near the smallest.
    fn half(self) -> Self {
        Self::outward(0.5 * self.lo, 0.5 * self.hi)
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::outward(self.lo + other.lo, self.hi + other.hi)
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::outward(self.lo - other.hi, self.hi - other.lo)
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let products = [
            self.lo * other.lo,
            self.lo * other.hi,
            self.hi * other.lo,
            self.hi * other.hi,
        ];
        Self::outward(
            products.iter().copied().fold(f64::INFINITY, f64::min),
            products.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

/// A polynomial on [0, 1] by its Bernstein coefficients, of degree `N − 1`: its values lie within the hull of the coefficients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bernstein<const N: usize>(pub [Interval; N]);

impl<const N: usize> Bernstein<N> {
    /// The smallest and the largest coefficient.
    pub fn hull(&self) -> Interval {
        self.0.iter().fold(
            Interval {
                lo: f64::INFINITY,
                hi: f64::NEG_INFINITY,
            },
            |hull, c| Interval {
                // Not a number must not vanish in a minimum.
                lo: if hull.lo.is_nan() || c.lo >= hull.lo {
                    hull.lo
                } else {
                    c.lo
                },
                hi: if hull.hi.is_nan() || c.hi <= hull.hi {
                    hull.hi
                } else {
                    c.hi
                },
            },
        )
    }

    /// The same on both halves (de Casteljau).
    pub fn halves(&self) -> [Self; 2] {
        let mut row = self.0;
        let (mut left, mut right) = (self.0, self.0);
        for level in 1..N {
            for i in 0..N - level {
                row[i] = (row[i] + row[i + 1]).half();
            }
            left[level] = row[0];
            right[N - 1 - level] = row[N - 1 - level];
        }
        [Self(left), Self(right)]
    }

    /// The product with a polynomial of degree `M − 1`; `P` is N + M − 1.
    pub fn times<const M: usize, const P: usize>(&self, other: &Bernstein<M>) -> Bernstein<P> {
        debug_assert_eq!(P + 1, N + M);
        let mut product = [Interval::ZERO; P];
        for (i, a) in self.0.iter().enumerate() {
            for (j, b) in other.0.iter().enumerate() {
                let share = binomial(N - 1, i) * binomial(M - 1, j) / binomial(P - 1, i + j);
                // The quotient of whole numbers is rounded once.
                let share = Interval::outward(share, share);
                product[i + j] = product[i + j] + share * *a * *b;
            }
        }
        Bernstein(product)
    }
}

/// n over k, exact for the small n used here.
fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_third_thrice_contains_one() {
        let third = Interval::of(1.0) * Interval::outward(1.0 / 3.0, 1.0 / 3.0);
        let sum = third + third + third;
        assert!(sum.lo < 1.0 && 1.0 < sum.hi && sum.hi - sum.lo < 1e-14);
    }

    #[test]
    fn what_is_not_a_number_shows_in_the_hull() {
        let hull = Bernstein([Interval::of(0.0), Interval::of(f64::NAN), Interval::of(1.0)]).hull();
        assert!(hull.lo.is_nan() && hull.hi.is_nan());
    }

    proptest! {
        #[test]
        fn products_and_halves_are_those_of_the_polynomials(
            a in prop::array::uniform3(-5.0..5.0_f64), b in prop::array::uniform2(-5.0..5.0_f64), t in 0.0..1.0_f64,
        ) {
            let (p, q) = (Bernstein(a.map(Interval::of)), Bernstein(b.map(Interval::of)));
            let u = 1.0 - t;
            let at = |t: f64| {
                let u = 1.0 - t;
                (a[0] * u * u + 2.0 * a[1] * u * t + a[2] * t * t) * (b[0] * u + b[1] * t)
            };
            let product: Bernstein<4> = p.times(&q);
            let c = product.0.map(|c| 0.5 * (c.lo + c.hi));
            let value = c[0] * u * u * u + 3.0 * c[1] * u * u * t + 3.0 * c[2] * u * t * t + c[3] * t * t * t;
            prop_assert!((value - at(t)).abs() < 1e-12);
            let [left, right] = product.halves();
            for (half, from) in [(left, 0.0), (right, 0.5)] {
                let hull = half.hull();
                let value = at(from + 0.5 * t);
                prop_assert!(hull.lo <= value + 1e-13 && value - 1e-13 <= hull.hi);
            }
        }
    }
}
