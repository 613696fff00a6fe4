//! Records of an MCAP file as bytes, read so that no file can do harm.
//!
//! The file is trusted with nothing: a length is believed only as far as the file
//! reaches and the limits below allow, and every field is looked up with bounds.
//! Unpacking of compressed chunks is left to the mcap crate, under the same limits.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Largest record that is read, bytes.
pub(crate) const RECORD_LIMIT: u64 = 128 * 1024 * 1024;

/// Largest chunk, packed and unpacked, bytes; ours hold a quarter of a MiB and a map.
const CHUNK_LIMIT: u64 = 64 * 1024 * 1024;

/// What all chunks together may unpack to, bytes: this much …
const UNPACKED_BASE: u64 = 256 * 1024 * 1024;
/// … and so many times the size of the file. Ours unpack to ten times theirs.
const UNPACKED_FACTOR: u64 = 500;

/// Length of an opcode and a length.
const RECORD_HEAD: u64 = 9;

/// Why a record cannot be read, in words.
pub(crate) type Broken = String;

/// A record, its fields borrowed from the bytes it was read from.
#[derive(Debug)]
pub(crate) enum Record<'a> {
    Header {
        profile: &'a str,
        library: &'a str,
    },
    Schema {
        id: u16,
        name: &'a str,
        encoding: &'a str,
        data: &'a [u8],
    },
    Channel {
        id: u16,
        schema_id: u16,
        topic: &'a str,
        encoding: &'a str,
        metadata: BTreeMap<String, String>,
    },
    Message {
        channel_id: u16,
        sequence: u32,
        log_time: u64,
        publish_time: u64,
        data: &'a [u8],
    },
    Chunk(Chunk<'a>),
    Attachment {
        log_time: u64,
        create_time: u64,
        name: &'a str,
        media_type: &'a str,
        data: &'a [u8],
    },
    Metadata {
        name: &'a str,
        metadata: BTreeMap<String, String>,
    },
    Statistics {
        message_count: u64,
        channel_count: u32,
        attachment_count: u32,
        metadata_count: u32,
        chunk_count: u32,
    },
    DataEnd {
        crc: u32,
    },
    Footer {
        summary_crc: u32,
    },
    /// Indexes, and whatever else there may be.
    Other,
}

/// The fields of a chunk record.
#[derive(Debug)]
pub(crate) struct Chunk<'a> {
    uncompressed_size: u64,
    uncompressed_crc: u32,
    compression: &'a str,
    records: &'a [u8],
    /// The whole body, for the reader that unpacks it.
    body: &'a [u8],
}

/// Reads fields off the front of some bytes.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: u64, what: &str) -> Result<&'a [u8], Broken> {
        let left = self.0.len();
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let Some((taken, rest)) = self.0.split_at_checked(count) else {
            return Err(format!("{what} takes {count} bytes where {left} are left"));
        };
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Broken> {
        let left = self.0.len();
        let Some((taken, rest)) = self.0.split_first_chunk::<N>() else {
            return Err(format!("{what} takes {N} bytes where {left} are left"));
        };
        self.0 = rest;
        Ok(*taken)
    }

    fn u16(&mut self, what: &str) -> Result<u16, Broken> {
        self.array(what).map(u16::from_le_bytes)
    }

    fn u32(&mut self, what: &str) -> Result<u32, Broken> {
        self.array(what).map(u32::from_le_bytes)
    }

    fn u64(&mut self, what: &str) -> Result<u64, Broken> {
        self.array(what).map(u64::from_le_bytes)
    }

    fn string(&mut self, what: &str) -> Result<&'a str, Broken> {
        let length = self.u32(what)?;
        let bytes = self.bytes(u64::from(length), what)?;
        std::str::from_utf8(bytes).map_err(|_| format!("{what} is not UTF-8"))
    }

    fn map(&mut self, what: &str) -> Result<BTreeMap<String, String>, Broken> {
        let length = self.u32(what)?;
        let mut entries = Fields(self.bytes(u64::from(length), what)?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            let key = entries.string(what)?.to_owned();
            let value = entries.string(what)?.to_owned();
            map.insert(key, value);
        }
        Ok(map)
    }
}

