//! The page as HTML: one file that needs neither scripts nor others, but leads to the files that it
//! was made from.

use super::{Drawing, Link, Section, Verdict};
use crate::report::output::Output;
use crate::run::provenance::Provenance;
use comfy_table::{Row, Table};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};

const STYLE: &str = include_str!("style.css");

/// The rule of the verdicts, for the reader.
const RULE: &str = "Every verdict is made from the rows. Where the paper has numbers, it is what all comparisons with \
    them that can be told have in common: they agree, are in the same direction, differ, or agree in part. Elsewhere it is \
    the sentence in which the first report reads its own numbers; where reports only list them, no verdict is stated. \
    Costs are ratios to the greedy Müller–Fellner tree of the same scene unless a table says otherwise. The paper is Ng & \
    Trifonov, Automatic Bounding Volume Hierarchy Generation Using Stochastic Search Methods (2003); its scenes are gone, \
    and stand-ins are called stand-ins.";

/// Text as it stands in HTML, between tags and in attributes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A name as it stands in a URL.
pub(super) fn reference(name: &str) -> String {
    // These are the unreserved characters of URLs (RFC 3986); all others are encoded.
    const KEPT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');
    utf8_percent_encode(name, KEPT).to_string()
}

/// The whole page.
pub(super) fn page(sections: &[Section]) -> String {
    let list = |title: &str, of_paper: bool| {
        let own: String =
            sections.iter().filter(|section| section.of_paper == of_paper).map(answer).collect();
        // A heading without entries would look like a fault of the page.
        if own.is_empty() {
            own
        } else {
            format!("<h2>{title}</h2>\n<ul class=\"answers\">{own}\n</ul>\n")
        }
    };
    format!(
        "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<meta name=\"color-scheme\" content=\"light dark\">
<title>BVH by stochastic search: results</title><style>{STYLE}</style></head>
<body>
<header id=\"answers\"><h1>BVH by stochastic search: results</h1></header>
<main>
{paper}{beyond}<p class=\"rule\">{rule}</p>
{experiments}
</main>
<footer><p>Made by harness {version} from the CSV files to which it leads.</p></footer></body></html>",
        paper = list("Compared with the paper’s numbers", true),
        beyond = list("Further questions", false),
        rule = escaped(RULE),
        experiments = sections.iter().map(experiment).collect::<String>(),
        version = env!("CARGO_PKG_VERSION"),
    )
}

/// An experiment in the list of answers: question, verdict and picture.
fn answer(section: &Section) -> String {
    let picture = match (&section.miniature, section.figures.first()) {
        (Some(small), _) => drawing(small).to_owned(),
        (None, Some(figure)) => {
            format!(
                "<svg viewBox=\"0 300 800 600\" role=\"img\"><use href=\"#{}\"/></svg>",
                figure_id(section, figure)
            )
        }
        (None, None) => "no figure".into(),
    };
    format!(
        "\n<li id=\"answer-{name}\"><div class=\"picture\">{picture}</div><div><h3><a href=\"#{name}\">{question}</a></h3>{verdict}<small>{title}</small></div></li>",
        title = escaped(&section.name),
        name = reference(&section.name),
        question = escaped(&section.question),
        verdict = verdict(&section.verdict),
    )
}

fn verdict(verdict: &Verdict) -> String {
    let (mark, text) = match verdict {
        Verdict::Paper(outcome, answer) => {
            let name = outcome.name();
            (
                format!("<strong class=\"{}\">{name}</strong> ", name.replace(' ', "-")),
                answer.clone(),
            )
        }
        Verdict::Reading(reading) => (String::new(), reading.clone()),
        Verdict::None => (String::new(), "No verdict is stated.".into()),
    };
    format!("<p class=\"verdict\">{mark}{}</p>", escaped(&text))
}

/// An experiment with all that belongs to it.
fn experiment(section: &Section) -> String {
    let name = reference(&section.name);
    let stand_ins = if section.stand_ins {
        "Scenes named as stand-ins are procedural stand-ins for the paper's."
    } else {
        ""
    };
    let shown: String = section.outputs.iter().map(|output| report(section, output)).collect();
    let is_of_a_report =
        |figure: &Drawing| section.outputs.iter().any(|output| has_drawn(output, figure));
    let others: String = section
        .figures
        .iter()
        .filter(|figure| !is_of_a_report(figure))
        .map(|drawn| figure(section, drawn))
        .collect();
    let Provenance { command, revision, rustc, cpu, threads, date, parts, .. } =
        &section.provenance;
    let [command, revision, rustc, cpu, date] =
        [command, revision, rustc, cpu, date].map(|text| escaped(text));
    let merged = if parts.is_empty() {
        String::new()
    } else {
        format!(", merged from {} parts", parts.len())
    };
    format!(
        "\n<section id=\"{name}\">\n<h2>{question}</h2>\n{verdict}
<p class=\"files\">{title}: {specs}. Rows: {tables}. {stand_ins} <a href=\"#answer-{name}\">All answers</a></p>{shown}{others}
<p class=\"provenance\"><code>{command}</code>, revision {revision}, {rustc}, {cpu}, {threads} thread(s), {date}{merged}</p>\n</section>",
        question = escaped(&section.question),
        verdict = verdict(&section.verdict),
        title = escaped(&section.name),
        specs = links(&section.specs),
        tables = links(&section.tables),
    )
}

