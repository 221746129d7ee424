//! Files that are known and not read, and what to do with them.

use super::text;

const TRACE: &str = "convert it: `pip install python-can`, then `can_logconvert FILE.trc FILE.asc`";

/// Bytes at the start of a file, what it is, and what makes it readable.
const KNOWN: &[(&[u8], &str, &str)] = &[
    (
        b"#ROSBAG V",
        "a ROS 1 bag",
        "convert it: `pip install rosbags`, then `rosbags-convert --src FILE.bag --dst FOLDER --dst-storage mcap`",
    ),
    (b"rosbag2_bagfile_information", "the metadata of a ROS 2 bag", "name the .mcap beside it"),
    (
        b"LOGG",
        "a log of Vector (.blf)",
        "convert it: `pip install python-can`, then `can_logconvert FILE.blf FILE.asc`",
    ),
    (b"MDF     ", "a measurement of the MDF format (.mf4)", "export its bus as ASC"),
    (b";$FILEVERSION", "a trace of PCAN-View (.trc)", TRACE),
    (b"\xD4\xC3\xB2\xA1", "a capture of a network (pcap)", "of CAN: record with `candump -L can0` instead"),
    (b"\x0A\x0D\x0D\x0A", "a capture of a network (pcapng)", "of CAN: record with `candump -L can0` instead"),
    (b"\x89PNG", "a picture", "name the recording"),
    (b"\x1F\x8B", "packed twice", "unpack it with `gunzip`"),
    (b"PK\x03\x04", "a zip archive", "unpack it, and name a file of it"),
    (b"\x28\xB5\x2F\xFD", "packed with zstd", "unpack it with `unzstd`"),
    (b"BZh", "packed with bzip2", "unpack it with `bunzip2`"),
    (b"\xFD7zXZ\0", "packed with xz", "unpack it with `unxz`"),
    (b"\x5D\0\0", "packed with LZMA", "unpack it with `unlzma`"),
    (b"7z\xBC\xAF\x27\x1C", "a 7-Zip archive", "unpack it with `7z x`, and name a file of it"),
    (b"Rar!\x1A\x07", "a RAR archive", "unpack it, and name a file of it"),
    (b"\x04\x22\x4D\x18", "packed with lz4", "unpack it with `lz4 -d`"),
    (b"\x1F\x9D", "packed with compress", "unpack it with `uncompress`"),
    (b"\x89HDF", "an HDF5 file (of MATLAB, too)", "export its bus as a log of `candump -L` or as CSV of python-can"),
    (b"MATLAB 5.0", "a file of MATLAB", "export its bus as a log of `candump -L` or as CSV of python-can"),
    (b"\xD0\xCF\x11\xE0", "a document of Microsoft Office", "save the table as CSV"),
    (
        b"version https://git-lfs",
        "a pointer of Git LFS, which stands for the file",
        "fetch the file itself: `git lfs pull`",
    ),
    (b"***BUSMASTER", "a log of BUSMASTER", "convert it to ASC with its format converter, or record with `candump -L`"),
];

/// Bytes in which the first lines of a text are looked for.
const START: usize = 1 << 16;

/// Where a tar archive says that it is one.
const TAR: usize = 257;

/// What a text begins with, without letter case, what it is, and what makes it readable.
const KNOWN_TEXT: &[(&str, &str, &str)] = &[
    (
        "chn identifier flg",
        "a log of Kvaser CanKing (.txt)",
        "log in the Vector ASC format, or record with `candump -L`",
    ),
    ("<!doctype html", "a page of a web site", "download the file itself"),
    ("<html", "a page of a web site", "download the file itself"),
    ("<?xml", "XML", "trajectories of SUMO are for `viewshed simulate --fcd`"),
    ("line,abs time(sec)", "a CSV of Vehicle Spy", "save it as Vector ASC"),
    ("timestamp;type;id;data", "a CSV of a CL1000 or CL2000", "convert it to Vector ASC with its maker's tool"),
];

/// Of python-can's tables in SQLite, and of a ROS 2 bag's.
const OF_PYTHON_CAN: &[u8] = b"arbitration_id";
const OF_ROS: &[u8] = b"topic";

