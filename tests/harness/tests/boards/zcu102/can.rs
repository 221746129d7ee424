//! The CAN bus: an ARS408's frames in, every map out, frame by frame and cell by cell the same.

use std::collections::BTreeMap;
use std::path::PathBuf;

use viewshed::bench::flash::Flash;
use viewshed::fixed::time::Time;
use viewshed::unit::can_service::{Answers, Tool};
use viewshed::unit::reply::Said;
use viewshed::unit::settings::{BlockKind, Settings, Which};
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::status::{Reason, UnitState};
use viewshed_harness::boards::can::CanBoard;
use viewshed_harness::boards::can_twin::{Sent, Step, clusters, flashed, log};
use viewshed_harness::boards::listener::{Listener, Look};
use viewshed_harness::boards::listener::{MEDIUM, SENSOR};
use viewshed_harness::boards::{Board, Profile, firmware};
use viewshed_harness::recording::{self, ReadOptions, can_log};

use crate::{settings_of, shipped};

fn image() -> PathBuf {
    firmware::build(Board::Zcu102R5, Profile::Reference, "live").unwrap()
}

/// A receiver that hears everything: what it tells after each step.
fn heard(sent: &[Sent]) -> (Listener, Vec<Look>) {
    let mut listener = Listener::default();
    let told = sent.iter().map(|step| {
        step.maps.iter().for_each(|map| listener.sent(map));
        step.frames.iter().for_each(|frame| listener.frame(step.time, frame));
        listener.look(step.time).unwrap()
    });
    let told = told.collect();
    (listener, told)
}

/// Every map in every cell, from when the receiver trusts its sender: 0.4 s and 8 frames.
fn every_cell_is_the_same(sent: &[Sent], told: &[Look]) {
    let first = told.iter().position(|told| told.azimuths > 0).expect("maps are shown");
    let began = sent.iter().position(|step| !step.maps.is_empty()).expect("maps are sent");
    let settling = sent[first].time.since(sent[began].time).unwrap();
    assert!(settling <= 600_000, "{settling} us until maps are shown");
    for (step, told) in sent.iter().zip(told).skip(first).filter(|(step, _)| !step.maps.is_empty()) {
        assert!(told.equal, "at {:?}: {told:?}", step.time);
    }
}

#[test]
#[ignore = "needs QEMU"]
fn every_map_of_two_hundred_scans_arrives_cell_by_cell() {
    let count = std::env::var("VIEWSHED_CAN_SCANS").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    let (mut settings, scans) = shipped(f64::INFINITY);
    settings.radar_bus.listen_first = false;
    let steps = clusters(&scans, count, 240);
    assert!(steps.iter().all(|step| step.frames.len() > 100), "at least a hundred clusters a scan");
    let mut flash = flashed(&settings);
    let mut board = CanBoard::start(&image(), &flash).unwrap();
    let sent = board.run(&mut flash, &steps).unwrap();
    let [frames_in, frames_out] = [steps.iter().map(|s| s.frames.len()).sum::<usize>(), board.answer.len()];
    let maps = sent.iter().map(|step| step.maps.len()).sum::<usize>();
    let (listener, told) = heard(&sent);
    println!("{count} scans, {frames_in} frames in, {frames_out} frames out, {maps} maps");
    assert!(maps >= count - 10, "{maps} maps: one a scan but for the quiet time at the start");
    every_cell_is_the_same(&sent, &told);
    let visible = told.last().unwrap().visible_cells;
    assert!((5_000..24_000).contains(&visible), "{visible} cells are visible in the end");
    let status = listener.receiver().sensor(SENSOR).and_then(|s| s.status().copied());
    // within 13 s what stands has not settled
    assert_eq!(status.map(|s| (s.state, s.reason)), Some((UnitState::Degraded, Reason::Settling)));
}

#[test]
#[ignore = "needs QEMU"]
fn a_log_of_a_bus_gives_the_same_maps() {
    // any log of a radar of the ARS408 family, clusters or objects
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/ars408-made-up.log");
    let path = std::env::var_os("VIEWSHED_CAN_LOG").map_or(PathBuf::from(shipped), PathBuf::from);
    let reading = ReadOptions { sensor_id: Some(SENSOR), ..ReadOptions::default() };
    let recording = recording::read(&path, &reading).unwrap();
    let mut settings = settings_of(&recording);
    settings.radar_bus.listen_first = false;
    let steps = log(&can_log::of_file(&path, None).unwrap().unwrap());
    let mut flash = flashed(&settings);
    let mut board = CanBoard::start(&image(), &flash).unwrap();
    let sent = board.run(&mut flash, &steps).unwrap();
    let (_, told) = heard(&sent);
    let maps = sent.iter().map(|step| step.maps.len()).sum::<usize>();
    let frames: usize = steps.iter().map(|step| step.frames.len()).sum();
    println!("{}: {frames} frames in, {} out, {maps} maps", path.display(), board.answer.len());
    assert!(maps > 15, "{maps}");
    every_cell_is_the_same(&sent, &told);
}

