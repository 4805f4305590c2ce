//! Recombination: the best tree in which every split comes from one of several trees.
//!
//! Good trees over the same objects share many *clades*, sets of objects below one node. A clade
//! may be divided as in any of the trees that have it, independently of the tree above. Dynamic
//! programming over the clades therefore finds the best of all combinations, which is never worse
//! than the best of the trees. Compare the crossover by common partitions (Whitley, Hains & Howe
//! 2009) and the clade-based search for species trees (Bryant 1996).

use crate::tree::{ANCHOR, Metric, NONE, Node, Working};
use std::collections::HashMap;

/// Returns the best tree over the clades of `trees`, one tree or more over the same objects.
/// O(n log n), where n is the number of nodes of all trees together.
///
/// Clades are identified by 128-bit sums of scattered keys. Among a billion clades, the probability
/// that any two different clades collide is below 10⁻²⁰.
pub(super) fn recombine<A: Metric>(trees: &[&Working<A>]) -> Working<A> {
    let clades = Clades::of(trees);
    let divisions = best_divisions(trees, &clades);
    Working::from_nodes(assemble(trees, &clades, &divisions), trees[0].metric())
}

/// A node of one of the trees. Nodes with fewer objects come first, and among equals the nodes of
/// earlier trees, which makes the result deterministic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Occurrence {
    /// The number of objects below the node.
    objects: u32,
    tree: u32,
    node: u32,
}

/// The clades of several trees, numbered from 0 in the order in which they were found.
struct Clades {
    /// Every node of every tree, in order.
    occurrences: Vec<Occurrence>,
    /// The number of the clade below each node, by tree and node.
    numbers: Vec<Vec<u32>>,
    count: usize,
}

impl Clades {
    fn of<A: Metric>(trees: &[&Working<A>]) -> Self {
        let mut occurrences = Vec::new();
        let mut numbers = Vec::with_capacity(trees.len());
        // Nothing iterates over the map, so that its random order has no effect.
        let mut number_by_key: HashMap<u128, u32> = HashMap::new();
        for (tree, working) in (0..).zip(trees) {
            let leaf_cost = working.metric().leaf_cost();
            let mut keys = vec![0_u128; working.nodes.len()];
            let mut objects = vec![0_u32; working.nodes.len()];
            let mut numbers_of_tree = vec![NONE; working.nodes.len()];
            // Children come after their parent in preorder, and here before it.
            for &node in working.preorder().iter().rev() {
                let index = node as usize;
                if working.nodes[index].is_leaf() {
                    keys[index] = key_of_leaf(&working.nodes[index], leaf_cost);
                    objects[index] = 1;
                } else {
                    let [left, right] = working.nodes[index].children;
                    keys[index] = keys[left as usize].wrapping_add(keys[right as usize]);
                    objects[index] = objects[left as usize] + objects[right as usize];
                }
                let next = number_by_key.len() as u32;
                numbers_of_tree[index] = *number_by_key.entry(keys[index]).or_insert(next);
                occurrences.push(Occurrence { objects: objects[index], tree, node });
            }
            numbers.push(numbers_of_tree);
        }
        occurrences.sort_unstable();
        Self { occurrences, numbers, count: number_by_key.len() }
    }

    fn number(&self, tree: u32, node: u32) -> u32 {
        self.numbers[tree as usize][node as usize]
    }
}

/// The cheapest division of a clade: the node at which a tree has the division.
#[derive(Clone, Copy)]
struct Division {
    tree: u32,
    node: u32,
    /// The total area of the best subtree over the clade, the clade's own box included.
    cost: f64,
}

/// Returns the cheapest division of every clade, by its number.
fn best_divisions<A: Metric>(trees: &[&Working<A>], clades: &Clades) -> Vec<Division> {
    let leaf_cost = trees[0].metric().leaf_cost();
    let mut divisions = vec![Division { tree: 0, node: NONE, cost: f64::INFINITY }; clades.count];
    // The parts of a clade have fewer objects than the clade, so their costs are final.
    for &Occurrence { tree, node: index, .. } in &clades.occurrences {
        let node = &trees[tree as usize].nodes[index as usize];
        let cost = if node.is_leaf() {
            leaf_cost * node.area
        } else {
            let [left, right] =
                node.children.map(|child| divisions[clades.number(tree, child) as usize].cost);
            node.area + left + right
        };
        let best = &mut divisions[clades.number(tree, index) as usize];
        if cost < best.cost {
            *best = Division { tree, node: index, cost };
        }
    }
    divisions
}

