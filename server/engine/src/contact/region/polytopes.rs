//! The region of two convex polytopes, boxes and hulls of meshes among them: by their corners, without boxes that are halved.
//!
//! Two convex bodies touch in one place. Along its normal n the surface of A is the lower envelope of its planes, that of B
//! the upper one, and the gap between them is convex. What faces the other body is told by its outline: the hull of the
//! corners of all faces that lie along it, or, of an edge or a blunt corner, of the corners within the threshold. Both
//! outlines have in common
//!
//! * an area where faces lie along each other: a patch, cut where the gap reaches the threshold;
//! * a segment: a line, likewise;
//! * a point, or an area of corners without faces: points, eight of them at most.
//!
//! Where they are nearest within it is a point of its own, since a hull that bows touches there before it does on its rim:
//! what the foremost corners of both have in common. Boxes would have all faces that run together in a place in pairs.

use super::local::Bodies;
use super::polytope::{Plane, Polytope, Polytopes};
use super::{Region, RegionPoint, SAME_POINT, faces_at, three};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::program::{Lowest, Program};
use crate::contact::instant::separation::common;
use crate::contact::query::outcome::{ContactKind, Extent, NO_FACE};
use crate::contact::region::surface::LEAN;
use crate::math::Aabb;
use crate::math::gjk::{Cores, of_supports};
use glam::{DVec2, DVec3};
use smallvec::{SmallVec, smallvec};

/// Sizes of the smaller body: where bodies are farther apart, the way between the nearest points is the normal; where they
/// are nearer it has few digits, and the planes that balance tell it.
const APART: f64 = 1e-9;
/// Relative gap to which the nearest points are looked for. On polytopes the search ends by itself; a gap would leave its
/// square root in the direction.
const GOOD: f64 = 0.0;
/// Times that it is looked for, each from the last direction.
const STARTS: usize = 4;
/// A face within this angle of the way between the nearest points may have the normal that was looked for.
const SAME: f64 = 1e-4;
/// Faces of each body that are asked where the bodies touch: one that bows has many of nearly the same normal.
const MANY_FACES: usize = 64;
/// Sizes apart from which on the nearest face of each body is enough.
const THIN: f64 = 1e-6;
/// Normals that balance less than this, of unit length each, balance nothing.
const BALANCED: f64 = 1e-7;
/// Planes that rise by less than this against the normal are walls: they bound what is over a body, not heights, which would be
/// their rounding.
const STEEP: f64 = 1e-2;
/// Cuts along one wall, each at the height of what is farthest beyond it.
const WALL_CUTS: usize = 8;
/// Names of cuts: by walls downwards from here, by the threshold from the last.
const WALL: u32 = u32::MAX - 2 * MOST_CUTS as u32;
/// Points told of an area of corners.
const MOST_POINTS: usize = 8;
/// Cuts of a region at its threshold.
const MOST_CUTS: usize = 64;
/// Corners within so many roundings of the foremost one are as far ahead: more where the normal has few digits.
const FOREMOST: [f64; 3] = [4.0, 64.0, 1024.0];
/// Points within this many sizes are one, as of other patches.
const MERGED: f64 = 1e-9;

/// A corner of an outline: where it is across the normal, and a name that is the same from step to step.
#[derive(Clone, Copy, Debug)]
struct Corner {
    u: DVec2,
    key: [u32; 2],
}

/// Heights of a body's surface along the normal: those planes of it that may be the outermost somewhere.
struct Surface {
    /// Height at the origin, slope, face.
    planes: Vec<(f64, DVec2, u32)>,
    /// 1 for the lower envelope of A, −1 for the upper one of B.
    sign: f64,
}

/// A pair along its normal: both surfaces as heights over the plane across it.
struct Projection {
    normal: DVec3,
    across: [DVec3; 2],
    surfaces: [Surface; 2],
}

/// The gap at a point: how wide, and the planes that make it, by place.
struct Gap {
    width: f64,
    planes: [usize; 2],
}

