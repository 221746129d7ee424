//! The specification's tables are the code's, and its example is what the code sends and reads.

use viewshed::fixed::angle::Angle;
use viewshed::fixed::bits::Bits;
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::code::block::{Block, Kind, Rays};
use viewshed::wire::code::model::MODEL;
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::code::reading::{self, Ending, Reader};
use viewshed::wire::header::{Clock, Collector, Header, WireMount};
use viewshed::wire::map_message;
use viewshed::wire::message::{Addresses, Epoch, Message, Packet, Packing, Part, Plane, Received, Word};
use viewshed::wire::scan_number::ScanNumber;

const PAGE: &str = include_str!("../../src/wire/SPECIFICATION.md");
const AZIMUTHS: usize = 4;
const EPOCH: Epoch = Epoch::new(5);

/// The lines of a fenced block.
fn fenced(kind: &str) -> Vec<&'static str> {
    let begin = format!("```{kind}\n");
    let from = PAGE.find(&begin).unwrap_or_else(|| panic!("no {kind}")) + begin.len();
    PAGE[from..].lines().take_while(|line| !line.starts_with("```")).collect()
}

fn header() -> Header {
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
        azimuths: AZIMUTHS as u8,
        cell_cm: 100,
        ranges: 32,
        usual: Known::new(2, 32),
        planes: 1,
        fingerprint: 0xDEAD_BEEF,
    }
}

/// A picture's rays.
fn rays(scan: u8) -> Vec<Ray<1>> {
    let lines = fenced(&format!("map {scan:#04x}"));
    assert_eq!(lines.len(), AZIMUTHS);
    let ray = |line: &&str| {
        let mut bits = Bits::NONE;
        line.chars().enumerate().filter(|(_, c)| *c == '.').for_each(|(cell, _)| bits.set(cell));
        let near = line.find(|c| c != ' ').unwrap();
        Ray::new(Known::new(near, line.trim_end().len()), bits)
    };
    lines.iter().map(ray).collect()
}

struct Map {
    now: Vec<Ray<1>>,
    was: Vec<Ray<1>>,
}

impl Rays<1> for Map {
    fn now(&self, azimuth: usize) -> Option<&Ray<1>> {
        self.now.get(azimuth)
    }
    fn was(&self, azimuth: usize) -> Option<&Ray<1>> {
        self.was.get(azimuth)
    }
}

impl Reader<1> for Map {
    fn was(&self, azimuth: usize) -> Option<Ray<1>> {
        self.was.get(azimuth).copied()
    }
    fn take(&mut self, azimuth: usize, ray: &Ray<1>) {
        self.now[azimuth] = *ray;
    }
}

fn line(message: Message, own: &[u8], counter: u8) -> String {
    let packet = Packet::new(Packing::Classic, 0, message, EPOCH, own).protect(counter, None);
    format!("{:?}", packet.frame(&Addresses::STANDARD).unwrap())
}

/// The frames of the example, as the code sends them.
fn sent() -> Vec<String> {
    let clock = Clock { time_ms: 0x0102_0304, synchronised: true };
    let mut frames: Vec<String> =
        (0..7).map(|group| line(Message::Header, &header().emit_group(&clock, group), group)).collect();
    let refresh = Map { now: rays(0x21), was: Vec::new() };
    let delta = Map { now: rays(0x24), was: rays(0x21) };
    for (scan, kind, map) in [(0x21, Kind::Refresh, refresh), (0x24, Kind::Delta { ticks: 3 }, delta)] {
        let block = Block::new(&header().context(Packing::Classic.form()), kind, 0, &map);
        assert_eq!(block.end, AZIMUTHS);
        for (k, word) in block.words().iter().enumerate() {
            let first = if kind == Kind::Refresh { Part::Refresh } else { Part::Delta };
            let part = Word::at(k).map_or(first, Part::More);
            let own = map_message::word(ScanNumber::from_byte(scan), 0, *word);
            frames.push(line(Message::Map(Plane::Visibility, part), &own, 0));
        }
    }
    frames
}

#[test]
fn the_tables_of_the_page_are_the_codes() {
    let mut all: Vec<Vec<u8>> = Vec::new();
    for line in fenced("tables").into_iter().filter(|line| line.starts_with("  ")) {
        let numbers = line.split('#').next().unwrap_or("").split(',').map(|n| n.trim().parse().unwrap());
        all.push(numbers.collect());
    }
    let mut expected: Vec<Vec<u8>> = Vec::new();
    expected.extend(MODEL.ray.as_flattened().iter().map(|t| t.to_vec()));
    expected.extend(MODEL.first.iter().map(|t| t.to_vec()));
    expected.extend(MODEL.edge.as_flattened().as_flattened().iter().map(|t| t.to_vec()));
    expected.extend(MODEL.end.as_flattened().as_flattened().iter().map(|t| t.to_vec()));
    expected.extend(MODEL.distance.iter().map(|t| t.to_vec()));
    expected.push(MODEL.limit.to_vec());
    expected.extend(MODEL.stop.iter().map(|t| t.to_vec()));
    assert_eq!(all, expected);
}

