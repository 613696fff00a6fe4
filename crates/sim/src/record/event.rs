//! The vocabulary of a run: what can happen, in plain numbers.
//!
//! SI units and radians; the names of the sampled quantities carry their unit
//! and are the same in [`Trace`](super::Trace), on the wire and in Python. A
//! quantity that does not apply to a plant or controller is NaN, so samples are
//! best written as `StateSample { roll_rad: …, ..Default::default() }`.
//!
//! Frames: world x east, y north, z up; the bike's frame `base_link` sits at the
//! rear contact, x forward, y left, and is rolled about x (positive to the right).

use super::columns::{Column, sampled};
use crate::clock::SimTime;
use crate::online::Searched;
use bikebot_geometry::CurvePath;
use bikebot_world::{OccupancyGrid, World};

/// One thing that happened, borrowed from whoever saw it happen.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a> {
    /// What the bike looks like; once, before the first state.
    Bike(&'a BikeGeometry),
    /// What stands where, as known at this moment.
    Map(MapEvent<'a>),
    /// A path was planned, or planned anew.
    Plan(PlanEvent<'a>),
    /// The curve the follower was given, with the speed it means to keep.
    FollowedPath(&'a [PathSample]),
    /// The true state. Frames, pose, joints and footprint are drawn from it, so
    /// it comes first among the events of a tick.
    State(&'a StateSample),
    /// What the controller measured, wanted and asked for.
    Control(&'a ControlSample),
    /// One sweep of the laser.
    Scan(ScanSample<'a>),
    /// What the bike has found out about its field so far: free, occupied, unknown. Written as a whole, at its own rate.
    Belief(&'a OccupancyGrid),
    /// What the navigator has said, at each tick of a ride on what the laser shows. For whoever measures it; recordings leave it out.
    Order(OrderSample<'a>),
    /// Where the moving obstacles are now: all of them, in a fixed order.
    MovingObstacles(&'a [Shape]),
    /// A line for people.
    Log {
        /// How grave.
        level: LogLevel,
        /// One line, no terminator.
        text: &'a str,
    },
    /// Something a program may want to find: `/events`.
    Notice {
        /// Of the closed list.
        kind: NoticeKind,
        /// One line for people.
        text: &'a str,
        /// The number that goes with it in SI units; NaN if there is none.
        value: f64,
    },
    /// A file that belongs to the run, such as the plan (`plan.json`).
    Attachment {
        /// Its name inside the recording.
        name: &'a str,
        /// Its media type, such as `application/json`.
        media_type: &'a str,
        /// Its content.
        data: &'a [u8],
    },
}

/// The shape of the bike, as far as pictures need it.
#[derive(Debug, Clone, PartialEq)]
pub struct BikeGeometry {
    /// Rear contact to front contact `w`, m.
    pub wheelbase: f64,
    /// Wheel radius, m.
    pub wheel_radius: f64,
    /// Balancer pivot ahead of the rear contact `x2`, m.
    pub pivot_x: f64,
    /// Balancer pivot above the ground `l`, m.
    pub pivot_height: f64,
    /// Laser in `base_link`: x, y, z, m.
    pub laser_position: [f64; 3],
    /// Laser turned about z, rad, counter-clockwise positive.
    pub laser_yaw: f64,
    /// Laser then turned about its own y, rad: pointing down is positive.
    pub laser_pitch: f64,
    /// Whether the laser's mount turns against the bike's roll and keeps its beams level.
    pub laser_is_level: bool,
    /// Outline of the footprint in the bike's frame, m, closed by itself; see
    /// [`capsule_outline`](super::scene::capsule_outline).
    pub footprint: Vec<[f64; 2]>,
}

/// An order of the navigator, and what it was made from.
#[derive(Debug, Clone, Copy)]
pub struct OrderSample<'a> {
    /// Whether a scan came in since the order before.
    pub is_fresh: bool,
    /// Arc length of the rear contact on the path in force, m.
    pub s: f64,
    /// The path in force.
    pub path: Option<&'a CurvePath>,
    /// The optimistic world as of the last search.
    pub world: &'a World,
    /// The search for a path, where one was made.
    pub search: Option<Searched>,
    /// Time it took, s, by the clock lent to the run; NaN without one.
    pub took: f64,
}

/// What one cell of a map is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellState {
    /// Nothing there.
    Free,
    /// An obstacle.
    Occupied,
    /// Never seen.
    Unknown,
}

/// A shape on the ground, world frame, m.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A disc.
    Disc {
        /// Centre, m.
        center: [f64; 2],
        /// Radius, m.
        radius: f64,
    },
    /// A simple polygon.
    Polygon {
        /// Corners in order, m; the last joins the first.
        vertices: Vec<[f64; 2]>,
    },
    /// A box along the axes.
    Block {
        /// Lower left corner, m.
        min: [f64; 2],
        /// Upper right corner, m.
        max: [f64; 2],
    },
}

/// A grid of cells.
#[derive(Debug, Clone, Copy)]
pub struct GridSample<'a> {
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Side of a cell, m.
    pub resolution: f64,
    /// Lower left corner of the lower left cell, world frame, m.
    pub origin: [f64; 2],
    /// Rotation of the grid about that corner, rad, counter-clockwise.
    pub yaw: f64,
    /// `width * height` cells, row by row, the lowest row first.
    pub cells: &'a [CellState],
}

/// What stands where: shapes, a grid, or both.
///
/// Without a grid the shapes are rasterised for the picture.
#[derive(Debug, Clone, Copy)]
pub struct MapEvent<'a> {
    /// The field's lower left and upper right corner, m.
    pub bounds: [[f64; 2]; 2],
    /// Standing obstacles.
    pub shapes: &'a [Shape],
    /// The map's own grid, where it has one.
    pub grid: Option<GridSample<'a>>,
}

/// One point of a path; the heading is the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathSample {
    /// World frame, m.
    pub x: f64,
    /// World frame, m.
    pub y: f64,
    /// From +x, counter-clockwise, rad.
    pub heading: f64,
    /// Positive to the left, 1/m.
    pub curvature: f64,
    /// Arc length from the start of the path, m.
    pub s: f64,
    /// Speed meant to be kept here, m/s; NaN where the path carries none.
    pub speed: f64,
}

/// Where a plan was to end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalSample {
    /// World frame, m.
    pub position: [f64; 2],
    /// Heading asked for, rad; `None` where any will do.
    pub heading: Option<f64>,
    /// How near counts as there, m.
    pub tolerance: f64,
}

/// A plan and what led to it. A stage that a method does not have is empty.
#[derive(Debug, Clone, Copy)]
pub struct PlanEvent<'a> {
    /// The path of the rear contact, dense enough to draw; empty if none was found.
    pub path: &'a [PathSample],
    /// Edges of the search tree as short straight pieces, m.
    pub tree: &'a [[[f64; 2]; 2]],
    /// The first collision-free polyline, m.
    pub coarse: &'a [[f64; 2]],
    /// The polyline that guides the last stage, m.
    pub guide: &'a [[f64; 2]],
    /// Half width of the corridor round the guide, m.
    pub corridor_half_width: Option<f64>,
    /// Where it was to end.
    pub goal: Option<GoalSample>,
}

/// One sweep of the laser, in the laser's own frame. The event comes when the scan is handed out.
#[derive(Debug, Clone, Copy)]
pub struct ScanSample<'a> {
    /// The middle of the sweep: drawn from where the laser was then, the beams of a moving bike are nearest to where they
    /// were.
    pub stamp: SimTime,
    /// Bearing of the first beam, rad, counter-clockwise from the laser's x.
    pub start_angle: f64,
    /// Bearing from one beam to the next, rad.
    pub angle_step: f64,
    /// Distances, m; infinite where nothing came back.
    pub ranges: &'a [f64],
}

