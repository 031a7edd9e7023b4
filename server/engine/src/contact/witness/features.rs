//! Which faces two bodies show at a point of contact: what is told of it is told of these.
//!
//! A solution of the contact's equations is confirmed by the values of both trees alone. Where faces of several
//! primitives lie in one plane, or the plane of a subtracted one's face passes by far from its cube, a literal of the
//! solution may have the right value and yet decide nothing there. A face is *active* at a point if it passes through
//! it and f depends on it there: the tree's literals are folded by what is known of them at the point
//! (`Model::literals_at`), and of the open rest those count that the expression depends on (`dependence`), faces of one
//! tangent plane counting as one. So neither a satisfied alternative of a complement is active nor the side of a body whose end lies
//! flush in another's; and of faces in one plane none that another one always precedes.

use super::dependence::{self, Literals, ONE_PLANE};
use super::newton::{Constraint, cholesky_solve};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::local::{self, LiteralId, Truth};
use crate::solid::surface::Apex;
use crate::solid::{Face, Sense};
use glam::DVec3;
use smallvec::SmallVec;

/// Tokens of most points: what passes there are a few faces.
const FEW: usize = 16;

/// Both bodies at a point of contact.
pub struct Features<'t, 'a> {
    task: &'t Task<'a>,
    x: DVec3,
    at: &'t Instant,
    tolerance: f64,
    /// The active faces of A and of B; empty where a body has no surface there.
    pub active: [Literals; 2],
}

/// What was found at a point and an instant, kept for whoever asks for it there again.
#[derive(Clone, Debug)]
pub struct Seen {
    x: DVec3,
    t: f64,
    tolerance: f64,
    active: [Literals; 2],
}

/// What is left of the gradients' weighted sum where they hold each other.
const BALANCED: f64 = 1e-9;

/// The same where rounding has turned them: still a contact's.
const NEARLY_BALANCED: f64 = 1e-5;

impl<'t, 'a> Features<'t, 'a> {
    /// The faces within `tolerance` (a length) of x (A's frame) at an instant; none are known without one.
    pub fn at(task: &'t Task<'a>, x: DVec3, at: &'t Instant, tolerance: Option<f64>) -> Self {
        let Some(tolerance) = tolerance else {
            return Self { task, x, at, tolerance: 0.0, active: Default::default() };
        };
        let mut spot = Self { task, x, at, tolerance, active: Default::default() };
        spot.active = [Side::A, Side::B].map(|side| spot.active_within(side, tolerance));
        // Where the apex of a slender cone is told the faces of the other body are told that pass as near as it does.
        for (side, other) in [(Side::A, Side::B), (Side::B, Side::A)] {
            let off = spot.off_apexes(side);
            if off > tolerance && !spot.active[other as usize].is_empty() {
                spot.active[other as usize] = spot.active_within(other, off);
            }
        }
        spot
    }

    /// The same as `at`, or what is kept of it where that was asked before.
    pub fn again(task: &'t Task<'a>, x: DVec3, at: &'t Instant, tolerance: f64, seen: Option<&Seen>) -> Self {
        match seen.filter(|seen| (seen.x, seen.t, seen.tolerance) == (x, at.t, tolerance)) {
            Some(seen) => Self { task, x, at, tolerance, active: seen.active.clone() },
            None => Self::at(task, x, at, Some(tolerance)),
        }
    }

    /// What is kept of it.
    pub fn seen(self) -> Seen {
        Seen { x: self.x, t: self.at.t, tolerance: self.tolerance, active: self.active }
    }

    /// The active faces of one side among those within `tolerance` of the point.
    fn active_within(&self, side: Side, tolerance: f64) -> Literals {
        let (task, y) = (self.task, if side == Side::A { self.x } else { self.at.b_point(self.x) });
        let (model, mut open) = (if side == Side::A { task.model_a } else { task.model_b }, Vec::with_capacity(FEW));
        if model.literals_at(y, tolerance, &mut open) != Truth::Open {
            return Literals::new();
        }
        let face = |id: LiteralId| &model.solid.faces[id.face() as usize];
        let is_apex = |id| face(id).apex().is_some_and(|apex| passes(&apex, y, tolerance));
        dependence::active(&open, |id| normal(face(id), id, y), local::literals(&open).any(is_apex))
    }

    /// How far the farthest apex lies that counts as passing through the point; 0 without one.
    fn off_apexes(&self, side: Side) -> f64 {
        let apexes = self.active[side as usize].iter().filter_map(|id| {
            let (face, y) = self.face(side, *id);
            face.apex().filter(|apex| self.is_at(apex, y)).map(|apex| (y - apex.point).length())
        });
        apexes.fold(0.0, f64::max)
    }

