//! Logs of SavvyCAN (its own CSV, "GVRET").
//!
//! ```text
//! Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8
//! 166064000,0000060A,false,Rx,0,4,01,C2,49,10,
//! ```
//!
//! Times are microseconds of the adapter's clock. Older ones have no `Dir`.

use viewshed::wire::frame::{CanFrame, CanId};

use super::{Content, Line};

/// Whether a file begins like such a log.
pub fn is_log(start: &str) -> bool {
    start.trim_start_matches('\u{feff}').starts_with("Time Stamp,ID,Extended,")
}

/// Reads a log.
pub fn read(text: &str) -> Vec<Result<Line, String>> {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let place = |name: &str| head.iter().position(|column| *column == name);
    let (bus, length, first) = (place("Bus"), place("LEN"), place("D1"));
    let (Some(bus), Some(length), Some(first)) = (bus, length, first) else {
        return vec![Err("its first line has no Bus, LEN and D1".into())];
    };
    lines.filter(|line| !line.trim().is_empty()).map(|line| row(line, bus, length, first)).collect()
}

fn row(line: &str, bus: usize, length: usize, first: usize) -> Result<Line, String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let field = |at: usize| fields.get(at).copied().unwrap_or_default();
    let micros: i64 = field(0).parse().map_err(|_| format!("`{}` is no time in microseconds", field(0)))?;
    let raw = u32::from_str_radix(field(1), 16).map_err(|_| format!("`{}` is no identifier", field(1)))?;
    let id = match field(2) {
        "true" | "1" => CanId::extended(raw),
        _ => u16::try_from(raw).ok().and_then(CanId::standard),
    };
    let id = id.ok_or_else(|| format!("`{}` is no identifier", field(1)))?;
    let count: usize = field(length).parse().map_err(|_| format!("`{}` is no length", field(length)))?;
    let bytes = (first..first + count.min(64)).map(|at| u8::from_str_radix(field(at), 16).ok());
    let bytes: Vec<u8> = bytes.collect::<Option<_>>().ok_or_else(|| format!("not the {count} bytes it announces"))?;
    let frame = if count > 8 { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes) };
    let content = frame.map(Content::Data).ok_or_else(|| format!("{count} bytes are no length of a frame"))?;
    Ok(Line { time_ns: micros.saturating_mul(1000), interface: field(bus).to_owned(), content })
}

#[cfg(test)]
mod tests {
    use super::super::candump;
    use super::*;

    #[test]
    fn rows_are_read_with_and_without_a_direction() {
        let new = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n166064000,0000060A,false,Rx,0,4,01,C2,49,10,\n\
                   166065500,18DAF110,true,Tx,1,1,FF,\n";
        let old = "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n166064000,0000060A,false,0,4,01,C2,49,10,\n\
                   166065500,18DAF110,true,1,1,FF,,,,,,,\n";
        let expected = [candump::line("(166.064) 0 60A#01C24910"), candump::line("(166.0655) 1 18DAF110#FF")];
        for log in [new, old] {
            assert!(is_log(log));
            assert_eq!(read(log), expected);
        }
    }

    #[test]
    fn what_is_no_frame_says_why() {
        for (row, why) in [
            ("x,0000060A,false,Rx,0,1,01", "`x` is no time in microseconds"),
            ("1,00000FFF,false,Rx,0,1,01", "`00000FFF` is no identifier"),
            ("1,0000060A,false,Rx,0,4,01,02", "not the 4 bytes it announces"),
            ("1,0000060A,false,Rx,0,n,01,02", "`n` is no length"),
        ] {
            let log = format!("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n{row}\n");
            assert_eq!(read(&log), [Err(why.to_owned())]);
        }
        assert_eq!(read("Time Stamp,ID,Extended,\n1,2,3\n").len(), 1);
    }
}
