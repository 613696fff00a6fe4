//! The derivative of a cubic as a curve of its own, and bounds on what is made of it.

use crate::{Vector2, cross};

/// `P′(T) = A T² + B T + c`.
#[derive(Clone, Copy)]
pub(super) struct Hodograph {
    pub(super) a: Vector2,
    pub(super) b: Vector2,
    pub(super) c: Vector2,
}

impl Hodograph {
    #[inline]
    pub(super) fn at(&self, t: f64) -> Vector2 {
        (self.a * t + self.b) * t + self.c
    }

    #[inline]
    pub(super) fn slope(&self, t: f64) -> Vector2 {
        self.a * (2.0 * t) + self.b
    }

    /// Bernstein control points of `P′` on `[t0, t1]`.
    #[inline]
    pub(super) fn control(&self, t0: f64, t1: f64) -> [Vector2; 3] {
        [
            self.at(t0),
            self.a * (t0 * t1) + self.b * (0.5 * (t0 + t1)) + self.c,
            self.at(t1),
        ]
    }

    /// Power coefficients of `N = P′ × P″`, constant first.
    #[inline]
    pub(super) fn turn(&self) -> [f64; 3] {
        [
            cross(self.c, self.b),
            2.0 * cross(self.c, self.a),
            -cross(self.a, self.b),
        ]
    }

    /// Power coefficients of `D = |P′|²`, constant first.
    #[inline]
    pub(super) fn speed_squared(&self) -> [f64; 5] {
        [
            self.c.dot(&self.c),
            2.0 * self.b.dot(&self.c),
            self.b.dot(&self.b) + 2.0 * self.a.dot(&self.c),
            2.0 * self.a.dot(&self.b),
            self.a.dot(&self.a),
        ]
    }

    /// Power coefficients of `D′`.
    pub(super) fn speed_squared_slope(&self) -> [f64; 4] {
        let d = self.speed_squared();
        [d[1], 2.0 * d[2], 3.0 * d[3], 4.0 * d[4]]
    }

    /// Power coefficients of `Q = N′D − (3/2) N D′`.
    pub(super) fn curvature_slope(&self, n: &[f64; 3]) -> [f64; 6] {
        let d = self.speed_squared();
        let d_slope = [1.5 * d[1], 3.0 * d[2], 4.5 * d[3], 6.0 * d[4]];
        let n_slope = [n[1], 2.0 * n[2]];
        let mut q = [0.0; 6];
        for (i, x) in n_slope.iter().enumerate() {
            for (j, y) in d.iter().enumerate() {
                q[i + j] += x * y;
            }
        }
        for (i, x) in n.iter().enumerate() {
            for (j, y) in d_slope.iter().enumerate() {
                q[i + j] -= x * y;
            }
        }
        q
    }

    /// σ² at `t`; zero for a straight line even where it stands still.
    #[inline]
    pub(super) fn curvature_squared(&self, turn: &[f64; 3], t: f64) -> f64 {
        let n = quadratic(turn, t);
        if n == 0.0 {
            return 0.0;
        }
        let d = self.at(t).norm_squared();
        n * n / (d * d * d)
    }
}

#[inline]
pub(super) fn quadratic(p: &[f64; 3], t: f64) -> f64 {
    (p[2] * t + p[1]) * t + p[0]
}

/// max |p| on `[t0, t1]`: at an end or at the vertex of the parabola.
#[inline]
pub(super) fn max_abs_quadratic(p: &[f64; 3], t0: f64, t1: f64) -> f64 {
    let mut largest = quadratic(p, t0).abs().max(quadratic(p, t1).abs());
    if p[2] != 0.0 {
        let vertex = -0.5 * p[1] / p[2];
        if vertex > t0 && vertex < t1 {
            largest = largest.max(quadratic(p, vertex).abs());
        }
    }
    largest
}

/// A bound of a quotient by D, of which `slowest` is a lower bound; infinite where that excludes nothing.
pub(super) fn over_slowest(numerator: f64, slowest: f64) -> f64 {
    if slowest <= 0.0 {
        f64::INFINITY
    } else {
        numerator / slowest
    }
}

/// Bernstein coefficients of |q|² for a quadratic `q` with control points `q`.
#[inline]
pub(super) fn squared_norm_coefficients(q: &[Vector2; 3]) -> [f64; 5] {
    [
        q[0].dot(&q[0]),
        q[0].dot(&q[1]),
        (q[0].dot(&q[2]) + 2.0 * q[1].dot(&q[1])) / 3.0,
        q[1].dot(&q[2]),
        q[2].dot(&q[2]),
    ]
}

#[inline]
pub(super) fn minimum(b: &[f64; 5]) -> f64 {
    b.iter().copied().fold(f64::INFINITY, f64::min)
}

#[inline]
pub(super) fn maximum(b: &[f64; 5]) -> f64 {
    b.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}
