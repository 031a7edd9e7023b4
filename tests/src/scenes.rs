//! Random scenes: what two solids are, and how they move over a step.
//!
//! A `Recipe` is a solid before it is built, so that laws can rewrite it (scale it, join it, place it elsewhere). The
//! classes are weighted so that well over 30 % of the scenes meet and over 15 % meet on a subtracted surface; the tests
//! that use them count and assert it.

use crate::random_solids::Random;
use crate::reference::{self, Effort, Moving, Truth};
use contactd::solid::primitive::{
    Capsule, Cone, Cuboid, Cylinder, Ellipsoid, EllipticFrustum, Polyhedron, Sphere, Superellipsoid, Torus,
    TriangleMesh,
};
use contactd::solid::{Label, NodeId, Op, Shape, Solid, SolidBuilder};
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec2, DVec3};

/// A solid before it is built.
#[derive(Clone, Debug)]
pub enum Recipe {
    /// A placed primitive.
    Leaf(Shape, Pose),
    /// An operation on others.
    Op(Op, Vec<Recipe>),
}

impl Recipe {
    /// A primitive at the origin.
    pub fn of(shape: impl Into<Shape>) -> Self {
        Recipe::Leaf(shape.into(), Pose::IDENTITY)
    }
    /// Ball of radius r.
    pub fn sphere(radius: f64) -> Self {
        Self::of(Sphere { radius })
    }
    /// Cylinder of radius r and half height h, axis z.
    pub fn cylinder(radius: f64, half_height: f64) -> Self {
        Self::of(Cylinder { radius, half_height })
    }
    /// Cone or frustum, axis z.
    pub fn cone(bottom: f64, top: f64, half_height: f64) -> Self {
        Self::of(Cone { bottom, top, half_height })
    }
    /// Box with the given half extents.
    pub fn cuboid(x: f64, y: f64, z: f64) -> Self {
        Self::of(Cuboid { half: DVec3::new(x, y, z) })
    }
    /// A torus about z.
    pub fn torus(major: f64, minor: f64) -> Self {
        Self::of(Torus { major, minor })
    }
    /// All points within a radius of a segment along z.
    pub fn capsule(half: f64, radius: f64) -> Self {
        Self::of(Capsule { half, radius })
    }
    /// A paraboloid with its tip at z = h above its rim of radius r.
    pub fn dome(radius: f64, height: f64) -> Self {
        Self::of(crate::quadrics::dome_of(radius, height))
    }
    /// All points of a box of the given half extents with x²/a² − y²/b² <= z/c.
    pub fn saddle(x: f64, y: f64, z: f64) -> Self {
        Self::of(crate::quadrics::saddle_of(DVec3::new(x, y, z)))
    }
    /// An ellipsoid with the given semi-axes.
    pub fn ellipsoid(x: f64, y: f64, z: f64) -> Self {
        Self::of(Ellipsoid { semi: DVec3::new(x, y, z) })
    }
    /// Superellipsoid with semi-axes and the exponents of meridians and of the equator, in (0, 1].
    pub fn superellipsoid(semi: DVec3, exponents: [f64; 2]) -> Self {
        Self::of(Superellipsoid { semi, exponents: DVec2::from_array(exponents) })
    }
    /// Regular polyhedron with 4, 6, 8, 12 or 20 faces.
    pub fn platonic(faces: usize, radius: f64) -> Self {
        Self::of(Polyhedron::platonic(faces, radius).expect("4, 6, 8, 12 or 20 faces"))
    }
    /// self ∪ other.
    pub fn union(self, other: Self) -> Self {
        Recipe::Op(Op::Union, vec![self, other])
    }
    /// self ∩ other.
    pub fn intersection(self, other: Self) -> Self {
        Recipe::Op(Op::Intersection, vec![self, other])
    }
    /// self − other.
    pub fn minus(self, other: Self) -> Self {
        Recipe::Op(Op::Difference, vec![self, other])
    }

