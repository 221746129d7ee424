//! The serial lines: scans in over one UART, protected maps out over another, and what may go wrong.

use std::time::{Duration, Instant};

use viewshed::bench::record::{RECORD_LEN, Record};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::frame::thinning::Thinning;
use viewshed::map::Visibility;
use viewshed::unit::profile::reference::{Map, State};
use viewshed::unit::reply::Said;
use viewshed::unit::service::Request;
use viewshed::unit::settings::{BLOCK_LEN, BlockError, BlockKind, Settings, Which};
use viewshed::wire::message::{Addresses, Plane, Received};
use viewshed::wire::planes::{Planes, Quantised};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::serial::Unstuffer;
use viewshed::wire::status::{Reason, UnitState};
use viewshed_harness::boards::listener::Listener;
use viewshed_harness::boards::live::{Answered, SENSOR, Script, answer, on_the_line};
use viewshed_harness::boards::machine::{Emulator, Folder, Lines};
use viewshed_harness::boards::scans::Scan;
use viewshed_harness::boards::serial::{Far, LINES, SerialBoard, Waiting};
use viewshed_harness::boards::{Board, Profile, firmware};
use viewshed_harness::configure;

use crate::{kept, shipped};

/// A board that runs the live program; the emulator ends with it.
struct Running {
    line: SerialBoard,
    /// What it should have sent.
    expected: Option<Answered>,
    _emulator: Emulator,
    _folder: Folder,
}

fn start(profile: Profile) -> Running {
    let image = firmware::build(Board::Mps2An386, profile, "live").unwrap();
    let folder = Folder::new().unwrap();
    let waiting = Waiting::new(&folder.0).unwrap();
    let emulator = Emulator::start(Board::Mps2An386, &image, &folder.0, Lines::Sockets(&LINES)).unwrap();
    Running { line: waiting.accept().unwrap(), expected: None, _emulator: emulator, _folder: folder }
}

/// Sends a script and compares every byte that comes back.
fn same(profile: Profile, script: &Script) -> Running {
    let mut board = start(profile);
    let expected = answer(profile, &script.bytes);
    board.line.send(&script.bytes).unwrap();
    board.line.wait_for(expected.bytes.len(), Duration::from_secs(60)).unwrap();
    let got = &board.line.answer;
    let first = got.iter().zip(&expected.bytes).position(|(a, b)| a != b);
    assert_eq!((first, got.len()), (None, expected.bytes.len()), "first byte that differs, and how many came");
    board.expected = Some(expected);
    board
}

fn messages(bytes: &[u8]) -> Vec<Vec<u8>> {
    let (mut unstuffer, mut rest, mut all) = (Unstuffer::new(), bytes, Vec::new());
    while !rest.is_empty() {
        let (taken, message) = unstuffer.push(rest);
        rest = &rest[taken..];
        all.extend(message.map(<[u8]>::to_vec));
    }
    all
}

/// Azimuths and ranges of the reference grid.
const AZIMUTHS: usize = State::AZIMUTHS;
/// See [`AZIMUTHS`].
const RANGES: usize = State::RANGES;
/// All of its cells but one in 100.
const NEARLY_ALL: usize = AZIMUTHS * RANGES * 99 / 100;
/// Scans within which every ray is sent again.
const SCANS_OF_A_RAY: usize = 6;

type Hearing = Receiver<1, AZIMUTHS, { State::WORDS }>;

/// A receiver that heard everything when it was sent.
fn listen(answered: &Answered) -> Hearing {
    listen_to(answered)
}

/// The same with so many planes.
fn listen_to<const P: usize>(answered: &Answered) -> Receiver<1, AZIMUTHS, { State::WORDS }, P> {
    let mut receiver = Receiver::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let mut from = 0;
    for (to, now) in &answered.times {
        for message in messages(&answered.bytes[from..*to]) {
            if Received::from_bytes(&message).is_ok() {
                let _ = receiver.message(*now, &message);
            }
        }
        from = *to;
    }
    receiver
}

fn script(settings: &Settings, scans: &[Scan]) -> Script {
    let mut script = Script::default();
    script.configure(settings);
    scans.iter().for_each(|s| script.scan(s, scans[0].time));
    script
}

fn records(board: &Running) -> Vec<Record> {
    let records = board.line.trace.chunks_exact(RECORD_LEN);
    records.filter_map(|r| Record::from_bytes(r.try_into().unwrap())).collect()
}

