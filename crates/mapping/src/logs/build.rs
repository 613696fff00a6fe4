//! From a log to a map.

use bikebot_geometry::Point2;
use bikebot_world::Bounds;

use super::{LogError, LogProblem, ScanLog};
use crate::belief::BeliefGrid;
use crate::mapper::Mapper;
use crate::params::MapperParams;

/// Kept free about what was seen, m: an edge to the map.
const BORDER: f64 = 1.0;

/// Sides a cell may have, m.
const RESOLUTIONS: std::ops::RangeInclusive<f64> = 1e-3..=100.0;

/// How a map is made of a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuildOptions {
    /// Side of a cell, m: 0.001 to 100.
    pub resolution: f64,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { resolution: 0.1 }
    }
}

impl BuildOptions {
    /// What a level robot's scans tell: no roll, no beam over anything. A missing return tells nothing, as the devices of the logs also
    /// lose returns on dark and on shiny things.
    fn mapper(&self) -> MapperParams {
        MapperParams {
            cell: self.resolution,
            roll_tolerance_deg: 0.0,
            height_tolerance: 0.0,
            no_return_clears: 0.0,
            ..MapperParams::default()
        }
    }
}

/// What went into a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuildSummary {
    /// Returns that were entered.
    pub hits: u64,
    /// Beams without a return, or with one that says nothing.
    pub silent: u64,
}

/// Makes a map of all scans of a log, at the poses of its odometry. `go_on` is asked before each scan, with its index; `None` once it says
/// no.
///
/// # Errors
///
/// [`LogProblem::Resolution`] for a cell size that is none, [`LogProblem::TooLarge`] for a field too large for cells of it.
pub fn build(
    name: &str,
    log: &ScanLog,
    options: &BuildOptions,
    go_on: &mut dyn FnMut(usize) -> bool,
) -> Result<Option<(BeliefGrid, BuildSummary)>, LogError> {
    let params = options.mapper();
    let resolution = options.resolution;
    if !RESOLUTIONS.contains(&resolution) {
        let problem = LogProblem::Resolution { found: resolution };
        return Err(LogError::new(name, None, problem));
    }
    let bounds = extent(log);
    let belief = BeliefGrid::over(bounds, resolution).map_err(|_| {
        let problem = LogProblem::TooLarge {
            width: bounds.width(),
            height: bounds.height(),
            resolution,
        };
        LogError::new(name, None, problem)
    })?;
    let fail = |line, error: crate::MappingError| LogError::new(name, line, error.into());
    let mut mapper =
        Mapper::new(&params, &log.laser, None, belief).map_err(|error| fail(None, error))?;
    let mut summary = BuildSummary { hits: 0, silent: 0 };
    for (index, logged) in log.scans.iter().enumerate() {
        if !go_on(index) {
            return Ok(None);
        }
        mapper
            .insert(&logged.scan, |_| (logged.pose, 0.0))
            .map_err(|error| fail(Some(logged.line), error))?;
        let hits = mapper.hits().len() as u64;
        summary.hits += hits;
        summary.silent += logged.scan.ranges.len() as u64 - hits;
    }
    Ok(Some((mapper.into_belief(), summary)))
}

/// All places the robot was and all returns, and a border; on whole metres, so that two maps of one log lie alike.
fn extent(log: &ScanLog) -> Bounds {
    let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
    let mut high = -low;
    let mut include = |p: Point2| {
        low = Point2::new(low.x.min(p.x), low.y.min(p.y));
        high = Point2::new(high.x.max(p.x), high.y.max(p.y));
    };
    for logged in &log.scans {
        include(logged.pose.position);
        let mount = logged
            .pose
            .transform(Point2::new(log.laser.mount_x, log.laser.mount_y));
        for (i, range) in logged.scan.ranges.iter().enumerate() {
            if *range >= log.laser.range_min && *range < log.laser.range_max {
                let angle =
                    logged.pose.heading + logged.scan.angle_min + logged.scan.angle_step * i as f64;
                let (sin, cos) = angle.sin_cos();
                include(Point2::new(mount.x + range * cos, mount.y + range * sin));
            }
        }
    }
    Bounds {
        min: Point2::new((low.x - BORDER).floor(), (low.y - BORDER).floor()),
        max: Point2::new((high.x + BORDER).ceil(), (high.y + BORDER).ceil()),
    }
}
