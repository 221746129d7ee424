//! One log in every way that tools write it, in every order they leave it: always the same scans.

use std::fmt::Write;

use viewshed::wire::frame::CanId;

use super::ars408;
use super::can_log::log::find;
use super::can_log::{Content, Line, candump};
use super::file::Source;
use super::{Frame, ReadOptions, Recording};

const LOG: &str = include_str!("../../../recordings/ars408-made-up.log");

fn lines() -> Vec<Line> {
    LOG.lines().map(|line| candump::line(line).unwrap()).collect()
}

fn read(bytes: &[u8]) -> Result<Recording, String> {
    let options = ReadOptions { sensor_id: Some(0), ..ReadOptions::default() };
    let found = find(&Source::of_bytes(bytes)).unwrap().ok_or("no log")?;
    ars408::read("log", &found, &options, None).map(|(recording, _)| recording).map_err(|error| error.to_string())
}

/// Times since the first, microseconds, and detections.
fn scans(recording: &Recording) -> Vec<(i64, &Frame)> {
    let start = recording.frames[0].time_ns;
    recording.frames.iter().map(|frame| ((frame.time_ns - start) / 1000, frame)).collect()
}

#[track_caller]
fn same(what: &str, bytes: &[u8], expected: &Recording) -> Recording {
    let recording = read(bytes).unwrap_or_else(|error| panic!("{what}: {error}"));
    let (found, expected) = (scans(&recording), scans(expected));
    assert_eq!(found.len(), expected.len(), "{what}");
    for ((time, frame), (expected_time, expected_frame)) in found.iter().zip(&expected) {
        assert!(time.abs_diff(*expected_time) <= 2, "{what}: {time} {expected_time}");
        assert_eq!(frame.detections, expected_frame.detections, "{what}");
    }
    recording
}

fn decimal(ns: i64, digits: u32, comma: bool) -> String {
    let unit = 10_i64.pow(9 - digits);
    let (sign, value) = (if ns < 0 { "-" } else { "" }, ns.unsigned_abs() / unit.unsigned_abs());
    let one = 10_u64.pow(digits);
    let point = if comma { ',' } else { '.' };
    let width = digits as usize;
    format!("{sign}{}{point}{:0width$}", value / one, value % one)
}

/// Each line as a tool writes it, with its headings.
struct Tool {
    name: &'static str,
    head: &'static str,
    line: fn(&Line, &str) -> String,
    /// Digits after the point; none where times are whole microseconds.
    digits: Option<u32>,
}

fn id(line: &Line, upper: bool) -> String {
    match line.frame().unwrap().id {
        CanId::Standard(raw) if upper => format!("{raw:03X}"),
        CanId::Standard(raw) => format!("{raw:x}"),
        CanId::Extended(raw) => format!("{raw:08X}"),
    }
}

fn data(line: &Line, between: &str, radix: u32) -> String {
    let byte = |b: &u8| if radix == 16 { format!("{b:02X}") } else { b.to_string() };
    line.frame().unwrap().data().iter().map(byte).collect::<Vec<_>>().join(between)
}

fn count(line: &Line) -> usize {
    line.frame().unwrap().data().len()
}

