//! Parameter sets of the bike robot and the constants derived from them — design note,
//! `docs/frames.md` for frames and signs.
//!
//! Symbols: link 1 is everything that leans with the frame, link 2 is the balancer; `m, h, x`
//! are mass, height of the centre of gravity and its distance ahead of the rear contact; `l`
//! is the height of the balancer's pivot and `d` the distance of the balancer's centre of
//! gravity above it.

use crate::constants::GRAVITY;
use crate::error::DynamicsError;

/// Where the balancer's centre of gravity sits.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum BalancerMode {
    /// On the pivot (`d` is `d_flywheel_m`): a reaction wheel, strong against disturbances,
    /// unable to lean the bike statically.
    #[default]
    Flywheel,
    /// Above the pivot (`d` is `d_balancer_m`): able to hold a lean, weaker against pushes.
    Balancer,
}

/// The balancer's offset `d` and its motion while the shift motor works.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Offset {
    /// Distance of the balancer's centre of gravity above its pivot, `d`, m.
    pub d: f64,
    /// `ḋ`, m/s.
    pub rate: f64,
    /// `d̈`, m/s².
    pub acceleration: f64,
}

impl Offset {
    /// An offset `d` (m) that does not move.
    #[must_use]
    pub const fn fixed(d: f64) -> Self {
        Self {
            d,
            rate: 0.0,
            acceleration: 0.0,
        }
    }
}

/// A fixed offset, m.
impl From<f64> for Offset {
    fn from(d: f64) -> Self {
        Self::fixed(d)
    }
}

/// Everything that describes one bike: masses, lengths, inertias, limits of its motors.
///
/// The default is a 26-inch electric bicycle with battery, computer and laser and a heavy
/// ring as balancer. No table of the original machine is published; every value can be set.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct BikeParams {
    /// Mass of link 1 (frame, wheels, steering, motors, battery), kg. 23 kg of electric
    /// bicycle and 15 kg of battery, computer, laser and motors.
    #[serde(rename = "m1_kg")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub m1: f64,
    /// Height of link 1's centre of gravity above the ground, m. A bare bicycle has 0.5 to
    /// 0.6 m.
    #[serde(rename = "h1_m")]
    #[schemars(range(max = 3.0), extend("exclusiveMinimum" = 0.0))]
    pub h1: f64,
    /// Distance of link 1's centre of gravity ahead of the rear contact, m. 43 % of the
    /// wheelbase: motor and electronics sit at the rear.
    #[serde(rename = "x1_m")]
    #[schemars(range(min = -1.0, max = 3.0))]
    pub x1: f64,
    /// Moment of inertia of link 1 about its own roll axis, kg m². Radius of gyration 0.29 m.
    #[serde(rename = "i1x_kgm2")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub i1x: f64,
    /// Moment of inertia of link 1 about its own lateral axis, kg m². Radius of gyration
    /// 0.41 m.
    #[serde(rename = "i1y_kgm2")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub i1y: f64,
    /// Moment of inertia of link 1 about its own vertical axis, kg m². Radius of gyration
    /// 0.38 m.
    #[serde(rename = "i1z_kgm2")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub i1z: f64,
    /// Product of inertia of link 1 in its plane of symmetry, kg m², entering the yaw-roll
    /// coupling with the sign of `m1 x1 h1`. Zero: unknown and small.
    #[serde(rename = "i1xz_kgm2")]
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub i1xz: f64,
    /// Mass of the balancer, kg: a heavy disc or ring.
    #[serde(rename = "m2_kg")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub m2: f64,
    /// Height of the balancer's pivot above the ground, m: just above the rear rack.
    #[serde(rename = "l_m")]
    #[schemars(range(max = 3.0), extend("exclusiveMinimum" = 0.0))]
    pub l: f64,
    /// Distance of the balancer ahead of the rear contact, m: over the rear rack.
    #[serde(rename = "x2_m")]
    #[schemars(range(min = -1.0, max = 3.0))]
    pub x2: f64,
    /// Moment of inertia of the balancer about its own axis of rotation, kg m². A ring of
    /// 0.26 m radius.
    #[serde(rename = "i2x_kgm2")]
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub i2x: f64,
    /// Moment of inertia of the balancer about its lateral axis, kg m².
    #[serde(rename = "i2y_kgm2")]
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub i2y: f64,
    /// Moment of inertia of the balancer about its third axis, kg m².
    #[serde(rename = "i2z_kgm2")]
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub i2z: f64,
    /// Offset of the balancer's centre of gravity above its pivot in flywheel mode, m.
    #[serde(rename = "d_flywheel_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub flywheel_offset: f64,
    /// Offset of the balancer's centre of gravity above its pivot in balancer mode, m.
    #[serde(rename = "d_balancer_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub balancer_offset: f64,
    /// Distance between the two wheel contacts, m.
    #[serde(rename = "wheelbase_m")]
    #[schemars(range(min = 0.1, max = 5.0))]
    pub wheelbase: f64,
    /// Radius of both wheels, m: 26 inches. Converts wheel torque to drive force.
    #[serde(rename = "wheel_radius_m")]
    #[schemars(range(min = 0.01, max = 2.0))]
    pub wheel_radius: f64,
    /// Coefficient of friction between tyre and ground: dry tarmac.
    #[serde(rename = "friction")]
    #[schemars(range(max = 5.0), extend("exclusiveMinimum" = 0.0))]
    pub friction: f64,
    /// Largest torque between frame and balancer, N m: a 1 kW motor with a 10:1 gear, for a
    /// short time.
    #[serde(rename = "balancer_torque_max_nm")]
    #[schemars(range(max = 10000.0), extend("exclusiveMinimum" = 0.0))]
    pub balancer_torque_max: f64,
    /// Balancer speed from which on the motor can only brake, rad/s: 380 rpm at the balancer.
    #[serde(rename = "balancer_speed_max_radps")]
    #[schemars(range(max = 10000.0), extend("exclusiveMinimum" = 0.0))]
    pub balancer_speed_max: f64,
    /// Stop of the ground-projected steering angle to either side, degrees.
    #[schemars(range(max = 80.0), extend("exclusiveMinimum" = 0.0))]
    pub steer_max_deg: f64,
    /// Largest steering rate to either side, rad/s.
    #[serde(rename = "steer_rate_max_radps")]
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub steer_rate_max: f64,
    /// Time constant of the first-order lag from commanded to actual steering rate, s.
    #[serde(rename = "steer_lag_s")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub steer_lag: f64,
    /// Largest drive or brake force at the rear contact, N: a 250 W hub motor, 40 N m at the
    /// wheel.
    #[serde(rename = "drive_force_max_n")]
    #[schemars(range(max = 10000.0), extend("exclusiveMinimum" = 0.0))]
    pub drive_force_max: f64,
}

