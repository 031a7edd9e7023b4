//! Random CSG trees of all primitives and operations, and random motions, from a seed: the same seed, the same solid.

use contactd::motion::Placed;
use contactd::solid::primitive::{
    Capsule, Cone, Cuboid, Cylinder, Ellipsoid, EllipticFrustum, HalfSpace, Polyhedron, Shape, Sphere, Superellipsoid,
    Torus,
};
use contactd::solid::{Label, NodeId, Op, Solid, SolidBuilder};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec2, DVec3};

/// A small generator of random numbers (splitmix64): fixed results everywhere.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator for a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03)
    }
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    /// A number in [lo, hi).
    pub fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * ((self.bits() >> 11) as f64 / (1u64 << 53) as f64)
    }
    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.within(0.0, 1.0) < p
    }
    /// A unit vector, uniform on the sphere.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.within(-1.0, 1.0);
        let (s, c) = self.within(0.0, std::f64::consts::TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * c, r * s, z)
    }
    /// A whole number below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// A vector in the cube [−r, r]³.
    pub fn vector(&mut self, r: f64) -> DVec3 {
        DVec3::new(self.within(-r, r), self.within(-r, r), self.within(-r, r))
    }
    /// A rotation; one in three is a multiple of a quarter turn, as in real parts.
    pub fn rotation(&mut self) -> DQuat {
        if self.below(3) == 0 {
            let axis = [DVec3::X, DVec3::Y, DVec3::Z][self.below(3)];
            return quat_of_rotation_vector(axis * (std::f64::consts::FRAC_PI_2 * self.below(4) as f64));
        }
        let v = self.vector(1.0);
        quat_of_rotation_vector(v.normalize_or_zero() * self.within(0.0, 3.0))
    }
    /// A point in a box.
    pub fn point_in(&mut self, b: &contactd::math::Aabb) -> DVec3 {
        let mut p = DVec3::ZERO;
        for k in 0..3 {
            p[k] = self.within(b.min[k], b.max[k]);
        }
        p
    }
}

/// A random bounded primitive of size about `size`.
pub fn shape(r: &mut Random, size: f64) -> Shape {
    let mut s = |lo: f64, hi: f64| size * r.within(lo, hi);
    let (a, b, c) = (s(0.3, 1.0), s(0.3, 1.0), s(0.3, 1.0));
    match r.below(6) {
        0 => Sphere { radius: a }.into(),
        1 => Cylinder { radius: a, half_height: b }.into(),
        2 => Cone { bottom: a, top: [0.0, 0.4 * a, 1.5 * a][r.below(3)], half_height: b }.into(),
        3 | 4 => Cuboid { half: DVec3::new(a, b, c) }.into(),
        _ => Polyhedron::platonic([4, 6, 8, 12, 20][r.below(5)], a + 0.3 * size).expect("a platonic count").into(),
    }
}

/// A random torus of size about `size`; one in four has no hole.
pub fn torus(r: &mut Random, size: f64) -> Torus {
    let minor = size * r.within(0.1, 0.4);
    let major = if r.below(4) == 0 { minor * r.within(0.2, 1.0) } else { minor + size * r.within(0.02, 0.6) };
    Torus { major, minor }
}

/// The same as `shape`, or a torus, one in three.
pub fn shape_or_torus(r: &mut Random, size: f64) -> Shape {
    if r.below(3) == 0 { torus(r, size).into() } else { shape(r, size) }
}

/// A random ellipsoid, elliptic cylinder, cone or frustum of size about `size`: half of those lean, some but a little or on circles.
pub fn elliptic(r: &mut Random, size: f64) -> Shape {
    let mut s = |lo: f64, hi: f64| size * r.within(lo, hi);
    let (a, b, c) = (s(0.15, 1.0), s(0.15, 1.0), s(0.15, 1.0));
    if r.below(2) == 0 {
        let semi = if r.below(4) == 0 { DVec3::new(a, a, b) } else { DVec3::new(a, b, c) };
        return Ellipsoid { semi }.into();
    }
    let (bottom, top) = [(1.0, 1.0), (1.0, 0.0), (1.0, 0.4), (0.7, 1.0), (0.0, 1.0)][r.below(5)];
    let lean = [0.0, 0.0, 0.05, 0.8][r.below(4)] * DVec2::new(r.within(-1.0, 1.0), r.within(-1.0, 1.0));
    let semi = if r.below(4) == 0 && lean != DVec2::ZERO { DVec2::splat(a) } else { DVec2::new(a, b) };
    EllipticFrustum { semi, bottom, top, half_height: c, lean }.into()
}

