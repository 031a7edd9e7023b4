//! A body as a record's judge sees it: its tree's faces with their signs, and which of them are active at a point.

use crate::formula::{Formula, formula_of};
use crate::reference::Moving;
use crate::reference::field::{Image, Literal};
use contactd::solid::{Face, Node as TreeNode, NodeId, Op, Shape, Solid, surface};
use glam::{DVec2, DVec3};

/// A face in its place in the tree.
pub enum Node {
    Literal(usize),
    Min(Vec<Node>),
    Max(Vec<Node>),
    Constant(f64),
}

/// A body at the time of a record.
pub struct Side<'a> {
    pub moving: &'a Moving<'a>,
    pub literals: Vec<Literal>,
    /// Face id of each literal.
    pub ids: Vec<u32>,
    pub root: Node,
    pub time: f64,
    /// Bounding radius of the model, and the size of all numbers that its points are computed from.
    pub radius: f64,
    pub extent: f64,
    /// The part of `extent` that has nothing to do with where the bodies are.
    pub own: f64,
}

impl<'a> Side<'a> {
    /// True for a ball about its object's origin, around which it turns.
    pub fn is_ball_about_its_centre(&self) -> bool {
        let [primitive] = self.moving.solid.primitives.as_slice() else { return false };
        let center = self.moving.place.point(primitive.frame.position);
        matches!(primitive.shape, Shape::Sphere(_)) && center.length() <= 1e-15 * self.extent
    }

    pub fn new(moving: &'a Moving<'a>, time: f64) -> Self {
        let solid = moving.solid;
        let mut first = vec![0];
        for p in &solid.primitives {
            first.push(first.last().unwrap() + p.faces.len() as u32);
        }
        let (mut literals, mut ids) = (vec![], vec![]);
        let root = lower(solid, &first, solid.root, false, &mut literals, &mut ids);
        let bounds = solid.aabb();
        // What reaches to infinity has no size of its own: its partner's counts.
        let (radius, reach) = if solid.is_empty() || !bounds.is_finite() {
            (0.0, 0.0)
        } else {
            ((bounds.max - bounds.min).length() / 2.0, bounds.min.abs().max(bounds.max.abs()).length())
        };
        // Faces may have their numbers far outside of the solid.
        let numbers = solid.faces.iter().map(|f| match *f {
            Face::Plane(surface::Plane { offset, .. }) => offset.abs(),
            Face::Sphere(surface::Sphere { center: o, radius })
            | Face::Cylinder(surface::Cylinder { origin: o, radius, .. }) => o.length() + radius,
            Face::Cone(surface::Cone { apex, .. }) => apex.length(),
            Face::Torus(surface::Torus { origin, major, minor, .. }) => origin.length() + major + minor,
            Face::Elliptic(e) => e.origin.length() + e.size,
            Face::Bowl(b) => b.origin.length() + b.radius,
            Face::Superellipsoid(s) => s.origin.length() + s.semi.min_element(),
            Face::Saddle(s) => s.origin.length() + s.size,
            Face::Capsule(surface::Capsule { origin, half, radius, .. }) => origin.length() + half + radius,
        });
        let motion = &moving.motion;
        let own = 2.0 * moving.place.position.length() + 2.0 * reach + numbers.fold(0.0, f64::max);
        let extent = motion.start.position.length() + motion.velocity.length() + own;
        Self { moving, literals, ids, root, time, radius, extent, own }
    }

    /// A world point in the model's frame.
    pub fn local(&self, world: DVec3) -> DVec3 {
        self.local_from(world - self.moving.motion.at(self.time).position)
    }

    /// A point in the model's frame, by its way from the body's position along the world's axes.
    pub fn local_from(&self, way: DVec3) -> DVec3 {
        let object = self.moving.motion.at(self.time).rotation.conjugate() * way;
        self.moving.place.rotation.conjugate() * (object - self.moving.place.position)
    }

    /// A world direction along the model's axes.
    pub fn turned(&self, world: DVec3) -> DVec3 {
        let at = self.moving.motion.at(self.time);
        self.moving.place.rotation.conjugate() * (at.rotation.conjugate() * world)
    }

    /// World velocity of the body's matter at a world point, per step.
    pub fn velocity(&self, world: DVec3) -> DVec3 {
        let motion = &self.moving.motion;
        motion.velocity + motion.spin.cross(world - motion.at(self.time).position)
    }

    pub fn value(&self, x: DVec3) -> f64 {
        value(&self.root, &mut |i| self.literals[i].value(x))
    }

