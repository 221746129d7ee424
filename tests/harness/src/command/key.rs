//! `--key` and `--key-file`: the key of authenticated messages.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use super::options::given;
use crate::bus::ears::Key;

/// Where the key comes from.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Authentication")]
pub struct KeyArgs {
    /// Key of authenticated messages (AES-128-CMAC), 32 hexadecimal digits
    ///
    /// Others on this machine can read the command line: for a real key take --key-file.
    #[arg(long, value_name = "HEX", conflicts_with = "key_file")]
    key: Option<String>,
    /// File with the key: 32 hexadecimal digits, or 16 bytes
    #[arg(long, value_name = "FILE")]
    key_file: Option<PathBuf>,
}

impl KeyArgs {
    /// The file the key is read from.
    pub fn file(&self) -> Option<PathBuf> {
        self.key_file.clone()
    }

    /// The options that are given.
    pub fn given(&self) -> Vec<&'static str> {
        given([("--key", self.key.is_some()), ("--key-file", self.key_file.is_some())])
    }

    /// The key, if one is given.
    ///
    /// # Errors
    /// A file that cannot be read, and what is no key.
    pub fn key(&self) -> Result<Option<Key>> {
        if let Some(text) = &self.key {
            return Ok(Some(digits(text).context("--key: not 32 hexadecimal digits")?));
        }
        let Some(path) = &self.key_file else { return Ok(None) };
        let bytes = std::fs::read(path).with_context(|| format!("cannot read the key {}", path.display()))?;
        if let Some(key) = std::str::from_utf8(&bytes).ok().and_then(digits) {
            return Ok(Some(key));
        }
        match bytes.try_into() {
            Ok(key) => Ok(Some(key)),
            Err(_) => bail!("{} is no key: neither 32 hexadecimal digits nor 16 bytes", path.display()),
        }
    }
}

fn digits(text: &str) -> Option<Key> {
    let text = text.trim();
    if text.len() != 32 || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    u128::from_str_radix(text, 16).ok().map(u128::to_be_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_digits_or_bytes() {
        let folder = std::env::temp_dir().join(format!("viewshed-key-{}", std::process::id()));
        let from_file = |content: &[u8]| {
            std::fs::write(&folder, content).unwrap();
            KeyArgs { key: None, key_file: Some(folder.clone()) }.key()
        };
        let expected: Key = std::array::from_fn(|i| i as u8 * 17);
        let text = "00112233445566778899AABBCCDDEEFF";
        assert_eq!(KeyArgs { key: Some(text.to_lowercase()), key_file: None }.key().unwrap(), Some(expected));
        assert_eq!(from_file(format!("{text}\n").as_bytes()).unwrap(), Some(expected));
        assert_eq!(from_file(&expected).unwrap(), Some(expected));
        assert!(from_file(&expected[1..]).is_err());
        assert!(KeyArgs { key: Some("+".repeat(32)), key_file: None }.key().is_err());
        assert_eq!(KeyArgs::default().key().unwrap(), None);
        std::fs::remove_file(&folder).unwrap();
    }
}
