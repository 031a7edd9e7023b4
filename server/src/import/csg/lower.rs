//! From the syntax tree to a solid.
//!
//! One pass over the calls in file order with a stack of open ones; each carries the transform from its children to the
//! model. It yields a tree of parts, from which those that cannot contribute (an intersection with nothing, what is
//! subtracted from nothing) are left out before primitives get their indices: every primitive of the solid stands at
//! exactly one leaf. What a call makes of all that is inside of it (an extrusion, a hull, a sum, an offset) is made when it closes.

use super::arguments::{Arguments, OTHER_FILES, finite};
use super::combined;
use super::extrude::Extrusion;
use super::flat::{Flat, Outline, Plane};
use super::imports;
use super::offset::Offset;
use super::outlines::{self, flat_of, flats};
use super::parts::{Around, Part, PartId, Parts, emit, is_unbounded};
use super::place;
use super::quadrics;
use super::revolve::Turn;
use super::shapes::Shapes;
use super::superellipsoid;
use super::syntax::{Call, CallId, FLATTEN, File, Value, ValueKind};
use super::{Facets, Import, Limits, Place, Problem};
use super::{resize, text, twist};
use crate::import::{Attachment, Note};
use crate::math::Aabb;
use crate::math::tolerance::ROUNDING;
use crate::solid::Op;
use glam::{DAffine3, DMat3, DVec3};
use std::collections::HashMap;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Makes a solid of a parsed file.
pub fn lower(file: &File, (facets, attached): (Facets, Option<&[Attachment]>), limits: &Limits) -> Result<Import> {
    let shapes = Shapes { facets, limits, parts: Parts::new(limits) };
    let mut lowering = Lowering { file, attached, shapes };
    let root = lowering.tree()?;
    let Parts { mut notes, list, measured, .. } = lowering.shapes.parts;
    let solid = emit(list, root, &measured, &mut notes);
    let unbounded = solid.primitives.iter().find(|p| is_unbounded(&p.shape));
    if let Some(p) = unbounded
        && !solid.aabb().is_empty()
        && !solid.aabb().is_finite()
    {
        let at = Place { line: p.label.line, column: p.label.column };
        let text = "the model reaches to infinity by this half-space: a floor or a wall, without mass properties";
        notes.push(Note { at, text: text.into(), amount: None });
    }
    notes.sort_by_key(|n| (n.at.line, n.at.column));
    if solid.is_empty() {
        notes.push(Note { at: Place::START, text: "the model is empty: nothing can touch it".into(), amount: None });
    }
    Ok(Import { solid, notes })
}

/// The surroundings of a call.
#[derive(Clone, Copy)]
struct Context {
    /// From the call's coordinates to the model's; inside of an extrusion from the extrusion's.
    outer: DAffine3,
    /// Inside of an extrusion: its plane.
    plane: Option<Plane>,
    /// What is made of the call, with nothing but unions in between.
    around: Around,
}

/// Why a matrix leaves nothing.
const FLAT: &str = "that flattens what is inside of it";

/// What is below a matrix.
enum Moved {
    /// The same, elsewhere.
    Kept(Context),
    /// Points in a plane or on a line, moved so.
    Flat(DAffine3),
}

/// What a call makes of what is inside of it.
#[derive(Clone)]
enum CallKind {
    Set(Op),
    Extrude(Extrusion),
    Revolve(Turn),
    Hull,
    /// A flat shape without its holes.
    Fill,
    Minkowski,
    Projection {
        /// What z = 0 cuts; else the shadow on it.
        cut: bool,
    },
    Offset(Offset, u32),
    /// Solids whose points alone count, moved so.
    Flattened(DAffine3),
}

/// A call whose children are being lowered.
struct Open<'a> {
    call: Option<&'a Call>,
    children: &'a [CallId],
    next: usize,
    kind: CallKind,
    /// That of the call itself; the children's differs inside of an extrusion.
    outside: Context,
    context: Context,
    built: Vec<PartId>,
}

impl Open<'_> {
    fn at(&self) -> Place {
        self.call.map_or(Place::START, |c| c.at)
    }
}

/// What a call is at first sight.
enum Step {
    Leaf(PartId),
    Open(Box<(CallKind, Context)>),
}

impl Step {
    fn open(kind: CallKind, context: Context) -> Self {
        Self::Open(Box::new((kind, context)))
    }
}

