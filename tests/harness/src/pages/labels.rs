//! The labels of one recording while a person draws: read, kept by one writer at a time, saved whole.
//!
//! One page may write. It holds the right to as long as its connection stands: a closed or crashed tab gives it back,
//! and so does the end of the program. A file that another program has changed since is never replaced.

use std::convert::Infallible;
use std::fs::File;
use std::path::Path;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context as Waker, Poll};

use anyhow::{Context, Result};
use axum::body::{Body, Bytes};
use http_body::Frame;
use serde::Serialize;
use thiserror::Error;

use super::locked;
use crate::labels::near_face::BoxStep;
use crate::labels::tracks::{LabelTrack, TrackError, check_all};
use crate::labels::{Site, file, near_face};
use crate::results::files::Target;

/// Why labels are not saved. What was drawn stays in the page.
#[derive(Debug, Error)]
pub enum NotSaved {
    #[error("another page writes these labels; close it, or this page's changes are not saved")]
    AnotherPage,
    #[error(
        "{0} was changed by another page or program since this page read it, and is not replaced; reload this page to \
         go on with what it holds now"
    )]
    Changed(String),
    #[error(transparent)]
    Track(#[from] TrackError),
    #[error("not saved: {0:#}; what you drew stays in this page, which tries again")]
    File(anyhow::Error),
}

/// The labels of a recording, and who may write them.
pub struct Labels {
    target: Target,
    site: Site,
    writer: Arc<Writer>,
    known: Mutex<Known>,
    /// Keeps other programs of this kind away from the recording.
    _lock: File,
}

/// The file as it was read or written last.
#[derive(Default)]
struct Known {
    /// Grows with every other content.
    version: u64,
    /// `None` if there was no file.
    bytes: Option<Vec<u8>>,
}

/// The page that may write, by number.
#[derive(Default)]
struct Writer(Mutex<(Option<u64>, u64)>);

/// Where a track's box is over time.
#[derive(Serialize)]
pub struct TrackBoxes {
    id: String,
    size_m: [f64; 3],
    steps: Vec<BoxStep>,
}

impl Known {
    fn set(&mut self, bytes: Option<Vec<u8>>) {
        if bytes != self.bytes || self.version == 0 {
            self.version += 1;
            self.bytes = bytes;
        }
    }
}

impl Labels {
    /// # Errors
    /// Another program labels this recording.
    pub fn new(recording: &Path, target: Target, site: Site) -> Result<Self> {
        let lock = File::open(recording).with_context(|| format!("cannot read {}", recording.display()))?;
        #[cfg(unix)]
        rustix::fs::flock(&lock, rustix::fs::FlockOperation::NonBlockingLockExclusive)
            .with_context(|| format!("another viewshed label has {} open; stop it first", recording.display()))?;
        Ok(Self { target, site, writer: Arc::default(), known: Mutex::default(), _lock: lock })
    }

    /// Reads the file, and says which version it is; none is no labels.
    ///
    /// # Errors
    /// It is broken; names the line.
    pub fn read(&self) -> Result<(u64, Vec<LabelTrack>)> {
        let path = self.target.path();
        let bytes = self.on_disk()?;
        let tracks = match bytes {
            None => Vec::new(),
            Some(_) => file::read(path, &self.site)
                .with_context(|| format!("{} is left as it is; mend it or move it away", path.display()))?,
        };
        let mut known = locked(&self.known);
        known.set(bytes);
        Ok((known.version, tracks))
    }

    /// Replaces the file and says which version it is now. `version` is the one the page has.
    ///
    /// # Errors
    /// The file is what it was before; says why.
    pub fn save(&self, writer: u64, version: u64, tracks: &[LabelTrack]) -> Result<u64, NotSaved> {
        if locked(&self.writer.0).0 != Some(writer) {
            return Err(NotSaved::AnotherPage);
        }
        check_all(tracks)?;
        let text = file::text(tracks, &self.site).map_err(NotSaved::File)?.into_bytes();
        let mut known = locked(&self.known);
        if known.version != version || self.on_disk().map_err(NotSaved::File)? != known.bytes {
            return Err(NotSaved::Changed(self.target.path().display().to_string()));
        }
        self.target.write(&text).map_err(NotSaved::File)?;
        known.set(Some(text));
        Ok(known.version)
    }

    /// The boxes that stand behind tracks.
    pub fn boxes(&self, tracks: &[LabelTrack]) -> Vec<TrackBoxes> {
        let of = |track: &LabelTrack| TrackBoxes {
            id: track.id.clone(),
            size_m: track.size(),
            steps: near_face::boxes(track, self.site.sensor),
        };
        tracks.iter().map(of).collect()
    }

    fn on_disk(&self) -> Result<Option<Vec<u8>>> {
        match std::fs::read(self.target.path()) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(e).with_context(|| format!("cannot read {}", self.target.path().display())),
        }
    }

    /// Makes the asking page the writer for as long as it holds the answer; `None` if another is.
    ///
    /// The answer is the writer's number and a line's end; it does not end.
    pub fn hold(&self) -> Option<Body> {
        let mut state = locked(&self.writer.0);
        if state.0.is_some() {
            return None;
        }
        state.1 += 1;
        state.0 = Some(state.1);
        let first = Some(Bytes::from(format!("{}\n", state.1)));
        Some(Body::new(Held { writer: self.writer.clone(), first }))
    }
}

/// The right to write, as an answer whose end is never sent. Dropped with the connection.
struct Held {
    writer: Arc<Writer>,
    first: Option<Bytes>,
}

impl http_body::Body for Held {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Waker<'_>) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        match self.first.take() {
            Some(first) => Poll::Ready(Some(Ok(Frame::data(first)))),
            // woken by the end of the connection only
            None => Poll::Pending,
        }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        locked(&self.writer.0).0 = None;
    }
}
