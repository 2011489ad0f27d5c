//! What a ULog says of its topics: formats of named fields, which may be arrays or formats themselves, laid out flat.

use crate::flight::bytes::{float, signed, text, unsigned};
use std::collections::HashMap;

/// A message holds no more bytes than its size can say.
const MOST_BYTES: usize = 0xffff;
/// Formats within formats.
const MOST_DEPTH: usize = 8;
/// Fields that are looked at for all topics of a file, also such without a byte; a log of hours has some ten thousand.
const MOST_VISITS: usize = 500_000;
/// Characters of a field's name with those of what it is in.
const MOST_CHARACTERS: usize = 512;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Signed,
    Unsigned,
    Float,
    Text,
}

const KINDS: [(&str, Kind, usize); 12] = [
    ("int8_t", Kind::Signed, 1),
    ("uint8_t", Kind::Unsigned, 1),
    ("int16_t", Kind::Signed, 2),
    ("uint16_t", Kind::Unsigned, 2),
    ("int32_t", Kind::Signed, 4),
    ("uint32_t", Kind::Unsigned, 4),
    ("int64_t", Kind::Signed, 8),
    ("uint64_t", Kind::Unsigned, 8),
    ("float", Kind::Float, 4),
    ("double", Kind::Float, 8),
    ("bool", Kind::Unsigned, 1),
    ("char", Kind::Text, 1),
];

/// A number in a message: its name below the topic, and where it stands.
#[derive(Clone)]
pub(super) struct Leaf {
    pub name: String,
    offset: usize,
    kind: Kind,
    size: usize,
}

impl Leaf {
    pub fn is_number(&self) -> bool {
        self.kind != Kind::Text
    }

    pub fn is_time(&self) -> bool {
        self.kind == Kind::Unsigned && self.size == 8
    }

    /// `None` beyond the message's end, where padding may be missing.
    pub fn value(&self, body: &[u8]) -> Option<f64> {
        let bytes = body.get(self.offset..self.offset + self.size)?;
        Some(match self.kind {
            Kind::Signed => signed(bytes) as f64,
            Kind::Unsigned | Kind::Text => unsigned(bytes) as f64,
            Kind::Float => float(bytes),
        })
    }
}

struct Field {
    of: String,
    /// Elements of an array.
    count: Option<usize>,
    name: String,
}

/// Formats by name.
#[derive(Default)]
pub(super) struct Formats {
    by_name: HashMap<String, Vec<Field>>,
    visits: usize,
}

impl Formats {
    /// Takes in `name:type field;type[2] field;`.
    pub fn define(&mut self, body: &[u8]) -> Result<(), String> {
        let text = text(body);
        let (name, fields) = text.split_once(':').ok_or_else(|| "a format without a name".to_owned())?;
        let fields: Option<Vec<Field>> = fields.split(';').map(str::trim).filter(|field| !field.is_empty()).map(field).collect();
        let fields = fields.ok_or_else(|| format!("a format of `{name}` that is not `type field;`"))?;
        self.by_name.insert(name.to_owned(), fields);
        Ok(())
    }

    /// The numbers of a topic.
    pub fn leaves(&mut self, topic: &str) -> Result<Vec<Leaf>, String> {
        let mut flat = Flat { formats: &self.by_name, leaves: Vec::new(), size: 0, visits: self.visits };
        flat.format(topic, "", 0).map_err(|reason| format!("a topic `{topic}` with {reason}"))?;
        let Flat { leaves, visits, .. } = flat;
        self.visits = visits;
        Ok(leaves)
    }
}

fn field(text: &str) -> Option<Field> {
    let (of, name) = text.split_once(' ')?;
    let (of, count) = match of.split_once('[') {
        None => (of, None),
        Some((of, count)) => (of, Some(count.strip_suffix(']')?.parse().ok()?)),
    };
    Some(Field { of: of.to_owned(), count, name: name.trim().to_owned() })
}

struct Flat<'a> {
    formats: &'a HashMap<String, Vec<Field>>,
    leaves: Vec<Leaf>,
    size: usize,
    visits: usize,
}

impl Flat<'_> {
    fn format(&mut self, name: &str, prefix: &str, depth: usize) -> Result<(), String> {
        let formats = self.formats;
        let fields = formats.get(name).ok_or_else(|| format!("an unknown format `{name}`"))?;
        if depth > MOST_DEPTH {
            return Err(format!("formats more than {MOST_DEPTH} deep"));
        }
        for field in fields {
            for element in 0..field.count.unwrap_or(1) {
                self.visits += 1;
                if self.visits > MOST_VISITS {
                    return Err(format!("more than {MOST_VISITS} fields"));
                }
                let index = field.count.map_or(String::new(), |_| format!("[{element}]"));
                let full = format!("{prefix}{}{index}", field.name);
                if full.len() > MOST_CHARACTERS {
                    return Err(format!("a field whose name has more than {MOST_CHARACTERS} characters"));
                }
                match KINDS.iter().find(|kind| kind.0 == field.of) {
                    Some(&(_, kind, size)) => {
                        // Padding at the end may be missing; it has no use.
                        if !field.name.starts_with("_padding") {
                            self.leaves.push(Leaf { name: full, offset: self.size, kind, size });
                        }
                        self.size += size;
                    }
                    None => self.format(&field.of, &format!("{full}."), depth + 1)?,
                }
                if self.size > MOST_BYTES {
                    return Err(format!("more than {MOST_BYTES} bytes"));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_and_formats_within_formats_are_laid_out_flat() -> Result<(), String> {
        let mut formats = Formats::default();
        formats.define(b"point:float x;int16_t[2] n;")?;
        formats.define(b"topic:uint64_t timestamp;point[2] p;uint8_t[3] _padding0;bool on;")?;
        let leaves = formats.leaves("topic")?;
        let places: Vec<(&str, usize)> = leaves.iter().map(|leaf| (leaf.name.as_str(), leaf.offset)).collect();
        let expected = [("timestamp", 0), ("p[0].x", 8), ("p[0].n[0]", 12), ("p[0].n[1]", 14), ("p[1].x", 16)];
        assert_eq!(places[..5], expected);
        assert_eq!(places[7], ("on", 27));
        Ok(())
    }

    #[test]
    fn hostile_formats_end_soon() -> Result<(), String> {
        let mut formats = Formats::default();
        formats.define(b"loop:loop a;")?;
        formats.define(b"empty:")?;
        formats.define(b"many:empty[4000000000] a;")?;
        formats.define(b"large:float[4000000000] a;")?;
        formats.define(format!("named:float {};", "n".repeat(600)).as_bytes())?;
        for (topic, part) in
            [("loop", "deep"), ("named", "characters"), ("many", "fields"), ("large", "bytes"), ("none", "unknown format")]
        {
            assert!(matches!(formats.leaves(topic), Err(text) if text.contains(part)), "{topic}");
        }
        assert!(formats.define(b"a:float").is_err() && formats.define(b"a").is_err() && formats.define(b"a:float[x] y;").is_err());
        Ok(())
    }
}
