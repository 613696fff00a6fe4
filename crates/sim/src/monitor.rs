//! What is watched at each tick, whatever the controller believes: friction, wheel loads, roll,
//! clearance, passivity, decoupling, finiteness. All of it is judged on the true state.

use crate::clock::{Period, SimTime};
use crate::outcome::RunOutcome;
use bikebot_control::AugmentedEnergy;
use bikebot_dynamics::{BikeState, ContactForces};

/// |roll| at which the bike counts as fallen, rad.
pub const FALL_ROLL: f64 = 0.7;
/// How long the friction may be exceeded before it counts as a slip, s.
pub const SLIP_TIME: f64 = 0.020;
/// How long a fall has to be beyond recovery before it is called, s.
pub const BEYOND_RECOVERY_TIME: f64 = 0.050;
/// How long a wheel may be off the ground, s.
pub const WHEEL_LIFT_TIME: f64 = 0.050;

/// Why the ride cannot go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verdict {
    /// How it ended.
    pub outcome: RunOutcome,
    /// One of a closed list: [`FALL_REASONS`](crate::fall_cause::FALL_REASONS), or `obstacle`.
    pub reason: &'static str,
}

/// Watches the contact forces for slip and wheel lift, and the state for a fall.
#[derive(Debug, Clone)]
pub struct FallMonitor {
    tick: Period,
    slipping: SimTime,
    lifted: SimTime,
    falling: SimTime,
}

impl FallMonitor {
    /// A monitor called once per `tick`.
    #[must_use]
    pub fn new(tick: Period) -> Self {
        Self {
            tick,
            slipping: SimTime::ZERO,
            lifted: SimTime::ZERO,
            falling: SimTime::ZERO,
        }
    }

    /// A tick in which nothing could keep the bike from falling any more, or in which something could: a
    /// fall that is certain is not waited for.
    pub fn give_up(&mut self, is_beyond_recovery: bool) -> Option<Verdict> {
        self.falling = if is_beyond_recovery {
            self.falling + self.tick
        } else {
            SimTime::ZERO
        };
        (self.falling >= SimTime::from_seconds(BEYOND_RECOVERY_TIME)).then_some(Verdict {
            outcome: RunOutcome::Fell,
            reason: "roll",
        })
    }

    /// Judges one tick, on ground with this friction under the rear and the front wheel; `None` while the
    /// ride may go on.
    pub fn judge(
        &mut self,
        state: &BikeState,
        contact: Option<&ContactForces>,
        friction: [f64; 2],
    ) -> Option<Verdict> {
        let fell = |reason| {
            Some(Verdict {
                outcome: RunOutcome::Fell,
                reason,
            })
        };
        if !state.is_finite() {
            return fell("not_finite");
        }
        if state.roll.abs() > FALL_ROLL {
            return fell("roll");
        }
        let contact = contact?;
        let on_ground = contact.both_wheels_down();
        // Without load there is no friction to exceed: a lifted wheel is judged as that.
        let slips = on_ground
            && (contact.slides
                || contact.friction_use_rear(friction[0]) > 1.0
                || contact.friction_use_front(friction[1]) > 1.0);
        self.slipping = if slips {
            self.slipping + self.tick
        } else {
            SimTime::ZERO
        };
        self.lifted = if on_ground {
            SimTime::ZERO
        } else {
            self.lifted + self.tick
        };
        if self.lifted >= SimTime::from_seconds(WHEEL_LIFT_TIME) {
            return fell("wheel_lift");
        }
        if self.slipping >= SimTime::from_seconds(SLIP_TIME) {
            return fell("slip");
        }
        None
    }
}

/// Share of the rear wheel's friction in use; `None` off the ground, where there is none to use.
pub(crate) fn loaded_use_rear(contact: &ContactForces, friction: f64) -> Option<f64> {
    (contact.rear_load > 0.0).then(|| contact.friction_use_rear(friction))
}

/// As [`loaded_use_rear`] for the front wheel.
pub(crate) fn loaded_use_front(contact: &ContactForces, friction: f64) -> Option<f64> {
    (contact.front_load > 0.0).then(|| contact.friction_use_front(friction))
}

