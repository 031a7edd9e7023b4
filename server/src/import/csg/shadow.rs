//! `projection`: the shadow of solids on the plane z = 0, or what that plane cuts of them.
//!
//! The shadow of a union is that of its operands, and that of a convex solid the hull of what its elements cast: points and circles
//! where discs lie flat or stand upright. A section goes through set operations as it is: that of a ball and of an upright cylinder
//! is a circle, that of a polyhedron a polygon. Anything else is taken as a mesh (`meshed`).

use super::convex::{elements, pieces};
use super::element::Element;
use super::flat::{Flat, Outline};
use super::hull::Disc;
use super::meshed::Meshed;
use super::outlines::{flat, hull_parts};
use super::parts::{Part, PartId, Parts};
use super::polygon::convex_hull;
use super::{Place, Problem};
use crate::math::Aabb;
use crate::solid::primitive::{Capsule, Cylinder, Sphere};
use crate::solid::{Op, Shape};
use contactd_proto::Pose;
use glam::{DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Lengths that differ by less than this, relative to the size at hand, are one.
const SAME: f64 = 1e-9;
/// How far the section of a half-space reaches, in sizes of what it cuts.
const FAR: f64 = 4.0;
/// Corners of a convex solid up to which all pairs are looked at.
const FEW: usize = 400;

/// The shadow of some solids, as flat parts like `like`.
///
/// # Errors
/// Whatever a mesh of them fails for.
pub fn shadow(parts: &mut Parts<'_>, at: Place, like: &Flat, roots: &[PartId]) -> Result<Part> {
    let of_root = |parts: &Parts<'_>, root: &PartId| -> Option<Vec<Vec<Disc>>> {
        let cast = |piece: &Vec<Element>| {
            let each: Option<Vec<Vec<Disc>>> = piece.iter().map(Element::shadow).collect();
            each.map(|all| all.concat())
        };
        pieces(parts, *root)?.iter().map(cast).collect()
    };
    let exact: Option<Vec<Vec<Vec<Disc>>>> = roots.iter().map(|r| of_root(parts, r)).collect();
    if let Some(all) = exact {
        let mut made = Vec::new();
        for discs in all.into_iter().flatten() {
            made.extend(hull_parts(parts, like, &discs));
        }
        return Ok(Part::Op(Op::Union, at, made));
    }
    let whole = parts.push(Part::Op(Op::Union, at, roots.to_vec()));
    let mesh = Meshed::of(parts, at, whole)?;
    let paths = mesh.shadow(at)?;
    Ok(of_paths(parts, at, like, paths, mesh.off, "the shadow of projection"))
}

fn of_paths(parts: &mut Parts<'_>, at: Place, like: &Flat, paths: Vec<Vec<DVec2>>, off: f64, what: &str) -> Part {
    if paths.is_empty() {
        return Part::Empty;
    }
    if off > 0.0 {
        parts.faceted(at, what, paths.iter().map(Vec::len).sum(), off);
    }
    flat(like, Outline::Paths(paths), DVec2::ZERO)
}

/// What the plane z = 0 cuts of some solids, faces in it with it, whichever side the solid is on, as flat parts like `like`.
///
/// # Errors
/// Whatever a mesh of a primitive fails for.
pub fn section(parts: &mut Parts<'_>, at: Place, like: &Flat, roots: &[PartId]) -> Result<Part> {
    let mut around = Aabb::EMPTY;
    let mut stack = roots.to_vec();
    while let Some(p) = stack.pop() {
        match &parts.list[p] {
            Part::Leaf(shape, frame, _) => {
                let b = shape.geometry().aabb(frame);
                around = if b.is_finite() { around.union(&b) } else { around };
            }
            Part::Op(_, _, of) => stack.extend(of),
            Part::Empty | Part::Flat(_) | Part::Stray(..) => {}
        }
    }
    let size = if around.is_empty() { 1.0 } else { around.half().length() };
    let cut = Cut { at, size, around };
    let made = roots.iter().map(|r| cut.part(parts, *r, like)).collect::<Result<Vec<_>>>()?;
    Ok(Part::Op(Op::Union, at, made))
}

/// A section in the making.
struct Cut {
    at: Place,
    size: f64,
    around: Aabb,
}

