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

use bikebot_geometry::{CurvePath, Point2, Pose2, Vector2, angle};

use crate::authority::Authority;
use crate::error::ControlError;
use crate::params::{FollowParams, Track};
use crate::plan_table::{Beyond, HeadingAlong, PlanSample, tabulate};
use crate::profile::{corner_speed, moving_average, speed_profile};
use crate::ramps::{blend, ramp_weights};

/// Spacing of the table, m; the last sample lies on the end, so it varies by half of one per cent.
const SPACING: f64 = 0.01;
/// A second, short average that rounds the ramps the first one makes of curvature jumps, as a
/// share of the smoothing window; the steering lag needs about this much distance.
const ROUNDING_SHARE: f64 = 1.0 / 3.0;

/// Over how much way beyond a jump the average fades out, in smoothing windows: slowly enough that moving
/// back from the averaged path to the plan bends it by little.
const FADING: f64 = 2.0;

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
    samples: Vec<PathSample>,
    step: f64,
    /// Pose in which the rear contact shall come to rest.
    goal: Pose2,
    braking: f64,
    speed_max: f64,
    /// Share of the profile's speed that is ridden.
    speed_share: f64,
    /// Arc length of the rear contact on the plan at each sample, m.
    rear: Vec<f64>,
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
            samples,
            step,
            goal: path.end_pose(),
            braking: params.braking_deceleration,
            speed_max,
            speed_share: 1.0,
            rear,
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

/// The table before the profile.
struct Curve {
    /// Without speeds.
    samples: Vec<PathSample>,
    speed_limits: Vec<f64>,
    /// Arc length of the rear contact on the plan, m.
    rear: Vec<f64>,
    step: f64,
}

/// Number of steps and step that divide `length` about every [`SPACING`] m.
fn divide(length: f64) -> (usize, f64) {
    let n = ((length / SPACING).round() as usize).max(2);
    (n, length / n as f64)
}

/// Number of samples of a symmetric window: odd, so that averaging shifts nothing.
fn odd_count(window: f64, step: f64) -> usize {
    2 * ((0.5 * window / step).round() as usize) + 1
}

/// Adds whole turns so that no heading differs from the one before by more than half a turn.
fn unwrap_headings(headings: &mut [f64]) {
    for i in 1..headings.len() {
        headings[i] = headings[i - 1] + angle::difference(headings[i], headings[i - 1]);
    }
}

/// What of the plan the steering cannot ride as it stands.
fn unrideable(
    planned: &[PlanSample],
    h: f64,
    params: &FollowParams,
    limits: &RideLimits,
) -> Vec<bool> {
    /// A heading that jumps by more than this between two samples is a kink, rad.
    const KINK: f64 = 2e-3;
    let steepest =
        params.steer_rate_share * limits.steer_rate / (limits.wheelbase * params.end_speed);
    let mut marked = vec![false; planned.len()];
    for i in 1..planned.len() {
        let (before, here) = (&planned[i - 1], &planned[i]);
        let (from, a, to, b) = (
            before.heading,
            before.curvature,
            here.heading,
            here.curvature,
        );
        let curvature = 0.5 * (a + b);
        let stretch = 1.0 + (limits.wheelbase * curvature).powi(2);
        // Negated, so that a curvature that is not finite counts as one that cannot be ridden.
        let smooth = (b - a).abs() <= steepest * stretch * h
            && (angle::difference(to, from) - curvature * h).abs() <= KINK
            && b.abs() <= limits.curvature;
        marked[i] = !smooth;
    }
    marked
}

/// The plan itself with its straight run-out.
fn own_point_curve(
    path: &CurvePath,
    params: &FollowParams,
    limits: &RideLimits,
    ahead: f64,
    lateral: f64,
) -> Curve {
    let (n, step) = divide(path.length() + ahead);
    let straight = (Beyond::Straight, Beyond::Straight);
    let samples = tabulate(path, (0.0, step, n + 1), straight);
    let mut headings: Vec<f64> = samples.iter().map(|p| p.heading).collect();
    unwrap_headings(&mut headings);
    let curvatures: Vec<f64> = samples.iter().map(|p| p.curvature).collect();
    let window = odd_count(params.curvature_window, step);
    // A plan that can be ridden as it stands is fed forward as it is.
    let stands = !unrideable(&samples, step, params, limits).contains(&true);
    let speed_limits = curvatures
        .iter()
        .map(|k| corner_speed(*k, lateral, params.max_speed))
        .collect();
    let fed_forward = if stands {
        curvatures
    } else {
        moving_average(&curvatures, window)
    };
    Curve {
        samples: (0..=n)
            .map(|i| PathSample {
                position: samples[i].position,
                heading: headings[i],
                curvature: fed_forward[i],
                speed: 0.0,
                speed_slope: 0.0,
            })
            .collect(),
        // The rear contact cuts corners; along the way it is the look-ahead behind.
        rear: (0..=n).map(|i| i as f64 * step - ahead).collect(),
        speed_limits,
        step,
    }
}

