//! What a curve measures: length, bending, and where along it clearance and curvature are short.
//!
//! Clearance is that of the discs which cover the footprint (planning note: 1 for a point, 3 for the bike). Each is
//! sampled eight times a segment, and every local minimum of the samples is refined by golden section: a corner
//! of an obstacle that falls between two samples would be cut, and then cut a little more each round.

use super::spline::Spline;
use bikebot_geometry::{FergusonCurve, ParametricCurve, Point2, Vector2};
use bikebot_world::{FootprintDisc, World};

/// Samples per segment.
pub(crate) const SAMPLES: usize = 8;

/// After so many segments it is asked whether to go on.
const ASKED_EVERY: usize = 64;

/// Golden-section steps: they narrow a quarter of a segment to 1/190 of one.
const GOLDEN_STEPS: u32 = 8;

/// A refined local minimum of the clearance of one disc.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Minimum {
    pub disc: usize,
    pub segment: usize,
    pub t: f64,
    pub clearance: f64,
}

/// Measurements of one curve.
#[derive(Debug, Clone)]
pub(crate) struct Survey {
    /// m.
    pub length: f64,
    /// J, 1/m³.
    pub bending: f64,
    /// Per disc: clearance, m, at every sample of the curve, both ends included; infinite where it is beyond the reach
    /// of the whole segment.
    pub clearance: Vec<Vec<f64>>,
    /// Refined local minima within reach.
    pub minima: Vec<Minimum>,
    /// Per disc and segment: the least clearance seen, m.
    pub least: Vec<Vec<f64>>,
    /// Per segment: signed curvature at its samples, both ends included, 1/m.
    pub curvature: Vec<[f64; SAMPLES + 1]>,
}

impl Survey {
    /// Measures `spline`; clearance matters up to `reach` (m). `None` if `go_on` says no on the way.
    pub fn of(
        spline: &Spline,
        curves: &[FergusonCurve],
        discs: &[FootprintDisc],
        world: &World,
        reach: f64,
        go_on: &dyn Fn() -> bool,
    ) -> Option<Self> {
        let segments = spline.segments();
        let mut survey = Self {
            length: 0.0,
            bending: 0.0,
            clearance: Vec::with_capacity(discs.len()),
            minima: Vec::new(),
            least: Vec::with_capacity(discs.len()),
            curvature: Vec::with_capacity(segments),
        };
        for curve in curves {
            let (length, bending) = curve.length_and_bending();
            survey.length += length;
            survey.bending += bending;
            let sigma: [f64; SAMPLES + 1] =
                std::array::from_fn(|j| curve.curvature(j as f64 / SAMPLES as f64));
            survey.curvature.push(sigma);
        }
        for (k, disc) in discs.iter().enumerate() {
            let probe = Probe {
                spline,
                disc,
                world,
            };
            let samples = probe.samples(curves, reach, go_on)?;
            let least = probe.minima(k, &samples, reach, &mut survey.minima, go_on)?;
            survey.least.push(least);
            survey.clearance.push(samples);
        }
        Some(survey)
    }
}

/// One disc carried along the curve.
struct Probe<'s> {
    spline: &'s Spline,
    disc: &'s FootprintDisc,
    world: &'s World,
}

