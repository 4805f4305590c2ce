//! Agglomerative clustering: repeatedly joins clusters that are each other's nearest neighbour
//! along the Morton curve.
//!
//! Meister & Bittner 2018, 'Parallel locally-ordered clustering for bounding volume hierarchy
//! construction' (PLOC). Clusters are in Morton order. In every round, each cluster finds its
//! nearest neighbour among the `radius` clusters on either side, by the area of the joint box, and
//! any two clusters that find each other are joined.
//!
//! Differs from the paper: Morton cells are cubes, so flat scenes are not distorted. The first
//! rounds may examine only adjacent clusters. Among equally near neighbours, the position with the
//! least exclusive or with the cluster's position wins, so regular grids are divided by powers of
//! two and identical clusters pair off. After a round with few joins, the next round also joins
//! adjacent clusters without a partner, which bounds the number of rounds by O(log n) for any
//! scene.

mod clusters;
mod morton;
mod neighbours;

use crate::error::check_scene;
use crate::watch::Pace;
use crate::{BuildError, Builder, Check, Watch};
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh, PackedAabb};
use clusters::Clusters;

bvh_config::config! {
    /// The range of the search for neighbours.
    pub struct Config {
        /// Number of clusters examined on either side.
        radius: u32 = 24, in 1..=1000;
        /// Number of first rounds that examine only the next cluster on either side: faster, and
        /// often no worse.
        near_rounds: u32 = 0;
    }
}

impl Builder for Config {
    /// Builds a tree in O(radius · n), plus a radix sort. The search for neighbours uses all
    /// threads of the current rayon pool; their number does not change the tree.
    fn build_watched(
        &self,
        boxes: &[Aabb],
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError> {
        self.check()?;
        MortonOrder::new(boxes)?.build(self, measure, watch)
    }
}

/// The objects of a scene in Morton order: the start of builds with any radius.
#[derive(Clone, Debug)]
pub struct MortonOrder {
    /// One box per object, by index.
    boxes: Vec<PackedAabb>,
    /// The box around all objects.
    bounds: PackedAabb,
    /// The objects in order.
    order: Vec<u32>,
}

impl MortonOrder {
    /// Checks and sorts the objects. The radix sort takes O(n), or O(n log n) if most objects are
    /// within a thousandth of the scene's size.
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let boxes: Vec<PackedAabb> = boxes.iter().map(PackedAabb::from).collect();
        let bounds = boxes.iter().fold(PackedAabb::EMPTY, |bounds, b| bounds.union(b));
        let order = morton::order(&boxes);
        Ok(Self { boxes, bounds, order })
    }

