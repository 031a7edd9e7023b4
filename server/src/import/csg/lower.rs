//! From the syntax tree to a solid.
//!
//! One pass over the calls in file order with a stack of open ones; each carries the transform from its children to the
//! model. It yields a tree of parts, from which those that cannot contribute (an intersection with nothing, what is
//! subtracted from nothing) are left out before primitives get their indices: every primitive of the solid stands at
//! exactly one leaf, in file order.

use super::arguments::{Arguments, OTHER_FILES, finite};
use super::extrude::{Extrusion, prism, ring, turn};
use super::place::{self, Placed};
use super::syntax::{Call, CallId, File, Value, ValueKind};
use super::{Facets, Import, Limits, Place, Problem};
use crate::import::Note;
use crate::math::tolerance::{ROUNDING, SIMILARITY};
use crate::solid::{Label, NodeId, Op, Shape, Solid, SolidBuilder};
use contactd_proto::Pose;
use glam::{DAffine3, DMat3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// From this `$fn` on a curved primitive is taken as exact (`Facets::Auto`).
const EXACT_FROM: f64 = 9.0;

/// True for a primitive that is meant to reach to infinity.
fn is_unbounded(shape: &Shape) -> bool {
    !shape.geometry().ball().radius.is_finite()
}

/// Makes a solid of a parsed file.
pub fn lower(file: &File, facets: Facets, limits: &Limits) -> Result<Import> {
    let mut lowering = Lowering { file, facets, limits, notes: Vec::new(), parts: Vec::new(), faces: 0 };
    let root = lowering.tree()?;
    let mut notes = lowering.notes;
    let solid = emit(lowering.parts, root, &mut notes);
    notes.sort_by_key(|n| (n.at.line, n.at.column));
    let unbounded = solid.primitives.iter().find(|p| is_unbounded(&p.shape));
    if let Some(p) = unbounded
        && !solid.aabb().is_empty()
        && !solid.aabb().is_finite()
    {
        let at = Place { line: p.label.line, column: p.label.column };
        let expected = "something bounded that this infinite primitive is cut down by";
        return Err((at, Problem::syntax(expected, "a solid that reaches to infinity")));
    }
    if solid.is_empty() {
        notes.push(Note { at: Place::START, text: "the model is empty: nothing can touch it".into(), amount: None });
    }
    Ok(Import { solid, notes })
}

/// Index of a part.
type PartId = usize;

/// What a call became, before it is known which primitives stay.
enum Operand {
    Empty,
    Leaf(Shape, Pose, Label),
    /// An operation, where it stands, and its operands.
    Op(Op, Place, Vec<PartId>),
}

/// The surroundings of a call.
#[derive(Clone, Copy)]
struct Context {
    /// From the call's coordinates to the model's; inside of an extrusion from the extrusion's.
    outer: DAffine3,
    /// Inside of an extrusion: the outline's own transform and how far it goes beyond the ends.
    outline: Option<Outline>,
}

#[derive(Clone, Copy)]
struct Outline {
    extrusion: Extrusion,
    inner: DAffine3,
    overshoot: u32,
}

/// A call whose children are being lowered.
struct Open<'a> {
    at: Place,
    children: &'a [CallId],
    next: usize,
    op: Op,
    context: Context,
    built: Vec<PartId>,
}

/// What a call is at first sight.
enum Step {
    Leaf(Operand),
    Open(Op, Context),
}

struct Lowering<'a> {
    file: &'a File,
    facets: Facets,
    limits: &'a Limits,
    notes: Vec<Note>,
    parts: Vec<Operand>,
    faces: usize,
}

