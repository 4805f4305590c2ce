//! `cargo fuzz run rays`: see the function of that name.
#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::rays(bytes));
