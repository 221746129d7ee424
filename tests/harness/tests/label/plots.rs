//! The plots: every detection is where it belongs, also after a pan, and how long that takes.

use std::fs::File;
use std::path::{Path, PathBuf};

use viewshed_harness::recording::write::RecordingWriter;
use viewshed_harness::recording::{self, ReadOptions};

use crate::browser::{Browser, Page, SHIFT};
use crate::server::{SHIPPED, Server, folder, recording};

/// Detections of the dense recording.
const MANY: usize = 200_000;

/// The shipped recording with copies of its detections beside them, up to 200 000.
fn dense(test: &str) -> PathBuf {
    let path = folder(test).join("dense.mcap");
    let mut recording = recording::read(Path::new(SHIPPED), &ReadOptions::default()).unwrap();
    let frames = recording.frames.len();
    for (k, frame) in recording.frames.iter_mut().enumerate() {
        let wanted = (k + 1) * MANY / frames - k * MANY / frames;
        let own = frame.detections.clone();
        let copies = (0..).flat_map(|copy| own.iter().map(move |d| (copy, *d)));
        let spread = copies.map(|(copy, mut d)| {
            d.range_m += 0.7 * copy as f32;
            d.azimuth_rad += 0.01 * (copy % 7) as f32;
            d
        });
        frame.detections = spread.take(wanted).collect();
        assert_eq!(frame.detections.len(), wanted);
    }
    let start_ns = recording.frames[0].time_ns;
    let mut writer =
        RecordingWriter::new(File::create(&path).unwrap(), &recording.sensor, &recording.pose, start_ns).unwrap();
    recording.frames.iter().for_each(|frame| writer.frame(frame).unwrap());
    writer.finish().unwrap();
    path
}

/// How many detections lie in a plot's picture, and how many of these have no pixel.
fn missing(page: &Page, plot: &str) -> [f64; 2] {
    let found = page.ask(&format!(
        "(() => {{
           const {{ points, drawn, source }} = viewshed.plots.{plot};
           const pixels = points.getContext('2d').getImageData(0, 0, points.width, points.height).data;
           const {{ across, up }} = source.layer();
           const [from, to] = '{plot}' === 'plan' ? source.range(drawn) : [0, across.length];
           let [inside, missing] = [0, 0];
           for (let i = from; i < to; i += 1) {{
             const x = Math.floor((across[i] - drawn.left) * (points.width / (drawn.right - drawn.left)));
             const y = Math.floor((drawn.top - up[i]) * (points.height / (drawn.top - drawn.bottom)));
             if (!(x >= 0 && y >= 0 && x < points.width && y < points.height)) continue;
             inside += 1;
             if (pixels[4 * (y * points.width + x) + 3] !== 255) missing += 1;
           }}
           return [inside, missing];
         }})()"
    ));
    [0, 1].map(|k| found[k].as_f64().unwrap())
}

#[test]
fn no_point_of_200_000_is_missing_after_a_pan_and_the_picture_moves_at_once() {
    let Some(browser) = Browser::start("200 000 points") else { return };
    let server = Server::with(&dense("dense"), &[]);
    let page = browser.open(&server.url);
    assert_eq!(page.number("viewshed.recording.count"), MANY as f64);
    page.key("0");
    page.rests();
    let [all, lost] = missing(&page, "along");
    assert!(all > 0.9 * MANY as f64 && lost == 0.0, "{lost} of {all}");
    page.wheel(page.screen("along", 20.0, 80.0), -600.0);
    page.rests();
    let before = page.ask("viewshed.plots.along.drawn");
    // the picture has moved in the next frame, and has not been drawn afresh by then
    let moved = page.ask(
        "new Promise((done) => {
           const plot = viewshed.plots.along;
           const view = plot.view;
           const by = (view.right - view.left) / 5;
           viewshed.show('along', { ...view, left: view.left + by, right: view.right + by });
           requestAnimationFrame(() => done([plot.points.style.transform, plot.drawn, plot.area.width / 5]));
         })",
    );
    assert_eq!(moved[1], before, "drawn afresh already");
    let shift = moved[0].as_str().unwrap().trim_start_matches("translate(").split("px").next().unwrap().parse::<f64>();
    let width = moved[2].as_f64().unwrap() * 5.0;
    assert!((shift.unwrap() + width * 0.25 + moved[2].as_f64().unwrap()).abs() < 1.0, "{moved}");
    page.rests();
    assert_ne!(page.ask("viewshed.plots.along.drawn"), before);
    for plot in ["along", "across", "plan"] {
        let [inside, lost] = missing(&page, plot);
        assert!(inside > 500.0 && lost == 0.0, "{plot}: {lost} of {inside}");
    }
    // by mouse, by keys, on a screen of more pixels
    page.size(1400, 1000, 2.0);
    let from = page.screen("along", 20.0, 80.0);
    page.drag(&[from, [from[0] + 60.0, from[1] + 10.0], [from[0] + 220.0, from[1] - 30.0]], 0);
    page.focus("across");
    page.key_with("ArrowUp", SHIFT);
    page.rests();
    let views = page.ask("[viewshed.plots.along.view.left, viewshed.plots.across.view.left]");
    assert_eq!(views[0], views[1], "the plots over time show one time");
    for plot in ["along", "across"] {
        let [inside, lost] = missing(&page, plot);
        assert!(inside > 500.0 && lost == 0.0, "{plot}: {lost} of {inside}");
    }
}

