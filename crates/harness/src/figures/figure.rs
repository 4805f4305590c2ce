//! Lays a figure out and draws it: title, caption, legend, and panels whose axes line up.

use plotters::style::RGBColor;

use super::canvas::{Anchor, Canvas, Fault, Frame, Pen};
use super::label::{Labels, around};
use super::legend::Legend;
use super::marks::Marks;
use super::model::Figure;
use super::plot::Plot;
use super::side::{LABEL, Side, TICK, horizontal, label_depth, vertical};
use super::style::{FAINT, GREY, GRID, INK, Strokes, WHITE};
use super::text::{BODY, HEADING, Ruler, SMALL, TITLE, Type};

/// Width of every figure in pixels.
pub(super) const WIDTH: f64 = 800.0;
/// Blank border.
pub(super) const BORDER: f64 = 14.0;
/// Heights of plots in 1, 2, 3 and 4 columns.
const HEIGHTS: [f64; 4] = [360.0, 240.0, 190.0, 150.0];
/// Blank to the right of and below each panel.
const GUTTER: (f64, f64) = (16.0, 18.0);

/// Title and caption: their lines and height.
pub(super) struct Head {
    title: Vec<String>,
    caption: Vec<String>,
    /// Pixels from the top of the figure.
    pub bottom: f64,
}

impl Head {
    pub fn new(title: &str, caption: &str, width: f64, ruler: &Ruler) -> Self {
        let room = width - 2.0 * BORDER;
        let (title, caption) = (ruler.wrap(title, room, TITLE), ruler.wrap(caption, room, BODY));
        let lines = TITLE.line() * title.len() as f64 + BODY.line() * caption.len() as f64;
        Self { title, caption, bottom: (BORDER + lines + if lines > 0.0 { 8.0 } else { 0.0 }).ceil() }
    }

    pub fn draw(&self, pen: &Pen) -> Result<(), Fault> {
        let top = stacked(pen, &self.title, (BORDER, BORDER), TITLE, INK, Anchor::Start)?;
        stacked(pen, &self.caption, (BORDER, top), BODY, GREY, Anchor::Start)?;
        Ok(())
    }
}

/// Draws lines below each other; returns the bottom of the last.
fn stacked(
    pen: &Pen,
    lines: &[String],
    (x, mut top): (f64, f64),
    style: Type,
    colour: RGBColor,
    anchor: Anchor,
) -> Result<f64, Fault> {
    for line in lines {
        pen.text((x, top + style.line() / 2.0), line, style, colour, anchor)?;
        top += style.line();
    }
    Ok(top)
}

/// One panel with all that is printed around its plot, and the plot's place.
struct Placed<'a> {
    plot: Plot<'a>,
    title: Vec<String>,
    x: Side,
    y: Side,
    /// The neighbour below or to the left has the same label; it is printed only there.
    x_label: bool,
    y_label: bool,
    frame: Frame,
}

impl Placed<'_> {
    fn x_lines(&self) -> &[String] {
        if self.x_label { &self.x.lines } else { &[] }
    }

    fn y_lines(&self) -> &[String] {
        if self.y_label { &self.y.lines } else { &[] }
    }

    fn above(&self) -> f64 {
        (HEADING.line() * self.title.len() as f64 + 4.0).ceil()
    }

    fn below(&self) -> f64 {
        (self.x.depth + label_depth(self.x_lines())).ceil()
    }
}

