//! Keeping the bike upright with the balancer, whatever the plane motion does.
//!
//! [`BalanceLaw`] is the part both controllers share: the roll-moment observer, the chosen law
//! (output zeroing, linear-quadratic or predictive), the guard that hands over to linear-quadratic
//! feedback where the decoupling term nearly vanishes, and the torque limit. [`BalanceController`] runs it alone, for the two-link plant;
//! [`crate::cascade::RideController`] feeds it the turn and the lean reference.

use bikebot_dynamics::{BalancerMode, BikeParams, Measurement, TwoLink, TwoLinkState};
use nalgebra::Vector4;

use crate::controller::{Controller, check_finite};
use crate::error::ControlError;
use crate::external::{BalancerView, External, ExternalBalancer, asked_balancer};
use crate::lqr;
use crate::observer::RollMomentObserver;
use crate::output_zeroing::{OutputDerivatives, OutputReference, OutputZeroing};
use crate::params::{BalanceLawKind, BalanceParams};
use crate::predictive::{Predicted, Predictive, SteeringRoom, Trouble};
use crate::roll_model::{RollModel, TurnMoment};

/// What the balance law answers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BalanceOutput {
    /// Torque of the body on the balancer, N m, within the motor's limit.
    pub torque: f64,
    /// Whether the limit cut it.
    pub saturated: bool,
    /// `D / D_upright`: one upright and at rest, zero where the balancer loses its authority.
    pub decoupling: f64,
    /// Whether another law stood in for the chosen one: linear-quadratic feedback where the
    /// balancer has hardly any authority, output zeroing where the prediction failed.
    pub fallback: bool,
    /// `T_hat`, N m: the estimated roll moment.
    pub moment_estimate: f64,
    /// `y`, kg m^2/s: the output that is being zeroed.
    pub output: f64,
    /// Steering rate that the predictive law adds to the follower's, rad/s.
    pub steer_rate: f64,
}

/// What a law is based on at a tick.
#[derive(Debug, Clone, Copy)]
struct Observed {
    estimate: f64,
    reference: OutputReference,
    d: OutputDerivatives,
    decoupling: f64,
}

/// The balance law at a movable balancer offset.
#[derive(Debug, Clone, PartialEq)]
pub struct BalanceLaw {
    bike: BikeParams,
    kind: BalanceLawKind,
    zeroing: OutputZeroing,
    model: RollModel,
    upright_decoupling: f64,
    observer: Option<RollMomentObserver>,
    /// Feedback gains at the offsets of flywheel and balancer mode.
    gains: [(f64, Vector4<f64>); 2],
    guard: f64,
    predictive: Option<Predictive>,
    handover: Handover,
}

/// Takes the step out of a change from one law to another: the difference at the change fades.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Handover {
    last: Option<(BalanceLawKind, f64)>,
    step: f64,
}

impl Handover {
    /// How long the difference lasts, s: short beside the 0.28 s in which the bike topples.
    const TIME: f64 = 0.05;

    /// The torque on the way from the last law to `kind`, which wants `torque` N m, within `limit`.
    fn pass(&mut self, kind: BalanceLawKind, torque: f64, limit: f64, dt: f64) -> f64 {
        match self.last {
            Some((before, given)) if before != kind => {
                self.step = given - torque.clamp(-limit, limit);
            }
            _ => self.step *= (-dt / Self::TIME).exp(),
        }
        if self.step.abs() < 1e-9 {
            self.step = 0.0;
        }
        torque + self.step
    }
}

impl BalanceLaw {
    /// For a bike whose balancer sits at `offset`, m.
    ///
    /// # Errors
    ///
    /// [`ControlError::NoBalanceAuthority`] if the balancer cannot control the roll there, and
    /// [`ControlError::NoStabilisingGain`] if the fallback gain does not exist.
    pub fn new(
        bike: &BikeParams,
        params: &BalanceParams,
        offset: f64,
    ) -> Result<Self, ControlError> {
        /// Below this share of the toppling stiffness, authority is rounding.
        const AUTHORITY: f64 = 1e-4;
        let model = RollModel::new(bike, offset);
        let decoupling = model.upright_decoupling();
        if decoupling.abs() < AUTHORITY * model.toppling_stiffness() || !decoupling.is_finite() {
            return Err(ControlError::NoBalanceAuthority {
                offset,
                decoupling: decoupling / model.inertia.m11(0.0),
            });
        }
        let gain = |mode: BalancerMode| {
            let d = bike.offset(mode);
            lqr::gain(&TwoLink::new(bike, d), &params.weights(mode)).map(|k| (d, k))
        };
        Ok(Self {
            bike: *bike,
            kind: params.controller,
            zeroing: OutputZeroing::new(params.kappa, params.poles),
            model,
            upright_decoupling: decoupling,
            observer: params
                .observer
                .then(|| RollMomentObserver::new(params.observer_rate, params.observer_moment_max)),
            gains: [gain(BalancerMode::Flywheel)?, gain(BalancerMode::Balancer)?],
            guard: params.decoupling_guard,
            predictive: (params.controller == BalanceLawKind::Mpc)
                .then(|| Predictive::new(bike, params))
                .transpose()?,
            handover: Handover::default(),
        })
    }

