//! Scenes and robots from files, driven by their joints.

use crate::abi::{Joint, JointValue, LoadedObject, Reply, SceneInfo, SceneOptions};
use crate::error::Failure;
use crate::handle::{Session, State, free, on};
use crate::raw::{flag, given, place, row, seconds, text};
use contactd::load::{LoadError, LoadOptions, LoadScene as _, LoadedScene};
use contactd_proto::{ErrorCode, PoseRecord};
use std::collections::BTreeMap;
use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::path::PathBuf;
use std::ptr::{null, null_mut};

/// A scene that was loaded into a session. It belongs to no thread, but is in one call at a time.
pub struct Loaded {
    of: LoadedScene,
    unit: CString,
    objects: Vec<CString>,
    joints: Vec<CString>,
    notes: Vec<CString>,
}

/// A name without zero bytes; one that had some would end there.
fn string(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

impl Loaded {
    fn new(of: LoadedScene) -> Self {
        let unit = string(&of.unit);
        let objects = of.objects.iter().map(|o| string(&o.name)).collect();
        let joints = of.joints().iter().map(|j| string(&j.name)).collect();
        let notes = of.notes.iter().map(|n| string(n)).collect();
        Self { of, unit, objects, joints, notes }
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        let sentence = error.to_string();
        match error {
            LoadError::Session(error) => error.into(),
            LoadError::Refused { error, .. } => Self::from(error).saying(sentence),
            LoadError::Scene(_) | LoadError::Kind { .. } => Self::new(ErrorCode::Model.number() as i32, sentence),
        }
    }
}

/// A handle.
///
/// # Safety
/// Point 7 of the contract: NULL, or a scene that was not freed, in no other call.
unsafe fn live<'a>(scene: *mut Loaded) -> Result<&'a mut Loaded, Failure> {
    // SAFETY: NULL or a live handle, of this call alone.
    unsafe { scene.as_mut() }.ok_or_else(|| Failure::null("the scene (freed, or never loaded)"))
}

/// Joint values by name.
///
/// # Safety
/// Points 1 and 2 of the contract: NULL, or `n` structures with strings.
unsafe fn values(pointer: *const JointValue, n: usize, what: &str) -> Result<BTreeMap<String, f64>, Failure> {
    // SAFETY: the caller's structures.
    let all = unsafe { row(pointer, n, what)? };
    let one = |(i, joint): (usize, &JointValue)| {
        // SAFETY: the caller's string.
        let name = unsafe { text(joint.name, "joint.name") }.map_err(|e| e.at(i))?;
        match joint.value.is_nan() {
            true => Err(Failure::argument(format!("expected a value of the joint {name}, found NaN")).at(i)),
            false => Ok((name.to_owned(), joint.value)),
        }
    };
    all.iter().enumerate().map(one).collect()
}

/// What is asked of a load.
///
/// # Safety
/// Points 1 and 2 of the contract.
unsafe fn options(options: &SceneOptions) -> Result<LoadOptions, Failure> {
    let optional = |pointer: *const c_char, what| match pointer.is_null() {
        true => Ok(None),
        // SAFETY: the caller's string.
        false => unsafe { text(pointer, what) }.map(|text| Some(text.to_owned())),
    };
    // SAFETY: the caller's strings.
    let packages = unsafe { row(options.packages, options.package_count, "options.packages")? };
    // SAFETY: as above.
    let package = |name: &*const c_char| unsafe { text(*name, "options.packages") }.map(PathBuf::from);
    Ok(LoadOptions {
        // SAFETY: the caller's structures.
        joints: unsafe { values(options.joints, options.joint_count, "options.joints")? },
        key: optional(options.key, "options.key")?,
        hulls: flag(options.hulls, "options.hulls")?,
        packages: packages.iter().map(package).collect::<Result<_, _>>()?,
        srdf: optional(options.srdf, "options.srdf")?.map(PathBuf::from),
        import_root: optional(options.import_root, "options.import_root")?.map(PathBuf::from),
        keeps_rules: flag(options.keeps_rules, "options.keeps_rules")?,
    })
}

/// Options with defaults: a robot stands where its file says, and the scene's rules replace the session's.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_scene_options_new() -> SceneOptions {
    SceneOptions {
        joints: null(),
        joint_count: 0,
        key: null(),
        packages: null(),
        package_count: 0,
        srdf: null(),
        import_root: null(),
        hulls: 0,
        keeps_rules: 0,
    }
}

