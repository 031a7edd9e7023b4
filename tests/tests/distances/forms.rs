//! Closed forms of distances, from textbooks and nothing of the engine.

use glam::DVec3;

/// Distance of a point from the box of these half extents around the origin, negative inside.
pub fn point_box(x: DVec3, half: DVec3) -> f64 {
    let q = x.abs() - half;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
}

/// Distance of a point from the cylinder about z of this radius and half height, outside of it.
pub fn point_cylinder(x: DVec3, radius: f64, half: f64) -> f64 {
    let (r, z) = (x.truncate().length() - radius, x.z.abs() - half);
    r.max(0.0).hypot(z.max(0.0))
}

/// Distance of a point from the solid of revolution about z that a convex polygon (r, z) in r >= 0 makes, outside of it.
pub fn point_turned(x: DVec3, outline: &[(f64, f64)]) -> f64 {
    let p = DVec3::new(x.truncate().length(), x.z, 0.0);
    let corner = |i: usize| DVec3::new(outline[i % outline.len()].0, outline[i % outline.len()].1, 0.0);
    (0..outline.len()).map(|i| point_segment(p, corner(i), corner(i + 1))).fold(f64::INFINITY, f64::min)
}

/// Distance of a point from a segment.
pub fn point_segment(x: DVec3, p: DVec3, q: DVec3) -> f64 {
    let d = q - p;
    let t = if d == DVec3::ZERO { 0.0 } else { ((x - p).dot(d) / d.length_squared()).clamp(0.0, 1.0) };
    (x - p - d * t).length()
}

/// Distance of two segments: within both, or from an end of one.
pub fn segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> f64 {
    let ends = [point_segment(p, r, s), point_segment(q, r, s), point_segment(r, p, q), point_segment(s, p, q)];
    let mut least = ends.into_iter().fold(f64::INFINITY, f64::min);
    let (d, e, w) = (q - p, s - r, p - r);
    let (a, b, c) = (d.length_squared(), d.dot(e), e.length_squared());
    let det = a * c - b * b;
    if det > 1e-12 * a * c {
        let t = (b * e.dot(w) - c * d.dot(w)) / det;
        let u = (a * e.dot(w) - b * d.dot(w)) / det;
        if (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u) {
            least = least.min((w + d * t - e * u).length());
        }
    }
    least
}

/// A box by its corners and edges, placed by `at`.
pub struct Box3 {
    pub half: DVec3,
    pub at: glam::DAffine3,
}

impl Box3 {
    fn corners(&self) -> [DVec3; 8] {
        let sign = |i: usize, k: usize| if i >> k & 1 == 0 { -1.0 } else { 1.0 };
        std::array::from_fn(|i| self.at.transform_point3(self.half * DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2))))
    }

    fn edges(&self) -> Vec<[DVec3; 2]> {
        let c = self.corners();
        (0..8).flat_map(|i| (0..3).filter(move |k| i >> k & 1 == 0).map(move |k| [c[i], c[i | 1 << k]])).collect()
    }
}

/// Distance of two boxes that are apart: of a corner from the other box, or of two edges.
pub fn boxes(a: &Box3, b: &Box3) -> f64 {
    let corners = |p: &Box3, q: &Box3| {
        let own = q.at.inverse();
        p.corners().into_iter().map(|x| point_box(own.transform_point3(x), q.half)).fold(f64::INFINITY, f64::min)
    };
    let mut least = corners(a, b).min(corners(b, a));
    for e in a.edges() {
        for f in b.edges() {
            least = least.min(segments(e, f));
        }
    }
    least
}
