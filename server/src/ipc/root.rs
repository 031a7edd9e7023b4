//! The server's place on this machine: its folder, its lock, its incarnation, and what is left of predecessors.
//!
//! Whoever holds the lock is the one server of its name. It removes what predecessors left (a killed one leaves its
//! folders and its shared memory), takes a new epoch, and publishes it once everything can be opened. Removal touches only
//! names that begin with the server's own prefix and files of its own user, and follows no links.

use contactd_proto::names::{Address, AddressError, Incarnation, own_uid, start_of_process};
use rustix::fs::{FlockOperation, flock};
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Where POSIX shared memory shows as files.
const SHARED_MEMORY: &str = "/dev/shm";
/// How often a folder that comes and goes is made again.
const TRIES: u32 = 3;

/// Why a server has no place.
#[derive(Debug, thiserror::Error)]
pub enum RootError {
    /// A folder is not private.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Another server has this name.
    #[error("a server called \"{name}\" is running already{who}")]
    Running {
        /// The name.
        name: String,
        /// Its process, if it has said.
        who: String,
    },
    /// Something else lies where a server has its folder.
    #[error(
        "{0} is no folder, and a server needs one there: remove it, or set XDG_RUNTIME_DIR to a folder of your own"
    )]
    NoFolder(PathBuf),
    /// The system failed.
    #[error("{what}: {reason}")]
    System {
        /// At what.
        what: String,
        /// Why.
        reason: io::Error,
    },
}

/// A place that is held until it is dropped, which removes all that is left of it.
#[derive(Debug)]
pub struct Root {
    address: Address,
    epoch: u64,
    lock: File,
}

impl Root {
    /// Takes the place of `address`.
    ///
    /// # Errors
    /// Another server holds it; a folder is open to other users, or is none; the system fails.
    pub fn take(address: &Address) -> Result<Self, RootError> {
        for folder in [address.base(), &address.folder()] {
            match DirBuilder::new().mode(0o700).create(folder) {
                Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(system(folder, e)),
                Err(_) if !folder.is_dir() => return Err(RootError::NoFolder(folder.to_owned())),
                _ => {}
            }
        }
        address.check_private()?;
        let lock = lock(address)?;
        // The clock may have been set back: an epoch is larger than any that a leftover names.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
        let epoch = now.max(address.current().map_or(0, |last| last.epoch + 1));
        let root = Self { address: address.clone(), epoch, lock };
        root.make_shared_folder()?;
        Ok(root)
    }

    /// Makes iceoryx2's folder anew. A client that waits for this server may have read what its killed predecessor published in
    /// the moment before it was removed, and looks for that one in the folder, which then cannot be removed or is there again. It
    /// may stay: names in it carry the epoch.
    fn make_shared_folder(&self) -> Result<(), RootError> {
        self.remove_leftovers();
        let folder = self.address.shared_folder();
        let own = || folder.symlink_metadata().is_ok_and(|m| m.is_dir() && m.uid() == own_uid());
        let mut tries = 0..TRIES;
        loop {
            match DirBuilder::new().mode(0o700).create(&folder) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && own() => return Ok(()),
                // It went while it was looked at.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && tries.next().is_some() => {}
                made => return made.map_err(|e| system(&folder, e)),
            }
        }
    }

    /// The number of this incarnation.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Tells clients that this incarnation serves.
    ///
    /// # Errors
    /// The system fails.
    pub fn publish(&self) -> Result<(), RootError> {
        let pid = std::process::id();
        let start = start_of_process(pid).unwrap_or(0);
        let text = Incarnation { epoch: self.epoch, pid, start }.text();
        let file = self.address.current_file();
        let temporary = file.with_extension("new");
        // Written aside and renamed: a reader sees all of it or nothing.
        let write = || -> io::Result<()> {
            File::create(&temporary)?.write_all(text.as_bytes())?;
            fs::rename(&temporary, &file)
        };
        write().map_err(|e| system(&file, e))
    }

    /// Removes the published file, iceoryx2's folder, and every shared memory object of the server's prefix.
    fn remove_leftovers(&self) {
        // Whatever cannot be removed is in nobody's way: names carry the epoch.
        let current = self.address.current_file();
        let _ = fs::remove_file(&current);
        let _ = fs::remove_file(current.with_extension("new"));
        let _ = fs::remove_dir_all(self.address.shared_folder());
        let prefix = self.address.prefix();
        for entry in fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten() {
            let ours = entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes());
            // A directory entry's metadata is that of the entry itself, not of what a link points to.
            if ours && entry.metadata().is_ok_and(|m| m.uid() == own_uid() && m.is_file()) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        self.remove_leftovers();
        // Still under the lock: a successor that waits for it finds that the file it locked is gone, and starts anew.
        let _ = fs::remove_file(self.address.lock_file());
        let _ = fs::remove_dir(self.address.folder());
        let _ = flock(&self.lock, FlockOperation::Unlock);
    }
}

