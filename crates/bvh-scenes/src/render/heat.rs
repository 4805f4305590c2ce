//! The heat map: the number of tests of each pixel as a colour of matplotlib's 'inferno', whose
//! brightness increases evenly to the eye.

use super::image::Film;
use colorous::INFERNO;

/// The distribution of a heat map's values: the tests of a pixel's rays and of those that follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The median.
    pub median: f64,
    /// The value that one pixel in two hundred exceeds. The colours end here, because a few extreme
    /// pixels would darken all others.
    pub top: f64,
}

/// Returns the distribution of the tests of pixels.
pub fn range(mut tests: Vec<u64>) -> Range {
    tests.sort_unstable();
    // A film without pixels has zeros.
    let last = tests.len().saturating_sub(1);
    let [median, top] = [last / 2, last - last / 200]
        .map(|index| tests.get(index).map_or(0.0, |&tests| tests as f64));
    Range { median, top }
}

/// Returns the colours of a film's pixels. They end at `top` tests of a pixel.
pub fn colours(film: &Film, top: f64) -> Vec<[u8; 3]> {
    // A picture without tests has the top 0, and its colours would be 0 / 0.
    let top = top.max(f64::MIN_POSITIVE);
    film.tests.iter().map(|&tests| INFERNO.eval_continuous(tests as f64 / top).as_array()).collect()
}

/// Returns `count` colours of the scale, from no tests to the last colour, evenly apart.
pub fn scale(count: usize) -> Vec<[u8; 3]> {
    (0..count).map(|i| INFERNO.eval_rational(i, count).as_array()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_extreme_pixels_change_neither_the_median_nor_the_last_colour() {
        let mut tests: Vec<u64> = (0..1000).collect();
        tests[500] = 1_000_000;
        // 499 is now the five hundredth of a thousand values.
        let range = range(tests);
        assert_eq!(range.median, 499.0);
        assert!(range.top > 960.0 && range.top < 1000.0, "{range:?}");
    }

    #[test]
    fn more_tests_are_brighter_up_to_the_top_and_a_picture_without_tests_is_dark() {
        let film = |tests: Vec<u64>| Film { tests, ..Film::default() };
        let shades: Vec<f64> = colours(&film((0..=64).collect()), 64.0)
            .iter()
            .map(|colour| colour.map(f64::from))
            .map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
            .collect();
        assert!(shades.is_sorted_by(|a, b| a < b), "{shades:?}");
        assert_eq!(colours(&film(vec![5, 9]), 5.0), [scale(2)[1]; 2]);
        let dark = film(vec![0; 40]);
        assert_eq!(colours(&dark, range(dark.tests.clone()).top), [scale(2)[0]; 40]);
    }
}
