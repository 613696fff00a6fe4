//! Scenario, closed loop, recorder, sweeps.
