//! What the answers of rays are held to: a membership of the judge's own, looked at densely along the ray.

use contactd::contact::probe::{Ray, RayAnswer, RayHit, RayOutcome};
use contactd::solid::{Shape, Solid};
use contactd_proto::Pose;
use contactd_tests::quadrics::shape_or_quadric;
use contactd_tests::random_solids::{
    Random, shape, shape_or_capsule, shape_or_elliptic, shape_or_mesh, shape_or_superellipsoid, shape_or_torus,
    solid_of,
};
use contactd_tests::reference::field::Field;
use glam::DVec3;

/// Sources of random primitives: between them, every kind of face.
pub const KINDS: [fn(&mut Random, f64) -> Shape; 7] = [
    shape,
    shape_or_torus,
    shape_or_capsule,
    shape_or_elliptic,
    shape_or_superellipsoid,
    shape_or_quadric,
    shape_or_mesh,
];

/// A random tree of the kind of a number, which may be one primitive.
pub fn solid(r: &mut Random, number: usize) -> Solid {
    let depth = r.below(3);
    solid_of(r, depth, KINDS[number % KINDS.len()])
}

/// A solid where it stands, to the judge.
pub struct Judge {
    field: Field,
    from_world: Pose,
}

impl Judge {
    pub fn new(solid: &Solid, pose: &Pose) -> Self {
        Self { field: Field::new(solid, &Pose::IDENTITY), from_world: pose.inverse() }
    }

    /// f at a point of the world.
    pub fn value(&self, x: DVec3) -> f64 {
        self.field.value(self.from_world.point(x))
    }
}

/// What an answer says that is refuted by f along the ray, looked at `count` places and where its sign changes between them. What is
/// no deeper than `depth` counts for nothing.
pub fn refuted(answer: &RayAnswer, ray: &Ray, f: &dyn Fn(DVec3) -> f64, count: usize, depth: f64) -> Option<String> {
    let at = |t: f64| f(ray.at(t));
    let start = at(0.0);
    let (free_until, inside) = match answer.outcome {
        RayOutcome::Hit(hit) => {
            if let Some(text) = refuted_hit(&hit, ray, f, depth) {
                return Some(text);
            }
            (hit.lower, hit.is_leaving)
        }
        RayOutcome::Miss { is_inside } => (ray.length, is_inside),
        RayOutcome::Undecided { until } => (until, start < 0.0),
    };
    if start.abs() > depth && (start < 0.0) != inside {
        return Some(format!("it begins with f = {start}: {answer:?}"));
    }
    let sought = |t: f64| if inside { -at(t) } else { at(t) };
    let step = free_until / count as f64;
    let (mut lowest, mut at_lowest) = (f64::INFINITY, 0.0);
    for k in 0..=count {
        let (t, v) = (k as f64 * step, sought(k as f64 * step));
        if v < lowest {
            (lowest, at_lowest) = (v, t);
        }
    }
    // The lowest place, lowered.
    let mut reach = step;
    for _ in 0..60 {
        for t in [at_lowest - reach, at_lowest + reach] {
            let t = t.clamp(0.0, free_until);
            if sought(t) < lowest {
                (lowest, at_lowest) = (sought(t), t);
            }
        }
        reach *= 0.7;
    }
    (lowest < -depth).then(|| format!("f = {lowest} at {at_lowest}, before {free_until}: {answer:?}"))
}

fn refuted_hit(hit: &RayHit, ray: &Ray, f: &dyn Fn(DVec3) -> f64, depth: f64) -> Option<String> {
    if !(0.0 <= hit.lower && hit.lower <= hit.t && hit.t <= hit.upper && hit.upper <= ray.length + 1e-9) {
        return Some(format!("no bracket: {hit:?}"));
    }
    if (hit.point - ray.at(hit.t)).length() > 1e-12 * (1.0 + hit.t) || f(hit.point).abs() > depth {
        return Some(format!("f = {} at its point: {hit:?}", f(hit.point)));
    }
    let sign = if hit.is_leaving { -1.0 } else { 1.0 };
    if sign * f(ray.at(hit.upper)) > 1e-13 {
        return Some(format!("f = {} at its witness: {hit:?}", f(ray.at(hit.upper))));
    }
    if (hit.normal.length() - 1.0).abs() > 1e-9 || sign * hit.normal.dot(ray.direction) > 1e-6 {
        return Some(format!("its normal points along the ray: {hit:?}"));
    }
    None
}
