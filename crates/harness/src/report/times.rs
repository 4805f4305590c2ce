//! Times of methods against each other, pair by pair, in the same run.

use super::config::{first, one_for_each};
use super::paper::Verdict;
use super::prelude::*;
use crate::statistics::{median, median_interval, range};
use bvh_config::OutOfRange;
use bvh_config::above;
use std::collections::BTreeMap;

bvh_config::config! { serde;
    /// A comparison of times.
    pub struct Config {
        /// Where the paper has it.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods; ratios are to the first.
        methods: Vec<String>, in OneOrMore;
        /// Labels under which the same methods run a second time, one for each of `methods`. The seconds of both runs are added. In a
        /// spec that lists the second runs in reverse order, no method gains by its place.
        again: Vec<String>;
        /// The paper's seconds by scene, in the order of `methods`.
        paper: BTreeMap<String, Vec<f64>>, in above(0.0);
    }
    check Self::check_lengths;
}

/// One comparison, as written to `timing_times.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Ratio<'a> {
    scene: &'a str,
    method: &'a str,
    /// Number of repetitions.
    repetitions: usize,
    /// The median wall time.
    median_seconds: f64,
    /// Lower end of the interval of the median ratio to the first method, repetition by repetition: two order statistics, between which
    /// the median lies with a probability of at least 95 %.
    ratio_low: f64,
    /// The median.
    ratio_median: f64,
    /// The upper end.
    ratio_high: f64,
    /// Median ratio of the first method's second run to its first run: noise alone. Empty if there is no second run.
    noise: Option<f64>,
    /// The paper's ratio, where it has one.
    paper_ratio: Option<f64>,
    /// How the interval compares with the paper's ratio:
    verdict: Verdict,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let methods = self.methods.iter().enumerate();
        let ratios: Vec<Ratio> = methods
            .flat_map(|(index, method)| {
                scenes
                    .iter()
                    .map(move |scene| self.compare(rows, scene, index, method))
            })
            .collect();
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("timing_times", &ratios)?;
        let caption = "Median of the ratios repetition by repetition, whiskers its 95 % interval.";
        output.add_figure("timing_times", caption, 1, vec![self.draw(rows, &ratios)]);
        let explanation =
            format!("Time over that of '{}', median and its 95 % interval:", first(&self.methods));
        let columns = "scene method median_seconds ratio_low ratio_median ratio_high noise paper_ratio verdict";
        output.show(&explanation, &ratios, columns)?;
        output.reading = self.reading(&ratios);
        Ok(output)
    }

    fn check_lengths(&self) -> Vec<OutOfRange> {
        let mut faults = one_for_each(&self.paper, &self.methods);
        if !self.again.is_empty() && self.again.len() != self.methods.len() {
            let found = format!("a list of {} labels", self.again.len());
            let accepted = format!("none, or {}, one for each of methods", self.methods.len());
            faults.push(OutOfRange::new("again", found, accepted));
        }
        faults
    }

    /// The seconds of a method by repetition, of both runs where there are two.
    fn seconds(&self, rows: &Rows, scene: &str, index: usize) -> Vec<f64> {
        let seconds = rows.seconds_of(scene, &self.methods[index]);
        let Some(again) = self.again.get(index) else { return seconds };
        let second = rows.seconds_of(scene, again);
        seconds
            .iter()
            .zip(&second)
            .map(|(first, second)| first + second)
            .collect()
    }

    fn compare<'a>(&self, rows: &Rows, scene: &'a str, index: usize, method: &'a str) -> Ratio<'a> {
        let base = self.seconds(rows, scene, 0);
        let own = self.seconds(rows, scene, index);
        let pairs: Vec<f64> = own
            .iter()
            .zip(&base)
            .map(|(own, base)| own / base)
            .collect();
        let (ratio_low, ratio_high) = median_interval(&pairs).unwrap_or((f64::NAN, f64::NAN));
        let paper = self.paper.get(scene);
        let paper_ratio = paper
            .and_then(|paper| Some(paper.get(index)? / paper.first()?))
            .filter(|_| index > 0);
        Ratio {
            scene,
            method,
            repetitions: own.len(),
            median_seconds: median(&own).unwrap_or(f64::NAN),
            ratio_low,
            ratio_median: median(&pairs).unwrap_or(f64::NAN),
            ratio_high,
            noise: self.again.first().and_then(|again| {
                let firsts = rows.seconds_of(scene, first(&self.methods));
                let seconds = rows.seconds_of(scene, again);
                let ratios: Vec<f64> = seconds
                    .iter()
                    .zip(&firsts)
                    .map(|(second, first)| second / first)
                    .collect();
                median(&ratios)
            }),
            paper_ratio,
            verdict: verdict(paper_ratio, ratio_low, ratio_high),
        }
    }

    /// Whether each method is faster, slower, or not to be told from the first by the interval, scene by scene.
    fn reading(&self, ratios: &[Ratio]) -> String {
        let first = first(&self.methods);
        let of = |method: &String| {
            let own: Vec<&Ratio> = ratios
                .iter()
                .filter(|ratio| ratio.method == method)
                .collect();
            let (low, high) = range(own.iter().map(|ratio| ratio.ratio_median))?;
            let faster = own
                .iter()
                .filter(|ratio| ratio.ratio_high < 1.0)
                .count();
            let slower = own
                .iter()
                .filter(|ratio| ratio.ratio_low > 1.0)
                .count();
            let scenes = own.len();
            let sides = match (faster, slower) {
                (0, 0) => format!("within noise on all {scenes} scenes"),
                _ => format!(
                    "faster on {faster}, slower on {slower} and within noise on {} of {scenes} scenes",
                    scenes - faster - slower
                ),
            };
            Some(format!(
                "'{method}' is {sides}: it takes {low:.3} to {high:.3} times as long as '{first}', median by scene"
            ))
        };
        self.methods
            .iter()
            .skip(1)
            .filter_map(of)
            .collect::<Vec<_>>()
            .join("; ")
            + "."
    }

    fn draw(&self, rows: &Rows, ratios: &[Ratio]) -> Panel {
        let mut layers = Vec::new();
        for method in self.methods.iter().skip(1) {
            let own: Vec<_> = ratios
                .iter()
                .filter(|ratio| ratio.method == method)
                .collect();
            let values = own
                .iter()
                .map(|ratio| ratio.ratio_median)
                .collect();
            let spread = own
                .iter()
                .map(|ratio| (ratio.ratio_low, ratio.ratio_high))
                .collect();
            layers.push(Layer::new(method, Marks::Bars { values, spread, base: 1.0 }));
            let paper = own
                .iter()
                .enumerate()
                .filter_map(|(at, ratio)| Some((at as f64, ratio.paper_ratio?)));
            layers.push(Layer::new(format!("{method}, paper"), Marks::Points(paper.collect())));
        }
        let first = first(&self.methods);
        layers.push(Layer::new(first, Marks::HLine(1.0)));
        let y = Axis::linear(format!("time / time of '{first}'"));
        panel("", Axis::categories("", rows.all_shown()), y, layers)
    }
}

