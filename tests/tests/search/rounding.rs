//! The rounding budget of docs/accuracy.md against 160-bit arithmetic.
//!
//! Random faces, places, poses, offsets from the origin up to 1e7, turns up to 81: what the engine computes in doubles may
//! differ from the exact value by no more than the bound E that its exclusions subtract. `--nocapture` prints the worst
//! ratio of each kind. Ten million evaluations (some minutes; any other number likewise):
//! `CONTACTD_EVALUATIONS=10000000 cargo test --release -p contactd-tests --test search rounding:: -- --nocapture`

use contactd::contact::exclusion::clause::{self, Expressions};
use contactd::contact::exclusion::enumeration;
use contactd::contact::exclusion::literal::{Faces, Side, View};
use contactd::contact::exclusion::{fit, rounding};
use contactd::motion::{Placed, Relative};
use contactd::octree::Model;
use contactd::solid::local::{LiteralId, literal_token};
use contactd::solid::primitive::{Cone, Cylinder, Sphere};
use contactd::solid::{Face, Label, Sense, Shape, SolidBuilder, surface};
use contactd_proto::{Motion, Pose};
use contactd_tests::quadrics;
use contactd_tests::random_solids::{self, Random};
use contactd_tests::sweep::sized;
use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use glam::{DQuat, DVec3};
use std::f64::consts::TAU;

/// Binary digits of the reference: 107 more than a double has.
const DIGITS: usize = 160;

type Big = FBig<HalfEven, 2>;

fn big(x: f64) -> Big {
    Big::try_from(x).expect("finite").with_precision(DIGITS).value()
}

fn double(x: &Big) -> f64 {
    x.to_f64().value()
}

#[derive(Clone, Debug)]
struct Vector([Big; 3]);

impl Vector {
    fn of(v: DVec3) -> Self {
        Self(v.to_array().map(big))
    }
    fn plus(&self, o: &Self) -> Self {
        Self(std::array::from_fn(|k| &self.0[k] + &o.0[k]))
    }
    fn minus(&self, o: &Self) -> Self {
        Self(std::array::from_fn(|k| &self.0[k] - &o.0[k]))
    }
    fn times(&self, s: &Big) -> Self {
        Self(std::array::from_fn(|k| &self.0[k] * s))
    }
    fn dot(&self, o: &Self) -> Big {
        &self.0[0] * &o.0[0] + &self.0[1] * &o.0[1] + &self.0[2] * &o.0[2]
    }
    fn length(&self) -> Big {
        let square = self.dot(self);
        if square == Big::ZERO { big(0.0) } else { square.sqrt() }
    }
}

/// Rows of a matrix.
#[derive(Clone, Debug)]
struct Matrix([Vector; 3]);

impl Matrix {
    /// The rotation of a quaternion x y z w of any length.
    fn of(q: &[Big; 4]) -> Self {
        let [x, y, z, w] = q;
        let two = big(2.0) / (x * x + y * y + z * z + w * w);
        let entry = |diagonal: f64, v: Big| big(diagonal) + &two * v;
        Self([
            Vector([entry(1.0, -(y * y) - z * z), entry(0.0, x * y - w * z), entry(0.0, x * z + w * y)]),
            Vector([entry(0.0, x * y + w * z), entry(1.0, -(x * x) - z * z), entry(0.0, y * z - w * x)]),
            Vector([entry(0.0, x * z - w * y), entry(0.0, y * z + w * x), entry(1.0, -(x * x) - y * y)]),
        ])
    }
    fn times(&self, v: &Vector) -> Vector {
        Vector(std::array::from_fn(|k| self.0[k].dot(v)))
    }
    fn transposed(&self) -> Self {
        Self(std::array::from_fn(|k| Vector(std::array::from_fn(|j| self.0[j].0[k].clone()))))
    }
}

fn quaternion(q: DQuat) -> [Big; 4] {
    q.to_array().map(big)
}

/// Where a body is, exactly: world = rotation·(place·x + at) + position.
struct Exact {
    rotation: Matrix,
    position: Vector,
    place: Matrix,
    at: Vector,
}

