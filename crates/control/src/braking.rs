//! Braking to rest: what is promised, what the tyres allow, and the law that keeps the promise.
//!
//! A braking manoeuvre is a function of the way alone: the speed stays for a reaction time and then falls as
//!
//! ```text
//! v(x)^2 = v_0^2 - 2 a (x - v_0 t_r),
//! ```
//!
//! to rest a margin before the line. There are two of them. *Service* braking is what the riding speed is planned
//! with. *Emergency* braking is the least way in which the bike can be brought to rest, for a line that moves towards it.
//!
//! The rear wheel brakes alone. It carries the share `c = (w - x)/w` of the weight, less what braking moves to the
//! front wheel, and the same share of the lateral force; with `k` the share of the friction that may be used,
//!
//! ```text
//! a^2 + (c a_y)^2 <= k^2 mu^2 (c g - a h/w)^2
//! ```
//!
//! bounds the deceleration `a` in a bend with lateral acceleration `a_y`.

use bikebot_dynamics::BikeParams;
use bikebot_dynamics::constants::GRAVITY;

use crate::params::FollowParams;

/// How far before a stop line the rear contact comes to rest, m: for what noise and slopes may do.
pub const STOP_MARGIN: f64 = 0.05;
/// Share of the friction that service braking may use, and emergency braking.
const SERVICE_FRICTION: f64 = 0.5;
const EMERGENCY_FRICTION: f64 = 0.7;
/// From the moment a line is known until the brakes grip, s: the onset of service braking is smooth.
const SERVICE_REACTION: f64 = 0.1;
const EMERGENCY_REACTION: f64 = 0.05;
/// Share of the emergency deceleration that is promised; the rest is for a bike heavier than believed.
const PROMISED_SHARE: f64 = 0.9;
/// Emergency braking begins when service braking would need this much more than its deceleration.
const EMERGENCY_ONSET: f64 = 1.25;
/// Slower than this nothing is an emergency, m/s.
const EMERGENCY_SPEED: f64 = 0.1;

/// Speed at which the last centimetres are ridden, m/s, and the distance at which it is given up, m.
pub(crate) const CREEP_SPEED: f64 = 0.03;
pub(crate) const ARRIVED: f64 = 0.003;
/// How fast braking corrects the speed, and how fast hold takes the last of it, 1/s.
pub(crate) const BRAKE_GAIN: f64 = 4.0;
pub(crate) const HOLD_GAIN: f64 = 8.0;

/// Braking to rest, as a function of the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrakingManoeuvre {
    /// `v_0`, m/s: speed at its beginning.
    pub speed: f64,
    /// `a`, m/s^2.
    pub deceleration: f64,
    /// `t_r`, s: how long the speed stays.
    pub reaction: f64,
    /// How far before the line the rear contact stands, m.
    pub margin: f64,
}

impl BrakingManoeuvre {
    /// `v(x)`, m/s: an upper bound of the speed after `way` m.
    #[must_use]
    pub fn speed_after(&self, way: f64) -> f64 {
        let braked = (way - self.speed * self.reaction).max(0.0);
        (self.speed * self.speed - 2.0 * self.deceleration * braked)
            .max(0.0)
            .sqrt()
    }

    /// Way to the line, m: with the margin that is left before it.
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.speed * self.reaction
            + self.speed * self.speed / (2.0 * self.deceleration)
            + self.margin
    }

    /// Time to rest, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.reaction + self.speed / self.deceleration
    }
}

/// How hard the bike may brake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrakingLimits {
    /// Deceleration that riding counts on, m/s^2.
    pub service: f64,
    /// Greatest deceleration, m/s^2.
    pub emergency: f64,
}

