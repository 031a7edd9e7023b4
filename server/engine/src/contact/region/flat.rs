//! The patch of two convex bodies that lie on each other with a flat face each, one of them with a round rim: without boxes.
//!
//! Along the normal of two such faces the gap between convex bodies is convex, so the bodies touch in one connected place. Where
//! all that is next to the faces falls away from them by 45 degrees or more, that place is the patch, and what is within a
//! threshold of it: the patch is all that is told.
//!
//! The patch is what the outlines of both faces have in common. The body's other faces cut the face's plane in lines and circles, and
//! these bound the outline. Where two of them meet, and eight marks of each circle, are the points that may bound the patch:
//! Newton's method follows each to the faces' own equations, and both whole trees confirm it, as those that boxes find (`patch`).

use super::local::{Bodies, Lit};
use super::patch::{self, Corners, Cut, MARK};
use super::surface::FacePair;
use super::{Region, patch_region, single};
use crate::contact::exclusion::literal::Side;
use crate::math::any_perpendicular;
use crate::solid::primitive::Primitive;
use crate::solid::surface::curve::{self, Curve};
use glam::{DVec2, DVec3};
use smallvec::SmallVec;

/// Planes that stand on a face by less than this sine leave no digits of where they cut it.
const LEVEL: f64 = 1e-3;
/// Sizes from the middle within which such a plane must not cut the face.
const FAR: f64 = 4.0;
/// Sizes beyond an outline from where on a point bounds no patch: more than faces that lean by `surface::LEAN` shift it.
const BEYOND: f64 = 1e-2;
/// Cosine of opposite normals, at most.
const OPPOSITE: f64 = -0.9;
/// Thresholds between two planes near the middle of the smaller body, at most, when they lie on each other somewhere.
const NEAR: f64 = 16.0;
/// Sizes across which a patch is an area.
const AREA: f64 = 1e-6;
/// Radii from a mark to another point that is a mark of its own.
const SAME_MARK: f64 = 2e-3;

/// A line or circle in a face's plane; inside is where the value is negative.
#[derive(Clone, Copy, Debug)]
enum Rim {
    Line { normal: DVec2, offset: f64 },
    Circle { center: DVec2, radius: f64 },
}

/// What bounds an outline, by name.
#[derive(Clone, Copy, Debug)]
struct Edge {
    key: u64,
    cut: Cut,
    rim: Rim,
}

type Edges = SmallVec<[Edge; 16]>;

/// Coordinates in the plane of a face.
struct Plane {
    origin: DVec3,
    axes: [DVec3; 2],
}

impl Plane {
    fn vector(&self, v: DVec3) -> DVec2 {
        DVec2::new(v.dot(self.axes[0]), v.dot(self.axes[1]))
    }

    fn across(&self, x: DVec3) -> DVec2 {
        self.vector(x - self.origin)
    }

    fn point(&self, u: DVec2) -> DVec3 {
        self.origin + self.axes[0] * u.x + self.axes[1] * u.y
    }

    /// Where a plane n·x = d cuts it; `None` for one that is level.
    fn line(&self, n: DVec3, d: f64) -> Option<Rim> {
        let across = self.vector(n);
        let sine = across.length();
        (sine > LEVEL).then(|| Rim::Line { normal: across / sine, offset: (d - n.dot(self.origin)) / sine })
    }
}

impl Edge {
    /// A plane n·x = d; `None` for one that is level.
    fn plane(plane: &Plane, key: u64, n: DVec3, d: f64) -> Option<Self> {
        Some(Self { key, cut: Cut::Plane(n, d), rim: plane.line(n, d)? })
    }
}

impl Rim {
    fn value(&self, u: DVec2) -> f64 {
        match *self {
            Rim::Line { normal, offset } => normal.dot(u) - offset,
            Rim::Circle { center, radius } => (u - center).length() - radius,
        }
    }

