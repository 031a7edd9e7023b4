//! Convex polyhedra cut out of the cube [−1, 1]³ by planes, and their moments.
//!
//! A face is a closed chain of directed edges, counter-clockwise as seen from outside, in no particular order: neither
//! cutting nor integrating needs one. A cut point is interpolated from the corner inside towards the one outside, so the
//! two faces at an edge get the same bits and the surface stays closed, whatever rounding does.
//!
//! Cutting costs no more than a plane that lies a few ε away would: corners within rounding of the plane may go either
//! way, and a cut point lies on its edge and within 4 ε of the plane, for planes with Σ|g| <= 1. Whoever cuts keeps that
//! distance (`slab`).

use crate::math::moments::{Moments, PAIRS};
use glam::DVec3;
use smallvec::SmallVec;

/// The half-space g·u + d <= 0.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Gradient g.
    pub gradient: DVec3,
    /// Value d at the origin.
    pub offset: f64,
}

impl Plane {
    /// g·u + d.
    pub fn value(&self, u: DVec3) -> f64 {
        self.gradient.dot(u) + self.offset
    }

    /// The other side.
    pub fn flipped(&self) -> Self {
        Self { gradient: -self.gradient, offset: -self.offset }
    }
}

/// A convex polyhedron, or nothing.
#[derive(Clone, Debug, Default)]
pub struct Cell {
    edges: Vec<[DVec3; 2]>,
    /// Where each face's edges end, and whether it is a wall.
    ends: Vec<(usize, bool)>,
}

