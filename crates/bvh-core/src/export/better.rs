//! The better of two trees for a tracer, by the tests that rays take there.

use super::three_mesh::LEAF;
use super::{Layout, Target, ThreeMeshNode};
use crate::traverse::{TestCounts, nearest_hit_by};
use crate::{Aabb, Bvh, PreparedRay, Ray, Slabs, Triangle};
use core::f64::consts::TAU;
use glam::DVec3;

/// The number of rays of each kind. Both trees trace the same rays, so that few suffice.
const RAYS: u32 = 4096;
/// The tests after which no more rays are traced: a fraction of a second. Where objects are as large
/// as the scene, fewer rays must do.
const MOST_TESTS: u64 = 1 << 24;

/// Tests of boxes and triangles in a second, where every one waits for memory.
const TESTS_PER_SECOND: f64 = 2e7;

/// A tree for a tracer, by [`Target::fit_better`].
#[derive(Clone, Debug, PartialEq)]
pub struct Better {
    /// The fitted tree.
    pub tree: Bvh,
    /// The cost of a ray in the library's kind of tree over that in the searched one: of rays that
    /// begin inside the scene's box, and of rays that begin outside and go into it.
    pub gains: [f64; 2],
}

impl Better {
    /// Returns whether the tree is the searched one: whether the geometric mean of the gains is at
    /// least 1.
    pub fn is_searched(&self) -> bool {
        let product = self.gains[0] * self.gains[1];
        // NaN is of a box in which no ray can begin.
        product >= 1.0 || product.is_nan()
    }
}

impl Target {
    /// Returns the searched tree, [fitted](Self::fit). If the rays of both kinds take more tests in
    /// it on average than in the tree of the library's kind, returns that one: a greedy tree, such
    /// as of `bvh_build::muller_fellner`, is at least as good as the binned ones that libraries
    /// build.
    ///
    /// The area of a tree does not tell which one is better, above all for a smooth mesh in
    /// `three-mesh-bvh`, whose traversal leaves a box out only where a hit lies before it along one
    /// axis. O(objects), and a few thousand rays.
    pub fn fit_better(&self, searched: &Bvh, own: &Bvh, triangles: &[Triangle]) -> Better {
        let [searched, own] = [self.fit(searched), self.fit(own)];
        let [ours, theirs] = self.counted_costs([&searched, &own], triangles, MOST_TESTS);
        let gains = [theirs[0] / ours[0], theirs[1] / ours[1]];
        let better = Better { tree: searched, gains };
        if better.is_searched() { better } else { Better { tree: own, ..better } }
    }

    /// Returns about how many seconds [`fit_better`](Self::fit_better) takes for trees of such a
    /// [cost](Self::cost), if every test waits for memory.
    pub fn comparison_seconds(cost: f64) -> f64 {
        let tests = 2.0 * f64::from(2 * RAYS) * cost;
        tests.min(MOST_TESTS as f64) / TESTS_PER_SECOND
    }

    /// Returns the costs of all rays of each kind in each of two fitted trees, or of as many as take
    /// few tests.
    fn counted_costs(
        &self,
        trees: [&Bvh; 2],
        triangles: &[Triangle],
        most_tests: u64,
    ) -> [[f64; 2]; 2] {
        let mut costs = [[0.0; 2]; 2];
        let Some(bounds) = trees[0].root_aabb() else { return costs };
        let nodes = trees.map(|tree| match self.layout {
            Layout::ThreeMesh => tree.to_three_mesh(),
            // Visited by the nearer child first.
            Layout::FirstCount | Layout::FirstCountAligned | Layout::Json => Vec::new(),
        });
        let cost = |which: usize, ray: Ray, tests: &mut u64| {
            let mut counts = TestCounts::default();
            let (tree, nodes) = (trees[which], &nodes[which]);
            if nodes.is_empty() {
                let prepared = PreparedRay::new(&ray);
                let test = |id, t_max| triangles[id as usize].intersect(&prepared, t_max);
                nearest_hit_by(tree, &ray, test, &mut counts);
            } else {
                ThreeMeshRay::new(nodes, &tree.prim_ids, triangles, &ray, &mut counts).first_hit(0);
            }
            *tests += counts.boxes + counts.objects;
            // A visit of an inner node tests the boxes of two children.
            0.5 * self.constants.traversal * counts.boxes as f64
                + self.constants.intersection * counts.objects as f64
        };
        let mut tests = 0;
        for pair in (0..RAYS).filter_map(|index| rays(&bounds, index)) {
            for (which, costs) in costs.iter_mut().enumerate() {
                costs[0] += cost(which, pair[0], &mut tests);
                costs[1] += cost(which, pair[1], &mut tests);
            }
            if tests > most_tests {
                break;
            }
        }
        costs
    }
}

