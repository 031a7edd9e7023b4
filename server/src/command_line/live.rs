//! `contactd view --server NAME`: a running server's steps as they are taken.
//!
//! The server records for this process, as it does for `contactd record`: its sessions copy each step into a queue and wait for
//! nobody. The file has no name once it is opened, so that nothing is left of it, and another one takes its place when it is large. A
//! thread here follows it; steps are solved anew when a page asks for them, on this process's time.

use super::{CacheArguments, print, warn};
use crate::cache::Cache;
use crate::import::Scene;
use crate::operator::Recording;
use crate::recording::Content;
use crate::replay::{Following, Told};
use crate::view::buffers::Shown;
use crate::view::live::{self, Live};
use crate::view::show::{Act, Show};
use contactd_proto::control::ObjectSpec;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps of a run that are kept at most; then the next one begins.
const MOST: usize = 20_000;
/// Bytes of their texts that are kept at most.
const MOST_BYTES: usize = 64 << 20;
/// Bytes of a recording after which another one begins.
const LARGE: u64 = 256 << 20;
/// The same of those that are not read yet: a server that steps faster than this process reads is taken up again where it is now.
const BEHIND: u64 = 16 << 20;
/// How long steps are taken before they are told of.
const TAKE: Duration = Duration::from_millis(50);
/// How often the file is looked at, and the server asked whether it still records.
const LOOK: Duration = Duration::from_millis(20);
const ASK: Duration = Duration::from_secs(1);
/// How long a server may take to begin its file.
const BEGIN: Duration = Duration::from_secs(10);
/// Acts that are shown at most: the runs that began last.
const ACTS: usize = 8;

/// Steps of a session with the same objects.
struct Run {
    session: u64,
    first: u64,
    contents: Vec<Arc<Content>>,
    objects: Vec<ObjectSpec>,
    scenes: Arc<Mutex<Vec<String>>>,
    bytes: usize,
    count: Arc<AtomicUsize>,
}

/// What follows a server.
struct Follower {
    name: String,
    recording: Recording,
    following: Following,
    asked: Instant,
    models: HashMap<Arc<Content>, Shown>,
    cache: Option<Cache>,
    /// Those that began last come first.
    runs: Vec<Run>,
    /// Shows that were made.
    shows: u64,
}

/// Serves the page of a server until this process ends.
///
/// # Errors
/// One sentence: no such server, one that cannot be recorded, a port that is taken.
pub(super) fn view(name: &str, port: u16, cache: &CacheArguments) -> Result<(), String> {
    let mut follower = Follower::begin(name, cache.open())?;
    let live = Arc::new(Live::default());
    let followed = live.clone();
    let follow = move || {
        loop {
            if let Err(sentence) = follower.look(&followed) {
                warn(&sentence);
                followed.end(sentence);
                return;
            }
            std::thread::sleep(LOOK);
        }
    };
    let thread = std::thread::Builder::new().name("contactd-follow".into()).spawn(follow);
    thread.map_err(|e| format!("no thread can be started: {e}"))?;
    live::serve(&live, port, |address| {
        let _ = print(&format!(
            "contactd view: open {address} in a browser; it waits for the first step on \"{name}\"; Ctrl+C ends it\n"
        ));
    })
}

/// A recording of the server that this process alone reads.
fn begun(name: &str) -> Result<(Recording, Following), String> {
    let path = new_path();
    let recording = Recording::begin(name, &path, None).map_err(|e| e.to_string())?;
    let from = Instant::now();
    let following = loop {
        match Following::growing(&path) {
            Some(following) => break following,
            None if from.elapsed() < BEGIN => std::thread::sleep(LOOK),
            None => return Err(format!("{}: expected the server's recording, found none", path.display())),
        }
    };
    // Both have it open: it needs no name any more.
    std::fs::remove_file(&path).map_err(|e| format!("{}: expected to remove it, found {e}", path.display()))?;
    Ok((recording, following))
}

/// A file that is not there yet.
fn new_path() -> PathBuf {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    let number = COUNT.fetch_add(1, Relaxed);
    std::env::temp_dir().join(format!("contactd-view-{}-{number}.mcap", std::process::id()))
}