impl<'a> Record<'a> {
    /// Reads the body of a record.
    pub(crate) fn parse(opcode: u8, body: &'a [u8]) -> Result<Self, Broken> {
        let mut fields = Fields(body);
        let it = &mut fields;
        Ok(match opcode {
            op::HEADER => Self::Header {
                profile: it.string("profile")?,
                library: it.string("library")?,
            },
            op::SCHEMA => {
                let id = it.u16("schema id")?;
                let name = it.string("schema name")?;
                let encoding = it.string("schema encoding")?;
                let length = it.u32("schema data")?;
                let data = it.bytes(u64::from(length), "schema data")?;
                Self::Schema {
                    id,
                    name,
                    encoding,
                    data,
                }
            }
            op::CHANNEL => Self::Channel {
                id: it.u16("channel id")?,
                schema_id: it.u16("schema id")?,
                topic: it.string("topic")?,
                encoding: it.string("message encoding")?,
                metadata: it.map("channel metadata")?,
            },
            op::MESSAGE => Self::Message {
                channel_id: it.u16("channel id")?,
                sequence: it.u32("sequence")?,
                log_time: it.u64("log time")?,
                publish_time: it.u64("publish time")?,
                data: fields.0,
            },
            op::CHUNK => {
                it.u64("start time")?;
                it.u64("end time")?;
                let uncompressed_size = it.u64("uncompressed size")?;
                let uncompressed_crc = it.u32("uncompressed CRC")?;
                let compression = it.string("compression")?;
                let length = it.u64("chunk records")?;
                let records = it.bytes(length, "chunk records")?;
                Self::Chunk(Chunk {
                    uncompressed_size,
                    uncompressed_crc,
                    compression,
                    records,
                    body,
                })
            }
            op::ATTACHMENT => {
                let log_time = it.u64("log time")?;
                let create_time = it.u64("create time")?;
                let name = it.string("attachment name")?;
                let media_type = it.string("media type")?;
                let length = it.u64("attachment data")?;
                let data = it.bytes(length, "attachment data")?;
                let checked = body.len() - it.0.len();
                let saved = it.u32("attachment CRC")?;
                compare_crc("attachment", saved, crc32fast::hash(&body[..checked]))?;
                Self::Attachment {
                    log_time,
                    create_time,
                    name,
                    media_type,
                    data,
                }
            }
            op::METADATA => Self::Metadata {
                name: it.string("metadata name")?,
                metadata: it.map("metadata")?,
            },
            op::STATISTICS => {
                let message_count = it.u64("message count")?;
                it.u16("schema count")?;
                Self::Statistics {
                    message_count,
                    channel_count: it.u32("channel count")?,
                    attachment_count: it.u32("attachment count")?,
                    metadata_count: it.u32("metadata count")?,
                    chunk_count: it.u32("chunk count")?,
                }
            }
            op::DATA_END => Self::DataEnd {
                crc: it.u32("data section CRC")?,
            },
            op::FOOTER => {
                it.u64("summary start")?;
                it.u64("summary offset start")?;
                Self::Footer {
                    summary_crc: it.u32("summary CRC")?,
                }
            }
            _ => Self::Other,
        })
    }
}

/// Zero means that no CRC was written.
pub(crate) fn compare_crc(what: &str, saved: u32, calculated: u32) -> Result<(), Broken> {
    if saved == 0 || saved == calculated {
        Ok(())
    } else {
        Err(format!(
            "the CRC of the {what} is {calculated:08x}, the file says {saved:08x}"
        ))
    }
}

