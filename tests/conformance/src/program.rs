//! A receiver that is a program: fed on standard input, answering on standard output.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// A program and its arguments.
#[derive(Debug, Clone)]
pub struct Program(Vec<String>);

impl Program {
    /// From a command line whose words are separated by spaces.
    pub fn new(words: &str) -> Self {
        Self(words.split_whitespace().map(str::to_owned).collect())
    }

    /// From a program and its arguments.
    pub fn of(words: impl IntoIterator<Item = PathBuf>) -> Self {
        Self(words.into_iter().map(|word| word.to_string_lossy().into_owned()).collect())
    }

    /// Feeds lines; what was answered.
    ///
    /// # Errors
    /// It cannot be started, or fails.
    pub fn answers(&self, lines: String) -> Result<String> {
        let [program, arguments @ ..] = &self.0[..] else { bail!("no program is named") };
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot run {program}"))?;
        let mut input = child.stdin.take().context("a pipe to its standard input")?;
        // a program that gives up closes its input; its status says so
        let feeding = std::thread::spawn(move || drop(input.write_all(lines.as_bytes())));
        let output = child.wait_with_output().with_context(|| format!("cannot read what {program} answers"))?;
        let _ = feeding.join();
        if !output.status.success() {
            bail!("{} ended with {}", self.0.join(" "), output.status);
        }
        String::from_utf8(output.stdout).with_context(|| format!("{program} answers something that is no text"))
    }
}
