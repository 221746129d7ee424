//! A progress bar on stderr; nothing where that is no terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar of `steps` for what is being done; it disappears when dropped.
pub fn bar(what: &str, steps: u64) -> Bar {
    let bar = ProgressBar::new(steps);
    // a template that does not parse leaves the library's own style
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:40}] {percent:>3} %, {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(what.to_owned());
    Bar(bar)
}

pub struct Bar(ProgressBar);

impl Bar {
    pub fn step(&self) {
        self.0.inc(1);
    }

    /// Stands at a share of its steps, 0 to 1.
    pub fn reach(&self, share: f64) {
        self.0.set_position((share * self.0.length().unwrap_or_default() as f64) as u64);
    }

    /// Says something else in front of the bar.
    pub fn say(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
