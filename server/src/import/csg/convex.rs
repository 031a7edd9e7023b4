//! Hulls and sums of solids, from the faces that there are.
//!
//! A convex primitive is the hull of balls, discs and points (balls of radius 0); so is a hull of some, and so is the sum of two,
//! whose elements are the sums of theirs. Of such elements a hull is exact where they are points, or balls and points, or where
//! all is symmetric about one axis, or where all lies on two planes square to one axis in the same way. Any other is taken as
//! OpenSCAD has it, with every curve in the pieces that its text asks for, and a note tells how many facets and how far off.

use super::element::{Element, SAME, sagitta};
use super::facets::{faceted_sphere, prism, ring};
use super::hull::{Disc, DiscHull, ball_hull, corners_of, disc_hull, point_hull};
use super::parts::{Part, PartId, Parts};
use super::place;
use super::polygon::{Region, convex_hull};
use super::revolve::Lathe;
use super::{Place, Problem};
use crate::math::{Aabb, any_perpendicular};
use crate::solid::{Face, Op, Shape};
use contactd_proto::Pose;
use glam::{DAffine3, DMat3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Balls up to which their hull is looked for; its cost grows with the third power.
const MOST_BALLS: usize = 150;
/// Pieces of a curve that no call stands for, such as one of a hull: OpenSCAD's own of a large circle.
pub const PIECES: u32 = 30;

/// What a primitive is the hull of; `None` for what has no bounds. Of a mesh or a torus: what its hull is the hull of.
pub fn elements(shape: &Shape, frame: &Pose, pieces: u32) -> Option<Vec<Element>> {
    let axes = frame.matrix();
    let disc = |z: f64, radius: f64| Element {
        center: frame.point(DVec3::Z * z),
        radius,
        axes: (radius > 0.0).then_some(axes),
        round: 0.0,
        pieces,
        off: 0.0,
    };
    let corners = |all: &[DVec3]| Some(all.iter().map(|v| Element::point(frame.point(*v))).collect());
    match shape {
        Shape::Sphere(s) => {
            Some(vec![Element { center: frame.position, radius: s.radius, axes: None, round: 0.0, pieces, off: 0.0 }])
        }
        Shape::Cylinder(c) => Some(vec![disc(-c.half_height, c.radius), disc(c.half_height, c.radius)]),
        Shape::Cone(c) => Some(vec![disc(-c.half_height, c.bottom), disc(c.half_height, c.top)]),
        Shape::Cuboid(c) => corners(&Aabb::around(DVec3::ZERO, c.half).corners()),
        Shape::Polyhedron(p) => corners(&p.vertices),
        Shape::TriangleMesh(m) => corners(m.vertices()),
        Shape::Torus(t) => {
            let (center, axes) = (frame.position, Some(axes));
            Some(vec![Element { center, radius: t.major, axes, round: t.minor, pieces, off: 0.0 }])
        }
        Shape::Capsule(c) => {
            let ball = |z: f64| Element {
                center: frame.point(DVec3::Z * z),
                radius: c.radius,
                axes: None,
                round: 0.0,
                pieces,
                off: 0.0,
            };
            Some(vec![ball(-c.half), ball(c.half)])
        }
        // No element is an ellipse: as many points as OpenSCAD has.
        Shape::Ellipsoid(e) => {
            let points = faceted_sphere(1.0, pieces, pieces.div_ceil(2)).0;
            let off = e.semi.max_element() * sagitta(pieces);
            Some(points.into_iter().map(|p| Element::facet(frame.point(p * e.semi), off)).collect())
        }
        Shape::Superellipsoid(s) => {
            let (points, off) = s.tessellated(pieces);
            Some(points.into_iter().map(|p| Element::facet(frame.point(p), off)).collect())
        }
        Shape::EllipticFrustum(c) => {
            let off = c.semi.max_element() * sagitta(pieces);
            let rim = |(z, size): (f64, f64)| {
                let middle = (c.lean * z).extend(z);
                let points = if size > 0.0 { ring(size, pieces) } else { vec![DVec2::ZERO] };
                points.into_iter().map(move |p| Element::facet(frame.point(middle + (p * c.semi).extend(0.0)), off))
            };
            Some([(-c.half_height, c.bottom), (c.half_height, c.top)].into_iter().flat_map(rim).collect())
        }
        Shape::HalfSpace(_) | Shape::Quadric(_) => None,
    }
}

/// The pieces of a union of convex solids, as what each is the hull of; `None` where it is no such union.
pub fn pieces(parts: &Parts<'_>, root: PartId) -> Option<Vec<Vec<Element>>> {
    let (leaves, false) = parts.leaves(root)? else { return None };
    let bulges = |shape: &Shape| shape.geometry().faces().iter().all(Face::is_convex);
    let hollow = |shape: &Shape| shape.formula().is_some() || !bulges(shape);
    let convex = |p: &PartId| !matches!(&parts.list[*p], Part::Leaf(shape, ..) if hollow(shape));
    leaves.iter().map(|p| if convex(p) { of_leaf(parts, *p) } else { None }).collect()
}

fn of_leaf(parts: &Parts<'_>, p: PartId) -> Option<Vec<Element>> {
    if let Some((points, off)) = parts.bent.get(&p) {
        return Some(points.iter().map(|x| Element::facet(*x, *off)).collect());
    }
    match &parts.list[p] {
        Part::Leaf(shape, frame, _) => elements(shape, frame, parts.pieces.get(&p).copied().unwrap_or(PIECES)),
        Part::Empty => Some(parts.points.get(&p).cloned().unwrap_or_default()),
        Part::Flat(_) | Part::Stray(..) | Part::Op(..) => Some(Vec::new()),
    }
}

/// Elements with the hull of a part; `None` where a difference takes something from one of them, and for what is cut in another
/// way. An extruded island counts as its hull: pockets and holes take no corner away.
pub fn extremes(parts: &Parts<'_>, root: PartId) -> Option<Vec<Element>> {
    if let Some(hull) = parts.hulls.get(&root) {
        return extremes(parts, *hull);
    }
    match &parts.list[root] {
        Part::Leaf(..) | Part::Empty | Part::Flat(_) | Part::Stray(..) => of_leaf(parts, root),
        Part::Op(Op::Union, _, of) => {
            let each: Option<Vec<Vec<Element>>> = of.iter().map(|p| extremes(parts, *p)).collect();
            each.map(|all| all.into_iter().flatten().collect())
        }
        Part::Op(Op::Intersection, _, of) if of.len() == 1 => extremes(parts, of[0]),
        Part::Op(Op::Intersection, ..) => None,
        Part::Op(Op::Difference, _, of) => {
            let (first, rest) = of.split_first()?;
            let all = extremes(parts, *first)?;
            let kept = all.iter().all(|e| rest.iter().all(|cut| is_clear_of(e, parts, *cut)));
            kept.then_some(all)
        }
    }
}

/// True when a part is proven not to touch an element where it is extreme: f of the part changes by no more than the way, and no
/// place on a disc's rim or a ball is farther from one of the points looked at than they are from each other.
fn is_clear_of(element: &Element, parts: &Parts<'_>, cut: PartId) -> bool {
    const ROUND: u32 = 96;
    if element.radius == 0.0 {
        return clearance(parts, cut, element.center) > 0.0;
    }
    let step = (element.radius + element.round) * std::f64::consts::TAU / f64::from(ROUND);
    let dense = Element { pieces: ROUND, ..*element };
    dense.facets().into_iter().all(|p| clearance(parts, cut, p) > step)
}

/// Lower bound of the distance of a point from a part, negative where that may hold it: primitives' f, which is never more.
fn clearance(parts: &Parts<'_>, root: PartId, x: DVec3) -> f64 {
    match &parts.list[root] {
        Part::Leaf(shape, frame, _) => {
            let local = frame.rotation.inverse() * (x - frame.position);
            let faces = shape.geometry().faces();
            match shape.formula() {
                Some(formula) => formula.value(&mut |f| faces[f as usize].value(local)),
                None => faces.iter().fold(f64::NEG_INFINITY, |m, f| m.max(f.value(local))),
            }
        }
        Part::Empty | Part::Flat(_) | Part::Stray(..) => f64::INFINITY,
        Part::Op(Op::Union, _, of) => of.iter().map(|p| clearance(parts, *p, x)).fold(f64::INFINITY, f64::min),
        Part::Op(Op::Intersection, _, of) => {
            of.iter().map(|p| clearance(parts, *p, x)).fold(f64::NEG_INFINITY, f64::max)
        }
        // What is taken from it is let be: more is held, the distance is less.
        Part::Op(Op::Difference, _, of) => of.first().map_or(f64::INFINITY, |p| clearance(parts, *p, x)),
    }
}

/// The hull of elements, from the call `name`; nothing where it has no volume.
pub fn hull(parts: &mut Parts<'_>, name: &str, at: Place, elements: &[Element]) -> Result<Part> {
    let around = Aabb::of_points(elements.iter().map(|e| e.center));
    let reach = elements.iter().map(|e| e.radius + e.round).fold(0.0, f64::max);
    let size = around.half().length() + reach;
    let hull = Hull { name, at };
    let discs: Vec<&Element> = elements.iter().filter(|e| e.axes.is_some()).collect();
    let exact = if elements.iter().any(|e| e.off > 0.0) {
        None
    } else if let Some(axes) = discs.first().and_then(|d| d.axes) {
        let parallel = discs.iter().all(|d| d.axes.is_some_and(|a| a.z_axis.cross(axes.z_axis).length() <= SAME));
        if !parallel {
            None
        } else if let Some(profile) = coaxial(elements, discs[0].center, axes.z_axis, size) {
            Some(hull.revolved(parts, discs[0].center, axes.z_axis, &profile)?)
        } else {
            match prismatic(elements, discs[0].center, axes, size) {
                Some((outline, heights)) => {
                    let frame = DAffine3 { matrix3: axes, translation: discs[0].center };
                    Some(hull.prism(parts, &frame, outline, heights)?)
                }
                None => None,
            }
        }
    } else if reach == 0.0 {
        let points: Vec<DVec3> = elements.iter().map(|e| e.center).collect();
        Some(hull.polyhedron(parts, &points)?)
    } else {
        hull.balls(parts, elements)?
    };
    match exact {
        Some(part) => Ok(part),
        None => hull.faceted(parts, elements),
    }
}

/// The sum of solids that are each a union of convex ones, as the pieces of all; a note where curves have no sum of a kind.
pub fn sums(parts: &mut Parts<'_>, at: Place, operands: &[Vec<Vec<Element>>]) -> Result<Vec<Vec<Element>>> {
    let mut sums = vec![vec![Element::point(DVec3::ZERO)]];
    let mut off: Option<f64> = None;
    for pieces in operands {
        let mut next = Vec::with_capacity(sums.len() * pieces.len());
        for sum in &sums {
            for piece in pieces {
                let pairs = || sum.iter().flat_map(|a| piece.iter().map(move |b| (a, b)));
                let exact: Option<Vec<Element>> = pairs().map(|(a, b)| a.plus(b)).collect();
                let most = exact.iter().flatten().map(|e| e.off).fold(0.0, f64::max);
                off = if most > 0.0 { Some(off.unwrap_or(0.0).max(most)) } else { off };
                let of_points = || {
                    let points = |e: &[Element]| e.iter().flat_map(Element::facets).collect::<Vec<DVec3>>();
                    let (a, b) = (points(sum), points(piece));
                    a.iter().flat_map(|p| b.iter().map(|q| Element::point(*p + *q))).collect()
                };
                next.push(exact.unwrap_or_else(|| {
                    let most = |e: &[Element]| e.iter().map(Element::deviation).fold(0.0, f64::max);
                    off = Some(off.unwrap_or(0.0).max(most(sum) + most(piece)));
                    of_points()
                }));
            }
        }
        sums = next;
        parts.affordable(at, sums.iter().map(Vec::len).sum::<usize>() / 64)?;
    }
    if let Some(off) = off {
        let points: usize = sums.iter().map(Vec::len).sum();
        parts.note(at, format!("minkowski: faceted, {points} points, max deviation {off:.1e}"), None);
    }
    Ok(sums)
}

/// A hull in the making.
struct Hull<'n> {
    name: &'n str,
    at: Place,
}