const TOOLS: [Tool; 9] = [
    Tool {
        name: "candump -L",
        head: "",
        line: |line, time| format!("({time}) can0 {}#{}", id(line, true), data(line, "", 16)),
        digits: Some(6),
    },
    Tool {
        name: "candump -L, marked as CAN FD",
        head: "",
        line: |line, time| format!("({time}) can0 {}##0{}", id(line, true), data(line, "", 16)),
        digits: Some(6),
    },
    Tool {
        name: "candump",
        head: "",
        line: |line, time| format!(" ({time})  can0  {}   [{}]  {}", id(line, true), count(line), data(line, " ", 16)),
        digits: Some(6),
    },
    Tool {
        name: "ASC",
        head: "date x\nbase hex  timestamps absolute\n0.000000 Start of measurement\n",
        line: |line, time| format!("  {time} 1  {}  Rx  d {} {}", id(line, true), count(line), data(line, " ", 16)),
        digits: Some(6),
    },
    Tool {
        name: "ASC of a logger, decimal",
        head: "date x\n  Base Dec  timestamps absolute\n",
        line: |line, time| {
            format!("{time} 1 {} Rx D {} {}", line.frame().unwrap().id.raw(), count(line), data(line, "  ", 10))
        },
        digits: Some(6),
    },
    Tool {
        name: "ASC with names",
        head: "date x\nbase hex  timestamps absolute\n",
        line: |line, time| {
            let (count, bytes, id) = (count(line), data(line, " ", 16), line.frame().unwrap().id.raw());
            format!("{time} 1 Add Rx d {count} {bytes} Length = 222000 BitCount = 114 ID = {id}")
        },
        digits: Some(6),
    },
    Tool {
        name: "SavvyCAN",
        head: "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n",
        line: |line, time| format!("{time},{:0>8},false,Rx,0,{},{}", id(line, true), count(line), data(line, ",", 16)),
        digits: None,
    },
    Tool {
        name: "SavvyCAN of a spreadsheet",
        head: "Time Stamp;ID;Extended;Dir;Bus;LEN;D1;D2;D3;D4;D5;D6;D7;D8\n",
        line: |line, time| {
            format!("{time};{};FALSE;Rx;0;{};{}", id(line, true), count(line), data(line, ";", 16).replace(";0", ";"))
                .replace(";;", ";0;")
                .replace(";;", ";0;")
                .trim_end_matches(';')
                .to_owned()
                + ";0"
        },
        digits: None,
    },
    Tool {
        name: "python-can",
        head: "timestamp;arbitration_id;extended;remote;error;dlc;data\n",
        line: |line, time| {
            use base64::Engine;
            let bytes = base64::engine::general_purpose::STANDARD.encode(line.frame().unwrap().data());
            format!("{time};0x{};0;0;0;{};{bytes}", id(line, false), count(line))
        },
        digits: Some(6),
    },
];

fn text(tool: &Tool, lines: &[Line], comma: bool) -> String {
    let mut text = tool.head.to_owned();
    for line in lines {
        let time = tool.digits.map_or_else(|| (line.time_ns / 1000).to_string(), |n| decimal(line.time_ns, n, comma));
        let _ = writeln!(text, "{}", (tool.line)(line, &time));
    }
    text
}

/// The lines, with times that count from another start.
fn from(lines: &[Line], start_ns: i64) -> Vec<Line> {
    let first = lines.iter().map(|line| line.time_ns).min().unwrap_or(0);
    lines.iter().map(|line| Line { time_ns: line.time_ns - first + start_ns, ..line.clone() }).collect()
}

/// Lines in the orders in which tools leave them.
fn orders(lines: &[Line]) -> Vec<(&'static str, Vec<Line>, &'static str)> {
    let half = lines.len() / 2;
    let third = lines.len() / 3;
    let blocks = |n: usize, turn: fn(&mut Vec<Line>)| {
        let turned = lines.chunks(n).map(|chunk| {
            let mut chunk = chunk.to_vec();
            turn(&mut chunk);
            chunk
        });
        turned.collect::<Vec<_>>().concat()
    };
    let mut late = lines.to_vec();
    for at in (10..late.len() - 40).step_by(400) {
        let line = late.remove(at);
        late.insert(at + 30, line);
    }
    vec![
        ("in order", lines.to_vec(), ""),
        ("halves exchanged", [&lines[half..], &lines[..half]].concat(), "not in the order of time"),
        (
            "thirds",
            [&lines[third..2 * third], &lines[..third], &lines[2 * third..]].concat(),
            "not in the order of time",
        ),
        ("newest first", lines.iter().rev().cloned().collect(), "newest line comes first"),
        ("by four", blocks(4, |four| four.rotate_left(1)), "not in the order of time"),
        ("by scan", blocks(45, |scan| scan.reverse()), "not in the order of time"),
        ("single lines late", late, "not in the order of time"),
        (
            "sorted by identifier within a second",
            blocks(900, |second| second.sort_by_key(|line| line.frame().unwrap().id.raw())),
            "not in the order of time",
        ),
    ]
}

#[test]
fn every_tool_writes_the_same_scans_whatever_its_clock_and_its_decimal_sign() {
    let expected = read(LOG.as_bytes()).unwrap();
    assert_eq!((expected.frames.len(), expected.problems.count("order of time")), (28, 0));
    let lines = lines();
    for tool in &TOOLS {
        for (start, start_ns) in [
            ("1970", 1_700_000_000_000_000_000),
            ("0", 0),
            ("a start", 12_345_000),
            ("before 0", -1_000_000_000),
            ("long before 0", -1_700_000_000_000_000_000),
        ] {
            for comma in [false, true] {
                let what = format!("{} from {start}, comma {comma}", tool.name);
                let read = same(&what, text(tool, &from(&lines, start_ns), comma).as_bytes(), &expected);
                assert_eq!(read.problems.count("before 0"), u64::from(start_ns < 0), "{what}");
                assert_eq!(read.problems.count("line skipped") + read.problems.count("order of time"), 0, "{what}");
            }
        }
    }
}

