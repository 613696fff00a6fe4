//! Passive velocity field control of the augmented point mass.
//!
//! With the augmented velocity `q'`, `p = M q'`, `P = M V` and `w = M V'`, the force
//!
//! ```text
//! tau_c = (w (P . q') - P (w . q'))/(2 E),     tau_f = gamma (P (p . q') - p (P . q'))
//! ```
//!
//! is skew in `q'` and so does no work: the energy `k = q'^T M q'/2` changes only through forces
//! from outside. It turns `q'` towards a multiple of the field. A regulator on the flywheel
//! restores the energy level that slopes and drag take away. What it injects comes out of a tank
//! ([`crate::energy_tank`]) and what it extracts goes into it, so that the system with its tank is
//! strictly passive. The books are kept by [`crate::lyapunov`].

use bikebot_geometry::{Point2, Vector2};
use nalgebra::Vector4;

use crate::energy_tank::{EnergyTank, Withdrawal};
use crate::followed_path::FollowedPath;
use crate::params::FollowParams;
use crate::velocity_field::{FieldValue, VelocityField};

/// The skew coupling force at `velocity` in a field of energy `energy`.
#[must_use]
pub fn coupling_force(
    inertia: &Vector4<f64>,
    velocity: &Vector4<f64>,
    field: &FieldValue,
    energy: f64,
    coupling_gain: f64,
) -> Vector4<f64> {
    let momentum = inertia.component_mul(velocity);
    let field_momentum = inertia.component_mul(&field.velocity);
    let field_force = inertia.component_mul(&field.rate);
    let along_field = field_momentum.dot(velocity);
    let covariant =
        (field_force * along_field - field_momentum * field_force.dot(velocity)) / (2.0 * energy);
    let feedback =
        (field_momentum * momentum.dot(velocity) - momentum * along_field) * coupling_gain;
    covariant + feedback
}

/// The augmented system in motion: the point is measured, virtual time and flywheel are software.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pvfc {
    field: VelocityField,
    coupling_gain: f64,
    energy_gain: f64,
    level: f64,
    tank: Option<EnergyTank>,
    virtual_time: f64,
    virtual_rate: f64,
    flywheel_rate: f64,
}

/// What one step of the law asks for, and what it did to the energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PvfcStep {
    /// Commanded acceleration of the followed point, world frame, m/s^2.
    pub acceleration: Vector2,
    /// The field it moved in.
    pub field: FieldValue,
    /// Force on the point, N.
    pub force: Vector2,
    /// `k`, J, before the step.
    pub stored: f64,
    /// Power of the energy regulator, W.
    pub regulator_power: f64,
    /// What an explicit Euler step of these forces adds to the energy, `dt^2 tau' M^-1 tau / 2`, J.
    pub euler_excess: f64,
    /// Content of the tank before the step, J, if there is one.
    pub tank: Option<f64>,
    /// What the full tank gave up in the step, J.
    pub given_up: f64,
}

impl Pvfc {
    /// Starts at arc length `virtual_time`, m, with the point moving at `point_rate` and the
    /// virtual time keeping pace with it, m/s; the flywheel gets the rest of the energy.
    #[must_use]
    pub fn new(
        params: &FollowParams,
        field: VelocityField,
        virtual_time: f64,
        virtual_rate: f64,
        point_rate: Vector2,
    ) -> Self {
        let level = params.speed_level * params.speed_level * field.energy();
        let m = field.inertia();
        let rest =
            2.0 * level - m[0] * point_rate.norm_squared() - m[2] * virtual_rate * virtual_rate;
        Self {
            field,
            coupling_gain: params.coupling_gain,
            energy_gain: params.energy_gain,
            level,
            tank: params
                .energy_tank
                .then(|| EnergyTank::new(params.tank_start, params.tank_capacity)),
            virtual_time,
            virtual_rate,
            // A bike faster than the level allows starts with a flywheel that barely turns.
            flywheel_rate: (rest / m[3]).max(1e-6).sqrt(),
        }
    }