#[test]
fn the_example_is_what_is_sent() {
    let page: Vec<String> =
        fenced("frames").iter().map(|line| line.split_whitespace().next().unwrap().to_owned()).collect();
    assert_eq!(page, sent(), "\n{}", sent().join("\n"));
}

#[test]
fn the_example_reads_as_the_pictures() {
    let mut collector = Collector::NEW;
    let mut now = Map { now: vec![Ray::UNKNOWN; AZIMUTHS], was: Vec::new() };
    let (mut words, mut refresh, mut complete) = (Vec::new(), true, 0);
    for frame in fenced("frames") {
        let (id, data) = frame.split_whitespace().next().unwrap().split_once('#').unwrap();
        let bytes: Vec<u8> = (0..8).map(|i| u8::from_str_radix(&data[2 * i..2 * i + 2], 16).unwrap()).collect();
        let id = viewshed::wire::frame::CanId::standard(u16::from_str_radix(id, 16).unwrap()).unwrap();
        let frame = viewshed::wire::frame::CanFrame::classic(id, &bytes).unwrap();
        let received = Received::from_frame(&frame, &Addresses::STANDARD).unwrap();
        assert_eq!(received.epoch, EPOCH);
        match received.message {
            Message::Header => {
                collector.take(received.own).unwrap();
            }
            Message::Map(Plane::Visibility, part) => {
                let map = map_message::parse(received.own, false).unwrap();
                let context = collector.header().unwrap().context(Packing::Classic.form());
                if !matches!(part, Part::More(_)) {
                    now.was.clone_from(&now.now);
                    words.clear();
                    refresh = part == Part::Refresh;
                }
                words.push(map.words()[0]);
                let delta = || Kind::Delta { ticks: reading::age(&words, context.form).unwrap() };
                let kind = if refresh { Kind::Refresh } else { delta() };
                let ending =
                    reading::decode(&words, &context, kind, map.start, &mut { reading::Place::START }, &mut now);
                if ending == Ending::Complete {
                    assert_eq!(now.now, rays(map.scan.byte()));
                    complete += 1;
                }
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(collector.header(), Some(&header()));
    assert_eq!(complete, 2);
}

/// What a sender with a key says first, on CAN FD.
#[cfg(feature = "secoc")]
fn secured() -> Vec<viewshed::wire::frame::CanFrame> {
    use viewshed::fixed::time::Time;
    use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
    let start = Time::from_micros(1000 * 0x0102_0304);
    let medium = Medium::CanFd(Addresses::STANDARD);
    let config = BroadcastConfig { secured: true, ..BroadcastConfig::new(0, medium) };
    let mut sender = Broadcaster::<AZIMUTHS, 1>::new(config, header(), EPOCH, start).unwrap();
    let mut sealer = viewshed::wire::secoc::Sealer::new(KEY, 0x0000_0102_0304_0507);
    let mut next = |ms: u64| sender.next_sealed(Time::from_micros(start.micros() + 1000 * ms), &mut sealer).unwrap();
    [next(0), next(1)].iter().map(|p| p.frame(&Addresses::STANDARD).unwrap()).collect()
}

#[cfg(feature = "secoc")]
const KEY: [u8; 16] = [0x2B, 0x7E, 0x15, 0x16, 0x28, 0xAE, 0xD2, 0xA6, 0xAB, 0xF7, 0x15, 0x88, 0x09, 0xCF, 0x4F, 0x3C];

#[cfg(feature = "secoc")]
#[test]
fn the_authenticated_example_is_what_is_sent_and_opens() {
    let page: Vec<String> =
        fenced("secured").iter().map(|line| line.split_whitespace().next().unwrap().to_owned()).collect();
    let frames = secured();
    let sent: Vec<String> = frames.iter().map(|frame| format!("{frame:?}")).collect();
    assert_eq!(page, sent, "\n{}", sent.join("\n"));
    let key: String = KEY.iter().map(|byte| format!("{byte:02X}")).collect();
    assert!(PAGE.contains(&key));
    let mut opener = viewshed::wire::secoc::Opener::new(KEY);
    for (frame, freshness) in frames.iter().zip([0x0000_0102_0304_0508, 0x0000_0102_0304_0509]) {
        let received = Received::from_frame(frame, &Addresses::STANDARD).unwrap();
        assert!(opener.open(&received).is_ok());
        assert_eq!(opener.freshness(), Some(freshness));
    }
}
