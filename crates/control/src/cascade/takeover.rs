//! Riding under a moving end of authority: stop lines, greatest speeds and new paths on the way.
//!
//! Start, cruise, brake and hold follow each other; a line that moves on, or a new path, leads
//! back from brake or hold. It takes more way to set off than to go on, so that the bike neither creeps after a
//! line that crawls nor stops and goes.

use bikebot_dynamics::Measurement;
use bikebot_geometry::{CurvePath, Point2, Vector2, angle};

use super::{PROJECTION_REACH, REST_SPEED, RideController};
use crate::authority::{Authority, Takeover};
use crate::braking::{ARRIVED, BrakingLimits, BrakingManoeuvre, CREEP_SPEED, STOP_MARGIN};
use crate::error::ControlError;
use crate::followed_path::{Entry, FollowedPath, Projection};
use crate::params::Track;
use crate::supervisor::Phase;

/// Way to the place of rest from which the bike sets off again, m.
const SET_OFF: f64 = 0.5;
/// Standing with less way than this to the place of rest, the bike waits there, m.
const HALT: f64 = 0.25;
/// Braking ends when the place of rest has moved on by this much, m, there is this much way, m, and this much more
/// speed than ridden, m/s.
const MOVED_ON: f64 = 0.1;
const RELEASE_WAY: f64 = 0.35;
const RELEASE_SPEED: f64 = 0.1;
/// The end of the path counts as reached within this way, m.
const AT_GOAL: f64 = 0.02;
/// Lowest greatest speed, m/s: to stand, the bike needs a place to stand.
const LEAST_CAP: f64 = 0.1;
/// How fast a waiting bike comes back to its place, 1/s, and with what speed at the most, m/s: noise of the
/// speed alone would let it drift.
const RETURN_RATE: f64 = 0.5;
const RETURN_SPEED: f64 = 0.02;
/// How far a new followed curve may pass beside the followed point, m, and how far it may be turned off, rad.
const BESIDE: f64 = 1.0;
const TURNED: f64 = std::f64::consts::FRAC_PI_2;
/// The reference counts as continuous within this, m/s: the step does less than a ramp with another slope.
const SAME_SPEED: f64 = 2e-3;
/// The divergent component of the roll error at which braking harder than service braking is given up, and
/// over how much it fades, rad: what is left of the balancer is needed for the roll.
const DIVERGENT_MAX: f64 = 0.2;
const DIVERGENT_FADE: f64 = 0.1;

impl RideController {
    /// Where the rear contact has to be at rest at the latest, m of arc length on the planned path; `None` opens
    /// the road. The bike stands 5 cm before. It stops in time whenever the line is
    /// [`Self::stopping_distance`] away; nearer than that it brakes as hard as it may
    /// ([`ControlOutput::emergency`](super::ControlOutput::emergency)), and nearer than
    /// [`Self::least_stopping_distance`] it overshoots. A line behind the bike stops it at once, as does one that is no number.
    pub fn set_stop(&mut self, stop: Option<f64>) {
        let aim = match stop {
            Some(line) if line.is_nan() => Some(f64::NEG_INFINITY),
            Some(line) if line < f64::INFINITY => Some(line - STOP_MARGIN),
            _ => None,
        };
        if self
            .path
            .authority()
            .map_or(aim.is_none(), |a| a.aim == aim)
        {
            return;
        }
        self.take_reference_over(self.reference_speed(), |authority| authority.aim = aim);
    }

    /// The stop line, m of arc length on the planned path.
    #[must_use]
    pub fn stop(&self) -> Option<f64> {
        Some(self.path.authority()?.aim? + STOP_MARGIN)
    }

    /// Greatest speed of the followed point, m/s; `None` leaves it to the profile. Approached at the rate of the
    /// profile or of service braking. Less than 0.1 m/s, or what is no number, counts as that: to stand, set a stop line.
    pub fn set_speed_cap(&mut self, cap: Option<f64>) {
        let cap = cap.map(|speed| speed.max(LEAST_CAP));
        if self
            .path
            .authority()
            .map_or(cap.is_none(), |a| a.cap == cap)
        {
            return;
        }
        self.take_reference_over(self.reference_speed(), |authority| authority.cap = cap);
    }

