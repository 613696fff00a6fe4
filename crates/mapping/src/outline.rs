//! The bike's own outline among returns and cells.

use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::{Footprint, OccupancyGrid};

/// A footprint as convex parts with a radius about each, m.
#[derive(Debug, Clone, Default)]
pub(crate) struct Outline {
    parts: Vec<(Vec<Point2>, f64)>,
    /// No point of it lies farther than this from the reference point, m.
    reach: f64,
}

impl Outline {
    pub(crate) fn new(footprint: &Footprint) -> Self {
        Self {
            parts: footprint.convex_parts(),
            reach: footprint.reach(),
        }
    }

    /// Whether a point in the bike's frame (m) lies within the outline.
    pub(crate) fn contains(&self, point: Point2) -> bool {
        self.parts
            .iter()
            .any(|(corners, radius)| distance(corners, point) <= *radius)
    }

    /// The cells that have a point in common with the outline at `pose`; calls `visit` once for each, row by row.
    pub(crate) fn cells(
        &self,
        pose: &Pose2,
        grid: &OccupancyGrid,
        mut visit: impl FnMut(usize, usize),
    ) {
        let parts: Vec<(Vec<Vector2>, f64)> = self
            .parts
            .iter()
            .map(|(corners, radius)| {
                let corners = corners
                    .iter()
                    .map(|corner| grid.to_cell_coordinates(pose.transform(*corner)));
                (corners.collect(), radius / grid.resolution)
            })
            .collect();
        let centre = grid.to_cell_coordinates(pose.position);
        let reach = self.reach / grid.resolution + 1.0;
        // A cast saturates at either end; NaN becomes an empty span.
        let span = |c: f64, size: usize| {
            let first = (c - reach).floor().max(0.0) as usize;
            let past = (c + reach).ceil().max(0.0) as usize;
            first.min(size)..past.min(size)
        };
        for y in span(centre.y, grid.height) {
            for x in span(centre.x, grid.width) {
                let low = Vector2::new(x as f64, y as f64);
                if parts
                    .iter()
                    .any(|(corners, radius)| square_distance(corners, low) <= *radius)
                {
                    visit(x, y);
                }
            }
        }
    }
}

/// Distance from a point to a segment.
fn to_segment(a: Vector2, b: Vector2, p: Vector2) -> f64 {
    let span = b - a;
    let length = span.norm_squared();
    let t = if length > 0.0 {
        ((p - a).dot(&span) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p - a - span * t).norm()
}

/// The sides of a convex shape: of one vertex a point, of two a segment.
fn sides(corners: &[Vector2]) -> impl Iterator<Item = (Vector2, Vector2)> {
    let count = match corners.len() {
        2 => 1,
        n => n,
    };
    (0..count).map(move |i| (corners[i], corners[(i + 1) % corners.len()]))
}

/// Whether a point lies in a convex polygon, counter-clockwise; a point or a segment holds nothing.
fn is_inside(corners: &[Vector2], p: Vector2) -> bool {
    corners.len() > 2 && sides(corners).all(|(a, b)| bikebot_geometry::cross(b - a, p - a) >= 0.0)
}

/// Distance from a point to a convex shape; 0 inside.
fn distance(corners: &[Point2], p: Point2) -> f64 {
    let count = corners.len();
    if count > 2
        && (0..count).all(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % count]);
            bikebot_geometry::cross(b - a, p - a) >= 0.0
        })
    {
        return 0.0;
    }
    (0..count)
        .map(|i| to_segment(corners[i].coords, corners[(i + 1) % count].coords, p.coords))
        .fold(f64::INFINITY, f64::min)
}

/// Distance from the unit square with this lower left corner to a convex shape; 0 where they meet.
fn square_distance(corners: &[Vector2], low: Vector2) -> f64 {
    let square =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| low + Vector2::new(x, y));
    let holds = |p: &Vector2| is_inside(&square, *p);
    if corners.iter().any(holds) || square.iter().any(|p| is_inside(corners, *p)) {
        return 0.0;
    }
    let mut nearest = f64::INFINITY;
    for (a, b) in sides(corners) {
        for (c, d) in sides(&square) {
            if crosses(a, b, c, d) {
                return 0.0;
            }
            for distance in [
                to_segment(a, b, c),
                to_segment(c, d, a),
                to_segment(c, d, b),
            ] {
                nearest = nearest.min(distance);
            }
        }
    }
    nearest
}

/// Whether two segments cross, each between the other's ends.
fn crosses(a: Vector2, b: Vector2, c: Vector2, d: Vector2) -> bool {
    let side = |p: Vector2, q: Vector2, r: Vector2| bikebot_geometry::cross(q - p, r - p);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_world::{Cell, World};
    use proptest::prelude::*;

    #[test]
    fn the_bike_holds_its_laser_and_not_what_stands_a_metre_ahead() {
        let outline = Outline::new(&Footprint::bike());
        assert!(outline.contains(Point2::new(1.2, 0.0)));
        assert!(outline.contains(Point2::new(1.45, 0.0)));
        assert!(!outline.contains(Point2::new(1.47, 0.0)));
        assert!(!outline.contains(Point2::new(0.5, 0.31)));
    }

    proptest! {
        // Each case builds a world for every cell.
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Against the world's own overlap test, with the one cell as an obstacle.
        #[test]
        fn the_cells_under_a_footprint_are_those_it_overlaps(
            x in 1.0..3.0_f64, y in 1.0..3.0_f64, heading in -3.2..3.2_f64, yaw in -0.5..0.5_f64,
            shape in prop::sample::select(vec![
                "bike", "disc:0.4", "box:1.3x0.5", "polygon:0,0;1,0;1,1;0.5,0.2;0,0.8", "point",
            ]),
        ) {
            let footprint: Footprint = shape.parse().unwrap();
            let origin = Pose2::new(-0.3, -0.2, yaw);
            let mut grid = OccupancyGrid::filled(15, 15, 0.3, origin, Cell::Free).unwrap();
            let pose = Pose2::new(x, y, heading);
            let empty = World::from_grid(grid.clone()).unwrap();
            let to_edge = empty.footprint_clearance(&footprint, &pose);
            let mut under = Vec::new();
            Outline::new(&footprint).cells(&pose, &grid, |x, y| under.push((x, y)));
            for row in 0..15 {
                for column in 0..15 {
                    grid.set(column, row, Cell::Occupied);
                    let world = World::from_grid(grid.clone()).unwrap();
                    let clearance = world.footprint_clearance(&footprint, &pose);
                    grid.set(column, row, Cell::Free);
                    // Only where the cell decides, and not the edge of the field.
                    if clearance < to_edge - 1e-9
                        && clearance.abs() > 1e-9
                    {
                        let is_under = under.contains(&(column, row));
                        prop_assert_eq!(is_under, clearance < 0.0, "{} {}", column, row);
                    }
                }
            }
        }
    }
}
