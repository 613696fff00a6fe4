//! What makes no sense about a world.

/// Largest coordinate magnitude (m) a world accepts. Beyond it the squares taken by distance
/// arithmetic would leave too few digits for a centimetre.
pub(crate) const MAX_COORDINATE: f64 = 1e9;

/// Smallest extent (m) of a field: cells of the clearance grid must have a size.
pub(crate) const MIN_EXTENT: f64 = 1e-12;

/// Largest number of cells along one side of a grid.
pub(crate) const MAX_GRID_SIDE: usize = 16_384;

/// Largest number of cells of a grid (64 Mi cells, one byte each).
pub(crate) const MAX_GRID_CELLS: usize = 64 * 1024 * 1024;

/// A description of obstacles, field or grid from which no world can be built.
///
/// Obstacles are counted from 0 in the order they were given. Lengths are in metres.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The field has no area, or one of its corners is not a usable number.
    #[error(
        "field from ({min_x}, {min_y}) m to ({max_x}, {max_y}) m: each maximum must be above its minimum, by at least 1e-12 m, and within ±1e9 m"
    )]
    Bounds {
        /// Least x, m.
        min_x: f64,
        /// Least y, m.
        min_y: f64,
        /// Greatest x, m.
        max_x: f64,
        /// Greatest y, m.
        max_y: f64,
    },
    /// A coordinate of an obstacle is NaN, infinite or beyond ±1e9 m.
    #[error("obstacle {obstacle}: coordinate {value} m is not within ±1e9 m")]
    Coordinate {
        /// Which obstacle.
        obstacle: usize,
        /// The offending coordinate, m.
        value: f64,
    },
    /// A disc whose radius is not a positive number.
    #[error("obstacle {obstacle}: disc radius {radius} m must be above 0")]
    Radius {
        /// Which obstacle.
        obstacle: usize,
        /// The offending radius, m.
        radius: f64,
    },
    /// A block whose maximum is not above its minimum in both axes.
    #[error("obstacle {obstacle}: a block of {width} m by {height} m has no area")]
    EmptyBlock {
        /// Which obstacle.
        obstacle: usize,
        /// Extent along x, m.
        width: f64,
        /// Extent along y, m.
        height: f64,
    },
    /// A polygon with fewer than three distinct vertices or without area.
    #[error(
        "obstacle {obstacle}: a polygon of {vertices} distinct vertices and {area} m² encloses nothing"
    )]
    EmptyPolygon {
        /// Which obstacle.
        obstacle: usize,
        /// Distinct vertices.
        vertices: usize,
        /// Enclosed area, m².
        area: f64,
    },
    /// A polygon two of whose edges cross or touch, so that its inside is not defined.
    #[error(
        "obstacle {obstacle}: edge {first} and edge {second} of the polygon meet near ({x}, {y}) m; split it into simple polygons"
    )]
    SelfCrossing {
        /// Which obstacle.
        obstacle: usize,
        /// First edge (edge i runs from vertex i to vertex i + 1 of the cleaned polygon).
        first: usize,
        /// Second edge.
        second: usize,
        /// Where they meet, m.
        x: f64,
        /// Where they meet, m.
        y: f64,
    },
    /// A grid without cells, or with more than can be held.
    #[error(
        "grid of {width} by {height} cells: each side must be 1 to 16384 and the whole at most 67108864 cells"
    )]
    GridSize {
        /// Cells along x.
        width: usize,
        /// Cells along y.
        height: usize,
    },
    /// A grid whose cell list does not match its size.
    #[error("grid of {width} by {height} needs {expected} cells, {found} given")]
    GridCells {
        /// Cells along x.
        width: usize,
        /// Cells along y.
        height: usize,
        /// width · height.
        expected: usize,
        /// Cells given.
        found: usize,
    },
    /// A cell size that is not a positive, finite length.
    #[error(
        "grid resolution {resolution} m per cell must be above 0 and leave the grid within ±1e9 m"
    )]
    Resolution {
        /// The offending cell size, m.
        resolution: f64,
    },
    /// A grid origin that is not finite or beyond ±1e9 m.
    #[error("grid origin ({x} m, {y} m, {yaw} rad) must be finite and within ±1e9 m")]
    GridOrigin {
        /// m.
        x: f64,
        /// m.
        y: f64,
        /// rad.
        yaw: f64,
    },
    /// A scale factor that is not a positive, finite number.
    #[error("scale factor {factor} must be a finite number above 0")]
    Scale {
        /// The offending factor.
        factor: f64,
    },
    /// The grid and the given bounds have no area in common.
    #[error("the grid lies outside the given field")]
    Disjoint,
    /// A change names a cell the grid does not have, or there is no grid.
    #[error(
        "there is no cell in column {column}, row {row}: the grid has {width} by {height} cells"
    )]
    NoSuchCell {
        /// Column named.
        column: usize,
        /// Row named.
        row: usize,
        /// Cells along x; 0 without a grid.
        width: usize,
        /// Cells along y; 0 without a grid.
        height: usize,
    },
    /// A change takes away an obstacle that is not there.
    #[error("there is no obstacle {obstacle} to take away: there are {count}, counted from 0")]
    NoSuchObstacle {
        /// Index named.
        obstacle: usize,
        /// Obstacles there are.
        count: usize,
    },
}