/// All regions of two polytopes; `None` for other bodies, and where no direction between them is found.
pub fn regions(bodies: &Bodies) -> Option<Vec<Region>> {
    let pair = Polytopes::of(bodies.task, bodies.at)?;
    let (normal, near) = normal(bodies, &pair)?;
    let found = along(bodies, &pair, normal, &near)?;
    match mean_normal(bodies, &pair, normal, &found) {
        Some(mean) => along(bodies, &pair, mean, &near),
        None => Some(found),
    }
}

/// Where edges or corners meet many directions are normals: the mean of the adjacent faces' normals, if it is one of them.
fn mean_normal(bodies: &Bodies, pair: &Polytopes, n: DVec3, found: &[Region]) -> Option<DVec3> {
    let [region] = found else { return None };
    let with_face = matches!(region.kind, ContactKind::FaceFace | ContactKind::EdgeFace | ContactKind::VertexFace);
    if with_face || region.separation().abs() > APART * bodies.size {
        return None;
    }
    let middle = region.points.iter().map(|p| p.point).sum::<DVec3>() / region.points.len() as f64;
    let mean = (bodies.average(Side::A, middle) - bodies.average(Side::B, middle)).try_normalize()?;
    (pair.apart(mean) >= pair.apart(n) - bodies.eps).then_some(mean)
}

/// The regions along a normal, of bodies that are nearest to each other at one of some points.
fn along(bodies: &Bodies, pair: &Polytopes, normal: DVec3, near: &[DVec3]) -> Option<Vec<Region>> {
    let across = [bodies.material(Side::A, normal), normal.cross(bodies.material(Side::A, normal))];
    let flat = |x: DVec3| DVec2::new(across[0].dot(x), across[1].dot(x));
    bodies.work.look(pair.a.planes.len() + pair.b.planes.len());
    let ([of_a, of_b], are_faces) = outlines(bodies, pair, normal, flat);
    let common = of_a.common(&of_b, bodies);
    let foremost = FOREMOST.iter().filter_map(|slack| foremost(bodies, pair, normal, *slack, flat));
    let near = foremost.chain(near.iter().map(|x| flat(*x)));
    let near: SmallVec<[Corner; 5]> = near.map(|u| Corner { u, key: [0; 2] }).collect();
    let missed = common.is_empty();
    let ends = if missed { near.to_vec() } else { common };
    let mut region = ends.clone();
    // Corners told one by one are as far apart as other points are; those of an edge of a mesh are often two that nearly coincide.
    let is_area = hull(&mut region, if are_faces { MERGED } else { SAME_POINT } * bodies.size).len() > 2;
    let is_patch = is_area && are_faces;
    let projection = Projection::new(pair, normal, across, ends.iter().chain(&near).chain(&of_a.1).chain(&of_b.1));
    if is_patch || !is_area {
        projection.cut(&mut region, bodies);
    }
    projection.wall_in(&mut region, pair, bodies);
    // Corners of a hull are on their faces as far as this.
    let slack = APART * bodies.size;
    let stands = |c: &Corner| {
        let [on_a, on_b] = projection.feet(c.u);
        pair.a.value(on_a) <= slack && pair.b.value(on_b) <= slack
    };
    // The nearest points of thin differences may be anywhere.
    let width = |c: &&Corner| projection.gap(c.u).width;
    let standing = near.iter().filter(|c| stands(c));
    let near = standing.min_by(|p, q| width(p).total_cmp(&width(q)));
    if missed {
        region = vec![*near?];
    }
    if !are_faces {
        if is_area {
            region.retain(stands);
        }
        let corners = of_a.1.len() + of_b.1.len();
        bodies.work.look(corners * (pair.a.planes.len() + pair.b.planes.len()) / 8);
        region.extend(of_a.1.iter().chain(&of_b.1).filter(|c| stands(c)).chain(near));
    }
    region.retain(|c| projection.gap(c.u).width <= bodies.tau * (1.0 + MERGED));
    hull(&mut region, if is_patch { MERGED } else { SAME_POINT } * bodies.size);
    let mut found = Vec::new();
    match region.len() {
        0 => {}
        1 => found.push(projection.point(bodies, near.unwrap_or(&region[0]).u)),
        2 => found.push(projection.line(bodies, [region[0].u, region[1].u])),
        _ if is_patch => found.push(projection.patch(bodies, &mut region)),
        _ => found.extend(some(&region).into_iter().map(|c| projection.point(bodies, c.u))),
    }
    let told = found.iter().map(Region::separation).fold(bodies.tau * (1.0 + MERGED), f64::min);
    let is_lower = |c: &Corner| projection.gap(c.u).width < told - if found.is_empty() { 0.0 } else { bodies.eps };
    if let Some(c) = near.filter(|c| is_lower(c)) {
        found.push(projection.point(bodies, c.u));
    }
    Some(found)
}

