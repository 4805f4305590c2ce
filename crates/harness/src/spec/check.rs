//! What types alone do not say of a spec, part by part. Messages name the key, what was found, what would be accepted.

use super::Experiment;
use crate::contestant::{Contestant, Labelled, Own};
use crate::report::Report;
use crate::stress;
use bvh_config::OutOfRange;
use bvh_config::fault::{Fault, is_within};
use bvh_scenes::subset;
use bvh_search::{Budget, Method, best};
use std::collections::HashSet;

/// Most runs of an experiment.
const MOST_RUNS: u64 = 10_000_000;

impl Experiment {
    /// Checks everything that types and the ranges of single keys leave open, but methods and the names in reports.
    pub(super) fn check_together(&self) -> Vec<Fault> {
        let is_unsaid = self.question.trim().is_empty();
        let unsaid = is_unsaid.then(|| {
            OutOfRange::new("question", "empty", "what the experiment asks, for its readers")
        });
        let others = [self.check_scenes().err(), self.check_run_count().err()];
        unsaid
            .into_iter()
            .chain(others.into_iter().flatten())
            .map(Fault::from)
            .collect()
    }

    /// Checks the scenes' names; whether the scenes are there is found when they are loaded.
    fn check_scenes(&self) -> Result<(), OutOfRange> {
        if self.suite.is_some() {
            if let Some(unknown) = self
                .scenes
                .iter()
                .find(|id| stress::by_id(id).is_none())
            {
                return Err(OutOfRange::new(
                    "scenes",
                    format!("{unknown:?}"),
                    "cases of the suite, S01 to S45",
                ));
            }
        } else if self.scenes.is_empty() {
            return Err(OutOfRange::new("scenes", "empty", "at least one name or path"));
        }
        match self
            .scenes
            .iter()
            .find(|name| subset::names(name) == 0)
        {
            Some(none) => {
                Err(OutOfRange::new("scenes", format!("{none:?}"), "A..B with A up to B"))
            }
            None => Ok(()),
        }
    }

    /// Checks that there are runs, and not too many.
    pub(crate) fn check_run_count(&self) -> Result<(), OutOfRange> {
        let scenes = self
            .scenes
            .iter()
            .map(|name| subset::names(name))
            .fold(0, u64::saturating_add);
        let runs = [self.methods.len() as u64, self.repetitions.into()]
            .into_iter()
            .fold(scenes, u64::saturating_mul);
        if runs > MOST_RUNS {
            let product = "the product of the numbers of scenes, methods and repetitions";
            return Err(OutOfRange::new(
                product,
                format!("{runs} runs"),
                format!("up to {MOST_RUNS}"),
            ));
        }
        if self.methods.is_empty() {
            return Err(OutOfRange::new("methods", "empty", "at least one table with a `method`"));
        }
        Ok(())
    }

    /// What is wrong with methods beside the rest of the experiment; they stand at these places in the spec.
    pub(super) fn check_methods(&self, at: &[usize]) -> Vec<Fault> {
        let below = |at: &usize| format!("methods[{at}]");
        let check = |(at, labelled)| {
            self.check_method(labelled)
                .into_iter()
                .map(move |fault| fault.below(&below(at)))
        };
        at.iter()
            .zip(&self.methods)
            .flat_map(check)
            .collect()
    }

    fn check_method(&self, labelled: &Labelled) -> Vec<Fault> {
        let Labelled { method, own, .. } = labelled;
        let Own { budget, max_seconds, keep, judge, for_rays, objective, references, .. } = own;
        let is_ours = matches!(method, Contestant::Ours(_));
        let is_best = matches!(method, Contestant::Ours(Method::Best(_)));
        let judged = Labelled::JUDGED;
        let ours = "with a method of ours";
        let with_judged = format!("with {}", judged.join(", "));
        let sized = "with a method of ours but median_cut, which compares no sizes of boxes";
        let of_some_methods = [
            ("budget", budget.is_some(), is_ours, ours),
            ("max_seconds", max_seconds.is_some(), is_ours, ours),
            ("keep", !keep.is_empty(), is_ours, ours),
            ("objective", objective.is_some(), is_ours, ours),
            ("for_rays", for_rays.is_some(), is_ours && method.name() != "median_cut", sized),
            ("references", references.is_some(), is_best, "with best"),
            ("judge", judge.is_some(), judged.contains(&method.name()), &with_judged),
        ];
        let misplaced = of_some_methods
            .iter()
            .filter(|(_, is_set, takes, _)| *is_set && !takes);
        let set_for = format!("set for {}", method.name());
        let mut faults: Vec<Fault> = misplaced
            .map(|(key, .., accepted)| Fault::new(key, &set_for, accepted))
            .collect();
        if for_rays.is_some() && is_ours && self.ray_cost.is_none() {
            let accepted = "with the experiment's `ray_cost`";
            faults.push(Fault::new("for_rays", "set without `ray_cost`", accepted));
        }
        let layouts = self
            .tracing
            .iter()
            .flat_map(|tracing| &tracing.layouts);
        if for_rays.is_some()
            && layouts
                .into_iter()
                .any(|layout| layout.is_for_lines())
        {
            let found = "set beside `tracing.layouts` with another cost of blocks";
            faults.push(Fault::new("for_rays", found, "with other layouts, which can be for rays"));
        }
        let found = format!("{:?}", method.name());
        if self.suite.is_some() && !is_ours {
            let accepted =
                "methods of ours; the suite runs the libraries that are compiled in by itself";
            faults.push(Fault::new("method", format!("{found}, none of ours"), accepted));
        } else if let Contestant::Peer(peer) = method
            && let Some(feature) = peer.missing_feature()
        {
            let needs = format!(
                "another library, which needs `cargo run --release -p harness --features {feature}`"
            );
            let accepted = format!("without it {}", Method::NAMES.join(", "));
            faults.push(Fault::new("method", format!("{found}, {needs}"), accepted));
        }
        faults
    }

