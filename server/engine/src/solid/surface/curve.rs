//! Straight and circular curves of two faces: those that they have in common, and those along which they touch.
//!
//! A face that has such curves says what it is to this file ([`Analytic`], `Surface::analytic`). Of every other one none are looked for: it says nothing.

use super::{Axis, Capsule, Cone, Cylinder, Elliptic, Face, Plane, Sphere, Surface as _, Symmetry, Torus};
use crate::math::any_perpendicular;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_8;

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

/// A face that may have lines or circles in common with another one.
#[derive(Clone, Copy, Debug)]
pub enum Analytic {
    /// A plane.
    Plane(Plane),
    /// A sphere.
    Sphere(Sphere),
    /// A cylinder.
    Cylinder(Cylinder),
    /// A cone.
    Cone(Cone),
    /// A torus.
    Torus(Torus),
    /// An elliptic face: of an image of a cylinder or cone its straight lines.
    Elliptic(Elliptic),
    /// A capsule.
    Capsule(Capsule),
}

impl Analytic {
    /// The face.
    fn face(&self) -> Face {
        match *self {
            Analytic::Plane(f) => f.into(),
            Analytic::Sphere(f) => f.into(),
            Analytic::Cylinder(f) => f.into(),
            Analytic::Cone(f) => f.into(),
            Analytic::Torus(f) => f.into(),
            Analytic::Elliptic(f) => f.into(),
            Analytic::Capsule(f) => f.into(),
        }
    }
}

/// Directions are parallel, and centres on an axis, nearer than this: an angle, and a part of the body's size.
const PARALLEL: f64 = 1e-9;

/// The circle of a centre, an axis and the square of its radius, if it has one above `least`.
fn circle_above(least: f64, center: DVec3, axis: DVec3, squared: f64) -> Option<Curve> {
    (squared > (least * least).max(0.0)).then(|| Curve::Circle { center, axis, radius: squared.sqrt() })
}

/// The lines and circles that two faces have in common, for a body of the diameter `size`; circles with a radius above
/// `least` alone. Both are lengths.
pub fn common(p: &Face, q: &Face, size: f64, least: f64, found: &mut impl FnMut(Curve)) {
    if let (Some(p), Some(q)) = (p.analytic(), q.analytic()) {
        shared(&p, &q, [size, least], found);
    }
}

