//! Lanes, heights and tables of probabilities in slots of their own: what a unit makes of them, and what it refuses.

use viewshed::bench::flash::Flash;
use viewshed::bench::start_stored;
use viewshed::fixed::time::Time;
use viewshed::probability::{Edges, ProbabilityTable, TableError, fitted_with};
use viewshed::sensor::site::{LaneList, Points, Site};
use viewshed::unit::Flow;
use viewshed::unit::can_service::{Answers, CanService, CanServiceConfig, Tool};
use viewshed::unit::identity::Identity;
use viewshed::unit::quantised::QuantisedSender;
use viewshed::unit::reply::Said;
use viewshed::unit::serial_service::SerialLine;
use viewshed::unit::service::{PART_LEN, Request};
use viewshed::unit::session::SerialSession;
use viewshed::unit::settings::{
    BLOCK_LEN, BlockError, BlockKind, MOST_BLOCK_LEN, Settings, SettingsCheck, SettingsSlots, StoredError,
    StoredSettings, Which, heights_block, lanes_block, table_block,
};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::header::Header;
use viewshed::wire::message::{Addresses, Epoch};
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer, stuff};
use viewshed::wire::status::Reason;

use crate::block::Block;
use crate::common::{SmallSender, SmallState, gantry};

type Sender = QuantisedSender<40, 2>;

const CHECK: SettingsCheck = SettingsCheck::of::<SmallState, Sender>();
const LANES: [&[[f32; 2]]; 2] = [&[[0.0, -1.75], [60.5, -1.75], [150.0, -2.0]], &[[150.0, 9.25], [0.0, 9.25]]];
const OTHER_LANES: [&[[f32; 2]]; 1] = [&[[0.0, -3.0], [100.0, -3.0]]];
const HEIGHTS: [[f32; 2]; 2] = [[0.0, 101.0], [150.0, 105.5]];
const GRID: [u8; 2] = [50, 40];

fn settings() -> Settings {
    Settings::of(gantry(6.0, 0.0))
}

fn with_place() -> Settings {
    Settings { lanes: &LANES, ground: &HEIGHTS, ..settings() }
}

fn lanes(lanes: &[&[[f32; 2]]]) -> Vec<u8> {
    let mut block = [0; MOST_BLOCK_LEN];
    let length = lanes_block(LaneList::Metres(lanes), &mut block).unwrap();
    block[..length].to_vec()
}

fn heights(points: &[[f32; 2]]) -> Vec<u8> {
    let mut block = [0; MOST_BLOCK_LEN];
    let length = heights_block(Points::Metres(points), &mut block).unwrap();
    block[..length].to_vec()
}

fn table(fingerprint: u32) -> Vec<u8> {
    let edges = Edges {
        grades: [2, 26, 51, 76, 102, 128, 153, 179, 204, 230, 255],
        ranges_cm: [2000, 4000, 6000, 8000, 10_000, 13_000, 16_000],
        azimuths: [-6000, -3000, -1500, 0, 1500, 3000, 6000],
    };
    let values = std::array::from_fn(|_| std::array::from_fn(|_| std::array::from_fn(|g| 100 + 10 * g as u8)));
    table_block(GRID, &ProbabilityTable::new(edges, values, fitted_with(fingerprint)).unwrap(), None).to_vec()
}

fn stored(flash: &Flash) -> StoredSettings {
    StoredSettings::read(flash, CHECK)
}

/// A memory into which these blocks were written.
fn flash(blocks: &[&[u8]]) -> Flash {
    let mut flash = Flash::ERASED;
    for block in blocks {
        stored(&flash).write(block, &mut flash).unwrap();
    }
    flash
}

