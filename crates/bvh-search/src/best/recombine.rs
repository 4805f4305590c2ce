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
/// O(total size).
///
/// Clades are identified by 128-bit sums of scattered keys. Among a billion clades, the probability
/// that any two different clades collide is below 10⁻²⁰.
pub(super) fn recombine<A: Metric>(trees: &[&Working<A>]) -> Working<A> {
    let leaf_cost = trees[0].metric().leaf_cost();
    // Every node of every tree, as number of objects, tree and index. The sort below then visits
    // smaller clades first, and ties in the order of the trees, which makes the result
    // deterministic.
    let mut by_size: Vec<(u32, u32, u32)> = Vec::new();
    let mut clade_of: Vec<Vec<u32>> = Vec::new();
    let mut number = HashMap::new(); // only looked up by key, so that its order has no effect
    for (which, tree) in (0..).zip(trees) {
        let order = tree.preorder();
        let mut keys = vec![(0u128, 0u32); tree.nodes.len()];
        let mut clades = vec![NONE; tree.nodes.len()];
        for &index in order.iter().rev() {
            let node = &tree.nodes[index as usize];
            let [left, right] = node.children.map(|child| child as usize);
            keys[index as usize] = if node.is_leaf() {
                (key_of_leaf(node, leaf_cost), 1)
            } else {
                (keys[left].0.wrapping_add(keys[right].0), keys[left].1 + keys[right].1)
            };
            let (key, size) = keys[index as usize];
            // Clades are numbered in the order of their first occurrence.
            let next = number.len() as u32;
            clades[index as usize] = *number.entry(key).or_insert(next);
            by_size.push((size, which, index));
        }
        clade_of.push(clades);
    }
    by_size.sort_unstable();
    // Per clade: cost of the best division, including the area of the clade's box, and the node
    // that has the division. Parts are smaller than the clade, so their costs are final.
    let mut best = vec![(f64::INFINITY, 0, NONE); number.len()];
    for (_, which, index) in by_size {
        let node = &trees[which as usize].nodes[index as usize];
        let clades = &clade_of[which as usize];
        let cost = if node.is_leaf() {
            leaf_cost * node.area
        } else {
            let [left, right] = node
                .children
                .map(|child| best[clades[child as usize] as usize].0);
            node.area + left + right
        };
        let best = &mut best[clades[index as usize] as usize];
        if cost < best.0 {
            *best = (cost, which, index);
        }
    }
    let mut nodes = vec![trees[0].nodes[ANCHOR as usize]];
    // All trees are over the same objects, so their roots are the same clade.
    let root = trees[0]
        .root()
        .map(|root| (clade_of[0][root as usize], ANCHOR, 0));
    let mut stack: Vec<(u32, u32, usize)> = root.into_iter().collect();
    while let Some((clade, parent, side)) = stack.pop() {
        let (_, which, index) = best[clade as usize];
        let node = trees[which as usize].nodes[index as usize];
        let to = nodes.len() as u32;
        nodes[parent as usize].children[side] = to;
        nodes.push(Node { parent, ..node });
        if !node.is_leaf() {
            let clades = &clade_of[which as usize];
            stack.extend([1, 0].map(|side| (clades[node.children[side] as usize], to, side)));
        }
    }
    Working::from_nodes(nodes, trees[0].metric())
}

/// Returns a key for a leaf: its object, and the part of the object if the object may have several
/// leaves.
fn key_of_leaf(node: &Node, leaf_cost: f64) -> u128 {
    let object = key(node.children[1]);
    if leaf_cost == 0.0 {
        return object;
    }
    let [low, high] = node.aabb.planes();
    [low[0], low[1], low[2], high[0], high[1], high[2]]
        .into_iter()
        .fold(object, |sum, plane| {
            // Multiplying between the planes makes the key depend on their order, and an odd factor
            // loses no bits.
            sum.rotate_left(21)
                .wrapping_mul(0x2d99_787926d46932a4c1f32680f70c55)
                ^ key(plane.to_bits())
        })
}

/// Returns a key for an object, scattered over 128 bits by two rounds of SplitMix64 (Steele, Lea &
/// Flood 2014).
fn key(object: u32) -> u128 {
    const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;
    let number = 2 * u64::from(object) + 1;
    let low = split_mix(number.wrapping_mul(GAMMA));
    let high = split_mix((number + 1).wrapping_mul(GAMMA));
    u128::from(high) << 64 | u128::from(low)
}

/// The output function of SplitMix64.
fn split_mix(state: u64) -> u64 {
    let state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    state ^ (state >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::built;
    use bvh_build::muller_fellner;
    use bvh_core::{Aabb, validate};
    use rand::RngExt;

    #[test]
    fn the_recombined_tree_has_the_best_part_of_every_parent() {
        let boxes: Vec<Aabb> = (0..200u16)
            .map(|i| {
                let low = [f32::from(i) * 1.7 % 9.0, f32::from(i) * 2.3 % 7.0, f32::from(i / 3)];
                Aabb::from((low, low.map(|c| c + 1.0)))
            })
            .collect();
        let good = built(&muller_fellner::Config::default(), &boxes);
        let [left, right] = good.nodes[good.root().unwrap() as usize].children;
        // Two parents, each degraded on one side of the root.
        let spoilt = |side: u32| {
            let mut tree = good.clone();
            let mut rng = stream(u64::from(side), 0);
            tree.begin();
            for _ in 0..20 {
                let mut node = side;
                while !tree.nodes[node as usize].is_leaf() {
                    node = tree.nodes[node as usize].children[usize::from(rng.random::<bool>())];
                }
                if node != side && tree.nodes[node as usize].parent != side {
                    tree.detach(node);
                    let place = tree.nodes[side as usize].children[0];
                    tree.attach(node, place);
                }
            }
            tree
        };
        let a = spoilt(left);
        let b = spoilt(right);
        let found = recombine(&[&a, &b]);
        validate(&found.to_bvh(), &boxes).unwrap();
        assert!(a.area() > good.area() && b.area() > good.area());
        assert!(found.area() <= good.area() * (1.0 + 1e-12), "{} {}", found.area(), good.area());
        assert_eq!(recombine(&[&good]).to_bvh(), good.to_bvh());
        assert_eq!(recombine(&[&built(&muller_fellner::Config::default(), &[])]).objects(), 0);
    }
}
