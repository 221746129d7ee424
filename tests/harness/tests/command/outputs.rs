//! Files out of every command: never over what it reads, over other files when asked to, whole or not at all.

use std::path::Path;
#[cfg(target_os = "linux")]
use std::process::Command;

use crate::scene::{Scene, folder, replay, stderr, stdout, viewshed};

const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");
const SIMULATED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.toml");
const LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/ars408-made-up.log");
const PLAN: &str = "scene = \"s.toml\"\nduration_s = 2.0\n[training]\nfcd = \"u.xml\"\nseed = 1\n\
                    [[reporting]]\nfcd = \"t.xml\"\nseed = 2\n";
const SCENE: &str = "name = \"s\"\nduration_s = 2.0\n[traffic]\nfcd = \"t.xml\"\n[radar]\nname = \"r\"\nrate_hz = 15.0\n\
                     mount = { height_m = 6.0 }\nfield_of_view = { azimuth_deg = [-60.0, 60.0], \
                     elevation_deg = [-16.0, 16.0], range_m = [3.0, 200.0] }\n";

/// A car on its way.
fn traffic() -> String {
    let step = |k: u32| {
        let (time, x) = (0.5 * f64::from(k), 60 + 10 * k);
        format!("<timestep time=\"{time}\"><vehicle id=\"a\" x=\"{x}\" y=\"0\" angle=\"90\" type=\"car\"/></timestep>")
    };
    format!("<fcd-export>{}</fcd-export>", (0..8).map(step).collect::<String>())
}

