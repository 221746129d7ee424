//! Where a key stands in a TOML text, and which key stands at a place: for error messages.

use toml::de::{DeTable, DeValue};

/// Line, from 1, of a key written with points, as in `mount.height_m`; of the innermost table it would
/// belong to where it is not there.
pub fn line_of(text: &str, key: &str) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let (mut table, mut found) = (document.get_ref(), None);
    for part in key.split('.') {
        let Some((name, value)) = table.iter().find(|(name, _)| name.get_ref() == part) else { break };
        found = Some(name.span().start);
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => break,
        }
    }
    found.map(|at| line_at(text, at))
}

/// Line, from 1, of a byte.
pub fn line_at(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
}

/// The innermost key whose name or value covers a byte.
pub fn key_at(text: &str, at: usize) -> Option<String> {
    let document = DeTable::parse(text).ok()?;
    within(document.get_ref(), at)
}

/// A table's own place is its head only, so all tables are searched.
fn within(table: &DeTable<'_>, at: usize) -> Option<String> {
    table.iter().find_map(|(name, value)| {
        let inner = match value.get_ref() {
            DeValue::Table(inner) => within(inner, at).map(|inner| format!("{}.{inner}", name.get_ref())),
            _ => None,
        };
        let here = name.span().contains(&at) || value.span().contains(&at);
        inner.or_else(|| here.then(|| name.get_ref().to_string()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a = 1\n\n[mount]\nheight_m = 6.0 # above the road\n[input.ti]\nb = \"x\"\n";

    #[test]
    fn keys_are_found_by_name() {
        assert_eq!(line_of(TEXT, "a"), Some(1));
        assert_eq!(line_of(TEXT, "mount.height_m"), Some(4));
        assert_eq!(line_of(TEXT, "mount.pitch_deg"), Some(3), "the table it belongs to");
        assert_eq!(line_of(TEXT, "input.ti.b"), Some(6));
        assert_eq!(line_of(TEXT, "gate.min_snr_db"), None);
        assert_eq!(line_of("a = ", "a"), None);
    }

    #[test]
    fn and_by_place() {
        let at = |what| TEXT.find(what).unwrap();
        assert_eq!(key_at(TEXT, at("6.0")).as_deref(), Some("mount.height_m"));
        assert_eq!(key_at(TEXT, at("height_m")).as_deref(), Some("mount.height_m"));
        assert_eq!(key_at(TEXT, at("\"x\"")).as_deref(), Some("input.ti.b"));
        assert_eq!(line_at(TEXT, at("\"x\"")), 6);
    }
}