/// How grave a line of the log is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// For those who build the machine.
    Debug,
    /// Worth knowing.
    Info,
    /// Went on, but look at it.
    Warning,
    /// Something was lost.
    Error,
}

/// What the follower is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, foxglove::Encode)]
pub enum RidePhase {
    /// Getting up to speed.
    #[default]
    Start,
    /// Following the path.
    Cruise,
    /// Slowing for the end of the path.
    Brake,
    /// At rest, balancing.
    Hold,
}

/// What a [`Event::Notice`] is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoticeKind {
    /// The footprint touched an obstacle; value: clearance, m.
    Collision,
    /// The goal was reached; value: distance to it, m.
    GoalReached,
    /// The bike fell; value: roll, rad.
    Fell,
    /// Friction use above one; value: the use.
    Slip,
    /// A wheel left the ground; value: its load, N.
    WheelLift,
    /// An actuator reached its limit; value: what was asked for, in its unit.
    Saturated,
    /// Stored energy rose beyond what was supplied; value: by how much, J.
    Passivity,
    /// The decoupling term came near zero; value: its ratio to the upright one.
    Decoupling,
    /// The balancer changed mode; value: the offset aimed at, m.
    ModeChange,
    /// A new path was planned; value: its length, m.
    Replanned,
    /// No path was found.
    NoPath,
    /// A push, slope or fault came or went; value: its size, in its unit.
    Disturbance,
    /// The state was no longer a number.
    NonFinite,
    /// The controller gave up; the reason is in the text.
    ControlFailed,
    /// Time ran out; value: the limit, s.
    TimedOut,
    /// Someone stopped the run.
    Interrupted,
    /// A margin ran out, or is wide open again, and the controller acts on it; value: the share of it in use.
    Supervisor,
    /// No way on is known: the bike brakes, or stands; value: arc length at which it is to stand, m.
    Halted,
    /// There is a way on again; value: arc length of the bike, m.
    Resumed,
    /// What was believed free is so no more, within the stopping distance; value: way to it, m.
    Emergency,
    /// The bike goes before something that moves; value: time until that may be there, s.
    Pass,
    /// The bike slows down or waits for something that moves; value: time until they would have met, s.
    Yield,
    /// Something that moves came so near that the bike cannot stop before it, and brakes as hard as it can; value: time to contact, s.
    Unavoidable,
}

