//! Two faces, one of each body, that lie on each other: what their common surface is, and which part of it is contact.
//!
//! At a point of the surface the tangent plane is cut into sectors by the faces that pass through it. In each sector the
//! bodies' trees are evaluated with the point moved a little along the sector, then off the surface into the body: A on
//! one side and B on the other make it a contact. No sector: outside; all: inside the patch; some: on its boundary, and
//! at a corner unless the boundary goes straight on.

use super::local::{ANGLE, At, Bodies, Lit, each_once, holds};
use crate::contact::exclusion::literal::Side;
use crate::math::any_perpendicular;
use crate::solid::Sense;
use crate::solid::local::{LiteralId, Token, Truth};
use crate::solid::surface::{Axis, Symmetry};
use glam::DVec3;
use smallvec::SmallVec;
use std::f64::consts::{PI, TAU};

/// A face of A and one of B that coincide within the threshold of touching, facing each other.
#[derive(Clone, Copy, Debug)]
pub struct FacePair {
    pub alpha: Lit,
    pub beta: Lit,
    /// Where flat faces lean against each other: the half-space in which their gap is within the threshold.
    pub limit: Option<(DVec3, f64)>,
}

/// Faces that lean apart further than this many thresholds of lying on each other across a body touch along an edge, not
/// over an area.
pub const LEAN: f64 = 4.0;

impl FacePair {
    /// The pair of two literals, if they lie on each other.
    pub fn of(bodies: &Bodies, alpha: Lit, beta: Lit) -> Option<Self> {
        let (tau, size) = (bodies.tau, bodies.size);
        let opposite = alpha.1.sense() != beta.1.sense();
        let (face_a, face_b) = (bodies.face(alpha), bodies.face(beta));
        if face_a.is_flat() && face_b.is_flat() {
            let ((a, normal_a), (b, normal_b)) = (bodies.slant(alpha, DVec3::ZERO), bodies.slant(beta, DVec3::ZERO));
            let lean = normal_a + normal_b;
            let tilt = lean.length();
            if tilt * size > LEAN * bodies.lie {
                return None;
            }
            // gap(x) = a(x) + b(x): both are distances from their bodies.
            let limit = (tilt * size > 0.25 * tau).then(|| (lean / tilt, (tau - a - b) / tilt));
            return Some(Self { alpha, beta, limit });
        }
        let found = face_a.deviation(face_b, size).is_some_and(|d| d <= tau);
        (found && opposite).then_some(Self { alpha, beta, limit: None })
    }

    /// Feet of a point on both faces, and the normal from A to B.
    pub fn feet(&self, bodies: &Bodies, x: DVec3) -> (DVec3, DVec3, DVec3) {
        (bodies.foot(self.alpha, x), bodies.foot(self.beta, x), bodies.slant_out(self.alpha, x).1)
    }

    /// Separation of the faces at a point.
    pub fn gap(&self, bodies: &Bodies, x: DVec3) -> f64 {
        let (a, b, n) = self.feet(bodies, x);
        (b - a).dot(n)
    }

    /// Half way between the faces: value and gradient.
    pub fn middle(&self, bodies: &Bodies, x: DVec3) -> (f64, DVec3) {
        let ((a, normal_a), (b, normal_b)) = (bodies.slant_out(self.alpha, x), bodies.slant_out(self.beta, x));
        (0.5 * (a - b), (normal_a - normal_b) * 0.5)
    }
}

/// What a point of the common surface is to the patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    Outside,
    Inside,
    /// On the boundary, which goes straight on.
    Boundary,
    Corner,
}

/// Faces of both bodies that pass through a point of a patch, usually: as many need no memory of their own.
const FEW: usize = 8;

/// A literal's part in the tangent plane of a point.
struct SurfacePart {
    side: Side,
    id: LiteralId,
    at: At,
    /// Its gradient within the tangent plane; zero where it is tangent to the surface.
    across: DVec3,
}

/// The surroundings of a point in the tangent plane of a pair's surface: which directions lead into the patch.
struct Around<'t> {
    /// Normal of the surface.
    normal: DVec3,
    surface: At,
    parts: &'t [SurfacePart],
    /// Where faces lean against each other and the point lies on the end of their half-space: its normal, outwards.
    limit: Option<DVec3>,
    /// What is open of both bodies there.
    open: [&'t [Token]; 2],
    size: f64,
}

