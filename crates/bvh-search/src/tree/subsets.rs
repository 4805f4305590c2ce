//! The best binary tree over every subset of a few leaves, by dynamic programming.
//!
//! The best subtree below a node does not depend on the rest of the tree. The least internal area
//! over a set S is therefore best(S) = A(S) + min over the divisions of S in two of best(L) +
//! best(S ∖ L), with best = 0 for single leaves (Karras & Aila 2013).

use super::Metric;
use bvh_core::PackedAabb;

/// Per subset of the leaves, as a bit set: its box, its least internal area, and one side of its
/// best division.
#[derive(Debug)]
pub(crate) struct Subsets {
    boxes: Vec<PackedAabb>,
    cost: Vec<f64>,
    side: Vec<u16>,
}

impl Subsets {
    /// Allocates room for `leaves` leaves, at most 16.
    pub fn new(leaves: u32) -> Self {
        let subsets = 1 << leaves;
        Self {
            boxes: vec![PackedAabb::EMPTY; subsets],
            cost: vec![0.0; subsets],
            side: vec![0; subsets],
        }
    }

    /// Finds the best divisions and returns the least internal area over all leaves. O(3ⁿ) for n
    /// leaves.
    ///
    /// Among equal divisions, chooses the one whose side with the lowest leaf is the least as a bit
    /// set.
    #[inline(always)]
    pub fn solve(
        &mut self,
        leaves: impl ExactSizeIterator<Item = PackedAabb>,
        metric: impl Metric,
    ) -> f64 {
        let all = (1usize << leaves.len()) - 1;
        for (position, aabb) in leaves.enumerate() {
            self.boxes[1 << position] = aabb;
            self.cost[1 << position] = 0.0;
        }
        for set in 1..=all {
            let rest = set & (set - 1);
            if rest == 0 {
                continue;
            }
            let lowest = set ^ rest;
            self.boxes[set] = self.boxes[rest].union(&self.boxes[lowest]);
            // `side` never contains the lowest leaf, so every division is tried once.
            let mut side = rest;
            let mut least = f64::INFINITY;
            let mut best = 0;
            while side > 0 {
                let cost = self.cost[side] + self.cost[set ^ side];
                if cost < least {
                    (least, best) = (cost, side);
                }
                // The next smaller subset of `rest`.
                side = (side - 1) & rest;
            }
            self.cost[set] = least + metric.of(&self.boxes[set]);
            self.side[set] = best as u16;
        }
        self.cost[all]
    }

    /// Returns both sides of the best division of a set of two leaves or more, the side with the
    /// lowest leaf first.
    #[inline(always)]
    pub fn division(&self, set: usize) -> [usize; 2] {
        let side = usize::from(self.side[set]);
        [set ^ side, side]
    }
}
