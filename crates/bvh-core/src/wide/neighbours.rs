//! Points in an order in which neighbours follow each other.

use super::POINTS_OF_BEAM;
use crate::each::Each;
use crate::exact::largest_axis;
use glam::DVec3;

/// The number of points whose order does not matter.
const FEW: usize = 16;

/// Returns the numbers of points in an order in which neighbours follow each other: the order of the
/// leaves of a tree that halves them along their longest extent. O(n log n) time.
pub fn neighbours<P: Copy + Into<DVec3>>(points: &[P]) -> Vec<u32> {
    let at = |point: &P| (*point).into();
    let low = points.iter().map(at).fold(DVec3::INFINITY, DVec3::min);
    // The bits of numbers from +0 on are in the order of the numbers.
    let bits = |point: &P| (at(point) - low + DVec3::ZERO).as_vec3().to_array().each(f32::to_bits);
    let mut points: Vec<([u32; 3], u32)> = points.iter().map(bits).zip(0..).collect();
    // Pairs of a beginning and an end.
    let mut open = vec![(0, points.len())];
    while let Some((from, to)) = open.pop() {
        let count = to - from;
        if count <= FEW {
            continue;
        }
        let points = &mut points[from..to];
        let mut least = [u32::MAX; 3];
        let mut most = [0; 3];
        for (place, _) in &*points {
            for axis in 0..3 {
                least[axis] = least[axis].min(place[axis]);
                most[axis] = most[axis].max(place[axis]);
            }
        }
        let size = [0, 1, 2].each(|k| f32::from_bits(most[k]) - f32::from_bits(least[k]));
        let axis = largest_axis(size.each(f64::from).into());
        // Beams begin at multiples of their size, and end between halves.
        let unit = if count > POINTS_OF_BEAM { POINTS_OF_BEAM } else { FEW };
        let middle = (count / 2).div_ceil(unit) * unit;
        points.select_nth_unstable_by_key(middle, |(place, number)| {
            u64::from(place[axis]) << 32 | u64::from(*number)
        });
        open.extend([(from + middle, to), (from, from + middle)]);
    }
    points.into_iter().map(|(_, number)| number).collect()
}
