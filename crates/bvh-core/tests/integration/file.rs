//! Tree files preserve trees and reject damage, and no bytes make a traversal leave the tree.

use crate::support::layouts::{divided, framed};
use crate::support::{Random, SHAPES, boxes, grid_box, rays, soup, tree};
use bvh_core::cost::{Objective, SahConstants, call_in_turn};
use bvh_core::file::{FileError, Header, Origin, TreeFile, boxes_checksum, load, save, sections};
use bvh_core::{Aabb, Bvh, DTriangle, InvalidBvh, Primitives, nearest_hit_by};
use glam::Vec3;

fn origin() -> Origin<'static> {
    let objective = Objective::Sah(SahConstants::new(1.5, 0.25).unwrap());
    Origin { method: "best", seed: 7, work: 1 << 40, objective, visits: &[], doubles: &[] }
}

/// Makes a tree with many children per node, and several objects per leaf.
fn scene(objects: usize) -> (Vec<Aabb>, Bvh) {
    let mut random = Random(1);
    let boxes = boxes(&soup(objects, &mut random));
    let tree = tree(&boxes, SHAPES[3], &mut random);
    (boxes, tree)
}

/// Returns the file of a tree whose objects may be divided.
fn save_parts(tree: &Bvh, boxes: &[Aabb], origin: &Origin) -> Vec<u8> {
    let cost = origin.objective.cost(tree);
    sections(tree, boxes, cost, origin, &call_in_turn).unwrap().concat()
}

/// Gives a file the checksum of its bytes.
fn seal(file: &mut [u8]) {
    let covered = [&file[192..], &file[..188]].concat();
    file[188..192].copy_from_slice(&crc32fast::hash(&covered).to_le_bytes());
}

fn with_field(file: &[u8], offset: usize, field: &[u8]) -> Vec<u8> {
    let mut bytes = file.to_vec();
    bytes[offset..offset + field.len()].copy_from_slice(field);
    bytes
}

fn load_any(bytes: &[u8]) -> Result<Bvh, FileError> {
    TreeFile::open(bytes)?.tree()
}

/// Copies bytes to an address that is aligned like a mapped file.
fn aligned(bytes: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(bytes)
}

#[test]
fn a_saved_tree_can_be_loaded_and_viewed() {
    for n in [0, 1, 2, 7, 40] {
        let (boxes, tree) = scene(n);
        let bytes = save(&tree, &boxes, &origin()).unwrap();
        assert_eq!(load(&bytes, &boxes), Ok(tree.clone()));
        let held = aligned(&bytes);
        let file = TreeFile::open(bytemuck::cast_slice(&held)).unwrap().for_boxes(&boxes).unwrap();
        assert_eq!(file.view(), Ok((&tree).into()));
        let header = Header {
            nodes: tree.nodes.len(),
            objects: boxes.len(),
            references: boxes.len(),
            objective: origin().objective,
            cost: origin().objective.cost(&tree),
            seed: 7,
            work: 1 << 40,
            scene: boxes_checksum(&boxes),
            bounds: tree.root_aabb().unwrap_or(Aabb::EMPTY),
            method: "best".into(),
            has_visits: false,
            has_frame: false,
            is_double: false,
        };
        assert_eq!(file.header(), &header);
        assert_eq!(file.visits(), Ok(None));
        assert_eq!(bytes[8..12], Header::VERSION.to_le_bytes());
    }
}

