//! Lays out a figure: title, caption and legend above panels with aligned axes.

use super::canvas::{self, Align, Frame};
use super::legend::Legend;
use super::model::Figure;
use super::panel::Plot;
use super::style::{GREY, INK, Strokes};
use super::text::{self, BODY, TITLE};

/// Width of every figure in pixels.
const WIDTH: f64 = 680.0;
/// Width of the blank border.
const BORDER: f64 = 14.0;
/// Heights of plots in figures of 1 and 2 columns; plots of rows have their own.
const HEIGHTS: [f64; 2] = [340.0, 230.0];
/// Blank space to the right of each panel and below it.
const GUTTER: (f64, f64) = (16.0, 16.0);

/// Draws a figure as an SVG document.
///
/// Skips points that an axis cannot show: see [`Marks`](super::Marks).
pub fn svg(figure: &Figure) -> String {
    let strokes = Strokes::new(figure);
    let room = WIDTH - 2.0 * BORDER;
    let title = text::wrap(&figure.title, room, TITLE);
    let caption = text::wrap(&figure.caption, room, BODY);
    let below_title = BORDER + TITLE.line() * title.len() as f64;
    let below_caption = below_title + BODY.line() * caption.len() as f64 + 8.0;
    let legend = Legend::new(figure, &strokes, room);
    let (panels, height) = arrange(figure, below_caption + legend.height());
    canvas::svg(&figure.title, (WIDTH, height), |sheet| {
        sheet.lines((BORDER, BORDER), &title, TITLE, INK, Align::Left);
        sheet.lines((BORDER, below_title), &caption, BODY, GREY, Align::Left);
        legend.draw(sheet, (BORDER, below_caption));
        panels.iter().for_each(|(plot, frame)| plot.draw(sheet, *frame, &strokes));
    })
}

/// Finds places for the plots of all panels, below `top`. Returns them and the figure's height.
fn arrange<'a>(figure: &'a Figure, top: f64) -> (Vec<(Plot<'a>, Frame)>, f64) {
    let most = figure.columns.clamp(1, HEIGHTS.len()).min(figure.panels.len().max(1));
    // Labels next to the plots determine the width left for them, and with it the lines below.
    let side_by_side = |columns: usize| {
        let plot = |panel| Plot::new(panel, HEIGHTS[columns - 1]);
        let plots: Vec<Plot> = figure.panels.iter().map(plot).collect();
        let beside = plots.iter().map(|plot| plot.left).fold(0.0, f64::max);
        let column_width = (WIDTH - 2.0 * BORDER) / columns as f64;
        (columns, plots, beside, column_width)
    };
    let room = |beside: f64, column_width: f64| (column_width - beside - GUTTER.0).max(60.0);
    // Long names leave plots side by side too narrow.
    let (columns, mut plots, beside, column_width) = Some(side_by_side(most))
        .filter(|(_, _, beside, width)| room(*beside, *width) >= 0.5 * width)
        .unwrap_or_else(|| side_by_side(1));
    let width = room(beside, column_width);
    plots.iter_mut().for_each(|plot| plot.fit_width(width));
    for upper in 0..plots.len().saturating_sub(columns) {
        let (above, below) = plots.split_at_mut(upper + 1);
        above[upper].share_x_label(&below[columns - 1]);
    }
    let mut top = top;
    let mut placed: Vec<(Plot, Frame)> = Vec::new();
    while !plots.is_empty() {
        let row: Vec<Plot> = plots.drain(..columns.min(plots.len())).collect();
        let deepest = |depth: fn(&Plot) -> f64| row.iter().map(depth).fold(0.0, f64::max);
        let below = deepest(|plot| plot.height + plot.below);
        top += deepest(|plot| plot.above);
        for (column, plot) in row.into_iter().enumerate() {
            let left = BORDER + column_width * column as f64 + beside;
            let height = plot.height;
            placed.push((plot, Frame { left, top, width, height }));
        }
        top += below + GUTTER.1;
    }
    (placed, top)
}
