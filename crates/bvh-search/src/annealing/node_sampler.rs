//! The nodes at which moves begin: most often below large nodes, where the most area can be saved.

use crate::run::Stream;
use crate::tree::{ANCHOR, Metric, Working};
use crate::tuning::{LEAST_WINDOWS, MOVES_PER_WINDOW, SHORT_RUN, WINDOW, WINDOW_OF_SHORT_RUNS};
use rand::RngExt;
use std::ops::Range;

/// Draws nodes of a tree in preorder, each in proportion to the square root of its parent's area
/// at the beginning. Weights by the area of the node itself would never draw degenerate boxes;
/// equal weights would waste moves on tiny nodes.
///
/// In large trees, consecutive draws come from one *window*, nodes that are neighbours in the tree,
/// so that moves find their nodes in a cache. The next window is the golden section of all nodes
/// further, which visits every part of the tree about equally often, even with few windows.
#[derive(Debug, Default)]
pub(crate) struct NodeSampler {
    /// The only nodes that are drawn; all nodes if empty.
    only: Vec<u32>,
    /// Prefix sums of the weights, by position, the total last.
    sums: Vec<f64>,
    /// The current window, by position.
    window: Range<usize>,
    /// The fraction of the total weight at the window's middle, 0 to 1, after the first draw.
    middle: Option<f64>,
    /// True if the run is so short that small windows would not cover all nodes.
    short_run: bool,
    /// Remaining draws in this window.
    draws: u32,
}

/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl NodeSampler {
    /// Builds a sampler for a run of this much work per object.
    pub fn for_work(per_object: f64) -> Self {
        Self { short_run: per_object < SHORT_RUN, ..Self::default() }
    }

    /// Weighs the nodes of a tree. Only these nodes will be drawn, or all nodes if `only` is empty.
    /// O(n).
    pub fn begin(&mut self, tree: &Working<impl Metric>, only: Vec<u32>) {
        self.only = only;
        self.middle = None;
        self.draws = 0;
        // The weights keep their values until the next round: updating the sums after every move
        // would take O(n).
        let all = if self.only.is_empty() { tree.nodes.len() - 1 } else { self.only.len() };
        self.sums.clear();
        self.sums.reserve(all + 1);
        let mut sum = 0.0;
        self.sums.push(sum);
        for position in 0..all {
            sum += weight(tree, self.node(position));
            self.sums.push(sum);
        }
    }

    /// Draws a node of the tree, which must have the same nodes as at the
    /// [beginning](Self::begin).
    #[inline(always)]
    pub fn draw(&mut self, rng: &mut Stream) -> u32 {
        if self.draws == 0 {
            self.next_window(rng);
        }
        self.draws -= 1;
        self.node(self.position(self.window.clone(), rng.random()))
    }

    #[inline(always)]
    fn node(&self, position: usize) -> u32 {
        self.only.get(position).map_or(position as u32 + 1, |&node| node)
    }

    /// Returns the position in the window at which the fraction `drawn` of its weight is reached.
    #[inline(always)]
    fn position(&self, window: Range<usize>, drawn: f64) -> usize {
        let [low, high] = [window.start, window.end].map(|index| self.sums[index]);
        let drawn = low + drawn * (high - low);
        // The last sum of the window is excluded: rounding may draw it, and the result must stay
        // inside.
        let before = self.sums[window.start + 1..window.end].partition_point(|&sum| sum <= drawn);
        window.start + before
    }

    #[inline(never)]
    fn next_window(&mut self, rng: &mut Stream) {
        let before = match self.middle {
            Some(middle) => middle,
            None => rng.random(),
        };
        self.middle = Some(before);
        let all = self.sums.len() - 1;
        (self.window, self.draws) = (0..all, u32::MAX);
        let is_short = self.short_run && self.only.is_empty();
        let reach = if is_short { WINDOW_OF_SHORT_RUNS * WINDOW } else { WINDOW };
        // Smaller trees fit into a near cache and need no windows.
        if all >= LEAST_WINDOWS * reach {
            let fraction = (before + GOLDEN).fract();
            self.middle = Some(fraction);
            let middle = self.position(0..all, fraction);
            (self.window, self.draws) =
                (middle.saturating_sub(reach)..(middle + reach).min(all), MOVES_PER_WINDOW);
        }
    }
}

/// Returns the weight of a node: the square root of its parent's area, or of its own area for the
/// root. The tiny summand makes all nodes equally likely if none has an area.
#[inline(always)]
pub(crate) fn weight(tree: &Working<impl Metric>, index: u32) -> f64 {
    let parent = tree.nodes[index as usize].parent;
    tree.nodes[if parent == ANCHOR { index } else { parent } as usize].area.sqrt()
        + f64::MIN_POSITIVE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;
    use bvh_core::Aabb;

    /// How often each node was drawn.
    fn drawn(only: Vec<u32>, tree: &Working, times: u32) -> Vec<u32> {
        let mut sampler = NodeSampler::default();
        let mut counts = vec![0; tree.nodes.len()];
        let mut rng = stream(6, 0);
        sampler.begin(tree, only);
        (0..times).for_each(|_| counts[sampler.draw(&mut rng) as usize] += 1);
        counts
    }

    #[test]
    fn nodes_are_drawn_by_the_square_root_of_their_parents_area() {
        let tree = built(&muller_fellner::Config::default(), &scatter(50));
        for only in [vec![], vec![7, 3, 60, 12]] {
            let nodes: Vec<u32> = if only.is_empty() { (1..100).collect() } else { only.clone() };
            let weight = |&index: &u32| {
                let parent = tree.nodes[index as usize].parent;
                tree.nodes[if parent == ANCHOR { index } else { parent } as usize].area.sqrt()
            };
            let total = nodes.iter().map(weight).sum::<f64>();
            let times = 400_000;
            let counts = drawn(only, &tree, times);
            assert_eq!(
                counts.iter().sum::<u32>(),
                nodes.iter().map(|&index| counts[index as usize]).sum::<u32>()
            );
            for index in nodes {
                let expected = f64::from(times) * weight(&index) / total;
                let off = (f64::from(counts[index as usize]) - expected).abs();
                assert!(
                    off < 5.0 * expected.sqrt(),
                    "node {index}: {} of {expected}",
                    counts[index as usize]
                );
            }
        }
    }

    #[test]
    fn every_part_of_a_large_tree_is_drawn_from_by_its_weight() {
        let tree = built(&muller_fellner::Config::default(), &scatter(40_000));
        let counts = drawn(vec![], &tree, 2_000_000);
        let weights: Vec<f64> = (1..tree.nodes.len()).map(|at| weight(&tree, at as u32)).collect();
        let total: f64 = weights.iter().sum();
        for (counts, weights) in counts[1..].chunks(4096).zip(weights.chunks(4096)) {
            let expected = 2e6 * weights.iter().sum::<f64>() / total;
            let found = f64::from(counts.iter().sum::<u32>());
            assert!((found / expected - 1.0).abs() < 0.01, "{found} of {expected}");
        }
    }

    #[test]
    fn nodes_without_area_are_equally_likely() {
        let points: Vec<Aabb> = (0..50).map(|_| Aabb::from(([1.0; 3], [1.0; 3]))).collect();
        let tree = built(&muller_fellner::Config::default(), &points);
        let counts = drawn(vec![], &tree, 100_000);
        assert!(counts[1..].iter().all(|count| (700..1400).contains(count)), "{counts:?}");
    }
}
