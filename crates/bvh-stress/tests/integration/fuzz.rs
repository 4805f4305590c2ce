//! The fuzz targets on a stable compiler: the kept inputs and mutations of them.
//!
//! An input that breaks a promise is printed; a file in `fuzz/corpus/NAME` keeps it as a test. The
//! fuzzers in `fuzz/` run for longer.

#[path = "../../fuzz/src/lib.rs"]
mod targets;

use bvh_search::Stream;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

fn files(folder: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().filter(|path| path.is_file()).map(|path| fs::read(path).unwrap()).collect()
}

/// Replaces one to eight pieces by nothing, bytes, special words, numbers, or pieces of another
/// input.
fn mutated(inputs: &[Vec<u8>], rng: &mut Stream) -> Vec<u8> {
    const WORDS: [f32; 8] =
        [0.0, -0.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX, f32::MIN];
    const NUMBERS: [&str; 5] = ["-1", "0", "nan", "1e39", "18446744073709551616"];
    // Kept inputs are nearly valid, so that mutations pass the first checks and reach the deeper
    // ones.
    let mut bytes = inputs.choose(rng).cloned().unwrap_or_default();
    for _ in 0..rng.random_range(1..=8) {
        let mut start = rng.random_range(0..=bytes.len());
        let piece = match rng.random_range(0..7) {
            0 => Vec::new(),
            1 => rng.random::<u32>().to_le_bytes()[..rng.random_range(1..=4)].to_vec(),
            2 => WORDS.choose(rng).unwrap().to_le_bytes().to_vec(),
            3 => rng.random_range(-1..=1i32).to_le_bytes().to_vec(),
            4 => bytes
                .get(start)
                .map(|byte| byte ^ 1 << rng.random_range(0..8))
                .into_iter()
                .collect(),
            5 => {
                let digit = bytes[start..].iter().position(u8::is_ascii_digit);
                start += digit.unwrap_or(0);
                NUMBERS.choose(rng).unwrap().as_bytes().to_vec()
            }
            _ => {
                let other = inputs.choose(rng).unwrap();
                let from = rng.random_range(0..=other.len());
                other[from..].iter().take(rng.random_range(0..=40)).copied().collect()
            }
        };
        // What has fixed places stays there only if as many bytes go as come.
        let gone = if rng.random() { piece.len() } else { rng.random_range(0..=40) };
        let end = bytes.len().min(start + gone);
        bytes.splice(start..end, piece);
    }
    bytes
}

/// Runs a target on the kept inputs and on mutations. Checks that its fuzzer runs it too.
fn run(name: &str, target: fn(&[u8])) {
    let check = |bytes: &[u8]| {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| target(bytes))) {
            let input = bytes.escape_ascii();
            eprintln!("{name} broke a promise for the {} bytes \"{input}\"", bytes.len());
            resume_unwind(panic);
        }
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let fuzzer = fs::read_to_string(folder.join(format!("fuzz_targets/{name}.rs"))).unwrap();
    assert!(fuzzer.contains(&format!("targets::{name}(bytes)")), "{fuzzer}");
    let mut inputs = files(&folder.join("corpus").join(name));
    let bytes: usize = inputs.iter().map(Vec::len).sum();
    assert!((1..10_000).contains(&bytes), "{name}: the kept inputs are small: {bytes} bytes");
    inputs.push(Vec::new());
    inputs.iter().for_each(|input| check(input));
    // The same mutations each time: a commit is judged by its change, not by luck.
    let mut rng = Stream::seed_from_u64(1);
    (0..20_000).for_each(|_| check(&mutated(&inputs, &mut rng)));
}

#[test]
fn any_bytes_are_a_mesh_file_or_rejected() {
    run("mesh", targets::mesh);
}

#[test]
fn any_bytes_are_a_tree_file_or_rejected() {
    run("tree_file", targets::tree_file);
}
