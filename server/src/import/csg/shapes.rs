//! The primitives: what each call makes.
//!
//! What has no size is nothing, with a note, as in OpenSCAD.

use super::arguments::{Arguments, IndexLists, vector};
use super::element::Element;
use super::facets::{faceted_sphere, prism, ring};
use super::flat::{Flat, Outline};
use super::hull::{corners_of, point_hull};
use super::parts::{Part, PartId, Parts};
use super::place::{self, PlacedShape};
use super::syntax::Call;
use super::{Facets, Limits, Place, Problem};
use crate::import::arrangement::Done;
use crate::import::mesh::{Polygons, oriented};
use crate::solid::primitive::{MeshError, MeshFault};
use crate::solid::{Op, Shape};
use glam::{DAffine3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// From this `$fn` on a curved primitive is taken as exact (`Facets::Auto`).
const EXACT_FROM: f64 = 9.0;

/// Makes primitives.
pub struct Shapes<'l> {
    /// How curved ones are taken.
    pub facets: Facets,
    /// What a file may ask for.
    pub limits: &'l Limits,
    /// Where they go.
    pub parts: Parts<'l>,
}

impl Shapes<'_> {
    /// Nothing, for the reason that the note tells.
    pub fn nothing(&mut self, call: &Call, why: &str) -> PartId {
        self.parts.note(call.at, format!("{} {why}: left out, as OpenSCAD does", call.short()), None);
        self.parts.push(Part::Empty)
    }

    fn leaf(&mut self, call: &Call, placed: std::result::Result<place::PlacedShape, Problem>) -> Result<PartId> {
        let leaf = self.parts.leaf(&call.name, call.at, placed)?;
        Ok(self.parts.push(leaf))
    }

    /// A round primitive; of one that a transform makes elliptic OpenSCAD's polyhedron is kept for what has no other form.
    fn round(
        &mut self,
        call: &Call,
        outer: &DAffine3,
        placed: std::result::Result<place::PlacedShape, Problem>,
        (pieces, radius): (u32, f64),
        mesh: &dyn Fn(u32) -> (Vec<DVec3>, Vec<Vec<u32>>),
    ) -> Result<PartId> {
        let is_elliptic =
            placed.as_ref().is_ok_and(|p| matches!(p.shape, Shape::Ellipsoid(_) | Shape::EllipticFrustum(_)));
        let id = self.leaf(call, placed)?;
        self.parts.pieces.insert(id, pieces);
        if is_elliptic {
            let m = outer.matrix3;
            let size = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
            let off = radius * size * (1.0 - libm::cos(std::f64::consts::PI / f64::from(pieces)));
            let corners = mesh(pieces).0.into_iter().map(|p| outer.transform_point3(p)).collect();
            self.parts.bent.insert(id, (corners, off));
        }
        Ok(id)
    }

    /// `sphere`.
    pub fn sphere(&mut self, call: &Call, outer: &DAffine3) -> Result<PartId> {
        let arguments = Arguments::new(call, &["r"])?;
        let r = match measured(arguments.size("r")?) {
            Ok(r) => r,
            Err(why) => return Ok(self.nothing(call, why)),
        };
        let mesh = |n: u32| faceted_sphere(r, n, n.div_ceil(2));
        match self.fragments(&arguments, r)? {
            None => {
                let pieces = self.pieces(&arguments, r)?;
                self.round(call, outer, place::sphere(outer, r), (pieces, r), &mesh)
            }
            Some(n) => {
                self.parts.affordable(call.at, n as usize * n.div_ceil(2) as usize)?;
                let (points, faces) = mesh(n);
                self.leaf(call, place::polyhedron(outer, &points, &faces).map(|p| p.0))
            }
        }
    }

    /// `cylinder`.
    pub fn cylinder(&mut self, call: &Call, outer: &DAffine3) -> Result<PartId> {
        let arguments = Arguments::new(call, &["h", "r1", "r2", "center"])?;
        let (h, r1, r2) = (arguments.size("h")?, arguments.not_negative("r1")?, arguments.not_negative("r2")?);
        let center = arguments.bool_or("center", false)?;
        let (Some(h), Some(r1), Some(r2)) = (h, r1, r2) else { return Ok(self.nothing(call, "of no size")) };
        if r1 == 0.0 && r2 == 0.0 {
            return Ok(self.nothing(call, "of no size"));
        }
        if r1.is_infinite() && r2.is_infinite() {
            let sides = DVec3::new(f64::INFINITY, f64::INFINITY, h);
            // Sideways it has no ends, so only z tells whether it is centred.
            return self.infinite_box(call, outer, sides, [true, true, center]);
        }
        if !(h.is_finite() && r1.is_finite() && r2.is_finite()) {
            return Ok(self.nothing(call, INFINITE));
        }
        let (low, high) = if center { (-0.5 * h, 0.5 * h) } else { (0.0, h) };
        let mesh = |n: u32| prism(&ring(r1, n), &ring(r2, n), low, high);
        match self.fragments(&arguments, r1.max(r2))? {
            None => {
                let middle = DVec3::new(0.0, 0.0, 0.5 * (low + high));
                let pieces = self.pieces(&arguments, r1.max(r2))?;
                let placed = place::cylinder(outer, middle, r1, r2, h);
                self.round(call, outer, placed, (pieces, r1.max(r2)), &mesh)
            }
            Some(n) => {
                self.parts.affordable(call.at, n as usize + 2)?;
                let (points, faces) = mesh(n);
                self.leaf(call, place::polyhedron(outer, &points, &faces).map(|p| p.0))
            }
        }
    }

    /// `cube`.
    pub fn cube(&mut self, call: &Call, outer: &DAffine3) -> Result<PartId> {
        let arguments = Arguments::new(call, &["size", "center"])?;
        let size = arguments.sizes("size")?;
        let center = arguments.bool_or("center", false)?;
        let Some(size) = size else { return Ok(self.nothing(call, "of no size")) };
        if !size.is_finite() {
            return self.infinite_box(call, outer, size, [center; 3]);
        }
        let middle = if center { DVec3::ZERO } else { size * 0.5 };
        self.leaf(call, place::cuboid(outer, middle, size * 0.5))
    }

    /// `half_space`, which OpenSCAD does not have: all points x with n·x <= offset |n|, by default z <= 0.
    pub fn half_space(&mut self, call: &Call, outer: &DAffine3) -> Result<PartId> {
        let arguments = Arguments::new(call, &["normal", "offset"])?;
        let normal = arguments.get("normal").map_or(Ok(DVec3::Z), |v| vector(v, "a normal of 3 numbers"))?;
        let Some(n) = normal.try_normalize() else {
            return Err((call.at, Problem::syntax("a normal that is not 0", format!("half_space along {normal}"))));
        };
        let offset = arguments.number_or("offset", 0.0)?;
        if !offset.is_finite() {
            return Err((call.at, Problem::syntax("a finite offset", format!("half_space at {offset}"))));
        }
        self.leaf(call, Ok(place::half_space(outer, n, offset)))
    }

    /// A box with infinite sides: an intersection of half-spaces. A centred infinite side has no ends, any other begins
    /// at 0.
    fn infinite_box(&mut self, call: &Call, outer: &DAffine3, size: DVec3, center: [bool; 3]) -> Result<PartId> {
        let mut ends: Vec<(DVec3, f64)> = Vec::new();
        for k in 0..3 {
            let axis = DVec3::AXES[k];
            match (size[k].is_finite(), center[k]) {
                (true, true) => ends.extend([(axis, 0.5 * size[k]), (-axis, 0.5 * size[k])]),
                (true, false) => ends.extend([(axis, size[k]), (-axis, 0.0)]),
                (false, false) => ends.push((-axis, 0.0)),
                (false, true) => {}
            }
        }
        if ends.is_empty() {
            return Err((call.at, Problem::syntax("a primitive with at least one face", "all of space")));
        }
        self.parts.note(call.at, format!("an infinite {}: {} half-space(s)", call.name, ends.len()), None);
        let mut made = Vec::with_capacity(ends.len());
        for (n, d) in ends {
            made.push(self.leaf(call, Ok(place::half_space(outer, n, d)))?);
        }
        Ok(self.parts.push(Part::Op(Op::Intersection, call.at, made)))
    }

    /// Tells what was wrong with lists of indices.
    fn note_indices(&mut self, call: &Call, lists: &str, read: &IndexLists) {
        let whose = format!("a {} whose {lists} name", call.name);
        if read.beyond > 0 {
            let text = format!("{whose} {} points that it has not: left out, as OpenSCAD does", read.beyond);
            self.parts.note(call.at, text, None);
        }
        if read.rough > 0 {
            let text = format!("{whose} {} points by no whole number: cut off, as OpenSCAD does", read.rough);
            self.parts.note(call.at, text, None);
        }
    }

    /// Nothing, for a point that is none, nor is one to OpenSCAD.
    fn pointless(&mut self, call: &Call, place: usize, found: &str) -> PartId {
        self.nothing(call, &format!("whose point {place} is {found}"))
    }

    /// `polyhedron`; below a hull the points of its faces are enough.
    pub fn polyhedron(&mut self, call: &Call, outer: &DAffine3, hull: bool) -> Result<PartId> {
        let arguments = Arguments::new(call, &["points", "faces"])?;
        if arguments.get("points").is_none() && !call.arguments.is_empty() {
            return Ok(self.nothing(call, "without points"));
        }
        let listed = arguments.points::<3>("points", 2)?;
        let mut read = arguments.index_lists("faces", listed.len())?;
        self.note_indices(call, "faces", &read);
        read.lists.retain(|face| face.len() >= 3);
        // Points that no face names may be anything.
        for i in read.lists.iter().flatten() {
            if let Err(found) = &listed[*i as usize] {
                return Ok(self.pointless(call, *i as usize, found));
            }
        }
        let spare = listed.iter().flatten().next().copied().unwrap_or_default();
        let points = listed.into_iter().map(|p| DVec3::from_array(p.unwrap_or(spare))).collect();
        self.of_faces(call, outer, hull, (points, read.lists))
    }

    /// The solid within faces that run clockwise as seen from outside.
    pub fn of_faces(
        &mut self,
        call: &Call,
        outer: &DAffine3,
        hull: bool,
        (points, faces): (Vec<DVec3>, Vec<Vec<u32>>),
    ) -> Result<PartId> {
        if faces.len() > self.limits.polyhedron_faces {
            return if hull {
                self.parts.meshable(call.at, faces.len())?;
                Ok(self.corners(outer, corners_of(used(&points, &faces))))
            } else {
                self.mesh(call, outer, (&points, &faces), None)
            };
        }
        let mut mesh = place::polyhedron(outer, &points, &faces);
        if !hull
            && matches!(mesh, Err(Problem::Mesh(MeshError::Mixed(..))))
            && let Some((turned, count)) = oriented(&faces)
        {
            let text =
                format!("a polyhedron with {count} faces that run the other way round than their neighbours: turned");
            self.parts.note(call.at, text, None);
            return self.of_faces(call, outer, hull, (points, turned));
        }
        if !hull && matches!(mesh, Err(Problem::Mesh(ref e)) if *e != MeshError::Flat) {
            return self.mesh(call, outer, (&points, &faces), mesh.err());
        }
        if hull && matches!(mesh, Err(Problem::Mesh(_))) {
            let used: Vec<DVec3> = faces.iter().flatten().map(|i| points[*i as usize]).collect();
            // What is flat has corners, too.
            let Some(faces) = point_hull(&used) else {
                let id = self.corners(outer, used);
                self.parts.loose.insert(id);
                return Ok(id);
            };
            self.parts.hullable(call.at, faces.len())?;
            let faces: Vec<Vec<u32>> = faces.iter().map(|f| f.iter().rev().map(|i| *i as u32).collect()).collect();
            mesh = place::polyhedron(outer, &used, &faces);
        }
        let (placed, fit) = match mesh {
            Err(Problem::Mesh(MeshError::Flat)) => return Ok(self.nothing(call, "without volume")),
            placed => placed.map_err(|p| (call.at, p))?,
        };
        let mut note = |text: &str, amount| self.parts.note(call.at, text, amount);
        if fit.flipped {
            note("a polyhedron with all faces reversed: flipped", None);
        }
        if fit.merged > 0 {
            note("a polyhedron with coplanar neighbours: merged into one face each", None);
        }
        if fit.moved > 0.0 {
            note(
                "a polyhedron that is not quite convex or not quite planar: taken as the hull of its planes",
                Some(fit.moved),
            );
        }
        self.leaf(call, Ok(placed))
    }

    /// What has no inside of its own, below a hull: points of it.
    fn corners(&mut self, outer: &DAffine3, points: Vec<DVec3>) -> PartId {
        let id = self.parts.push(Part::Empty);
        let points = points.into_iter().map(|p| Element::point(outer.transform_point3(p)));
        self.parts.points.insert(id, points.collect());
        id
    }

    /// A mesh that need not be convex; what it is not closed for was told by `before` where that is known.
    fn mesh(
        &mut self,
        call: &Call,
        outer: &DAffine3,
        (points, faces): (&[DVec3], &[Vec<u32>]),
        before: Option<Problem>,
    ) -> Result<PartId> {
        let triangles: usize = faces.iter().map(|f| f.len().saturating_sub(2)).sum();
        if triangles > self.limits.mesh_facets {
            let problem = Problem::Limit { what: "triangles of a mesh", limit: self.limits.mesh_facets };
            return Err((call.at, problem));
        }
        let made = place::wound(outer, points, faces).map_err(|fault| by_faces(fault, outer, (points, faces)));
        self.meshed(call, made, before)
    }

    /// A mesh of many faces, which run counter-clockwise as seen from outside.
    pub fn of_polygons(&mut self, call: &Call, outer: &DAffine3, polygons: Polygons) -> Result<PartId> {
        self.parts.meshable(call.at, polygons.triangles())?;
        self.meshed(call, place::polygons(outer, polygons), None)
    }

    fn meshed(
        &mut self,
        call: &Call,
        made: std::result::Result<(PlacedShape, Done), Problem>,
        before: Option<Problem>,
    ) -> Result<PartId> {
        let (placed, done) = match made {
            Err(Problem::Surface(MeshFault::Flat)) => return Ok(self.nothing(call, "without volume")),
            Err(Problem::Surface(MeshFault::Open(..) | MeshFault::Mixed(..))) if before.is_some() => {
                return Err((call.at, before.unwrap_or_else(|| Problem::syntax("a mesh", "none"))));
            }
            placed => placed.map_err(|p| (call.at, p))?,
        };
        for (text, amount) in done.notes("a polyhedron") {
            self.parts.note(call.at, text, amount);
        }
        self.leaf(call, Ok(placed))
    }

    /// `circle`, `square` or `polygon`, in a plane.
    pub fn outline(&mut self, call: &Call, inner: DAffine3, overshoot: u32) -> Result<PartId> {
        let mut pieces = 0;
        let outline = match call.name.as_str() {
            "circle" => {
                let arguments = Arguments::new(call, &["r"])?;
                let r = match measured(arguments.size("r")?) {
                    Ok(r) => r,
                    Err(why) => return Ok(self.nothing(call, why)),
                };
                pieces = self.pieces(&arguments, r)?;
                match self.fragments(&arguments, r)? {
                    None => Outline::Circle(r),
                    Some(n) => Outline::Paths(vec![ring(r, n)]),
                }
            }
            "square" => {
                let arguments = Arguments::new(call, &["size", "center"])?;
                let size = arguments.sizes_2d("size")?;
                let center = arguments.bool_or("center", false)?;
                let Some(size) = size else { return Ok(self.nothing(call, "of no size")) };
                if !size.is_finite() {
                    return Ok(self.nothing(call, INFINITE));
                }
                Outline::Square { corner: if center { size * -0.5 } else { DVec2::ZERO }, size }
            }
            _ => {
                let arguments = Arguments::new(call, &["points", "paths"])?;
                if arguments.get("points").is_none() && !call.arguments.is_empty() {
                    return Ok(self.nothing(call, "without points"));
                }
                let listed = arguments.points::<2>("points", 2)?;
                if let Some((i, found)) = listed.iter().enumerate().find_map(|(i, p)| Some((i, p.as_ref().err()?))) {
                    return Ok(self.pointless(call, i, found));
                }
                let points: Vec<DVec2> = listed.into_iter().flatten().map(DVec2::from_array).collect();
                let read = arguments.index_lists("paths", points.len())?;
                self.note_indices(call, "paths", &read);
                // No path at all is the way around all points, too.
                let paths = if read.lists.is_empty() {
                    vec![points]
                } else {
                    read.lists.iter().map(|l| l.iter().map(|i| points[*i as usize]).collect()).collect()
                };
                self.parts.meshable(call.at, paths.iter().map(Vec::len).sum())?;
                if paths.iter().all(|p| p.len() < 3) {
                    return Ok(self.nothing(call, "without area"));
                }
                Outline::Paths(paths)
            }
        };
        let flat = Flat { outline, inner, overshoot, name: call.name.clone(), at: call.at, pieces };
        Ok(self.parts.push(Part::Flat(Box::new(flat))))
    }

    /// How many sides a curved primitive of radius `r` gets; `None` for as many as it has: none.
    pub fn fragments(&mut self, arguments: &Arguments<'_>, r: f64) -> Result<Option<u32>> {
        let fn_ = turn_pieces(arguments)?;
        let name = arguments.name();
        let faceted = match self.facets {
            Facets::Exact => false,
            Facets::Auto => fn_ > 0.0 && fn_ < EXACT_FROM,
            Facets::AsWritten => true,
        };
        if !faceted {
            if fn_ > 0.0 {
                self.parts.note(arguments.at(), format!("{name} with $fn = {fn_}: taken as exact"), None);
            }
            return Ok(None);
        }
        if fn_ <= 0.0 && arguments.number_or("$fe", 0.0)? > 0.0 {
            let construct = format!("$fe of {name} taken as written");
            return Err((arguments.at(), Problem::Unsupported { construct, hint: " (give $fn, or $fa and $fs)" }));
        }
        let n = pieces(arguments, r)?;
        if n > self.limits.polyhedron_faces as f64 {
            let problem = Problem::Limit { what: "faces of a primitive", limit: self.limits.polyhedron_faces };
            return Err((arguments.at(), problem));
        }
        let text = match name {
            "offset" => format!("offset taken with OpenSCAD's arcs, of {n} pieces a turn"),
            _ => format!("{name} taken as OpenSCAD's polyhedron of {n} sides"),
        };
        self.parts.note(arguments.at(), text, None);
        Ok(Some(n as u32))
    }

    /// How many pieces OpenSCAD cuts a curve of radius `r` into, where it has to be cut; never more than the limit.
    pub fn pieces(&self, arguments: &Arguments<'_>, r: f64) -> Result<u32> {
        // Whatever is written there: whole curves are not cut, and their arguments change nothing.
        Ok(pieces(arguments, r).map_or(30.0, |n| n.min(self.limits.polyhedron_faces as f64)) as u32)
    }
}

