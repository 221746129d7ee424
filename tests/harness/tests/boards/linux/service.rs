//! What a service manager sees: ready, signs of life, the end; and what an administrator sees of mistakes.

use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use viewshed::unit::settings::BLOCK_LEN;
use viewshed_harness::boards::live::Script;
use viewshed_harness::boards::machine::Folder;

use super::daemon::{Daemon, program, tables};
use super::terminal::{Ear, Terminal};
use crate::shipped;

/// The service manager's end of its socket.
struct Manager {
    socket: UnixDatagram,
    states: Vec<String>,
}

impl Manager {
    fn new(folder: &Folder) -> Self {
        let socket = UnixDatagram::bind(folder.0.join("notify")).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(10))).unwrap();
        Self { socket, states: Vec::new() }
    }

    /// Listens for a while.
    fn listen(&mut self, time: Duration) {
        let started = Instant::now();
        let mut buffer = [0; 1024];
        while started.elapsed() < time {
            if let Ok(n) = self.socket.recv(&mut buffer) {
                self.states.extend(String::from_utf8_lossy(&buffer[..n]).lines().map(str::to_owned));
            }
        }
    }

    fn count(&self, what: &str) -> usize {
        self.states.iter().filter(|state| *state == what).count()
    }
}

/// A watchdog of 200 ms: a sign of life at most every 50.
fn start(folder: Folder, config: &str) -> Daemon {
    let socket = folder.0.join("notify");
    Daemon::start_in(folder, config, &[("NOTIFY_SOCKET", socket.to_str().unwrap()), ("WATCHDOG_USEC", "200000")])
}

#[test]
#[ignore = "needs the daemon"]
fn linux_the_service_manager_hears_of_start_frames_and_end() {
    let (settings, _) = shipped(0.1);
    let folder = Folder::new().unwrap();
    let mut manager = Manager::new(&folder);
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/ars408-made-up.log");
    let config = format!(
        "[input]\nradar = \"ars408\"\ncandump = \"{}\"\n[output]\nmedium = \"can\"\ncandump = \"FOLDER/maps.log\"\n{}",
        log.display(),
        tables(&settings)
    );
    // at the pace of the log, 2 s and one of silence
    let begin = Instant::now();
    let mut daemon = start(folder, &config);
    manager.listen(Duration::from_millis(2800));
    assert_eq!(manager.states.first().map(String::as_str), Some("READY=1"), "{:?}", manager.states);
    let fed = manager.count("WATCHDOG=1");
    assert!((5..=50).contains(&fed), "{fed}: {:?}", manager.states);
    assert!(manager.states.iter().any(|state| state.starts_with("STATUS=radar ")), "{:?}", manager.states);
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    assert!((2.9..20.0).contains(&begin.elapsed().as_secs_f64()), "{:?}", begin.elapsed());
    manager.listen(Duration::from_millis(50));
    assert_eq!(manager.states.last().map(String::as_str), Some("STOPPING=1"), "{:?}", manager.states);
}

