//! The Whipple bicycle: the linear reference every other plant is judged by.
//!
//! Four rigid bodies (rear wheel R, rear frame with rider B, handlebar and fork H, front wheel F), knife-edge
//! wheels that roll without slip, and a tilted steering axis with trail; riding straight ahead at constant speed.
//! The equations are those of Meijaard, Papadopoulos, Ruina and Schwab, *Linearized dynamics equations for the
//! balance and steer of a bicycle: a benchmark and review*, Proc. R. Soc. A 463 (2007):
//!
//! ```text
//! M q̈ + v C1 q̇ + (g K0 + v² K2) q = f,     q = (lean, steer)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`params`] | the 25 parameters, their bounds, and what no bicycle can be |
//! | [`linear`] | `M, C1, K0, K2`, the state matrix, the characteristic polynomial, eigenvalues |
//! | [`critical`] | weave and capsize speed, from Routh's condition in closed form |
//! | [`modes`] | eigenvalues by name — weave, capsize, caster — followed over speed |
//! | [`parameter_file`] | parameter files in the text formats of the BicycleParameters collection |
//! | [`from_bike`] | the bike robot, balancer locked, as a Whipple bicycle |
//!
//! Frame and signs are the paper's, **not** those of the rest of this crate: x forward from the rear contact,
//! y to the right, **z down**, so that what lies above the ground has `z < 0`. Lean and steer are positive to the
//! right: `lean = α`, `steer = −ψ` in the signs of `docs/frames.md`.

pub mod critical;
pub mod from_bike;
pub mod linear;
pub mod modes;
pub mod parameter_file;
pub mod params;

pub use critical::{CriticalSpeeds, SpeedRange};
pub use from_bike::{SteeringAssembly, WheelInertia};
pub use linear::Whipple;
pub use modes::{Mode, Modes};
pub use parameter_file::{ParameterFile, ParameterFileError};
pub use params::{FrameBody, PARAMETERS, Parameter, WheelBody, WhippleParams};
