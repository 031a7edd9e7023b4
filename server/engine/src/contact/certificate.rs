//! A certificate: the proof that a pair stays free of contact until `time_lower`, to be checked by another program.
//!
//! It is made after the answer is known, by a second, simpler pass: no slices of time, no octrees, no candidates, one tree
//! of cells that starts with the reference body's whole box. A cell is proven free for spans of time, one after the other; where
//! its bounds do not advance it is split into halves, which go on from there. Each span lists the combinations of
//! literals that cannot hold together; the cell's expression is closed when no clause is left. Source: the bounds of
//! `clause`, taken over a slightly larger cell, for a little less time and depth, so that a checker with bounds of its own
//! has room for its rounding.
//!
//! Invariant: cells stand in preorder, spans meet end to end. It does not promise to be the shortest proof, and it proves
//! the answer rather than the steps by which the search found it. Format: docs/certificate.md.

use crate::bound::{Bound, Volumes};
use crate::contact::exclusion::clause::{self, Hint, Proof, Term};
use crate::contact::exclusion::enumeration;
use crate::contact::exclusion::literal::{Side, View};
use crate::contact::instant::depth;
use crate::contact::instant::work::Work;
use crate::contact::query::outcome::{Contact, NO_FACE, Outcome, Status};
use crate::contact::query::question::PairQuery;
use crate::contact::query::task::Task;
use crate::math::Aabb;
use crate::motion::{Placed, Relative};
use crate::solid::local::{self, AND, Expression, LiteralId, OR, Token, Truth};
use crate::solid::{Node, NodeId, Op, Sense, Solid};
use contactd_proto::Motion;
use glam::DVec3;
use std::fmt::Write as _;

/// A literal with the body it belongs to; A is the reference body of the cells.
type Key = (Side, LiteralId);

/// Room left for a checker: depth proven, relative to the depth claimed.
const DEPTH: f64 = 0.8;
/// Room left for a checker: depth by which a wall is told, which nothing moves, relative to the depth claimed.
const WALL: f64 = 1.0 - 1e-9;
/// Room left for a checker: the cell is bounded as if this much larger.
const SWELL: f64 = 1.02;
/// Room left for a checker: share of the proven time that is used.
const HASTE: f64 = 0.85;
/// Part of the depth that a witness must reach: the point deepened from the touch is right to less than the rest.
const WITNESS: f64 = 0.995;
/// Room left for a checker: the box of a proof at a distance holds what is so many times as near.
const ROOM: f64 = 4.0;
/// Sides of a compact cell differ by no more than about this.
const SLAB: f64 = 4.0;
/// Cells that may get as thin as their faces have them; a proof that takes more is begun anew with compact ones. Most take a few.
const THIN: u64 = 2000;
/// How much before `time_lower` the proof of an undecided answer may end, in depths over the fastest speed.
const BACK: [f64; 3] = [0.0, 10.0, 1000.0];
/// Combinations of a span above which they are not thinned out.
const MAX_THINNED: usize = 40;

/// The proof of one pair.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// The second body of the query carries the cells.
    pub swapped: bool,
    /// Depth below which nothing counts: the resolution, or twice that when the bodies touch at the start.
    pub depth: f64,
    /// Free of contact until then.
    pub until: f64,
    /// The box that is covered, in the reference body's frame.
    pub root: Aabb,
    /// For a contact: `time_upper`, and the point that is at the depth in both bodies then, in the reference body's frame.
    pub witness: Option<(f64, DVec3)>,
    /// Cells in preorder.
    pub cells: Vec<CellProof>,
}

/// The proof of one cell, from the time at which its parent was split.
#[derive(Clone, Debug, Default)]
pub struct CellProof {
    /// Literals that hold nowhere in the cell, from its beginning to the end of the proof; point of contact of a tangent.
    pub never: Vec<(Key, DVec3)>,
    /// Spans of time, each from the end of the one before.
    pub spans: Vec<Span>,
    /// What becomes of the rest of the time.
    pub rest: Rest,
}

/// An exclusion: no contact in the cell until then.
#[derive(Clone, Debug)]
pub struct Span {
    /// End of the span.
    pub until: f64,
    /// Combinations that close the cell's expression; empty when the cell lies inside B (after the start only).
    pub close: Vec<Vec<Term>>,
}

