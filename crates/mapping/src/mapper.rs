//! From scans to a belief.

use bikebot_dynamics::{LaserParams, LaserScan};
use bikebot_geometry::{Point2, Pose2, Vector2};
use bikebot_world::{Cell, Footprint, OccupancyGrid};

use crate::beam::{Beam, Device};
use crate::belief::BeliefGrid;
use crate::beside::Beside;
use crate::error::MappingError;
use crate::evidence::{Thresholds, Weights};
use crate::marks::{HIT, Marks};
use crate::outline::Outline;
use crate::params::MapperParams;

/// How far behind the surface a hit is entered, m: a surface on the line between two cells belongs to the farther one,
/// whichever way the last digit rounds.
const DEPTH: f64 = 1e-6;

/// Beams as far apart as this part of a cell cross every cell: a square is nowhere narrower than its side. The rest is for the bike
/// that moves from beam to beam.
const DENSE: f64 = 0.7;

/// Beams are told apart by how often their index can be halved, up to this.
const MOST_HALVINGS: u32 = 5;

/// Nothing can hide from a laser whose least range is at most this, m: it would be inside the device.
const BLIND: f64 = 0.1;

/// Beams to either side that must have met nothing before, for a missing return to clear as far as it may: a lost return
/// must not clear what the beams beside it see.
const WITNESSES: usize = 2;
/// Room for so many cells that change with one scan, for each beam: more than rides along walls need, so that none allocates.
const CHANGES_PER_BEAM: usize = 16;

/// A return that was believed to come from an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Which beam of the scan, from 0.
    pub beam: usize,
    /// When the beam was fired, s.
    pub time: f64,
    /// What it met, world frame, m.
    pub point: Point2,
    /// From the scanner, over ground, m.
    pub distance: f64,
    /// From the scanner, over ground; of length one.
    pub direction: Vector2,
    /// Column and row of the cell it was entered in; `None` off the grid.
    pub cell: Option<(usize, usize)>,
    /// What that cell was taken to be before this scan; unknown off the grid.
    pub before: Cell,
}

/// Inserts scans into a [`BeliefGrid`].
///
/// * Every beam counts from where the bike was when it was fired.
/// * A cell is judged once a scan: occupied if any beam ended in it, else freed if one passed. The order of the beams does
///   not matter.
/// * What the roll would have touch the ground, or pass over the obstacles, neither hits nor clears.
/// * A beam clears only what lies farther than `surface_margin_cells`, and what noise adds to it, before and beside whatever was hit
///   in this scan. So cells behind a wall seen at a grazing angle are not freed.
/// * Evidence that the pose's uncertainty blurs over several cells weighs less.
///
/// After the first scan of a kind nothing is allocated but for a longer list of changes than ever before.
#[derive(Debug, Clone)]
pub struct Mapper {
    belief: BeliefGrid,
    params: MapperParams,
    /// Kept before and beside every surface, m.
    surface_margin: f64,
    device: Device,
    frame: Frame,
    weights: Weights,
    thresholds: Thresholds,
    marks: Marks,
    beams: Vec<Beam>,
    /// Distance over ground of the nearest thing met in a tube about each beam, then up to which it clears, m.
    nearest: Vec<f64>,
    beside: Beside,
    hits: Vec<Hit>,
    changes: Vec<(usize, usize, Cell)>,
}

/// The grid's frame, with its rotation worked out.
#[derive(Debug, Clone, Copy)]
struct Frame {
    origin: Point2,
    cos: f64,
    sin: f64,
    per_cell: f64,
}

impl Frame {
    fn of(grid: &OccupancyGrid) -> Self {
        let (sin, cos) = grid.origin.heading.sin_cos();
        Self {
            origin: grid.origin.position,
            cos,
            sin,
            per_cell: grid.resolution.recip(),
        }
    }

    /// A point (m) in cells from the lower left corner.
    fn cells(&self, p: Point2) -> Vector2 {
        let offset = (p - self.origin) * self.per_cell;
        Vector2::new(
            self.cos * offset.x + self.sin * offset.y,
            self.cos * offset.y - self.sin * offset.x,
        )
    }
}

impl Mapper {
    /// A mapper that adds to `belief` what a laser of these parameters shows. Returns within `own_outline`, in the bike's
    /// frame, are the bike's own.
    ///
    /// # Errors
    ///
    /// [`MappingError::Thresholds`].
    pub fn new(
        params: &MapperParams,
        laser: &LaserParams,
        own_outline: Option<&Footprint>,
        belief: BeliefGrid,
    ) -> Result<Self, MappingError> {
        params.check()?;
        let grid = belief.grid();
        let beams = laser.beams as usize;
        Ok(Self {
            params: *params,
            surface_margin: params.surface_margin * grid.resolution,
            device: Device::new(params, laser, own_outline),
            frame: Frame::of(grid),
            weights: Weights::new(params, grid.resolution, laser.range_max),
            thresholds: Thresholds::new(params),
            marks: Marks::new(grid.width, grid.height),
            beams: Vec::with_capacity(beams),
            nearest: Vec::with_capacity(beams),
            beside: Beside::with_capacity(beams),
            hits: Vec::with_capacity(beams),
            changes: Vec::with_capacity(CHANGES_PER_BEAM * beams),
            belief,
        })
    }

