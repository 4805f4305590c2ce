//! From finished runs to results: joins their rows, brings the references up to date, makes the reports.

use crate::Error;
use crate::report::output::Output;
use crate::report::{self, clocked};
use crate::rows::store::{self, Existing, Store};
use crate::run::provenance::Provenance;
use crate::run::reference::{self, BestKnown};
use crate::run::resolved::{Resolved, to_toml};
use crate::spec::Experiment;
use bvh_scenes::read_text;
use std::path::{Path, PathBuf};

/// What a finished experiment has to say.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Tables for the terminal.
    pub text: String,
    /// Optional scenes that are not there.
    pub left_out: Vec<String>,
    /// What was noticed in scene files, and damaged runs that were done again, one line each.
    pub remarks: Vec<String>,
    /// The folder of the results.
    pub folder: PathBuf,
    /// The finished results that are kept, beside which those of a repetition lie.
    pub beside: Option<PathBuf>,
}

impl Summary {
    /// Of an experiment to be resumed whose results are finished.
    pub(crate) fn finished(folder: PathBuf) -> Self {
        let text = "All runs are finished; nothing was done. --force does them again, --redraw makes the reports again.\n";
        Self { text: text.into(), folder, ..Self::default() }
    }
}

/// Joins the kept runs and makes the reports. Returns the text for the terminal. Runs whose results lie beside others
/// improve no best known costs.
pub(crate) fn conclude(
    resolved: &Resolved,
    best_known: BestKnown,
    provenance: &Provenance,
    store: Store,
) -> Result<String, Error> {
    store.join(resolved.run_count())?;
    // The suite has drawn its own table, and its cases have no best known costs.
    let text = if resolved.experiment.suite.is_some() {
        store.write("resolved.toml", to_toml(resolved)?.as_bytes())?;
        String::new()
    } else {
        report(resolved, best_known, provenance, &store)?
    };
    store.write("provenance.toml", to_toml(provenance)?.as_bytes())?;
    store.finish()?;
    Ok(text)
}

/// Improves the best known costs and makes the reports of joined rows. Returns the text for the terminal.
fn report(
    resolved: &Resolved,
    best_known: BestKnown,
    provenance: &Provenance,
    store: &Store,
) -> Result<String, Error> {
    store.write("resolved.toml", to_toml(resolved)?.as_bytes())?;
    reference::update(resolved, best_known, &provenance.revision, store)?;
    let made = outputs(&resolved.experiment, store.folder())?;
    // Of quick variants, nothing but the rows is compared or shown.
    report::write_all(&made, store, !resolved.experiment.quick)
}

/// What is made of the CSV files in an experiment's folder. Writes nothing.
pub fn outputs(experiment: &Experiment, folder: &Path) -> Result<Vec<Output>, Error> {
    match &experiment.suite {
        Some(measure) => Ok(vec![measure.output(folder)?]),
        None if experiment.is_by_the_clock() => Ok(vec![clocked::output(folder)?]),
        None => report::outputs(&experiment.reports, folder),
    }
}

/// Makes the reports of the finished experiment in a folder again, by the spec that lies next to its rows. Writes nothing.
pub fn remade(folder: &Path) -> Result<Vec<Output>, Error> {
    let path = folder.join("resolved.toml");
    let resolved: Resolved = toml::from_str(&read_text(&path)?).map_err(Error::toml(&path))?;
    outputs(&resolved.experiment, folder)
}

/// Makes the reports of finished runs again, with the best known costs of now. Runs nothing and loads no scene: the rows
/// in `out/NAME/` must come from the same spec, which may differ in its reports only.
pub fn redraw(experiment: &Experiment, out: &Path) -> Result<Summary, Error> {
    let folder = out.join(experiment.folder());
    let refuse = |message: &str| Error::Usage(format!("{}: {message}", folder.display()));
    if store::is_unfinished(&folder) {
        return Err(refuse("the experiment was interrupted; finish it with --resume first"));
    }
    let text = read_text(&folder.join("resolved.toml"))?;
    let found: Option<Resolved> = toml::from_str(&text).ok();
    let resolved = found.filter(|found| found.has_runs_of(experiment));
    let Some(Resolved { experiment: old, scenes }) = resolved else {
        return Err(refuse(
            "the rows come from another spec, scene or seed; run it again without --redraw",
        ));
    };
    if !old.keeps_rows_for(&experiment.reports) {
        return Err(refuse(
            "a new report reads trials or times of events, which were not kept; run it again without --redraw",
        ));
    }
    let resolved = Resolved { experiment: experiment.clone(), scenes };
    let store = Store::open(&folder, &text, Existing::Keep)?;
    // The rows stay those of the program that produced them, so its provenance is kept.
    let path = folder.join("provenance.toml");
    let provenance: Provenance = toml::from_str(&read_text(&path)?).map_err(Error::toml(&path))?;
    let text = report(&resolved, BestKnown::Improve(out), &provenance, &store)?;
    store.finish()?;
    Ok(Summary { text, left_out: vec![], remarks: vec![], folder, beside: None })
}
