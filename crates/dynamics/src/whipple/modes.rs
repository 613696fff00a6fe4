//! Eigenvalues by name — weave, capsize, caster — followed over speed.
//!
//! Far above all critical speeds the spectrum sorts itself: one eigenvalue goes to zero (*capsize*, a slow lean),
//! the others grow with speed, one real (*caster*, the front assembly falling into line) and two a pair (*weave*,
//! steering left and right). There the names are given. Downwards they are carried along: from one speed to the
//! next each eigenvalue keeps the name of the nearest one before, in steps so small that no other mode comes as
//! near. Where two modes do meet on the real axis and leave it together, the pair is the weave and the name it
//! took goes to the eigenvalue left behind.

use super::linear::Whipple;
use crate::error::DynamicsError;
use nalgebra::Complex;
use serde::Serialize;

/// A mode of the bicycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Steering and leaning to and fro, headed by the steering; at low speed two real eigenvalues.
    Weave,
    /// A slow lean with little steering.
    Capsize,
    /// The fast alignment of the front assembly with the direction of travel.
    Caster,
}

/// The four eigenvalues at one speed, by name, 1/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modes {
    /// m/s.
    pub speed: f64,
    /// A conjugate pair, that of negative imaginary part first, or two real ones, the smaller first.
    pub weave: [Complex<f64>; 2],
    /// The capsize eigenvalue.
    pub capsize: Complex<f64>,
    /// The caster eigenvalue.
    pub caster: Complex<f64>,
}

/// Names at each place of the array that is carried along.
const NAMES: [Mode; 4] = [Mode::Weave, Mode::Weave, Mode::Capsize, Mode::Caster];
/// The names are given at this multiple of the largest speed of interest.
const FAR: f64 = 4.0;
/// The least such speed of interest, m/s: twice what bicycles reach.
const LEAST_FAR: f64 = 40.0;
/// An eigenvalue may move this share of the way to the nearest one of another mode in one step.
const SHARE: f64 = 0.25;
/// Largest and smallest step, as shares of the speed, and the smallest absolute one, m/s.
const LARGEST_STEP: f64 = 0.05;
const SMALLEST_STEP: f64 = 1e-4;
const LEAST_STEP: f64 = 1e-5;

impl Modes {
    /// All four with their names.
    pub fn iter(&self) -> impl Iterator<Item = (Mode, Complex<f64>)> {
        NAMES.into_iter().zip(self.array())
    }

    /// Every disturbance dies away.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.array().iter().all(|value| value.re < 0.0)
    }

    /// The weave is an oscillation.
    #[must_use]
    pub fn weave_oscillates(&self) -> bool {
        self.weave[1].im > 0.0
    }

    fn array(&self) -> [Complex<f64>; 4] {
        [self.weave[0], self.weave[1], self.capsize, self.caster]
    }
}

impl Whipple {
    /// The modes at each of the `speeds` (m/s, not negative, in any order), in their order.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::NoEigenvalues`] at a speed that is negative, not finite, or too large for numbers.
    pub fn modes(&self, speeds: &[f64]) -> Result<Vec<Modes>, DynamicsError> {
        let unfit = |speed: &&f64| !(speed.is_finite() && **speed >= 0.0);
        if let Some(speed) = speeds.iter().find(unfit) {
            return Err(DynamicsError::NoEigenvalues { speed: *speed });
        }
        let critical = self.critical_speeds();
        let of_interest = speeds
            .iter()
            .chain(&critical.oscillatory)
            .chain(&critical.neutral)
            .copied()
            .fold(LEAST_FAR, f64::max);
        let mut here = FAR * of_interest;
        let mut values = named(self.eigenvalues(here)?);

        let mut order: Vec<usize> = (0..speeds.len()).collect();
        order.sort_by(|a, b| speeds[*b].total_cmp(&speeds[*a]));
        let mut found = vec![None; speeds.len()];
        for index in order {
            values = self.carried(here, values, speeds[index])?;
            here = speeds[index];
            found[index] = Some(Modes {
                speed: here,
                weave: ordered([values[0], values[1]]),
                capsize: values[2],
                caster: values[3],
            });
        }
        Ok(found.into_iter().flatten().collect())
    }

