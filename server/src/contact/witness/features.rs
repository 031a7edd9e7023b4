//! Which faces two bodies show at a point of contact: what is told of it is told of these.
//!
//! A solution of the contact's equations is confirmed by the values of both trees alone. Where faces of several
//! primitives lie in one plane, or the plane of a subtracted one's face passes by far from its cube, a literal of the
//! solution may have the right value and yet decide nothing there. A face is *active* at a point if it passes through
//! it and f depends on it there: the tree's literals are folded by what is known of them at the point
//! (`Model::literals_at`), and of the open rest those count that the expression depends on, faces of one tangent plane
//! counting as one. So neither a satisfied alternative of a complement is active nor the side of a body whose end lies
//! flush in another's; and of faces in one plane none that another one always precedes.

use super::newton::{Constraint, cholesky_solve};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::local::{self, Expression, LiteralId, Token, Truth};
use crate::solid::surface::Apex;
use crate::solid::{Face, Sense};
use glam::DVec3;
use smallvec::SmallVec;

/// The literals active on a side, in order.
pub type Literals = SmallVec<[LiteralId; 8]>;

/// Both bodies at a point of contact.
pub struct Features<'t, 'a> {
    task: &'t Task<'a>,
    x: DVec3,
    at: &'t Instant,
    tolerance: f64,
    /// The active faces of A and of B; empty where a body has no surface there.
    pub active: [Literals; 2],
}

/// Gradients closer than this are of one tangent plane.
const ONE_PLANE: f64 = 1e-9;

/// Most tangent planes at a point of which it is worked out on which of them f depends.
const MOST_PLANES: usize = 8;

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
        let active = [(Side::A, x), (Side::B, at.b_point(x))].map(|(side, y)| {
            let (model, mut open) = (if side == Side::A { task.model_a } else { task.model_b }, Vec::new());
            if model.literals_at(y, tolerance, &mut open) != Truth::Open {
                return Literals::new();
            }
            active(&open, |id| normal(&model.solid.faces[id.face() as usize], id, y))
        });
        Self { task, x, at, tolerance, active }
    }

    fn face(&self, side: Side, id: LiteralId) -> (&'a Face, DVec3) {
        let (solid, y) = if side == Side::A { (self.task.a, self.x) } else { (self.task.b, self.at.b_point(self.x)) };
        (&solid.faces[id.face() as usize], y)
    }

    /// True when a literal is active.
    pub fn has(&self, side: Side, id: LiteralId) -> bool {
        self.active[side as usize].contains(&id)
    }

    /// The gradient of a literal at the point, along A's axes.
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
            None => face.at(y).normal,
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
        (y - apex.point).length() * apex.sin <= self.tolerance
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
                let Some((along, mut held, sum)) = best.filter(|b| b.0 >= apex.sin - NEARLY_BALANCED) else { continue };
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
        for of_a in 1..count {
            for p in choices(&each[0], of_a) {
                for q in choices(&each[1], count - of_a) {
                    let all: Vec<_> = p.iter().chain(&q).copied().collect();
                    let Some((lambda, rest)) = balance(&all.iter().map(|l| l.2).collect::<Vec<_>>()) else {
                        continue;
                    };
                    if best.as_ref().is_none_or(|b| rest < 0.5 * b.0) {
                        let held = all.iter().map(|l| Constraint::Literal(l.0, l.1));
                        best = Some((rest, held.zip(lambda).collect()));
                    }
                }
            }
        }
        if best.as_ref().is_some_and(|b| b.0 <= BALANCED) {
            break;
        }
    }
    best
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

/// The gradient of a literal at a point of its own body.
fn normal(face: &Face, id: LiteralId, y: DVec3) -> DVec3 {
    let n = face.at(y).normal;
    if id.sense() == Sense::Positive { n } else { -n }
}

/// The literals that an open expression depends on, those of one gradient taken for one.
fn active(open: &[Token], gradient: impl Fn(LiteralId) -> DVec3) -> Literals {
    let mut ids: Literals = local::literals(open).collect();
    ids.sort_unstable();
    ids.dedup();
    // Of literals that are all alternatives, or all demanded, none can be left out.
    if is_flat(open) {
        return ids;
    }
    let mut planes: SmallVec<[DVec3; 8]> = SmallVec::new();
    let plane_of: SmallVec<[usize; 8]> = ids
        .iter()
        .map(|id| {
            let g = gradient(*id);
            planes.iter().position(|p| (*p - g).length() <= ONE_PLANE).unwrap_or_else(|| {
                planes.push(g);
                planes.len() - 1
            })
        })
        .collect();
    if planes.len() > MOST_PLANES {
        return ids;
    }
    let plane = |id: LiteralId| plane_of[ids.binary_search(&id).expect("a literal of the expression")];
    let worlds = || 0..1usize << planes.len();
    let table: Vec<bool> = worlds().map(|w| holds(open, &|id| w >> plane(id) & 1 == 1)).collect();
    let depends = |k: usize| worlds().any(|w| w >> k & 1 == 0 && table[w] != table[w | 1 << k]);
    // Of the faces in one plane those count that decide when they are the first or the last of it.
    let alone = |own: LiteralId| {
        let k = plane(own);
        worlds().any(|w| table[w] != holds(open, &|id| (w >> plane(id) & 1 == 1) != (id == own)) && depends(k))
    };
    let of_plane = |k: usize| ids.iter().zip(&plane_of).filter(move |(_, p)| **p == k).map(|(id, _)| *id);
    let mut kept = Literals::new();
    for k in (0..planes.len()).filter(|k| depends(*k)) {
        let before = kept.len();
        kept.extend(of_plane(k).filter(|id| alone(*id)));
        if kept.len() == before {
            kept.extend(of_plane(k));
        }
    }
    kept.sort_unstable();
    if kept.is_empty() { ids } else { kept }
}

/// True for a literal, and for an operator over literals alone.
fn is_flat(tokens: &[Token]) -> bool {
    match local::first(tokens).0 {
        Expression::Literal(_) => true,
        Expression::And(body) | Expression::Or(body) => {
            local::operands(body).all(|e| matches!(e, Expression::Literal(_)))
        }
    }
}

/// Truth of an expression from its literals'.
fn holds(tokens: &[Token], of: &dyn Fn(LiteralId) -> bool) -> bool {
    let (expression, _) = local::first(tokens);
    let each = |body: &[Token], all: bool| {
        let mut rest = body;
        while !rest.is_empty() {
            let n = local::first(rest).1;
            if holds(&rest[..n], of) != all {
                return !all;
            }
            rest = &rest[n..];
        }
        all
    };
    match expression {
        Expression::Literal(id) => of(id),
        Expression::And(body) => each(body, true),
        Expression::Or(body) => each(body, false),
    }
}
