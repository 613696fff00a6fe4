//! Rides among things that move, drawn from a seed, and judged by the truth alone.
//!
//! *Left room*: whenever something shows itself, or changes its velocity while the bike can see it, it is assumed to go straight on from there, and
//! the bike to ride on as fast as it may along its path. If they would meet, and the stretch on which the bike would be in its way begins nearer than the
//! bike can stop, it has left no room, and whatever follows counts for nothing. What this judge knows it has from the recorded path, the true state, and the obstacles' true ways: nothing of
//! what the bike believes.

use bikebot_dynamics::laser::{Prisms, Ray, RayScene};
use bikebot_geometry::{Point2, Pose2, Vector2, angle};
use nalgebra::{Point3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::clock::SimTime;
use crate::record::event::PathSample;
use crate::record::{Event, NoticeKind, RecordError, Recorder};
use crate::{RunControl, RunOutcome, ScenarioFile, Setup, run};

/// Scans it takes until something is known to move, and how fast, and what the bike takes to react, s.
pub const PERCEPTION: f64 = 0.6;
/// Something not seen for so long shows itself anew, s: by then its track is forgotten.
const FORGOTTEN: f64 = 1.0;
/// Spacing of the looks, s, and of the places tried, m or s.
const LOOK: f64 = 0.05;
/// Straight on is assumed for so long, s.
const FORESEEN: f64 = 8.0;
/// Slower than this the bike stands, m/s.
const STANDS: f64 = 0.05;

/// One ride, and what came of it.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Row {
    /// What it was drawn from.
    pub seed: u64,
    /// Balance mode.
    pub mode: &'static str,
    /// How it ended.
    pub outcome: RunOutcome,
    /// Why.
    pub reason: String,
    /// Whether the bike met something that moves.
    pub collided: bool,
    /// Whether what it met had left room.
    pub had_room: bool,
    /// Whether the bike stood when it was met.
    pub stood: bool,
    /// How many obstacles left no room at some time.
    pub without_room: u32,
    /// How often the bike went first, gave way, and could not avoid a meeting by its own account.
    pub passed: u32,
    /// See `passed`.
    pub yielded: u32,
    /// See `passed`.
    pub unavoidable: u32,
    /// s.
    pub time: f64,
    /// Least distance from anything, m.
    pub clearance: Option<f64>,
}

impl Row {
    /// A meeting with something that kept to what was announced and left room.
    #[must_use]
    pub fn is_violation(&self) -> bool {
        self.collided && self.had_room
    }
}