impl Default for BikeParams {
    fn default() -> Self {
        Self {
            m1: 38.0,
            h1: 0.52,
            x1: 0.48,
            i1x: 3.2,
            i1y: 6.5,
            i1z: 5.5,
            i1xz: 0.0,
            m2: 12.0,
            l: 0.80,
            x2: 0.30,
            i2x: 0.80,
            i2y: 0.45,
            i2z: 0.45,
            flywheel_offset: 0.0,
            balancer_offset: 0.15,
            wheelbase: 1.12,
            wheel_radius: 0.33,
            friction: 0.7,
            balancer_torque_max: 70.0,
            balancer_speed_max: 40.0,
            steer_max_deg: 45.0,
            steer_rate_max: 2.0,
            steer_lag: 0.03,
            drive_force_max: 120.0,
        }
    }
}

/// The lumped constants of the two-link model at one offset, §2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lumped {
    /// `I1x + m1 h1² + m2 l²`, kg m².
    pub a0: f64,
    /// `I2x + m2 d²`, kg m².
    pub a2: f64,
    /// `m2 l d`, kg m².
    pub a3: f64,
    /// `(m1 h1 + m2 l) g`, N m.
    pub b1: f64,
    /// `m2 d g`, N m.
    pub b2: f64,
}

/// How a turn rolls the upright bike: moment `H v ω + A ω̇`, §5.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeanCoefficients {
    /// `H`: first moment of mass about the ground, kg m.
    pub centrifugal: f64,
    /// `A`: roll moment per yaw acceleration, kg m².
    pub yaw: f64,
}

/// The two sides of the condition under which the balancer may be shifted while running, §4.3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeChangeCondition {
    /// Height of link 1's centre of percussion, `h1 + I1x/(m1 h1)`, m.
    pub percussion_height: f64,
    /// `l + 2 √((1 + m2 l/(m1 h1)) I2x/m2)`, m.
    pub bound: f64,
}

impl ModeChangeCondition {
    /// Whether the decoupling term keeps its sign for every offset, so that output zeroing
    /// holds all through a mode change.
    #[must_use]
    pub fn is_met(&self) -> bool {
        self.percussion_height < self.bound
    }
}

