//! A face over a box as two parallel planes that hold its surface between them.
//!
//! Let c be the centre of the box, v = psi(c), n its gradient, q the distance of a point from the centre or axis measured
//! along the radial direction at c, and τ its offset from there along the directions in which the face curves. Then the
//! surface lies where
//!
//! v + n·(x − c) + σ = 0,   ½ κ⁻ τ² <= σ <= ½ κ⁺ τ²
//!
//! | face | κ⁻ | κ⁺ | if |
//! |---|---|---|---|
//! | plane | 0 | 0 | |
//! | sphere, cylinder | 1/r | 2/(r + √(r² − T²)) | q >= 0, T < r |
//! | cone | 2 cos α/(q⁺ + √(q⁺² + T²)) | cos α/q⁻ | q⁻ > 0 |
//! | elliptic | as the face it is an image of, in the coordinates B(x − o), of a cone with cos α = 1 | | |
//! | bowl | as an elliptic cone's, q⁻ > 0 | | |
//! | saddle | −1/q⁻ of \|N\| | 1/q⁻ of \|P\| | both > 0 |
//! | torus | min(0, n_ρ)/q⁻ | 2/(r + √(r² − T²)) | q⁻ > 0, T < r, the box no deeper than the middle of the tube |
//!
//! with T the largest τ and q⁻, q⁺ the range of q over the box. Sphere: x is inside where (r + v + n·(x − c))² + τ² <= r²,
//! and r − √(r² − τ²) = τ²/(r + √(r² − τ²)); the cylinder the same in its cross-section. Cone: inside where √(q² + τ²) cos α
//! <= z sin α, and √(q² + τ²) − q = τ²/(q + √(q² + τ²)). So nothing with v + n·(x − c) > 0 is inside, and everything where it is
//! <= −½ κ⁺ T² is. Torus: it holds the ball of its tube at c, and psi >= n_ρ (ρ − R) + n_z z − r, where ρ − q <= τ²/(2 q⁻): what bends
//! inwards moves the outer plane out by ½ |κ⁻| T². Only points between these planes matter: T, q⁻ and q⁺ are taken over them once more (`tightened`).
//!
//! Both planes lie further apart by the rounding of v and n·(x − c) (`span::rounding`), which also covers that of cutting along
//! them. Their distance is of the second order in the size of the box, and no part of it comes from directions along which
//! the face is straight.

use super::cell::{Cell, Plane};
use crate::octree::span::rounding;
use crate::solid::surface::{Bend, Law};
use crate::solid::{Face, Sense};
use glam::DVec3;

/// Range of κ over a box, and the largest τ.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    /// κ⁻ and κ⁺, per length.
    pub range: [f64; 2],
    /// T, a length.
    pub reach: f64,
}

/// A face's two planes in the coordinates u of a box, x = c + E u.
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    law: Law,
    /// E n.
    gradient: DVec3,
    /// Length of psi's gradient: the planes lie closer in psi than in space by it.
    slope: f64,
    value: f64,
    /// Rounding, which either plane is moved outwards by.
    pub pad: f64,
    /// E times the unit vectors along which the face curves.
    pub tangents: [DVec3; 2],
    /// q at the centre, and its gradient.
    radial: (f64, DVec3),
    /// E times the direction along which κ changes: a cone's line through its apex.
    pub along: DVec3,
    /// `None`: the box is too large for the face, and only the outer plane exists.
    pub curve: Option<Curve>,
}

/// Corners of the cube, one of each opposite pair.
const CORNERS: [DVec3; 4] =
    [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, 1.0), DVec3::new(1.0, 1.0, -1.0)];

impl Slab {
    /// The slab of a face over the box center ± half.
    pub fn new(face: &Face, center: DVec3, half: DVec3) -> Self {
        let at = face.at(center);
        let Bend { law, radial: (rho, radial), tangents, core } = face.bend(center, &at);
        let mut slab = Self {
            law: law.over(half),
            gradient: at.normal * half,
            slope: at.slope,
            value: at.value,
            pad: rounding(face, center, half),
            tangents: tangents.map(|t| t * half),
            radial: (rho, radial * half),
            along: if law.changes_along() { at.normal.cross(tangents[0]) * half } else { DVec3::ZERO },
            curve: None,
        };
        let widest = slab.radial.1.abs().element_sum();
        let reach = CORNERS.iter().map(|u| slab.offset(*u)).fold(0.0, f64::max);
        if core > slab.gradient.abs().element_sum() + slab.pad {
            slab.curve = slab.curvature(reach, [rho - widest, rho + widest]);
        }
        slab
    }

