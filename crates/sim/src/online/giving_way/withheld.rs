//! Cells that something moving covers are no walls.
//!
//! A thing that crosses leaves a trail in the belief: the mapper needs a few scans to see that a cell is free again. If the navigator
//! heard of all that, it would plan around a place that is free when the bike comes there, and again a scan later around another. So
//! what is said of cells under something that moves, and of those it has just left, is withheld, if the navigator has them as free: who
//! moves is given way to instead. It is told after all when nothing moves there any more and the cell is still not free, as
//! when the thing has come to rest.

use std::collections::BTreeMap;

use bikebot_mapping::Track;
use bikebot_world::{Cell, OccupancyGrid};

use super::params::GivingWayParams;

/// How far hits may lie outside the disc that a track has, m: pose, noise, and an outline that is no disc.
const BESIDE: f64 = 0.35;
/// For how long a cell stays withheld after the thing has left it, s: the mapper clears what it sees in half of that.
const TRAIL: f64 = 1.0;
/// What was told so long ago is taken back when it turns out to have been something that moves, s: a track takes a few scans.
const TAKEN_BACK: f64 = 1.5;

/// A cell of the grid, and what it is.
type Change = (usize, usize, Cell);

/// What moves, for as long as it counts as moving.
#[derive(Debug, Clone, Copy)]
struct Moving {
    id: u64,
    /// When it was last fast enough, s.
    last: f64,
}

/// Stands between mapper and navigator.
#[derive(Debug, Clone)]
pub(crate) struct Withheld {
    rest_after: f64,
    least_speed: f64,
    /// What the navigator has been told.
    told: Vec<Cell>,
    /// Cells it has not been told the truth about, and until when, s.
    held: BTreeMap<usize, f64>,
    /// Cells told to be free no more, and when, s.
    news: BTreeMap<usize, f64>,
    moving: Vec<Moving>,
    answer: Vec<Change>,
}

impl Withheld {
    /// For a navigator that knows `belief`; slower than `least_speed` (m/s) nothing moves.
    pub fn new(params: &GivingWayParams, least_speed: f64, belief: &OccupancyGrid) -> Self {
        Self {
            rest_after: params.rest_after,
            least_speed,
            told: belief.cells.clone(),
            held: BTreeMap::new(),
            news: BTreeMap::new(),
            moving: Vec::new(),
            answer: Vec::new(),
        }
    }

    /// What to tell of `changes` to `belief`, seen at `now` (s).
    pub fn tell<'t>(
        &mut self,
        changes: &[Change],
        belief: &OccupancyGrid,
        tracks: impl Iterator<Item = &'t Track>,
        now: f64,
    ) -> &[Change] {
        self.answer.clear();
        let tracks: Vec<&Track> = tracks.collect();
        self.watch(&tracks, now);
        let moving: Vec<&Track> = tracks
            .into_iter()
            .filter(|track| self.moving.iter().any(|moving| moving.id == track.id()))
            .collect();
        let width = belief.width;
        let is_under = |cell: usize, time: f64| {
            let centre = belief.cell_centre(cell % width, cell / width);
            moving
                .iter()
                .any(|track| (track.position_at(time) - centre).norm() <= track.radius() + BESIDE)
        };
        for &(x, y, cell) in changes {
            let index = y * width + x;
            let Some(told) = self.told.get(index) else {
                continue;
            };
            let was_free = *told == Cell::Free;
            if cell == Cell::Free {
                self.held.remove(&index);
                self.news.remove(&index);
                if was_free {
                    continue;
                }
            } else if self.held.contains_key(&index) || was_free && is_under(index, now) {
                self.held.entry(index).or_insert(now + TRAIL);
                continue;
            } else if was_free {
                self.news.insert(index, now);
            }
            self.told[index] = cell;
            self.answer.push((x, y, cell));
        }
        // Held no longer than anything moves there, nor told while it does.
        let mut given_up = Vec::new();
        for (index, until) in &mut self.held {
            if is_under(*index, now) {
                *until = now + TRAIL;
            } else if now > *until {
                given_up.push(*index);
            }
        }
        for index in given_up {
            self.held.remove(&index);
            let cell = belief.cells[index];
            if self.told[index] != cell {
                self.told[index] = cell;
                self.answer.push((index % width, index / width, cell));
            }
        }
        // What was told before anybody knew that it moves.
        let mut taken_back = Vec::new();
        self.news.retain(|index, time| {
            if now - *time > TAKEN_BACK {
                return false;
            }
            let is_trail = is_under(*index, now) || is_under(*index, *time);
            if is_trail {
                taken_back.push(*index);
            }
            !is_trail
        });
        for index in taken_back {
            self.told[index] = Cell::Free;
            self.held.insert(index, now + TRAIL);
            self.answer.push((index % width, index / width, Cell::Free));
        }
        &self.answer
    }

    /// Notes which tracks move.
    fn watch(&mut self, tracks: &[&Track], now: f64) {
        let (least, rest_after) = (self.least_speed, self.rest_after);
        self.moving = tracks
            .iter()
            .filter_map(|track| {
                let before = self.moving.iter().find(|moving| moving.id == track.id());
                let is_fast = track.velocity().norm() > least;
                let last = if is_fast { now } else { before?.last };
                (now - last <= rest_after).then_some(Moving {
                    id: track.id(),
                    last,
                })
            })
            .collect();
    }
}