impl Cell {
    /// The cube [−1, 1]³.
    pub fn cube() -> Self {
        let mut cube = Self::default();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let (mut out, mut right, mut up) = ([0.0; 3], [0.0; 3], [0.0; 3]);
                (out[axis], right[(axis + 1) % 3], up[(axis + 2) % 3]) = (side, side, 1.0);
                let [out, right, up] = [out, right, up].map(DVec3::from_array);
                let corners = [out - right - up, out + right - up, out + right + up, out - right + up];
                cube.edges.extend((0..4).map(|i| [corners[i], corners[(i + 1) % 4]]));
                cube.ends.push((cube.edges.len(), true));
            }
        }
        cube
    }

    /// True when nothing is left.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// Least and largest value of a plane's function over the polyhedron: it is linear, corners decide.
    pub fn range(&self, plane: &Plane) -> (f64, f64) {
        self.edges
            .iter()
            .map(|e| plane.value(e[0]))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
    }

    /// Its corners, each as often as it begins an edge.
    pub fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.edges.iter().map(|e| e[0])
    }

    /// Σ |n·a| over the vector areas a of its walls.
    pub fn shadow(&self, n: DVec3) -> f64 {
        let (mut sum, mut from) = (0.0, 0);
        for &(end, wall) in &self.ends {
            if wall {
                let twice: DVec3 = self.edges[from..end].iter().map(|[a, b]| a.cross(*b)).sum();
                sum += 0.5 * n.dot(twice).abs();
            }
            from = end;
        }
        sum
    }

    /// What of the polyhedron lies in a half-space, into `out`; the new face is a wall or is not.
    pub fn cut(&self, plane: &Plane, wall: bool, out: &mut Self) {
        out.edges.clear();
        out.ends.clear();
        let mut cap: SmallVec<[[DVec3; 2]; 12]> = SmallVec::new();
        let mut from = 0;
        for &(end, was_wall) in &self.ends {
            let head = out.edges.len();
            // Where the boundary leaves the half-space and where it comes back: once each, but for rounding.
            let (mut leaves, mut returns) = (SmallVec::<[DVec3; 2]>::new(), SmallVec::<[DVec3; 2]>::new());
            for &[a, b] in &self.edges[from..end] {
                let (va, vb) = (plane.value(a), plane.value(b));
                match (va <= 0.0, vb <= 0.0) {
                    (true, true) => out.edges.push([a, b]),
                    (true, false) => {
                        let x = a + (b - a) * (va / (va - vb));
                        out.edges.push([a, x]);
                        leaves.push(x);
                    }
                    (false, true) => {
                        let x = b + (a - b) * (vb / (vb - va));
                        out.edges.push([x, b]);
                        returns.push(x);
                    }
                    (false, false) => {}
                }
            }
            for (leave, back) in leaves.into_iter().zip(returns) {
                out.edges.push([leave, back]);
                cap.push([back, leave]);
            }
            if out.edges.len() > head {
                out.ends.push((out.edges.len(), was_wall));
            }
            from = end;
        }
        if !cap.is_empty() {
            out.edges.extend(cap);
            out.ends.push((out.edges.len(), wall));
        }
    }

    /// Its moments, by the signed tetrahedra that the triangles of its faces span with the origin. For a tetrahedron of
    /// corners v₀ … v₃ and S = Σ v: ∫ x = V S/4, ∫ xᵢxⱼ = V/20 (Σ vᵢvⱼ + SᵢSⱼ); F. Tonon, J. Math. Stat. 1, 2004.
    pub fn moments(&self) -> Moments {
        let mut sum = Moments::default();
        let mut from = 0;
        for &(end, _) in &self.ends {
            let p = self.edges[from][0];
            for &[a, b] in &self.edges[from..end] {
                let volume = p.dot(a.cross(b)) / 6.0;
                if volume == 0.0 {
                    continue;
                }
                let s = p + a + b;
                sum.0[0] += volume;
                for k in 0..3 {
                    sum.0[1 + k] += volume * s[k] / 4.0;
                }
                for (k, (i, j)) in PAIRS.into_iter().enumerate() {
                    sum.0[4 + k] += volume / 20.0 * (p[i] * p[j] + a[i] * a[j] + b[i] * b[j] + s[i] * s[j]);
                }
            }
            from = end;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn near(a: &Moments, b: &Moments, slack: f64) {
        for (x, y) in a.0.iter().zip(&b.0) {
            assert!((x - y).abs() <= slack, "{a:?} {b:?}");
        }
    }

    #[test]
    fn the_whole_cube_and_a_corner_of_it() {
        near(&Cell::cube().moments(), &Moments::of_box(DVec3::ONE), 1e-14);
        // x + y + z <= −2 leaves the tetrahedron of side 1 at the corner (−1, −1, −1).
        let mut corner = Cell::default();
        Cell::cube().cut(&Plane { gradient: DVec3::ONE, offset: 2.0 }, true, &mut corner);
        let m = corner.moments().moved(DVec3::ONE);
        let expected = [1. / 6., 1. / 24., 1. / 24., 1. / 24., 1. / 60., 1. / 60., 1. / 60.];
        near(&m, &Moments(std::array::from_fn(|k| *expected.get(k).unwrap_or(&(1. / 120.)))), 1e-14);
    }

    #[test]
    fn both_sides_of_any_cuts_make_the_whole() {
        let mut r = Random(3);
        let mut cuts = 0;
        for _ in 0..300 {
            let mut whole = Cell::cube();
            for _ in 0..6 {
                // One plane in three through corners or along faces: the degenerate ones.
                let gradient = if r.within(0.0, 3.0) < 1.0 {
                    DVec3::AXES[(r.within(0.0, 2.99)) as usize]
                } else {
                    r.vector(1.0).normalize()
                };
                let offset = [r.within(-1.0, 1.0), -gradient.dot(DVec3::ONE), 0.0][(r.within(0.0, 2.99)) as usize];
                let plane = Plane { gradient, offset };
                let (mut a, mut b) = (Cell::default(), Cell::default());
                whole.cut(&plane, true, &mut a);
                whole.cut(&plane.flipped(), true, &mut b);
                let mut sum = a.moments();
                sum.add(&b.moments());
                near(&sum, &whole.moments(), 1e-14);
                assert!(a.range(&plane).1 <= 1e-15 || a.is_empty());
                cuts += usize::from(!a.is_empty() && !b.is_empty());
                whole = if a.moments().volume() > b.moments().volume() { a } else { b };
            }
        }
        assert!(cuts > 900, "{cuts}");
    }
}
