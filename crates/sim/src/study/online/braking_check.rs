//! Whether a ride could have been stopped safely at each tick, judged by code that shares nothing with the navigator.

use bikebot_geometry::{Point2, Pose2};
use bikebot_planner::EndPose;
use bikebot_world::{Cell, Footprint, OccupancyGrid};

use crate::clock::SimTime;
use crate::record::{Event, NoticeKind, RecordError, Recorder};
use crate::setup::Setup;

/// The braking that is checked: reaction, s, deceleration, m/s², and what is kept before the line, m.
const REACTION: f64 = 0.1;
const DECELERATION: f64 = 0.5;
const KEPT: f64 = 0.05;
/// Spacing of the places and of the points of the outline at which the check looks, m.
const SPACING: f64 = 0.1;
/// A surprise stands this far beyond the braking distance, m, and is so large, m.
const BEYOND: f64 = 1.0;
pub(super) const BLOCK: f64 = 0.8;

/// A block that comes to stand on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surprise {
    /// When, s.
    pub(super) time: f64,
    /// Its middle, m.
    pub(super) place: Point2,
    /// How the bike is met by it.
    pub(super) from: EndPose,
    /// Way ridden until then, m.
    pub(super) ridden: f64,
}

/// Watches a ride, and whether it could have been stopped safely at each tick.
pub struct BrakingCheck<'s> {
    setup: &'s Setup,
    path: Vec<Pose2>,
    /// Of the path at the same places, 1/m.
    curvatures: Vec<f64>,
    belief: Option<OccupancyGrid>,
    /// Index of the bike on the path.
    at: usize,
    distance: f64,
    last: Option<Point2>,
    /// Way after which to say where a surprise would stand, m.
    pub(super) look_out_after: f64,
    /// Where it would stand, and how the bike is met by it.
    pub(super) surprise: Option<Surprise>,
    pub(super) unsafe_ticks: u64,
    pub(super) unproved_ticks: u64,
    pub(super) emergencies: u64,
    /// The block that can be passed on both sides, m.
    pub(super) two_sides_of: Option<Point2>,
    /// Whether the paths in force, one after the other, passed it on the left.
    lefts: Vec<bool>,
}

impl<'s> BrakingCheck<'s> {
    /// Of a ride of this setup.
    #[must_use]
    pub fn new(setup: &'s Setup) -> Self {
        Self {
            setup,
            path: Vec::new(),
            curvatures: Vec::new(),
            belief: None,
            at: 0,
            distance: 0.0,
            last: None,
            look_out_after: f64::INFINITY,
            surprise: None,
            unsafe_ticks: 0,
            unproved_ticks: 0,
            emergencies: 0,
            two_sides_of: None,
            lefts: Vec::new(),
        }
    }

    /// Ticks in which braking would have met a true obstacle, and in which it would have led over what was not believed free.
    #[must_use]
    pub fn violations(&self) -> (u64, u64) {
        (self.unsafe_ticks, self.unproved_ticks)
    }

    /// Times at which the path in force went over to the other side of the block.
    pub(super) fn side_changes(&self) -> u64 {
        let pairs = self.lefts.windows(2);
        pairs.filter(|pair| pair[0] != pair[1]).count() as u64
    }

    fn note_the_side(&mut self) {
        let Some(block) = self.two_sides_of else {
            return;
        };
        let beside = self.path.iter().find(|pose| pose.position.x >= block.x);
        self.lefts
            .extend(beside.map(|pose| pose.position.y > block.y));
    }

