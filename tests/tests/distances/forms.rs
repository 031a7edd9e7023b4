//! Closed forms of distances, from textbooks and nothing of the engine, and how answers are held to them.

use contactd::contact::distance::Distance;
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

/// What a family's answers were against what is known.
pub struct Tally {
    name: &'static str,
    answers: usize,
    /// By how much a bound is on the wrong side of the truth, at most.
    worst: f64,
    /// How far apart the bounds are, at most.
    width: f64,
    cells: u64,
    most: u64,
    failures: Vec<String>,
}

impl Tally {
    /// Of a family of that name.
    pub fn new(name: &'static str) -> Self {
        Self { name, answers: 0, worst: 0.0, width: 0.0, cells: 0, most: 0, failures: Vec::new() }
    }

    /// Takes an answer: right where its bounds hold the truth, are no more than `apart` from each other, its points are as far from
    /// each other as it says, and `and` holds.
    pub fn take(&mut self, i: usize, truth: f64, apart: f64, d: &Distance, and: bool) {
        self.answers += 1;
        self.worst = self.worst.max(d.lower - truth).max(truth - d.upper);
        self.width = self.width.max(d.upper - d.lower);
        self.cells += d.cells;
        self.most = self.most.max(d.cells);
        let points = (d.a.point - d.b.point).length();
        let right = d.lower <= truth + 1e-12
            && truth <= d.upper + 1e-12
            && d.is_settled
            && d.upper - d.lower <= apart
            && (truth == 0.0 || (points - d.upper).abs() < 1e-11)
            && and;
        if !right {
            let Distance { lower, upper, cells, .. } = d;
            self.failures.push(format!("{} {i}: {truth} in [{lower}, {upper}], {cells} cells: {d:?}", self.name));
        }
    }

    /// Prints a row; what was wrong is added to `failures`.
    pub fn tell(mut self, failures: &mut Vec<String>) {
        let (name, answers, worst, width) = (self.name, self.answers, self.worst, self.width);
        let (mean, most) = (self.cells as f64 / answers as f64, self.most);
        println!(
            "{name:18} {answers} answers, bounds {worst:9.1e} on the wrong side, {width:8.1e} apart, {mean:7.1} cells, {most} at most"
        );
        failures.append(&mut self.failures);
    }
}
