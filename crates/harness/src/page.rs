//! All results on one page in Markdown: the paper's numbers beside ours first, then each experiment
//! with its figures, tables and files.

use crate::report::output::Output;
use crate::report::paper::{PaperRow, Verdict};
use crate::run::finish::outputs;
use crate::run::provenance::Provenance;
use crate::run::resolved::{Resolved, read_toml};
use crate::{Error, files};
use comfy_table::{Table, presets};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// One experiment's folder, as read.
struct Section {
    name: String,
    question: String,
    outputs: Vec<Output>,
    /// The names of the files in the folder.
    files: BTreeSet<String>,
    provenance: Provenance,
}

impl Section {
    /// Reads what an experiment has written, and makes its reports again, which read CSV files only.
    fn read(results: &Path, name: &str) -> Result<Self, Error> {
        let folder = results.join(name);
        let Resolved { experiment, .. } = read_toml(&folder.join("resolved.toml"))?;
        Ok(Self {
            name: name.into(),
            outputs: outputs(&experiment, &folder)?,
            question: experiment.question,
            files: files::names(&folder)?,
            provenance: read_toml(&folder.join("provenance.toml"))?,
        })
    }

    /// Returns the comparisons with the paper's numbers and words.
    fn paper(&self) -> impl Iterator<Item = &PaperRow> {
        let rows = self.outputs.iter().flat_map(|output| &output.paper);
        rows.filter(|row| row.verdict != Verdict::NotInPaper)
    }

    /// Returns the question, and the first thing that the experiment's rows say.
    fn answered(&self) -> String {
        let said = self.outputs.iter().find_map(|output| output.finding.as_ref());
        let said = said.map_or_else(String::new, |finding| format!(" **{finding}.**"));
        plain(&(self.question.clone() + &said))
    }

    /// Returns the links to the files with this extension; figures are shown.
    fn links(&self, extension: &str) -> String {
        let mut links = String::new();
        for file in self.files.iter().filter(|file| file.ends_with(extension)) {
            let mark = if extension == ".svg" { "!" } else { "" };
            links += &format!("{mark}[{file}](<{}/{file}>)\n", self.name);
        }
        links
    }

    fn text(&self) -> String {
        let Provenance { command, revision, rustc, cpu, threads, date, .. } = &self.provenance;
        let mut text = format!("\n## <a id=\"{0}\"></a>{0}\n\n{1}\n", self.name, self.answered());
        text += &format!("\n{}\n", self.links(".svg"));
        for output in &self.outputs {
            for (explanation, table) in &output.tables {
                let summary = format!("{}: {}", output.heading, explanation.trim_end_matches(':'));
                let (summary, table) = (plain(&summary), markdown(table.clone()));
                text +=
                    &format!("<details><summary>{summary}</summary>\n\n{table}\n\n</details>\n\n");
            }
        }
        let made = format!("`{command}`, revision {revision}, {rustc}, {cpu}, {threads} thread(s)");
        text + &format!("{}\n{made}, {date}\n", self.links(".csv"))
    }
}

/// Writes a page of all finished experiments in `results`, without quick variants, into this folder.
/// Returns the number of experiments and the page's path.
pub fn write(results: &Path) -> Result<(usize, PathBuf), Error> {
    let mut names = files::names(results)?;
    names.retain(|name| results.join(name).join("resolved.toml").is_file());
    let sections = names.iter().map(|name| Section::read(results, name));
    let mut sections = sections.collect::<Result<Vec<_>, _>>()?;
    if sections.is_empty() {
        return Err(Error::Usage(format!(
            "{} holds no finished experiment; accepted: the --out of one",
            results.display()
        )));
    }
    // In the order of the paper's tables and figures.
    sections.sort_by_cached_key(|section| {
        let source = section.paper().next().map(|row| row.source.clone());
        (source.is_none(), source, section.name.clone())
    });
    let mut page = String::from("# BVH by stochastic search: results\n");
    page += &beside_paper(&sections);
    page += "\n## All questions\n\n";
    for section in &sections {
        page += &format!("- [{0}](<#{0}>): {1}\n", section.name, section.answered());
    }
    page.extend(sections.iter().map(Section::text));
    let out = results.join("report.md");
    files::write(&out, page.as_bytes())?;
    Ok((sections.len(), out))
}

/// The numbers and words of the paper beside ours, in the paper's order.
fn beside_paper(sections: &[Section]) -> String {
    let mut table = Table::new();
    table.set_header(["source", "paper", "ours", "verdict", "scene", "quantity"]);
    for row in sections.iter().flat_map(Section::paper) {
        let PaperRow { source, paper, ours, scene, quantity, .. } = row;
        table.add_row([source, paper, ours, &row.verdict.name(), scene, quantity]);
    }
    if table.is_empty() {
        return String::new();
    }
    let caption = "Ng & Trifonov (2003) beside ours. Their scenes are gone; ours are stand-ins. \
                   Costs are ratios to the greedy Müller–Fellner tree.";
    format!("\n{caption}\n\n{}\n", markdown(table))
}

fn markdown(mut table: Table) -> String {
    plain(&table.load_preset(presets::ASCII_MARKDOWN).to_string())
}

/// Text in which nothing is a tag.
fn plain(text: &str) -> String {
    text.replace('<', "&lt;")
}
