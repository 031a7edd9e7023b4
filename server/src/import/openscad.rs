//! OpenSCAD's own texts (`.scad`): an installed OpenSCAD flattens them, and what it writes is read as `csg`.
//!
//! The program is started by its name, without a shell, and told the text's absolute path and that of an empty file to write.
//! What it says goes to a file, too, so that neither a pipe nor memory fills up; it is ended when its time is over or when it has
//! written more than a model's file may have, and with it what it has started itself. Nothing that a client sends comes here: files alone do.

use super::{ImportError, Limits};
use rustix::process::{Pid, Signal, kill_process_group};
use std::ffi::OsString;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// The variable of the environment that names the program.
pub const VARIABLE: &str = "CONTACTD_OPENSCAD";

/// How often it is looked whether the program has come to its end.
const LOOK: Duration = Duration::from_millis(5);
/// Bytes of what the program says that are read.
const HEARD: u64 = 64 << 10;
/// Lines of that which are told.
const TOLD: usize = 20;

/// The OpenSCAD that flattens texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Openscad {
    /// Its path, or a name that is looked for in the folders of `PATH`.
    pub program: OsString,
    /// After this it is ended.
    pub time: Duration,
}

impl Default for Openscad {
    /// The one that the environment names, else `openscad`; two minutes.
    fn default() -> Self {
        let named = std::env::var_os(VARIABLE).filter(|name| !name.is_empty());
        Self { program: named.unwrap_or_else(|| "openscad".into()), time: Duration::from_secs(120) }
    }
}

/// What OpenSCAD made of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flattened {
    /// The flattened text.
    pub bytes: Vec<u8>,
    /// Its warnings, a line each.
    pub warnings: Vec<String>,
}

/// True for the name of a text that has to be flattened.
pub fn is_source(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("scad"))
}

impl Openscad {
    /// Flattens the text of a file.
    ///
    /// # Errors
    /// `Read` where there is no such file; `Flatten` where the program is missing, fails, tells of an error, or takes too long.
    pub fn flatten(&self, path: &Path, limits: &Limits) -> Result<Flattened, ImportError> {
        let file = path.display().to_string();
        let absolute = path.canonicalize().map_err(|reason| ImportError::Read { file: file.clone(), reason })?;
        let failed = |found: String| ImportError::Flatten { file: file.clone(), found };
        let no_room = |e: std::io::Error| failed(format!("no room for what it writes ({e})"));
        // OpenSCAD tells by the name's ending what it is to write.
        let written = tempfile::Builder::new().prefix("contactd-").suffix(".csg").tempfile().map_err(no_room)?;
        let mut said = tempfile::tempfile().map_err(no_room)?;
        let ears = || said.try_clone().map(Stdio::from).map_err(no_room);
        let mut command = Command::new(&self.program);
        command.arg("-o").arg(written.path()).arg(absolute).stdin(Stdio::null()).stdout(ears()?).stderr(ears()?);
        // What the program starts itself ends with it: it may be a script around OpenSCAD.
        command.process_group(0);
        let name = self.program.to_string_lossy();
        let child = command.spawn().map_err(|e| {
            failed(format!("no program {name:?} ({e}): install OpenSCAD, or name it by --openscad or {VARIABLE}"))
        })?;
        let size = |file: &File| file.metadata().map_or(0, |about| about.len());
        let most = limits.bytes as u64;
        let ended = self.wait(child, || size(&said).max(size(written.as_file())) > most);
        let (errors, warnings) = heard(&mut said);
        let because = if errors.is_empty() { String::new() } else { format!(": {}", errors.join("; ")) };
        match ended.map_err(|e| failed(format!("no end of it ({e})")))? {
            Ended::Late => {
                return Err(failed(format!("none after {} s, the time that it has{because}", self.time.as_secs_f64())));
            }
            Ended::Large => return Err(failed(format!("more than {most} bytes written{because}"))),
            Ended::By(status) if !status.success() => return Err(failed(format!("a failure ({status}){because}"))),
            // An assertion that fails ends OpenSCAD's work, yet not with a status that says so.
            Ended::By(_) if errors.iter().any(|e| e.starts_with("ERROR")) => {
                return Err(failed(format!("an error{because}")));
            }
            Ended::By(_) => {}
        }
        // Some versions write beside the file and rename: it is read by its name.
        let bytes = super::read_bytes(written.path(), limits).map_err(|e| failed(e.to_string()))?;
        if bytes.is_empty() {
            return Err(failed(format!("nothing written{because}")));
        }
        Ok(Flattened { bytes, warnings })
    }

