//! Tests of rays in trees that are trained on rays, relative to a tree that is searched for by
//! area.

use super::data::grouped;
use super::prelude::*;
use crate::rows::TestRow;
use crate::statistics::{geometric_mean, student};

report! {
    /// A comparison of trees by the tests of rays that they were not trained on.
    pub struct Config {
        /// Label of the method that the others are compared with.
        base: String;
        /// Pairs of labels: whether trees of the second take more tests than those of the first.
        /// Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pairs: Vec<[String; 2]>;
    }
}

/// A tree's tests over those of the base, as written to `ray_cost.csv`; rows for the geometric mean
/// of all scenes come last.
#[derive(Serialize)]
pub(super) struct Compared<'a> {
    scene: &'a str,
    /// The method's label, or `rays` if the tree was trained on rays.
    tree: &'a str,
    trained_on: &'a str,
    judged_on: &'a str,
    camera: &'a str,
    /// Tests of nodes and of blocks of triangles together.
    tests: Option<f64>,
    /// `tests` over the base's.
    tests_over_base: f64,
    /// Lower end of the 95 % interval, from the standard errors of both over the repetitions.
    over_base_low: Option<f64>,
    /// Its upper end.
    over_base_high: Option<f64>,
}

/// A method's tests over those of another on one scene, as written to `ray_cost_pairs.csv`.
#[derive(Serialize)]
pub(super) struct Paired<'a> {
    scene: &'a str,
    method: &'a str,
    /// Label of the other method.
    against: &'a str,
    judged_on: &'a str,
    camera: &'a str,
    /// Tests of nodes and blocks over the other's.
    tests_over_other: f64,
    /// Lower end of the 95 % interval, from the standard errors of both over the repetitions.
    low: Option<f64>,
    /// The upper end of `low`'s interval.
    high: Option<f64>,
    /// `fewer` if the interval lies below 1, `more` if above; `inconclusive` if it holds 1, or if
    /// there is none.
    verdict: &'static str,
}

/// The scene of rows that are geometric means.
const ALL: &str = "geometric mean";

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut table: Vec<Compared> =
            rows.tests.iter().filter_map(|row| compared(rows, row, &self.base)).collect();
        let means = means(&table);
        table.extend(means);
        let mut output = Output::default();
        output.add_csv("ray_cost", &table)?;
        let paired: Vec<Paired> = self.pairs.iter().flat_map(|pair| paired(rows, pair)).collect();
        if !paired.is_empty() {
            output.add_csv("ray_cost_pairs", &paired)?;
        }
        Ok(output)
    }
}

/// A tree's tests over those of the trees of the method `base`.
fn compared<'a>(rows: &'a Rows, row: &'a TestRow, base: &str) -> Option<Compared<'a>> {
    let same = |of: &&TestRow| {
        of.scene == row.scene
            && of.method == base
            && (&of.judged_on, &of.camera) == (&row.judged_on, &row.camera)
    };
    let base = rows.tests.iter().find(same)?;
    let [own, other] = [row, base].map(|row| row.node_tests + row.block_tests);
    let ratio = own / other;
    // Of a ratio of means, by the relative errors of both.
    let relative = row.tests_standard_error.zip(base.tests_standard_error);
    // The degrees of freedom of one mean: with those of both, intervals would be somewhat narrower.
    let factor = student(row.repetitions.min(base.repetitions));
    let half =
        relative.zip(factor).map(|((a, b), factor)| factor * ratio * (a / own).hypot(b / other));
    Some(Compared {
        scene: &row.scene,
        tree: &row.tree,
        trained_on: &row.trained_on,
        judged_on: &row.judged_on,
        camera: &row.camera,
        tests: Some(own),
        tests_over_base: ratio,
        over_base_low: half.map(|half| ratio - half),
        over_base_high: half.map(|half| ratio + half),
    })
}

/// Compares the second method of a pair with the first, on all scenes and for all rays.
fn paired<'a>(rows: &'a Rows, [first, second]: &'a [String; 2]) -> Vec<Paired<'a>> {
    let pair = |row: &'a TestRow| {
        let over = compared(rows, row, first)?;
        Some(Paired {
            scene: &row.scene,
            method: second,
            against: first,
            judged_on: &row.judged_on,
            camera: &row.camera,
            tests_over_other: over.tests_over_base,
            low: over.over_base_low,
            high: over.over_base_high,
            verdict: match over.over_base_low.zip(over.over_base_high) {
                Some((_, high)) if high < 1.0 => "fewer",
                Some((low, _)) if low > 1.0 => "more",
                _ => "inconclusive",
            },
        })
    };
    rows.tests.iter().filter(|row| row.method == *second).filter_map(pair).collect()
}

/// Returns the geometric means over scenes of rows that agree in all other columns.
fn means<'a>(table: &[Compared<'a>]) -> Vec<Compared<'a>> {
    let key = |row: &&Compared<'a>| (row.tree, row.trained_on, row.judged_on, row.camera);
    let mean = |own: Vec<&Compared<'a>>| {
        let ratios: Vec<f64> = own.iter().map(|row| row.tests_over_base).collect();
        Compared {
            scene: ALL,
            tests: None,
            tests_over_base: geometric_mean(&ratios),
            over_base_low: None,
            over_base_high: None,
            ..*own[0]
        }
    };
    grouped(table, key).into_values().map(mean).collect()
}
