//! Archives of the kind ZIP (APPNOTE 6.3.10): files by their names, stored or deflated, within a limit of bytes.
//!
//! What the archive says of a file's size is a claim: no more than the limit is made of it, and its length and checksum have to be
//! what the archive says. Sizes and places of 64 bits are read; encryption and several disks are not.

/// An archive in memory.
pub struct Archive<'a> {
    bytes: &'a [u8],
    files: Vec<Entry>,
}

/// A file in it.
struct Entry {
    name: String,
    /// How it was packed: 0 not at all, 8 deflated.
    method: u16,
    flags: u16,
    checksum: u32,
    packed: u64,
    size: u64,
    /// Where its own head stands.
    head: u64,
}

/// Files of one archive.
const MOST_FILES: u64 = 10_000;

/// A number of a few bytes, the least first.
fn number(bytes: &[u8], at: usize, width: usize) -> Option<u64> {
    let field = bytes.get(at..at.checked_add(width)?)?;
    Some(field.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)))
}

/// True for bytes that begin as an archive does.
pub fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")
}

impl<'a> Archive<'a> {
    /// The archive of some bytes.
    ///
    /// # Errors
    /// What was found instead.
    pub fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let last = bytes.len().checked_sub(22).ok_or("fewer bytes than an archive has")?;
        let signed = |at: &usize| bytes[*at..].starts_with(b"PK\x05\x06");
        // A remark of up to 65,535 bytes may follow.
        let end = (last.saturating_sub(0xffff)..=last).rev().find(signed).ok_or("no archive's end")?;
        let missing = || "an archive that is cut off".to_owned();
        let mut count = number(bytes, end + 10, 2).ok_or_else(missing)?;
        let mut at = number(bytes, end + 16, 4).ok_or_else(missing)?;
        if let Some(locator) = end.checked_sub(20).filter(|l| bytes[*l..].starts_with(b"PK\x06\x07")) {
            let wide = number(bytes, locator + 8, 8).and_then(|w| usize::try_from(w).ok()).ok_or_else(missing)?;
            if bytes.get(wide..).is_none_or(|b| !b.starts_with(b"PK\x06\x06")) {
                return Err("an archive without the end that it says it has".into());
            }
            count = number(bytes, wide + 32, 8).ok_or_else(missing)?;
            at = number(bytes, wide + 48, 8).ok_or_else(missing)?;
        }
        if count > MOST_FILES {
            return Err(format!("an archive of {count} files, more than {MOST_FILES}"));
        }
        let mut files = Vec::new();
        let mut at = usize::try_from(at).map_err(|_| missing())?;
        for _ in 0..count {
            let (entry, next) = Entry::read(bytes, at).ok_or_else(missing)?;
            files.push(entry);
            at = next;
        }
        Ok(Self { bytes, files })
    }

    /// The names of its files.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|f| f.name.as_str())
    }

    /// What a file has in it, at most `limit` bytes; letters of its name may be small or capital.
    ///
    /// # Errors
    /// What was found instead.
    pub fn read(&self, name: &str, limit: usize) -> Result<Vec<u8>, String> {
        let same = |f: &&Entry| f.name == name;
        let alike = |f: &&Entry| f.name.eq_ignore_ascii_case(name);
        let found = self.files.iter().find(same).or_else(|| self.files.iter().find(alike));
        let file = found.ok_or_else(|| format!("no file {name:?} in the archive"))?;
        let of = |what: &str| format!("{what} as {name:?} in the archive");
        if file.flags & 1 != 0 {
            return Err(of("an encrypted file"));
        }
        if file.size > limit as u64 {
            return Err(of(&format!("{} bytes, more than {limit},", file.size)));
        }
        let packed = self.packed(file).ok_or_else(|| of("a file that is cut off"))?;
        let content = match file.method {
            0 if packed.len() as u64 == file.size => packed.to_vec(),
            8 => miniz_oxide::inflate::decompress_to_vec_with_limit(packed, file.size as usize)
                .map_err(|e| of(&format!("a broken file ({e})")))?,
            0 => return Err(of("a file of another size than the archive says")),
            other => return Err(of(&format!("a file packed in another way ({other}) than stored or deflated"))),
        };
        if content.len() as u64 != file.size || crc32fast::hash(&content) != file.checksum {
            return Err(of("a file of another size or checksum than the archive says"));
        }
        Ok(content)
    }

    fn packed(&self, file: &Entry) -> Option<&'a [u8]> {
        let head = usize::try_from(file.head).ok()?;
        self.bytes.get(head..)?.starts_with(b"PK\x03\x04").then_some(())?;
        let (name, extra) = (number(self.bytes, head + 26, 2)?, number(self.bytes, head + 28, 2)?);
        let begin = head + 30 + name as usize + extra as usize;
        self.bytes.get(begin..begin.checked_add(usize::try_from(file.packed).ok()?)?)
    }
}