impl<'a> Lowering<'a> {
    /// Lowers the whole file; the top is a union.
    fn tree(&mut self) -> Result<PartId> {
        let file = self.file;
        let root = root_call(file);
        let top: &[CallId] = root.as_ref().map_or(&file.top, std::slice::from_ref);
        if let Some(root) = root {
            self.roots(root);
        }
        let context = Context { outer: DAffine3::IDENTITY, outline: None };
        let mut open =
            vec![Open { at: Place::START, children: top, next: 0, op: Op::Union, context, built: Vec::new() }];
        loop {
            let depth = open.len();
            let current = &mut open[depth - 1];
            if let Some(&id) = current.children.get(current.next) {
                current.next += 1;
                let call = &file.calls[id];
                if call.disabled || (call.background && root != Some(id)) {
                    let mark = if call.disabled { "*" } else { "%" };
                    self.note(call.at, format!("{} after {mark}: left out, as OpenSCAD does", call.short()), None);
                    continue;
                }
                let mut context = current.context;
                if let Some(outline) = &mut context.outline
                    && current.op == Op::Difference
                    && !current.built.is_empty()
                {
                    outline.overshoot += 1;
                }
                match self.step(call, context)? {
                    Step::Leaf(part) => {
                        let id = self.push(part);
                        open[depth - 1].built.push(id);
                    }
                    Step::Open(op, context) => {
                        let children = &call.children;
                        open.push(Open { at: call.at, children, next: 0, op, context, built: Vec::new() });
                    }
                }
                continue;
            }
            let (op, at, built) = (current.op, current.at, std::mem::take(&mut current.built));
            open.pop();
            let part = self.push(Operand::Op(op, at, built));
            match open.last_mut() {
                Some(parent) => parent.built.push(part),
                None => return Ok(part),
            }
        }
    }

    fn note(&mut self, at: Place, text: String, amount: Option<f64>) {
        self.notes.push(Note { at, text, amount });
    }

    /// Tells that the model is the call `root` alone, and which other calls would be it too.
    fn roots(&mut self, root: CallId) {
        let file = self.file;
        let call = &file.calls[root];
        self.note(call.at, format!("{} after !: the model is this call alone", call.short()), None);
        for (_, other) in file.calls.iter().enumerate().filter(|(id, c)| *id != root && c.root && !c.disabled) {
            self.note(other.at, "a second !: without effect, the first one counts, as in OpenSCAD".into(), None);
        }
    }

    fn push(&mut self, part: Operand) -> PartId {
        self.parts.push(part);
        self.parts.len() - 1
    }

    fn step(&mut self, call: &'a Call, context: Context) -> Result<Step> {
        let inside = |op| Ok(Step::Open(op, context));
        match call.name.as_str() {
            "group" | "union" => Arguments::new(call, &[]).and_then(|_| inside(Op::Union)),
            "difference" => Arguments::new(call, &[]).and_then(|_| inside(Op::Difference)),
            "intersection" => Arguments::new(call, &[]).and_then(|_| inside(Op::Intersection)),
            "render" => Arguments::new(call, &["convexity"]).and_then(|_| inside(Op::Union)),
            "color" => Arguments::new(call, &["c", "alpha"]).and_then(|_| inside(Op::Union)),
            "multmatrix" => self.multmatrix(call, context).map(|c| Step::Open(Op::Union, c)),
            "linear_extrude" => {
                solid_wanted(call, &context)?;
                if call.children.is_empty() {
                    Extrusion::arguments(call)?;
                    self.note(call.at, "linear_extrude without a shape inside: nothing is there".into(), None);
                    return Ok(Step::Leaf(Operand::Empty));
                }
                let extrusion = Extrusion::new(call)?;
                let outline = Some(Outline { extrusion, inner: DAffine3::IDENTITY, overshoot: 0 });
                Ok(Step::Open(Op::Union, Context { outer: extrusion.slanted(&context.outer), outline }))
            }
            "sphere" | "cylinder" | "cube" | "polyhedron" => {
                solid_wanted(call, &context)?;
                no_children(call)?;
                match call.name.as_str() {
                    "sphere" => self.sphere(call, &context.outer),
                    "cylinder" => self.cylinder(call, &context.outer),
                    "cube" => self.cube(call, &context.outer),
                    _ => self.polyhedron(call, &context.outer),
                }
                .map(Step::Leaf)
            }
            "circle" | "square" | "polygon" => {
                let Some(outline) = context.outline else {
                    let found = format!("the 2D shape {} outside of linear_extrude", call.name);
                    return Err((call.at, Problem::syntax("a solid", found)));
                };
                no_children(call)?;
                self.outline(call, &context.outer, &outline).map(Step::Leaf)
            }
            other => Err((call.at, Problem::Unsupported { construct: call.short(), hint: hint(other) })),
        }
    }

