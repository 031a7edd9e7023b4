//! The two solids around one point: which faces pass there, what is solid in which direction, what kind of feature it is.
//!
//! Everything stands along A's axes at one instant; B's faces are carried there once. A literal within `eps` of a point
//! passes through it; how it looks from there is read off its gradient and Hessian, not from points nearby.

use crate::contact::exclusion::literal::Side;
use crate::contact::instant::work::Work;
use crate::contact::query::task::Task;
use crate::contact::witness::newton;
use crate::motion::Instant;
use crate::solid::local::{self, Expression, LiteralId, Token, Truth};
use crate::solid::{Face, Sense, Solid};
use glam::{DMat3, DVec3};
use smallvec::{SmallVec, smallvec};
use std::cell::OnceCell;

/// Gradients within this angle are parallel.
pub const ANGLE: f64 = 1e-7;

/// Largest separation, in diameters of the smaller body, at which surfaces are said to touch in regions. From farther away
/// all of a body is near: there one place counts, the nearest.
pub const REACH: f64 = 0.125;
/// Tokens for which there is room from the start in what is open at a point: few faces pass there.
const ROOM: usize = 16;
/// Largest deviation, in the same unit, with which they lie along each other.
const LIE: f64 = 0.01;

/// Both bodies at an instant.
pub struct Bodies<'t, 'a> {
    pub task: &'t Task<'a>,
    pub at: &'t Instant,
    /// Separation up to which surfaces touch.
    pub tau: f64,
    /// Deviation up to which curves and faces lie along each other: the same, but small against the bodies.
    pub lie: f64,
    /// A face nearer to a point than this passes through it: some hundred roundings.
    pub eps: f64,
    /// Diameter of the smaller body.
    pub size: f64,
    /// B's faces in A's frame.
    faces_b: Carried,
    /// Every look at a face counts.
    pub work: &'t Work,
}

/// A literal at a point: value, gradient, Hessian, with its sign.
#[derive(Clone, Copy, Debug)]
pub struct At {
    pub value: f64,
    pub normal: DVec3,
    pub hessian: DMat3,
    /// Length of the gradient.
    pub slope: f64,
}

/// A literal of one of the bodies.
pub type Lit = (Side, LiteralId);

/// B's faces in A's frame: those of large meshes some at a time, when one of them is looked at.
struct Carried {
    listed: Vec<Face>,
    made: Vec<OnceCell<Box<[Face]>>>,
}

impl Carried {
    /// Faces that are carried at a time.
    const TOGETHER: usize = 64;

    fn of<'f>(at: &Instant, faces: impl Iterator<Item = &'f Face>) -> Vec<Face> {
        faces.map(|f| f.moved(|x| at.a_point(x), |v| at.a_vector(v))).collect()
    }

    fn new(solid: &Solid, at: &Instant) -> Self {
        let listed = Self::of(at, solid.faces.listed().iter());
        let made = vec![OnceCell::new(); (solid.faces.len() - listed.len()).div_ceil(Self::TOGETHER)];
        Self { listed, made }
    }

    #[inline]
    fn face(&self, solid: &Solid, at: &Instant, id: usize) -> &Face {
        match self.listed.get(id) {
            Some(face) => face,
            None => self.made(solid, at, id - self.listed.len()),
        }
    }

    /// A face behind those that are listed.
    fn made(&self, solid: &Solid, at: &Instant, i: usize) -> &Face {
        let chunk = self.made[i / Self::TOGETHER].get_or_init(|| {
            let from = self.listed.len() + i / Self::TOGETHER * Self::TOGETHER;
            let all = from..(from + Self::TOGETHER).min(solid.faces.len());
            Self::of(at, all.map(|f| &solid.faces[f])).into()
        });
        &chunk[i % Self::TOGETHER]
    }
}

impl<'t, 'a> Bodies<'t, 'a> {
    /// Separations up to `tau` count, and up to `REACH`.
    pub fn new(task: &'t Task<'a>, at: &'t Instant, tau: f64, work: &'t Work) -> Self {
        let size = 2.0 * task.model_a.radius.min(task.model_b.radius);
        Self {
            task,
            at,
            tau: tau.min(REACH * size),
            lie: tau.min(LIE * size),
            eps: 256.0 * task.rounding,
            size,
            faces_b: Carried::new(task.b, at),
            work,
        }
    }

