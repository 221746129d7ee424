//! Collects a sender's header, group by group or all at once.
//!
//! # Model
//! A group that came stays for the epoch; one that differs from it is a contradiction and changes nothing. Once all are
//! there they are checked together, and if that fails none is kept, for nothing says which of them was wrong.
//! Probabilities come at any time, and whatever is said of them changes nothing of what is visible.

use crate::probability::Levels;
use crate::wire::header::{Clock, GROUP, GROUPS, Groups, Header, MORE, NotAHeader, is_narrow, some_narrow};
use crate::wire::message::WIRE_VERSION;

/// What a header message brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Brought {
    /// The clock, and nothing else new.
    Clock(Clock),
    /// A group that was missing or is as it was.
    Group,
    /// The header is complete now.
    Complete,
    /// A group that contradicts what this epoch said before.
    Contradiction,
}

/// Collects an epoch's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Collector {
    groups: Groups,
    /// Which of them are there, a bit each.
    there: u8,
    /// The group of narrow azimuths; zeros are none.
    narrow: [u8; GROUP],
    header: Option<Header>,
    levels: Said,
}

/// What an epoch said of probabilities. It never changes what is visible, so that receivers which do not know of it
/// show the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Said {
    Nothing,
    Once(Levels),
    /// One thing and another: neither is believed any more.
    Contradicting,
}

impl Default for Collector {
    fn default() -> Self {
        Self::NEW
    }
}

impl Collector {
    /// Nothing yet.
    pub const NEW: Self = Self {
        groups: [[0; GROUP]; GROUPS as usize - 1],
        there: 0,
        narrow: [0; GROUP],
        header: None,
        levels: Said::Nothing,
    };

    /// The header, once complete.
    pub fn header(&self) -> Option<&Header> {
        self.header.as_ref()
    }

    /// Takes a message's own bytes: a group, or all of them.
    ///
    /// # Errors
    /// An unknown wire version, missing bytes, a check that does not fit, values out of range.
    pub fn take(&mut self, own: &[u8]) -> Result<Brought, NotAHeader> {
        let [flags, bytes @ ..] = own else { return Err(NotAHeader::TooShort) };
        let version = flags & 0x0F;
        if version != WIRE_VERSION {
            return Err(NotAHeader::Version { version });
        }
        let synchronised = flags >> 7 == 1;
        let first: [u8; GROUP] = *bytes.first_chunk().ok_or(NotAHeader::TooShort)?;
        if bytes.len() < usize::from(GROUPS) * GROUP {
            return match flags >> 4 & 7 {
                0 => Ok(Brought::Clock(Clock::parse(synchronised, first))),
                MORE.. if is_narrow(&first) => self.take_narrow(first),
                MORE.. => {
                    self.take_levels(first);
                    Ok(Brought::Group)
                }
                group => self.take_group(usize::from(group) - 1, first),
            };
        }
        let mut groups = [[0; GROUP]; GROUPS as usize - 1];
        let rest = bytes.get(GROUP..).unwrap_or(&[]);
        groups.as_flattened_mut().iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
        let more = rest.get(groups.as_flattened().len()..).unwrap_or(&[]).as_chunks::<GROUP>().0;
        let narrow = more.iter().copied().find(is_narrow);
        let header = Header::parse(&groups, narrow)?;
        if self.contradicts(&groups) || self.narrow().is_some_and(|held| narrow.is_some_and(|new| new != held)) {
            return Ok(Brought::Contradiction);
        }
        (self.groups, self.there, self.header) = (groups, 0x3F, Some(header));
        self.narrow = narrow.unwrap_or(self.narrow);
        more.iter().filter(|group| !is_narrow(group)).for_each(|levels| self.take_levels(*levels));
        self.with_levels();
        Ok(Brought::Clock(Clock::parse(synchronised, first)))
    }

    fn contradicts(&self, groups: &Groups) -> bool {
        let mut both = self.groups.iter().zip(groups).enumerate();
        both.any(|(i, (old, new))| self.there >> i & 1 == 1 && old != new)
    }

    /// Takes group 7 of probabilities; one that does not hold says nothing.
    fn take_levels(&mut self, group: [u8; GROUP]) {
        let Some(new) = Levels::from_bytes(group) else { return };
        self.levels = match self.levels {
            Said::Nothing => Said::Once(new),
            Said::Once(levels) if levels == new => return,
            _ => Said::Contradicting,
        };
        self.with_levels();
    }

    fn with_levels(&mut self) {
        if let Some(header) = &mut self.header {
            header.probability = match self.levels {
                Said::Once(levels) => Some(levels),
                Said::Nothing | Said::Contradicting => None,
            };
        }
    }

