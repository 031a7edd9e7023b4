//! What hulls and sums are made of: balls, discs and points.

use super::facets::{faceted_sphere, ring};
use super::hull::Disc;
use crate::math::Aabb;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// Two lengths that differ by less than this, relative to the size at hand, are one.
pub const SAME: f64 = 1e-9;

/// What a convex solid is the hull of.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// Its middle.
    pub(super) center: DVec3,
    /// Of a ball or a disc; 0 of a point.
    pub(super) radius: f64,
    /// Of a disc: its frame, z square to it.
    pub(super) axes: Option<DMat3>,
    /// Of a disc: the radius of the ball that its rim is rounded with, all points within it of the disc.
    pub(super) round: f64,
    /// Pieces that OpenSCAD cuts its curve into.
    pub(super) pieces: u32,
    /// Of a point that stands for a curve with others: how far off it they are at most.
    pub(super) off: f64,
}

impl Element {
    /// A point.
    pub fn point(center: DVec3) -> Self {
        Self { center, radius: 0.0, axes: None, round: 0.0, pieces: 1, off: 0.0 }
    }

    /// A point of those that stand for a curved solid, `off` from it at most.
    pub fn facet(center: DVec3, off: f64) -> Self {
        Self { off, ..Self::point(center) }
    }

    /// Its middle.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Its box.
    pub fn bounds(&self) -> Aabb {
        let half = match self.axes {
            None => DVec3::splat(self.radius),
            Some(axes) => {
                let disc = (DVec3::ONE - axes.z_axis * axes.z_axis).max(DVec3::ZERO).map(f64::sqrt);
                disc * self.radius + DVec3::splat(self.round)
            }
        };
        Aabb::around(self.center, half)
    }

    /// What its shadow on z = 0 is the hull of; `None` for an ellipse.
    pub fn shadow(&self) -> Option<Vec<Disc>> {
        if self.off > 0.0 {
            return None;
        }
        let disc = |center: DVec3, radius: f64| Disc { center: center.truncate(), radius };
        let Some(axes) = self.axes else { return Some(vec![disc(self.center, self.radius)]) };
        let aside = axes.z_axis.truncate();
        if aside.length() <= SAME {
            return Some(vec![disc(self.center, self.radius + self.round)]);
        }
        // A disc that stands upright casts a line.
        let along = (aside.perp().normalize() * self.radius).extend(0.0);
        let ends = || vec![disc(self.center - along, self.round), disc(self.center + along, self.round)];
        (axes.z_axis.z.abs() <= SAME).then(ends)
    }

    /// Moved.
    pub fn moved(self, by: DVec3) -> Self {
        Self { center: self.center + by, ..self }
    }

    /// The sum of two, where it is one of a kind.
    pub(super) fn plus(&self, other: &Self) -> Option<Self> {
        let (center, pieces) = (self.center + other.center, self.pieces.max(other.pieces));
        // Discs that lie alike add up, and so do balls; a ball rounds a disc.
        let (radius, axes, round) = match (self.axes, other.axes) {
            (None, None) => (self.radius + other.radius, None, 0.0),
            (Some(a), None) => (self.radius, Some(a), self.round + other.radius),
            (None, Some(b)) => (other.radius, Some(b), other.round + self.radius),
            (Some(a), Some(b)) if a.z_axis.cross(b.z_axis).length() <= SAME => {
                (self.radius + other.radius, Some(a), self.round + other.round)
            }
            (Some(_), Some(_)) => return None,
        };
        Some(Self { center, radius, axes, round, pieces, off: self.off + other.off })
    }

    /// The points that stand for it under a matrix that flattens it.
    pub fn flattened(&self, by: &DAffine3) -> Vec<Self> {
        let m = by.matrix3;
        let size = (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt();
        let off = self.deviation() * size;
        self.facets().into_iter().map(|p| Self::facet(by.transform_point3(p), off)).collect()
    }

    /// How far its facets lie inside of it at most.
    pub fn deviation(&self) -> f64 {
        self.off + (self.radius + self.round) * sagitta(self.pieces)
    }

    /// Points whose hull OpenSCAD takes for it.
    pub fn facets(&self) -> Vec<DVec3> {
        if self.radius == 0.0 {
            return vec![self.center];
        }
        let local: Vec<DVec3> = match self.axes {
            None => faceted_sphere(self.radius, self.pieces, self.pieces.div_ceil(2)).0,
            Some(axes) if self.round == 0.0 => {
                ring(self.radius, self.pieces).into_iter().map(|p| axes * p.extend(0.0)).collect()
            }
            Some(axes) => {
                // Along the rim the outer half of the ball's circle.
                let tube = ring(self.round, self.pieces.next_multiple_of(4)).into_iter().filter(|p| p.x >= 0.0);
                let tube: Vec<DVec2> = tube.collect();
                let rim = ring(1.0, self.pieces).into_iter();
                let at = |x: DVec2| tube.iter().map(move |p| axes * (x * (self.radius + p.x)).extend(p.y)).collect();
                rim.flat_map(|x| -> Vec<DVec3> { at(x) }).collect()
            }
        };
        local.into_iter().map(|p| self.center + p).collect()
    }
}

/// How far the middle of a chord is from a circle of radius 1 that is cut into so many pieces.
pub fn sagitta(pieces: u32) -> f64 {
    1.0 - libm::cos(std::f64::consts::PI / f64::from(pieces.max(3)))
}
