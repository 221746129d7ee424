//! What comes over the radar's line while no scans do: whether anything, and whose.

use std::collections::{BTreeMap, BTreeSet};

use viewshed::{CanFrame, CanId, Time};

/// Without a scan for this long it is said what is heard instead, microseconds.
const SILENCE_US: u64 = 3_000_000;
/// Identifiers that are named.
const MOST_NAMED: usize = 6;
/// Identifiers of an ARS408 of sensor id 0 that come with every scan or every second; another id adds 0x10 times it.
const OF_A_RADAR: [u32; 5] = [0x201, 0x600, 0x60A, 0x60B, 0x701];

/// What is expected on the line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Line {
    /// An ARS408 of this id on an interface.
    Ars408 { interface: String, id: u8 },
    /// Messages of this kind on a port.
    Serial { port: String, baud: u32, what: &'static str },
}

/// Listens, and says once what has changed.
#[derive(Debug)]
pub struct Hearing {
    line: Line,
    /// Since the last scan, or the last time it was said.
    since: Option<Time>,
    scans: u32,
    pieces: u64,
    radars: BTreeMap<u8, u64>,
    others: BTreeSet<u32>,
    said: Option<String>,
}

/// Something worth a line in the log.
#[derive(Debug, PartialEq, Eq)]
pub enum Heard {
    /// No scans, and why that may be.
    Trouble(String),
    /// Scans come after that.
    Scans,
}

impl Hearing {
    pub fn new(line: Line) -> Self {
        let (radars, others) = (BTreeMap::new(), BTreeSet::new());
        Self { line, since: None, scans: 0, pieces: 0, radars, others, said: None }
    }

    /// A frame on the bus.
    pub fn frame(&mut self, frame: &CanFrame) {
        self.pieces += 1;
        let raw = frame.id.raw();
        if let CanId::Standard(_) = frame.id
            && OF_A_RADAR.contains(&(raw & !0x70))
        {
            *self.radars.entry((raw >> 4 & 7) as u8).or_default() += 1;
        } else if self.others.len() < MOST_NAMED {
            self.others.insert(raw);
        }
    }

    /// Bytes on the port.
    pub fn bytes(&mut self, count: usize) {
        self.pieces += count as u64;
    }

    /// Looks, with the scans so far; what is to be said.
    pub fn look(&mut self, now: Time, scans: u32) -> Option<Heard> {
        if scans != self.scans {
            (self.scans, self.since) = (scans, Some(now));
            self.forget();
            return self.said.take().map(|_| Heard::Scans);
        }
        let since = *self.since.get_or_insert(now);
        // a clock that stepped back begins anew
        let Some(silent) = now.since(since) else {
            self.since = Some(now);
            return None;
        };
        if silent < SILENCE_US {
            return None;
        }
        let what = self.trouble();
        self.since = Some(now);
        self.forget();
        let new = self.said.as_ref() != Some(&what);
        self.said = Some(what.clone());
        new.then_some(Heard::Trouble(what))
    }

    fn forget(&mut self) {
        self.pieces = 0;
        self.radars.clear();
        self.others.clear();
    }

