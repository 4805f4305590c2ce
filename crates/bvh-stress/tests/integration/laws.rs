//! Laws for all finite coordinates, as exact as each method can promise.
//!
//! | law | who | claim |
//! |---|---|---|
//! | scale by 2^k | every method | same tree, cost times 4^k, bit by bit; the case S21 of the suite has every k |
//! | | divided trees | the same, parts too; `suite` has every scene, and the number of threads |
//! | translation, exact in f32, on a grid of 24 bits | every method | same tree and cost, bit by bit. Off such a grid the sum of two corners, which orders objects, may round differently |
//! | reflection | insertion in any order, exact | same tree and cost, bit by bit: these see areas and indices only |
//! | | Müller–Fellner | same cost where neither centres nor costs of splits tie: ties go to the lower side |
//! | | median cut | same cost for 2^k objects: an odd one goes to the lower half |
//! | | agglomerative, searches from sorted orders | none: the Morton curve has a first corner; random draws name positions |
//! | permutation of axes | insertion, exact | same cost where areas are exact: otherwise xy + yz + zx rounds by its order |
//! | | Müller–Fellner | the same, and where nothing ties: ties go to the lower axis |
//! | | median cut, agglomerative | none: axes alternate from x; curves interleave x first |
//! | permutation of objects | Müller–Fellner, median cut | same tree, bit by bit, where no two centres tie along an axis |
//! | | exact | same cost but for rounding |
//! | | insertion | none: the order is what it is about |
//! | every object twice | exact | the optimum grows by the objects' areas at most, and never falls |
//! | one more object inside another | exact | the optimum grows by the other's area at most, and never falls |
//! | | insertion, last | the Goldsmith–Salmon cost grows by 1 at most, a place at the root, and never falls |

use bvh_core::{Aabb, cost};
use bvh_search::{Method, Outcome};
use bvh_stress::examine::{ROUNDING, check_outcome, check_scale, run};
use bvh_stress::transform::{mirrored, same_topology, scale_range, shuffled};
use bvh_stress::{EXACT_OBJECTS, methods};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

/// Nodes per object that a search may make or visit.
const WORK: u64 = 40;

/// The methods that use only areas and indices.
const BY_AREA: [&str; 4] = ["goldsmith_salmon", "random_orders", "genetic", "exact"];

fn solved(method: &Method, boxes: &[Aabb]) -> Outcome {
    run(method, boxes, WORK).unwrap_or_else(|broken| panic!("{}: {broken}", method.name()))
}

/// Returns the boxes that a method gets: few if it takes exponential time.
fn accepted<'a>(method: &Method, boxes: &'a [Aabb]) -> &'a [Aabb] {
    if let Method::Exact(_) = method { &boxes[..boxes.len().min(EXACT_OBJECTS - 4)] } else { boxes }
}

/// Returns true if the method builds the same tree with the same cost over both, bit by bit.
fn alike(method: &Method, boxes: &[Aabb], others: &[Aabb]) -> bool {
    let [one, other] = [boxes, others].map(|boxes| solved(method, accepted(method, boxes)));
    same_topology(&one.tree, &other.tree) && one.cost == other.cost
}

fn named(name: &str) -> Method {
    Method::all()
        .into_iter()
        .find(|method| method.name() == name)
        .expect("a method of the registry")
}

fn with_axes(boxes: &[Aabb], from: [usize; 3]) -> Vec<Aabb> {
    let turned = |point: Vec3| Vec3::from(from.map(|axis| point[axis]));
    boxes.iter().map(|aabb| Aabb { min: turned(aabb.min), max: turned(aabb.max) }).collect()
}

/// Returns true if no two boxes have the same centre along any axis; no order then depends on
/// indices.
fn distinct_centres(boxes: &[Aabb]) -> bool {
    (0..3).all(|axis| {
        let mut keys: Vec<f64> =
            boxes.iter().map(Aabb::doubled_centroid).map(|c: DVec3| c[axis]).collect();
        keys.sort_by(f64::total_cmp);
        keys.windows(2).all(|pair| pair[0] < pair[1])
    })
}

