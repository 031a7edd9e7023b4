//! The handle behind `contactd_session *`: whose it is, whether a call is under way, and the one way into it.

use crate::error::Failure;
use crate::models::Models;
use contactd_client::{Error, Transport};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::{self, ThreadId};

/// A session of whichever transport.
pub(crate) type Inner = contactd_client::Session<Box<dyn Transport>>;

/// One client's scene on a server, or in this process. It belongs to the thread that opened it.
pub struct Session {
    owner: ThreadId,
    /// A call is under way.
    busy: Cell<bool>,
    state: UnsafeCell<State>,
}

/// What the calls work on.
pub(crate) struct State {
    pub(crate) session: Inner,
    pub(crate) models: Models,
    /// Records of the reply whose slots lie in the transport.
    pub(crate) records: Option<usize>,
    /// A call panicked: what it left half done is not looked at again.
    pub(crate) panicked: bool,
}

thread_local! {
    static HERE: ThreadId = thread::current().id();
}

fn here() -> ThreadId {
    HERE.try_with(|id| *id).unwrap_or_else(|_| thread::current().id())
}

/// A handle on a session over `transport`, to be closed by `contactd_close`: what connecting and embedding end in.
///
/// # Errors
/// Those of [`Transport::open`].
pub fn hand_over(transport: Box<dyn Transport>) -> Result<*mut Session, Error> {
    let session = Inner::new(transport)?;
    let state = State { session, models: Models::default(), records: None, panicked: false };
    Ok(Box::into_raw(Box::new(Session { owner: here(), busy: Cell::new(false), state: UnsafeCell::new(state) })))
}

/// Runs a call that needs no session; its code.
pub(crate) fn free(call: impl FnOnce() -> Result<(), Failure>) -> i32 {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(())) => crate::error::OK,
        Ok(Err(failure)) => failure.reported(),
        Err(payload) => panicked(payload).reported(),
    }
}

/// Runs a call on a session; its code.
///
/// # Safety
/// Point 3 of the contract: NULL, or a handle that was not closed.
pub(crate) unsafe fn on(session: *mut Session, call: impl FnOnce(&mut State) -> Result<(), Failure>) -> i32 {
    // SAFETY: NULL or a live handle; shared, since a call may be under way in it.
    let Some(session) = (unsafe { session.as_ref() }) else {
        return Failure::null("the session (closed, or never opened)").reported();
    };
    if let Err(failure) = session.enter() {
        return failure.reported();
    }
    // SAFETY: `enter` lets one call at a time through, of one thread: nothing else refers to the state.
    let state = unsafe { &mut *session.state.get() };
    let code = state.run(call);
    session.busy.set(false);
    code
}

/// Takes a handle back; its session is over, whatever the code says.
///
/// # Safety
/// Point 3 of the contract: a handle that was not closed.
pub(crate) unsafe fn take_back(session: *mut Session) -> Result<State, Failure> {
    // SAFETY: a live handle.
    unsafe { &*session }.enter()?;
    // SAFETY: it came out of a box in `hand_over`, and no call is under way in it.
    let session = unsafe { Box::from_raw(session) };
    Ok(session.state.into_inner())
}

impl Session {
    fn enter(&self) -> Result<(), Failure> {
        if self.owner != here() {
            return Err(Failure::misuse("the session belongs to the thread that opened it"));
        }
        if self.busy.replace(true) {
            return Err(Failure::misuse("a call of this session is under way"));
        }
        Ok(())
    }
}

impl State {
    fn run(&mut self, call: impl FnOnce(&mut Self) -> Result<(), Failure>) -> i32 {
        if self.panicked {
            let sentence = "contactd failed internally within this session: close it";
            return Failure::new(crate::error::ERROR_PANIC, sentence).reported();
        }
        // What a panic leaves half done is never looked at again: the session is closed to all calls but its end.
        match catch_unwind(AssertUnwindSafe(|| call(self))) {
            Ok(Ok(())) => crate::error::OK,
            Ok(Err(failure)) => failure.reported(),
            Err(payload) => {
                self.panicked = true;
                panicked(payload).reported()
            }
        }
    }
}

fn panicked(payload: Box<dyn Any + Send>) -> Failure {
    let failure = Failure::panic(&*payload);
    // Its end may panic too.
    std::mem::forget(payload);
    failure
}
