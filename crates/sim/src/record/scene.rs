//! Plane shapes made into pictures: outlines, cells and triangles.

use std::f64::consts::{FRAC_PI_2, PI};

use super::event::{CellState, GridSample, Shape};

/// Cells a rasterised world may have; enough for a sharp picture, small enough to
/// be sent at once.
const CELL_BUDGET: f64 = 250_000.0;

/// Cells of a map's own grid that are sent as they are; a larger one is shrunk.
const GRID_BUDGET: usize = 1_000_000;

/// Finest cell of a rasterised world, m.
const FINEST_CELL: f64 = 0.02;

/// Pieces of a half circle in an outline: the polygon stays within 1 % of the radius.
const HALF_CIRCLE_PIECES: usize = 12;

/// The outline of a capsule whose axis runs from `rear` to `front` on the x axis, m.
///
/// With `rear = front` it is a disc. Counter-clockwise, from the right rear.
#[must_use]
pub fn capsule_outline(rear: f64, front: f64, radius: f64) -> Vec<[f64; 2]> {
    let half_circle = |center: f64, from: f64| {
        (0..=HALF_CIRCLE_PIECES).map(move |piece| {
            let angle = from + PI * piece as f64 / HALF_CIRCLE_PIECES as f64;
            [center + radius * angle.cos(), radius * angle.sin()]
        })
    };
    half_circle(front, -FRAC_PI_2)
        .chain(half_circle(rear, FRAC_PI_2))
        .collect()
}

/// The outline of a rectangle from `rear` to `front` along x, m.
#[must_use]
pub fn rectangle_outline(rear: f64, front: f64, half_width: f64) -> Vec<[f64; 2]> {
    vec![
        [rear, -half_width],
        [front, -half_width],
        [front, half_width],
        [rear, half_width],
    ]
}

/// A grid that owns its cells.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Raster {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) resolution: f64,
    pub(crate) origin: [f64; 2],
    pub(crate) yaw: f64,
    pub(crate) cells: Vec<CellState>,
}

impl Raster {
    /// The grid as events carry one.
    pub(crate) fn sample(&self) -> GridSample<'_> {
        GridSample {
            width: self.width,
            height: self.height,
            resolution: self.resolution,
            origin: self.origin,
            yaw: self.yaw,
            cells: &self.cells,
        }
    }
}

/// Draws shapes into cells whose side is the least 1-2-5 step that keeps the
/// picture small.
///
/// A cell is occupied when its centre lies in a shape or within half a cell of
/// its edge, so that a wall thinner than a cell does not vanish.
pub(crate) fn rasterise(bounds: [[f64; 2]; 2], shapes: &[Shape]) -> Raster {
    let [min, max] = bounds;
    let extent = [0, 1].map(|axis| {
        let length = max[axis] - min[axis];
        if length.is_finite() {
            length.max(0.0)
        } else {
            0.0
        }
    });
    let resolution = cell_side(extent);
    let count = |axis: usize| ((extent[axis] / resolution - 1e-9).ceil().max(1.0)) as usize;
    let (width, height) = (count(0), count(1));
    let mut cells = vec![CellState::Free; width * height];
    for shape in shapes {
        let (low, high) = bounding_box(shape);
        let span = |axis: usize, count: usize| {
            let first = (low[axis] - min[axis]) / resolution - 1.0;
            let last = (high[axis] - min[axis]) / resolution + 1.0;
            // Casts saturate, so shapes far off the field give empty spans.
            (first.max(0.0) as usize).min(count)..(last.max(0.0).ceil() as usize).min(count)
        };
        for row in span(1, height) {
            for column in span(0, width) {
                let center = [
                    min[0] + (column as f64 + 0.5) * resolution,
                    min[1] + (row as f64 + 0.5) * resolution,
                ];
                if touches(shape, center, 0.5 * resolution) {
                    cells[row * width + column] = CellState::Occupied;
                }
            }
        }
    }
    Raster {
        width,
        height,
        resolution,
        origin: min,
        yaw: 0.0,
        cells,
    }
}

/// A grid too large to send, with blocks of cells made into one: occupied if any
/// of them is, else unknown if any is. `None` if it is small enough already.
pub(crate) fn shrink(grid: &GridSample<'_>) -> Option<Raster> {
    let (mut width, mut height, mut factor) = (grid.width, grid.height, 1);
    while width.saturating_mul(height) > GRID_BUDGET {
        factor += 1;
        width = grid.width.div_ceil(factor);
        height = grid.height.div_ceil(factor);
    }
    if factor == 1 {
        return None;
    }
    let mut cells = vec![CellState::Free; width * height];
    for (index, cell) in grid.cells.iter().enumerate() {
        let (row, column) = (index / grid.width, index % grid.width);
        let block = &mut cells[row / factor * width + column / factor];
        *block = match (*block, *cell) {
            (CellState::Occupied, _) | (_, CellState::Occupied) => CellState::Occupied,
            (CellState::Unknown, _) | (_, CellState::Unknown) => CellState::Unknown,
            (CellState::Free, CellState::Free) => CellState::Free,
        };
    }
    Some(Raster {
        width,
        height,
        resolution: grid.resolution * factor as f64,
        origin: grid.origin,
        yaw: grid.yaw,
        cells,
    })
}

