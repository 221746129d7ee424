//! The records of an MCAP file, and what is wrong with how they are packed.
//!
//! Chunks whose CRC-32 or packing is wrong are left out whole; what comes after them is found by their length and read.
//! The last chunk of a file that is cut off is read as far as it goes. Files joined end to end are read one after another.
//!
//! # References
//! MCAP format specification, <https://mcap.dev/spec>.

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError, parse_record};

/// Opcode and length before each record.
const HEADER_BYTES: usize = 9;

/// A record that claims more than this is damaged.
const MOST_BYTES: usize = 1 << 28;

/// What is found in a file, in its order.
#[derive(Debug)]
pub enum Item<'a> {
    /// A file begins; numbers of channels and schemas of the one before it mean nothing in it.
    File,
    Record(Record<'a>),
    /// Something is wrong here.
    Flaw(String),
}

/// Gives every record that is read to `each`; index and summary records are passed over.
pub fn read(bytes: &[u8], each: &mut dyn FnMut(Item<'_>)) {
    let mut rest = bytes;
    while let Some(file) = rest.strip_prefix(MAGIC) {
        each(Item::File);
        rest = one_file(file, each);
    }
    // the end's own mark may be cut off
    if !rest.is_empty() && !MAGIC.starts_with(rest) {
        each(Item::Flaw(format!("{} bytes after its end are no MCAP file, not read", rest.len())));
    }
}

/// Reads one file after its first mark; gives back what comes after its last.
fn one_file<'a>(mut bytes: &'a [u8], each: &mut dyn FnMut(Item<'_>)) -> &'a [u8] {
    let (mut ended, mut announced) = (false, false);
    loop {
        let at = bytes;
        // a recorder that broke off was started anew on the same file
        let Some((opcode, length)) = head(at).filter(|_| !at.starts_with(MAGIC)) else {
            if !ended {
                each(Item::Flaw("cut off before its end, read up to the break".into()));
            }
            return if at.starts_with(MAGIC) { at } else { &[] };
        };
        let body = usize::try_from(length).ok().and_then(|length| at[HEADER_BYTES..].get(..length));
        let Some(body) = body.filter(|_| opcode != 0) else {
            if opcode == op::CHUNK {
                // packed data is read up to the break
                let (records, _) = unpacked(at);
                records.into_iter().for_each(|record| each(Item::Record(record)));
            }
            if !ended {
                let what = if opcode == 0 { "no record has the number 0" } else { "a record ends beyond the file" };
                each(Item::Flaw(format!("damaged or cut off, read up to the break: {what}")));
            }
            return next_file(at);
        };
        bytes = &at[HEADER_BYTES + body.len()..];
        match opcode {
            op::CHUNK => match unpacked(&at[..HEADER_BYTES + body.len()]) {
                (records, None) => records.into_iter().for_each(|record| each(Item::Record(record))),
                (records, Some(_)) if !next_file(&at[..HEADER_BYTES + body.len()]).is_empty() => {
                    // the recorder broke off within it, and another file follows
                    records.into_iter().for_each(|record| each(Item::Record(record)));
                    each(Item::Flaw("cut off before its end, read up to the break".into()));
                    return next_file(at);
                }
                (_, Some(error)) => {
                    let why = match error {
                        McapError::BadChunkCrc { .. } => "its CRC-32 is wrong".to_owned(),
                        other => other.to_string(),
                    };
                    each(Item::Flaw(format!("damaged chunk left out: {why}")));
                    if !announced {
                        announce(bytes, each);
                        announced = true;
                    }
                }
            },
            op::FOOTER => return bytes.strip_prefix(MAGIC).unwrap_or(bytes),
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA | op::DATA_END => {
                ended |= opcode == op::DATA_END;
                match parse_record(opcode, body) {
                    Ok(record) => each(Item::Record(record)),
                    Err(error) => each(Item::Flaw(format!("damaged record left out: {error}"))),
                }
            }
            _ => {}
        }
    }
}

/// Opcode and length of the next record, if there are bytes of one.
fn head(bytes: &[u8]) -> Option<(u8, u64)> {
    let (head, _) = bytes.split_first_chunk::<HEADER_BYTES>()?;
    let [opcode, length @ ..] = head;
    Some((*opcode, u64::from_le_bytes(*length)))
}

/// Schemas and channels that the summary repeats: a chunk that is left out may have announced them.
fn announce(mut bytes: &[u8], each: &mut dyn FnMut(Item<'_>)) {
    while let Some((opcode, length)) = head(bytes) {
        let body = usize::try_from(length).ok().and_then(|length| bytes[HEADER_BYTES..].get(..length));
        let Some(body) = body else { return };
        if let (op::SCHEMA | op::CHANNEL, Ok(record)) = (opcode, parse_record(opcode, body)) {
            each(Item::Record(record));
        }
        if opcode == op::FOOTER {
            return;
        }
        bytes = &bytes[HEADER_BYTES + body.len()..];
    }
}

/// Where a file begins after damage; empty if none does.
fn next_file(bytes: &[u8]) -> &[u8] {
    let begins = |at: &[u8]| at.starts_with(MAGIC) && at.get(MAGIC.len()) == Some(&op::HEADER);
    let at = (1..bytes.len()).find(|&at| bytes[at] == MAGIC[0] && begins(&bytes[at..]));
    at.map_or(&[], |at| &bytes[at..])
}

/// The records of a chunk, given with its head, and why they are not all.
fn unpacked(mut chunk: &[u8]) -> (Vec<Record<'static>>, Option<McapError>) {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(MOST_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let (now, later) = chunk.split_at(wanted.min(chunk.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                chunk = later;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => match parse_record(opcode, data) {
                Ok(record) => records.push(record.into_owned()),
                Err(error) => return (records, Some(error)),
            },
            Err(error) => return (records, Some(error)),
        }
    }
    (records, None)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::recording::write::RecordingWriter;
    use crate::recording::{RadarDetection, ReadOptions, Recording, mcap as bag};

    /// A bag of so many frames, one point each; chunks as the crate writes them, packed or not.
    fn written(frames: i64, packed: bool) -> Vec<u8> {
        let blank = made_up::recording(1, 0);
        let mut writer = RecordingWriter::new(Cursor::new(Vec::new()), &blank.sensor, &blank.pose, 0).unwrap();
        for k in 0..frames {
            let d = |n: i64| RadarDetection {
                range_m: 20.0 + n as f32,
                azimuth_rad: 0.01 * k as f32,
                elevation_rad: Some(-0.05),
                radial_velocity_mps: 1.0,
                rcs_dbsm: Some(n as f32),
                snr_db: Some(20.0 + (k % 5) as f32),
            };
            let detections = (0..4).map(d).collect();
            let frame = super::super::Frame {
                time_ns: k * 66_000_000,
                detections,
                refused: 0,
                unwanted: Vec::new(),
                fault: false,
            };
            writer.frame(&frame).unwrap();
        }
        let bytes = writer.finish().unwrap().into_inner();
        if packed { bytes } else { repacked(&bytes, None) }
    }

    /// The same records in chunks of this many, or with none, unpacked.
    fn repacked(bytes: &[u8], chunk: Option<u64>) -> Vec<u8> {
        let options = ::mcap::WriteOptions::new().compression(None).use_chunks(chunk.is_some()).chunk_size(chunk);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        let (mut schemas, mut channels) = (std::collections::BTreeMap::new(), std::collections::BTreeMap::new());
        read(bytes, &mut |item| match item {
            Item::Record(Record::Schema { header, data }) => {
                schemas.insert(header.id, writer.add_schema(&header.name, &header.encoding, &data).unwrap());
            }
            Item::Record(Record::Channel(c)) => {
                let id = writer.add_channel(schemas[&c.schema_id], &c.topic, &c.message_encoding, &c.metadata);
                channels.insert(c.id, id.unwrap());
            }
            Item::Record(Record::Message { mut header, data }) => {
                header.channel_id = channels[&header.channel_id];
                writer.write_to_known_channel(&header, &data).unwrap();
            }
            Item::Record(Record::Metadata(m)) => writer.write_metadata(&m).unwrap(),
            _ => {}
        });
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }

    fn parsed(bytes: &[u8]) -> Result<Recording, String> {
        bag::parse(bytes, "a".into(), &ReadOptions::default()).map_err(|e| format!("{e:#}"))
    }

    fn said(recording: &Recording) -> String {
        recording.problems.iter().map(|p| p.to_string()).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_whole_file_says_nothing_however_it_is_packed() {
        let plain = written(60, true);
        for bytes in [plain.clone(), repacked(&plain, None), repacked(&plain, Some(2000))] {
            let recording = parsed(&bytes).unwrap();
            assert_eq!((recording.frames.len(), said(&recording).as_str()), (60, ""));
        }
    }

    #[test]
    fn a_chunk_whose_check_sum_is_wrong_is_left_out_and_told() {
        let bytes = repacked(&written(60, true), Some(2000));
        let last = bytes.len() / 2;
        // the value of a point, which nothing else would notice
        let at = (last..).find(|&at| bytes[at..].starts_with(&20.0_f32.to_le_bytes())).unwrap();
        let mut damaged = bytes;
        damaged[at + 3] ^= 1;
        let recording = parsed(&damaged).unwrap();
        assert!((40..60).contains(&recording.frames.len()), "{}", recording.frames.len());
        assert!(said(&recording).contains("damaged chunk left out: its CRC-32 is wrong (1x"), "{}", said(&recording));
        assert!(recording.frames.iter().flat_map(|f| &f.detections).all(|d| d.range_m >= 20.0 && d.range_m < 24.0));
    }

    #[test]
    fn a_first_chunk_that_is_damaged_takes_no_channel_with_it() {
        let mut bytes = repacked(&written(60, true), Some(2000));
        let at = bytes.windows(4).position(|w| w == 20.0_f32.to_le_bytes()).unwrap();
        bytes[at + 3] ^= 1;
        let options = ReadOptions { mount: Some([0.0, 0.0, 5.0, 0.0, 0.0, 0.0]), ..ReadOptions::default() };
        let recording = bag::parse(&bytes, "a".into(), &options).unwrap();
        assert!(recording.frames.len() > 30 && !said(&recording).contains("never announced"), "{}", said(&recording));
    }

    #[test]
    fn files_joined_end_to_end_are_read_one_after_another() {
        let one = written(60, true);
        let both = parsed(&[&one[..], &one[..]].concat()).unwrap();
        assert_eq!(both.frames, parsed(&one).unwrap().frames, "the same again adds nothing");
        assert!(said(&both).contains("two files joined") && said(&both).contains("repeats another"), "{}", said(&both));
        // a recorder that broke off and was started anew
        let broken = [&one[..one.len() / 2], &one[..]].concat();
        let recording = parsed(&broken).unwrap();
        assert_eq!(recording.frames.len(), 60);
        assert!(said(&recording).contains("up to the break"), "{}", said(&recording));
        let tail = parsed(&[&one[..], b"and more"].concat()).unwrap();
        assert!(said(&tail).contains("8 bytes after its end are no MCAP file"), "{}", said(&tail));
    }

    #[test]
    fn a_file_cut_off_is_read_up_to_the_break() {
        for whole in [written(60, true), written(60, false), repacked(&written(60, true), Some(2000))] {
            let mut most = 0;
            for cut in (MAGIC.len()..whole.len()).step_by(97) {
                let Ok(recording) = parsed(&whole[..cut]) else { continue };
                most = most.max(recording.frames.len());
                assert!(recording.frames.len() == 60 || said(&recording).contains("up to the break"), "{cut}");
            }
            assert_eq!(most, 60);
        }
    }

    #[test]
    fn changed_files_never_end_the_program() {
        let packed = written(12, true);
        let kept = [repacked(&packed, None), repacked(&packed, Some(1000)), packed];
        let changes = std::env::var("VIEWSHED_MCAP_CHANGES").ok().and_then(|n| n.parse().ok()).unwrap_or(1500);
        let mut state = 1_u64;
        let mut below = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as usize) % n.max(1)
        };
        let mut read = 0;
        for change in 0..changes {
            let mut bytes = kept[change % kept.len()].clone();
            for _ in 0..=below(6) {
                let at = below(bytes.len());
                let end = (at + 1 + below(16)).min(bytes.len());
                match below(6) {
                    0 => bytes[at] ^= 1 << below(8),
                    1 => bytes[at] = [0, 1, 127, 128, 254, 255][below(6)],
                    2 => bytes[at] = below(256) as u8,
                    3 => drop(bytes.drain(at..end)),
                    4 => {
                        let again = bytes[at..end].to_vec();
                        bytes.splice(at..at, again);
                    }
                    _ => {
                        let other = &kept[below(kept.len())];
                        bytes.truncate(at);
                        bytes.extend(&other[below(other.len() + 1)..]);
                    }
                }
                if bytes.is_empty() {
                    break;
                }
            }
            let _ = bag::radar_topics(&bytes);
            read += usize::from(parsed(&bytes).is_ok());
        }
        assert!(read * 10 > changes, "most changes are to reach the messages: {read} of {changes}");
    }
}
