//! From the faces of a file to the closed surface of a solid, with the repairs that real files need.
//!
//! In order: points that are equal are one, and where edges stay open then, those within `WELD` of each other; triangles that lose a
//! corner so are gone; every edge must be run along as often in one direction as in the other; a mesh that is inside out as a whole
//! is turned. `Repair` says what was done.

use super::MeshFault;
use super::edges::Edges;
use crate::math::Aabb;
use crate::math::mix::Mixed;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::BuildHasher;

/// Points nearer to each other than this, relative to the diagonal of the mesh's box, are one where edges would stay open: single
/// precision, which most files are in, has seven digits.
pub const WELD: f64 = 1e-6;

/// What had to be changed in a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repair {
    /// All its triangles were reversed.
    pub flipped: bool,
    /// Points that were not equal but taken as one …
    pub welded: usize,
    /// … and how far apart they were at most, a length.
    pub moved: f64,
    /// Triangles that lost a corner by that, or had none of three different ones.
    pub dropped: usize,
    /// How far corners of a face that was cut into triangles lay from its plane at most, a length.
    pub bent: f64,
}

impl Repair {
    /// What was changed in `what`, as sentences, and by how much where that is a length.
    pub fn notes(&self, what: &str) -> Vec<(String, Option<f64>)> {
        let mut notes = Vec::new();
        if self.flipped {
            notes.push((format!("{what} with all faces reversed: flipped"), None));
        }
        if self.bent > 0.0 {
            notes.push((format!("{what} with faces that are not flat: cut into triangles"), Some(self.bent)));
        }
        if self.welded > 0 {
            notes.push((
                format!("{what} with open edges: {} points taken as others near them", self.welded),
                Some(self.moved),
            ));
        }
        if self.dropped > 0 {
            notes.push((format!("{what} with {} triangles without area: left out", self.dropped), None));
        }
        notes
    }
}

/// A closed surface.
pub struct Shell {
    /// Its corners, each used.
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Its edges.
    pub edges: Edges,
    /// It encloses as much one way round as the other.
    pub is_flat: bool,
}

impl Shell {
    /// The surface of triangles given by indices of points, counter-clockwise from outside.
    ///
    /// # Errors
    /// Where it is not closed.
    pub fn of(points: &[DVec3], triangles: &[[u32; 3]]) -> Result<(Self, Repair), MeshFault> {
        let used = Aabb::of_points(triangles.iter().flatten().map(|i| points[*i as usize]));
        let size = 2.0 * used.half().length();
        if !(size > 0.0 && size.is_finite()) {
            return Err(MeshFault::Flat);
        }
        let mut repair = Repair::default();
        let mut shell = Self::welded(points, triangles, &equal(points), &mut repair);
        if let Err(fault) = shell.edges.are_closed(&shell.vertices, &shell.triangles) {
            let mut rough = Repair::default();
            let near = near(&shell.vertices, WELD * size, &mut rough);
            shell = Self::welded(&shell.vertices, &shell.triangles, &near, &mut rough);
            shell.edges.are_closed(&shell.vertices, &shell.triangles).map_err(|_| fault)?;
            repair = Repair { dropped: repair.dropped + rough.dropped, ..rough };
        }
        let volume = shell.volume();
        shell.is_flat = volume.abs() <= 1e-14 * size * size * size;
        if volume < 0.0 && !shell.is_flat {
            shell.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            repair.flipped = true;
        }
        Ok((shell, repair))
    }

