//! Convex pieces of a mesh's facets, cut by planes.

use glam::DVec3;
use smallvec::SmallVec;

/// In place of a mesh edge: a side along which a piece was cut, or along which its neighbour is left out.
pub const CUT: u32 = u32::MAX;

/// A corner of a piece and the side from it to the next.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Where.
    pub at: DVec3,
    /// The mesh edge that the side lies on, or `CUT`.
    pub edge: u32,
}

/// A convex polygon of one facet, counter-clockwise from outside.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Its plane.
    pub plane: u32,
    /// Its corners, three or more.
    pub corners: SmallVec<[Corner; 4]>,
}

impl Piece {
    /// The mean of its corners.
    pub fn middle(&self) -> DVec3 {
        self.corners.iter().map(|c| c.at).sum::<DVec3>() / self.corners.len() as f64
    }

    /// The smallest and the largest n·x − d over it.
    pub fn range(&self, (n, d): (DVec3, f64)) -> (f64, f64) {
        let each = self.corners.iter().map(|c| n.dot(c.at) - d);
        each.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
    }

    /// The part of it where n·x <= d; `None` where none of it lies lower than `tolerance` below the plane. Corners within the
    /// tolerance lie on the plane. Two pieces cut their common edge at the same point, to the bit.
    pub fn below(&self, (n, d): (DVec3, f64), tolerance: f64) -> Option<Piece> {
        let side = |c: &Corner| {
            let v = n.dot(c.at) - d;
            if v.abs() <= tolerance { 0.0 } else { v }
        };
        let sides: SmallVec<[f64; 8]> = self.corners.iter().map(side).collect();
        if sides.iter().all(|s| *s >= 0.0) {
            return None;
        }
        if sides.iter().all(|s| *s <= 0.0) {
            // What is on the plane with a whole side is bounded there.
            let mut whole = self.clone();
            for i in 0..sides.len() {
                if sides[i] == 0.0 && sides[(i + 1) % sides.len()] == 0.0 {
                    whole.corners[i].edge = CUT;
                }
            }
            return Some(whole);
        }
        let mut corners = SmallVec::new();
        for i in 0..sides.len() {
            let j = (i + 1) % sides.len();
            let (a, b, p, q) = (self.corners[i], self.corners[j], sides[i], sides[j]);
            if p <= 0.0 {
                corners.push(if p == 0.0 && q >= 0.0 { Corner { edge: CUT, ..a } } else { a });
            }
            if p * q < 0.0 {
                let at = between((a.at, p), (b.at, q));
                corners.push(Corner { at, edge: if p < 0.0 { CUT } else { a.edge } });
            }
        }
        (corners.len() >= 3).then_some(Piece { plane: self.plane, corners })
    }
}

impl Piece {
    /// `below`, of a piece that is not wholly below as it is.
    pub fn within(self, (n, d): (DVec3, f64), tolerance: f64) -> Option<Piece> {
        if self.corners.iter().all(|c| n.dot(c.at) - d < -tolerance) {
            return Some(self);
        }
        self.below((n, d), tolerance)
    }
}

/// Where a segment crosses a plane, from its ends' heights above it: the same whichever end comes first.
fn between(a: (DVec3, f64), b: (DVec3, f64)) -> DVec3 {
    let later = a.0.to_array().partial_cmp(&b.0.to_array()) == Some(std::cmp::Ordering::Greater);
    let ((p, v), (q, w)) = if later { (b, a) } else { (a, b) };
    p + (q - p) * (v / (v - w))
}