impl Hull<'_> {
    fn polyhedron(&self, parts: &mut Parts<'_>, points: &[DVec3]) -> Result<Part> {
        let Some(faces) = point_hull(points) else { return Ok(Part::Empty) };
        parts.hullable(self.at, faces.len())?;
        let faces: Vec<Vec<u32>> = faces.iter().map(|f| f.iter().rev().map(|i| *i as u32).collect()).collect();
        match place::polyhedron(&DAffine3::IDENTITY, points, &faces) {
            Err(Problem::Mesh(crate::solid::primitive::MeshError::Flat)) => Ok(Part::Empty),
            placed => parts.leaf(self.name, self.at, placed.map(|p| p.0)),
        }
    }

    /// With every curve in pieces.
    fn faceted(&self, parts: &mut Parts<'_>, elements: &[Element]) -> Result<Part> {
        let points: Vec<DVec3> = elements.iter().flat_map(Element::facets).collect();
        let name = format!("faceted {}", self.name);
        let part = Hull { name: &name, at: self.at }.polyhedron(parts, &points)?;
        let off = elements.iter().map(Element::deviation).fold(0.0, f64::max);
        if let Part::Leaf(shape, ..) = &part {
            let count = shape.geometry().faces().len();
            parts.faceted(self.at, self.name, count, off);
        }
        Ok(part)
    }

    /// Balls and points; `None` for more than are looked through.
    fn balls(&self, parts: &mut Parts<'_>, elements: &[Element]) -> Result<Option<Part>> {
        let balls = outermost(elements);
        if balls.len() > MOST_BALLS {
            return Ok(None);
        }
        let hull = ball_hull(&balls);
        let mut made = Vec::new();
        let mut add = |parts: &mut Parts<'_>, placed| -> Result<()> {
            let leaf = parts.leaf(self.name, self.at, placed)?;
            made.push(parts.push(leaf));
            Ok(())
        };
        // Of two balls of one size: all within it of the way between them.
        if let [(i, j)] = hull.edges[..]
            && balls[i].1 == balls[j].1
        {
            return parts.leaf(self.name, self.at, Ok(place::capsule(balls[i].0, balls[j].0, balls[i].1))).map(Some);
        }
        for &i in &hull.balls {
            let (center, radius) = balls[i];
            add(parts, place::sphere(&DAffine3::from_translation(center), radius))?;
        }
        for &(i, j) in &hull.edges {
            let (a, b) = (balls[i], balls[j]);
            let apart = b.0.distance(a.0);
            let e = (b.0 - a.0) / apart;
            // Where a plane along both touches them: as far along the axis, and as far from it, as the slope says.
            let k = (a.1 - b.1) / apart;
            let s = ((1.0 - k) * (1.0 + k)).sqrt();
            let frame = frame_along(a.0, e);
            let (low, high) = (a.1 * k, apart + b.1 * k);
            let middle = DVec3::Z * (0.5 * (low + high));
            add(parts, place::cylinder(&frame, middle, a.1 * s, b.1 * s, high - low))?;
        }
        if point_hull(&hull.corners).is_some() {
            let inner = self.polyhedron(parts, &hull.corners)?;
            made.push(parts.push(inner));
        }
        Ok(Some(Part::Op(Op::Union, self.at, made)))
    }

    /// Symmetric about an axis: the meridian's hull, revolved.
    fn revolved(&self, parts: &mut Parts<'_>, origin: DVec3, axis: DVec3, profile: &[Disc]) -> Result<Part> {
        let hull = disc_hull(profile);
        let outer = frame_along(origin, axis);
        let lathe = Lathe { name: self.name, at: self.at, outer: &outer, sides: Vec::new() };
        let mut made = Vec::new();
        if hull.corners.len() >= 3 {
            let part = lathe.region(parts, &Region::of_paths(&[symmetric(&hull.corners)]))?;
            made.push(parts.push(part));
        }
        let far = profile.iter().fold(0.0, |m: f64, d| m.max(d.center.abs().max_element() + d.radius));
        for d in hull.discs.into_iter().filter(|d| d.center.x >= -SAME * far) {
            let center = outer * DAffine3::from_translation(DVec3::Z * d.center.y);
            let placed = if d.center.x > SAME * far {
                place::torus(&center, d.center.x, d.radius)
            } else {
                place::sphere(&center, d.radius)
            };
            let leaf = parts.leaf(self.name, self.at, placed)?;
            made.push(parts.push(leaf));
        }
        Ok(Part::Op(Op::Union, self.at, made))
    }

    /// The same hull of discs between two heights of a frame.
    fn prism(&self, parts: &mut Parts<'_>, frame: &DAffine3, hull: DiscHull, (low, high): (f64, f64)) -> Result<Part> {
        let mut made = Vec::new();
        if hull.corners.len() >= 3 {
            parts.affordable(self.at, hull.corners.len() + 2)?;
            let (points, faces) = prism(&hull.corners, &hull.corners, low, high);
            let leaf = parts.leaf(self.name, self.at, place::polyhedron(frame, &points, &faces).map(|p| p.0))?;
            made.push(parts.push(leaf));
        }
        for d in hull.discs {
            let center = d.center.extend(0.5 * (low + high));
            let leaf =
                parts.leaf(self.name, self.at, place::cylinder(frame, center, d.radius, d.radius, high - low))?;
            made.push(parts.push(leaf));
        }
        Ok(Part::Op(Op::Union, self.at, made))
    }
}

