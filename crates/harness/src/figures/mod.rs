//! The chart engine: data series in, an SVG and the PNG made from it out; no files, no clock.
//!
//! A [`Figure`] says what is shown, in data units. [`svg`] lays it out and draws it with plotters;
//! [`png()`] rasterises the very same SVG with fonts that are part of the program. The same figure gives
//! the same bytes of SVG on every machine, and the same bytes of PNG on machines of the same
//! processor architecture.
//!
//! Figures are 800 pixels wide with text of 12 pixels and more, as a README shows them. Series differ in
//! colour (Okabe and Ito's palette) and in dash or marker, so that they survive printing in grey.

mod canvas;
mod figure;
mod heatmap;
mod label;
mod legend;
mod marks;
mod model;
mod plot;
mod raster;
mod scale;
mod side;
mod style;
mod text;

pub use model::{Axis, Cell, ChartError, Figure, HeatMap, Key, Layer, Look, Panel, Scale};
pub use raster::{PNG_SCALE, png};

/// Draws a figure as an SVG document.
///
/// Degenerate data are drawn as far as they make sense: see [`Layer`].
///
/// # Errors
/// [`ChartError::Draw`] if plotters refuses, [`ChartError::Font`] if the embedded fonts are damaged.
pub fn svg(chart: &Figure) -> Result<String, ChartError> {
    let ruler = text::Ruler::new()?;
    figure::draw(chart, &ruler)
        .map_err(|fault| ChartError::Draw { title: chart.title.clone(), reason: fault.to_string() })
}