impl Chunk<'_> {
    /// Hands over the records inside, in order.
    ///
    /// The CRC is checked before the first of them.
    fn unpack(&self, visit: &mut dyn FnMut(u8, &[u8])) -> Result<(), Broken> {
        let largest = self.uncompressed_size.max(self.body.len() as u64);
        if largest > CHUNK_LIMIT {
            return Err(format!(
                "a chunk of {largest} bytes is more than the {CHUNK_LIMIT} read at once"
            ));
        }
        if self.compression.is_empty() {
            compare_crc(
                "chunk",
                self.uncompressed_crc,
                crc32fast::hash(self.records),
            )?;
            let mut inside = Fields(self.records);
            while !inside.0.is_empty() {
                let [opcode] = inside.array("opcode")?;
                let length = inside.u64("record length")?;
                visit(opcode, inside.bytes(length, "record in a chunk")?);
            }
            return Ok(());
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(CHUNK_LIMIT as usize);
        let mut reader = LinearReader::new_with_options(options);
        let head = (self.body.len() as u64).to_le_bytes();
        let opcode = [op::CHUNK];
        let mut source = (&opcode[..]).chain(&head[..]).chain(self.body);
        while let Some(event) = reader.next_event() {
            match event.map_err(|error| error.to_string())? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let read = source.read(reader.insert(wanted));
                    reader.notify_read(read.map_err(|error| error.to_string())?);
                }
                LinearReadEvent::Record { opcode, data } => visit(opcode, data),
            }
        }
        Ok(())
    }
}

/// A place in the file and what is wrong there.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) offset: u64,
    pub(crate) text: Broken,
    /// The bytes after it cannot be told apart into records.
    pub(crate) fatal: bool,
}

/// Where the walk is: data, the summary that repeats it, or behind the footer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Section {
    Data,
    Summary,
}

/// What a walk meets.
pub(crate) enum Met<'a> {
    /// A record, those inside a chunk under the offset of the chunk.
    Record(Section, Record<'a>),
    /// Something is wrong; the walk goes on unless it is fatal.
    Fault(Fault),
}

/// Which records a walk reads.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Depth {
    /// Everything.
    All,
    /// All but chunks, which are passed over unread (and no CRC of the whole is checked).
    WithoutChunks,
}

