//! Distance from a convex shape to everything solid, by direct geometry on the obstacles as they were given.
//!
//! Nothing of the clearance field or the query trees is used: edges and discs lie in square buckets, cells of a grid are
//! squares, and the edge of the field is a wall. Distances between segments are closed forms.

use bikebot_geometry::{Point2, Vector2, cross};
use bikebot_world::{Bounds, Cell, Obstacle, World};

/// Buckets along an axis, at most.
const MOST_BUCKETS: usize = 512;

/// Everything solid, ready to be asked.
#[derive(Debug)]
pub(super) struct Obstacles<'w> {
    world: &'w World,
    bounds: Bounds,
    rings: Vec<Vec<Point2>>,
    discs: Vec<(Point2, f64)>,
    /// Edge of a ring, by ring and index; or a disc.
    buckets: Vec<Vec<Item>>,
    columns: usize,
    rows: usize,
    side: f64,
}

#[derive(Debug, Clone, Copy)]
enum Item {
    Edge {
        ring: u32,
        index: u32,
    },
    Disc(u32),
    /// The box of this ring reaches into the bucket.
    Ring(u32),
}

impl<'w> Obstacles<'w> {
    pub fn new(world: &'w World) -> Self {
        let bounds = world.bounds();
        let (mut rings, mut discs) = (Vec::new(), Vec::new());
        for obstacle in world.obstacles() {
            match obstacle {
                Obstacle::Disc { center, radius } => discs.push((*center, *radius)),
                Obstacle::Polygon { vertices } => rings.push(vertices.clone()),
                Obstacle::Block { min, max } => rings.push(vec![
                    *min,
                    Point2::new(max.x, min.y),
                    *max,
                    Point2::new(min.x, max.y),
                ]),
            }
        }
        let items = rings.iter().map(Vec::len).sum::<usize>() + discs.len();
        let side = (bounds.width() * bounds.height() / (items + 1) as f64)
            .sqrt()
            .max(bounds.width().max(bounds.height()) / MOST_BUCKETS as f64);
        let count = |extent: f64| ((extent / side).ceil() as usize).clamp(1, MOST_BUCKETS);
        let mut this = Self {
            world,
            bounds,
            columns: count(bounds.width()),
            rows: count(bounds.height()),
            side,
            buckets: Vec::new(),
            rings,
            discs,
        };
        this.buckets = vec![Vec::new(); this.columns * this.rows];
        for r in 0..this.rings.len() {
            let ring = std::mem::take(&mut this.rings[r]);
            for (i, a) in ring.iter().enumerate() {
                let b = ring[(i + 1) % ring.len()];
                let item = Item::Edge {
                    ring: r as u32,
                    index: i as u32,
                };
                this.put(item, &box_of(&[*a, b]));
            }
            this.put(Item::Ring(r as u32), &box_of(&ring));
            this.rings[r] = ring;
        }
        for d in 0..this.discs.len() {
            let (center, radius) = this.discs[d];
            this.put(Item::Disc(d as u32), &grown(&box_of(&[center]), radius));
        }
        this
    }

    /// The buckets that a box reaches into; what lies beyond the field is in its outermost ones.
    fn window(&self, b: &Bounds) -> [std::ops::RangeInclusive<usize>; 2] {
        let index = |v: f64, most: usize| ((v / self.side) as usize).min(most - 1);
        let (min, max) = (b.min - self.bounds.min, b.max - self.bounds.min);
        [
            index(min.x, self.columns)..=index(max.x, self.columns),
            index(min.y, self.rows)..=index(max.y, self.rows),
        ]
    }

    fn put(&mut self, item: Item, b: &Bounds) {
        let [columns, rows] = self.window(b);
        for row in rows {
            for column in columns.clone() {
                self.buckets[row * self.columns + column].push(item);
            }
        }
    }