    /// The roll model at the present offset.
    #[must_use]
    pub fn model(&self) -> &RollModel {
        &self.model
    }

    /// Whether the law plans the steering assist itself.
    #[must_use]
    pub fn plans_steering(&self) -> bool {
        self.kind == BalanceLawKind::Mpc
    }

    /// Goes over to the law that `params` name, without a bump: the difference of the two torques
    /// fades within some 50 ms. The predictive law takes memory here and never later.
    ///
    /// # Errors
    ///
    /// [`ControlError::NoStabilisingGain`] if its weights have no cost to go.
    pub fn change_law(&mut self, params: &BalanceParams) -> Result<(), ControlError> {
        if params.controller == BalanceLawKind::Mpc && self.kind != BalanceLawKind::Mpc {
            self.predictive = Some(Predictive::new(&self.bike, params)?);
        }
        self.kind = params.controller;
        Ok(())
    }

    /// The estimated roll moment, N m; zero without an observer.
    #[must_use]
    pub fn moment_estimate(&self) -> f64 {
        self.observer.map_or(0.0, |observer| observer.moment())
    }

    /// Follows a shift of the balancer to `offset`, m.
    pub fn set_offset(&mut self, offset: f64) {
        if offset != self.model.offset {
            self.model = RollModel::new(&self.bike, offset);
            self.upright_decoupling = self.model.upright_decoupling();
        }
    }

    /// The torque for this period: `state` as measured, the turn the bike is in, the lean
    /// reference without the observer's share, and what steering may do for the balance.
    pub fn tick(
        &mut self,
        state: &TwoLinkState,
        turn: &TurnMoment,
        lean: &OutputReference,
        room: Option<&SteeringRoom>,
        dt: f64,
    ) -> BalanceOutput {
        let seen = self.observe(state, turn, lean, dt);
        let Observed {
            estimate,
            reference,
            d,
            decoupling,
        } = &seen;
        let kind = if decoupling.abs() < self.guard {
            BalanceLawKind::Lqr
        } else {
            self.kind
        };
        let predicted = (kind == BalanceLawKind::Mpc)
            .then(|| self.predict(state, turn, reference, *estimate, room, dt))
            .flatten();
        let (kind, wanted) = match (kind, predicted) {
            (BalanceLawKind::Mpc, Some(predicted)) => (kind, predicted.torque),
            (BalanceLawKind::Lqr, _) => (kind, self.quadratic_torque(state, turn, reference)),
            _ => {
                let w = self.zeroing.balancer_acceleration(d);
                (
                    BalanceLawKind::OutputZeroing,
                    OutputZeroing::torque(&self.model, state, turn, d, w),
                )
            }
        };
        let limit = self.bike.balancer_torque_max;
        let wanted = self.handover.pass(kind, wanted, limit, dt);
        self.handover.last = Some((kind, wanted.clamp(-limit, limit)));
        BalanceOutput {
            fallback: kind != self.kind,
            steer_rate: predicted.map_or(0.0, |predicted| predicted.steer_rate),
            ..self.given(wanted, state, &seen)
        }
    }

    /// The same with the torque of a law from outside in place of ours, told of `time`, s.
    ///
    /// # Errors
    ///
    /// What it declines, or a torque that is no number.
    pub fn tick_by(
        &mut self,
        balancer: &mut dyn ExternalBalancer,
        time: f64,
        state: &TwoLinkState,
        turn: &TurnMoment,
        lean: &OutputReference,
        dt: f64,
    ) -> Result<BalanceOutput, ControlError> {
        let seen = self.observe(state, turn, lean, dt);
        let view = BalancerView {
            time,
            period: dt,
            state,
            turn,
            reference: seen.reference,
            moment_estimate: seen.estimate,
            offset: self.model.offset,
        };
        let wanted = asked_balancer(balancer, &view)?;
        Ok(self.given(wanted, state, &seen))
    }

