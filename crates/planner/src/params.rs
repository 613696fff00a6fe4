//! Tunables of the planner: Table 1, and every choice where Algorithm 1 is silent or slips.
//!
//! Lengths of Table 1 that belong to a 100 m yard are given in units of [`PlannerParams::scale`], so that a smaller or
//! larger field needs one number changed.

mod errata;
mod method;
#[cfg(test)]
mod tests;

pub use errata::{CostRule, Errata, GoalMode, TangentRule};
pub use method::Method;

use crate::error::PlanError;
use bikebot_world::Footprint;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the planner, the section `[planner]` of a scenario.
///
/// Fields whose key ends in `_scales` are lengths in units of `scale_m`; the methods of the same name, without
/// the ending, give metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlannerParams {
    /// Which planner: "full" or "paper"; or one of the other rows of Table 2: "laplace", "linear_program", "rrt", "rrt_star", "birrt" and
    /// "birrt_smooth", which ignore headings and curvature, "mpc_laplace" and "mpc_linear_program", which do not. The paths of
    /// "full" and of those that begin with "mpc" have a curvature without jumps.
    pub method: Method,
    /// Largest curvature of the path, 1/m: the inverse of the smallest turning radius (the paper's sigma_MAX).
    #[serde(rename = "max_curvature_per_m")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_curvature: f64,
    /// Length unit of the steps below, m: 1 suits a field of 100 m, 0.4 one of 10 m.
    #[serde(rename = "scale_m")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub scale: f64,
    /// Outline that must fit: "bike" (the bike's own), "point", "disc:0.4" (radius), "capsule:1.8x0.6", "box:1.8x0.6"
    /// (length x width, m), or the vertices of a simple polygon, m, [[x, y], …] with x forward and the reference point at 0, 0.
    #[serde(deserialize_with = "footprint_text")]
    #[schemars(schema_with = "footprint_schema")]
    pub footprint: String,
    /// Iterations of RRT* in the corridor (the paper's n). Table 1 leaves it out; at 3000 the cost has settled on the yard.
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub iterations: u64,
    /// Most samples that RRT, RRT* and BiRRT may draw before they give up.
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub search_iterations: u64,
    /// Where a path may end: "pose", the goal itself, or "ball", within the goal's tolerance as printed.
    pub goal: GoalMode,
    /// Longest edge of a tree, in units of scale_m (the paper's epsilon; Table 1: 5).
    #[serde(rename = "max_step_scales")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub max_step_scales: f64,
    /// Half width of the corridor about the guide, in units of scale_m (the paper's w; Table 1: 2).
    #[serde(rename = "corridor_half_width_scales")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub corridor_half_width_scales: f64,
    /// Radius in which the corridor RRT* looks for better parents, in units of scale_m (the paper's r, which Table 1 leaves
    /// out). One step is best: a smaller radius makes many short edges and a rougher path.
    #[serde(rename = "rewire_radius_scales")]
    #[schemars(range(min = 0.0, max = 1e4))]
    pub rewire_radius_scales: f64,
    /// The same radius for "rrt_star". 2 gives the length the paper prints for that row.
    #[serde(rename = "rrt_star_radius_scales")]
    #[schemars(range(min = 0.0, max = 1e4))]
    pub rrt_star_radius_scales: f64,
    /// Whether that radius shrinks as the tree grows, as RRT* needs it for asymptotic optimality. Off: many short edges are
    /// rougher than a few long ones, and the path is no shorter.
    pub rewire_radius_shrinks: bool,
    /// Most neighbours examined per sample of the corridor RRT*, cheapest bound first; bounds the cost of an iteration in a
    /// crowded tree.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub near_limit: usize,
    /// Half the range in which headings are drawn about the heading of the guide, degrees (the paper's delta theta).
    #[serde(rename = "heading_spread_deg")]
    #[schemars(range(min = 0.0, max = 180.0))]
    pub heading_spread_deg: f64,
    /// Pairs of points the shortcut tries (the paper's i_smooth; Table 1: 200). Attempts, successful or not.
    #[schemars(range(min = 0, max = 100_000_000))]
    pub shortcut_attempts: u64,
    /// Pull the shortcut path tight before the corridor search. Algorithm 1 does not; on the yard of Table 2 it saves
    /// about 3 m, which brings the length to the paper's own.
    pub taut_guide: bool,
    /// How many guides "paper" may try, and along how many "full" may search a corridor where nothing else certifies: where the corridor about one comes to nothing, BiRRT starts again. A guide is planned
    /// without headings, and sometimes leads where the whole outline cannot turn. The paper has one.
    #[schemars(range(min = 1, max = 10_000))]
    pub guides: u32,
    /// Most BiRRT starts of "full", beside the guide of the clearance grid that comes first. Each looks for a way around obstacles
    /// on other sides.
    #[schemars(range(min = 0, max = 1_000_000_000))]
    pub starts: u32,
    /// Starts in vain after which "full" is content.
    #[schemars(range(min = 0, max = 1_000_000_000))]
    pub starts_without_gain: u32,
    /// Most rounds of quadratic programmes for the curve along one guide. In the beliefs of online rides nearly all that succeed do so within
    /// ten; the rest helps in thickets, and is what a search in vain takes longest over.
    #[schemars(range(min = 1, max = 48))]
    pub refine_rounds: u32,
    /// How BiRRT grows its second tree towards a new node of the first: `false` by one step, as the paper's row does; `true`
    /// until blocked, as in RRT-Connect.
    pub birrt_connect: bool,
    /// Magnitude of the tangents of an edge: "chord", "chord_sec2" or "constant". A constant 1 on edges of 5 m, as printed,
    /// bends them beyond any limit. "chord_sec2" is the default because it follows turns as tight as the limit with the least bending;
    /// on the yard "chord", which reproduces Table 2, is as good.
    pub tangent: TangentRule,
    /// Magnitude of the tangents where `tangent = "constant"`, m per unit of the curve's parameter (the paper's k; Table 1: 1).
    #[serde(rename = "tangent_speed_m")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub tangent_speed: f64,
    /// Cost of an edge: "printed", Eq. (5), or "additive", which does not change when a curve is cut in two.
    pub cost: CostRule,
    /// Weight of length in the cost, per metre (the paper's w_p; Table 1: 1).
    #[schemars(range(min = 0.0, max = 1e9))]
    pub length_weight: f64,
    /// Weight of bending in the cost (the paper's w_sigma; Table 1: 1).
    #[schemars(range(min = 0.0, max = 1e9))]
    pub curvature_weight: f64,
    /// Whether the corridor RRT* first tries poses laid out along the guide and around the outside of its corners. Finds a path
    /// many times sooner; not in the paper.
    pub structured_seeds: bool,
    /// Whether prescribed headings at the ends are first joined to the guide by a turn, a straight and a turn. Without it a
    /// guide that leaves in another direction than the bike stands leaves no room to turn; not in the paper.
    pub end_arcs: bool,
    /// Length over which a refined path turns a corner that nothing confines, in units of scale_m. Longer is smoother to ride
    /// and longer to travel: at 8.75 the yard's path is 0.7 % longer than the shortest that a point could
    /// take, at 12 it is 0.8 % longer and bends a third as abruptly, at 20 1.2 %.
    #[serde(rename = "corner_length_scales")]
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub corner_length_scales: f64,
    /// Distance kept to every obstacle beyond the outline, m.
    #[serde(rename = "margin_m")]
    #[schemars(range(min = 0.0, max = 1e4))]
    pub margin: f64,
    /// How far a motion may be from touching and still be refused, in units of scale_m. A motion called free is free without
    /// any tolerance; smaller values thread narrower gaps and take longer.
    #[serde(rename = "clearance_resolution_scales")]
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub clearance_resolution_scales: f64,
    /// Slips of the printed algorithm, `true` where corrected.
    pub errata: Errata,
    /// The grid of "laplace" and "linear_program", and of the references of the two "mpc" methods.
    pub grid: GridParams,
    /// The receding horizon of "mpc_laplace" and "mpc_linear_program".
    pub mpc: MpcParams,
}

