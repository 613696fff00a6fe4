//! The speeds at which the upright bicycle gains or loses stability, in closed form.
//!
//! With `u = v²` the characteristic polynomial is
//!
//! ```text
//! a4 λ⁴ + v A λ³ + (B0 + B2 u) λ² + v (C0 + C2 u) λ + (E0 + E2 u)
//! ```
//!
//! (`det K2 = 0`, since lean alone feels no force that grows with speed). A real eigenvalue passes through zero
//! where `E0 + E2 u = 0`; a pair `±iω` stands on the imaginary axis where Routh's condition
//! `a3 a2 a1 − a4 a1² − a3² a0 = 0` holds with `ω² = a1/a3 > 0`. Divided by `u` the condition is a quadratic in u,
//! so that both kinds of speed are roots of a formula, not of a search.

use super::linear::{Whipple, mixed_determinant};
use super::params::{Parameter, WhippleParams};
use nalgebra::Complex;
use serde::Serialize;

/// A range of speeds, m/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpeedRange {
    /// Above this speed, m/s.
    pub from_mps: f64,
    /// Below this speed, m/s; `None`: at any speed above `from`.
    pub to_mps: Option<f64>,
}

/// The speeds at which an eigenvalue crosses the imaginary axis.
#[derive(Debug, Clone, PartialEq)]
pub struct CriticalSpeeds {
    /// Where an oscillation passes from growing to decaying, `v_w`, m/s: the weave speed.
    pub weave: Option<f64>,
    /// Where a real eigenvalue passes from decay to growth, `v_c`, m/s: the capsize speed.
    pub capsize: Option<f64>,
    /// All speeds at which a pair `±iω` crosses, ascending, m/s.
    pub oscillatory: Vec<f64>,
    /// The speed at which a real eigenvalue is zero, in whichever direction it passes, m/s.
    pub neutral: Option<f64>,
    /// Where every disturbance dies away, ascending.
    pub stable: Vec<SpeedRange>,
}

/// The coefficients of the characteristic polynomial as functions of `u = v²`.
struct Coefficients {
    a4: f64,
    a: f64,
    b: [f64; 2],
    c: [f64; 2],
    e: [f64; 2],
}

impl Coefficients {
    fn of(bicycle: &Whipple) -> Self {
        let (m, c1, k2) = (&bicycle.mass, &bicycle.damping, &bicycle.speed_stiffness);
        let k0 = bicycle.gravity_stiffness * bicycle.gravity;
        Self {
            a4: m.determinant(),
            a: mixed_determinant(m, c1),
            b: [
                mixed_determinant(m, &k0),
                mixed_determinant(m, k2) + c1.determinant(),
            ],
            c: [mixed_determinant(c1, &k0), mixed_determinant(c1, k2)],
            e: [k0.determinant(), mixed_determinant(&k0, k2)],
        }
    }

    /// `(a3 a2 a1 − a4 a1² − a3² a0)/u` as a polynomial in u, of u⁰ first.
    fn routh(&self) -> [f64; 3] {
        let Self { a4, a, b, c, e } = self;
        [
            a * b[0] * c[0] - a4 * c[0] * c[0] - a * a * e[0],
            a * (b[0] * c[1] + b[1] * c[0]) - 2.0 * a4 * c[0] * c[1] - a * a * e[1],
            a * b[1] * c[1] - a4 * c[1] * c[1],
        ]
    }

    /// `ω²` of the pair on the imaginary axis at a root of [`Self::routh`], 1/s².
    fn frequency_squared(&self, u: f64) -> f64 {
        (self.c[0] + self.c[1] * u) / self.a
    }

    /// All roots in the left half plane, by Routh.
    fn is_stable(&self, u: f64) -> bool {
        let routh = self.routh();
        self.a > 0.0
            && self.b[0] + self.b[1] * u > 0.0
            && self.c[0] + self.c[1] * u > 0.0
            && self.e[0] + self.e[1] * u > 0.0
            && routh[0] + u * (routh[1] + u * routh[2]) > 0.0
    }

    /// `dλ/dv` of the eigenvalue `λ` at speed `v`, by the implicit function theorem, 1/m.
    fn drift(&self, speed: f64, value: Complex<f64>) -> Complex<f64> {
        let u = speed * speed;
        let by_speed = value.powi(3) * self.a
            + value.powi(2) * (2.0 * speed * self.b[1])
            + value * (self.c[0] + 3.0 * u * self.c[1])
            + 2.0 * speed * self.e[1];
        let by_value = value.powi(3) * (4.0 * self.a4)
            + value.powi(2) * (3.0 * speed * self.a)
            + value * (2.0 * (self.b[0] + self.b[1] * u))
            + speed * (self.c[0] + self.c[1] * u);
        -by_speed / by_value
    }
}

