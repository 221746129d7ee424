//! Whatever comes, and whatever is lost.

use proptest::prelude::*;
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Outcome};
use viewshed::wire::frame::{CanFrame, CanId};

use super::at;

fn classic(id: u16, bytes: &[u8]) -> CanFrame {
    CanFrame::classic(CanId::standard(id).unwrap(), bytes).unwrap()
}

/// A frame that is likely to be one of the radar's.
fn any_frame() -> impl Strategy<Value = CanFrame> {
    let ids = prop_oneof![
        Just(0x600_u16),
        Just(0x60A),
        Just(0x60B),
        Just(0x60C),
        Just(0x701),
        Just(0x702),
        Just(0x201),
        Just(0x700),
        0_u16..0x800
    ];
    (ids, prop::collection::vec(prop_oneof![0_u8..4, any::<u8>()], 0..=8)).prop_map(|(id, b)| classic(id, &b))
}

proptest! {
    #[test]
    fn any_frames_are_taken(
        frames in prop::collection::vec((any_frame(), 0_u64..300), 0..400),
    ) {
        let mut radar = Ars408::<16>::new(Ars408Config::sensor(0));
        let (mut scans, mut refused) = (0, 0);
        for (i, (frame, ms)) in frames.iter().enumerate() {
            match radar.push(frame, at(*ms)) {
                Ars408Outcome::Scan(scan) => {
                    prop_assert!(scan.detections.len() <= 16 && scan.detections.iter().all(|d| d.range_cm > 0));
                    scans += 1;
                }
                Ars408Outcome::Refused(_) => refused += 1,
                _ => {}
            }
            if i % 7 == 0 && matches!(radar.poll(at(*ms)), Some(Ars408Outcome::Scan(_))) {
                scans += 1;
            }
        }
        let c = radar.counters();
        prop_assert_eq!(c.scans, scans);
        // an entry that ends a scan is counted without being the outcome
        let counted = c.too_short + c.no_scan + c.repeated + c.surplus + c.unknown_entry;
        prop_assert!((refused..=refused + c.scans + c.broken).contains(&counted));
        prop_assert!(c.incomplete <= c.scans && c.frames as usize <= frames.len());
    }

    /// Scans of clusters whose frames are lost at random: what is given out was sent in that scan, what
    /// is said to be missing is missing, and every scan is accounted for.
    #[test]
    fn losses_are_counted_and_nothing_is_made_up(
        sizes in prop::collection::vec(0_usize..30, 4..20),
        losses in prop::collection::vec(prop::bool::weighted(0.1), 1..97),
        quality: bool,
    ) {
        let mut radar = Ars408::<64>::new(Ars408Config::sensor(0));
        let mut lost = losses.iter().cycle();
        let mut statuses = 0;
        for (scan, size) in sizes.iter().enumerate() {
            let number = 2 * scan as u16;
            let [high, low] = number.to_be_bytes();
            // entries of scan s lie at 2 (s + 1) metres: raw 2500 + 10 (s + 1)
            let place = 2500 + 10 * (scan as u16 + 1);
            let mut frames = vec![classic(0x600, &[*size as u8, 0, high, low, 0x10])];
            frames.extend((0..*size as u8).map(|n| {
                classic(0x701, &[n, (place >> 5) as u8, (place << 3) as u8 | 1, 0xFF, 0x80, 0x20, 0, 0x80])
            }));
            if quality {
                frames.extend((0..*size as u8).map(|n| classic(0x702, &[n, 0, 0, 0, 3])));
            }
            for (i, frame) in frames.iter().enumerate() {
                if *lost.next().unwrap() {
                    continue;
                }
                statuses += usize::from(i == 0);
                if let Ars408Outcome::Scan(s) = radar.push(frame, at(70 * scan as u64)) {
                    let sent = sizes[s.number as usize / 2];
                    // 511 * 0.2 - 102.3 = -0.1 m to the side does not show in the range
                    let range = 200 * (s.number as u16 / 2 + 1);
                    prop_assert!(s.detections.iter().all(|d| d.range_cm.abs_diff(range) <= 1), "{:?}", s);
                    prop_assert_eq!(s.detections.len() + usize::from(s.missing), sent);
                }
            }
        }
        radar.poll(at(10_000_000));
        let c = radar.counters();
        prop_assert_eq!((c.scans + c.broken) as usize, statuses);
        prop_assert_eq!(c.overflow + c.no_range + c.unwanted + c.restarts, 0);
    }
}