/// Places the panels in rows from y = 0, all plots of a column and of a row aligned; returns also the
/// free part of the last row.
fn grid<'a>(figure: &'a Figure, ruler: &Ruler) -> (Vec<Placed<'a>>, Option<Frame>) {
    let count = figure.panels.len();
    let columns = figure.columns.clamp(1, HEIGHTS.len()).min(count.max(1));
    let height = HEIGHTS.get(columns - 1).copied().unwrap_or(HEIGHTS[0]);
    let plots: Vec<Plot> = figure.panels.iter().map(Plot::new).collect();

    // The labels of the y axes leave the plots' width; that decides on the labels of the x axes; and
    // they on the rows.
    let ys: Vec<Side> = plots.iter().map(|plot| vertical(&plot.panel.y, plot.y, height, ruler)).collect();
    let y_label = |index: usize| index.is_multiple_of(columns) || ys[index - 1].label != ys[index].label;
    let mut lefts = vec![0.0_f64; columns];
    for (index, side) in ys.iter().enumerate() {
        let label = if y_label(index) { label_depth(&side.lines) } else { 0.0 };
        lefts[index % columns] = lefts[index % columns].max((side.depth + label).ceil());
    }
    let spare = WIDTH - 2.0 * BORDER - lefts.iter().sum::<f64>() - GUTTER.0 * columns as f64;
    let width = (spare / columns as f64).floor().max(60.0);
    let left = |column: usize| {
        BORDER + lefts.iter().take(column + 1).sum::<f64>() + (width + GUTTER.0) * column as f64
    };
    let xs: Vec<Side> = plots.iter().map(|plot| horizontal(&plot.panel.x, plot.x, width, ruler)).collect();
    let x_labels: Vec<bool> = (0..count)
        .map(|index| xs.get(index + columns).is_none_or(|below| below.label != xs[index].label))
        .collect();
    let y_labels: Vec<bool> = (0..count).map(y_label).collect();

    let mut panels: Vec<Placed> = Vec::new();
    for (index, (((plot, x), y), (&x_label, &y_label))) in
        plots.into_iter().zip(xs).zip(ys).zip(x_labels.iter().zip(&y_labels)).enumerate()
    {
        let title = ruler.wrap(&plot.panel.title, width, HEADING);
        let frame = Frame { left: left(index % columns), top: 0.0, width, height };
        panels.push(Placed { plot, title, x, y, x_label, y_label, frame });
    }
    let mut top = 0.0;
    for (row, panels) in panels.chunks_mut(columns).enumerate() {
        let above = panels.iter().map(Placed::above).fold(0.0, f64::max);
        // An axis label with no panel below it may reach into the free part of the last row.
        let next = (row + 1) * columns;
        let depth = |(column, panel): (usize, &Placed)| {
            if count > next && count <= next + column { panel.x.depth } else { panel.below() }
        };
        let below = panels.iter().enumerate().map(depth).fold(0.0, f64::max).ceil();
        for panel in panels.iter_mut() {
            panel.frame.top = top + above;
        }
        top += above + height + below + GUTTER.1;
    }
    let used = count % columns;
    let free = panels.last().filter(|_| used > 0 && count > columns).map(|last| {
        let free_left = left(used - 1) + width + GUTTER.0 + 20.0;
        Frame { left: free_left, width: WIDTH - BORDER - free_left, ..last.frame }
    });
    (panels, free)
}

/// The figure as an SVG.
pub(super) fn draw(figure: &Figure, ruler: &Ruler) -> Result<String, Fault> {
    let strokes = Strokes::new(figure);
    let legend = Legend::new(figure, &strokes, ruler);
    let head = Head::new(&figure.title, &figure.caption, WIDTH, ruler);
    let (mut panels, free) = grid(figure, ruler);

    // The legend stands in the free part of the last row if it fits there, otherwise above all panels.
    let beside = free.map(|free| (free, legend.arrange(free.width)));
    let beside = beside.filter(|(free, legend)| legend.width <= free.width && legend.height <= free.height);
    let above = legend.arrange(WIDTH - 2.0 * BORDER);
    let legend_depth = if beside.is_some() || above.height == 0.0 { 0.0 } else { above.height + 10.0 };
    let top = head.bottom + legend_depth;
    for panel in &mut panels {
        panel.frame.top += top;
    }
    let bottom = panels.iter().map(|panel| panel.frame.bottom() + panel.below()).fold(top, f64::max);

    let mut canvas = Canvas::new(&figure.title, WIDTH, bottom + BORDER);
    canvas.over(|pen| {
        head.draw(pen)?;
        panels.iter().try_for_each(|panel| draw_grid(pen, panel))
    })?;
    match &beside {
        Some((free, arrangement)) => {
            let down = top + free.top + (free.height - arrangement.height) / 2.0;
            legend.draw(&mut canvas, (free.left, down.round()), arrangement)?;
        }
        None => legend.draw(&mut canvas, (BORDER, head.bottom), &above)?,
    }
    for panel in &panels {
        draw_panel(&mut canvas, panel, &strokes, ruler)?;
    }
    Ok(canvas.finish())
}

/// Draws the lines behind the data.
fn draw_grid(pen: &Pen, panel: &Placed) -> Result<(), Fault> {
    let frame = panel.frame;
    let upright = |at: f64, colour| {
        let x = frame.left + at * frame.width;
        pen.path(&[(x, frame.top), (x, frame.bottom())], colour, 1.0)
    };
    let level = |at: f64, colour| {
        let y = frame.bottom() - at * frame.height;
        pen.path(&[(frame.left, y), (frame.right(), y)], colour, 1.0)
    };
    let (x, y) = (&panel.x.ticks, &panel.y.ticks);
    x.minor.iter().try_for_each(|&at| upright(at, FAINT))?;
    y.minor.iter().try_for_each(|&at| level(at, FAINT))?;
    if !panel.plot.has_categories() {
        x.major.iter().try_for_each(|tick| upright(tick.at, GRID))?;
    }
    y.major.iter().try_for_each(|tick| level(tick.at, GRID))
}

