//! Which of the lines that leave a circle are stopped by something near: intervals, joined as they are found.

use std::f64::consts::TAU;

/// Intervals of progress (rad) in shadow, within one range; disjoint and in order.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    low: f64,
    high: f64,
    dark: Vec<(f64, f64)>,
    /// Shadows still to fall, with the distance (m) from which on they are cast.
    waiting: Vec<(f64, f64, f64)>,
}

impl Shadows {
    /// Nothing in shadow between `low` and `high`, which are no more than 2π apart.
    pub(super) fn clear(&mut self, low: f64, high: f64) {
        (self.low, self.high) = (low, high);
        self.dark.clear();
        self.waiting.clear();
    }

    /// What is farther than `distance` between `from` and `to` (less than 2π apart, within π of the middle) will be dark.
    pub(super) fn announce(&mut self, distance: f64, from: f64, to: f64) {
        for turn in [-TAU, 0.0, TAU] {
            let (a, b) = ((from + turn).max(self.low), (to + turn).min(self.high));
            if a < b {
                self.waiting.push((distance, a, b));
            }
        }
    }

    /// Lets the shadows fall that are cast within `distance`; afterwards no question may be about anything nearer.
    pub(super) fn advance(&mut self, distance: f64) {
        let mut k = 0;
        while k < self.waiting.len() {
            if self.waiting[k].0 <= distance {
                let (_, a, b) = self.waiting.swap_remove(k);
                self.darken(a, b);
            } else {
                k += 1;
            }
        }
    }

    fn darken(&mut self, mut a: f64, mut b: f64) {
        let first = self.dark.partition_point(|d| d.1 < a);
        let mut last = first;
        while let Some(d) = self.dark.get(last)
            && d.0 <= b
        {
            a = a.min(d.0);
            b = b.max(d.1);
            last += 1;
        }
        self.dark.splice(first..last, [(a, b)]);
    }

    /// Whether all that lies in the range between `from` and `to` (within π of the middle) is dark. True if nothing does.
    pub(super) fn cover(&self, from: f64, to: f64) -> bool {
        [-TAU, 0.0, TAU].into_iter().all(|turn| {
            let (a, b) = ((from + turn).max(self.low), (to + turn).min(self.high));
            a > b || self.covers_piece(a, b)
        })
    }

    fn covers_piece(&self, a: f64, b: f64) -> bool {
        let k = self.dark.partition_point(|d| d.1 < b);
        self.dark.get(k).is_some_and(|d| d.0 < a && b < d.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadows_that_overlap_are_one() {
        let mut shadows = Shadows::default();
        shadows.clear(0.0, 1.0);
        for (a, b) in [(0.1, 0.3), (0.5, 0.7), (0.25, 0.55), (-1.0, 0.05)] {
            shadows.announce(2.0, a, b);
        }
        assert!(!shadows.cover(0.2, 0.6));
        shadows.advance(2.0);
        assert!(shadows.cover(0.2, 0.6));
        assert!(!shadows.cover(0.2, 0.71));
        assert!(!shadows.cover(0.05, 0.1));
        assert!(
            shadows.cover(1.1, 1.2),
            "beyond the range there is nothing to see"
        );
    }

    #[test]
    fn on_a_full_turn_a_shadow_goes_over_the_seam() {
        let mut shadows = Shadows::default();
        shadows.clear(0.0, TAU);
        shadows.announce(1.0, TAU - 0.2, TAU + 0.3);
        shadows.advance(1.0);
        assert!(shadows.cover(TAU - 0.1, TAU - 0.05));
        assert!(shadows.cover(0.1, 0.2));
        assert!(!shadows.cover(0.2, 0.4));
    }
}
