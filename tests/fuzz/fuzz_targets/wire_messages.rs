#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| viewshed_fuzz::wire_messages::run(bytes));
