//! What moves: tracks of clusters of hits that the belief cannot explain by what stands still.
//!
//! | file | holds |
//! |---|---|
//! | `unexplained` | which hits belong to nothing that has stood there for a while |
//! | `cluster` | hits side by side, and the disc they look like |
//! | `track` | constant velocity, one covariance for both axes |
//!
//! A hit is *unexplained* if its cell was free a moment ago and nothing settled stands beside it. What has stood in one place for
//! `settle_s` belongs to what stands still, and the belief has it as occupied.

mod cluster;
mod params;
mod track;
mod unexplained;

pub use params::TrackerParams;
pub use track::Track;

use bikebot_geometry::Point2;

use crate::mapper::{Hit, Mapper};
use cluster::{Disc, clusters};
use unexplained::Memory;

/// Follows what moves, scan by scan.
///
/// Deterministic: equal scans give equal tracks, with equal numbers.
#[derive(Debug, Clone)]
pub struct Tracker {
    params: TrackerParams,
    memory: Memory,
    tracks: Vec<Track>,
    next_id: u64,
}

impl Tracker {
    /// A tracker that has seen nothing yet.
    #[must_use]
    pub fn new(params: &TrackerParams) -> Self {
        Self {
            params: *params,
            memory: Memory::default(),
            tracks: Vec::new(),
            next_id: 0,
        }
    }

    /// What is known to move, oldest first.
    pub fn tracks(&self) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(|track| track.is_confirmed())
    }

    /// Takes in the scan that `mapper` has inserted last.
    pub fn update(&mut self, mapper: &Mapper) {
        let Some(now) = mapper.hits().iter().map(|hit| hit.time).reduce(f64::max) else {
            return;
        };
        let unexplained = self.memory.unexplained(mapper, &self.params);
        let mut found = clusters(&unexplained, &self.params);
        self.part(&mut found);
        let discs: Vec<Disc> = found
            .iter()
            .filter_map(|(hits, is_part)| Disc::of(hits, *is_part, &self.params))
            .collect();
        let taken = self.associate(&discs);
        for (disc, taken) in discs.iter().zip(taken) {
            if !taken {
                self.tracks
                    .push(Track::born(self.next_id, disc, &self.params));
                self.next_id += 1;
            }
        }
        let params = &self.params;
        self.tracks
            .retain(|track| track.is_alive(now, params) && track.is_finite());
    }

    /// Parts clusters that hold what belongs to several tracks: those that pass one another are seen as one for a moment.
    fn part(&self, found: &mut Vec<(Vec<Hit>, bool)>) {
        let mut parted = Vec::with_capacity(found.len());
        for (hits, _) in found.drain(..) {
            let claims: Vec<(Point2, f64)> = self
                .tracks()
                .filter_map(|track| {
                    let time = hits[0].time;
                    let centre = track.position_at(time);
                    let reach = track.radius() + self.params.cluster_gap;
                    let is_near = hits.iter().any(|hit| (hit.point - centre).norm() <= reach);
                    is_near.then_some((centre, track.radius()))
                })
                .collect();
            if claims.len() < 2 {
                parted.push((hits, false));
                continue;
            }
            let mut parts = vec![Vec::new(); claims.len()];
            for hit in hits {
                // The surface that the hit is nearest to.
                let off =
                    |(centre, radius): &(Point2, f64)| ((hit.point - centre).norm() - radius).abs();
                let mut nearest = 0;
                for (index, claim) in claims.iter().enumerate() {
                    if off(claim) < off(&claims[nearest]) {
                        nearest = index;
                    }
                }
                parts[nearest].push(hit);
            }
            parted.extend(parts.into_iter().map(|part| (part, true)));
        }
        *found = parted;
    }

    /// Gives each disc to the track it fits best, each track at most one; says which discs were given away.
    fn associate(&mut self, discs: &[Disc]) -> Vec<bool> {
        let mut pairs = Vec::new();
        for (t, track) in self.tracks.iter().enumerate() {
            for (d, disc) in discs.iter().enumerate() {
                let distance = track.distance(disc, &self.params);
                if distance <= self.params.gate {
                    // A track that is sure of itself chooses first.
                    pairs.push((!track.is_confirmed(), distance, t, d));
                }
            }
        }
        pairs.sort_by(|a, b| {
            a.0.cmp(&b.0)
                .then(a.1.total_cmp(&b.1))
                .then((a.2, a.3).cmp(&(b.2, b.3)))
        });
        let mut has_disc = vec![false; self.tracks.len()];
        let mut taken = vec![false; discs.len()];
        for (_, _, t, d) in pairs {
            if !has_disc[t] && !taken[d] {
                has_disc[t] = true;
                taken[d] = true;
                self.tracks[t].update(&discs[d], &self.params);
            }
        }
        taken
    }
}

#[cfg(test)]
mod tests;
