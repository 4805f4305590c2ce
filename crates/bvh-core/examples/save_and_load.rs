//! Converts a tree of another builder, saves it, loads it in two ways, and traces it without
//! copying it.
//!
//! `cargo run -p bvh-core --example save_and_load`

use bvh_core::file::{self, FileError, Origin, TreeFile};
use bvh_core::{Aabb, Bvh, FirstCountNode, Ray, Triangle, boxes, nearest_hit, validate};
use std::error::Error;

/// Makes a row of triangles. Any scene will do.
fn triangles() -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for x in (0..64u8).map(f32::from) {
        triangles.push(Triangle::from([[x, 0.0, 0.0], [x + 0.75, 0.0, 0.0], [x, 1.0, 0.5]]));
    }
    triangles
}

/// The nodes of another builder: two children at `first`, or `count` objects from `first` on.
fn halves(boxes: &[Aabb]) -> [FirstCountNode; 3] {
    let half = boxes.len() as u32 / 2;
    let (low, high) = boxes.split_at(half as usize);
    [(boxes, 1, 0), (low, 0, half), (high, half, high.len() as u32)].map(
        |(objects, first, count)| {
            let Aabb { min, max } = Aabb::union_of(objects);
            FirstCountNode { min: min.to_array(), first, max: max.to_array(), count }
        },
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    let triangles = triangles();
    let boxes = boxes(&triangles);
    let ids: Vec<u32> = (0..boxes.len() as u32).collect();
    let tree = Bvh::from_first_count(&halves(&boxes), &ids)?;
    validate(&tree, &boxes)?;

    // Save. The library makes bytes, and the program decides where to store them.
    let name = format!("save_and_load.{}.bvh", std::process::id());
    let path = std::env::temp_dir().join(name);
    let origin = Origin { method: "halves", ..Default::default() };
    std::fs::write(&path, file::save(&tree, &boxes, &origin)?)?;

    // Load an owned tree. The bytes may have any alignment.
    let bytes = std::fs::read(&path)?;
    std::fs::remove_file(&path)?;
    assert_eq!(file::load(&bytes, &boxes)?, tree);

    // Or load without a copy: bytes of a mapped file become a tree by a check and a cast.
    let file = TreeFile::open(&bytes)?.for_boxes(&boxes)?;
    println!("{} bytes, by {}, cost {}", bytes.len(), file.header().method, file.header().cost);
    match file.view() {
        Ok(view) => {
            let ray = Ray::half_line([10.25, 0.25, -5.0], [0.0, 0.0, 1.0])?;
            let hit = nearest_hit(view, &triangles, &ray).ok_or("no hit")?;
            println!("hit triangle {} at {}", hit.object, hit.t);
            assert_eq!(hit.object, 10);
        }
        // A mapped file is always aligned, a `Vec<u8>` need not be.
        Err(FileError::Alignment(_)) => println!("these bytes must be loaded"),
        Err(error) => return Err(error.into()),
    }

    // A scene whose objects have moved is another scene, and is rejected.
    let mut moved = boxes.clone();
    for aabb in &mut moved {
        aabb.max += 1.0;
    }
    println!("moved: {}", file::load(&bytes, &moved).expect_err("another scene"));
    Ok(())
}