    fn multmatrix(&mut self, call: &Call, context: Context) -> Result<Context> {
        let arguments = Arguments::new(call, &["m"])?;
        let value = arguments.required("m", "a 4×4 matrix")?;
        let m = matrix(value)?;
        if m[3][..3] != [0.0; 3] {
            let text = "the last row of a matrix is not quite [0, 0, 0, 1]: ignored, as OpenSCAD does".into();
            let amount = m[3][..3].iter().fold(0.0, |a: f64, x| a.max(x.abs()));
            self.notes.push(Note { at: value.at, text, amount: Some(amount) });
        }
        let shift = DVec3::new(m[0][3], m[1][3], m[2][3]);
        let columns = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
        let linear = DMat3::from_cols(columns(0), columns(1), columns(2));
        let flat = |l: DMat3| match place::is_flat(l) {
            true => Err((value.at, Problem::syntax("a matrix that keeps volumes", "one that flattens them"))),
            false => Ok(()),
        };
        let Some(outline) = context.outline else {
            flat(linear)?;
            let (linear, off) = place::snapped(linear);
            self.snapped(value.at, off);
            let outer = context.outer * DAffine3::from_mat3_translation(linear, shift);
            return Ok(Context { outer, ..context });
        };
        // In 2D only x and y count. With z scaled as they are, a plane similarity is one in space, and snaps as one.
        let aside = [m[0][2], m[1][2], m[2][0], m[2][1], m[2][3]].iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        if aside > ROUNDING {
            let text = "a matrix inside of linear_extrude that moves along z: ignored, as OpenSCAD does".into();
            self.note(value.at, text, Some(aside));
        }
        let plane = |z: f64| DMat3::from_cols(columns(0).with_z(0.0), columns(1).with_z(0.0), DVec3::Z * z);
        let size = plane(1.0).determinant().abs().sqrt();
        flat(plane(size))?;
        let (mut linear, off) = place::snapped(plane(size));
        linear.z_axis = DVec3::Z;
        self.snapped(value.at, off);
        let inner = outline.inner * DAffine3::from_mat3_translation(linear, shift.with_z(0.0));
        Ok(Context { outline: Some(Outline { inner, ..outline }), ..context })
    }

    fn snapped(&mut self, at: Place, off: Option<f64>) {
        if off.is_some() {
            let text = "a rough matrix: replaced by the nearest rotation times scale".into();
            self.notes.push(Note { at, text, amount: off });
        }
    }

    fn sphere(&mut self, call: &Call, outer: &DAffine3) -> Result<Operand> {
        let arguments = Arguments::new(call, &["r"])?;
        let r = arguments.finite_positive("r")?;
        match self.fragments(&arguments, r)? {
            None => self.leaf(call, place::sphere(outer, r)),
            Some(n) => {
                let rings = n.div_ceil(2);
                self.affordable(call, n as usize * rings as usize)?;
                let (points, faces) = faceted_sphere(r, n, rings);
                self.leaf(call, place::polyhedron(outer, &points, &faces).map(|p| p.0))
            }
        }
    }

    fn cylinder(&mut self, call: &Call, outer: &DAffine3) -> Result<Operand> {
        let arguments = Arguments::new(call, &["h", "r1", "r2", "center"])?;
        let h = arguments.positive("h")?;
        let (r1, r2) = (arguments.not_negative("r1")?, arguments.not_negative("r2")?);
        let center = arguments.bool_or("center", false)?;
        if r1 == 0.0 && r2 == 0.0 {
            return Err((call.at, Problem::syntax("a positive r1 or r2 of cylinder", "0 for both")));
        }
        if r1.is_infinite() && r2.is_infinite() {
            let sides = DVec3::new(f64::INFINITY, f64::INFINITY, h);
            // Sideways it has no ends, so only z tells whether it is centred.
            return self.infinite_box(call, outer, sides, [true, true, center]);
        }
        if !(h.is_finite() && r1.is_finite() && r2.is_finite()) {
            let found = format!("h = {h}, r1 = {r1}, r2 = {r2}");
            return Err((call.at, Problem::syntax("a finite cylinder, or one with r1 and r2 infinite", found)));
        }
        let (low, high) = if center { (-0.5 * h, 0.5 * h) } else { (0.0, h) };
        match self.fragments(&arguments, r1.max(r2))? {
            None => {
                let middle = DVec3::new(0.0, 0.0, 0.5 * (low + high));
                self.leaf(call, place::cylinder(outer, middle, r1, r2, h))
            }
            Some(n) => {
                self.affordable(call, n as usize + 2)?;
                let (points, faces) = prism(&ring(r1, n), &ring(r2, n), low, high);
                self.leaf(call, place::polyhedron(outer, &points, &faces).map(|p| p.0))
            }
        }
    }

