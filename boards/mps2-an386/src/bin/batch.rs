//! Batch mode: the estimator over every scan of a job file, a fingerprint of each map and its messages, and what it cost.
#![no_std]
#![no_main]

emulated::batch!(mps2_an386, mps2_an386::Core::start());

#[cortex_m_rt::entry]
fn main() -> ! {
    batch()
}
