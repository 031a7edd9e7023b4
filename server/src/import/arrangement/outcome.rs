//! Which parts of a mesh are between what it winds around and what it does not, as faces.

use super::ears::triangles;
use super::exact::{Point, are_in_line};
use super::facets::Facets;
use super::joints;
use super::pieces::{Piece, Pieces};
use super::snap::snapped;
use super::winding::Winding;
use crate::math::mix::Mixed;
use glam::DVec3;
use smallvec::SmallVec;

/// Corners of a face beyond which parts are not joined to it, since it is cut into triangles again one ear at a time.
const MANY: usize = 64;

/// Numbers of corners, counter-clockwise as seen from outside.
type Loop = Vec<u32>;

/// A part that is kept.
struct Part {
    /// Its triangle.
    facet: u32,
    /// The other way round than that.
    turned: bool,
    around: Loop,
}

/// What runs along each side: which part, and whether from its lower corner to the higher.
type Sides = Mixed<[u32; 2], SmallVec<[(u32, bool); 2]>>;

/// The boundary of what a mesh winds around.
pub struct Kept {
    /// Its faces.
    pub faces: Vec<Loop>,
    /// How many parts it has, the other way round than in the mesh …
    pub turned: usize,
    /// … and as there.
    pub others: usize,
    /// How many of the mesh have the same on both sides of them.
    pub left_out: usize,
}

/// The boundary of what a mesh winds around. `None` where there is none, and where a winding number could not be told.
pub fn kept(facets: &Facets, pieces: &Pieces) -> Option<Kept> {
    let same = joints::unified(&pieces.points);
    let loops = joints::joined(&pieces.points, &pieces.all, &same);
    let leaders = leaders(pieces, &loops);
    let mut known: Vec<Option<Winding>> = vec![None; pieces.all.len()];
    let (mut parts, mut left_out) = (Vec::<Part>::new(), 0);
    for ((i, piece), mut around) in pieces.all.iter().enumerate().zip(loops) {
        let leader = leaders[i] as usize;
        if known[leader].is_none() {
            known[leader] = Some(Winding::of(facets, piece.facet, spread(piece, &pieces.points))?);
        }
        let winding = known[leader]?;
        if (winding.front != 0) == (winding.behind != 0) || covered_by_another(pieces, piece, &winding) {
            left_out += 1;
            continue;
        }
        let turned = winding.front != 0;
        if turned {
            around.reverse();
        }
        parts.push(Part { facet: piece.facet, turned, around });
    }
    let turned = parts.iter().filter(|p| p.turned).count();
    let others = parts.len() - turned;
    let mut faces = joined(facets, &pieces.points, parts);
    straighten(facets.points.len(), &pieces.points, &mut faces);
    (!faces.is_empty()).then_some(Kept { faces, turned, others, left_out })
}

/// True for a part of which another triangle in its plane has the same one.
fn covered_by_another(pieces: &Pieces, piece: &Piece, winding: &Winding) -> bool {
    pieces.covered[piece.facet as usize] && winding.owner != piece.facet
}

/// Three corners of a part, far from each other along its rim.
fn spread<'p>(piece: &Piece, points: &'p [Point]) -> [&'p Point; 3] {
    let count = piece.corners.len();
    [0, count / 3, 2 * count / 3].map(|k| &points[piece.corners[k] as usize])
}

fn sides_of(around: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    around.iter().copied().zip(around.iter().copied().cycle().skip(1))
}

fn sides<'l>(loops: impl Iterator<Item = &'l Loop>) -> Sides {
    let mut out = Sides::default();
    for (i, around) in loops.enumerate() {
        for (a, b) in sides_of(around) {
            out.entry([a.min(b), a.max(b)]).or_default().push((i as u32, a < b));
        }
    }
    out
}

/// Of each part the first one of those that it hangs together with across sides at which nothing else is: winding numbers are the
/// same in front of all of them, and behind. Those of a triangle that another one covers hang together with its own alone.
fn leaders(pieces: &Pieces, loops: &[Loop]) -> Vec<u32> {
    let mut leader: Vec<u32> = (0..loops.len() as u32).collect();
    fn find(leader: &mut [u32], mut i: u32) -> u32 {
        while leader[i as usize] != i {
            leader[i as usize] = leader[leader[i as usize] as usize];
            i = leader[i as usize];
        }
        i
    }
    for at in sides(loops.iter()).values() {
        let [(p, up), (q, other)] = at.as_slice() else { continue };
        let [f, g] = [p, q].map(|i| pieces.all[*i as usize].facet);
        let alike = f == g || !pieces.covered[f as usize] && !pieces.covered[g as usize];
        if up != other && alike {
            let (p, q) = (find(&mut leader, *p), find(&mut leader, *q));
            leader[p.max(q) as usize] = p.min(q);
        }
    }
    (0..loops.len() as u32).map(|i| find(&mut leader, i)).collect()
}