impl Whipple {
    /// The critical speeds, forward riding.
    #[must_use]
    pub fn critical_speeds(&self) -> CriticalSpeeds {
        let coefficients = Coefficients::of(self);
        let mut oscillatory: Vec<f64> = roots(coefficients.routh())
            .into_iter()
            .filter(|u| *u > 0.0 && coefficients.frequency_squared(*u) > 0.0)
            .map(f64::sqrt)
            .collect();
        oscillatory.sort_by(f64::total_cmp);
        let [e0, e1] = coefficients.e;
        let neutral = Some(-e0 / e1)
            .filter(|u| u.is_finite() && *u > 0.0)
            .map(f64::sqrt);

        let weave = oscillatory.iter().copied().find(|speed| {
            let omega = coefficients.frequency_squared(speed * speed).sqrt();
            coefficients.drift(*speed, Complex::new(0.0, omega)).re < 0.0
        });
        let capsize =
            neutral.filter(|speed| coefficients.drift(*speed, Complex::new(0.0, 0.0)).re > 0.0);

        // Stability changes at critical speeds only, so one test between two neighbours decides.
        let mut borders = vec![0.0];
        borders.extend(&oscillatory);
        borders.extend(neutral);
        borders.sort_by(f64::total_cmp);
        let mut stable: Vec<SpeedRange> = Vec::new();
        for (i, from) in borders.iter().copied().enumerate() {
            let to = borders.get(i + 1).copied();
            let inside = to.map_or(from + 1.0, |to| 0.5 * (from + to));
            if !coefficients.is_stable(inside * inside) {
                continue;
            }
            match stable.last_mut() {
                Some(last) if last.to_mps == Some(from) => last.to_mps = to,
                _ => stable.push(SpeedRange {
                    from_mps: from,
                    to_mps: to,
                }),
            }
        }
        CriticalSpeeds {
            weave,
            capsize,
            oscillatory,
            neutral,
            stable,
        }
    }
}

impl CriticalSpeeds {
    /// Speeds that show it all, m/s: every half up to 10, or up to a fifth past the highest critical speed.
    #[must_use]
    pub fn usual_speeds(&self) -> Vec<f64> {
        let highest = [self.weave, self.capsize]
            .into_iter()
            .flatten()
            .fold(0.0, f64::max);
        let top = (1.2 * highest).clamp(10.0, 50.0).ceil();
        let last = 2 * top as usize;
        // Exact at both ends.
        (0..=last).map(|i| top * (i as f64 / last as f64)).collect()
    }

