//! What a block says of the unit itself: its number, the bit rate of its line, how old its maps may get.

use viewshed::unit::service::Request;
use viewshed::unit::settings::{BLOCK_LEN, Settings, UnitConfig};
use viewshed::wire::frame::CanFrame;

use super::{VERSION, World, settings};
use viewshed::unit::said::Said;

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
    world.ask(Request::Read);
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
