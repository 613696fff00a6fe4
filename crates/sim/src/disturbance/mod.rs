//! What the world does to the true bike: pushes, moments, slopes, gusts, slippery ground.
//!
//! [`Disturbances::at`] answers with the [`Loads`] on the bike over one integration step; any plant can take
//! them. What breaks *on* the bike is in [`motor_faults`] and [`sensor_faults`]. Nothing of all this reaches
//! the controller but through the sensors.

pub mod motor_faults;
pub mod sensor_faults;

pub use motor_faults::MotorFaults;
pub use sensor_faults::SensorFaults;

use crate::scenario::disturbance::{
    Disturbance, FaultIs, FaultOf, FaultSection, FrictionSection, GustProfile, When,
};
use bikebot_dynamics::constants::GRAVITY;
use bikebot_dynamics::{BikeInput, BikeParams, BikeState, Push};
use bikebot_geometry::Point2;

/// What acts on the bike from outside during one integration step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loads {
    /// Pure roll moment, N m, positive to the right.
    pub roll_moment: f64,
    /// Rise over run of the ground along the heading, positive uphill.
    pub grade: f64,
    /// Level forces on points of the frame.
    pub push: Push,
    /// Friction of the ground under the rear and the front wheel.
    pub friction: [f64; 2],
}

impl Loads {
    /// Pull of the slope on a bike of `mass` (kg) along its heading, N, negative uphill: `−m g sin(atan grade)`.
    #[must_use]
    pub fn slope_force(&self, mass: f64) -> f64 {
        -mass * GRAVITY * self.grade / self.grade.hypot(1.0)
    }

    /// The same bike input with these loads on a bike of `mass` (kg).
    #[must_use]
    pub fn on(&self, input: BikeInput, mass: f64) -> BikeInput {
        BikeInput {
            roll_moment: self.roll_moment,
            slope_force: self.slope_force(mass),
            push: self.push,
            ..input
        }
    }
}

/// A disturbance of the scenario and how far it has come.
#[derive(Debug, Clone)]
struct Entry {
    what: Disturbance,
    when: When,
    /// When it began, s; known beforehand unless it waits for a place.
    began: Option<f64>,
    /// When it ends, s; infinite while nobody knows.
    ends: f64,
    told: Told,
}

/// How much of an entry has been told as events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Told {
    Nothing,
    Begin,
    End,
}

impl Entry {
    fn new(what: &Disturbance) -> Self {
        let when = what.when();
        let began = match (when.time, when.from_s) {
            (Some(time), _) => Some(time),
            (None, Some(_)) => None,
            (None, None) => Some(0.0),
        };
        Self {
            what: what.clone(),
            when,
            began,
            ends: end(began, when.duration),
            told: Told::Nothing,
        }
    }

    /// Notes a place that has been passed at time `t` (s).
    fn pass(&mut self, t: f64, progress: f64) {
        if self.began.is_none() && self.when.from_s.is_some_and(|from| progress >= from) {
            self.began = Some(t);
            self.ends = end(self.began, self.when.duration);
        }
        if self.began.is_some() && self.when.to_s.is_some_and(|to| progress > to) {
            self.ends = self.ends.min(t);
        }
    }

    /// Acts at time `t` (s).
    fn is_active(&self, t: f64) -> bool {
        self.began
            .is_some_and(|began| t + SLACK >= began && t + SLACK < self.ends)
    }

    /// Share of the step from `t` to `t + dt` (s) in which it acts: no step length changes an impulse.
    fn share(&self, t: f64, dt: f64) -> f64 {
        let Some(began) = self.began else {
            return 0.0;
        };
        ((self.ends.min(t + dt) - began.max(t)) / dt).clamp(0.0, 1.0)
    }
}

fn end(began: Option<f64>, duration: Option<f64>) -> f64 {
    match (began, duration) {
        (Some(began), Some(duration)) => began + duration,
        _ => f64::INFINITY,
    }
}

/// Slack when comparing times, s: far below any step, far above the rounding of `k · dt`.
const SLACK: f64 = 1e-9;

/// A disturbance that came or went.
#[derive(Debug, Clone, PartialEq)]
pub struct Turn {
    /// One line for people.
    pub text: String,
    /// Its size in its own unit; zero when it ends.
    pub size: f64,
}

/// All disturbances of a scenario, on one true bike.
#[derive(Debug, Clone)]
pub struct Disturbances {
    entries: Vec<Entry>,
    /// Where the centre of gravity lies ahead of the rear contact, m.
    centre: f64,
    wheelbase: f64,
    friction: f64,
}