impl Exact {
    fn of(placed: &Placed, t: f64) -> Self {
        let m = &placed.motion;
        let start = quaternion(m.start.rotation);
        let spin = Vector::of(m.spin).times(&big(t));
        let angle = spin.length();
        let rotation = if angle == Big::ZERO {
            Matrix::of(&start)
        } else {
            let (s, c) = (&angle / big(2.0)).sin_cos();
            let v = spin.times(&(s / &angle));
            let [x, y, z, w] = &start;
            let [a, b, d] = &v.0;
            Matrix::of(&[
                &c * x + a * w + b * z - d * y,
                &c * y - a * z + b * w + d * x,
                &c * z + a * y - b * x + d * w,
                &c * w - a * x - b * y - d * z,
            ])
        };
        let position = Vector::of(m.start.position).plus(&Vector::of(m.velocity).times(&big(t)));
        let place = Matrix::of(&quaternion(placed.place.rotation));
        Self { rotation, position, place, at: Vector::of(placed.place.position) }
    }
    fn world(&self, x: &Vector) -> Vector {
        self.rotation.times(&self.place.times(x).plus(&self.at)).plus(&self.position)
    }
    fn model(&self, x: &Vector) -> Vector {
        let object = self.rotation.transposed().times(&x.minus(&self.position));
        self.place.transposed().times(&object.minus(&self.at))
    }
}

/// psi, from the stored numbers of the face.
fn psi(face: &Face, x: &Vector) -> Big {
    let across = |axis: DVec3, o: &Vector| {
        let a = Vector::of(axis);
        let z = o.dot(&a);
        (o.minus(&a.times(&z)).length(), z)
    };
    match *face {
        Face::Plane(surface::Plane { normal, offset }) => Vector::of(normal).dot(x) - big(offset),
        Face::Sphere(surface::Sphere { center, radius }) => x.minus(&Vector::of(center)).length() - big(radius),
        Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
            across(axis, &x.minus(&Vector::of(origin))).0 - big(radius)
        }
        Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
            let (rho, z) = across(axis, &x.minus(&Vector::of(apex)));
            rho * big(cos) - z * big(sin)
        }
        Face::Torus(surface::Torus { origin, axis, major, minor }) => {
            let (rho, z) = across(axis, &x.minus(&Vector::of(origin)));
            let off = rho - big(major);
            let square = &off * &off + &z * &z;
            (if square == Big::ZERO { big(0.0) } else { square.sqrt() }) - big(minor)
        }
        Face::Capsule(surface::Capsule { origin, axis, half, radius }) => {
            let (o, a) = (x.minus(&Vector::of(origin)), Vector::of(axis));
            // The axis' stored length stays in the point of the segment, as across a cylinder.
            let z = o.dot(&a);
            let (low, high) = (big(-half), big(half));
            let z = if z < low {
                low
            } else if z > high {
                high
            } else {
                z
            };
            o.minus(&a.times(&z)).length() - big(radius)
        }
        Face::Elliptic(e) => stretched(&e.parts(), &x.minus(&Vector::of(e.origin))),
        Face::Bowl(b) => stretched(&b.parts(), &x.minus(&Vector::of(b.origin))),
        Face::Superellipsoid(s) => norm(&s, &x.minus(&Vector::of(s.origin))),
        Face::Saddle(s) => {
            let (sides, y) = (s.sides(), x.minus(&Vector::of(s.origin)));
            let length = |rows: [surface::Row; 2]| {
                let [a, b] = rows.map(|row| Vector::of(row.slope).dot(&y) + big(row.at));
                Vector([a, b, big(0.0)]).length()
            };
            length(sides.plus) - length(sides.minus)
        }
    }
}

/// sN − s, from the rows that the engine makes of the stored numbers, with the exponents 2/e as they are.
fn norm(face: &surface::Superellipsoid, y: &Vector) -> Big {
    let parts = face.parts();
    let [a, b, c] = parts.rows.map(|row| {
        let v = Vector::of(row).dot(y);
        if v < Big::ZERO { -v } else { v }
    });
    let [p, q] = face.exponents.to_array().map(|e| big(2.0) / big(e));
    let joined = |a: Big, b: Big, p: &Big| {
        let (large, small) = if a < b { (b, a) } else { (a, b) };
        if small == Big::ZERO {
            return large;
        }
        let power = ((&small / &large).ln() * p).exp();
        large * ((big(1.0) + power).ln() / p).exp()
    };
    joined(joined(a, b, &q), c, &p) - big(parts.radius)
}

