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
    while let Some(file) = rest.strip_prefix(&MAGIC[..]) {
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
            op::FOOTER => return bytes.strip_prefix(&MAGIC[..]).unwrap_or(bytes),
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