fn box_of([a, b]: [[f32; 3]; 2]) -> Aabb {
    let a = Vec3::from(a);
    let b = Vec3::from(b);
    Aabb { min: a.min(b), max: a.max(b) }
}

/// Boxes of any finite bits, with zeros and repetitions. Exponents come from a range, as narrow as
/// one exponent or as wide as all.
pub fn any_boxes() -> impl Strategy<Value = Vec<Aabb>> {
    (0u32..=254, 0u32..=254).prop_flat_map(|(low, width)| {
        let coordinate =
            (any::<u32>(), low..=(low + width).min(254)).prop_map(move |(bits, exponent)| {
                let random = f32::from_bits(bits & 0x807f_ffff | exponent << 23);
                if bits.is_multiple_of(16) { 0.0 * random } else { random }
            });
        let corner = || prop::array::uniform3(coordinate.clone());
        prop::collection::vec([corner(), corner()].prop_map(box_of), 0..40)
    })
}

/// Boxes whose coordinates are integer multiples, of at most `bits` bits, of one power of two, and
/// that power.
fn boxes_on_a_grid(bits: u32) -> impl Strategy<Value = (Vec<Aabb>, f32)> {
    (-149i32..=104).prop_flat_map(move |exponent| {
        let unit = libm::exp2(exponent.into()) as f32;
        let most = (1 << bits) - 1;
        let coordinate = (-most..=most).prop_map(move |whole: i32| whole as f32 * unit);
        let corner = || prop::array::uniform3(coordinate.clone());
        (prop::collection::vec([corner(), corner()].prop_map(box_of), 0..40), Just(unit))
    })
}

/// Returns true if both costs are the same except for the rounding of sums.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.max(b)
}

