//! What makes no sense in this crate.

/// A parameter set that no real bike or sensor can have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DynamicsError {
    /// Three moments of inertia that no distribution of mass has: the largest exceeds the sum
    /// of the other two.
    #[error(
        "the moments of inertia of {link} are impossible: {x} {y} {z} kg m² about x, y, z, \
         and the largest exceeds the sum of the other two"
    )]
    ImpossibleInertia {
        /// `"link 1"` (frame) or `"link 2"` (balancer).
        link: &'static str,
        /// About the roll axis, kg m².
        x: f64,
        /// About the lateral axis, kg m².
        y: f64,
        /// About the vertical axis, kg m².
        z: f64,
    },
    /// A product of inertia that makes the inertia tensor indefinite.
    #[error(
        "the product of inertia {product} kg m² is impossible beside {x} and {z} kg m²: \
         its square must stay below their product"
    )]
    ImpossibleProduct {
        /// `I1xz`, kg m².
        product: f64,
        /// `I1x`, kg m².
        x: f64,
        /// `I1z`, kg m².
        z: f64,
    },
    /// Wheels and fork that together exceed link 1, so that no frame is left.
    #[error(
        "wheels and fork leave a frame of {mass} kg with a least moment of inertia of {least_moment} kg m², \
         and both must be above 0: link 1 is too light or too slender for them"
    )]
    NothingLeftForTheFrame {
        /// kg.
        mass: f64,
        /// Least principal moment of inertia, kg m².
        least_moment: f64,
    },
    /// A balancer whose centre of gravity would pass through the ground.
    #[error(
        "the balancer's centre of gravity swings {offset} m about a pivot {pivot} m above the ground, so it \
         would pass below it: the offset must stay below the height"
    )]
    BalancerBelowGround {
        /// Height of the pivot, `l`, m.
        pivot: f64,
        /// The larger of the two offsets `d`, m.
        offset: f64,
    },
    /// A laser whose nearest reading lies beyond its farthest.
    #[error("the laser's least range {min} m must stay below its largest range {max} m")]
    EmptyRange {
        /// Least range, m.
        min: f64,
        /// Largest range, m.
        max: f64,
    },
    /// A laser without a beam.
    #[error("the laser has no beams: it takes one at least")]
    NoBeams,
    /// A laser in the bike's own body.
    #[error(
        "the laser's mount at ({x}, {y}, {z}) m lies inside {part}: its beams would begin in the bike itself"
    )]
    LaserInside {
        /// `"the rear wheel"`, `"the front wheel"` or `"the frame"`.
        part: &'static str,
        /// Ahead of the rear contact, m.
        x: f64,
        /// To the left, m.
        y: f64,
        /// Above the ground, m.
        z: f64,
    },
    /// A parameter of a Whipple bicycle that no bicycle has.
    #[error("{what} = {value} {unit} must be {bound}: {reason}")]
    ImpossibleBicycle {
        /// The parameter's symbol, or what was computed of several.
        what: String,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Where it may lie.
        bound: String,
        /// Why it may lie nowhere else.
        reason: String,
    },
    /// A speed at which a bicycle has no eigenvalues.
    #[error(
        "there are no eigenvalues at {speed} m/s: the speed must be finite, not negative and of human size"
    )]
    NoEigenvalues {
        /// m/s.
        speed: f64,
    },
}
