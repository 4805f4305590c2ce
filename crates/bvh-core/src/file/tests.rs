//! Tree files preserve trees and reject damage, and no bytes make a traversal leave the tree.

use super::*;
use crate::cost::SahConstants;
use crate::{Clip, Ray, nearest_hit_by, validate_references};

const ORIGIN: Origin = Origin {
    method: "best",
    seed: 7,
    work: 1 << 40,
    objective: Objective::Sah(SahConstants { traversal: 1.5, intersection: 0.25 }),
    visits: &[],
};

/// Miri takes thousands of times as long as a processor, so it tries one of so many cases.
const ONE_OF: usize = if cfg!(miri) { 29 } else { 1 };

/// Makes boxes along a line and a tree over them. The root has three children, and leaves have up
/// to two objects.
fn scene(n: u32) -> (Vec<Aabb>, Bvh) {
    scene_of(n, 3, 2)
}

/// Makes a [`scene`] with a given number of children of the root and leaves of up to `leaf`
/// objects. All other nodes have two children.
fn scene_of(n: u32, children: usize, leaf: usize) -> (Vec<Aabb>, Bvh) {
    let mut boxes = Vec::new();
    for i in 0..n {
        let [x, y, z] = [i as f32, (i % 3) as f32, (i % 5) as f32 * 0.5];
        boxes.push(Aabb::from([[x, y, z], [x + 1.5, y + 1.0, z + 0.5]]));
    }
    let mut tree = Bvh { nodes: vec![], prim_ids: (0..n).rev().collect() };
    if n as usize > leaf {
        let cut = |part: usize| (n as usize * part / children) as u32;
        let leaf_of = |part| Node::leaf(Aabb::EMPTY, cut(part), cut(part + 1) - cut(part));
        tree.nodes.push(Node::inner(Aabb::EMPTY, 1, children as u32));
        tree.nodes.extend((0..children).map(leaf_of));
        tree.halve_leaves(leaf);
    } else if n > 0 {
        tree.nodes.push(Node::leaf(Aabb::EMPTY, 0, n));
    }
    tree.refit(&boxes);
    (boxes, tree)
}

/// Objects that fill their boxes.
#[derive(Debug)]
struct Filled<'a>(&'a [Aabb]);

impl Clip for Filled<'_> {
    fn clip(&self, object: u32, region: &Aabb) -> Aabb {
        self.0[object as usize].intersection(region)
    }
}

/// Returns the file of a tree whose objects may be divided.
fn save_parts(tree: &Bvh, boxes: &[Aabb], origin: &Origin) -> Result<Vec<u8>, FileError> {
    validate_references(tree, boxes, &Filled(boxes))?;
    let cost = origin.objective.cost(tree);
    Ok(sections(tree, boxes, cost, origin, &call_in_turn)?.concat())
}

/// Makes a [`scene_of`] single objects per leaf, in which every third leaf is divided at the middle
/// of its box.
fn split_scene(n: u32) -> (Vec<Aabb>, Bvh) {
    let (boxes, mut tree) = scene_of(n, 2, 1);
    for index in 0..tree.nodes.len() {
        if let crate::NodeKind::Leaf { first, .. } = tree.nodes[index].kind()
            && first % 3 == 0
        {
            let Node { aabb, .. } = tree.nodes[index];
            let middle = 0.5 * (aabb.min.x + aabb.max.x);
            let [low, high] = aabb.halves(0, middle);
            let added = tree.prim_ids.len() as u32;
            tree.nodes[index] = Node::inner(aabb, tree.nodes.len() as u32, 2);
            tree.nodes.extend([Node::leaf(low, first, 1), Node::leaf(high, added, 1)]);
            tree.prim_ids.push(tree.prim_ids[first as usize]);
        }
    }
    (boxes, tree)
}

