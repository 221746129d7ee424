//! The daemon as a child, with a folder of its own.

use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use viewshed_harness::boards::machine::Folder;

/// The program; `tests/linux.sh` builds it.
pub fn program() -> PathBuf {
    let path = std::env::var_os("VIEWSHEDD").expect("VIEWSHEDD is the daemon's path: run tests/linux.sh");
    PathBuf::from(path)
}

/// The daemon; it ends with this.
pub struct Daemon {
    child: Child,
    pub folder: Folder,
}

impl Daemon {
    /// Starts it with a configuration, in which `FOLDER` stands for its folder.
    pub fn start(config: &str) -> Self {
        Self::start_in(Folder::new().unwrap(), config, &[])
    }

    /// Starts it in a folder, with an environment.
    pub fn start_in(folder: Folder, config: &str, environment: &[(&str, &str)]) -> Self {
        let path = folder.0.join("viewshed.toml");
        std::fs::write(&path, config.replace("FOLDER", folder.0.to_str().unwrap())).unwrap();
        let log = std::fs::File::create(folder.0.join("stderr")).unwrap();
        let mut command = Command::new(program());
        command.arg("--config").arg(path).stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let child = command.envs(environment.iter().copied()).spawn().unwrap();
        Self { child, folder }
    }

    /// What it said.
    pub fn log(&self) -> String {
        std::fs::read_to_string(self.folder.0.join("stderr")).unwrap()
    }

    /// Waits until it has said something.
    pub fn wait_for(&self, text: &str) {
        self.wait_for_times(text, 1);
    }

    /// Waits until it has said something so many times.
    pub fn wait_for_times(&self, text: &str, times: usize) {
        let started = Instant::now();
        while self.log().matches(text).count() < times {
            assert!(started.elapsed() < Duration::from_secs(20), "no {times} times `{text}` in: {}", self.log());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(started.elapsed() < Duration::from_secs(60), "it does not end: {}", self.log());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    pub fn terminate(&self) {
        kill_process(Pid::from_child(&self.child), Signal::TERM).unwrap();
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The tables of mount, field of view and ends of maps.
pub fn tables(settings: &viewshed::unit::settings::Settings) -> String {
    let (m, v, h) = (settings.sensor.mount, settings.sensor.field_of_view, settings.health);
    format!(
        "[mount]\nx_m = {:?}\ny_m = {:?}\nheight_m = {:?}\nyaw_deg = {:?}\npitch_deg = {:?}\nroll_deg = {:?}\n\
         [field_of_view]\nazimuth_min_deg = {:?}\nazimuth_max_deg = {:?}\nelevation_min_deg = {:?}\n\
         elevation_max_deg = {:?}\nrange_min_m = {:?}\nrange_max_m = {:?}\n\
         [health]\nhold_s = {:?}\nblind_after_s = {:?}\nreset_gap_s = {:?}\n",
        m.x_m,
        m.y_m,
        m.height_m,
        m.yaw_deg,
        m.pitch_deg,
        m.roll_deg,
        v.azimuth_min_deg,
        v.azimuth_max_deg,
        v.elevation_min_deg,
        v.elevation_max_deg,
        v.range_min_m,
        v.range_max_m,
        h.hold_s,
        h.blind_after_s,
        h.reset_gap_s
    )
}
