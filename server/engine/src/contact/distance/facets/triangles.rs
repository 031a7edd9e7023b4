//! Two triangles: their nearest points by their features, and the directions along which those keep them apart.
//!
//! Of two triangles that do not cross a corner of the one is nearest to the other, or two edges are nearest to each other (C. Ericson,
//! Real-Time Collision Detection, 5.1.10).

use glam::DVec3;

/// A triangle by its corners.
pub type Triangle = [DVec3; 3];

/// The points of two triangles that are nearest to each other: both the same where they cross.
pub fn nearest(p: &Triangle, q: &Triangle) -> [DVec3; 2] {
    let mut best = (f64::INFINITY, [p[0], q[0]]);
    let mut offer = |x: DVec3, y: DVec3| {
        let square = (x - y).length_squared();
        if square < best.0 {
            best = (square, [x, y]);
        }
    };
    for (a, b) in edges(p) {
        if let Some(x) = crossing(a, b, q) {
            offer(x, x);
        }
        for (c, d) in edges(q) {
            let [x, y] = of_segments([a, b], [c, d]);
            offer(x, y);
        }
        offer(a, of_point(a, q));
    }
    for (c, d) in edges(q) {
        if let Some(x) = crossing(c, d, p) {
            offer(x, x);
        }
        offer(of_point(c, p), c);
    }
    best.1
}

/// The directions that may keep two triangles apart whose nearest points lie along `way`, a unit vector: those of their planes, across two
/// edges, and across one. They are of what the corners say, however near the points are.
pub fn directions(p: &Triangle, q: &Triangle, way: DVec3, mut each: impl FnMut(DVec3)) {
    let mut offer = |n: DVec3| {
        if let Some(n) = n.try_normalize() {
            each(if n.dot(way) < 0.0 { -n } else { n });
        }
    };
    offer(normal(p));
    offer(normal(q));
    for (a, b) in edges(p) {
        for (c, d) in edges(q) {
            offer((b - a).cross(d - c));
        }
    }
    for (a, b) in edges(p).chain(edges(q)) {
        if let Some(along) = (b - a).try_normalize() {
            offer(way - along * along.dot(way));
        }
    }
}

/// Twice the area along the normal.
pub fn normal(t: &Triangle) -> DVec3 {
    (t[1] - t[0]).cross(t[2] - t[0])
}

fn edges(t: &Triangle) -> impl Iterator<Item = (DVec3, DVec3)> {
    let [a, b, c] = *t;
    [(a, b), (b, c), (c, a)].into_iter()
}

/// The point of a triangle that is nearest to a point (Ericson, 5.1.5).
pub fn of_point(x: DVec3, [a, b, c]: &Triangle) -> DVec3 {
    let (ab, ac, ax) = (*b - *a, *c - *a, x - *a);
    let (d1, d2) = (ab.dot(ax), ac.dot(ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bx = x - *b;
    let (d3, d4) = (ab.dot(bx), ac.dot(bx));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return *a + ab * (d1 / (d1 - d3));
    }
    let cx = x - *c;
    let (d5, d6) = (ab.dot(cx), ac.dot(cx));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return *a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return *b + (*c - *b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    *a + ab * (vb / sum) + ac * (vc / sum)
}

/// The points of two segments that are nearest to each other (Ericson, 5.1.9).
fn of_segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> [DVec3; 2] {
    let (u, v, w) = (q - p, s - r, p - r);
    let (a, e, f) = (u.length_squared(), v.length_squared(), v.dot(w));
    if a == 0.0 || e == 0.0 {
        let along = |x: DVec3, o: DVec3, d: DVec3, square: f64| {
            o + d * if square > 0.0 { ((x - o).dot(d) / square).clamp(0.0, 1.0) } else { 0.0 }
        };
        return if a == 0.0 { [p, along(p, r, v, e)] } else { [along(r, p, u, a), r] };
    }
    let (b, c) = (u.dot(v), u.dot(w));
    let det = a * e - b * b;
    let mut at = if det > 0.0 { ((b * f - c * e) / det).clamp(0.0, 1.0) } else { 0.0 };
    let mut to = (b * at + f) / e;
    if !(0.0..=1.0).contains(&to) {
        to = to.clamp(0.0, 1.0);
        at = ((b * to - c) / a).clamp(0.0, 1.0);
    }
    [p + u * at, r + v * to]
}

/// Where a segment runs through a triangle.
fn crossing(p: DVec3, q: DVec3, t: &Triangle) -> Option<DVec3> {
    let n = normal(t);
    let (from, to) = (n.dot(p - t[0]), n.dot(q - t[0]));
    if from * to >= 0.0 {
        return None;
    }
    let x = p + (q - p) * (from / (from - to));
    edges(t).all(|(a, b)| (b - a).cross(x - a).dot(n) >= 0.0).then_some(x)
}