/// The scenario of a seed: a yard nobody has told the bike about, and one to four things that cross, come, overtake, or stop and go. Even
/// seeds ride with a flywheel, odd ones with a balancer.
#[must_use]
pub fn scenario(seed: u64) -> String {
    use std::fmt::Write;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = |low: f64, high: f64| {
        low + (high - low) * (rng.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
    };
    let mode = mode(seed);
    let mut text = format!(
        "format = 1\nname = \"crossing-{seed}\"\n[bike]\nmode = \"{mode}\"\n[map]\nknown = false\nbounds_m = [0, 0, 26, 14]\n"
    );
    // Two things that stand, off the straight way.
    for side in [2.4, 11.6] {
        let (x, y, r) = (
            uniform(5.0, 20.0),
            side + uniform(-0.8, 0.8),
            uniform(0.2, 0.6),
        );
        let _ = write!(
            text,
            "[[map.disc]]\ncenter_m = [{x:.3}, {y:.3}]\nradius_m = {r:.3}\n"
        );
    }
    let count = 1 + uniform(0.0, 4.0) as usize;
    for _ in 0..count {
        let (kind, speed) = (uniform(0.0, 10.0), uniform(0.5, 1.6));
        let shape = if uniform(0.0, 1.0) < 0.7 {
            format!("disc:{:.2}", uniform(0.2, 0.4))
        } else {
            format!("box:{:.2}x{:.2}", uniform(0.5, 1.2), uniform(0.4, 0.7))
        };
        let up = if uniform(0.0, 1.0) < 0.5 { 1.0 } else { -1.0 };
        let (x, slant) = (uniform(8.0, 19.0), uniform(-3.0, 3.0));
        // When the bike would be there, more or less.
        let then = (x - 3.0) / 1.35 + uniform(-3.5, 3.5);
        let appear = (then - 6.2 / speed).max(0.0);
        let (from, to) = (7.0 - 6.2 * up, 7.0 + 6.2 * up);
        let (way, more) = if kind < 5.0 {
            // Crosses.
            (
                vec![[x - slant, from], [x + slant, to]],
                format!("appear_s = {appear:.2}\n"),
            )
        } else if kind < 6.5 {
            // Comes towards the bike beside its way.
            let y = 7.0 + up * uniform(2.0, 3.5);
            (vec![[25.0, y], [1.0, y]], String::new())
        } else if kind < 8.0 {
            // Overtakes.
            let y = 7.0 + up * uniform(1.9, 3.0);
            (
                vec![[1.0, y], [25.0, y + up * uniform(0.0, 0.8)]],
                format!("appear_s = {:.2}\n", uniform(1.0, 6.0)),
            )
        } else {
            // Crosses, and stops beside the way for a while.
            let stop = 7.0 - up * uniform(1.6, 3.0);
            (
                vec![[x, from], [x, stop], [x + 0.5 * slant, to]],
                format!(
                    "appear_s = {:.2}\npause_s = {:.2}\n",
                    (appear - 2.0).max(0.0),
                    uniform(1.0, 4.0)
                ),
            )
        };
        let speed = if (6.5..8.0).contains(&kind) {
            1.4 + 0.6 * speed
        } else {
            speed
        };
        let _ = write!(
            text,
            "[[obstacle]]\nshape = \"{shape}\"\nwaypoints_m = {way:.3?}\nspeed_mps = {speed:.3}\n{more}"
        );
    }
    let _ = write!(
        text,
        "[start]\nx_m = 2\ny_m = 7\nheading_deg = 0\n[goal]\nx_m = 23\ny_m = 7\n[planner]\nscale_m = 0.5\n\
         [laser]\nrange_sigma_m = 0.01\ndropout_probability = 0.005\n\
         [noise]\nroll_sigma_deg = 0.1\nroll_rate_sigma_radps = 0.01\nspeed_sigma_mps = 0.01\nposition_sigma_m = 0.01\n\
         heading_sigma_deg = 0.2\npose_rate_hz = 20.0\n[run]\nduration_s = 90\nseed = {seed}\n"
    );
    text
}

fn mode(seed: u64) -> &'static str {
    if seed.is_multiple_of(2) {
        "flywheel"
    } else {
        "balancer"
    }
}

/// Rides a seed.
///
/// # Errors
///
/// What is wrong with the scenario.
pub fn ride(seed: u64) -> Result<Row, String> {
    let file = ScenarioFile::parse(&scenario(seed), &[]).map_err(|error| error.to_string())?;
    let setup = Setup::resolve(&file, &mut |name| Err(format!("no file {name}")))
        .map_err(|error| error.to_string())?;
    let mut judge = Judge::new(&setup);
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    let report = run(&setup, &mut judge, control).map_err(|error| error.to_string())?;
    let met = judge.met();
    let collided = report.outcome == RunOutcome::Collided && report.reason == "moving_obstacle";
    Ok(Row {
        seed,
        mode: mode(seed),
        outcome: report.outcome,
        reason: report.reason,
        collided,
        had_room: collided && met.is_none_or(|index| judge.left_room[index]),
        stood: judge.speed < STANDS,
        without_room: judge.left_room.iter().filter(|room| !**room).count() as u32,
        passed: judge.notices[0],
        yielded: judge.notices[1],
        unavoidable: judge.notices[2],
        time: judge.time,
        clearance: report.metrics.min_clearance_m,
    })
}

/// Rides many seeds on `jobs` threads, all there are if that is zero.
///
/// # Errors
///
/// The threads could not be started, or a scenario makes no sense.
pub fn ride_all(seeds: std::ops::Range<u64>, jobs: usize) -> Result<Vec<Row>, String> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| error.to_string())?;
    pool.install(|| seeds.into_par_iter().map(ride).collect())
}

