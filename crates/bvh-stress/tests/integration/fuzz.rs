//! The fuzz targets on a stable compiler: the kept inputs and mutations of them.
//!
//! `FUZZ_SECONDS=600 cargo test -p bvh-stress --test integration NAME` runs for longer, each time
//! with different mutations. An input that breaks a promise is printed; a file in
//! `fuzz/corpus/NAME` keeps it as a test.

#[path = "../../fuzz/src/lib.rs"]
mod targets;

use bvh_search::Stream;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

fn files(folder: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().filter(|path| path.is_file()).map(|path| fs::read(path).unwrap()).collect()
}

/// Makes one to eight changes: bits, bytes, special words, numbers, and pieces that are cut,
/// repeated, or copied from another input.
fn mutated(inputs: &[Vec<u8>], rng: &mut Stream) -> Vec<u8> {
    const WORDS: [u32; 10] = [
        0,
        1,
        1 << 31,
        u32::MAX,
        0x7f80_0000,
        0xff80_0000,
        0x7fc0_0000,
        0x7f7f_ffff,
        0xff7f_ffff,
        0x3f80_0000,
    ];
    // Kept inputs are nearly valid, so that mutations pass the first checks and reach the deeper
    // ones.
    let mut bytes = inputs.choose(rng).cloned().unwrap_or_default();
    for _ in 0..rng.random_range(1..=8) {
        let start = rng.random_range(0..=bytes.len());
        let end = rng.random_range(start..=bytes.len().min(start + 40));
        match rng.random_range(0..8) {
            0 => bytes.insert(start, rng.random()),
            1 => drop(bytes.drain(start..end)),
            2 => {
                let piece = bytes[start..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            3 => {
                let other = inputs.choose(rng).cloned().unwrap_or_default();
                let from = rng.random_range(0..=other.len());
                let piece = &other[from..other.len().min(from + 40)];
                bytes.splice(start..end, piece.iter().copied());
            }
            4 => {
                let word = WORDS.choose(rng).unwrap().to_le_bytes();
                for (old, new) in bytes[start..].iter_mut().zip(word) {
                    *old = new;
                }
            }
            5 => {
                let numbers = ["-1", "0", "nan", "1e39", "18446744073709551616"];
                let number = numbers.choose(rng).unwrap();
                if let Some(digit) = bytes[start..].iter().position(u8::is_ascii_digit) {
                    bytes.splice(start + digit..=start + digit, number.bytes());
                }
            }
            6 => {
                if let Some(byte) = bytes.get_mut(start) {
                    *byte ^= 1 << rng.random_range(0..8);
                }
            }
            _ => {
                for byte in bytes[start..].iter_mut().take(4) {
                    *byte = rng.random();
                }
            }
        }
    }
    bytes
}

/// Runs a target on the kept inputs and on `count` mutations, or for `FUZZ_SECONDS`.
fn run(name: &str, count: usize) {
    let (_, target) = targets::TARGETS.into_iter().find(|(known, _)| *known == name).unwrap();
    let check = |bytes: &[u8]| {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| target(bytes))) {
            let input = bytes.escape_ascii();
            eprintln!("{name} broke a promise for the {} bytes \"{input}\"", bytes.len());
            resume_unwind(panic);
        }
    };
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(name);
    let inputs = [files(&corpus), vec![Vec::new()]].concat();
    inputs.iter().for_each(|input| check(input));
    let seconds: Option<u64> =
        std::env::var("FUZZ_SECONDS").ok().and_then(|seconds| seconds.parse().ok());
    let start = Instant::now();
    // Commits are tested with the same mutations each time, long runs with new ones.
    let seed = match seconds {
        Some(_) => SystemTime::UNIX_EPOCH.elapsed().unwrap().as_nanos() as u64,
        None => 1,
    };
    let mut rng = Stream::seed_from_u64(seed);
    let mut executions = 0;
    while match seconds {
        Some(seconds) => start.elapsed() < Duration::from_secs(seconds),
        None => executions < count,
    } {
        check(&mutated(&inputs, &mut rng));
        executions += 1;
    }
    let inputs = inputs.len();
    eprintln!("{name}: {inputs} inputs and {executions} mutations in {:.1?}", start.elapsed());
}

#[test]
fn every_method_survives_boxes_of_any_bits() {
    run("boxes", 300);
}

#[test]
fn any_bytes_are_a_mesh_file_or_rejected() {
    run("mesh", 20_000);
}

#[test]
fn any_bytes_are_a_tree_file_or_rejected() {
    run("tree_file", 20_000);
}

#[test]
fn any_ray_is_answered_by_every_traversal_as_by_brute_force() {
    run("rays", 3000);
}

#[test]
fn every_target_has_inputs_and_a_fuzzer() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let mut bytes = 0;
    for (name, _) in targets::TARGETS {
        let inputs = files(&folder.join("corpus").join(name));
        assert!(!inputs.is_empty(), "{name}");
        bytes += inputs.iter().map(Vec::len).sum::<usize>();
        let fuzzer =
            fs::read_to_string(folder.join("fuzz_targets").join(name).with_extension("rs"))
                .unwrap();
        assert!(fuzzer.contains(&format!("targets::{name}(bytes)")));
    }
    assert!(bytes < 20_000, "the kept inputs are small: {bytes} bytes");
}