/// A folder with something for every command to read.
fn prepared(test: &str) -> std::path::PathBuf {
    let folder = folder(test);
    Scene::default().save(&folder, "a");
    std::fs::copy(LOG, folder.join("a.log")).unwrap();
    let key = "000102030405060708090a0b0c0d0e0f";
    for (name, text) in [
        ("s.toml", SCENE),
        ("t.xml", &traffic()),
        ("u.xml", &traffic()),
        ("p.toml", PLAN),
        ("key", key),
        ("c.toml", "[evaluation]\n"),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let rows = "0.0,7,car,48,7\n2.8,7,car,81.6,7\n";
    std::fs::write(folder.join("a.labels.csv"), format!("time_s,object_id,class,x_m,y_m\n{rows}")).unwrap();
    folder
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn no_command_destroys_what_it_reads() {
    let folder = prepared("destroy");
    std::os::unix::fs::symlink("a.mcap", folder.join("soft")).unwrap();
    std::fs::hard_link(folder.join("a.mcap"), folder.join("hard")).unwrap();
    let all = names(&folder);
    let before: Vec<Vec<u8>> = all.iter().map(|name| std::fs::read(folder.join(name)).unwrap()).collect();
    for (arguments, output) in [
        ("replay a.mcap --csv a.mcap", "--csv"),
        ("replay a.mcap --json soft", "--json"),
        ("replay a.mcap --mcap hard", "--mcap"),
        ("replay a.mcap --csv ./../destroy/a.labels.csv", "--csv"),
        ("replay a.mcap --config c.toml --json c.toml", "--json"),
        ("replay soft --mcap a.mcap", "--mcap"),
        ("bus a.mcap --log a.mcap", "--log"),
        ("bus a.mcap --json a.mcap", "--json"),
        ("bus a.mcap --key-file key --bus fd-500k-2M --log key", "--log"),
        ("listen a.log --json a.log", "--json"),
        ("listen a.log --key-file key --json key", "--json"),
        ("doctor a.log --json a.log", "--json"),
        ("doctor a.log --detections a.log", "--detections"),
        ("simulate s.toml --out s.toml", "--out"),
        ("simulate s.toml --out t.xml", "--out"),
        ("simulate s.toml --fcd a.log --out a.log", "--out"),
        ("simulate s.toml --out r.mcap --json t.xml", "--json"),
        ("experiment p.toml --json p.toml", "--json"),
        ("experiment p.toml --json s.toml", "--json"),
        ("experiment p.toml --beside a.mcap --json a.mcap", "--json"),
        ("site s.toml --out s.toml", "--out"),
        ("site s.toml --json t.xml", "--json"),
        ("detections a.mcap --out a.mcap", "--out"),
        ("detections --real a.mcap --json a.labels.csv", "--json"),
    ] {
        let output_of = viewshed(&folder, &format!("{arguments} --force"));
        let text = stderr(&output_of);
        assert_eq!(output_of.status.code(), Some(2), "{arguments}: {text}");
        assert!(text.contains(&format!("error: {output} ")) && text.contains("which is read"), "{arguments}: {text}");
        let now: Vec<Vec<u8>> = all.iter().map(|name| std::fs::read(folder.join(name)).unwrap()).collect();
        assert!(now == before && names(&folder) == all, "{arguments}: {:?}", names(&folder));
    }
}

#[test]
fn a_recording_in_the_folder_of_pictures_is_not_drawn_over() {
    let folder = folder("drawn_over");
    std::fs::create_dir(folder.join("o")).unwrap();
    std::fs::copy(Scene::default().save(&folder, "a"), folder.join("o/tradeoff-cells.png")).unwrap();
    let output = replay(&folder, &["o/tradeoff-cells.png", "--bootstrap", "0", "--out", "o"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert_eq!(
        std::fs::read(folder.join("o/tradeoff-cells.png")).unwrap(),
        std::fs::read(folder.join("a.mcap")).unwrap()
    );
}

#[test]
fn what_exists_is_replaced_when_that_is_asked_for_only() {
    let folder = prepared("replace");
    for (arguments, written) in [
        ("replay a.mcap --bootstrap 0 --json out", "{"),
        ("replay a.mcap --bootstrap 0 --csv out", "recording,"),
        ("replay a.mcap --bootstrap 0 --mcap out", "\u{89}MCAP"),
        ("bus a.mcap --log out", "("),
        ("doctor a.log --json out", "{"),
        ("doctor a.log --sensor-id 0 --detections out", "scan,"),
        ("simulate s.toml --out out", "\u{89}MCAP"),
        ("simulate s.toml --out new.mcap --json out", "{"),
        ("site s.toml --yaw 0 --pitch 4 --sensors 1 --out out", "\u{89}PNG"),
        ("site s.toml --yaw 0 --pitch 4 --sensors 1 --json out", "{"),
        ("detections new.mcap --out out", "\u{89}PNG"),
        ("detections new.mcap --json out", "{"),
        ("experiment p.toml --bootstrap 0 --json out", "{"),
    ] {
        std::fs::write(folder.join("out"), "before").unwrap();
        let refused = viewshed(&folder, arguments);
        assert_eq!(refused.status.code(), Some(2), "{arguments}");
        assert!(stderr(&refused).contains("out exists; add --force"), "{arguments}: {}", stderr(&refused));
        assert_eq!(std::fs::read(folder.join("out")).unwrap(), b"before", "{arguments}");
        let forced = viewshed(&folder, &format!("{arguments} --force"));
        assert!(stdout(&forced).lines().any(|line| line == "wrote out"), "{arguments}: {}", stdout(&forced));
        assert!(matches!(forced.status.code(), Some(0 | 1)), "{arguments}: {}", stderr(&forced));
        let bytes = std::fs::read(folder.join("out")).unwrap();
        let begins: Vec<u8> = written.chars().map(|c| c as u8).collect();
        assert!(bytes.starts_with(&begins), "{arguments}: {:?}", String::from_utf8_lossy(&bytes[..20]));
        assert!(names(&folder).iter().all(|name| !name.contains("part")), "{arguments}: {:?}", names(&folder));
    }
}

#[test]
fn a_place_for_results_that_is_none_is_found_before_anything_is_read() {
    let folder = prepared("no_place");
    let all = names(&folder);
    for arguments in [
        "replay broken.mcap --out key/maps",
        "replay broken.mcap --json no/r.json",
        "replay broken.mcap --csv no/r.csv",
        "bus broken.mcap --log no/b.log",
        "listen broken.log --out key/maps",
        "listen broken.log --json no/r.json",
        "doctor broken.log --json no/r.json",
        "simulate s.toml --out no/r.mcap",
        "site s.toml --out no/s.png",
        "detections broken.mcap --json no/r.json",
    ] {
        let output = viewshed(&folder, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        let text = stderr(&output);
        assert!(text.contains("there is no folder no") || text.contains("key is a file"), "{arguments}: {text}");
    }
    for arguments in ["site s.toml --out map.jpg", "detections a.mcap --out map.jpg"] {
        let text = stderr(&viewshed(&folder, arguments));
        assert!(text.contains("pictures are PNG; name it map.png"), "{arguments}: {text}");
    }
    assert_eq!(names(&folder), all);
}

/// `-` is standard input elsewhere; a file of that name is what nobody wants.
#[test]
fn a_dash_is_no_file_to_write() {
    let folder = prepared("dash");
    let all = names(&folder);
    for (arguments, says) in [
        ("replay a.mcap --bootstrap 0 --json -", "--json /dev/stdout"),
        ("replay a.mcap --bootstrap 0 --out -", "--out ./-"),
        ("bus a.mcap --json -", "--json /dev/stdout"),
        ("bus a.mcap --log -", "--log ./-"),
        ("simulate s.toml --out -", "--out /dev/stdout"),
        ("detections a.mcap --out -", "--out ./-"),
    ] {
        let output = viewshed(&folder, arguments);
        assert!(output.status.code() == Some(2) && stderr(&output).contains(says), "{arguments}: {}", stderr(&output));
    }
    assert_eq!(names(&folder), all);
    assert!(viewshed(&folder, "bus a.mcap --log ./-").status.success());
    assert!(folder.join("-").is_file());
}

#[test]
fn the_main_job_runs_twice() {
    let folder = folder("twice");
    Scene::default().save(&folder, "a");
    for time in ["first", "second"] {
        let output = replay(&folder, &["a.mcap", "--bootstrap", "0", "--out", "out"]);
        assert!(output.status.success(), "{time} time: {}", stderr(&output));
        let files = std::fs::read_dir(folder.join("out")).unwrap().count();
        assert!(stdout(&output).ends_with(&format!("wrote {files} files into out\n")), "{}", stdout(&output));
        assert!(std::fs::metadata(folder.join("out/tradeoff-cells.png")).unwrap().len() > 1000);
    }
}

#[test]
fn an_error_half_way_leaves_nothing() {
    let folder = folder("half_way");
    Scene::default().save(&folder, "a");
    let output = replay(&folder, &["a.mcap", "--mcap", "m.mcap", "--mcap-estimator", "lidar", "--csv", "r.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(names(&folder), ["a.mcap"]);
    let output = replay(&folder, &["absent.mcap", "--csv", "r.csv", "--json", "r.json", "--out", "o"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(names(&folder), ["a.mcap"]);
}

/// Commands in a text: lines that are indented by four, and what stands between backticks.
fn commands(text: &str) -> Vec<String> {
    let code = text.lines().filter_map(|line| line.strip_prefix("    ")).map(str::to_owned);
    let quoted = text.split('`').skip(1).step_by(2).map(|quoted| quoted.replace('\n', " "));
    let command = |code: String| {
        let code = code.split(" # ").next().unwrap_or_default().split(" > ").next().unwrap_or_default().trim();
        let replay = code.strip_prefix("tests/replay.sh ").map(|rest| format!("replay {rest}"));
        // a variable of two words is one word in zsh and fish
        assert!(!code.starts_with('$'), "{code}");
        let rest = code.strip_prefix("viewshed ").map(str::to_owned);
        replay.or(rest).filter(|rest| rest.contains(' ') && !rest.starts_with('='))
    };
    code.chain(quoted).filter_map(command).collect()
}

/// What links call a page's headings: their letters in lower case, and a dash for each space.
fn anchors(page: &str) -> Vec<String> {
    let outside_code = page.split("```").step_by(2).flat_map(str::lines);
    let heading = |line: &str| line.strip_prefix('#').map(|rest| rest.trim_start_matches('#').trim().to_lowercase());
    let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let anchor = |heading: String| heading.chars().filter(kept).map(|c| if c == ' ' { '-' } else { c }).collect();
    outside_code.filter_map(heading).map(anchor).collect()
}

#[test]
fn links_between_pages_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let (mut folders, mut links) = (vec![root.clone()], 0);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && name != "target" && !name.starts_with('.') {
                folders.push(path);
            } else if name.ends_with(".md") {
                let text = std::fs::read_to_string(&path).unwrap();
                for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
                    let (file, heading) = link.split_once('#').unwrap_or((link, ""));
                    if link.contains("::") || link.contains("://") || link.contains(char::is_whitespace) {
                        continue;
                    }
                    links += 1;
                    let page = if file.is_empty() { path.clone() } else { folder.join(file) };
                    assert!(page.exists(), "{}: {link}", path.display());
                    let is_page = page.extension().is_some_and(|extension| extension == "md");
                    if !heading.is_empty() && is_page {
                        let anchors = anchors(&std::fs::read_to_string(&page).unwrap());
                        assert!(anchors.iter().any(|a| a == heading), "{}: {link}, of {anchors:?}", path.display());
                    }
                }
            }
        }
    }
    assert!(links > 30, "{links}");
}

#[test]
fn the_commands_that_are_written_down_are_understood_and_run_twice() {
    use clap::Parser;

    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |name: &str| std::fs::read_to_string(root.join(name)).unwrap();
    let pages = [
        "README.md",
        "boards/README.md",
        "src/README.md",
        "src/inputs/README.md",
        "src/wire/README.md",
        "tests/GUIDE.md",
        "tests/harness/src/evaluation/README.md",
        "tests/harness/src/twin/README.md",
        "tests/recordings/README.md",
    ];
    let all: Vec<String> = pages.iter().flat_map(|name| commands(&read(name))).collect();
    assert!(all.len() >= 20, "{all:?}");
    for command in &all {
        let words = ["viewshed"].into_iter().chain(command.split_whitespace());
        if let Err(error) = viewshed_harness::command::Cli::try_parse_from(words) {
            assert_eq!(error.kind(), clap::error::ErrorKind::DisplayHelp, "{command}: {error}");
        }
        let pictures = ["replay", "listen"].iter().any(|name| command.starts_with(name));
        let names_a_file = ["--json ", "--csv ", "--mcap ", "--report ", "--log ", "--detections ", "--keep "];
        let names_a_file =
            names_a_file.iter().any(|o| command.contains(o)) || (!pictures && command.contains("--out "));
        assert_eq!(command.contains("--force"), names_a_file, "{command}");
    }
}

/// Ends a command by a signal as soon as it has begun to write. One that was over before the signal came, as on a busy
/// machine, is begun anew.
#[cfg(target_os = "linux")]
fn ended(folder: &Path, arguments: &str, signal: rustix::process::Signal) {
    use std::os::unix::process::ExitStatusExt;

    let before: Vec<_> =
        names(folder).into_iter().map(|name| folder.join(name)).filter(|path| path.is_file()).collect();
    let before: Vec<_> = before.into_iter().map(|path| (std::fs::read(&path).unwrap(), path)).collect();
    for time in 0..20 {
        // what is written in one go is not always seen: then the signal comes before it
        let status = signalled(folder, arguments, signal, time < 5);
        if !status.success() {
            assert_eq!(status.signal(), Some(signal.as_raw()), "{arguments}: {status}");
            return;
        }
        for name in names(folder) {
            let path = folder.join(name);
            if path.is_file() {
                std::fs::remove_file(path).unwrap();
            }
        }
        before.iter().for_each(|(bytes, path)| std::fs::write(path, bytes).unwrap());
    }
    panic!("{arguments}: was over before the signal came, twenty times");
}

#[cfg(target_os = "linux")]
fn signalled(
    folder: &Path,
    arguments: &str,
    signal: rustix::process::Signal,
    while_writing: bool,
) -> std::process::ExitStatus {
    use std::time::{Duration, Instant};

    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    let mut child = command.current_dir(folder).args(arguments.split_whitespace()).spawn().unwrap();
    let started = Instant::now();
    std::thread::sleep(Duration::from_millis(if while_writing { 0 } else { 50 }));
    while while_writing && !names(folder).iter().any(|name| name.ends_with(".part")) {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{arguments}: nothing is written");
        std::thread::sleep(Duration::from_millis(1));
    }
    rustix::process::kill_process(rustix::process::Pid::from_child(&child), signal).unwrap();
    child.wait().unwrap()
}

#[cfg(target_os = "linux")]
fn is_ignored(signal: rustix::process::Signal) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    let mask = u64::from_str_radix(mask.trim(), 16).unwrap();
    mask & (1 << (signal.as_raw() - 1)) != 0
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_leaves_nothing_half_written() {
    use rustix::process::Signal;

    let folder = prepared("ctrl_c");
    let all = names(&folder);
    // a shell has its background jobs ignore Ctrl-C, `nohup` a line that hangs up, and what they start inherits that
    let unless_ignored = |signal| if is_ignored(signal) { Signal::TERM } else { signal };
    ended(&folder, &format!("simulate {SIMULATED} --out r.mcap"), unless_ignored(Signal::INT));
    assert_eq!(names(&folder), all);
    ended(&folder, &format!("replay {RECORDING} --csv r.csv --json r.json"), Signal::TERM);
    assert_eq!(names(&folder), all);
    ended(&folder, &format!("simulate {SIMULATED} --out r.mcap"), unless_ignored(Signal::HUP));
    assert_eq!(names(&folder), all);
    // and what was there before is there still
    std::fs::write(folder.join("r.mcap"), "before").unwrap();
    ended(&folder, &format!("simulate {SIMULATED} --out r.mcap --force"), Signal::TERM);
    assert_eq!(std::fs::read(folder.join("r.mcap")).unwrap(), b"before");
    assert_eq!(names(&folder).len(), all.len() + 1);
}
