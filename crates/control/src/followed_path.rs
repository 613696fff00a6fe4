//! The curve that a follower's own point is to follow, tabulated by arc length.
//!
//! With [`Track::RearContact`] it is the trace of the own point, `ell` ahead, while the rear contact
//! rides the planned path `r`:
//!
//! ```text
//! P_d(s) = r(s) + ell t(s),     |P_d'| = sqrt(1 + ell^2 kappa^2),
//! heading = theta + atan(ell kappa),
//! kappa_d = (kappa + ell kappa'/(1 + ell^2 kappa^2)) / sqrt(1 + ell^2 kappa^2).
//! ```
//!
//! This is exact wherever the curvature of the plan is continuous. Where it jumps, or turns more
//! quickly or tightly than the steering can, the plan is first averaged along its arc length, so
//! that a jump becomes a ramp over the smoothing window; the average fades out away from the jump. The speed
//! profile then knows the steering rate each place needs.
//!
//! With [`Track::LookAheadPoint`] the plan itself, continued straight by `ell`, is the followed curve.

use std::sync::Arc;

use bikebot_geometry::{CurvePath, Point2, Pose2, Vector2};

mod curve;

use self::curve::{Curve, own_point_curve, rear_curve};
use crate::authority::Authority;
use crate::error::ControlError;
use crate::params::{FollowParams, Track};
use crate::profile::speed_profile;

/// What the bike imposes on the profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RideLimits {
    /// Wheelbase `w`, m.
    pub wheelbase: f64,
    /// Greatest steering rate, rad/s.
    pub steer_rate: f64,
    /// Greatest lateral acceleration that tyres and balance allow, m/s^2.
    pub lateral_acceleration: f64,
    /// Greatest curvature that the steering stops allow, 1/m.
    pub curvature: f64,
}

/// The followed curve at one arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathSample {
    /// Position, world frame, m.
    pub position: Point2,
    /// Heading of the tangent, rad, not wrapped along the path.
    pub heading: f64,
    /// Curvature for feed-forward, 1/m, positive to the left.
    pub curvature: f64,
    /// `rho`, m/s: speed of the profile.
    pub speed: f64,
    /// `d rho/ds`, 1/s.
    pub speed_slope: f64,
}

/// Where a point lies beside the followed curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Arc length of the nearest point of the curve, m.
    pub s: f64,
    /// Distance to the left of the curve, m.
    pub lateral: f64,
}

/// Arc-length table of the followed curve with its speed profile.
#[derive(Debug, Clone, PartialEq)]
pub struct FollowedPath {
    /// Shared by all that ride the same curve.
    samples: Arc<Vec<PathSample>>,
    step: f64,
    /// Pose in which the rear contact shall come to rest.
    goal: Pose2,
    braking: f64,
    speed_max: f64,
    /// Share of the profile's speed that is ridden.
    speed_share: f64,
    /// Arc length of the rear contact on the plan at each sample, m.
    rear: Arc<Vec<f64>>,
    entry: Entry,
    /// The end of authority, once there has been one.
    authority: Option<Authority>,
}

/// How a followed path begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Entry {
    /// From rest, at the end speed of the profile.
    Rest,
    /// The bike is on it already: its profile starts at this speed, m/s, and the plan is taken to come along the
    /// circle of its start.
    Rolling(f64),
}

impl FollowedPath {
    /// Least length of a planned path, m.
    pub const MIN_LENGTH: f64 = 0.2;
    /// Greatest length of a planned path, m: its table, with what it takes to make it, stays below half a
    /// gigabyte.
    pub const MAX_LENGTH: f64 = 20_000.0;

    /// Tabulates the curve for an own point `ahead` m in front of the rear contact that is to ride `path`.
    ///
    /// # Errors
    ///
    /// [`ControlError::PathTooShort`] below [`Self::MIN_LENGTH`], [`ControlError::PathTooLong`] above
    /// [`Self::MAX_LENGTH`] and
    /// [`ControlError::PathDegenerate`] where the path has no direction.
    pub fn new(
        path: &CurvePath,
        params: &FollowParams,
        limits: &RideLimits,
        ahead: f64,
    ) -> Result<Self, ControlError> {
        Self::entered(path, params, limits, ahead, Entry::Rest)
    }

