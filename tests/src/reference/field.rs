//! f of a solid, written a second time: literals in negation normal form.
//!
//! A solid becomes min and max over literals ±psi in the object's frame: complements are pushed down to the faces by
//! De Morgan's laws, so that a subtracted primitive is the min of its −psi. Near a point most literals cannot decide f;
//! `clauses` lists what can, as alternatives (min) of conjunctions (max).

use crate::formula::{Formula, formula_of};
use contactd::solid::{Face, Node as TreeNode, NodeId, Op, Solid, surface};
use contactd_proto::Pose;
use glam::{DQuat, DVec2, DVec3};

/// One face with its sign: +psi of a positive primitive, −psi of a subtracted one.
#[derive(Clone, Copy, Debug)]
pub struct Literal {
    /// The face, in the object's frame.
    pub face: Face,
    /// +1 or −1.
    pub sign: f64,
    /// Index of the primitive that owns the face.
    pub owner: u32,
}

impl Literal {
    /// Value at `x`.
    pub fn value(&self, x: DVec3) -> f64 {
        self.sign
            * match self.face {
                Face::Plane(surface::Plane { normal, offset }) => normal.dot(x) - offset,
                Face::Sphere(surface::Sphere { center, radius }) => center.distance(x) - radius,
                Face::Cylinder(surface::Cylinder { origin, axis, radius }) => axis.cross(x - origin).length() - radius,
                Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
                    axis.cross(x - apex).length() * cos - axis.dot(x - apex) * sin
                }
                Face::Torus(surface::Torus { origin, axis, major, minor }) => {
                    (axis.cross(x - origin).length() - major).hypot(axis.dot(x - origin)) - minor
                }
                Face::Capsule(surface::Capsule { origin, axis, half, radius }) => {
                    let along = axis.dot(x - origin).clamp(-half, half);
                    x.distance(origin + axis * along) - radius
                }
                Face::Elliptic(e) => Image::of(&e).value(x),
                Face::Bowl(b) => Image::of_bowl(&b).value(x),
                Face::Superellipsoid(s) => Ball::of(&s).value(x),
                Face::Saddle(s) => {
                    let [p, n] = Ridge::of(&s).halves(x);
                    p.length() - n.length()
                }
            }
    }

    /// Gradient at `x` (some one-sided one where there is none).
    pub fn gradient(&self, x: DVec3) -> DVec3 {
        let across = |o: DVec3, a: DVec3| (a.cross(x - o)).cross(a).normalize_or(a.any_orthonormal_vector());
        self.sign
            * match self.face {
                Face::Plane(surface::Plane { normal, .. }) => normal,
                Face::Sphere(surface::Sphere { center, .. }) => (x - center).normalize_or(DVec3::Z),
                Face::Cylinder(surface::Cylinder { origin, axis, .. }) => across(origin, axis),
                Face::Cone(surface::Cone { apex, axis, sin, cos }) => across(apex, axis) * cos - axis * sin,
                Face::Torus(surface::Torus { origin, axis, major, .. }) => {
                    let out = across(origin, axis);
                    (x - origin - out * major).normalize_or(out)
                }
                Face::Capsule(surface::Capsule { origin, axis, half, .. }) => {
                    let along = axis.dot(x - origin);
                    if along.abs() <= half {
                        across(origin, axis)
                    } else {
                        (x - origin - axis * half.copysign(along)).normalize_or(axis)
                    }
                }
                Face::Elliptic(e) => Image::of(&e).gradient(x),
                Face::Bowl(b) => Image::of_bowl(&b).gradient(x),
                Face::Superellipsoid(s) => Ball::of(&s).gradient(x),
                Face::Saddle(s) => {
                    let s = Ridge::of(&s);
                    let [p, n] = s.halves(x).map(|v| v.normalize_or(DVec2::X));
                    let [own, other] = s.scales();
                    s.turn * (own[0] * p.x + own[1] * p.y - other[0] * n.x - other[1] * n.y)
                }
            }
    }

    /// Apex and axis, for the faces that have a point without gradient on the surface.
    pub fn apex(&self) -> Option<(DVec3, DVec3, f64)> {
        match self.face {
            Face::Cone(surface::Cone { apex, axis, sin, .. }) if self.sign > 0.0 => Some((apex, axis, sin)),
            Face::Elliptic(e) if self.sign > 0.0 && e.third < 0.0 => {
                Some((e.origin, Image::of(&e).turn * DVec3::Z, -e.third))
            }
            _ => None,
        }
    }
}