/// Two kilobytes stay free for what was not met here.
fn enough_stack(profile: Profile, board: &Running) {
    let closing =
        records(board).into_iter().rev().find_map(|r| if let Record::Closing(c) = r { Some(c) } else { None });
    let [used, there] = closing.expect("reported at the end of every start").stack;
    println!("live, {}: {used} of {there} bytes of stack", profile.name());
    assert!(used > 500 && used + 2048 <= there, "{used} of {there}");
}

#[test]
#[ignore = "needs QEMU"]
fn every_byte_of_five_seconds_is_the_same() {
    let (settings, scans) = shipped(5.0);
    let mut script = script(&settings, &scans);
    // ends a start and reports what it took
    script.request(&Request::Restart);
    let board = same(Profile::Reference, &script);
    let frames = records(&board).into_iter().filter(|r| matches!(r, Record::Frame(f) if f.used > 0)).count();
    assert_eq!(frames, scans.len(), "a trace a frame");
    enough_stack(Profile::Reference, &board);
    // the last map as a receiver has it
    let now = on_the_line(scans.last().unwrap().time, scans[0].time);
    let far = listen(board.expected.as_ref().unwrap());
    let map = far.map(SENSOR, now);
    let visible =
        (0..AZIMUTHS * RANGES).filter(|k| map.cell(k / RANGES, k % RANGES).visibility == Visibility::Visible).count();
    assert!(visible > 5000, "{visible}");
}

#[test]
#[ignore = "needs QEMU"]
fn noise_half_messages_and_jumping_clocks_change_nothing_but_counters() {
    let (settings, scans) = shipped(4.0);
    let mut script = Script::default();
    script.configure(&settings);
    let (mut seed, first) = (1_u32, scans[0].time);
    let mut random = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        seed >> 16
    };
    for (k, scan) in scans.iter().enumerate() {
        let from = script.bytes.len();
        script.scan(scan, first);
        match k % 6 {
            // a flipped byte, a message cut in half, noise between, the same again
            1 => {
                let at = from + random() as usize % (script.bytes.len() - from);
                script.bytes[at] ^= 0x20;
            }
            2 => script.bytes.truncate(from + (script.bytes.len() - from) / 2),
            3 => script.bytes.extend((0..random() % 300).map(|_| (random() & 0xFF) as u8)),
            4 => script.bytes.extend_from_within(from..),
            _ => {}
        }
        if k == 20 || k == 40 {
            // forwards over every hold time, and back
            let jump = if k == 20 { 5_000_000 } else { 0 };
            script.time(Time::from_micros(scan.time.micros() + jump), first);
        }
    }
    let board = same(Profile::Small, &script);
    let mut counted = 0;
    for message in messages(&board.line.answer) {
        counted += usize::from(Received::from_bytes(&message).is_ok());
    }
    assert!(counted > scans.len() / 2, "maps went on: {counted} messages");
}

#[test]
#[ignore = "needs QEMU"]
fn a_radar_that_stops_makes_the_map_unknown_and_the_status_blind() {
    let (settings, scans) = shipped(2.0);
    let mut script = script(&settings, &scans);
    let (first, last) = (scans[0].time, scans.last().unwrap().time);
    let later = |ms: u64| Time::from_micros(last.micros() + ms * 1000);
    (1..=12).for_each(|k| script.time(later(k * 100), first));
    let board = same(Profile::Reference, &script);
    let now = on_the_line(later(1200), first);
    let far = listen(board.expected.as_ref().unwrap());
    let map = far.map(SENSOR, now);
    assert!((0..AZIMUTHS * RANGES).all(|k| map.cell(k / RANGES, k % RANGES).visibility == Visibility::Unknown));
    let status = far.sensor(SENSOR).and_then(|s| s.status()).unwrap();
    assert_eq!((status.state, status.reason), (UnitState::Blind, Reason::RadarSilent));
}

/// Posts that stand to the right, ahead and to the left of a radar, of which the left ones vanish.
fn posts(seconds: f64, left: bool) -> Scan {
    let post = |range_cm: u16, degrees: f32| Detection {
        range_cm,
        azimuth: Angle::from_degrees(degrees),
        elevation: Some(Angle::from_degrees(-5.0)),
        radial_velocity_cm_s: 0,
        rcs_half_dbsm: Some(20),
        snr_half_db: Some(40),
        marked: false,
    };
    let right = [post(2000, -50.0), post(3500, -48.0), post(6000, 5.0)];
    let left = [post(2000, 50.0), post(3500, 48.0)].into_iter().filter(|_| left);
    Scan {
        time: Time::from_micros(5_000_000 + (seconds * 1e6) as u64),
        reset: false,
        detections: right.into_iter().chain(left).collect(),
    }
}

