//! Draws shapes and text given in pixels, through plotters, into one SVG.
//!
//! plotters' SVG backend has whole-number coordinates and no dashes or clipping. So it draws twelfths
//! of a pixel, and a figure is several of its pictures nested in one SVG: a nested picture clips what
//! leaves it and inherits the dash of the group around it.

use std::fmt::Write as _;

use plotters::coord::Shift;
use plotters::element::{PathElement, Polygon, Rectangle, Text};
use plotters::prelude::{Color, DrawingArea, IntoDrawingArea, RGBColor, SVGBackend, ShapeStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontDesc, FontFamily, FontStyle, FontTransform, TextStyle};

use super::style::WHITE;
use super::text::{FAMILY, Type};

/// Steps of plotters' coordinates per pixel. Of tens, twelfths and the like, twelfths let all font
/// sizes be written exactly: see [`nominal`].
const STEPS: f64 = 12.0;

/// Where a text lies with respect to its point; always centred across the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
    /// Middle, reading upwards.
    UpMiddle,
    /// End at the point, reading upwards.
    UpEnd,
    /// Start at the point, reading upwards.
    UpStart,
}

/// A rectangle in pixels, y downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Frame {
    pub fn right(self) -> f64 {
        self.left + self.width
    }

    pub fn bottom(self) -> f64 {
        self.top + self.height
    }

    pub fn contains(self, (x, y): (f64, f64)) -> bool {
        x >= self.left && x <= self.right() && y >= self.top && y <= self.bottom()
    }

    pub fn overlaps(self, other: Self) -> bool {
        self.left < other.right()
            && other.left < self.right()
            && self.top < other.bottom()
            && other.top < self.bottom()
    }
}

/// An SVG being put together.
pub(super) struct Canvas {
    svg: String,
    width: f64,
    height: f64,
}

/// Draws into one picture, in pixels from its upper left corner.
pub(super) struct Pen<'a>(DrawingArea<SVGBackend<'a>, Shift>);

/// What went wrong while drawing.
pub(super) type Fault = Box<dyn std::error::Error>;

fn steps(pixels: f64) -> i32 {
    // Casting saturates; the limit leaves room for plotters' own additions.
    (pixels * STEPS).clamp(-1e8, 1e8).round() as i32
}

fn point((x, y): (f64, f64)) -> (i32, i32) {
    (steps(x), steps(y))
}

/// XML 1.0 has no control characters, not even escaped ones.
fn printable(text: &str) -> String {
    let legal = |c: char| !c.is_control() && c != '\u{fffe}' && c != '\u{ffff}';
    text.chars().map(|c| if legal(c) { c } else { ' ' }).collect()
}

