//! What is in a recording.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use super::super::mcap_recorder::{HOST, RESULT, RUN};
use super::super::wire::{Depth, Met, Record, Section, walk};
use super::{LogError, Problem, is_foreign};
use crate::clock::SimTime;

/// One topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicInfo {
    /// Its name.
    pub name: String,
    /// Name of its schema; empty if it has none.
    pub schema: String,
    /// How the schema is written, such as `protobuf`.
    pub schema_encoding: String,
    /// How the messages are written.
    pub encoding: String,
    /// How many there are.
    pub messages: u64,
    /// Time of the first and the last.
    pub span: Option<(SimTime, SimTime)>,
}

/// One attachment of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AttachmentInfo {
    /// Its name.
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// Its size, bytes.
    pub bytes: u64,
}

/// What is in a recording, as far as it can be read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LogInfo {
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Profile of the file; ours is `bikebot`.
    pub profile: String,
    /// What wrote the file.
    pub library: String,
    /// Its topics, in the order of their channels.
    pub topics: Vec<TopicInfo>,
    /// How many messages there are.
    pub messages: u64,
    /// How many chunks they stand in.
    pub chunks: u64,
    /// Time of the first and the last message.
    pub span: Option<(SimTime, SimTime)>,
    /// Metadata records by name; of several with one name the last.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Attachments in order.
    pub attachments: Vec<AttachmentInfo>,
    /// Whether the file has a footer: its writer was finished.
    pub closed: bool,
    /// The first thing that is wrong with the file, if anything is.
    pub damage: Option<Problem>,
}

impl LogInfo {
    /// The topic of that name.
    #[must_use]
    pub fn topic(&self, name: &str) -> Option<&TopicInfo> {
        self.topics.iter().find(|it| it.name == name)
    }

    /// What the run is: the record `bikebot.run`.
    #[must_use]
    pub fn run(&self) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(RUN)
    }

    /// How the run ended: the record `bikebot.result`; absent if it did not.
    #[must_use]
    pub fn result(&self) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(RESULT)
    }

    /// What the host and its clock had to say: the record `bikebot.host`.
    #[must_use]
    pub fn host(&self) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(HOST)
    }
}

/// Says what is in a file, broken or not.
///
/// # Errors
///
/// [`LogError::NotMcap`], [`LogError::File`].
pub fn inspect<R: Read + Seek>(reader: &mut R) -> Result<LogInfo, LogError> {
    let mut census = Census::default();
    let bytes = walk(reader, Depth::All, &mut |_, met| {
        census.meet(&met)?;
        Ok::<_, LogError>(true)
    })?;
    Ok(census.finish(bytes))
}

/// Counts what a walk meets.
#[derive(Default)]
pub(super) struct Census {
    info: LogInfo,
    schemas: BTreeMap<u16, (String, String)>,
    channels: BTreeMap<u16, TopicInfo>,
    pub(super) metadata_records: u64,
}

impl Census {
    pub(super) fn meet(&mut self, met: &Met<'_>) -> Result<(), LogError> {
        let record = match met {
            Met::Fault(fault) if is_foreign(fault) => return Err(LogError::NotMcap),
            Met::Fault(fault) => {
                self.info.damage.get_or_insert_with(|| fault.into());
                return Ok(());
            }
            // The summary says nothing new, but the footer stands behind it.
            Met::Record(Section::Summary, Record::Footer { .. }) => {
                self.info.closed = true;
                return Ok(());
            }
            Met::Record(Section::Summary, _) => return Ok(()),
            Met::Record(Section::Data, record) => record,
        };
        match record {
            Record::Header { profile, library } => {
                self.info.profile = (*profile).to_owned();
                self.info.library = (*library).to_owned();
            }
            Record::Schema {
                id, name, encoding, ..
            } => {
                let names = ((*name).to_owned(), (*encoding).to_owned());
                self.schemas.insert(*id, names);
            }
            Record::Channel {
                id,
                schema_id,
                topic,
                encoding,
                ..
            } => {
                let (schema, schema_encoding) =
                    self.schemas.get(schema_id).cloned().unwrap_or_default();
                self.channels.entry(*id).or_insert_with(|| TopicInfo {
                    name: (*topic).to_owned(),
                    schema,
                    schema_encoding,
                    encoding: (*encoding).to_owned(),
                    messages: 0,
                    span: None,
                });
            }
            Record::Message {
                channel_id,
                log_time,
                ..
            } => {
                let time = SimTime::from_nanoseconds(*log_time);
                self.info.messages += 1;
                widen(&mut self.info.span, time);
                if let Some(topic) = self.channels.get_mut(channel_id) {
                    topic.messages += 1;
                    widen(&mut topic.span, time);
                }
            }
            Record::Chunk(_) => self.info.chunks += 1,
            Record::Attachment {
                name,
                media_type,
                data,
                ..
            } => self.info.attachments.push(AttachmentInfo {
                name: (*name).to_owned(),
                media_type: (*media_type).to_owned(),
                bytes: data.len() as u64,
            }),
            Record::Metadata { name, metadata } => {
                self.metadata_records += 1;
                self.info
                    .metadata
                    .insert((*name).to_owned(), metadata.clone());
            }
            Record::Footer { .. } => self.info.closed = true,
            Record::Statistics { .. } | Record::DataEnd { .. } | Record::Other => {}
        }
        Ok(())
    }

    pub(super) fn channel(&self, id: u16) -> Option<&TopicInfo> {
        self.channels.get(&id)
    }

    pub(super) fn info(&self) -> &LogInfo {
        &self.info
    }

    pub(super) fn channel_count(&self) -> usize {
        self.channels.len()
    }

    pub(super) fn finish(self, bytes: u64) -> LogInfo {
        LogInfo {
            bytes,
            topics: self.channels.into_values().collect(),
            ..self.info
        }
    }
}

fn widen(span: &mut Option<(SimTime, SimTime)>, time: SimTime) {
    *span = Some(match *span {
        None => (time, time),
        Some((first, last)) => (first.min(time), last.max(time)),
    });
}
