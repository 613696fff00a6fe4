//! The parameters of the Whipple bicycle, Table 1 of Meijaard et al. (2007), and what no bicycle can be.

use crate::constants::GRAVITY;
use crate::error::DynamicsError;
use serde::{Deserialize, Serialize};

/// How far a measured frame may fall short of the triangle inequality of its moments of inertia, as a share of the
/// largest. A bicycle frame is nearly flat, where the inequality is an equality, and each moment is measured on
/// its own: the instrumented "Browser" bicycle of the collection misses it by 2.3 %. The moment about y has no
/// part in the linear equations.
const FLATNESS_SLACK: f64 = 0.05;
/// As far as rounding may go, relative.
const ROUNDING: f64 = 1e-9;

/// A wheel: knife-edged, symmetric about its axle, centre of mass on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelBody {
    /// `rR`, `rF`: radius, m.
    #[serde(rename = "radius_m")]
    pub radius: f64,
    /// `mR`, `mF`: mass, kg.
    #[serde(rename = "mass_kg")]
    pub mass: f64,
    /// `IRxx`, `IFxx`: moment of inertia about any diameter, kg m².
    #[serde(rename = "ixx_kgm2")]
    pub ixx: f64,
    /// `IRyy`, `IFyy`: moment of inertia about the axle, kg m².
    #[serde(rename = "iyy_kgm2")]
    pub iyy: f64,
}

/// A frame: symmetric about the plane of the bicycle, with its inertia about its own centre of mass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameBody {
    /// `xB`, `xH`: centre of mass ahead of the rear contact, m.
    #[serde(rename = "x_m")]
    pub x: f64,
    /// `zB`, `zH`: centre of mass below the ground, m; negative, since z points down.
    #[serde(rename = "z_m")]
    pub z: f64,
    /// `mB`, `mH`: mass, kg.
    #[serde(rename = "mass_kg")]
    pub mass: f64,
    /// `IBxx`, `IHxx`: about the forward axis, kg m².
    #[serde(rename = "ixx_kgm2")]
    pub ixx: f64,
    /// `IByy`, `IHyy`: about the lateral axis, kg m². Has no part in the linear equations.
    #[serde(rename = "iyy_kgm2")]
    pub iyy: f64,
    /// `IBzz`, `IHzz`: about the vertical axis, kg m².
    #[serde(rename = "izz_kgm2")]
    pub izz: f64,
    /// `IBxz`, `IHxz`: the element of the inertia tensor, `−∫ x z dm`, kg m².
    #[serde(rename = "ixz_kgm2")]
    pub ixz: f64,
}

/// The 25 parameters of a Whipple bicycle and gravity. Lengths from the rear contact, z down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhippleParams {
    /// `w`: distance of the two wheel contacts, m.
    #[serde(rename = "wheelbase_m")]
    pub wheelbase: f64,
    /// `c`: how far the front contact trails behind the point where the steering axis meets the ground, m.
    #[serde(rename = "trail_m")]
    pub trail: f64,
    /// `λ`: tilt of the steering axis backwards from the vertical, rad; 90° less the head angle.
    #[serde(rename = "steer_axis_tilt_rad")]
    pub tilt: f64,
    /// `g`: acceleration of free fall, m/s².
    #[serde(rename = "gravity_mps2")]
    pub gravity: f64,
    /// R: the rear wheel.
    pub rear_wheel: WheelBody,
    /// B: the rear frame, with a rider where there is one.
    pub rear_frame: FrameBody,
    /// H: handlebar and fork.
    pub front_frame: FrameBody,
    /// F: the front wheel.
    pub front_wheel: WheelBody,
}

/// One parameter: its symbol, what it is, where it may lie, and how to reach it.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// The paper's symbol in plain letters, as parameter files spell it.
    pub symbol: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    least: Least,
    most: f64,
    reason: &'static str,
    /// Reads it.
    pub get: fn(&WhippleParams) -> f64,
    /// Writes it.
    pub set: fn(&mut WhippleParams, f64),
}

/// The lower bound of a parameter.
#[derive(Debug, Clone, Copy)]
enum Least {
    Above(f64),
    From(f64),
}

