//! Rays and points against primitives, by formulas of textbooks: sphere, box, cylinder, frustum, torus (a quartic).

use super::rays::drawn;
use contactd::contact::probe::{
    DEFAULT_LIMIT, PointOptions, PosedModel, Ray, RayOptions, RayOutcome, Side, points, rays,
};
use contactd::octree::Model;
use contactd::solid::{Label, Shape, SolidBuilder, primitive};
use contactd_proto::Pose;
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DVec2, DVec3};

/// Stretches of a ray in a solid, ascending.
type Inside = Vec<(f64, f64)>;

/// A primitive of which all is known.
#[derive(Clone, Copy, Debug)]
enum Known {
    Ball(f64),
    Box(DVec3),
    /// Radii below and above, half the height: a cylinder where they are one.
    Frustum([f64; 2], f64),
    Torus(f64, f64),
}

impl Known {
    fn draw(r: &mut Random) -> Self {
        let mut s = || r.within(0.2, 1.2);
        let (a, b, c) = (s(), s(), s());
        match r.below(5) {
            0 => Known::Ball(a),
            1 => Known::Box(DVec3::new(a, b, c)),
            2 => Known::Frustum([a, a], c),
            3 => Known::Frustum([a, if r.chance(0.3) { 0.0 } else { b }], c),
            _ => Known::Torus(a + 0.3, 0.2 * b + 0.05),
        }
    }

    fn shape(self) -> Shape {
        match self {
            Known::Ball(radius) => primitive::Sphere { radius }.into(),
            Known::Box(half) => primitive::Cuboid { half }.into(),
            Known::Frustum([p, q], half_height) if p == q => primitive::Cylinder { radius: p, half_height }.into(),
            Known::Frustum([bottom, top], half_height) => primitive::Cone { bottom, top, half_height }.into(),
            Known::Torus(major, minor) => primitive::Torus { major, minor }.into(),
        }
    }

    fn inside(self, o: DVec3, d: DVec3) -> Inside {
        match self {
            Known::Ball(radius) => below_zero(&[o.dot(o) - radius * radius, 2.0 * o.dot(d), 1.0]),
            Known::Box(half) => {
                let slabs = (0..3).map(|k| slab(o[k], d[k], half[k]));
                slabs.reduce(|a, b| common(&a, &b)).unwrap()
            }
            Known::Frustum([p, q], half) => {
                // ρ² <= (m + s z)², between the lids, where m + s z >= 0.
                let (m, s) = (0.5 * (p + q), 0.5 * (q - p) / half);
                let (w, v) = (m + s * o.z, s * d.z);
                let (x, y) = (o.truncate(), d.truncate());
                let round = below_zero(&[x.dot(x) - w * w, 2.0 * (x.dot(y) - w * v), y.dot(y) - v * v]);
                common(&round, &slab(o.z, d.z, half))
            }
            Known::Torus(major, minor) => {
                let (k, f) = (o.dot(o) + major * major - minor * minor, 4.0 * major * major);
                let (x, y, od) = (o.truncate(), d.truncate(), o.dot(d));
                below_zero(&[
                    k * k - f * x.dot(x),
                    4.0 * od * k - 2.0 * f * x.dot(y),
                    4.0 * od * od + 2.0 * k - f * y.dot(y),
                    4.0 * od,
                    1.0,
                ])
            }
        }
    }