    fn cube(&mut self, call: &Call, outer: &DAffine3) -> Result<Operand> {
        let arguments = Arguments::new(call, &["size", "center"])?;
        let size = arguments.positive_sizes("size")?;
        let center = arguments.bool_or("center", false)?;
        if !size.is_finite() {
            return self.infinite_box(call, outer, size, [center; 3]);
        }
        let middle = if center { DVec3::ZERO } else { size * 0.5 };
        self.leaf(call, place::cuboid(outer, middle, size * 0.5))
    }

    /// A box with infinite sides: an intersection of half-spaces. A centred infinite side has no ends, any other begins
    /// at 0.
    fn infinite_box(&mut self, call: &Call, outer: &DAffine3, size: DVec3, center: [bool; 3]) -> Result<Operand> {
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
        let text = format!("an infinite {}: {} half-space(s)", call.name, ends.len());
        self.notes.push(Note { at: call.at, text, amount: None });
        let mut parts = Vec::with_capacity(ends.len());
        for (n, d) in ends {
            let part = self.leaf(call, Ok(place::half_space(outer, n, d)))?;
            parts.push(self.push(part));
        }
        Ok(Operand::Op(Op::Intersection, call.at, parts))
    }

    fn polyhedron(&mut self, call: &Call, outer: &DAffine3) -> Result<Operand> {
        let arguments = Arguments::new(call, &["points", "faces"])?;
        let points: Vec<DVec3> = arguments.points::<3>("points")?.into_iter().map(DVec3::from_array).collect();
        let faces = arguments.index_lists("faces", points.len())?;
        self.affordable(call, faces.len())?;
        let (placed, fit) = place::polyhedron(outer, &points, &faces).map_err(|p| (call.at, p))?;
        let mut note = |text: &str, amount| self.notes.push(Note { at: call.at, text: text.into(), amount });
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

    fn outline(&mut self, call: &Call, outer: &DAffine3, o: &Outline) -> Result<Operand> {
        let Outline { extrusion, inner, overshoot } = *o;
        let placed = match call.name.as_str() {
            "circle" => {
                let arguments = Arguments::new(call, &["r"])?;
                let r = arguments.finite_positive("r")?;
                match self.fragments(&arguments, r)? {
                    None => extrusion.circle(outer, &inner, r, overshoot),
                    Some(n) => {
                        self.affordable(call, n as usize + 2)?;
                        extrusion.polygon(outer, &inner, &ring(r, n), overshoot)
                    }
                }
            }
            "square" => {
                let arguments = Arguments::new(call, &["size", "center"])?;
                let size = arguments.positive_sizes_2d("size")?;
                let corner = if arguments.bool_or("center", false)? { size * -0.5 } else { DVec2::ZERO };
                extrusion.square(outer, &inner, corner, size, overshoot)
            }
            _ => {
                let arguments = Arguments::new(call, &["points", "paths"])?;
                let points: Vec<DVec2> = arguments.points::<2>("points")?.into_iter().map(DVec2::from_array).collect();
                let outline = match arguments.get("paths") {
                    None => points,
                    Some(paths) => match arguments.index_lists("paths", points.len())?.as_slice() {
                        [one] => one.iter().map(|i| points[*i as usize]).collect(),
                        _ => return Err((paths.at, Problem::unsupported("a polygon of several paths"))),
                    },
                };
                self.affordable(call, outline.len() + 2)?;
                extrusion.polygon(outer, &inner, &outline, overshoot)
            }
        };
        self.leaf(call, placed)
    }

    /// How many sides a curved primitive of radius `r` gets; `None` for as many as it has: none.
    fn fragments(&mut self, arguments: &Arguments<'_>, r: f64) -> Result<Option<u32>> {
        let fn_ = arguments.number_or("$fn", 0.0)?;
        let name = arguments.name();
        let faceted = match self.facets {
            Facets::Exact => false,
            Facets::Auto => fn_ > 0.0 && fn_ < EXACT_FROM,
            Facets::AsWritten => true,
        };
        if !faceted {
            if fn_ > 0.0 {
                let text = format!("{name} with $fn = {fn_}: taken as exact");
                self.notes.push(Note { at: arguments.at(), text, amount: None });
            }
            return Ok(None);
        }
        if fn_ <= 0.0 && arguments.number_or("$fe", 0.0)? > 0.0 {
            let construct = format!("$fe of {name} taken as written");
            return Err((arguments.at(), Problem::Unsupported { construct, hint: " (give $fn, or $fa and $fs)" }));
        }
        // OpenSCAD's rule (Calc::get_fragments_from_r).
        let (fs, fa) = (arguments.number_or("$fs", 2.0)?, arguments.number_or("$fa", 12.0)?);
        let n = if fn_ > 0.0 {
            fn_.max(3.0).floor()
        } else {
            (360.0 / fa.max(0.01)).min(r * std::f64::consts::TAU / fs.max(0.01)).max(5.0).ceil()
        };
        if n > self.limits.polyhedron_faces as f64 {
            let problem = Problem::Limit { what: "faces of a primitive", limit: self.limits.polyhedron_faces };
            return Err((arguments.at(), problem));
        }
        let text = format!("{name} taken as OpenSCAD's polyhedron of {n} sides");
        self.notes.push(Note { at: arguments.at(), text, amount: None });
        Ok(Some(n as u32))
    }

    fn affordable(&self, call: &Call, faces: usize) -> Result<()> {
        if faces > self.limits.polyhedron_faces {
            let problem = Problem::Limit { what: "faces of a primitive", limit: self.limits.polyhedron_faces };
            return Err((call.at, problem));
        }
        Ok(())
    }

    fn leaf(&mut self, call: &Call, placed: std::result::Result<Placed, Problem>) -> Result<Operand> {
        let Placed { shape, frame, mirrored, notes } = placed.map_err(|p| (call.at, p))?;
        let geometry = shape.geometry();
        self.faces += geometry.faces().len();
        if self.faces > self.limits.faces {
            return Err((call.at, Problem::Limit { what: "faces", limit: self.limits.faces }));
        }
        let bounded = is_unbounded(&shape) || geometry.aabb(&frame).is_finite();
        if !(bounded && frame.position.is_finite()) {
            return Err((call.at, Problem::syntax("coordinates that a double can hold", "an overflow")));
        }
        for (text, amount) in notes {
            self.note(call.at, text, amount);
        }
        let label = Label { name: call.name.clone(), line: call.at.line, column: call.at.column, mirrored };
        Ok(Operand::Leaf(shape, frame, label))
    }
}

/// The first call with `!` that is not switched off: the model is this call alone, without what surrounds it.
fn root_call(file: &File) -> Option<CallId> {
    let mut stack: Vec<CallId> = file.top.iter().rev().copied().collect();
    while let Some(id) = stack.pop() {
        let call = &file.calls[id];
        if call.disabled {
            continue;
        }
        if call.root {
            return Some(id);
        }
        stack.extend(call.children.iter().rev());
    }
    None
}

fn solid_wanted(call: &Call, context: &Context) -> Result<()> {
    match context.outline {
        None => Ok(()),
        Some(_) => Err((call.at, Problem::syntax("a 2D shape inside of linear_extrude", &call.name))),
    }
}

fn no_children(call: &Call) -> Result<()> {
    match call.children.is_empty() {
        true => Ok(()),
        false => Err((call.at, Problem::syntax(format!("nothing inside of {}", call.name), "calls"))),
    }
}

/// What to do about a construct that is not supported.
fn hint(name: &str) -> &'static str {
    match name {
        "translate" | "rotate" | "scale" | "mirror" | "for" | "intersection_for" | "if" | "let" | "assign" | "echo"
        | "assert" | "children" | "child" => " (flatten the file first: openscad -o model.csg model.scad)",
        "import" | "import_stl" | "import_off" | "import_dxf" | "surface" => OTHER_FILES,
        "hull" | "minkowski" | "rotate_extrude" | "resize" | "projection" | "roof" => {
            " (write the shape out in spheres, cylinders, cubes and convex polyhedra)"
        }
        "text" | "offset" | "fill" => " (write the outline out in circles, squares and convex polygons)",
        _ => "",
    }
}

