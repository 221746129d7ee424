//! What logs that are tables have in common.

use viewshed::wire::frame::{CanFrame, CanId};

use super::Content;

/// Between the columns.
const SEPARATORS: [char; 3] = [',', ';', '\t'];

/// Where the wanted columns of a table are.
#[derive(Debug, Clone)]
pub struct Columns<const N: usize> {
    separator: char,
    pub at: [usize; N],
}

impl<const N: usize> Columns<N> {
    /// By the names in the first line; `None` where one is missing.
    pub fn of(heading: &str, names: [&str; N]) -> Option<Self> {
        let separator = separator(heading)?;
        let found: Vec<&str> = split(heading, separator).collect();
        let place = |name: &str| found.iter().position(|column| column.eq_ignore_ascii_case(name));
        let at: Vec<usize> = names.into_iter().map(place).collect::<Option<_>>()?;
        Some(Self { separator, at: at.try_into().ok()? })
    }

    /// The fields of a row, in the table's own order.
    pub fn fields<'a>(&self, row: &'a str) -> Vec<&'a str> {
        split(row, self.separator).collect()
    }
}

fn separator(heading: &str) -> Option<char> {
    SEPARATORS.into_iter().find(|separator| heading.contains(*separator))
}

fn split(line: &str, separator: char) -> impl Iterator<Item = &str> {
    line.split(separator).map(|field| field.trim().trim_matches('"'))
}

/// Whether a line begins with these names of columns.
pub fn is_heading(line: &str, names: &[&str]) -> bool {
    let Some(separator) = separator(line) else { return false };
    let mut found = split(line, separator);
    names.iter().all(|name| found.next().is_some_and(|column| column.eq_ignore_ascii_case(name)))
}

/// An identifier, and whether the table says it is of 29 bits; one that is too large for 11 is.
pub fn identifier(raw: u32, extended: &str) -> Option<CanId> {
    // spreadsheets say it in their own language
    let short = ["", "0", "f", "false", "falsch", "faux", "falso", "no"];
    if short.iter().any(|word| extended.eq_ignore_ascii_case(word)) {
        return u16::try_from(raw).ok().and_then(CanId::standard);
    }
    CanId::extended(raw)
}

/// A frame with these bytes.
pub fn data(id: CanId, bytes: &[u8]) -> Result<Content, String> {
    let frame = if bytes.len() > 8 { CanFrame::fd(id, bytes) } else { CanFrame::classic(id, bytes) };
    frame.map(Content::Data).ok_or_else(|| format!("{} bytes are no length of a frame", bytes.len()))
}
