//! Instants of a broadcast: what a receiver of it shows, and what happens to its senders.

use std::collections::BTreeMap;

use anyhow::Result;
use viewshed::map::CellState;
use viewshed::wire::scan_number::ScanNumber;

use super::instant::{Cells, Instant, Sample, Shown};
use super::instants::{Event, Instants};
use crate::bus::listening::{Heard, Listening, Map, SENSORS, shown};
use crate::bus::logged::Logged;
use crate::geometry::azimuths;

/// An azimuth's newest scan, and when it came.
type News = Option<(ScanNumber, f64)>;

/// A receiver that is looked at now and then.
pub struct Receiving {
    pub listening: Listening,
    news: BTreeMap<u8, Vec<News>>,
    /// Where each sender's cells lay last.
    cells: BTreeMap<u8, Cells>,
    /// Condition and epoch of each sender at the last look.
    before: BTreeMap<u8, (String, Option<u8>)>,
    /// On the source's clock.
    begin_s: Option<f64>,
}

impl Receiving {
    pub fn new(listening: Listening) -> Self {
        Self { listening, news: BTreeMap::new(), cells: BTreeMap::new(), before: BTreeMap::new(), begin_s: None }
    }

    /// Takes what came, and notes which azimuths it has news of.
    pub fn take(&mut self, logged: &Logged) {
        self.listening.take_logged(logged);
        let now_s = self.listening.time_s();
        for sensor in self.listening.sensors() {
            let map = self.listening.map(sensor);
            let Some(header) = map.header() else { continue };
            renew(self.news.entry(sensor).or_default(), &map, usize::from(header.azimuths), now_s);
        }
    }

    /// Seconds since the first look.
    pub fn passed_s(&mut self) -> f64 {
        let now = self.listening.time_s();
        now - *self.begin_s.get_or_insert(now)
    }

    /// The maps as they are now, one a sender that was ever heard with a header.
    pub fn maps(&mut self, name: impl Fn(u8) -> String) -> Vec<(Shown, Sample)> {
        (0..SENSORS).filter_map(|sensor| self.map(sensor, &name(sensor))).collect()
    }

    fn map(&mut self, sensor: u8, name: &str) -> Option<(Shown, Sample)> {
        let now_s = self.listening.time_s();
        let map = self.listening.map(sensor);
        let Some(header) = map.header() else {
            // who is silent shows nothing, never the map as it was
            let cells = *self.cells.get(&sensor)?;
            self.news.remove(&sensor);
            let (shown, sample) = Shown::new(name, cells, |_, _| CellState::UNKNOWN);
            return Some((Shown { ages_ms: Some(vec![None; cells.azimuths]), ..shown }, sample));
        };
        let cells = Cells {
            azimuths: usize::from(header.azimuths),
            ranges: usize::from(header.ranges),
            azimuth_rad: azimuths::ends_rad(header.azimuth_origin, header.azimuth_span),
            narrow: header.narrow.to_bytes(),
            cell_m: f64::from(header.cell_cm) / 100.0,
            mount: [
                f64::from(header.mount.origin.x_cm) / 100.0,
                f64::from(header.mount.origin.y_cm) / 100.0,
                f64::from(header.mount.height_cm) / 100.0,
                f64::from(header.mount.yaw.radians()),
            ],
        };
        let news = self.news.entry(sensor).or_default();
        renew(news, &map, cells.azimuths, now_s);
        let ages = news.iter().map(|news| news.map(|(_, at)| ((now_s - at).max(0.0) * 1000.0) as u32)).collect();
        let (shown, sample) = Shown::new(name, cells, |azimuth, range| shown(&map, azimuth, range));
        let shown = match header.probability {
            Some(_) => shown.with_probabilities(|azimuth, range| map.probability(azimuth, range)),
            None => shown,
        };
        self.cells.insert(sensor, cells);
        Some((Shown { ages_ms: Some(ages), ..shown }, sample))
    }

