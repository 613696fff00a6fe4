//! Pass, slow down, yield, or brake as hard as can be.
//!
//! After every scan the bike's way on is held against where everything that moves may be meanwhile. Of these the first that meets nothing
//! is ridden:
//!
//! 1. on as it is;
//! 2. slower, behind what crosses;
//! 3. to rest before the place, and there until it is free.
//!
//! Each is looked at as a band of times: by the time the bike may come to a place at the earliest the others have left it, or by the time it
//! has left it at the latest they are not there yet. A way to rest is taken only to where the bike can wait. So from one scan to
//! the next there is a way to rest, or the bike goes first with time to spare; only who was not foreseen takes both. Then it counts
//! where things are believed to be, without what may be wrong with it, and if that leaves nothing either, the bike brakes as hard as it can and says so.

use bikebot_control::BrakingLimits;
use bikebot_geometry::CurvePath;
use bikebot_mapping::Track;
use bikebot_world::Footprint;

use super::corridor::{Corridor, PIECE, Window};
use super::mover::{Doubt, Mover};
use super::params::GivingWayParams;
use super::schedule::Pace;

/// The path is looked at so far ahead, m: more than is ridden while anything is foreseen matters to nobody.
const FARTHEST: f64 = 20.0;
/// Slower than this the bike stands, m/s.
const STANDSTILL: f64 = 0.05;
/// A bike that stands needs so long to set off, s.
const SETTING_OFF: f64 = 1.0;
/// How much faster and slower than its profile the bike may be, and how much harder it may accelerate.
const FASTER: f64 = 1.05;
const SLOWER: f64 = 0.9;
const HARDER: f64 = 1.3;
/// It may stand so much before the place it shall stand at, m.
const SHORT: f64 = 0.3;
/// Shares of the greatest speed to slow down to, and the least speed that is worth it, m/s.
const SHARES: [f64; 3] = [0.7, 0.5, 0.35];
const LEAST_CAP: f64 = 0.45;
/// Nothing that is farther off in time than this is slowed down for, s: a stop line does not bite sooner either.
const SOON: f64 = 4.0;
/// Places to stand at are tried so far apart, m; and one farther on by so much is worth going to.
const APART: f64 = 0.2;
const FARTHER: f64 = 0.5;
/// The place stays when noise has it nearer than the bike can stop by so much, m.
const SLACK: f64 = 0.15;
/// Who was given way to is passed only with so much more time to spare, s; who is being passed needs this share of it.
const MORE: f64 = 0.7;
const MORE_AFTER: f64 = 0.2;
const LESS: f64 = 0.35;
/// Beyond the time it takes to stop, s, the bike needs not doubt what it foresees: it looks again.
const LOOKS_AGAIN: f64 = 0.5;
/// A slow bike stops soon, but takes as long as this at the least to get out of the way, s.
const LEAST_DOUBT: f64 = 2.0;
/// Who comes so much later than the bike has left, s, is not said to be passed.
const MUCH_LATER: f64 = 3.0;
/// Who would come to the bike so much later than that stands, s, has time to see it.
const IMMINENT: f64 = 1.0;
/// Who comes into the way farther on than that behind the first one, m, is not said to be waited for.
const BESIDE: f64 = 1.0;
/// A stop bites when it is nearer than the stopping distance by this factor, and this, m.
const BITES: (f64, f64) = (1.15, 0.2);

/// What the bike does about something that moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Course {
    /// They do not meet.
    Clear,
    /// The bike goes first.
    Pass,
    /// The bike slows down and goes behind it.
    SlowDown,
    /// The bike waits.
    Yield,
    /// It came too near for all that: the bike brakes as hard as it can.
    Unavoidable,
}

/// The bike and its way.
pub(crate) struct Ride<'a> {
    /// s.
    pub time: f64,
    /// Arc length of the rear contact on the path, m.
    pub s: f64,
    /// m/s.
    pub speed: f64,
    /// What is ridden.
    pub path: &'a CurvePath,
    /// Greatest speed at an arc length, m/s.
    pub profile: &'a dyn Fn(f64) -> f64,
    /// How hard the bike brakes.
    pub braking: BrakingLimits,
    /// How hard it accelerates, m/s².
    pub up: f64,
    /// Where it has to stand for other reasons, m.
    pub stop: Option<f64>,
}

