//! `pack WASM FOLDER`: writes the WebAssembly and the JavaScript that loads it into a folder. It
//! does what the program `wasm-bindgen` does, in the version that Cargo.lock names.

use std::env::args;
use std::error::Error;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<(), Box<dyn Error>> {
    let [wasm, folder]: [String; 2] =
        args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "usage: pack WASM FOLDER")?;
    let mut bindgen = Bindgen::new();
    bindgen.input_path(wasm).web(true)?.typescript(false).out_name("bvh_js");
    Ok(bindgen.generate(folder)?)
}
