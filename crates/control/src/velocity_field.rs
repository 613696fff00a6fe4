//! The velocity field of path following, encoded over the augmented coordinates.
//!
//! Coordinates `(P_x, P_y, s, f)`: the followed point, the virtual time (arc length along the
//! followed curve) and the angle of a fictitious flywheel. With the error `e = P - P_d(s)`, its
//! saturated version `e_s`, and tangent `t` and left normal `n` at `s`,
//!
//! ```text
//! V_P = rho t - Gamma e_s,   V_s = rho + Gamma_s e_s . t,
//! V_f = sqrt((2 E - m_p |V_P|^2 - m_s V_s^2)/m_f),
//! ```
//!
//! so the field has the constant energy `E` everywhere; the flywheel holds what the point does
//! not need. On the field the contour error decays at `Gamma`, and the virtual time waits for a
//! bike that lags.

use bikebot_geometry::{Point2, Vector2};
use nalgebra::Vector4;

use crate::followed_path::PathSample;
use crate::params::FollowParams;

/// The field with its gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityField {
    inertia: Vector4<f64>,
    contour_gain: f64,
    virtual_time_gain: f64,
    error_max: f64,
    energy: f64,
}

/// The field at one place, and its rate along the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldValue {
    /// `V`, m/s, in the order `(P_x, P_y, s, f)`.
    pub velocity: Vector4<f64>,
    /// `V'`, m/s^2.
    pub rate: Vector4<f64>,
    /// `e = P - P_d(s)`, m.
    pub error: Vector2,
}

impl VelocityField {
    /// The field of `params` for a path whose speed profile nowhere exceeds `speed_max`, m/s.
    #[must_use]
    pub fn new(params: &FollowParams, speed_max: f64) -> Self {
        let point = speed_max + params.contour_gain * params.error_max;
        let virtual_time = speed_max + params.virtual_time_gain * params.error_max;
        let needed = 0.5
            * (params.point_mass * point * point
                + params.virtual_mass * virtual_time * virtual_time);
        Self {
            inertia: Vector4::new(
                params.point_mass,
                params.point_mass,
                params.virtual_mass,
                params.flywheel_mass,
            ),
            contour_gain: params.contour_gain,
            virtual_time_gain: params.virtual_time_gain,
            error_max: params.error_max,
            energy: params.energy_margin * needed,
        }
    }

    /// The field of `params` for profiles up to `speed_max`, m/s, but with no less energy than this one.
    #[must_use]
    pub fn raised_for(&self, params: &FollowParams, speed_max: f64) -> Self {
        let field = Self::new(params, speed_max);
        if field.energy > self.energy {
            field
        } else {
            *self
        }
    }

    /// `M`, kg: the diagonal inertia of the augmented system.
    #[must_use]
    pub fn inertia(&self) -> Vector4<f64> {
        self.inertia
    }

    /// `E`, J: the field's energy.
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// The field at `point` while the path stands at `sample`; `point_rate` and `s_rate` are
    /// `P'` and `s'`, m/s.
    #[must_use]
    pub fn evaluate(
        &self,
        sample: &PathSample,
        point: Point2,
        point_rate: Vector2,
        s_rate: f64,
    ) -> FieldValue {
        let (sin, cos) = sample.heading.sin_cos();
        let (t, n) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
        let (rho, rho_rate) = (sample.speed, sample.speed_slope * s_rate);
        let error = point - sample.position;
        let error_rate = point_rate - t * s_rate;
        let distance = error.norm();
        let (held, held_rate) = if distance > self.error_max {
            let u = error / distance;
            (
                u * self.error_max,
                (error_rate - u * u.dot(&error_rate)) * (self.error_max / distance),
            )
        } else {
            (error, error_rate)
        };
        let turning = sample.curvature * s_rate;
        let v_p = t * rho - held * self.contour_gain;
        let v_s = rho + self.virtual_time_gain * held.dot(&t);
        let v_p_rate = t * rho_rate + n * (rho * turning) - held_rate * self.contour_gain;
        let v_s_rate =
            rho_rate + self.virtual_time_gain * (held_rate.dot(&t) + held.dot(&n) * turning);
        let (m_p, m_s, m_f) = (self.inertia[0], self.inertia[2], self.inertia[3]);
        // The energy margin keeps this positive wherever rho stays below the maximum it was built for.
        let v_f = ((2.0 * self.energy - m_p * v_p.norm_squared() - m_s * v_s * v_s) / m_f)
            .max(1e-6)
            .sqrt();
        let v_f_rate = -(m_p * v_p.dot(&v_p_rate) + m_s * v_s * v_s_rate) / (m_f * v_f);
        FieldValue {
            velocity: Vector4::new(v_p.x, v_p.y, v_s, v_f),
            rate: Vector4::new(v_p_rate.x, v_p_rate.y, v_s_rate, v_f_rate),
            error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Point2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn holds_the_same_energy_everywhere(
            x in -2.0f64..2.0, y in -2.0f64..2.0, heading in -4.0f64..4.0,
            curvature in -0.8f64..0.8, speed in 0.0f64..1.5, slope in -1.0f64..1.0,
            vx in -1.0f64..1.0, vy in -1.0f64..1.0, s_rate in 0.0f64..1.5,
        ) {
            let field = VelocityField::new(&FollowParams::default(), 1.5);
            let sample = PathSample {
                position: Point2::new(0.1, -0.2), heading, curvature, speed, speed_slope: slope,
            };
            let v = field.evaluate(&sample, Point2::new(x, y), Vector2::new(vx, vy), s_rate);
            let m = field.inertia();
            let energy = 0.5 * v.velocity.dot(&m.component_mul(&v.velocity));
            prop_assert!((energy - field.energy()).abs() < 1e-10 * field.energy());
            // And keeps it: V' is tangent to the sphere of that energy.
            prop_assert!(v.velocity.dot(&m.component_mul(&v.rate)).abs() < 1e-9);
        }
    }

    #[test]
    fn pulls_no_harder_beyond_the_saturation_distance() {
        let field = VelocityField::new(&FollowParams::default(), 1.5);
        let sample = PathSample {
            position: Point2::origin(),
            heading: 0.0,
            curvature: 0.0,
            speed: 1.0,
            speed_slope: 0.0,
        };
        let at = |y: f64| {
            field
                .evaluate(&sample, Point2::new(0.0, y), Vector2::zeros(), 1.0)
                .velocity[1]
        };
        assert!((at(0.3) + 1.2 * 0.3).abs() < 1e-15);
        assert!((at(3.0) + 1.2 * 0.5).abs() < 1e-15);
    }
}
