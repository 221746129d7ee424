//! A unit on serial lines that take nothing for a while.

use viewshed::fixed::time::Time;
use viewshed::inputs::native::{NativeMedium, NativeSender};
use viewshed::unit::Unit;
use viewshed::unit::identity::Identity;
use viewshed::unit::serial_service::SerialLine;
use viewshed::unit::service::Request;
use viewshed::unit::session::SerialSession;
use viewshed::unit::settings::{BLOCK_LEN, Settings, SettingsCheck, StoredSettings};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::{Epoch, Message, Received};
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer, stuff};
use viewshed::wire::status::{Reason, Status, UnitState};

use crate::block::Block;
use crate::common::{SmallSender, SmallState, Vehicle, gantry, small_unit};

#[derive(Default)]
struct Narrow {
    open: bool,
    messages: usize,
}

impl SerialLine for Narrow {
    fn send(&mut self, _: &[u8]) -> bool {
        self.messages += usize::from(self.open);
        self.open
    }
}

#[test]
fn a_line_that_takes_nothing_costs_messages_that_are_counted_and_not_the_unit() {
    let settings = Settings::of(gantry(6.0, 0.0));
    let (parameters, mut sender) = small_unit(&settings, Medium::Serial, 1, Time::from_micros(0));
    let mut state = Box::new(SmallState::new());
    let mut map = parameters.map();
    let mut unit = Some(Unit::new(&parameters, &mut *state, &mut map, &mut sender));
    let (mut slots, mut line) = (Block(settings.to_block(1)), Narrow::default());
    let stored = StoredSettings::read(&slots, SettingsCheck::of::<SmallState, SmallSender>());
    let mut session = SerialSession::<64>::start(0, Identity::UNNAMED, Epoch::new(1), stored, &mut line);
    assert_eq!(session.settings(), Some(&settings));

    let (mut radar, car) = (NativeSender::new(0), Vehicle::car(40.0, 2.0, 22.0));
    let mut after = Vec::new();
    for k in 0..60_u64 {
        line.open = k >= 40;
        let scan = car.at(k as f64 / 15.0).detections(&gantry(6.0, 0.0), true);
        for message in radar.scan(Time::from_micros(1 + k * 66_667), false, &scan, NativeMedium::Serial) {
            let mut stuffed = [0; MOST_STUFFED];
            let n = stuff(message.bytes(), &mut stuffed).unwrap();
            session.take(&stuffed[..n], &mut unit, &mut slots, &mut line, &mut |_, _| {});
        }
        after.push((line.messages, unit.as_mut().unwrap().broadcast().status_mut().dropped));
    }
    assert_eq!(after[39].0, 0);
    assert!(after[39].1 > 30, "{after:?}");
    assert!(after[59].0 >= 20, "a map a scan from then on: {after:?}");
    assert!(after[59].1 <= after[40].1 + 1, "and nothing more is dropped: {after:?}");
}

#[test]
fn a_radar_that_stops_is_told_by_the_units_own_clock() {
    let settings = Settings::of(gantry(6.0, 0.0));
    let (parameters, mut sender) = small_unit(&settings, Medium::Serial, 1, Time::from_micros(0));
    let mut state = Box::new(SmallState::new());
    let mut map = parameters.map();
    let mut unit = Some(Unit::new(&parameters, &mut *state, &mut map, &mut sender));
    let (mut slots, mut line) = (Block(settings.to_block(1)), Narrow { open: true, messages: 0 });
    let stored = StoredSettings::read(&slots, SettingsCheck::of::<SmallState, SmallSender>());
    let mut session = SerialSession::<64>::start(0, Identity::UNNAMED, Epoch::new(1), stored, &mut line);

    let (mut radar, car) = (NativeSender::new(0), Vehicle::car(40.0, 2.0, 22.0));
    for k in 0..20_u64 {
        let scan = car.at(k as f64 / 15.0).detections(&gantry(6.0, 0.0), true);
        for message in radar.scan(Time::from_micros(1 + k * 66_667), false, &scan, NativeMedium::Serial) {
            let mut stuffed = [0; MOST_STUFFED];
            let n = stuff(message.bytes(), &mut stuffed).unwrap();
            session.take(&stuffed[..n], &mut unit, &mut slots, &mut line, &mut |_, _| {});
        }
    }
    let last = session.now();
    assert_eq!(unit.as_ref().unwrap().offered(), Some(last));
    let mut sent = Vec::new();
    for ms in [400, 500, 501, 550, 601, 700, 702] {
        let before = line.messages;
        session.idle(Time::from_micros(last.micros() + 1000 * ms), &mut unit, &mut line);
        let unit = unit.as_mut().unwrap();
        let offered = unit.offered().and_then(|t| t.since(last)).unwrap();
        let status = unit.broadcast().status_mut();
        sent.push((ms, status.state, status.reason, offered / 1000, line.messages > before));
    }
    // held for half a second, then unknown, ten times a second
    // a second after the start
    let (settling, silent) = ((UnitState::Degraded, Reason::Settling), (UnitState::Blind, Reason::RadarSilent));
    let expected = [(400, settling, 0), (500, settling, 0), (501, silent, 501), (550, silent, 501), (601, silent, 601)];
    for (sent, (ms, (state, reason), offered)) in sent.iter().zip(expected) {
        assert_eq!((sent.0, sent.1, sent.2, sent.3), (ms, state, reason, offered));
    }
    assert!(sent[2].4 && sent[4].4, "{sent:?}");
}

/// Messages as they are stuffed.
#[derive(Default)]
struct Kept(Vec<Vec<u8>>);

impl SerialLine for Kept {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.0.push(bytes.to_vec());
        true
    }
}

#[test]
fn the_safe_state_is_told_in_the_epoch_of_the_start_four_times_a_second() {
    let mut slots = Block([0xFF; BLOCK_LEN]);
    for epoch in [Epoch::new(1), Epoch::new(9)] {
        let mut line = Kept::default();
        let stored = StoredSettings::read(&slots, SettingsCheck::of::<SmallState, SmallSender>());
        let mut session = SerialSession::<64>::start(0, Identity::UNNAMED, epoch, stored, &mut line);
        let mut unit: Option<Unit<'_, SmallState, SmallSender>> = None;
        line.0.clear();
        for ms in 0..10_000 {
            session.idle(Time::from_micros(1000 * ms), &mut unit, &mut line);
        }
        assert_eq!(line.0.len(), 40);
        for (k, stuffed) in line.0.iter().enumerate() {
            let mut unstuffer = Unstuffer::new();
            let received = Received::from_bytes(unstuffer.push(stuffed).1.unwrap()).unwrap();
            assert_eq!((received.message, received.epoch), (Message::Status, epoch));
            let mut status = Status::default();
            status.take(received.own).unwrap();
            assert_eq!((status.state, status.reason), (UnitState::Fault, Reason::Configuration));
            assert_eq!(status.uptime_s, k as u32 / 4);
        }
        // it takes a block all the same
        let mut stuffed = [0; MOST_STUFFED];
        let request = Request::Write(&Settings::of(gantry(6.0, 0.0)).to_block(0)).message(0, 0);
        let n = stuff(request.bytes(), &mut stuffed).unwrap();
        session.take(&stuffed[..n], &mut unit, &mut slots, &mut line, &mut |_, _| {});
        assert!(StoredSettings::read(&slots, SettingsCheck::of::<SmallState, SmallSender>()).settings().is_some());
        slots.0.fill(0xFF);
    }
}
