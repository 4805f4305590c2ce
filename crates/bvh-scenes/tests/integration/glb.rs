//! Files in the binary form of glTF.

/// Returns a chunk with its length and its kind before the contents.
fn chunk(kind: &[u8; 4], bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes()[..], kind, bytes].concat()
}

/// Returns a GLB file of this JSON and these bytes.
pub fn glb(json: String, binary: &[u8]) -> Vec<u8> {
    let mut json = json.into_bytes();
    // The format wants chunks of a multiple of four bytes.
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", binary)].concat();
    [&b"glTF\x02\0\0\0"[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}
