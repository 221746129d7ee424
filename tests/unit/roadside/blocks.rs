//! Any block with a right check sum, stored or sent: the unit comes up, runs or says why not, and answers.

use crc::Crc;
use proptest::prelude::*;
use viewshed::unit::can_service::Tool;
use viewshed::unit::reply::{Piece, Refusal, Said};
use viewshed::unit::service::Request;
use viewshed::unit::settings::{BLOCK_LEN, BlockKind, SettingsSlots, Which};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::status::{Reason, UnitState};

use super::{ADDRESSES, SENSOR, World, settings};

const EMPTY: [u8; BLOCK_LEN] = [0xFF; BLOCK_LEN];

/// Where the numbers of a block begin, and how many they are; the two buses follow.
const NUMBERS: (usize, usize) = (12, 29);

/// Smallest and largest value of every number that a unit takes at all.
const LIMITS: [[f32; 2]; NUMBERS.1] = [
    // mount
    [-10_000.0, 10_000.0],
    [-10_000.0, 10_000.0],
    [0.1, 20.0],
    [-360.0, 360.0],
    [-45.0, 45.0],
    [-45.0, 45.0],
    // field of view
    [-85.0, 85.0],
    [-85.0, 85.0],
    [-85.0, 85.0],
    [-85.0, 85.0],
    [0.0, 400.0],
    [1.0, 400.0],
    // noise
    [0.01, 5.0],
    [0.01, 10.0],
    [0.01, 20.0],
    [0.01, 5.0],
    [0.0, 3.0],
    // gate
    [-100.0, 200.0],
    [-100.0, 100.0],
    [1.0, 327.0],
    [0.0, 20.0],
    [0.0, 90.0],
    [1.0, 65_535.0],
    // visibility
    [0.0, 20.0],
    [0.01, 1.0],
    [0.01, 1.0],
    // health
    [0.01, 60.0],
    [0.01, 60.0],
    [0.01, 60.0],
];

/// A change of one number: within its limits, at or just beyond one of them, or any four bytes.
fn change() -> impl Strategy<Value = (usize, [u8; 4])> {
    let value = |number: usize| {
        let [low, high] = LIMITS[number];
        prop_oneof![
            4 => (0.0_f32..1.0).prop_map(move |share| (low + share * (high - low)).to_le_bytes()),
            2 => prop::sample::select(vec![low, high]).prop_map(f32::to_le_bytes),
            1 => prop::sample::select(vec![low.next_down(), high.next_up(), low - 1.0, high * 1.5, 0.0])
                .prop_map(f32::to_le_bytes),
            1 => any::<[u8; 4]>(),
        ]
        .prop_map(move |bytes| (NUMBERS.0 + 4 * number, bytes))
    };
    // bit rate, sample point and start of a bus
    let rate = prop::sample::select(vec![0, 9_999, 10_000, 125_000, 333_333, 500_000, 1_000_000, 1_000_001, u32::MAX]);
    let bus = (0_usize..2, rate).prop_map(|(bus, rate)| (NUMBERS.0 + 4 * NUMBERS.1 + 8 * bus, rate.to_le_bytes()));
    let rest = (0_usize..2, any::<[u8; 4]>()).prop_map(|(bus, bytes)| (NUMBERS.0 + 4 * NUMBERS.1 + 8 * bus + 4, bytes));
    // the sensor's number stays, by which it is asked here
    let at = NUMBERS.0 + 4 * NUMBERS.1 + 2 * 8;
    let delay = prop::sample::select(vec![39_u16, 40, 100, 500, 501, u16::MAX]);
    let numbers = (0_u8..9, delay).prop_map(move |(radar_id, delay)| {
        let [low, high] = delay.to_le_bytes();
        (at, [SENSOR, radar_id, low, high])
    });
    let bauds = prop::sample::select(vec![0, 57_599, 57_600, 115_200, 921_600, 1_000_000, 1_000_001, u32::MAX]);
    let baud = bauds.prop_map(move |baud: u32| (at + 4, baud.to_le_bytes()));
    prop_oneof![12 => (0..NUMBERS.1).prop_flat_map(value), 1 => bus, 1 => rest, 1 => numbers, 1 => baud]
}

/// A block with some numbers changed and a right check sum.
fn block(sequence: u32) -> impl Strategy<Value = [u8; BLOCK_LEN]> {
    prop::collection::vec(change(), 0..5).prop_map(move |changes| with(sequence, &changes))
}

fn with(sequence: u32, changes: &[(usize, [u8; 4])]) -> [u8; BLOCK_LEN] {
    let mut block = settings().to_block(sequence);
    for (at, bytes) in changes {
        block[*at..at + 4].copy_from_slice(bytes);
    }
    let sum = Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&block[..BLOCK_LEN - 4]);
    block[BLOCK_LEN - 4..].copy_from_slice(&sum.to_le_bytes());
    block
}

fn tool() -> Tool {
    Tool::new(SENSOR, Medium::Can(ADDRESSES))
}

/// What a unit is after its start: the block it runs with, or the parameter that stands against it.
#[derive(Debug, PartialEq)]
enum Came {
    Up(u32),
    Safe(String),
}

