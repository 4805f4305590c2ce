//! The page as HTML: one file without scripts, with its pictures inside.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;

const STYLE: &str = include_str!("style.css");
/// The size of a chart, and the height of the part above its labels, in its own units.
const CHART: (f64, f64, f64) = (720.0, 220.0, 180.0);

/// A fact about both trees.
pub struct Row {
    pub name: &'static str,
    pub baked: f64,
    pub greedy: f64,
}

/// The tests of each pixel's rays in a tree.
pub struct Heat {
    /// The heat map, a PNG file.
    pub png: Vec<u8>,
    /// The median over the pixels.
    pub median: f64,
    /// The largest number of a pixel.
    pub most: f64,
}

/// The contents of a page. Pairs begin with the baked tree, and the greedy tree follows.
pub struct Page<'a> {
    pub title: &'a str,
    pub origin: String,
    pub rows: Vec<Row>,
    /// A picture of the scene, a PNG file.
    pub scene: Vec<u8>,
    /// The heat of both trees under one scale.
    pub heat: [Heat; 2],
    /// The area of the inner nodes at each depth, over the root's.
    pub levels: [Vec<f64>; 2],
}

impl Page<'_> {
    /// Returns the text of the page.
    pub fn html(&self) -> String {
        let title = escaped(self.title);
        let origin = escaped(&self.origin);
        let table = self.table();
        let scene = picture(&self.scene, "The scene.");
        let mut heat = String::new();
        for (Heat { png, median, most }, tree) in self.heat.iter().zip(["baked", "greedy"]) {
            let caption = format!(
                "Tests of each pixel's rays in the {tree} tree: median {median:.0}, most {most:.0}."
            );
            heat += &picture(png, &caption);
        }
        let area = chart(&self.levels);
        let version = env!("CARGO_PKG_VERSION");
        format!(
            "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>{title}</title><style>{STYLE}</style></head>
<body>
<h1>{title}</h1>
<p>{origin}</p>
<p><span class=\"key baked\"></span> the baked tree
<span class=\"key greedy\"></span> the greedy Müller–Fellner tree, a library's plain build</p>
{table}
<p>Less is better. A tree baked for the wide layout saves tests there, and not always in the binary
tree.</p>
<h2>Rays</h2>
<div class=\"pictures\">{scene}{heat}</div>
<h2>Cost by level</h2>
<p>The area of the inner nodes at each depth over the root's area: how many of them a random line
visits.</p>
{area}
<footer><p>Written by bvh {version}.</p></footer>
</body></html>
"
        )
    }

    fn table(&self) -> String {
        let mut text = String::from(
            "<table>\n<tr><th></th><th>baked</th><th>greedy</th><th>difference</th></tr>\n",
        );
        for Row { name, baked, greedy } in &self.rows {
            let difference = if *greedy > 0.0 {
                // A hyphen would be shorter than the plus.
                format!("{:+.1} %", 100.0 * (baked / greedy - 1.0)).replace('-', "−")
            } else {
                String::new()
            };
            let baked = number(*baked);
            let greedy = number(*greedy);
            text += &format!(
                "<tr><td>{name}</td><td>{baked}</td><td>{greedy}</td><td>{difference}</td></tr>\n"
            );
        }
        text + "</table>"
    }
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.2}") }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn picture(png: &[u8], caption: &str) -> String {
    let data = STANDARD.encode(png);
    format!(
        "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\">\
         <figcaption>{caption}</figcaption></figure>\n"
    )
}

/// Draws one pair of bars per level.
fn chart(levels: &[Vec<f64>; 2]) -> String {
    let (width, height, base) = CHART;
    let count = levels[0].len().max(levels[1].len()).max(1);
    let most = levels.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let step = width / count as f64;
    let mut text =
        format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"By level\">\n");
    for (tree, class) in [(0, "baked"), (1, "greedy")] {
        for (depth, &area) in levels[tree].iter().enumerate() {
            let bar = base * area / most;
            let x = step * (depth as f64 + 0.1 + 0.4 * tree as f64);
            let y = base - bar;
            let breadth = 0.38 * step;
            let shown = number(area);
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "<rect class=\"{class}\" x=\"{x:.2}\" y=\"{y:.2}\" width=\"{breadth:.2}\" \
                 height=\"{bar:.2}\"><title>depth {depth}: {shown}</title></rect>"
            );
        }
    }
    // Labels of ten levels or fewer have room on a phone.
    let every = count.div_ceil(10);
    for depth in (0..count).step_by(every) {
        let x = step * (depth as f64 + 0.5);
        let y = base + 20.0;
        let _ =
            writeln!(text, "<text x=\"{x:.2}\" y=\"{y}\" text-anchor=\"middle\">{depth}</text>");
    }
    let _ = writeln!(text, "<text x=\"0\" y=\"10\">{}</text>", number(most));
    let _ = writeln!(
        text,
        "<text x=\"{:.2}\" y=\"{}\" text-anchor=\"middle\">depth</text>",
        width / 2.0,
        base + 40.0
    );
    text + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_escapes_names_and_refers_to_no_other_file() {
        let page = Page {
            title: "<b> & co",
            origin: "2 objects".into(),
            rows: vec![Row { name: "Depth", baked: 1.0, greedy: 2.0 }],
            scene: vec![1, 2, 3],
            heat: [4, 5].map(|byte| Heat { png: vec![byte], median: 1.0, most: 2.0 }),
            levels: [vec![1.0], vec![]],
        };
        let html = page.html();
        assert!(html.contains("<h1>&lt;b&gt; &amp; co</h1>"), "{html}");
        assert!(html.contains("<td>1</td><td>2</td><td>−50.0 %</td>"), "{html}");
        assert_eq!(html.matches("data:image/png;base64,").count(), 3);
        assert!(!html.contains("http") && !html.contains("<script"), "{html}");
    }
}
