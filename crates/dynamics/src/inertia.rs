//! Moments of mass of the leaning bike in the heading frame, with their rates — §5.1.
//!
//! The heading frame sits at the rear contact: e1 forward, e2 left, e3 up. A body at height
//! `h` on the frame is at `Y = −h sin α`, `Z = h cos α` in it.

use crate::bike::BikeState;
use crate::params::{BikeParams, Offset};

/// First and second moments of mass and the yaw-roll products, named as in §5.1.
pub(crate) struct Moments {
    pub sin_alpha: f64,
    pub cos_alpha: f64,
    pub sin_phi: f64,
    pub cos_phi: f64,
    /// Positions of the two centres of gravity, m.
    pub y1: f64,
    pub z1: f64,
    pub y2: f64,
    pub z2: f64,
    /// First moments `Σ m x`, `Σ m Y`, `Σ m Z`, kg m.
    pub sx: f64,
    pub sy: f64,
    pub hz: f64,
    /// Yaw inertia about the rear contact and its partial derivatives, kg m².
    pub j: f64,
    pub j_a: f64,
    pub j_b: f64,
    /// Yaw momentum per roll rate, per balancer rate (kg m²) and per offset rate (kg m).
    pub a_a: f64,
    pub a_b: f64,
    pub a_d: f64,
    /// Rates of the above along the motion.
    pub sy_rate: f64,
    pub j_rate: f64,
    pub a_a_rate: f64,
    pub a_b_rate: f64,
    pub a_d_rate: f64,
}

impl Moments {
    pub(crate) fn new(p: &BikeParams, state: &BikeState, offset: &Offset) -> Self {
        let Offset { d, rate: d_dot, .. } = *offset;
        let (sa, ca) = state.roll.sin_cos();
        let (sf, cf) = (state.roll + state.balancer).sin_cos();
        let (alpha_dot, beta_dot) = (state.roll_rate, state.balancer_rate);
        let phi_dot = alpha_dot + beta_dot;

        let (y1, z1) = (-p.h1 * sa, p.h1 * ca);
        let (y2, z2) = (-p.l * sa - d * sf, p.l * ca + d * cf);
        let hz = p.m1 * z1 + p.m2 * z2;

        let frame = p.m1 * p.x1 * p.h1 + p.m2 * p.x2 * p.l + p.i1xz;
        let m2x2 = p.m2 * p.x2;
        let a_b = m2x2 * d * cf;
        let a_ab = -m2x2 * d * sf;
        let a_aa = -frame * sa + a_ab;

        let tilt = 2.0 * (p.i2y - p.i2z) * sf * cf;
        let j_a = -2.0 * (p.m1 * y1 * z1 + p.m2 * y2 * z2) + 2.0 * (p.i1y - p.i1z) * sa * ca + tilt;
        let j_b = -2.0 * p.m2 * y2 * d * cf + tilt;

        Self {
            sin_alpha: sa,
            cos_alpha: ca,
            sin_phi: sf,
            cos_phi: cf,
            y1,
            z1,
            y2,
            z2,
            sx: p.m1 * p.x1 + m2x2,
            sy: p.m1 * y1 + p.m2 * y2,
            hz,
            j: p.m1 * (p.x1 * p.x1 + y1 * y1)
                + p.m2 * (p.x2 * p.x2 + y2 * y2)
                + p.i1y * sa * sa
                + p.i1z * ca * ca
                + p.i2y * sf * sf
                + p.i2z * cf * cf,
            j_a,
            j_b,
            a_a: frame * ca + a_b,
            a_b,
            a_d: m2x2 * sf,
            sy_rate: -hz * alpha_dot - p.m2 * d * cf * beta_dot - p.m2 * sf * d_dot,
            j_rate: j_a * alpha_dot + j_b * beta_dot - 2.0 * p.m2 * y2 * sf * d_dot,
            a_a_rate: a_aa * alpha_dot + a_ab * beta_dot + m2x2 * cf * d_dot,
            a_b_rate: a_ab * phi_dot + m2x2 * cf * d_dot,
            a_d_rate: m2x2 * cf * phi_dot,
        }
    }
}