impl BikeParams {
    /// The names [`BikeParams::preset`] knows.
    pub const PRESETS: [&'static str; 2] = ["default", "low_pivot"];

    /// The named parameter set, or `None` for a name not in [`BikeParams::PRESETS`].
    #[must_use]
    pub fn preset(name: &str) -> Option<Self> {
        match name {
            "default" => Some(Self::default()),
            "low_pivot" => Some(Self::low_pivot()),
            _ => None,
        }
    }

    /// A bike with a low and light balancer: fine in flywheel mode, but its decoupling term
    /// vanishes on the way to balancer mode.
    #[must_use]
    pub fn low_pivot() -> Self {
        Self {
            h1: 0.60,
            i1x: 5.0,
            l: 0.45,
            i2x: 0.08,
            i2y: 0.05,
            i2z: 0.05,
            ..Self::default()
        }
    }

    /// Refuses a parameter set that no real bike has although each value is in its range.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::ImpossibleInertia`] when moments of inertia violate the triangle
    /// inequality, [`DynamicsError::ImpossibleProduct`] when the product of inertia is too
    /// large beside them, [`DynamicsError::BalancerBelowGround`] when the balancer would swing through the
    /// ground.
    pub fn check(&self) -> Result<(), DynamicsError> {
        for (link, x, y, z) in [
            ("link 1", self.i1x, self.i1y, self.i1z),
            ("link 2", self.i2x, self.i2y, self.i2z),
        ] {
            // Twice the largest against the sum of all three; written so that NaN is refused.
            let possible = 2.0 * x.max(y).max(z) <= x + y + z;
            if !possible {
                return Err(DynamicsError::ImpossibleInertia { link, x, y, z });
            }
        }
        let possible = self.i1xz * self.i1xz < self.i1x * self.i1z;
        if !possible {
            return Err(DynamicsError::ImpossibleProduct {
                product: self.i1xz,
                x: self.i1x,
                z: self.i1z,
            });
        }
        let offset = self.flywheel_offset.max(self.balancer_offset);
        let possible = offset < self.l;
        if !possible {
            return Err(DynamicsError::BalancerBelowGround {
                pivot: self.l,
                offset,
            });
        }
        Ok(())
    }

    /// Mass of the whole bike, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.m1 + self.m2
    }

    /// The steering stop, rad.
    #[must_use]
    pub fn steer_max(&self) -> f64 {
        self.steer_max_deg.to_radians()
    }

    /// The offset `d` of a mode, m.
    #[must_use]
    pub fn offset(&self, mode: BalancerMode) -> f64 {
        match mode {
            BalancerMode::Flywheel => self.flywheel_offset,
            BalancerMode::Balancer => self.balancer_offset,
        }
    }

    /// The lumped constants at offset `d` (m).
    #[must_use]
    pub fn lumped(&self, d: f64) -> Lumped {
        let m1h1 = self.m1 * self.h1;
        let m2l = self.m2 * self.l;
        Lumped {
            a0: self.i1x + m1h1 * self.h1 + m2l * self.l,
            a2: self.i2x + self.m2 * d * d,
            a3: m2l * d,
            b1: (m1h1 + m2l) * GRAVITY,
            b2: self.m2 * d * GRAVITY,
        }
    }

    /// The rate `λ = √((b1 + b2)/M11(0))` at which the upright bike with a locked balancer
    /// falls over, 1/s.
    #[must_use]
    pub fn roll_rate(&self, d: f64) -> f64 {
        let Lumped { a0, a2, a3, b1, b2 } = self.lumped(d);
        ((b1 + b2) / (a0 + a2 + 2.0 * a3)).sqrt()
    }

    /// The decoupling term `D = b2 − (b1 + b2) M12/M11` of output zeroing, upright and at
    /// rest, N m. Zero means that the balancer cannot balance.
    #[must_use]
    pub fn upright_decoupling(&self, d: f64) -> f64 {
        let Lumped { a0, a2, a3, b1, b2 } = self.lumped(d);
        b2 - (b1 + b2) * (a2 + a3) / (a0 + a2 + 2.0 * a3)
    }

    /// Whether the balancer may be shifted while running, with both sides of the condition.
    ///
    /// When it is met the decoupling term is negative for every offset; when it is not, there
    /// are offsets at which the balancer has no authority, and a mode change must be refused.
    #[must_use]
    pub fn mode_change_is_possible(&self) -> ModeChangeCondition {
        let m1h1 = self.m1 * self.h1;
        ModeChangeCondition {
            percussion_height: self.h1 + self.i1x / m1h1,
            bound: self.l + 2.0 * ((1.0 + self.m2 * self.l / m1h1) * self.i2x / self.m2).sqrt(),
        }
    }

