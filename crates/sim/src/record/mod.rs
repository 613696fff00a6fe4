//! What happened in a run, kept in memory or written to an MCAP file.
//!
//! The closed loop tells a [`Recorder`] each [`Event`] as it happens and knows
//! nothing of files. [`Trace`] keeps the numbers for tests, pictures and Python;
//! [`McapRecorder`] writes the recording that people watch, share and run again;
//! a pair of recorders is a recorder. What a file holds, whether it is whole and what can
//! be saved of it is asked of [`log`].
//!
//! A recording depends on nothing but scenario, seed and version: all times in it
//! are simulated, and what the host and its clock have to say goes into one
//! metadata record, `bikebot.host`, if the caller gives any at all.

mod about;
mod columns;
pub mod event;
pub mod hash;
#[cfg(feature = "live")]
pub mod live;
pub mod log;
pub mod mcap_recorder;
mod messages;
mod protobuf;
#[cfg(test)]
mod recording_test;
pub mod scene;
pub mod trace;
mod wire;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use event::{
    BikeGeometry, CellState, ControlColumns, ControlSample, Event, GoalSample, GridSample,
    LogLevel, MapEvent, NoticeKind, OrderSample, PathSample, PlanEvent, RidePhase, ScanSample,
    Shape, StateColumns, StateSample,
};
pub use hash::{ResultHasher, sha256_hex};
#[cfg(feature = "live")]
pub use live::{LiveError, LiveOptions, LiveServer};
pub use mcap_recorder::McapRecorder;
pub use trace::Trace;

use crate::clock::SimTime;

/// Version of our own messages and metadata in a recording.
///
/// Raised when a field changes its meaning or place; a field added at the end
/// of a message does not raise it.
pub const SCHEMA_VERSION: u32 = 1;

/// Someone who is told what happens.
pub trait Recorder {
    /// Takes note of `event` at `time`, which never lies before the one before it.
    ///
    /// # Errors
    ///
    /// When it could not be kept. A recorder that failed to write says so once;
    /// after that it takes events and drops them, so that the run it watches can
    /// go on, and says so again when it is finished.
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError>;
}

/// Records nothing.
impl Recorder for () {
    fn record(&mut self, _: SimTime, _: &Event<'_>) -> Result<(), RecordError> {
        Ok(())
    }
}

impl<R: Recorder + ?Sized> Recorder for &mut R {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        (**self).record(time, event)
    }
}

impl<R: Recorder + ?Sized> Recorder for Box<R> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        (**self).record(time, event)
    }
}

/// Records where there is someone to record.
impl<R: Recorder> Recorder for Option<R> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        self.as_mut().map_or(Ok(()), |it| it.record(time, event))
    }
}

/// Tells both, even when the first of them fails.
impl<A: Recorder, B: Recorder> Recorder for (A, B) {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        let first = self.0.record(time, event);
        let second = self.1.record(time, event);
        first.and(second)
    }
}

/// Why something could not be recorded.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The file behind the recorder refused a write.
    #[error("the recording could not be written after {written} bytes: {source}")]
    Write {
        /// Bytes that had gone out before.
        written: u64,
        /// What the system said.
        source: std::io::Error,
    },
    /// The container refused a record.
    #[error("the recording refused a record after {written} bytes: {source}")]
    Container {
        /// Bytes that had gone out before.
        written: u64,
        /// What the container said.
        source: Box<mcap::McapError>,
    },
    /// Finished after an earlier failure: the file ends where that happened.
    #[error("the recording is incomplete: {reason}")]
    Incomplete {
        /// The failure, in the words it was first reported in.
        reason: String,
    },
    /// Used after it was finished.
    #[error("the recording is already finished")]
    Finished,
    /// An event lies before the one before it.
    #[error("an event at {} s came after one at {} s", .time.seconds(), .last.seconds())]
    TimeWentBack {
        /// When the event happened.
        time: SimTime,
        /// When the one before it happened.
        last: SimTime,
    },
    /// A grid whose cells are not as many as its sides say.
    #[error("a map of {width} x {height} cells came with {cells} cells")]
    GridSize {
        /// Cells along x.
        width: usize,
        /// Cells along y.
        height: usize,
        /// Cells given.
        cells: usize,
    },
    /// An attachment larger than a reader of recordings accepts.
    #[error(
        "attachment {name} has {bytes} bytes, more than the {} that recordings may hold",
        wire::RECORD_LIMIT
    )]
    AttachmentTooLarge {
        /// Its name.
        name: String,
        /// Its size, bytes.
        bytes: u64,
    },
}

