//! Steps that are kept in files: recordings, and the last step as a scene.

use crate::abi::Recording;
use crate::error::Failure;
use crate::handle::{Session, State, on};
use crate::raw::{place, text};
use contactd_proto::ErrorCode;
use contactd_proto::control::RecordingStatus;
use std::ffi::c_char;

/// Records the session's steps from now on into a new MCAP file, until contactd_stop_recording or the end of the session;
/// `contactd replay FILE` repeats it bit for bit. A recorder that cannot keep up leaves out whole steps and counts them: no step
/// waits for it. CONTACTD_ERROR_RECORDING: the file exists or cannot be made, the session is being recorded already, or the server
/// has a deadline, with which answers depend on time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_start_recording(session: *mut Session, path: *const c_char) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's string (2).
        let path = unsafe { text(path, "path")? };
        Ok(state.session.record(path)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// What was recorded so far. CONTACTD_ERROR_RECORDING: nothing is being recorded, or the recording has failed;
/// contactd_error_message says why.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_recording(session: *mut Session, recording: *mut Recording) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(recording, "recording")? };
        place.write(counted(state.session.recording()?)?);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Ends the recording: its file is complete when this returns. Codes as of contactd_get_recording.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_stop_recording(session: *mut Session, recording: *mut Recording) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(recording, "recording")? };
        place.write(counted(state.session.stop_recording()?)?);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Writes the last step as a scene in a new folder, for `contactd check FOLDER/scene.toml`. CONTACTD_ERROR_RECORDING: the folder
/// exists or cannot be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_save_step(session: *mut Session, folder: *const c_char) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's string (2).
        let folder = unsafe { text(folder, "folder")? };
        state.session.save_step(folder)?;
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

fn counted(status: RecordingStatus) -> Result<Recording, Failure> {
    let RecordingStatus { steps, dropped, without_picture, bytes, failure, .. } = status;
    match failure.is_empty() {
        true => Ok(Recording { steps, dropped, without_picture, bytes }),
        false => Err(Failure::new(ErrorCode::Recording.number() as i32, failure)),
    }
}
