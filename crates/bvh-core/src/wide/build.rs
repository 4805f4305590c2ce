//! The wide layout of least expected cost of a given tree.

use super::decide::{Costs, Decision, areas, children, decide};
use super::layout::{Child, WideBvh, WideNode};
use super::triangles::TriangleBlock;
use crate::collapse::{binary, binary_visited, collect};
use crate::{Aabb, Bvh, Kernel, Triangle};

/// By how much each subtree promises to stop a ray, in relation to the expected time of tracing a
/// ray through it. Rays that ask for any hit visit the child of most promise first, which is in the
/// last lane.
///
/// A line meets triangles of the total area A inside a box of half area B on average A / B times; a
/// ray is stopped by a fraction of such lines that grows with it and is less than 1.
///
/// Source: Ogaki & Derouet-Jourdan 2014, 'An N-ary BVH child node sorting technique for occlusion
/// test'. Differs from the paper: no rays are sampled.
fn promise(tree: &Bvh, triangles: &[Triangle], visits: &[f32], costs: &[Costs]) -> Vec<f32> {
    let mut areas = vec![0.0f64; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        // A leaf tests all of a triangle, though only a part of it may be in its box.
        let own = |&id: &u32| triangles[id as usize].area();
        areas[index] = tree.prim_ids[node.prims()].iter().map(own).sum::<f64>()
            + areas[node.children()].iter().sum::<f64>();
    }
    let promise = |(index, node): (usize, &crate::Node)| {
        let area = areas[index];
        let half_area = node.aabb.half_area();
        let stopped = if area > 0.0 { area / (area + half_area) } else { 0.0 };
        let time = costs[index][0] / visits[index].max(f32::MIN_POSITIVE);
        (stopped / f64::from(time).max(f64::MIN_POSITIVE)) as f32
    };
    tree.nodes.iter().enumerate().map(promise).collect()
}

/// Returns the number of nodes of the layout, and the largest number of blocks that it can have.
fn sizes(tree: &Bvh, decisions: &[Decision]) -> (usize, usize) {
    let mut sizes = (0, 0);
    let mut open = vec![0];
    while let Some(subtree) = open.pop() {
        let decision = &decisions[subtree];
        if decision.is_leaf {
            sizes.1 += decision.objects.div_ceil(TriangleBlock::LANES as u32) as usize;
        } else {
            sizes.0 += 1;
            let (children, lanes) = children(tree, decisions, subtree);
            open.extend_from_slice(&children[..lanes]);
        }
    }
    sizes
}

/// The wide layout of least expected cost for rays that enter the nodes of `tree` as often as
/// `visits` says, by default for random lines. `tree` must be valid over the triangles' boxes. Some
/// triangles may be left out.
pub(crate) fn widen(
    tree: &Bvh,
    triangles: &[Triangle],
    visits: Option<&[f32]>,
    is_left_out: impl Fn(u32) -> bool,
) -> WideBvh {
    let bounds = tree.root_aabb().unwrap_or(Aabb::EMPTY);
    let mut wide = WideBvh {
        bounds,
        root: None,
        nodes: Vec::new(),
        blocks: Vec::new(),
        near: Aabb::EMPTY,
        framed: None,
        error_factor: 1.0,
        kernel: Kernel::best(),
        stack_need: 0,
    };
    let around = match tree.frame {
        None => bounds,
        Some(_) => Aabb::around(triangles.iter().flat_map(|triangle| triangle.0)),
    };
    wide.set_bounds(tree.frame, &bounds, around);
    if tree.nodes.is_empty() {
        return wide;
    }
    let (tree, visits) = match visits {
        Some(visits) => {
            let mut visits = visits.to_vec();
            (binary_visited(tree, &mut visits), visits)
        }
        None => {
            let tree = binary(tree);
            let visits = areas(&tree);
            (tree, visits)
        }
    };
    let tree = &*tree;
    let split = tree.prim_ids.len() > triangles.len();
    let (decisions, costs) = decide(tree, &visits);
    let promise = promise(tree, triangles, &visits, &costs);
    drop(visits);
    drop(costs);
    // A vector that grows would take up to three times its memory while it is copied.
    let (node_count, most_blocks) = sizes(tree, &decisions);
    let mut ids = Vec::new();
    let mut all_blocks = Vec::with_capacity(most_blocks);
    let leaf = |subtree| {
        let child = Child::leaf(all_blocks.len() as u32);
        ids.clear();
        collect(tree.into(), subtree, &mut ids);
        if split {
            // Several parts of one triangle in one leaf are the triangle.
            ids.sort_unstable();
            ids.dedup();
        }
        ids.retain(|&id| !is_left_out(id));
        if ids.is_empty() {
            return None;
        }
        all_blocks.extend(TriangleBlock::chain(&ids, triangles));
        Some(child)
    };
    lay_out_nodes(&mut wide, tree, &decisions, &promise, node_count, leaf);
    assert!(all_blocks.len() < Child::END.index(), "blocks have indices of 31 bits");
    wide.blocks = all_blocks;
    wide
}

