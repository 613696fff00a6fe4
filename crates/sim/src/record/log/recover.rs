//! Saves what can be saved of a broken recording.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use mcap::Attachment;
use mcap::records::{MessageHeader, Metadata};

use super::super::mcap_recorder::write_options;
use super::super::wire::{Depth, Met, Record, Section, walk};
use super::check::{LogReport, check};
use super::{LogError, Problem, is_foreign};

/// Name of the metadata record that says that a file was recovered.
const RECOVERED: &str = "bikebot.recovered";

/// What was saved.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecoverReport {
    /// Where reading stopped and why; `None` if the file was whole. What stands
    /// behind that place is lost, unless it lies in the summary.
    pub stopped: Option<Problem>,
    /// Whether all messages were there, and only the summary was damaged if anything.
    pub nothing_lost: bool,
    /// Messages saved.
    pub messages: u64,
    /// Attachments saved.
    pub attachments: u64,
    /// Metadata records saved.
    pub metadata: u64,
    /// Size of the broken file, bytes.
    pub source_bytes: u64,
    /// The check of what was written, read back from `output`.
    pub written: LogReport,
}

/// Reads up to the first broken record, writes a whole file, and reads that back.
///
/// # Errors
///
/// [`LogError::NotMcap`], [`LogError::File`], [`LogError::Container`]. After an
/// error `output` holds nothing of use.
pub fn recover<R: Read + Seek, W: Read + Write + Seek>(
    input: &mut R,
    output: &mut W,
) -> Result<RecoverReport, LogError> {
    let mut report = write_what_is_there(input, output)?;
    output.flush()?;
    report.written = check(output)?;
    Ok(report)
}

/// All but the reading back.
fn write_what_is_there<R: Read + Seek, W: Write + Seek>(
    input: &mut R,
    output: &mut W,
) -> Result<RecoverReport, LogError> {
    let mut rescue = Rescue {
        writer: write_options().create(output)?,
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        report: RecoverReport::default(),
    };
    let source_bytes = walk(input, Depth::All, &mut |offset, met| {
        rescue.meet(offset, &met)
    })?;
    let Rescue {
        mut writer,
        mut report,
        ..
    } = rescue;
    report.source_bytes = source_bytes;
    if let Some(problem) = &report.stopped {
        writer.write_metadata(&Metadata {
            name: RECOVERED.to_owned(),
            metadata: BTreeMap::from([
                ("stopped_at_byte".to_owned(), problem.offset.to_string()),
                ("reason".to_owned(), problem.text.clone()),
                ("source_bytes".to_owned(), source_bytes.to_string()),
            ]),
        })?;
    }
    writer.finish()?;
    Ok(report)
}

struct Rescue<W: Write + Seek> {
    writer: mcap::Writer<W>,
    /// Ids in the broken file → ids in the new one.
    schemas: BTreeMap<u16, u16>,
    channels: BTreeMap<u16, u16>,
    report: RecoverReport,
}

impl<W: Write + Seek> Rescue<W> {
    /// `false` at the first thing that is broken.
    fn meet(&mut self, offset: u64, met: &Met<'_>) -> Result<bool, LogError> {
        let record = match met {
            Met::Fault(fault) if is_foreign(fault) => return Err(LogError::NotMcap),
            Met::Fault(fault) => {
                self.report.stopped = Some(fault.into());
                return Ok(false);
            }
            Met::Record(Section::Summary, _) => {
                self.report.nothing_lost = true;
                return Ok(true);
            }
            Met::Record(Section::Data, record) => record,
        };
        let mut broken = |text: String| {
            self.report.stopped = Some(Problem { offset, text });
            Ok(false)
        };
        match record {
            Record::Schema {
                id,
                name,
                encoding,
                data,
            } => {
                if *id == 0 {
                    return broken("a schema with id 0".to_owned());
                }
                let new = self.writer.add_schema(name, encoding, data)?;
                self.schemas.insert(*id, new);
            }
            Record::Channel {
                id,
                schema_id,
                topic,
                encoding,
                metadata,
            } => {
                let schema = match schema_id {
                    0 => Some(0),
                    known => self.schemas.get(known).copied(),
                };
                let Some(schema) = schema else {
                    return broken(format!(
                        "{topic} names schema {schema_id}, which is not defined"
                    ));
                };
                let new = self.writer.add_channel(schema, topic, encoding, metadata)?;
                self.channels.insert(*id, new);
            }
            Record::Message {
                channel_id,
                sequence,
                log_time,
                publish_time,
                data,
            } => {
                let Some(&channel_id) = self.channels.get(channel_id) else {
                    return broken(format!(
                        "a message on channel {channel_id}, which is not defined"
                    ));
                };
                let header = MessageHeader {
                    channel_id,
                    sequence: *sequence,
                    log_time: *log_time,
                    publish_time: *publish_time,
                };
                self.writer.write_to_known_channel(&header, data)?;
                self.report.messages += 1;
            }
            // The chunks of the new file are those of the old one.
            Record::Chunk(_) => self.writer.flush()?,
            Record::Attachment {
                log_time,
                create_time,
                name,
                media_type,
                data,
            } => {
                self.writer.attach(&Attachment {
                    log_time: *log_time,
                    create_time: *create_time,
                    name: (*name).to_owned(),
                    media_type: (*media_type).to_owned(),
                    data: (*data).into(),
                })?;
                self.report.attachments += 1;
            }
            Record::Metadata { name, metadata } => {
                self.writer.write_metadata(&Metadata {
                    name: (*name).to_owned(),
                    metadata: metadata.clone(),
                })?;
                self.report.metadata += 1;
            }
            Record::Header { .. }
            | Record::Statistics { .. }
            | Record::DataEnd { .. }
            | Record::Footer { .. }
            | Record::Other => {}
        }
        Ok(true)
    }
}
