//! What is written down of a tick.

use super::{FOLLOWED_STEP, Facts, Ride};
use crate::clock::SimTime;
use crate::error::Error;
use crate::online::{Course, Decision, Motion, Order, Status};
use crate::picture;
use crate::pilot::PilotOutput;
use crate::record::{ControlSample, Event, NoticeKind, Recorder, StateSample};
use crate::ride_metrics::TickFacts;
use bikebot_control::Intervention;
use bikebot_dynamics::{BikeState, Measurement, Saturation};

impl Ride<'_> {
    /// Writes down what has changed with an order.
    pub(super) fn tell_of(
        &self,
        time: SimTime,
        order: &Order,
        before: Status,
        motion: &Motion,
        recorder: &mut dyn Recorder,
    ) -> Result<(), Error> {
        if let Some(new) = &order.path {
            let text = format!("{}, from {:.2} m on", new.cause.name(), new.joint);
            recorder.record(
                time,
                &Event::Notice {
                    kind: NoticeKind::Replanned,
                    text: &text,
                    value: new.curves.length(),
                },
            )?;
            picture::plan(self.setup, None, Some(&new.curves), time, recorder)?;
            recorder.record(
                time,
                &Event::FollowedPath(&self.pilot.followed_path(FOLLOWED_STEP)),
            )?;
        }
        let mut notice =
            |kind, text: &str, value| recorder.record(time, &Event::Notice { kind, text, value });
        if order.is_emergency {
            notice(
                NoticeKind::Emergency,
                "what was believed free is so no more",
                order.stop_at.map_or(f64::NAN, |stop| stop - motion.s),
            )?;
        }
        match (before, order.status) {
            (Status::Halted(old), Status::Halted(new)) if old == new => {}
            (_, Status::Halted(halt)) => notice(
                NoticeKind::Halted,
                halt.in_words(),
                order.stop_at.unwrap_or(f64::NAN),
            )?,
            (Status::Halted(_), _) => notice(NoticeKind::Resumed, "on the way again", motion.s)?,
            _ => {}
        }
        Ok(())
    }

    /// Writes one tick down; returns the clearance and the contact forces it found on the way.
    pub(super) fn record(
        &mut self,
        time: SimTime,
        state: &BikeState,
        measured: &Measurement,
        output: &PilotOutput,
        saturation: Saturation,
        recorder: &mut dyn Recorder,
    ) -> Result<Facts, Error> {
        let plant = &self.bike.plant;
        let input = self.bike.input;
        let contact = plant.contact(state, &input);
        let acceleration = plant.accelerations(state, &input);
        let yaw_rate = plant.yaw_rate(state);
        let setup = self.setup;
        let standing = setup
            .world
            .as_ref()
            .filter(|_| self.path.is_some())
            .map(|world| world.footprint_clearance(&setup.footprint, &state.pose));
        let moving = standing.and_then(|standing| {
            let (footprint, pose) = (&setup.footprint, &state.pose);
            setup
                .traffic
                .nearest(footprint, pose, time.seconds(), standing)
        });
        let clearance = moving.map(|(_, clearance)| clearance).or(standing);
        let following = self.pilot.true_following(state);
        let lateral_error = following.map(|following| following.lateral_error);
        let friction = self.bike.friction;
        let rear_error = self.metrics.add(
            &TickFacts {
                state,
                yaw_rate,
                contact: contact.as_ref(),
                friction,
                balancer_torque: input.balancer_torque,
                lateral_error,
                followed_point: following.map(|following| (following.point, following.look_ahead)),
                clearance,
                decoupling: output.decoupling,
                fallback: output.fallback,
            },
            self.path.as_ref(),
        );
        let distance = self.distance;
        self.distance += (self.bike.state.pose.position - state.pose.position).norm();

        let sample = StateSample {
            x_m: state.pose.position.x,
            y_m: state.pose.position.y,
            heading_rad: state.pose.heading,
            steer_rad: state.steer,
            roll_rad: state.roll,
            balancer_rad: state.balancer,
            speed_mps: state.speed,
            yaw_rate_radps: yaw_rate,
            roll_rate_radps: state.roll_rate,
            balancer_rate_radps: state.balancer_rate,
            steer_rate_radps: input.steer_rate,
            acceleration_mps2: acceleration.speed,
            yaw_acceleration_radps2: acceleration.yaw,
            roll_acceleration_radps2: acceleration.roll,
            balancer_acceleration_radps2: acceleration.balancer,
            curvature_per_m: plant.curvature(state),
            distance_m: distance,
            balancer_offset_m: input.offset.d,
            drive_force_n: input.drive_force,
            balancer_torque_nm: input.balancer_torque,
            roll_moment_nm: input.roll_moment + input.push.roll_moment(state.roll),
            slope_force_n: input.slope_force + input.push.forward,
            rear_lateral_force_n: contact.map_or(f64::NAN, |c| c.rear_lateral),
            front_lateral_force_n: contact.map_or(f64::NAN, |c| c.front_normal),
            rear_load_n: contact.map_or(f64::NAN, |c| c.rear_load),
            front_load_n: contact.map_or(f64::NAN, |c| c.front_load),
            friction_use_rear: contact.map_or(f64::NAN, |c| c.friction_use_rear(friction[0])),
            friction_use_front: contact.map_or(f64::NAN, |c| c.friction_use_front(friction[1])),
            energy_j: plant.energy(state, &input),
            clearance_m: clearance.unwrap_or(f64::NAN),
        };
        recorder.record(time, &Event::State(&sample))?;
        if !setup.traffic.is_empty() {
            let shapes = setup.traffic.shapes(time.seconds());
            recorder.record(time, &Event::MovingObstacles(&shapes))?;
        }

        let excess = output
            .energy
            .and_then(|account| self.passivity.check(&account, self.setup.control.seconds()));
        let mut control = output.sample;
        control.drive_saturated = saturation.drive_force;
        control.steer_saturated = saturation.steer_rate || saturation.steer_stop;
        control.balancer_saturated = saturation.balancer_torque || saturation.balancer_speed;
        control.rear_error_m = rear_error.unwrap_or(f64::NAN);
        control.lateral_error_m = lateral_error.unwrap_or(f64::NAN);
        control.passivity_excess_j = excess.unwrap_or(0.0);
        with_measurement(&mut control, measured);
        recorder.record(time, &Event::Control(&control))?;

        let mut notice = |edge: bool, kind, text: &str, value: f64| {
            if edge {
                recorder.record(time, &Event::Notice { kind, text, value })
            } else {
                Ok(())
            }
        };
        notice(
            self.edges.saturated.rises(control.balancer_saturated),
            NoticeKind::Saturated,
            "the balancer's torque or speed is at its limit",
            input.balancer_torque,
        )?;
        notice(
            self.edges.passivity.rises(excess.is_some()),
            NoticeKind::Passivity,
            "the follower stored energy that nobody supplied",
            excess.unwrap_or(0.0),
        )?;
        notice(
            self.edges.decoupling.rises(output.fallback),
            NoticeKind::Decoupling,
            "the balance law is near its singularity and its guard took over",
            output.decoupling.unwrap_or(0.0),
        )?;
        notice(
            self.edges.mode_change.rises(output.offset.rate != 0.0),
            NoticeKind::ModeChange,
            "the balancer's offset is being shifted",
            output.offset.d,
        )?;
        if let Some(intervention) = output.intervention {
            let (text, used) = match intervention {
                Intervention::ToFlywheel(margin, used) => (
                    format!("to flywheel mode: {} runs out", margin.words()),
                    used,
                ),
                Intervention::SlowDown(margin, used) => {
                    (format!("slower: {} runs out", margin.words()), used)
                }
                Intervention::SpeedUp => ("back to speed: every margin is open".to_owned(), 0.0),
            };
            recorder.record(
                time,
                &Event::Notice {
                    kind: NoticeKind::Supervisor,
                    text: &text,
                    value: used,
                },
            )?;
        }
        Ok(Facts {
            contact,
            clearance,
            moving: moving
                .filter(|(_, clearance)| *clearance < 0.0)
                .map(|(index, _)| index)
                .or(self.bike.plant.touched_moving_obstacle()),
            balancer_at_limit: control.balancer_saturated || self.balancer_is_at_limit(state),
        })
    }

    /// A law that knows the limits asks for no more, so that nothing is cut: the limit is seen in what is given.
    fn balancer_is_at_limit(&self, state: &BikeState) -> bool {
        const NEARLY: f64 = 0.999;
        let bike = self.bike.plant.params();
        self.bike.input.balancer_torque.abs() >= NEARLY * bike.balancer_torque_max
            || state.balancer_rate.abs() >= NEARLY * bike.balancer_speed_max
    }
}

