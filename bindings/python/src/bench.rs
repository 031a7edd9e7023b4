//! Steps made by Rust alone, in the same session and from the same arrays: what `benches/overhead.py` holds Python's against.
//!
//! They keep the interpreter's lock while they wait, as no other call does: to give it away and take it back is part of what a step
//! costs in Python.

use crate::errors;
use crate::session::Session;
use crate::slots::Held;
use contactd_proto::PoseRecord;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::time::{Duration, Instant};

/// Nanoseconds of a step that copies a whole batch of pose records.
#[pyfunction]
#[pyo3(name = "_whole_in_rust")]
pub fn whole_in_rust(session: &Bound<'_, Session>, batch: &Bound<'_, PyAny>) -> PyResult<u64> {
    let batch = Held::of(batch)?;
    let batch: &[PoseRecord] = all(&batch)?;
    timed(session, batch.len(), |slots| slots.copy_from_slice(batch))
}

/// The same, of a batch that is filled in field by field.
#[pyfunction]
#[pyo3(name = "_fields_in_rust")]
pub fn fields_in_rust(
    session: &Bound<'_, Session>,
    objects: &Bound<'_, PyAny>,
    flags: u32,
    positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
) -> PyResult<u64> {
    let held = [Held::of(objects)?, Held::of(positions)?, Held::of(rotations)?];
    let (objects, positions): (&[u32], &[[f64; 3]]) = (all(&held[0])?, all(&held[1])?);
    let rotations: &[[f64; 4]] = all(&held[2])?;
    timed(session, objects.len(), |slots| {
        for (((slot, object), position), rotation) in slots.iter_mut().zip(objects).zip(positions).zip(rotations) {
            *slot = PoseRecord { object: *object, flags, position: *position, rotation: *rotation };
        }
    })
}

/// A buffer's bytes as so many `T`.
fn all<T: bytemuck::AnyBitPattern>(held: &Held) -> PyResult<&[T]> {
    if held.len() == 0 {
        return Ok(&[]);
    }
    // SAFETY: so many bytes lie there until the buffer is released. Nobody writes to them meanwhile: the interpreter's lock is held, and
    // a step's own slots are not among them, for no step begins while an array into the last one lives.
    let bytes = unsafe { std::slice::from_raw_parts(held.start(), held.len()) };
    bytemuck::try_cast_slice(bytes).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// Nanoseconds of a step whose slots `fill` fills in.
fn timed(session: &Bound<'_, Session>, n: usize, fill: impl FnOnce(&mut [PoseRecord])) -> PyResult<u64> {
    let py = session.py();
    let time = Session::fresh(session)?.with(py, |session| {
        let start = Instant::now();
        fill(session.begin_step(n)?);
        session.finish(Duration::from_secs(60))?;
        Ok(start.elapsed().as_nanos() as u64)
    })?;
    time.map_err(|e| errors::of(py, &e))
}
