//! Passes the revision, the compiler and its options to the harness, for the provenance of results.

use std::process::Command;

fn main() {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let version =
        Command::new(rustc).arg("--version").output().ok().filter(|output| output.status.success());
    let version = version.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    println!("cargo:rustc-env=HARNESS_RUSTC={}", version.as_deref().unwrap_or("unknown"));
    let set = |name| std::env::var(name).unwrap_or_else(|_| "unknown".into());
    let profile = set("PROFILE");
    let level = set("OPT_LEVEL");
    let features = set("CARGO_CFG_TARGET_FEATURE");
    println!(
        "cargo:rustc-env=HARNESS_BUILD={profile}, opt-level {level}, target features {features}"
    );
    println!("cargo:rustc-env=HARNESS_REVISION={}", revision().as_deref().unwrap_or("unknown"));
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
    }
}

/// The sources of the program, relative to this folder.
const SOURCES: [&str; 9] = [
    "build.rs",
    "src",
    "../bvh-config/src",
    "../bvh-core/src",
    "../bvh-build/src",
    "../bvh-search/src",
    "../bvh-scenes/src",
    "../bvh-stress/src",
    "../figures/src",
];

/// Returns the commit of the sources, with a `+` if they differ from it.
///
/// It is determined here because at run time the current folder may belong to another repository,
/// and the sources may have changed.
fn revision() -> Option<String> {
    let git = |args: &[&str]| {
        let output = Command::new("git")
            .args(args)
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    // Sources that an enclosing repository does not track do not belong to its commit.
    git(&["ls-files", "--error-unmatch", "build.rs"])?;
    // The log of HEAD changes with every commit and checkout.
    println!("cargo:rerun-if-changed={}", git(&["rev-parse", "--git-path", "logs/HEAD"])?);
    let dirty =
        git(&[&["status", "--porcelain", "--untracked-files=no", "--"], &SOURCES[..]].concat())?;
    Some(git(&["rev-parse", "HEAD"])? + if dirty.is_empty() { "" } else { "+" })
}
