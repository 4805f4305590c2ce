//! The experiment `precision`: what areas in f32 save in time and lose in decisions against areas in f64 and exact ones.
//!
//! The builder has areas in f64 only, so a plain sweep, the same code for every kind of number, stands in for it.

use super::exact_area::{half_area, internal_area, ratio};
use super::table::by_id;
use super::transform::scaled;
use crate::Error;
use crate::report::output::Output;
use crate::rows::columns::{Columns, read, to_bytes};
use crate::rows::store::Store;
use bvh_config::config;
use bvh_core::{Aabb, Bvh, Node};
use bvh_scenes::builtin::stiff;
use figures::{Axis, Figure, Layer, Panel};
use num_bigint::{BigInt, BigUint};
use num_traits::Zero;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Add;
use std::path::Path;
use std::time::Instant;

config! {
    serde;
    /// What is measured.
    pub struct Config {
        /// Objects per scene.
        objects: usize = 1500, in 3..=10_000_000;
        /// Builds per time; the shortest counts.
        repetitions: u32 = 7, in 1..;
    }
}

/// One kind of number on one scene, as written to `precision.csv`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
struct Row {
    scene: String,
    /// `f32` or `f64`.
    method: String,
    objects: usize,
    /// Inner nodes of the exact tree over three objects or more, where there is a choice.
    decisions: usize,
    /// Decisions for a split that costs more than the best one, in exact arithmetic.
    wrong: usize,
    /// Their fraction of all decisions.
    wrong_fraction: f64,
    /// Decisions in which no candidate has a finite cost.
    undecided: usize,
    /// The internal area of the whole tree over that of the exact one; 1 if both are 0.
    cost_over_exact: f64,
}

/// The time of one kind of number on one scene, as written to `timing_precision.csv`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
struct Timing {
    scene: String,
    /// `f32` or `f64`.
    method: String,
    /// The shortest build.
    nanoseconds_per_object: f64,
}

/// The columns of the files that a measurement leaves.
pub fn columns() -> Vec<Columns> {
    vec![Columns::of::<Row>(), Columns::of::<Timing>()]
}

/// A kind of number for costs: the cost of a split is the sum over both sides of half area times number of objects.
trait Number: Clone + PartialOrd + for<'a> Add<&'a Self, Output = Self> {
    fn side(aabb: &Aabb, count: usize) -> Self;
    fn is_finite(&self) -> bool;
}

impl Number for f32 {
    fn side(aabb: &Aabb, count: usize) -> Self {
        let d = aabb.max - aabb.min;
        (d.x * d.y + d.y * d.z + d.z * d.x) * count as f32
    }
    fn is_finite(&self) -> bool {
        Self::is_finite(*self)
    }
}

impl Number for f64 {
    fn side(aabb: &Aabb, count: usize) -> Self {
        aabb.half_area() * count as f64
    }
    fn is_finite(&self) -> bool {
        Self::is_finite(*self)
    }
}

impl Number for BigInt {
    fn side(aabb: &Aabb, count: usize) -> Self {
        half_area(aabb) * count
    }
    fn is_finite(&self) -> bool {
        true
    }
}

/// The first `left` objects in the order of `axis` against the rest.
type Split = (usize, usize);

/// The best of all splits by the rules of the builder: of equal cost the more balanced, then the lower axis and
/// position. `None` if no cost is finite.
fn best<N: Number>(boxes: &[Aabb], orders: &[Vec<u32>; 3]) -> Option<(N, Split)> {
    let n = orders[0].len();
    let mut best: Option<(N, usize, Split)> = None;
    for (axis, order) in orders.iter().enumerate() {
        let mut right = Vec::with_capacity(n);
        let mut aabb = Aabb::EMPTY;
        for (i, &object) in order.iter().enumerate().skip(1).rev() {
            aabb = aabb.union(&boxes[object as usize]);
            right.push(N::side(&aabb, n - i));
        }
        let mut aabb = Aabb::EMPTY;
        for (left, right) in (1..n).zip(right.iter().rev()) {
            aabb = aabb.union(&boxes[order[left - 1] as usize]);
            let cost = N::side(&aabb, left) + right;
            let imbalance = n.abs_diff(2 * left);
            let better = best.as_ref().is_none_or(|(least, balance, _)| {
                cost < *least || (*least >= cost && imbalance < *balance)
            });
            if cost.is_finite() && better {
                best = Some((cost, imbalance, (axis, left)));
            }
        }
    }
    best.map(|(cost, _, split)| (cost, split))
}

