//! The chart engine: data series in, SVG out. It knows no BVH, no files and no clock.
//!
//! A [`Figure`] holds the data in data units. [`svg`] lays it out with the text widths
//! of DejaVu Sans. The same picture gives the same bytes on every machine.
//!
//! Figures are 680 pixels wide with text of 16 pixels and more, so that it can still be read where a
//! phone shows them 390 pixels wide. Series differ in colour and in dash or marker, so that they
//! survive printing in grey.

mod axis;
mod canvas;
mod figure;
mod layers;
mod legend;
mod model;
mod panel;
mod style;
mod text;

pub use axis::share_axes;
pub use figure::svg;
pub use model::{Axis, Figure, Hue, Layer, Marks, Panel, Scale, Unit};

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that have broken other charts.
    const NASTY: [f64; 12] = [
        0.0,
        -0.0,
        1.0,
        1.0 + f64::EPSILON,
        -3.5,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN,
        5e-324,
        1e14,
    ];

    /// One layer of each kind with all of `points`.
    fn all_layers(points: &[(f64, f64)]) -> Vec<Layer> {
        let bands = points.iter().map(|&(x, y)| (x, y, x)).collect();
        let (x, y) = points.first().copied().unwrap_or_default();
        let spans = points.iter().map(|&point| [point, (y, x)]).collect();
        vec![
            Layer::new("line", Marks::Line(points.to_vec())),
            Layer::new("points <&>", Marks::Points(points.to_vec())),
            Layer::new("", Marks::Band(bands)),
            Layer::new("spans", Marks::Spans(spans)),
            Layer::new("level", Marks::HLine(y)),
            Layer::new("upright", Marks::VLine(x)),
        ]
    }

    fn axes() -> Vec<Axis> {
        let names = |count: usize| (0..count).map(|i| format!("row {i}")).collect();
        vec![
            Axis::linear("x"),
            Axis::log(""),
            Axis::linear("very long label ".repeat(30)).range(f64::NAN, -1e300),
            Axis::log("x").range(2.0, 1.0),
            Axis::linear("x").range(0.5, 0.5),
            Axis::linear("").unit(Unit::Bare),
            Axis::linear("x").unit(Unit::Percent),
            Axis::rows(names(0), 20.0),
            Axis::rows(names(200), 20.0),
        ]
    }

    #[test]
    fn whatever_the_data_there_is_a_picture() {
        let mut data: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
        data.extend(NASTY.iter().map(|&value| vec![(value, value)]));
        data.push(NASTY.iter().flat_map(|&x| NASTY.iter().map(move |&y| (x, y))).collect());
        for points in data {
            for x in axes() {
                let panel = |(index, layer): (usize, Layer)| Panel {
                    title: "title ".repeat(index),
                    x: x.clone(),
                    y: axes().swap_remove(index),
                    layers: if index == 0 { all_layers(&points) } else { vec![layer] },
                };
                let panels = all_layers(&points).into_iter().enumerate().map(panel).collect();
                let figure = Figure { columns: points.len() % 6, panels, ..Figure::default() };
                let picture = svg(&figure);
                assert!(
                    !picture.contains("NaN") && !picture.contains("inf"),
                    "{points:?} on {x:?}"
                );
            }
        }
    }

    #[test]
    fn a_panel_without_anything_to_show_says_so() {
        let says = |layers: Vec<Layer>| {
            let panel =
                Panel { title: String::new(), x: Axis::log("x"), y: Axis::log("y"), layers };
            svg(&Figure { panels: vec![panel], ..Figure::default() }).contains("no data")
        };
        let line = |points| vec![Layer::new("", Marks::Line(points))];
        assert!(
            says(Vec::new()) && says(line(Vec::new())) && says(line(vec![(1.0, 0.0), (-1.0, 2.0)]))
        );
        assert!(!says(line(vec![(1.0, 2.0)])));
    }

    #[test]
    fn long_names_put_plots_below_each_other() {
        let height = |name: &str| -> f64 {
            let y = Axis::rows(vec![name.to_owned(); 4], 24.0);
            let layers = vec![Layer::new("", Marks::Points(vec![(1.0, 0.0)]))];
            let panels = vec![Panel { y, layers, ..Panel::default() }; 2];
            let picture = svg(&Figure { columns: 2, panels, ..Figure::default() });
            let (_, size) = picture.split_once("width=\"680\" height=\"").unwrap();
            size.split('"').next().unwrap().parse().unwrap()
        };
        assert!(height("Goldsmith–Salmon, rays") > 1.7 * height("greedy"));
    }

    #[test]
    fn names_cannot_break_the_svg() {
        let figure = Figure {
            title: "a < b & \u{0}c".to_owned(),
            caption: "<\u{1}>&\"".to_owned(),
            ..Figure::default()
        };
        let picture = svg(&figure);
        assert!(
            picture.contains("<title>a &lt; b &amp;  c</title>")
                && picture.contains("&lt; &gt;&amp;&quot;")
        );
    }
}