    /// The greatest speed that has been set, m/s.
    #[must_use]
    pub fn speed_cap(&self) -> Option<f64> {
        self.path.authority()?.cap
    }

    /// Goes over to `path`, a plan of the rear contact that contains the piece being ridden: it begins a little
    /// behind the bike, agrees with the present plan around it, and the rear contact is about
    /// `near` m along it, within a metre.
    ///
    /// Reference speed, virtual time, flywheel and tank go on where they are, so that the commands change only by
    /// what the preview sees of the new way. A stop line stays where it is along the way: give the new one with
    /// [`Self::set_stop`] before the next tick. What is averaged of a plan with jumps of curvature reaches two
    /// smoothing windows and a half, 1.6 m by default, beyond them: of such a plan, leave that much behind the bike.
    ///
    /// This allocates, and takes some 10 µs per metre.
    ///
    /// # Errors
    ///
    /// As [`FollowedPath::new`], and [`ControlError::PathElsewhere`] for a path that does not lead past the bike; the
    /// bike then stays on the present one.
    pub fn replace_path(&mut self, path: &CurvePath, near: f64) -> Result<(), ControlError> {
        let own = self.follower.own_point();
        let ahead = own.distance;
        let point = own.point(&self.measured);
        let near = if near.is_finite() { near } else { 0.0 };
        let entry = self.entry_to(path, near, ahead);
        let mut new = FollowedPath::entered(path, &self.follow, &self.limits, ahead, entry)?;

        let guess = new.own_at(near);
        let foot = new.project(point, guess, BESIDE);
        let there = new.sample(foot.s);
        let (distance, turn) = (
            (point - there.position).norm(),
            angle::difference(there.heading, self.measured.pose.heading),
        );
        // Negated, so that what is no number does not pass.
        if !(distance <= BESIDE && turn.abs() <= TURNED) {
            return Err(ControlError::PathElsewhere { distance, turn });
        }

        let before = self.follower.virtual_time();
        let desired = self.path.reference(before);
        // Both feet are off alike where the curves are the same.
        let on = |path: &FollowedPath, near: f64| {
            path.project(desired.position, near, PROJECTION_REACH).s
        };
        let lead = before - self.arc_length;
        let after = before + on(&new, foot.s + lead) - on(&self.path, before);
        let shift = new.rear_at(after).0 - self.path.rear_at(before).0;
        new.set_speed_share(self.guardian.speed_share());
        if let Some(authority) = self.path.authority() {
            new.set_authority(Authority {
                aim: authority.aim.map(|aim| aim + shift),
                takeover: None,
                ..*authority
            });
        }
        self.path = new;
        self.follower.take_over(&self.follow, &self.path, after);
        self.arc_length = foot.s;
        self.waits_at += shift;
        self.rests_at += shift;
        self.arrived = false;
        self.goal_reached = false;
        self.has_changed = true;
        let jumps = (self.path.reference(after).speed - desired.speed).abs() > SAME_SPEED;
        if jumps {
            self.take_reference_over(desired.speed, |_| ());
        }
        Ok(())
    }

    /// How hard the bike brakes.
    #[must_use]
    pub fn braking_limits(&self) -> BrakingLimits {
        self.braking
    }

    /// The braking that is promised from `speed`, m/s: way of the rear contact on the planned path, in bends
    /// as on straights.
    #[must_use]
    pub fn service_braking(&self, speed: f64) -> BrakingManoeuvre {
        self.braking.service_from(speed)
    }

    /// The shortest braking from `speed`, m/s.
    #[must_use]
    pub fn emergency_braking(&self, speed: f64) -> BrakingManoeuvre {
        self.braking.emergency_from(speed)
    }

    /// How far ahead a stop line has to be that the bike, riding at `speed`, m/s, stops before it as a matter of course, m.
    #[must_use]
    pub fn stopping_distance(&self, speed: f64) -> f64 {
        self.service_braking(speed).distance()
    }

    /// How far ahead a stop line has to be that the bike, riding at `speed`, m/s, can stop before it at all, m.
    #[must_use]
    pub fn least_stopping_distance(&self, speed: f64) -> f64 {
        self.emergency_braking(speed).distance()
    }

