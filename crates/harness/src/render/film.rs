//! A finished picture with what it took, put together from tiles.

use bvh_core::TestCounts;

/// A finished picture, and what it took. Rows from the top, pixels from the left.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// In pixels.
    pub width: u32,
    /// Red, green, blue of each pixel, sRGB.
    pub pixels: Vec<[u8; 3]>,
    /// Per pixel, the tests of all its rays against boxes and objects.
    pub tests: Vec<u64>,
    /// The tests of the whole picture.
    pub counts: TestCounts,
    /// The rays of the whole picture: through pixels, to lights, and mirrored.
    pub rays: u64,
}

/// One tile: its pixels row by row, and the tests of each.
pub struct Tile {
    /// In pixels.
    pub width: usize,
    /// Colour, and tests of all rays.
    pub pixels: Vec<([u8; 3], u64)>,
    /// As the film's.
    pub counts: TestCounts,
    /// As the film's.
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
