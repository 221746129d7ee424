//! Batch mode: every map of a recording, here and there.

use viewshed::bench::record::{RECORD_LEN, Record};
use viewshed::bench::stage::Stage;
use viewshed::unit::settings::Settings;
use viewshed_harness::boards::check::{self, Checked};
use viewshed_harness::boards::scans::Scan;
use viewshed_harness::boards::{Board, Profile, Run, firmware, host, machine, stress};

use viewshed_harness::results::files::OutputArgs;

use crate::shipped;

/// Instructions a frame may take, of the recording, which has more detections than either grid keeps, and of
/// scans nobody should send.
const BUDGET: [(Profile, u32); 2] = [(Profile::Reference, 2_850_000), (Profile::Small, 900_000)];

fn run(board: Board, profile: Profile, name: &str, settings: &Settings, scans: &[Scan]) -> Checked {
    let checked = Run { board, profile, name, settings, scans }.check().unwrap();
    let what = || checked.difference.as_ref().map(check::Difference::text);
    assert_eq!(checked.equal, scans.len(), "{name} on {}: {:?}", board.name(), what());
    checked
}

fn worst(checked: &Checked) -> u32 {
    checked.instructions.iter().map(|f| f[..Stage::ESTIMATOR].iter().sum()).max().unwrap()
}

#[test]
#[ignore = "needs QEMU"]
fn every_frame_of_the_shipped_recording_is_the_same_within_the_budget() {
    let (settings, scans) = shipped(f64::INFINITY);
    assert!(scans.len() >= 300);
    for (profile, budget) in BUDGET {
        let checked = run(Board::Mps2An386, profile, "motorway", &settings, &scans);
        println!("{}: at most {} instructions", profile.name(), worst(&checked));
        assert!(worst(&checked) <= budget);
    }
}

#[test]
#[ignore = "needs QEMU"]
fn lanes_that_are_learnt_are_the_same_within_the_budget() {
    let (mut settings, scans) = shipped(f64::INFINITY);
    let maps = |settings: &Settings| {
        let (answer, _) = host::answer(Profile::Reference, settings, &scans, None).unwrap();
        let records =
            answer.chunks_exact(RECORD_LEN).filter_map(|record| Record::from_bytes(record.try_into().unwrap()));
        let map = |record| if let Record::Frame(frame) = record { Some(frame.fingerprint) } else { None };
        records.filter_map(map).collect::<Vec<_>>()
    };
    let without = maps(&settings);
    settings.unit.learn_lanes = true;
    let differ = maps(&settings).iter().zip(&without).filter(|(a, b)| a != b).count();
    assert!(2 * differ > scans.len(), "lanes change {differ} of {} maps", scans.len());
    let checked = run(Board::Mps2An386, Profile::Reference, "motorway, lanes learnt", &settings, &scans);
    println!("at most {} instructions", worst(&checked));
    assert!(worst(&checked) <= BUDGET[0].1);
}

#[test]
#[ignore = "needs QEMU"]
fn scans_nobody_should_send_are_the_same_within_their_budget() {
    let (settings, _) = shipped(0.1);
    let mut learns = settings;
    learns.unit.learn_lanes = true;
    let [(reference, most), _] = BUDGET;
    let runs = BUDGET.map(|(profile, budget)| (profile, settings, budget)).into_iter();
    for (profile, settings, budget) in runs.chain([(reference, learns, most)]) {
        for scene in stress::SCENES {
            let checked = run(Board::Mps2An386, profile, scene, &settings, &stress::scans(scene));
            let learns = if settings.unit.learn_lanes { ", lanes learnt" } else { "" };
            println!("{scene}, {}{learns}: at most {} instructions", profile.name(), worst(&checked));
            assert!(worst(&checked) <= budget);
        }
    }
}

#[test]
#[ignore = "needs QEMU"]
fn the_same_image_runs_on_a_cortex_m7() {
    let (settings, scans) = shipped(2.0);
    run(Board::Mps2An500, Profile::Reference, "motorway", &settings, &scans);
}

#[test]
#[ignore = "needs QEMU"]
fn instruction_counts_repeat_exactly() {
    let (settings, scans) = shipped(1.0);
    let counts = || run(Board::Mps2An386, Profile::Small, "motorway", &settings, &scans).instructions;
    assert_eq!(counts(), counts());
}

#[test]
#[ignore = "needs QEMU"]
fn a_controller_that_computes_something_else_is_found_out_cell_by_cell() {
    // of the first second nothing is known
    const FRAME: usize = 40;
    let (settings, scans) = shipped(3.0);
    let (here, geometry) = host::answer(Profile::Small, &settings, &scans, Some(FRAME)).unwrap();
    let image = firmware::build(Board::Mps2An386, Profile::Small, "batch").unwrap();
    let mut other = settings;
    other.sensor.mount.pitch_deg += 0.5;
    let answer = machine::batch(Board::Mps2An386, &image, &other, &scans, Some(FRAME)).unwrap();
    let checked = check::compare(&answer, &here, scans.len()).unwrap();
    assert!(checked.first_difference.is_some() && checked.equal < scans.len());
    let difference = check::difference(&answer, &here, FRAME, &geometry).unwrap();
    assert!(difference.text().contains("cells differ"), "{}", difference.text());
    let folder = std::env::temp_dir().join("viewshed-boards-difference");
    let folder = OutputArgs::default().beside([]).folder("--out", &folder).unwrap();
    assert!(difference.draw(&folder, "test").is_ok());
}

#[test]
#[ignore = "needs QEMU"]
fn a_scan_larger_than_the_buffer_ends_the_job_with_its_reason() {
    let (settings, mut scans) = shipped(1.0);
    let one = scans[3].detections[0];
    scans[3].detections = vec![one; 20_000];
    let image = firmware::build(Board::Mps2An386, Profile::Small, "batch").unwrap();
    let answer = machine::batch(Board::Mps2An386, &image, &settings, &scans, None).unwrap();
    let last = Record::from_bytes(answer[answer.len() - RECORD_LEN..].try_into().unwrap());
    assert!(matches!(last, Some(Record::Closing(c)) if (c.reason, c.frames) == (3, 3)), "{last:?}");
}
