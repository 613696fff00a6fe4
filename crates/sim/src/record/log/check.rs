//! Is a recording whole? What is wrong with it, and where?

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Seek};
use std::rc::Rc;

use super::super::mcap_recorder::{RUN, SCENARIO};
use super::super::protobuf::{Message, Schema};
use super::super::sha256_hex;
use super::super::wire::{Depth, Met, Record, Section, walk};
use super::info::Census;
use super::{LogError, LogInfo, Problem};

/// Problems kept one by one; the rest are counted.
const PROBLEM_LIMIT: usize = 100;

/// What a check found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LogReport {
    /// What is in the file.
    pub info: LogInfo,
    /// What is wrong, in the order of the file; the first hundred.
    pub problems: Vec<Problem>,
    /// How much is wrong in all.
    pub problem_count: u64,
    /// Messages that were read and are what their schema says.
    pub decoded: u64,
    /// Messages in an encoding that is not known here; they were not looked into.
    pub not_decoded: u64,
}

impl LogReport {
    /// Nothing is wrong with the file.
    ///
    /// Whether the run in it came to its end is another matter: [`LogInfo::result`].
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.problem_count == 0
    }
}

/// Checks a file from its first byte to its last: magic, CRCs, every record and
/// every message against its schema, times that never go back, frames that hang
/// together, counts in the summary, the scenario against its digest.
///
/// # Errors
///
/// [`LogError::NotMcap`], [`LogError::File`]. A broken file is a report.
pub fn check<R: Read + Seek>(reader: &mut R) -> Result<LogReport, LogError> {
    let mut checker = Checker::default();
    let bytes = walk(reader, Depth::All, &mut |offset, met| {
        checker.census.meet(&met)?;
        match &met {
            Met::Fault(fault) => checker.problem(offset, fault.text.clone()),
            Met::Record(section, record) => checker.record(offset, *section, record),
        }
        Ok::<_, LogError>(true)
    })?;
    checker.frames_at_end();
    Ok(LogReport {
        info: checker.census.finish(bytes),
        problems: checker.problems,
        problem_count: checker.problem_count,
        decoded: checker.decoded,
        not_decoded: checker.not_decoded,
    })
}

#[derive(Default)]
struct Checker {
    census: Census,
    problems: Vec<Problem>,
    problem_count: u64,
    decoded: u64,
    not_decoded: u64,
    /// Schema ids in the file; with how to read their messages where that is known.
    schemas: BTreeMap<u16, Option<Rc<Schema>>>,
    channel_schemas: BTreeMap<u16, u16>,
    last_time: u64,
    /// Child frame → parent frame.
    frames: BTreeMap<String, String>,
    /// Frames that messages were given in before any transform named them.
    early_frames: BTreeMap<String, u64>,
}

impl Checker {
    fn problem(&mut self, offset: u64, text: String) {
        self.problem_count += 1;
        if self.problems.len() < PROBLEM_LIMIT {
            self.problems.push(Problem { offset, text });
        }
    }

    fn record(&mut self, offset: u64, section: Section, record: &Record<'_>) {
        match record {
            Record::Statistics { .. } => self.statistics(offset, record),
            _ if section == Section::Summary => {}
            Record::Schema {
                id,
                name,
                encoding,
                data,
            } => self.schema(offset, *id, name, encoding, data),
            Record::Channel {
                id,
                schema_id,
                topic,
                ..
            } => {
                self.channel_schemas.insert(*id, *schema_id);
                if *schema_id != 0 && !self.schemas.contains_key(schema_id) {
                    let text = format!("{topic} names schema {schema_id}, which is not defined");
                    self.problem(offset, text);
                }
            }
            Record::Message {
                channel_id,
                log_time,
                data,
                ..
            } => self.message(offset, *channel_id, *log_time, data),
            Record::Attachment {
                name: SCENARIO,
                data,
                ..
            } => self.scenario(offset, data),
            _ => {}
        }
    }

    fn schema(&mut self, offset: u64, id: u16, name: &str, encoding: &str, data: &[u8]) {
        let schema = match encoding {
            "protobuf" => Schema::parse(name, data)
                .map_err(|text| self.problem(offset, format!("schema {name}: {text}")))
                .ok(),
            _ => None,
        };
        self.schemas.insert(id, schema.map(Rc::new));
    }

