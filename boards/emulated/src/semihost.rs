//! The emulator's files, by the core's semihosting trap.

use core::ffi::CStr;

use semihosting::fd::BorrowedFd;
use semihosting::sys;
use semihosting::sys::arm_compat::{OpenMode, sys_open};
use viewshed::bench::files;

/// An open file; it stays open until the emulator ends.
#[derive(Debug)]
pub struct HostFile(BorrowedFd<'static>);

fn opened(name: &CStr, mode: OpenMode) -> Option<HostFile> {
    let file = sys_open(name, mode).ok()?.into_raw_fd();
    // SAFETY: never closed
    (file != -1).then(|| HostFile(unsafe { BorrowedFd::borrow_raw(file) }))
}

impl files::HostFile for HostFile {
    fn open(name: &CStr) -> Option<Self> {
        opened(name, OpenMode::RDONLY_BINARY)
    }

    fn create(name: &CStr) -> Option<Self> {
        opened(name, OpenMode::WRONLY_TRUNC_BINARY)
    }

    fn read(&mut self, buffer: &mut [u8]) -> usize {
        sys::read(self.0, buffer).unwrap_or(0)
    }

    fn write(&mut self, bytes: &[u8]) -> usize {
        sys::write(self.0, bytes).unwrap_or(0)
    }
}