fn stretched(parts: &surface::Stretch, y: &Vector) -> Big {
    Vector(parts.rows.map(|row| Vector::of(row).dot(y))).length() - Vector::of(parts.fall).dot(y) - big(parts.radius)
}

/// G of a fit (`contact::exclusion::fit`) over A's frame, for round faces: squares, radii, depth.
fn exact_fit(p: (&Face, &Vector), q: (&Face, &Vector), delta: f64, mu: [f64; 2]) -> Option<Big> {
    // |u|² − ρ² of a face that delta shrinks; the fit takes an axis' direction, not its stored length.
    let square = |face: &Face, x: &Vector, shrink: f64| {
        let (origin, axis, radius, steep) = match part_of(face, x) {
            Face::Sphere(surface::Sphere { center, radius }) => {
                (Vector::of(center), None, big(radius) - big(shrink), big(0.0))
            }
            Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
                (Vector::of(origin), Some(axis), big(radius) - big(shrink), big(0.0))
            }
            Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
                let tan = big(sin) / big(cos);
                (Vector::of(apex + axis * (shrink / sin)), Some(axis), big(0.0), &tan * &tan)
            }
            Face::Plane(_)
            | Face::Torus(_)
            | Face::Elliptic(_)
            | Face::Capsule(_)
            | Face::Bowl(_)
            | Face::Superellipsoid(_)
            | Face::Saddle(_) => return None,
        };
        let o = x.minus(&origin);
        let along = axis.map_or(big(0.0), |a| {
            let (z, a) = (o.dot(&Vector::of(a)), Vector::of(a));
            &z * &z / a.dot(&a)
        });
        Some(o.dot(&o) - along * (big(1.0) + steep) - &radius * &radius)
    };
    Some(big(mu[0]) * square(p.0, p.1, delta)? - big(mu[1]) * square(q.0, q.1, -delta)?)
}

/// The face itself, or of a capsule its cylinder or the ball at one of its ends, which it is around a point.
fn part_of(face: &Face, x: &Vector) -> Face {
    let Face::Capsule(surface::Capsule { origin, axis, half, radius }) = *face else { return *face };
    let along = x.minus(&Vector::of(origin)).dot(&Vector::of(axis));
    if along > big(half) {
        surface::Sphere { center: origin + axis * half, radius }.into()
    } else if along < big(-half) {
        surface::Sphere { center: origin - axis * half, radius }.into()
    } else {
        surface::Cylinder { origin, axis, radius }.into()
    }
}

/// Random models: primitives and trees, frusta with a far apex, faces far from the model's origin.
fn models(r: &mut Random) -> Vec<Model> {
    let mut models = Vec::new();
    for i in 0..48 {
        let solid = match i % 4 {
            0 => random_solids::solid(r, 2),
            1 => {
                let taper = 10f64.powf(r.within(-6.0, 0.0));
                let shape: Shape = Cone { bottom: 1.0, top: 1.0 - 0.9 * taper, half_height: r.within(0.2, 2.0) }.into();
                alone(r, shape)
            }
            2 => {
                let shape: Shape = if r.chance(0.5) {
                    Sphere { radius: r.within(0.2, 1.0) }.into()
                } else {
                    Cylinder { radius: r.within(0.2, 1.0), half_height: r.within(0.2, 2.0) }.into()
                };
                alone(r, shape)
            }
            _ => {
                let shape = random_solids::shape(r, 1.0);
                alone(r, shape)
            }
        };
        // Trees of which nothing is left have nowhere to put a cell.
        let model = Model::new(solid);
        if model.bounds.root().is_finite() {
            models.push(model);
        }
    }
    models
}

