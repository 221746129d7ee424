//! `viewshed replay --live` and `--port`: the live programs from the command line.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use serde_json::Value;
use serialport::{SerialPort, TTYPort};
use viewshed_harness::boards::{Profile, live};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("live-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn replay(folder: &Path, recording: &str, arguments: &[&str]) -> (Output, Value) {
    let recording = format!("{}/../recordings/{recording}", env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    let output = command.current_dir(folder).args(["replay", &recording, "--json", "r.json"]).args(arguments);
    let output = output.output().unwrap();
    let json = std::fs::read_to_string(folder.join("r.json")).unwrap_or_else(|_| "null".into());
    (output, serde_json::from_str(&json).unwrap())
}

#[test]
#[ignore = "needs QEMU"]
fn mps2_live_from_the_command_line() {
    let folder = folder("mps2");
    let (output, json) = replay(&folder, "motorway.mcap", &["--board", "mps2-an386", "--live", "--to", "2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let live = &json[0];
    assert!(live["scans"].as_u64().unwrap() >= 30 && live["equal"] == live["scans"], "{live}");
    assert!(live["visible_cells"].as_u64().unwrap() > 5000 && live["messages"].as_u64().unwrap() > 60, "{live}");
    let worst = live["instructions"]["worst"].as_u64().unwrap();
    assert!((200_000..3_000_000).contains(&worst), "{worst} instructions");
}

#[test]
#[ignore = "needs QEMU"]
fn zcu102_live_from_the_command_line() {
    let folder = folder("zcu102");
    let log = ["--sensor-id", "0", "--board", "zcu102-r5", "--live"];
    let (output, json) = replay(&folder, "ars408-made-up.log", &log);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(json[0]["scans"].as_u64().unwrap() > 20 && json[0]["equal"] == json[0]["scans"], "{json}");
}

/// Bytes on their way to a device, each by itself: as another one, or not at all.
struct Through<R, F>(R, F);

impl<R: Read, F: FnMut(u8) -> Option<u8>> Read for Through<R, F> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            match self.0.read(&mut buffer[..1]) {
                Err(e) if e.kind() == std::io::ErrorKind::TimedOut => {}
                Ok(1) => {
                    if let Some(byte) = (self.1)(buffer[0]) {
                        buffer[0] = byte;
                        return Ok(1);
                    }
                }
                other => return other,
            }
        }
    }
}

/// A port with this computer's own board behind it: a test bench, or a product.
pub fn device(profile: Profile, is_bench: bool, through: impl FnMut(u8) -> Option<u8> + Send + 'static) -> String {
    let (mut far, near) = TTYPort::pair().unwrap();
    far.set_timeout(Duration::from_secs(1)).unwrap();
    let name = near.name().unwrap();
    let write = far.try_clone_native().unwrap();
    std::thread::spawn(move || {
        // the pair stays open for as long as the board runs
        let _near = near;
        live::device(profile, is_bench, Through(far, through), write);
    });
    name
}

#[test]
fn a_board_behind_a_port_is_compared_scan_by_scan() {
    let folder = folder("port");
    let path = device(Profile::Small, true, Some);
    let (output, json) = replay(&folder, "motorway.mcap", &["--port", &path, "--profile", "small", "--to", "2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let live = &json[0];
    assert!(live["scans"].as_u64().unwrap() >= 30 && live["equal"] == live["scans"], "{live}");
    assert!(live["visible_cells"].as_u64().unwrap() > 1000, "{live}");
}

#[test]
fn a_board_behind_a_port_that_hears_something_else_fails_with_a_picture() {
    let folder = folder("port-noise");
    // a byte in 40 000 is another one
    let mut count = 0;
    let path = device(Profile::Small, true, move |byte| {
        count += 1;
        Some(if count % 40_000 == 0 { byte ^ 0x55 } else { byte })
    });
    let (output, json) = replay(&folder, "motorway.mcap", &["--port", &path, "--profile", "small", "--to", "3"]);
    assert!(!output.status.success());
    assert!(json[0]["equal"].as_u64() < json[0]["scans"].as_u64(), "{json}");
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(printed.contains("here") && printed.contains("difference.png"), "{printed}");
    let pictures = std::fs::read_dir(folder.join("out/live")).unwrap().count();
    assert_eq!(pictures, 3, "here, there, and what differs");
}

#[test]
fn a_port_with_nobody_behind_it_is_told() {
    let folder = folder("port-silent");
    let (_far, near) = TTYPort::pair().unwrap();
    let path = near.name().unwrap();
    let (output, _) = replay(&folder, "motorway.mcap", &["--port", &path, "--to", "3"]);
    assert!(!output.status.success());
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(printed.contains("nothing answers") && printed.contains("reset button"), "{printed}");
}

#[test]
fn nothing_is_written_to_a_port_before_a_bench_of_that_grid_has_named_itself() {
    let folder = folder("port-product");
    for (is_bench, profile, what) in [
        (false, "small", "this-computer is no test bench: its image takes no scans on this line"),
        (true, "reference", "has the grid 100 x 96, which is --profile small"),
    ] {
        let path = device(Profile::Small, is_bench, Some);
        let (output, _) = replay(&folder, "motorway.mcap", &["--port", &path, "--profile", profile, "--to", "1"]);
        assert_eq!(output.status.code(), Some(2));
        let printed = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(printed.contains(what), "{printed}");
        // it still has no configuration
        let read = Command::new(env!("CARGO_BIN_EXE_viewshed")).args(["configure", "--port", &path, "--read"]).output();
        let printed = String::from_utf8_lossy(&read.unwrap().stderr).into_owned();
        assert!(printed.contains("the unit has no configuration"), "{printed}");
    }
}
