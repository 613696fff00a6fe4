//! What one turn of the scanner says.

/// One turn of the scanner: ranges along beams in the scanner's own plane, fired one after another.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LaserScan {
    /// When the first beam was fired, s.
    pub start: f64,
    /// Time from one beam to the next, s; zero where all are fired at once.
    pub beam_period: f64,
    /// Angle of the first beam from the scanner's x axis, rad, counter-clockwise.
    pub angle_min: f64,
    /// Angle from one beam to the next, rad; zero for a single beam.
    pub angle_step: f64,
    /// Range of each beam, m. What stands for no return is the scanner's to say
    /// ([`LaserScanner::is_return`](super::LaserScanner::is_return)); unless told otherwise it is `f64::INFINITY`.
    pub ranges: Vec<f64>,
}

impl LaserScan {
    /// When the beam of this index is fired, s.
    #[must_use]
    pub fn beam_time(&self, index: usize) -> f64 {
        self.start + self.beam_period * index as f64
    }

    /// Angle of the beam of this index from the scanner's x axis, rad, counter-clockwise.
    #[must_use]
    pub fn beam_angle(&self, index: usize) -> f64 {
        self.angle_min + self.angle_step * index as f64
    }

    /// When the last beam is fired, s.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.beam_time(self.ranges.len().saturating_sub(1))
    }

    /// The middle of the turn, s: seen from where the scanner was then, all its beams are nearest to where they were.
    #[must_use]
    pub fn middle(&self) -> f64 {
        0.5 * (self.start + self.end())
    }
}
