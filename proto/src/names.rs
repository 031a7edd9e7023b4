//! Where a server and its clients find each other: service names, prefixes and folders.
//!
//! A server called S keeps its lock in `RUNTIME/contactd/S`, RUNTIME being the user's own runtime folder, and what
//! iceoryx2 makes in a folder beside it that has a short name, since paths of sockets are short. Each start of the server
//! is an *incarnation* with a number, its epoch; whatever it makes carries the epoch in its name, so nothing that a killed
//! predecessor left half-made can stand in its way, and a client of the predecessor that still tidies up cannot touch
//! it. The file `current` in the server's folder names the incarnation that serves.
//!
//! Invariant: every name that contactd makes in a shared place begins with [`Address::prefix`], which belongs to one
//! user, one runtime folder and one server name, and is a prefix of no other server's.

use std::fmt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Version of the protocol; part of every service name but the status service's.
pub const PROTOCOL_VERSION: u32 = 3;
/// The service whose layout never changes.
pub const STATUS_SERVICE: &str = "contactd/status";
/// Request-response service of steps.
pub const STEP_SERVICE: &str = "contactd/3/step";
/// Request-response service of commands.
pub const CONTROL_SERVICE: &str = "contactd/3/control";
/// Event service by which clients wake the server.
pub const WAKE_SERVICE: &str = "contactd/3/wake";
/// The server's name when none is given.
pub const DEFAULT_NAME: &str = "default";

/// Event service by which the server wakes the client of one session.
pub fn wake_service_of(session: u64) -> String {
    format!("{WAKE_SERVICE}/{session}")
}

/// Why there is no address for a server. `Debug` prints the sentence, too: it is what a `main` that returns one ends with.
#[derive(Clone, PartialEq, Eq)]
pub enum AddressError {
    /// The name is not of the form `[a-z0-9_-]{1,32}`.
    Name(String),
    /// No runtime folder, or one that other users can write to.
    Folder(PathBuf, &'static str),
}

impl fmt::Display for AddressError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => {
                write!(f, "\"{name}\" is not a server name: expected 1 to 32 of the characters a-z, 0-9, _ and -")
            }
            Self::Folder(path, why) => write!(f, "{}: {why}", path.display()),
        }
    }
}

impl fmt::Debug for AddressError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for AddressError {}

/// The place of a server: the same value on both sides, from the same name and the same environment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    name: String,
    uid: u32,
    base: PathBuf,
    /// Seven characters that stand for user, base and name where room is short.
    code: String,
}

impl Address {
    /// The address of server `name` under the user's runtime folder: `$XDG_RUNTIME_DIR`, else `/run/user/UID`, else
    /// `/tmp/contactd-UID`, a folder that must be the user's own with mode 0700 (the server makes it so).
    ///
    /// # Errors
    /// A malformed name; a runtime folder that is not an absolute path.
    pub fn of(name: &str) -> Result<Self, AddressError> {
        let uid = own_uid();
        let base = match std::env::var_os("XDG_RUNTIME_DIR").filter(|d| !d.is_empty()) {
            Some(dir) => PathBuf::from(dir).join("contactd"),
            None => {
                let run = PathBuf::from(format!("/run/user/{uid}"));
                if is_private(&run, uid).is_ok() {
                    run.join("contactd")
                } else {
                    PathBuf::from(format!("/tmp/contactd-{uid}"))
                }
            }
        };
        Self::under(&base, name)
    }

    /// The address of server `name` under `base`, a folder that only this user may write to; made when missing.
    ///
    /// # Errors
    /// A malformed name; a base that is not an absolute path of reasonable length.
    pub fn under(base: &Path, name: &str) -> Result<Self, AddressError> {
        check_name(name)?;
        if !base.is_absolute() {
            return Err(AddressError::Folder(base.into(), "the runtime folder must be an absolute path"));
        }
        if base.as_os_str().len() > LONGEST_BASE {
            return Err(AddressError::Folder(base.into(), "longer than the 39 bytes that sockets' paths leave for it"));
        }
        let uid = own_uid();
        let words = [&uid.to_le_bytes(), base.as_os_str().as_encoded_bytes(), name.as_bytes()];
        let code = base32(fnv1a(&words.join(&0)) >> 29, 7);
        Ok(Self { name: name.into(), uid, base: base.into(), code })
    }

