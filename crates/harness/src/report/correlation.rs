//! Correlations of costs with the tests of rays, over the trees that one method builds on one
//! scene.
//!
//! Trees of different methods are never pooled: a ranking of binary and n-ary trees together mostly
//! separates the two kinds (Simpson 1951).

use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::statistics::{pearson, pearson_interval, spearman};
use bvh_config::above;
use indexmap::IndexMap;
use std::collections::BTreeMap;

report! {
    /// Costs against tests per ray.
    pub struct Config {
        /// Labels of the methods, the paper's own case first. Trees of each method are compared
        /// with each other only.
        methods: Vec<String>, in OneOrMore;
        /// The paper's words on the correlation over the trees of the first method.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_says: Option<String>;
        /// Least value of Pearson's correlation for which these words hold.
        paper_from: f64 = 0.9, in above(0.0);
    }
}

/// One cost against one kind of rays over the trees of one method, as written to `correlation.csv`.
#[derive(Serialize)]
pub(super) struct Correlation<'a> {
    scene: &'a str,
    /// Label of the method whose trees are compared.
    method: &'a str,
    /// Name of the cost.
    cost: &'a str,
    family: &'a str,
    query: &'a str,
    trees: usize,
    pearson: Option<f64>,
    /// Lower end of the 95 % interval of `pearson`, by Fisher's transformation; empty for fewer
    /// than four trees.
    pearson_low: Option<f64>,
    /// Upper end of this interval.
    pearson_high: Option<f64>,
    spearman: Option<f64>,
}

/// The family and query of the paper's rays: they start inside and end at any hit.
const OF_PAPER: (&str, &str) = ("inside", "any");

/// The cost that the paper compares with tests, as in `runs.csv`.
const OF_AREA: &str = "goldsmith_salmon";

/// A tree by its run: scene, method and repetition.
type Tree<'a> = (&'a str, &'a str, u32);

/// The costs of all trees by their names: by area, and one by the density of each kind of rays.
fn costs(rows: &Rows) -> IndexMap<String, BTreeMap<Tree<'_>, f64>> {
    let mut costs: IndexMap<String, BTreeMap<Tree, f64>> = IndexMap::new();
    let mut add = |name: &str, tree, cost| {
        costs.entry(name.into()).or_default().insert(tree, cost);
    };
    for run in &rows.runs {
        let tree = (run.scene.as_str(), run.method.as_str(), run.repetition);
        add(OF_AREA, tree, run.goldsmith_salmon);
        add("cost_over_root_area", tree, run.cost_over_root_area);
        add("sah", tree, run.sah);
    }
    for row in &rows.visits {
        let tree = (row.scene.as_str(), row.method.as_str(), row.repetition);
        add(&format!("{OF_AREA}_{}", row.rays), tree, row.goldsmith_salmon);
    }
    costs
}

/// The tests per ray in all trees, by the family and query of random rays, which traverse the binary
/// tree, or by the kind and camera of all other rays, which traverse the wide layout.
fn ray_tests(rows: &Rows) -> IndexMap<(&str, &str), Vec<(Tree<'_>, f64)>> {
    let mut tests: IndexMap<_, Vec<(Tree, f64)>> = IndexMap::new();
    for row in &rows.rays {
        let tree = (row.scene.as_str(), row.method.as_str(), row.repetition);
        let kind = (row.family.as_str(), row.query.as_str());
        tests.entry(kind).or_default().push((tree, row.boxes_per_ray));
    }
    for row in &rows.run_tests {
        let tree = (row.scene.as_str(), row.method.as_str(), row.repetition);
        let kind = (row.judged_on.as_str(), row.camera.as_str());
        tests.entry(kind).or_default().push((tree, row.tests));
    }
    tests
}

