//! What a tree file survives, what it refuses, and that no bytes at all lead a traversal astray.

use super::*;
use crate::cost::SahConstants;
use crate::{Ray, nearest_hit};
use alloc::{vec, vec::Vec};
use glam::Vec3;

const ORIGIN: Origin = Origin {
    method: "best",
    seed: 7,
    work: 1 << 40,
    objective: Objective::Sah(SahConstants { traversal: 1.5, intersection: 0.25 }),
};

/// Triangles along a line and a tree over them with a node of three children and leaves of up to two objects.
fn scene(n: u32) -> (Vec<Triangle>, Vec<Aabb>, Bvh) {
    scene_of(n, 3, 2)
}

/// The same with so many children of the root, two of all other nodes, and leaves of up to `leaf` objects.
fn scene_of(n: u32, children: usize, leaf: usize) -> (Vec<Triangle>, Vec<Aabb>, Bvh) {
    let triangle = |i: u32| {
        let at = Vec3::new(i as f32, (i % 3) as f32, (i % 5) as f32 * 0.5);
        Triangle([at, at + Vec3::X * 1.5, at + Vec3::new(0.25, 1.0, 0.5)])
    };
    let triangles: Vec<Triangle> = (0..n).map(triangle).collect();
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
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
    (triangles, boxes, tree)
}

/// A copy of some bytes that lies as a mapped file would.
fn aligned(bytes: &[u8]) -> Vec<WideNode> {
    let mut copy = vec![WideNode::EMPTY; bytes.len().div_ceil(size_of::<WideNode>())];
    bytemuck::cast_slice_mut::<WideNode, u8>(&mut copy)[..bytes.len()].copy_from_slice(bytes);
    copy
}

fn bytes_of(aligned: &[WideNode], len: usize) -> &[u8] {
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
        let (triangles, boxes, tree) = scene(n);
        let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
        assert_eq!(load(&bytes, &boxes), Ok(tree.clone()));
        let held = aligned(&bytes);
        let file = TreeFile::open(bytes_of(&held, bytes.len())).unwrap().for_boxes(&boxes).unwrap();
        assert_eq!(file.view(), Ok((&tree).into()));
        let Header { method, seed, work, objective, cost, .. } = file.header();
        assert_eq!((method.as_str(), *seed, *work, *objective), ("best", 7, 1 << 40, ORIGIN.objective));
        assert_eq!(*cost, ORIGIN.objective.cost(&tree));

        let wide = WideBvh::new(&tree, &triangles).unwrap();
        let bytes = save_wide(&tree, &triangles, &ORIGIN).unwrap();
        let loaded = load_wide(&bytes, &triangles).unwrap();
        let held = aligned(&bytes);
        let file = TreeFile::open(bytes_of(&held, bytes.len())).unwrap().for_triangles(&triangles).unwrap();
        for ray in rays() {
            let hit = wide.nearest_hit(&ray);
            assert_eq!(
                [loaded.nearest_hit(&ray), file.wide_view().unwrap().nearest_hit(&ray)],
                [hit; 2],
                "{n}"
            );
        }
    }
}

#[test]
fn every_changed_byte_and_every_cut_is_refused() {
    let (triangles, boxes, tree) = scene(5);
    let files = [save(&tree, &boxes, &ORIGIN).unwrap(), save_wide(&tree, &triangles, &ORIGIN).unwrap()];
    let refused = |bytes: &[u8]| match bytes[16] {
        0 => load(bytes, &boxes).is_err(),
        _ => load_wide(bytes, &triangles).is_err(),
    };
    for mut bytes in files {
        assert!(!refused(&bytes));
        for length in 17..bytes.len() {
            assert!(refused(&bytes[..length]), "cut to {length}");
        }
        for length in 0..17 {
            assert!(TreeFile::open(&bytes[..length]).is_err(), "cut to {length}");
        }
        let longer = [&bytes[..], &[0; 8]].concat();
        assert!((1..=8).all(|more| refused(&longer[..bytes.len() + more])));
        for at in 0..bytes.len() {
            let right = bytes[at];
            for change in 1..=255 {
                bytes[at] = right ^ change;
                assert!(TreeFile::open(&bytes).is_err(), "byte {at} changed by {change}");
            }
            bytes[at] = right;
        }
    }
}

