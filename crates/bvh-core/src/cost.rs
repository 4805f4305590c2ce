//! Every cost that the workspace reports, as a documented formula in f64.
//!
//! Areas are *half* surface areas in world units squared, from coordinates promoted to f64 before subtraction. Sums are
//! compensated, so that the order of the nodes changes at most a cost's last bit or two. Costs that are divided by the
//! root's area are 0 by definition if that area is 0.

use crate::{Bvh, Node, NodeKind, PackedAabb};

pub use crate::layout_cost::{LayoutCost, layout_area, layout_measure};
pub use crate::overlap::end_point_overlap;

/// The cost that a search minimises and that results report as `cost`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Objective {
    /// [`internal_area`], the paper's objective.
    #[default]
    InternalArea,
    /// [`goldsmith_salmon`].
    GoldsmithSalmon,
    /// [`sah`] with the given constants.
    Sah(SahConstants),
    /// [`layout_area`]: what is traced through, once the tree becomes a [`WideBvh`](crate::WideBvh).
    Layout,
}

impl Objective {
    /// The cost of `tree` under this objective, in O(nodes).
    pub fn cost(&self, tree: &Bvh) -> f64 {
        match self {
            Self::InternalArea => internal_area(tree),
            Self::GoldsmithSalmon => goldsmith_salmon(tree),
            Self::Sah(constants) => sah(tree, constants),
            Self::Layout => layout_area(tree),
        }
    }

    /// The same by a measure in place of half areas, in O(nodes).
    pub fn cost_by(&self, tree: &Bvh, measure: &dyn Measure) -> f64 {
        let size = |node: &Node| measure.of(&PackedAabb::from(&node.aabb));
        let over_root = |total| over(tree.nodes.first().map_or(0.0, size), total);
        match self {
            Self::InternalArea => internal_measure(tree, measure),
            Self::GoldsmithSalmon => {
                over_root(by_children(tree, |node| if node.is_leaf() { 0.0 } else { size(node) }))
            }
            Self::Sah(constants) => over_root(by_tests(tree, constants, size)),
            Self::Layout => layout_measure(tree, measure),
        }
    }
}

/// A measure of boxes that builders and searches may go by in place of the half area: the expected number of rays that enter a
/// box, for example.
pub trait Measure: core::fmt::Debug + Sync {
    /// The measure of a box that is not empty: finite, not negative, and *monotone*, no smaller than that of any box inside it.
    /// Branch and bound is exact only for monotone measures.
    fn of(&self, aabb: &PackedAabb) -> f64;
}

/// The half area as a measure. What is generic over the measure is compiled for it as if there were no other.
#[derive(Clone, Copy, Debug, Default)]
pub struct Area;

impl Measure for Area {
    #[inline(always)]
    fn of(&self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }
}

/// The total measure of the boxes of all inner nodes, root included, in the measure's unit. O(nodes).
pub fn internal_measure(tree: &Bvh, measure: &dyn Measure) -> f64 {
    let inner = tree.nodes.iter().filter(|node| !node.is_leaf());
    inner.map(|node| measure.of(&PackedAabb::from(&node.aabb))).collect::<Sum>().value()
}

/// The total measure of the boxes of all nodes, leaves included. O(nodes).
pub fn total_measure(tree: &Bvh, measure: &dyn Measure) -> f64 {
    tree.nodes.iter().map(|node| measure.of(&PackedAabb::from(&node.aabb))).collect::<Sum>().value()
}

/// The total half area of the boxes of all nodes, leaves included, in world units squared: what remains of the surface area
/// heuristic with equal constants where every leaf has one reference. Trees with [split references](crate::Clip) are searched
/// by it. O(nodes).
pub fn total_area(tree: &Bvh) -> f64 {
    tree.nodes.iter().map(|node| node.aabb.half_area()).collect::<Sum>().value()
}

