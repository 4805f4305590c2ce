//! Lays a figure out: title, caption and legend above panels whose axes line up.

use plotters::prelude::DrawingBackend;

use super::canvas::{Align, Fault, Frame, Layout, Picture, Sheet};
use super::legend::Legend;
use super::model::{Figure, FigureError};
use super::panel::Plot;
use super::style::{GREY, INK, Strokes};
use super::text::{BODY, Fonts, TITLE};

/// Width of every figure in pixels.
pub(super) const WIDTH: f64 = 800.0;
/// Blank border.
pub(super) const BORDER: f64 = 14.0;
/// Heights of plots in 1, 2, 3 and 4 columns.
const HEIGHTS: [f64; 4] = [360.0, 240.0, 190.0, 150.0];
/// Blank to the right of and below each panel.
const GUTTER: (f64, f64) = (16.0, 16.0);

/// Title and caption.
pub(super) struct Head {
    title: Vec<String>,
    caption: Vec<String>,
    /// Pixels from the top of the figure to the end of the caption.
    pub bottom: f64,
}

impl Head {
    pub fn new(title: &str, caption: &str, fonts: &Fonts) -> Self {
        let room = WIDTH - 2.0 * BORDER;
        let (title, caption) = (fonts.wrap(title, room, TITLE), fonts.wrap(caption, room, BODY));
        let lines = TITLE.line() * title.len() as f64 + BODY.line() * caption.len() as f64;
        Self { title, caption, bottom: BORDER + lines + 8.0 }
    }

    pub fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
        let below = BORDER + TITLE.line() * self.title.len() as f64;
        sheet.lines((BORDER, BORDER), &self.title, TITLE, INK, Align::Left)?;
        sheet.lines((BORDER, below), &self.caption, BODY, GREY, Align::Left)
    }
}

/// A figure with a place for everything.
struct Plan<'a> {
    head: Head,
    strokes: Strokes,
    legend: Legend,
    /// Each panel with the place of its plot.
    panels: Vec<(Plot<'a>, Frame)>,
    height: f64,
}

impl Picture for Figure {
    fn title(&self) -> &str {
        &self.title
    }

    fn lay_out<'a>(&'a self, fonts: &'a Fonts) -> Result<impl Layout + 'a, FigureError> {
        let strokes = Strokes::new(self);
        let room = WIDTH - 2.0 * BORDER;
        let legend = Legend::new(self, &strokes, room, fonts);
        let head = Head::new(&self.title, &self.caption, fonts);
        let columns = self.columns.clamp(1, HEIGHTS.len()).min(self.panels.len().max(1));
        let height = HEIGHTS[columns - 1];

        // What stands beside the plots leaves their width, and that decides on what stands below them.
        let mut plots: Vec<Plot> = self.panels.iter().map(|panel| Plot::new(panel, height, fonts)).collect();
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
            let (above, below) = (deepest(|plot| plot.above), deepest(|plot| plot.below));
            top += above;
            for (column, plot) in row.into_iter().enumerate() {
                let left = BORDER + room / columns as f64 * column as f64 + beside;
                panels.push((plot, Frame { left, top, width, height }));
            }
            top += height + below + GUTTER.1;
        }
        Ok(Plan { head, strokes, legend, panels, height: top })
    }
}

impl Layout for Plan<'_> {
    fn size(&self) -> (f64, f64) {
        (WIDTH, self.height)
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
        self.head.draw(sheet)?;
        self.legend.draw(sheet, (BORDER, self.head.bottom))?;
        self.panels.iter().try_for_each(|(plot, frame)| plot.draw(sheet, *frame, &self.strokes))
    }
}
