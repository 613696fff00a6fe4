//! Uniform cubic B-splines of the plane, and the Ferguson–Coons segments they consist of.
//!
//! Control points c_0 … c_{M+2}; segment i is decided by c_i … c_{i+3}:
//!
//! ```text
//!     P(T) = Σ_k B_k(T) c_{i+k},   x0 = (c_i + 4 c_{i+1} + c_{i+2})/6,   v0 = (c_{i+2} − c_i)/2,
//! ```
//!
//! likewise at its end. Neighbours share position, first and second derivative in `T`, so curvature is continuous:
//! what one segment's end is computed from is what the next one's start is computed from.

use bikebot_geometry::{FergusonCurve, Point2, Polyline, Vector2};

/// Values, first and second derivatives in `T` of the four basis functions of a segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Basis {
    pub value: [f64; 4],
    pub first: [f64; 4],
    pub second: [f64; 4],
}

impl Basis {
    pub fn at(t: f64) -> Self {
        let r = 1.0 - t;
        let (t2, t3) = (t * t, t * t * t);
        Self {
            value: [
                r * r * r / 6.0,
                (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0,
                (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0,
                t3 / 6.0,
            ],
            first: [
                -0.5 * r * r,
                0.5 * t * (3.0 * t - 4.0),
                0.5 * (-3.0 * t2 + 2.0 * t + 1.0),
                0.5 * t2,
            ],
            second: [r, 3.0 * t - 2.0, 1.0 - 3.0 * t, t],
        }
    }
}

/// Position and derivatives at one parameter of a segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub basis: Basis,
    pub point: Point2,
    pub first: Vector2,
    pub second: Vector2,
}

/// What an end of the curve is held to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clamp {
    pub position: Point2,
    /// Unit vector of the prescribed heading; `None`: any.
    pub direction: Option<Vector2>,
    /// σ there, 1/m; `None`: any. Heeded at an end with a direction.
    pub curvature: Option<f64>,
}

/// Positions, m, of the control points; at least four.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spline {
    pub control: Vec<Point2>,
}

impl Spline {
    /// The spline through `points` (at least two) with end tangents `first` and `last` (m per segment).
    pub fn through(points: &[Point2], first: Vector2, last: Vector2) -> Self {
        // (c_i + 4 c_{i+1} + c_{i+2})/6 = g_i with c_0 = c_2 − 2 v_0 and c_{M+2} = c_M + 2 v_M put in:
        // tridiagonal in c_1 … c_{M+1}, diagonally dominant, so elimination needs no pivots.
        let n = points.len();
        let mut upper = vec![0.0; n];
        let mut inner = vec![Vector2::zeros(); n];
        for i in 0..n {
            let mut right = points[i].coords * 6.0;
            let (below, above) = match i {
                0 => {
                    right += first * 2.0;
                    (0.0, 2.0)
                }
                _ if i == n - 1 => {
                    right -= last * 2.0;
                    (2.0, 0.0)
                }
                _ => (1.0, 1.0),
            };
            let (above_before, before) = if i == 0 {
                (0.0, Vector2::zeros())
            } else {
                (upper[i - 1], inner[i - 1])
            };
            let pivot = 4.0 - below * above_before;
            upper[i] = above / pivot;
            inner[i] = (right - before * below) / pivot;
        }
        for i in (0..n - 1).rev() {
            let next = inner[i + 1];
            inner[i] -= next * upper[i];
        }
        let mut control = Vec::with_capacity(n + 2);
        control.push(Point2::from(inner[1] - first * 2.0));
        control.extend(inner.iter().map(|c| Point2::from(*c)));
        control.push(Point2::from(inner[n - 2] + last * 2.0));
        Self { control }
    }

    /// The spline through places evenly spaced along `guide`, from clamp to clamp, in `segments` segments. Tangents at the
    /// ends point along the prescribed headings, or along the guide, and are as long as the spacing.
    pub fn along(guide: &Polyline, segments: usize, [start, goal]: &[Clamp; 2]) -> Self {
        let length = guide.length();
        let spacing = length / segments as f64;
        let mut points: Vec<_> = (0..=segments)
            .map(|i| guide.point_at(spacing * i as f64))
            .collect();
        points[0] = start.position;
        points[segments] = goal.position;
        let along = |heading: f64| Vector2::new(heading.cos(), heading.sin());
        let leaving = start
            .direction
            .unwrap_or_else(|| along(guide.heading_at(0.0)));
        let arriving = goal
            .direction
            .unwrap_or_else(|| along(guide.heading_at(length)));
        Self::through(&points, leaving * spacing, arriving * spacing)
    }

