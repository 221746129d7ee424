//! What the server refuses, and what it keeps, asked without a browser.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::Duration;

use viewshed_harness::recording::write::RecordingWriter;
use viewshed_harness::recording::{self, ReadOptions};

use crate::server::{SHIPPED, Server, folder, recording};
use crate::skipped::skipped;

/// Two tracks as the page sends them.
const TWO: &str = r#"[{"id":"1","class":"car","points":[[1,80,3],[4,20,3]]},
                      {"id":"b","class":"truck","points":[[2,30,-4],[5,90,-4.5],[6,120,-4]]}]"#;

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stderr, .. } =
        Command::new(env!("CARGO_BIN_EXE_viewshed")).args(["label", "--no-open"]).args(arguments).output().unwrap();
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

fn version(answer: &str) -> String {
    let line = answer.lines().find_map(|line| line.strip_prefix("x-version: ")).expect("a version");
    format!("x-version: {line}")
}

/// Saves tracks as the page does: version of what is there, right to write, tracks.
fn save(server: &Server, writer: &str, version: &str, tracks: &str) -> (u16, String) {
    server.own("PUT", "labels", &[&format!("x-writer: {writer}"), version], tracks)
}

#[test]
fn only_its_own_pages_with_the_token_are_answered() {
    let server = Server::start(&recording("token"));
    let (path, host) = (server.path("labels"), format!("Host: {}", server.host()));
    let get = format!("GET {path} HTTP/1.1");
    assert_eq!(server.ask(&[&get, &host], "").0, 200);
    for lines in [
        vec![get.as_str()],
        vec![&get, "Host: evil.example"],
        vec![&get, "Host: 127.0.0.1:1"],
        vec![&get, &host, &host],
        vec![&get, &host, "Origin: http://evil.example"],
        vec![&get, &host, "Origin: null"],
        vec!["GET / HTTP/1.1", &host],
        vec!["GET /labels HTTP/1.1", &host],
        vec!["GET /00000000000000000000000000000000/labels HTTP/1.1", &host],
        vec!["GET /../labels HTTP/1.1", &host],
    ] {
        let (status, answer) = server.ask(&lines, "");
        assert!(matches!(status, 400 | 403), "{lines:?}: {answer}");
        assert!(!answer.contains("[]"), "{lines:?}: {answer}");
    }
    for origin in ["Origin: http://evil.example", "Origin: null", "X-Nothing: 1"] {
        let (status, answer) = server.ask(&[&format!("PUT {path} HTTP/1.1"), &host, origin], TWO);
        assert_eq!(status, 403, "{answer}");
    }
    assert!(!server.labels.exists());
}

#[test]
fn no_path_leads_out_of_the_program() {
    let server = Server::start(&recording("paths"));
    for path in [
        "assets/../../site.mcap",
        "assets/..%2f..%2fsite.mcap",
        "assets/%2e%2e/site.mcap",
        "assets//etc/passwd",
        "assets/%2fetc%2fpasswd",
        "assets/main.js%00.css",
        "../site.mcap",
        "site.mcap",
        "camera/../labels",
        "visibility/-1",
        "visibility/99999999999999999999",
        "labels/../../site.labels.csv",
    ] {
        let (status, answer) = server.own("GET", path, &[], "");
        assert!(matches!(status, 400 | 404), "{path}: {answer}");
    }
    let (status, answer) = server.own("GET", "assets/main.js", &[], "");
    assert!(status == 200 && answer.contains("text/javascript") && answer.contains("default-src 'self'"), "{answer}");
}

