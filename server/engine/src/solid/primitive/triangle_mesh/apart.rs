//! Whether two facets have more in common than what joins them: decided exactly where they cross, told as doubt where they are as
//! near to each other as roundings.

use super::MeshFault;
use super::surface::Surface;
use crate::math::Aabb;
use glam::DVec3;
use robust::{Coord3D, orient3d};

/// Facets nearer to each other than this, in tolerances, are looked at again.
const NEAR: f64 = 1e3;
/// Facets that are thinner than this, in tolerances, too.
const THIN: f64 = 1e5;
/// Facets that share a corner are this many times farther than near from each other's sides to be apart by that.
const FAR: f64 = 64.0;

/// How two facets lie to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FacetPair {
    /// They share what joins them and nothing else, by far.
    Apart,
    /// Not to be told from here.
    Doubtful,
    /// One runs through the other.
    Crossing,
}

/// On which side of the plane through a, b and c a point is; its sign is exact.
fn side([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
    let of = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    -orient3d(of(a), of(b), of(c), of(p))
}

/// True where a segment with its ends on both sides of a facet's plane runs through the facet or its rim.
fn pierces(p: DVec3, q: DVec3, t: [DVec3; 3]) -> bool {
    let ends = [side(t, p), side(t, q)];
    if !(ends[0] > 0.0 && ends[1] < 0.0 || ends[0] < 0.0 && ends[1] > 0.0) {
        return false;
    }
    let around = [side([p, q, t[0]], t[1]), side([p, q, t[1]], t[2]), side([p, q, t[2]], t[0])];
    around.iter().all(|s| *s >= 0.0) || around.iter().all(|s| *s <= 0.0)
}

/// True where a point is on the inner side of a facet's plane; `None` where it is on it.
pub fn is_below(p: DVec3, t: [DVec3; 3]) -> Option<bool> {
    let height = side(t, p);
    (height != 0.0).then_some(height < 0.0)
}

/// True where a segment runs through a facet; `None` where it only touches it or its rim, or ends as near to it as roundings.
pub fn runs_through(p: DVec3, q: DVec3, t: [DVec3; 3], tolerance: f64) -> Option<bool> {
    let ends = [side(t, p), side(t, q)];
    if ends.iter().all(|s| *s > 0.0) || ends.iter().all(|s| *s < 0.0) {
        return Some(false);
    }
    let around = [side([p, q, t[0]], t[1]), side([p, q, t[1]], t[2]), side([p, q, t[2]], t[0])];
    if around.iter().any(|s| *s > 0.0) && around.iter().any(|s| *s < 0.0) {
        return Some(false);
    }
    let least = NEAR * tolerance * (t[1] - t[0]).cross(t[2] - t[0]).length();
    let is_clear = around.iter().all(|s| *s != 0.0) && ends.iter().all(|s| s.abs() > least);
    is_clear.then_some(true)
}

fn from_segment(x: DVec3, p: DVec3, q: DVec3) -> f64 {
    let along = q - p;
    let t = ((x - p).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    x.distance(p + along * if t.is_nan() { 0.0 } else { t })
}

/// Distance of a point from a triangle.
fn from_triangle(x: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a);
    let beyond = |p: DVec3, q: DVec3| (q - p).cross(x - p).dot(n) < 0.0;
    if !beyond(a, b) && !beyond(b, c) && !beyond(c, a) {
        return ((x - a).dot(n) / n.length()).abs();
    }
    from_segment(x, a, b).min(from_segment(x, b, c)).min(from_segment(x, c, a))
}

/// Distance of two segments (V. Lumelsky 1985).
fn between_segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> f64 {
    let (u, v, w) = (q - p, s - r, p - r);
    let (a, b, c, d, e) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let det = a * c - b * b;
    let inner = if det > 1e-12 * a * c { ((b * e - c * d) / det, (a * e - b * d) / det) } else { (-1.0, -1.0) };
    if (0.0..=1.0).contains(&inner.0) && (0.0..=1.0).contains(&inner.1) {
        return (w + u * inner.0 - v * inner.1).length();
    }
    from_segment(p, r, s).min(from_segment(q, r, s)).min(from_segment(r, p, q)).min(from_segment(s, p, q))
}

/// Distance of a segment from a triangle that it does not run through.
fn beside(p: DVec3, q: DVec3, t: [DVec3; 3]) -> f64 {
    let ends = from_triangle(p, t).min(from_triangle(q, t));
    (0..3).fold(ends, |least, k| least.min(between_segments([p, q], [t[k], t[(k + 1) % 3]])))
}

/// A facet as it is held against others.
pub struct Facet {
    ids: [u32; 3],
    at: [DVec3; 3],
    /// Twice its area times its normal, and how long that is.
    area: DVec3,
    length: f64,
    thin: bool,
}

impl Facet {
    /// The one of a number.
    pub fn of(surface: &Surface, i: u32) -> Self {
        let ids = surface.triangles[i as usize];
        let at = ids.map(|v| surface.vertices[v as usize]);
        let [a, b, c] = at;
        let area = (b - a).cross(c - a);
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        let thin = area.length_squared() <= (THIN * surface.tolerance).powi(2) * longest;
        Self { ids, at, area, length: area.length(), thin }
    }

    /// True where a side of another one runs through it, farther than `near` from whatever it could only touch.
    fn is_pierced(&self, by: &Facet, near: f64) -> bool {
        let t = self.at;
        let heights = by.at.map(|x| self.area.dot(x - t[0]));
        let least = near * self.length;
        (0..3).any(|m| {
            let n = (m + 1) % 3;
            let [v, w] = [heights[m], heights[n]];
            if v.min(w) >= -least || v.max(w) <= least {
                return false;
            }
            let (p, q) = (by.at[m], by.at[n]);
            let around: [f64; 3] = std::array::from_fn(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let least = near * p.distance(q) * a.distance(b);
                let volume = side([p, q, a], b);
                if volume.abs() > least { volume.signum() } else { 0.0 }
            });
            around.iter().sum::<f64>().abs() == 3.0
        })
    }

    /// True where some points all lie farther than `far` beyond one of its sides, of these the ones that count.
    fn is_beside(&self, sides: [bool; 3], points: impl Iterator<Item = DVec3> + Clone, far: f64) -> bool {
        (0..3).filter(|m| sides[*m]).any(|m| {
            let (a, b) = (self.at[m], self.at[(m + 1) % 3]);
            let outward = (b - a).cross(self.area);
            let least = far * (b - a).length() * self.length;
            points.clone().all(|x| outward.dot(x - a) > least)
        })
    }
}

