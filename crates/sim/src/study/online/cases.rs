//! The rides of the campaign, made from seeds: random fields, maps, and a corridor with equal ways to both sides.

use std::fmt::Write as _;

use bikebot_geometry::{Point2, Pose2, Vector2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Read, resolve};

/// Side of a random field, m.
pub const SIDE: f64 = 30.0;
/// The two modes, as a scenario writes them.
pub const MODES: [&str; 2] = ["flywheel", "balancer"];
/// Ends on a map lie at least this far apart, m, and are drawn at most so often.
const APART: f64 = 4.0;
const TRIES: u32 = 5000;

/// Noise of laser and sensors that every ride of the campaign has.
const NOISE: &str = "\
[laser]
range_sigma_m = 0.01
dropout_probability = 0.005
[noise]
roll_sigma_deg = 0.1
roll_rate_sigma_radps = 0.01
speed_sigma_mps = 0.01
position_sigma_m = 0.01
heading_sigma_deg = 0.2
pose_rate_hz = 20.0
";

/// One ride to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Which part of the campaign it belongs to.
    pub suite: String,
    /// What it is made from.
    pub seed: u64,
    /// The scenario.
    pub text: String,
    /// Whether a block comes to stand on the way.
    pub has_surprise: bool,
    /// The middle of a block that can be passed on the left as well as on the right of a corridor along x, m.
    pub two_sides_of: Option<Point2>,
}

/// A field with `count` discs, blocks and triangles, a start in its lower left and a goal in its upper right.
#[must_use]
pub fn field(suite: &str, seed: u64, count: usize, mode: &str, has_surprise: bool) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = |from: f64, to: f64| from + (to - from) * unit(&mut rng);
    let (start, goal) = (Point2::new(2.0, 2.0), Point2::new(SIDE - 2.5, SIDE - 2.5));
    let mut text = format!(
        "format = 1\nname = \"{suite}-{seed}\"\n[map]\nknown = false\nbounds_m = [0, 0, {SIDE}, {SIDE}]\n"
    );
    let mut stands = 0;
    while stands < count {
        let centre = Point2::new(uniform(0.0, SIDE), uniform(0.0, SIDE));
        let size = uniform(0.2, 1.0);
        let (kind, turn, other) = (
            uniform(0.0, 1.0),
            uniform(0.0, std::f64::consts::TAU),
            uniform(0.2, 1.0),
        );
        let reach = 1.5 * size.max(other);
        let is_clear = |end: Point2| (centre - end).norm() > reach + 2.2;
        if !(is_clear(start) && is_clear(goal)) {
            continue;
        }
        stands += 1;
        let (x, y) = (centre.x, centre.y);
        let shape = if kind < 0.4 {
            format!("[[map.disc]]\ncenter_m = [{x}, {y}]\nradius_m = {size}\n")
        } else if kind < 0.7 {
            format!(
                "[[map.box]]\nmin_m = [{}, {}]\nmax_m = [{}, {}]\n",
                x - size,
                y - other,
                x + size,
                y + other
            )
        } else {
            let corner = |i: f64| {
                let p = centre + turned(turn + std::f64::consts::TAU * i / 3.0) * 1.3 * size;
                format!("[{}, {}]", p.x, p.y)
            };
            format!(
                "[[map.polygon]]\nvertices_m = [{}, {}, {}]\n",
                corner(0.0),
                corner(1.0),
                corner(2.0)
            )
        };
        text.push_str(&shape);
    }
    let _ = write!(
        text,
        "[start]\nx_m = {}\ny_m = {}\nheading_deg = 45\n[goal]\nx_m = {}\ny_m = {}\n\
         [planner]\nscale_m = 0.5\n[bike]\nmode = \"{mode}\"\n{NOISE}[run]\nduration_s = 300\nseed = {seed}\n",
        start.x, start.y, goal.x, goal.y
    );
    Case {
        suite: suite.to_owned(),
        seed,
        text,
        has_surprise,
        two_sides_of: None,
    }
}