fn links(links: &[Link]) -> String {
    let link =
        |link: &Link| format!("<a href=\"{}\">{}</a>", escaped(&link.to), escaped(&link.name));
    links.iter().map(link).collect::<Vec<_>>().join(", ")
}

/// One report: its reading, figures and tables.
fn report(section: &Section, output: &Output) -> String {
    let figures: String = section
        .figures
        .iter()
        .filter(|drawn| has_drawn(output, drawn))
        .map(|drawn| figure(section, drawn))
        .collect();
    let tables: String =
        output.tables.iter().map(|(explanation, rows)| table(explanation, rows)).collect();
    let reading = output.reading.trim();
    // The verdict above has said it already.
    let said = matches!(&section.verdict, Verdict::Reading(verdict) if verdict == reading);
    let reading = if reading.is_empty() || said {
        String::new()
    } else {
        format!("\n<p>{}</p>", escaped(reading))
    };
    format!("\n<h3>{}</h3>{reading}{figures}{tables}", escaped(&output.heading))
}

/// Returns true if the figure is one of the report.
fn has_drawn(output: &Output, figure: &Drawing) -> bool {
    output.figures.iter().any(|(name, _)| *name == figure.name)
}

fn figure_id(section: &Section, figure: &Drawing) -> String {
    format!("{}-figure-{}", reference(&section.name), reference(&figure.name))
}

fn figure(section: &Section, figure: &Drawing) -> String {
    let svg = drawing(&figure.svg).replacen(
        "<svg",
        &format!("<svg id=\"{}\"", figure_id(section, figure)),
        1,
    );
    format!(
        "\n<figure><div class=\"wide sheet\" tabindex=\"0\">{svg}</div><figcaption>{}</figcaption></figure>",
        links(&figure.files)
    )
}

/// Returns the drawing without the XML declaration that a separate file begins with.
fn drawing(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| &svg[start..])
}

/// Returns a table in a box that scrolls if the table is too wide or too long for the page. The
/// first cell of a row is its header.
fn table(explanation: &str, table: &Table) -> String {
    let cells = |row: &Row| row.cell_iter().map(|cell| cell.content()).collect::<Vec<String>>();
    let header = table.header().map(cells).unwrap_or_default();
    let header = header
        .iter()
        .map(|name| format!("<th scope=\"col\">{}</th>", escaped(&name.replace('_', " "))));
    let cell = |(at, text): (usize, &String)| match (at, is_number(text)) {
        (0, _) => format!("<th scope=\"row\">{}</th>", escaped(text)),
        (_, true) => format!("<td class=\"number\">{}</td>", escaped(text)),
        (_, false) => format!("<td>{}</td>", escaped(text)),
    };
    let row = |row: &Row| {
        format!("\n<tr>{}</tr>", cells(row).iter().enumerate().map(cell).collect::<String>())
    };
    format!(
        "\n<div class=\"wide\" tabindex=\"0\"><table><caption><span>{}</span></caption>\n<thead><tr>{}</tr></thead>\n<tbody>{}\n</tbody></table></div>",
        escaped(explanation.trim_end_matches(':')),
        header.collect::<String>(),
        table.row_iter().map(row).collect::<String>(),
    )
}

fn is_number(text: &str) -> bool {
    text.trim_end_matches(" %").trim_start_matches('+').parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::output::text_table;

    #[test]
    fn text_is_escaped_and_drawings_are_not() {
        let mut output = Output::new("", "Section <1>");
        let mut rows = text_table(["scene", "cost_over_base"]);
        rows.add_row(["<pre>", "+1.5 %"]);
        output.add_table("Table & more:", rows);
        let svg = "<?xml version=\"1.0\"?><svg width=\"1\"></svg>";
        let link = |name: &str| Link { name: name.into(), to: reference(name) };
        let section = Section {
            name: "x y".into(),
            question: "Is 1 < 2 & so on?".into(),
            verdict: Verdict::Reading("a < b".into()),
            stand_ins: true,
            of_paper: false,
            outputs: vec![output],
            figures: vec![Drawing {
                name: "f".into(),
                svg: svg.into(),
                files: vec![link("f&.svg")],
            }],
            miniature: None,
            specs: vec![],
            tables: vec![],
            provenance: Provenance { command: "harness a<b".into(), ..Provenance::gather() },
        };
        let page = page(&[section]);
        for part in [
            "1 &lt; 2 &amp; so",
            "a &lt; b",
            "a&lt;b",
            "Section &lt;1&gt;",
            "<section id=\"x%20y\">",
            "<svg id=\"x%20y-figure-f\" width=\"1\">",
            "<use href=\"#x%20y-figure-f\"/>",
            "<a href=\"f%26.svg\">f&amp;.svg</a>",
            "<caption><span>Table &amp; more</span></caption>",
            "<th scope=\"col\">cost over base</th>",
            "<th scope=\"row\">&lt;pre&gt;</th><td class=\"number\">+1.5 %</td>",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("<?xml") && !page.contains("<script"));
    }
}