#[test]
fn a_frame_comes_back_and_numbers_that_are_none_are_rejected() {
    let mut random = Random(3);
    let triangles = soup(40, &mut random);
    let tree = framed(&triangles, &mut random).unwrap();
    let boxes = boxes(&triangles);
    assert_eq!(save(&tree, &boxes, &origin()), Err(FileError::Frame));
    for visits in [&[][..], &halving(&tree)] {
        let bytes = save_parts(&tree, &boxes, &Origin { visits, ..origin() });
        assert_eq!(load(&bytes, &boxes).as_ref(), Ok(&tree));
        let held = aligned(&bytes);
        let file = TreeFile::open(bytemuck::cast_slice(&held)).unwrap();
        assert_eq!(file.frame(), tree.frame.as_ref());
        assert_eq!(file.view(), Ok((&tree).into()));
        let first = bytes.len() - 96;
        for (offset, number) in [
            (0, 2.0),
            (8, f64::NAN),
            (64, f64::INFINITY),
            (72, f64::NAN),
            (80, f64::INFINITY),
            (88, 1e39),
        ] {
            let mut forged = with_field(&bytes, first + offset, &number.to_le_bytes());
            seal(&mut forged);
            assert_eq!(load_any(&forged), Err(FileError::Field("frame")), "{offset}: {number}");
        }
        // A mirror: the first row with the other sign.
        let mut mirrored = bytes.clone();
        for x in 0..3 {
            mirrored[first + 8 * x + 7] ^= 0x80;
        }
        seal(&mut mirrored);
        assert_eq!(load_any(&mirrored), Err(FileError::Field("frame")));
        let mut shorter = bytes[..first].to_vec();
        seal(&mut shorter);
        assert!(matches!(load_any(&shorter), Err(FileError::Length { .. })));
    }
}

#[test]
fn a_tree_with_divided_objects_comes_back_and_is_not_saved_as_one_without() {
    let mut random = Random(2);
    let triangles = soup(40, &mut random);
    let boxes = boxes(&triangles);
    let (tree, planes) = divided(&tree(&boxes, SHAPES[0], &mut random), &triangles, &mut random);
    let references = tree.prim_ids.len();
    assert!(references == 40 + planes.len() && planes.len() > 10);
    let origin = Origin { objective: Objective::Layout, ..origin() };
    let bytes = save_parts(&tree, &boxes, &origin);
    assert_eq!(TreeFile::open(&bytes).unwrap().header().references, references);
    let wrong_count = InvalidBvh::ObjectCount { named: references, objects: 40 };
    assert_eq!(save(&tree, &boxes, &origin), Err(wrong_count.into()));
    assert_eq!(load(&bytes, &boxes), Ok(tree));
}

fn halving(tree: &Bvh) -> Vec<f32> {
    let mut visits = vec![1.0; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        for child in node.children() {
            visits[child] = visits[index] / 2.0;
        }
    }
    visits
}

#[test]
fn visits_come_back_and_only_those_of_a_monotone_measure_are_accepted() {
    for n in [1, 2, 11, 3000] {
        let (boxes, tree) = scene(n);
        let visits = halving(&tree);
        let save_with = |visits: &[f32]| save(&tree, &boxes, &Origin { visits, ..origin() });
        let mut bytes = save_with(&visits).unwrap();
        let file = TreeFile::open(&bytes).unwrap();
        assert_eq!(file.tree().as_ref(), Ok(&tree));
        assert_eq!(file.visits(), Ok(Some(visits.clone())));
        for cut in 1..=4 {
            let shorter = TreeFile::open(&bytes[..bytes.len() - cut]);
            assert!(matches!(shorter, Err(FileError::Length { .. })));
        }
        let ids = 192 + size_of_val(&tree.nodes[..]);
        for position in [40, 192, ids, bytes.len() - 1] {
            let damaged = with_field(&bytes, position, &[bytes[position] ^ 1]);
            assert_eq!(TreeFile::open(&damaged).unwrap_err(), FileError::Checksum, "{position}");
        }
        let last = visits.len() - 1;
        for wrong in [-1.0, 1.5, f32::NAN, f32::INFINITY] {
            let mut wrong_visits = visits.clone();
            wrong_visits[last] = wrong;
            assert_eq!(save_with(&wrong_visits), Err(FileError::Visits(last)));
            let end = bytes.len();
            bytes[end - 4..].copy_from_slice(&wrong.to_le_bytes());
            seal(&mut bytes);
            let forged = TreeFile::open(&bytes).unwrap();
            assert_eq!(forged.visits(), Err(FileError::Visits(last)));
            assert_eq!(forged.tree().as_ref(), Ok(&tree), "the tree itself is sound");
        }
        // A tree of one node is saved without visits.
        assert_eq!(save_with(&visits[..last]).is_ok(), last == 0);
    }
}