    /// Waits for the program's end, at most as long as it has.
    fn wait(&self, mut child: Child, too_large: impl Fn() -> bool) -> std::io::Result<Ended> {
        let begun = Instant::now();
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(Ended::By(status));
            }
            let ended =
                if begun.elapsed() > self.time { Some(Ended::Late) } else { too_large().then_some(Ended::Large) };
            if let Some(ended) = ended {
                kill_process_group(Pid::from_child(&child), Signal::KILL)?;
                child.wait()?;
                return Ok(ended);
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// How the program came to its end.
enum Ended {
    By(ExitStatus),
    Late,
    Large,
}

/// What the program said: why it failed (lines that tell of errors; failing these, all), and its warnings.
fn heard(said: &mut File) -> (Vec<String>, Vec<String>) {
    let mut bytes = Vec::new();
    // What cannot be read is not told; the exit status tells enough.
    let _ = said.rewind().and_then(|()| said.take(HEARD).read_to_end(&mut bytes));
    let text = String::from_utf8_lossy(&bytes);
    let lines = || text.lines().map(str::trim).filter(|l| !l.is_empty());
    let begins = |words: &'static [&'static str]| lines().filter(move |l| words.iter().any(|w| l.starts_with(w)));
    let few = |all: Vec<&str>| -> Vec<String> {
        let more = all.len().saturating_sub(TOLD);
        let told = all.iter().take(TOLD).map(|l| (*l).to_owned());
        told.chain((more > 0).then(|| format!("and {more} more"))).collect()
    };
    let mut errors = few(begins(&["ERROR", "TRACE", "Can't", "PARSER-ERROR", "EXPORT-ERROR"]).collect());
    let warnings = few(begins(&["WARNING", "DEPRECATED"]).collect());
    if errors.is_empty() {
        errors = few(lines().filter(|l| !l.starts_with("WARNING") && !l.starts_with("ECHO")).collect());
    }
    (errors, warnings)
}

/// Where files are looked for and what flattens them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Access {
    /// The folder, with all below it, that texts may import files from; `None`: each text from its own.
    pub root: Option<PathBuf>,
    /// Folders beside it that they may import files from, too: a robot's packages.
    pub packages: Vec<PathBuf>,
    /// What flattens OpenSCAD's own texts.
    pub openscad: Openscad,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Facets, ModelBytes};
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;

    /// A program that stands in for OpenSCAD: a script with `lines`, in which $2 is the file to write and $3 the text.
    fn stand_in(folder: &Path, lines: &str) -> Openscad {
        let program = folder.join("stand in");
        fs::write(&program, format!("#!/bin/sh\n{lines}\n")).expect("written");
        fs::set_permissions(&program, fs::Permissions::from_mode(0o700)).expect("a program");
        Openscad { program: program.into(), time: Duration::from_secs(20) }
    }

    #[test]
    fn what_a_program_flattens_is_the_model_and_what_it_warns_of_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let scad = folder.path().join("-o; touch x.scad");
        fs::write(&scad, "anything").expect("written");
        fs::write(
            folder.path().join("t.off"),
            "OFF 4 4 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n",
        )
        .expect("written");
        let lines = "[ \"$1\" = -o ] || exit 3\n[ $# = 3 ] || exit 4\necho ECHO: 3 >&2\necho WARNING: rough >&2\n\
                     echo 'cube(1); import(file = \"t.off\");' > \"$2\"\ngrep -q anything \"$3\"";
        let access = Access { openscad: stand_in(folder.path(), lines), ..Access::default() };
        let read = ModelBytes::read(&scad, &access, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
        let import = read.source().import(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(import.solid.primitives.len(), 2);
        let notes: Vec<String> = import.notes.iter().map(ToString::to_string).collect();
        assert_eq!(notes, ["1:1: openscad: WARNING: rough"]);
        assert!(!folder.path().join("x.scad").exists());
        // What is wrong with what it writes is told of that.
        let access = Access { openscad: stand_in(folder.path(), "echo 'cube(1);  nothing();' > \"$2\""), ..access };
        let read = ModelBytes::read(&scad, &access, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
        let error = read.source().import(Facets::Auto, &Limits::default()).expect_err("a call unheard of").to_string();
        assert!(error.contains("touch x.scad, flattened:1:11: expected a supported construct"), "{error}");
    }

    #[test]
    fn a_program_that_fails_is_told_in_one_sentence_with_what_it_said() {
        let folder = tempfile::tempdir().expect("a folder");
        let scad = folder.path().join("part.scad");
        let none = Openscad { program: folder.path().join("none").into(), time: Duration::from_secs(9) };
        let limits = Limits { bytes: 1000, ..Limits::default() };
        let error = none.flatten(&scad, &limits).expect_err("no file").to_string();
        assert!(error.contains("part.scad: expected a readable file, found No such file"), "{error}");
        fs::write(&scad, "cube(").expect("written");
        let error = none.flatten(&scad, &limits).expect_err("no program").to_string();
        assert!(error.contains("part.scad: expected OpenSCAD to flatten it, found no program \""), "{error}");
        assert!(error.ends_with("install OpenSCAD, or name it by --openscad or CONTACTD_OPENSCAD"), "{error}");
        for (lines, found) in [
            (
                "echo WARNING: w\necho 'ERROR: Parser error in line 3' >&2\necho \"Can't parse\" >&2\nexit 1",
                "found a failure (exit status: 1): ERROR: Parser error in line 3; Can't parse",
            ),
            ("echo 'ERROR: Assertion false failed'\necho > \"$2\"", "found an error: ERROR: Assertion false failed"),
            ("echo out of tune >&2\nkill -9 $$", "found a failure (signal: 9 (SIGKILL)): out of tune"),
            ("exit 0", "found nothing written"),
            ("yes | head -c 5000 > \"$2\"; sleep 60", "found more than 1000 bytes written"),
            ("yes | head -c 5000; sleep 60", "found more than 1000 bytes written: y; y; "),
        ] {
            let error = stand_in(folder.path(), lines).flatten(&scad, &limits).expect_err(lines).to_string();
            assert!(error.contains(found), "{error}\nnot {found}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        let slow = Openscad { time: Duration::from_millis(200), ..stand_in(folder.path(), "exec sleep 60") };
        let begun = Instant::now();
        let error = slow.flatten(&scad, &limits).expect_err("late").to_string();
        assert!(error.ends_with("found none after 0.2 s, the time that it has"), "{error}");
        assert!(begun.elapsed() < Duration::from_secs(10));
    }

    /// Processes of a group that are not at their end.
    fn at_work(group: &str) -> usize {
        let stats = fs::read_dir("/proc").expect("/proc").filter_map(|entry| {
            let stat = fs::read_to_string(entry.ok()?.path().join("stat")).ok()?;
            // Behind the name, which may hold anything: state, parent, group.
            let (_, rest) = stat.rsplit_once(')')?;
            let mut fields = rest.split_whitespace();
            Some((fields.next()? != "Z", fields.nth(1)? == group))
        });
        stats.filter(|stat| *stat == (true, true)).count()
    }

    #[test]
    fn what_a_program_has_started_ends_with_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let (scad, group) = (folder.path().join("part.scad"), folder.path().join("group"));
        fs::write(&scad, "cube();").expect("written");
        let limits = Limits { bytes: 1000, ..Limits::default() };
        let begin = format!("echo $$ > '{}'", group.display());
        for (time, end) in [(1000, "sleep 60 & sleep 60"), (20_000, "yes | head -c 5000 > \"$2\"; sleep 60 & sleep 60")]
        {
            let program = stand_in(folder.path(), &format!("{begin}\n{end}"));
            let program = Openscad { time: Duration::from_millis(time), ..program };
            program.flatten(&scad, &limits).expect_err("late, or large");
            let group = fs::read_to_string(&group).expect("a group");
            // They are told to end, which takes them a moment.
            let begun = Instant::now();
            while at_work(group.trim()) > 0 {
                assert!(begun.elapsed() < Duration::from_secs(10), "{end}: {} are at work", at_work(group.trim()));
                std::thread::sleep(LOOK);
            }
        }
    }
}
