//! What a recording carries of its run: enough to run it again, and its numbers.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use super::super::event::{GoalSample, LogLevel, PathSample};
use super::super::mcap_recorder::{FILES, RESULT, RUN, SCENARIO};
use super::super::protobuf::{Message, Schema};
use super::super::trace::{FollowedTrace, LogLine, Notice, PlanTrace, ScanTrace, Trace};
use super::super::wire::{Depth, Met, Record, Section, walk};
use super::super::{SCHEMA_VERSION, SourceFile, sha256_hex};
use super::{LogError, Problem, is_foreign};
use bikebot_geometry::Pose2;
use bikebot_world::{Cell, OccupancyGrid};

/// A run as its recording carries it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunSource {
    /// The scenario's text after overrides.
    pub scenario_text: String,
    /// The name of the scenario.
    pub scenario: String,
    /// The seed of all chance.
    pub seed: u64,
    /// Version of the program that made it: with another, bits may differ.
    pub version: String,
    /// What had been overridden, as `key.path=value`; already part of the text.
    pub overrides: Vec<String>,
    /// The files the scenario names, under the names it uses.
    pub files: Vec<SourceFile>,
    /// The record `bikebot.run`, all of it.
    pub run: BTreeMap<String, String>,
    /// How it ended then: the record `bikebot.result`, if it came to that.
    pub result: Option<BTreeMap<String, String>>,
}

impl RunSource {
    /// The content of a file the scenario names, by that name.
    #[must_use]
    pub fn file(&self, name: &str) -> Option<&[u8]> {
        let file = self.files.iter().find(|it| it.name == name)?;
        Some(&file.data)
    }
}

/// Reads from a recording what is needed to run it again, broken end or not.
///
/// # Errors
///
/// [`LogError::Missing`] for a file that is no recording of ours,
/// [`LogError::Unexpected`] where scenario and digest disagree or a number is none.
pub fn read_run<R: Read + Seek>(reader: &mut R) -> Result<RunSource, LogError> {
    let mut metadata = BTreeMap::new();
    let mut scenario = None;
    let mut files = Vec::new();
    let mut damage = None;
    // Attachments and metadata stand outside the chunks.
    walk(reader, Depth::WithoutChunks, &mut |_, met| {
        match met {
            Met::Fault(fault) if is_foreign(&fault) => return Err(LogError::NotMcap),
            Met::Fault(fault) => {
                damage.get_or_insert_with(|| Problem::from(&fault));
            }
            Met::Record(
                Section::Data,
                Record::Metadata {
                    name,
                    metadata: entries,
                },
            ) => {
                metadata.insert(name.to_owned(), entries);
            }
            Met::Record(Section::Data, Record::Attachment { name, data, .. }) => {
                if name == SCENARIO {
                    scenario = Some(data.to_vec());
                } else if let Some(name) = name.strip_prefix(FILES) {
                    files.push(SourceFile {
                        name: name.to_owned(),
                        data: data.to_vec(),
                    });
                }
            }
            Met::Record(..) => {}
        }
        Ok::<_, LogError>(true)
    })?;
    let missing = |what: &str| LogError::Missing {
        what: what.to_owned(),
        damage: damage.clone(),
    };
    let run: BTreeMap<_, _> = metadata.remove(RUN).ok_or_else(|| missing(RUN))?;
    let scenario = scenario.ok_or_else(|| missing(SCENARIO))?;
    let entry = |key: &str| {
        run.get(key)
            .cloned()
            .ok_or_else(|| missing(&format!("{RUN} {key}")))
    };
    let unexpected = |key: &str, found: &str, expected: String| LogError::Unexpected {
        record: format!("{RUN} {key}"),
        found: found.to_owned(),
        expected,
    };
    let schema = entry("schema_version")?;
    if schema != SCHEMA_VERSION.to_string() {
        let expected = format!("version {SCHEMA_VERSION}");
        return Err(unexpected("schema_version", &schema, expected));
    }
    let digest = entry("scenario_sha256")?;
    let found = sha256_hex(&scenario);
    if digest != found {
        return Err(unexpected("scenario_sha256", &digest, found));
    }
    let scenario_text = String::from_utf8(scenario)
        .map_err(|_| unexpected(SCENARIO, "other bytes", "UTF-8".to_owned()))?;
    let seed = entry("seed")?;
    let overrides = entry("overrides")?;
    Ok(RunSource {
        scenario_text,
        scenario: entry("scenario")?,
        seed: seed
            .parse()
            .map_err(|_| unexpected("seed", &seed, "a whole number".to_owned()))?,
        version: entry("version")?,
        overrides: overrides.lines().map(str::to_owned).collect(),
        files,
        result: metadata.remove(RESULT),
        run,
    })
}