    /// What is believed now.
    #[must_use]
    pub fn belief(&self) -> &BeliefGrid {
        &self.belief
    }

    /// What is believed, and nothing else.
    #[must_use]
    pub fn into_belief(self) -> BeliefGrid {
        self.belief
    }

    /// The parameters.
    #[must_use]
    pub fn params(&self) -> &MapperParams {
        &self.params
    }

    /// Where the beams of the last scan ended on obstacles, in the order of the beams.
    #[must_use]
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }

    /// How far a hit `distance` (m) away may be entered from where it belongs, m: two standard deviations of pose and range.
    pub(crate) fn blur(&self, distance: f64) -> f64 {
        2.0 * self.params.lateral_variance(distance).sqrt() + self.device.range_margin(distance)
    }

    /// The cells that changed their verdict last, as [`Mapper::insert`] or [`Mapper::declare_free`] answered.
    #[must_use]
    pub fn changes(&self) -> &[(usize, usize, Cell)] {
        &self.changes
    }

    /// Adds a scan. `poses` tells where the rear contact was at a time (s), which way the bike headed, and its roll (rad,
    /// positive to the right), as measured; it is asked once for each beam.
    ///
    /// Answers with the cells that changed their verdict, row by row from below: column, row, what they are now. That is what
    /// [`bikebot_world::WorldChanges::cells`] takes.
    ///
    /// A range that is not a number or below the laser's least tells nothing; a scan of no beams changes nothing.
    ///
    /// # Errors
    ///
    /// [`MappingError::Scan`] or [`MappingError::Pose`] for what is not finite; nothing is changed then.
    pub fn insert(
        &mut self,
        scan: &LaserScan,
        poses: impl FnMut(f64) -> (Pose2, f64),
    ) -> Result<&[(usize, usize, Cell)], MappingError> {
        self.changes.clear();
        self.hits.clear();
        self.aim(scan, poses)?;
        self.look_beside(scan.angle_step);
        self.mark(scan.angle_step);
        self.judge();
        Ok(&self.changes)
    }

    /// The ground under a footprint (in the bike's frame, about `pose`) is free: the bike stands there. Cells that were hit stay
    /// as they are. Answers with the cells that changed their verdict.
    pub fn declare_free(&mut self, footprint: &Footprint, pose: &Pose2) -> &[(usize, usize, Cell)] {
        self.changes.clear();
        let width = self.belief.grid().width;
        let mut under = Vec::new();
        Outline::new(footprint).cells(pose, self.belief.grid(), |x, y| under.push((x, y)));
        for (x, y) in under {
            if self.belief.declare_free(y * width + x, &self.thresholds) {
                self.changes.push((x, y, Cell::Free));
            }
        }
        &self.changes
    }

    /// What each beam says by itself.
    fn aim(
        &mut self,
        scan: &LaserScan,
        mut poses: impl FnMut(f64) -> (Pose2, f64),
    ) -> Result<(), MappingError> {
        let numbers = [
            scan.angle_min,
            scan.angle_step,
            scan.start,
            scan.beam_period,
        ];
        if !numbers.iter().all(|v| v.is_finite()) {
            return Err(MappingError::Scan {
                angle_min: scan.angle_min,
                angle_step: scan.angle_step,
                start: scan.start,
                beam_period: scan.beam_period,
            });
        }
        self.device
            .prepare(scan.angle_min, scan.angle_step, scan.ranges.len(), BLIND);
        self.beams.clear();
        let mut last = None;
        for (index, &range) in scan.ranges.iter().enumerate() {
            let time = scan.beam_time(index);
            let (pose, roll) = poses(time);
            let attitude = match last {
                // The same bits as for the beam before, as with a scanner that sees all at once.
                Some((same_pose, same_roll, attitude))
                    if (same_pose, same_roll) == (pose, roll) =>
                {
                    attitude
                }
                _ => {
                    if !(pose.is_finite() && roll.is_finite()) {
                        return Err(MappingError::Pose {
                            beam: index,
                            x: pose.position.x,
                            y: pose.position.y,
                            heading: pose.heading,
                            roll,
                        });
                    }
                    let attitude = self.device.attitude(&pose, roll);
                    last = Some((pose, roll, attitude));
                    attitude
                }
            };
            let margin = self.margin(range);
            let beam = self.device.beam(index, range, &attitude, margin, time);
            self.beams.push(beam);
        }
        Ok(())
    }

    /// Distance kept before a surface `distance` (m) away, m.
    fn margin(&self, distance: f64) -> f64 {
        self.surface_margin + self.params.position_sigma + self.device.range_margin(distance)
    }

    /// The nearest thing met in a tube about each beam, half as wide as the margin to either side.
    fn look_beside(&mut self, angle_step: f64) {
        let count = self.beams.len();
        self.nearest.clear();
        self.nearest.resize(count, f64::INFINITY);
        let step = angle_step.abs();
        let (beams, params, margin) = (&self.beams, &self.params, self.surface_margin);
        self.beside.lower(
            &mut self.nearest,
            |beam| beams[beam].met,
            |met| {
                let beside = margin + params.lateral_variance(met).sqrt();
                // A cast saturates: without a step the beams are one.
                (beside / (met * step)) as usize
            },
        );
        for i in 0..count {
            if self.beams[i].is_missing {
                let witnesses = i.saturating_sub(WITNESSES)..=(i + WITNESSES).min(count - 1);
                let nearest = self.beams[witnesses]
                    .iter()
                    .fold(self.nearest[i], |least, beam| least.min(beam.met));
                self.nearest[i] = nearest;
            }
        }
    }

    /// Marks what was passed, then what was hit: hits win.
    fn mark(&mut self, angle_step: f64) {
        for (beam, nearest) in self.beams.iter().zip(&mut self.nearest) {
            let kept = *nearest
                - self.surface_margin
                - self.params.position_sigma
                - self.device.range_margin(*nearest);
            // Nothing met beside it, and the margin of infinity is no number.
            *nearest = if nearest.is_finite() {
                kept.min(beam.clear)
            } else {
                beam.clear
            };
        }
        let until = &self.nearest;
        // Every other beam may begin where its neighbours by themselves would begin to leave cells out, those between these where
        // every fourth beam would, and so on: near the scanner a cell is crossed by dozens of them.
        let dense = DENSE * self.belief.grid().resolution / angle_step.abs();
        for (i, beam) in self.beams.iter().enumerate() {
            let end = until[i];
            if end > 0.0 {
                let apart = 1 << i.trailing_zeros().min(MOST_HALVINGS);
                let neighbours = [i.checked_sub(apart), i.checked_add(apart)]
                    .map(|k| k.and_then(|k| until.get(k)).copied().unwrap_or(0.0));
                let begin = (0.5 * dense / apart as f64)
                    .min(neighbours[0])
                    .min(neighbours[1])
                    .clamp(0.0, end);
                let [from, to] = [begin, end]
                    .map(|distance| self.frame.cells(beam.origin + beam.direction * distance));
                self.marks.pass(from, to);
            }
        }
        let grid = self.belief.grid();
        for (index, beam) in self.beams.iter().enumerate() {
            if beam.met.is_finite() {
                let behind = beam.origin + beam.direction * (beam.met + DEPTH);
                let at = self.frame.cells(behind);
                // A cast saturates, so what is far off the grid stays off it.
                let cell = (at.x >= 0.0 && at.y >= 0.0)
                    .then(|| (at.x as usize, at.y as usize))
                    .filter(|(x, y)| *x < grid.width && *y < grid.height);
                self.hits.push(Hit {
                    beam: index,
                    time: beam.time,
                    point: beam.origin + beam.direction * beam.met,
                    distance: beam.met,
                    direction: beam.direction,
                    cell,
                    before: cell
                        .and_then(|(x, y)| grid.cell(x, y))
                        .unwrap_or(Cell::Unknown),
                });
                if let Some((x, y)) = cell {
                    self.marks.hit(x, y);
                }
            }
        }
    }

    /// Adds the evidence, once for each cell.
    fn judge(&mut self) {
        let Some(middle) = self.beams.get(self.beams.len() / 2) else {
            return;
        };
        let centre = self.frame.cells(middle.origin);
        let (cx, cy) = (centre.x.floor() as i64, centre.y.floor() as i64);
        let width = self.belief.grid().width;
        let (belief, weights, thresholds) = (&mut self.belief, &self.weights, &self.thresholds);
        let changes = &mut self.changes;
        self.marks.take(|x, y, mark| {
            let (dx, dy) = (
                (x as i64 - cx).unsigned_abs(),
                (y as i64 - cy).unsigned_abs(),
            );
            let (hit, miss) = weights.at(dx * dx + dy * dy);
            let evidence = if mark == HIT { hit } else { miss };
            if let Some(now) = belief.add(y * width + x, evidence, thresholds) {
                changes.push((x, y, now));
            }
        });
    }
}

#[cfg(test)]
mod tests;
