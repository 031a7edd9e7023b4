//! From the faces of a mesh to a convex polyhedron, with the repairs that real files need.
//!
//! Faces are clockwise as seen from outside (OpenSCAD's convention). In order: equal points are one; every edge must
//! join two faces that run along it in opposite directions; a mesh that is inside out as a whole is flipped;
//! neighbouring faces within `COPLANAR` of one plane are one face; every corner must lie within `CONVEXITY` of the
//! inner side of every plane. If then nothing deviates by more than rounding the corners stay as they were given, bit
//! for bit; otherwise the polyhedron is the hull of its planes, with its corners computed from them. `Fit` says what
//! was done. Not promised: a mesh whose edges do not match up (a T-junction) is refused even if it looks closed.

use super::Polyhedron;
use crate::math::{
    Aabb,
    tolerance::{CONVEXITY, COPLANAR, ROUNDING},
};
use glam::DVec3;
use std::collections::HashMap;

/// What had to be changed in a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fit {
    /// All its faces were reversed.
    pub flipped: bool,
    /// Faces that were joined with a coplanar neighbour.
    pub merged: usize,
    /// How far a corner lies from where its planes put it, length; 0 when the corners were kept.
    pub moved: f64,
}

/// Why a mesh is not a convex polyhedron. Faces and points are named by their index in the mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No volume at all.
    #[error("a polyhedron without volume")]
    Flat,
    /// An edge at the rim of a hole.
    #[error("an open mesh: the edge between points {0} and {1} belongs to one face only")]
    Open(u32, u32),
    /// Neighbours that disagree about what is outside.
    #[error("mixed orientation: two faces run along the edge from point {0} to point {1} in the same direction")]
    Mixed(u32, u32),
    /// More than two faces at an edge.
    #[error("a mesh that is no surface: the edge between points {0} and {1} belongs to more than two faces")]
    Crowded(u32, u32),
    /// A dent.
    #[error("a non-convex polyhedron: point {point} lies {by:.3e} outside of face {face}")]
    Dented {
        /// The point.
        point: u32,
        /// The face.
        face: usize,
        /// How far.
        by: f64,
    },
}

/// A face with what is derived from it.
struct Facet {
    /// Corners, as indices of points, without repetitions.
    corners: Vec<u32>,
    /// Index in the mesh.
    index: usize,
    /// Area times outward normal.
    area: DVec3,
    /// Too thin for its normal to mean anything.
    sliver: bool,
}

/// What counts as rounding of a mesh's points, in parts of its size.
#[derive(Clone, Copy)]
struct Tolerances {
    coplanar: f64,
    convexity: f64,
    rounding: f64,
}

/// Points as texts have them, of six digits.
const WRITTEN: Tolerances = Tolerances { coplanar: COPLANAR, convexity: CONVEXITY, rounding: ROUNDING };
/// Points that are meant to the last digits: what is as thin as the others' rounding has a volume if it has one by these.
const EXACT: Tolerances = Tolerances { coplanar: 1e-12, convexity: 1e-12, rounding: 1e-12 };

/// Thickness of a foil, in parts of its size, and sine of the angle of two planes that meet in a corner of it, at least.
const THINNEST: f64 = 1e-9;
const BLUNT: f64 = 1e-3;

impl Polyhedron {
    /// The convex polyhedron of a mesh: `faces` hold indices of `points`, clockwise as seen from outside.
    pub fn from_faces(points: &[DVec3], faces: &[Vec<u32>]) -> Result<(Self, Fit), MeshError> {
        let found = Self::within(points, faces, &WRITTEN);
        // A foil is none the less where its points are told exactly, as z = 0 and z = 1e-6 are.
        if found == Err(MeshError::Flat) {
            Self::within(points, faces, &EXACT).ok().filter(|(p, _)| p.is_blunt()).map_or(found, Ok)
        } else {
            found
        }
    }

    /// True where planes that meet in a corner lean enough for what rounds them not to move the corner: a sliver with two sides that
    /// run along each other is none of this kind.
    fn is_blunt(&self) -> bool {
        let size = 2.0 * Aabb::of_points(self.vertices.iter().copied()).half().length();
        let meet = |v: &DVec3| {
            let on = |(n, d): &&(DVec3, f64)| (n.dot(*v) - d).abs() <= EXACT.coplanar * size;
            self.planes.iter().filter(on).map(|plane| plane.0).collect::<Vec<DVec3>>()
        };
        let leans = |n: &DVec3, m: &DVec3| n.cross(*m).length() >= BLUNT;
        let thickness = |(n, d): &(DVec3, f64)| self.vertices.iter().map(|v| d - n.dot(*v)).fold(0.0, f64::max);
        self.planes.iter().all(|plane| thickness(plane) >= THINNEST * size)
            && self.vertices.iter().all(|v| {
                let normals = meet(v);
                (1..normals.len()).all(|i| normals[..i].iter().all(|m| leans(&normals[i], m)))
            })
    }

