//! What watches the margins while riding, and acts before one is gone: the scenario's `[supervisor]`.
//!
//! Five margins are watched on the nominal model: balancer speed, time at the torque limit, the divergent
//! component of the roll, the least wheel load and the friction in use. When one runs out, the bike leaves
//! balancer mode for flywheel mode, which is the stronger against disturbances, and slows down. It goes back to
//! its speed when every margin has been wide open for a while; it does not go back to balancer mode by itself.
//! Both moves are smooth: the offset by a quintic, the speed at a limited rate.

use bikebot_dynamics::BalancerMode;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Watching the margins: the scenario's `[supervisor]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SupervisorParams {
    /// Watch the margins and act.
    pub enabled: bool,
    /// Leave balancer mode when a margin runs out; needs a bike that can change its mode while riding.
    pub to_flywheel: bool,
    /// Share of the speed that is left when a margin has run out; 1 does not slow down.
    #[schemars(range(min = 0.2, max = 1.0))]
    pub slow_share: f64,
    /// Balancer speed in balancer mode, rad/s: at 11.7 the offset mass takes half the weight off the wheels.
    #[serde(rename = "balancer_mode_speed_max_radps")]
    #[schemars(range(min = 0.1, max = 100.0))]
    pub balancer_mode_speed: f64,
    /// Balancer speed in flywheel mode, as a share of the motor's largest.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub flywheel_speed_share: f64,
    /// Time at the torque limit, s; it runs down again as fast as it ran up.
    #[serde(rename = "saturation_max_s")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub saturation: f64,
    /// Divergent component of the roll error, rad: 0.24 is what the torque can still stop.
    #[serde(rename = "divergent_max_rad")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub divergent: f64,
    /// Least load of either wheel, N.
    #[serde(rename = "wheel_load_min_n")]
    #[schemars(range(min = 0.0, max = 10000.0))]
    pub wheel_load: f64,
    /// Share of the friction in use.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub friction_use_max: f64,
    /// A margin is wide open again when no more than this share of it is used.
    #[schemars(range(min = 0.1, max = 0.95))]
    pub calm_share: f64,
    /// How long every margin has to be wide open before the speed comes back, s.
    #[serde(rename = "calm_s")]
    #[schemars(range(min = 0.1, max = 60.0))]
    pub calm: f64,
    /// How fast the bike slows down and speeds up again, m/s^2.
    #[serde(rename = "deceleration_mps2")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub deceleration: f64,
    /// How long the shift to flywheel mode takes, s.
    #[serde(rename = "shift_s")]
    #[schemars(range(min = 1.0, max = 60.0))]
    pub shift: f64,
}

impl Default for SupervisorParams {
    fn default() -> Self {
        Self {
            enabled: false,
            to_flywheel: true,
            slow_share: 0.6,
            balancer_mode_speed: 8.0,
            flywheel_speed_share: 0.7,
            saturation: 0.15,
            divergent: 0.12,
            wheel_load: 60.0,
            friction_use_max: 0.7,
            calm_share: 0.6,
            calm: 2.0,
            deceleration: 0.3,
            shift: 1.0,
        }
    }
}

/// A margin that is watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Margin {
    /// The balancer's speed.
    BalancerSpeed,
    /// Time at the torque limit.
    Saturation,
    /// The divergent component of the roll error.
    Divergent,
    /// The least wheel load.
    WheelLoad,
    /// The friction in use.
    Friction,
}

impl Margin {
    /// In words, for events.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::BalancerSpeed => "the balancer's speed",
            Self::Saturation => "the time at the torque limit",
            Self::Divergent => "the divergent roll",
            Self::WheelLoad => "a wheel's load",
            Self::Friction => "the friction in use",
        }
    }
}

/// What the guardian has decided in a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Intervention {
    /// To flywheel mode, for this margin, of which this share is used.
    ToFlywheel(Margin, f64),
    /// Slower, for this margin, of which this share is used.
    SlowDown(Margin, f64),
    /// Back to the speed of the profile.
    SpeedUp,
}

