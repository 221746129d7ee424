//! Probabilities over the wire: what a receiver gives out is never above what the sender's table says of its map.

use std::collections::VecDeque;

use crate::shadows::{A, R, Random, Shadows, W, header};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::fixed::trig::Direction;
use viewshed::map::polar::PolarMap;
use viewshed::map::query::Footprint;
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::probability::{Edges, Probability, ProbabilityTable, Quantiser, Threshold};
use viewshed::sensor::road::RoadPoint;
use viewshed::unit::MapSender;
use viewshed::unit::quantised::QuantisedSender;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::code::ray::Ray;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Epoch, Plane};
use viewshed::wire::planes::{Planes, Quantised};
use viewshed::wire::receive::{ReceivedMap, Receiver, ReceiverLimits};
use viewshed::wire::scan_number::ScanNumber;
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer};

const SENSOR: u8 = 2;
const MEDIA: [Medium; 3] = [Medium::Can(Addresses::STANDARD), Medium::CanFd(Addresses::STANDARD), Medium::Serial];
const VISIBLE_FROM: u8 = 128;
const RULES: [Option<Threshold>; 4] =
    [None, Some(Threshold::From(190)), Some(Threshold::Everything), Some(Threshold::Nothing)];

type Map = PolarMap<R, A>;
type Received<'a> = ReceivedMap<'a, A, W, 2>;

/// Rises with the grade; its bins end within cells and azimuths of the map.
fn table(random: &mut Random) -> ProbabilityTable {
    let edges = Edges {
        grades: [2, 30, 60, 90, 120, 150, 180, 200, 220, 240, 255],
        ranges_cm: [1111, 2050, 3333, 4001, 6199, 7777, 9999],
        azimuths: [-7777, -5050, -2001, -3, 2500, 5123, 9001],
    };
    let mut steps = || {
        let mut steps = [0; 12].map(|_: u8| 30 + random.below(226) as u8);
        steps.sort_unstable();
        steps
    };
    let values = std::array::from_fn(|_| std::array::from_fn(|_| steps()));
    ProbabilityTable::new(edges, values, 1).unwrap()
}

/// Grades of a map of moving shadows, with unknown cells among them.
fn graded(shadows: &mut Shadows, random: &mut Random) -> Map {
    let mut map = PolarMap::unknown(header(1).geometry(), VISIBLE_FROM, 128);
    for (azimuth, ray) in shadows.next().0.iter().enumerate() {
        let (grades, _) = map.rows_mut(azimuth).unwrap();
        let known = ray.known.near()..ray.known.end();
        for (cell, grade) in grades.iter_mut().enumerate().take(known.end).skip(known.start) {
            let partly = (azimuth * 7 + cell / 5) % 3;
            *grade = match (ray.get(cell), partly) {
                (true, 0) => 150,
                (true, _) => 255,
                (false, 0) => 100,
                (false, _) => 1,
            };
            if random.chance(0.002) {
                *grade = 0;
            }
        }
    }
    map
}

/// Any point of a cell.
fn point(azimuth: usize, range: usize, random: &mut Random) -> RoadPoint {
    let geometry = header(1).geometry();
    let part = |n: usize, random: &mut Random| (1000 * n as u64 + random.below(1000)) as f32 / 1000.0;
    let turn = part(azimuth, random) * f32::from(geometry.azimuth_span) / A as f32;
    let bearing = (geometry.azimuth_origin + Angle::from_raw(turn as i16)).radians();
    let far = part(range, random) * geometry.cell_cm as f32;
    RoadPoint::new((far * bearing.cos()) as i32, (far * bearing.sin()) as i32)
}

/// What the table says of the sender's map at a point, 0 where nothing is known.
fn at_most(table: &ProbabilityTable, map: &Map, point: RoadPoint) -> Probability {
    table.at(map, point).unwrap_or(Probability::from_raw(0))
}

struct Sending {
    medium: Medium,
    sender: QuantisedSender<A, W>,
    receiver: Receiver<1, A, W, 2>,
    unstuffer: Unstuffer,
}

impl Sending {
    fn new(medium: Medium, quantiser: &Quantiser) -> Self {
        // random tables cost more than fitted ones
        let config = BroadcastConfig { gap_us: 400, ..BroadcastConfig::new(SENSOR, medium) };
        let now = Time::from_micros(0);
        let sender = QuantisedSender::new(config, header(1), Some(quantiser.clone()), Epoch::new(3), now).unwrap();
        let receiver = Receiver::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
        Self { medium, sender, receiver, unstuffer: Unstuffer::new() }
    }

