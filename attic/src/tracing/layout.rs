//! The layouts of our trees for tracing, and the instruction sets that they are limited to.

use super::answers::SOME_HIT;
use super::contender::{BATCH, Batch, Contender, Tracer, in_batches};
use bvh_core::cost::SahConstants;
use bvh_core::{
    Bvh, Corners, DRay, DTriangle, DWideBvh, Hit, InvalidBvh, Kernel, Ray, Select, Triangle,
    WideBvh, collapse_leaves,
};
use bvh_scenes::Scene;
use bvh_scenes::trace::{Accelerator, Query, Structure};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::time::Instant;

/// A way to lay out one of our trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// The unmodified tree.
    Binary,
    /// The tree with merged leaves where the surface area heuristic, both constants 1, favours
    /// them.
    BinaryLeaves,
    /// [`WideBvh`] with the best instructions of this machine.
    Wide,
    /// A second copy of `Wide`; its times differ from the first copy's only by noise.
    WideAgain,
    /// [`WideBvh`] that traces batches of rays, coherent or incoherent according to their kind.
    WideBatches,
    /// A second copy of `WideBatches`; its times differ from the first copy's only by noise.
    WideBatchesAgain,
    /// [`WideBvh`] with portable code.
    WidePortable,
    /// [`DWideBvh`], the same triangles and rays in f64.
    WideDouble,
    /// [`DWideBvh`] that traces batches of rays.
    WideBatchesDouble,
}

/// An instruction set of the vector kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Instructions {
    /// AVX-512, with packets and many rays in flight.
    #[serde(rename = "AVX-512")]
    Avx512,
    /// AVX2.
    #[serde(rename = "AVX2")]
    Avx2,
}

impl Instructions {
    fn kernel(self) -> Kernel {
        match self {
            Self::Avx512 => Kernel::Avx512,
            Self::Avx2 => Kernel::Avx2,
        }
    }
}

/// Returns true if a layout with this name is a second copy, measured for its noise.
pub fn is_repeat(layout: &str) -> bool {
    layout.ends_with(", again")
}

/// Returns true if a layout with this name traces rays in f64.
pub fn is_double(layout: &str) -> bool {
    layout.contains("double")
}

/// Returns true if a layout with this name traces rays one by one.
pub fn is_single(layout: &str) -> bool {
    !["batches", "packets", "blocks"].iter().any(|word| layout.contains(word))
}

/// Returns the name of a kernel's instruction set in tables.
fn instructions_of(kernel: Kernel) -> &'static str {
    match kernel {
        Kernel::Avx512 => "AVX-512",
        Kernel::Avx2 => "AVX2",
        Kernel::Simd128 => "128 bits",
        Kernel::Portable => COMPILED,
    }
}

/// The name in tables for code without intrinsics, whose instruction set the compiler chose.
pub const COMPILED: &str = "as compiled";

impl Layout {
    /// The layout's name in tables.
    fn name(self) -> &'static str {
        match self {
            Self::Binary => "binary",
            Self::BinaryLeaves => "binary, merged leaves",
            Self::Wide => "wide",
            Self::WideAgain => "wide, again",
            Self::WideBatches => "wide, batches",
            Self::WideBatchesAgain => "wide, batches, again",
            Self::WidePortable => "wide, portable",
            Self::WideDouble => "wide, double",
            Self::WideBatchesDouble => "wide, batches, double",
        }
    }

    /// Returns true if the vector kernels trace the layout.
    fn has_kernels(self) -> bool {
        !matches!(self, Self::Binary | Self::BinaryLeaves | Self::WidePortable)
    }
}

/// Lays out a tree of ours, valid over the scene, in each of the layouts.
///
/// Layouts with vector kernels are limited to each of the instruction sets in turn, by default to
/// the best available one. Wide layouts are made for rays that enter the tree's nodes as often as
/// `visits` states, otherwise for random lines.
pub fn own_contenders<'a>(
    layouts: &[Layout],
    instructions: &[Instructions],
    scene: &'a Scene,
    tree: &'a Bvh,
    visits: Option<&[f32]>,
) -> Result<Vec<Contender<'a>>, String> {
    let mut contenders = Vec::new();
    for &layout in layouts {
        for kernel in kernels(layout, instructions) {
            contenders.push(own_contender(layout, kernel, scene, tree, visits)?);
        }
    }
    Ok(contenders)
}

/// Returns the kernels that trace a layout.
fn kernels(layout: Layout, instructions: &[Instructions]) -> Vec<Kernel> {
    // These layouts have one implementation, whatever the processor.
    if !layout.has_kernels() {
        return vec![Kernel::Portable];
    }
    if instructions.is_empty() {
        return vec![Kernel::best()];
    }
    instructions
        .iter()
        .map(|instructions| instructions.kernel())
        // Results name what was measured, so a missing instruction set has no row.
        .filter(|kernel| kernel.is_available())
        .collect()
}

