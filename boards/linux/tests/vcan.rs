//! The daemon on virtual CAN buses of the kernel: frames in and out, buses that go and come back.
//!
//! Skipped, with a line that says why, where the kernel has none or this user may not make them.

use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use socketcan::dump::Reader;
use socketcan::{CanAnyFrame, CanFdSocket, EmbeddedFrame, Id, Socket};
use viewshed::map::Visibility;
use viewshed::time::Time;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::Addresses;
use viewshed::wire::receive::{Limits, Receiver};
use viewshed::wire::status::{Reason, State};

const RADAR: &str = "vsradar";
const MAPS: &str = "vsmaps";

fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(|e| format!("ip: {e}"))?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()) }
}

/// Two virtual buses; they go with this.
struct Buses;

impl Buses {
    fn make() -> Result<Self, String> {
        for name in [RADAR, MAPS] {
            ip(&format!("link add dev {name} type vcan"))?;
            // room for CAN FD frames
            ip(&format!("link set {name} mtu 72"))?;
            ip(&format!("link set {name} up"))?;
        }
        Ok(Self)
    }
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
            .replace("medium = \"can\"", &format!("medium = \"{medium}\""));
        std::fs::write(folder.join("viewshed.toml"), config).unwrap();
        let log = std::fs::File::create(folder.join("stderr")).unwrap();
        // a copy of this test may run elsewhere than it was built
        let program = std::env::var("VIEWSHEDD").unwrap_or(env!("CARGO_BIN_EXE_viewshedd").into());
        let mut command = Command::new(program);
        let child = command.arg("--config").arg(folder.join("viewshed.toml")).stdout(Stdio::null()).stderr(log).spawn();
        Self(child.unwrap(), folder)
    }

    fn wait_for(&self, text: &str, times: usize) {
        let started = Instant::now();
        let log = || std::fs::read_to_string(self.1.join("stderr")).unwrap();
        while log().matches(text).count() < times {
            assert!(started.elapsed() < Duration::from_secs(20), "no {times} times `{text}` in: {}", log());
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
    receiver: Box<Receiver<1, 120, 7>>,
    begin: Instant,
    heard: usize,
}

impl Bench {
    fn new() -> Self {
        let open = |name| {
            let socket = CanFdSocket::open(name).unwrap();
            socket.set_nonblocking(true).unwrap();
            socket
        };
        let receiver = Box::new(Receiver::new([0], Addresses::STANDARD, Limits::DEFAULT));
        Self { radar: open(RADAR), maps: open(MAPS), receiver, begin: Instant::now(), heard: 0 }
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
                let _ = self.receiver.frame(self.now(), &frame.unwrap());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Plays the shipped log to the radar's bus at its pace.
    fn play(&mut self) {
        let log = include_bytes!("../../../tests/recordings/ars408-made-up.log");
        let mut reader = Reader::from_reader(&log[..]);
        let (started, mut first) = (Instant::now(), None);
        while let Some(record) = reader.next_record().unwrap() {
            let due = Duration::from_micros(record.t_us - *first.get_or_insert(record.t_us));
            self.listen(due.saturating_sub(started.elapsed()));
            self.radar.write_frame(&record.frame).unwrap();
        }
    }

    fn state(&self) -> Option<(State, Reason)> {
        self.receiver.sensor(0).and_then(|sensor| sensor.status()).map(|status| (status.state, status.reason))
    }

    fn visible(&self) -> usize {
        let map = self.receiver.map(0, self.now());
        (0..120 * 200).filter(|k| map.cell(k / 200, k % 200).visibility == Visibility::Visible).count()
    }
}

#[test]
fn frames_come_and_go_over_the_kernels_buses() {
    let _buses = match Buses::make() {
        Ok(buses) => buses,
        Err(why) => return println!("skipped: virtual CAN buses: ip link add type vcan: {why}"),
    };
    for medium in ["can", "can-fd"] {
        let mut bench = Bench::new();
        let mut daemon = Daemon::start(medium);
        daemon.wait_for("started", 1);
        bench.play();
        bench.listen(Duration::from_millis(60));
        assert_eq!(bench.state().map(|s| s.0), Some(State::Ok), "{medium}");
        let counters = *bench.receiver.sensor(0).unwrap().counters();
        println!("{medium}: {} frames, {counters:?}, {} cells visible", bench.heard, bench.visible());
        assert_eq!((counters.lost, counters.protection, counters.malformed), (0, 0, 0));
        assert!(bench.visible() > 5000, "{medium}: {}", bench.visible());

        // silence
        bench.listen(Duration::from_millis(1200));
        assert_eq!((bench.state(), bench.visible()), (Some((State::Blind, Reason::RadarSilent)), 0), "{medium}");

        // the bus of the maps goes down and comes back
        ip(&format!("link set {MAPS} down")).unwrap();
        daemon.wait_for(&format!("{MAPS}: "), 2);
        ip(&format!("link set {MAPS} up")).unwrap();
        daemon.wait_for(&format!("{MAPS}: open"), 2);
        bench.maps = Bench::new().maps;
        // that of the radar vanishes
        ip(&format!("link del {RADAR}")).unwrap();
        daemon.wait_for(&format!("warning: {RADAR}: "), 1);
        ip(&format!("link add dev {RADAR} type vcan")).unwrap();
        ip(&format!("link set {RADAR} up")).unwrap();
        daemon.wait_for(&format!("{RADAR}: open"), 2);
        bench.radar = Bench::new().radar;
        bench.play();
        bench.listen(Duration::from_millis(60));
        assert_eq!(bench.state().map(|s| s.0), Some(State::Ok), "{medium}");
        assert!(bench.visible() > 5000, "{medium}: {}", bench.visible());

        assert_eq!(daemon.terminate().code(), Some(0));
        bench.listen(Duration::from_millis(60));
        assert_eq!((bench.state().map(|s| s.0), bench.visible()), (Some(State::Starting), 0), "{medium}");
    }
}