/// The number of scenes per law: few, or `PROPTEST_CASES`, which `.ci/nightly` sets.
fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(60)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases()))]

    #[test]
    fn every_tree_is_tight_of_exact_cost_and_the_same_at_any_scale(
        boxes in any_boxes(), fraction in 0.0..1.0,
    ) {
        for (label, method) in methods() {
            let boxes = accepted(&method, &boxes);
            let outcome = solved(&method, boxes);
            let found = check_outcome(boxes, &outcome);
            prop_assert!(found.is_ok(), "{}: {:?}", label, found);
            let range = scale_range(boxes);
            let k = range.start() + (f64::from(range.end() - range.start()) * fraction) as i32;
            let found = check_scale(&method, boxes, WORK, &outcome, k);
            prop_assert!(found.is_ok(), "{}: {:?}", label, found);
        }
    }

    #[test]
    fn an_exact_translation_changes_no_tree(
        (boxes, unit) in boxes_on_a_grid(22), by in prop::array::uniform3(-(1i32 << 22)..1 << 22),
    ) {
        // Sums of whole multiples have at most 24 bits, so they are exact.
        let by = Vec3::from(by.map(|whole| whole as f32 * unit));
        let moved: Vec<Aabb> =
            boxes.iter().map(|aabb| Aabb { min: aabb.min + by, max: aabb.max + by }).collect();
        for (label, method) in methods() {
            prop_assert!(alike(&method, &boxes, &moved), "{}", label);
        }
    }

    #[test]
    fn a_reflection_changes_nothing_for_methods_that_see_only_areas(
        boxes in any_boxes(), axis in 0usize..3,
    ) {
        for method in BY_AREA.map(named) {
            prop_assert!(alike(&method, &boxes, &mirrored(&boxes, axis)), "{}", method.name());
        }
    }

    #[test]
    fn a_permutation_of_axes_changes_nothing_where_areas_are_exact(
        (boxes, _) in boxes_on_a_grid(15),
        from in prop::sample::select(vec![[1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]]),
    ) {
        for method in BY_AREA.map(named) {
            prop_assert!(alike(&method, &boxes, &with_axes(&boxes, from)), "{}", method.name());
        }
    }

    #[test]
    fn a_reflection_keeps_the_cost_of_sorted_division(
        // Few exponents, because a large box would hide the differences of small ones.
        corners in prop::collection::vec(
            [0.5f32..8.0, 0.5f32..8.0, 0.5f32..8.0, 0.01f32..1.0, 0.01f32..1.0, 0.01f32..1.0],
            16,
        ),
        axis in 0usize..3, k in -100i32..100,
    ) {
        let scale = libm::exp2(k.into()) as f32;
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|&[x, y, z, width, height, depth]| {
                let min = Vec3::new(x, y, z);
                let max = min + Vec3::new(width, height, depth);
                Aabb { min: min * scale, max: max * scale }
            })
            .collect();
        prop_assume!(distinct_centres(&boxes));
        let other = mirrored(&boxes, axis);
        for method in ["muller_fellner", "median_cut"].map(named) {
            let costs = [&boxes, &other].map(|boxes| solved(&method, boxes).cost);
            prop_assert!(close(costs[0], costs[1]), "{}: {:?}", method.name(), costs);
        }
    }

    #[test]
    fn the_order_of_objects_with_distinct_centres_changes_no_divided_tree(
        boxes in any_boxes(), seed in any::<u64>(),
    ) {
        prop_assume!(distinct_centres(&boxes));
        let (permuted, order) = shuffled(&boxes, seed);
        for (label, method) in methods() {
            if !matches!(method, Method::MullerFellner(_) | Method::MedianCut(_)) {
                continue;
            }
            let one = solved(&method, &boxes);
            let mut other = solved(&method, &permuted);
            other.tree.prim_ids.iter_mut().for_each(|id| *id = order[*id as usize]);
            prop_assert!(one.tree == other.tree && one.cost == other.cost, "{}", label);
        }
    }

    #[test]
    fn the_order_of_objects_keeps_the_optimum(boxes in any_boxes(), seed in any::<u64>()) {
        let exact = named("exact");
        let boxes = accepted(&exact, &boxes);
        let costs = [solved(&exact, boxes).cost, solved(&exact, &shuffled(boxes, seed).0).cost];
        prop_assert!(close(costs[0], costs[1]), "{:?}", costs);
    }

    #[test]
    fn every_object_twice_costs_its_area_more_at_most(boxes in any_boxes()) {
        // Twice as many objects must still be few enough for the exact method.
        let boxes = &boxes[..boxes.len().min(6)];
        let twice: Vec<Aabb> = boxes.iter().flat_map(|b| [*b; 2]).collect();
        let exact = named("exact");
        let once = solved(&exact, boxes).cost;
        let both = solved(&exact, &twice).cost;
        let most: f64 = once + boxes.iter().map(Aabb::half_area).sum::<f64>();
        prop_assert!(once <= both * (1.0 + ROUNDING), "{once} {both}");
        prop_assert!(both <= most * (1.0 + ROUNDING), "{both} {most}");
        for (label, method) in methods() {
            let outcome = solved(&method, &twice);
            let is_wide = outcome.tree.nodes.iter().any(|node| node.children().len() > 2);
            let is_above = both <= outcome.cost * (1.0 + ROUNDING);
            prop_assert!(is_wide || is_above, "{} is below the optimum", label);
        }
    }

    #[test]
    fn an_enclosed_object_adds_at_most_its_encloser(
        boxes in any_boxes(), which in any::<prop::sample::Index>(),
    ) {
        prop_assume!(!boxes.is_empty());
        let boxes = &boxes[..boxes.len().min(EXACT_OBJECTS - 4)];
        let around = boxes[which.index(boxes.len())];
        let inside = Aabb { min: around.min, max: around.min };
        let more = [boxes, &[inside]].concat();
        let exact = named("exact");
        let before = solved(&exact, boxes).cost;
        let after = solved(&exact, &more).cost;
        let most = before + around.half_area();
        prop_assert!(before <= after * (1.0 + ROUNDING), "{before} {after}");
        prop_assert!(after <= most * (1.0 + ROUNDING), "{after} {most}");
        let insertion = named("goldsmith_salmon");
        let [before, after] = [boxes, &more]
            .map(|boxes| cost::goldsmith_salmon(&solved(&insertion, boxes).tree));
        let most = before + if boxes.len() == 1 { 2.0 } else { 1.0 };
        prop_assert!(before <= after * (1.0 + ROUNDING), "{before} {after}");
        prop_assert!(after <= most * (1.0 + ROUNDING), "{after} {most}");
    }
}
