//! A unit configured over CAN: written, read back, applied at the restart; and what may go wrong on the way.

use proptest::prelude::*;
use viewshed::fixed::time::Time;
use viewshed::unit::Flow;
use viewshed::unit::can_service::{ANSWER, Answers, CanService, CanServiceConfig, INCOMPLETE, REQUEST, Tool};
use viewshed::unit::identity::Identity;
use viewshed::unit::profile::reference::State;
use viewshed::unit::profile::small;
use viewshed::unit::reply::{Piece, Said};
use viewshed::unit::settings::{
    BLOCK_LEN, BlockError, BlockKind, Settings, SettingsSlots, StoredError, StoredSettings, Which,
};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Epoch, Packet, Packing};
use viewshed::wire::receive::{Accepted, Receiver, ReceiverLimits, Refused};
use viewshed::wire::status::{Reason, Status, UnitState};

use crate::common::gantry;

const SENSOR: u8 = 2;
const CLASSIC: Medium = Medium::Can(Addresses::STANDARD);
const FD: Medium = Medium::CanFd(Addresses::STANDARD);

/// A receiver of the reference grid's maps.
type MapReceiver = Receiver<1, { State::AZIMUTHS }, { State::WORDS }>;

#[derive(Clone)]
struct InRam([[u8; BLOCK_LEN]; 2], usize);

impl SettingsSlots for InRam {
    fn slot(&self, slot: usize) -> &[u8] {
        self.0.get(slot).map_or(&[], |slot| slot)
    }

    fn write(&mut self, slot: usize, block: &[u8]) {
        self.0[slot][..block.len()].copy_from_slice(block);
        self.1 += 1;
    }
}

fn empty() -> InRam {
    InRam([[0xFF; BLOCK_LEN]; 2], 0)
}