/// A random capsule of size about `size`.
pub fn capsule(r: &mut Random, size: f64) -> Capsule {
    Capsule { half: size * r.within(0.05, 0.9), radius: size * r.within(0.1, 0.5) }
}

/// The same as `shape`, or a capsule, one in three.
pub fn shape_or_capsule(r: &mut Random, size: f64) -> Shape {
    if r.below(3) == 0 { capsule(r, size).into() } else { shape(r, size) }
}

/// A random superellipsoid of size about `size`: exponents at either end of what there is, one like a box, or any.
pub fn superellipsoid(r: &mut Random, size: f64) -> Superellipsoid {
    let mut s = || size * r.within(0.15, 1.0);
    let (a, b, c) = (s(), s(), s());
    let e = |r: &mut Random| match r.below(8) {
        0 => 1.0,
        1 => 0.1,
        2 => 0.5,
        _ => r.within(0.1, 1.0),
    };
    let exponents = DVec2::new(e(r), e(r));
    let semi = if r.below(4) == 0 { DVec3::new(a, a, b) } else { DVec3::new(a, b, c) };
    Superellipsoid { semi, exponents }
}

/// The same as `shape`, or a superellipsoid, one in three.
pub fn shape_or_superellipsoid(r: &mut Random, size: f64) -> Shape {
    if r.below(3) == 0 { superellipsoid(r, size).into() } else { shape(r, size) }
}

/// The same as `shape`, or an elliptic one, one in three.
pub fn shape_or_elliptic(r: &mut Random, size: f64) -> Shape {
    if r.below(3) == 0 { elliptic(r, size) } else { shape(r, size) }
}

/// The same as `shape`, or a mesh, one in three.
pub fn shape_or_mesh(r: &mut Random, size: f64) -> Shape {
    if r.below(3) == 0 { crate::meshes::solid(&crate::meshes::random(r, size)).into() } else { shape(r, size) }
}

/// The words for the kinds of primitives, as `of_kind` draws them: elliptic ones are ellipsoids, elliptic cylinders, cones and frustums.
pub const KINDS: [&str; 12] = [
    "ball",
    "cylinder",
    "frustum",
    "box",
    "polyhedron",
    "capsule",
    "elliptic",
    "torus",
    "superellipsoid",
    "quadric",
    "mesh",
    "half-space",
];

/// A random primitive of a kind, of size about `size`.
pub fn of_kind(r: &mut Random, kind: &str, size: f64) -> Shape {
    let (a, b, c) = (size * r.within(0.25, 1.0), size * r.within(0.25, 1.0), size * r.within(0.25, 1.0));
    match kind {
        "ball" => Sphere { radius: a }.into(),
        "cylinder" => Cylinder { radius: a, half_height: b }.into(),
        "frustum" => Cone { bottom: a, top: [0.0, 0.4 * a, 1.5 * a][r.below(3)], half_height: b }.into(),
        "box" => Cuboid { half: DVec3::new(a, b, c) }.into(),
        "polyhedron" => {
            let faces = [4, 6, 8, 12, 20][r.below(5)];
            Polyhedron::platonic(faces, a + 0.25 * size).expect("a platonic count").into()
        }
        "capsule" => capsule(r, size).into(),
        "elliptic" => elliptic(r, size),
        "torus" => torus(r, size).into(),
        "superellipsoid" => superellipsoid(r, size).into(),
        "quadric" => crate::quadrics::random(r, size),
        "mesh" => crate::meshes::solid(&crate::meshes::random(r, size)).into(),
        "half-space" => HalfSpace.into(),
        other => panic!("no kind {other:?}"),
    }
}

/// A random primitive of any kind but half-spaces.
pub fn shape_of_any_kind(r: &mut Random, size: f64) -> Shape {
    let kind = KINDS[r.below(KINDS.len() - 1)];
    of_kind(r, kind, size)
}