fn own_contender<'a>(
    layout: Layout,
    kernel: Kernel,
    scene: &'a Scene,
    tree: &'a Bvh,
    visits: Option<&[f32]>,
) -> Result<Contender<'a>, String> {
    let triangles = scene.triangles().map_err(|error| error.to_string())?;
    let start = Instant::now();
    let wide = match layout {
        Layout::Binary | Layout::BinaryLeaves | Layout::WideDouble | Layout::WideBatchesDouble => {
            None
        }
        _ => Some(match visits {
            Some(visits) => WideBvh::for_rays(tree, triangles, visits),
            None => WideBvh::new(tree, triangles),
        }),
    };
    let tracer = match wide {
        None if is_double(layout.name()) => {
            let wide = double(tree, triangles).map_err(|error| error.to_string())?;
            let wide =
                wide.with_kernel(kernel).ok_or_else(|| format!("{kernel:?} is not available"))?;
            let is_single = layout == Layout::WideDouble;
            let call = move |batch: &Batch, hits: &mut [Option<Hit>]| {
                in_double(&wide, is_single, batch, hits)
            };
            Tracer::Other(Box::new(move |batch, hits| Ok(in_batches(batch, hits, &call))))
        }
        None => {
            let tree = match layout {
                Layout::Binary => Cow::Borrowed(tree),
                _ => Cow::Owned(collapse_leaves(tree, &SahConstants::default())),
            };
            Tracer::Own(Accelerator::new(&scene.primitives, Structure::Tree(tree)))
        }
        Some(wide) => {
            let wide = wide
                .map_err(|error| error.to_string())?
                .with_kernel(kernel)
                .ok_or_else(|| format!("{kernel:?} is not available"))?;
            match layout {
                Layout::Wide | Layout::WideAgain => {
                    Tracer::Own(Accelerator::new(&scene.primitives, Structure::Wide(wide)))
                }
                Layout::WidePortable => {
                    let structure = Structure::WidePortable(wide);
                    Tracer::Own(Accelerator::new(&scene.primitives, structure))
                }
                _ => Tracer::Batches(wide),
            }
        }
    };
    Ok(Contender {
        layout: layout.name().into(),
        instructions: instructions_of(kernel).into(),
        version: env!("CARGO_PKG_VERSION").into(),
        preparation_seconds: start.elapsed().as_secs_f64(),
        tracer,
    })
}

/// Lays out a tree over the same triangles in f64, in a frame around their middle.
fn double(tree: &Bvh, triangles: &[Triangle]) -> Result<DWideBvh, InvalidBvh> {
    let triangles: Vec<DTriangle> =
        triangles.iter().map(|triangle| DTriangle(triangle.corners())).collect();
    let frame = DWideBvh::centred(&triangles);
    let mut tree = tree.clone();
    tree.refit(&DWideBvh::boxes(&triangles, &frame));
    tree.frame = Some(frame);
    DWideBvh::new(&tree, &triangles)
}

/// Answers the rays of one call in f64, singly or together, and returns its seconds. Rays are
/// converted before the clock starts, as those of other libraries are.
fn in_double(
    wide: &DWideBvh,
    is_single: bool,
    &Batch { query, coherence, rays, .. }: &Batch,
    hits: &mut [Option<Hit>],
) -> f64 {
    let all = Select::default();
    let is_any = query == Query::Any;
    let ray = |ray: &Ray| {
        let [origin, direction] = [ray.origin(), ray.direction()].map(|p| p.as_dvec3());
        DRay::new(origin, direction, ray.t_min().into(), ray.t_max().into())
            .expect("numbers of f32 that are rays there")
    };
    let rays: Vec<DRay> = rays.iter().map(ray).collect();
    let (mut nearest, mut any) = ([None; BATCH], [false; BATCH]);
    let (nearest, any) = (&mut nearest[..rays.len()], &mut any[..rays.len()]);
    let start = Instant::now();
    match (is_single, is_any) {
        (true, true) => {
            for (any, ray) in any.iter_mut().zip(&rays) {
                *any = wide.any_hit(ray, all);
            }
        }
        (true, false) => {
            for (nearest, ray) in nearest.iter_mut().zip(&rays) {
                *nearest = wide.nearest_hit(ray, all);
            }
        }
        (_, true) => wide.any_hits(&rays, all, any, coherence),
        (_, false) => wide.nearest_hits(&rays, all, nearest, coherence),
    }
    let seconds = start.elapsed().as_secs_f64();
    for ((hit, nearest), any) in hits.iter_mut().zip(nearest).zip(any) {
        *hit = match is_any {
            true => any.then_some(SOME_HIT),
            false => nearest.map(|hit| Hit { t: hit.t as f32, object: hit.object }),
        };
    }
    seconds
}
