//! Triangles between rings: the constrained Delaunay triangulation (spade), without what lies outside.

use glam::DVec2;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::HashMap;

/// The triangles of what rings enclose by the even-odd rule, counter-clockwise, as places in the list of all their corners. The rings
/// touch each other at corners at most.
pub fn triangles(rings: &[Vec<DVec2>]) -> Vec<[usize; 3]> {
    let corners: Vec<DVec2> = rings.iter().flatten().copied().collect();
    // Coordinates too small for the triangulation's arithmetic are 0 to it.
    let tidy = |x: f64| spade::mitigate_underflow(Point2::new(x, 0.0)).x;
    let mut net = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::with_capacity(corners.len());
    // Corners in which rings touch are one vertex: the first of them stands for all.
    let mut place = HashMap::with_capacity(corners.len());
    for (i, p) in corners.iter().enumerate() {
        let Ok(handle) = net.insert(Point2::new(tidy(p.x), tidy(p.y))) else { return Vec::new() };
        place.entry(handle).or_insert(i);
        handles.push(handle);
    }
    let mut first = 0;
    for ring in rings {
        for i in 0..ring.len() {
            let (a, b) = (handles[first + i], handles[first + (i + 1) % ring.len()]);
            if a != b && net.can_add_constraint(a, b) {
                net.add_constraint(a, b);
            }
        }
        first += ring.len();
    }
    // From the outside in: every ring that is crossed changes sides.
    let mut inside = vec![None; net.num_all_faces()];
    let outer = net.outer_face().fix();
    inside[outer.index()] = Some(false);
    let mut stack: Vec<_> = net.convex_hull().map(|e| (e.rev().fix(), false)).collect();
    stack.extend(net.convex_hull().map(|e| (e.fix(), false)));
    while let Some((edge, before)) = stack.pop() {
        let edge = net.directed_edge(edge);
        let other = edge.rev();
        let here = before != edge.is_constraint_edge();
        let face = other.face();
        if inside[face.index()].is_some() {
            continue;
        }
        inside[face.index()] = Some(here);
        if let Some(face) = face.as_inner() {
            stack.extend(face.adjacent_edges().iter().map(|e| (e.fix(), here)));
        }
    }
    let kept = net.inner_faces().filter(|f| inside[f.index()] == Some(true));
    kept.map(|f| f.vertices().map(|v| place[&v.fix()])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn triangles_cover_what_the_even_odd_rule_says_once() {
        let mut r = Random(23);
        for _ in 0..200 {
            // Nested rings, an island in a hole, and one aside that touches the outermost in a corner.
            let ring = |size: f64, x: f64, r: &mut Random| -> Vec<DVec2> {
                let n = 3 + (r.unit() * 12.0) as usize;
                let at = |i: usize| libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
                (0..n).map(|i| DVec2::new(at(i).1, at(i).0) * size * r.within(0.8, 1.0) + DVec2::X * x).collect()
            };
            let mut rings: Vec<Vec<DVec2>> =
                [(3.0, 0.0), (1.0, 0.0), (0.3, 0.0)].map(|(s, x)| ring(s, x, &mut r)).into();
            let corner = rings[0][0];
            rings.push(vec![corner, corner + DVec2::new(1.0, -0.4), corner + DVec2::new(1.0, 0.4)]);
            let corners: Vec<DVec2> = rings.iter().flatten().copied().collect();
            let made = triangles(&rings);
            let area = |p: DVec2, q: DVec2, s: DVec2| 0.5 * (q - p).perp_dot(s - p);
            assert!(made.iter().all(|t| area(corners[t[0]], corners[t[1]], corners[t[2]]) > 0.0));
            for _ in 0..200 {
                let p = DVec2::new(r.within(-3.0, 4.0), r.within(-3.0, 3.0));
                let odd = rings.iter().filter(|ring| {
                    let n = ring.len();
                    let crosses = |i: usize| {
                        let (a, b) = (ring[i], ring[(i + 1) % n]);
                        (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)
                    };
                    (0..n).filter(|i| crosses(*i)).count() % 2 == 1
                });
                let holds = |t: &&[usize; 3]| (0..3).all(|k| area(corners[t[k]], corners[t[(k + 1) % 3]], p) > 0.0);
                assert_eq!(made.iter().filter(holds).count(), odd.count() % 2, "{p} of {rings:?}");
            }
        }
    }
}