    /// The smaller of `cap` and the distance (m) from a convex shape (1, 2 or more vertices in order) to the nearest solid or to the
    /// field's edge; 0 where it meets one or lies in it.
    pub fn distance(&self, hull: &[Point2], cap: f64) -> f64 {
        let mut least = cap.min(self.edge_distance(hull)).max(0.0);
        // Look near first: what is found bounds how far to look.
        let mut reach = self.side.min(least);
        while least > 0.0 {
            least = self.within(hull, reach, least);
            if reach >= least {
                break;
            }
            reach = (4.0 * reach).min(least);
        }
        least
    }

    /// Distance to the field's edge, negative beyond it. Not a number counts as beyond.
    fn edge_distance(&self, hull: &[Point2]) -> f64 {
        let grid = self.world.grid();
        let mut least = f64::INFINITY;
        for v in hull {
            let mut inside = (v.x - self.bounds.min.x)
                .min(self.bounds.max.x - v.x)
                .min(v.y - self.bounds.min.y)
                .min(self.bounds.max.y - v.y);
            if let Some(grid) = grid {
                let c = grid.to_cell_coordinates(*v);
                let in_grid =
                    c.x.min(c.y)
                        .min(grid.width as f64 - c.x)
                        .min(grid.height as f64 - c.y);
                inside = inside.min(in_grid * grid.resolution);
            }
            if !(v.x.is_finite() && v.y.is_finite()) {
                return f64::NEG_INFINITY;
            }
            least = least.min(inside);
        }
        least
    }

    /// The smaller of `least` and the distance to what lies within `reach` of the shape's box.
    fn within(&self, hull: &[Point2], reach: f64, mut least: f64) -> f64 {
        let around = grown(&box_of(hull), reach);
        let [columns, rows] = self.window(&around);
        for row in rows {
            for column in columns.clone() {
                for item in &self.buckets[row * self.columns + column] {
                    let distance = match *item {
                        Item::Edge { ring, index } => {
                            let ring = &self.rings[ring as usize];
                            let a = ring[index as usize];
                            let b = ring[(index as usize + 1) % ring.len()];
                            convex_to_segment(hull, a, b)
                        }
                        Item::Disc(d) => {
                            let (center, radius) = self.discs[d as usize];
                            (convex_to_segment(hull, center, center) - radius).max(0.0)
                        }
                        Item::Ring(r) if contains(&self.rings[r as usize], hull[0]) => 0.0,
                        Item::Ring(_) => continue,
                    };
                    // Not a number is no distance.
                    least = if distance >= least {
                        least
                    } else {
                        distance.max(0.0)
                    };
                }
            }
        }
        self.cells(hull, reach, least)
    }

    fn cells(&self, hull: &[Point2], reach: f64, mut least: f64) -> f64 {
        let Some(grid) = self.world.grid() else {
            return least;
        };
        let local: Vec<Point2> = hull
            .iter()
            .map(|v| Point2::from(grid.to_cell_coordinates(*v)))
            .collect();
        let around = grown(&box_of(&local), reach / grid.resolution + 1.0);
        let index = |v: f64, most: usize| (v.max(0.0) as usize).min(most.saturating_sub(1));
        for y in index(around.min.y, grid.height)..=index(around.max.y, grid.height) {
            for x in index(around.min.x, grid.width)..=index(around.max.x, grid.width) {
                if !matches!(grid.cell(x, y), Some(Cell::Free)) {
                    let (u, v) = (x as f64, y as f64);
                    // Quick: the boxes are farther apart than the least so far.
                    let b = box_of(&local);
                    let dx = (u - b.max.x).max(b.min.x - u - 1.0).max(0.0);
                    let dy = (v - b.max.y).max(b.min.y - v - 1.0).max(0.0);
                    if (dx * dx + dy * dy).sqrt() * grid.resolution >= least {
                        continue;
                    }
                    let square = [(u, v), (u + 1.0, v), (u + 1.0, v + 1.0), (u, v + 1.0)]
                        .map(|(x, y)| Point2::new(x, y));
                    let distance = convex_distance(&local, &square) * grid.resolution;
                    least = if distance >= least {
                        least
                    } else {
                        distance.max(0.0)
                    };
                }
            }
        }
        least
    }

