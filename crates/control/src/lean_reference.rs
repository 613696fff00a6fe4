//! The lean a coming turn asks for.
//!
//! A balancer cannot hold the moment of a turn, so the body must already lean when the turn
//! comes. The reference that needs no balancer torque obeys
//! `alpha_ref'' = lambda^2 (alpha_ref - alpha_eq(t))`; its bounded solution is a preview and a
//! filter, the same split as the divergent component of motion in walking robots:
//!
//! ```text
//! xi_ref(t) = lambda integral_0^inf exp(-lambda s) alpha_eq(t + s) ds,
//! alpha_ref' = lambda (xi_ref - alpha_ref).
//! ```
//!
//! `alpha_eq(t + s)` comes from rolling the kinematics of the followed point along the curve.

use bikebot_geometry::Pose2;

use crate::followed_path::FollowedPath;
use crate::output_zeroing::OutputReference;
use crate::params::BalanceParams;
use crate::roll_model::RollModel;

/// Speeds blend from the present one to the profile over this many steps.
const BLEND_STEPS: usize = 8;
/// Least speed at which a yaw-rate mismatch decays, m/s.
const MISMATCH_SPEED: f64 = 0.3;

/// The plane motion of the bike as the preview starts from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneMotion {
    /// Pose of the rear contact.
    pub pose: Pose2,
    /// `v`, m/s.
    pub speed: f64,
    /// `omega`, rad/s.
    pub yaw_rate: f64,
    /// `omega'`, rad/s^2.
    pub yaw_acceleration: f64,
}

/// Preview and filter of the lean reference.
#[derive(Debug, Clone, PartialEq)]
pub struct LeanReference {
    enabled: bool,
    step: f64,
    /// `exp(-lambda i h) (1 - exp(-lambda h))`.
    weights: Vec<f64>,
    rate: f64,
    look_ahead: f64,
    period: u32,
    ticks: u32,
    divergent: f64,
    lean: f64,
}

impl LeanReference {
    /// Starts at the present lean `lean`, rad, so that switching on makes no step.
    #[must_use]
    pub fn new(params: &BalanceParams, model: &RollModel, look_ahead: f64, lean: f64) -> Self {
        let mut reference = Self {
            enabled: params.preview,
            step: params.preview_step,
            weights: vec![0.0; params.preview_steps.max(1) as usize],
            rate: 0.0,
            look_ahead,
            period: params.preview_ticks.max(1),
            ticks: 0,
            divergent: lean,
            lean,
        };
        reference.set_model(model);
        reference
    }

    /// Takes over the toppling rate of a model whose offset has moved. Does not allocate.
    pub fn set_model(&mut self, model: &RollModel) {
        let rate = model.toppling_rate();
        if rate == self.rate {
            return;
        }
        self.rate = rate;
        let decay = (-rate * self.step).exp();
        let mut weight = 1.0 - decay;
        for w in &mut self.weights {
            *w = weight;
            weight *= decay;
        }
    }

    /// `xi_ref`, rad: the divergent component the body should have.
    #[must_use]
    pub fn divergent(&self) -> f64 {
        self.divergent
    }

    /// `alpha_ref`, rad.
    #[must_use]
    pub fn lean(&self) -> f64 {
        self.lean
    }

    /// Looks ahead on every `preview_ticks`-th call, from virtual time `s`, m.
    pub fn look(&mut self, model: &RollModel, path: &FollowedPath, motion: &PlaneMotion, s: f64) {
        if !self.enabled {
            // Nothing is known of the coming yaw acceleration, and the present one is over too soon to lean for.
            self.divergent = model.equilibrium_lean(motion.speed * motion.yaw_rate, 0.0);
            return;
        }
        if self.ticks == 0 {
            self.divergent = self.preview(model, path, motion, s);
        }
        self.ticks = (self.ticks + 1) % self.period;
    }

    /// No turn is coming: the bike stands.
    pub fn look_at_nothing(&mut self) {
        self.divergent = 0.0;
    }

    /// Reference for this tick, given `alpha_eq` of the present motion; then advances by `dt` seconds.
    pub fn tick(&mut self, equilibrium: f64, dt: f64) -> OutputReference {
        let l2 = self.rate * self.rate;
        let p1 = self.rate * (self.divergent - self.lean);
        let p2 = l2 * (self.lean - equilibrium);
        let reference = OutputReference {
            value: self.lean,
            derivatives: [p1, p2, l2 * p1, l2 * p2],
        };
        self.lean += p1 * dt;
        reference
    }