    fn message(&mut self, offset: u64, channel_id: u16, log_time: u64, data: &[u8]) {
        let (topic, encoding) = match self.census.channel(channel_id) {
            Some(channel) => (channel.name.clone(), channel.encoding.clone()),
            None => {
                let text = format!("a message on channel {channel_id}, which is not defined");
                self.problem(offset, text);
                return;
            }
        };
        if log_time < self.last_time {
            let text = format!(
                "time goes back from {} ns to {log_time} ns on {topic}",
                self.last_time
            );
            self.problem(offset, text);
        }
        self.last_time = self.last_time.max(log_time);
        let schema_id = self.channel_schemas.get(&channel_id);
        let schema = schema_id.and_then(|id| self.schemas.get(id)?.clone());
        let wrong = match (encoding.as_str(), schema) {
            ("protobuf", Some(schema)) => match schema.decode(data) {
                Ok(message) => {
                    self.frames_of(offset, &message);
                    None
                }
                Err(text) => Some(text),
            },
            ("json", _) => serde_json::from_slice::<serde::de::IgnoredAny>(data)
                .err()
                .map(|it| it.to_string()),
            _ => {
                self.not_decoded += 1;
                return;
            }
        };
        match wrong {
            None => self.decoded += 1,
            Some(text) => self.problem(offset, format!("a message on {topic}: {text}")),
        }
    }

    /// Takes note of transforms, and of the frames a message is given in.
    fn frames_of(&mut self, offset: u64, message: &Message<'_>) {
        let single = std::iter::once(message);
        for transform in single.clone().chain(message.messages("transforms")) {
            let parent = transform.text("parent_frame_id");
            let child = transform.text("child_frame_id");
            if let (Some(parent), Some(child)) = (parent, child) {
                let known = self.frames.get(child);
                if known.is_some_and(|it| it != parent) {
                    let text = format!("frame {child} hangs on {parent} and on another frame");
                    self.problem(offset, text);
                } else if known.is_none() {
                    self.frames.insert(child.to_owned(), parent.to_owned());
                }
            }
        }
        for drawn in single.chain(message.messages("entities")) {
            if let Some(frame) = drawn.text("frame_id")
                && !self.frames.contains_key(frame)
                && !self.frames.values().any(|parent| parent == frame)
                && !self.early_frames.contains_key(frame)
            {
                self.early_frames.insert(frame.to_owned(), offset);
            }
        }
    }

    /// All frames hang on one root, and no message was given in a frame before a
    /// transform named it; the root itself needs none.
    fn frames_at_end(&mut self) {
        let mut roots = BTreeSet::new();
        for child in self.frames.keys() {
            let mut frame = child;
            // As many steps as there are frames, or it goes in a circle.
            let mut steps = self.frames.len();
            while let Some(parent) = self.frames.get(frame) {
                frame = parent;
                if steps == 0 {
                    break;
                }
                steps -= 1;
            }
            roots.insert(frame.clone());
        }
        let end = self.census.info().bytes;
        if roots.len() > 1 {
            let names: Vec<_> = roots.iter().map(String::as_str).collect();
            let text = format!("frames hang on several roots: {}", names.join(", "));
            self.problem(end, text);
        }
        if roots.is_empty() && self.early_frames.len() == 1 {
            return;
        }
        for (frame, offset) in std::mem::take(&mut self.early_frames) {
            if !roots.contains(&frame) {
                let text = format!("a message in frame {frame}, which no transform had named");
                self.problem(offset, text);
            }
        }
    }

    fn scenario(&mut self, offset: u64, data: &[u8]) {
        let run = self.census.info().metadata.get(RUN);
        let said = run.and_then(|it| it.get("scenario_sha256"));
        if said.is_some_and(|it| *it != sha256_hex(data)) {
            let text = format!("{SCENARIO} is not what {RUN} gives the digest of");
            self.problem(offset, text);
        }
    }

    fn statistics(&mut self, offset: u64, statistics: &Record<'_>) {
        let Record::Statistics {
            message_count,
            channel_count,
            attachment_count,
            metadata_count,
            chunk_count,
        } = *statistics
        else {
            return;
        };
        // What is missing from a broken file has been said already.
        if self.problem_count > 0 {
            return;
        }
        let info = self.census.info();
        let counts = [
            ("messages", message_count, info.messages),
            (
                "channels",
                u64::from(channel_count),
                self.census.channel_count() as u64,
            ),
            (
                "attachments",
                u64::from(attachment_count),
                info.attachments.len() as u64,
            ),
            (
                "metadata records",
                u64::from(metadata_count),
                self.census.metadata_records,
            ),
            ("chunks", u64::from(chunk_count), info.chunks),
        ];
        for (what, said, found) in counts {
            if said != found {
                self.problem(
                    offset,
                    format!("the summary counts {said} {what}, there are {found}"),
                );
            }
        }
    }
}
