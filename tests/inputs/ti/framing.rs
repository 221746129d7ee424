//! Frames as a whole: headers, learning, resynchronisation, numbers.

use viewshed::inputs::ti::{Flaw, Ti, TiConfig, TiFamily};

use super::frames::{Frame, MAGIC, floats, shorts};
use super::{Got, feed, radar};

/// A usual frame of a family, with a few points at distances that contain its number.
fn usual(family: TiFamily, number: u32) -> Frame {
    let y = 10.0 + number as f32;
    match family {
        TiFamily::Bytes52 => Frame::new(family, number)
            .item(6, 2, floats(&[[y, 0.1, 1.0, 100.0], [y, -0.1, 1.0, 100.0]]))
            .item(7, 0, vec![1; 68])
            .item(8, 0, vec![0; 2]),
        TiFamily::Bytes48 => Frame::new(family, number)
            .item(
                6,
                2,
                [floats(&[[0.01, 0.01, 0.1, 0.01, 1.0]]), shorts(&[0, 0, 100 * y as i16, 9, 0, 1, 900, 9])].concat(),
            )
            .item(7, 0, vec![1; 112])
            .item(8, 0, vec![0; 2]),
        TiFamily::Bytes36 => {
            Frame::new(family, number).item(1, 1, shorts(&[1, 0, 5, 1, 9, 0, y as i16, 0])).item(2, 0, vec![9; 512])
        }
        _ => Frame::new(family, number)
            .cartesian(&[[1.0, y, 0.0, 1.0], [-1.0, y, 0.0, 1.0]])
            .item(7, 0, shorts(&[100, 0, 100, 0]))
            .item(6, 0, vec![0; 24]),
    }
}

fn scans(got: &[Got]) -> Vec<u32> {
    let number = |g: &Got| if let Got::Scan(number, ..) = g { Some(*number) } else { None };
    got.iter().filter_map(number).collect()
}

fn stream(family: TiFamily, numbers: std::ops::Range<u32>) -> Vec<u8> {
    numbers.flat_map(|n| usual(family, n).bytes()).collect()
}

#[test]
fn a_family_that_is_set_gives_scans_at_once() {
    for family in TiFamily::ALL {
        let mut radar = radar(family);
        assert_eq!(scans(&feed(&mut radar, &stream(family, 1..6), 1000)), [1, 2, 3, 4, 5], "{family:?}");
        let c = radar.counters();
        assert_eq!((c.frames, c.scans, c.broken, c.lost, c.stray_bytes), (5, 5, 0, 0, 0), "{family:?}");
    }
}

#[test]
fn a_family_is_learnt_from_three_consistent_frames() {
    for family in TiFamily::ALL {
        let mut radar = Ti::<64>::new(TiConfig::LEARN);
        // the fourth magic word ends the third frame
        let got = feed(&mut radar, &stream(family, 1..8), 1000);
        assert_eq!(got[0], Got::Learnt(family));
        assert_eq!(scans(&got), [4, 5, 6, 7], "{family:?}");
        assert_eq!((radar.family(), radar.counters().learning), (Some(family), 3));
    }
}

#[test]
fn nothing_is_given_out_before_it_is_learnt() {
    for family in TiFamily::ALL {
        let mut radar = Ti::<64>::new(TiConfig::LEARN);
        assert!(feed(&mut radar, &stream(family, 1..4), 1000).is_empty());
        // a frame cut short begins the count anew
        let mut radar = Ti::<64>::new(TiConfig::LEARN);
        let mut bytes = stream(family, 1..3);
        bytes.extend(&usual(family, 3).bytes()[..60]);
        bytes.extend(stream(family, 4..9));
        assert_eq!(scans(&feed(&mut radar, &bytes, 1000)), [7, 8], "{family:?}");
    }
}

#[test]
fn frames_without_items_are_empty_scans_and_teach_nothing() {
    for family in TiFamily::ALL {
        let mut radar = Ti::<64>::new(TiConfig::LEARN);
        let empty = |n| Frame::new(family, n).bytes();
        let bytes: Vec<u8> = (1..10).flat_map(empty).collect();
        assert!(
            feed(&mut radar, &bytes, 100).is_empty(),
            "36, 40 and 44 bytes look alike, and the others are not certain"
        );
        let mut bytes = stream(family, 10..12);
        bytes.extend(empty(12));
        bytes.extend(usual(family, 13).bytes());
        bytes.extend(empty(14));
        bytes.extend(stream(family, 15..16));
        let got = feed(&mut radar, &bytes, 100);
        assert_eq!(got[0], Got::Learnt(family));
        assert_eq!(got[1], Got::Scan(14, vec![], 0), "{family:?}");
        assert_eq!(scans(&got), [14, 15]);
    }
}

#[test]
fn the_wrong_family_gives_no_scans() {
    for family in TiFamily::ALL {
        for other in TiFamily::ALL.into_iter().filter(|f| *f != family) {
            let mut radar = radar(other);
            assert_eq!(scans(&feed(&mut radar, &stream(family, 1..9), 1000)), [0; 0], "{family:?} as {other:?}");
            assert!(radar.counters().broken > 0);
        }
    }
}

