//! Builds a tree over triangles and traces it, one ray at a time and in the wide layout.
//!
//! `cargo run -p bvh-build --example build_and_trace`

use bvh_build::{Builder, muller_fellner};
use bvh_core::{Ray, Shear, TestCounts, Triangle, WideBvh, any_hit, boxes, cost, nearest_hit, nearest_hit_by};
use std::error::Error;

/// A bumpy ground of two triangles per square metre.
fn ground(size: u16) -> Vec<Triangle> {
    let height = |x: u16, z: u16| f32::from((x * 7 + z * 13) % 11) * 0.1;
    let corner = |x: u16, z: u16| [f32::from(x), height(x, z), f32::from(z)];
    let square = |(x, z)| {
        let (a, b, c, d) = (corner(x, z), corner(x + 1, z), corner(x, z + 1), corner(x + 1, z + 1));
        [Triangle::from([a, b, c]), Triangle::from([d, c, b])]
    };
    (0..size).flat_map(|x| (0..size).map(move |z| (x, z))).flat_map(square).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let triangles = ground(64);
    let boxes = boxes(&triangles);
    let tree = muller_fellner::Config::default().build(&boxes)?;
    println!(
        "{} triangles, {} nodes, internal area {}",
        boxes.len(),
        tree.nodes.len(),
        cost::internal_area(&tree)
    );

    // What lies under this point, and at what price?
    let down = Ray::half_line([20.3, 10.0, 41.8], [0.0, -1.0, 0.0])?;
    let hit = nearest_hit(&tree, &triangles, &down).ok_or("nothing below")?;
    let (shear, mut counts) = (Shear::new(&down), TestCounts::default());
    nearest_hit_by(&tree, &down, |id, t_max| triangles[id as usize].intersect(&shear, t_max), &mut counts);
    println!(
        "triangle {} at distance {}: {} boxes, {} triangles tested",
        hit.object, hit.t, counts.boxes, counts.objects
    );

    // Is the sun visible from there? Shadow rays end at the first hit.
    let sun = Ray::new(down.at(hit.t), [0.3, 1.0, 0.2], 1e-3, f32::INFINITY)?;
    let shadow = any_hit(&tree, &triangles, &sun);
    println!("{}", if shadow { "in shadow" } else { "in the sun" });

    // For many rays: eight children at a time, the same answers bit by bit.
    let wide = WideBvh::new(&tree, &triangles)?;
    assert_eq!((wide.nearest_hit(&down), wide.any_hit(&sun)), (Some(hit), shadow));
    println!("the wide layout takes {} bytes and agrees", wide.bytes());
    Ok(())
}
