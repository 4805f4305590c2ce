//! The layouts in which our trees are traced, and the instruction sets that they are held to.

use super::contender::{Contender, Tracer};
use bvh_core::cost::{self, SahConstants};
use bvh_core::{Bvh, InvalidBvh, Kernel, Triangle, WideBvh, collapse_leaves};
use bvh_scenes::Scene;
use bvh_scenes::trace::{Accelerator, Structure};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::time::Instant;

/// A way to lay out one of our trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// The tree as it is.
    Binary,
    /// The tree with its leaves merged where the surface area heuristic, both constants 1, says so.
    BinaryLeaves,
    /// [`WideBvh`] with the best instructions of this machine.
    Wide,
    /// [`WideBvh`] with the best instructions of this machine, laid out once more: only noise tells its times from those
    /// of `Wide`.
    WideAgain,
    /// [`WideBvh`] that is handed batches of rays, coherent or incoherent ones as their kind says.
    WideBatches,
    /// As `WideBatches`, laid out once more: the noise of batches.
    WideBatchesAgain,
    /// As `WideBatches`, laid out as if a block of triangles took half the time of a node.
    WideCheapBlocks,
    /// As `WideBatches`, laid out as if a block of triangles took twice the time of a node.
    WideDearBlocks,
    /// [`WideBvh`] with portable code.
    WidePortable,
}

/// An instruction set of the vector kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
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

/// Whether a layout of this name is one that is measured a second time, for the noise.
pub fn is_repeat(layout: &str) -> bool {
    layout.ends_with(", again")
}

/// Whether a layout of this name is called ray by ray.
pub fn is_single(layout: &str) -> bool {
    !["batches", "packets", "blocks"]
        .iter()
        .any(|word| layout.contains(word))
}

/// The name of a kernel's instruction set in tables.
fn instructions_of(kernel: Kernel) -> &'static str {
    match kernel {
        Kernel::Avx512 => "AVX-512",
        Kernel::Avx2 => "AVX2",
        Kernel::Portable => COMPILED,
    }
}

/// The instruction set of code without intrinsics, in tables: the one that the compiler chose.
pub const COMPILED: &str = "as compiled";

impl Layout {
    /// Whether it is traced by the vector kernels.
    fn has_kernels(self) -> bool {
        !matches!(self, Self::Binary | Self::BinaryLeaves | Self::WidePortable)
    }

    /// Whether it is made for random lines alone, whatever rays the tree is for.
    pub fn is_for_lines(self) -> bool {
        matches!(self, Self::WideCheapBlocks | Self::WideDearBlocks)
    }
}

/// The wide layout of a valid tree for rays that enter its nodes as often as `visits` says, else for random lines.
pub fn widened(
    tree: &Bvh,
    triangles: &[Triangle],
    visits: Option<&[f32]>,
) -> Result<WideBvh, InvalidBvh> {
    match visits {
        Some(visits) => WideBvh::for_rays(tree, triangles, visits),
        None => WideBvh::new(tree, triangles),
    }
}

/// One of our trees, valid over the scene, in each of these layouts and, where that has vector kernels, with each of these
/// instruction sets, by default the best that there is; wide ones for rays that enter the tree's nodes as often as `visits` says, if it does. An error says
/// why there is no such layout.
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

/// The kernels with which a layout is traced.
fn kernels(layout: Layout, instructions: &[Instructions]) -> Vec<Kernel> {
    if !layout.has_kernels() {
        return vec![Kernel::Portable];
    }
    if instructions.is_empty() {
        return vec![Kernel::best()];
    }
    let asked = instructions
        .iter()
        .map(|instructions| instructions.kernel());
    asked
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
    let triangles = scene
        .triangles()
        .map_err(|error| error.to_string())?;
    let accelerator = |structure| Tracer::Own(Accelerator::new(&scene.primitives, structure));
    let start = Instant::now();
    let held = |wide: Result<WideBvh, InvalidBvh>| {
        let wide = wide.map_err(|error| error.to_string())?;
        wide.with_kernel(kernel)
            .ok_or_else(|| format!("{kernel:?} is not available"))
    };
    let wide = || held(widened(tree, triangles, visits));
    let blocks = |cost| held(WideBvh::with_block_cost(tree, triangles, cost));
    let (name, tracer) = match layout {
        Layout::Binary => ("binary", accelerator(Structure::Tree(Cow::Borrowed(tree)))),
        Layout::BinaryLeaves => {
            let merged = collapse_leaves(tree, &SahConstants::default());
            ("binary, merged leaves", accelerator(Structure::Tree(Cow::Owned(merged))))
        }
        Layout::Wide => ("wide", accelerator(Structure::Wide(wide()?))),
        Layout::WideAgain => ("wide, again", accelerator(Structure::Wide(wide()?))),
        Layout::WideBatches => ("wide, batches", Tracer::Batches(wide()?)),
        Layout::WideBatchesAgain => ("wide, batches, again", Tracer::Batches(wide()?)),
        Layout::WideCheapBlocks => ("wide, cheap blocks", Tracer::Batches(blocks(0.5)?)),
        Layout::WideDearBlocks => ("wide, dear blocks", Tracer::Batches(blocks(2.0)?)),
        Layout::WidePortable => ("wide, portable", accelerator(Structure::WidePortable(wide()?))),
    };
    Ok(Contender {
        layout: name.into(),
        instructions: instructions_of(kernel).into(),
        version: env!("CARGO_PKG_VERSION").into(),
        preparation_seconds: start.elapsed().as_secs_f64(),
        tracer,
    })
}

/// Returns the surface area heuristic of a tree with both constants 1, after the best collapse of leaves.
pub fn collapsed_sah(tree: &Bvh) -> f64 {
    let constants = SahConstants::default();
    cost::sah(&collapse_leaves(tree, &constants), &constants)
}
