//! Checks that types alone cannot express, one function per part of a spec.
//!
//! Messages name the key, the value found, and the accepted values.

use super::Experiment;
use crate::contestant::{Contestant, EntryOptions, Labelled};
use crate::report::Report;
use crate::rows;
use bvh_config::OutOfRange;
use bvh_scenes::subset;
use bvh_search::{Budget, Method, best};
use std::collections::HashSet;

/// The maximum number of runs of an experiment.
const MOST_RUNS: u64 = 10_000_000;

impl Experiment {
    /// Checks relations between keys.
    pub(super) fn check_together(&self) -> Result<(), OutOfRange> {
        self.check_question()?;
        self.check_scenes()?;
        self.check_frames()?;
        self.check_run_count()?;
        self.check_labels()?;
        let mut files: Vec<String> = rows::FILES.iter().map(|file| (*file).to_owned()).collect();
        for (index, report) in self.reports.iter().enumerate() {
            let checked = self.check_report(report, &mut files);
            checked.map_err(|fault| fault.below(format!("reports[{index}]")))?;
        }
        for (index, labelled) in self.methods.iter().enumerate() {
            let fault = self.check_method(labelled).err();
            if let Some(fault) = fault.or_else(|| self.check_end(labelled).err()) {
                return Err(fault.below(format!("methods[{index}]")));
            }
        }
        Ok(())
    }

    fn check_question(&self) -> Result<(), OutOfRange> {
        if self.question.trim().is_empty() {
            let accepted = "the question that the experiment answers, for its readers";
            return Err(OutOfRange::new("question", "empty", accepted));
        }
        Ok(())
    }

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

    /// Rejects measurements that know of boxes along the file's axes only.
    fn check_frames(&self) -> Result<(), OutOfRange> {
        let is_other = |EntryOptions { judge, references, .. }: &EntryOptions| {
            judge.is_some() || references.is_some()
        };
        let is_along_file = self.render.is_some()
            || self.tracing.is_some()
            || self.ray_cost.is_some()
            || self.needs_references()
            || self.methods.iter().any(|labelled| is_other(&labelled.options));
        if !(is_along_file && self.has_frames()) {
            return Ok(());
        }
        let found = "turned scenes or `frame` with render, tracing, ray_cost, judge, \
                     references or gaps, which know no frames";
        Err(OutOfRange::new("scenes, frame", found, "`rays` to measure trees in frames"))
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

    fn check_method(&self, labelled: &Labelled) -> Result<(), OutOfRange> {
        let Labelled { method, options, .. } = labelled;
        let EntryOptions { budget, keep, judge, for_rays, objective, references, frame, .. } =
            options;
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
            ("frame", frame.is_some(), is_ours, ours),
            ("judge", judge.is_some(), judged.contains(&method.name()), &with_judged),
        ];
        for (key, is_set, is_accepted, accepted) in restricted_keys {
            if is_set && !is_accepted {
                return Err(OutOfRange::new(key, format!("set for {}", method.name()), accepted));
            }
        }
        if for_rays.is_some() && self.ray_cost.is_none() {
            let accepted = "with the experiment's `ray_cost`";
            return Err(OutOfRange::new("for_rays", "set without `ray_cost`", accepted));
        }
        let Contestant::Peer(peer) = method else { return Ok(()) };
        if self.suite.is_some() {
            // One that crashes must not end the suite; it runs each library in a separate process.
            let found = format!("{:?}, none of ours", peer.name());
            return Err(OutOfRange::new("method", found, "methods of ours"));
        }
        peer.check_settings()
    }

    /// Rejects a method that would run for hours because the spec sets no limit.
    fn check_end(&self, labelled: &Labelled) -> Result<(), OutOfRange> {
        let work = best::Config::default().work_per_object;
        let is_endless = matches!(&labelled.method, Contestant::Ours(Method::Best(config))
            if config.work_per_object == work)
            && self.budget_of(labelled) == Budget::UNLIMITED
            && self.suite.is_none();
        if !is_endless {
            return Ok(());
        }
        let found = format!(
            "missing for best, which would spend {work} nodes of work per object: hours on a large \
             scene"
        );
        let accepted = "`budget = { max_work = 300_000_000 }`, some seconds on one thread, here or \
                        for all methods, or another `work_per_object`";
        Err(OutOfRange::new("budget", found, accepted))
    }

    fn check_labels(&self) -> Result<(), OutOfRange> {
        let mut known = HashSet::new();
        for (index, Labelled { label, .. }) in self.methods.iter().enumerate() {
            if !known.insert(label) {
                let key = format!("methods[{index}].label");
                let found = format!("{label:?} for the second time");
                return Err(OutOfRange::new(key, found, "unique labels"));
            }
        }
        Ok(())
    }

    /// Rejects a label that no method has, a file that no run and no earlier report writes, and one
    /// that two reports make. `known` are the files of the runs and of earlier reports.
    fn check_report(&self, report: &Report, known: &mut Vec<String>) -> Result<(), OutOfRange> {
        let labels: Vec<&str> = self.methods.iter().map(|method| method.label.as_str()).collect();
        for (key, label) in report.labels() {
            if !labels.contains(&label) {
                let found = format!("{label:?}, no label of a method");
                return Err(OutOfRange::new(key, found, labels.join(", ")));
            }
        }
        for (key, file) in report.reads() {
            if !known.iter().any(|known| known == file) {
                let found = format!("{file:?}, which no run and no report before this one writes");
                return Err(OutOfRange::new(key, found, known.join(", ")));
            }
        }
        for file in report.files() {
            if known.contains(&file) {
                let accepted = "one report that makes it, or another `file` in one of them";
                return Err(OutOfRange::new("kind", format!("a second {file}"), accepted));
            }
            known.push(file);
        }
        Ok(())
    }
}
