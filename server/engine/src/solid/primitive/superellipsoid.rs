//! Superellipsoid around the origin.

use super::{Checked, Convex, Cuboid, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::halt;
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface;
use crate::solid::surface::superellipsoid::{EXPONENTS, Joined, farthest};
use contactd_proto::Pose;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// All points with ((|x/a|^(2/e₂) + |y/b|^(2/e₂))^(e₂/e₁) + |z/c|^(2/e₁)) <= 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Superellipsoid {
    /// Semi-axes a, b and c, lengths.
    pub semi: DVec3,
    /// e₁ (north to south) and e₂ (east to west), within `superellipsoid::EXPONENTS` of the face.
    pub exponents: DVec2,
}

/// What the gamma functions of the moments leave open, of the volume: a dozen of them, each right to some units in the last place.
const GAMMA_ROUNDING: f64 = 256.0 * f64::EPSILON;

/// Rounding of a norm, outwards.
const OUTWARD: f64 = 1.0 + 16.0 * f64::EPSILON;

impl Superellipsoid {
    /// The largest m·x, m a vector of any length.
    #[inline]
    pub(super) fn reach(&self, m: [f64; 3]) -> f64 {
        farthest(self.semi, self.exponents, DVec3::from_array(m)).0
    }

    /// The point of the surface at Barr's angles: north of the equator and east, in radians.
    fn at(&self, north: f64, east: f64) -> DVec3 {
        halt::work(16);
        let ([s, c], [t, d]) = ([libm::sin(north), libm::cos(north)], [libm::sin(east), libm::cos(east)]);
        let power = |x: f64, e: f64| libm::pow(x.abs(), e).copysign(x);
        let [e, f] = self.exponents.to_array();
        let around = power(c, e);
        self.semi * DVec3::new(around * power(d, f), around * power(t, f), power(s, e))
    }

    /// Points of the surface whose hull stands for it, `pieces` around and half as many from pole to pole, and how far it reaches beyond that hull as far as
    /// is seen at eight places of each piece, a length. Where the surface bends they are close, where it is flat far from each other.
    pub fn tessellated(&self, pieces: u32) -> (Vec<DVec3>, f64) {
        let around = pieces.max(4).next_multiple_of(4);
        let step = 2.0 * PI / f64::from(around);
        let at = |i: f64, j: f64| self.at(i * step - FRAC_PI_2, j * step);
        let whole = |rows: u32| (0..=rows).flat_map(move |i| (0..around).map(move |j| [f64::from(i), f64::from(j)]));
        let face = self.faces()[0];
        let beyond = |[i, j]: [f64; 2]| {
            let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[k, l]| at(i + k, j + l));
            let looks = (0..9u32).map(|k| [0.5 * f64::from(k / 3), 0.5 * f64::from(k % 3)]);
            looks.fold(0.0, |off: f64, [k, l]| {
                let x = at(i + k, j + l);
                let n = face.unit_normal(x);
                off.max(corners.iter().map(|c| n.dot(x - *c)).fold(f64::INFINITY, f64::min))
            })
        };
        let off = whole(around / 2 - 1).map(beyond).fold(0.0, f64::max);
        (whole(around / 2).map(|[i, j]| at(i, j)).collect(), off)
    }

    /// The point at which that is.
    pub(super) fn support(&self, m: DVec3) -> DVec3 {
        farthest(self.semi, self.exponents, m).1
    }

    /// The middle of what reaches as far along the unit vector m, to within an angle `flat`: a point, and the middle of a side where m is square to
    /// it. There the surface is the flatter the lower the exponents, and a point of it says nothing.
    pub(super) fn middle(&self, m: DVec3, flat: f64) -> DVec3 {
        self.support(DVec3::from_array(m.to_array().map(|c| if c.abs() <= flat { 0.0 } else { c })))
    }
}