/// What a split costs, exactly.
fn exact_cost(boxes: &[Aabb], orders: &[Vec<u32>; 3], (axis, left): Split) -> BigInt {
    let (l, r) = orders[axis].split_at(left);
    let [l, r] = [l, r].map(|side| {
        let aabb = side
            .iter()
            .fold(Aabb::EMPTY, |b, &object| b.union(&boxes[object as usize]));
        BigInt::side(&aabb, side.len())
    });
    l + r
}

/// The objects of both sides in the orders of all axes.
fn divide(
    orders: &[Vec<u32>; 3],
    (axis, left): Split,
    goes_left: &mut [bool],
) -> [[Vec<u32>; 3]; 2] {
    for (at, &object) in orders[axis].iter().enumerate() {
        goes_left[object as usize] = at < left;
    }
    [true, false].map(|side| {
        [0, 1, 2].map(|axis: usize| {
            orders[axis]
                .iter()
                .copied()
                .filter(|&o| goes_left[o as usize] == side)
                .collect()
        })
    })
}

/// Divides greedily down to single objects. `choose` is asked for the split of every node of three or more.
fn build(boxes: &[Aabb], mut choose: impl FnMut(&[Vec<u32>; 3]) -> Split) -> Bvh {
    let sorted = |axis: usize| {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        order.sort_by(|&a, &b| {
            let key = |object: u32| boxes[object as usize].doubled_centroid()[axis];
            key(a).total_cmp(&key(b))
        });
        order
    };
    let placeholder = Node::leaf(Aabb::EMPTY, 0, 1);
    let mut tree = Bvh { nodes: vec![placeholder], prim_ids: Vec::with_capacity(boxes.len()) };
    let mut goes_left = vec![false; boxes.len()];
    let mut open = vec![(0, [0, 1, 2].map(sorted))];
    while let Some((node, orders)) = open.pop() {
        if let [object] = orders[0][..] {
            tree.nodes[node] = Node::leaf(Aabb::EMPTY, tree.prim_ids.len() as u32, 1);
            tree.prim_ids.push(object);
            continue;
        }
        let split = if orders[0].len() == 2 { (0, 1) } else { choose(&orders) };
        let [left, right] = divide(&orders, split, &mut goes_left);
        let first = tree.nodes.len();
        tree.nodes[node] = Node::inner(Aabb::EMPTY, first as u32, 2);
        tree.nodes.extend([placeholder; 2]);
        open.extend([(first + 1, right), (first, left)]);
    }
    tree.refit(boxes);
    tree
}

/// The best split, or the middle of the first order where no cost is finite.
fn chosen<N: Number>(boxes: &[Aabb], orders: &[Vec<u32>; 3]) -> Split {
    best::<N>(boxes, orders).map_or((0, orders[0].len() / 2), |(_, split)| split)
}

/// What f32 and f64 would have decided at the nodes of the exact tree.
#[derive(Default)]
struct Decisions {
    area: BigUint,
    all: usize,
    wrong: [usize; 2],
    undecided: [usize; 2],
}

