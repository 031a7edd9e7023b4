//! A quadric cut by planes.

mod form;

pub use form::{Form, NoQuadric, Quadrics};

use super::{Checked, Convex, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::{Bowl, Elliptic, Plane, Saddle};
use contactd_proto::Pose;
use glam::{DMat3, DVec3};

/// What lies inside of a quadric's face and before some planes.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadric(Box<Cut>);

/// Its numbers: more than any other primitive has.
#[derive(Clone, Debug, PartialEq)]
struct Cut {
    /// An elliptic face, a bowl or a saddle.
    side: Face,
    /// The planes, each with its place among `NAMES`; around a saddle six, the sides of a parallelepiped in that order.
    planes: Vec<(u8, Plane)>,
    /// A box that holds it.
    around: Aabb,
    /// A point inside of it.
    inside: DVec3,
    /// How deep that lies, a length.
    depth: f64,
}

/// What the planes are called.
const NAMES: [&str; 6] = ["-x", "+x", "-y", "+y", "bottom", "top"];

/// Points of a box along an edge at which a quadric is looked at for its inside.
const LOOKS: u32 = 13;
/// Directions that are tried at a step.
const WAYS: u32 = 32;
/// By how much the step of the search around the deepest of them shrinks at most.
const FINEST: f64 = 1e-6;
/// Directions that are tried in all: what has been found until then is deep enough, or nothing.
const MOST: u32 = 1 << 17;

impl Quadric {
    /// The inside of an elliptic face, a bowl or a saddle before some planes, each with its number: −x, +x, −y, +y, bottom, top. `around`
    /// is a box that holds all of it. A saddle has all six planes, of a parallelepiped. `None` where nothing is found inside.
    pub fn new(side: Face, planes: Vec<(u8, Plane)>, around: Aabb) -> Option<Self> {
        let value =
            |x: DVec3| planes.iter().fold(side.value(x), |m, (_, plane)| m.max(plane.normal.dot(x) - plane.offset));
        let (mut best, mut least) = (around.center(), f64::INFINITY);
        let mut look = |x: DVec3, best: &mut DVec3| {
            let v = value(x);
            let is_lower = v < least;
            if is_lower {
                (*best, least) = (x, v);
            }
            is_lower
        };
        let step = (around.max - around.min) / f64::from(LOOKS);
        for i in 0..LOOKS * LOOKS * LOOKS {
            let at = DVec3::new(f64::from(i % LOOKS), f64::from(i / LOOKS % LOOKS), f64::from(i / LOOKS / LOOKS));
            look(around.min + step * (at + 0.5), &mut best);
        }
        // f has ridges, along which few directions lead down: ever others are tried.
        let (mut by, mut turn) = (1.0, 0u32);
        while by > FINEST && turn < MOST {
            let center = best;
            // Within the box: towards a piece that lies beyond it f falls as long as one likes to follow.
            let next = |k: u32| (center + way(turn + k) * step * by).clamp(around.min, around.max);
            let lower = (0..WAYS).filter(|k| look(next(*k), &mut best)).count();
            turn += WAYS;
            if lower == 0 {
                by *= 0.5;
            }
        }
        let size = around.half().length();
        (least < -FINEST * FINEST * size)
            .then(|| Self(Box::new(Cut { side, planes, around, inside: best, depth: -least })))
    }

    /// The quadric's face, in its frame.
    pub fn side(&self) -> &Face {
        &self.0.side
    }

    /// The box that was said to hold it, in its frame.
    pub fn around(&self) -> Aabb {
        self.0.around
    }

    /// The planes that cut it, with their numbers, in its frame.
    pub fn planes(&self) -> &[(u8, Plane)] {
        &self.0.planes
    }

    /// The corners of the six planes' parallelepiped, and by how much more than the planes it grows where they go out.
    fn cage(&self) -> Option<([DVec3; 8], f64)> {
        let [(_, a), (_, b), (_, c), (_, d), (_, e), (_, f)] = self.0.planes.as_slice() else { return None };
        let back = DMat3::from_cols(b.normal, d.normal, f.normal).transpose().inverse();
        let at = |k: usize| {
            let side =
                |bit: usize, low: &Plane, high: &Plane| if k >> bit & 1 == 0 { -low.offset } else { high.offset };
            back * DVec3::new(side(0, a, b), side(1, c, d), side(2, e, f))
        };
        let spread = (back.x_axis.abs() + back.y_axis.abs() + back.z_axis.abs()).max_element();
        Some((std::array::from_fn(at), spread))
    }
}

/// A sequence of directions that keep apart: turned by the golden angle about z, at heights that a van der Corput sequence gives.
fn way(k: u32) -> DVec3 {
    let z = f64::from(k.reverse_bits()) / f64::from(u32::MAX) * 2.0 - 1.0;
    let (sin, cos) = libm::sincos(f64::from(k) * 2.399_963_229_728_653);
    let rho = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    DVec3::new(rho * cos, rho * sin, z)
}

impl Geometry for Quadric {
    fn faces(&self) -> Vec<Face> {
        std::iter::once(self.0.side).chain(self.0.planes.iter().map(|(_, plane)| (*plane).into())).collect()
    }
    fn domain(&self) -> Option<Aabb> {
        if self.0.side.is_convex() {
            return None;
        }
        self.cage().map(|(corners, _)| Aabb::of_points(corners))
    }
    fn spread(&self) -> f64 {
        self.cage().map_or(1.0, |(_, spread)| spread)
    }
    fn face_name(&self, index: usize) -> String {
        let plane = index.checked_sub(1).and_then(|k| self.0.planes.get(k));
        plane.and_then(|(name, _)| NAMES.get(usize::from(*name))).map_or("surface", |name| *name).into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::of_points(self.0.around.corners().map(|c| frame.point(c)))
    }
    fn ball(&self) -> Ball {
        Ball::new(self.0.around.center(), self.0.around.half().length())
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.0.depth
    }
    fn interior_point(&self) -> DVec3 {
        self.0.inside
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Other
    }
    fn moments(&self) -> Option<Moments> {
        None
    }
    fn grown(&self, _: f64) -> Option<Shape> {
        None
    }
    fn kind(&self) -> &'static str {
        self.0.side.quadric_name()
    }
    fn dimensions(&self) -> String {
        let size = self.0.around.max - self.0.around.min;
        format!("cut by {} planes, within {} × {} × {}", self.0.planes.len(), size.x, size.y, size.z)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.word(self.0.side.rank() as usize);
        self.0.side.numbers().into_iter().for_each(|x| out.number(x));
        out.word(self.0.planes.len());
        for (name, plane) in &self.0.planes {
            out.word(usize::from(*name));
            write_vector(out, plane.normal);
            out.number(plane.offset);
        }
        [self.0.around.min, self.0.around.max, self.0.inside].into_iter().for_each(|v| write_vector(out, v));
        out.number(self.0.depth);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        const WRONG: &str = "a quadric cut by planes";
        let rank = from.word()?;
        let (origin, turn) = (read_vector(from)?, read_vector(from)?);
        let [a, b, c, d, e] = [from.finite()?, from.finite()?, from.finite()?, from.finite()?, from.finite()?];
        let of = |face: Face| (face.rank() == rank).then_some(face);
        let elliptic = Elliptic { origin, turn, size: a, second: b, third: c };
        let bowl = Bowl { origin, turn, scale: DVec3::new(a, b, c), fall: d, radius: e };
        let saddle = Saddle { origin, turn, first: a, second: b, third: c, size: d };
        let side = of(elliptic.into()).or(of(bowl.into())).or(of(saddle.into())).ok_or(WRONG)?;
        let mut planes = Vec::new();
        for _ in 0..from.word()?.min(NAMES.len() as u32) {
            let name = from.word()?.min(NAMES.len() as u32 - 1) as u8;
            planes.push((name, Plane { normal: read_vector(from)?, offset: from.finite()? }));
        }
        let around = Aabb { min: read_vector(from)?, max: read_vector(from)? };
        let cut = Cut { side, planes, around, inside: read_vector(from)?, depth: from.finite()? };
        let read = Self(Box::new(cut));
        let units = read.0.planes.iter().all(|(_, p)| (p.normal.length() - 1.0).abs() < 1e-9);
        let sized =
            [a, b, c, d].iter().all(|x| x.abs() <= 1e300) && a > 0.0 && !around.is_empty() && read.0.depth > 0.0;
        let bounded = read.0.side.is_convex() || read.0.planes.len() == NAMES.len();
        if units && sized && bounded { Ok(read) } else { Err(WRONG) }
    }
}
