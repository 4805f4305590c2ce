//! Prints the header of bvh-c:
//! `cargo run --manifest-path crates/bvh-c/header/Cargo.toml > crates/bvh-c/include/bvh_search.h`.

use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut config = cbindgen::Config::from_file(library.join("header/cbindgen.toml"))?;
    let manifest = std::fs::read_to_string(library.join("Cargo.toml"))?;
    let version = manifest.lines().find_map(|line| line.strip_prefix("version = "));
    let version = version.ok_or("Cargo.toml has no version")?.trim_matches('"');
    let macros = ["MAJOR", "MINOR", "PATCH"].into_iter().zip(version.split('.'));
    let macros = macros.map(|(name, number)| format!("\n#define BVS_VERSION_{name} {number}"));
    config.after_includes = Some(macros.collect());
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in ["failure", "tree", "tracer", "double", "instances", "sky"] {
        builder = builder.with_src(library.join(format!("src/{source}.rs")));
    }
    builder.generate()?.write(std::io::stdout());
    Ok(())
}
