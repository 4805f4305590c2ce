//! Triangles from PLY files, text or binary: the faces over the vertices; or the vertices as points.
//!
//! This module does not use `ply-rs-bw` 4.0.1, because that crate rejects blank lines, comments in
//! Latin-1, lines that end in CR, elements without properties, and `-nan(ind)`; it reads an element
//! that is declared twice at wrong places; and its errors speak of its grammar.

use super::mesh::{AFTER_END, Fault, MOST_TRIANGLES, Mesh, Rounding, counted};
use super::polygon::Polygons;
use super::{text, without_mark};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

/// A type of numbers.
#[derive(Clone, Copy, Debug)]
struct Scalar {
    kind: Kind,
    /// The number of bytes.
    size: usize,
}

impl Scalar {
    fn named(word: &str) -> Result<Self, String> {
        let (kind, size) = match word {
            "char" | "int8" => (Kind::Signed, 1),
            "uchar" | "uint8" => (Kind::Unsigned, 1),
            "short" | "int16" => (Kind::Signed, 2),
            "ushort" | "uint16" => (Kind::Unsigned, 2),
            "int" | "int32" => (Kind::Signed, 4),
            "uint" | "uint32" => (Kind::Unsigned, 4),
            "float" | "float32" => (Kind::Float, 4),
            "double" | "float64" => (Kind::Float, 8),
            _ => return Err(format!("type `{word}`; expected a type such as uchar, int or float")),
        };
        Ok(Self { kind, size })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Ignored,
    Axis(usize),
    Indices,
}

#[derive(Debug)]
struct Property {
    name: String,
    /// The type of the length, if the property is a list.
    length: Option<Scalar>,
    scalar: Scalar,
    purpose: Purpose,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// Reads the bytes of a PLY file. O(bytes), and more for polygons that are not convex.
pub fn parse(bytes: &[u8]) -> Result<Mesh, Fault> {
    let mut file = File::new(bytes, &AXES[..3]);
    let Elements { vertices, indices, ends, .. } = file.elements()?;
    let mut polygons = Polygons::new(&vertices);
    let starts = [0].iter().chain(&ends);
    for (number, (&start, &end)) in starts.zip(&ends).enumerate() {
        polygons
            .add(&indices[start..end])
            .map_err(|message| Fault::of(&format!("face {number}, counted from 0"), message))?;
    }
    let mut remarks = polygons.remarks(vertices.len());
    remarks.extend(counted(AFTER_END, file.rest.trim_ascii().len()));
    let triangles = polygons.triangles;
    remarks.extend(file.rounding.remark(&triangles));
    if triangles.is_empty() || triangles.len() > MOST_TRIANGLES {
        let found = format!("{} vertices and {} triangles", vertices.len(), triangles.len());
        let message = format!("{found}; expected 1 to {MOST_TRIANGLES} triangles");
        return Err(Fault::of_file(message));
    }
    Ok(Mesh::new(triangles, remarks))
}

/// Reads the vertices of a PLY file, rounded to single precision, and as many normals if it has
/// `nx`, `ny` and `nz`, or none. O(bytes).
pub fn points(bytes: &[u8]) -> Result<[Vec<[f32; 3]>; 2], Fault> {
    let Elements { vertices, normals, .. } = File::new(bytes, &AXES).elements()?;
    Ok([vertices, normals])
}

const AXES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// The contents of a file.
#[derive(Default)]
struct Elements {
    vertices: Vec<[f32; 3]>,
    /// Empty if the vertices have none.
    normals: Vec<[f32; 3]>,
    /// The vertices of all faces, one face after the other.
    indices: Vec<i64>,
    /// The ends of the faces.
    ends: Vec<usize>,
}

/// The part of a file that is not read yet.
struct File<'a> {
    rest: &'a [u8],
    /// The number of lines taken so far.
    line: usize,
    /// The rest of the current line.
    words: &'a [u8],
    encoding: Encoding,
    rounding: Rounding,
    /// The properties of a vertex that are read. Those of meshes may have anything as normals.
    axes: &'static [&'static str],
}

