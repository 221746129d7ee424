#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| viewshed_fuzz::ars408::run(bytes));
