//! What a unit's status says of it, message by message, as its receivers read it.

use viewshed::fixed::time::Time;
use viewshed::inputs::Frame;
use viewshed::unit::Unit;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::{Addresses, Message, Received};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::status::{Reason, Status, UnitState};

use crate::common::{SmallState, Vehicle, gantry, small_unit};

/// Milliseconds between scans.
const PERIOD: u64 = 60;

/// States and reasons in the order they are sent, with the time of the first and the number of messages.
type Sent = Vec<(UnitState, Reason, u64, usize)>;

/// Runs a unit: `scan` says, at every time one is due, whether there is one, whether the radar has a fault, and whether entries
/// are missing.
fn run(until: u64, scan: impl Fn(u64) -> Option<(bool, bool)>, time: impl Fn(u64) -> u64) -> Sent {
    let settings = Settings::of(gantry(6.0, 0.0));
    let medium = Medium::Can(Addresses::STANDARD);
    let (parameters, mut sender) = small_unit(&settings, medium, 1, Time::from_micros(1000 * time(0)));
    let mut state = Box::new(SmallState::new());
    let mut map = parameters.map();
    let mut unit = Unit::new(&parameters, &mut *state, &mut map, &mut sender);
    let car = Vehicle::car(40.0, 2.0, 0.0);
    let mut sent = Sent::new();
    for ms in 0..until {
        let now = Time::from_micros(1000 * time(ms));
        match scan(ms).filter(|_| ms % PERIOD == 0) {
            Some((fault, missing)) => {
                let input = &car.at(0.0).detections(&gantry(6.0, 0.0), true)[..];
                unit.frame(&Frame { measured: now, input, incomplete: missing, status: fault.into() }, &mut |_| {});
            }
            None => drop(unit.idle(now)),
        }
        while let Some(frame) = unit.next_frame(now) {
            let received = Received::from_frame(&frame, &Addresses::STANDARD).unwrap();
            if received.message != Message::Status {
                continue;
            }
            let mut status = Status::default();
            status.take(received.own).unwrap();
            match sent.last_mut() {
                Some(last) if (last.0, last.1) == (status.state, status.reason) => last.3 += 1,
                _ => sent.push((status.state, status.reason, ms, 1)),
            }
        }
    }
    sent
}

/// A radar that is silent from 3 s on and comes back at a time, in milliseconds: its scans are stamped with their start and
/// complete 50 ms later. How often the epoch changed, and how long after its return its map is shown.
fn silence_until(back: u64) -> (usize, Option<u64>) {
    let settings = Settings::of(gantry(6.0, 0.0));
    let (parameters, mut sender) = small_unit(&settings, Medium::Can(Addresses::STANDARD), 1, Time::from_micros(0));
    let mut state = Box::new(SmallState::new());
    let mut map = parameters.map();
    let mut unit = Unit::new(&parameters, &mut *state, &mut map, &mut sender);
    let mut receiver = Receiver::<1, 40, 2>::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let car = Vehicle::car(40.0, 2.0, 0.0);
    let (mut epochs, mut shown) = (Vec::new(), None);
    for ms in 0..back + 1000 {
        let now = Time::from_micros(1000 * ms);
        let began = ms.checked_sub(50).filter(|began| *began < 3000 || *began >= back);
        match began.filter(|began| began % PERIOD == if *began < 3000 { 0 } else { back % PERIOD }) {
            Some(began) => {
                let (measured, input) =
                    (Time::from_micros(1000 * began), &car.at(0.0).detections(&gantry(6.0, 0.0), true)[..]);
                unit.frame(&Frame { measured, input, incomplete: false, status: false.into() }, &mut |_| {});
            }
            None => drop(unit.idle(now)),
        }
        while let Some(frame) = unit.next_frame(now) {
            epochs.push(Received::from_frame(&frame, &Addresses::STANDARD).unwrap().epoch);
            let _ = receiver.frame(now, &frame);
        }
        let map = receiver.map(0, now);
        let any = (0..40).any(|azimuth| (0..50).any(|range| map.cell(azimuth, range).visible()));
        assert!(any || !(2000..3000).contains(&ms) && (ms < back || shown.is_none()), "{ms} ms");
        if any && ms >= back {
            shown = shown.or(Some(ms - back));
        }
    }
    epochs.dedup();
    (epochs.len() - 1, shown)
}

#[test]
fn a_radar_that_comes_back_is_shown_at_once_though_unknown_was_sent_after_its_first_scan_began() {
    for back in (4000..4100).step_by(7) {
        let (changes, shown) = silence_until(back);
        assert!(
            changes == 0 && shown.is_some_and(|ms| ms < 50 + 2 * PERIOD + 20),
            "back at {back} ms: {changes} {shown:?}"
        );
    }
}

fn states(sent: &Sent) -> Vec<(UnitState, Reason)> {
    sent.iter().map(|t| (t.0, t.1)).collect()
}

/// A car stands in view that nobody saw moving: what is behind it has not settled.
const USUAL: (UnitState, Reason) = (UnitState::Degraded, Reason::Settling);

#[test]
fn from_the_start_to_silence() {
    let sent = run(6000, |ms| (500..3000).contains(&ms).then_some((false, false)), |ms| ms);
    let expected = [(UnitState::Starting, Reason::None), USUAL, (UnitState::Blind, Reason::RadarSilent)];
    assert_eq!(states(&sent), expected);
    // a quarter of a second between messages, half a second a map is held
    assert!(sent[1].2 < 1000 && (3250..4000).contains(&sent[2].2), "{sent:?}");
    assert!(sent.iter().map(|t| t.3).sum::<usize>() >= 23, "four a second, whatever the state: {sent:?}");
}

#[test]
fn a_fault_is_a_fault_for_as_long_as_the_radar_says_so() {
    let sent = run(8000, |ms| Some(((2000..4000).contains(&ms), false)), |ms| ms);
    let expected = [USUAL, (UnitState::Fault, Reason::RadarFault), USUAL];
    assert_eq!(states(&sent), expected);
    assert!(sent[1].3 >= 7 && sent[1].2 < 2500 && sent[2].2 < 4500, "{sent:?}");
}

#[test]
fn a_fault_followed_by_silence_is_silence() {
    let sent = run(6000, |ms| (ms < 3000).then_some((ms > 2000, false)), |ms| ms);
    assert_eq!(sent.last().map(|t| (t.0, t.1)), Some((UnitState::Blind, Reason::RadarSilent)));
}

#[test]
fn missing_entries_degrade_for_a_second_and_are_not_overlooked() {
    let sent = run(6000, |ms| Some((false, ms == 34 * PERIOD)), |ms| ms);
    let expected = [USUAL, (UnitState::Degraded, Reason::IncompleteScans), USUAL];
    assert_eq!(states(&sent), expected);
    assert!((3..=5).contains(&sent[1].3), "{sent:?}");
}

#[test]
fn a_clock_that_steps_is_told() {
    let sent = run(8000, |_| Some((false, false)), |ms| if ms < 3000 { ms } else { ms - 1500 });
    assert!(states(&sent).contains(&(UnitState::Degraded, Reason::ClockStepped)), "{sent:?}");
    assert_eq!(sent.last().map(|t| (t.0, t.1)), Some(USUAL));
}