/// How a cell ends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Rest {
    /// Its spans reach the end of the proof, or its expression is false.
    #[default]
    Done,
    /// It lies inside the reference body: the first contact would be on both surfaces.
    Inside,
    /// Two halves follow: axis and coordinate.
    Split(usize, f64),
    /// Nothing is said of it: bodies touch in it, or near it.
    Left,
}

/// Proves what an answer says; `None` when it says nothing about any time (overlap), or the limit of cells is reached.
pub fn certify(query: &PairQuery, outcome: &Outcome) -> Option<Certificate> {
    if outcome.status() == Status::Overlap {
        return None;
    }
    let (mut task, swapped) = Task::of(query);
    let depth = outcome.depth;
    // In the frames of the bodies as they move: the search may leave out a spin that moves nothing.
    let (reference, other) = if swapped { (query.b, query.a) } else { (query.a, query.b) };
    let still = task.relative;
    task.relative = Relative::new(reference.placed, other.placed);
    task.delta = DEPTH * depth;
    // A formula is seen to be bounded by the planes that cut it off, which stand a little outside of what it holds.
    let with_formula = task.a.primitives.iter().any(|p| p.shape.formula().is_some());
    let hull = if with_formula { extent(task.a, task.a.root, 0.0) } else { task.a.aabb() };
    // Coordinates of the box and of what it holds are right to a few units in the last place.
    let slack = hull.half() * 1e-9 + DVec3::splat(depth);
    let root = Aabb::new(hull.min - slack, hull.max + slack);
    let made = Certificate {
        swapped,
        depth,
        until: outcome.time_lower().min(1.0),
        root,
        witness: witness(&task, (swapped, &still), outcome, depth),
        cells: Vec::new(),
    };
    if task.a.is_void() || task.b.is_void() {
        return Some(made);
    }
    if !root.is_finite() {
        return None;
    }
    if outcome.status() != Status::Undecided {
        return cover(&task, swapped, outcome, made, (query.cell_limit, 0.0));
    }
    // The limit may have run out where the bodies are as good as at the depth, too near for what a checker needs: then the
    // proof ends a little earlier.
    let speed = task.relative.bounds(0.0, 1.0, task.scale).speed.max(f64::MIN_POSITIVE);
    let backs = BACK.iter().map(|back| made.until - back * depth / speed).filter(|until| *until >= 0.0);
    let tries: Vec<Certificate> = backs.map(|until| Certificate { until, ..made.clone() }).collect();
    let limit = query.cell_limit / BACK.len() as u64;
    tries.into_iter().find_map(|made| cover(&task, swapped, outcome, made, (limit, 0.0)))
}

/// Proves that no point has f_A <= `level` and f_B <= `level` (a length, positive) until `until`; the cells are bounded at `made`,
/// a little more than that, which leaves a checker room. `None` when the limit of cells is reached.
pub fn certify_level(query: &PairQuery, level: f64, made: f64, until: f64) -> Option<Certificate> {
    level_proof(query, (level, made), until, 0.0)
}

/// The same, of which cells of radius `left` or less may be left.
fn level_proof(query: &PairQuery, (level, made): (f64, f64), until: f64, left: f64) -> Option<Certificate> {
    let (mut task, swapped) = Task::of(query);
    let (reference, other) = if swapped { (query.b, query.a) } else { (query.a, query.b) };
    task.relative = Relative::new(reference.placed, other.placed);
    task.delta = -made;
    task.strategies.fits &= made < task.fits_below();
    // A checker has bounds of its own of how far {f <= level} reaches beyond a cone or a polyhedron.
    let hull = extent(task.a, task.a.root, ROOM * level);
    let slack = hull.half() * 1e-9 + DVec3::splat(level);
    let root = Aabb::new(hull.min - slack, hull.max + slack);
    let made = Certificate { swapped, depth: -level, until, root, witness: None, cells: Vec::new() };
    if task.a.is_empty() || task.b.is_empty() {
        return Some(made);
    }
    let nothing = Outcome::clear(query.resolution);
    if root.is_finite() { cover(&task, swapped, &nothing, made, (query.cell_limit, left)) } else { None }
}