impl Geometry for Superellipsoid {
    fn faces(&self) -> Vec<Face> {
        vec![surface::Superellipsoid::new(DVec3::ZERO, DMat3::IDENTITY, self.semi, self.exponents).into()]
    }
    fn face_name(&self, _: usize) -> String {
        "surface".into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        let turn = frame.matrix();
        let rows = [0, 1, 2].map(|k| self.reach(turn.row(k).to_array()) * OUTWARD);
        Aabb::around(frame.position, DVec3::from_array(rows))
    }
    /// The largest |x|: by Hölder's inequality a norm of the semi-axes, too, of the exponents 2/(1 − e).
    fn ball(&self) -> Ball {
        let join = |lengths: [f64; 2], e: f64| {
            if e < 1.0 { Joined::new(lengths, 2.0 / (1.0 - e)).length } else { lengths[0].max(lengths[1]) }
        };
        let around = join([self.semi.x, self.semi.y], self.exponents.y);
        Ball::new(DVec3::ZERO, join([around, self.semi.z], self.exponents.x) * OUTWARD)
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.semi.min_element()
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::ZERO
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Superellipsoid(self)
    }
    /// Of the octant of all semi-axes 1, by Dirichlet's integrals over the cross-sections, whose size is (1 − z^(2/e₁))^(e₁/2).
    fn moments(&self) -> Option<Moments> {
        let gamma = libm::tgamma;
        let [h, g] = (0.5 * self.exponents).to_array();
        let once = gamma(1.0 + g);
        // ∫ 1 and ∫ x² of a cross-section.
        let (area, second) =
            (once * once / gamma(1.0 + 2.0 * g), gamma(1.0 + 3.0 * g) * once / (3.0 * gamma(1.0 + 4.0 * g)));
        let volume = area * gamma(1.0 + h) * gamma(1.0 + 2.0 * h) / gamma(1.0 + 3.0 * h);
        let last = gamma(1.0 + 5.0 * h);
        let across = second * gamma(1.0 + h) * gamma(1.0 + 4.0 * h) / last;
        let along = area * gamma(1.0 + 3.0 * h) * gamma(1.0 + 2.0 * h) / (3.0 * last);
        let whole = 8.0 * self.semi.x * self.semi.y * self.semi.z;
        let squares = self.semi * self.semi * DVec3::new(across, across, along);
        Some(Moments::diagonal(whole * volume, 0.0, squares * whole))
    }
    fn moments_doubt(&self) -> f64 {
        8.0 * self.semi.x * self.semi.y * self.semi.z * GAMMA_ROUNDING
    }
    /// A box around it: of use to those who compute with convex bodies. psi <= margin where N <= 1 + margin/s.
    fn grown(&self, margin: f64) -> Option<Shape> {
        let by = (1.0 + margin / self.semi.min_element()) * (1.0 + 1e-14);
        Some(Cuboid { half: self.semi * by }.into())
    }
    fn kind(&self) -> &'static str {
        "superellipsoid"
    }
    fn dimensions(&self) -> String {
        let Self { semi, exponents } = self;
        format!("semi-axes {}, {}, {}, exponents {}, {}", semi.x, semi.y, semi.z, exponents.x, exponents.y)
    }
    fn write(&self, out: &mut dyn Sink) {
        write_vector(out, self.semi);
        out.number(self.exponents.x);
        out.number(self.exponents.y);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        let (semi, exponents) = (read_vector(from)?, DVec2::new(from.finite()?, from.finite()?));
        let within = |e: f64| (EXPONENTS[0]..=EXPONENTS[1]).contains(&e);
        if semi.min_element() > 0.0 && within(exponents.x) && within(exponents.y) {
            Ok(Self { semi, exponents })
        } else {
            Err("semi-axes above 0 and exponents of a superellipsoid")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn moments_and_bounds_are_those_of_points() {
        let mut r = Random(3);
        for _ in 0..6 {
            let semi = DVec3::new(r.within(0.3, 1.0), r.within(0.3, 1.0), r.within(0.3, 1.0));
            let of = Superellipsoid { semi, exponents: DVec2::new(r.within(0.1, 1.0), r.within(0.1, 1.0)) };
            let face = of.faces()[0];
            let (mut count, mut squares, mut far) = (0.0, DVec3::ZERO, 0.0f64);
            let n = 60_000;
            for _ in 0..n {
                let x = semi * DVec3::new(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0));
                if face.value(x) < 0.0 {
                    (count, squares, far) = (count + 1.0, squares + x * x, far.max(x.length()));
                }
            }
            let whole = 8.0 * semi.x * semi.y * semi.z;
            let m = of.moments().expect("a formula");
            assert!((m.volume() - whole * count / f64::from(n)).abs() < 0.02 * whole);
            for (k, square) in squares.to_array().into_iter().enumerate() {
                let own = m.0[4 + [0, 1, 2][k]];
                assert!((own - whole * square / f64::from(n)).abs() < 0.02 * whole * semi[k] * semi[k], "{of:?} {k}");
            }
            let ball = of.ball().radius;
            assert!(far <= ball && far > 0.9 * ball, "{of:?}: {far} of {ball}");
        }
    }
}