    fn take_group(&mut self, place: usize, group: [u8; GROUP]) -> Result<Brought, NotAHeader> {
        let Some(slot) = self.groups.get_mut(place) else { return Err(NotAHeader::Range) };
        let known = self.there >> place & 1 == 1;
        if known && *slot != group {
            return Ok(Brought::Contradiction);
        }
        *slot = group;
        self.there |= 1 << place;
        if known { Ok(Brought::Group) } else { self.complete() }
    }

    /// The group of narrow azimuths, once it came.
    fn narrow(&self) -> Option<[u8; GROUP]> {
        Some(self.narrow).filter(is_narrow)
    }

    /// Takes group 7 of narrow azimuths.
    fn take_narrow(&mut self, group: [u8; GROUP]) -> Result<Brought, NotAHeader> {
        match self.narrow() {
            Some(held) if held == group => Ok(Brought::Group),
            Some(_) => Ok(Brought::Contradiction),
            None => {
                self.narrow = group;
                self.complete()
            }
        }
    }

    /// Makes the header, once all of it is there.
    fn complete(&mut self) -> Result<Brought, NotAHeader> {
        let missing = self.there != 0x3F || self.narrow().is_none() && some_narrow(&self.groups);
        if missing || self.header.is_some() {
            return Ok(Brought::Group);
        }
        match Header::parse(&self.groups, self.narrow()) {
            Ok(header) => {
                self.header = Some(header);
                self.with_levels();
                Ok(Brought::Complete)
            }
            Err(error) => {
                // some group was wrong, none says which
                *self = Self { levels: self.levels, ..Self::NEW };
                Err(error)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::code::ray::Known;
    use crate::wire::header::check;
    use crate::wire::header::tests::{CLOCK, LEVELS_7, emit, header, with_levels, with_narrow};

    #[test]
    fn groups_come_in_any_order_and_more_than_once() {
        let mut c = Collector::NEW;
        for group in [6, 2, 2, 5, 1, 4] {
            assert_eq!(c.take(&header().emit_group(&CLOCK, group)), Ok(Brought::Group));
        }
        assert_eq!(c.take(&header().emit_group(&CLOCK, 0)), Ok(Brought::Clock(CLOCK)));
        assert!(c.header().is_none());
        assert_eq!(c.take(&header().emit_group(&CLOCK, 3)), Ok(Brought::Complete));
        assert_eq!(c.header(), Some(&header()));
        let other = Header { azimuths: 119, ..header() };
        assert_eq!(c.take(&other.emit_group(&CLOCK, 4)), Ok(Brought::Contradiction));
        assert_eq!(c.take(&emit(&other)), Ok(Brought::Contradiction));
        let mut c = Collector::NEW;
        assert_eq!(c.take(&emit(&header())), Ok(Brought::Clock(CLOCK)));
        assert_eq!(c.header(), Some(&header()));
    }

    #[test]
    fn groups_of_two_headers_do_not_make_one() {
        let other = Header { fingerprint: 1, ..header() };
        let mut c = Collector::NEW;
        (1..6).for_each(|group| assert_eq!(c.take(&other.emit_group(&CLOCK, group)), Ok(Brought::Group)));
        let mut mixed = header().emit_group(&CLOCK, 6);
        mixed[4] ^= 1;
        assert_eq!(c.take(&mixed), Err(NotAHeader::Check));
        assert_eq!(c, Collector::NEW);
    }

    #[test]
    fn probabilities_are_an_eighth_group_that_comes_at_any_time() {
        let sent = with_levels(LEVELS_7);
        assert!(sent.probability.is_some());
        assert_eq!((emit(&sent).len(), &emit(&sent)[36..]), (41, &LEVELS_7[..]));
        let mut c = Collector::NEW;
        c.take(&emit(&sent)).unwrap();
        assert_eq!(c.header(), Some(&sent));
        for first in 0..8 {
            let mut c = Collector::NEW;
            (0..8).for_each(|k| _ = c.take(&sent.emit_group(&CLOCK, (first + k) % 8)).unwrap());
            assert_eq!(c.header(), Some(&sent), "from group {first} on");
        }
        // zeros fill a frame up
        let mut filled = emit(&header());
        filled.resize(42, 0);
        let mut c = Collector::NEW;
        c.take(&filled).unwrap();
        assert_eq!(c.header(), Some(&header()));
    }

    #[test]
    fn probabilities_that_contradict_are_believed_no_more_and_nothing_else_changes() {
        let (one, other) = (with_levels(LEVELS_7), with_levels([60, 200, 241, 0xAB, 0xCD]));
        let mut c = Collector::NEW;
        c.take(&emit(&one)).unwrap();
        assert_eq!(c.take(&emit(&other)), Ok(Brought::Clock(CLOCK)), "no conflict");
        assert_eq!(c.header(), Some(&header()));
        c.take(&emit(&one)).unwrap();
        assert_eq!(c.header(), Some(&header()), "for the rest of the epoch");
        let mut c = Collector::NEW;
        assert_eq!(c.take(&one.emit_group(&CLOCK, 7)), Ok(Brought::Group));
        assert_eq!(c.take(&other.emit_group(&CLOCK, 7)), Ok(Brought::Group));
        (1..7).for_each(|group| _ = c.take(&one.emit_group(&CLOCK, group)).unwrap());
        assert_eq!(c.header(), Some(&header()));
    }

    #[test]
    fn narrow_azimuths_are_one_more_group_without_which_there_is_no_header() {
        let levels = Levels::from_bytes(LEVELS_7);
        for (sent, more) in
            [(with_narrow([40, 88, 4]), 1), (Header { probability: levels, ..with_narrow([0, 120, 2]) }, 2)]
        {
            let bytes = emit(&sent);
            assert_eq!((bytes.len(), usize::from(sent.count())), (36 + 5 * more, 7 + more));
            let [first, end, times] = sent.narrow.to_bytes();
            assert_eq!(bytes[bytes.len() - 5..], [first, end, 0, times, 0]);
            assert_eq!(bytes[25], 128 + 119, "more azimuths than there may be");
            let mut c = Collector::NEW;
            c.take(&bytes).unwrap();
            assert_eq!(c.header(), Some(&sent));
            assert_eq!(c.header().unwrap().geometry().narrow, sent.narrow);
            let count = sent.count();
            for first in 0..count {
                let mut c = Collector::NEW;
                for k in 0..count {
                    assert!(c.header().is_none() || c.narrow().is_some(), "from group {first} on");
                    c.take(&sent.emit_group(&CLOCK, (first + k) % count)).unwrap();
                }
                assert_eq!(c.header(), Some(&sent), "from group {first} on");
            }
            // a long message without that group
            assert_eq!(Collector::default().take(&bytes[..bytes.len() - 5]), Err(NotAHeader::Check));
        }
    }

    #[test]
    fn other_narrow_azimuths_contradict_and_damaged_ones_make_no_header() {
        let (one, other) = (with_narrow([40, 88, 4]), with_narrow([40, 87, 4]));
        let mut c = Collector::NEW;
        c.take(&emit(&one)).unwrap();
        assert_eq!(c.take(&other.emit_group(&CLOCK, 7)), Ok(Brought::Contradiction));
        assert_eq!(c.take(&emit(&other)), Ok(Brought::Contradiction));
        assert_eq!(c.header(), Some(&one));
        // the check of group 6 is over these, too
        let mut c = Collector::NEW;
        (1..7).for_each(|group| _ = c.take(&one.emit_group(&CLOCK, group)).unwrap());
        assert!(c.header().is_none());
        assert_eq!(c.take(&other.emit_group(&CLOCK, 7)), Err(NotAHeader::Check));
        assert_eq!(c, Collector::NEW);
        // in range of a byte, not of the header
        let groups = one.groups();
        for bytes in [[40, 121, 0, 4, 0], [88, 40, 0, 4, 0], [40, 88, 0, 5, 0]] {
            let mut groups = groups;
            groups[5][4] = check(&groups, Some(bytes));
            assert_eq!(Header::parse(&groups, Some(bytes)), Err(NotAHeader::Range), "{bytes:?}");
        }
        // of a header without any, such a group says nothing
        let mut c = Collector::NEW;
        c.take(&emit(&header())).unwrap();
        assert_eq!(c.take(&one.emit_group(&CLOCK, 7)), Ok(Brought::Group));
        assert_eq!(c.header(), Some(&header()));
    }

    #[test]
    fn unknown_versions_and_impossible_sizes_are_refused() {
        let take = |bytes: &[u8]| Collector::default().take(bytes);
        let mut bytes = emit(&header());
        bytes[0] = 0x82;
        assert_eq!(take(&bytes), Err(NotAHeader::Version { version: 2 }));
        assert_eq!(take(&[0x01, 0, 0]), Err(NotAHeader::TooShort));
        let wide = Header { usual: Known::new(0, 201), ..header() };
        assert_eq!(take(&emit(&wide)), Err(NotAHeader::Range));
        let flat = Header { cell_cm: 0, ..header() };
        assert_eq!(take(&emit(&flat)), Err(NotAHeader::Range));
    }
}
