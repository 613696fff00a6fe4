//! Whoever holds the handlebar: the ride controller on a path, or the balance law alone.

use crate::error::Error;
use crate::record::{ControlSample, PathSample, RidePhase};
use crate::setup::{ScheduledModeChange, Setup};
use bikebot_control::{
    AugmentedEnergy, BalanceController, BrakingLimits, ControlError, External, Intervention, Phase,
    RideController,
};
use bikebot_dynamics::{BikeState, Command, Measurement, Offset, TwoLinkState};
use bikebot_geometry::{CurvePath, Point2};

/// How far along the followed curve the true followed point may move between two looks, m.
const PROJECTION_REACH: f64 = 0.5;

/// One controller, as the loop sees it.
#[derive(Debug, Clone)]
pub(crate) struct Pilot {
    kind: Kind,
    offset: Offset,
    changes: Vec<ScheduledModeChange>,
    next_change: usize,
}

#[derive(Debug, Clone)]
enum Kind {
    Rider {
        controller: Box<RideController>,
        /// Arc length of the true followed point on the followed curve, m.
        true_s: f64,
    },
    Balancer(Box<BalanceController>),
}

/// The answer of one tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PilotOutput {
    pub command: Command,
    pub offset: Offset,
    /// D/D_upright of the balance law.
    pub decoupling: Option<f64>,
    pub fallback: bool,
    pub energy: Option<AugmentedEnergy>,
    /// The controller has brought the bike to a standstill and holds it there.
    pub holds: bool,
    /// What the guardian of the margins has decided.
    pub intervention: Option<Intervention>,
    /// What of this the recording shows.
    pub sample: ControlSample,
}

/// Where the bike's followed point really is, whatever the sensors said.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrueFollowing {
    /// Distance from the followed curve, m, positive to the left.
    pub lateral_error: f64,
    pub point: Point2,
    /// How far ahead of the rear contact it lies, m.
    pub look_ahead: f64,
}

impl Pilot {
    pub fn new(
        setup: &Setup,
        path: Option<&CurvePath>,
        start: &Measurement,
    ) -> Result<Self, Error> {
        let period = setup.control.seconds();
        let offset = Offset {
            d: setup.bike.offset(setup.mode),
            rate: 0.0,
            acceleration: 0.0,
        };
        let kind = match path {
            Some(path) => {
                let controller = RideController::new(
                    &setup.bike,
                    setup.mode,
                    &setup.follow,
                    &setup.balance,
                    path,
                    start,
                    period,
                )?
                .guarded(&setup.supervisor);
                Kind::Rider {
                    controller: Box::new(controller),
                    true_s: 0.0,
                }
            }
            None => Kind::Balancer(Box::new(BalanceController::new(
                &setup.bike,
                setup.mode,
                &setup.balance,
                period,
            )?)),
        };
        Ok(Self {
            kind,
            offset,
            changes: setup.mode_changes.clone(),
            next_change: 0,
        })
    }

    /// Offset of the balancer's centre of gravity commanded now.
    pub fn offset(&self) -> Offset {
        self.offset
    }

    /// One period from `t` (s) on, with the controllers that `external` lends in place of ours.
    pub fn tick(
        &mut self,
        t: f64,
        measured: &Measurement,
        external: &mut External<'_>,
    ) -> Result<PilotOutput, ControlError> {
        external.time = t;
        match &mut self.kind {
            Kind::Rider { controller, .. } => {
                if let Some(change) = self
                    .changes
                    .get(self.next_change)
                    .filter(|change| t >= change.time)
                {
                    match controller.request_mode(change.mode, change.duration) {
                        Ok(()) => self.next_change += 1,
                        // The one before still waits for a calm moment; so does this one.
                        Err(ControlError::ModeChangeUnderWay) => {}
                        Err(error) => return Err(error),
                    }
                }
                let output = controller.tick_with(measured, external)?;
                self.offset = output.offset;
                let path = controller.followed_path();
                let reference = path.sample(output.virtual_time);
                // Laws that keep no account leave its columns at zero.
                let energy = output.energy.unwrap_or_default();
                let sample = ControlSample {
                    drive_force_command_n: output.command.drive_force,
                    steer_rate_command_radps: output.command.steer_rate,
                    balancer_torque_command_nm: output.command.balancer_torque,
                    balancer_offset_command_m: output.offset.d,
                    fallback: output.fallback,
                    phase: match output.phase {
                        Phase::Start => RidePhase::Start,
                        Phase::Cruise => RidePhase::Cruise,
                        Phase::Brake => RidePhase::Brake,
                        Phase::Hold => RidePhase::Hold,
                    },
                    followed_x_m: output.followed_point.x,
                    followed_y_m: output.followed_point.y,
                    desired_x_m: output.desired_point.x,
                    desired_y_m: output.desired_point.y,
                    path_s_m: output.virtual_time,
                    path_curvature_per_m: reference.curvature,
                    speed_reference_mps: reference.speed,
                    speed_error_mps: output.followed_speed - reference.speed,
                    roll_reference_rad: output.lean_reference,
                    balance_output: output.balance.output,
                    decoupling_ratio: output.decoupling,
                    roll_moment_estimate_nm: output.balance.moment_estimate,
                    drive_force_estimate_n: output.drive_estimate,
                    stored_energy_j: energy.stored,
                    supplied_power_w: energy.supplied_power,
                    regulator_power_w: energy.regulator_power,
                    energy_bound_j: energy.error_bound,
                    energy_tank_j: energy.tank,
                    ..ControlSample::default()
                };
                Ok(PilotOutput {
                    command: output.command,
                    offset: output.offset,
                    decoupling: Some(output.decoupling),
                    fallback: output.fallback,
                    energy: output.energy,
                    holds: output.phase == Phase::Hold,
                    intervention: output.intervention,
                    sample,
                })
            }
            Kind::Balancer(controller) => {
                let output = controller.torque_with(&TwoLinkState::from(measured), external)?;
                let sample = ControlSample {
                    balancer_torque_command_nm: output.torque,
                    balancer_offset_command_m: self.offset.d,
                    fallback: output.fallback,
                    phase: RidePhase::Hold,
                    balance_output: output.output,
                    decoupling_ratio: output.decoupling,
                    roll_moment_estimate_nm: output.moment_estimate,
                    ..ControlSample::default()
                };
                Ok(PilotOutput {
                    command: Command {
                        drive_force: 0.0,
                        steer_rate: 0.0,
                        balancer_torque: output.torque,
                    },
                    offset: self.offset,
                    decoupling: Some(output.decoupling),
                    fallback: output.fallback,
                    energy: None,
                    holds: false,
                    intervention: None,
                    sample,
                })
            }
        }
    }

