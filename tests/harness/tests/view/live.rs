//! The page over a unit that is running: the live program of the emulated boards, run here, behind a serial port.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
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
    fn play(&self, port: &mut File) -> Vec<(f64, usize)> {
        let begin = Instant::now();
        let mut messages = 0;
        let mut marks = Vec::new();
        for (at, bytes) in &self.pieces {
            std::thread::sleep(at.saturating_sub(begin.elapsed()));
            port.write_all(bytes).unwrap();
            messages += messages_in(bytes);
            marks.push((now_ms(), messages));
        }
        marks
    }
}

/// Messages that end in these bytes.
pub fn messages_in(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| **byte == 0).count()
}

/// Milliseconds since 1970, as the page counts them.
pub fn now_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64() * 1000.0
}

/// The page notes each instant it draws: when, and how many messages it knew of.
pub fn watch(page: &Page) {
    page.ask(
        "(() => { window.log = []; const tick = () => { const { drawn, instant } = viewshed;
           if (instant && window.log.at(-1)?.number !== drawn.number) window.log.push({ ...drawn, messages: instant.counters[0][1] });
           requestAnimationFrame(tick); }; tick(); })()",
    );
}

/// From each mark (milliseconds since 1970, messages so far) to the frame of the page that shows it, in milliseconds and in
/// rising order.
pub fn delays(page: &Page, marks: &[(f64, usize)]) -> Vec<f64> {
    let log = page.ask("window.log");
    let log: Vec<(f64, usize)> = log
        .as_array()
        .unwrap()
        .iter()
        .map(|d| (d["at"].as_f64().unwrap(), d["messages"].as_u64().unwrap() as usize))
        .collect();
    let delay = |(sent, messages): &(f64, usize)| {
        log.iter().find(|(at, shown)| shown >= messages && at >= sent).map(|(at, _)| at - sent)
    };
    let mut took: Vec<f64> = marks.iter().filter_map(delay).collect();
    took.sort_by(f64::total_cmp);
    took
}

/// Prints what a measurement found.
pub fn print(what: &str, took: &[f64]) {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let at = |share: f64| took[(took.len() as f64 * share) as usize];
    println!(
        "{what} to the animation frame that drew it: median {:.0} ms, 90 % within {:.0} ms, of {} scans; software rendering (SwiftShader), load {}",
        at(0.5),
        at(0.9),
        took.len(),
        load.split(' ').next().unwrap_or("?")
    );
}

/// The far end of a port, and a page over the near one. Dropping the far end unplugs the port: it is this process's alone.
pub fn plugged() -> (File, Server) {
    let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&far).unwrap();
    unlockpt(&far).unwrap();
    let name = ptsname(&far, Vec::new()).unwrap().into_string().unwrap();
    let server = Server::run(["view", "--port", &name]);
    (File::from(far), server)
}

pub fn opened(browser: &Browser, server: &Server) -> Page {
    let page = browser.open(&server.url);
    page.until("viewshed.following");
    page
}

pub fn events(page: &Page) -> String {
    page.ask("viewshed.source.events.map((event) => event.text).join('; ')").as_str().unwrap().to_owned()
}

#[test]
fn two_senders_of_one_number_are_shown_as_a_conflict() {
    let Some(browser) = Browser::start("conflict") else { return };
    let (mut far, server) = plugged();
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
    let (mut far, server) = plugged();
    let page = opened(&browser, &server);
    watch(&page);
    let marks = sent(20.0, 0).play(&mut far);
    page.rests();
    let took = delays(&page, &marks[30..]);
    print("from the last byte of a scan", &took);
    assert!(took.len() > 100 && took[took.len() / 2] < 1000.0);
}
