//! Logs of SavvyCAN (its own CSV, "GVRET").
//!
//! ```text
//! Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8
//! 166064000,0000060A,false,Rx,0,4,01,C2,49,10,
//! ```
//!
//! Times are microseconds of the adapter's clock. Older ones have no `Dir`, and for a while it wrote a minus before each.
//! Spreadsheets save it with semicolons and without leading zeros.

use super::Line;
use super::columns::{self, Columns};
use super::time::microseconds;

/// Columns in the order of [`row`].
const COLUMNS: [&str; 6] = ["Time Stamp", "ID", "Extended", "Bus", "LEN", "D1"];

/// Whether a file begins like such a log.
pub fn is_log(lines: &[String]) -> bool {
    lines.first().is_some_and(|line| Reader::begins(line))
}

/// Reads line by line.
#[derive(Debug, Clone, Default)]
pub struct Reader(Option<Columns<6>>);

impl Reader {
    fn begins(line: &str) -> bool {
        columns::is_heading(line, &COLUMNS[..3])
    }

    /// The frame of a line; nothing of a heading, which may come again where files were joined.
    pub fn line(&mut self, line: &str) -> Option<Result<Line, String>> {
        if Self::begins(line) {
            self.0 = Columns::of(line, COLUMNS);
            return self.0.is_none().then(|| Err("its first line has no Bus, LEN and D1".into()));
        }
        Some(row(self.0.as_ref()?, line))
    }
}

fn row(columns: &Columns<6>, line: &str) -> Result<Line, String> {
    let fields = columns.fields(line);
    let [time, id, extended, bus, length, first] = columns.at;
    let field = |at: usize| fields.get(at).copied().unwrap_or_default();
    let time_ns = microseconds(field(time)).ok_or_else(|| format!("`{}` is no time in microseconds", field(time)))?;
    let raw = u32::from_str_radix(field(id), 16).map_err(|_| format!("`{}` is no identifier", field(id)))?;
    let id = columns::identifier(raw, field(extended)).ok_or_else(|| format!("`{}` is no identifier", field(id)))?;
    let count: usize = field(length).parse().map_err(|_| format!("`{}` is no length", field(length)))?;
    let bytes = (first..first + count.min(64)).map(|at| u8::from_str_radix(field(at), 16).ok());
    let bytes: Vec<u8> = bytes.collect::<Option<_>>().ok_or_else(|| format!("not the {count} bytes it announces"))?;
    Ok(Line { time_ns, interface: field(bus).to_owned(), content: columns::data(id, &bytes)? })
}

#[cfg(test)]
mod tests {
    use super::super::{Format, all, candump};
    use super::*;

    fn read(text: &str) -> Vec<Result<Line, String>> {
        all(Format::SavvyCan, text)
    }

    #[test]
    fn rows_are_read_with_and_without_a_direction() {
        let new = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n166064000,0000060A,false,Rx,0,4,01,C2,49,10,\n\
                   166065500,18DAF110,true,Tx,1,1,FF,\n";
        let old = "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n166064000,0000060A,false,0,4,01,C2,49,10,\n\
                   166065500,18DAF110,true,1,1,FF,,,,,,,\n";
        let expected = [candump::line("(166.064) 0 60A#01C24910"), candump::line("(166.0655) 1 18DAF110#FF")];
        let table = new.replace(',', ";").replace("0000060A", "60A").replace("01;C2", "1;C2").replace("true", "WAHR");
        let lower = new.to_lowercase();
        let fraction = new.replace(',', ";").replace("166064000;", "166064000,0;");
        for log in [new, old, &table, &lower, &fraction] {
            assert!(is_log(&[log.lines().next().unwrap().to_owned()]));
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
