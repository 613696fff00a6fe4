//! Disturbances that make sense together with the plant, the path and themselves.

use super::{PathSource, Resolver, SetupError};
use crate::scenario::PlantModel;
use crate::scenario::disturbance::{Disturbance, FaultIs, FaultOf, FaultSection};

impl Resolver<'_> {
    /// Refuses disturbances that say nothing, too much, or what the plant does not feel.
    pub(super) fn disturbances(&self, path: &PathSource) -> Result<Vec<Disturbance>, SetupError> {
        for (index, disturbance) in self.scenario.disturbance.iter().enumerate() {
            let at = |key: &str| format!("disturbance.{index}.{key}");
            self.when_makes_sense(&at, disturbance, path)?;
            self.is_felt(&at, disturbance)?;
            match disturbance {
                Disturbance::Push(push) => match (push.impulse_ns, push.force_n) {
                    (None, None) => {
                        return self.refuse(
                            &at("kind"),
                            "the push has neither `impulse_ns` nor `force_n`",
                            "add one of the two: how hard it pushes",
                        );
                    }
                    (Some(_), Some(_)) => {
                        return self.refuse(
                            &at("force_n"),
                            "the push has both `impulse_ns` and `force_n`",
                            "keep one of the two",
                        );
                    }
                    _ => {}
                },
                Disturbance::Friction(patch) => {
                    if let Some([x0, y0, x1, y1]) = patch.region_m
                        && (x0 >= x1 || y0 >= y1)
                    {
                        return self.refuse(
                            &at("region_m"),
                            "the region is empty: its second corner is not above and right of its first",
                            "write it as [min x, min y, max x, max y]",
                        );
                    }
                }
                Disturbance::Fault(fault) => self.fault_makes_sense(&at, fault)?,
                Disturbance::Moment(_) | Disturbance::Slope(_) | Disturbance::Gust(_) => {}
            }
        }
        Ok(self.scenario.disturbance.clone())
    }

    fn when_makes_sense(
        &self,
        at: &dyn Fn(&str) -> String,
        disturbance: &Disturbance,
        path: &PathSource,
    ) -> Result<(), SetupError> {
        let when = disturbance.when();
        let both = |a: &str, b: &str| {
            self.refuse(
                &at(b),
                format!("the {} has both `{a}` and `{b}`", disturbance.kind()),
                "keep one of the two",
            )
        };
        if when.time.is_some() && when.from_s.is_some() {
            return both("time_s", "from_s_m");
        }
        if when.duration.is_some() && when.to_s.is_some() {
            return both("duration_s", "to_s_m");
        }
        if let (Some(from), Some(to)) = (when.from_s.or(Some(0.0)), when.to_s)
            && to <= from
        {
            return self.refuse(
                &at("to_s_m"),
                format!("`to_s_m` = {to} lies not behind `from_s_m` = {from}"),
                "both are arc lengths of the rear contact along the path",
            );
        }
        if *path == PathSource::Standing
            && let Some(key) = when
                .from_s
                .map(|_| "from_s_m")
                .or(when.to_s.map(|_| "to_s_m"))
        {
            return self.refuse(
                &at(key),
                format!("`{key}` is a place on a path, but the bike stands"),
                "say when with `time_s` and `duration_s`",
            );
        }
        Ok(())
    }

    /// A plant that does not have the motion does not feel what acts on it.
    fn is_felt(
        &self,
        at: &dyn Fn(&str) -> String,
        disturbance: &Disturbance,
    ) -> Result<(), SetupError> {
        let model = self.scenario.plant.model;
        let felt = match (model, disturbance) {
            (PlantModel::TwoLink, Disturbance::Slope(_) | Disturbance::Friction(_)) => false,
            (PlantModel::TwoLink, Disturbance::Fault(fault)) => !matches!(
                fault.of,
                FaultOf::Steering
                    | FaultOf::Drive
                    | FaultOf::Speed
                    | FaultOf::SteerEncoder
                    | FaultOf::Pose
            ),
            (PlantModel::Kinematic, Disturbance::Slope(_)) => true,
            (PlantModel::Kinematic, Disturbance::Fault(fault)) => !matches!(
                fault.of,
                FaultOf::Balancer
                    | FaultOf::Roll
                    | FaultOf::RollRate
                    | FaultOf::Imu
                    | FaultOf::BalancerEncoder
            ),
            (PlantModel::Kinematic, _) => false,
            _ => true,
        };
        if felt {
            return Ok(());
        }
        let (key, what) = match disturbance {
            Disturbance::Fault(fault) => ("of", format!("fault of {}", fault.of.name())),
            other => ("kind", other.kind().to_owned()),
        };
        self.refuse(
            &at(key),
            format!(
                "`plant.model` = \"{}\" does not feel a {what}",
                model.name()
            ),
            "remove it, or choose plant.model = \"bike3d\"",
        )
    }

    fn fault_makes_sense(
        &self,
        at: &dyn Fn(&str) -> String,
        fault: &FaultSection,
    ) -> Result<(), SetupError> {
        let (of, is) = (fault.of, fault.is);
        let fits = match is {
            FaultIs::Stuck => matches!(of, FaultOf::Steering | FaultOf::Balancer),
            FaultIs::Lag | FaultIs::Limit => of.is_motor(),
            FaultIs::Dropout | FaultIs::Bias | FaultIs::Delay => !of.is_motor(),
        };
        if !fits {
            let help = if of == FaultOf::Drive {
                "a drive may have \"lag\" or \"limit\"; with `limit_share = 0` it is dead"
            } else if of.is_motor() {
                "a motor may have \"stuck\", \"lag\" or \"limit\""
            } else {
                "a sensor may have \"dropout\", \"bias\" or \"delay\""
            };
            return self.refuse(
                &at("is"),
                format!(
                    "`is` = \"{}\" is no fault of `of` = \"{}\"",
                    is.name(),
                    of.name()
                ),
                help,
            );
        }
        let sizes = [
            ("lag_s", fault.lag_s),
            ("limit_share", fault.limit_share),
            ("delay_s", fault.delay_s),
            ("bias_deg", fault.bias_deg),
            ("bias_radps", fault.bias_radps),
            ("bias_mps", fault.bias_mps),
            ("bias_m", fault.bias_m),
        ];
        let wanted: &[&str] = match (is, of) {
            (FaultIs::Stuck | FaultIs::Dropout, _) => &[],
            (FaultIs::Lag, _) => &["lag_s"],
            (FaultIs::Limit, _) => &["limit_share"],
            (FaultIs::Delay, _) => &["delay_s"],
            (FaultIs::Bias, FaultOf::RollRate) => &["bias_radps"],
            (FaultIs::Bias, FaultOf::Imu) => &["bias_deg", "bias_radps"],
            (FaultIs::Bias, FaultOf::Speed) => &["bias_mps"],
            (FaultIs::Bias, FaultOf::Pose) => &["bias_m", "bias_deg"],
            (FaultIs::Bias, _) => &["bias_deg"],
        };
        let listed = wanted
            .iter()
            .map(|name| format!("`{name}`"))
            .collect::<Vec<_>>()
            .join(" or ");
        if let Some((key, _)) = sizes
            .iter()
            .find(|(name, value)| value.is_some() && !wanted.contains(name))
        {
            let help = if wanted.is_empty() {
                "remove it".to_owned()
            } else {
                format!("it takes {listed}")
            };
            return self.refuse(
                &at(key),
                format!(
                    "`{key}` says nothing about a {} of {}",
                    is.name(),
                    of.name()
                ),
                help,
            );
        }
        let is_sized = sizes
            .iter()
            .any(|(name, value)| value.is_some() && wanted.contains(name));
        if !wanted.is_empty() && !is_sized {
            return self.refuse(
                &at("is"),
                format!("the {} of {} has no size", is.name(), of.name()),
                format!("add {listed}"),
            );
        }
        Ok(())
    }
}