/// Proves where two bodies touch at one time of their motions: but for cells that are left, of radius `left` (radii of the smaller
/// body), no point has f_A <= `level` and f_B <= `level`. The certificate's motions are those of bodies that stand as they do then.
/// `None` when the limit of cells is reached.
pub fn certify_regions(query: &PairQuery, time: f64, level: f64, left: f64) -> Option<Certificate> {
    let mut query = *query;
    for body in [&mut query.a, &mut query.b] {
        let motion = Motion::resting(body.placed.motion.at(time));
        body.placed = Placed { motion, ..body.placed };
    }
    let radius = query.a.model.radius.min(query.b.model.radius);
    level_proof(&query, (level, 1.25 * level), 0.0, left * radius)
}

/// The point of a contact's witness (world), and its time.
pub fn witness_of(query: &PairQuery, outcome: &Outcome) -> Option<(f64, DVec3)> {
    let (mut task, swapped) = Task::of(query);
    let (reference, other) = if swapped { (query.b, query.a) } else { (query.a, query.b) };
    let still = task.relative;
    task.relative = Relative::new(reference.placed, other.placed);
    let (t, x) = witness(&task, (swapped, &still), outcome, outcome.depth)?;
    Some((t, task.relative.world_point(&task.relative.at(t), x)))
}

/// A box around all points with f <= `level` below a node, as its operations bound it.
fn extent(solid: &Solid, node: NodeId, level: f64) -> Aabb {
    match &solid.nodes[node as usize] {
        Node::Empty => Aabb::EMPTY,
        Node::Primitive(p) => Bound::of_primitive(&solid.primitives[*p as usize], level, Volumes::Boxes).aabb,
        Node::Op(Op::Difference, children) => extent(solid, children[0], level),
        Node::Op(Op::Union, children) => {
            children.iter().fold(Aabb::EMPTY, |all, c| all.union(&extent(solid, *c, level)))
        }
        Node::Op(Op::Intersection, children) => {
            children.iter().fold(Aabb::ALL, |all, c| all.intersection(&extent(solid, *c, level)))
        }
    }
}

/// Covers the box with cells, as many as `limit`; those of radius `left` or less may be left.
///
/// Along a line of contact a cell costs its bound nothing, however thin it is across. Faces that bend away from their tangents may
/// tell the same of a long side that holds the bound back all the same: there compact cells are the shorter proof, by factors.
fn cover(
    task: &Task,
    swapped: bool,
    outcome: &Outcome,
    made: Certificate,
    (limit, left): (u64, f64),
) -> Option<Certificate> {
    let covered =
        |limit: u64, compact: bool| cover_with(task, (swapped, outcome), made.clone(), (limit, left), compact);
    // Along faces that touch no cell is ever thin enough: what is to be left must not become a slab.
    if left > 0.0 {
        return covered(limit, true);
    }
    covered(limit.min(THIN), false).or_else(|| {
        if limit <= THIN {
            return None;
        }
        covered(limit, true).or_else(|| covered(limit, false))
    })
}

/// The same with cells that may be thin, or compact ones.
fn cover_with(
    task: &Task,
    (swapped, outcome): (bool, &Outcome),
    mut made: Certificate,
    (limit, left): (u64, f64),
    compact: bool,
) -> Option<Certificate> {
    let mut scratch = clause::Scratch::recording();
    let hints = hints(task, swapped, outcome);
    // What lies on itself is left for the checker to see: the trees as they stand.
    let (a, b) = (task.a.literal_form(), task.b.literal_form());
    let mut stack = vec![Open { region: made.root, t: 0.0, started: false, a, b, reach: 1.0 }];
    while let Some(open) = stack.pop() {
        if made.cells.len() as u64 >= limit {
            return None;
        }
        let mut maker = Maker { task, end: made.until, left, compact, hints: &hints, scratch: &mut scratch };
        let (proof, children) = maker.cell(open);
        made.cells.push(proof);
        stack.extend(children.into_iter().flatten().rev());
    }
    Some(made)
}

