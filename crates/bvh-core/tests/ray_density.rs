//! The ray density counts what it says: segment by segment on the grid, monotone everywhere, area for uniform lines.

mod support;

use bvh_core::cost::Measure;
use bvh_core::{Aabb, DensityError, PackedAabb, RayDensity, Segment};
use proptest::prelude::*;
use std::sync::OnceLock;
use support::Random;

/// Bounds whose cells have a side of 1, so that boxes with whole coordinates lie on the grid.
const GRID: f32 = 32.0;

fn bounds() -> Aabb {
    Aabb::from([[0.0; 3], [GRID; 3]])
}

/// Numbers in 0..1 from a seed.
fn uniform(seed: u64) -> impl FnMut() -> f32 {
    let mut random = Random(seed);
    move || random.unit()
}

/// Segments inside, through and beside the bounds.
fn segments(count: usize, seed: u64) -> Vec<Segment> {
    let mut next = uniform(seed);
    let mut point = |spread: f32| [0, 1, 2].map(|_| GRID * (0.5 + spread * (next() - 0.5)));
    (0..count)
        .map(|i| {
            if i % 2 == 0 {
                Segment { from: point(1.0), to: point(1.0) }
            } else {
                Segment { from: point(3.0), to: point(1.5) }
            }
        })
        .collect()
}

/// Whether the segment has a point in the box, by its slabs.
fn meets(segment: &Segment, bounds: &Aabb) -> bool {
    let (low, high) = (bounds.min.to_array(), bounds.max.to_array());
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let (from, to) = (f64::from(segment.from[axis]), f64::from(segment.to[axis]));
        let cut = |plane: f32| (f64::from(plane) - from) / (to - from);
        let (a, b) = (cut(low[axis]), cut(high[axis]));
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    first <= last
}

#[test]
fn boxes_on_the_grid_are_entered_as_often_as_segments_meet_them() {
    let segments = segments(3000, 1);
    let density = RayDensity::new(&bounds(), &segments, 0.0).unwrap();
    let mut next = uniform(2);
    for _ in 0..2000 {
        let ends = [0, 1, 2].map(|_| {
            let (a, b) = ((next() * 33.0).floor(), (next() * 33.0).floor());
            (a.min(b), a.max(b).max(a.min(b) + 1.0).min(GRID))
        });
        let cells = Aabb::from([ends.map(|end| end.0), ends.map(|end| end.1)]);
        if cells.half_area() == 0.0 || ends.iter().any(|end| end.0 == end.1) {
            continue;
        }
        let counted = segments.iter().filter(|segment| meets(segment, &cells)).count();
        assert_eq!(density.entries(&cells), counted as f64, "{cells:?}");
    }
    assert_eq!(density.measure(&bounds()), bounds().half_area());
}

/// A box from two corners, any order.
fn around(a: [f32; 3], b: [f32; 3]) -> Aabb {
    let pick = |take: fn(f32, f32) -> f32| [0, 1, 2].map(|axis| take(a[axis], b[axis]));
    Aabb::from([pick(f32::min), pick(f32::max)])
}

fn corner() -> impl Strategy<Value = [f32; 3]> {
    let coordinate = prop_oneof![-1.0f32..33.0, (0u8..33).prop_map(f32::from), 15.0f32..15.2];
    prop::array::uniform3(coordinate)
}

