//! A daemon with a table of probabilities sends what the library's unit with it sends; one whose table cannot be used
//! goes on with grades and says so.

use viewshed::fixed::time::Time;
use viewshed::probability::{Quantiser, Threshold};
use viewshed::unit::profile::reference::State;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Message};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::status::{Reason, UnitState};
use viewshed_harness::boards::machine::Folder;
use viewshed_harness::evaluation::curve::Grades;
use viewshed_harness::evaluation::probability::file::Fitted;

use super::daemon::Daemon;
use super::logs::{Sent, config, logged, read, twin};
use crate::{kept, shipped};

/// While a map settles, classic CAN is too narrow for it, and a status says that first.
const MEDIUM: Medium = Medium::CanFd(Addresses::STANDARD);

/// A made-up table that rises with the grade and falls with range; of the samples with p = 230 and more 4 % are missed,
/// of all others half.
fn fitted(fingerprint: u32) -> Fitted {
    let mut counted = Grades::default();
    for p in 50..=255_u8 {
        (0..100).for_each(|k| counted.add(k >= if p >= 230 { 4 } else { 50 }, Some(p)));
    }
    Fitted { table: kept::table(fingerprint), counted }
}

/// What a daemon sends whose configuration has these lines, with a table's file of this text.
fn sent(settings: &Settings, log: &std::path::Path, table: &str, risk: &str) -> (Daemon, Sent) {
    let folder = Folder::new().unwrap();
    std::fs::write(folder.0.join("epoch"), "4").unwrap();
    std::fs::write(folder.0.join("t.probability.toml"), table).unwrap();
    let tables = format!("[probability]\nfile = \"FOLDER/t.probability.toml\"\n{risk}\n");
    let mut daemon = Daemon::start_in(folder, &(config(settings, log, 0, "can-fd") + &tables), &[]);
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    let sent = read(&daemon.folder.0.join("maps.log"));
    (daemon, sent)
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_table_becomes_the_bits_the_library_makes_of_it() {
    let (settings, scans) = shipped(8.0);
    let (_folder, log) = logged(&scans);
    let fitted = fitted(settings.fingerprint());
    let quantiser = |threshold| Quantiser::new(fitted.table.clone(), threshold, 128);
    for (risk, threshold) in [("risk = 0.05", Some(Threshold::From(230))), ("", None)] {
        let (daemon, sent) = sent(&settings, &log, &fitted.text().unwrap(), risk);
        assert!(daemon.log().contains("table of probabilities"), "{}", daemon.log());
        let expected = twin(&settings, Some(quantiser(threshold)), &read(&log), 0, MEDIUM);
        let first = sent.iter().zip(&expected).position(|(a, b)| a != b);
        assert_eq!((first, sent.len()), (None, expected.len()), "{risk}: first frame that differs, and how many came");

        // while its radar is heard
        let now = Time::from_micros(sent[0].0 + 7_000_000);
        let mut receiver = ears();
        for (at, frame) in sent.iter().filter(|(at, _)| *at <= now.micros()) {
            let _ = receiver.frame(Time::from_micros(*at), frame);
        }
        let map = receiver.map(0, now);
        assert_eq!(map.header().unwrap().probability, Some(quantiser(threshold).levels()));
        let cells = (0..State::AZIMUTHS).flat_map(|a| (0..State::RANGES).map(move |r| (a, r)));
        let given = cells.filter(|(a, r)| map.probability(*a, *r).is_some_and(|p| p.raw() > 200)).count();
        assert!(given > 1000, "{risk}: {given} cells above 0.78");
    }
}

type Ears = Receiver<1, { State::AZIMUTHS }, { State::WORDS }, 2>;

fn ears() -> Ears {
    Receiver::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT)
}

fn is_map(frame: &CanFrame) -> bool {
    matches!(Addresses::STANDARD.message(frame.id), Some((_, Message::Map(..))))
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_table_that_cannot_be_used_is_refused_by_its_reason_and_maps_are_by_grades() {
    let (settings, scans) = shipped(3.0);
    let (_folder, log) = logged(&scans);
    let good = fitted(settings.fingerprint()).text().unwrap();
    let expected = twin(&settings, None, &read(&log), 0, MEDIUM);
    let maps = |sent: &Sent| -> Vec<CanFrame> { sent.iter().map(|(_, frame)| *frame).filter(is_map).collect() };
    let cases = [
        (fitted(settings.fingerprint() ^ 1).text().unwrap(), "was fitted with configuration"),
        (good[..good.len() / 2].to_owned(), "TOML parse error"),
        (good.replacen("grades = [2", "grades = [3", 1), "changed after it was fitted"),
        (good.replacen("[100, 114,", "[115, 114,", 1), "falls with the grade, in azimuth 0, range 0"),
        (String::new(), "check_sum"),
    ];
    for (table, why) in cases {
        let (daemon, sent) = sent(&settings, &log, &table, "risk = 0.05");
        let said = daemon.log();
        assert!(
            said.contains("t.probability.toml") && said.contains(why) && said.contains("maps are by grades"),
            "{said}"
        );
        assert_eq!(maps(&sent), maps(&expected), "{why}");
        let mut receiver = ears();
        let mut told = 0;
        for (at, frame) in &sent {
            let _ = receiver.frame(Time::from_micros(*at), frame);
            let status = receiver.sensor(0).unwrap().status();
            told += usize::from(
                status.is_some_and(|s| (s.state, s.reason) == (UnitState::Degraded, Reason::NoProbabilities)),
            );
            assert!(status.is_none_or(|s| s.state != UnitState::Ok), "{why}");
        }
        assert!(told > 100, "{why}: {told}");
    }
}