impl Probe<'_> {
    /// Clearance at parameter `u` of the whole curve, in segments.
    fn at(&self, u: f64) -> f64 {
        let (segment, t) = split(u, self.spline.segments());
        let place = self.spline.place(segment, t);
        self.world
            .clearance(centre(place.point, place.first, self.disc))
            - self.disc.radius
    }

    fn samples(
        &self,
        curves: &[FergusonCurve],
        reach: f64,
        go_on: &dyn Fn() -> bool,
    ) -> Option<Vec<f64>> {
        let segments = curves.len();
        let mut samples = vec![f64::INFINITY; SAMPLES * segments + 1];
        let step = 1.0 / SAMPLES as f64;
        for (i, curve) in curves.iter().enumerate() {
            if i % ASKED_EVERY == ASKED_EVERY - 1 && !go_on() {
                return None;
            }
            // The disc's centre swings by no more than its distance from the reference point times the turn, and never by more
            // than twice that distance.
            let swing = match self.disc.offset.hypot(self.disc.lateral) {
                0.0 => 0.0,
                offset => offset * (0.5 * curve.heading_rate_bound(0.0, 1.0)).min(2.0),
            };
            let middle = self.at(i as f64 + 0.5);
            if middle - 0.5 * curve.speed_bound() - swing > reach {
                continue;
            }
            let first = SAMPLES * i;
            let past = if i + 1 == segments {
                SAMPLES + 1
            } else {
                SAMPLES
            };
            for j in 0..past {
                samples[first + j] = if 2 * j == SAMPLES {
                    middle
                } else {
                    self.at(i as f64 + j as f64 * step)
                };
            }
        }
        Some(samples)
    }

    /// Appends the refined local minima of disc `index` and returns the least clearance of each segment.
    fn minima(
        &self,
        index: usize,
        samples: &[f64],
        reach: f64,
        minima: &mut Vec<Minimum>,
        go_on: &dyn Fn() -> bool,
    ) -> Option<Vec<f64>> {
        let segments = self.spline.segments();
        let last = samples.len() - 1;
        let mut least: Vec<f64> = (0..segments)
            .map(|i| {
                samples[SAMPLES * i..=SAMPLES * (i + 1)]
                    .iter()
                    .copied()
                    .fold(f64::INFINITY, f64::min)
            })
            .collect();
        for j in 1..last {
            if j % (SAMPLES * ASKED_EVERY) == 0 && !go_on() {
                return None;
            }
            let c = samples[j];
            if !(c < reach && c <= samples[j - 1] && c < samples[j + 1]) {
                continue;
            }
            let step = 1.0 / SAMPLES as f64;
            let (u, clearance) = self.golden((j as f64 - 1.0) * step, (j as f64 + 1.0) * step);
            let (segment, t) = split(u, segments);
            least[segment] = least[segment].min(clearance);
            minima.push(Minimum {
                disc: index,
                segment,
                t,
                clearance,
            });
        }
        Some(least)
    }

    /// The least clearance between two parameters, if there is one minimum between them.
    fn golden(&self, mut low: f64, mut high: f64) -> (f64, f64) {
        const RATIO: f64 = 0.618_033_988_749_894_9;
        let mut left = high - RATIO * (high - low);
        let mut right = low + RATIO * (high - low);
        let (mut at_left, mut at_right) = (self.at(left), self.at(right));
        for _ in 0..GOLDEN_STEPS {
            if at_left < at_right {
                (high, right, at_right) = (right, left, at_left);
                left = high - RATIO * (high - low);
                at_left = self.at(left);
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = low + RATIO * (high - low);
                at_right = self.at(right);
            }
        }
        if at_left < at_right {
            (left, at_left)
        } else {
            (right, at_right)
        }
    }
}

/// Centre of a disc carried by the reference point with this tangent.
pub(crate) fn centre(point: Point2, tangent: Vector2, disc: &FootprintDisc) -> Point2 {
    let speed = tangent.norm();
    if is_central(disc) || speed <= 0.0 {
        return point;
    }
    let along = tangent / speed;
    point + along * disc.offset + Vector2::new(-along.y, along.x) * disc.lateral
}

/// Whether the disc does not move when the footprint turns.
pub(crate) fn is_central(disc: &FootprintDisc) -> bool {
    disc.offset == 0.0 && disc.lateral == 0.0
}

/// Segment and its parameter at parameter `u` of the whole curve.
fn split(u: f64, segments: usize) -> (usize, f64) {
    let segment = (u.max(0.0) as usize).min(segments - 1);
    (segment, (u - segment as f64).clamp(0.0, 1.0))
}
