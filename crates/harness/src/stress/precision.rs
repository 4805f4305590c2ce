//! The experiment `precision`: the time that areas in f32 save, and the decisions that they get
//! wrong, compared with areas in f64 and exact areas.
//!
//! The builder supports only areas in f64, so a plain sweep, generic over the kind of number,
//! replaces it here.

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
    /// Parameters of the measurement.
    pub struct Config {
        /// Objects per scene.
        objects: usize = 1500, in 3..=10_000_000;
        /// Builds per time; the shortest one counts.
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
    /// Inner nodes of the exact tree over at least three objects, where there is a choice.
    decisions: usize,
    /// Decisions for a split that costs more than the best one, in exact arithmetic.
    wrong: usize,
    /// Wrong decisions as a fraction of all decisions.
    wrong_fraction: f64,
    /// Decisions in which no candidate has a finite cost.
    undecided: usize,
    /// The internal area of the full tree over the exact tree's; 1 if both are 0.
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

/// The columns of the files that a measurement writes.
pub fn columns() -> Vec<Columns> {
    vec![Columns::of::<Row>(), Columns::of::<Timing>()]
}

/// A kind of number for costs. The cost of a split is the sum over both sides of half area times
/// number of objects.
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

/// A split into the first `left` objects in the order of `axis` and the rest.
type Split = (usize, usize);

/// Returns the best of all splits by the builder's rules: among equal costs the more balanced one,
/// then the lower axis and position. `None` if no cost is finite.
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

/// Returns the exact cost of a split.
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

/// Returns the objects of both sides in the orders of all axes.
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

/// Divides greedily down to single objects. `choose` selects the split of every node with at least
/// three objects.
fn build(boxes: &[Aabb], mut choose: impl FnMut(&[Vec<u32>; 3]) -> Split) -> Bvh {
    let placeholder = Node::leaf(Aabb::EMPTY, 0, 1);
    let mut tree = Bvh { nodes: vec![placeholder], prim_ids: Vec::with_capacity(boxes.len()) };
    let mut goes_left = vec![false; boxes.len()];
    let mut open = vec![(0, [0, 1, 2].map(|axis| sorted_by_centre(boxes, axis)))];
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

fn sorted_by_centre(boxes: &[Aabb], axis: usize) -> Vec<u32> {
    let centres: Vec<f64> = boxes
        .iter()
        .map(|aabb| aabb.doubled_centroid()[axis])
        .collect();
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.sort_by(|&a, &b| centres[a as usize].total_cmp(&centres[b as usize]));
    order
}

/// Returns the best split, or the middle of the first order if no cost is finite.
fn chosen<N: Number>(boxes: &[Aabb], orders: &[Vec<u32>; 3]) -> Split {
    best::<N>(boxes, orders).map_or((0, orders[0].len() / 2), |(_, split)| split)
}

/// The decisions of f32 and f64 at the nodes of the exact tree.
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

/// Returns the stiff scenes on which precision may matter, by case.
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

    /// Returns the tree of one kind of number, and the seconds of the fastest build.
    fn timed<N: Number>(&self, boxes: &[Aabb]) -> (Bvh, f64) {
        let builds = (0..self.repetitions.max(1)).map(|_| {
            let start = Instant::now();
            let tree = build(boxes, |orders| chosen::<N>(boxes, orders));
            (tree, start.elapsed().as_secs_f64())
        });
        builds
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or_default()
    }
}

/// Draws one number of each row as bars by scene, one colour per kind of number.
fn panel<T>(title: &str, label: &str, rows: &[T], bar: impl Fn(&T) -> (&str, &str, f64)) -> Panel {
    let mut scenes = Vec::new();
    let mut values = [Vec::new(), Vec::new()];
    for row in rows {
        let (scene, method, value) = bar(row);
        if method == KINDS[0] {
            scenes.push(scene.to_owned());
        }
        values[usize::from(method != KINDS[0])].push(value);
    }
    let [f32_values, f64_values] = values;
    Panel {
        title: title.into(),
        x: Axis::categories("", scenes),
        y: Axis::linear(label),
        layers: vec![
            Layer::bars(KINDS[0], f32_values, 0.0),
            Layer::bars(KINDS[1], f64_values, 0.0),
        ],
    }
}

/// The kinds of numbers in the column `method`.
const KINDS: [&str; 2] = ["f32", "f64"];

fn figure(rows: &[Row], timing: &[Timing]) -> Figure {
    Figure {
        title: "What f32 areas cost: Müller–Fellner's choices against exact arithmetic".into(),
        caption: "Stiff scenes of the suite. Above, how often the chosen split is not the best one, at the nodes of \
                  the exact tree; then the cost of the whole tree over the exact one's; below, the time of one plain \
                  sweep, the same code for both."
            .into(),
        columns: 1,
        panels: vec![
            panel("wrong decisions", "% of nodes", rows, |row| {
                (&row.scene, &row.method, 100.0 * row.wrong_fraction)
            }),
            panel("cost above the exact tree's", "%", rows, |row| {
                (&row.scene, &row.method, 100.0 * (row.cost_over_exact - 1.0))
            }),
            panel("time", "µs per object", timing, |row| {
                (&row.scene, &row.method, row.nanoseconds_per_object / 1000.0)
            }),
        ],
        looks: vec![],
    }
}

/// Makes the table and the figure from the CSV files in the folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let rows: Vec<Row> = read(&folder.join("precision.csv"))?;
    let timing: Vec<Timing> = read(&folder.join("timing_precision.csv"))?;
    let mut output = Output::new("", "Areas in f32 and f64 against exact ones");
    let scenes = rows
        .iter()
        .filter(|row| row.method == "f32")
        .count();
    let [by_f32, by_f64] = KINDS.map(|kind| {
        let wrong = rows
            .iter()
            .filter(|row| row.method == kind && row.wrong > 0)
            .map(|row| 100.0 * row.wrong_fraction);
        let worst = wrong.clone().fold(0.0, f64::max);
        match wrong.count() {
            0 => format!("areas in {kind} on none"),
            some => format!(
                "areas in {kind} on {some} of {scenes} scenes, at up to {worst:.1} % of nodes"
            ),
        }
    });
    let [f32_time, f64_time] = KINDS.map(|kind| {
        let times = timing.iter().filter(|row| row.method == kind);
        times
            .map(|row| row.nanoseconds_per_object)
            .sum::<f64>()
    });
    let saved = 100.0 * (1.0 - f32_time / f64_time);
    output.reading = format!(
        "Splits worse than by exact arithmetic: by {by_f32}; by {by_f64}. \
         f32 takes {saved:.0} % less time."
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
