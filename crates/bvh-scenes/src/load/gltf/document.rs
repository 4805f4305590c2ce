//! The JSON of a glTF or GLB file, and the binary chunk next to it.

use super::super::mesh::{Fault, Place};
use super::super::without_mark;
use gltf_json::Root;
use gltf_json::deserialize::from_slice;
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, IgnoredAny};
use serde::de::{MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;
use std::fmt;
use std::path::Path;

/// Extensions that a file may require, because none of them changes its triangles: lights,
/// materials, textures, metadata, and other types of positions, which the loader rejects
/// where a mesh uses them.
const HARMLESS: [&str; 25] = [
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_techniques_webgl",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

/// Reads a file's JSON, and returns the bytes of the binary chunk of a GLB file with it.
pub(super) fn document<'a>(
    bytes: &'a [u8],
    path: &Path,
) -> Result<(Root, Option<&'a [u8]>), Fault> {
    let (json, chunk) = match bytes.starts_with(b"glTF") {
        true => chunks(bytes).ok_or_else(|| {
            let message = "no chunk of JSON in version 2; expected a GLB file, and whole";
            Fault::new(path, Place::File, message)
        })?,
        false => (without_mark(bytes), None),
    };
    let root = from_slice::<References>(json)
        .and_then(|_| Root::from_slice(json))
        .map_err(|error| Fault::new(path, Place::File, error))?;
    let asset = &root.asset;
    let version = asset.min_version.as_ref().unwrap_or(&asset.version);
    // A file of a later minor version is read unless it says that it needs this version.
    let is_known = match asset.min_version {
        Some(_) => version == "2.0",
        None => version.starts_with("2."),
    };
    if !is_known {
        let message = format!("version `{version}`; expected 2.0");
        return Err(Fault::new(path, Place::Element("asset".into()), message));
    }
    if let Some(unknown) =
        root.extensions_required.iter().find(|name| !HARMLESS.contains(&name.as_str()))
    {
        let place = Place::Element("extensionsRequired".into());
        let message = format!(
            "`{unknown}`; expected none that changes triangles (compressed meshes cannot be read)"
        );
        return Err(Fault::new(path, place, message));
    }
    Ok((root, chunk))
}

fn chunks(bytes: &[u8]) -> Option<(&[u8], Option<&[u8]>)> {
    if bytes.get(4..8)? != [2, 0, 0, 0] {
        return None;
    }
    let length = u32::from_le_bytes(*bytes.get(8..)?.first_chunk()?) as usize;
    if bytes.len() < length {
        return None;
    }
    // The file's header has 12 bytes, and each chunk's header has 8.
    let json = chunk(bytes, 12, b"JSON")?;
    Some((json, chunk(bytes, 20 + json.len(), b"BIN\0")))
}

/// Returns the contents of the chunk whose header begins at `offset`, if it has this kind.
fn chunk<'a>(bytes: &'a [u8], offset: usize, kind: &[u8; 4]) -> Option<&'a [u8]> {
    let (header, contents) = bytes.get(offset..)?.split_first_chunk::<8>()?;
    let length = u32::from_le_bytes(*header.first_chunk()?) as usize;
    if header[4..] != *kind {
        return None;
    }
    contents.get(..length)
}

/// The keys of the numbers that the loader follows or compares.
const REFERENCES: [&str; 10] = [
    "attributes",
    "buffer",
    "bufferView",
    "children",
    "componentType",
    "indices",
    "mesh",
    "mode",
    "nodes",
    "scene",
];

/// The keys of values that belong to the author of the file or of an extension.
const FREE: [&str; 2] = ["extensions", "extras"];

/// A JSON document whose references are all below 2³²; `gltf-json` takes others modulo 2³².
struct References;

impl<'de> Deserialize<'de> for References {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Value { key: "" }.deserialize(deserializer).map(|()| Self)
    }
}

/// A value of the document, and the key of the nearest object around it.
#[derive(Clone, Copy)]
struct Value<'k> {
    key: &'k str,
}

impl<'de> DeserializeSeed<'de> for Value<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Value<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("JSON")
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<(), E> {
        if number > u64::from(u32::MAX) && REFERENCES.contains(&self.key) {
            return Err(E::custom(format!(
                "{number}; expected at most {} as `{}`",
                u32::MAX,
                self.key
            )));
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<(), A::Error> {
        while elements.next_element_seed(self)?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<(), A::Error> {
        while let Some(key) = entries.next_key::<Cow<str>>()? {
            if FREE.contains(&key.as_ref()) {
                entries.next_value::<IgnoredAny>()?;
                continue;
            }
            // The keys of attributes are names, such as POSITION.
            let is_name = self.key == "attributes";
            let key = if is_name { self.key } else { key.as_ref() };
            entries.next_value_seed(Value { key })?;
        }
        Ok(())
    }

    // Other values contain no reference.
    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }
}