    fn within(
        points: &[DVec3],
        faces: &[Vec<u32>],
        &Tolerances { coplanar, convexity, rounding }: &Tolerances,
    ) -> Result<(Self, Fit), MeshError> {
        // Size: the diagonal of the bounding box.
        let size = 2.0 * Aabb::of_points(faces.iter().flatten().map(|i| points[*i as usize])).half().length();
        if !(size > 0.0 && size.is_finite()) {
            return Err(MeshError::Flat);
        }
        let mut facets = facets(points, faces, coplanar * size);
        let neighbours = neighbours(&facets)?;
        let mut fit = Fit { flipped: orient(&mut facets, points, rounding * size * size * size)?, ..Fit::default() };

        let groups = coplanar_groups(&facets, &neighbours, points, coplanar * size);
        fit.merged = facets.iter().filter(|f| !f.sliver).count().saturating_sub(groups.len());
        let mut planes = Vec::with_capacity(groups.len());
        let mut touching: HashMap<u32, usize> = HashMap::new();
        for group in &groups {
            let n = group.iter().map(|f| facets[*f].area).sum::<DVec3>().normalize();
            let mut corners: Vec<u32> = group.iter().flat_map(|f| facets[*f].corners.iter().copied()).collect();
            corners.sort_unstable();
            corners.dedup();
            let heights = || corners.iter().map(|c| n.dot(points[*c as usize]));
            let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
            // Halfway, so that equal heights stay exact; the half range is the deviation.
            planes.push((n, if low == high { low } else { 0.5 * (low + high) }));
            fit.moved = fit.moved.max(0.5 * (high - low));
            corners.iter().for_each(|c| *touching.entry(*c).or_default() += 1);
        }

        let mut used: Vec<u32> = touching.keys().copied().collect();
        used.sort_unstable();
        // Also those at slivers alone: a thin spike is a dent like any other.
        let mut all: Vec<u32> = facets.iter().flat_map(|f| f.corners.iter().copied()).collect();
        all.sort_unstable();
        all.dedup();
        for ((n, d), group) in planes.iter().zip(&groups) {
            for &c in &all {
                let by = n.dot(points[c as usize]) - d;
                if by > convexity * size {
                    return Err(MeshError::Dented { point: c, face: facets[group[0]].index, by });
                }
                fit.moved = fit.moved.max(by);
            }
        }
        if fit.moved <= rounding * size {
            fit.moved = 0.0;
            let vertices: Vec<DVec3> =
                used.into_iter().filter(|c| touching[c] >= 3).map(|c| points[c as usize]).collect();
            if planes.len() < 4 || vertices.len() < 4 {
                return Err(MeshError::Flat);
            }
            return Ok((Self { vertices: vertices.into(), planes }, fit));
        }
        let around = Aabb::of_points(used.iter().map(|c| points[*c as usize]));
        let hull = Self::from_planes(&planes, &around).ok_or(MeshError::Flat)?;
        Ok((hull, fit))
    }
}

