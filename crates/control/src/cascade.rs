//! What the whole bike runs: path following outside, balance inside.
//!
//! Every tick reads the measurement once and answers with drive force, steering rate and
//! balancer torque:
//!
//! 1. where the followed point is and how it moves; its distance from the followed curve;
//! 2. [`crate::follower`]: the forward acceleration and the turning that the path follower wants;
//! 3. the former as drive force, with the drive observer, the latter as steering rate;
//! 4. near the end, the braking law instead of the follower's speed; at rest, hold;
//! 5. [`crate::lean_reference`]: the lean the coming turn asks for;
//! 6. [`crate::balance`]: the torque that keeps the body on it.
//!
//! A tick does not allocate.
//!
//! The path and how far it may be ridden can change at any moment (`takeover`); the path's end and
//! a stop line are braked for alike.

use bikebot_dynamics::constants::GRAVITY;
use bikebot_dynamics::{
    BalancerMode, Bike, BikeInput, BikeParams, BikeState, Command, Measurement, Offset,
    TwoLinkState,
};
use bikebot_geometry::{CurvePath, Point2, Pose2};

mod takeover;

use crate::balance::{BalanceLaw, BalanceOutput, check_period};
use crate::braking::{BRAKE_GAIN, BrakingLimits, CREEP_SPEED, HOLD_GAIN};
use crate::controller::{Controller, check_finite};
use crate::error::ControlError;
use crate::external::{External, FollowerView, asked};
use crate::followed_path::{FollowedPath, Projection, RideLimits};
use crate::follower::{FollowStep, Follower, PlaneMotion, Turning};
use crate::guardian::{Guardian, Intervention, SupervisorParams, Watched};
use crate::lean_reference::LeanReference;
use crate::look_ahead::LookAhead;
use crate::lyapunov::AugmentedEnergy;
use crate::observer::DriveObserver;
use crate::output_zeroing::OutputReference;
use crate::params::{BalanceParams, FollowParams};
use crate::roll_model::TurnMoment;
use crate::steering_assist::SteeringAssist;
use crate::supervisor::{Phase, ShiftConditions, Supervisor};

/// Half the friction is kept for pushes, braking and what the model does not know.
const FRICTION_SHARE: f64 = 0.5;
/// How far along the curve the nearest point may move between two ticks, m, beyond twice the way ridden:
/// a pose that comes late makes it jump.
const PROJECTION_REACH: f64 = 0.5;
/// The bike is at rest below these, m/s, rad and rad/s.
const REST_SPEED: f64 = 0.005;
const REST_ROLL: f64 = 0.5 * std::f64::consts::PI / 180.0;
const REST_ROLL_RATE: f64 = 0.05;

