//! Neither the shortcut for boxes within a cell nor the processor's vectors change a bit.

use super::*;

/// A linear congruential generator (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32 % end
    }

    fn point(&mut self) -> [f32; 3] {
        [0, 1, 2].map(|_| self.below(1 << 20) as f32 / (1 << 15) as f32)
    }
}

/// Returns random segments over a grid whose cells have a side of 1, and their random numbers.
fn segments(seed: u64) -> (Aabb, Vec<Segment>, Random) {
    let mut random = Random(seed);
    let segment = |_| Segment { from: random.point(), to: random.point() };
    let segments = (0..2000).map(segment).collect();
    (Aabb::from([[0.0; 3], [CELLS as f32; 3]]), segments, random)
}

#[test]
fn the_shortcut_within_a_cell_and_the_sum_over_corners_give_the_same_bits() {
    let (bounds, segments, mut random) = segments(1);
    let density = RayDensity::new(&bounds, &segments, 0.0).unwrap();
    let mut entered = 0;
    for _ in 0..20_000 {
        let cell = [0, 1, 2].map(|_| random.below(CELLS as u32) as usize);
        let mut rounded = Rounded { low: [0; 3], high: [0; 3] };
        for (axis, &index) in cell.iter().enumerate() {
            let begin = (index as u32) << FRACTION_BITS;
            let a = begin + random.below(FRACTIONS + 1);
            let b = begin + random.below(FRACTIONS + 1);
            rounded.low[axis] = a.min(b);
            rounded.high[axis] = a.max(b);
        }
        // A lower corner at the upper end of its cell belongs to the next cell.
        if rounded.low.map(cell_of) == cell {
            let short = within(&density.cells[index(cell)], &rounded, cell);
            let full = density.across(&rounded);
            assert_eq!(short.to_bits(), full.to_bits(), "{rounded:?}");
            entered += u32::from(short > 0.0);
        }
    }
    assert!(entered > 5000);
}

#[test]
fn every_processor_counts_the_same_entries() {
    let (bounds, segments, mut random) = segments(2);
    let density = RayDensity::of_rays(&bounds, &segments, 0.1).unwrap();
    let mut entered = 0;
    for number in 0..20_000 {
        let corner = Vec3::from(random.point());
        // Boxes of all sizes, and beyond the bounds.
        let size = Vec3::from(random.point()) / (1 << (number % 12)) as f32;
        let aabb = Aabb { min: corner - size, max: corner + size };
        let entries = density.fractional_entries(&aabb);
        assert_eq!(entries.to_bits(), density.portable_entries(&aabb).to_bits(), "{aabb:?}");
        entered += u32::from(entries > 0.0);
    }
    assert!(entered > 5000);
}
