//! What a session is asked about its objects: arguments from Python's buffers, answers as records for numpy.

use bytemuck::Pod;
use contactd_proto::PoseRecord;
use contactd_proto::query::ObjectRay;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Records as bytes.
pub fn records<'py, A, R: Pod + for<'a> From<&'a A>>(py: Python<'py>, answers: &[A]) -> Bound<'py, PyBytes> {
    let records: Vec<R> = answers.iter().map(R::from).collect();
    PyBytes::new(py, bytemuck::cast_slice(&records))
}

/// Poses as bytes.
pub fn bytes(records: &[PoseRecord]) -> &[u8] {
    bytemuck::cast_slice(records)
}

/// Points from doubles, three each.
pub fn points(bytes: &[u8]) -> Vec<[f64; 3]> {
    bytes.chunks_exact(24).map(bytemuck::pod_read_unaligned).collect()
}

/// Rays from doubles, seven each: origin, direction, length.
pub fn rays(bytes: &[u8]) -> Vec<ObjectRay> {
    bytes.chunks_exact(size_of::<ObjectRay>()).map(bytemuck::pod_read_unaligned).collect()
}
