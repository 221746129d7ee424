//! A table as a text file (TOML), with what it was counted from.

use std::path::Path;

use anyhow::{Context, Result};
use viewshed::probability::{Edges, ProbabilityTable};

use super::table_file::{self, Content, sum};
use crate::evaluation::curve::{GRADE_SLOTS, Grades};

/// A table and the samples it was fitted on, by what tables fitted without them say of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    pub table: ProbabilityTable,
    pub counted: Grades,
}

const HEAD: &str = "# Probability that a vehicle is detected, by grade, range and azimuth, of one unit.\n\
                    # Written by `viewshed experiment --calibration --tables`; read by `viewshed replay --probability`.\n\n";

impl Fitted {
    pub fn text(&self) -> Result<String> {
        let Edges { grades, ranges_cm, azimuths } = *self.table.edges();
        let used = |&slot: &usize| self.counted.positive[slot] + self.counted.negative[slot] > 0;
        let count = |slot| [slot as u64, self.counted.positive[slot], self.counted.negative[slot]];
        let content = Content {
            check_sum: sum(&self.table),
            fingerprint: format!("{:08x}", self.table.fingerprint()),
            grades,
            ranges_cm,
            azimuths,
            values: *self.table.values(),
            counted: (0..GRADE_SLOTS - 1).filter(used).map(count).collect(),
        };
        Ok(format!("{HEAD}{}", toml::to_string(&content)?))
    }

    /// # Errors
    /// The key, with its line, of what cannot be read or is cut off; a check sum that does not hold; a table that the
    /// library refuses, with its reason.
    pub fn parse(text: &str) -> Result<Self> {
        let (table, by_probability) = table_file::parse(text)?;
        let mut counted = Grades::default();
        for (p, [detected, missed]) in by_probability.iter().enumerate() {
            (counted.positive[p], counted.negative[p]) = (*detected, *missed);
        }
        Ok(Self { table, counted })
    }

    /// # Errors
    /// Those of [`Fitted::parse`], and a file that cannot be read.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::parse(&text).with_context(|| format!("probability table {}", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted() -> Fitted {
        let edges = Edges {
            grades: std::array::from_fn(|k| 2 + 23 * k as u8),
            ranges_cm: std::array::from_fn(|k| 1000 * (k as u16 + 1)),
            azimuths: std::array::from_fn(|k| 900 * (k as i16 - 3)),
        };
        let values =
            std::array::from_fn(|a| std::array::from_fn(|r| std::array::from_fn(|g| (10 * a + 5 * r + 3 * g) as u8)));
        let mut counted = Grades::default();
        (0..300).for_each(|k| counted.add(k % 7 != 0, u8::try_from(k).ok()));
        // what is unknown is not of the table
        counted.positive[256] = 0;
        counted.negative[256] = 0;
        Fitted { table: ProbabilityTable::new(edges, values, 0xBEEF).unwrap(), counted }
    }

    #[test]
    fn a_table_comes_back_from_its_text() {
        let text = fitted().text().unwrap();
        assert_eq!(Fitted::parse(&text).unwrap(), fitted());
    }

    #[test]
    fn a_file_that_is_no_table_is_refused_by_what_is_wrong() {
        let text = fitted().text().unwrap();
        let refused = |text: &str| format!("{:#}", Fitted::parse(text).unwrap_err());
        let changed = text.replacen("grades = [2", "grades = [1", 1);
        assert!(refused(&changed).contains("changed after it was fitted"), "{}", refused(&changed));
        let falls = text.replacen("[0, 3, 6,", "[0, 9, 6,", 1);
        assert!(refused(&falls).contains("falls with the grade, in azimuth 0, range 0"), "{}", refused(&falls));
        let cut = text.replacen("ranges_cm = [1000, ", "ranges_cm = [", 1);
        assert!(refused(&cut).contains("ranges_cm"), "{}", refused(&cut));
        assert!(refused(&text[..text.len() / 2]).contains("TOML"), "{}", refused(&text[..text.len() / 2]));
        assert!(refused("").contains("check_sum"));
    }
}