/// What is done about something that moves, as a notice.
pub(super) fn giving_way_in_words(turn: &Decision) -> (NoticeKind, String, f64) {
    let Decision {
        id,
        contact,
        way,
        stopping_distance,
        ..
    } = *turn;
    match turn.course {
        Course::Clear | Course::Pass => (
            NoticeKind::Pass,
            format!("goes before mover {id}, which may be {way:.1} m ahead in {contact:.1} s"),
            contact,
        ),
        Course::SlowDown => (
            NoticeKind::Yield,
            format!("slows down to go behind mover {id}, {way:.1} m ahead in {contact:.1} s"),
            contact,
        ),
        Course::Yield => (
            NoticeKind::Yield,
            format!("stops for mover {id}, {way:.1} m ahead in {contact:.1} s"),
            contact,
        ),
        Course::Unavoidable => (
            NoticeKind::Unavoidable,
            format!(
                "mover {id} may be met in {contact:.2} s, {way:.2} m ahead, and stopping takes {stopping_distance:.2} m"
            ),
            contact,
        ),
    }
}

fn with_measurement(sample: &mut ControlSample, measured: &Measurement) {
    sample.measured_x_m = measured.pose.position.x;
    sample.measured_y_m = measured.pose.position.y;
    sample.measured_heading_rad = measured.pose.heading;
    sample.measured_speed_mps = measured.speed;
    sample.measured_steer_rad = measured.steer;
    sample.measured_roll_rad = measured.roll;
    sample.measured_roll_rate_radps = measured.roll_rate;
    sample.measured_balancer_rad = measured.balancer;
    sample.measured_balancer_rate_radps = measured.balancer_rate;
}