impl<'a> File<'a> {
    fn new(bytes: &'a [u8], axes: &'static [&'static str]) -> Self {
        let (rest, rounding) = (without_mark(bytes), Rounding::default());
        Self { rest, line: 0, words: &[], encoding: Encoding::Text, rounding, axes }
    }

    /// Reads the header and all elements.
    fn elements(&mut self) -> Result<Elements, Fault> {
        let elements = self.header().map_err(|message| Fault::in_line(self.line, message))?;
        let mut read = Elements::default();
        for Element { name, count, properties } in &elements {
            let has_normals = properties.iter().any(|p| matches!(p.purpose, Purpose::Axis(3..)));
            // An element without properties has no bytes, whatever its count.
            for number in 0..if properties.is_empty() { 0 } else { *count } {
                let mut axes = [f32::NAN; 6];
                self.element(properties, &mut axes, &mut read.indices).map_err(|message| {
                    let name = format!("{name} {number}, counted from 0");
                    match self.encoding {
                        Encoding::Text => Fault::in_line(self.line, format!("{name}: {message}")),
                        _ => Fault::of(&name, message),
                    }
                })?;
                let [x, y, z, normal @ ..] = axes;
                match name.as_str() {
                    "vertex" => read.vertices.push([x, y, z]),
                    "face" => read.ends.push(read.indices.len()),
                    _ => {}
                }
                read.normals.extend(has_normals.then_some(normal));
            }
        }
        Ok(read)
    }

    /// Reads the header, and everything up to the first byte of the first element.
    fn header(&mut self) -> Result<Vec<Element>, String> {
        // Only in a file whose lines end in CR alone may the body begin with LF.
        let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let end = &self.rest[end.unwrap_or(self.rest.len())..];
        let ends_in_cr = end.starts_with(b"\r") && !end.starts_with(b"\r\n");
        let mut elements: Vec<Element> = Vec::new();
        let mut encoding = None;
        let unexpected = |line: &[u8]| {
            let expected = "format, comment, obj_info, element, property or end_header";
            format!("`{}`; expected {expected}", text::shown(line))
        };
        loop {
            let before = self.rest;
            let line = text::line(&mut self.rest).ok_or("the file ends in its header")?;
            self.line += 1;
            let lossy = String::from_utf8_lossy(line);
            let words: Vec<&str> = lossy.split_ascii_whitespace().collect();
            match words[..] {
                ["ply"] if self.line == 1 => {}
                _ if self.line == 1 => {
                    return Err(format!("`{}`; expected ply", text::shown(line)));
                }
                [] | ["comment" | "obj_info", ..] => {}
                ["format", name, version] => {
                    encoding = Some(match (name, version) {
                        ("ascii", "1.0") => Encoding::Text,
                        ("binary_little_endian", "1.0") => Encoding::LittleEndian,
                        ("binary_big_endian", "1.0") => Encoding::BigEndian,
                        _ => {
                            let known = "ascii, binary_little_endian or binary_big_endian, and 1.0";
                            return Err(format!("format `{name} {version}`; expected {known}"));
                        }
                    });
                }
                ["element", name, count] => {
                    if elements.iter().any(|element| element.name == name) {
                        return Err(format!("element `{name}` repeats a name; expected each once"));
                    }
                    let count = count
                        .parse()
                        .map_err(|_| format!("`{count}` elements; expected a whole number"))?;
                    elements.push(Element { name: name.into(), count, properties: Vec::new() });
                }
                ["property", ref type_ @ .., name] => {
                    let Some(element) = elements.last_mut() else { return Err(unexpected(line)) };
                    element.add(type_, name, self.axes)?;
                }
                ["end_header"] => {
                    if ends_in_cr {
                        self.rest = &before[before.len().min(line.len() + 1)..];
                    }
                    break;
                }
                _ => return Err(unexpected(line)),
            }
        }
        self.encoding = encoding.ok_or("no format; expected a line such as format ascii 1.0")?;
        elements.iter().try_for_each(Element::check)?;
        Ok(elements)
    }

    /// Reads one element. Adds its list of vertices to `indices`.
    fn element(
        &mut self,
        properties: &[Property],
        axes: &mut [f32; 6],
        indices: &mut Vec<i64>,
    ) -> Result<(), String> {
        while self.encoding == Encoding::Text && self.words.is_empty() {
            self.words = text::line(&mut self.rest).ok_or(ENDS)?.trim_ascii();
            self.line += 1;
        }
        for property in properties {
            let named = |message| format!("{}: {message}", property.name);
            let count = match property.length {
                None => 1,
                Some(length) => self.integer(length).map_err(named)?,
            };
            if count < 0 {
                return Err(named(format!("a list of length {count}; expected 0 or more")));
            }
            for _ in 0..count {
                match property.purpose {
                    Purpose::Ignored => self.skip(property.scalar),
                    Purpose::Axis(axis) => {
                        self.float(property.scalar).map(|number| axes[axis] = number)
                    }
                    Purpose::Indices => {
                        self.integer(property.scalar).map(|index| indices.push(index))
                    }
                }
                .map_err(named)?;
            }
        }
        match std::mem::take(&mut self.words) {
            [] => Ok(()),
            extra => Err(format!(
                "`{}` after its last property; expected the end of the line",
                text::shown(extra)
            )),
        }
    }

    fn skip(&mut self, scalar: Scalar) -> Result<(), String> {
        match self.encoding {
            Encoding::Text => self.word().map(drop),
            _ => self.bytes(scalar).map(drop),
        }
    }

    fn float(&mut self, scalar: Scalar) -> Result<f32, String> {
        if scalar.kind != Kind::Float {
            let number = self.integer(scalar)? as f64;
            return Ok(self.rounding.round(number));
        }
        if self.encoding == Encoding::Text {
            let word = self.word()?;
            return text::number(word, &mut self.rounding)
                .ok_or_else(|| format!("`{}`; expected a number", text::shown(word)));
        }
        let bits = self.bytes(scalar)?;
        Ok(match scalar.size {
            4 => f32::from_bits(bits as u32),
            _ => self.rounding.round(f64::from_bits(bits)),
        })
    }

    fn integer(&mut self, scalar: Scalar) -> Result<i64, String> {
        if self.encoding == Encoding::Text {
            let word = self.word()?;
            let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            return number
                .ok_or_else(|| format!("`{}`; expected a whole number", text::shown(word)));
        }
        let bits = self.bytes(scalar)? as i64;
        let unused = 64 - 8 * scalar.size;
        // The sign is in the highest bit of the number.
        Ok(if scalar.kind == Kind::Signed { bits << unused >> unused } else { bits })
    }

    fn word(&mut self) -> Result<&'a [u8], String> {
        if self.words.is_empty() {
            return Err("its line ends before it; expected one line for each element".into());
        }
        let end = self.words.iter().position(u8::is_ascii_whitespace);
        let (word, rest) = self.words.split_at(end.unwrap_or(self.words.len()));
        self.words = rest.trim_ascii_start();
        Ok(word)
    }