#[test]
fn another_firmware_is_learnt_anew() {
    let mut radar = Ti::<64>::new(TiConfig::LEARN);
    feed(&mut radar, &stream(TiFamily::Bytes40, 1..6), 1000);
    let got = feed(&mut radar, &stream(TiFamily::Bytes52, 1..20), 1000);
    assert!(got.contains(&Got::Learnt(TiFamily::Bytes52)));
    assert_eq!((radar.counters().relearnt, scans(&got).last()), (1, Some(&19)));
}

#[test]
fn a_frame_cut_short_costs_only_itself() {
    let mut radar = radar(TiFamily::Bytes40);
    let mut bytes = vec![0xAA; 5];
    let whole = usual(TiFamily::Bytes40, 1).bytes();
    for cut in [9, 30, 41, 50, 60, 90] {
        bytes.extend(&whole[..cut]);
        bytes.extend(usual(TiFamily::Bytes40, 2).bytes());
    }
    let got = feed(&mut radar, &bytes, 1000);
    assert_eq!(scans(&got), [2; 6]);
    assert!(got.iter().all(|g| matches!(g, Got::Scan(..) | Got::Broken(Flaw::Cut | Flaw::Items | Flaw::Records))));
    assert_eq!(radar.counters().broken, 6);
    assert!((5..60).contains(&radar.counters().stray_bytes));
}

#[test]
fn a_magic_word_within_a_frame_begins_a_frame() {
    let mut radar = radar(TiFamily::Bytes40);
    let mut payload = vec![0; 40];
    payload[16..24].copy_from_slice(&MAGIC);
    let bytes =
        [Frame::new(TiFamily::Bytes40, 1).item(9, 0, payload).bytes(), usual(TiFamily::Bytes40, 2).bytes()].concat();
    let got = feed(&mut radar, &bytes, 1000);
    assert_eq!(got[0], Got::Broken(Flaw::Cut));
    assert_eq!(scans(&got), [2]);
}

#[test]
fn lengths_that_do_not_fit_are_broken_frames() {
    let mut radar = radar(TiFamily::Bytes40);
    let mut flaw = |frame: &Frame, at: usize, value: u32| {
        let mut bytes = frame.bytes();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes.extend(usual(TiFamily::Bytes40, 9).bytes());
        let got = feed(&mut radar, &bytes, 1000);
        assert_eq!(
            got.last(),
            feed(&mut super::radar(TiFamily::Bytes40), &usual(TiFamily::Bytes40, 9).bytes(), 99).last()
        );
        let Got::Broken(flaw) = got[0] else { panic!("{got:?}") };
        flaw
    };
    let frame = usual(TiFamily::Bytes40, 1);
    assert_eq!(flaw(&frame, 12, 39), Flaw::Header, "shorter than its header");
    assert_eq!(flaw(&frame, 12, 1 << 20), Flaw::Header, "absurdly long");
    assert_eq!(flaw(&frame, 32, 65), Flaw::Header, "absurdly many items");
    assert_eq!(flaw(&frame, 12, 400), Flaw::Items, "more than the items fill");
    assert_eq!(flaw(&frame, 32, 9), Flaw::Items, "more items than there are");
    assert_eq!(flaw(&frame, 44, 33), Flaw::Records, "no whole points");
    assert_eq!(flaw(&frame, 44, 4000), Flaw::Items, "beyond the frame");
    assert_eq!(flaw(&frame, 28, 50), Flaw::Points, "most points are missing");
}

#[test]
fn lost_frames_are_counted_by_their_numbers() {
    let mut radar = radar(TiFamily::Bytes40);
    for number in [5, 6, 9, 10, 1, 2] {
        feed(&mut radar, &usual(TiFamily::Bytes40, number).bytes(), 1000);
    }
    assert_eq!((radar.counters().lost, radar.counters().restarts), (2, 1));
    let mut radar = super::radar(TiFamily::Bytes40);
    for (number, sub_frame) in [(1, 0), (1, 1), (2, 0), (2, 1)] {
        feed(&mut radar, &Frame { sub_frame, ..usual(TiFamily::Bytes40, number) }.bytes(), 1000);
    }
    assert_eq!((radar.counters().lost, radar.counters().restarts, radar.counters().scans), (0, 0, 4));
}

#[test]
fn a_frame_needs_no_padding() {
    let mut bytes = usual(TiFamily::Bytes40, 1).bytes();
    // header, two points, two ratios, statistics
    let length = 40 + (8 + 32) + (8 + 8) + (8 + 24);
    bytes.truncate(length);
    bytes[12..16].copy_from_slice(&(length as u32).to_le_bytes());
    assert_eq!(scans(&feed(&mut radar(TiFamily::Bytes40), &bytes, 1000)), [1]);
}
