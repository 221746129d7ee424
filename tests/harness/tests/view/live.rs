//! The page over a unit that is running: the live program of the emulated boards, run here, behind a serial port.

use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serialport::{SerialPort, TTYPort};
use viewshed::fixed::time::Time;
use viewshed::unit::service::Request;
use viewshed::unit::settings::Settings;
use viewshed_harness::boards::live::{Script, answer};
use viewshed_harness::boards::{Profile, scans};
use viewshed_harness::estimators;
use viewshed_harness::recording::{ReadOptions, read};

use crate::browser::{Browser, Page};
use crate::server::{SHIPPED, Server};

/// Bytes that a board sends, with the time of each piece and where the scans' answers end.
struct Sent {
    pieces: Vec<(Duration, Vec<u8>)>,
}

/// What the board sends of the recording's seconds; it has started `starts` times before.
fn sent(seconds: f64, starts: usize) -> Sent {
    let reading = ReadOptions { to_s: Some(seconds), ..ReadOptions::default() };
    let recording = read(Path::new(SHIPPED), &reading).unwrap();
    let settings = Settings::of(estimators::sensor(&recording, &Default::default()));
    let scans = scans::of(&recording);
    let mut script = Script::default();
    script.configure(&settings);
    (0..starts).for_each(|_| script.request(&Request::Restart));
    let begin = script.bytes.len();
    scans.iter().for_each(|scan| script.scan(scan, scans[0].time));
    let answered = answer(Profile::Small, &script.bytes);
    let skipped = answered.lengths.get(begin).copied().unwrap_or(0);
    let mut from = skipped;
    let mut pieces = Vec::new();
    let first = script.marks[0].1;
    for (to, time) in &script.marks {
        let end = answered.lengths[to - 1];
        pieces.push((since(first, *time), answered.bytes[from..end].to_vec()));
        from = end;
    }
    Sent { pieces }
}

fn since(first: Time, time: Time) -> Duration {
    Duration::from_micros(time.since(first).unwrap_or(0))
}

impl Sent {
    /// Sends everything in its own time, and says when the last byte of each piece was out: milliseconds since 1970, and
    /// messages so far.
    fn play(&self, port: &mut TTYPort) -> Vec<(f64, usize)> {
        let begin = Instant::now();
        let mut messages = 0;
        let mut marks = Vec::new();
        for (at, bytes) in &self.pieces {
            std::thread::sleep(at.saturating_sub(begin.elapsed()));
            port.write_all(bytes).unwrap();
            let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
            messages += bytes.iter().filter(|byte| **byte == 0).count();
            marks.push((now.as_secs_f64() * 1000.0, messages));
        }
        marks
    }
}

/// A port, and a page over the other end of it.
fn pair() -> (TTYPort, TTYPort, Server) {
    let (far, near) = TTYPort::pair().unwrap();
    let name = near.name().unwrap();
    let server = Server::run(["view", "--port", &name]);
    (far, near, server)
}

fn opened(browser: &Browser, server: &Server) -> Page {
    let page = browser.open(&server.url);
    page.until("viewshed.following");
    page
}

fn events(page: &Page) -> String {
    page.ask("viewshed.source.events.map((event) => event.text).join('; ')").as_str().unwrap().to_owned()
}

#[test]
fn two_senders_of_one_number_are_shown_as_a_conflict() {
    let Some(browser) = Browser::start("conflict") else { return };
    let (mut far, _near, server) = pair();
    let page = opened(&browser, &server);
    let [one, other] = [0, 2].map(|starts| sent(6.0, starts));
    let begin = Instant::now();
    for ((at, a), (_, b)) in one.pieces.iter().zip(&other.pieces) {
        std::thread::sleep(at.saturating_sub(begin.elapsed()));
        far.write_all(a).unwrap();
        far.write_all(b).unwrap();
    }
    page.until("viewshed.source.events.some((event) => event.text.includes('two senders use the number'))");
    assert!(!events(&page).contains("error"), "{}", events(&page));
}

/// From the last byte of a scan to the frame of the page that shows what it said; prints the median.
#[test]
#[ignore = "a measurement"]
fn how_long_a_scan_takes_to_the_screen() {
    let Some(browser) = Browser::start("latency") else { return };
    let (mut far, _near, server) = pair();
    let page = opened(&browser, &server);
    page.ask(
        "(() => { window.log = []; const tick = () => { const { drawn, instant } = viewshed;
           if (instant && window.log.at(-1)?.number !== drawn.number) window.log.push({ ...drawn, messages: instant.counters[0][1] });
           requestAnimationFrame(tick); }; tick(); })()",
    );
    let marks = sent(20.0, 0).play(&mut far);
    page.rests();
    let log = page.ask("window.log");
    let log: Vec<(f64, usize)> = log
        .as_array()
        .unwrap()
        .iter()
        .map(|d| (d["at"].as_f64().unwrap(), d["messages"].as_u64().unwrap() as usize))
        .collect();
    let mut took: Vec<f64> = marks
        .iter()
        .skip(30)
        .filter_map(|(sent, messages)| {
            log.iter().find(|(at, shown)| shown >= messages && at >= sent).map(|(at, _)| at - sent)
        })
        .collect();
    took.sort_by(f64::total_cmp);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let at = |share: f64| took[(took.len() as f64 * share) as usize];
    println!(
        "from the last byte of a scan to the animation frame that drew it: median {:.0} ms, 90 % within {:.0} ms, of {} scans; software rendering (SwiftShader), load {}",
        at(0.5),
        at(0.9),
        took.len(),
        load.split(' ').next().unwrap_or("?")
    );
    assert!(took.len() > 100 && at(0.5) < 1000.0);
}
