//! A face over a box as two parallel planes that hold its surface between them.
//!
//! Around the centre c of the box, with v = psi(c), n its gradient, ρ the distance from centre or axis, and T the largest
//! tangential offset |d_t| of a point c + d of the box, along which the face curves:
//!
//! | face | beyond v + n·d > 0 all is outside; inside is where v + n·d <= −B |
//! |---|---|
//! | plane | B = 0 |
//! | sphere, cylinder | B = r − √(r² − T²), if T < r and the box does not reach past the centre or axis |
//! | cone | B = cos α (√(q² + T²) − q), q > 0 the least of ρ + u·d over the box, u the radial direction |
//!
//! Sphere: c + d is inside where (ρ + n·d)² + d_t² <= r²; the cylinder the same in its cross-section. Cone: inside where
//! √((ρ + u·d)² + d_t²) cos α <= z sin α, and √(a² + T²) − a falls with a. Both planes lie further apart by the rounding
//! of v and n·d (`span::rounding`), which also covers that of cutting along them.
//!
//! B falls with the square of T: of the second order in the size of the box, and no part of it comes from the directions
//! along which the face is straight.

use super::cell::Plane;
use crate::eco::span::rounding;
use crate::solid::{Face, Sense};
use glam::DVec3;

/// A face's two planes in the coordinates u of a box, x = c + E u.
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    gradient: DVec3,
    /// Values at the centre: of the plane beyond which all is outside, and of that before which all is inside.
    outer: f64,
    inner: Option<f64>,
    /// How much each direction of the box adds to the distance of the planes, in comparison.
    pub bend: DVec3,
}

impl Slab {
    /// The slab of a face over the box center ± half.
    pub fn new(face: &Face, center: DVec3, half: DVec3) -> Self {
        let at = face.at(center);
        let pad = rounding(face, center, half);
        let gradient = at.normal * half;
        // Tangential directions along which the face curves, and the radial part of the smallest distance.
        let (reach, gap) = match *face {
            Face::Plane { .. } => (DVec3::ZERO, Some(0.0)),
            Face::Sphere { radius, .. } => {
                let reach = half * (DVec3::ONE - at.normal * at.normal).max(DVec3::ZERO).map(f64::sqrt);
                // The part of a corner across n is no longer than the corner, nor than the parts of its coordinates.
                let largest = across(at.normal, half).max(0.0);
                (reach, sagitta(radius, largest, at.rho - gradient.abs().element_sum()))
            }
            Face::Cylinder { axis, radius, .. } => {
                let reach = half * axis.cross(at.normal).abs();
                (reach, sagitta(radius, reach.element_sum(), at.rho - gradient.abs().element_sum()))
            }
            Face::Cone { axis, sin, cos, .. } => {
                let radial = (at.normal + axis * sin) / cos;
                let reach = half * axis.cross(radial).abs();
                let least = at.rho - radial.abs().dot(half);
                let t = reach.element_sum();
                (reach, (least > 0.0).then(|| cos * t * t / (least + least.hypot(t))))
            }
        };
        // The bounds of T and B themselves are right to a few units in the last place.
        let inner = gap.map(|b| at.value + b * (1.0 + 64.0 * f64::EPSILON) + pad);
        let bend = if inner.is_some() { reach * reach / at.rho.min(f64::MAX) } else { half };
        Self { gradient, outer: at.value - pad, inner, bend }
    }

    /// True when refining the box would bring nothing but rounding.
    pub fn is_flat(&self) -> bool {
        self.bend == DVec3::ZERO
    }

    /// True when the box is too large for the face: only one of its planes exists.
    pub fn is_rough(&self) -> bool {
        self.inner.is_none()
    }

    /// The half-space that stands for a literal of this face: one that holds all of it (`all`), or one that it holds.
    /// `None` where there is no such half-space: all of the box, or nothing of it.
    pub fn plane(&self, sense: Sense, all: bool) -> Option<Plane> {
        let outside = |offset| Plane { gradient: self.gradient, offset };
        match (sense, all) {
            (Sense::Positive, true) => Some(outside(self.outer)),
            (Sense::Positive, false) => self.inner.map(outside),
            (Sense::Negative, true) => self.inner.map(|offset| outside(offset).flipped()),
            (Sense::Negative, false) => Some(outside(self.outer).flipped()),
        }
    }
}

/// r − √(r² − T²), if T < r and the least distance is not negative.
fn sagitta(radius: f64, t: f64, least: f64) -> Option<f64> {
    (t < radius && least >= 0.0).then(|| t * t / (radius + ((radius - t) * (radius + t)).sqrt()))
}

/// Largest length of a part across the unit vector n of a corner of a box of half extents `half`: a convex function, so
/// a corner decides; opposite corners are alike.
fn across(n: DVec3, half: DVec3) -> f64 {
    let corners = [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]];
    corners.iter().map(|s| (DVec3::from_array(*s) * half).cross(n).length()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn the_surface_lies_between_the_planes() {
        let mut r = Random(11);
        let (mut tight, mut seen) = (0, 0);
        for i in 0..6000 {
            let (o, n) = (r.vector(1.0), r.vector(1.0).normalize());
            let face = match i % 4 {
                0 => Face::Plane { normal: n, offset: r.within(-1.0, 1.0) },
                1 => Face::Sphere { center: o, radius: r.within(0.2, 2.0) },
                2 => Face::Cylinder { origin: o, axis: n, radius: r.within(0.2, 2.0) },
                _ => {
                    let (sin, cos) = r.within(0.1, 1.4).sin_cos();
                    Face::Cone { apex: o, axis: n, sin, cos }
                }
            };
            let half = DVec3::new(r.within(0.01, 0.4), r.within(0.01, 0.4), r.within(0.01, 0.4));
            let c = r.vector(2.0);
            let slab = Slab::new(&face, c, half);
            let (all, some) = (slab.plane(Sense::Positive, true).unwrap(), slab.plane(Sense::Positive, false));
            let mut closest = f64::INFINITY;
            for k in 0..60 {
                let corner = |b: usize| if k >> b & 1 == 0 { -1.0 } else { 1.0 };
                let u = if k < 8 { DVec3::new(corner(0), corner(1), corner(2)) } else { r.vector(1.0) };
                let psi = face.value(c + half * u);
                assert!(psi > 0.0 || all.value(u) <= 0.0, "{face:?} {c} {half}: inside, beyond the outer plane");
                if let Some(some) = some {
                    assert!(psi <= 0.0 || some.value(u) > 0.0, "{face:?} {c} {half}: outside, before the inner plane");
                    closest = closest.min(all.value(u).abs().max(psi.abs()));
                }
            }
            let gap = |slab: &Slab| slab.inner.map(|inner| inner - slab.outer);
            if let Some(whole) = gap(&slab) {
                let quarter = gap(&Slab::new(&face, c, half / 4.0)).unwrap();
                assert!(quarter <= whole / 16.0 + 1e-13, "{face:?} {c} {half}: not of the second order");
                assert!(whole < 1e-13 || !slab.is_flat());
            }
            seen += usize::from(some.is_some());
            tight += usize::from(closest < 0.05);
        }
        assert!(seen > 4000 && tight > 500, "{seen} {tight}");
    }
}
