//! The heat map: the number of tests of each pixel as a colour.

use super::image::Film;

/// Every sixteenth colour of matplotlib's 'inferno' (van der Walt & Smith 2015; CC0), whose
/// brightness increases evenly to the eye.
pub const INFERNO: [[u8; 3]; 17] = [
    [0, 0, 4],
    [11, 7, 36],
    [32, 12, 74],
    [60, 9, 101],
    [87, 16, 110],
    [114, 25, 110],
    [140, 41, 99],
    [165, 53, 92],
    [188, 55, 84],
    [209, 70, 67],
    [227, 89, 51],
    [241, 113, 31],
    [249, 142, 9],
    [252, 172, 17],
    [249, 203, 53],
    [242, 234, 105],
    [252, 255, 164],
];

/// The distribution of a heat map's values: tests per ray through a pixel, with the tests of the
/// rays that follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The smallest value.
    pub min: f64,
    /// The median.
    pub median: f64,
    /// The value that one pixel in two hundred exceeds. The colours end here, because a few extreme
    /// pixels would darken all others.
    pub top: f64,
    /// The largest value.
    pub max: f64,
}

/// Returns the distribution of the tests of pixels with this many rays through each.
pub fn range(mut tests: Vec<u64>, rays_per_pixel: u32) -> Range {
    tests.sort_unstable();
    // A film without pixels has zeros.
    let last = tests.len().saturating_sub(1);
    let [min, median, top, max] = [0, last / 2, last - last / 200, last].map(|index| {
        let tests = tests.get(index).copied().unwrap_or(0);
        tests as f64 / f64::from(rays_per_pixel)
    });
    Range { min, median, top, max }
}

/// Returns the colours of a film's pixels. They end at `top` tests of a pixel.
pub fn colours(film: &Film, top: f64) -> Vec<[u8; 3]> {
    // A picture without tests has the top 0, and its colours would be 0 / 0.
    let top = top.max(f64::MIN_POSITIVE);
    film.tests.iter().map(|&tests| colour(tests as f64 / top)).collect()
}

/// Returns the colour of a value relative to the range, 0 to 1. Larger values have the last colour.
fn colour(value: f64) -> [u8; 3] {
    let place = value.clamp(0.0, 1.0) * (INFERNO.len() - 1) as f64;
    let index = (place as usize).min(INFERNO.len() - 2);
    let part = place - index as f64;
    [0, 1, 2].map(|channel| {
        let low = f64::from(INFERNO[index][channel]);
        let high = f64::from(INFERNO[index + 1][channel]);
        (low + (high - low) * part + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_extreme_pixels_change_only_the_maximum() {
        let mut tests: Vec<u64> = (0..1000).collect();
        tests[500] = 1_000_000;
        // 499 is now the five hundredth of a thousand values.
        let range = range(tests, 4);
        assert_eq!((range.min, range.median, range.max), (0.0, 499.0 / 4.0, 250_000.0));
        assert!(range.top > 240.0 && range.top < 250.0, "{range:?}");
    }

    #[test]
    fn more_tests_are_brighter() {
        let shades: Vec<f64> = (0..=64)
            .map(|i| colour(f64::from(i) / 64.0).map(f64::from))
            .map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
            .collect();
        assert!(shades.is_sorted_by(|a, b| a < b), "{shades:?}");
    }

    #[test]
    fn the_same_number_of_tests_has_one_colour_under_one_scale() {
        let film = Film { tests: vec![5, 10], ..Film::default() };
        assert_eq!(colours(&film, 10.0), [colour(0.5), colour(1.0)]);
    }

    #[test]
    fn a_picture_without_tests_has_a_heat_map_too() {
        let film = Film { tests: vec![0; 40], ..Film::default() };
        assert_eq!(colours(&film, range(film.tests.clone(), 1).top), [INFERNO[0]; 40]);
    }
}