/// One primitive, placed anywhere up to a hundred sizes from the model's origin.
fn alone(r: &mut Random, shape: Shape) -> contactd::solid::Solid {
    let far = 10f64.powf(r.within(-1.0, 2.0));
    let mut b = SolidBuilder::new();
    let root = b.primitive(shape, Pose::new(r.vector(far), r.rotation()), Label::default());
    b.finish(root)
}

/// A motion near `base`; `turns` in radians.
fn motion(r: &mut Random, base: DVec3, reach: f64, turns: f64) -> Motion {
    let start = Pose::new(base + r.vector(reach), r.rotation());
    Motion { start, velocity: r.vector(reach), spin: r.direction() * turns }
}

#[derive(Default)]
struct Worst {
    value: f64,
    normal: f64,
    plane: f64,
    fit: f64,
    time: f64,
    evaluations: u64,
}

impl Worst {
    fn see(&mut self, kind: fn(&mut Self) -> &mut f64, difference: f64, bound: f64, what: &dyn Fn() -> String) {
        assert!(difference <= bound, "{}: off by {difference:e}, budget {bound:e}", what());
        let worst = kind(self);
        *worst = worst.max(difference / bound);
        self.evaluations += 1;
    }
}

/// How many numbers a test compares: `few` in the command.
fn evaluations(few: u64) -> u64 {
    sized("CONTACTD_EVALUATIONS", few)
}

/// Of each kind of solid by itself.
const OF_A_KIND: u64 = 4_000;

#[test]
fn nothing_that_is_computed_differs_from_the_exact_value_by_more_than_the_budget() {
    let mut r = Random::new(7);
    let models = models(&mut r);
    evaluate(&mut r, &models, evaluations(20_000), "all kinds");
}

#[test]
fn nothing_that_is_computed_of_a_torus_differs_by_more_than_the_budget() {
    let mut r = Random::new(8);
    let shapes: Vec<Shape> = (0..24).map(|_| random_solids::torus(&mut r, 1.0).into()).collect();
    let models: Vec<Model> = shapes.into_iter().map(|shape| Model::new(alone(&mut r, shape))).collect();
    evaluate(&mut r, &models, evaluations(OF_A_KIND), "tori");
}

#[test]
fn nothing_that_is_computed_of_an_elliptic_face_differs_by_more_than_the_budget() {
    let mut r = Random::new(9);
    let shapes: Vec<Shape> = (0..48).map(|_| random_solids::elliptic(&mut r, 1.0)).collect();
    let models: Vec<Model> = shapes.into_iter().map(|shape| Model::new(alone(&mut r, shape))).collect();
    evaluate(&mut r, &models, evaluations(OF_A_KIND), "elliptic faces");
}

#[test]
fn nothing_that_is_computed_of_a_capsule_differs_by_more_than_the_budget() {
    let mut r = Random::new(10);
    let shapes: Vec<Shape> = (0..24).map(|_| random_solids::capsule(&mut r, 1.0).into()).collect();
    let models: Vec<Model> = shapes.into_iter().map(|shape| Model::new(alone(&mut r, shape))).collect();
    evaluate(&mut r, &models, evaluations(OF_A_KIND), "capsules");
}

#[test]
fn nothing_that_is_computed_of_a_quadric_differs_by_more_than_the_budget() {
    let mut r = Random::new(11);
    let shapes: Vec<Shape> = (0..48).map(|_| quadrics::random(&mut r, 1.0)).collect();
    let models: Vec<Model> = shapes.into_iter().map(|shape| Model::new(alone(&mut r, shape))).collect();
    evaluate(&mut r, &models, evaluations(OF_A_KIND), "quadrics");
}

#[test]
fn nothing_that_is_computed_of_a_superellipsoid_differs_by_more_than_the_budget() {
    let mut r = Random::new(15);
    let shapes: Vec<Shape> = (0..48).map(|_| random_solids::superellipsoid(&mut r, 1.0).into()).collect();
    let models: Vec<Model> = shapes.into_iter().map(|shape| Model::new(alone(&mut r, shape))).collect();
    // Logarithms of many digits take their time.
    evaluate(&mut r, &models, evaluations(20_000).div_ceil(20), "superellipsoids");
}

