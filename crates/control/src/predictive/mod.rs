//! Saturation-aware balance: predictive control over about a second, solved in the tick.
//!
//! A law that is only clipped spends what it does not have. This one looks at the roll ahead of it
//! (`prediction`) and chooses twelve balancer torques, and where steering may help six steering
//! rates, that minimise
//!
//! ```text
//! integral( q_e e^2 + q_b beta^2 + q_n beta'^2 + w^2 ) dt + z' P z
//! ```
//!
//! (`e = p - s beta` the lean without the balancer's ripple, `w = beta''`, `P` the cost to go of the
//! unconstrained law) subject to the torque limit, and at a price to the speed limit and to the
//! *capture* of the divergent component: at the end of the horizon `xi = e + e'/lambda` must be what
//! the speed still in hand can stop. With a price on every limit
//! but the torque the programme always has a solution: where nothing can save the bike it is full
//! torque into the fall, which is then also the best there is.
//!
//! One quadratic programme is solved per tick, linearised about the motion that the torques of the
//! tick before would give. It is written about the lean reference: in the frame that leans with it
//! a turn is no turn, and what is left of its moment is given as a constant.

mod prediction;
mod programme;

pub use prediction::{SteeringRoom, Trouble};
pub use programme::{Predicted, Predictive};
