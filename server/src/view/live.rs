//! A show of what happens now: acts grow while steps are taken, and where objects or models change another show takes its place. The
//! page hears of both by server-sent events at `/live`, and loads itself anew for another show.

use super::show::Show;
use crate::http::{Answer, Answers, Events, Listening};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The shortest time between two events: a page draws no more often.
const BETWEEN: Duration = Duration::from_millis(100);
/// After so long without news a stream says that it is still there.
const QUIET: Duration = Duration::from_secs(1);

/// What is shown now.
#[derive(Debug, Default)]
pub struct Live {
    now: Mutex<Now>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Now {
    show: Option<Arc<Show>>,
    /// Why nothing more will come; empty: more may.
    ended: String,
}

impl Live {
    fn now(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another show takes the place of the one before; it says how it grows (`Show::growing`).
    pub fn put(&self, show: Show) {
        self.now().show = Some(Arc::new(show));
        self.changed.notify_all();
    }

    /// Its acts have more steps than before.
    pub fn grown(&self) {
        self.changed.notify_all();
    }

    /// Nothing more will come; a sentence why.
    pub fn end(&self, sentence: String) {
        self.now().ended = sentence;
        self.changed.notify_all();
    }

    /// What is shown now, if anything is.
    pub fn show(&self) -> Option<Arc<Show>> {
        self.now().show.clone()
    }

    /// What a browser sees before there is a show: it asks again each second.
    fn waiting(&self) -> String {
        let ended = &self.now().ended;
        let sentence = if ended.is_empty() { "Waits for the first step." } else { ended };
        let sentence = sentence.replace('&', "&amp;").replace('<', "&lt;");
        format!(
            "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta http-equiv=\"refresh\" content=\"1\">\
             <title>contactd view</title><p>{sentence}\n"
        )
    }

    /// The news, as JSON: which show, the steps of its acts, why nothing more will come.
    fn news(now: &Now) -> String {
        let growing = now.show.as_ref().and_then(|show| show.growing.as_ref());
        let steps: Vec<usize> = growing.iter().flat_map(|(_, steps)| steps).map(|n| n.load(Relaxed)).collect();
        let number = growing.map_or(0, |(number, _)| *number);
        serde_json::json!({ "live": number, "steps": steps, "ended": now.ended }).to_string()
    }

    /// Waits for news other than `told`; an empty text where none came for a while.
    fn after(&self, told: &str) -> String {
        let now = self.now();
        let same = |now: &mut Now| Self::news(now) == told;
        let (now, waited) = self.changed.wait_timeout_while(now, QUIET, same).unwrap_or_else(PoisonError::into_inner);
        if waited.timed_out() { String::new() } else { Self::news(&now) }
    }

    /// The stream of its news.
    fn events(self: &Arc<Self>) -> Events {
        let (live, mut told) = (self.clone(), String::new());
        Events(Box::new(move || {
            if !told.is_empty() {
                std::thread::sleep(BETWEEN);
            }
            let news = live.after(&told);
            if !news.is_empty() {
                told.clone_from(&news);
            }
            Some(news)
        }))
    }
}

/// What a path is answered with.
pub fn answer(live: &Arc<Live>, path: &str) -> Answer {
    match (path, live.show()) {
        ("/live", _) => Answer::stream(live.events()),
        (_, Some(show)) => super::answer(&show, path),
        ("/", None) => Answer::of("text/html; charset=utf-8", live.waiting()),
        (_, None) => Answer::refused(503, "there is nothing to show yet: ask again"),
    }
}

/// As `serve` of a show, of what is shown at the time.
///
/// # Errors
/// One sentence why it cannot listen.
pub fn serve(live: &Arc<Live>, port: u16, ready: impl FnOnce(&str)) -> Result<(), String> {
    let listening = Listening::on(port)?;
    ready(&format!("http://{}/", listening.address()));
    let live = live.clone();
    let answers: Arc<Answers> = Arc::new(move |path: &str| answer(&live, path));
    listening.answer(&answers).map_err(|e| format!("expected to take requests, found {e}"))
}
