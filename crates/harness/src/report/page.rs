//! All results on one page: a self-contained HTML file that needs neither scripts nor other files.

use super::TEXT_FILE;
use crate::Error;
use crate::files;
use crate::run::provenance::Provenance;
use crate::run::resolved::Resolved;
use crate::scenes::SceneKind;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::Path;

const STYLE: &str = "
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; background: #fff; max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.3rem; margin-top: 3rem; border-top: 1px solid #d0d7de; padding-top: 1rem; }
nav ul { columns: 3; padding-left: 1.2rem; }
.reading { border-left: 4px solid #0969da; padding-left: .8rem; }
pre { font-size: .75rem; line-height: 1.25; overflow-x: auto; background: #f6f8fa; padding: .6rem; }
figure { margin: 1rem 0; } figure svg { max-width: 100%; height: auto; }
footer, .provenance { color: #57606a; font-size: .8rem; }
";

/// One experiment's folder, as read.
struct Section {
    name: String,
    question: String,
    stand_ins: bool,
    /// What the reports printed.
    text: String,
    /// Whether it reproduces something of the paper's.
    of_paper: bool,
    /// Name and SVG text.
    figures: Vec<(String, String)>,
    provenance: Provenance,
}

/// Writes a page of all finished experiments in `results` to `out`, without quick variants and the repetitions that lie
/// beside others. Returns the number of experiments.
pub fn write(results: &Path, out: &Path) -> Result<usize, Error> {
    let mut names = Vec::new();
    for entry in fs::read_dir(results).map_err(Error::io(results, "read the folder"))? {
        let entry = entry.map_err(Error::io(results, "read the folder"))?;
        if entry.path().join("resolved.toml").is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    let repeats =
        |name: &String| name.strip_suffix(".new").is_some_and(|kept| names.iter().any(|name| name == kept));
    let mut sections = names
        .iter()
        .filter(|name| !repeats(name))
        .map(|name| section(results, name))
        .collect::<Result<Vec<_>, _>>()?;
    if sections.is_empty() {
        return Err(Error::Usage(format!(
            "{} holds no finished experiment; accepted: the --out of one",
            results.display()
        )));
    }
    // What the paper has comes first.
    sections.sort_by(|a, b| (!a.of_paper, &a.name).cmp(&(!b.of_paper, &b.name)));
    files::write(out, page(&sections).as_bytes())?;
    Ok(sections.len())
}

/// Reads what an experiment has written. Nothing is computed again.
fn section(results: &Path, name: &str) -> Result<Section, Error> {
    let folder = results.join(name);
    let resolved: Resolved = read_toml(&folder.join("resolved.toml"))?;
    let provenance = read_toml(&folder.join("provenance.toml"))?;
    let mut figures = Vec::new();
    for entry in fs::read_dir(&folder).map_err(Error::io(&folder, "read the folder"))?.flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|extension| extension == "svg") {
            figures.push((entry.file_name().to_string_lossy().into_owned(), read(&path)?));
        }
    }
    figures.sort();
    let text = folder.join(TEXT_FILE);
    Ok(Section {
        name: name.into(),
        question: resolved.experiment.question,
        stand_ins: resolved.scenes.iter().any(|scene| scene.kind == SceneKind::StandIn.to_string()),
        text: if text.is_file() { read(&text)? } else { String::new() },
        of_paper: folder.join("paper.csv").is_file(),
        figures,
        provenance,
    })
}

fn read(path: &Path) -> Result<String, Error> {
    fs::read_to_string(path).map_err(Error::io(path, "read the file"))
}

fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    toml::from_str(&read(path)?).map_err(Error::toml(path))
}

/// Text as it stands in HTML, between tags and in attributes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn page(sections: &[Section]) -> String {
    let link = |section: &Section| format!("<li><a href=\"#{0}\">{0}</a></li>", escaped(&section.name));
    format!(
        "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>BVH by stochastic search: results</title><style>{STYLE}</style></head>
<body><h1>BVH by stochastic search: results</h1>
<p>Costs are ratios to the greedy Müller–Fellner tree of the same scene unless a table says otherwise. The paper is Ng &amp; \
         Trifonov, Automatic Bounding Volume Hierarchy Generation Using Stochastic Search Methods (2003); its scenes are gone, and \
         stand-ins are called stand-ins.</p>
<nav><ul>{links}</ul></nav>{experiments}
<footer><p>Made by harness {version} from the CSV files beside it.</p></footer></body></html>",
        links = sections.iter().map(link).collect::<String>(),
        experiments = sections.iter().map(experiment).collect::<String>(),
        version = env!("CARGO_PKG_VERSION"),
    )
}

fn experiment(section: &Section) -> String {
    let name = escaped(&section.name);
    let mut html = format!("\n<section id=\"{name}\"><h2>{name}</h2>");
    html += &format!("<p><strong>{}</strong></p>", escaped(&section.question));
    if section.stand_ins {
        html += "<p>Scenes named as stand-ins are procedural stand-ins for the paper's.</p>";
    }
    for (stem, svg) in &section.figures {
        html += &format!("<figure id=\"{name}-{}\">{}</figure>", escaped(stem), drawing(svg));
    }
    for block in section.text.split("\n\n").filter(|block| !block.is_empty()) {
        let (begin, end) =
            if block.contains('\n') { ("<pre>", "</pre>") } else { ("<p class=\"reading\">", "</p>") };
        html += &format!("{begin}{}{end}", escaped(block));
    }
    let Provenance { command, revision, rustc, cpu, threads, date, parts, .. } = &section.provenance;
    let [command, revision, rustc, cpu, date] = [command, revision, rustc, cpu, date].map(|text| escaped(text));
    let merged = if parts.is_empty() { String::new() } else { format!(", merged from {} parts", parts.len()) };
    html + &format!(
        "<p class=\"provenance\"><code>{command}</code>, revision {revision}, {rustc}, {cpu}, {threads} thread(s), \
         {date}{merged}</p></section>"
    )
}

/// The drawing without what may stand before it in a file of its own.
fn drawing(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| &svg[start..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_and_drawings_are_not() {
        let provenance = Provenance { command: "harness a<b".into(), ..Provenance::gather() };
        let section = Section {
            name: "x".into(),
            question: "Is 1 < 2 & so on?".into(),
            stand_ins: true,
            text: "first\n\nsecond\n\nTable:\n<pre>\n\n".into(),
            of_paper: false,
            figures: vec![("f".into(), "<?xml version=\"1.0\"?><svg width=\"1\"></svg>".into())],
            provenance,
        };
        let page = page(&[section]);
        for part in [
            "1 &lt; 2 &amp; so",
            "<pre>Table:\n&lt;pre&gt;</pre>",
            "a&lt;b",
            "<svg width=\"1\">",
            "<p class=\"reading\">second</p>",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("<?xml") && !page.contains("<script"));
    }
}
