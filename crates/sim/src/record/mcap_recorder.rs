//! The recording: one MCAP file that viewers open and that can be run again.
//!
//! Written so that a killed program leaves a readable file: chunks go out whole
//! (`disable_seeking`), at least once per simulated second, and what is needed to
//! run the scenario again stands at the front. Write to a temporary name and
//! rename after [`McapRecorder::finish`]; a file without the `bikebot.result`
//! record is one whose run did not end.

use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bikebot_world::{Cell, OccupancyGrid};
use foxglove::Encode;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, McapResult, WriteOptions};

use super::event::{
    BikeGeometry, BikeState, CellState, ControlDebug, ControlSample, Event, GridSample, MapEvent,
    StateSample,
};
use super::messages::{self, RunEvent, Topic};
use super::scene::{Raster, rasterise, shrink};
use super::{
    RecordError, RecordOptions, Recorder, ResultInfo, RunInfo, SCHEMA_VERSION, sha256_hex, wire,
};
use crate::clock::SimTime;

/// Uncompressed size at which a chunk is closed whatever the clock says, bytes:
/// with the flush each second, the most a killed program may lose.
const CHUNK_SIZE: u64 = 256 * 1024;

/// Parts of a topic whose messages do not replace each other: all of it, and beside that what is named.
const WHOLE: u8 = 0;
/// The followed curve, on the topic of the plan's scene.
const FOLLOWED: u8 = 1;
/// What moves, on the topic of the obstacles.
const MOVING: u8 = 1;

/// Name of the metadata record that says what the run is.
pub(super) const RUN: &str = "bikebot.run";
/// Name of the metadata record that says how it ended.
pub(super) const RESULT: &str = "bikebot.result";
/// Name of the metadata record for the host and its clock.
pub(super) const HOST: &str = "bikebot.host";
/// Name of the attachment that holds the scenario.
pub(super) const SCENARIO: &str = "scenario.toml";
/// Folder of the attachments that hold the scenario's files.
pub(super) const FILES: &str = "files/";

/// How all our files are written, whoever writes them.
pub(super) fn write_options() -> WriteOptions {
    WriteOptions::new()
        .profile("bikebot")
        .library(concat!("bikebot/", env!("CARGO_PKG_VERSION")))
        .chunk_size(Some(CHUNK_SIZE))
        .disable_seeking(true)
        // Of the compressor's levels the quickest: a third less time than by default, one percent more bytes.
        .compression_level(1)
        // Threads of the compressor are as many as the host has unless told.
        .compression_threads(0)
}

/// Writes a run to anything that can be written and sought.
///
/// ```
/// use std::io::Cursor;
/// use bikebot_sim::clock::SimTime;
/// use bikebot_sim::record::{
///     Event, LogLevel, McapRecorder, RecordOptions, Recorder, ResultInfo, RunInfo,
/// };
///
/// let run = RunInfo { scenario: "fig7".into(), seed: 1, ..RunInfo::default() };
/// let mut recorder =
///     McapRecorder::begin(Cursor::new(Vec::new()), &run, &RecordOptions::default())?;
/// let event = Event::Log { level: LogLevel::Info, text: "off we go" };
/// recorder.record(SimTime::ZERO, &event)?;
/// recorder.finish(&ResultInfo { outcome: "arrived".into(), ..ResultInfo::default() })?;
/// let bytes = recorder.into_inner().into_inner();
/// assert_eq!(bytes[..8], bytes[bytes.len() - 8..]); // whole: magic at both ends
/// # Ok::<(), bikebot_sim::record::RecordError>(())
/// ```
pub struct McapRecorder<W: Write + Seek> {
    /// Present while the recording is open.
    writer: Option<mcap::Writer<Counted<W>>>,
    /// The stream, once the recording was finished or given up.
    closed: Option<W>,
    /// Why it was given up.
    failure: Option<String>,
    written: Arc<AtomicU64>,
    channels: [Channel; Topic::ALL.len()],
    buffer: Vec<u8>,
    bike: Option<BikeGeometry>,
    last_time: SimTime,
    flush: Pace,
    frames: Pace,
    joints: Pace,
    pose: Pace,
    state: Pace,
    control: Pace,
    footprint: Pace,
    moving: Pace,
    belief: Pace,
    /// The newest samples that were not written yet; at the end they are.
    held_state: Option<(SimTime, StateSample)>,
    held_control: Option<(SimTime, ControlSample)>,
    /// Messages placed in the world, of the present stamp, until its state has come
    /// and with it the transforms: a viewer looks for those at or before each stamp.
    waiting: Vec<(Topic, u8, Vec<u8>)>,
    /// The stamp whose state has come.
    settled: Option<SimTime>,
    /// Whoever else is handed every message.
    #[cfg(feature = "live")]
    live: Option<Arc<super::live::Shared>>,
}

