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
            let corners = (scene.triangles)().into_iter().flat_map(|triangle| triangle.0);
            let coordinates = corners.flat_map(|corner| corner.to_array());
            (scene.name, fnv1a(coordinates.flat_map(f32::to_le_bytes)))
        });
        assert_eq!(made, pinned, "{made:#x?}");
    }
}
