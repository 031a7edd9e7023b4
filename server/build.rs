//! Gives the sources that decide what preprocessing makes of a model a name, `CONTACTD_PREPROCESSING`: a kept model is used
//! only by a program that would make the same of its text. Any change there counts, and of the versions of what they use.

use std::path::{Path, PathBuf};

/// Floors up to the octree, poses, and the versions of the packages. What is missing in a packaged crate is named by the
/// crate's version.
const SOURCES: [&str; 8] = [
    "engine/src/math",
    "engine/src/motion",
    "engine/src/solid",
    "src/import",
    "engine/src/bound",
    "engine/src/octree",
    "../proto/src",
    "../Cargo.lock",
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    for variable in ["CARGO_PKG_VERSION", "TARGET"] {
        add(std::env::var(variable).unwrap_or_default().as_bytes());
    }
    for source in SOURCES {
        if Path::new(source).exists() {
            println!("cargo:rerun-if-changed={source}");
        }
        for file in files(Path::new(source)) {
            add(file.to_string_lossy().as_bytes());
            add(&std::fs::read(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display())));
        }
    }
    println!("cargo:rustc-env=CONTACTD_PREPROCESSING={}", hasher.finalize().to_hex());
}

/// The files of a folder and below it, or the file itself; in order.
fn files(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.into()];
    }
    let mut entries: Vec<PathBuf> = std::fs::read_dir(path).into_iter().flatten().flatten().map(|e| e.path()).collect();
    entries.sort();
    entries.iter().flat_map(|e| files(e)).collect()
}
