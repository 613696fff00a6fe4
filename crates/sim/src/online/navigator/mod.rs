//! Keep, repair, plan anew, or stop: decided after every scan, and safe in between.
//!
//! Two questions are asked of the [`Sweep`] of the present path, always with what is believed now:
//!
//! * *Where does it first cover a cell not known to be free?* So far the bike may ride: `stop_at` lies a margin before. The speed that
//!   the controller keeps, √(2 a (stop_at − s)), is then limited by what is seen, and there is a braking manoeuvre within known free space
//!   at any time, along the very path that is ridden.
//! * *Where does it first cover a cell known to be occupied?* Then the path is blocked, however far away that is, and a new one is
//!   planned at once, in a world where everything unknown is free.
//!
//! A new path leaves the old one where the bike will be when the plan is done, and not before it is done is it taken over; even then
//! only if nothing has come to block it since, and if the bike can stop on it within what is seen. Else the bike brakes, on
//! the old path, and asks again: slower, it can take over what it could not at speed.

mod begin;
mod search;

use bikebot_geometry::CurvePath;
use bikebot_planner::{EndPose, GoalRegion, PlannerParams};
use bikebot_world::{Bounds, Cell, Footprint, OccupancyGrid, World, WorldError};

use self::search::Aim;
use super::belief::Belief;
use super::params::OnlineParams;
use super::status::{Cause, Halt, NewPath, Order, Searched, Status};
use super::sweep::{Covered, Sweep};

/// Slower than this the bike stands, m/s: a noisy encoder is never still.
const STANDSTILL: f64 = 0.03;
/// Way by which the bike has moved on, m; who does not within so many seconds stands, whatever the encoder says.
const MOVED_ON: f64 = 0.1;
const CREEPING: f64 = 2.0;
/// A stop nearer than this is where the bike stands already, m: for less way the controller does not set off.
const HERE: f64 = 0.65;
/// Unknown cells that are reached at most so much after the first are doubted together with it, m.
const DOUBTED: f64 = 0.5;
/// Searches in vain at one place before the bike goes on to the next.
const IN_VAIN: u32 = 3;
/// A search that has failed while standing is repeated so many periods later, then more: only a change in the map, or another seed, can help. (That
/// what blocks the path goes away is seen without a search.)
const STANDING_PERIODS: [f64; 3] = [5.0, 10.0, 20.0];
/// Beyond what the bike's outline is grown by in the proof of free space, the tighter of the two plans keeps this, m: the steps of the proof;
/// and the search through the narrowest of gaps this, for shorter ones.
const PROOF_STEPS: f64 = 0.01;
const SHORT_PROOF_STEPS: f64 = 0.005;
/// What was only sketched is made anew when it is as near as this part of the horizon.
const CARE: f64 = 0.6;
/// A path with less than this to go is not improved, m.
const NEARLY_THERE: f64 = 2.0;

/// What the navigator is to do.
#[derive(Debug)]
pub struct Task<'a> {
    /// What is believed at the start: frame and cells.
    pub belief: &'a OccupancyGrid,
    /// Beyond these the bike may not go, m.
    pub bounds: Bounds,
    /// The map, where one is given to the planner.
    pub known: Option<&'a World>,
    /// Where the rear contact is, at rest.
    pub start: EndPose,
    /// Where it shall come to rest.
    pub goal: GoalRegion,
    /// The bike's outline.
    pub bike: Footprint,
    /// The outline planned with: the bike's with what the follower may cut a corner by.
    pub outline: Footprint,
    /// How a path is planned.
    pub planner: &'a PlannerParams,
    /// How that is done while riding.
    pub online: &'a OnlineParams,
    /// Seed of the searches.
    pub seed: u64,
}

/// Where the bike is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// s.
    pub time: f64,
    /// Arc length of the rear contact on the present path, m.
    pub s: f64,
    /// m/s.
    pub speed: f64,
    /// Way on which the controller promises to bring the bike to rest from this speed, m.
    pub stopping_distance: f64,
}

