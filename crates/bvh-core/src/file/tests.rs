//! What tree files preserve, what they refuse, and that no bytes at all lead a traversal astray.

use super::*;
use crate::cost::SahConstants;
use crate::{Ray, nearest_hit_by};
use alloc::vec;

const ORIGIN: Origin = Origin {
    method: "best",
    seed: 7,
    work: 1 << 40,
    objective: Objective::Sah(SahConstants { traversal: 1.5, intersection: 0.25 }),
    visits: &[],
};

/// Boxes along a line and a tree over them whose root has three children and whose leaves have up to two objects.
fn scene(n: u32) -> (Vec<Aabb>, Bvh) {
    scene_of(n, 3, 2)
}

/// As [`scene`], with this many children of the root, two of all other nodes, and leaves of up to `leaf` objects.
fn scene_of(n: u32, children: usize, leaf: usize) -> (Vec<Aabb>, Bvh) {
    let aabb = |i: u32| {
        let [x, y, z] = [i as f32, (i % 3) as f32, (i % 5) as f32 * 0.5];
        Aabb::from([[x, y, z], [x + 1.5, y + 1.0, z + 0.5]])
    };
    let boxes: Vec<Aabb> = (0..n).map(aabb).collect();
    let mut tree = Bvh { nodes: vec![Node::leaf(Aabb::EMPTY, 0, n)], prim_ids: (0..n).rev().collect() };
    let mut at = 0;
    while at < tree.nodes.len() && n as usize > leaf {
        let range = tree.nodes[at].prims();
        let parts = if at == 0 { children } else { 2 };
        if range.len() > leaf {
            let first = tree.nodes.len() as u32;
            let cut = |part: usize| (range.start + range.len() * part / parts) as u32;
            tree.nodes
                .extend((0..parts).map(|part| Node::leaf(Aabb::EMPTY, cut(part), cut(part + 1) - cut(part))));
            tree.nodes[at] = Node::inner(Aabb::EMPTY, first, parts as u32);
        }
        at += 1;
    }
    if n == 0 {
        tree.nodes.clear();
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

/// As [`scene_of`] with single objects in leaves, but every third leaf is divided at the middle of its box.
fn split_scene(n: u32) -> (Vec<Aabb>, Bvh) {
    let (boxes, mut tree) = scene_of(n, 2, 1);
    for at in 0..tree.nodes.len() {
        if let crate::NodeKind::Leaf { first, .. } = tree.nodes[at].kind()
            && first % 3 == 0
        {
            let Node { aabb, .. } = tree.nodes[at];
            let middle = 0.5 * (aabb.min.x + aabb.max.x);
            let [low, high] = aabb.halves(0, middle);
            tree.nodes[at] = Node::inner(aabb, tree.nodes.len() as u32, 2);
            tree.nodes.extend([Node::leaf(low, first, 1), Node::leaf(high, tree.prim_ids.len() as u32, 1)]);
            tree.prim_ids.push(tree.prim_ids[first as usize]);
        }
    }
    (boxes, tree)
}

#[test]
fn a_tree_with_divided_objects_comes_back_and_is_refused_where_a_part_is_missing() {
    let (boxes, tree) = split_scene(11);
    assert_eq!(tree.prim_ids.len(), 15);
    let origin = Origin { objective: Objective::Layout, ..ORIGIN };
    let bytes = save_references(&tree, &boxes, &Filled(&boxes), &origin).unwrap();
    assert_eq!((bytes[8], load(&bytes, &boxes)), (4, Ok(tree.clone())));
    assert_eq!(TreeFile::open(&bytes).unwrap().header().references, 15);
    let whole = FileError::Tree(InvalidBvh::ObjectCount { named: 15, objects: 11 });
    assert_eq!(save(&tree, &boxes, &origin), Err(whole), "objects that may not be divided");
    for at in (0..tree.nodes.len()).filter(|&at| tree.nodes[at].is_leaf()) {
        let mut smaller = tree.clone();
        smaller.nodes[at].aabb.max.y -= 0.25;
        let refused = save_references(&smaller, &boxes, &Filled(&boxes), &origin);
        assert!(
            matches!(
                refused,
                Err(FileError::Tree(InvalidBvh::Uncovered { .. } | InvalidBvh::ObjectOutside { .. }))
            ),
            "{at}"
        );
    }
}

/// A copy of some bytes, aligned as a mapped file.
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
fn what_is_saved_is_loaded_and_viewed() {
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
        assert_eq!((file.visits(), &bytes[8..12]), (Ok(None), &2u32.to_le_bytes()[..]));
    }
}

/// Visits that halve from parent to child.
fn halving(tree: &Bvh) -> Vec<f32> {
    let mut visits = vec![1.0; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        node.children().for_each(|child| visits[child] = visits[index] / 2.0);
    }
    visits
}

#[test]
fn visits_come_back_and_only_those_of_a_monotone_measure_are_accepted() {
    for n in [1, 2, 11, 3000] {
        let (boxes, tree) = scene_of(n, 2, 1);
        let visits = halving(&tree);
        let origin = Origin { visits: &visits, ..ORIGIN };
        let mut bytes = save(&tree, &boxes, &origin).unwrap();
        let file = TreeFile::open(&bytes).unwrap();
        assert_eq!((file.tree(), file.visits()), (Ok(tree.clone()), Ok(Some(visits.clone()))));
        assert_eq!(&bytes[8..12], &3u32.to_le_bytes());
        for cut in 1..=4 {
            assert!(matches!(TreeFile::open(&bytes[..bytes.len() - cut]), Err(FileError::Length { .. })));
        }
        let last = visits.len() - 1;
        for wrong in [-1.0, 1.5, f32::NAN, f32::INFINITY] {
            let mut visits = visits.clone();
            visits[last] = wrong;
            let refused = Err(FileError::Visits(last));
            assert_eq!(save(&tree, &boxes, &Origin { visits: &visits, ..ORIGIN }), refused);
            let end = bytes.len();
            bytes[end - 4..].copy_from_slice(&wrong.to_le_bytes());
            seal(&mut bytes);
            let forged = TreeFile::open(&bytes).unwrap();
            assert_eq!(forged.visits().map(|_| ()), refused.map(|_: Vec<u8>| ()));
            assert_eq!(forged.tree().as_ref(), Ok(&tree), "the tree itself is sound");
        }
        let too_few = Origin { visits: &visits[..last], ..ORIGIN };
        assert_eq!(save(&tree, &boxes, &too_few).is_ok(), last == 0, "none at all are none");
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
fn every_changed_byte_and_every_cut_is_refused() {
    let (boxes, tree) = scene(5);
    let mut bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    for length in 0..bytes.len() {
        assert!(TreeFile::open(&bytes[..length]).is_err(), "cut to {length}");
    }
    let longer = [&bytes[..], &[0; 8]].concat();
    assert!((1..=8).all(|more| TreeFile::open(&longer[..bytes.len() + more]).is_err()));
    for at in 0..bytes.len() {
        let right = bytes[at];
        for change in 1..=255 {
            bytes[at] = right ^ change;
            assert!(TreeFile::open(&bytes).is_err(), "byte {at} changed by {change}");
        }
        bytes[at] = right;
    }
}

#[test]
fn other_files_versions_byte_orders_and_scenes_are_named() {
    let (boxes, tree) = scene(5);
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    let changed = |at: usize, field: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + field.len()].copy_from_slice(field);
        TreeFile::open(&bytes).map(|_| ()).unwrap_err()
    };
    assert_eq!(changed(0, b"v 0 0 0\n"), FileError::Magic);
    let old = changed(8, &1u32.to_le_bytes());
    assert_eq!(old, FileError::OldVersion { found: 1 });
    assert!(old.to_string().contains("version 1") && old.to_string().contains("bake it again"), "{old}");
    assert_eq!(changed(8, &5u32.to_le_bytes()), FileError::NewVersion { found: 5 });
    assert_eq!(changed(8, &[0, 0, 0, 2, 1, 2, 3, 4]), FileError::Endianness);
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
fn fields_that_no_save_writes_are_refused_even_under_a_right_checksum() {
    let (boxes, tree) = scene(5);
    let (none, empty) = scene(0);
    let files = [save(&tree, &boxes, &ORIGIN).unwrap(), save(&empty, &none, &Origin::default()).unwrap()];
    let refusal = |file: usize, at: usize, field: &[u8]| {
        let mut bytes = files[file].clone();
        bytes[at..at + field.len()].copy_from_slice(field);
        seal(&mut bytes);
        TreeFile::open(&bytes).and_then(|file| file.tree()).unwrap_err()
    };
    for wrong in [f64::NAN, f64::INFINITY, -1.0] {
        assert_eq!(refusal(0, 56, &wrong.to_le_bytes()), FileError::Field("cost"));
        assert_eq!(refusal(0, 64, &wrong.to_le_bytes()), FileError::Field("constants"));
    }
    assert_eq!(refusal(1, 72, &1f64.to_le_bytes()), FileError::Field("constants"), "internal area has none");
    for at in [80, 84, 100] {
        for wrong in [f32::NAN, f32::INFINITY, 0.25] {
            assert_eq!(refusal(0, at, &wrong.to_le_bytes()), FileError::Field("box of the root"));
        }
        assert_eq!(refusal(1, at, &0.25f32.to_le_bytes()), FileError::Field("box of the root"));
    }
    assert_eq!(refusal(0, 104, b"be\0t"), FileError::Field("padding"));
    assert_eq!(refusal(0, 187, &[1]), FileError::Field("padding"));
    let infinite = f32::INFINITY.to_le_bytes();
    assert!(matches!(refusal(0, 192 + 32 + 12, &infinite), FileError::Tree(InvalidBvh::Box { node: 1, .. })));
}

#[test]
fn what_cannot_be_saved_or_viewed_is_refused() {
    let (boxes, tree) = scene(7);
    let named = |method: &str| save(&tree, &boxes, &Origin { method, ..ORIGIN }).map(|_| ());
    assert_eq!(named(&"é".repeat(32)), Ok(()));
    assert_eq!([named(&"é".repeat(33)), named("a\0b")], [Err(FileError::Method), Err(FileError::Method)]);
    assert!(matches!(save(&tree, &boxes[1..], &ORIGIN), Err(FileError::Tree(InvalidBvh::ObjectCount { .. }))));
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    let held = aligned(&[&[0], &bytes[..]].concat());
    let askew = TreeFile::open(&bytes_of(&held, bytes.len() + 1)[1..]).unwrap();
    assert_eq!((askew.view(), askew.tree()), (Err(FileError::Alignment(4)), Ok(tree)));
}

#[test]
fn a_forged_file_is_refused_or_can_be_traced_to_the_end() {
    let floats = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN, f32::MAX, 0.0].map(f32::to_bits);
    let words: Vec<u32> = (0..24)
        .chain([1 << 30, 1 << 31, u32::MAX, u32::MAX - 1])
        .chain((0..24).map(|i| i | 1 << 31))
        .chain(floats)
        .collect();
    let mut accepted = 0;
    for (boxes, tree) in [scene(11), scene_of(11, 2, 1), split_scene(11)] {
        let whole = save_references(&tree, &boxes, &Filled(&boxes), &ORIGIN).unwrap();
        for at in (16..whole.len()).step_by(4).filter(|at| !Header::CHECKSUM.contains(at)) {
            for word in &words {
                let mut bytes = whole.clone();
                bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
                seal(&mut bytes);
                let Ok(tree) = TreeFile::open(&bytes).and_then(|file| file.tree()) else { continue };
                let test = |id: u32, _: f32| {
                    assert!(id < 11);
                    None
                };
                rays().for_each(|ray| assert_eq!(nearest_hit_by(&tree, &ray, test, &mut ()), None));
                accepted += 1;
            }
        }
    }
    assert!(accepted > 100, "{accepted}: enlarged boxes are no harm, nor are seeds");
}
