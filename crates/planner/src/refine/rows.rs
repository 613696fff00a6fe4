//! Clearance and curvature of the next curve, linearised about the current one: the elastic rows of a round.
//!
//! *Clearance* of a disc a ahead and b to the left, with n the unit vector from the nearest obstacle point to its centre (reversed
//! inside): moving the centre by δ changes it by n·δ. The centre is P + a t̂ + b t̂_⊥, t̂_⊥ a quarter turn left of t̂, so
//!
//! ```text
//!     ∂(n·centre)/∂c_{i+k} = B_k n + B'_k (a n·t̂_⊥ − b n·t̂)/|P'| t̂_⊥
//! ```
//!
//! where the second term is how the disc swings when the tangent turns. *Curvature*:
//!
//! ```text
//!     ∂σ/∂c_{i+k} = ∂(P'×P'')/|P'|³ − 3σ B'_k P'/|P'|²
//! ```
//!
//! All rows are in metres: those of curvature are multiplied by R², so that one price fits both.

use super::spline::{Place, Spline};
use super::survey::{SAMPLES, Survey, centre, is_central};
use bikebot_geometry::{Point2, Vector2};
use bikebot_qp::BandedQp;
use bikebot_world::{FootprintDisc, World};

/// Rows at the middle and start of a segment below this part of σ_MAX are left out.
const CURVED: f64 = 0.25;
/// Part of the limit from which a peak between them gets its own row.
const PEAK: f64 = 0.9;
/// Part of the reach within which every second sample gets a row.
const NEAR: f64 = 0.15;
/// Most rows of one disc on one segment, more being left out; and of curvature.
const MOST_CLEARANCE_ROWS: usize = 8;
const MOST_CURVATURE_ROWS: usize = 4;

/// What the next curve is asked for, segment by segment. Segments that failed to certify are asked for more.
#[derive(Debug, Clone)]
pub(crate) struct Demands {
    /// Clearance of every disc, m.
    pub clearance: Vec<f64>,
    /// |σ|, 1/m.
    pub curvature: Vec<f64>,
}

/// What rows are made from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowMaker<'a> {
    pub world: &'a World,
    pub discs: &'a [FootprintDisc],
    /// Clearances beyond it do not matter, m.
    pub reach: f64,
    pub max_curvature: f64,
    /// ρ.
    pub price: f64,
    /// Whether start and goal have headings.
    pub clamped: [bool; 2],
    /// Whether the curvature at the start is prescribed.
    pub curvature_is_fixed: bool,
}

/// A row Σ coefficients·step ≤ bound + e, on the four control points of a segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub segment: usize,
    pub coefficients: [f64; 8],
    /// m.
    pub bound: f64,
}

