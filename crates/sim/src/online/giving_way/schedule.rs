//! When the bike will be where.

use super::corridor::PIECE;

/// A ride as it may go on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pace<'a> {
    /// Where the bike is, m.
    pub s: f64,
    /// m/s.
    pub speed: f64,
    /// Greatest speed at the ends of the pieces, m/s: one more than there are pieces.
    pub profile: &'a [f64],
    /// Share of the profile that is ridden.
    pub share: f64,
    /// Greatest speed, m/s.
    pub cap: f64,
    /// Where the bike shall stand, m.
    pub stop: f64,
    /// m/s².
    pub up: f64,
    /// Deceleration towards the stop, m/s².
    pub braking: f64,
    /// Hardest deceleration, m/s².
    pub hardest: f64,
    /// Time before anything happens, s: setting off takes a while.
    pub delay: f64,
}

impl Pace<'_> {
    /// Lead time, s, at which the rear contact comes to each end of a piece, the first of which is where it is; infinite where it never comes.
    pub fn arrivals(&self) -> Vec<f64> {
        let mut arrivals = vec![f64::INFINITY; self.profile.len()];
        let Some(first) = arrivals.first_mut() else {
            return arrivals;
        };
        *first = 0.0;
        let (mut time, mut speed) = (self.delay, self.speed.max(0.0));
        for (k, (arrival, profile)) in arrivals.iter_mut().zip(self.profile).enumerate().skip(1) {
            let left = self.stop - (self.s + k as f64 * PIECE);
            let to_stop = (2.0 * self.braking * left.max(0.0)).sqrt();
            let wanted = (self.share * profile).min(self.cap).min(to_stop);
            let after =
                |acceleration: f64| (speed * speed + 2.0 * acceleration * PIECE).max(0.0).sqrt();
            let next = wanted.min(after(self.up)).max(after(-self.hardest));
            let mean = 0.5 * (speed + next);
            if left <= 0.0 && next <= 0.0 || mean <= 0.0 {
                break;
            }
            time += PIECE / mean;
            speed = next;
            *arrival = time;
        }
        arrivals
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pace(profile: &[f64]) -> Pace<'_> {
        Pace {
            s: 2.0,
            speed: 1.5,
            profile,
            share: 1.0,
            cap: f64::INFINITY,
            stop: f64::INFINITY,
            up: 0.3,
            braking: 0.5,
            hardest: 1.0,
            delay: 0.0,
        }
    }

    #[test]
    fn at_constant_speed_time_is_way_over_speed() {
        let profile = [1.5; 61];
        let arrivals = pace(&profile).arrivals();
        assert!((arrivals[60] - 4.0).abs() < 1e-9, "{}", arrivals[60]);
    }

    #[test]
    fn setting_off_takes_its_time() {
        // 1.5 m at 0.3 m/s² take √(2·1.5/0.3) s, after a second of waiting.
        let profile = [1.5; 16];
        let arrivals = Pace {
            speed: 0.0,
            delay: 1.0,
            ..pace(&profile)
        }
        .arrivals();
        assert!((arrivals[15] - 1.0 - 10f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_stop_is_never_passed_and_reached_in_the_time_of_braking() {
        // 2.25 m from 1.5 m/s at 0.5 m/s²: 3 s.
        let profile = [1.5; 41];
        let arrivals = Pace {
            stop: 4.25,
            ..pace(&profile)
        }
        .arrivals();
        assert!(arrivals[23].is_infinite() && arrivals[40].is_infinite());
        // At 5 cm before it the bike still has √(2·0.5·0.05) m/s, that is 0.45 s to go.
        assert!(
            (arrivals[22] - (3.0 - 0.447)).abs() < 0.01,
            "{}",
            arrivals[22]
        );
    }

    #[test]
    fn a_stop_too_near_is_overshot_as_far_as_braking_takes() {
        let profile = [1.5; 41];
        let arrivals = Pace {
            stop: 2.0,
            ..pace(&profile)
        }
        .arrivals();
        // 1.125 m at 1 m/s².
        assert!(arrivals[11].is_finite() && arrivals[12].is_infinite());
    }
}