    /// M.
    pub fn segments(&self) -> usize {
        self.control.len() - 3
    }

    pub fn is_finite(&self) -> bool {
        self.control
            .iter()
            .all(|c| c.x.is_finite() && c.y.is_finite())
    }

    pub fn place(&self, segment: usize, t: f64) -> Place {
        let basis = Basis::at(t);
        let window = &self.control[segment..segment + 4];
        let sum = |weights: &[f64; 4]| {
            window
                .iter()
                .zip(weights)
                .fold(Vector2::zeros(), |sum, (c, w)| sum + c.coords * *w)
        };
        Place {
            basis,
            point: Point2::from(sum(&basis.value)),
            first: sum(&basis.first),
            second: sum(&basis.second),
        }
    }

    /// Adds `step`, x and y of every control point in turn.
    pub fn moved(&self, step: &[f64]) -> Self {
        let control = self
            .control
            .iter()
            .zip(step.chunks_exact(2))
            .map(|(c, d)| Point2::new(c.x + d[0], c.y + d[1]))
            .collect();
        Self { control }
    }

    /// `part` of the way to `other`, which has as many control points.
    pub fn towards(&self, other: &Self, part: f64) -> Self {
        let control = self
            .control
            .iter()
            .zip(&other.control)
            .map(|(from, to)| from + (to - from) * part)
            .collect();
        Self { control }
    }

    /// Takes the last rounding off the ends by moving the two outermost control points: with forward speed v along the
    /// prescribed direction u, c_0 = c_2 − 2 v u, and c_1 = (6 p_0 − c_0 − c_2)/4. Where the curvature σ_0 is prescribed too, c_2 first
    /// moves across u to n·c_2 = n·p_0 + σ_0 v²/3, n the normal to the left: then n·P'' = 3 n·(c_2 − p_0) = σ_0 v².
    pub fn snap(&mut self, [start, goal]: &[Clamp; 2]) {
        let n = self.control.len();
        snap_end(start, &mut self.control, [0, 1, 2], 1.0);
        snap_end(goal, &mut self.control, [n - 1, n - 2, n - 3], -1.0);
    }

    /// The segments; the first starts and the last ends exactly at their clamps, and along them.
    pub fn curves(&self, [start, goal]: &[Clamp; 2]) -> Vec<FergusonCurve> {
        let knot = |i: usize| {
            let [a, b, c] = [0, 1, 2].map(|k| self.control[i + k].coords);
            (Point2::from((a + b * 4.0 + c) / 6.0), (c - a) * 0.5)
        };
        let exactly = |clamp: &Clamp, tangent: Vector2| {
            let along = clamp.direction.map(|u| u * tangent.dot(&u));
            (clamp.position, along.unwrap_or(tangent))
        };
        let last = self.segments();
        let mut from = exactly(start, knot(0).1);
        (1..=last)
            .map(|i| {
                let mut to = knot(i);
                if i == last {
                    to = exactly(goal, to.1);
                }
                let curve = FergusonCurve::from_ends(from.0, from.1, to.0, to.1);
                from = to;
                curve
            })
            .collect()
    }
}

