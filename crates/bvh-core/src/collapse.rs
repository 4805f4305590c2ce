//! Transformations of a finished tree: the leaves that minimise its surface area heuristic, and two
//! children per node.

use crate::cost::SahConstants;
use crate::{Aabb, Bvh, BvhView, Node};
use std::borrow::Cow;

/// The cheapest form of a subtree.
#[derive(Clone, Copy, Default)]
struct Subtree {
    /// The cost, times the root's area.
    cost: f64,
    objects: u32,
    is_leaf: bool,
}

/// Turns subtrees into leaves wherever that lowers the surface area heuristic,
/// [`cost::sah`](crate::cost::sah) with the same constants. The result is the least costly tree
/// that can be made in this way, and of several such trees the one with the fewest nodes. The nodes
/// of the result are in depth-first order. O(nodes + objects).
pub fn collapse_leaves(tree: &Bvh, constants: &SahConstants) -> Bvh {
    collapse_at_most(tree.into(), constants, u32::MAX)
}

/// Does the same, but makes no leaves of more than `most` objects.
pub(crate) fn collapse_at_most(tree: BvhView, constants: &SahConstants, most: u32) -> Bvh {
    let mut best = vec![Subtree::default(); tree.nodes.len()];
    // Backwards, because the cost of a node depends on its children, which come after it.
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let area = node.aabb.half_area();
        let mut objects = node.prims().len() as u32;
        let mut cost_below = 0.0;
        for child in &best[node.children()] {
            objects += child.objects;
            cost_below += child.cost;
        }
        let as_leaf = area * constants.intersection * f64::from(objects);
        let as_inner = area * constants.traversal + cost_below;
        // `<=`, because a leaf is one node and an inner node is several.
        let is_leaf = node.is_leaf() || objects <= most && as_leaf <= as_inner;
        best[index] = Subtree { cost: if is_leaf { as_leaf } else { as_inner }, objects, is_leaf };
    }
    let mut collapsed = Bvh { frame: tree.frame.copied(), ..Bvh::default() };
    // Nodes of `tree` with their indices in `collapsed`.
    let mut open: Vec<(usize, usize)> = Vec::new();
    if let Some(root) = tree.nodes.first() {
        collapsed.nodes.push(*root);
        open.push((0, 0));
    }
    while let Some((from, to)) = open.pop() {
        let node = &tree.nodes[from];
        collapsed.nodes[to] = if best[from].is_leaf {
            let first = collapsed.prim_ids.len();
            collect(tree, from, &mut collapsed.prim_ids);
            Node::leaf(node.aabb, first as u32, (collapsed.prim_ids.len() - first) as u32)
        } else {
            let first = collapsed.nodes.len();
            collapsed.nodes.extend_from_slice(&tree.nodes[node.children()]);
            // Reversed, so that the first child is popped first.
            open.extend(node.children().zip(first..collapsed.nodes.len()).rev());
            Node::inner(node.aabb, first as u32, node.children().len() as u32)
        };
    }
    collapsed
}

/// Appends the ids of the objects below `subtree`, in the tree's order.
pub(crate) fn collect(tree: BvhView, subtree: usize, ids: &mut Vec<u32>) {
    // Most subtrees are leaves, which need no stack.
    if tree.nodes[subtree].is_leaf() {
        ids.extend_from_slice(&tree.prim_ids[tree.nodes[subtree].prims()]);
        return;
    }
    let mut open = vec![subtree];
    while let Some(index) = open.pop() {
        let node = &tree.nodes[index];
        ids.extend_from_slice(&tree.prim_ids[node.prims()]);
        open.extend(node.children().rev());
    }
}

/// Returns the same tree with two children per inner node. Wider nodes are halved, in the order of
/// their children.
pub(crate) fn binary(tree: &Bvh) -> Cow<'_, Bvh> {
    if is_binary(tree) {
        return Cow::Borrowed(tree);
    }
    binary_visited(tree, &mut vec![0.0; tree.nodes.len()])
}

fn is_binary(tree: &Bvh) -> bool {
    // The most nodes that a valid tree can have are one leaf per reference and two children per
    // inner node. Once over the nodes of a large tree takes 50 ms.
    let has_most_nodes = tree.nodes.len() + 1 == 2 * tree.prim_ids.len();
    has_most_nodes || tree.nodes.iter().all(|node| node.is_leaf() || node.children().len() == 2)
}

