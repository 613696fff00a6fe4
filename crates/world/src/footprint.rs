//! The outline that must fit: a point, disc, capsule or rectangle carried by a pose.

use std::fmt;
use std::str::FromStr;

use bikebot_geometry::{Point2, Pose2};

/// Most discs a cover may have; a very slender shape gets larger discs instead of more.
const MAX_DISCS: usize = 16;

/// Largest dimension (m) a written footprint may have.
const MAX_DIMENSION: f64 = 1e6;

/// The ground a robot occupies, in its body frame: reference point at the origin, x forward.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
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
}

/// One disc of a cover, centred on the body's x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootprintDisc {
    /// x of the centre in the body frame, m.
    pub offset: f64,
    /// m.
    pub radius: f64,
}

impl Footprint {
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
    /// 1e6 m, no negative radius or width, the rear not ahead of the front.
    ///
    /// # Errors
    ///
    /// What is wrong, and the numbers found. A footprint read from text has passed already.
    pub fn check(&self) -> Result<(), FootprintError> {
        let (numbers, is_shape) = match *self {
            Self::Point => ([0.0; 3], true),
            Self::Disc { radius } => ([radius, 0.0, 0.0], radius >= 0.0),
            Self::Capsule {
                rear,
                front,
                radius,
            } => ([rear, front, radius], rear <= front && radius >= 0.0),
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => (
                [rear, front, half_width],
                rear <= front && half_width >= 0.0,
            ),
        };
        let fail = |problem| {
            Err(FootprintError {
                found: format!("{self:?}"),
                problem,
            })
        };
        // Twice the limit of the text form, whose centre and half length add up. NaN is not below it.
        if !numbers.iter().all(|v| v.abs() <= 2.0 * MAX_DIMENSION) {
            return fail("each number must be finite and at most 2e6 m");
        }
        if !is_shape {
            return fail(
                "a radius or half width is 0 or above, and the rear is not ahead of the front",
            );
        }
        Ok(())
    }

    /// A footprint that contains every point within `by` (m) of this one.
    ///
    /// Exact for point, disc and capsule; a rectangle keeps its corners square, which adds
    /// up to 0.41 `by` there. A negative or non-finite `by` changes nothing.
    #[must_use]
    pub fn grown(&self, by: f64) -> Self {
        if !(by > 0.0 && by.is_finite()) {
            return *self;
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
        }
    }

    /// Discs on the body's x axis whose union contains the footprint, rear to front.
    ///
    /// For a capsule the outer discs touch its ends from within, and neighbours meet at its
    /// full width half-way between their centres; with n discs on an axis of length L and
    /// x = ρ − r that fixes the radius ρ by x² + 2 r x = ((L − 2x) / (2 (n − 1)))².
    #[must_use]
    pub fn discs(&self) -> Vec<FootprintDisc> {
        match *self {
            Self::Point => vec![FootprintDisc {
                offset: 0.0,
                radius: 0.0,
            }],
            Self::Disc { radius } => vec![FootprintDisc {
                offset: 0.0,
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
                        radius: cover,
                    })
                    .collect()
            }
        }
    }

    /// The footprint as a convex core and a radius about it: 1, 2 or 4 vertices in the world
    /// frame (counter-clockwise), and m.
    pub(crate) fn core(&self, pose: &Pose2) -> Core {
        let at = |x: f64, y: f64| pose.transform(Point2::new(x, y));
        let reference = pose.position;
        match *self {
            Self::Point => Core::new([reference; 4], 1, 0.0),
            Self::Disc { radius } => Core::new([reference; 4], 1, radius),
            Self::Capsule {
                rear,
                front,
                radius,
            } => {
                let (a, b) = (at(rear, 0.0), at(front, 0.0));
                Core::new([a, b, a, b], if a == b { 1 } else { 2 }, radius)
            }
            Self::Rectangle {
                rear,
                front,
                half_width,
            } => Core::new(
                [
                    at(rear, -half_width),
                    at(front, -half_width),
                    at(front, half_width),
                    at(rear, half_width),
                ],
                4,
                0.0,
            ),
        }
    }
}

/// A convex core with up to four vertices, and the radius (m) about it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Core {
    vertices: [Point2; 4],
    count: usize,
    pub(crate) radius: f64,
}

impl Core {
    fn new(vertices: [Point2; 4], count: usize, radius: f64) -> Self {
        Self {
            vertices,
            count,
            radius,
        }
    }

    pub(crate) fn vertices(&self) -> &[Point2] {
        &self.vertices[..self.count]
    }

    /// A point of the core half-way along its diagonal (m).
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
    "footprint \"{found}\": {problem}; write bike, point, disc:0.4 (radius), capsule:1.8x0.6 or box:1.8x0.6 (length x width in metres, centred; @0.56 after it moves the centre forward)"
)]
pub struct FootprintError {
    /// The text given.
    pub found: String,
    /// What is wrong with it.
    pub problem: &'static str,
}

impl FromStr for Footprint {
    type Err = FootprintError;

    fn from_str(text: &str) -> Result<Self, FootprintError> {
        let fail = |problem| FootprintError {
            found: text.chars().take(80).collect(),
            problem,
        };
        let trimmed = text.trim();
        let number = |s: &str, problem| {
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
        match *self {
            bike if bike == Self::bike() => write!(f, "bike"),
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
            .any(|d| (x - d.offset).hypot(y) <= d.radius + 1e-12)
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
            capsule(0.0, 0.0, 0.0),
            rectangle(-1.0, 2.0, 0.5),
        ] {
            assert_eq!(shape.check(), Ok(()));
        }
        for no_shape in [
            Footprint::Disc { radius: f64::NAN },
            Footprint::Disc { radius: -5.0 },
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
        ] {
            let error = text.parse::<Footprint>().expect_err(text);
            assert!(error.to_string().contains("capsule:1.8x0.6"));
        }
    }

    #[test]
    fn growing_moves_the_reach_by_as_much() {
        for text in ["point", "disc:0.4", "capsule:1.8x0.6"] {
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
