//! Rays through meshes, and how far points are from them: a tree of boxes over the triangles, halved at the middle.
//!
//! Which triangles a line passes through is decided exactly, of corners that are projected along the line: each corner once the
//! same way, and a line that is seen to run through an edge or a corner passes on one side of it for all triangles there (after
//! S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", JCGT 2, 2013). So a line leaves a closed mesh as often as
//! it enters it. Pictures only.

use super::line::{Crossing, Ray, Span, THIN};
use crate::math::Aabb;
use crate::solid::Primitive;
use crate::solid::primitive::Facets;
use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};
use smallvec::SmallVec;

/// Triangles of a leaf.
const FEW: usize = 4;
/// What rounding may do to where a line meets a box, relative to the length on the line.
const SLACK: f64 = 1e-12;

/// Triangles `from..to` of the order, in a box; inner nodes have their second half at `second`, and their first behind themselves.
#[derive(Debug)]
struct Node {
    aabb: Aabb,
    from: u32,
    to: u32,
    second: u32,
}

/// A primitive of triangles, prepared for rays.
#[derive(Debug)]
pub struct Mesh<'a> {
    primitive: &'a Primitive,
    facets: Facets<'a>,
    /// The corners of all triangles in the order of the leaves, each with its triangle's number.
    order: Vec<([DVec3; 3], u32)>,
    nodes: Vec<Node>,
}

impl<'a> Mesh<'a> {
    /// Prepares a primitive that has facets.
    pub fn new(primitive: &'a Primitive, facets: Facets<'a>) -> Self {
        let all = facets.triangles.iter().enumerate();
        let order: Vec<([DVec3; 3], u32)> =
            all.map(|(i, t)| (t.map(|v| facets.vertices[v as usize]), i as u32)).collect();
        let mut mesh = Self { primitive, facets, order, nodes: Vec::new() };
        mesh.halve(0, mesh.order.len());
        mesh
    }

    fn halve(&mut self, from: usize, to: usize) {
        let part = &mut self.order[from..to];
        let aabb = Aabb::of_points(part.iter().flat_map(|t| t.0));
        let node = self.nodes.len();
        self.nodes.push(Node { aabb, from: from as u32, to: to as u32, second: 0 });
        if part.len() <= FEW {
            return;
        }
        let middles = Aabb::of_points(part.iter().map(|(t, _)| t[0] + t[1] + t[2]));
        let size = middles.max - middles.min;
        let k = if size.x >= size.y.max(size.z) { 0 } else { 1 + usize::from(size.z > size.y) };
        let key = |t: &([DVec3; 3], u32)| t.0.iter().map(|c| c[k]).sum::<f64>();
        let half = part.len() / 2;
        part.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.1.cmp(&b.1)));
        self.halve(from, from + half);
        self.nodes[node].second = self.nodes.len() as u32;
        self.halve(from + half, to);
    }

    /// The ray in the primitive's frame.
    fn own(&self, ray: &Ray) -> Ray {
        let inverse = self.primitive.frame.inverse();
        Ray { origin: inverse.point(ray.origin), direction: inverse.vector(ray.direction) }
    }

    /// The spans of a ray (in the solid's frame) inside the mesh from its origin on, ascending. One in which it starts begins infinitely
    /// far behind.
    pub fn spans(&self, ray: &Ray) -> Vec<Span> {
        let own = self.own(ray);
        let mut met = self.crossings(&own);
        met.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Far away it is outside.
        let mut depth: i32 = met.iter().map(|c| if c.1 { -1 } else { 1 }).sum();
        let behind = Crossing { at: f64::NEG_INFINITY, face: self.primitive.first_face, outward: true };
        let (mut open, mut spans) = ((depth > 0).then_some(behind), Vec::with_capacity(met.len().div_ceil(2)));
        for (at, entering, triangle) in met {
            let was = depth > 0;
            depth += if entering { 1 } else { -1 };
            if was == (depth > 0) {
                continue;
            }
            let crossing = Crossing { at, face: self.face(triangle, own.at(at)), outward: true };
            match open.take() {
                None => open = Some(crossing),
                Some(enter) => spans.push((enter, crossing)),
            }
        }
        spans.retain(|(a, b): &Span| b.at - a.at > THIN * a.at.abs().min(b.at.abs()));
        spans
    }

    /// The id within the solid of a triangle's face; of one that is too thin to have a face that of the nearest one that has.
    fn face(&self, triangle: u32, x: DVec3) -> u32 {
        let own = self.facets.face_of(triangle);
        let face = own.or_else(|| self.nearest(x, f64::INFINITY).and_then(|near| self.facets.face_of(near.triangle)));
        self.primitive.first_face + face.unwrap_or(0)
    }

    /// Where a ray crosses triangles ahead of its origin: length, whether it enters, triangle.
    fn crossings(&self, ray: &Ray) -> SmallVec<[(f64, bool, u32); 16]> {
        let (sight, inverse) = (Sight::along(ray), ray.direction.recip());
        let mut met = SmallVec::new();
        let mut stack: SmallVec<[u32; 64]> = SmallVec::new();
        stack.push(0);
        while let Some(n) = stack.pop() {
            let node = &self.nodes[n as usize];
            if !passes_through(ray.origin, inverse, &node.aabb) {
                continue;
            }
            if node.second == 0 {
                let own = self.order[node.from as usize..node.to as usize].iter();
                let crossed = own.filter_map(|(t, i)| sight.meets(t).map(|(at, enters)| (at, enters, *i)));
                met.extend(crossed.filter(|c| c.0 > 0.0));
            } else {
                stack.extend([node.second, n + 1]);
            }
        }
        met
    }

    /// The distance of a point (in the solid's frame) from the mesh, negative inside, cut off a little above `reach`.
    pub fn clearance(&self, x: DVec3, reach: f64) -> f64 {
        let x = self.primitive.frame.inverse().point(x);
        let reach = reach * 1.001;
        match self.nearest(x, reach) {
            Some(near) if near.below => -near.off,
            Some(near) => near.off,
            None => {
                let ahead = self.crossings(&Ray { origin: x, direction: DVec3::new(0.36, 0.48, 0.8) });
                let turns: i32 = ahead.iter().map(|c| if c.1 { -1 } else { 1 }).sum();
                if turns > 0 { -reach } else { reach }
            }
        }
    }

    /// The triangle that has a face and is nearest to a point (in the primitive's frame), if it is nearer than `reach`.
    fn nearest(&self, x: DVec3, reach: f64) -> Option<Near> {
        let away = |n: u32| {
            let b = &self.nodes[n as usize].aabb;
            (b.min - x).max(x - b.max).max(DVec3::ZERO).length_squared()
        };
        let (mut best, mut found) = (reach * reach, None);
        // Of those that are as near, with a common edge, the one tells the side that the point is farthest above or below.
        let mut height = 0.0;
        let mut stack: SmallVec<[(f64, u32); 64]> = SmallVec::new();
        stack.push((away(0), 0));
        while let Some((least, n)) = stack.pop() {
            if least > best {
                continue;
            }
            let node = &self.nodes[n as usize];
            if node.second != 0 {
                let mut halves = [n + 1, node.second].map(|half| (away(half), half));
                if halves[0].0 < halves[1].0 {
                    halves.swap(0, 1);
                }
                stack.extend(halves.into_iter().filter(|half| half.0 <= best));
                continue;
            }
            for (t, i) in &self.order[node.from as usize..node.to as usize] {
                let off = x - closest(x, *t);
                let square = off.length_squared();
                if square > best * (1.0 + 1e-9) || self.facets.face_of(*i).is_none() {
                    continue;
                }
                let own = off.dot((t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero());
                if square < best * (1.0 - 1e-9) || own.abs() > f64::abs(height) || found.is_none() {
                    height = own;
                    found = Some(Near { off: square.sqrt(), below: own < 0.0, triangle: *i });
                }
                best = best.min(square);
            }
        }
        found
    }
}