    fn offer(&mut self, at: Time, map: &Map) {
        MapSender::offer(&mut self.sender, at, map);
    }

    /// The next message: a frame's bytes or a line's.
    fn next(&mut self, now: Time) -> Option<Vec<u8>> {
        if self.medium == Medium::Serial {
            let mut line = [0; MOST_STUFFED];
            let n = MapSender::<Map>::next_line(&mut self.sender, now, &mut line)?;
            return Some(line[..n].to_vec());
        }
        let frame = MapSender::<Map>::next_frame(&mut self.sender, now)?;
        let id = (frame.id.raw() as u16).to_be_bytes();
        Some([&id[..], frame.data()].concat())
    }

    fn deliver(&mut self, now: Time, bytes: &[u8]) {
        // what is refused changes nothing
        if self.medium == Medium::Serial {
            if let (_, Some(message)) = self.unstuffer.push(bytes) {
                let _ = self.receiver.message(now, message);
            }
            return;
        }
        let id = viewshed::wire::frame::CanId::standard(u16::from_be_bytes([bytes[0], bytes[1]])).unwrap();
        let long = matches!(self.medium, Medium::CanFd(_));
        let frame = if long { CanFrame::fd(id, &bytes[2..]) } else { CanFrame::classic(id, &bytes[2..]) };
        let _ = self.receiver.frame(now, &frame.unwrap());
    }

    fn map(&self, now: Time) -> Received<'_> {
        self.receiver.map(SENSOR, now)
    }
}

#[test]
fn without_loss_a_receiver_knows_each_cells_level_and_the_table_says_no_less() {
    for (medium, rule) in MEDIA.into_iter().flat_map(|medium| RULES.map(|rule| (medium, rule))) {
        let mut random = Random::new(11);
        let table = table(&mut random);
        let quantiser = Quantiser::new(table.clone(), rule, VISIBLE_FROM);
        let (mut sending, mut shadows) = (Sending::new(medium, &quantiser), Shadows::new(5));
        let (mut cells, mut given, mut of_table, mut compared) = (0, 0_u64, 0_u64, 0);
        let mut map = graded(&mut shadows, &mut random);
        for scan in 0..90 {
            // each map stays for three scans: halves of the plane of probability go out in turn
            if scan % 3 == 0 {
                map = graded(&mut shadows, &mut random);
            }
            let start = 67_000 * scan;
            sending.offer(Time::from_micros(start), &map);
            for now in (start..start + 66_500).step_by(500).map(Time::from_micros) {
                if let Some(bytes) = sending.next(now) {
                    sending.deliver(now, &bytes);
                }
            }
            if start < 1_500_000 || !sending.sender.idle() || scan % 3 != 2 {
                continue;
            }
            compared += 1;
            let received = sending.map(Time::from_micros(start + 66_500));
            assert_eq!(received.header().unwrap().probability, Some(quantiser.levels()));
            let sent = Quantised { map: &map, quantiser: &quantiser };
            for (azimuth, range) in (0..A).flat_map(|azimuth| (0..R).map(move |range| (azimuth, range))) {
                let [visible, clear]: [Ray<W>; 2] =
                    [Plane::Visibility, Plane::Grade].map(|plane| sent.ray(plane, azimuth));
                let known = visible.known.contains(range);
                let expected = known.then(|| quantiser.levels().of(visible.get(range), clear.get(range)));
                assert_eq!(received.probability(azimuth, range), expected, "{medium:?} {rule:?}: {azimuth}, {range}");
                let at = point(azimuth, range, &mut random);
                let Some((p, most)) = received.probability_at(at).zip(table.at(&map, at)) else { continue };
                assert!(p <= most, "{medium:?} {rule:?}: {p:?} at {at:?}, where the sender has {most:?}");
                (cells, given, of_table) = (cells + 1, given + u64::from(p.raw()), of_table + u64::from(most.raw()));
            }
            let area = Footprint {
                centre: RoadPoint::new(5000, 0),
                heading: Direction::AHEAD,
                half_length_cm: 1500,
                half_width_cm: 400,
            };
            let (told, own) = (received.expected_missed(&area), table.expected_missed(&map, &area));
            assert!(told.is_some() && told >= own, "{told:?} {own:?}");
        }
        assert!(compared > 10 && cells > 10_000, "{medium:?}: {compared} scans, {cells} cells");
        // a random table loses more than a fitted one; a receiver that says 0 is safe and useless
        let share = given as f64 / of_table as f64;
        println!("{medium:?} {rule:?}: {:.0} % of p arrives", 100.0 * share);
        assert!(share > if rule == Some(Threshold::Nothing) { 0.1 } else { 0.4 }, "{medium:?} {rule:?}: {share}");
    }
}

