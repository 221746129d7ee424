//! A running `viewshed label`, and requests to it as bytes.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The shipped recording, which is synthetic.
pub const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");

/// A fresh folder for one test.
pub fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("label-{test}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// A copy of the shipped recording in a fresh folder.
pub fn recording(test: &str) -> PathBuf {
    let path = folder(test).join("site.mcap");
    std::fs::copy(SHIPPED, &path).unwrap();
    path
}

pub struct Server {
    child: Child,
    pub url: String,
    pub labels: PathBuf,
}

impl Server {
    /// Labels a recording; its first seconds unless told otherwise.
    pub fn start(recording: &Path) -> Self {
        Self::with(recording, &["--to", "10"])
    }

    pub fn with(recording: &Path, options: &[&str]) -> Self {
        let arguments = [OsStr::new("label"), recording.as_os_str()].into_iter().chain(options.iter().map(OsStr::new));
        let mut server = Self::run(arguments);
        server.labels = recording.with_extension("labels.csv");
        server
    }

    /// Any command that serves pages.
    pub fn run(arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
        command.args(arguments).arg("--no-open");
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let url = lines.find_map(|line| line.ok().filter(|line| line.starts_with("http://"))).expect("an address");
        // whatever else it prints has a reader
        std::thread::spawn(move || lines.for_each(drop));
        Self { child, url, labels: PathBuf::new() }
    }

    /// Ends it as a crash does.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// 127.0.0.1:PORT
    pub fn host(&self) -> &str {
        self.url.trim_start_matches("http://").split('/').next().unwrap()
    }

    /// `/TOKEN/` and a path after it.
    pub fn path(&self, path: &str) -> String {
        format!("/{}/{path}", self.url.trim_end_matches('/').rsplit('/').next().unwrap())
    }

    /// Status and the whole answer to a request of these lines; Host is not added.
    pub fn ask(&self, lines: &[&str], body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        let head = lines.join("\r\n");
        write!(stream, "{head}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}", body.len()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        (answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0), answer)
    }

    /// A request as the page makes it.
    pub fn own(&self, method: &str, path: &str, headers: &[&str], body: &str) -> (u16, String) {
        let first = format!("{method} {} HTTP/1.1", self.path(path));
        let (host, origin) = (format!("Host: {}", self.host()), format!("Origin: http://{}", self.host()));
        self.ask(&[&[first.as_str(), &host, &origin], headers].concat(), body)
    }

    /// The right to write, held as long as the stream lives, and the writer's number.
    pub fn hold(&self) -> Option<(TcpStream, String)> {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        let (path, host) = (self.path("writer"), self.host());
        write!(stream, "POST {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nContent-Length: 0\r\n\r\n")
            .unwrap();
        let mut answer = Vec::new();
        while !answer.ends_with(b"\n\r\n") || answer.iter().filter(|b| **b == b'\n').count() < 4 {
            let mut bytes = [0; 1024];
            let n = stream.read(&mut bytes).unwrap();
            answer.extend(&bytes[..n]);
            if n == 0 || answer.starts_with(b"HTTP/1.1 202") {
                return None;
            }
        }
        let text = String::from_utf8(answer).unwrap();
        let number = text.lines().rfind(|line| !line.is_empty()).unwrap().to_owned();
        Some((stream, number))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