/// The constants of the surface area heuristic, in any common unit of time. With those that [`new`](Self::new) accepts,
/// every tree of finite boxes has a finite cost.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SahConstants {
    /// Cost of visiting an inner node. Default 1.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "checked"))]
    pub(crate) traversal: f64,
    /// Cost of testing one object. Default 1.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "checked"))]
    pub(crate) intersection: f64,
}

/// A constant that was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{found} is not a constant from 0 to {:e}", SahConstants::MAX)]
pub struct InvalidConstant {
    /// The value found.
    pub found: f64,
}

impl SahConstants {
    /// The largest constant: far from overflowing the sum over the largest tree of the largest boxes.
    pub const MAX: f64 = 1e200;

    /// The costs of visiting an inner node and of testing one object, each from 0 to [`MAX`](Self::MAX).
    pub fn new(traversal: f64, intersection: f64) -> Result<Self, InvalidConstant> {
        match [traversal, intersection].into_iter().find(|constant| !(0.0..=Self::MAX).contains(constant)) {
            Some(found) => Err(InvalidConstant { found }),
            None => Ok(Self { traversal, intersection }),
        }
    }

    /// Cost of visiting an inner node.
    pub fn traversal(&self) -> f64 {
        self.traversal
    }

    /// Cost of testing one object.
    pub fn intersection(&self) -> f64 {
        self.intersection
    }
}

#[cfg(feature = "serde")]
fn checked<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let constant = serde::Deserialize::deserialize(deserializer)?;
    SahConstants::new(constant, constant).map(|_| constant).map_err(serde::de::Error::custom)
}

impl Default for SahConstants {
    fn default() -> Self {
        Self { traversal: 1.0, intersection: 1.0 }
    }
}

/// The paper's objective: the total half area of the boxes of all inner nodes, root included, in world units squared.
/// Compare it only within a scene. O(nodes).
///
/// Source: Ng & Trifonov 2003, section 3.3. Differs from the paper: half areas instead of whole ones, as in the paper's
/// own implementation (section 3.2).
pub fn internal_area(tree: &Bvh) -> f64 {
    // Whether a node is a leaf is unpredictable, so both values are computed and one is selected. Adding 0 changes no
    // sum.
    let area = |node: &Node| core::hint::select_unpredictable(node.is_leaf(), 0.0, node.aabb.half_area());
    tree.nodes.iter().map(area).collect::<Sum>().value()
}

/// The Goldsmith–Salmon cost: Σ over inner nodes of S(node) / S(root) · number of children. Dimensionless: the
/// expected number of boxes below the root that a random line through the root's box is tested against. O(nodes).
///
/// Source: Goldsmith & Salmon 1987; Ng & Trifonov 2003, section 1.
pub fn goldsmith_salmon(tree: &Bvh) -> f64 {
    over_root_area(tree, by_children(tree, |node| node.aabb.half_area()))
}

/// Σ size(node) · number of children.
fn by_children(tree: &Bvh, size: impl Fn(&Node) -> f64) -> f64 {
    tree.nodes.iter().map(|node| size(node) * node.children().len() as f64).collect::<Sum>().value()
}

/// The surface area heuristic: traversal · Σ inner S/S(root) + intersection · Σ leaves S/S(root) · objects.
/// Dimensionless multiple of the constants' unit: expected time per random line through the root's box. O(nodes).
///
/// Source: MacDonald & Booth 1990.
pub fn sah(tree: &Bvh, constants: &SahConstants) -> f64 {
    over_root_area(tree, by_tests(tree, constants, |node| node.aabb.half_area()))
}

/// Σ size(node) · what visiting the node, or testing its objects, costs.
fn by_tests(tree: &Bvh, constants: &SahConstants, size: impl Fn(&Node) -> f64) -> f64 {
    let cost = |node: &Node| {
        size(node)
            * match node.kind() {
                NodeKind::Inner { .. } => constants.traversal,
                NodeKind::Leaf { count, .. } => constants.intersection * f64::from(count),
            }
    };
    tree.nodes.iter().map(cost).collect::<Sum>().value()
}

