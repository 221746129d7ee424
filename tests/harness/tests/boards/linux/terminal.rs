//! The far end of a serial port: a pseudo-terminal under a name that stays when it is unplugged.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// The far end; dropping it unplugs the port.
pub struct Terminal {
    far: File,
}

impl Terminal {
    /// Plugs it in under a name.
    pub fn plug(name: &Path) -> Self {
        let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&far).unwrap();
        unlockpt(&far).unwrap();
        let near = ptsname(&far, Vec::new()).unwrap().into_string().unwrap();
        rustix::fs::fcntl_setfl(&far, rustix::fs::OFlags::NONBLOCK).unwrap();
        let _ = std::fs::remove_file(name);
        std::os::unix::fs::symlink(near, name).unwrap();
        Self { far: File::from(far) }
    }

    pub fn send(&mut self, mut bytes: &[u8]) {
        let started = Instant::now();
        while !bytes.is_empty() {
            match self.far.write(bytes) {
                Ok(n) => bytes = &bytes[n..],
                Err(e) if e.kind() == ErrorKind::WouldBlock => thread::sleep(Duration::from_millis(1)),
                Err(e) => panic!("the terminal takes nothing: {e}"),
            }
            assert!(started.elapsed() < Duration::from_secs(60), "the terminal takes nothing");
        }
    }
}

/// What came, and when.
type Chunks = Vec<(Duration, Vec<u8>)>;

/// Hears what a port sends, with the time of each chunk, until it is unplugged by dropping this.
pub struct Ear {
    heard: Arc<Mutex<Chunks>>,
    gone: Arc<Mutex<bool>>,
    thread: Option<thread::JoinHandle<()>>,
}

impl Ear {
    pub fn plug(name: &Path, since: Instant) -> Self {
        let mut terminal = Terminal::plug(name);
        let (heard, gone) = (Arc::new(Mutex::new(Chunks::new())), Arc::new(Mutex::new(false)));
        let (to, end) = (heard.clone(), gone.clone());
        let thread = thread::spawn(move || {
            let mut buffer = [0; 4096];
            while !*end.lock().unwrap() {
                match terminal.far.read(&mut buffer) {
                    Ok(n) if n > 0 => to.lock().unwrap().push((since.elapsed(), buffer[..n].to_vec())),
                    // nobody has opened the port yet, or nothing comes
                    _ => thread::sleep(Duration::from_millis(1)),
                }
            }
        });
        Self { heard, gone, thread: Some(thread) }
    }

    /// Everything so far.
    pub fn heard(&self) -> Chunks {
        self.heard.lock().unwrap().clone()
    }

    /// Everything so far, as one.
    pub fn bytes(&self) -> Vec<u8> {
        self.heard().into_iter().flat_map(|(_, bytes)| bytes).collect()
    }

    /// Waits for so many bytes, and that nothing follows.
    pub fn wait_for(&self, bytes: usize) {
        let started = Instant::now();
        while self.bytes().len() < bytes && started.elapsed() < Duration::from_secs(30) {
            thread::sleep(Duration::from_millis(5));
        }
        thread::sleep(Duration::from_millis(50));
    }
}

impl Drop for Ear {
    fn drop(&mut self) {
        *self.gone.lock().unwrap() = true;
        let _ = self.thread.take().map(thread::JoinHandle::join);
    }
}
