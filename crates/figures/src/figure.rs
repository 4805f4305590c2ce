//! Lays out a figure: title, caption and legend above panels with aligned axes.

use super::canvas::{self, Align, Fault, Frame, Sheet};
use super::legend::Legend;
use super::model::{Figure, FigureError, Panel};
use super::panel::Plot;
use super::style::{GREY, INK, Strokes};
use super::text::{BODY, Fonts, TITLE};

/// Width of every figure in pixels.
const WIDTH: f64 = 800.0;
/// Width of the blank border.
const BORDER: f64 = 14.0;
/// Heights of plots in figures of 1, 2, 3 and 4 columns.
const HEIGHTS: [f64; 4] = [360.0, 240.0, 190.0, 150.0];
/// Blank space to the right of each panel and below it.
const GUTTER: (f64, f64) = (16.0, 16.0);

/// Title and caption.
#[derive(Default)]
struct Head {
    title: Vec<String>,
    caption: Vec<String>,
    /// Pixels from the top of the figure to the end of the caption.
    pub bottom: f64,
}

impl Head {
    pub fn new(title: &str, caption: &str, fonts: &Fonts) -> Self {
        let room = WIDTH - 2.0 * BORDER;
        let title = fonts.wrap(title, room, TITLE);
        let caption = fonts.wrap(caption, room, BODY);
        let lines = TITLE.line() * title.len() as f64 + BODY.line() * caption.len() as f64;
        Self { title, caption, bottom: BORDER + lines + 8.0 }
    }

    pub fn draw(&self, sheet: &Sheet) -> Result<(), Fault> {
        let below = BORDER + TITLE.line() * self.title.len() as f64;
        sheet.lines((BORDER, BORDER), &self.title, TITLE, INK, Align::Left)?;
        sheet.lines((BORDER, below), &self.caption, BODY, GREY, Align::Left)
    }
}

/// A figure with its layout.
struct Plan<'a> {
    head: Head,
    strokes: Strokes,
    legend: Legend,
    /// Each panel with the place of its plot.
    panels: Vec<(Plot<'a>, Frame)>,
    width: f64,
    height: f64,
}

/// Draws a figure as an SVG document.
pub(super) fn svg(figure: &Figure) -> Result<String, FigureError> {
    let fonts = Fonts::new()?;
    let strokes = Strokes::new(figure);
    let legend = Legend::new(figure, &strokes, WIDTH - 2.0 * BORDER, &fonts);
    let head = Head::new(&figure.title, &figure.caption, &fonts);
    let columns = figure.columns.clamp(1, HEIGHTS.len()).min(figure.panels.len().max(1));
    let size = (WIDTH, HEIGHTS[columns - 1]);
    Plan::new(head, strokes, legend, &figure.panels, columns, size, &fonts).svg(&figure.title)
}

impl<'a> Plan<'a> {
    /// Finds places for panels in columns, in a figure of this width with plots of this height.
    fn new(
        head: Head,
        strokes: Strokes,
        legend: Legend,
        panels: &'a [Panel],
        columns: usize,
        (whole, height): (f64, f64),
        fonts: &Fonts,
    ) -> Self {
        let room = whole - 2.0 * BORDER;
        // Labels next to the plots determine the width left for them, and with it the lines below.
        let mut plots: Vec<Plot> =
            panels.iter().map(|panel| Plot::new(panel, height, fonts)).collect();
        let beside = plots.iter().map(|plot| plot.left).fold(0.0, f64::max);
        let width = (room / columns as f64 - beside - GUTTER.0).max(60.0);
        plots.iter_mut().for_each(|plot| plot.fit_width(width, fonts));
        for upper in 0..plots.len().saturating_sub(columns) {
            let (above, below) = plots.split_at_mut(upper + 1);
            above[upper].share_x_label(&below[columns - 1]);
        }

        let mut top = head.bottom + legend.height() + if legend.height() > 0.0 { 8.0 } else { 0.0 };
        let mut panels: Vec<(Plot, Frame)> = Vec::new();
        while !plots.is_empty() {
            let row: Vec<Plot> = plots.drain(..columns.min(plots.len())).collect();
            let deepest = |depth: fn(&Plot) -> f64| row.iter().map(depth).fold(0.0, f64::max);
            let above = deepest(|plot| plot.above);
            let below = deepest(|plot| plot.below);
            top += above;
            for (column, plot) in row.into_iter().enumerate() {
                let left = BORDER + room / columns as f64 * column as f64 + beside;
                panels.push((plot, Frame { left, top, width, height }));
            }
            top += height + below + GUTTER.1;
        }
        Self { head, strokes, legend, panels, width: whole, height: top }
    }

    fn svg(&self, title: &str) -> Result<String, FigureError> {
        canvas::svg(title, (self.width, self.height), |sheet| self.draw(sheet))
    }

    fn draw(&self, sheet: &Sheet) -> Result<(), Fault> {
        self.head.draw(sheet)?;
        self.legend.draw(sheet, (BORDER, self.head.bottom))?;
        self.panels.iter().try_for_each(|(plot, frame)| plot.draw(sheet, *frame, &self.strokes))
    }
}
