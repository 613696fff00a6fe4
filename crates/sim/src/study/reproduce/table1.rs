//! Table 1 of the paper, beside what is used here.

use bikebot_planner::PlannerParams;
use serde::Serialize;

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table1Row {
    /// The paper's symbol.
    pub symbol: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// The key in a scenario.
    pub key: &'static str,
    /// What the paper prints; absent where it prints none, or none that we could read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paper: Option<f64>,
    /// What the rows of Table 2 are measured with.
    pub ours: String,
    /// Why it differs, or where it comes from.
    pub remark: &'static str,
}

impl Table1Row {
    /// Whether ours is the printed number.
    #[must_use]
    pub fn is_as_printed(&self) -> bool {
        self.paper
            .is_some_and(|paper| self.ours.parse() == Ok(paper))
    }
}

/// The rows, read off the parameters that reproduce Table 2 on a field of scale 1.
#[must_use]
pub fn table_1() -> Vec<Table1Row> {
    let ours = PlannerParams::table_1();
    let row = |symbol, meaning, key, paper, value: f64, remark| Table1Row {
        symbol,
        meaning,
        key,
        paper,
        ours: value.to_string(),
        remark,
    };
    vec![
        row(
            "w",
            "half width of the corridor, m",
            "planner.corridor_half_width_scales",
            Some(2.0),
            ours.corridor_half_width_scales,
            "",
        ),
        row(
            "ε",
            "longest step of a tree, m",
            "planner.max_step_scales",
            Some(5.0),
            ours.max_step_scales,
            "",
        ),
        row(
            "l",
            "radius of the goal ball, m",
            "goal.tolerance_m",
            Some(3.0),
            ours.table_goal_tolerance(),
            "",
        ),
        row(
            "i_smooth",
            "attempts of the shortcut",
            "planner.shortcut_attempts",
            Some(200.0),
            ours.shortcut_attempts as f64,
            "attempts, successful or not",
        ),
        row(
            "σ_MAX",
            "curvature limit, 1/m",
            "planner.max_curvature_per_m",
            Some(1.0),
            ours.max_curvature,
            "rides use 0.8: 1 per metre needs 48° of steering at our wheelbase (D20)",
        ),
        row(
            "w_p",
            "weight of length",
            "planner.length_weight",
            Some(1.0),
            ours.length_weight,
            "",
        ),
        row(
            "w_σ",
            "weight of bending",
            "planner.curvature_weight",
            Some(1.0),
            ours.curvature_weight,
            "",
        ),
        Table1Row {
            symbol: "k",
            meaning: "magnitude of the tangents, m",
            key: "planner.tangent",
            paper: Some(1.0),
            ours: "the chord".into(),
            remark: "as printed no edge of 5 m keeps to σ_MAX and nothing is found (D18)",
        },
        row(
            "δθ",
            "spread of headings, °",
            "planner.heading_spread_deg",
            None,
            ours.heading_spread_deg,
            "ours",
        ),
        row(
            "r",
            "radius of rewiring, m",
            "planner.rewire_radius_scales",
            None,
            ours.rewire_radius_scales,
            "not in Table 1; ours (D3)",
        ),
        row(
            "n",
            "iterations",
            "planner.iterations",
            None,
            ours.iterations as f64,
            "not in Table 1; ours (D3)",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_paper_prints_is_used_but_for_the_tangents() {
        let differs: Vec<_> = table_1()
            .into_iter()
            .filter(|row| row.paper.is_some() && !row.is_as_printed())
            .map(|row| row.symbol)
            .collect();
        assert_eq!(differs, ["k"]);
    }

    #[test]
    fn every_key_is_one_of_a_scenario() {
        let schema = serde_json::to_string(&crate::json_schema()).unwrap();
        for row in table_1() {
            let key = row.key.rsplit('.').next().unwrap();
            assert!(schema.contains(&format!("\"{key}\"")), "{key}");
        }
    }
}
