//! What types alone do not say of a spec, part by part. Messages name the key, what was found, what would be accepted.

use super::fault::Fault;
use super::method::Own;
use super::{Contestant, Experiment, Labelled};
use crate::report::Report;
use crate::{scenes::subset, stress};
use bvh_build::{Check, OutOfRange};
use bvh_search::Method;
use std::collections::HashSet;

/// Most runs of an experiment.
const MOST_RUNS: u64 = 10_000_000;

impl Experiment {
    /// Checks everything that types and the ranges of single keys leave open, but methods and the names in reports.
    pub(super) fn check_together(&self) -> Result<(), OutOfRange> {
        if self.question.trim().is_empty() {
            return Err(OutOfRange::new("question", "empty", "what the experiment asks, for its readers"));
        }
        self.check_scenes()?;
        self.check_run_count()
    }

    /// Checks the scenes' names; whether the scenes are there is found when they are loaded.
    fn check_scenes(&self) -> Result<(), OutOfRange> {
        if self.suite.is_some() {
            if let Some(unknown) = self.scenes.iter().find(|id| stress::by_id(id).is_none()) {
                return Err(OutOfRange::new(
                    "scenes",
                    format!("{unknown:?}"),
                    "cases of the suite, S01 to S45",
                ));
            }
        } else if self.scenes.is_empty() {
            return Err(OutOfRange::new("scenes", "empty", "at least one name or path"));
        }
        match self.scenes.iter().find(|name| subset::names(name) == 0) {
            Some(none) => Err(OutOfRange::new("scenes", format!("{none:?}"), "A..B with A up to B")),
            None => Ok(()),
        }
    }

    /// Checks that there are runs, and not too many.
    pub(crate) fn check_run_count(&self) -> Result<(), OutOfRange> {
        let scenes = self.scenes.iter().map(|name| subset::names(name)).fold(0, u64::saturating_add);
        let runs =
            [self.methods.len() as u64, self.repetitions.into()].into_iter().fold(scenes, u64::saturating_mul);
        if runs > MOST_RUNS {
            let product = "the product of the numbers of scenes, methods and repetitions";
            return Err(OutOfRange::new(product, format!("{runs} runs"), format!("up to {MOST_RUNS}")));
        }
        if self.methods.is_empty() {
            return Err(OutOfRange::new("methods", "empty", "at least one table with a `method`"));
        }
        Ok(())
    }

    /// What is wrong with methods, one fault each: labels that are not unique, and parameters.
    pub(super) fn check_methods(&self) -> Vec<Fault> {
        let mut labels = HashSet::new();
        let check = |(index, labelled): (usize, &Labelled)| {
            let checked = if labels.insert(labelled.label.clone()) {
                self.check_method(labelled)
            } else {
                let found = format!("{:?} for the second time", labelled.label);
                Err(Fault::new("label", found, "unique labels"))
            };
            checked.err().map(|fault| fault.below(&format!("methods[{index}]")))
        };
        self.methods.iter().enumerate().filter_map(check).collect()
    }

    fn check_method(&self, labelled: &Labelled) -> Result<(), Fault> {
        let Labelled { method, own, .. } = labelled;
        let Own { budget, max_seconds, keep, judge, for_rays, objective, references, .. } = own;
        own.check()?;
        let (is_ours, is_best) =
            (matches!(method, Contestant::Ours(_)), matches!(method, Contestant::Ours(Method::Best(_))));
        let judged = Labelled::JUDGED;
        let (ours, with_judged) = ("with a method of ours", format!("with {}", judged.join(", ")));
        let of_some_methods = [
            ("budget", budget.is_some(), is_ours, ours),
            ("max_seconds", max_seconds.is_some(), is_ours, ours),
            ("keep", !keep.is_empty(), is_ours, ours),
            ("objective", objective.is_some(), is_ours, ours),
            ("for_rays", for_rays.is_some(), is_ours, ours),
            ("references", references.is_some(), is_best, "with best"),
            ("judge", judge.is_some(), judged.contains(&method.name()), &with_judged),
        ];
        if let Some((key, .., accepted)) = of_some_methods.iter().find(|(_, set, takes, _)| *set && !takes) {
            return Err(Fault::new(key, format!("set for {}", method.name()), accepted));
        }
        if for_rays.is_some() && self.ray_cost.is_none() {
            return Err(Fault::new("for_rays", "set without `ray_cost`", "with the experiment's `ray_cost`"));
        }
        match method {
            Contestant::Peer(_) | Contestant::External(_) if self.suite.is_some() => {
                let found = format!("{:?}, none of ours", method.name());
                Err(Fault::new(
                    "method",
                    found,
                    "methods of ours; the suite runs the libraries that are compiled in by itself",
                ))
            }
            Contestant::Peer(peer) => match peer.missing_feature() {
                Some(feature) => {
                    let found = format!(
                        "{:?}, another library, which needs `cargo run --release -p harness --features {feature}`",
                        peer.name()
                    );
                    Err(Fault::new("method", found, format!("without it {}", Method::NAMES.join(", "))))
                }
                None => Ok(peer.check()?),
            },
            Contestant::Ours(method) => Ok(method.check()?),
            Contestant::External(program) => Ok(program.check()?),
        }
    }

    /// What is asked for that runs which the clock ends cannot have: everything that is to be the same whenever it is made again.
    pub(super) fn check_clock(&self) -> Vec<Fault> {
        if !self.is_by_the_clock() {
            let alone = self.tinybvh.as_ref().map(|_| {
                Fault::new(
                    "tinybvh",
                    "set without `max_seconds`",
                    "with a budget in seconds, beside which its trees are costed",
                )
            });
            return alone.into_iter().collect();
        }
        let beside = |key: &str| format!("{key} beside `max_seconds`");
        let accepted =
            "none, or a budget of `max_work`: runs of so many seconds have rows in timing_runs.csv alone";
        let repeatable = [
            ("suite", self.suite.is_some()),
            ("lower_bound", self.lower_bound.is_some()),
            ("rays", !self.rays.is_empty()),
            ("render", self.render.is_some()),
            ("tracing", self.tracing.is_some()),
            ("ray_cost", self.ray_cost.is_some()),
            ("reports", !self.reports.is_empty()),
        ];
        let refused = repeatable.iter().filter(|(_, is_set)| *is_set);
        let refused = refused.map(|(key, _)| Fault::new(key, beside("set"), accepted));
        let in_parallel = (!self.sequential).then(|| {
            Fault::new(
                "sequential",
                beside("false"),
                "true: runs at the same time take seconds from each other",
            )
        });
        refused.chain(in_parallel).collect()
    }

    /// The first label in each report that no method has.
    pub(super) fn check_reports(&self) -> Vec<Fault> {
        let known: Vec<&str> = self.methods.iter().map(|method| method.label.as_str()).collect();
        let check = |(index, report): (usize, &Report)| {
            let (key, unknown) = report.labels().into_iter().find(|(_, label)| !known.contains(label))?;
            let found = format!("{unknown:?}, no label of a method");
            Some(Fault::new(format!("reports[{index}].{key}"), found, known.join(", ")))
        };
        self.reports.iter().enumerate().filter_map(check).collect()
    }
}