#[test]
fn visible_is_what_keeps_the_risk_on_the_wire_as_anywhere() {
    let mut random = Random::new(4);
    let table = table(&mut random);
    let map = graded(&mut Shadows::new(3), &mut random);
    for rule in RULES {
        let quantiser = Quantiser::new(table.clone(), rule, VISIBLE_FROM);
        let (mut seen, mut hidden) = (0, 0);
        for _ in 0..20_000 {
            let at = point(random.below(A as u64) as usize, random.below(R as u64) as usize, &mut random);
            let (x, y) = map.geometry().levelling.place(at);
            let Some((azimuth, range)) = map.locate(x, y) else { continue };
            let (state, p) = quantiser.of_point(map.geometry(), [R, A], map.at(at), at);
            let sent: Ray<W> = Quantised { map: &map, quantiser: &quantiser }.ray(Plane::Visibility, azimuth);
            if !sent.known.contains(range) {
                // beyond an unknown cell nothing is sent
                continue;
            }
            assert_eq!(state.visible(), sent.get(range), "{rule:?} {azimuth} {range}");
            assert_eq!(p.is_none(), state.visibility == Visibility::Unknown);
            assert_eq!(p, table.at(&map, at));
            if rule == Some(Threshold::From(190)) && state.visible() {
                assert!(table.at(&map, at).unwrap().raw() >= 190);
            }
            seen += u32::from(state.visible());
            hidden += u32::from(state.visibility == Visibility::Invisible);
        }
        let both = !matches!(rule, Some(Threshold::Everything | Threshold::Nothing));
        assert!(seen + hidden > 10_000 && (seen > 500 && hidden > 500) == both, "{rule:?}: {seen} {hidden}");
    }
}

/// A message on its way: when it arrives, and its bytes.
type OnItsWay = Vec<(u64, Vec<u8>)>;

/// A bus that loses, delays by up to D, repeats and cuts; the sentence at every look.
fn lossy(medium: Medium, rule: Option<Threshold>, loss: f64, seed: u64) -> u64 {
    let mut random = Random::new(seed);
    let table = table(&mut random);
    let quantiser = Quantiser::new(table.clone(), rule, VISIBLE_FROM);
    let (mut sending, mut shadows) = (Sending::new(medium, &quantiser), Shadows::new(seed));
    let geometry = header(1).geometry();
    let mut history: VecDeque<(ScanNumber, u64, Map)> = VecDeque::new();
    let (mut on_its_way, mut looked): (OnItsWay, u64) = (Vec::new(), 0);
    for scan in 0..150 {
        let map = graded(&mut shadows, &mut random);
        let start = 67_000 * scan;
        sending.offer(Time::from_micros(start), &map);
        history.push_back((ScanNumber::at(Time::from_micros(start)), start, map));
        if history.len() > 20 {
            history.pop_front();
        }
        for us in (start..start + 67_000).step_by(500) {
            let now = Time::from_micros(us);
            if let Some(mut bytes) = sending.next(now) {
                if random.chance(0.01) {
                    bytes.truncate(2 + random.below(bytes.len() as u64 - 1) as usize);
                }
                if random.chance(0.04) {
                    on_its_way.push((us + random.below(3_000_000), bytes.clone()));
                }
                if !random.chance(loss) {
                    on_its_way.push((us + random.below(35_000), bytes));
                }
            }
            on_its_way.sort_by_key(|(at, _)| *at);
            let due = on_its_way.partition_point(|(at, _)| *at <= us);
            for (_, bytes) in on_its_way.drain(..due) {
                sending.deliver(now, &bytes);
            }
            if !random.chance(0.02) {
                continue;
            }
            let received = sending.map(now);
            for azimuth in 0..A {
                let Some(scan) = received.scan(azimuth) else { continue };
                let range = random.below(R as u64) as usize;
                let at = point(azimuth, range, &mut random);
                let (x, y) = geometry.levelling.place(at);
                let cell = geometry.locate(x, y, R, A);
                let (Some(p), Some((azimuth, range))) = (received.probability_at(at), cell) else { continue };
                // of the maps that may be shown: the newest that is marked with the scan, and what was before it
                let lately = history.iter().rev().filter(|(_, measured, _)| us - measured <= 400_000);
                let most = lately.map(|(.., sent)| at_most(&table, sent, at)).max().unwrap();
                assert!(p <= most, "{medium:?} {rule:?} {seed}: {p:?} at {at:?}, the sender had {most:?}");
                // and what visibility says is never older than what it says
                let visible = received.ray(Plane::Visibility, azimuth).get(range);
                if received.scan(azimuth) == Some(scan) {
                    let of_scan = history.iter().rev().find(|(number, ..)| *number == scan).unwrap();
                    let then = at_most(&table, &of_scan.2, at);
                    assert!(quantiser.levels().of(visible, false) <= then, "{medium:?} {rule:?} {seed}: {at:?}");
                }
                assert!(visible || p == quantiser.levels().of(false, true), "not visible any more: {p:?}");
                looked += 1;
            }
        }
    }
    looked
}