#[test]
fn a_tree_with_divided_objects_comes_back_and_is_rejected_if_a_part_is_missing() {
    let (boxes, tree) = split_scene(11);
    assert_eq!(tree.prim_ids.len(), 15);
    let origin = Origin { objective: Objective::Layout, ..ORIGIN };
    let bytes = save_parts(&tree, &boxes, &origin).unwrap();
    assert_eq!(load(&bytes, &boxes), Ok(tree.clone()));
    assert_eq!(TreeFile::open(&bytes).unwrap().header().references, 15);
    let wrong_count = FileError::Tree(InvalidBvh::ObjectCount { named: 15, objects: 11 });
    assert_eq!(save(&tree, &boxes, &origin), Err(wrong_count), "objects that may not be divided");
    let is_divided = |id: u32| tree.prim_ids.iter().filter(|&&other| other == id).count() > 1;
    let leaf = tree.nodes.iter().position(|node| {
        node.is_leaf() && tree.prim_ids[node.prims()].iter().all(|&id| is_divided(id))
    });
    let leaf = leaf.unwrap();
    let mut smaller = tree.clone();
    smaller.nodes[leaf].aabb.max.y -= 0.25;
    let fault = save_parts(&smaller, &boxes, &origin);
    let object = tree.prim_ids[tree.nodes[leaf].prims()][0] as usize;
    assert_eq!(fault, Err(FileError::Tree(InvalidBvh::Uncovered { object })));
}

/// Copies bytes to an address that is aligned like a mapped file.
fn aligned(bytes: &[u8]) -> Vec<u64> {
    let mut copy = vec![0; bytes.len().div_ceil(8)];
    bytemuck::cast_slice_mut::<u64, u8>(&mut copy)[..bytes.len()].copy_from_slice(bytes);
    copy
}

fn bytes_of(aligned: &[u64], len: usize) -> &[u8] {
    &bytemuck::cast_slice(aligned)[..len]
}

fn rays() -> impl Iterator<Item = Ray> {
    (0..24u8).map(|i| {
        let i = f32::from(i);
        Ray::half_line([i * 0.5 - 1.0, 5.0, -3.0], [0.1 * i - 1.0, -3.0 + 0.2 * i, 2.0]).unwrap()
    })
}

#[test]
fn a_saved_tree_can_be_loaded_and_viewed() {
    for n in [0, 1, 2, 7, 40] {
        let (boxes, tree) = scene(n);
        let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
        assert_eq!(load(&bytes, &boxes), Ok(tree.clone()));
        let held = aligned(&bytes);
        let file = TreeFile::open(bytes_of(&held, bytes.len())).unwrap().for_boxes(&boxes).unwrap();
        assert_eq!(file.view(), Ok((&tree).into()));
        let header = Header {
            nodes: tree.nodes.len(),
            objects: boxes.len(),
            references: boxes.len(),
            objective: ORIGIN.objective,
            cost: ORIGIN.objective.cost(&tree),
            seed: 7,
            work: 1 << 40,
            scene: boxes_checksum(&boxes),
            bounds: tree.root_aabb().unwrap_or(Aabb::EMPTY),
            method: "best".into(),
            has_visits: false,
        };
        assert_eq!(file.header(), &header);
        assert_eq!(file.visits(), Ok(None));
        assert_eq!(bytes[8..12], Header::VERSION.to_le_bytes());
    }
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
    for n in [1, 2, 11, 3000 / ONE_OF as u32] {
        let (boxes, tree) = scene_of(n, 2, 1);
        let visits = halving(&tree);
        let origin = Origin { visits: &visits, ..ORIGIN };
        let mut bytes = save(&tree, &boxes, &origin).unwrap();
        let file = TreeFile::open(&bytes).unwrap();
        assert_eq!(file.tree().as_ref(), Ok(&tree));
        assert_eq!(file.visits(), Ok(Some(visits.clone())));
        for cut in 1..=4 {
            assert!(matches!(
                TreeFile::open(&bytes[..bytes.len() - cut]),
                Err(FileError::Length { .. })
            ));
        }
        let last = visits.len() - 1;
        for wrong in [-1.0, 1.5, f32::NAN, f32::INFINITY] {
            let mut wrong_visits = visits.clone();
            wrong_visits[last] = wrong;
            let rejected = save(&tree, &boxes, &Origin { visits: &wrong_visits, ..ORIGIN });
            assert_eq!(rejected, Err(FileError::Visits(last)));
            let end = bytes.len();
            bytes[end - 4..].copy_from_slice(&wrong.to_le_bytes());
            seal(&mut bytes);
            let forged = TreeFile::open(&bytes).unwrap();
            assert_eq!(forged.visits(), Err(FileError::Visits(last)));
            assert_eq!(forged.tree().as_ref(), Ok(&tree), "the tree itself is sound");
        }
        let too_few = Origin { visits: &visits[..last], ..ORIGIN };
        // A tree of one node is saved without visits.
        assert_eq!(save(&tree, &boxes, &too_few).is_ok(), last == 0);
    }
}

