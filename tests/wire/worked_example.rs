//! The specification's example: what the code sends, and what the page's own words, followed one by one, read from it.

use super::specification::{EPOCH, PAGE, fenced};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::bits::Bits;
use viewshed::fixed::time::Time;
use viewshed::map::Visibility;
use viewshed::probability::Levels;
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::code::model::{MODEL, STOP_CLASSES};
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::frame::{CanFrame, CanId, fd_length};
use viewshed::wire::header::{Clock, Header, WireMount};
use viewshed::wire::map_message;
use viewshed::wire::message::{Addresses, Message, Packet, Packing, Part, Plane};
use viewshed::wire::planes::Planes;
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::scan_number::ScanNumber;

const AZIMUTHS: usize = 4;
const RANGES: usize = 32;

pub fn header() -> Header {
    Header {
        mount: WireMount {
            origin: RoadPoint::new(-1234, 560),
            height_cm: 600,
            yaw: Angle::from_degrees(-15.0),
            pitch: Angle::from_degrees(4.0),
            roll: Angle::from_degrees(0.0),
        },
        azimuth_origin: Angle::from_degrees(-2.0),
        azimuth_span: 728,
        narrow: viewshed::map::azimuths::Narrow::NONE,
        azimuths: AZIMUTHS as u8,
        cell_cm: 100,
        ranges: RANGES as u16,
        usual: Known::new(2, RANGES),
        planes: 1,
        fingerprint: 0xDEAD_BEEF,
        probability: None,
    }
}

// ---- what the code sends

/// A picture: `.` visible, `#` not visible, blanks unknown.
struct Picture(Vec<Ray<1>>);

impl Planes<1> for Picture {
    fn ray(&self, _: Plane, azimuth: usize) -> Ray<1> {
        self.0[azimuth]
    }
}

fn picture(scan: u8) -> Picture {
    let lines = fenced(&format!("map {scan:#04x}"));
    assert_eq!(lines.len(), AZIMUTHS);
    let ray = |line: &&str| {
        let mut bits = Bits::NONE;
        line.chars().enumerate().filter(|(_, c)| *c == '.').for_each(|(cell, _)| bits.set(cell));
        let near = line.find(|c| c != ' ').unwrap_or(0);
        Ray::new(Known::new(near, line.trim_end().len()), bits)
    };
    Picture(lines.iter().map(ray).collect())
}

/// When a scan with this number is measured, in the second period of the numbers.
fn measured(scan: u8) -> Time {
    let ticks = if scan < 0x80 { 3 * 256 } else { 2 * 256 } + u64::from(scan);
    Time::from_micros(20_000 * ticks)
}

/// The map frames of these scans as a sender sends them that began before.
fn sent(medium: Medium, scans: &[u8]) -> Vec<String> {
    let begun = Time::from_micros(measured(scans[0]).micros() - 1_000_000);
    let mut sender = Broadcaster::<AZIMUTHS, 1>::new(BroadcastConfig::new(0, medium), header(), EPOCH, begun).unwrap();
    let mut frames = Vec::new();
    for scan in scans {
        sender.scan(measured(*scan), &picture(*scan)).unwrap();
        for ms in 0..40 {
            let packet = sender.next_packet(Time::from_micros(measured(*scan).micros() + 1000 * ms));
            let packet = packet.filter(|packet| matches!(packet.message, Message::Map(..)));
            frames.extend(packet.map(|packet| format!("{:?}", packet.frame(&Addresses::STANDARD).unwrap())));
        }
        assert!(sender.idle());
    }
    frames
}

/// The frames of a fenced block, without their comments.
fn page_frames(kind: &str) -> Vec<String> {
    fenced(kind).iter().map(|line| line.split_whitespace().next().unwrap().to_owned()).collect()
}

