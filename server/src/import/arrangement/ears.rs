//! Faces cut into triangles that keep clear of corners which lie on their sides but for roundings: an ear across such a corner would
//! leave a triangle without area beside one that the corner's other facets run through.

use glam::{DVec2, DVec3};

/// How far a corner lies from a triangle to be beside it, in steps of the grid.
const CLEAR: f64 = 64.0;

/// The triangles of a face, corner by corner the ear with the widest least angle; the face itself where no ear is clear.
pub fn triangles(points: &[DVec3], face: &[u32]) -> Vec<Vec<u32>> {
    if face.len() <= 3 {
        return vec![face.to_vec()];
    }
    let flat = seen(points, face);
    let mut left: Vec<usize> = (0..face.len()).collect();
    let mut out = Vec::with_capacity(face.len());
    while left.len() > 3 {
        let count = left.len();
        let around = |k: usize| [left[(k + count - 1) % count], left[k], left[(k + 1) % count]];
        let quality = |k: usize| {
            let at = around(k);
            let [a, b, c] = at.map(|i| flat[i]);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let height = (b - a).perp_dot(c - a) / longest;
            let is_clear = height > CLEAR && !left.iter().any(|i| !at.contains(i) && is_near(flat[*i], [a, b, c]));
            is_clear.then_some(height / longest)
        };
        let best =
            (0..count).filter_map(|k| Some((k, quality(k)?))).max_by(|p, q| p.1.total_cmp(&q.1).then(q.0.cmp(&p.0)));
        let Some((k, _)) = best else { return vec![face.to_vec()] };
        out.push(around(k).map(|i| face[i]).to_vec());
        left.remove(k);
    }
    out.push(left.into_iter().map(|i| face[i]).collect());
    out
}

/// The corners of a face seen along the axis that its normal points along most, so that it runs counter-clockwise.
fn seen(points: &[DVec3], face: &[u32]) -> Vec<DVec2> {
    let at = |i: usize| points[face[i] as usize] - points[face[0] as usize];
    let normal: DVec3 = (1..face.len() - 1).map(|i| at(i).cross(at(i + 1))).sum();
    let k = (0..3).fold(0, |most, k| if normal[k].abs() > normal[most].abs() { k } else { most });
    let flat = |i: usize| {
        let (u, v) = (at(i)[(k + 1) % 3], at(i)[(k + 2) % 3]);
        if normal[k] > 0.0 { DVec2::new(u, v) } else { DVec2::new(v, u) }
    };
    (0..face.len()).map(flat).collect()
}

/// True for a point of a triangle, or beside it by no more than what counts as clear.
fn is_near(p: DVec2, [a, b, c]: [DVec2; 3]) -> bool {
    [(a, b), (b, c), (c, a)].iter().all(|(from, to)| (*to - *from).perp_dot(p - *from) >= -CLEAR * from.distance(*to))
}