impl Around<'_> {
    /// True where a step in the direction `d` stays in the patch.
    fn holds(&self, d: DVec3) -> bool {
        if self.limit.is_some_and(|m| m.dot(d) > 0.0) {
            return false;
        }
        let sign = |side: Side, id: LiteralId| {
            let Some(p) = self.parts.iter().find(|p| (p.side, p.id) == (side, id)) else { return false };
            if p.across != DVec3::ZERO {
                return p.across.dot(d) < 0.0;
            }
            // Tangent: how it bends away from the surface, then on which side of it the body lies.
            let surface = &self.surface;
            let bend = d.dot(p.at.hessian * d) - p.at.normal.dot(surface.normal) * d.dot(surface.hessian * d);
            if bend.abs() * self.size > 1e-6 {
                return bend < 0.0;
            }
            let into = if side == Side::A { -1.0 } else { 1.0 };
            into * p.at.normal.dot(self.normal) < 0.0
        };
        holds(self.open[0], &mut |id| sign(Side::A, id)) && holds(self.open[1], &mut |id| sign(Side::B, id))
    }

    /// What the point is to the patch: by the sectors between the lines in which the parts cut the tangent plane.
    fn standing(&self) -> Standing {
        let mut cutting = self.parts.iter().filter(|p| p.across != DVec3::ZERO);
        if let (Some(part), None, None) = (cutting.next(), cutting.next(), self.limit) {
            // One line alone: two halves, as beside the rim of a face.
            return match [part.across, -part.across].map(|d| self.holds(d)) {
                [true, true] => Standing::Inside,
                [false, false] => Standing::Outside,
                _ => Standing::Boundary,
            };
        }
        let n = self.normal;
        let e1 = any_perpendicular(n);
        let e2 = n.cross(e1);
        let angle = |d: DVec3| d.dot(e2).atan2(d.dot(e1)).rem_euclid(TAU);
        let mut cuts: SmallVec<[(f64, Option<usize>); 2 * FEW]> = SmallVec::new();
        for (i, part) in self.parts.iter().enumerate().filter(|(_, p)| p.across != DVec3::ZERO) {
            let t = n.cross(part.across);
            cuts.extend([(angle(t), Some(i)), (angle(-t), Some(i))]);
        }
        if let Some(m) = self.limit {
            let t = n.cross(m);
            cuts.extend([(angle(t), None), (angle(-t), None)]);
        }
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        cuts.dedup_by(|b, a| b.0 - a.0 <= ANGLE);
        if cuts.is_empty() {
            return if self.holds(e1) { Standing::Inside } else { Standing::Outside };
        }
        let count = cuts.len();
        let inside: SmallVec<[bool; 2 * FEW]> = (0..count)
            .map(|i| {
                let (from, to) = (cuts[i].0, if i + 1 < count { cuts[i + 1].0 } else { cuts[0].0 + TAU });
                let (s, c) = libm::sincos(0.5 * (from + to));
                self.holds(e1 * c + e2 * s)
            })
            .collect();
        match inside.iter().filter(|i| **i).count() {
            0 => return Standing::Outside,
            n if n == count => return Standing::Inside,
            _ => {}
        }
        let turns: SmallVec<[&(f64, Option<usize>); 2 * FEW]> =
            (0..count).filter(|i| inside[*i] != inside[(*i + count - 1) % count]).map(|i| &cuts[i]).collect();
        let straight = turns.len() == 2 && ((turns[1].0 - turns[0].0) - PI).abs() <= 10.0 * ANGLE;
        // A line that runs into an arc: as straight, but another curve.
        let bend = |i: Option<usize>| {
            let Some(i) = i else { return 0.0 };
            let t = n.cross(self.parts[i].across);
            t.dot(self.parts[i].at.hessian * t)
        };
        let same = straight && (bend(turns[0].1) - bend(turns[1].1)).abs() * self.size <= 1e-6;
        if same { Standing::Boundary } else { Standing::Corner }
    }
}