/// Draws cells, literals and times until so many numbers were compared.
fn evaluate(r: &mut Random, models: &[Model], wanted: u64, name: &str) {
    let mut worst = Worst::default();
    while worst.evaluations < wanted {
        let (a, mut b) = (&models[r.below(models.len())], &models[r.below(models.len())]);
        // Axes that all but coincide: what tells them apart is as small as what rounding leaves of a difference.
        let leans = r.chance(0.2);
        if leans {
            b = a;
        }
        let offset = if r.chance(0.5) { 10f64.powf(r.within(0.0, 7.0)) } else { 0.0 };
        let base = r.vector(offset);
        let reach = 10f64.powf(r.within(-1.0, 2.0));
        let turns = |r: &mut Random| match r.below(4) {
            0 => 0.0,
            1 => r.within(0.0, 81.0) * TAU,
            _ => r.within(0.0, 3.0),
        };
        let (turns_a, turns_b) = (turns(r), turns(r));
        let place = |r: &mut Random| Pose::new(r.vector(2.0), r.rotation());
        let placed_a = Placed { place: place(r), motion: motion(r, base, reach, turns_a) };
        let mut placed_b = Placed { place: place(r), motion: motion(r, base, reach, turns_b) };
        if leans {
            let lean =
                contactd_proto::motion::quat_of_rotation_vector(r.direction() * 10f64.powf(r.within(-12.0, -3.0)));
            placed_b = placed_a;
            placed_b.place.rotation = (placed_a.place.rotation * lean).normalize();
        }
        let relative = Relative::new(placed_a, placed_b);
        let budget = rounding::of_literals(a, b, &relative);
        let t = if r.chance(0.1) { 0.0 } else { r.within(0.0, 1.0) };
        let exact = (Exact::of(&placed_a, t), Exact::of(&placed_b, t));
        let in_b = |x: DVec3| {
            let x = Vector::of(x);
            (exact.1.model(&exact.0.world(&x)), x)
        };
        let at = relative.at(t);
        let aabb = a.bounds.root().aabb;
        for _ in 0..6 {
            let mut center = r.point_in(&aabb);
            let mut size = 10f64.powf(r.within(-9.0, -0.5));
            let mut beside_axis_of = None;
            if r.chance(0.3) {
                // On an axis, where directions are noise, or very near it, in a cell of that size.
                if let Some((face, origin)) = axis_point(r, a) {
                    beside_axis_of = Some(face);
                    size = 10f64.powf(r.within(-14.0, -8.0));
                    let beside = if r.chance(0.3) { DVec3::ZERO } else { r.direction() * size * aabb.half().length() };
                    center = (origin + beside).clamp(aabb.min, aabb.max);
                }
            }
            let half = (aabb.half() * size).min(aabb.max - center).min(center - aabb.min);
            let x_max = (center - at.center_a).length() + half.length();
            let h = r.within(0.0, 1.0 - t);
            let view = View {
                a: Faces { solid: &a.solid, clip_planes: &[] },
                b: Faces { solid: &b.solid, clip_planes: &[] },
                at: &at,
                motion: relative.bounds(t, h, x_max),
                center,
                half,
                radius: half.length(),
                center_b: at.b_point(center),
                velocity: at.velocity(center),
                delta: 1e-9,
                wall: 1e-9,
                rounding: budget,
                fits: true,
                multipliers: true,
                curved: true,
            };
            let inside = |r: &mut Random| (center + half * r.vector(1.0)).clamp(center - half, center + half);
            let (c_b, c_a) = in_b(center);
            let x = inside(r);
            let (x_b, x_a) = in_b(x);
            for _ in 0..6 {
                // The face whose axis is near is asked most of the time.
                let near = beside_axis_of.filter(|_| r.chance(0.7));
                let side = if near.is_some() || r.chance(0.3) { Side::A } else { Side::B };
                let solid = if side == Side::A { &a.solid } else { &b.solid };
                let sense = if r.chance(0.6) { Sense::Positive } else { Sense::Negative };
                let id = LiteralId::new(near.unwrap_or_else(|| r.below(solid.faces.len())) as u32, sense);
                let face = &solid.faces[id.face() as usize];
                let sign = if sense == Sense::Positive { big(1.0) } else { big(-1.0) };
                let own = |in_a: &Vector, in_b: &Vector| psi(face, if side == Side::A { in_a } else { in_b });
                let what = || format!("{face:?} of {side:?} {sense:?} at {center}, t {t}, {placed_a:?} {placed_b:?}");
                // The value at the centre, both ways.
                let point = if side == Side::A { center } else { view.center_b };
                let computed = face.at(point);
                let difference = double(&(big(computed.value) - own(&c_a, &c_b))).abs();
                worst.see(|w| &mut w.value, difference, budget, &what);
                assert_eq!(computed.value.to_bits(), face.value(point).to_bits(), "{}", what());
                // A plane's gradient over the cell, both ways.
                if let Face::Plane(surface::Plane { normal, .. }) = *face {
                    let along = if side == Side::B { at.a_vector(normal) } else { normal };
                    let step = x - center;
                    let difference =
                        big(along.x) * big(step.x) + big(along.y) * big(step.y) + big(along.z) * big(step.z)
                            - (own(&x_a, &x_b) - own(&c_a, &c_b));
                    let exact_step = double(&x_a.minus(&c_a).minus(&Vector::of(step)).length());
                    worst.see(|w| &mut w.normal, double(&difference).abs() - exact_step, budget, &what);
                }
                // The literal's plane never lies above the literal, wherever it is touched.
                let l = if sense == Sense::Positive && r.chance(0.5) {
                    let far = 10f64.powf(r.within(-3.0, 6.0));
                    view.tangent(side, id, point + r.vector(far))
                } else {
                    view.linear(side, id, DVec3::ZERO)
                };
                let plane = |l: &contactd::contact::exclusion::literal::Linear| {
                    big(l.bound) + Vector::of(l.normal).dot(&x_a.minus(&c_a))
                };
                let above = plane(&l) - (own(&x_a, &x_b) * &sign + big(view.delta));
                worst.see(|w| &mut w.plane, double(&above).max(0.0), budget, &what);
                // Neither does a fit's.
                let other = if side == Side::A { &b.solid } else { &a.solid };
                let round = |f: &Face| !matches!(f, Face::Plane(_));
                let fitting = (0..other.faces.len()).find(|i| round(face) && round(&other.faces[*i]));
                if let (Sense::Positive, Some(i)) = (sense, fitting) {
                    let other_side = if side == Side::A { Side::B } else { Side::A };
                    let q = LiteralId::new(i as u32, Sense::Negative);
                    let both = fit::Fitted::of(&view, side, id).zip(fit::Fitted::of(&view, other_side, q));
                    for (l, touchable) in both.iter().flat_map(|(p, q)| fit::fit(&view, p, q)) {
                        let Some(mu) = l.weights else { continue };
                        let (in_p, in_q) = if side == Side::A { (&x_a, &x_b) } else { (&x_b, &x_a) };
                        let g = exact_fit((face, in_p), (&other.faces[i], in_q), view.delta, mu).expect("round");
                        // Its own rounding is subtracted already; E stands for the sums.
                        worst.see(|w| &mut w.fit, double(&(plane(&l) - &g)).max(0.0), budget, &what);
                        let touched = fit::touch(&view, &l, &touchable.expect("curved fits"), inside(r) - center);
                        worst.see(|w| &mut w.fit, double(&(plane(&touched) - &g)).max(0.0), budget, &what);
                    }
                }
            }
            // Through time: what a clause of one or two literals excludes stays excluded until then.
            let pick = |r: &mut Random, m: &Model| LiteralId::new(r.below(m.solid.faces.len()) as u32, Sense::Positive);
            let (on_a, on_b) = (pick(r, a), pick(r, b));
            let pool = [literal_token(on_a), literal_token(on_b)];
            let alone = r.chance(0.5);
            let pair = Expressions { pool: &pool, a: if alone { (0, 0) } else { (0, 1) }, b: (1, 2) };
            let free = enumeration::advance(&view, &pair, &[], budget, 0.0, &mut clause::Scratch::default()).dt;
            if free > 0.0 && r.chance(0.5) {
                let later = t + free.min(h);
                let later = if later - t > free.min(h) { later.next_down() } else { later };
                let exact = (Exact::of(&placed_a, later), Exact::of(&placed_b, later));
                for corner in [x, center - half, center + half, center + half * DVec3::new(1.0, -1.0, 1.0)] {
                    let x = Vector::of(corner);
                    let on_b = psi(&b.solid.faces[on_b.face() as usize], &exact.1.model(&exact.0.world(&x)));
                    let on_a = if alone { on_b.clone() } else { psi(&a.solid.faces[on_a.face() as usize], &x) };
                    let most = if on_a > on_b { on_a } else { on_b };
                    // What is left of E at the end of the span.
                    let left = double(&(most + big(view.delta)));
                    let used = budget - left;
                    worst.see(|w| &mut w.time, used.max(0.0), budget, &|| format!("free for {free} from {t}"));
                }
            }
        }
    }
    println!(
        "{name}: {} evaluations; worst share of the budget: value {:.3}, normal {:.3}, plane {:.3}, fit {:.3}, time {:.3}",
        worst.evaluations, worst.value, worst.normal, worst.plane, worst.fit, worst.time
    );
    // The budget is a worst case, not a fantasy: something comes within two orders of magnitude of it.
    assert!(worst.value > 0.01, "the budget is a hundred times what was ever seen");
}