    /// The modes over a range of speeds (m/s) at `count` places and on both sides of each speed at which the weave
    /// begins or ceases to oscillate: curves through them branch where the eigenvalues do.
    ///
    /// # Errors
    ///
    /// As [`modes`](Self::modes).
    pub fn mode_curves(
        &self,
        from: f64,
        to: f64,
        count: usize,
    ) -> Result<Vec<Modes>, DynamicsError> {
        let last = count.max(2) - 1;
        let speeds: Vec<f64> = (0..=last)
            .map(|i| {
                let share = i as f64 / last as f64;
                from * (1.0 - share) + to * share
            })
            .collect();
        let even = self.modes(&speeds)?;
        let mut curves: Vec<Modes> = Vec::with_capacity(even.len() + 4);
        for modes in even {
            if let Some(before) = curves.last().copied()
                && before.weave_oscillates() != modes.weave_oscillates()
            {
                let [below, above] = self.branching(before, modes)?;
                curves.extend([below, above]);
            }
            curves.push(modes);
        }
        Ok(curves)
    }

    /// The speed between two at which the weave begins or ceases to oscillate, from both sides.
    fn branching(&self, mut below: Modes, mut above: Modes) -> Result<[Modes; 2], DynamicsError> {
        // Forty halvings of a step of a table: the eigenvalues are then a millionth apart.
        for _ in 0..40 {
            let middle = self.modes(&[0.5 * (below.speed + above.speed)])?[0];
            if middle.weave_oscillates() == below.weave_oscillates() {
                below = middle;
            } else {
                above = middle;
            }
        }
        Ok([below, above])
    }

    /// The eigenvalues at the lower speed `to`, each at the place of the one it came from.
    fn carried(
        &self,
        from: f64,
        values: [Complex<f64>; 4],
        to: f64,
    ) -> Result<[Complex<f64>; 4], DynamicsError> {
        let (mut here, mut values) = (from, values);
        let mut step = (LARGEST_STEP * here).max(LEAST_STEP);
        while here > to {
            let least = (SMALLEST_STEP * here).max(LEAST_STEP);
            step = step.clamp(least, (LARGEST_STEP * here).max(least));
            // A last step that would leave a crumb takes it along.
            let next = if here - step < to + 0.5 * least {
                to
            } else {
                here - step
            };
            let matched = matched(&values, self.eigenvalues(next)?);
            let is_sure = (0..4).all(|i| {
                let nearest = (0..4)
                    .filter(|j| NAMES[*j] != NAMES[i])
                    .map(|j| (values[i] - values[j]).norm())
                    .fold(f64::INFINITY, f64::min);
                (matched[i] - values[i]).norm() <= SHARE * nearest
            });
            if !is_sure && here - next > 1.5 * least {
                step = 0.5 * (here - next);
                continue;
            }
            values = renamed(matched);
            here = next;
            step *= 2.0;
        }
        Ok(values)
    }
}

/// Of all ways to pair the old with the new the one with the least way in total.
fn matched(old: &[Complex<f64>; 4], new: [Complex<f64>; 4]) -> [Complex<f64>; 4] {
    let mut best = (f64::INFINITY, new);
    for a in 0..4 {
        for b in (0..4).filter(|b| *b != a) {
            for c in (0..4).filter(|c| *c != a && *c != b) {
                let d = 6 - a - b - c;
                let order = [new[a], new[b], new[c], new[d]];
                let way: f64 = (0..4).map(|i| (order[i] - old[i]).norm()).sum();
                if way < best.0 {
                    best = (way, order);
                }
            }
        }
    }
    best.1
}