    /// The coefficients of the roll moment of a turn on the upright bike at offset `d` (m).
    #[must_use]
    pub fn lean_coefficients(&self, d: f64) -> LeanCoefficients {
        LeanCoefficients {
            centrifugal: self.m1 * self.h1 + self.m2 * (self.l + d),
            yaw: self.m1 * self.x1 * self.h1 + self.m2 * self.x2 * (self.l + d) + self.i1xz,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_preset_exists_and_is_physical() {
        for name in BikeParams::PRESETS {
            let params = BikeParams::preset(name).unwrap();
            assert_eq!(params.check(), Ok(()), "{name}");
        }
        assert_eq!(BikeParams::preset("other"), None);
        assert_eq!(BikeParams::preset("default"), Some(BikeParams::default()));
    }

    #[test]
    fn the_default_set_may_change_mode_and_the_low_pivot_may_not() {
        // Numbers of §4.3, printed there to three decimals.
        let default = BikeParams::default().mode_change_is_possible();
        assert!((default.percussion_height - 0.682).abs() < 5e-4);
        assert!((default.bound - 1.429).abs() < 5e-4);
        assert!(default.is_met());
        let low = BikeParams::low_pivot().mode_change_is_possible();
        assert!((low.percussion_height - 0.819).abs() < 5e-4);
        assert!((low.bound - 0.632).abs() < 5e-4);
        assert!(!low.is_met());
    }

    #[test]
    fn the_condition_decides_whether_any_offset_loses_the_decoupling() {
        let largest = |params: &BikeParams| {
            (0..2000)
                .map(|i| params.upright_decoupling(f64::from(i) * 1e-3))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        assert!(largest(&BikeParams::default()) < 0.0);
        assert!(largest(&BikeParams::low_pivot()) > 0.0);
    }

    #[test]
    fn upright_decoupling_agrees_with_its_closed_form() {
        let p = BikeParams::default();
        for d in [0.0, 0.05, 0.15, 0.4] {
            let m11 = p.i1x + p.m1 * p.h1 * p.h1 + p.i2x + p.m2 * (p.l + d).powi(2);
            let closed = GRAVITY / m11
                * (p.m2 * d * (p.i1x + p.m1 * p.h1 * p.h1 - p.m1 * p.h1 * (p.l + d))
                    - (p.m1 * p.h1 + p.m2 * p.l) * p.i2x);
            assert!((p.upright_decoupling(d) / closed - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn lean_coefficients_are_those_of_the_note() {
        let c = BikeParams::default().lean_coefficients(0.0);
        assert!((c.centrifugal - 29.36).abs() < 5e-3);
        assert!((c.yaw - 12.36).abs() < 6e-3);
    }

    #[test]
    fn refuses_inertias_no_body_has() {
        let plate = BikeParams {
            i2x: 1.0,
            ..BikeParams::default()
        };
        assert!(matches!(
            plate.check(),
            Err(DynamicsError::ImpossibleInertia { link: "link 2", .. })
        ));
        let product = BikeParams {
            i1xz: 4.3,
            ..BikeParams::default()
        };
        assert!(matches!(
            product.check(),
            Err(DynamicsError::ImpossibleProduct { .. })
        ));
        let unknown = BikeParams {
            i1y: f64::NAN,
            ..BikeParams::default()
        };
        assert!(unknown.check().is_err());
    }

    #[test]
    fn scenario_keys_carry_their_units_and_unknown_keys_are_refused() {
        let json = serde_json::to_value(BikeParams::default()).unwrap();
        let keys: Vec<&str> = json
            .as_object()
            .unwrap()
            .keys()
            .map(String::as_str)
            .collect();
        for key in [
            "m1_kg",
            "i1xz_kgm2",
            "d_balancer_m",
            "steer_max_deg",
            "drive_force_max_n",
        ] {
            assert!(keys.contains(&key), "{key} missing from {keys:?}");
        }
        let partial: BikeParams = serde_json::from_str(r#"{ "m1_kg": 40.0 }"#).unwrap();
        assert_eq!(
            partial,
            BikeParams {
                m1: 40.0,
                ..BikeParams::default()
            }
        );
        assert!(serde_json::from_str::<BikeParams>(r#"{ "m1": 40.0 }"#).is_err());
    }
}
