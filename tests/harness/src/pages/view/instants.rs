//! The instants found so far, for any number of pages at once.
//!
//! One thread adds instants, compressed; pages ask for one by its number, or wait for a newer one than they have.
//! Nothing is kept for a page: one that does not ask, or does not read, costs its connection and no more. The oldest
//! instants go when all of them need too much memory.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::sync::{Arc, Mutex};

use anyhow::{Context, Result};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use serde::Serialize;
use tokio::sync::watch;

use super::instant::{Instant, Remembered, Sample};
use crate::pages::locked;

/// Compressed bytes that are kept.
const MOST_BYTES: usize = 400 << 20;
/// Samples of a source that does not end.
const MOST_SAMPLES: usize = 100_000;

/// Something that happened, to be listed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Event {
    pub time_s: f64,
    pub text: String,
}

/// What is known of all instants.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Overview {
    /// Number of the first sample.
    pub from: usize,
    pub samples: Vec<Sample>,
    pub events: Vec<Event>,
    /// Instants are kept from this number on.
    pub kept_from: usize,
    pub count: usize,
    /// Nothing will be added.
    pub done: bool,
    /// What is being done, or why it ended.
    pub says: String,
}

#[derive(Default)]
struct State {
    kept: VecDeque<Arc<[u8]>>,
    bytes: usize,
    overview: Overview,
}

/// All of them.
pub struct Instants {
    state: Mutex<State>,
    /// How many there were; pages wait on it.
    count: watch::Sender<usize>,
    most_bytes: usize,
}

impl Default for Instants {
    fn default() -> Self {
        Self { state: Mutex::default(), count: watch::Sender::new(0), most_bytes: MOST_BYTES }
    }
}

impl Instants {
    /// Adds an instant and numbers it.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn add(&self, mut instant: Instant) -> Result<()> {
        let number = locked(&self.state).overview.count;
        instant.number = number;
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        serde_json::to_writer(&mut packed, &instant).context("an instant as JSON")?;
        packed.flush()?;
        let packed: Arc<[u8]> = packed.finish()?.into();
        let mut state = locked(&self.state);
        state.bytes += packed.len();
        state.kept.push_back(packed);
        state.overview.samples.push(instant.sample);
        state.overview.count = number + 1;
        while state.bytes > self.most_bytes && state.kept.len() > 1 {
            state.bytes -= state.kept.pop_front().map_or(0, |oldest| oldest.len());
            state.overview.kept_from += 1;
        }
        if state.overview.samples.len() > MOST_SAMPLES {
            let spare = MOST_SAMPLES / 10;
            state.overview.samples.drain(..spare);
            state.overview.from += spare;
        }
        drop(state);
        self.count.send_replace(number + 1);
        Ok(())
    }

    pub fn tell(&self, event: Event) {
        locked(&self.state).overview.events.push(event);
    }

    pub fn say(&self, says: impl Into<String>) {
        locked(&self.state).overview.says = says.into();
    }

    /// Nothing comes any more.
    pub fn end(&self, says: impl Into<String>) {
        let mut state = locked(&self.state);
        state.overview.done = true;
        state.overview.says = says.into();
        drop(state);
        // whoever waits looks again
        self.count.send_modify(|_| ());
    }

    /// What is known, with the samples from a number on.
    pub fn overview(&self, from: usize) -> Overview {
        let state = locked(&self.state);
        let known = &state.overview;
        let skipped = from.saturating_sub(known.from).min(known.samples.len());
        Overview { from: known.from + skipped, samples: known.samples[skipped..].to_vec(), ..known.without_samples() }
    }

    /// An instant as compressed JSON; `None` before the first that is kept and after the last.
    pub fn at(&self, number: usize) -> Option<Arc<[u8]>> {
        let state = locked(&self.state);
        state.kept.get(number.checked_sub(state.overview.kept_from)?).cloned()
    }

    /// Waits until there are more than `after`, and gives the newest; `None` if none will come.
    pub async fn newer(&self, after: usize) -> Option<Arc<[u8]>> {
        let mut count = self.count.subscribe();
        loop {
            let (known, done) = {
                let state = locked(&self.state);
                (state.overview.count, state.overview.done)
            };
            if known > after {
                return self.at(known - 1);
            }
            if done || count.changed().await.is_err() {
                return None;
            }
        }
    }

    /// What a question about a cell needs of an instant.
    pub fn remembered(&self, number: usize) -> Option<Remembered> {
        let packed = self.at(number)?;
        let mut text = Vec::new();
        GzDecoder::new(&packed[..]).read_to_end(&mut text).ok()?;
        serde_json::from_slice(&text).ok()
    }
}

impl Overview {
    fn without_samples(&self) -> Self {
        Self {
            from: self.from,
            samples: Vec::new(),
            events: self.events.clone(),
            kept_from: self.kept_from,
            count: self.count,
            done: self.done,
            says: self.says.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instant(time_s: f64) -> Instant {
        Instant { sample: Sample { time_s, ..Sample::default() }, ..Instant::default() }
    }

    #[test]
    fn instants_are_numbered_and_the_oldest_go_first() {
        let instants = Instants { most_bytes: 500, ..Instants::default() };
        (0..20).for_each(|k| instants.add(instant(f64::from(k))).unwrap());
        let overview = instants.overview(15);
        assert_eq!((overview.count, overview.from, overview.samples.len()), (20, 15, 5));
        let first = overview.kept_from;
        assert!((1..20).contains(&first), "{first}");
        assert!(instants.at(first - 1).is_none() && instants.at(20).is_none());
        assert_eq!(instants.remembered(19).unwrap().sample.time_s, 19.0);
        assert_eq!(instants.overview(99).samples.len(), 0);
    }

    #[test]
    fn who_waits_is_woken_by_the_next_and_by_the_end() {
        let instants = Arc::new(Instants::default());
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let adding = instants.clone();
        let adds = std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_millis(30));
            adding.add(instant(1.0)).unwrap();
        });
        assert!(runtime.block_on(instants.newer(0)).is_some());
        adds.join().unwrap();
        let ending = instants.clone();
        std::thread::spawn(move || ending.end("over"));
        assert!(runtime.block_on(instants.newer(1)).is_none());
        assert_eq!(instants.overview(0).says, "over");
    }
}