/// Ratios of times within this distance of the paper's agree with it: its seconds have three or four digits.
const TOLERANCE: f64 = 0.01;

/// Compares the interval with the paper's ratio: agrees if all of it is close to the paper's, differs if none of it is.
fn verdict(paper: Option<f64>, low: f64, high: f64) -> Verdict {
    let Some(paper) = paper else { return Verdict::NotInPaper };
    let least = paper * (1.0 - TOLERANCE);
    let most = paper * (1.0 + TOLERANCE);
    if least <= low && high <= most {
        Verdict::Agrees
    } else if high < least || most < low {
        Verdict::Differs
    } else {
        Verdict::CannotBeTold
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::rows::TimingRow;

    /// Rows of the methods, each with its seconds by repetition.
    fn rows(methods: &[(&str, Vec<f64>)]) -> Rows {
        let mut rows = Rows::default();
        for (method, seconds) in methods {
            for (repetition, &seconds) in (0..).zip(seconds) {
                rows.runs.push(run(method, repetition, 1, 0));
                let scene = "s".to_owned();
                let method = (*method).to_owned();
                rows.timing.push(TimingRow {
                    scene,
                    method,
                    seed: 0,
                    repetition,
                    threads: 1,
                    seconds,
                });
            }
        }
        rows
    }

    /// The seconds of ten repetitions, each a little different.
    fn around(seconds: f64) -> Vec<f64> {
        (0..10)
            .map(|index| seconds * (1.0 + 0.001 * f64::from(index)))
            .collect()
    }

    #[test]
    fn a_method_that_only_runs_first_and_cold_is_not_slower() {
        let config = Config {
            methods: vec!["without".into(), "with".into()],
            again: vec!["without again".into(), "with again".into()],
            ..Config::default()
        };
        // The first run of every repetition takes a quarter longer, whatever it runs.
        let timed = [
            ("without", around(1.25)),
            ("with", around(1.0)),
            ("with again", around(1.25)),
            ("without again", around(1.0)),
        ];
        let said = config.write(&rows(&timed)).unwrap().reading;
        assert!(said.contains("within noise on all 1 scenes"), "{said}");
        let alone = Config { again: vec![], ..config };
        assert!(
            alone
                .write(&rows(&timed))
                .unwrap()
                .reading
                .contains("faster on 1")
        );
    }

    #[test]
    fn a_ratio_agrees_with_the_papers_only_by_its_whole_interval() {
        assert_eq!(verdict(Some(0.98), 0.975, 0.985), Verdict::Agrees);
        assert_eq!(verdict(Some(0.98), 0.975, 1.01), Verdict::CannotBeTold);
        assert_eq!(verdict(Some(0.98), 1.0, 1.01), Verdict::Differs);
        assert_eq!(verdict(None, 1.0, 1.01), Verdict::NotInPaper);
    }
}
