//! What calls have become before it is known which primitives stay: a list of parts, and the solid made of it.

use super::element::Element;
use super::flat::Flat;
use super::place::PlacedShape;
use super::polygon::Formula;
use super::swept::Swept;
use super::{Limits, Place, Problem};
use crate::import::{DEVIATION, FACETED, Note};
use crate::solid::{Label, Measured, NodeId, Op, Shape, Solid, SolidBuilder};
use contactd_proto::Pose;
use glam::DVec3;
use std::collections::{HashMap, HashSet};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Makes corners and triangles of a prism.
pub type Prism = Box<dyn Fn() -> (Vec<DVec3>, Vec<[u32; 3]>)>;

/// Index of a part.
pub type PartId = usize;

/// What a call became.
pub enum Part {
    /// Nothing.
    Empty,
    /// A primitive.
    Leaf(Shape, Pose, Label),
    /// A shape in the plane of the extrusion around it.
    Flat(Box<Flat>),
    /// A shape in a plane, by its name, where no extrusion is around it.
    Stray(Place, String),
    /// An operation, where it stands, and its operands.
    Op(Op, Place, Vec<PartId>),
}

/// A part, or all that is outside of it, or everything (true) or nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Signed {
    /// A part.
    In(PartId),
    /// What is outside of a part.
    Out(PartId),
    /// Everything or nothing.
    Known(bool),
}

/// What is made of a call, with nothing but unions in between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Around {
    /// A hull, to which points are all that counts.
    Hull,
    /// A Minkowski sum, to which points of what has no volume count, too.
    Sum,
    /// Anything else, to which what has no volume is nothing.
    Other,
}

/// Parts and notes as they come.
pub struct Parts<'a> {
    limits: &'a Limits,
    /// What was noticed.
    pub notes: Vec<Note>,
    /// All parts; a part that is not replaced by a later one comes after its operands.
    pub list: Vec<Part>,
    /// Of a round primitive: into how many pieces OpenSCAD cuts it.
    pub pieces: HashMap<PartId, u32>,
    /// Of an elliptic primitive: the corners of OpenSCAD's polyhedron of it, and how far off they are at most.
    pub bent: HashMap<PartId, (Vec<DVec3>, f64)>,
    /// Below a hull or a sum: what counts of something without volume, by the empty part that it is.
    pub points: HashMap<PartId, Vec<Element>>,
    /// Of these the faces that enclose nothing, of which a union of several makes nothing.
    pub loose: HashSet<PartId>,
    /// Of a set operation below a hull or a sum: how many operands are something; of one those of what it is.
    pub operands: HashMap<PartId, usize>,
    /// Of an extruded island: the part that is its convex hull.
    pub hulls: HashMap<PartId, PartId>,
    /// Of an extruded island of very many sides: what makes its surface, to be cut as a mesh.
    pub prisms: HashMap<PartId, Prism>,
    /// Of an extrusion of very many sides: its moments.
    pub measured: HashMap<PartId, Measured>,
    /// Where sizes are asked for: of a turned outline what turns, for its mesh has other ends.
    pub swept: Option<HashMap<PartId, Swept>>,
    faces: usize,
}

/// A length as two digits tell it, rounded up: what is told is a bound.
fn told_up(off: f64) -> f64 {
    let unit = 10f64.powf(off.log10().floor() - 1.0);
    let up = (off / unit).ceil() * unit;
    if up.is_finite() { up } else { off }
}

/// True for a primitive that is meant to reach to infinity.
pub fn is_unbounded(shape: &Shape) -> bool {
    !shape.geometry().ball().radius.is_finite()
}

impl<'a> Parts<'a> {
    /// None yet.
    pub fn new(limits: &'a Limits) -> Self {
        let (pieces, bent, points, hulls) = (HashMap::new(), HashMap::new(), HashMap::new(), HashMap::new());
        let (loose, operands) = (HashSet::new(), HashMap::new());
        let (prisms, measured) = (HashMap::new(), HashMap::new());
        let (notes, list) = (Vec::new(), Vec::new());
        let swept = None;
        Self { limits, notes, list, pieces, bent, points, loose, operands, hulls, prisms, measured, swept, faces: 0 }
    }

    /// Adds a part.
    pub fn push(&mut self, part: Part) -> PartId {
        self.list.push(part);
        self.list.len() - 1
    }

    /// Adds a note.
    pub fn note(&mut self, at: Place, text: impl Into<String>, amount: Option<f64>) {
        self.notes.push(Note { at, text: text.into(), amount });
    }

    /// Tells that something has no exact form and is taken in OpenSCAD's pieces: how many, and how far they lie off at most.
    pub fn faceted(&mut self, at: Place, what: &str, facets: usize, off: f64) {
        self.note(at, format!("{what}{FACETED}{facets}{DEVIATION}{:.1e}", told_up(off)), None);
    }