/// Four rows of four; the last one (0, 0, 0, w), within `SIMILARITY`, divides the others.
fn matrix(value: &Value) -> Result<[[f64; 4]; 4]> {
    let wrong = |v: &Value, what: &str| (v.at, Problem::syntax(what, v.found()));
    let ValueKind::List(rows) = &value.kind else { return Err(wrong(value, "a 4×4 matrix")) };
    if rows.len() != 4 {
        return Err(wrong(value, "a matrix with 4 rows"));
    }
    let mut m = [[0.0; 4]; 4];
    for (row, values) in m.iter_mut().zip(rows) {
        let ValueKind::List(values_in_row) = &values.kind else { return Err(wrong(values, "a row of 4 numbers")) };
        if values_in_row.len() != 4 {
            return Err(wrong(values, "a row of 4 numbers"));
        }
        for (x, v) in row.iter_mut().zip(values_in_row) {
            *x = finite(v)?;
        }
    }
    let w = m[3][3];
    if m[3][..3].iter().any(|x| x.abs() > SIMILARITY * w.abs()) || w == 0.0 {
        return Err(wrong(&rows[3], "the row [0, 0, 0, 1]"));
    }
    if w != 1.0 {
        m.iter_mut().flatten().for_each(|x| *x /= w);
    }
    Ok(m)
}

