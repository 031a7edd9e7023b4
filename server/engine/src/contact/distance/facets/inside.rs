//! Points at surfaces, moved inside the bodies and proven there; points of both; the faces at a point.

use super::body::Body;
use super::triangles::{self, Triangle};
use crate::contact::distance::common;
use crate::contact::distance::part::literal_at;
use crate::contact::distance::polish::{FEATURE, Pair};
use crate::contact::query::outcome::NO_FACE;
use crate::math::gjk::least_of;
use crate::motion::Instant;
use glam::DVec3;
use smallvec::SmallVec;

/// Steps against the gradient of f that lead inside, and how far they may lead, in steps.
const STEPS: usize = 24;
const FAR: f64 = 1e3;
/// Lengths of a step along a direction that may lead inside, in steps.
const STEPPED: [f64; 5] = [1.0, 4.0, 16.0, 64.0, 256.0];
/// How much a facet is gone below on the way to its middle.
const BELOW: f64 = 0.25;
/// Depths at which a point of both is looked for below where surfaces cross, each part of the one before.
const DEPTHS: i32 = 24;
const SHALLOWER: f64 = 0.25;

/// A point of a body next to one at its surface, of its model's frame, proven inside. `facet` is the one that it is on, of a mesh;
/// `inwards` is a unit vector that may lead there, of a convex body.
pub fn inside(body: &Body, x: DVec3, facet: Option<&Triangle>, inwards: DVec3, rounding: f64) -> Option<DVec3> {
    if let Some(convex) = body.convex() {
        return convex.inside(x, inwards, rounding);
    }
    let model = body.model;
    let is_inside = |x: &DVec3| model.value(*x) <= -rounding;
    let step = 2.0 * (rounding + body.tolerance);
    if let Some(n) = facet.and_then(|t| triangles::normal(t).try_normalize())
        && let Some(below) = Some(x - n * step).filter(is_inside)
    {
        return Some(below);
    }
    let mut y = x;
    for _ in 0..STEPS {
        let (f, id) = model.deciding(y);
        if is_inside(&y) {
            return Some(y);
        }
        y -= literal_at(&model.solid.faces[id.face() as usize], id.sense(), y).1 * (f.max(0.0) + step);
        let is_near = (y - x).length() <= FAR * step;
        if !is_near {
            break;
        }
    }
    let around = around(body, x, step);
    let ways = || around.iter().copied();
    STEPPED.iter().flat_map(|k| ways().map(move |way| x + way * (k * step))).find(is_inside)
}

/// Directions that may lead from a corner or an edge into a mesh, the model's frame: below all facets there, below each, and below each on
/// the way to its middle.
fn around(body: &Body, x: DVec3, reach: f64) -> Vec<DVec3> {
    let Some((tree, facets)) = body.mesh() else { return Vec::new() };
    let (frame, y) = (&body.primitive.frame, body.primitive.frame.inverse().point(x));
    let mut near: Vec<(DVec3, DVec3)> = Vec::new();
    tree.near(y, reach, |facet| {
        let t = facets.corners(facet);
        if (triangles::of_point(y, &t) - y).length() <= reach
            && let Some(n) = triangles::normal(&t).try_normalize()
        {
            near.push((n, ((t[0] + t[1] + t[2]) / 3.0 - y).normalize_or_zero()));
        }
    });
    let normals: Vec<DVec3> = near.iter().map(|n| n.0).collect();
    let mean = -normals.iter().copied().sum::<DVec3>().normalize_or_zero();
    let least = least_of(&normals).map_or(mean, |m| -m.normalize_or_zero());
    let each = near.iter().flat_map(|(n, middle)| [-*n, (*middle - *n * BELOW).normalize_or_zero()]);
    [least, mean].into_iter().chain(each).map(|way| frame.vector(way)).collect()
}

/// A point of both bodies below where a surface of a body runs through the other one, A's frame; `outward` are the unit normals there,
/// A's axes, and `size` a length as large as what lies there.
pub fn shared(bodies: &[Body; 2], at: &Instant, x: DVec3, outward: &[DVec3], size: f64, rounding: f64) -> Option<Pair> {
    let inwards = -outward.iter().copied().sum::<DVec3>().try_normalize()?;
    let mut depth = size;
    for _ in 0..DEPTHS {
        let p = x + inwards * depth;
        let q = at.b_point(p);
        if bodies[0].model.value(p) <= -rounding && bodies[1].model.value(q) <= -rounding {
            return Some(Pair { x: p, y: q, distance: 0.0 });
        }
        depth *= SHALLOWER;
        if depth < rounding {
            break;
        }
    }
    None
}

/// A point of both bodies next to one that is at both surfaces, or none.
pub fn shared_near(bodies: &[Body; 2], at: &Instant, x: DVec3, rounding: f64, least: f64) -> Option<Pair> {
    common::from_point([bodies[0].model, bodies[1].model], at, x, rounding, least)
}

/// The faces at a point of a body's model frame, at most three, by face id; `NO_FACE` fills.
pub fn faces(body: &Body, x: DVec3, scale: f64, rounding: f64) -> [u32; 3] {
    if let Some(convex) = body.convex() {
        return convex.faces(x, scale, rounding);
    }
    let mut out = [NO_FACE; 3];
    let Some((tree, facets)) = body.mesh() else { return out };
    let (y, reach) = (body.primitive.frame.inverse().point(x), FEATURE * scale + 1e3 * rounding);
    let mut near: SmallVec<[(f64, u32); 8]> = SmallVec::new();
    tree.near(y, reach, |facet| {
        let Some(face) = facets.face_of(facet).map(|face| body.primitive.first_face + face) else { return };
        let off = (triangles::of_point(y, &facets.corners(facet)) - y).length();
        if off <= reach {
            near.push((off, face));
        }
    });
    // Of each face its nearest facet.
    near.sort_by(|p, q| p.1.cmp(&q.1).then(p.0.total_cmp(&q.0)));
    near.dedup_by_key(|n| n.1);
    near.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
    out.iter_mut().zip(&near).for_each(|(to, n)| *to = n.1);
    out.sort_unstable();
    out
}