/// How two facets lie to each other.
pub fn pair(tolerance: f64, facets: [&Facet; 2]) -> FacetPair {
    let near = NEAR * tolerance;
    let (ids, at) = ([facets[0].ids, facets[1].ids], [&facets[0].at, &facets[1].at]);
    let others = |k: usize| {
        let ([a, b, c], others) = (ids[k], &ids[1 - k]);
        [!others.contains(&a), !others.contains(&b), !others.contains(&c)]
    };
    let own = [others(0), others(1)];
    let owned = |k: usize| (0..3).filter(move |m| own[k][*m]).map(move |m| at[k][m]);
    for k in 0..2 {
        if facets[k].thin {
            return FacetPair::Doubtful;
        }
        // All that the other one has for itself on one side of this one's plane, and not near it.
        let (n, least) = (facets[k].area, near * facets[k].length);
        let (mut above, mut below, mut count) = (true, true, 0);
        for x in owned(1 - k) {
            let height = n.dot(x - at[k][0]);
            (above, below, count) = (above && height > least, below && height < -least, count + 1);
        }
        if count > 0 && (above || below) {
            return FacetPair::Apart;
        }
    }
    let shared = own[0].iter().filter(|own| !**own).count();
    // Beyond a side, of one that they meet in a corner of a side at that corner: by far, since what is beyond it at the ends of long
    // sides is near it at the ends of short ones.
    let far = if shared == 0 { near } else { FAR * near };
    let sides = |k: usize| std::array::from_fn(|m| shared == 0 || !own[k][m] || !own[k][(m + 1) % 3]);
    if shared < 2 && (0..2).any(|k| facets[k].is_beside(sides(k), owned(1 - k), far)) {
        return FacetPair::Apart;
    }
    match shared {
        0 => {
            let mut least = f64::INFINITY;
            for k in 0..2 {
                for m in 0..3 {
                    let (p, q) = (at[k][m], at[k][(m + 1) % 3]);
                    if pierces(p, q, *at[1 - k]) {
                        return FacetPair::Crossing;
                    }
                    least = least.min(beside(p, q, *at[1 - k]));
                }
            }
            if least <= near { FacetPair::Doubtful } else { FacetPair::Apart }
        }
        1 => {
            let mut least = f64::INFINITY;
            for k in 0..2 {
                let m = (0..3).find(|m| !own[k][*m]).unwrap_or(0);
                let (p, q) = (at[k][(m + 1) % 3], at[k][(m + 2) % 3]);
                if pierces(p, q, *at[1 - k]) {
                    return FacetPair::Crossing;
                }
                least = least.min(beside(p, q, *at[1 - k]));
            }
            if least <= near { FacetPair::Doubtful } else { FacetPair::Apart }
        }
        2 => {
            // In one plane, or nearly: on both sides of their edge.
            if facets[0].area.dot(facets[1].area) > 0.0 && ids_run_against(ids) {
                FacetPair::Apart
            } else {
                FacetPair::Doubtful
            }
        }
        _ => FacetPair::Crossing,
    }
}