/// The point of a contact, deepened to what both bodies share when it is decided.
fn witness(task: &Task, (swapped, still): (bool, &Relative), o: &Outcome, depth: f64) -> Option<(f64, DVec3)> {
    let contact = o.contact()?;
    let x = carried(task, contact)?;
    let at = task.relative.at(contact.time_upper);
    let deep = |x: DVec3| -task.a.value(x).max(task.b.value(at.b_point(x)));
    let enough = |x: &DVec3| deep(*x) >= WITNESS * depth;
    // The search has left out a spin that moves nothing; the frame that carries the point here takes part in it.
    let named = contact.witness.map(|x| {
        let searched = still.at(contact.time_upper);
        let x = if swapped { searched.a_point(x) } else { x };
        let off = still.world_point(&searched, DVec3::ZERO) - task.relative.world_point(&at, DVec3::ZERO);
        at.world_from_a.transpose() * (searched.world_from_a * x + off)
    });
    let found = named.filter(enough).or_else(|| Some(x).filter(enough)).or_else(|| {
        let (deepest, ..) = depth::climb(task, &at, x, &Work::new(u64::MAX));
        Some(deepest).filter(enough)
    });
    found.map(|x| (contact.time_upper, x))
}

/// The contact's point in the reference body's frame.
fn carried(task: &Task, contact: &Contact) -> Option<DVec3> {
    let at = task.relative.at(contact.time);
    let point = contact.point?.point;
    Some(at.world_from_a.transpose() * (point - task.relative.world_point(&at, DVec3::ZERO)))
}

/// Where the contact touches curved faces is where they are worth touching all along.
fn hints(task: &Task, swapped: bool, o: &Outcome) -> Vec<Hint> {
    let Some(contact) = o.contact() else { return Vec::new() };
    let (Some(x), Some(point)) = (carried(task, contact), &contact.point) else { return Vec::new() };
    let at = task.relative.at(contact.time);
    let (faces_a, faces_b) = if swapped { (&point.faces_b, &point.faces_a) } else { (&point.faces_a, &point.faces_b) };
    let mut hints = Vec::new();
    for (side, solid, faces, point) in [(Side::A, task.a, faces_a, x), (Side::B, task.b, faces_b, at.b_point(x))] {
        for face in faces.iter().filter(|f| **f != NO_FACE && (**f as usize) < solid.faces.len()) {
            if solid.senses[solid.face_owner[*face as usize] as usize] == Sense::Positive {
                hints.push(Hint { side, id: LiteralId::new(*face, Sense::Positive), point });
            }
        }
    }
    hints
}

impl Task<'_> {
    /// The point of a curved face at which the tangent belonging to `point` touches it. On an axis or at a centre any
    /// direction will do, and which one was taken a checker could not know.
    fn touched(&self, (side, id): Key, point: DVec3) -> DVec3 {
        let face = &(if side == Side::A { self.a } else { self.b }).faces[id.face() as usize];
        let normal = face.at(point).normal;
        face.foot(point, normal, self.scale)
    }
}

/// A cell yet to be proven.
struct Open {
    region: Aabb,
    t: f64,
    /// The instant t = 0 is excluded already.
    started: bool,
    a: Vec<Token>,
    b: Vec<Token>,
    reach: f64,
}

struct Maker<'a> {
    task: &'a Task<'a>,
    end: f64,
    /// Cells of this radius or less may be left.
    left: f64,
    /// Cells are halved across their longest side before one of them gets thin.
    compact: bool,
    hints: &'a [Hint],
    scratch: &'a mut clause::Scratch,
}