/// A triangle near a point.
struct Near {
    off: f64,
    /// The point is on its inner side.
    below: bool,
    triangle: u32,
}

/// True where a ray meets a box, in doubt too; `inverse` is one over its direction.
fn passes_through(origin: DVec3, inverse: DVec3, b: &Aabb) -> bool {
    let (p, q) = ((b.min - origin) * inverse, (b.max - origin) * inverse);
    // 0 · infinity: the line lies in a side's plane; NaN compares as "no limit".
    let enter = p.x.min(q.x).max(p.y.min(q.y)).max(p.z.min(q.z));
    let leave = p.x.max(q.x).min(p.y.max(q.y)).min(p.z.max(q.z));
    leave >= 0.0 && enter <= leave + SLACK * enter.abs().max(leave.abs())
}

/// A line as seen along itself: points are sheared so that it is the axis `k`.
struct Sight {
    origin: DVec3,
    k: usize,
    shear: DVec2,
    along: f64,
}

impl Sight {
    fn along(ray: &Ray) -> Self {
        let size = ray.direction.abs();
        let k = if size.x >= size.y.max(size.z) { 0 } else { 1 + usize::from(size.z > size.y) };
        let along = ray.direction[k];
        let shear = DVec2::new(ray.direction[(k + 1) % 3], ray.direction[(k + 2) % 3]) / along;
        Self { origin: ray.origin, k, shear, along }
    }

    /// Where a point is seen, and how far along the axis.
    fn seen(&self, x: DVec3) -> (DVec2, f64) {
        let v = x - self.origin;
        let z = v[self.k];
        (DVec2::new(v[(self.k + 1) % 3], v[(self.k + 2) % 3]) - self.shear * z, z)
    }

    /// Where the line crosses a triangle, and whether it enters what lies behind it.
    fn meets(&self, corners: &[DVec3; 3]) -> Option<(f64, bool)> {
        let [a, b, c] = [self.seen(corners[0]), self.seen(corners[1]), self.seen(corners[2])];
        let at = |p: DVec2| Coord { x: p.x, y: p.y };
        let passes = |p: DVec2, q: DVec2| {
            if (p.y > 0.0) == (q.y > 0.0) {
                return false;
            }
            let (low, high) = if p.y < q.y { (p, q) } else { (q, p) };
            orient2d(at(low), at(high), at(DVec2::ZERO)) >= 0.0
        };
        if !(passes(a.0, b.0) ^ passes(b.0, c.0) ^ passes(c.0, a.0)) {
            return None;
        }
        let turns = orient2d(at(a.0), at(b.0), at(c.0));
        let shares = [b.0.perp_dot(c.0), c.0.perp_dot(a.0), a.0.perp_dot(b.0)];
        let sum: f64 = shares.iter().sum();
        let z = [a.1, b.1, c.1];
        let (low, high) = (z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]));
        let mean = (0..3).map(|i| shares[i] * z[i]).sum::<f64>() / sum;
        // Of what is seen from its side roundings decide: it is somewhere between its corners.
        let z = if mean.is_finite() { mean.clamp(low, high) } else { 0.5 * (low + high) };
        Some((z / self.along, (turns < 0.0) == (self.along > 0.0)))
    }
}

/// The point of a triangle that is nearest to a point (C. Ericson, "Real-time collision detection", 2005, 5.1.5).
fn closest(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    if sum > 0.0 { a + ab * (vb / sum) + ac * (vc / sum) } else { a }
}
