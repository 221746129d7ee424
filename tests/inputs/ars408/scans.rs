//! Scans as a whole: when they are over, and what becomes of frames that are lost, repeated or odd.

use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Outcome, Refusal};
use viewshed::wire::frame::{CanFrame, CanId};

use super::{Got, at, frame, got, radar, scans};

/// Entries at 20.00 and 30.00 m, straight ahead, standing: raw 2600, 2650; 1023; 512; 256.
const NEAR: &str = "60B#015143FF80200080";
const FAR: &str = "60B#0252D3FF80200080";

fn whole(number: u32, ranges: &[u16]) -> Got {
    Got { number, detections: ranges.iter().map(|r| (*r, 0)).collect(), missing: 0, fault: false }
}

#[test]
fn a_scan_is_over_when_everything_announced_has_come() {
    let mut radar = radar();
    let frames = ["60A#02000110", NEAR, FAR, "60A#01000310", FAR, "60A#00000510", "60A#01000710", NEAR];
    assert_eq!(
        scans(&mut radar, &frames),
        [whole(1, &[2000, 3000]), whole(3, &[3000]), whole(5, &[]), whole(7, &[2000])]
    );
    let counters = radar.counters();
    assert_eq!((counters.frames, counters.scans, counters.incomplete, counters.lost), (8, 4, 0, 0));
}

/// Scans of both entries, 70 ms apart, under status messages that announce so many, polled as time passes.
fn announced(radar: &mut Ars408<64>, first: u64, counts: &[u16]) -> Vec<Vec<u16>> {
    let mut all = Vec::new();
    let mut keep = |outcome: Option<Ars408Outcome<'_>>| {
        all.extend(outcome.and_then(got).map(|scan| scan.detections.iter().map(|d| d.0).collect::<Vec<_>>()));
    };
    for (i, count) in (first..).zip(counts) {
        let status = format!("60A#{count:02X}{:04X}10", 2 * i + 1);
        for (k, text) in (0..).zip([status.as_str(), NEAR, FAR]) {
            keep(Some(radar.push(&frame(text), at(i * 70 + k))));
        }
        for wait in [20, 40] {
            keep(radar.poll(at(i * 70 + wait)));
        }
    }
    all
}

#[test]
fn entries_beyond_those_announced_are_evidence_from_the_third_scan_on() {
    for (count, first) in [(0, vec![]), (1, vec![2000])] {
        let mut radar = radar();
        let scans = announced(&mut radar, 0, &[count; 6]);
        let whole = vec![2000, 3000];
        assert_eq!(
            scans.iter().collect::<Vec<_>>(),
            [&first, &first, &whole, &whole, &whole, &whole],
            "{count} announced"
        );
        assert_eq!(radar.counters().surplus, 6 * u32::from(2 - count));
    }
}

#[test]
fn announcements_count_again_once_they_hold() {
    let mut radar = radar();
    announced(&mut radar, 0, &[0; 3]);
    let long = radar.poll(at(3 * 70));
    assert_eq!(long, None, "it was given out when nothing more came");
    let scans = announced(&mut radar, 3, &[2; 10]);
    assert!(scans.iter().all(|scan| scan.len() == 2), "{scans:?}");
    // the last of them did not wait
    radar.push(&frame("60A#01FFFF10"), at(13 * 70));
    assert!(got(radar.push(&frame(NEAR), at(13 * 70 + 1))).is_some());
}

#[test]
fn entries_of_a_scan_whose_status_was_lost_are_not_taken_for_more_of_the_one_before() {
    let mut radar = radar();
    for k in 0..4 {
        let status = format!("60A#01{:04X}10", 4 * k + 1);
        assert_eq!(scans(&mut radar, &[&status, NEAR]).len(), 1);
        for text in [NEAR, FAR] {
            assert_eq!(radar.push(&frame(text), at(70)), Ars408Outcome::Refused(Refusal::NoScan));
        }
    }
    assert_eq!((radar.counters().surplus, radar.counters().no_scan), (0, 8));
}

#[test]
fn the_next_scan_ends_one_that_misses_entries() {
    let mut radar = radar();
    let frames = ["60A#02000110", NEAR, "60A#02000310", NEAR, FAR];
    let first = Got { missing: 1, ..whole(1, &[2000]) };
    assert_eq!(scans(&mut radar, &frames), [first, whole(3, &[2000, 3000])]);
    assert_eq!(radar.counters().incomplete, 1);
}