/// Returns a ray from a point of the box in any direction, and a ray to that point from outside.
///
/// Five coordinates are from the additive sequence of the generalised golden ratio, which covers
/// its cube evenly. Source: Roberts 2018, 'The unreasonable effectiveness of quasirandom sequences'.
fn rays(bounds: &Aabb, index: u32) -> Option<[Ray; 2]> {
    /// The positive root of x⁶ = x + 1.
    const RATIO: f64 = 1.134_724_138_401_519_4;
    let mut step = 1.0;
    let [x, y, z, height, turn] = [(); 5].map(|()| {
        step /= RATIO;
        let place = 0.5 + step * f64::from(index);
        place - place.floor()
    });
    let up = 1.0 - 2.0 * height;
    let (sin, cos) = libm::sincos(TAU * turn);
    let direction = DVec3::new(cos, sin, 0.0) * (1.0 - up * up).sqrt() + DVec3::Z * up;
    let extent = bounds.extent();
    let point = bounds.min.as_dvec3() + DVec3::new(x, y, z) * extent;
    let centre = 0.5 * bounds.doubled_centroid();
    let eye = centre + direction * extent.length();
    let ray = |origin: DVec3, direction: DVec3| {
        Ray::half_line(origin.as_vec3(), direction.try_normalize()?.as_vec3()).ok()
    };
    Some([ray(point, direction)?, ray(eye, point - eye)?])
}

/// A ray in the traversal of `three-mesh-bvh`: no hit shortens the ray, and a node's second child is
/// left out only if the hit in the first one lies before its box along the node's axis.
struct ThreeMeshRay<'a> {
    nodes: &'a [ThreeMeshNode],
    ids: &'a [u32],
    triangles: &'a [Triangle],
    prepared: PreparedRay,
    slabs: Slabs,
    counts: &'a mut TestCounts,
}

impl<'a> ThreeMeshRay<'a> {
    fn new(
        nodes: &'a [ThreeMeshNode],
        ids: &'a [u32],
        triangles: &'a [Triangle],
        ray: &Ray,
        counts: &'a mut TestCounts,
    ) -> Self {
        let (prepared, slabs) = (PreparedRay::new(ray), Slabs::new(ray, &nodes[0].aabb()));
        Self { nodes, ids, triangles, prepared, slabs, counts }
    }

    /// Returns the distance of the first hit below a node, infinite without one. Recursive, as the
    /// library's is: fitted trees have at most its depth.
    fn first_hit(&mut self, index: usize) -> f32 {
        let ThreeMeshNode { below, axis_or_count, .. } = self.nodes[index];
        if let Some(count) = axis_or_count.checked_sub(LEAF) {
            self.counts.objects += u64::from(count);
            return self.ids[below as usize..][..count as usize]
                .iter()
                .filter_map(|&id| self.triangles[id as usize].intersect(&self.prepared, f32::MAX))
                .fold(f32::INFINITY, f32::min);
        }
        let axis = axis_or_count as usize;
        let [low, high] = [index + 1, index + below as usize];
        let [origin, direction] = self.slabs.ray.ends().map(|vector| f64::from(vector[axis]));
        let (first, second) = if direction >= 0.0 { (low, high) } else { (high, low) };
        let found = if self.meets(first) { self.first_hit(first) } else { f32::INFINITY };
        let point = origin + f64::from(found) * direction;
        let is_before = if second > first {
            point <= f64::from(self.nodes[second].min[axis])
        } else {
            point >= f64::from(self.nodes[second].max[axis])
        };
        if !(found < f32::INFINITY && is_before) && self.meets(second) {
            return found.min(self.first_hit(second));
        }
        found
    }

