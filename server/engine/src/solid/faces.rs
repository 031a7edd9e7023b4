//! The faces of a primitive or of a solid, by number.
//!
//! Those of a large mesh are made when somebody looks at them, some neighbours at a time, and stay: a look at a small region costs
//! what is in that region. What is made is the same whoever asks, and when.

use super::Face;
use super::surface::Plane;
use contactd_proto::Pose;
use std::fmt;
use std::sync::{Arc, OnceLock};

/// Faces that are made at a time.
const TOGETHER: usize = 16;

/// Planes by number, kept in a form that takes less than faces do.
pub trait Planes: fmt::Debug + Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// The plane of a number below that, in the primitive's own frame.
    fn plane(&self, index: usize) -> Plane;
    /// The largest distance of one of them from the origin.
    fn reach(&self) -> f64;
}

/// Planes of a placed primitive, made into faces where they are looked at.
pub struct Made {
    planes: Arc<dyn Planes>,
    frame: Pose,
    chunks: Box<[OnceLock<Box<[Face]>>]>,
}

impl Made {
    fn face(&self, index: usize) -> &Face {
        let chunk = self.chunks[index / TOGETHER].get_or_init(|| {
            let from = index / TOGETHER * TOGETHER;
            let all = from..(from + TOGETHER).min(self.planes.count());
            all.map(|i| Face::from(self.planes.plane(i)).placed(&self.frame)).collect()
        });
        &chunk[index % TOGETHER]
    }
}

/// Without what was made of it: that is no part of a model's state.
impl fmt::Debug for Made {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} planes placed at {:?}", self.planes.count(), self.frame)
    }
}

/// Some faces in a row.
#[derive(Clone, Debug)]
enum Row {
    Listed(Vec<Face>),
    Made(Arc<Made>),
}

impl Row {
    fn len(&self) -> usize {
        match self {
            Row::Listed(list) => list.len(),
            Row::Made(made) => made.planes.count(),
        }
    }

    fn get(&self, index: usize) -> Option<&Face> {
        match self {
            Row::Listed(list) => list.get(index),
            Row::Made(made) => (index < self.len()).then(|| made.face(index)),
        }
    }
}

/// Faces by number.
#[derive(Clone, Debug, Default)]
pub struct Faces {
    listed: Vec<Face>,
    /// Those behind the listed ones, each row with the number of its first: from the first large mesh on.
    rows: Vec<(usize, Row)>,
}

impl Faces {
    /// The planes of a large mesh, placed.
    pub fn made(planes: Arc<dyn Planes>, frame: Pose) -> Self {
        let chunks = (0..planes.count().div_ceil(TOGETHER)).map(|_| OnceLock::new()).collect();
        Self { listed: Vec::new(), rows: vec![(0, Row::Made(Arc::new(Made { planes, frame, chunks })))] }
    }

    /// How many there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.rows.last().map_or(self.listed.len(), |(first, row)| first + row.len())
    }

    /// True where there is none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The face of a number.
    #[inline]
    pub fn get(&self, index: usize) -> Option<&Face> {
        match self.listed.get(index) {
            None if !self.rows.is_empty() => self.behind(index),
            face => face,
        }
    }

    #[cold]
    fn behind(&self, index: usize) -> Option<&Face> {
        let row = self.rows.partition_point(|(first, _)| *first <= index).checked_sub(1)?;
        let (first, row) = &self.rows[row];
        row.get(index - first)
    }

    /// Those that are not planes of large meshes and stand in front of all of these: all faces of all other solids.
    #[inline]
    pub fn listed(&self) -> &[Face] {
        &self.listed
    }

    /// All of them. Those of large meshes are made for that.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = &Face> {
        let behind = (self.listed.len()..self.len()).filter_map(|i| self.behind(i));
        self.listed.iter().chain(behind)
    }

    /// Those that are not planes of large meshes, with their numbers.
    pub fn kept(&self) -> impl Iterator<Item = (usize, &Face)> {
        let rows = self.rows.iter().filter_map(|(first, row)| match row {
            Row::Listed(list) => Some((*first, list)),
            Row::Made(_) => None,
        });
        let behind = rows.flat_map(|(first, list)| list.iter().enumerate().map(move |(i, face)| (first + i, face)));
        self.listed.iter().enumerate().chain(behind)
    }

    /// Largest `Face::reach` of them.
    pub fn reach(&self) -> f64 {
        let made = self.rows.iter().map(|(_, row)| match row {
            Row::Listed(_) => 0.0,
            Row::Made(made) => made.planes.reach() + made.frame.position.length(),
        });
        self.kept().map(|(_, face)| face.reach()).chain(made).fold(0.0, f64::max)
    }

    /// Appends the faces of a primitive.
    pub fn extend(&mut self, other: &Faces) {
        if self.rows.is_empty() && other.rows.is_empty() {
            return self.listed.extend_from_slice(&other.listed);
        }
        let mut add = |row: Row| {
            let first = self.len();
            if row.len() > 0 {
                self.rows.push((first, row));
            }
        };
        add(Row::Listed(other.listed.clone()));
        other.rows.iter().for_each(|(_, row)| add(row.clone()));
    }
}

impl From<Vec<Face>> for Faces {
    fn from(listed: Vec<Face>) -> Self {
        Self { listed, rows: Vec::new() }
    }
}

impl std::ops::Index<usize> for Faces {
    type Output = Face;

    #[inline]
    fn index(&self, index: usize) -> &Face {
        match self.listed.get(index) {
            Some(face) => face,
            None => self.behind(index).expect("a face of this number"),
        }
    }
}

impl<'a> IntoIterator for &'a Faces {
    type Item = &'a Face;
    type IntoIter = Box<dyn Iterator<Item = &'a Face> + 'a>;

    fn into_iter(self) -> Self::IntoIter {
        Box::new(self.iter())
    }
}

/// Which primitive owns a face, by the face's number.
#[derive(Clone, Debug, Default)]
pub struct Owners {
    /// Of the listed faces.
    listed: Vec<u32>,
    /// Behind them the first face of each primitive, with the primitive.
    rows: Vec<(usize, u32)>,
    count: usize,
}

impl Owners {
    /// Appends a primitive's faces.
    pub fn extend(&mut self, owner: u32, faces: &Faces) {
        if self.rows.is_empty() && faces.rows.is_empty() {
            self.listed.extend(std::iter::repeat_n(owner, faces.len()));
        } else {
            self.rows.push((self.count, owner));
        }
        self.count += faces.len();
    }

    /// The owner of a face.
    #[inline]
    pub fn get(&self, face: usize) -> Option<&u32> {
        match self.listed.get(face) {
            None if face < self.count => self.behind(face),
            owner => owner,
        }
    }

    #[cold]
    fn behind(&self, face: usize) -> Option<&u32> {
        let row = self.rows.partition_point(|(first, _)| *first <= face).checked_sub(1)?;
        Some(&self.rows[row].1)
    }

    /// Those of all faces in order.
    pub fn iter(&self) -> impl Iterator<Item = &u32> {
        self.listed.iter().chain((self.listed.len()..self.count).filter_map(|f| self.behind(f)))
    }
}

impl std::ops::Index<usize> for Owners {
    type Output = u32;

    #[inline]
    fn index(&self, face: usize) -> &u32 {
        match self.listed.get(face) {
            Some(owner) => owner,
            None => self.get(face).expect("a face of this number"),
        }
    }
}
