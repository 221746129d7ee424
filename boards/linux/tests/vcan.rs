//! The daemon on virtual CAN buses of the kernel: frames in and out, buses that go and come back.
//!
//! Skipped, with a line that says why, where the kernel has none or this user may not make them.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use socketcan::dump::Reader;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, EmbeddedFrame, Id, Socket, StandardId,
};
use viewshed::fixed::time::Time;
use viewshed::map::Visibility;
use viewshed::sensor::Sensor;
use viewshed::unit::can_service::{Answers, Tool};
use viewshed::unit::profile::reference::State;
use viewshed::unit::reply::Said;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::Addresses;
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::status::{Reason, UnitState};

#[path = "../../../tests/common/skipped.rs"]
mod skipped;
use skipped::skipped;

const RADAR: &str = "vsradar";
const MAPS: &str = "vsmaps";

fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(|e| format!("ip: {e}"))?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()) }
}

/// Two virtual buses; they go with this.
struct Buses;

impl Buses {
    /// `None` where a test is skipped, which is said.
    fn make(test: &str) -> Option<Self> {
        for name in [RADAR, MAPS] {
            if !added(name, test) {
                return None;
            }
            // room for CAN FD frames
            ip(&format!("link set {name} mtu 72")).unwrap();
            ip(&format!("link set {name} up")).unwrap();
        }
        Some(Self)
    }
}

/// Adds a virtual bus; false where the kernel has none, or not for this user, which is said.
fn added(name: &str, test: &str) -> bool {
    if Command::new("ip").arg("-V").output().is_err() {
        skipped("iproute2", &format!("{test}: no command `ip` (apt-get install iproute2)"));
        return false;
    }
    ip(&format!("link add dev {name} type vcan"))
        .inspect_err(|why| skipped("vcan", &format!("{test}: ip link add type vcan: {why}")))
        .is_ok()
}

impl Drop for Buses {
    fn drop(&mut self) {
        for name in [RADAR, MAPS] {
            let _ = ip(&format!("link del {name}"));
        }
    }
}

/// The daemon; it ends with this.
struct Daemon(Child, std::path::PathBuf);