/// What many rides come to, a line each.
#[must_use]
pub fn text(rows: &[Row]) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    for row in rows
        .iter()
        .filter(|row| row.outcome != RunOutcome::Arrived || row.unavoidable > 0)
    {
        let _ = writeln!(
            text,
            "seed {} ({}): {} ({}) after {:.1} s{}{}, {} unavoidable by its own account",
            row.seed,
            row.mode,
            row.outcome,
            row.reason,
            row.time,
            match (row.collided, row.had_room) {
                (true, true) => ", THOUGH IT HAD ROOM",
                (true, false) => ", without room",
                (false, _) => "",
            },
            if row.collided && row.stood {
                ", standing"
            } else {
                ""
            },
            row.unavoidable
        );
    }
    for mode in ["flywheel", "balancer"] {
        let of: Vec<&Row> = rows.iter().filter(|row| row.mode == mode).collect();
        let count = |test: &dyn Fn(&Row) -> bool| of.iter().filter(|row| test(row)).count();
        let sum = |value: &dyn Fn(&Row) -> u32| of.iter().map(|row| value(row)).sum::<u32>();
        let mut times: Vec<f64> = of
            .iter()
            .filter(|row| row.outcome == RunOutcome::Arrived)
            .map(|row| row.time)
            .collect();
        times.sort_by(f64::total_cmp);
        let _ = writeln!(
            text,
            "{mode}: {} rides, {} arrived (median {:.1} s), {} met something ({} of these with room), {} fell, {} stopped or ran out of time; went first {} times, gave way {} times, {} unavoidable; {} obstacles left no room",
            of.len(),
            times.len(),
            times.get(times.len() / 2).copied().unwrap_or(f64::NAN),
            count(&|row| row.collided),
            count(&Row::is_violation),
            count(&|row| row.outcome == RunOutcome::Fell),
            count(&|row| matches!(row.outcome, RunOutcome::Stopped | RunOutcome::TimedOut)),
            sum(&|row| row.passed),
            sum(&|row| row.yielded),
            sum(&|row| row.unavoidable),
            sum(&|row| row.without_room),
        );
    }
    text
}

/// Watches a ride from outside.
struct Judge<'s> {
    setup: &'s Setup,
    path: Vec<PathSample>,
    next_look: f64,
    time: f64,
    pose: Pose2,
    speed: f64,
    /// Of each obstacle when it was seen last, s, and its velocity then, m/s.
    seen: Vec<Option<(f64, Vector2)>>,
    left_room: Vec<bool>,
    notices: [u32; 3],
}

impl Recorder for Judge<'_> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        match event {
            Event::FollowedPath(samples) => self.path = samples.to_vec(),
            Event::State(state) => {
                self.time = time.seconds();
                self.pose = Pose2::new(state.x_m, state.y_m, state.heading_rad);
                self.speed = state.speed_mps;
                if self.time >= self.next_look {
                    self.next_look = self.time + LOOK;
                    self.look();
                }
            }
            Event::Notice { kind, .. } => match kind {
                NoticeKind::Pass => self.notices[0] += 1,
                NoticeKind::Yield => self.notices[1] += 1,
                NoticeKind::Unavoidable => self.notices[2] += 1,
                _ => {}
            },
            _ => {}
        }
        Ok(())
    }
}

impl<'s> Judge<'s> {
    fn new(setup: &'s Setup) -> Self {
        let count = setup.traffic.obstacles().len();
        Self {
            setup,
            path: Vec::new(),
            next_look: 0.0,
            time: 0.0,
            pose: setup.start.pose,
            speed: 0.0,
            seen: vec![None; count],
            left_room: vec![true; count],
            notices: [0; 3],
        }
    }

    /// The obstacle that the bike has met.
    fn met(&self) -> Option<usize> {
        let traffic = &self.setup.traffic;
        let nearest = traffic.nearest(&self.setup.footprint, &self.pose, self.time, f64::INFINITY);
        nearest.map(|(index, _)| index)
    }