impl NoticeKind {
    /// Every kind, in the order of the list.
    pub const ALL: [Self; 23] = [
        Self::Collision,
        Self::GoalReached,
        Self::Fell,
        Self::Slip,
        Self::WheelLift,
        Self::Saturated,
        Self::Passivity,
        Self::Decoupling,
        Self::ModeChange,
        Self::Replanned,
        Self::NoPath,
        Self::Disturbance,
        Self::NonFinite,
        Self::ControlFailed,
        Self::TimedOut,
        Self::Interrupted,
        Self::Supervisor,
        Self::Halted,
        Self::Resumed,
        Self::Emergency,
        Self::Pass,
        Self::Yield,
        Self::Unavoidable,
    ];

    /// The name on the wire.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Collision => "collision",
            Self::GoalReached => "goal_reached",
            Self::Fell => "fell",
            Self::Slip => "slip",
            Self::WheelLift => "wheel_lift",
            Self::Saturated => "saturated",
            Self::Passivity => "passivity",
            Self::Decoupling => "decoupling",
            Self::ModeChange => "mode_change",
            Self::Replanned => "replanned",
            Self::NoPath => "no_path",
            Self::Disturbance => "disturbance",
            Self::NonFinite => "non_finite",
            Self::ControlFailed => "control_failed",
            Self::TimedOut => "timed_out",
            Self::Interrupted => "interrupted",
            Self::Supervisor => "supervisor",
            Self::Halted => "halted",
            Self::Resumed => "resumed",
            Self::Emergency => "emergency",
            Self::Pass => "pass",
            Self::Yield => "yield",
            Self::Unavoidable => "unavoidable",
        }
    }
}

sampled! {
    /// The true state of the bike at one control tick, with the forces on it.
    ///
    /// Sent on `/bike/state`.
    pub struct StateSample as BikeState in StateColumns {
        /// Rear contact, world frame, m.
        x_m: f64,
        /// Rear contact, world frame, m.
        y_m: f64,
        /// Heading `theta` from +x, counter-clockwise, rad.
        heading_rad: f64,
        /// Ground-projected steering angle `psi`, positive to the left, rad.
        steer_rad: f64,
        /// Roll `alpha`, positive to the right, rad.
        roll_rad: f64,
        /// Balancer angle `beta` from the body, same sense as roll, rad.
        balancer_rad: f64,
        /// Speed of the rear contact along the heading, m/s.
        speed_mps: f64,
        /// Rate of the heading, rad/s.
        yaw_rate_radps: f64,
        /// Rate of roll, rad/s.
        roll_rate_radps: f64,
        /// Rate of the balancer from the body, rad/s.
        balancer_rate_radps: f64,
        /// Rate of the steering angle, rad/s.
        steer_rate_radps: f64,
        /// Rate of speed, m/s².
        acceleration_mps2: f64,
        /// Rate of the yaw rate, rad/s².
        yaw_acceleration_radps2: f64,
        /// Rate of the roll rate, rad/s².
        roll_acceleration_radps2: f64,
        /// Rate of the balancer rate, rad/s².
        balancer_acceleration_radps2: f64,
        /// Curvature of the rear contact's path, positive to the left, 1/m.
        curvature_per_m: f64,
        /// Way of the rear contact since the start, m.
        distance_m: f64,
        /// Balancer offset `d`, m.
        balancer_offset_m: f64,
        /// Drive force at the rear wheel as it acts, N.
        drive_force_n: f64,
        /// Balancer torque as it acts, N m.
        balancer_torque_nm: f64,
        /// Outside moment about the roll axis, N m.
        roll_moment_nm: f64,
        /// Outside force along the heading (slope, wind), N.
        slope_force_n: f64,
        /// Side force at the rear contact, positive to the left, N.
        rear_lateral_force_n: f64,
        /// Force at the front contact normal to the wheel, positive to the left, N.
        front_lateral_force_n: f64,
        /// Load of the rear wheel, N.
        rear_load_n: f64,
        /// Load of the front wheel, N.
        front_load_n: f64,
        /// Friction used at the rear wheel; one is the limit.
        friction_use_rear: f64,
        /// Friction used at the front wheel; one is the limit.
        friction_use_front: f64,
        /// Mechanical energy of the bike, J.
        energy_j: f64,
        /// Footprint to the nearest true obstacle, negative inside it, m.
        clearance_m: f64,
    }
}