/// The header of the maps of a unit that starts with this memory, and what it lacks; none in the safe state.
fn starts(flash: &Flash) -> Option<(Header, Option<Reason>)> {
    let (mut parameters, mut sender) = (None, None::<Sender>);
    let stored = stored(flash);
    let now = Time::from_micros(0);
    let lacking = start_stored::<SmallState, _>(
        &mut parameters,
        &mut sender,
        (&stored, flash),
        Medium::Serial,
        Epoch::new(1),
        now,
    );
    let header = StoredSettings::place(flash).ok().and_then(|place| {
        let header = stored.settings()?.build_at::<SmallState>(&place, &mut None).ok()?;
        let quantiser = StoredSettings::quantiser(stored.settings()?, &header, flash).ok().flatten();
        Some(Header { probability: quantiser.map(|q| q.levels()), ..header })
    });
    assert_eq!(sender.is_some(), header.is_some());
    header.map(|header| (header, lacking))
}

fn refused(kind: BlockKind, error: BlockError) -> StoredError {
    StoredError { kind, error }
}

#[test]
fn what_is_kept_is_what_a_pc_has_with_the_same_file() {
    let flash = flash(&[&settings().to_block(0), &heights(&HEIGHTS), &lanes(&LANES)]);
    let place = StoredSettings::place(&flash).unwrap();
    let parameters = |settings: &Settings, place: &Site<'_>| {
        let mut made = None;
        let header = settings.build_at::<SmallState>(place, &mut made).unwrap();
        (header, format!("{made:?}"))
    };
    let file = with_place();
    assert_eq!(parameters(&settings(), &place), parameters(&file, &file.place()), "to the last bit");
    assert_ne!(parameters(&settings(), &place).0.fingerprint, settings().fingerprint());
    assert_eq!(starts(&flash).unwrap().0.fingerprint, file.fingerprint());
}

#[test]
fn slots_take_turns_and_a_damaged_one_leaves_the_one_before() {
    let mut flash = flash(&[&settings().to_block(0), &lanes(&OTHER_LANES), &lanes(&LANES)]);
    let of = |lanes| Settings { lanes, ..settings() }.fingerprint();
    let fingerprint = |flash: &Flash| starts(flash).map(|(header, _)| header.fingerprint);
    assert_eq!(fingerprint(&flash), Some(of(&LANES)));
    flash.slot_mut(BlockKind::Lanes.slots()[1])[20] ^= 1;
    assert_eq!(fingerprint(&flash), Some(of(&OTHER_LANES)));
    // both: not without lanes that were given
    flash.slot_mut(BlockKind::Lanes.slots()[0])[20] ^= 1;
    assert_eq!(fingerprint(&flash), None);
    assert_eq!(stored(&flash).position(), Err(refused(BlockKind::Lanes, BlockError::CheckSum)));
    let slot = stored(&flash).find(Which::newest(BlockKind::Settings), &flash);
    assert_eq!(slot, Ok(0), "the settings themselves are still read");
    let settings_again = stored(&flash).write(&settings().to_block(0), &mut flash);
    assert_eq!(
        settings_again,
        Err(refused(BlockKind::Lanes, BlockError::CheckSum)),
        "it could not start with them either"
    );
    // a write, and emptying, get out of it
    let mut written = flash.clone();
    assert_eq!(stored(&flash).write(&lanes(&LANES), &mut written), Ok(1));
    assert_eq!(fingerprint(&written), Some(of(&LANES)));
    StoredSettings::clear(BlockKind::Lanes, &mut flash);
    assert_eq!(fingerprint(&flash), Some(settings().fingerprint()));
}

#[test]
fn a_unit_that_is_safe_for_its_lanes_keeps_its_number_and_its_bit_rates() {
    let mut numbered = settings();
    numbered.unit.sensor = 5;
    numbered.broadcast_bus.bit_rate = 250_000;
    let mut flash = flash(&[&numbered.to_block(0), &lanes(&LANES)]);
    flash.slot_mut(BlockKind::Lanes.slots()[0])[20] ^= 1;
    let stored = stored(&flash);
    assert!(stored.settings().is_none());
    assert_eq!((stored.unit().sensor, stored.buses()[1].bit_rate), (5, 250_000), "not another unit's identifiers");
}