    /// The same solid seen from the parent of `pose`.
    pub fn moved(&self, pose: &Pose) -> Self {
        self.map(&|shape, frame| (shape.clone(), pose.compose(frame)))
    }
    /// Shifted by (x, y, z).
    pub fn at(&self, x: f64, y: f64, z: f64) -> Self {
        let d = DVec3::new(x, y, z);
        self.map(&|shape, frame| (shape.clone(), Pose::new(frame.position + d, frame.rotation)))
    }
    /// Scaled by k about the origin; exact for powers of two.
    pub fn scaled(&self, k: f64) -> Self {
        self.map(&|shape, frame| (scaled(shape, k), Pose::new(frame.position * k, frame.rotation)))
    }
    fn map(&self, f: &impl Fn(&Shape, &Pose) -> (Shape, Pose)) -> Self {
        match self {
            Recipe::Leaf(s, p) => {
                let (s, p) = f(s, p);
                Recipe::Leaf(s, p)
            }
            Recipe::Op(op, c) => Recipe::Op(*op, c.iter().map(|r| r.map(f)).collect()),
        }
    }

    /// The solid.
    pub fn build(&self) -> Solid {
        let mut builder = SolidBuilder::new();
        let root = self.add(&mut builder);
        builder.finish(root)
    }
    fn add(&self, b: &mut SolidBuilder) -> NodeId {
        match self {
            Recipe::Leaf(shape, frame) => b.primitive(shape.clone(), *frame, Label::default()),
            Recipe::Op(op, children) => {
                let nodes: Vec<NodeId> = children.iter().map(|c| c.add(b)).collect();
                b.operation(*op, &nodes)
            }
        }
    }
}

fn scaled(shape: &Shape, k: f64) -> Shape {
    match shape {
        Shape::Sphere(s) => Sphere { radius: s.radius * k }.into(),
        Shape::Cylinder(c) => Cylinder { radius: c.radius * k, half_height: c.half_height * k }.into(),
        Shape::Cone(c) => Cone { bottom: c.bottom * k, top: c.top * k, half_height: c.half_height * k }.into(),
        Shape::Cuboid(c) => Cuboid { half: c.half * k }.into(),
        Shape::Polyhedron(p) => Polyhedron {
            vertices: p.vertices.iter().map(|v| *v * k).collect::<Vec<_>>().into(),
            planes: p.planes.iter().map(|(n, d)| (*n, d * k)).collect(),
        }
        .into(),
        Shape::HalfSpace(h) => h.clone().into(),
        Shape::TriangleMesh(m) => {
            let points: Vec<DVec3> = m.vertices().iter().map(|v| *v * k).collect();
            TriangleMesh::new(&points, m.triangles()).expect("closed as before").0.into()
        }
        Shape::Torus(t) => Torus { major: t.major * k, minor: t.minor * k }.into(),
        Shape::Capsule(c) => Capsule { half: c.half * k, radius: c.radius * k }.into(),
        Shape::Quadric(q) => crate::quadrics::scaled(q, k).into(),
        Shape::Ellipsoid(e) => Ellipsoid { semi: e.semi * k }.into(),
        Shape::Superellipsoid(s) => Superellipsoid { semi: s.semi * k, exponents: s.exponents }.into(),
        Shape::EllipticFrustum(c) => {
            EllipticFrustum { semi: c.semi * k, half_height: c.half_height * k, ..c.clone() }.into()
        }
    }
}

/// Two solids and their motions over one step; both models stand in their object's frame as built.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The class it was drawn from.
    pub class: &'static str,
    /// First solid.
    pub a: Recipe,
    /// Second solid.
    pub b: Recipe,
    /// Motion of the first.
    pub motion_a: Motion,
    /// Motion of the second.
    pub motion_b: Motion,
    /// Resolution; `None` for the default of 1e-9 of the larger bounding radius.
    pub resolution: Option<f64>,
}

impl Scene {
    /// A scene of two objects.
    pub fn new(class: &'static str, a: Recipe, motion_a: Motion, b: Recipe, motion_b: Motion) -> Self {
        Self { class, a, b, motion_a, motion_b, resolution: None }
    }

