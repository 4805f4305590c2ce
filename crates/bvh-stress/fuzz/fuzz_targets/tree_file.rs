//! `cargo fuzz run tree_file`: see the function of that name.
#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::tree_file(bytes));