#[derive(Clone, Copy, Default)]
struct Channel {
    id: u16,
    sequence: u32,
}

/// Lets the first event of each period pass, by the simulated clock alone.
struct Pace {
    period: u64,
    last_slot: Option<u64>,
}

impl Pace {
    fn seconds(period: f64) -> Self {
        // A cast saturates: a rate of zero is one event in 584 years.
        Self {
            period: ((period * 1e9).round() as u64).max(1),
            last_slot: None,
        }
    }

    fn hertz(rate: f64) -> Self {
        Self::seconds(1.0 / rate)
    }

    fn is_due(&mut self, time: SimTime) -> bool {
        let slot = Some(time.nanoseconds() / self.period);
        let due = slot != self.last_slot;
        self.last_slot = slot;
        due
    }
}

impl<W: Write + Seek> McapRecorder<W> {
    /// Opens a recording: what the run is, the scenario and its files, all topics.
    ///
    /// `output` is best buffered; it is flushed at least once per simulated second.
    ///
    /// # Errors
    ///
    /// [`RecordError::Write`], or [`RecordError::AttachmentTooLarge`] for a file
    /// that no reader of recordings would take.
    pub fn begin(output: W, run: &RunInfo, options: &RecordOptions) -> Result<Self, RecordError> {
        let written = Arc::new(AtomicU64::new(0));
        let counted = Counted {
            inner: output,
            written: Arc::clone(&written),
        };
        let writer = write_options()
            .create(counted)
            .map_err(|source| failure(written.load(Ordering::Relaxed), source))?;
        let mut this = Self {
            writer: Some(writer),
            closed: None,
            failure: None,
            written,
            channels: Default::default(),
            buffer: Vec::new(),
            bike: None,
            last_time: SimTime::ZERO,
            flush: Pace::seconds(options.flush),
            frames: Pace::hertz(options.frames),
            joints: Pace::hertz(options.frames),
            pose: Pace::hertz(options.pose),
            state: Pace::hertz(options.state),
            control: Pace::hertz(options.state),
            footprint: Pace::hertz(options.scene),
            moving: Pace::hertz(options.scene),
            belief: Pace::hertz(options.belief),
            held_state: None,
            held_control: None,
            waiting: Vec::new(),
            settled: None,
            #[cfg(feature = "live")]
            live: None,
        };
        this.metadata(RUN, run_metadata(run))?;
        this.attach(SCENARIO, "application/toml", run.scenario_text.as_bytes())?;
        for file in &run.files {
            let name = format!("{FILES}{}", file.name);
            this.attach(&name, "application/octet-stream", &file.data)?;
        }
        for topic in Topic::ALL {
            let (schema, encoding) = topic.schema();
            let id = this.write(|writer| {
                let schema_id = match &schema {
                    Some(it) => writer.add_schema(&it.name, &it.encoding, &it.data)?,
                    None => 0,
                };
                writer.add_channel(schema_id, topic.name(), &encoding, &BTreeMap::new())
            })?;
            this.channels[topic as usize].id = id.unwrap_or_default();
        }
        this.flush()?;
        Ok(this)
    }

    /// Hands every message from now on to the viewers of `server` as well, also where the file fails.
    #[cfg(feature = "live")]
    #[must_use]
    pub fn with_live(mut self, server: &super::live::LiveServer) -> Self {
        self.live = Some(server.shared());
        self
    }

    /// Whether someone watches, whatever becomes of the file.
    fn is_live(&self) -> bool {
        #[cfg(feature = "live")]
        {
            self.live.is_some()
        }
        #[cfg(not(feature = "live"))]
        {
            false
        }
    }

