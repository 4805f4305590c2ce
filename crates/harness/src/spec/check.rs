//! Checks that types alone cannot express, one function per part of a spec.
//!
//! Messages name the key, the value found, and the accepted values.

use super::Experiment;
use crate::contestant::{Contestant, EntryOptions, Labelled};
use bvh_config::OutOfRange;
use bvh_config::fault::{Fault, is_within};
use bvh_scenes::subset;
use bvh_search::{Budget, Method, best};
use std::collections::HashSet;

/// The maximum number of runs of an experiment.
const MOST_RUNS: u64 = 10_000_000;

impl Experiment {
    /// Checks the question, the scenes and the number of runs.
    pub(super) fn check_together(&self) -> Vec<Fault> {
        let errors = [self.check_question(), self.check_scenes(), self.check_run_count()];
        errors.into_iter().filter_map(Result::err).map(Fault::from).collect()
    }

    fn check_question(&self) -> Result<(), OutOfRange> {
        if self.question.trim().is_empty() {
            let accepted = "the question that the experiment answers, for its readers";
            return Err(OutOfRange::new("question", "empty", accepted));
        }
        Ok(())
    }

    /// Checks the scenes' names; loading finds out whether the scenes exist.
    fn check_scenes(&self) -> Result<(), OutOfRange> {
        let rejected = |name: &str, accepted: &str| {
            Err(OutOfRange::new("scenes", format!("{name:?}"), accepted))
        };
        if self.suite.is_none() && self.scenes.is_empty() {
            return Err(OutOfRange::new("scenes", "empty", "at least one name or path"));
        }
        for name in &self.scenes {
            if self.suite.is_some() && bvh_stress::by_id(name).is_none() {
                return rejected(name, "cases of the suite, S01 to S45");
            }
            if subset::names(name) == 0 {
                return rejected(name, "A..B with A up to B");
            }
        }
        Ok(())
    }

    /// Checks that there is at least one run, and at most [`MOST_RUNS`].
    pub(crate) fn check_run_count(&self) -> Result<(), OutOfRange> {
        let scenes =
            self.scenes.iter().map(|name| subset::names(name)).fold(0, u64::saturating_add);
        // A range of scenes may have more names than fit in a number of 64 bits.
        let runs = scenes
            .saturating_mul(self.methods.len() as u64)
            .saturating_mul(self.repetitions.into());
        if runs > MOST_RUNS {
            let product = "the product of the numbers of scenes, methods and repetitions";
            let accepted = format!("up to {MOST_RUNS}");
            return Err(OutOfRange::new(product, format!("{runs} runs"), accepted));
        }
        if self.methods.is_empty() {
            return Err(OutOfRange::new("methods", "empty", "at least one table with a `method`"));
        }
        Ok(())
    }

    /// Checks methods against the rest of the experiment. `indices` are their places in the spec.
    pub(super) fn check_methods(&self, indices: &[usize]) -> Vec<Fault> {
        let mut faults = Vec::new();
        for (index, labelled) in indices.iter().zip(&self.methods) {
            let entry = format!("methods[{index}]");
            let found = self.check_method(labelled).into_iter();
            faults.extend(found.map(|fault| fault.below(&entry)));
        }
        faults
    }

    fn check_method(&self, labelled: &Labelled) -> Vec<Fault> {
        let Labelled { method, options, .. } = labelled;
        let EntryOptions { budget, keep, judge, for_rays, objective, references, .. } = options;
        let is_ours = matches!(method, Contestant::Ours(_));
        let is_best = matches!(method, Contestant::Ours(Method::Best(_)));
        let judged = Labelled::JUDGED;
        let ours = "with a method of ours";
        let with_judged = format!("with {}", judged.join(", "));
        let sized = "with a method of ours except median_cut, which compares no box sizes";
        let restricted_keys = [
            ("budget", budget.is_some(), is_ours, ours),
            ("keep", !keep.is_empty(), is_ours, ours),
            ("objective", objective.is_some(), is_ours, ours),
            ("for_rays", for_rays.is_some(), is_ours && method.name() != "median_cut", sized),
            ("references", references.is_some(), is_best, "with best"),
            ("judge", judge.is_some(), judged.contains(&method.name()), &with_judged),
        ];
        let mut faults: Vec<Fault> = restricted_keys
            .iter()
            .filter(|(_, is_set, is_accepted, _)| *is_set && !is_accepted)
            .map(|(key, .., accepted)| {
                Fault::new(key, format!("set for {}", method.name()), accepted)
            })
            .collect();
        if for_rays.is_some() && is_ours && self.ray_cost.is_none() {
            let accepted = "with the experiment's `ray_cost`";
            faults.push(Fault::new("for_rays", "set without `ray_cost`", accepted));
        }
        faults.extend(self.check_library(method));
        faults
    }

