//! The least clearance of an outline carried along curves.

use super::obstacles::{Obstacles, convex_hull};
use super::piece::{Piece, at};
use super::{CLEARANCE_TOLERANCE, MOST_HALVINGS, Place, SHORTEST};
use bikebot_geometry::{FergusonCurve, Point2, Vector2};
use bikebot_world::Footprint;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// The outline as convex cores with one radius about them, in the body frame.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) cores: Vec<Vec<Vector2>>,
    pub(super) radius: f64,
    /// The boundary that the cores make up, where they leave out the inside.
    pub(super) ring: Option<Vec<Vector2>>,
    /// Farthest vertex, m.
    pub(super) reach: f64,
}

impl Body {
    pub(super) fn disc(radius: f64) -> Self {
        Self::new(vec![vec![Vector2::zeros()]], radius, None)
    }

    pub(super) fn new(cores: Vec<Vec<Vector2>>, radius: f64, ring: Option<Vec<Vector2>>) -> Self {
        let reach = cores.iter().flatten().map(|v| v.norm()).fold(0.0, f64::max);
        Self {
            cores,
            radius,
            ring,
            reach,
        }
    }

    pub(super) fn of(footprint: &Footprint) -> Self {
        match footprint {
            Footprint::Point => Self::disc(0.0),
            Footprint::Disc { radius } => Self::disc(*radius),
            Footprint::Capsule {
                rear,
                front,
                radius,
            } => {
                let axis = [*rear, *front].map(|x| Vector2::new(x, 0.0));
                Self::new(vec![axis.to_vec()], *radius, None)
            }
            Footprint::Rectangle {
                rear,
                front,
                half_width: w,
            } => {
                let corners = [(*rear, -w), (*front, -w), (*front, *w), (*rear, *w)];
                let corners = corners.map(|(x, y)| Vector2::new(x, y)).to_vec();
                Self::new(vec![corners], 0.0, None)
            }
            Footprint::Polygon(polygon) => {
                let ring: Vec<Vector2> = polygon.vertices().iter().map(|v| v.coords).collect();
                let n = ring.len();
                let edges = (0..n).map(|i| vec![ring[i], ring[(i + 1) % n]]).collect();
                Self::new(edges, polygon.rounding(), Some(ring))
            }
            // A shape not known here is no larger than its reach.
            other => Self::disc(other.reach()),
        }
    }
}

/// The search for the least clearance.
pub(super) struct Search<'s> {
    pub(super) obstacles: Obstacles<'s>,
    pub(super) body: Body,
    pub(super) segments: &'s [FergusonCurve],
    /// What is to be decided, m: whether the clearance is nowhere below this.
    pub(super) needed: f64,
}

/// A piece with a lower bound of the clearance on it; the least bound is the greatest entry of a heap.
struct Bounded {
    bound: f64,
    piece: Piece,
}

impl PartialEq for Bounded {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Bounded {}

impl PartialOrd for Bounded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Bounded {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |b: &Self| (b.piece.segment, b.piece.from.to_bits());
        other
            .bound
            .total_cmp(&self.bound)
            .then(place(other).cmp(&place(self)))
    }
}

