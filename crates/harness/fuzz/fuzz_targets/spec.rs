//! `cargo fuzz run spec`: see the function of that name.
#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::spec(bytes));
