//! Whole convex primitives against supports and memberships of the test's own: at an instant, and over a step at random times of it.
//!
//! A pair of points bounds the distance from above where each is in its body, and from below along the direction between them, by what
//! the bodies reach along it. Where both are the same, that is the distance, and no other pair of points is as near.
//!
//! `CONTACTD_CONVEX_DISTANCES=1000 cargo test --release -p contactd-tests --test distances convex:: -- --nocapture` sets the number of
//! pairs of each two kinds (6 by default).

use contactd::contact::PlacedModel;
use contactd::contact::distance::{DEFAULT_LIMIT, Distance, DistanceQuery, at_instant, over_step};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::{
    Capsule, Cone, Cuboid, Cylinder, Ellipsoid, EllipticFrustum, HalfSpace, Polyhedron, Sphere, Superellipsoid,
};
use contactd::solid::{Op, Shape};
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec2, DVec3, dvec2, dvec3};

/// How exact an answer is asked for, in lengths of about the size of the bodies.
const TOLERANCE: f64 = 1e-10;
/// How far apart the bounds of the reported points may be.
const EXACT: f64 = 2e-11;

/// A body as the test knows it, in its own frame.
enum Own {
    Ball(f64),
    Box(DVec3),
    Capsule {
        half: f64,
        radius: f64,
    },
    /// Two ellipses: half the height, semi-axes, sizes below and above, how far the middle goes aside per height.
    Ends {
        half: f64,
        semi: DVec2,
        sizes: [f64; 2],
        lean: DVec2,
    },
    Ellipsoid(DVec3),
    Super {
        semi: DVec3,
        powers: DVec2,
    },
    Hull(Polyhedron),
    Below,
}

const KINDS: usize = 10;

impl Own {
    fn random(kind: usize, r: &mut Random) -> (Self, Shape) {
        let mut length = || r.within(0.2, 1.0);
        match kind {
            0 => {
                let radius = length();
                (Own::Ball(radius), Sphere { radius }.into())
            }
            1 => {
                let half = dvec3(length(), length(), length());
                (Own::Box(half), Cuboid { half }.into())
            }
            2 => {
                let (half, radius) = (length(), length());
                (Own::Capsule { half, radius }, Capsule { half, radius }.into())
            }
            3 => {
                let (half, radius) = (length(), length());
                let own = Own::Ends { half, semi: DVec2::splat(radius), sizes: [1.0, 1.0], lean: DVec2::ZERO };
                (own, Cylinder { radius, half_height: half }.into())
            }
            4 | 5 => {
                let (half, bottom, top) = (length(), length(), if kind == 4 { 0.0 } else { length() });
                let own = Own::Ends { half, semi: DVec2::ONE, sizes: [bottom, top], lean: DVec2::ZERO };
                (own, Cone { bottom, top, half_height: half }.into())
            }
            6 => {
                let semi = dvec3(length(), length(), length());
                (Own::Ellipsoid(semi), Ellipsoid { semi }.into())
            }
            7 => {
                let (half, semi) = (length(), dvec2(length(), length()));
                let (lean, top) = (
                    dvec2(length() - 0.6, length() - 0.6),
                    if r.within(0.0, 1.0) < 0.5 { 1.0 } else { r.within(0.0, 1.0) },
                );
                let own = Own::Ends { half, semi, sizes: [1.0, top], lean };
                (own, EllipticFrustum { semi, bottom: 1.0, top, half_height: half, lean }.into())
            }
            8 => {
                let semi = dvec3(length(), length(), length());
                let exponents = dvec2(r.within(0.15, 1.0), r.within(0.15, 1.0));
                let shape = Superellipsoid { semi, exponents };
                (Own::Super { semi, powers: 2.0 / exponents }, shape.into())
            }
            _ => {
                let semi = dvec3(length(), length(), length());
                let hull = Polyhedron::hull((0..14).map(|_| r.direction() * semi).collect()).expect("a hull");
                (Own::Hull(hull.clone()), hull.into())
            }
        }
    }

