//! Measures and wraps text in the embedded fonts, so that no figure depends on the machine's fonts.

use ab_glyph::{Font, FontRef};

/// The font DejaVu Sans, reduced to the characters that figures use.
const REGULAR: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");
/// The font DejaVu Sans Bold, reduced to the same characters.
const BOLD: &[u8] = include_bytes!("../assets/DejaVuSans-Bold-subset.ttf");

/// The `font-family` of SVGs: DejaVu Sans, then fonts that are not wider.
pub(super) const FAMILY: &str = "DejaVu Sans, Verdana, Arial, sans-serif";

/// Size and weight of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Type {
    /// Font size in pixels.
    pub size: f64,
    /// True for bold.
    pub bold: bool,
}

impl Type {
    /// Distance between two baselines in pixels.
    pub fn line(self) -> f64 {
        1.3 * self.size
    }
}

/// The type of figure titles.
pub(super) const TITLE: Type = Type { size: 19.0, bold: true };
/// The type of panel titles.
pub(super) const HEADING: Type = Type { size: 16.0, bold: true };
/// The type of all other text: legible where a phone shows the figure 390 pixels wide.
pub(super) const BODY: Type = Type { size: 16.0, bold: false };

/// The embedded fonts.
pub struct Fonts {
    regular: FontRef<'static>,
    bold: FontRef<'static>,
}

impl Fonts {
    /// Parses the embedded fonts.
    pub fn new() -> Self {
        let [regular, bold] = [REGULAR, BOLD]
            .map(|bytes| FontRef::try_from_slice(bytes).expect("the file is a font"));
        Self { regular, bold }
    }

    /// Returns the advance of a character in pixels. A missing character has that of a box.
    fn advance(&self, character: char, style: Type) -> f64 {
        let font = if style.bold { &self.bold } else { &self.regular };
        let advance = font.h_advance_unscaled(font.glyph_id(character));
        style.size * f64::from(advance / font.units_per_em().unwrap_or(1.0))
    }

    /// Returns the width of a line of text in pixels, without kerning.
    pub fn width(&self, text: &str, style: Type) -> f64 {
        text.chars().map(|character| self.advance(character, style)).sum()
    }

    /// Returns the largest width among lines of text in pixels.
    pub fn widest<'a>(&self, lines: impl IntoIterator<Item = &'a String>, style: Type) -> f64 {
        lines.into_iter().map(|line| self.width(line, style)).fold(0.0, f64::max)
    }

    /// Breaks a text at blanks into lines of at most `width` pixels. A wider word is broken
    /// anywhere. An empty text has no lines.
    pub fn wrap(&self, text: &str, width: f64, style: Type) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        let mut line = String::new();
        for word in text.split_whitespace() {
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
        lines.extend(Some(line).filter(|line| !line.is_empty()));
        lines
    }

    /// Returns the text, or its longest beginning that fits `width` pixels with an ellipsis.
    pub fn shorten(&self, text: &str, width: f64, style: Type) -> String {
        if self.width(text, style) <= width {
            return text.to_owned();
        }
        let mut room = width - self.width("…", style);
        let fits = |character: &char| {
            room -= self.advance(*character, style);
            room >= 0.0
        };
        let kept: String = text.chars().take_while(fits).collect();
        format!("{}…", kept.trim_end())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_broken_at_blanks_into_lines_that_fit_or_cut_with_an_ellipsis() {
        let fonts = Fonts::new();
        let words = "gap against seconds, median and quartiles of 25 seeds";
        let lines = fonts.wrap(words, 120.0, BODY);
        assert!(lines.len() > 1 && fonts.widest(&lines, BODY) <= 120.0);
        assert_eq!(lines.join(" "), words);
        assert_eq!(
            fonts.wrap("incomprehensibilities", 60.0, BODY).concat(),
            "incomprehensibilities"
        );
        assert_eq!((fonts.wrap("", 60.0, BODY).len(), fonts.wrap("ab", 0.0, BODY).len()), (0, 2));
        let short = fonts.shorten("interlocking staircases", 80.0, BODY);
        assert!(short.ends_with('…') && fonts.width(&short, BODY) <= 80.0);
        assert_eq!(fonts.shorten("jewel", 80.0, BODY), "jewel");
    }

    #[test]
    fn the_fonts_have_the_characters_of_figures() {
        let fonts = Fonts::new();
        for character in "aZ09 äéñß αΩπσ ×÷±−≤≥≈∞√∑ ⁰¹²³⁴⁵⁶⁷⁸⁹⁻ ₀₁₉ ←→↑↓ …–—’“” °µ½ ✓✗ ●■▲".chars()
        {
            assert_ne!(fonts.regular.glyph_id(character).0, 0, "no {character}");
        }
    }
}