    /// Derivative of a literal at a point that lies on it to `tau`, along d.
    pub fn slope(&self, i: usize, x: DVec3, tau: f64, d: DVec3) -> f64 {
        let l = &self.literals[i];
        match l.face {
            Face::Cone(surface::Cone { apex, axis, sin, cos }) if apex.distance(x) <= tau / sin => {
                l.sign * (axis.cross(d).length() * cos - axis.dot(d) * sin)
            }
            Face::Elliptic(e) if self.is_apex(i, x, tau) => {
                let image = Image::of(&e);
                l.sign * (image.across(image.origin + d).length() - image.fall * image.local(image.origin + d).z)
            }
            _ => l.gradient(x).dot(d),
        }
    }

    /// True for the same face of two primitives that are one another's copy to the bit, with the same sign: whether f
    /// depends on the one or on the other cannot be told.
    pub fn is_copy(&self, i: usize, k: usize) -> bool {
        let (a, b) = (&self.literals[i], &self.literals[k]);
        let faces = |l: &Literal| &self.moving.solid.primitives[l.owner as usize].faces;
        a.sign == b.sign && a.face == b.face && faces(a).iter().eq(faces(b).iter())
    }

    pub fn is_apex(&self, i: usize, x: DVec3, tau: f64) -> bool {
        match self.literals[i].face {
            Face::Cone(surface::Cone { apex, sin, .. }) => apex.distance(x) <= tau / sin,
            Face::Elliptic(e) if e.third < 0.0 => e.origin.distance(x) <= tau / -e.third,
            _ => false,
        }
    }
}

pub fn lower(
    solid: &Solid,
    first: &[u32],
    id: NodeId,
    negated: bool,
    literals: &mut Vec<Literal>,
    ids: &mut Vec<u32>,
) -> Node {
    match &solid.nodes[id as usize] {
        TreeNode::Empty => Node::Constant(if negated { f64::NEG_INFINITY } else { f64::INFINITY }),
        TreeNode::Primitive(p) => {
            let primitive = &solid.primitives[*p as usize];
            of_formula(&formula_of(primitive), negated, &mut |k, sign| {
                literals.push(Literal { face: primitive.faces[k as usize], sign, owner: *p });
                ids.push(first[*p as usize] + k);
                Node::Literal(literals.len() - 1)
            })
        }
        TreeNode::Op(op, children) => {
            let flips = |i: usize| negated != (*op == Op::Difference && i > 0);
            let lowered = children.iter().enumerate();
            let lowered = lowered.map(|(i, c)| lower(solid, first, *c, flips(i), literals, ids)).collect();
            if (*op == Op::Union) != negated { Node::Min(lowered) } else { Node::Max(lowered) }
        }
    }
}

pub fn of_formula(e: &Formula, negated: bool, literal: &mut dyn FnMut(u32, f64) -> Node) -> Node {
    let mut many = |all: &[Formula], max: bool| {
        let each = all.iter().map(|e| of_formula(e, negated, literal)).collect();
        if max != negated { Node::Max(each) } else { Node::Min(each) }
    };
    match e {
        Formula::One(face, flipped) => literal(*face, if negated != *flipped { -1.0 } else { 1.0 }),
        Formula::And(all) => many(all, true),
        Formula::Or(all) => many(all, false),
    }
}

pub fn value(node: &Node, of: &mut impl FnMut(usize) -> f64) -> f64 {
    match node {
        Node::Literal(i) => of(*i),
        Node::Min(c) => c.iter().map(|n| value(n, of)).fold(f64::INFINITY, f64::min),
        Node::Max(c) => c.iter().map(|n| value(n, of)).fold(f64::NEG_INFINITY, f64::max),
        Node::Constant(v) => *v,
    }
}

/// What a body is at a point of its surface, faces within `tau` passing through it.
pub struct Spot {
    /// Active literals.
    pub active: Vec<usize>,
    /// Generators of the cone of their gradients, along the model's axes.
    pub generators: Vec<DVec3>,
    /// An active cone has its apex there.
    pub apex: bool,
    /// Dimension of what the gradients span: 1 a face, 2 an edge, 3 a vertex.
    pub rank: usize,
}

/// A literal that does not pass through the point has this slope, of its value's sign.
pub const FAR: f64 = 1e9;

