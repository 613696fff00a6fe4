//! A run kept in memory: every sample, whatever the rates of a recording.

use super::event::{
    BikeGeometry, ControlColumns, Event, GoalSample, LogLevel, PathSample, StateColumns,
};
use super::{RecordError, Recorder};
use crate::clock::SimTime;
use bikebot_world::OccupancyGrid;

/// Least time between two beliefs that are kept, s.
const BELIEF_PERIOD: f64 = 0.5;

/// Something a program may want to find.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// When, s.
    pub time_s: f64,
    /// [`NoticeKind::as_str`](super::NoticeKind::as_str) of its kind.
    pub kind: String,
    /// One line for people.
    pub text: String,
    /// The number that goes with it, SI; NaN if there is none.
    pub value: f64,
}

/// A line for people.
#[derive(Debug, Clone, PartialEq)]
pub struct LogLine {
    /// When, s.
    pub time_s: f64,
    /// How grave.
    pub level: LogLevel,
    /// The line.
    pub text: String,
}

/// A plan as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanTrace {
    /// When, s.
    pub time_s: f64,
    /// The path of the rear contact; empty if none was found.
    pub path: Vec<PathSample>,
    /// Edges of the search tree, m.
    pub tree: Vec<[[f64; 2]; 2]>,
    /// The first collision-free polyline, m.
    pub coarse: Vec<[f64; 2]>,
    /// The polyline that guided the last stage, m.
    pub guide: Vec<[f64; 2]>,
    /// Half width of the corridor round the guide, m.
    pub corridor_half_width: Option<f64>,
    /// Where it was to end.
    pub goal: Option<GoalSample>,
}

/// A followed curve as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct FollowedTrace {
    /// When the follower got it, s.
    pub time_s: f64,
    /// The curve with its speeds.
    pub path: Vec<PathSample>,
}

/// One sweep of the laser.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanTrace {
    /// The middle of the sweep, s.
    pub time_s: f64,
    /// Bearing of the first beam in the laser's frame, rad.
    pub start_angle: f64,
    /// Bearing from one beam to the next, rad.
    pub angle_step: f64,
    /// Distances, m; infinite where nothing came back.
    pub ranges: Vec<f64>,
}

/// What was believed of the field.
#[derive(Debug, Clone, PartialEq)]
pub struct BeliefTrace {
    /// When, s.
    pub time_s: f64,
    /// The cells.
    pub grid: OccupancyGrid,
}

/// What a run left behind, in memory.
///
/// Scans and beliefs are kept only on request ([`Trace::with_scans`], [`Trace::with_beliefs`]); they outweigh all else.
/// [`log::read_trace`](super::log::read_trace) gives the same from a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trace {
    /// The true states.
    pub state: StateColumns,
    /// What the controller measured, wanted and asked for.
    pub control: ControlColumns,
    /// Every plan, the last one last.
    pub plans: Vec<PlanTrace>,
    /// Every followed curve, the last one last.
    pub followed: Vec<FollowedTrace>,
    /// Notices in order.
    pub notices: Vec<Notice>,
    /// Log lines in order.
    pub lines: Vec<LogLine>,
    /// Scans in order, if asked for.
    pub scans: Vec<ScanTrace>,
    /// Beliefs in order, if asked for; at most two a second.
    pub beliefs: Vec<BeliefTrace>,
    /// The map as a recording has it, in cells. A run leaves none: its scenario says more exactly where things stand.
    pub map: Option<OccupancyGrid>,
    /// What the bike looks like, if told; a file does not keep it.
    pub bike: Option<BikeGeometry>,
    keep_scans: bool,
    keep_beliefs: bool,
}

impl Trace {
    /// An empty trace that keeps scans too.
    #[must_use]
    pub fn with_scans() -> Self {
        Self {
            keep_scans: true,
            ..Self::default()
        }
    }

    /// This trace, but it keeps beliefs too.
    #[must_use]
    pub fn with_beliefs(self) -> Self {
        Self {
            keep_beliefs: true,
            ..self
        }
    }

    /// Keeps a belief, unless it is not asked for or comes too soon after the last one.
    pub(super) fn push_belief(
        &mut self,
        time_s: f64,
        grid: impl FnOnce() -> Option<OccupancyGrid>,
    ) {
        // Half a millisecond: a recording's rate is not exactly two a second.
        let is_due = self
            .beliefs
            .last()
            .is_none_or(|last| time_s >= last.time_s + BELIEF_PERIOD - 5e-4);
        if self.keep_beliefs && is_due {
            self.beliefs
                .extend(grid().map(|grid| BeliefTrace { time_s, grid }));
        }
    }

