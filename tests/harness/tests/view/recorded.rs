//! The page over a recording: play, step, jump, ask about cells, and what it looks like.

use std::io::Write;
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use viewshed_harness::recording::write::RecordingWriter;
use viewshed_harness::recording::{ReadOptions, Sensor, read};

use crate::browser::{Browser, Page};
use crate::looks::{contrast, is_readable, readme};
use crate::server::{SHIPPED, Server, folder};

/// The first seconds of the shipped recording.
fn start() -> Server {
    Server::run(["view", SHIPPED, "--to", "10"])
}

fn ready(browser: &Browser, server: &Server) -> Page {
    let page = browser.open(&server.url);
    page.until("viewshed.source.done && viewshed.drawn.number >= 0 && viewshed.instant.maps.length === 2");
    page.rests();
    page
}

fn number(page: &Page) -> f64 {
    page.number("viewshed.number")
}

#[test]
fn it_plays_steps_and_jumps_to_what_is_wrong() {
    let Some(browser) = Browser::start("view") else { return };
    let server = start();
    let page = ready(&browser, &server);
    // it begins where something is judged
    assert!(page.number("viewshed.instant.sample.tv") > 0.0);
    page.key("Home");
    page.until("viewshed.number === 0");
    page.key(".");
    page.key(".");
    page.until("viewshed.number === 2");
    page.key(",");
    page.until("viewshed.number === 1");
    page.key("PageDown");
    page.until("viewshed.number > 12");
    let time = page.number("viewshed.instant.sample.time_s");
    assert!((0.9..1.3).contains(&time), "{time}");
    for (key, kind) in [("v", "fv"), ("i", "fi")] {
        let before = number(&page);
        page.key(key);
        page.until(&format!("viewshed.number > {before}"));
        assert!(page.number(&format!("viewshed.instant.sample.{kind}")) > 0.0);
        let named =
            page.ask(&format!("viewshed.instant.boxes.filter((b) => b.outcome === '{}').length", kind.to_uppercase()));
        assert_eq!(named, page.ask(&format!("viewshed.instant.sample.{kind}")), "boxes and counts agree");
    }
    let before = number(&page);
    page.key(" ");
    page.until(&format!("viewshed.number > {before} + 10"));
    page.key(" ");
    assert_eq!(page.ask("viewshed.playing"), false);
    page.key("End");
    page.until("viewshed.number === viewshed.source.count - 1");
    // a click into the figures over time goes there
    page.click_plot("time", 5.0, 40.0);
    page.until("Math.abs(viewshed.instant.sample.time_s - 5) < 0.2");
    assert_eq!(page.console(), Vec::<String>::new());
}

#[test]
fn samples_that_were_skipped_are_asked_for_and_the_nearest_is_one_that_is_known() {
    let Some(browser) = Browser::start("skipped") else { return };
    let server = start();
    let page = ready(&browser, &server);
    let found = page.ask(
        "(async () => { const { source } = viewshed; const { samples } = source;
           const middle = samples.length >> 1; const { time_s: time } = samples[middle];
           for (const k of [0, 1, 2]) delete samples[middle + k];
           const without = source.nearest(time);
           await source.update();
           return [middle, without, source.nearest(time), samples.findIndex((sample) => !sample)]; })()",
    );
    let [middle, without, again, hole] = [0, 1, 2, 3].map(|k| found[k].as_i64().unwrap());
    assert_eq!((without, again, hole), (middle - 1, middle, -1));
    assert_eq!(page.console(), Vec::<String>::new());
}