/// `outer` names the outermost control point and its two neighbours, going inwards; `sign` is that of travel.
fn snap_end(clamp: &Clamp, control: &mut [Point2], outer: [usize; 3], sign: f64) {
    let [c0, c1, c2] = outer;
    if let Some(u) = clamp.direction {
        let speed = 0.5 * sign * (control[c2] - control[c0]).dot(&u);
        if let Some(sigma) = clamp.curvature {
            let left = Vector2::new(-u.y, u.x);
            let aside = sigma * speed * speed / 3.0;
            control[c2] += left * (aside - left.dot(&(control[c2] - clamp.position)));
        }
        control[c0] = control[c2] - u * (2.0 * sign * speed);
    }
    let inner = clamp.position.coords * 6.0 - control[c0].coords - control[c2].coords;
    control[c1] = Point2::from(inner * 0.25);
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::ParametricCurve;
    use proptest::prelude::*;

    fn points() -> impl Strategy<Value = Vec<Point2>> {
        prop::collection::vec((-50.0..50.0_f64, -50.0..50.0_f64), 2..20)
            .prop_map(|v| v.into_iter().map(|(x, y)| Point2::new(x, y)).collect())
    }

    fn free(position: Point2) -> Clamp {
        Clamp {
            position,
            direction: None,
            curvature: None,
        }
    }

    proptest! {
        #[test]
        fn interpolates_points_and_end_tangents(points in points(), tangents in prop::array::uniform4(-5.0..5.0_f64)) {
            let [a, b, c, d] = tangents;
            let (first, last) = (Vector2::new(a, b), Vector2::new(c, d));
            let spline = Spline::through(&points, first, last);
            let m = spline.segments();
            prop_assert_eq!(m, points.len() - 1);
            // Coordinates of 50 m in a diagonally dominant system: a few roundings of 1e-14.
            for i in 0..m {
                prop_assert!((spline.place(i, 0.0).point - points[i]).norm() < 1e-11);
                prop_assert!((spline.place(i, 1.0).point - points[i + 1]).norm() < 1e-11);
            }
            prop_assert!((spline.place(0, 0.0).first - first).norm() < 1e-11);
            prop_assert!((spline.place(m - 1, 1.0).first - last).norm() < 1e-11);
        }

        #[test]
        fn curves_are_the_spline_and_join_with_two_derivatives(points in points()) {
            let tangent = Vector2::new(3.0, 1.0);
            let spline = Spline::through(&points, tangent, tangent);
            let ends = [free(points[0]), free(points[points.len() - 1])];
            let curves = spline.curves(&ends);
            for (i, curve) in curves.iter().enumerate() {
                for t in [0.0, 0.3, 1.0] {
                    let place = spline.place(i, t);
                    prop_assert!((curve.point(t) - place.point).norm() < 1e-11);
                    prop_assert!((curve.derivative(t) - place.first).norm() < 1e-10);
                    prop_assert!((curve.second_derivative(t) - place.second).norm() < 1e-9);
                }
            }
            for pair in curves.windows(2) {
                prop_assert_eq!(pair[0].end_point(), pair[1].start_point());
                prop_assert_eq!(pair[0].end_tangent(), pair[1].start_tangent());
                let bend = pair[0].second_derivative(1.0) - pair[1].second_derivative(0.0);
                prop_assert!(bend.norm() < 1e-10);
            }
        }

        #[test]
        fn snapped_ends_are_where_and_how_they_are_held(points in points().prop_filter("room between the ends", |p| p.len() > 4), heading in -3.1..3.1_f64, curvature in -0.5..0.5_f64) {
            let mut spline = Spline::through(&points, Vector2::new(1.0, 2.0), Vector2::new(2.0, 1.0));
            let u = Vector2::new(heading.cos(), heading.sin());
            let direction = Some(u);
            let ends = [
                Clamp { position: Point2::new(1.0, 2.0), direction, curvature: Some(curvature) },
                Clamp { position: Point2::new(-3.0, 4.0), direction, curvature: None },
            ];
            spline.snap(&ends);
            let last = spline.segments() - 1;
            for (place, end) in [(spline.place(0, 0.0), ends[0]), (spline.place(last, 1.0), ends[1])] {
                prop_assert!((place.point - end.position).norm() < 1e-12);
                prop_assert!((place.first - u * place.first.dot(&u)).norm() < 1e-12);
            }
            let curves = spline.curves(&ends);
            // Roundings of 1e-14 of coordinates of 50 m, over the square of the speed.
            let rounding = 1e-12 / curves[0].start_tangent().norm_squared();
            // Backward, left is right; such a curve is not certified.
            let sign = curves[0].start_tangent().dot(&u).signum();
            prop_assert!((sign * curves[0].curvature(0.0) - curvature).abs() < 1e-9 + rounding);
            prop_assert_eq!(curves[0].start_point(), ends[0].position);
            prop_assert_eq!(curves[last].end_point(), ends[1].position);
        }
    }
}