    /// `s`, m.
    #[must_use]
    pub fn virtual_time(&self) -> f64 {
        self.virtual_time
    }

    /// `s'`, m/s.
    #[must_use]
    pub fn virtual_rate(&self) -> f64 {
        self.virtual_rate
    }

    /// `f'`, m/s.
    #[must_use]
    pub fn flywheel_rate(&self) -> f64 {
        self.flywheel_rate
    }

    /// `k = q'^T M q'/2`, J, with the point moving at `point_rate`.
    #[must_use]
    pub fn stored_energy(&self, point_rate: Vector2) -> f64 {
        let m = self.field.inertia();
        0.5 * (m[0] * point_rate.norm_squared()
            + m[2] * self.virtual_rate * self.virtual_rate
            + m[3] * self.flywheel_rate * self.flywheel_rate)
    }

    /// Content of the energy tank, J, if there is one.
    #[must_use]
    pub fn tank(&self) -> Option<f64> {
        self.tank.as_ref().map(EnergyTank::content)
    }

    /// Goes over to another curve, on which the virtual time is `virtual_time`, m, and to its field. The motion
    /// goes on as it is; a field of more energy comes with the energy that fills it, which is returned, J.
    pub fn take_over(&mut self, field: VelocityField, virtual_time: f64) -> f64 {
        // The level is this multiple of the field's energy.
        let share = self.level / self.field.energy();
        let granted = share * (field.energy() - self.field.energy());
        if granted != 0.0 {
            self.flywheel_rate = (self.flywheel_rate * self.flywheel_rate
                + 2.0 * granted / field.inertia()[3])
                .max(0.0)
                .sqrt();
        }
        self.level = share * field.energy();
        self.field = field;
        self.virtual_time = virtual_time;
        granted
    }

    /// Sets off again after the augmented system was stopped, at `virtual_time`, m, with the virtual time moving at
    /// `virtual_rate` and the point at `point_rate`, m/s. The flywheel gets what is left of the level's energy, as far
    /// as what was stored and the tank suffice.
    pub fn resume(&mut self, virtual_time: f64, virtual_rate: f64, point_rate: Vector2) {
        let m = self.field.inertia();
        let stored = self.stored_energy(point_rate);
        let available = match &self.tank {
            Some(tank) => stored + tank.content(),
            None => f64::INFINITY,
        };
        let others = 0.5 * (m[0] * point_rate.norm_squared() + m[2] * virtual_rate * virtual_rate);
        let flywheel = (self.level.min(available) - others).max(0.0);
        self.virtual_time = virtual_time;
        self.virtual_rate = virtual_rate;
        self.flywheel_rate = (2.0 * flywheel / m[3]).max(1e-6).sqrt();
        let drawn = self.stored_energy(point_rate) - stored;
        if let Some(tank) = &mut self.tank {
            tank.draw(drawn);
        }
    }

    /// The field it moves in.
    #[must_use]
    pub fn field(&self) -> &VelocityField {
        &self.field
    }

