//! Text of any encoding a logger leaves behind, line by line, from the smallest to the largest file.
//!
//! UTF-8 with or without a mark, UTF-16 with a mark or by its pattern (what PowerShell's `>` writes), zero bytes (what a
//! power failure and logrotate's `copytruncate` leave): they are skipped and counted. Lines end with a line feed, a
//! carriage return or both.

use std::borrow::Cow;
use std::io::{self, Read};

/// Bytes of a line that are kept; no line of a log is as long.
const LONGEST: usize = 1 << 16;

/// Bytes that are read at once.
const BLOCK: usize = 1 << 16;

/// Bytes whose pattern tells UTF-16 without a mark.
const PATTERN: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    /// Or any that has ASCII in it.
    Utf8,
    Utf16 {
        big: bool,
    },
}

/// Reads lines.
pub struct Lines<R> {
    source: R,
    encoding: Option<Encoding>,
    raw: Vec<u8>,
    /// Text of `raw`, from `at` on not yet given out.
    text: Vec<u8>,
    at: usize,
    /// Of UTF-16, what belongs to bytes that have not come yet.
    carried: Vec<u8>,
    line: Vec<u8>,
    zeros: u64,
    ended: bool,
}

impl<R: Read> Lines<R> {
    pub fn new(source: R) -> Self {
        Self {
            source,
            encoding: None,
            raw: vec![0; BLOCK],
            text: Vec::new(),
            at: 0,
            carried: Vec::new(),
            line: Vec::new(),
            zeros: 0,
            ended: false,
        }
    }

    /// Where the text comes from.
    pub fn source(&self) -> &R {
        &self.source
    }

    /// Zero bytes that were skipped so far.
    pub fn zeros(&self) -> u64 {
        self.zeros
    }

    /// The next line that is not empty; what is no text in it is replaced.
    ///
    /// # Errors
    /// Those of the source.
    pub fn next_line(&mut self) -> io::Result<Option<Cow<'_, str>>> {
        self.line.clear();
        loop {
            let rest = &self.text[self.at..];
            let end = memchr::memchr2(b'\n', b'\r', rest);
            let part = &rest[..end.unwrap_or(rest.len())];
            // nearly all lines lie in one block
            if end.is_some() && self.line.is_empty() && part.len() <= LONGEST && !is_blank(part) {
                let from = self.at;
                self.at += part.len() + 1;
                return Ok(Some(decoded(&self.text[from..self.at - 1])));
            }
            let room = LONGEST.saturating_sub(self.line.len());
            self.line.extend_from_slice(&part[..part.len().min(room)]);
            self.at += end.map_or(rest.len(), |end| end + 1);
            let whole = end.is_some() || (self.ended && self.at >= self.text.len());
            if whole && !is_blank(&self.line) {
                break;
            }
            if whole {
                self.line.clear();
            }
            if self.at >= self.text.len() {
                if self.ended {
                    return Ok(None);
                }
                self.fill()?;
            }
        }
        Ok(Some(decoded(&self.line)))
    }

    /// Reads on, and turns it into UTF-8.
    fn fill(&mut self) -> io::Result<()> {
        self.text.clear();
        self.at = 0;
        let n = loop {
            match self.source.read(&mut self.raw) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                other => break other?,
            }
        };
        self.ended = n == 0;
        let mut bytes = &self.raw[..n];
        if self.encoding.is_none() {
            // what is told by the begin is told by the begin of the text
            let zeros = bytes.iter().take_while(|b| **b == 0).count();
            if zeros == bytes.len() && !self.ended {
                self.zeros += zeros as u64;
                return Ok(());
            }
            bytes = &bytes[zeros..];
            let (mut encoding, length) = encoding_of(bytes);
            bytes = &bytes[length..];
            let mut skipped = zeros;
            // the first half of a letter, before it whole blocks of zeros
            if length == 0 && encoding != Encoding::Utf8 && zeros % 2 == 1 {
                encoding = Encoding::Utf16 { big: true };
                self.carried = vec![0];
                skipped -= 1;
            }
            self.zeros += skipped as u64;
            self.encoding = Some(encoding);
        }
        match self.encoding {
            Some(Encoding::Utf16 { big }) => {
                let all = [&self.carried[..], bytes].concat();
                let whole = if self.ended { all.len().next_multiple_of(2) } else { all.len() / 2 * 2 };
                let unit = |k: usize| {
                    let [a, b] = [2 * k, 2 * k + 1].map(|at| all.get(at).copied().unwrap_or(0));
                    if big { u16::from_be_bytes([a, b]) } else { u16::from_le_bytes([a, b]) }
                };
                let mut units: Vec<u16> = (0..whole / 2).map(unit).collect();
                let mut used = whole;
                // the second half of a pair may be in the next block
                if !self.ended && units.last().is_some_and(|unit| (0xD800..0xDC00).contains(unit)) {
                    units.pop();
                    used -= 2;
                }
                self.carried = all.get(used..).unwrap_or_default().to_vec();
                let letters = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
                let text: String = letters.filter(|c| *c != '\u{feff}' && *c != '\0').collect();
                self.text.extend_from_slice(text.as_bytes());
            }
            _ => {
                let parts = bytes.split(|b| *b == 0).filter(|part| !part.is_empty());
                parts.for_each(|part| self.text.extend_from_slice(part));
                self.zeros += (bytes.len() - self.text.len()) as u64;
            }
        }
        Ok(())
    }
}

