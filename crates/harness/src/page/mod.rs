//! All results on one page: what each experiment answers first, then its tables, figures and files.

mod html;

use crate::Error;
use crate::files;
use crate::report::output::Output;
use crate::report::paper::Outcome;
use crate::run::finish::outputs;
use crate::run::provenance::Provenance;
use crate::run::resolved::{Resolved, read_toml};
use ::figures::Figure;
use bvh_scenes::SceneKind;
use bvh_scenes::files::read_text;
use std::path::{Component, Path, PathBuf};

/// One experiment's folder, as read.
struct Section {
    name: String,
    question: String,
    /// The verdict on its rows.
    verdict: Verdict,
    stand_ins: bool,
    /// True if it reproduces a result of the paper.
    of_paper: bool,
    /// The outputs of its reports.
    outputs: Vec<Output>,
    /// The figures in the folder, those of the first report first.
    figures: Vec<Drawing>,
    /// The first figure's first panel, small; of a figure without panels nothing.
    miniature: Option<String>,
    /// Spec, resolved spec and provenance: what it is called, and where it is as seen from the
    /// page.
    specs: Vec<Link>,
    /// The rows.
    tables: Vec<Link>,
    provenance: Provenance,
}

/// The conclusion of an experiment, by a rule that the page states.
enum Verdict {
    Paper(Outcome, String),
    Reading(String),
    None,
}

/// A figure of the folder.
struct Drawing {
    name: String,
    svg: String,
    files: Vec<Link>,
}

/// The name of a file, and its path relative to the page.
struct Link {
    name: String,
    to: String,
}

/// Writes a page of all finished experiments in `results` to `out`, without quick variants and
/// without repetitions of experiments that are on the page. Returns the number of experiments.
pub fn write(results: &Path, out: &Path) -> Result<usize, Error> {
    let mut names = files::names(results)?;
    names.retain(|name| results.join(name).join("resolved.toml").is_file());
    let repeats =
        |name: &String| name.strip_suffix(".new").is_some_and(|kept| names.contains(kept));
    let kept = names.iter().filter(|name| !repeats(name));
    let mut sections =
        kept.map(|name| section(results, name, out)).collect::<Result<Vec<_>, _>>()?;
    if sections.is_empty() {
        return Err(Error::Usage(format!(
            "{} holds no finished experiment; accepted: the --out of one",
            results.display()
        )));
    }
    // The paper's experiments come first.
    sections.sort_by(|a, b| (!a.of_paper, &a.name).cmp(&(!b.of_paper, &b.name)));
    files::write(out, html::page(&sections).as_bytes())?;
    Ok(sections.len())
}

/// Reads what an experiment has written, and makes its reports again, which read CSV files only.
/// Runs nothing.
fn section(results: &Path, name: &str, out: &Path) -> Result<Section, Error> {
    let folder = results.join(name);
    let Resolved { experiment, scenes } = read_toml(&folder.join("resolved.toml"))?;
    let provenance: Provenance = read_toml(&folder.join("provenance.toml"))?;
    let outputs = outputs(&experiment, &folder)?;
    let found = files::names(&folder)?;
    let link = |file: &str| Link { name: file.into(), to: way(out, &folder.join(file)) };
    let ending = |suffix: &'static str| {
        found.iter().filter_map(move |file| Some((file, file.strip_suffix(suffix)?.to_owned())))
    };
    let drawn: Vec<&(String, Figure)> = outputs.iter().flat_map(|output| &output.figures).collect();
    let mut figures = Vec::new();
    for (file, name) in ending(".svg") {
        let files = ["svg", "csv"].map(|kind| format!("{name}.{kind}"));
        let files = files
            .iter()
            // A figure of several tables has no CSV file of its name.
            .filter(|file| found.contains(*file))
            .map(|file| link(file))
            .collect();
        figures.push(Drawing { svg: read(&folder.join(file))?, name, files });
    }
    // Readers expect figures in the order of the reports, not of their file names.
    figures.sort_by_key(|figure| {
        drawn.iter().position(|(name, _)| *name == figure.name).unwrap_or(drawn.len())
    });
    let miniature = drawn.first().map(|(_, figure)| ::figures::miniature(figure)).transpose()?;
    let specs =
        spec_file(name, &provenance).map(|path| Link { name: "spec".into(), to: way(out, &path) });
    let resolved = Link { name: "spec with all defaults".into(), ..link("resolved.toml") };
    Ok(Section {
        name: name.into(),
        question: experiment.question,
        verdict: verdict(&outputs),
        stand_ins: scenes.iter().any(|scene| scene.kind == SceneKind::StandIn.to_string()),
        of_paper: outputs.iter().any(|output| output.outcome.is_some()),
        miniature,
        outputs,
        figures,
        specs: specs
            .into_iter()
            .chain([resolved, Link { name: "provenance".into(), ..link("provenance.toml") }])
            .collect(),
        tables: ending(".csv").map(|(file, _)| link(file)).collect(),
        provenance,
    })
}

/// Returns the verdict and the answers if numbers are compared with the paper's, otherwise the
/// first report's reading.
fn verdict(outputs: &[Output]) -> Verdict {
    let compared =
        outputs.iter().find_map(|output| Some((output.outcome?, output.answer.clone()?)));
    if let Some((outcome, answer)) = compared {
        return Verdict::Paper(outcome, answer);
    }
    let reading =
        outputs.iter().map(|output| output.reading.trim()).find(|reading| !reading.is_empty());
    reading.map_or(Verdict::None, |reading| Verdict::Reading(reading.into()))
}

/// The spec that was run, if it still is where it was.
fn spec_file(name: &str, provenance: &Provenance) -> Option<PathBuf> {
    let command = provenance.parts.first().map_or(&provenance.command, |part| &part.command);
    let is_spec = |path: &PathBuf| {
        path.file_name().is_some_and(|file| *file == *format!("{name}.toml")) && path.is_file()
    };
    command
        .split_whitespace()
        .map(PathBuf::from)
        // Only the command line of the run records where the spec was.
        .find(is_spec)
}

/// The way from the page to a file, as a relative reference of a URL.
fn way(page: &Path, file: &Path) -> String {
    let whole = |path: &Path| {
        path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_default()
    };
    let from = whole(
        page.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")),
    );
    let to = whole(file);
    // Only a relative link still works when the results are moved or published.
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| "..".into());
    let down = to.components().skip(common).filter_map(|part| match part {
        Component::Normal(name) => Some(html::reference(&name.to_string_lossy())),
        _ => None,
    });
    up.chain(down).collect::<Vec<String>>().join("/")
}

fn read(path: &Path) -> Result<String, Error> {
    Ok(read_text(path)?)
}