/// A change of mind about something that moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Decision {
    /// Of the track.
    pub id: u64,
    /// What is done from now on.
    pub course: Course,
    /// Time until it may be where the bike is or goes, s.
    pub contact: f64,
    /// Way to the place, m.
    pub way: f64,
    /// Least way to stop, m.
    pub stopping_distance: f64,
}

/// What is to be done about all that moves.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Counsel {
    /// Where to be at rest at the latest, m.
    pub stop_at: Option<f64>,
    /// Greatest speed, m/s.
    pub speed_cap: Option<f64>,
    /// What has changed.
    pub turns: Vec<Decision>,
}

/// Something that moves, with all that is announced to be possible, and as it is believed.
#[derive(Debug, Clone, Copy)]
struct Sighted {
    announced: Mover,
    believed: Mover,
}

/// Something that moves, with what was decided about it.
struct Met {
    mover: Mover,
    windows: Vec<Option<Window>>,
    /// Least time between the bike and it, it second and it first, s.
    before: f64,
    after: f64,
}

/// A way on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    On,
    Slower(f64),
    Stop { at: f64, is_hard: bool },
}

/// Decides, and stays with it.
#[derive(Debug, Clone)]
pub(crate) struct GivingWay {
    params: GivingWayParams,
    outline: Footprint,
    allowance: f64,
    courses: Vec<(u64, Course)>,
    /// What was said last of each.
    told: Vec<(u64, Course)>,
    stop: Option<f64>,
    cap: Option<f64>,
}

impl GivingWay {
    /// For a bike of this outline that is up to `allowance` (m) beside its path.
    pub fn new(params: &GivingWayParams, outline: &Footprint, allowance: f64) -> Self {
        Self {
            params: params.clone(),
            outline: outline.clone(),
            allowance,
            courses: Vec::new(),
            told: Vec::new(),
            stop: None,
            cap: None,
        }
    }

    /// Whether the bike waits for someone.
    pub fn waits(&self) -> bool {
        self.stop.is_some()
    }