/// A curved face, drawn from those of the model, and a point of its axis or its centre.
fn axis_point(r: &mut Random, m: &Model) -> Option<(usize, DVec3)> {
    let curved: Vec<usize> =
        (0..m.solid.faces.len()).filter(|i| !matches!(m.solid.faces[*i], Face::Plane(_))).collect();
    let face = *curved.get(r.below(curved.len().max(1)))?;
    let point = match m.solid.faces[face] {
        Face::Cylinder(surface::Cylinder { origin, axis, .. }) => origin + axis * r.within(-1.0, 1.0),
        Face::Cone(surface::Cone { apex, axis, .. }) => apex + axis * r.within(0.0, 2.0),
        Face::Sphere(surface::Sphere { center, .. }) => center,
        // On its axis, or on its circle.
        Face::Torus(surface::Torus { origin, axis, .. }) if r.chance(0.5) => origin + axis * r.within(-1.0, 1.0),
        Face::Torus(surface::Torus { origin, axis, major, .. }) => {
            let u = axis.any_orthonormal_vector();
            let (sin, cos) = r.within(0.0, TAU).sin_cos();
            origin + (u * cos + axis.cross(u) * sin) * major
        }
        Face::Capsule(surface::Capsule { origin, axis, half, .. }) => origin + axis * (half * r.within(-1.0, 1.0)),
        Face::Elliptic(e) => {
            let along = if e.third > 0.0 { 0.0 } else { r.within(if e.third < 0.0 { 0.0 } else { -1.0 }, 2.0) };
            e.origin + e.axis() * along
        }
        // On its axis; of a saddle where P, or of a hyperbolic paraboloid N, is zero, too.
        Face::Bowl(b) => b.origin + b.axes().z_axis * r.within(-1.0, 2.0) * b.radius,
        Face::Saddle(s) => {
            let (axes, along) = (s.axes(), r.within(-1.0, 1.0));
            match (s.is_parabolic(), r.chance(0.5)) {
                (false, _) => s.origin + axes.z_axis * along,
                (true, true) => s.origin + axes.z_axis * s.size + axes.y_axis * along,
                (true, false) => s.origin - axes.z_axis * s.size + axes.x_axis * along,
            }
        }
        // Its centre, or on an axis or a plane of symmetry, where parts vanish.
        Face::Superellipsoid(s) => {
            let kept = DVec3::from_array([0, 1, 2].map(|_| if r.chance(0.5) { 1.0 } else { 0.0 }));
            s.origin + s.axes() * (r.vector(1.5) * s.semi * kept)
        }
        Face::Plane(_) => return None,
    };
    Some((face, point))
}