/// Returns the nodes of the tree that has the best division of every clade, the anchor first.
fn assemble<A: Metric>(
    trees: &[&Working<A>],
    clades: &Clades,
    divisions: &[Division],
) -> Vec<Node> {
    let mut nodes = vec![trees[0].nodes[ANCHOR as usize]];
    // Clades whose subtrees remain to be made, each with its parent and its side of the parent.
    let mut open: Vec<(u32, u32, usize)> = Vec::new();
    // All trees are over the same objects, so their roots are the same clade.
    if let Some(root) = trees[0].root() {
        open.push((clades.number(0, root), ANCHOR, 0));
    }
    while let Some((clade, parent, side)) = open.pop() {
        let Division { tree, node, .. } = divisions[clade as usize];
        let copied = trees[tree as usize].nodes[node as usize];
        let to = nodes.len() as u32;
        nodes[parent as usize].children[side] = to;
        nodes.push(Node { parent, ..copied });
        if !copied.is_leaf() {
            let [left, right] = copied.children;
            open.push((clades.number(tree, right), to, 1));
            open.push((clades.number(tree, left), to, 0));
        }
    }
    nodes
}

/// Returns a key for a leaf: its object, and the part of the object if the object may have several
/// leaves.
fn key_of_leaf(node: &Node, leaf_cost: f64) -> u128 {
    // The multiplier of a well-known linear congruential generator. It is odd, so multiplication
    // loses no bits.
    const FACTOR: u128 = 0x2d99_7879_26d4_6932_a4c1_f326_80f7_0c55;
    let mut key = scattered(node.children[1]);
    if leaf_cost == 0.0 {
        return key;
    }
    for [x, y, z, _] in node.aabb.planes() {
        for plane in [x, y, z] {
            // Multiplication between the planes makes the key depend on their order.
            key = key.rotate_left(21).wrapping_mul(FACTOR) ^ scattered(plane.to_bits());
        }
    }
    key
}

/// Returns a number scattered over 128 bits by two rounds of SplitMix64 (Steele, Lea & Flood 2014).
fn scattered(number: u32) -> u128 {
    const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;
    let first = 2 * u64::from(number) + 1;
    let low = split_mix(first.wrapping_mul(GAMMA));
    let high = split_mix((first + 1).wrapping_mul(GAMMA));
    u128::from(high) << 64 | u128::from(low)
}

fn split_mix(state: u64) -> u64 {
    let state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    state ^ (state >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;
    use bvh_core::{Aabb, validate};
    use rand::RngExt;
    use std::collections::BTreeMap;

    /// Returns the objects below every node, as bits, and the area of all inner nodes of the
    /// cheapest tree of which every division is in one of the trees.
    fn brute_force(trees: &[&Working], boxes: &[Aabb]) -> f64 {
        let mut divisions: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
        for tree in trees {
            let mut below = vec![0_u32; tree.nodes.len()];
            for &node in tree.preorder().iter().rev() {
                let [left, right] = tree.nodes[node as usize].children;
                below[node as usize] = if tree.nodes[node as usize].is_leaf() {
                    1 << right
                } else {
                    let parts = [below[left as usize], below[right as usize]];
                    divisions.entry(parts[0] | parts[1]).or_default().push(parts);
                    parts[0] | parts[1]
                };
            }
        }
        // A part of a set is a smaller number than the set.
        let mut least = BTreeMap::new();
        for (&set, divisions) in &divisions {
            let of = |part: &u32| least.get(part).copied().unwrap_or(0.0);
            let parts = divisions.iter().map(|[a, b]| of(a) + of(b)).fold(f64::INFINITY, f64::min);
            let inside = boxes.iter().zip(0..).filter(|(_, object)| set >> object & 1 == 1);
            let area = Aabb::union_of(inside.map(|(aabb, _)| aabb)).half_area();
            least.insert(set, area + parts);
        }
        least.into_values().next_back().unwrap()
    }

    #[test]
    fn no_combination_of_divisions_of_the_trees_is_cheaper_than_the_recombined_tree() {
        let boxes = &scatter(24);
        let start = built(&muller_fellner::Config::default(), boxes);
        let mut better = 0;
        for seed in 0..40 {
            let rng = &mut stream(seed, 0);
            // Trees with most divisions in common.
            let trees: Vec<Working> = (0..4)
                .map(|_| {
                    let mut tree = start.clone();
                    for _ in 0..6 {
                        tree.begin();
                        let root = tree.root().unwrap();
                        let node = rng.random_range(1..tree.nodes.len() as u32);
                        if node != root {
                            let (_, sibling, _) = tree.detach(node);
                            let above = tree.nodes[sibling as usize].parent;
                            tree.attach(node, if above == ANCHOR { sibling } else { above });
                        }
                    }
                    tree
                })
                .collect();
            let trees: Vec<&Working> = trees.iter().collect();
            let found = recombine(&trees);
            validate(&found.to_bvh(), boxes).unwrap();
            let least = brute_force(&trees, boxes);
            let off = (found.area() - least).abs();
            assert!(off <= 1e-12 * least, "{seed}: {off} of {least}");
            better += usize::from(trees.iter().all(|tree| found.area() < 0.999 * tree.area()));
        }
        assert!(better > 20, "{better}");
        assert_eq!(recombine(&[&start]).to_bvh(), start.to_bvh());
        assert_eq!(recombine(&[&built(&muller_fellner::Config::default(), &[])]).objects(), 0);
    }
}
