//! Where something that moves may be in a while.

use bikebot_geometry::{Point2, Vector2};
use bikebot_mapping::Track;

use super::params::GivingWayParams;

/// How much may be wrong with what is foreseen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Doubt {
    /// Standard deviations.
    pub sigmas: f64,
    /// m.
    pub clearance: f64,
    /// m/s².
    pub acceleration: f64,
    /// m/s.
    pub fastest: f64,
    /// Beyond this lead time doubt grows no more, s: by then the bike has looked again, and could still stop.
    pub lasts: f64,
}

impl Doubt {
    /// What the scenario asks for, for `lasts` s.
    pub fn announced(params: &GivingWayParams, lasts: f64) -> Self {
        Self {
            lasts,
            sigmas: params.sigmas,
            clearance: params.clearance,
            acceleration: params.acceleration,
            fastest: params.fastest,
        }
    }

    /// The least there is: it goes straight on, and is believed where it was seen.
    pub fn least(params: &GivingWayParams) -> Self {
        /// m.
        const TOUCH: f64 = 0.05;
        Self {
            sigmas: 0.5 * params.sigmas.min(2.0),
            clearance: TOUCH.min(params.clearance),
            acceleration: 0.0,
            fastest: params.fastest,
            lasts: 0.0,
        }
    }
}

/// Something that moves: within the lead time `h` it is somewhere in the disc about `p + v h` with the radius `a + b h + c h²`, and in the
/// one about `p` with the radius `a + v_max h`. The first grows for a while only.
///
/// The filter's standard deviation √(P_pp + 2 P_pv h + P_vv h²) is not above σ_p + σ_v h, so the first disc holds all that the
/// filter would draw.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mover {
    pub id: u64,
    position: Point2,
    velocity: Vector2,
    base: f64,
    growth: f64,
    bend: f64,
    fastest: f64,
    lasts: f64,
}

impl Mover {
    /// What `track` is at `now` (s).
    pub fn of(track: &Track, now: f64, doubt: &Doubt) -> Self {
        let age = (now - track.time()).max(0.0);
        let speed = track.velocity().norm();
        let velocity = track.velocity() * (doubt.fastest / speed.max(doubt.fastest));
        let drift = doubt.sigmas * track.velocity_sigma();
        let bend = 0.5 * doubt.acceleration;
        Self {
            id: track.id(),
            position: track.position() + velocity * age,
            velocity,
            base: track.radius()
                + doubt.clearance
                + doubt.sigmas * track.position_sigma()
                + drift * age
                + bend * age * age,
            growth: drift + 2.0 * bend * age,
            bend,
            fastest: doubt.fastest,
            lasts: doubt.lasts,
        }
    }

    /// Whether it is certainly not at places that are `gap(point)` (m) from a point, at any lead time from `early` to `late` (s).
    pub fn is_clear_of(&self, gap: impl Fn(Point2) -> f64, early: f64, late: f64) -> bool {
        let (middle, half) = (0.5 * (early + late), 0.5 * (late - early));
        let doubted = late.min(self.lasts);
        let within = self.base + (self.growth + self.bend * doubted) * doubted;
        // In between it moves no farther from the middle than at its speed.
        gap(self.position + self.velocity * middle) > within + half * self.velocity.norm()
            || gap(self.position) > self.base + self.fastest * late
    }

    #[cfg(test)]
    pub fn straight(
        id: u64,
        position: Point2,
        velocity: Vector2,
        [base, growth, bend]: [f64; 3],
    ) -> Self {
        Self {
            id,
            position,
            velocity,
            base,
            growth,
            bend,
            fastest: f64::INFINITY,
            lasts: f64::INFINITY,
        }
    }

    #[cfg(test)]
    pub fn no_faster_than(self, fastest: f64) -> Self {
        Self { fastest, ..self }
    }

    /// Centre and radius of the disc at a lead time (s), m.
    #[cfg(test)]
    pub fn disc(&self, lead: f64) -> (Point2, f64) {
        (
            self.position + self.velocity * lead,
            self.base + self.growth * lead + self.bend * lead * lead,
        )
    }
}
