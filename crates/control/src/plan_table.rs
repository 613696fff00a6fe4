//! A planned path at equally spaced arc lengths, and on beyond its ends.
//!
//! The arc length of a curve has no closed inverse; inverting it anew for each sample would take most of the time of a
//! new path. Between exact inversions a block apart the parameter is the quintic that has their values and their
//! first two derivatives
//!
//! ```text
//! dT/ds = 1/|P'|,     d^2T/ds^2 = -(P' . P'')/|P'|^4,
//! ```
//!
//! and a block that departs from the exact value is divided; beside a cusp it is inverted sample by sample.

use bikebot_geometry::{CurvePath, FergusonCurve, ParametricCurve, Point2, Vector2, cross};

/// Greatest length of a block, m, and least number of blocks in a curve.
const BLOCK: f64 = 0.16;
const LEAST_BLOCKS: f64 = 6.0;
/// How far a place within a block may lie off along the curve, m, and where it is looked for: errors of even and of
/// odd order show there.
const OFF: f64 = 1e-8;
const CHECKED: f64 = 0.3;

/// Where the plan is at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlanSample {
    pub position: Point2,
    /// As the curve has it, in [−π, π] within the path, rad.
    pub heading: f64,
    /// Unit tangent.
    pub tangent: Vector2,
    pub curvature: f64,
}

/// The powers of a curve's parameter.
#[derive(Debug, Clone, Copy)]
struct Powers([Vector2; 4]);

impl Powers {
    fn new(curve: &FergusonCurve) -> Self {
        Self([
            curve.start_point().coords,
            curve.start_tangent(),
            curve.second_derivative(0.0) * 0.5,
            curve.third_derivative(0.0) / 6.0,
        ])
    }

    /// The place at parameter `t`; `heading` is told the derivative and the unit tangent.
    fn at(&self, t: f64, heading: impl FnOnce(Vector2, Vector2) -> f64) -> PlanSample {
        let [p, v, a, j] = self.0;
        let d1 = v + (a * 2.0 + j * (3.0 * t)) * t;
        let d2 = a * 2.0 + j * (6.0 * t);
        let squared = d1.norm_squared();
        let norm = squared.sqrt();
        let tangent = d1 / norm;
        PlanSample {
            position: Point2::from(p + (v + (a + j * t) * t) * t),
            heading: heading(d1, tangent),
            tangent,
            curvature: cross(d1, d2) / (squared * norm),
        }
    }
}

/// The heading along unit tangents that follow each other closely, exact at every sixteenth.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct HeadingAlong {
    before: Option<(Vector2, f64)>,
    count: u32,
}

impl HeadingAlong {
    /// The heading of the next `tangent`, which is `exact()`, rad.
    pub fn next(&mut self, tangent: Vector2, exact: impl FnOnce() -> f64) -> f64 {
        /// Sines up to this have their arc by three terms, to 1e-13 of a radian.
        const SMALL: f64 = 0.02;
        const EXACT_EVERY: u32 = 16;
        let heading = match self.before {
            Some((before, heading)) if !self.count.is_multiple_of(EXACT_EVERY) => {
                let sine = cross(before, tangent);
                if sine.abs() < SMALL && before.dot(&tangent) > 0.0 {
                    let square = sine * sine;
                    heading + sine * (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0)))
                } else {
                    exact()
                }
            }
            _ => exact(),
        };
        self.before = Some((tangent, heading));
        self.count += 1;
        heading
    }

    /// The next tangent does not follow on.
    pub fn start_anew(&mut self) {
        *self = Self::default();
    }
}

impl PlanSample {
    fn on(curve: &FergusonCurve, t: f64) -> Self {
        let mut sample = Powers::new(curve).at(t, |_, _| curve.heading(t));
        if !sample.tangent.x.is_finite() {
            sample.tangent = unit(sample.heading);
        }
        sample
    }

    /// On from here by `way` m, negative for back, along the circle of curvature `curvature`.
    fn along_circle(&self, way: f64, curvature: f64) -> Self {
        let turn = curvature * way;
        let half = 0.5 * turn;
        // sin(x)/x, whose series is exact to rounding here.
        let shortening = if half.abs() < 1e-4 {
            1.0 - half * half / 6.0
        } else {
            half.sin() / half
        };
        let heading = self.heading + turn;
        Self {
            position: self.position + unit(self.heading + half) * (way * shortening),
            heading,
            tangent: unit(heading),
            curvature,
        }
    }
}