/// An elliptic face by its numbers: psi = |(s_k y_k)| − fall y_z − radius with y = turnᵀ(x − origin).
#[derive(Clone, Copy, Debug)]
pub struct Image {
    /// Centre, a point of the axis, or the apex.
    pub origin: DVec3,
    /// Principal axes.
    pub turn: DQuat,
    /// s.
    pub scale: DVec3,
    /// sin α of a cone.
    pub fall: f64,
    /// r.
    pub radius: f64,
}

impl Image {
    /// 2⁻⁴⁷ less than 1: what stands for it.
    pub const WHOLE: f64 = 1.0 - 1.0 / (1u64 << 47) as f64;

    /// A tangent of a quarter of an angle about an axis is a quaternion's vector over one more than its scalar.
    pub fn of(e: &surface::Elliptic) -> Self {
        let turn = turn_of(e.turn);
        let (scale, fall, radius) = if e.third < 0.0 {
            (DVec3::new(e.size, e.second, 0.0), -e.third, 0.0)
        } else {
            (DVec3::new(Self::WHOLE, e.second, e.third), 0.0, e.size)
        };
        Self { origin: e.origin, turn, scale, fall, radius }
    }

    /// A bowl's: the same with a third row and a fall.
    pub fn of_bowl(b: &surface::Bowl) -> Self {
        Self { origin: b.origin, turn: turn_of(b.turn), scale: b.scale, fall: b.fall, radius: b.radius }
    }

    fn value(&self, x: DVec3) -> f64 {
        self.across(x).length() - self.fall * self.local(x).z - self.radius
    }

    fn gradient(&self, x: DVec3) -> DVec3 {
        self.turn * (self.across(x).normalize_or(DVec3::X) * self.scale - DVec3::Z * self.fall)
    }

    /// A point along its axes.
    pub fn local(&self, x: DVec3) -> DVec3 {
        self.turn.conjugate() * (x - self.origin)
    }

    /// (s_k y_k).
    pub fn across(&self, x: DVec3) -> DVec3 {
        self.local(x) * self.scale
    }
}

fn turn_of(turn: DVec3) -> DQuat {
    let square = turn.length_squared();
    let v = turn * (2.0 / (1.0 + square));
    DQuat::from_xyzw(v.x, v.y, v.z, (1.0 - square) / (1.0 + square)).normalize()
}

/// A superellipsoid by its numbers: psi = s (N(y) − 1), y along its axes.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    face: surface::Superellipsoid,
    turn: DQuat,
    size: f64,
}

impl Ball {
    /// Of a face.
    pub fn of(face: &surface::Superellipsoid) -> Self {
        Self { face: *face, turn: turn_of(face.turn), size: face.semi.min_element() * Image::WHOLE }
    }

    /// y over the semi-axes, N, and the largest of the former.
    fn seen(&self, x: DVec3) -> (DVec3, f64) {
        let v = self.turn.conjugate() * (x - self.face.origin) / self.face.semi;
        let (w, m) = (v.abs(), v.abs().max_element());
        if m == 0.0 {
            return (v, 0.0);
        }
        let (e, f) = (self.face.exponents.x, self.face.exponents.y);
        let [a, b, c] = (w / m).to_array();
        let flat = a.powf(2.0 / f) + b.powf(2.0 / f);
        (v, m * (flat.powf(f / e) + c.powf(2.0 / e)).powf(0.5 * e))
    }

    /// s N.
    pub fn length(&self, x: DVec3) -> f64 {
        self.seen(x).1 * self.size
    }

    fn value(&self, x: DVec3) -> f64 {
        self.length(x) - self.size
    }

    fn gradient(&self, x: DVec3) -> DVec3 {
        let (v, n) = self.seen(x);
        let (p, q) = (2.0 / self.face.exponents.x, 2.0 / self.face.exponents.y);
        if n == 0.0 {
            return self.turn * DVec3::AXES[self.face.semi.min_position()];
        }
        let u = (v / n).abs();
        let flat = u.x.max(u.y);
        let inner = if flat > 0.0 { flat * ((u.x / flat).powf(q) + (u.y / flat).powf(q)).powf(1.0 / q) } else { 0.0 };
        let part = |x: f64| if inner > 0.0 { (x / inner).powf(q - 1.0) * inner.powf(p - 1.0) } else { 0.0 };
        let g = DVec3::new(part(u.x), part(u.y), u.z.powf(p - 1.0)) * DVec3::ONE.copysign(v);
        self.turn * (g * self.size / self.face.semi)
    }