impl World {
    fn refusals(&self) -> Vec<Refusal> {
        self.said
            .iter()
            .filter_map(|said| if let Said::Refused(refusal) = said { Some(*refusal) } else { None })
            .collect()
    }

    /// Answers on both lines, and what it says of itself there agrees.
    fn came_up(&mut self) -> Came {
        self.run(700);
        let started =
            self.said.iter().find_map(|said| if let Said::Started(place) = said { Some(*place) } else { None });
        let started = started.expect("says on the bus that it starts");
        self.ports.broadcast.incoming.extend(tool().read(Which::in_use(BlockKind::Settings)));
        self.ask(Request::Read(Which::in_use(BlockKind::Settings)));
        let before = self.replies.len();
        self.run(200);
        let read: Vec<u8> =
            self.replies[before..].iter().find(|m| m[3] == 130).expect("answers on the line")[4..].to_vec();
        let state = self.last.unwrap().state;
        let status = self.status();
        match started {
            Some((slot, sequence)) => {
                let stored = self.ports.slots.slot(slot.into()).to_vec();
                assert_eq!(read, stored);
                assert!(self.said.contains(&Said::Block(Piece::new(&stored))), "{:?}", self.said);
                assert!(
                    state != UnitState::Fault && status.iter().all(|s| s.reason != Reason::Configuration),
                    "{status:?}"
                );
                assert!(self.bus.sensor(SENSOR).unwrap().header().is_some(), "it has a map to send");
                Came::Up(sequence)
            }
            None => {
                assert!(read.is_empty() && state == UnitState::Fault, "{state:?}");
                assert!(
                    status.iter().all(|s| (s.state, s.reason) == (UnitState::Fault, Reason::Configuration)),
                    "{status:?}"
                );
                Came::Safe(self.refusals().last().expect("says why").parameter().to_owned())
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Sent over either line: what is written runs after the restart, what is refused is named, and the block
    /// before goes on.
    #[test]
    fn a_block_that_is_written_runs_and_one_that_is_refused_is_named(block in block(5), over_can: bool) {
        let mut world = World::with_settings();
        world.run(20);
        if over_can {
            world.ports.broadcast.incoming.extend(tool().write(&block));
        } else {
            world.ask(Request::Write(&block));
        }
        world.run(200);
        let written = if over_can {
            let (written, refusals) = (world.said.contains(&Said::Written(2)), world.refusals());
            prop_assert!(written != refusals.last().is_some_and(|r| r.parameter().contains('.')), "{refusals:?}");
            written
        } else {
            let kind = |kind| world.replies.iter().find(|m| m[3] == kind);
            let refused = kind(132).map(|m| String::from_utf8_lossy(&m[9..]).into_owned());
            prop_assert!(kind(129).is_some() != refused.as_ref().is_some_and(|name| name.contains('.')), "{refused:?}");
            kind(129).is_some()
        };
        let mut world = World::new(world.ports.slots.0);
        prop_assert_eq!(world.came_up(), Came::Up(if written { 2 } else { 1 }));
    }

    /// Stored by whatever wrote it: the newest that runs is used.
    #[test]
    fn whatever_is_stored_a_unit_comes_up_and_answers(first in block(5), second in block(6)) {
        let alone = [first, second].map(|block| World::new([block, EMPTY]).came_up());
        let both = World::new([first, second]).came_up();
        let expected = match alone {
            [_, Came::Up(sequence)] | [Came::Up(sequence), Came::Safe(_)] => Came::Up(sequence),
            [Came::Safe(first), Came::Safe(_)] => Came::Safe(first),
        };
        prop_assert_eq!(both, expected);
    }
}

#[test]
fn blocks_that_were_accepted_and_could_never_run_are_refused_by_name() {
    let number = |number: usize, value: f32| (NUMBERS.0 + 4 * number, value.to_le_bytes());
    let rate = |bus: usize, rate: u32| (NUMBERS.0 + 4 * NUMBERS.1 + 8 * bus, rate.to_le_bytes());
    let too_high_a_slice = vec![number(23, 15.0)];
    let plane_out_of_view = vec![number(10, 0.5), number(11, 4.0)];
    for (changes, name) in [
        (too_high_a_slice, "visibility.slice_height_m"),
        (plane_out_of_view, "field_of_view.elevation_min_deg"),
        (vec![rate(0, 333_333)], "radar_bus.bit_rate"),
        (vec![rate(1, 333_333)], "broadcast_bus.bit_rate"),
    ] {
        let block = with(7, &changes);
        assert_eq!(World::new([block, EMPTY]).came_up(), Came::Safe(name.to_owned()));
        assert_eq!(World::new([settings().to_block(3), block]).came_up(), Came::Up(3), "{name}: the one before");
        let mut world = World::with_settings();
        world.run(20);
        world.ports.broadcast.incoming.extend(tool().write(&block));
        world.run(200);
        assert_eq!(world.refusals().last().map(|r| r.parameter().to_owned()).as_deref(), Some(name));
    }
}
