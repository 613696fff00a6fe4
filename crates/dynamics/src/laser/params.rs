//! The scanner's parameters, and where its mount cannot be.

use nalgebra::Point2;

use crate::error::DynamicsError;
use crate::params::BikeParams;

/// Half the width of a tyre as far as a laser is concerned, m: a city bicycle's.
const HALF_TYRE: f64 = 0.025;
/// Half the width of the frame as far as a laser is concerned, m: tubes, battery and motors.
const HALF_FRAME: f64 = 0.05;

/// What a scan says of a beam that gives no return.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Default,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum NoReturn {
    /// Infinity.
    #[default]
    Infinity,
    /// The largest range, as many devices do: only a shorter range is a return.
    RangeMax,
}

/// The scanner: its beams, its mount on the bike and its errors. The default is a scanner without errors,
/// 1081 beams over 270°, 30 m far, above the front wheel.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct LaserParams {
    /// Whether the bike carries a laser.
    pub enabled: bool,
    /// Number of beams of one scan.
    #[schemars(range(min = 1, max = 100_000))]
    pub beams: u32,
    /// Angle between the first and the last beam, degrees, half of it to either side.
    #[schemars(range(min = 0.0, max = 360.0))]
    pub fov_deg: f64,
    /// Least range, m: anything nearer gives no return.
    #[serde(rename = "range_min_m")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub range_min: f64,
    /// Largest range, m: anything farther gives no return.
    #[serde(rename = "range_max_m")]
    #[schemars(range(max = 10000.0), extend("exclusiveMinimum" = 0.0))]
    pub range_max: f64,
    /// Scans per second, Hz.
    #[serde(rename = "rate_hz")]
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub rate: f64,
    /// Whether the beams are fired one after another, over the part of the scan's period that their angle is of a full
    /// turn, while the bike moves on: a scan in a bend is bent. False: all at once.
    pub sweep: bool,
    /// How long after its last beam a scan is handed out, s.
    #[serde(rename = "latency_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub latency: f64,
    /// Mount ahead of the rear contact, m: above the front hub.
    #[serde(rename = "mount_x_m")]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub mount_x: f64,
    /// Mount to the left of the bike's plane of symmetry, m.
    #[serde(rename = "mount_y_m")]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub mount_y: f64,
    /// Height of the mount above the ground, m: it decides how far roll shifts the scan, and how far off a leaning beam
    /// meets the ground.
    #[serde(rename = "mount_z_m")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub mount_z: f64,
    /// Direction of the middle beam, degrees to the left of straight ahead.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub mount_yaw_deg: f64,
    /// How far the middle beam points down, degrees.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub mount_pitch_deg: f64,
    /// Whether the plane of the beams tilts with the bike; false for a mount that keeps it
    /// level. The mount shifts sideways either way.
    pub tilts_with_roll: bool,
    /// How high the obstacles of the map stand, m: beams above pass over them.
    #[serde(rename = "obstacle_height_m")]
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub obstacle_height: f64,
    /// Whether a beam that meets the ground returns its range; false for ground that swallows it.
    pub ground_returns: bool,
    /// What a scan says of a beam without a return: "infinity", or "`range_max`" as many devices do.
    pub no_return: NoReturn,
    /// Constant part of the range's standard deviation, m.
    #[serde(rename = "range_sigma_m")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub range_sigma: f64,
    /// Part of the range's standard deviation that grows with the range, m per m.
    #[serde(rename = "range_sigma_m_per_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range_sigma_per_range: f64,
    /// Probability that a beam gives no return although it hit something.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout_probability: f64,
}

impl Default for LaserParams {
    fn default() -> Self {
        Self {
            enabled: true,
            beams: 1081,
            fov_deg: 270.0,
            range_min: 0.1,
            range_max: 30.0,
            rate: 20.0,
            sweep: true,
            latency: 0.0,
            mount_x: 1.2,
            mount_y: 0.0,
            mount_z: 0.7,
            mount_yaw_deg: 0.0,
            mount_pitch_deg: 0.0,
            tilts_with_roll: true,
            obstacle_height: 2.0,
            ground_returns: true,
            no_return: NoReturn::Infinity,
            range_sigma: 0.0,
            range_sigma_per_range: 0.0,
            dropout_probability: 0.0,
        }
    }
}

impl LaserParams {
    /// Refuses a mount inside the bike itself. The outline planned with may well contain it.
    ///
    /// Wheels are discs as wide as their tyres. The frame is the triangle of the two hubs and the balancer's pivot, as wide
    /// as its tubes. What turns and swings (fork, balancer) is not looked at.
    ///
    /// # Errors
    ///
    /// [`DynamicsError::LaserInside`] names the part.
    pub fn check_mount(&self, bike: &BikeParams) -> Result<(), DynamicsError> {
        let at = Point2::new(self.mount_x, self.mount_z);
        let aside = self.mount_y.abs();
        let hub = |x: f64| Point2::new(x, bike.wheel_radius);
        let in_wheel = |x: f64| aside < HALF_TYRE && (at - hub(x)).norm() < bike.wheel_radius;
        let corners = [hub(0.0), hub(bike.wheelbase), Point2::new(bike.x2, bike.l)];
        let sides = [0, 1, 2].map(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            (b - a).perp(&(at - a))
        });
        // Inside, whichever way round the corners are.
        let in_frame = aside < HALF_FRAME
            && (sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0));
        let part = if in_wheel(0.0) {
            "the rear wheel"
        } else if in_wheel(bike.wheelbase) {
            "the front wheel"
        } else if in_frame {
            "the frame"
        } else {
            return Ok(());
        };
        Err(DynamicsError::LaserInside {
            part,
            x: self.mount_x,
            y: self.mount_y,
            z: self.mount_z,
        })
    }
}