/// Bytes as text. Nearly all are, which is found out faster than where they are not.
fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    str::from_utf8(bytes).map_or_else(|_| String::from_utf8_lossy(bytes), Cow::Borrowed)
}

fn is_blank(line: &[u8]) -> bool {
    line.iter().all(u8::is_ascii_whitespace)
}

/// The encoding of a text that begins so, and the length of its mark.
fn encoding_of(bytes: &[u8]) -> (Encoding, usize) {
    match bytes {
        [0xFF, 0xFE, ..] => (Encoding::Utf16 { big: false }, 2),
        [0xFE, 0xFF, ..] => (Encoding::Utf16 { big: true }, 2),
        [0xEF, 0xBB, 0xBF, ..] => (Encoding::Utf8, 3),
        _ => {
            let pairs = bytes[..bytes.len().min(PATTERN)].chunks_exact(2);
            let (all, latin) = (pairs.len(), pairs.filter(|pair| pair[0] != 0 && pair[1] == 0).count());
            let alternate = all >= 8 && 5 * latin >= 4 * all;
            (if alternate { Encoding::Utf16 { big: false } } else { Encoding::Utf8 }, 0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives out a few bytes at a time.
    struct Slowly<'a>(&'a [u8], usize);

    impl Read for Slowly<'_> {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let n = self.0.len().min(self.1).min(into.len());
            into[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }

    fn lines(bytes: &[u8], at_once: usize) -> (Vec<String>, u64) {
        let mut lines = Lines::new(Slowly(bytes, at_once));
        let mut all = Vec::new();
        while let Some(line) = lines.next_line().unwrap() {
            all.push(line.into_owned());
        }
        (all, lines.zeros())
    }

    const TEXT: &str = "# a remark: Größe \u{1F697}\n(1.0) can0 60A#01\r\n\n(2.0) can0 60A#02";

    fn utf_16(text: &str, big: bool) -> Vec<u8> {
        text.encode_utf16().flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
    }

    #[test]
    fn the_same_lines_come_of_every_encoding() {
        let expected = ["# a remark: Größe \u{1F697}", "(1.0) can0 60A#01", "(2.0) can0 60A#02"];
        let zeros = vec![0; 3 * BLOCK];
        for (what, bytes, skipped) in [
            ("plain", TEXT.as_bytes().to_vec(), 0),
            ("marked", ["\u{feff}".as_bytes(), TEXT.as_bytes()].concat(), 0),
            ("UTF-16", [&[0xFF, 0xFE], &utf_16(TEXT, false)[..]].concat(), 0),
            ("UTF-16, big end first", [&[0xFE, 0xFF], &utf_16(TEXT, true)[..]].concat(), 0),
            ("UTF-16 without a mark", utf_16(TEXT, false), 0),
            ("UTF-16, big end first, without a mark", utf_16(TEXT, true), 0),
            ("zeros before", [&zeros, TEXT.as_bytes()].concat(), zeros.len() as u64),
            ("zeros and a mark", [&zeros[..5], &[0xFF, 0xFE], &utf_16(TEXT, false)].concat(), 5),
            ("zeros within", TEXT.replacen("(2.0)", "\0\0\0(2.0)", 1).into_bytes(), 3),
            ("old line ends", TEXT.replace("\r\n", "\n").replace('\n', "\r").into_bytes(), 0),
        ] {
            for at_once in [BLOCK, 7_777, 129] {
                let (found, zeros) = lines(&bytes, at_once);
                assert_eq!(found, expected, "{what}, {at_once} bytes at once");
                assert_eq!(zeros, skipped, "{what}");
            }
        }
    }

    #[test]
    fn a_line_without_an_end_takes_no_more_than_its_room() {
        let long = [vec![b'x'; 5 * LONGEST], b"\nnext\n".to_vec()].concat();
        let (found, _) = lines(&long, BLOCK);
        assert_eq!(found.iter().map(String::len).collect::<Vec<_>>(), [LONGEST, 4]);
        assert_eq!(lines(b"\xFF\xFFa\n", 9).0, ["\u{FFFD}\u{FFFD}a"]);
        assert_eq!((lines(b"", 9), lines(&[0; 40], 9)), ((vec![], 0), (vec![], 40)));
    }
}
