//! What a block says of the unit itself: its number, the bit rate of its line, how old its maps may get.

use viewshed::unit::service::Request;
use viewshed::unit::settings::{BLOCK_LEN, BlockKind, ConfigureRadar, Settings, UnitConfig, Which};
use viewshed::wire::frame::{CanFrame, CanId};

use super::{VERSION, World, settings};
use viewshed::unit::reply::Said;

fn with(unit: UnitConfig) -> World {
    World::new([Settings { unit, ..settings() }.to_block(1), [0xFF; BLOCK_LEN]])
}

#[test]
fn the_serial_line_changes_its_bit_rate_two_seconds_after_the_start() {
    let mut world = with(UnitConfig { serial_baud: 921_600, ..UnitConfig::default() });
    world.run(1999);
    assert_eq!(world.ports.serial.bauds, []);
    world.run(2000);
    assert_eq!(world.ports.serial.bauds, [921_600], "once");
    // the rate it has already is not set again
    let mut world = with(UnitConfig::default());
    world.run(3000);
    assert_eq!(world.ports.serial.bauds, []);
}

#[test]
fn a_wrong_bit_rate_locks_nobody_out() {
    let mut world = with(UnitConfig { serial_baud: 57_600, ..UnitConfig::default() });
    world.run(1500);
    world.ask(Request::Identify);
    world.run(30_000);
    assert_eq!(world.ports.serial.bauds, [], "somebody is at work at the rate of every start");
    let said: Vec<Said> = world.replies.iter().filter_map(|reply| Said::read(reply, 0)).collect();
    let identified = said.iter().find_map(|said| if let Said::Identified(unit) = said { Some(*unit) } else { None });
    let unit = identified.expect("it says which one it is");
    assert_eq!(
        (unit.board(), unit.chip, unit.is_bench, unit.grid, unit.firmware),
        ("a-board", 7, false, [50, 40], VERSION)
    );
}

#[test]
fn a_unit_sends_and_answers_by_the_number_of_its_block() {
    let mut world = with(UnitConfig { sensor: 3, ..UnitConfig::default() });
    let mut ids = std::collections::BTreeSet::new();
    for _ in 0..1000 {
        world.step_hearing(&mut |frame: &CanFrame| {
            ids.insert(frame.id.raw() / 32);
        });
    }
    assert_eq!(ids.into_iter().collect::<Vec<_>>(), [0x400 / 32 + 3]);
    // asked by another number it says nothing, asked without one it says its own
    world.ask(Request::Read(Which::in_use(BlockKind::Settings)));
    world.run(100);
    assert!(!world.replies.iter().any(|reply| reply[3] == 130));
    world.ask(Request::Identify);
    world.run(100);
    let numbers = world.replies.iter().filter_map(|reply| match Said::read(reply, 0)? {
        Said::Identified(unit) => Some(unit.sensor),
        _ => None,
    });
    assert_eq!(numbers.collect::<Vec<_>>(), [3]);
}

#[test]
fn frames_wait_in_mailboxes_no_longer_than_the_receivers_allow() {
    // nobody acknowledges: what waits is taken back when its map is too old for the receivers it was set for
    let taken_back_after = |max_delay_ms| {
        let mut world = with(UnitConfig { max_delay_ms, ..UnitConfig::default() });
        world.run(1000);
        world.ports.broadcast.stuck = true;
        let (from, before) = (world.ms, world.ports.broadcast.aborted);
        while world.ports.broadcast.aborted == before && world.ms < from + 2000 {
            world.step();
        }
        world.ms - from
    };
    let (short, long) = (taken_back_after(60), taken_back_after(300));
    assert!(short < 120 && long > 200, "{short} ms, {long} ms");
}

/// A counter that goes on by ten whenever it is read.
pub fn count() -> u32 {
    use std::sync::atomic::{AtomicU32, Ordering};
    static COUNT: AtomicU32 = AtomicU32::new(u32::MAX - 1000);
    COUNT.fetch_add(10, Ordering::Relaxed)
}

#[test]
fn frames_are_timed_in_all_and_by_stage() {
    let mut world = World::with_settings();
    world.run(660);
    world.ask(Request::Timing);
    world.run(100);
    let took = world.replies.iter().find_map(|reply| match Said::read(reply, 0)? {
        Said::Took(took) => Some(took),
        _ => None,
    });
    let took = took.expect("it answers");
    assert_eq!((took.hz, took.frames), (1000, 10));
    // another test may read the counter meanwhile
    assert!(took.stages.iter().all(|stage| stage.last >= 10 && stage.worst >= stage.last), "{took:?}");
    let stages: u32 = took.stages.iter().map(|stage| stage.last).sum();
    assert!(took.frame.last > stages, "the end is read once more: {took:?}");
    // the status says so on both lines, where nobody asked
    world.run(2000);
    for status in world.status() {
        let [last, longest] = status.frame_times.map(|time| time.tenths_of_ms().expect("measured"));
        assert!(longest >= last && u32::from(last) >= 10 * stages / 2, "{last} {longest}");
    }
}

#[test]
fn a_radar_is_configured_until_it_reads_its_settings_back_and_told_that_it_stands() {
    let mut world = with(UnitConfig { configure_radar: ConfigureRadar::Clusters, ..UnitConfig::default() });
    let mut sent = Vec::new();
    // as the radar says it twice a second: it sends objects; from the third second on clusters
    for ms in 1..=5000_u32 {
        if ms.is_multiple_of(500) {
            let output = if ms > 3000 { 0x18 } else { 0x14 };
            let state = [0x40, 0x1F, 0x40, 0x00, 0x22, output, 0x00, 0x00];
            world.ports.radar.incoming.push_back(CanFrame::classic(CanId::Standard(0x201), &state).unwrap());
        }
        world.step();
        sent.extend(world.ports.radar.mailboxes.drain(..).map(|frame| (ms, frame.id.raw())));
    }
    let times = |id| sent.iter().filter(|(_, other)| *other == id).map(|(ms, _)| *ms).collect::<Vec<_>>();
    let settings = times(0x200);
    assert!((2..=4).contains(&settings.len()) && settings[0] < 500, "{settings:?}");
    assert!(settings.iter().all(|ms| *ms <= 3500), "not once they hold: {settings:?}");
    assert!((90..=101).contains(&times(0x300).len()) && times(0x300).len() == times(0x301).len());
    // nothing is sent unless the block says so
    let mut world = World::with_settings();
    world.run(1000);
    assert!(world.ports.radar.mailboxes.is_empty());
}