fn at(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

fn settings(height_m: f32) -> Settings {
    Settings::of(gantry(height_m, 0.0))
}

fn stored(slots: &InRam) -> StoredSettings {
    StoredSettings::read(slots, small::CHECK)
}

fn start(medium: Medium, slots: &InRam) -> CanService {
    let config = CanServiceConfig { gap_us: 0, ..CanServiceConfig::new(SENSOR, medium) };
    CanService::start(config, Epoch::new(1), at(0), stored(slots))
}

fn send(frames: impl Iterator<Item = CanFrame>, unit: &mut CanService, slots: &mut InRam) {
    for frame in frames {
        assert_eq!(unit.take(&frame, slots), Some(Flow::Continue));
    }
}

/// Everything the unit has to say now.
fn answers(unit: &mut CanService, slots: &InRam, medium: Medium) -> Vec<Said> {
    let mut answers = Answers::new(SENSOR, medium);
    std::iter::from_fn(|| unit.next_frame(at(0), slots)).filter_map(|frame| answers.take(&frame)).collect()
}

#[test]
fn a_block_is_written_read_back_and_counts_from_the_restart_on() {
    for medium in [CLASSIC, FD] {
        let (mut slots, mut tool) = (empty(), Tool::new(SENSOR, medium));
        let mut unit = start(medium, &slots);
        let mut sequence = 0;
        for height in [6.0, 7.0, 8.0] {
            let before = unit.settings().copied();
            for frame in tool.write(&settings(height).to_block(99)) {
                assert_eq!(unit.take(&frame, &mut slots), Some(Flow::Continue));
            }
            sequence += 1;
            assert!(answers(&mut unit, &slots, medium).contains(&Said::Written(sequence)));
            unit.take(&tool.read(Which::newest(BlockKind::Settings)).unwrap(), &mut slots);
            let written = settings(height).to_block(sequence);
            assert_eq!(
                answers(&mut unit, &slots, medium),
                [Said::Block(Piece::new(&written))],
                "what was written reads back"
            );
            assert_eq!(unit.settings().copied(), before, "not before the restart");
            assert_eq!(unit.take(&tool.restart().unwrap(), &mut slots), Some(Flow::Restart));
            unit = start(medium, &slots);
            assert_eq!(unit.settings(), Some(&settings(height)));
            let slot = 1 - (sequence & 1) as u8;
            assert_eq!(answers(&mut unit, &slots, medium), [Said::Started(Some((slot, sequence)))], "slots take turns");
            unit.take(&tool.read(Which::in_use(BlockKind::Settings)).unwrap(), &mut slots);
            let read = answers(&mut unit, &slots, medium);
            let [Said::Block(block)] = read.as_slice() else { panic!("{read:?}") };
            assert_eq!(Settings::from_block(block.bytes()), Ok((sequence, settings(height))));
        }
    }
}

#[test]
fn the_messages_are_these_bytes() {
    let (mut slots, mut tool) = (empty(), Tool::new(SENSOR, CLASSIC));
    let block = settings(6.0).to_block(1);
    let frames: Vec<String> = tool.write(&block).map(|frame| format!("{frame:?}")).collect();
    assert_eq!(frames.len(), 2 + BLOCK_LEN / 4);
    // begin, 160 bytes; part 0 is the magic; part 39 and the completion have the check sum
    let sum: String = block[BLOCK_LEN - 4..].iter().map(|b| format!("{b:02X}")).collect();
    assert_eq!(frames[0], "458#6300010000A00000");
    assert_eq!(frames[1], "458#3F01020056534342");
    assert_eq!(frames[40][6..], format!("0A0227{sum}"), "{}", frames[40]);
    assert_eq!(frames[41][6..], format!("0B0300{sum}"), "{}", frames[41]);
    // the rest is the specification's example
    let mut unit = start(CLASSIC, &slots);
    let mut talk: Vec<CanFrame> = (0..2).map(|_| unit.next_frame(at(0), &slots).unwrap()).collect();
    let read = tool.read(Which::in_use(BlockKind::Settings)).unwrap();
    assert_eq!(unit.take(&read, &mut slots), Some(Flow::Continue));
    talk.extend([read, unit.next_frame(at(0), &slots).unwrap(), tool.restart().unwrap()]);
    let page = include_str!("../../src/wire/SPECIFICATION.md");
    let (_, example) = page.split_once("```configuration\n").unwrap();
    let (example, _) = example.split_once("```").unwrap();
    let example: Vec<&str> = example.lines().map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(talk.iter().map(|frame| format!("{frame:?}")).collect::<Vec<_>>(), example);
}

#[test]
fn a_corrupted_block_is_refused_with_its_reason_and_the_unit_is_in_its_safe_state() {
    let mut slots = InRam([settings(6.0).to_block(1), [0xFF; BLOCK_LEN]], 0);
    slots.0[0][40] ^= 1;
    for medium in [CLASSIC, FD] {
        let mut unit = start(medium, &slots);
        assert_eq!((unit.settings(), unit.refusal()), (None, Some(StoredError::of_settings(BlockError::CheckSum))));
        let said = answers(&mut unit, &slots, medium);
        assert!(matches!(said[..], [Said::Started(None), Said::Refused(r)] if r.reason == 4), "{said:?}");
        // the status says it to everybody, at least twice a second
        let mut receiver = MapReceiver::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
        let mut last = 0;
        for ms in 0..3000 {
            let Some(frame) = unit.next_status(at(ms), Status::starting(0)) else { continue };
            // a session begins with the second
            let expected = if last == 0 { Err(Refused::FirstOfEpoch) } else { Ok(Accepted::Status) };
            assert_eq!(receiver.frame(at(ms), &frame), expected, "{ms} ms");
            assert!(ms - last <= 500);
            last = ms.max(1);
        }
        let status = receiver.sensor(SENSOR).and_then(|s| s.status()).unwrap();
        assert_eq!((status.state, status.reason), (UnitState::Fault, Reason::Configuration));
        assert!(status.uptime_s >= 1 && last >= 2500);
    }
}

#[test]
fn a_parameter_is_refused_by_its_name_and_value() {
    let (mut slots, mut tool) = (empty(), Tool::new(SENSOR, CLASSIC));
    let mut unit = start(CLASSIC, &slots);
    let mut narrow = settings(6.0);
    narrow.visibility.slice_height_m = 50.0;
    for (block, name, value) in
        [(settings(50.0).to_block(1), "mount.height_m", 50.0), (narrow.to_block(1), "visibility.slice_height_m", 50.0)]
    {
        send(tool.write(&block), &mut unit, &mut slots);
        let said = answers(&mut unit, &slots, CLASSIC);
        let Some(Said::Refused(refusal)) = said.last() else { panic!("{said:?}") };
        assert_eq!((refusal.reason, refusal.parameter(), refusal.value()), (5, name, value));
    }
    assert_eq!(slots.1, 0, "nothing was written");
}

#[test]
fn a_lost_part_is_asked_for_and_a_repeated_completion_writes_once() {
    let (mut slots, mut tool) = (empty(), Tool::new(SENSOR, CLASSIC));
    let mut unit = start(CLASSIC, &slots);
    let block = settings(6.0).to_block(1);
    let frames: Vec<CanFrame> = tool.write(&block).collect();
    for (k, frame) in frames.iter().enumerate() {
        if k != 18 {
            unit.take(frame, &mut slots);
        }
    }
    let said = answers(&mut unit, &slots, CLASSIC);
    let Some(Said::Refused(refusal)) = said.last() else { panic!("{said:?}") };
    assert_eq!((refusal.reason, refusal.detail[0], slots.1), (INCOMPLETE, 17, 0));
    send(tool.again(&block, 17), &mut unit, &mut slots);
    assert_eq!(answers(&mut unit, &slots, CLASSIC), [Said::Written(1)]);
    unit.take(frames.last().unwrap(), &mut slots);
    assert_eq!((answers(&mut unit, &slots, CLASSIC), slots.1), (vec![Said::Written(1)], 1), "the answer was lost");
    // the parts alone, without a beginning, are of no block
    send(frames[1..].iter().copied(), &mut unit, &mut slots);
    assert_eq!(slots.1, 1);
}

#[test]
fn receivers_of_maps_and_other_sensors_units_leave_these_messages_alone() {
    let (mut slots, mut tool) = (empty(), Tool::new(SENSOR, CLASSIC));
    let block = settings(6.0).to_block(1);
    let mut other = CanService::start(CanServiceConfig::new(3, CLASSIC), Epoch::new(1), at(0), stored(&slots));
    let mut receiver = MapReceiver::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let mut unit = start(CLASSIC, &slots);
    let status = unit.next_status(at(0), Status::starting(0)).unwrap();
    assert_eq!(receiver.frame(at(0), &status), Err(Refused::FirstOfEpoch));
    assert_eq!(receiver.frame(at(0), &status), Ok(Accepted::Status));
    for frame in tool.write(&block) {
        assert_eq!(other.take(&frame, &mut slots), None);
        assert_eq!(receiver.frame(at(10), &frame), Ok(Accepted::Other(REQUEST)));
        let mut damaged = frame.data().to_vec();
        damaged[5] ^= 4;
        assert_eq!(unit.take(&CanFrame::classic(frame.id, &damaged).unwrap(), &mut slots), None);
    }
    let answer = unit.next_frame(at(20), &slots).unwrap();
    assert_eq!(receiver.frame(at(20), &answer), Ok(Accepted::Other(ANSWER)));
    // requests are of epoch 0 and the unit of epoch 1: the session goes on
    assert_eq!(receiver.sensor(SENSOR).unwrap().epoch(), Some(Epoch::new(1)));
    let foreign = CanFrame::classic(CanId::Standard(0x600), &[0; 8]).unwrap();
    assert_eq!(unit.take(&foreign, &mut slots), None);
}

#[test]
fn answers_keep_their_distance_and_identifiers_are_where_the_installation_has_them() {
    let slots = InRam([settings(6.0).to_block(1), settings(7.0).to_block(2)], 0);
    let addresses = Addresses::new(CanId::Extended(0x0A00_0000)).unwrap();
    let medium = Medium::Can(addresses);
    let config = CanServiceConfig::new(SENSOR, medium);
    let mut unit = CanService::start(config, Epoch::new(1), at(0), stored(&slots));
    let mut tool = Tool::new(SENSOR, medium);
    unit.take(&tool.read(Which::in_use(BlockKind::Settings)).unwrap(), &mut slots.clone());
    let mut sent = Vec::new();
    for us in 0..200_000 {
        let now = Time::from_micros(us);
        sent.extend(unit.next_frame(now, &slots).map(|frame| (us, frame)));
    }
    assert_eq!(sent.len(), 1 + BLOCK_LEN / 4);
    assert!(sent.windows(2).all(|w| w[1].0 - w[0].0 == 2000));
    assert!(sent.iter().all(|(_, frame)| frame.id == CanId::Extended(0x0A00_0000 + 32 * 2 + 25)));
    // a clock that steps back does not silence it
    unit.take(&tool.read(Which::in_use(BlockKind::Settings)).unwrap(), &mut slots.clone());
    assert!(unit.next_frame(Time::from_micros(0), &slots).is_some());
}

/// A unit with a chip of its own.
fn unit_of(chip: u32, slots: &InRam) -> CanService {
    let identity = Identity { board: "a-board", chip, is_bench: false, grid: [100, 64] };
    let config = CanServiceConfig { gap_us: 0, identity, ..CanServiceConfig::new(SENSOR, CLASSIC) };
    CanService::start(config, Epoch::new(1), at(0), stored(slots))
}

#[test]
fn two_units_of_one_number_are_told_apart_by_their_chips() {
    let chips = [0x0102_0305, 0x0102_0309];
    let mut slots = [empty(), empty()];
    let mut units = [0, 1].map(|k| unit_of(chips[k], &slots[k]));
    let mut tool = Tool::new(SENSOR, CLASSIC);
    for (unit, slots) in units.iter_mut().zip(&mut slots) {
        while unit.next_frame(at(0), slots).is_some() {}
        unit.take(&tool.identify().unwrap(), slots);
    }
    // both answer, 16 ms apart
    let mut heard = Vec::new();
    for ms in 0..300 {
        for (unit, slots) in units.iter_mut().zip(&slots) {
            let Some(frame) = unit.next_frame(at(ms), slots) else { continue };
            let Some(Said::Identified(unit)) = Answers::new(SENSOR, CLASSIC).take(&frame) else { panic!("{frame:?}") };
            heard.push((ms, unit.chip));
        }
    }
    assert_eq!(heard, [(20, chips[0]), (36, chips[1])]);
    // one of them is named, and takes a number of its own
    let mut own = settings(6.0);
    own.unit.sensor = 5;
    let frames: Vec<CanFrame> = tool.address(chips[1]).into_iter().chain(tool.write(&own.to_block(0))).collect();
    for (unit, slots) in units.iter_mut().zip(&mut slots) {
        for frame in &frames {
            assert_eq!(unit.take(frame, slots), Some(Flow::Continue));
        }
    }
    assert_eq!([slots[0].1, slots[1].1], [0, 1], "blocks written");
    assert_eq!(answers(&mut units[0], &slots[0], CLASSIC), []);
    let said = answers(&mut units[1], &slots[1], CLASSIC);
    assert!(matches!(said[..], [Said::Written(1), Said::Identified(unit)] if unit.chip == chips[1]), "{said:?}");
    assert_eq!(stored(&slots[1]).unit().sensor, 5);
    // a restart is not for the other one either, until all are named again
    let restart = tool.restart().unwrap();
    assert_eq!(units[0].take(&restart, &mut slots[0]), Some(Flow::Continue));
    assert_eq!(units[1].take(&restart, &mut slots[1]), Some(Flow::Restart));
    units[0].take(&tool.address(0).unwrap(), &mut slots[0]);
    assert_eq!(units[0].take(&restart, &mut slots[0]), Some(Flow::Restart));
}

#[test]
fn a_clock_that_steps_back_keeps_nobody_from_saying_which_unit_it_is() {
    let slots = empty();
    let mut unit = unit_of(63, &slots);
    while unit.next_frame(at(5000), &slots).is_some() {}
    unit.take(&Tool::new(SENSOR, CLASSIC).identify().unwrap(), &mut slots.clone());
    assert!(unit.next_frame(at(5000), &slots).is_none(), "its turn is 252 ms later");
    assert!(unit.next_frame(at(10), &slots).is_some());
}

#[test]
fn emptied_slots_count_from_the_restart_on() {
    for medium in [CLASSIC, FD] {
        let (mut slots, mut tool) =
            (InRam([settings(6.0).to_block(1), settings(7.0).to_block(2)], 0), Tool::new(SENSOR, medium));
        let mut unit = start(medium, &slots);
        send(tool.write(&settings(8.0).to_block(0)), &mut unit, &mut slots);
        let last = tool.write(&settings(8.0).to_block(0)).last().unwrap();
        answers(&mut unit, &slots, medium);
        send(tool.clear(BlockKind::Settings).into_iter(), &mut unit, &mut slots);
        assert_eq!(answers(&mut unit, &slots, medium), [Said::Cleared]);
        assert_eq!(unit.settings(), Some(&settings(7.0)), "it runs on");
        // there is nothing to read, and the block that was written before does not count as written any more
        send(tool.read(Which::in_use(BlockKind::Settings)).into_iter().chain([last]), &mut unit, &mut slots);
        let said = answers(&mut unit, &slots, medium);
        assert!(matches!(said[..], [Said::Refused(_)]), "{said:?}");
        let restarted = start(medium, &slots);
        assert_eq!(
            (restarted.settings(), restarted.refusal()),
            (None, Some(StoredError::of_settings(BlockError::Empty)))
        );
    }
}

#[test]
fn a_block_of_layout_1_is_taken_and_the_units_own_figures_stay() {
    let mut own = settings(6.0);
    own.unit.serial_baud = 921_600;
    own.visibility.far_road_deg = Some(12);
    let mut slots = InRam([own.to_block(1), [0xFF; BLOCK_LEN]], 0);
    let (mut unit, mut tool) = (start(CLASSIC, &slots), Tool::new(SENSOR, CLASSIC));
    // as tools before layout 2 make it
    let mut old = settings(7.0).to_block(0)[..148].to_vec();
    (old[4], old[6]) = (1, 148);
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&old[..144]);
    old[144..].copy_from_slice(&sum.to_le_bytes());
    send(tool.write(&old), &mut unit, &mut slots);
    assert!(answers(&mut unit, &slots, CLASSIC).contains(&Said::Written(2)));
    let now = stored(&slots);
    let said = now.settings().map(|s| (s.sensor.mount.height_m, s.unit.serial_baud, s.visibility.far_road_deg));
    assert_eq!(said, Some((7.0, 921_600, Some(12))));
    // one that an older firmware left in its slot is read back as it is
    let slot: [u8; BLOCK_LEN] = std::array::from_fn(|k| old.get(k).copied().unwrap_or(0xFF));
    let slots = InRam([slot, [0xFF; BLOCK_LEN]], 0);
    let mut unit = start(CLASSIC, &slots);
    unit.take(&tool.read(Which::in_use(BlockKind::Settings)).unwrap(), &mut slots.clone());
    let said = answers(&mut unit, &slots, CLASSIC);
    assert!(said.contains(&Said::Block(Piece::new(&old))), "{said:?}");
}

