//! Contact manifolds: `contactd_client::manifold`. `contactd.manifold` makes arrays of what is told here.

use crate::errors;
use crate::reply::Reply;
use contactd_client::manifold::{Manifolds as Kept, Point, reported_at};
use contactd_client::{Error, Reply as Answer};
use contactd_proto::Pose;
use contactd_proto::control::WirePose;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

/// Position and quaternion x, y, z, w.
type Placed = ([f64; 3], [f64; 4]);
/// Id, group, position, normal, separation, on a, on b.
type PointFields = (u32, u32, [f64; 3], [f64; 3], f64, [f64; 3], [f64; 3]);
/// a, b, status, whether it is complete, points.
type PairFields = (u32, u32, u8, bool, Vec<PointFields>);

/// The points of all pairs, from step to step.
#[pyclass(subclass, module = "contactd._native")]
#[derive(Default)]
pub struct Manifolds {
    kept: Kept,
}

fn pose(py: Python<'_>, (position, rotation): Placed) -> PyResult<Pose> {
    WirePose { position, rotation }.checked().map_err(|code| errors::of(py, &Error::refused(code)))
}

fn fields(p: &Point) -> PointFields {
    let [position, normal, on_a, on_b] = [p.position, p.normal, p.on_a, p.on_b].map(|v| v.to_array());
    (p.id, p.group, position, normal, p.separation, on_a, on_b)
}

#[pymethods]
impl Manifolds {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Takes the answer to a step; `placed(object, time)` says where an object stood.
    fn _update(&mut self, reply: &Bound<'_, Reply>, placed: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = reply.py();
        let reported = |r: &contactd_proto::ContactRecord| (r.a, r.b, reported_at(r));
        let reported: Vec<_> = Reply::read(reply, |answer| answer.records().iter().map(reported).collect())?;
        let mut poses = Vec::with_capacity(reported.len());
        for (a, b, time) in reported {
            let at = |object: u32| pose(py, placed.call1((object, time))?.extract()?);
            poses.push((at(a)?, at(b)?));
        }
        // What was called may have gone on to another step: it is asked again.
        Reply::read(reply, |answer| {
            self.kept.start();
            for (record, (a, b)) in answer.records().iter().zip(&poses) {
                self.kept.add(answer, record, a, b);
            }
            self.kept.finish();
        })
    }

    /// Begins an update that is made record by record.
    fn start(&mut self) {
        self.kept.start();
    }

    /// Takes record number `record` of a reply.
    fn _add(&mut self, reply: &Bound<'_, Reply>, record: usize, a: Placed, b: Placed) -> PyResult<()> {
        let py = reply.py();
        let (a, b) = (pose(py, a)?, pose(py, b)?);
        let add = |answer: &Answer<'_>| match answer.records().get(record) {
            Some(found) => {
                self.kept.add(answer, found, &a, &b);
                Ok(())
            }
            None => Err(PyIndexError::new_err(format!("record {record}: there are {}", answer.records().len()))),
        };
        Reply::read(reply, add)?
    }

    /// Ends an update: pairs that were not added are forgotten.
    fn finish(&mut self) {
        self.kept.finish();
    }

    /// All pairs that have points, in the order (a, b).
    fn _pairs(&self) -> Vec<PairFields> {
        let pairs = self.kept.pairs();
        pairs.map(|m| (m.a, m.b, m.status, m.is_complete, m.points.iter().map(fields).collect())).collect()
    }
}
