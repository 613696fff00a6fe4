//! Scenario, closed loop, recorder, sweeps.

pub mod clock;
pub mod record;