/// The grid of the methods that search one, `[planner.grid]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridParams {
    /// Side of a cell, in units of scale_m. One cell is one metre on the yard of Table 2. Cells are wider where the field
    /// would hold more of them than allowed, and halved where they show no way.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub cell_scales: f64,
    /// Most cells. Time and memory of "laplace" grow with their square root to the third power, those of "linear_program" a little
    /// faster than their number: 40000 take half a second and some seconds.
    #[schemars(range(min = 4, max = 100_000))]
    pub max_cells: u32,
}

impl GridParams {
    /// How often cells may be halved.
    pub const MOST_HALVINGS: usize = 3;
}

impl Default for GridParams {
    /// The grid of Table 2's field.
    fn default() -> Self {
        Self {
            cell_scales: 1.0,
            max_cells: 40_000,
        }
    }
}

/// The receding horizon of model predictive control, `[planner.mpc]`. The paper prints none of these numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MpcParams {
    /// Steps of a horizon (N). At 40 steps of 1 m a turn about a wall is seen before it begins.
    #[schemars(range(min = 4, max = 1000))]
    pub horizon_steps: u32,
    /// Steps ridden before the next horizon is solved.
    #[schemars(range(min = 1, max = 1000))]
    pub applied_steps: u32,
    /// Linearisations and quadratic programmes per horizon.
    #[schemars(range(min = 1, max = 100))]
    pub rounds: u32,
    /// Length of a step, in units of scale_m.
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub step_scales: f64,
    /// How much faster than the steps the reference point runs ahead. Above 1 it draws the path tight around corners; from
    /// about 1.3 on it runs away and the path circles.
    #[schemars(range(min = 0.5, max = 2.0))]
    pub lead: f64,
    /// Weight of the squared distance from the reference, per scale_m², where squared curvature times scale_m² weighs 1.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub position_weight: f64,
    /// Weight of the squared rate of curvature, times scale_m⁴. More is smoother, and cuts less close to the reference.
    #[schemars(range(min = 1e-6, max = 1e12))]
    pub rate_weight: f64,
    /// Price of length in the last horizon, which ends at the goal, per scale_m.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub length_weight: f64,
    /// Largest rate of curvature, per scale_m².
    #[serde(rename = "max_curvature_rate_per_scale2")]
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_curvature_rate: f64,
    /// Clearance the horizon tries to keep beyond margin_m, in units of scale_m: it looks twice per step, and a wall's
    /// corner may stand between.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub margin_scales: f64,
}

