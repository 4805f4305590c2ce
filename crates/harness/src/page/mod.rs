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
use html_escape::encode_double_quoted_attribute as escaped;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use std::fmt::Display;
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
            let tables = output.tables()?.into_iter().filter(|(_, rows)| !rows.is_empty());
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
    files::write(&out, page(&sections).as_bytes())?;
    Ok((sections.len(), out))
}

fn page(sections: &[Section]) -> String {
    // The two pictures that say the most, wherever they are: error against run time, and all checks
    // of extreme scenes.
    let files = [OVERVIEW, stress::FIGURE].map(|name| format!("{name}.svg"));
    let figures = sections.iter().flat_map(|section| &section.figures);
    let pictures: String = figures.filter(|(name, _)| files.contains(name)).map(figure).collect();
    let scoreboard = scoreboard(sections);
    let question = |section: &Section| format!("<li>{}</li>\n", link(section, &section.question));
    let questions: String = sections.iter().map(question).collect();
    let experiments: String = sections.iter().map(experiment).collect();
    let version = env!("CARGO_PKG_VERSION");
    format!(
        r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>BVH by stochastic search: results</title>
<style>{STYLE}</style>
</head>
<body>
<h1>BVH by stochastic search: results</h1>
<main>
{pictures}{scoreboard}<h2>All questions</h2>
<ul>
{questions}</ul>
{experiments}</main>
<footer><p>Made by harness {version} from the CSV files that it leads to.</p></footer>
</body>
</html>
"#
    )
}

/// The numbers and words of the paper beside ours, in the paper's order.
fn scoreboard(sections: &[Section]) -> String {
    let row = |(section, row): (&Section, &PaperRow)| {
        let PaperRow { paper, ours, verdict, scene, quantity, .. } = row;
        let verdict = verdict.name();
        let others =
            [paper, ours, &verdict, scene, quantity].map(|text| escaped(text).into_owned());
        [link(section, &row.source)].into_iter().chain(others).collect()
    };
    let rows =
        sections.iter().flat_map(|section| section.paper.iter().map(move |row| (section, row)));
    let rows: Vec<Vec<String>> = rows.map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    let caption = "<caption><span>Ng &amp; Trifonov (2003) beside ours. Their scenes are gone; ours are \
                   stand-ins. Costs are ratios to the greedy Müller–Fellner tree.</span></caption>";
    table(caption, "source paper ours verdict scene quantity".split(' '), rows)
}

/// An experiment with all that belongs to it.
fn experiment(section: &Section) -> String {
    let id = in_url(&section.name);
    let [name, question] = [&section.name, &section.question].map(|text| escaped(text));
    let figures: String = section.figures.iter().map(figure).collect();
    let tables: String = section
        .shown
        .iter()
        .map(|(title, rows)| {
            let columns = rows[0].keys().map(|name| escaped(name).replace('_', " "));
            let rows = rows
                .iter()
                .map(|row| row.values().map(|text| escaped(text).into_owned()).collect());
            let (title, table) = (escaped(title), table("", columns, rows));
            format!("<details><summary>{title}</summary>\n{table}</details>\n")
        })
        .collect();
    let file =
        |(name, path): &(String, String)| format!("<a href=\"{path}\">{}</a>\n", escaped(name));
    let files: String = section.tables.iter().map(file).collect();
    let Provenance { command, revision, rustc, cpu, threads, date, .. } = &section.provenance;
    let command = escaped(command);
    let origin = format!("revision {revision}, {rustc}, {cpu}, {threads} thread(s), {date}");
    let origin = escaped(&origin);
    format!(
        "<section id=\"{id}\">\n<h2>{question}</h2>\n{figures}{tables}\
         <p class=\"files\">Rows of {name}:\n{files}</p>\n\
         <p class=\"files\"><code>{command}</code>, {origin}</p>\n</section>\n"
    )
}

/// A link to an experiment on the page.
fn link(section: &Section, text: &str) -> String {
    format!("<a href=\"#{}\">{}</a>", in_url(&section.name), escaped(text))
}

/// A figure by its name and path.
fn figure((name, path): &(String, String)) -> String {
    let name = escaped(name);
    format!(
        "<figure><img class=\"sheet\" src=\"{path}\" alt=\"{name}\" loading=\"lazy\"></figure>\n"
    )
}

/// A table of cells in HTML, in a box that scrolls if it is too wide for the page. The first cell of a row
/// is its header.
fn table<S: Display>(
    caption: &str,
    columns: impl IntoIterator<Item = S>,
    rows: impl IntoIterator<Item = Vec<String>>,
) -> String {
    let is_number =
        |text: &str| text.trim_end_matches(" %").trim_start_matches('+').parse::<f64>().is_ok();
    let cell = |(at, text): (usize, &String)| match at {
        0 => format!("<th scope=\"row\">{text}</th>"),
        _ if is_number(text) => format!("<td class=\"number\">{text}</td>"),
        _ => format!("<td>{text}</td>"),
    };
    let row = |row: Vec<String>| {
        let cells: String = row.iter().enumerate().map(cell).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let columns: String =
        columns.into_iter().map(|name| format!("<th scope=\"col\">{name}</th>")).collect();
    let rows: String = rows.into_iter().map(row).collect();
    format!(
        "<div class=\"wide\" tabindex=\"0\"><table>{caption}\n<thead><tr>{columns}</tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table></div>\n"
    )
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
