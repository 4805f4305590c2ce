//! All results on one page: the paper's numbers beside ours first, then each experiment with its
//! figures, tables and files.

use crate::Error;
use crate::files;
use crate::report::paper::{PaperRow, Verdict};
use crate::report::query::Row;
use crate::run::finish::remade;
use crate::run::provenance::Provenance;
use crate::run::resolved::read_toml;
use crate::stress;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use std::path::{Path, PathBuf};

const STYLE: &str = include_str!("style.css");

/// The figure of error against run time, which `experiments/anytime.toml` makes.
const OVERVIEW: &str = "timing_overview";

/// One experiment's folder, as read.
struct Section {
    name: String,
    question: String,
    /// The comparisons with the paper's numbers and words.
    paper: Vec<PaperRow>,
    /// The tables of the reports, each with its title.
    shown: Vec<(String, Vec<Row>)>,
    /// The figures and the CSV files in the folder: name, and path relative to the page.
    figures: Vec<(String, String)>,
    tables: Vec<(String, String)>,
    provenance: Provenance,
}

impl Section {
    /// Reads what an experiment has written, and makes its reports again, which read CSV files only.
    fn read(results: &Path, name: &str) -> Result<Self, Error> {
        let folder = results.join(name);
        let (experiment, outputs) = remade(&folder)?;
        let names = files::names(&folder)?;
        let ending = |suffix: &str| {
            let ours = names.iter().filter(|file| file.ends_with(suffix));
            ours.map(|file| (file.clone(), format!("{}/{}", in_url(name), in_url(file)))).collect()
        };
        let (mut shown, mut paper) = (Vec::new(), Vec::new());
        for output in outputs {
            let tables = output.tables()?.into_iter();
            shown
                .extend(tables.map(|(title, rows)| (format!("{}: {title}", output.heading), rows)));
            paper.extend(output.paper);
        }
        paper.retain(|row| row.verdict != Verdict::NotInPaper);
        Ok(Self {
            name: name.into(),
            paper,
            shown,
            question: experiment.question,
            figures: ending(".svg"),
            tables: ending(".csv"),
            provenance: read_toml(&folder.join("provenance.toml"))?,
        })
    }
}

/// Writes a page of all finished experiments in `results`, without quick variants, into this folder.
/// Returns the number of experiments and the page's path.
pub fn write(results: &Path) -> Result<(usize, PathBuf), Error> {
    let mut names = files::names(results)?;
    names.retain(|name| results.join(name).join("resolved.toml").is_file());
    let mut sections = Vec::new();
    for name in &names {
        sections.push(Section::read(results, name)?);
    }
    if sections.is_empty() {
        return Err(Error::Usage(format!(
            "{} holds no finished experiment; accepted: the --out of one",
            results.display()
        )));
    }
    // In the order of the paper's tables and figures.
    sections.sort_by_cached_key(|section| {
        let source = section.paper.first().map(|row| row.source.clone());
        (source.is_none(), source, section.name.clone())
    });
    let out = results.join("report.html");
    files::write(&out, page(&sections).into_string().as_bytes())?;
    Ok((sections.len(), out))
}

fn page(sections: &[Section]) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "BVH by stochastic search: results" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "BVH by stochastic search: results" }
                main {
                    (pictures(sections))
                    (scoreboard(sections))
                    h2 { "All questions" }
                    ul {
                        @for section in sections {
                            li {
                                a href={ "#" (in_url(&section.name)) } { (section.question) }
                            }
                        }
                    }
                    @for section in sections { (experiment(section)) }
                }
                footer { p { "Made by harness " (env!("CARGO_PKG_VERSION")) " from the CSV files that it leads to." } }
            }
        }
    }
}

/// The two pictures that say the most, wherever they are: error against run time, and all checks of
/// extreme scenes.
fn pictures(sections: &[Section]) -> Markup {
    let files = [OVERVIEW, stress::FIGURE].map(|name| format!("{name}.svg"));
    let figures = sections.iter().flat_map(|section| &section.figures);
    html! {
        @for (name, path) in figures.filter(|(name, _)| files.contains(name)) {
            figure { img.sheet src=(path) alt=(name); }
        }
    }
}

/// The numbers and words of the paper beside ours, in the paper's order.
fn scoreboard(sections: &[Section]) -> Markup {
    html! {
        @if sections.iter().any(|section| !section.paper.is_empty()) {
            div.wide tabindex="0" { table {
                caption { span {
                    "Ng & Trifonov (2003) beside ours. Their scenes are gone; ours are stand-ins. \
                     Costs are ratios to the greedy Müller–Fellner tree."
                } }
                thead { tr { @for name in ["source", "paper", "ours", "verdict", "scene", "quantity"] {
                    th scope="col" { (name) }
                } } }
                tbody { @for section in sections { @for row in &section.paper { tr {
                    th scope="row" { a href={ "#" (in_url(&section.name)) } { (row.source) } }
                    td.number { (row.paper) }
                    td.number { (row.ours) }
                    td { (row.verdict.name()) }
                    td { (row.scene) }
                    td { (row.quantity) }
                } } } }
            } }
        }
    }
}

/// An experiment with all that belongs to it.
fn experiment(section: &Section) -> Markup {
    let Provenance { command, revision, rustc, cpu, threads, date, .. } = &section.provenance;
    html! {
        section id=(in_url(&section.name)) {
            h2 { (section.question) }
            @for (name, path) in &section.figures {
                figure { img.sheet src=(path) alt=(name) loading="lazy"; }
            }
            @for (title, rows) in &section.shown {
                details { summary { (title) } (table(rows)) }
            }
            p.files {
                "Rows of " (section.name) ": "
                @for (name, path) in &section.tables { a href=(path) { (name) } " " }
            }
            p.files {
                code { (command) } ", revision " (revision) ", " (rustc) ", " (cpu) ", "
                (threads) " thread(s), " (date)
            }
        }
    }
}

/// A table in a box that scrolls if it is too wide for the page. The first cell of a row is its
/// header.
fn table(rows: &[Row]) -> Markup {
    let is_number =
        |text: &str| text.trim_end_matches(" %").trim_start_matches('+').parse::<f64>().is_ok();
    html! {
        div.wide tabindex="0" { table {
            thead { tr { @for name in rows[0].keys() {
                th scope="col" { (name.replace('_', " ")) }
            } } }
            tbody { @for row in rows { tr {
                @for (at, text) in row.values().enumerate() {
                    @if at == 0 { th scope="row" { (text) } }
                    @else if is_number(text) { td.number { (text) } }
                    @else { td { (text) } }
                }
            } } }
        } }
    }
}

/// A name as it stands in a URL.
fn in_url(name: &str) -> String {
    // These are the unreserved characters of URLs (RFC 3986); all others are encoded.
    const PLAIN: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');
    utf8_percent_encode(name, PLAIN).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;
    use crate::spec::{Experiment, Overrides};

    #[test]
    fn the_experiment_about_run_times_draws_the_first_picture() {
        let spec = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/anytime.toml");
        let spec = Experiment::read(Path::new(spec), &Overrides::default()).unwrap();
        let draws = |report: &Report| match report {
            Report::Query(config) => config.file == OVERVIEW && config.figure.is_some(),
            _ => false,
        };
        assert!(spec.reports.iter().any(draws));
    }
}
