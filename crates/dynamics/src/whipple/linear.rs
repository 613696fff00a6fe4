//! The linear equations `M q̈ + v C1 q̇ + (g K0 + v² K2) q = f` and their spectrum — Meijaard et al. (2007),
//! Appendix A; design note §5.4.

use super::params::WhippleParams;
use crate::error::DynamicsError;
use nalgebra::{Complex, Matrix2, Matrix4, Schur};

/// Rounds of QR iteration before the eigenvalues count as not found; a 4 × 4 matrix takes about ten.
const QR_ROUNDS: usize = 1000;

/// The linear Whipple bicycle: its four matrices in the coordinates (lean, steer).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whipple {
    /// `M`: kg m².
    pub mass: Matrix2<f64>,
    /// `C1`: damping per speed, kg m.
    pub damping: Matrix2<f64>,
    /// `K0`: stiffness per gravity, kg m.
    pub gravity_stiffness: Matrix2<f64>,
    /// `K2`: stiffness per speed squared, kg.
    pub speed_stiffness: Matrix2<f64>,
    /// `g`, m/s².
    pub gravity: f64,
}

impl Whipple {
    /// The matrices of a bicycle.
    ///
    /// # Errors
    ///
    /// As [`WhippleParams::check`]; and where the mass matrix is not positive definite, as of a front assembly
    /// without any inertia about the steering axis.
    pub fn new(params: &WhippleParams) -> Result<Self, DynamicsError> {
        params.check()?;
        Self::unchecked(params)
    }

    /// The matrices of a set that has been checked, or of one a rounding away from it.
    pub(super) fn unchecked(params: &WhippleParams) -> Result<Self, DynamicsError> {
        let WhippleParams {
            wheelbase: w,
            trail: c,
            tilt,
            gravity,
            ..
        } = *params;
        let (r, b, h, f) = (
            &params.rear_wheel,
            &params.rear_frame,
            &params.front_frame,
            &params.front_wheel,
        );
        let (sin, cos) = tilt.sin_cos();

        // T: the whole bicycle. A wheel's moment about the vertical is the one about a diameter.
        let m_t = params.mass();
        let x_t = (b.mass * b.x + h.mass * h.x + f.mass * w) / m_t;
        let z_t = (-r.mass * r.radius + b.mass * b.z + h.mass * h.z - f.mass * f.radius) / m_t;
        let i_txx = r.ixx
            + b.ixx
            + h.ixx
            + f.ixx
            + r.mass * r.radius.powi(2)
            + b.mass * b.z.powi(2)
            + h.mass * h.z.powi(2)
            + f.mass * f.radius.powi(2);
        let i_txz = b.ixz + h.ixz - b.mass * b.x * b.z - h.mass * h.x * h.z + f.mass * w * f.radius;
        let i_tzz = r.ixx
            + b.izz
            + h.izz
            + f.ixx
            + b.mass * b.x.powi(2)
            + h.mass * h.x.powi(2)
            + f.mass * w.powi(2);

        // A: the front assembly, H and F. Without mass it has no centre; its moments are then zero wherever.
        let m_a = h.mass + f.mass;
        let (x_a, z_a) = if m_a > 0.0 {
            (
                (h.mass * h.x + f.mass * w) / m_a,
                (h.mass * h.z - f.mass * f.radius) / m_a,
            )
        } else {
            (w, 0.0)
        };
        let i_axx =
            h.ixx + f.ixx + h.mass * (h.z - z_a).powi(2) + f.mass * (f.radius + z_a).powi(2);
        let i_axz =
            h.ixz - h.mass * (h.x - x_a) * (h.z - z_a) + f.mass * (w - x_a) * (f.radius + z_a);
        let i_azz = h.izz + f.ixx + h.mass * (h.x - x_a).powi(2) + f.mass * (w - x_a).powi(2);
        // Distance of its centre ahead of the steering axis, and its moments about that axis.
        let u_a = (x_a - w - c) * cos - z_a * sin;
        let i_all =
            m_a * u_a.powi(2) + i_axx * sin.powi(2) + 2.0 * i_axz * sin * cos + i_azz * cos.powi(2);
        let i_alx = -m_a * u_a * z_a + i_axx * sin + i_axz * cos;
        let i_alz = m_a * u_a * x_a + i_axz * sin + i_azz * cos;

        // Ratio of the mechanical trail to the wheelbase, gyrostatic coefficients, static moment.
        let mu = c * cos / w;
        let s_r = r.iyy / r.radius;
        let s_f = f.iyy / f.radius;
        let s_t = s_r + s_f;
        let s_a = m_a * u_a + mu * m_t * x_t;

        let m_ld = i_alx + mu * i_txz;
        let m_dd = i_all + 2.0 * mu * i_alz + mu * mu * i_tzz;
        let model = Self {
            mass: Matrix2::new(i_txx, m_ld, m_ld, m_dd),
            damping: Matrix2::new(
                0.0,
                mu * s_t + s_f * cos + i_txz * cos / w - mu * m_t * z_t,
                -(mu * s_t + s_f * cos),
                i_alz * cos / w + mu * (s_a + i_tzz * cos / w),
            ),
            gravity_stiffness: Matrix2::new(m_t * z_t, -s_a, -s_a, -s_a * sin),
            speed_stiffness: Matrix2::new(
                0.0,
                (s_t - m_t * z_t) * cos / w,
                0.0,
                (s_a + s_f * sin) * cos / w,
            ),
            gravity,
        };
        let determinant = model.mass.determinant();
        let is_definite = i_txx > 0.0 && determinant > 1e-14 * i_txx * m_dd.abs();
        if !is_definite {
            return Err(DynamicsError::ImpossibleBicycle {
                what: "det M".into(),
                value: determinant,
                unit: "kg² m⁴",
                bound: "above 0".into(),
                reason: "lean and steer both need inertia; the front assembly has none about the steering axis"
                    .into(),
            });
        }
        Ok(model)
    }