impl BrakingLimits {
    /// What `params` ask for, as far as the tyres of `bike` allow it in the tightest bends that are ridden, at
    /// the lateral acceleration `lateral`, m/s^2.
    #[must_use]
    pub fn new(params: &FollowParams, bike: &BikeParams, lateral: f64) -> Self {
        let tyre = |share: f64| tyre_deceleration(bike, lateral, share);
        let emergency = params.drive_deceleration.min(tyre(EMERGENCY_FRICTION));
        Self {
            // A quarter is left to correct the speed with.
            service: params
                .braking_deceleration
                .min(tyre(SERVICE_FRICTION))
                .min(0.75 * emergency),
            emergency,
        }
    }

    /// What is promised from `speed`, m/s, for a line that is known in time.
    #[must_use]
    pub fn service_from(&self, speed: f64) -> BrakingManoeuvre {
        BrakingManoeuvre {
            speed: speed.max(0.0),
            deceleration: self.service,
            reaction: SERVICE_REACTION,
            margin: STOP_MARGIN,
        }
    }

    /// The least that is possible from `speed`, m/s.
    #[must_use]
    pub fn emergency_from(&self, speed: f64) -> BrakingManoeuvre {
        BrakingManoeuvre {
            speed: speed.max(0.0),
            deceleration: PROMISED_SHARE * self.emergency,
            reaction: EMERGENCY_REACTION,
            margin: STOP_MARGIN,
        }
    }

    /// The speed from which service braking comes to rest within `distance` m, m/s.
    #[must_use]
    pub fn service_speed(&self, distance: f64) -> f64 {
        (2.0 * self.service * distance.max(0.0)).sqrt()
    }

    /// Whether service braking cannot bring `speed`, m/s, to rest within `distance`, m; with hysteresis by
    /// whether it `already` could not.
    #[must_use]
    pub fn is_emergency(&self, speed: f64, distance: f64, already: bool) -> bool {
        let onset = if already { 1.0 } else { EMERGENCY_ONSET };
        speed > EMERGENCY_SPEED && speed * speed > 2.0 * onset * self.service * distance.max(0.0)
    }

    /// The greatest acceleration, m/s^2, at `speed`, m/s, with `distance` m to the place of rest: on the
    /// profile it brakes by exactly `service`, below it the bound opens smoothly.
    #[must_use]
    pub fn most_acceleration(&self, speed: f64, distance: f64, emergency: bool) -> f64 {
        if self.is_emergency(speed, distance, emergency) {
            return -self.emergency;
        }
        let law = self.service_speed(distance);
        let bound = if law > CREEP_SPEED {
            -self.service * (speed / law).clamp(0.0, 2.0) + BRAKE_GAIN * (law - speed)
        } else {
            BRAKE_GAIN * (CREEP_SPEED - speed)
        };
        bound.max(-self.emergency)
    }
}