/// Plans from what has been seen, and says how far that carries. No clock, no chance but the seed's: equal inputs give equal orders.
#[derive(Debug)]
pub struct Navigator {
    belief: Belief,
    online: OnlineParams,
    planner: PlannerParams,
    goal: GoalRegion,
    start: EndPose,
    bike: Footprint,
    /// Outlines and margins to plan with, the roomier first.
    rooms: [(Footprint, f64); 2],
    /// The outline to get through the narrowest of gaps with.
    narrow: Footprint,
    seed: u64,
    plans: u64,
    /// The search made at this tick.
    searched: Option<Searched>,
    route: Option<Route>,
    pending: Option<Route>,
    /// What the route was before.
    replaced: Option<Route>,
    /// Arc length of the bike on the route, m; never less than before.
    s: f64,
    /// What lies ahead, as of the last change.
    view: Option<View>,
    /// Stop here, whatever the proof allows, m: there is no way on.
    hold: Option<f64>,
    halt: Option<Halt>,
    /// m.
    promised: f64,
    next_search: f64,
    next_improvement: f64,
    searches_in_vain: u32,
    /// What was proved was taken back, and the bike cannot stop a margin before it.
    brakes_hard: bool,
    /// Where the bike has been last when it had moved on, m, and when, s.
    rest: (f64, f64),
    /// Where it was at rest when searches failed, m, and how many had failed there before the last.
    in_vain_here: (f64, usize),
}

/// A path with what it covers.
#[derive(Debug)]
struct Route {
    curves: CurvePath,
    sweep: Sweep,
    joint: f64,
    cause: Cause,
    iterations: u64,
    /// It leaves less room than it should.
    is_tight: bool,
    /// So far it was made with care, m; beyond it is a sketch.
    careful_until: f64,
    /// When it may be taken over, s.
    ready: f64,
}

/// The first places ahead that are not free, and that are solid.
#[derive(Debug, Clone, Copy)]
struct View {
    unproved: Option<Covered>,
    solid: Option<Covered>,
}

impl Navigator {
    /// A navigator that knows what `task` says. It has no path yet: see [`Navigator::begin`].
    ///
    /// # Errors
    ///
    /// If the grid or the bounds make no sense.
    pub fn new(task: &Task<'_>) -> Result<Self, WorldError> {
        let mut belief = Belief::new(task.belief, task.bounds, task.known)?;
        begin::vouch_for_the_start(&mut belief, task);
        let allowance = task.online.tracking_allowance;
        let tight = task.bike.grown(allowance + PROOF_STEPS);
        let roomy = if task.outline.reach() > tight.reach() {
            task.outline.clone()
        } else {
            tight.clone()
        };
        let margin = task.planner.margin;
        Ok(Self {
            belief,
            online: task.online.clone(),
            planner: PlannerParams {
                starts: task.online.starts,
                ..task.planner.clone()
            },
            goal: task.goal,
            start: task.start,
            bike: task.bike.clone(),
            rooms: [(roomy, margin + task.online.plan_margin), (tight, 0.0)],
            narrow: task.bike.grown(allowance + SHORT_PROOF_STEPS),
            seed: task.seed,
            plans: 0,
            searched: None,
            route: None,
            pending: None,
            replaced: None,
            s: 0.0,
            view: None,
            hold: None,
            halt: None,
            promised: 0.0,
            next_search: 0.0,
            next_improvement: 0.0,
            searches_in_vain: 0,
            brakes_hard: false,
            rest: (0.0, 0.0),
            in_vain_here: (f64::NAN, 0),
        })
    }

    /// The path that counts now.
    #[must_use]
    pub fn path(&self) -> Option<&CurvePath> {
        self.route.as_ref().map(|route| &route.curves)
    }

    /// The optimistic world of the last search: known obstacles and occupied cells; everything else free.
    #[must_use]
    pub fn world(&self) -> &World {
        self.belief.world_as_it_was()
    }

    /// Takes over cells of the belief that have changed.
    pub fn observe(&mut self, changes: &[(usize, usize, Cell)]) {
        if self.belief.observe(changes) {
            self.view = None;
        }
    }