/// The trace of the own point while the rear contact rides the plan, averaged where it jumps.
fn rear_curve(
    path: &CurvePath,
    params: &FollowParams,
    limits: &RideLimits,
    (ahead, lateral): (f64, f64),
    entry: Entry,
) -> Result<Curve, ControlError> {
    let (n, h) = divide(path.length());
    let wide = odd_count(params.smoothing_window, h);
    let narrow = odd_count(params.smoothing_window * ROUNDING_SHARE, h);
    let pad = (wide + narrow) / 2 + 2;
    let circle = Beyond::Circle(limits.curvature);
    let before = match entry {
        Entry::Rest => Beyond::Straight,
        Entry::Rolling(_) => circle,
    };
    let range = (-(pad as f64) * h, h, n + 2 * pad + 1);
    let planned = tabulate(path, range, (before, circle));
    let marked = unrideable(&planned, h, params, limits);
    let fading = (FADING * params.smoothing_window / h) as usize;
    let weights = ramp_weights(&marked, (wide + narrow) / 2 + 1, fading);
    let smooth = |of: fn(&PlanSample) -> f64| {
        let raw: Vec<f64> = planned.iter().map(of).collect();
        // Nothing is averaged in most plans.
        if weights.iter().all(|w| *w == 0.0) {
            return raw;
        }
        blend(
            &raw,
            &moving_average(&moving_average(&raw, wide), narrow),
            &weights,
        )
    };
    let (xs, ys) = (smooth(|p| p.position.x), smooth(|p| p.position.y));
    let rear = RearPath::new(&planned, &xs, &ys, &weights, h).map_err(|i| {
        ControlError::PathDegenerate {
            arc_length: i.saturating_sub(pad) as f64 * h,
        }
    })?;

    // Own point and the greatest speed there, for each place of the rear contact.
    let mut own = HeadingAlong::default();
    let trace: Vec<TraceSample> = (pad..=pad + n)
        .map(|i| {
            let (heading, curvature) = (rear.headings[i], rear.curvatures[i]);
            let along = rear.tangents[i];
            let slope = (rear.curvatures[i + 1] - rear.curvatures[i - 1]) / (2.0 * h);
            let steer = limits.wheelbase * curvature;
            let steer_slope = limits.wheelbase * slope.abs() / (1.0 + steer * steer);
            let stretch = (1.0 + (ahead * curvature).powi(2)).sqrt();
            let steering =
                stretch * params.steer_rate_share * limits.steer_rate / steer_slope.max(1e-9);
            let planned_curvature = planned[i].curvature.abs().max(curvature.abs());
            // t + ell kappa n, of length one.
            let tangent = (along + Vector2::new(-along.y, along.x) * (ahead * curvature)) / stretch;
            TraceSample {
                position: Point2::new(xs[i], ys[i]) + along * ahead,
                heading: own.next(tangent, || heading + (ahead * curvature).atan()),
                tangent,
                speed_limit: corner_speed(planned_curvature, lateral, params.max_speed)
                    .min(steering),
            }
        })
        .collect();
    Ok(evenly_spaced(&trace, h))
}

/// The path of the rear contact, with what its differences say.
struct RearPath {
    /// Not wrapped, rad.
    headings: Vec<f64>,
    /// Unit tangents.
    tangents: Vec<Vector2>,
    /// 1/m.
    curvatures: Vec<f64>,
}

