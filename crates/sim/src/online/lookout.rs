//! Mapper and navigator on a ride: scans and measured poses in, orders out.

use std::collections::VecDeque;

use bikebot_control::BrakingLimits;
use bikebot_dynamics::laser::{Prisms, Ray, RayScene};
use bikebot_dynamics::{LaserScan, LaserScanner, Measurement, SweepingLaser};
use bikebot_geometry::{Pose2, angle};
use bikebot_mapping::{BeliefGrid, Mapper, MappingError, Tracker};
use bikebot_planner::PlanReport;
use bikebot_world::OccupancyGrid;

use super::giving_way::{Counsel, GivingWay, Ride, Withheld};
use super::navigator::{Motion, Navigator, Task};
use super::status::{Halt, Order, Status};
use crate::chance::{Component, stream};
use crate::error::Error;
use crate::setup::{OnlineSetup, Setup};

/// Scans taken at the start before the first plan: what a dropped beam or a doubtful cell leaves open is seen by the next.
const FIRST_SCANS: usize = 10;
/// For how long measured poses are kept beyond one turn of the laser and its latency, s.
const KEPT: f64 = 0.5;
/// Less of the path than this left, m, is none.
const AT_THE_END: f64 = 0.5;

/// What the first look has led to.
#[derive(Debug)]
pub(crate) struct Sighting {
    /// The first plan, where one was tried.
    pub plan: Option<PlanReport>,
    /// Why there is no path.
    pub halt: Option<Halt>,
}

/// Where the bike was, as measured.
#[derive(Debug, Clone, Copy)]
struct Placed {
    time: f64,
    pose: Pose2,
    roll: f64,
}

/// Who looks ahead while the bike rides.
#[derive(Debug)]
pub(crate) struct Lookout {
    mapper: Mapper,
    navigator: Navigator,
    tracker: Tracker,
    withheld: Withheld,
    giving_way: GivingWay,
    counsel: Counsel,
    /// Whether anything new was seen since the last counsel.
    has_seen: bool,
    poses: VecDeque<Placed>,
    kept: f64,
    status: Status,
    gives_up: Option<Halt>,
    /// Way left at the last order, m.
    left: f64,
}

/// How the bike is ridden.
pub(crate) struct Riding<'a> {
    /// Greatest speed of the rear contact at an arc length of the path (m), m/s.
    pub profile: &'a dyn Fn(f64) -> f64,
    /// How hard the bike brakes.
    pub braking: BrakingLimits,
    /// How hard it accelerates, m/s².
    pub acceleration: f64,
}

/// A scene in which time stands still.
struct AtTheStart<S>(S);

impl<S: RayScene> RayScene for AtTheStart<S> {
    fn cast(&self, ray: &Ray, _time: f64, max_range: f64) -> f64 {
        self.0.cast(ray, 0.0, max_range)
    }
}

impl Lookout {
    /// Looks around from the start, with the bike at rest, and makes the first plan.
    ///
    /// # Errors
    ///
    /// Where the field, the laser or the problem make no sense.
    pub fn first_look(setup: &Setup, online: &OnlineSetup) -> Result<(Self, Sighting), Error> {
        let (Some(world), Some(start), Some(goal)) = (&setup.world, setup.start_pose, setup.goal)
        else {
            return Err(Error::NothingToPlan);
        };
        let belief = match world.grid().filter(|_| online.map_is_known) {
            // News are entered in the map's own cells.
            Some(grid) => BeliefGrid::new(grid.width, grid.height, grid.resolution, grid.origin)?,
            None => BeliefGrid::over(world.bounds(), setup.mapper.cell)?,
        };
        let mut mapper = Mapper::new(&setup.mapper, &setup.laser, Some(&setup.footprint), belief)?;
        mapper.declare_free(&setup.footprint, &setup.start.pose);
        let mut laser = SweepingLaser::new(
            LaserScanner::new(&setup.laser)?,
            stream(setup.seed, Component::FirstLook),
        );
        let standing = Prisms {
            world,
            height: setup.laser.obstacle_height,
        };
        let scene = AtTheStart((standing, &setup.traffic));
        let (pose, roll) = (setup.start.pose, setup.start.roll);
        let turn = 1.0 / setup.laser.rate;
        let last = (FIRST_SCANS as f64 + 1.0) * turn + setup.laser.latency;
        let mut tick = 0;
        while setup.control.times(tick).seconds() <= last {
            let time = setup.control.times(tick).seconds();
            if let Some(scan) = laser.advance(&scene, time, &pose, roll) {
                mapper.insert(&scan, |_| (pose, roll))?;
            }
            tick += 1;
        }
        let curvature = setup.start.steer.tan() / setup.bike.wheelbase;
        let mut navigator = Navigator::new(&Task {
            belief: mapper.belief().grid(),
            bounds: world.bounds(),
            known: online.map_is_known.then_some(world),
            start: start.with_curvature(curvature),
            goal,
            bike: setup.footprint.clone(),
            outline: setup.planning_footprint.clone(),
            planner: &setup.planner,
            online: &online.params,
            seed: setup.seed,
        })?;
        let (plan, halt) = navigator.begin()?;
        let moving = &online.params.moving;
        let tracker = setup.mapper.tracker;
        let lookout = Self {
            withheld: Withheld::new(moving, tracker.confirm_speed, mapper.belief().grid()),
            giving_way: GivingWay::new(moving, &setup.footprint, online.params.tracking_allowance),
            tracker: Tracker::new(&tracker),
            counsel: Counsel::default(),
            has_seen: false,
            mapper,
            navigator,
            poses: VecDeque::new(),
            kept: 2.0 * turn + setup.laser.latency + KEPT,
            status: Status::Clear,
            gives_up: None,
            left: f64::INFINITY,
        };
        Ok((lookout, Sighting { plan, halt }))
    }