/// What the ride controller answers, and what a recording wants to know of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlOutput {
    /// What the actuators are asked to do.
    pub command: Command,
    /// Where the balancer offset shall be.
    pub offset: Offset,
    /// The mode the bike is in, or leaves by the shift under way.
    pub mode: BalancerMode,
    /// What the bike is doing.
    pub phase: Phase,
    /// The follower's own point (`P`, the look-ahead point, of the velocity field), world frame, m.
    pub followed_point: Point2,
    /// `P_d(s)`: where on the followed curve the own point should be, m.
    pub desired_point: Point2,
    /// `s`, m: the virtual time, or the foot of the own point where the law knows none.
    pub virtual_time: f64,
    /// Speed of the followed point, m/s.
    pub followed_speed: f64,
    /// Arc length of the nearest point of the followed curve, m.
    pub arc_length: f64,
    /// Distance of the followed point from the followed curve, m, positive to the left.
    pub lateral_error: f64,
    /// Way of the rear contact to the end of the path, m; negative past it.
    pub remaining: f64,
    /// `alpha_ref`, rad: the lean reference, with the share of the roll-moment observer.
    pub lean_reference: f64,
    /// The balance law's own account; `decoupling` is `D / D_upright`.
    pub balance: BalanceOutput,
    /// `D / D_upright`.
    pub decoupling: f64,
    /// Whether linear-quadratic feedback stood in for output zeroing.
    pub fallback: bool,
    /// Whether the drive force was cut to its limit.
    pub drive_saturated: bool,
    /// Whether the steering rate was cut to its limit or held at a stop.
    pub steer_saturated: bool,
    /// Whether the balancer torque was cut to its limit.
    pub balancer_saturated: bool,
    /// `m d_hat`, N: the force along the heading that the drive observer compensates, negative uphill.
    pub drive_estimate: f64,
    /// The energy account of the augmented system over the tick that has just ended; only the velocity
    /// field keeps one.
    pub energy: Option<AugmentedEnergy>,
    /// What the guardian of the margins has decided in this tick.
    pub intervention: Option<Intervention>,
    /// Standing, or about to, before the stop line: it sets off again when the line moves on.
    pub waiting: bool,
    /// Standing, or about to, on the end of the path.
    pub arrived: bool,
    /// The stop line has come nearer than service braking allows: the bike brakes as hard as it may.
    pub emergency: bool,
    /// Arc length of the rear contact on the planned path, m.
    pub rear_arc_length: f64,
    /// Standing upright: slower than 5 mm/s, within 0.5 deg of the lean held, turning over at less
    /// than 0.05 rad/s.
    pub at_rest: bool,
}

/// What following asks for in one tick.
#[derive(Debug, Clone, Copy)]
struct PlaneCommand {
    acceleration: f64,
    /// Before the limits of the steering, rad/s.
    steer_rate: f64,
    energy: Option<AugmentedEnergy>,
}

/// The whole bike's controller.
#[derive(Debug, Clone, PartialEq)]
pub struct RideController {
    bike: BikeParams,
    follow: FollowParams,
    assist: Option<SteeringAssist>,
    path: FollowedPath,
    follower: Follower,
    drive: DriveObserver,
    law: BalanceLaw,
    lean: LeanReference,
    supervisor: Supervisor,
    guardian: Guardian,
    /// The nominal bike, for loads and friction that no sensor measures.
    nominal: Bike,
    phase: Phase,
    arc_length: f64,
    /// The phase of braking in which the place of rest has been reached.
    arrived: bool,
    /// It is the end of the path.
    goal_reached: bool,
    /// Arc length of the plan where the rear contact waits, m.
    waits_at: f64,
    /// The nearest place of rest while it brakes, m of the plan.
    rests_at: f64,
    limits: RideLimits,
    braking: BrakingLimits,
    /// Path, stop line or speed have been changed on the way.
    has_changed: bool,
    /// What was measured last.
    measured: Measurement,
    period: f64,
}

impl RideController {
    /// For `bike` in `mode`, to ride `path` (of the rear contact) from `start`, called every
    /// `control_period` seconds.
    ///
    /// # Errors
    ///
    /// A path that cannot be followed, a control period that is none, a balancer without
    /// authority, or a start that is not finite.
    pub fn new(
        bike: &BikeParams,
        mode: BalancerMode,
        follow: &FollowParams,
        balance: &BalanceParams,
        path: &CurvePath,
        start: &Measurement,
        control_period: f64,
    ) -> Result<Self, ControlError> {
        check_period(control_period)?;
        check_finite(start)?;
        let limits = RideLimits {
            wheelbase: bike.wheelbase,
            steer_rate: bike.steer_rate_max,
            lateral_acceleration: FRICTION_SHARE * bike.friction * GRAVITY,
            curvature: bike.steer_max().tan() / bike.wheelbase,
        };
        let ahead = Follower::own_distance(follow, bike);
        let path = FollowedPath::new(path, follow, &limits, ahead)?;
        let law = BalanceLaw::new(bike, balance, bike.offset(mode))?;
        let own = start.pose.position + start.pose.direction() * ahead;
        let projection = path.project(own, ahead, 2.0 * ahead.max(PROJECTION_REACH));
        let follower = Follower::new(follow, bike, &path, start, &projection);
        let lean = LeanReference::new(balance, law.model(), 0.0, control_period);
        Ok(Self {
            bike: *bike,
            follow: follow.clone(),
            assist: SteeringAssist::new(balance),
            path,
            follower,
            drive: DriveObserver::new(follow.drive_observer_rate),
            law,
            lean,
            supervisor: Supervisor::new(bike, mode),
            guardian: guardian(&SupervisorParams::default(), bike),
            nominal: Bike::new(*bike),
            phase: Phase::Start,
            arc_length: projection.s,
            arrived: false,
            goal_reached: false,
            waits_at: 0.0,
            rests_at: 0.0,
            limits,
            braking: BrakingLimits::new(
                follow,
                bike,
                follow.lateral_acceleration.min(limits.lateral_acceleration),
            ),
            has_changed: false,
            measured: *start,
            period: control_period,
        })
    }

