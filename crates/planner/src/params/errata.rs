//! Where the paper is in doubt: what a method is to make of it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where a path may end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GoalMode {
    /// At the goal itself, with its heading if it has one.
    #[default]
    Pose,
    /// Anywhere in the ball of the goal's tolerance, with any heading: as printed.
    Ball,
}

/// Magnitude `k` of the tangents at both ends of a Ferguson curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TangentRule {
    /// The distance between the ends.
    Chord,
    /// The distance divided by cos²(Δθ/4): the magnitude that turns the curve into almost a circular arc.
    #[default]
    ChordSec2,
    /// The fixed `tangent_speed_m`, as printed.
    Constant,
}

/// What an edge costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CostRule {
    /// Eq. (5): the bending term is divided by the square of each edge's own length.
    #[default]
    Printed,
    /// The bending term is divided by the square of the step ε, so that cutting a curve in two leaves its cost.
    Additive,
}

/// The slips of Algorithm 1, each to be undone on its own. `true` is the corrected reading.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Errata {
    /// Lines 11 and 19 print SplineCurve(x_new, x_near), from the new node to the old one. Corrected, curves run from
    /// parent to child, in the direction of travel.
    pub curves_run_from_parent_to_child: bool,
    /// Eq. (1) and (2) print the weight (1 - d/w) halved twice over, (1 - d)/(2w). Corrected, it is (1 - d/w)/2, which makes
    /// the heading continuous along the guide, and headings blend along the shorter arc.
    pub continuous_heading_prior: bool,
    /// The listing keeps the heading that was drawn before Steer moved the sample. Corrected, it is drawn again
    /// where the node ends up.
    pub heading_drawn_after_steer: bool,
    /// Line 34 returns at the first arrival. Corrected, the search runs its n iterations and returns the cheapest path.
    pub run_all_iterations: bool,
}

impl Errata {
    /// Every slip corrected.
    #[must_use]
    pub fn corrected() -> Self {
        Self {
            curves_run_from_parent_to_child: true,
            continuous_heading_prior: true,
            heading_drawn_after_steer: true,
            run_all_iterations: true,
        }
    }

    /// As printed.
    #[must_use]
    pub fn as_printed() -> Self {
        Self {
            curves_run_from_parent_to_child: false,
            continuous_heading_prior: false,
            heading_drawn_after_steer: false,
            run_all_iterations: false,
        }
    }
}

impl Default for Errata {
    fn default() -> Self {
        Self::corrected()
    }
}
