//! Codes and sentences of failures. The server's codes keep their numbers (`contactd_proto::ErrorCode`); the client's own
//! begin beyond 1000. Numbers never change; new ones are appended.

use contactd_client::Error;
use contactd_proto::ErrorCode;
use contactd_proto::step::NO_INDEX;
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};

/// Done.
pub const OK: i32 = 0;
/// No server of this name is running.
pub const ERROR_NO_SERVER: i32 = 1001;
/// The server died or was stopped, or the session on it was lost: contactd_reconnect finds a server and replays the session.
pub const ERROR_SERVER_LOST: i32 = 1002;
/// The server could not deliver its reply; what was asked was done, or refused: contactd_reconnect goes back to before it,
/// then it is to be sent again (contactd_resend, for a step).
pub const ERROR_REPLY_LOST: i32 = 1003;
/// The time ran out. A step stays in flight: contactd_finish may be called again.
pub const ERROR_TIMEOUT: i32 = 1004;
/// The server's name or the runtime folder is not usable.
pub const ERROR_ADDRESS: i32 = 1005;
/// Calls came in an order that makes no sense, from another thread, or from within a call.
pub const ERROR_MISUSE: i32 = 1006;
/// The system or the shared memory layer failed.
pub const ERROR_SYSTEM: i32 = 1007;
/// A pointer is NULL that must not be.
pub const ERROR_NULL: i32 = 1008;
/// An argument is out of its range, a string not UTF-8, a pointer not aligned.
pub const ERROR_ARGUMENT: i32 = 1009;
/// The settings of an embedded engine cannot be read.
pub const ERROR_CONFIG: i32 = 1010;
/// contactd itself failed within this session. Nothing but contactd_close works on it any more.
pub const ERROR_PANIC: i32 = 1011;

/// Why a call failed.
#[derive(Debug)]
pub(crate) struct Failure {
    code: i32,
    index: u32,
    sentence: String,
}

struct Last {
    sentence: CString,
    index: u32,
}

thread_local! {
    static LAST: RefCell<Option<Last>> = const { RefCell::new(None) };
}

impl Failure {
    pub(crate) fn new(code: i32, sentence: impl Into<String>) -> Self {
        Self { code, index: NO_INDEX, sentence: sentence.into() }
    }

    pub(crate) fn argument(sentence: impl Into<String>) -> Self {
        Self::new(ERROR_ARGUMENT, sentence)
    }

    pub(crate) fn misuse(sentence: &str) -> Self {
        Self::new(ERROR_MISUSE, sentence)
    }

    pub(crate) fn null(what: &str) -> Self {
        Self::new(ERROR_NULL, format!("{what} is NULL"))
    }

    pub(crate) fn panic(payload: &(dyn Any + Send)) -> Self {
        let what = payload.downcast_ref::<&str>().copied();
        let what = what.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no more is known");
        Self::new(ERROR_PANIC, format!("contactd failed internally: {what}"))
    }

    /// The same in other words.
    pub(crate) fn saying(self, sentence: String) -> Self {
        Self { sentence, ..self }
    }

    /// The same, of one element of what was given.
    pub(crate) fn at(self, index: usize) -> Self {
        Self { index: index as u32, sentence: format!("index {index}: {}", self.sentence), ..self }
    }

    /// Keeps the sentence for `contactd_error_message`; returns the code.
    #[cold]
    pub(crate) fn reported(self) -> i32 {
        let Self { code, index, mut sentence } = self;
        // A sentence ends at a zero byte, whatever text it quotes.
        sentence.truncate(sentence.find('\0').unwrap_or(sentence.len()));
        let sentence = CString::new(sentence).unwrap_or_default();
        // At the end of a thread there may be no place left for it.
        let _ = LAST.try_with(|last| *last.borrow_mut() = Some(Last { sentence, index }));
        code
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let sentence = error.to_string();
        let (code, index) = match error {
            Error::Refused { code, index, .. } => (code.number() as i32, index.unwrap_or(NO_INDEX)),
            Error::Version { .. } => (ErrorCode::Version.number() as i32, NO_INDEX),
            Error::NoServer(_) => (ERROR_NO_SERVER, NO_INDEX),
            Error::ServerLost => (ERROR_SERVER_LOST, NO_INDEX),
            Error::ReplyLost => (ERROR_REPLY_LOST, NO_INDEX),
            Error::Timeout => (ERROR_TIMEOUT, NO_INDEX),
            Error::Address(_) => (ERROR_ADDRESS, NO_INDEX),
            Error::Build(_) => (ERROR_ARGUMENT, NO_INDEX),
            Error::Misuse(_) => (ERROR_MISUSE, NO_INDEX),
            Error::System(_) => (ERROR_SYSTEM, NO_INDEX),
        };
        Self { code, index, sentence }
    }
}

impl From<ErrorCode> for Failure {
    fn from(code: ErrorCode) -> Self {
        Error::refused(code).into()
    }
}

/// What was wrong with the last call that failed on this thread, in one sentence; "" if none did. Valid until the next call
/// that fails on this thread.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_error_message() -> *const c_char {
    let kept = LAST.try_with(|last| last.borrow().as_ref().map_or(c"".as_ptr(), |last| last.sentence.as_ptr()));
    kept.unwrap_or(c"".as_ptr())
}

/// Index of the record of a batch, or of the rule, that the last call that failed on this thread was refused for;
/// CONTACTD_NO_INDEX: none in particular.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_error_index() -> u32 {
    LAST.try_with(|last| last.borrow().as_ref().map_or(NO_INDEX, |last| last.index)).unwrap_or(NO_INDEX)
}
