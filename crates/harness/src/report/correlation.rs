//! Correlations of costs with the tests of rays, over the trees that one method builds on one
//! scene.
//!
//! Trees of different methods are never pooled: a ranking of binary and n-ary trees together mostly
//! separates the two kinds (Simpson 1951).

use super::data::distinct;
use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::rows::{RunRow, RunTestRow, VisitRow};
use crate::statistics::{pearson, pearson_interval, spearman};
use bvh_config::above;

bvh_config::config! { serde;
    /// Costs against tests per ray.
    pub struct Config {
        /// Section or topic of the report.
        source: String;
        /// Heading.
        title: String;
        /// What the rows say, the title of the figure, as in a report of the kind `query`.
        finding: String;
        /// Labels of the methods, the paper's own case first. Trees of each method are compared
        /// with each other only.
        methods: Vec<String>, in OneOrMore;
        /// The paper's words on the correlation over the trees of the first method.
        #[serde(skip_serializing_if = "Option::is_none")]
        paper_says: Option<String>;
        /// Least value of Pearson's correlation for which these words hold.
        paper_from: f64 = 0.9, in above(0.0);
        /// Reason for differences from the paper.
        reason: String;
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

/// A tree, and the tests per ray of one kind in it.
type Tree<'a> = (&'a RunRow, f64);

/// A cost: name in the table, and function of the tree of a run.
type Cost<'a> = (String, Box<dyn Fn(&RunRow) -> Option<f64> + 'a>);

/// Returns the costs by area, and one cost by the density of each kind of rays.
fn costs(rows: &Rows) -> Vec<Cost<'_>> {
    let of_area: [Cost; 3] = [
        (OF_AREA.into(), Box::new(|run| Some(run.goldsmith_salmon))),
        ("cost_over_root_area".into(), Box::new(|run| Some(run.cost_over_root_area))),
        ("sah".into(), Box::new(|run| Some(run.sah))),
    ];
    let of_rays = |rays| -> Cost {
        let own = move |run: &RunRow, row: &VisitRow| {
            (&row.scene, &row.method, row.repetition) == (&run.scene, &run.method, run.repetition)
                && row.rays == rays
        };
        let of = move |run: &RunRow| {
            Some(rows.visits.iter().find(|row| own(run, row))?.goldsmith_salmon)
        };
        (format!("goldsmith_salmon_{rays}"), Box::new(of))
    };
    let rays = distinct(rows.visits.iter().map(|row| row.rays.as_str()));
    of_area.into_iter().chain(rays.into_iter().map(of_rays)).collect()
}

pub(super) fn write(config: &Config, rows: &Rows) -> Result<Output, Error> {
    let mut correlations = Vec::new();
    let mut panels = Vec::new();
    let costs = costs(rows);
    let of_layouts =
        distinct(rows.run_tests.iter().map(|row| (row.judged_on.as_str(), row.camera.as_str())));
    let random = rows.ray_kinds().len();
    for scene in rows.scenes() {
        for (number, kind) in rows.ray_kinds().into_iter().chain(of_layouts.clone()).enumerate() {
            let start = correlations.len();
            let mut drawn = Vec::new();
            for method in &config.methods {
                let trees = trees(rows, scene, method, kind);
                correlations
                    .extend(costs.iter().map(|cost| correlate(scene, method, kind, cost, &trees)));
                drawn.push((method.as_str(), trees));
            }
            // Only random rays are drawn; kinds of rays through layouts would make too many panels.
            if number < random {
                panels.push(draw(&rows.shown(scene), kind, &drawn, correlations[start].spearman));
            }
        }
    }
    let mut output = Output::new(&config.source, &config.title);
    output.add_csv("correlation", &correlations)?;
    output.say(&config.finding, rows)?;
    let caption = format!(
        "One point per tree, the same rays for all trees of a scene. ρ is Spearman's rank correlation over the trees of ‘{}’.",
        config.case()
    );
    output.add_figure("correlation", caption, random, panels);
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
    /// The label of the paper's own case.
    fn case(&self) -> &str {
        self.methods.first().map_or("", String::as_str)
    }

    /// Compares the paper's words with the correlation of its cost and its rays over the trees of
    /// its case, scene by scene.
    fn compare(&self, rows: &Rows, correlations: &[Correlation]) -> Vec<PaperRow> {
        let Some(says) = &self.paper_says else { return Vec::new() };
        let is_of_paper = |row: &&Correlation| {
            row.method == self.case() && row.cost == OF_AREA && (row.family, row.query) == OF_PAPER
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
            let compared =
                PaperRow::new(&self.source, rows.shown(row.scene), quantity, &self.reason);
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

/// Returns the method's trees through which rays of the kind were sent. Random rays traverse the
/// binary tree, all other rays the wide layout.
fn trees<'a>(rows: &'a Rows, scene: &str, method: &str, kind: (&str, &str)) -> Vec<Tree<'a>> {
    let random = rows
        .rays_of(scene, method, kind)
        .into_iter()
        .map(|row| (row.repetition, row.boxes_per_ray));
    let own = |row: &&RunTestRow| {
        row.scene == scene
            && row.method == method
            && (row.judged_on.as_str(), row.camera.as_str()) == kind
    };
    let of_layouts = rows.run_tests.iter().filter(own).map(|row| (row.repetition, row.tests));
    let run = |repetition| rows.runs_of(scene, method).find(|run| run.repetition == repetition);
    random
        .chain(of_layouts)
        .filter_map(|(repetition, tests)| Some((run(repetition)?, tests)))
        .collect()
}

fn correlate<'a>(
    scene: &'a str,
    method: &'a str,
    (family, query): (&'a str, &'a str),
    (cost, of): &'a Cost,
    trees: &[Tree],
) -> Correlation<'a> {
    let pair = |(run, tests): &Tree| Some((of(run)?, *tests));
    let pairs: Vec<(f64, f64)> = trees.iter().filter_map(pair).collect();
    let pearson = pearson(&pairs);
    let (pearson_low, pearson_high) =
        pearson.and_then(|pearson| pearson_interval(pearson, pairs.len())).unzip();
    let trees = pairs.len();
    let spearman = spearman(&pairs);
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

fn draw(
    scene: &str,
    (family, query): (&str, &str),
    methods: &[(&str, Vec<Tree>)],
    rank: Option<f64>,
) -> Panel {
    let points = |(method, trees): &(&str, Vec<Tree>)| {
        let points = trees.iter().map(|(run, tests)| (run.goldsmith_salmon, *tests));
        Layer::new(*method, Marks::Points(points.collect()))
    };
    let rank = rank.map_or_else(String::new, |rank| format!(", ρ = {rank:.3}"));
    let x = Axis::linear("Goldsmith–Salmon cost");
    let y = Axis::linear("box tests per ray");
    panel(format!("{scene}: {family}, {query}{rank}"), x, y, methods.iter().map(points).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::report::query::Row;
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
                let scene = "s".to_owned();
                let method = method.to_owned();
                let family = OF_PAPER.0.to_owned();
                let query = OF_PAPER.1.to_owned();
                let boxes_per_ray = level + tests;
                rows.rays.push(RayRow {
                    scene,
                    method,
                    repetition,
                    family,
                    query,
                    boxes_per_ray,
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
        let mut reader = csv::Reader::from_reader(&output.csv[0].1[..]);
        let rows: Vec<Row> = reader.deserialize().map(Result::unwrap).collect();
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
