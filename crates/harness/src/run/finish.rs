//! Turns finished runs into results: joins their rows, updates the references and makes the
//! reports.

use crate::Error;
use crate::files::read_toml;
use crate::report;
use crate::report::output::Output;
use crate::rows::store::{self, Store};
use crate::run::provenance::Provenance;
use crate::run::reference;
use crate::run::resolved::Resolved;
use crate::spec::Experiment;
use bvh_scenes::files::read_text;
use std::path::{Path, PathBuf};

/// The outcome of a finished experiment, for the terminal.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Tables for the terminal.
    pub text: String,
    /// Optional scenes that have not been fetched.
    pub skipped_scenes: Vec<String>,
    /// Peculiarities of scene files and damaged runs that were repeated, one line each.
    pub remarks: Vec<String>,
    /// The folder of the results.
    pub folder: PathBuf,
}

/// Joins the kept runs and makes the reports of results in `out`. Adds their tables to the summary,
/// before its text, and a remark if the seconds come from processors of several models.
pub(crate) fn conclude(
    resolved: &Resolved,
    out: &Path,
    store: Store,
    summary: &mut Summary,
) -> Result<(), Error> {
    let processors = store.join(resolved.run_count())?;
    let are_unlike = processors.len() > 1;
    let provenance = Provenance::gather(processors);
    let text = report(resolved, out, &provenance, &store);
    // A mistake in a report must not cost the runs: `--redraw` makes the reports again.
    if matches!(text, Ok(_) | Err(Error::Query { .. })) {
        store.write_toml("resolved.toml", resolved)?;
        // Provenance comes last, so that it describes results that are complete.
        store.write_toml("provenance.toml", &provenance)?;
        store.finish()?;
    }
    summary.text.insert_str(0, &text?);
    if are_unlike {
        let cpu = provenance.cpu;
        summary.remarks.push(format!("the seconds come from unlike processors: {cpu}"));
    }
    Ok(())
}

/// Improves the best known costs and makes the reports of joined rows. Returns the text for the
/// terminal.
fn report(
    resolved: &Resolved,
    out: &Path,
    provenance: &Provenance,
    store: &Store,
) -> Result<String, Error> {
    // Reports read references, so these are updated first.
    reference::update(resolved, out, &provenance.revision, store)?;
    let experiment = &resolved.experiment;
    report::write(&experiment.reports, experiment.suite.is_some(), store, experiment.quick)
}

/// Reads the spec of a finished experiment from its folder, and makes its reports again. Writes
/// nothing.
pub fn remade(folder: &Path) -> Result<(Experiment, Vec<Output>), Error> {
    let Resolved { experiment, .. } = read_toml(&folder.join("resolved.toml"))?;
    let outputs = report::outputs(&experiment.reports, experiment.suite.is_some(), folder)?;
    Ok((experiment, outputs))
}

/// Returns true if `out` has finished results of the same runs, perhaps with other reports.
pub fn has_results_of(experiment: &Experiment, out: &Path) -> Result<bool, Error> {
    let text = store::finished_spec(&out.join(experiment.folder()))?;
    let recorded: Option<Resolved> = text.and_then(|text| toml::from_str(&text).ok());
    Ok(recorded.is_some_and(|recorded| recorded.has_runs_of(experiment)))
}

/// Makes the reports of finished runs again, with the current best known costs.
///
/// Runs nothing and loads no scene. The rows in `out/NAME/` must come from the same spec, which may
/// differ only in its reports.
pub fn redraw(experiment: &Experiment, out: &Path) -> Result<Summary, Error> {
    let folder = out.join(experiment.folder());
    let rejected = |fault: &str| Err(Error::Usage(format!("{}: {fault}", folder.display())));
    let unfinished = "the experiment was interrupted; finish it with --resume first";
    if store::is_unfinished(&folder) {
        return rejected(unfinished);
    }
    let recorded: Option<Resolved> =
        toml::from_str(&read_text(&folder.join("resolved.toml"))?).ok();
    let Some(recorded) = recorded.filter(|recorded| recorded.has_runs_of(experiment)) else {
        return rejected(
            "the rows come from another spec, scene or seed; run it again without --redraw",
        );
    };
    if !recorded.experiment.keeps_rows_for(experiment) {
        return rejected(
            "a new report reads trials or times of events, which were not kept; run it again \
             without --redraw",
        );
    }
    let resolved = Resolved { experiment: experiment.clone(), scenes: recorded.scenes };
    let store = Store::lock(&folder)?;
    // Another harness may have begun before the folder was locked.
    if store::is_unfinished(&folder) {
        return rejected(unfinished);
    }
    // The rows are still the output of the program that ran, so its provenance is kept.
    let provenance: Provenance = read_toml(&folder.join("provenance.toml"))?;
    let text = report(&resolved, out, &provenance, &store)?;
    store.write_toml("resolved.toml", &resolved)?;
    Ok(Summary { text, folder, ..Summary::default() })
}