impl Canvas {
    /// An empty white picture of whole pixels.
    pub fn new(title: &str, width: f64, height: f64) -> Self {
        let (width, height) = (width.ceil(), height.ceil());
        let mut svg = String::new();
        let _ = writeln!(
            svg,
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {} {}" role="img" stroke-linejoin="round">"#,
            width * STEPS,
            height * STEPS,
        );
        let title = printable(title).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let _ = writeln!(svg, "<title>{title}</title>");
        let _ = writeln!(svg, r##"<rect width="100%" height="100%" fill="#FFFFFF"/>"##);
        Self { svg, width, height }
    }

    /// Draws over the whole picture.
    pub fn over(&mut self, draw: impl FnOnce(&Pen) -> Result<(), Fault>) -> Result<(), Fault> {
        let all = Frame { left: 0.0, top: 0.0, width: self.width, height: self.height };
        self.inside(all, &[], draw)
    }

    /// Draws in a part of the picture, cutting off what leaves it, with all lines dashed.
    pub fn inside(
        &mut self,
        frame: Frame,
        dash: &[f64],
        draw: impl FnOnce(&Pen) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        self.svg.push_str("<g");
        if (frame.left, frame.top) != (0.0, 0.0) {
            let (left, top) = point((frame.left, frame.top));
            let _ = write!(self.svg, r#" transform="translate({left} {top})""#);
        }
        if !dash.is_empty() {
            let lengths: Vec<String> = dash.iter().map(|&length| steps(length).to_string()).collect();
            let _ = write!(self.svg, r#" stroke-dasharray="{}""#, lengths.join(" "));
        }
        self.svg.push_str(">\n");
        let size = (steps(frame.width).max(1) as u32, steps(frame.height).max(1) as u32);
        let pen = Pen(SVGBackend::with_string(&mut self.svg, size).into_drawing_area());
        draw(&pen)?;
        pen.0.present()?;
        drop(pen);
        self.svg.push_str("</g>\n");
        Ok(())
    }

    /// The whole SVG.
    pub fn finish(mut self) -> String {
        self.svg.push_str("</svg>\n");
        self.svg
    }
}

impl Pen<'_> {
    /// A line through points, `width` pixels wide. Points that do not show are left out.
    pub fn path(&self, points: &[(f64, f64)], colour: RGBColor, width: f64) -> Result<(), Fault> {
        let points = thinned(points);
        if points.len() < 2 {
            return Ok(());
        }
        let style = ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: steps(width) as u32 };
        Ok(self.0.draw(&PathElement::new(points, style))?)
    }

    /// A filled polygon of this opacity.
    pub fn polygon(&self, points: &[(f64, f64)], colour: RGBColor, opacity: f64) -> Result<(), Fault> {
        Ok(self.0.draw(&Polygon::new(thinned(points), colour.mix(opacity)))?)
    }

    /// A filled rectangle of this opacity.
    pub fn rectangle(&self, frame: Frame, colour: RGBColor, opacity: f64) -> Result<(), Fault> {
        let corners = [point((frame.left, frame.top)), point((frame.right(), frame.bottom()))];
        Ok(self.0.draw(&Rectangle::new(corners, colour.mix(opacity).filled()))?)
    }

    /// A marker of this radius with a white edge of this width.
    pub fn marker(
        &self,
        (x, y): (f64, f64),
        shape: &[(f64, f64)],
        colour: RGBColor,
        radius: f64,
        edge: f64,
    ) -> Result<(), Fault> {
        let scaled = |radius: f64| -> Vec<(i32, i32)> {
            shape.iter().map(|&(dx, dy)| point((x + dx * radius, y + dy * radius))).collect()
        };
        if edge > 0.0 {
            self.0.draw(&Polygon::new(scaled(radius + edge), WHITE))?;
        }
        Ok(self.0.draw(&Polygon::new(scaled(radius), colour))?)
    }

    /// A line of text.
    pub fn text(
        &self,
        at: (f64, f64),
        text: &str,
        style: Type,
        colour: RGBColor,
        anchor: Anchor,
    ) -> Result<(), Fault> {
        let (turned, side) = match anchor {
            Anchor::Start => (false, HPos::Left),
            Anchor::Middle => (false, HPos::Center),
            Anchor::End => (false, HPos::Right),
            Anchor::UpStart => (true, HPos::Left),
            Anchor::UpMiddle => (true, HPos::Center),
            Anchor::UpEnd => (true, HPos::Right),
        };
        if text.is_empty() {
            return Ok(());
        }
        // plotters centres the lower-case letters; a little lower, digits and capitals look centred.
        let lower = 0.09 * style.size;
        let (x, y) = if turned { (at.0 + lower, at.1) } else { (at.0, at.1 + lower) };
        let weight = if style.bold { FontStyle::Bold } else { FontStyle::Normal };
        let turn = if turned { FontTransform::Rotate270 } else { FontTransform::None };
        let font = FontDesc::new(FontFamily::Name(FAMILY), nominal(style.size * STEPS), weight).transform(turn);
        let style = TextStyle { pos: Pos::new(side, VPos::Center), ..font.color(&colour) };
        Ok(self.0.draw(&Text::new(printable(text), point((x, y)), style))?)
    }
}

/// The size that plotters' SVG backend, which divides it by 1.24, writes as `size`.
fn nominal(size: f64) -> f64 {
    let near = size * 1.24;
    [near, near.next_up(), near.next_down()].into_iter().find(|near| near / 1.24 == size).unwrap_or(near)
}

/// The points in plotters' coordinates, without what cannot be seen: of successive points in the same
/// column only the first, lowest, highest and last, and no inner points of upright or level lines.
fn thinned(points: &[(f64, f64)]) -> Vec<(i32, i32)> {
    let mut columns: Vec<(i32, i32)> = Vec::new();
    let points: Vec<(i32, i32)> = points.iter().copied().map(point).collect();
    for column in points.chunk_by(|one, next| one.0 == next.0) {
        let (Some(&first), Some(&last)) = (column.first(), column.last()) else { continue };
        let low = column.iter().copied().min_by_key(|point| point.1).unwrap_or(first);
        let high = column.iter().copied().max_by_key(|point| point.1).unwrap_or(last);
        columns.extend([first, low, high, last]);
    }
    columns.dedup();
    let mut kept: Vec<(i32, i32)> = Vec::new();
    for next in columns {
        if let [.., before, middle] = kept[..]
            && before.1 == middle.1
            && middle.1 == next.1
            && (before.0 <= middle.0) == (middle.0 <= next.0)
        {
            kept.pop();
        }
        kept.push(next);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::super::text::{BODY, HEADING, SMALL, TITLE};
    use super::*;

    #[test]
    fn a_million_points_are_drawn_as_few() {
        let wave = |i: i32| (f64::from(i) * 1e-4, f64::from(i % 97));
        let dense: Vec<(f64, f64)> = (0..1_000_000).map(wave).collect();
        let thin = thinned(&dense);
        assert!(thin.len() as f64 <= 4.0 * (100.0 * STEPS + 1.0), "{} points", thin.len());
        assert_eq!((thin.first(), thin.last()), (Some(&point(dense[0])), Some(&point(dense[999_999]))));
        assert_eq!(thin.iter().map(|point| point.1).max(), Some(steps(96.0)));
    }

    #[test]
    fn level_points_are_left_out_and_reversals_kept() {
        let (a, b, c) = ((0.0, 1.0), (1.0, 1.0), (2.0, 1.0));
        assert_eq!(thinned(&[a, b, c]), [point(a), point(c)]);
        assert_eq!(thinned(&[a, c, b]), [point(a), point(c), point(b)]);
    }

    #[test]
    fn font_sizes_are_written_without_rounding_errors() {
        for style in [SMALL, BODY, HEADING, TITLE] {
            assert_eq!(nominal(style.size * STEPS) / 1.24, style.size * STEPS);
        }
    }

    #[test]
    fn names_cannot_break_the_svg() {
        let mut canvas = Canvas::new("a < b & \u{0}c", 10.0, 10.0);
        let style = Type { size: 12.0, bold: false };
        canvas
            .over(|pen| pen.text((5.0, 5.0), "<\u{1}>&\"", style, RGBColor(0, 0, 0), Anchor::Middle))
            .unwrap();
        let svg = canvas.finish();
        assert!(svg.contains("<title>a &lt; b &amp;  c</title>") && svg.contains("&lt; &gt;&amp;&quot;"));
    }
}
