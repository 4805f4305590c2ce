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
    /// The medians of the tests over the pixels in which there is an object.
    pub medians: [f64; 2],
    /// The number of tests of the last colour.
    pub top: f64,
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
        for ((png, median), tree) in self.heat.iter().zip(self.medians).zip(["baked", "greedy"]) {
            let median = number(median);
            let caption =
                format!("Tests of each pixel's rays in the {tree} tree: median {median}.");
            heat += &picture(png, &caption);
        }
        let top = number(self.top);
        let colours: Vec<String> =
            heat::INFERNO.iter().map(|[r, g, b]| format!("rgb({r} {g} {b})")).collect();
        let colours = colours.join(", ");
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
<span class=\"key greedy\"></span> the greedy Müller–Fellner tree, a plain build</p>
{table}
<p>Less is better, but depth and nodes are no costs. A tree baked for the wide layout saves tests there, and not always in the binary
tree.</p>
<h2>Rays</h2>
<div class=\"pictures\">{scene}{heat}</div>
<div class=\"scale\" style=\"background: linear-gradient(to right, {colours})\"></div>
<p class=\"ends\"><span>0 tests</span><span>{top} or more, in one pixel of 200</span></p>
<p>Medians are over the pixels in which there is an object.</p>
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

/// Draws one pair of bars per level, in a picture of 720 × 240 units.
fn chart(levels: &[Vec<f64>; 2]) -> String {
    const LEFT: f64 = 48.0;
    const WIDTH: f64 = 672.0;
    const BASE: f64 = 190.0;
    /// The room above the axis, for the upper half of its last number.
    const ABOVE: f64 = 12.0;
    let count = levels[0].len().max(levels[1].len()).max(1);
    let most = levels.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let tick = tick(most);
    let height = |area: f64| (BASE - ABOVE) * area / (tick * (most / tick).ceil());
    let mut text =
        String::from("<svg viewBox=\"0 0 720 240\" role=\"img\" aria-label=\"By level\">\n");
    let mut add = |line: String| text.extend([&line, "\n"]);
    for step in 0..=(most / tick).ceil() as u32 {
        let value = tick * f64::from(step);
        let y = BASE - height(value);
        let shown = number(value);
        add(format!(
            "<line x1=\"{LEFT}\" x2=\"720\" y1=\"{y:.2}\" y2=\"{y:.2}\"/>\
             <text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">{shown}</text>",
            LEFT - 6.0,
            y + 4.0
        ));
    }
    let step = WIDTH / count as f64;
    for (tree, class) in [(0, "baked"), (1, "greedy")] {
        for (depth, &area) in levels[tree].iter().enumerate() {
            let bar = height(area);
            let x = LEFT + step * (depth as f64 + 0.1 + 0.4 * tree as f64);
            let shown = number(area);
            add(format!(
                "<rect class=\"{class}\" x=\"{x:.2}\" y=\"{:.2}\" width=\"{:.2}\" \
                 height=\"{bar:.2}\"><title>depth {depth}: {shown}</title></rect>",
                BASE - bar,
                0.38 * step
            ));
        }
    }
    // Labels of ten levels or fewer have room on a phone.
    for depth in (0..count).step_by(count.div_ceil(10)) {
        let x = LEFT + step * (depth as f64 + 0.5);
        add(format!(
            "<text x=\"{x:.2}\" y=\"{}\" text-anchor=\"middle\">{depth}</text>",
            BASE + 20.0
        ));
    }
    add(format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">depth</text>",
        LEFT + WIDTH / 2.0,
        BASE + 42.0
    ));
    text + "</svg>"
}

/// Returns the distance of two to five ticks up to `most`: 1, 2 or 5 times a power of ten.
fn tick(most: f64) -> f64 {
    let power = 10f64.powf((most / 2.0).log10().floor());
    let factor = [5.0, 2.0].into_iter().find(|factor| factor * power <= most / 2.0);
    power * factor.unwrap_or(1.0)
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
            levels: [vec![1.0], vec![]],
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

    #[test]
    fn an_axis_has_two_to_five_ticks_up_to_the_most() {
        for (most, expected) in [(1.1, 0.5), (1.9, 0.5), (2.1, 1.0), (3.9, 1.0), (4.1, 2.0)] {
            for scale in [1e-9, 1.0, 1e6] {
                let found = tick(most * scale) / scale;
                assert!((found / expected - 1.0).abs() < 1e-9, "{most} × {scale}: {found}");
            }
        }
    }
}