/// The deceleration, m/s^2, at which `bike`, braked by its rear wheel in a bend with `lateral` acceleration, m/s^2, uses
/// `share` of the rear tyre's friction. Little but never nothing where the bend takes it all.
#[must_use]
pub fn tyre_deceleration(bike: &BikeParams, lateral: f64, share: f64) -> f64 {
    /// What is left to brake with at the least, m/s^2.
    const LEAST: f64 = 0.05;
    let mass = bike.mass();
    let ahead = (bike.m1 * bike.x1 + bike.m2 * bike.x2) / mass;
    let height = (bike.m1 * bike.h1 + bike.m2 * (bike.l + bike.balancer_offset)) / mass;
    let carried = (bike.wheelbase - ahead) / bike.wheelbase;
    let (grip, lever) = (share * bike.friction, height / bike.wheelbase);
    // a^2 (1 - k^2 l^2) + 2 k^2 c g l a + c^2 (a_y^2 - k^2 g^2) = 0
    let weight = carried * GRAVITY;
    let square = 1.0 - (grip * lever).powi(2);
    let linear = grip * grip * weight * lever;
    let constant = (carried * lateral).powi(2) - (grip * weight).powi(2);
    let root = (linear * linear - square * constant).max(0.0).sqrt();
    // In this form it stays exact as the square's coefficient goes through zero.
    let most = -constant / (linear + root).max(1e-12);
    most.max(LEAST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits() -> BrakingLimits {
        BrakingLimits::new(&FollowParams::default(), &BikeParams::default(), 0.8)
    }

    #[test]
    fn the_default_bike_brakes_as_asked_and_on_ice_as_the_tyres_allow() {
        assert_eq!(
            limits(),
            BrakingLimits {
                service: 0.5,
                emergency: 1.0
            }
        );
        let ice = BikeParams {
            friction: 0.15,
            ..BikeParams::default()
        };
        let slippery = BrakingLimits::new(&FollowParams::default(), &ice, 0.3);
        assert!(slippery.emergency < 0.7 && slippery.service < 0.5);
        assert!(slippery.service <= 0.75 * slippery.emergency);
    }

    #[test]
    fn the_manoeuvre_ends_its_margin_before_the_line() {
        for speed in [0.0, 0.3, 1.5, 2.5] {
            for braking in [limits().service_from(speed), limits().emergency_from(speed)] {
                let rest = braking.distance() - STOP_MARGIN;
                assert_eq!(braking.speed_after(rest + 1e-9), 0.0);
                assert!(speed == 0.0 || braking.speed_after(rest - 1e-3) > 0.0);
                assert_eq!(braking.speed_after(0.0), speed);
                // Time by quadrature of dx/v over the braked part: v/a and the reaction.
                let steps = 100_000;
                let h = rest / f64::from(steps);
                let time: f64 = (0..steps)
                    .map(|i| h / braking.speed_after((f64::from(i) + 0.5) * h).max(1e-12))
                    .sum();
                // The integrand has a root singularity at the end: sqrt(h).
                assert!(speed == 0.0 || (time - braking.duration()).abs() < 0.02);
            }
        }
    }

    proptest! {
        #[test]
        fn the_tyre_is_used_to_the_share_and_no_further(
            lateral in 0.0f64..2.0, friction in 0.4f64..1.2, share in 0.5f64..1.0,
        ) {
            let bike = BikeParams { friction, ..BikeParams::default() };
            let a = tyre_deceleration(&bike, lateral, share);
            let m = bike.mass();
            let x = (bike.m1 * bike.x1 + bike.m2 * bike.x2) / m;
            let h = (bike.m1 * bike.h1 + bike.m2 * (bike.l + bike.balancer_offset)) / m;
            // Moments about the front contact.
            let load = m * (GRAVITY * (bike.wheelbase - x) - a * h) / bike.wheelbase;
            let side = m * lateral * (bike.wheelbase - x) / bike.wheelbase;
            let used = (m * a).hypot(side) / (friction * load);
            prop_assume!(a > 0.05);
            prop_assert!((used - share).abs() < 1e-9, "{used}");
        }

        #[test]
        fn the_law_ends_at_rest_before_the_line(speed in 0.0f64..2.5, extra in 0.0f64..3.0) {
            // An ideal bike that brakes as the law says from what the promise needs.
            let l = limits();
            let line = l.service_from(speed).distance() + extra;
            let (mut x, mut v, dt, mut emergency) = (0.0, speed, 0.005, false);
            for _ in 0..20_000 {
                let distance = line - STOP_MARGIN - x;
                if distance <= ARRIVED {
                    v *= 1.0 - HOLD_GAIN * dt;
                } else {
                    emergency = l.is_emergency(v, distance, emergency);
                    prop_assert!(!emergency, "service braking suffices");
                    v = (v + dt * l.most_acceleration(v, distance - v * dt, emergency).min(0.3)).max(0.0);
                }
                x += v * dt;
            }
            // It creeps over the last millimetres and takes 0.03/8 m to stop.
            prop_assert!(x <= line - STOP_MARGIN + 0.004 && x > line - STOP_MARGIN - 0.01, "{x} of {line}");
        }
    }
}