    /// What is believed now.
    pub fn belief(&self) -> &OccupancyGrid {
        self.mapper.belief().grid()
    }

    /// Who plans.
    pub fn navigator(&mut self) -> &mut Navigator {
        &mut self.navigator
    }

    /// Notes what the sensors say of the bike at `time` (s).
    pub fn note(&mut self, time: f64, measured: &Measurement) {
        while self
            .poses
            .front()
            .is_some_and(|old| old.time < time - self.kept)
        {
            self.poses.pop_front();
        }
        self.poses.push_back(Placed {
            time,
            pose: measured.pose,
            roll: measured.roll,
        });
    }

    /// Takes in a scan.
    ///
    /// # Errors
    ///
    /// If the scan, or a pose that was measured while it was taken, is not finite; it is left out then.
    pub fn hear(&mut self, scan: &LaserScan) -> Result<(), MappingError> {
        let poses = &self.poses;
        self.mapper.insert(scan, |time| at(poses, time))?;
        self.tracker.update(&self.mapper);
        let told = self.withheld.tell(
            self.mapper.changes(),
            self.mapper.belief().grid(),
            self.tracker.tracks(),
            scan.middle(),
        );
        self.navigator.observe(told);
        self.has_seen = true;
        Ok(())
    }

    /// What to do now, and what the bike did before; for what moves see [`Self::counsel`].
    pub fn order(&mut self, motion: &Motion, riding: &Riding<'_>) -> (Order, Status) {
        let before = self.status;
        let mut order = self.navigator.tick(motion);
        self.give_way(motion, riding, &order);
        if let Some(stop) = self.counsel.stop_at {
            order.stop_at = Some(order.stop_at.map_or(stop, |other| other.min(stop)));
        }
        self.status = order.status;
        self.gives_up = order.gives_up;
        let length = self.navigator.path().map_or(0.0, |path| path.length());
        self.left = length - motion.s;
        (order, before)
    }

    /// What is to be done about all that moves. Its place to stand is in the order already.
    pub fn counsel(&self) -> &Counsel {
        &self.counsel
    }

    fn give_way(&mut self, motion: &Motion, riding: &Riding<'_>, order: &Order) {
        self.counsel.turns.clear();
        let is_due = std::mem::take(&mut self.has_seen) || order.path.is_some();
        let Some(path) = self.navigator.path().filter(|_| is_due) else {
            return;
        };
        let ride = Ride {
            time: motion.time,
            s: motion.s,
            speed: motion.speed,
            path,
            profile: riding.profile,
            braking: riding.braking,
            up: riding.acceleration,
            stop: order.stop_at,
        };
        self.counsel = self.giving_way.decide(self.tracker.tracks(), &ride);
    }

    /// Why the bike stays where it is for good.
    pub fn gives_up(&self) -> Option<Halt> {
        self.gives_up
    }

    /// Whether a bike at rest is only waiting.
    pub fn waits(&self) -> bool {
        self.status != Status::Clear || self.left > AT_THE_END || self.giving_way.waits()
    }
}

/// Pose and roll at `time` (s), by straight lines between what was measured.
fn at(poses: &VecDeque<Placed>, time: f64) -> (Pose2, f64) {
    let after = poses.partition_point(|placed| placed.time < time);
    let (Some(a), Some(b)) = (
        poses.get(after.saturating_sub(1)),
        poses.get(after).or(poses.back()),
    ) else {
        return (Pose2::new(f64::NAN, f64::NAN, f64::NAN), f64::NAN);
    };
    let span = b.time - a.time;
    let share = if span > 0.0 {
        ((time - a.time) / span).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let position = a.pose.position + share * (b.pose.position - a.pose.position);
    let heading = angle::interpolate(a.pose.heading, b.pose.heading, share);
    (
        Pose2::new(position.x, position.y, heading),
        a.roll + share * (b.roll - a.roll),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_between_two_measurements_lie_on_the_line_between_them() {
        let placed = |time, x, heading, roll| Placed {
            time,
            pose: Pose2::new(x, 0.0, heading),
            roll,
        };
        // The heading goes the short way round.
        let poses = VecDeque::from([placed(1.0, 2.0, 3.0, 0.1), placed(2.0, 4.0, -3.0, 0.3)]);
        let (pose, roll) = at(&poses, 1.5);
        assert!((pose.position.x - 3.0).abs() < 1e-12 && (roll - 0.2).abs() < 1e-12);
        assert!((pose.heading.abs() - std::f64::consts::PI).abs() < 1e-9);
        assert_eq!(at(&poses, 0.0).1, 0.1);
        assert_eq!(at(&poses, 9.0).1, 0.3);
        assert!(at(&VecDeque::new(), 0.0).1.is_nan());
    }
}