    /// τ at a point of the cube.
    fn offset(&self, u: DVec3) -> f64 {
        self.tangents[0].dot(u).hypot(self.tangents[1].dot(u))
    }

    fn curvature(&self, reach: f64, [least, most]: [f64; 2]) -> Option<Curve> {
        // T and q are right to a few units in the last place of what they come from.
        let t = reach * (1.0 + 64.0 * f64::EPSILON);
        let range = self.law.range(t, [least, most], self.pad)?;
        let outward = 8.0 * f64::EPSILON;
        let low = range[0] * if range[0] < 0.0 { 1.0 + outward } else { 1.0 - outward };
        Some(Curve { range: [low, range[1] * (1.0 + outward)], reach: t })
    }

    /// The same, its inner plane moved closer: `between` is what of the cube lies between its planes.
    pub fn tightened(&self, between: &Cell) -> Self {
        let (mut reach, mut least, mut most) = (0.0f64, f64::INFINITY, f64::NEG_INFINITY);
        let (at, gradient) = self.radial;
        for u in between.corners() {
            reach = reach.max(self.offset(u));
            let q = at + gradient.dot(u);
            (least, most) = (least.min(q), most.max(q));
        }
        Self { curve: self.curvature(reach, [least, most]), ..*self }
    }

    /// What of a cell lies before the outer plane, and what of that beyond the inner one.
    pub fn between(&self, cell: &Cell, outer: &mut Cell, between: &mut Cell) {
        let planes = [true, false].map(|all| self.plane(Sense::Positive, all));
        if let [Some(most), Some(least)] = planes {
            cell.cut(&most, false, outer);
            outer.cut(&least.flipped(), false, between);
        }
    }

    /// What of a cell lies before the inner plane.
    pub fn inside(&self, cell: &Cell, inner: &mut Cell) {
        if let Some(least) = self.plane(Sense::Positive, false) {
            cell.cut(&least, false, inner);
        }
    }

    /// ½ κ⁺ T², the planes' distance without rounding.
    pub fn bulge(&self) -> Option<f64> {
        self.curve.map(|c| 0.5 * c.range[1] * c.reach * c.reach)
    }

    /// ½ |κ⁻| T² of what bends the other way, too: how far the outer plane is moved out. `None` where nobody knows.
    pub fn dent(&self) -> Option<f64> {
        match (self.law, self.curve) {
            (Law::Ring { lean, .. }, None) if lean > 0.0 => None,
            (Law::Saddle { .. }, None) => None,
            (_, curve) => Some(curve.map_or(0.0, |c| 0.5 * (-c.range[0]).max(0.0) * c.reach * c.reach)),
        }
    }

    /// True when refining the box would bring nothing but rounding.
    pub fn is_flat(&self) -> bool {
        self.law.is_straight()
    }

    /// How much each direction of the box adds to the planes' distance, in comparison.
    pub fn bend(&self) -> DVec3 {
        let [a, b] = self.tangents;
        (a * a + b * b) * self.curve.map_or(1.0, |c| c.range[1])
    }

    /// What the vector areas of the cube of half extents `half` are multiplied by for their part along n, per volume and per what psi
    /// is along n.
    pub fn toward(&self, half: DVec3) -> DVec3 {
        let along = self.gradient / (half * half);
        if self.slope == 1.0 { along } else { along / (self.slope * self.slope) }
    }

    /// The half-space of a planar face itself.
    pub fn middle(&self, sense: Sense) -> Plane {
        let plane = Plane { gradient: self.gradient, offset: self.value };
        if sense == Sense::Positive { plane } else { plane.flipped() }
    }

    /// Volume of the part of the cube that rounding leaves in doubt about a planar face, `cube` being all of it.
    pub fn sheet(&self, cube: f64) -> f64 {
        if self.is_flat() { cube * (self.pad / self.gradient.abs().max_element()).min(1.0) } else { 0.0 }
    }

