//! Recorded rays and points as an array that `numpy.save` wrote.

/// Returns the numbers of an array, `float32` or `float64` in either order of bytes, row by row, in
/// whatever order the file has them, and how many are in a row: of shape (n, `width`) for one of the
/// `widths`, and also (n, 2, 3) where six are accepted. Doubles are rounded. The format is described
/// in `numpy.lib.format`.
///
/// # Errors
///
/// Returns a message for bytes that are no such array, or less or more of it than its shape says.
pub fn read_npy(bytes: &[u8], widths: &[usize]) -> Result<(usize, Vec<f32>), String> {
    let (header, data) = split(bytes).ok_or("the file is not an array of numpy")?;
    let rejected = |accepted: &str| Err(format!("the array is {header}; accepted: {accepted}"));
    let kind = header.split_once("'descr':'").and_then(|(_, rest)| rest.split_once('\''));
    let (is_big, size) = match kind.map(|(kind, _)| kind) {
        Some("<f4") => (false, size_of::<f32>()),
        Some("<f8") => (false, size_of::<f64>()),
        Some(">f4") => (true, size_of::<f32>()),
        Some(">f8") => (true, size_of::<f64>()),
        _ => return rejected("float32 or float64"),
    };
    // The column of each of a row's numbers, of the array of columns.
    let (rows, columns) = match shape(&header).as_deref() {
        Some(&[rows, width]) if widths.contains(&width) => (rows, (0..width).collect()),
        Some(&[rows, 2, 3]) if widths.contains(&6) => (rows, vec![0, 2, 4, 1, 3, 5]),
        _ if widths.contains(&3) => return rejected("(n, 3), (n, 6) or (n, 2, 3)"),
        _ => return rejected("(n, 6) or (n, 2, 3)"),
    };
    let width = columns.len();
    // A copy that was cut off would otherwise train the tree for a part of its rays.
    if rows.checked_mul(width * size) != Some(data.len()) {
        return Err(format!("the array is {header} and has {} bytes of data", data.len()));
    }
    let single = |&bytes: &[u8; 4]| match is_big {
        true => f32::from_be_bytes(bytes),
        false => f32::from_le_bytes(bytes),
    };
    let double = |&bytes: &[u8; 8]| match is_big {
        true => f64::from_be_bytes(bytes) as f32,
        false => f64::from_le_bytes(bytes) as f32,
    };
    let numbers: Vec<f32> = match size {
        4 => data.as_chunks().0.iter().map(single).collect(),
        _ => data.as_chunks().0.iter().map(double).collect(),
    };
    if !header.contains("'fortran_order':True") {
        return Ok((width, numbers));
    }
    let row = |row| columns.iter().map(move |column| column * rows + row);
    Ok((width, (0..rows).flat_map(row).map(|place| numbers[place]).collect()))
}

/// Splits an array into its header, without spaces, and its data.
fn split(bytes: &[u8]) -> Option<(String, &[u8])> {
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
    Some((str::from_utf8(header).ok()?.split_whitespace().collect(), data))
}

fn shape(header: &str) -> Option<Vec<usize>> {
    let (_, rest) = header.split_once("'shape':(")?;
    let (shape, _) = rest.split_once(')')?;
    shape.split(',').map(|length| length.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        in_order("False", kind, shape, data)
    }

    fn in_order(columns: &str, kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header =
            format!("{{'descr': '{kind}', 'fortran_order': {columns}, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), data].concat()
    }

    #[test]
    fn arrays_of_both_precisions_and_shapes_are_read() {
        let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, -6.5f32];
        let single = numbers.map(f32::to_le_bytes).concat();
        let double = numbers.map(|x| f64::from(x).to_le_bytes()).concat();
        let read = |array: &[u8], widths| read_npy(array, widths).unwrap();
        let six = (6, numbers.to_vec());
        assert_eq!(read(&array("<f4", "(1, 6)", &single), &[6]), six);
        assert_eq!(read(&array("<f8", "(1, 2, 3)", &double), &[6]), six);
        assert_eq!(read(&array("<f4", "(2, 3)", &single), &[3, 6]), (3, numbers.to_vec()));
        let single = numbers.map(f32::to_be_bytes).concat();
        let double = numbers.map(|x| f64::from(x).to_be_bytes()).concat();
        assert_eq!(read(&array(">f4", "(1, 6)", &single), &[6]), six);
        assert_eq!(read(&array(">f8", "(1, 2, 3)", &double), &[6]), six);
    }

    #[test]
    fn arrays_in_the_order_of_columns_give_the_same_segments() {
        // Row by row, the numbers are 0 to 11.
        let rows: Vec<f32> = (0..12u8).map(f32::from).collect();
        let bytes = |order: [u8; 12]| order.map(|x| f32::from(x).to_le_bytes()).concat();
        let pairs = bytes([0, 6, 1, 7, 2, 8, 3, 9, 4, 10, 5, 11]);
        let triples = bytes([0, 6, 3, 9, 1, 7, 4, 10, 2, 8, 5, 11]);
        let read = |array: &[u8]| read_npy(array, &[6]).unwrap().1;
        assert_eq!(read(&in_order("True", "<f4", "(2, 6)", &pairs)), rows);
        assert_eq!(read(&in_order("True", "<f4", "(2, 2, 3)", &triples)), rows);
    }

    #[test]
    fn other_arrays_are_rejected_by_what_they_are() {
        for (bytes, message) in [
            (b"PK".to_vec(), "not an array"),
            (array("<i8", "(1, 6)", &[0; 48]), "accepted: float32 or float64"),
            (array("<f2", "(1, 6)", &[0; 12]), "accepted: float32 or float64"),
            (array("<f4", "(2, 6)", &[0; 24]), "has 24 bytes of data"),
            (array("<f8", "(1, 6)", &[0; 52]), "has 52 bytes of data"),
            (array("<f4", "(1, 1, 6)", &[0; 24]), "accepted: (n, 6) or (n, 2, 3)"),
            (array("<f4", "(6,)", &[0; 24]), "accepted: (n, 6) or (n, 2, 3)"),
        ] {
            let found = read_npy(&bytes, &[6]).unwrap_err();
            assert!(found.contains(message), "{found}");
        }
    }
}