    /// b falls along `velocity` from `position` onto a, which rests at the origin.
    pub fn falling(a: Recipe, b: Recipe, position: DVec3, velocity: DVec3) -> Self {
        let motion = Motion::turning(Pose::at(position), position + velocity, DVec3::ZERO);
        Self::new("falling", a, Motion::resting(Pose::IDENTITY), b, motion)
    }

    /// The same scene with the other body first.
    pub fn swapped(&self) -> Self {
        Self { a: self.b.clone(), b: self.a.clone(), motion_a: self.motion_b, motion_b: self.motion_a, ..self.clone() }
    }

    /// The resolution in force: 1e-9 of the larger bounding radius by default.
    pub fn delta(&self) -> f64 {
        self.resolution.unwrap_or_else(|| {
            let radius = |r: &Recipe| {
                let b = r.build().aabb();
                (b.max - b.min).length() / 2.0
            };
            1e-9 * radius(&self.a).max(radius(&self.b))
        })
    }

    /// What the reference says.
    pub fn truth(&self, effort: Effort) -> Truth {
        let (a, b) = (self.a.build(), self.b.build());
        let moving = |solid, motion| Moving { solid, place: Pose::IDENTITY, motion };
        reference::earliest_contact(moving(&a, self.motion_a), moving(&b, self.motion_b), self.delta(), effort)
    }

    /// What the reference says, with more effort where its quick proof leaves a hundredth of the step or more open.
    pub fn truth_with_care(&self) -> Truth {
        let quick = self.truth(Effort::QUICK);
        if quick.time - quick.lower < 0.01 { quick } else { self.truth(Effort::THOROUGH) }
    }

    /// Fastest speed of any point of b relative to a, per step (a bound).
    pub fn speed(&self) -> f64 {
        let radius = |r: &Recipe| {
            let b = r.build().aabb();
            b.min.abs().max(b.max.abs()).length()
        };
        (self.motion_a.velocity - self.motion_b.velocity).length()
            + self.motion_a.spin.length() * radius(&self.a)
            + self.motion_b.spin.length() * radius(&self.b)
    }
}

/// Any primitive of about the given size.
pub fn primitive(rng: &mut Random, size: f64) -> Recipe {
    let mut s = || size * rng.within(0.3, 1.0);
    let (x, y, z) = (s(), s(), s());
    match rng.below(7) {
        0 => Recipe::sphere(x),
        1 => Recipe::cylinder(x, y),
        2 => Recipe::cone(x, 0.0, y),
        3 => Recipe::cone(x, x * rng.within(0.3, 0.9), y),
        4 | 5 => Recipe::cuboid(x, y, z),
        _ => Recipe::platonic([4, 6, 8, 12, 20][rng.below(5)], x),
    }
}

/// A random pose within `reach` of the origin.
pub fn pose(rng: &mut Random, reach: f64) -> Pose {
    Pose::new(rng.vector(reach), rng.rotation())
}

/// A random tree of `leaves` primitives with all operations, size about 1, with an interior.
pub fn tree(rng: &mut Random, leaves: usize) -> Recipe {
    loop {
        let recipe = subtree(rng, leaves);
        let solid = recipe.build();
        if (0..400).any(|_| solid.value(rng.vector(1.0)) < -0.05) {
            return recipe;
        }
    }
}

fn subtree(rng: &mut Random, leaves: usize) -> Recipe {
    if leaves <= 1 {
        let at = pose(rng, 0.35);
        return primitive(rng, 0.7).moved(&at);
    }
    let left = 1 + rng.below(leaves - 1);
    let op = [Op::Union, Op::Union, Op::Difference, Op::Difference, Op::Intersection][rng.below(5)];
    Recipe::Op(op, vec![subtree(rng, left), subtree(rng, leaves - left)])
}