    /// Whether a point of some obstacle lies in the ring, though its outline meets none: a post inside a footprint.
    pub fn any_inside(&self, ring: &[Point2]) -> bool {
        let b = box_of(ring);
        let [columns, rows] = self.window(&b);
        for row in rows {
            for column in columns.clone() {
                for item in &self.buckets[row * self.columns + column] {
                    let inside = match *item {
                        Item::Edge { ring: r, index } => {
                            contains(ring, self.rings[r as usize][index as usize])
                        }
                        Item::Disc(d) => contains(ring, self.discs[d as usize].0),
                        Item::Ring(_) => false,
                    };
                    if inside {
                        return true;
                    }
                }
            }
        }
        let Some(grid) = self.world.grid() else {
            return false;
        };
        let local: Vec<Point2> = ring
            .iter()
            .map(|v| Point2::from(grid.to_cell_coordinates(*v)))
            .collect();
        let b = box_of(&local);
        let index = |v: f64, most: usize| (v.max(0.0) as usize).min(most.saturating_sub(1));
        (index(b.min.y, grid.height)..=index(b.max.y, grid.height)).any(|y| {
            (index(b.min.x, grid.width)..=index(b.max.x, grid.width)).any(|x| {
                !matches!(grid.cell(x, y), Some(Cell::Free))
                    && contains(&local, Point2::new(x as f64 + 0.5, y as f64 + 0.5))
            })
        })
    }
}

fn box_of(points: &[Point2]) -> Bounds {
    let mut b = Bounds {
        min: points[0],
        max: points[0],
    };
    for p in points {
        b.min = Point2::new(b.min.x.min(p.x), b.min.y.min(p.y));
        b.max = Point2::new(b.max.x.max(p.x), b.max.y.max(p.y));
    }
    b
}

fn grown(b: &Bounds, by: f64) -> Bounds {
    let by = Vector2::new(by, by);
    Bounds {
        min: b.min - by,
        max: b.max + by,
    }
}

