//! The triangles of a mesh on a grid of whole numbers, and which of them have something in common that they should not.

use super::boxes::Boxes;
use super::exact::Plane;
use crate::math::Aabb;
use crate::math::mix::Mixed;
use glam::DVec3;
use robust::{Coord3D, orient3d};
use std::cmp::Ordering;

/// Binary digits of a coordinate on the finest grid: whole numbers that doubles hold.
pub const DIGITS: i32 = 53;

/// A triangle.
pub struct Facet {
    /// Its corners, counter-clockwise from outside.
    pub corners: [u32; 3],
    /// The axis that its normal points along most, and whether it points up there.
    pub axis: usize,
    /// True where it does.
    pub up: bool,
}

/// Triangles with corners on a grid.
pub struct Facets {
    /// Different points of the grid.
    pub points: Vec<[i64; 3]>,
    /// Where each is, in units of length: on the finest grid the first point of the mesh that was taken to it.
    pub sources: Vec<DVec3>,
    /// Those that have an area.
    pub all: Vec<Facet>,
    /// The box of each.
    pub boxes: Vec<Aabb>,
    /// The tree of these.
    pub tree: Boxes,
    /// Steps of the grid in a unit of length are 2 to this power.
    pub power: i32,
}

impl Facets {
    /// The triangles of a mesh with corners rounded to a grid on which the largest coordinate has so many binary digits. `None` of a
    /// mesh without size.
    pub fn of(vertices: &[DVec3], triangles: &[[u32; 3]], digits: i32) -> Option<Self> {
        let reach = vertices.iter().fold(0.0, |most: f64, v| most.max(v.abs().max_element()));
        if !(reach > 0.0 && reach.is_finite()) {
            return None;
        }
        let power = digits.min(DIGITS) - libm::frexp(reach).1;
        let mut places: Mixed<[u64; 3], u32> = Mixed::default();
        let (mut points, mut sources) = (Vec::new(), Vec::new());
        let ids: Vec<u32> = vertices
            .iter()
            .map(|v| {
                let at = v.to_array().map(|x| libm::round(libm::ldexp(x, power)) as i64);
                *places.entry(at.map(|x| x as u64)).or_insert_with(|| {
                    points.push(at);
                    let length = |x: i64| libm::ldexp(x as f64, -power);
                    // On the finest grid they stay the bits that they are.
                    sources.push(if digits == DIGITS { *v } else { DVec3::from(at.map(length)) });
                    points.len() as u32 - 1
                })
            })
            .collect();
        let corners = triangles.iter().map(|t| t.map(|v| ids[v as usize]));
        let all: Vec<Facet> = corners.filter_map(|corners| facet(&points, corners)).collect();
        let at = |v: u32| DVec3::from(points[v as usize].map(|x| x as f64));
        let boxes: Vec<Aabb> = all.iter().map(|f| Aabb::of_points(f.corners.map(at))).collect();
        let tree = Boxes::of(&boxes);
        Some(Self { points, sources, all, boxes, tree, power })
    }

    /// Corners of a triangle.
    pub fn corners(&self, facet: u32) -> [[i64; 3]; 3] {
        self.all[facet as usize].corners.map(|v| self.points[v as usize])
    }

    /// Its plane, then one through each of its sides along its axis; normals point outwards.
    pub fn planes(&self, facet: u32) -> [Plane; 4] {
        let (away, at) = (self.away(facet), self.corners(facet));
        let side = |m: usize| Plane::through(cross(less(at[(m + 1) % 3], at[m]), away), at[m]);
        [Plane::through(normal(at), at[0]), side(0), side(1), side(2)]
    }

    /// On which side of a triangle's plane the corners of another one are.
    fn sides(&self, facet: u32, other: u32) -> [Ordering; 3] {
        let at = self.corners(facet);
        self.corners(other).map(|p| side(at, p))
    }

    /// True for triangles in one plane.
    pub fn are_coplanar(&self, facet: u32, other: u32) -> bool {
        self.sides(facet, other) == [Ordering::Equal; 3]
    }