impl Disturbances {
    /// The disturbances of a scenario on a true bike.
    #[must_use]
    pub fn new(sections: &[Disturbance], bike: &BikeParams) -> Self {
        Self {
            entries: sections.iter().map(Entry::new).collect(),
            centre: (bike.m1 * bike.x1 + bike.m2 * bike.x2) / bike.mass(),
            wheelbase: bike.wheelbase,
            friction: bike.friction,
        }
    }

    /// To be told at each control tick: the time (s), and how far the rear contact has come along the path (m).
    /// What has come or gone since the last tick is handed to `tell`.
    pub fn advance(&mut self, t: f64, progress: f64, mut tell: impl FnMut(Turn)) {
        for entry in &mut self.entries {
            entry.pass(t, progress);
            let begun = entry.began.is_some_and(|began| t + SLACK >= began);
            if begun && entry.told == Told::Nothing {
                entry.told = Told::Begin;
                tell(Turn {
                    text: format!("{} begins", entry.what.words()),
                    size: entry.what.size(),
                });
            }
            if t + SLACK >= entry.ends && entry.told == Told::Begin {
                entry.told = Told::End;
                tell(Turn {
                    text: format!("{} ends", entry.what.words()),
                    size: 0.0,
                });
            }
        }
    }

    /// What acts on the bike from `t` to `t + dt` (s), averaged over the step, while it is in `state`.
    #[must_use]
    pub fn at(&self, t: f64, dt: f64, state: &BikeState) -> Loads {
        let mut loads = Loads {
            roll_moment: 0.0,
            grade: 0.0,
            push: Push::default(),
            friction: [self.friction; 2],
        };
        for entry in &self.entries {
            let share = entry.share(t, dt);
            if share == 0.0 {
                continue;
            }
            match &entry.what {
                Disturbance::Push(push) => {
                    let direction = push.direction_deg.to_radians();
                    loads.push = loads.push
                        + self.force(share * push.force(), direction, push.ahead_m, push.height_m);
                }
                Disturbance::Gust(gust) => {
                    let force = match gust.profile {
                        GustProfile::Constant => share * gust.force_n,
                        GustProfile::OneMinusCosine => gust.force_n * swell(entry, t, dt),
                    };
                    // The wind keeps its direction while the bike turns.
                    let direction = gust.direction_deg.to_radians() - state.pose.heading;
                    loads.push =
                        loads.push + self.force(force, direction, gust.ahead_m, gust.height_m);
                }
                Disturbance::Moment(moment) => loads.roll_moment += share * moment.moment_nm,
                Disturbance::Slope(slope) => loads.grade += share * slope.grade,
                Disturbance::Friction(patch) => self.roughen(&mut loads.friction, patch, state),
                Disturbance::Fault(_) => {}
            }
        }
        loads
    }

    /// The faults that act at time `t` (s), each with its number among the disturbances.
    pub fn faults(&self, t: f64) -> impl Iterator<Item = (usize, &FaultSection)> {
        self.entries
            .iter()
            .enumerate()
            .filter(move |(_, entry)| entry.is_active(t))
            .filter_map(|(index, entry)| match &entry.what {
                Disturbance::Fault(fault) => Some((index, fault)),
                _ => None,
            })
    }

    /// A fault of this kind acts at time `t` (s) on this part.
    #[must_use]
    pub fn has_fault(&self, t: f64, of: FaultOf, is: FaultIs) -> bool {
        self.faults(t)
            .any(|(_, fault)| fault.of == of && fault.is == is)
    }

    fn force(&self, force: f64, direction: f64, ahead: Option<f64>, height: f64) -> Push {
        let (sin, cos) = direction.sin_cos();
        Push::at(
            force * cos,
            force * sin,
            ahead.unwrap_or(self.centre),
            height,
        )
    }

    /// The last patch that a wheel stands on decides.
    fn roughen(&self, friction: &mut [f64; 2], patch: &FrictionSection, state: &BikeState) {
        let rear = state.pose.position;
        let front = rear + state.pose.direction() * self.wheelbase;
        for (friction, wheel) in friction.iter_mut().zip([rear, front]) {
            if patch.region_m.is_none_or(|region| is_inside(region, wheel)) {
                *friction = patch.friction;
            }
        }
    }
}

fn is_inside([x0, y0, x1, y1]: [f64; 4], point: Point2) -> bool {
    (x0..=x1).contains(&point.x) && (y0..=y1).contains(&point.y)
}