/// The unit normal from A to B, and points between them where they may be nearest.
fn normal(bodies: &Bodies, pair: &Polytopes) -> Option<(DVec3, SmallVec<[DVec3; 2]>)> {
    let box_of_both = common(bodies.task, bodies.at, bodies.tau);
    // Of two polytopes that nearly lie along each other it has as few digits as their difference is thin. A face, two edges,
    // an edge and a corner that keep them farther apart have it to all digits.
    let apart = |n: DVec3| pair.apart(n);
    let sharpened = |n: DVec3, most: usize| {
        let near = |normals: &mut dyn Iterator<Item = DVec3>| -> Vec<DVec3> {
            let all = normals.map(|m| ((m - n).length(), m)).filter(|(off, _)| *off <= SAME);
            let mut all: Vec<_> = all.collect();
            all.sort_by(|p, q| p.0.total_cmp(&q.0));
            all.into_iter().take(most).map(|(_, m)| m).collect()
        };
        let of_a = near(&mut pair.a.planes.iter().map(|p| p.normal));
        let of_b = near(&mut pair.b.planes.iter().map(|p| -p.normal));
        let ways = between_edges(&pair.a.outermost(n), &pair.b.outermost(-n), n);
        bodies
            .work
            .look((1 + of_a.len() + of_b.len() + ways.len()) * (pair.a.corners.len() + pair.b.corners.len()) / 16);
        let mut best = (apart(n) - 0.25 * bodies.eps, n);
        for m in of_a.into_iter().chain(of_b).chain(ways) {
            let gap = apart(m);
            if gap > best.0 {
                best = (gap, m);
            }
        }
        best.1
    };
    if !pair.a.is_unbounded() && !pair.b.is_unbounded() {
        let mut way = pair.b.corners[0] - pair.a.corners[0];
        let mut best: Option<(f64, DVec3, DVec3)> = None;
        for _ in 0..STARTS {
            bodies.work.look(pair.a.corners.len() + pair.b.corners.len());
            let cores = of_supports(|n| pair.a.support(n), |n| pair.b.support(n), way, GOOD);
            let Cores::Apart { v, a, .. } = cores else { break };
            if v.length() <= APART * bodies.size {
                break;
            }
            // The thinner the difference, the fewer digits.
            let most = if v.length() > THIN * bodies.size { 1 } else { MANY_FACES };
            let n = sharpened(v.normalize(), most);
            let gap = apart(n);
            // Of bodies that overlap a little it may end beside where it should, in a direction that is none.
            if gap < 0.0 {
                break;
            }
            if best.is_none_or(|b| gap > b.0) {
                best = Some((gap, n, a + v * 0.5));
            }
            // Thin differences end it before it is there.
            if gap >= v.length() - bodies.eps {
                break;
            }
            way = n;
        }
        if let Some((gap, n, near)) = best {
            let mut all = smallvec![near];
            if gap < THIN * bodies.size && box_of_both.is_finite() {
                all.push(lowest(bodies, &box_of_both)?.x);
            }
            return Some((n, all));
        }
    }
    for (wall, other, sign) in [(&pair.b, &pair.a, -1.0), (&pair.a, &pair.b, 1.0)] {
        if let ([plane], true) = (&wall.planes[..], wall.is_unbounded()) {
            return Some((plane.normal * sign, smallvec![other.support(-plane.normal)]));
        }
    }
    if !box_of_both.is_finite() {
        return None;
    }
    let found = lowest(bodies, &box_of_both)?;
    let sum = |side: Side, planes: &[Plane]| {
        let own = found.support.iter().filter(|s| s.0 == side);
        own.map(|s| planes[s.1.face() as usize].normal * s.2).sum::<DVec3>()
    };
    let (of_a, of_b) = (sum(Side::A, &pair.a.planes), sum(Side::B, &pair.b.planes));
    if (of_a + of_b).length() > BALANCED * of_a.length() {
        return None;
    }
    Some((sharpened(of_a.normalize(), MANY_FACES), smallvec![found.x]))
}

