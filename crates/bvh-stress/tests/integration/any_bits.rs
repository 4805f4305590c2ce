//! Boxes, triangles and rays of any bits: what is made of trees is valid, and every traversal
//! answers as testing every object does.

use crate::laws::any_boxes;
use bvh_build::{Builder, goldsmith_salmon, muller_fellner};
use bvh_core::cost::{self, SahConstants};
use bvh_core::{
    Aabb, Bvh, Primitives, Ray, Sphere, Triangle, any_hit_by, clip_to_box, collapse_leaves, file,
    nearest_hit_by, nearest_hit_of_all, validate,
};
use bvh_scenes::trace::KdTree;
use bvh_search::{Budget, Problem, best, lower_bound, optimize};
use bvh_stress::examine::ROUNDING;
use bvh_stress::tracing::{TRAVERSALS, bits, check};
use glam::Vec3;
use proptest::collection::vec;
use proptest::prelude::*;

/// Numbers of any bits, or one of a few, which coincide often.
fn numbers<const N: usize>(few: bool) -> impl Strategy<Value = [f32; N]> {
    const SPECIAL: [f32; 8] =
        [0.0, -0.0, 1.0, 1e-45, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    any::<[u32; N]>().prop_map(move |bits| {
        bits.map(|bits| match (few, bits % 16) {
            (true, _) => f32::from((bits >> 8) as i8) / 16.0,
            (false, 0) => SPECIAL[bits as usize / 16 % 8],
            (false, _) => f32::from_bits(bits),
        })
    })
}

/// Origin, direction and range of a ray, which may be none.
type MaybeRay = (Vec3, Vec3, (f32, f32));

fn triangles_and_rays() -> impl Strategy<Value = (Vec<Triangle>, Vec<MaybeRay>)> {
    (any::<[bool; 4]>(), 1u32..=254).prop_flat_map(|(modes, exponent)| {
        let [few, few_in_rays, is_scaled, is_ranged] = modes;
        let scale = if is_scaled { f32::from_bits(exponent << 23) } else { 1.0 };
        // Every scene rejects coordinates that are not finite.
        let finite = move |x: f32| if (x * scale).is_finite() { x * scale } else { 0.0 };
        let triangle = numbers::<9>(few).prop_map(move |[a, b, c, d, e, f, g, h, i]| {
            Triangle::from([[a, b, c], [d, e, f], [g, h, i]].map(|corner| corner.map(finite)))
        });
        let ray = numbers::<8>(few_in_rays).prop_map(move |[a, b, c, d, e, f, t_min, t_max]| {
            let origin = Vec3::new(a, b, c) * if few_in_rays { scale } else { 1.0 };
            let range = if is_ranged { (t_min, t_max) } else { (0.0, f32::INFINITY) };
            (origin, Vec3::new(d, e, f), range)
        });
        (vec(triangle, 0..12), vec(ray, 1..8))
    })
}

/// Checks that trees and a KD-tree over boxes, which are the objects themselves, give the answers
/// of testing every box. Rays of any bits meet boxes far more often than triangles.
fn check_boxes(boxes: &[Aabb], rays: &[Ray]) {
    let binary = muller_fellner::Config::default().build(boxes).unwrap();
    let wide = goldsmith_salmon::Config::default().build(boxes).unwrap();
    let cells = KdTree::build(boxes).unwrap();
    for ray in rays {
        let test = |id: u32, t_max| clip_to_box(ray, &boxes[id as usize], ray.t_min(), t_max);
        let any = |id: u32| test(id, ray.t_max()).is_some();
        let expected = nearest_hit_of_all(boxes.len() as u32, ray, test, &mut ());
        for tree in [&binary, &wide] {
            assert_eq!(bits(nearest_hit_by(tree, ray, test, &mut ())), bits(expected), "{ray:?}");
            assert_eq!(any_hit_by(tree, ray, any, &mut ()), expected.is_some(), "{ray:?}");
        }
        let nearest = cells.nearest_hit(ray, test, &mut ());
        assert_eq!(bits(nearest), bits(expected), "KD-tree: {ray:?}");
        assert_eq!(cells.any_hit(ray, any, &mut ()), expected.is_some(), "KD-tree: {ray:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn any_ray_is_answered_by_every_traversal_as_by_brute_force(
        (triangles, maybe_rays) in triangles_and_rays(),
    ) {
        let mut rays = Vec::new();
        for (origin, direction, (t_min, t_max)) in maybe_rays {
            // A ray is rejected only for its direction's length, a NaN, or a negative start.
            let length = direction.abs().max_element();
            match Ray::new(origin, direction, t_min, t_max) {
                Ok(ray) => rays.push(ray),
                Err(error) => prop_assert!(
                    !(origin + direction).is_finite()
                        || !(1e-30..=1e30).contains(&length)
                        || t_max.is_nan()
                        || t_min.is_nan()
                        || t_min < 0.0,
                    "{error}"
                ),
            }
        }
        // Spheres from the same bits test the traversals with another object test.
        let sphere = |t: &Triangle| Sphere::new(t.0[0] / 4.0, t.0[1].x.abs() / 4.0);
        let spheres = Primitives::Spheres(triangles.iter().map(sphere).collect());
        let triangles = Primitives::Triangles(triangles);
        check_boxes(&triangles.boxes(), &rays);
        for objects in [triangles, spheres] {
            for (name, traversal) in TRAVERSALS {
                // Only triangles have wide layouts.
                if matches!(objects, Primitives::Spheres(_)) && name.starts_with("wide") {
                    continue;
                }
                let found = check(*traversal, &objects, &rays);
                prop_assert!(found.is_ok(), "{name}: {found:?}");
            }
        }
    }

    #[test]
    fn whatever_is_made_of_a_tree_is_valid_and_no_search_from_it_ends_above_it(
        boxes in any_boxes(), seed in any::<u64>(), work in 0u64..5000,
    ) {
        let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
        let wide = goldsmith_salmon::Config::default().build(&boxes).unwrap();
        let before = cost::internal_area(&greedy);
        prop_assert!(before >= lower_bound::of_largest(&boxes) * (1.0 - ROUNDING));
        let constants = SahConstants::default();
        for tree in [&greedy, &wide] {
            let bytes = file::save(tree, &boxes, &file::Origin::default()).unwrap();
            prop_assert_eq!(&file::load(&bytes, &boxes).unwrap(), tree);
            let merged = collapse_leaves(tree, &constants);
            prop_assert_eq!(validate(&merged, &boxes), Ok(()));
            let [sah, merged_sah] = [tree, &merged].map(|tree| cost::sah(tree, &constants));
            prop_assert!(merged_sah <= sah * (1.0 + ROUNDING));
        }
        let other = Bvh::from_first_count(&greedy.to_first_count(), &greedy.prim_ids).unwrap();
        prop_assert_eq!(validate(&other, &boxes), Ok(()));
        for start in [&greedy, &collapse_leaves(&greedy, &constants)] {
            let budget = Budget { max_work: Some(work), ..Budget::UNLIMITED };
            let config = best::Config::default();
            let better = optimize(start, &Problem::new(&boxes), &config, seed, budget, &()).unwrap();
            prop_assert_eq!(validate(&better.tree, &boxes), Ok(()));
            prop_assert!(better.cost <= before * (1.0 + ROUNDING));
        }
        let cells = KdTree::build(&boxes).unwrap();
        prop_assert!(cells.references() >= boxes.len());
    }
}
