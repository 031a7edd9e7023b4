//! Models: loading, their faces' names, their mass properties.

use crate::abi::{Face, Mass, Pose};
use crate::error::Failure;
use crate::handle::{Session, State, free, on};
use crate::raw::{given, place, row, text, word};
use contactd_client::{MassOptions, MassProperties};
use contactd_proto::control::{Facets, ModelFile};
use std::ffi::c_char;

/// Curved primitives are exact when `$fn` is 0 or at least 9, as written below that.
pub const FACETS_AUTO: u32 = 0;
/// Always exact.
pub const FACETS_EXACT: u32 = 1;
/// Always the prism or polyhedron that `$fn` asks for.
pub const FACETS_AS_WRITTEN: u32 = 2;

/// By their numbers.
pub(crate) const FACETS: [Facets; 3] = [Facets::Auto, Facets::Exact, Facets::AsWritten];

fn index(i: u32, n: usize, what: &str) -> Result<usize, Failure> {
    if (i as usize) < n {
        return Ok(i as usize);
    }
    Err(Failure::argument(format!("{what} {i}: there are {n}")))
}

/// Loads a model from OpenSCAD CSG text; `name` stands in error sentences; `facets` is CONTACTD_FACETS_…, how curved
/// primitives are taken. `*model` is its id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_load_model(
    session: *mut Session,
    name: *const c_char,
    csg: *const c_char,
    facets: u32,
    model: *mut u32,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's strings (2).
        let (name, csg) = unsafe { (text(name, "name")?, text(csg, "csg")?) };
        // SAFETY: the caller's variable (1).
        let model = unsafe { place(model, "model")? };
        let info = state.session.load_model_with(name, csg, word(&FACETS, facets, "facets")?)?;
        model.write(info.id);
        state.models.add(info);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Loads a model from the `length` bytes of a file, text or not. `format` is what they are, such as "csg"; NULL: as `name` ends. A format that the
/// server does not read is refused by name. Otherwise as contactd_load_model.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_load_model_file(
    session: *mut Session,
    name: *const c_char,
    format: *const c_char,
    bytes: *const u8,
    length: usize,
    facets: u32,
    model: *mut u32,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's strings (2).
        let name = unsafe { text(name, "name")? };
        // SAFETY: as above.
        let format = if format.is_null() { "" } else { unsafe { text(format, "format")? } };
        // SAFETY: the caller's array (1).
        let bytes = unsafe { row(bytes, length, "bytes")? };
        if Vec::<u8>::new().try_reserve_exact(length).is_err() {
            return Err(Failure::argument(format!("bytes: {length} of them do not fit into memory")));
        }
        // SAFETY: the caller's variable (1).
        let model = unsafe { place(model, "model")? };
        let file = ModelFile::new(name, format, bytes);
        let info = state.session.load_model_file(file, word(&FACETS, facets, "facets")?)?;
        model.write(info.id);
        state.models.add(info);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Number of a model's faces, and of the warnings of its import: what it snapped or dropped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_count_faces(
    session: *mut Session,
    model: u32,
    faces: *mut u32,
    warnings: *mut u32,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variables (1).
        let (faces, warnings) = unsafe { (place(faces, "faces")?, place(warnings, "warnings")?) };
        let info = state.models.of(model)?;
        faces.write(info.faces.len() as u32);
        warnings.write(info.warnings.len() as u32);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A face of a model, by its id: what a record's `faces_a` and `faces_b` name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_face(session: *mut Session, model: u32, face: u32, out: *mut Face) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        let faces = &state.models.of(model)?.faces;
        let found = faces[index(face, faces.len(), "face")?].clone();
        let (name, face) = (state.models.string(&found.name), state.models.string(&found.face));
        out.write(Face { primitive: found.primitive, subtracted: found.subtracted.into(), name, face });
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A warning of a model's import, by its number from 0. The string is valid until the session is closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_warning(
    session: *mut Session,
    model: u32,
    warning: u32,
    out: *mut *const c_char,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        let warnings = &state.models.of(model)?.warnings;
        let found = warnings[index(warning, warnings.len(), "warning")?].clone();
        out.write(state.models.string(&found));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Volume, centre of mass and inertia of a model, in the model's own frame and unit, density 1. `tolerance`: error of the
/// volume that is good enough, as a fraction of it (0: 1e-6). `boxes`: most boxes that may be looked at (0: a million); where
/// they do not suffice the answer carries the larger bounds that were reached. A model that reaches to infinity is refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_mass_properties(
    session: *mut Session,
    model: u32,
    tolerance: f64,
    boxes: u64,
    mass: *mut Mass,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let mass = unsafe { place(mass, "mass")? };
        let default = MassOptions::default();
        let options = MassOptions {
            tolerance: if tolerance == 0.0 { default.tolerance } else { tolerance },
            boxes: if boxes == 0 { default.boxes } else { boxes },
        };
        mass.write(state.session.mass_properties(model, &options)?.into());
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// The same solid seen from the parent of `pose`: with an object's place, the model's properties become the object's. `out` may
/// be `mass`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_mass_placed(mass: *const Mass, pose: *const Pose, out: *mut Mass) -> i32 {
    free(|| {
        // SAFETY: the caller's structures (1), copied before anything is written.
        let (mass, pose) = unsafe { (*given(mass, "mass")?, *given(pose, "pose")?) };
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        out.write(MassProperties::from(mass).placed(&pose.checked()?).into());
        Ok(())
    })
}

/// The same solid of another density, mass per volume, which is taken as exact. `out` may be `mass`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_mass_with_density(mass: *const Mass, density: f64, out: *mut Mass) -> i32 {
    free(|| {
        // SAFETY: the caller's structure (1), copied before anything is written.
        let mass = unsafe { *given(mass, "mass")? };
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        if !(density > 0.0 && density.is_finite()) {
            return Err(Failure::argument(format!("expected a positive density, found {density}")));
        }
        out.write(MassProperties::from(mass).with_density(density).into());
        Ok(())
    })
}

impl From<MassProperties> for Mass {
    fn from(m: MassProperties) -> Self {
        let MassProperties { volume, volume_error, center, center_error, density, inertia, inertia_error, boxes } = m;
        let (center, center_error) = (center.to_array(), center_error.to_array());
        Self { volume, volume_error, center, center_error, density, inertia, inertia_error, boxes }
    }
}

impl From<Mass> for MassProperties {
    fn from(m: Mass) -> Self {
        let Mass { volume, volume_error, center, center_error, density, inertia, inertia_error, boxes } = m;
        let (center, center_error) = (center.into(), center_error.into());
        Self { volume, volume_error, center, center_error, density, inertia, inertia_error, boxes }
    }
}
