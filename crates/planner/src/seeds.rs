//! Poses that a corridor search tries before it draws any (D12): along the guide's segments, around the outside of its corners.
//!
//! They do not change what the search converges to; they find the first path many times sooner, because a random heading
//! rarely matches a corner.

use bikebot_geometry::{Polyline, Pose2, angle};

/// Most places along the whole guide that seeds are laid at. A step that asks for more is far too short for its field, and would
/// fill the memory before the first sample.
const MOST_PLACES: f64 = 20_000.0;

/// Poses to try first, in the order of the guide: along its segments, and around the outside of its corners.
///
/// Outside, because a short guide touches the obstacle at its corners, and a curve that rounds the corner inside would cut
/// into it. All are proposals; the tests of every sample decide.
#[must_use]
pub fn along(guide: &Polyline, half_width: f64, max_step: f64, max_curvature: f64) -> Vec<Pose2> {
    let mut seeds: Vec<(f64, Pose2)> = Vec::new();
    let radius = 1.0 / max_curvature;
    let segments = guide.segment_count();
    let max_step = max_step.max(1.3 * guide.length() / MOST_PLACES);
    let beside = |s: f64, heading: f64, offset: f64| {
        let normal = Pose2::new(0.0, 0.0, heading).left_normal();
        guide.point_at(s) + normal * offset
    };
    for i in 0..segments {
        let heading = guide.segment_heading(i);
        let (from, to) = (guide.cumulative(i), guide.cumulative(i + 1));
        let count = (1.3 * (to - from) / max_step).ceil().max(1.0);
        for k in 0..count as usize {
            let s = from + (to - from) * (k as f64 + 0.5) / count;
            for offset in [0.0, 0.15, -0.15, 0.4, -0.4] {
                let position = beside(s, heading, offset * half_width);
                seeds.push((s, Pose2 { position, heading }));
            }
        }
        if i + 1 == segments {
            break;
        }
        let turn = angle::difference(guide.segment_heading(i + 1), heading);
        let outside = -turn.signum();
        let bisector = angle::wrap(heading + 0.5 * turn);
        for offset in [0.02, 0.1, 0.2, 0.35, 0.55, 0.8] {
            let position = beside(to, bisector, outside * offset * half_width);
            let pose = Pose2 {
                position,
                heading: bisector,
            };
            seeds.push((to, pose));
        }
        let reach = (1.2 * radius * turn.abs())
            .max(0.3 * radius)
            .min(0.9 * max_step);
        let next = guide.segment_heading(i + 1);
        for (s, own, inward) in [
            (to - reach, heading, heading + 0.25 * turn),
            (to + reach, next, next - 0.25 * turn),
        ] {
            let s = s.clamp(0.0, guide.length());
            for offset in [0.05, 0.2, 0.4] {
                let position = beside(s, own, outside * offset * half_width);
                for heading in [own, angle::wrap(inward)] {
                    seeds.push((s, Pose2 { position, heading }));
                }
            }
        }
    }
    seeds.sort_by(|a, b| a.0.total_cmp(&b.0));
    seeds.into_iter().map(|(_, pose)| pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Point2;

    #[test]
    fn seeds_run_along_the_guide_within_the_corridor() {
        let guide = Polyline::new(vec![
            Point2::new(0.0, 0.0),
            Point2::new(12.0, 0.0),
            Point2::new(12.0, 8.0),
        ])
        .unwrap();
        let seeds = along(&guide, 2.0, 5.0, 1.0);
        assert!(seeds.len() > 30);
        let mut last = 0.0;
        for seed in &seeds {
            let foot = guide.project(seed.position);
            assert!(foot.distance <= 2.0 + 1e-12);
            // Entry and exit poses lie beside the place they are sorted by; the foot may be a width away.
            assert!(foot.s >= last - 2.0);
            last = foot.s;
        }
        // The corner is left: its own seeds are on the right of it.
        let bisector = std::f64::consts::FRAC_PI_4;
        let at_corner: Vec<_> = seeds.iter().filter(|s| s.heading == bisector).collect();
        assert_eq!(at_corner.len(), 6);
        assert!(
            at_corner
                .iter()
                .all(|s| s.position.x > 12.0 && s.position.y < 0.0)
        );
    }

    /// Found in review: a nanometre step on a free line of 100 m asked for 10¹¹ poses.
    #[test]
    fn a_step_far_too_short_for_the_guide_fills_no_memory() {
        let guide = Polyline::new(vec![Point2::origin(), Point2::new(100.0, 0.0)]).unwrap();
        assert!(along(&guide, 2.0, 1e-9, 1.0).len() <= 5 * 20_000 + 5);
    }

    #[test]
    fn a_guide_of_one_point_has_none() {
        let point = Polyline::new(vec![Point2::origin()]).unwrap();
        assert!(along(&point, 2.0, 5.0, 1.0).is_empty());
    }
}