/// Motions that bring b, about `reach` in size like a, from apart towards a; either may turn, sometimes whole turns.
pub fn approach(rng: &mut Random, reach: f64) -> (Motion, Motion) {
    let dir = rng.direction();
    let spin = |rng: &mut Random| match rng.below(8) {
        0 | 1 => DVec3::ZERO,
        2 => rng.direction() * std::f64::consts::TAU,
        _ => rng.vector(1.2),
    };
    let start_a = pose(rng, 0.3 * reach);
    let end_a = start_a.position + if rng.chance(0.4) { DVec3::ZERO } else { rng.vector(0.3 * reach) };
    let start = Pose::new(start_a.position + dir * reach * rng.within(2.2, 3.0), rng.rotation());
    let end = start_a.position - dir * reach * rng.within(0.0, 1.0) + rng.vector(0.6 * reach);
    let (spin_a, spin_b) = (spin(rng), spin(rng));
    (Motion::turning(start_a, end_a, spin_a), Motion::turning(start, end, spin_b))
}

/// A scene of any class.
pub fn any(rng: &mut Random) -> Scene {
    match rng.below(10) {
        0..=2 => trees(rng),
        3 => primitives(rng),
        4 => drilled(rng),
        5 | 6 => cavity(rng),
        7 | 8 => peg(rng),
        _ => socket(rng),
    }
}

/// Two random trees.
pub fn trees(rng: &mut Random) -> Scene {
    let (a, b) = (2 + rng.below(5), 1 + rng.below(5));
    let (a, b) = (tree(rng, a), tree(rng, b));
    let (ma, mb) = approach(rng, 1.0);
    Scene::new("trees", a, ma, b, mb)
}

/// Two primitives.
pub fn primitives(rng: &mut Random) -> Scene {
    let (a, b) = (primitive(rng, 0.8), primitive(rng, 0.8));
    let (ma, mb) = approach(rng, 1.0);
    Scene::new("primitives", a, ma, b, mb)
}

/// A block with many holes, and something small that comes along.
pub fn drilled(rng: &mut Random) -> Scene {
    let mut block = vec![Recipe::cuboid(0.8, 0.8, 0.3)];
    for _ in 0..5 {
        let at =
            Pose::new(DVec3::new(rng.within(-0.6, 0.6), rng.within(-0.6, 0.6), rng.within(-0.1, 0.1)), DQuat::IDENTITY);
        let hole = match rng.below(3) {
            0 => Recipe::cylinder(rng.within(0.15, 0.35), 1.0),
            1 => Recipe::cuboid(rng.within(0.15, 0.3), rng.within(0.15, 0.3), 1.0),
            _ => Recipe::cone(rng.within(0.1, 0.2), rng.within(0.3, 0.4), 0.45),
        };
        block.push(hole.moved(&at));
    }
    let a = Recipe::Op(Op::Difference, block);
    let b = primitive(rng, 0.25);
    let start = Pose::new(DVec3::new(rng.within(-0.6, 0.6), rng.within(-0.6, 0.6), 0.9), rng.rotation());
    let end = start.position + DVec3::new(rng.within(-0.3, 0.3), rng.within(-0.3, 0.3), -1.3);
    let turn = rng.vector(1.0);
    Scene::new("drilled", a, Motion::resting(Pose::IDENTITY), b, Motion::turning(start, end, turn))
}

/// Something inside a cavity that meets its wall from within.
pub fn cavity(rng: &mut Random) -> Scene {
    let hollow = match rng.below(4) {
        0 => Recipe::sphere(0.8),
        1 => Recipe::cylinder(0.8, 0.7),
        2 => Recipe::cuboid(0.7, 0.8, 0.7),
        _ => Recipe::cone(0.9, 0.6, 0.7),
    };
    let a = Recipe::cuboid(1.1, 1.1, 1.1).minus(hollow);
    let leaves = 1 + rng.below(2);
    let b = tree(rng, leaves).scaled(0.25);
    let turn_a = if rng.chance(0.5) { DVec3::ZERO } else { rng.vector(0.6) };
    let start_a = pose(rng, 0.2);
    let start = Pose::new(start_a.position + rng.vector(0.1), rng.rotation());
    let end = start.position + rng.direction() * rng.within(0.3, 1.0);
    let turn = rng.vector(1.5);
    Scene::new("cavity", a, Motion::turning(start_a, start_a.position, turn_a), b, Motion::turning(start, end, turn))
}