#[test]
fn other_files_versions_byte_orders_and_scenes_are_named() {
    let (triangles, boxes, tree) = scene(5);
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    let changed = |at: usize, field: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + field.len()].copy_from_slice(field);
        TreeFile::open(&bytes).map(|_| ()).unwrap_err()
    };
    assert_eq!(changed(0, b"v 0 0 0\n"), FileError::Magic);
    assert_eq!(changed(8, &2u32.to_le_bytes()), FileError::Version { found: 2 });
    assert_eq!(changed(8, &[0, 0, 0, 1, 1, 2, 3, 4]), FileError::Endianness);
    assert_eq!(changed(32, &u64::MAX.to_le_bytes()), FileError::Field("objects"));
    let short = FileError::Length { found: bytes.len() as u64, expected: 192 + 3 * 32 + 5 * 4 };
    assert_eq!(changed(24, &3u64.to_le_bytes()), short);

    let mut moved = boxes.clone();
    moved[3].max.z = moved[3].max.z.next_up();
    assert!(matches!(load(&bytes, &moved), Err(FileError::OtherScene { .. })));
    moved.swap(0, 3);
    assert!(matches!(load(&bytes, &moved), Err(FileError::OtherScene { .. })));
    assert_eq!(load(&bytes, &boxes[..4]), Err(FileError::ObjectCount { found: 4, expected: 5 }));
    let kind = FileError::Layout { found: Layout::Tree, expected: Layout::Wide };
    assert_eq!(load_wide(&bytes, &triangles).map(|_| ()), Err(kind));

    // Another diagonal: the same box, another triangle.
    let wide = save_wide(&tree, &triangles, &ORIGIN).unwrap();
    let mut other = triangles.clone();
    other[2].0.swap(0, 1);
    assert!(matches!(load_wide(&wide, &other), Err(FileError::OtherScene { .. })));
}

#[test]
fn what_cannot_be_saved_or_viewed_is_refused() {
    let (_, boxes, tree) = scene(7);
    let named = |method: &str| save(&tree, &boxes, &Origin { method, ..ORIGIN }).map(|_| ());
    assert_eq!(named(&"é".repeat(32)), Ok(()));
    assert_eq!([named(&"é".repeat(33)), named("a\0b")], [Err(FileError::Method), Err(FileError::Method)]);
    assert!(matches!(save(&tree, &boxes[1..], &ORIGIN), Err(FileError::Tree(InvalidBvh::ObjectCount { .. }))));
    let bytes = save(&tree, &boxes, &ORIGIN).unwrap();
    let held = aligned(&[&[0], &bytes[..]].concat());
    let askew = TreeFile::open(&bytes_of(&held, bytes.len() + 1)[1..]).unwrap();
    assert_eq!((askew.view(), askew.tree()), (Err(FileError::Alignment(4)), Ok(tree)));
}

/// Gives altered bytes the checksum that makes them look whole.
fn seal(bytes: &mut [u8]) {
    let (header, body) = bytes.split_at_mut(Header::BYTES);
    let sum = whole_checksum(header, checksum(body));
    header[Header::CHECKSUM].copy_from_slice(&sum.to_le_bytes());
}

#[test]
fn a_forged_file_is_refused_or_can_be_traced_to_the_end() {
    let (triangles, boxes, tree) = scene(11);
    let (.., plain) = scene_of(11, 2, 1);
    let floats = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN, f32::MAX, 0.0].map(f32::to_bits);
    let words = (0..24)
        .chain([1 << 30, 1 << 31, u32::MAX, u32::MAX - 1])
        .chain((0..24).map(|i| i | 1 << 31))
        .chain(floats);
    let words: Vec<u32> = words.collect();
    let mut accepted = 0;
    for whole in [
        save(&tree, &boxes, &ORIGIN).unwrap(),
        save(&plain, &boxes, &ORIGIN).unwrap(),
        save_wide(&tree, &triangles, &ORIGIN).unwrap(),
    ] {
        for at in (16..whole.len()).step_by(4).filter(|at| !Header::CHECKSUM.contains(at)) {
            for word in &words {
                let mut bytes = whole.clone();
                bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
                seal(&mut bytes);
                let Ok(file) = TreeFile::open(&bytes) else { continue };
                let test = |id: u32, _: f32| {
                    assert!(id < 11);
                    None
                };
                if let Ok(tree) = file.tree() {
                    rays().for_each(|ray| assert_eq!(nearest_hit(&tree, &ray, test, &mut ()), None));
                    accepted += 1;
                } else if let Ok(wide) = file.wide() {
                    for ray in rays() {
                        let hits = [wide.nearest_hit(&ray), wide.view().nearest_hit_portable(&ray)];
                        assert!(hits.iter().flatten().all(|hit| hit.object < 11));
                    }
                    accepted += 1;
                }
            }
        }
    }
    assert!(accepted > 100, "{accepted}: enlarged boxes are no harm, nor are seeds");
}