impl Default for MpcParams {
    /// Settings that bring the row of Table 2 near what the paper prints.
    fn default() -> Self {
        Self {
            horizon_steps: 40,
            applied_steps: 3,
            rounds: 2,
            step_scales: 1.0,
            lead: 1.15,
            position_weight: 0.02,
            rate_weight: 300.0,
            length_weight: 1.0,
            max_curvature_rate: 0.5,
            margin_scales: 0.3,
        }
    }
}

impl Default for PlannerParams {
    /// Table 1 with every slip corrected, to the goal pose, for the bike.
    fn default() -> Self {
        Self {
            method: Method::Full,
            max_curvature: 0.8,
            scale: 1.0,
            footprint: "bike".to_owned(),
            iterations: 3000,
            search_iterations: 100_000,
            goal: GoalMode::Pose,
            max_step_scales: 5.0,
            corridor_half_width_scales: 2.0,
            rewire_radius_scales: 5.0,
            rrt_star_radius_scales: 2.0,
            rewire_radius_shrinks: false,
            near_limit: 200,
            heading_spread_deg: 30.0,
            shortcut_attempts: 200,
            taut_guide: false,
            guides: 5,
            starts: 1000,
            starts_without_gain: 32,
            refine_rounds: 48,
            birrt_connect: false,
            tangent: TangentRule::ChordSec2,
            tangent_speed: 1.0,
            cost: CostRule::Printed,
            length_weight: 1.0,
            curvature_weight: 1.0,
            structured_seeds: true,
            end_arcs: true,
            corner_length_scales: 8.75,
            margin: 0.0,
            clearance_resolution_scales: 0.02,
            errata: Errata::corrected(),
            grid: GridParams::default(),
            mpc: MpcParams::default(),
        }
    }
}