    /// The face of a literal, in A's frame.
    #[inline]
    pub fn face(&self, (side, id): Lit) -> &Face {
        match side {
            Side::A => &self.task.a.faces[id.face() as usize],
            Side::B => self.faces_b.face(self.task.b, self.at, id.face() as usize),
        }
    }

    /// A literal at a point.
    pub fn look(&self, lit: Lit, x: DVec3) -> At {
        self.work.look(1);
        let face = self.face(lit);
        let f = face.at(x);
        let sign = sign(lit);
        At {
            value: f.value * sign,
            normal: f.normal * sign,
            hessian: newton::hessian_at(face, x, &f) * sign,
            slope: f.slope,
        }
    }

    /// A literal's value and gradient at a point: the same as `look` tells of them, for who has no use for the rest.
    #[inline]
    pub fn slant(&self, lit: Lit, x: DVec3) -> (f64, DVec3) {
        self.work.look(1);
        let f = self.face(lit).at(x);
        let sign = sign(lit);
        (f.value * sign, f.normal * sign)
    }

    /// The same with the Hessian, `None` for that of a flat face.
    pub fn bent(&self, lit: Lit, x: DVec3) -> (f64, DVec3, Option<DMat3>) {
        if self.face(lit).is_flat() {
            let (value, normal) = self.slant(lit, x);
            return (value, normal, None);
        }
        let at = self.look(lit, x);
        (at.value, at.normal, Some(at.hessian))
    }

    /// The same as `look_out` tells of them.
    #[inline]
    pub fn slant_out(&self, lit: Lit, x: DVec3) -> (f64, DVec3) {
        self.work.look(1);
        let f = self.face(lit).at(x);
        let sign = sign(lit);
        let (value, normal) = (f.value * sign, f.normal * sign);
        if f.slope == 1.0 {
            return (value, normal);
        }
        let by = 1.0 / f.slope;
        (value * by, normal * by)
    }

    /// The same as a distance, next to the surface: all over the length of the gradient, which is then a unit vector.
    pub fn look_out(&self, lit: Lit, x: DVec3) -> At {
        let at = self.look(lit, x);
        if at.slope == 1.0 {
            return at;
        }
        let by = 1.0 / at.slope;
        At { value: at.value * by, normal: at.normal * by, hessian: at.hessian * by, slope: 1.0 }
    }

    /// A literal's value at a point.
    #[inline]
    pub fn value(&self, lit: Lit, x: DVec3) -> f64 {
        self.work.look(1);
        let v = self.face(lit).value(x);
        if lit.1.sense() == Sense::Positive { v } else { -v }
    }

    /// f of one body.
    pub fn f(&self, side: Side, x: DVec3) -> f64 {
        let (solid, y) = match side {
            Side::A => (self.task.a, x),
            Side::B => (self.task.b, self.at.b_point(x)),
        };
        self.work.look(solid.faces.len());
        solid.value(y)
    }

    /// Bounds of a face's psi over a box.
    pub fn span(&self, face: &Face, center: DVec3, half: DVec3) -> local::Span {
        self.work.look(1);
        local::face_span(face, center, half)
    }

    /// The point of a literal's surface next to `x`.
    pub fn foot(&self, lit: Lit, mut x: DVec3) -> DVec3 {
        for _ in 0..3 {
            let (value, normal) = self.slant_out(lit, x);
            let from = x;
            x -= normal * value;
            if x == from {
                break;
            }
        }
        x
    }

    /// A perpendicular of `axis` that is fixed in a body: the same material direction however the body moves.
    pub fn material(&self, side: Side, axis: DVec3) -> DVec3 {
        let own = if side == Side::A { axis } else { self.at.b_from_a * axis };
        // Rounding must not choose between axes of equal rank.
        let e = DVec3::AXES[(own.abs() * 1e6).round().min_position()];
        let u = if side == Side::A { e } else { self.at.a_vector(e) };
        (u - axis * u.dot(axis)).normalize()
    }