    /// How two triangles meet.
    pub fn meeting(&self, one: u32, other: u32) -> Meeting {
        let sides = [self.sides(one, other), self.sides(other, one)];
        let clear = |s: &[Ordering; 3]| *s == [Ordering::Greater; 3] || *s == [Ordering::Less; 3];
        if sides.iter().any(clear) {
            return Meeting::None;
        }
        let (a, b) = (self.all[one as usize].corners, self.all[other as usize].corners);
        if sides[0] == [Ordering::Equal; 3] {
            let apart = self.is_beside(one, other) || self.is_beside(other, one);
            return if apart { Meeting::None } else { Meeting::Coplanar };
        }
        let shared = a.iter().filter(|v| b.contains(v)).count();
        // Those of the planes of two that share a side meet in it alone.
        if shared >= 2 {
            return Meeting::None;
        }
        let pierced = |edges: [u32; 3], (of, through): (u32, [u32; 3])| {
            let sides = (0..3).map(|m| [edges[m], edges[(m + 1) % 3]]);
            let through_at = through.map(|v| self.points[v as usize]);
            sides
                .filter(|side| !side.iter().any(|v| through.contains(v)))
                .any(|side| self.touches(side.map(|v| self.points[v as usize]), (of, through_at)))
        };
        if pierced(a, (other, b)) || pierced(b, (one, a)) { Meeting::Across } else { Meeting::None }
    }

    /// True where a segment has a point of a triangle.
    fn touches(&self, [p, q]: [[i64; 3]; 2], (facet, t): (u32, [[i64; 3]; 3])) -> bool {
        let ends = [side(t, p), side(t, q)];
        if ends[0] != ends[1] {
            let around = [side([p, q, t[0]], t[1]), side([p, q, t[1]], t[2]), side([p, q, t[2]], t[0])];
            return !(around.contains(&Ordering::Greater) && around.contains(&Ordering::Less));
        }
        if ends[0] != Ordering::Equal {
            return false;
        }
        // In its plane: no side of either parts them.
        let away = self.away(facet);
        let beyond = |m: usize| {
            let outward = cross(less(t[(m + 1) % 3], t[m]), away);
            [p, q].iter().all(|x| dot(outward, less(*x, t[m])) > 0)
        };
        let aside = cross(less(q, p), away);
        let of = t.map(|x| dot(aside, less(x, p)).signum());
        !(0..3).any(beyond) && of != [1; 3] && of != [-1; 3]
    }

    /// The way out of a triangle along its axis.
    fn away(&self, facet: u32) -> [i128; 3] {
        let f = &self.all[facet as usize];
        let mut away = [0; 3];
        away[f.axis] = if f.up { 1 } else { -1 };
        away
    }

    /// True where a triangle lies beyond a side of another one in its plane, or on it.
    fn is_beside(&self, facet: u32, other: u32) -> bool {
        let (at, others, away) = (self.corners(facet), self.corners(other), self.away(facet));
        (0..3).any(|m| {
            let outward = cross(less(at[(m + 1) % 3], at[m]), away);
            others.iter().all(|p| dot(outward, less(*p, at[m])) >= 0)
        })
    }
}

/// How two triangles meet, what joins them left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// Not at all, or along sides within a plane.
    None,
    /// In a point or along a segment.
    Across,
    /// In an area of one plane, or nearly so: what is beside neither's sides.
    Coplanar,
}

fn facet(points: &[[i64; 3]], corners: [u32; 3]) -> Option<Facet> {
    let n = normal(corners.map(|v| points[v as usize]));
    let axis = (0..3).fold(0, |most, k| if n[k].abs() > n[most].abs() { k } else { most });
    (n[axis] != 0).then(|| Facet { corners, axis, up: n[axis] > 0 })
}

/// Twice the area times the normal.
pub fn normal([a, b, c]: [[i64; 3]; 3]) -> [i128; 3] {
    cross(less(b, a), less(c, a))
}

fn less(a: [i64; 3], b: [i64; 3]) -> [i128; 3] {
    std::array::from_fn(|k| i128::from(a[k] - b[k]))
}

fn cross(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    let of = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
    [of(1, 2), of(2, 0), of(0, 1)]
}

fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// On which side of the plane of a triangle a point is, `Greater` where its normal points to. Coordinates on the grid are
/// doubles, of which it is exact (J. Shewchuk 1997).
fn side([a, b, c]: [[i64; 3]; 3], p: [i64; 3]) -> Ordering {
    let of = |p: [i64; 3]| Coord3D { x: p[0] as f64, y: p[1] as f64, z: p[2] as f64 };
    let value = -orient3d(of(a), of(b), of(c), of(p));
    value.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}