#[test]
#[ignore = "needs QEMU"]
fn a_configuration_goes_over_the_bus_and_a_corrupted_one_is_refused_with_its_reason() {
    let (mut settings, scans) = shipped(f64::INFINITY);
    settings.radar_bus.listen_first = false;
    let image = image();
    let at = |ms: u64| Time::from_micros(1_000_000 + 1000 * ms);
    let silence = |from: u64, to: u64| (from..to).step_by(50).map(|ms| Step { time: at(ms), frames: Vec::new() });
    let mut tool = Tool::new(SENSOR, MEDIUM);

    // nothing was ever written: the safe state; then a block that is damaged, one that cannot be, and a good one
    let mut bad = settings.to_block(0);
    bad[40] ^= 1;
    let mut high = settings;
    high.sensor.mount.height_m = 50.0;
    let mut steps: Vec<Step> = silence(0, 1000).collect();
    for (k, block) in [bad, high.to_block(0), settings.to_block(0)].iter().enumerate() {
        steps.push(Step { time: at(1000 + 100 * k as u64), frames: tool.write(block).collect() });
    }
    steps.push(Step { time: at(1300), frames: tool.restart().into_iter().collect() });
    steps.push(Step { time: at(1320), frames: tool.read(Which::in_use(BlockKind::Settings)).into_iter().collect() });
    let mut traffic = clusters(&scans, 20, 40);
    traffic.iter_mut().for_each(|step| step.time = Time::from_micros(step.time.micros() + 1_400_000));
    steps.extend(traffic.clone());
    let mut flash = Flash::ERASED;
    let mut board = CanBoard::start(&image, &flash).unwrap();
    let sent = board.run(&mut flash, &steps).unwrap();
    let said = |sent: &[Sent]| -> Vec<Said> {
        let mut answers = Answers::new(SENSOR, MEDIUM);
        sent.iter().flat_map(|step| &step.frames).filter_map(|frame| answers.take(frame)).collect()
    };
    let all = said(&sent);
    let refused = |told: &Said| match told {
        Said::Refused(r) => Some((r.reason, r.parameter().to_owned())),
        _ => None,
    };
    let refused: Vec<(u8, String)> = all.iter().filter_map(refused).collect();
    assert_eq!(refused, [(1, String::new()), (4, String::new()), (5, "mount.height_m".to_owned())]);
    assert!(all.contains(&Said::Written(1)) && all.contains(&Said::Started(Some((0, 1)))), "{all:?}");
    let read = all.iter().find_map(|told| if let Said::Block(block) = told { Some(block) } else { None });
    assert_eq!(Settings::from_block(read.unwrap().bytes()), Ok((1, settings)));
    let (listener, told) = heard(&sent[..20]);
    let status = listener.receiver().sensor(SENSOR).and_then(|s| s.status().copied()).unwrap();
    assert_eq!((status.state, status.reason), (UnitState::Fault, Reason::Configuration));
    assert!(
        told.iter().all(|told| told.azimuths == 0) && listener.receiver().sensor(SENSOR).unwrap().header().is_none()
    );
    let (_, told) = heard(&sent);
    every_cell_is_the_same(&sent, &told);
    assert_eq!(board.flash().unwrap(), flash, "what the board keeps");
    let stack = board.closing().unwrap().stack;
    println!("live: {} of {} bytes of stack", stack[0], stack[1]);
    assert!(stack[0] > 500 && 4 * stack[0] <= 3 * stack[1], "{stack:?}");

    // it is kept without power, and refused when it rots
    let mut board = board.restart(&image).unwrap();
    assert_eq!(said(&board.run(&mut flash, &traffic).unwrap()), [Said::Started(Some((0, 1)))]);
    let mut rotten = flash.clone();
    rotten.slot_mut(0)[30] ^= 4;
    let mut board = CanBoard::start(&image, &rotten).unwrap();
    let sent = board.run(&mut rotten, &traffic).unwrap();
    assert!(matches!(said(&sent)[..], [Said::Started(None), Said::Refused(r)] if r.reason == 4));
    assert!(sent.iter().all(|step| step.maps.is_empty()), "no map in the safe state");
}

/// A bus that loses, damages, repeats, delays and reorders what the board sends.
struct Bus {
    random: u64,
    /// When it arrives, in which order, what.
    under_way: BTreeMap<(u64, u64), CanFrame>,
    number: u64,
}