    /// Where the rear contact was at the last tick, m of arc length on the planned path.
    pub fn arc_length(&self) -> f64 {
        match &self.kind {
            Kind::Rider { controller, .. } => controller.rear_arc_length(),
            Kind::Balancer(_) => 0.0,
        }
    }

    /// Way on which the controller promises to stop from `speed` (m/s), m.
    pub fn stopping_distance(&self, speed: f64) -> f64 {
        match &self.kind {
            Kind::Rider { controller, .. } => controller.stopping_distance(speed),
            Kind::Balancer(_) => 0.0,
        }
    }

    /// Rides `path` from now on, which has the bike `near` m along it.
    pub fn replace_path(&mut self, path: &CurvePath, near: f64) -> Result<(), ControlError> {
        match &mut self.kind {
            Kind::Rider { controller, .. } => controller.replace_path(path, near),
            Kind::Balancer(_) => Ok(()),
        }
    }

    /// Where to be at rest at the latest, m of arc length on the planned path.
    pub fn set_stop(&mut self, stop: Option<f64>) {
        if let Kind::Rider { controller, .. } = &mut self.kind {
            controller.set_stop(stop);
        }
    }

    /// Greatest speed, m/s; `None` leaves it to the profile.
    pub fn set_speed_cap(&mut self, cap: Option<f64>) {
        if let Kind::Rider { controller, .. } = &mut self.kind {
            controller.set_speed_cap(cap);
        }
    }

    /// The profile's speed of the rear contact at an arc length of the planned path (m), m/s, without stop lines and greatest speeds.
    pub fn profile_speed(&self, rear: f64) -> f64 {
        match &self.kind {
            Kind::Rider { controller, .. } => {
                let path = controller.followed_path();
                let own = path.own_at(rear);
                path.sample(own).speed / path.rear_at(own).1
            }
            Kind::Balancer(_) => 0.0,
        }
    }

    /// How hard the controller brakes.
    pub fn braking_limits(&self) -> BrakingLimits {
        match &self.kind {
            Kind::Rider { controller, .. } => controller.braking_limits(),
            Kind::Balancer(_) => BrakingLimits {
                service: 0.0,
                emergency: 0.0,
            },
        }
    }

    /// The followed curve with its speed profile, thinned to one sample per `step` metres.
    pub fn followed_path(&self, step: f64) -> Vec<PathSample> {
        let Kind::Rider { controller, .. } = &self.kind else {
            return Vec::new();
        };
        let path = controller.followed_path();
        let every = (step / path.step()).round().max(1.0) as usize;
        path.samples()
            .iter()
            .enumerate()
            .step_by(every)
            .map(|(i, sample)| PathSample {
                x: sample.position.x,
                y: sample.position.y,
                heading: sample.heading,
                curvature: sample.curvature,
                s: i as f64 * path.step(),
                speed: sample.speed,
            })
            .collect()
    }

    /// Where the true followed point is, from the true state.
    pub fn true_following(&mut self, state: &BikeState) -> Option<TrueFollowing> {
        let Kind::Rider { controller, true_s } = &mut self.kind else {
            return None;
        };
        let ahead = controller.own_point().distance;
        let point = state.pose.position + state.pose.direction() * ahead;
        let projection = controller
            .followed_path()
            .project(point, *true_s, PROJECTION_REACH);
        *true_s = projection.s;
        Some(TrueFollowing {
            lateral_error: projection.lateral,
            point,
            look_ahead: ahead,
        })
    }
}