/// A ride across a map file, at a scale, between two places of it where the bike fits with room to spare; `None` if the seed finds none.
#[must_use]
pub fn on_map(suite: &str, file: &str, scale: f64, seed: u64, read: Read<'_>) -> Option<Case> {
    let head = format!(
        "format = 1\nname = \"{suite}-{seed}\"\n[map]\nknown = false\nfile = \"{file}\"\nscale = {scale}\n"
    );
    let ends = |x: f64, y: f64, heading: f64, goal: Point2| {
        format!(
            "[start]\nx_m = {x}\ny_m = {y}\nheading_deg = {heading}\n[goal]\nx_m = {}\ny_m = {}\n",
            goal.x, goal.y
        )
    };
    let mode = MODES[(seed % 2) as usize];
    let tail = format!(
        "[planner]\nscale_m = 0.5\n[bike]\nmode = \"{mode}\"\n{NOISE}[run]\nduration_s = 300\nseed = {seed}\n"
    );
    // Any ends, to have the world.
    let any = format!("{head}{}{tail}", ends(0.0, 0.0, 0.0, Point2::origin()));
    let setup = resolve(&any, read).ok()?;
    let world = setup.world.as_ref()?;
    let (bounds, outline) = (world.bounds(), setup.footprint.grown(0.4));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut place = || {
        let x = bounds.min.x + bounds.width() * unit(&mut rng);
        let y = bounds.min.y + bounds.height() * unit(&mut rng);
        Pose2::new(x, y, std::f64::consts::TAU * (unit(&mut rng) - 0.5))
    };
    let mut free = |from: Option<Point2>| {
        (0..TRIES).find_map(|_| {
            let pose = place();
            let is_far = from.is_none_or(|from| (pose.position - from).norm() > APART);
            (is_far && !world.overlaps(&outline, &pose)).then_some(pose)
        })
    };
    let start = free(None)?;
    let goal = free(Some(start.position))?;
    let p = start.position;
    let text = format!(
        "{head}{}{tail}",
        ends(p.x, p.y, start.heading.to_degrees(), goal.position)
    );
    Some(Case {
        suite: suite.to_owned(),
        seed,
        text,
        has_surprise: false,
        two_sides_of: None,
    })
}

/// A corridor along x that is its own mirror image, with a block in its middle; size and place of the block come from the seed.
#[must_use]
pub fn corridor(suite: &str, seed: u64, mode: &str) -> Case {
    const LENGTH: f64 = 26.0;
    const MIDDLE: f64 = 5.0;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = |from: f64, to: f64| from + (to - from) * unit(&mut rng);
    let x = uniform(10.0, 14.0);
    let (half_length, half_width) = (uniform(0.3, 1.5), uniform(0.3, 1.2));
    // Noise moves the edges of the block, and with them what is the shorter way: three times as much of it as elsewhere.
    let noise = NOISE.replace("range_sigma_m = 0.01", "range_sigma_m = 0.03");
    let (from, to) = (MIDDLE - half_width, MIDDLE + half_width);
    let text = format!(
        "format = 1\nname = \"{suite}-{seed}\"\n[map]\nknown = false\nbounds_m = [0, 0, {LENGTH}, {}]\n\
         [[map.box]]\nmin_m = [{}, {from}]\nmax_m = [{}, {to}]\n\
         [start]\nx_m = 2\ny_m = {MIDDLE}\nheading_deg = 0\n[goal]\nx_m = {}\ny_m = {MIDDLE}\n\
         [planner]\nscale_m = 0.5\n[bike]\nmode = \"{mode}\"\n{noise}[run]\nduration_s = 120\nseed = {seed}\n",
        2.0 * MIDDLE,
        x - half_length,
        x + half_length,
        LENGTH - 2.5,
    );
    Case {
        suite: suite.to_owned(),
        seed,
        text,
        has_surprise: false,
        two_sides_of: Some(Point2::new(x, MIDDLE)),
    }
}

/// The next number of [0, 1).
pub(super) fn unit(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
}

fn turned(angle: f64) -> Vector2 {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos, sin)
}
