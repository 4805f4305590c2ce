//! Procedural stand-ins for the five scenes of the paper.
//!
//! The originals are no longer distributed. The stand-ins have the originals' sizes and character,
//! but different triangles: compare ratios to the greedy tree's cost, never absolute costs. Every
//! generator is deterministic to the bit on every machine.

mod bijou;
mod cloister;
mod escher;
mod konistil;
mod mesh_builder;
mod pinecon2;

use bvh_core::Triangle;
pub use mesh_builder::{cos_sin, jitter};

/// Generates a scene, in a few milliseconds.
pub type Generator = fn() -> Vec<Triangle>;

/// The five mesh scenes, in the order of the paper's tables: the name of Ng & Trifonov's (2003)
/// original, the generator, and a description in one sentence.
pub const STAND_INS: [(&str, Generator, &str); 5] = [
    ("bijou", bijou::triangles, "A ring with a brilliant-cut stone and a chain, on a cushion."),
    ("cloister", cloister::triangles, "An arcaded courtyard with groin vaults and tiled roofs."),
    ("escher", escher::triangles, "Staircases that interlock under three directions of gravity."),
    ("konistil", konistil::triangles, "A valley with a town and a railway, in millimetres."),
    ("pinecon2", pinecon2::triangles, "A fractal pine cone whose scales carry smaller scales."),
];