impl Follower {
    fn begin(name: &str, cache: Option<Cache>) -> Result<Self, String> {
        let (recording, following) = begun(name)?;
        let (asked, models, name) = (Instant::now(), HashMap::new(), name.to_owned());
        Ok(Self { name, recording, following, asked, models, cache, runs: Vec::new(), shows: 0 })
    }

    /// Takes what has come since.
    fn look(&mut self, live: &Live) -> Result<(), String> {
        let (mut is_other, mut has_grown, from) = (false, false, Instant::now());
        while from.elapsed() < TAKE
            && let Some(told) = self.following.next_step().map_err(|e| e.to_string())?
        {
            is_other |= self.take(told);
            has_grown = true;
        }
        if is_other {
            live.put(self.show()?);
        } else if has_grown {
            live.grown();
        }
        if self.asked.elapsed() > ASK {
            self.asked = Instant::now();
            self.recording.look().map_err(|e| e.to_string())?;
        }
        let (read, left) = self.following.bytes();
        if read > LARGE || left > BEHIND {
            // One at a time: a server records all of its sessions once.
            self.recording.end().map_err(|e| e.to_string())?;
            (self.recording, self.following) = begun(&self.name)?;
        }
        Ok(())
    }

    /// Takes a step; true when it begins another run. An opening alone begins none: it stands where steps were left out, too.
    fn take(&mut self, told: Told) -> bool {
        let Told { session, number, is_fresh, contents, objects, scene } = told;
        let before = self.runs.iter().position(|run| run.session == session);
        let goes_on = |run: &Run| {
            let is_same = !is_fresh || (run.contents == contents && run.objects == objects);
            is_same && run.count.load(Relaxed) < MOST && run.bytes <= MOST_BYTES
        };
        match before.map(|at| &mut self.runs[at]) {
            Some(run) if goes_on(run) => {
                run.bytes += scene.len();
                let mut scenes = run.scenes.lock().unwrap_or_else(PoisonError::into_inner);
                scenes.push(scene);
                run.count.store(scenes.len(), Relaxed);
                false
            }
            last => {
                // What is not fresh has the models and objects of the run before it.
                let (contents, objects) = match last {
                    Some(run) if !is_fresh => (run.contents.clone(), run.objects.clone()),
                    _ => (contents, objects),
                };
                self.runs.retain(|run| run.session != session);
                let (bytes, scenes, count) = (scene.len(), Arc::new(Mutex::new(vec![scene])), Arc::new(1.into()));
                self.runs.insert(0, Run { session, first: number, contents, objects, scenes, bytes, count });
                self.runs.truncate(ACTS);
                true
            }
        }
    }

    /// The show of the runs as they are.
    fn show(&mut self) -> Result<Show, String> {
        let (mut models, mut acts, mut counts): (Vec<Shown>, _, _) = (Vec::new(), Vec::new(), Vec::new());
        let mut places: HashMap<Arc<Content>, usize> = HashMap::new();
        for run in &self.runs {
            let mut of = Vec::new();
            for content in &run.contents {
                let at = match places.get(content) {
                    Some(at) => *at,
                    None => {
                        let shown = match self.models.get(content) {
                            Some(shown) => shown.clone(),
                            None => super::recorded::model(content, self.cache.as_ref())?,
                        };
                        self.models.insert(content.clone(), shown.clone());
                        models.push(shown);
                        places.insert(content.clone(), models.len() - 1);
                        models.len() - 1
                    }
                };
                of.push(at);
            }
            counts.push(run.count.clone());
            acts.push(run.act(of));
        }
        // Models that no run has any more are forgotten.
        self.models.retain(|content, _| places.contains_key(content));
        self.shows += 1;
        let mut show = Show::new(format!("server {}", self.name), models, acts)?;
        show.growing = Some((self.shows, counts));
        Ok(show)
    }
}

impl Run {
    fn act(&self, models: Vec<usize>) -> Act {
        let title = format!("session {}, from step {} on", self.session, self.first);
        let (scenes, name) = (self.scenes.clone(), title.clone());
        let scene = move |i: usize| {
            let scenes = scenes.lock().unwrap_or_else(PoisonError::into_inner);
            let text = scenes.get(i).ok_or_else(|| format!("expected a step of {}, found {}", scenes.len(), i + 1))?;
            Scene::parse(&name, text, Path::new("")).map_err(|e| e.to_string())
        };
        Act { title, steps: MOST, models, scene: Box::new(scene) }
    }
}
