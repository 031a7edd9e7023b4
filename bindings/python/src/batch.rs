//! Tables of queries on a scene: the native half of `contactd.batch`.

use crate::errors;
use contactd::batch::{Answers, BatchOptions};
use contactd::cache::{Cache, DEFAULT_BYTES};
use contactd::import::{Facets, read_scene};
use contactd_proto::{ErrorCode, PoseRecord};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::{Path, PathBuf};

/// Objects of the scene: name, declared never to move, index of its model, position and rotation at the start.
type Objects = Vec<(String, bool, usize, [f64; 7])>;

/// By query: statuses (u4), counts of records (u4), truncated (u1), safe times (f8), cells (u8); then records and details.
type Columns<'py> = [Bound<'py, PyBytes>; 7];

/// A scene that takes queries which know nothing of each other.
#[pyclass(frozen, module = "contactd")]
pub struct Batch {
    of: contactd::batch::Batch,
    notes: Vec<String>,
}

fn told<'py, T: bytemuck::NoUninit>(py: Python<'py>, values: &[T]) -> Bound<'py, PyBytes> {
    PyBytes::new(py, bytemuck::cast_slice(values))
}

/// The key of a scene's `Batch`, for which its models are read, but not preprocessed.
#[pyfunction]
#[pyo3(name = "_batch_key")]
pub fn batch_key(py: Python<'_>, scene: PathBuf, resolution: Option<f64>) -> PyResult<String> {
    let key = || {
        let scene = read_scene(&scene).map_err(|e| e.to_string())?;
        contactd::batch::key_of(&scene, Facets::Auto, resolution).map_err(|e| e.to_string())
    };
    let key: Result<_, String> = py.detach(key);
    key.map_err(|sentence| errors::refused(py, &sentence, ErrorCode::Model))
}

/// Values as they lie in bytes, aligned or not.
fn read<T: bytemuck::AnyBitPattern>(bytes: &[u8]) -> impl Iterator<Item = T> {
    bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
}

#[pymethods]
impl Batch {
    /// Reads a scene and its models. `cache`: a folder for preprocessed models.
    #[new]
    fn new(py: Python<'_>, scene: PathBuf, cache: Option<PathBuf>, resolution: Option<f64>) -> PyResult<Self> {
        let make = || {
            let opened = cache.as_deref().map(|folder: &Path| Cache::open(folder, DEFAULT_BYTES)).transpose()?;
            let scene = read_scene(&scene).map_err(|e| e.to_string())?;
            let made = contactd::batch::Batch::new(scene, opened.as_ref(), Facets::Auto, resolution);
            made.map_err(|e| e.to_string())
        };
        let made: Result<_, String> = py.detach(make);
        let (of, notes) = made.map_err(|sentence| errors::refused(py, &sentence, ErrorCode::Model))?;
        Ok(Self { of, notes })
    }

    /// A hash of all that answers depend on beside the queries and their options.
    #[getter]
    fn key(&self) -> &str {
        self.of.key()
    }

    /// What the import noted, one sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn _objects(&self) -> Objects {
        let objects = self.of.scene().objects.iter();
        let numbers = |o: &contactd::import::SceneObject| {
            let ([x, y, z], [i, j, k, w]) = (o.motion.start.position.to_array(), o.motion.start.rotation.to_array());
            [x, y, z, i, j, k, w]
        };
        objects.map(|o| (o.name.clone(), o.is_static, o.model, numbers(o))).collect()
    }

    /// What the faces of each model are called, by face id.
    fn _faces(&self) -> Vec<Vec<String>> {
        self.of.faces()
    }

    /// Answers queries. `offsets`: where each begins among `records`, and where the last one ends (u8); `records`: dtype POSE.
    /// `options`: first, clear, most records, cells of a pair, cells of a query, threads. Last: which were refused, and why.
    fn _solve<'py>(
        &self,
        py: Python<'py>,
        offsets: &[u8],
        records: &[u8],
        options: (bool, bool, u32, u64, u64, usize),
    ) -> PyResult<(Columns<'py>, Vec<(usize, String)>)> {
        let bad = |what: &str| PyValueError::new_err(format!("{what} are not what they must be"));
        if !offsets.len().is_multiple_of(size_of::<u64>()) || !records.len().is_multiple_of(size_of::<PoseRecord>()) {
            return Err(bad("bytes of offsets or records"));
        }
        let offsets: Vec<usize> = read::<u64>(offsets).map(|o| o as usize).collect();
        let records: Vec<PoseRecord> = read(records).collect();
        if !offsets.is_sorted() || offsets.last().is_none_or(|end| *end > records.len()) {
            return Err(bad("offsets"));
        }
        let (first, clear, max_records, cell_limit, batch_limit, threads) = options;
        let options = BatchOptions { first, clear, max_records, cell_limit, batch_limit, threads };
        let Answers { rows, records, details } = py.detach(|| self.of.solve(&offsets, &records, &options));
        let status: Vec<u32> = rows.iter().map(|r| r.status).collect();
        let counts: Vec<u32> = rows.iter().map(|r| r.records).collect();
        let truncated: Vec<u8> = rows.iter().map(|r| u8::from(r.truncated)).collect();
        let safe: Vec<f64> = rows.iter().map(|r| r.safe_time).collect();
        let cells: Vec<u64> = rows.iter().map(|r| r.cells).collect();
        let columns = [
            told(py, &status),
            told(py, &counts),
            told(py, &truncated),
            told(py, &safe),
            told(py, &cells),
            told(py, &records),
            told(py, &details),
        ];
        let refused = rows.into_iter().enumerate().filter_map(|(i, row)| Some((i, row.refusal?)));
        Ok((columns, refused.collect()))
    }
}