    /// Where the rear contact was at the last tick, m of arc length on the planned path.
    #[must_use]
    pub fn rear_arc_length(&self) -> f64 {
        self.path.rear_at(self.arc_length).0
    }

    /// The reference speed now, m/s; while it brakes to rest, not below that of the bike.
    fn reference_speed(&self) -> f64 {
        let reference = self.path.reference(self.follower.virtual_time()).speed;
        if self.phase == Phase::Brake {
            reference.max(self.measured.speed.min(self.follow.end_speed))
        } else {
            reference
        }
    }

    /// How the followed curve of `path` begins, where the rear contact is now `near` m along it: with the reference of
    /// the present one there, or as that began if it begins at the same place.
    fn entry_to(&self, path: &CurvePath, near: f64, ahead: f64) -> Entry {
        /// The same start, m.
        const SAME: f64 = 1e-6;
        let start = path.start_pose();
        // Where the followed curve begins, and the rear contact then.
        let (lead, behind) = match self.follow.track {
            Track::RearContact => (ahead, 0.0),
            Track::LookAheadPoint => (0.0, ahead),
        };
        let own: Point2 =
            start.position + Vector2::new(start.heading.cos(), start.heading.sin()) * lead;
        let rear = self.rear_arc_length() - near - behind;
        let guess = self.path.own_at(rear);
        let foot = self.path.project(own, guess, PROJECTION_REACH);
        if guess.abs() < BESIDE && foot.s < SAME {
            self.path.entry()
        } else {
            Entry::Rolling(self.path.reference(foot.s).speed.max(CREEP_SPEED))
        }
    }

    /// Changes what restrains the profile, and takes the reference over at `speed`, m/s.
    fn take_reference_over(&mut self, speed: f64, change: impl FnOnce(&mut Authority)) {
        let f = &self.follow;
        let up = f.longitudinal_acceleration;
        let mut authority = self
            .path
            .authority()
            .copied()
            .unwrap_or_else(|| Authority::new(self.braking, up));
        change(&mut authority);
        authority.takeover = Some(Takeover {
            s: self.follower.virtual_time(),
            speed,
            down: self.gentle_deceleration(speed),
        });
        self.path.set_authority(authority);
        self.has_changed = true;
    }

    /// The deceleration at which a reference of `speed`, m/s, comes down to a slower profile, m/s^2: that
    /// of service braking, or what the next bends need.
    fn gentle_deceleration(&self, speed: f64) -> f64 {
        /// Not what the first quarter of a metre would need, which is behind the bike before it is braked, m.
        const NEAREST: f64 = 0.25;
        /// The profile itself may fall by a little more than its limit.
        const MORE: f64 = 1.2;
        let least = self
            .braking
            .service
            .max(MORE * self.follow.longitudinal_acceleration);
        let hardest = self.braking.emergency.max(least);
        let here = self.follower.virtual_time();
        let (mut s, step) = (here + NEAREST, 0.05);
        let mut needed = least;
        while s < self.path.length() && s - here < speed * speed / (2.0 * least) {
            let target = self.path.sample(s).speed;
            needed = needed.max((speed * speed - target * target) / (2.0 * (s - here)));
            s += step;
        }
        needed.min(hardest)
    }

    /// Way to the place of rest before the stop line, m, if that comes before the end of the path, `remaining` m ahead.
    pub(super) fn stop_first(&self, projection: &Projection, remaining: f64) -> Option<f64> {
        self.path
            .stop_distance(projection.s)
            .filter(|distance| *distance < remaining)
    }

    pub(super) fn is_emergency(&self) -> bool {
        self.path.authority().is_some_and(|a| a.is_emergency)
    }

    /// Notes whether service braking still suffices.
    pub(super) fn watch_emergency(&mut self, speed: f64, projection: &Projection) {
        let (Some(authority), distance) = (
            self.path.authority().copied(),
            self.path.stop_distance(projection.s),
        ) else {
            return;
        };
        let is_emergency = distance.is_some_and(|distance| {
            self.braking
                .is_emergency(speed, distance, authority.is_emergency)
        });
        if is_emergency != authority.is_emergency {
            self.path.set_authority(Authority {
                is_emergency,
                ..authority
            });
        }
    }

