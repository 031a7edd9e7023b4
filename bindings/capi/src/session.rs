//! Opening, closing and finding again; versions.

use crate::abi::Opened;
use crate::error::{ERROR_CONFIG, Failure};
use crate::handle::{Session, State, free, hand_over, on, take_back};
use crate::raw::{place, seconds, text};
use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::proto::names::{Address, DEFAULT_NAME, PROTOCOL_VERSION};
use contactd_client::{Error, SharedMemory};
use std::ffi::{CStr, c_char};
use std::path::Path;
use std::ptr::null_mut;

const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
    Ok(version) => version,
    Err(_) => c"",
};

/// Version of the library, as CONTACTD_VERSION was when it was built.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_version() -> *const c_char {
    VERSION.as_ptr()
}

/// Version of the protocol that the library speaks; a server of another one is refused.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_protocol_version() -> u32 {
    PROTOCOL_VERSION
}

/// A session on the server called `name` of this user; NULL: "default". `*session` is NULL unless the code is CONTACTD_OK.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_connect(name: *const c_char, session: *mut *mut Session) -> i32 {
    free(|| {
        // SAFETY: the caller's variable (1).
        let session = unsafe { place(session, "session")? };
        session.write(null_mut());
        // SAFETY: the caller's string (2).
        let name = if name.is_null() { DEFAULT_NAME } else { unsafe { text(name, "name")? } };
        session.write(hand_over(Box::new(SharedMemory::new(Address::of(name).map_err(Error::from)?)))?);
        Ok(())
    })
}

/// A session on an engine of its own in this process: the same calls and the same bits, no server. `config` is a server's
/// configuration file (TOML), or NULL for its defaults. `*session` is NULL unless the code is CONTACTD_OK.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_embedded(config: *const c_char, session: *mut *mut Session) -> i32 {
    free(|| {
        // SAFETY: the caller's variable (1).
        let session = unsafe { place(session, "session")? };
        session.write(null_mut());
        let config = if config.is_null() {
            ServerConfig::default()
        } else {
            // SAFETY: the caller's string (2).
            let path = unsafe { text(config, "config")? };
            ServerConfig::read(Path::new(path)).map_err(|e| Failure::new(ERROR_CONFIG, e))?
        };
        session.write(hand_over(Box::new(Embedded::new(&config)))?);
        Ok(())
    })
}

/// Ends the session, frees all that belongs to it and sets `*session` to NULL; a step in flight is waited for, a second
/// at most. What the code says changes nothing about that, except CONTACTD_ERROR_MISUSE from another thread or from within a
/// call: then nothing happened. A `*session` that is NULL already is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_close(session: *mut *mut Session) -> i32 {
    free(|| {
        // SAFETY: the caller's variable (1).
        let variable = unsafe { place(session, "session")? };
        // SAFETY: it was set by the function that opened the session, or to NULL.
        let handle = unsafe { variable.assume_init() };
        if handle.is_null() {
            return Ok(());
        }
        // SAFETY: not NULL, so a handle that was not closed (3).
        let State { session, panicked, .. } = unsafe { take_back(handle)? };
        variable.write(null_mut());
        if panicked {
            return Ok(());
        }
        Ok(session.close()?)
    })
}

/// The session's id, its server's epoch (0 embedded) and the most records of a batch.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_opened(session: *mut Session, opened: *mut Opened) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(opened, "opened")? };
        place.write(state.session.opened().into());
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// How long a command (everything but steps) may take, in seconds; 600 unless set. Imports of large models are commands. After
/// CONTACTD_ERROR_TIMEOUT what was asked may be done yet: contactd_reconnect goes back to before it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_set_command_timeout(session: *mut Session, timeout: f64) -> i32 {
    let call = |state: &mut State| {
        state.session.command_timeout = seconds(timeout, "a timeout")?;
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// After CONTACTD_ERROR_SERVER_LOST, CONTACTD_ERROR_REPLY_LOST or a session that is gone: waits up to `timeout` seconds until a
/// server of the same name runs, opens a session there and replays models, objects, rules and last poses. Ids stay the same. A
/// step that has no answer is kept for contactd_resend. On an embedded session there is nothing to find again:
/// CONTACTD_ERROR_MISUSE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_reconnect(session: *mut Session, timeout: f64) -> i32 {
    let call = |state: &mut State| {
        let timeout = seconds(timeout, "a timeout")?;
        let done = state.session.reconnect(timeout);
        if !matches!(done, Err(Error::Misuse(_))) {
            state.records = None;
        }
        Ok(done?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}