    /// What every law is based on: the observer's estimate, the lean with its share, the output.
    fn observe(
        &mut self,
        state: &TwoLinkState,
        turn: &TurnMoment,
        lean: &OutputReference,
        dt: f64,
    ) -> Observed {
        let estimate = if let Some(observer) = &mut self.observer {
            let modelled = self.model.gravity(state).value + self.model.turning(state, turn).value;
            observer.update(self.model.momentum(state), modelled, dt);
            observer.moment()
        } else {
            0.0
        };
        let reference = OutputReference {
            value: lean.value - estimate / self.model.toppling_stiffness(),
            derivatives: lean.derivatives,
        };
        let d = self
            .zeroing
            .derivatives(&self.model, state, turn, estimate, &reference);
        Observed {
            estimate,
            reference,
            decoupling: d.decoupling / self.upright_decoupling,
            d,
        }
    }

    /// The answer that `wanted` N m come to within the limits of the motor.
    fn given(&self, wanted: f64, state: &TwoLinkState, seen: &Observed) -> BalanceOutput {
        let limit = self.bike.balancer_torque_max;
        let mut torque = wanted.clamp(-limit, limit);
        if state.balancer_rate.abs() >= self.bike.balancer_speed_max
            && torque * state.balancer_rate > 0.0
        {
            torque = 0.0;
        }
        BalanceOutput {
            torque,
            saturated: torque != wanted,
            decoupling: seen.decoupling,
            fallback: false,
            moment_estimate: seen.estimate,
            output: seen.d.y,
            steer_rate: 0.0,
        }
    }

    /// Feedback about the reference lean with the torque that holds the balancer still on it.
    fn quadratic_torque(
        &self,
        state: &TwoLinkState,
        turn: &TurnMoment,
        reference: &OutputReference,
    ) -> f64 {
        let [(d0, k0), (d1, k1)] = self.gains;
        let share = if d1 == d0 {
            0.0
        } else {
            ((self.model.offset - d0) / (d1 - d0)).clamp(0.0, 1.0)
        };
        let gain = k0 + (k1 - k0) * share;
        let p1 = reference.derivatives[0];
        let error = Vector4::new(
            state.roll - reference.value,
            state.balancer,
            state.roll_rate - p1,
            state.balancer_rate,
        );
        self.held_torque(turn, reference) - gain.dot(&error)
    }

    /// The torque that holds the balancer still while the body is on the reference, N m.
    fn held_torque(&self, turn: &TurnMoment, reference: &OutputReference) -> f64 {
        let held = on_reference(reference);
        self.model.inertia.m12(0.0) * reference.derivatives[1]
            - self.model.balancer_gravity(&held)
            - self.model.turning_joint(&held, turn)
    }

    /// The predictive law, asked in the frame that leans with the reference.
    fn predict(
        &mut self,
        state: &TwoLinkState,
        turn: &TurnMoment,
        reference: &OutputReference,
        estimate: f64,
        room: Option<&SteeringRoom>,
        dt: f64,
    ) -> Option<Predicted> {
        let [p1, p2, ..] = reference.derivatives;
        let held = on_reference(reference);
        let off = TwoLinkState {
            roll: state.roll - reference.value,
            roll_rate: state.roll_rate - p1,
            ..*state
        };
        let trouble = Trouble {
            roll: off.roll,
            momentum: self.model.momentum(&off),
            balancer: off.balancer,
            balancer_rate: off.balancer_rate,
            moment: self.model.gravity(&held).value
                + self.model.turning(&held, turn).value
                + estimate
                - self.model.inertia.m11(0.0) * p2,
            held_torque: self.held_torque(turn, reference),
        };
        self.predictive
            .as_mut()?
            .tick(&self.model, &trouble, room, dt)
    }
}

/// On the reference lean with the balancer still.
fn on_reference(reference: &OutputReference) -> TwoLinkState {
    TwoLinkState {
        roll: reference.value,
        ..TwoLinkState::default()
    }
}

/// Balance alone: holds the two-link model upright.
#[derive(Debug, Clone, PartialEq)]
pub struct BalanceController {
    law: BalanceLaw,
    period: f64,
}

impl BalanceController {
    /// For `bike` in `mode`, called every `control_period` seconds.
    ///
    /// # Errors
    ///
    /// As [`BalanceLaw::new`], and [`ControlError::ControlPeriod`].
    pub fn new(
        bike: &BikeParams,
        mode: BalancerMode,
        params: &BalanceParams,
        control_period: f64,
    ) -> Result<Self, ControlError> {
        check_period(control_period)?;
        Ok(Self {
            law: BalanceLaw::new(bike, params, bike.offset(mode))?,
            period: control_period,
        })
    }