fn point_to_segment(p: Point2, a: Point2, b: Point2) -> f64 {
    let (along, offset) = (b - a, p - a);
    let squared = along.norm_squared();
    let t = if squared > 0.0 {
        (offset.dot(&along) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (offset - along * t).norm()
}

/// Whether two segments have a point in common; sides are judged by the sign of the area they span.
fn segments_cross(a: Point2, b: Point2, c: Point2, d: Point2) -> bool {
    let side = |p: Point2, q: Point2, r: Point2| cross(q - p, r - p);
    let (s, t) = (side(a, b, c) * side(a, b, d), side(c, d, a) * side(c, d, b));
    s <= 0.0 && t <= 0.0 && (s < 0.0 || t < 0.0)
}

fn segment_to_segment(a: Point2, b: Point2, c: Point2, d: Point2) -> f64 {
    if segments_cross(a, b, c, d) {
        return 0.0;
    }
    point_to_segment(a, c, d)
        .min(point_to_segment(b, c, d))
        .min(point_to_segment(c, a, b))
        .min(point_to_segment(d, a, b))
}

/// From a convex shape, its inside included, to a segment.
fn convex_to_segment(hull: &[Point2], a: Point2, b: Point2) -> f64 {
    if hull.len() > 2 && contains(hull, a) {
        return 0.0;
    }
    sides(hull)
        .map(|(c, d)| segment_to_segment(a, b, c, d))
        .fold(f64::INFINITY, f64::min)
}

/// Between two convex shapes, their insides included.
fn convex_distance(a: &[Point2], b: &[Point2]) -> f64 {
    if contains(b, a[0]) || (a.len() > 2 && contains(a, b[0])) {
        return 0.0;
    }
    sides(b)
        .map(|(c, d)| convex_to_segment(a, c, d))
        .fold(f64::INFINITY, f64::min)
}

fn sides(ring: &[Point2]) -> impl Iterator<Item = (Point2, Point2)> + '_ {
    let n = if ring.len() == 2 { 1 } else { ring.len() };
    (0..n).map(move |i| (ring[i], ring[(i + 1) % ring.len()]))
}

/// Whether a ring winds around `p` (sum of quarter turns; on the boundary either answer).
fn contains(ring: &[Point2], p: Point2) -> bool {
    let mut winding = 0;
    for (a, b) in sides(ring) {
        if a.y <= p.y && b.y > p.y && cross(b - a, p - a) > 0.0 {
            winding += 1;
        } else if a.y > p.y && b.y <= p.y && cross(b - a, p - a) < 0.0 {
            winding -= 1;
        }
    }
    winding != 0
}

/// The convex hull of a few points, counter-clockwise (monotone chain).
pub(super) fn convex_hull(points: &mut Vec<Point2>) {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return;
    }
    let mut hull: Vec<Point2> = Vec::with_capacity(2 * points.len());
    for pass in 0..2 {
        let first = hull.len();
        let mut add = |p: Point2| {
            while hull.len() >= first + 2
                && cross(
                    hull[hull.len() - 1] - hull[hull.len() - 2],
                    p - hull[hull.len() - 1],
                ) <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        };
        if pass == 0 {
            points.iter().copied().for_each(&mut add);
        } else {
            points.iter().rev().copied().for_each(&mut add);
        }
        hull.pop();
    }
    *points = hull;
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Pose2;
    use bikebot_world::{Footprint, OccupancyGrid};
    use proptest::prelude::*;

    fn p(x: f64, y: f64) -> Point2 {
        Point2::new(x, y)
    }

    #[test]
    fn the_hull_of_a_square_with_a_point_inside_is_the_square() {
        let mut points = vec![
            p(0.0, 0.0),
            p(1.0, 1.0),
            p(0.5, 0.4),
            p(1.0, 0.0),
            p(0.0, 1.0),
        ];
        convex_hull(&mut points);
        assert_eq!(points, [p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]);
    }

    proptest! {
        /// The two implementations share no code: they agree on boxes and axes anywhere, in shapes and in a turned grid.
        #[test]
        fn distances_agree_with_those_of_the_world(
            x in 0.0..12.0_f64, y in 0.0..12.0_f64, heading in -3.2..3.2_f64, turned in 0..2_u8,
            solid in prop::collection::vec(0..12_u8, 144),
        ) {
            let world = if turned == 0 {
                World::new(Bounds::new(0.0, 0.0, 12.0, 12.0), vec![
                    Obstacle::Disc { center: p(3.0, 3.0), radius: 0.7 },
                    Obstacle::Block { min: p(6.0, 1.0), max: p(8.0, 5.0) },
                    Obstacle::Polygon { vertices: vec![p(2.0, 8.0), p(9.0, 7.0), p(9.0, 11.0), p(8.0, 8.0)] },
                ]).unwrap()
            } else {
                let cells = solid.iter().map(|n| if *n == 0 { Cell::Occupied } else { Cell::Free }).collect();
                World::from_grid(OccupancyGrid::new(12, 12, 1.0, Pose2::new(3.0, -2.0, 0.4), cells).unwrap()).unwrap()
            };
            let obstacles = Obstacles::new(&world);
            let pose = Pose2::new(x, y, heading);
            let at = |x: f64, y: f64| pose.transform(p(x, y));
            let shapes = [
                ("box:1.2x0.5@0.2", vec![at(-0.4, -0.25), at(0.8, -0.25), at(0.8, 0.25), at(-0.4, 0.25)], 0.0),
                ("capsule:1.2x0.4", vec![at(-0.4, 0.0), at(0.4, 0.0)], 0.2),
                ("point", vec![pose.position], 0.0),
            ];
            for (text, hull, radius) in shapes {
                let footprint: Footprint = text.parse().unwrap();
                let expected = world.footprint_clearance(&footprint, &pose);
                let found = obstacles.distance(&hull, f64::INFINITY) - radius;
                if expected + radius > 1e-9 {
                    prop_assert!((found - expected).abs() < 1e-9, "{text} {found} {expected}");
                } else {
                    prop_assert!(found <= 1e-9 - radius, "{text} {found} {expected}");
                }
            }
        }
    }
}
