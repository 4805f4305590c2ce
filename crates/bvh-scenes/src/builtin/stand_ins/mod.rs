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

/// A procedural scene that replaces an original.
#[derive(Clone, Copy, Debug)]
pub struct StandIn {
    /// The name on the command line and in specs, which is that of Ng & Trifonov's (2003) original.
    pub name: &'static str,
    /// A description in one sentence.
    pub character: &'static str,
    /// The generator, which takes a few milliseconds.
    pub triangles: fn() -> Vec<Triangle>,
}

/// The five mesh scenes, in the order of the paper's tables.
pub const STAND_INS: [StandIn; 5] = [
    StandIn {
        name: "bijou",
        character: "A ring with a brilliant-cut stone, a halo, pavé shoulders and a chain on a \
                    cushion.",
        triangles: bijou::triangles,
    },
    StandIn {
        name: "cloister",
        character: "An arcaded courtyard: twin columns, round arches, groin vaults, tiled roofs, \
                    a well.",
        triangles: cloister::triangles,
    },
    StandIn {
        name: "escher",
        character: "Staircases, landings, arches and balustrades that interlock under three \
                    directions of gravity.",
        triangles: escher::triangles,
    },
    StandIn {
        name: "konistil",
        character: "A valley with a town, a station, a viaduct and power lines, in millimetres on \
                    a map grid.",
        triangles: konistil::triangles,
    },
    StandIn {
        name: "pinecon2",
        character: "A fractal pine cone whose scales carry smaller scales on the same golden-angle \
                    spiral.",
        triangles: pinecon2::triangles,
    },
];