/// The parts of each triangle that lie beside each other as one face, where nothing else is at the sides between them and the face
/// has one rim; any others as they are.
fn joined(facets: &Facets, points: &[Point], parts: Vec<Part>) -> Vec<Loop> {
    let sides = sides(parts.iter().map(|p| &p.around));
    let is_within = |facet: u32, (a, b): (u32, u32)| match sides[&[a.min(b), a.max(b)]].as_slice() {
        [(p, up), (q, other)] => up != other && [p, q].iter().all(|i| parts[**i as usize].facet == facet),
        _ => false,
    };
    let mut out = Vec::with_capacity(parts.len());
    for of_facet in parts.chunk_by(|a, b| a.facet == b.facet) {
        let Part { facet, turned, .. } = of_facet[0];
        let as_they_are = || of_facet.iter().map(|p| p.around.clone());
        if of_facet.len() == 1 || of_facet.iter().any(|p| p.turned != turned) {
            out.extend(as_they_are());
            continue;
        }
        let rim = of_facet.iter().flat_map(|p| sides_of(&p.around)).filter(|side| !is_within(facet, *side));
        match rims(rim, |around| is_rim(facets, points, (facet, turned), around)) {
            Some(rims) => out.extend(rims),
            None => out.extend(as_they_are()),
        }
    }
    out
}

/// Sides in rings, in the order of their first ones; `None` where two begin at one corner, and of rings that are none of a face.
fn rims(sides: impl Iterator<Item = (u32, u32)>, is_rim: impl Fn(&[u32]) -> bool) -> Option<Vec<Loop>> {
    let all: Vec<(u32, u32)> = sides.collect();
    let mut next: Mixed<u32, u32> = Mixed::default();
    for (a, b) in &all {
        if next.insert(*a, *b).is_some() {
            return None;
        }
    }
    let mut out = Vec::new();
    for (first, _) in &all {
        let (mut around, mut at) = (Vec::new(), *first);
        while let Some(then) = next.remove(&at) {
            around.push(at);
            at = then;
        }
        if around.is_empty() {
            continue;
        }
        if around.len() > MANY || !is_rim(&around) {
            return None;
        }
        out.push(around);
    }
    Some(out)
}

/// True for a ring that is surely no hole, of the parts of a triangle that are all kept one way round.
fn is_rim(facets: &Facets, points: &[Point], (facet, turned): (u32, bool), around: &[u32]) -> bool {
    let first = points[around[0] as usize].near;
    let at = |c: u32| points[c as usize].near - first;
    let area: DVec3 = sides_of(around).map(|(a, b)| at(a).cross(at(b))).sum();
    let [a, b, c] = facets.all[facet as usize].corners.map(|v| points[v as usize].near);
    let whole = (b - a).cross(c - a) * if turned { -1.0 } else { 1.0 };
    area.dot(whole) > 1e-9 * whole.length_squared()
}

/// Leaves out corners that were made by cutting and cut nothing any more: two sides of a line meet there, and nothing else.
fn straighten(first: usize, points: &[Point], faces: &mut Vec<Loop>) {
    let mut beside: Mixed<u32, SmallVec<[u32; 2]>> = Mixed::default();
    for (a, b) in faces.iter().flat_map(|f| sides_of(f)) {
        for (c, other) in [(a, b), (b, a)] {
            if c as usize >= first {
                let there = beside.entry(c).or_default();
                if !there.contains(&other) {
                    there.push(other);
                }
            }
        }
    }
    let is_straight = |c: u32| match beside.get(&c).map(SmallVec::as_slice) {
        Some([a, b]) => are_in_line([*a, c, *b].map(|i| &points[i as usize])),
        _ => false,
    };
    let straight: Mixed<u32, bool> = beside.keys().map(|c| (*c, is_straight(*c))).collect();
    faces.iter_mut().for_each(|f| f.retain(|c| straight.get(c) != Some(&true)));
    faces.retain(|f| f.len() >= 3);
}

/// Faces, cut into triangles where that is clear, with their corners as the nearest doubles, in units of length, what is within `reach` steps of the grid made one; without
/// those that are none any more.
pub fn rounded(facets: &Facets, pieces: &Pieces, faces: &[Loop], reach: f64) -> (Vec<DVec3>, Vec<Loop>) {
    let near: Vec<DVec3> = pieces.points.iter().map(|p| p.near).collect();
    let mut faces: Vec<Loop> = snapped(&near, faces, reach).iter().flat_map(|f| triangles(&near, f)).collect();
    let mut number: Mixed<u32, u32> = Mixed::default();
    let mut points = Vec::new();
    for c in faces.iter_mut().flatten() {
        *c = *number.entry(*c).or_insert_with(|| {
            let length = |x: f64| libm::ldexp(x, -facets.power);
            let made = || DVec3::from(near[*c as usize].to_array().map(length));
            points.push(facets.sources.get(*c as usize).copied().unwrap_or_else(made));
            points.len() as u32 - 1
        });
    }
    (points, faces)
}
