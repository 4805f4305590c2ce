//! Measures and breaks text, in the embedded font, so that a layout needs no font of the machine.

use skrifa::charmap::Charmap;
use skrifa::instance::{LocationRef, Size};
use skrifa::metrics::GlyphMetrics;
use skrifa::{FontRef, MetadataProvider};

use super::model::ChartError;

/// DejaVu Sans, reduced to the characters figures use.
pub(super) const REGULAR: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");
/// DejaVu Sans Bold, reduced likewise.
pub(super) const BOLD: &[u8] = include_bytes!("../../assets/DejaVuSans-Bold-subset.ttf");

/// The font's name, and what viewers without it should take: fonts not wider than it.
pub(super) const FAMILY: &str = "DejaVu Sans, Verdana, Arial, sans-serif";

/// Height of a text line in font sizes.
pub(super) const LINE: f64 = 1.3;

/// Size and weight of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Type {
    /// Font size in pixels.
    pub size: f64,
    pub bold: bool,
}

impl Type {
    /// Distance between the middles of two lines, in pixels.
    pub fn line(self) -> f64 {
        self.size * LINE
    }
}

/// Figure titles.
pub(super) const TITLE: Type = Type { size: 17.0, bold: true };
/// Panel titles.
pub(super) const HEADING: Type = Type { size: 14.0, bold: true };
/// Captions, axis labels and legends.
pub(super) const BODY: Type = Type { size: 13.0, bold: false };
/// Ticks, notes and cells.
pub(super) const SMALL: Type = Type { size: 12.0, bold: false };

/// Widths of characters.
pub(super) struct Ruler {
    regular: (Charmap<'static>, GlyphMetrics<'static>),
    bold: (Charmap<'static>, GlyphMetrics<'static>),
}

impl Ruler {
    pub fn new() -> Result<Self, ChartError> {
        let face = |bytes| {
            let font = FontRef::new(bytes).map_err(|error| ChartError::Font { reason: error.to_string() })?;
            Ok((font.charmap(), font.glyph_metrics(Size::new(1.0), LocationRef::default())))
        };
        Ok(Self { regular: face(REGULAR)?, bold: face(BOLD)? })
    }

    /// Width of a line of text in pixels. Characters the font lacks count as one font size.
    pub fn width(&self, text: &str, style: Type) -> f64 {
        let (map, metrics) = if style.bold { &self.bold } else { &self.regular };
        let advance = |character| map.map(character).and_then(|glyph| metrics.advance_width(glyph));
        text.chars().map(|character| f64::from(advance(character).unwrap_or(1.0))).sum::<f64>() * style.size
    }

    /// The largest width among lines of text, in pixels.
    pub fn widest<'a>(&self, lines: impl IntoIterator<Item = &'a str>, style: Type) -> f64 {
        lines.into_iter().map(|line| self.width(line, style)).fold(0.0, f64::max)
    }

    /// The text in lines no wider than `width` pixels, broken at blanks, and inside words only where
    /// a word alone is wider. Empty text has no lines.
    pub fn wrap(&self, text: &str, width: f64, style: Type) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for paragraph in text.lines() {
            let mut line = String::new();
            for word in paragraph.split_whitespace() {
                let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
                if self.width(&longer, style) <= width {
                    line = longer;
                    continue;
                }
                if !line.is_empty() {
                    lines.push(std::mem::take(&mut line));
                }
                for character in word.chars() {
                    line.push(character);
                    if self.width(&line, style) > width && line.chars().nth(1).is_some() {
                        line.pop();
                        lines.push(std::mem::replace(&mut line, character.to_string()));
                    }
                }
            }
            if !line.is_empty() {
                lines.push(line);
            }
        }
        lines
    }

    /// The text, or as much of its beginning as fits `width` pixels with an ellipsis.
    pub fn shorten(&self, text: &str, width: f64, style: Type) -> String {
        if self.width(text, style) <= width {
            return text.to_owned();
        }
        let room = width - self.width("…", style);
        let mut taken = 0.0;
        let fits = |character: &char| {
            taken += self.width(character.encode_utf8(&mut [0; 4]), style);
            taken <= room
        };
        let kept: String = text.chars().take_while(fits).collect();
        format!("{}…", kept.trim_end())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_broken_at_blanks_into_lines_that_fit() {
        let ruler = Ruler::new().unwrap();
        let words = "gap against seconds, median and quartiles of 25 seeds";
        let lines = ruler.wrap(words, 120.0, BODY);
        assert!(lines.len() > 1);
        assert!(lines.iter().all(|line| ruler.width(line, BODY) <= 120.0));
        assert_eq!(lines.join(" "), words);
        assert_eq!(ruler.wrap("incomprehensibilities", 60.0, BODY).concat(), "incomprehensibilities");
        assert!(ruler.wrap("", 60.0, BODY).is_empty());
        assert_eq!(ruler.wrap("ab", 0.0, BODY), ["a", "b"]);
    }

    #[test]
    fn shortened_text_ends_with_an_ellipsis_and_fits() {
        let ruler = Ruler::new().unwrap();
        let short = ruler.shorten("interlocking staircases", 80.0, SMALL);
        assert!(short.ends_with('…') && ruler.width(&short, SMALL) <= 80.0);
        assert_eq!(ruler.shorten("jewel", 80.0, SMALL), "jewel");
    }

    #[test]
    fn the_font_has_the_characters_of_figures() {
        let ruler = Ruler::new().unwrap();
        for character in "aZ09 äéñß αΩπσ ×÷±−≤≥≈∞√∑ ⁰¹²³⁴⁵⁶⁷⁸⁹⁻ ₀₁₉ ←→↑↓ …–—’“” °µ½ ✓✗ ●■▲".chars()
        {
            assert!(ruler.regular.0.map(character).is_some(), "no {character}");
        }
    }
}