    /// Returns whether the ray meets a node's box, and counts the test.
    fn meets(&mut self, index: usize) -> bool {
        self.counts.boxes += 1;
        self.slabs.entry(&self.nodes[index].aabb()) < f32::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::tests::scene;
    use crate::{Node, boxes, nearest_hit};

    #[test]
    fn the_traversal_of_three_mesh_bvh_finds_the_nearest_hit() {
        let (triangles, tree) = scene(300, 1);
        let fitted = Target::THREE_MESH_BVH.fit(&tree);
        let nodes = fitted.to_three_mesh();
        let bounds = tree.root_aabb().unwrap();
        let mut hits = 0;
        for ray in (0..2000).flat_map(|index| rays(&bounds, index).unwrap()) {
            let mut counts = TestCounts::default();
            let found = ThreeMeshRay::new(&nodes, &fitted.prim_ids, &triangles, &ray, &mut counts)
                .first_hit(0);
            let expected = nearest_hit(&tree, &triangles, &ray);
            assert_eq!(found, expected.map_or(f32::INFINITY, |hit| hit.t));
            hits += usize::from(expected.is_some());
            // The root's box is not tested, and both children of a visited node are at most.
            assert!(counts.boxes >= 1 && counts.boxes < nodes.len() as u64);
            assert!(counts.objects <= 300);
        }
        assert!((500..3500).contains(&hits), "{hits}");
    }

    #[test]
    fn fewer_rays_are_traced_where_all_of_them_meet_all_triangles() {
        let triangles =
            vec![Triangle([DVec3::ZERO, DVec3::X, DVec3::ONE].map(|c| c.as_vec3())); 30_000];
        let leaf = Node::leaf(triangles[0].aabb(), 0, 30_000);
        let tree = Bvh { nodes: vec![leaf], prim_ids: (0..30_000).collect(), ..Bvh::default() };
        for target in [Target::PLAIN, Target::THREE_MESH_BVH] {
            let costs = target.counted_costs([&tree; 2], &triangles, 1 << 21);
            assert_eq!(costs[0], costs[1]);
            assert!(costs[0].iter().all(|&cost| (1e5..1e7).contains(&cost)), "{costs:?}");
        }
    }

    #[test]
    fn rays_of_one_kind_outweigh_a_smaller_loss_of_the_other() {
        for (gains, is_searched) in [
            ([1.4, 0.99], true),
            ([0.99, 1.4], true),
            ([1.0, 1.0], true),
            ([1.01, 0.98], false),
            ([0.7, 1.4], false),
            ([f64::NAN; 2], true),
        ] {
            let better = Better { tree: Bvh::default(), gains };
            assert_eq!(better.is_searched(), is_searched, "{gains:?}");
        }
    }

    #[test]
    fn the_tree_with_fewer_tests_is_kept() {
        let (triangles, poor) = scene(300, 1);
        // Halves of halves of the triangles along an axis.
        let mut sorted = poor.prim_ids.clone();
        sorted.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|id| triangles[id as usize].0[0].x);
            a.total_cmp(&b)
        });
        let leaf = Bvh::new(vec![Node::leaf(Aabb::EMPTY, 0, 300)], sorted);
        let mut good = Target { most_objects: 1, ..Target::OBVHS }.fit(&leaf);
        good.refit(&boxes(&triangles));
        for target in Target::ALL {
            let better = target.fit_better(&good, &poor, &triangles);
            assert!(better.is_searched(), "{target:?}: {:?}", better.gains);
            assert!(better.gains.iter().all(|&gain| gain > 1.02), "{:?}", better.gains);
            assert_eq!(better.tree, target.fit(&good), "{target:?}");
            let worse = target.fit_better(&poor, &good, &triangles);
            assert!(!worse.is_searched(), "{target:?}");
            assert_eq!(worse.tree, better.tree, "{target:?}");
            assert_eq!(target.fit_better(&poor, &poor, &triangles).gains, [1.0; 2]);
        }
        let empty = Target::OBVHS.fit_better(&Bvh::default(), &Bvh::default(), &[]);
        assert!(empty.is_searched() && empty.tree.nodes.is_empty());
    }
}