    /// What of a body's tree is open at a point, literals through it alone.
    pub fn open(&self, side: Side, x: DVec3) -> (Truth, Vec<Token>) {
        let solid = if side == Side::A { self.task.a } else { self.task.b };
        self.work.look(solid.faces.len());
        let mut out = Vec::with_capacity(solid.normal_form.len().min(ROOM));
        let mut truth_of = |id: LiteralId| {
            let v = self.face((side, id)).value(x);
            local::truth_of(id.sense(), (v, v), 0.0, self.eps)
        };
        // Of a polytope those faces that a point is well below hold there, and fold away unseen.
        let own = if side == Side::A { x } else { self.at.b_point(x) };
        let whole = solid.whole().filter(|whole| whole.is_convex());
        let some = whole.and_then(|p| Some((p.first_face, p.not_below(own, -2.0 * self.eps)?)));
        let truth = match some {
            None => solid.prune(&solid.normal_form, &mut out, &mut truth_of),
            Some((first, faces)) => local::fold(local::AND, faces.into_iter(), &mut out, |face, out| {
                let id = LiteralId::new(first + face, Sense::Positive);
                let known = truth_of(id);
                if known == Truth::Open {
                    out.push(local::literal_token(id));
                }
                known
            }),
        };
        (truth, out)
    }

    /// The literals through a point, each once.
    pub fn through(&self, side: Side, x: DVec3) -> SmallVec<[LiteralId; ROOM]> {
        each_once(&self.open(side, x).1)
    }

    /// Direction in which a literal rises at `x`; away from the cone along the axis at an apex, and whether it is one.
    pub fn rise(&self, lit: Lit, x: DVec3) -> (DVec3, bool) {
        match self.face(lit).apex().filter(|apex| (x - apex.point).length() <= self.eps) {
            Some(apex) => (if lit.1.sense() == Sense::Positive { -apex.axis } else { apex.axis }, true),
            None => (self.slant_out(lit, x).1, false),
        }
    }

    /// 1 on a face of a body, 2 on an edge, 3 at a vertex: dimensions that the normals of the faces through `x` span.
    pub fn rank(&self, side: Side, x: DVec3) -> usize {
        let mut span: SmallVec<[DVec3; 3]> = SmallVec::new();
        for id in self.through(side, x) {
            let (g, is_apex) = self.rise((side, id), x);
            if is_apex {
                return 3;
            }
            let r = span.iter().fold(g, |r, e| r - *e * e.dot(r));
            if r.length() > 1e-6 && span.len() < 3 {
                span.push(r.normalize());
            }
        }
        span.len().max(1)
    }

    /// The sum of the normals of the faces through `x`, as the paper averages them.
    pub fn average(&self, side: Side, x: DVec3) -> DVec3 {
        self.through(side, x).iter().map(|id| self.rise((side, *id), x).0).sum::<DVec3>().normalize_or_zero()
    }

    /// True when `x` is a limit of interior points of a body: no skin without volume passes for a surface. Some
    /// direction must lower all literals of a clause.
    pub fn is_bodily(&self, side: Side, x: DVec3) -> bool {
        let (truth, tokens) = self.open(side, x);
        if truth != Truth::Open {
            return truth == Truth::True;
        }
        clauses(&tokens).iter().any(|clause| {
            let rises: SmallVec<[DVec3; FEW]> = clause.iter().map(|id| self.rise((side, *id), x).0).collect();
            has_descent(&rises, 1e-6)
        })
    }
}

/// The sign with which a literal takes its face's psi.
#[inline]
pub fn sign(lit: Lit) -> f64 {
    if lit.1.sense() == Sense::Positive { 1.0 } else { -1.0 }
}