#[test]
fn checksums_are_the_crc_32_that_other_programs_compute() {
    // In Python: zlib.crc32(struct.pack("<12f", 0, 0, 0, 1, 1, 1, 2, 0, 0, 3, 1, 1)).
    let boxes = [Aabb::from([[0.0; 3], [1.0; 3]]), Aabb::from([[2.0, 0.0, 0.0], [3.0, 1.0, 1.0]])];
    assert_eq!(boxes_checksum(&boxes), 0x3806_b19d);
    let (boxes, tree) = scene(5);
    let bytes = save(&tree, &boxes, &origin()).unwrap();
    let mut sealed = with_field(&bytes, 188, &[0; 4]);
    seal(&mut sealed);
    assert_eq!(sealed, bytes);
}

#[test]
fn a_tree_is_for_all_boxes_that_equal_those_it_was_built_over() {
    let boxes = boxes(&grid_box(8));
    let tree = tree(&boxes, SHAPES[0], &mut Random(3));
    let signed = |corner: Vec3| Vec3::select(corner.cmpeq(Vec3::ZERO), -Vec3::ZERO, corner);
    let mirrored: Vec<Aabb> =
        boxes.iter().map(|b| Aabb { min: signed(b.min), max: signed(b.max) }).collect();
    assert_eq!(mirrored, boxes);
    let bytes = save(&tree, &mirrored, &origin()).unwrap();
    assert_eq!(load(&bytes, &boxes), Ok(tree));
    assert_eq!(boxes_checksum(&mirrored), boxes_checksum(&boxes));
}

#[test]
fn a_tree_over_triangles_in_f64_is_for_no_others_in_the_same_boxes() {
    let scene = |z: f64| {
        let corners = |x: f64| DTriangle::from([[x, 0.0, z], [x + 1.0, 0.0, 5.1], [x, 1.0, 5.3]]);
        Primitives::Doubles(vec![corners(0.0), corners(2.1)])
    };
    let (ours, others) = (scene(5.2), scene(5.2 + 1e-9));
    let boxes = ours.boxes();
    assert_eq!(others.boxes(), boxes);
    let tree = tree(&boxes, SHAPES[0], &mut Random(3));
    let Primitives::Doubles(doubles) = &ours else { unreachable!() };
    let bytes = save(&tree, &boxes, &Origin { doubles, ..origin() }).unwrap();
    let file = TreeFile::open(&bytes).unwrap();
    let opened = |objects: Option<&Primitives>| file.clone().for_objects(&boxes, objects).map(drop);
    assert!(file.header().is_double);
    assert_eq!(opened(Some(&ours)), Ok(()));
    assert!(matches!(opened(Some(&others)), Err(FileError::OtherScene { .. })));
    assert_eq!(opened(None), Err(FileError::Double));
    let single = Primitives::Triangles(Vec::new());
    assert_eq!(opened(Some(&single)), Err(FileError::Double));
    // In Python, as below, and then struct.pack("<18d", …) of the corners.
    let corners = bytemuck::cast_slice(doubles);
    let checksum = crc32fast::hash(&[bytemuck::cast_slice(&boxes), corners].concat());
    assert_eq!(file.header().scene, checksum);
    // Files of earlier programs identify the boxes only.
    let older = save(&tree, &boxes, &origin()).unwrap();
    let older = TreeFile::open(&older).unwrap();
    assert!(
        older.clone().for_objects(&boxes, Some(&ours)).is_ok() && older.for_boxes(&boxes).is_ok()
    );
}

