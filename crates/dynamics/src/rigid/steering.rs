//! The handlebar's angle and the angle at which the front wheel crosses the ground.
//!
//! A frame that leans and pitches carries a tilted steering axis; what the bike does depends on the line in
//! which the front wheel's plane meets the ground. Both ways have a closed form, because the front axle is a
//! fixed vector turned about the steering axis.

use nalgebra::{Rotation3, Vector3};

/// The front axle of a frame at roll `α` and pitch, as `A cos δ + B sin δ` in the heading frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrontAxle {
    a: Vector3<f64>,
    b: Vector3<f64>,
}

impl FrontAxle {
    /// For a frame at `roll` and `pitch` (rad, nose down positive) with a steering axis `axis` in its own frame.
    pub(crate) fn new(roll: f64, pitch: f64, axis: &Vector3<f64>) -> Self {
        let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), roll)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
        Self {
            a: turn * Vector3::y(),
            b: turn * axis.cross(&Vector3::y()),
        }
    }

    /// The handlebar angle (rad) at which the wheel crosses the ground at `ground` (rad).
    pub(crate) fn handlebar(&self, ground: f64) -> f64 {
        let (sin, cos) = ground.sin_cos();
        // The ground line's forward direction (cos ψ, sin ψ) is at right angles to the axle.
        let straight = self.a.x * cos + self.a.y * sin;
        let turned = self.b.x * cos + self.b.y * sin;
        (-straight / turned).atan()
    }
}

/// Direction (rad, about z from x) of the line in which the plane of a wheel with this axle meets the ground.
pub(crate) fn ground_line(axle: &Vector3<f64>) -> f64 {
    (-axle.x).atan2(axle.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ground-projected angle at handlebar angle `δ`.
    fn ground_angle(axle: &FrontAxle, handlebar: f64) -> f64 {
        ground_line(&(axle.a * handlebar.cos() + axle.b * handlebar.sin()))
    }

    #[test]
    fn on_a_vertical_axis_the_design_notes_formula_holds() {
        // ψ_h = atan(tan ψ cos α) for an axis fixed to the leaning frame.
        for roll in [-0.3, 0.0, 0.2] {
            let axle = FrontAxle::new(roll, 0.0, &Vector3::z());
            for ground in [-0.7, -0.1, 0.0, 0.4] {
                let handlebar = axle.handlebar(ground);
                let expected = (f64::tan(ground) * f64::cos(roll)).atan();
                assert!((handlebar - expected).abs() < 1e-15, "{roll} {ground}");
                assert!((ground_angle(&axle, handlebar) - ground).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_tilted_axis_needs_more_handlebar_for_the_same_turn() {
        // Upright: tan ψ = tan δ cos λ.
        let tilt = 0.35_f64;
        let axis = Vector3::new(-tilt.sin(), 0.0, tilt.cos());
        let axle = FrontAxle::new(0.0, 0.0, &axis);
        let handlebar = axle.handlebar(0.3);
        assert!((handlebar.tan() * tilt.cos() - 0.3_f64.tan()).abs() < 1e-15);
        // And leaning, it still finds its way back.
        let leaning = FrontAxle::new(-0.2, 0.01, &axis);
        for ground in [-0.6, 0.0, 0.5] {
            let back = ground_angle(&leaning, leaning.handlebar(ground));
            assert!((back - ground).abs() < 1e-14);
        }
    }
}
