//! Text files plain or gzip, read through while counting lines; attributes of XML elements.

use std::cell::Cell;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Result as IoResult};
use std::path::Path;
use std::rc::Rc;

use anyhow::{Context, Result};
use flate2::bufread::MultiGzDecoder;
use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

/// Reads on and knows the line it is in.
pub struct Counted<R> {
    inner: R,
    newlines: Rc<Cell<u64>>,
}

/// The line a [`Counted`] reader has come to; can be asked while another owns the reader.
#[derive(Debug, Clone)]
pub struct Line(Rc<Cell<u64>>);

impl Line {
    /// Counted from 1.
    pub fn number(&self) -> u64 {
        self.0.get() + 1
    }
}

impl<R: BufRead> Counted<R> {
    pub fn new(inner: R) -> Self {
        Self { inner, newlines: Rc::default() }
    }

    pub fn line(&self) -> Line {
        Line(Rc::clone(&self.newlines))
    }
}

impl<R: BufRead> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> IoResult<usize> {
        let available = self.fill_buf()?;
        let taken = available.len().min(buffer.len());
        buffer[..taken].copy_from_slice(&available[..taken]);
        self.consume(taken);
        Ok(taken)
    }
}

impl<R: BufRead> BufRead for Counted<R> {
    fn fill_buf(&mut self) -> IoResult<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        // what is consumed has been filled before, so asking again reads nothing
        if let Ok(buffer) = self.inner.fill_buf() {
            let passed = buffer.iter().take(amount).filter(|b| **b == b'\n').count() as u64;
            self.newlines.set(self.newlines.get() + passed);
        }
        self.inner.consume(amount);
    }
}

/// A text file being read.
pub type Text = Counted<Box<dyn BufRead>>;

/// Opens a file; gzip is told by its first bytes, whatever its name.
///
/// # Errors
/// A file that cannot be read.
pub fn open(path: &Path) -> Result<Text> {
    let place = || format!("cannot read {}", path.display());
    let mut file = BufReader::new(File::open(path).with_context(place)?);
    let zipped = file.fill_buf().with_context(place)?.starts_with(&[0x1f, 0x8b]);
    Ok(Counted::new(if zipped { Box::new(BufReader::new(MultiGzDecoder::new(file))) } else { Box::new(file) }))
}

/// Whether the text goes on with these bytes, white space and a byte order mark left out.
pub fn begins_with(text: &mut Text, what: &[u8]) -> IoResult<bool> {
    let buffer = text.fill_buf()?;
    let buffer = buffer.strip_prefix(b"\xef\xbb\xbf").unwrap_or(buffer);
    Ok(buffer.trim_ascii_start().starts_with(what))
}

/// The first line that is no comment, and the text from that line on.
pub fn first_line(mut text: Text) -> IoResult<(Text, String)> {
    let mut comments = 0;
    loop {
        let mut line = String::new();
        let end = text.read_line(&mut line)? == 0;
        if end || !(line.starts_with('#') || line.trim().is_empty()) {
            let heading = line.trim().to_owned();
            let again = std::io::Cursor::new(line.into_bytes());
            let mut whole = Counted::new(Box::new(again.chain(text)) as Box<dyn BufRead>);
            whole.newlines = Rc::new(Cell::new(comments));
            return Ok((whole, heading));
        }
        comments += 1;
    }
}

/// An attribute of an element, entities resolved.
pub fn attribute(element: &BytesStart, key: &str) -> Result<Option<String>> {
    let found = element.try_get_attribute(key)?;
    Ok(found.map(|a| a.normalized_value(XmlVersion::Implicit1_0).map(|t| t.into_owned())).transpose()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_however_the_text_is_read() {
        let text: &[u8] = b"one\ntwo\nthree";
        let mut counted = Counted::new(BufReader::with_capacity(2, text));
        let line = counted.line();
        assert_eq!(line.number(), 1);
        let mut taken = String::new();
        counted.read_line(&mut taken).unwrap();
        assert_eq!((taken.as_str(), line.number()), ("one\n", 2));
        let mut rest = String::new();
        counted.read_to_string(&mut rest).unwrap();
        assert_eq!((rest.as_str(), line.number()), ("two\nthree", 3));
    }

    #[test]
    fn the_heading_is_found_behind_comments_and_stays_in_the_text() {
        let text = Counted::new(Box::new(&b"# a\n\nx,y\n1,2\n"[..]) as Box<dyn BufRead>);
        let (mut rest, heading) = first_line(text).unwrap();
        let line = rest.line();
        assert_eq!((heading.as_str(), line.number()), ("x,y", 3));
        let mut all = String::new();
        rest.read_to_string(&mut all).unwrap();
        assert_eq!(all, "x,y\n1,2\n");
        assert_eq!(line.number(), 5);
    }
}
