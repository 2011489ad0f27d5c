use super::super::bytes::ends_between_messages;
use super::*;
use proptest::prelude::*;

fn message(kind: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = (body.len() as u16).to_le_bytes().to_vec();
    bytes.push(kind);
    bytes.extend(body);
    bytes
}

fn subscription(instance: u8, number: u16, topic: &str) -> Vec<u8> {
    let mut body = vec![instance];
    body.extend(number.to_le_bytes());
    body.extend(topic.as_bytes());
    message(b'A', &body)
}

fn sample(number: u16, time_us: u64, values: &[f32]) -> Vec<u8> {
    let mut body = number.to_le_bytes().to_vec();
    body.extend(time_us.to_le_bytes());
    values.iter().for_each(|value| body.extend(value.to_le_bytes()));
    message(b'D', &body)
}

fn head(appended: u64) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1; 9]);
    let mut flags = vec![0; FLAGS];
    flags[8] = u8::from(appended > 0);
    flags[16..24].copy_from_slice(&appended.to_le_bytes());
    bytes.extend(message(b'B', &flags));
    bytes
}

fn log() -> Vec<u8> {
    let mut bytes = head(0);
    bytes.extend(message(b'F', b"rate:uint64_t timestamp;float[2] xyz;"));
    bytes.extend(message(b'I', b"\x03a b1"));
    bytes.extend(subscription(0, 3, "rate"));
    bytes.extend(subscription(1, 4, "rate"));
    for k in 0..20_u16 {
        bytes.extend(sample(3 + k % 2, 1000 * u64::from(k), &[f32::from(k), 0.5]));
    }
    bytes
}

fn read(content: &[u8], description: &str) -> Result<(Vec<Stream>, Option<String>)> {
    streams(Path::new("a.ulg"), content, &Schema::parse(description.as_bytes(), "dataset.toml")?)
}

#[test]
fn topics_and_their_instances_are_streams() -> Result<()> {
    let (streams, damage) = read(&log(), "extra = [\"rate.xyz[0]\", \"rate[1].xyz[1]\"]")?;
    assert_eq!((streams.len(), damage), (2, None));
    assert_eq!((streams[0].name.as_str(), streams[0].fields[0].0.as_str()), ("rate", "rate.xyz[0]"));
    assert_eq!((streams[0].time_s[1], streams[0].fields[0].1[1]), (0.002, 2.0));
    assert_eq!((streams[1].name.as_str(), streams[1].fields[0].1[9]), ("rate[1]", 0.5));
    Ok(())
}

#[test]
fn every_truncation_is_an_error_with_its_place_or_stops_there() -> Result<()> {
    let whole = log();
    assert_eq!(ends_between_messages(&whole, |cut| read(cut, "")), 25 - 1);
    let (streams, damage) = read(&whole[..whole.len() - 1], "damaged = \"stop\"")?;
    assert_eq!(streams[0].time_s.len() + streams[1].time_s.len(), 19);
    assert!(damage.is_some_and(|note| note.contains("at byte")));
    Ok(())
}

#[test]
fn what_was_appended_after_a_crash_is_read_on() -> Result<()> {
    let mut bytes = head(1);
    bytes.extend(message(b'F', b"rate:uint64_t timestamp;float[2] xyz;"));
    bytes.extend(subscription(0, 3, "rate"));
    bytes.extend(sample(3, 1000, &[1.0, 0.0]));
    bytes.extend(&sample(3, 2000, &[2.0, 0.0])[..9]);
    let appended = bytes.len();
    bytes.extend(sample(3, 3000, &[3.0, 0.0]));
    // The offset stands behind head and flags before it.
    bytes[HEADER + 3 + 16..HEADER + 3 + 24].copy_from_slice(&(appended as u64).to_le_bytes());
    let (streams, _) = read(&bytes, "extra = [\"rate.xyz[0]\"]")?;
    assert_eq!(streams[0].fields[0].1, [1.0, 3.0]);
    bytes[HEADER + 3 + 16] = 1;
    bytes[HEADER + 3 + 17] = 0xff;
    assert!(read(&bytes, "").map(|_| ()).is_err_and(|error| error.to_string().contains("appended")));
    Ok(())
}

#[test]
fn what_a_newer_or_broken_file_holds_is_named() {
    let with = |more: Vec<u8>| [log(), more].concat();
    let mut newer = log();
    newer[HEADER + 3 + 8] = 2;
    for (bytes, part) in [
        (newer, "newer kind"),
        (with(sample(9, 0, &[])), "unknown topic number 9"),
        (with(subscription(0, 5, "none")), "unknown format `none`"),
        (with(message(b'F', b"x")), "a format without a name"),
        (with(vec![0, 0, 7]), "a message of the kind"),
        (with(sample(3, 0, &[1.0])), "fewer than its fields"),
    ] {
        let refused = read(&bytes, "").map(|_| ()).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains(part) && text.contains("at byte")), "{refused:?}");
    }
}

proptest! {
    #[test]
    fn no_damage_panics(changes in prop::collection::vec((0_usize..2000, any::<u8>()), 1..40), length in 0_usize..2000) {
        let mut bytes = log();
        for (at, byte) in changes {
            let at = at % bytes.len();
            bytes[at] = byte;
        }
        bytes.truncate(length.max(HEADER));
        if let Ok((streams, _)) = read(&bytes, "damaged = \"stop\"") {
            prop_assert!(streams.iter().all(|stream| stream.fields.iter().all(|field| field.1.len() == stream.time_s.len())));
        }
    }
}
