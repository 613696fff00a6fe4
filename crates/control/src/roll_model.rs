//! The nominal roll model the balance law works with, at one balancer offset.
//!
//! Gravity partials of the two-link model, and the extra roll moment of a turn,
//!
//! ```text
//! E = A_a omega' + v omega HZ + omega^2 J_a / 2,
//! ```
//!
//! with its partials: `v omega` and `omega'` frozen, the `omega^2` term in the value only.

use bikebot_dynamics::{BikeParams, Lumped, TwoLinkState};

use crate::output_function::OutputFunction;

/// The plane motion that makes a roll moment: zero while riding straight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TurnMoment {
    /// `v omega`, m/s^2, positive in a left turn.
    pub centripetal: f64,
    /// `omega'`, rad/s^2.
    pub yaw_acceleration: f64,
    /// `omega`, rad/s.
    pub yaw_rate: f64,
}

/// A roll moment with its derivatives in roll and balancer angle, N m and N m/rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RollMoment {
    /// The moment itself, N m.
    pub value: f64,
    /// `d/d alpha`.
    pub a: f64,
    /// `d/d beta`.
    pub b: f64,
    /// `d^2/d alpha^2`.
    pub aa: f64,
    /// `d^2/(d alpha d beta)`.
    pub ab: f64,
    /// `d^2/d beta^2`.
    pub bb: f64,
}

impl std::ops::Add for RollMoment {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            a: self.a + other.a,
            b: self.b + other.b,
            aa: self.aa + other.aa,
            ab: self.ab + other.ab,
            bb: self.bb + other.bb,
        }
    }
}

/// Every constant of the roll dynamics at one offset `d`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RollModel {
    /// The inertia terms and `F`.
    pub inertia: OutputFunction,
    /// Balancer offset `d`, m.
    pub offset: f64,
    /// `a3 = m2 l d`, kg m^2.
    a3: f64,
    /// `b1 = (m1 h1 + m2 l) g`, N m/rad.
    b1: f64,
    /// `b2 = m2 d g`, N m/rad.
    b2: f64,
    /// `m1 h1`, `m2` and `l`.
    m1h1: f64,
    m1: f64,
    h1: f64,
    m2: f64,
    l: f64,
    /// `m1 x1 h1 + m2 x2 l + I1xz` and `m2 x2 d`, kg m^2.
    product_frame: f64,
    product_balancer: f64,
    /// `I1y - I1z` and `I2y - I2z`, kg m^2.
    frame_difference: f64,
    balancer_difference: f64,
}

impl RollModel {
    /// The model of `bike` with its balancer shifted by `offset`, m.
    #[must_use]
    pub fn new(bike: &BikeParams, offset: f64) -> Self {
        let Lumped { a0, a2, a3, b1, b2 } = bike.lumped(offset);
        Self {
            inertia: OutputFunction::new(a0, a2, a3),
            offset,
            a3,
            b1,
            b2,
            m1h1: bike.m1 * bike.h1,
            m1: bike.m1,
            h1: bike.h1,
            m2: bike.m2,
            l: bike.l,
            product_frame: bike.m1 * bike.x1 * bike.h1 + bike.m2 * bike.x2 * bike.l + bike.i1xz,
            product_balancer: bike.m2 * bike.x2 * offset,
            frame_difference: bike.i1y - bike.i1z,
            balancer_difference: bike.i2y - bike.i2z,
        }
    }

    /// `[a0, a2, a3, b1, b2]`: kg m^2 and N m.
    pub(crate) fn constants(&self) -> [f64; 5] {
        let [a0, a2, a3] = self.inertia.constants();
        [a0, a2, a3, self.b1, self.b2]
    }

    /// `b1 + b2`, N m/rad: the upright gravity stiffness with the balancer locked.
    #[must_use]
    pub fn toppling_stiffness(&self) -> f64 {
        self.b1 + self.b2
    }

    /// `b2`, N m/rad: the part of it that the balancer's own offset adds.
    #[must_use]
    pub fn balancer_stiffness(&self) -> f64 {
        self.b2
    }

    /// `lambda = sqrt((b1 + b2)/M11(0))`, 1/s: how fast the bike topples with the balancer locked.
    #[must_use]
    pub fn toppling_rate(&self) -> f64 {
        (self.toppling_stiffness() / self.inertia.m11(0.0)).sqrt()
    }

    /// `H = HZ(0, 0)`, kg m: roll moment per `v omega`.
    #[must_use]
    pub fn centripetal_arm(&self) -> f64 {
        self.m1h1 + self.m2 * (self.l + self.offset)
    }

    /// `A = A_a(0, 0)`, kg m^2: roll moment per `omega'`.
    #[must_use]
    pub fn yaw_product(&self) -> f64 {
        self.product_frame + self.product_balancer
    }

    /// `alpha_eq`, rad: the small lean that balances a turn.
    #[must_use]
    pub fn equilibrium_lean(&self, centripetal: f64, yaw_acceleration: f64) -> f64 {
        -(self.centripetal_arm() * centripetal + self.yaw_product() * yaw_acceleration)
            / self.toppling_stiffness()
    }

    /// `sigma = M11 alpha' + M12 beta'`, kg m^2/s: angular momentum about the contact line.
    #[must_use]
    pub fn momentum(&self, state: &TwoLinkState) -> f64 {
        self.inertia.m11(state.balancer) * state.roll_rate
            + self.inertia.m12(state.balancer) * state.balancer_rate
    }

    /// Coriolis and centrifugal terms `(c1, c2)`, N m.
    #[must_use]
    pub fn coriolis(&self, state: &TwoLinkState) -> (f64, f64) {
        let s = self.a3 * state.balancer.sin();
        (
            -s * (2.0 * state.roll_rate + state.balancer_rate) * state.balancer_rate,
            s * state.roll_rate * state.roll_rate,
        )
    }

