//! A face over a region: which of its pieces it is there, and a plane that lies below it.

use super::form::{along, halves, image, rows_of_bowl, touched};
use super::interval::{
    Jet, ZERO, across, dot, linear, minus, offsets, point, short, square_length, times, unit, vector,
};
use super::norm;
use contactd::solid::{Face, surface};
use glam::DVec3;

/// The face itself, or of a capsule what it is over a whole region: its cylinder, or the ball at one of its ends.
pub fn part_of(face: &Face, y: &[Jet; 3]) -> Option<Face> {
    let Face::Capsule(surface::Capsule { origin, axis, half, radius }) = *face else { return Some(*face) };
    let along = linear(unit(vector(axis.to_array())), &offsets(y, origin)).v;
    if along.mag() <= half {
        Some(surface::Cylinder { origin, axis, radius }.into())
    } else if along.lo >= half {
        Some(surface::Sphere { center: origin + axis * half, radius }.into())
    } else if along.hi <= -half {
        Some(surface::Sphere { center: origin - axis * half, radius }.into())
    } else {
        None
    }
}

/// A plane below a convex psi: |v| >= n·v for every |n| <= 1. Below a torus' psi what is concave, too.
pub fn tangent(face: &Face, at: DVec3, y: &[Jet; 3]) -> Jet {
    let perpendicular = |axis: DVec3, o: DVec3| {
        let a = unit(vector(axis.to_array()));
        let m = short({
            let o = at - o;
            o - axis * o.dot(axis)
        });
        minus(m, times(dot(m, a), a))
    };
    match *face {
        Face::Plane(surface::Plane { normal, offset }) => linear(vector(normal.to_array()), y).plus(point(-offset)),
        Face::Sphere(surface::Sphere { center, radius }) => {
            linear(short(at - center), &offsets(y, center)).plus(point(-radius))
        }
        Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
            linear(perpendicular(axis, origin), &offsets(y, origin)).plus(point(-radius))
        }
        Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
            let a = unit(vector(axis.to_array()));
            let m = perpendicular(axis, apex);
            linear(minus(times(point(cos), m), times(point(sin), a)), &offsets(y, apex))
        }
        // hypot(ρ − R, z) >= n_ρ (ρ − R) + n_z z for every |n| <= 1; where n_ρ < 0 that is concave, and stays as it is.
        Face::Torus(surface::Torus { origin, axis, major, minor }) => {
            let a = unit(vector(axis.to_array()));
            let (z, off) = {
                let (o, axis) = (at - origin, axis.normalize());
                let z = o.dot(axis);
                (z, (o - axis * z).length() - major)
            };
            let size = off.hypot(z) * (1.0 + 1e-15);
            let (lean, up) = if size > 0.0 { (off / size, z / size) } else { (0.0, 0.0) };
            let o = offsets(y, origin);
            let rho =
                if lean < 0.0 { square_length(&across(&o, a)).sqrt() } else { linear(perpendicular(axis, origin), &o) };
            rho.plus(point(-major)).scaled(point(lean)) + linear(a, &o).scaled(point(up)).plus(point(-minor))
        }
        // |x − q| >= n·(x − q) for every |n| <= 1 that leads to no other point of the segment: across it, or past an end.
        Face::Capsule(surface::Capsule { origin, axis, half, radius }) => {
            let along = (at - origin).dot(axis);
            if along.abs() <= half {
                return linear(perpendicular(axis, origin), &offsets(y, origin)).plus(point(-radius));
            }
            let a = times(point(half.copysign(along)), unit(vector(axis.to_array())));
            let n = short(at - origin - axis * half.copysign(along));
            let (o, past) = (offsets(y, origin), dot(n, a));
            // Rounding may leave it leading back.
            let from: [Jet; 3] = std::array::from_fn(|i| o[i].plus(-a[i]));
            let back = if past.lo < 0.0 { point(2.0) * past } else { ZERO };
            linear(n, &from).plus(back + point(-radius))
        }
        Face::Elliptic(ref e) => touched(image(e), e.origin, at, y),
        Face::Bowl(ref bowl) => touched(rows_of_bowl(bowl), bowl.origin, at, y),
        Face::Superellipsoid(ref face) => norm::touched(face, at, y),
        // |P| >= p·P for every |p| <= 1; −|N| is concave, and stays as it is.
        Face::Saddle(ref saddle) => {
            let ([p, n], along) = (halves(saddle, y), along(saddle, at, 0));
            p[0].scaled(along[0]) + p[1].scaled(along[1]) - (n[0].square() + n[1].square()).sqrt()
        }
    }
}
