//! Tells the harness which compiler built it, for the provenance of results.

use std::process::Command;

fn main() {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let version = Command::new(rustc).arg("--version").output().ok().filter(|output| output.status.success());
    let version = version.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    println!("cargo:rustc-env=HARNESS_RUSTC={}", version.as_deref().unwrap_or("unknown"));
    println!("cargo:rerun-if-changed=build.rs");
}
