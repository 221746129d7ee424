//! Logs of python-can (its CSV).
//!
//! ```text
//! timestamp,arbitration_id,extended,remote,error,dlc,data
//! 1700000000.0029,0x701,0,0,0,8,AlgiIoAgAYA=
//! ```
//!
//! The bytes are in base 64. It does not say which bus a frame was on.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::columns::{self, Columns};
use super::time::seconds;
use super::{Content, Line};

/// Columns in the order of [`row`].
const COLUMNS: [&str; 6] = ["timestamp", "arbitration_id", "extended", "remote", "error", "data"];

/// The name that stands for the bus, whichever it was.
const BUS: &str = "can";

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

    /// The frame of a line; nothing of a heading.
    pub fn line(&mut self, line: &str) -> Option<Result<Line, String>> {
        if Self::begins(line) {
            self.0 = Columns::of(line, COLUMNS);
            return self.0.is_none().then(|| Err("its first line has no remote, error and data".into()));
        }
        Some(row(self.0.as_ref()?, line))
    }
}

fn row(columns: &Columns<6>, line: &str) -> Result<Line, String> {
    let fields = columns.fields(line);
    let [time, id, extended, remote, error, data] = columns.at.map(|at| fields.get(at).copied().unwrap_or_default());
    let time_ns = seconds(time).ok_or_else(|| format!("`{time}` is no time in seconds"))?;
    let digits = id.strip_prefix("0x").or(id.strip_prefix("0X")).unwrap_or(id);
    let raw = u32::from_str_radix(digits, 16).map_err(|_| format!("`{id}` is no identifier"))?;
    let of = |content: Content| Line { time_ns, interface: BUS.to_owned(), content };
    let is = |flag: &str| flag == "1" || flag.eq_ignore_ascii_case("true");
    if is(error) {
        return Ok(of(Content::Error(raw)));
    }
    let id = columns::identifier(raw, extended).ok_or_else(|| format!("`{id}` is no identifier"))?;
    if is(remote) {
        return Ok(of(Content::Remote(id)));
    }
    let bytes = STANDARD.decode(data).map_err(|_| format!("`{data}` is not base 64"))?;
    Ok(of(columns::data(id, &bytes)?))
}

#[cfg(test)]
mod tests {
    use super::super::{Format, all, candump};

    const HEADING: &str = "timestamp,arbitration_id,extended,remote,error,dlc,data";

    #[test]
    fn rows_are_read_with_commas_and_with_semicolons() {
        let rows = "1.5,0x60a,0,0,0,4,AcJJEA==\n1e-05,0x18daf110,1,0,0,1,/w==\n2.5,0x701,0,1,0,0,\n";
        let expected = ["(1.5) can 60A#01C24910", "(0.00001) can 18DAF110#FF", "(2.5) can 701#R"].map(candump::line);
        assert_eq!(all(Format::PythonCan, &format!("{HEADING}\n{rows}")), expected);
        let table = format!("{HEADING}\n{rows}").replace(',', ";").replace("1.5", "1,5").replace("2.5", "\"2,5\"");
        assert_eq!(all(Format::PythonCan, &table), expected);
    }

    #[test]
    fn what_is_no_frame_says_why() {
        let long = format!("1.5,0x60a,0,0,0,66,{}", "A".repeat(88));
        for (row, why) in [
            ("x,0x60a,0,0,0,4,AcJJEA==", "`x` is no time in seconds"),
            ("1.5,0x60g,0,0,0,4,AcJJEA==", "`0x60g` is no identifier"),
            ("1.5,0xfff,0,0,0,4,AcJJEA==", "`0xfff` is no identifier"),
            ("1.5,0x60a,0,0,0,4,AcJJEA", "`AcJJEA` is not base 64"),
            (&long, "66 bytes are no length of a frame"),
        ] {
            assert_eq!(all(Format::PythonCan, &format!("{HEADING}\n{row}\n")), [Err(why.to_owned())]);
        }
    }
}