#[test]
fn the_example_is_what_is_sent() {
    let can = Medium::Can(Addresses::STANDARD);
    let clock = Clock { time_ms: 0x0102_0304, synchronised: true };
    let group = |group: u8| {
        let own = header().emit_group(&clock, group);
        let packet = Packet::new(Packing::Classic, 0, Message::Header, EPOCH, &own).protect(group, None);
        format!("{:?}", packet.frame(&Addresses::STANDARD).unwrap())
    };
    let mut frames: Vec<String> = (0..7).map(group).collect();
    frames.extend(sent(can, &[0x21, 0x24]));
    let mut wrong = Vec::new();
    let mut same = |kind: &str, sent: Vec<String>| {
        if page_frames(kind) != sent {
            wrong.push(format!("{kind}:\n{}", sent.join("\n")));
        }
    };
    same("frames", frames);
    same("further", sent(can, &[0xFE, 0x01]));
    // long: all azimuths in a block, and the one in plain cells as a long message has them
    let mut long = sent(Medium::CanFd(Addresses::STANDARD), &[0xFE]);
    let (own, length) = map_message::plain(ScanNumber::from_byte(0xFE), 2, &picture(0xFE).0[2]);
    let packet = Packet::new(Packing::Long, 0, Message::Map(Plane::Visibility, Part::Plain), EPOCH, &own[..length]);
    let filled = fd_length(packet.bytes().len());
    long.push(format!("{:?}", packet.protect(0, filled).frame(&Addresses::STANDARD).unwrap()));
    same("long", long);
    assert!(wrong.is_empty(), "what is sent is, instead of the page's\n{}", wrong.join("\n"));
}

/// Visible as in one picture, probable as in another.
struct Probable(Picture, Picture);

impl Planes<1> for Probable {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<1> {
        let picture = if plane == Plane::Visibility { &self.0 } else { &self.1 };
        picture.0.get(azimuth).copied().unwrap_or(Ray::UNKNOWN)
    }
}

#[test]
fn probabilities_are_a_group_of_the_header_and_a_second_plane() {
    let levels = Levels::from_bytes([51, 178, 242, 0xAB, 0xCD]).unwrap();
    let header = Header { probability: Some(levels), ..header() };
    let (medium, start) = (Medium::Can(Addresses::STANDARD), Time::from_micros(measured(0x21).micros() - 1_200_000));
    let mut sender = Broadcaster::<AZIMUTHS, 1, 2>::new(BroadcastConfig::new(0, medium), header, EPOCH, start).unwrap();
    let limits = ReceiverLimits::DEFAULT;
    let mut receiver = Receiver::<1, AZIMUTHS, 1, 2>::new([0], Addresses::STANDARD, limits);
    let (mut group, mut plane) = (None, Vec::new());
    let probable = Probable(picture(0x21), picture(0x24));
    let end = measured(0x21).micros() + 40_000;
    for us in (start.micros()..end).step_by(1000) {
        let now = Time::from_micros(us);
        // every third is a refresh, and every second has probabilities of azimuths 0 and 1
        if (end - 40_000 - 720_000..=end - 40_000).contains(&us) && (end - 40_000 - us).is_multiple_of(60_000) {
            let _ = sender.scan(now, &probable);
        }
        let Some(packet) = sender.next_packet(now) else { continue };
        let frame = packet.frame(&Addresses::STANDARD).unwrap();
        let _ = receiver.frame(now, &frame);
        let counted = |counter| format!("{:?}", packet.protect(counter, None).frame(&Addresses::STANDARD).unwrap());
        match packet.message {
            Message::Header if frame.data()[2] >> 4 & 7 == 7 => group = Some(counted(7)),
            Message::Map(Plane::Grade, _) if us >= end - 40_000 => plane.push(counted(plane.len() as u8)),
            _ => {}
        }
    }
    let expected = [vec![group.unwrap()], plane].concat();
    assert_eq!(page_frames("probability"), expected, "what is sent is, instead of the page's\n{}", expected.join("\n"));
    let map = receiver.map(0, Time::from_micros(end));
    let p = |cell| map.probability(1, cell).map(|p| p.raw());
    assert_eq!([1, 2, 11, 12, 17, 18].map(p), [None, Some(242), Some(178), Some(51), Some(51), Some(242)]);
}

