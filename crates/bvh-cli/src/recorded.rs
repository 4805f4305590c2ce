//! Files of recorded rays: segments of six numbers each, from the origin to the hit.

use bvh_core::Segment;

/// Reads segments, in the scene's coordinates, from a file in the format `csv`; in any other format
/// the file is little-endian `f32`.
///
/// # Errors
///
/// Returns a message for a file that is damaged, has no segments or has a number that is not
/// finite. Messages count lines from 1, as editors do, and segments from 0, as arrays do.
pub fn read(format: &str, bytes: &[u8]) -> Result<Vec<Segment>, String> {
    let numbers = if format == "csv" { read_csv(bytes)? } else { read_floats(bytes)? };
    let (segments, rest) = numbers.as_chunks::<6>();
    if !rest.is_empty() {
        let count = numbers.len();
        return Err(format!("there are {count} numbers; accepted: six for each segment"));
    }
    // The search would find these faults too, but only after the first tree of the scene.
    if segments.is_empty() {
        return Err("there are no segments; accepted: one or more".to_owned());
    }
    for (index, segment) in segments.iter().enumerate() {
        if !segment.iter().all(|number| number.is_finite()) {
            return Err(format!("segment {index} is {segment:?}; accepted: finite `f32`"));
        }
    }
    Ok(segments.iter().map(segment).collect())
}

fn segment(&[x, y, z, to_x, to_y, to_z]: &[f32; 6]) -> Segment {
    Segment { from: [x, y, z], to: [to_x, to_y, to_z] }
}

fn read_floats(bytes: &[u8]) -> Result<Vec<f32>, String> {
    let (floats, rest) = bytes.as_chunks();
    if !rest.is_empty() {
        // The caller rejects whole numbers that are no whole segments of 24 bytes.
        return Err(format!("there are {} bytes; accepted: a multiple of 24", bytes.len()));
    }
    Ok(floats.iter().map(|&float| f32::from_le_bytes(float)).collect())
}

/// Reads lines of six numbers, separated by commas. The first line may be a header, which has no
/// number, and lines may be blank.
fn read_csv(bytes: &[u8]) -> Result<Vec<f32>, String> {
    let text = str::from_utf8(bytes).map_err(|_| "the file is not UTF-8".to_owned())?;
    // Spreadsheets begin UTF-8 with this mark, which would make the first number a word.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut numbers = Vec::new();
    for (line_number, line) in (1..).zip(text.lines()) {
        let fields: Vec<Option<f32>> =
            line.split(',').map(|field| field.trim().parse().ok()).collect();
        let is_header = line_number == 1 && fields.iter().all(Option::is_none);
        if is_header || line.trim().is_empty() {
            continue;
        }
        let &[Some(x), Some(y), Some(z), Some(to_x), Some(to_y), Some(to_z)] = &fields[..] else {
            return Err(format!("line {line_number} is {line:?}; accepted: six numbers"));
        };
        numbers.extend([x, y, z, to_x, to_y, to_z]);
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEGMENT: Segment = Segment { from: [1.0, 2.0, 3.0], to: [4.0, 5.0, -6.5] };

    #[test]
    fn segments_come_from_all_formats() {
        let floats = [1.0f32, 2.0, 3.0, 4.0, 5.0, -6.5].map(f32::to_le_bytes).concat();
        for (format, bytes) in [
            ("bin", floats),
            ("csv", b"x,y,z,to x,to y,to z\n1,2,3, 4,5,-6.5\n".to_vec()),
            ("csv", b"1,2,3,4,5,-6.5".to_vec()),
            ("csv", "\u{feff}1,2,3,4,5,-6.5\r\n".into()),
        ] {
            assert_eq!(read(format, &bytes), Ok(vec![SEGMENT]), "{format}");
        }
    }

    #[test]
    fn faults_are_named() {
        for (format, bytes, message) in [
            ("bin", vec![0; 7], "there are 7 bytes; accepted: a multiple of 24"),
            ("bin", vec![0; 28], "there are 7 numbers; accepted: six for each segment"),
            ("csv", b"1,2,3,4,5,6\n1,2,3".to_vec(), "line 2 is \"1,2,3\"; accepted: six numbers"),
            (
                "csv",
                b"1,2,3,4,5,6.5.0\n1,2,3,4,5,6".to_vec(),
                "line 1 is \"1,2,3,4,5,6.5.0\"; accepted: six numbers",
            ),
            (
                "csv",
                b"x,y,z,to x,to y,to z\n".to_vec(),
                "there are no segments; accepted: one or more",
            ),
            ("bin", vec![], "there are no segments; accepted: one or more"),
            (
                "csv",
                b"1,2,3,4,5,6\n1,2,3,4,nan,1e40".to_vec(),
                "segment 1 is [1.0, 2.0, 3.0, 4.0, NaN, inf]; accepted: finite `f32`",
            ),
        ] {
            assert_eq!(read(format, &bytes).unwrap_err(), message);
        }
    }
}