    /// The points that two rims have in common.
    fn meet(&self, other: &Rim) -> SmallVec<[DVec2; 2]> {
        match (*self, *other) {
            (Rim::Line { normal: m, offset: c }, Rim::Line { normal: n, offset: d }) => {
                let turn = m.perp_dot(n);
                let u = DVec2::new(c * n.y - d * m.y, d * m.x - c * n.x) / turn;
                u.is_finite().then_some(u).into_iter().collect()
            }
            (Rim::Line { normal, offset }, Rim::Circle { center, radius })
            | (Rim::Circle { center, radius }, Rim::Line { normal, offset }) => {
                chord(center, normal, offset - normal.dot(center), radius)
            }
            (Rim::Circle { center: o, radius: r }, Rim::Circle { center: c, radius: s }) => {
                let way = c - o;
                let far = way.length();
                // The chord of both stands this far from o.
                let off = 0.5 * (far + (r - s) * (r + s) / far);
                if off.is_finite() { chord(o, way / far, off, r) } else { SmallVec::new() }
            }
        }
    }
}

/// The ends of the chord of a circle that stands `off` from its centre along a unit normal.
fn chord(center: DVec2, normal: DVec2, off: f64, radius: f64) -> SmallVec<[DVec2; 2]> {
    let squared = (radius - off) * (radius + off);
    if squared < 0.0 {
        return SmallVec::new();
    }
    let (foot, half) = (center + normal * off, normal.perp() * squared.sqrt());
    SmallVec::from_slice(&[foot - half, foot + half])
}

/// The patch of two convex bodies, not both of planes alone; `None` where they do not lie on each other with flat faces, or where
/// the faces next to these are not steep or cut them in other curves.
pub fn regions(bodies: &Bodies) -> Option<Vec<Region>> {
    let both = single::convex(bodies)?;
    if both.iter().any(|whole| whole.faces.len() > single::MOST_FACES) {
        return None;
    }
    let pair = pair(bodies, both)?;
    let middle = middle(bodies, both);
    let (value, normal) = bodies.slant_out(pair.alpha, middle);
    let u = any_perpendicular(normal);
    let plane = Plane { origin: middle - normal * value, axes: [u, normal.cross(u)] };
    // Not of the far sides of bodies thinner than the threshold.
    if single::apart(bodies, both, -normal) > pair.gap(bodies, middle) {
        return None;
    }
    let mut edges = Edges::new();
    for (own, whole) in [pair.alpha, pair.beta].into_iter().zip(both) {
        outline(bodies, &plane, own, whole, &mut edges)?;
    }
    if let Some((n, d)) = pair.limit {
        edges.push(Edge::plane(&plane, 0, n, d)?);
    }
    // A rim that leans is less than a circle across the plane.
    let lean = (normal + bodies.slant_out(pair.beta, middle).1).length_squared();
    let bends = |e: &Edge| matches!(e.rim, Rim::Circle { radius, .. } if radius * lean > 0.1 * BEYOND * bodies.size);
    if edges.iter().any(bends) {
        return None;
    }
    edges.sort_by_key(|e| e.key);
    let mut corners = Corners::of(bodies, &pair);
    let mut add = |p: &Edge, q: &Edge, apart: f64| {
        bodies.work.look(edges.len());
        for u in p.rim.meet(&q.rim) {
            let beyond = |e: &Edge| e.rim.value(u) > BEYOND * bodies.size;
            if !edges.iter().any(beyond)
                && let Some((x, turn)) = patch::newton(bodies, &pair, [&p.cut, &q.cut], plane.point(u))
                && !corners.has_within(x, apart)
            {
                corners.add(x, [p.key, q.key, turn]);
            }
        }
    };
    for (i, p) in edges.iter().enumerate() {
        edges[i + 1..].iter().for_each(|q| add(p, q, 0.0));
        if let (Cut::Face(lit), Rim::Circle { .. }) = (p.cut, p.rim) {
            for (k, (n, d)) in patch::marks(bodies, lit, pair.alpha).into_iter().enumerate() {
                add(p, &Edge::plane(&plane, MARK + k as u64, n, d)?, 0.0);
            }
        }
    }
    // Faces that lean so far that they leave each other are nearest at a corner, or at a point of a circle between two marks.
    if let Some((lean, _)) = pair.limit {
        for p in &edges {
            let Rim::Circle { center, radius } = p.rim else { continue };
            if !edges.iter().any(|e| e.key == 0 && !p.rim.meet(&e.rim).is_empty()) {
                continue;
            }
            let n = normal.cross(lean).normalize_or_zero();
            add(p, &Edge::plane(&plane, MARK + 4, n, n.dot(plane.point(center)))?, SAME_MARK * radius);
        }
    }
    let corners = corners.ordered();
    if bodies.work.is_spent() {
        return None;
    }
    let is_area = corners.first().is_some_and(|c| {
        let ways = || corners.iter().map(|o| plane.across(o.x) - plane.across(c.x));
        let longest = ways().max_by(|v, w| v.length_squared().total_cmp(&w.length_squared()));
        let along = longest.unwrap_or(DVec2::ZERO).normalize_or_zero();
        ways().any(|w| along.perp_dot(w).abs() > AREA * bodies.size)
    });
    is_area.then(|| vec![patch_region(bodies, &pair, &corners)])
}