fn unit(heading: f64) -> Vector2 {
    let (sin, cos) = heading.sin_cos();
    Vector2::new(cos, sin)
}

/// How a plan goes on beyond an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beyond {
    /// Straight on.
    Straight,
    /// Along the circle of the end's curvature, if it is no tighter than this, 1/m: an average over the end does not
    /// turn its heading.
    Circle(f64),
}

impl Beyond {
    fn curvature(self, end: &PlanSample) -> f64 {
        match self {
            // A cusp has no circle.
            Self::Circle(tightest) if end.curvature.abs() <= tightest => end.curvature,
            _ => 0.0,
        }
    }
}

/// The plan at `first`, `first + step`, … (m), `count` samples.
pub(crate) fn tabulate(
    path: &CurvePath,
    (first, step, count): (f64, f64, usize),
    (before, after): (Beyond, Beyond),
) -> Vec<PlanSample> {
    let length = path.length();
    let segments = path.segments();
    let (start, end) = (
        PlanSample::on(&segments[0], 0.0),
        PlanSample::on(&segments[segments.len() - 1], 1.0),
    );
    let (bend_before, bend_after) = (before.curvature(&start), after.curvature(&end));
    let mut along = Along::new(path);
    (0..count)
        .map(|i| {
            let s = first + i as f64 * step;
            if s < 0.0 {
                start.along_circle(s, bend_before)
            } else if s > length {
                end.along_circle(s - length, bend_after)
            } else {
                along.at(s)
            }
        })
        .collect()
}

/// A traveller along a path that asks for ever greater arc lengths.
struct Along<'p> {
    path: &'p CurvePath,
    segment: usize,
    powers: Powers,
    heading: HeadingAlong,
    block: Option<Block>,
}

/// The parameter at an arc length, with its derivatives by the arc length.
#[derive(Debug, Clone, Copy)]
struct Knot {
    s: f64,
    t: f64,
    rate: f64,
    acceleration: f64,
}

impl Knot {
    fn new(curve: &FergusonCurve, s: f64, t: f64) -> Self {
        let (d1, d2) = (curve.derivative(t), curve.second_derivative(t));
        let squared = d1.norm_squared();
        Self {
            s,
            t,
            rate: 1.0 / squared.sqrt(),
            acceleration: -d1.dot(&d2) / (squared * squared),
        }
    }
}

/// One block of one segment.
struct Block {
    from: Knot,
    to: Knot,
    /// Powers of `x = (s - from)/(to - from)`; none where the quintic does not fit.
    quintic: Option<[f64; 6]>,
}

impl<'p> Along<'p> {
    fn new(path: &'p CurvePath) -> Self {
        Self {
            path,
            segment: 0,
            powers: Powers::new(&path.segments()[0]),
            heading: HeadingAlong::default(),
            block: None,
        }
    }

    fn at(&mut self, s: f64) -> PlanSample {
        let segments = self.path.segments();
        while self.segment + 1 < segments.len() && self.path.segment_start(self.segment + 1) <= s {
            self.segment += 1;
            self.block = None;
            self.heading.start_anew();
            self.powers = Powers::new(&segments[self.segment]);
        }
        if !self.block.as_ref().is_some_and(|block| s <= block.to.s) {
            let before = self.block.take().map(|block| block.to);
            self.block = Some(Block::new(self.path, self.segment, s, before));
        }
        let t = match &self.block {
            Some(Block {
                from,
                to,
                quintic: Some(c),
            }) => {
                let x = (s - from.s) / (to.s - from.s);
                let t = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))));
                t.clamp(0.0, 1.0)
            }
            _ => self.path.locate(s).1,
        };
        let along = &mut self.heading;
        let sample = self
            .powers
            .at(t, |d1, tangent| along.next(tangent, || d1.y.atan2(d1.x)));
        if sample.tangent.x.is_finite() {
            sample
        } else {
            // It stands still here.
            along.start_anew();
            PlanSample::on(&segments[self.segment], t)
        }
    }
}

impl Block {
    /// The block of `segment` that holds arc length `s` of the path; `before` is the end of the block before it.
    fn new(path: &CurvePath, segment: usize, s: f64, before: Option<Knot>) -> Self {
        let block = Self::of_share(path, segment, s, before, 1.0);
        if block.quintic.is_some() {
            block
        } else {
            // The error falls with the sixth power of the length.
            Self::of_share(path, segment, s, before, 3.0)
        }
    }