/// Mean over the step of `(1 − cos 2πu)/2`, u the elapsed share of the gust: its integral is exact.
fn swell(entry: &Entry, t: f64, dt: f64) -> f64 {
    use std::f64::consts::TAU;
    let (Some(began), Some(length)) = (entry.began, entry.when.duration) else {
        return 1.0;
    };
    let integral = |t: f64| {
        let u = ((t - began) / length).clamp(0.0, 1.0);
        0.5 * length * (u - (TAU * u).sin() / TAU)
    };
    (integral(t + dt) - integral(t)) / dt
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::disturbance::{GustSection, MomentSection, PushSection, SlopeSection};
    use bikebot_geometry::Pose2;

    const DT: f64 = 0.0025;

    fn on_default(sections: &[Disturbance]) -> Disturbances {
        Disturbances::new(sections, &BikeParams::default())
    }

    fn rolling(heading: f64) -> BikeState {
        BikeState::upright(Pose2::new(0.0, 0.0, heading), 1.0)
    }

    /// Sum of the left component of the force over `seconds`, N s.
    fn impulse(disturbances: &Disturbances, seconds: f64, dt: f64) -> f64 {
        let steps = (seconds / dt).round() as usize;
        (0..steps)
            .map(|i| dt * disturbances.at(i as f64 * dt, dt, &rolling(0.0)).push.left)
            .sum()
    }

    #[test]
    fn a_push_brings_its_impulse_whatever_the_step() {
        let push = Disturbance::Push(PushSection {
            impulse_ns: Some(20.0),
            time_s: Some(0.3333),
            ..PushSection::default()
        });
        for dt in [0.0025, 0.007, 0.05] {
            let found = impulse(&on_default(std::slice::from_ref(&push)), 2.0, dt);
            // To the right by default: negative on the left.
            assert!((found + 20.0).abs() < 1e-9, "{found}");
        }
    }

    #[test]
    fn a_gust_swells_to_its_force_and_brings_half_of_it_in_the_mean() {
        let gust = on_default(&[Disturbance::Gust(GustSection {
            force_n: 40.0,
            direction_deg: 90.0,
            time_s: Some(0.1),
            duration_s: Some(0.8),
            ..GustSection::default()
        })]);
        assert!((impulse(&gust, 1.0, DT) - 0.5 * 40.0 * 0.8).abs() < 1e-9);
        let middle = gust.at(0.5 - 0.5 * DT, DT, &rolling(0.0)).push.left;
        assert!((middle - 40.0).abs() < 0.01, "{middle}");
        // Wind from the right of the world is head wind for a bike that has turned to face it.
        let ahead = gust
            .at(0.5, DT, &rolling(-std::f64::consts::FRAC_PI_2))
            .push;
        assert!(ahead.forward < -39.0 && ahead.left.abs() < 1e-9);
    }

    #[test]
    fn a_slope_of_five_percent_pulls_with_a_twentieth_of_the_weight() {
        let slope = on_default(&[Disturbance::Slope(SlopeSection {
            grade: 0.05,
            ..SlopeSection::default()
        })]);
        let force = slope.at(0.0, DT, &rolling(0.0)).slope_force(50.0);
        // m g sin(atan 0.05): 0.12 % below a twentieth.
        assert!((force + 24.4944).abs() < 1e-3, "{force}");
    }

    #[test]
    fn what_waits_for_a_place_begins_there_and_ends_there() {
        let mut stretch = on_default(&[Disturbance::Moment(MomentSection {
            moment_nm: 5.0,
            from_s_m: Some(2.0),
            to_s_m: Some(3.0),
            ..MomentSection::default()
        })]);
        let mut told = Vec::new();
        let mut moments = Vec::new();
        for tick in 0..50 {
            let t = f64::from(tick) * 0.1;
            stretch.advance(t, t, |turn| told.push((tick, turn.size)));
            moments.push(stretch.at(t, DT, &rolling(0.0)).roll_moment);
        }
        assert_eq!(told, [(20, 5.0), (31, 0.0)]);
        assert_eq!(moments.iter().position(|moment| *moment > 0.0), Some(20));
        assert_eq!(moments.iter().filter(|moment| **moment > 0.0).count(), 11);
    }

    #[test]
    fn a_patch_is_felt_by_the_wheel_that_stands_on_it() {
        let patch = on_default(&[Disturbance::Friction(FrictionSection {
            friction: 0.05,
            region_m: Some([0.5, -1.0, 2.0, 1.0]),
            ..FrictionSection::default()
        })]);
        // Rear contact at the origin, front contact at 1.12 m.
        assert_eq!(patch.at(0.0, DT, &rolling(0.0)).friction, [0.7, 0.05]);
        assert_eq!(patch.at(0.0, DT, &rolling(3.0)).friction, [0.7, 0.7]);
    }

    #[test]
    fn without_disturbances_there_are_no_loads() {
        let loads = on_default(&[]).at(0.0, DT, &rolling(0.3));
        let input = BikeInput {
            drive_force: 3.0,
            ..BikeInput::default()
        };
        assert_eq!(
            loads.on(input, 50.0),
            BikeInput {
                slope_force: -0.0,
                ..input
            }
        );
    }
}
