//! From finished runs to results: joins their rows, brings the references up to date, makes the reports.

use crate::Error;
use crate::report;
use crate::run::provenance::Provenance;
use crate::run::reference;
use crate::run::resolved::{Resolved, load_scenes, to_toml};
use crate::run::store::{self, Store};
use crate::spec::Experiment;
use std::path::Path;

/// What a finished experiment has to say.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Tables for the terminal.
    pub text: String,
    /// Optional scenes that are not there.
    pub left_out: Vec<String>,
}

/// Joins the kept runs and makes the reports. Returns the text for the terminal.
pub(crate) fn conclude(
    resolved: &Resolved,
    out: &Path,
    provenance: &Provenance,
    store: Store,
) -> Result<String, Error> {
    store.join(resolved.run_count())?;
    let text = report(resolved, out, provenance, &store)?;
    store.write("provenance.toml", to_toml(provenance)?.as_bytes())?;
    store.finish()?;
    Ok(text)
}

/// Improves the best known costs and makes the reports of joined rows. Returns the text for the terminal.
fn report(resolved: &Resolved, out: &Path, provenance: &Provenance, store: &Store) -> Result<String, Error> {
    store.write("resolved.toml", to_toml(resolved)?.as_bytes())?;
    reference::update(resolved, out, &provenance.revision, store)?;
    report::write_all(&resolved.experiment.reports, store)
}

/// Makes the reports of finished runs again, with the best known costs of now. Runs nothing: the rows in `out/NAME/`
/// must come from the same spec, which may differ in its reports only.
pub fn redraw(experiment: &Experiment, out: &Path) -> Result<Summary, Error> {
    let (scenes, left_out) = load_scenes(experiment)?;
    let resolved = Resolved::new(experiment, &scenes);
    let folder = out.join(&experiment.name);
    let refuse = |message: &str| Error::Usage(format!("{}: {message}", folder.display()));
    if store::is_unfinished(&folder) {
        return Err(refuse("the experiment was interrupted; finish it with --resume first"));
    }
    let read = |name: &str| {
        let path = folder.join(name);
        std::fs::read_to_string(&path).map_err(Error::io(&path, "read the file"))
    };
    let found = read("resolved.toml")?;
    let same_runs = toml::from_str(&found).is_ok_and(|found: Resolved| {
        let experiment = Experiment { reports: experiment.reports.clone(), ..found.experiment };
        Resolved { experiment, ..found } == resolved
    });
    if !same_runs {
        return Err(refuse("the rows come from another spec, scene or seed; run it again without --redraw"));
    }
    let store = Store::open(out, &experiment.name, &found, false)?;
    // The rows stay those of the program that produced them, so its provenance is kept.
    let path = folder.join("provenance.toml");
    let provenance: Provenance = toml::from_str(&read("provenance.toml")?).map_err(Error::toml(&path))?;
    let text = report(&resolved, out, &provenance, &store)?;
    store.finish()?;
    Ok(Summary { text, left_out })
}
