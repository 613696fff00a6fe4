//! What an edge costs: Eq. (5), and a form that does not depend on how a path is cut into edges (D10).
//!
//! Printed, c = w_p L + w_σ (1/L²) ∫ (dσ/ds)² ds over one edge. Because of the 1/L² of *each edge*, cutting an edge in
//! two changes the cost of the same curve. The additive form divides by the square of a fixed length, the step ε;
//! the two agree on an edge of that length.

use crate::params::{CostRule, PlannerParams};

/// Eq. (5) with its weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeCost {
    rule: CostRule,
    length_weight: f64,
    curvature_weight: f64,
    /// 1/ε², 1/m².
    reference: f64,
}

impl EdgeCost {
    /// The cost that `params` ask for.
    #[must_use]
    pub fn new(params: &PlannerParams) -> Self {
        Self {
            rule: params.cost,
            length_weight: params.length_weight,
            curvature_weight: params.curvature_weight,
            reference: params.max_step().powi(-2),
        }
    }

    /// Cost of an edge of length L (m) and bending J = ∫ (dσ/ds)² ds (1/m³).
    #[must_use]
    #[inline]
    pub fn of(&self, length: f64, bending: f64) -> f64 {
        let per_squared_length = match self.rule {
            CostRule::Printed => 1.0 / (length * length),
            CostRule::Additive => self.reference,
        };
        self.length_weight * length + self.curvature_weight * bending * per_squared_length
    }

    /// A lower bound of the cost of any way of at least `distance` (m), as the crow flies.
    #[must_use]
    #[inline]
    pub fn lower_bound(&self, distance: f64) -> f64 {
        self.length_weight * distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{FergusonCurve, Pose2};

    fn cost(rule: CostRule) -> EdgeCost {
        EdgeCost::new(&PlannerParams {
            cost: rule,
            length_weight: 1.5,
            curvature_weight: 2.0,
            ..PlannerParams::default()
        })
    }

    fn bend() -> FergusonCurve {
        FergusonCurve::between(Pose2::new(0.0, 0.0, 0.3), Pose2::new(5.0, 0.0, 0.4), 5.0)
    }

    #[test]
    fn the_printed_cost_is_equation_five() {
        let (length, bending) = (4.0, 0.8);
        let expected = 1.5 * 4.0 + 2.0 * 0.8 / 16.0;
        assert!((cost(CostRule::Printed).of(length, bending) - expected).abs() < 1e-15);
    }

    #[test]
    fn the_two_rules_agree_on_an_edge_of_one_step() {
        let step = PlannerParams::default().max_step();
        let (printed, additive) = (cost(CostRule::Printed), cost(CostRule::Additive));
        assert!((printed.of(step, 0.7) - additive.of(step, 0.7)).abs() < 1e-14);
    }

    #[test]
    fn cutting_an_edge_changes_only_the_printed_cost() {
        let (whole, first, second) = (
            bend(),
            bend().sub_curve(0.0, 0.5),
            bend().sub_curve(0.5, 1.0),
        );
        let total = |rule, curves: &[FergusonCurve]| -> f64 {
            curves
                .iter()
                .map(|c| {
                    let (length, bending) = c.length_and_bending_fine();
                    cost(rule).of(length, bending)
                })
                .sum()
        };
        let additive =
            total(CostRule::Additive, &[whole]) - total(CostRule::Additive, &[first, second]);
        // What the quadrature leaves of the bending.
        assert!(additive.abs() < 1e-5, "{additive:e}");
        let printed =
            total(CostRule::Printed, &[first, second]) / total(CostRule::Printed, &[whole]);
        assert!(printed > 1.003, "{printed}");
    }

    #[test]
    fn no_edge_is_cheaper_than_its_chord() {
        for rule in [CostRule::Printed, CostRule::Additive] {
            let (length, bending) = bend().length_and_bending();
            assert!(cost(rule).lower_bound(5.0) <= cost(rule).of(length, bending));
        }
    }
}
