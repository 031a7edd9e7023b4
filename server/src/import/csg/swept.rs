//! The box of an outline that turns about an axis, by itself: no pieces of its curves.
//!
//! At the angle φ a point (ρ, z) of the outline is at (ρ cos φ, ρ sin φ, z). Along d it reaches ρ c + z d_z, c = d_x cos φ + d_y sin φ.
//! How far the outline reaches at one φ is its support along (c, d_z), which is convex in c: it is largest where c is least or largest.

use super::facets::direction;
use super::hull::Disc;
use crate::math::Aabb;
use glam::{DAffine3, DVec2, DVec3};

/// What turns, from the axis away and along it.
pub enum Rim {
    /// Corners, of which it is within the hull.
    Corners(Vec<DVec2>),
    /// A disc.
    Disc(Disc),
}

impl Rim {
    fn support(&self, d: DVec2) -> f64 {
        match self {
            Self::Corners(all) => all.iter().map(|p| p.dot(d)).fold(f64::NEG_INFINITY, f64::max),
            Self::Disc(disc) => disc.center.dot(d) + disc.radius * d.length(),
        }
    }
}

/// Outlines that turn about an axis by some angle.
pub struct Swept {
    /// From the axis' frame, z along it, to the model.
    pub outer: DAffine3,
    /// Where the turn begins and how far it goes, degrees.
    pub turn: [f64; 2],
    /// What turns.
    pub rims: Vec<Rim>,
}

impl Swept {
    /// The least and the largest cosine of the turn with a direction square to the axis, times its length.
    fn range(&self, d: DVec2) -> [f64; 2] {
        let [from, angle] = self.turn;
        if angle >= 360.0 {
            return [-d.length(), d.length()];
        }
        let ends = [from, from + angle].map(|phi| direction(phi).dot(d));
        let [mut least, mut largest] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let at = libm::atan2(d.y, d.x).to_degrees();
        if (at - from).rem_euclid(360.0) <= angle {
            largest = d.length();
        }
        if (at + 180.0 - from).rem_euclid(360.0) <= angle {
            least = -d.length();
        }
        [least, largest]
    }

    /// Its box.
    pub fn bounds(&self) -> Aabb {
        let back = self.outer.matrix3.transpose();
        let reach = |d: DVec3| {
            let own = back * d;
            let range = self.range(own.truncate());
            let along = |rim: &Rim| range.map(|c| rim.support(DVec2::new(c, own.z)));
            let most = self.rims.iter().flat_map(along).fold(f64::NEG_INFINITY, f64::max);
            most + self.outer.translation.dot(d)
        };
        let max = DVec3::new(reach(DVec3::X), reach(DVec3::Y), reach(DVec3::Z));
        let min = -DVec3::new(reach(-DVec3::X), reach(-DVec3::Y), reach(-DVec3::Z));
        if max.is_finite() && min.is_finite() { Aabb { min, max } } else { Aabb::EMPTY }
    }
}