/// The content of an attachment such as `plan.json`; of several with that name the last.
///
/// # Errors
///
/// [`LogError::Missing`] if there is none of that name.
pub fn read_attachment<R: Read + Seek>(reader: &mut R, wanted: &str) -> Result<Vec<u8>, LogError> {
    let (mut content, mut damage) = (None, None);
    walk(reader, Depth::WithoutChunks, &mut |_, met| {
        match met {
            Met::Fault(fault) if is_foreign(&fault) => return Err(LogError::NotMcap),
            Met::Fault(fault) => {
                damage.get_or_insert_with(|| Problem::from(&fault));
            }
            Met::Record(Section::Data, Record::Attachment { name, data, .. }) if name == wanted => {
                content = Some(data.to_vec());
            }
            Met::Record(..) => {}
        }
        Ok::<_, LogError>(true)
    })?;
    content.ok_or_else(|| LogError::Missing {
        what: format!("attachment {wanted}"),
        damage,
    })
}

/// Reads the numbers of a recording into `trace`, at the rates it was recorded
/// with; up to the first broken record of a broken file.
///
/// Scans are read only into [`Trace::with_scans`], beliefs into [`Trace::with_beliefs`]; what the bike looks like is not
/// in a file.
///
/// # Errors
///
/// [`LogError::NotMcap`], [`LogError::File`].
pub fn read_trace<R: Read + Seek>(reader: &mut R, trace: Trace) -> Result<Trace, LogError> {
    let mut numbers = Numbers {
        trace,
        ..Numbers::default()
    };
    walk(reader, Depth::All, &mut |_, met| {
        match met {
            Met::Fault(fault) if is_foreign(&fault) => return Err(LogError::NotMcap),
            Met::Fault(fault) => return Ok(!fault.fatal),
            Met::Record(Section::Data, record) => numbers.record(&record),
            Met::Record(Section::Summary, _) => return Ok(false),
        }
        Ok::<_, LogError>(true)
    })?;
    Ok(numbers.trace)
}

#[derive(Default)]
struct Numbers {
    trace: Trace,
    schemas: BTreeMap<u16, Schema>,
    /// Topic and schema of each channel.
    channels: BTreeMap<u16, (String, u16)>,
    /// The stages of the plan whose samples come next.
    stages: Stages,
}

#[derive(Default)]
struct Stages {
    tree: Vec<[[f64; 2]; 2]>,
    coarse: Vec<[f64; 2]>,
    guide: Vec<[f64; 2]>,
    corridor_half_width: Option<f64>,
    goal: Option<GoalSample>,
}

impl Numbers {
    fn record(&mut self, record: &Record<'_>) {
        match record {
            Record::Schema {
                id,
                name,
                encoding: "protobuf",
                data,
            } => {
                if let Ok(schema) = Schema::parse(name, data) {
                    self.schemas.insert(*id, schema);
                }
            }
            Record::Channel {
                id,
                schema_id,
                topic,
                ..
            } => {
                self.channels.insert(*id, ((*topic).to_owned(), *schema_id));
            }
            Record::Message {
                channel_id,
                log_time,
                data,
                ..
            } => {
                let Some((topic, schema_id)) = self.channels.get(channel_id) else {
                    return;
                };
                let Some(schema) = self.schemas.get(schema_id) else {
                    return;
                };
                let Ok(message) = schema.decode(data) else {
                    return;
                };
                let time_s = *log_time as f64 / 1e9;
                message_into(&mut self.trace, &mut self.stages, topic, time_s, &message);
            }
            _ => {}
        }
    }
}