/// What is wrong with a mesh of which two facets cross.
pub fn through(surface: &Surface, facets: [u32; 2]) -> MeshFault {
    let facets = facets.map(|i| surface.corners(i));
    let [one, other] = facets.map(Aabb::of_points);
    MeshFault::Through { near: one.intersection(&other).center(), facets: Box::new(facets) }
}

/// The first two facets of few that cross, all of them held against each other.
pub fn first_through(surface: &Surface) -> Option<MeshFault> {
    let count = surface.triangles.len() as u32;
    let all: Vec<(Facet, Aabb)> =
        (0..count).map(|i| (Facet::of(surface, i), Aabb::of_points(surface.corners(i)))).collect();
    let pairs = (0..count).flat_map(|i| (0..i).map(move |j| [j, i]));
    let cross = |[j, i]: &[u32; 2]| {
        let ((one, around), (other, beside)) = (&all[*j as usize], &all[*i as usize]);
        around.meets(beside) && pair(surface.tolerance, [one, other]) == FacetPair::Crossing
    };
    pairs.into_iter().find(cross).map(|facets| through(surface, facets))
}

/// Two facets of few of which an edge runs through the other, clear of its ends, its rim and roundings: solids that only touch each
/// other have none.
pub fn clearly_through(surface: &Surface) -> Option<MeshFault> {
    let count = surface.triangles.len() as u32;
    let mut all: Vec<(u32, Facet, Aabb)> =
        (0..count).map(|i| (i, Facet::of(surface, i), Aabb::of_points(surface.corners(i)))).collect();
    all.sort_by(|(i, _, one), (j, _, other)| one.min.x.total_cmp(&other.min.x).then(i.cmp(j)));
    let near = NEAR * surface.tolerance;
    for (k, (i, one, around)) in all.iter().enumerate() {
        let beside = all[k + 1..].iter().take_while(|(_, _, b)| b.min.x <= around.max.x);
        let met = beside.filter(|(_, _, b)| b.meets(around));
        let found = met.into_iter().find(|(_, other, _)| one.is_pierced(other, near) || other.is_pierced(one, near));
        if let Some((j, ..)) = found {
            return Some(through(surface, [*i.min(j), *i.max(j)]));
        }
    }
    None
}

/// True where two triangles run along an edge that they share in opposite directions.
fn ids_run_against(ids: [[u32; 3]; 2]) -> bool {
    let along = |t: [u32; 3]| (0..3).map(move |k| (t[k], t[(k + 1) % 3]));
    along(ids[0]).any(|(a, b)| along(ids[1]).any(|other| other == (b, a)))
}