/// Densities of three samples with three weights of area, made once.
fn density(sample: usize, share: usize) -> &'static RayDensity {
    static MADE: OnceLock<Vec<RayDensity>> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let make = |i: usize| {
            RayDensity::new(&bounds(), &segments(200, i as u64 / 3), [0.0, 0.1, 1.0][i % 3]).unwrap()
        };
        (0..9).map(make).collect()
    });
    &made[3 * sample + share]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

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
fn uniform_endless_lines_give_the_area_back() {
    let mut next = uniform(5);
    let mut lines = Vec::new();
    // Lines through two points of a sphere around the bounds, uniform and independent, are uniform lines.
    let mut on_sphere = || loop {
        let p = [0, 1, 2].map(|_| 2.0 * next() - 1.0);
        let length = p.iter().map(|c| c * c).sum::<f32>();
        if length > 1e-4 && length <= 1.0 {
            return p.map(|c| 16.0 + 28.0 * c / length.sqrt());
        }
    };
    while lines.len() < 400_000 {
        lines.push(Segment { from: on_sphere(), to: on_sphere() });
    }
    let density = RayDensity::new(&bounds(), &lines, 0.0).unwrap();
    for cells in [
        [[4.0, 4.0, 4.0], [20.0, 12.0, 28.0]],
        [[1.0, 1.0, 1.0], [5.0, 31.0, 6.0]],
        [[8.0, 8.0, 8.0], [9.0, 9.0, 9.0]],
    ] {
        let cells = Aabb::from(cells);
        let ratio = density.measure(&cells) / cells.half_area();
        let deviation = 1.0 / density.entries(&cells).sqrt();
        assert!((ratio - 1.0).abs() < 4.0 * deviation + 0.01, "{cells:?}: {ratio}");
    }
}

#[test]
fn nonsense_is_refused_by_name() {
    let one = [Segment { from: [1.0; 3], to: [2.0; 3] }];
    let nan = [one[0], Segment { from: [f32::NAN; 3], to: [2.0; 3] }];
    let far = [Segment { from: [100.0; 3], to: [200.0; 3] }];
    assert_eq!(RayDensity::new(&bounds(), &nan, 0.1).unwrap_err(), DensityError::NotFinite { index: 1 });
    assert_eq!(RayDensity::new(&bounds(), &[], 0.1).unwrap_err(), DensityError::Count { segments: 0 });
    assert_eq!(RayDensity::new(&bounds(), &far, 0.1).unwrap_err(), DensityError::NoneMeets);
    assert_eq!(RayDensity::new(&bounds(), &one, -0.1).unwrap_err(), DensityError::AreaWeight(-0.1));
    assert_eq!(RayDensity::new(&Aabb::EMPTY, &one, 0.1).unwrap_err(), DensityError::Bounds);
}

#[test]
fn rays_that_end_on_a_wall_enter_the_flat_box_around_it() {
    // Downwards onto a wall in the middle of the cells between 16 and 17.
    let mut next = uniform(5);
    let rays: Vec<Segment> = (0..1000)
        .map(|_| {
            let [x, z] = [GRID * next(), GRID * next()];
            Segment { from: [x, 30.2, z], to: [x, 16.5, z] }
        })
        .collect();
    let wall = Aabb::from([[0.0, 16.5, 0.0], [GRID, 16.5, GRID]]);
    let entries = |density: RayDensity| density.entries(&wall);
    assert_eq!(entries(RayDensity::new(&bounds(), &rays, 0.0).unwrap()), 500.0);
    let longer: Vec<Segment> =
        rays.iter().map(|ray| Segment { to: [ray.to[0], 15.9, ray.to[2]], ..*ray }).collect();
    assert_eq!(entries(RayDensity::new(&bounds(), &longer, 0.0).unwrap()), 1000.0);
    // On average over walls at all heights, half of the rays seem to enter, and three quarters of the lengthened ones.
    let mean = (0..64).map(|i| {
        let height = 16.0 + i as f32 / 64.0;
        let rays: Vec<Segment> =
            rays.iter().map(|ray| Segment { to: [ray.to[0], height, ray.to[2]], ..*ray }).collect();
        let wall = Aabb::from([[0.0, height, 0.0], [GRID, height, GRID]]);
        [RayDensity::new, RayDensity::of_rays].map(|made| made(&bounds(), &rays, 0.0).unwrap().entries(&wall))
    });
    let sums = mean.fold([0.0, 0.0], |sums, entries| [sums[0] + entries[0], sums[1] + entries[1]]);
    let [plain, lengthened] = sums.map(|sum| sum / 64.0 / 1000.0);
    assert!((0.45..0.55).contains(&plain) && (0.7..0.8).contains(&lengthened), "{plain} {lengthened}");
}