#[test]
#[ignore = "needs QEMU"]
fn a_supervised_radar_that_goes_blind_to_the_left_is_unknown_there_and_its_status_says_so() {
    let (mut settings, _) = shipped(1.0);
    settings.unit.supervise = true;
    // a scan in a second, so that two minutes of learning take 121 of them, and none is a gap; then as usual, for the receiver
    (settings.health.hold_s, settings.health.reset_gap_s) = (2.0, 5.0);
    let slow = (0..140).map(|k| posts(f64::from(k), k < 126));
    let scans: Vec<Scan> = slow.chain((0..20).map(|k| posts(139.1 + 0.1 * f64::from(k), false))).collect();
    let board = same(Profile::Reference, &script(&settings, &scans));
    let now = on_the_line(scans.last().unwrap().time, scans[0].time);
    let far = listen(board.expected.as_ref().unwrap());
    let status = far.sensor(SENSOR).and_then(|s| s.status()).unwrap();
    assert_eq!((status.state, status.reason), (UnitState::Degraded, Reason::SectorBlind));
    let map = far.map(SENSOR, now);
    let known = |azimuths: std::ops::Range<usize>| {
        let cells = azimuths.flat_map(|a| (0..RANGES).map(move |r| (a, r)));
        cells.filter(|(a, r)| map.cell(*a, *r).visibility != Visibility::Unknown).count()
    };
    // six sectors of 20 degrees, from right to left; the view and a degree beside it on either side are 122
    let from_deg = |degrees: usize| (degrees + 1) * AZIMUTHS / 122;
    assert!((0..5).all(|sector| known(from_deg(20 * sector)..from_deg(20 * sector + 20)) > 1000));
    assert!((from_deg(100) + 1..AZIMUTHS).all(|a| known(a..a + 1) == 0) && known(from_deg(100) - 2..from_deg(100)) > 0);
}

#[test]
#[ignore = "needs QEMU"]
fn a_corrupted_configuration_is_refused_with_its_reason_and_nothing_is_sent_but_the_status() {
    let (settings, scans) = shipped(1.0);
    let first = scans[0].time;
    let mut script = Script::default();
    let mut block = settings.to_block(1);
    block[40] ^= 1;
    script.request(&Request::Write(&block));
    let mut wrong = settings;
    wrong.sensor.mount.height_m = 50.0;
    script.request(&Request::Write(&wrong.to_block(1)));
    script.request(&Request::Restart);
    scans.iter().for_each(|s| script.scan(s, first));
    // a session begins with the second status in time
    scans.iter().for_each(|s| script.time(s.time, first));
    let board = same(Profile::Small, &script);
    let all = messages(&board.line.answer);
    let refusals: Vec<&[u8]> = all.iter().filter(|m| m.get(3) == Some(&132)).map(|m| &m[4..]).collect();
    assert!(refusals.iter().any(|r| r[0] == 4), "the check sum");
    assert!(refusals.iter().any(|r| r[0] == 5 && &r[5..] == b"mount.height_m"), "the parameter by name");
    let far = listen(board.expected.as_ref().unwrap());
    let status = far.sensor(SENSOR).and_then(|s| s.status()).unwrap();
    assert_eq!((status.state, status.reason), (UnitState::Fault, Reason::Configuration));
    assert!(far.sensor(SENSOR).unwrap().header().is_none(), "no header, no map");
}

#[test]
#[ignore = "needs QEMU"]
fn a_configuration_reads_back_and_counts_from_the_restart_on() {
    let (settings, scans) = shipped(1.0);
    let mut script = script(&settings, &scans);
    let mut other = settings;
    other.visibility.visible_from = 0.8;
    script.request(&Request::Write(&other.to_block(0)));
    script.request(&Request::Read(Which::in_use(BlockKind::Settings)));
    script.request(&Request::Restart);
    script.request(&Request::Read(Which::in_use(BlockKind::Settings)));
    scans.iter().for_each(|s| script.scan(s, scans[0].time));
    script.request(&Request::Restart);
    let board = same(Profile::Small, &script);
    let all = messages(&board.line.answer);
    enough_stack(Profile::Small, &board);
    let blocks: Vec<_> = all
        .iter()
        .filter(|m| m.get(3) == Some(&130) && m.len() == 4 + BLOCK_LEN)
        .map(|m| Settings::from_block(&m[4..]).unwrap())
        .collect();
    assert_eq!(blocks.len(), 2);
    assert_eq!((blocks[0].1, blocks[1].1), (settings, other));
    assert_eq!((blocks[0].0, blocks[1].0), (1, 2), "sequences");
}

