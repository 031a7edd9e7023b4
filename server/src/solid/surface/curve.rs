//! Straight and circular curves of two faces: those that they have in common, and those along which they touch.

use super::{Cone, Cylinder, Face, Plane, Sphere};
use glam::DVec3;

/// A straight or circular curve, in the frame of the faces that make it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curve {
    /// A line.
    Line {
        /// A point of it.
        origin: DVec3,
        /// Unit direction.
        along: DVec3,
    },
    /// A circle.
    Circle {
        /// Centre.
        center: DVec3,
        /// Unit normal of its plane.
        axis: DVec3,
        /// Radius, a length.
        radius: f64,
    },
}

/// The lines and circles that two faces have in common, for a body of the diameter `size`; circles with a radius above
/// `least` alone. Both are lengths.
pub fn common(p: &Face, q: &Face, size: f64, least: f64, found: &mut impl FnMut(Curve)) {
    const PARALLEL: f64 = 1e-9;
    let mut circle = |center: DVec3, axis: DVec3, squared: f64| {
        if squared > (least * least).max(0.0) {
            found(Curve::Circle { center, axis, radius: squared.sqrt() });
        }
    };
    match (*p, *q) {
        (Face::Plane(Plane { normal: m, offset: d }), Face::Plane(Plane { normal: n, offset: e })) => {
            let w = m.cross(n);
            if let Some(along) = w.try_normalize().filter(|_| w.length() > PARALLEL) {
                let origin = (n.cross(w) * d + w.cross(m) * e) / w.length_squared();
                found(Curve::Line { origin, along });
            }
        }
        (Face::Plane(Plane { normal, offset }), Face::Sphere(Sphere { center, radius })) => {
            let h = normal.dot(center) - offset;
            circle(center - normal * h, normal, (radius - h) * (radius + h));
        }
        (Face::Plane(Plane { normal, offset }), Face::Cylinder(Cylinder { origin, axis, radius })) => {
            let h = normal.dot(origin) - offset;
            if normal.cross(axis).length() <= PARALLEL {
                circle(origin - axis * (h / normal.dot(axis)), axis, radius * radius);
            } else if normal.dot(axis).abs() <= PARALLEL {
                let half = (radius - h) * (radius + h);
                if half > 0.0 {
                    let w = normal.cross(axis).normalize() * half.sqrt();
                    found(Curve::Line { origin: origin - normal * h + w, along: axis });
                    found(Curve::Line { origin: origin - normal * h - w, along: axis });
                }
            }
        }
        (Face::Plane(Plane { normal, offset }), Face::Cone(Cone { apex, axis, sin, cos })) => {
            let z = (offset - normal.dot(apex)) / normal.dot(axis);
            if normal.cross(axis).length() <= PARALLEL && z > 0.0 {
                circle(apex + axis * z, axis, (z * sin / cos) * (z * sin / cos));
            }
        }
        (Face::Sphere(Sphere { center: o, radius: r }), Face::Sphere(Sphere { center: c, radius: s })) => {
            let d = (c - o).length();
            if d > PARALLEL * size {
                let x = (d * d + (r - s) * (r + s)) / (2.0 * d);
                circle(o + (c - o) * (x / d), (c - o) / d, (r - x) * (r + x));
            }
        }
        (
            Face::Cylinder(Cylinder { origin: o, axis: a, radius: r }),
            Face::Cylinder(Cylinder { origin: c, axis: b, radius: s }),
        ) => {
            let w = (c - o) - a * (c - o).dot(a);
            let d = w.length();
            if a.cross(b).length() <= PARALLEL && d > PARALLEL * size {
                let x = (d * d + (r - s) * (r + s)) / (2.0 * d);
                let half = (r - x) * (r + x);
                if half > 0.0 {
                    let v = a.cross(w / d) * half.sqrt();
                    found(Curve::Line { origin: o + w * (x / d) + v, along: a });
                    found(Curve::Line { origin: o + w * (x / d) - v, along: a });
                }
            }
        }
        (Face::Sphere(Sphere { center, radius: s }), Face::Cylinder(Cylinder { origin, axis, radius })) => {
            let off = (center - origin) - axis * (center - origin).dot(axis);
            let h = (s - radius) * (s + radius);
            if off.length() <= PARALLEL * size && h > 0.0 {
                circle(center + axis * h.sqrt(), axis, radius * radius);
                circle(center - axis * h.sqrt(), axis, radius * radius);
            }
        }
        (Face::Cylinder(Cylinder { origin, axis: a, radius }), Face::Cone(Cone { apex, axis, sin, cos })) => {
            let off = (apex - origin) - a * (apex - origin).dot(a);
            if a.cross(axis).length() <= PARALLEL && off.length() <= PARALLEL * size {
                circle(apex + axis * (radius * cos / sin), axis, radius * radius);
            }
        }
        // The same pairs the other way round.
        (Face::Sphere(_) | Face::Cylinder(_) | Face::Cone(_), Face::Plane(_))
        | (Face::Cylinder(_), Face::Sphere(_))
        | (Face::Cone(_), Face::Cylinder(_)) => common(q, p, size, least, found),
        // Two cones, and a cone and a sphere, share no line or circle that is looked for.
        (Face::Cone(_), Face::Cone(_) | Face::Sphere(_)) | (Face::Sphere(_), Face::Cone(_)) => {}
    }
}