    fn look(&mut self, time: f64, pose: &Pose2, speed: f64) {
        if let Some(last) = self.last {
            self.distance += (pose.position - last).norm();
        }
        self.last = Some(pose.position);
        if self.path.is_empty() {
            return;
        }
        let away = |i: usize| (self.path[i].position - pose.position).norm_squared();
        let window = self.at.saturating_sub(20)..(self.at + 40).min(self.path.len());
        self.at = window
            .min_by(|a, b| away(*a).total_cmp(&away(*b)))
            .unwrap_or(self.at);
        let braking = REACTION * speed + speed * speed / (2.0 * DECELERATION) + KEPT;
        if self.surprise.is_none() && self.distance >= self.look_out_after {
            // Where the front would stand after braking, and a metre more.
            let front = 1.46;
            let ahead = braking + front + BEYOND + 0.5 * BLOCK;
            let index = self.at + (ahead / STEP) as usize;
            if index + 60 < self.path.len() {
                self.surprise = Some(Surprise {
                    time,
                    place: self.path[index].position,
                    from: EndPose {
                        position: pose.position,
                        heading: Some(pose.heading),
                        curvature: Some(self.curvatures[self.at]),
                    },
                    ridden: self.distance,
                });
            } else {
                self.look_out_after = f64::INFINITY;
            }
        }
        let last = (self.at + (braking / STEP).ceil() as usize).min(self.path.len() - 1);
        let every = (SPACING / STEP) as usize;
        let places = (self.at..=last).step_by(every).chain([last]);
        let (mut is_safe, mut is_proved) = (true, true);
        for index in places {
            let place = self.path[index];
            is_safe &= self.is_safe(time, &place);
            is_proved = is_proved && self.is_proved(pose, &place);
        }
        self.unsafe_ticks += u64::from(!is_safe);
        self.unproved_ticks += u64::from(!is_proved);
    }

    fn is_safe(&self, time: f64, place: &Pose2) -> bool {
        let (setup, outline) = (self.setup, &self.setup.footprint);
        let stands = setup
            .world
            .as_ref()
            .is_some_and(|world| world.overlaps(outline, place));
        !stands && setup.traffic.clearance(outline, place, time) >= 0.0
    }

    /// Whether the outline at `place` covers only cells believed free, or that it stands on at `now`, or stood on at the start.
    fn is_proved(&self, now: &Pose2, place: &Pose2) -> bool {
        let Some(belief) = &self.belief else {
            return true;
        };
        let zone = self
            .setup
            .online
            .as_ref()
            .map_or(0.0, |online| online.params.start_zone);
        let covers = |pose: &Pose2, p: Point2, by: f64| {
            let local = pose.inverse().transform(p);
            match self.setup.footprint {
                Footprint::Capsule {
                    rear,
                    front,
                    radius,
                } => (local.x - local.x.clamp(rear, front)).hypot(local.y) <= radius + by,
                _ => local.coords.norm() <= self.setup.footprint.reach() + by,
            }
        };
        let reach = self.setup.footprint.reach();
        let steps = (2.0 * reach / SPACING).ceil() as i32;
        for i in 0..=steps {
            for j in 0..=steps {
                let local = Point2::new(
                    -reach + SPACING * f64::from(i),
                    -reach + SPACING * f64::from(j),
                );
                let p = place.transform(local);
                if !covers(place, p, 0.0)
                    || covers(now, p, 0.15)
                    || covers(&self.setup.start.pose, p, zone)
                {
                    continue;
                }
                let cell = belief.world_to_cell(p).and_then(|(x, y)| belief.cell(x, y));
                if cell != Some(Cell::Free) {
                    return false;
                }
            }
        }
        true
    }
}

/// Spacing of the path in force, m.
const STEP: f64 = 0.05;

impl Recorder for BrakingCheck<'_> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        match event {
            Event::Plan(plan) => {
                // Joints of the curves come in between: spaced evenly again.
                self.path.clear();
                self.curvatures.clear();
                let mut next = 0.0;
                for sample in plan.path {
                    while sample.s >= next - 1e-9 {
                        self.path
                            .push(Pose2::new(sample.x, sample.y, sample.heading));
                        self.curvatures.push(sample.curvature);
                        next += STEP;
                    }
                }
                self.note_the_side();
            }
            Event::Belief(grid) => self.belief = Some((*grid).clone()),
            Event::State(state) => {
                let pose = Pose2::new(state.x_m, state.y_m, state.heading_rad);
                self.look(time.seconds(), &pose, state.speed_mps);
            }
            Event::Notice {
                kind: NoticeKind::Emergency,
                ..
            } => self.emergencies += 1,
            _ => {}
        }
        Ok(())
    }
}