#[test]
fn lines_in_a_wrong_order_are_read_in_that_of_time() {
    let lines = lines();
    for start_ns in [1_700_000_000_000_000_000, 0, -1_000_000_000] {
        let lines = from(&lines, start_ns);
        let expected = read(text(&TOOLS[0], &lines, false).as_bytes()).unwrap();
        for (order, lines, said) in orders(&lines) {
            for tool in &TOOLS {
                let what = format!("{}, {order}, from {start_ns}", tool.name);
                let read = same(&what, text(tool, &lines, false).as_bytes(), &expected);
                // a minus before each time is another trouble
                assert!(said.is_empty() || read.problems.count(said) > 0, "{what}: {:?}", read.problems);
                assert_eq!(read.problems.count("runs backwards"), 0, "{what}");
            }
        }
    }
}

#[test]
fn times_since_the_line_before_are_added_up() {
    let lines = from(&lines(), 0);
    let expected = read(text(&TOOLS[0], &lines, false).as_bytes()).unwrap();
    let before = [0].into_iter().chain(lines.iter().map(|line| line.time_ns)).collect::<Vec<_>>();
    let differences: Vec<Line> =
        lines.iter().zip(before).map(|(line, ns)| Line { time_ns: line.time_ns - ns, ..line.clone() }).collect();
    for tool in TOOLS.iter().filter(|tool| tool.name.contains("candump")) {
        for comma in [false, true] {
            let text = text(tool, &differences, comma);
            same(tool.name, text.as_bytes(), &expected);
            // cut off in the middle
            let cut: String = text.lines().skip(1).map(|line| format!("{line}\n")).collect();
            assert_eq!(read(cut.as_bytes()).unwrap().frames.len(), expected.frames.len(), "{}", tool.name);
        }
    }
    for tool in TOOLS.iter().filter(|tool| tool.name.contains("ASC")) {
        let text = text(tool, &differences, true).replace("absolute", "relative");
        same(tool.name, text.as_bytes(), &expected);
    }
}

#[test]
fn the_minus_that_savvycan_writes_is_left_out() {
    let lines = from(&lines(), 1_700_000_000_000_000_000);
    let expected = read(text(&TOOLS[0], &lines, false).as_bytes()).unwrap();
    let turned: Vec<Line> = lines.iter().map(|line| Line { time_ns: -line.time_ns, ..line.clone() }).collect();
    let read = same("minus", text(&TOOLS[6], &turned, false).as_bytes(), &expected);
    assert_eq!((read.problems.count("minus sign"), read.problems.count("order of time")), (1, 0));
    assert_eq!(read.frames[0].time_ns / 1_000_000_000, 1_700_000_000);
}

#[test]
fn a_clock_that_is_set_back_is_no_wrong_order() {
    let lines = from(&lines(), 50_000_000_000);
    let once = read(text(&TOOLS[0], &lines, false).as_bytes()).unwrap().frames.len();
    // the same clock again, and one that was set by a second in the middle
    let twice = [lines.clone(), lines.clone()].concat();
    let half = lines.len() / 2;
    let set: Vec<Line> = [&lines[..half], &from(&lines[half..], lines[half].time_ns - 500_000_000)[..]].concat();
    for (what, lines, scans) in [("twice", twice, 2 * once), ("set", set, once)] {
        for tool in &TOOLS {
            let read = read(text(tool, &lines, false).as_bytes()).unwrap();
            assert!(read.frames.len().abs_diff(scans) <= 1, "{what}, {}: {}", tool.name, read.frames.len());
            assert_eq!(read.problems.count("runs backwards"), 1, "{what}, {}: {:?}", tool.name, read.problems);
        }
    }
}

