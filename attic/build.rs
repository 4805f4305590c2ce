//! Passes the versions of the other libraries on, for the rows of their speeds.

fn main() {
    for library in ["bvh", "obvhs"] {
        let version = locked_version(library).unwrap_or_else(|| "unknown".into());
        println!("cargo:rustc-env=ATTIC_{}={version}", library.to_uppercase());
    }
}

/// Returns the version of a package in the lock file of this workspace; the lowest of several.
fn locked_version(package: &str) -> Option<String> {
    const LOCK: &str = "Cargo.lock";
    println!("cargo:rerun-if-changed={LOCK}");
    let lock = std::fs::read_to_string(LOCK).ok()?;
    let (_, after) = lock.split_once(&format!("name = \"{package}\"\nversion = \""))?;
    Some(after.split('"').next()?.to_owned())
}