/// Lays out the nodes, the root and the `stack_need` as decided; children of more promise are in
/// later lanes. `leaf` lays out a leaf, and returns `None` if there is nothing in it.
fn lay_out_nodes(
    wide: &mut WideBvh,
    tree: &Bvh,
    decisions: &[Decision],
    promise: &[f32],
    node_count: usize,
    mut leaf: impl FnMut(usize) -> Option<Child>,
) {
    let mut nodes = Vec::with_capacity(node_count);
    // Subtrees, and the lane that is to name each; none names the root.
    let mut open = vec![(0, None, 0)];
    while let Some((subtree, place, waiting)) = open.pop() {
        let child = if decisions[subtree].is_leaf {
            let Some(child) = leaf(subtree) else { continue };
            child
        } else {
            let index = nodes.len();
            nodes.push(WideNode::EMPTY);
            let (mut children, lanes) = children(tree, decisions, subtree);
            children[..lanes].sort_by(|&a, &b| promise[a].total_cmp(&promise[b]));
            let waiting = waiting + lanes - 1;
            open.extend((0..lanes).map(|lane| (children[lane], Some((index, lane)), waiting)));
            Child::node(index as u32)
        };
        wide.stack_need = wide.stack_need.max(waiting);
        match place {
            None => wide.root = Some(child),
            Some((node, lane)) => {
                let parent: &mut WideNode = &mut nodes[node];
                parent.children[lane] = child;
                parent.set_box(lane, &wide.laid(&tree.nodes[subtree].aabb));
            }
        }
    }
    wide.nodes = nodes;
}

#[cfg(test)]
mod tests {
    use super::super::decide::{BLOCK_COST, NODE_COST};
    use super::*;
    use crate::collapse::tests::{exhaustive, objects, scene};

    #[test]
    fn no_choice_of_nodes_costs_less_than_the_layout_for_random_lines_or_for_the_visits_of_rays() {
        let along_x = |aabb: &Aabb| {
            let extent = aabb.extent();
            extent.y * extent.z + 0.02 * extent.x * (extent.y + extent.z)
        };
        for seed in 0..6 {
            let (triangles, tree) = scene(11, seed);
            let wide = WideBvh::new(&tree, &triangles).unwrap();
            check_optimal(&tree, &wide, Aabb::half_area);
            let visits: Vec<f32> =
                tree.nodes.iter().map(|node| along_x(&node.aabb) as f32).collect();
            let wide = WideBvh::for_rays(&tree, &triangles, &visits).unwrap();
            check_optimal(&tree, &wide, along_x);
        }
    }

    /// Checks that the layout has the least cost for rays that enter a box as often as its size
    /// says, that boxes are nested, and that every triangle is in one leaf.
    fn check_optimal(tree: &Bvh, wide: &WideBvh, size: impl Fn(&Aabb) -> f64) {
        let cost_of_leaf = |aabb: &Aabb, objects: f64| {
            size(aabb) * f64::from(BLOCK_COST) * (objects / TriangleBlock::LANES as f64).ceil()
        };
        // States: wide node, left out, or leaf; the root is not left out.
        let least = exhaustive(tree, 3, |choice| {
            let mut total = 0.0;
            let mut open = vec![0];
            while let Some(node) = open.pop() {
                let aabb = &tree.nodes[node].aabb;
                if tree.nodes[node].is_leaf() || choice[node] == 2 {
                    total += cost_of_leaf(aabb, objects(tree, node));
                    continue;
                }
                total += size(aabb) * f64::from(NODE_COST);
                let mut children = 0;
                let mut parts = Vec::from_iter(tree.nodes[node].children());
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
        let cost = |(aabb, child): (Aabb, Child)| match child.is_node() {
            true => size(&aabb) * f64::from(NODE_COST),
            false => cost_of_leaf(&aabb, (wide.leaf(child).len() * TriangleBlock::LANES) as f64),
        };
        let found: f64 = wide.boxes().map(cost).sum();
        assert!((found - least).abs() < 1e-5 * least, "{found} is not {least}");
        let mut ids = Vec::new();
        for (aabb, child) in wide.boxes() {
            if child.is_node() {
                let node = &wide.nodes[child.index()];
                let mut boxes = (0..WideNode::LANES).filter_map(|lane| node.lane_box(lane));
                assert!(boxes.all(|inner| aabb.contains(&inner)));
            } else {
                let triangles = wide.leaf(child).iter().flat_map(TriangleBlock::triangles);
                ids.extend(triangles.map(|(id, _)| id));
            }
        }
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..tree.prim_ids.len() as u32));
    }
}
