//! Calls with a filter that accepts every hit, in relation to the same calls without a filter.
//!
//! `cargo bench -p bvh-build --bench filters`
//!
//! Both contenders trace in turns on one thread; the ratio is the median over the rounds. The scene
//! is the packed scene of the benchmark `instances`, written out.

mod balls;

use balls::{ball, camera, compare, copied, layout, print_head, random, transforms};
use bvh_core::{Aabb, Coherence, Hit, Ray, WideBvh, boxes};

/// The number of balls.
const COPIES: usize = 64;

fn main() {
    let triangles = copied(&ball(3), &transforms(COPIES, 2.2));
    let wide = layout(&triangles);
    let bounds = Aabb::union_of(&boxes(&triangles));
    print_head("without, M/s", "with, M/s");
    measure("coherent", &wide, &camera(&bounds), Coherence::Coherent);
    measure("incoherent", &wide, &random(&bounds), Coherence::Incoherent);
}

fn measure(name: &str, wide: &WideBvh, rays: &[Ray], coherence: Coherence) {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut filtered = hits.clone();
    compare(
        &format!("{name}, batch, nearest"),
        rays.len(),
        || wide.nearest_hits(rays, &mut hits, coherence),
        || wide.nearest_hits_where(rays, &mut filtered, coherence, |_, _| true),
    );
    assert_eq!(hits, filtered);
    compare(
        &format!("{name}, single, nearest"),
        rays.len(),
        || {
            for (ray, hit) in rays.iter().zip(&mut hits) {
                *hit = wide.nearest_hit(ray).unwrap_or(Hit::MISS);
            }
        },
        || {
            for (ray, hit) in rays.iter().zip(&mut filtered) {
                *hit = wide.nearest_hit_where(ray, |_| true).unwrap_or(Hit::MISS);
            }
        },
    );
    assert_eq!(hits, filtered);
    let mut found = vec![false; rays.len()];
    let mut found_filtered = found.clone();
    compare(
        &format!("{name}, batch, any"),
        rays.len(),
        || wide.any_hits(rays, &mut found, coherence),
        || wide.any_hits_where(rays, &mut found_filtered, coherence, |_, _| true),
    );
    assert_eq!(found, found_filtered);
    compare(
        &format!("{name}, single, any"),
        rays.len(),
        || {
            for (ray, hit) in rays.iter().zip(&mut found) {
                *hit = wide.any_hit(ray);
            }
        },
        || {
            for (ray, hit) in rays.iter().zip(&mut found_filtered) {
                *hit = wide.any_hit_where(ray, |_| true);
            }
        },
    );
    assert_eq!(found, found_filtered);
}