struct Lowering<'a> {
    file: &'a File,
    /// The files that it names.
    attached: Option<&'a [Attachment]>,
    shapes: Shapes<'a>,
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
        self.all(top, root, Context { outer: DAffine3::IDENTITY, plane: None, around: Around::Other })
    }

    /// The union of some calls, of which `root` alone counts where there is one.
    fn all(&mut self, top: &[CallId], root: Option<CallId>, context: Context) -> Result<PartId> {
        let file = self.file;
        let (kind, outside) = (CallKind::Set(Op::Union), context);
        let mut open = vec![Open { call: None, children: top, next: 0, kind, outside, context, built: Vec::new() }];
        while let Some(current) = open.last_mut() {
            if let Some(&id) = current.children.get(current.next) {
                current.next += 1;
                let call = &file.calls[id];
                if call.disabled || (call.background && root != Some(id)) {
                    let mark = if call.disabled { "*" } else { "%" };
                    self.note(call.at, format!("{} after {mark}: left out, as OpenSCAD does", call.short()), None);
                    continue;
                }
                let mut context = current.context;
                if let Some(plane) = &mut context.plane
                    && matches!(current.kind, CallKind::Set(Op::Difference))
                    && !current.built.is_empty()
                {
                    plane.overshoot += 1;
                }
                match self.step(call, context)? {
                    Step::Leaf(id) => current.built.push(id),
                    Step::Open(open_call) => {
                        let (kind, inside) = *open_call;
                        let (children, outside) = (call.children.as_slice(), context);
                        let built = Vec::new();
                        open.push(Open { call: Some(call), children, next: 0, kind, outside, context: inside, built });
                    }
                }
                continue;
            }
            let Some(done) = open.pop() else { break };
            let part = self.close(done)?;
            match open.last_mut() {
                Some(parent) => parent.built.push(part),
                None => return Ok(part),
            }
        }
        Ok(self.shapes.parts.push(Part::Empty))
    }

    fn note(&mut self, at: Place, text: impl Into<String>, amount: Option<f64>) {
        self.shapes.parts.note(at, text, amount);
    }

    /// Tells that the model is the call `root` alone, and which other calls would be it too.
    fn roots(&mut self, root: CallId) {
        let file = self.file;
        let call = &file.calls[root];
        self.note(call.at, format!("{} after !: the model is this call alone", call.short()), None);
        for (_, other) in file.calls.iter().enumerate().filter(|(id, c)| *id != root && c.root && !c.disabled) {
            self.note(other.at, "a second !: without effect, the first one counts, as in OpenSCAD", None);
        }
    }

    fn step(&mut self, call: &'a Call, context: Context) -> Result<Step> {
        let inside = |kind| {
            let around = match kind {
                CallKind::Hull => Around::Hull,
                CallKind::Minkowski => Around::Sum,
                CallKind::Set(Op::Union) => context.around,
                _ => Around::Other,
            };
            Ok(Step::open(kind, Context { around, ..context }))
        };
        // A 2D shape within its plane, or by itself.
        let placed = || context.plane.map_or((DAffine3::IDENTITY, 0), |plane| (plane.inner, plane.overshoot));
        match call.name.as_str() {
            "group" | "union" => Arguments::new(call, &[]).and_then(|_| inside(CallKind::Set(Op::Union))),
            "difference" => Arguments::new(call, &[]).and_then(|_| inside(CallKind::Set(Op::Difference))),
            "intersection" => Arguments::new(call, &[]).and_then(|_| inside(CallKind::Set(Op::Intersection))),
            "render" => Arguments::new(call, &["convexity"]).and_then(|_| inside(CallKind::Set(Op::Union))),
            "color" => Arguments::new(call, &["c", "alpha"]).and_then(|_| inside(CallKind::Set(Op::Union))),
            "multmatrix" | "translate" | "rotate" | "scale" | "mirror" => Ok(match self.multmatrix(call, context)? {
                Ok(Moved::Kept(context)) => Step::open(CallKind::Set(Op::Union), context),
                Ok(Moved::Flat(by)) => {
                    Step::open(CallKind::Flattened(by), Context { outer: DAffine3::IDENTITY, ..context })
                }
                Err(why) => Step::Leaf(self.shapes.nothing(call, why)),
            }),
            "hull" => Arguments::new(call, &[]).and_then(|_| inside(CallKind::Hull)),
            "fill" => Arguments::new(call, &[]).and_then(|_| inside(CallKind::Fill)),
            "minkowski" => Arguments::new(call, &["convexity"]).and_then(|_| inside(CallKind::Minkowski)),
            "projection" => {
                let cut = Arguments::new(call, &["cut", "convexity"])?.bool_or("cut", false)?;
                let inside = Context { outer: DAffine3::IDENTITY, plane: None, around: Around::Other };
                Ok(Step::open(CallKind::Projection { cut }, inside))
            }
            "resize" => self.resized(call, context),
            "offset" => {
                let Some(mut offset) = Offset::new(call)? else {
                    return Ok(Step::Leaf(self.shapes.nothing(call, "by no finite distance")));
                };
                let pieces = self.shapes.pieces(&Offset::arguments(call)?, offset.by().abs())?;
                let Some(plane) = context.plane else { return inside(CallKind::Set(Op::Union)) };
                offset.cut(&mut self.shapes, call)?;
                // Distances are those of the call's own coordinates.
                let local = Plane { inner: DAffine3::IDENTITY, ..plane };
                Ok(Step::open(CallKind::Offset(offset, pieces), Context { plane: Some(local), ..context }))
            }
            "linear_extrude" | "rotate_extrude" => self.extrusion(call, context),
            "circle" | "square" | "polygon" => {
                no_children(call)?;
                let (inner, overshoot) = placed();
                let id = self.shapes.outline(call, inner, overshoot)?;
                Ok(self.flat_leaf(call, context, id))
            }
            "text" => {
                no_children(call)?;
                let (inner, overshoot) = placed();
                let id = text::text(&mut self.shapes, call, inner, overshoot, self.attached)?;
                Ok(self.flat_leaf(call, context, id))
            }
            "import" if context.plane.is_some() || imports::is_flat(call) && self.attached.is_some() => {
                let (inner, overshoot) = placed();
                let id = imports::flat(&mut self.shapes, call, (inner, overshoot), self.attached)?;
                no_children(call)?;
                Ok(self.flat_leaf(call, context, id))
            }
            _ => self.solid(call, context).map(Step::Leaf),
        }
    }

    /// A solid that has no operands; what is none of these is a construct that is not known.
    fn solid(&mut self, call: &Call, context: Context) -> Result<PartId> {
        let (outer, attached) = (&context.outer, self.attached);
        let hull = context.around == Around::Hull;
        let hulled = (outer, hull);
        match call.name.as_str() {
            "import" => {
                let id = imports::import(&mut self.shapes, call, hulled, attached)?;
                return no_children(call).map(|()| id);
            }
            "surface" => {
                let id = imports::surface(&mut self.shapes, call, hulled, attached)?;
                no_children(call)?;
                return Ok(if context.plane.is_none() { id } else { self.within_a_plane(call) });
            }
            "sphere" | "cylinder" | "cube" | "polyhedron" | "half_space" | "height_field" | "paraboloid"
            | "hyperboloid" | "quadric" | "superellipsoid" => no_children(call)?,
            other => return Err((call.at, Problem::Unsupported { construct: call.short(), hint: hint(other) })),
        }
        if context.plane.is_some() {
            return Ok(self.within_a_plane(call));
        }
        match call.name.as_str() {
            "sphere" => self.shapes.sphere(call, outer),
            "cylinder" => self.shapes.cylinder(call, outer),
            "cube" => self.shapes.cube(call, outer),
            "half_space" => self.shapes.half_space(call, outer),
            "height_field" => imports::height_field(&mut self.shapes, call, hulled),
            "polyhedron" => self.shapes.polyhedron(call, outer, hull),
            "superellipsoid" => superellipsoid::superellipsoid(&mut self.shapes, call, outer),
            "paraboloid" | "hyperboloid" | "quadric" => quadrics::quadric(&mut self.shapes, call, outer),
            other => Err((call.at, Problem::Unsupported { construct: call.short(), hint: hint(other) })),
        }
    }

    /// What a solid is inside of a 2D shape.
    fn within_a_plane(&mut self, call: &Call) -> PartId {
        self.shapes.nothing(call, "inside of a 2D shape")
    }

    /// What a call that resizes its operands opens.
    fn resized(&mut self, call: &'a Call, context: Context) -> Result<Step> {
        let scale = resize::scale(call, context.plane.is_some(), || self.bounds(call, context))?;
        let linear = DAffine3::from_mat3(DMat3::from_diagonal(scale));
        let context = match context.plane {
            Some(plane) => Context { plane: Some(Plane { inner: plane.inner * linear, ..plane }), ..context },
            None => Context { outer: context.outer * linear, ..context },
        };
        Ok(Step::open(CallKind::Set(Op::Union), context))
    }

    /// A 2D shape; outside of what makes it a solid it is none.
    fn flat_leaf(&mut self, call: &Call, context: Context, id: PartId) -> Step {
        Step::Leaf(match context.plane {
            Some(_) => id,
            None => self.shapes.parts.push(Part::Stray(call.at, call.name.clone())),
        })
    }

    fn extrusion(&mut self, call: &'a Call, context: Context) -> Result<Step> {
        let linear = call.name == "linear_extrude";
        if imports::file_of(call).is_some() && context.plane.is_none() {
            return self.extruded_file(call, context);
        }
        if call.children.is_empty() {
            if linear {
                Extrusion::arguments(call)?
            } else {
                Turn::arguments(call)?
            };
            self.note(call.at, format!("{} without a shape inside: nothing is there", call.name), None);
            return Ok(Step::Leaf(self.shapes.parts.push(Part::Empty)));
        }
        if context.plane.is_some() {
            return Ok(Step::Leaf(self.shapes.nothing(call, "inside of a 2D shape")));
        }
        let plane = Some(Plane { inner: DAffine3::IDENTITY, overshoot: 0 });
        if linear {
            let Some(extrusion) = Extrusion::new(call)? else {
                return Ok(Step::Leaf(self.shapes.nothing(call, "of no height")));
            };
            let outer = extrusion.slanted(&context.outer);
            return Ok(Step::open(CallKind::Extrude(extrusion), Context { outer, plane, around: Around::Other }));
        }
        let Some(turn) = Turn::new(call)? else {
            return Ok(Step::Leaf(self.shapes.nothing(call, "by no angle")));
        };
        Ok(Step::open(CallKind::Revolve(turn), Context { plane, around: Around::Other, ..context }))
    }

    /// An extrusion of a drawing in another file.
    fn extruded_file(&mut self, call: &'a Call, context: Context) -> Result<Step> {
        let plane = Some(Plane { inner: DAffine3::IDENTITY, overshoot: 0 });
        let (kind, outer) = if call.name == "linear_extrude" {
            let Some(extrusion) = Extrusion::new(call)? else {
                return Ok(Step::Leaf(self.shapes.nothing(call, "of no height")));
            };
            (CallKind::Extrude(extrusion), extrusion.slanted(&context.outer))
        } else {
            let Some(turn) = Turn::new(call)? else {
                return Ok(Step::Leaf(self.shapes.nothing(call, "by no angle")));
            };
            (CallKind::Revolve(turn), context.outer)
        };
        let flat = imports::flat(&mut self.shapes, call, (DAffine3::IDENTITY, 0), self.attached)?;
        let inside = Context { outer, plane, around: Around::Other };
        let open = Open {
            call: Some(call),
            children: &[],
            next: 0,
            kind,
            outside: context,
            context: inside,
            built: vec![flat],
        };
        self.close(open).map(Step::Leaf)
    }

    /// The box of what is inside of a call, in the call's own coordinates; of 2D shapes flat. `None` for nothing.
    fn bounds(&self, call: &'a Call, context: Context) -> Result<Option<(Aabb, f64)>> {
        let mut parts = Parts::new(self.shapes.limits);
        parts.swept = Some(HashMap::new());
        let shapes = Shapes { facets: self.shapes.facets, limits: self.shapes.limits, parts };
        let mut inside = Lowering { file: self.file, attached: self.attached, shapes };
        let plane = context.plane.map(|_| Plane { inner: DAffine3::IDENTITY, overshoot: 0 });
        let own = Context { outer: DAffine3::IDENTITY, plane, around: Around::Other };
        let root = inside.all(&call.children, None, own)?;
        resize::bounds(&mut inside.shapes.parts, call.at, root, plane.is_some())
    }

    /// What a call has become, all that is inside of it being there.
    fn close(&mut self, open: Open<'_>) -> Result<PartId> {
        let at = open.at();
        if let (CallKind::Projection { cut }, Some(call)) = (&open.kind, open.call) {
            return combined::projection(&mut self.shapes.parts, call, *cut, open.outside.plane, open.built);
        }
        if open.context.plane.is_none() {
            // What is flat is nothing to solids, and what an intersection with it leaves is nothing, too.
            let is_stray = |p: &PartId| matches!(self.shapes.parts.list[*p], Part::Stray(..));
            let flat = matches!(open.kind, CallKind::Set(Op::Intersection)) && open.built.iter().any(is_stray);
            let (built, stray) = combined::of_one_dimension(&mut self.shapes.parts, open.built, open.call.is_none())?;
            if flat && stray.is_none() && !built.is_empty() {
                self.note(at, "an intersection of solids with a 2D shape: nothing is left, as OpenSCAD has it", None);
                return Ok(self.shapes.parts.push(Part::Empty));
            }
            if let Some((at, name)) = stray {
                return Ok(self.shapes.parts.push(Part::Stray(at, name)));
            }
            let parts = &mut self.shapes.parts;
            let part = match open.kind {
                CallKind::Set(op) => return Ok(combined::set(parts, op, at, built, open.outside.around)),
                CallKind::Hull => return combined::hull(parts, at, &built, open.outside.around),
                CallKind::Flattened(by) => {
                    let made = combined::flattened(parts, at, &built, &by, open.outside.around)?;
                    if made.is_some_and(|p| parts.operands(p) > 0) {
                        parts.note(
                            at,
                            "a matrix that flattens: points count to what is around it, as in OpenSCAD",
                            None,
                        );
                    }
                    return Ok(match (made, open.call) {
                        (Some(made), _) => made,
                        (None, Some(call)) => self.shapes.nothing(call, FLAT),
                        (None, None) => parts.push(Part::Empty),
                    });
                }
                CallKind::Fill => Part::Op(Op::Union, at, built),
                CallKind::Minkowski => combined::minkowski(parts, at, &built, open.outside.outer.translation)?,
                CallKind::Extrude(_) | CallKind::Revolve(_) | CallKind::Offset(..) | CallKind::Projection { .. } => {
                    Part::Empty
                }
            };
            return Ok(self.shapes.parts.push(part));
        }
        let like = |pieces: u32, call: &Call| Flat {
            outline: Outline::Circle(1.0),
            inner: DAffine3::IDENTITY,
            overshoot: open.outside.plane.map_or(0, |p| p.overshoot),
            name: call.name.clone(),
            at,
            pieces,
        };
        let most = flats(&self.shapes.parts, &open.built);
        let most = most.iter().filter_map(|f| flat_of(&self.shapes.parts, *f)).map(|f| f.pieces).max().unwrap_or(1);
        let parts = &mut self.shapes.parts;
        let part = match (&open.kind, open.call) {
            (CallKind::Set(op), _) => Part::Op(*op, at, open.built),
            (_, None) | (CallKind::Projection { .. } | CallKind::Flattened(_), _) => Part::Empty,
            (CallKind::Extrude(extrusion), _)
                if extrusion.bends(flats(parts, &open.built).into_iter().filter_map(|f| flat_of(parts, f))) =>
            {
                twist::extruded(parts, at, &open.context.outer, extrusion, &open.built)?
            }
            (CallKind::Extrude(extrusion), _) => {
                for leaf in flats(parts, &open.built) {
                    let Part::Flat(flat) = std::mem::replace(&mut parts.list[leaf], Part::Empty) else { continue };
                    parts.list[leaf] = extrusion.part(parts, &open.context.outer, &flat)?;
                    if flat.pieces > 0 {
                        parts.pieces.insert(leaf, flat.pieces);
                    }
                }
                Part::Op(Op::Union, at, open.built)
            }
            (CallKind::Revolve(turn), Some(call)) => {
                return combined::revolve(&mut self.shapes, call, *turn, &open.context.outer, open.built);
            }
            (CallKind::Hull, Some(call)) => outlines::hull(parts, at, &like(most, call), &open.built)?,
            (CallKind::Fill, Some(call)) => outlines::filled(parts, at, &like(most, call), &open.built)?,
            (CallKind::Minkowski, Some(call)) => {
                let origin = open.outside.plane.map_or(DVec3::ZERO, |p| p.inner.translation);
                outlines::minkowski(parts, at, &like(most, call), &open.built, origin)?
            }
            (CallKind::Offset(offset, pieces), Some(call)) => {
                let part = offset.of(parts, at, &like((*pieces).max(most), call), &open.built)?;
                let id = parts.push(part);
                let inner = open.outside.plane.map_or(DAffine3::IDENTITY, |p| p.inner);
                for leaf in flats(parts, &[id]) {
                    if let Part::Flat(flat) = &mut parts.list[leaf] {
                        flat.inner = inner * flat.inner;
                    }
                }
                return Ok(id);
            }
        };
        Ok(self.shapes.parts.push(part))
    }

    /// The context below a matrix; else why nothing is there.
    fn multmatrix(&mut self, call: &Call, context: Context) -> Result<std::result::Result<Moved, &'static str>> {
        let arguments = Arguments::new(call, &["m"])?;
        let value = arguments.required("m", "a 4×4 matrix")?;
        if holds_no_finite(value) {
            return Ok(Err("that holds no finite numbers"));
        }
        let Some(m) = matrix(value)? else { return Ok(Err("with a 0 as its last number")) };
        if m[3][..3] != [0.0; 3] {
            let text = "the last row of a matrix begins with other numbers than 0: ignored, as OpenSCAD does";
            let amount = m[3][..3].iter().fold(0.0, |a: f64, x| a.max(x.abs()));
            self.note(value.at, text, Some(amount));
        }
        let shift = DVec3::new(m[0][3], m[1][3], m[2][3]);
        let columns = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
        let linear = DMat3::from_cols(columns(0), columns(1), columns(2));
        let Some(flat) = context.plane else {
            if place::is_flat(linear) {
                let by = context.outer * DAffine3::from_mat3_translation(linear, shift);
                return Ok(if context.around == Around::Other { Err(FLAT) } else { Ok(Moved::Flat(by)) });
            }
            let (linear, off) = place::snapped(linear);
            self.snapped(value.at, off);
            let outer = context.outer * DAffine3::from_mat3_translation(linear, shift);
            return Ok(Ok(Moved::Kept(Context { outer, ..context })));
        };
        // In 2D only x and y count. With z scaled as they are, a plane similarity is one in space, and snaps as one.
        let aside = [m[0][2], m[1][2], m[2][0], m[2][1], m[2][3]].iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        if aside > ROUNDING {
            let text = "a matrix inside of linear_extrude that moves along z: ignored, as OpenSCAD does";
            self.note(value.at, text, Some(aside));
        }
        let plane = |z: f64| DMat3::from_cols(columns(0).with_z(0.0), columns(1).with_z(0.0), DVec3::Z * z);
        let size = plane(1.0).determinant().abs().sqrt();
        if place::is_flat(plane(size)) {
            return Ok(Err(FLAT));
        }
        let (mut linear, off) = place::snapped(plane(size));
        linear.z_axis = DVec3::Z;
        self.snapped(value.at, off);
        let inner = flat.inner * DAffine3::from_mat3_translation(linear, shift.with_z(0.0));
        Ok(Ok(Moved::Kept(Context { plane: Some(Plane { inner, ..flat }), ..context })))
    }

    fn snapped(&mut self, at: Place, off: Option<f64>) {
        if off.is_some() {
            self.note(at, "a rough matrix: replaced by the nearest rotation times scale", off);
        }
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

fn no_children(call: &Call) -> Result<()> {
    match call.children.is_empty() {
        true => Ok(()),
        false => Err((call.at, Problem::syntax(format!("nothing inside of {}", call.name), "calls"))),
    }
}

/// What to do about a construct that is not supported.
fn hint(name: &str) -> &'static str {
    match name {
        "for" | "intersection_for" | "if" | "let" | "assign" | "echo" | "assert" | "children" | "child" => FLATTEN,
        "import_stl" | "import_off" | "import_dxf" => OTHER_FILES,
        "roof" => " (write the shape out in spheres, cylinders, cubes and convex polyhedra)",
        _ => "",
    }
}

/// True for a matrix in which a number is infinite or `nan`, as divisions by zero leave them: OpenSCAD removes what is inside.
fn holds_no_finite(value: &Value) -> bool {
    let is = |v: &Value| matches!(v.kind, ValueKind::Number(n) if !n.is_finite());
    let of = |v: &Value| matches!(&v.kind, ValueKind::List(row) if row.iter().any(is));
    matches!(&value.kind, ValueKind::List(rows) if rows.iter().any(of))
}

/// Four rows of four, divided by the last number w; `None` where that is 0. The other numbers of the last row say nothing of a solid.
fn matrix(value: &Value) -> Result<Option<[[f64; 4]; 4]>> {
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
    if w == 0.0 {
        return Ok(None);
    }
    if w != 1.0 {
        m.iter_mut().flatten().for_each(|x| *x /= w);
    }
    Ok(Some(m))
}
