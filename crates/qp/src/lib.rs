//! Small and banded convex quadratic programmes, allocation-free once set up.
//!
//! ```text
//!     minimise  ½ xᵀHx + gᵀx + Σ ρ_k e_k
//!     subject to  a_k·x ≤ b_k + e_k, e_k ≥ 0   (elastic rows: violation at the price ρ_k)
//!                 a_k·x ≤ b_k                  (hard rows)
//!                 A x = c                      (equalities)
//! ```
//!
//! * [`BandedQp`]: H a positive definite band and rows on windows of it; hundreds of unknowns.
//!   Refines
//!   splines.
//! * [`DenseQp`]: H positive semidefinite and dense, with boxes; some forty unknowns. Predictive
//!   control within a tick.
//!
//! Both run the same primal–dual interior point with Mehrotra's predictor and corrector
//! (`interior_point`), with elastic rows eliminated by hand (`row`), equalities met exactly through
//! a small Schur complement (`equalities`), and the problem scaled by powers of two (`scaling`).
//! Room is made when a solver is constructed; refilling and solving take no memory. Nothing is
//! random and nothing depends on threads or time: the same problem gives the same bits.
//!
//! How a solve ended is a [`Status`], in the [`Summary`]; input that makes no sense is a
//! [`QpError`] from the call that gave it. All quantities are in the caller's own units.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used))]

mod answer;
mod banded;
mod dense;
mod equalities;
mod error;
mod interior_point;
mod outcome;
mod row;
mod scaling;

pub use banded::BandedQp;
pub use dense::DenseQp;
pub use error::QpError;
pub use outcome::{Breakdown, Settings, Status, Summary};