/// The names far above all critical speeds.
fn named(values: [Complex<f64>; 4]) -> [Complex<f64>; 4] {
    let is_real = |value: &Complex<f64>| value.im == 0.0;
    let mut reals: Vec<_> = values.iter().copied().filter(is_real).collect();
    let mut others: Vec<_> = values.iter().copied().filter(|v| !is_real(v)).collect();
    reals.sort_by(|a, b| a.re.total_cmp(&b.re));
    match reals.len() {
        // Two pairs: the faster oscillation is the weave, the other one caster and capsize in one.
        0 => {
            others.sort_by(|a, b| b.im.abs().total_cmp(&a.im.abs()));
            [others[0], others[1], others[2], others[3]]
        }
        2 => {
            let capsize = usize::from(reals[1].re.abs() < reals[0].re.abs());
            [others[0], others[1], reals[capsize], reals[1 - capsize]]
        }
        // All real: the slowest is the capsize, the fastest to decay the caster.
        _ => {
            let slowest = (1..4)
                .min_by(|a, b| reals[*a].re.abs().total_cmp(&reals[*b].re.abs()))
                .unwrap_or(3);
            let capsize = reals.remove(slowest);
            [reals[1], reals[2], capsize, reals[0]]
        }
    }
}

/// After a meeting of two modes: the weave is the pair, and of capsize and caster the caster decays faster.
fn renamed(mut values: [Complex<f64>; 4]) -> [Complex<f64>; 4] {
    let is_real = |value: Complex<f64>| value.im == 0.0;
    if is_real(values[0]) != is_real(values[1]) {
        let alone = usize::from(is_real(values[1]));
        // Conjugates come in pairs, so one of capsize and caster is the other half of the pair.
        let taken = if is_real(values[2]) { 3 } else { 2 };
        values.swap(alone, taken);
    }
    if is_real(values[2]) && is_real(values[3]) && values[3].re > values[2].re {
        values.swap(2, 3);
    }
    values
}

fn ordered([a, b]: [Complex<f64>; 2]) -> [Complex<f64>; 2] {
    let is_in_order = a.im.total_cmp(&b.im).then(a.re.total_cmp(&b.re)).is_le();
    if is_in_order { [a, b] } else { [b, a] }
}

#[cfg(test)]
mod tests {
    use super::super::params::{PARAMETERS, WhippleParams};
    use super::*;
    use proptest::prelude::*;

    fn benchmark() -> Whipple {
        Whipple::new(&WhippleParams::benchmark()).unwrap()
    }

    fn grid(n: u32, step: f64) -> Vec<f64> {
        (0..=n).map(|i| f64::from(i) * step).collect()
    }

    #[test]
    fn the_modes_of_the_benchmark_at_five_metres_a_second_have_their_names() {
        let modes = benchmark().modes(&[5.0]).unwrap()[0];
        // Meijaard et al. (2007), Table 2.
        assert!((modes.caster.re + 14.078_389_692_798_24).abs() < 1e-11);
        assert!((modes.capsize.re + 0.322_866_429_004_09).abs() < 1e-11);
        assert!((modes.weave[1].re + 0.775_341_882_195_85).abs() < 1e-11);
        assert!((modes.weave[1].im - 4.464_867_713_788_23).abs() < 1e-11);
        assert_eq!(modes.weave[0], modes.weave[1].conj());
        assert!(modes.is_stable() && modes.weave_oscillates());
    }

    #[test]
    fn below_the_double_root_the_weave_is_two_real_eigenvalues() {
        // The two positive ones at rest; they meet at 0.684 m/s.
        let modes = benchmark().modes(&[0.0, 0.6, 0.7]).unwrap();
        assert!((modes[0].weave[0].re - 3.131_643_247_906_6).abs() < 1e-11);
        assert!((modes[0].weave[1].re - 5.530_943_717_653_9).abs() < 1e-11);
        assert!((modes[0].capsize.re + 3.131_643_247_906_6).abs() < 1e-11);
        assert!((modes[0].caster.re + 5.530_943_717_653_9).abs() < 1e-11);
        assert!(!modes[1].weave_oscillates() && modes[2].weave_oscillates());
    }