/// Draws data, axes and texts over the grid.
fn draw_panel(canvas: &mut Canvas, panel: &Placed, strokes: &Strokes, ruler: &Ruler) -> Result<(), Fault> {
    let frame = panel.frame;
    let marks = Marks::new(&panel.plot, frame, strokes);
    let mut labels = Labels::new(frame);
    marks.draw_inside(canvas, &mut labels)?;
    canvas.over(|pen| {
        draw_axes(pen, panel)?;
        stacked(pen, &panel.title, (frame.left, frame.top - panel.above()), HEADING, INK, Anchor::Start)?;
        let markers = marks.markers();
        for (name, (x, y)) in markers.places {
            let (stroke, radius) = (strokes.of(name), markers.radius);
            pen.marker((x, y), stroke.marker, stroke.colour, radius, markers.edge)?;
            let size = 2.0 * radius;
            labels.avoid_area(Frame { left: x - radius, top: y - radius, width: size, height: size });
        }
        draw_notes(pen, &marks, frame, &mut labels, ruler)?;
        if !panel.plot.has_data {
            let middle = (frame.left + frame.width / 2.0, frame.top + frame.height / 2.0);
            let width = ruler.width("no data", BODY) + 8.0;
            let behind = Frame { left: middle.0 - width / 2.0, top: middle.1 - 9.0, width, height: 18.0 };
            pen.rectangle(behind, WHITE, 1.0)?;
            pen.text(middle, "no data", BODY, GREY, Anchor::Middle)?;
        }
        Ok(())
    })
}

/// Draws the axes' lines, ticks, tick labels and labels.
fn draw_axes(pen: &Pen, panel: &Placed) -> Result<(), Fault> {
    let (frame, x, y) = (panel.frame, &panel.x, &panel.y);
    let (left, bottom) = (frame.left, frame.bottom());
    pen.path(&[(left, frame.top), (left, bottom), (frame.right(), bottom)], INK, 1.0)?;
    for tick in &x.ticks.major {
        let at = left + tick.at * frame.width;
        pen.path(&[(at, bottom), (at, bottom + 4.0)], INK, 1.0)?;
        if x.upright {
            pen.text((at, bottom + TICK), &tick.label, SMALL, INK, Anchor::UpEnd)?;
        } else {
            pen.text((at, bottom + TICK + SMALL.line() / 2.0), &tick.label, SMALL, INK, Anchor::Middle)?;
        }
    }
    for tick in &y.ticks.major {
        let at = bottom - tick.at * frame.height;
        pen.path(&[(left - 4.0, at), (left, at)], INK, 1.0)?;
        pen.text((left - TICK, at), &tick.label, SMALL, INK, Anchor::End)?;
    }
    let below = (left + frame.width / 2.0, bottom + x.depth + LABEL);
    stacked(pen, panel.x_lines(), below, BODY, INK, Anchor::Middle)?;
    for (index, line) in panel.y_lines().iter().rev().enumerate() {
        let across = left - y.depth - LABEL - BODY.line() * (index as f64 + 0.5);
        pen.text((across, frame.top + frame.height / 2.0), line, BODY, INK, Anchor::UpMiddle)?;
    }
    Ok(())
}

/// Draws the texts of reference lines and notes where they cover least.
fn draw_notes(pen: &Pen, marks: &Marks, frame: Frame, labels: &mut Labels, ruler: &Ruler) -> Result<(), Fault> {
    for (text, x, y) in marks.notes() {
        let text = ruler.shorten(text, frame.width - 12.0, SMALL);
        let (width, height) = (ruler.width(&text, SMALL) + 4.0, SMALL.size + 3.0);
        // At one end of the line, at the other, or between.
        let along = |from: f64, to: f64| {
            [0, 40].into_iter().chain(1..40).map(move |part| from + (to - from) * f64::from(part) / 40.0)
        };
        let candidates: Vec<Frame> = match (x, y) {
            (Some(x), Some(y)) => around((x, y), width, height),
            (None, Some(y)) => along(frame.right() - width - 2.0, frame.left + 2.0)
                .flat_map(|left| [y - height - 2.0, y + 2.0].map(|top| Frame { left, top, width, height }))
                .collect(),
            (Some(x), None) => along(frame.top + 2.0, frame.bottom() - height - 2.0)
                .flat_map(|top| [x + 3.0, x - width - 3.0].map(|left| Frame { left, top, width, height }))
                .collect(),
            (None, None) => continue,
        };
        let Some(place) = labels.best(&candidates) else { continue };
        if let (Some(x), Some(y)) = (x, y) {
            // A note that found no place beside its point is led back to it.
            let near = (x.clamp(place.left, place.right()), y.clamp(place.top, place.bottom()));
            if (near.0 - x).abs().max((near.1 - y).abs()) > 10.0 {
                pen.path(&[(x, y), near], GREY, 1.0)?;
            }
        }
        pen.rectangle(place, WHITE, 0.8)?;
        pen.text((place.left + 2.0, place.top + height / 2.0), &text, SMALL, INK, Anchor::Start)?;
    }
    Ok(())
}
