//! What a unit's status says of it, message by message, as its receivers read it.

use viewshed::fixed::time::Time;
use viewshed::inputs::Frame;
use viewshed::unit::Unit;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::{Addresses, Message, Received};
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

fn states(sent: &Sent) -> Vec<(UnitState, Reason)> {
    sent.iter().map(|t| (t.0, t.1)).collect()
}

#[test]
fn from_the_start_to_silence() {
    let sent = run(6000, |ms| (500..3000).contains(&ms).then_some((false, false)), |ms| ms);
    let expected =
        [(UnitState::Starting, Reason::None), (UnitState::Ok, Reason::None), (UnitState::Blind, Reason::RadarSilent)];
    assert_eq!(states(&sent), expected);
    // a quarter of a second between messages, half a second a map is held
    assert!(sent[1].2 < 1000 && (3250..4000).contains(&sent[2].2), "{sent:?}");
    assert!(sent.iter().map(|t| t.3).sum::<usize>() >= 23, "four a second, whatever the state: {sent:?}");
}

#[test]
fn a_fault_is_a_fault_for_as_long_as_the_radar_says_so() {
    let sent = run(8000, |ms| Some(((2000..4000).contains(&ms), false)), |ms| ms);
    let expected =
        [(UnitState::Ok, Reason::None), (UnitState::Fault, Reason::RadarFault), (UnitState::Ok, Reason::None)];
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
    let expected =
        [(UnitState::Ok, Reason::None), (UnitState::Degraded, Reason::IncompleteScans), (UnitState::Ok, Reason::None)];
    assert_eq!(states(&sent), expected);
    assert!((3..=5).contains(&sent[1].3), "{sent:?}");
}

#[test]
fn a_clock_that_steps_is_told() {
    let sent = run(8000, |_| Some((false, false)), |ms| if ms < 3000 { ms } else { ms - 1500 });
    assert!(states(&sent).contains(&(UnitState::Degraded, Reason::ClockStepped)), "{sent:?}");
    assert_eq!(sent.last().map(|t| (t.0, t.1)), Some((UnitState::Ok, Reason::None)));
}