    /// Gravity's roll moment `b1 sin(alpha) + b2 sin(phi)` and its partials.
    #[must_use]
    pub fn gravity(&self, state: &TwoLinkState) -> RollMoment {
        let (sa, ca) = state.roll.sin_cos();
        let (sf, cf) = (state.roll + state.balancer).sin_cos();
        RollMoment {
            value: self.b1 * sa + self.b2 * sf,
            a: self.b1 * ca + self.b2 * cf,
            b: self.b2 * cf,
            aa: -self.b1 * sa - self.b2 * sf,
            ab: -self.b2 * sf,
            bb: -self.b2 * sf,
        }
    }

    /// Gravity's moment on the balancer joint, `b2 sin(phi)`, N m.
    #[must_use]
    pub fn balancer_gravity(&self, state: &TwoLinkState) -> f64 {
        self.b2 * (state.roll + state.balancer).sin()
    }

    /// The roll moment `E` of a turn and its partials.
    #[must_use]
    pub fn turning(&self, state: &TwoLinkState, turn: &TurnMoment) -> RollMoment {
        let (sa, ca) = state.roll.sin_cos();
        let (sf, cf) = (state.roll + state.balancer).sin_cos();
        let d = self.offset;
        let (y1, z1) = (-self.h1 * sa, self.h1 * ca);
        let (y2, z2) = (-self.l * sa - d * sf, self.l * ca + d * cf);
        let sy = self.m1 * y1 + self.m2 * y2;
        let hz = self.m1 * z1 + self.m2 * z2;
        let j_a = -2.0 * self.m1 * y1 * z1 - 2.0 * self.m2 * y2 * z2
            + 2.0 * self.frame_difference * sa * ca
            + 2.0 * self.balancer_difference * sf * cf;
        let a_a = self.product_frame * ca + self.product_balancer * cf;
        let a_b = self.product_balancer * cf;
        let a_aa = -self.product_frame * sa - self.product_balancer * sf;
        let a_ab = -self.product_balancer * sf;
        let (vw, wd, w) = (turn.centripetal, turn.yaw_acceleration, turn.yaw_rate);
        RollMoment {
            value: a_a * wd + vw * hz + 0.5 * w * w * j_a,
            a: vw * sy + wd * a_aa,
            b: -vw * self.m2 * d * sf + wd * a_ab,
            aa: -vw * hz - wd * a_a,
            ab: -vw * self.m2 * d * cf - wd * a_b,
            bb: -vw * self.m2 * d * cf - wd * a_b,
        }
    }

    /// The joint moment of a turn, `A_b omega' + v omega m2 d cos(phi) + omega^2 J_b / 2`, N m.
    #[must_use]
    pub fn turning_joint(&self, state: &TwoLinkState, turn: &TurnMoment) -> f64 {
        let sa = state.roll.sin();
        let (sf, cf) = (state.roll + state.balancer).sin_cos();
        let d = self.offset;
        let y2 = -self.l * sa - d * sf;
        let j_b = -2.0 * self.m2 * y2 * d * cf + 2.0 * self.balancer_difference * sf * cf;
        self.product_balancer * cf * turn.yaw_acceleration
            + turn.centripetal * self.m2 * d * cf
            + 0.5 * turn.yaw_rate * turn.yaw_rate * j_b
    }

    /// `D` upright and at rest, N m/rad: negative wherever the balancer can control the roll.
    #[must_use]
    pub fn upright_decoupling(&self) -> f64 {
        self.b2 - (self.b1 + self.b2) * self.inertia.slope(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upright_constants_are_those_of_the_default_set() {
        let bike = BikeParams::default();
        let flywheel = RollModel::new(&bike, 0.0);
        assert!((flywheel.toppling_stiffness() - 288.02).abs() < 5e-3);
        assert!((flywheel.toppling_rate() - 3.62).abs() < 5e-3);
        assert!((flywheel.centripetal_arm() - 29.36).abs() < 1e-9);
        assert!((flywheel.yaw_product() - 12.36).abs() < 5e-3);
        let balancer = RollModel::new(&bike, 0.15);
        assert!((balancer.balancer_stiffness() - 17.658).abs() < 1e-9);
        assert!((balancer.inertia.m11(0.0) - 25.105).abs() < 1e-3);
    }

    #[test]
    fn partials_of_both_moments_agree_with_differences() {
        let model = RollModel::new(&BikeParams::default(), 0.15);
        let turn = TurnMoment {
            centripetal: 0.8,
            yaw_acceleration: -0.4,
            yaw_rate: 0.0,
        };
        let at = |roll: f64, balancer: f64| {
            let state = TwoLinkState {
                roll,
                balancer,
                ..TwoLinkState::default()
            };
            model.gravity(&state) + model.turning(&state, &turn)
        };
        let (a, b, h) = (0.11, -0.7, 1e-5);
        let m = at(a, b);
        // Central differences: truncation about h^2 of third derivatives near 300 N m.
        let tolerance = 1e-6;
        assert!(((at(a + h, b).value - at(a - h, b).value) / (2.0 * h) - m.a).abs() < tolerance);
        assert!(((at(a, b + h).value - at(a, b - h).value) / (2.0 * h) - m.b).abs() < tolerance);
        assert!(((at(a + h, b).a - at(a - h, b).a) / (2.0 * h) - m.aa).abs() < tolerance);
        assert!(((at(a, b + h).a - at(a, b - h).a) / (2.0 * h) - m.ab).abs() < tolerance);
        assert!(((at(a, b + h).b - at(a, b - h).b) / (2.0 * h) - m.bb).abs() < tolerance);
    }
}
