//! The pieces the obstacles' boundary is made of, for whoever builds geometry of his own on it.

use bikebot_geometry::{Point2, Vector2};

use crate::obstacle::Bounds;

/// A piece of the boundary; see [`crate::World::visit_boundary`]. Lengths in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BoundaryPiece {
    /// A whole disc.
    Disc {
        /// Its centre.
        center: Point2,
        /// Its radius.
        radius: f64,
    },
    /// A whole axis-aligned rectangle.
    Block {
        /// Lower-left corner.
        min: Point2,
        /// Upper-right corner.
        max: Point2,
    },
    /// A straight side of a polygon, or of the solid cells of a grid, with the solid on its left.
    Side {
        /// Where it begins.
        start: Point2,
        /// Where it ends.
        end: Point2,
        /// Whether the solid fills less than a half turn where the side begins.
        begins_convex: bool,
    },
}

impl BoundaryPiece {
    /// The smallest axis-aligned rectangle around the piece.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        match self {
            Self::Disc { center, radius } => Bounds {
                min: center - Vector2::repeat(*radius),
                max: center + Vector2::repeat(*radius),
            },
            Self::Block { min, max } => Bounds {
                min: *min,
                max: *max,
            },
            Self::Side { start, end, .. } => Bounds {
                min: start.inf(end),
                max: start.sup(end),
            },
        }
    }
}