impl Bus {
    fn below(&mut self, n: u64) -> u64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33) % n
    }

    fn put(&mut self, us: u64, frame: CanFrame) {
        self.number += 1;
        self.under_way.insert((us, self.number), frame);
    }

    /// Takes what is sent at a time; `bad` is the share of frames that something happens to, in percent.
    fn send(&mut self, us: u64, frames: &[CanFrame], bad: u64) {
        for frame in frames {
            let at = us + if bad > 0 { self.below(8000) } else { 0 };
            if self.below(100) >= bad {
                self.put(at, *frame);
                continue;
            }
            match self.below(6) {
                // lost
                0..3 => {}
                3 => {
                    let mut data = frame.data().to_vec();
                    for _ in 0..1 + self.below(2) {
                        let bit = self.below(64) as usize;
                        data[bit / 8] ^= 1 << (bit % 8);
                    }
                    self.put(at, CanFrame::classic(frame.id, &data).unwrap());
                }
                4 => {
                    // twice, the second time late
                    let late = us + self.below(2_400_000);
                    self.put(at, *frame);
                    self.put(late, *frame);
                }
                _ => {
                    let late = us + self.below(2_400_000);
                    self.put(late, *frame);
                }
            }
            // and frames of nobody's
            let id = CanId::Standard(0x500 + self.below(0x100) as u16);
            self.put(at, CanFrame::classic(id, &frame.data()[..4]).unwrap());
        }
    }

    fn deliver(&mut self, until: u64, listener: &mut Listener) {
        while let Some(first) = self.under_way.first_entry().filter(|first| first.key().0 <= until) {
            let ((us, _), frame) = first.remove_entry();
            listener.frame(Time::from_micros(us), &frame);
        }
    }
}

/// Puts loss, repetitions and garbage into what comes from the radar, but for the time.
fn damage(steps: &mut [Step], bus: &mut Bus) {
    for step in steps {
        let mut frames = Vec::new();
        for frame in &step.frames {
            match bus.below(100) {
                0..2 => {}
                2..4 => frames.extend([*frame, *frame]),
                4..6 => {
                    // no identifier of the bench's own
                    let id = CanId::Standard(0x100 + bus.below(0x600) as u16);
                    let data: Vec<u8> = (0..bus.below(9)).map(|_| bus.below(256) as u8).collect();
                    frames.extend([*frame, CanFrame::classic(id, &data).unwrap()]);
                }
                _ => frames.push(*frame),
            }
        }
        step.frames = frames;
    }
}

#[test]
#[ignore = "needs QEMU"]
fn loss_repetition_garbage_and_restarts_never_make_visible_and_are_over_within_a_second() {
    let (mut settings, scans) = shipped(f64::INFINITY);
    settings.radar_bus.listen_first = false;
    let image = image();
    let mut bus = Bus { random: 1, under_way: BTreeMap::new(), number: 0 };
    let mut flash = flashed(&settings);
    let mut board = Some(CanBoard::start(&image, &flash).unwrap());
    let mut sent: Vec<Sent> = Vec::new();
    // three times power: the radar's frames come whole, then damaged, then whole again
    for (from, damaged) in [(0, false), (60, true), (120, false)] {
        let mut steps = clusters(&scans, from + 60, 60).split_off(from);
        if damaged {
            damage(&mut steps, &mut bus);
        }
        let mut running = match board.take() {
            Some(board) if from > 0 => board.restart(&image).unwrap(),
            Some(board) => board,
            None => unreachable!("there is one"),
        };
        sent.extend(running.run(&mut flash, &steps).unwrap());
        board = Some(running);
    }

    let mut listener = Listener::default();
    let (mut shown_at, mut last_bad, mut moments, mut shown_meanwhile) = (Vec::new(), 0, 0, 0);
    let mut worst = 0;
    for (k, step) in sent.iter().enumerate() {
        let us = step.time.micros();
        // a bad bus for a second out of three, the receiver and the board restart once each in a good one
        let bad = match k % 45 {
            15..30 => [20, 60, 95][k / 45 % 3],
            _ => 0,
        };
        if k == 35 {
            listener.restart();
        }
        if bad > 0 || k == 35 || k % 60 == 0 {
            last_bad = us;
        }
        bus.deliver(us, &mut listener);
        step.maps.iter().for_each(|map| listener.sent(map));
        bus.send(us, &step.frames, bad);
        // whatever moment one asks at
        for later in [0, 9_000, 30_000, 66_000] {
            bus.deliver(us + later, &mut listener);
            let told = listener.look(Time::from_micros(us + later)).unwrap_or_else(|why| panic!("step {k}: {why}"));
            moments += 1;
            if later == 9_000 && bad == 0 && !step.maps.is_empty() {
                worst = if told.equal { worst } else { worst.max(us - last_bad) };
                shown_at.push((us - last_bad, told.equal));
            }
            if later == 66_000 && bad > 0 {
                shown_meanwhile += told.azimuths;
            }
        }
    }
    assert!(shown_meanwhile > 2000, "a bad bus does not silence the receiver: {shown_meanwhile} azimuths shown");
    println!(
        "{moments} moments, {shown_meanwhile} azimuths shown in bad ones; maps differ for {} ms at most afterwards",
        worst / 1000
    );
    let late: Vec<_> = shown_at.iter().filter(|(since, equal)| *since > 1_000_000 && !equal).collect();
    assert!(late.is_empty(), "{late:?}");
    let after: Vec<bool> = shown_at.iter().filter(|(since, _)| *since > 1_000_000).map(|(_, equal)| *equal).collect();
    assert!(after.len() >= 30, "{} maps looked at after a second", after.len());
}