macro_rules! parameter {
    ($symbol:literal, $unit:literal, $meaning:literal, $($field:ident).+, $least:expr, $most:expr, $reason:literal) => {
        Parameter {
            symbol: $symbol,
            unit: $unit,
            meaning: $meaning,
            least: $least,
            most: $most,
            reason: $reason,
            get: |params| params.$($field).+,
            set: |params, value| params.$($field).+ = value,
        }
    };
}

const POSITIVE: Least = Least::Above(0.0);
const NOT_NEGATIVE: Least = Least::From(0.0);

/// The 25 parameters and gravity, in the order of the paper's table.
pub const PARAMETERS: [Parameter; 26] = [
    parameter!(
        "w",
        "m",
        "wheelbase",
        wheelbase,
        POSITIVE,
        10.0,
        "the front contact lies ahead of the rear one"
    ),
    parameter!(
        "c",
        "m",
        "trail",
        trail,
        Least::From(-5.0),
        5.0,
        "a bicycle's trail is a few centimetres"
    ),
    parameter!(
        "lam",
        "rad",
        "tilt of the steering axis",
        tilt,
        Least::From(-1.4),
        1.4,
        "about a lying axis the handlebar does not steer; the angle is in radians, 18 degrees are 0.314"
    ),
    parameter!(
        "g",
        "m/s²",
        "acceleration of free fall",
        gravity,
        POSITIVE,
        100.0,
        "it is 9.81 on the ground"
    ),
    parameter!(
        "rR",
        "m",
        "radius of the rear wheel",
        rear_wheel.radius,
        POSITIVE,
        5.0,
        "a wheel has a radius"
    ),
    parameter!(
        "mR",
        "kg",
        "mass of the rear wheel",
        rear_wheel.mass,
        NOT_NEGATIVE,
        1e4,
        "a mass is not negative"
    ),
    parameter!(
        "IRxx",
        "kg m²",
        "rear wheel about a diameter",
        rear_wheel.ixx,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IRyy",
        "kg m²",
        "rear wheel about its axle",
        rear_wheel.iyy,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "xB",
        "m",
        "rear frame's centre of mass, forward",
        rear_frame.x,
        Least::From(-10.0),
        10.0,
        "it lies on the bicycle"
    ),
    parameter!(
        "zB",
        "m",
        "rear frame's centre of mass, downward",
        rear_frame.z,
        Least::From(-10.0),
        0.0,
        "z points down, so what lies above the ground has z < 0"
    ),
    parameter!(
        "mB",
        "kg",
        "mass of rear frame and rider",
        rear_frame.mass,
        NOT_NEGATIVE,
        1e4,
        "a mass is not negative"
    ),
    parameter!(
        "IBxx",
        "kg m²",
        "rear frame about the forward axis",
        rear_frame.ixx,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IByy",
        "kg m²",
        "rear frame about the lateral axis",
        rear_frame.iyy,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IBzz",
        "kg m²",
        "rear frame about the vertical axis",
        rear_frame.izz,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IBxz",
        "kg m²",
        "rear frame's product of inertia",
        rear_frame.ixz,
        Least::From(-1e4),
        1e4,
        "it is an element of an inertia tensor"
    ),
    parameter!(
        "xH",
        "m",
        "front frame's centre of mass, forward",
        front_frame.x,
        Least::From(-10.0),
        10.0,
        "it lies on the bicycle"
    ),
    parameter!(
        "zH",
        "m",
        "front frame's centre of mass, downward",
        front_frame.z,
        Least::From(-10.0),
        0.0,
        "z points down, so what lies above the ground has z < 0"
    ),
    parameter!(
        "mH",
        "kg",
        "mass of handlebar and fork",
        front_frame.mass,
        NOT_NEGATIVE,
        1e4,
        "a mass is not negative"
    ),
    parameter!(
        "IHxx",
        "kg m²",
        "front frame about the forward axis",
        front_frame.ixx,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IHyy",
        "kg m²",
        "front frame about the lateral axis",
        front_frame.iyy,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IHzz",
        "kg m²",
        "front frame about the vertical axis",
        front_frame.izz,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IHxz",
        "kg m²",
        "front frame's product of inertia",
        front_frame.ixz,
        Least::From(-1e4),
        1e4,
        "it is an element of an inertia tensor"
    ),
    parameter!(
        "rF",
        "m",
        "radius of the front wheel",
        front_wheel.radius,
        POSITIVE,
        5.0,
        "a wheel has a radius"
    ),
    parameter!(
        "mF",
        "kg",
        "mass of the front wheel",
        front_wheel.mass,
        NOT_NEGATIVE,
        1e4,
        "a mass is not negative"
    ),
    parameter!(
        "IFxx",
        "kg m²",
        "front wheel about a diameter",
        front_wheel.ixx,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
    parameter!(
        "IFyy",
        "kg m²",
        "front wheel about its axle",
        front_wheel.iyy,
        NOT_NEGATIVE,
        1e4,
        "a moment of inertia is not negative"
    ),
];

impl Parameter {
    /// The parameter of this symbol.
    #[must_use]
    pub fn named(symbol: &str) -> Option<&'static Self> {
        PARAMETERS
            .iter()
            .find(|parameter| parameter.symbol == symbol)
    }

    fn check(&self, params: &WhippleParams) -> Result<(), DynamicsError> {
        let value = (self.get)(params);
        let (holds, least) = match self.least {
            Least::Above(least) => (value > least, format!("above {least}")),
            Least::From(least) => (value >= least, format!("at least {least}")),
        };
        // Written so that NaN is refused.
        if holds && value <= self.most {
            return Ok(());
        }
        let bound = format!("{least} and at most {}", self.most);
        Err(refused(self.symbol, value, self.unit, bound, self.reason))
    }
}