/// Loads a scene file (.toml) or a robot or world (URDF, SDFormat, MJCF) into the session, beside what it has; `options` may be NULL.
/// The caller's process reads the files and sends what they name along. Objects, motions and rules are those of `contactd check`, to the
/// bit. What is wrong is one sentence with file, line and column, and the session keeps what it had, but for models. The scene is to be
/// freed by contactd_scene_free, before or after its session is closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_load_scene(
    session: *mut Session,
    path: *const c_char,
    options: *const SceneOptions,
    scene: *mut *mut Loaded,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's string (2) and variable (1).
        let (path, scene) = unsafe { (text(path, "path")?, place(scene, "scene")?) };
        let asked = match options.is_null() {
            true => LoadOptions::default(),
            // SAFETY: the caller's structure and strings (1, 2).
            false => unsafe { self::options(given(options, "options")?)? },
        };
        let loaded = state.session.load_scene(path, &asked)?;
        loaded.models.iter().for_each(|info| state.models.add(info.clone()));
        scene.write(Box::into_raw(Box::new(Loaded::new(loaded))));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Frees a scene and sets `*scene` to NULL; its objects stay in the session. One that is NULL already is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_free(scene: *mut *mut Loaded) -> i32 {
    free(|| {
        // SAFETY: the caller's variable (1).
        let variable = unsafe { place(scene, "scene")? };
        // SAFETY: it was set by contactd_load_scene, or to NULL.
        let handle = unsafe { std::mem::replace(variable, MaybeUninit::new(null_mut())).assume_init() };
        if !handle.is_null() {
            // SAFETY: it came out of a box in contactd_load_scene and was not freed since (7).
            drop(unsafe { Box::from_raw(handle) });
        }
        Ok(())
    })
}

/// What a scene has in it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_get_info(scene: *mut Loaded, out: *mut SceneInfo) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (7) and variable (1).
        let (scene, out) = unsafe { (live(scene)?, place(out, "out")?) };
        out.write(SceneInfo {
            unit: scene.unit.as_ptr(),
            dt: scene.of.dt.unwrap_or(0.0),
            object_count: scene.objects.len(),
            joint_count: scene.joints.len(),
            note_count: scene.notes.len(),
        });
        Ok(())
    })
}

/// An element of a list by its number from 0.
fn nth<T>(mut all: impl ExactSizeIterator<Item = T>, index: usize, what: &str) -> Result<T, Failure> {
    let n = all.len();
    all.nth(index).ok_or_else(|| Failure::argument(format!("{what} {index}: there are {n}")))
}

/// An object of a scene by its number from 0, in the order of the file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_get_object(scene: *mut Loaded, index: usize, out: *mut LoadedObject) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (7) and variable (1).
        let (scene, out) = unsafe { (live(scene)?, place(out, "out")?) };
        let (object, name) = nth(scene.of.objects.iter().zip(&scene.objects), index, "object")?;
        out.write(LoadedObject { name: name.as_ptr(), object: object.id, model: object.model });
        Ok(())
    })
}

/// The id of the object of a name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_find(scene: *mut Loaded, name: *const c_char, id: *mut u32) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (7), string (2) and variable (1).
        let (scene, name, id) = unsafe { (live(scene)?, text(name, "name")?, place(id, "id")?) };
        let found = scene.of.id(name);
        id.write(found.ok_or_else(|| Failure::argument(format!("expected an object of the scene, found {name:?}")))?);
        Ok(())
    })
}

