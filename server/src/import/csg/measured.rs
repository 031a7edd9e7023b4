//! Moments of extrusions of very many sides in closed form: by the signed tetrahedra of their surface, outlines being simple rings.
//!
//! The surface needs no triangles of its caps: a fan of signed ones about any point of a cap has the same integrals.
//!
//! What the tree of planes holds differs from what is within the surface by what rounding does to the planes. Let each be off by
//! εᵢ at most wherever the extrusion is. A point that is on different sides in both has a value of at most εᵢ at some plane, so
//! it lies in one of these sheets: together no more than Σ 2 εᵢ Aᵢ, Aᵢ the largest area that plane i has in there.

use super::polygon::Edge;
use crate::math::Aabb;
use crate::math::tolerance::ROUNDING;
use crate::solid::Measured;
use crate::solid::primitive::TriangleMesh;
use contactd_proto::Pose;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// Rounding of a point or a direction that a transform moves, times its condition: products and sums of some ten terms.
const TRANSFORMED: f64 = 64.0 * f64::EPSILON;

/// An extrusion as its moments are worked out.
pub struct Walls {
    outer: DAffine3,
    heights: [f64; 2],
    scale: DVec2,
    around: Aabb,
    /// Of coordinates, a length: what a transform's rounding is relative to.
    reach: f64,
    /// Σ εᵢ over walls, each times the length of a line up the wall.
    sheets: f64,
    /// How far corners may lie off their wall, a length.
    bent: f64,
}

fn condition(m: &DMat3) -> f64 {
    let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    norm(m) * norm(&m.inverse())
}

impl Walls {
    /// Those over some rings: between two heights, the upper end being `scale` times the lower one.
    pub fn new(outer: &DAffine3, heights: [f64; 2], scale: DVec2, rings: &[Vec<DVec2>]) -> Self {
        let mut walls = Self { outer: *outer, heights, scale, around: Aabb::EMPTY, reach: 0.0, sheets: 0.0, bent: 0.0 };
        let corners = rings.iter().flatten().flat_map(|p| walls.ends(*p)).collect::<Vec<_>>();
        walls.around = Aabb::of_points(corners.iter().copied());
        let m = outer.matrix3;
        let sizes = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
        let far = rings.iter().flatten().map(|p| p.abs().max(p.abs() * scale)).fold(DVec2::ZERO, DVec2::max);
        let far = far.extend(heights[0].abs().max(heights[1].abs()));
        walls.reach = condition(&m) * (outer.translation.length() + sizes.dot(far));
        walls
    }

    /// A corner at both ends, in the model.
    fn ends(&self, p: DVec2) -> [DVec3; 2] {
        let [low, high] = self.heights;
        [p.extend(low), (p * self.scale).extend(high)].map(|x| self.outer.transform_point3(x))
    }

    /// Counts a wall, as the half-space below z = 0 of a frame stands for it.
    pub fn add(&mut self, [p, q]: Edge, frame: &Pose) {
        let [[a, top], [b, far]] = [p, q].map(|p| self.ends(p));
        let normal = frame.vector(DVec3::Z);
        // From the edge itself and the way up, as vectors: those of corners cancel.
        let [low, high] = self.heights;
        let turn = self.outer.matrix3;
        let up = turn * (p * self.scale - p).extend(high - low);
        let exact = (turn * (q - p).extend(0.0)).cross(up);
        let exact = if turn.determinant() < 0.0 { -exact } else { exact }.normalize();
        let radius = self.around.half().length();
        let off = |x: DVec3| normal.dot(x - frame.position).abs();
        let tilt = (normal - exact).length() + TRANSFORMED * condition(&turn);
        self.sheets += (2.0 * radius * tilt + off(a) + TRANSFORMED * self.reach) * (top - a).length();
        self.bent = self.bent.max(exact.dot(far - b).abs().max(exact.dot(far - top).abs()));
    }

    /// What is within the walls and both ends.
    pub fn measured(&self, rings: &[Vec<DVec2>]) -> Measured {
        let middle = rings.iter().flatten().copied().fold(DVec2::ZERO, |sum, p| sum + p);
        let middle = middle / rings.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let mut points = self.ends(middle).to_vec();
        let mut triangles = Vec::new();
        for ring in rings {
            let (first, n) = (points.len() as u32, ring.len() as u32);
            points.extend(ring.iter().flat_map(|p| self.ends(*p)));
            for k in 0..n {
                let [p, q] = [first + 2 * k, first + 2 * ((k + 1) % n)];
                triangles.extend([[p, q, q + 1], [p, q + 1, p + 1], [0, q, p], [1, p + 1, q + 1]]);
            }
        }
        let about = self.around.center();
        let radius = self.around.half().length();
        let (moments, doubt) =
            TriangleMesh::moments_within(&points, &triangles, about, TRANSFORMED * self.reach + self.bent);
        let moments =
            if self.outer.matrix3.determinant() < 0.0 { moments.mean(&Default::default(), -1.0) } else { moments };
        // No plane has more than a disc of its box' ball; a wall is a strip as high as a line up the wall at most. The hull's
        // planes pass by its corners to a ROUNDING of its size, and its surface is no more than its ball's.
        let walls = 4.0 * radius * self.sheets;
        let ends = 40.0 * radius * radius * (ROUNDING * radius + TRANSFORMED * self.reach);
        Measured { about, moments, doubt: doubt + walls + ends }
    }
}