    /// What to do about `tracks`.
    pub fn decide<'t>(
        &mut self,
        tracks: impl Iterator<Item = &'t Track>,
        ride: &Ride<'_>,
    ) -> Counsel {
        let lasts = ride
            .braking
            .service_from(ride.speed)
            .duration()
            .max(LEAST_DOUBT)
            + LOOKS_AGAIN;
        let doubts = (
            Doubt::announced(&self.params, lasts),
            Doubt::least(&self.params),
        );
        let sighted: Vec<Sighted> = tracks
            .map(|track| Sighted {
                announced: Mover::of(track, ride.time, &doubts.0),
                believed: Mover::of(track, ride.time, &doubts.1),
            })
            .collect();
        self.weigh(&sighted, ride)
    }

    fn weigh(&mut self, sighted: &[Sighted], ride: &Ride<'_>) -> Counsel {
        if sighted.is_empty() {
            self.courses.clear();
            self.told.clear();
            (self.stop, self.cap) = (None, None);
            return Counsel::default();
        }
        self.told
            .retain(|(id, _)| sighted.iter().any(|sighted| sighted.announced.id == *id));
        let scene = Scene::new(self, ride);
        let met: Vec<Met> = sighted
            .iter()
            .map(|sighted| self.meet(&scene, sighted.announced))
            .collect();
        let bothers: Vec<bool> = {
            let on = scene.band(Way::On);
            met.iter().map(|met| on.meets(met).is_some()).collect()
        };
        if !bothers.contains(&true) {
            (self.stop, self.cap) = (None, None);
            return self.settle(&scene, &met, &bothers, Way::On, false);
        }
        let first = scene.band(Way::On).first_conflict(&met);
        if let Some(way) = self.choose(&scene, &met, first) {
            return self.settle(&scene, &met, &bothers, way, false);
        }
        let believed: Vec<Met> = sighted
            .iter()
            .map(|sighted| Met {
                windows: scene
                    .corridor
                    .windows(&sighted.believed, self.params.horizon),
                mover: sighted.believed,
                before: 0.0,
                after: 0.0,
            })
            .collect();
        let passes = sighted.iter().zip(&bothers).any(|(sighted, bothers)| {
            *bothers && self.course(sighted.announced.id) == Course::Pass
        });
        let stops = [false, true].map(|is_hard| Way::Stop {
            at: ride.s + scene.stopping_distance(is_hard),
            is_hard,
        });
        // Inside a place where it would be in the way the bike does not stop.
        let is_inside = ride.speed > STANDSTILL
            && believed
                .iter()
                .any(|met| met.windows.first().is_some_and(Option::is_some));
        let ways = if passes || is_inside {
            [Way::On, stops[0], stops[1]]
        } else {
            [stops[0], stops[1], Way::On]
        };
        // Who has begun to brake as hard as he can does not change his mind.
        let brakes = self
            .courses
            .iter()
            .any(|(_, course)| *course == Course::Unavoidable);
        let free = ways
            .into_iter()
            .filter(|way| !(brakes && *way == Way::On))
            .find(|way| scene.band(*way).first_conflict(&believed).is_none());
        match free {
            Some(way) => self.settle(&scene, &met, &bothers, way, false),
            None => {
                let soon = ride.braking.emergency_from(ride.speed).duration() + IMMINENT;
                let band = scene.band(stops[1]);
                let hits: Vec<bool> = believed
                    .iter()
                    .map(|met| band.meets(met).is_some_and(|(_, time)| time < soon))
                    .collect();
                let hard = Way::Stop {
                    at: ride.s,
                    is_hard: true,
                };
                if hits.contains(&true) {
                    self.settle(&scene, &believed, &hits, hard, true)
                } else {
                    self.settle(&scene, &met, &bothers, hard, false)
                }
            }
        }
    }

    fn course(&self, id: u64) -> Course {
        self.courses
            .iter()
            .find(|(other, _)| *other == id)
            .map_or(Course::Clear, |(_, course)| *course)
    }

    fn meet(&self, scene: &Scene<'_>, mover: Mover) -> Met {
        let (before, after) = match self.course(mover.id) {
            Course::Clear => (self.params.before, self.params.after),
            Course::Pass => (LESS * self.params.before, self.params.after),
            Course::SlowDown | Course::Yield | Course::Unavoidable => {
                (self.params.before + MORE, self.params.after + MORE_AFTER)
            }
        };
        Met {
            windows: scene.corridor.windows(&mover, self.params.horizon),
            mover,
            before,
            after,
        }
    }

    /// Slower, or to a place to wait at.
    fn choose(&self, scene: &Scene<'_>, met: &[Met], first: Option<(usize, f64)>) -> Option<Way> {
        let (piece, time) = first?;
        let is_free = |way: &Way| scene.band(*way).first_conflict(met).is_none();
        if time <= SOON && scene.ride.speed > LEAST_CAP {
            let caps = SHARES.map(|share| share * scene.fastest);
            let slower = self
                .cap
                .into_iter()
                .chain(caps)
                .filter(|cap| *cap >= LEAST_CAP)
                .map(Way::Slower)
                .find(is_free);
            if slower.is_some() {
                return slower;
            }
        }
        let ride = scene.ride;
        let (service, least) = (
            ride.s + scene.stopping_distance(false),
            ride.s + scene.stopping_distance(true),
        );
        let to = |at: f64| Way::Stop {
            at,
            is_hard: at < service,
        };
        let farthest = ride.s + piece as f64 * PIECE - self.params.stop_margin;
        let kept = self
            .stop
            .filter(|at| *at >= least - SLACK && farthest < at + FARTHER)
            .map(to)
            .filter(is_free);
        if kept.is_some() {
            return kept;
        }
        let count = ((farthest - least) / APART).floor();
        // Casts saturate: none if the least way is too long.
        (0..(count + 1.0).max(0.0) as usize)
            .map(|k| to(farthest - k as f64 * APART))
            .find(is_free)
    }

    /// Takes a way, and says what is new about it.
    fn settle(
        &mut self,
        scene: &Scene<'_>,
        met: &[Met],
        bothers: &[bool],
        way: Way,
        is_unavoidable: bool,
    ) -> Counsel {
        let ride = scene.ride;
        (self.stop, self.cap) = match way {
            Way::On => (None, None),
            Way::Slower(cap) => (None, Some(cap)),
            Way::Stop { at, .. } => (Some(at), None),
        };
        let stopping_distance = scene.stopping_distance(false);
        let bites = match way {
            Way::Stop { at, .. } => at - ride.s < BITES.0 * stopping_distance + BITES.1,
            Way::On | Way::Slower(_) => true,
        };
        let on = scene.band(Way::On);
        let nearest = on.first_conflict(met).map_or(0, |(piece, _)| piece);
        let is_near = |met: &Met| {
            on.meets(met)
                .is_some_and(|(piece, _)| (piece - nearest) as f64 * PIECE <= BESIDE)
        };
        let mut courses = Vec::with_capacity(met.len());
        let mut turns = Vec::new();
        for (met, bothers) in met.iter().zip(bothers) {
            let before = self.course(met.mover.id);
            let passed = on.passes(met);
            let course = match (bothers, way) {
                (true, _) if is_unavoidable => Course::Unavoidable,
                (true, Way::Slower(_)) => Course::SlowDown,
                (true, Way::Stop { .. }) if bites && is_near(met) => Course::Yield,
                // A line far ahead changes nothing yet.
                (true, Way::Stop { .. }) => match before {
                    Course::Pass => Course::Clear,
                    other => other,
                },
                (true, Way::On) => Course::Pass,
                // It counts once the bike could not stop before the place any more.
                (false, Way::On)
                    if passed.is_some_and(|piece| {
                        before == Course::Pass
                            || piece as f64 * PIECE - self.params.stop_margin < stopping_distance
                    }) =>
                {
                    Course::Pass
                }
                (false, _) => Course::Clear,
            };
            courses.push((met.mover.id, course));
            let said = self.told.iter().position(|(id, _)| *id == met.mover.id);
            let is_new = said.is_none_or(|said| !is_same(self.told[said].1, course));
            if is_new && course != Course::Clear {
                match said {
                    Some(said) => self.told[said].1 = course,
                    None => self.told.push((met.mover.id, course)),
                }
                let conflict = on.meets(met).or_else(|| {
                    let piece = passed?;
                    Some((piece, met.windows[piece]?.first))
                });
                let (piece, contact) = conflict.unwrap_or((0, f64::NAN));
                turns.push(Decision {
                    id: met.mover.id,
                    course,
                    contact,
                    way: piece as f64 * PIECE,
                    stopping_distance: if is_unavoidable {
                        scene.stopping_distance(true)
                    } else {
                        stopping_distance
                    },
                });
            }
        }
        self.courses = courses;
        Counsel {
            stop_at: self.stop,
            speed_cap: self.cap,
            turns,
        }
    }
}

