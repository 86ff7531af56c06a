#![no_main]

#[path = "../entries.rs"]
#[allow(dead_code)] // each target calls one of them
mod entries;

libfuzzer_sys::fuzz_target!(|data: &[u8]| entries::study(data));
