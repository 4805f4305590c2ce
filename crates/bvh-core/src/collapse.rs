//! Fewer nodes at less expected time: the exactly optimal leaves, and the exactly optimal wide layout, of a given tree.

use crate::block::Block;
use crate::cost::SahConstants;
use crate::wide::{Child, WideNode};
use crate::{Aabb, Bvh, Node, NodeKind, Triangle, WideBvh};
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
fn collect(tree: &Bvh, subtree: usize, ids: &mut Vec<u32>) {
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
    if tree.nodes.iter().all(|node| node.is_leaf() || node.children().len() == 2) {
        return Cow::Borrowed(tree);
    }
    let root = tree.nodes[0];
    let mut split = Bvh { nodes: vec![root], prim_ids: tree.prim_ids.clone() };
    let mut open = vec![(0, 0..1)];
    while let Some((to, siblings)) = open.pop() {
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
        open.extend([(first + 1, middle..below.end), (first, below.start..middle)]);
    }
    Cow::Owned(split)
}

/// Expected time of visiting a wide node, in any unit. With a block's, measured; the layout depends little on them.
const NODE_COST: f32 = 1.0;
/// Expected time of testing a block.
const BLOCK_COST: f32 = 1.0;

/// How a subtree becomes children of a wide node.
#[derive(Clone, Copy)]
struct Decision {
    /// Least cost as at most 1 to 7 children, times the root's area; last, as the 8 children of a node of its own.
    costs: [f32; 8],
    /// How many of those slots go to the first child (low half) and to the second one; 0 to be one child.
    slots: [u8; 8],
    objects: u32,
    /// Whether, as one child, it is a leaf.
    leaf: bool,
}

/// Decides by dynamic programming from the leaves up; every node of `tree` has two children or none.
fn decide(tree: &Bvh) -> Vec<Decision> {
    let root_area = tree.nodes[0].aabb.half_area();
    let scale = if root_area > 0.0 { 1.0 / root_area } else { 0.0 };
    let nothing = Decision { costs: [0.0; 8], slots: [0; 8], objects: 0, leaf: true };
    let mut decisions = vec![nothing; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let area = (node.aabb.half_area() * scale) as f32;
        let leaf_cost = |objects: u32| area * BLOCK_COST * objects.div_ceil(Block::LANES as u32) as f32;
        decisions[index] = match (node.kind(), &decisions[node.children()]) {
            (NodeKind::Inner { .. }, [a, b]) => {
                let objects = a.objects + b.objects;
                let mut decision = Decision { objects, ..nothing };
                for slots in 2..=8 {
                    let (mut least, mut split) = (f32::INFINITY, 0);
                    for first in 1..slots {
                        let cost = a.costs[first - 1] + b.costs[slots - first - 1];
                        if cost < least {
                            (least, split) = (cost, first | (slots - first) << 4);
                        }
                    }
                    (decision.costs[slots - 1], decision.slots[slots - 1]) = (least, split as u8);
                }
                let (as_node, as_leaf) = (decision.costs[7] + area * NODE_COST, leaf_cost(objects));
                decision.leaf = as_leaf < as_node || (as_leaf == as_node && objects <= Block::LANES as u32);
                decision.costs[0] = if decision.leaf { as_leaf } else { as_node };
                // Fewer children where more are no better.
                for slots in 1..7 {
                    if decision.costs[slots - 1] <= decision.costs[slots] {
                        decision.costs[slots] = decision.costs[slots - 1];
                        decision.slots[slots] = decision.slots[slots - 1];
                    }
                }
                decision
            }
            (kind, _) => {
                let objects = if let NodeKind::Leaf { count, .. } = kind { count } else { 0 };
                Decision { costs: [leaf_cost(objects); 8], objects, ..nothing }
            }
        };
    }
    decisions
}