/// Draws a heat map as an SVG document, wider than other figures if the texts in the cells need it.
///
/// # Errors
/// [`ChartError::CellCount`] unless there is one cell for every row and column; otherwise as [`svg`].
pub fn heatmap_svg(map: &HeatMap) -> Result<String, ChartError> {
    let (rows, columns, cells) = (map.rows.len(), map.columns.len(), map.cells.len());
    if rows.checked_mul(columns) != Some(cells) {
        return Err(ChartError::CellCount { title: map.title.clone(), rows, columns, cells });
    }
    let ruler = text::Ruler::new()?;
    heatmap::draw(map, &ruler)
        .map_err(|fault| ChartError::Draw { title: map.title.clone(), reason: fault.to_string() })
}

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
        let name = |text: &str| text.to_owned();
        let bands = || points.iter().map(|&(x, y)| (x, y, x)).collect();
        let (x, y) = points.first().copied().unwrap_or_default();
        vec![
            Layer::Line { name: name("line"), points: points.to_vec() },
            Layer::Steps { name: name("steps"), points: points.to_vec() },
            Layer::Points { name: name("points <&>"), points: points.to_vec() },
            Layer::Band { name: name(""), points: bands() },
            Layer::StepBand { name: name("steps"), points: bands() },
            Layer::ErrorBars {
                name: name("bars"),
                points: points.iter().map(|&(x, y)| (x, y, y, x)).collect(),
            },
            Layer::Bars {
                name: name("bars"),
                values: points.iter().map(|point| point.1).collect(),
                spread: points.to_vec(),
                base: x,
            },
            Layer::HLine { y, label: name("level") },
            Layer::VLine { x, label: name("upright") },
            Layer::Note { x, y, text: "a rather long note ".repeat(20) },
        ]
    }

    fn axes() -> Vec<Axis> {
        let names = |count: usize| (0..count).map(|i| format!("category {i}")).collect();
        vec![
            Axis::linear("x"),
            Axis::log(""),
            Axis::linear("very long label ".repeat(30)).range(f64::NAN, -1e300),
            Axis::log("x").range(2.0, 1.0),
            Axis::linear("x").range(0.5, 0.5),
            Axis::categories("x", names(0)),
            Axis::categories("x", names(200)),
        ]
    }

    #[test]
    fn whatever_the_data_there_is_a_picture() {
        let mut data: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
        data.extend(NASTY.iter().map(|&value| vec![(value, value)]));
        data.push(NASTY.iter().flat_map(|&x| NASTY.iter().map(move |&y| (x, y))).collect());
        for points in data {
            for (kind, x) in axes().into_iter().enumerate() {
                let panel = |(index, layer): (usize, Layer)| Panel {
                    title: "title ".repeat(index),
                    x: x.clone(),
                    y: axes().swap_remove(index % 5),
                    layers: if index == 0 { all_layers(&points) } else { vec![layer] },
                };
                let panels = all_layers(&points).into_iter().enumerate().map(panel).collect();
                let figure = Figure { columns: points.len() % 6, panels, ..Figure::default() };
                let picture = svg(&figure).unwrap();
                assert!(!picture.contains("NaN") && !picture.contains("inf"), "{points:?} on {x:?}");
                if points.len() > 1 && kind == 0 {
                    png(&picture).unwrap();
                }
            }
        }
        png(&svg(&Figure::default()).unwrap()).unwrap();
    }

    #[test]
    fn a_panel_without_anything_to_show_says_so() {
        let says = |layers: Vec<Layer>| {
            let panel = Panel { title: String::new(), x: Axis::log("x"), y: Axis::log("y"), layers };
            svg(&Figure { panels: vec![panel], ..Figure::default() }).unwrap().contains("no data")
        };
        let line = |points| vec![Layer::Line { name: String::new(), points }];
        assert!(says(Vec::new()) && says(line(Vec::new())) && says(line(vec![(1.0, 0.0), (-1.0, 2.0)])));
        assert!(!says(line(vec![(1.0, 2.0)])));
    }

    #[test]
    fn the_same_figure_gives_the_same_bytes() {
        let points: Vec<(f64, f64)> = (0..50).map(|i| (f64::from(i), f64::from(i * i % 17))).collect();
        let panel = Panel {
            title: "t".to_owned(),
            x: Axis::linear("x"),
            y: Axis::log("y"),
            layers: all_layers(&points),
        };
        let figure = Figure { columns: 2, panels: vec![panel; 3], ..Figure::default() };
        let (one, other) = (svg(&figure).unwrap(), svg(&figure.clone()).unwrap());
        assert_eq!(one, other);
        assert_eq!(png(&one).unwrap(), png(&other).unwrap());
    }

    #[test]
    fn coordinates_have_at_most_one_decimal() {
        let points: Vec<(f64, f64)> = (0..50).map(|i| (f64::from(i) / 7.0, f64::from(i) / 3.0)).collect();
        let panel = Panel {
            title: "t".to_owned(),
            x: Axis::linear("x"),
            y: Axis::linear("y"),
            layers: all_layers(&points),
        };
        let picture = svg(&Figure { panels: vec![panel], ..Figure::default() }).unwrap();
        let numbers = picture.split(['"', ' ', ',', '\n', '<', '>']).filter(|text| text.parse::<f64>().is_ok());
        let decimals = |number: &str| number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        assert!(numbers.clone().count() > 100);
        assert!(
            numbers.clone().all(|number| decimals(number) <= 1),
            "{:?}",
            numbers.max_by_key(|n| decimals(n))
        );
    }

    #[test]
    fn a_heat_map_of_any_values_is_drawn() {
        for key in [
            Key::Classes(Vec::new()),
            Key::Classes(vec!["good".to_owned(), "bad".to_owned()]),
            Key::Numbers { axis: Axis::log("x"), middle: Some(0.0) },
            Key::Numbers { axis: Axis::linear("x"), middle: Some(1.0) },
            Key::Numbers { axis: Axis::linear("x").range(0.0, 1.0), middle: None },
        ] {
            for (rows, columns) in [(0, 0), (0, 3), (3, 0), (1, NASTY.len()), (NASTY.len(), 1)] {
                let value = |i: usize| NASTY.get(i).copied().unwrap_or_default();
                let cell = |i: usize| Cell { value: value(i), text: "text ".repeat(i) };
                let map = HeatMap {
                    title: "a heat map".to_owned(),
                    caption: String::new(),
                    row_label: "row".to_owned(),
                    column_label: "column".to_owned(),
                    rows: (0..rows).map(|i| "long name ".repeat(i)).collect(),
                    columns: (0..columns).map(|i| "name ".repeat(i)).collect(),
                    cells: (0..rows * columns).map(cell).collect(),
                    key: key.clone(),
                };
                let picture = heatmap_svg(&map).unwrap();
                assert!(!picture.contains("NaN"), "{picture}");
                png(&picture).unwrap();
                let missing =
                    HeatMap { rows: vec![String::new(); rows + 1], columns: vec![String::new(); 2], ..map };
                assert!(
                    matches!(heatmap_svg(&missing), Err(ChartError::CellCount { .. })) || rows + 1 == columns
                );
            }
        }
    }
}
