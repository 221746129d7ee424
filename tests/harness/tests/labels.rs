//! Proposals on recordings with ground truth, judged by a person's script.

use std::path::Path;
use std::time::Instant;

use viewshed_harness::labels::{judged, proposals};
use viewshed_harness::recording::{self, ReadOptions};
use viewshed_harness::{estimators, evaluation};

/// `VIEWSHED_LABELLED=a.mcap:b.mcap cargo test --release -p viewshed-harness --test labels -- --ignored --nocapture`
#[test]
#[ignore = "prints a table of recordings named in VIEWSHED_LABELLED, for minutes"]
fn figures_of_proposals() {
    let paths = std::env::var("VIEWSHED_LABELLED").expect("recordings, with : between them");
    let tables = std::env::var("VIEWSHED_TABLES").is_ok();
    for path in paths.split(':') {
        let options = ReadOptions { to_s: Some(60.0), ..Default::default() };
        let recording = recording::read(Path::new(path), &options).unwrap();
        let begin = Instant::now();
        let offered = proposals::propose(&recording, &|_| ());
        println!("{path}: proposed in {:.1} s", begin.elapsed().as_secs_f64());
        let evaluation = evaluation::Options::default();
        let Some(judged) = judged::judge(&recording, &offered, &evaluation) else { continue };
        print!("{}", judged.text());
        if tables {
            let percent = |v: Option<f64>| v.map_or(f64::NAN, |v| 100.0 * v);
            let rows = judged.tables(&recording, &evaluation, &estimators::Options::default()).unwrap();
            for (t, l) in rows[0].iter().zip(&rows[1]) {
                let c = |r: &evaluation::summary::Row| {
                    [r.counts.tvr(), r.counts.fvr(), r.counts.tir(), r.counts.fir(), r.cell_fvr(), r.cell_fir()]
                        .map(percent)
                };
                println!("  {:15} truth {:5.1?}\n  {:15} label {:5.1?}", t.name, c(t), "", c(l));
            }
        }
    }
}