#[test]
fn the_example_shows_every_way_to_send() {
    let mut page = Page::default();
    ["frames", "further", "long"].iter().for_each(|kind| page_frames(kind).iter().for_each(|f| page.frame(f)));
    page.finish();
    let rows = page.traces.concat();
    let has = |name: &str, answer: &str| {
        rows.iter().any(|row| row.starts_with(&format!("| {name}")) && row.ends_with(&format!("| {answer} |")))
    };
    for (name, answers) in [
        ("ray", &["0", "1", "2"][..]),
        ("limit", &["0", "1", "2", "3"]),
        ("first", &["0", "1"]),
        ("edge", &["4", "5", "6", "11", "12"]),
        ("end", &["0", "1"]),
        ("stop", &["0", "1"]),
    ] {
        answers.iter().for_each(|answer| assert!(has(name, answer), "{name} is never {answer}:\n{}", rows.join("\n")));
    }
    let frames = page_frames("further");
    let (mut numbers, mut starts) = (Vec::new(), Vec::new());
    for frame in frames.iter().map(|frame| parsed(frame)) {
        numbers.push(frame.id.raw() & 31);
        starts.push(frame.data()[3] >> 1);
    }
    assert!([6, 7, 8, 9, 11].iter().all(|number| numbers.contains(number)), "a third word, plain cells: {numbers:?}");
    assert!(starts.iter().any(|start| *start > 0));
}

// ---- what the code reads

fn parsed(frame: &str) -> CanFrame {
    let (id, data) = frame.split_once('#').unwrap();
    let id = CanId::standard(u16::from_str_radix(id, 16).unwrap()).unwrap();
    let (fd, data) = data.strip_prefix('#').map_or((false, data), |data| (true, data));
    let bytes: Vec<u8> =
        (0..data.len() / 2).map(|i| u8::from_str_radix(&data[2 * i..2 * i + 2], 16).unwrap()).collect();
    if fd { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes) }.unwrap()
}

/// Whether what was received is a picture.
fn shows(ray: &Ray<1>, state: impl Fn(usize) -> Option<bool>) -> bool {
    (0..RANGES).all(|cell| state(cell) == ray.known.contains(cell).then(|| ray.get(cell)))
}

#[test]
fn the_example_reads_as_the_pictures() {
    // nothing is on its way for long here, so that each map is shown as soon as its frames have come
    let limits = ReceiverLimits { max_age_us: 60_000, max_delay_us: 10_000 };
    for (kind, scans) in [("frames", [0x21, 0x24]), ("further", [0xFE, 0x01])] {
        let mut receiver = Receiver::<1, AZIMUTHS, 1>::new([0], Addresses::STANDARD, limits);
        let start = Time::from_micros(measured(scans[0]).micros() - 80_000);
        let halfway = Time::from_micros(start.micros() + 40_000);
        let mut send = |at: Time, message: Message, own: &[u8]| {
            let packet = Packet::new(Packing::Classic, 0, message, EPOCH, own).protect(0, None);
            let _ = receiver.frame(at, &packet.frame(&Addresses::STANDARD).unwrap());
        };
        // the example's clock is another one; two messages begin a session, eight dated ones are enough
        let clock = header().emit_group(&Clock { time_ms: start.micros() / 1000, synchronised: true }, 0);
        (0..2).for_each(|_| send(start, Message::Header, &clock));
        for at in [start, start, start, start, halfway, halfway, halfway, halfway] {
            send(at, Message::VisibleRange, &[ScanNumber::at(at).byte(), 0, 0, 0, 0, 0]);
        }
        page_frames("frames")[1..7].iter().for_each(|frame| _ = receiver.frame(halfway, &parsed(frame)).unwrap());
        for scan in scans {
            let frames = page_frames(kind).iter().map(|frame| parsed(frame)).collect::<Vec<_>>();
            let of_scan = frames.iter().filter(|frame| frame.id.raw() & 31 >= 6 && frame.data()[2] == scan);
            of_scan.for_each(|frame| _ = receiver.frame(measured(scan), frame).unwrap());
            let map = receiver.map(0, measured(scan));
            for (azimuth, ray) in picture(scan).0.iter().enumerate() {
                let state = |cell| match map.cell(azimuth, cell).visibility {
                    Visibility::Unknown => None,
                    state => Some(state == Visibility::Visible),
                };
                assert!(shows(ray, state), "scan {scan:#04x}, azimuth {azimuth}");
            }
        }
    }
}

