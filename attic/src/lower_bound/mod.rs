//! A proven lower bound of the internal area of every binary tree over a scene, for any number of
//! objects.
//!
//! # The bound
//!
//! Every object i has a weight wᵢ > 0; w(S) is the weight of a set. Let A(S) be the half area of
//! the box around S and gᵢ(x) the least A(S) of all sets of two objects or more that contain i and
//! weigh x or more. Let α be any function with α(p) + α(1 − p) = 1 for 0 < p < 1, and ψᵢ(wᵢ) = 0,
//!
//! > ψᵢ(x) = min over y < x of ψᵢ(y) + α(y / x) · gᵢ(x) / y,
//!
//! where y is wᵢ or a greater weight that a set with i may have. Then **every binary tree over S
//! with one object per leaf has an internal area of at least Σ wᵢ · ψᵢ(w(S)) over the objects i of
//! S.**
//!
//! *Proof*, by induction over the size of S. A single object has no inner node, and ψᵢ(wᵢ) = 0.
//! Otherwise the root divides S into L and R; let x = w(S) and y = w(L). The area of the root is
//! A(S), and A(S) ≥ gᵢ(x) for every i in S. By the definition of ψ, wᵢ · ψᵢ(x) ≤ wᵢ · ψᵢ(y) + α(y /
//! x) · A(S) · wᵢ / y for the objects of L. Summed over L, whose weights add up to y, this is Σ wᵢ
//! · ψᵢ(x) ≤ Σ wᵢ · ψᵢ(y) + α(y / x) · A(S), and likewise for R with α(1 − y / x). Because both α
//! add up to 1, the sum over S is at most A(S) plus the sums for L and R, which by induction are at
//! most the internal areas of the subtrees. ∎
//!
//! With equal weights and α(p) = 1 − p this is ∫ (c(t) − 1) dt, where c(t) = Σ 1 / (the most
//! objects in a box of area t with i) is a fractional count of the boxes of area t that are needed
//! to cover all objects. This bound alone is never below the minimum spanning tree under the areas
//! of unions of pairs, whose cost is the same integral over the number of connected components. The
//! α used here, α(p) = h(p) / (h(p) + h(1 − p)) with h(p) = (1 − p^¼) / (1 − p), charges more to
//! unequal divisions: a chain of log₂ n equal divisions then costs as much as in a tree, and not
//! only ln n. h is a secant of a concave function, so h decreases, and α decreases, too.
//!
//! # Rounding down
//!
//! Every inexact value is rounded down. Weights are integers, and sizes fall into classes. A step
//! between classes has the cost of the cheapest pair of their sizes: the largest possible y and the
//! smallest possible x, because α decreases and divisions leave at least the weight of one object
//! on either side. A branch and bound (`smallest_box`) searches gᵢ at the lower ends of bands of
//! sizes, and for large sizes once for a whole group of neighbours. It returns the least open bound
//! when its effort ends.
//!
//! Large objects among small ones belong into separate clusters. The weight wᵢ therefore grows with
//! the square root of the area of the union of i and its nearest neighbour.

mod clusters;
mod smallest_box;

use bvh_build::BuildError;
use bvh_core::{Aabb, cost::Sum};
use bvh_search::{Observer, lower_bound::of_largest};
use clusters::{Clusters, Grouped};
use rayon::prelude::*;

/// A lower bound of [`bvh_core::cost::internal_area`] of every binary tree over `boxes` with one
/// object per leaf, in world units squared; 0 for fewer than two objects. See the [module](self)
/// for the proof.
///
/// `effort` limits the search for the smallest boxes: the number of times that it examines their
/// neighbourhood after the first. Time grows with the effort and, for objects that are spread over
/// space, with n log n; O(n²) if boxes overlap so much that all objects are neighbours. Memory
/// O(n).
///
/// The result is reduced by the fraction 10⁻¹², more than all rounding errors together. Areas are
/// rounded as in the cost of a tree and are monotone in the box; only the sums of a few hundred
/// terms and over all objects add errors.
pub fn internal_area(
    boxes: &[Aabb],
    effort: u32,
    observer: &dyn Observer,
) -> Result<f64, BuildError> {
    let mut clusters = Clusters::new(boxes)?;
    let n = boxes.len();
    if n < 2 {
        return Ok(0.0);
    }
    let nearest =
        map_numbers(n, |object| clusters.smallest_box(clusters.leaf(object), 2, effort, observer));
    let weights = weights(&nearest);
    clusters.set_weights(&weights);
    let classes = Classes::new(clusters.weight());
    let bands: Vec<Grouped> = bands(clusters.weight())
        .map(|from| {
            let groups = clusters.groups(from / SEEDS_PER_SIZE);
            let areas = map_numbers(groups.len(), |group| {
                clusters.smallest_box(groups[group], from, effort, observer)
            });
            clusters.grouped(from, &groups, &areas)
        })
        .collect();
    let shares = map_numbers(n, |object| {
        if observer.cancelled() {
            return 0.0;
        }
        // Any set of two objects or more needs at least the box with the nearest neighbour.
        let mut areas = vec![nearest[object]; classes.first.len()];
        for band in &bands {
            let class = classes.first.partition_point(|&first| first < band.from);
            let area = band.area(object);
            areas[class..].iter_mut().for_each(|least| *least = least.max(area));
        }
        // The last class holds the weight of all objects, whose only box is the scene's.
        *areas.last_mut().unwrap_or(&mut 0.0) = clusters.area();
        weights[object] as f64 * classes.least_path(weights[object], &areas)
    });
    if observer.cancelled() {
        return Ok(of_largest(boxes));
    }
    Ok(shares.into_iter().collect::<Sum>().value() * (1.0 - 1e-12))
}

