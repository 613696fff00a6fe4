//! Lines 7–8 of Algorithm 1: samples in a corridor about the guide, with headings after Eq. (1)–(2).
//!
//! A sample's position is uniform along the guide and across the corridor's width; its heading is that of the guide,
//! blended near a vertex with that of the neighbouring segment, plus a uniform spread.
//!
//! The blend at distance d from a vertex is printed with the weights (1 + d)/(2w) and (1 − d)/(2w), which do not sum to one.
//! Read as (1 + d/w)/2 and (1 − d/w)/2 they do, and the heading is continuous: half of each at the vertex, only one's own
//! at distance w (D1). Where a segment is shorter than 2w the nearer vertex rules, and the blend reaches half
//! the segment (D2).

use crate::chance::Chance;
use bikebot_geometry::{Point2, Polyline, Pose2, Projection, angle};

/// The heading that the guide suggests at a point, Eq. (1)–(2).
#[derive(Debug, Clone, Copy)]
pub struct HeadingPrior<'g> {
    guide: &'g Polyline,
    half_width: f64,
    continuous: bool,
}

impl<'g> HeadingPrior<'g> {
    /// For a corridor of half width `half_width` (the paper's w, m) about `guide`. `continuous` chooses the corrected
    /// reading; otherwise the weights are those printed, and headings are averaged as plain numbers.
    #[must_use]
    pub fn new(guide: &'g Polyline, half_width: f64, continuous: bool) -> Self {
        Self {
            guide,
            half_width,
            continuous,
        }
    }

    /// Heading at the foot of `point` on the guide, rad. Zero for a guide of one vertex.
    #[must_use]
    pub fn at(&self, point: Point2) -> f64 {
        self.at_foot(&self.guide.project(point))
    }

    /// Heading at a foot on the guide, rad.
    #[must_use]
    pub fn at_foot(&self, foot: &Projection) -> f64 {
        let segments = self.guide.segment_count();
        if segments == 0 {
            return 0.0;
        }
        let i = foot.segment;
        let own = self.guide.segment_heading(i);
        let to_next = (self.guide.cumulative(i + 1) - foot.s).max(0.0);
        let to_previous = (foot.s - self.guide.cumulative(i)).max(0.0);
        let reach = self.half_width.min(0.5 * (to_next + to_previous));
        if to_next <= reach && i + 1 < segments {
            self.blend(own, self.guide.segment_heading(i + 1), to_next, reach)
        } else if to_previous <= reach && i > 0 {
            self.blend(own, self.guide.segment_heading(i - 1), to_previous, reach)
        } else {
            own
        }
    }

    /// `own` blended with the neighbouring segment's heading at `distance` (m) from the vertex between them.
    fn blend(&self, own: f64, neighbour: f64, distance: f64, reach: f64) -> f64 {
        if self.continuous {
            let weight = 0.5 * (1.0 - distance / reach);
            angle::interpolate(own, neighbour, weight)
        } else {
            let w = self.half_width;
            ((1.0 + distance) * own + (1.0 - distance) * neighbour) / (2.0 * w)
        }
    }
}

/// Draws poses in the corridor about a guide.
#[derive(Debug, Clone, Copy)]
pub struct PathWidthSampler<'g> {
    guide: &'g Polyline,
    half_width: f64,
    heading_spread: f64,
    prior: HeadingPrior<'g>,
}

impl<'g> PathWidthSampler<'g> {
    /// A corridor of half width `half_width` (w, m) about `guide`, with headings up to `heading_spread` (δθ, rad) to
    /// either side of `prior`.
    #[must_use]
    pub fn new(
        guide: &'g Polyline,
        half_width: f64,
        heading_spread: f64,
        prior: HeadingPrior<'g>,
    ) -> Self {
        Self {
            guide,
            half_width,
            heading_spread,
            prior,
        }
    }

    /// A pose in the corridor: place along the guide, offset across it and heading, drawn in this order.
    pub fn draw(&self, chance: &mut Chance) -> Pose2 {
        let s = chance.between(0.0, self.guide.length());
        let offset = chance.between(-self.half_width, self.half_width);
        let along = Pose2 {
            position: self.guide.point_at(s),
            heading: self.guide.heading_at(s),
        };
        let position = along.position + along.left_normal() * offset;
        Pose2 {
            position,
            heading: self.draw_heading(position, chance),
        }
    }

