//! Tells the harness which compiler built it and how, for the provenance of results.

use std::process::Command;

fn main() {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let version = Command::new(rustc).arg("--version").output().ok().filter(|output| output.status.success());
    let version = version.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    println!("cargo:rustc-env=HARNESS_RUSTC={}", version.as_deref().unwrap_or("unknown"));
    let set = |name| std::env::var(name).unwrap_or_else(|_| "unknown".into());
    let (profile, level, features) = (set("PROFILE"), set("OPT_LEVEL"), set("CARGO_CFG_TARGET_FEATURE"));
    println!("cargo:rustc-env=HARNESS_BUILD={profile}, opt-level {level}, target features {features}");
    println!("cargo:rerun-if-changed=build.rs");
}