impl Entry {
    /// The entry of the directory at a place, and where the next one stands.
    fn read(bytes: &[u8], at: usize) -> Option<(Self, usize)> {
        bytes.get(at..)?.starts_with(b"PK\x01\x02").then_some(())?;
        let field = |offset: usize, width: usize| number(bytes, at + offset, width);
        let [name, extra, remark] = [field(28, 2)? as usize, field(30, 2)? as usize, field(32, 2)? as usize];
        let text = bytes.get(at + 46..at + 46 + name)?;
        let mut entry = Self {
            name: String::from_utf8_lossy(text).into_owned(),
            method: field(10, 2)? as u16,
            flags: field(8, 2)? as u16,
            checksum: field(16, 4)? as u32,
            packed: field(20, 4)?,
            size: field(24, 4)?,
            head: field(42, 4)?,
        };
        let extras = bytes.get(at + 46 + name..at + 46 + name + extra)?;
        entry.widen(extras)?;
        Some((entry, at + 46 + name + extra + remark))
    }

    /// Takes the sizes and the place of 64 bits where those of 32 say that they do not fit.
    fn widen(&mut self, extras: &[u8]) -> Option<()> {
        let mut at = 0;
        while at + 4 <= extras.len() {
            let (id, length) = (number(extras, at, 2)?, number(extras, at + 2, 2)? as usize);
            at += 4;
            if id == 1 {
                let mut wide = at;
                for field in [&mut self.size, &mut self.packed, &mut self.head] {
                    if *field == 0xffff_ffff {
                        *field = number(extras, wide, 8)?;
                        wide += 8;
                    }
                }
            }
            at += length;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `ab` three hundred times and `!`, deflated.
    const PACKED: [u8; 11] = [0x4b, 0x4c, 0x4a, 0x1c, 0x85, 0xa3, 0x90, 0xea, 0x50, 0x11, 0x00];
    const CHECKSUM: u32 = 3_137_055_109;

    /// An archive of one file, its numbers as given.
    fn archive(name: &str, method: u16, packed: &[u8], (size, checksum): (u32, u32)) -> Vec<u8> {
        let mut out = b"PK\x03\x04\x14\0\0\0".to_vec();
        out.extend(method.to_le_bytes());
        out.extend([0; 4]);
        // The head may leave its numbers to the directory.
        out.extend([0; 12]);
        out.extend((name.len() as u16).to_le_bytes());
        out.extend([0; 2]);
        out.extend(name.bytes());
        out.extend(packed);
        let directory = out.len() as u32;
        out.extend(b"PK\x01\x02\x14\0\x14\0\0\0");
        out.extend(method.to_le_bytes());
        out.extend([0; 4]);
        for n in [checksum, packed.len() as u32, size] {
            out.extend(n.to_le_bytes());
        }
        out.extend((name.len() as u16).to_le_bytes());
        out.extend([0; 16]);
        out.extend(name.bytes());
        let end = out.len() as u32;
        out.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
        out.extend((end - directory).to_le_bytes());
        out.extend(directory.to_le_bytes());
        out.extend([0; 2]);
        out
    }

    #[test]
    fn files_are_unpacked_and_no_claim_is_believed() {
        let content = [b"ab".repeat(300), b"!".to_vec()].concat();
        let good = archive("a/B.txt", 8, &PACKED, (601, CHECKSUM));
        let open = Archive::new(&good).expect("an archive");
        assert_eq!(open.names().collect::<Vec<_>>(), ["a/B.txt"]);
        for name in ["a/B.txt", "A/b.TXT"] {
            assert!(open.read(name, 601).expect("a file") == content);
        }
        let stored = archive("a", 0, &content, (601, CHECKSUM));
        assert!(Archive::new(&stored).and_then(|a| a.read("a", 1000)).expect("a file") == content);
        let refused = |bytes: &[u8], limit: usize| match Archive::new(bytes).and_then(|a| a.read("a", limit)) {
            Ok(_) => "read".to_owned(),
            Err(found) => found,
        };
        for (bytes, limit, found) in [
            (archive("a", 8, &PACKED, (601, CHECKSUM)), 600, "601 bytes, more than 600, as \"a\" in the archive"),
            // It unpacks to more than it says: no more than it says is made.
            (archive("a", 8, &PACKED, (600, CHECKSUM)), 600, "a broken file ("),
            (archive("a", 8, &PACKED, (602, CHECKSUM)), 700, "a file of another size or checksum than"),
            (archive("a", 8, &PACKED, (601, 7)), 700, "a file of another size or checksum than"),
            (archive("a", 0, &content, (600, CHECKSUM)), 700, "a file of another size than"),
            (archive("a", 8, &PACKED[..9], (601, CHECKSUM)), 700, "a broken file ("),
            (archive("a", 12, &PACKED, (601, CHECKSUM)), 700, "a file packed in another way (12)"),
            (archive("b", 8, &PACKED, (601, CHECKSUM)), 700, "no file \"a\" in the archive"),
            (good[..good.len() - 23].to_vec(), 700, "no archive's end"),
            (good[30..].to_vec(), 700, "an archive that is cut off"),
            (Vec::new(), 700, "fewer bytes than an archive has"),
        ] {
            let sentence = refused(&bytes, limit);
            assert!(sentence.starts_with(found), "{sentence}\nnot {found}");
        }
        for cut in 0..good.len() {
            assert_ne!(refused(&good[..cut], 700), "read");
        }
    }
}
