//! The numbers of a glTF file: accessors and their views.

use super::buffers::Buffers;
use super::document::Accessor;
use super::{MOST_ITEMS, get};

/// The types of numbers.
pub const I8: u32 = 5120;
pub const U8: u32 = 5121;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// The names and the numbers of bytes of the types.
const TYPES: [(u32, &str, usize); 6] = [
    (I8, "byte", 1),
    (U8, "unsigned byte", 1),
    (I16, "short", 2),
    (U16, "unsigned short", 2),
    (U32, "unsigned int", 4),
    (F32, "float", 4),
];

fn name(component: u32) -> String {
    let known = TYPES.iter().find(|(number, ..)| *number == component);
    known.map_or_else(|| format!("component type {component}"), |(_, name, _)| (*name).into())
}

fn size(component: u32) -> usize {
    TYPES.iter().find(|(number, ..)| *number == component).map_or(4, |(.., size)| *size)
}

/// Returns the number in the first bytes. A normalised integer is a fraction of the largest one.
fn decode(bytes: &[u8], component: u32, normalized: bool) -> f64 {
    let little = bytes.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte));
    let (number, largest) = match component {
        I8 => (f64::from(little as i8), 127.0),
        U8 => (f64::from(little), 255.0),
        I16 => (f64::from(little as i16), 32767.0),
        U16 => (f64::from(little), 65535.0),
        U32 => (f64::from(little), f64::from(u32::MAX)),
        _ => return f64::from(f32::from_bits(little)),
    };
    if normalized { (number / largest).max(-1.0) } else { number }
}

impl Buffers<'_> {
    /// Reads an accessor whose items have `N` numbers of one of the types `wanted`.
    pub fn accessor<const N: usize>(
        &mut self,
        index: usize,
        wanted: &[u32],
    ) -> Result<Vec<[f64; N]>, String> {
        let accessor = get(&self.document.accessors, index, "accessors")?;
        self.items(accessor, wanted).map_err(|message| format!("accessors[{index}]: {message}"))
    }

    fn items<const N: usize>(
        &mut self,
        accessor: &Accessor,
        wanted: &[u32],
    ) -> Result<Vec<[f64; N]>, String> {
        let Accessor { count, component_type: component, normalized, .. } = *accessor;
        let type_ = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        if accessor.type_ != type_ || !wanted.contains(&component) {
            let wanted: Vec<String> = wanted.iter().map(|&component| name(component)).collect();
            return Err(format!(
                "{} of {}; expected {type_} of {}",
                accessor.type_,
                name(component),
                wanted.join(" or ")
            ));
        }
        // A few accessors over the same bytes can stand for any number of items.
        self.item_count = self.item_count.saturating_add(count as u64);
        if self.item_count > MOST_ITEMS {
            return Err(format!(
                "{count} items, {} with those before; expected at most {MOST_ITEMS}",
                self.item_count
            ));
        }
        if count == 0 {
            return Ok(Vec::new());
        }
        let number = accessor.buffer_view.filter(|_| accessor.sparse.is_none()).ok_or(
            "items that are not all in a buffer view; expected them there (sparse accessors cannot \
             be read)",
        )?;
        let view = get(&self.document.buffer_views, number, "bufferViews")?;
        let size = size(component);
        let stride = if view.byte_stride == 0 { size * N } else { view.byte_stride };
        let view = self.view(number)?;
        // Every number comes from the file, so each step checks for overflow and for the end.
        let bytes = || {
            // The last item needs no padding after it.
            let length = stride.checked_mul(count - 1)?.checked_add(size * N)?;
            view?.get(accessor.byte_offset..)?.get(..length).filter(|_| stride >= size * N)
        };
        let bytes = bytes().ok_or_else(|| {
            format!("bufferViews[{number}] has no room for {count} items; expected it")
        })?;
        let item = |item: usize| {
            let bytes = &bytes[item * stride..];
            std::array::from_fn(|i| decode(&bytes[i * size..][..size], component, normalized))
        };
        Ok((0..count).map(item).collect())
    }
}
