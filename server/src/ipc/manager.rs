//! What a service manager is told, in systemd's words (sd_notify(3)): the server is ready, its loop goes round, it stops.
//!
//! It is told from a thread of its own: a manager that does not listen holds up no session.

use sd_notify::NotifyState;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::Builder;
use std::time::Duration;

/// Of the time within which a manager wants to hear of the loop: a beat that comes late is no reason to end a server.
const PART: u32 = 4;
/// How long the thread sleeps where no manager wants to hear of the loop.
const LONG: Duration = Duration::from_secs(3600);
/// How long the end of a server waits for what is being told: on a busy machine the thread may get its turn late.
const LAST: Duration = Duration::from_secs(2);

/// A service manager that is told how the server is; or none.
#[derive(Debug, Default)]
pub struct Manager {
    /// Asks the thread to tell that the server stops.
    stopping: Option<Sender<()>>,
    /// Hung up when the thread has ended.
    ended: Option<Receiver<()>>,
}

impl Manager {
    /// Tells the manager that started this process, if one did, that the server is ready; and from then on that its loop goes round,
    /// as often as the manager wants to hear of it, while `beats` changes.
    ///
    /// # Errors
    /// The manager's socket takes nothing, or no thread can be started.
    pub fn ready(beats: Arc<AtomicU64>) -> io::Result<Self> {
        if std::env::var_os("NOTIFY_SOCKET").is_none() {
            return Ok(Self::default());
        }
        sd_notify::notify(&[NotifyState::Ready])?;
        let period = sd_notify::watchdog_enabled().map_or(LONG, |within| within / PART);
        let (stopping, asked) = channel();
        let (end, ended) = channel();
        Builder::new().name("contactd-notify".into()).spawn(move || {
            // What a manager does not hear it acts upon itself.
            tell(&beats, &asked, period, |word| drop(sd_notify::notify(&[word])));
            drop(end);
        })?;
        Ok(Self { stopping: Some(stopping), ended: Some(ended) })
    }

    /// Tells that the server stops.
    pub fn stopping(&self) {
        // A thread that has gone tells nothing any more.
        let _ = self.stopping.as_ref().map(|stopping| stopping.send(()));
    }
}

impl Drop for Manager {
    fn drop(&mut self) {
        self.stopping = None;
        let _ = self.ended.as_ref().map(|ended| ended.recv_timeout(LAST));
    }
}

/// Says that the loop goes round, once a period if it does, and each time that it is asked to that the server stops.
fn tell(beats: &AtomicU64, asked: &Receiver<()>, period: Duration, say: impl Fn(NotifyState<'_>)) {
    let mut told = beats.load(Ordering::Relaxed);
    loop {
        let word = match asked.recv_timeout(period) {
            Ok(()) => NotifyState::Stopping,
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {
                let now = beats.load(Ordering::Relaxed);
                if std::mem::replace(&mut told, now) == now {
                    continue;
                }
                NotifyState::Watchdog
            }
        };
        say(word);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_that_stands_still_is_told_of_no_more() {
        let (beats, (ask, asked), (say, said)) = (AtomicU64::new(7), channel(), channel());
        let period = Duration::from_millis(5);
        let heard = |patience: u64| said.recv_timeout(Duration::from_millis(patience)).ok();
        std::thread::scope(|scope| {
            let beats = &beats;
            scope.spawn(move || {
                tell(beats, &asked, period, |word| say.send(word.to_string()).expect("the test hears"));
            });
            assert_eq!(heard(50), None, "it has not gone round yet");
            for _ in 0..3 {
                beats.fetch_add(1, Ordering::Relaxed);
                assert_eq!(heard(60_000).as_deref(), Some("WATCHDOG=1"));
                assert_eq!(heard(50), None, "once for each time it was seen to go round");
            }
            ask.send(()).unwrap();
            assert_eq!(heard(60_000).as_deref(), Some("STOPPING=1"));
            drop(ask);
        });
    }
}