    /// The law that follows the path.
    #[must_use]
    pub fn follower(&self) -> &Follower {
        &self.follower
    }

    /// The same, with its margins watched.
    #[must_use]
    pub fn guarded(mut self, params: &SupervisorParams) -> Self {
        self.guardian = guardian(params, &self.bike);
        self
    }

    /// The point of the bike that is kept on the followed curve.
    #[must_use]
    pub fn own_point(&self) -> &LookAhead {
        self.follower.own_point()
    }

    /// The curve the own point follows, with its speed profile.
    #[must_use]
    pub fn followed_path(&self) -> &FollowedPath {
        &self.path
    }

    /// What the bike is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The balancer offset commanded now.
    #[must_use]
    pub fn offset(&self) -> Offset {
        self.supervisor.offset()
    }

    /// Asks for another balancer mode; the shift takes `duration` seconds once its conditions hold.
    ///
    /// # Errors
    ///
    /// As [`Supervisor::request`].
    pub fn request_mode(&mut self, mode: BalancerMode, duration: f64) -> Result<(), ControlError> {
        self.supervisor.request(mode, duration)
    }

    /// Advances by one period.
    ///
    /// # Errors
    ///
    /// [`ControlError::NotFinite`] for a measurement that is not finite.
    pub fn tick(&mut self, m: &Measurement) -> Result<ControlOutput, ControlError> {
        self.tick_with(m, &mut External::default())
    }

