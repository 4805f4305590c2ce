//! Files of recorded rays: segments of six numbers each, from the origin to the hit.

use bvh_core::Segment;

/// Reads segments, in the scene's coordinates, from a file in the format `npy` or `csv`; in any
/// other format the file is little-endian `f32`. Numbers in f64 are rounded to f32.
///
/// # Errors
///
/// Returns a message for a file that is damaged, has no segments or has a number that is not
/// finite. Messages count lines from 1, as editors do, and segments from 0, as arrays do.
pub fn read(format: &str, bytes: &[u8]) -> Result<Vec<Segment>, String> {
    let numbers = match format {
        "npy" => read_npy(bytes)?,
        "csv" => read_csv(bytes)?,
        _ => read_floats(bytes)?,
    };
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

/// Reads an array of numpy: `float32` or `float64`, little-endian, in row order.
fn read_npy(bytes: &[u8]) -> Result<Vec<f32>, String> {
    let (header, data) = split_npy(bytes).ok_or("the file is not an array of numpy")?;
    let is_in_rows = header.contains("'fortran_order':False");
    let segments = match npy_shape(&header).as_deref() {
        Some(&[segments, 6] | &[segments, 2, 3]) if is_in_rows => segments,
        _ => {
            return Err(format!(
                "the array is {header}; accepted: (n, 6) or (n, 2, 3) in row order"
            ));
        }
    };
    let is_single = header.contains("'descr':'<f4'");
    let is_double = header.contains("'descr':'<f8'");
    if !is_single && !is_double {
        return Err(format!("the array is {header}; accepted: float32 or float64"));
    }
    let size = if is_single { size_of::<f32>() } else { size_of::<f64>() };
    // A copy that was cut off would otherwise train the tree for a part of its rays.
    if segments.checked_mul(6 * size) != Some(data.len()) {
        let bytes = data.len();
        return Err(format!("the array is {header} and has {bytes} bytes of data"));
    }
    if is_single {
        return read_floats(data);
    }
    // The length is right, so no bytes remain.
    let (doubles, _) = data.as_chunks();
    Ok(doubles.iter().map(|&double| f64::from_le_bytes(double) as f32).collect())
}

/// Splits an array of numpy into its header, without spaces, and its data. Returns `None` if the
/// bytes are no such array. The format is described in `numpy.lib.format`.
fn split_npy(bytes: &[u8]) -> Option<(String, &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (&[major, _minor], rest) = rest.split_first_chunk()?;
    // The length of the header has two bytes in version 1, and four in later ones.
    let (length, rest) = if major == 1 {
        let (&length, rest) = rest.split_first_chunk()?;
        (usize::from(u16::from_le_bytes(length)), rest)
    } else {
        let (&length, rest) = rest.split_first_chunk()?;
        (u32::from_le_bytes(length) as usize, rest)
    };
    let (header, data) = rest.split_at_checked(length)?;
    let header = str::from_utf8(header).ok()?;
    Some((header.split_whitespace().collect(), data))
}

fn npy_shape(header: &str) -> Option<Vec<usize>> {
    let (_, rest) = header.split_once("'shape':(")?;
    let (shape, _) = rest.split_once(')')?;
    shape.split(',').map(|length| length.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEGMENT: Segment = Segment { from: [1.0, 2.0, 3.0], to: [4.0, 5.0, -6.5] };

    fn array(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), data].concat()
    }

    #[test]
    fn segments_come_from_all_formats() {
        let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, -6.5];
        let single: Vec<u8> = numbers.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
        let double: Vec<u8> = numbers.iter().flat_map(|&x: &f64| x.to_le_bytes()).collect();
        for (format, bytes) in [
            ("bin", single.clone()),
            ("csv", b"x,y,z,to x,to y,to z\n1,2,3, 4,5,-6.5\n".to_vec()),
            ("csv", b"1,2,3,4,5,-6.5".to_vec()),
            ("csv", "\u{feff}1,2,3,4,5,-6.5\r\n".into()),
            ("npy", array("<f4", "(1, 6)", &single)),
            ("npy", array("<f8", "(1, 2, 3)", &double)),
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
            ("npy", b"PK".to_vec(), "the file is not an array of numpy"),
            (
                "npy",
                array("<i8", "(1, 6)", &[0; 48]),
                "the array is {'descr':'<i8','fortran_order':False,'shape':(1,6),}; \
                 accepted: float32 or float64",
            ),
            (
                "npy",
                array("<f4", "(2, 6)", &[0; 24]),
                "the array is {'descr':'<f4','fortran_order':False,'shape':(2,6),} \
                 and has 24 bytes of data",
            ),
            (
                "npy",
                array("<f8", "(1, 6)", &[0; 52]),
                "the array is {'descr':'<f8','fortran_order':False,'shape':(1,6),} \
                 and has 52 bytes of data",
            ),
            (
                "npy",
                array("<f4", "(1, 1, 6)", &[0; 24]),
                "the array is {'descr':'<f4','fortran_order':False,'shape':(1,1,6),}; \
                 accepted: (n, 6) or (n, 2, 3) in row order",
            ),
        ] {
            assert_eq!(read(format, &bytes).unwrap_err(), message);
        }
    }
}