fn decisions(boxes: &[Aabb]) -> Decisions {
    let mut found = Decisions::default();
    let tree = build(boxes, |orders| {
        let (least, split) = best::<BigInt>(boxes, orders)
            .unwrap_or_else(|| (BigInt::zero(), (0, orders[0].len() / 2)));
        found.all += 1;
        let choices = [
            best::<f32>(boxes, orders).map(|(_, split)| split),
            best::<f64>(boxes, orders).map(|(_, split)| split),
        ];
        for (kind, choice) in choices.into_iter().enumerate() {
            found.undecided[kind] += usize::from(choice.is_none());
            let choice = choice.unwrap_or((0, orders[0].len() / 2));
            found.wrong[kind] +=
                usize::from(choice != split && exact_cost(boxes, orders, choice) > least);
        }
        split
    });
    found.area = internal_area(&tree);
    found
}

/// The stiff scenes on which precision could matter, by case.
fn scenes(n: usize) -> Vec<(String, Vec<Aabb>)> {
    let mut found: Vec<(String, Vec<Aabb>)> = Vec::new();
    let uniform = stiff::boxes(&stiff::uniform(n));
    for k in [-120, -72, -68, 0, 56, 60, 120] {
        found.push((format!("S21 2^{k}"), scaled(&uniform, k)));
    }
    for id in ["S06", "S09", "S22", "S23", "S24", "S25", "S27", "S28", "S29", "S30", "S31"] {
        if let Some(case) = by_id(id)
            && let Some(scene) = case.scene()
        {
            found.push((id.into(), stiff::boxes(&case.triangles(n.min(scene.sizes[2])))));
        }
    }
    found
}

impl Config {
    /// Measures everything and writes the CSV files and the figure.
    pub fn execute(&self, store: &Store) -> Result<String, Error> {
        let mut rows = Vec::new();
        let mut timing = Vec::new();
        for (scene, boxes) in scenes(self.objects) {
            let Decisions { area, all, wrong, undecided } = decisions(&boxes);
            let measured = [self.timed::<f32>(&boxes), self.timed::<f64>(&boxes)];
            for (kind, (tree, seconds)) in measured.into_iter().enumerate() {
                let scene = scene.clone();
                let method = ["f32", "f64"][kind].to_owned();
                let nanoseconds_per_object = seconds * 1e9 / boxes.len() as f64;
                timing.push(Timing {
                    scene: scene.clone(),
                    method: method.clone(),
                    nanoseconds_per_object,
                });
                let cost_over_exact =
                    if area.is_zero() { 1.0 } else { ratio(&internal_area(&tree), &area) };
                rows.push(Row {
                    scene,
                    method,
                    objects: boxes.len(),
                    decisions: all,
                    wrong: wrong[kind],
                    wrong_fraction: wrong[kind] as f64 / all.max(1) as f64,
                    undecided: undecided[kind],
                    cost_over_exact,
                });
            }
        }
        store.write("precision.csv", &to_bytes(&rows, Path::new("precision.csv"))?)?;
        store.write(
            "timing_precision.csv",
            &to_bytes(&timing, Path::new("timing_precision.csv"))?,
        )?;
        let output = output(store.folder())?;
        output.draw(store)?;
        Ok(output.text())
    }

    /// The tree by one kind of number, and the seconds of the fastest build.
    fn timed<N: Number>(&self, boxes: &[Aabb]) -> (Bvh, f64) {
        let once = |_| {
            let start = Instant::now();
            let tree = build(boxes, |orders| chosen::<N>(boxes, orders));
            (tree, start.elapsed().as_secs_f64())
        };
        let builds = (0..self.repetitions.max(1)).map(once);
        builds
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or_default()
    }
}

