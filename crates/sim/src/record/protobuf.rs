//! Messages read by the schema that came with them.
//!
//! A recording carries the protobuf descriptors of all its messages. This reads
//! any of them without generated code: to check that each message is what its
//! schema says, and to find numbers and frames by name. Malformed bytes are an
//! error, never a panic; nesting is limited.

use std::collections::BTreeMap;

/// How deep messages may nest; ours need four levels.
const DEPTH_LIMIT: usize = 32;

/// Values one message may hold, against a few bytes that claim to be millions.
const VALUE_LIMIT: usize = 16 * 1024 * 1024;

/// Why bytes are not the message they should be.
pub(crate) type Malformed = String;

/// One value of a field.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value<'a> {
    /// Any number, flag or enumeration.
    Number(f64),
    Text(&'a str),
    Bytes(&'a [u8]),
    Message(Message<'a>),
}

/// A message with the names of its fields; absent ones are absent.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Message<'a> {
    fields: Vec<(&'a str, Value<'a>)>,
}

impl<'a> Message<'a> {
    /// The values of a field, in order; one for a field that does not repeat.
    pub(crate) fn all<'m>(&'m self, name: &'m str) -> impl Iterator<Item = &'m Value<'a>> {
        let named = self.fields.iter().filter(move |(it, _)| *it == name);
        named.map(|(_, value)| value)
    }

    /// The number in a field.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).last()
    }

    /// The numbers in a repeated field.
    pub(crate) fn numbers<'m>(&'m self, name: &'m str) -> impl Iterator<Item = f64> {
        self.all(name).filter_map(|value| match value {
            Value::Number(number) => Some(*number),
            _ => None,
        })
    }

    /// The text in a field.
    pub(crate) fn text(&self, name: &str) -> Option<&'a str> {
        self.all(name)
            .filter_map(|value| match value {
                Value::Text(text) => Some(*text),
                _ => None,
            })
            .last()
    }

    /// The bytes in a field.
    pub(crate) fn bytes(&self, name: &str) -> Option<&'a [u8]> {
        self.all(name)
            .filter_map(|value| match value {
                Value::Bytes(bytes) => Some(*bytes),
                _ => None,
            })
            .last()
    }

    /// The messages in a field.
    pub(crate) fn messages<'m>(&'m self, name: &'m str) -> impl Iterator<Item = &'m Message<'a>> {
        self.all(name).filter_map(|value| match value {
            Value::Message(message) => Some(message),
            _ => None,
        })
    }
}

/// The types of a schema, by full name.
#[derive(Debug, Clone)]
pub(crate) struct Schema {
    root: String,
    types: BTreeMap<String, BTreeMap<u64, Field>>,
}

#[derive(Debug, Clone)]
struct Field {
    name: String,
    kind: Kind,
}

/// How a field is written, from `FieldDescriptorProto.Type`.
#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Double,
    Float,
    Fixed64,
    Fixed32,
    SignedFixed64,
    SignedFixed32,
    /// Unsigned, flag, and enumeration.
    Varint,
    /// Two's complement in 64 bits.
    SignedVarint,
    ZigZag,
    Text,
    Bytes,
    Message(String),
}

/// A field as it stands in the bytes.
enum Raw<'a> {
    Varint(u64),
    Eight([u8; 8]),
    Four([u8; 4]),
    Delimited(&'a [u8]),
}

/// Takes the next field off the front: its number and content.
fn next_field<'a>(bytes: &mut &'a [u8]) -> Result<(u64, Raw<'a>), Malformed> {
    let tag = varint(bytes)?;
    let raw = match tag & 7 {
        0 => Raw::Varint(varint(bytes)?),
        1 => Raw::Eight(fixed(bytes)?),
        2 => {
            let length = usize::try_from(varint(bytes)?).unwrap_or(usize::MAX);
            let left = bytes.len();
            let Some((inside, rest)) = bytes.split_at_checked(length) else {
                return Err(format!("{length} bytes announced where {left} are left"));
            };
            *bytes = rest;
            Raw::Delimited(inside)
        }
        5 => Raw::Four(fixed(bytes)?),
        wire => return Err(format!("wire type {wire} does not exist")),
    };
    match tag >> 3 {
        0 => Err("a field with number 0".to_owned()),
        number => Ok((number, raw)),
    }
}