    /// Looks at everything, and tells what has changed about the senders.
    ///
    /// # Errors
    /// An instant that cannot be written.
    pub fn look(&mut self, instants: &Instants) -> Result<()> {
        let time_s = self.passed_s();
        let senders: Vec<Heard> =
            self.listening.sensors().into_iter().filter_map(|n| self.listening.heard(n, Vec::new())).collect();
        for sender in &senders {
            let before = self.before.insert(sender.sensor, (sender.condition.clone(), sender.epoch));
            for text in changes(sender, before.as_ref()) {
                instants.tell(Event { time_s, text });
            }
        }
        let (maps, samples): (Vec<Shown>, Vec<Sample>) =
            self.maps(|sensor| format!("sensor {sensor}")).into_iter().unzip();
        let first = samples.first().copied().unwrap_or(Sample { unknown: 1.0, ..Sample::default() });
        let counters = vec![
            ("frames".to_owned(), self.listening.frames()),
            ("frames of others".to_owned(), u64::from(self.listening.foreign())),
            ("messages not authentic".to_owned(), u64::from(self.listening.not_authentic())),
        ];
        instants.add(Instant { sample: Sample { time_s, ..first }, maps, senders, counters, ..Instant::default() })
    }
}

/// Notes the time at which azimuths show another scan.
fn renew(news: &mut Vec<News>, map: &Map<'_>, azimuths: usize, now_s: f64) {
    news.resize(azimuths, None);
    for (azimuth, news) in news.iter_mut().enumerate() {
        *news = map.scan(azimuth).map(|scan| match *news {
            Some((before, at)) if before == scan => (scan, at),
            _ => (scan, now_s),
        });
    }
}

/// What is to be said of a sender that is not as it was.
fn changes(now: &Heard, before: Option<&(String, Option<u8>)>) -> Vec<String> {
    let sensor = now.sensor;
    let mut said = Vec::new();
    let restarted = before.is_some_and(|(_, epoch)| epoch.is_some() && now.epoch.is_some() && *epoch != now.epoch);
    if restarted {
        said.push(format!("sensor {sensor} has restarted; its maps count anew"));
    }
    if before.is_none_or(|(condition, _)| *condition != now.condition) {
        let was_ok = before.is_some_and(|(condition, _)| condition == "ok");
        let said_now = match (now.condition.as_str(), was_ok) {
            ("ok", _) => format!("sensor {sensor} is heard; its map is shown"),
            ("waiting", true) => format!("sensor {sensor} has stopped; all of its map is unknown"),
            ("waiting", false) => format!("sensor {sensor} is heard; its map is not shown yet"),
            ("no header", _) => format!("sensor {sensor} is heard, and its header is not complete"),
            ("unusable", _) => {
                let version =
                    now.status.as_ref().map_or_else(String::new, |s| format!(" (wire version {})", s.wire_version));
                format!("sensor {sensor} speaks another version{version}, or of a map too large: all of it is unknown")
            }
            ("conflict", _) => format!("two senders use the number {sensor}: all of its map is unknown"),
            (other, _) => format!("sensor {sensor}: {other}"),
        };
        said.push(said_now);
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::listening::Counted;

    fn heard(condition: &str, epoch: u8) -> Heard {
        let counters = Counted::default();
        let (condition, epoch) = (condition.to_owned(), Some(epoch));
        Heard { sensor: 3, condition, epoch, header: None, status: None, counters, maps: Vec::new() }
    }

    #[test]
    fn a_stop_a_restart_and_a_conflict_are_told_once() {
        let ok = ("ok".to_owned(), Some(1));
        let waiting = ("waiting".to_owned(), Some(1));
        assert!(changes(&heard("ok", 1), Some(&ok)).is_empty());
        assert!(changes(&heard("waiting", 1), Some(&ok))[0].contains("has stopped"));
        assert!(changes(&heard("waiting", 1), None)[0].contains("not shown yet"));
        let restarted = changes(&heard("ok", 2), Some(&waiting));
        assert!(restarted[0].contains("restarted") && restarted[1].contains("is shown"), "{restarted:?}");
        assert!(changes(&heard("conflict", 1), Some(&ok))[0].contains("two senders"));
        assert!(changes(&heard("unusable", 1), Some(&ok))[0].contains("another version"));
    }
}
