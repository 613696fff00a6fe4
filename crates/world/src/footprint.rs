//! The outline that must fit: a point, disc, capsule, rectangle or polygon carried by a pose.

mod disc_cover;
mod polygon;

use std::fmt;
use std::str::FromStr;

use bikebot_geometry::{Point2, Pose2};

pub use polygon::FootprintPolygon;
use polygon::MOST_CORNERS;

/// Most discs a cover may have; a very slender shape gets larger discs instead of more.
const MAX_DISCS: usize = 16;

/// Largest dimension (m) a written footprint may have.
const MAX_DIMENSION: f64 = 1e6;

/// The ground a robot occupies, in its body frame: reference point at the origin, x forward.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
#[non_exhaustive]
pub enum Footprint {
    /// No extent at all.
    Point,
    /// A disc about the reference point.
    Disc {
        /// m.
        radius: f64,
    },
    /// All points within `radius` of an axis on the body's x axis.
    Capsule {
        /// x of the axis' rear end, m.
        rear: f64,
        /// x of the axis' front end, m.
        front: f64,
        /// m.
        radius: f64,
    },
    /// An oriented rectangle, symmetric about the body's x axis.
    Rectangle {
        /// x of the rear side, m.
        rear: f64,
        /// x of the front side, m.
        front: f64,
        /// Half the extent across, m.
        half_width: f64,
    },
    /// Any simple outline, convex or not.
    Polygon(FootprintPolygon),
}

/// One disc of a cover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootprintDisc {
    /// x of the centre in the body frame, m.
    pub offset: f64,
    /// y of the centre in the body frame, m; 0 but for polygons.
    pub lateral: f64,
    /// m.
    pub radius: f64,
}

impl Footprint {
    /// The simple polygon with these vertices, m, in the body frame: either orientation, convex or not, the last vertex joins the
    /// first.
    ///
    /// # Errors
    ///
    /// See [`FootprintPolygon::new`].
    pub fn polygon(vertices: &[Point2]) -> Result<Self, FootprintError> {
        FootprintPolygon::new(vertices).map(Self::Polygon)
    }

    /// The default bike seen from the rear contact: axis from −0.04 m to 1.16 m, radius 0.30 m.
    #[must_use]
    pub const fn bike() -> Self {
        Self::Capsule {
            rear: -0.04,
            front: 1.16,
            radius: 0.30,
        }
    }

    /// Checks that the numbers of a footprint put together by hand describe a shape: finite, at most
    /// 2e6 m, of a radius or width above 0, the rear not ahead of the front.
    ///
    /// # Errors
    ///
    /// What is wrong, and the numbers found. A footprint read from text has passed already, and so has every polygon.
    pub fn check(&self) -> Result<(), FootprintError> {
        let (numbers, is_shape) = match *self {
            Self::Point => ([0.0; 3], true),
            Self::Disc { radius } => ([radius, 0.0, 0.0], radius > 0.0),
            Self::Capsule {
                rear,
                front,
                radius,
            } => ([rear, front, radius], rear <= front && radius > 0.0),
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => ([rear, front, half_width], rear < front && half_width > 0.0),
            Self::Polygon(ref polygon) => ([polygon.rounding(), 0.0, 0.0], true),
        };
        let fail = |problem: &str| {
            Err(FootprintError {
                found: format!("{self:?}"),
                problem: problem.to_owned(),
            })
        };
        // Twice the limit of the text form, whose centre and half length add up. NaN is not below it.
        if !numbers.iter().all(|v| v.abs() <= 2.0 * MAX_DIMENSION) {
            return fail("each number must be finite and at most 2e6 m");
        }
        if !is_shape {
            return fail("length, width and radius must be above 0 (a disc of radius 0 is Point)");
        }
        Ok(())
    }

    /// A footprint that contains every point within `by` (m) of this one.
    ///
    /// Exact for point, disc, capsule and polygon; a rectangle keeps its corners square, which adds
    /// up to 0.41 `by` there. A negative or non-finite `by` changes nothing.
    #[must_use]
    pub fn grown(&self, by: f64) -> Self {
        if !(by > 0.0 && by.is_finite()) {
            return self.clone();
        }
        match *self {
            Self::Point => Self::Disc { radius: by },
            Self::Disc { radius } => Self::Disc {
                radius: radius + by,
            },
            Self::Capsule {
                rear,
                front,
                radius,
            } => Self::Capsule {
                rear,
                front,
                radius: radius + by,
            },
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => Self::Rectangle {
                rear: rear - by,
                front: front + by,
                half_width: half_width + by,
            },
            Self::Polygon(ref polygon) => Self::Polygon(polygon.grown(by)),
        }
    }