#[test]
fn buses_with_clocks_of_their_own_are_each_in_order() {
    let lines = from(&lines(), 1_700_000_000_000_000_000);
    let expected = read(text(&TOOLS[0], &lines, false).as_bytes()).unwrap();
    for behind_ns in [3_000_000, -3_000_000, 1_699_999_999_000_000_000, -40_000_000_000] {
        let mut text = String::new();
        for line in &lines {
            let other = Line { time_ns: line.time_ns - behind_ns, interface: "can1".into(), ..line.clone() };
            let Content::Data(frame) = &line.content else { continue };
            let id = CanId::Standard(0x100 + frame.id.raw() as u16 % 0x100);
            let other = Line {
                content: Content::Data(viewshed::wire::frame::CanFrame::classic(id, frame.data()).unwrap()),
                ..other
            };
            let _ = write!(text, "{line}\n{other}\n");
        }
        let read = same("two clocks", text.as_bytes(), &expected);
        assert_eq!((read.problems.count("order"), read.problems.count("backwards")), (0, 0), "{:?}", read.problems);
    }
}

#[test]
fn a_log_is_read_whatever_its_encoding_and_what_lies_before_it() {
    let expected = read(LOG.as_bytes()).unwrap();
    let lines = lines();
    let units = |text: &str, big: bool| -> Vec<u8> {
        text.encode_utf16().flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
    };
    for tool in &TOOLS {
        let text = text(tool, &lines, false);
        for (what, bytes) in [
            ("marked", format!("\u{feff}{text}").into_bytes()),
            ("UTF-16", [&[0xFF, 0xFE], &units(&text, false)[..]].concat()),
            ("UTF-16, big end first", [&[0xFE, 0xFF], &units(&text, true)[..]].concat()),
            ("UTF-16 without a mark", units(&text, false)),
            ("zeros", [&vec![0; 100_000], text.as_bytes()].concat()),
            ("remarks", format!("{}{text}", "# Größe\n// who\n; wrote\n".repeat(9_000)).into_bytes()),
            ("empty lines", format!("\r\n \n{}", text.replace('\n', "\r\n\r\n")).into_bytes()),
            ("old line ends", text.replace('\n', "\r").into_bytes()),
        ] {
            let read = same(&format!("{}, {what}", tool.name), &bytes, &expected);
            assert_eq!(read.problems.count("line skipped"), 0, "{}, {what}", tool.name);
            assert_eq!(read.problems.count("zero bytes"), if what == "zeros" { 100_000 } else { 0 });
        }
    }
}

#[test]
fn times_of_which_no_map_can_be_made_are_refused() {
    let lines = from(&lines(), 5_000_000_000);
    let scaled = |by: fn(i64) -> i64| {
        let lines: Vec<Line> = lines.iter().map(|line| Line { time_ns: by(line.time_ns), ..line.clone() }).collect();
        TOOLS.iter().map(|tool| read(text(tool, &lines, false).as_bytes()).unwrap_err()).collect::<Vec<_>>()
    };
    for error in scaled(|_| 5_000_000_000) {
        assert!(error.contains("the same time"), "{error}");
    }
    for error in scaled(|ns| ns / 1000) {
        assert!(error.contains("in another unit"), "{error}");
    }
}

#[test]
fn what_is_asked_for_ends_the_reading() {
    // ten times one after the other, and the same sensor's state before it
    let lines: Vec<Line> = (0..10).flat_map(|k| from(&lines(), (100 + 2 * k) * 1_000_000_000)).collect();
    let bytes = text(&TOOLS[0], &lines, false);
    let options = |to_s| ReadOptions { sensor_id: Some(0), to_s, ..ReadOptions::default() };
    let found = find(&Source::of_bytes(bytes.as_bytes())).unwrap().unwrap();
    let read = |to_s| ars408::read("log", &found, &options(to_s), None).unwrap().0;
    let (all, some) = (read(None), read(Some(5.0)));
    assert!(all.duration_s() > 19.0 && (5.0..9.0).contains(&some.duration_s()), "{}", some.duration_s());
    assert_eq!(some.frames[..], all.frames[..some.frames.len()]);
    // scans that cannot be read at first do not end it early
    let entries = |line: &&str| !line.starts_with("(10") || !line.contains(" 701#");
    let late: String = bytes.lines().filter(entries).map(|line| format!("{line}\n")).collect();
    let found = find(&Source::of_bytes(late.as_bytes())).unwrap().unwrap();
    let read = |to_s| ars408::read("log", &found, &options(to_s), None).unwrap().0;
    let (all, some) = (read(None), read(Some(5.0)));
    let until = |r: &Recording| r.frames.iter().filter(|f| f.time_ns - r.frames[0].time_ns <= 5_000_000_000).count();
    assert_eq!(until(&some), until(&all));
}