impl RowMaker<'_> {
    /// Room to set aside in a programme for a curve of `segments` segments.
    pub fn most_rows(&self, segments: usize) -> usize {
        // and one of forward speed at each end
        segments * (self.discs.len() * MOST_CLEARANCE_ROWS + MOST_CURVATURE_ROWS) + 2
    }

    /// Adds the rows of `spline`. A row that is not finite is left out: it would say nothing.
    pub fn add_to(
        &self,
        qp: &mut BandedQp<8>,
        spline: &Spline,
        survey: &Survey,
        demands: &Demands,
    ) {
        let mut add = |row: Option<Row>| {
            if let Some(row) = row {
                let first = 2 * row.segment;
                // Refused are only rows for which there is no room, and those that are not finite.
                let _ = qp.add_elastic_row(first, &row.coefficients, row.bound, self.price);
            }
        };
        for segment in 0..spline.segments() {
            self.curvature_rows(spline, survey, demands, segment, &mut add);
            self.clearance_rows(spline, survey, demands, segment, &mut add);
        }
        for minimum in &survey.minima {
            add(self.clearance_row(
                spline,
                minimum.segment,
                minimum.t,
                minimum.disc,
                minimum.clearance,
                demands,
            ));
        }
    }

    fn curvature_rows(
        &self,
        spline: &Spline,
        survey: &Survey,
        demands: &Demands,
        segment: usize,
        add: &mut impl FnMut(Option<Row>),
    ) {
        let sigma = &survey.curvature[segment];
        let limit = demands.curvature[segment];
        let last = segment + 1 == spline.segments();
        for (j, s) in sigma.iter().enumerate() {
            let at_joint = j == 0 || 2 * j == SAMPLES || (j == SAMPLES && last);
            let is_peak = j > 0
                && j < SAMPLES
                && s.abs() >= PEAK * limit
                && s.abs() >= sigma[j - 1].abs()
                && s.abs() > sigma[j + 1].abs();
            // Nothing can be done about a curvature that is prescribed.
            let is_fixed = self.curvature_is_fixed && segment == 0 && j == 0;
            if (at_joint && !is_fixed && s.abs() > CURVED * self.max_curvature) || is_peak {
                let place = spline.place(segment, j as f64 / SAMPLES as f64);
                add(Some(self.curvature_row(segment, &place, limit)));
            }
        }
    }

    fn clearance_rows(
        &self,
        spline: &Spline,
        survey: &Survey,
        demands: &Demands,
        segment: usize,
        add: &mut impl FnMut(Option<Row>),
    ) {
        for (k, samples) in survey.clearance.iter().enumerate() {
            let last = segment + 1 == spline.segments();
            for j in 0..=SAMPLES {
                let c = samples[SAMPLES * segment + j];
                let at_joint = j == 0 || 2 * j == SAMPLES || (j == SAMPLES && last);
                let every_second = j % 2 == 0 && j < SAMPLES && c < NEAR * self.reach;
                // Nothing can be done about a disc that stands still with the end it belongs to.
                let stands = (segment == 0 && j == 0 && self.stands(0, k))
                    || (last && j == SAMPLES && self.stands(1, k));
                if c < self.reach && (at_joint || every_second) && !stands {
                    let t = j as f64 / SAMPLES as f64;
                    add(self.clearance_row(spline, segment, t, k, c, demands));
                }
            }
        }
    }

    fn stands(&self, end: usize, disc: usize) -> bool {
        self.clamped[end] || is_central(&self.discs[disc])
    }

    /// −∂(n·centre)·d − e ≤ clearance − demand.
    pub(crate) fn clearance_row(
        &self,
        spline: &Spline,
        segment: usize,
        t: f64,
        disc: usize,
        clearance: f64,
        demands: &Demands,
    ) -> Option<Row> {
        let place = spline.place(segment, t);
        let disc = &self.discs[disc];
        let at = centre(place.point, place.first, disc);
        let n = self.away(at, clearance + disc.radius)?;
        let speed = place.first.norm();
        let swing = if is_central(disc) || speed <= 0.0 {
            Vector2::zeros()
        } else {
            let along = place.first / speed;
            let left = Vector2::new(-along.y, along.x);
            left * ((disc.offset * n.dot(&left) - disc.lateral * n.dot(&along)) / speed)
        };
        let mut coefficients = [0.0; 8];
        for k in 0..4 {
            let by = n * place.basis.value[k] + swing * place.basis.first[k];
            coefficients[2 * k] = -by.x;
            coefficients[2 * k + 1] = -by.y;
        }
        Some(Row {
            segment,
            coefficients,
            bound: clearance - demands.clearance[segment],
        })
    }

    /// The direction in which the clearance of a point grows fastest.
    fn away(&self, p: Point2, clearance: f64) -> Option<Vector2> {
        let from = p - self.world.nearest_obstacle_point(p);
        let distance = from.norm();
        // On a boundary the nearest point is the point itself; then the clearance on both sides tells.
        let close = 1e-6 * self.reach;
        if distance > close {
            return Some(from / if clearance < 0.0 { -distance } else { distance });
        }
        let step = 1e-3 * self.reach;
        let slope = |d: Vector2| self.world.clearance(p + d) - self.world.clearance(p - d);
        let gradient = Vector2::new(
            slope(Vector2::new(step, 0.0)),
            slope(Vector2::new(0.0, step)),
        );
        gradient.try_normalize(1e-9 * step)
    }

    /// ±∂σ·d − e ≤ limit − |σ|, times R².
    pub(crate) fn curvature_row(&self, segment: usize, place: &Place, limit: f64) -> Row {
        let (sigma, gradient) = curvature_and_gradient(place);
        let scale = 1.0 / (self.max_curvature * self.max_curvature);
        Row {
            segment,
            coefficients: gradient.map(|g| scale * sigma.signum() * g),
            bound: scale * (limit - sigma.abs()),
        }
    }
}

/// σ and ∂σ/∂(x, y of the four control points).
pub(crate) fn curvature_and_gradient(place: &Place) -> (f64, [f64; 8]) {
    let (d1, d2) = (place.first, place.second);
    let squared = d1.norm_squared();
    let cubed = squared * squared.sqrt();
    let sigma = d1.perp(&d2) / cubed;
    let mut gradient = [0.0; 8];
    for k in 0..4 {
        let (first, second) = (place.basis.first[k], place.basis.second[k]);
        let turn = Vector2::new(first * d2.y - second * d1.y, second * d1.x - first * d2.x);
        let by = turn / cubed - d1 * (3.0 * sigma * first / squared);
        gradient[2 * k] = by.x;
        gradient[2 * k + 1] = by.y;
    }
    (sigma, gradient)
}