/// A random solid whose tree has up to `depth` levels of operations; bounded, its plain box not empty.
pub fn solid(r: &mut Random, depth: usize) -> Solid {
    solid_of(r, depth, shape)
}

/// The same of primitives that `shape` draws.
pub fn solid_of(r: &mut Random, depth: usize, shape: fn(&mut Random, f64) -> Shape) -> Solid {
    loop {
        let mut b = SolidBuilder::new();
        let root = node_of(r, &mut b, depth, 1.0, (false, shape));
        let s = b.finish(root);
        if s.aabb().is_finite() {
            return s;
        }
    }
}

/// Adds a random tree of up to `depth` levels to a builder; an `operand` of something bounded may be a half-space.
pub fn node(r: &mut Random, b: &mut SolidBuilder, depth: usize, size: f64, operand: bool) -> NodeId {
    node_of(r, b, depth, size, (operand, shape))
}

/// A source of random primitives of a size.
type Draw = fn(&mut Random, f64) -> Shape;

fn node_of(r: &mut Random, b: &mut SolidBuilder, depth: usize, size: f64, (operand, shape): (bool, Draw)) -> NodeId {
    if depth == 0 || r.below(8) == 0 {
        let frame = Pose::new(r.vector(0.8 * size), r.rotation());
        if operand && r.below(6) == 0 {
            return b.primitive(HalfSpace, frame, label("half-space"));
        }
        let shape = shape(r, size);
        return b.primitive(shape, frame, label("primitive"));
    }
    let arity = 2 + r.below(3);
    let op = [Op::Union, Op::Difference, Op::Difference, Op::Intersection][r.below(4)];
    let mut children = vec![node_of(r, b, depth - 1, size, (false, shape))];
    for _ in 1..arity {
        // Subtracted and intersecting operands may be unbounded: the first operand bounds the result.
        let child = match op {
            Op::Union => node_of(r, b, depth - 1, size, (false, shape)),
            Op::Difference => node_of(r, b, depth - 1, 0.7 * size, (true, shape)),
            Op::Intersection => node_of(r, b, depth - 1, 1.6 * size, (true, shape)),
        };
        children.push(child);
    }
    b.operation(op, &children)
}

fn label(name: &str) -> Label {
    Label { name: name.into(), ..Label::default() }
}

/// A plate with a grid of `n`×`n` holes and a boss beside each: real parts' shape of tree (one difference, flat unions).
pub fn perforated_plate(n: usize) -> Solid {
    let mut b = SolidBuilder::new();
    let half = n as f64 * 0.5;
    let plate = b.primitive(Cuboid { half: DVec3::new(half, half, 0.2) }, Pose::IDENTITY, label("cube"));
    let (mut bosses, mut holes) = (vec![plate], vec![]);
    for i in 0..n {
        for j in 0..n {
            let at = DVec3::new(i as f64 + 0.5 - half, j as f64 + 0.5 - half, 0.0);
            let hole = Cylinder { radius: 0.2, half_height: 0.3 };
            holes.push(b.primitive(hole, Pose::at(at), label("cylinder")));
            let boss = Cylinder { radius: 0.08, half_height: 0.3 };
            bosses.push(b.primitive(boss, Pose::at(at + DVec3::new(0.35, 0.35, 0.0)), label("cylinder")));
        }
    }
    let body = b.operation(Op::Union, &bosses);
    holes.insert(0, body);
    let root = b.operation(Op::Difference, &holes);
    b.finish(root)
}

/// A model's random place and motion: positions within `reach`, displacement up to `reach`, one in four without spin, one
/// in eight with several whole turns, one in four at rest.
pub fn placed(r: &mut Random, reach: f64) -> Placed {
    let place = Pose::new(r.vector(0.3), r.rotation());
    let start = Pose::new(r.vector(reach), r.rotation());
    let (move_by, spin) = match r.below(8) {
        0 | 1 => (DVec3::ZERO, DVec3::ZERO),
        2 | 3 => (r.vector(reach), DVec3::ZERO),
        4 => (r.vector(reach), r.vector(25.0)),
        _ => (r.vector(reach), r.vector(1.5)),
    };
    Placed { place, motion: Motion::turning(start, start.position + move_by, spin) }
}