// ---- what the page's words read

#[test]
fn the_pages_own_words_read_the_pictures_and_its_tables() {
    let mut page = Page::default();
    for (kind, scans) in [("frames", &[0x21, 0x24][..]), ("further", &[0xFE, 0x01]), ("long", &[0xFE])] {
        if kind == "long" {
            page.rays = Default::default();
        }
        for scan in scans {
            let of_scan = |frame: &&String| parsed(frame).data()[if kind == "long" { 6 } else { 2 }] == *scan;
            let frames = page_frames(kind);
            frames.iter().filter(|f| !f.starts_with("401")).filter(of_scan).for_each(|frame| page.frame(frame));
            page.finish();
            for (azimuth, ray) in picture(*scan).0.iter().enumerate() {
                let read = page.rays[azimuth].unwrap_or(NONE);
                let state = |cell| (cell >= read.near && cell < read.end).then(|| read.bit[cell]);
                assert!(shows(ray, state), "{kind}, scan {scan:#04x}, azimuth {azimuth}");
            }
        }
    }
    // the tables of the page are of the first blocks of the classic maps
    let tables: Vec<Vec<String>> = PAGE
        .split("\n| asked | width | value | answer |\n|---|---|---|---|\n")
        .skip(1)
        .map(|rest| rest.lines().take_while(|line| line.starts_with('|')).map(str::to_owned).collect())
        .collect();
    let traces: Vec<&Vec<String>> = page.traces.iter().filter(|rows| tables.contains(rows)).collect();
    let all = page.traces.iter().map(|rows| rows.join("\n")).collect::<Vec<_>>().join("\n\n");
    assert_eq!((tables.len(), traces.len()), (4, 4), "\n{all}");
}

/// A ray as the page has it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PageRay {
    near: usize,
    end: usize,
    bit: [bool; RANGES],
}

const NONE: PageRay = PageRay { near: 1, end: 0, bit: [false; RANGES] };

impl PageRay {
    fn clear(near: usize, end: usize) -> Self {
        let mut bit = [false; RANGES];
        (near..end).for_each(|cell| bit[cell] = true);
        Self { near, end, bit }
    }

    fn is_edge(&self, cell: usize) -> bool {
        self.near < cell && cell < self.end && self.bit[cell] != self.bit[cell - 1]
    }
}

/// "Numbers": the words as one big number.
struct Number<'a> {
    words: &'a [u64],
    word_bits: u32,
    most: usize,
    v: u64,
    w: u64,
    u: usize,
    rows: Vec<String>,
}

impl Number<'_> {
    fn join(&mut self) {
        if self.w < 1 << 16 && self.u < self.most {
            self.v = (self.v << self.word_bits) + self.words[self.u];
            self.w <<= self.word_bits;
            self.u += 1;
        }
    }

    fn symbol(&mut self, asked: &str, frequencies: &[u8]) -> usize {
        self.join();
        let (mut below, mut s) = (0, 0);
        while self.v >= self.w * (below + u64::from(frequencies[s])) / 256 {
            below += u64::from(frequencies[s]);
            s += 1;
        }
        self.rows.push(format!("| {asked} | {} | {} | {s} |", self.w, self.v));
        let (low, high) = (self.w * below / 256, self.w * (below + u64::from(frequencies[s])) / 256);
        (self.v, self.w) = (self.v - low, high - low);
        s
    }

    fn plain(&mut self, asked: &str, bits: u32) -> usize {
        let row = self.rows.len();
        self.join();
        self.rows.push(format!("| {asked} | {} | {} |", self.w, self.v));
        let mut value = 0;
        for _ in 0..bits {
            self.join();
            let half = self.w / 2;
            let upper = self.v >= half;
            (self.v, self.w) = if upper { (self.v - half, self.w - half) } else { (self.v, half) };
            value = 2 * value + usize::from(upper);
        }
        self.rows[row] += &format!(" {value} |");
        value
    }

    fn room(&self) -> u32 {
        self.w.ilog2() + (self.most - self.u) as u32 * self.word_bits
    }
}