fn varint(bytes: &mut &[u8]) -> Result<u64, Malformed> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let Some((&byte, rest)) = bytes.split_first() else {
            return Err("a number is cut off".to_owned());
        };
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(value);
        }
    }
    Err("a number of more than 64 bits".to_owned())
}

fn fixed<const N: usize>(bytes: &mut &[u8]) -> Result<[u8; N], Malformed> {
    let Some((taken, rest)) = bytes.split_first_chunk::<N>() else {
        return Err("a number is cut off".to_owned());
    };
    *bytes = rest;
    Ok(*taken)
}

fn utf8(bytes: &[u8]) -> Result<&str, Malformed> {
    std::str::from_utf8(bytes).map_err(|_| "text that is not UTF-8".to_owned())
}

impl Schema {
    /// Reads a serialised `FileDescriptorSet` and picks the message of that name.
    pub(crate) fn parse(name: &str, mut set: &[u8]) -> Result<Self, Malformed> {
        let mut types = BTreeMap::new();
        while !set.is_empty() {
            if let (1, Raw::Delimited(file)) = next_field(&mut set)? {
                read_file(file, &mut types)?;
            }
        }
        let root = format!(".{name}");
        if !types.contains_key(&root) {
            return Err(format!("the schema does not define {name}"));
        }
        Ok(Self { root, types })
    }

    /// The names of the message's own fields.
    #[cfg(test)]
    pub(crate) fn fields(&self) -> Vec<String> {
        let fields = self.types[&self.root].values();
        fields.map(|it| it.name.clone()).collect()
    }

    /// Reads a message, checking that it is one.
    pub(crate) fn decode<'a>(&'a self, bytes: &'a [u8]) -> Result<Message<'a>, Malformed> {
        let mut budget = VALUE_LIMIT;
        self.message(&self.root, bytes, 0, &mut budget)
    }

    fn message<'a>(
        &'a self,
        name: &str,
        mut bytes: &'a [u8],
        depth: usize,
        budget: &mut usize,
    ) -> Result<Message<'a>, Malformed> {
        if depth > DEPTH_LIMIT {
            return Err(format!("messages nest more than {DEPTH_LIMIT} deep"));
        }
        let Some(known) = self.types.get(name) else {
            return Err(format!("the schema does not define {name}"));
        };
        let mut message = Message::default();
        while !bytes.is_empty() {
            let (number, raw) = next_field(&mut bytes)?;
            // A field added by a later version is passed over.
            let Some(field) = known.get(&number) else {
                continue;
            };
            let wrong = |it: Malformed| format!("{name}.{}: {it}", field.name);
            let mut push = |value| {
                *budget = budget
                    .checked_sub(1)
                    .ok_or_else(|| format!("more than {VALUE_LIMIT} values"))?;
                message.fields.push((field.name.as_str(), value));
                Ok::<_, Malformed>(())
            };
            match (&field.kind, raw) {
                (Kind::Text, Raw::Delimited(inside)) => {
                    push(Value::Text(utf8(inside).map_err(wrong)?))?;
                }
                (Kind::Bytes, Raw::Delimited(inside)) => push(Value::Bytes(inside))?,
                (Kind::Message(kind), Raw::Delimited(inside)) => {
                    let inner = self.message(kind, inside, depth + 1, budget)?;
                    message
                        .fields
                        .push((field.name.as_str(), Value::Message(inner)));
                }
                // Numbers that repeat may be packed one behind the other.
                (kind, Raw::Delimited(mut packed)) => {
                    while !packed.is_empty() {
                        let number = kind.take(&mut packed).map_err(wrong)?;
                        push(Value::Number(number))?;
                    }
                }
                (kind, raw) => push(Value::Number(kind.number(&raw).map_err(wrong)?))?,
            }
        }
        Ok(message)
    }
}

impl Kind {
    /// Takes one packed number off the front.
    fn take(&self, bytes: &mut &[u8]) -> Result<f64, Malformed> {
        let raw = match self {
            Self::Double | Self::Fixed64 | Self::SignedFixed64 => Raw::Eight(fixed(bytes)?),
            Self::Float | Self::Fixed32 | Self::SignedFixed32 => Raw::Four(fixed(bytes)?),
            _ => Raw::Varint(varint(bytes)?),
        };
        self.number(&raw)
    }

