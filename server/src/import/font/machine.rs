//! The fonts of this machine.

use super::{Font, Pattern};
use read_fonts::types::NameId;
use read_fonts::{FontData, FontRead, tables::name::Name};
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Where fonts are installed, below the root or below a user's folder; OpenSCAD's own first.
const FOLDERS: [&str; 5] = [
    "/usr/share/openscad/fonts",
    "/usr/share/fonts",
    "/usr/local/share/fonts",
    "/System/Library/Fonts",
    "/Library/Fonts",
];
const OWN_FOLDERS: [&str; 3] = [".local/share/fonts", ".fonts", "Library/Fonts"];
/// Fonts that are looked at, and folders in folders.
const MOST: usize = 10_000;
const DEEPEST: u32 = 6;
/// Bytes of a font, and of its names.
const LARGEST: u64 = 64 << 20;
const NAMES: u64 = 1 << 20;

/// The file of the machine's font that comes nearest to a pattern, in memory.
///
/// # Errors
/// A sentence for a pattern that no font comes near to.
pub fn find(pattern: &Pattern) -> Result<Vec<u8>, String> {
    let own = std::env::var_os("HOME").map(PathBuf::from);
    let own = own.iter().flat_map(|home| OWN_FOLDERS.iter().map(|f| home.join(f)));
    let folders: Vec<PathBuf> = FOLDERS.iter().map(PathBuf::from).chain(own).collect();
    find_in(&folders, pattern)
}

/// The same of the fonts in some folders and below.
///
/// # Errors
/// The same.
pub fn find_in(folders: &[PathBuf], pattern: &Pattern) -> Result<Vec<u8>, String> {
    let mut files = Vec::new();
    folders.iter().for_each(|f| collect(f, 0, &mut files));
    let mut best: Option<((usize, usize), &PathBuf)> = None;
    for file in &files {
        let Some(rank) = names(file).and_then(|(family, style)| pattern.rank(&family, &style)) else { continue };
        if best.is_none_or(|(b, _)| rank < b) {
            best = Some((rank, file));
        }
    }
    let none = || format!("{:?}: no such font on this machine", pattern.family);
    let bytes = fs::read(best.ok_or_else(none)?.1).map_err(|e| e.to_string())?;
    if Font::new(&bytes).is_some() { Ok(bytes) } else { Err(none()) }
}

/// Files whose names end as fonts' do, in the order of their names.
fn collect(folder: &Path, depth: u32, out: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        if out.len() >= MOST {
            return;
        }
        if path.is_dir() && depth < DEEPEST {
            collect(&path, depth + 1, out);
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ttf")) {
            out.push(path);
        }
    }
}

/// Family and style of a font file, of which no more is read than its names.
fn names(path: &Path) -> Option<(String, String)> {
    let mut file = File::open(path).ok()?;
    if file.metadata().ok()?.len() > LARGEST {
        return None;
    }
    let mut head = [0; 12];
    file.read_exact(&mut head).ok()?;
    let count = usize::from(u16::from_be_bytes([head[4], head[5]]));
    let mut directory = vec![0; 16 * count];
    file.read_exact(&mut directory).ok()?;
    let table = |tag: &[u8]| directory.chunks_exact(16).find(|row| row.starts_with(tag));
    table(b"glyf")?;
    let row = table(b"name")?;
    let number = |at: usize| row.get(at..at + 4)?.try_into().ok().map(u32::from_be_bytes).map(u64::from);
    let (offset, length) = (number(8)?, number(12)?.min(NAMES));
    file.seek(SeekFrom::Start(offset)).ok()?;
    let mut bytes = vec![0; length as usize];
    file.read_exact(&mut bytes).ok()?;
    let table = Name::read(FontData::new(&bytes)).ok()?;
    let of = |id: NameId| {
        let record = table.name_record().iter().find(|r| r.name_id() == id && r.is_unicode())?;
        Some(record.string(table.string_data()).ok()?.chars().collect::<String>())
    };
    let family = of(NameId::TYPOGRAPHIC_FAMILY_NAME).or_else(|| of(NameId::FAMILY_NAME))?;
    let style = of(NameId::TYPOGRAPHIC_SUBFAMILY_NAME).or_else(|| of(NameId::SUBFAMILY_NAME));
    Some((family, style.unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_that_comes_nearest_is_found_and_nothing_else_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let below = folder.path().join("a/b");
        fs::create_dir_all(&below).expect("folders");
        fs::write(below.join("hack.TTF"), epaint_default_fonts::HACK_REGULAR).expect("written");
        fs::write(folder.path().join("ubuntu.ttf"), epaint_default_fonts::UBUNTU_LIGHT).expect("written");
        fs::write(folder.path().join("broken.ttf"), &epaint_default_fonts::HACK_REGULAR[..500]).expect("written");
        fs::write(folder.path().join("note.txt"), "no font").expect("written");
        let find = |name: &str| find_in(&[folder.path().to_owned()], &Pattern::new(name));
        assert_eq!(find("Hack:style=Bold").expect("Hack"), epaint_default_fonts::HACK_REGULAR);
        assert_eq!(find("ubuntu").expect("Ubuntu"), epaint_default_fonts::UBUNTU_LIGHT);
        assert_eq!(find("Arial"), Err("\"Arial\": no such font on this machine".into()));
        assert!(find_in(&[folder.path().join("none")], &Pattern::new("Hack")).is_err());
    }
}