/// Where F is lowest in a box.
fn lowest(bodies: &Bodies, within: &Aabb) -> Option<Lowest> {
    let program = Program::of(bodies.task, bodies.at).filter(|_| !within.is_empty())?;
    Some(program.lowest(within, |value, bound| value - bound <= bodies.task.rounding, bodies.work))
}

/// Unit directions near to n that two edges between some corners of each body have as their common perpendicular, or an edge and
/// a corner.
fn between_edges(a: &[DVec3], b: &[DVec3], n: DVec3) -> Vec<DVec3> {
    let edges = |of: &[DVec3]| -> Vec<(DVec3, DVec3)> {
        (0..of.len()).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| (of[j], of[i] - of[j])).collect()
    };
    let (of_a, of_b) = (edges(a), edges(b));
    let crosses = of_a.iter().flat_map(|p| of_b.iter().map(|q| p.1.cross(q.1)));
    let off = |x: DVec3, (from, way): &(DVec3, DVec3)| (x - *from).reject_from(*way);
    let from_a = a.iter().flat_map(|x| of_b.iter().map(|q| off(*x, q)));
    let from_b = b.iter().flat_map(|x| of_a.iter().map(|p| off(*x, p)));
    let ways = crosses.chain(from_a).chain(from_b).filter_map(|way| way.try_normalize());
    ways.map(|way| if way.dot(n) < 0.0 { -way } else { way }).filter(|way| (*way - n).length() <= SAME).collect()
}

/// What of a body faces the other one: corners of a convex polygon, or two ends, or one point; `None` where it has no end. Then all
/// corners that make it.
struct Outline(Option<Vec<Corner>>, Vec<Corner>);

/// The outlines of both bodies, and whether both are of faces that lie along each other.
fn outlines(bodies: &Bodies, pair: &Polytopes, n: DVec3, flat: impl Fn(DVec3) -> DVec2) -> ([Outline; 2], bool) {
    let lean = LEAN * bodies.lie / bodies.size;
    let along = |body: &Polytope, n: DVec3| -> Vec<Plane> {
        body.planes.iter().filter(|p| (p.normal - n).length() <= lean).copied().collect()
    };
    let faces = [along(&pair.a, n), along(&pair.b, -n)];
    let are_faces = faces.iter().all(|f| !f.is_empty());
    let outline = |of: u32, body: &Polytope, along: &[Plane], n: DVec3| {
        if body.is_unbounded() {
            return Outline(None, Vec::new());
        }
        bodies.work.look(along.len() * body.corners.len() / 16);
        let on_a_face = |v: DVec3| along.iter().any(|p| p.normal.dot(v) - p.offset >= -MERGED * bodies.size);
        let farthest = n.dot(body.support(n));
        // An edge or a corner may be beside a face, over what falls off from it.
        let is_near = |v: DVec3| !are_faces && n.dot(v) >= farthest - bodies.tau;
        let all = body.corners.iter().enumerate().filter(|(_, v)| is_near(**v) || on_a_face(**v));
        Outline::of(all.map(|(i, v)| Corner { u: flat(*v), key: [2 * i as u32 + of, 0] }).collect(), bodies.eps)
    };
    ([outline(0, &pair.a, &faces[0], n), outline(1, &pair.b, &faces[1], -n)], are_faces)
}

