//! The curve of the own point as a table, before it has speeds: the plan itself, or the trace the point leaves
//! while the rear contact rides the plan, averaged where the plan jumps.

use bikebot_geometry::{CurvePath, Point2, Vector2, angle};

use super::{Entry, PathSample, RideLimits};
use crate::error::ControlError;
use crate::params::FollowParams;
use crate::plan_table::{Beyond, HeadingAlong, PlanSample, tabulate};
use crate::profile::{corner_speed, moving_average};
use crate::ramps::{blend, ramp_weights};

/// Spacing of the table, m; the last sample lies on the end, so it varies by half of one per cent.
const SPACING: f64 = 0.01;
/// A second, short average that rounds the ramps the first one makes of curvature jumps, as a
/// share of the smoothing window; the steering lag needs about this much distance.
const ROUNDING_SHARE: f64 = 1.0 / 3.0;

/// Over how much way beyond a jump the average fades out, in smoothing windows: slowly enough that moving
/// back from the averaged path to the plan bends it by little.
const FADING: f64 = 2.0;

/// The table before the profile.
pub(super) struct Curve {
    /// Without speeds.
    pub(super) samples: Vec<PathSample>,
    pub(super) speed_limits: Vec<f64>,
    /// Arc length of the rear contact on the plan, m.
    pub(super) rear: Vec<f64>,
    pub(super) step: f64,
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
pub(super) fn own_point_curve(
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
pub(super) fn rear_curve(
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