/// What the point `x` of a pair's surface is to its patch.
pub fn standing(bodies: &Bodies, pair: &FacePair, x: DVec3) -> Standing {
    let (x_a, x_b, n) = pair.feet(bodies, x);
    // Deeper in each other, too, they are not the surfaces that touch: at a sharp rim planes pass that lie on each other nowhere.
    if (x_b - x_a).dot(n).abs() > bodies.tau * (1.0 + 1e-9) {
        return Standing::Outside;
    }
    let (truth_a, tokens_a) = bodies.open(Side::A, x_a);
    if truth_a != Truth::Open {
        return Standing::Outside;
    }
    let (truth_b, tokens_b) = bodies.open(Side::B, x_b);
    if truth_b != Truth::Open {
        return Standing::Outside;
    }
    let surface = bodies.look_out(pair.alpha, x_a);
    let mut parts: SmallVec<[SurfacePart; FEW]> = SmallVec::new();
    for (side, y, tokens) in [(Side::A, x_a, &tokens_a), (Side::B, x_b, &tokens_b)] {
        for id in each_once(tokens) {
            let at = bodies.look_out((side, id), y);
            let across = at.normal - n * at.normal.dot(n);
            // Leaning faces of a pair count as parallel.
            let flat = ANGLE.max(2.0 * LEAN * bodies.lie / bodies.size);
            let across = if across.length() <= flat { DVec3::ZERO } else { across.normalize() };
            parts.push(SurfacePart { side, id, at, across });
        }
    }
    let limit = pair.limit.map(|(m, offset)| ((m - n * m.dot(n)).normalize_or_zero(), m.dot(x) - offset));
    let at_limit = |v: f64| v.abs() <= bodies.eps / (bodies.tau / bodies.size).min(1.0);
    if limit.is_some_and(|(_, v)| v > 0.0 && !at_limit(v)) {
        return Standing::Outside;
    }
    let limit = limit.filter(|(_, v)| at_limit(*v)).map(|(m, _)| m);
    Around { normal: n, surface, parts: &parts, limit, open: [&tokens_a, &tokens_b], size: bodies.size }.standing()
}

/// The literals of a list by surface: the first one that coincides with each stands for it.
pub fn same_surface(bodies: &Bodies, p: Lit, q: Lit) -> bool {
    if p == q {
        return true;
    }
    let near = |d: f64| d <= bodies.eps;
    let size = bodies.size;
    if p.0 != q.0 {
        return false;
    }
    let (face_p, face_q) = (bodies.face(p), bodies.face(q));
    if face_p.is_flat() && face_q.is_flat() {
        // Planes of either sense, by how they look out of the body.
        let ((a, normal_a), (b, normal_b)) = (bodies.slant(p, DVec3::ZERO), bodies.slant(q, DVec3::ZERO));
        return near((normal_a - normal_b).length() * size) && near((a - b).abs());
    }
    p.1.sense() == q.1.sense() && face_p.difference(face_q, size).is_some_and(near)
}

/// The axis about which the curve of two faces is symmetric, if it has one, or a line through the middle of an ellipse: a point, a
/// direction, and a perpendicular that moves with the body.
pub fn axis_of_curve(bodies: &Bodies, p: Lit, q: Lit) -> Option<(DVec3, DVec3, DVec3)> {
    let other = bodies.face(q);
    let (origin, axis, side) = match (bodies.face(p).symmetry(), other.symmetry()) {
        (Symmetry::None, Symmetry::Normal(normal)) => {
            let Axis { origin, direction } = bodies.face(p).skewer(normal)?;
            (origin, direction, p.0)
        }
        (Symmetry::Normal(_), Symmetry::None) => return axis_of_curve(bodies, q, p),
        (Symmetry::None, _) | (_, Symmetry::None) => return None,
        (Symmetry::Axis(Axis { origin, direction }), like) => {
            let skewer = match like {
                Symmetry::Normal(normal) => bodies.face(p).skewer(normal),
                Symmetry::Axis(_) | Symmetry::Center(_) | Symmetry::None => None,
            };
            match skewer {
                // The axis is not what the curve goes around.
                Some(skewer) => (skewer.origin, skewer.direction, p.0),
                None if other.slides_along(direction, 1e-6) => return None,
                None => (origin, direction, p.0),
            }
        }
        (Symmetry::Center(center), Symmetry::Normal(normal)) => (center, normal, p.0),
        (Symmetry::Center(center), Symmetry::Center(other)) => (center, (other - center).try_normalize()?, p.0),
        (Symmetry::Center(_) | Symmetry::Normal(_), Symmetry::Axis(_)) | (Symmetry::Normal(_), Symmetry::Center(_)) => {
            return axis_of_curve(bodies, q, p);
        }
        (Symmetry::Normal(_), Symmetry::Normal(_)) => return None,
    };
    Some((origin, axis, bodies.material(side, axis)))
}

/// True for a face that bends outwards from its body.
pub fn is_convex(lit: Lit) -> bool {
    lit.1.sense() == Sense::Positive
}