    /// The number that stands there, if this kind is written so.
    fn number(&self, raw: &Raw<'_>) -> Result<f64, Malformed> {
        Ok(match (self, raw) {
            (Self::Double, Raw::Eight(it)) => f64::from_le_bytes(*it),
            (Self::Fixed64, Raw::Eight(it)) => u64::from_le_bytes(*it) as f64,
            (Self::SignedFixed64, Raw::Eight(it)) => i64::from_le_bytes(*it) as f64,
            (Self::Float, Raw::Four(it)) => f64::from(f32::from_le_bytes(*it)),
            (Self::Fixed32, Raw::Four(it)) => f64::from(u32::from_le_bytes(*it)),
            (Self::SignedFixed32, Raw::Four(it)) => f64::from(i32::from_le_bytes(*it)),
            (Self::Varint, Raw::Varint(it)) => *it as f64,
            (Self::SignedVarint, Raw::Varint(it)) => *it as i64 as f64,
            (Self::ZigZag, Raw::Varint(it)) => ((it >> 1) as i64 ^ -((it & 1) as i64)) as f64,
            _ => return Err(format!("not written as {self:?} is")),
        })
    }
}

type Types = BTreeMap<String, BTreeMap<u64, Field>>;

/// `FileDescriptorProto`: package = 2, messages = 4.
fn read_file(mut file: &[u8], types: &mut Types) -> Result<(), Malformed> {
    let mut package = "";
    let mut messages = Vec::new();
    while !file.is_empty() {
        match next_field(&mut file)? {
            (2, Raw::Delimited(inside)) => package = utf8(inside)?,
            (4, Raw::Delimited(inside)) => messages.push(inside),
            _ => {}
        }
    }
    let scope = match package {
        "" => String::new(),
        package => format!(".{package}"),
    };
    messages
        .into_iter()
        .try_for_each(|message| read_type(message, &scope, 0, types))
}

/// `DescriptorProto`: name = 1, fields = 2, nested types = 3.
fn read_type(
    mut message: &[u8],
    scope: &str,
    depth: usize,
    types: &mut Types,
) -> Result<(), Malformed> {
    if depth > DEPTH_LIMIT {
        return Err(format!("types nest more than {DEPTH_LIMIT} deep"));
    }
    let mut name = "";
    let (mut fields, mut nested) = (Vec::new(), Vec::new());
    while !message.is_empty() {
        match next_field(&mut message)? {
            (1, Raw::Delimited(inside)) => name = utf8(inside)?,
            (2, Raw::Delimited(inside)) => fields.push(inside),
            (3, Raw::Delimited(inside)) => nested.push(inside),
            _ => {}
        }
    }
    let full = format!("{scope}.{name}");
    let fields = fields
        .into_iter()
        .map(|field| read_field(field, &full))
        .collect::<Result<_, _>>()?;
    for inner in nested {
        read_type(inner, &full, depth + 1, types)?;
    }
    types.insert(full, fields);
    Ok(())
}