/// Slower or to rest, it is giving way.
fn is_same(a: Course, b: Course) -> bool {
    let plain = |course| match course {
        Course::SlowDown => Course::Yield,
        other => other,
    };
    plain(a) == plain(b)
}

/// The way ahead of the bike.
struct Scene<'r> {
    ride: &'r Ride<'r>,
    corridor: Corridor,
    profile: Vec<f64>,
    /// Greatest speed on the way, m/s.
    fastest: f64,
}

/// Times between which the bike is on each piece: from the earliest to the latest, s.
struct Band {
    earliest: Vec<f64>,
    latest: Vec<f64>,
    /// Pieces on which the bike may wait.
    waits: std::ops::Range<usize>,
}

impl<'r> Scene<'r> {
    fn new(giving_way: &GivingWay, ride: &'r Ride<'r>) -> Self {
        let speeds = (ride.profile)(ride.s).max(ride.speed).max(1.0);
        let reach = (FASTER * speeds * giving_way.params.horizon).min(FARTHEST);
        let corridor = Corridor::new(
            ride.path,
            ride.s,
            ride.s + reach,
            &giving_way.outline,
            giving_way.allowance,
        );
        let profile: Vec<f64> = (0..=corridor.len())
            .map(|k| (ride.profile)(ride.s + k as f64 * PIECE))
            .collect();
        Self {
            ride,
            fastest: profile.iter().copied().fold(0.0, f64::max),
            corridor,
            profile,
        }
    }