/// A receiver that only decodes: no delays, nothing too old.
#[derive(Default)]
struct Page {
    rays: [Option<PageRay>; AZIMUTHS],
    refreshes: [Option<(u8, PageRay)>; AZIMUTHS],
    /// The block whose words are coming: whether it is a delta, its scan, first azimuth, words.
    coming: Option<(bool, u8, usize, Vec<u64>)>,
    /// The questions and answers of each block.
    traces: Vec<Vec<String>>,
}

impl Page {
    fn frame(&mut self, frame: &str) {
        let frame = parsed(frame);
        let (number, data) = (frame.id.raw() & 31, frame.data());
        if number < 6 {
            return;
        }
        if !(8..11).contains(&number) {
            self.finish();
        }
        let own = if frame.fd { &data[6..] } else { &data[2..] };
        if frame.fd {
            let (scan, azimuth) = (own[0], usize::from(own[1]));
            if number == 11 {
                let (near, end) = (usize::from(own[2]), usize::from(own[3]) + 1);
                let mut ray = PageRay { near, end, ..NONE };
                (near..end).for_each(|cell| ray.bit[cell] = own[4 + cell / 8] >> (7 - cell % 8) & 1 == 1);
                (self.rays[azimuth], self.refreshes[azimuth]) = (Some(ray), None);
            } else {
                let words: Vec<u64> =
                    own[2..].chunks_exact(4).map(|w| u64::from(u32::from_be_bytes(w.try_into().unwrap()))).collect();
                self.block(number == 7, scan, azimuth, (&words, 32, 14));
            }
            return;
        }
        let big = own.iter().fold(0, |big, byte| big << 8 | u64::from(*byte));
        let (scan, azimuth, word) = ((big >> 40) as u8, (big >> 33 & 0x7F) as usize, big & ((1 << 33) - 1));
        if number == 11 {
            let (segment, cells) = ((word >> 29) as usize, word & ((1 << 29) - 1));
            if segment == 15 {
                let (near, last) = ((cells >> 21) as usize, (cells >> 13 & 0xFF) as usize);
                self.rays[azimuth] = Some(PageRay { near, end: last + 1, ..NONE });
                self.refreshes[azimuth] = None;
            } else {
                let ray = self.rays[azimuth].as_mut().unwrap();
                let of_segment = (0..29).map(|i| (29 * segment + i, cells >> (28 - i) & 1 == 1));
                let known = ray.near..ray.end;
                of_segment.filter(|(cell, _)| known.contains(cell)).for_each(|(cell, bit)| ray.bit[cell] = bit);
            }
            return;
        }
        match &mut self.coming {
            Some((.., words)) if number >= 8 => words.push(word),
            coming => *coming = Some((number == 7, scan, azimuth, vec![word])),
        }
    }

    /// Reads the block whose words have come.
    fn finish(&mut self) {
        if let Some((delta, scan, azimuth, words)) = self.coming.take() {
            self.block(delta, scan, azimuth, (&words, 33, 4));
        }
    }

