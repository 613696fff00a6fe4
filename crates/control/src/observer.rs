//! Two disturbance observers: what pushes the bike over, and what slows it down.
//!
//! Each is a second-order observer with a double pole. They are what lets the static
//! laws ride a slope, a gust or a biased roll sensor without a steady error.

/// Estimates a constant roll moment from the angular momentum about the contact line:
/// `sigma_hat' = G + T_hat + 2 q (sigma - sigma_hat)`, `T_hat' = q^2 (sigma - sigma_hat)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RollMomentObserver {
    rate: f64,
    limit: f64,
    momentum: Option<f64>,
    moment: f64,
}

impl RollMomentObserver {
    /// With double pole at `-rate`, 1/s, and the estimate held within `limit`, N m.
    #[must_use]
    pub fn new(rate: f64, limit: f64) -> Self {
        Self {
            rate,
            limit,
            momentum: None,
            moment: 0.0,
        }
    }

    /// `T_hat`, N m.
    #[must_use]
    pub fn moment(&self) -> f64 {
        self.moment
    }

    /// One step of `dt` seconds with the measured momentum `sigma`, kg m^2/s, and the
    /// modelled roll moment, N m. The first call only takes the momentum over.
    pub fn update(&mut self, momentum: f64, modelled_moment: f64, dt: f64) {
        let estimate = self.momentum.unwrap_or(momentum);
        let innovation = momentum - estimate;
        self.momentum =
            Some(estimate + dt * (modelled_moment + self.moment + 2.0 * self.rate * innovation));
        self.moment =
            (self.moment + dt * self.rate * self.rate * innovation).clamp(-self.limit, self.limit);
    }
}

/// Estimates the acceleration the drive did not ask for (slope, drag, lean terms):
/// `v_hat' = F/m + d_hat + 2 w_o (v - v_hat)`, `d_hat' = w_o^2 (v - v_hat)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveObserver {
    rate: f64,
    speed: Option<f64>,
    acceleration: f64,
}

impl DriveObserver {
    /// With double pole at `-rate`, 1/s.
    #[must_use]
    pub fn new(rate: f64) -> Self {
        Self {
            rate,
            speed: None,
            acceleration: 0.0,
        }
    }

    /// `d_hat`, m/s^2.
    #[must_use]
    pub fn acceleration(&self) -> f64 {
        self.acceleration
    }

    /// One step of `dt` seconds with the measured speed, m/s, and `F/m` of the force that
    /// is really applied, m/s^2.
    pub fn update(&mut self, speed: f64, specific_force: f64, dt: f64) {
        let estimate = self.speed.unwrap_or(speed);
        let innovation = speed - estimate;
        self.speed = Some(
            estimate + dt * (specific_force + self.acceleration + 2.0 * self.rate * innovation),
        );
        self.acceleration += dt * self.rate * self.rate * innovation;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_a_constant_moment() {
        let mut observer = RollMomentObserver::new(1.0, 25.0);
        let (mut sigma, dt) = (0.3, 0.005);
        for _ in 0..4000 {
            observer.update(sigma, -2.0, dt);
            sigma += dt * (-2.0 + 5.0);
        }
        // Twenty time constants of a double pole leave 21 exp(-20) of the step.
        assert!((observer.moment() - 5.0).abs() < 1e-6);
    }

    #[test]
    fn holds_the_moment_within_its_limit() {
        let mut observer = RollMomentObserver::new(1.0, 25.0);
        let mut sigma = 0.0;
        for _ in 0..4000 {
            observer.update(sigma, 0.0, 0.005);
            sigma += 0.005 * 100.0;
        }
        assert!((observer.moment() - 25.0).abs() < 1e-12);
    }

    #[test]
    fn finds_the_acceleration_of_a_slope() {
        let mut observer = DriveObserver::new(4.0);
        let (mut v, dt) = (1.0, 0.005);
        for _ in 0..2000 {
            observer.update(v, 0.2, dt);
            v += dt * (0.2 - 0.49);
        }
        assert!((observer.acceleration() + 0.49).abs() < 1e-6);
    }
}
