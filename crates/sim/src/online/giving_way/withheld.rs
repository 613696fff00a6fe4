//! Cells that something moving covers are no walls.
//!
//! A thing that crosses leaves a trail in the belief: the mapper needs a few scans to see that a cell is free again. If the navigator
//! heard of all that, it would plan around a place that is free when the bike comes there, and again a scan later around another. So
//! what is said of cells under something that moves, and of those it has just left, is withheld, if the navigator has them as free: who
//! moves is given way to instead. It is told after all when nothing moves there any more and the cell is still not free, as
//! when the thing has come to rest.

use std::collections::BTreeMap;

use bikebot_geometry::{Point2, Vector2};
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

/// Where something is that may move.
#[derive(Debug, Clone, Copy)]
struct Sight {
    id: u64,
    /// When it was seen, s.
    time: f64,
    position: Point2,
    velocity: Vector2,
    radius: f64,
}

impl Sight {
    fn of(track: &Track) -> Self {
        Self {
            id: track.id(),
            time: track.time(),
            position: track.position(),
            velocity: track.velocity(),
            radius: track.radius(),
        }
    }

    fn is_over(&self, p: Point2, time: f64) -> bool {
        let centre = self.position + self.velocity * (time - self.time);
        (centre - p).norm() <= self.radius + BESIDE
    }
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
        let tracks: Vec<Sight> = tracks.map(Sight::of).collect();
        self.tell_among(changes, belief, &tracks, now)
    }

    fn tell_among(
        &mut self,
        changes: &[Change],
        belief: &OccupancyGrid,
        tracks: &[Sight],
        now: f64,
    ) -> &[Change] {
        self.answer.clear();
        self.watch(tracks, now);
        let moving: Vec<&Sight> = tracks
            .iter()
            .filter(|track| self.moving.iter().any(|moving| moving.id == track.id))
            .collect();
        let width = belief.width;
        let is_under = |cell: usize, time: f64| {
            let centre = belief.cell_centre(cell % width, cell / width);
            moving.iter().any(|track| track.is_over(centre, time))
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
    fn watch(&mut self, tracks: &[Sight], now: f64) {
        let (least, rest_after) = (self.least_speed, self.rest_after);
        self.moving = tracks
            .iter()
            .filter_map(|track| {
                let before = self.moving.iter().find(|moving| moving.id == track.id);
                let is_fast = track.velocity.norm() > least;
                let last = if is_fast { now } else { before?.last };
                (now - last <= rest_after).then_some(Moving { id: track.id, last })
            })
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Pose2;

    const LEAST: f64 = 0.25;

    /// A free field with unknown cells in its last column.
    fn field() -> OccupancyGrid {
        let mut grid =
            OccupancyGrid::filled(40, 20, 0.1, Pose2::new(0.0, 0.0, 0.0), Cell::Free).unwrap();
        for y in 0..20 {
            grid.set(39, y, Cell::Unknown);
        }
        grid
    }

    fn withheld(grid: &OccupancyGrid) -> Withheld {
        Withheld::new(&GivingWayParams::default(), LEAST, grid)
    }

    fn at(x: f64, vx: f64, time: f64) -> Sight {
        Sight {
            id: 7,
            time,
            position: Point2::new(x, 1.0),
            velocity: Vector2::new(vx, 0.0),
            radius: 0.2,
        }
    }

    /// Writes a change into the belief and says it.
    fn told(
        withheld: &mut Withheld,
        grid: &mut OccupancyGrid,
        changes: &[Change],
        tracks: &[Sight],
        now: f64,
    ) -> Vec<Change> {
        for &(x, y, cell) in changes {
            grid.set(x, y, cell);
        }
        withheld.tell_among(changes, grid, tracks, now).to_vec()
    }

    #[test]
    fn what_lies_under_a_mover_is_withheld_and_all_else_is_told() {
        let mut grid = field();
        let mut withheld = withheld(&grid);
        let under = (10, 10, Cell::Occupied);
        let (away, unknown) = ((25, 10, Cell::Occupied), (39, 10, Cell::Occupied));
        let mover = at(1.05, 1.0, 0.0);
        let changes = [under, away, unknown];
        let answer = told(&mut withheld, &mut grid, &changes, &[mover], 0.0);
        assert_eq!(answer, [away, unknown]);
        // What was never free is told even under a mover: it hides nothing that could be ridden over.
        let over_the_unknown = at(3.9, 1.0, 0.1);
        let freed = (39, 11, Cell::Occupied);
        let answer = told(&mut withheld, &mut grid, &[freed], &[over_the_unknown], 0.1);
        assert_eq!(answer, [freed]);
    }

    #[test]
    fn a_trail_that_clears_is_never_heard_of() {
        let mut grid = field();
        let mut withheld = withheld(&grid);
        let hit = [(10, 10, Cell::Occupied)];
        assert!(told(&mut withheld, &mut grid, &hit, &[at(1.05, 1.0, 0.0)], 0.0).is_empty());
        // Gone on by more than its radius; the mapper says unknown, then free.
        let doubtful = [(10, 10, Cell::Unknown)];
        let gone = [at(1.85, 1.0, 0.8)];
        assert!(told(&mut withheld, &mut grid, &doubtful, &gone, 0.8).is_empty());
        let free = [(10, 10, Cell::Free)];
        assert!(told(&mut withheld, &mut grid, &free, &gone, 0.9).is_empty());
        for k in 0..40 {
            let now = 1.0 + 0.1 * f64::from(k);
            assert!(told(&mut withheld, &mut grid, &[], &[], now).is_empty());
        }
    }

    #[test]
    fn what_stays_behind_is_told_when_its_time_is_over() {
        let mut grid = field();
        let mut withheld = withheld(&grid);
        let hit = [(10, 10, Cell::Occupied)];
        told(&mut withheld, &mut grid, &hit, &[at(1.05, 1.0, 0.0)], 0.0);
        let mut first = None;
        for k in 1..40 {
            let now = 0.05 * f64::from(k);
            let mover = at(1.05 + now, 1.0, now);
            if !told(&mut withheld, &mut grid, &[], &[mover], now).is_empty() {
                first = Some(now);
                break;
            }
        }
        // It is over the cell until its rim and what hits may lie beside it have passed, 0.55 m on; then a trail's time.
        let first = first.expect("it is told");
        assert!((first - (0.55 + TRAIL)).abs() < 0.11, "{first}");
    }

    #[test]
    fn what_has_come_to_rest_is_told_after_its_time_of_rest() {
        let mut grid = field();
        let mut withheld = withheld(&grid);
        let rest_after = GivingWayParams::default().rest_after;
        let hit = [(10, 10, Cell::Occupied)];
        told(&mut withheld, &mut grid, &hit, &[at(1.05, 1.0, 0.0)], 0.0);
        let mut first = None;
        for k in 1..100 {
            let now = 0.05 * f64::from(k);
            let standing = at(1.05, 0.1, now);
            let answer = told(&mut withheld, &mut grid, &[], &[standing], now);
            if !answer.is_empty() {
                assert_eq!(answer, hit);
                first = Some(now);
                break;
            }
        }
        let first = first.expect("it is told");
        assert!((first - (rest_after + TRAIL)).abs() < 0.11, "{first}");
    }

    #[test]
    fn what_was_told_before_anybody_knew_that_it_moves_is_taken_back() {
        let mut grid = field();
        let mut withheld = withheld(&grid);
        let hit = [(10, 10, Cell::Occupied)];
        assert_eq!(told(&mut withheld, &mut grid, &hit, &[], 0.0), hit);
        let answer = told(&mut withheld, &mut grid, &[], &[at(1.25, 1.0, 0.2)], 0.2);
        assert_eq!(answer, [(10, 10, Cell::Free)]);
        // But not what was told long before.
        let hit = [(20, 10, Cell::Occupied)];
        assert_eq!(told(&mut withheld, &mut grid, &hit, &[], 1.0), hit);
        let late = 1.0 + TAKEN_BACK + 0.1;
        let mover = [at(2.05, 1.0, late)];
        assert!(
            told(&mut withheld, &mut grid, &[], &mover, late)
                .iter()
                .all(|change| (change.0, change.1) != (20, 10))
        );
    }

    #[test]
    fn who_stands_hides_nothing() {
        let mut grid = field();
        let mut withheld = withheld(&grid);
        let hit = [(10, 10, Cell::Occupied)];
        let standing = [at(1.05, 0.9 * LEAST, 0.0)];
        assert_eq!(told(&mut withheld, &mut grid, &hit, &standing, 0.0), hit);
    }
}