    /// As [`Self::new`], with the beginning that `entry` says.
    pub(crate) fn entered(
        path: &CurvePath,
        params: &FollowParams,
        limits: &RideLimits,
        ahead: f64,
        entry: Entry,
    ) -> Result<Self, ControlError> {
        let length = path.length();
        if !(length >= Self::MIN_LENGTH && length.is_finite()) {
            return Err(ControlError::PathTooShort {
                length,
                least: Self::MIN_LENGTH,
            });
        }
        if length > Self::MAX_LENGTH {
            return Err(ControlError::PathTooLong {
                length,
                most: Self::MAX_LENGTH,
            });
        }
        let lateral = params.lateral_acceleration.min(limits.lateral_acceleration);
        let curve = match params.track {
            Track::LookAheadPoint => own_point_curve(path, params, limits, ahead, lateral),
            Track::RearContact => rear_curve(path, params, limits, (ahead, lateral), entry)?,
        };
        let Curve {
            mut samples,
            speed_limits,
            rear,
            step,
        } = curve;
        let entry_speed = match entry {
            Entry::Rest => params.end_speed,
            Entry::Rolling(speed) => speed,
        };
        let speeds = speed_profile(
            &speed_limits,
            step,
            (entry_speed, params.end_speed),
            params.longitudinal_acceleration,
        );
        let n = samples.len();
        for (i, sample) in samples.iter_mut().enumerate() {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(n - 1));
            sample.speed = speeds[i];
            sample.speed_slope =
                (speeds[after] - speeds[before]) / (step * (after - before) as f64);
        }
        let finite =
            |p: &PathSample| p.position.coords.iter().all(|c| c.is_finite()) && p.speed.is_finite();
        if let Some(i) = samples.iter().position(|p| !finite(p)) {
            return Err(ControlError::PathDegenerate {
                arc_length: i as f64 * step,
            });
        }
        let speed_max = speeds.iter().copied().fold(0.0, f64::max);
        Ok(Self {
            samples: Arc::new(samples),
            step,
            goal: path.end_pose(),
            braking: params.braking_deceleration,
            speed_max,
            speed_share: 1.0,
            rear: Arc::new(rear),
            entry,
            authority: None,
        })
    }

    pub(crate) fn entry(&self) -> Entry {
        self.entry
    }

    pub(crate) fn authority(&self) -> Option<&Authority> {
        self.authority.as_ref()
    }

    pub(crate) fn set_authority(&mut self, authority: Authority) {
        self.authority = Some(authority);
    }

    /// Rides the whole profile at this share of its speed from now on; to be moved gently.
    pub fn set_speed_share(&mut self, share: f64) {
        self.speed_share = share;
    }

    /// The table, from the first to the last sample.
    #[must_use]
    pub fn samples(&self) -> &[PathSample] {
        &self.samples
    }

    /// The same, shared: what it was stays as long as it is held.
    #[must_use]
    pub fn shared_samples(&self) -> &Arc<Vec<PathSample>> {
        &self.samples
    }

    /// Distance between two samples, m.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Length of the followed curve, m: at its end the rear contact has arrived.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.step * (self.samples.len() - 1) as f64
    }

    /// Pose in which the rear contact shall come to rest.
    #[must_use]
    pub fn goal(&self) -> Pose2 {
        self.goal
    }

    /// Greatest speed of the profile, m/s.
    #[must_use]
    pub fn speed_max(&self) -> f64 {
        self.speed_max
    }

    /// The curve and its profile at arc length `s`, m; straight on beyond both ends.
    #[must_use]
    pub fn sample(&self, s: f64) -> PathSample {
        let last = self.samples.len() - 1;
        let length = self.length();
        if s < 0.0 || s > length {
            let (end, beyond) = if s < 0.0 {
                (self.samples[0], s)
            } else {
                (self.samples[last], s - length)
            };
            let (sin, cos) = end.heading.sin_cos();
            return PathSample {
                position: end.position + Vector2::new(cos, sin) * beyond,
                curvature: 0.0,
                speed: self.speed_share * end.speed,
                speed_slope: 0.0,
                ..end
            };
        }
        let x = s / self.step;
        let i = (x as usize).min(last - 1);
        let t = x - i as f64;
        let (a, b) = (&self.samples[i], &self.samples[i + 1]);
        let mix = |from: f64, to: f64| from + t * (to - from);
        PathSample {
            position: a.position + (b.position - a.position) * t,
            heading: mix(a.heading, b.heading),
            curvature: mix(a.curvature, b.curvature),
            speed: self.speed_share * mix(a.speed, b.speed),
            speed_slope: self.speed_share * mix(a.speed_slope, b.speed_slope),
        }
    }

    /// Curvature at arc length `s`, m, 1/m; straight on beyond both ends.
    #[must_use]
    pub fn curvature(&self, s: f64) -> f64 {
        let last = self.samples.len() - 1;
        if s < 0.0 || s > self.length() {
            return 0.0;
        }
        let x = s / self.step;
        let i = (x as usize).min(last - 1);
        let (a, b) = (self.samples[i].curvature, self.samples[i + 1].curvature);
        a + (x - i as f64) * (b - a)
    }

    /// Where the rear contact is on the plan, m, while the own point is at arc length `s`, m, of the followed curve,
    /// and how many times as fast the own point moves there; straight on beyond both ends.
    #[must_use]
    pub fn rear_at(&self, s: f64) -> (f64, f64) {
        let last = self.rear.len() - 1;
        let x = s / self.step;
        if s < 0.0 {
            return (self.rear[0] + s, 1.0);
        }
        if s > self.length() {
            return (self.rear[last] + s - self.length(), 1.0);
        }
        let i = (x as usize).min(last - 1);
        let (a, b) = (self.rear[i], self.rear[i + 1]);
        (
            a + (x - i as f64) * (b - a),
            self.step / (b - a).max(1e-3 * self.step),
        )
    }

    /// Where the own point is on the followed curve, m, while the rear contact is at arc length `rear`, m, of the
    /// plan: the inverse of [`Self::rear_at`].
    #[must_use]
    pub fn own_at(&self, rear: f64) -> f64 {
        let last = self.rear.len() - 1;
        // What is no number stays none.
        if rear < self.rear[0] || rear.is_nan() {
            return rear - self.rear[0];
        }
        if rear >= self.rear[last] {
            return self.length() + rear - self.rear[last];
        }
        let i = self.rear.partition_point(|r| *r <= rear) - 1;
        let (a, b) = (self.rear[i], self.rear[i + 1]);
        self.step * (i as f64 + (rear - a) / (b - a))
    }

    /// As [`Self::sample`], with the profile restrained by the end of authority.
    #[must_use]
    pub fn reference(&self, s: f64) -> PathSample {
        let mut sample = self.sample(s);
        if let Some(authority) = &self.authority {
            let (rear, stretch) = self.rear_at(s);
            authority.restrain(&mut sample, s, rear, stretch);
        }
        sample
    }

    /// Way of the rear contact to where it shall stand before the stop line, m, with the own point at arc length
    /// `s`, m; none without a line.
    #[must_use]
    pub fn stop_distance(&self, s: f64) -> Option<f64> {
        let aim = self.authority.as_ref()?.aim?;
        Some(aim - self.rear_at(s).0)
    }

    /// `acceleration`, m/s^2, as far as the stop line allows it with the own point at arc length `s`, m, and the
    /// rear contact moving at `speed`, m/s, for another `time` s.
    #[must_use]
    pub fn governed(&self, acceleration: f64, speed: f64, s: f64, time: f64) -> f64 {
        match (&self.authority, self.stop_distance(s)) {
            (Some(authority), Some(distance)) => {
                authority.govern(acceleration, speed, distance - speed * time)
            }
            _ => acceleration,
        }
    }

    /// As [`Self::reference`], with the profile brought down to standstill at the end.
    #[must_use]
    pub fn riding_sample(&self, s: f64) -> PathSample {
        /// Below this the braking law is given up for standstill, m/s; it bounds the slope of the profile.
        const CREEP: f64 = 0.02;
        let mut sample = self.reference(s);
        let braking = self.braking_speed(self.length() - s);
        if let Some(authority) = &self.authority {
            let hardest = authority.hardest(s);
            if hardest > braking {
                if hardest < sample.speed {
                    sample.speed = hardest;
                    sample.speed_slope = -authority.limits.emergency / hardest;
                }
                return sample;
            }
        }
        if braking < CREEP {
            sample.speed = 0.0;
            sample.speed_slope = 0.0;
        } else if braking < sample.speed {
            sample.speed = braking;
            sample.speed_slope = -self.braking / braking;
        }
        sample
    }

    /// The speed from which the bike comes to rest within `distance` m, m/s.
    #[must_use]
    pub fn braking_speed(&self, distance: f64) -> f64 {
        (2.0 * self.braking * distance.max(0.0)).sqrt()
    }

    /// How far the rear contact at `rear` still has to ride, m, when the look-ahead point is at
    /// arc length `s`; negative past the goal.
    #[must_use]
    pub fn remaining(&self, rear: Point2, s: f64) -> f64 {
        /// Within this distance the goal's own tangent measures better than the look-ahead point, m.
        const NEAR: f64 = 0.4;
        let along_curve = self.length() - s;
        if along_curve > NEAR {
            along_curve
        } else {
            (self.goal.position - rear).dot(&self.goal.direction())
        }
    }

    /// The nearest point of the curve, looked for up to `reach` m before and behind arc length `near`.
    #[must_use]
    pub fn project(&self, point: Point2, near: f64, reach: f64) -> Projection {
        let last = self.samples.len() - 1;
        let index = |s: f64| ((s / self.step).max(0.0) as usize).min(last);
        let (from, to) = (index(near - reach), index(near + reach + self.step));
        let mut best = from;
        let mut least = f64::INFINITY;
        for (i, sample) in self.samples[from..=to].iter().enumerate() {
            let distance = (point - sample.position).norm_squared();
            if distance < least {
                least = distance;
                best = from + i;
            }
        }
        // The samples are close enough for the foot to be found on the tangent of the nearest one;
        // its sagitta over half a step is below 1e-5 m at any curvature a bike can ride.
        let sample = &self.samples[best];
        let (sin, cos) = sample.heading.sin_cos();
        let offset = point - sample.position;
        let along = offset.x * cos + offset.y * sin;
        let side = offset.y * cos - offset.x * sin;
        Projection {
            s: best as f64 * self.step + along,
            lateral: side - 0.5 * sample.curvature * along * along,
        }
    }

    /// The foot of a point that was near arc length `near` a moment ago, by two Newton steps: cheaper
    /// than [`Self::project`], and equal to it as long as the guess is good.
    #[must_use]
    pub fn project_near(&self, point: Point2, near: f64) -> Projection {
        let mut s = near;
        let mut lateral = 0.0;
        for _ in 0..2 {
            Projection { s, lateral } = self.project_once(point, s);
        }
        Projection { s, lateral }
    }

    /// One Newton step from arc length `guess`, m: enough where the guess is off by no more than rounding a corner makes it, as one step of a
    /// roll-out ahead of the last foot.
    #[must_use]
    pub fn project_once(&self, point: Point2, guess: f64) -> Projection {
        /// The foot is not looked for beyond this share of the way to the centre of curvature.
        const WITHIN: f64 = 0.2;
        let sample = self.sample(guess);
        let (sin, cos) = sample.heading.sin_cos();
        let offset = point - sample.position;
        let along = offset.x * cos + offset.y * sin;
        let side = offset.y * cos - offset.x * sin;
        Projection {
            s: guess + along / (1.0 - sample.curvature * side).max(WITHIN),
            lateral: side - 0.5 * sample.curvature * along * along,
        }
    }
}

#[cfg(test)]
mod tests;
