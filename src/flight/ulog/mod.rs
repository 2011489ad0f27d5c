//! PX4 logs, ULog: topics at rates of their own, described within the file.
//!
//! Of a file the topics are read that the description names; parameters, texts and events are passed over. Time is that of the measurement
//! (`timestamp_sample`) where a topic has it, else that of the message. The first instance of a topic is `topic.field`, others are `topic[1].field`; an
//! element of an array is `topic.field[0]`. A file of our own reading rather than that of a crate: a log that is damaged has to be
//! refused with the place, not mended in silence. Source: PX4 user guide, "ULog File Format", version 1.

mod format;

use super::bytes::{Bytes, text, unsigned};
use super::format::{Format, Place, Reader};
use super::join::{Stream, Turn};
use super::schema::{Damaged, Schema};
use crate::error::{Error, Result};
use format::{Formats, Leaf};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// ULog among the formats.
pub(super) const ULOG: Format = Format {
    kind: "a PX4 log",
    place: Place::File("ulg"),
    description: Some(include_str!("description.toml")),
    reader: Reader::Streams { parse: streams, turns: TURNS },
};

/// What turns in these topics.
const TURNS: &[(&str, Turn)] = &[("vehicle_attitude", Turn::Quaternion(["q[0]", "q[1]", "q[2]", "q[3]"]))];

const MAGIC: &[u8] = b"ULog\x01\x125";
/// Magic, version and time of the start.
const HEADER: usize = 16;
/// Compatible and incompatible flags, and offsets of data that was appended after a crash.
const FLAGS: usize = 40;

/// A topic's instance as it is logged, by the number that its messages carry.
struct Subscription {
    topic: String,
    /// Its stream, where something of it is wanted, and which of its values go there.
    wanted: Option<(usize, Vec<Leaf>)>,
    /// Places of the two times.
    time: Leaf,
    sampled: Option<Leaf>,
}

struct Parser<'a> {
    bytes: Bytes<'a>,
    schema: &'a Schema,
    formats: Formats,
    subscriptions: HashMap<u64, Subscription>,
    streams: Vec<Stream>,
    by_name: BTreeMap<String, usize>,
    /// Where data was appended after a crash.
    appended: Vec<usize>,
}

/// The streams that the description names, and a sentence about damage behind them.
///
/// # Errors
/// [`Error::Log`] for a file that is no ULog, is damaged (unless the description says to stop there), or holds a newer kind of data.
fn streams(path: &Path, content: &[u8], schema: &Schema) -> Result<(Vec<Stream>, Option<String>)> {
    if !content.starts_with(MAGIC) || content.len() < HEADER {
        return Err(super::table::fault(path, "a file that does not begin as a PX4 log", "a ULog file, written by PX4"));
    }
    let mut parser = Parser {
        bytes: Bytes::new(path, content),
        schema,
        formats: Formats::default(),
        subscriptions: HashMap::new(),
        streams: Vec::new(),
        by_name: BTreeMap::new(),
        appended: Vec::new(),
    };
    match parser.file(content.len()) {
        Ok(()) => Ok((parser.streams, None)),
        Err(Error::Log { found, .. }) if schema.damaged == Damaged::Stop && !parser.streams.is_empty() => {
            Ok((parser.streams, Some(format!("read up to where it is damaged, as dataset.toml says: {found}"))))
        }
        Err(error) => Err(error),
    }
}