    /// Methods whose runs would go on for hours because nothing says when they end. What that would be is not judged where it has
    /// `faults`.
    pub(super) fn check_ends(&self, at: &[usize], faults: &[Fault]) -> Vec<Fault> {
        let endless = best::Config::default().work_per_object;
        let goes_on = |labelled: &&Labelled| match &labelled.method {
            Contestant::Ours(Method::Best(config)) => config.work_per_object == endless,
            _ => false,
        };
        let has_end = |labelled: &Labelled| {
            let is_limited = self.budget_of(labelled) != Budget::UNLIMITED;
            is_limited || self.max_seconds_of(labelled).is_some() || self.suite.is_some()
        };
        let is_doubtful = |entry: &str| {
            let keys = ["budget", "max_seconds", "work_per_object"];
            let keys = keys
                .iter()
                .flat_map(|key| [(*key).to_owned(), format!("{entry}.{key}")]);
            keys.into_iter().any(|key| {
                faults
                    .iter()
                    .any(|fault| is_within(&fault.key, &key))
            })
        };
        let found = format!(
            "missing for best, which would take {endless} nodes of work per object: hours on a large scene"
        );
        let accepted = "`budget = { max_work = 300_000_000 }`, some seconds on one thread, or `max_seconds = 10`, here or for all \
                        methods, or another `work_per_object`";
        let own = at
            .iter()
            .zip(&self.methods)
            .filter(|(_, labelled)| goes_on(labelled) && !has_end(labelled));
        let entries = own
            .map(|(at, _)| format!("methods[{at}]"))
            .filter(|entry| !is_doubtful(entry));
        entries
            .map(|entry| Fault::new(format!("{entry}.budget"), &found, accepted))
            .collect()
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
        let accepted = "none, or a budget of `max_work`: runs of so many seconds have rows in timing_runs.csv alone";
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

    /// The labels in reports, which stand at these places in the spec, that no method has.
    pub(super) fn check_reports(&self, labels: &[Option<String>], at: &[usize]) -> Vec<Fault> {
        // A label that cannot be told may be any.
        let Some(known) = labels
            .iter()
            .map(Option::as_deref)
            .collect::<Option<Vec<&str>>>()
        else {
            return vec![];
        };
        let accepted = known.join(", ");
        let fault = |(at, report): (&usize, &Report)| {
            let unknown = report
                .labels()
                .into_iter()
                .filter(|(_, label)| !known.contains(label));
            let fault = |(key, label): (String, &str)| {
                Fault::new(
                    format!("reports[{at}].{key}"),
                    format!("{label:?}, no label of a method"),
                    &accepted,
                )
            };
            unknown.map(fault).collect::<Vec<Fault>>()
        };
        at.iter()
            .zip(&self.reports)
            .flat_map(fault)
            .collect()
    }
}

/// Labels that another entry of `methods` has already.
pub(super) fn unique(labels: &[Option<String>]) -> Vec<Fault> {
    let mut known = HashSet::new();
    let labels = labels
        .iter()
        .enumerate()
        .filter_map(|(at, label)| Some((at, label.as_ref()?)));
    let second = labels.filter(|(_, label)| !known.insert(*label));
    let fault = |(at, label)| {
        Fault::new(
            format!("methods[{at}].label"),
            format!("{label:?} for the second time"),
            "unique labels",
        )
    };
    second.map(fault).collect()
}
