//! The fuzz targets on a stable compiler: the kept inputs, and as many mutations of them as time allows.
//!
//! `FUZZ_SECONDS=600 cargo test -p harness --test fuzz NAME` goes on for longer, each time with other mutations. An
//! input that breaks a promise is printed; kept under `fuzz/corpus/NAME` it becomes a test for ever.

#[path = "../fuzz/src/lib.rs"]
mod targets;

use bvh_search::Stream;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

/// The files of a folder, in the order of their names.
fn files(folder: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths
        .into_iter()
        .filter(|path| path.is_file())
        .map(|path| fs::read(path).unwrap())
        .collect()
}

/// One to eight changes: bits, bytes, words that matter, numbers, and pieces cut, repeated, or taken from another
/// input.
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
    let mut bytes = inputs.choose(rng).cloned().unwrap_or_default();
    for _ in 0..rng.random_range(1..=8) {
        let at = rng.random_range(0..=bytes.len());
        let end = rng.random_range(at..=bytes.len().min(at + 40));
        match rng.random_range(0..8) {
            0 => bytes.insert(at, rng.random()),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let piece = bytes[at..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            3 => {
                let other = inputs.choose(rng).cloned().unwrap_or_default();
                let from = rng.random_range(0..=other.len());
                bytes.splice(
                    at..end,
                    other[from..other.len().min(from + 40)]
                        .iter()
                        .copied(),
                );
            }
            4 => {
                let word = WORDS
                    .choose(rng)
                    .copied()
                    .unwrap_or_default()
                    .to_le_bytes();
                bytes
                    .iter_mut()
                    .skip(at)
                    .zip(word)
                    .for_each(|(old, new)| *old = new);
            }
            5 => {
                let digit = bytes
                    .iter()
                    .skip(at)
                    .position(u8::is_ascii_digit)
                    .map(|from| at + from);
                let number = *["-1", "0", "nan", "1e39", "18446744073709551616"]
                    .choose(rng)
                    .unwrap();
                digit
                    .into_iter()
                    .for_each(|at| drop(bytes.splice(at..at + 1, number.bytes())));
            }
            6 => bytes
                .iter_mut()
                .skip(at)
                .take(1)
                .for_each(|byte| *byte ^= 1 << rng.random_range(0..8)),
            _ => bytes
                .iter_mut()
                .skip(at)
                .take(4)
                .for_each(|byte| *byte = rng.random()),
        }
    }
    bytes
}

/// Runs a target over what is kept and `count` mutations, or for as long as `FUZZ_SECONDS` says.
fn run(name: &str, count: usize, further: Vec<Vec<u8>>) {
    let (_, target) = targets::TARGETS
        .into_iter()
        .find(|(known, _)| *known == name)
        .unwrap();
    let holds = |bytes: &[u8]| {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| target(bytes))) {
            eprintln!(
                "{name} broke a promise for the {} bytes \"{}\"",
                bytes.len(),
                bytes.escape_ascii()
            );
            resume_unwind(panic);
        }
    };
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/corpus")
        .join(name);
    let inputs = [files(&corpus), further, vec![Vec::new()]].concat();
    inputs.iter().for_each(|input| holds(input));
    let seconds = std::env::var("FUZZ_SECONDS")
        .ok()
        .and_then(|seconds| seconds.parse().ok());
    let start = Instant::now();
    let seed = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let mut rng = Stream::seed_from_u64(
        seconds
            .and(seed.ok())
            .map_or(1, |since| since.as_nanos() as u64),
    );
    let mut executions = 0;
    while seconds.map_or(executions < count, |s: u64| start.elapsed() < Duration::from_secs(s)) {
        holds(&mutated(&inputs, &mut rng));
        executions += 1;
    }
    eprintln!(
        "{name}: {} inputs and {executions} mutations in {:.1?}",
        inputs.len(),
        start.elapsed()
    );
}

#[test]
fn every_method_survives_boxes_of_any_bits() {
    run("boxes", 300, vec![]);
}

#[test]
fn any_bytes_are_an_obj_file_or_refused() {
    run("obj", 20_000, vec![]);
}

#[test]
fn any_bytes_are_a_spec_or_refused() {
    run("spec", 1000, files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments")));
}

#[test]
fn any_bytes_are_a_tree_file_or_refused() {
    run("tree_file", 20_000, vec![]);
}

#[test]
fn any_ray_is_answered_by_every_traversal_as_by_brute_force() {
    run("rays", 3000, vec![]);
}

#[test]
fn every_target_has_inputs_and_a_fuzzer() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let mut bytes = 0;
    for (name, _) in targets::TARGETS {
        let inputs = files(&folder.join("corpus").join(name));
        assert!(!inputs.is_empty(), "{name}");
        bytes += inputs.iter().map(Vec::len).sum::<usize>();
        let fuzzer = fs::read_to_string(
            folder
                .join("fuzz_targets")
                .join(name)
                .with_extension("rs"),
        )
        .unwrap();
        assert!(fuzzer.contains(&format!("targets::{name}(bytes)")));
    }
    assert!(bytes < 20_000, "the kept inputs are small: {bytes} bytes");
}
