//! Whether one method really differs from others: paired across scenes, and run against run within
//! each.

use super::prelude::*;
use crate::statistics::median;
use crate::statistics::rank::{
    Test, a12, holm, least_rank_sum, least_signed_rank, mann_whitney, wilcoxon_signed_rank,
};
use std::ops::Bound::Excluded;

bvh_config::config! { serde;
    /// A comparison of one method's final costs with those of others.
    pub struct Config {
        /// Heading.
        title: String;
        /// Label of the method that is compared.
        method: String;
        /// Labels of the others.
        against: Vec<String>, in OneOrMore;
        /// Corrected p-values below this are called different.
        level: f64 = 0.05, in (Excluded(0.0), Excluded(1.0));
    }
}

/// One comparison, as written to `significance.csv`. Holm's correction is over all rows of the same
/// test.
#[derive(Serialize, JsonSchema)]
pub(super) struct Row<'a> {
    /// `all` for the comparison across scenes.
    scene: &'a str,
    method: &'a str,
    /// Label of the other method.
    against: &'a str,
    /// Of the medians paired by scene, or of the runs on one scene:
    test: RankTest,
    /// Scenes, or runs of the method.
    samples: usize,
    /// Of the other.
    samples_against: usize,
    /// W⁺ or U.
    statistic: f64,
    /// Of the test alone.
    p_value: f64,
    /// The corrected p-value if every test came out as clearly as its samples allow.
    least_holm_p_value: f64,
    /// The corrected p-value.
    holm_p_value: f64,
    /// How likely a run of the method ends below one of the other, ties counting a half; across
    /// scenes, its mean over them.
    a12: f64,
    /// The method's median work over the other's, the median over scenes: budgets may differ.
    work_ratio: Option<f64>,
    /// How the method's cost compares with the other's:
    verdict: Difference,
}

/// In the place of the scene in rows across all scenes.
const ALL: &str = "all";

/// Which test a row is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
enum RankTest {
    /// Of the medians over base, paired by scene.
    #[serde(rename = "Wilcoxon signed-rank")]
    Wilcoxon,
    /// Of the runs on one scene.
    #[serde(rename = "Mann–Whitney")]
    MannWhitney,
}