    /// As [`RideController::tick`], with the follower and the balance law that `external` lends in place
    /// of ours. The future of a law from outside is not known: the lean preview foresees the ride by the
    /// follower named in the parameters, from where the bike is.
    ///
    /// # Errors
    ///
    /// As [`RideController::tick`], and what a law from outside declines or gives that is no number.
    pub fn tick_with(
        &mut self,
        m: &Measurement,
        external: &mut External<'_>,
    ) -> Result<ControlOutput, ControlError> {
        check_finite(m)?;
        let dt = self.period;
        let (sin, cos) = m.steer.sin_cos();
        let (tan, cos2) = (sin / cos, cos * cos);
        let own = *self.follower.own_point();
        let yaw_rate = own.yaw_rate(m);
        let (point, point_rate) = (own.point(m), own.velocity(m));

        let reach = PROJECTION_REACH + 2.0 * m.speed.abs() * dt;
        let projection = self.path.project(point, self.arc_length, reach);
        self.arc_length = projection.s;
        self.measured = *m;
        let remaining = self.path.remaining(m.pose.position, projection.s);
        self.watch_emergency(m.speed, &projection);
        self.advance_phase(m, &projection, remaining);

        let plane = if self.phase == Phase::Hold {
            PlaneCommand {
                acceleration: (HOLD_GAIN * (self.holding_speed(&projection) - m.speed)).clamp(
                    -self.follow.drive_deceleration,
                    self.follow.drive_acceleration,
                ),
                steer_rate: 0.0,
                energy: self.follower.rest(),
            }
        } else {
            let step = match external.follower.as_deref_mut() {
                None => self.follower.step(&self.path, m, &projection, dt),
                Some(outside) => {
                    // Ours only foresees: it begins anew where the bike has come to.
                    self.follower.resume(&self.path, m, &projection);
                    let command = asked(
                        outside,
                        &FollowerView {
                            time: external.time,
                            period: dt,
                            measured: m,
                            path: &self.path,
                            projection,
                            reference: self.path.reference(projection.s),
                            ahead: own.distance,
                            remaining,
                        },
                    )?;
                    FollowStep {
                        acceleration: command.acceleration,
                        turning: Turning::SteerRate(command.steer_rate),
                        energy: None,
                    }
                }
            };
            self.plane_command(m, &step, &projection, remaining)
        };

        let mass = self.bike.mass();
        let wanted_force = mass * (plane.acceleration - self.drive.acceleration());
        let drive_force = wanted_force.clamp(-self.bike.drive_force_max, self.bike.drive_force_max);
        self.drive.update(m.speed, drive_force / mass, dt);

        let yaw_acceleration =
            (plane.acceleration * tan + m.speed * m.steer_rate / cos2) / self.bike.wheelbase;
        let turn = TurnMoment {
            centripetal: m.speed * yaw_rate,
            yaw_acceleration,
            yaw_rate,
        };
        let state = TwoLinkState::from(m);
        let reference = self.lean_reference(m, &turn, plane.acceleration);
        let (balance, wanted_steer_rate) =
            self.balance(m, &state, &turn, &reference, plane.steer_rate, external)?;
        let steer_rate = self.steerable(wanted_steer_rate, m.steer);

        let saturated = balance.torque.abs() >= self.bike.balancer_torque_max;
        let intervention = self.guard(m, drive_force, balance.torque, saturated);
        let lean_held =
            reference.value - balance.moment_estimate / self.law.model().toppling_stiffness();
        Ok(ControlOutput {
            command: Command {
                drive_force,
                steer_rate,
                balancer_torque: balance.torque,
            },
            offset: self.supervisor.offset(),
            mode: self.supervisor.mode(),
            phase: self.phase,
            followed_point: point,
            desired_point: self.path.sample(self.follower.virtual_time()).position,
            virtual_time: self.follower.virtual_time(),
            followed_speed: point_rate.norm(),
            arc_length: projection.s,
            lateral_error: projection.lateral,
            remaining,
            lean_reference: lean_held,
            balance,
            decoupling: balance.decoupling,
            fallback: balance.fallback,
            drive_saturated: drive_force != wanted_force,
            steer_saturated: steer_rate != wanted_steer_rate,
            balancer_saturated: balance.saturated,
            drive_estimate: mass * self.drive.acceleration(),
            energy: plane.energy,
            intervention,
            waiting: self.phase == Phase::Hold && !self.goal_reached,
            arrived: self.phase == Phase::Hold && self.goal_reached,
            emergency: self.is_emergency(),
            rear_arc_length: self.path.rear_at(projection.s).0,
            at_rest: self.phase == Phase::Hold
                && m.speed.abs() < REST_SPEED
                && (m.roll - lean_held).abs() < REST_ROLL
                && m.roll_rate.abs() < REST_ROLL_RATE,
        })
    }

