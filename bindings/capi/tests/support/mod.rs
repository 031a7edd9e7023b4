//! The C functions as a C program would call them, for tests: codes checked, a small scene, sentences as Rust strings.
#![allow(dead_code)]

use contactd_capi::Session;
use contactd_capi::abi::{Object, Reply};
use contactd_capi::error::{OK, contactd_error_index, contactd_error_message};
use contactd_capi::model::contactd_load_model;
use contactd_capi::scene::{contactd_add_object, contactd_object_new};
use contactd_capi::session::{contactd_close, contactd_embedded};
use contactd_capi::step::{contactd_begin_step, contactd_finish};
use contactd_proto::{ContactRecord, PoseRecord};
use std::ffi::{CStr, CString, c_char};
use std::mem::MaybeUninit;
use std::ptr::null_mut;

pub const PLATE: &CStr =
    c"difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }";
pub const BALL: &CStr = c"sphere(r = 5);";

/// The sentence of the last failure.
pub fn sentence() -> String {
    // SAFETY: a string of the library, valid until the next failure.
    unsafe { CStr::from_ptr(contactd_error_message()) }.to_str().expect("text").to_owned()
}

/// Asserts that a call went well.
pub fn done(code: i32) {
    assert_eq!(code, OK, "{}", sentence());
}

/// Asserts that a call failed in the given way.
pub fn refused(code: i32, expected: i32, words: &str) {
    assert_eq!(code, expected, "{}", sentence());
    assert!(sentence().contains(words), "\"{}\" does not say \"{words}\"", sentence());
}

/// The same, with the index that it names.
pub fn refused_at(code: i32, expected: i32, index: u32, words: &str) {
    refused(code, expected, words);
    assert_eq!(contactd_error_index(), index, "{}", sentence());
}

/// What a function writes to its out parameter.
pub fn out<T>(call: impl FnOnce(*mut T) -> i32) -> T {
    let mut place = MaybeUninit::uninit();
    done(call(place.as_mut_ptr()));
    // SAFETY: a call that went well has written it.
    unsafe { place.assume_init() }
}

pub fn string(pointer: *const c_char) -> String {
    // SAFETY: a string of the library's, of a session that is open.
    unsafe { CStr::from_ptr(pointer) }.to_str().expect("text").to_owned()
}

/// A session of the tests' own, closed at the end.
pub struct Open(pub *mut Session);

impl Open {
    pub fn embedded() -> Self {
        let mut session = null_mut();
        // SAFETY: a variable of this function.
        done(unsafe { contactd_embedded(std::ptr::null(), &mut session) });
        Self(session)
    }

    pub fn model(&self, name: &str, csg: &CStr) -> u32 {
        let name = CString::new(name).expect("a name");
        // SAFETY: an open session, strings and a variable.
        out(|model| unsafe { contactd_load_model(self.0, name.as_ptr(), csg.as_ptr(), 0, model) })
    }

    pub fn object(&self, name: &CStr, model: u32, change: impl FnOnce(&mut Object)) -> u32 {
        let mut object = contactd_object_new(name.as_ptr(), model);
        change(&mut object);
        // SAFETY: an open session, a structure and a variable.
        out(|id| unsafe { contactd_add_object(self.0, &object, id) })
    }

    /// The plate, and the ball 20 above it; their ids.
    pub fn scene(&self) -> (u32, u32) {
        let (plate, ball) = (self.model("plate.csg", PLATE), self.model("ball.csg", BALL));
        let plate = self.object(c"plate", plate, |o| o.is_static = 1);
        (plate, self.object(c"ball", ball, |o| o.pose.position = [1.0, 0.0, 20.0]))
    }

    /// The slots of a step that is begun.
    #[allow(clippy::mut_from_ref)] // The slots are the session's, not the handle's.
    pub fn begin(&self, n: usize) -> &mut [PoseRecord] {
        // SAFETY: an open session and a variable.
        let poses = out(|poses| unsafe { contactd_begin_step(self.0, n, poses) });
        // SAFETY: as many slots as were asked for, until the step is sent.
        unsafe { std::slice::from_raw_parts_mut(poses, n) }
    }

    pub fn finish(&self) -> Reply {
        // SAFETY: an open session and a variable.
        out(|reply| unsafe { contactd_finish(self.0, 60.0, reply) })
    }

    pub fn step(&self, poses: &[PoseRecord]) -> Reply {
        self.begin(poses.len()).copy_from_slice(poses);
        self.finish()
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        // SAFETY: a session that is open, or NULL.
        unsafe { contactd_close(&mut self.0) };
    }
}

/// A reply's records; valid as the reply is.
pub fn records(reply: &Reply) -> &[ContactRecord] {
    // SAFETY: a reply of the library, of a session that has not gone on.
    unsafe { std::slice::from_raw_parts(reply.records, reply.record_count) }
}

/// A reply's slots; valid as the reply is.
pub fn slots(reply: &Reply) -> &[ContactRecord] {
    // SAFETY: a reply of the library, of a session that has not gone on.
    unsafe { std::slice::from_raw_parts(reply.slots, reply.slot_count) }
}

pub fn end(object: u32, position: [f64; 3]) -> PoseRecord {
    PoseRecord { object, flags: contactd_proto::pose_record::END, position, rotation: [0.0, 0.0, 0.0, 1.0] }
}
