//! When to start, cruise, brake and hold, and when the balancer may be shifted.

use bikebot_dynamics::{BalancerMode, BikeParams, ModeChangeCondition, Offset};

use crate::error::ControlError;

/// What the bike is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Setting off: slower than the floor of the steering law.
    #[default]
    Start,
    /// Following the path at the speed of its profile.
    Cruise,
    /// Coming to rest with the rear contact on the end of the path.
    Brake,
    /// Standing upright.
    Hold,
}

/// What the conditions of a shift look at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftConditions {
    /// Commanded acceleration along the path, m/s^2.
    pub acceleration: f64,
    /// Divergent component of the roll error, rad.
    pub divergent: f64,
    /// Balancer angle, rad.
    pub balancer: f64,
    /// Balancer rate, rad/s.
    pub balancer_rate: f64,
}

impl ShiftConditions {
    /// Whether the balancer may be shifted now.
    #[must_use]
    pub fn hold(&self) -> bool {
        /// A speed that changes slower than this counts as constant, m/s^2.
        const ACCELERATION: f64 = 0.1;
        self.acceleration.abs() < ACCELERATION
            && self.divergent.abs() < 2f64.to_radians()
            && self.balancer.abs() < 0.2
            && self.balancer_rate.abs() < 1.0
    }

    /// Whether the balancer may be shifted because it has to be: when it swings through its slowest moment.
    #[must_use]
    pub fn hold_in_need(&self) -> bool {
        self.divergent.abs() < 6f64.to_radians() && self.balancer_rate.abs() < 3.0
    }
}

/// A shift of the balancer: waiting for its conditions, then a quintic of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeChange {
    /// The mode to go to.
    pub mode: BalancerMode,
    /// Duration of the shift, s.
    pub duration: f64,
    from: f64,
    to: f64,
    elapsed: Option<f64>,
    /// It cannot wait for a calm moment.
    is_urgent: bool,
}

impl ModeChange {
    /// Least duration of a shift, s.
    pub const MIN_DURATION: f64 = 1.0;

    /// Whether the shift has begun.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.elapsed.is_some()
    }

    /// Offset, rate and acceleration `elapsed` seconds into the shift: at rest at both ends.
    #[must_use]
    fn offset(&self, elapsed: f64) -> Offset {
        let u = (elapsed / self.duration).clamp(0.0, 1.0);
        let span = self.to - self.from;
        let (u2, t) = (u * u, self.duration);
        Offset {
            d: self.from + span * u2 * u * (10.0 - 15.0 * u + 6.0 * u2),
            rate: span / t * 30.0 * u2 * (1.0 - u) * (1.0 - u),
            acceleration: span / (t * t) * 60.0 * u * (1.0 - 3.0 * u + 2.0 * u2),
        }
    }
}

/// Moves the balancer between its two offsets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supervisor {
    mode: BalancerMode,
    offsets: [f64; 2],
    offset: Offset,
    change: Option<ModeChange>,
    /// Why the offset may not be shifted, if it may not.
    singular: Option<ModeChangeCondition>,
}

impl Supervisor {
    /// Starts in `mode`. Whether mode changes are possible is settled here, by the singularity
    /// condition: the centre of percussion of the frame must lie below a bound.
    #[must_use]
    pub fn new(bike: &BikeParams, mode: BalancerMode) -> Self {
        let condition = bike.mode_change_is_possible();
        Self {
            mode,
            offsets: [
                bike.offset(BalancerMode::Flywheel),
                bike.offset(BalancerMode::Balancer),
            ],
            offset: Offset {
                d: bike.offset(mode),
                rate: 0.0,
                acceleration: 0.0,
            },
            change: None,
            singular: (!condition.is_met()).then_some(condition),
        }
    }

    /// The mode the bike is in, or was in before the shift under way.
    #[must_use]
    pub fn mode(&self) -> BalancerMode {
        self.mode
    }

    /// The balancer offset commanded now.
    #[must_use]
    pub fn offset(&self) -> Offset {
        self.offset
    }

    /// The mode change that waits or runs.
    #[must_use]
    pub fn change(&self) -> Option<ModeChange> {
        self.change
    }

