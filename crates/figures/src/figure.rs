//! Lays out a figure: title, caption and legend above panels with aligned axes.

use plotters::prelude::DrawingBackend;

use super::canvas::{Align, Fault, Frame, Layout, Picture, Sheet};
use super::legend::Legend;
use super::model::{Axis, Figure, FigureError, Panel, Scale};
use super::panel::Plot;
use super::style::{GREY, INK, Strokes};
use super::text::{BODY, Fonts, TITLE};

/// Width of every figure in pixels.
pub(super) const WIDTH: f64 = 800.0;
/// Width of a miniature, and the height of its plot.
const MINIATURE: (f64, f64) = (240.0, 110.0);
/// Width of the blank border.
pub(super) const BORDER: f64 = 14.0;
/// Heights of plots in figures of 1, 2, 3 and 4 columns.
const HEIGHTS: [f64; 4] = [360.0, 240.0, 190.0, 150.0];
/// Blank space to the right of each panel and below it.
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
        let title = fonts.wrap(title, room, TITLE);
        let caption = fonts.wrap(caption, room, BODY);
        let lines = TITLE.line() * title.len() as f64 + BODY.line() * caption.len() as f64;
        Self { title, caption, bottom: BORDER + lines + 8.0 }
    }

    pub fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
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

impl Picture for Figure {
    fn title(&self) -> &str {
        &self.title
    }

    fn lay_out<'a>(&'a self, fonts: &'a Fonts) -> Result<impl Layout + 'a, FigureError> {
        let strokes = Strokes::new(self);
        let legend = Legend::new(self, &strokes, WIDTH - 2.0 * BORDER, fonts);
        let head = Head::new(&self.title, &self.caption, fonts);
        let columns = self
            .columns
            .clamp(1, HEIGHTS.len())
            .min(self.panels.len().max(1));
        Ok(Plan::new(
            head,
            strokes,
            legend,
            &self.panels,
            columns,
            (WIDTH, HEIGHTS[columns - 1]),
            fonts,
        ))
    }
}

/// The first panel of a figure without words, small enough for a list of figures.
pub struct Miniature(Figure);

impl From<&Figure> for Miniature {
    fn from(figure: &Figure) -> Self {
        let wordless = |axis: &Axis| Axis {
            label: String::new(),
            scale: match &axis.scale {
                Scale::Category(names) => Scale::Category(vec![String::new(); names.len()]),
                other => other.clone(),
            },
            ..axis.clone()
        };
        let panel = |panel: &Panel| Panel {
            title: String::new(),
            x: wordless(&panel.x),
            y: wordless(&panel.y),
            layers: panel.layers.clone(),
        };
        Self(Figure {
            panels: figure
                .panels
                .first()
                .map(panel)
                .into_iter()
                .collect(),
            ..figure.clone()
        })
    }
}

impl Picture for Miniature {
    fn title(&self) -> &str {
        &self.0.title
    }

    fn lay_out<'a>(&'a self, fonts: &'a Fonts) -> Result<impl Layout + 'a, FigureError> {
        let legend = Legend::of_areas(std::iter::empty(), 0.0, fonts);
        let head = Head { title: vec![], caption: vec![], bottom: 0.0 };
        Ok(Plan::new(head, Strokes::new(&self.0), legend, &self.0.panels, 1, MINIATURE, fonts))
    }
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
        let mut plots: Vec<Plot> = panels
            .iter()
            .map(|panel| Plot::new(panel, height, fonts))
            .collect();
        let beside = plots
            .iter()
            .map(|plot| plot.left)
            .fold(0.0, f64::max);
        let width = (room / columns as f64 - beside - GUTTER.0).max(60.0);
        plots
            .iter_mut()
            .for_each(|plot| plot.fit_width(width, fonts));
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
}

impl Layout for Plan<'_> {
    fn size(&self) -> (f64, f64) {
        (self.width, self.height)
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
        self.head.draw(sheet)?;
        self.legend
            .draw(sheet, (BORDER, self.head.bottom))?;
        self.panels
            .iter()
            .try_for_each(|(plot, frame)| plot.draw(sheet, *frame, &self.strokes))
    }
}