    /// Returns the bytes of a number, the lowest first, as the lowest bits.
    fn bytes(&mut self, scalar: Scalar) -> Result<u64, String> {
        let (bytes, rest) = self.rest.split_at_checked(scalar.size).ok_or(ENDS)?;
        self.rest = rest;
        let add = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
        Ok(match self.encoding {
            Encoding::BigEndian => bytes.iter().fold(0, add),
            _ => bytes.iter().rev().fold(0, add),
        })
    }
}

const ENDS: &str = "the file ends here; expected the elements of the header";

impl Element {
    fn add(&mut self, types: &[&str], name: &str, axes: &[&str]) -> Result<(), String> {
        if self.properties.iter().any(|property| property.name == name) {
            return Err(format!("property `{name}` repeats a name; expected each once"));
        }
        let axis = axes.iter().position(|axis| *axis == name);
        let purpose = match (self.name.as_str(), axis) {
            ("vertex", Some(axis)) => Purpose::Axis(axis),
            ("face", _) if matches!(name, "vertex_indices" | "vertex_index") => Purpose::Indices,
            _ => Purpose::Ignored,
        };
        let (length, scalar) = match *types {
            [scalar] => (None, Scalar::named(scalar)?),
            ["list", length, scalar] => (Some(Scalar::named(length)?), Scalar::named(scalar)?),
            _ => return Err(format!("the type of `{name}`; expected one type, or list and two")),
        };
        let expected = match purpose {
            Purpose::Axis(_) if length.is_some() => "one number",
            Purpose::Indices if length.is_none() || scalar.kind == Kind::Float => {
                "a list of an integer type"
            }
            _ if length.is_some_and(|length| length.kind == Kind::Float) => {
                "a length of an integer type"
            }
            _ => {
                self.properties.push(Property { name: name.into(), length, scalar, purpose });
                return Ok(());
            }
        };
        Err(format!("`{name}` of type {}; expected {expected}", types.join(" ")))
    }

    /// Rejects an element without the properties that make it a vertex or a face.
    fn check(&self) -> Result<(), String> {
        let (needed, names) = match self.name.as_str() {
            "vertex" => (3, "x, y and z, and nx, ny and nz if any of them"),
            "face" => (1, "vertex_indices"),
            "tristrips" if self.count > 0 => {
                return Err("element tristrips; expected faces instead".into());
            }
            _ => (0, ""),
        };
        let has = self.properties.iter().filter(|property| property.purpose != Purpose::Ignored);
        let has = has.count();
        match self.count > 0 && has != needed && !(self.name == "vertex" && has == AXES.len()) {
            true => Err(format!("element {} has other properties; expected {names}", self.name)),
            false => Ok(()),
        }
    }
}