    fn stopping_distance(&self, is_hard: bool) -> f64 {
        let braking = self.ride.braking;
        let speed = self.ride.speed;
        if is_hard {
            braking.emergency_from(speed).distance()
        } else {
            braking.service_from(speed).distance()
        }
    }

    fn band(&self, way: Way) -> Band {
        let ride = self.ride;
        let end = ride.path.length();
        let (cap, stop, is_hard) = match way {
            Way::On => (f64::INFINITY, end, false),
            Way::Slower(cap) => (cap, end, false),
            Way::Stop { at, is_hard } => (f64::INFINITY, at.min(end), is_hard),
        };
        let braking = if is_hard {
            ride.braking.emergency_from(ride.speed).deceleration
        } else {
            ride.braking.service
        };
        let fast = Pace {
            s: ride.s,
            speed: ride.speed,
            profile: &self.profile,
            share: FASTER,
            cap,
            stop,
            up: HARDER * ride.up,
            braking,
            hardest: braking,
            delay: 0.0,
        };
        let slow = Pace {
            speed: SLOWER * ride.speed,
            share: SLOWER,
            stop: stop.min(ride.stop.unwrap_or(f64::INFINITY)),
            up: ride.up,
            hardest: ride.braking.emergency.max(braking),
            delay: if ride.speed < STANDSTILL {
                SETTING_OFF
            } else {
                0.0
            },
            ..fast
        };
        let count = self.corridor.len();
        let waits = match way {
            Way::Stop { .. } => {
                // Casts saturate at the piece where the bike is.
                let first = ((stop - SHORT - ride.s) / PIECE) as usize;
                let last = ((stop - ride.s) / PIECE) as usize;
                first.min(count)..(last + 1).min(count)
            }
            // At the end of the path as well.
            Way::On | Way::Slower(_) => count..count,
        };
        Band {
            earliest: fast.arrivals(),
            latest: slow.arrivals(),
            waits,
        }
    }
}

impl Band {
    /// The first piece on which the bike may meet it, and when, s.
    fn meets(&self, met: &Met) -> Option<(usize, f64)> {
        met.windows.iter().enumerate().find_map(|(piece, window)| {
            let window = (*window)?;
            let (enters, leaves) = self.on(piece);
            let is_behind = enters - met.after > window.last;
            let is_before = leaves + met.before < window.first;
            (!(is_behind || is_before)).then_some((piece, enters.max(window.first)))
        })
    }

    fn on(&self, piece: usize) -> (f64, f64) {
        let leaves = if self.waits.contains(&piece) {
            f64::INFINITY
        } else {
            self.latest[piece + 1]
        };
        (self.earliest[piece], leaves)
    }

    /// Of all the first in space.
    fn first_conflict(&self, met: &[Met]) -> Option<(usize, f64)> {
        met.iter()
            .filter_map(|met| self.meets(met))
            .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
    }

    /// The first piece that the bike leaves not long before it comes there.
    fn passes(&self, met: &Met) -> Option<usize> {
        met.windows.iter().enumerate().position(|(piece, window)| {
            let leaves = self.on(piece).1;
            window.is_some_and(|window| leaves < window.first && window.first < leaves + MUCH_LATER)
        })
    }
}

#[cfg(test)]
mod tests;