    /// Distance (m) from the reference point to the farthest point of the footprint.
    ///
    /// When the pose turns by dθ no point of the footprint moves farther than this times dθ.
    #[must_use]
    pub fn reach(&self) -> f64 {
        match *self {
            Self::Point => 0.0,
            Self::Disc { radius } => radius,
            Self::Capsule {
                rear,
                front,
                radius,
            } => rear.abs().max(front.abs()) + radius,
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => rear.abs().max(front.abs()).hypot(half_width),
            Self::Polygon(ref polygon) => polygon.reach(),
        }
    }

    /// Radius of the largest disc about the reference point that the footprint contains, m; 0 if the point lies outside.
    #[must_use]
    pub fn inscribed_radius(&self) -> f64 {
        match *self {
            Self::Point => 0.0,
            Self::Disc { radius } => radius,
            Self::Capsule {
                rear,
                front,
                radius,
            } => (radius - rear.max(-front).max(0.0)).max(0.0),
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => half_width.min(-rear).min(front).max(0.0),
            Self::Polygon(ref polygon) => polygon.inscribed_radius(),
        }
    }

    /// Discs whose union contains the footprint, rear to front; on the body's x axis but for polygons.
    ///
    /// Those of a polygon stick out by a tenth of its width at most, unless it is so slender that 32 are not enough.
    ///
    /// For a capsule the outer discs touch its ends from within, and neighbours meet at its
    /// full width half-way between their centres; with n discs on an axis of length L and
    /// x = ρ − r that fixes the radius ρ by x² + 2 r x = ((L − 2x) / (2 (n − 1)))².
    #[must_use]
    pub fn discs(&self) -> Vec<FootprintDisc> {
        match *self {
            Self::Point => vec![FootprintDisc {
                offset: 0.0,
                lateral: 0.0,
                radius: 0.0,
            }],
            Self::Disc { radius } => vec![FootprintDisc {
                offset: 0.0,
                lateral: 0.0,
                radius,
            }],
            Self::Capsule {
                rear,
                front,
                radius,
            } => {
                let length = front - rear;
                if length <= 0.0 {
                    return vec![FootprintDisc {
                        offset: rear,
                        lateral: 0.0,
                        radius,
                    }];
                }
                let gaps = count(length, 2.0 * radius, MAX_DISCS - 1);
                let m2 = (gaps * gaps) as f64;
                let a = 4.0 * (m2 - 1.0);
                let b = 8.0 * m2 * radius + 4.0 * length;
                let excess =
                    2.0 * length * length / (b + (b * b + 4.0 * a * length * length).sqrt());
                let spacing = (length - 2.0 * excess) / gaps as f64;
                // A part in 10¹² more, so that rounding cannot leave a sliver uncovered.
                let cover = (radius + excess) * (1.0 + 1e-12);
                (0..=gaps)
                    .map(|i| FootprintDisc {
                        offset: rear + excess + spacing * i as f64,
                        lateral: 0.0,
                        radius: cover,
                    })
                    .collect()
            }
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => {
                let length = front - rear;
                let discs = count(length, 2.0 * half_width, MAX_DISCS);
                let spacing = length / discs as f64;
                let cover = half_width.hypot(spacing / 2.0) * (1.0 + 1e-12);
                (0..discs)
                    .map(|i| FootprintDisc {
                        offset: rear + spacing * (i as f64 + 0.5),
                        lateral: 0.0,
                        radius: cover,
                    })
                    .collect()
            }
            Self::Polygon(ref polygon) => polygon.discs(),
        }
    }

    /// The footprint in its body frame as convex parts: vertices (m; one, two, or more and then
    /// counter-clockwise) and the radius (m) about each. Together they are the footprint exactly.
    #[must_use]
    pub fn convex_parts(&self) -> Vec<(Vec<Point2>, f64)> {
        self.cores(&Pose2::new(0.0, 0.0, 0.0))
            .map(|core| (core.vertices().to_vec(), core.radius))
            .collect()
    }

