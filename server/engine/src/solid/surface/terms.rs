//! psi as a sum of few terms: what somebody who does not know the kinds of faces computes it from, a page's shader for one.
//!
//! All kinds but two are a difference of lengths and an affine part: a plane has that part alone, round faces one length |P(x)| with
//! P affine, a saddle two. A torus and a capsule are distances from a circle and from a segment. A kind that is none of these has no
//! terms ([`Surface::terms`](super::Surface::terms)), and whoever draws it takes its triangles.

use super::Row;
use crate::math::any_perpendicular;
use glam::DVec3;

/// What psi is a sum of. Rows are over points x of the face's own frame: slope·x + at.
#[derive(Clone, Debug, PartialEq)]
pub enum Terms {
    /// |P(x)| − |N(x)| + rest(x).
    Lengths {
        /// P: none, two or three rows.
        plus: Vec<Row>,
        /// N: none or two rows.
        minus: Vec<Row>,
        /// What is affine.
        rest: Row,
    },
    /// hypot(|A(x)| − R, z(x)) − r: the distance from a circle, less that of the tube.
    Circle {
        /// A: away from the axis, two rows.
        across: [Row; 2],
        /// z: along the axis, from the plane of the circle.
        along: Row,
        /// R, a length.
        radius: f64,
        /// r, a length.
        tube: f64,
    },
    /// hypot(|A(x)|, max(|z(x)| − h, 0)) − r: the distance from a segment, less that of the tube.
    Segment {
        /// A: away from the line, two rows.
        across: [Row; 2],
        /// z: along the line, from the middle of the segment.
        along: Row,
        /// h, half the length of the segment.
        half: f64,
        /// r, a length.
        tube: f64,
    },
}

impl Terms {
    /// psi at `x`, a length: the face's own up to rounding.
    pub fn value(&self, x: DVec3) -> f64 {
        match self {
            Self::Lengths { plus, minus, rest } => length(plus, x) - length(minus, x) + rest.value(x),
            Self::Circle { across, along, radius, tube } => (length(across, x) - radius).hypot(along.value(x)) - tube,
            Self::Segment { across, along, half, tube } => {
                length(across, x).hypot((along.value(x).abs() - half).max(0.0)) - tube
            }
        }
    }

    /// The face of one length and an affine part, y = x − `origin`.
    pub(super) fn around(origin: DVec3, rows: &[DVec3], fall: DVec3, radius: f64) -> Self {
        let rows = rows.iter().filter(|row| **row != DVec3::ZERO);
        let plus = rows.map(|row| Row::from_origin(*row, 0.0, origin)).collect();
        Self::Lengths { plus, minus: Vec::new(), rest: Row::from_origin(-fall, -radius, origin) }
    }
}

impl Row {
    /// At `x`, a length.
    #[inline]
    pub fn value(&self, x: DVec3) -> f64 {
        self.slope.dot(x) + self.at
    }

    /// slope·(x − origin) + at.
    pub(super) fn from_origin(slope: DVec3, at: f64, origin: DVec3) -> Self {
        Self { slope, at: at - slope.dot(origin) }
    }

    /// What is along an axis through `origin`, and what is across.
    pub(super) fn of_axis(origin: DVec3, axis: DVec3) -> ([Self; 2], Self) {
        let u = any_perpendicular(axis);
        let row = |slope| Self::from_origin(slope, 0.0, origin);
        ([row(u), row(axis.cross(u))], row(axis))
    }
}

/// The length of what rows are at `x`.
fn length(rows: &[Row], x: DVec3) -> f64 {
    rows.iter().map(|row| row.value(x) * row.value(x)).sum::<f64>().sqrt()
}
