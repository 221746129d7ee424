//! The bench over semihosting files: `job.bin` in, `answer.bin` out, in the emulator's folder.

use core::ffi::CStr;

use semihosting::fd::BorrowedFd;
use semihosting::process;
use semihosting::sys;
use semihosting::sys::arm_compat::{OpenMode, sys_open};
use viewshed::pil::Bench;

use crate::stack;

const JOB: &CStr = c"job.bin";
const ANSWER: &CStr = c"answer.bin";

/// Both files.
pub struct Files {
    job: BorrowedFd<'static>,
    answer: BorrowedFd<'static>,
}

impl Files {
    /// Opens them; `None` without a debugger or emulator that has them.
    pub fn open() -> Option<Self> {
        let job = open(JOB, OpenMode::RDONLY_BINARY)?;
        let answer = open(ANSWER, OpenMode::WRONLY_TRUNC_BINARY)?;
        Some(Self { job, answer })
    }
}

fn open(name: &CStr, mode: OpenMode) -> Option<BorrowedFd<'static>> {
    let file = sys_open(name, mode).ok()?.into_raw_fd();
    // SAFETY: open until the emulator ends
    (file != -1).then(|| unsafe { BorrowedFd::borrow_raw(file) })
}

impl Bench for Files {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        sys::read(self.job, buffer).unwrap_or(0)
    }

    fn write(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            match sys::write(self.answer, rest) {
                Ok(n) if n > 0 => rest = rest.get(n..).unwrap_or(&[]),
                _ => process::exit(3),
            }
        }
    }

    fn ticks(&mut self) -> u32 {
        0
    }

    fn ticks_per_256(&self) -> u32 {
        0 // the emulator cannot count this core's instructions
    }

    fn stack(&self) -> [u32; 2] {
        stack::used()
    }
}