impl Daemon {
    fn start(medium: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("viewshedd-vcan-{}-{medium}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let sample = include_str!("../viewshed.toml");
        let config = sample
            .replace("interface = \"can0\"", &format!("interface = \"{RADAR}\""))
            .replace("interface = \"can1\"", &format!("interface = \"{MAPS}\""))
            .replace("medium = \"can\"", &format!("medium = \"{medium}\"\nservice = true"));
        std::fs::write(folder.join("viewshed.toml"), config).unwrap();
        let log = std::fs::File::create(folder.join("stderr")).unwrap();
        // a copy of this test may run elsewhere than it was built
        let program = std::env::var("VIEWSHEDD").unwrap_or(env!("CARGO_BIN_EXE_viewshedd").into());
        let mut command = Command::new(program);
        let child = command.arg("--config").arg(folder.join("viewshed.toml")).stdout(Stdio::null()).stderr(log).spawn();
        Self(child.unwrap(), folder)
    }

    /// What it said.
    fn log(&self) -> String {
        std::fs::read_to_string(self.1.join("stderr")).unwrap()
    }

    fn wait_for(&self, text: &str, times: usize) {
        let started = Instant::now();
        while self.log().matches(text).count() < times {
            assert!(started.elapsed() < Duration::from_secs(20), "no {times} times `{text}` in: {}", self.log());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn terminate(&mut self) -> ExitStatus {
        let pid = rustix::process::Pid::from_child(&self.0);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        self.0.wait().unwrap()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
        let _ = std::fs::remove_dir_all(&self.1);
    }
}

/// Both ends of the buses, and what a receiver makes of the maps.
struct Bench {
    radar: CanFdSocket,
    maps: CanFdSocket,
    receiver: Box<Receiver<1, { State::AZIMUTHS }, { State::WORDS }>>,
    begin: Instant,
    heard: usize,
    tool: Tool,
    answers: Answers,
    said: Vec<Said>,
}

impl Bench {
    fn new(medium: &str) -> Self {
        let addresses = Addresses::STANDARD;
        let medium = if medium == "can" { Medium::Can(addresses) } else { Medium::CanFd(addresses) };
        let open = |name| {
            let socket = CanFdSocket::open(name).unwrap();
            socket.set_nonblocking(true).unwrap();
            socket
        };
        let receiver = Box::new(Receiver::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT));
        let (tool, answers) = (Tool::new(0, medium), Answers::new(0, medium));
        let begin = Instant::now();
        Self { radar: open(RADAR), maps: open(MAPS), receiver, begin, heard: 0, tool, answers, said: Vec::new() }
    }

    fn now(&self) -> Time {
        Time::from_micros(self.begin.elapsed().as_micros() as u64)
    }

    fn listen(&mut self, time: Duration) {
        let started = Instant::now();
        while started.elapsed() < time {
            while let Ok(frame) = self.maps.read_frame() {
                let Id::Standard(id) = frame.id() else { continue };
                let id = CanId::standard(id.as_raw()).unwrap();
                let frame = match &frame {
                    CanAnyFrame::Fd(frame) => CanFrame::fd(id, frame.data()),
                    frame => CanFrame::classic(id, frame.data()),
                };
                self.heard += 1;
                let frame = frame.unwrap();
                self.said.extend(self.answers.take(&frame));
                let _ = self.receiver.frame(self.now(), &frame);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Sends the integrator's frames.
    fn ask(&mut self, frames: &[CanFrame]) {
        for frame in frames {
            let id = StandardId::new(frame.id.raw() as u16).unwrap();
            let frame: CanAnyFrame = match frame.fd {
                true => CanFdFrame::new(id, frame.data()).unwrap().into(),
                false => CanDataFrame::new(id, frame.data()).unwrap().into(),
            };
            self.maps.write_frame(&frame).unwrap();
            self.listen(Duration::from_millis(2));
        }
        self.listen(Duration::from_millis(200));
    }

    /// Plays the shipped log to the radar's bus, at its pace and up to five times, until something is so.
    fn play_until(&mut self, so: impl Fn(&Self) -> bool) -> bool {
        let log = include_bytes!("../../../tests/recordings/ars408-made-up.log");
        for _ in 0..5 {
            let mut reader = Reader::from_reader(&log[..]);
            let (started, mut first, mut count) = (Instant::now(), None, 0_u32);
            while let Some(record) = reader.next_record().unwrap() {
                let due = Duration::from_micros(record.t_us - *first.get_or_insert(record.t_us));
                self.listen(due.saturating_sub(started.elapsed()));
                self.radar.write_frame(&record.frame).unwrap();
                count += 1;
                if count.is_multiple_of(50) && so(self) {
                    return true;
                }
            }
        }
        false
    }

    /// Whether maps come and show something, with nothing wrong: still settling, or settled on a machine so slow.
    fn is_ok(&self) -> bool {
        let well = [(UnitState::Ok, Reason::None), (UnitState::Degraded, Reason::Settling)];
        self.state().is_some_and(|state| well.contains(&state)) && self.visible() > 5000
    }

    /// Listens until something is so; `false` if it is not within a minute: a loaded machine that emulates another is slow.
    fn until(&mut self, so: impl Fn(&Self) -> bool) -> bool {
        let started = Instant::now();
        while !so(self) {
            if started.elapsed() > Duration::from_secs(60) {
                return false;
            }
            self.listen(Duration::from_millis(10));
        }
        true
    }

    fn state(&self) -> Option<(UnitState, Reason)> {
        self.receiver.sensor(0).and_then(|sensor| sensor.status()).map(|status| (status.state, status.reason))
    }

    fn visible(&self) -> usize {
        let map = self.receiver.map(0, self.now());
        let ranges = State::RANGES;
        let seen = |k: &usize| map.cell(k / ranges, k % ranges).visibility == Visibility::Visible;
        (0..State::AZIMUTHS * ranges).filter(seen).count()
    }
}

/// Those of the sample file.
fn settings() -> Settings {
    let table: toml::Table = include_str!("../viewshed.toml").parse().unwrap();
    let part = |name: &str| table[name].clone();
    let (mount, field_of_view) = (part("mount").try_into().unwrap(), part("field_of_view").try_into().unwrap());
    Settings::of(Sensor { mount, field_of_view, noise: Default::default() })
}

/// What a command wrote, and how it ended.
fn ran(child: Child) -> (Option<i32>, String, String) {
    let output = child.wait_with_output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// Plays a log to a bus at its pace, to a time since its first frame; how many frames that are.
fn play(log: &[u8], socket: &CanFdSocket, seconds: u64) -> usize {
    let mut reader = Reader::from_reader(log);
    let (started, mut first, mut count) = (Instant::now(), None, 0);
    while let Some(record) = reader.next_record().unwrap() {
        let due = Duration::from_micros(record.t_us - *first.get_or_insert(record.t_us));
        if due > Duration::from_secs(seconds) {
            break;
        }
        std::thread::sleep(due.saturating_sub(started.elapsed()));
        socket.write_frame(&record.frame).unwrap();
        count += 1;
    }
    count
}

/// `viewshed doctor --can`, `listen --can` and `view --can`: `VIEWSHED` names the command, `BROADCAST` a log of a broadcast.
#[test]
fn the_command_examines_and_shows_a_live_bus() {
    const LIVE: &str = "vslive";
    if !added(LIVE, "`viewshed` on live buses") {
        return;
    }
    let (Ok(viewshed), Ok(broadcast)) = (std::env::var("VIEWSHED"), std::env::var("BROADCAST")) else {
        ip(&format!("link del {LIVE}")).unwrap();
        return skipped("viewshed", "`viewshed` on live buses: no VIEWSHED and BROADCAST are named (tests/linux.sh)");
    };
    let start = |arguments: &str| {
        let mut command = Command::new(&viewshed);
        let command = command.args(arguments.split(' ')).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    // what cannot be listened to
    for (arguments, says) in [
        ("listen --can absent0", "there is no interface absent0; CAN interfaces here: "),
        ("doctor --can lo", "lo is no CAN interface"),
        ("doctor --can vslive", "vslive is down; set it up: `ip link set vslive up type can bitrate 500000`"),
    ] {
        let (code, _, error) = ran(start(arguments));
        assert_eq!(code, Some(2), "{arguments}: {error}");
        assert!(error.starts_with("error: ") && error.contains(says), "{arguments}: {error}");
    }
    ip(&format!("link set {LIVE} mtu 72")).unwrap();
    ip(&format!("link set {LIVE} up")).unwrap();
    let socket = CanFdSocket::open(LIVE).unwrap();

    let (code, text, error) = ran(start("doctor --can vslive --for 1"));
    assert_eq!(code, Some(1), "{error}");
    assert!(text.contains("WRONG: no frame came within 1."), "{text}");

    // a bus with two radars
    let doctor = start("doctor --can vslive --for 5");
    std::thread::sleep(Duration::from_secs(2));
    let played = play(include_bytes!("../../../tests/recordings/ars408-made-up.log"), &socket, 10);
    let (code, text, error) = ran(doctor);
    assert_eq!(code, Some(0), "{text}{error}");
    for said in [
        &format!("vslive: {played} frames in 5.") as &str,
        "sensor 0 on vslive: Clusters, 28 of 28 scans, 564 entries",
        "sensor 3 on vslive: Objects, 28 of 28 scans",
        "`cansend vslive 230#7800000010240000`",
    ] {
        assert!(text.contains(said), "`{said}` in: {text}");
    }

    // a bus with a broadcast that ends after three seconds
    let log = std::fs::read(broadcast).unwrap();
    let listen = start("listen --can vslive --for 8 --every 0.5");
    std::thread::sleep(Duration::from_secs(2));
    let played = play(&log, &socket, 3);
    let (code, text, error) = ran(listen);
    assert_eq!(code, Some(0), "{text}{error}");
    let looks: Vec<&str> = text.lines().filter(|line| line.contains("s  sensor 0: ")).collect();
    let visible = |line: &str| line.split("sensor 0: ").nth(1)?.split(' ').next()?.parse::<f64>().ok();
    let most = looks.iter().filter_map(|line| visible(line)).fold(0.0, f64::max);
    println!("listen --can: {played} frames, {} looks, {most} % visible at most", looks.len());
    assert!(looks.len() >= 6 && most > 60.0, "{text}");
    assert!(text.contains("no broadcast among 0 frames"), "before: {text}");
    assert!(looks.last().is_some_and(|line| line.contains("all of its map is unknown")), "after: {text}");
    assert!(
        text.contains(&format!("frames: {played} came, ")) && text.contains("by their counters 0 never came"),
        "{text}"
    );

    // the same in a page: shown, and then said to have stopped
    let mut view = start("view --can vslive --no-open");
    let mut lines = BufReader::new(view.stdout.take().unwrap()).lines();
    let url = lines.find_map(|line| line.ok().filter(|line| line.starts_with("http://"))).expect("an address");
    let played = play(&log, &socket, 3);
    std::thread::sleep(Duration::from_secs(2));
    let (host, token) = url.trim_start_matches("http://").trim_end_matches('/').split_once('/').unwrap();
    let mut page = TcpStream::connect(host).unwrap();
    write!(page, "GET /{token}/overview/0 HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut overview = String::new();
    page.read_to_string(&mut overview).unwrap();
    view.kill().unwrap();
    view.wait().unwrap();
    let shares = overview.split("\"visible\":").skip(1);
    let shares = shares.filter_map(|rest| rest.split([',', '}']).next()?.parse::<f64>().ok());
    let most = shares.fold(0.0, f64::max);
    println!("view --can: {played} frames, {:.0} % visible at most", 100.0 * most);
    assert!(most > 0.6, "{overview}");
    for said in ["sensor 0 is heard; its map is shown", "sensor 0 has stopped; all of its map is unknown"] {
        assert!(overview.contains(said), "`{said}` in: {overview}");
    }

    // Ctrl-C ends it, and the report is there
    let listen = start("listen --can vslive");
    std::thread::sleep(Duration::from_secs(2));
    let pid = rustix::process::Pid::from_child(&listen);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    let (code, _, error) = ran(listen);
    assert_eq!(code, Some(2));
    assert!(error.contains("vslive: no frame came"), "{error}");
    ip(&format!("link del {LIVE}")).unwrap();
}

#[test]
fn frames_come_and_go_over_the_kernels_buses() {
    let Some(_buses) = Buses::make("frames come and go") else { return };
    for medium in ["can", "can-fd"] {
        let mut bench = Bench::new(medium);
        let mut daemon = Daemon::start(medium);
        daemon.wait_for("started", 1);
        assert!(bench.play_until(|bench| bench.is_ok()), "{medium}: {:?}", bench.state());
        let counters = *bench.receiver.sensor(0).unwrap().counters();
        println!("{medium}: {} frames, {counters:?}, {} cells visible", bench.heard, bench.visible());
        assert_eq!((counters.protection, counters.malformed), (0, 0));

        // another height, over the bus
        let mut settings = settings();
        settings.sensor.mount.height_m = 7.5;
        let block: Vec<CanFrame> = bench.tool.write(&settings.to_block(0)).collect();
        bench.ask(&block);
        // a slow machine first works through the radar's frames
        let written = |bench: &Bench| matches!(bench.said.last(), Some(Said::Written(_)));
        assert!(bench.until(written), "{medium}: {:?}", bench.said);
        let restart = bench.tool.restart().unwrap();
        bench.ask(&[restart]);
        daemon.wait_for("restart with the newest configuration block", 1);
        let height = |bench: &Bench| bench.receiver.sensor(0).and_then(|s| s.header()).map(|h| h.mount.height_cm);
        assert!(bench.until(|bench| height(bench) == Some(750)), "{medium}: {:?}", height(&bench));
        assert!(bench.play_until(|bench| bench.is_ok()), "{medium}: {:?}", bench.state());

        // and another by the command, which reads it back; `VIEWSHED` names it
        if let Ok(viewshed) = std::env::var("VIEWSHED") {
            let file = daemon.1.join("unit.toml");
            std::fs::write(&file, include_str!("../viewshed.toml").replace("height_m = 6.0", "height_m = 8.25"))
                .unwrap();
            let mut command = Command::new(viewshed);
            command.arg("configure").arg(&file).args(["--can", MAPS, "--restart"]).stdout(Stdio::piped());
            if medium == "can-fd" {
                command.arg("--fd");
            }
            let (code, text, error) = ran(command.stderr(Stdio::piped()).spawn().unwrap());
            assert_eq!(code, Some(0), "{medium}: {text}{error}");
            assert!(
                text.contains("written as block 3, and read back the same\nrestarted with block 3"),
                "{medium}: {text}"
            );
            assert!(bench.until(|bench| height(bench) == Some(825)), "{medium}: {:?}", height(&bench));
            assert!(bench.play_until(|bench| bench.is_ok()), "{medium}: {:?}", bench.state());
        }

        // silence
        let blind = Some((UnitState::Blind, Reason::RadarSilent));
        assert!(bench.until(|bench| bench.state() == blind && bench.visible() == 0), "{medium}: {:?}", bench.state());

        // the bus of the maps goes down and comes back
        ip(&format!("link set {MAPS} down")).unwrap();
        daemon.wait_for(&format!("{MAPS}: "), 2);
        ip(&format!("link set {MAPS} up")).unwrap();
        daemon.wait_for(&format!("{MAPS}: open"), 2);
        bench.maps = Bench::new(medium).maps;
        // that of the radar vanishes
        ip(&format!("link del {RADAR}")).unwrap();
        daemon.wait_for(&format!("warning: {RADAR}: "), 1);
        ip(&format!("link add dev {RADAR} type vcan")).unwrap();
        ip(&format!("link set {RADAR} up")).unwrap();
        daemon.wait_for(&format!("{RADAR}: open"), 2);
        bench.radar = Bench::new(medium).radar;
        assert!(bench.play_until(|bench| bench.is_ok()), "{medium}: {:?}, {}", bench.state(), daemon.log());

        assert_eq!(daemon.terminate().code(), Some(0));
        let gone = Some((UnitState::Starting, Reason::None));
        assert!(bench.until(|bench| bench.state() == gone && bench.visible() == 0), "{medium}: {:?}", bench.state());
    }
}

#[test]
fn an_interface_that_takes_no_can_fd_is_said_once_with_what_sets_it_up() {
    let Some(_buses) = Buses::make("an interface without CAN FD") else { return };
    let mtu = |mtu| {
        ip(&format!("link set {MAPS} down")).unwrap();
        ip(&format!("link set {MAPS} mtu {mtu}")).unwrap();
        ip(&format!("link set {MAPS} up")).unwrap();
    };
    mtu(16);
    let mut daemon = Daemon::start("can-fd");
    daemon.wait_for("warning: vsmaps: takes no CAN FD frames; set it up for them: `ip link set vsmaps type can ", 1);
    std::thread::sleep(Duration::from_secs(3));
    // once, and there is nothing to open again
    assert_eq!(daemon.log().matches(MAPS).count(), 3, "{}", daemon.log());
    mtu(72);
    daemon.wait_for("vsmaps: open", 2);
    let mut bench = Bench::new("can-fd");
    assert!(bench.until(|bench| bench.state().is_some()), "{}", daemon.log());
    assert_eq!(daemon.terminate().code(), Some(0));
}

#[test]
fn a_bus_off_of_the_radars_bus_is_in_the_status() {
    let Some(_buses) = Buses::make("a bus-off in the status") else { return };
    let mut bench = Bench::new("can");
    let mut daemon = Daemon::start("can");
    daemon.wait_for("started", 1);
    assert!(bench.play_until(|bench| bench.is_ok()), "{:?}", bench.state());
    // as the kernel says it of a controller
    bench.radar.write_frame(&CanErrorFrame::new_error(0x40, &[0; 8]).unwrap()).unwrap();
    daemon.wait_for("warning: vsradar: bus-off", 1);
    let degraded = Some((UnitState::Degraded, Reason::BusOff));
    assert!(bench.play_until(|bench| bench.state() == degraded), "{:?}", bench.state());
    // on classic CAN the counter is on a page of its own, which comes within the next few messages
    let bus_off =
        |bench: &Bench| bench.receiver.sensor(0).and_then(|sensor| sensor.status()).map(|status| status.bus_off);
    assert!(bench.play_until(|bench| bus_off(bench) == Some(1)), "{:?}", bus_off(&bench));
    assert_eq!(daemon.terminate().code(), Some(0));
}