    /// The half-space that stands for a literal of this face: one that holds all of it (`all`), or one that it holds.
    /// `None` where there is no such half-space: all of the box, or nothing of it.
    pub fn plane(&self, sense: Sense, all: bool) -> Option<Plane> {
        let gradient = self.gradient;
        let outer = self.dent().map(|dent| Plane { gradient, offset: self.value - dent - self.pad });
        let inner = self.bulge().map(|bulge| Plane { gradient, offset: self.value + bulge + self.pad });
        match (sense, all) {
            (Sense::Positive, true) => outer,
            (Sense::Positive, false) => inner,
            (Sense::Negative, true) => inner.map(|p| p.flipped()),
            (Sense::Negative, false) => outer.map(|p| p.flipped()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::solid::surface::{Bowl, Cone, Cylinder, Elliptic, Plane, Saddle, Sphere, Torus};

    #[test]
    fn the_surface_lies_between_the_planes() {
        let mut r = Random(11);
        let (mut tight, mut seen, mut tighter) = (0, 0, 0);
        for i in 0..13_200 {
            let (o, n) = (r.vector(1.0), r.vector(1.0).normalize());
            let axes = glam::DMat3::from_rotation_y(n.y);
            let bends = glam::DVec2::new(r.within(0.3, 2.0), r.within(0.3, 2.0));
            let face = match i % 11 {
                0 => Plane { normal: n, offset: r.within(-1.0, 1.0) }.into(),
                1 => Sphere { center: o, radius: r.within(0.2, 2.0) }.into(),
                2 => Cylinder { origin: o, axis: n, radius: r.within(0.2, 2.0) }.into(),
                3 => Torus { origin: o, axis: n, major: r.within(0.3, 2.0), minor: r.within(0.1, 1.0) }.into(),
                4 => {
                    let semi = DVec3::new(r.within(0.3, 2.0), r.within(0.3, 2.0), r.within(0.3, 2.0));
                    Elliptic::ellipsoid(o, glam::DMat3::from_rotation_x(n.x), semi).into()
                }
                5 => Elliptic::cylinder(o, [r.vector(1.0) + DVec3::X, r.vector(1.0) + DVec3::Y]).into(),
                7 => Bowl::new(o, axes, bends, [r.within(-0.1, 1.0), r.within(0.3, 1.0)], 1.0).into(),
                8 => Saddle::hyperboloid(o, axes, DVec3::new(0.3, r.within(0.4, 1.0), r.within(0.3, 2.0))).into(),
                9 => Saddle::paraboloid(o, axes, bends, 1.0).into(),
                6 => Elliptic::cone(o, [r.vector(1.0) + DVec3::X, r.vector(1.0) + DVec3::Y], DVec3::Z).into(),
                _ => {
                    let (sin, cos) = r.within(0.1, 1.4).sin_cos();
                    Face::from(Cone { apex: o, axis: n, sin, cos })
                }
            };
            let half = DVec3::new(r.within(0.01, 0.4), r.within(0.01, 0.4), r.within(0.01, 0.4));
            let c = r.vector(2.0);
            let mut slab = Slab::new(&face, c, half);
            if let Some(whole) = slab.bulge() {
                let quarter = Slab::new(&face, c, half / 4.0).bulge().unwrap();
                assert!(quarter <= whole / 16.0 * (1.0 + 1e-9), "{face:?} {c} {half}: not of the second order");
                assert!(whole == 0.0 || !slab.is_flat());
                let [mut outer, mut between] = [(); 2].map(|()| Cell::default());
                slab.between(&Cell::cube(), &mut outer, &mut between);
                if !between.is_empty() {
                    let closer = slab.tightened(&between);
                    assert!(closer.bulge().unwrap() <= whole * (1.0 + 1e-9));
                    slab = closer;
                    tighter += usize::from(slab.bulge().unwrap() < 0.7 * whole);
                }
            }
            let Some(all) = slab.plane(Sense::Positive, true) else { continue };
            let some = slab.plane(Sense::Positive, false);
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
            seen += usize::from(some.is_some());
            tight += usize::from(closest < 0.05);
        }
        assert!(seen > 4000 && tight > 500 && tighter > 200, "{seen} {tight} {tighter}");
    }
}
