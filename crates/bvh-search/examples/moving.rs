//! Follows a moving mesh: refits every frame, and improves the tree briefly when its cost has
//! drifted.
//!
//! `cargo run -p bvh-search --example moving`

use bvh_search::prelude::*;
use std::error::Error;

const DRIFT: f64 = 1.15;

/// The corners of a sheet that is wound up, more with `time`.
fn sheet(time: f32) -> Vec<[f32; 3]> {
    let point = |i: u16| {
        let u = f32::from(i % 65) / 8.0 - 4.0;
        let v = f32::from(i / 65) / 8.0 - 4.0;
        let angle = time * (u * u + v * v).sqrt();
        [u * angle.cos() - v * angle.sin(), u * angle.sin() + v * angle.cos(), (time * u * v).sin()]
    };
    (0..65 * 65).map(point).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let indices: Vec<[u32; 3]> = (0..64 * 65)
        .filter(|i| i % 65 < 64)
        .flat_map(|i| [[i, i + 1, i + 65], [i + 66, i + 65, i + 1]])
        .collect();
    let mut triangles = Triangle::from_mesh(&sheet(0.3), &indices)?;
    let mut tree = bake(&boxes(&triangles), Duration::from_millis(200))?.tree;
    let mut wide = WideBvh::new(&tree, &triangles)?;
    let mut fresh = wide.expected_visits();
    let mut improved = 0;
    for frame in 1..=12u8 {
        triangles = Triangle::from_mesh(&sheet(0.3 + f32::from(frame) * 0.04), &indices)?;
        wide.refit(&triangles)?;
        let drift = wide.expected_visits() / fresh;
        print!("frame {frame:2}: {drift:.2} times the cost");
        if drift > DRIFT {
            // A renderer would refit and improve the tree in another thread, while it draws frames.
            let boxes = boxes(&triangles);
            tree.refit(&boxes);
            tree = improve(&tree, &boxes, Duration::from_millis(100))?.tree;
            wide = WideBvh::new(&tree, &triangles)?;
            fresh = wide.expected_visits();
            improved += 1;
            print!(", improved for 100 ms");
        }
        println!();
        let ray = Ray::half_line([0.3, 0.2, 9.0], [0.0, 0.0, -1.0])?;
        tree.refit(&boxes(&triangles));
        assert_eq!(wide.nearest_hit(&ray), nearest_hit(&tree, &triangles, &ray));
    }
    assert!(improved > 0);
    Ok(())
}