pub(super) fn write(config: &Config, rows: &Rows) -> Result<Output, Error> {
    let mut correlations = Vec::new();
    let costs = costs(rows);
    let tests = ray_tests(rows);
    for scene in rows.scenes() {
        for (&(family, query), tests) in &tests {
            for method in &config.methods {
                let is_own =
                    |(tree, _): &&(Tree, f64)| (tree.0, tree.1) == (scene, method.as_str());
                for (cost, of_trees) in &costs {
                    let own = tests.iter().filter(is_own);
                    let pairs: Vec<_> = own
                        .filter_map(|(tree, tests)| Some((*of_trees.get(tree)?, *tests)))
                        .collect();
                    let pearson = pearson(&pairs);
                    let interval = pearson.and_then(|r| pearson_interval(r, pairs.len()));
                    let (pearson_low, pearson_high) = interval.unzip();
                    correlations.push(Correlation {
                        scene,
                        method,
                        cost,
                        family,
                        query,
                        trees: pairs.len(),
                        pearson,
                        pearson_low,
                        pearson_high,
                        spearman: spearman(&pairs),
                    });
                }
            }
        }
    }
    let mut output = Output::default();
    output.add_csv("correlation", &correlations)?;
    output.paper = config.compare(rows, &correlations);
    Ok(output)
}

impl Config {
    /// Compares the paper's words with the correlation of its cost and its rays over the trees of
    /// its case, scene by scene.
    fn compare(&self, rows: &Rows, correlations: &[Correlation]) -> Vec<PaperRow> {
        let Some(says) = &self.paper_says else { return Vec::new() };
        let is_of_paper = |row: &&Correlation| {
            row.method == self.methods[0]
                && row.cost == OF_AREA
                && (row.family, row.query) == OF_PAPER
        };
        let compare = |row: &Correlation| {
            let pearson = row.pearson?;
            let low = row.pearson_low?;
            let high = row.pearson_high?;
            let verdict = if low >= self.paper_from {
                Verdict::Agrees
            } else if high < self.paper_from {
                Verdict::Differs
            } else {
                Verdict::Inconclusive
            };
            let quantity = "Pearson's correlation of cost and tests per ray over insertion orders";
            let compared = PaperRow::new(rows.shown(row.scene), quantity);
            let rule = format!(
                "its 95 % interval lies from {} on; it differs if the interval lies below",
                self.paper_from
            );
            let compared = compared.compare(says, format!("{pearson:.2}"), verdict, rule);
            Some(PaperRow { ours_low: Some(low), ours_high: Some(high), ..compared })
        };
        correlations.iter().filter(is_of_paper).filter_map(compare).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::rows::{RayRow, RunRow};

    /// Rows of two methods, whose costs predict nothing within either, though the second is dearer
    /// and takes more tests.
    fn two_families() -> Rows {
        let mut rows = Rows::default();
        for (method, level) in [("orders", 1.0), ("splits", 100.0)] {
            for (repetition, (cost, tests)) in
                (0..).zip([(1.0, 2.0), (2.0, 1.0), (3.0, 1.0), (4.0, 2.0)])
            {
                let goldsmith_salmon = level + cost;
                rows.runs.push(RunRow { goldsmith_salmon, ..run(method, repetition, 1, 0) });
                rows.rays.push(RayRow {
                    scene: "s".into(),
                    method: method.into(),
                    repetition,
                    family: OF_PAPER.0.into(),
                    query: OF_PAPER.1.into(),
                    boxes_per_ray: level + tests,
                    ..RayRow::default()
                });
            }
        }
        rows
    }

    /// Makes the report of both methods, of which the paper's case is the first.
    fn output() -> Output {
        let config = Config {
            methods: vec!["orders".into(), "splits".into()],
            paper_says: Some("very strong".into()),
            ..Config::default()
        };
        write(&config, &two_families()).unwrap()
    }

    #[test]
    fn trees_of_different_methods_are_never_ranked_together() {
        let output = output();
        let rows = output.table().unwrap();
        let own = rows.iter().filter(|row| row["cost"] == OF_AREA);
        let own: Vec<(&str, f64)> =
            own.map(|row| (row["method"].as_str(), row["spearman"].parse().unwrap())).collect();
        assert_eq!(own, [("orders", 0.0), ("splits", 0.0)]);
    }

    #[test]
    fn the_papers_words_hold_only_by_the_trees_of_its_own_case() {
        let [row] = &output().paper[..] else { panic!("one scene, one row") };
        assert_eq!((row.ours.as_str(), row.verdict), ("0.00", Verdict::Inconclusive));
    }
}