/// What a TI radar sends before each frame, as digits.
const TI_MAGIC: &str = "0201040306050807";

/// What a file is that is known and not read, and what to do; `None` where it is not known either.
pub fn named(bytes: &[u8]) -> Option<String> {
    if bytes.iter().all(|b| *b == 0) {
        let what = if bytes.is_empty() { "it is empty" } else { "it has nothing but zero bytes" };
        return Some(format!("{what}; record again"));
    }
    if let Some((_, what, remedy)) = KNOWN.iter().find(|(start, ..)| bytes.starts_with(start)) {
        return Some(format!("it is {what}; {remedy}"));
    }
    if bytes.starts_with(b"SQLite format 3\0") {
        return Some(format!("it is {}", of_sqlite(bytes)));
    }
    if bytes.get(TAR..).is_some_and(|rest| rest.starts_with(b"ustar")) {
        return Some("it is a tar archive; unpack it with `tar -x`, and name a file of it".into());
    }
    let start = begin(bytes);
    // a capture of bytes may begin with a brace by chance
    let text = !start.chars().any(|c| c == char::REPLACEMENT_CHARACTER || (c.is_control() && !c.is_whitespace()));
    if text && let Some((_, what, remedy)) = KNOWN.iter().find(|(known, ..)| start.as_bytes().starts_with(known)) {
        return Some(format!("it is {what}; {remedy}"));
    }
    if text && start.trim_start().starts_with(['{', '[']) && !has_magic_as_text(&start) {
        return Some("it is JSON; export it as MCAP, or as a log of `candump -L`".into());
    }
    let start = &start[..];
    if text {
        if let Some((_, what, remedy)) = KNOWN_TEXT.iter().find(|(begin, ..)| begins(start, begin)) {
            return Some(format!("it is {what}; {remedy}"));
        }
        if start.starts_with(';')
            && ["Generated by PCAN", ";---+--", "Start time:"].iter().any(|has| start.contains(has))
        {
            return Some(format!("it is a trace of PCAN-View (.trc); {TRACE}"));
        }
        if has_magic_as_text(start) {
            return Some(
                "it is a capture of a TI mmWave radar as text (hexadecimal or a list of numbers), and bytes are read; write what comes from the port to a file as it is, or turn pairs of digits into bytes with `xxd -r -p FILE NEW`".into(),
            );
        }
    }
    let first: Vec<&str> = start.lines().find(|line| !line.trim().is_empty())?.split_whitespace().collect();
    let length = |word: &str| word.strip_prefix('[').is_some_and(|word| word.ends_with(']'));
    let (interface, rest) = first.split_first()?;
    let is_date =
        interface.starts_with('(') && interface.contains('-') && rest.first().is_some_and(|t| t.contains(':'));
    if is_date && (rest.get(3).is_some_and(|word| length(word)) || rest.get(2).is_some_and(|word| word.contains('#'))) {
        return Some(
            "it is what `candump -t A` prints, in local time; record with `candump -L`, or print with `-t a`".into(),
        );
    }
    if rest.len() > 1 && length(rest[1]) {
        return Some("it is what `candump` prints without time stamps; record with `candump -L`".into());
    }
    None
}

/// The first lines of a text, whatever its encoding.
fn begin(bytes: &[u8]) -> String {
    let mut lines = text::Lines::new(&bytes[..bytes.len().min(START)]);
    let mut start = String::new();
    while start.len() < 4096
        && let Ok(Some(line)) = lines.next()
    {
        start += line;
        start.push('\n');
    }
    start
}

/// Whether a text begins so, whatever its spaces and letters.
fn begins(text: &str, begin: &str) -> bool {
    let mut words = text.split_whitespace();
    begin.split_whitespace().all(|part| {
        words.next().is_some_and(|word| word.get(..part.len()).is_some_and(|word| word.eq_ignore_ascii_case(part)))
    })
}

