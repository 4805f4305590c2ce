//! What a stranger does with `bvh-search`: load a mesh, bake it for a second, trace a million rays, ask, save and map.
//!
//! `cargo run --release --manifest-path examples/stranger/Cargo.toml [scene.obj]`

use bvh_search::prelude::*;
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let knot = concat!(env!("CARGO_MANIFEST_DIR"), "/knot.obj").to_string();
    let mut triangles = Vec::new();
    for model in tobj::load_obj(std::env::args().nth(1).unwrap_or(knot), &tobj::GPU_LOAD_OPTIONS)?.0
    {
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

    // A million rays from points of a sphere around the scene to points of its box.
    let wide = WideBvh::new(&found.tree, &triangles)?;
    let bounds = found.tree.root_aabb().ok_or("an empty scene")?;
    let size = bounds.max - bounds.min;
    let rays = (0..1_000_000u32).map(|i| {
        let part = |k: u32| (i.wrapping_mul(k) >> 8) as f32 / (1 << 24) as f32;
        let z = 2.0 * part(2_654_435_769) - 1.0;
        let angle = 6.283 * part(3_242_174_889);
        let around =
            Vec3::new(angle.cos() * (1.0 - z * z).sqrt(), angle.sin() * (1.0 - z * z).sqrt(), z);
        let from = bounds.min + 0.5 * size + size.length() * around;
        let to = bounds.min
            + size * Vec3::new(part(2_447_445_413), part(1_640_531_527), part(374_761_393));
        Ray::half_line(from, to - from)
    });
    let rays: Vec<Ray> = rays.collect::<Result<_, _>>()?;
    let mut hits = vec![Hit::MISS; rays.len()];
    let start = Instant::now();
    wide.nearest_hits(&rays, &mut hits, Coherence::Incoherent);
    let met = hits.iter().filter(|hit| !hit.is_miss()).count();
    println!("{met} of a million rays hit, in {:.0} ms", start.elapsed().as_secs_f64() * 1e3);

    let point = Vec3::splat(0.5);
    let closest = |id: u32| triangles[id as usize].closest_point(point);
    let distance = |id| Some(closest(id).distance_squared(point.as_dvec3()));
    let near =
        query::nearest(&found.tree, point, f64::INFINITY, distance).ok_or("an empty scene")?;
    println!("closest to {point} is {} of triangle {}", closest(near.object), near.object);

    let path = std::env::temp_dir().join(format!("stranger.{}.bvh", std::process::id()));
    std::fs::write(
        &path,
        file::save(&found.tree, &boxes, &file::Origin { method: "best", ..Default::default() })?,
    )?;
    // SAFETY: nobody else writes to the file of this process.
    let map = unsafe { memmap2::Mmap::map(&std::fs::File::open(&path)?)? };
    std::fs::remove_file(&path)?;
    let mapped = file::TreeFile::open(&map)?.for_boxes(&boxes)?;
    let view = mapped.view()?;
    let same =
        |(ray, hit): (&Ray, &Hit)| nearest_hit(view, &triangles, ray).unwrap_or(Hit::MISS) == *hit;
    assert!(rays.iter().zip(&hits).all(same), "the mapped tree answers as the wide layout");
    Ok(())
}
