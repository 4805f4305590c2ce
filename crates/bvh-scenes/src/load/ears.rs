//! Ear clipping that ends. The crate `earcut` has no limit of its own, and takes cubic time where a
//! polygon crosses itself everywhere.

use earcut::Earcut;
use glam::DVec2;
use num_derive::{Float, Num, NumCast, NumOps, One, ToPrimitive, Zero};
use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::Neg;

thread_local! {
    /// The number of comparisons that remain.
    static STEPS: Cell<u64> = const { Cell::new(0) };
}

/// Takes a step, and returns whether there was none left.
fn is_over() -> bool {
    let left = STEPS.get();
    STEPS.set(left.saturating_sub(1));
    left == 0
}

/// A number that counts its comparisons. When there were too many, it equals all others and is
/// greater, too: to `earcut`, all corners are then repetitions, which it leaves out.
#[derive(Clone, Copy, Debug, Float, Num, NumCast, NumOps, One, ToPrimitive, Zero)]
struct Counted(f64);

impl PartialEq for Counted {
    fn eq(&self, other: &Self) -> bool {
        is_over() || self.0 == other.0
    }
}

impl PartialOrd for Counted {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        if is_over() { Some(Ordering::Greater) } else { self.0.partial_cmp(&other.0) }
    }
}

impl Neg for Counted {
    type Output = Self;

    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// Returns triangles between the corners of a polygon, and takes the comparisons that this needs
/// off the `steps`. If no steps are left, the triangles are arbitrary.
pub fn ears(polygon: &[DVec2], steps: &mut u64) -> Vec<[u32; 3]> {
    let mut indices: Vec<u32> = Vec::new();
    let points = polygon.iter().map(|point| point.to_array().map(Counted));
    STEPS.set(*steps);
    Earcut::new().earcut(points, &[0u32; 0], &mut indices);
    *steps = STEPS.get();
    indices.as_chunks().0.to_vec()
}