fn message_into(
    trace: &mut Trace,
    stages: &mut Stages,
    topic: &str,
    time_s: f64,
    message: &Message<'_>,
) {
    let number = |name: &str| message.number(name);
    let text = |name: &str| message.text(name).unwrap_or_default().to_owned();
    match topic {
        "/bike/state" => trace.state.push_named(number),
        "/control/debug" => trace.control.push_named(number),
        "/plan/scene" => {
            for entity in message.messages("entities") {
                stages.read(entity);
            }
        }
        "/plan/samples" => {
            let stages = std::mem::take(stages);
            trace.plans.push(PlanTrace {
                time_s,
                path: path(message),
                tree: stages.tree,
                coarse: stages.coarse,
                guide: stages.guide,
                corridor_half_width: stages.corridor_half_width,
                goal: stages.goal,
            });
        }
        "/plan/followed" => trace.followed.push(FollowedTrace {
            time_s,
            path: path(message),
        }),
        "/events" => trace.notices.push(Notice {
            time_s,
            kind: text("kind"),
            text: text("text"),
            value: number("value").unwrap_or(0.0),
        }),
        "/log" => trace.lines.push(LogLine {
            time_s,
            level: match number("level").unwrap_or(0.0) as u8 {
                0 | 1 => LogLevel::Debug,
                2 => LogLevel::Info,
                3 => LogLevel::Warning,
                _ => LogLevel::Error,
            },
            text: text("message"),
        }),
        "/scan" if trace.keeps_scans() => {
            let ranges: Vec<f64> = message.numbers("ranges").collect();
            // A field that is zero is absent on the wire.
            let start_angle = number("start_angle").unwrap_or(0.0);
            let end_angle = number("end_angle").unwrap_or(0.0);
            let steps = ranges.len().saturating_sub(1).max(1) as f64;
            let stamp = message.messages("timestamp").next().map_or(time_s, |at| {
                at.number("seconds").unwrap_or(0.0) + at.number("nanos").unwrap_or(0.0) / 1e9
            });
            trace.scans.push(ScanTrace {
                time_s: stamp,
                start_angle,
                angle_step: (end_angle - start_angle) / steps,
                ranges,
            });
        }
        "/belief" => trace.push_belief(time_s, || grid(message)),
        "/map/occupancy" => trace.map = grid(message).or_else(|| trace.map.take()),
        _ => {}
    }
}

/// A grid of three-valued cells as it was sent; `None` if it is none.
fn grid(message: &Message<'_>) -> Option<OccupancyGrid> {
    let size = message.messages("cell_size").next()?.number("x")?;
    let width = message.number("column_count")? as usize;
    let data = message.bytes("data")?;
    let pose = message.messages("pose").next()?;
    let part = |of: &str, name: &str| {
        let inner = pose.messages(of).next();
        // A coordinate that is zero is absent on the wire.
        inner.and_then(|it| it.number(name)).unwrap_or(0.0)
    };
    let origin = Pose2::new(
        part("position", "x"),
        part("position", "y"),
        2.0 * part("orientation", "z").atan2(part("orientation", "w")),
    );
    let cells: Vec<Cell> = data
        .iter()
        .map(|value| match value {
            0 => Cell::Free,
            100 => Cell::Occupied,
            _ => Cell::Unknown,
        })
        .collect();
    let height = cells.len().checked_div(width)?;
    OccupancyGrid::new(width, height, size, origin, cells).ok()
}

/// A path from its columns, as long as the shortest of them.
fn path(table: &Message<'_>) -> Vec<PathSample> {
    let [mut x, mut y, mut heading, mut curvature, mut s, mut speed] = [
        "x_m",
        "y_m",
        "heading_rad",
        "curvature_per_m",
        "s_m",
        "speed_mps",
    ]
    .map(|name| table.numbers(name));
    let mut row = || {
        Some(PathSample {
            x: x.next()?,
            y: y.next()?,
            heading: heading.next()?,
            curvature: curvature.next()?,
            s: s.next()?,
            speed: speed.next()?,
        })
    };
    std::iter::from_fn(&mut row).collect()
}

impl Stages {
    /// Reads a picture of the plan back into its stage.
    fn read(&mut self, entity: &Message<'_>) {
        let points = || -> Vec<[f64; 2]> {
            entity
                .messages("lines")
                .flat_map(|line| line.messages("points"))
                // A coordinate that is zero is absent on the wire.
                .map(|it| ["x", "y"].map(|name| it.number(name).unwrap_or(0.0)))
                .collect()
        };
        let beside = |key: &str| {
            let pair = entity
                .messages("metadata")
                .find(|it| it.text("key") == Some(key))?;
            pair.text("value")?.parse().ok()
        };
        match entity.text("id") {
            Some("tree") => {
                let ends = points();
                self.tree = ends.chunks_exact(2).map(|it| [it[0], it[1]]).collect();
            }
            Some("coarse") => self.coarse = points(),
            Some("guide") => self.guide = points(),
            Some("corridor") => self.corridor_half_width = beside("half_width_m"),
            Some("goal") => {
                self.goal = (|| {
                    Some(GoalSample {
                        position: [beside("x_m")?, beside("y_m")?],
                        heading: beside("heading_rad"),
                        tolerance: beside("tolerance_m")?,
                    })
                })();
            }
            _ => {}
        }
    }
}