/// What a unit's list holds of a scan with more detections: it comes before the gate.
fn collected(mut scan: Scan) -> Scan {
    let mut thinning = Thinning::NEW;
    let mut sorted: Vec<_> = scan.detections.iter().map(|d| std::cmp::Reverse(thinning.priority(d))).zip(0..).collect();
    sorted.sort_unstable();
    sorted.truncate(State::DETECTIONS);
    let mut kept: Vec<usize> = sorted.into_iter().map(|(_, place)| place).collect();
    kept.sort_unstable();
    scan.detections = kept.into_iter().map(|place| scan.detections[place]).collect();
    scan
}

#[test]
#[ignore = "needs QEMU"]
fn lanes_heights_and_a_table_of_probabilities_outlast_a_restart_and_give_the_maps_of_a_pc() {
    let (settings, scans) = shipped(2.0);
    let first = scans[0].time;
    let mut script = Script::default();
    script.configure(&settings);
    kept::blocks(&settings).iter().for_each(|block| script.write(block));
    // not before the restart
    script.request(&Request::ReadPart(Which::in_use(BlockKind::Lanes), 0));
    script.request(&Request::ReadPart(Which::newest(BlockKind::Lanes), 0));
    script.request(&Request::Restart);
    script.request(&Request::ReadPart(Which::in_use(BlockKind::Lanes), 0));
    scans.iter().for_each(|s| script.scan(s, first));
    let board = same(Profile::Reference, &script);
    let all = messages(&board.line.answer);
    let said: Vec<Said> = all.iter().filter_map(|m| Said::read(m, SENSOR)).collect();
    let written = said.iter().filter(|said| **said == Said::Written(1)).count();
    assert_eq!(written, 4, "settings, heights, lanes, table");
    let [_, lanes, _] = kept::blocks(&settings);
    let of_lanes = |said: &&Said| match said {
        Said::Part(which, ..) => which.kind == BlockKind::Lanes,
        Said::Refused(refusal) => refusal.of_kind().0 == Some(BlockKind::Lanes),
        _ => false,
    };
    let parts: Vec<_> = said.iter().filter(of_lanes).collect();
    let [Said::Refused(none), Said::Part(_, 0, newest), Said::Part(_, 0, in_use)] = parts[..] else {
        panic!("{parts:?}")
    };
    assert_eq!((none.of_kind(), newest), ((Some(BlockKind::Lanes), BlockError::Empty.code()), in_use));
    assert!(configure::kept::same(newest.bytes(), &lanes));

    let scans: Vec<Scan> = scans.into_iter().map(collected).collect();
    let (header, map, quantiser) = kept::on_a_pc(&kept::with_place(&settings), &scans);
    let far = listen_to::<2>(board.expected.as_ref().unwrap());
    let now = on_the_line(scans.last().unwrap().time, first);
    let received = far.map(SENSOR, now);
    let told = received.header().unwrap();
    assert_eq!((told.fingerprint, told.probability), (header.fingerprint, Some(quantiser.levels())));
    let equal_of_ray = |map: &Map, a: usize| -> usize {
        let quantised = Quantised { map, quantiser: &quantiser };
        let ray = Planes::<7>::ray(&quantised, Plane::Visibility, a);
        let equal = |r: &usize| ray.bits().get(*r) == (received.cell(a, *r).visibility == Visibility::Visible);
        (0..RANGES).filter(equal).count()
    };
    let cells = |map: &Map| -> usize { (0..AZIMUTHS).map(|a| equal_of_ray(map, a)).sum() };
    // rays that were not sent again since are of a scan before
    let before = |back: usize| kept::on_a_pc(&kept::with_place(&settings), &scans[..scans.len() - back]).1;
    let recent: Vec<_> = std::iter::once(map).chain((1..=SCANS_OF_A_RAY).map(before)).collect();
    for a in 0..AZIMUTHS {
        let of_one = recent.iter().any(|map| equal_of_ray(map, a) == RANGES);
        assert!(of_one, "ray {a} is of none of the last scans on the PC");
    }
    let (_, flat, _) = kept::on_a_pc(&settings, &scans);
    let (equal, of_flat) = (cells(&recent[0]), cells(&flat));
    assert!(
        equal > NEARLY_ALL && of_flat < AZIMUTHS * RANGES * 47 / 48,
        "{equal} cells are the PC's, {of_flat} those of a flat road"
    );
}

