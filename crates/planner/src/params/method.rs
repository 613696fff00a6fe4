//! The planning methods by name.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which composition of stages plans: a row of Table 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Streamline of a harmonic potential on a grid: the paper's "LP" read as Laplace potential. Ignores headings and curvature.
    Laplace,
    /// Flow of least cost on a grid: the paper's "LP" read as linear programme. Ignores headings and curvature.
    LinearProgram,
    /// Rapidly-exploring random tree, no goal bias. Ignores headings and curvature.
    Rrt,
    /// RRT*, returning at the first arrival as the paper's row does. Ignores headings and curvature.
    RrtStar,
    /// Bidirectional RRT: lines 1-4 of Algorithm 1. Ignores headings and curvature.
    Birrt,
    /// BiRRT and the shortcut: lines 1-5. Ignores headings and curvature.
    BirrtSmooth,
    /// Model predictive control along the path of `laplace`. Respects headings and curvature, which is continuous.
    MpcLaplace,
    /// Model predictive control along the path of `linear_program`. Respects headings and curvature, which is continuous.
    MpcLinearProgram,
    /// Algorithm 1: BiRRT, shortcut, RRT* in the corridor. Respects headings and curvature.
    Paper,
    /// The cheapest certified curve of continuous curvature that the budget allows. Respects headings and curvature.
    #[default]
    Full,
}

impl Method {
    /// All methods, in the order of Table 2.
    pub const ALL: [Self; 10] = [
        Self::Laplace,
        Self::LinearProgram,
        Self::Rrt,
        Self::RrtStar,
        Self::Birrt,
        Self::BirrtSmooth,
        Self::MpcLaplace,
        Self::MpcLinearProgram,
        Self::Paper,
        Self::Full,
    ];

    /// The name used in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Laplace => "laplace",
            Self::LinearProgram => "linear_program",
            Self::Rrt => "rrt",
            Self::RrtStar => "rrt_star",
            Self::Birrt => "birrt",
            Self::BirrtSmooth => "birrt_smooth",
            Self::MpcLaplace => "mpc_laplace",
            Self::MpcLinearProgram => "mpc_linear_program",
            Self::Paper => "paper",
            Self::Full => "full",
        }
    }

    /// Whether what it returns keeps to the curvature limit and the headings of the ends.
    #[must_use]
    pub fn is_curvature_limited(self) -> bool {
        matches!(
            self,
            Self::MpcLaplace | Self::MpcLinearProgram | Self::Paper | Self::Full
        )
    }

    /// Whether the seed makes no difference to what it returns.
    #[must_use]
    pub fn is_deterministic(self) -> bool {
        matches!(
            self,
            Self::Laplace | Self::LinearProgram | Self::MpcLaplace | Self::MpcLinearProgram
        )
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|m| m.name() == text)
            .ok_or_else(|| {
                let names = Self::ALL.map(Self::name).join(", ");
                format!("no method {text:?}; there are {names}")
            })
    }
}
