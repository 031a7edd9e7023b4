//! Shared memory that is there when it is written to.
//!
//! A segment is a size at first: the system finds a page for it when something is written to that page, and kills the writer
//! (SIGBUS) where it has none left, as in a container whose `/dev/shm` is small. So a port has the pages of what it is lent
//! allocated before it writes to them (`fallocate(2)`), once for each place: what is missing is an error then.

use crate::Error;
use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::Errno;
use std::collections::HashMap;
use std::fs::File;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Where the segments lie.
const FOLDER: &str = "/dev/shm";
/// For so long there is room where some was seen, for a loan at a known place: what is lent next may be a new one.
const AGAIN: Duration = Duration::from_millis(1);
/// What iceoryx2 writes of its own when a port comes or a segment grows, and more than that: bytes.
const OWN: u64 = 1 << 19;

/// The pages that a port has already written to.
#[derive(Debug, Default)]
pub struct Pages {
    known: Mutex<Known>,
}

#[derive(Debug, Default)]
struct Known {
    /// How many bytes from an address on are there.
    places: HashMap<usize, usize>,
    /// The segments of these places.
    segments: Vec<Segment>,
    /// The largest loan so far, bytes: a larger one moves to a new segment, perhaps where an old one has been.
    largest: usize,
    /// The last loan was at a place as it had been before …
    settled: bool,
    /// … and room was seen then.
    looked: Option<Instant>,
}

/// A stretch of addresses that a file lies at.
#[derive(Debug)]
struct Segment {
    addresses: Range<usize>,
    /// Where in the file it begins, bytes.
    offset: u64,
    file: File,
}

impl Pages {
    /// To be asked before a loan of `bytes` bytes: iceoryx2 writes to what it lends, too.
    ///
    /// # Errors
    /// `System` where there is hardly any room.
    pub fn before(&self, bytes: usize) -> Result<(), Error> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if bytes > known.largest {
            *known = Known { largest: bytes, ..Known::default() };
        }
        // A system call for each loan would be a fiftieth of the shortest step.
        if known.settled && known.looked.is_some_and(|looked| looked.elapsed() < AGAIN) {
            return Ok(());
        }
        room(bytes)?;
        known.looked = Some(Instant::now());
        Ok(())
    }

    /// Makes sure that a loan can be written to.
    ///
    /// # Errors
    /// `System` where it cannot.
    pub fn claim<T>(&self, loan: &[T]) -> Result<(), Error> {
        let (start, bytes) = (loan.as_ptr().addr(), size_of_val(loan));
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.settled = known.places.get(&start).is_some_and(|&there| there >= bytes);
        if known.settled {
            return Ok(());
        }
        let is_in = |segment: &Segment| segment.addresses.contains(&start);
        if !known.segments.iter().any(is_in)
            && let Some(segment) = mapped(start)
        {
            known.segments.push(segment);
        }
        match known.segments.iter().find(|segment| is_in(segment)) {
            Some(segment) => segment.allocate(start, bytes)?,
            // A system that does not tell what lies where: the room was looked at before the loan.
            None => room(bytes)?,
        }
        known.places.insert(start, bytes);
        Ok(())
    }
}

impl Segment {
    /// Has the pages of `bytes` bytes from an address on allocated.
    fn allocate(&self, start: usize, bytes: usize) -> Result<(), Error> {
        let from = (start - self.addresses.start) as u64 + self.offset;
        loop {
            match fallocate(&self.file, FallocateFlags::KEEP_SIZE, from, bytes.max(1) as u64) {
                Err(Errno::INTR) => {}
                Err(Errno::NOSPC | Errno::NOMEM | Errno::DQUOT) => return Err(full(bytes)),
                // A file system that cannot do it: the room was looked at before the loan.
                _ => return Ok(()),
            }
        }
    }
}