    /// The path of the last order cannot be taken over: the one before counts again.
    pub fn refuse(&mut self) {
        if let Some(route) = self.replaced.take() {
            self.route = Some(route);
            self.view = None;
        }
    }

    /// What to do, with the bike as it is now.
    pub fn tick(&mut self, motion: &Motion) -> Order {
        let Some(route) = &self.route else {
            return Order {
                path: None,
                stop_at: Some(0.0),
                status: Status::Halted(self.halt.unwrap_or(Halt::NoPath)),
                is_emergency: false,
                gives_up: self.halt,
                search: None,
            };
        };
        let length = route.curves.length();
        self.s = motion.s.clamp(self.s.min(length), length);
        if self.s > self.rest.0 + MOVED_ON {
            self.rest = (self.s, motion.time);
        }
        let stood_for = motion.time - self.rest.1;
        let stands = motion.speed.abs() < STANDSTILL || stood_for > CREEPING;
        self.searched = None;
        let path = self.take_over(motion, stands);
        let mut view = self.look();
        if stands
            && stood_for >= self.online.doubt_after
            && view.solid.is_none()
            && self.doubt(view)
        {
            view = self.look();
        }
        if view.solid.is_some() {
            self.find_a_way(motion, view, stands);
        } else {
            (self.hold, self.halt) = (None, None);
            self.improve(motion, view);
        }
        let (stop_at, is_emergency) = self.stop(motion, view, stands);
        let status = match (view.solid, view.unproved) {
            (Some(_), _) if self.pending.is_some() => Status::Replanning,
            (Some(_), _) => self.halt.map_or(Status::Replanning, Status::Halted),
            (None, None) => Status::Clear,
            (None, Some(_)) if stands && stop_at.is_some_and(|stop| stop - self.s < HERE) => {
                Status::Halted(Halt::UnknownAhead)
            }
            (None, Some(_)) => Status::Seeing,
        };
        Order {
            path,
            stop_at,
            status,
            is_emergency,
            gives_up: match status {
                Status::Halted(halt) if stood_for >= self.online.give_up => Some(halt),
                _ => None,
            },
            search: self.searched,
        }
    }

    /// A plan that is done by now becomes the route, if it still can.
    fn take_over(&mut self, motion: &Motion, stands: bool) -> Option<NewPath> {
        if self
            .pending
            .as_ref()
            .is_none_or(|plan| motion.time < plan.ready)
        {
            return None;
        }
        let plan = self.pending.take()?;
        let view = look(&plan.sweep, self.s, &self.belief);
        let is_in_time = self.s <= plan.joint || stands;
        let is_stoppable = stands
            || view
                .unproved
                .is_none_or(|place| place.first >= self.s + motion.stopping_distance);
        if !(is_in_time && is_stoppable && view.solid.is_none()) {
            self.next_search = motion.time;
            if plan.cause != Cause::Improved {
                self.brake(motion);
            }
            return None;
        }
        let new = NewPath {
            curves: plan.curves.clone(),
            joint: plan.joint,
            cause: plan.cause,
            iterations: plan.iterations,
        };
        self.replaced = self.route.replace(plan);
        self.view = None;
        (self.hold, self.halt, self.searches_in_vain) = (None, None, 0);
        self.promised = 0.0;
        self.next_improvement = motion.time + self.online.improve_period;
        Some(new)
    }

    /// What lies ahead on the route.
    fn look(&mut self) -> View {
        let is_passed = |place: Option<Covered>| place.is_some_and(|place| place.first <= self.s);
        if let Some(view) = self.view
            && !is_passed(view.unproved)
            && !is_passed(view.solid)
        {
            return view;
        }
        let view = match &self.route {
            Some(route) => look(&route.sweep, self.s, &self.belief),
            None => View {
                unproved: None,
                solid: None,
            },
        };
        self.view = Some(view);
        view
    }

