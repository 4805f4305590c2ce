//! A finished picture, put together from tiles.

use bvh_core::TestCounts;

/// A finished picture, with the rays and tests that it took. Rows run from the top, pixels from the left.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Pixels per row.
    pub width: u32,
    /// The sRGB colour of each pixel.
    pub pixels: Vec<[u8; 3]>,
    /// For each pixel, the number of tests of all its rays against boxes and objects.
    pub tests: Vec<u64>,
    /// The tests of the whole picture.
    pub counts: TestCounts,
    /// The rays of the whole picture: through pixels, to lights, and along mirror reflections.
    pub rays: u64,
}

/// A rectangle of a picture, drawn by one thread.
pub struct Tile {
    /// Pixels per row.
    pub width: usize,
    /// The colour of each pixel and the number of tests of all its rays, row by row.
    pub pixels: Vec<([u8; 3], u64)>,
    /// The tests of the whole tile.
    pub counts: TestCounts,
    /// The rays of the whole tile.
    pub rays: u64,
}

impl Film {
    /// Puts tiles together, `columns` of them side by side.
    pub fn of_tiles(width: u32, tiles: &[Tile], columns: usize) -> Self {
        let (mut pixels, mut tests) = (Vec::new(), Vec::new());
        let (mut counts, mut rays) = (TestCounts::default(), 0);
        for row in tiles.chunks(columns) {
            let lines = row.iter().map(|tile| tile.pixels.len() / tile.width).max();
            for y in 0..lines.unwrap_or(0) {
                for line in row.iter().filter_map(|tile| tile.pixels.chunks(tile.width).nth(y)) {
                    pixels.extend(line.iter().map(|pixel| pixel.0));
                    tests.extend(line.iter().map(|pixel| pixel.1));
                }
            }
            for tile in row {
                counts.boxes += tile.counts.boxes;
                counts.objects += tile.counts.objects;
                rays += tile.rays;
            }
        }
        Self { width, pixels, tests, counts, rays }
    }
}