/// The file that lies at an address, by proc_pid_maps(5).
fn mapped(address: usize) -> Option<Segment> {
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let (addresses, offset, path) = maps.lines().find_map(|line| {
        let (addresses, offset, path) = fields(line)?;
        addresses.contains(&address).then_some((addresses, offset, path))
    })?;
    Some(Segment { addresses, offset, file: File::options().read(true).write(true).open(path).ok()? })
}

/// Addresses, offset and path of a line of proc_pid_maps(5) that is of a shared segment.
fn fields(line: &str) -> Option<(Range<usize>, u64, &str)> {
    let path = &line[line.find(FOLDER)?..];
    let mut words = line.split_ascii_whitespace();
    let (from, to) = words.next()?.split_once('-')?;
    let (from, to) = (usize::from_str_radix(from, 16).ok()?, usize::from_str_radix(to, 16).ok()?);
    let is_shared = words.next()?.ends_with('s');
    let offset = u64::from_str_radix(words.next()?, 16).ok()?;
    is_shared.then_some((from..to, offset, path))
}

/// That there is room for a port, or for a segment that grows.
///
/// # Errors
/// `System`.
pub fn room(bytes: usize) -> Result<(), Error> {
    match free() {
        Some((free, _)) if free < OWN.saturating_add(bytes as u64) => Err(full(bytes)),
        // Where nothing can be said of the folder, iceoryx2 says it.
        _ => Ok(()),
    }
}

/// Free bytes and all bytes of the folder.
fn free() -> Option<(u64, u64)> {
    let says = rustix::fs::statvfs(FOLDER).ok()?;
    let bytes = |blocks: u64| blocks.saturating_mul(says.f_frsize);
    // A file system without a limit says that it has no blocks.
    (says.f_blocks > 0).then(|| (bytes(says.f_bavail), bytes(says.f_blocks)))
}

fn full(bytes: usize) -> Error {
    let mega = |bytes: u64| bytes as f64 / 1e6;
    let of = match free() {
        Some((free, all)) => format!("{:.1} MB of its {:.1} MB are free", mega(free), mega(all)),
        None => "its size is not known".into(),
    };
    let wanted = mega(OWN.saturating_add(bytes as u64));
    Error::System(format!(
        "shared memory is full: {FOLDER} has no room for {wanted:.1} MB more, {of}; make it larger (a container's: \
         `--shm-size=1g`), or end other sessions"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_maps_is_read_and_others_are_not() {
        let line = "7f10c2a00000-7f10c2b00000 rw-s 00001000 00:1a 42                 /dev/shm/ctdabc_x__0.data";
        assert_eq!(fields(line), Some((0x7f10_c2a0_0000..0x7f10_c2b0_0000, 0x1000, "/dev/shm/ctdabc_x__0.data")));
        for other in [
            "7f10c2a00000-7f10c2b00000 rw-p 00001000 00:1a 42 /dev/shm/ctdabc_x__0.data",
            "7f10c2a00000-7f10c2b00000 rw-s 00001000 00:1a 42 /usr/lib/libc.so.6",
            "7f10c2a00000-7f10c2b00000 rw-p 00000000 00:00 0",
            "",
        ] {
            assert_eq!(fields(other), None, "{other}");
        }
    }

    #[test]
    fn places_are_known_until_a_loan_is_larger_than_any_before() {
        let pages = Pages::default();
        let settled = || pages.known.lock().expect("no panic").settled;
        let loan = [0_u64; 64];
        pages.before(512).expect("room");
        // No file lies here: the room decides.
        pages.claim(&loan).expect("room");
        assert!(!settled());
        pages.claim(&loan[..3]).expect("known");
        assert!(settled());
        pages.before(512).expect("room");
        assert!(settled());
        pages.before(513).expect("room");
        assert!(!settled() && pages.known.lock().expect("no panic").places.is_empty());
    }

    #[test]
    fn what_no_folder_has_room_for_is_an_error() {
        let error = room(usize::MAX).expect_err("more than there is").to_string();
        assert!(
            error.starts_with("shared memory is full: /dev/shm has no room for 18446744073709.6 MB more"),
            "{error}"
        );
    }
}
