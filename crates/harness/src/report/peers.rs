//! Other libraries beside ours: build time, cost by our module, speed by their fastest layout, disagreements.

use super::metric::Metric;
use super::prelude::*;

bvh_config::config! { serde;
    /// A comparison with other libraries.
    pub struct Config {
        /// What it belongs to.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Label of the method whose fastest layout is 1.
        ours: String;
    }
}

/// A method on a scene with rays of one kind, as written to `timing_peers.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Comparison<'a> {
    scene: &'a str,
    method: &'a str,
    rays: &'a str,
    /// The fastest repetition.
    build_seconds: f64,
    cost_over_base: f64,
    /// The method's fastest layout for these rays.
    layout: &'a str,
    mrays_per_second: f64,
    /// Our speed over this method's.
    ours_over_this: f64,
    /// Number of rays.
    rays_traced: u64,
    missed_hits: u64,
    false_hits: u64,
    other_hits: u64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let kinds = rows.traced_kinds();
        let mut comparisons = Vec::new();
        for scene in rows.scenes() {
            for method in &self.methods {
                comparisons.extend(
                    kinds
                        .iter()
                        .filter_map(|kind| self.compare(rows, scene, method, kind)),
                );
            }
        }
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("timing_peers", &comparisons)?;
        let columns = "scene method build_seconds cost_over_base rays layout mrays_per_second ours_over_this \
                       missed_hits false_hits other_hits";
        output.show(
            "Each method by its fastest layout, ray by ray on one thread:",
            &comparisons,
            columns,
        )?;
        output.reading = self.reading(&comparisons);
        Ok(output)
    }

    fn compare<'a>(
        &self,
        rows: &'a Rows,
        scene: &'a str,
        method: &'a str,
        kind: &'a str,
    ) -> Option<Comparison<'a>> {
        let (layout, ns) = rows.fastest_layout(scene, method, kind)?;
        let (_, our_ns) = rows.fastest_layout(scene, &self.ours, kind)?;
        let trace = rows.traces.iter().find(|row| {
            row.scene == scene && row.method == method && row.layout == layout && row.rays == kind
        })?;
        Some(Comparison {
            scene,
            method,
            rays: kind,
            build_seconds: rows.build_seconds(scene, method)?,
            cost_over_base: Metric::CostOverBase.of_run(rows.runs_of(scene, method).next()?)?,
            layout,
            mrays_per_second: 1e3 / ns,
            ours_over_this: ns / our_ns,
            rays_traced: trace.count,
            missed_hits: trace.missed_hits,
            false_hits: trace.false_hits,
            other_hits: trace.other_hits,
        })
    }

    /// In how many comparisons ours is the faster one.
    fn reading(&self, comparisons: &[Comparison]) -> String {
        let others = self
            .methods
            .iter()
            .filter(|method| **method != self.ours);
        let own = |method: &String| -> Vec<&Comparison> {
            comparisons
                .iter()
                .filter(|row| row.method == *method)
                .collect()
        };
        let total = others
            .clone()
            .map(|method| own(method).len())
            .max()
            .unwrap_or(0);
        let faster = |method| {
            own(method)
                .iter()
                .filter(|row| row.ours_over_this > 1.0)
                .count()
        };
        let counts =
            tally(others.map(|method| (method.as_str(), faster(method))), total, "settings");
        format!(
            "Ours, ‘{}’, each by its fastest layout, traces more rays ray by ray per second than {counts}.",
            self.ours
        )
    }
}