#[test]
#[ignore = "needs QEMU"]
fn azimuths_narrower_along_the_road_are_those_of_a_pc_and_told_in_the_header() {
    let (mut settings, scans) = shipped(1.0);
    settings.visibility.far_road_deg = Some(0);
    let board = same(Profile::Reference, &script(&settings, &scans));
    let (header, map, _) = kept::on_a_pc(&settings, &scans);
    let far = listen(board.expected.as_ref().unwrap());
    let received = far.map(SENSOR, on_the_line(scans.last().unwrap().time, scans[0].time));
    let told = received.header().unwrap();
    let [first, end, times] = told.narrow.to_bytes();
    assert!(end - first > 40 && times == 4 && told.narrow == header.narrow, "{first} {end} {times}");
    let visible = |a, r| received.cell(a, r).visibility == Visibility::Visible;
    let equal = (0..AZIMUTHS * RANGES)
        .filter(|k| visible(k / RANGES, k % RANGES) == map.cell(k / RANGES, k % RANGES).visible())
        .count();
    assert!(equal > NEARLY_ALL, "{equal} cells are the PC's");
}

#[test]
#[ignore = "needs QEMU"]
fn a_line_that_takes_nothing_costs_maps_that_are_counted_and_no_safety() {
    let (settings, scans) = shipped(6.0);
    let mut script = script(&settings, &scans);
    let expected = answer(Profile::Reference, &script.bytes);
    let mut board = start(Profile::Reference);
    let (mut listener, mut unstuffer) = (Listener::default(), Unstuffer::new());
    // nobody reads the maps for two seconds
    let deaf = 30..60;
    let (mut from, mut heard, mut offered) = (0, 0, 0);
    let (mut unequal_us, mut shown_while_deaf, mut unknown_while_deaf) = (0, 0, 0);
    for (k, (to, now)) in std::mem::take(&mut script.marks).into_iter().enumerate() {
        board.line.deaf = deaf.contains(&k);
        board.line.send(&script.bytes[from..to]).unwrap();
        from = to;
        // the frame is done when its trace is there, after those of two starts
        let done = |line: &SerialBoard| line.trace.len() / RECORD_LEN > k + 3;
        let started = Instant::now();
        while !done(&board.line) && started.elapsed() < Duration::from_secs(120) {
            board.line.wait_for(usize::MAX, Duration::from_millis(5)).unwrap();
        }
        assert!(done(&board.line), "the unit goes on working: scan {k}");
        board.line.wait_for(usize::MAX, Duration::from_millis(if board.line.deaf { 1 } else { 60 })).unwrap();
        while let Some((bytes, map)) = expected.maps.get(offered).filter(|(bytes, _)| *bytes <= to) {
            assert!(*bytes <= to);
            listener.sent(map);
            offered += 1;
        }
        while heard < board.line.answer.len() {
            let (taken, message) = unstuffer.push(&board.line.answer[heard..]);
            heard += taken;
            if let Some(message) = message.filter(|m| Received::from_bytes(m).is_ok()) {
                listener.message(now, message);
            }
        }
        let told = listener.look(now).unwrap_or_else(|why| panic!("scan {k}: {why}"));
        if deaf.contains(&k) {
            shown_while_deaf += usize::from(told.azimuths > 0);
            unknown_while_deaf += usize::from(told.azimuths == 0);
        } else if k >= deaf.end && !told.equal {
            unequal_us = now.since(on_the_line(scans[deaf.end].time, scans[0].time)).unwrap();
        } else if k == deaf.start - 1 || k == scans.len() - 1 {
            assert!(told.equal && told.visible_cells > 5000, "scan {k}: {told:?}");
        }
    }
    let dropped = listener.receiver().sensor(SENSOR).and_then(|s| s.status()).map(|s| s.dropped).unwrap();
    println!(
        "deaf for {} scans: {dropped} messages dropped, shown for {shown_while_deaf} scans more, the last map that differs {} ms afterwards",
        deaf.len(),
        unequal_us / 1000
    );
    assert!((1..=5).contains(&shown_while_deaf) && unknown_while_deaf >= deaf.len() - 5, "maps age to unknown");
    assert!(dropped > 30 && unequal_us < 1_000_000, "{dropped} dropped, {unequal_us} us");
}
