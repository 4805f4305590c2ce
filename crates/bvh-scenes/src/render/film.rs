//! A picture, assembled from tiles, which are small pictures.

use bvh_core::TestCounts;

/// A picture, or a tile that one thread has drawn, with its numbers of rays and tests. Rows run
/// from the top, and pixels from the left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// The number of pixels per row.
    pub width: u32,
    /// The sRGB colour of each pixel.
    pub pixels: Vec<[u8; 3]>,
    /// The number of tests that all rays of each pixel made against boxes and objects.
    pub tests: Vec<u64>,
    /// The number of tests of the whole picture.
    pub counts: TestCounts,
    /// The number of rays of the whole picture: through pixels, to lights, and along mirror
    /// reflections.
    pub rays: u64,
}

impl Film {
    /// Assembles tiles in rows of `columns`.
    pub fn of_tiles(width: u32, tiles: &[Self], columns: usize) -> Self {
        let mut film = Self { width, ..Self::default() };
        for row in tiles.chunks(columns) {
            // The last row's tiles may be lower than the others.
            let lines = row[0].pixels.len() / row[0].width as usize;
            for y in 0..lines {
                for tile in row {
                    let line = y * tile.width as usize..(y + 1) * tile.width as usize;
                    film.pixels.extend(&tile.pixels[line.clone()]);
                    film.tests.extend(&tile.tests[line]);
                }
            }
        }
        for tile in tiles {
            film.count(tile.counts, tile.rays);
        }
        film
    }

    /// Adds to the tests and rays of the whole picture.
    pub fn count(&mut self, tests: TestCounts, rays: u64) {
        self.counts.boxes += tests.boxes;
        self.counts.objects += tests.objects;
        self.rays += rays;
    }
}
