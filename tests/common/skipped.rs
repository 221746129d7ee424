//! How a test says that it was skipped, and what of it.

use std::io::Write;

/// Says that this machine lacks what a test needs: the line `skipped: LACK: WHAT`, which `tests/all.sh` counts. `lack` is
/// one word, by which `.ci/skips` may permit it.
pub fn skipped(lack: &str, what: &str) {
    // past the capture of the test runner, and in one piece, as other tests write meanwhile
    let _ = std::io::stderr().write_all(format!("skipped: {lack}: {what}\n").as_bytes());
}