#[test]
fn brushed_reflections_stand_out_in_all_plots() {
    let Some(browser) = Browser::start("brush") else { return };
    let server = Server::start(&recording("brush"));
    let page = browser.open(&server.url);
    page.until_saved();
    let corners = [page.screen("across", 1.0, 6.0), page.screen("across", 8.0, 0.0)];
    page.drag(&[corners[0], corners[1]], SHIFT);
    page.until("viewshed.session.chosen !== null");
    let [chosen, wrong] = ["c", "w"].map(|what| {
        page.number(&format!(
            "(() => {{ const {{ time, y }} = viewshed.recording; const {{ chosen, brush: {{ area }} }} = viewshed.session;
               let [c, w] = [0, 0];
               chosen.forEach((one, i) => {{
                 const inside = time[i] >= area.left && time[i] <= area.right && y[i] >= area.bottom && y[i] <= area.top;
                 c += one; w += Number(Boolean(one) !== inside);
               }});
               return {what}; }})()"
        ))
    });
    assert!(chosen > 100.0 && wrong == 0.0, "{chosen} {wrong}");
    page.rests();
    // the others are faint, and still there
    let faint = page.ask(
        "(() => { const { points } = viewshed.plots.along; const pixels = new Uint32Array(points.getContext('2d')
           .getImageData(0, 0, points.width, points.height).data.buffer);
           return [pixels.filter((p) => p === viewshed.faint[0]).length, pixels.filter((p) => p !== 0).length]; })()",
    );
    assert!(faint[0].as_f64().unwrap() > 50.0 && faint[1].as_f64() > faint[0].as_f64(), "{faint}");
    page.key("Escape");
    page.until("viewshed.session.chosen === null");
}

/// Times with 200 000 points: `cargo test --release -p viewshed-harness --test label -- --ignored --nocapture`.
#[test]
#[ignore = "a bench, for quiet machines"]
fn times_of_200_000_points() {
    let Some(browser) = Browser::start("bench") else { return };
    let server = Server::with(&dense("bench"), &[]);
    let page = browser.open(&server.url);
    page.key("0");
    page.rests();
    println!("renderer: the page's own, on a canvas of bytes; {}", page.ask("navigator.userAgent"));
    println!("load, from request to first drawing: {:.0} ms", page.number("viewshed.loaded"));
    let (mut moved, mut drawn) = (Vec::new(), Vec::new());
    for k in 0..41 {
        let by = if k % 2 == 0 { "0.1" } else { "-0.1" };
        let times = page.ask(&format!(
            "new Promise((done) => {{
               const plot = viewshed.plots.along;
               const {{ view }} = plot;
               const by = {by} * (view.right - view.left);
               viewshed.show('along', {{ ...view, left: view.left + by, right: view.right + by }});
               setTimeout(() => done([plot.times.moved, plot.times.drawn]), 400);
             }})"
        ));
        moved.push(times[0].as_f64().unwrap());
        drawn.push(times[1].as_f64().unwrap());
    }
    for (what, times) in [("pan, until the picture has moved", &mut moved), ("full drawing", &mut drawn)] {
        times.sort_by(f64::total_cmp);
        println!("{what}: median {:.1} ms, worst {:.1} ms", times[times.len() / 2], times[times.len() - 1]);
    }
}