#[test]
fn tracks_are_saved_whole_and_read_back_by_the_next_run() {
    let recording = recording("saved");
    let mut server = Server::start(&recording);
    let (_, read) = server.own("GET", "labels", &[], "");
    let (_stream, writer) = server.hold().unwrap();
    let (status, answer) = save(&server, &writer, &version(&read), TWO);
    assert_eq!(status, 200, "{answer}");
    server.kill();
    let again = Server::start(&recording);
    let (_, read) = again.own("GET", "labels", &[], "");
    assert!(read.contains(r#""id":"1""#) && read.contains("[6.0,120.0,-4.0]"), "{read}");
    let names: Vec<_> = fs::read_dir(recording.parent().unwrap()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
}

#[test]
fn a_crash_while_saving_leaves_whole_labels() {
    let recording = recording("crash");
    let tracks = |n: usize| {
        let track = |k| format!(r#"{{"id":"{k}","class":"car","points":[[1,80,{k}],[{n}.5,20,{k}]]}}"#);
        format!("[{}]", (0..40).map(track).collect::<Vec<_>>().join(","))
    };
    for pause_ms in [0, 3, 10, 25] {
        let mut server = Server::start(&recording);
        let (_, read) = server.own("GET", "labels", &[], "");
        let (_stream, writer) = server.hold().unwrap();
        let mut at = version(&read);
        let mut saved = 0;
        for n in 2..6 {
            let (status, answer) = save(&server, &writer, &at, &tracks(n));
            assert_eq!(status, 200, "{answer}");
            (at, saved) = (version(&answer), n);
        }
        // one more, and a crash in its middle
        let mut stream = std::net::TcpStream::connect(server.host()).unwrap();
        let (path, host, body) = (server.path("labels"), server.host(), tracks(8));
        let head =
            format!("PUT {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nx-writer: {writer}\r\n{at}\r\n");
        std::io::Write::write_all(
            &mut stream,
            format!("{head}Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes(),
        )
        .unwrap();
        sleep(Duration::from_millis(pause_ms));
        server.kill();
        let again = Server::start(&recording);
        let (status, read) = again.own("GET", "labels", &[], "");
        assert_eq!(status, 200, "{read}");
        let whole = |n: usize| read.matches(&format!("[{n}.5,20.0")).count() == 40;
        assert!(whole(saved) || whole(8), "{read}");
    }
}

#[test]
fn one_page_writes_and_its_end_gives_the_right_back() {
    let server = Server::start(&recording("writer"));
    let (_, read) = server.own("GET", "labels", &[], "");
    let (stream, first) = server.hold().unwrap();
    assert!(server.hold().is_none());
    for stranger in ["0", "7", "", "x"] {
        let (status, answer) = save(&server, stranger, &version(&read), TWO);
        assert!(status == 409 && answer.contains("another page writes"), "{answer}");
    }
    drop(stream);
    let second = (0..50).find_map(|_| {
        sleep(Duration::from_millis(20));
        server.hold()
    });
    let (_stream, second) = second.expect("the right to write");
    let (status, answer) = save(&server, &first, &version(&read), TWO);
    assert_eq!(status, 409, "{answer}");
    assert_eq!(save(&server, &second, &version(&read), TWO).0, 200);
    // what the first page still had is of an older version
    let (status, answer) = save(&server, &second, &version(&read), "[]");
    assert!(status == 409 && answer.contains("was changed by another page or program"), "{answer}");
}

#[test]
fn a_second_program_is_refused() {
    let recording = recording("second");
    let _server = Server::start(&recording);
    let (code, error) = run(&[recording.to_str().unwrap()]);
    assert!(code == Some(2) && error.contains("another viewshed label has"), "{error}");
}

#[test]
fn labels_that_another_program_changed_are_not_replaced() {
    let server = Server::start(&recording("foreign"));
    let (_, read) = server.own("GET", "labels", &[], "");
    let (_stream, writer) = server.hold().unwrap();
    let foreign = "time_s,object_id,class,x_m,y_m\n1,z,car,50,0\n2,z,car,70,0\n";
    fs::write(&server.labels, foreign).unwrap();
    let (status, answer) = save(&server, &writer, &version(&read), TWO);
    assert!(status == 409 && answer.contains("was changed by another page or program"), "{answer}");
    assert_eq!(fs::read_to_string(&server.labels).unwrap(), foreign);
    let (_, read) = server.own("GET", "labels", &[], "");
    assert!(read.contains(r#""id":"z""#), "{read}");
    assert_eq!(save(&server, &writer, &version(&read), TWO).0, 200);
}

#[test]
fn broken_labels_are_named_with_their_line_and_kept() {
    let recording = recording("broken");
    let labels = recording.with_extension("labels.csv");
    let text = "time_s,object_id,class,x_m,y_m\n1,a,car,50,0\n2,a,car,here,0\n";
    fs::write(&labels, text).unwrap();
    let (code, error) = run(&[recording.to_str().unwrap()]);
    assert!(code == Some(2) && error.contains("site.labels.csv, line 3"), "{error}");
    assert_eq!(fs::read_to_string(&labels).unwrap(), text);
    // and while the server runs
    fs::remove_file(&labels).unwrap();
    let server = Server::start(&recording);
    fs::write(&labels, text).unwrap();
    let (status, answer) = server.own("GET", "labels", &[], "");
    assert!(status == 422 && answer.contains("line 3") && answer.contains("left as it is"), "{answer}");
    assert_eq!(fs::read_to_string(&labels).unwrap(), text);
}

#[test]
fn tracks_that_are_none_are_refused_by_name() {
    let server = Server::start(&recording("none"));
    let (_, read) = server.own("GET", "labels", &[], "");
    let (_stream, writer) = server.hold().unwrap();
    for (tracks, why) in [
        (
            r#"[{"id":"1","class":"car","points":[[1,80,3],[4,20,3]]},{"id":"1","class":"car","points":[[1,0,3],[4,20,3]]}]"#,
            "two tracks have the id 1",
        ),
        (r#"[{"id":"a","class":"car","points":[[4,80,3],[1,20,3]]}]"#, "track a, point 2"),
        (r#"[{"id":"a","class":"ship","points":[[1,80,3],[4,20,3]]}]"#, "`ship`"),
        (r#"[{"id":"a","class":"car","points":[[1,80,1e999],[4,20,3]]}]"#, "no tracks"),
        ("[{", "no tracks"),
    ] {
        let (status, answer) = save(&server, &writer, &version(&read), tracks);
        assert!(status == 422 && answer.contains(why), "{tracks}: {answer}");
    }
    assert!(!server.labels.exists());
}

#[test]
fn what_is_no_click_is_refused_by_name_and_where_nothing_is_nothing_is_followed() {
    let server = Server::start(&recording("click"));
    let own = r#"{"id":"1","class":"car","points":[]}"#;
    let ask = |track: &str, click: &str, others: &str| {
        let body = format!(r#"{{"track":{track},"click":{click},"others":{others}}}"#);
        // until the reflections are sorted
        (0..500)
            .map(|_| {
                sleep(Duration::from_millis(20));
                server.own("POST", "follow", &[], &body)
            })
            .find(|(status, _)| *status != 202)
            .unwrap()
    };
    for (track, click, others, why) in [
        (own, "[1,80]", "[]", "this is no click"),
        (own, r#""here""#, "[]", "this is no click"),
        (r#"{"id":"a","class":"ship","points":[]}"#, "[1,80,3]", "[]", "`ship`"),
        (r#"{"id":"a","class":"car","points":[[4,80,3],[1,20,3]]}"#, "[1,80,3]", "[]", "track a, point 2"),
        (own, "[1,80,3]", r#"[{"id":"b","class":"car","points":[[4,80,3],[1,20,3]]}]"#, "track b, point 2"),
        (own, "[1,80,3]", r#"[{"id":"b","class":"car","points":[]}]"#, "track b"),
    ] {
        let (status, answer) = ask(track, click, others);
        assert!(status == 422 && answer.contains(why), "{track} {click} {others}: {answer}");
    }
    for nothing in ["[1,-900,3]", "[1,1e300,3]", "[-1e300,80,3]"] {
        assert_eq!(ask(own, nothing, "[]").0, 204, "{nothing}");
    }
    let (status, answer) = server.ask(&["POST /follow HTTP/1.1", &format!("Host: {}", server.host())], "{}");
    assert!(matches!(status, 400 | 403), "{answer}");
    assert!(!server.labels.exists(), "a click saves nothing by itself");
}

#[test]
fn a_full_disk_is_said_and_what_was_saved_stays() {
    let folder = folder("full");
    let mount = |arguments: &[&str]| Command::new(arguments[0]).args(&arguments[1..]).arg(&folder).status();
    // it holds the recording and little more
    if !mount(&["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs"]).is_ok_and(|status| status.success()) {
        skipped("mount", "labels on a full disk: no small file system can be mounted here");
        return;
    }
    let recording = folder.join("site.mcap");
    fs::copy(SHIPPED, &recording).unwrap();
    let server = Server::start(&recording);
    let (_, read) = server.own("GET", "labels", &[], "");
    let (_stream, writer) = server.hold().unwrap();
    let (status, answer) = save(&server, &writer, &version(&read), TWO);
    assert_eq!(status, 200, "{answer}");
    let before = fs::read(&server.labels).unwrap();
    let filler = folder.join("filler");
    let _ = fs::write(&filler, vec![0; 4 << 20]);
    let many = (0..20).map(|k| format!(r#"{{"id":"{k}","class":"car","points":[[1,80,3],[9,20,3]]}}"#));
    let many = format!("[{}]", many.collect::<Vec<_>>().join(","));
    let (status, error) = save(&server, &writer, &version(&answer), &many);
    let kept = fs::read(&server.labels).unwrap();
    fs::remove_file(&filler).unwrap();
    let (after, _) = save(&server, &writer, &version(&answer), &many);
    drop(server);
    assert!(mount(&["umount"]).unwrap().success());
    assert!(status == 507 && error.contains("No space left"), "{error}");
    assert_eq!(kept, before);
    assert_eq!(after, 200);
}

#[test]
fn a_recording_without_radar_is_an_error() {
    let folder = folder("no-radar");
    let file = folder.join("empty.mcap");
    fs::write(&file, "nothing").unwrap();
    let (code, error) = run(&[file.to_str().unwrap()]);
    assert!(code == Some(2) && error.contains("empty.mcap"), "{error}");
    let recording = recording::read(Path::new(SHIPPED), &ReadOptions::default()).unwrap();
    let silent = File::create(folder.join("silent.mcap")).unwrap();
    RecordingWriter::new(silent, &recording.sensor, &recording.pose, 0).unwrap().finish().unwrap();
    let (code, error) = run(&[folder.join("silent.mcap").to_str().unwrap()]);
    assert!(code == Some(2) && error.contains("silent.mcap") && error.contains("/radar/points"), "{error}");
    let (code, error) = run(&[folder.join("absent.mcap").to_str().unwrap()]);
    assert!(code == Some(2) && error.contains("absent.mcap"), "{error}");
}