    /// Watches the margins and does what they ask for.
    fn guard(
        &mut self,
        m: &Measurement,
        drive_force: f64,
        balancer_torque: f64,
        saturated: bool,
    ) -> Option<Intervention> {
        let state = BikeState {
            pose: m.pose,
            steer: m.steer,
            roll: m.roll,
            balancer: m.balancer,
            speed: m.speed,
            roll_rate: m.roll_rate,
            balancer_rate: m.balancer_rate,
        };
        let forces = self.nominal.contact_forces(
            &state,
            &BikeInput {
                drive_force,
                steer_rate: m.steer_rate,
                balancer_torque,
                offset: self.supervisor.offset(),
                ..BikeInput::default()
            },
        );
        let friction = self.bike.friction;
        let watched = Watched {
            mode: self.supervisor.mode(),
            is_shifting: self
                .supervisor
                .change()
                .is_some_and(|change| change.is_moving()),
            balancer_speed: m.balancer_rate.abs(),
            saturated,
            divergent: self.divergent_error(m),
            wheel_load: forces.rear_load.min(forces.front_load),
            friction_use: forces
                .friction_use_rear(friction)
                .max(forces.friction_use_front(friction)),
            speed: m.speed,
        };
        let intervention = self.guardian.tick(&watched, self.period);
        self.path.set_speed_share(self.guardian.speed_share());
        if let Some(Intervention::ToFlywheel(..)) = intervention {
            let duration = self.guardian.shift_duration();
            // Whether the bike can is known to the guardian; asking twice does no harm.
            let _ = self
                .supervisor
                .request_urgently(BalancerMode::Flywheel, duration);
        }
        intervention
    }

    /// Steps 3 and 4: what the follower wants as forward acceleration and steering rate.
    fn plane_command(
        &self,
        m: &Measurement,
        step: &FollowStep,
        projection: &Projection,
        remaining: f64,
    ) -> PlaneCommand {
        let f = &self.follow;
        let (acceleration, steering_share) = if self.phase == Phase::Brake {
            // Standing still, no steering angle moves the point sideways: let it fade out.
            (
                self.braking_acceleration(m.speed, projection, remaining),
                (m.speed / f.steering_speed_floor).clamp(0.0, 1.0),
            )
        } else {
            let (speed, dt) = (m.speed.max(0.0), self.period);
            let governed = self
                .path
                .governed(step.acceleration, speed, projection.s, dt);
            (governed, 1.0)
        };
        let acceleration = acceleration.clamp(-self.hardest_deceleration(m), f.drive_acceleration);
        let steer_rate = match step.turning {
            Turning::YawAcceleration(yaw) => {
                self.follower.own_point().steer_rate(m, acceleration, yaw)
            }
            Turning::SteerRate(rate) => rate,
        };
        PlaneCommand {
            acceleration,
            steer_rate: steering_share * steer_rate,
            energy: step.energy,
        }
    }

    /// Holds the speed from which the bike comes to rest on the goal or before the stop line; the last
    /// centimetres are ridden at a creep so that it neither stops short nor overshoots.
    fn braking_acceleration(&self, speed: f64, projection: &Projection, remaining: f64) -> f64 {
        if self.arrived {
            return -HOLD_GAIN * speed;
        }
        if let Some(distance) = self.stop_first(projection, remaining) {
            return self
                .braking
                .most_acceleration(speed, distance, self.is_emergency());
        }
        let law = self.path.braking_speed(remaining);
        if law > CREEP_SPEED {
            -self.follow.braking_deceleration * (speed / law).clamp(0.0, 2.0)
                + BRAKE_GAIN * (law - speed)
        } else {
            BRAKE_GAIN * (CREEP_SPEED - speed)
        }
    }