    /// Closes the recording: the last samples, how the run ended, the index.
    ///
    /// Asking again does nothing. The stream behind is flushed but not synchronised
    /// with the disk; that is for whoever opened it.
    ///
    /// # Errors
    ///
    /// The failure of a write, now or ([`RecordError::Incomplete`]) before: after
    /// an `Ok` the file is whole.
    pub fn finish(&mut self, result: &ResultInfo) -> Result<(), RecordError> {
        self.check_not_failed()?;
        if self.closed.is_some() {
            return Ok(());
        }
        self.release_waiting(self.last_time)?;
        self.write_held()?;
        self.metadata(RESULT, result_metadata(result))?;
        if !result.host.is_empty() {
            self.metadata(HOST, result.host.clone())?;
        }
        self.write(|writer| writer.finish().map(|_| ()))?;
        self.closed = self.writer.take().map(|it| it.into_inner().inner);
        Ok(())
    }

    /// Sends out what is still held back in memory.
    ///
    /// # Errors
    ///
    /// [`RecordError::Write`].
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.write(mcap::Writer::flush).map(|_| ())
    }

    /// Bytes that have gone to the stream.
    #[must_use]
    pub fn bytes_written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// The stream, as it was given. Unless [`Self::finish`] went well it holds no
    /// whole recording, only what was written so far.
    #[must_use]
    pub fn into_inner(self) -> W {
        match (self.writer, self.closed) {
            (Some(writer), _) => writer.into_inner().inner,
            (None, Some(inner)) => inner,
            (None, None) => unreachable!("whoever takes the writer leaves the stream"),
        }
    }

    fn check_not_failed(&self) -> Result<(), RecordError> {
        match &self.failure {
            Some(reason) => Err(RecordError::Incomplete {
                reason: reason.clone(),
            }),
            None => Ok(()),
        }
    }

    /// Does something with the writer; on failure gives the recording up, so that
    /// nothing is ever appended to a torn record. Nothing once it was given up.
    fn write<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<Counted<W>>) -> McapResult<T>,
    ) -> Result<Option<T>, RecordError> {
        let Some(writer) = &mut self.writer else {
            return Ok(None);
        };
        match act(writer) {
            Ok(value) => Ok(Some(value)),
            Err(source) => {
                let error = failure(self.bytes_written(), source);
                self.failure = Some(error.to_string());
                self.closed = self.writer.take().map(|it| it.into_inner().inner);
                Err(error)
            }
        }
    }

    fn metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), RecordError> {
        let record = Metadata {
            name: name.to_owned(),
            metadata,
        };
        self.write(|writer| writer.write_metadata(&record))
            .map(|_| ())
    }

    fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<(), RecordError> {
        let bytes = data.len() as u64;
        // Room for the name and the lengths around the data.
        if bytes + name.len() as u64 + 1024 > wire::RECORD_LIMIT {
            return Err(RecordError::AttachmentTooLarge {
                name: name.to_owned(),
                bytes,
            });
        }
        let attachment = Attachment {
            // Time zero and not the clock's: the bytes depend on the run alone.
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: data.into(),
        };
        self.write(|writer| writer.attach(&attachment)).map(|_| ())
    }

    fn send<M: Encode>(
        &mut self,
        topic: Topic,
        time: SimTime,
        message: &M,
    ) -> Result<(), RecordError> {
        self.send_part(topic, WHOLE, time, message)
    }

    fn send_part<M: Encode>(
        &mut self,
        topic: Topic,
        part: u8,
        time: SimTime,
        message: &M,
    ) -> Result<(), RecordError> {
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.clear();
        #[expect(clippy::expect_used, reason = "a vector grows as it must")]
        message
            .encode(&mut buffer)
            .expect("encoding fails only for want of room, and a vector grows");
        if topic.is_framed() && self.settled != Some(time) {
            self.waiting.push((topic, part, buffer));
            return Ok(());
        }
        let sent = self.write_message(topic, part, time, &buffer);
        self.buffer = buffer;
        sent
    }

    fn write_message(
        &mut self,
        topic: Topic,
        #[cfg_attr(not(feature = "live"), expect(unused_variables))] part: u8,
        time: SimTime,
        message: &[u8],
    ) -> Result<(), RecordError> {
        #[cfg(feature = "live")]
        if let Some(live) = &self.live {
            live.publish(topic, part, time, message);
        }
        let channel = self.channels[topic as usize];
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: time.nanoseconds(),
            publish_time: time.nanoseconds(),
        };
        self.channels[topic as usize].sequence = channel.sequence.wrapping_add(1);
        self.write(|writer| writer.write_to_known_channel(&header, message))
            .map(|_| ())
    }

    /// The transforms of this stamp are written, or will not be: all else may follow.
    fn settle(&mut self, time: SimTime) -> Result<(), RecordError> {
        self.settled = Some(time);
        self.release_waiting(time)
    }

    /// Writes what waited for transforms, all of the stamp `time`.
    fn release_waiting(&mut self, time: SimTime) -> Result<(), RecordError> {
        for (topic, part, message) in std::mem::take(&mut self.waiting) {
            self.write_message(topic, part, time, &message)?;
        }
        Ok(())
    }

    fn state(&mut self, time: SimTime, state: &StateSample, all: bool) -> Result<(), RecordError> {
        // Frames before anything of the same stamp: a viewer looks back for them.
        if let Some(bike) = self.bike.take() {
            let drawn = self.drawn_from_state(time, state, &bike, all);
            self.bike = Some(bike);
            drawn?;
        } else {
            self.settle(time)?;
        }
        if self.pose.is_due(time) || all {
            self.send(Topic::Pose, time, &messages::bike_pose(time, state))?;
        }
        if self.state.is_due(time) || all {
            self.held_state = None;
            self.send(Topic::State, time, &BikeState::new(time, state))?;
        } else {
            self.held_state = Some((time, *state));
        }
        Ok(())
    }

    fn drawn_from_state(
        &mut self,
        time: SimTime,
        state: &StateSample,
        bike: &BikeGeometry,
        all: bool,
    ) -> Result<(), RecordError> {
        if self.frames.is_due(time) || all || !self.waiting.is_empty() {
            self.send(Topic::Frames, time, &messages::frames(time, state, bike))?;
        }
        self.settle(time)?;
        if self.joints.is_due(time) || all {
            self.send(Topic::Joints, time, &messages::joints(time, state, bike))?;
        }
        if self.footprint.is_due(time) || all {
            let message = messages::footprint(time, state, bike);
            self.send(Topic::Footprint, time, &message)?;
        }
        Ok(())
    }

    fn control(
        &mut self,
        time: SimTime,
        control: &ControlSample,
        all: bool,
    ) -> Result<(), RecordError> {
        if self.control.is_due(time) || all {
            self.held_control = None;
            self.send(Topic::Control, time, &ControlDebug::new(time, control))
        } else {
            self.held_control = Some((time, *control));
            Ok(())
        }
    }

    /// The last samples, whose turn had not come, unless others came after them.
    fn write_held(&mut self) -> Result<(), RecordError> {
        if let Some((time, state)) = self.held_state.take()
            && time >= self.last_time
        {
            self.state(time, &state, true)?;
        }
        if let Some((time, control)) = self.held_control.take()
            && time >= self.last_time
        {
            self.control(time, &control, true)?;
        }
        Ok(())
    }

    fn belief(&mut self, time: SimTime, grid: &OccupancyGrid) -> Result<(), RecordError> {
        let cells: Vec<CellState> = grid
            .cells
            .iter()
            .map(|cell| match cell {
                Cell::Free => CellState::Free,
                Cell::Occupied => CellState::Occupied,
                Cell::Unknown => CellState::Unknown,
            })
            .collect();
        let sample = GridSample {
            width: grid.width,
            height: grid.height,
            resolution: grid.resolution,
            origin: [grid.origin.position.x, grid.origin.position.y],
            yaw: grid.origin.heading,
            cells: &cells,
        };
        let small = shrink(&sample);
        let sample = small.as_ref().map_or(sample, Raster::sample);
        self.send(Topic::Belief, time, &messages::map_occupancy(time, &sample))
    }

    fn map(&mut self, time: SimTime, map: &MapEvent<'_>) -> Result<(), RecordError> {
        let raster = match &map.grid {
            None => Some(rasterise(map.bounds, map.shapes)),
            Some(grid) => {
                if grid.width.checked_mul(grid.height) != Some(grid.cells.len()) {
                    return Err(RecordError::GridSize {
                        width: grid.width,
                        height: grid.height,
                        cells: grid.cells.len(),
                    });
                }
                shrink(grid)
            }
        };
        let grid = match (&raster, &map.grid) {
            (Some(raster), _) => raster.sample(),
            (None, Some(grid)) => *grid,
            (None, None) => return Ok(()),
        };
        self.send(Topic::Map, time, &messages::map_colour(time, &grid))?;
        self.send(
            Topic::Occupancy,
            time,
            &messages::map_occupancy(time, &grid),
        )?;
        let solid = messages::obstacles(time, messages::STANDING, map.shapes);
        self.send(Topic::Obstacles, time, &solid)
    }
}

