//! The one thing every controller does: read the sensors, answer with a command.

use bikebot_dynamics::Measurement;

use crate::error::ControlError;

/// A sampled controller, called once a control period.
pub trait Controller {
    /// What it answers with.
    type Output;

    /// Advances the controller by one period and returns its answer.
    ///
    /// # Errors
    ///
    /// When the measurement is not finite.
    fn tick(&mut self, measurement: &Measurement) -> Result<Self::Output, ControlError>;
}

/// Refuses measurements that are not finite, naming the first offender.
pub(crate) fn check_finite(m: &Measurement) -> Result<(), ControlError> {
    for (quantity, value) in [
        ("x", m.pose.position.x),
        ("y", m.pose.position.y),
        ("heading", m.pose.heading),
        ("speed", m.speed),
        ("steering angle", m.steer),
        ("steering rate", m.steer_rate),
        ("roll", m.roll),
        ("roll rate", m.roll_rate),
        ("balancer angle", m.balancer),
        ("balancer rate", m.balancer_rate),
    ] {
        if !value.is_finite() {
            return Err(ControlError::NotFinite { quantity, value });
        }
    }
    Ok(())
}
