//! A person at the page, played by keys that are really pressed: every proposal of a recording is decided about.

use std::path::Path;
use std::time::Instant;

use viewshed_harness::evaluation::Options;
use viewshed_harness::labels::judged::{Decision, decide, judge};
use viewshed_harness::labels::proposals::Proposal;
use viewshed_harness::labels::{Site, file, proposals};
use viewshed_harness::recording::{self, ReadOptions};

use crate::browser::{Browser, Page};
use crate::offered::point_at;
use crate::server::{Server, folder, recording};

/// Keys of the classes, as the page's help lists them.
const CLASSES: [&str; 7] = ["car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian"];

/// Presses a key, counts it and waits until the page shows what is offered then.
fn press(page: &Page, key: &str, pressed: &mut usize) {
    page.key(key);
    *pressed += 1;
    page.until("viewshed.session.proposals.shown || !viewshed.session.proposals.current");
}

/// Works through the proposals of a recording's first seconds; keys pressed, proposals, labels in the file.
fn works_through(recording: &Path, seconds: f64) -> Option<[usize; 3]> {
    let browser = Browser::start("a person's keys")?;
    let options = ReadOptions { to_s: Some(seconds), ..Default::default() };
    let read = recording::read(recording, &options).unwrap();
    let offered = proposals::propose(&read, &|_| ());
    let decisions = decide(&read, &offered, &Options::default()).expect("ground truth");
    let server = Server::with(recording, &["--to", &seconds.to_string()]);
    let page = browser.open(&server.url);
    page.until_saved();
    page.until("viewshed.session.proposals.ready");
    let (mut pressed, mut classes, mut expected) = (0, 0, Vec::new());
    let mut ways: Vec<u32> = offered.iter().map(|p| p.way).collect();
    ways.sort_unstable();
    ways.dedup();
    for way in ways {
        page.until("viewshed.session.proposals.shown");
        let mut left: Vec<(&Proposal, &Decision)> =
            offered.iter().zip(&decisions).filter(|(p, _)| p.way == way).collect();
        let ids: Vec<&str> = left.iter().map(|(p, _)| p.track.id.as_str()).collect();
        let shown = page.ask("viewshed.session.proposals.offered.map(({ track }) => track.id)");
        assert_eq!(shown, serde_json::json!(ids), "way {way}");
        for (k, (proposal, decision)) in left.iter().enumerate() {
            let Decision::Accept { class } = decision else { continue };
            if *class != proposal.track.class {
                let key = CLASSES.iter().position(|c| c == class).expect("a class") + 1;
                point_at(&page, k);
                press(&page, &key.to_string(), &mut classes);
            }
        }
        // the few are pointed at, the others go with one key
        let wrong = left.iter().filter(|(_, d)| **d == Decision::Reject).count();
        let right = left.len() - wrong;
        let (alone, key) = if wrong <= right { (false, "x") } else { (true, "m") };
        while let Some(k) = left.iter().position(|(_, d)| (**d != Decision::Reject) == alone && right > 0) {
            point_at(&page, k);
            press(&page, key, &mut pressed);
            expected.extend(taken(left.remove(k)));
        }
        if !left.is_empty() {
            press(&page, if alone || right == 0 { "d" } else { "a" }, &mut pressed);
            expected.extend(left.into_iter().filter_map(taken));
        }
    }
    page.until("viewshed.session.proposals.current === null");
    page.until_saved();
    let counted = judge(&read, &offered, &Options::default()).expect("ground truth").actions;
    assert_eq!(pressed, (counted.accepted + counted.rejected) as usize);
    // what is saved is what was decided, class by class and point by point
    let saved = file::read(&server.labels, &Site::of(&read)).unwrap();
    let saved: Vec<(String, usize)> = saved.iter().map(|t| (t.class.clone(), t.points.len())).collect();
    assert_eq!(saved, expected);
    Some([pressed + classes, offered.len(), saved.len()])
}

/// Class and number of points of the label that a decision makes.
fn taken((proposal, decision): (&Proposal, &Decision)) -> Option<(String, usize)> {
    match decision {
        Decision::Accept { class } => Some((class.clone(), proposal.track.points.len())),
        Decision::Reject => None,
    }
}

#[test]
fn a_person_works_through_the_shipped_recording_s_proposals_with_few_keys() {
    let Some([pressed, offered, labels]) = works_through(&recording("person"), 6.0) else { return };
    println!("{pressed} keys for {offered} proposals, {labels} labels");
    assert!(offered > 10 && labels as f64 > 0.7 * offered as f64, "{labels} of {offered}");
    assert!(pressed as f64 <= 0.8 * labels as f64, "{pressed} keys for {labels} labels");
}

/// `VIEWSHED_LABELLED=a.mcap:b.mcap cargo test --release -p viewshed-harness --test label keys_of -- --ignored --nocapture`
#[test]
#[ignore = "minutes for each recording that VIEWSHED_LABELLED names"]
fn keys_of_the_recordings_that_are_named() {
    let paths = std::env::var("VIEWSHED_LABELLED").expect("VIEWSHED_LABELLED: recordings with truth, : between them");
    for path in paths.split(':') {
        // the labels file is beside the recording
        let copy = folder("named").join("site.mcap");
        std::fs::copy(path, &copy).unwrap();
        let begin = Instant::now();
        if let Some([pressed, offered, labels]) = works_through(&copy, 60.0) {
            println!(
                "{path}: {pressed} keys for {offered} proposals, {labels} labels, {:.0} s",
                begin.elapsed().as_secs_f64()
            );
        }
    }
}
