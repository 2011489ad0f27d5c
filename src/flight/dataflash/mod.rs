//! ArduPilot logs, DataFlash (`.bin`): messages whose layout the file states in messages `FMT`.
//!
//! Of a file the messages are read that the description names. Columns are `ATT.Roll`, those of a second sensor or filter core `IMU[1].GyrX`. Numbers
//! that are stored as hundredths, or a latitude as 10⁻⁷ degrees, are scaled. Time is that of the message, s since the start.
//! Source: ArduPilot, libraries/AP_Logger (LogStructure.h, README.md).

use super::bytes::{Bytes, float, signed, text, unsigned};
use super::format::{Format, Place, Reader};
use super::join::{Stream, Turn};
use super::schema::{Damaged, Schema};
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::path::Path;

/// DataFlash among the formats.
pub(super) const DATAFLASH: Format = Format {
    kind: "an ArduPilot log",
    place: Place::File("bin"),
    description: Some(include_str!("description.toml")),
    reader: Reader::Streams { parse: streams, turns: TURNS },
};

/// What turns in these messages.
const TURNS: &[(&str, Turn)] = &[
    ("ATT", Turn::Degrees(["Roll", "Pitch", "Yaw"])),
    ("XKF1", Turn::Degrees(["Roll", "Pitch", "Yaw"])),
    ("NKF1", Turn::Degrees(["Roll", "Pitch", "Yaw"])),
    ("XKQ", Turn::Quaternion(["Q1", "Q2", "Q3", "Q4"])),
    ("NKQ", Turn::Quaternion(["Q1", "Q2", "Q3", "Q4"])),
];

/// How each message begins, before the number of its type.
const MAGIC: [u8; 2] = [0xa3, 0x95];
/// The type that states the others.
const FMT: u8 = 128;
/// Type, length, name, kinds and names of the fields.
const FMT_BODY: usize = 1 + 1 + 4 + 16 + 64;

#[derive(Clone, Copy)]
enum Kind {
    Signed(f64),
    Unsigned(f64),
    Float,
    Half,
    Text,
}

/// A kind of field by its letter: what it is, with the factor to what it means, and its bytes.
fn kind(letter: u8) -> Option<(Kind, usize)> {
    Some(match letter {
        b'b' => (Kind::Signed(1.0), 1),
        b'B' | b'M' => (Kind::Unsigned(1.0), 1),
        b'h' => (Kind::Signed(1.0), 2),
        b'H' => (Kind::Unsigned(1.0), 2),
        b'i' => (Kind::Signed(1.0), 4),
        b'I' => (Kind::Unsigned(1.0), 4),
        b'q' => (Kind::Signed(1.0), 8),
        b'Q' => (Kind::Unsigned(1.0), 8),
        b'c' => (Kind::Signed(0.01), 2),
        b'C' => (Kind::Unsigned(0.01), 2),
        b'e' => (Kind::Signed(0.01), 4),
        b'E' => (Kind::Unsigned(0.01), 4),
        b'L' => (Kind::Signed(1e-7), 4),
        b'f' => (Kind::Float, 4),
        b'd' => (Kind::Float, 8),
        b'g' => (Kind::Half, 2),
        b'n' => (Kind::Text, 4),
        b'N' => (Kind::Text, 16),
        b'Z' => (Kind::Text, 64),
        // Thirty-two numbers of two bytes.
        b'a' => (Kind::Text, 64),
        _ => return None,
    })
}

#[derive(Clone)]
struct Field {
    name: String,
    offset: usize,
    kind: Kind,
    size: usize,
}

impl Field {
    /// The body has the message's length.
    fn value(&self, body: &[u8]) -> f64 {
        let bytes = &body[self.offset..self.offset + self.size];
        match self.kind {
            Kind::Signed(factor) => signed(bytes) as f64 * factor,
            Kind::Unsigned(factor) => unsigned(bytes) as f64 * factor,
            Kind::Float => float(bytes),
            Kind::Half => half(unsigned(bytes)),
            Kind::Text => f64::NAN,
        }
    }
}

/// A number of IEEE 754 in two bytes.
fn half(bits: u64) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = ((bits >> 10 & 0x1f) as i32, (bits & 0x3ff) as f64);
    sign * match exponent {
        0 => fraction * 2.0_f64.powi(-24),
        0x1f => return f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2.0_f64.powi(exponent - 15),
    }
}

/// A type of message.
#[derive(Clone)]
struct Layout {
    name: String,
    /// Without its head.
    length: usize,
    fields: Vec<Field>,
    /// What tells sensors or cores apart.
    instance: Option<Field>,
    /// With the factor to s.
    time: Option<(Field, f64)>,
    definition: Vec<u8>,
}