/// OpenSCAD's sphere: `rings` rings of `n` corners at polar angles (i + ½)·180°/rings, caps on the outermost rings.
fn faceted_sphere(r: f64, n: u32, rings: u32) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let mut points = Vec::with_capacity((n * rings) as usize);
    for i in 0..rings {
        let polar = turn(2 * i + 1, 4 * rings);
        points.extend(ring(r * polar.y, n).into_iter().map(|p| p.extend(r * polar.x)));
    }
    // Ring 0 is the topmost; faces clockwise from outside.
    let mut faces: Vec<Vec<u32>> = vec![(0..n).rev().collect()];
    for i in 1..rings {
        let (up, down) = ((i - 1) * n, i * n);
        faces.extend((0..n).map(|k| vec![up + k, up + (k + 1) % n, down + (k + 1) % n, down + k]));
    }
    faces.push(((rings - 1) * n..rings * n).collect());
    (points, faces)
}

/// Builds the solid of `root`, leaving out what cannot contribute; where that is more than nothing, a note tells.
fn emit(mut parts: Vec<Operand>, root: PartId, notes: &mut Vec<Note>) -> Solid {
    let mut empty = vec![false; parts.len()];
    for (i, part) in parts.iter().enumerate() {
        empty[i] = match part {
            Operand::Empty => true,
            Operand::Leaf(..) => false,
            Operand::Op(Op::Union, _, c) => c.iter().all(|c| empty[*c]),
            Operand::Op(Op::Intersection, _, c) => c.is_empty() || c.iter().any(|c| empty[*c]),
            Operand::Op(Op::Difference, _, c) => c.first().is_none_or(|c| empty[*c]),
        };
        if let Operand::Op(op, at, c) = part
            && empty[i]
            && c.iter().any(|c| !empty[*c])
        {
            let what = if *op == Op::Difference { "a difference from" } else { "an intersection with" };
            notes.push(Note {
                at: *at,
                text: format!("{what} nothing: left out with all that is inside"),
                amount: None,
            });
        }
    }
    enum Visit {
        Enter(PartId),
        Leave(Op, usize),
    }
    let mut builder = SolidBuilder::new();
    let mut built: Vec<NodeId> = Vec::new();
    let mut visits = vec![Visit::Enter(root)];
    while let Some(visit) = visits.pop() {
        match visit {
            Visit::Enter(p) if empty[p] => built.push(builder.empty()),
            Visit::Enter(p) => match std::mem::replace(&mut parts[p], Operand::Empty) {
                Operand::Empty => built.push(builder.empty()),
                Operand::Leaf(shape, frame, label) => built.push(builder.primitive(shape, frame, label)),
                Operand::Op(op, _, children) => {
                    let kept: Vec<PartId> = children.into_iter().filter(|c| !empty[*c]).collect();
                    visits.push(Visit::Leave(op, kept.len()));
                    visits.extend(kept.into_iter().rev().map(Visit::Enter));
                }
            },
            Visit::Leave(op, count) => {
                let children = built.split_off(built.len() - count);
                built.push(builder.operation(op, &children));
            }
        }
    }
    let root = built.pop().unwrap_or_else(|| builder.empty());
    builder.finish(root)
}