#[test]
#[ignore = "needs the daemon"]
fn linux_only_completed_frames_feed_the_watchdog() {
    let (settings, scans) = shipped(1.0);
    let folder = Folder::new().unwrap();
    let mut manager = Manager::new(&folder);
    let _ear = Ear::plug(&folder.0.join("maps"), Instant::now());
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    // in a test bench nothing is completed unless something comes in
    let config = "[input]\nradar = \"native\"\nport = \"FOLDER/radar\"\nclock = \"input\"\n\
                  [output]\nmedium = \"serial\"\nport = \"FOLDER/maps\"\n";
    let daemon = start(folder, &format!("{config}{}", tables(&settings)));
    daemon.wait_for("started");
    manager.listen(Duration::from_millis(700));
    assert_eq!((manager.count("READY=1"), manager.count("WATCHDOG=1")), (1, 0), "the loop alone is no life");
    let mut script = Script::default();
    for scan in &scans {
        script.bytes.clear();
        script.scan(scan, scans[0].time);
        radar.send(&script.bytes);
        manager.listen(Duration::from_millis(60));
    }
    let fed = manager.count("WATCHDOG=1");
    assert!(fed >= scans.len() / 3 && fed <= scans.len(), "{fed} of {}", scans.len());
    manager.listen(Duration::from_millis(400));
    assert!(manager.count("WATCHDOG=1") <= fed + 1, "and none afterwards");
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_stored_block_that_cannot_run_leaves_the_daemon_up_answering_and_saying_why() {
    let (settings, scans) = shipped(1.0);
    let mut high = settings;
    high.visibility.slice_height_m = 15.0;
    let mut near = settings;
    (near.sensor.field_of_view.range_min_m, near.sensor.field_of_view.range_max_m) = (0.5, 2.0);
    for (stored, name) in [(high, "visibility.slice_height_m"), (near, "field_of_view.")] {
        let folder = Folder::new().unwrap();
        std::fs::write(folder.0.join("slots"), [stored.to_block(1), [0xFF; BLOCK_LEN]].as_flattened()).unwrap();
        let mut manager = Manager::new(&folder);
        let ear = Ear::plug(&folder.0.join("maps"), Instant::now());
        let mut radar = Terminal::plug(&folder.0.join("radar"));
        let config = "state_dir = \"FOLDER\"\n[input]\nradar = \"native\"\nport = \"FOLDER/radar\"\n\
                      [output]\nmedium = \"serial\"\nport = \"FOLDER/maps\"\n";
        let mut daemon = start(folder, config);
        daemon.wait_for(name);
        manager.listen(Duration::from_millis(1500));
        assert!(manager.count("WATCHDOG=1") >= 2, "the safe state is no reason for a restart: {:?}", manager.states);
        let status = format!("STATUS=safe state: configuration block: {name}");
        assert!(manager.states.iter().any(|state| state.starts_with(&status)), "{:?}", manager.states);
        // the service's answers name it as well, and a block is taken
        let has = |text: &[u8]| ear.bytes().windows(text.len()).any(|w| w == text);
        assert!(has(name.as_bytes()), "refused by name");
        let mut script = Script::default();
        script.configure(&settings);
        radar.send(&script.bytes);
        daemon.wait_for_times("started", 2);
        // at the radar's pace: a burst of scans leaves maps unsent, and the status would say so
        for scan in &scans {
            script.bytes.clear();
            script.scan(scan, scans[0].time);
            radar.send(&script.bytes);
            manager.listen(Duration::from_millis(50));
        }
        daemon.wait_for("radar Degraded: Settling");
        daemon.terminate();
        assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    }
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_missing_bus_is_waited_for_and_sigterm_ends_it() {
    let (settings, _) = shipped(0.1);
    let config = format!(
        "[input]\nradar = \"ars408\"\ninterface = \"nowhere0\"\n[output]\nmedium = \"can\"\ninterface = \"nowhere1\"\n{}",
        tables(&settings)
    );
    let mut daemon = Daemon::start(&config);
    daemon.wait_for("warning: nowhere0: ");
    daemon.wait_for("warning: nowhere1: ");
    std::thread::sleep(Duration::from_millis(1500));
    // said once, though it was tried four times
    assert_eq!(daemon.log().matches("nowhere0: ").count(), 1, "{}", daemon.log());
    daemon.terminate();
    let stopped = Instant::now();
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    assert!(stopped.elapsed() < Duration::from_secs(2));
}

#[test]
#[ignore = "needs the daemon"]
fn linux_mistakes_are_reported_with_file_line_and_key() {
    let folder = Folder::new().unwrap();
    let path = folder.0.join("viewshed.toml");
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards/linux/viewshed.toml");
    let sample = std::fs::read_to_string(sample).unwrap();
    let check = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let output = Command::new(program()).arg("--check").arg("--config").arg(&path).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (output.status.code(), said)
    };
    let (code, said) = check(&sample);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("not there now, would be waited for: interface can0"), "{said}");
    // every key that is explained is a key
    let (code, said) = check(&all_keys(&sample));
    assert_eq!(code, Some(0), "{said}");

    let line = |text: &str, what: &str| 1 + text[..text.find(what).unwrap()].matches('\n').count();
    for (key, wrong, message) in [
        ("height_m = 6.0", "hight_m = 6.0", "mount.hight_m: unknown field `hight_m`"),
        ("height_m = 6.0", "height_m = 60.0", "mount.height_m: is 60, outside 0.1 to 20"),
        ("height_m = 6.0", "height_m = \"high\"", "mount.height_m: invalid type: string \"high\", expected f32"),
        ("radar = \"ars408\"", "radar = \"lidar\"", "input.radar: unknown variant `lidar`"),
        ("interface = \"can0\"", "port = \"/dev/ttyS0\"", "input.port: an ARS408 is on a CAN bus"),
        ("range_max_m = 200.0", "range_max_m = 0.1", "field_of_view.range_max_m: "),
        ("medium = \"can\"", "medium = \"can\"\nmax_delay_ms = 900", "output.max_delay_ms: is 900, outside 10 to 500"),
    ] {
        let text = sample.replacen(key, wrong, 1);
        let (code, said) = check(&text);
        let at = line(&text, wrong.rsplit('\n').next().unwrap());
        assert_eq!(code, Some(2), "{wrong}: {said}");
        assert!(said.contains(&format!("viewshed.toml:{at}: {message}")), "{wrong}: {said}");
    }
    let (code, said) = check(&sample.replace("[mount]", "[mount"));
    assert!(code == Some(2) && said.contains("viewshed.toml:"), "{said}");
    let missing = folder.0.join("none.toml");
    let output = Command::new(program()).arg("--config").arg(&missing).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("none.toml: cannot be read: No such file"));
    // at start as well as by --check, before anything is written
    let log = folder.0.join("in.log");
    std::fs::write(&log, "(1.0) can0 123#00\n").unwrap();
    let text = sample.replace("interface = \"can0\"", &format!("candump = {log:?}"));
    let text = text.replace("interface = \"can1\"", &format!("candump = {log:?}"));
    let (code, said) = check(&text);
    assert!(code == Some(2) && said.contains("output.candump: ") && said.contains("would destroy"), "{said}");
    let output = Command::new(program()).arg("--config").arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(&log).unwrap(), "(1.0) can0 123#00\n");
    // --check finds logs that are not there
    let (code, said) = check(&sample.replace("interface = \"can0\"", "candump = \"none.log\""));
    assert!(code == Some(2) && said.contains("input.candump: none.log is not there"), "{said}");
    let (code, said) = check(&sample.replace("interface = \"can1\"", "candump = \"nowhere/out.log\""));
    assert!(code == Some(2) && said.contains("output.candump: the folder nowhere is not there"), "{said}");
    // a log that is not there is no device to wait for
    std::fs::write(&path, sample.replace("interface = \"can0\"", "candump = \"none.log\"")).unwrap();
    let output = Command::new(program()).arg("--config").arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("input.candump: none.log: No such file"), "{output:?}");
}