#[test]
fn heights_that_do_not_hold_do_not_become_a_flat_road() {
    let mut flash = flash(&[&settings().to_block(0), &heights(&HEIGHTS)]);
    for byte in 0..heights(&HEIGHTS).len() {
        let before = flash.clone();
        flash.slot_mut(BlockKind::Heights.slots()[0])[byte] ^= 0x10;
        assert!(starts(&flash).is_none(), "byte {byte}");
        flash = before;
    }
    // power failed while the first block was written: nobody was told that it is there, and it is not taken for none
    flash.slot_mut(BlockKind::Heights.slots()[0])[30..].fill(0xFF);
    assert!(starts(&flash).is_none());
}

#[test]
fn blocks_a_unit_could_not_start_with_are_refused_by_name_and_not_written() {
    let mut flash = flash(&[&settings().to_block(0), &heights(&HEIGHTS), &lanes(&LANES)]);
    let before = flash.clone();
    let mut write = |block: &[u8]| stored(&before).write(block, &mut flash).unwrap_err();
    let parameter = |refused: StoredError| match refused.error {
        BlockError::Parameter(error) => (refused.kind, error.parameter, error.value),
        error => panic!("{error}"),
    };
    let crossing: &[[f32; 2]] = &[[0.0, 0.0], [50.0, 0.0], [50.0, 20.0], [20.0, -20.0]];
    assert_eq!(parameter(write(&lanes(&[LANES[0], crossing]))), (BlockKind::Lanes, "lanes", 1.0));
    assert_eq!(
        parameter(write(&lanes(&[&[[0.0, 0.0], [300.0, 0.0], [500.0, 0.0]]]))),
        (BlockKind::Lanes, "lanes", 0.0)
    );
    assert_eq!(parameter(write(&heights(&[[0.0, 0.0], [10.0, 1.3]]))), (BlockKind::Heights, "ground", 1.0));
    // a mount from which the stored lanes are out of reach
    let mut far = settings();
    far.sensor.mount.x_m = 5000.0;
    assert_eq!(parameter(write(&far.to_block(0))), (BlockKind::Settings, "ground.x_m", 0.0));
    for length in [0, 4, 11, 12, 40] {
        let cut = &lanes(&LANES)[..length];
        let kind = if length < 4 { BlockKind::Settings } else { BlockKind::Lanes };
        assert_eq!(write(cut), refused(kind, BlockError::Short), "{length}");
    }
    let mut other = lanes(&LANES);
    other[4] = 2;
    assert_eq!(write(&other), refused(BlockKind::Lanes, BlockError::Layout(2)));
    assert_eq!(flash, before);
}

#[test]
fn a_table_is_of_one_grid_and_one_configuration_and_without_it_the_unit_says_so() {
    let place = [heights(&HEIGHTS), lanes(&LANES)];
    let mut flash = flash(&[&settings().to_block(0), &place[0], &place[1]]);
    let unit = with_place().fingerprint();
    let error = stored(&flash.clone()).write(&table(settings().fingerprint()), &mut flash).unwrap_err();
    let other = TableError::Configuration { table: fitted_with(settings().fingerprint()), unit: fitted_with(unit) };
    assert_eq!(
        error,
        refused(BlockKind::Probabilities, BlockError::Table(other)),
        "that of the flat road without lanes"
    );
    let mut of_another_grid = table(unit);
    of_another_grid[12] = 200;
    let end = of_another_grid.len() - 4;
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&of_another_grid[..end]);
    of_another_grid[end..].copy_from_slice(&sum.to_le_bytes());
    let error = stored(&flash.clone()).write(&of_another_grid, &mut flash).unwrap_err();
    assert_eq!(error, refused(BlockKind::Probabilities, BlockError::Grid([200, 40])));
    assert_eq!(
        starts(&flash).map(|(header, lacking)| (header.probability, lacking)),
        Some((None, None)),
        "none is stored"
    );

    assert_eq!(stored(&flash.clone()).write(&table(unit), &mut flash), Ok(1));
    let (header, lacking) = starts(&flash).unwrap();
    assert!(header.probability.is_some() && lacking.is_none());
    // what watches the radar changes no grade
    let mut watched = settings();
    watched.unit.supervise = true;
    let mut supervised = flash.clone();
    stored(&flash).write(&watched.to_block(0), &mut supervised).unwrap();
    assert!(starts(&supervised).unwrap().0.probability.is_some());
    // what the table is not of any more: by grades, and said
    stored(&flash.clone()).write(&lanes(&OTHER_LANES), &mut flash).unwrap();
    let by_grades = |flash: &Flash| starts(flash).map(|(header, lacking)| (header.probability, lacking));
    assert_eq!(by_grades(&flash), Some((None, Some(Reason::NoProbabilities))));
    flash.slot_mut(BlockKind::Probabilities.slots()[0])[100] ^= 1;
    assert_eq!(by_grades(&flash), Some((None, Some(Reason::NoProbabilities))), "maps do not depend on it");
}