#[test]
fn each_foreign_file_version_and_scene_has_its_error() {
    let (boxes, tree) = scene(5);
    let bytes = save(&tree, &boxes, &origin()).unwrap();
    let longer = [&bytes[..], &[0; 8]].concat();
    for length in (0..bytes.len()).chain(bytes.len() + 1..=longer.len()) {
        assert!(TreeFile::open(&longer[..length]).is_err(), "cut or extended to {length}");
    }
    let changed =
        |offset, field: &[u8]| TreeFile::open(&with_field(&bytes, offset, field)).unwrap_err();
    assert_eq!(changed(0, b"v 0 0 0\n"), FileError::Magic);
    for found in [3, 5] {
        assert_eq!(changed(8, &u32::to_le_bytes(found)), FileError::Version { found });
    }
    assert_eq!(changed(12, &[1, 2, 3, 4]), FileError::Field("endianness mark"));
    assert_eq!(changed(32, &u64::MAX.to_le_bytes()), FileError::Field("objects"));
    let short = FileError::Length { found: bytes.len() as u64, expected: 192 + 3 * 32 + 5 * 4 };
    assert_eq!(changed(24, &3u64.to_le_bytes()), short);

    let mut moved = boxes.clone();
    moved[3].max.z = moved[3].max.z.next_up();
    let mut swapped = boxes.clone();
    swapped.swap(0, 3);
    for others in [moved, swapped] {
        assert!(matches!(load(&bytes, &others), Err(FileError::OtherScene { .. })));
    }
    assert_eq!(load(&bytes, &boxes[..4]), Err(FileError::ObjectCount { found: 4, expected: 5 }));
}

#[test]
fn fields_that_no_save_writes_are_rejected_even_with_a_correct_checksum() {
    let (boxes, tree) = scene(5);
    let file = save(&tree, &boxes, &origin()).unwrap();
    let empty = save(&Bvh::default(), &[], &Origin::default()).unwrap();
    let rejection = |file: &[u8], offset: usize, field: &[u8]| {
        let mut bytes = with_field(file, offset, field);
        seal(&mut bytes);
        load_any(&bytes).unwrap_err()
    };
    for wrong in [f64::NAN, f64::INFINITY, -1.0].map(f64::to_le_bytes) {
        assert_eq!(rejection(&file, 56, &wrong), FileError::Field("cost"));
        assert_eq!(rejection(&file, 64, &wrong), FileError::Field("constants"));
    }
    // The internal area has no constants.
    assert_eq!(rejection(&empty, 72, &1f64.to_le_bytes()), FileError::Field("constants"));
    let root = FileError::Field("box of the root");
    for offset in [80, 84, 100] {
        for wrong in [f32::NAN, f32::INFINITY, 0.25].map(f32::to_le_bytes) {
            assert_eq!(rejection(&file, offset, &wrong), root);
        }
        assert_eq!(rejection(&empty, offset, &0.25f32.to_le_bytes()), root);
    }
    assert_eq!(rejection(&file, 104, b"be\0t"), FileError::Field("padding"));
    assert_eq!(rejection(&file, 187, &[1]), FileError::Field("padding"));
    let infinite_box = rejection(&file, 192 + 32 + 12, &f32::INFINITY.to_le_bytes());
    assert!(matches!(infinite_box, FileError::Tree(InvalidBvh::Box { node: 1, .. })));
}

