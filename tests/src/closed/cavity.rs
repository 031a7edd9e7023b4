//! Complemented primitives: a body inside a cavity (n-pair), two cavities (nn-pair).
//!
//! Idea: the clearance of a body A inside a convex cavity B is the smallest of −(signed distance to B) over A. That
//! distance is convex, so its largest value lies at an extreme point of A: a ball's point along the normal at its
//! centre, a corner, an apex, a point of a rim. Along a rim every face of B is asked by itself:
//!
//! | wall | where the rim c + r(e cos θ + f sin θ) reaches farthest |
//! |---|---|
//! | facet, cap | along the wall's normal |
//! | sphere | away from its centre: one angle |
//! | cylinder's side | d/dθ of the squared distance from its axis: degree 2 in the angle, at most four angles |
//! | cone's side | (ρ²)′² cos²α = 4 ρ² z′² sin²α: degree 4 in the angle, at most eight angles |
//!
//! That holds for every position of the axes: a tilted cylinder in a round hole, a cone in a conical seat. Parallel axes
//! make the squared distance constant around the rim; then the offset of the axes decides.
//!
//! Two cavities (nn-pair): their surfaces touch from outside when the separation of the two primitives is 0, from inside
//! when one's clearance in the other is. Neither is a contact of its own where a surface curves: the two solids are the
//! outsides, and beside the touching point there is outside of both already. Only flat walls meet so, and their
//! separation is that of the planes.
//! Source: Zeiller 1993, stage 3, complemented surfaces; the maximum principle for convex functions.

use super::directions::Rim;
use super::trig::Trig;
use super::{Convex, Round, separation_only};
use contactd::math::any_perpendicular;
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// A body in a cavity.
#[derive(Clone, Copy, Debug)]
pub struct Clearance {
    /// Distance from the body to the wall, negative where it sticks out.
    pub value: f64,
    /// The point of the body nearest to the wall, or farthest beyond it.
    pub point: DVec3,
    /// Outward unit normal of the cavity there: from the body into the wall.
    pub normal: DVec3,
}

/// Clearance of `a` inside the cavity `b`: minus the largest signed distance to `b` over `a`. Exact while `a` is inside; of
/// bodies that stick out it is the distance of one of their points, and negative.
pub fn clearance(a: &Convex, b: &Convex) -> Clearance {
    let mut best = Clearance { value: f64::INFINITY, point: DVec3::ZERO, normal: DVec3::X };
    let mut offer = |point: DVec3| {
        let (d, normal) = b.distance(point);
        if -d < best.value {
            best = Clearance { value: -d, point, normal };
        }
    };
    match a {
        Convex::Ball(p) => {
            let (d, normal) = b.distance(p.center);
            return Clearance { value: -d - p.radius, point: p.center + normal * p.radius, normal };
        }
        Convex::Poly(p) => p.vertices.iter().for_each(|v| offer(*v)),
        Convex::Cylinder(p) | Convex::Cone(p) => {
            p.apex().into_iter().for_each(&mut offer);
            for rim in p.rims() {
                farthest_of_rim(&rim, b, &mut offer);
            }
        }
    }
    best
}

/// Calls `take` with the points of a rim at which one of the cavity's faces is reached farthest.
fn farthest_of_rim(rim: &Rim, b: &Convex, take: &mut impl FnMut(DVec3)) {
    match b {
        Convex::Ball(q) => take(rim.farthest(rim.center - q.center)),
        Convex::Poly(q) => q.planes.iter().for_each(|(n, _)| take(rim.farthest(*n))),
        Convex::Cylinder(q) | Convex::Cone(q) => {
            take(rim.farthest(q.axis));
            take(rim.farthest(-q.axis));
            farthest_of_rim_in_side(rim, q, take);
        }
    }
}

/// The same for the side of a cylinder, cone or frustum.
fn farthest_of_rim_in_side(rim: &Rim, q: &Round, take: &mut impl FnMut(DVec3)) {
    let e = any_perpendicular(rim.axis);
    let f = rim.axis.cross(e);
    let point = |angle: f64| {
        let (s, c) = angle.sin_cos();
        rim.center + (e * c + f * s) * rim.radius
    };
    // Offset across the axis and height along it, as functions of the angle.
    let d = rim.center - q.centers[0];
    let coordinate = |n: DVec3| Trig::linear(n.dot(d), rim.radius * n.dot(e), rim.radius * n.dot(f));
    let u = any_perpendicular(q.axis);
    let (x, y, z) = (coordinate(u), coordinate(q.axis.cross(u)), coordinate(q.axis));
    let square = x.times(&x).plus(1.0, &y.times(&y));
    let slope = square.slope();
    if q.lean == 0.0 {
        slope.roots(|angle| take(point(angle)));
    } else {
        // ψ = (ρ − r) cos α + z lean is stationary where (ρ²)′ cos α = −2 ρ z′ lean; squared.
        let rise = z.slope();
        let cos2 = 1.0 - q.lean * q.lean;
        let right = square.times(&rise.times(&rise));
        let zero = Trig::default().plus(cos2, &slope.times(&slope)).plus(-4.0 * q.lean * q.lean, &right);
        zero.roots(|angle| take(point(angle)));
    }
    // Constant along the rim (axes parallel) or nearly so: the offset decides, and four angles stand for all.
    take(rim.farthest(d - q.axis * q.axis.dot(d)));
    (0..4).for_each(|k| take(point(f64::from(k) * FRAC_PI_2)));
}

/// Signed gaps of the surfaces of two cavities: to touching from outside (separation of the two primitives) and to touching
/// from inside (the larger clearance of one in the other). An event is a root of either.
pub fn tangency_of_cavities(a: &Convex, b: &Convex) -> [f64; 2] {
    [separation_only(a, b, None).0, clearance(a, b).value.max(clearance(b, a).value)]
}
