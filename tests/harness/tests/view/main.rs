//! `viewshed view` and `viewshed replay --report` as their users meet them: the server over its socket, pages in a real
//! browser, a unit behind a serial port.
//!
//! The browser is that of the tests of `viewshed label`; without any, the tests of pages say that they skipped.

mod broadcast;
#[allow(dead_code, reason = "of the tests of another page")]
#[path = "../label/browser.rs"]
mod browser;
#[cfg(target_os = "linux")]
mod emulated;
#[cfg(target_os = "linux")]
mod live;
#[path = "../label/looks.rs"]
mod looks;
mod recorded;
mod report;
#[allow(dead_code, reason = "of the tests of another page")]
#[path = "../label/server.rs"]
mod server;
#[path = "../../../common/skipped.rs"]
mod skipped;