    /// The route is blocked.
    fn find_a_way(&mut self, motion: &Motion, view: View, stands: bool) {
        if self.pending.is_some() || motion.time < self.next_search {
            return;
        }
        match self.search(motion, view, Aim::AnyWay, stands) {
            Ok(plan) => self.pending = Some(plan),
            Err(halt) => {
                let is_doubt = view
                    .solid
                    .is_some_and(|place| self.belief.is_doubted(place.cell));
                self.halt = Some(if is_doubt { Halt::UnknownAhead } else { halt });
                self.searches_in_vain += 1;
                let periods = if stands { self.standing_periods() } else { 1.0 };
                self.next_search = motion.time + periods * self.online.search_period;
                self.brake(motion);
                let proved = view.unproved.map_or(f64::INFINITY, |place| place.first)
                    - self.online.stop_margin;
                if stands && self.searches_in_vain >= IN_VAIN && proved > self.s + HERE {
                    // From farther on there may be a way.
                    self.hold = Some(self.s + self.online.advance);
                    self.searches_in_vain = 0;
                }
            }
        }
    }

    /// How many periods to wait for the next search at rest.
    fn standing_periods(&mut self) -> f64 {
        let here = self.rest.0;
        let count = match self.in_vain_here {
            (place, count) if place == here => count + 1,
            _ => 0,
        };
        self.in_vain_here = (here, count);
        STANDING_PERIODS[count.min(STANDING_PERIODS.len() - 1)]
    }

    /// The route is free; is another one clearly better?
    fn improve(&mut self, motion: &Motion, view: View) {
        let Some(route) = &self.route else {
            return;
        };
        if self.pending.is_some()
            || motion.time < self.next_improvement
            || route.curves.length() - self.s < NEARLY_THERE
        {
            return;
        }
        let aim = if self.belief.has_opened || route.is_tight {
            self.belief.has_opened = false;
            Aim::Better
        } else if route.careful_until < self.s + CARE * self.online.horizon {
            Aim::Renewal
        } else {
            return;
        };
        self.next_improvement = motion.time + self.online.improve_period;
        self.pending = self.search(motion, view, aim, false).ok();
    }

    /// There is no way on for now: the more room is left, the more ways there are.
    fn brake(&mut self, motion: &Motion) {
        self.hold.get_or_insert(self.s + motion.stopping_distance);
    }

    /// Where to be at rest, and whether that is nearer than promised and than the bike can stop.
    fn stop(&mut self, motion: &Motion, view: View, stands: bool) -> (Option<f64>, bool) {
        let proved = view.unproved.map(|place| place.first);
        let rest = self.s + motion.stopping_distance;
        let is_emergency =
            !stands && proved.is_some_and(|proved| proved < rest && proved < self.promised);
        let is_near = proved.is_some_and(|proved| proved - self.online.stop_margin < rest);
        self.brakes_hard = (is_emergency || self.brakes_hard) && is_near && !stands;
        let margin = if self.brakes_hard {
            0.0
        } else {
            self.online.stop_margin
        };
        let stop = proved.map(|proved| (proved - margin).max(self.s));
        self.promised = stop.unwrap_or(f64::INFINITY);
        let stop = match (stop, self.hold) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        (stop, is_emergency)
    }

    /// The bike has stood long enough before what it cannot see: it is to go round. Whether that is news.
    fn doubt(&mut self, view: View) -> bool {
        let Some(first) = view.unproved else {
            return false;
        };
        let is_here = first.first - self.online.stop_margin - self.s < HERE;
        let Some(route) = &self.route else {
            return false;
        };
        if !is_here {
            return false;
        }
        let mut is_news = false;
        for place in route.sweep.ahead(self.s) {
            if place.first > first.first + DOUBTED {
                break;
            }
            is_news |= self.belief.doubt(place.cell);
        }
        if is_news {
            self.view = None;
        }
        is_news
    }
}

/// What lies ahead of arc length `s` (m).
fn look(sweep: &Sweep, s: f64, belief: &Belief) -> View {
    let ahead = sweep.ahead(s);
    let unproved = ahead.iter().position(|place| !belief.is_free(place.cell));
    let solid = unproved.and_then(|first| {
        ahead[first..]
            .iter()
            .find(|place| belief.is_solid(place.cell))
            .copied()
    });
    View {
        unproved: unproved.map(|first| ahead[first]),
        solid,
    }
}