impl RearPath {
    /// Where nothing was averaged, the plan's own heading and curvature stand. The error is the sample at
    /// which the path has no direction.
    fn new(
        planned: &[PlanSample],
        xs: &[f64],
        ys: &[f64],
        weights: &[f64],
        h: f64,
    ) -> Result<Self, usize> {
        let last = planned.len() - 1;
        let around = |i: usize| (i.saturating_sub(1), (i + 1).min(last));
        let averaged = |i: usize| {
            let (before, after) = around(i);
            weights[before] > 0.0 || weights[i] > 0.0 || weights[after] > 0.0
        };
        let mut headings = Vec::with_capacity(planned.len());
        let mut tangents = Vec::with_capacity(planned.len());
        let mut lengths = vec![1.0; planned.len()];
        for (i, plan) in planned.iter().enumerate() {
            let (before, after) = around(i);
            let chord = Vector2::new(xs[after] - xs[before], ys[after] - ys[before]);
            let squared = chord.norm_squared();
            if squared.is_nan() || squared <= 0.01 * h * h {
                return Err(i);
            }
            if averaged(i) {
                let length = squared.sqrt();
                lengths[i] = length;
                headings.push(chord.y.atan2(chord.x));
                tangents.push(chord / length);
            } else {
                headings.push(plan.heading);
                tangents.push(plan.tangent);
            }
        }
        unwrap_headings(&mut headings);
        let curvatures = planned
            .iter()
            .enumerate()
            .map(|(i, plan)| {
                let (before, after) = around(i);
                if averaged(i) {
                    (headings[after] - headings[before]) / lengths[i]
                } else {
                    plan.curvature
                }
            })
            .collect();
        Ok(Self {
            headings,
            tangents,
            curvatures,
        })
    }
}

/// The own point while the rear contact is at one place.
struct TraceSample {
    position: Point2,
    heading: f64,
    /// Unit tangent.
    tangent: Vector2,
    speed_limit: f64,
}

/// The trace, whose samples are `h` m apart on the plan, again, equally spaced along itself.
fn evenly_spaced(trace: &[TraceSample], h: f64) -> Curve {
    let last = trace.len() - 1;
    let mut arc = vec![0.0];
    for pair in trace.windows(2) {
        // A chord is shorter than its arc by the square of the turn over 24.
        let turn = pair[1].heading - pair[0].heading;
        let chord = (pair[1].position - pair[0].position).norm();
        arc.push(arc[arc.len() - 1] + chord * (1.0 + turn * turn / 24.0));
    }
    let bend: Vec<f64> = (0..=last)
        .map(|i| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let way = arc[after] - arc[before];
            if way > 0.0 {
                (trace[after].heading - trace[before].heading) / way
            } else {
                0.0
            }
        })
        .collect();
    let total = arc[last];
    let (count, step) = divide(total);
    let mut curve = Curve {
        samples: Vec::with_capacity(count + 1),
        speed_limits: Vec::with_capacity(count + 1),
        rear: Vec::with_capacity(count + 1),
        step,
    };
    let mut k = 0;
    for i in 0..=count {
        let s = (i as f64 * step).min(total);
        while k + 2 < arc.len() && arc[k + 1] < s {
            k += 1;
        }
        let (a, b) = (&trace[k], &trace[k + 1]);
        let span = arc[k + 1] - arc[k];
        let t = if span > 0.0 {
            ((s - arc[k]) / span).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let mix = |from: f64, to: f64| from + t * (to - from);
        curve.samples.push(PathSample {
            position: between(a, b, span, t),
            heading: mix(a.heading, b.heading),
            curvature: mix(bend[k], bend[k + 1]),
            speed: 0.0,
            speed_slope: 0.0,
        });
        curve.speed_limits.push(a.speed_limit.min(b.speed_limit));
        curve.rear.push((k as f64 + t) * h);
    }
    curve
}