/// `area` divided by the half area of the root's box; 0 when that area is 0 or the tree is empty.
pub fn over_root_area(tree: &Bvh, area: f64) -> f64 {
    over(tree.root_aabb().map_or(0.0, |aabb| aabb.half_area()), area)
}

fn over(root: f64, total: f64) -> f64 {
    if root > 0.0 { total / root } else { 0.0 }
}

/// A compensated sum (Neumaier 1974): as accurate as if added in twice the precision.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    total: f64,
    lost: f64,
}

impl Sum {
    /// Adds one term.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let total = self.total + term;
        self.lost += if self.total.abs() >= term.abs() {
            (self.total - total) + term
        } else {
            (term - total) + self.total
        };
        self.total = total;
    }

    /// The sum so far.
    #[inline]
    pub fn value(&self) -> f64 {
        self.total + self.lost
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, Node};
    use alloc::{vec, vec::Vec};

    /// Unit cubes at x = 0 and x = 2 under one root of half area 7.
    fn two_cubes() -> Bvh {
        let boxes = [Aabb::from(([0.0; 3], [1.0; 3])), Aabb::from(([2.0, 0.0, 0.0], [3.0, 1.0, 1.0]))];
        let root = Node::inner(boxes[0].union(&boxes[1]), 1, 2);
        Bvh { nodes: vec![root, Node::leaf(boxes[0], 0, 1), Node::leaf(boxes[1], 1, 1)], prim_ids: vec![0, 1] }
    }

    #[test]
    fn two_cubes_cost_what_the_hand_computes() {
        let tree = two_cubes();
        assert_eq!(sah(&tree, &SahConstants::default()), 1.0 + 6.0 / 7.0);
        assert_eq!(sah(&tree, &SahConstants { traversal: 2.0, intersection: 0.0 }), 2.0);
        assert_eq!(internal_area(&tree), 7.0);
        assert_eq!(goldsmith_salmon(&tree), 2.0);
    }

    #[test]
    fn constants_that_could_make_a_cost_infinite_or_nan_are_refused() {
        for wrong in [f64::NAN, f64::INFINITY, -1.0, 2e200] {
            for refused in [SahConstants::new(wrong, 1.0), SahConstants::new(1.0, wrong)] {
                let error = refused.unwrap_err().to_string();
                assert_eq!(error, alloc::format!("{wrong} is not a constant from 0 to 1e200"));
            }
        }
        let largest = Aabb { min: glam::Vec3::splat(f32::MIN), max: glam::Vec3::splat(f32::MAX) };
        let tree = Bvh { nodes: vec![Node::leaf(largest, 0, u32::MAX >> 1); 100], prim_ids: vec![] };
        assert!(sah(&tree, &SahConstants::new(SahConstants::MAX, SahConstants::MAX).unwrap()).is_finite());
    }

    #[test]
    fn trees_without_inner_nodes_or_area_cost_nothing() {
        let point = Aabb::from(([1.0; 3], [1.0; 3]));
        let flat = Bvh {
            nodes: vec![Node::inner(point, 1, 2), Node::leaf(point, 0, 1), Node::leaf(point, 1, 1)],
            prim_ids: vec![0, 1],
        };
        let single = Bvh { nodes: vec![Node::leaf(point, 0, 1)], prim_ids: vec![0] };
        for tree in [Bvh::default(), single, flat] {
            for objective in [
                Objective::InternalArea,
                Objective::GoldsmithSalmon,
                Objective::Sah(SahConstants::default()),
                Objective::Layout,
            ] {
                assert_eq!(objective.cost(&tree), 0.0, "{objective:?} of {tree:?}");
            }
        }
    }

    #[test]
    fn a_sum_does_not_depend_on_the_order_of_its_terms() {
        let terms: Vec<f64> = (0..1000).map(|i| f64::from(i * i % 997) * 10f64.powi(i % 30)).collect();
        let forwards: Sum = terms.iter().copied().collect();
        let backwards: Sum = terms.iter().rev().copied().collect();
        assert_eq!(forwards.value(), backwards.value());
    }
}