#[test]
fn kinds_there_is_no_room_for_are_refused_and_the_rest_works() {
    // a memory of one slot
    let mut slots = Block([0xFF; BLOCK_LEN]);
    let stored = StoredSettings::read(&slots, CHECK);
    assert_eq!(stored.write(&settings().to_block(0), &mut slots), Ok(1));
    let stored = StoredSettings::read(&slots, CHECK);
    for (kind, block) in [(BlockKind::Heights, heights(&HEIGHTS)), (BlockKind::Lanes, lanes(&LANES))] {
        assert_eq!(stored.write(&block, &mut slots), Err(refused(kind, BlockError::NoRoom)));
        assert_eq!(stored.find(Which::newest(kind), &slots), Err(refused(kind, BlockError::NoRoom)));
    }
    assert_eq!(stored.settings(), Some(&settings()));
    // a sender without a use for tables
    let mut flash = flash(&[&settings().to_block(0)]);
    let plain = StoredSettings::read(&flash, SettingsCheck::of::<SmallState, SmallSender>());
    let error = plain.write(&table(settings().fingerprint()), &mut flash);
    assert_eq!(error, Err(refused(BlockKind::Probabilities, BlockError::NoRoom)));
}

/// What a unit says on its serial line.
#[derive(Default)]
struct Line(Unstuffer, Vec<Said>);

impl SerialLine for Line {
    fn send(&mut self, bytes: &[u8]) -> bool {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (taken, message) = self.0.push(rest);
            rest = &rest[taken..];
            self.1.extend(message.and_then(|message| Said::read(message, 0)));
        }
        true
    }
}

struct Serial {
    session: SerialSession<64>,
    flash: Flash,
    line: Line,
}

impl Serial {
    fn new(flash: Flash) -> Self {
        let mut line = Line::default();
        let session = SerialSession::start(0, Identity::UNNAMED, Epoch::new(1), stored(&flash), &mut line);
        Self { session, flash, line }
    }

    /// The unit's answers.
    fn ask(&mut self, request: &Request<'_>) -> Vec<Said> {
        self.line.1.clear();
        let mut stuffed = [0; MOST_STUFFED];
        let n = stuff(request.message(0, 0).bytes(), &mut stuffed).unwrap();
        let mut none = None::<viewshed::unit::Unit<'_, SmallState, Sender>>;
        let flow = self.session.take(&stuffed[..n], &mut none, &mut self.flash, &mut self.line, &mut |_, _| {});
        assert_eq!(flow, Flow::Continue);
        std::mem::take(&mut self.line.1)
    }

    fn part(&mut self, block: &[u8], place: usize) -> Said {
        let rest = &block[place..];
        self.ask(&Request::Part(place as u16, &rest[..rest.len().min(PART_LEN)]))[0]
    }
}

