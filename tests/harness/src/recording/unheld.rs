//! Scans of a CAN log that are not held in memory: the log is read and decoded again whenever they are asked for.

use std::cell::Cell;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::{Result, bail};
use viewshed::fixed::time::Time;
use viewshed::inputs::RadarScan;
use viewshed::inputs::ars408::{Ars408Config, Ars408Counters};

use super::ars408_feed::Feed;
use super::can_log::Line;
use super::can_log::log::Log;
use super::frames::{Correction, Extent, Frames, Survey, Wanted};
use super::{Frame, Recording, capture};

/// Entries of a scan that are kept; clones announce more than 255.
const MOST_ENTRIES: usize = 1024;

/// Scans that are decoded and shown at once.
pub const PART: usize = 2048;

/// Scans of a log that are held at once for what takes them all: those of five hours.
pub const MOST_HELD: usize = 250_000;

/// The scans of one sensor in a log.
pub struct Scans {
    log: Log,
    interface: String,
    config: Ars408Config,
    part: usize,
    corrections: Vec<Correction>,
    wanted: Wanted,
    survey: Survey,
    extent: Extent,
    /// Those that were asked for by their number.
    shown: Vec<(usize, Frame)>,
}

impl Scans {
    /// Those of a log, by so many at once.
    pub fn new(log: Log, interface: &str, config: Ars408Config, part: usize) -> Self {
        Self {
            log,
            interface: interface.to_owned(),
            config,
            part: part.max(1),
            corrections: Vec::new(),
            wanted: Wanted::default(),
            survey: Survey::default(),
            extent: Extent::default(),
            shown: Vec::new(),
        }
    }

    /// Decodes all of the log: `line` is given every frame of the bus, `scan` all that comes of them, until it has seen
    /// enough.
    pub fn decode(
        &self,
        line: &mut dyn FnMut(&Line),
        scan: &mut dyn FnMut(Frame) -> ControlFlow<()>,
    ) -> Ars408Counters {
        let mut feed = Feed::<MOST_ENTRIES>::new(self.config);
        let flow = Cell::new(ControlFlow::Continue(()));
        let mut take = |s: &RadarScan<'_>| {
            if flow.get().is_continue() {
                flow.set(scan(frame(s)));
            }
        };
        self.log.until(&mut |of_bus| {
            if of_bus.interface == self.interface {
                line(of_bus);
                feed.push(of_bus, &mut take);
            }
            flow.get()
        });
        feed.end(&mut take);
        *feed.radar.counters()
    }

    /// Keeps what was said of all of them.
    pub fn surveyed(&mut self, survey: Survey) {
        self.extent = survey.extent;
        self.survey = survey;
    }

    /// How much there is of those that are wanted.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Keeps some by their numbers.
    pub fn keep(&mut self, numbers: &[usize]) {
        let (mut k, mut shown) = (0, Vec::new());
        let end = numbers.iter().max().map_or(0, |last| last + 1);
        self.parts(&mut |part| {
            for frame in part {
                if numbers.contains(&k) {
                    shown.push((k, frame.clone()));
                }
                k += 1;
            }
            if k < end { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        self.shown = shown;
    }

    /// One of those that are kept.
    pub fn kept(&self, number: usize) -> Option<&Frame> {
        self.shown.iter().find(|(k, _)| *k == number).map(|(_, frame)| frame)
    }
}

impl Frames for Scans {
    fn parts(&self, see: &mut dyn FnMut(&[Frame]) -> ControlFlow<()>) {
        let (mut part, mut flow) = (Vec::new(), ControlFlow::Continue(()));
        self.decode(&mut |_| {}, &mut |mut frame| {
            if self.wanted.has(frame.time_ns) {
                self.corrections.iter().for_each(|correction| correction.apply(&mut frame));
                part.push(frame);
            }
            if part.len() == self.part {
                flow = see(&part);
                part.clear();
            }
            flow
        });
        if flow.is_continue() && !part.is_empty() {
            let _ = see(&part);
        }
    }

    fn survey(&self) -> Survey {
        self.survey.clone()
    }

    fn correct(&mut self, correction: Correction) {
        self.corrections.push(correction);
    }

    fn cut(&mut self, wanted: Wanted, left: Extent) {
        (self.wanted, self.extent) = (wanted, left);
    }
}

impl fmt::Debug for Scans {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} scans on {}", self.extent.frames, self.interface)
    }
}

impl Recording {
    /// All frames, held or not.
    pub fn all(&self) -> &dyn Frames {
        match &self.scans {
            Some(scans) => &**scans,
            None => &self.frames,
        }
    }

    /// How much there is of it.
    pub fn extent(&self) -> Extent {
        self.scans.as_ref().map_or_else(|| Extent::of(&self.frames), |scans| scans.extent())
    }

    /// How many frames there are.
    pub fn count(&self) -> usize {
        self.scans.as_ref().map_or(self.frames.len(), |scans| scans.extent().frames)
    }

    /// Time of the first frame.
    pub fn start_ns(&self) -> i64 {
        self.scans.as_ref().map_or_else(|| self.frames.first().map_or(0, |f| f.time_ns), |s| s.extent().first_ns)
    }

    pub fn duration_s(&self) -> f64 {
        let end_ns =
            self.scans.as_ref().map_or_else(|| self.frames.last().map_or(0, |f| f.time_ns), |s| s.extent().last_ns);
        end_ns.saturating_sub(self.start_ns()) as f64 * 1e-9
    }

    /// A frame by its number; of frames that are not held, one of those that were [asked for](Self::keep).
    pub fn frame(&self, number: usize) -> Option<&Frame> {
        match &self.scans {
            Some(scans) => scans.kept(number),
            None => self.frames.get(number),
        }
    }

    /// Keeps these of the frames that are not held.
    pub fn keep(&mut self, numbers: &[usize]) {
        if let Some(scans) = self.scans.as_mut().and_then(Arc::get_mut) {
            scans.keep(numbers);
        }
    }

    /// Holds all frames, so many at most, for what takes them all at once.
    ///
    /// # Errors
    /// There are too many.
    pub fn hold(mut self, what: &str, most: usize) -> Result<Self> {
        let Some(scans) = self.scans.take() else { return Ok(self) };
        let frames = scans.extent().frames;
        if frames > most {
            bail!(
                "{}: {what} takes all scans at once, and of its {frames} at most {most} can be: choose a part with --from and --to",
                self.name
            );
        }
        self.frames.reserve(frames);
        scans.each(&mut |frame| self.frames.push(frame.clone()));
        Ok(self)
    }
}

fn frame(scan: &RadarScan<'_>) -> Frame {
    Frame {
        time_ns: nanoseconds(scan.time),
        detections: scan.detections.iter().map(capture::detection).collect(),
        refused: scan.refused.into(),
        unwanted: scan.unwanted().iter().map(capture::detection).collect(),
        fault: scan.fault,
    }
}

fn nanoseconds(time: Time) -> i64 {
    i64::try_from(time.micros()).unwrap_or(i64::MAX).saturating_mul(1000)
}
