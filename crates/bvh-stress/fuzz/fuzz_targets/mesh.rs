//! `cargo fuzz run mesh`: see the function of that name.
#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::mesh(bytes));