#[test]
fn long_names_wrong_trees_and_misaligned_views_are_rejected() {
    let (boxes, tree) = scene(7);
    let save_as = |method: &str| save(&tree, &boxes, &Origin { method, ..origin() });
    assert!(save_as(&"é".repeat(32)).is_ok());
    assert_eq!(save_as(&"é".repeat(33)), Err(FileError::Method));
    assert_eq!(save_as("a\0b"), Err(FileError::Method));
    let wrong_count = save(&tree, &boxes[1..], &origin());
    assert!(matches!(wrong_count, Err(FileError::Tree(InvalidBvh::ObjectCount { .. }))));
    let bytes = save(&tree, &boxes, &origin()).unwrap();
    let held = aligned(&[&[0], &bytes[..]].concat());
    let beside = &bytemuck::cast_slice(&held)[1..][..bytes.len()];
    let misaligned = TreeFile::open(beside).unwrap();
    assert_eq!(misaligned.view(), Err(FileError::Alignment(4)));
    assert_eq!(misaligned.tree(), Ok(tree));
}

#[test]
fn a_tree_whose_boxes_do_not_contain_its_objects_is_rejected_with_any_checksum() {
    let mut random = Random(5);
    let triangles = soup(40, &mut random);
    let boxes = boxes(&triangles);
    let whole = tree(&boxes, SHAPES[0], &mut random);
    let (parts, _) = divided(&whole, &triangles, &mut random);
    let turned = framed(&triangles, &mut random).unwrap();
    let shapes = Primitives::Triangles(triangles);
    let point = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
    let one_point = (1..whole.nodes.len()).map(|index| (&whole, index..index + 1));
    let all_points = [&whole, &parts, &turned].map(|tree| (tree, 1..tree.nodes.len()));
    for (tree, forged) in one_point.chain(all_points) {
        let over = |tree: &Bvh, objects| {
            let bytes = save_parts(tree, &boxes, &origin());
            TreeFile::open(&bytes).unwrap().tree_over(&boxes, objects, &call_in_turn)
        };
        assert_eq!(over(tree, Some(&shapes)).as_ref(), Ok(tree));
        let mut other = tree.clone();
        other.nodes[forged.clone()].iter_mut().for_each(|node| node.aabb = point);
        assert!(matches!(over(&other, Some(&shapes)), Err(FileError::Tree(_))), "{forged:?}");
        // Without their corners, nobody knows the boxes of triangles in a frame.
        let by_boxes = over(&other, None);
        assert!(by_boxes.is_err() || tree.frame.is_some(), "{forged:?}");
    }
}

/// Words that are likely to do damage: small indices, with and without the flag of leaves, huge
/// ones, and extreme floats.
fn forged_words() -> Vec<u32> {
    let floats = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN, f32::MAX, 0.0];
    let mut words = vec![1 << 30, 1 << 31, u32::MAX, u32::MAX - 1];
    words.extend(floats.map(f32::to_bits));
    for index in 0..24 {
        words.extend([index, index | 1 << 31]);
    }
    words
}

#[test]
fn a_forged_file_is_rejected_or_can_be_traced_to_the_end() {
    let mut random = Random(4);
    let triangles = soup(11, &mut random);
    let boxes = boxes(&triangles);
    let rays = rays(&triangles, 24, &mut random);
    let [wide, binary] = [3, 0].map(|shape| tree(&boxes, SHAPES[shape], &mut random));
    let (parts, _) = divided(&binary, &triangles, &mut random);
    let words = forged_words();
    let mut accepted = 0;
    for tree in [wide, binary, parts] {
        let file = save_parts(&tree, &boxes, &origin());
        // All words but the checksum.
        for offset in (16..file.len()).step_by(4).filter(|&offset| offset != 188) {
            for word in &words {
                let mut bytes = with_field(&file, offset, &word.to_le_bytes());
                seal(&mut bytes);
                let Ok(forged) = load_any(&bytes) else { continue };
                for ray in &rays {
                    let misses = |id, _| {
                        assert!(id < 11);
                        None
                    };
                    assert_eq!(nearest_hit_by(&forged, ray, misses, &mut ()), None);
                }
                accepted += 1;
            }
        }
    }
    // Enlarged boxes and other seeds do no harm.
    assert!(accepted > 100, "{accepted}");
}
