//! Is this motion free, for this footprint? Conservative bisection on clearance; no sampling step.
//!
//! If no point of the footprint moves faster than `V` per unit of the curve's parameter, a clearance `c`
//! at parameter `m` proves clearance of at least `c − V |t − m|` at every other `t`. One query thus
//! clears an interval about `m`; what it leaves on both sides is examined the same way, middle first, because
//! collisions usually show there. `true` means the clearance is at least the margin *everywhere*
//! on the motion. `false` may be pessimistic by half the resolution δ.
//!
//! A point or a disc has `V ≥ |dP/dT|`, and its clearance is that of its centre less its radius.
//! Another outline also swings: `V` grows by its reach times a bound on |dθ/dT| over the
//! interval at hand. Covering discs accept cheaply; only where they do not is the exact shape asked.
//!
//! Every query and bound may be infinite or not a number (a cusp turns infinitely fast, input may be nonsense): comparisons
//! are written so that anything but a proof refuses, and the work per motion is bounded.

use bikebot_geometry::{CurvePath, FergusonCurve, ParametricCurve, Point2, Pose2, Vector2, angle};
use bikebot_world::{Footprint, FootprintDisc, World};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Intervals still to be examined. Each level at least halves the interval, so this depth resolves 2⁻⁶⁰ of a motion.
const STACK: usize = 62;
/// In place of the clearance at the ends of an interval that is not known yet.
const UNASKED: f64 = f64::INFINITY;
/// Most queries for one motion, and most intervals split in search of the least clearance. Reached only if the resolution
/// is absurdly fine for the length of the motion.
pub(crate) const MAX_QUERIES: u32 = 20_000;

/// Decides whether poses and motions of one footprint are free in one world.
#[derive(Debug, Clone)]
pub struct MotionChecker<'w> {
    world: &'w World,
    footprint: Footprint,
    /// Radius if the footprint is a disc about its reference point (0 for a point).
    round: Option<f64>,
    /// Radius of the largest disc about the reference point that the footprint contains, m.
    inscribed: f64,
    /// Farthest point of the footprint from its reference point, m.
    reach: f64,
    discs: Vec<FootprintDisc>,
    margin: f64,
    resolution: f64,
}

impl<'w> MotionChecker<'w> {
    /// A checker that asks for `margin` (m) between footprint and obstacles, and may refuse what comes within
    /// half of `resolution` (m, δ) of that.
    #[must_use]
    pub fn new(world: &'w World, footprint: &Footprint, margin: f64, resolution: f64) -> Self {
        let round = match footprint {
            Footprint::Point => Some(0.0),
            Footprint::Disc { radius } => Some(*radius),
            _ => None,
        };
        Self {
            world,
            round,
            inscribed: footprint.inscribed_radius(),
            reach: footprint.reach(),
            discs: footprint.discs(),
            footprint: footprint.clone(),
            margin,
            resolution,
        }
    }

    /// The checker for a search that ignores headings: the largest disc about the reference point that the footprint
    /// contains. Where even that cannot pass, the footprint cannot.
    #[must_use]
    pub fn inscribed(&self) -> Self {
        let disc = if self.inscribed > 0.0 {
            Footprint::Disc {
                radius: self.inscribed,
            }
        } else {
            Footprint::Point
        };
        Self::new(self.world, &disc, self.margin, self.resolution)
    }

    /// The world asked.
    #[must_use]
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// What must fit.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// The clearance asked for, m.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// How far from touching a motion may be refused, δ, m.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// Radius of the largest disc about the reference point that the footprint contains, m.
    #[must_use]
    pub fn inscribed_radius(&self) -> f64 {
        self.inscribed
    }

    /// Signed distance from the footprint at `pose` to the nearest obstacle or edge, m; negative if they overlap.
    #[must_use]
    pub fn pose_clearance(&self, pose: &Pose2) -> f64 {
        match self.round {
            Some(radius) => self.world.clearance(pose.position) - radius,
            None => self.world.footprint_clearance(&self.footprint, pose),
        }
    }

    /// Signed distance from the inscribed disc at `position` to the nearest obstacle or edge, m.
    #[must_use]
    pub fn position_clearance(&self, position: Point2) -> f64 {
        self.world.clearance(position) - self.inscribed
    }

    /// Whether the footprint at `pose` has more than the margin, by at least half the resolution.
    #[must_use]
    pub fn is_pose_free(&self, pose: &Pose2) -> bool {
        let need = self.margin + 0.5 * self.resolution;
        self.lower_bound(pose, need) >= need
    }