    /// Follows a shift of the balancer to `offset`, m.
    pub fn set_offset(&mut self, offset: f64) {
        self.law.set_offset(offset);
    }

    /// As [`BalanceLaw::change_law`].
    ///
    /// # Errors
    ///
    /// As there.
    pub fn change_law(&mut self, params: &BalanceParams) -> Result<(), ControlError> {
        self.law.change_law(params)
    }

    /// The torque for a roll state, without a measurement around it. A state that is not finite
    /// gives a torque that is not finite.
    pub fn torque(&mut self, state: &TwoLinkState) -> BalanceOutput {
        self.law.tick(
            state,
            &TurnMoment::default(),
            &OutputReference::default(),
            None,
            self.period,
        )
    }

    /// As [`BalanceController::torque`], with the law that `external` lends in place of ours.
    ///
    /// # Errors
    ///
    /// As [`BalanceLaw::tick_by`].
    pub fn torque_with(
        &mut self,
        state: &TwoLinkState,
        external: &mut External<'_>,
    ) -> Result<BalanceOutput, ControlError> {
        let Some(balancer) = external.balancer.as_deref_mut() else {
            return Ok(self.torque(state));
        };
        self.law.tick_by(
            balancer,
            external.time,
            state,
            &TurnMoment::default(),
            &OutputReference::default(),
            self.period,
        )
    }
}

impl Controller for BalanceController {
    type Output = BalanceOutput;

    fn tick(&mut self, measurement: &Measurement) -> Result<BalanceOutput, ControlError> {
        check_finite(measurement)?;
        Ok(self.torque(&TwoLinkState::from(measurement)))
    }
}

/// Refuses control periods that are no time or far too long to balance with.
pub(crate) fn check_period(period: f64) -> Result<(), ControlError> {
    if period > 0.0 && period <= 0.1 {
        Ok(())
    } else {
        Err(ControlError::ControlPeriod { period })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_over_where_the_decoupling_term_nearly_vanishes() {
        let bike = BikeParams::default();
        let mut law = BalanceLaw::new(&bike, &BalanceParams::default(), 0.0).unwrap();
        let tick = |law: &mut BalanceLaw, roll: f64| {
            let state = TwoLinkState {
                roll,
                ..TwoLinkState::default()
            };
            law.tick(
                &state,
                &TurnMoment::default(),
                &OutputReference::default(),
                None,
                0.005,
            )
        };
        let upright = tick(&mut law, 0.0);
        assert!(
            (upright.decoupling - 1.0).abs() < 1e-12 && !upright.fallback && upright.torque == 0.0
        );
        // In flywheel mode D falls with the cosine of the roll: below a tenth beyond 84 deg.
        let lying = tick(&mut law, 85f64.to_radians());
        assert!(lying.fallback && lying.torque.is_finite());
        assert!(!tick(&mut law, 80f64.to_radians()).fallback);
    }

    #[test]
    fn only_brakes_a_balancer_at_its_greatest_speed() {
        let bike = BikeParams::default();
        let mut law = BalanceLaw::new(&bike, &BalanceParams::default(), 0.0).unwrap();
        for (roll, rate) in [(0.1, 40.5), (-0.1, -40.5)] {
            let state = TwoLinkState {
                roll,
                balancer_rate: rate,
                ..TwoLinkState::default()
            };
            let out = law.tick(
                &state,
                &TurnMoment::default(),
                &OutputReference::default(),
                None,
                0.005,
            );
            assert!(out.torque * rate <= 0.0, "{out:?}");
        }
    }

    #[test]
    fn refuses_a_bike_whose_balancer_has_no_authority() {
        // A balancer without inertia of its own, pivoted in the bike's centre: nothing to push against.
        let bike = BikeParams {
            i2x: 0.0,
            ..BikeParams::default()
        };
        assert!(matches!(
            BalanceLaw::new(&bike, &BalanceParams::default(), 0.0),
            Err(ControlError::NoBalanceAuthority { .. })
        ));
    }

    #[test]
    fn parameters_survive_being_written_down() {
        let params = BalanceParams {
            kappa: 1.5,
            preview: false,
            ..BalanceParams::default()
        };
        let text = serde_json::to_string(&params).unwrap();
        assert!(text.contains("kappa_per_s"));
        assert_eq!(
            serde_json::from_str::<BalanceParams>(&text).unwrap(),
            params
        );
        assert!(serde_json::from_str::<BalanceParams>(r#"{"kapa_per_s": 1.0}"#).is_err());
        assert_eq!(
            serde_json::from_str::<crate::FollowParams>("{}").unwrap(),
            crate::FollowParams::default()
        );
    }
}
