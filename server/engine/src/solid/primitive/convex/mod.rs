//! What a convex primitive is to those who compute with it: one capability, asked in its own frame or where it stands with some axes.
//!
//! How far it reaches along a direction and with which point, how deep a point lies in it, and what it shows along a direction
//! (`feature`). Nobody outside of this folder asks which of these it is, but who chooses between closed forms.

mod farthest;
mod feature;

use super::elliptic_frustum::EllipticFrustum;
use super::polyhedron::{Corners, middle};
use super::superellipsoid::Superellipsoid;
use crate::math::Lanes;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

pub use farthest::Farthest;
pub use feature::{Features, Hold, Shown};

/// A convex shape in its own frame, centred there but for corners: the few numbers that tell it, or its corners. Two kinds of
/// primitives may be of one form; a cylinder is round with equal radii, which a frustum never has.
#[derive(Clone, Copy, Debug)]
pub enum Convex<'a> {
    /// Radius.
    Ball(f64),
    /// Half sizes.
    Cuboid(DVec3),
    /// A solid of revolution about z between two discs.
    Round {
        /// Radius at z = −half.
        bottom: f64,
        /// Radius at z = +half.
        top: f64,
        /// Half the height.
        half: f64,
    },
    /// All points within a radius of a segment along z.
    Capsule {
        /// Half the length of the segment.
        half: f64,
        /// Radius.
        radius: f64,
    },
    /// The semi-axes of an ellipsoid along the axes.
    Ellipsoid(DVec3),
    /// What any affine map makes of a solid of revolution between two discs.
    Elliptic(&'a EllipticFrustum),
    /// The unit ball of a norm of two exponents, scaled along the axes.
    Superellipsoid(&'a Superellipsoid),
    /// The corners.
    Corners(&'a Corners),
    /// All of z <= 0: it reaches 0 along z, and to infinity along any other direction.
    HalfSpace,
    /// None of these: of a kind that those who compute with forms do not know. They leave it to the search.
    Other,
}

/// How deep a point is.
#[derive(Clone, Copy, Debug)]
pub struct Slope {
    /// f, the largest of the faces' values; negative inside.
    pub f: f64,
    /// The unit normal of the face that tells it, outwards; f lies nowhere below the plane that they make.
    pub normal: DVec3,
    /// Which face that is, of those of the primitive.
    pub face: u32,
}

/// What of a convex body is nearest to a plane in front of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Foremost {
    /// What is near one point.
    Point,
    /// What is no farther from a line than a width.
    Line {
        /// Unit vector along it, in the body's own frame.
        along: DVec3,
        /// A length.
        width: f64,
    },
    /// More, or what is not known.
    Area,
}

/// Discs about one axis, or balls, whose hull a shape is: centres and radii, corners with radius 0.
pub type Discs = SmallVec<[(DVec3, f64); 8]>;

/// How many times deeper than looked at a rim has to fall off across the body, for what is near of it to be near one point.
const RIM: f64 = 8.0;

impl Convex<'_> {
    /// A point inside a bounded one.
    pub fn middle(&self) -> DVec3 {
        match self {
            Convex::Corners(corners) => middle(corners),
            Convex::Ball(_)
            | Convex::Cuboid(_)
            | Convex::Round { .. }
            | Convex::Capsule { .. }
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::HalfSpace
            | Convex::Other => DVec3::ZERO,
        }
    }

    /// The same, to be kept, where few numbers tell it.
    pub fn of_few(self) -> Option<Convex<'static>> {
        match self {
            Convex::Ball(radius) => Some(Convex::Ball(radius)),
            Convex::Cuboid(half) => Some(Convex::Cuboid(half)),
            Convex::Round { bottom, top, half } => Some(Convex::Round { bottom, top, half }),
            Convex::Capsule { half, radius } => Some(Convex::Capsule { half, radius }),
            Convex::Ellipsoid(semi) => Some(Convex::Ellipsoid(semi)),
            Convex::HalfSpace => Some(Convex::HalfSpace),
            Convex::Other => Some(Convex::Other),
            Convex::Elliptic(_) | Convex::Superellipsoid(_) | Convex::Corners(_) => None,
        }
    }

    /// Largest m·x over the shape, in its own frame; m is a unit vector, or two of them. Of any length but for what
    /// has a margin.
    #[inline]
    pub fn extent<T: Lanes>(&self, m: [T; 3]) -> T {
        match self {
            Convex::Ball(radius) => T::all(*radius),
            Convex::Cuboid(half) => m[0].abs() * half.x + m[1].abs() * half.y + m[2].abs() * half.z,
            Convex::Round { bottom, top, half } => {
                let (across, up) = ((m[0] * m[0] + m[1] * m[1]).sqrt(), m[2] * *half);
                (across * *top + up).max(across * *bottom - up)
            }
            Convex::Ellipsoid(semi) => {
                let [x, y, z] = [m[0] * semi.x, m[1] * semi.y, m[2] * semi.z];
                (x * x + y * y + z * z).sqrt()
            }
            Convex::Elliptic(f) => {
                let [rim, up] = f.rim_and_up(m);
                (rim * f.top + up).max(rim * f.bottom - up)
            }
            Convex::Superellipsoid(s) => T::each(m, |m| s.reach(m)),
            Convex::Corners(corners) => {
                corners.iter().fold(T::all(f64::NEG_INFINITY), |far, v| far.max(m[0] * v.x + m[1] * v.y + m[2] * v.z))
            }
            Convex::Capsule { half, radius } => m[2].abs() * *half + T::all(*radius),
            Convex::HalfSpace | Convex::Other => T::all(f64::INFINITY),
        }
    }

    /// Largest n·x over the shape where it stands with these axes; n is a unit vector.
    #[inline]
    pub fn reach(&self, axes: &DMat3, n: DVec3) -> f64 {
        let m = DVec3::new(axes.x_axis.dot(n), axes.y_axis.dot(n), axes.z_axis.dot(n));
        match self {
            Convex::Ball(radius) => *radius,
            Convex::Corners(corners) => corners.farthest(m).0,
            _ => self.extent(m.to_array()),
        }
    }

    /// The same along n of any length.
    #[inline]
    pub fn reach_along(&self, axes: &DMat3, n: DVec3) -> f64 {
        match self {
            Convex::Ball(radius) => radius * n.length(),
            Convex::Capsule { half, radius } => axes.z_axis.dot(n).abs() * half + radius * n.length(),
            Convex::Cuboid(_)
            | Convex::Round { .. }
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => self.extent([axes.x_axis.dot(n), axes.y_axis.dot(n), axes.z_axis.dot(n)]),
        }
    }

    /// False for what those who compute with bounded forms leave to others.
    pub fn is_known(&self) -> bool {
        !matches!(self, Convex::HalfSpace | Convex::Other)
    }

    /// True for all of one side of a plane.
    pub fn is_half_space(&self) -> bool {
        matches!(self, Convex::HalfSpace)
    }

    /// True where the core is the hull of finitely many points.
    pub fn has_corners_alone(&self) -> bool {
        match self {
            Convex::Ball(_) | Convex::Capsule { .. } | Convex::Cuboid(_) | Convex::Corners(_) => true,
            Convex::Round { .. }
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::HalfSpace
            | Convex::Other => false,
        }
    }

    /// The radius of a ball.
    pub fn ball(&self) -> Option<f64> {
        if let Convex::Ball(radius) = self { Some(*radius) } else { None }
    }

    /// What it is thicker than its core: the radius of a ball, whose core is a point, and of a capsule, whose core is a segment; else 0.
    pub fn margin(&self) -> f64 {
        match self {
            Convex::Ball(radius) | Convex::Capsule { radius, .. } => *radius,
            Convex::Cuboid(_)
            | Convex::Round { .. }
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => 0.0,
        }
    }

    /// The farthest point of the core along n, which may have any length, where it stands with these axes about `origin`.
    #[inline]
    pub fn support(&self, axes: &DMat3, origin: DVec3, n: DVec3) -> DVec3 {
        let m = DVec3::new(axes.x_axis.dot(n), axes.y_axis.dot(n), axes.z_axis.dot(n));
        let round = |bottom: f64, top: f64, half: f64| {
            let len = (m.x * m.x + m.y * m.y).sqrt();
            let above = top * len + half * m.z >= bottom * len - half * m.z;
            let (r, z) = if above { (top, half) } else { (bottom, -half) };
            let k = if len > 0.0 { r / len } else { 0.0 };
            DVec3::new(k * m.x, k * m.y, z)
        };
        let local = match *self {
            Convex::Ball(_) | Convex::HalfSpace | Convex::Other => return origin,
            Convex::Round { bottom, top, half } => round(bottom, top, half),
            Convex::Capsule { half, .. } => DVec3::Z * half.copysign(m.z),
            Convex::Cuboid(half) => DVec3::new(half.x.copysign(m.x), half.y.copysign(m.y), half.z.copysign(m.z)),
            Convex::Ellipsoid(semi) => {
                let along = semi * m;
                let length = along.length();
                if length > 0.0 { semi * along / length } else { DVec3::ZERO }
            }
            Convex::Elliptic(f) => f.support(m),
            Convex::Superellipsoid(s) => s.support(m),
            Convex::Corners(corners) => corners.farthest(m).1,
        };
        origin + *axes * local
    }

    /// How deep a point is, seen `from` the frame's centre, by f, the largest of its faces' values: the same as `Primitive::value` but for rounding,
    /// in a fraction of the time. `None` for a polyhedron and what is elliptic.
    #[inline]
    pub fn slope(&self, axes: &DMat3, from: DVec3) -> Option<Slope> {
        let own = || DVec3::new(axes.x_axis.dot(from), axes.y_axis.dot(from), axes.z_axis.dot(from));
        let across = |l: DVec3| (l.x * l.x + l.y * l.y).sqrt();
        // Away from the axis of revolution; on it any direction will do.
        let radial = |l: DVec3, rho: f64| {
            if rho > 0.0 { axes.x_axis * (l.x / rho) + axes.y_axis * (l.y / rho) } else { axes.x_axis }
        };
        let reported = |f, normal, face: usize| Slope { f, normal, face: face as u32 };
        Some(match *self {
            Convex::Ball(radius) => {
                let length = from.length();
                reported(length - radius, if length > 0.0 { from / length } else { DVec3::X }, 0)
            }
            Convex::Cuboid(half) => {
                let l = own();
                let beyond = l.abs() - half;
                let axis = beyond.max_position();
                let below = l[axis].is_sign_negative();
                let normal = axes.col(axis);
                reported(beyond[axis], if below { -normal } else { normal }, 2 * axis + usize::from(below))
            }
            Convex::Round { bottom, top, half } if bottom == top => {
                let l = own();
                let rho = across(l);
                let (side, end) = (rho - bottom, l.z.abs() - half);
                let below = l.z.is_sign_negative();
                if side >= end {
                    reported(side, radial(l, rho), 0)
                } else {
                    reported(end, if below { -axes.z_axis } else { axes.z_axis }, 1 + usize::from(below))
                }
            }
            Convex::Round { bottom, top, half } => {
                let l = own();
                let rho = across(l);
                let (at_bottom, at_top) = (bottom, top);
                let slope = (at_bottom - at_top) / (2.0 * half);
                let tilt = (1.0 + slope * slope).sqrt();
                let side = (rho - 0.5 * (at_bottom + at_top) + slope * l.z) / tilt;
                // An end without a disc has no face there.
                let disc = |radius: f64, beyond: f64| if radius > 0.0 { beyond } else { f64::NEG_INFINITY };
                let (top, bottom) = (disc(at_top, l.z - half), disc(at_bottom, -l.z - half));
                if side >= top.max(bottom) {
                    reported(side, (radial(l, rho) + axes.z_axis * slope) / tilt, 0)
                } else if top > bottom {
                    reported(top, axes.z_axis, 1)
                } else {
                    reported(bottom, -axes.z_axis, 1 + usize::from(at_top > 0.0))
                }
            }
            Convex::Capsule { half, radius } => {
                let core = axes.z_axis * axes.z_axis.dot(from).clamp(-half, half);
                let out = from - core;
                let length = out.length();
                reported(length - radius, if length > 0.0 { out / length } else { axes.x_axis }, 0)
            }
            // Their faces' gradients are no unit vectors: a plane along one would not lie below f.
            Convex::Ellipsoid(_) | Convex::Elliptic(_) | Convex::Superellipsoid(_) => return None,
            Convex::Corners(_) | Convex::HalfSpace | Convex::Other => return None,
        })
    }

    /// How many faces it takes to hold what a polyhedron shows along the unit direction n: 3 for a corner, 2 for an edge, 1
    /// for a face. 0 for round bodies.
    pub fn corner(&self, axes: &DMat3, n: DVec3) -> usize {
        const FLAT: f64 = 1e-6;
        let m = axes.transpose() * n;
        match self {
            Convex::Cuboid(_) => m.to_array().iter().filter(|c| c.abs() > FLAT).count(),
            Convex::Corners(corners) => {
                let reach = corners.iter().fold(f64::NEG_INFINITY, |d, v| d.max(m.dot(*v)));
                let slack = FLAT * corners[0].distance(corners[1]);
                match corners.iter().filter(|v| m.dot(**v) > reach - slack).count() {
                    1 => 3,
                    2 => 2,
                    _ => 1,
                }
            }
            Convex::Ball(_)
            | Convex::Round { .. }
            | Convex::Capsule { .. }
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::HalfSpace
            | Convex::Other => 0,
        }
    }

    /// What of it is within `depth` of its farthest plane along the unit direction n, both in its own frame; faces and edges that
    /// lean against that plane by an angle whose sine is `lean`, or less, count as within. `near`: the depth for which a width is told.
    pub fn foremost(&self, n: DVec3, near: f64, depth: f64, lean: f64) -> Foremost {
        match self {
            Convex::Ball(_) | Convex::Ellipsoid(_) => Foremost::Point,
            Convex::Round { bottom, top, half } => {
                let across = n.truncate().length();
                let ends = [(-half, *bottom), (*half, *top)];
                let reach = |(z, radius): (f64, f64)| n.z * z + radius * across;
                let falls = (reach(ends[1]) - reach(ends[0])).abs();
                let rim = if reach(ends[1]) > reach(ends[0]) { *top } else { *bottom };
                let side = (2.0 * half).hypot(top - bottom);
                // A rim falls off by the square of the way along it.
                let is_rim = |radius: f64| across > lean && radius * across > RIM * depth;
                if falls > depth.max(lean * side) {
                    return if rim == 0.0 || is_rim(rim) { Foremost::Point } else { Foremost::Area };
                }
                let widest = bottom.max(*top);
                if !is_rim(widest) {
                    return Foremost::Area;
                }
                let ruling = (n.truncate() / across * (top - bottom)).extend(2.0 * half);
                Foremost::Line { along: ruling / side, width: (2.0 * widest * near / across).sqrt() }
            }
            Convex::Capsule { half, radius } => {
                if n.z.abs() > lean && 2.0 * half * n.z.abs() > depth {
                    return Foremost::Point;
                }
                let across = n.truncate().length();
                Foremost::Line { along: DVec3::Z, width: (2.0 * radius * near / across).sqrt() }
            }
            Convex::Cuboid(half) => {
                let falls = |k: usize| n[k].abs() > lean && 2.0 * half[k] * n[k].abs() > depth;
                match [0, 1, 2].map(falls) {
                    [true, true, true] => Foremost::Point,
                    [false, true, true] => Foremost::Line { along: DVec3::X, width: near / n.y.abs().min(n.z.abs()) },
                    [true, false, true] => Foremost::Line { along: DVec3::Y, width: near / n.x.abs().min(n.z.abs()) },
                    [true, true, false] => Foremost::Line { along: DVec3::Z, width: near / n.x.abs().min(n.y.abs()) },
                    _ => Foremost::Area,
                }
            }
            Convex::Corners(corners) => {
                let Some(far) = corners.iter().copied().max_by(|v, w| n.dot(*v).total_cmp(&n.dot(*w))) else {
                    return Foremost::Area;
                };
                let stays = |v: &&DVec3| n.dot(far - **v) <= depth.max(lean * far.distance(**v)) && **v != far;
                let mut beside = corners.iter().filter(stays);
                match (beside.next(), beside.next()) {
                    (None, _) => Foremost::Point,
                    (Some(v), None) => Foremost::Line { along: (*v - far).normalize(), width: near / lean },
                    _ => Foremost::Area,
                }
            }
            Convex::Elliptic(_) | Convex::Superellipsoid(_) | Convex::HalfSpace | Convex::Other => Foremost::Area,
        }
    }

    /// Normals of its sides where it stands with these axes, towards what lies along `way`: one of them mostly keeps apart
    /// what is near. Zero where there is none.
    pub fn sides(&self, [x, y, z]: [DVec3; 3], way: DVec3) -> [DVec3; 3] {
        match self {
            Convex::Cuboid(_) => [x, y, z],
            Convex::Round { .. } => [z, (way - z * way.dot(z)).normalize_or_zero(), DVec3::ZERO],
            Convex::Capsule { .. } => [(way - z * way.dot(z)).normalize_or_zero(), DVec3::ZERO, DVec3::ZERO],
            Convex::Ball(_)
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => [DVec3::ZERO; 3],
        }
    }

    /// The discs about z whose hull it is, in its own frame, or the balls; `None` for what is not such a hull. Of a
    /// cuboid and of corners these are points.
    pub fn discs(&self) -> Option<Discs> {
        Some(match self {
            Convex::Ball(radius) => SmallVec::from_slice(&[(DVec3::ZERO, *radius)]),
            Convex::Round { bottom, top, half } => {
                SmallVec::from_slice(&[(DVec3::Z * -half, *bottom), (DVec3::Z * *half, *top)])
            }
            Convex::Capsule { half, radius } => {
                SmallVec::from_slice(&[(DVec3::Z * -*half, *radius), (DVec3::Z * *half, *radius)])
            }
            Convex::Cuboid(half) => {
                let corner = |k: usize| {
                    let sign = |bit: usize| if k & bit == 0 { -1.0 } else { 1.0 };
                    (*half * DVec3::new(sign(1), sign(2), sign(4)), 0.0)
                };
                (0..8).map(corner).collect()
            }
            Convex::Corners(corners) => corners.iter().map(|v| (*v, 0.0)).collect(),
            Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::HalfSpace
            | Convex::Other => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn what_is_foremost_holds_all_that_is_as_near() {
        let mut r = Random(0x0066_6f72_656d_6f73);
        let mut lines = 0;
        for i in 0..600 {
            let mut length = || r.within(0.15, 0.9);
            let shape = match i % 4 {
                0 => Convex::Round { bottom: length(), top: length(), half: length() },
                1 => Convex::Round { bottom: length(), top: 0.0, half: length() },
                2 => Convex::Capsule { half: length(), radius: length() },
                _ => Convex::Cuboid(DVec3::new(length(), length(), length())),
            };
            let near = 10f64.powf(r.within(-7.0, -2.0));
            let (depth, lean) = (8.0 * near, 2.0 * near.sqrt());
            // Any direction, along an axis, across one, or nearly so.
            let along = DVec3::AXES[i / 4 % 3];
            let any = r.vector(1.0);
            let n = match i / 12 % 4 {
                0 => any,
                1 => along,
                2 => any - along * any.dot(along),
                _ => any - along * any.dot(along) * (1.0 - 10f64.powf(r.within(-8.0, -1.0))),
            };
            let n = n.normalize_or(DVec3::Z);
            let told = shape.foremost(n, near, depth, lean);
            let (along, width) = match told {
                Foremost::Line { along, width } => (along, width),
                // A rim that nearly lies in the plane is near it along a fifth of its radius.
                Foremost::Point => (DVec3::ZERO, 0.25f64.max(8.0 * near.sqrt())),
                Foremost::Area => continue,
            };
            lines += usize::from(told != Foremost::Point);
            let discs = shape.discs().expect("a hull of discs");
            let is_flat = matches!(shape, Convex::Round { .. });
            let towards = |d: DVec3| if is_flat { d.truncate().normalize_or_zero().extend(0.0) } else { d };
            let ends = discs.iter().map(|(center, radius)| *center + towards(n) * *radius);
            let far = ends.max_by(|v, w| n.dot(*v).total_cmp(&n.dot(*w))).expect("a disc");
            // Points between those of its discs that are farthest along n and along directions beside it.
            for k in 0..400 {
                let spread = 10f64.powf(r.within(-5.0, 0.0));
                let beside = |r: &mut Random| (n + r.vector(spread)).normalize_or(n);
                let (mut x, mut all) = (DVec3::ZERO, 0.0);
                let together = beside(&mut r);
                for (center, radius) in &discs {
                    // On the surface, all of them on one side of what is farthest; or anywhere.
                    let (d, part) = if k % 2 == 0 { (together, 1.0) } else { (beside(&mut r), r.unit().powf(spread)) };
                    let weight = r.unit().powi(4);
                    x += (*center + towards(d) * *radius * part) * weight;
                    all += weight;
                }
                x /= all;
                if n.dot(far - x) <= near {
                    let off = if told == Foremost::Point { x.distance(far) } else { (x - far).cross(along).length() };
                    assert!(off <= width * (1.0 + 1e-9) + near, "{i}: {off:e}, {told:?} {n}");
                }
            }
        }
        assert!(lines > 100, "{lines}");
    }
}
