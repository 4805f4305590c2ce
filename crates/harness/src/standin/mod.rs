//! The built-in scenes: procedural stand-ins for the paper's five originals, which are no longer distributed, and
//! the spheres of the ray tracing rows.
//!
//! They have the originals' sizes and character, not their triangles: compare ratios to the greedy tree's cost,
//! never absolute costs. Every generator is deterministic to the bit on every machine.

pub mod bijou;
pub mod cloister;
pub mod escher;
pub mod konistil;
pub mod patch;
pub mod pinecon2;
pub mod spheres;

use glam::Vec3;

/// One procedural scene and what it stands in for.
#[derive(Clone, Copy, Debug)]
pub struct StandIn {
    /// Name on the command line and in specs.
    pub name: &'static str,
    /// The original scene of Ng & Trifonov (2003), spelled as there.
    pub original: &'static str,
    /// What it looks like, in one sentence.
    pub character: &'static str,
    /// Number of triangles that `triangles` returns.
    pub triangle_count: usize,
    /// The generator; a few milliseconds.
    pub triangles: fn() -> Vec<[Vec3; 3]>,
}

/// The five mesh scenes, in the order of the paper's tables.
pub const STAND_INS: [StandIn; 5] = [
    StandIn {
        name: "bijou",
        original: "bijou",
        character: "A ring with a brilliant-cut stone, a halo, pavé shoulders and a chain on a cushion.",
        triangle_count: 0,
        triangles: bijou::triangles,
    },
    StandIn {
        name: "cloister",
        original: "Cloister",
        character: "An arcaded courtyard: twin columns, round arches, groin vaults, tiled roofs, a well.",
        triangle_count: 0,
        triangles: cloister::triangles,
    },
    StandIn {
        name: "escher",
        original: "escher",
        character: "Staircases, landings, arches and balustrades that interlock under three directions of gravity.",
        triangle_count: 0,
        triangles: escher::triangles,
    },
    StandIn {
        name: "konistil",
        original: "konistil",
        character: "A valley with a town, a station, a viaduct and power lines, in millimetres on a map grid.",
        triangle_count: 0,
        triangles: konistil::triangles,
    },
    StandIn {
        name: "pinecon2",
        original: "pinecon2",
        character: "A fractal pine cone whose scales carry smaller scales on the same golden-angle spiral.",
        triangle_count: 0,
        triangles: pinecon2::triangles,
    },
];