/// A file that a scenario names, under the name it uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// The path as the scenario (or a map) writes it.
    pub name: String,
    /// Its content.
    pub data: Vec<u8>,
}

/// What a run is, as far as it is known before it starts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunInfo {
    /// Version of the program.
    pub version: String,
    /// Name of the scenario.
    pub scenario: String,
    /// The scenario's text after overrides: enough to run it again.
    pub scenario_text: String,
    /// Seed of all chance.
    pub seed: u64,
    /// What was overridden, as `key.path=value`, in the order given.
    pub overrides: Vec<String>,
    /// Files the scenario names, maps above all.
    pub files: Vec<SourceFile>,
    /// Anything more, such as `plant`, `mode`, `run_id`.
    pub more: BTreeMap<String, String>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResultInfo {
    /// `arrived`, `fell`, … (`interfaces.md` §1).
    pub outcome: String,
    /// Of the outcome's closed list.
    pub reason: String,
    /// See [`ResultHasher`].
    pub result_hash: String,
    /// Metrics by name; nothing that depends on the clock on the wall.
    pub metrics: BTreeMap<String, f64>,
    /// What the scenario expected, and whether it held.
    pub expect: Vec<(String, bool)>,
    /// Facts about the host and its clock, for `bikebot.host`; empty leaves the
    /// record out, and the file depends on scenario, seed and version alone.
    pub host: BTreeMap<String, String>,
}

/// How densely a run is recorded, `[record]` of a scenario.
///
/// A rate above the control rate means every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RecordOptions {
    /// Rate of `/bike/state` and `/control/debug`, Hz. A hundred draws smooth
    /// curves; 1000 shows every tick of a fast controller at ten times the size.
    #[serde(rename = "state_hz")]
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub state: f64,
    /// Rate of `/tf` and `/bike/joints`, Hz: smooth to the eye when played slowly.
    #[serde(rename = "frames_hz")]
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub frames: f64,
    /// Rate of `/bike/pose`, Hz.
    #[serde(rename = "pose_hz")]
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub pose: f64,
    /// Rate of `/bike/footprint` and of moving `/obstacles`, Hz.
    #[serde(rename = "scene_hz")]
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub scene: f64,
    /// Rate of `/belief`, Hz: the whole grid each time. Two a second show the field filling in.
    #[serde(rename = "belief_hz")]
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub belief: f64,
    /// How much simulated time may be lost when the program is killed, s: the
    /// file is readable up to the last of these.
    #[serde(rename = "flush_s")]
    #[schemars(range(min = 0.01, max = 60.0))]
    pub flush: f64,
}

impl Default for RecordOptions {
    fn default() -> Self {
        Self {
            state: 100.0,
            frames: 100.0,
            pose: 50.0,
            scene: 20.0,
            belief: 2.0,
            flush: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Failing;

    impl Recorder for Failing {
        fn record(&mut self, _: SimTime, _: &Event<'_>) -> Result<(), RecordError> {
            Err(RecordError::Finished)
        }
    }

    #[test]
    fn a_pair_tells_the_second_even_when_the_first_fails() {
        let mut pair = (Failing, Trace::default());
        let event = Event::Notice {
            kind: NoticeKind::Collision,
            text: "touched",
            value: -0.01,
        };
        assert!(pair.record(SimTime::ZERO, &event).is_err());
        assert_eq!(pair.1.notices.len(), 1);
    }

    #[test]
    fn names_of_state_and_control_never_clash() {
        for name in StateSample::FIELDS {
            assert!(!ControlSample::FIELDS.contains(name), "{name}");
        }
    }
}