/// Locks the server's lock file. Clients may hold it shared for a moment, while they look whether a server lives.
fn lock(address: &Address) -> Result<File, RootError> {
    let path = address.lock_file();
    let until = Instant::now() + Duration::from_secs(1);
    loop {
        let no_follow = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
        let mut options = OpenOptions::new();
        options.create(true).truncate(false).write(true).read(true).mode(0o600).custom_flags(no_follow);
        match options.open(&path) {
            Ok(file) => {
                let locked = flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok();
                if locked && is_same(&file, &path) {
                    return Ok(file);
                }
            }
            // The folder went with a server that was just leaving.
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let _ = DirBuilder::new().mode(0o700).create(address.folder());
            }
            Err(e) => return Err(system(&path, e)),
        }
        if Instant::now() > until {
            let who = address.current().map_or_else(String::new, |now| format!(" (process {})", now.pid));
            return Err(RootError::Running { name: address.name().into(), who });
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// True when `path` still names the open file.
fn is_same(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(there)) => (open.dev(), open.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

fn system(what: &Path, reason: io::Error) -> RootError {
    RootError::System { what: what.display().to_string(), reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn base() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::set_permissions(dir.path(), fs::Permissions::from_mode(0o700)).unwrap();
        dir
    }

    #[test]
    fn a_file_where_the_folder_belongs_is_named() {
        let dir = base();
        let file = dir.path().join("file");
        fs::write(&file, "kept").unwrap();
        let refused = Root::take(&Address::under(&file, "one").unwrap()).unwrap_err().to_string();
        assert!(refused.starts_with(&format!("{} is no folder", file.display())), "{refused}");
        assert_eq!(fs::read_to_string(file).unwrap(), "kept");
    }

    #[test]
    fn one_server_of_a_name_and_nothing_left_behind() {
        let dir = base();
        let address = Address::under(dir.path(), "one").unwrap();
        let other = Address::under(dir.path(), "one_more").unwrap();
        let root = Root::take(&address).unwrap();
        let sentence = Root::take(&address).unwrap_err().to_string();
        assert!(sentence.contains("\"one\" is running already"), "{sentence}");
        let second = Root::take(&other).unwrap();
        root.publish().unwrap();
        assert_eq!(address.current().map(|now| now.pid), Some(std::process::id()));
        let shm = Path::new(SHARED_MEMORY).join(format!("{}x", address.prefix_of(root.epoch())));
        let foreign = Path::new(SHARED_MEMORY).join(format!("{}x", other.prefix_of(second.epoch())));
        for file in [&shm, &foreign] {
            fs::write(file, "x").unwrap();
        }
        drop(root);
        assert!(!address.folder().exists() && !address.shared_folder().exists() && !shm.exists());
        assert!(other.folder().exists() && foreign.exists(), "another server's things are its own");
        drop(second);
        assert!(!foreign.exists());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_killed_predecessor_is_swept_away_and_its_epoch_passed() {
        let dir = base();
        let address = Address::under(dir.path(), "killed").unwrap();
        let future = u64::MAX / 2;
        DirBuilder::new().mode(0o700).create(address.folder()).unwrap();
        fs::create_dir_all(address.shared_folder().join("services")).unwrap();
        fs::write(address.current_file(), Incarnation { epoch: future, pid: 1, start: 0 }.text()).unwrap();
        let shm = Path::new(SHARED_MEMORY).join(format!("{}x", address.prefix_of(future)));
        fs::write(&shm, "x").unwrap();
        let root = Root::take(&address).unwrap();
        assert!(root.epoch() > future && !shm.exists() && !address.shared_folder().join("services").exists());
        assert_eq!(address.current(), None, "nobody is reported before it serves");
    }

    #[test]
    fn clients_that_look_for_a_killed_predecessor_stop_no_successor() {
        let dir = base();
        let address = Address::under(dir.path(), "looked_for").unwrap();
        let node = address.shared_folder().join("nodes/old/details");
        let is_over = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                    let _ = fs::create_dir_all(&node);
                    std::thread::yield_now();
                }
            });
            // A server of its own each time, as a supervisor starts one; the folder is there or comes back while it is removed.
            let taken: Vec<_> = (0..200).map(|_| Root::take(&address).map(drop)).collect();
            is_over.store(true, std::sync::atomic::Ordering::Relaxed);
            assert_eq!(taken.iter().filter(|t| t.is_err()).count(), 0, "{taken:?}");
        });
    }

    #[test]
    fn a_folder_open_to_others_is_refused() {
        let dir = base();
        fs::set_permissions(dir.path(), fs::Permissions::from_mode(0o777)).unwrap();
        let address = Address::under(dir.path(), "open").unwrap();
        let sentence = Root::take(&address).unwrap_err().to_string();
        assert!(sentence.contains("0700"), "{sentence}");
    }

    #[test]
    fn a_link_in_place_of_the_lock_is_refused() {
        let dir = base();
        let address = Address::under(dir.path(), "link").unwrap();
        DirBuilder::new().mode(0o700).create(address.folder()).unwrap();
        std::os::unix::fs::symlink("/etc/passwd", address.lock_file()).unwrap();
        assert!(matches!(Root::take(&address), Err(RootError::System { .. })));
    }
}