proptest! {
    /// Whatever requests and answers pass their check sums, nothing is written that does not hold.
    #[test]
    fn any_requests_and_answers_are_taken(
        messages in prop::collection::vec((prop_oneof![0_u8..5, 128_u8..138, any::<u8>()], any::<[u8; 5]>()), 0..200),
    ) {
        let (mut slots, mut unit) = (empty(), start(CLASSIC, &empty()));
        let mut answers = Answers::new(SENSOR, CLASSIC);
        for (kind, [number, rest @ ..]) in messages {
            let own = [&[kind, number][..], &rest[..]].concat();
            for message in [REQUEST, ANSWER] {
                let packet = Packet::new(Packing::Classic, SENSOR, message, Epoch::new(3), &own).protect(0, None);
                let frame = packet.frame(&Addresses::STANDARD).unwrap();
                let _ = (unit.take(&frame, &mut slots), answers.take(&frame));
            }
            prop_assert!(std::iter::from_fn(|| unit.next_frame(at(0), &slots)).take(200).count() < 200);
            prop_assert_eq!(slots.1, 0, "no block of random bytes holds");
        }
    }

    /// Two blocks on a bus that loses, repeats and reorders: whatever is written is one of them, whole.
    #[test]
    fn only_whole_blocks_are_written(
        order in prop::collection::vec((0_usize..84, 0_usize..6), 0..160),
        lost in prop::collection::vec(0_usize..84, 0..4),
    ) {
        let mut tool = Tool::new(SENSOR, CLASSIC);
        let blocks = [settings(6.0).to_block(1), settings(7.0).to_block(1)];
        let mut frames: Vec<(usize, CanFrame)> = tool.write(&blocks[0]).collect::<Vec<_>>().into_iter().enumerate().collect();
        frames.extend(tool.write(&blocks[1]).enumerate().map(|(k, frame)| (42 + k, frame)));
        frames.retain(|(k, _)| !lost.contains(k));
        for (k, to) in order {
            let Some(place) = frames.iter().position(|(n, _)| *n == k) else { continue };
            let copy = frames[place];
            frames.insert((place + to).min(frames.len()), copy);
        }
        let mut slots = empty();
        let mut unit = start(CLASSIC, &slots);
        for (_, frame) in &frames {
            unit.take(frame, &mut slots);
            for slot in &slots.0 {
                let read = Settings::from_block(slot).map(|(_, settings)| settings);
                let whole = [Err(BlockError::Empty), Ok(settings(6.0)), Ok(settings(7.0))];
                prop_assert!(whole.contains(&read), "{read:?}");
            }
        }
    }
}
