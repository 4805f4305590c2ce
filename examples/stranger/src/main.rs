//! A program of a stranger who uses `bvh-search`: loads a mesh, bakes it for a second, traces a
//! million rays, finds the closest triangle of a point, saves the tree, and maps the file.
//!
//! `cargo run --release --manifest-path examples/stranger/Cargo.toml [scene.obj]`

use bvh_search::prelude::*;
use std::error::Error;
use std::f32::consts::TAU;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let knot = concat!(env!("CARGO_MANIFEST_DIR"), "/knot.obj").to_string();
    let mut triangles = Vec::new();
    let path = std::env::args().nth(1).unwrap_or(knot);
    let (models, _materials) = tobj::load_obj(path, &tobj::GPU_LOAD_OPTIONS)?;
    for model in models {
        let positions = model.mesh.positions.as_chunks::<3>().0;
        let indices = model.mesh.indices.as_chunks().0;
        triangles.extend(Triangle::from_mesh(positions, indices)?);
    }
    let boxes = boxes(&triangles);
    let found = bake(&boxes, Duration::from_secs(1))?;
    println!(
        "{} triangles, cost {} after {} moves",
        triangles.len(),
        found.cost,
        found.evaluations
    );

    let wide = WideBvh::new(&found.tree, &triangles)?;
    let bounds = found.tree.root_aabb().ok_or("an empty scene")?;
    let mut rays = Vec::new();
    for i in 0..1_000_000 {
        rays.push(ray(i, &bounds)?);
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    let start = Instant::now();
    wide.nearest_hits(&rays, &mut hits, Coherence::Incoherent);
    let met = hits.iter().filter(|hit| !hit.is_miss()).count();
    println!("{met} of a million rays hit, in {:.0} ms", start.elapsed().as_secs_f64() * 1e3);

    let point = Vec3::splat(0.5);
    let near = wide.closest_point(point).ok_or("an empty scene")?;
    println!("closest to {point} is {} of triangle {}", near.point, near.object);

    let path = std::env::temp_dir().join(format!("stranger.{}.bvh", std::process::id()));
    std::fs::write(
        &path,
        file::save(&found.tree, &boxes, &file::Origin { method: "best", ..Default::default() })?,
    )?;
    // SAFETY: the name of the file contains this process's number, and this process has finished
    // writing, so that nobody changes the file while it is mapped.
    let map = unsafe { memmap2::Mmap::map(&std::fs::File::open(&path)?)? };
    std::fs::remove_file(&path)?;
    let mapped = file::TreeFile::open(&map)?.for_boxes(&boxes)?;
    let view = mapped.view()?;
    for (ray, hit) in rays.iter().zip(&hits) {
        let mapped_hit = nearest_hit(view, &triangles, ray).unwrap_or(Hit::MISS);
        assert_eq!(mapped_hit, *hit, "the mapped tree and the wide layout disagree");
    }
    Ok(())
}

/// Returns a fraction from 0 to 1 that multiplication by a large odd number scatters.
fn scattered(i: u32, factor: u32) -> f32 {
    (i.wrapping_mul(factor) >> 8) as f32 / (1 << 24) as f32
}

/// Returns a ray from a point on a sphere around the scene to a point in the scene's box.
fn ray(i: u32, bounds: &Aabb) -> Result<Ray, Box<dyn Error>> {
    let size = bounds.max - bounds.min;
    // Points with uniform z are uniform on the sphere (Archimedes).
    let z = 2.0 * scattered(i, 2_654_435_769) - 1.0;
    let angle = TAU * scattered(i, 3_242_174_889);
    let radius = (1.0 - z * z).sqrt();
    let direction = Vec3::new(angle.cos() * radius, angle.sin() * radius, z);
    let from = bounds.min + 0.5 * size + size.length() * direction;
    let part = Vec3::new(
        scattered(i, 2_447_445_413),
        scattered(i, 1_640_531_527),
        scattered(i, 374_761_393),
    );
    let to = bounds.min + size * part;
    Ok(Ray::half_line(from, to - from)?)
}
