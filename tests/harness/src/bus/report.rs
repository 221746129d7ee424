//! The table of `viewshed bus`, and the same as JSON.

use serde::Serialize;

use super::entropy::Entropy;
use super::load::Load;
use super::loss::Arrived;
use crate::results::report::table::table;

/// What one recording's maps cost.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// File stem.
    pub recording: String,
    /// The row of `replay`'s table whose maps were sent.
    pub estimator: String,
    pub scans: usize,
    pub scans_per_second: f64,
    pub buses: Vec<Load>,
    /// What a receiver has, by bus and share of frames lost.
    pub received: Vec<Arrived>,
    pub entropy_bytes_per_scan: Entropy,
    /// Buses on which azimuths of scans were dropped.
    pub dropped: Vec<Dropped>,
    /// Unknown cells between known ones, which travel as not visible.
    pub holes: u64,
}

/// What was not sent in time.
#[derive(Debug, Clone, Serialize)]
pub struct Dropped {
    pub bus: &'static str,
    pub azimuths: u16,
    /// Of so many that were to be sent, those of all planes.
    pub of: u64,
}

/// `fd-500k-2M-authenticated` in two lines.
fn name(bus: &str) -> String {
    bus.replace("-authenticated", "\nauthenticated")
}

fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

impl Report {
    /// For people.
    pub fn text(&self) -> String {
        let loads = self.buses.iter().map(|bus| {
            let Load { name, load_median, load_worst, frames_per_scan, bytes_per_scan } = bus;
            let loads = [percent(*load_median), percent(*load_worst)];
            let sizes = [format!("{frames_per_scan:.1}"), format!("{bytes_per_scan:.0}")];
            [self::name(name)].into_iter().chain(loads).chain(sizes).collect()
        });
        let headings = ["bus", "load %", "worst\nsecond %", "frames\na scan", "bytes\na scan"];
        let received = self.received.iter().map(|r| {
            let shares = [r.visible_median, r.visible_p05, r.equal];
            let shares = shares.map(|share| share.map_or_else(|| "n/a".to_owned(), percent));
            let begin = [name(r.name), percent(r.loss)];
            begin.into_iter().chain(shares).chain([r.wrongly_visible.to_string()]).collect()
        });
        let arrived =
            ["bus", "lost %", "visible cells\nthere %", "worst 5 %\nof scans", "scans\nequal %", "wrongly\nvisible"];
        let Entropy { neighbours, previous_scan } = self.entropy_bytes_per_scan;
        let mut text = format!(
            "{}: {} scans of {}, {:.1} a second\n{}\n",
            self.recording,
            self.scans,
            self.estimator,
            self.scans_per_second,
            table(&headings, loads)
        );
        text += "Load: every frame, status and header included, with its stuff bits; median and worst of all windows of 1 s.\n";
        text += &format!(
            "Entropy of the maps: {neighbours:.0} bytes a scan given the neighbours, {previous_scan:.0} given the previous scan too.\n"
        );
        text += &format!("{}\n", table(&arrived, received));
        if self.received.iter().any(|r| r.visible_median.is_none()) {
            text += "n/a: no scan after the first 1.5 s has a visible cell that could arrive.\n";
        }
        for Dropped { bus, azimuths, of } in &self.dropped {
            text += &format!("On {bus} {azimuths} of {of} azimuths were not sent in time.\n");
        }
        if !self.dropped.is_empty() {
            text += "What is late is left out: a receiver has what came before, or unknown. On CAN FD there is room; on classic CAN with a \
                     smaller gap between frames, where the bus has it to spare: gap_us of [output] in a daemon's file, 1000 here.\n";
        }
        if self.holes > 0 {
            text += &format!("{} unknown cells between known ones were sent as not visible.\n", self.holes);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_that_is_too_slow_is_named_with_what_to_do() {
        let late = Report {
            recording: "busy".into(),
            estimator: "radar-3d-narrow".into(),
            scans: 10,
            scans_per_second: 15.0,
            buses: Vec::new(),
            received: Vec::new(),
            entropy_bytes_per_scan: Entropy { neighbours: 1.0, previous_scan: 1.0 },
            dropped: vec![Dropped { bus: "classic-500k", azimuths: 12, of: 1920 }],
            holes: 0,
        };
        let text = late.text();
        assert!(text.starts_with("busy: 10 scans of radar-3d-narrow, "), "{text}");
        assert!(text.contains("On classic-500k 12 of 1920 azimuths were not sent in time."), "{text}");
        assert!(text.contains("CAN FD") && text.contains("gap_us"), "{text}");
        assert!(!Report { dropped: Vec::new(), ..late }.text().contains("gap_us"));
    }
}
