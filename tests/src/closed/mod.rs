//! Geometric reasoning between whole primitives: the paper's stage 3, a second opinion on the general search.
//!
//! Idea: at an instant two convex primitives have a signed separation
//! max over unit n of (min over B of n·y − max over A of n·x); which features attain it is a matter of a few
//! configurations per pair, one file and one row each. `directions` holds the common normals of two features.
//! On top of it `time_of_contact` advances by the separation and ends at its root; `time_of_leaving` does the same for a
//! body in a cavity by its clearance.
//! Source: Zeiller 1993, stage 3 (quadrics by reasoning on centres, axes and radii; polyhedra by clipping; quadric and
//! polyhedron by vertices, edges, faces); the separations are our own derivation from support functions.
//! Invariant: `value` never exceeds the true signed separation (it is attained by a slab), and for disjoint bodies
//! `value + slack` is never below it (the witnesses attain it).
//! Does not promise: the exact depth of deeply overlapping bodies; −value is then an upper bound of the depth.

mod advance;
mod body;
mod cavity;
mod cone_cone;
mod cylinder_cone;
mod cylinder_cylinder;
mod directions;
pub mod meridian;
pub mod miller;
mod polyhedron_polyhedron;
mod quadric_polyhedron;
pub mod round_round;
mod sphere_cone;
mod sphere_cylinder;
mod sphere_polyhedron;
mod sphere_sphere;
pub mod trig;

pub use advance::{Bracket, Meeting, time_of_contact, time_of_leaving};
pub use body::{Ball, Convex, Edge, Feature, Poly, Round, Stand};
pub use cavity::{Clearance, clearance, tangency_of_cavities};

use contactd::math::tolerance::ROUNDING;
use glam::DVec3;

/// How two bodies stand to each other.
#[derive(Clone, Copy, Debug)]
pub struct Separation {
    /// Signed separation: distance, or minus the depth. Proven lower bound.
    pub value: f64,
    /// Unit normal from a to b that attains it.
    pub normal: DVec3,
    /// Witness points on a and b.
    pub points: [DVec3; 2],
    /// How much farther apart than `value` the witnesses are: the error that is not excluded.
    pub slack: f64,
    /// Features that hold the witnesses.
    pub features: [Feature; 2],
}

/// The best direction so far, by its proven separation.
pub struct Best<'a> {
    a: &'a Convex,
    b: &'a Convex,
    value: f64,
    normal: DVec3,
}

impl<'a> Best<'a> {
    /// None yet, or the one that is given.
    pub fn new(a: &'a Convex, b: &'a Convex, hint: Option<DVec3>) -> Self {
        let mut best = Self { a, b, value: f64::NEG_INFINITY, normal: DVec3::X };
        if let Some(n) = hint {
            best.offer(n);
        }
        best
    }

    /// The separation along it.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Tries the unit direction n from a to b.
    fn offer(&mut self, n: DVec3) {
        let value = -self.b.reach(-n) - self.a.reach(n);
        if value > self.value {
            (self.value, self.normal) = (value, n);
        }
    }

    /// Whether `p`, a point of a, is among a's farthest along `o`, give or take rounding.
    fn a_reaches(&self, o: DVec3, p: DVec3) -> bool {
        o.dot(p) >= self.a.reach(o) - ROUNDING * o.length() * p.length()
    }

    /// The same for b.
    fn b_reaches(&self, o: DVec3, p: DVec3) -> bool {
        o.dot(p) >= self.b.reach(o) - ROUNDING * o.length() * p.length()
    }

    /// Tries all of `list`, and empties it.
    fn offer_all(&mut self, list: &mut Vec<DVec3>) {
        // Rounding in a unit vector counts like distance: renormalised.
        list.drain(..).filter_map(DVec3::try_normalize).for_each(|n| self.offer(n));
    }
}

