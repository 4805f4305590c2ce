//! The page as HTML: one file without scripts, with its pictures inside.

use crate::answer::{short, whole};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bvh_scenes::render::heat;

const STYLE: &str = include_str!("style.css");

/// A fact about both trees.
pub struct Row {
    pub name: &'static str,
    pub baked: f64,
    pub greedy: f64,
    /// True if less is better.
    pub is_cost: bool,
}

/// The contents of a page. Pairs begin with the baked tree, and the greedy tree follows.
pub struct Page<'a> {
    pub title: &'a str,
    pub origin: String,
    pub rows: Vec<Row>,
    /// A picture of the scene, a PNG file.
    pub scene: Vec<u8>,
    /// The tests of each pixel's rays as colours, PNG files.
    pub heat: [Vec<u8>; 2],
    /// The medians of the tests over the pixels whose rays meet the box of the scene.
    pub medians: [f64; 2],
    /// The number of tests of the last colour.
    pub top: f64,
}

impl Page<'_> {
    /// Returns the text of the page.
    pub fn html(&self) -> String {
        let title = escaped(self.title);
        let origin = escaped(&self.origin);
        let table = self.table();
        let scene = picture(&self.scene, "The scene.");
        let mut heat = String::new();
        for ((png, median), tree) in self.heat.iter().zip(self.medians).zip(["baked", "greedy"]) {
            let median = number(median);
            let caption =
                format!("Tests of each pixel's rays in the {tree} tree: median {median}.");
            heat += &picture(png, &caption);
        }
        let top = number(self.top);
        let colours: Vec<String> =
            heat::scale(17).iter().map(|[r, g, b]| format!("rgb({r} {g} {b})")).collect();
        let colours = colours.join(", ");
        let version = env!("CARGO_PKG_VERSION");
        format!(
            "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>{title}</title><style>{STYLE}</style></head>
<body>
<h1>{title}</h1>
<p>{origin}</p>
{table}
<p>The greedy tree is a plain build, as by Müller and Fellner. Less is better, but depth and nodes
are no costs. A tree baked for the wide layout saves tests there, and not always in the binary
tree.</p>
<h2>Rays</h2>
<div class=\"pictures\">{scene}{heat}</div>
<div class=\"scale\" style=\"background: linear-gradient(to right, {colours})\"></div>
<p class=\"ends\"><span>0 tests</span><span>{top} or more, in one pixel of 200</span></p>
<p>Medians are over the pixels whose rays meet the box of the scene.</p>
<footer><p>Written by bvh {version}.</p></footer>
</body></html>
"
        )
    }

    fn table(&self) -> String {
        let mut text = String::from(
            "<table>\n<tr><th></th><th>baked</th><th>greedy</th><th>difference</th></tr>\n",
        );
        for Row { name, baked, greedy, is_cost } in &self.rows {
            let difference = if *is_cost && *greedy > 0.0 {
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
    if value.fract() == 0.0 && value >= 0.0 { whole(value as u64) } else { short(value) }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_escapes_names_and_refers_to_no_other_file() {
        let page = Page {
            title: "<b> & co",
            origin: "2 objects".into(),
            rows: [true, false]
                .map(|is_cost| Row { name: "r", baked: 1.0, greedy: 2.0, is_cost })
                .into(),
            scene: vec![1, 2, 3],
            heat: [vec![4], vec![5]],
            medians: [1.0, 2.0],
            top: 1234.0,
        };
        let html = page.html();
        assert!(html.contains("<h1>&lt;b&gt; &amp; co</h1>"), "{html}");
        for difference in ["−50.0 %", ""] {
            assert!(html.contains(&format!("<td>1</td><td>2</td><td>{difference}</td>")), "{html}");
        }
        assert!(html.contains("1 234 or more"), "{html}");
        assert_eq!(html.matches("data:image/png;base64,").count(), 3);
        assert!(!html.contains("http") && !html.contains("<script"), "{html}");
    }
}