    /// The most pieces that a round primitive below a part is cut into.
    pub fn most_pieces(&self, root: PartId) -> Option<u32> {
        let (mut most, mut stack) = (None, vec![root]);
        while let Some(p) = stack.pop() {
            most = most.max(self.pieces.get(&p).copied());
            if let Part::Op(_, _, of) = &self.list[p] {
                stack.extend(of);
            }
        }
        most
    }

    /// An operation.
    pub fn op(&mut self, op: Op, at: Place, operands: Vec<PartId>) -> PartId {
        match operands.as_slice() {
            [one] => *one,
            _ => self.push(Part::Op(op, at, operands)),
        }
    }

    /// Refuses more faces of one primitive or shape than the limit says.
    pub fn affordable(&self, at: Place, faces: usize) -> Result<()> {
        if faces > self.limits.polyhedron_faces {
            return Err((at, Problem::Limit { what: "faces of a primitive", limit: self.limits.polyhedron_faces }));
        }
        Ok(())
    }

    /// Refuses more faces of one hull than the limit says.
    pub fn hullable(&self, at: Place, faces: usize) -> Result<()> {
        if faces > self.limits.hull_faces {
            return Err((at, Problem::Limit { what: "faces of a hull", limit: self.limits.hull_faces }));
        }
        Ok(())
    }

    /// Refuses more corners of one outline than the limit says.
    pub fn extrudable(&self, at: Place, corners: usize) -> Result<()> {
        let limit = self.limits.outline_corners;
        if corners > limit {
            let expected = format!("at most {limit} corners of an outline (draw it coarser, or divide it)");
            return Err((at, Problem::syntax(expected, format!("{corners}"))));
        }
        Ok(())
    }

    /// Sides that the hull of an outline has at most to be one shape.
    pub fn most_sides(&self) -> usize {
        self.limits.polyhedron_faces.saturating_sub(2)
    }

    /// Refuses more triangles of one mesh than the limit says.
    pub fn meshable(&self, at: Place, triangles: usize) -> Result<()> {
        if triangles > self.limits.mesh_facets {
            return Err((at, Problem::Limit { what: "triangles of a mesh", limit: self.limits.mesh_facets }));
        }
        Ok(())
    }

    /// A primitive as it was placed.
    pub fn leaf(&mut self, name: &str, at: Place, placed: std::result::Result<PlacedShape, Problem>) -> Result<Part> {
        let PlacedShape { shape, frame, mirrored, notes } = placed.map_err(|p| (at, p))?;
        let geometry = shape.geometry();
        self.faces += geometry.face_count();
        if self.faces > self.limits.faces {
            return Err((at, Problem::Limit { what: "faces", limit: self.limits.faces }));
        }
        let bounded = is_unbounded(&shape) || geometry.aabb(&frame).is_finite();
        if !(bounded && frame.position.is_finite()) {
            return Err((at, Problem::syntax("coordinates that a double can hold", "an overflow")));
        }
        for (text, amount) in notes {
            self.note(at, text, amount);
        }
        let label = Label { name: name.to_owned(), line: at.line, column: at.column, mirrored };
        Ok(Part::Leaf(shape, frame, label))
    }

    /// All (true) or one of some parts and outsides of parts must hold. What has an outside is a difference where it is bounded.
    pub fn many(&mut self, all: bool, at: Place, of: Vec<Signed>) -> Signed {
        if of.contains(&Signed::Known(!all)) {
            return Signed::Known(!all);
        }
        let (mut ins, mut outs) = (Vec::new(), Vec::new());
        for s in of {
            match s {
                Signed::In(p) => ins.push(p),
                Signed::Out(p) => outs.push(p),
                Signed::Known(_) => {}
            }
        }
        match (all, ins.is_empty(), outs.is_empty()) {
            (_, true, true) => Signed::Known(all),
            (true, true, false) => Signed::Out(self.op(Op::Union, at, outs)),
            (true, false, _) => {
                let base = self.op(Op::Intersection, at, ins);
                Signed::In(self.op(Op::Difference, at, [vec![base], outs].concat()))
            }
            (false, false, true) => Signed::In(self.op(Op::Union, at, ins)),
            (false, _, false) => {
                let base = self.op(Op::Intersection, at, outs);
                Signed::Out(self.op(Op::Difference, at, [vec![base], ins].concat()))
            }
        }
    }

    /// The parts of a formula whose edges `edge` makes.
    pub fn formula(
        &mut self,
        at: Place,
        formula: &Formula,
        edge: &mut dyn FnMut(&mut Self, usize) -> Result<Signed>,
    ) -> Result<Signed> {
        // Operands before operators, from the last one on: one that is deep takes no stack.
        enum Step<'f> {
            Enter(&'f Formula),
            Leave(bool, usize),
        }
        let (mut steps, mut made) = (vec![Step::Enter(formula)], Vec::new());
        while let Some(step) = steps.pop() {
            match step {
                Step::Enter(Formula::Edge(e)) => made.push(edge(self, *e)?),
                Step::Enter(Formula::Many(all, list)) => {
                    steps.push(Step::Leave(*all, list.len()));
                    steps.extend(list.iter().rev().map(Step::Enter));
                }
                Step::Leave(all, count) => {
                    let of = made.split_off(made.len() - count);
                    made.push(self.many(all, at, of));
                }
            }
        }
        Ok(made.pop().unwrap_or(Signed::Known(true)))
    }