    /// The hardest braking that drive, tyres and balance allow now, m/s^2.
    pub(super) fn hardest_deceleration(&self, m: &Measurement) -> f64 {
        if !self.has_changed {
            return self.follow.drive_deceleration;
        }
        let (service, emergency) = (self.braking.service, self.braking.emergency);
        let left = (DIVERGENT_MAX - self.divergent_error(m).abs()) / DIVERGENT_FADE;
        service + (emergency - service) * left.clamp(0.0, 1.0)
    }

    /// The speed at which a bike that holds goes back to where it waits, m/s; none at the end of the path.
    pub(super) fn holding_speed(&self, projection: &Projection) -> f64 {
        if self.goal_reached {
            return 0.0;
        }
        let off = self.waits_at - self.path.rear_at(projection.s).0;
        (RETURN_RATE * off).clamp(-RETURN_SPEED, RETURN_SPEED)
    }

    /// Start, cruise, brake and hold follow each other; a change may lead back.
    pub(super) fn advance_phase(
        &mut self,
        m: &Measurement,
        projection: &Projection,
        remaining: f64,
    ) {
        let speed = m.speed;
        let stop = self.stop_first(projection, remaining);
        let end = stop.unwrap_or(remaining);
        if self.has_changed {
            self.go_on(m, projection, remaining, stop);
        }
        if self.phase == Phase::Start && speed >= self.follow.steering_speed_floor {
            self.phase = Phase::Cruise;
        }
        let rolled = speed.max(0.0) * self.period;
        let is_riding = |phase: Phase| matches!(phase, Phase::Start | Phase::Cruise);
        let was_riding = is_riding(self.phase);
        let way = self.path.braking_speed(remaining - rolled);
        if is_riding(self.phase) && way <= speed.max(CREEP_SPEED) {
            self.phase = Phase::Brake;
        }
        if let Some(distance) = stop.filter(|_| is_riding(self.phase)) {
            // Until the last decimetre the governor of the cruise brakes.
            let way = self.braking.service_speed(distance - rolled);
            let stands = speed < 2.0 * REST_SPEED && distance < HALT;
            if stands || way <= speed.max(CREEP_SPEED).min(self.follow.end_speed) {
                self.phase = Phase::Brake;
            }
        }
        if self.phase == Phase::Brake {
            if was_riding {
                self.rests_at = self.path.rear_at(projection.s).0 + end;
            }
            self.arrived |= end <= ARRIVED;
            let stands_short = stop.is_some() && end < SET_OFF;
            if (self.arrived || stands_short) && speed < 2.0 * REST_SPEED {
                self.phase = Phase::Hold;
                self.goal_reached = stop.is_none();
                self.waits_at = self.path.rear_at(projection.s).0;
            }
        }
    }

    /// Leaves brake and hold where there is way again.
    fn go_on(
        &mut self,
        m: &Measurement,
        projection: &Projection,
        remaining: f64,
        stop: Option<f64>,
    ) {
        let end = stop.unwrap_or(remaining);
        let sets_off = match self.phase {
            Phase::Start | Phase::Cruise => return,
            Phase::Brake => {
                let rest = self.path.rear_at(projection.s).0 + end;
                self.rests_at = self.rests_at.min(rest);
                rest > self.rests_at + MOVED_ON
                    && end > RELEASE_WAY
                    && self.braking.service_speed(end) > m.speed + RELEASE_SPEED
            }
            Phase::Hold if stop.is_some() => !self.goal_reached && end >= SET_OFF,
            Phase::Hold => {
                self.goal_reached |= remaining <= AT_GOAL;
                !self.goal_reached
            }
        };
        if !sets_off {
            return;
        }
        if self.phase == Phase::Hold {
            self.follower.resume(&self.path, m, projection);
        }
        self.phase = if m.speed >= self.follow.steering_speed_floor {
            Phase::Cruise
        } else {
            Phase::Start
        };
        self.arrived = false;
        // As at the beginning: from a reference of nothing a velocity field does not set off.
        let speed = self.reference_speed().max(self.follow.end_speed);
        self.take_reference_over(speed, |_| ());
    }
}
