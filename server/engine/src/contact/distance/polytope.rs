//! A convex polytope as its corners: what planes leave of a box.
//!
//! A corner knows by a bit which planes pass through it. Two corners may be the ends of an edge only where they share two planes
//! (T. S. Motzkin et al., The double description method, 1953); a plane adds the point where it cuts each such pair. A bit too many
//! makes a point too many, within the hull; so corners that lie nearly on a plane count as on it, and no edge is missed.
//!
//! What rounding takes: planes are moved outwards by `outward` before they cut. By induction over the cuts the exact polytope lies
//! within a few units in the last place of the corners' hull: a point of it is next to one of the hull before the cut, which the plane
//! so moved keeps.

use crate::math::Aabb;
use glam::DVec3;
use smallvec::SmallVec;

/// Planes at most: as many as a word has bits.
pub const MOST_PLANES: u32 = 64;

/// Corners from which on no plane is taken: what a cut costs grows with their square.
const MOST_CORNERS: usize = 128;

/// Corners within this of a plane, relative to the extent, count as on it.
const ON_PLANE: f64 = 1e-9;

/// A polytope; see the module's head.
#[derive(Clone, Debug)]
pub struct Polytope {
    /// Its corners, with some other points of it; none of an empty one.
    pub corners: Vec<DVec3>,
    incident: Vec<u64>,
    planes: u32,
    extent: f64,
}

impl Polytope {
    /// A finite box; `extent` (a length) is the size of the coordinates that rounding is measured by.
    pub fn of_box(aabb: &Aabb, extent: f64) -> Self {
        let corners = aabb.corners().to_vec();
        let planes = |i: u64| (0..3).map(|k| 1 << (2 * k + (i >> k & 1))).sum();
        Self { corners, incident: (0..8).map(planes).collect(), planes: 6, extent }
    }

    /// What a plane is moved outwards by: more than rounding takes from the hull.
    pub fn outward(&self) -> f64 {
        128.0 * f64::EPSILON * self.extent
    }

    /// True when nothing is left.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The box of it.
    pub fn aabb(&self) -> Aabb {
        Aabb::of_points(self.corners.iter().copied())
    }

    /// True when another plane may be cut with.
    pub fn takes_more(&self) -> bool {
        self.planes < MOST_PLANES && self.corners.len() < MOST_CORNERS
    }

    /// True when more planes than these may be cut with.
    pub fn takes_more_than(&self, spare: u32) -> bool {
        self.planes + spare < MOST_PLANES && 2 * self.corners.len() < MOST_CORNERS
    }

    /// How many planes it was cut with, the sides of the box among them.
    pub fn planes(&self) -> u32 {
        self.planes
    }

    /// Keeps what satisfies normal·x <= offset (a unit normal), and hardly more.
    pub fn cut(&mut self, normal: DVec3, offset: f64) {
        let offset = offset + self.outward();
        let values: SmallVec<[f64; 64]> = self.corners.iter().map(|x| normal.dot(*x) - offset).collect();
        if values.iter().all(|v| *v <= 0.0) || !self.takes_more() {
            return;
        }
        let bit = 1u64 << self.planes;
        self.planes += 1;
        let (mut corners, mut incident) = (Vec::with_capacity(values.len() + 4), Vec::with_capacity(values.len() + 4));
        let near = ON_PLANE * self.extent;
        for (i, v) in values.iter().enumerate() {
            let on = if v.abs() <= near { bit } else { 0 };
            self.incident[i] |= on;
            if *v <= 0.0 {
                corners.push(self.corners[i]);
                incident.push(self.incident[i]);
            }
        }
        for (i, v) in values.iter().enumerate().filter(|(_, v)| **v < 0.0) {
            for (j, w) in values.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                let shared = self.incident[i] & self.incident[j] & !bit;
                if shared.count_ones() >= 2 {
                    let (p, q) = (self.corners[i], self.corners[j]);
                    corners.push(p + (q - p) * (v / (v - w)));
                    incident.push(shared | bit);
                }
            }
        }
        (self.corners, self.incident) = (corners, incident);
    }

    /// The farthest corner along a direction.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        support(&self.corners, direction)
    }
}

/// The farthest of some points along a direction; there is one.
pub fn support(points: &[DVec3], direction: DVec3) -> DVec3 {
    let mut best = (f64::NEG_INFINITY, points[0]);
    for p in points {
        let reach = direction.dot(*p);
        if reach > best.0 {
            best = (reach, *p);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// Random planes around a box: the hull of the corners reaches, along random directions, at least as far as points that are found
    /// to satisfy all planes, and its corners satisfy all planes.
    #[test]
    fn corners_hold_what_the_planes_leave() {
        let mut r = Random(5);
        let mut inside = 0;
        for _ in 0..300 {
            let mut v = |s: f64| DVec3::new(r.within(-s, s), r.within(-s, s), r.within(-s, s));
            let aabb = Aabb::around(v(3.0), v(1.0).abs() + 0.1);
            let mut p = Polytope::of_box(&aabb, 8.0);
            let c = aabb.center();
            let planes: Vec<(DVec3, f64)> = (0..12)
                .map(|i| {
                    let mut n = v(1.0).normalize();
                    if i % 4 == 0 {
                        // Through an edge or nearly along a side of the box.
                        n = (DVec3::AXES[i / 4] + v(1e-9)).normalize();
                    }
                    (n, n.dot(c + v(0.2)) + 0.15)
                })
                .collect();
            planes.iter().for_each(|(n, d)| p.cut(*n, *d));
            for x in &p.corners {
                assert!(planes.iter().all(|(n, d)| n.dot(*x) <= d + 1e-12) && aabb.grown(1e-13).contains(*x));
            }
            for _ in 0..200 {
                let x = c + v(1.0) * aabb.half();
                if planes.iter().all(|(n, d)| n.dot(x) <= *d) {
                    inside += 1;
                    for _ in 0..4 {
                        let u = v(1.0);
                        assert!(u.dot(p.support(u)) >= u.dot(x) - 1e-13);
                    }
                }
            }
        }
        assert!(inside > 500, "{inside}");
    }

    /// Tangents of a ball at points that are drawn, at corners of what is left, and where a plane has touched already: half a ball stays.
    #[test]
    fn tangents_of_a_ball_leave_the_ball() {
        let mut r = Random(9);
        for round in 0..2000 {
            let radius = r.within(0.05, 2.0);
            let low = if round % 2 == 0 { 0.0 } else { -radius };
            let aabb = Aabb::new(DVec3::new(low, -radius, -radius), DVec3::splat(radius));
            let mut p = Polytope::of_box(&aabb, radius);
            let sphere: Vec<DVec3> =
                (0..60).map(|_| r.vector(1.0).normalize() * radius).filter(|x| x.x >= low).collect();
            let mut drawn: Vec<DVec3> = Vec::new();
            for i in 0..40 {
                if !p.takes_more() {
                    break;
                }
                let k = (r.unit() * p.corners.len() as f64) as usize;
                let towards = match i % 4 {
                    0 => p.corners[k],
                    1 => r.vector(1.0).round(),
                    2 if !drawn.is_empty() => drawn[i % drawn.len()] + r.vector(1e-15),
                    _ => r.vector(1.0),
                };
                let Some(n) = towards.try_normalize() else { continue };
                drawn.push(n);
                p.cut(n, radius);
                for x in &sphere {
                    for u in [*x, r.vector(1.0)] {
                        assert!(!p.is_empty() && u.dot(p.support(u)) >= u.dot(*x) - 1e-13, "{round} {i}: {x} is lost");
                    }
                }
            }
        }
    }
}