impl<W: Write + Seek> Recorder for McapRecorder<W> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        match &self.failure {
            Some(_) if !self.is_live() => return Ok(()),
            // The file has ended; those who watch go on.
            Some(_) => {}
            None if self.closed.is_some() => return Err(RecordError::Finished),
            None => {}
        }
        if time < self.last_time {
            return Err(RecordError::TimeWentBack {
                time,
                last: self.last_time,
            });
        }
        if time > self.last_time {
            // No state came with them; they wait no longer than their stamp.
            self.release_waiting(self.last_time)?;
        }
        self.last_time = time;
        if self.flush.is_due(time) {
            self.flush()?;
        }
        match *event {
            Event::Bike(bike) => {
                self.bike = Some(bike.clone());
                self.send(Topic::Model, time, &messages::bike_model(time, bike))
            }
            Event::Map(ref map) => self.map(time, map),
            Event::Plan(ref plan) => {
                self.send(Topic::PlanPath, time, &messages::plan_path(time, plan.path))?;
                self.send(Topic::PlanScene, time, &messages::plan_scene(time, plan))?;
                let table = messages::path_table(time, plan.path);
                self.send(Topic::PlanSamples, time, &table)
            }
            Event::FollowedPath(path) => {
                self.send(Topic::Followed, time, &messages::path_table(time, path))?;
                let scene = messages::followed_scene(time, path);
                self.send_part(Topic::PlanScene, FOLLOWED, time, &scene)
            }
            Event::State(state) => self.state(time, state, false),
            Event::Control(control) => self.control(time, control, false),
            Event::Scan(ref scan) => self.send(Topic::Scan, time, &messages::scan(scan)),
            Event::Belief(grid) => {
                if self.belief.is_due(time) {
                    self.belief(time, grid)?;
                }
                Ok(())
            }
            Event::Order(_) => Ok(()),
            Event::MovingObstacles(shapes) => {
                if self.moving.is_due(time) {
                    let scene = messages::obstacles(time, messages::MOVING, shapes);
                    self.send_part(Topic::Obstacles, MOVING, time, &scene)?;
                }
                Ok(())
            }
            Event::Log { level, text } => {
                self.send(Topic::Log, time, &messages::log_line(time, level, text))
            }
            Event::Notice { kind, text, value } => {
                let message = RunEvent {
                    time_s: time.seconds(),
                    kind: kind.as_str().to_owned(),
                    text: text.to_owned(),
                    value,
                };
                self.send(Topic::Events, time, &message)
            }
            Event::Attachment {
                name,
                media_type,
                data,
            } => self.attach(name, media_type, data),
        }
    }
}

