//! A sheet for drawing through plotters in pixels, y downwards, and the SVG document made from it.

use std::fmt::Write as _;

use plotters::coord::Shift;
use plotters::element::{DashedPathElement, Drawable, PathElement, Polygon};
use plotters::prelude::{Color, DrawingArea, IntoDrawingArea, RGBColor, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontDesc, FontFamily, FontStyle, FontTransform, TextStyle};

use super::text::{FAMILY, Type};

pub(super) type Colour = RGBColor;

/// The colour of the background.
pub(super) const WHITE: Colour = RGBColor(0xFF, 0xFF, 0xFF);

/// Steps of plotters' integer coordinates per pixel.
const STEPS: f64 = 4.0;
/// plotters' SVG backend divides font sizes by this.
const FONT_SIZE: f64 = 1.24;

/// A place in pixels.
pub(super) type Point = (f64, f64);

/// The position of a text relative to its point; always centred across the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Center,
    Right,
    /// Upwards, with the point in its middle.
    Up,
}

/// A rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

/// Lengths of a dash and of the gap after it; `None` for a solid line.
pub(super) type Dash = Option<(f64, f64)>;

/// An SVG document that is being drawn.
pub(super) struct Sheet<'a>(DrawingArea<SVGBackend<'a>, Shift>);

/// Why nothing that is drawn here fails.
const IN_MEMORY: &str = "a text in memory takes whatever is drawn";

/// Converts pixels to steps. Casting saturates; the limit leaves room for plotters' own additions.
fn steps(pixels: f64) -> i32 {
    (pixels * STEPS).clamp(-1e8, 1e8).round() as i32
}

fn place((x, y): Point) -> (i32, i32) {
    (steps(x), steps(y))
}

fn places(points: &[Point]) -> Vec<(i32, i32)> {
    points.iter().copied().map(place).collect()
}

/// Removes control characters, which XML does not allow even escaped.
fn printable(text: &str) -> String {
    let legal = |c: char| !c.is_control() && c != '\u{fffe}' && c != '\u{ffff}';
    text.chars().map(|c| if legal(c) { c } else { ' ' }).collect()
}

impl<'a> Sheet<'a> {
    fn draw<E>(&mut self, element: &E)
    where
        for<'b> &'b E: plotters::element::PointCollection<'b, (i32, i32)>,
        E: Drawable<SVGBackend<'a>>,
    {
        self.0.draw(element).expect(IN_MEMORY);
    }

    /// Draws a line of text.
    pub fn text(&mut self, at: Point, text: &str, style: Type, colour: Colour, align: Align) {
        if text.is_empty() {
            return;
        }
        let (side, turn) = match align {
            Align::Left => (HPos::Left, FontTransform::None),
            Align::Center => (HPos::Center, FontTransform::None),
            Align::Right => (HPos::Right, FontTransform::None),
            Align::Up => (HPos::Center, FontTransform::Rotate270),
        };
        let weight = if style.bold { FontStyle::Bold } else { FontStyle::Normal };
        let font = FontDesc::new(FontFamily::Name(FAMILY), style.size * STEPS * FONT_SIZE, weight);
        let style = TextStyle { color: colour.to_backend_color(), ..TextStyle::from(font) };
        let style = style.pos(Pos::new(side, VPos::Center)).transform(turn);
        self.0.draw_text(&printable(text), &style, place(at)).expect(IN_MEMORY);
    }

    /// Draws lines of text, the first just below `top`.
    pub fn lines(
        &mut self,
        (x, top): Point,
        lines: &[String],
        style: Type,
        colour: Colour,
        align: Align,
    ) {
        for (line, index) in lines.iter().zip(0..) {
            let middle = top + style.line() * (f64::from(index) + 0.5);
            self.text((x, middle), line, style, colour, align);
        }
    }

    /// Fills a polygon.
    pub fn polygon(&mut self, corners: &[Point], colour: Colour, opacity: f64) {
        self.draw(&Polygon::new(places(corners), colour.mix(opacity)));
    }

    /// Fills a polygon over its edge, of which the outer half is seen.
    pub fn marker(&mut self, corners: &[Point], fill: Colour, edge: Colour, width: f64) {
        let closed = [corners, &corners[..2]].concat();
        self.line(&closed, edge, width, None);
        self.polygon(corners, fill, 1.0);
    }

    /// Draws a line through these points.
    pub fn line(&mut self, points: &[Point], colour: Colour, width: f64, dash: Dash) {
        let style = colour.stroke_width(steps(width) as u32);
        let points = places(points);
        match dash {
            None => self.draw(&PathElement::new(points, style)),
            Some((on, off)) => {
                self.draw(&DashedPathElement::new(points, steps(on), steps(off), style));
            }
        }
    }
}

/// Makes an SVG document of this size. Screen readers read the title.
pub(super) fn svg(
    title: &str,
    (width, height): (f64, f64),
    draw: impl FnOnce(&mut Sheet),
) -> String {
    let (across, down) = place((width.ceil(), height.ceil()));
    let mut body = String::new();
    {
        let area =
            SVGBackend::with_string(&mut body, (across as u32, down as u32)).into_drawing_area();
        let mut sheet = Sheet(area);
        draw(&mut sheet);
        sheet.0.present().expect(IN_MEMORY);
    }
    let title = printable(title).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" \
         viewBox=\"0 0 {across} {down}\" role=\"img\" stroke-linejoin=\"round\">\n\
         <title>{title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n\
         {}</svg>\n",
        width.ceil(),
        height.ceil(),
        joined(&body),
    )
}

/// Joins successive lines of one style, such as the dashes of a line, into one element. The
/// document shrinks to a fifth.
fn joined(svg: &str) -> String {
    let mut joined = String::with_capacity(svg.len());
    let mut open: Option<&str> = None;
    for line in svg.lines() {
        let path = line.strip_prefix("<polyline ").and_then(|rest| rest.split_once(" points=\""));
        if open.is_some() && open != path.map(|(style, _)| style) {
            joined.push_str("\"/>\n");
            open = None;
        }
        match path {
            Some((style, points)) => {
                if open.is_none() {
                    let _ = write!(joined, "<path {style} d=\"");
                    open = Some(style);
                }
                let _ = write!(joined, "M{}", points.trim_end_matches([' ', '"', '/', '>']));
            }
            None => {
                joined.push_str(line);
                joined.push('\n');
            }
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_of_one_style_become_one_path() {
        let line =
            |style: &str, points: &str| format!("<polyline {style} points=\"{points} \"/>\n");
        let svg = format!(
            "<svg>\n{}{}{}</svg>\n",
            line("a", "1,2 3,4"),
            line("a", "5,6 7,8"),
            line("b", "1,1 2,2")
        );
        let paths = "<path a d=\"M1,2 3,4M5,6 7,8\"/>\n<path b d=\"M1,1 2,2\"/>\n";
        assert_eq!(joined(&svg), format!("<svg>\n{paths}</svg>\n"));
    }
}
