//! The end of authority: how far and how fast the bike may ride, whatever the path's own profile says.
//!
//! A stop line and a greatest speed may change at any moment, as may the path. The reference speed must not jump with
//! them, so it is taken over where it is and moves to what is allowed now at a limited rate. Everything is a function
//! of the *place* and not of the time,
//!
//! ```text
//! soft(s) = min(rho(s), cap)  held between  sqrt(c^2 - 2 a_- (s - s_0))  and  sqrt(c^2 + 2 a_+ (s - s_0)),
//! hard(s) = max(sqrt(2 a (s_stop - s)),  sqrt(c^2 - 2 a_max (s - s_0))),
//! ```
//!
//! so between two changes the field is a stationary one, and a roll-out ahead foresees what will be ridden. `c` is the
//! reference at the place `s_0` of the last change. Where the line has come nearer than service braking
//! allows, the reference falls as the hardest braking does: a reference below what can be ridden
//! would straighten the steering instead of stopping the bike.

use crate::braking::BrakingLimits;
use crate::followed_path::PathSample;

/// Below this the reference counts as standstill, m/s; it bounds the slope of the profile.
const STANDSTILL: f64 = 0.02;

/// Where the reference speed was taken over at the last change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Takeover {
    /// `s_0`, m: arc length of the followed curve.
    pub s: f64,
    /// `c`, m/s.
    pub speed: f64,
    /// `a_-`, m/s^2.
    pub down: f64,
}

/// What restrains the profile of a followed path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Authority {
    /// Where the rear contact shall stand, m of the planned path: a margin before the stop line.
    pub aim: Option<f64>,
    /// Greatest speed, m/s.
    pub cap: Option<f64>,
    pub takeover: Option<Takeover>,
    pub limits: BrakingLimits,
    /// `a_+`, m/s^2.
    pub up: f64,
    /// Service braking does not suffice.
    pub is_emergency: bool,
}

impl Authority {
    pub fn new(limits: BrakingLimits, up: f64) -> Self {
        Self {
            aim: None,
            cap: None,
            takeover: None,
            limits,
            up,
            is_emergency: false,
        }
    }

    /// Restrains the profile's `sample` at `s`, where the rear contact is at arc length `rear` of the plan and
    /// the own point moves `stretch` times as fast as it.
    pub fn restrain(&self, sample: &mut PathSample, s: f64, rear: f64, stretch: f64) {
        if let Some(cap) = self.cap
            && sample.speed > cap
        {
            sample.speed = cap;
            sample.speed_slope = 0.0;
        }
        if let Some(t) = &self.takeover {
            let (rising, falling) = (t.speed_after(s, self.up), t.speed_after(s, -t.down));
            if sample.speed > rising {
                sample.speed = rising;
                sample.speed_slope = self.up / rising.max(STANDSTILL);
            } else if sample.speed < falling {
                sample.speed = falling;
                sample.speed_slope = -t.down / falling.max(STANDSTILL);
            }
        }
        let Some(aim) = self.aim else {
            return;
        };
        let service = self.limits.service_speed(aim - rear);
        let hardest = self.hardest(s);
        let (speed, slope) = if hardest > service * stretch {
            (hardest, -self.limits.emergency / hardest)
        } else if service > STANDSTILL {
            // Stretch of the speed and of the way cancel.
            (service * stretch, -self.limits.service / service)
        } else {
            (0.0, 0.0)
        };
        if speed < sample.speed {
            sample.speed = speed;
            sample.speed_slope = slope;
        }
    }

    /// The reference at `s` under the hardest braking since the takeover, m/s; zero at standstill.
    pub fn hardest(&self, s: f64) -> f64 {
        let speed = self
            .takeover
            .map_or(0.0, |t| t.speed_after(s, -self.limits.emergency));
        if speed > STANDSTILL { speed } else { 0.0 }
    }

    /// `acceleration`, m/s^2, as far as the stop line `distance` m from the place of rest allows it at `speed`, m/s.
    pub fn govern(&self, acceleration: f64, speed: f64, distance: f64) -> f64 {
        acceleration.min(
            self.limits
                .most_acceleration(speed, distance, self.is_emergency),
        )
    }
}