    /// The footprint at a pose as convex cores with a radius about each, in the world frame: one, or the convex parts of a
    /// polygon.
    pub(crate) fn cores(&self, pose: &Pose2) -> impl Iterator<Item = Core> {
        let parts = match self {
            Self::Polygon(polygon) => polygon.parts().len(),
            _ => 1,
        };
        (0..parts).map(move |part| self.core(pose, part))
    }

    fn core(&self, pose: &Pose2, part: usize) -> Core {
        let at = |x: f64, y: f64| pose.transform(Point2::new(x, y));
        match *self {
            Self::Point => Core::new(&[pose.position], 0.0),
            Self::Disc { radius } => Core::new(&[pose.position], radius),
            Self::Capsule {
                rear,
                front,
                radius,
            } => {
                let axis = [at(rear, 0.0), at(front, 0.0)];
                let count = if axis[0] == axis[1] { 1 } else { 2 };
                Core::new(&axis[..count], radius)
            }
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => Core::new(
                &[
                    at(rear, -half_width),
                    at(front, -half_width),
                    at(front, half_width),
                    at(rear, half_width),
                ],
                0.0,
            ),
            Self::Polygon(ref polygon) => {
                let mut core = Core::new(&polygon.parts()[part], polygon.rounding());
                let (sin, cos) = pose.heading.sin_cos();
                for v in &mut core.vertices[..core.count] {
                    *v = Point2::new(
                        pose.position.x + cos * v.x - sin * v.y,
                        pose.position.y + sin * v.x + cos * v.y,
                    );
                }
                core
            }
        }
    }
}

/// A convex core of a few vertices (1, 2, or more and then counter-clockwise), and the radius (m) about it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Core {
    vertices: [Point2; MOST_CORNERS],
    count: usize,
    pub(crate) radius: f64,
}

impl Core {
    /// `corners` are at most [`MOST_CORNERS`].
    fn new(corners: &[Point2], radius: f64) -> Self {
        let mut vertices = [Point2::origin(); MOST_CORNERS];
        vertices[..corners.len()].copy_from_slice(corners);
        Self {
            vertices,
            count: corners.len(),
            radius,
        }
    }

    pub(crate) fn vertices(&self) -> &[Point2] {
        &self.vertices[..self.count]
    }

    /// A point of the core half-way along a diagonal (m).
    pub(crate) fn middle(&self) -> Point2 {
        nalgebra::center(&self.vertices[0], &self.vertices[self.count / 2])
    }
}

/// How many pieces of about `piece` make up `length`; at least 1.
fn count(length: f64, piece: f64, most: usize) -> usize {
    let ratio = length / piece;
    if ratio.is_finite() {
        // The hair less keeps 1.2 / 0.6 at two pieces whatever way it rounds.
        ((ratio - 1e-9).ceil().max(1.0) as usize).min(most)
    } else {
        most
    }
}

/// A footprint that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "footprint \"{found}\": {problem}; write bike, point, disc:0.4 (radius), capsule:1.8x0.6 or box:1.8x0.6 (length x width in metres, centred; @0.56 after it moves the centre forward), or polygon:0,0;1,0;0,1 (vertices; ~0.1 after them adds that much all around)"
)]
pub struct FootprintError {
    /// The text given.
    pub found: String,
    /// What is wrong with it.
    pub problem: String,
}

impl FromStr for Footprint {
    type Err = FootprintError;

