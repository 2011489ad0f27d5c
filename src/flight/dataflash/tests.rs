use super::super::bytes::ends_between_messages;
use super::*;
use proptest::prelude::*;

fn fmt(number: u8, length: u8, name: &str, kinds: &str, names: &str) -> Vec<u8> {
    let mut bytes = vec![MAGIC[0], MAGIC[1], FMT, number, length];
    for (text, size) in [(name, 4), (kinds, 16), (names, 64)] {
        let mut field = text.as_bytes().to_vec();
        field.resize(size, 0);
        bytes.extend(field);
    }
    bytes
}

fn gyro(time_us: u64, instance: u8, rate: f32) -> Vec<u8> {
    let mut bytes = vec![MAGIC[0], MAGIC[1], 5];
    bytes.extend(time_us.to_le_bytes());
    bytes.push(instance);
    bytes.extend(rate.to_le_bytes());
    bytes.extend((-1234_i16).to_le_bytes());
    bytes
}

fn log() -> Vec<u8> {
    let mut bytes = fmt(FMT, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
    bytes.extend(fmt(5, 18, "IMU", "QBfc", "TimeUS,I,GyrX,Roll"));
    (0..20_u8).for_each(|k| bytes.extend(gyro(1000 * u64::from(k), k % 2, f32::from(k))));
    bytes
}

fn read(content: &[u8], description: &str) -> Result<(Vec<Stream>, Option<String>)> {
    streams(Path::new("a.bin"), content, &Schema::parse(description.as_bytes(), "dataset.toml")?)
}

#[test]
fn messages_and_their_instances_are_streams_and_hundredths_are_scaled() -> Result<()> {
    let (streams, damage) = read(&log(), "")?;
    assert_eq!((streams.len(), damage), (2, None));
    let names: Vec<&str> = streams[1].fields.iter().map(|field| field.0.as_str()).collect();
    assert_eq!(names, ["IMU[1].TimeUS", "IMU[1].I", "IMU[1].GyrX", "IMU[1].Roll"]);
    assert_eq!((streams[0].time_s[1], streams[0].fields[2].1[1], streams[0].fields[3].1[0]), (0.002, 2.0, -12.34));
    assert_eq!((half(0x3c00), half(0xc000), half(1)), (1.0, -2.0, 2.0_f64.powi(-24)));
    Ok(())
}

#[test]
fn every_truncation_is_an_error_with_its_place_or_stops_there() -> Result<()> {
    let whole = log();
    assert_eq!(ends_between_messages(&whole, |cut| read(cut, "")), 22 - 1);
    let (streams, damage) = read(&whole[..whole.len() - 1], "damaged = \"stop\"")?;
    assert_eq!(streams[0].time_s.len() + streams[1].time_s.len(), 19);
    assert!(damage.is_some_and(|note| note.contains("at byte")));
    Ok(())
}

#[test]
fn what_a_broken_file_holds_is_named() {
    let with = |more: Vec<u8>| [log(), more].concat();
    for (bytes, part) in [
        (with(vec![0, 0, 0, 0]), "begin no message"),
        (with(vec![MAGIC[0], MAGIC[1], 9, 0]), "unknown type 9"),
        (with(fmt(9, 18, "X", "QBfc", "TimeUS,I,GyrX")), "fewer names than fields"),
        (with(fmt(9, 18, "X", "QBfc", "TimeUS,I,GyrX,a,b")), "more names than"),
        (with(fmt(9, 200, "X", "QBfc", "TimeUS,I,GyrX,a")), "of 200 bytes, whose fields have 18"),
        (with(fmt(9, 18, "X", "Q?fc", "TimeUS,I,GyrX,a")), "unknown kind `?`"),
        (with(fmt(5, 11, "IMU", "Q", "TimeUS")), "a second layout"),
    ] {
        let refused = read(&bytes, "").map(|_| ()).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains(part) && text.contains("at byte")), "{refused:?}");
    }
}

proptest! {
    #[test]
    fn no_damage_panics(changes in prop::collection::vec((3_usize..2000, any::<u8>()), 1..40), length in 3_usize..2000) {
        let mut bytes = log();
        for (at, byte) in changes {
            let at = 3 + at % (bytes.len() - 3);
            bytes[at] = byte;
        }
        bytes.truncate(length);
        if let Ok((streams, _)) = read(&bytes, "damaged = \"stop\"") {
            prop_assert!(streams.iter().all(|stream| stream.fields.iter().all(|field| field.1.len() == stream.time_s.len())));
        }
    }
}