/// What is watched at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watched {
    /// The mode the bike is in.
    pub mode: BalancerMode,
    /// A shift waits or runs.
    pub is_shifting: bool,
    /// `|beta'|`, rad/s.
    pub balancer_speed: f64,
    /// The torque is at its limit.
    pub saturated: bool,
    /// Divergent component of the roll error, rad.
    pub divergent: f64,
    /// Least load of either wheel, N, by the nominal model.
    pub wheel_load: f64,
    /// Greatest share of the friction in use, by the nominal model.
    pub friction_use: f64,
    /// Speed of the bike, m/s.
    pub speed: f64,
}

/// Watches the margins of one ride.
#[derive(Debug, Clone, PartialEq)]
pub struct Guardian {
    params: SupervisorParams,
    speed_max: f64,
    /// Load of the lighter wheel at rest, N.
    resting_load: f64,
    can_shift: bool,
    saturated_for: f64,
    calm_for: f64,
    is_slow: bool,
    /// Flywheel mode has been asked for and not been reached yet.
    has_left: bool,
    share: f64,
}

impl Guardian {
    /// For a balancer of `speed_max` (rad/s) on a bike whose lighter wheel carries `resting_load` (N) at rest and
    /// that can, or cannot, change its mode while riding.
    #[must_use]
    pub fn new(
        params: &SupervisorParams,
        speed_max: f64,
        resting_load: f64,
        can_shift: bool,
    ) -> Self {
        Self {
            params: params.clone(),
            speed_max,
            resting_load,
            can_shift,
            saturated_for: 0.0,
            calm_for: 0.0,
            is_slow: false,
            has_left: false,
            share: 1.0,
        }
    }

    /// Share of the profile's speed to be ridden now.
    #[must_use]
    pub fn speed_share(&self) -> f64 {
        self.share
    }

    /// How long a shift takes, s.
    #[must_use]
    pub fn shift_duration(&self) -> f64 {
        self.params.shift
    }

    /// Advances by `dt` (s).
    pub fn tick(&mut self, watched: &Watched, dt: f64) -> Option<Intervention> {
        if !self.params.enabled {
            return None;
        }
        let change = if watched.saturated { dt } else { -dt };
        self.saturated_for =
            (self.saturated_for + change).clamp(0.0, 10.0 * self.params.saturation);
        self.has_left &= watched.mode == BalancerMode::Balancer;
        let (margin, used) = self.worst(watched);
        let p = &self.params;
        self.calm_for = if used <= p.calm_share {
            self.calm_for + dt
        } else {
            0.0
        };
        let target = if self.is_slow { p.slow_share } else { 1.0 };
        let most = p.deceleration / watched.speed.max(0.5) * dt;
        self.share += (target - self.share).clamp(-most, most);

        if used >= 1.0 {
            let leaves = p.to_flywheel
                && self.can_shift
                && watched.mode == BalancerMode::Balancer
                && !watched.is_shifting
                && !self.has_left;
            if leaves {
                self.has_left = true;
                return Some(Intervention::ToFlywheel(margin, used));
            }
            if !self.is_slow && p.slow_share < 1.0 {
                self.is_slow = true;
                return Some(Intervention::SlowDown(margin, used));
            }
        } else if self.is_slow && self.calm_for >= p.calm {
            self.is_slow = false;
            return Some(Intervention::SpeedUp);
        }
        None
    }