    /// Clusters the sorted objects by the measure, or by half area without one, unless the `watch`
    /// cancels.
    pub fn build(
        self,
        config: &Config,
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError> {
        config.check()?;
        let Self { boxes, bounds, order } = self;
        if boxes.is_empty() {
            return Ok(Bvh::default());
        }
        let boxes = order.iter().map(|&object| boxes[object as usize]).collect();
        let mut clusters = Clusters::new(boxes, &bounds);
        let mut pace = Pace::new(watch);
        let mut round = 0;
        while clusters.count() > 1 {
            // The first rounds have most clusters, so a small radius saves most time there.
            let radius = if round < config.near_rounds { 1 } else { config.radius as usize };
            if pace.ends_after(clusters.count()) {
                return Err(BuildError::Cancelled);
            }
            clusters.find_nearest(radius, measure);
            clusters.join();
            round += 1;
        }
        Ok(Bvh::new(clusters.into_nodes(), order))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::cost::Area;
    use bvh_core::glam::Vec3;
    use bvh_core::{Node, validate};
    use proptest::prelude::*;

    fn cube(low: [f32; 3], size: f32) -> Aabb {
        Aabb::from((low, low.map(|c| c + size)))
    }

    fn scatter(n: u32) -> Vec<Aabb> {
        (0..n)
            .map(|i| {
                let hash = i.wrapping_mul(2_654_435_761);
                let [x, y, z, size] =
                    [3, 11, 19, 27].map(|salt| (hash.rotate_left(salt) % 65_521) as f32);
                cube([x, y, z], size / 32.0)
            })
            .collect()
    }

    #[test]
    fn clusters_without_a_difference_pair_off_into_a_balanced_tree() {
        for boxes in [vec![cube([0.1; 3], 1.0); 1 << 12], vec![cube([0.1; 3], 0.0); 1 << 12]] {
            assert_eq!(Config::default().build(&boxes).unwrap().depth(), 12);
        }
    }

    #[test]
    fn no_scene_takes_more_rounds_than_a_multiple_of_the_logarithm() {
        // Nested boxes: the smallest cluster is the nearest of every cluster.
        let boxes: Vec<Aabb> =
            (1..20_000u16).map(|i| cube([-f32::from(i); 3], 2.0 * f32::from(i))).collect();
        let tree = Config::default().build(&boxes).unwrap();
        validate(&tree, &boxes).unwrap();
        assert!(tree.depth() < 1000, "{}", tree.depth());
    }

    #[cfg(feature = "rayon")]
    #[test]
    fn the_number_of_threads_does_not_change_the_tree() {
        let boxes = scatter(5000);
        let tree = Config::default().build(&boxes).unwrap();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| Config::default().build(&boxes).unwrap()), tree);
        }
    }

    #[test]
    fn the_scale_changes_no_tree_with_or_without_a_measure() {
        for measure in [None, Some(&Area as &dyn Measure)] {
            let tree = |exponent: i32| {
                let scaled = |corner: Vec3| corner * 2f32.powi(exponent);
                let boxes: Vec<Aabb> = scatter(500)
                    .iter()
                    .map(|aabb| Aabb { min: scaled(aabb.min), max: scaled(aabb.max) })
                    .collect();
                Config::default().build_watched(&boxes, measure, &Watch::default()).unwrap()
            };
            let topology = |tree: &Bvh| {
                let children: Vec<_> = tree.nodes.iter().map(Node::children).collect();
                (children, tree.prim_ids.clone())
            };
            // The areas of the largest boxes are too large for f32, those of the smallest too small.
            for exponent in [-100, 90] {
                assert_eq!(topology(&tree(exponent)), topology(&tree(0)), "2^{exponent}");
            }
        }
    }

    /// Returns the objects below every inner node, sorted, straight from the definition: without
    /// arrays of planes, f32, or early exits.
    fn oracle(boxes: &[Aabb], config: &Config) -> Vec<Vec<u32>> {
        let packed: Vec<PackedAabb> = boxes.iter().map(PackedAabb::from).collect();
        let mut current: Vec<(Aabb, Vec<u32>)> =
            morton::order(&packed).into_iter().map(|id| (boxes[id as usize], vec![id])).collect();
        let mut joined = Vec::new();
        let mut few = false;
        for round in 0.. {
            let n = current.len();
            if n == 1 {
                break;
            }
            let radius = if round < config.near_rounds { 1 } else { config.radius as usize };
            let key = |index: usize, other: usize| {
                let area = current[index].0.union(&current[other].0).half_area();
                (area, index ^ other)
            };
            let nearest = |index: usize| {
                let others = (index.saturating_sub(radius)..n.min(index + radius + 1))
                    .filter(|&other| other != index);
                others.min_by(|&a, &b| key(index, a).partial_cmp(&key(index, b)).unwrap()).unwrap()
            };
            let mut nearest: Vec<usize> = (0..n).map(nearest).collect();
            let mutual = |nearest: &[usize], index: usize| nearest[nearest[index]] == index;
            for index in 0..n - 1 {
                if few && !mutual(&nearest, index) && !mutual(&nearest, index + 1) {
                    (nearest[index], nearest[index + 1]) = (index + 1, index);
                }
            }
            let mut next = Vec::new();
            for index in 0..n {
                let other = nearest[index];
                if !mutual(&nearest, index) {
                    next.push(current[index].clone());
                } else if other > index {
                    let mut ids = [current[index].1.clone(), current[other].1.clone()].concat();
                    ids.sort_unstable();
                    joined.push(ids.clone());
                    next.push((current[index].0.union(&current[other].0), ids));
                }
            }
            few = n - next.len() < n.div_ceil(clusters::FEW);
            current = next;
        }
        joined.sort();
        joined
    }

    fn below_inner_nodes(tree: &Bvh) -> Vec<Vec<u32>> {
        let mut below: Vec<Vec<u32>> = vec![Vec::new(); tree.nodes.len()];
        for index in (0..tree.nodes.len()).rev() {
            let node = &tree.nodes[index];
            let mut ids = tree.prim_ids[node.prims()].to_vec();
            node.children().for_each(|child| ids.extend_from_slice(&below[child]));
            ids.sort_unstable();
            below[index] = ids;
        }
        let mut inner: Vec<_> = below.into_iter().filter(|ids| ids.len() > 1).collect();
        inner.sort();
        inner
    }

    proptest! {
        #[test]
        fn trees_are_those_of_the_definition(
            // Small integers make areas exact in f32, and many areas equal.
            corners in prop::collection::vec(([0u8..40, 0u8..40, 0u8..6], [0u8..5, 0u8..5, 0u8..5]), 1..90),
            radius in 1u32..30, near_rounds in 0u32..3, exponent in prop::sample::select(vec![-60, 0, 100]),
        ) {
            let place = |c: u8| f32::from(c) * 2f32.powi(exponent);
            let boxes: Vec<Aabb> = corners
                .iter()
                .map(|(low, size)| Aabb::from((low.map(place), [0, 1, 2].map(|axis| place(low[axis] + size[axis])))))
                .collect();
            let config = Config { radius, near_rounds };
            let tree = config.build(&boxes).unwrap();
            prop_assert!(validate(&tree, &boxes).is_ok());
            prop_assert_eq!(below_inner_nodes(&tree), oracle(&boxes, &config));
        }
    }

    #[test]
    fn a_plane_far_from_the_origin_for_its_size_does_not_hide_areas() {
        let flat = |x: f32| -> Vec<Aabb> {
            let rows = [0.0f32, 10.0, 11.0, 20.0, 21.0, 30.0, 31.0, 40.0].map(|row| row * 1e-10);
            rows.map(|y| Aabb::from(([x, y, 0.0], [x, y + 1e-10, 1e-10]))).to_vec()
        };
        assert_eq!(below_inner_nodes(&built(&flat(1e32))), below_inner_nodes(&built(&flat(0.0))));
        assert!(below_inner_nodes(&built(&flat(1e32))).contains(&vec![1, 2]));
    }

    fn built(boxes: &[Aabb]) -> Bvh {
        Config::default().build(boxes).unwrap()
    }
}
