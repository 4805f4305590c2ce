//! The crate `obvhs`: parallel locally ordered clustering, then reinsertion.

use crate::tracing::contender::{Batch, Contender, Trace, Tracer, timed};
use crate::tracing::layout::COMPILED;
use crate::{Racer, tight};
use ::obvhs::bvh2::{Bvh2, builder as binary, node::Bvh2Node};
use ::obvhs::cwbvh::{CwBvh, builder as wide};
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use ::obvhs::rt_triangle::RtTriangle;
use ::obvhs::triangle::Triangle as TheirTriangle;
use ::obvhs::{BvhBuildParams, aabb};
use bvh_config::{OutOfRange, fault};
use bvh_core::{Aabb, Bvh, FirstCountNode, Hit, Ray, Triangle};
use bvh_scenes::trace::Query;
use glam::Vec3A;
use harness::peers::{BuildFault, Built, Library, Task};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use toml::Table;

bvh_config::config! { serde;
    /// Settings of `obvhs`.
    pub struct Obvhs {
        /// The library's preset.
        preset: Preset;
        /// The fraction of nodes that are reinserted, `reinsertion_batch_ratio`; above 1, nodes
        /// are reinserted repeatedly. Default the preset's.
        reinsertion: Option<f32>, in 0.0..=100.0;
    }
}

/// The presets of `obvhs`, named like its functions without `_build`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    Fastest,
    VeryFast,
    Fast,
    #[default]
    Medium,
    Slow,
    VerySlow,
}

/// The crate as a method.
pub struct Crate;

impl Library for Crate {
    fn name(&self) -> &'static str {
        "obvhs"
    }

    fn check(&self, settings: &Table) -> Result<(), OutOfRange> {
        read(settings).map(|_| ())
    }

    fn build(&self, settings: &Table, task: &Task) -> Result<Built, BuildFault> {
        Ok(build(&read(settings)?, task.boxes))
    }
}

impl Racer for Crate {
    fn contenders<'a>(
        &self,
        settings: &Table,
        triangles: &'a [Triangle],
    ) -> Result<Vec<Contender<'a>>, OutOfRange> {
        Ok(contenders(&read(settings)?, triangles))
    }
}

fn read(settings: &Table) -> Result<Obvhs, OutOfRange> {
    fault::deserialize(settings.clone())
}

fn parameters(config: &Obvhs) -> BvhBuildParams {
    let mut parameters = match config.preset {
        Preset::Fastest => BvhBuildParams::fastest_build(),
        Preset::VeryFast => BvhBuildParams::very_fast_build(),
        Preset::Fast => BvhBuildParams::fast_build(),
        Preset::Medium => BvhBuildParams::medium_build(),
        Preset::Slow => BvhBuildParams::slow_build(),
        Preset::VerySlow => BvhBuildParams::very_slow_build(),
    };
    if let Some(ratio) = config.reinsertion {
        parameters.reinsertion_batch_ratio = ratio;
    }
    parameters
}

/// Returns the library's tree over boxes and the time by the library's stopwatch.
fn build_over(boxes: &[Aabb], parameters: BvhBuildParams) -> (Bvh2, Duration) {
    let theirs: Vec<aabb::Aabb> =
        boxes.iter().map(|b| aabb::Aabb::new(b.min.into(), b.max.into())).collect();
    let mut time = Duration::ZERO;
    (binary::build_bvh2(&theirs, parameters, &mut time), time)
}

/// Converts a tree that [`Target::OBVHS`](bvh_core::export::Target::OBVHS) fits. `bvh2_to_cwbvh`
/// makes the library's wide tree of the result.
pub fn to_theirs(tree: &Bvh) -> Bvh2 {
    let node = |node: FirstCountNode| {
        let aabb = aabb::Aabb::new(node.min.into(), node.max.into());
        Bvh2Node::new(aabb, node.count, node.first)
    };
    Bvh2 {
        nodes: tree.to_first_count().into_iter().map(node).collect(),
        primitive_indices: tree.prim_ids.clone(),
        children_are_ordered_after_parents: true,
        max_depth: tree.depth() + 1,
        ..Default::default()
    }
}

/// Converts a tree to our type.
pub fn to_our_tree(theirs: &Bvh2) -> Bvh {
    if theirs.primitive_indices.is_empty() {
        return Bvh::default();
    }
    let nodes: Vec<FirstCountNode> = theirs
        .nodes
        .iter()
        .map(|node| FirstCountNode {
            min: node.aabb().min.into(),
            first: node.first_index,
            max: node.aabb().max.into(),
            count: node.prim_count,
        })
        .collect();
    Bvh::from_first_count(&nodes, &theirs.primitive_indices)
        .unwrap_or_else(|error| panic!("obvhs built no tree: {error}"))
}

