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
    /// The name on the command line and in specs.
    pub name: &'static str,
    /// The original scene of Ng & Trifonov (2003), in their spelling.
    pub original: &'static str,
    /// A description in one sentence.
    pub character: &'static str,
    /// The number of triangles that `triangles` returns.
    pub triangle_count: usize,
    /// The generator, which takes a few milliseconds.
    pub triangles: fn() -> Vec<Triangle>,
}

/// The five mesh scenes, in the order of the paper's tables.
pub const STAND_INS: [StandIn; 5] = [
    StandIn {
        name: "bijou",
        original: "bijou",
        character: "A ring with a brilliant-cut stone, a halo, pavé shoulders and a chain on a \
                    cushion.",
        triangle_count: 32_892,
        triangles: bijou::triangles,
    },
    StandIn {
        name: "cloister",
        original: "Cloister",
        character: "An arcaded courtyard: twin columns, round arches, groin vaults, tiled roofs, \
                    a well.",
        triangle_count: 83_634,
        triangles: cloister::triangles,
    },
    StandIn {
        name: "escher",
        original: "escher",
        character: "Staircases, landings, arches and balustrades that interlock under three \
                    directions of gravity.",
        triangle_count: 9_642,
        triangles: escher::triangles,
    },
    StandIn {
        name: "konistil",
        original: "konistil",
        character: "A valley with a town, a station, a viaduct and power lines, in millimetres on \
                    a map grid.",
        triangle_count: 42_446,
        triangles: konistil::triangles,
    },
    StandIn {
        name: "pinecon2",
        original: "pinecon2",
        character: "A fractal pine cone whose scales carry smaller scales on the same golden-angle \
                    spiral.",
        triangle_count: 10_008,
        triangles: pinecon2::triangles,
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fnv1a;

    #[test]
    fn no_machine_changes_a_bit_of_any_stand_in() {
        let pinned = [
            ("bijou", 0x9429_df24_df3f_272c),
            ("cloister", 0x17b2_6d6d_32c2_291d),
            ("escher", 0x0732_3635_9b09_ba2a),
            ("konistil", 0xe8ba_78f5_4cc0_a64c),
            ("pinecon2", 0xf4fc_e900_8b61_06f0),
        ];
        let made = STAND_INS.map(|scene| {
            let triangles = (scene.triangles)();
            assert_eq!(triangles.len(), scene.triangle_count, "{}", scene.name);
            let coordinates = triangles
                .iter()
                .flat_map(|triangle| triangle.0)
                .flat_map(|corner| corner.to_array());
            (scene.name, fnv1a(coordinates.flat_map(f32::to_le_bytes)))
        });
        assert_eq!(made, pinned, "{made:#x?}");
    }
}