    /// "Blocks".
    fn block(&mut self, delta: bool, scan: u8, start: usize, (words, word_bits, most): (&[u64], u32, usize)) {
        let mut n = Number { words, word_bits, most, v: words[0], w: 1 << word_bits, u: 1, rows: Vec::new() };
        let named =
            if delta { Some(scan.wrapping_sub(n.plain("age less one", 4) as u8).wrapping_sub(1)) } else { None };
        let mut before = (NONE, NONE);
        let (mut as_expected, mut unchanged) = (true, true);
        for azimuth in start..AZIMUTHS {
            let first = azimuth == start;
            if !first {
                let room = n.room();
                if room < 4 {
                    break;
                }
                let class = STOP_CLASSES.iter().filter(|from| room >= **from).count();
                if n.symbol(&format!("stop, room {room}"), &MODEL.stop[class]) == 1 {
                    break;
                }
            }
            let refresh = match named {
                Some(named) => match self.refreshes[azimuth].filter(|(scan, _)| *scan == named) {
                    Some((_, ray)) => ray,
                    None => break,
                },
                None => NONE,
            };
            let expected = match (delta, first) {
                (false, true) => PageRay::clear(2, RANGES),
                (false, false) => before.0,
                (true, _) => {
                    let mut ray = refresh;
                    let changed = |cell: &usize| !first && before.0.bit[*cell] != before.1.bit[*cell];
                    let within = ray.near..ray.end;
                    (0..RANGES)
                        .filter(changed)
                        .filter(|c| within.contains(c))
                        .for_each(|c| ray.bit[c] = before.0.bit[c]);
                    ray
                }
            };
            let edges = (0..RANGES).any(|cell| expected.is_edge(cell));
            let row = match (delta, first) {
                (false, true) => 0,
                (false, false) => 1 + usize::from(!as_expected),
                (true, true) => 3,
                (true, false) => 4 + 2 * usize::from(!unchanged) + usize::from(!as_expected),
            };
            let ray = match n.symbol(&format!("ray, azimuth {azimuth}"), &MODEL.ray[row][usize::from(edges)]) {
                0 => expected,
                symbol => {
                    let (mut near, mut end) = (expected.near, expected.end);
                    if symbol == 2 {
                        (near, end) = (limit(&mut n, near), limit(&mut n, end));
                    }
                    if near < end { with_edges(&mut n, delta, &expected, near, end) } else { NONE }
                }
            };
            (as_expected, unchanged) = (ray == expected, ray == refresh);
            before = (ray, refresh);
            self.rays[azimuth] = Some(ray);
            if !delta {
                self.refreshes[azimuth] = Some((scan, ray));
            }
        }
        assert_eq!(n.v, 0, "an intact block leaves 0");
        self.traces.push(n.rows);
    }
}

fn limit(n: &mut Number<'_>, x: usize) -> usize {
    match n.symbol(&format!("limit, expected {x}"), &MODEL.limit) {
        0 => x,
        1 => x - 1,
        2 => x + 1,
        _ => n.plain("plain 9 bits", 9),
    }
}

fn with_edges(n: &mut Number<'_>, delta: bool, expected: &PageRay, near: usize, end: usize) -> PageRay {
    let mut bit = expected.near >= expected.end || expected.bit[expected.near];
    bit ^= n.symbol("first", &MODEL.first[usize::from(bit)]) == 1;
    let mut ray = PageRay { near, end, ..NONE };
    let (mut place, mut from, mut last) = (near, near + 1, 0);
    let fill = |ray: &mut PageRay, cells: core::ops::Range<usize>, bit| cells.for_each(|cell| ray.bit[cell] = bit);
    loop {
        let next_edge = |from: usize| (from..end).find(|cell| expected.is_edge(*cell));
        let mut hint = next_edge(from);
        if hint.is_some_and(|edge| expected.bit[edge] == bit) {
            hint = hint.and_then(|edge| next_edge(edge + 1));
        }
        let (kind, after) = (usize::from(delta), usize::from(bit));
        let next = match hint {
            Some(hint) => match n.symbol(&format!("edge, hint {hint}"), &MODEL.edge[kind][after][last]) {
                11 => {
                    (last, from) = (4, hint + 1);
                    continue;
                }
                12 => {
                    last = 4;
                    place + distance(n, bit)
                }
                shift => {
                    last = [2, 1, 3][(shift.cmp(&5) as i8 + 1) as usize];
                    hint + shift - 5
                }
            },
            None if n.symbol("end", &MODEL.end[kind][after][usize::from(last == 0 || last == 4)]) == 0 => {
                fill(&mut ray, place..end, bit);
                return ray;
            }
            None => {
                last = 4;
                place + distance(n, bit)
            }
        };
        fill(&mut ray, place..next, bit);
        (bit, place, from) = (!bit, next, from.max(next + 1));
    }
}

fn distance(n: &mut Number<'_>, bit: bool) -> usize {
    let bits = n.symbol("distance", &MODEL.distance[usize::from(bit)]);
    let plain = if bits == 0 { 0 } else { n.plain(&format!("plain {bits} bits"), bits as u32) };
    (1 << bits) + plain
}