#[test]
fn no_loss_delay_or_repetition_makes_a_cell_more_probable() {
    let mut looked = 0;
    for (k, rule) in RULES.into_iter().enumerate() {
        for (m, medium) in MEDIA.into_iter().enumerate() {
            for loss in [0.0, 0.05, 0.3] {
                let looks = lossy(medium, rule, loss, (10 * k + m) as u64 + (loss * 1e4) as u64);
                assert!(looks > 300, "{medium:?} {rule:?} {loss}: {looks} looks");
                looked += looks;
            }
        }
    }
    assert!(looked > 50_000, "{looked}");
}

#[test]
fn a_receiver_of_one_plane_says_what_the_visible_bit_says() {
    let mut random = Random::new(2);
    let quantiser = Quantiser::new(table(&mut random), Some(Threshold::From(190)), VISIBLE_FROM);
    let mut sending = Sending::new(MEDIA[1], &quantiser);
    let mut one = Receiver::<1, A, W>::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let map = graded(&mut Shadows::new(1), &mut random);
    for us in (0..2_000_000).step_by(500) {
        let now = Time::from_micros(us);
        if us % 67_000 == 0 {
            sending.offer(now, &map);
        }
        let frame = MapSender::<Map>::next_frame(&mut sending.sender, now);
        frame.into_iter().for_each(|frame| _ = one.frame(now, &frame));
    }
    let received = one.map(SENSOR, Time::from_micros(2_000_000));
    let levels = quantiser.levels();
    let mut seen = [0; 2];
    for (azimuth, range) in (0..A).flat_map(|azimuth| (0..R).map(move |range| (azimuth, range))) {
        let ray = received.ray(Plane::Visibility, azimuth);
        let expected = ray.known.contains(range).then(|| levels.of(ray.get(range), false));
        assert_eq!(received.probability(azimuth, range), expected);
        seen[usize::from(ray.get(range))] += 1;
    }
    assert!(seen.iter().all(|n| *n > 300), "{seen:?}");
}

#[test]
fn a_sender_without_a_table_says_nothing_of_probabilities() {
    let map = graded(&mut Shadows::new(1), &mut Random::new(1));
    for medium in [MEDIA[0], MEDIA[1]] {
        let config = BroadcastConfig::new(SENSOR, medium);
        let (epoch, start) = (Epoch::new(3), Time::from_micros(0));
        let mut sender = QuantisedSender::<A, W>::new(config, header(1), None, epoch, start).unwrap();
        let mut one = Broadcaster::<A, W>::new(config, header(1), epoch, start).unwrap();
        let mut frames = 0;
        for us in (0..2_000_000).step_by(500) {
            let now = Time::from_micros(us);
            if us % 67_000 == 0 {
                MapSender::offer(&mut sender, now, &map);
                let _ = one.scan(now, &map);
            }
            let frame = MapSender::<Map>::next_frame(&mut sender, now);
            assert_eq!(frame, one.next_frame(now), "the same frames as before there were tables");
            frames += usize::from(frame.is_some());
        }
        assert!(frames > 30, "{medium:?}: {frames}");
    }
}