impl Spot {
    pub fn of(side: &Side, x: DVec3, tau: f64, normal: DVec3) -> Self {
        let n = side.literals.len();
        let values: Vec<f64> = side.literals.iter().map(|l| l.value(x)).collect();
        let through: Vec<usize> = (0..n).filter(|i| values[*i].abs() <= tau).collect();
        let gradients: Vec<DVec3> = through.iter().map(|i| side.literals[*i].gradient(x)).collect();
        let has_apex = through.iter().any(|i| side.is_apex(*i, x, tau));
        let mut is_active = vec![false; n];
        let mut slopes: Vec<f64> = values.iter().map(|v| FAR * v.signum()).collect();
        for d in directions(&gradients, has_apex) {
            for i in &through {
                slopes[*i] = side.slope(*i, x, tau, d);
            }
            let now = value(&side.root, &mut |i| slopes[i]);
            if now.abs() > 2.0 {
                // Deep inside or far outside, whatever these faces do.
                break;
            }
            for i in &through {
                let one = |k: usize| k == *i || side.is_copy(k, *i);
                let moved = |by: f64| value(&side.root, &mut |k| if one(k) { slopes[k] + by } else { slopes[k] });
                is_active[*i] |= moved(1e-7) != now || moved(-1e-7) != now;
            }
        }
        let active: Vec<usize> = through.into_iter().filter(|i| is_active[*i]).collect();
        let mut generators = vec![];
        let mut apex = false;
        for i in &active {
            if side.is_apex(*i, x, tau) {
                let sign = side.literals[*i].sign;
                if let Face::Elliptic(e) = side.literals[*i].face {
                    let image = Image::of(&e);
                    let n = image.turn.conjugate() * (normal * sign);
                    let towards = DVec2::new(n.x / image.scale.x, n.y / image.scale.y).try_normalize();
                    let around = (0..256).map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 256.0));
                    let ray = |v: DVec2| image.turn * (v.extend(0.0) * image.scale - DVec3::Z * image.fall) * sign;
                    generators.extend(around.chain(towards).map(ray));
                    generators.push(image.turn * DVec3::Z * -sign);
                    apex = true;
                    continue;
                }
                let Face::Cone(surface::Cone { axis, sin, cos, .. }) = side.literals[*i].face else { unreachable!() };
                let u = axis.any_orthonormal_vector();
                let v = axis.cross(u);
                let towards = (normal * sign - axis * axis.dot(normal * sign)).try_normalize();
                let around = (0..256).map(|k| {
                    let (s, c) = (f64::from(k) * std::f64::consts::TAU / 256.0).sin_cos();
                    u * c + v * s
                });
                generators.extend(around.chain(towards).map(|r| (r * cos - axis * sin) * sign));
                generators.push(-axis * sign);
                apex = true;
            } else {
                generators.push(side.literals[*i].gradient(x));
            }
        }
        let rank = if apex { 3 } else { rank(&generators) };
        Self { active, generators, apex, rank }
    }
}

/// Directions that reach every way in which one of some gradients may decide: at random, and around every edge and wall
/// of the arrangement of the planes on which two of them agree.
pub fn directions(gradients: &[DVec3], apex: bool) -> Vec<DVec3> {
    let mut state = 0x9E37_79B9_97F4_A7C1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut out = vec![];
    for _ in 0..if apex { 2000 } else { 100 } {
        let d = DVec3::new(random(), random(), random());
        out.extend(d.try_normalize());
    }
    out.extend(gradients.iter().flat_map(|g| [*g, -*g]));
    let mut walls: Vec<DVec3> = vec![];
    for (i, g) in gradients.iter().enumerate() {
        for h in &gradients[i + 1..] {
            for wall in [*g - *h, *g + *h].into_iter().filter(|w| w.length() > 1e-7).map(DVec3::normalize) {
                if walls.len() < 40 && walls.iter().all(|w| w.cross(wall).length() > 1e-6) {
                    walls.push(wall);
                }
            }
        }
    }
    for (i, w) in walls.iter().enumerate() {
        for _ in 0..16 {
            let d = DVec3::new(random(), random(), random());
            let Some(d) = (d - *w * d.dot(*w)).try_normalize() else { continue };
            out.extend([(d + *w * 1e-3).normalize(), (d - *w * 1e-3).normalize()]);
        }
        for v in &walls[i + 1..] {
            let Some(edge) = w.cross(*v).try_normalize() else { continue };
            for _ in 0..4 {
                let aside = DVec3::new(random(), random(), random()) * 1e-3;
                out.extend([(edge + aside).normalize(), (aside - edge).normalize()]);
            }
        }
    }
    out
}

/// Gradients closer than this, in radians, are one direction: a seam where faces meet tangentially is no edge.
pub const TANGENT: f64 = 1e-6;

pub fn rank(vectors: &[DVec3]) -> usize {
    let mut span: Vec<DVec3> = vec![];
    for g in vectors {
        let rest = span.iter().fold(*g, |r, e| r - *e * e.dot(r));
        if rest.length() > TANGENT && span.len() < 3 {
            span.push(rest.normalize());
        }
    }
    span.len()
}
