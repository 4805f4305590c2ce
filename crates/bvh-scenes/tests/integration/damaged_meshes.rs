//! Any bytes give a mesh or an error that names its place.

use crate::samples::{error, glb, read, samples, stl_binary};
use bvh_scenes::load::orient;
use glam::DMat3;
use proptest::prelude::*;
use std::path::Path;

#[test]
fn malicious_files_are_rejected() {
    for length in [0, 1, u32::MAX - 3, u32::MAX] {
        let mut bytes = glb();
        bytes[12..16].copy_from_slice(&length.to_le_bytes());
        error(bytes, "a.glb");
    }
    for length in [13, glb().len() - 60, glb().len() - 1] {
        let message = error(&glb()[..length], "a.glb");
        let cut = format!("cut: {length} of {} bytes", glb().len());
        assert!(message.contains(&cut), "{message}");
    }
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    error(format!(r#"{{"asset": {deep}}}"#), "a.gltf");
    // The length of the list is 2³² − 1.
    let list = "ply\nformat binary_little_endian 1.0\nelement face 1\n\
                property list uint int vertex_indices\nend_header\n";
    error([list.as_bytes(), &[255; 8]].concat(), "a.ply");
    let mut stl = stl_binary();
    stl[80..84].copy_from_slice(&(u32::MAX - 1).to_le_bytes());
    assert!(error(&stl, "a.stl").contains("4294967294"));
}

#[test]
fn cut_files_give_a_mesh_or_an_error() {
    for (name, _, bytes) in samples() {
        for length in 0..bytes.len() {
            check(&bytes[..length], name);
        }
    }
}

/// Turns the bytes, which may be an error, and asserts that they give an error, or a mesh with
/// triangles that are all finite.
fn check(bytes: &[u8], name: &str) {
    let find = &mut |_: usize, _: &[_]| Some(DMat3::from_rotation_x(1.0));
    let _ = orient(bytes, Path::new(name), Path::new(name), find);
    if let Ok(mesh) = read(bytes, name) {
        assert!(!mesh.triangles.is_empty());
        assert!(mesh.triangles.iter().flat_map(|t| t.0).all(|corner| corner.is_finite()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn damaged_files_give_a_mesh_or_an_error(
        which in 0usize..8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
        digits in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 0..5),
    ) {
        let (name, _, original) = samples()[which].clone();
        let mut bytes = original.clone();
        for (place, byte) in changes {
            bytes[place.index(original.len())] = byte;
        }
        check(&bytes, name);
        // Wrong digits leave a file well formed, so that deeper checks see its numbers.
        let mut bytes = original;
        let numbers: Vec<usize> =
            (0..bytes.len()).filter(|&index| bytes[index].is_ascii_digit()).collect();
        for (place, digit) in digits.iter().filter(|_| !numbers.is_empty()) {
            bytes[numbers[place.index(numbers.len())]] = *digit;
        }
        check(&bytes, name);
    }
}
