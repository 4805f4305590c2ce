//! The built-in scenes: stand-ins for the paper's five originals, and spheres for ray tracing.
//!
//! The originals are no longer distributed. The stand-ins have the originals' sizes and character, not their triangles:
//! compare ratios to the greedy tree's cost, never absolute costs. Every generator is deterministic to the bit on every
//! machine.

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
        triangle_count: 32_892,
        triangles: bijou::triangles,
    },
    StandIn {
        name: "cloister",
        original: "Cloister",
        character: "An arcaded courtyard: twin columns, round arches, groin vaults, tiled roofs, a well.",
        triangle_count: 83_634,
        triangles: cloister::triangles,
    },
    StandIn {
        name: "escher",
        original: "escher",
        character: "Staircases, landings, arches and balustrades that interlock under three directions of gravity.",
        triangle_count: 9_642,
        triangles: escher::triangles,
    },
    StandIn {
        name: "konistil",
        original: "konistil",
        character: "A valley with a town, a station, a viaduct and power lines, in millimetres on a map grid.",
        triangle_count: 42_446,
        triangles: konistil::triangles,
    },
    StandIn {
        name: "pinecon2",
        original: "pinecon2",
        character: "A fractal pine cone whose scales carry smaller scales on the same golden-angle spiral.",
        triangle_count: 10_008,
        triangles: pinecon2::triangles,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    /// FNV-1a, 64 bit, over the little-endian bytes of the coordinates.
    fn fingerprint(coordinates: impl Iterator<Item = f32>) -> u64 {
        coordinates
            .flat_map(f32::to_le_bytes)
            .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
    }

    #[test]
    fn every_stand_in_has_its_listed_count_and_only_finite_triangles_with_an_area() {
        for scene in STAND_INS {
            let triangles = (scene.triangles)();
            assert_eq!(triangles.len(), scene.triangle_count, "{}", scene.name);
            for [a, b, c] in triangles {
                assert!(a.is_finite() && b.is_finite() && c.is_finite(), "{}", scene.name);
                assert!(a != b && b != c && c != a, "{}", scene.name);
            }
        }
    }

    #[test]
    fn sizes_are_ordered_as_the_originals_were() {
        let count =
            |name: &str| STAND_INS.iter().find(|scene| scene.name == name).map(|scene| scene.triangle_count);
        let ascending = ["escher", "pinecon2", "bijou", "konistil", "cloister"].map(count);
        assert!(ascending.is_sorted() && ascending[0].is_some(), "{ascending:?}");
    }

    #[test]
    fn no_machine_changes_a_bit_of_any_scene() {
        let pinned = [
            ("bijou", 0x9429_df24_df3f_272c),
            ("cloister", 0x17b2_6d6d_32c2_291d),
            ("escher", 0x0732_3635_9b09_ba2a),
            ("konistil", 0xe8ba_78f5_4cc0_a64c),
            ("pinecon2", 0xf4fc_e900_8b61_06f0),
        ];
        let made = STAND_INS.map(|scene| {
            let triangles = (scene.triangles)();
            (scene.name, fingerprint(triangles.iter().flatten().flat_map(Vec3::to_array)))
        });
        assert_eq!(made, pinned, "{made:#x?}");
        let spheres = [75, 750, 7500].map(|count| {
            let spheres = spheres::spheres(count);
            fingerprint(spheres.iter().flat_map(|s| [s.center.x, s.center.y, s.center.z, s.radius]))
        });
        assert_eq!(
            spheres,
            [0xfc00_d4e2_6fbf_f38a, 0xbb9c_cd48_f5fe_ee71, 0x8b82_4c8d_585f_1de7],
            "{spheres:#x?}"
        );
    }

    #[test]
    fn root_boxes_have_the_order_of_magnitude_that_the_papers_costs_ask_for() {
        // The paper's base costs; a greedy tree costs some 10 to 100 times the half area of its root.
        let base = [1.710e7, 1.845e9, 4.820e5, 1.027e14, 1.361e6];
        for (scene, base) in STAND_INS.into_iter().zip(base) {
            let triangles = (scene.triangles)();
            let corners = || triangles.iter().flatten().map(|corner| corner.as_dvec3());
            let low = corners().reduce(|a, b| a.min(b)).unwrap_or_default();
            let size = corners().reduce(|a, b| a.max(b)).unwrap_or_default() - low;
            let ratio = base / (size.x * size.y + size.y * size.z + size.z * size.x);
            assert!((10.0..100.0).contains(&ratio), "{}: {ratio}", scene.name);
        }
    }
}