    /// Largest n·x; n has the length 1.
    fn reach(&self, n: DVec3) -> f64 {
        match self {
            Own::Ball(radius) => *radius,
            Own::Box(half) => n.abs().dot(*half),
            Own::Capsule { half, radius } => n.z.abs() * half + radius,
            Own::Ends { half, semi, sizes, lean } => {
                let rim = (*semi * n.truncate()).length();
                let up = half * (n.z + lean.dot(n.truncate()));
                (rim * sizes[0] - up).max(rim * sizes[1] + up)
            }
            Own::Ellipsoid(semi) => (*semi * n).length(),
            Own::Super { semi, powers } => {
                // The dual norm: 1/p + 1/q = 1.
                let q = *powers / (*powers - 1.0);
                let m = (*semi * n).abs();
                let across = (m.x.powf(q.y) + m.y.powf(q.y)).powf(1.0 / q.y);
                (across.powf(q.x) + m.z.powf(q.x)).powf(1.0 / q.x)
            }
            Own::Hull(hull) => hull.vertices.iter().map(|v| n.dot(*v)).fold(f64::NEG_INFINITY, f64::max),
            Own::Below => {
                if n.distance(DVec3::Z) < 1e-14 {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
        }
    }

    /// How far a point is outside, about: no more than that where it is positive, and negative inside.
    fn beyond(&self, x: DVec3) -> f64 {
        match self {
            Own::Ball(radius) => x.length() - radius,
            Own::Box(half) => (x.abs() - *half).max_element(),
            Own::Capsule { half, radius } => (x - DVec3::Z * x.z.clamp(-half, *half)).length() - radius,
            Own::Ends { half, semi, sizes, lean } => {
                let size = sizes[0] + (sizes[1] - sizes[0]) * (x.z + half) / (2.0 * half);
                let off = ((x.truncate() - *lean * x.z) / *semi).length() - size;
                (off * semi.min_element()).max(x.z.abs() - half)
            }
            Own::Ellipsoid(semi) => ((x / *semi).length() - 1.0) * semi.min_element(),
            Own::Super { semi, powers } => {
                let [x, y, z] = (x / *semi).abs().to_array();
                let across = (x.powf(powers.y) + y.powf(powers.y)).powf(1.0 / powers.y);
                ((across.powf(powers.x) + z.powf(powers.x)).powf(1.0 / powers.x) - 1.0) * semi.min_element()
            }
            Own::Hull(hull) => hull.planes.iter().map(|(n, d)| n.dot(x) - d).fold(f64::NEG_INFINITY, f64::max),
            Own::Below => x.z,
        }
    }
}

/// A body where it stands.
struct Body {
    own: Own,
    model: Model,
    /// The same as a union with a ball inside it: no primitive alone.
    tree: Model,
    /// Of the primitive in its model.
    frame: Pose,
}

impl Body {
    fn new((own, shape): (Own, Shape), r: &mut Random) -> Self {
        let frame = if r.within(0.0, 1.0) < 0.5 { Pose::IDENTITY } else { Pose::new(r.vector(0.5), r.rotation()) };
        let leaf = Recipe::Leaf(shape, frame);
        let within =
            Pose::new(frame.point(if let Own::Below = own { -DVec3::Z } else { DVec3::ZERO }), DQuat::IDENTITY);
        let ball = Recipe::Leaf(Sphere { radius: 1e-3 }.into(), within);
        let tree = Model::new(Recipe::Op(Op::Union, vec![leaf.clone(), ball]).build());
        Self { own, model: Model::new(leaf.build()), tree, frame }
    }

    /// Largest n·x of the body at a pose.
    fn reach(&self, at: &Pose, n: DVec3) -> f64 {
        let own = self.frame.rotation.conjugate() * (at.rotation.conjugate() * n);
        n.dot(at.point(self.frame.position)) + self.own.reach(own)
    }

    fn beyond(&self, at: &Pose, x: DVec3) -> f64 {
        self.own.beyond(self.frame.inverse().point(at.inverse().point(x)))
    }
}

struct Pair {
    bodies: [Body; 2],
    motions: [Motion; 2],
}

impl Pair {
    /// Two bodies of which a plane keeps a gap, or none.
    fn new(kinds: [usize; 2], r: &mut Random) -> Self {
        let a = Body::new(Own::random(kinds[0], r), r);
        let b = if kinds[1] == KINDS { (Own::Below, HalfSpace.into()) } else { Own::random(kinds[1], r) };
        let b = Body::new(b, r);
        let (at_a, turn) = (Pose::new(r.vector(2.0), r.rotation()), r.rotation());
        let u = if kinds[1] == KINDS { turn * (b.frame.rotation * -DVec3::Z) } else { r.direction() };
        let gap = match r.within(0.0, 1.0) {
            x if x < 0.2 => -r.within(0.0, 0.3),
            x if x < 0.3 => 0.0,
            x if x < 0.5 => 10f64.powf(r.within(-7.0, -1.0)),
            _ => r.within(0.0, 2.0),
        };
        let at_b = Pose::new(DVec3::ZERO, turn);
        let aside = if kinds[1] == KINDS { DVec3::ZERO } else { r.vector(0.7) };
        let way = u * (a.reach(&at_a, u) + b.reach(&at_b, -u) + gap) + aside - u * aside.dot(u);
        let speed = 10f64.powf(r.within(-2.0, 0.3));
        let mut motion = |start| Motion { start, velocity: r.vector(speed), spin: r.vector(speed) };
        let mut motions = [motion(at_a), motion(Pose::new(way, turn))];
        if r.within(0.0, 1.0) < 0.2 {
            // They rest, or move on together.
            let velocity = if r.within(0.0, 1.0) < 0.5 { DVec3::ZERO } else { r.vector(speed) };
            motions.iter_mut().for_each(|m| *m = Motion { velocity, ..Motion::resting(m.start) });
        }
        Self { bodies: [a, b], motions }
    }

    fn ask(&self, motions: [Motion; 2], limit: u64, of: fn(&DistanceQuery) -> Distance) -> Distance {
        self.ask_of(self.bodies.each_ref().map(|b| &b.model), motions, limit, of)
    }

    fn ask_of(
        &self,
        models: [&Model; 2],
        motions: [Motion; 2],
        limit: u64,
        of: fn(&DistanceQuery) -> Distance,
    ) -> Distance {
        let placed =
            |k: usize| PlacedModel { model: models[k], placed: Placed { place: Pose::IDENTITY, motion: motions[k] } };
        of(&DistanceQuery { a: placed(0), b: placed(1), tolerance: TOLERANCE, limit })
    }

    /// The distance at a time, and what is wrong with what is told of it.
    fn judged(&self, t: f64) -> (Distance, Result<(), String>) {
        let poses = self.motions.map(|m| m.at(t));
        let d = self.ask(poses.map(Motion::resting), DEFAULT_LIMIT, |query| at_instant(query, 0.0));
        let judged = self.judge(&poses, &d);
        (d, judged)
    }

    fn judge(&self, poses: &[Pose; 2], d: &Distance) -> Result<(), String> {
        let off = [0, 1].map(|k| self.bodies[k].beyond(&poses[k], [d.a.point, d.b.point][k]));
        let apart = d.b.point - d.a.point;
        let length = apart.length();
        let wrong = |what: &str| {
            Err(format!("{what}: off {off:?}, apart {length:e}, {:e} to {:e}, {} cells", d.lower, d.upper, d.cells))
        };
        if !d.is_settled || d.upper - d.lower > TOLERANCE.max(8.0 * d.rounding) {
            return wrong("not settled");
        }
        if off[0].max(off[1]) > 1e-12 {
            return wrong("a point outside");
        }
        if d.upper == 0.0 {
            return if length <= 1e-12 { Ok(()) } else { wrong("no common point") };
        }
        if !(d.lower <= length && length <= d.upper) {
            return wrong("bounds that do not hold the distance of the points");
        }
        let [a, b] = &self.bodies;
        // What rounding does to the points it does to the direction between them, the more the nearer they are.
        let blur = (1e-11 - 8.0 * off[0].min(off[1]).min(0.0)) / length;
        let mut n = apart / length;
        if let Own::Below = b.own {
            let down = poses[1].rotation * (b.frame.rotation * -DVec3::Z);
            if n.distance(down) > blur {
                return wrong("not square to the plane");
            }
            n = down;
        }
        let below = -b.reach(&poses[1], -n) - a.reach(&poses[0], n);
        if below < length - EXACT.max(8.0 * d.rounding) - blur {
            return wrong(&format!("nearer points, perhaps: only {below:e} is proven"));
        }
        // Bounds this near to each other leave some 1e-6 to points of curved bodies; their normals leave less.
        for (k, x) in [d.a.point, d.b.point].into_iter().enumerate() {
            let Own::Ellipsoid(semi) = self.bodies[k].own else { continue };
            let (frame, at) = (&self.bodies[k].frame, &poses[k]);
            let own = frame.inverse().point(at.inverse().point(x)) / (semi * semi);
            let normal = at.rotation * (frame.rotation * own.normalize());
            let off = normal.distance(if k == 0 { n } else { -n });
            if off > 1e-9 + 20.0 * blur {
                return wrong(&format!("normals that are {off:e} apart"));
            }
        }
        if below > d.upper { wrong("an upper bound below the distance") } else { Ok(()) }
    }
}

#[test]
fn nearest_points_of_convex_primitives_are_proven_by_supports() {
    let count = sized("CONTACTD_CONVEX_DISTANCES", 6u64);
    let (mut failures, mut asked, mut shared) = (Vec::new(), 0, 0);
    for (i, j) in (0..KINDS).flat_map(|i| (i..=KINDS).map(move |j| (i, j))) {
        for n in 0..count {
            let mut r = Random::new(((i * 16 + j) as u64) << 32 | n);
            let pair = Pair::new([i, j], &mut r);
            let (d, judged) = pair.judged(0.0);
            asked += 1;
            shared += u32::from(d.upper == 0.0);
            failures.extend(judged.err().map(|e| format!("{i}-{j} {n}: {e}")));
        }
    }
    println!("{asked} pairs, {shared} in each other");
    assert!(failures.is_empty(), "{} wrong: {:#?}", failures.len(), &failures[..failures.len().min(9)]);
    assert!(shared > 0 && 2 * shared < asked);
}

#[test]
fn least_distances_of_moving_convex_primitives_hold_at_all_times() {
    let count = sized("CONTACTD_CONVEX_DISTANCES", 6u64).div_ceil(4);
    let (mut failures, mut asked, mut cells, mut inside) = (Vec::new(), 0, 0, 0);
    // GJK ends in a flat simplex: from elsewhere it does not.
    let known = |i: usize, j: usize| ((i, j) == (1, 3)).then_some(2260);
    for (i, j) in (0..KINDS).flat_map(|i| (i..=KINDS).map(move |j| (i, j))) {
        for n in (0..count).chain(known(i, j)) {
            let mut r = Random::new(1 << 63 | ((i * 16 + j) as u64) << 32 | n);
            let pair = Pair::new([i, j], &mut r);
            let d = pair.ask(pair.motions, DEFAULT_LIMIT, over_step);
            // What is left at a limit holds as well: of one span, and of a few.
            let some = [1, 7].map(|limit| pair.ask(pair.motions, limit, over_step).lower);
            (asked, cells) = (asked + 1, cells.max(d.cells));
            inside += u32::from(0.0 < d.time && d.time < 1.0 && d.lower > 0.0);
            let told = format!("{:e} to {:e} at {}, {} cells", d.lower, d.upper, d.time, d.cells);
            let mut wrong = |what: String| failures.push(format!("{i}-{j} {n}: {what}; {told}"));
            // Of bodies that graze to within the tolerance no direction between them has digits.
            if !d.is_settled && d.upper > 2.0 * TOLERANCE {
                wrong("not settled".into());
            }
            let (at_best, judged) = pair.judged(d.time);
            if judged.is_err() || (at_best.upper - d.upper).abs() > TOLERANCE.max(8.0 * d.rounding) {
                wrong(format!("at its time {:e} to {:e}, {judged:?}", at_best.lower, at_best.upper));
            }
            for _ in 0..40 {
                // All over the step, and beside the time that is told.
                let t = if r.within(0.0, 1.0) < 0.5 {
                    r.within(0.0, 1.0)
                } else {
                    d.time + r.within(-1.0, 1.0) * 10f64.powf(r.within(-5.0, -1.0))
                };
                let t = t.clamp(0.0, 1.0);
                let at = pair.judged(t).0;
                if at.upper < d.lower || some.iter().any(|lower| at.upper < *lower) {
                    wrong(format!("nearer at {t}: {:e}, bounds at limits {some:?}", at.upper));
                }
            }
        }
    }
    println!("{asked} pairs, {inside} nearest on the way, at most {cells} cells");
    assert!(failures.is_empty(), "{} wrong: {:#?}", failures.len(), &failures[..failures.len().min(9)]);
    assert!(20 * inside > asked);
}

#[test]
fn bounds_of_moving_trees_hold_at_all_times_and_limits() {
    let count = sized("CONTACTD_CONVEX_DISTANCES", 6u64).div_ceil(4);
    let (mut failures, mut asked) = (Vec::new(), 0);
    for (i, j) in (0..KINDS).flat_map(|i| (i..=KINDS).map(move |j| (i, j))) {
        for n in 0..count {
            let mut r = Random::new(1 << 62 | ((i * 16 + j) as u64) << 32 | n);
            let mut pair = Pair::new([i, j], &mut r);
            // They come near more than once.
            pair.motions.iter_mut().for_each(|m| m.spin *= 5.0);
            let trees = pair.bodies.each_ref().map(|b| &b.tree);
            let told = [1, 5, 40].map(|limit| pair.ask_of(trees, pair.motions, limit, over_step));
            asked += told.len();
            for _ in 0..40 {
                let t = r.within(0.0, 1.0);
                let at = pair.judged(t).0;
                let wrong = told.iter().filter(|d| at.upper < d.lower);
                failures.extend(
                    wrong.map(|d| format!("{i}-{j} {n}: {:e} at {t}, {:e} to {:e}", at.upper, d.lower, d.upper)),
                );
            }
            for d in &told {
                let at = pair.judged(d.time).0;
                if d.upper < at.lower - TOLERANCE {
                    failures.push(format!(
                        "{i}-{j} {n}: {:e} to {:e} at {}, no less than {:e}",
                        d.lower, d.upper, d.time, at.lower
                    ));
                }
            }
        }
    }
    println!("{asked} questions");
    assert!(failures.is_empty(), "{} wrong: {:#?}", failures.len(), &failures[..failures.len().min(9)]);
}
