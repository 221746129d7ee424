//! A table's text file (TOML) as units and the harness read it: the table, and what it was counted from.

use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};
use viewshed::probability::{AZIMUTHS, Counted, Edges, GRADES, ProbabilityTable, RANGES};

/// The file's keys.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Content {
    /// CRC-32 of the table's bytes as a unit stores them, hexadecimal.
    pub check_sum: String,
    /// Configuration it was fitted with, hexadecimal.
    pub fingerprint: String,
    /// Least grade of each step but the first.
    pub grades: [u8; GRADES - 1],
    pub ranges_cm: [u16; RANGES - 1],
    /// 2^-16 turn from the boresight, + left.
    pub azimuths: [i16; AZIMUTHS - 1],
    /// In 1/255: azimuths from right to left, ranges from near to far, steps of the grade.
    pub values: [[[u8; GRADES]; RANGES]; AZIMUTHS],
    /// Of the samples of fitting, by tables fitted without them: p in 1/255, detected, missed.
    pub counted: Vec<[u64; 3]>,
}

/// As the file has it.
pub fn sum(table: &ProbabilityTable) -> String {
    format!("{:08x}", table.check_sum())
}

/// # Errors
/// The key, with its line, of what cannot be read or is cut off; a check sum that does not hold; a table that the
/// library refuses, with its reason.
pub fn parse(text: &str) -> Result<(ProbabilityTable, Box<Counted>)> {
    let content: Content = toml::from_str(text)?;
    let unit = u32::from_str_radix(&content.fingerprint, 16)
        .with_context(|| format!("`fingerprint` is `{}`, not 8 hexadecimal digits", content.fingerprint))?;
    let edges = Edges { grades: content.grades, ranges_cm: content.ranges_cm, azimuths: content.azimuths };
    let table = ProbabilityTable::new(edges, content.values, unit)?;
    let found = sum(&table);
    ensure!(
        found == content.check_sum,
        "`check_sum` is {}, the table's is {found}: it was changed after it was fitted; fit it again",
        content.check_sum
    );
    let mut counted: Box<Counted> = Box::new([[0; 2]; 256]);
    for [p, detected, missed] in content.counted {
        let slot = usize::try_from(p).ok().and_then(|slot| counted.get_mut(slot));
        let [all_detected, all_missed] = slot.with_context(|| format!("`counted` has p = {p}, which is above 255"))?;
        *all_detected += detected;
        *all_missed += missed;
    }
    Ok((table, counted))
}
