//! Hits side by side, and the disc they look like.

use bikebot_geometry::{Point2, Vector2, cross};

use super::params::TrackerParams;
use crate::mapper::Hit;

/// Hits whose neighbours, beam by beam, are no farther apart than the gap; none of them a part of another yet.
pub(crate) fn clusters(hits: &[Hit], params: &TrackerParams) -> Vec<(Vec<Hit>, bool)> {
    let mut found: Vec<(Vec<Hit>, bool)> = Vec::new();
    for hit in hits {
        // The thing may be cut in two by something thin before it: look back a little.
        let near = found.iter_mut().rev().take(4).find(|(members, _)| {
            let recent = members.iter().rev().take(4);
            recent
                .map(|member| (member.point - hit.point).norm())
                .any(|distance| distance <= params.cluster_gap)
        });
        match near {
            Some((members, _)) => members.push(*hit),
            None => found.push((vec![*hit], false)),
        }
    }
    found.retain(|(members, _)| members.len() >= params.min_hits as usize);
    found
}

/// A disc as the laser sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Disc {
    pub(crate) time: f64,
    pub(crate) centre: Point2,
    pub(crate) radius: f64,
    /// Standard deviation of the centre along each axis, m.
    pub(crate) sigma: f64,
}

impl Disc {
    /// From the angle it fills, and the distances within it. A part of a cluster tells less.
    ///
    /// Seen under the half angle h at the distance D its radius is D sin h, and its nearest point lies at D (1 − sin h).
    pub(crate) fn of(hits: &[Hit], is_part: bool, params: &TrackerParams) -> Option<Self> {
        if hits.len() < params.min_hits as usize {
            return None;
        }
        let count = hits.len() as f64;
        let time = hits.iter().map(|hit| hit.time).sum::<f64>() / count;
        // All beams seen from where the middle one came from; the bike moves millimetres between them.
        let middle = hits[hits.len() / 2];
        let origin = middle.point - middle.direction * middle.distance;
        let seen: Vec<(Vector2, f64)> = hits
            .iter()
            .map(|hit| {
                let to = hit.point - origin;
                let distance = to.norm();
                (to / distance.max(1e-9), distance)
            })
            .collect();
        let bearing =
            |direction: &Vector2| cross(middle.direction, *direction).clamp(-1.0, 1.0).asin();
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for (direction, _) in &seen {
            let angle = bearing(direction);
            least = least.min(angle);
            most = most.max(angle);
        }
        // Half a beam to either side was filled as well, on average.
        let spacing = (most - least) / (count - 1.0).max(1.0);
        let half = (0.5 * (most - least + spacing)).clamp(0.0, 1.4);
        let nearest = seen
            .iter()
            .map(|(_, distance)| *distance)
            .fold(f64::INFINITY, f64::min);
        // Not clamp, which panics where the largest is below the least.
        let radius = (nearest * half.sin() / (1.0 - half.sin()))
            .min(params.max_radius)
            .max(params.min_radius);
        let (sin, cos) = (0.5 * (least + most)).sin_cos();
        let m = middle.direction;
        let axis = Vector2::new(cos * m.x - sin * m.y, sin * m.x + cos * m.y);
        // The centre that each hit puts on the axis, if it lies on the disc's near side.
        let depth = seen
            .iter()
            .map(|(direction, distance)| {
                let along = distance * direction.dot(&axis);
                let across = distance * cross(axis, *direction);
                along + (radius * radius - across * across).max(0.0).sqrt()
            })
            .sum::<f64>()
            / count;
        let sigma = if is_part {
            // Of the hidden part nothing is known.
            params.position_sigma + 0.5 * radius
        } else {
            params.position_sigma
        };
        Some(Self {
            time,
            centre: origin + axis * depth,
            radius,
            sigma,
        })
    }
}