    /// The signed distance of a point.
    fn distance(self, x: DVec3) -> f64 {
        let half_plane = DVec2::new(x.truncate().length(), x.z);
        match self {
            Known::Ball(radius) => x.length() - radius,
            Known::Box(half) => {
                let q = x.abs() - half;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            Known::Frustum([p, q], half) => {
                let corners = [(0.0, -half), (p, -half), (q, half), (0.0, half)].map(|(x, y)| DVec2::new(x, y));
                let sides = [0, 1, 2].map(|i| from_segment(half_plane, corners[i], corners[i + 1]));
                let is_inside = x.z.abs() <= half && half_plane.x <= p + (q - p) * (x.z + half) / (2.0 * half);
                sides.into_iter().fold(f64::INFINITY, f64::min) * if is_inside { -1.0 } else { 1.0 }
            }
            Known::Torus(major, minor) => (half_plane - DVec2::X * major).length() - minor,
        }
    }

    /// A tolerance, as far as a frustum allows: psi is computed from its apex, far away where its radii are nearly one.
    fn exact(self, tolerance: f64) -> f64 {
        match self {
            Known::Frustum([p, q], half) if p != q => tolerance.max(1e-11 * half * p.max(q) / (p - q).abs()),
            Known::Ball(_) | Known::Box(_) | Known::Frustum(..) | Known::Torus(..) => tolerance,
        }
    }

    fn model(self) -> Model {
        let mut b = SolidBuilder::new();
        let root = b.primitive(self.shape(), Pose::IDENTITY, Label::default());
        Model::new(b.finish(root))
    }
}

fn from_segment(x: DVec2, p: DVec2, q: DVec2) -> f64 {
    let d = q - p;
    let t = if d == DVec2::ZERO { 0.0 } else { ((x - p).dot(d) / d.length_squared()).clamp(0.0, 1.0) };
    (x - p - d * t).length()
}

fn slab(o: f64, d: f64, half: f64) -> Inside {
    if d == 0.0 {
        return if o.abs() <= half { vec![(f64::NEG_INFINITY, f64::INFINITY)] } else { vec![] };
    }
    let (p, q) = ((-half - o) / d, (half - o) / d);
    vec![(p.min(q), p.max(q))]
}

fn common(a: &Inside, b: &Inside) -> Inside {
    let each = a.iter().flat_map(|p| b.iter().map(move |q| (p.0.max(q.0), p.1.min(q.1))));
    let mut all: Inside = each.filter(|s| s.0 < s.1).collect();
    all.sort_by(|p, q| p.0.total_cmp(&q.0));
    all
}

fn value(c: &[f64], t: f64) -> f64 {
    c.iter().rev().fold(0.0, |v, k| v * t + k)
}

/// No ray is looked at farther than this.
const END: f64 = 100.0;

/// Roots of a polynomial in −END..END, ascending: between the roots of its derivative it rises or falls, and halves find where it is 0.
fn roots(c: &[f64]) -> Vec<f64> {
    let n = c.len() - 1;
    if n == 0 {
        return vec![];
    }
    let derivative: Vec<f64> = (1..=n).map(|k| k as f64 * c[k]).collect();
    let mut ends = vec![-END];
    ends.extend(roots(&derivative).into_iter().filter(|t| t.abs() < END));
    ends.push(END);
    let mut found = vec![];
    for w in ends.windows(2) {
        let (mut a, mut b) = (w[0], w[1]);
        if value(c, a) * value(c, b) > 0.0 {
            continue;
        }
        for _ in 0..200 {
            let m = 0.5 * (a + b);
            if value(c, a) * value(c, m) <= 0.0 { b = m } else { a = m }
        }
        found.push(0.5 * (a + b));
    }
    found
}

/// Where in −END..END a polynomial is negative.
fn below_zero(c: &[f64]) -> Inside {
    let mut ends = vec![-END];
    ends.extend(roots(c));
    ends.push(END);
    let negative = |w: &&[f64]| value(c, 0.5 * (w[0] + w[1])) < 0.0;
    ends.windows(2).filter(negative).map(|w| (w[0], w[1])).collect()
}

/// Rays that come nearer to a root than this, or graze by no more, are left out: the formulas themselves are not that exact.
const NEAR: f64 = 1e-5;

#[test]
fn first_hits_are_those_of_closed_forms() {
    let count = sized("CONTACTD_PROBE_CLOSED", 1500usize);
    let mut told = [0usize; 3];
    for i in 0..count {
        let mut r = Random::new(93_000 + i as u64);
        let (known, pose) = (Known::draw(&mut r), Pose::new(r.vector(2.0), r.rotation()));
        let own = drawn(&mut r, DVec3::ZERO, 1.2);
        let ray = Ray { origin: pose.point(own.origin), direction: pose.vector(own.direction), ..own };
        let model = known.model();
        let options = RayOptions { depth: 0.0, limit: DEFAULT_LIMIT };
        let answer = rays(&PosedModel { model: &model, pose }, &[ray], &options)[0];
        let inside = known.inside(own.origin, own.direction);
        // Where the ray is in it, but for the ends of the ray.
        let doubtful = inside
            .iter()
            .any(|s| s.1 - s.0 < NEAR || [s.0, s.1].iter().any(|t| t.abs() < NEAR || (t - own.length).abs() < NEAR))
            || inside.windows(2).any(|w| w[1].0 - w[0].1 < NEAR);
        if doubtful {
            continue;
        }
        let within = |s: &&(f64, f64)| s.1 > 0.0 && s.0 < own.length;
        let truth = match inside.iter().find(within) {
            None => None,
            Some(s) if s.0 < 0.0 => Some((s.1, true)).filter(|t| t.0 < own.length),
            Some(s) => Some((s.0, false)),
        };
        let text = format!("{i}: {known:?} {own:?} {inside:?}: {answer:?}");
        match (answer.outcome, truth) {
            (RayOutcome::Hit(hit), Some((t, is_leaving))) => {
                told[usize::from(is_leaving)] += 1;
                assert!((hit.t - t).abs() < 1e-8 && hit.is_leaving == is_leaving, "{text}");
                assert!(hit.lower <= t + 1e-8 && t <= hit.upper + 1e-8, "{text}");
                let (x, h) = (own.origin + own.direction * t, 1e-6);
                let n = pose.inverse().vector(hit.normal);
                let rise = known.distance(x + n * h) - known.distance(x - n * h);
                let on_an_edge = hit.faces[1] != u32::MAX;
                assert!(on_an_edge || (rise / (2.0 * h) - 1.0).abs() < 1e-4, "normal {n}, {rise}: {text}");
            }
            (RayOutcome::Miss { is_inside }, None) => {
                told[2] += 1;
                assert_eq!(is_inside, inside.iter().any(|s| s.0 < 0.0 && s.1 > 0.0), "{text}");
            }
            _ => panic!("{truth:?}: {text}"),
        }
    }
    println!("{count} rays: hit, leaving, missed {told:?}");
    assert!(told.iter().all(|n| 12 * n > count) && 20 * told.iter().sum::<usize>() > 19 * count, "{told:?}");
}

#[test]
fn signed_distances_are_those_of_closed_forms() {
    let count = sized("CONTACTD_PROBE_CLOSED", 1500usize);
    let (mut sides, mut cells, mut most, mut open) = ([0usize; 2], 0, 0, 0);
    for i in 0..count {
        let mut r = Random::new(94_000 + i as u64);
        let (known, pose) = (Known::draw(&mut r), Pose::new(r.vector(2.0), r.rotation()));
        let reach = if i % 2 == 0 { 0.4 } else { 1.6 };
        let own = r.vector(reach);
        let options = PointOptions { surface: 1e-7, tolerance: 1e-9, limit: DEFAULT_LIMIT };
        let model = known.model();
        let answer = points(&PosedModel { model: &model, pose }, &[pose.point(own)], &options)[0];
        let truth = known.distance(own);
        let text = format!("{i}: {known:?} {own} {truth}: {answer:?}");
        assert!(answer.lower <= truth + 1e-12 && truth <= answer.upper + 1e-12, "{text}");
        assert!(
            known.distance(pose.inverse().point(answer.nearest)).abs() < answer.upper - answer.lower + 1e-11,
            "{text}"
        );
        let is_inside = truth < 0.0;
        assert_eq!(answer.side, if is_inside { Side::Inside } else { Side::Outside }, "{text}");
        sides[usize::from(is_inside)] += 1;
        open += usize::from(!answer.is_settled);
        (cells, most) = (cells + answer.cells, most.max(answer.cells));
        assert!(!answer.is_settled || answer.upper - answer.lower <= known.exact(1e-9), "{text}");
        let quick = PointOptions { tolerance: f64::INFINITY, ..options };
        let side = points(&PosedModel { model: &model, pose }, &[pose.point(own)], &quick)[0];
        assert!(side.side == answer.side && side.lower <= truth && truth <= side.upper, "{text}: {side:?}");
    }
    println!(
        "{count} points: outside, inside {sides:?}, {open} open; {} cells on average, {most} at most",
        cells / count as u64
    );
    assert!(sides.iter().all(|n| 5 * n > count) && open == 0, "{sides:?} {open}");
}