    /// Whether the straight motion from `from` to `to` is free, the heading along it.
    #[must_use]
    pub fn is_segment_free(&self, from: Point2, to: Point2) -> bool {
        self.obstruction(from, to).is_none()
    }

    /// Where the straight motion from `from` to `to` was found not to be free; `None` if it is free. Of several such places
    /// it is the first that bisection comes upon, not the first on the way.
    pub(crate) fn obstruction(&self, from: Point2, to: Point2) -> Option<Point2> {
        let motion = Straight::new(from, to);
        self.sweep(&motion).map(|t| motion.pose(t).position)
    }

    /// Whether the footprint carried along `curve`, the heading along it, is free.
    #[must_use]
    pub fn is_curve_free(&self, curve: &FergusonCurve) -> bool {
        self.sweep(&Curved::new(curve)).is_none()
    }

    /// A value of the clearance at `pose` that is a lower bound always, and exact where it is below `need`.
    fn lower_bound(&self, pose: &Pose2, need: f64) -> f64 {
        let p = pose.position;
        if let Some(radius) = self.round {
            let bound = self.world.clearance_lower_bound(p) - radius;
            if bound >= need {
                return bound;
            }
            return self.world.clearance(p) - radius;
        }
        let direction = pose.direction();
        let left = Vector2::new(-direction.y, direction.x);
        let cover = |clearance: &dyn Fn(Point2) -> f64| {
            self.discs
                .iter()
                .map(|disc| {
                    clearance(p + direction * disc.offset + left * disc.lateral) - disc.radius
                })
                .fold(f64::INFINITY, |least, c| {
                    if c < least || c.is_nan() { c } else { least }
                })
        };
        if !self.discs.is_empty() {
            let bound = cover(&|q| self.world.clearance_lower_bound(q));
            if bound >= need {
                return bound;
            }
            let bound = cover(&|q| self.world.clearance(q));
            if bound >= need {
                return bound;
            }
        }
        self.world.footprint_clearance(&self.footprint, pose)
    }

    /// The parameter at which the motion was refused; `None` if it is free.
    fn sweep(&self, motion: &impl Motion) -> Option<f64> {
        let floor = self.margin + 0.5 * self.resolution;
        let mut stack = [(0.0, 0.0); STACK];
        stack[0] = (0.0, 1.0);
        let mut height = 1;
        let mut queries = 0;
        while height > 0 {
            height -= 1;
            let (from, to) = stack[height];
            let middle = 0.5 * (from + to);
            let half = 0.5 * (to - from);
            let rate = self.rate(motion, from, to);
            queries += 1;
            if queries > MAX_QUERIES || height + 2 > STACK {
                return Some(middle);
            }
            let need = self.margin + rate * half;
            let clearance = self.lower_bound(&motion.pose(middle), need.max(floor));
            if clearance < floor || clearance.is_nan() {
                return Some(middle);
            }
            let proven = (clearance - self.margin) / rate;
            if proven >= half {
                continue;
            }
            if !(rate.is_finite() && proven > 0.0) {
                // Nothing proven beyond the middle itself: halve, until the interval is as good as a point.
                if half <= f64::EPSILON {
                    return Some(middle);
                }
                stack[height] = (from, middle);
                stack[height + 1] = (middle, to);
            } else {
                stack[height] = (from, middle - proven);
                stack[height + 1] = (middle + proven, to);
            }
            height += 2;
        }
        None
    }

    /// No point of the footprint moves faster than this between the two parameters, m per unit of the parameter.
    fn rate(&self, motion: &impl Motion, from: f64, to: f64) -> f64 {
        if self.round.is_some() {
            motion.speed()
        } else {
            motion.speed() + self.reach * motion.heading_rate(from, to)
        }
    }

    /// Least clearance of the footprint along a chain of curves, m: a value the clearance is nowhere below, and less than the least value
    /// there is by no more than `tolerance` allows.
    #[must_use]
    pub fn least_clearance_of_path(&self, path: &CurvePath, tolerance: Tolerance) -> f64 {
        let motions: Vec<_> = path.segments().iter().map(Curved::new).collect();
        self.least_clearance(&motions, tolerance)
    }

    /// The same along a polyline, the heading along each leg; the turns on the spot at its vertices are not looked at.
    #[must_use]
    pub fn least_clearance_of_polyline(&self, vertices: &[Point2], tolerance: Tolerance) -> f64 {
        if let [only] = vertices {
            return self.position_clearance(*only);
        }
        let motions: Vec<_> = vertices
            .windows(2)
            .map(|w| Straight::new(w[0], w[1]))
            .collect();
        self.least_clearance(&motions, tolerance)
    }