/// Makes some points their convex hull, counter-clockwise: a polygon, the two ends of a segment, or one point. What is within `merged`
/// of it otherwise is left out (A. M. Andrew's monotone chain, 1979).
fn hull(points: &mut Vec<Corner>, merged: f64) -> &mut Vec<Corner> {
    // Along the way between two that are far from each other: those on a line across another way came in the order of their roundings.
    let farthest = |from: DVec2| {
        points.iter().map(|p| p.u).max_by(|p, q| p.distance(from).total_cmp(&q.distance(from))).unwrap_or(from)
    };
    let one = farthest(points.first().map_or(DVec2::ZERO, |p| p.u));
    let way = (farthest(one) - one).normalize_or(DVec2::X);
    let rank = |p: &Corner| (way.dot(p.u), way.perp_dot(p.u));
    points.sort_by(|p, q| {
        let ((x, y), (v, w)) = (rank(p), rank(q));
        x.total_cmp(&v).then(y.total_cmp(&w)).then(p.key.cmp(&q.key))
    });
    let mut chain: Vec<Corner> = Vec::new();
    let mut half = |points: &mut dyn Iterator<Item = &Corner>| {
        let from = chain.len();
        'points: for p in points {
            if chain[from..].last().is_some_and(|q| q.u.distance(p.u) <= merged) {
                continue;
            }
            while let [.., o, q] = chain[from..] {
                let (to_q, to_p) = (q.u - o.u, p.u - o.u);
                let (turn, slack) = (to_q.perp_dot(to_p), merged * to_p.length());
                if turn > slack {
                    break;
                }
                // Of points on a line the order is that of their roundings: the farther one stays.
                if turn >= -slack && to_q.dot(to_p) > 0.0 && to_q.length() >= to_p.length() {
                    continue 'points;
                }
                chain.pop();
            }
            chain.push(*p);
        }
        // The last one is the first of the other half.
        if chain.len() > from + 1 {
            chain.pop();
        }
    };
    half(&mut points.iter());
    half(&mut points.iter().rev());
    if let [p, .., q] = chain[..]
        && p.u.distance(q.u) <= merged
    {
        chain.pop();
    }
    *points = chain;
    points
}

/// Where two polytopes are nearest to each other along their normal: what the corners that are foremost there have in common.
fn foremost(bodies: &Bodies, pair: &Polytopes, n: DVec3, slack: f64, flat: impl Fn(DVec3) -> DVec2) -> Option<DVec2> {
    let outline = |body: &Polytope, n: DVec3| {
        if body.is_unbounded() {
            return Outline(None, Vec::new());
        }
        let farthest = n.dot(body.support(n)) - slack * bodies.eps;
        let all = body.corners.iter().filter(|v| n.dot(**v) >= farthest);
        Outline::of(all.map(|v| Corner { u: flat(*v), key: [0; 2] }).collect(), bodies.eps)
    };
    let common = outline(&pair.a, n).common(&outline(&pair.b, -n), bodies);
    (!common.is_empty()).then(|| common.iter().map(|c| c.u).sum::<DVec2>() / common.len() as f64)
}

impl Outline {
    fn of(all: Vec<Corner>, merged: f64) -> Self {
        let mut corners = all.clone();
        hull(&mut corners, merged);
        Self(Some(corners), all)
    }