/// A frame with z along a direction.
fn frame_along(origin: DVec3, axis: DVec3) -> DAffine3 {
    let x = any_perpendicular(axis);
    DAffine3 { matrix3: DMat3::from_cols(x, axis.cross(x), axis), translation: origin }
}

/// Corners about x = 0, each pair of them as far out to the bit.
fn symmetric(corners: &[DVec2]) -> Vec<DVec2> {
    let far = corners.iter().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
    let right = corners.iter().filter(|p| p.x >= -SAME * far);
    let right = right.map(|p| if p.x <= SAME * far { p.with_x(0.0) } else { *p });
    convex_hull(&right.flat_map(|p| [p, p.with_x(-p.x)]).collect::<Vec<_>>())
}

/// Balls that no other one holds, and the corners of the points' hull.
fn outermost(elements: &[Element]) -> Vec<(DVec3, f64)> {
    let (points, balls): (Vec<&Element>, Vec<&Element>) = elements.iter().partition(|e| e.radius == 0.0);
    let points: Vec<DVec3> = points.into_iter().map(|e| e.center).collect();
    let mut balls: Vec<(DVec3, f64)> = balls.into_iter().map(|e| (e.center, e.radius)).collect();
    // Of equal radii only the corners of the centres' hull are on it.
    if balls.iter().all(|b| b.1 == balls[0].1) {
        let centers: Vec<DVec3> = balls.iter().map(|b| b.0).collect();
        let radius = balls[0].1;
        balls = corners_of(centers).into_iter().map(|c| (c, radius)).collect();
    }
    balls.extend(corners_of(points).into_iter().map(|p| (p, 0.0)));
    balls.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<(DVec3, f64)> = Vec::with_capacity(balls.len());
    for b in balls {
        if !kept.iter().any(|o| o.0.distance(b.0) <= (o.1 - b.1) + 1e-14 * o.1) {
            kept.push(b);
        }
    }
    kept
}

