//! The crate `tinybvh-rs`, a wrapper of the C++ library tinybvh.

use super::{Built, Theirs, convert};
use crate::measure::Query;
use crate::measure::speed::{Contender, Tracer, timed};
use bvh_core::{Aabb, Hit, Ray, Triangle};
use std::time::Instant;
use tinybvh_rs::{Intersection, Intersector, Ray as TheirRay, bvh};
#[cfg(target_feature = "avx2")]
use tinybvh_rs::{bvh8_cpu, mbvh};

fn vertices(triangles: &[Triangle]) -> Vec<[f32; 4]> {
    triangles.iter().flat_map(|triangle| triangle.0).map(|p| [p.x, p.y, p.z, 0.0]).collect()
}

/// Its binned builder over the triangles' boxes, leaves split down to one triangle afterwards.
pub(super) fn build(triangles: &[Triangle], boxes: &[Aabb]) -> Result<Built, String> {
    let vertices = vertices(triangles);
    let start = Instant::now();
    let mut built = bvh::BVH::new(vertices.as_slice().into()).map_err(|error| error.to_string())?;
    built.split_leaves(1);
    let seconds = start.elapsed().as_secs_f64();
    let (nodes, ids) = (built.nodes(), built.indices());
    let tree = convert(boxes, |index| {
        let (first, count) = (nodes[index].left_first as usize, nodes[index].tri_count as usize);
        let content = match count {
            0 => Theirs::Inner([first, first + 1]),
            _ => Theirs::Leaf(ids[first..first + count].to_vec()),
        };
        (Aabb::EMPTY, content)
    });
    Ok(Built::tight(tree, seconds, boxes))
}

/// The binary tree with its own leaves and, in a program compiled for a processor with AVX2, its eight-wide layout: of
/// that tree and of the one with split triangles (SBVH).
pub(super) fn contenders(triangles: &[Triangle]) -> Result<Vec<Contender<'_>>, String> {
    let start = Instant::now();
    binary(&vertices(triangles))?;
    let binary_seconds = start.elapsed().as_secs_f64();
    let trace_binary = move |_: Query, rays: &[Ray], hits: &mut [Option<Hit>]| {
        // The tree borrows the vertices: it is built anew for every turn, outside the time.
        let vertices = vertices(triangles);
        match binary(&vertices) {
            Ok(tree) => trace(&tree, rays, hits),
            Err(_) => Vec::new(),
        }
    };
    let contender = |layout: &str, preparation_seconds, trace| Contender {
        layout: layout.into(),
        preparation_seconds,
        tracer: Tracer::Other(trace),
    };
    #[cfg_attr(not(target_feature = "avx2"), allow(unused_mut, reason = "no wide layouts without"))]
    let mut contenders = vec![contender("binary, their own", binary_seconds, Box::new(trace_binary) as _)];
    #[cfg(target_feature = "avx2")]
    for (layout, split_triangles) in [("wide, their own", false), ("wide, split triangles", true)] {
        let vertices = vertices(triangles);
        let start = Instant::now();
        let build = if split_triangles { bvh::BVH::new_hq } else { bvh::BVH::new };
        let mut tree = build(vertices.as_slice().into()).map_err(|error| error.to_string())?;
        tree.split_leaves(4);
        let wide = bvh8_cpu::BVH::new(&mbvh::BVH::new(&tree)).map_err(|error| error.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let trace_wide = move |_: Query, rays: &[Ray], hits: &mut [Option<Hit>]| trace(&wide, rays, hits);
        contenders.push(contender(layout, seconds, Box::new(trace_wide) as _));
    }
    Ok(contenders)
}

fn binary(vertices: &[[f32; 4]]) -> Result<bvh::BVH<'_>, String> {
    bvh::BVH::new(vertices.into()).map_err(|error| error.to_string())
}

/// A ray with the room behind it that the C++ library takes to be part of it: its type has 128 bytes, that of the
/// wrapper
/// 64. The wrapper's constructor writes beyond these, and is not used for that reason.
#[repr(C, align(64))]
struct Padded {
    ray: TheirRay,
    rest: [u64; 8],
}

fn theirs(ray: &Ray) -> TheirRay {
    // As the C++ constructor does it.
    let far = |x: f32| if x >= 0.0 { tinybvh_rs::INFINITE } else { -tinybvh_rs::INFINITE };
    let reciprocal = |x: f32| if x.abs() > 1e-12 { 1.0 / x } else { far(x) };
    let (origin, dir) = (ray.origin().to_array(), ray.direction().to_array());
    let hit = Intersection { t: ray.t_max().min(tinybvh_rs::INFINITE), ..Intersection::new() };
    // The first padding is a mask of what may be met.
    TheirRay { origin, dir, r_d: dir.map(reciprocal), hit, padding_0: 0xffff, ..TheirRay::default() }
}

/// The wrapper has no any-hit traversal: shadow rays look for the nearest hit too.
fn trace(tree: &impl Intersector, rays: &[Ray], hits: &mut [Option<Hit>]) -> Vec<f64> {
    let rays: Vec<TheirRay> = rays.iter().map(theirs).collect();
    timed(&rays, hits, |ray| {
        let mut padded = Padded { ray: *ray, rest: [0; 8] };
        tree.intersect(&mut padded.ray);
        std::hint::black_box(&padded.rest);
        let hit = padded.ray.hit;
        (hit.t < ray.hit.t).then_some(Hit { t: hit.t, object: hit.prim })
    })
}