/// The point a share `t` of the way between two samples `span` m apart, on the Ferguson curve that has their
/// headings: a straight line would leave kinks of a milliradian, which feed-forward would steer after.
fn between(a: &TraceSample, b: &TraceSample, span: f64, t: f64) -> Point2 {
    let (start, end) = (a.tangent * span, b.tangent * span);
    let chord = b.position - a.position;
    let bend = chord * 3.0 - start * 2.0 - end;
    let twist = start + end - chord * 2.0;
    a.position + (start + (bend + twist * t) * t) * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::FergusonCurve;

    const LIMITS: RideLimits = RideLimits {
        wheelbase: 1.12,
        steer_rate: 2.0,
        lateral_acceleration: 3.0,
        curvature: 0.9,
    };
    const AHEAD: f64 = 0.5;

    /// A straight, a left bend of about 0.7 1/m and a straight: curvature jumps at both joints.
    fn bend() -> CurvePath {
        let radius = 1.0 / 0.7;
        let (a, b) = (Pose2::new(0.0, 0.0, 0.0), Pose2::new(2.0, 0.0, 0.0));
        let c = Pose2::new(2.0 + radius * 1f64.sin(), radius * (1.0 - 1f64.cos()), 1.0);
        let d = c.compose(&Pose2::new(2.0, 0.0, 0.0));
        CurvePath::new(vec![
            FergusonCurve::straight(a.position, b.position),
            FergusonCurve::between(b, c, radius),
            FergusonCurve::straight(c.position, d.position),
        ])
        .unwrap()
    }

    #[test]
    fn where_the_own_point_is_leads_back_to_the_rear_contact_and_no_number_to_none() {
        let path = FollowedPath::new(&bend(), &FollowParams::default(), &LIMITS, AHEAD).unwrap();
        for i in -100..700 {
            let rear = 0.01 * f64::from(i) + 0.003;
            let back = path.rear_at(path.own_at(rear)).0;
            assert!((back - rear).abs() < 1e-9, "{rear}: {back}");
        }
        assert_eq!(path.own_at(f64::INFINITY), f64::INFINITY);
        assert_eq!(path.own_at(f64::NEG_INFINITY), f64::NEG_INFINITY);
        assert!(path.own_at(f64::NAN).is_nan());
    }

    #[test]
    fn refuses_a_path_of_no_length() {
        let path = CurvePath::new(vec![FergusonCurve::straight(
            Point2::origin(),
            Point2::new(0.1, 0.0),
        )])
        .unwrap();
        assert!(matches!(
            FollowedPath::new(&path, &FollowParams::default(), &LIMITS, AHEAD),
            Err(ControlError::PathTooShort { .. })
        ));
    }

    #[test]
    fn on_a_straight_the_curve_runs_the_look_ahead_in_front() {
        let path = CurvePath::new(vec![FergusonCurve::straight(
            Point2::origin(),
            Point2::new(5.0, 0.0),
        )])
        .unwrap();
        for track in [Track::RearContact, Track::LookAheadPoint] {
            let params = FollowParams {
                track,
                ..FollowParams::default()
            };
            let followed = FollowedPath::new(&path, &params, &LIMITS, AHEAD).unwrap();
            let end = followed.sample(followed.length()).position;
            // Sums of 500 steps.
            assert!((end - Point2::new(5.5, 0.0)).norm() < 1e-9);
            assert!(
                followed.remaining(Point2::new(4.9, 0.0), followed.length() - 0.1) - 0.1 < 1e-9
            );
            assert!(
                (followed.project(Point2::new(2.0, 0.03), 2.0, 1.0).lateral - 0.03).abs() < 1e-12
            );
        }
    }

    #[test]
    fn a_rear_contact_that_trails_the_curve_stays_on_the_plan() {
        let path = bend();
        let params = FollowParams::default();
        let followed = FollowedPath::new(&path, &params, &LIMITS, AHEAD).unwrap();
        // Drag a rod of the look-ahead's length along the curve: its tail is the rear contact.
        let (mut heading, mut worst, mut steepest) = (0.0f64, 0.0f64, 0.0f64);
        let (step, mut before) = (0.001, 0.0);
        let n = (followed.length() / step) as usize;
        for i in 0..n {
            let sample = followed.sample(i as f64 * step);
            let slip = sample.heading - heading;
            let steer = (LIMITS.wheelbase * slip.tan() / params.look_ahead).atan();
            if i > 0 {
                steepest = steepest.max((steer - before).abs() / step * sample.speed);
            }
            before = steer;
            heading += slip.sin() / params.look_ahead * step;
            let rear =
                sample.position - Vector2::new(heading.cos(), heading.sin()) * params.look_ahead;
            worst = worst.max(path.project(rear, 0.0, path.length()).distance);
        }
        // Averaging over 0.6 m moves a bend of 0.7 1/m by 0.7 (0.36 + 0.04)/24 = 12 mm.
        assert!(worst < 0.014, "{worst}");
        // The speed profile keeps the steering within its rate; the linear table adds a little.
        assert!(steepest < LIMITS.steer_rate, "{steepest}");
    }

    #[test]
    fn the_riding_speed_ends_at_standstill_and_never_exceeds_the_profile() {
        let followed =
            FollowedPath::new(&bend(), &FollowParams::default(), &LIMITS, AHEAD).unwrap();
        let length = followed.length();
        assert_eq!(followed.riding_sample(length).speed, 0.0);
        assert_eq!(followed.riding_sample(length + 1.0).speed, 0.0);
        for i in 0..200 {
            let s = length * f64::from(i) / 200.0;
            assert!(followed.riding_sample(s).speed <= followed.sample(s).speed);
        }
        // From 0.3 m/s at half a metre per second squared: 9 cm.
        assert!((followed.braking_speed(0.09) - 0.3).abs() < 1e-12);
    }

    /// One curve, so that nothing jumps but the steering's start.
    fn curving() -> CurvePath {
        CurvePath::new(vec![FergusonCurve::between(
            Pose2::new(0.0, 0.0, 0.0),
            Pose2::new(6.0, 2.5, 0.9),
            6.5,
        )])
        .unwrap()
    }

    #[test]
    fn where_curvature_is_continuous_the_curve_is_the_trace_of_the_own_point() {
        let path = curving();
        for ahead in [0.5, 1.12] {
            let followed =
                FollowedPath::new(&path, &FollowParams::default(), &LIMITS, ahead).unwrap();
            // From the end backwards: the arc length of the trace is the integral of sqrt(1 + (l kappa)^2).
            let (mut s, mut arc, h) = (path.length(), followed.length(), 1e-3);
            while s > 1.8 {
                let at = path.at(s);
                let (sin, cos) = at.heading.sin_cos();
                let trace = at.position + Vector2::new(cos, sin) * ahead;
                let got = followed.sample(arc);
                // The table's chords of a centimetre: kappa h^2/8.
                assert!((got.position - trace).norm() < 2e-5, "at {s}");
                let k = at.curvature;
                let stretch = (1.0 + (ahead * k).powi(2)).sqrt();
                let heading = at.heading + (ahead * k).atan();
                assert!(
                    angle::difference(got.heading, heading).abs() < 1e-4,
                    "at {s}"
                );
                if s < path.length() - 0.05 {
                    let slope = (path.at(s + h).curvature - path.at(s - h).curvature) / (2.0 * h);
                    let wanted = (k + ahead * slope / (stretch * stretch)) / stretch;
                    assert!(
                        (got.curvature - wanted).abs() < 1e-3,
                        "at {s}: {} for {wanted}",
                        got.curvature
                    );
                }
                let middle = path.at(s - 0.5 * h).curvature;
                arc -= h * (1.0 + (ahead * middle).powi(2)).sqrt();
                s -= h;
            }
        }
    }

    #[test]
    fn the_curve_ends_the_look_ahead_in_front_of_the_goal_pose() {
        let path = curving();
        let goal = path.end_pose();
        let followed = FollowedPath::new(&path, &FollowParams::default(), &LIMITS, AHEAD).unwrap();
        let end = followed.sample(followed.length());
        assert!((end.position - (goal.position + goal.direction() * AHEAD)).norm() < 1e-9);
        // The rear contact's way to the goal, as the own point stands there.
        assert!(followed.remaining(goal.position, followed.length()).abs() < 1e-12);
    }

    #[test]
    fn the_foot_stays_on_its_branch_where_the_curve_crosses_itself() {
        // A loop: out along x, round to the left and back across the way out.
        let poses = [
            Pose2::new(0.0, 0.0, 0.0),
            Pose2::new(6.0, 2.0, std::f64::consts::FRAC_PI_2),
            Pose2::new(4.0, 4.0, std::f64::consts::PI),
            Pose2::new(2.0, 2.0, -std::f64::consts::FRAC_PI_2),
            Pose2::new(2.0, -4.0, -std::f64::consts::FRAC_PI_2),
        ];
        let curve = |p: &[Pose2]| {
            FergusonCurve::between(p[0], p[1], 1.2 * (p[1].position - p[0].position).norm())
        };
        let path = CurvePath::new(poses.windows(2).map(curve).collect()).unwrap();
        let followed = FollowedPath::new(&path, &FollowParams::default(), &LIMITS, 0.0).unwrap();
        let (mut s, mut near) = (0.0, 0.0);
        while s < followed.length() {
            let sample = followed.sample(s);
            let left = Vector2::new(-sample.heading.sin(), sample.heading.cos());
            let point = sample.position + left * 0.1;
            let wide = followed.project(point, s, 0.5);
            let quick = followed.project_near(point, near);
            near = quick.s;
            for foot in [wide, quick] {
                assert!((foot.s - s).abs() < 2e-3, "at {s}: {foot:?}");
                assert!((foot.lateral - 0.1).abs() < 1e-4, "at {s}: {foot:?}");
            }
            s += 0.02;
        }
    }

    #[test]
    fn straight_on_beyond_both_ends() {
        let followed =
            FollowedPath::new(&bend(), &FollowParams::default(), &LIMITS, AHEAD).unwrap();
        let end = followed.sample(followed.length());
        let beyond = followed.sample(followed.length() + 2.0);
        let gone = beyond.position - end.position;
        assert!(
            (gone.norm() - 2.0).abs() < 1e-12 && (gone.y.atan2(gone.x) - end.heading).abs() < 1e-12
        );
        let before = followed.sample(-1.0).position - followed.sample(0.0).position;
        assert!((before.norm() - 1.0).abs() < 1e-12);
    }
}