/// Faces with three different corners or more; points with equal coordinates become the first of them. Slivers are no wider than a length.
fn facets(points: &[DVec3], faces: &[Vec<u32>], least: f64) -> Vec<Facet> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::new();
    let mut canonical = |i: u32| {
        // Adding 0 turns -0 into 0.
        let key = (points[i as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
        *first.entry(key).or_insert(i)
    };
    let mut facets = Vec::with_capacity(faces.len());
    for (index, face) in faces.iter().enumerate() {
        let mut corners: Vec<u32> = face.iter().map(|i| canonical(*i)).collect();
        corners.dedup();
        while corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() < 3 {
            continue;
        }
        let p = |i: usize| points[corners[i % corners.len()] as usize];
        let twice: DVec3 = (0..corners.len()).map(|i| (p(i + 1) - p(0)).cross(p(i) - p(0))).sum();
        let longest = (0..corners.len()).map(|i| (p(i + 1) - p(i)).length()).fold(0.0, f64::max);
        let sliver = twice.length() <= least * longest;
        facets.push(Facet { corners, index, area: twice * 0.5, sliver });
    }
    facets
}

/// For each face the faces across its edges.
fn neighbours(facets: &[Facet]) -> Result<Vec<Vec<usize>>, MeshError> {
    let edges = |f: &Facet| {
        let n = f.corners.len();
        (0..n).map(|i| (f.corners[i], f.corners[(i + 1) % n])).collect::<Vec<_>>()
    };
    let mut owners: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
    for (k, f) in facets.iter().enumerate() {
        for e in edges(f) {
            owners.entry(e).or_default().push(k);
        }
    }
    let mut across = Vec::with_capacity(facets.len());
    for f in facets {
        let mut others = Vec::with_capacity(f.corners.len());
        for (a, b) in edges(f) {
            let forth = owners[&(a, b)].len();
            match owners.get(&(b, a)).map(Vec::as_slice) {
                Some([other]) if forth == 1 => others.push(*other),
                None if forth == 1 => return Err(MeshError::Open(a, b)),
                None if forth == 2 => return Err(MeshError::Mixed(a, b)),
                _ => return Err(MeshError::Crowded(a, b)),
            }
        }
        across.push(others);
    }
    Ok(across)
}

/// Turns the normals outwards; true when they pointed inwards. The sign is that of the enclosed volume, of which there is more than `least`.
fn orient(facets: &mut [Facet], points: &[DVec3], least: f64) -> Result<bool, MeshError> {
    let Some(origin) = facets.first().map(|f| points[f.corners[0] as usize]) else { return Err(MeshError::Flat) };
    let volume: f64 = facets
        .iter()
        .map(|f| {
            let middle: DVec3 = f.corners.iter().map(|c| points[*c as usize] - origin).sum();
            f.area.dot(middle) / (3.0 * f.corners.len() as f64)
        })
        .sum();
    if volume.abs() <= least {
        return Err(MeshError::Flat);
    }
    if volume < 0.0 {
        facets.iter_mut().for_each(|f| f.area = -f.area);
    }
    Ok(volume < 0.0)
}

/// Groups of faces on one plane, each led by its first face in file order. The largest faces gather first, and a face
/// is measured against the plane of the one that gathers, so a finely faceted curve does not creep together. Corners lie on a plane
/// where they are within `off` of it.
fn coplanar_groups(facets: &[Facet], neighbours: &[Vec<usize>], points: &[DVec3], off: f64) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..facets.len()).filter(|k| !facets[*k].sliver).collect();
    order.sort_by(|a, b| facets[*b].area.length_squared().total_cmp(&facets[*a].area.length_squared()).then(a.cmp(b)));
    let mut taken = vec![false; facets.len()];
    let mut groups = Vec::new();
    for seed in order {
        if taken[seed] {
            continue;
        }
        taken[seed] = true;
        let n = facets[seed].area.normalize();
        let d = n.dot(points[facets[seed].corners[0] as usize]);
        let fits = |f: &Facet| {
            (f.sliver || f.area.dot(n) > 0.0) && f.corners.iter().all(|c| (n.dot(points[*c as usize]) - d).abs() <= off)
        };
        let mut group = vec![seed];
        let mut next = 0;
        while next < group.len() {
            for &other in &neighbours[group[next]] {
                if !taken[other] && fits(&facets[other]) {
                    taken[other] = true;
                    group.push(other);
                }
            }
            next += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups.sort_unstable();
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Faces of a cube, clockwise from outside, over `Aabb::corners`.
    fn cube_faces() -> Vec<Vec<u32>> {
        vec![vec![2, 6, 4, 0], vec![5, 7, 3, 1], vec![4, 5, 1, 0], vec![3, 7, 6, 2], vec![1, 3, 2, 0], vec![6, 7, 5, 4]]
    }

    fn cube_points() -> Vec<DVec3> {
        Aabb::around(DVec3::ZERO, DVec3::ONE).corners().to_vec()
    }

    fn split(faces: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
        faces.iter().flat_map(|f| [vec![f[0], f[1], f[2]], vec![f[0], f[2], f[3]]]).collect()
    }

    #[test]
    fn a_cube_keeps_its_corners() {
        let (p, fit) = Polyhedron::from_faces(&cube_points(), &cube_faces()).expect("a cube");
        assert_eq!(fit, Fit::default());
        assert_eq!((p.vertices.len(), p.planes.len()), (8, 6));
        assert_eq!(p.planes[0], (-DVec3::X, 1.0));
        assert_eq!(p.planes[5], (DVec3::Z, 1.0));
    }

    #[test]
    fn reversed_faces_are_flipped_and_triangles_joined() {
        let mut faces = split(cube_faces());
        faces.iter_mut().for_each(|f| f.reverse());
        let (p, fit) = Polyhedron::from_faces(&cube_points(), &faces).expect("a cube");
        assert_eq!(fit, Fit { flipped: true, merged: 6, moved: 0.0 });
        assert_eq!(p.planes.len(), 6);
        assert!(p.planes.iter().all(|(n, d)| *d == 1.0 && n.length() == 1.0));
    }

    #[test]
    fn a_rough_cube_becomes_the_hull_of_its_planes() {
        let mut points = cube_points();
        points[7] += DVec3::new(3e-7, -2e-7, 1e-5);
        points[0] += DVec3::new(-3e-7, -2e-7, -1e-7);
        for faces in [cube_faces(), split(cube_faces())] {
            let (p, fit) = Polyhedron::from_faces(&points, &faces).expect("nearly a cube");
            assert!(fit.moved > 1e-7 && fit.moved < 1e-4, "{fit:?}");
            for v in p.vertices.iter() {
                let on = p.planes.iter().filter(|(n, d)| (n.dot(*v) - d).abs() < 1e-12).count();
                assert!(on >= 3 && p.planes.iter().all(|(n, d)| n.dot(*v) <= d + 1e-12));
            }
        }
    }

    #[test]
    fn a_foil_has_a_volume_where_its_points_say_so() {
        for thickness in [1e-3, 1e-5, 1e-6, 1e-8] {
            let points: Vec<DVec3> = cube_points().iter().map(|p| *p * DVec3::new(1.0, 1.0, thickness)).collect();
            for faces in [cube_faces(), split(cube_faces())] {
                let (p, fit) = Polyhedron::from_faces(&points, &faces).expect("a foil");
                assert_eq!((p.vertices.len(), p.planes.len(), fit.moved), (8, 6, 0.0), "{thickness}");
            }
        }
        // A wedge whose sides run along each other is none.
        let wedge = |p: &DVec3| DVec3::new(p.x, p.y, 1e-6 * p.z * (2.0 + p.x));
        let points: Vec<DVec3> = cube_points().iter().map(wedge).collect();
        assert!(Polyhedron::from_faces(&points, &cube_faces()).is_ok(), "a foil that is thicker at one end");
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1e-7, 0.0)];
        let points: Vec<DVec3> = points.iter().map(|p| *p + DVec3::Z).chain(points).collect();
        let faces = vec![vec![0, 2, 1], vec![3, 4, 5], vec![0, 1, 4, 3], vec![1, 2, 5, 4], vec![2, 0, 3, 5]];
        assert_eq!(Polyhedron::from_faces(&points, &faces), Err(MeshError::Flat));
        // In six digits a foil is one no more.
        let tilt = |p: &DVec3| {
            let tilted = DVec3::new(p.x, 0.6 * p.y, 0.8 * p.y + 1e-9 * p.z);
            tilted + DVec3::new(0.0, 3e-7 * p.x * p.y, 3e-7 * p.x * p.y)
        };
        let points: Vec<DVec3> = cube_points().iter().map(tilt).collect();
        assert_eq!(Polyhedron::from_faces(&points, &cube_faces()), Err(MeshError::Flat));
    }

    #[test]
    fn meshes_that_are_no_convex_polyhedron_are_named() {
        let check = |points: &[DVec3], faces: &[Vec<u32>], sentence: &str| {
            let error = Polyhedron::from_faces(points, faces).expect_err(sentence).to_string();
            assert!(error.starts_with(sentence), "{error}");
        };
        let mut mixed = cube_faces();
        mixed[3].reverse();
        check(&cube_points(), &mixed, "mixed orientation: two faces run along the edge");
        check(&cube_points(), &cube_faces()[1..], "an open mesh: the edge between points");
        check(&cube_points(), &[], "a polyhedron without volume");
        let mut dented = cube_points();
        dented[7] = DVec3::splat(0.2);
        check(&dented, &split(cube_faces()), "a non-convex polyhedron: point");
        let mut crowded = cube_faces();
        crowded.push(crowded[0].clone());
        check(&cube_points(), &crowded, "a mesh that is no surface: the edge between points");
        let flat = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        check(&flat, &[vec![0, 1, 2], vec![2, 1, 0]], "a polyhedron without volume");
    }

    #[test]
    fn corners_inside_faces_and_edges_are_dropped() {
        // The top is a fan around its middle, and one of its edges carries a middle point.
        let mut points = cube_points();
        points.push(DVec3::Z);
        points.push(DVec3::new(0.0, -1.0, 1.0));
        let mut faces = cube_faces();
        faces[2] = vec![4, 9, 5, 1, 0];
        faces.pop();
        faces.extend([[8, 9, 4], [8, 5, 9], [8, 7, 5], [8, 6, 7], [8, 4, 6]].map(Vec::from));
        let (p, fit) = Polyhedron::from_faces(&points, &faces).expect("a cube");
        assert_eq!((p.vertices.len(), p.planes.len(), fit.merged), (8, 6, 4));
    }
}
