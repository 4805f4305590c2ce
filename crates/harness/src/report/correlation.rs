//! Correlations of costs with the tests of rays, over the trees that one method builds on one
//! scene.
//!
//! Trees of different methods are never pooled: a ranking of binary and n-ary trees together mostly
//! separates the two kinds (Simpson 1951).

use super::data::distinct;
use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::rows::{RunRow, VisitRow};
use crate::statistics::{pearson, pearson_interval, spearman};
use bvh_config::above;

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

/// A tree by its run, and the tests per ray of one kind in it.
struct Tree<'a> {
    run: &'a RunRow,
    /// Family and query of random rays, or kind of rays and camera.
    kind: (&'a str, &'a str),
    tests: f64,
}

/// All trees through which rays were sent. Random rays traverse the binary tree, all other rays the
/// wide layout.
fn trees(rows: &Rows) -> Vec<Tree<'_>> {
    let tree = |scene: &str, method: &str, repetition: u32, kind, tests| {
        let run = rows.runs_of(scene, method).find(|run| run.repetition == repetition)?;
        Some(Tree { run, kind, tests })
    };
    let random = rows.rays.iter().filter_map(|row| {
        let kind = (row.family.as_str(), row.query.as_str());
        tree(&row.scene, &row.method, row.repetition, kind, row.boxes_per_ray)
    });
    let of_layouts = rows.run_tests.iter().filter_map(|row| {
        let kind = (row.judged_on.as_str(), row.camera.as_str());
        tree(&row.scene, &row.method, row.repetition, kind, row.tests)
    });
    random.chain(of_layouts).collect()
}

/// The names of the costs by area, and of one cost by the density of each kind of rays.
fn costs(rows: &Rows) -> Vec<String> {
    let rays = distinct(rows.visits.iter().map(|row| &row.rays));
    let of_rays = rays.into_iter().map(|rays| format!("{OF_AREA}_{rays}"));
    let of_area = [OF_AREA, "cost_over_root_area", "sah"].map(str::to_owned);
    of_area.into_iter().chain(of_rays).collect()
}

/// The cost of this name of a run's tree.
fn cost_of(rows: &Rows, cost: &str, run: &RunRow) -> Option<f64> {
    match cost {
        OF_AREA => Some(run.goldsmith_salmon),
        "cost_over_root_area" => Some(run.cost_over_root_area),
        "sah" => Some(run.sah),
        of_rays => {
            let rays = of_rays.strip_prefix(OF_AREA)?.strip_prefix('_')?;
            let tree = (&run.scene, &run.method, run.repetition, rays);
            let of_tree =
                |row: &&VisitRow| (&row.scene, &row.method, row.repetition, &*row.rays) == tree;
            Some(rows.visits.iter().find(of_tree)?.goldsmith_salmon)
        }
    }
}

pub(super) fn write(config: &Config, rows: &Rows) -> Result<Output, Error> {
    let mut correlations = Vec::new();
    let costs = costs(rows);
    let trees = trees(rows);
    let kinds = distinct(trees.iter().map(|tree| tree.kind));
    for scene in rows.scenes() {
        for &kind in &kinds {
            for method in &config.methods {
                let is_own = |tree: &&Tree| {
                    (tree.run.scene.as_str(), &tree.run.method, tree.kind) == (scene, method, kind)
                };
                let own: Vec<&Tree> = trees.iter().filter(is_own).collect();
                for cost in &costs {
                    let pair = |tree: &&Tree| Some((cost_of(rows, cost, tree.run)?, tree.tests));
                    let pairs: Vec<_> = own.iter().filter_map(pair).collect();
                    correlations.push(correlate(scene, method, kind, cost, &pairs));
                }
            }
        }
    }
    let mut output = Output::default();
    output.add_csv("correlation", &correlations)?;
    output.paper = config.compare(rows, &correlations);
    let columns = "scene method trees cost family query pearson spearman";
    output.show(
        "Correlation of costs and tests per ray over the trees of each method:",
        &correlations,
        columns,
    )?;
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

fn correlate<'a>(
    scene: &'a str,
    method: &'a str,
    (family, query): (&'a str, &'a str),
    cost: &'a str,
    pairs: &[(f64, f64)],
) -> Correlation<'a> {
    let (pearson, trees) = (pearson(pairs), pairs.len());
    let interval = pearson.and_then(|pearson| pearson_interval(pearson, trees));
    let (pearson_low, pearson_high) = interval.unzip();
    let spearman = spearman(pairs);
    Correlation {
        scene,
        method,
        cost,
        family,
        query,
        trees,
        pearson,
        pearson_low,
        pearson_high,
        spearman,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::rows::RayRow;

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