fn refused(
    what: &str,
    value: f64,
    unit: &'static str,
    bound: String,
    reason: &str,
) -> DynamicsError {
    DynamicsError::ImpossibleBicycle {
        what: what.to_owned(),
        value,
        unit,
        bound,
        reason: reason.to_owned(),
    }
}

impl WhippleParams {
    /// The benchmark bicycle of Meijaard et al. (2007), Table 1.
    #[must_use]
    pub fn benchmark() -> Self {
        Self {
            wheelbase: 1.02,
            trail: 0.08,
            tilt: std::f64::consts::PI / 10.0,
            gravity: GRAVITY,
            rear_wheel: WheelBody {
                radius: 0.3,
                mass: 2.0,
                ixx: 0.0603,
                iyy: 0.12,
            },
            rear_frame: FrameBody {
                x: 0.3,
                z: -0.9,
                mass: 85.0,
                ixx: 9.2,
                iyy: 11.0,
                izz: 2.8,
                ixz: 2.4,
            },
            front_frame: FrameBody {
                x: 0.9,
                z: -0.7,
                mass: 4.0,
                ixx: 0.05892,
                iyy: 0.06,
                izz: 0.00708,
                ixz: -0.00756,
            },
            front_wheel: WheelBody {
                radius: 0.35,
                mass: 3.0,
                ixx: 0.1405,
                iyy: 0.28,
            },
        }
    }

