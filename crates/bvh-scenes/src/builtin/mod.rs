//! Scenes that are generated in code, the same on every machine.

pub mod spheres;
pub mod stand_ins;
pub mod stiff;

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::Triangle;

    fn hash(numbers: impl IntoIterator<Item = f32>) -> u64 {
        crate::fnv1a(numbers.into_iter().flat_map(f32::to_le_bytes))
    }

    fn corners(triangles: Vec<Triangle>) -> impl Iterator<Item = f32> {
        triangles.into_iter().flat_map(|triangle| triangle.0).flat_map(|corner| corner.to_array())
    }

    #[test]
    fn no_machine_changes_a_bit_of_any_scene() {
        let stand_ins = stand_ins::STAND_INS.map(|scene| hash(corners((scene.triangles)())));
        let pinned = [
            0x9429_df24_df3f_272c,
            0x17b2_6d6d_32c2_291d,
            0x0732_3635_9b09_ba2a,
            0xe8ba_78f5_4cc0_a64c,
            0xf4fc_e900_8b61_06f0,
        ];
        assert_eq!(stand_ins, pinned, "{stand_ins:#x?}");
        let spheres = [75, 750, 7500].map(|count| {
            let spheres = spheres::spheres(count).into_iter();
            hash(spheres.flat_map(|s| [s.center.x, s.center.y, s.center.z, s.radius]))
        });
        let pinned = [0xfc00_d4e2_6fbf_f38a, 0xbb9c_cd48_f5fe_ee71, 0x8b82_4c8d_585f_1de7];
        assert_eq!(spheres, pinned, "{spheres:#x?}");
        let stiff = hash(stiff::STIFF.iter().flat_map(|(_, generator)| corners(generator(60))));
        assert_eq!(stiff, 0x3e21_837a_848d_954d, "{stiff:#x}");
    }
}