    /// How many operands a set operation has that are something; 1 for anything else that is something.
    pub fn operands(&self, p: PartId) -> usize {
        match &self.list[p] {
            Part::Empty => usize::from(self.points.contains_key(&p)),
            Part::Op(..) => self.operands.get(&p).copied().unwrap_or(1),
            Part::Leaf(..) | Part::Flat(_) | Part::Stray(..) => 1,
        }
    }

    /// What counts of all without volume below a part of which it is the union.
    pub fn flat_points(&self, root: PartId) -> Vec<Element> {
        let (mut found, mut stack) = (Vec::new(), vec![root]);
        while let Some(p) = stack.pop() {
            match &self.list[p] {
                Part::Empty => found.extend(self.points.get(&p).into_iter().flatten().copied()),
                Part::Op(Op::Union, _, of) => stack.extend(of),
                Part::Leaf(..) | Part::Flat(_) | Part::Stray(..) | Part::Op(..) => {}
            }
        }
        found
    }

    /// The leaves below a part of which it is the union, what has no volume but counts among them, and whether something is taken from any of them; `None` where it is cut
    /// in another way.
    pub fn leaves(&self, root: PartId) -> Option<(Vec<PartId>, bool)> {
        let (mut found, mut cut, mut stack) = (Vec::new(), false, vec![root]);
        while let Some(p) = stack.pop() {
            match &self.list[p] {
                Part::Empty if self.points.contains_key(&p) => found.push(p),
                Part::Empty | Part::Stray(..) => {}
                Part::Leaf(..) | Part::Flat(_) => found.push(p),
                Part::Op(Op::Union, _, of) => stack.extend(of.iter().rev()),
                Part::Op(Op::Difference, _, of) => {
                    cut |= of.iter().skip(1).any(|c| !matches!(self.list[*c], Part::Empty));
                    stack.extend(of.first());
                }
                Part::Op(Op::Intersection, _, of) if of.len() == 1 => stack.extend(of),
                Part::Op(Op::Intersection, ..) => return None,
            }
        }
        Some((found, cut))
    }
}

/// Which parts are empty: those made of nothing, and those that cannot contribute.
fn empties(parts: &[Part], root: PartId) -> Vec<bool> {
    let mut empty = vec![false; parts.len()];
    let mut stack = vec![(root, false)];
    while let Some((p, done)) = stack.pop() {
        empty[p] = match &parts[p] {
            Part::Empty | Part::Flat(_) | Part::Stray(..) => true,
            Part::Leaf(..) => false,
            Part::Op(_, _, of) if !done => {
                stack.push((p, true));
                stack.extend(of.iter().map(|c| (*c, false)));
                continue;
            }
            Part::Op(Op::Union, _, c) => c.iter().all(|c| empty[*c]),
            Part::Op(Op::Intersection, _, c) => c.is_empty() || c.iter().any(|c| empty[*c]),
            Part::Op(Op::Difference, _, c) => c.first().is_none_or(|c| empty[*c]),
        };
    }
    empty
}

/// Builds the solid of `root`, leaving out what cannot contribute; where that is more than nothing, a note tells. `measured`: the
/// moments of some parts.
pub fn emit(mut parts: Vec<Part>, root: PartId, measured: &HashMap<PartId, Measured>, notes: &mut Vec<Note>) -> Solid {
    let empty = empties(&parts, root);
    for (i, part) in parts.iter().enumerate() {
        if let Part::Op(op, at, c) = part
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
        Leave(PartId, Op, usize),
    }
    let mut builder = SolidBuilder::new();
    let mut built: Vec<NodeId> = Vec::new();
    let mut visits = vec![Visit::Enter(root)];
    while let Some(visit) = visits.pop() {
        match visit {
            Visit::Enter(p) if empty[p] => built.push(builder.empty()),
            Visit::Enter(p) => match std::mem::replace(&mut parts[p], Part::Empty) {
                Part::Empty | Part::Flat(_) | Part::Stray(..) => built.push(builder.empty()),
                Part::Leaf(shape, frame, label) => built.push(builder.primitive(shape, frame, label)),
                Part::Op(op, _, children) => {
                    let kept: Vec<PartId> = children.into_iter().filter(|c| !empty[*c]).collect();
                    visits.push(Visit::Leave(p, op, kept.len()));
                    visits.extend(kept.into_iter().rev().map(Visit::Enter));
                }
            },
            Visit::Leave(p, op, count) => {
                let children = built.split_off(built.len() - count);
                let node = builder.operation(op, &children);
                if let Some(known) = measured.get(&p) {
                    builder.measured(node, *known);
                }
                built.push(node);
            }
        }
    }
    let root = built.pop().unwrap_or_else(|| builder.empty());
    builder.finish(root)
}