    /// Mass of the whole bicycle, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.rear_wheel.mass + self.rear_frame.mass + self.front_frame.mass + self.front_wheel.mass
    }

    /// Refuses what no bicycle can be.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::ImpossibleBicycle`] with the value, the bound and the reason: a number out of its range or
    /// not finite, no mass at all, a trail of more than half the wheelbase, an inertia tensor that is indefinite or
    /// whose moments violate the triangle inequality (a frame by more than the 5 % that separate measurements
    /// of a nearly flat one explain).
    pub fn check(&self) -> Result<(), DynamicsError> {
        for parameter in &PARAMETERS {
            parameter.check(self)?;
        }
        let mass = self.mass();
        if mass <= 0.0 {
            let reason = "a bicycle without mass neither falls nor steers";
            return Err(refused(
                "mR + mB + mH + mF",
                mass,
                "kg",
                "above 0".into(),
                reason,
            ));
        }
        let half = 0.5 * self.wheelbase;
        if self.trail.abs() > half {
            return Err(refused(
                "c",
                self.trail,
                "m",
                format!("at most half the wheelbase, {half} m, to either side"),
                "the steering axis meets the ground near the front contact",
            ));
        }
        for (body, wheel) in [("R", &self.rear_wheel), ("F", &self.front_wheel)] {
            let bound = 2.0 * wheel.ixx;
            if wheel.iyy > bound * (1.0 + ROUNDING) {
                return Err(refused(
                    &format!("I{body}yy"),
                    wheel.iyy,
                    "kg m²",
                    format!("at most 2 I{body}xx = {bound} kg m²"),
                    "of three moments of inertia none exceeds the sum of the others",
                ));
            }
        }
        for (body, frame) in [("B", &self.rear_frame), ("H", &self.front_frame)] {
            frame.check(body)?;
        }
        Ok(())
    }

    /// What is odd about the set although it passes [`check`](Self::check), as sentences.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        for (body, frame) in [("B", &self.rear_frame), ("H", &self.front_frame)] {
            let excess = frame.triangle_excess();
            if excess > ROUNDING {
                remarks.push(format!(
                    "the moments of inertia of body {body} violate the triangle inequality by {:.1} %, as separate \
                     measurements of a flat frame may",
                    100.0 * excess
                ));
            }
        }
        if !(0.0..=self.wheelbase).contains(&self.centre_of_mass()) {
            remarks.push(format!(
                "the centre of mass lies at x = {:.3} m, outside the wheelbase of {} m: the bicycle tips over a wheel",
                self.centre_of_mass(),
                self.wheelbase
            ));
        }
        remarks
    }

    /// `xT`: the whole bicycle's centre of mass ahead of the rear contact, m.
    fn centre_of_mass(&self) -> f64 {
        let moment = self.rear_frame.mass * self.rear_frame.x
            + self.front_frame.mass * self.front_frame.x
            + self.front_wheel.mass * self.wheelbase;
        moment / self.mass()
    }
}

impl FrameBody {
    /// The two principal moments in the plane of the bicycle, the larger first, kg m².
    fn in_plane(&self) -> [f64; 2] {
        let mean = 0.5 * (self.ixx + self.izz);
        let radius = (0.5 * (self.ixx - self.izz)).hypot(self.ixz);
        [mean + radius, mean - radius]
    }

    /// By how much the largest principal moment exceeds the sum of the others, as a share of itself; negative
    /// where it does not.
    fn triangle_excess(&self) -> f64 {
        let [larger, smaller] = self.in_plane();
        let largest = larger.max(self.iyy);
        if largest == 0.0 {
            return 0.0;
        }
        (2.0 * largest - (larger + smaller + self.iyy)) / largest
    }

