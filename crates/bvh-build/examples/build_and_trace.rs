//! Builds a tree over triangles and traces it, one ray at a time and in the wide layout.
//!
//! `cargo run -p bvh-build --example build_and_trace`

use bvh_build::{Builder, muller_fellner};
use bvh_core::{
    PreparedRay, Ray, TestCounts, Triangle, WideBvh, any_hit, boxes, cost, nearest_hit,
    nearest_hit_by,
};
use std::error::Error;

/// Makes a bumpy ground with two triangles per square metre.
fn ground(size: u16) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for x in 0..size {
        for z in 0..size {
            let a = corner(x, z);
            let b = corner(x + 1, z);
            let c = corner(x, z + 1);
            let d = corner(x + 1, z + 1);
            triangles.push(Triangle::from([a, b, c]));
            triangles.push(Triangle::from([d, c, b]));
        }
    }
    triangles
}

fn corner(x: u16, z: u16) -> [f32; 3] {
    let height = f32::from((x * 7 + z * 13) % 11) * 0.1;
    [f32::from(x), height, f32::from(z)]
}

fn main() -> Result<(), Box<dyn Error>> {
    let triangles = ground(64);
    let boxes = boxes(&triangles);
    let tree = muller_fellner::Config::default().build(&boxes)?;
    let area = cost::internal_area(&tree);
    println!("{} triangles, {} nodes, internal area {area}", boxes.len(), tree.nodes.len());

    // Find the triangle below a point, and count the tests.
    let down = Ray::half_line([20.3, 10.0, 41.8], [0.0, -1.0, 0.0])?;
    let hit = nearest_hit(&tree, &triangles, &down).ok_or("nothing below")?;
    let prepared = PreparedRay::new(&down);
    let test = |id: u32, t_max| triangles[id as usize].intersect(&prepared, t_max);
    let mut counts = TestCounts::default();
    nearest_hit_by(&tree, &down, test, &mut counts);
    println!(
        "triangle {} at distance {}: {} boxes, {} triangles tested",
        hit.object, hit.t, counts.boxes, counts.objects
    );

    // Test whether the sun is visible from there. A shadow ray ends at the first hit.
    let sun = Ray::new(down.at(hit.t), [0.3, 1.0, 0.2], 1e-3, f32::INFINITY)?;
    let shadow = any_hit(&tree, &triangles, &sun);
    println!("{}", if shadow { "in shadow" } else { "in the sun" });

    // The wide layout is faster for many rays: it tests eight children at a time and gives the same
    // answers, bit by bit.
    let wide = WideBvh::new(&tree, &triangles)?;
    assert_eq!(wide.nearest_hit(&down), Some(hit));
    assert_eq!(wide.any_hit(&sun), shadow);
    println!("the wide layout takes {} bytes and agrees", wide.bytes());
    Ok(())
}