impl Takeover {
    /// The speed at `s` after accelerating by `acceleration` along the way, m/s.
    fn speed_after(&self, s: f64, acceleration: f64) -> f64 {
        let way = (s - self.s).max(0.0);
        (self.speed * self.speed + 2.0 * acceleration * way)
            .max(0.0)
            .sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Point2;
    use proptest::prelude::*;

    const LIMITS: BrakingLimits = BrakingLimits {
        service: 0.5,
        emergency: 1.0,
    };

    fn profile(speed: f64) -> PathSample {
        PathSample {
            position: Point2::origin(),
            heading: 0.0,
            curvature: 0.0,
            speed,
            speed_slope: 0.0,
        }
    }

    fn reference(authority: &Authority, s: f64) -> PathSample {
        let mut sample = profile(1.5);
        authority.restrain(&mut sample, s, s, 1.0);
        sample
    }

    #[test]
    fn an_open_road_changes_nothing() {
        let authority = Authority::new(LIMITS, 0.3);
        assert_eq!(reference(&authority, 3.0), profile(1.5));
    }

    #[test]
    fn a_cap_is_approached_at_the_rate_of_its_takeover() {
        let slower = Authority {
            cap: Some(0.5),
            takeover: Some(Takeover {
                s: 1.0,
                speed: 1.5,
                down: 0.5,
            }),
            ..Authority::new(LIMITS, 0.3)
        };
        assert_eq!(reference(&slower, 1.0).speed, 1.5);
        // 2.25 - 1 over a metre at half a metre per second squared.
        assert!((reference(&slower, 2.0).speed - 1.25f64.sqrt()).abs() < 1e-12);
        assert_eq!(reference(&slower, 4.0).speed, 0.5);
    }

    #[test]
    fn a_line_too_near_is_approached_as_hard_as_possible_and_no_harder() {
        let sudden = Authority {
            aim: Some(0.2),
            takeover: Some(Takeover {
                s: 0.0,
                speed: 1.0,
                down: 0.5,
            }),
            ..Authority::new(LIMITS, 0.3)
        };
        assert_eq!(reference(&sudden, 0.0).speed, 1.0);
        assert!((reference(&sudden, 0.3).speed - 0.4f64.sqrt()).abs() < 1e-12);
        assert_eq!(reference(&sudden, 0.5).speed, 0.0);
    }

    proptest! {
        #[test]
        fn the_slope_is_that_of_the_speed(
            s in 0.1f64..5.0, from in 0.0f64..1.5, cap in prop::option::of(0.2f64..1.5),
            aim in prop::option::of(0.0f64..6.0), stretch in 1.0f64..1.3,
        ) {
            let authority = Authority {
                aim,
                cap,
                takeover: Some(Takeover { s: 0.0, speed: from, down: 0.7 }),
                ..Authority::new(LIMITS, 0.3)
            };
            let at = |s: f64| {
                let mut sample = profile(1.5);
                authority.restrain(&mut sample, s, s / stretch, stretch);
                sample
            };
            let h = 1e-6;
            let (before, here, after) = (at(s - h), at(s), at(s + h));
            let difference = (after.speed - before.speed) / (2.0 * h);
            // Not across a kink nor at standstill.
            prop_assume!((after.speed_slope - before.speed_slope).abs() < 1e-2 && here.speed > 0.1);
            prop_assert!((difference - here.speed_slope).abs() < 1e-3, "{difference} {here:?}");
        }

        #[test]
        fn taking_over_again_on_the_way_changes_nothing(
            s in 0.0f64..3.0, further in 0.0f64..3.0, from in 0.3f64..1.5, cap in 0.2f64..1.5,
        ) {
            let first = Authority {
                cap: Some(cap),
                takeover: Some(Takeover { s: 0.0, speed: from, down: 0.5 }),
                ..Authority::new(LIMITS, 0.3)
            };
            let again = Authority {
                takeover: Some(Takeover { s, speed: reference(&first, s).speed, down: 0.5 }),
                ..first
            };
            let (a, b) = (reference(&first, s + further).speed, reference(&again, s + further).speed);
            prop_assert!((a - b).abs() < 1e-12);
        }
    }
}