fn run_metadata(run: &RunInfo) -> BTreeMap<String, String> {
    let mut record = run.more.clone();
    let fixed = [
        ("schema_version", SCHEMA_VERSION.to_string()),
        ("version", run.version.clone()),
        ("scenario", run.scenario.clone()),
        ("scenario_sha256", sha256_hex(run.scenario_text.as_bytes())),
        ("seed", run.seed.to_string()),
        ("overrides", run.overrides.join("\n")),
    ];
    record.extend(fixed.map(|(key, value)| (key.to_owned(), value)));
    record
}

fn result_metadata(result: &ResultInfo) -> BTreeMap<String, String> {
    let fixed = [
        ("outcome", &result.outcome),
        ("reason", &result.reason),
        ("result_hash", &result.result_hash),
    ];
    let fixed = fixed.map(|(key, value)| (key.to_owned(), value.clone()));
    // `{}` of an f64 is the shortest text that reads back as the same number.
    let metrics = result.metrics.iter();
    let metrics = metrics.map(|(key, value)| (format!("metrics.{key}"), value.to_string()));
    let expect = result.expect.iter();
    let expect = expect.map(|(check, ok)| (format!("expect.{check}"), ok.to_string()));
    fixed.into_iter().chain(metrics).chain(expect).collect()
}

fn failure(written: u64, source: McapError) -> RecordError {
    match source {
        McapError::Io(source) => RecordError::Write { written, source },
        source => RecordError::Container {
            written,
            source: Box::new(source),
        },
    }
}

/// A stream that counts what goes into it, so that a failure can say how far it came.
struct Counted<W> {
    inner: W,
    written: Arc<AtomicU64>,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.written.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W: Seek> Seek for Counted<W> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.inner.seek(position)
    }
}