    /// How fast the gradient may turn at a point: 1/length.
    pub fn turns(&self, x: DVec3) -> f64 {
        (2.0 / self.face.exponents.min_element() - 1.0) / self.length(x).max(f64::MIN_POSITIVE)
    }
}

/// A saddle by its numbers: psi = |P| − |N|, both of two parts along y = turnᵀ(x − origin).
#[derive(Clone, Copy, Debug)]
pub struct Ridge {
    /// Centre or saddle point.
    pub origin: DVec3,
    /// Principal axes.
    pub turn: DQuat,
    face: surface::Saddle,
}

impl Ridge {
    /// Of a face.
    pub fn of(face: &surface::Saddle) -> Self {
        Self { origin: face.origin, turn: turn_of(face.turn), face: *face }
    }

    /// What the parts of P and of N change by, along its axes.
    pub fn scales(&self) -> [[DVec3; 2]; 2] {
        let s = &self.face;
        if s.third == 0.0 {
            let up = DVec3::Z * (0.5 * Image::WHOLE);
            return [[DVec3::X * s.first, up], [DVec3::Y * s.second, up]];
        }
        [[DVec3::X * s.first, DVec3::Y * s.second], [DVec3::Z * s.third, DVec3::ZERO]]
    }

    /// What they are at the origin.
    pub fn levels(&self) -> [DVec2; 2] {
        let s = &self.face;
        let half = 0.5 * Image::WHOLE * s.size;
        if s.third == 0.0 { [DVec2::Y * -half, DVec2::Y * half] } else { [DVec2::ZERO, DVec2::Y * s.size] }
    }

    /// P and N.
    pub fn halves(&self, x: DVec3) -> [DVec2; 2] {
        let y = self.turn.conjugate() * (x - self.origin);
        let (scales, levels) = (self.scales(), self.levels());
        [0, 1].map(|k| DVec2::new(scales[k][0].dot(y), scales[k][1].dot(y)) + levels[k])
    }
}

#[derive(Clone, Debug)]
enum Node {
    Literal(u32),
    Min(Vec<Node>),
    Max(Vec<Node>),
    /// f = +infinity (or −infinity for the complement of nothing).
    Constant(f64),
}

/// A solid as a function of the point, in its object's frame.
#[derive(Clone, Debug)]
pub struct Field {
    /// All literals.
    pub literals: Vec<Literal>,
    root: Node,
    /// Centre of a ball that holds the solid.
    pub center: DVec3,
    /// Radius of that ball.
    pub radius: f64,
}

impl Field {
    /// The solid put into its object's frame by `place`.
    pub fn new(solid: &Solid, place: &Pose) -> Self {
        let mut field =
            Self { literals: vec![], root: Node::Constant(f64::INFINITY), center: DVec3::ZERO, radius: 0.0 };
        field.root = field.lower(solid, place, solid.root, false);
        let bounds = solid.aabb();
        if !solid.is_empty() && bounds.min.cmple(bounds.max).all() {
            field.center = place.rotation * ((bounds.min + bounds.max) / 2.0) + place.position;
            field.radius = (bounds.max - bounds.min).length() / 2.0;
        }
        field
    }

    fn lower(&mut self, solid: &Solid, place: &Pose, id: NodeId, negated: bool) -> Node {
        match &solid.nodes[id as usize] {
            TreeNode::Empty => Node::Constant(if negated { f64::NEG_INFINITY } else { f64::INFINITY }),
            TreeNode::Primitive(p) => {
                let faces = &solid.primitives[*p as usize].faces;
                self.of_formula(&formula_of(&solid.primitives[*p as usize]), negated, &|face, sign| Literal {
                    face: moved(&faces[face as usize], place),
                    sign,
                    owner: *p,
                })
            }
            TreeNode::Op(op, children) => {
                let flips = |i: usize| negated != (*op == Op::Difference && i > 0);
                let lowered =
                    children.iter().enumerate().map(|(i, c)| self.lower(solid, place, *c, flips(i))).collect();
                if (*op == Op::Union) != negated { Node::Min(lowered) } else { Node::Max(lowered) }
            }
        }
    }

    fn of_formula(&mut self, e: &Formula, negated: bool, literal: &dyn Fn(u32, f64) -> Literal) -> Node {
        let mut many = |all: &[Formula], max: bool| {
            let each = all.iter().map(|e| self.of_formula(e, negated, literal)).collect();
            if max != negated { Node::Max(each) } else { Node::Min(each) }
        };
        match e {
            Formula::One(face, flipped) => {
                self.literals.push(literal(*face, if negated != *flipped { -1.0 } else { 1.0 }));
                Node::Literal(self.literals.len() as u32 - 1)
            }
            Formula::And(all) => many(all, true),
            Formula::Or(all) => many(all, false),
        }
    }

