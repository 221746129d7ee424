//! Proposals of labels on recordings with ground truth, worked through by a script that plays a person.

use std::path::Path;
use std::time::Instant;

use viewshed_harness::estimators;
use viewshed_harness::evaluation;
use viewshed_harness::evaluation::summary::Row;
use viewshed_harness::labels::{judged, proposals};
use viewshed_harness::recording::{self, ReadOptions, Recording};

fn read(path: &Path) -> Recording {
    recording::read(path, &ReadOptions { to_s: Some(60.0), ..Default::default() }).unwrap()
}

fn motorway() -> Recording {
    read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.mcap"))
}

#[test]
fn proposals_of_the_motorway_need_few_actions_and_give_labels_like_the_truth() {
    let recording = motorway();
    let offered = proposals::propose(&recording, &|_| ());
    let judged = judged::judge(&recording, &offered, &evaluation::Options::default()).unwrap();
    println!("{}", judged.text());
    let share = |[all, part]: [u64; 2]| part as f64 / all as f64;
    assert!(judged.vehicles > 100 && judged.actions_a_vehicle() <= 0.5);
    assert!(share(judged.steps) >= 0.95 && share(judged.undetected) >= 0.8);
    assert!(share(judged.labelled) <= 0.02);
}

#[test]
fn proposals_know_no_truth_and_are_told_to_go_on() {
    let mut recording = motorway();
    recording.frames.truncate(150);
    let offered = proposals::propose(&recording, &|_| ());
    assert!(offered.len() > 10 && offered.is_sorted_by(|a, b| a.score >= b.score));
    recording.truth = None;
    let done = std::sync::Mutex::new(Vec::new());
    assert_eq!(proposals::propose(&recording, &|share| done.lock().unwrap().push(share)), offered);
    let done = done.into_inner().unwrap();
    assert!(done.len() > 4 && done.is_sorted() && done.last() == Some(&1.0), "{done:?}");
}

#[test]
fn single_frames_and_silence_have_no_proposals() {
    let mut recording = motorway();
    recording.frames.truncate(30);
    recording.sensor.frames_independent = true;
    assert_eq!(proposals::propose(&recording, &|_| ()), []);
    recording.sensor.frames_independent = false;
    recording.frames.iter_mut().for_each(|f| f.detections.clear());
    assert_eq!(proposals::propose(&recording, &|_| ()), []);
    recording.frames.clear();
    assert_eq!(proposals::propose(&recording, &|_| ()), []);
}

/// `VIEWSHED_LABELLED=a.mcap:b.mcap cargo test --release -p viewshed-harness --test labels -- --ignored --nocapture`
#[test]
#[ignore = "prints figures of the recordings that VIEWSHED_LABELLED names, for minutes"]
fn figures_of_proposals() {
    let paths = std::env::var("VIEWSHED_LABELLED").expect("VIEWSHED_LABELLED: recordings with truth, : between them");
    let evaluation = evaluation::Options::default();
    for path in paths.split(':') {
        let recording = read(Path::new(path));
        let begin = Instant::now();
        let offered = proposals::propose(&recording, &|_| ());
        println!("proposed in {:.1} s", begin.elapsed().as_secs_f64());
        let Some(judged) = judged::judge(&recording, &offered, &evaluation) else { continue };
        print!("{}", judged.text());
        let rows = judged.tables(&recording, &evaluation, &estimators::Options::default()).unwrap();
        println!(
            "  TVR, FVR, TIR, FIR of objects, FVR and FIR of cells, in %; perfect: truth from first to last detection"
        );
        for ((of_truth, of_perfect), of_labels) in rows[0].iter().zip(&rows[1]).zip(&rows[2]) {
            let rates = |r: &Row| {
                let all = [r.counts.tvr(), r.counts.fvr(), r.counts.tir(), r.counts.fir(), r.cell_fvr(), r.cell_fir()];
                all.map(|v| v.map_or(f64::NAN, |v| 100.0 * v))
            };
            println!("  {:15} truth  {:5.1?}", of_truth.name, rates(of_truth));
            println!("  {:15} perfect{:5.1?}", "", rates(of_perfect));
            println!("  {:15} labels {:5.1?}", "", rates(of_labels));
        }
    }
}
