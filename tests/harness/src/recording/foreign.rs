//! Files that are known and not read, and what to do with them.

/// Bytes at the start of a file, what it is, and what makes it readable.
const KNOWN: &[(&[u8], &str, &str)] = &[
    (
        b"#ROSBAG V",
        "a ROS 1 bag",
        "convert it: `pip install rosbags`, then `rosbags-convert --src FILE.bag --dst FOLDER --dst-storage mcap`",
    ),
    (
        b"SQLite format 3\0",
        "a ROS 2 bag stored in SQLite (.db3)",
        "convert it: `ros2 bag convert` to storage mcap, or `rosbags-convert --src FOLDER --dst NEW --dst-storage mcap`",
    ),
    (b"rosbag2_bagfile_information", "the metadata of a ROS 2 bag", "name the .mcap beside it"),
    (
        b"LOGG",
        "a log of Vector (.blf)",
        "convert it: `pip install python-can`, then `can_logconvert FILE.blf FILE.asc`",
    ),
    (b"MDF     ", "a measurement of the MDF format (.mf4)", "export its bus as ASC"),
    (
        b";$FILEVERSION",
        "a trace of PCAN-View (.trc)",
        "convert it: `pip install python-can`, then `can_logconvert FILE.trc FILE.asc`",
    ),
    (b"\xD4\xC3\xB2\xA1", "a capture of a network (pcap)", "of CAN: record with `candump -L can0` instead"),
    (b"\x0A\x0D\x0D\x0A", "a capture of a network (pcapng)", "of CAN: record with `candump -L can0` instead"),
    (b"\x89PNG", "a picture", "name the recording"),
    (b"\x1F\x8B", "packed twice", "unpack it with `gunzip`"),
    (b"PK\x03\x04", "a zip archive", "unpack it, and name a file of it"),
    (b"\x28\xB5\x2F\xFD", "packed with zstd", "unpack it with `unzstd`"),
];

/// What a file is that is known and not read, and what to do; `None` where it is not known either.
pub fn named(bytes: &[u8]) -> Option<String> {
    if let Some((_, what, remedy)) = KNOWN.iter().find(|(start, ..)| bytes.starts_with(start)) {
        return Some(format!("it is {what}; {remedy}"));
    }
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    // a capture of bytes may begin with a brace by chance
    let text = !start.chars().any(|c| c == char::REPLACEMENT_CHARACTER || (c.is_control() && !c.is_whitespace()));
    if text && start.trim_start().starts_with(['{', '[']) {
        return Some("it is JSON; export it as MCAP, or as a log of `candump -L`".into());
    }
    let first: Vec<&str> = start.lines().find(|line| !line.trim().is_empty())?.split_whitespace().collect();
    let length = |word: &str| word.strip_prefix('[').is_some_and(|word| word.ends_with(']'));
    let (interface, rest) = first.split_first()?;
    if interface.starts_with('(') && rest.len() > 3 && length(rest[3]) && interface.contains('-') {
        return Some(
            "it is what `candump -t A` prints, in local time; record with `candump -L`, or print with `-t a`".into(),
        );
    }
    if rest.len() > 1 && length(rest[1]) {
        return Some("it is what `candump` prints without time stamps; record with `candump -L`".into());
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_named_with_what_to_do() {
        for (bytes, what) in [
            (&b"#ROSBAG V2.0\n"[..], "ROS 1 bag; convert"),
            (b"SQLite format 3\0rest", "rosbags-convert"),
            (b"LOGG\x90", "can_logconvert"),
            (b";$FILEVERSION=1.1", "can_logconvert"),
            (b"  can0  60A   [4]  01 C2 49 10\n", "without time stamps; record with `candump -L`"),
            (b" (2020-06-05 15:46:52.436348)  can0  60A   [4]  01 C2 49 10\n", "-t A"),
            (b"{\"a\": 1}", "JSON"),
        ] {
            assert!(named(bytes).is_some_and(|text| text.contains(what)), "{what}: {:?}", named(bytes));
        }
        assert_eq!(named(b"{\x02\x01\x04\x03\xFF"), None);
        assert_eq!((named(b"time,x,y\n1,2,3\n"), named(b"")), (None, None));
    }
}