#[test]
fn checksums_are_the_crc_32_that_other_programs_compute() {
    // In Python: zlib.crc32(struct.pack("<12f", 0, 0, 0, 1, 1, 1, 2, 0, 0, 3, 1, 1)).
    let boxes = [Aabb::from([[0.0; 3], [1.0; 3]]), Aabb::from([[2.0, 0.0, 0.0], [3.0, 1.0, 1.0]])];
    assert_eq!(boxes_checksum(&boxes), 0x3806_b19d);
    let (boxes, tree) = scene(5);
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    let covered = [&bytes[192..], &bytes[..188]].concat();
    assert_eq!(crc32fast::hash(&covered).to_le_bytes(), bytes[188..192]);
}

#[test]
fn a_tree_is_for_all_boxes_that_equal_those_it_was_built_over() {
    let (boxes, tree) = scene(500 / ONE_OF as u32);
    let signed =
        |corner: Vec3| Vec3::from(corner.to_array().map(|x| if x == 0.0 { -0.0 } else { x }));
    let mut mirrored = boxes.clone();
    for one in &mut mirrored {
        *one = Aabb { min: signed(one.min), max: signed(one.max) };
    }
    assert_eq!(mirrored, boxes);
    let bytes = save(&tree, &mirrored, &ORIGIN).unwrap();
    assert_eq!(load(&bytes, &boxes), Ok(tree));
    assert_eq!(boxes_checksum(&mirrored), boxes_checksum(&boxes));
}

#[test]
fn every_changed_byte_and_every_cut_is_rejected() {
    let (boxes, tree) = scene(5);
    let mut bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    for length in (0..bytes.len()).step_by(ONE_OF) {
        assert!(TreeFile::open(&bytes[..length]).is_err(), "cut to {length}");
    }
    let longer = [&bytes[..], &[0; 8]].concat();
    for length in bytes.len() + 1..=longer.len() {
        assert!(TreeFile::open(&longer[..length]).is_err(), "extended to {length}");
    }
    for position in (0..bytes.len()).step_by(ONE_OF) {
        let right = bytes[position];
        for change in (1..=255).step_by(ONE_OF) {
            bytes[position] = right ^ change;
            assert!(TreeFile::open(&bytes).is_err(), "byte {position} changed by {change}");
        }
        bytes[position] = right;
    }
}

fn with_field(file: &[u8], offset: usize, field: &[u8]) -> Vec<u8> {
    let mut bytes = file.to_vec();
    bytes[offset..offset + field.len()].copy_from_slice(field);
    bytes
}

#[test]
fn each_foreign_file_version_and_scene_has_its_error() {
    let (boxes, tree) = scene(5);
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
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
    assert!(matches!(load(&bytes, &moved), Err(FileError::OtherScene { .. })));
    moved = boxes.clone();
    moved.swap(0, 3);
    assert!(matches!(load(&bytes, &moved), Err(FileError::OtherScene { .. })));
    assert_eq!(load(&bytes, &boxes[..4]), Err(FileError::ObjectCount { found: 4, expected: 5 }));
}

