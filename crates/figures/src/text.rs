//! Measures and wraps text by the widths of DejaVu Sans, so that no figure depends on the machine's
//! fonts.

/// The advances of DejaVu Sans from the blank to the tilde, in thousandths of the font's size.
const ADVANCES: [u16; 95] = [
    318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361, 318, 337, 636, 636, 636,
    636, 636, 636, 636, 636, 636, 636, 337, 337, 838, 838, 838, 531, 1000, 684, 686, 698, 770, 632,
    575, 775, 752, 295, 295, 656, 557, 863, 748, 787, 603, 787, 695, 635, 611, 732, 684, 989, 685,
    611, 685, 390, 337, 390, 838, 500, 500, 613, 635, 550, 635, 615, 352, 635, 634, 278, 278, 579,
    278, 974, 634, 612, 635, 635, 411, 521, 392, 634, 592, 818, 592, 592, 525, 636, 337, 636, 838,
];

/// The widest that lines of the bold font are, over those of the regular one.
const BOLD: f64 = 1.15;

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

/// Returns the advance of a character in pixels.
fn advance(character: char, style: Type) -> f64 {
    let advance = match (ADVANCES.get((character as usize).wrapping_sub(32)), character) {
        (Some(&advance), _) => advance,
        (None, '–' | '‘' | '’') => 500,
        (None, letter) if letter.is_alphabetic() => 650,
        (None, _) => 838,
    };
    let weight = if style.bold { BOLD } else { 1.0 };
    style.size * weight * f64::from(advance) / 1000.0
}

/// Returns the width of a line of text in pixels, without kerning.
pub fn width(text: &str, style: Type) -> f64 {
    text.chars().map(|character| advance(character, style)).sum()
}

/// Returns the largest width among lines of text in pixels.
pub fn widest<'a>(lines: impl IntoIterator<Item = &'a String>, style: Type) -> f64 {
    lines.into_iter().map(|line| width(line, style)).fold(0.0, f64::max)
}

/// Breaks a text at blanks into lines of at most `room` pixels. A wider word is broken
/// anywhere. An empty text has no lines.
pub fn wrap(text: &str, room: f64, style: Type) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        if width(&longer, style) <= room {
            line = longer;
            continue;
        }
        if !line.is_empty() {
            lines.push(std::mem::take(&mut line));
        }
        for character in word.chars() {
            line.push(character);
            if width(&line, style) > room && line.chars().nth(1).is_some() {
                line.pop();
                lines.push(std::mem::replace(&mut line, character.to_string()));
            }
        }
    }
    lines.extend(Some(line).filter(|line| !line.is_empty()));
    lines
}

/// Returns the text, or its longest beginning that fits `room` pixels with an ellipsis.
pub fn shorten(text: &str, room: f64, style: Type) -> String {
    if width(text, style) <= room {
        return text.to_owned();
    }
    let mut room = room - width("…", style);
    let fits = |character: &char| {
        room -= advance(*character, style);
        room >= 0.0
    };
    let kept: String = text.chars().take_while(fits).collect();
    format!("{}…", kept.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_broken_at_blanks_into_lines_that_fit_or_cut_with_an_ellipsis() {
        let words = "gap against seconds, median and quartiles of 25 seeds";
        let lines = wrap(words, 120.0, BODY);
        assert!(lines.len() > 1 && widest(&lines, BODY) <= 120.0);
        assert_eq!(lines.join(" "), words);
        assert_eq!(wrap("incomprehensibilities", 60.0, BODY).concat(), "incomprehensibilities");
        assert_eq!((wrap("", 60.0, BODY).len(), wrap("ab", 0.0, BODY).len()), (0, 2));
        let short = shorten("interlocking staircases", 80.0, BODY);
        assert!(short.ends_with('…') && width(&short, BODY) <= 80.0);
        assert_eq!(shorten("jewel", 80.0, BODY), "jewel");
    }
}