#[test]
fn a_cell_says_what_it_is_since_when_and_in_whose_shadow() {
    let Some(browser) = Browser::start("cells") else { return };
    let server = start();
    let page = ready(&browser, &server);
    page.click_plot("time", 7.0, 40.0);
    page.until("Math.abs(viewshed.instant.sample.time_s - 7) < 0.2");
    // a place that is invisible behind an obstacle, far enough from it
    let place = page.ask(
        "(() => { const { instant } = viewshed; const [map] = instant.maps; const { cells, bytes } = map;
           for (const { center: [x, y], size: [length] } of instant.obstacles) {
             const [mx, my, , heading] = cells.mount; const far = Math.hypot(x - mx, y - my);
             if (far < 30 || far > 120) continue;
             const place = [x + ((x - mx) / far) * (length / 2 + 6), y + ((y - my) / far) * (length / 2 + 6)];
             const range = Math.floor(Math.hypot(place[0] - mx, place[1] - my) / cells.cell_m);
             const [right, left] = cells.azimuth_rad;
             const azimuth = Math.floor(((Math.atan2(place[1] - my, place[0] - mx) - heading - right) / (left - right)) * cells.azimuths);
             if (bytes[2 * (azimuth * cells.ranges + range) + 1] === 1) return place; }
           return null; })()",
    );
    let [x, y] = [0, 1].map(|k| place[k].as_f64().expect("an invisible place behind an obstacle"));
    page.click_plot("plan", x, y);
    page.until("viewshed.told");
    let told = page.ask("viewshed.told");
    assert_eq!(told["state"], 1, "{told}");
    assert!(!told["shadows"].as_array().unwrap().is_empty(), "{told}");
    let now = page.number("viewshed.instant.sample.time_s");
    assert!(told["since_s"].as_f64().unwrap() <= now, "{told}");
    let text = page.ask("document.getElementById('cell').textContent");
    let text = text.as_str().unwrap();
    assert!(text.contains("invisible") && text.contains("in the shadow of") && text.contains("since"), "{text}");
    // the receiver's cell has an age
    page.key("m");
    page.click_plot("plan", x, y);
    page.until("viewshed.told?.age_ms !== null && viewshed.told?.age_ms !== undefined");
    let age = page.number("viewshed.told.age_ms");
    assert!((0.0..=300.0).contains(&age), "{age} ms");
    page.key("Escape");
    page.until("viewshed.told === null");
    // with the keyboard alone
    page.focus("plan");
    page.key("ArrowRight");
    page.key("Enter");
    page.until("viewshed.told !== null");
}

#[test]
fn narrow_azimuths_are_drawn_where_they_lie_on_the_senders_and_the_receivers_map() {
    let Some(browser) = Browser::start("narrow") else { return };
    let config = folder("narrow").join("far-road.toml");
    std::fs::write(&config, "[estimators.radar_3d.visibility]\nfar_road_deg = 0\n").unwrap();
    let config = config.to_str().unwrap();
    let server = Server::run(["view", SHIPPED, "--to", "10", "--config", config]);
    let page = ready(&browser, &server);
    page.click_plot("time", 7.0, 40.0);
    page.until("Math.abs(viewshed.instant.sample.time_s - 7) < 0.2");
    for map in 0..2 {
        let narrow = page.ask(&format!("viewshed.instant.maps[{map}].cells.narrow"));
        let [first, end, times] = [0, 1, 2].map(|k| narrow[k].as_f64().unwrap());
        assert!(times == 4.0 && end - first > 40.0, "{narrow}");
        // along the road and far to the side, where the columns are four times as wide
        for (x, y) in [(110.0_f64, 2.0_f64), (110.0, -14.0), (60.0, 5.0), (40.0, 30.0), (30.0, -35.0)] {
            page.click_plot("plan", x, y);
            page.until(&format!("viewshed.told && Math.hypot(viewshed.told.x_m - {x}, viewshed.told.y_m - {y}) < 4"));
            let told = page.ask("viewshed.told");
            let [at_x, at_y] = ["x_m", "y_m"].map(|key| told[key].as_f64().unwrap());
            // half a column to each side of its middle, and what a pixel is wide
            let wide = if (y.atan2(x)).to_degrees().abs() < 10.0 { 0.36_f64 } else { 1.43 };
            let across = (at_y.atan2(at_x) - y.atan2(x)).abs() * x.hypot(y);
            let most = x.hypot(y) * wide.to_radians() / 2.0 + 0.15;
            assert!(across <= most, "map {map}, ({x}, {y}): {across} m beside {told}, {most}");
        }
        page.key("m");
    }
    page.picture(&folder("pictures-narrow").join("view.png"));
    assert_eq!(page.console(), Vec::<String>::new());
}