/// `FieldDescriptorProto`: name = 1, number = 3, type = 5, type name = 6.
fn read_field(mut field: &[u8], scope: &str) -> Result<(u64, Field), Malformed> {
    let (mut name, mut type_name) = ("", "");
    let (mut number, mut kind) = (0, 0);
    while !field.is_empty() {
        match next_field(&mut field)? {
            (1, Raw::Delimited(inside)) => name = utf8(inside)?,
            (3, Raw::Varint(value)) => number = value,
            (5, Raw::Varint(value)) => kind = value,
            (6, Raw::Delimited(inside)) => type_name = utf8(inside)?,
            _ => {}
        }
    }
    let kind = match kind {
        1 => Kind::Double,
        2 => Kind::Float,
        3 | 5 => Kind::SignedVarint,
        4 | 8 | 13 | 14 => Kind::Varint,
        6 => Kind::Fixed64,
        7 => Kind::Fixed32,
        9 => Kind::Text,
        // A name without a leading dot is nested in the type that uses it.
        11 if type_name.starts_with('.') => Kind::Message(type_name.to_owned()),
        11 => Kind::Message(format!("{scope}.{type_name}")),
        12 => Kind::Bytes,
        15 => Kind::SignedFixed32,
        16 => Kind::SignedFixed64,
        17 | 18 => Kind::ZigZag,
        kind => {
            return Err(format!(
                "{scope}.{name} is of type {kind}, which is unknown"
            ));
        }
    };
    let name = name.to_owned();
    Ok((number, Field { name, kind }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::SimTime;
    use crate::record::event::{ControlDebug, ControlSample, RidePhase};
    use crate::record::messages::{frames, path_table};
    use crate::record::{BikeGeometry, PathSample, StateSample};
    use foxglove::Encode;
    use proptest::prelude::*;

    fn encoded<M: Encode>(message: &M) -> (Schema, Vec<u8>) {
        let schema = M::get_schema().unwrap();
        let mut bytes = Vec::new();
        message
            .encode(&mut bytes)
            .map_err(|it| it.to_string())
            .unwrap();
        (Schema::parse(&schema.name, &schema.data).unwrap(), bytes)
    }

    fn some_frames() -> (Schema, Vec<u8>) {
        let bike = BikeGeometry {
            wheelbase: 1.12,
            wheel_radius: 0.33,
            pivot_x: 0.3,
            pivot_height: 0.8,
            laser_position: [0.9, 0.0, 0.6],
            laser_yaw: 0.0,
            laser_pitch: 0.0,
            laser_is_level: false,
            footprint: Vec::new(),
        };
        let state = StateSample {
            x_m: 3.5,
            ..StateSample::default()
        };
        encoded(&frames(SimTime::from_seconds(1.25), &state, &bike))
    }

    #[test]
    fn reads_our_own_flat_messages_by_name() {
        let sample = ControlSample {
            lateral_error_m: -0.125,
            balancer_saturated: true,
            phase: RidePhase::Hold,
            ..ControlSample::default()
        };
        let message = ControlDebug::new(SimTime::from_seconds(2.0), &sample);
        let (schema, bytes) = encoded(&message);
        let read = schema.decode(&bytes).unwrap();
        assert_eq!(read.number("time_s"), Some(2.0));
        assert_eq!(read.number("lateral_error_m"), Some(-0.125));
        assert_eq!(read.number("balancer_saturated"), Some(1.0));
        assert_eq!(read.number("phase"), Some(3.0));
        assert!(read.number("rear_error_m").unwrap().is_nan());
        for name in ControlSample::FIELDS {
            assert!(read.number(name).is_some(), "{name}");
        }
    }

    #[test]
    fn reads_columns_and_nested_well_known_messages() {
        let path = [0.0, 1.0, 2.0].map(|s| PathSample {
            x: s,
            y: -s,
            heading: 0.0,
            curvature: 0.1,
            s,
            speed: 1.5,
        });
        let (schema, bytes) = encoded(&path_table(SimTime::ZERO, &path));
        let read = schema.decode(&bytes).unwrap();
        assert_eq!(read.numbers("y_m").collect::<Vec<_>>(), [0.0, -1.0, -2.0]);

        let (schema, bytes) = some_frames();
        let read = schema.decode(&bytes).unwrap();
        let first = read.messages("transforms").next().unwrap();
        assert_eq!(first.text("child_frame_id"), Some("base_link"));
        let position = first.messages("translation").next().unwrap();
        assert_eq!(position.number("x"), Some(3.5));
        let stamp = first.messages("timestamp").next().unwrap();
        assert_eq!(stamp.number("nanos"), Some(0.25e9));
    }

    #[test]
    fn a_cut_or_wrongly_written_message_is_an_error() {
        let (schema, bytes) = some_frames();
        let whole = schema.decode(&bytes).unwrap();
        for cut in 1..bytes.len() {
            // A cut between two fields is a shorter message; never the same one.
            assert_ne!(schema.decode(&bytes[..cut]).as_ref(), Ok(&whole));
        }
        // transforms as a number instead of a message.
        assert!(schema.decode(&[0x08, 0x01]).is_err());
        assert!(schema.decode(&[0x0b]).is_err());
        assert!(Schema::parse("foxglove.Nothing", &[]).is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..300),
            at in 0usize..400,
            byte: u8,
        ) {
            let (schema, mut message) = some_frames();
            let _ = schema.decode(&bytes);
            let _ = Schema::parse("a.B", &bytes);
            let index = at % message.len();
            message[index] = byte;
            let _ = schema.decode(&message);
            let known = foxglove::messages::SceneUpdate::get_schema().unwrap();
            let mut descriptor = known.data.to_vec();
            let index = at * 37 % descriptor.len();
            descriptor[index] = byte;
            if let Ok(schema) = Schema::parse(&known.name, &descriptor) {
                let _ = schema.decode(&bytes);
            }
        }
    }
}