    fn from_str(text: &str) -> Result<Self, FootprintError> {
        let fail = |problem: &str| FootprintError {
            found: text.chars().take(80).collect(),
            problem: problem.to_owned(),
        };
        let trimmed = text.trim();
        let number = |s: &str, problem: &str| {
            let value: f64 = s.trim().parse().map_err(|_| fail(problem))?;
            if value.abs() <= MAX_DIMENSION {
                Ok(value)
            } else {
                Err(fail("each number must be finite and at most 1e6 m"))
            }
        };
        match trimmed {
            "bike" => return Ok(Self::bike()),
            "point" => return Ok(Self::Point),
            _ => {}
        }
        let (kind, rest) = trimmed
            .split_once(':')
            .ok_or_else(|| fail("not a known shape"))?;
        match kind.trim() {
            "disc" => {
                let radius = number(rest, "the radius is not a number")?;
                if radius > 0.0 {
                    Ok(Self::Disc { radius })
                } else {
                    Err(fail("the radius must be above 0"))
                }
            }
            kind @ ("capsule" | "box") => {
                let (size, centre) = match rest.split_once('@') {
                    Some((size, centre)) => {
                        (size, number(centre, "the centre offset is not a number")?)
                    }
                    None => (rest, 0.0),
                };
                let (length, width) = size
                    .split_once('x')
                    .ok_or_else(|| fail("length and width are separated by an x"))?;
                let length = number(length, "the length is not a number")?;
                let width = number(width, "the width is not a number")?;
                if !(length > 0.0 && width > 0.0) {
                    return Err(fail("length and width must be above 0"));
                }
                if kind == "box" {
                    return Ok(Self::Rectangle {
                        rear: centre - length / 2.0,
                        front: centre + length / 2.0,
                        half_width: width / 2.0,
                    });
                }
                let half_axis = (length - width) / 2.0;
                if half_axis < 0.0 {
                    return Err(fail("a capsule is at least as long as it is wide"));
                }
                Ok(Self::Capsule {
                    rear: centre - half_axis,
                    front: centre + half_axis,
                    radius: width / 2.0,
                })
            }
            "polygon" => {
                let (list, rounding) = match rest.split_once('~') {
                    Some((list, by)) => (list, number(by, "the radius about it is not a number")?),
                    None => (rest, 0.0),
                };
                if rounding < 0.0 {
                    return Err(fail("the radius about a polygon must not be negative"));
                }
                let vertices = list
                    .split(';')
                    .map(|pair| {
                        let (x, y) = pair
                            .split_once(',')
                            .ok_or_else(|| fail("each vertex is x,y, and a ; separates them"))?;
                        let coordinate = |s| number(s, "a coordinate is not a number");
                        Ok(Point2::new(coordinate(x)?, coordinate(y)?))
                    })
                    .collect::<Result<Vec<_>, FootprintError>>()?;
                FootprintPolygon::new(&vertices)
                    .map(|polygon| Self::Polygon(polygon.rounded(rounding)))
                    .map_err(|error| fail(&error.problem))
            }
            _ => Err(fail("not a known shape")),
        }
    }
}

impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Sums such as 1.16 + 0.04 carry a last-digit error that would make the text long.
        let tidy = |v: f64| (v * 1e9).round() / 1e9;
        let centred = |f: &mut fmt::Formatter<'_>, kind, length: f64, width: f64, centre: f64| {
            write!(f, "{kind}:{}x{}", tidy(length), tidy(width))?;
            if tidy(centre) != 0.0 {
                write!(f, "@{}", tidy(centre))?;
            }
            Ok(())
        };
        if *self == Self::bike() {
            return write!(f, "bike");
        }
        match *self {
            Self::Point => write!(f, "point"),
            Self::Disc { radius } => write!(f, "disc:{radius}"),
            Self::Capsule {
                rear,
                front,
                radius,
            } => centred(
                f,
                "capsule",
                front - rear + 2.0 * radius,
                2.0 * radius,
                (rear + front) / 2.0,
            ),
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => centred(
                f,
                "box",
                front - rear,
                2.0 * half_width,
                (rear + front) / 2.0,
            ),
            // As given, to the last bit: what is certified for one outline must be verified for the same.
            Self::Polygon(ref polygon) => f.write_str(&polygon.text()),
        }
    }
}

impl TryFrom<String> for Footprint {
    type Error = FootprintError;

    fn try_from(text: String) -> Result<Self, FootprintError> {
        text.parse()
    }
}