    /// Checks that the experiment can run a third-party method.
    fn check_library(&self, method: &Contestant) -> Option<Fault> {
        let name = method.name();
        if self.suite.is_some() && !matches!(method, Contestant::Ours(_)) {
            // One that crashes must not end the suite; it runs each library in a separate process.
            let accepted =
                "methods of ours; the suite itself runs the libraries that are compiled in";
            return Some(Fault::new("method", format!("{name:?}, none of ours"), accepted));
        }
        let Contestant::Peer(peer) = method else { return None };
        let feature = peer.missing_feature()?;
        let command = format!("cargo run --release -p harness --features {feature}");
        let found = format!("{name:?}, another library, which needs `{command}`");
        let accepted = format!("without it {}", Method::NAMES.join(", "));
        Some(Fault::new("method", found, accepted))
    }

    /// Finds methods that would run for hours because the spec sets no limit.
    ///
    /// A method is skipped if its limits have `faults` already.
    pub(super) fn check_ends(&self, indices: &[usize], faults: &[Fault]) -> Vec<Fault> {
        let work = best::Config::default().work_per_object;
        let found = format!(
            "missing for best, which would spend {work} nodes of work per object: hours on a large \
             scene"
        );
        let accepted = "`budget = { max_work = 300_000_000 }`, some seconds on one thread, here or \
                        for all methods, or another `work_per_object`";
        indices
            .iter()
            .zip(&self.methods)
            .filter(|(_, labelled)| self.is_endless(labelled))
            .map(|(index, _)| format!("methods[{index}]"))
            .filter(|entry| !has_faulty_limit(entry, faults))
            .map(|entry| Fault::new(format!("{entry}.budget"), &found, accepted))
            .collect()
    }

    /// Returns true if nothing but the generous default limits a method's runs.
    fn is_endless(&self, labelled: &Labelled) -> bool {
        let Contestant::Ours(Method::Best(config)) = &labelled.method else { return false };
        config.work_per_object == best::Config::default().work_per_object
            && self.budget_of(labelled) == Budget::UNLIMITED
            && self.suite.is_none()
    }

    /// Finds labels in reports that no method has. `indices` are the reports' places in the spec.
    pub(super) fn check_reports(&self, labels: &[Option<String>], indices: &[usize]) -> Vec<Fault> {
        // Any name may be the label of an entry that could not be read.
        let known: Option<Vec<&str>> = labels.iter().map(Option::as_deref).collect();
        // One fault is enough: a report may name the entry that could not be read.
        let Some(known) = known else { return vec![] };
        let accepted = known.join(", ");
        let mut faults = Vec::new();
        for (index, report) in indices.iter().zip(&self.reports) {
            for (key, label) in report.labels() {
                if !known.contains(&label) {
                    let key = format!("reports[{index}].{key}");
                    let found = format!("{label:?}, no label of a method");
                    faults.push(Fault::new(key, found, &accepted));
                }
            }
        }
        faults
    }
}

/// Returns true if a key that limits the runs of `entry` has a fault.
fn has_faulty_limit(entry: &str, faults: &[Fault]) -> bool {
    ["budget", "work_per_object"]
        .iter()
        .flat_map(|key| [(*key).to_owned(), format!("{entry}.{key}")])
        .any(|key| faults.iter().any(|fault| is_within(&fault.key, &key)))
}

/// Finds labels that an earlier entry of `methods` has.
pub(super) fn unique(labels: &[Option<String>]) -> Vec<Fault> {
    let mut known = HashSet::new();
    let mut faults = Vec::new();
    for (index, label) in labels.iter().enumerate() {
        if let Some(label) = label
            && !known.insert(label)
        {
            let key = format!("methods[{index}].label");
            let found = format!("{label:?} for the second time");
            faults.push(Fault::new(key, found, "unique labels"));
        }
    }
    faults
}