#[test]
fn on_a_serial_line_blocks_come_and_go_in_parts() {
    let mut unit = Serial::new(flash(&[&settings().to_block(0)]));
    let block = table(settings().fingerprint());
    assert_eq!(unit.part(&block, 0), Said::Came(200));
    assert_eq!(unit.part(&block, 200), Said::Came(400));
    // one is lost, one comes twice, and one behind it is not taken
    assert_eq!(unit.part(&block, 200), Said::Came(400));
    assert_eq!(unit.part(&block, 600), Said::Came(400));
    assert_eq!((unit.part(&block, 400), unit.part(&block, 600)), (Said::Came(600), Said::Came(800)));
    assert_eq!(unit.part(&block, 800), Said::Written(1));
    assert_eq!(unit.part(&block, 800), Said::Written(1), "the answer may be lost, and nothing is written twice");
    let which = Which::newest(BlockKind::Probabilities);
    let mut read = Vec::new();
    while read.len() < block.len() {
        let said = unit.ask(&Request::ReadPart(which, read.len() as u16));
        let [Said::Part(of, place, part)] = said[..] else { panic!("{said:?}") };
        assert_eq!((of, usize::from(place)), (which, read.len()));
        read.extend_from_slice(part.bytes());
    }
    assert_eq!(read[12..block.len() - 4], block[12..block.len() - 4]);
    // not yet in use, and of nothing else there is any
    for (which, reason) in [(Which::in_use(BlockKind::Probabilities), 0x31), (Which::newest(BlockKind::Lanes), 0x21)] {
        let said = unit.ask(&Request::ReadPart(which, 0));
        assert!(matches!(said[..], [Said::Refused(refusal)] if refusal.reason == reason), "{said:?}");
    }
    let mut long = lanes(&LANES);
    long.resize(MOST_BLOCK_LEN + 1, 0);
    (long[6], long[7]) = ((MOST_BLOCK_LEN + 1) as u8, ((MOST_BLOCK_LEN + 1) >> 8) as u8);
    let said = (0..long.len()).step_by(PART_LEN).map(|place| unit.part(&long, place)).last().unwrap();
    assert!(
        matches!(said, Said::Refused(refusal) if refusal.reason == 0x27),
        "longer than there is room for: {said:?}"
    );
    assert_eq!(unit.ask(&Request::Clear(BlockKind::Probabilities)), [Said::Cleared]);
    assert_eq!(unit.flash.slot(BlockKind::Probabilities.slots()[0])[..4], [0xFF; 4]);
    assert!(stored(&unit.flash).settings().is_some(), "of the kind alone");
}

#[test]
fn on_a_bus_they_come_and_go_in_parts_of_four_bytes() {
    let medium = Medium::Can(Addresses::STANDARD);
    let mut slots = flash(&[&settings().to_block(0)]);
    let config = CanServiceConfig { gap_us: 0, ..CanServiceConfig::new(0, medium) };
    let now = Time::from_micros(0);
    let mut unit = CanService::start(config, Epoch::new(1), now, stored(&slots));
    let (mut tool, mut answers) = (Tool::new(0, medium), Answers::new(0, medium));
    let block = table(settings().fingerprint());
    let frames: Vec<_> = tool.write(&block).collect();
    assert_eq!(frames.len(), 2 + block.len() / 4);
    // the last ones come first
    let (first, rest) = frames.split_first().unwrap();
    let (last, parts) = rest.split_last().unwrap();
    for frame in [first].into_iter().chain(parts.iter().rev()).chain([last]) {
        unit.take(frame, &mut slots);
    }
    unit.take(&tool.read(Which::newest(BlockKind::Probabilities)).unwrap(), &mut slots);
    let said: Vec<Said> =
        std::iter::from_fn(|| unit.next_frame(now, &slots)).filter_map(|frame| answers.take(&frame)).collect();
    let [Said::Started(Some(_)), Said::Written(1), Said::Block(read)] = said[..] else { panic!("{said:?}") };
    assert_eq!(read.bytes()[12..block.len() - 4], block[12..block.len() - 4]);
    unit.take(&tool.read(Which::newest(BlockKind::Heights)).unwrap(), &mut slots);
    unit.take(&tool.clear(BlockKind::Probabilities).unwrap(), &mut slots);
    let said: Vec<Said> =
        std::iter::from_fn(|| unit.next_frame(now, &slots)).filter_map(|frame| answers.take(&frame)).collect();
    assert!(matches!(said[..], [Said::Cleared, Said::Refused(refusal)] if refusal.reason == 0x11), "{said:?}");
    assert!(unit.settings().is_some() && starts(&slots).unwrap().0.probability.is_none());
}
