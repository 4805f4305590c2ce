//! Draws one panel as a plotters chart: ticks, labels and, by [`Layers`], the marks.

use plotters::chart::ChartBuilder;

use super::axis::{Ruled, axes};
use super::canvas::{Align, Fault, Frame, Sheet, font, pen, steps};
use super::layers::Layers;
use super::model::{Panel, Scale};
use super::style::{FAINT, GREY, GRID, INK, Strokes};
use super::text::{BODY, Fonts, HEADING, SMALL};

/// Length of ticks; their labels are twice as far from the axis.
const TICK: f64 = 4.0;
/// Distance from tick labels to the axis label.
const LABEL: f64 = 5.0;

/// A panel with the space it needs around its plot.
pub(super) struct Plot<'a> {
    panel: &'a Panel,
    x: Ruled,
    y: Ruled,
    has_data: bool,
    /// The names of categories below the plot, in lines, with their coordinates.
    names: Vec<(f64, Vec<String>)>,
    /// True if the names are written upwards.
    upright: bool,
    title: Vec<String>,
    x_label: Vec<String>,
    y_label: Vec<String>,
    /// Pixels above the plot; `left` and `below` are the pixels on its other sides.
    pub above: f64,
    pub left: f64,
    pub below: f64,
}

impl<'a> Plot<'a> {
    /// Finds the ranges of both axes and the ticks of a y axis of this height.
    pub fn new(panel: &'a Panel, height: f64, fonts: &Fonts) -> Self {
        let (x, mut y, has_data) = axes(panel);
        y.rule((height / 28.0) as usize);
        let y_label = fonts.wrap(&format!("{} {}", panel.y.label, y.factor), height, BODY);
        let widest = fonts.widest(y.major.iter().map(|tick| &tick.1), SMALL);
        let left = (2.0 * TICK + widest + LABEL + BODY.line() * y_label.len() as f64).ceil();
        let names = Vec::new();
        let title = Vec::new();
        let x_label = Vec::new();
        Self {
            panel,
            x,
            y,
            has_data,
            names,
            upright: false,
            title,
            x_label,
            y_label,
            above: 0.0,
            left,
            below: 0.0,
        }
    }

    /// Finds the ticks of an x axis of this width, and breaks the texts above and below into lines.
    pub fn fit_width(&mut self, width: f64, fonts: &Fonts) {
        let mut depth = SMALL.line();
        if let Scale::Category(names) = &self.panel.x.scale {
            let room = width / names.len().max(1) as f64;
            // Names are wrapped at blanks, so a name fits if each word does.
            let fits = |name: &String| {
                name.split_whitespace().all(|word| fonts.width(word, SMALL) <= room - 6.0)
            };
            self.upright = !names.iter().all(fits);
            // Upright names need the height of a line each; names that have no room are skipped.
            let every = if self.upright { (SMALL.line() / room).ceil() as usize } else { 1 };
            let lines = |name: String| {
                if self.upright { vec![name] } else { fonts.wrap(&name, room - 6.0, SMALL) }
            };
            let named = names.iter().zip(0..).step_by(every);
            self.names = named.map(|(name, at)| (f64::from(at), lines(name.clone()))).collect();
            let size = |(_, lines): &(f64, Vec<String>)| {
                if self.upright {
                    fonts.widest(lines, SMALL)
                } else {
                    SMALL.line() * lines.len() as f64
                }
            };
            depth = self.names.iter().map(size).fold(0.0, f64::max);
        } else {
            self.x.rule((width / 46.0) as usize);
        }
        self.title = fonts.wrap(&self.panel.title, width, HEADING);
        self.above = HEADING.line() * self.title.len() as f64 + 5.0;
        self.x_label =
            fonts.wrap(&format!("{} {}", self.panel.x.label, self.x.factor), width, BODY);
        self.below = (2.0 * TICK + depth + LABEL + BODY.line() * self.x_label.len() as f64).ceil();
    }

    /// Drops the label of the x axis if the panel below has the same label.
    pub fn share_x_label(&mut self, below: &Self) {
        if self.x_label == below.x_label {
            self.below -= BODY.line() * self.x_label.len() as f64;
            self.x_label.clear();
        }
    }

    /// Draws the panel with its plot in a place of the sheet.
    pub fn draw(&self, sheet: &Sheet, frame: Frame, strokes: &Strokes) -> Result<(), Fault> {
        let Frame { left, top, width, height } = frame;
        let area = sheet.0.clone().shrink(
            (steps(left - self.left), steps(top)),
            (steps(self.left + width), steps(height + self.below)),
        );
        let mut chart = ChartBuilder::on(&area)
            .y_label_area_size(steps(self.left))
            .x_label_area_size(steps(self.below))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .bold_line_style(pen(GRID, 1.0))
            .light_line_style(pen(FAINT, 1.0))
            .axis_style(pen(INK, 1.0))
            .label_style(font(SMALL, INK))
            .set_all_tick_mark_size(steps(TICK))
            .draw()?;
        Layers {
            layers: &self.panel.layers,
            x: &self.x,
            y: &self.y,
            area: chart.plotting_area(),
            strokes,
            frame,
        }
        .draw()?;

        sheet.lines((left, top - self.above), &self.title, HEADING, INK, Align::Left)?;
        let centre = left + width / 2.0;
        let middle = top + height / 2.0;
        let bottom = top + height;
        if !self.has_data {
            sheet.text((centre, middle), "no data", BODY, GREY, Align::Center)?;
        }
        for (at, lines) in &self.names {
            let x = left + self.x.fraction(*at) * width;
            match &lines[..] {
                [name] if self.upright => {
                    sheet.text((x, bottom + 2.0 * TICK), name, SMALL, INK, Align::UpTo)?
                }
                _ => sheet.lines((x, bottom + TICK), lines, SMALL, INK, Align::Center)?,
            }
        }
        let below = bottom + self.below - BODY.line() * self.x_label.len() as f64;
        sheet.lines((centre, below), &self.x_label, BODY, INK, Align::Center)?;
        self.y_label.iter().zip(0..).try_for_each(|(line, index)| {
            let beside = left - self.left + BODY.line() * (f64::from(index) + 0.5);
            sheet.text((beside, middle), line, BODY, INK, Align::UpCenter)
        })
    }
}