sampled! {
    /// What the controller measured, wanted and asked for at one tick.
    ///
    /// Sent on `/control/debug`.
    pub struct ControlSample as ControlDebug in ControlColumns {
        /// Drive force asked for, N.
        drive_force_command_n: f64,
        /// Steering rate asked for, rad/s.
        steer_rate_command_radps: f64,
        /// Balancer torque asked for, N m.
        balancer_torque_command_nm: f64,
        /// Balancer offset asked for, m.
        balancer_offset_command_m: f64,
        /// The drive force was cut to its limit.
        drive_saturated: bool,
        /// The steering rate or angle was cut to its limit.
        steer_saturated: bool,
        /// The balancer torque was cut, or the balancer is at its top speed.
        balancer_saturated: bool,
        /// The fallback law ruled instead of the designed one.
        fallback: bool,
        /// What the follower is doing.
        phase: RidePhase,
        /// The point of the bike that follows the curve, world frame, m.
        followed_x_m: f64,
        /// The point of the bike that follows the curve, world frame, m.
        followed_y_m: f64,
        /// Where on the curve it should be, world frame, m.
        desired_x_m: f64,
        /// Where on the curve it should be, world frame, m.
        desired_y_m: f64,
        /// Arc length of that place (the virtual time), m.
        path_s_m: f64,
        /// Curvature of the curve there, 1/m.
        path_curvature_per_m: f64,
        /// Speed the curve asks for there, m/s.
        speed_reference_mps: f64,
        /// Lean the coming curve asks for, rad.
        roll_reference_rad: f64,
        /// Followed point from the curve, positive to its left, m.
        lateral_error_m: f64,
        /// Rear contact from the planned path, positive to its left, m.
        rear_error_m: f64,
        /// Speed less what the curve asks for, m/s.
        speed_error_mps: f64,
        /// The output that the balance law drives to zero, kg m²/s.
        balance_output: f64,
        /// Decoupling term over its value upright.
        decoupling_ratio: f64,
        /// Outside roll moment as the observer believes it, N m.
        roll_moment_estimate_nm: f64,
        /// Outside drive force as the observer believes it, N.
        drive_force_estimate_n: f64,
        /// Energy stored in the augmented system, J.
        stored_energy_j: f64,
        /// Power supplied to it from outside, W.
        supplied_power_w: f64,
        /// Power its regulator puts in, W.
        regulator_power_w: f64,
        /// How far the integrator alone may raise the stored energy in a tick, J.
        energy_bound_j: f64,
        /// Content of the tank that pays for the regulator, J; zero without a tank.
        energy_tank_j: f64,
        /// Rise of stored energy beyond all that, J; positive is a violation.
        passivity_excess_j: f64,
        /// Measured rear contact, world frame, m.
        measured_x_m: f64,
        /// Measured rear contact, world frame, m.
        measured_y_m: f64,
        /// Measured heading, rad.
        measured_heading_rad: f64,
        /// Measured speed, m/s.
        measured_speed_mps: f64,
        /// Measured steering angle, rad.
        measured_steer_rad: f64,
        /// Measured roll, rad.
        measured_roll_rad: f64,
        /// Measured rate of roll, rad/s.
        measured_roll_rate_radps: f64,
        /// Measured balancer angle, rad.
        measured_balancer_rad: f64,
        /// Measured balancer rate, rad/s.
        measured_balancer_rate_radps: f64,
    }
}

impl Column for RidePhase {
    const ABSENT: Self = Self::Start;

    fn number(self) -> f64 {
        f64::from(self as u8)
    }
}