    /// The addresses of all servers beside this one: those that have a folder under its base, whether they run or not; by name.
    pub fn beside(&self) -> Vec<Self> {
        let folders = std::fs::read_dir(&self.base).into_iter().flatten().flatten();
        let mut names: Vec<String> = folders
            .filter(|e| e.file_type().is_ok_and(|t| t.is_dir()))
            .filter_map(|e| e.file_name().into_string().ok())
            .collect();
        names.sort();
        // What iceoryx2 keeps begins with a dot, which no name of a server has.
        names.iter().filter_map(|name| Self::under(&self.base, name).ok()).collect()
    }

    /// The server's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The folder that holds the folders of all servers: private to the user.
    pub fn base(&self) -> &Path {
        &self.base
    }

    /// The server's folder.
    pub fn folder(&self) -> PathBuf {
        self.base.join(&self.name)
    }

    /// The file that the serving process holds locked.
    pub fn lock_file(&self) -> PathBuf {
        self.folder().join("lock")
    }

    /// The file that names the serving incarnation.
    pub fn current_file(&self) -> PathBuf {
        self.folder().join("current")
    }

    /// The folder in which iceoryx2 keeps the files and sockets of this server.
    pub fn shared_folder(&self) -> PathBuf {
        self.base.join(format!(".{}", self.code))
    }

    /// What every shared memory name of this server begins with.
    pub fn prefix(&self) -> String {
        format!("ctd{}", self.code)
    }

    /// Prefix of one incarnation: 30 bits of its epoch, which repeat after 13 days.
    pub fn prefix_of(&self, epoch: u64) -> String {
        format!("{}{}_", self.prefix(), base32(epoch >> 20, 6))
    }

    /// Checks that the base and the server's folder belong to this user alone (mode 0700, no link).
    ///
    /// # Errors
    /// Which folder is not, and why.
    pub fn check_private(&self) -> Result<(), AddressError> {
        is_private(&self.base, self.uid).map_err(|why| AddressError::Folder(self.base.clone(), why))?;
        is_private(&self.folder(), self.uid).map_err(|why| AddressError::Folder(self.folder(), why))
    }

    /// The incarnation that serves, as `current` says; `None` when no server runs or it is still starting.
    pub fn current(&self) -> Option<Incarnation> {
        Incarnation::parse(&std::fs::read_to_string(self.current_file()).ok()?)
    }
}

/// A socket's path has 107 bytes: base, "/.code", "/", prefix, 39 digits of a port, ".e".
const LONGEST_BASE: usize = 107 - 9 - 1 - 17 - 39 - 2;

/// The lowest `digits` digits of `n` to the base 32.
fn base32(n: u64, digits: u32) -> String {
    let digit = |i| b"0123456789abcdefghijklmnopqrstuv"[(n >> (5 * i) & 31) as usize] as char;
    (0..digits).rev().map(digit).collect()
}

/// One start of a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Incarnation {
    /// Its number: nanoseconds since 1970 at its start, larger than its predecessor's.
    pub epoch: u64,
    /// Its process.
    pub pid: u32,
    /// When that process started, clock ticks since boot; 0 when unknown.
    pub start: u64,
}

impl Incarnation {
    /// The text of the file `current`.
    pub fn text(&self) -> String {
        format!("contactd 1 epoch {:016x} pid {} start {}\n", self.epoch, self.pid, self.start)
    }

    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let &["contactd", _, "epoch", epoch, "pid", pid, "start", start] = words.as_slice() else {
            return None;
        };
        let epoch = u64::from_str_radix(epoch, 16).ok()?;
        Some(Self { epoch, pid: pid.parse().ok()?, start: start.parse().ok()? })
    }
}

/// Checks the form `[a-z0-9_-]{1,32}` of a server name.
///
/// # Errors
/// `AddressError::Name`.
pub fn check_name(name: &str) -> Result<(), AddressError> {
    let good = |c: u8| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'_' || c == b'-';
    if (1..=32).contains(&name.len()) && name.bytes().all(good) {
        return Ok(());
    }
    Err(AddressError::Name(name.chars().take(64).collect()))
}