    /// With the points that stand for others in place of these.
    fn welded(points: &[DVec3], triangles: &[[u32; 3]], stands_for: &[u32], repair: &mut Repair) -> Self {
        let mut index = vec![u32::MAX; points.len()];
        let (mut vertices, mut kept) = (Vec::new(), Vec::with_capacity(triangles.len()));
        for t in triangles {
            let [a, b, c] = t.map(|v| stands_for[v as usize]);
            if a == b || b == c || c == a {
                repair.dropped += 1;
                continue;
            }
            kept.push([a, b, c].map(|v| {
                let place = &mut index[v as usize];
                if *place == u32::MAX {
                    *place = vertices.len() as u32;
                    vertices.push(points[v as usize]);
                }
                *place
            }));
        }
        vertices.shrink_to_fit();
        kept.shrink_to_fit();
        let edges = Edges::of(&kept, vertices.len());
        Self { vertices, triangles: kept, edges, is_flat: false }
    }

    /// Enclosed volume, negative inside out.
    fn volume(&self) -> f64 {
        let Some(origin) = self.vertices.first().copied() else { return 0.0 };
        let each = self.triangles.iter().map(|t| t.map(|v| self.vertices[v as usize] - origin));
        each.map(|[p, q, r]| p.dot(q.cross(r)) / 6.0).sum()
    }
}

/// Points from which on those of equal hashes are looked through side by side.
const MANY: usize = 100_000;
/// In so many shares.
const SHARES: usize = 64;

/// Of each point the first that is equal to it.
fn equal(points: &[DVec3]) -> Vec<u32> {
    // Adding 0 turns -0 into 0.
    let key = |p: &DVec3| (*p + DVec3::ZERO).to_array().map(f64::to_bits);
    if points.len() < MANY {
        let mut first: Mixed<[u64; 3], u32> = Mixed::with_capacity_and_hasher(points.len(), Default::default());
        return points.iter().enumerate().map(|(i, p)| *first.entry(key(p)).or_insert(i as u32)).collect();
    }
    let share = |p: &DVec3| (Mixed::<(), ()>::default().hasher().hash_one(key(p)) >> 58) as usize % SHARES;
    let shares: Vec<u8> = points.par_iter().map(|p| share(p) as u8).collect();
    let mut ends = [0usize; SHARES + 1];
    shares.iter().for_each(|s| ends[*s as usize + 1] += 1);
    (0..SHARES).for_each(|s| ends[s + 1] += ends[s]);
    let (mut order, mut at) = (vec![0u32; points.len()], ends);
    for (i, s) in shares.iter().enumerate() {
        order[at[*s as usize]] = i as u32;
        at[*s as usize] += 1;
    }
    let firsts = |s: usize| {
        let own = &order[ends[s]..ends[s + 1]];
        let mut first: Mixed<[u64; 3], u32> = Mixed::with_capacity_and_hasher(own.len() / 4, Default::default());
        own.iter().map(|i| *first.entry(key(&points[*i as usize])).or_insert(*i)).collect::<Vec<u32>>()
    };
    let found: Vec<Vec<u32>> = (0..SHARES).into_par_iter().map(firsts).collect();
    let mut out = vec![0u32; points.len()];
    for (i, first) in order.iter().zip(found.iter().flatten()) {
        out[*i as usize] = *first;
    }
    out
}

/// Of each point the first within `reach` of it that stands for itself.
fn near(points: &[DVec3], reach: f64, repair: &mut Repair) -> Vec<u32> {
    let cell = |p: DVec3| (p / (2.0 * reach)).floor().to_array().map(|v| v as i64);
    let mut grid: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut out = Vec::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        let at = cell(*p);
        let mut found: Option<u32> = None;
        for step in 0..27i64 {
            let next = [at[0] + step % 3 - 1, at[1] + step / 3 % 3 - 1, at[2] + step / 9 - 1];
            let others = grid.get(&next).into_iter().flatten().copied();
            let close = others.filter(|o| points[*o as usize].distance(*p) <= reach).min();
            found = [found, close].into_iter().flatten().min();
        }
        match found {
            Some(o) => {
                repair.welded += 1;
                repair.moved = repair.moved.max(points[o as usize].distance(*p));
                out.push(o);
            }
            None => {
                grid.entry(at).or_default().push(i as u32);
                out.push(i as u32);
            }
        }
    }
    out
}