impl<'a> Maker<'a> {
    fn cell(&mut self, mut open: Open) -> (CellProof, [Option<Open>; 2]) {
        let mut proof = CellProof::default();
        let (center, half) = (open.region.center(), open.region.half() * SWELL);
        // What is settled for the rest of the time: A's literals stand still, B's sweep over all of it.
        let mut kept = [Vec::new(), Vec::new()];
        for (side, tokens, out) in [(Side::A, &open.a, 0), (Side::B, &open.b, 1)] {
            if tokens.is_empty() {
                continue;
            }
            let (mut used, view) = (Vec::new(), self.at(open.t, self.end - open.t, center, half));
            let view = view.view();
            let solid = if side == Side::A { self.task.a } else { self.task.b };
            let truth = falsify_opened(solid, tokens, &mut kept[out], &mut used, &mut |id| view.truth(side, id));
            // B's points of tangency are those at the beginning.
            let center = if side == Side::A { center } else { view.center_b };
            let point = |id: LiteralId| self.task.touched((side, id), center);
            if truth == Truth::False {
                proof.never = used.into_iter().map(|id| ((side, id), point(id))).collect();
                return (proof, [None, None]);
            }
            if truth == Truth::True && side == Side::B {
                // Only known over the span: asked again there.
                kept[out] = tokens.clone();
                continue;
            }
            proof.never.extend(used.into_iter().map(|id| ((side, id), point(id))));
        }
        [open.a, open.b] = kept;
        let mut cost;
        loop {
            let t = open.t;
            if open.a.is_empty() && (t > 0.0 || open.started) {
                proof.rest = Rest::Inside;
                return (proof, [None, None]);
            }
            let left = self.end - t;
            let instant = t == 0.0 && !open.started && open.a.is_empty();
            let (h, close, dt);
            (h, close, dt, cost) = self.span(&open, if instant { 0.0 } else { left }, center, half);
            let Some(close) = close else { break };
            let until = if dt >= left { self.end } else { t + dt };
            if until <= t && !(instant || left == 0.0 || (t == 0.0 && !open.started && dt == 0.0)) {
                break;
            }
            proof.spans.push(Span { until, close });
            open.started = true;
            open.reach = if dt >= h { open.reach * 2.0 } else { (open.reach * 0.5).max(0.5) };
            open.t = until;
            if until >= self.end {
                return (proof, [None, None]);
            }
        }
        if half.length() <= self.left {
            proof.rest = Rest::Left;
            return (proof, [None, None]);
        }
        // Halves along the axis that costs most.
        let dearest = clause::axis_to_halve(cost, half);
        let longest = half.max_position();
        let k = if self.compact && half[dearest] * SLAB < half[longest] { longest } else { dearest };
        proof.rest = Rest::Split(k, center[k]);
        let child = |low: bool| {
            let mut region = open.region;
            if low {
                region.max[k] = center[k]
            } else {
                region.min[k] = center[k]
            }
            let (a, b) = (open.a.clone(), open.b.clone());
            Some(Open { region, t: open.t, started: open.started, a, b, reach: open.reach })
        };
        let children = [child(true), child(false)];
        (proof, children)
    }

    /// How far the cell is free from `open.t`, at most for `end`: (length looked at, what closes it, time, costs).
    fn span(&mut self, open: &Open, end: f64, center: DVec3, half: DVec3) -> (f64, Option<Vec<Vec<Term>>>, f64, DVec3) {
        let placed = self.at(open.t, end, center, half);
        let radius = half.length();
        let whole = placed.motion.speed * end;
        let h = if whole > open.reach * radius { open.reach * radius / placed.motion.speed } else { end };
        let placed = self.at(open.t, h, center, half);
        let view = placed.view();
        let started = open.t > 0.0 || open.started;
        let (mut b, mut used) = (Vec::new(), Vec::new());
        let truth = falsify_opened(self.task.b, &open.b, &mut b, &mut used, &mut |id| view.truth(Side::B, id));
        let singles: Vec<Vec<Term>> = used
            .iter()
            .map(|id| {
                let point = self.task.touched((Side::B, *id), view.center_b);
                vec![Term { literal: (Side::B, *id), other: None, lambda: [1.0; 2], point }]
            })
            .collect();
        match truth {
            Truth::False => return (h, Some(thinned(singles, &open.a, &open.b)), h, DVec3::ZERO),
            Truth::True if started => return (h, Some(Vec::new()), h, DVec3::ZERO),
            _ => {}
        }
        if open.a.is_empty() && b.is_empty() {
            return (h, None, 0.0, DVec3::ZERO);
        }
        let mut pool = open.a.clone();
        let split = pool.len() as u32;
        pool.extend_from_slice(&b);
        let pair = clause::Expressions { pool: &pool, a: (0, split), b: (split, pool.len() as u32) };
        if let Some(record) = &mut self.scratch.record {
            record.clear();
        }
        let found = enumeration::advance(&view, &pair, self.hints, self.task.rounding, 0.0, self.scratch);
        // What parts hold that are not written out is in smaller cells, whatever the bound is short of.
        let cost = if pool.iter().any(|t| local::is_part(*t)) { DVec3::ZERO } else { found.cost };
        if found.dt < 0.0 {
            return (h, None, 0.0, cost);
        }
        let gain = found.cost.element_sum().min(radius);
        let enough = found.dt >= h || found.dt * placed.motion.speed >= 0.25 * gain || found.dt >= 0.25 * end;
        if !enough {
            return (h, None, 0.0, cost);
        }
        let dt = if found.dt >= h { h } else { found.dt * HASTE };
        let proofs: &[Proof] = self.scratch.record.as_deref().unwrap_or_default();
        let mut close = singles;
        for proof in proofs.iter().filter(|p| p.dt >= dt) {
            let touched = |t: &Term| match t.other {
                Some(_) => *t,
                None => Term { point: self.task.touched(t.literal, t.point), ..*t },
            };
            close.push(proof.until(dt).iter().map(touched).collect());
        }
        (h, Some(thinned(close, &open.a, &open.b)), dt, cost)
    }