    /// A heading for a node at `position`, rad, in (−π, π].
    pub fn draw_heading(&self, position: Point2, chance: &mut Chance) -> f64 {
        let spread = chance.between(-self.heading_spread, self.heading_spread);
        angle::wrap(self.prior.at(position) + spread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Purpose;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    fn corner() -> Polyline {
        Polyline::new(vec![
            Point2::new(0.0, 0.0),
            Point2::new(10.0, 0.0),
            Point2::new(10.0, 10.0),
        ])
        .unwrap()
    }

    #[test]
    fn half_of_each_heading_at_the_vertex_and_only_ones_own_a_width_away() {
        let guide = corner();
        let prior = HeadingPrior::new(&guide, 2.0, true);
        assert!((prior.at(Point2::new(10.0, 0.0)) - FRAC_PI_4).abs() < 1e-15);
        assert!((prior.at(Point2::new(9.0, 0.5)) - FRAC_PI_4 / 2.0).abs() < 1e-15);
        assert_eq!(prior.at(Point2::new(8.0, 0.0)), 0.0);
        assert!((prior.at(Point2::new(10.3, 1.0)) - 1.5 * FRAC_PI_4).abs() < 1e-15);
        assert!((prior.at(Point2::new(10.0, 5.0)) - FRAC_PI_2).abs() < 1e-15);
        // No neighbour beyond the ends.
        assert_eq!(prior.at(Point2::new(0.0, 0.0)), 0.0);
        assert!((prior.at(Point2::new(10.0, 10.0)) - FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn as_printed_two_equal_headings_give_another() {
        // With w = 2 and 1 rad on both segments the printed weights sum to one half.
        let printed = HeadingPrior::new(&corner(), 2.0, false).blend(1.0, 1.0, 0.7, 2.0);
        assert!((printed - 0.5).abs() < 1e-15);
        let corrected = HeadingPrior::new(&corner(), 2.0, true).blend(1.0, 1.0, 0.7, 2.0);
        assert!((corrected - 1.0).abs() < 1e-15);
    }

    #[test]
    fn headings_blend_along_the_shorter_arc() {
        // From 170° to −170° over 180°, not over 0°.
        let prior = HeadingPrior::new(&corner(), 2.0, true).blend(
            170.0_f64.to_radians(),
            (-170.0_f64).to_radians(),
            0.0,
            2.0,
        );
        assert!((prior.abs() - PI).abs() < 1e-14);
    }

    #[test]
    fn a_guide_of_one_point_has_heading_zero() {
        let point = Polyline::new(vec![Point2::new(1.0, 1.0)]).unwrap();
        assert_eq!(
            HeadingPrior::new(&point, 2.0, true).at(Point2::new(3.0, 3.0)),
            0.0
        );
    }

    fn guide() -> impl Strategy<Value = Polyline> {
        prop::collection::vec((0.2..6.0_f64, -1.5..1.5_f64), 1..8).prop_map(|legs| {
            let mut at = Point2::origin();
            let mut heading = 0.0;
            let mut vertices = vec![at];
            for (length, turn) in legs {
                heading += turn;
                at += Pose2::new(0.0, 0.0, heading).direction() * length;
                vertices.push(at);
            }
            Polyline::new(vertices).unwrap()
        })
    }

    proptest! {
        #[test]
        fn the_heading_is_continuous_along_any_guide(guide in guide(), u in 0.0..1.0_f64) {
            let prior = HeadingPrior::new(&guide, 2.0, true);
            let at = |s: f64| {
                let segment = guide.segment_at(s).unwrap();
                prior.at_foot(&Projection { segment, s, foot: guide.point_at(s), distance: 0.0 })
            };
            let (s, step) = (u * guide.length(), 1e-6);
            // The blend turns at most half of 1.5 rad over half of the shortest segment.
            prop_assert!(angle::difference(at(s + step), at(s)).abs() < 0.75 / 0.1 * step * 1.01 + 1e-12);
        }

        #[test]
        fn samples_stay_in_the_corridor_and_within_the_spread(guide in guide(), seed in 0..1000_u64) {
            let prior = HeadingPrior::new(&guide, 1.0, true);
            let sampler = PathWidthSampler::new(&guide, 1.0, 0.5, prior);
            let mut chance = Chance::new(seed, Purpose::Corridor, 0);
            for _ in 0..20 {
                let pose = sampler.draw(&mut chance);
                prop_assert!(guide.project(pose.position).distance <= 1.0 + 1e-12);
                let off = angle::difference(pose.heading, prior.at(pose.position));
                prop_assert!(off.abs() <= 0.5 + 1e-12);
            }
        }
    }
}