/// The literals of an expression, each once, in order.
pub fn each_once(tokens: &[Token]) -> SmallVec<[LiteralId; ROOM]> {
    let mut ids: SmallVec<[LiteralId; ROOM]> = local::literals(tokens).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// Gradients up to which `has_descent` tries every direction that can be the best one.
const FEW: usize = 6;

/// True when a unit direction is found along which every one of some gradients falls by `least` or more. Then no combination of
/// them (weights >= 0, sum 1) is shorter than that: the direction that falls most is the opposite of their hull's point next to
/// the origin (E. G. Gilbert, D. W. Johnson, S. S. Keerthi 1988), which one, two or three of them span.
pub fn has_descent(gradients: &[DVec3], least: f64) -> bool {
    let falls = |p: DVec3| {
        let d = p.normalize_or_zero();
        gradients.iter().all(|g| g.dot(d) >= least)
    };
    if falls(gradients.iter().sum()) {
        return true;
    }
    if gradients.len() > FEW {
        return falls_by_turns(gradients, least);
    }
    for (i, &p) in gradients.iter().enumerate() {
        if falls(p) {
            return true;
        }
        for (j, &q) in gradients.iter().enumerate().skip(i + 1) {
            // Next to the origin on the line through p and q, and in the plane through a third one.
            let way = q - p;
            if falls(p * way.length_squared() - way * p.dot(way)) {
                return true;
            }
            for &r in &gradients[j + 1..] {
                let n = way.cross(r - p);
                if falls(n * p.dot(n)) {
                    return true;
                }
            }
        }
    }
    false
}

/// The same of many, by the perceptron's rule: one that it does not find may be there.
fn falls_by_turns(gradients: &[DVec3], least: f64) -> bool {
    let mut d = -gradients.iter().copied().sum::<DVec3>();
    for _ in 0..64 {
        d = d.normalize_or_zero();
        match gradients.iter().max_by(|g, h| g.dot(d).total_cmp(&h.dot(d))) {
            Some(g) if g.dot(d) > -least => d -= *g * (g.dot(d) + 0.1),
            _ => return true,
        }
    }
    false
}

/// An alternative of an expression, and all of them.
type Clause = SmallVec<[LiteralId; FEW]>;
type Clauses = SmallVec<[Clause; 1]>;

/// The alternatives of an expression, each a set of literals that must hold together; the first few of many.
fn clauses(tokens: &[Token]) -> Clauses {
    const MOST: usize = 64;
    fn of(e: Expression<'_>) -> Clauses {
        match e {
            Expression::Literal(id) => smallvec![smallvec![id]],
            Expression::Part(_) => smallvec![Clause::new()],
            Expression::Or(body) => local::operands(body).flat_map(of).take(MOST).collect(),
            Expression::And(body) => local::operands(body).fold(smallvec![Clause::new()], |mut all: Clauses, e| {
                if let Expression::Literal(id) = e {
                    all.iter_mut().for_each(|clause| clause.push(id));
                    return all;
                }
                let one = of(e);
                let joined = |left: &Clause, right: &Clause| left.iter().chain(right).copied().collect::<Clause>();
                all.iter().flat_map(|left| one.iter().map(move |right| joined(left, right))).take(MOST).collect()
            }),
        }
    }
    of(local::first(tokens).0)
}

/// True when an expression holds given the truth of its literals.
pub fn holds(tokens: &[Token], truth: &mut impl FnMut(LiteralId) -> bool) -> bool {
    fn of(e: Expression<'_>, truth: &mut impl FnMut(LiteralId) -> bool) -> bool {
        match e {
            Expression::Literal(id) => truth(id),
            Expression::Part(_) => true,
            Expression::And(body) => local::operands(body).all(|e| of(e, truth)),
            Expression::Or(body) => local::operands(body).any(|e| of(e, truth)),
        }
    }
    of(local::first(tokens).0, truth)
}

#[cfg(test)]
mod tests {
    use super::has_descent;
    use crate::math::random::Random;
    use glam::DVec3;

    #[test]
    fn a_common_descent_is_found_where_there_is_one() {
        // Directions spread evenly (a Fibonacci lattice on the sphere), about .03 from each other.
        let all: Vec<DVec3> = (0..12_000)
            .map(|k| {
                let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 12_000.0;
                let (s, c) = (f64::from(k) * 2.399_963_229_728_653).sin_cos();
                DVec3::new(c, s, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
            })
            .collect();
        let mut r = Random(0x0066_616c_6c73);
        let mut counts = [0; 2];
        for i in 0..600 {
            let mut draw = || DVec3::from_array(std::array::from_fn(|_| r.within(-1.0, 1.0))).normalize();
            let mut gradients: Vec<DVec3> = (0..2 + i % 4).map(|_| draw()).collect();
            if i % 3 == 0 {
                // Opposite but for a little.
                gradients[1] = (draw() * 0.05 - gradients[0]).normalize();
            }
            let least = [1e-6, 0.02, 0.3, 0.8][i / 5 % 4];
            let best = all.iter().map(|d| gradients.iter().map(|g| g.dot(*d)).fold(f64::INFINITY, f64::min));
            let best = best.fold(f64::NEG_INFINITY, f64::max);
            let has = has_descent(&gradients, least);
            counts[usize::from(has)] += 1;
            assert!(if has { best >= least - 0.04 } else { best < least }, "{i}: {has}, {best} for {least}");
        }
        assert!(counts.iter().all(|n| *n > 100), "{counts:?}");
    }
}