/// `$fn`: of a turn that is cut into no finite number of pieces OpenSCAD makes three.
fn turn_pieces(arguments: &Arguments<'_>) -> Result<f64> {
    let fn_ = arguments.setting("$fn", 0.0)?;
    Ok(if fn_.is_finite() { fn_ } else { 3.0 })
}

/// Why OpenSCAD makes nothing of what reaches to infinity.
const INFINITE: &str = "of infinite size";

/// A finite size, or why nothing is there.
fn measured(size: Option<f64>) -> std::result::Result<f64, &'static str> {
    let r = size.ok_or("of no size")?;
    if r.is_finite() { Ok(r) } else { Err(INFINITE) }
}

/// OpenSCAD's rule (Calc::get_fragments_from_r).
fn pieces(arguments: &Arguments<'_>, r: f64) -> Result<f64> {
    let fn_ = turn_pieces(arguments)?;
    let (fs, fa) = (arguments.setting("$fs", 2.0)?, arguments.setting("$fa", 12.0)?);
    Ok(if fn_ > 0.0 {
        fn_.max(3.0).floor()
    } else {
        (360.0 / fa.max(0.01)).min(r * std::f64::consts::TAU / fs.max(0.01)).max(5.0).ceil()
    })
}

/// The points that some faces name, each once.
fn used(points: &[DVec3], faces: &[Vec<u32>]) -> Vec<DVec3> {
    let mut named = vec![false; points.len()];
    faces.iter().flatten().for_each(|i| named[*i as usize] = true);
    points.iter().zip(named).filter(|(_, named)| *named).map(|(p, _)| *p).collect()
}

/// What is wrong with a polyhedron of which two facets cross, by the numbers of its faces.
fn by_faces(fault: Problem, outer: &DAffine3, (points, faces): (&[DVec3], &[Vec<u32>])) -> Problem {
    let Problem::Surface(MeshFault::Through { near, facets }) = &fault else { return fault };
    let points: Vec<DVec3> = points.iter().map(|p| outer.transform_point3(*p)).collect();
    // Corners that were taken as others near them are none of its own.
    let face_of = |facet: &[DVec3; 3]| {
        faces.iter().position(|face| facet.iter().all(|c| face.iter().any(|i| points[*i as usize] == *c)))
    };
    let [Some(one), Some(other)] = [face_of(&facets[0]), face_of(&facets[1])] else { return fault };
    let corners = |i: usize| format!("faces[{i}] = {:?}", faces[i]);
    let found = format!(
        "one that crosses itself near {near}, where {} meets {} (part them, or make it a union of closed parts)",
        corners(one),
        corners(other)
    );
    Problem::syntax("a closed mesh", found)
}