/// Vertices become the text that [`Footprint`] reads, so that a footprint is one thing wherever it is named.
fn footprint_text<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        Text(String),
        Vertices(Vec<[f64; 2]>),
    }
    Ok(match Written::deserialize(deserializer)? {
        Written::Text(text) => text,
        Written::Vertices(vertices) => {
            let pairs: Vec<String> = vertices.iter().map(|[x, y]| format!("{x},{y}")).collect();
            format!("polygon:{}", pairs.join(";"))
        }
    })
}

fn footprint_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({
        "anyOf": [
            { "type": "string" },
            {
                "type": "array",
                "minItems": 3,
                "maxItems": 256,
                "items": {
                    "type": "array",
                    "minItems": 2,
                    "maxItems": 2,
                    "items": { "type": "number", "minimum": -1e6, "maximum": 1e6 }
                }
            }
        ]
    })
}

impl PlannerParams {
    /// Table 1 as it reproduces Table 2: a point robot, σ_MAX = 1, the path ending in the ball `l`, slips corrected (D1, D4, D5).
    #[must_use]
    pub fn table_1() -> Self {
        Self {
            method: Method::Paper,
            max_curvature: 1.0,
            footprint: "point".to_owned(),
            goal: GoalMode::Ball,
            guides: 1,
            tangent: TangentRule::Chord,
            structured_seeds: false,
            end_arcs: false,
            ..Self::default()
        }
    }

    /// Table 1 and Algorithm 1 to the letter. Finds nothing on the yard: its edges all exceed σ_MAX.
    #[must_use]
    pub fn literal() -> Self {
        Self {
            tangent: TangentRule::Constant,
            errata: Errata::as_printed(),
            ..Self::table_1()
        }
    }

    /// The longest edge of a tree, ε, m.
    #[must_use]
    pub fn max_step(&self) -> f64 {
        self.max_step_scales * self.scale
    }

    /// Half width of the corridor, w, m.
    #[must_use]
    pub fn corridor_half_width(&self) -> f64 {
        self.corridor_half_width_scales * self.scale
    }

    /// Rewiring radius r of the corridor RRT*, m.
    #[must_use]
    pub fn rewire_radius(&self) -> f64 {
        self.rewire_radius_scales * self.scale
    }

    /// Rewiring radius r of the plain RRT*, m.
    #[must_use]
    pub fn rrt_star_radius(&self) -> f64 {
        self.rrt_star_radius_scales * self.scale
    }

    /// Table 1's radius of the goal ball, l = 3 in units of the scale, m: what to put into
    /// [`GoalRegion::tolerance`](crate::problem::GoalRegion) where a table is to be reproduced.
    #[must_use]
    pub fn table_goal_tolerance(&self) -> f64 {
        3.0 * self.scale
    }

    /// Half the range of drawn headings, δθ, rad.
    #[must_use]
    pub fn heading_spread(&self) -> f64 {
        self.heading_spread_deg.to_radians()
    }

    /// Length over which a refined path turns an unconfined corner, ℓ_c, m.
    #[must_use]
    pub fn corner_length(&self) -> f64 {
        self.corner_length_scales * self.scale
    }

    /// How far from touching a motion may be refused, δ, m.
    #[must_use]
    pub fn clearance_resolution(&self) -> f64 {
        self.clearance_resolution_scales * self.scale
    }

