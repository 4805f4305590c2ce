//! Copies the real scenes from the packages that contain them:
//! `cargo metadata … | scene-fetcher FOLDER`.

use std::error::Error;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use ruzstd::decoding::StreamingDecoder;
use serde_json::Value;
use sha2::{Digest, Sha256};

/// A scene and its package, whose version is in the manifest.
struct Scene {
    file: &'static str,
    package: &'static str,
    /// The path inside the package. A file with the extension `.zst` is decompressed.
    source: &'static str,
    /// True if faces are written as fans of triangles. The committed results are of these triangles,
    /// which cover concave faces wrongly; the loader covers such faces right.
    is_split: bool,
    /// The hexadecimal hash of the written scene.
    sha256: &'static str,
}

const SCENES: [Scene; 3] = [
    Scene {
        file: "sponza.obj",
        package: "bvh",
        source: "media/sponza.obj",
        is_split: true,
        sha256: "020cba5d4ff8bc7f9d3e7c0e17e90b9a25e3749bf1e9eb7cefde0b46ba1f227c",
    },
    Scene {
        file: "kitchen.obj",
        package: "obvhs",
        source: "assets/kitchen.obj.zst",
        is_split: false,
        sha256: "45ef80470157128c96a9e3521d0ecef2b52028df79a0c4271f07b40942de9ba3",
    },
    // The cow by Keenan Crane, in the public domain.
    Scene {
        file: "spot.obj",
        package: "meshx",
        source: "assets/spot.obj",
        is_split: false,
        sha256: "2978aec87377f3aac185c18e1dd253d258c6074f3eeecf5f5a75a76e510bddd0",
    },
];

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("fetch-scenes: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let folder =
        PathBuf::from(std::env::args_os().nth(1).ok_or("expected the folder to write to")?);
    let metadata: Value = serde_json::from_reader(io::stdin())
        .map_err(|error| format!("no output of `cargo metadata` on the standard input: {error}"))?;
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for scene in &SCENES {
        let report =
            put(scene, &folder, &metadata).map_err(|error| format!("{}: {error}", scene.file))?;
        println!("{report}");
    }
    Ok(())
}

/// Writes the scene into the folder unless it is there, and reports its origin.
fn put(scene: &Scene, folder: &Path, metadata: &Value) -> Result<String, Box<dyn Error>> {
    let package = find(metadata, scene.package)?;
    let target = folder.join(scene.file);
    let (text, done) = match fs::read(&target) {
        Ok(text) if sha256(&text) == scene.sha256 => (text, "already there"),
        Ok(_) => {
            return Err(format!(
                "{} has different contents; move it away to get the scene {}",
                target.display(),
                scene.sha256
            )
            .into());
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let text = read(&package.folder.join(scene.source))?;
            let text = if scene.is_split { split(&text) } else { text };
            let found = sha256(&text);
            if found != scene.sha256 {
                let package = &package.name;
                return Err(
                    format!("{package} has SHA-256 {found}, expected {}", scene.sha256).into()
                );
            }
            write(&target, &text)?;
            (text, "written")
        }
        Err(error) => return Err(format!("{}: {error}", target.display()).into()),
    };
    Ok(format!(
        "{}: {done}, {} bytes, {} triangles, SHA-256 as expected\n    \
         from {} of the package {}, licence of the package: {}",
        target.display(),
        text.len(),
        triangles(&text),
        scene.source,
        package.name,
        package.licence,
    ))
}

/// A package in cargo's cache.
struct Package {
    /// With its version.
    name: String,
    licence: String,
    folder: PathBuf,
}

fn find(metadata: &Value, name: &str) -> Result<Package, String> {
    metadata["packages"]
        .as_array()
        .and_then(|packages| packages.iter().find(|package| package["name"] == name))
        .and_then(|package| {
            Some(Package {
                name: format!("{name} {}", package["version"].as_str()?),
                licence: package["license"].as_str().unwrap_or("not stated").to_owned(),
                folder: Path::new(package["manifest_path"].as_str()?).parent()?.to_path_buf(),
            })
        })
        .ok_or_else(|| format!("`cargo metadata` names no package {name}"))
}

fn read(source: &Path) -> Result<Vec<u8>, String> {
    let explain = |error: &dyn Error| format!("{}: {error}", source.display());
    let bytes = fs::read(source).map_err(|error| explain(&error))?;
    if source.extension().is_none_or(|extension| extension != "zst") {
        return Ok(bytes);
    }
    let mut text = Vec::new();
    StreamingDecoder::new(&bytes[..])
        .map_err(|error| explain(&error))?
        .read_to_end(&mut text)
        .map_err(|error| explain(&error))?;
    Ok(text)
}

/// Under another name first: an interrupted run leaves no half scene.
fn write(target: &Path, text: &[u8]) -> Result<(), String> {
    let part = target.with_extension("part");
    fs::write(&part, text)
        .and_then(|()| fs::rename(&part, target))
        .map_err(|error| format!("{}: {error}", target.display()))
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes every face as the fan of triangles around its first vertex.
fn split(text: &[u8]) -> Vec<u8> {
    let mut fans = Vec::new();
    for line in text.split_inclusive(|&byte| byte == b'\n') {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.collect::<Vec<_>>()[..] {
            [b"f", first, ref others @ ..] => {
                for pair in others.windows(2) {
                    let face = [&b"f "[..], first, b" ", pair[0], b" ", pair[1], b"\n"].concat();
                    fans.extend(face);
                }
            }
            _ => fans.extend(line),
        }
    }
    fans
}

/// A face of n vertices counts as n − 2.
fn triangles(text: &[u8]) -> usize {
    text.split(|&byte| byte == b'\n')
        .filter_map(|line| line.strip_prefix(b"f "))
        .map(|face| face.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).count())
        .map(|vertices| vertices.saturating_sub(2))
        .sum()
}