#[test]
fn the_receivers_map_stands_beside_the_senders_and_the_page_is_readable() {
    let Some(browser) = Browser::start("appearance") else { return };
    let server = start();
    let page = ready(&browser, &server);
    let pictures = folder("pictures");
    page.click_plot("time", 7.6, 40.0);
    page.until("Math.abs(viewshed.instant.sample.time_s - 7.6) < 0.2");
    page.size(1240, 900, 1.0);
    page.rests();
    page.focus("plan");
    page.key("f");
    page.rests();
    // deep in the shadow of the lorry in the left lanes
    page.click_plot("plan", 110.0, 14.0);
    page.until("viewshed.told");
    page.rests();
    page.picture(&readme(&pictures).join("view.png"));
    page.key("b");
    page.until("!document.getElementById('beside').hidden");
    page.rests();
    let title = page.ask("document.getElementById('second-title').textContent");
    assert!(title.as_str().unwrap().contains("receiver") && title.as_str().unwrap().contains("cells"), "{title}");
    // what a receiver on this bus shows is the sender's map, but for what changed within a scan
    let differs: f64 = title.as_str().unwrap().split(": ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    let all = page.number("viewshed.instant.maps[0].codes.length");
    assert!(differs < 0.03 * all, "{differs} of {all}");
    page.picture(&pictures.join("view-beside.png"));
    page.key("?");
    page.until("document.getElementById('help').open");
    assert!(page.number("document.querySelectorAll('#keys dt').length") >= 20.0);
    page.picture(&pictures.join("view-keys.png"));
    page.ask("document.getElementById('help').close()");
    for mode in ["light", "dark"] {
        if mode == "dark" {
            page.dark();
            page.rests();
            page.picture(&pictures.join("view-dark.png"));
        }
        is_readable(&page, 1240);
        for selector in
            ["h1", "#state", "#plan-title", "#legend span", "#counters dt", "#counters dd", "#play", "#now-text"]
        {
            let found = contrast(&page, selector);
            assert!(found >= 4.5, "{mode}, {selector}: {found}");
        }
    }
    page.size(620, 450, 2.0);
    page.rests();
    is_readable(&page, 620);
    page.picture(&pictures.join("view-enlarged.png"));
    assert_eq!(page.console(), Vec::<String>::new());
}

/// Waits until every instant is found.
fn filled(server: &Server) -> serde_json::Value {
    let begin = Instant::now();
    loop {
        let (status, answer) = server.own("GET", "overview/0", &[], "");
        let body = answer.split("\r\n\r\n").nth(1).unwrap_or_default();
        let overview: serde_json::Value = serde_json::from_str(body).unwrap_or_default();
        if status == 200 && overview["done"] == true {
            return overview;
        }
        assert!(begin.elapsed() < Duration::from_secs(120), "{answer}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn several_radars_of_a_recording_are_shown_each_and_together_and_a_silent_one_is_unknown() {
    let Some(browser) = Browser::start("several radars") else { return };
    let path = folder("several-radars").join("two.mcap");
    let reading = ReadOptions { to_s: Some(4.0), ..ReadOptions::default() };
    let recording = read(Path::new(SHIPPED), &reading).unwrap();
    let named = |name: &str| (Sensor { name: name.into(), ..recording.sensor.clone() }, recording.pose);
    let start_ns = recording.frames[0].time_ns;
    let sink = std::fs::File::create(&path).unwrap();
    let mut writer = RecordingWriter::of_several(sink, &[named("left"), named("right")], None, start_ns).unwrap();
    for (k, frame) in recording.frames.iter().enumerate() {
        writer.frame_of(0, frame).unwrap();
        // the same, and silent from the middle on
        if k < 30 {
            writer.frame_of(1, frame).unwrap();
        }
    }
    writer.finish().unwrap();

    let server = Server::run([Path::new("view"), &path]);
    filled(&server);
    let page = browser.open(&server.url);
    page.until("viewshed.source.done && viewshed.drawn.number >= 0");
    // a receiver needs some frames before it has a map
    page.ask("viewshed.goTo(25)");
    page.until("viewshed.number === 25 && viewshed.instant.maps.length === 3");
    let names = page.ask("viewshed.names");
    assert_eq!(names, serde_json::json!(["all sensors together", "left", "receiver, fd-500k-2M", "right"]));
    assert_eq!(page.ask("viewshed.about.sensor"), "left, right");
    let visible = |name: &str| {
        page.number(&format!(
            "(viewshed.of('{name}')[0].bytes ?? []).filter((byte, k) => k % 2 === 1 && (byte & 3) === 2).length"
        ))
    };
    assert!(visible("left") > 1000.0 && visible("left") == visible("right"), "{}", visible("right"));
    page.key("End");
    page.until("viewshed.number === viewshed.source.count - 1");
    assert!(visible("left") > 1000.0 && visible("right") == 0.0, "{}", visible("right"));
    assert_eq!(page.console(), Vec::<String>::new());
}

#[test]
fn with_a_table_a_cell_says_how_often_a_vehicle_there_is_detected_and_what_a_receiver_knows_of_it() {
    let folder = folder("recorded-probability");
    let table = crate::broadcast::table(&folder);
    let server = Server::run([
        Path::new("view"),
        Path::new(SHIPPED),
        Path::new("--to"),
        Path::new("4"),
        Path::new("--probability"),
        &table,
    ]);
    let last = filled(&server)["count"].as_u64().unwrap() - 1;
    let cell = |map: usize, azimuth: usize, range: usize| -> serde_json::Value {
        let (_, answer) = server.own("GET", &format!("cell/{last}/{map}/{azimuth}/{range}"), &[], "");
        serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap_or_default()).unwrap()
    };
    let edges = [2, 26, 51, 76, 102, 128, 153, 179, 204, 230, 255];
    let (mut known, mut lower, mut both) = (0, 0, 0);
    for (azimuth, range) in (0..128).step_by(7).flat_map(|a| (0..200).step_by(9).map(move |r| (a, r))) {
        let (own, received) = (cell(0, azimuth, range), cell(1, azimuth, range));
        let grade = own["grade"].as_u64().unwrap();
        let step = edges.iter().filter(|edge| grade >= **edge).count();
        let of = |cell: &serde_json::Value| cell["probability"].as_f64().map(|p| (255.0 * p).round() as usize);
        let expected = (grade > 0).then_some(51 + 17 * step);
        assert_eq!(of(&own), expected, "grade {grade}");
        known += usize::from(expected.is_some());
        // a receiver's are rounded down, and of the scan that came last
        if let (Some(of_table), Some(at_least)) = (expected, of(&received)) {
            both += 1;
            lower += usize::from(at_least <= of_table);
        }
    }
    assert!(known > 200 && both > 200 && 50 * (both - lower) < both, "{known} known, {lower} of {both} not above");

    let view = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
        command.current_dir(&folder).args(["view", SHIPPED, "--to", "1", "--no-open", "--probability"]);
        let output = command.args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for (arguments, why) in [
        (&["t.probability.toml", "--noise", "0.25,0.3,1,0.15"][..], "was fitted with configuration"),
        (&["none.toml"], "none.toml"),
        (&["t.probability.toml", "--risk", "2"], "2 is not between 0 and 1"),
    ] {
        let (code, error) = view(arguments);
        assert!(code == Some(2) && error.contains(why), "{arguments:?}: {error}");
    }
}

#[test]
fn ten_look_at_once_and_one_that_does_not_read_is_dropped_without_the_others_noticing() {
    let server = Server::run(["view", SHIPPED, "--to", "4"]);
    let overview = filled(&server);
    assert_eq!(overview["count"], 61, "{}", overview["says"]);
    // asks for everything again and again and reads nothing: at last its connection is closed
    let mut deaf = TcpStream::connect(server.host()).unwrap();
    deaf.set_write_timeout(Some(Duration::from_millis(200))).unwrap();
    let request = format!("GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", server.path("instant/30"), server.host());
    let begin = Instant::now();
    let dropped = loop {
        match deaf.write(request.as_bytes()) {
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
            Err(_) => break true,
            Ok(_) => {}
        }
        // the rest live on
        if begin.elapsed() > Duration::from_millis(500) {
            std::thread::scope(|scope| {
                let server = &server;
                let clients: Vec<_> = (0..10)
                    .map(|k| scope.spawn(move || server.own("GET", &format!("instant/{}", 5 * k), &[], "").0))
                    .collect();
                clients.into_iter().for_each(|client| assert_eq!(client.join().unwrap(), 200));
            });
        }
        if begin.elapsed() > Duration::from_secs(60) {
            break false;
        }
    };
    assert!(dropped, "it still hangs on after a minute");
    assert_eq!(server.own("GET", "instant/60", &[], "").0, 200);
    assert_eq!(server.own("GET", "instant/61", &[], "").0, 404);
    assert_eq!(server.own("GET", "cell/59/0/9999/0", &[], "").0, 404);
}

#[test]
fn only_its_own_pages_are_answered() {
    let server = Server::run(["view", SHIPPED, "--to", "2"]);
    let (get, host) = (format!("GET {} HTTP/1.1", server.path("about")), format!("Host: {}", server.host()));
    assert_eq!(server.ask(&[&get, &host], "").0, 200);
    for lines in [
        vec![get.as_str(), "Host: evil.example"],
        vec![&get, &host, "Origin: null"],
        vec!["GET /about HTTP/1.1", &host],
    ] {
        assert!(matches!(server.ask(&lines, "").0, 400 | 403), "{lines:?}");
    }
}