impl Cut {
    fn part(&self, parts: &mut Parts<'_>, p: PartId, like: &Flat) -> Result<PartId> {
        let made = match &parts.list[p] {
            Part::Empty | Part::Flat(_) | Part::Stray(..) => Part::Empty,
            Part::Op(op, at, of) => {
                let (op, at, of) = (*op, *at, of.clone());
                let mut all = Vec::with_capacity(of.len());
                for (i, operand) in of.into_iter().enumerate() {
                    let taken = op == Op::Difference && i > 0;
                    let like = Flat { overshoot: like.overshoot + u32::from(taken), ..like.clone() };
                    all.push(self.part(parts, operand, &like)?);
                }
                Part::Op(op, at, all)
            }
            // As its parts, of which some may be told by outlines.
            Part::Leaf(Shape::Capsule(c), frame, label) => {
                let (Capsule { half, radius }, frame, label) = (c.clone(), *frame, label.clone());
                let pieces = parts.pieces.get(&p).copied();
                let mut leaf = |shape: Shape, z: f64| {
                    let own = parts.push(Part::Leaf(
                        shape,
                        Pose::new(frame.point(DVec3::Z * z), frame.rotation),
                        label.clone(),
                    ));
                    parts.pieces.extend(pieces.map(|n| (own, n)));
                    own
                };
                let tube = leaf(Cylinder { radius, half_height: half }.into(), 0.0);
                let ends = [half, -half].map(|z| leaf(Sphere { radius }.into(), z));
                let all = parts.push(Part::Op(Op::Union, self.at, vec![tube, ends[0], ends[1]]));
                return self.part(parts, all, like);
            }
            Part::Leaf(shape, frame, _) => {
                let (shape, frame) = (shape.clone(), *frame);
                let pieces = parts.pieces.get(&p).copied().unwrap_or(super::convex::PIECES);
                let like = Flat { pieces, ..like.clone() };
                match self.leaf(&shape, &frame) {
                    Some(Some((outline, center))) => flat(&like, outline, center),
                    Some(None) => Part::Empty,
                    None => {
                        let mesh = Meshed::of(parts, self.at, p)?;
                        let paths = mesh.section(self.at)?;
                        of_paths(parts, self.at, &like, paths, mesh.off, "a section of projection")
                    }
                }
            }
        };
        Ok(parts.push(made))
    }

    /// The section of a primitive, and about which point; `None` inside for none, `None` for one that no outline tells.
    fn leaf(&self, shape: &Shape, frame: &Pose) -> Option<Option<(Outline, DVec2)>> {
        let middle = frame.position;
        let circle = |radius: f64| (radius > SAME * self.size).then(|| (Outline::Circle(radius), middle.truncate()));
        let upright = |half: f64, bottom: f64, top: f64| {
            let axis = frame.vector(DVec3::Z);
            if axis.truncate().length() > SAME {
                return None;
            }
            let [low, high] = [self.level(middle.z - half), self.level(middle.z + half)];
            let (bottom, top) = if axis.z > 0.0 { (bottom, top) } else { (top, bottom) };
            let radius = bottom + (top - bottom) * (-low / (high - low));
            Some(if low <= 0.0 && high >= 0.0 { circle(radius) } else { None })
        };
        match shape {
            Shape::Sphere(s) => Some(circle((s.radius * s.radius - middle.z * middle.z).max(0.0).sqrt())),
            Shape::Cylinder(c) => upright(c.half_height, c.radius, c.radius),
            Shape::Cone(c) => upright(c.half_height, c.bottom, c.top),
            Shape::Cuboid(_) | Shape::Polyhedron(_) => {
                let corners: Vec<DVec3> = elements(shape, frame, 0)?.iter().map(|e| e.center()).collect();
                if corners.len() > FEW { None } else { Some(self.polygon(&corners)) }
            }
            Shape::HalfSpace(_) => Some(self.half_plane(frame)),
            Shape::TriangleMesh(_)
            | Shape::Torus(_)
            | Shape::Ellipsoid(_)
            | Shape::EllipticFrustum(_)
            | Shape::Superellipsoid(_)
            | Shape::Capsule(_)
            | Shape::Quadric(_) => None,
        }
    }

    /// A height, 0 where it is that but for rounding.
    fn level(&self, z: f64) -> f64 {
        if z.abs() <= SAME * self.size { 0.0 } else { z }
    }

    /// The section of the hull of points: that of all ways between two of them.
    fn polygon(&self, corners: &[DVec3]) -> Option<(Outline, DVec2)> {
        let corners: Vec<DVec3> = corners.iter().map(|c| c.with_z(self.level(c.z))).collect();
        let mut points: Vec<DVec2> = corners.iter().filter(|c| c.z == 0.0).map(|c| c.truncate()).collect();
        for a in corners.iter().filter(|c| c.z < 0.0) {
            for b in corners.iter().filter(|c| c.z > 0.0) {
                points.push((*a + (*b - *a) * (a.z / (a.z - b.z))).truncate());
            }
        }
        let hull = convex_hull(&points);
        (hull.len() >= 3).then_some((Outline::Paths(vec![hull]), DVec2::ZERO))
    }

    fn half_plane(&self, frame: &Pose) -> Option<(Outline, DVec2)> {
        let n = frame.vector(DVec3::Z);
        let far = FAR * self.size;
        let middle = if self.around.is_empty() { DVec2::ZERO } else { self.around.center().truncate() };
        let across = n.truncate();
        if across.length() <= SAME {
            let z = self.level(frame.position.z);
            let here = if n.z > 0.0 { z >= 0.0 } else { z <= 0.0 };
            let corners = [[-far, -far], [far, -far], [far, far], [-far, far]];
            return here.then(|| (Outline::Paths(vec![corners.map(DVec2::from_array).to_vec()]), middle));
        }
        let out = across.normalize();
        let reach = n.dot(frame.position) / across.length();
        let foot = middle + out * (reach - out.dot(middle));
        let (along, deep) = (out.perp() * far, out * (far + (reach - out.dot(middle)).abs()));
        Some((
            Outline::Paths(vec![vec![foot - along, foot - along - deep, foot + along - deep, foot + along]]),
            DVec2::ZERO,
        ))
    }
}