    /// Step 5, and the balancer shift, whose conditions look at the same roll error.
    fn lean_reference(
        &mut self,
        m: &Measurement,
        turn: &TurnMoment,
        acceleration: f64,
    ) -> OutputReference {
        let conditions = ShiftConditions {
            acceleration,
            divergent: self.divergent_error(m),
            balancer: m.balancer,
            balancer_rate: m.balancer_rate,
        };
        if self.supervisor.tick(&conditions, self.period) {
            self.law.set_offset(self.supervisor.offset().d);
            self.lean.set_model(self.law.model());
        }
        if self.phase == Phase::Hold {
            self.lean.look_at_nothing();
            return self.lean.tick(0.0, self.period);
        }
        let motion = PlaneMotion {
            measured: *m,
            yaw_rate: turn.yaw_rate,
            yaw_acceleration: turn.yaw_acceleration,
        };
        let (follower, path) = (&self.follower, &self.path);
        self.lean
            .look(self.law.model(), turn, |step, steps, visit| {
                follower.roll_out(path, &motion, step, steps, visit);
            });
        let equilibrium = self
            .law
            .model()
            .equilibrium_lean(turn.centripetal, turn.yaw_acceleration);
        self.lean.tick(equilibrium, self.period)
    }

    /// `alpha + alpha'/lambda - xi_ref`, rad: what decides whether the bike can still be saved.
    fn divergent_error(&self, m: &Measurement) -> f64 {
        m.roll + m.roll_rate / self.law.model().toppling_rate() - self.lean.divergent()
    }

    /// Step 6, and what of the follower's steering rate and of the assist's comes out, rad/s.
    fn balance(
        &mut self,
        m: &Measurement,
        state: &TwoLinkState,
        turn: &TurnMoment,
        reference: &OutputReference,
        follower: f64,
        external: &mut External<'_>,
    ) -> Result<(BalanceOutput, f64), ControlError> {
        let dt = self.period;
        let error = self.divergent_error(m);
        let outside = match external.balancer.as_deref_mut() {
            None => None,
            Some(outside) => {
                Some(
                    self.law
                        .tick_by(outside, external.time, state, turn, reference, dt)?,
                )
            }
        };
        let Some(assist) = self.assist.as_mut().filter(|_| self.phase != Phase::Hold) else {
            let balance =
                outside.unwrap_or_else(|| self.law.tick(state, turn, reference, None, dt));
            return Ok((balance, follower));
        };
        Ok(if self.law.plans_steering() && outside.is_none() {
            let follower = assist.left_to_follower(follower, &self.bike);
            let room = assist.room(
                m,
                &self.bike,
                self.law.model(),
                self.follow.look_ahead,
                follower,
            );
            let balance = self.law.tick(state, turn, reference, room.as_ref(), dt);
            assist.take(balance.steer_rate, dt);
            (balance, follower + balance.steer_rate)
        } else {
            let balance =
                outside.unwrap_or_else(|| self.law.tick(state, turn, reference, None, dt));
            let added = assist.proportional(error, m, &self.bike, self.law.model());
            (balance, follower + added)
        })
    }

    /// Goes over to the balance law that `params` name, without a bump.
    ///
    /// # Errors
    ///
    /// As [`BalanceLaw::change_law`].
    pub fn change_balance_law(&mut self, params: &BalanceParams) -> Result<(), ControlError> {
        self.law.change_law(params)
    }

    /// A steering rate within the limits of the servo, and none into a stop.
    fn steerable(&self, rate: f64, steer: f64) -> f64 {
        if steer.abs() >= self.bike.steer_max() && rate * steer > 0.0 {
            return 0.0;
        }
        rate.clamp(-self.bike.steer_rate_max, self.bike.steer_rate_max)
    }
}

fn guardian(params: &SupervisorParams, bike: &BikeParams) -> Guardian {
    let rest = BikeState::upright(Pose2::new(0.0, 0.0, 0.0), 0.0);
    let forces = Bike::new(*bike).contact_forces(&rest, &BikeInput::default());
    Guardian::new(
        params,
        bike.balancer_speed_max,
        forces.rear_load.min(forces.front_load),
        bike.mode_change_is_possible().is_met(),
    )
}

impl Controller for RideController {
    type Output = ControlOutput;

    fn tick(&mut self, measurement: &Measurement) -> Result<ControlOutput, ControlError> {
        Self::tick(self, measurement)
    }
}