    /// The margin that is used most, and its share.
    fn worst(&self, watched: &Watched) -> (Margin, f64) {
        let p = &self.params;
        let speed_limit = match watched.mode {
            BalancerMode::Balancer => p.balancer_mode_speed,
            BalancerMode::Flywheel => p.flywheel_speed_share * self.speed_max,
        };
        // Of the load at rest, what may be taken away.
        let lightened =
            (self.resting_load - watched.wheel_load) / (self.resting_load - p.wheel_load).max(1.0);
        [
            (Margin::BalancerSpeed, watched.balancer_speed / speed_limit),
            (Margin::Saturation, self.saturated_for / p.saturation),
            (Margin::Divergent, watched.divergent.abs() / p.divergent),
            (Margin::WheelLoad, lightened),
            (Margin::Friction, watched.friction_use / p.friction_use_max),
        ]
        .into_iter()
        // The first of equals, and what is no number is gone.
        .fold(
            (Margin::BalancerSpeed, f64::NEG_INFINITY),
            |worst, (margin, used)| {
                if used <= worst.1 {
                    worst
                } else {
                    (margin, used)
                }
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.005;

    fn calm() -> Watched {
        Watched {
            mode: BalancerMode::Balancer,
            is_shifting: false,
            balancer_speed: 1.0,
            saturated: false,
            divergent: 0.01,
            wheel_load: 170.0,
            friction_use: 0.1,
            speed: 1.5,
        }
    }

    fn guardian() -> Guardian {
        let params = SupervisorParams {
            enabled: true,
            ..SupervisorParams::default()
        };
        Guardian::new(&params, 40.0, 170.0, true)
    }

    #[test]
    fn leaves_balancer_mode_first_and_slows_down_then() {
        let mut guardian = guardian();
        let fast = Watched {
            balancer_speed: 9.0,
            ..calm()
        };
        assert!(matches!(
            guardian.tick(&fast, DT),
            Some(Intervention::ToFlywheel(Margin::BalancerSpeed, used)) if used > 1.1
        ));
        let shifting = Watched {
            is_shifting: true,
            ..fast
        };
        assert!(matches!(
            guardian.tick(&shifting, DT),
            Some(Intervention::SlowDown(..))
        ));
        assert_eq!(guardian.tick(&shifting, DT), None);
    }

    #[test]
    fn comes_back_only_after_a_calm_while_and_never_with_a_jump() {
        let mut guardian = guardian();
        let slipping = Watched {
            friction_use: 0.8,
            mode: BalancerMode::Flywheel,
            ..calm()
        };
        assert!(matches!(
            guardian.tick(&slipping, DT),
            Some(Intervention::SlowDown(Margin::Friction, _))
        ));
        let middling = Watched {
            friction_use: 0.5,
            ..slipping
        };
        let quiet = Watched {
            mode: BalancerMode::Flywheel,
            ..calm()
        };
        let mut before = guardian.speed_share();
        let mut follow = |guardian: &mut Guardian, watched: &Watched, ticks: usize| {
            let mut said = Vec::new();
            for tick in 0..ticks {
                said.extend(guardian.tick(watched, DT).map(|_| tick));
                // 0.3 m/s² at 1.5 m/s.
                assert!((guardian.speed_share() - before).abs() <= 0.2 * DT + 1e-12);
                before = guardian.speed_share();
            }
            said
        };
        // Neither gone nor wide open: nothing changes.
        assert!(follow(&mut guardian, &middling, 2000).is_empty());
        assert!((guardian.speed_share() - 0.6).abs() < 1e-9);
        // Two seconds at 5 ms a tick, but for the rounding of the sum.
        let back = follow(&mut guardian, &quiet, 2000);
        assert!(
            back.len() == 1 && (399..=401).contains(&back[0]),
            "{back:?}"
        );
        assert!((guardian.speed_share() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_short_saturation_is_forgiven() {
        let mut guardian = guardian();
        for tick in 0..2000 {
            let watched = Watched {
                saturated: tick % 2 == 0,
                ..calm()
            };
            assert_eq!(guardian.tick(&watched, DT), None);
        }
        let saturated = Watched {
            saturated: true,
            ..calm()
        };
        let first = (0..100).find(|_| guardian.tick(&saturated, DT).is_some());
        assert_eq!(first, Some(29));
    }

    #[test]
    fn unless_enabled_it_does_nothing() {
        let mut guardian = Guardian::new(&SupervisorParams::default(), 40.0, 170.0, true);
        let bad = Watched {
            wheel_load: -10.0,
            ..calm()
        };
        assert_eq!(guardian.tick(&bad, DT), None);
        assert_eq!(guardian.speed_share(), 1.0);
    }
}