    /// Best-first branch and bound over all intervals of all motions: always split the one that may hold the least.
    ///
    /// Of an interval the clearances `a` and `b` at its ends are known, and two bounds on what lies between. One is that of the
    /// sweep from both ends, (a + b − V Δt)/2. Beside a wall that is poor: it needs an interval for each tolerance's worth of way. But
    /// no point of the footprint meets an obstacle in the discs of radius a and b about both ends of its own way,
    /// and for ends L apart the point between them nearest to the outside of both discs is √(a² − x²) from it, at
    /// x = (L² + a² − b²)/(2L) from the first. That falls with L, so the longest of these chords counts; and what the points' ways deviate
    /// from their chords, A Δt²/8, is taken off.
    fn least_clearance(&self, motions: &[impl Motion], tolerance: Tolerance) -> f64 {
        let mut best = f64::INFINITY;
        let mut open = BinaryHeap::new();
        for (index, motion) in motions.iter().enumerate() {
            // Most of a path is far from everything, as a look at the clearance field tells; its clearance is then never asked for.
            let middle = self.lower_bound(&motion.pose(0.5), f64::NEG_INFINITY);
            let bound = proven(middle - 0.5 * self.rate(motion, 0.0, 1.0));
            open.push(Interval {
                bound,
                index,
                from: (0.0, UNASKED),
                to: (1.0, UNASKED),
            });
        }
        let mut queries = 0;
        while let Some(interval) = open.pop() {
            queries += 1;
            if best - interval.bound <= tolerance.at(best) || queries > tolerance.questions {
                return interval.bound.min(best);
            }
            let motion = &motions[interval.index];
            if interval.from.1 == UNASKED {
                // One question in the middle often says that the way is far from what is nearest.
                let middle = (0.5, self.pose_clearance(&motion.pose(0.5)));
                best = best.min(middle.1);
                open.push(Interval {
                    bound: proven(middle.1 - 0.5 * self.rate(motion, 0.0, 1.0)),
                    index: interval.index,
                    from: middle,
                    to: middle,
                });
                continue;
            }
            if interval.from.0 == interval.to.0 {
                let [from, to] = [0.0, 1.0].map(|t| (t, self.pose_clearance(&motion.pose(t))));
                best = best.min(from.1).min(to.1);
                open.push(self.interval(motion, interval.index, from, interval.from));
                open.push(self.interval(motion, interval.index, interval.to, to));
                continue;
            }
            let middle = 0.5 * (interval.from.0 + interval.to.0);
            let middle = (middle, self.pose_clearance(&motion.pose(middle)));
            best = best.min(middle.1);
            open.push(self.interval(motion, interval.index, interval.from, middle));
            open.push(self.interval(motion, interval.index, middle, interval.to));
        }
        best
    }

    /// The interval between two parameters, each with the clearance there.
    fn interval(
        &self,
        motion: &impl Motion,
        index: usize,
        from: (f64, f64),
        to: (f64, f64),
    ) -> Interval {
        let part = to.0 - from.0;
        let (a, b) = (motion.pose(from.0), motion.pose(to.0));
        let mut chord = (b.position - a.position).norm();
        let mut rate = motion.speed();
        let mut acceleration = motion.acceleration(from.0, to.0);
        if self.round.is_none() {
            let (turn_rate, turn_acceleration) = motion.turning(from.0, to.0);
            chord += 2.0 * self.reach * (0.5 * angle::difference(b.heading, a.heading)).sin().abs();
            rate += self.reach * turn_rate;
            acceleration += self.reach * (turn_acceleration + turn_rate * turn_rate);
        }
        let swept = 0.5 * (from.1 + to.1 - rate * part);
        let deviation = 0.125 * acceleration * part * part;
        let between = clearance_between(from.1, to.1, chord) - deviation;
        let bound = if between > swept { between } else { swept };
        Interval {
            bound: proven(bound),
            index,
            from,
            to,
        }
    }
}

/// Least clearance on a segment of length `chord` (m) at whose ends it is `a` and `b` (m): the distance from the segment to
/// the outside of the discs of these radii about its ends. −∞ where the discs do not cover the segment together.
fn clearance_between(a: f64, b: f64, chord: f64) -> f64 {
    if !(a > 0.0 && b > 0.0 && a + b > chord) {
        return f64::NEG_INFINITY;
    }
    if (a - b).abs() >= chord {
        // The smaller disc lies within the larger, and its centre is nearest to the outside.
        let (smaller, larger) = if a < b { (a, b) } else { (b, a) };
        return smaller.max(larger - chord);
    }
    let x = 0.5 * (chord + (a - b) * (a + b) / chord);
    if x <= 0.0 {
        return a;
    }
    if x >= chord {
        return b;
    }
    ((a - x) * (a + x)).max(0.0).sqrt()
}