    /// In words without counts, so that the same is said once.
    fn trouble(&self) -> String {
        match &self.line {
            Line::Ars408 { interface, .. } if self.pieces == 0 => format!(
                "{interface}: no frame; is the radar powered, the bus terminated, and `ip -details link show {interface}` at the \
                 radar's bit rate?"
            ),
            Line::Ars408 { interface, id } => {
                let ids: Vec<String> = self.radars.keys().map(ToString::to_string).collect();
                let others: Vec<String> = self.others.iter().map(|id| format!("0x{id:03X}")).collect();
                match (self.radars.contains_key(id), ids.is_empty()) {
                    (true, _) => format!(
                        "{interface}: sensor {id} is there and sends no scans; is it set to clusters or objects?"
                    ),
                    (false, false) => format!(
                        "{interface}: sensor {id} is silent; {} {} there (input.sensor_id)",
                        ids.join(" and "),
                        if ids.len() == 1 { "is" } else { "are" }
                    ),
                    (false, true) => format!(
                        "{interface}: no frame of an ARS408, whose identifiers are 0x{:03X}, 0x{:03X} and others; but {}",
                        OF_A_RADAR[0] + 0x10 * u32::from(*id),
                        OF_A_RADAR[1] + 0x10 * u32::from(*id),
                        others.join(", ")
                    ),
                }
            }
            Line::Serial { port, what, .. } if self.pieces == 0 => {
                format!("{port}: no byte; is the radar powered and started, and is this its port for {what}?")
            }
            Line::Serial { port, baud, what } => {
                format!("{port}: bytes, and no {what} among them; is {baud} its baud rate (input.baud)?")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    fn frame(id: u16) -> CanFrame {
        CanFrame::classic(CanId::Standard(id), &[0; 8]).unwrap()
    }

    fn trouble(ids: &[u16]) -> String {
        let mut hearing = Hearing::new(Line::Ars408 { interface: "can0".into(), id: 5 });
        assert_eq!(hearing.look(at(0), 0), None);
        ids.iter().for_each(|id| hearing.frame(&frame(*id)));
        match hearing.look(at(3000), 0) {
            Some(Heard::Trouble(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_heard_in_place_of_the_radar_is_named() {
        assert!(trouble(&[]).starts_with("can0: no frame; is the radar powered"));
        assert!(trouble(&[0x600, 0x701, 0x731, 0x630]).starts_with("can0: sensor 5 is silent; 0 and 3 are there"));
        assert!(trouble(&[0x201]).starts_with("can0: sensor 5 is silent; 0 is there"));
        assert!(trouble(&[0x251]).starts_with("can0: sensor 5 is there and sends no scans"));
        let others = trouble(&[0x123, 0x0F0]);
        assert!(others.contains("identifiers are 0x251, 0x650") && others.ends_with("but 0x0F0, 0x123"), "{others}");
        // an extended identifier is none of its own
        let mut hearing = Hearing::new(Line::Ars408 { interface: "can0".into(), id: 0 });
        hearing.frame(&CanFrame::classic(CanId::Extended(0x600), &[]).unwrap());
        assert!(hearing.radars.is_empty());
    }

    #[test]
    fn a_wrong_baud_rate_is_told_from_silence() {
        let line = Line::Serial { port: "/dev/ttyUSB0".into(), baud: 921_600, what: "frames" };
        let mut hearing = Hearing::new(line);
        hearing.look(at(0), 0);
        let Some(Heard::Trouble(text)) = hearing.look(at(3000), 0) else { panic!() };
        assert!(text.starts_with("/dev/ttyUSB0: no byte"), "{text}");
        hearing.bytes(100);
        let Some(Heard::Trouble(text)) = hearing.look(at(6000), 0) else { panic!() };
        assert_eq!(text, "/dev/ttyUSB0: bytes, and no frames among them; is 921600 its baud rate (input.baud)?");
    }

    #[test]
    fn it_is_said_once_and_that_it_ended() {
        let mut hearing = Hearing::new(Line::Ars408 { interface: "can0".into(), id: 0 });
        let mut said = Vec::new();
        for ms in 0..20_000 {
            hearing.frame(&frame(0x610));
            said.extend(hearing.look(at(ms), u32::from(ms >= 15_000)).map(|what| (ms, what)));
        }
        let [(3000, Heard::Trouble(_)), (15_000, Heard::Scans), (18_000, Heard::Trouble(_))] = &said[..] else {
            panic!("{said:?}")
        };
        // a clock that steps back is no silence
        assert_eq!(hearing.look(at(100), 1), None);
        assert_eq!(hearing.look(at(2000), 1), None);
    }
}