    /// What two outlines have in common; none where they miss each other, as they do within rounding.
    fn common(&self, other: &Self, bodies: &Bodies) -> Vec<Corner> {
        let (p, q) = match (&self.0, &other.0) {
            (Some(p), Some(q)) => (p, q),
            (Some(p), None) | (None, Some(p)) => return p.clone(),
            (None, None) => return Vec::new(),
        };
        bodies.work.look(p.len() * q.len() / 8);
        if let ([a, b], [c, d]) = (&p[..], &q[..]) {
            return crossing([*a, *b], [*c, *d], bodies);
        }
        let (mut cut, by) = if q.len() > 2 { (p.clone(), q) } else { (q.clone(), p) };
        if by.len() == 1 {
            return if cut.len() == 1 || nearest(&cut, by[0].u) <= MERGED * bodies.size {
                by.clone()
            } else {
                Vec::new()
            };
        }
        if by.len() == 2 {
            // A point on a segment.
            return if nearest(by, cut[0].u) <= MERGED * bodies.size { cut } else { Vec::new() };
        }
        for (i, c) in by.iter().enumerate() {
            let next = by[(i + 1) % by.len()];
            let out = -(next.u - c.u).perp().normalize_or_zero();
            clip(&mut cut, out, out.dot(c.u), 1 + c.key[0], bodies.eps);
        }
        cut
    }
}

/// How far a point is from a segment.
fn nearest(ends: &[Corner], u: DVec2) -> f64 {
    let (p, way) = (ends[0].u, ends[ends.len() - 1].u - ends[0].u);
    let part = if way == DVec2::ZERO { 0.0 } else { ((u - p).dot(way) / way.length_squared()).clamp(0.0, 1.0) };
    u.distance(p + way * part)
}

/// What two segments have in common: a point, or of those that lie along each other a part of the first.
fn crossing([a, b]: [Corner; 2], [c, d]: [Corner; 2], bodies: &Bodies) -> Vec<Corner> {
    let (p, q) = (b.u - a.u, d.u - c.u);
    let turn = p.perp_dot(q);
    if turn.abs() <= bodies.lie * p.length().max(q.length()) {
        let mut cut = vec![a, b];
        let way = q.normalize();
        clip(&mut cut, way, way.dot(d.u), 1 + d.key[0], bodies.eps);
        clip(&mut cut, -way, -way.dot(c.u), 1 + c.key[0], bodies.eps);
        return cut;
    }
    let (s, t) = ((c.u - a.u).perp_dot(q) / turn, (c.u - a.u).perp_dot(p) / turn);
    let slack = |way: DVec2| MERGED * bodies.size / way.length();
    let within = |s: f64, way: DVec2| s >= -slack(way) && s <= 1.0 + slack(way);
    if !within(s, p) || !within(t, q) {
        return Vec::new();
    }
    vec![Corner { u: a.u + p * s.clamp(0.0, 1.0), key: [a.key[0], 1 + c.key[0]] }]
}

/// Takes away what of a polygon, a segment or a point lies beyond n·u = d by more than `slack`; `by` names the cut.
fn clip(corners: &mut Vec<Corner>, n: DVec2, d: f64, by: u32, slack: f64) {
    let beyond = |c: &Corner| n.dot(c.u) - d;
    if corners.iter().all(|c| beyond(c) <= slack) {
        return;
    }
    let count = corners.len();
    let sides = if count == 2 { 1 } else { count };
    let mut kept: Vec<Corner> = Vec::with_capacity(count + 1);
    for (i, c) in corners.iter().enumerate() {
        let here = beyond(c);
        if here <= slack {
            kept.push(*c);
        }
        if i >= sides {
            continue;
        }
        let next = corners[(i + 1) % count];
        let there = beyond(&next);
        if (here > slack) != (there > slack) {
            let s = here / (here - there);
            // An end within the slack is where the cut is.
            if (0.0..=1.0).contains(&s) && c.u.distance(next.u) > 0.0 {
                kept.push(Corner { u: c.u.lerp(next.u, s), key: [c.key[0], by] });
            }
        }
    }
    *corners = kept;
}

/// Some corners of an area: those farthest along directions that are fixed in A.
fn some(corners: &[Corner]) -> Vec<Corner> {
    let mut found: Vec<Corner> = Vec::new();
    for k in 0..MOST_POINTS {
        let (y, x) = libm::sincos(k as f64 * std::f64::consts::TAU / MOST_POINTS as f64);
        let way = DVec2::new(x, y);
        let farther = |p: &&Corner, q: &&Corner| way.dot(p.u).total_cmp(&way.dot(q.u));
        if let Some(c) = corners.iter().max_by(farther)
            && !found.iter().any(|f| f.u == c.u)
        {
            found.push(*c);
        }
    }
    found
}