/// A motion over the parameter interval [0, 1].
trait Motion {
    fn pose(&self, t: f64) -> Pose2;
    /// Bound on |dP/dT|.
    fn speed(&self) -> f64;
    /// Bound on |dθ/dT| between two parameters.
    fn heading_rate(&self, from: f64, to: f64) -> f64;
    /// Bounds on |dθ/dT| and |d²θ/dT²| between two parameters.
    fn turning(&self, from: f64, to: f64) -> (f64, f64);
    /// Bound on |d²P/dT²| between two parameters.
    fn acceleration(&self, from: f64, to: f64) -> f64;
}

struct Straight {
    from: Point2,
    step: Vector2,
    speed: f64,
    heading: f64,
}

impl Straight {
    fn new(from: Point2, to: Point2) -> Self {
        let step = to - from;
        Self {
            from,
            step,
            speed: step.norm(),
            heading: step.y.atan2(step.x),
        }
    }
}

impl Motion for Straight {
    fn pose(&self, t: f64) -> Pose2 {
        Pose2 {
            position: self.from + self.step * t,
            heading: self.heading,
        }
    }

    fn speed(&self) -> f64 {
        self.speed
    }

    fn heading_rate(&self, _: f64, _: f64) -> f64 {
        0.0
    }

    fn turning(&self, _: f64, _: f64) -> (f64, f64) {
        (0.0, 0.0)
    }

    fn acceleration(&self, _: f64, _: f64) -> f64 {
        0.0
    }
}

struct Curved<'c> {
    curve: &'c FergusonCurve,
    speed: f64,
}

impl<'c> Curved<'c> {
    fn new(curve: &'c FergusonCurve) -> Self {
        Self {
            curve,
            speed: curve.speed_bound(),
        }
    }
}

impl Motion for Curved<'_> {
    fn pose(&self, t: f64) -> Pose2 {
        Pose2 {
            position: self.curve.point(t),
            heading: self.curve.heading(t),
        }
    }

    fn speed(&self) -> f64 {
        self.speed
    }

    fn heading_rate(&self, from: f64, to: f64) -> f64 {
        self.curve.heading_rate_bound(from, to)
    }

    fn turning(&self, from: f64, to: f64) -> (f64, f64) {
        self.curve.heading_bounds(from, to)
    }

    fn acceleration(&self, from: f64, to: f64) -> f64 {
        // Linear in T, so largest at an end.
        let at = |t| self.curve.second_derivative(t).norm();
        at(from).max(at(to))
    }
}

/// How closely a least value is looked for: to the greater of the two, or as closely as so many questions tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// m.
    pub absolute: f64,
    /// Part of the value.
    pub relative: f64,
    /// Intervals looked at. What is proven when they are used up holds, but may be far below the least value.
    pub questions: u32,
}

impl Tolerance {
    /// To so many metres.
    #[must_use]
    pub fn of(absolute: f64) -> Self {
        Self {
            absolute,
            relative: 0.0,
            questions: MAX_QUERIES,
        }
    }

    /// m, for the least found so far, which is infinite before any is.
    fn at(&self, value: f64) -> f64 {
        let relative = if value.is_finite() {
            self.relative * value
        } else {
            0.0
        };
        self.absolute.max(relative).max(1e-9)
    }
}

/// What is proven by `bound`: not a number proves nothing.
fn proven(bound: f64) -> f64 {
    if bound.is_nan() {
        f64::NEG_INFINITY
    } else {
        bound
    }
}

/// An interval of one motion with a lower bound of the clearance on it; the least bound is the greatest entry of a heap.
struct Interval {
    /// Of the clearance on the whole motion, while the interval is but its middle.
    bound: f64,
    index: usize,
    /// Parameter, and the clearance there (m). Both are the same point where only that has been asked for.
    from: (f64, f64),
    to: (f64, f64),
}

impl PartialEq for Interval {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Interval {}

impl PartialOrd for Interval {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Interval {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .bound
            .total_cmp(&self.bound)
            .then(other.index.cmp(&self.index))
            .then(other.from.0.total_cmp(&self.from.0))
    }
}

#[cfg(test)]
mod tests;