    fn face(&self, side: Side, id: LiteralId) -> (&'a Face, DVec3) {
        let (solid, y) = if side == Side::A { (self.task.a, self.x) } else { (self.task.b, self.at.b_point(self.x)) };
        (&solid.faces[id.face() as usize], y)
    }

    /// True when a literal is active.
    pub fn has(&self, side: Side, id: LiteralId) -> bool {
        self.active[side as usize].contains(&id)
    }

    /// The unit vector along a literal's gradient at the point, along A's axes.
    pub fn gradient(&self, side: Side, id: LiteralId) -> DVec3 {
        let (face, y) = self.face(side, id);
        let n = normal(face, id, y);
        if side == Side::A { n } else { self.at.a_vector(n) }
    }

    /// The outward normal of a literal's face at the point, along its own body's axes; at an apex against the cone's axis.
    pub fn normal(&self, side: Side, id: LiteralId) -> DVec3 {
        let (face, y) = self.face(side, id);
        match face.apex().filter(|apex| self.is_at(apex, y)) {
            Some(apex) => -apex.axis,
            None => face.unit_normal(y),
        }
    }

    /// A direction of B's own axes along A's.
    pub fn turned(&self, direction: DVec3) -> DVec3 {
        self.at.a_vector(direction)
    }

    /// True when an active cone has its apex at the point: every face that passes there comes as near to the apex of a slender cone as
    /// the tolerance over sin α.
    pub fn is_apex(&self, side: Side, id: LiteralId) -> bool {
        let (face, y) = self.face(side, id);
        face.apex().is_some_and(|apex| self.is_at(&apex, y))
    }

    fn is_at(&self, apex: &Apex, y: DVec3) -> bool {
        passes(apex, y, self.tolerance)
    }

    /// The active face of `side` that lies in the tangent plane of another face there.
    pub fn in_plane_of(&self, side: Side, id: LiteralId) -> Option<LiteralId> {
        let gradient = self.gradient(side, id);
        let mut active = self.active[side as usize].iter().copied();
        active.find(|other| (self.gradient(side, *other) - gradient).length() <= ONE_PLANE)
    }

    /// What holds the bodies at the point, as few active faces as there are, with their multipliers.
    pub fn held(&self) -> Option<Vec<(Constraint, f64)>> {
        let each = self.smooth();
        let by_faces = held_by_faces(&each).filter(|held| held.0 <= NEARLY_BALANCED).map(|held| held.1);
        by_faces.or_else(|| self.held_by_an_apex(&each))
    }

    /// True when active faces of both bodies oppose each other, up to what is left of their gradients' weighted sum, or
    /// an apex holds.
    pub fn is_balanced(&self, within: f64) -> bool {
        let each = self.smooth();
        held_by_faces(&each).is_some_and(|held| held.0 <= within) || self.held_by_an_apex(&each).is_some()
    }

    /// The active faces of either side that have a gradient at the point, with it.
    fn smooth(&self) -> [Vec<(Side, LiteralId, DVec3)>; 2] {
        [Side::A, Side::B].map(|side| {
            let ids = self.active[side as usize].iter();
            let smooth = ids.filter(|id| !self.is_apex(side, **id));
            smooth.map(|id| (side, *id, self.gradient(side, *id))).collect::<Vec<_>>()
        })
    }

    /// An apex of one body against faces of the other: of the directions between these faces' normals the one that is
    /// nearest to the apex' axis, if it lies in its normal cone.
    fn held_by_an_apex(&self, each: &[Vec<(Side, LiteralId, DVec3)>; 2]) -> Option<Vec<(Constraint, f64)>> {
        for (side, faces) in [(Side::A, &each[1]), (Side::B, &each[0])] {
            let ids = self.active[side as usize].iter();
            for id in ids.filter(|id| id.sense() == Sense::Positive && self.is_apex(side, **id)) {
                let (face, _) = self.face(side, *id);
                let Some(apex) = face.apex() else { continue };
                let turned = |v: DVec3| if side == Side::A { v } else { self.at.a_vector(v) };
                let outward = turned(-apex.axis);
                let mut best: Option<(f64, Vec<(Constraint, f64)>, DVec3)> = None;
                for set in (1..=2).flat_map(|count| choices(faces, count)) {
                    let Some((weights, sum)) = towards(-outward, &set.iter().map(|f| f.2).collect::<Vec<_>>()) else {
                        continue;
                    };
                    let along = -sum.dot(outward);
                    if best.as_ref().is_none_or(|b| along > b.0 + BALANCED) {
                        let held = set.iter().map(|f| Constraint::Literal(f.0, f.1));
                        best = Some((along, held.zip(weights).collect(), sum));
                    }
                }
                let own = |v: DVec3| if side == Side::A { v } else { self.at.b_from_a * v };
                let holds = |b: &(f64, Vec<(Constraint, f64)>, DVec3)| apex.holds(own(-b.2), b.0, NEARLY_BALANCED);
                let Some((along, mut held, sum)) = best.filter(holds) else { continue };
                debug_assert!(along <= 1.0 + 1e-9);
                let directions = apex.directions();
                held.extend((0..3).map(|k| {
                    let plane = turned(directions[usize::from(k)]);
                    (Constraint::Apex(side, *id, k), -sum.dot(plane))
                }));
                return Some(held);
            }
        }
        None
    }
}

