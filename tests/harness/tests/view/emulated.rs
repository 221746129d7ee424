//! The page over a controller that is running under emulation: its firmware, its serial lines, a port to the page.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use viewshed::fixed::time::Time;
use viewshed::unit::service::Request;
use viewshed::unit::settings::Settings;
use viewshed_harness::boards::live::Script;
use viewshed_harness::boards::machine::{Emulator, Folder, Lines};
use viewshed_harness::boards::scans::{self, Scan};
use viewshed_harness::boards::serial::{Far, LINES, SerialBoard, Waiting};
use viewshed_harness::boards::{Board, Profile, firmware};
use viewshed_harness::estimators;
use viewshed_harness::recording::{ReadOptions, read};

use crate::browser::{Browser, Page};
use crate::live::{delays, events, messages_in, now_ms, opened, plugged, print, watch};
use crate::server::SHIPPED;

/// Time a board is given to start.
const STARTED: Duration = Duration::from_millis(500);

/// An emulated board, and the port that its line of maps goes to.
struct Wired {
    board: SerialBoard,
    port: File,
    script: Script,
    /// Bytes of the script that have been sent, and of the answer that have been passed on.
    sent: usize,
    passed: usize,
    messages: usize,
    first: Time,
    _emulator: Emulator,
    _folder: Folder,
}

impl Wired {
    fn start(port: File, settings: &Settings, first: Time) -> Self {
        let image = firmware::build(Board::Mps2An386, Profile::Small, "live").unwrap();
        let folder = Folder::new().unwrap();
        let waiting = Waiting::new(&folder.0).unwrap();
        let emulator = Emulator::start(Board::Mps2An386, &image, &folder.0, Lines::Sockets(&LINES)).unwrap();
        let mut script = Script::default();
        script.configure(settings);
        let mut wired = Self {
            board: waiting.accept().unwrap(),
            port,
            script,
            sent: 0,
            passed: 0,
            messages: 0,
            first,
            _emulator: emulator,
            _folder: folder,
        };
        wired.exchange(Instant::now() + STARTED);
        wired
    }

    /// Sends what the script has more, and passes on what comes back until then; when the last byte had gone out.
    fn exchange(&mut self, until: Instant) -> f64 {
        self.board.send(&self.script.bytes[self.sent..]).unwrap();
        let sent_ms = now_ms();
        self.sent = self.script.bytes.len();
        loop {
            self.board.collect().unwrap();
            let answer = &self.board.answer[self.passed..];
            self.port.write_all(answer).unwrap();
            self.messages += messages_in(answer);
            self.passed = self.board.answer.len();
            if Instant::now() >= until {
                return sent_ms;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Scans in their own time; when the last byte of each had gone to the board, and the messages that answered it.
    fn scans(&mut self, scans: &[Scan]) -> Vec<(f64, usize)> {
        let (begin, from) = (Instant::now(), scans[0].time);
        let mut marks = Vec::new();
        for (k, scan) in scans.iter().enumerate() {
            self.script.scan(scan, self.first);
            let next = scans.get(k + 1).unwrap_or(scan).time;
            let sent_ms = self.exchange(begin + Duration::from_micros(next.since(from).unwrap()));
            marks.push((sent_ms, self.messages));
        }
        marks
    }

    fn restart(&mut self) {
        self.script.request(&Request::Restart);
        self.exchange(Instant::now() + STARTED);
    }
}

/// The greatest share of visible cells since a time, as the server has it: a page may miss instants.
fn most_visible(page: &Page, since_s: f64) -> f64 {
    page.number(&format!(
        "fetch('overview/0').then((answer) => answer.json()).then(({{ samples }}) =>
           Math.max(...samples.filter(({{ time_s }}) => time_s > {since_s}).map(({{ visible }}) => visible)))"
    ))
}

#[test]
#[ignore = "needs QEMU"]
fn mps2_is_seen_live_stopped_and_restarted() {
    let Some(browser) = Browser::start("emulated") else { return };
    let reading = ReadOptions { to_s: Some(14.0), ..ReadOptions::default() };
    let recording = read(Path::new(SHIPPED), &reading).unwrap();
    let settings = Settings::of(estimators::sensor(&recording, &Default::default()));
    // the emulated line takes some 20 kB a second: a third of the scans, with a fifth of their detections, come in time
    // on a busy computer too
    let mut scans: Vec<Scan> = scans::of(&recording).into_iter().step_by(3).collect();
    scans.iter_mut().for_each(|scan| scan.detections = scan.detections.iter().copied().step_by(5).collect());
    let (before, after) = scans.split_at(scans.len() / 2);

    let (far, server) = plugged();
    let page = opened(&browser, &server);
    let mut wired = Wired::start(far, &settings, scans[0].time);
    watch(&page);
    let marks = wired.scans(before);
    assert!(wired.messages > before.len(), "{} messages to {} scans", wired.messages, before.len());
    page.until("viewshed.source.events.some((event) => event.text.includes('its map is shown'))");
    let seen = most_visible(&page, 0.0);
    assert!(seen > 0.2, "{seen} of its cells were visible");
    assert_eq!(page.ask("viewshed.instant.maps.length"), 1);

    // no scan, no message: what was shown is shown no longer
    page.until("viewshed.source.events.some((event) => event.text.includes('has stopped; all of its map is unknown'))");
    page.until(
        "viewshed.following && viewshed.instant.sample.visible === 0 && viewshed.instant.sample.unknown > 0.999",
    );

    wired.restart();
    wired.scans(after);
    page.until("viewshed.source.events.some((event) => event.text.includes('has restarted'))");
    let anew = page.number("viewshed.source.events.find((event) => event.text.includes('has restarted')).time_s");
    let again = most_visible(&page, anew);
    assert!(again > seen / 2.0, "{again} of its cells, {seen} before");
    let told = events(&page);
    assert!(!told.contains("two senders") && !told.contains("error"), "{told}");
    print("from the last byte of a scan into the emulated board", &delays(&page, &marks[10..]));

    // the port is pulled out
    drop(wired);
    page.until("viewshed.source.done && document.getElementById('message').textContent.includes('the port is gone')");
    assert_eq!(page.console(), Vec::<String>::new());
}