    /// The outline that `footprint` names.
    ///
    /// # Errors
    ///
    /// [`PlanError::InvalidFootprint`] if it names none.
    pub fn parse_footprint(&self) -> Result<Footprint, PlanError> {
        Ok(self.footprint.parse()?)
    }

    /// Checks the numbers a search divides by or steps with, for callers that do not go through a scenario.
    ///
    /// # Errors
    ///
    /// [`PlanError::InvalidParameter`] for the first that cannot be planned with.
    pub fn check(&self) -> Result<(), PlanError> {
        let at_least = |name, value: f64, positive: bool| {
            let fine = value.is_finite() && if positive { value > 0.0 } else { value >= 0.0 };
            if fine {
                return Ok(());
            }
            Err(PlanError::InvalidParameter {
                name,
                value,
                expected: if positive {
                    "a finite number above 0"
                } else {
                    "a finite number, 0 or above"
                },
            })
        };
        at_least("max_curvature_per_m", self.max_curvature, true)?;
        at_least("scale_m", self.scale, true)?;
        at_least("max_step_scales", self.max_step_scales, true)?;
        at_least(
            "corridor_half_width_scales",
            self.corridor_half_width_scales,
            true,
        )?;
        at_least("rewire_radius_scales", self.rewire_radius_scales, false)?;
        at_least("rrt_star_radius_scales", self.rrt_star_radius_scales, false)?;
        at_least("heading_spread_deg", self.heading_spread_deg, false)?;
        at_least("tangent_speed_m", self.tangent_speed, true)?;
        at_least("length_weight", self.length_weight, false)?;
        at_least("curvature_weight", self.curvature_weight, false)?;
        at_least("corner_length_scales", self.corner_length_scales, true)?;
        at_least("margin_m", self.margin, false)?;
        at_least(
            "clearance_resolution_scales",
            self.clearance_resolution_scales,
            true,
        )?;
        // Each factor may be fine and their product not: a step of nothing gets nowhere.
        for (name, value, metres) in [
            ("max_step_scales", self.max_step_scales, self.max_step()),
            (
                "corridor_half_width_scales",
                self.corridor_half_width_scales,
                self.corridor_half_width(),
            ),
            (
                "clearance_resolution_scales",
                self.clearance_resolution_scales,
                self.clearance_resolution(),
            ),
        ] {
            if !(1e-12..=1e12).contains(&metres) {
                return Err(PlanError::InvalidParameter {
                    name,
                    value,
                    expected: "a length between 1e-12 m and 1e12 m once multiplied by scale_m",
                });
            }
        }
        self.check_grid_and_mpc(&at_least)?;
        if self.near_limit == 0 {
            return Err(PlanError::InvalidParameter {
                name: "near_limit",
                value: 0.0,
                expected: "1 or above, or no node ever has a parent",
            });
        }
        Ok(())
    }

    fn check_grid_and_mpc(
        &self,
        at_least: &dyn Fn(&'static str, f64, bool) -> Result<(), PlanError>,
    ) -> Result<(), PlanError> {
        let (grid, mpc) = (&self.grid, &self.mpc);
        for (name, value, positive) in [
            ("grid.cell_scales", grid.cell_scales, true),
            ("mpc.step_scales", mpc.step_scales, true),
            ("mpc.lead", mpc.lead, true),
            ("mpc.position_weight", mpc.position_weight, false),
            ("mpc.rate_weight", mpc.rate_weight, true),
            ("mpc.length_weight", mpc.length_weight, false),
            (
                "mpc.max_curvature_rate_per_scale2",
                mpc.max_curvature_rate,
                true,
            ),
            ("mpc.margin_scales", mpc.margin_scales, false),
            ("mpc.horizon_steps", f64::from(mpc.horizon_steps), true),
        ] {
            at_least(name, value, positive)?;
        }
        if !(4..=100_000).contains(&grid.max_cells) {
            return Err(PlanError::InvalidParameter {
                name: "grid.max_cells",
                value: f64::from(grid.max_cells),
                expected: "a number from 4 to 100000",
            });
        }
        Ok(())
    }
}
