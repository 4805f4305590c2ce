//! The area and the overlap of the nodes on each level of a tree.

use bvh_core::Bvh;

/// The nodes at one depth, with areas relative to the root's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// The number of inner nodes.
    pub inner: usize,
    /// The number of leaves.
    pub leaves: usize,
    /// The sum of the inner nodes' areas: the expected number of them that a random line visits.
    pub area: f64,
    /// The sum over the inner nodes of the areas that two of their children share.
    pub overlap: f64,
}

/// Returns the levels of a tree, the root's first. O(nodes).
pub fn of(tree: &Bvh) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    let root_area = tree.root_aabb().map_or(0.0, |root| root.half_area());
    // The areas of a scene without area are all 0.
    let unit = root_area.max(f64::MIN_POSITIVE);
    let mut row: Vec<usize> = (0..tree.nodes.len().min(1)).collect();
    while !row.is_empty() {
        let mut level = Level::default();
        let mut next = Vec::new();
        for &index in &row {
            let node = &tree.nodes[index];
            let children = node.children();
            if children.is_empty() {
                level.leaves += 1;
                continue;
            }
            level.inner += 1;
            level.area += node.aabb.half_area() / unit;
            for (position, first) in children.clone().enumerate() {
                for second in children.clone().skip(position + 1) {
                    let shared = tree.nodes[first].aabb.intersection(&tree.nodes[second].aabb);
                    level.overlap += shared.half_area() / unit;
                }
            }
            next.extend(children);
        }
        levels.push(level);
        row = next;
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, median_cut};
    use bvh_core::{Aabb, cost};
    use glam::Vec3;

    #[test]
    fn levels_add_up_to_the_tree() {
        let mut boxes = Vec::new();
        for index in 0..100 {
            let min = Vec3::new(index as f32, (index % 7) as f32, (index % 3) as f32);
            boxes.push(Aabb { min, max: min + Vec3::splat(1.5) });
        }
        let tree = median_cut::Config::default().build(&boxes).unwrap();
        let levels = of(&tree);
        let inner: usize = levels.iter().map(|level| level.inner).sum();
        let leaves: usize = levels.iter().map(|level| level.leaves).sum();
        let area: f64 = levels.iter().map(|level| level.area).sum();
        assert_eq!((inner, inner + leaves), (tree.inner_count(), tree.nodes.len()));
        let expected = cost::over_root_area(&tree, cost::internal_area(&tree));
        assert!((area - expected).abs() < 1e-12 * expected, "{area} {expected}");
        assert_eq!(levels[0].area, 1.0);
        assert!(levels.iter().any(|level| level.overlap > 0.0));
    }

    #[test]
    fn two_apart_children_share_nothing() {
        let boxes = [0.0, 5.0]
            .map(|x| Aabb { min: Vec3::new(x, 0.0, 0.0), max: Vec3::new(x + 1.0, 1.0, 1.0) });
        let tree = median_cut::Config::default().build(&boxes).unwrap();
        let levels = of(&tree);
        assert_eq!((levels.len(), levels[0].overlap, levels[1].leaves), (2, 0.0, 2));
    }
}