    fn look(&mut self) {
        for index in 0..self.seen.len() {
            let Some(velocity) = self.velocity(index) else {
                self.seen[index] = None;
                continue;
            };
            if !self.sees(index) {
                continue;
            }
            let is_news = self.seen[index].is_none_or(|(last, before)| {
                self.time - last > FORGOTTEN || (velocity - before).norm() > 0.05
            });
            self.seen[index] = Some((self.time, velocity));
            if is_news && !self.leaves_room(index, velocity) {
                self.left_room[index] = false;
            }
        }
    }

    fn velocity(&self, index: usize) -> Option<Vector2> {
        /// s.
        const SHORT: f64 = 1e-3;
        let way = self.setup.traffic.obstacles()[index].itinerary();
        let (now, then) = (way.pose(self.time)?, way.pose(self.time + SHORT)?);
        Some((then.position - now.position) / SHORT)
    }

    /// Whether a beam to its middle, or to either side of it, comes to it first.
    fn sees(&self, index: usize) -> bool {
        let (setup, time) = (self.setup, self.time);
        let (Some(world), obstacle) = (&setup.world, &setup.traffic.obstacles()[index]) else {
            return false;
        };
        let Some(there) = obstacle.itinerary().pose(time) else {
            return false;
        };
        let laser = &setup.laser;
        let eye = self
            .pose
            .transform(Point2::new(laser.mount_x, laser.mount_y));
        let to = there.position - eye;
        let aside = Vector2::new(-to.y, to.x) * (0.6 * obstacle.reach() / to.norm().max(1e-6));
        [to, to + aside, to - aside].into_iter().any(|to| {
            let bearing = angle::difference(to.y.atan2(to.x), self.pose.heading);
            if bearing.abs() > 0.5 * laser.fov_deg.to_radians() {
                return false;
            }
            let direction = to.normalize();
            let ray = Ray {
                origin: Point3::new(eye.x, eye.y, laser.mount_z),
                direction: Vector3::new(direction.x, direction.y, 0.0),
            };
            let standing = Prisms {
                world,
                height: laser.obstacle_height,
            };
            let scene = (standing, &setup.traffic);
            let range = obstacle.cast(&ray, time, laser.range_max);
            range < laser.range_max && range <= scene.cast(&ray, time, laser.range_max) + 1e-9
        })
    }

    /// Whether the bike could stop before the place where both would meet if they went on.
    fn leaves_room(&self, index: usize, velocity: Vector2) -> bool {
        let obstacle = &self.setup.traffic.obstacles()[index];
        let follow = &self.setup.follow;
        let Some(here) = self
            .path
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| {
                let off =
                    |p: &PathSample| (p.x - self.pose.position.x).hypot(p.y - self.pose.position.y);
                off(a).total_cmp(&off(b))
            })
            .map(|(i, _)| i)
        else {
            return true;
        };
        let stopping = self.speed * (PERCEPTION + 0.1)
            + self.speed * self.speed / (2.0 * follow.braking_deceleration)
            + 0.05;
        let meets = |at: usize, lead: f64| {
            let (place, shift) = (&self.path[at], velocity * lead);
            let pose = Pose2::new(place.x - shift.x, place.y - shift.y, place.heading);
            obstacle.clearance(&self.setup.footprint, &pose, self.time) < 0.0
        };
        let leads = || (0..(FORESEEN / LOOK) as u32).map(|k| f64::from(k) * LOOK);
        // Do they meet if both go on?
        let (mut way, mut speed, mut at) = (0.0, self.speed.max(0.0), here);
        let goes_wrong = leads().any(|lead| {
            let meets = meets(at, lead);
            way += speed * LOOK;
            speed = (speed + follow.longitudinal_acceleration * LOOK).min(follow.max_speed);
            while at + 1 < self.path.len() && self.path[at].s - self.path[here].s < way {
                at += 1;
            }
            meets
        });
        // Where begins the stretch on which the bike would be in the way?
        let mut near = (here..self.path.len())
            .take_while(|at| self.path[*at].s - self.path[here].s <= stopping);
        !(goes_wrong && near.any(|at| leads().any(|lead| meets(at, lead))))
    }
}