/// Converts a ray.
pub fn to_their_ray(ray: &Ray) -> TheirRay {
    TheirRay::new(ray.origin().into(), ray.direction().into(), ray.t_min(), ray.t_max())
}

/// Builds over boxes, with one object per leaf and no split triangles. The library's stopwatch
/// excludes conversions and checks.
pub fn build(config: &Obvhs, boxes: &[Aabb]) -> Built {
    let parameters =
        BvhBuildParams { max_prims_per_leaf: 1, pre_split: false, ..parameters(config) };
    let (theirs, time) = build_over(boxes, parameters);
    tight(to_our_tree(&theirs), time.as_secs_f64(), boxes)
}

/// Makes a [`Trace`] from a tree and its library's triangles. It is a macro because the library's
/// trees share functions but no trait. Triangles are in the order of leaves, as it recommends.
macro_rules! traced_by {
    ($tree:ident, $triangles:expr) => {{
        let triangles: Vec<RtTriangle> =
            $tree.primitive_indices.iter().map(|&id| (&$triangles[id as usize]).into()).collect();
        Box::new(move |batch: &Batch, hits: &mut [Option<Hit>]| {
            let traverse = |any, ray, hit: &mut RayHit| {
                let test = |ray: &TheirRay, id: usize| triangles[id].intersect(ray);
                if any {
                    !$tree.ray_traverse_miss(ray, test)
                } else {
                    $tree.ray_traverse(ray, hit, test)
                }
            };
            Ok(trace(batch, hits, traverse, &$tree.primitive_indices))
        })
    }};
}

/// Returns the traversal of a binary tree. The library expects rays with unit directions; ours have
/// unit length up to rounding.
pub fn trace_binary(tree: Bvh2, triangles: &[TheirTriangle]) -> Trace<'static> {
    traced_by!(tree, triangles)
}

/// Returns the traversal of a compressed eight-wide tree.
pub fn trace_wide(tree: CwBvh, triangles: &[TheirTriangle]) -> Trace<'static> {
    traced_by!(tree, triangles)
}

/// Returns triangles as the library builds over them.
pub fn triangles(triangles: &[Triangle]) -> Vec<TheirTriangle> {
    let theirs = |&Triangle(corners)| {
        let [v0, v1, v2] = corners.map(Vec3A::from);
        TheirTriangle { v0, v1, v2 }
    };
    triangles.iter().map(theirs).collect()
}

/// Returns the preset's binary tree and its compressed eight-wide tree.
fn contenders(config: &Obvhs, over: &[Triangle]) -> Vec<Contender<'static>> {
    let theirs = triangles(over);
    let mut times = [Duration::ZERO; 2];
    let tree = binary::build_bvh2_from_tris(&theirs, parameters(config), &mut times[0]);
    let compressed = wide::build_cwbvh_from_tris(&theirs, parameters(config), &mut times[1]);
    vec![
        contender("binary, their own", times[0], trace_binary(tree, &theirs)),
        contender("wide, their own", times[1], trace_wide(compressed, &theirs)),
    ]
}

fn contender(layout: &str, time: Duration, trace: Trace<'static>) -> Contender<'static> {
    Contender {
        layout: layout.into(),
        instructions: COMPILED.into(),
        version: env!("ATTIC_OBVHS").into(),
        preparation_seconds: time.as_secs_f64(),
        tracer: Tracer::Other(trace),
    }
}

/// Traces a batch by one of the library's trees, as [`Trace`] says. `traverse` answers one ray, an
/// any-hit query if its first argument is true; `ids` are the objects in the order of the leaves.
#[inline(always)]
fn trace(
    batch: &Batch,
    hits: &mut [Option<Hit>],
    traverse: impl Fn(bool, TheirRay, &mut RayHit) -> bool,
    ids: &[u32],
) -> Vec<f64> {
    let rays: Vec<TheirRay> = batch.rays.iter().map(to_their_ray).collect();
    if batch.query == Query::Any {
        return timed(&rays, hits, |&ray| {
            traverse(true, ray, &mut RayHit::none()).then_some(Hit { t: 0.0, object: 0 })
        });
    }
    timed(&rays, hits, |&ray| {
        let mut hit = RayHit::none();
        traverse(false, ray, &mut hit)
            .then(|| Hit { t: hit.t, object: ids[hit.primitive_id as usize] })
    })
}
