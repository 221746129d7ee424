//! `viewshed label` as its user meets it: the server over its socket, the page in a real browser.
//!
//! The browser is Debian's `chromium-headless-shell` (`apt-get install chromium-headless-shell`), another Chromium, or
//! the one named in `VIEWSHED_BROWSER`; without any, the tests of the page say that they skipped.

mod appearance;
#[allow(dead_code, reason = "pages of other commands need more of it")]
mod browser;
mod layouts;
mod looks;
mod offered;
mod page;
mod person;
mod plots;
mod requests;
mod server;
#[path = "../../../common/skipped.rs"]
mod skipped;
