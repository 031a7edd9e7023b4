//! The nearest point to 0 of the difference of two convex sets that are told by their supports: Gilbert, Johnson and
//! Keerthi's algorithm.
//!
//! Source: E. G. Gilbert, D. W. Johnson, S. S. Keerthi, IEEE J. Robotics and Automation 4(2), 1988; the nearest point of a
//! simplex by its regions after C. Ericson, Real-Time Collision Detection, 5.1.

use super::halt;
use glam::{DMat3, DVec3};

/// Points tried at most: curved bodies converge to this accuracy long before.
const ROUNDS: usize = 48;
/// What one of them costs, in looks at a face.
const ROUND: usize = 8;
/// Relative gap between the distance and its lower bound at which a direction is good enough to solve for a contact.
pub const GOOD: f64 = 1e-6;

#[derive(Clone, Copy, Default)]
struct Corner {
    a: DVec3,
    w: DVec3,
    weight: f64,
}

/// How two convex sets stand to each other that are told by their supports.
pub enum Cores {
    /// The shortest vector from one to the other, and the points between which it is, but for rounding. Along flat sides that face each
    /// other that may lead elsewhere in b than to the point of a and this vector.
    Apart {
        /// From a to b.
        v: DVec3,
        /// The point of a.
        a: DVec3,
        /// The point of b.
        b: DVec3,
    },
    /// A point of both, as far as rounding goes.
    Common(DVec3),
    /// Neither was found.
    Open,
}

/// How two convex sets stand to each other, from a first direction, to a relative gap of `good`.
pub fn of_supports(a: impl Fn(DVec3) -> DVec3, b: impl Fn(DVec3) -> DVec3, start: DVec3, good: f64) -> Cores {
    let mut simplex = [Corner::default(); 4];
    let mut count = 0;
    let mut v = start;
    for round in 0..ROUNDS {
        halt::work(ROUND);
        let sa = a(v);
        let w = b(-v) - sa;
        let square = v.length_squared();
        if round > 0 && (square - v.dot(w) <= good * square || simplex[..count].iter().any(|c| c.w == w)) {
            break;
        }
        simplex[count] = Corner { a: sa, w, weight: 1.0 };
        let Some(kept) = reduce(&mut simplex, count + 1) else {
            return common(&simplex).map_or(Cores::Open, Cores::Common);
        };
        count = kept;
        let next: DVec3 = simplex[..count].iter().map(|c| c.w * c.weight).sum();
        if round > 1 && next.length_squared() >= square {
            break;
        }
        v = next;
    }
    let [a, b] = [0.0, 1.0].map(|k| simplex[..count].iter().map(|c| (c.a + c.w * k) * c.weight).sum());
    Cores::Apart { v, a, b }
}

/// The shortest convex combination of some vectors; `None` if it is 0, or there are none.
pub fn least_of(vectors: &[DVec3]) -> Option<DVec3> {
    let mut simplex = [Corner::default(); 4];
    let mut count = 0;
    let mut v = *vectors.first()?;
    for _ in 0..ROUNDS {
        halt::work(vectors.len());
        let w = vectors.iter().copied().fold(v, |w, g| if g.dot(v) < w.dot(v) { g } else { w });
        if count > 0 && (v.dot(v) - v.dot(w) <= GOOD * v.dot(v) || simplex[..count].iter().any(|c| c.w == w)) {
            break;
        }
        simplex[count] = Corner { a: DVec3::ZERO, w, weight: 1.0 };
        count = reduce(&mut simplex, count + 1)?;
        v = simplex[..count].iter().map(|c| c.w * c.weight).sum();
    }
    Some(v)
}

/// The point of A that the corners of a tetrahedron around 0 make.
fn common(s: &[Corner; 4]) -> Option<DVec3> {
    let [o, p, q, r] = s.map(|c| c.w);
    let edges = DMat3::from_cols(p - o, q - o, r - o);
    let weights = edges.inverse() * -o;
    let rest = 1.0 - weights.element_sum();
    let x = s[0].a * rest + s[1].a * weights.x + s[2].a * weights.y + s[3].a * weights.z;
    x.is_finite().then_some(x)
}

/// Keeps the corners whose weights are positive.
fn keep<const N: usize>(s: &mut [Corner; 4], weights: [(usize, f64); N]) -> usize {
    let mut kept = 0;
    for (i, weight) in weights {
        if weight > 0.0 {
            if kept < i {
                s[kept] = s[i];
            }
            s[kept].weight = weight;
            kept += 1;
        }
    }
    kept
}

/// Keeps the corners that hold the point of the simplex nearest to 0, with their weights; `None` if 0 lies inside.
fn reduce(s: &mut [Corner; 4], count: usize) -> Option<usize> {
    Some(match count {
        1 => keep(s, [(0, 1.0)]),
        2 => {
            let [a, b] = segment([s[0].w, s[1].w]);
            keep(s, [(0, a), (1, b)])
        }
        3 => {
            let [a, b, c] = triangle([s[0].w, s[1].w, s[2].w]);
            keep(s, [(0, a), (1, b), (2, c)])
        }
        _ => {
            let ([i, j], [a, b, d]) = tetrahedron([s[0].w, s[1].w, s[2].w, s[3].w])?;
            keep(s, [(i, a), (j, b), (3, d)])
        }
    })
}

/// The weights of the corners in the point nearest to 0; 0 for those that do not hold it.
fn segment([a, b]: [DVec3; 2]) -> [f64; 2] {
    let d = b - a;
    let t = (-a.dot(d)).max(0.0);
    let length = d.length_squared();
    if t < length {
        let t = t / length;
        [1.0 - t, t]
    } else {
        [0.0, 1.0]
    }
}

/// The same of a triangle.
fn triangle([a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (-ab.dot(a), -ac.dot(a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (-ab.dot(b), -ac.dot(b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let (d5, d6) = (-ab.dot(c), -ac.dot(c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

/// The same of a tetrahedron whose last corner was added to the triangle of the others, on the side of it where 0 is, so that
/// 0 is nearest to one of the other faces: its first two corners, and the weights of these and the last; `None` if it lies inside.
fn tetrahedron([a, b, c, d]: [DVec3; 4]) -> Option<([usize; 2], [f64; 3])> {
    let mut best = None;
    let mut least = f64::INFINITY;
    // Normals of the faces at the last corner, and on which side of each the corner is that it misses.
    let (da, db, dc) = (a - d, b - d, c - d);
    let (bc, ca, ab) = (db.cross(dc), dc.cross(da), da.cross(db));
    let side = da.dot(bc);
    for (n, (p, q), corners) in [(ab, (a, b), [0, 1]), (ca, (a, c), [0, 2]), (bc, (b, c), [1, 2])] {
        // 0 on the other side of the face than the corner that it misses, or the tetrahedron flat.
        if -d.dot(n) * side <= 0.0 {
            let t = triangle([p, q, d]);
            let square = (p * t[0] + q * t[1] + d * t[2]).length_squared();
            if best.is_none() || square < least {
                (best, least) = (Some((corners, t)), square);
            }
        }
    }
    best
}
