//! Requests that write slots: the loop stands still meanwhile, and a watchdog does not wait for long.

use viewshed::unit::can_service::Tool;
use viewshed::unit::reply::Said;
use viewshed::unit::settings::{BLOCK_LEN, BlockKind};
use viewshed::wire::broadcast::Medium;

use super::{ADDRESSES, SENSOR, World, settings};

#[test]
fn requests_to_empty_slots_that_wait_together_erase_each_slot_once() {
    let mut world = World::new([settings().to_block(1), settings().to_block(2)]);
    world.run(20);
    let mut tool = Tool::new(SENSOR, Medium::Can(ADDRESSES));
    world.ports.broadcast.incoming.extend((0..5).filter_map(|_| tool.clear(BlockKind::Settings)));
    world.step();
    assert_eq!(world.ports.slots.1, 2, "erased in one step");
    world.run(100);
    assert_eq!((world.ports.slots.0, world.ports.slots.1), ([[0xFF; BLOCK_LEN]; 2], 2));
    assert!(world.said.contains(&Said::Cleared), "{:?}", world.said);
    assert!(world.ports.broadcast.incoming.is_empty());
}

#[test]
fn of_several_requests_that_write_one_is_done_in_a_step() {
    let mut world = World::new([settings().to_block(1), settings().to_block(2)]);
    world.run(20);
    let mut tool = Tool::new(SENSOR, Medium::Can(ADDRESSES));
    let waiting = &mut world.ports.broadcast.incoming;
    waiting.extend(tool.clear(BlockKind::Settings));
    waiting.extend(tool.write(&settings().to_block(0)));
    waiting.extend(tool.clear(BlockKind::Settings));
    world.step();
    assert_eq!(world.ports.slots.1, 2, "the rest waits");
    world.run(100);
    assert_eq!((world.ports.slots.0, world.ports.slots.1), ([[0xFF; BLOCK_LEN]; 2], 4));
}
