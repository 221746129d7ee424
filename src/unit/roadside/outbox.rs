//! Frames on their way through a controller's mailboxes, and until when each may leave.

use crate::fixed::time::Time;
use crate::unit::can_bus::{BusKeeper, CanPort};
use crate::wire::frame::CanFrame;

/// Frames a controller holds at most, first in, first out.
const MAILBOXES: usize = 3;
/// Until when a frame may leave that belongs to no map, microseconds after it was handed out.
const LATEST_US: u64 = 100_000;

/// What the mailboxes hold, and one frame that waits for room.
#[derive(Debug)]
pub struct Outbox {
    /// Of the frames handed over last, the newest at the end.
    deadlines: [Time; MAILBOXES],
    held: Option<(CanFrame, Time)>,
}

impl Outbox {
    pub const fn new() -> Self {
        Self { deadlines: [Time::from_micros(0); MAILBOXES], held: None }
    }

    /// Takes the mailboxes' frames back if the oldest is late, and the one that waits if that is; how many they were.
    pub fn take_back(&mut self, now: Time, port: &mut impl CanPort) -> u16 {
        let held = u16::from(self.held.take_if(|(_, deadline)| now > *deadline).is_some());
        let waiting = port.waiting().min(MAILBOXES);
        let oldest = MAILBOXES.checked_sub(waiting).and_then(|k| self.deadlines.get(k));
        if oldest.is_none_or(|deadline| now <= *deadline) {
            return held;
        }
        port.abort();
        u16::try_from(waiting).unwrap_or(u16::MAX).saturating_add(held)
    }

    /// Sends the frame that waits; whether there is none left. What is late was [taken back](Self::take_back).
    pub fn flush(&mut self, bus: &mut BusKeeper, port: &mut impl CanPort) -> bool {
        let Some((frame, deadline)) = self.held.take() else { return true };
        self.hand_over(frame, deadline, bus, port)
    }

    /// Sends a frame, or keeps it until there is room. `map` is the deadline of the map it may belong to.
    pub fn send(
        &mut self,
        frame: CanFrame,
        map: Option<Time>,
        now: Time,
        bus: &mut BusKeeper,
        port: &mut impl CanPort,
    ) {
        let latest = Time::from_micros(now.micros().saturating_add(LATEST_US));
        let deadline = map.filter(|map| now <= *map).unwrap_or(latest);
        self.hand_over(frame, deadline, bus, port);
    }

    fn hand_over(&mut self, frame: CanFrame, deadline: Time, bus: &mut BusKeeper, port: &mut impl CanPort) -> bool {
        if bus.send(&frame, port) {
            self.deadlines.rotate_left(1);
            if let Some(newest) = self.deadlines.last_mut() {
                *newest = deadline;
            }
            return true;
        }
        self.held = Some((frame, deadline));
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::can_bus::BusConfig;
    use crate::wire::frame::CanId;
    use std::collections::VecDeque;

    #[derive(Default)]
    struct Port {
        mailboxes: VecDeque<u32>,
    }

    impl CanPort for Port {
        fn receive(&mut self) -> Option<CanFrame> {
            None
        }
        fn send(&mut self, frame: &CanFrame) -> bool {
            let room = self.mailboxes.len() < MAILBOXES;
            if room {
                self.mailboxes.push_back(frame.id.raw());
            }
            room
        }
        fn abort(&mut self) {
            self.mailboxes.clear();
        }
        fn bus_off(&mut self) -> bool {
            false
        }
        fn start(&mut self, _: bool) {}
        fn waiting(&mut self) -> usize {
            self.mailboxes.len()
        }
    }

    fn at(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    fn frame(id: u16) -> CanFrame {
        CanFrame::classic(CanId::Standard(id), &[]).unwrap()
    }

    fn bus(port: &mut Port) -> BusKeeper {
        BusKeeper::start(&BusConfig { listen_first: false, ..BusConfig::default() }, port)
    }

    #[test]
    fn a_full_controller_delays_a_frame_and_loses_none() {
        let mut port = Port::default();
        let (mut bus, mut outbox) = (bus(&mut port), Outbox::new());
        for id in 1..=4 {
            assert!(outbox.flush(&mut bus, &mut port));
            outbox.send(frame(id), Some(at(80)), at(0), &mut bus, &mut port);
        }
        assert_eq!(port.mailboxes, [1, 2, 3]);
        assert!(!outbox.flush(&mut bus, &mut port), "no other one until it is gone");
        port.mailboxes.pop_front();
        assert!(outbox.flush(&mut bus, &mut port));
        assert_eq!(port.mailboxes, [2, 3, 4]);
    }

    #[test]
    fn late_frames_are_taken_back_the_moment_the_oldest_is_late() {
        let mut port = Port::default();
        let (mut bus, mut outbox) = (bus(&mut port), Outbox::new());
        outbox.send(frame(1), Some(at(80)), at(0), &mut bus, &mut port);
        outbox.send(frame(2), None, at(0), &mut bus, &mut port);
        assert_eq!((outbox.take_back(at(80), &mut port), port.waiting()), (0, 2));
        assert_eq!((outbox.take_back(at(81), &mut port), port.waiting()), (2, 0));
        // once the first has left, the second has its own deadline
        outbox.send(frame(1), Some(at(180)), at(100), &mut bus, &mut port);
        outbox.send(frame(2), None, at(100), &mut bus, &mut port);
        port.mailboxes.pop_front();
        assert_eq!(outbox.take_back(at(200), &mut port), 0);
        assert_eq!(outbox.take_back(at(201), &mut port), 1);
    }

    #[test]
    fn a_frame_that_waited_too_long_is_dropped_and_counted() {
        let mut port = Port::default();
        let (mut bus, mut outbox) = (bus(&mut port), Outbox::new());
        (1..=4).for_each(|id| outbox.send(frame(id), Some(at(80)), at(0), &mut bus, &mut port));
        assert_eq!(outbox.take_back(at(80), &mut port), 0);
        port.abort();
        assert_eq!(outbox.take_back(at(81), &mut port), 1);
        assert!(outbox.flush(&mut bus, &mut port));
        assert_eq!(port.waiting(), 0);
    }
}
