//! Pictures as PNG files.

use std::io;

/// Encodes pixels, row by row from the top, as a PNG file with the highest compression.
pub fn png(width: u32, pixels: &[[u8; 3]]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, pixels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoded_pixels_equal_the_encoded_ones() {
        let pixels = [[1, 2, 3], [255, 0, 128], [9, 9, 9], [0, 0, 0], [7, 70, 250], [4, 5, 6]];
        let bytes = png(3, &pixels).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(bytes)).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut read).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (3, 2, png::ColorType::Rgb));
        assert_eq!(read, pixels.as_flattened());
    }
}
