//! What a real radar sent: of 165 frames that begin 140 are whole, however the bytes are cut.

use viewshed::inputs::ti::TiFamily;

use super::{Got, feed, radar};

const CAPTURE: &[u8] = include_bytes!("../real/levm_oob_raw.bin");

#[test]
fn every_whole_frame_of_a_real_capture_comes_out_and_nothing_else() {
    let scans = |chunk: usize| {
        let mut radar = Box::new(radar(TiFamily::Bytes40));
        let got = feed(&mut radar, CAPTURE, chunk);
        let scans: Vec<_> = got
            .into_iter()
            .filter_map(|got| {
                if let Got::Scan(number, detections, missing) = got {
                    Some((number, detections, missing))
                } else {
                    None
                }
            })
            .collect();
        scans
    };
    let whole = scans(CAPTURE.len());
    assert_eq!(whole.len(), 140);
    assert!(whole.iter().all(|(_, _, missing)| *missing == 0));
    let points = whole.iter().map(|(_, detections, _)| detections.len()).sum::<usize>();
    assert_eq!(points, 2471);
    assert!(whole.windows(2).all(|two| two[0].0 < two[1].0), "numbers grow");
    let reach = whole.iter().flat_map(|(_, detections, _)| detections).map(|d| d.range_cm).max();
    assert!(reach.is_some_and(|cm| cm < 2000), "indoors, and {reach:?} cm away");
    for chunk in [1, 11, 17, 64, 4096] {
        assert_eq!(scans(chunk), whole, "cut into pieces of {chunk}");
    }
}