/// The least of 1, 2, 5 × 10^k m that covers the extent within the budget.
fn cell_side(extent: [f64; 2]) -> f64 {
    // Long thin fields round up to whole cells, hence the second term.
    let needed = (extent[0] * extent[1] / CELL_BUDGET)
        .sqrt()
        .max(extent[0].max(extent[1]) / CELL_BUDGET)
        .max(FINEST_CELL);
    let decade = 10f64.powf(needed.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|step| step * decade >= needed * (1.0 - 1e-9))
        .unwrap_or(10.0);
    step * decade
}

fn bounding_box(shape: &Shape) -> ([f64; 2], [f64; 2]) {
    match shape {
        Shape::Disc { center, radius } => (
            [center[0] - radius, center[1] - radius],
            [center[0] + radius, center[1] + radius],
        ),
        Shape::Block { min, max } => (*min, *max),
        Shape::Polygon { vertices } => vertices.iter().fold(
            ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
            |(low, high), vertex| {
                (
                    [low[0].min(vertex[0]), low[1].min(vertex[1])],
                    [high[0].max(vertex[0]), high[1].max(vertex[1])],
                )
            },
        ),
    }
}

/// Whether a point lies in a shape or within `reach` of its edge.
fn touches(shape: &Shape, point: [f64; 2], reach: f64) -> bool {
    match shape {
        Shape::Disc { center, radius } => {
            (point[0] - center[0]).hypot(point[1] - center[1]) <= radius + reach
        }
        Shape::Block { min, max } => {
            (0..2).all(|axis| point[axis] >= min[axis] - reach && point[axis] <= max[axis] + reach)
        }
        Shape::Polygon { vertices } => {
            let edges = || {
                let next = vertices.iter().cycle().skip(1);
                vertices.iter().zip(next)
            };
            let crossings = edges()
                .filter(|(a, b)| {
                    (a[1] > point[1]) != (b[1] > point[1])
                        && point[0] < a[0] + (point[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
                })
                .count();
            crossings % 2 == 1 || edges().any(|(a, b)| distance_to_segment(point, *a, *b) <= reach)
        }
    }
}

fn distance_to_segment(point: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let to_point = [point[0] - a[0], point[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let t = if square > 0.0 {
        ((along[0] * to_point[0] + along[1] * to_point[1]) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (to_point[0] - t * along[0]).hypot(to_point[1] - t * along[1])
}

/// Triangles (as indices into `vertices`) that cover a simple polygon: ear clipping.
///
/// A polygon that crosses itself is covered as far as ears can be found.
pub(crate) fn triangulate(vertices: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let doubled_area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let mut left: Vec<usize> = (0..vertices.len()).collect();
    let turning: f64 = (0..vertices.len())
        .map(|i| {
            let (a, b) = (vertices[i], vertices[(i + 1) % vertices.len()]);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum();
    if turning < 0.0 {
        left.reverse();
    }
    let mut triangles = Vec::with_capacity(vertices.len().saturating_sub(2));
    while left.len() >= 3 {
        let count = left.len();
        let ear = (0..count).find(|&i| {
            let corner = [
                left[(i + count - 1) % count],
                left[i],
                left[(i + 1) % count],
            ];
            let [a, b, c] = corner.map(|index| vertices[index]);
            doubled_area(a, b, c) > 0.0
                && left.iter().all(|&other| {
                    let p = vertices[other];
                    corner.contains(&other)
                        || doubled_area(a, b, p) < 0.0
                        || doubled_area(b, c, p) < 0.0
                        || doubled_area(c, a, p) < 0.0
                })
        });
        // Without an ear what is left is flat or crosses itself.
        let Some(i) = ear else { break };
        triangles.push([
            left[(i + count - 1) % count],
            left[i],
            left[(i + 1) % count],
        ]);
        left.remove(i);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_of_a_capsule_stays_on_it() {
        let outline = capsule_outline(-0.04, 1.16, 0.3);
        for [x, y] in &outline {
            let axis = x.clamp(-0.04, 1.16);
            assert!(((x - axis).hypot(*y) - 0.3).abs() < 1e-12);
        }
        assert!(outline.iter().any(|[x, _]| (x - 1.46).abs() < 1e-12));
        assert!(outline.iter().any(|[x, _]| (x + 0.34).abs() < 1e-12));
    }

    #[test]
    fn occupied_cells_cover_the_area_of_the_shapes() {
        let shapes = [
            Shape::Disc {
                center: [3.0, 3.0],
                radius: 1.0,
            },
            Shape::Polygon {
                vertices: vec![[6.0, 1.0], [9.0, 1.0], [9.0, 3.0]],
            },
            Shape::Block {
                min: [1.0, 7.0],
                max: [2.0, 9.0],
            },
        ];
        let raster = rasterise([[0.0, 0.0], [10.0, 10.0]], &shapes);
        assert_eq!((raster.width, raster.height), (500, 500));
        let occupied = raster
            .cells
            .iter()
            .filter(|it| **it == CellState::Occupied)
            .count();
        let area = occupied as f64 * raster.resolution.powi(2);
        // Exact areas, and half a cell more along each edge.
        let exact = PI + 3.0 + 2.0;
        let edges = 2.0 * PI + (3.0 + 2.0 + 13f64.sqrt()) + 6.0;
        let grown = exact + edges * 0.5 * raster.resolution;
        assert!((area - grown).abs() < 0.02, "{area} against {grown}");
    }

    #[test]
    fn a_wall_thinner_than_a_cell_is_still_seen_and_far_shapes_do_no_harm() {
        let wall = Shape::Polygon {
            vertices: vec![[0.0, 50.0], [100.0, 50.0], [100.0, 50.001], [0.0, 50.001]],
        };
        let far = Shape::Disc {
            center: [1e9, -1e9],
            radius: 5.0,
        };
        let raster = rasterise([[0.0, 0.0], [100.0, 100.0]], &[wall, far]);
        for column in 0..raster.width {
            assert!(
                (0..raster.height).any(|row| {
                    raster.cells[row * raster.width + column] == CellState::Occupied
                })
            );
        }
        assert!((raster.width * raster.height) as f64 <= CELL_BUDGET);
    }

    #[test]
    fn a_grid_too_large_is_shrunk_without_losing_an_obstacle() {
        let (width, height) = (1501, 1403);
        let mut cells = vec![CellState::Free; width * height];
        cells[1402 * width + 1500] = CellState::Occupied;
        cells[7] = CellState::Unknown;
        let mut grid = GridSample {
            width,
            height,
            resolution: 0.05,
            origin: [3.0, 4.0],
            yaw: 0.1,
            cells: &cells,
        };
        let small = shrink(&grid).unwrap();
        assert_eq!(
            (small.width, small.height, small.resolution),
            (751, 702, 0.1)
        );
        assert_eq!(small.cells[3], CellState::Unknown);
        assert_eq!(small.cells.last(), Some(&CellState::Occupied));
        assert_eq!(
            small
                .cells
                .iter()
                .filter(|it| **it != CellState::Free)
                .count(),
            2
        );
        (grid.width, grid.height, grid.cells) = (10, 10, &cells[..100]);
        assert_eq!(shrink(&grid), None);
    }

    #[test]
    fn cells_stay_within_budget_for_any_field() {
        for extent in [
            [1e-3, 1e-3],
            [1.0, 1.0],
            [1e6, 1e-3],
            [3e4, 7e4],
            [1e12, 1e12],
        ] {
            let raster = rasterise([[-5.0, 2.0], [-5.0 + extent[0], 2.0 + extent[1]]], &[]);
            let count = raster.width * raster.height;
            assert!(
                count >= 1 && count as f64 <= 1.01 * CELL_BUDGET,
                "{extent:?}: {count}"
            );
        }
        assert_eq!(rasterise([[0.0; 2], [f64::NAN; 2]], &[]).cells.len(), 1);
    }

    #[test]
    fn triangles_of_a_hooked_polygon_cover_its_area_either_way_round() {
        // An L with an extra notch, 12 of area by hand.
        let mut hook = vec![
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 1.0],
            [3.0, 1.0],
            [3.0, 2.0],
            [1.0, 2.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        let exact = 5.0 + 3.0 + 1.0;
        for _ in 0..2 {
            let triangles = triangulate(&hook);
            assert_eq!(triangles.len(), hook.len() - 2);
            let area: f64 = triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|i| hook[i]);
                    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
                })
                .sum();
            assert!((area - exact).abs() < 1e-12);
            hook.reverse();
        }
    }

    #[test]
    fn degenerate_polygons_end_and_give_what_they_can() {
        assert!(triangulate(&[]).is_empty());
        assert!(triangulate(&[[0.0, 0.0], [1.0, 0.0]]).is_empty());
        assert!(triangulate(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]).is_empty());
        let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert!(triangulate(&bow_tie).len() <= 2);
        assert!(triangulate(&[[f64::NAN, 0.0]; 4]).is_empty());
    }
}