    /// Asks for another mode. The shift begins as soon as its conditions hold; asking for the
    /// present mode does nothing.
    ///
    /// # Errors
    ///
    /// [`ControlError::SingularModeChange`] if the shift would pass a singular offset,
    /// [`ControlError::ModeChangeUnderWay`] during another one, and
    /// [`ControlError::ModeChangeTooQuick`] below [`ModeChange::MIN_DURATION`].
    pub fn request(&mut self, mode: BalancerMode, duration: f64) -> Result<(), ControlError> {
        self.ask(mode, duration, false)
    }

    /// As [`Supervisor::request`], for a change that cannot wait for a calm moment: it begins with the next
    /// slow moment of the balancer. A change that still waits gives way to it.
    ///
    /// # Errors
    ///
    /// As [`Supervisor::request`].
    pub fn request_urgently(
        &mut self,
        mode: BalancerMode,
        duration: f64,
    ) -> Result<(), ControlError> {
        if self.change.is_some_and(|change| !change.is_moving()) {
            self.change = None;
        }
        self.ask(mode, duration, true)
    }

    fn ask(
        &mut self,
        mode: BalancerMode,
        duration: f64,
        is_urgent: bool,
    ) -> Result<(), ControlError> {
        if let Some(ModeChangeCondition {
            percussion_height,
            bound,
        }) = self.singular
        {
            return Err(ControlError::SingularModeChange {
                percussion_height,
                bound,
            });
        }
        if self.change.is_some() {
            return Err(ControlError::ModeChangeUnderWay);
        }
        if !(duration >= ModeChange::MIN_DURATION && duration.is_finite()) {
            return Err(ControlError::ModeChangeTooQuick {
                duration,
                least: ModeChange::MIN_DURATION,
            });
        }
        if mode != self.mode {
            let to = self.offsets[usize::from(mode == BalancerMode::Balancer)];
            self.change = Some(ModeChange {
                mode,
                duration,
                from: self.offset.d,
                to,
                elapsed: None,
                is_urgent,
            });
        }
        Ok(())
    }

    /// Advances a shift by `dt` seconds; true while the offset moves.
    pub fn tick(&mut self, conditions: &ShiftConditions, dt: f64) -> bool {
        let Some(mut change) = self.change else {
            return false;
        };
        let elapsed = match change.elapsed {
            Some(elapsed) => elapsed + dt,
            None if conditions.hold() || change.is_urgent && conditions.hold_in_need() => dt,
            None => return false,
        };
        change.elapsed = Some(elapsed);
        self.offset = change.offset(elapsed);
        self.change = if elapsed >= change.duration {
            self.mode = change.mode;
            self.offset = Offset {
                d: change.to,
                rate: 0.0,
                acceleration: 0.0,
            };
            None
        } else {
            Some(change)
        };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CALM: ShiftConditions = ShiftConditions {
        acceleration: 0.0,
        divergent: 0.0,
        balancer: 0.0,
        balancer_rate: 0.0,
    };

    #[test]
    fn refuses_a_shift_through_a_singular_offset() {
        let mut supervisor = Supervisor::new(&BikeParams::low_pivot(), BalancerMode::Flywheel);
        let refused = supervisor.request(BalancerMode::Balancer, 2.0);
        assert!(matches!(
            refused,
            Err(ControlError::SingularModeChange { .. })
        ));
    }

    #[test]
    fn refuses_a_shift_quicker_than_a_second() {
        let mut supervisor = Supervisor::new(&BikeParams::default(), BalancerMode::Flywheel);
        assert!(matches!(
            supervisor.request(BalancerMode::Balancer, 0.5),
            Err(ControlError::ModeChangeTooQuick { .. })
        ));
    }

    #[test]
    fn waits_until_the_balancer_is_quiet_then_shifts_smoothly() {
        let mut supervisor = Supervisor::new(&BikeParams::default(), BalancerMode::Flywheel);
        supervisor.request(BalancerMode::Balancer, 1.0).unwrap();
        assert!(!supervisor.tick(
            &ShiftConditions {
                balancer: 0.5,
                ..CALM
            },
            0.005
        ));
        let mut integral = 0.0;
        let mut before = supervisor.offset();
        while supervisor.tick(&CALM, 0.005) {
            let now = supervisor.offset();
            integral += 0.0025 * (before.rate + now.rate);
            before = now;
        }
        assert_eq!(supervisor.mode(), BalancerMode::Balancer);
        // Trapezoidal rule over 200 steps of a smooth bump.
        assert!((integral - 0.15).abs() < 1e-6);
        assert_eq!(supervisor.offset().d, 0.15);
    }
}