#[test]
fn a_scan_of_which_most_is_missing_is_no_free_road() {
    let mut radar = radar();
    for f in ["60A#03000110", NEAR] {
        radar.push(&frame(f), at(0));
    }
    assert_eq!(radar.push(&frame("60A#03000310"), at(70)), Ars408Outcome::Broken { announced: 3, arrived: 1 });
    assert_eq!(radar.poll(at(101)), Some(Ars408Outcome::Broken { announced: 3, arrived: 0 }));
    assert_eq!(radar.poll(at(102)), None);
    assert_eq!((radar.counters().broken, radar.counters().scans), (2, 0));
}

#[test]
fn a_scan_does_not_wait_for_ever() {
    let mut radar = radar();
    for f in ["60A#02000110", NEAR] {
        assert_eq!(radar.push(&frame(f), at(10)), Ars408Outcome::Taken);
    }
    assert_eq!(radar.poll(at(40)), None);
    assert_eq!(radar.poll(at(41)).and_then(got), Some(Got { missing: 1, ..whole(1, &[2000]) }));
    // a clock that steps back ends it too
    for f in ["60A#02000310", NEAR] {
        radar.push(&frame(f), at(5000));
    }
    assert!(radar.poll(at(3000)).is_some());
}

#[test]
fn entries_of_a_lost_status_message_do_not_fill_the_scan_before() {
    let mut radar = radar();
    for f in ["60A#02000110", NEAR] {
        assert_eq!(radar.push(&frame(f), at(10)), Ars408Outcome::Taken);
    }
    let before = got(radar.push(&frame(FAR), at(80)));
    assert_eq!(before, Some(Got { missing: 1, ..whole(1, &[2000]) }));
    assert_eq!(radar.push(&frame(NEAR), at(81)), Ars408Outcome::Refused(Refusal::NoScan));
    assert_eq!(radar.counters().no_scan, 2);
}

#[test]
fn an_empty_scan_after_a_broken_one_is_not_lost() {
    let mut radar = radar();
    let frames = ["60A#02000110", NEAR, "60A#00000310"];
    assert_eq!(scans(&mut radar, &frames), [Got { missing: 1, ..whole(1, &[2000]) }]);
    assert_eq!(radar.poll(at(4)).and_then(got), Some(whole(3, &[])), "and none of the scan before is in it");
}

#[test]
fn scans_wait_for_quality_once_it_is_known_to_come() {
    let mut radar = radar();
    // state: objects with quality
    let frames = [
        "201#401F400010140000",
        "60A#02000110",
        NEAR,
        FAR,
        "60C#010000000000C8", // measured
        "60C#020000000000CC", // predicted
        "60A#01000310",
        NEAR,
        "60A#01000510",
        NEAR,
    ];
    assert_eq!(scans(&mut radar, &frames), [whole(1, &[2000]), whole(3, &[2000]), whole(5, &[2000])]);
    assert_eq!(radar.counters().unwanted, 1);
    // the third waited in vain, the fourth does not
    assert_eq!(scans(&mut radar, &["60A#01000710", NEAR]).len(), 1);
}

#[test]
fn extended_messages_are_taken_and_not_waited_for() {
    let mut radar = radar();
    let frames = ["60A#01000110", NEAR, "60D#017D2FA170800A0C"];
    assert_eq!(scans(&mut radar, &frames), [whole(1, &[2000])]);
}

#[test]
fn sensors_on_one_bus_do_not_disturb_each_other() {
    let mut radars = [0, 3].map(|sensor| Ars408::<8>::new(Ars408Config::sensor(sensor)));
    let frames =
        ["60A#01000110", "63A#02000910", "63B#015143FF80200080", NEAR, "65B#0152D3FF80200080", "63B#0252D3FF80200080"];
    let mut all = Vec::new();
    for (i, text) in frames.iter().enumerate() {
        for radar in &mut radars {
            let sensor = radar.config().sensor;
            all.extend(got(radar.push(&frame(text), at(i as u64))).map(|scan| (sensor, scan)));
        }
    }
    assert_eq!(all, [(0, whole(1, &[2000])), (3, whole(9, &[2000, 3000]))]);
    assert_eq!((radars[0].counters().frames, radars[1].counters().frames), (2, 3));
}