/// The wide layout of least expected cost. `tree` must be valid over the triangles' boxes.
pub(crate) fn widen(tree: &Bvh, triangles: &[Triangle]) -> WideBvh {
    let bounds = tree.root_aabb().unwrap_or(Aabb::EMPTY);
    let mut wide = WideBvh { bounds, root: None, nodes: Vec::new(), blocks: Vec::new() };
    if tree.nodes.is_empty() {
        return wide;
    }
    let tree = &*binary(tree);
    let decisions = decide(tree);
    let mut ids = Vec::new();
    // Subtrees, and the lane that is to name each; none names the root.
    let mut open = vec![(0, None)];
    while let Some((subtree, place)) = open.pop() {
        let child = if decisions[subtree].leaf {
            let child = Child::leaf(wide.blocks.len() as u32);
            ids.clear();
            collect(tree, subtree, &mut ids);
            wide.blocks.extend(Block::chain(&ids, triangles));
            child
        } else {
            let index = wide.nodes.len();
            wide.nodes.push(WideNode::EMPTY);
            // At most 8 slots are shared out: no more than 8 parts wait at any time.
            let mut parts = [(subtree, decisions[subtree].slots[7]); 8];
            let mut waiting = 1;
            let mut lane = 0;
            while waiting > 0 {
                waiting -= 1;
                let (part, slots) = parts[waiting];
                if slots == 0 {
                    wide.nodes[index].set_box(lane, &tree.nodes[part].aabb);
                    open.push((part, Some((index, lane))));
                    lane += 1;
                    continue;
                }
                let first = tree.nodes[part].children().start;
                for (part, slots) in [(first + 1, slots >> 4), (first, slots & 15)] {
                    parts[waiting] = (part, decisions[part].slots[usize::from(slots) - 1]);
                    waiting += 1;
                }
            }
            Child::node(index as u32)
        };
        match place {
            None => wide.root = Some(child),
            Some((node, lane)) => wide.nodes[node].children[lane] = child,
        }
    }
    wide
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cost, validate};
    use glam::Vec3;

    /// Triangles along a curve, and a lopsided binary tree over them with leaves of one.
    fn scene(n: u32, seed: u32) -> (Vec<Triangle>, Bvh) {
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
    fn exhaustive(tree: &Bvh, states: usize, cost: impl Fn(&[usize]) -> f64) -> f64 {
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

    fn objects(tree: &Bvh, node: usize) -> f64 {
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

    #[test]
    fn no_choice_of_nodes_costs_less_than_the_wide_layout() {
        for seed in 0..6 {
            let (triangles, tree) = scene(11, seed);
            let cost_of_leaf = |aabb: &Aabb, objects: f64| {
                aabb.half_area() * f64::from(BLOCK_COST) * (objects / Block::LANES as f64).ceil()
            };
            // States: wide node, left out, or leaf; the root is not left out.
            let least = exhaustive(&tree, 3, |choice| {
                let (mut total, mut open) = (0.0, vec![0]);
                while let Some(node) = open.pop() {
                    let aabb = &tree.nodes[node].aabb;
                    if tree.nodes[node].is_leaf() || choice[node] == 2 {
                        total += cost_of_leaf(aabb, objects(&tree, node));
                        continue;
                    }
                    total += aabb.half_area() * f64::from(NODE_COST);
                    let (mut children, mut parts) = (0, Vec::from_iter(tree.nodes[node].children()));
                    while let Some(part) = parts.pop() {
                        if choice[part] == 1 && !tree.nodes[part].is_leaf() {
                            parts.extend(tree.nodes[part].children());
                        } else {
                            children += 1;
                            open.push(part);
                        }
                    }
                    if children > 8 {
                        return f64::INFINITY;
                    }
                }
                total
            });
            let wide = WideBvh::new(&tree, &triangles).unwrap();
            let found: f64 = wide
                .boxes()
                .map(|(aabb, blocks)| match blocks {
                    0 => aabb.half_area() * f64::from(NODE_COST),
                    _ => cost_of_leaf(&aabb, (blocks * Block::LANES) as f64),
                })
                .sum();
            assert!((found - least).abs() < 1e-5 * least, "seed {seed}: {found} is not {least}");
        }
    }

    #[test]
    fn trees_of_one_leaf_and_of_none_have_layouts() {
        let (triangles, _) = scene(9, 1);
        let mut tree = Bvh { nodes: vec![Node::leaf(Aabb::EMPTY, 0, 9)], prim_ids: (0..9).rev().collect() };
        tree.refit(&triangles.iter().map(Triangle::aabb).collect::<Vec<_>>());
        let wide = WideBvh::new(&tree, &triangles).unwrap();
        assert_eq!((wide.nodes.len(), wide.blocks.len()), (0, 3));
        assert_eq!(WideBvh::new(&Bvh::default(), &[]).unwrap().bytes(), 0);
        assert!(WideBvh::new(&tree, &triangles[1..]).is_err());
    }
}