impl From<Footprint> for String {
    fn from(footprint: Footprint) -> Self {
        footprint.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn covered(footprint: &Footprint, x: f64, y: f64) -> bool {
        footprint
            .discs()
            .iter()
            .any(|d| (x - d.offset).hypot(y - d.lateral) <= d.radius + 1e-12)
    }

    #[test]
    fn the_bike_needs_three_discs_tighter_than_discs_at_the_axis_ends() {
        let discs = Footprint::bike().discs();
        assert_eq!(discs.len(), 3);
        // Discs centred on the ends of the axis would need √(0.3² + 0.3²) = 0.424 m.
        assert!(discs[0].radius < 0.40, "{}", discs[0].radius);
        assert!((discs[1].offset - 0.56).abs() < 1e-12);
    }

    #[test]
    fn a_footprint_by_hand_must_be_a_shape() {
        let capsule = |rear, front, radius| Footprint::Capsule {
            rear,
            front,
            radius,
        };
        let rectangle = |rear, front, half_width| Footprint::Rectangle {
            rear,
            front,
            half_width,
        };
        for shape in [
            Footprint::bike(),
            Footprint::Point,
            capsule(0.0, 0.0, 0.1),
            rectangle(-1.0, 2.0, 0.5),
        ] {
            assert_eq!(shape.check(), Ok(()));
        }
        for no_shape in [
            Footprint::Disc { radius: f64::NAN },
            Footprint::Disc { radius: -5.0 },
            Footprint::Disc { radius: 0.0 },
            capsule(0.0, 1.0, 0.0),
            rectangle(0.4, 0.4, 0.3),
            rectangle(-0.4, 0.4, 0.0),
            capsule(f64::NAN, 1.0, 0.3),
            capsule(1.0, -1.0, 0.3),
            capsule(0.0, 1.0, f64::INFINITY),
            rectangle(0.4, -0.4, 0.3),
            rectangle(-1.0, 1.0, -0.1),
            rectangle(-1e300, 1.0, 0.3),
        ] {
            let error = no_shape.check().unwrap_err();
            assert!(error.found.contains("radius") || error.found.contains("half_width"));
        }
    }

    #[test]
    fn written_footprints_read_back_as_themselves() {
        for text in [
            "bike",
            "point",
            "disc:0.4",
            "capsule:1.8x0.6",
            "box:1.8x0.6",
            "box:2x0.5@0.7",
            "polygon:0,0;1.5,0;0,1",
            "polygon:-0.25,-0.1;1,0;0.1,0.1;0,1~0.125",
        ] {
            let footprint: Footprint = text.parse().expect(text);
            assert_eq!(footprint.to_string(), text);
        }
        let grown = Footprint::bike().grown(0.2);
        assert_eq!(grown.to_string(), "capsule:2.2x1@0.56");
    }

    #[test]
    fn nonsense_is_refused_with_the_allowed_forms() {
        for text in [
            "",
            "bkie",
            "disc:",
            "disc:-1",
            "disc:nan",
            "disc:inf",
            "box:1x",
            "box:1",
            "box:0x1",
            "capsule:0.5x0.6",
            "box:1e300x1",
            "capsule:1x1@nan",
            "polygon:",
            "polygon:0,0;1,0",
            "polygon:0,0;1;0,1",
            "polygon:0,0;1,x;0,1",
            "polygon:0,0;1,nan;0,1",
            "polygon:0,0;1,0;0,1~-1",
            "polygon:0,0;1,0;0,1~inf",
            "polygon:0,0;1,1;1,0;0,1",
        ] {
            let error = text.parse::<Footprint>().expect_err(text);
            assert!(error.to_string().contains("capsule:1.8x0.6"));
        }
    }

    #[test]
    fn growing_moves_the_reach_by_as_much() {
        for text in [
            "point",
            "disc:0.4",
            "capsule:1.8x0.6",
            "polygon:-1,0;2,0;0,1",
        ] {
            let footprint: Footprint = text.parse().expect(text);
            let grown = footprint.grown(0.25);
            assert!((grown.reach() - footprint.reach() - 0.25).abs() < 1e-15);
        }
    }

    proptest! {
        #[test]
        fn the_discs_cover_the_shape(
            rear in -3.0..0.0_f64, length in 0.0..6.0_f64, radius in 0.01..1.0_f64,
            u in 0.0..1.0_f64, v in -1.0..1.0_f64, angle in 0.0..std::f64::consts::TAU,
        ) {
            let front = rear + length;
            let capsule = Footprint::Capsule { rear, front, radius };
            let on_axis = rear + u * length;
            prop_assert!(covered(&capsule, on_axis + radius * angle.cos(), radius * angle.sin()));
            let rectangle = Footprint::Rectangle { rear, front: front + 0.01, half_width: radius };
            prop_assert!(covered(&rectangle, on_axis, v * radius));
            for x in [rear, front + 0.01] {
                prop_assert!(covered(&rectangle, x, radius));
            }
        }
    }
}
