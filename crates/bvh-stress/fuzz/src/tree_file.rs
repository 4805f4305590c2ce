//! Tree files of arbitrary bytes, unmodified and with a right checksum.

use bvh_core::cost::{self, SahConstants};
use bvh_core::file::{Header, TreeFile, load};
use bvh_core::{
    Aabb, Bvh, Node, Ray, TestCounts, Triangle, any_hit_by, collapse_leaves, nearest_hit_by,
    validate,
};
use glam::Vec3;

/// Opens the bytes after the first one as a file. The first byte selects the fields that are
/// corrected.
pub fn tree_file(bytes: &[u8]) {
    let Some((&mode, bytes)) = bytes.split_first() else { return };
    // Views need the alignment of a mapped file, and a byte further on they have none.
    let len = bytes.len();
    let mut held = vec![0; len + 65];
    let start = held.as_ptr().align_offset(64);
    let file = &mut held[start..start + len];
    file.copy_from_slice(bytes);
    if mode & 1 == 1 && len >= Header::BYTES {
        correct_header(file, mode & 2 == 2, mode & 4 == 4);
        seal(file);
    }
    opened(file);
    held.copy_within(start..start + len, start + 1);
    let moved = &held[start + 1..][..len];
    let _ = TreeFile::open(moved).map(|file| (file.view().is_ok(), file.tree().is_ok()));
}

/// Gives a file the right magic bytes and, on request, visits, and as many objects as fit its
/// length.
fn correct_header(bytes: &mut [u8], counts: bool, visits: bool) {
    bytes[..8].copy_from_slice(&Header::MAGIC);
    bytes[8..12].copy_from_slice(&Header::VERSION.to_le_bytes());
    bytes[12..16].copy_from_slice(&[4, 3, 2, 1]);
    if counts {
        let nodes = u64::from(bytes[24]);
        let rest = (bytes.len() - Header::BYTES) as u64;
        let objects = rest.saturating_sub(nodes * if visits { 36 } else { 32 }) / 4;
        // Each object has one reference.
        for (at, count) in [(24, nodes), (32, objects), (168, objects)] {
            bytes[at..at + 8].copy_from_slice(&count.to_le_bytes());
        }
    }
    bytes[176..180].copy_from_slice(&u32::from(visits).to_le_bytes());
}

/// Writes the CRC-32, computed bit by bit from its definition, over the bytes that `bvh_core::file`
/// documents.
fn seal(file: &mut [u8]) {
    let covered = file[Header::BYTES..].iter().chain(&file[..188]);
    let sum = !covered.fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ (0xedb8_8320 * (sum & 1)))
    });
    file[188..192].copy_from_slice(&sum.to_le_bytes());
}

fn opened(bytes: &[u8]) {
    let file = match TreeFile::open(bytes) {
        Ok(file) => file,
        Err(error) => {
            assert!(load(bytes, &[]).is_err(), "{error}");
            return;
        }
    };
    let objects = file.header().objects;
    if let Ok(Some(visits)) = file.visits() {
        assert!(
            visits.len() == file.header().nodes
                && visits.iter().all(|part| (0.0..=1.0).contains(part))
        );
    }
    assert_eq!([file.tree().is_ok(), file.view().is_ok()], [file.tree().is_ok(); 2]);
    if let (Ok(tree), Ok(view)) = (file.tree(), file.view()) {
        assert!(tree.nodes == view.nodes && tree.prim_ids == view.prim_ids);
        // Equal numbers may be zeros of different signs.
        assert_eq!(bits(&tree.nodes), bits(view.nodes));
        traced(&tree, objects);
        measured(tree, objects);
    }
}

fn bits(nodes: &[Node]) -> Vec<u32> {
    let corners = nodes.iter().flat_map(|node| [node.aabb.min, node.aabb.max]);
    corners.flat_map(|corner| corner.to_array()).map(f32::to_bits).collect()
}

fn rays() -> impl Iterator<Item = Ray> {
    let origins = [Vec3::ZERO, Vec3::new(0.5, 5.0, -3.0), Vec3::splat(-1e30)];
    let directions = [Vec3::X, Vec3::new(0.0, -1.0, 0.5), Vec3::ONE];
    origins
        .into_iter()
        .flat_map(move |from| directions.map(|to| Ray::half_line(from, to)))
        .flatten()
}

/// Checks that every traversal ends, tests only existing objects, and none twice.
fn traced(tree: &Bvh, objects: usize) {
    for ray in rays() {
        let mut counts = TestCounts::default();
        let seen = |id: u32, _: f32| -> Option<f32> {
            assert!((id as usize) < objects);
            None
        };
        assert_eq!(nearest_hit_by(tree, &ray, seen, &mut counts), None);
        assert!(!any_hit_by(tree, &ray, |id| seen(id, 0.0).is_some(), &mut ()));
        assert!(counts.objects <= objects as u64 && counts.boxes <= tree.nodes.len() as u64);
    }
}

/// Checks that costs, refitting and conversions succeed for any boxes.
fn measured(mut tree: Bvh, objects: usize) {
    let constants = SahConstants::default();
    let costs =
        [cost::internal_area(&tree), cost::goldsmith_salmon(&tree), cost::sah(&tree, &constants)];
    assert!(cost::over_root_area(&tree, costs[0]).is_nan() || tree.depth() <= tree.nodes.len());
    let merged = collapse_leaves(&tree, &constants);
    assert_eq!(merged.prim_ids.len(), objects);
    let boxes: Vec<Aabb> = (0..objects).map(|at| Aabb::around([Vec3::splat(at as f32)])).collect();
    let _ = validate(&tree, &boxes);
    tree.refit(&boxes);
    assert_eq!(validate(&tree, &boxes), Ok(()));
    let triangles: Vec<Triangle> = boxes.iter().map(|b| Triangle([b.min; 3])).collect();
    assert!(bvh_core::WideBvh::new(&tree, &triangles).is_ok());
}