/// Writes the dispatch: one row per pair; the other order is `swapped`.
macro_rules! pairs {
    ($($a:ident $b:ident => $module:ident),+ $(,)?) => {
        /// Direction from a to b of the largest separation, no worse than `hint`.
        fn direction(a: &Convex, b: &Convex, hint: Option<DVec3>) -> DVec3 {
            // A pair of one form stands in both lists, where the first counts; a pair in neither does not compile.
            #[allow(unreachable_patterns)]
            match (a, b) {
                $((Convex::$a(p), Convex::$b(q)) => $module::direction(p, q, &mut Best::new(a, b, hint)),)+
                $((Convex::$b(_), Convex::$a(_)))|+ => -direction(b, a, hint.map(|n| -n)),
            }
        }
        /// The rows: the forms of both bodies.
        pub const ROWS: &[(&str, &str)] = &[$((stringify!($a), stringify!($b))),+];
    };
}

pairs! {
    Ball Ball => sphere_sphere,
    Ball Cylinder => sphere_cylinder,
    Ball Cone => sphere_cone,
    Ball Poly => sphere_polyhedron,
    Cylinder Cylinder => cylinder_cylinder,
    Cylinder Cone => cylinder_cone,
    Cone Cone => cone_cone,
    Cylinder Poly => quadric_polyhedron,
    Cone Poly => quadric_polyhedron,
    Poly Poly => polyhedron_polyhedron,
}

/// The signed separation of two bodies without their witnesses: (value, normal from a to b). A direction that is known
/// to separate them may be given; the answer is no worse.
pub fn separation_only(a: &Convex, b: &Convex, hint: Option<DVec3>) -> (f64, DVec3) {
    let n = direction(a, b, hint);
    (-b.reach(-n) - a.reach(n), n)
}

/// The signed separation of two bodies with witnesses and features.
pub fn separation(a: &Convex, b: &Convex, hint: Option<DVec3>) -> Separation {
    let (value, normal) = separation_only(a, b, hint);
    let ((ca, ra), (cb, rb)) = (a.ball(), b.ball());
    let size = ra.max(rb);
    // Shifted along the normal until they stand well apart, the bodies keep their witnesses: alternating projection
    // finds them for disjoint and for overlapping bodies alike, the faster the wider the gap.
    let apart = 4.0 * size;
    let shift = normal * (value - apart);
    let start = [a.support(normal) + shift, b.support(-normal), 0.5 * (ca + shift + cb)];
    let mut best = (f64::INFINITY, [DVec3::ZERO; 2]);
    for s in start {
        let (d, x, y) = alternate(a, b, shift, s, apart + 4.0 * f64::EPSILON * size);
        if d < best.0 {
            best = (d, [x - shift, y]);
        }
        if d - apart <= 1e-14 * size {
            break;
        }
    }
    let points = best.1;
    let tol = 1e-9 * size;
    Separation {
        value,
        normal,
        points,
        slack: (best.0 - apart).max(0.0),
        features: [a.feature(points[0], tol), b.feature(points[1], tol)],
    }
}

/// Nearest points of `a` shifted and `b` by alternating projections from `x`, until they are `enough` or stand still.
/// Crossing lines converge like a geometric series: every few rounds its limit is tried.
fn alternate(a: &Convex, b: &Convex, shift: DVec3, mut x: DVec3, enough: f64) -> (f64, DVec3, DVec3) {
    let round = |x: DVec3| {
        let y = b.project(x);
        (y, a.project(y - shift) + shift)
    };
    let (mut y, mut d) = (x, f64::INFINITY);
    for _ in 0..60 {
        let (_, x1) = round(x);
        let (_, x2) = round(x1);
        let (y3, x3) = round(x2);
        let ratio = (x3 - x2).length() / (x2 - x1).length();
        (x, y) = (x3, y3);
        let mut now = (x - y).length();
        if ratio < 1.0 {
            let (yl, xl) = round(x3 + (x3 - x2) * (ratio / (1.0 - ratio)));
            let limit = (xl - yl).length();
            if limit < now {
                (x, y, now) = (xl, yl, limit);
            }
        }
        if now <= enough || now >= d {
            return (now, x, y);
        }
        d = now;
    }
    (d, x, y)
}
