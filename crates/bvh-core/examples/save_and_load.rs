//! Takes a tree from another builder, saves it, loads it two ways, and traces it where it lies.
//!
//! `cargo run -p bvh-core --example save_and_load`

use bvh_core::file::{self, FileError, Origin, TreeFile};
use bvh_core::{Aabb, Bvh, FirstCountNode, Ray, Triangle, boxes, nearest_hit, validate};
use std::error::Error;

/// A row of triangles; any scene will do.
fn triangles() -> Vec<Triangle> {
    let triangle = |x: f32| Triangle::from([[x, 0.0, 0.0], [x + 0.75, 0.0, 0.0], [x, 1.0, 0.5]]);
    (0..64u8).map(|i| triangle(i.into())).collect()
}

/// A builder of one's own, in the plain form that most have: two children at `first`, or `count` objects from `first`
/// on.
fn halves(boxes: &[Aabb]) -> Vec<FirstCountNode> {
    let mut nodes = vec![FirstCountNode { first: 0, count: boxes.len() as u32, ..Default::default() }];
    let mut at = 0;
    while at < nodes.len() {
        let FirstCountNode { first, count, .. } = nodes[at];
        let around = boxes[first as usize..][..count as usize].iter().fold(Aabb::EMPTY, |b, o| b.union(o));
        (nodes[at].min, nodes[at].max) = (around.min.to_array(), around.max.to_array());
        if count > 2 {
            let children = [(first, count / 2), (first + count / 2, count - count / 2)];
            (nodes[at].first, nodes[at].count) = (nodes.len() as u32, 0);
            nodes.extend(children.map(|(first, count)| FirstCountNode { first, count, ..Default::default() }));
        }
        at += 1;
    }
    nodes
}

fn main() -> Result<(), Box<dyn Error>> {
    let triangles = triangles();
    let boxes = boxes(&triangles);
    let ids: Vec<u32> = (0..boxes.len() as u32).collect();
    let tree = Bvh::from_first_count(&halves(&boxes), &ids)?;
    validate(&tree, &boxes)?;

    // Save. The library makes bytes; where they go is the caller's affair.
    let path = std::env::temp_dir().join(format!("save_and_load.{}.bvh", std::process::id()));
    std::fs::write(&path, file::save(&tree, &boxes, &Origin { method: "halves", ..Default::default() })?)?;

    // Load: an owned tree, from bytes that lie anywhere.
    let bytes = std::fs::read(&path)?;
    std::fs::remove_file(&path)?;
    assert_eq!(file::load(&bytes, &boxes)?, tree);

    // Or no copy: bytes of a mapped file are a tree after a check and a cast.
    let file = TreeFile::open(&bytes)?.for_boxes(&boxes)?;
    println!("{} bytes, by {}, cost {}", bytes.len(), file.header().method, file.header().cost);
    match file.view() {
        Ok(view) => {
            let ray = Ray::half_line([10.25, 0.25, -5.0], [0.0, 0.0, 1.0])?;
            let hit = nearest_hit(view, &triangles, &ray).ok_or("no hit")?;
            println!("hit triangle {} at {}", hit.object, hit.t);
            assert_eq!(hit.object, 10);
        }
        // A `Vec<u8>` promises no alignment, a mapped file does.
        Err(FileError::Alignment(_) | FileError::Machine) => println!("these bytes must be loaded"),
        Err(error) => return Err(error.into()),
    }

    // Another scene, or one whose objects have moved, is refused.
    let moved: Vec<Aabb> = boxes.iter().map(|b| Aabb { min: b.min, max: b.max + 1.0 }).collect();
    println!("moved: {}", file::load(&bytes, &moved).expect_err("another scene"));
    Ok(())
}