    fn at(&self, t: f64, h: f64, center: DVec3, half: DVec3) -> PlacedTree<'a> {
        let at = self.task.relative.at(t);
        let x_max = (center - at.center_a).length() + half.length();
        PlacedTree { task: self.task, at, motion: self.task.relative.bounds(t, h, x_max), center, half }
    }
}

/// What a view is made of.
struct PlacedTree<'a> {
    task: &'a Task<'a>,
    at: crate::motion::Instant,
    motion: crate::motion::Bounds,
    center: DVec3,
    half: DVec3,
}

impl PlacedTree<'_> {
    fn view(&self) -> View<'_> {
        View {
            wall: self.task.delta * (WALL / DEPTH),
            multipliers: true,
            curved: false,
            ..self.task.view((self.center, self.half), &self.at, self.motion, &[])
        }
    }
}

/// `local::prune` that also tells which false literals it took: of a false *and* only one operand's.
fn falsify(
    tokens: &[Token],
    out: &mut Vec<Token>,
    used: &mut Vec<LiteralId>,
    classify: &mut dyn FnMut(LiteralId) -> Truth,
) -> Truth {
    let (kind, body) = match local::first(tokens).0 {
        Expression::Part(id) => {
            out.push(local::part_token(id));
            return Truth::Open;
        }
        Expression::Literal(id) => {
            let truth = classify(id);
            match truth {
                Truth::Open => out.push(local::literal_token(id)),
                Truth::False => used.push(id),
                Truth::True => {}
            }
            return truth;
        }
        Expression::And(body) => (AND, body),
        Expression::Or(body) => (OR, body),
    };
    let mark = used.len();
    local::fold(kind, items(body), out, |item, out| {
        let before = used.len();
        let truth = falsify(item, out, used, classify);
        match truth {
            Truth::False if kind == AND => drop(used.drain(mark..before)),
            Truth::True if kind == OR => used.truncate(mark),
            Truth::True => used.truncate(before),
            _ => {}
        }
        truth
    })
}

/// The same, with the parts of large meshes written out where few are left.
fn falsify_opened(
    solid: &Solid,
    tokens: &[Token],
    out: &mut Vec<Token>,
    used: &mut Vec<LiteralId>,
    classify: &mut dyn FnMut(LiteralId) -> Truth,
) -> Truth {
    let truth = falsify(tokens, out, used, classify);
    if truth != Truth::Open || !solid.has_few_parts(out) {
        return truth;
    }
    let mut written = Vec::new();
    match solid.written_out(&std::mem::take(out), &mut written) {
        Truth::Open => falsify(&written, out, used, classify),
        known => known,
    }
}

/// The operands in the body of an operator, heads included.
fn items(mut body: &[Token]) -> impl Iterator<Item = &[Token]> {
    std::iter::from_fn(move || {
        let (item, rest) = (!body.is_empty()).then(|| body.split_at(local::first(body).1))?;
        body = rest;
        Some(item)
    })
}

/// Leaves out combinations without which the expressions are still closed.
fn thinned(mut close: Vec<Vec<Term>>, a: &[Token], b: &[Token]) -> Vec<Vec<Term>> {
    if close.len() > MAX_THINNED {
        return close;
    }
    let mut i = close.len();
    while i > 0 && close.len() > 1 {
        i -= 1;
        let one = close.remove(i);
        if !closed(&close, a, b) {
            close.insert(i, one);
        }
    }
    close
}