/// Active faces of both sides that hold each other best: what is left of their gradients' weighted sum, and their
/// multipliers (sum 1).
fn held_by_faces(each: &[Vec<(Side, LiteralId, DVec3)>; 2]) -> Option<(f64, Vec<(Constraint, f64)>)> {
    let mut best: Option<(f64, Vec<(Constraint, f64)>)> = None;
    for count in 2..=4usize {
        for all in sets(each, count) {
            let Some((lambda, rest)) = balance(&all.iter().map(|l| l.2).collect::<Vec<_>>()) else {
                continue;
            };
            if best.as_ref().is_none_or(|b| rest < 0.5 * b.0) {
                let held = all.iter().map(|l| Constraint::Literal(l.0, l.1));
                best = Some((rest, held.zip(lambda).collect()));
            }
        }
        if best.as_ref().is_some_and(|b| b.0 <= BALANCED) {
            break;
        }
    }
    best
}

/// All choices of `count` faces, some of either side.
fn sets(each: &[Vec<(Side, LiteralId, DVec3)>; 2], count: usize) -> Vec<Vec<(Side, LiteralId, DVec3)>> {
    let mut out = Vec::new();
    for of_a in 1..count {
        for p in choices(&each[0], of_a) {
            out.extend(choices(&each[1], count - of_a).iter().map(|q| p.iter().chain(q).copied().collect()));
        }
    }
    out
}

/// The unit vector between some unit vectors (one or two) that is nearest to a direction, with their weights in it.
fn towards(direction: DVec3, between: &[DVec3]) -> Option<(SmallVec<[f64; 2]>, DVec3)> {
    match *between {
        [g] => Some((SmallVec::from_slice(&[1.0]), g)),
        [g, h] => {
            let c = g.dot(h);
            let det = 1.0 - c * c;
            let (p, q) = (g.dot(direction), h.dot(direction));
            let weights = [(p - c * q) / det, (q - c * p) / det];
            let sum = g * weights[0] + h * weights[1];
            let length = sum.length();
            // Also false for what is not a number.
            (weights.iter().all(|w| *w > 0.0) && length > 0.0)
                .then(|| (weights.iter().map(|w| w / length).collect(), sum / length))
        }
        _ => None,
    }
}

/// All choices of `count` of some literals, in order.
fn choices<T: Copy>(all: &[T], count: usize) -> Vec<Vec<T>> {
    if count == 0 {
        return vec![vec![]];
    }
    let each = all.iter().enumerate();
    each.flat_map(|(i, first)| {
        let rest = choices(&all[i + 1..], count - 1);
        rest.into_iter().map(|mut rest| {
            rest.insert(0, *first);
            rest
        })
    })
    .collect()
}

/// The shortest vector Σ λ g with Σ λ = 1: the multipliers, none of them negative, and its length.
fn balance(gradients: &[DVec3]) -> Option<(SmallVec<[f64; 4]>, f64)> {
    let m = gradients.len();
    let mut gram = [[0.0; 4]; 4];
    for i in 0..m {
        for j in 0..m {
            gram[i][j] = gradients[i].dot(gradients[j]);
        }
        gram[i][i] += 1e-14;
    }
    let y = cholesky_solve(&mut gram, [1.0; 4], m)?;
    let sum: f64 = y[..m].iter().sum();
    let lambda: SmallVec<[f64; 4]> = y[..m].iter().map(|v| v / sum).collect();
    let rest = gradients.iter().zip(&lambda).map(|(g, l)| *g * *l).sum::<DVec3>().length();
    // Also false for what is not a number.
    lambda.iter().all(|l| *l >= 0.0).then_some((lambda, rest)).filter(|b| b.1.is_finite())
}

/// True when a cone's apex lies at a point, as near as every face that passes there within `tolerance` comes to it.
fn passes(apex: &Apex, y: DVec3, tolerance: f64) -> bool {
    (y - apex.point).length() * apex.sin <= tolerance
}

/// The unit normal of a literal at a point of its own body, along its gradient.
fn normal(face: &Face, id: LiteralId, y: DVec3) -> DVec3 {
    let n = face.unit_normal(y);
    if id.sense() == Sense::Positive { n } else { -n }
}
