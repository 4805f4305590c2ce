//! Where moves begin: most often below large nodes, where there is most to gain.

use crate::stream::Stream;
use crate::working::{ANCHOR, Working};
use rand::RngExt;
use std::ops::Range;

/// Draws nodes of a tree, each in proportion to the square root of its parent's area as it was at the first draw: were
/// it that of the node, no point would ever be moved, and were all nodes alike, most moves would be spent where next to
/// nothing can be gained.
///
/// In a tree that is not small they are of a part of the memory for some moves, where neighbours in the tree are
/// neighbours, and then of another part, so that moves find nodes in a cache. Parts follow one another by the golden
/// section of the whole, which comes everywhere about equally often however few they are.
#[derive(Debug, Default)]
pub(crate) struct Starts {
    /// Only these nodes, unless there are none.
    only: Vec<u32>,
    /// What all nodes before weigh, by position; that of all nodes last.
    sums: Vec<f64>,
    /// The part of the moves to come, by position.
    part: Range<usize>,
    /// Where the middle of the part was drawn, 0 to 1.
    middle: f64,
    /// Whether so few moves are to come that small parts would not cover the tree.
    few: bool,
    draws: u32,
}

/// Nodes from the middle of a part to its ends: together, with what is above them, they are in the cache next to the
/// smallest. Eight times as many made moves on 66 000 objects take a fifth longer.
const REACH: usize = 512;

/// How many times as far it is if few moves are to come.
const FARTHER: usize = 8;

/// Work per object below which moves are few: so much, of which a move takes about 200, visits everything once.
const FEW: f64 = 64.0;

/// Moves in one part: a pass over everything takes few of all moves even of a short search.
const DRAWS: u32 = 128;

/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl Starts {
    /// Of moves with so much work per object in all.
    pub fn of_work(per_object: f64) -> Self {
        Self { few: per_object < FEW, ..Self::default() }
    }

    /// Draws only these nodes, unless there are none.
    pub fn among(only: Vec<u32>) -> Self {
        Self { only, ..Self::default() }
    }

    /// A node of the tree, which has the nodes that it had at the first draw.
    #[inline(always)]
    pub fn draw(&mut self, tree: &Working, rng: &mut Stream) -> u32 {
        if self.draws == 0 {
            self.move_on(tree, rng);
        }
        self.draws -= 1;
        self.node(self.position(self.part.clone(), rng.random()))
    }

    /// The node at this position.
    #[inline(always)]
    fn node(&self, position: usize) -> u32 {
        self.only.get(position).map_or(position as u32 + 1, |&node| node)
    }

    /// The position of these up to which there is so much of their weight.
    #[inline(always)]
    fn position(&self, part: Range<usize>, drawn: f64) -> usize {
        let [low, high] = [part.start, part.end].map(|at| self.sums[at]);
        let drawn = low + drawn * (high - low);
        let before = self.sums[part.start + 1..part.end].partition_point(|&sum| sum <= drawn);
        part.start + before
    }

    /// Chooses the next part.
    #[inline(never)]
    fn move_on(&mut self, tree: &Working, rng: &mut Stream) {
        if self.sums.is_empty() {
            self.weigh(tree);
            self.middle = rng.random();
        }
        let all = self.sums.len() - 1;
        (self.part, self.draws) = (0..all, u32::MAX);
        let reach = if self.few { FARTHER * REACH } else { REACH };
        if all >= 16 * reach {
            self.middle = (self.middle + GOLDEN).fract();
            let middle = self.position(0..all, self.middle);
            (self.part, self.draws) = (middle.saturating_sub(reach)..(middle + reach).min(all), DRAWS);
        }
    }

    /// O(n).
    fn weigh(&mut self, tree: &Working) {
        let all = if self.only.is_empty() { tree.nodes.len() - 1 } else { self.only.len() };
        self.sums.reserve(all + 1);
        let mut sum = 0.0;
        self.sums.push(sum);
        for position in 0..all {
            sum += weight(tree, self.node(position));
            self.sums.push(sum);
        }
    }
}

/// What a node is drawn in proportion to: the square root of its parent's area, of its own at the root; and next to nothing
/// more, so that nodes are drawn alike where none has an area.
#[inline(always)]
pub(crate) fn weight(tree: &Working, at: u32) -> f64 {
    let parent = tree.nodes[at as usize].parent;
    tree.nodes[if parent == ANCHOR { at } else { parent } as usize].area.sqrt() + f64::MIN_POSITIVE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use crate::stream::stream;
    use bvh_build::muller_fellner;
    use bvh_core::Aabb;

    /// How often each node was drawn.
    fn drawn(starts: &mut Starts, tree: &Working, times: u32) -> Vec<u32> {
        let (mut counts, mut rng) = (vec![0; tree.nodes.len()], stream(6, 0));
        (0..times).for_each(|_| counts[starts.draw(tree, &mut rng) as usize] += 1);
        counts
    }

    #[test]
    fn nodes_are_drawn_by_the_square_root_of_their_parents_area() {
        let tree = built(&muller_fellner::Config::default(), &scatter(50));
        for only in [vec![], vec![7, 3, 60, 12]] {
            let nodes: Vec<u32> = if only.is_empty() { (1..100).collect() } else { only.clone() };
            let weight = |&at: &u32| {
                let parent = tree.nodes[at as usize].parent;
                tree.nodes[if parent == ANCHOR { at } else { parent } as usize].area.sqrt()
            };
            let (total, times) = (nodes.iter().map(weight).sum::<f64>(), 400_000);
            let counts = drawn(&mut Starts::among(only), &tree, times);
            assert_eq!(counts.iter().sum::<u32>(), nodes.iter().map(|&at| counts[at as usize]).sum());
            for at in nodes {
                let expected = f64::from(times) * weight(&at) / total;
                let off = (f64::from(counts[at as usize]) - expected).abs();
                assert!(off < 5.0 * expected.sqrt(), "node {at}: {} of {expected}", counts[at as usize]);
            }
        }
    }

    #[test]
    fn every_part_of_a_large_tree_is_drawn_from_some_time() {
        let tree = built(&muller_fellner::Config::default(), &scatter(40_000));
        let counts = drawn(&mut Starts::default(), &tree, 2_000_000);
        assert!(counts[1..].chunks(512).all(|part| part.iter().sum::<u32>() > 0));
    }

    #[test]
    fn nodes_without_area_are_drawn_alike() {
        let points: Vec<Aabb> = (0..50).map(|_| Aabb::from(([1.0; 3], [1.0; 3]))).collect();
        let tree = built(&muller_fellner::Config::default(), &points);
        let counts = drawn(&mut Starts::default(), &tree, 100_000);
        assert!(counts[1..].iter().all(|count| (700..1400).contains(count)), "{counts:?}");
    }
}
