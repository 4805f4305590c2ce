//! The leaves that minimise the surface area heuristic of a given tree, and trees with two children per node.

use crate::cost::SahConstants;
use crate::{Aabb, Bvh, Node};
use alloc::{borrow::Cow, vec, vec::Vec};

/// Turns subtrees into leaves wherever that lowers the surface area heuristic, [`cost::sah`](crate::cost::sah) with the
/// same constants. The result is the least costly of all trees that can be made so, and of these the one with the
/// fewest nodes. O(nodes + objects); the nodes are then in depth-first order.
///
/// # Panics
/// May panic on a tree that [`validate`](crate::validate()) refuses.
pub fn collapse_leaves(tree: &Bvh, constants: &SahConstants) -> Bvh {
    // Least cost of every subtree, times the root's area; the objects in it; whether it is a leaf.
    let mut best = vec![(0.0f64, 0u32, true); tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let area = node.aabb.half_area();
        let below = &best[node.children()];
        let objects = node.prims().len() as u32 + below.iter().map(|child| child.1).sum::<u32>();
        let as_leaf = area * constants.intersection * f64::from(objects);
        let as_inner = area * constants.traversal + below.iter().map(|child| child.0).sum::<f64>();
        let leaf = node.is_leaf() || as_leaf <= as_inner;
        best[index] = (if leaf { as_leaf } else { as_inner }, objects, leaf);
    }
    let mut collapsed = Bvh::default();
    collapsed.nodes.extend(tree.nodes.first());
    let mut open: Vec<(usize, usize)> = collapsed.nodes.iter().map(|_| (0, 0)).collect();
    while let Some((from, to)) = open.pop() {
        let node = &tree.nodes[from];
        collapsed.nodes[to] = if best[from].2 {
            let first = collapsed.prim_ids.len();
            collect(tree, from, &mut collapsed.prim_ids);
            Node::leaf(node.aabb, first as u32, (collapsed.prim_ids.len() - first) as u32)
        } else {
            let first = collapsed.nodes.len();
            collapsed.nodes.extend_from_slice(&tree.nodes[node.children()]);
            open.extend(node.children().zip(first..collapsed.nodes.len()).rev());
            Node::inner(node.aabb, first as u32, node.children().len() as u32)
        };
    }
    collapsed
}

/// Appends the objects below `subtree`, in the tree's order.
pub(crate) fn collect(tree: &Bvh, subtree: usize, ids: &mut Vec<u32>) {
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

/// The same tree with two children per inner node: further ones are halved, in their order.
pub(crate) fn binary(tree: &Bvh) -> Cow<'_, Bvh> {
    binary_visited(tree, &mut vec![0.0; tree.nodes.len()])
}

/// As [`binary`]. `visits` has a number for every node, and gets one for every new node: the sum of its parts, but no more than
/// that of the whole.
pub(crate) fn binary_visited<'t>(tree: &'t Bvh, visits: &mut Vec<f32>) -> Cow<'t, Bvh> {
    if tree.nodes.iter().all(|node| node.is_leaf() || node.children().len() == 2) {
        return Cow::Borrowed(tree);
    }
    let root = tree.nodes[0];
    let mut split = Bvh { nodes: vec![root], prim_ids: tree.prim_ids.clone() };
    let before = core::mem::replace(visits, vec![visits[0]]);
    let mut open = vec![(0, 0..1)];
    while let Some((to, siblings)) = open.pop() {
        visits[to] = before[siblings.clone()].iter().sum::<f32>().min(visits[to]);
        let (aabb, below) = match &tree.nodes[siblings.clone()] {
            [leaf] if leaf.is_leaf() => {
                split.nodes[to] = *leaf;
                continue;
            }
            [node] => (node.aabb, node.children()),
            several => (several.iter().fold(Aabb::EMPTY, |b, node| b.union(&node.aabb)), siblings),
        };
        let (first, middle) = (split.nodes.len(), below.start + below.len() / 2);
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

    /// Triangles along a curve, and a lopsided binary tree over them with leaves of one.
    pub(crate) fn scene(n: u32, seed: u32) -> (Vec<Triangle>, Bvh) {
        let point = |i: u32| {
            let bits = (i + 1).wrapping_mul(2_654_435_761 ^ seed.wrapping_mul(0x9e37_79b9));
            Vec3::new((bits >> 24) as f32, (bits >> 16 & 255) as f32, (bits >> 8 & 255) as f32) / 32.0
        };
        let triangle = |i| Triangle([point(i), point(i) + Vec3::X, point(i) + Vec3::Y * (1 + i % 3) as f32]);
        let triangles: Vec<Triangle> = (0..n).map(triangle).collect();
        let mut tree = Bvh { nodes: vec![Node::leaf(Aabb::EMPTY, 0, n)], prim_ids: (0..n).collect() };
        let mut node = 0;
        while node < tree.nodes.len() {
            let range = tree.nodes[node].prims();
            if range.len() > 1 {
                let (first, end) = (tree.nodes.len() as u32, range.end as u32);
                let middle = range.start as u32 + 1 + (seed + node as u32) % (range.len() as u32 - 1);
                tree.nodes[node] = Node::inner(Aabb::EMPTY, first, 2);
                tree.nodes.push(Node::leaf(Aabb::EMPTY, range.start as u32, middle - range.start as u32));
                tree.nodes.push(Node::leaf(Aabb::EMPTY, middle, end - middle));
            }
            node += 1;
        }
        tree.refit(&triangles.iter().map(Triangle::aabb).collect::<Vec<_>>());
        (triangles, tree)
    }

    /// The least of `cost` over all ways to give every inner node one of `states` states.
    pub(crate) fn exhaustive(tree: &Bvh, states: usize, cost: impl Fn(&[usize]) -> f64) -> f64 {
        let mut choice = vec![0; tree.nodes.len()];
        let inner: Vec<usize> = (0..tree.nodes.len()).filter(|&i| !tree.nodes[i].is_leaf()).collect();
        let mut least = f64::INFINITY;
        for mut code in 0..states.pow(inner.len() as u32) {
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
        collect(tree, node, &mut ids);
        ids.len() as f64
    }

    #[test]
    fn no_choice_of_leaves_costs_less_than_the_collapsed_tree() {
        for seed in 0..20 {
            let (triangles, tree) = scene(10, seed);
            let constants = SahConstants { traversal: f64::from(seed % 4), intersection: 1.0 };
            let collapsed = collapse_leaves(&tree, &constants);
            let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
            validate(&collapsed, &boxes).unwrap();
            // States: inner node or leaf.
            let least = exhaustive(&tree, 2, |choice| {
                let (mut total, mut open) = (0.0, vec![0]);
                while let Some(node) = open.pop() {
                    let area = tree.nodes[node].aabb.half_area();
                    if tree.nodes[node].is_leaf() || choice[node] == 1 {
                        total += area * constants.intersection * objects(&tree, node);
                    } else {
                        total += area * constants.traversal;
                        open.extend(tree.nodes[node].children());
                    }
                }
                cost::over_root_area(&tree, total)
            });
            let found = cost::sah(&collapsed, &constants);
            assert!((found - least).abs() < 1e-12 * least, "seed {seed}: {found} is not {least}");
        }
    }
}