impl Search<'_> {
    /// A vertex of the body on segment `i` at `t`.
    pub(super) fn places(&self, i: usize, t: f64, vertices: &[Vector2], out: &mut Vec<Point2>) {
        let (point, first, _) = at(&self.segments[i], t);
        let along = if self.body.reach > 0.0 {
            first / first.norm()
        } else {
            Vector2::x()
        };
        out.extend(vertices.iter().map(|v| {
            Point2::new(
                point.x + along.x * v.x - along.y * v.y,
                point.y + along.y * v.x + along.x * v.y,
            )
        }));
    }

    /// Clearance at a pose, m, if below `cap`; minus the radius where the core meets something.
    pub(super) fn clearance_at(&self, i: usize, t: f64, cap: f64) -> f64 {
        let mut vertices = Vec::new();
        if let Some(ring) = &self.body.ring {
            self.places(i, t, ring, &mut vertices);
            if self.obstacles.any_inside(&vertices) {
                return -self.body.radius;
            }
        }
        let mut least = cap;
        for core in &self.body.cores {
            vertices.clear();
            self.places(i, t, core, &mut vertices);
            let radius = self.body.radius;
            least = least.min(self.obstacles.distance(&vertices, least + radius) - radius);
        }
        least
    }

    /// A lower bound of the clearance on a piece, m; anything from `enough` on says no more than that.
    pub(super) fn bound(&self, piece: &Piece, enough: f64) -> f64 {
        let deviation = piece.deviation(self.body.reach) + self.rounding(piece.segment);
        if !deviation.is_finite() {
            return f64::NEG_INFINITY;
        }
        let mut least = enough;
        let mut hull = Vec::new();
        for core in &self.body.cores {
            hull.clear();
            self.places(piece.segment, piece.from, core, &mut hull);
            self.places(piece.segment, piece.to, core, &mut hull);
            if !hull.iter().all(|v| v.x.is_finite() && v.y.is_finite()) {
                return f64::NEG_INFINITY;
            }
            convex_hull(&mut hull);
            let off = self.body.radius + deviation;
            least = least.min(self.obstacles.distance(&hull, least + off) - off);
        }
        least
    }

    /// What rounding of positions and distances may come to, m.
    pub(super) fn rounding(&self, segment: usize) -> f64 {
        let largest = self.segments[segment]
            .to_array()
            .iter()
            .fold(0.0_f64, |a, b| a.max(b.abs()));
        64.0 * f64::EPSILON * (largest + self.body.reach + self.body.radius)
    }

    /// A proven lower bound of the clearance, the least clearance seen, m, and where.
    pub(super) fn least_clearance(&self, start: Point2) -> (f64, f64, Option<Place>) {
        let mut best = (f64::INFINITY, None);
        for i in 0..self.segments.len() {
            for t in [0.0, 0.5, 1.0] {
                let clearance = self.clearance_at(i, t, best.0);
                if clearance < best.0 || clearance.is_nan() {
                    best = (
                        clearance,
                        Some(Place {
                            segment: i,
                            parameter: t,
                        }),
                    );
                }
            }
        }
        if self.segments.is_empty() {
            // A start that is an arrival, whatever the heading: no outline but the disc can be asked for.
            let clearance = self.obstacles.distance(&[start], f64::INFINITY) - self.body.radius;
            return (clearance, clearance, None);
        }
        let mut open = BinaryHeap::new();
        for (i, curve) in self.segments.iter().enumerate() {
            let piece = Piece::whole(i, curve);
            let bound = self.bound(&piece, best.0);
            open.push(Bounded { bound, piece });
        }
        let mut halvings = 0;
        let mut proven = best.0;
        while let Some(Bounded { bound, piece }) = open.pop() {
            proven = bound.min(best.0);
            halvings += 1;
            let decided = bound >= self.needed || best.0 < self.needed;
            let stuck = piece.to - piece.from < SHORTEST || halvings > MOST_HALVINGS;
            // Nothing is gained by knowing better how deep in an obstacle it is.
            let hopeless = best.0 <= -self.body.radius && best.0 < self.needed;
            if (best.0 - bound <= CLEARANCE_TOLERANCE && decided) || stuck || hopeless {
                break;
            }
            let t = piece.middle();
            let clearance = self.clearance_at(piece.segment, t, best.0);
            if clearance < best.0 || clearance.is_nan() {
                let segment = piece.segment;
                best = (
                    clearance,
                    Some(Place {
                        segment,
                        parameter: t,
                    }),
                );
            }
            for piece in piece.halves() {
                let bound = self.bound(&piece, best.0);
                open.push(Bounded { bound, piece });
            }
        }
        (proven, best.0, best.1)
    }
}
