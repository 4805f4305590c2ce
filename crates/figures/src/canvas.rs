//! A sheet of SVG in pixels, y downwards.

use std::fmt::Write as _;

use super::text::{FAMILY, Type};

/// A colour of SVG.
pub(super) type Colour = &'static str;

/// The colour of the background.
pub(super) const WHITE: Colour = "#FFFFFF";

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
pub(super) struct Sheet(String);

/// Writes a length to a tenth of a pixel, which is enough for the eye and the same on every
/// machine.
fn px(length: f64) -> f64 {
    // Adding 0 turns −0 into 0.
    (10.0 * length.clamp(-1e5, 1e5)).round() / 10.0 + 0.0
}

/// Replaces the characters that XML does not allow in texts.
fn escaped(text: &str) -> String {
    let legal = |c: char| !c.is_control() && c != '\u{fffe}' && c != '\u{ffff}';
    let text: String = text.chars().map(|c| if legal(c) { c } else { ' ' }).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns the commands of a path through these points.
fn path(points: &[Point]) -> String {
    let mut commands = String::new();
    for (x, y) in points {
        let before = if commands.is_empty() { 'M' } else { ' ' };
        let _ = write!(commands, "{before}{},{}", px(*x), px(*y));
    }
    commands
}

impl Sheet {
    /// Begins a document of this size. Screen readers read the title.
    pub fn new(title: &str, (width, height): (f64, f64)) -> Self {
        let (width, height) = (width.ceil(), height.ceil());
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" stroke-linejoin=\"round\" fill=\"none\" \
             font-family=\"{FAMILY}\">\n<title>{}</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"{WHITE}\"/>\n",
            escaped(title),
        ))
    }

    /// Ends the document.
    pub fn finish(self) -> String {
        self.0 + "</svg>\n"
    }

    /// Draws a line of text.
    pub fn text(&mut self, (x, y): Point, text: &str, style: Type, colour: Colour, align: Align) {
        let anchor = match align {
            Align::Left => "start",
            Align::Center | Align::Up => "middle",
            Align::Right => "end",
        };
        let turn = if align == Align::Up { -90 } else { 0 };
        let weight = if style.bold { " font-weight=\"bold\"" } else { "" };
        let (x, y, size) = (px(x), px(y), style.size);
        let _ = writeln!(
            self.0,
            "<text transform=\"translate({x} {y}) rotate({turn})\" y=\".35em\" \
             text-anchor=\"{anchor}\" font-size=\"{size}\"{weight} fill=\"{colour}\">{}</text>",
            escaped(text),
        );
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
        let opacity = if opacity < 1.0 { format!(" opacity=\"{opacity}\"") } else { String::new() };
        let _ = writeln!(self.0, "<path d=\"{}\" fill=\"{colour}\"{opacity}/>", path(corners));
    }

    /// Fills a polygon over its edge, of which the outer half is seen.
    pub fn marker(&mut self, corners: &[Point], fill: Colour, edge: Colour, width: f64) {
        let _ = writeln!(
            self.0,
            "<path d=\"{}z\" fill=\"{fill}\" stroke=\"{edge}\" stroke-width=\"{}\" \
             paint-order=\"stroke\"/>",
            path(corners),
            px(width),
        );
    }

    /// Fills a rectangle.
    pub fn rectangle(&mut self, frame: Frame, colour: Colour, opacity: f64) {
        let Frame { left, top, width, height } = frame;
        let (right, bottom) = (left + width, top + height);
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        self.polygon(&corners, colour, opacity);
    }

    /// Draws a line through these points.
    pub fn line(&mut self, points: &[Point], colour: Colour, width: f64, dash: Dash) {
        let dash =
            dash.map_or_else(String::new, |(on, off)| format!(" stroke-dasharray=\"{on} {off}\""));
        let _ = writeln!(
            self.0,
            "<path d=\"{}\" stroke=\"{colour}\" stroke-width=\"{width}\"{dash}/>",
            path(points),
        );
    }
}