/// The meridian of elements that are symmetric about an axis, both sides of it.
fn coaxial(elements: &[Element], origin: DVec3, axis: DVec3, size: f64) -> Option<Vec<Disc>> {
    let mut profile = Vec::with_capacity(2 * elements.len());
    for e in elements {
        let o = e.center - origin;
        let z = o.dot(axis);
        if (o - axis * z).length() > SAME * size {
            return None;
        }
        match e.axes {
            Some(_) => {
                profile.extend([e.radius, -e.radius].map(|x| Disc { center: DVec2::new(x, z), radius: e.round }));
            }
            None => profile.push(Disc { center: DVec2::new(0.0, z), radius: e.radius }),
        }
    }
    Some(profile)
}

/// The hull of elements that lie on two planes square to an axis in the same way, with the planes' heights.
fn prismatic(elements: &[Element], origin: DVec3, axes: DMat3, size: f64) -> Option<(DiscHull, (f64, f64))> {
    // The lowest, the highest, and the lowest with all in between, which must not reach farther.
    let mut levels: [Vec<Disc>; 3] = Default::default();
    let height = |e: &Element| (e.center - origin).dot(axes.z_axis);
    let heights = elements.iter().map(height);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    for e in elements {
        if e.radius > 0.0 && e.axes.is_none() || e.round > 0.0 {
            return None;
        }
        let z = height(e);
        let o = e.center - origin;
        let disc = Disc { center: DVec2::new(o.dot(axes.x_axis), o.dot(axes.y_axis)), radius: e.radius };
        if (z - high).abs() <= SAME * size {
            levels[1].push(disc);
            continue;
        }
        if (z - low).abs() <= SAME * size {
            levels[0].push(disc);
        }
        levels[2].push(disc);
    }
    let hulls = levels.map(|level| disc_hull(&level));
    let like =
        |a: &Disc, b: &Disc| a.center.distance(b.center) <= SAME * size && (a.radius - b.radius).abs() <= SAME * size;
    let of = |hull: &DiscHull| {
        let points = hull.corners.iter().map(|center| Disc { center: *center, radius: 0.0 });
        hull.discs.iter().copied().chain(points).collect::<Vec<Disc>>()
    };
    let [bottom, top, all] = [of(&hulls[0]), of(&hulls[1]), of(&hulls[2])];
    let within = |a: &[Disc], b: &[Disc]| a.iter().all(|d| b.iter().any(|e| like(d, e)));
    let alike = |a: &[Disc], b: &[Disc]| within(a, b) && within(b, a);
    let same = alike(&bottom, &top) && alike(&bottom, &all) && high - low > SAME * size;
    let [hull, ..] = hulls;
    same.then_some((hull, (low, high)))
}
