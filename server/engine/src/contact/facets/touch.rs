//! From the nearest points of two covers to the faces that hold a contact there.
//!
//! Of a mesh these are the planes that pass by the point, as few of them as hold the direction between them. Where more meet in
//! a corner than are needed, those are taken of which the corner that they cut off at a depth lies deepest: the dual of the linear
//! program "how far does the mesh reach along the direction, less a depth" has its solution there.

use super::body::{Body, Moment};
use crate::contact::convex::Nearest;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::faces::{faces_at, for_sets, weights};
use crate::contact::witness::newton::{Actives, Constraint, MAX_ACTIVE, Weights};
use crate::solid::Sense;
use crate::solid::local::LiteralId;
use glam::DVec3;
use smallvec::SmallVec;

/// How near to a witness, relative to the pair's scale, a face passes that is active there: first and second try.
pub(super) const ACTIVE: [f64; 2] = [1e-7, 1e-4];
/// Planes at a corner that are looked at: those that the direction points out of most.
const MOST_PLANES: usize = 16;
/// What the normals of faces may leave of a direction that they hold: nearest points tell it to about a thousandth where bodies are round.
const OFF: f64 = 0.05;
/// By how much a larger set of faces must hold it better.
const BETTER: f64 = 1e-7;
/// Determinant of three planes' normals from which on they are independent: a fine mesh of something round has them close to each other.
const INDEPENDENT: f64 = 1e-12;

/// Faces with the weights of their normals.
type Held = SmallVec<[(Constraint, f64); 8]>;

/// The faces of both bodies that hold their nearest points against each other, with multipliers that add up to 1; `None` where they
/// do not.
pub(super) fn holding(
    task: &Task,
    bodies: &[Body; 2],
    m: &Moment,
    found: &Nearest,
    tol: f64,
) -> Option<(Actives, Weights)> {
    let at = &m.at;
    let [a, b] = bodies;
    let of_a = of_body(task, a, Side::A, (found.a, found.normal), m, tol)?;
    let of_b = of_body(task, b, Side::B, (at.b_point(found.b), at.b_from_a * -found.normal), m, tol)?;
    if of_a.len() + of_b.len() > MAX_ACTIVE {
        return None;
    }
    Some(of_a.into_iter().chain(of_b).map(|(c, l)| (c, 0.5 * l)).unzip())
}

/// The faces that hold a body's point, in its model's frame, against its outward direction n.
fn of_body(task: &Task, body: &Body, side: Side, (x, n): (DVec3, DVec3), m: &Moment, tol: f64) -> Option<Held> {
    let mut held = Held::new();
    if let Some(convex) = body.convex() {
        faces_at(side, body.primitive, x, n, tol, &mut held);
        let outward = if side == Side::A { n } else { m.at.a_vector(n) };
        let outward = m.own(side as usize, m.at.world_from_a * outward);
        // A corner that two faces hold against n, as two opposite ones of four may: they alone leave a line open.
        return (!held.is_empty() && held.len() >= convex.corner(outward)).then_some(held);
    }
    let (tree, facets) = body.mesh()?;
    let y = body.primitive.frame.inverse().point(x);
    let mut near: SmallVec<[u32; MOST_PLANES]> = SmallVec::new();
    tree.near(y, tol, |facet| {
        if let Some(face) = facets.face_of(facet)
            && !near.contains(&face)
            && is_near(y, facets.corners(facet), tol)
        {
            near.push(face);
        }
    });
    let solid = if side == Side::A { task.a } else { task.b };
    let first = body.primitive.first_face;
    let normal = |face: u32| solid.faces[(first + face) as usize].flat().map_or(DVec3::ZERO, |(normal, _)| normal);
    let mut planes: SmallVec<[(u32, DVec3); MOST_PLANES]> = near.iter().map(|f| (*f, normal(*f))).collect();
    planes.sort_by(|p, q| q.1.dot(n).total_cmp(&p.1.dot(n)).then(p.0.cmp(&q.0)));
    planes.truncate(MOST_PLANES);
    let literal = |face: u32| Constraint::Literal(side, LiteralId::new(first + face, Sense::Positive));
    let set = least_set(&planes, n)?;
    Some(set.into_iter().map(|(i, w)| (literal(planes[i].0), w)).collect())
}

/// True where a point is within `tol` of a facet.
fn is_near(y: DVec3, [a, b, c]: [DVec3; 3], tol: f64) -> bool {
    let n = (b - a).cross(c - a).normalize_or_zero();
    let within = |p: DVec3, q: DVec3| {
        let side = q - p;
        n.cross(side).dot(y - p) >= -tol * side.length()
    };
    n.dot(y - a).abs() <= tol && within(a, b) && within(b, c) && within(c, a)
}

/// The least set of planes whose normals hold n between them, with their weights: one, two, then three.
fn least_set(planes: &[(u32, DVec3)], n: DVec3) -> Option<SmallVec<[(usize, f64); 3]>> {
    let mut best: (f64, f64, SmallVec<[(usize, f64); 3]>) = (OFF, 0.0, SmallVec::new());
    for_sets(planes.len(), |set| {
        let Some(weights) = weights(set, |i| planes[i].1, n, INDEPENDENT) else { return };
        let sum: DVec3 = set.iter().zip(&weights).map(|(i, w)| planes[*i].1 * *w).sum();
        let off = (sum - n).length();
        let total: f64 = weights.iter().sum();
        let is_better = if best.2.len() == set.len() {
            off < best.0 - BETTER || (off <= best.0 + BETTER && total > best.1)
        } else {
            off < best.0 - BETTER
        };
        if is_better {
            best = (off, total, set.iter().copied().zip(weights).collect());
        }
    });
    (!best.2.is_empty()).then_some(best.2)
}