    fn preview(&self, model: &RollModel, path: &FollowedPath, motion: &PlaneMotion, s: f64) -> f64 {
        let (h, ell) = (self.step, self.look_ahead);
        let mut heading = motion.pose.heading;
        let mut place = s;
        let present = motion.speed.hypot(ell * motion.yaw_rate);
        let mut before = motion.yaw_rate;
        let mut mismatch = 0.0;
        let mut xi = 0.0;
        for (i, weight) in self.weights.iter().enumerate() {
            let sample = path.riding_sample(place);
            let speed = if i > BLEND_STEPS {
                sample.speed
            } else {
                present + (sample.speed - present) * i as f64 / BLEND_STEPS as f64
            };
            let (sin, cos) = (sample.heading - heading).sin_cos();
            let mut yaw_rate = speed * sin / ell;
            if i == 0 {
                mismatch = motion.yaw_rate - yaw_rate;
            }
            yaw_rate += mismatch * (-(i as f64) * h * speed.max(MISMATCH_SPEED) / ell).exp();
            let yaw_acceleration = if i == 0 {
                motion.yaw_acceleration
            } else {
                (yaw_rate - before) / h
            };
            before = yaw_rate;
            xi += weight * model.equilibrium_lean(speed * cos * yaw_rate, yaw_acceleration);
            heading += yaw_rate * h;
            place += speed * h;
        }
        xi
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::followed_path::RideLimits;
    use crate::params::{FollowParams, Track};
    use bikebot_dynamics::BikeParams;
    use bikebot_geometry::{CurvePath, FergusonCurve, Point2};

    fn reference(params: &BalanceParams) -> (LeanReference, RollModel) {
        let model = RollModel::new(&BikeParams::default(), 0.0);
        (LeanReference::new(params, &model, 0.5, 0.0), model)
    }

    fn straight() -> FollowedPath {
        let path = CurvePath::new(vec![FergusonCurve::straight(
            Point2::origin(),
            Point2::new(50.0, 0.0),
        )])
        .unwrap();
        let limits = RideLimits {
            wheelbase: 1.12,
            steer_rate: 2.0,
            lateral_acceleration: 3.0,
        };
        let params = FollowParams {
            track: Track::LookAheadPoint,
            ..FollowParams::default()
        };
        FollowedPath::new(&path, &params, &limits).unwrap()
    }

    #[test]
    fn a_straight_asks_for_no_lean() {
        let (mut lean, model) = reference(&BalanceParams::default());
        let motion = PlaneMotion {
            pose: Pose2::new(10.0, 0.0, 0.0),
            speed: 1.5,
            yaw_rate: 0.0,
            yaw_acceleration: 0.0,
        };
        lean.look(&model, &straight(), &motion, 10.5);
        assert!(lean.divergent().abs() < 1e-12);
    }

    #[test]
    fn weights_sum_to_the_share_of_the_integral_they_cover() {
        let (lean, model) = reference(&BalanceParams::default());
        let sum: f64 = lean.weights.iter().sum();
        // A geometric series: 1 - exp(-lambda N h).
        assert!((sum - (1.0 - (-model.toppling_rate() * 45.0 * 0.04).exp())).abs() < 1e-12);
    }

    #[test]
    fn the_filter_settles_on_a_steady_turn_and_its_derivatives_are_its_own() {
        let (mut lean, model) = reference(&BalanceParams {
            preview: false,
            ..BalanceParams::default()
        });
        let motion = PlaneMotion {
            pose: Pose2::new(10.0, 0.0, 0.0),
            speed: 1.2,
            yaw_rate: 0.5,
            yaw_acceleration: 0.0,
        };
        let equilibrium = model.equilibrium_lean(0.6, 0.0);
        let path = straight();
        let dt = 0.0005;
        let mut before: Option<OutputReference> = None;
        for tick in 0..8000 {
            lean.look(&model, &path, &motion, 10.5);
            let now = lean.tick(equilibrium, dt);
            if let Some(last) = before {
                // Explicit Euler: the value moves by exactly its stated rate.
                assert!((now.value - last.value - dt * last.derivatives[0]).abs() < 1e-15);
                if tick > 1 {
                    let second = (now.derivatives[0] - last.derivatives[0]) / dt;
                    // First-order difference over half a millisecond of signals below 1 rad/s^3.
                    assert!((second - last.derivatives[1]).abs() < 2e-3);
                }
            }
            before = Some(now);
        }
        assert!((lean.lean() - equilibrium).abs() < 1e-5);
    }
}