impl Surface {
    /// The planes of a body that bound it along a direction over a box.
    fn new(body: &Polytope, normal: DVec3, across: [DVec3; 2], sign: f64, (middle, half): (DVec2, DVec2)) -> Self {
        let height = |p: &Plane| {
            // n·x = offset, x = u + z·normal.
            let rise = normal.dot(p.normal);
            let slope = DVec2::new(across[0].dot(p.normal), across[1].dot(p.normal)) / -rise;
            (sign * rise > STEEP).then(|| (p.offset / rise, slope, p.face))
        };
        let all: Vec<_> = body.planes.iter().filter_map(height).collect();
        let at = |(z, slope, _): &(f64, DVec2, u32)| sign * (z + slope.dot(middle));
        let swing = |(_, slope, _): &(f64, DVec2, u32)| slope.abs().dot(half);
        let most = all.iter().map(|p| at(p) + swing(p)).fold(f64::INFINITY, f64::min);
        let planes = all.iter().filter(|p| at(p) - swing(p) <= most).copied().collect();
        Self { planes, sign }
    }

    /// The height at a point and the plane that has it, by place.
    fn at(&self, u: DVec2) -> (f64, usize) {
        let first = (f64::INFINITY, 0);
        let (height, at) = self.planes.iter().enumerate().fold(first, |best, (i, (z, slope, _))| {
            let z = self.sign * (z + slope.dot(u));
            if z < best.0 { (z, i) } else { best }
        });
        (self.sign * height, at)
    }
}