/// The objects of a group together weigh at most 1/8 of the size in question, so one search for the
/// whole group weakens the bound little.
const SEEDS_PER_SIZE: u64 = 8;

/// The range of weights: 1 to 16 in units of the least.
const LEAST_WEIGHT: u64 = 4;
const MOST_WEIGHT: u64 = 64;

/// Returns integer weights from the area of the union of every object and its nearest neighbour.
fn weights(nearest: &[f64]) -> Vec<u64> {
    let mut sorted = nearest.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    // The lower quartile is robust against a few tiny objects.
    let unit = sorted[sorted.len() / 4];
    if unit <= 0.0 {
        return vec![LEAST_WEIGHT; nearest.len()];
    }
    nearest
        .iter()
        .map(|area| ((area / unit).sqrt() * LEAST_WEIGHT as f64).round() as u64)
        .map(|weight| weight.clamp(LEAST_WEIGHT, MOST_WEIGHT))
        .collect()
}

/// The sizes for which smallest boxes are searched: every size while single objects matter, then
/// increasing steps.
fn bands(total: u64) -> impl Iterator<Item = u64> {
    std::iter::successors(Some(2 * LEAST_WEIGHT + 1), |&from| {
        let step = if from < MOST_WEIGHT { 1 } else { from.div_ceil(6) };
        Some(from + step)
    })
    .take_while(move |&from| from < total)
}

/// Classes of sizes: one size each up to the greatest weight, then increasing widths. The last
/// class holds the weight of all objects only.
struct Classes {
    /// The least size of every class.
    first: Vec<u64>,
    /// The least α(y / x) / y of the steps to a class: one row per class, one entry per class that
    /// leads to it.
    rates: Vec<Vec<f64>>,
}

impl Classes {
    fn new(total: u64) -> Self {
        let first: Vec<u64> = std::iter::successors(Some(LEAST_WEIGHT), |&size| {
            let step = if size <= MOST_WEIGHT { 1 } else { size.div_ceil(32) };
            (size < total).then_some(total.min(size + step))
        })
        .collect();
        let mut last: Vec<u64> = first[1..].iter().map(|next| next - 1).collect();
        last.push(total);
        let rates = (0..first.len())
            .map(|to| {
                // A step must leave room for the least weight on the other side.
                let sources = first.partition_point(|&from| from + LEAST_WEIGHT <= last[to]);
                (0..sources.min(to)).map(|from| rate(last[from], first[to], last[to])).collect()
            })
            .collect();
        Self { first, rates }
    }

    /// Returns ψ at the weight of all objects, for an object of this weight and the areas of its
    /// smallest boxes by class.
    fn least_path(&self, weight: u64, areas: &[f64]) -> f64 {
        let start = (weight - LEAST_WEIGHT) as usize;
        let mut least = vec![f64::INFINITY; self.first.len()];
        least[start] = 0.0;
        for to in start + 1..least.len() {
            let steps = least.iter().zip(&self.rates[to]).skip(start);
            least[to] =
                steps.map(|(before, rate)| before + rate * areas[to]).fold(f64::INFINITY, f64::min);
        }
        least.last().copied().unwrap_or(0.0)
    }
}

/// Returns the least α(y / x) / y of a step from sizes up to `from` to sizes `first..=last`.
fn rate(from: u64, first: u64, last: u64) -> f64 {
    let y = from.min(last - LEAST_WEIGHT);
    let x = first.max(y + LEAST_WEIGHT);
    share(y as f64 / x as f64) / y as f64
}

/// Returns the numbers of the tasks `0..count`, which all threads share.
fn map_numbers(count: usize, task: impl Fn(usize) -> f64 + Sync + Send) -> Vec<f64> {
    (0..count).into_par_iter().map(task).collect()
}

/// α: the fraction of a node's area that is charged to a child with this fraction of the node's
/// weight.
fn share(part: f64) -> f64 {
    let of_child = over_secant(part);
    let of_sibling = over_secant(1.0 - part);
    of_sibling / (of_child + of_sibling)
}

