//! The shortest path of a disc, headings and curvature ignored: no path of the same problem is shorter.
//!
//! A disc of radius ρ moves like its centre among obstacles grown by ρ. Every convex corner becomes a circle of radius ρ, every disc
//! obstacle one of radius R + ρ, and a shortest path is made of arcs on these circles and of straight legs that touch two of
//! them: a graph whose nodes are circles with a sense of rotation, whose edges are their common tangents. For ρ = 0 the
//! circles are points, and the graph is that of visibility. A path may touch a corner only at normals between those of the
//! corner's two sides, so both the arcs and the tangents worth a look are few.
//!
//! The graph is never built. A* with the straight way to the goal as its estimate walks it from the start; the legs out of
//! an arc are found when a path first arrives there, ring by ring of distance, and what is wholly in the shadow of something
//! nearer is not looked at. Whether a leg is free is asked when it is the most promising one of all. Since the estimate never
//! overestimates and totals never fall, a search that is stopped has in hand a bound that holds: the total of the leg it was
//! about to look at.
//!
//! Positions that touch are no obstacle to the length: legs and arcs lie on the grown obstacles. Passages are: one that has less
//! than η = 10⁻⁸ of the largest coordinate to spare on either side is closed, so that nothing slips through the seam of two walls.
//! Legs and arcs are tested at ρ + η, and measured at ρ.

mod freedom;
mod graph;
mod search;
mod shadows;
mod tangent;
mod view;

use crate::budget::Meter;
use bikebot_geometry::Point2;
use bikebot_world::World;
use search::{End, Scales, Search};

/// η: what a passage must have to spare on either side, in parts of the largest coordinate.
const SPARE: f64 = 1e-8;
/// What rounding may take from that.
const ROUNDING: f64 = 1e-11;

/// What is known of the shortest path.
#[derive(Debug, Clone, PartialEq)]
pub struct Shortest {
    /// No path of the disc is shorter, m. Infinite if it is proved that there is none.
    pub length: f64,
    /// Whether there is a path of just this length (or arbitrarily close to it, where it touches obstacles).
    pub is_exact: bool,
    /// That path, if it is: its straight legs, and points on its arcs no more than 10° apart. Legs are free for the disc to
    /// rounding; the chords of arcs about a corner come nearer to it than ρ, by up to 0.4 % of ρ.
    pub path: Option<Vec<Point2>>,
}

impl Shortest {
    fn at_least(length: f64) -> Self {
        Self {
            length,
            is_exact: false,
            path: None,
        }
    }
}

/// The length of the shortest path of a disc of `radius` (m) from `start` to within `goal_tolerance` (m) of `goal`, or what is known of it when
/// the budget of `meter` ends: never less than the straight way, never more than the true infimum over paths that keep
/// more than `radius` from obstacles and from the edge of the field.
///
/// `upper` is the length (m) of a path known already. Nothing longer is looked at, which saves time; if
/// the known path turns out to be the shortest, its length is returned as the bound, without a path. Where nothing is known
/// and the search runs dry, there is no path: the length is infinite.
///
/// A start that is itself too near to something, or input that is not finite, yields the straight way and no claim.
#[must_use]
pub fn shortest(
    world: &World,
    radius: f64,
    start: Point2,
    goal: Point2,
    goal_tolerance: f64,
    upper: Option<f64>,
    meter: &mut Meter<'_>,
) -> Shortest {
    let usable = |x: f64| x.is_finite() && x >= 0.0;
    let straight = (goal - start).norm() - goal_tolerance;
    if !(usable(radius) && usable(goal_tolerance) && straight.is_finite()) {
        return Shortest::at_least(if straight > 0.0 && straight.is_finite() {
            straight
        } else {
            0.0
        });
    }
    let bounds = world.bounds();
    let largest = bounds.min.coords.amax().max(bounds.max.coords.amax());
    let scales = Scales {
        radius,
        spare: SPARE * largest,
        rounding: ROUNDING * largest,
    };
    if world.clearance(start) < radius - scales.rounding {
        return Shortest::at_least(straight.max(0.0));
    }
    if straight <= 0.0 {
        return Shortest {
            length: 0.0,
            is_exact: true,
            path: Some(vec![start]),
        };
    }
    let upper = upper.filter(|u| !u.is_nan()).unwrap_or(f64::INFINITY);
    let mut search = Search::new(world, scales, start, goal, goal_tolerance, upper);
    match search.run(meter) {
        End::Found { length, path } => Shortest {
            length,
            is_exact: true,
            path: Some(path),
        },
        End::Bound(length) => Shortest::at_least(length),
    }
}

#[cfg(test)]
mod tests;
