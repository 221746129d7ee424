//! Batch mode: the estimator over every scan of a job file, a fingerprint of each map and its messages.
#![no_std]
#![no_main]

emulated::batch!(zcu102_r5, zcu102_r5::Core);

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    batch()
}