    /// The block that is one of `shares` of a usual one.
    fn of_share(
        path: &CurvePath,
        segment: usize,
        s: f64,
        before: Option<Knot>,
        shares: f64,
    ) -> Self {
        let (start, end) = (path.segment_start(segment), path.segment_start(segment + 1));
        let count = shares * ((end - start) / BLOCK).ceil().max(LEAST_BLOCKS);
        let width = (end - start) / count;
        let index = ((s - start) / width).floor().clamp(0.0, count - 1.0);
        let curve = &path.segments()[segment];
        let knot = |index: f64| {
            let s = start + index * width;
            let t = if index == 0.0 {
                0.0
            } else if index == count {
                1.0
            } else {
                path.locate(s).1
            };
            Knot::new(curve, s, t)
        };
        let from = match before {
            Some(knot) if knot.s == start + index * width => knot,
            _ => knot(index),
        };
        let to = knot(index + 1.0);
        let (v0, v1) = (from.rate * width, to.rate * width);
        let (a0, a1) = (
            from.acceleration * width * width,
            to.acceleration * width * width,
        );
        let (p, v, a) = (to.t - from.t - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0);
        let quintic = [
            from.t,
            v0,
            0.5 * a0,
            10.0 * p - 4.0 * v + 0.5 * a,
            -15.0 * p + 7.0 * v - a,
            6.0 * p - 3.0 * v + 0.5 * a,
        ];
        let checked: f64 = quintic.iter().rev().fold(0.0, |sum, c| CHECKED * sum + c);
        let exact = path.locate(from.s + CHECKED * width).1;
        let off = (checked - exact).abs() * curve.derivative(exact).norm();
        Self {
            from,
            to,
            quintic: (off <= OFF).then_some(quintic),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::{FergusonCurve, Pose2};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn each_sample_lies_where_the_path_says(
            dx in 1.0f64..6.0, turn in -1.3f64..1.3, swing in 0.6f64..1.5, second in -0.8f64..0.8,
        ) {
            let a = Pose2::new(0.0, 0.0, 0.0);
            let b = Pose2::new(dx, 0.6 * turn, turn);
            let c = b.compose(&Pose2::new(2.0, second, 2.0 * second));
            let path = CurvePath::new(vec![
                FergusonCurve::between(a, b, swing * dx),
                FergusonCurve::between(b, c, 2.0),
            ]).unwrap();
            let (n, h) = (400, path.length() / 400.0);
            let straight = (Beyond::Straight, Beyond::Straight);
            let table = tabulate(&path, (0.0, h, n + 1), straight);
            for (i, sample) in table.iter().enumerate() {
                let exact = path.at(i as f64 * h);
                prop_assert!((sample.position - exact.position).norm() < 3e-8, "{i}");
                prop_assert!((sample.heading - exact.heading).abs() < 1e-6, "{i}");
                let (sin, cos) = exact.heading.sin_cos();
                prop_assert!((sample.tangent - Vector2::new(cos, sin)).norm() < 1e-6, "{i}");
            }
        }
    }

    #[test]
    fn beyond_the_ends_it_goes_on_straight_or_along_the_circle() {
        let path = CurvePath::new(vec![FergusonCurve::between(
            Pose2::new(0.0, 0.0, 0.0),
            Pose2::new(2.0, 1.0, 0.9),
            2.3,
        )])
        .unwrap();
        let (length, h) = (path.length(), 0.01);
        for (beyond, bends) in [(Beyond::Straight, false), (Beyond::Circle(0.9), true)] {
            let table = tabulate(&path, (-0.5, h, 60), (beyond, beyond));
            let start = path.at(0.0);
            let wanted = if bends { start.curvature } else { 0.0 };
            assert_eq!(table[0].curvature, wanted);
            assert!((table[0].heading - (start.heading - 0.5 * wanted)).abs() < 1e-12);
            let after = tabulate(&path, (length, h, 50), (beyond, beyond));
            let end = path.at(length);
            assert!((after[0].position - end.position).norm() < 1e-9);
            assert_eq!(after[30].curvature, if bends { end.curvature } else { 0.0 });
        }
        // Too tight a circle is left alone.
        let table = tabulate(
            &path,
            (-0.1, h, 2),
            (Beyond::Circle(1e-6), Beyond::Straight),
        );
        assert_eq!(table[0].curvature, 0.0);
    }
}