    #[test]
    fn names_do_not_depend_on_the_speeds_asked_for() {
        let bicycle = benchmark();
        let speeds = grid(100, 0.1);
        let together = bicycle.modes(&speeds).unwrap();
        for (speed, modes) in speeds.iter().zip(&together) {
            assert_eq!(bicycle.modes(&[*speed]).unwrap()[0], *modes, "{speed} m/s");
        }
        let mut backwards = speeds.clone();
        backwards.reverse();
        let mut turned = bicycle.modes(&backwards).unwrap();
        turned.reverse();
        assert_eq!(turned, together);
    }

    #[test]
    fn every_mode_is_continuous_in_the_speed() {
        let modes = benchmark().modes(&grid(5000, 0.002)).unwrap();
        for pair in modes.windows(2) {
            for ((_, a), (_, b)) in pair[0].iter().zip(pair[1].iter()) {
                // Steepest at the double root, where the pair leaves the axis as a square root: √0.002 times 3.
                assert!((a - b).norm() < 0.2, "{pair:?}");
            }
        }
    }

    #[test]
    fn curves_branch_where_the_eigenvalues_do() {
        let curves = benchmark().mode_curves(0.0, 10.0, 11).unwrap();
        let grown: Vec<_> = curves
            .windows(2)
            .filter(|pair| pair[0].speed < pair[1].speed)
            .collect();
        assert_eq!((curves.len(), grown.len()), (13, 12));
        // Meijaard et al. (2007): the double root at 0.684 283 m/s, where both are 3.782 90 1/s.
        for modes in &curves[1..3] {
            assert!((modes.speed - 0.684_283).abs() < 5e-7, "{modes:?}");
            for value in modes.weave {
                assert!((value - 3.782_90).norm() < 1e-4, "{modes:?}");
            }
        }
    }

    #[test]
    fn the_four_eigenvalues_are_all_there() {
        let bicycle = benchmark();
        for modes in bicycle.modes(&grid(50, 0.2)).unwrap() {
            let mut values: Vec<_> = modes.iter().map(|(_, value)| value).collect();
            values.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
            assert_eq!(values, bicycle.eigenvalues(modes.speed).unwrap());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Bicycles of all sorts: trails and tilts of either sign, heavy forks, small wheels, no rider.
        #[test]
        fn the_modes_of_any_bicycle_are_its_eigenvalues(
            factors in proptest::collection::vec(0.3_f64..2.0, 26),
            trail in -0.2_f64..0.3,
            tilt in -0.5_f64..1.0,
        ) {
            let mut params = WhippleParams::benchmark();
            for (parameter, factor) in PARAMETERS.iter().zip(&factors) {
                let value = factor * (parameter.get)(&params);
                (parameter.set)(&mut params, value);
            }
            params.trail = trail;
            params.tilt = tilt;
            let Ok(bicycle) = Whipple::new(&params) else {
                return Ok(());
            };
            for modes in bicycle.modes(&[0.0, 0.7, 3.0, 7.0, 25.0]).unwrap() {
                let mut values: Vec<_> = modes.iter().map(|(_, value)| value).collect();
                values.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
                prop_assert_eq!(values, bicycle.eigenvalues(modes.speed).unwrap());
                // The weave is a pair or two real ones, never half of each.
                prop_assert_eq!(modes.weave[0].im, -modes.weave[1].im);
            }
        }
    }

    #[test]
    fn a_speed_that_is_none_is_refused() {
        for speed in [-1.0, f64::NAN, f64::INFINITY] {
            let refused = benchmark().modes(&[1.0, speed]).unwrap_err();
            assert!(refused.to_string().contains("m/s"), "{refused}");
        }
    }
}