/// The middle of the smaller body.
fn middle(bodies: &Bodies, both: [&Primitive; 2]) -> DVec3 {
    let (a, b) = (bodies.task.model_a, bodies.task.model_b);
    if a.radius <= b.radius { both[0].ball.center } else { bodies.at.a_point(both[1].ball.center) }
}

/// The two flat faces, one of each, that lie on each other, if no others do.
fn pair(bodies: &Bodies, both: [&Primitive; 2]) -> Option<FacePair> {
    let middle = middle(bodies, both);
    let [of_a, of_b] = [(Side::A, both[0]), (Side::B, both[1])].map(|(side, whole)| {
        let flat = single::literals(side, whole).into_iter().filter(|lit| bodies.face(*lit).is_flat());
        flat.map(|lit| (lit, bodies.slant_out(lit, middle))).collect::<SmallVec<[_; 8]>>()
    });
    let mut found = None;
    for (alpha, (a, m)) in &of_a {
        for (beta, (b, n)) in &of_b {
            if m.dot(*n) < OPPOSITE
                && (a + b).abs() <= NEAR * bodies.tau + bodies.eps
                && let Some(pair) = FacePair::of(bodies, *alpha, *beta)
                && found.replace(pair).is_some()
            {
                return None;
            }
        }
    }
    found
}

/// What bounds a face of a body; `None` where something next to it is not steep, or is neither a line nor a circle.
fn outline(bodies: &Bodies, plane: &Plane, own: Lit, whole: &Primitive, edges: &mut Edges) -> Option<()> {
    let out = bodies.slant_out(own, plane.origin).1;
    let (own_normal, own_offset) = bodies.face(own).flat()?;
    for lit in single::literals(own.0, whole).into_iter().filter(|lit| *lit != own) {
        let face = bodies.face(lit);
        let (rim, at) = match face.flat() {
            Some((n, d)) => {
                // Along the normal from where it cuts the face: the plane it is told in lies a gap away.
                let rise = n.dot(own_normal);
                match plane.line(n - own_normal * rise, d - own_offset * rise) {
                    Some(rim) => (rim, plane.origin),
                    // The far side of the body, as long as it meets the face nowhere near.
                    None if rise < 0.0 && d - n.dot(plane.origin) > FAR * LEVEL * bodies.size => continue,
                    None => return None,
                }
            }
            None => {
                let mut circle = None;
                let mut count = 0;
                curve::common(bodies.face(own), face, bodies.size, bodies.eps, &mut |curve| {
                    count += 1;
                    if let Curve::Circle { center, radius, .. } = curve {
                        circle = Some((center, radius));
                    }
                });
                let (center, radius) = circle.filter(|_| count == 1)?;
                (Rim::Circle { center: plane.across(center), radius }, center + plane.axes[0] * radius)
            }
        };
        let slope = bodies.slant_out(lit, at).1.dot(out);
        if slope > std::f64::consts::FRAC_1_SQRT_2 {
            return None;
        }
        edges.push(Edge { key: patch::key_of(lit) + 1, cut: Cut::Face(lit), rim });
    }
    Some(())
}
