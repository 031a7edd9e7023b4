//! How far apart two placed bodies are, a judge that shares nothing with the engine: meshes triangle by triangle, with a tree of
//! boxes over them; balls and capsules by the distance of a point or a segment. Surfaces alone count: what lies wholly within
//! another body is as far as its surface is.

use crate::meshes::Mesh;
use contactd_proto::Pose;
use glam::{DVec3, dvec3};

/// A body, in its own frame.
pub enum Body {
    /// The surface of a mesh.
    Mesh(Tree),
    /// All within this distance of the segment along z of this half length.
    Capsule(f64, f64),
}

impl Body {
    /// A mesh.
    pub fn mesh((points, triangles): &Mesh) -> Self {
        Body::Mesh(Tree::of(triangles.iter().map(|t| t.map(|v| points[v as usize])).collect()))
    }

    /// A ball about the origin.
    pub fn ball(radius: f64) -> Self {
        Body::Capsule(0.0, radius)
    }

    /// A box about the origin, by its half extents.
    pub fn cuboid(half: DVec3) -> Self {
        Body::mesh(&cuboid(half))
    }
}

/// The surface of a box about the origin.
pub fn cuboid(half: DVec3) -> Mesh {
    let corner = |i: u32| half * dvec3(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - half;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

type Triangle = [DVec3; 3];

/// Triangles under boxes, halved at the middle: node i has its halves at 2i + 1 and 2i + 2.
pub struct Tree {
    triangles: Vec<Triangle>,
    boxes: Vec<(DVec3, DVec3)>,
    leaves: usize,
}

impl Tree {
    fn of(mut triangles: Vec<Triangle>) -> Self {
        // Leaves of one triangle each; those that are too many repeat the last one.
        let leaves = triangles.len().next_power_of_two();
        sort(&mut triangles, leaves);
        let mut boxes = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY); 2 * leaves - 1];
        for (i, t) in triangles.iter().enumerate() {
            boxes[leaves - 1 + i] = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        }
        for i in (0..leaves - 1).rev() {
            let (a, b) = (boxes[2 * i + 1], boxes[2 * i + 2]);
            boxes[i] = (a.0.min(b.0), a.1.max(b.1));
        }
        Self { triangles, boxes, leaves }
    }
}

/// Orders triangles so that each half of `leaves` places holds neighbours.
fn sort(triangles: &mut [Triangle], leaves: usize) {
    let half = leaves / 2;
    if half == 0 || triangles.len() <= 1 {
        return;
    }
    let middle = |t: &Triangle| t[0] + t[1] + t[2];
    let low = triangles.iter().map(middle).reduce(DVec3::min).unwrap_or_default();
    let size = triangles.iter().map(middle).reduce(DVec3::max).unwrap_or_default() - low;
    let k = if size.x >= size.y.max(size.z) { 0 } else { 1 + usize::from(size.z > size.y) };
    if triangles.len() > half {
        triangles.select_nth_unstable_by(half, |a, b| middle(a)[k].total_cmp(&middle(b)[k]));
        let (low, high) = triangles.split_at_mut(half);
        sort(low, half);
        sort(high, half);
    } else {
        sort(triangles, half);
    }
}

/// The distance of two placed bodies' surfaces, 0 where these meet, if it is less than `most`.
pub fn distance((a, at_a): (&Body, &Pose), (b, at_b): (&Body, &Pose), most: f64) -> f64 {
    match (a, b) {
        (Body::Mesh(a), Body::Mesh(b)) => {
            // The second one in the frame of the first.
            let inverse = at_a.inverse();
            let place = inverse.compose(at_b);
            let turned = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| place.vector(e).abs());
            let moved = |(low, high): (DVec3, DVec3)| {
                let (middle, half) = (place.point(0.5 * (low + high)), 0.5 * (high - low));
                let half = turned[0] * half.x + turned[1] * half.y + turned[2] * half.z;
                (middle - half, middle + half)
            };
            between(a, b, most, &moved, &|t| t.map(|x| place.point(x)))
        }
        (Body::Mesh(mesh), Body::Capsule(half, radius)) => {
            from_capsule(mesh, &at_a.inverse().compose(at_b), *half, *radius, most)
        }
        (Body::Capsule(half, radius), Body::Mesh(mesh)) => {
            from_capsule(mesh, &at_b.inverse().compose(at_a), *half, *radius, most)
        }
        (Body::Capsule(h, r), Body::Capsule(i, s)) => {
            let [p, q] = [at_a.point(DVec3::Z * -*h), at_a.point(DVec3::Z * *h)];
            let [u, v] = [at_b.point(DVec3::Z * -*i), at_b.point(DVec3::Z * *i)];
            (segments(p, q, u, v) - r - s).max(0.0)
        }
    }
}