/// Returns 1 / h without cancellation, by 1 − p = (1 − p^¼)(1 + p^¼)(1 + p^½).
fn over_secant(p: f64) -> f64 {
    (1.0 + p.sqrt().sqrt()) * (1.0 + p.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_scenes::Scene;
    use bvh_search::{Budget, Problem, exact, solve};
    use proptest::prelude::*;

    /// Boxes of very different sizes, `flat` axes without extent; every fourth scene is on a coarse
    /// grid, which makes ties, flat boxes and coincident ones.
    fn scene(n: usize, flat: usize) -> impl Strategy<Value = Vec<Aabb>> {
        let coordinate = (0u8..=255).prop_map(|step| f32::from(step) / 16.0);
        let aabb = (prop::array::uniform3(coordinate), prop::array::uniform3(0u8..=7), 1u8..=40);
        (prop::collection::vec(aabb, n), 0u8..4).prop_map(move |(boxes, coarse)| {
            let on_grid = |value: f32| if coarse == 0 { (value / 4.0).floor() } else { value };
            let of = |(low, size, scale): ([f32; 3], [u8; 3], u8)| {
                let keep = |axis: usize, value: f32| if axis < flat { 0.0 } else { on_grid(value) };
                let low: [f32; 3] = std::array::from_fn(|axis| keep(axis, low[axis]));
                let size = |axis| keep(axis, f32::from(size[axis]) * f32::from(scale) / 40.0);
                Aabb::from((low, std::array::from_fn(|axis| low[axis] + size(axis))))
            };
            boxes.into_iter().map(of).collect()
        })
    }

    fn boxes(scene: &str) -> Vec<Aabb> {
        Scene::load(scene).unwrap().boxes
    }

    fn optimum(boxes: &[Aabb]) -> f64 {
        solve(&exact::Config {}, &Problem::new(boxes), 1, Budget::UNLIMITED, &()).unwrap().cost
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2500))]
        #[test]
        fn it_is_never_above_the_optimum(
            boxes in (0usize..=9, 0usize..3).prop_flat_map(|(n, flat)| scene(n, flat)),
            effort in 0u32..40,
        ) {
            let bound = internal_area(&boxes, effort, &()).unwrap();
            let optimum = optimum(&boxes);
            prop_assert!((0.0..=optimum).contains(&bound), "{bound} {optimum}");
        }
    }

    #[test]
    fn it_is_most_of_the_optimum_of_scattered_boxes() {
        for salt in 1..=4u16 {
            let number = |i: u16, k: u16| {
                f32::from((i * 97 + salt * 41 + 7).wrapping_mul(k * 211 + 89) % 997) / 100.0
            };
            let corner = |i| [number(i, 1), number(i, 2), number(i, 3)];
            let boxes: Vec<Aabb> = (0..12)
                .map(|i| Aabb::from((corner(i), corner(i).map(|c| c + number(i, 4) / 10.0))))
                .collect();
            let tightness = internal_area(&boxes, 16, &()).unwrap() / optimum(&boxes);
            assert!(tightness > 0.8, "{tightness}");
        }
    }

    #[test]
    fn two_objects_have_only_one_tree() {
        let boxes = [Aabb::from(([0.0; 3], [1.0; 3])), Aabb::from(([2.0; 3], [7.0; 3]))];
        let bound = internal_area(&boxes, 1, &()).unwrap();
        assert!((1.0 - 1e-11..1.0).contains(&(bound / boxes[0].union(&boxes[1]).half_area())));
    }

    #[test]
    fn more_effort_never_hurts_and_shares_add_up() {
        let boxes = boxes("escher:300");
        let bounds = [0, 4, 16, 64].map(|effort| internal_area(&boxes, effort, &()).unwrap());
        assert!(bounds[0] > 0.0 && bounds.is_sorted(), "{bounds:?}");
        for part in [0.001, 0.2, 0.5, 0.93] {
            assert!((share(part) + share(1.0 - part) - 1.0).abs() < 1e-15);
            assert!(share(part) > share(part + 0.01));
        }
    }

    #[test]
    fn a_cancellation_ends_any_effort_and_leaves_a_bound() {
        use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
        struct After(AtomicU64);
        impl Observer for After {
            fn cancelled(&self) -> bool {
                self.0.fetch_update(Relaxed, Relaxed, |left| Some(left.saturating_sub(1))) == Ok(0)
            }
        }
        let boxes = boxes("escher:3000");
        let whole = internal_area(&boxes, 1, &()).unwrap();
        for polls in [0, 1, 10_000] {
            // Without a cancellation, this effort would take hours.
            let bound = internal_area(&boxes, u32::MAX, &After(AtomicU64::new(polls))).unwrap();
            assert!(bound > 0.0 && bound < whole, "{bound} {whole}");
        }
    }

    #[test]
    fn bad_boxes_are_rejected_and_extreme_ones_are_not() {
        let mut boxes = boxes("escher:50");
        for factor in [2f32.powi(-140), 2f32.powi(100)] {
            let scaled: Vec<Aabb> =
                boxes.iter().map(|b| Aabb { min: b.min * factor, max: b.max * factor }).collect();
            let bound = internal_area(&scaled, 4, &()).unwrap();
            assert!(bound > 0.0 && bound.is_finite());
        }
        boxes[7].min.y = f32::NAN;
        assert!(internal_area(&boxes, 4, &()).unwrap_err().to_string().contains("object 7"));
    }
}