    /// Whether scans are kept.
    pub(super) fn keeps_scans(&self) -> bool {
        self.keep_scans
    }

    /// Time and values of the quantity of that name, from state or control.
    ///
    /// Names are those of [`StateSample`](super::StateSample) and
    /// [`ControlSample`](super::ControlSample), such as `roll_rad`; plain `time_s`
    /// is that of the state.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<(&[f64], &[f64])> {
        let state = self.state.column(name).map(|it| (&*self.state.time_s, it));
        state.or_else(|| {
            let column = self.control.column(name)?;
            Some((&*self.control.time_s, column))
        })
    }

    /// The names that [`Trace::column`] knows, state before control.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let own = super::StateSample::FIELDS.iter();
        let control = super::ControlSample::FIELDS.iter();
        std::iter::once("time_s").chain(own.chain(control).copied())
    }
}

impl Recorder for Trace {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        let time_s = time.seconds();
        match *event {
            Event::Bike(bike) => self.bike = Some(bike.clone()),
            Event::State(sample) => self.state.push(time, sample),
            Event::Control(sample) => self.control.push(time, sample),
            Event::Plan(plan) => self.plans.push(PlanTrace {
                time_s,
                path: plan.path.to_vec(),
                tree: plan.tree.to_vec(),
                coarse: plan.coarse.to_vec(),
                guide: plan.guide.to_vec(),
                corridor_half_width: plan.corridor_half_width,
                goal: plan.goal,
            }),
            Event::FollowedPath(path) => self.followed.push(FollowedTrace {
                time_s,
                path: path.to_vec(),
            }),
            Event::Scan(scan) if self.keep_scans => self.scans.push(ScanTrace {
                time_s: scan.stamp.seconds(),
                start_angle: scan.start_angle,
                angle_step: scan.angle_step,
                ranges: scan.ranges.to_vec(),
            }),
            Event::Belief(grid) => self.push_belief(time_s, || Some(grid.clone())),
            Event::Notice { kind, text, value } => self.notices.push(Notice {
                time_s,
                kind: kind.as_str().to_owned(),
                text: text.to_owned(),
                value,
            }),
            Event::Log { level, text } => self.lines.push(LogLine {
                time_s,
                level,
                text: text.to_owned(),
            }),
            // Where things stand and what is attached, the scenario says already.
            Event::Scan(_)
            | Event::Map(_)
            | Event::Order(_)
            | Event::MovingObstacles(_)
            | Event::Attachment { .. } => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{ControlSample, ScanSample, StateSample};

    #[test]
    fn keeps_every_sample_under_the_name_it_has_on_the_wire() {
        let mut trace = Trace::default();
        for tick in 0..3u64 {
            let time = SimTime::from_nanoseconds(5_000_000 * tick);
            let state = StateSample {
                roll_rad: tick as f64,
                ..StateSample::default()
            };
            let control = ControlSample {
                balancer_saturated: tick == 2,
                phase: crate::record::RidePhase::Brake,
                ..ControlSample::default()
            };
            trace.record(time, &Event::State(&state)).unwrap();
            trace.record(time, &Event::Control(&control)).unwrap();
        }
        let (time, roll) = trace.column("roll_rad").unwrap();
        assert_eq!(time, [0.0, 0.005, 0.01]);
        assert_eq!(roll, [0.0, 1.0, 2.0]);
        assert_eq!(
            trace.column("balancer_saturated").unwrap().1,
            [0.0, 0.0, 1.0]
        );
        assert_eq!(trace.column("phase").unwrap().1, [2.0, 2.0, 2.0]);
        assert!(trace.column("x_m").unwrap().1.iter().all(|it| it.is_nan()));
        assert!(trace.column("no_such_thing").is_none());
        assert!(Trace::names().all(|name| trace.column(name).is_some()));
    }

    #[test]
    fn keeps_scans_only_when_asked() {
        let scan = Event::Scan(ScanSample {
            stamp: SimTime::ZERO,
            start_angle: 0.0,
            angle_step: 0.1,
            ranges: &[1.0, f64::INFINITY],
        });
        let mut plain = Trace::default();
        plain.record(SimTime::ZERO, &scan).unwrap();
        assert!(plain.scans.is_empty());
        let mut full = Trace::with_scans();
        full.record(SimTime::ZERO, &scan).unwrap();
        assert_eq!(full.scans[0].ranges, [1.0, f64::INFINITY]);
    }
}