#[test]
#[ignore = "needs the daemon"]
fn linux_the_first_try_without_hardware_works_from_the_projects_folder() {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(project.join("boards/linux/first-try.toml")).unwrap();
    let folder = Folder::new().unwrap();
    let (path, log) = (folder.0.join("try.toml"), folder.0.join("first-try.log"));
    std::fs::write(&path, text.replace("\"first-try.log\"", &format!("{log:?}"))).unwrap();
    let output = Command::new(program()).current_dir(&project).arg("-c").arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("35 maps, 275 messages sent, 0 refused"), "{said}");
    assert_eq!(std::fs::read_to_string(&log).unwrap().lines().count(), 275);
    // on the small grid as well, and its header says so
    let small = format!("grid = \"small\"\n{}", std::fs::read_to_string(&path).unwrap());
    std::fs::write(&path, small).unwrap();
    let output = Command::new(program()).current_dir(&project).arg("-c").arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("35 maps, "), "{said}");
    let output = Command::new(env!("CARGO_BIN_EXE_viewshed")).arg("listen").arg(&log).output().unwrap();
    let heard = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(heard.contains("96 azimuths from") && heard.contains("100 ranges of 2 m"), "{heard}");
}

#[test]
#[ignore = "needs the daemon"]
fn linux_bytes_that_are_no_scans_are_told_from_silence() {
    let (settings, _) = shipped(0.1);
    let folder = Folder::new().unwrap();
    let _ear = Ear::plug(&folder.0.join("maps"), Instant::now());
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    let config =
        "[input]\nradar = \"ti\"\nport = \"FOLDER/radar\"\n[output]\nmedium = \"serial\"\nport = \"FOLDER/maps\"\n";
    let mut daemon = start(folder, &format!("{config}{}", tables(&settings)));
    daemon.wait_for("radar: no byte; is the radar powered");
    for _ in 0..40 {
        radar.send(&[0x55; 64]);
        std::thread::sleep(Duration::from_millis(100));
    }
    daemon.wait_for("radar: bytes, and no frames among them; is 921600 its baud rate (input.baud)?");
    daemon.terminate();
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
}

/// The sample with every key on that can be on together.
fn all_keys(sample: &str) -> String {
    let not = [
        "port",
        "baud",
        "candump",
        "header_bytes",
        "has_elevation",
        "doppler_step_mps",
        "angles",
        "[input.ti]",
        // a file that would have to be there
        "[probability]",
        "file",
        "risk",
    ];
    let is_key = |line: &str| line.contains(" = ") || line.starts_with('[');
    let on = |line: &str| match line.strip_prefix('#') {
        Some(key) if !key.starts_with(' ') && is_key(key) && !not.iter().any(|n| key.starts_with(n)) => key.to_owned(),
        _ => line.to_owned(),
    };
    sample.lines().map(on).collect::<Vec<_>>().join("\n")
}