/// Holds the augmented system of the path follower to its energy account.
///
/// The coupling of passive velocity field control does no work, so the stored energy, with the content of
/// the energy tank, may rise only by what the environment supplies; without a tank also by what the energy
/// regulator injects.
#[derive(Debug, Clone, Default)]
pub struct PassivityMonitor {
    violations: u64,
}

impl PassivityMonitor {
    /// Checks the account of one tick of `dt` seconds; `Some(excess)` in J where energy came from nowhere.
    pub fn check(&mut self, account: &AugmentedEnergy, dt: f64) -> Option<f64> {
        let excess = account.unexplained(dt);
        // Written so that an account that is not a number is a violation, too.
        if excess <= 0.0 {
            return None;
        }
        self.violations += 1;
        Some(excess)
    }

    /// Ticks that violated the account.
    #[must_use]
    pub fn violations(&self) -> u64 {
        self.violations
    }
}

/// Turns a condition into its first occurrence, so that a recording holds an event and not a stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct Edge(bool);

impl Edge {
    /// True in the tick in which `condition` becomes true.
    pub fn rises(&mut self, condition: bool) -> bool {
        let rises = condition && !self.0;
        self.0 = condition;
        rises
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Pose2;

    const GROUND: [f64; 2] = [0.7; 2];

    fn forces(front_load: f64, front_normal: f64) -> ContactForces {
        ContactForces {
            drive: 0.0,
            rear_lateral: 0.0,
            front_normal,
            rear_load: 300.0,
            front_load,
            slides: false,
        }
    }

    fn monitor() -> FallMonitor {
        FallMonitor::new(Period::from_seconds(0.005).expect("a whole number of nanoseconds"))
    }

    fn upright() -> BikeState {
        BikeState::upright(Pose2::new(0.0, 0.0, 0.0), 1.0)
    }

    #[test]
    fn a_slip_is_judged_after_twenty_milliseconds_and_not_before() {
        let mut monitor = monitor();
        let slip = forces(100.0, 71.0);
        for _ in 0..3 {
            assert_eq!(monitor.judge(&upright(), Some(&slip), GROUND), None);
        }
        assert_eq!(
            monitor
                .judge(&upright(), Some(&slip), GROUND)
                .map(|verdict| verdict.reason),
            Some("slip")
        );
    }

    #[test]
    fn a_tyre_that_is_seen_to_slide_slips_although_its_force_stays_inside_the_cone() {
        let mut monitor = monitor();
        let slides = ContactForces {
            slides: true,
            ..forces(100.0, 69.9)
        };
        let verdicts: Vec<_> = (0..4)
            .map(|_| monitor.judge(&upright(), Some(&slides), GROUND))
            .collect();
        assert_eq!(verdicts[3].map(|verdict| verdict.reason), Some("slip"));
    }

    #[test]
    fn a_short_slip_is_forgiven() {
        let mut monitor = monitor();
        for _ in 0..20 {
            for force in [71.0, 71.0, 71.0, 69.0] {
                assert_eq!(
                    monitor.judge(&upright(), Some(&forces(100.0, force)), GROUND),
                    None
                );
            }
        }
    }

    #[test]
    fn a_lifted_wheel_is_judged_after_fifty_milliseconds() {
        let mut monitor = monitor();
        let lifted = forces(-1.0, 0.0);
        let verdicts: Vec<_> = (0..10)
            .map(|_| monitor.judge(&upright(), Some(&lifted), GROUND))
            .collect();
        assert!(verdicts[..9].iter().all(Option::is_none));
        assert_eq!(
            verdicts[9].map(|verdict| verdict.reason),
            Some("wheel_lift")
        );
    }

    #[test]
    fn a_state_that_is_not_finite_is_a_fall_at_once() {
        let mut state = upright();
        state.roll_rate = f64::NAN;
        assert_eq!(
            monitor()
                .judge(&state, None, GROUND)
                .map(|verdict| verdict.reason),
            Some("not_finite")
        );
    }
}