/// The user this process runs as.
pub fn own_uid() -> u32 {
    std::fs::metadata("/proc/self").map_or(u32::MAX, |m| m.uid())
}

/// When a process started, in clock ticks since boot (field 22 of its `stat`); tells a process from another that got
/// the same id later.
pub fn start_of_process(pid: u32) -> Option<u64> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The second field, the program's name, may hold spaces and parentheses.
    stat[stat.rfind(')')? + 1..].split_whitespace().nth(19)?.parse().ok()
}

fn is_private(path: &Path, uid: u32) -> Result<(), &'static str> {
    let m = std::fs::symlink_metadata(path).map_err(|_| "the folder does not exist")?;
    if !m.is_dir() {
        return Err("not a folder (links are not followed)");
    }
    if m.uid() != uid {
        return Err("the folder belongs to another user");
    }
    if m.mode() & 0o077 != 0 {
        return Err("the folder is open to other users: its mode must be 0700");
    }
    Ok(())
}

/// FNV-1a, 64 bits: keeps the prefixes of different runtime folders apart; no security rests on it.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_of_the_documented_form() {
        for good in ["a", "default", "cell-7_b", &"x".repeat(32)] {
            assert_eq!(check_name(good), Ok(()), "{good}");
        }
        for bad in ["", "A", "a b", "../x", "a/b", "é", &"x".repeat(33)] {
            let message = check_name(bad).unwrap_err().to_string();
            assert!(message.contains("a-z, 0-9, _ and -"), "{message}");
        }
    }

    #[test]
    fn services_carry_the_version_of_the_protocol() {
        for name in [STEP_SERVICE, CONTROL_SERVICE, WAKE_SERVICE] {
            assert!(name.starts_with(&format!("contactd/{PROTOCOL_VERSION}/")), "{name}");
        }
    }

    #[test]
    fn no_prefix_begins_another() {
        let base = Path::new("/run/user/7/contactd");
        let names = ["a", "a_", "a_1", "a-1"];
        let all: Vec<String> = names.iter().map(|n| Address::under(base, n).unwrap().prefix()).collect();
        for (i, p) in all.iter().enumerate() {
            for (j, q) in all.iter().enumerate() {
                assert!(i == j || !q.starts_with(p.as_str()), "{p} {q}");
            }
        }
        let elsewhere = Address::under(Path::new("/run/user/8/contactd"), "a").unwrap();
        assert_ne!(elsewhere.prefix(), all[0]);
        assert_ne!(elsewhere.prefix_of(1 << 40), elsewhere.prefix_of((1 << 40) + (1 << 20)));
    }

    #[test]
    fn the_longest_socket_fits() {
        let base = PathBuf::from(format!("/{}", "x".repeat(38)));
        let address = Address::under(&base, &"n".repeat(32)).unwrap();
        let path = address.shared_folder().join(format!("{}{}.e", address.prefix_of(u64::MAX), u128::MAX));
        assert_eq!(path.as_os_str().len(), 107);
        assert!(Address::under(&base.join("y"), "n").is_err());
    }

    #[test]
    fn an_incarnation_comes_back_from_its_text() {
        let i = Incarnation { epoch: 0x1234_5678_9abc_def0, pid: 77, start: 5 };
        assert_eq!(Incarnation::parse(&i.text()), Some(i));
        assert_eq!(Incarnation::parse("contactd 1 epoch zz pid 1 start 2"), None);
        assert_eq!(Incarnation::parse(""), None);
    }

    #[test]
    fn a_folder_open_to_others_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let dir = std::env::temp_dir().join(format!("contactd-names-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        std::fs::set_permissions(&dir, std::fs::Permissions::from_mode(0o755)).unwrap();
        assert!(is_private(&dir, own_uid()).unwrap_err().contains("0700"));
        std::fs::set_permissions(&dir, std::fs::Permissions::from_mode(0o700)).unwrap();
        assert_eq!(is_private(&dir, own_uid()), Ok(()));
        assert!(is_private(&dir, own_uid() + 1).unwrap_err().contains("another user"));
        std::fs::remove_dir(&dir).unwrap();
    }

    #[test]
    fn a_process_has_one_start() {
        let own = start_of_process(std::process::id());
        assert!(own.is_some());
        assert_eq!(own, start_of_process(std::process::id()));
    }
}