/// A face of a body as it looks out of it.
#[derive(Clone, Copy, Debug)]
pub struct Outward<'a> {
    /// The face.
    pub face: &'a Face,
    /// True where the body lies where psi <= 0: it bends outwards.
    pub is_convex: bool,
}

/// Lengths up to which a curve counts as one of touching.
#[derive(Clone, Copy, Debug)]
pub struct Nearness {
    /// Separation of the faces.
    pub near: f64,
    /// How far they may lean off each other over the body.
    pub lie: f64,
    /// Diameter of the body.
    pub size: f64,
}

/// The curve along which the face `p` of one body touches the face `q` of another without lying on it; `out_of_q` is the outward
/// normal of the body of `q` at a point. `None` also for pairs that are told the other way round.
pub fn tangent(p: Outward, q: Outward, out_of_q: impl Fn(DVec3) -> DVec3, within: &Nearness) -> Option<Curve> {
    let near = |d: f64| d.abs() <= within.near;
    let parallel = |sine: f64| (sine * within.size).abs() <= within.lie;
    match (*p.face, *q.face) {
        (Face::Cylinder(Cylinder { origin, axis, radius }), Face::Plane(_)) => {
            if !p.is_convex {
                return None;
            }
            let g = out_of_q(origin);
            let u = -(g - axis * g.dot(axis)).try_normalize()?;
            let line = Curve::Line { origin: origin + u * radius, along: axis };
            parallel(g.dot(axis)).then_some(line)
        }
        (Face::Cone(Cone { apex, axis, sin, cos }), Face::Plane(_)) => {
            if !p.is_convex {
                return None;
            }
            let g = out_of_q(apex);
            let u = -(g - axis * g.dot(axis)).try_normalize()?;
            parallel(g.dot(axis) - sin).then_some(Curve::Line { origin: apex, along: axis * cos + u * sin })
        }
        (
            Face::Cylinder(Cylinder { origin: o, axis: a, radius: r }),
            Face::Cylinder(Cylinder { origin: c, axis: b, radius: s }),
        ) => {
            if !p.is_convex {
                return None;
            }
            let u = ((c - o) - a * (c - o).dot(a)).try_normalize()?;
            let d = (c - o).dot(u);
            let (gap, u) = if q.is_convex { (d - r - s, u) } else { (s - r - d, -u) };
            (near(gap) && parallel(a.cross(b).length())).then_some(Curve::Line { origin: o + u * r, along: a })
        }
        (Face::Sphere(Sphere { center, radius }), Face::Cylinder(Cylinder { origin, axis, radius: s })) => {
            if !p.is_convex || q.is_convex {
                return None;
            }
            let off = (center - origin) - axis * (center - origin).dot(axis);
            near(off.length() + (radius - s).abs()).then_some(Curve::Circle { center, axis, radius })
        }
        (Face::Sphere(Sphere { center, radius }), Face::Cone(Cone { apex, axis, sin, cos })) => {
            if !p.is_convex || q.is_convex {
                return None;
            }
            let z = (center - apex).dot(axis);
            let off = (center - apex) - axis * z;
            let circle = Curve::Circle { center: center - axis * (radius * sin), axis, radius: radius * cos };
            (z > 0.0 && near(off.length()) && near(z * sin - radius)).then_some(circle)
        }
        // A plane touches what is round, and a hollow what is in it, the other way round.
        (Face::Plane(_), Face::Plane(_) | Face::Sphere(_) | Face::Cylinder(_) | Face::Cone(_))
        | (Face::Cylinder(_) | Face::Cone(_), Face::Sphere(_)) => None,
        // These touch at points, or along no line or circle that is looked for.
        (Face::Sphere(_), Face::Plane(_) | Face::Sphere(_))
        | (Face::Cylinder(_), Face::Cone(_))
        | (Face::Cone(_), Face::Cylinder(_) | Face::Cone(_)) => None,
    }
}