    /// f at `x`.
    pub fn value(&self, x: DVec3) -> f64 {
        self.value_of(&self.root, x)
    }

    fn value_of(&self, node: &Node, x: DVec3) -> f64 {
        match node {
            Node::Literal(i) => self.literals[*i as usize].value(x),
            Node::Min(c) => c.iter().map(|n| self.value_of(n, x)).fold(f64::INFINITY, f64::min),
            Node::Max(c) => c.iter().map(|n| self.value_of(n, x)).fold(f64::NEG_INFINITY, f64::max),
            Node::Constant(v) => *v,
        }
    }

    /// The literals that can decide f within `reach` of `x`, as alternatives of conjunctions; at most `limit`
    /// alternatives (those beyond are dropped: smaller reaches find them).
    pub fn clauses(&self, x: DVec3, reach: f64, limit: usize) -> Vec<Vec<u32>> {
        self.clauses_of(&self.root, x, reach, limit)
    }

    fn clauses_of(&self, node: &Node, x: DVec3, reach: f64, limit: usize) -> Vec<Vec<u32>> {
        match node {
            Node::Literal(i) => vec![vec![*i]],
            Node::Constant(_) => vec![],
            Node::Min(children) => {
                let v = self.value_of(node, x);
                let near = children.iter().filter(|c| self.value_of(c, x) <= v + 2.0 * reach);
                let mut all: Vec<Vec<u32>> = near.flat_map(|c| self.clauses_of(c, x, reach, limit)).collect();
                all.truncate(limit);
                all
            }
            Node::Max(children) => {
                let v = self.value_of(node, x);
                let mut product: Vec<Vec<u32>> = vec![vec![]];
                for child in children.iter().filter(|c| self.value_of(c, x) >= v - 2.0 * reach) {
                    let alternatives = self.clauses_of(child, x, reach, limit);
                    product = product
                        .iter()
                        .flat_map(|p| alternatives.iter().map(move |a| p.iter().chain(a).copied().collect()))
                        .take(limit)
                        .collect();
                }
                product
            }
        }
    }
}

/// A rotation told by a quarter of its angle, turned on.
fn quarter(by: DQuat, turn: DVec3) -> DVec3 {
    let q = by * turn_of(turn);
    let q = if q.w < 0.0 { -q } else { q };
    q.xyz() / (1.0 + q.w)
}

/// A face seen from the parent of `place`.
fn moved(face: &Face, place: &Pose) -> Face {
    let point = |x: DVec3| place.rotation * x + place.position;
    let turned = |n: DVec3| (place.rotation * n).normalize();
    match *face {
        Face::Plane(surface::Plane { normal, offset }) => {
            let normal = turned(normal);
            Face::Plane(surface::Plane { normal, offset: offset + normal.dot(place.position) })
        }
        Face::Sphere(surface::Sphere { center, radius }) => {
            Face::Sphere(surface::Sphere { center: point(center), radius })
        }
        Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
            Face::Cylinder(surface::Cylinder { origin: point(origin), axis: turned(axis), radius })
        }
        Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
            Face::Cone(surface::Cone { apex: point(apex), axis: turned(axis), sin, cos })
        }
        Face::Torus(surface::Torus { origin, axis, major, minor }) => {
            Face::Torus(surface::Torus { origin: point(origin), axis: turned(axis), major, minor })
        }
        Face::Capsule(surface::Capsule { origin, axis, half, radius }) => {
            Face::Capsule(surface::Capsule { origin: point(origin), axis: turned(axis), half, radius })
        }
        Face::Elliptic(e) => {
            Face::Elliptic(surface::Elliptic { origin: point(e.origin), turn: quarter(place.rotation, e.turn), ..e })
        }
        Face::Bowl(b) => {
            Face::Bowl(surface::Bowl { origin: point(b.origin), turn: quarter(place.rotation, b.turn), ..b })
        }
        Face::Superellipsoid(s) => Face::Superellipsoid(surface::Superellipsoid {
            origin: point(s.origin),
            turn: quarter(place.rotation, s.turn),
            ..s
        }),
        Face::Saddle(s) => {
            Face::Saddle(surface::Saddle { origin: point(s.origin), turn: quarter(place.rotation, s.turn), ..s })
        }
    }
}