impl Projection {
    /// Over a box that holds some points.
    fn new<'c>(pair: &Polytopes, normal: DVec3, across: [DVec3; 2], over: impl Iterator<Item = &'c Corner>) -> Self {
        let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (least, most) = over.fold(none, |(least, most), c| (least.min(c.u), most.max(c.u)));
        let over = ((least + most) * 0.5, (most - least) * 0.5);
        let surfaces =
            [Surface::new(&pair.a, normal, across, 1.0, over), Surface::new(&pair.b, normal, across, -1.0, over)];
        Self { normal, across, surfaces }
    }

    fn gap(&self, u: DVec2) -> Gap {
        let [(top, p), (bottom, q)] = [self.surfaces[0].at(u), self.surfaces[1].at(u)];
        Gap { width: bottom - top, planes: [p, q] }
    }

    /// The gap of two planes: at the origin, and its slope.
    fn between(&self, [p, q]: [usize; 2]) -> (f64, DVec2) {
        let ((top, up, _), (bottom, down, _)) = (self.surfaces[0].planes[p], self.surfaces[1].planes[q]);
        (bottom - top, down - up)
    }

    /// Cuts a region along the walls of both bodies. An outline runs off them where faces bow that walls lean against.
    fn wall_in(&self, region: &mut Vec<Corner>, pair: &Polytopes, bodies: &Bodies) {
        for (body, side) in [(&pair.a, 0), (&pair.b, 1)] {
            let is_wall = |p: &&Plane| self.normal.dot(p.normal).abs() <= STEEP;
            let feet = |region: &[Corner]| region.iter().map(|c| self.feet(c.u)[side]).collect::<Vec<DVec3>>();
            let mut on_it = feet(region);
            for (k, wall) in body.planes.iter().filter(is_wall).enumerate() {
                for _ in 0..WALL_CUTS {
                    bodies.work.look(1 + region.len() / 8);
                    let beyond = on_it.iter().map(|x| wall.normal.dot(*x) - wall.offset).enumerate();
                    let farthest = beyond.max_by(|p, q| p.1.total_cmp(&q.1));
                    let Some((i, off)) = farthest.filter(|(_, off)| *off > bodies.eps) else { break };
                    let across = DVec2::from_array(self.across.map(|e| e.dot(wall.normal)));
                    let (steep, u) = (across.length(), region[i].u);
                    let out = across / steep;
                    // What is on the wall but for rounding stays: between corners of one wall there is no crossing with it.
                    let slack = 0.5 * bodies.eps;
                    clip(region, out, out.dot(u) - off / steep, WALL - 2 * k as u32 - side as u32, slack);
                    on_it = feet(region);
                }
            }
        }
        hull(region, MERGED * bodies.size);
    }

    /// Cuts a region where the gap is wider than the threshold.
    fn cut(&self, region: &mut Vec<Corner>, bodies: &Bodies) {
        for k in 0..MOST_CUTS {
            let widest = region.iter().map(|c| self.gap(c.u)).max_by(|p, q| p.width.total_cmp(&q.width));
            let Some(gap) = widest.filter(|gap| gap.width > bodies.tau * (1.0 + MERGED)) else { return };
            let (width, slope) = self.between(gap.planes);
            let steep = slope.length();
            if steep * bodies.size <= bodies.eps {
                return;
            }
            let (normal, offset) = (slope / steep, (bodies.tau - width) / steep);
            clip(region, normal, offset, u32::MAX - k as u32, 0.0);
            hull(region, MERGED * bodies.size);
        }
    }

    /// The feet of a point on both surfaces, along A's axes.
    fn feet(&self, u: DVec2) -> [DVec3; 2] {
        let flat = self.across[0] * u.x + self.across[1] * u.y;
        [flat + self.normal * self.surfaces[0].at(u).0, flat + self.normal * self.surfaces[1].at(u).0]
    }

    fn told(&self, u: DVec2) -> RegionPoint {
        let [on_a, on_b] = self.feet(u);
        RegionPoint { point: (on_a + on_b) * 0.5, separation: self.gap(u).width }
    }

    fn point(&self, bodies: &Bodies, u: DVec2) -> Region {
        self.region(bodies, u, Extent::Point, vec![self.told(u)])
    }

    fn line(&self, bodies: &Bodies, [from, to]: [DVec2; 2]) -> Region {
        self.region(bodies, (from + to) * 0.5, Extent::Line, vec![self.told(from), self.told(to)])
    }

    /// A point or a line with the faces that meet at its middle.
    fn region(&self, bodies: &Bodies, middle: DVec2, extent: Extent, points: Vec<RegionPoint>) -> Region {
        let [on_a, on_b] = self.feet(middle);
        let (rank_a, rank_b) = (bodies.rank(Side::A, on_a), bodies.rank(Side::B, on_b));
        let most = if extent == Extent::Line { 2 } else { 3 };
        // A foot that a wall has cut off by more than rounding has the face that made its height.
        let faces = |side: Side, at: usize, foot: DVec3| match faces_at(bodies, side, foot) {
            [NO_FACE, ..] => three([self.surfaces[at].planes[self.surfaces[at].at(middle).1].2]),
            faces => faces,
        };
        Region {
            kind: ContactKind::of_active(rank_a.min(most), rank_b.min(most)),
            extent,
            normal: self.normal,
            faces_a: faces(Side::A, 0, on_a),
            faces_b: faces(Side::B, 1, on_b),
            points,
        }
    }

    /// A patch from its corners, the one with the smallest name first.
    fn patch(&self, bodies: &Bodies, corners: &mut [Corner]) -> Region {
        bodies.work.look(corners.len());
        let first = (0..corners.len()).min_by_key(|i| corners[*i].key).unwrap_or(0);
        corners.rotate_left(first);
        let middle = corners.iter().map(|c| c.u).sum::<DVec2>() / corners.len() as f64;
        let face = |side: usize| self.surfaces[side].planes[self.surfaces[side].at(middle).1].2;
        Region {
            kind: ContactKind::FaceFace,
            extent: Extent::Patch,
            normal: self.normal,
            faces_a: three([face(0)]),
            faces_b: three([face(1)]),
            points: corners.iter().map(|c| self.told(c.u)).collect(),
        }
    }
}