/// Understands the body of a message `FMT`.
fn layout(body: &[u8]) -> Result<Layout, String> {
    let name = text(&body[2..6]);
    let names = text(&body[22..FMT_BODY]);
    let kinds = body[6..22].iter().copied().take_while(|letter| *letter != 0);
    let names = names.split(',').map(str::trim).filter(|name| !name.is_empty());
    let (mut fields, mut length, mut count) = (Vec::new(), 0, 0);
    let mut names = names.fuse();
    for letter in kinds {
        let (kind, size) =
            kind(letter).ok_or_else(|| format!("a field of the unknown kind `{}` in `{name}`", letter.escape_ascii()))?;
        let own = names.next().ok_or_else(|| format!("fewer names than fields in `{name}`"))?;
        fields.push(Field { name: own.to_owned(), offset: length, kind, size });
        (length, count) = (length + size, count + 1);
    }
    if names.next().is_some() {
        return Err(format!("more names than the {count} fields in `{name}`"));
    }
    if usize::from(body[1]) != length + MAGIC.len() + 1 {
        return Err(format!("`{name}` of {} bytes, whose fields have {}", body[1], length + MAGIC.len() + 1));
    }
    let named = |wanted: &str| fields.iter().find(|field| field.name == wanted && matches!(field.kind, Kind::Unsigned(_))).cloned();
    let of_core = || named("C").filter(|_| name.starts_with("XK") || name.starts_with("NK"));
    let instance = named("I").or_else(|| named("Instance")).or_else(|| named("Inst")).or_else(of_core);
    let time = named("TimeUS").map(|field| (field, 1e-6)).or_else(|| named("TimeMS").map(|field| (field, 1e-3)));
    Ok(Layout { name, length, fields, instance, time, definition: body[1..].to_vec() })
}

/// Where the messages of a type and instance go: a stream and which of the fields, or nowhere.
type Destination = Option<(usize, Vec<Field>)>;

struct Parser<'a> {
    bytes: Bytes<'a>,
    schema: &'a Schema,
    layouts: Vec<Option<Layout>>,
    destinations: HashMap<(u8, u64), Destination>,
    streams: Vec<Stream>,
}

/// The streams that the description names, and a sentence about damage behind them.
///
/// # Errors
/// [`Error::Log`] for a file that is no DataFlash log, or is damaged (unless the description says to stop there).
fn streams(path: &Path, content: &[u8], schema: &Schema) -> Result<(Vec<Stream>, Option<String>)> {
    if !content.starts_with(&[MAGIC[0], MAGIC[1], FMT]) {
        let expected = "a DataFlash log, written by ArduPilot";
        return Err(super::table::fault(path, "a file that does not begin as an ArduPilot log", expected));
    }
    let mut parser = Parser {
        bytes: Bytes::new(path, content),
        schema,
        layouts: vec![None; 256],
        destinations: HashMap::new(),
        streams: Vec::new(),
    };
    match parser.file() {
        Ok(()) => Ok((parser.streams, None)),
        Err(Error::Log { found, .. }) if schema.damaged == Damaged::Stop && !parser.streams.is_empty() => {
            Ok((parser.streams, Some(format!("read up to where it is damaged, as dataset.toml says: {found}"))))
        }
        Err(error) => Err(error),
    }
}

impl Parser<'_> {
    fn file(&mut self) -> Result<()> {
        while !self.bytes.is_at_end() {
            let start = self.bytes.at();
            let head = self.bytes.take(MAGIC.len() + 1, "a message's head")?;
            if head[..2] != MAGIC {
                return Err(self.bytes.fault(start, "bytes that begin no message"));
            }
            let number = head[2];
            if number == FMT {
                let body = self.bytes.take(FMT_BODY, "a message `FMT`")?;
                self.define(body, start)?;
                continue;
            }
            let Some(layout) = &self.layouts[usize::from(number)] else {
                return Err(self.bytes.fault(start, format!("a message of the unknown type {number}")));
            };
            let body = self.bytes.take(layout.length, &format!("a message `{}`", layout.name))?;
            self.message(number, body);
        }
        Ok(())
    }

    fn define(&mut self, body: &[u8], start: usize) -> Result<()> {
        let number = body[0];
        let layout = layout(body).map_err(|found| self.bytes.fault(start, found))?;
        let known = &mut self.layouts[usize::from(number)];
        if known.as_ref().is_some_and(|known| known.definition != layout.definition) {
            let found = format!("a second layout of the type {number}, `{}`", layout.name);
            return Err(self.bytes.fault(start, found));
        }
        *known = Some(layout);
        Ok(())
    }

    fn message(&mut self, number: u8, body: &[u8]) {
        let Some(layout) = &self.layouts[usize::from(number)] else { return };
        let Some((stamp, factor)) = &layout.time else { return };
        let instance = layout.instance.as_ref().map_or(0, |field| field.value(body) as u64);
        let destination = self.destinations.entry((number, instance)).or_insert_with(|| {
            let name = if instance == 0 { layout.name.clone() } else { format!("{}[{instance}]", layout.name) };
            let is_wanted =
                |field: &&Field| !matches!(field.kind, Kind::Text) && self.schema.wants(&format!("{name}.{}", field.name));
            let wanted: Vec<Field> = layout.fields.iter().filter(is_wanted).cloned().collect();
            if wanted.is_empty() {
                return None;
            }
            let fields = wanted.iter().map(|field| (format!("{name}.{}", field.name), Vec::new())).collect();
            self.streams.push(Stream { name, time_s: Vec::new(), fields });
            Some((self.streams.len() - 1, wanted))
        });
        let Some((stream, fields)) = destination else { return };
        let stream = &mut self.streams[*stream];
        stream.time_s.push(stamp.value(body) * factor);
        stream.fields.iter_mut().zip(fields).for_each(|((_, column), field)| column.push(field.value(body)));
    }
}

#[cfg(test)]
mod tests;
