//! Proposals of labels on recordings with ground truth, worked through by a script that plays a person.

use std::path::Path;
use std::time::Instant;

use viewshed::obstacles::lanes::{MOST_LANES, MOST_SEGMENTS};
use viewshed_harness::estimators::{self, Lane};
use viewshed_harness::evaluation;
use viewshed_harness::evaluation::summary::Row;
use viewshed_harness::geometry::polyline;
use viewshed_harness::labels::{judged, lanes, proposals};
use viewshed_harness::recording::{self, ReadOptions, Recording};
use viewshed_harness::twin::scene::Scene;
use viewshed_harness::twin::simulate::Simulation;

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

/// Of all positions of moving vehicles in view and so near to the sensor, the share that lies within a metre of a lane of their
/// direction; and of the lanes, how many such vehicles keep to for 20 m at least.
fn on_lanes(recording: &Recording, lanes: &[Lane], within_m: f64) -> (f64, usize) {
    let truth = recording.truth.as_ref().unwrap();
    let [sx, sy, _] = recording.pose.position;
    let (mut on, mut all) = (0_u32, 0_u32);
    let mut driven = vec![0.0; lanes.len()];
    for frame in recording.frames.iter().step_by(15) {
        for o in truth.at(frame.time_ns) {
            let ([x, y, _], [length, width, _]) = (o.solid.center, o.solid.size);
            let Some([vx, vy]) = o.velocity else { continue };
            let speed = vx.hypot(vy);
            // bicycles and walkers have lanes of their own
            let seen = recording.sensor.field_of_view.contains(recording.pose.to_spherical([x, y, 1.0]));
            if speed < 2.0 || length < 3.0 || width < 1.5 || !seen || (x - sx).hypot(y - sy) > within_m {
                continue;
            }
            all += 1;
            let beside = |lane: &Lane| {
                lane.points.windows(2).any(|pair| {
                    let [a, b] = [pair[0], pair[1]].map(|p| p.map(f64::from));
                    let [c, s] = polyline::direction(a, b);
                    let (dx, dy) = (x - a[0], y - a[1]);
                    let along = dx * c + dy * s;
                    (-2.0..=(b[0] - a[0]).hypot(b[1] - a[1]) + 2.0).contains(&along)
                        && (dy * c - dx * s).abs() < 1.0
                        && vx * c + vy * s > 0.94 * speed
                })
            };
            let own: Vec<usize> = (0..lanes.len()).filter(|k| beside(&lanes[*k])).collect();
            on += u32::from(!own.is_empty());
            // a second between two looks
            own.iter().for_each(|k| driven[*k] += speed);
        }
    }
    (f64::from(on) / f64::from(all), driven.iter().filter(|m| **m >= 20.0).count())
}

#[test]
fn lanes_learnt_on_the_motorway_are_its_lanes() {
    let recording = motorway();
    let learnt = lanes::learnt(std::slice::from_ref(&recording), &|_| ());
    let (share, driven) = on_lanes(&recording, &learnt, 120.0);
    println!("{} lanes, {driven} driven, {:.1} % of vehicles on one", learnt.len(), 100.0 * share);
    assert!(share > 0.95 && driven == 6 && learnt.len() <= 8, "{share} {driven} {}", learnt.len());
    assert_eq!(lanes::learnt(&[], &|_| ()), []);
}

#[test]
fn lanes_learnt_at_a_crossing_are_those_of_other_traffic_there() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/crossing");
    let seen = |fcd: Option<&str>, duration_s: f64| {
        let scene = Scene { duration_s, ..Scene::read(&folder.join("train-2.toml")).unwrap() };
        let fcd = fcd.map(|name| folder.join(name));
        let simulation = Simulation::new(scene, fcd.as_deref()).unwrap();
        let (bytes, _) = simulation.record(std::io::Cursor::new(Vec::new()), &|| ()).unwrap();
        recording::mcap::parse(bytes.get_ref(), "train-2".into(), &ReadOptions::default()).unwrap()
    };
    let learnt = lanes::learnt(&[seen(Some("wide-day-1.fcd.xml.gz"), 90.0)], &|_| ());
    let segments = lanes::segments(&learnt);
    assert!(learnt.len() <= MOST_LANES && segments <= MOST_SEGMENTS, "{} lanes, {segments}", learnt.len());
    let (share, driven) = on_lanes(&seen(None, 60.0), &learnt, 80.0);
    println!("{} lanes, {driven} driven, {:.1} % of other traffic on one", learnt.len(), 100.0 * share);
    assert!(share > 0.7 && driven * 2 >= learnt.len(), "{share} {driven} {}", learnt.len());
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
