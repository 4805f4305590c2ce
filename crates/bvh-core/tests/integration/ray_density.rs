//! The ray density counts segments exactly on the grid, and is monotone everywhere.

use crate::support::Random;
use bvh_core::cost::Measure;
use bvh_core::{Aabb, DensityError, PackedAabb, RayDensity, Segment};
use glam::DVec3;
use proptest::prelude::*;
use std::sync::OnceLock;

/// The size of bounds whose cells have a side of 1. Boxes with integer coordinates are on the grid.
const GRID: f32 = 32.0;

fn bounds() -> Aabb {
    Aabb::from([[0.0; 3], [GRID; 3]])
}

fn segments(count: usize, seed: u64) -> Vec<Segment> {
    let mut random = Random(seed);
    let mut segment = |i: usize| {
        let [from, to] = [[1.0, 1.0], [3.0, 1.5]][i % 2].map(|spread| point(spread, &mut random));
        Segment { from, to }
    };
    (0..count).map(&mut segment).collect()
}

/// Returns a point of a cube around the middle of the bounds, `spread` times as large.
fn point(spread: f32, random: &mut Random) -> [f32; 3] {
    [0, 1, 2].map(|_| GRID * (0.5 + spread * (random.unit() - 0.5)))
}

/// Returns whether the segment, longer by a quarter of a cell at both ends, has a point in the box,
/// by its slabs.
fn meets(segment: &Segment, bounds: &Aabb) -> bool {
    let [from, to] = [segment.from, segment.to].map(|end| DVec3::from(end.map(f64::from)));
    let more = 0.25 / (to - from).abs().max_element();
    let [mut first, mut last] = [-more, 1.0 + more];
    for axis in 0..3 {
        let a = (f64::from(bounds.min[axis]) - from[axis]) / (to - from)[axis];
        let b = (f64::from(bounds.max[axis]) - from[axis]) / (to - from)[axis];
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    first <= last
}

#[test]
fn boxes_on_the_grid_are_entered_as_often_as_segments_meet_them() {
    let segments = segments(3000, 1);
    let density = RayDensity::of_rays(&bounds(), &segments, 0.0).unwrap();
    let mut random = Random(2);
    for _ in 0..2000 {
        let [a, b] = [(); 2].map(|()| [(); 3].map(|()| random.below(33) as f32));
        let cells = around(a, b);
        // Only boxes of at least one cell along every axis.
        if cells.extent().min_element() == 0.0 {
            continue;
        }
        let counted = segments.iter().filter(|segment| meets(segment, &cells)).count();
        assert_eq!(density.entries(&cells), counted as f64, "{cells:?}");
    }
    assert_eq!(density.measure(&bounds()), bounds().half_area());
}

fn around(a: [f32; 3], b: [f32; 3]) -> Aabb {
    Aabb::around([a.into(), b.into()])
}

fn corner() -> impl Strategy<Value = [f32; 3]> {
    let coordinate = prop_oneof![-1.0f32..33.0, (0u8..33).prop_map(f32::from), 15.0f32..15.2];
    prop::array::uniform3(coordinate)
}

/// Returns one of nine densities, of three samples with three weights of area. They are made once.
fn density(sample: usize, share: usize) -> &'static RayDensity {
    static DENSITIES: OnceLock<Vec<RayDensity>> = OnceLock::new();
    let make = |i: usize| {
        let segments = segments(200, i as u64 / 3);
        RayDensity::of_rays(&bounds(), &segments, [0.0, 0.1, 1.0][i % 3]).unwrap()
    };
    &DENSITIES.get_or_init(|| (0..9).map(make).collect())[3 * sample + share]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn a_larger_box_never_measures_less(a in corner(), b in corner(), c in corner(), d in corner(), seed in 0usize..3, share in 0usize..3) {
        let density = density(seed, share);
        let inner = around(a, b);
        let outer = inner.union(&around(c, d));
        prop_assert!(density.measure(&inner) <= density.measure(&outer), "{inner:?} in {outer:?}");
        prop_assert!(density.entries(&inner) <= density.entries(&outer));
        for aabb in [inner, outer] {
            let packed = density.of(&PackedAabb::from(&aabb));
            prop_assert_eq!(packed.to_bits(), density.measure(&aabb).to_bits(), "{:?}: vectors differ", aabb);
        }
        prop_assert!(density.entries(&inner) >= 0.0 && density.entries(&outer) <= f64::from(density.segments()));
    }
}

#[test]
fn each_invalid_input_has_its_error() {
    let one = [Segment { from: [1.0; 3], to: [2.0; 3] }];
    let nan = [one[0], Segment { from: [f32::NAN; 3], to: [2.0; 3] }];
    let far = [Segment { from: [100.0; 3], to: [200.0; 3] }];
    for (bounds, rays, area_weight, error) in [
        (bounds(), &nan[..], 0.1, DensityError::NotFinite { index: 1 }),
        (bounds(), &[], 0.1, DensityError::Count { segments: 0 }),
        (bounds(), &far, 0.1, DensityError::NoneMeets),
        (bounds(), &one, -0.1, DensityError::AreaWeight(-0.1)),
        (Aabb::EMPTY, &one, 0.1, DensityError::Bounds),
    ] {
        assert_eq!(RayDensity::of_rays(&bounds, rays, area_weight).unwrap_err(), error);
    }
}

#[test]
fn three_quarters_of_the_rays_that_end_on_a_wall_enter_the_flat_box_around_it() {
    // Downwards, onto walls at all heights between the grid points at 16 and 17. Without the longer
    // segments it would be half of the rays.
    let mut random = Random(5);
    let mut entries_at = |height: f32| {
        let mut downwards = || {
            let [x, z] = [GRID * random.unit(), GRID * random.unit()];
            Segment { from: [x, 30.2, z], to: [x, height, z] }
        };
        let rays: Vec<Segment> = (0..1000).map(|_| downwards()).collect();
        let wall = Aabb::from([[0.0, height, 0.0], [GRID, height, GRID]]);
        RayDensity::of_rays(&bounds(), &rays, 0.0).unwrap().entries(&wall)
    };
    let entries: f64 = (0..16u8).map(|i| entries_at(16.0 + (f32::from(i) + 0.5) / 16.0)).sum();
    assert!((0.7..0.8).contains(&(entries / 16_000.0)), "{entries}");
    // A longer segment crosses the grid's plane below a wall that is nearer than a quarter of a cell.
    assert_eq!(entries_at(16.125), 1000.0);
}