/// How the method's cost compares with the other's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Difference {
    /// The corrected p-value is below the level, and the method's cost is lower.
    Lower,
    /// The corrected p-value is below the level, and the method's cost is higher.
    Higher,
    /// The corrected p-value is not below the level.
    #[serde(rename = "not different")]
    None,
    /// No result could have been below the level: there are too few samples for so many
    /// comparisons.
    #[serde(rename = "inconclusive")]
    Inconclusive,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let across = self
            .against
            .iter()
            .filter_map(|against| self.across(rows, against))
            .collect();
        let scenes = rows.scenes();
        let within = scenes.iter().flat_map(|scene| {
            self.against
                .iter()
                .filter_map(move |against| self.within(rows, scene, against))
        });
        let mut table = self.judged(across);
        // Too few runs for so many comparisons could tell nothing, whatever they found.
        let within = self.judged(within.collect()).into_iter();
        table.extend(within.filter(|row| row.least_holm_p_value < self.level));
        let mut output = Output::new("", &self.title);
        output.add_csv("significance", &table)?;
        let explanation = format!(
            "Cost of '{}' against that of others, p-values by Holm's correction, and work:",
            self.method
        );
        let columns = "scene against test p_value holm_p_value a12 work_ratio verdict";
        output.show(&explanation, &table, columns)?;
        output.reading = self.reading(&table);
        Ok(output)
    }

    /// The signed-rank test of the medians on all scenes.
    fn across<'a>(&'a self, rows: &'a Rows, against: &'a str) -> Option<Row<'a>> {
        let mut differences = Vec::new();
        let mut effects = Vec::new();
        for scene in rows.scenes() {
            let [own, other] =
                [&self.method, against].map(|method| rows.final_ratios(scene, method));
            differences.extend(
                median(&own)
                    .zip(median(&other))
                    .map(|(own, other)| own - other),
            );
            effects.extend(a12(&other, &own));
        }
        let samples = differences.len();
        // Scenes on which both cost the same say nothing; if there are no others, nothing differs.
        let test =
            wilcoxon_signed_rank(&differences).unwrap_or(Test { statistic: 0.0, p_value: 1.0 });
        let others = differences
            .iter()
            .filter(|difference| **difference != 0.0)
            .count() as f64;
        let lower = test.statistic < others * (others + 1.0) / 4.0;
        let row = self.row(ALL, against, [samples; 2], &test);
        let a12 = effects.iter().sum::<f64>() / samples as f64;
        let work_ratio = median(
            &rows
                .scenes()
                .iter()
                .filter_map(|scene| self.work_ratio(rows, scene, against))
                .collect::<Vec<_>>(),
        );
        let verdict = Difference::of(lower);
        (samples > 0).then_some(Row { test: RankTest::Wilcoxon, a12, work_ratio, verdict, ..row })
    }

    /// The test of the runs on one scene; `None` if either method has only one, which says nothing
    /// about others.
    fn within<'a>(&'a self, rows: &'a Rows, scene: &'a str, against: &'a str) -> Option<Row<'a>> {
        let [own, other] = [&self.method, against].map(|method| rows.final_ratios(scene, method));
        let test = mann_whitney(&own, &other)?;
        let a12 = a12(&other, &own)?;
        let row = self.row(scene, against, [own.len(), other.len()], &test);
        let several = own.len() > 1 && other.len() > 1;
        let work_ratio = self.work_ratio(rows, scene, against);
        several.then_some(Row { a12, work_ratio, verdict: Difference::of(a12 > 0.5), ..row })
    }

    /// The method's median work on a scene over the other's.
    fn work_ratio(&self, rows: &Rows, scene: &str, against: &str) -> Option<f64> {
        let work = |method: &str| {
            let work: Vec<f64> = rows
                .runs_of(scene, method)
                .map(|run| run.work as f64)
                .collect();
            median(&work).filter(|&work| work > 0.0)
        };
        Some(work(&self.method)? / work(against)?)
    }

    fn row<'a>(
        &'a self,
        scene: &'a str,
        against: &'a str,
        [samples, samples_against]: [usize; 2],
        &Test { statistic, p_value }: &Test,
    ) -> Row<'a> {
        Row {
            scene,
            method: &self.method,
            against,
            test: RankTest::MannWhitney,
            samples,
            samples_against,
            // Minus zero is zero.
            statistic: statistic + 0.0,
            p_value,
            least_holm_p_value: 1.0,
            holm_p_value: 1.0,
            a12: 0.5,
            work_ratio: None,
            verdict: Difference::None,
        }
    }

    /// The rows of one test with their p-values corrected.
    fn judged<'a>(&self, mut table: Vec<Row<'a>>) -> Vec<Row<'a>> {
        let corrected =
            |p_value: fn(&Row) -> f64| holm(&table.iter().map(p_value).collect::<Vec<_>>());
        // If every test came out as clearly as it can.
        let least = corrected(|row| match row.test {
            RankTest::Wilcoxon => least_signed_rank(row.samples),
            RankTest::MannWhitney => least_rank_sum(row.samples, row.samples_against),
        });
        let found = corrected(|row| row.p_value);
        for (row, (least, found)) in table.iter_mut().zip(least.into_iter().zip(found)) {
            (row.least_holm_p_value, row.holm_p_value) = (least, found);
            if found >= self.level {
                let possible = least < self.level;
                row.verdict = if possible { Difference::None } else { Difference::Inconclusive };
            }
        }
        table
    }

    fn reading(&self, table: &[Row]) -> String {
        let of = |against: &String| {
            let own = || table.iter().filter(|row| row.against == against);
            let across = own().find(|row| row.scene == ALL);
            let verdict = across.map_or("untested", |row| row.verdict.name());
            let work = across.and_then(|row| row.work_ratio);
            let work =
                work.map_or_else(String::new, |ratio| format!(", with {ratio:.1} times its work"));
            let within: Vec<&Row> = own().filter(|row| row.scene != ALL).collect();
            let count = |verdict| {
                within
                    .iter()
                    .filter(|row| row.verdict == verdict)
                    .count()
            };
            let lower = count(Difference::Lower);
            let higher = count(Difference::Higher);
            let within = match within.len() {
                0 => "too few runs to compare within scenes".into(),
                scenes => format!("lower on {lower} and higher on {higher} of {scenes} scenes"),
            };
            format!("{against}: {verdict} across scenes{work}; {within}")
        };
        let all: Vec<String> = self.against.iter().map(of).collect();
        let method = &self.method;
        let level = self.level;
        let all = all.join("; against ");
        format!("Costs of {method} after Holm's correction at {level}, against {all}.")
    }
}

impl Difference {
    fn of(lower: bool) -> Self {
        if lower { Self::Lower } else { Self::Higher }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Lower => "lower",
            Self::Higher => "higher",
            Self::None => "not different",
            Self::Inconclusive => "not told by so few",
        }
    }
}