    fn check(&self, body: &str) -> Result<(), DynamicsError> {
        let product = self.ixx * self.izz;
        if self.ixz * self.ixz > product * (1.0 + ROUNDING) {
            return Err(refused(
                &format!("|I{body}xz|"),
                self.ixz.abs(),
                "kg m²",
                format!(
                    "at most √(I{body}xx I{body}zz) = {:.6} kg m²",
                    product.sqrt()
                ),
                "the inertia tensor would be indefinite",
            ));
        }
        let excess = self.triangle_excess();
        if excess > FLATNESS_SLACK {
            let [larger, smaller] = self.in_plane();
            let (what, value, others) = if self.iyy >= larger {
                (format!("I{body}yy"), self.iyy, larger + smaller)
            } else {
                let what = format!("the largest moment of I{body}xx, I{body}zz, I{body}xz");
                (what, larger, smaller + self.iyy)
            };
            return Err(refused(
                &what,
                value,
                "kg m²",
                format!(
                    "at most the sum of the other two principal moments, {others:.6} kg m² (and 5 % for errors of measurement)"
                ),
                "of three moments of inertia none exceeds the sum of the others",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(change: impl FnOnce(&mut WhippleParams)) -> String {
        let mut params = WhippleParams::benchmark();
        change(&mut params);
        params.check().expect_err("nonsense").to_string()
    }

    #[test]
    fn the_benchmark_is_a_bicycle_without_remarks() {
        assert_eq!(WhippleParams::benchmark().check(), Ok(()));
        assert!(WhippleParams::benchmark().remarks().is_empty());
    }

    #[test]
    fn refuses_nonsense_with_the_value_the_bound_and_the_reason() {
        for (text, value, bound, reason) in [
            (
                refusal(|p| p.rear_frame.mass = -85.0),
                "mB = -85 kg",
                "at least 0",
                "mass is not negative",
            ),
            (
                refusal(|p| p.wheelbase = 0.0),
                "w = 0 m",
                "above 0",
                "ahead of the rear",
            ),
            (
                refusal(|p| p.wheelbase = f64::NAN),
                "w = NaN m",
                "above 0",
                "ahead",
            ),
            (
                refusal(|p| p.trail = 0.6),
                "c = 0.6 m",
                "0.51 m",
                "steering axis meets",
            ),
            (
                refusal(|p| p.trail = -7.0),
                "c = -7 m",
                "at least -5",
                "centimetres",
            ),
            (
                refusal(|p| p.tilt = 18.0),
                "lam = 18 rad",
                "at most 1.4",
                "radians",
            ),
            (
                refusal(|p| p.rear_frame.z = 0.9),
                "zB = 0.9 m",
                "at most 0",
                "z points down",
            ),
            (
                refusal(|p| p.front_frame.ixz = 0.03),
                "|IHxz| = 0.03",
                "√(IHxx IHzz) = 0.020424",
                "indefinite",
            ),
            (
                refusal(|p| p.rear_frame.iyy = 13.0),
                "IByy = 13",
                "12.000000",
                "exceeds the sum",
            ),
            (
                refusal(|p| p.rear_frame.iyy = 7.0),
                "IBxx, IBzz, IBxz = 10",
                "9.000000",
                "exceeds the sum",
            ),
            (
                refusal(|p| p.front_wheel.iyy = 0.3),
                "IFyy = 0.3",
                "2 IFxx = 0.281",
                "exceeds the sum",
            ),
            (
                refusal(|p| p.gravity = 0.0),
                "g = 0 m/s²",
                "above 0",
                "9.81",
            ),
            (
                refusal(|p| {
                    for set in ["mR", "mB", "mH", "mF"] {
                        (Parameter::named(set).unwrap().set)(p, 0.0);
                    }
                }),
                "mR + mB + mH + mF = 0 kg",
                "above 0",
                "neither falls nor steers",
            ),
        ] {
            for part in [value, bound, reason] {
                assert!(text.contains(part), "`{part}` is not in: {text}");
            }
        }
    }

    #[test]
    fn every_parameter_is_refused_where_it_is_not_finite() {
        for parameter in &PARAMETERS {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let text = refusal(|p| (parameter.set)(p, value));
                assert!(text.starts_with(parameter.symbol), "{text}");
            }
        }
    }

    #[test]
    fn a_flat_frame_with_errors_of_measurement_is_a_remark_not_a_refusal() {
        let mut params = WhippleParams::benchmark();
        params.rear_frame.iyy = 12.2;
        assert_eq!(params.check(), Ok(()));
        let remarks = params.remarks();
        assert!(
            remarks[0].contains("body B") && remarks[0].contains("1.6 %"),
            "{remarks:?}"
        );
    }

    #[test]
    fn reading_and_writing_by_symbol_reach_the_same_field() {
        let mut params = WhippleParams::benchmark();
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            (parameter.set)(&mut params, i as f64);
        }
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            assert_eq!((parameter.get)(&params), i as f64, "{}", parameter.symbol);
        }
    }

    #[test]
    fn the_keys_of_the_serialised_set_carry_their_units() {
        let json = serde_json::to_value(WhippleParams::benchmark()).unwrap();
        assert_eq!(json["rear_frame"]["ixz_kgm2"], 2.4);
        assert_eq!(json["steer_axis_tilt_rad"], 0.314_159_265_358_979_3);
        let back: WhippleParams = serde_json::from_value(json).unwrap();
        assert_eq!(back, WhippleParams::benchmark());
    }
}
