//! Whatever comes, and however it is cut.

use proptest::prelude::*;
use viewshed::inputs::ti::{Ti, TiConfig, TiFamily};

use super::frames::{Frame, MAGIC};
use super::{Got, feed, radar};

fn family() -> impl Strategy<Value = TiFamily> {
    prop::sample::select(&TiFamily::ALL[..])
}

/// Points ahead, some to each side.
fn points() -> impl Strategy<Value = Vec<[f32; 4]>> {
    prop::collection::vec(prop::array::uniform4(-50.0_f32..50.0), 0..30)
        .prop_map(|points| points.into_iter().map(|[x, y, z, v]| [x, y.abs() + 1.0, z / 10.0, v]).collect())
}

proptest! {
    #[test]
    fn points_come_back_whatever_the_chunks(
        frames in prop::collection::vec(points(), 1..6),
        chunk in prop::sample::select(&[1_usize, 11, 17, 4096][..]),
        rubbish in prop::collection::vec(any::<u8>(), 0..40),
    ) {
        let mut bytes = rubbish;
        for (i, points) in frames.iter().enumerate() {
            bytes.extend(Frame::new(TiFamily::Bytes40, i as u32).cartesian(points).bytes());
        }
        let mut radar = radar(TiFamily::Bytes40);
        let got = feed(&mut radar, &bytes, chunk);
        prop_assert_eq!(got.len(), frames.len());
        for (points, got) in frames.iter().zip(got) {
            let Got::Scan(_, detections, 0) = got else { panic!("{got:?}") };
            prop_assert_eq!(detections.len(), points.len());
            for ([x, y, z, v], d) in points.iter().zip(detections) {
                let range = f64::from(x * x + y * y + z * z).sqrt();
                prop_assert!((f64::from(d.range_cm) / 100.0 - range).abs() < 0.006);
                prop_assert!((f64::from(d.azimuth.radians()) - f64::from(-x).atan2(f64::from(*y))).abs() < 1e-4);
                prop_assert!((f32::from(d.radial_velocity_cm_s) / 100.0 - v).abs() < 0.006);
            }
        }
    }

    #[test]
    fn any_bytes_are_taken(
        bytes in prop::collection::vec(prop_oneof![
            4 => any::<u8>().prop_map(|b| vec![b]),
            1 => Just(MAGIC.to_vec()),
            1 => prop::collection::vec(0_u8..40, 40).prop_map(|b| [MAGIC.to_vec(), b].concat()),
        ], 0..300),
        family in prop::option::of(family()),
    ) {
        let bytes = bytes.concat();
        let mut radar = Ti::<8>::new(TiConfig { family, ..TiConfig::LEARN });
        let got = feed(&mut radar, &bytes, 64);
        let whole = feed(&mut Ti::<8>::new(TiConfig { family, ..TiConfig::LEARN }), &bytes, 1);
        prop_assert_eq!(got, whole, "chunks make no difference");
        prop_assert!(radar.counters().frames as usize * 8 + radar.counters().stray_bytes as usize <= bytes.len() + 7);
    }

    /// Bytes flipped, lost and inserted: a frame without a fault right after one comes through.
    #[test]
    fn a_damaged_stream_recovers(
        damage in prop::collection::vec((0_usize..3000, 0_u8..3, any::<u8>()), 0..20),
        family in family(),
    ) {
        let frame = |n: u32| match family {
            TiFamily::Bytes52 => Frame::new(family, n).item(6, 1, super::frames::floats(&[[9.0, 0.0, 0.0, 9.0]])),
            TiFamily::Bytes48 => {
                let point = [super::frames::floats(&[[0.0, 0.0, 0.0, 0.01, 1.0]]), vec![0, 0, 0, 0, 3, 3, 9, 9]].concat();
                Frame::new(family, n).item(6, 1, point)
            }
            _ => Frame::new(family, n).item(1000, 1, super::frames::floats(&[[9.0, 0.0, 0.0, 9.0]])),
        };
        let mut bytes: Vec<u8> = (0..30).flat_map(|n| frame(n).bytes()).collect();
        for (at, what, value) in damage {
            let at = at % bytes.len();
            match what {
                0 => bytes[at] = value,
                1 => { bytes.remove(at); }
                _ => bytes.insert(at, value),
            }
        }
        // whatever was announced last has come to its end
        bytes.extend((30..32).flat_map(|n| frame(n).bytes()));
        let got = feed(&mut radar(family), &bytes, 100);
        prop_assert!(matches!(got.last(), Some(Got::Scan(31, d, 0)) if d.len() == 1), "{:?}", got.last());
    }
}