    /// The stiffness `g K0 + v² K2` at speed `v` (m/s), N m.
    #[must_use]
    pub fn stiffness(&self, speed: f64) -> Matrix2<f64> {
        self.gravity_stiffness * self.gravity + self.speed_stiffness * (speed * speed)
    }

    /// The matrix `A` of `ẋ = A x`, x = (lean, steer, lean rate, steer rate), at speed `v` (m/s).
    #[must_use]
    pub fn state_matrix(&self, speed: f64) -> Matrix4<f64> {
        // M is 2 × 2 and positive definite, by `new`: Cramer's rule.
        let m = &self.mass;
        let inverse = Matrix2::new(m[(1, 1)], -m[(0, 1)], -m[(1, 0)], m[(0, 0)]) / m.determinant();
        let stiffness = -(inverse * self.stiffness(speed));
        let damping = -(inverse * self.damping * speed);
        let mut a = Matrix4::zeros();
        a[(0, 2)] = 1.0;
        a[(1, 3)] = 1.0;
        a.fixed_view_mut::<2, 2>(2, 0).copy_from(&stiffness);
        a.fixed_view_mut::<2, 2>(2, 2).copy_from(&damping);
        a
    }

    /// The four eigenvalues at speed `v` (m/s), 1/s, sorted by real, then imaginary part.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::NoEigenvalues`] at a speed so large that the matrix overflows.
    pub fn eigenvalues(&self, speed: f64) -> Result<[Complex<f64>; 4], DynamicsError> {
        let a = self.state_matrix(speed);
        let refused = DynamicsError::NoEigenvalues { speed };
        if !a.iter().all(|element| element.is_finite()) {
            return Err(refused);
        }
        let schur = Schur::try_new(a, f64::EPSILON, QR_ROUNDS).ok_or(refused)?;
        let found = schur.complex_eigenvalues();
        let mut values = [found[0], found[1], found[2], found[3]];
        values.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
        Ok(values)
    }

    /// The coefficients of `det(M λ² + v C1 λ + g K0 + v² K2)`, of λ⁰ first, at speed `v` (m/s).
    #[must_use]
    pub fn characteristic(&self, speed: f64) -> [f64; 5] {
        let (m, k) = (&self.mass, self.stiffness(speed));
        let c = self.damping * speed;
        [
            k.determinant(),
            mixed_determinant(&c, &k),
            mixed_determinant(m, &k) + c.determinant(),
            mixed_determinant(m, &c),
            m.determinant(),
        ]
    }
}

/// The part of `det(a + b)` that is linear in both.
pub(super) fn mixed_determinant(a: &Matrix2<f64>, b: &Matrix2<f64>) -> f64 {
    a[(0, 0)] * b[(1, 1)] + b[(0, 0)] * a[(1, 1)] - a[(0, 1)] * b[(1, 0)] - b[(0, 1)] * a[(1, 0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_massless_front_assembly_is_refused() {
        let mut params = WhippleParams::benchmark();
        params.front_frame.mass = 0.0;
        params.front_wheel.mass = 0.0;
        for inertia in [
            &mut params.front_frame.ixx,
            &mut params.front_frame.iyy,
            &mut params.front_frame.izz,
            &mut params.front_frame.ixz,
            &mut params.front_wheel.ixx,
            &mut params.front_wheel.iyy,
        ] {
            *inertia = 0.0;
        }
        params.trail = 0.0;
        let text = Whipple::new(&params).unwrap_err().to_string();
        assert!(
            text.contains("det M = 0") && text.contains("steering axis"),
            "{text}"
        );
    }

    #[test]
    fn the_characteristic_polynomial_vanishes_at_the_eigenvalues() {
        let bicycle = Whipple::new(&WhippleParams::benchmark()).unwrap();
        for speed in [0.0, 0.4, 3.0, 5.0, 12.0] {
            let a = bicycle.characteristic(speed);
            for value in bicycle.eigenvalues(speed).unwrap() {
                let terms: Vec<_> = (0..5).map(|i| value.powi(i) * a[i as usize]).collect();
                let sum: Complex<f64> = terms.iter().sum();
                let size: f64 = terms.iter().map(|term| term.norm()).sum();
                // A backward stable eigenvalue: the residual is rounding beside the terms it is the sum of.
                assert!(sum.norm() < 1e-12 * size, "{speed} m/s: {sum} of {size}");
            }
        }
    }

    #[test]
    fn standing_still_the_spectrum_is_symmetric() {
        let bicycle = Whipple::new(&WhippleParams::benchmark()).unwrap();
        let values = bicycle.eigenvalues(0.0).unwrap();
        for i in 0..2 {
            assert!((values[i] + values[3 - i]).norm() < 1e-12);
        }
    }

    #[test]
    fn a_speed_beyond_all_numbers_is_an_error() {
        let bicycle = Whipple::new(&WhippleParams::benchmark()).unwrap();
        for speed in [1e200, f64::NAN, f64::INFINITY] {
            assert!(bicycle.eigenvalues(speed).is_err());
        }
    }
}