    /// One step of `dt` seconds from the measured point, m, and its velocity, m/s. What the steering does
    /// to the point comes `lag` seconds late, so the curvature that is fed forward is that of where the
    /// virtual time will be by then.
    pub fn step(
        &mut self,
        path: &FollowedPath,
        point: Point2,
        point_rate: Vector2,
        lag: f64,
        dt: f64,
    ) -> PvfcStep {
        let mut sample = path.riding_sample(self.virtual_time);
        sample.curvature = path.curvature(self.virtual_time + self.virtual_rate * lag);
        let field = self
            .field
            .evaluate(&sample, point, point_rate, self.virtual_rate);
        let velocity = Vector4::new(
            point_rate.x,
            point_rate.y,
            self.virtual_rate,
            self.flywheel_rate,
        );
        let m = self.field.inertia();
        let energy = self.field.energy();
        let mut force = coupling_force(&m, &velocity, &field, energy, self.coupling_gain);
        let stored = self.stored_energy(point_rate);
        let wanted = -self.energy_gain * (stored - self.level) / energy * m[3] * self.flywheel_rate;
        let tank = self.tank.as_ref().map(EnergyTank::content);
        let (regulator, given_up) = match &mut self.tank {
            Some(tank) => {
                let point_and_time = force.fixed_rows::<3>(0);
                let step = Withdrawal {
                    rate: self.flywheel_rate,
                    inertia: m[3],
                    force: force[3],
                    others: point_and_time
                        .component_div(&m.fixed_rows::<3>(0))
                        .dot(&point_and_time),
                    dt,
                };
                tank.regulate(wanted, &step)
            }
            None => (wanted, 0.0),
        };
        force[3] += regulator;
        let regulator_power = regulator * self.flywheel_rate;
        let acceleration = force.component_div(&m);
        let euler_excess = 0.5 * dt * dt * force.dot(&acceleration);
        self.virtual_time += self.virtual_rate * dt + 0.5 * acceleration[2] * dt * dt;
        self.virtual_rate += acceleration[2] * dt;
        self.flywheel_rate += acceleration[3] * dt;
        PvfcStep {
            acceleration: Vector2::new(acceleration.x, acceleration.y),
            field,
            force: Vector2::new(force.x, force.y),
            stored,
            regulator_power,
            euler_excess,
            tank,
            given_up,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_coupling_does_no_work(
            q in prop::array::uniform4(-3.0f64..3.0),
            v in prop::array::uniform4(-3.0f64..3.0),
            rate in prop::array::uniform4(-3.0f64..3.0),
        ) {
            let inertia = Vector4::new(50.0, 50.0, 25.0, 25.0);
            let velocity = Vector4::from(q);
            let field = FieldValue {
                velocity: Vector4::from(v),
                rate: Vector4::from(rate),
                error: Vector2::zeros(),
            };
            let force = coupling_force(&inertia, &velocity, &field, 160.0, 0.02);
            // Terms of the order of 1e4 W cancel.
            prop_assert!(force.dot(&velocity).abs() < 1e-9);
        }

        #[test]
        fn the_energy_rises_by_the_regulator_and_the_euler_step_alone(
            x in 0.0f64..2.0, y in -0.3f64..0.3, speed in 0.2f64..1.4, heading in -0.5f64..0.5,
            tank in prop::option::of(0.0f64..1.0),
        ) {
            use crate::followed_path::RideLimits;
            use bikebot_geometry::{CurvePath, FergusonCurve};
            let path = CurvePath::new(vec![FergusonCurve::straight(
                Point2::new(0.0, 0.0),
                Point2::new(6.0, 0.0),
            )]).unwrap();
            let params = FollowParams { energy_tank: tank.is_some(), tank_start: tank.unwrap_or(0.0), ..FollowParams::default() };
            let limits = RideLimits { wheelbase: 1.12, steer_rate: 2.0, lateral_acceleration: 3.0, curvature: 0.9 };
            let path = FollowedPath::new(&path, &params, &limits, params.look_ahead).unwrap();
            let field = VelocityField::new(&params, path.speed_max());
            let mut rate = Vector2::new(speed * heading.cos(), speed * heading.sin());
            let mut point = Point2::new(x + 0.5, y);
            let mut pvfc = Pvfc::new(&params, field, x, speed, rate);
            let dt = 0.005;
            for _ in 0..200 {
                let before = pvfc.stored_energy(rate);
                let step = pvfc.step(&path, point, rate, 0.0, dt);
                // The ideal point does as it is told.
                point += rate * dt + step.acceleration * (0.5 * dt * dt);
                rate += step.acceleration * dt;
                let rise = pvfc.stored_energy(rate) - before;
                prop_assert!((rise - dt * step.regulator_power - step.euler_excess).abs() < 1e-10);
                if let (Some(then), Some(now)) = (step.tank, pvfc.tank()) {
                    // Nothing from nowhere: what the one gains the other gives, the integrator's share included.
                    prop_assert!((rise + now - then + step.given_up).abs() < 1e-10);
                    prop_assert!(now >= 0.0 && step.given_up >= 0.0, "{now}");
                }
            }
        }
    }
}