/// A peg over or in a hole of a plate: straight, off-axis or tilted, with clearance.
pub fn peg(rng: &mut Random) -> Scene {
    let r = 0.25;
    let round = rng.chance(0.7);
    let hole = if round { Recipe::cylinder(r, 1.0) } else { Recipe::cuboid(r, r, 1.0) };
    let a = Recipe::cuboid(0.8, 0.8, 0.2).minus(hole);
    let c = rng.within(0.8, 0.99) * r;
    let b = if round { Recipe::cylinder(c, 0.5) } else { Recipe::cuboid(c, c, 0.5) };
    let inside = rng.chance(0.6);
    let tilt = DVec3::new(rng.within(-0.05, 0.05), rng.within(-0.05, 0.05), rng.within(-0.05, 0.05));
    let off = DVec3::new(rng.within(-0.02, 0.02), rng.within(-0.02, 0.02), if inside { 0.1 } else { 1.0 });
    if inside {
        let sideways = DVec3::new(rng.within(-0.3, 0.3), rng.within(-0.3, 0.3), rng.within(-0.3, 0.3));
        let start = Pose::at(DVec3::new(0.0, 0.0, off.z));
        return Scene::new(
            "peg",
            a,
            Motion::resting(Pose::IDENTITY),
            b,
            Motion::turning(start, start.position + sideways, tilt * 3.0),
        );
    }
    let start = Pose::new(off, DQuat::from_scaled_axis(tilt));
    let end = off * DVec3::new(1.0, 1.0, 0.0) + DVec3::new(0.0, 0.0, -0.2);
    Scene::new("peg", a, Motion::resting(Pose::IDENTITY), b, Motion::turning(start, end, tilt))
}

/// A ball towards a cup, a cone towards a countersink.
pub fn socket(rng: &mut Random) -> Scene {
    let (a, b) = if rng.chance(0.5) {
        let cup = Recipe::cuboid(0.9, 0.9, 0.5).minus(Recipe::sphere(0.6).at(0.0, 0.0, 0.5));
        (cup, Recipe::sphere(rng.within(0.2, 0.59)))
    } else {
        let sink = Recipe::cuboid(0.9, 0.9, 0.5).minus(Recipe::cone(0.05, 0.7, 0.6));
        (sink, Recipe::cone(0.02, rng.within(0.3, 0.6), 0.4))
    };
    let start = Pose::new(DVec3::new(rng.within(-0.1, 0.1), rng.within(-0.1, 0.1), 1.6), DQuat::IDENTITY);
    let end = DVec3::new(rng.within(-0.1, 0.1), rng.within(-0.1, 0.1), 0.1);
    let turn = rng.vector(0.3);
    Scene::new("socket", a, Motion::resting(Pose::IDENTITY), b, Motion::turning(start, end, turn))
}

/// How many of some scenes meet, miss and overlap, and how many meet on subtracted surfaces.
#[derive(Clone, Copy, Debug, Default)]
pub struct Share {
    /// Scenes that meet.
    pub contact: usize,
    /// Scenes that don't.
    pub clear: usize,
    /// Scenes that overlap at the start.
    pub overlap: usize,
    /// Scenes that could not be decided.
    pub undecided: usize,
    /// Scenes that meet on a subtracted surface.
    pub subtracted: usize,
}

impl Share {
    /// All scenes counted.
    pub fn total(&self) -> usize {
        self.contact + self.clear + self.overlap + self.undecided
    }

    /// Prints the shares under the law's name and asserts what the tests owe: 30 % contact, 15 % on subtracted surfaces.
    pub fn assert_enough(&self, law: &str) {
        let n = self.total().max(1);
        let percent = |k: usize| 100.0 * k as f64 / n as f64;
        println!(
            "{law}: {n} scenes, contact {:.0} %, clear {:.0} %, overlap {:.0} %, undecided {:.0} %; on subtracted surfaces {:.0} %",
            percent(self.contact),
            percent(self.clear),
            percent(self.overlap),
            percent(self.undecided),
            percent(self.subtracted)
        );
        assert!(self.contact * 100 >= 30 * n, "{law}: too few contacts to mean anything");
        assert!(self.subtracted * 100 >= 15 * n, "{law}: too few contacts on subtracted surfaces");
    }
}