#[test]
fn fields_that_no_save_writes_are_rejected_even_with_a_correct_checksum() {
    let (boxes, tree) = scene(5);
    let file = save(&tree, &boxes, &ORIGIN).unwrap();
    let empty = save(&Bvh::default(), &[], &Origin::default()).unwrap();
    for wrong in [f64::NAN, f64::INFINITY, -1.0] {
        assert_eq!(rejection(&file, 56, &wrong.to_le_bytes()), FileError::Field("cost"));
        assert_eq!(rejection(&file, 64, &wrong.to_le_bytes()), FileError::Field("constants"));
    }
    // The internal area has no constants.
    assert_eq!(rejection(&empty, 72, &1f64.to_le_bytes()), FileError::Field("constants"));
    for offset in [80, 84, 100] {
        for wrong in [f32::NAN, f32::INFINITY, 0.25] {
            assert_eq!(
                rejection(&file, offset, &wrong.to_le_bytes()),
                FileError::Field("box of the root")
            );
        }
        assert_eq!(
            rejection(&empty, offset, &0.25f32.to_le_bytes()),
            FileError::Field("box of the root")
        );
    }
    assert_eq!(rejection(&file, 104, b"be\0t"), FileError::Field("padding"));
    assert_eq!(rejection(&file, 187, &[1]), FileError::Field("padding"));
    let infinite_box = rejection(&file, 192 + 32 + 12, &f32::INFINITY.to_le_bytes());
    assert!(matches!(infinite_box, FileError::Tree(InvalidBvh::Box { node: 1, .. })));
}

/// Returns the error of a file with one field replaced and a correct checksum.
fn rejection(file: &[u8], offset: usize, field: &[u8]) -> FileError {
    let mut bytes = with_field(file, offset, field);
    seal(&mut bytes);
    load_any(&bytes).unwrap_err()
}

fn load_any(bytes: &[u8]) -> Result<Bvh, FileError> {
    TreeFile::open(bytes)?.tree()
}

#[test]
fn long_names_wrong_trees_and_misaligned_views_are_rejected() {
    let (boxes, tree) = scene(7);
    let save_as = |method: &str| save(&tree, &boxes, &Origin { method, ..ORIGIN });
    assert!(save_as(&"é".repeat(32)).is_ok());
    assert_eq!(save_as(&"é".repeat(33)), Err(FileError::Method));
    assert_eq!(save_as("a\0b"), Err(FileError::Method));
    let wrong_count = save(&tree, &boxes[1..], &ORIGIN);
    assert!(matches!(wrong_count, Err(FileError::Tree(InvalidBvh::ObjectCount { .. }))));
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    let held = aligned(&[&[0], &bytes[..]].concat());
    let misaligned = TreeFile::open(&bytes_of(&held, bytes.len() + 1)[1..]).unwrap();
    assert_eq!(misaligned.view(), Err(FileError::Alignment(4)));
    assert_eq!(misaligned.tree(), Ok(tree));
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

/// Fails if a traversal does not end or meets an object outside of `0..objects`.
fn trace(tree: &Bvh, objects: u32) {
    for ray in rays() {
        let hit = nearest_hit_by(
            tree,
            &ray,
            |id, _| {
                assert!(id < objects);
                None
            },
            &mut (),
        );
        assert_eq!(hit, None);
    }
}

#[test]
fn a_forged_file_is_rejected_or_can_be_traced_to_the_end() {
    let words = forged_words();
    let mut accepted = 0;
    for (boxes, tree) in [scene(11), scene_of(11, 2, 1), split_scene(11)] {
        let file = save_parts(&tree, &boxes, &ORIGIN).unwrap();
        for offset in (16..file.len()).step_by(4 * ONE_OF) {
            if Header::CHECKSUM.contains(&offset) {
                continue;
            }
            for word in &words {
                let mut bytes = with_field(&file, offset, &word.to_le_bytes());
                seal(&mut bytes);
                if let Ok(forged) = load_any(&bytes) {
                    trace(&forged, 11);
                    accepted += 1;
                }
            }
        }
    }
    // Enlarged boxes and other seeds do no harm.
    assert!(accepted > 100 / ONE_OF, "{accepted}");
}