/// True when every clause of the expressions holds all literals of some combination.
fn closed(close: &[Vec<Term>], a: &[Token], b: &[Token]) -> bool {
    let groups: Vec<Vec<Key>> =
        close.iter().map(|g| g.iter().flat_map(|t| [Some(t.literal), t.other]).flatten().collect()).collect();
    let mut state = Closing { groups: &groups, literals: Vec::new(), ors: Vec::new(), left: 10_000 };
    state.take(Side::A, a);
    state.take(Side::B, b);
    state.run()
}

struct Closing<'a> {
    groups: &'a [Vec<Key>],
    literals: Vec<Key>,
    ors: Vec<(Side, &'a [Token])>,
    left: u32,
}

impl<'a> Closing<'a> {
    fn take(&mut self, side: Side, tokens: &'a [Token]) {
        for item in items(tokens) {
            match local::first(item).0 {
                Expression::Literal(id) => self.literals.push((side, id)),
                Expression::Part(_) => {}
                Expression::And(body) => self.take(side, body),
                Expression::Or(body) => self.ors.push((side, body)),
            }
        }
    }

    fn run(&mut self) -> bool {
        if self.groups.iter().any(|g| g.iter().all(|k| self.literals.contains(k))) {
            return true;
        }
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        let known = |side: Side, item: &[Token]| {
            local::literals(item).any(|id| self.groups.iter().any(|g| g.contains(&(side, id))))
        };
        let useful = |(side, body): &(Side, &[Token])| items(body).all(|item| known(*side, item));
        let Some(pick) =
            (0..self.ors.len()).filter(|i| useful(&self.ors[*i])).min_by_key(|i| items(self.ors[*i].1).count())
        else {
            return false;
        };
        let (side, body) = self.ors.swap_remove(pick);
        let (literals, ors) = (self.literals.len(), self.ors.clone());
        let all = items(body).all(|item| {
            self.take(side, item);
            let done = self.run();
            self.literals.truncate(literals);
            self.ors.clone_from(&ors);
            done
        });
        self.ors.push((side, body));
        all
    }
}

impl Certificate {
    /// The certificate as text; `a` and `b` are the indices of the query's objects in the scene. Format:
    /// docs/certificate.md.
    pub fn write(&self, (a, b): (usize, usize), out: &mut String) {
        let (r, reference) = (&self.root, if self.swapped { b } else { a });
        let _ = writeln!(
            out,
            "pair {a} {b} reference {reference} depth {:e} until {:e} cells {} box {}",
            self.depth,
            self.until,
            self.cells.len(),
            numbers(&[r.min, r.max])
        );
        if let Some((t, x)) = self.witness {
            let _ = writeln!(out, "witness {t:e} {}", numbers(&[x]));
        }
        for cell in &self.cells {
            for (key, point) in &cell.never {
                let _ = writeln!(out, "never {} {}", name(key), numbers(&[*point]));
            }
            for span in &cell.spans {
                let _ = write!(out, "until {:e}", span.until);
                for group in &span.close {
                    let _ = write!(out, " |");
                    for term in group {
                        let [from, to] = term.lambda;
                        let _ = match &term.other {
                            Some(other) => {
                                let (p, q) = (name(&term.literal), name(other));
                                write!(out, " fit {p} {q} {from:e} {to:e} {}", numbers(&[term.point]))
                            }
                            None => {
                                write!(out, " {} {from:e} {to:e} {}", name(&term.literal), numbers(&[term.point]))
                            }
                        };
                    }
                }
                out.push('\n');
            }
            let _ = match cell.rest {
                Rest::Done => writeln!(out, "done"),
                Rest::Inside => writeln!(out, "inside"),
                Rest::Left => writeln!(out, "left"),
                Rest::Split(k, at) => writeln!(out, "split {} {at:e}", ["x", "y", "z"][k]),
            };
        }
    }
}

fn name((side, id): &Key) -> String {
    let sign = if id.sense() == Sense::Positive { '+' } else { '-' };
    format!("{}{sign}{}", if *side == Side::A { 'a' } else { 'b' }, id.face())
}

fn numbers(points: &[DVec3]) -> String {
    let all: Vec<String> = points.iter().flat_map(|p| p.to_array()).map(|v| format!("{v:e}")).collect();
    all.join(" ")
}

/// The first line of every certificate.
pub const HEADER: &str = "contactd-certificate 2";
