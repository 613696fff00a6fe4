//! Output zeroing: input–output linearisation of the roll dynamics.
//!
//! The output `y = sigma - M11(0) p1 + K (p - p_ref)` has relative degree three,
//!
//! ```text
//! y''' = L + D w,    w = beta'',
//! ```
//!
//! and the law `w = (-L - k2 y'' - k1 y' - k0 y)/D` gives it the poles `-p1, -p2, -p3`.
//! The roll moment `G` inside is gravity, the moment of the turn and an estimate of
//! whatever else acts ([`crate::observer`]). Where `D` vanishes, so does the balancer's
//! authority; the caller decides what to do then.

use bikebot_dynamics::TwoLinkState;

use crate::roll_model::{RollModel, TurnMoment};

/// `p_ref` and its time derivatives: rad, rad/s, … rad/s^4.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OutputReference {
    /// `p_ref`, rad.
    pub value: f64,
    /// First to fourth derivative, `p1 … p4`.
    pub derivatives: [f64; 4],
}

/// The output, its derivatives along the motion and the terms of its third one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputDerivatives {
    /// `y`, kg m^2/s.
    pub y: f64,
    /// `y'`, N m.
    pub y1: f64,
    /// `y''`, N m/s.
    pub y2: f64,
    /// `D`, N m/rad: the decoupling term.
    pub decoupling: f64,
    /// `L`, N m/s^2: the drift of `y'''`.
    pub drift: f64,
    /// `G`, N m: the total roll moment.
    pub moment: f64,
    /// `sigma`, kg m^2/s.
    pub momentum: f64,
    /// `p`, rad.
    pub p: f64,
}

/// The law with its gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputZeroing {
    /// `kappa`, 1/s: rate of the zero dynamics near the upright balancer.
    kappa: f64,
    /// `k0, k1, k2`.
    gains: [f64; 3],
}

impl OutputZeroing {
    /// With zero-dynamics rate `kappa`, 1/s, and output poles at `-poles`, 1/s.
    #[must_use]
    pub fn new(kappa: f64, poles: [f64; 3]) -> Self {
        let [a, b, c] = poles;
        Self {
            kappa,
            gains: [a * b * c, a * b + a * c + b * c, a + b + c],
        }
    }

    /// `K = kappa M11(0)`, kg m^2/s.
    #[must_use]
    pub fn output_gain(&self, model: &RollModel) -> f64 {
        self.kappa * model.inertia.m11(0.0)
    }

    /// The output and its derivatives at a state; `estimate` is a further roll moment, N m.
    #[must_use]
    pub fn derivatives(
        &self,
        model: &RollModel,
        state: &TwoLinkState,
        turn: &TurnMoment,
        estimate: f64,
        reference: &OutputReference,
    ) -> OutputDerivatives {
        let beta = state.balancer;
        let (ad, bd) = (state.roll_rate, state.balancer_rate);
        let (m11, m12) = (model.inertia.m11(beta), model.inertia.m12(beta));
        let (slope, curve) = (model.inertia.m11_slope(beta), model.inertia.m11_curve(beta));
        let upright = model.inertia.m11(0.0);
        let k = self.kappa * upright;
        let [p1, p2, p3, p4] = reference.derivatives;

        let g = model.gravity(state) + model.turning(state, turn);
        let moment = g.value + estimate;
        let sigma = model.momentum(state);
        let p = state.roll + model.inertia.value(beta);
        let moment_rate = g.a * ad + g.b * bd;
        let (c1, _) = model.coriolis(state);

        let y = sigma - upright * p1 + k * (p - reference.value);
        let y1 = moment - upright * p2 + k * (sigma / m11 - p1);
        let y2 =
            moment_rate - upright * p3 + k * (moment / m11 - sigma * slope * bd / (m11 * m11) - p2);
        let decoupling = g.b - g.a * m12 / m11 - k * sigma * slope / (m11 * m11);
        let drift = g.aa * ad * ad
            + 2.0 * g.ab * ad * bd
            + g.bb * bd * bd
            + g.a * (moment - c1) / m11
            + k * (moment_rate / m11
                - 2.0 * moment * slope * bd / (m11 * m11)
                - sigma * curve * bd * bd / (m11 * m11)
                + 2.0 * sigma * slope * slope * bd * bd / (m11 * m11 * m11))
            - upright * p4
            - k * p3;
        OutputDerivatives {
            y,
            y1,
            y2,
            decoupling,
            drift,
            moment,
            momentum: sigma,
            p,
        }
    }

    /// The balancer acceleration `w`, rad/s^2, that gives the output its poles.
    #[must_use]
    pub fn balancer_acceleration(&self, d: &OutputDerivatives) -> f64 {
        let [k0, k1, k2] = self.gains;
        (-d.drift - k2 * d.y2 - k1 * d.y1 - k0 * d.y) / d.decoupling
    }

    /// The joint torque, N m, that gives the balancer the acceleration `w`, by inverse dynamics.
    #[must_use]
    pub fn torque(
        model: &RollModel,
        state: &TwoLinkState,
        turn: &TurnMoment,
        d: &OutputDerivatives,
        balancer_acceleration: f64,
    ) -> f64 {
        let w = balancer_acceleration;
        let (m11, m12) = (
            model.inertia.m11(state.balancer),
            model.inertia.m12(state.balancer),
        );
        let (c1, c2) = model.coriolis(state);
        let roll_acceleration = (d.moment - c1 - m12 * w) / m11;
        m12 * roll_acceleration + model.inertia.m22() * w + c2
            - model.balancer_gravity(state)
            - model.turning_joint(state, turn)
    }
}