/// Walks through a file from its first byte to its last, handing over each record
/// with its offset; `Ok(false)` from the visitor ends the walk.
///
/// Memory stays below the largest record or chunk the limits allow. Fails only if
/// the file cannot be read; whatever is wrong with its content is a [`Fault`].
pub(crate) fn walk<R: Read + Seek, E: From<io::Error>>(
    reader: &mut R,
    depth: Depth,
    visit: &mut Visitor<'_, E>,
) -> Result<u64, E> {
    let end = reader.seek(SeekFrom::End(0))?;
    reader.seek(SeekFrom::Start(0))?;
    let mut offset = 0;
    let mut crc = crc32fast::Hasher::new();
    let magic = read_exactly(reader, (mcap::MAGIC.len() as u64).min(end))?;
    if magic != mcap::MAGIC {
        fault(
            0,
            "the file does not begin as an MCAP file".to_owned(),
            true,
            visit,
        )?;
        return Ok(end);
    }
    crc.update(&magic);
    offset += magic.len() as u64;
    let mut unpacked = 0u64;
    let unpacked_limit = UNPACKED_BASE.saturating_add(UNPACKED_FACTOR.saturating_mul(end));
    let mut section = Section::Data;
    loop {
        let left = end - offset;
        if left < RECORD_HEAD {
            let text = match left {
                0 => "the file ends without a footer".to_owned(),
                left => format!("the file ends {left} bytes into the head of a record"),
            };
            fault(offset, text, true, visit)?;
            return Ok(end);
        }
        let head = read_exactly(reader, RECORD_HEAD)?;
        let opcode = head[0];
        let mut length = [0; 8];
        length.copy_from_slice(&head[1..]);
        let length = u64::from_le_bytes(length);
        let left = left - RECORD_HEAD;
        if length > left {
            let text = format!("a record of {length} bytes where the file has {left} left");
            fault(offset, text, true, visit)?;
            return Ok(end);
        }
        let next = offset + RECORD_HEAD + length;
        if depth == Depth::WithoutChunks && opcode == op::CHUNK {
            reader.seek(SeekFrom::Start(next))?;
            offset = next;
            continue;
        }
        if length > RECORD_LIMIT {
            let text =
                format!("a record of {length} bytes is more than the {RECORD_LIMIT} read at once");
            fault(offset, text, true, visit)?;
            return Ok(end);
        }
        let body = read_exactly(reader, length)?;
        let record = match Record::parse(opcode, &body) {
            Ok(record) => record,
            Err(text) => {
                // Within its length a record is what it is; the next one begins after it.
                crc.update(&head);
                crc.update(&body);
                if !fault(offset, text, false, visit)? {
                    return Ok(end);
                }
                offset = next;
                continue;
            }
        };
        match &record {
            Record::DataEnd { crc: saved } => {
                let whole = std::mem::take(&mut crc).finalize();
                if depth == Depth::All
                    && let Err(text) = compare_crc("data section", *saved, whole)
                    && !fault(offset, text, false, visit)?
                {
                    return Ok(end);
                }
                section = Section::Summary;
            }
            Record::Footer { summary_crc } => {
                // The footer is covered up to its own CRC.
                crc.update(&head);
                crc.update(&body[..16]);
                let whole = std::mem::take(&mut crc).finalize();
                if let Err(text) = compare_crc("summary", *summary_crc, whole)
                    && !fault(offset, text, false, visit)?
                {
                    return Ok(end);
                }
                if !visit(offset, Met::Record(section, record))? {
                    return Ok(end);
                }
                let rest = read_exactly(reader, (end - next).min(mcap::MAGIC.len() as u64))?;
                let text = if rest != mcap::MAGIC {
                    "the file does not end as an MCAP file"
                } else if end - next > mcap::MAGIC.len() as u64 {
                    "there are bytes after the end of the recording"
                } else {
                    return Ok(end);
                };
                fault(next, text.to_owned(), true, visit)?;
                return Ok(end);
            }
            Record::Chunk(chunk) => {
                crc.update(&head);
                crc.update(&body);
                unpacked = unpacked.saturating_add(chunk.uncompressed_size);
                if unpacked > unpacked_limit {
                    let text = format!(
                        "chunks that unpack to more than {unpacked_limit} bytes are not opened"
                    );
                    fault(offset, text, true, visit)?;
                    return Ok(end);
                }
                let mut inner: Result<bool, E> = Ok(true);
                let opened = chunk.unpack(&mut |opcode, body| {
                    if !matches!(inner, Ok(true)) {
                        return;
                    }
                    inner = match Record::parse(opcode, body) {
                        Ok(record) => visit(offset, Met::Record(section, record)),
                        Err(text) => fault(offset, text, false, visit),
                    };
                });
                if !inner? {
                    return Ok(end);
                }
                if let Err(text) = opened
                    && !fault(offset, text, false, visit)?
                {
                    return Ok(end);
                }
                if !visit(offset, Met::Record(section, record))? {
                    return Ok(end);
                }
                offset = next;
                continue;
            }
            _ => {
                crc.update(&head);
                crc.update(&body);
            }
        }
        if !visit(offset, Met::Record(section, record))? {
            return Ok(end);
        }
        offset = next;
    }
}

/// Who is told what a walk meets, and says whether it goes on.
type Visitor<'v, E> = dyn FnMut(u64, Met<'_>) -> Result<bool, E> + 'v;

fn fault<E>(offset: u64, text: Broken, fatal: bool, visit: &mut Visitor<'_, E>) -> Result<bool, E> {
    let fault = Fault {
        offset,
        text,
        fatal,
    };
    visit(offset, Met::Fault(fault))
}

/// Reads so many bytes, which the file is known to have.
fn read_exactly<R: Read>(reader: &mut R, count: u64) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; count as usize];
    reader.read_exact(&mut bytes)?;
    Ok(bytes)
}