    /// Standard deviations of weave and capsize speed, m/s, from those of the parameters (symbol, value) taken as
    /// independent, to first order; `None` where there is no such speed.
    #[must_use]
    pub fn deviations(params: &WhippleParams, of: &[(&'static str, f64)]) -> [Option<f64>; 2] {
        let mut variances = [Some(0.0), Some(0.0)];
        let speeds = |params: &WhippleParams| {
            // The slope is asked for next to a set that has been checked; a bound may lie in between.
            let speeds = Whipple::unchecked(params).ok()?.critical_speeds();
            Some([speeds.weave, speeds.capsize])
        };
        for (symbol, deviation) in of {
            let Some(parameter) = Parameter::named(symbol) else {
                continue;
            };
            let value = (parameter.get)(params);
            // Far above rounding, far below the curvature of the speeds.
            let step = 1e-5 * value.abs().max(*deviation);
            let at = |value: f64| {
                let mut moved = *params;
                (parameter.set)(&mut moved, value);
                speeds(&moved)
            };
            let (above, below) = (at(value + step), at(value - step));
            for (i, variance) in variances.iter_mut().enumerate() {
                let ends = above.zip(below).and_then(|(a, b)| a[i].zip(b[i]));
                *variance = variance.zip(ends).map(|(variance, (above, below))| {
                    variance + ((above - below) / (2.0 * step) * deviation).powi(2)
                });
            }
        }
        variances.map(|variance| variance.map(f64::sqrt))
    }
}

/// The real roots of `q0 + q1 u + q2 u²`, without the cancellation of the school formula.
fn roots([q0, q1, q2]: [f64; 3]) -> Vec<f64> {
    let discriminant = q1 * q1 - 4.0 * q2 * q0;
    if discriminant.is_nan() || discriminant < 0.0 {
        return Vec::new();
    }
    let larger = -0.5 * (q1 + discriminant.sqrt().copysign(q1));
    [larger / q2, q0 / larger]
        .into_iter()
        .filter(|root| root.is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn benchmark() -> Whipple {
        Whipple::new(&WhippleParams::benchmark()).unwrap()
    }

    /// Meijaard et al. (2007), Table 2, to the printed digits, which the formula must reach.
    #[test]
    fn the_benchmark_has_the_published_critical_speeds() {
        let speeds = benchmark().critical_speeds();
        let (weave, capsize) = (speeds.weave.unwrap(), speeds.capsize.unwrap());
        assert!((weave - 4.292_382_536_341_11).abs() < 1e-9, "{weave}");
        assert!((capsize - 6.024_262_015_388_37).abs() < 1e-9, "{capsize}");
        assert_eq!(
            speeds.stable,
            [SpeedRange {
                from_mps: weave,
                to_mps: Some(capsize)
            }]
        );
    }

    #[test]
    fn at_a_critical_speed_an_eigenvalue_stands_on_the_imaginary_axis() {
        let bicycle = benchmark();
        let speeds = bicycle.critical_speeds();
        for speed in speeds.oscillatory.iter().chain(&speeds.neutral) {
            let nearest = bicycle
                .eigenvalues(*speed)
                .unwrap()
                .iter()
                .map(|value| value.re.abs())
                .fold(f64::INFINITY, f64::min);
            // Simple eigenvalues of size 10 are good to about 1e-13.
            assert!(nearest < 1e-11, "{speed} m/s: {nearest:e}");
        }
    }

    #[test]
    fn the_stable_ranges_are_where_all_eigenvalues_decay() {
        // Bicycles all around the benchmark: each parameter a fifth smaller and larger.
        let mut tried = 0;
        for symbol in [
            "w", "c", "lam", "IRyy", "xB", "zB", "mB", "IBxx", "xH", "zH", "mF", "IFyy",
        ] {
            for factor in [0.8, 1.2] {
                let mut params = WhippleParams::benchmark();
                let parameter = Parameter::named(symbol).unwrap();
                let value = factor * (parameter.get)(&params);
                (parameter.set)(&mut params, value);
                let Ok(bicycle) = Whipple::new(&params) else {
                    continue;
                };
                let speeds = bicycle.critical_speeds();
                for i in 1..200 {
                    let speed = 0.1 * f64::from(i) + 0.013;
                    let values = bicycle.eigenvalues(speed).unwrap();
                    let decays = values.iter().all(|value| value.re < 0.0);
                    let within = speeds.stable.iter().any(|range| {
                        speed > range.from_mps && range.to_mps.is_none_or(|to| speed < to)
                    });
                    assert_eq!(decays, within, "{symbol} × {factor} at {speed} m/s");
                }
                tried += 1;
            }
        }
        assert!(tried >= 20, "only {tried} were bicycles");
    }

    #[test]
    fn without_trail_and_spin_no_speed_makes_the_bicycle_stable() {
        // An upright steering axis through the contact, wheels that do not spin, and a fork ahead of the axis.
        let mut params = WhippleParams::benchmark();
        params.trail = 0.0;
        params.tilt = 0.0;
        params.rear_wheel.iyy = 0.0;
        params.front_wheel.iyy = 0.0;
        let speeds = Whipple::new(&params).unwrap().critical_speeds();
        assert!(speeds.stable.is_empty(), "{speeds:?}");
    }

    #[test]
    fn deviations_are_the_slope_times_the_deviation() {
        let params = WhippleParams::benchmark();
        let [weave, capsize] =
            CriticalSpeeds::deviations(&params, &[("g", 0.01)]).map(Option::unwrap);
        // Both speeds grow as √g.
        let speeds = benchmark().critical_speeds();
        assert!((weave - speeds.weave.unwrap() * 0.5 * 0.01 / 9.81).abs() < 1e-9);
        assert!((capsize - speeds.capsize.unwrap() * 0.5 * 0.01 / 9.81).abs() < 1e-9);
        // Independent ones add as squares.
        let single = |symbol| CriticalSpeeds::deviations(&params, &[(symbol, 0.01)])[0].unwrap();
        let [both, _] = CriticalSpeeds::deviations(&params, &[("c", 0.01), ("w", 0.01)]);
        assert!((both.unwrap() - single("c").hypot(single("w"))).abs() < 1e-12);
        assert_eq!(CriticalSpeeds::deviations(&params, &[]), [Some(0.0); 2]);
    }

    #[test]
    fn a_quadratic_of_any_degree_gives_its_real_roots() {
        let sorted = |q| {
            let mut found = roots(q);
            found.sort_by(f64::total_cmp);
            found
        };
        assert_eq!(sorted([2.0, -3.0, 1.0]), [1.0, 2.0]);
        assert_eq!(sorted([-4.0, 2.0, 0.0]), [2.0]);
        assert!(sorted([1.0, 0.0, 1.0]).is_empty());
        // The small root of 1e-8: the school formula would lose eight digits of it.
        let small = sorted([1.0, -1e8, 1.0])[0];
        assert!((small - 1e-8).abs() < 1e-22);
    }

    #[test]
    fn the_usual_speeds_reach_past_the_critical_ones() {
        let speeds = |capsize| {
            let mut critical = Whipple::new(&WhippleParams::benchmark())
                .unwrap()
                .critical_speeds();
            critical.capsize = capsize;
            critical.usual_speeds()
        };
        assert_eq!(speeds(None).len(), 21);
        let far = speeds(Some(12.0));
        assert_eq!((far.len(), far[1], *far.last().unwrap()), (31, 0.5, 15.0));
    }
}