#[test]
fn longer_frames_are_taken_and_shorter_ones_are_not() {
    let mut radar = radar();
    let frames = ["60A#0100011000000000", "60B#015143FF802000", NEAR];
    assert_eq!(scans(&mut radar, &frames), [whole(1, &[2000])]);
    assert_eq!(radar.counters().too_short, 1);
    assert!(matches!(
        radar.push(&frame("60A#010001"), at(9)),
        Ars408Outcome::Refused(Refusal::TooShort { length: 3, .. })
    ));
}

#[test]
fn frames_of_others_are_not_mine() {
    let mut radar = radar();
    for text in ["123#00", "300#0000", "301#8000000000000000", "200#F8000000089C0000", "61A#01000110", "405#0102"] {
        assert_eq!(radar.push(&frame(text), at(0)), Ars408Outcome::NotMine, "{text}");
    }
    let long = CanFrame::fd(CanId::Standard(0x60A), &[1, 0, 1, 0x10]).unwrap();
    assert_eq!(radar.push(&long, at(0)), Ars408Outcome::NotMine);
    assert_eq!(radar.counters().frames, 0);
}

#[test]
fn entries_out_of_place_are_refused_by_reason() {
    let mut radar = radar();
    let mut refused = |text: &str| match radar.push(&frame(text), at(0)) {
        Ars408Outcome::Refused(why) => Some(why),
        _ => None,
    };
    // a log that begins within a scan
    assert_eq!(refused(NEAR), Some(Refusal::NoScan));
    assert_eq!(refused("60A#02000110"), None);
    assert_eq!(refused("60A#02000110"), Some(Refusal::Repeated));
    assert_eq!(refused(NEAR), None);
    assert_eq!(refused(NEAR), Some(Refusal::Repeated));
    assert_eq!(refused("701#015143FF80200080"), Some(Refusal::NoScan), "a cluster among objects");
    assert_eq!(refused("60C#090000000000C8"), Some(Refusal::UnknownEntry));
    let counters = radar.counters();
    assert_eq!((counters.no_scan, counters.repeated, counters.unknown_entry), (2, 2, 1));
}

#[test]
fn entries_beyond_those_announced_are_refused() {
    let mut radar = radar();
    scans(&mut radar, &["60A#01000110", NEAR, "60C#010000000000C8"]);
    let frames = ["60A#01000310", NEAR, FAR, "60C#010000000000C8"];
    assert_eq!(scans(&mut radar, &frames), [whole(3, &[2000])]);
    assert_eq!(radar.counters().surplus, 1);
}

#[test]
fn lost_scans_are_counted_by_the_radars_counter() {
    let mut radar = radar();
    let status = |n: u16| format!("60A#00{n:04X}10");
    // steps of 2; two scans lost; a restart
    for n in [10, 12, 14, 16, 22, 24, 0, 2] {
        radar.push(&frame(&status(n)), at(0));
    }
    assert_eq!((radar.counters().lost, radar.counters().restarts, radar.counters().scans), (2, 1, 8));
}

#[test]
fn faults_are_passed_on_until_they_pass() {
    let mut radar = radar();
    let frames = [
        "201#401F600010040000", // persistent error
        "60A#01000110",
        NEAR,
        "201#401F400010040000",
        "60A#01000310",
        NEAR,
    ];
    let faults: Vec<bool> = scans(&mut radar, &frames).iter().map(|s| s.fault).collect();
    assert_eq!(faults, [true, false]);
}

#[test]
fn a_full_list_keeps_the_strongest_and_the_scan_is_complete_all_the_same() {
    let mut radar = Ars408::<2>::new(Ars408Config::sensor(0));
    let frames = ["60A#03000110", "60B#015143FF80200080", "60B#0252D3FF80200090", "60B#035463FF80200085"];
    let mut last = None;
    for f in frames {
        last = got(radar.push(&frame(f), at(0)));
    }
    // the first, of 0 dBsm, made room for the third
    assert_eq!(last, Some(whole(1, &[3000, 4000])));
    assert_eq!(radar.counters().overflow, 1);
}