/// A joint of a robot that has a value of its own, by its number from 0, in the order of the file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_get_joint(scene: *mut Loaded, index: usize, out: *mut Joint) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (7) and variable (1).
        let (scene, out) = unsafe { (live(scene)?, place(out, "out")?) };
        let (joint, name) = nth(scene.of.joints().into_iter().zip(&scene.joints), index, "joint")?;
        let ([low, high], turns) = (joint.range, joint.turns.into());
        out.write(Joint { name: name.as_ptr(), turns, reserved: 0, low, high, value: joint.value });
        Ok(())
    })
}

/// A note by its number from 0: a sentence about what has no effect, was left out or was taken in another way.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_get_note(scene: *mut Loaded, index: usize, note: *mut *const c_char) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (7) and variable (1).
        let (scene, note) = unsafe { (live(scene)?, place(note, "note")?) };
        note.write(nth(scene.notes.iter(), index, "note")?.as_ptr());
        Ok(())
    })
}

/// Gives the session the scene's rules instead of its own: those that `keeps_rules` left aside.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_set_rules(session: *mut Session, scene: *mut Loaded) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's handle (7).
        let scene = unsafe { live(scene)? };
        Ok(state.session.set_rules(&scene.of.rules)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Puts a robot where its joints have these `count` values (radians, metres), the others as they stand; nothing is searched. What is
/// attached to a link goes along. Refused where a joint is not there, or a value beyond its limits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_set_joints(
    session: *mut Session,
    scene: *mut Loaded,
    joints: *const JointValue,
    count: usize,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's handle (7) and structures (1, 2).
        let (scene, joints) = unsafe { (live(scene)?, values(joints, count, "joints")?) };
        Ok(scene.of.set_joints(&mut state.session, &joints)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A step in which a robot's joints go from where they stand to these `count` values at constant rates, its links on their true arcs; of
/// a scene file its own step, by no values. Its records are sent alone and answered as by contactd_finish. Refused where two hinges would
/// turn a link at once, which is no arc: move one after the other. A robot whose step is refused stands where it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_step(
    session: *mut Session,
    scene: *mut Loaded,
    joints: *const JointValue,
    count: usize,
    timeout: f64,
    reply: *mut Reply,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's handle (7) and structures (1, 2).
        let (scene, joints) = unsafe { (live(scene)?, values(joints, count, "joints")?) };
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(reply, "reply")? };
        let timeout = seconds(timeout, "a timeout")?;
        state.records = None;
        let reply = scene.of.step(&mut state.session, &joints, timeout)?;
        state.records = Some(reply.records().len());
        place.write(Reply::of(&reply));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// The records of that step, to be put into a batch with those of other objects: `*written` of them into `records`, which has room for
/// `room`; no more than the scene has objects. After it the joints stand at its end. Where there is not room enough nothing is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_records(
    session: *mut Session,
    scene: *mut Loaded,
    joints: *const JointValue,
    count: usize,
    records: *mut PoseRecord,
    room: usize,
    written: *mut usize,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's handle (7) and structures (1, 2).
        let (scene, joints) = unsafe { (live(scene)?, values(joints, count, "joints")?) };
        // SAFETY: the caller's variable, and room for as many records (1).
        let (written, checked) = unsafe { (place(written, "written")?, row(records.cast_const(), room, "records")?) };
        if checked.len() < scene.objects.len() {
            return Err(Failure::argument(format!("expected room for {} records, found {room}", scene.objects.len())));
        }
        let all = scene.of.records(&mut state.session, &joints)?;
        for (i, record) in all.iter().enumerate() {
            // SAFETY: within the room, which was checked.
            unsafe { records.add(i).write(*record) };
        }
        written.write(all.len());
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// The step of the last contactd_scene_records was refused: nothing has moved, and a robot's joints are where they were.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_refused(scene: *mut Loaded) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (7).
        unsafe { live(scene)? }.of.refused();
        Ok(())
    })
}

/// Puts a robot where its joints were at a time, 0 to 1, of the last step: where it met something, say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_scene_stop_at(session: *mut Session, scene: *mut Loaded, time: f64) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's handle (7).
        let scene = unsafe { live(scene)? };
        Ok(scene.of.stop_at(&mut state.session, time)?)
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}