fn from_capsule(mesh: &Tree, place: &Pose, half: f64, radius: f64, most: f64) -> f64 {
    let [p, q] = [place.point(DVec3::Z * -half), place.point(DVec3::Z * half)];
    let axis = Tree { triangles: vec![[p, q, p]], boxes: vec![(p.min(q), p.max(q))], leaves: 1 };
    (between(mesh, &axis, most + radius, &|b| b, &|t| t) - radius).max(0.0)
}

fn gap(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> f64 {
    (a.0 - b.1).max(b.0 - a.1).max(DVec3::ZERO).length()
}

/// The least distance of the triangles of two trees, the second one's moved, if it is less than `most`.
fn between(
    a: &Tree,
    b: &Tree,
    most: f64,
    moved: &impl Fn((DVec3, DVec3)) -> (DVec3, DVec3),
    placed: &impl Fn(Triangle) -> Triangle,
) -> f64 {
    let mut best = most;
    let mut stack = vec![(gap(a.boxes[0], moved(b.boxes[0])), 0, 0)];
    while let Some((least, i, j)) = stack.pop() {
        if least > best || best == 0.0 {
            continue;
        }
        let leaf = [(i, a), (j, b)].map(|(n, tree): (usize, &Tree)| (n + 1).checked_sub(tree.leaves));
        if let [Some(i), Some(j)] = leaf {
            if let (Some(s), Some(t)) = (a.triangles.get(i), b.triangles.get(j)) {
                best = best.min(triangles(*s, placed(*t)));
            }
            continue;
        }
        let size = |b: (DVec3, DVec3)| (b.1 - b.0).length_squared();
        let first = leaf[1].is_some() || leaf[0].is_none() && size(a.boxes[i]) >= size(b.boxes[j]);
        let mut halves = if first { [(2 * i + 1, j), (2 * i + 2, j)] } else { [(i, 2 * j + 1), (i, 2 * j + 2)] }
            .map(|(i, j)| (gap(a.boxes[i], moved(b.boxes[j])), i, j));
        if halves[0].0 < halves[1].0 {
            halves.swap(0, 1);
        }
        // A box without triangles has no place that could be moved.
        let held = |(low, _): (DVec3, DVec3)| low.is_finite();
        stack.extend(halves.into_iter().filter(|h| h.0 <= best && held(a.boxes[h.1]) && held(b.boxes[h.2])));
    }
    best
}

/// The distance of two triangles; one of them may be a segment, with its first corner as its last.
fn triangles(s: Triangle, t: Triangle) -> f64 {
    let edges = |t: Triangle| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    if edges(s).into_iter().any(|e| pierces(e, t)) || edges(t).into_iter().any(|e| pierces(e, s)) {
        return 0.0;
    }
    let corners = s.into_iter().map(|x| from_triangle(x, t)).chain(t.into_iter().map(|x| from_triangle(x, s)));
    let pairs = edges(s).into_iter().flat_map(|e| edges(t).into_iter().map(move |f| segments(e.0, e.1, f.0, f.1)));
    corners.chain(pairs).fold(f64::INFINITY, f64::min)
}

/// True where a segment runs through the inside of a triangle.
fn pierces((p, q): (DVec3, DVec3), [a, b, c]: Triangle) -> bool {
    let n = (b - a).cross(c - a);
    let (u, v) = (n.dot(p - a), n.dot(q - a));
    if (u > 0.0) == (v > 0.0) || u == v {
        return false;
    }
    let x = p + (q - p) * (u / (u - v));
    [(a, b), (b, c), (c, a)].into_iter().all(|(a, b)| n.dot((b - a).cross(x - a)) > 0.0)
}

/// The distance of a point from a triangle.
fn from_triangle(x: DVec3, [a, b, c]: Triangle) -> f64 {
    let n = (b - a).cross(c - a);
    let within = |p: DVec3, q: DVec3| n.dot((q - p).cross(x - p)) >= 0.0;
    if n.length_squared() > 0.0 && within(a, b) && within(b, c) && within(c, a) {
        return (n.dot(x - a) / n.length()).abs();
    }
    segments(x, x, a, b).min(segments(x, x, b, c)).min(segments(x, x, c, a))
}

/// The distance of two segments, of one from a point where both its ends are the same.
fn segments(p: DVec3, q: DVec3, u: DVec3, v: DVec3) -> f64 {
    let (d, e, r) = (q - p, v - u, p - u);
    let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
    let along = |share: f64, of: f64| if of > 0.0 { (share / of).clamp(0.0, 1.0) } else { 0.0 };
    // Where the lines are nearest, then each end against the other segment.
    let s = along(de * e.dot(r) - ee * d.dot(r), dd * ee - de * de);
    let on_second = |x: DVec3| x.distance(u + e * along(e.dot(x - u), ee));
    let on_first = |x: DVec3| x.distance(p + d * along(d.dot(x - p), dd));
    let t = along(e.dot(p + d * s - u), ee);
    let inner = on_first(u + e * t).min(on_second(p + d * s));
    inner.min(on_second(p)).min(on_second(q)).min(on_first(u)).min(on_first(v))
}