fn figure(rows: &[Row], timing: &[Timing]) -> Figure {
    let of = |kind: &'static str| rows.iter().filter(move |row| row.method == kind);
    let scenes: Vec<String> = of("f32").map(|row| row.scene.clone()).collect();
    let panel = |title: &str, label: &str, value: &dyn Fn(&'static str) -> Vec<f64>| Panel {
        title: title.into(),
        x: Axis::categories("", scenes.clone()),
        y: Axis::linear(label),
        layers: ["f32", "f64"]
            .map(|kind| Layer::bars(kind, value(kind), 0.0))
            .into(),
    };
    let wrong = |kind| {
        of(kind)
            .map(|row| 100.0 * row.wrong_fraction)
            .collect()
    };
    let cost = |kind| {
        of(kind)
            .map(|row| 100.0 * (row.cost_over_exact - 1.0))
            .collect()
    };
    let own_time = |kind: &'static str| {
        timing
            .iter()
            .filter(move |row| row.method == kind)
    };
    let time = |kind| {
        own_time(kind)
            .map(|row| row.nanoseconds_per_object / 1000.0)
            .collect()
    };
    Figure {
        title: "What f32 areas cost: Müller–Fellner's choices against exact arithmetic".into(),
        caption: "Stiff scenes of the suite. Above, how often the chosen split is not the best one, at the nodes of \
                  the exact tree; then the cost of the whole tree over the exact one's; below, the time of one plain \
                  sweep, the same code for both."
            .into(),
        columns: 1,
        panels: vec![
            panel("wrong decisions", "% of nodes", &wrong),
            panel("cost above the exact tree's", "%", &cost),
            panel("time", "µs per object", &time),
        ],
        looks: vec![],
    }
}

/// What is made from the CSV files in the folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let rows: Vec<Row> = read(&folder.join("precision.csv"))?;
    let timing: Vec<Timing> = read(&folder.join("timing_precision.csv"))?;
    let mut output = Output::new("", "Areas in f32 and f64 against exact ones");
    let scenes = rows
        .iter()
        .filter(|row| row.method == "f32")
        .count();
    let of = |kind: &str| {
        let wrong: Vec<&Row> = rows
            .iter()
            .filter(|row| row.method == kind && row.wrong > 0)
            .collect();
        let worst = wrong
            .iter()
            .map(|row| 100.0 * row.wrong_fraction)
            .fold(0.0, f64::max);
        match wrong.len() {
            0 => format!("areas in {kind} on none"),
            some => format!(
                "areas in {kind} on {some} of {scenes} scenes, at up to {worst:.1} % of nodes"
            ),
        }
    };
    let seconds = |kind: &str| -> f64 {
        timing
            .iter()
            .filter(|row| row.method == kind)
            .map(|row| row.nanoseconds_per_object)
            .sum()
    };
    let saved = 100.0 * (1.0 - seconds("f32") / seconds("f64"));
    output.reading = format!(
        "Splits worse than by exact arithmetic: by {}; by {}. f32 takes {saved:.0} % less time.",
        of("f32"),
        of("f64")
    );
    let columns = "scene method decisions wrong undecided cost_over_exact";
    output.show("Decisions at the nodes of the exact tree:", &rows, columns)?;
    output
        .figures
        .push(("timing_precision".into(), figure(&rows, &timing)));
    Ok(output)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, muller_fellner};

    #[test]
    fn the_plain_sweep_in_f64_builds_the_trees_of_the_builder() {
        for make in [stiff::uniform, stiff::overlapping, stiff::planar_grid, stiff::two_densities] {
            let boxes = stiff::boxes(&make(200));
            let plain = build(&boxes, |orders| chosen::<f64>(&boxes, orders));
            let built = muller_fellner::Config::default()
                .build(&boxes)
                .unwrap();
            assert_eq!(internal_area(&plain), internal_area(&built));
        }
    }

    #[test]
    fn f32_is_lost_where_its_areas_vanish_or_overflow_and_f64_is_not() {
        let uniform = stiff::boxes(&stiff::uniform(60));
        for k in [-100, 100] {
            let Decisions { all, wrong, undecided, .. } = decisions(&scaled(&uniform, k));
            assert!(wrong[0] > all / 2, "{wrong:?} of {all}");
            assert_eq!((wrong[1], undecided[1]), (0, 0));
        }
        assert_eq!(decisions(&uniform).wrong[1], 0);
    }
}