/// Returns the [`binary`] tree and updates `visits`, which has one number per node. A new node gets
/// the sum of the visits of its parts, but at most the visits of the node that was divided.
pub(crate) fn binary_visited<'t>(tree: &'t Bvh, visits: &mut Vec<f32>) -> Cow<'t, Bvh> {
    if is_binary(tree) {
        return Cow::Borrowed(tree);
    }
    let root = tree.nodes[0];
    let mut split = Bvh { nodes: vec![root], prim_ids: tree.prim_ids.clone(), frame: tree.frame };
    let visits_before = core::mem::replace(visits, vec![visits[0]]);
    // New nodes with the ranges of siblings in `tree` that they replace. A range of one is a node
    // of `tree`; a longer range is a part of a wide node.
    let mut open = vec![(0, 0..1)];
    while let Some((to, siblings)) = open.pop() {
        let visits_of_parts: f32 = visits_before[siblings.clone()].iter().sum();
        // New nodes start with the visits of their parent.
        visits[to] = visits_of_parts.min(visits[to]);
        let (aabb, below) = match &tree.nodes[siblings.clone()] {
            [leaf] if leaf.is_leaf() => {
                split.nodes[to] = *leaf;
                continue;
            }
            [node] => (node.aabb, node.children()),
            several => (Aabb::union_of(several.iter().map(|node| &node.aabb)), siblings),
        };
        let first = split.nodes.len();
        let middle = below.start + below.len() / 2;
        split.nodes[to] = Node::inner(aabb, first as u32, 2);
        split.nodes.extend([root; 2]);
        visits.extend([visits[to]; 2]);
        open.extend([(first + 1, middle..below.end), (first, below.start..middle)]);
    }
    Cow::Owned(split)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{Triangle, cost, validate};
    use glam::Vec3;

    /// A point from the bits of a multiplicative hash.
    fn point(i: u32, seed: u32) -> Vec3 {
        let bits = (i + 1).wrapping_mul(2_654_435_761 ^ seed.wrapping_mul(0x9e37_79b9));
        let [_, z, y, x] = bits.to_le_bytes().map(f32::from);
        Vec3::new(x, y, z) / 32.0
    }

    /// Makes small triangles at pseudo-random points, and a lopsided binary tree over them with one
    /// object per leaf.
    pub(crate) fn scene(n: u32, seed: u32) -> (Vec<Triangle>, Bvh) {
        let triangle = |i: u32| {
            let corner = point(i, seed);
            Triangle([corner, corner + Vec3::X, corner + Vec3::Y * (1 + i % 3) as f32])
        };
        let triangles: Vec<Triangle> = (0..n).map(triangle).collect();
        let mut tree = Bvh::new(vec![Node::leaf(Aabb::EMPTY, 0, n)], (0..n).collect());
        let mut node = 0;
        while node < tree.nodes.len() {
            let range = tree.nodes[node].prims();
            if range.len() > 1 {
                let start = range.start as u32;
                let end = range.end as u32;
                let first = tree.nodes.len() as u32;
                let middle = start + 1 + (seed + node as u32) % (end - start - 1);
                tree.nodes[node] = Node::inner(Aabb::EMPTY, first, 2);
                tree.nodes.push(Node::leaf(Aabb::EMPTY, start, middle - start));
                tree.nodes.push(Node::leaf(Aabb::EMPTY, middle, end - middle));
            }
            node += 1;
        }
        tree.refit(&crate::boxes(&triangles));
        (triangles, tree)
    }

    /// Returns the least of `cost` over all ways to give every inner node one of `states` states.
    pub(crate) fn exhaustive(tree: &Bvh, states: usize, cost: impl Fn(&[usize]) -> f64) -> f64 {
        let mut choice = vec![0; tree.nodes.len()];
        let mut inner: Vec<usize> = (0..tree.nodes.len()).collect();
        inner.retain(|&index| !tree.nodes[index].is_leaf());
        let mut least = f64::INFINITY;
        for mut code in 0..states.pow(inner.len() as u32) {
            // The digits of `code` are the states.
            for &node in &inner {
                choice[node] = code % states;
                code /= states;
            }
            least = least.min(cost(&choice));
        }
        least
    }

    pub(crate) fn objects(tree: &Bvh, node: usize) -> f64 {
        let mut ids = Vec::new();
        collect(tree.into(), node, &mut ids);
        ids.len() as f64
    }

    /// Returns the surface area heuristic of the tree in which inner nodes with state 1 become
    /// leaves.
    fn cost_with_leaves(tree: &Bvh, states: &[usize], constants: &SahConstants) -> f64 {
        let mut total = 0.0;
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let node = &tree.nodes[index];
            let area = node.aabb.half_area();
            if node.is_leaf() || states[index] == 1 {
                total += area * constants.intersection * objects(tree, index);
            } else {
                total += area * constants.traversal;
                open.extend(node.children());
            }
        }
        cost::over_root_area(tree, total)
    }

    #[test]
    fn no_choice_of_leaves_costs_less_than_the_collapsed_tree() {
        for seed in 0..20 {
            let (triangles, tree) = scene(10, seed);
            let constants = SahConstants { traversal: f64::from(seed % 4), intersection: 1.0 };
            let collapsed = collapse_leaves(&tree, &constants);
            validate(&collapsed, &crate::boxes(&triangles)).unwrap();
            let least = exhaustive(&tree, 2, |states| cost_with_leaves(&tree, states, &constants));
            let found = cost::sah(&collapsed, &constants);
            assert!((found - least).abs() < 1e-12 * least, "seed {seed}: {found} is not {least}");
        }
    }
}