fn shared(p: &Analytic, q: &Analytic, [size, least]: [f64; 2], found: &mut impl FnMut(Curve)) {
    let mut circle =
        |center, axis, squared| circle_above(least, center, axis, squared).into_iter().for_each(&mut *found);
    match (*p, *q) {
        (
            Analytic::Plane(plane),
            Analytic::Plane(_) | Analytic::Sphere(_) | Analytic::Cylinder(_) | Analytic::Cone(_),
        ) => {
            on_plane(&plane, q, least, found);
        }
        (Analytic::Sphere(Sphere { center: o, radius: r }), Analytic::Sphere(Sphere { center: c, radius: s })) => {
            let d = (c - o).length();
            if d > PARALLEL * size {
                let x = (d * d + (r - s) * (r + s)) / (2.0 * d);
                circle(o + (c - o) * (x / d), (c - o) / d, (r - x) * (r + x));
            }
        }
        (
            Analytic::Cylinder(Cylinder { origin: o, axis: a, radius: r }),
            Analytic::Cylinder(Cylinder { origin: c, axis: b, radius: s }),
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
        (Analytic::Sphere(Sphere { center, radius: s }), Analytic::Cylinder(Cylinder { origin, axis, radius })) => {
            let off = (center - origin) - axis * (center - origin).dot(axis);
            let h = (s - radius) * (s + radius);
            if off.length() <= PARALLEL * size && h > 0.0 {
                circle(center + axis * h.sqrt(), axis, radius * radius);
                circle(center - axis * h.sqrt(), axis, radius * radius);
            }
        }
        (Analytic::Cylinder(Cylinder { origin, axis: a, radius }), Analytic::Cone(Cone { apex, axis, sin, cos })) => {
            let off = (apex - origin) - a * (apex - origin).dot(a);
            if a.cross(axis).length() <= PARALLEL && off.length() <= PARALLEL * size {
                circle(apex + axis * (radius * cos / sin), axis, radius * radius);
            }
        }
        // The same pairs the other way round.
        (Analytic::Sphere(_) | Analytic::Cylinder(_) | Analytic::Cone(_), Analytic::Plane(_))
        | (Analytic::Cylinder(_), Analytic::Sphere(_))
        | (Analytic::Cone(_), Analytic::Cylinder(_)) => shared(q, p, [size, least], found),
        // Two cones, and a cone and a sphere, share no line or circle that is looked for.
        (Analytic::Cone(_), Analytic::Cone(_) | Analytic::Sphere(_)) | (Analytic::Sphere(_), Analytic::Cone(_)) => {}
        (Analytic::Elliptic(image), Analytic::Plane(plane)) => {
            rulings(&image, &plane, PARALLEL).into_iter().flatten().for_each(found);
        }
        (Analytic::Plane(_), Analytic::Elliptic(_)) => shared(q, p, [size, least], found),
        // Beside its segment it is a cylinder, at its ends a ball: what these have in common with another face, as far as it lies there.
        (Analytic::Capsule(capsule), _) => {
            for own in parts_of(&capsule) {
                let curves = all_shared(&own, q, [size, least]);
                curves.into_iter().filter(|curve| lies_on(&capsule, curve, PARALLEL * size)).for_each(&mut *found);
            }
        }
        (_, Analytic::Capsule(_)) => shared(q, p, [size, least], found),
        // Other curves of elliptic faces are no lines that are looked for, and circles by chance alone.
        (Analytic::Elliptic(_), _) | (_, Analytic::Elliptic(_)) => {}
        (Analytic::Torus(torus), _) => coaxial(&torus, q, [PARALLEL, PARALLEL * size], &mut circle),
        (_, Analytic::Torus(_)) => shared(q, p, [size, least], found),
    }
}

/// What a plane and a plane, a sphere, a cylinder or a cone have in common.
fn on_plane(&Plane { normal, offset }: &Plane, q: &Analytic, least: f64, found: &mut impl FnMut(Curve)) {
    let mut circle =
        |center, axis, squared| circle_above(least, center, axis, squared).into_iter().for_each(&mut *found);
    match *q {
        Analytic::Plane(Plane { normal: n, offset: e }) => {
            let (m, d) = (normal, offset);
            let w = m.cross(n);
            if let Some(along) = w.try_normalize().filter(|_| w.length() > PARALLEL) {
                let origin = (n.cross(w) * d + w.cross(m) * e) / w.length_squared();
                found(Curve::Line { origin, along });
            }
        }
        Analytic::Sphere(Sphere { center, radius }) => {
            let h = normal.dot(center) - offset;
            circle(center - normal * h, normal, (radius - h) * (radius + h));
        }
        Analytic::Cylinder(Cylinder { origin, axis, radius }) => {
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
        Analytic::Cone(Cone { apex, axis, sin, cos }) => {
            let z = (offset - normal.dot(apex)) / normal.dot(axis);
            if normal.cross(axis).length() <= PARALLEL && z > 0.0 {
                circle(apex + axis * z, axis, (z * sin / cos) * (z * sin / cos));
            }
        }
        // Of these `shared` knows more.
        Analytic::Elliptic(_) | Analytic::Torus(_) | Analytic::Capsule(_) => {}
    }
}

/// The lines that the image of a cylinder has in common with a plane along its axis: |n₁·y|² + |n₂·y|² = 1 with y from the axis, in the
/// two directions across it, is a circle in the coordinates n₁·y, n₂·y, and the plane a line there.
fn rulings(image: &Elliptic, plane: &Plane, parallel: f64) -> [Option<Curve>; 2] {
    let axis = image.axis();
    if !image.is_cylinder() || plane.normal.dot(axis).abs() > parallel {
        return [None; 2];
    }
    let parts = image.parts();
    // m·v = h with v = B y, |v| = r.
    let back = |v: DVec3| {
        parts
            .rows
            .map(|row| if row == DVec3::ZERO { row } else { row / row.length_squared() })
            .into_iter()
            .zip(v.to_array())
            .map(|(row, v)| row * v)
            .sum::<DVec3>()
    };
    let m = DVec3::from_array([DVec3::X, DVec3::Y, DVec3::Z].map(|e| plane.normal.dot(back(e))));
    let h = (plane.offset - plane.normal.dot(image.origin)) / m.length();
    let m = m.normalize();
    let half = (parts.radius - h) * (parts.radius + h);
    if half <= 0.0 {
        return [None; 2];
    }
    let beside = DVec3::new(-m.y, m.x, 0.0) * half.sqrt();
    [beside, -beside].map(|w| Some(Curve::Line { origin: image.origin + back(m * h + w), along: axis }))
}

/// All that `shared` finds.
fn all_shared(p: &Analytic, q: &Analytic, lengths: [f64; 2]) -> Vec<Curve> {
    let mut all = Vec::new();
    shared(p, q, lengths, &mut |curve| all.push(curve));
    all
}

/// The cylinder and the balls that a capsule is of.
fn parts_of(capsule: &Capsule) -> [Analytic; 3] {
    let Capsule { origin, axis, half, radius } = *capsule;
    let ball = |end: f64| Analytic::Sphere(Sphere { center: origin + axis * end, radius });
    [Analytic::Cylinder(Cylinder { origin, axis, radius }), ball(half), ball(-half)]
}

/// True where part of a curve lies on a capsule, to within a length.
fn lies_on(capsule: &Capsule, curve: &Curve, within: f64) -> bool {
    let on = |x: DVec3| capsule.value(x).abs() <= within;
    match *curve {
        Curve::Line { origin, along } => on(origin + along * (capsule.origin - origin).dot(along)),
        Curve::Circle { center, axis, radius } => {
            let u = any_perpendicular(axis);
            let v = axis.cross(u);
            (0..16).any(|k| {
                let (sin, cos) = libm::sincos(f64::from(k) * FRAC_PI_8);
                on(center + (u * cos + v * sin) * radius)
            })
        }
    }
}

/// True where a face is symmetric about the axis of a torus, by sines up to the first and offsets up to the second.
fn is_about(torus: &Torus, face: &Face, [sine, offset]: [f64; 2]) -> bool {
    let parallel = |d: DVec3| d.cross(torus.axis).length() <= sine;
    let passes = |o: DVec3| (o - torus.origin).cross(torus.axis).length() <= offset;
    match face.symmetry() {
        Symmetry::Normal(normal) => parallel(normal),
        Symmetry::Center(center) => passes(center),
        Symmetry::Axis(Axis { origin, direction }) => parallel(direction) && passes(origin),
        Symmetry::None => false,
    }
}

/// The circles that a torus has in common with a face about its own axis: in a half-plane through the axis, (ρ, z) from the torus'
/// centre, its tube is a circle and the other face a line or a circle.
fn coaxial(torus: &Torus, other: &Analytic, within: [f64; 2], circle: &mut impl FnMut(DVec3, DVec3, f64)) {
    if !is_about(torus, &other.face(), within) {
        return;
    }
    let Torus { origin, axis, major, minor } = *torus;
    let height = |x: DVec3| (x - origin).dot(axis);
    let tube = DVec2::new(major, 0.0);
    let mut at = |p: DVec2| {
        let x = origin + axis * p.y;
        // Of the line through a cone's apex a half belongs to its other nappe; a tube may go beyond the axis.
        let is_on = match other {
            Analytic::Cone(cone) => (x - cone.apex).dot(cone.axis) >= 0.0,
            Analytic::Plane(_)
            | Analytic::Sphere(_)
            | Analytic::Cylinder(_)
            | Analytic::Torus(_)
            | Analytic::Elliptic(_)
            | Analytic::Capsule(_) => true,
        };
        if is_on && p.x > 0.0 {
            circle(x, axis, p.x * p.x);
        }
    };
    // Points at distances r and s from two centres, or at a distance r from one and on the line n·p = d.
    let mut on_line = |n: DVec2, d: f64| {
        let h = n.dot(tube) - d;
        let half = (minor - h) * (minor + h);
        if half > 0.0 {
            let foot = tube - n * h;
            at(foot + n.perp() * half.sqrt());
            at(foot - n.perp() * half.sqrt());
        }
    };
    let (center, radius) = match *other {
        Analytic::Plane(Plane { normal, offset }) => {
            let up = normal.dot(axis).signum();
            return on_line(DVec2::Y, up * (offset - normal.dot(origin)));
        }
        Analytic::Cylinder(Cylinder { radius, .. }) => return on_line(DVec2::X, radius),
        Analytic::Cone(Cone { apex, axis: own, sin, cos }) => {
            let n = DVec2::new(cos, -sin * own.dot(axis).signum());
            return on_line(n, n.y * height(apex));
        }
        Analytic::Sphere(Sphere { center, radius }) => (DVec2::new(0.0, height(center)), radius),
        Analytic::Torus(Torus { origin: o, major, minor, .. }) => (DVec2::new(major, height(o)), minor),
        // About no axis, and of several pieces.
        Analytic::Elliptic(_) | Analytic::Capsule(_) => return,
    };
    let way = center - tube;
    let d = way.length();
    if d > within[1] {
        on_line(way / d, (way / d).dot(tube) + (d * d + (minor - radius) * (minor + radius)) / (2.0 * d));
    }
}

/// The circle along which a torus touches a face about its own axis: it lies under its tube, towards the other body.
fn under_tube(torus: &Torus, q: Outward, out_of_q: impl Fn(DVec3) -> DVec3, within: &Nearness) -> Option<Curve> {
    if !is_about(torus, q.face, [within.lie / within.size, within.lie]) {
        return None;
    }
    let Torus { origin, axis, major, minor } = *torus;
    let u = any_perpendicular(axis);
    let middle = origin + u * major;
    let apart = if q.is_convex { q.face.value(middle) } else { -q.face.value(middle) };
    let n = out_of_q(middle);
    let circle =
        Curve::Circle { center: origin - axis * (n.dot(axis) * minor), axis, radius: major - n.dot(u) * minor };
    ((apart - minor).abs() <= within.near && major > n.dot(u) * minor).then_some(circle)
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

impl Nearness {
    /// Whether a distance counts as none.
    fn is_near(&self, d: f64) -> bool {
        d.abs() <= self.near
    }

    /// Whether directions an angle apart that has this sine count as parallel.
    fn is_parallel(&self, sine: f64) -> bool {
        (sine * self.size).abs() <= self.lie
    }
}

/// The line along which the cylinder `p` touches the cylinder `q` from outside, or from inside where `q` is a wall around it.
fn side_by_side(p: &Cylinder, q: &Cylinder, q_is_convex: bool, within: &Nearness) -> Option<Curve> {
    let way = q.origin - p.origin;
    let u = (way - p.axis * way.dot(p.axis)).try_normalize()?;
    let d = way.dot(u);
    let (gap, u) = if q_is_convex { (d - p.radius - q.radius, u) } else { (q.radius - p.radius - d, -u) };
    (within.is_near(gap) && within.is_parallel(p.axis.cross(q.axis).length()))
        .then_some(Curve::Line { origin: p.origin + u * p.radius, along: p.axis })
}

/// The curve along which the face `p` of one body touches the face `q` of another without lying on it; `out_of_q` is the outward
/// normal of the body of `q` at a point. `None` also for pairs that are told the other way round.
pub fn tangent(p: Outward, q: Outward, out_of_q: impl Fn(DVec3) -> DVec3, within: &Nearness) -> Option<Curve> {
    let near = |d: f64| within.is_near(d);
    let parallel = |sine: f64| within.is_parallel(sine);
    match (p.face.analytic()?, q.face.analytic()?) {
        (Analytic::Cylinder(Cylinder { origin, axis, radius }), Analytic::Plane(_)) => {
            if !p.is_convex {
                return None;
            }
            let g = out_of_q(origin);
            let u = -(g - axis * g.dot(axis)).try_normalize()?;
            let line = Curve::Line { origin: origin + u * radius, along: axis };
            parallel(g.dot(axis)).then_some(line)
        }
        (Analytic::Cone(Cone { apex, axis, sin, cos }), Analytic::Plane(_)) => {
            if !p.is_convex {
                return None;
            }
            let g = out_of_q(apex);
            let u = -(g - axis * g.dot(axis)).try_normalize()?;
            parallel(g.dot(axis) - sin).then_some(Curve::Line { origin: apex, along: axis * cos + u * sin })
        }
        (Analytic::Cylinder(own), Analytic::Cylinder(other)) => {
            if p.is_convex {
                side_by_side(&own, &other, q.is_convex, within)
            } else {
                None
            }
        }
        (Analytic::Sphere(Sphere { center, radius }), Analytic::Cylinder(Cylinder { origin, axis, radius: s })) => {
            if !p.is_convex || q.is_convex {
                return None;
            }
            let off = (center - origin) - axis * (center - origin).dot(axis);
            near(off.length() + (radius - s).abs()).then_some(Curve::Circle { center, axis, radius })
        }
        (Analytic::Sphere(Sphere { center, radius }), Analytic::Cone(Cone { apex, axis, sin, cos })) => {
            if !p.is_convex || q.is_convex {
                return None;
            }
            let z = (center - apex).dot(axis);
            let off = (center - apex) - axis * z;
            let circle = Curve::Circle { center: center - axis * (radius * sin), axis, radius: radius * cos };
            (z > 0.0 && near(off.length()) && near(z * sin - radius)).then_some(circle)
        }
        (Analytic::Elliptic(image), Analytic::Plane(_)) => {
            if !p.is_convex {
                return None;
            }
            let (origin, along, lean) = image.ruling(-out_of_q(image.origin))?;
            parallel(lean).then_some(Curve::Line { origin, along })
        }
        (Analytic::Capsule(Capsule { origin, axis, radius, .. }), _) => {
            tangent(Outward { face: &Cylinder { origin, axis, radius }.into(), ..p }, q, out_of_q, within)
        }
        (_, Analytic::Capsule(Capsule { origin, axis, radius, .. })) => {
            tangent(p, Outward { face: &Cylinder { origin, axis, radius }.into(), ..q }, out_of_q, within)
        }
        // Touching others, they do so at points, or along no line or circle that is looked for.
        (Analytic::Elliptic(_), _) | (_, Analytic::Elliptic(_)) => None,
        // A plane touches what is round, and a hollow what is in it, the other way round.
        (
            Analytic::Plane(_),
            Analytic::Plane(_) | Analytic::Sphere(_) | Analytic::Cylinder(_) | Analytic::Cone(_) | Analytic::Torus(_),
        )
        | (Analytic::Cylinder(_) | Analytic::Cone(_), Analytic::Sphere(_) | Analytic::Torus(_))
        | (Analytic::Sphere(_), Analytic::Torus(_)) => None,
        (Analytic::Torus(torus), _) => {
            if p.is_convex {
                under_tube(&torus, q, out_of_q, within)
            } else {
                None
            }
        }
        // These touch at points, or along no line or circle that is looked for.
        (Analytic::Sphere(_), Analytic::Plane(_) | Analytic::Sphere(_))
        | (Analytic::Cylinder(_), Analytic::Cone(_))
        | (Analytic::Cone(_), Analytic::Cylinder(_) | Analytic::Cone(_)) => None,
    }
}