/// Which SQLite file it is, by the tables it announces at its begin.
fn of_sqlite(bytes: &[u8]) -> &'static str {
    let start = &bytes[..bytes.len().min(1 << 16)];
    let has = |what: &[u8]| start.windows(what.len()).any(|w| w == what);
    if has(OF_PYTHON_CAN) {
        "a log of python-can in SQLite (.db); convert it: `pip install python-can`, then `can_logconvert FILE.db FILE.asc`"
    } else if has(OF_ROS) {
        "a ROS 2 bag stored in SQLite (.db3); convert it: `ros2 bag convert` to storage mcap, or `rosbags-convert --src FOLDER --dst NEW --dst-storage mcap`"
    } else {
        "a database of SQLite; export its table as CSV, as python-can has it"
    }
}

/// Whether what a TI radar sends before each frame stands in a text: as `02 01 04 ...`, `0x02, 0x01, ...`, `0201 0403 ...`,
/// `b'\x02\x01...` or `[2, 1, 4, ...]`.
fn has_magic_as_text(text: &str) -> bool {
    if text.contains(r"\x02\x01\x04\x03\x06\x05\x08\x07") {
        return true;
    }
    let text = text.replace("0x", " ").replace("\\x", " ");
    let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let digits: String =
        words.map(|word| if word.len() % 2 == 1 { format!("0{word}") } else { word.to_owned() }).collect();
    digits.contains(TI_MAGIC)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_named_with_what_to_do() {
        for (bytes, what) in [
            (&b"#ROSBAG V2.0\n"[..], "ROS 1 bag; convert"),
            (b"SQLite format 3\0 CREATE TABLE topics(id, name)", "rosbags-convert"),
            (b"SQLite format 3\0 CREATE TABLE messages(ts REAL, arbitration_id INTEGER)", "can_logconvert FILE.db"),
            (b"SQLite format 3\0 CREATE TABLE frames(a)", "a database of SQLite"),
            (b"BZh91AY&SY", "bunzip2"),
            (b"\xFD7zXZ\0\0", "unxz"),
            (b"7z\xBC\xAF\x27\x1C", "7z x"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\n", "git lfs pull"),
            (b"***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n", "BUSMASTER"),
            (
                b";####\n;   C:\\trace.trc\n;   Start time: 24.11.2023\n;   Generated by PCAN-View\n",
                "can_logconvert FILE.trc",
            ),
            (b"Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir\n", "Kvaser"),
            (b"\xEF\xBB\xBF<!DOCTYPE html><p>404", "web site"),
            (b"\xEF\xBB\xBF***BUSMASTER Ver 3.2.2***\r\n", "BUSMASTER"),
            (b"\xFF\xFE*\0*\0*\0B\0U\0S\0M\0A\0S\0T\0E\0R\0 \0", "BUSMASTER"),
            (b"", "empty"),
            (b"\0\0\0", "zero bytes"),
            (b"(2020-06-05 15:46:52.436348) can0 60A#01C24910\n", "-t A"),
            (b"02 01 04 03 06 05 08 07 04 00", "as text"),
            (b"00000000: 0201 0403 0605 0807 0400 0503  ..", "as text"),
            (b"b'\\x02\\x01\\x04\\x03\\x06\\x05\\x08\\x07A\\x00'", "as text"),
            (b"0x02, 0x01, 0x04, 0x03, 0x06, 0x05, 0x08, 0x07,", "as text"),
            (b"0201040306050807040005", "as text"),
            (b"frame [2, 1, 4, 3, 6, 5, 8, 7, 65]\n", "as text"),
            (b"LOGG\x90", "can_logconvert"),
            (b";$FILEVERSION=1.1", "can_logconvert"),
            (b"  can0  60A   [4]  01 C2 49 10\n", "without time stamps; record with `candump -L`"),
            (b" (2020-06-05 15:46:52.436348)  can0  60A   [4]  01 C2 49 10\n", "-t A"),
            (b"{\"a\": 1}", "JSON"),
        ] {
            assert!(named(bytes).is_some_and(|text| text.contains(what)), "{what}: {:?}", named(bytes));
        }
        assert_eq!(named(b"{\x02\x01\x04\x03\xFF"), None);
        assert_eq!(named(b"time,x,y\n1,2,3\n"), None);
    }
}
