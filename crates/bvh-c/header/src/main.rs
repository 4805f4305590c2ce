//! Prints the header of bvh-c:
//! `cargo run --manifest-path crates/bvh-c/header/Cargo.toml > crates/bvh-c/include/bvh.h`.

use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut builder = cbindgen::Builder::new()
        .with_config(cbindgen::Config::from_file(here.join("cbindgen.toml"))?);
    for source in ["failure", "tree", "tracer"] {
        builder = builder.with_src(here.join(format!("../src/{source}.rs")));
    }
    builder.generate()?.write(std::io::stdout());
    Ok(())
}