impl Parser<'_> {
    fn file(&mut self, length: usize) -> Result<()> {
        self.bytes.go(HEADER, length);
        self.flags(length)?;
        let mut starts = vec![self.bytes.at()];
        starts.extend(self.appended.clone());
        for (part, &start) in starts.iter().enumerate() {
            let end = starts.get(part + 1).copied().unwrap_or(length);
            self.bytes.go(start, end);
            let result = self.part();
            // A crash cut the message before what was appended.
            if end == length {
                result?;
            }
        }
        Ok(())
    }

    /// The flags, if they come first.
    fn flags(&mut self, length: usize) -> Result<()> {
        let start = self.bytes.at();
        if self.bytes.is_at_end() {
            return Err(self.bytes.fault(start, "a header and nothing behind it"));
        }
        let head = self.bytes.take(3, "a message's head")?;
        if head[2] != b'B' {
            self.bytes.go(start, length);
            return Ok(());
        }
        let flags = self.bytes.take(unsigned(&head[..2]) as usize, "the flags")?;
        if flags.len() < FLAGS {
            return Err(self.bytes.fault(start, format!("flags of {} bytes instead of {FLAGS}", flags.len())));
        }
        if flags[8] & !1 != 0 || flags[9..16].iter().any(|flag| *flag != 0) {
            return Err(self.bytes.fault(start, "flags of a newer kind of ULog, which cannot be read"));
        }
        for offset in flags[16..FLAGS].chunks(8).map(unsigned).filter(|offset| *offset != 0) {
            let least = self.appended.last().copied().unwrap_or(self.bytes.at());
            let offset = usize::try_from(offset).ok().filter(|offset| (least..=length).contains(offset));
            let outside = || self.bytes.fault(start, "data said to be appended at a place that is none");
            self.appended.push(offset.ok_or_else(outside)?);
        }
        Ok(())
    }

    fn part(&mut self) -> Result<()> {
        while !self.bytes.is_at_end() {
            let start = self.bytes.at();
            let head = self.bytes.take(3, "a message's head")?;
            let kind = char::from(head[2]);
            let body = self.bytes.take(unsigned(&head[..2]) as usize, &format!("a message `{}`", kind.escape_default()))?;
            match kind {
                'F' => self.formats.define(body).map_err(|found| self.bytes.fault(start, found))?,
                'A' => self.subscribe(body, start)?,
                'D' => self.data(body, start)?,
                // What is not known has to be passed over, but all kinds are letters.
                kind if kind.is_ascii_alphabetic() => {}
                kind => return Err(self.bytes.fault(start, format!("a message of the kind `{}`", kind.escape_default()))),
            }
        }
        Ok(())
    }

    fn subscribe(&mut self, body: &[u8], start: usize) -> Result<()> {
        let (Some(&instance), Some(number), Some(topic)) = (body.first(), body.get(1..3), body.get(3..)) else {
            return Err(self.bytes.fault(start, format!("a subscription of {} bytes", body.len())));
        };
        let topic = text(topic);
        let leaves = self.formats.leaves(&topic).map_err(|found| self.bytes.fault(start, found))?;
        let time = |name: &str| leaves.iter().find(|leaf| leaf.name == name && leaf.is_time()).cloned();
        let stamp = time("timestamp").ok_or_else(|| self.bytes.fault(start, format!("a topic `{topic}` without a `timestamp`")))?;
        let name = if instance == 0 { topic.clone() } else { format!("{topic}[{instance}]") };
        let sampled = time("timestamp_sample");
        let is_wanted = |leaf: &Leaf| leaf.is_number() && self.schema.wants(&format!("{name}.{}", leaf.name));
        let leaves: Vec<Leaf> = leaves.into_iter().filter(is_wanted).collect();
        let wanted = (!leaves.is_empty()).then(|| {
            let stream = *self.by_name.entry(name.clone()).or_insert_with(|| {
                let fields = leaves.iter().map(|leaf| (format!("{name}.{}", leaf.name), Vec::new())).collect();
                self.streams.push(Stream { name: name.clone(), time_s: Vec::new(), fields });
                self.streams.len() - 1
            });
            (stream, leaves)
        });
        if let Some((stream, leaves)) = &wanted
            && self.streams[*stream].fields.len() != leaves.len()
        {
            return Err(self.bytes.fault(start, format!("`{name}` with other fields than before")));
        }
        self.subscriptions.insert(unsigned(number), Subscription { topic, wanted, time: stamp, sampled });
        Ok(())
    }

    fn data(&mut self, body: &[u8], start: usize) -> Result<()> {
        let (number, body) = body.split_at(body.len().min(2));
        let Some(of) = self.subscriptions.get(&unsigned(number)) else {
            return Err(self.bytes.fault(start, format!("data of the unknown topic number {}", unsigned(number))));
        };
        let Some((stream, leaves)) = &of.wanted else { return Ok(()) };
        let short = || self.bytes.fault(start, format!("data of `{}` with {} bytes, fewer than its fields", of.topic, body.len()));
        let stream = &mut self.streams[*stream];
        let sampled = of.sampled.as_ref().and_then(|leaf| leaf.value(body)).filter(|time| *time > 0.0);
        let time_us = sampled.or_else(|| of.time.value(body)).ok_or_else(short)?;
        let values: Option<Vec<f64>> = leaves.iter().map(|leaf| leaf.value(body)).collect();
        let values = values.ok_or_else(short)?;
        stream.time_s.push(time_us * 1e-6);
        stream.fields.iter_mut().zip(values).for_each(|((_, column), value)| column.push(value));
        Ok(())
    }
}

#[cfg(test)]
mod tests;
