//! Checks a certificate (docs/certificate.md) without any of the server's bounds: the text, the solids and their motion
//! in, an error or what was checked out.
//!
//! What is proven when it accepts: the box holds every point of the reference body at the certificate's depth; over it and
//! [0, until] no point is at that depth in both bodies at t = 0, and none is at exactly that depth in both afterwards.
//! The first contact would be on both surfaces (a point strictly inside one body that just reaches the depth in the
//! other reached it before, carried along by the other), so none is there. Each combination of literals is bounded by
//! interval arithmetic (`bound`), and each cell's expression, taken from the tree by code of its own, has no clause left.
//! sqrt and the four operations are the hardware's; sin and cos are series of their own. Boxes of placed primitives are
//! not taken from the server either.

pub mod bound;
pub mod form;
pub mod interval;
pub mod memory;
pub mod motion;
pub mod norm;
pub mod tangent;

use crate::formula::{Formula, formula_of};
use bound::{Bounder, Literal, Region, Term};
use contactd::motion::Placed;
use contactd::solid::primitive::{Geometry, HalfSpace};
use contactd::solid::{Node, NodeId, Op, Shape, Solid};
use glam::DVec3;
use interval::{Interval, vector};
use motion::Motions;

/// What was checked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Checked {
    /// No contact before this time.
    pub until: f64,
    /// Depth of the contacts that are excluded.
    pub depth: f64,
    /// Cells.
    pub cells: u64,
    /// Spans of time.
    pub spans: u64,
    /// Combinations of literals.
    pub combinations: u64,
    /// Interval evaluations.
    pub evaluations: u64,
    /// When the witness is at the depth in both bodies, if there is one.
    pub witness: Option<f64>,
}

/// How the error begins of a combination that the checker's budget did not suffice for.
pub const UNSHOWN: &str = "a combination is not shown within the budget";

/// Part of the depth that a witness must reach for certain: it is a point found by descent, in doubles.
const WITNESS: f64 = 0.99;

/// An and/or-tree of literals.
#[derive(Clone, Debug)]
enum Expr {
    One(Literal),
    And(Vec<Expr>),
    Or(Vec<Expr>),
}

fn expression(solid: &Solid, node: NodeId, negative: bool, on_b: bool) -> Expr {
    match &solid.nodes[node as usize] {
        Node::Empty if negative => Expr::And(vec![]),
        Node::Empty => Expr::Or(vec![]),
        Node::Primitive(p) => {
            let p = &solid.primitives[*p as usize];
            of_formula(&formula_of(p), negative, &|face, negative| Literal {
                on_b,
                face: p.first_face + face,
                negative,
            })
        }
        Node::Op(op, children) => {
            let flips = |i: usize| *op == Op::Difference && i > 0;
            let all =
                children.iter().enumerate().map(|(i, c)| expression(solid, *c, negative != flips(i), on_b)).collect();
            if (*op == Op::Union) != negative { Expr::Or(all) } else { Expr::And(all) }
        }
    }
}

fn of_formula(e: &Formula, negative: bool, literal: &dyn Fn(u32, bool) -> Literal) -> Expr {
    let many = |all: &[Formula]| all.iter().map(|e| of_formula(e, negative, literal)).collect();
    match e {
        Formula::One(face, flipped) => Expr::One(literal(*face, negative != *flipped)),
        Formula::And(all) if negative => Expr::Or(many(all)),
        Formula::Or(all) if negative => Expr::And(many(all)),
        Formula::And(all) => Expr::And(many(all)),
        Formula::Or(all) => Expr::Or(many(all)),
    }
}

/// What is left when some literals never hold; `None` when nothing can.
fn without(e: &Expr, never: &[Literal]) -> Option<Expr> {
    match e {
        Expr::One(l) => (!never.contains(l)).then(|| e.clone()),
        Expr::And(all) => {
            let left: Option<Vec<Expr>> = all.iter().map(|e| without(e, never)).collect();
            left.map(Expr::And)
        }
        Expr::Or(all) => {
            let left: Vec<Expr> = all.iter().filter_map(|e| without(e, never)).collect();
            (!left.is_empty()).then_some(Expr::Or(left))
        }
    }
}

fn any_literal(e: &Expr, f: &dyn Fn(&Literal) -> bool) -> bool {
    match e {
        Expr::One(l) => f(l),
        Expr::And(all) | Expr::Or(all) => all.iter().any(|e| any_literal(e, f)),
    }
}

/// True when every clause holds all literals of some group.
struct Closing<'a> {
    groups: &'a [Vec<Literal>],
    literals: Vec<Literal>,
    ors: Vec<&'a [Expr]>,
    left: u32,
}

impl<'a> Closing<'a> {
    fn take(&mut self, e: &'a Expr) {
        match e {
            Expr::One(l) => self.literals.push(*l),
            Expr::And(all) => all.iter().for_each(|e| self.take(e)),
            Expr::Or(all) => self.ors.push(all),
        }
    }

    fn closed(&mut self) -> bool {
        if self.groups.iter().any(|g| g.iter().all(|l| self.literals.contains(l))) {
            return true;
        }
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        // Alternatives without a literal of any group cannot be closed by taking them.
        let known = |e: &Expr| any_literal(e, &|l| self.groups.iter().any(|g| g.contains(l)));
        let useful = (0..self.ors.len()).filter(|i| self.ors[*i].iter().all(known));
        let Some(pick) = useful.min_by_key(|i| self.ors[*i].len()) else { return false };
        let alternatives = self.ors.swap_remove(pick);
        let (literals, ors) = (self.literals.len(), self.ors.clone());
        alternatives.iter().all(|e| {
            self.take(e);
            let done = self.closed();
            self.literals.truncate(literals);
            self.ors.clone_from(&ors);
            done
        })
    }
}

/// A cell to be checked next.
struct Cell {
    region: [(f64, f64); 3],
    t: f64,
    started: bool,
    a: Option<Expr>,
    b: Option<Expr>,
}

/// Checks the certificate of the pair (first, second) of a scene, indices `names`. The text is one pair's part: the line
/// that begins with "pair" and all lines up to the next such line.
///
/// # Errors
/// The first thing that is not certain, by line.
pub fn check(
    text: &str,
    names: (usize, usize),
    first: (&Solid, &Placed),
    second: (&Solid, &Placed),
) -> Result<Checked, String> {
    check_within(bound::BUDGET, text, names, first, second)
}

/// The same with a budget of its own for each combination: how many boxes it may be halved into before it counts as `UNSHOWN`.
///
/// # Errors
/// The first thing that is not certain, by line.
pub fn check_within(
    budget: u64,
    text: &str,
    names: (usize, usize),
    first: (&Solid, &Placed),
    second: (&Solid, &Placed),
) -> Result<Checked, String> {
    let checked = check_cells(budget, text, names, (first, second), None)?;
    if checked.depth > 0.0 { Ok(checked) } else { Err("line 1: depth out of range".into()) }
}

/// The same where the depth may be negative: no point is then within that distance of both bodies, as f measures it.
fn check_level(
    text: &str,
    names: (usize, usize),
    first: (&Solid, &Placed),
    second: (&Solid, &Placed),
) -> Result<Checked, String> {
    check_cells(bound::BUDGET, text, names, (first, second), None)
}

/// The same but for the cells that are left, where that is allowed: their boxes (frame of the reference body) are listed.
fn check_cells(
    budget: u64,
    text: &str,
    names: (usize, usize),
    (first, second): ((&Solid, &Placed), (&Solid, &Placed)),
    mut left: Option<&mut Vec<[(f64, f64); 3]>>,
) -> Result<Checked, String> {
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.split(' ').collect::<Vec<_>>())).peekable();
    let (_, head) = lines.next().ok_or("empty certificate")?;
    let [_, a, b, _, reference, _, depth, _, until, _, cells, _, corners @ ..] = head.as_slice() else {
        return Err("line 1: not the head of a pair".into());
    };
    let index = |s: &str| s.parse::<usize>().map_err(|_| format!("line 1: {s:?} is no index"));
    if (index(a)?, index(b)?) != names {
        return Err("line 1: another pair".into());
    }
    let swapped = match index(reference)? {
        c if c == names.0 => false,
        c if c == names.1 => true,
        _ => return Err("line 1: the reference is none of the pair".into()),
    };
    let (reference, other) = if swapped { (second, first) } else { (first, second) };
    let (depth, until, count) = (number(depth)?, number(until)?, index(cells)?);
    if !(depth != 0.0 && (0.0..=1.0).contains(&until)) {
        return Err("line 1: depth or time out of range".into());
    }
    let mut checked = Checked { until, depth, ..Checked::default() };
    if reference.0.is_void() || other.0.is_void() {
        return Ok(checked);
    }
    let corners: Vec<f64> = corners.iter().map(|s| number(s)).collect::<Result<_, _>>()?;
    let [x0, y0, z0, x1, y1, z1] = corners.as_slice() else { return Err("line 1: a box has six numbers".into()) };
    let root = [(*x0, *x1), (*y0, *y1), (*z0, *z1)];
    if !holds_solid(&root, reference.0, (-depth).max(0.0)) {
        return Err("line 1: the box does not hold the reference".into());
    }
    let motions = Motions::new(reference.1, other.1);
    let mut bounder = Bounder { a: reference.0, b: other.0, motions, depth, evaluations: 0, budget, exhausted: false };
    let a = expression(reference.0, reference.0.root, false, false);
    let b = expression(other.0, other.0.root, false, true);
    if let Some((line, words)) = lines.next_if(|(_, words)| words[0] == "witness") {
        let numbers: Vec<f64> = words[1..].iter().map(|s| number(s)).collect::<Result<_, _>>()?;
        let [t, x, y, z] = numbers.as_slice() else { return Err(format!("line {line}: witness: time and point")) };
        bounder.depth = WITNESS * depth;
        let region = Region([(*x, *x), (*y, *y), (*z, *z), (*t, *t)]);
        let within = (until..=1.0).contains(t);
        if !within || !certain(&mut bounder, &a, region) || !certain(&mut bounder, &b, region) {
            return Err(format!("line {line}: the witness is not at the depth in both bodies"));
        }
        bounder.depth = depth;
        checked.witness = Some(*t);
    }
    let mut stack = vec![Cell { region: root, t: 0.0, started: false, a: Some(a), b: Some(b) }];
    while let Some(mut cell) = stack.pop() {
        let end = format!("the certificate ends with cells missing (of {count})");
        checked.cells += 1;
        let mut never: Vec<Literal> = Vec::new();
        let place = cell.region;
        loop {
            let (line, words) = lines.next().ok_or(end.clone())?;
            let wrong = |what: &str| Err(format!("line {line}: {what}"));
            let region = |from: f64, to: f64| {
                let [x, y, z] = place;
                Region([x, y, z, (from, to)])
            };
            match words[0] {
                "never" => {
                    let [_, name, x, y, z] = words.as_slice() else { return wrong("never: literal and point") };
                    let term = Term {
                        literal: literal(name)?,
                        other: None,
                        lambda: [1.0; 2],
                        point: DVec3::new(number(x)?, number(y)?, number(z)?),
                    };
                    checked.combinations += 1;
                    if !bounder.excludes(&[term], region(cell.t, until)) {
                        return wrong("the literal may hold");
                    }
                    never.push(term.literal);
                    continue;
                }
                "until" => {
                    settle(&mut cell, &mut never);
                    checked.spans += 1;
                    let to = number(words.get(1).unwrap_or(&""))?;
                    if !(to >= cell.t && to <= until && (to > cell.t || !cell.started)) {
                        return wrong("the span is out of order");
                    }
                    let groups = combinations(&words[2..])?;
                    let span = region(cell.t, to);
                    if groups.is_empty() {
                        let inside = cell.b.as_ref().is_some_and(|b| certain(&mut bounder, b, span));
                        if !(cell.started || cell.t > 0.0) || !inside {
                            return wrong("the cell may not lie inside the other body");
                        }
                    } else {
                        for group in &groups {
                            checked.combinations += 1;
                            if !bounder.excludes(group, span) {
                                let why = if bounder.exhausted { UNSHOWN } else { "a combination may hold" };
                                return wrong(&format!("{why}: {group:?} over {span:?}"));
                            }
                        }
                        let keys: Vec<Vec<Literal>> = groups
                            .iter()
                            .map(|g| g.iter().flat_map(|t| [Some(t.literal), t.other]).flatten().collect())
                            .collect();
                        if let (Some(a), Some(b)) = (&cell.a, &cell.b) {
                            let mut closing = Closing { groups: &keys, literals: vec![], ors: vec![], left: 20_000 };
                            closing.take(a);
                            closing.take(b);
                            if !closing.closed() {
                                return wrong("a clause is left open");
                            }
                        }
                    }
                    (cell.t, cell.started) = (to, true);
                    continue;
                }
                _ => {}
            }
            settle(&mut cell, &mut never);
            let absent = cell.a.is_none() || cell.b.is_none();
            match words.as_slice() {
                ["done"] if absent || (cell.started && cell.t == until) => {}
                ["left"] => match &mut left {
                    Some(left) => left.push(cell.region),
                    None => return wrong("a cell is left"),
                },
                ["done"] => return wrong("the cell is not done: time or clauses are left"),
                ["inside"] => {
                    let inside = cell.a.as_ref().is_some_and(|a| certain(&mut bounder, a, region(0.0, 0.0)));
                    if !(cell.started || cell.t > 0.0) || !inside {
                        return wrong("the cell may not lie inside the reference");
                    }
                }
                ["split", axis, at] => {
                    let k = ["x", "y", "z"].iter().position(|n| n == axis).ok_or(format!("line {line}: axis"))?;
                    let at = number(at)?;
                    let (lo, hi) = cell.region[k];
                    if !(lo < at && at < hi) {
                        return wrong("the split is outside the cell");
                    }
                    for half in [(at, hi), (lo, at)] {
                        let mut part = cell.region;
                        part[k] = half;
                        let (a, b) = (cell.a.clone(), cell.b.clone());
                        stack.push(Cell { region: part, t: cell.t, started: cell.started, a, b });
                    }
                }
                _ => return wrong("unknown line"),
            }
            break;
        }
    }
    if lines.next().is_some() || checked.cells != count as u64 {
        return Err("cells are left over or missing".into());
    }
    checked.evaluations = bounder.evaluations;
    Ok(checked)
}

/// Takes what never holds out of a cell's expressions.
fn settle(cell: &mut Cell, never: &mut Vec<Literal>) {
    if !never.is_empty() {
        cell.a = cell.a.as_ref().and_then(|e| without(e, never));
        cell.b = cell.b.as_ref().and_then(|e| without(e, never));
        never.clear();
    }
}

/// True when the expression holds with room all over the region, for certain.
fn certain(bounder: &mut Bounder, e: &Expr, region: Region) -> bool {
    match e {
        Expr::One(l) => bounder.holds(l, region),
        Expr::And(all) => all.iter().all(|e| certain(bounder, e, region)),
        Expr::Or(all) => all.iter().any(|e| certain(bounder, e, region)),
    }
}

fn combinations(words: &[&str]) -> Result<Vec<Vec<Term>>, String> {
    let mut groups = Vec::new();
    for part in words.split(|w| *w == "|").skip(1) {
        let (mut group, mut rest) = (Vec::new(), part);
        while !rest.is_empty() {
            rest = match rest {
                ["fit", p, q, from, to, x, y, z, rest @ ..] => {
                    let lambda = [number(from)?, number(to)?];
                    let point = DVec3::new(number(x)?, number(y)?, number(z)?);
                    group.push(Term { literal: literal(p)?, other: Some(literal(q)?), lambda, point });
                    rest
                }
                [name, from, to, x, y, z, rest @ ..] => {
                    let lambda = [number(from)?, number(to)?];
                    let point = DVec3::new(number(x)?, number(y)?, number(z)?);
                    group.push(Term { literal: literal(name)?, other: None, lambda, point });
                    rest
                }
                _ => return Err("a combination ends early".into()),
            };
        }
        groups.push(group);
    }
    Ok(groups)
}

fn number(s: &str) -> Result<f64, String> {
    s.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| format!("{s:?} is no number"))
}

fn literal(s: &str) -> Result<Literal, String> {
    let bad = || format!("{s:?} is no literal");
    let on_b = match s.get(..1) {
        Some("a") => false,
        Some("b") => true,
        _ => return Err(bad()),
    };
    let negative = match s.get(1..2) {
        Some("+") => false,
        Some("-") => true,
        _ => return Err(bad()),
    };
    Ok(Literal { on_b, negative, face: s[2..].parse().map_err(|_| bad())? })
}

/// A box around all points with f <= `level` below a node: positive primitives as their operations join them.
fn extent(solid: &Solid, node: NodeId, level: f64) -> Option<[Interval; 3]> {
    extent_in(solid, node, level, [Interval::new(f64::NEG_INFINITY, f64::INFINITY); 3])
}

/// How often the operands of an intersection clip each other.
const CLIPS: usize = 2;

/// A box around those points with f <= `level` below a node that lie in a box: what stands beside it in an intersection clips every
/// operand of a union by itself.
fn extent_in(solid: &Solid, node: NodeId, level: f64, clip: [Interval; 3]) -> Option<[Interval; 3]> {
    match &solid.nodes[node as usize] {
        Node::Empty => None,
        Node::Primitive(p) => {
            let own = match &solid.primitives[*p as usize] {
                p if p.shape == Shape::HalfSpace(HalfSpace) => below_plane(&p.frame, level, &clip),
                _ => primitive_box(solid, *p, level),
            };
            let common = std::array::from_fn(|k| (own[k].lo.max(clip[k].lo), own[k].hi.min(clip[k].hi)));
            common.iter().all(|(lo, hi)| lo <= hi).then(|| common.map(|(lo, hi)| Interval::new(lo, hi)))
        }
        Node::Op(Op::Difference, children) => extent_in(solid, children[0], level, clip),
        Node::Op(Op::Union, children) => {
            let each = children.iter().filter_map(|c| extent_in(solid, *c, level, clip));
            each.reduce(|a, b| std::array::from_fn(|k| a[k].hull(b[k])))
        }
        Node::Op(Op::Intersection, children) => {
            (0..CLIPS).flat_map(|_| children).try_fold(clip, |left, c| extent_in(solid, *c, level, left))
        }
    }
}

const EVERYWHERE: Interval = Interval { lo: f64::NEG_INFINITY, hi: f64::INFINITY };

/// True when the box holds all points of the solid with f <= `level`.
fn holds_solid(root: &[(f64, f64); 3], solid: &Solid, level: f64) -> bool {
    let Some(all) = extent(solid, solid.root, level) else { return true };
    (0..3).all(|k| root[k].0 <= all[k].lo && all[k].hi <= root[k].1)
}

/// A box around those points of a box that lie below the plane z = `level` of a frame: as far as the box lets the plane's own
/// coordinates go along the axis that it faces most.
fn below_plane(frame: &contactd_proto::Pose, level: f64, clip: &[Interval; 3]) -> [Interval; 3] {
    let mut all = *clip;
    let n = frame.vector(DVec3::Z);
    let k = n.abs().max_position();
    let d = n.dot(frame.position) + level;
    let others = (0..3).filter(|i| *i != k && n[*i] != 0.0);
    // The least that the others add to n·x, and the sizes of what is added.
    let (least, size) = others.fold((0.0, d.abs()), |(sum, size): (f64, f64), i| {
        let ends = [n[i] * clip[i].lo, n[i] * clip[i].hi];
        (sum + ends[0].min(ends[1]), size + ends[0].abs().max(ends[1].abs()))
    });
    if least.is_finite() {
        let most = d - least + 1e-14 * (size + frame.position.abs().element_sum());
        if n[k] > 0.0 {
            all[k].hi = all[k].hi.min(most / n[k]);
        } else {
            all[k].lo = all[k].lo.max(most / n[k]);
        }
        if all[k].lo > all[k].hi {
            all[k] = Interval { lo: f64::INFINITY, hi: f64::NEG_INFINITY };
        }
    }
    all
}

/// A box around {psi <= level} of a primitive. A convex psi that is −rho at a point grows from there along every ray at least as
/// fast as up to the surface: of a cone and a polyhedron, scaled about such a point by 1 + level/rho, it holds.
fn primitive_box(solid: &Solid, p: u32, level: f64) -> [Interval; 3] {
    let grown = |x: f64| if level > 0.0 { (x + level) * (1.0 + 1e-15) } else { x };
    let scale = |rho: f64| if level > 0.0 { (1.0 + level / rho) * (1.0 + 1e-14) } else { 1.0 };
    let p = &solid.primitives[p as usize];
    let m = p.frame.matrix();
    // Placing a corner and the matrix itself are right to a few units in the last place.
    let reach = p.frame.position.abs().max_element();
    let around = |points: &[DVec3], radius: &dyn Fn(usize) -> f64| -> [Interval; 3] {
        std::array::from_fn(|k| {
            let mut all = Interval::new(f64::INFINITY, f64::NEG_INFINITY);
            for x in points {
                let slack = 1e-14 * (reach + x.length() + radius(k));
                let at = m.row(k).dot(*x) + p.frame.position[k];
                all = all.hull(Interval::new(at - radius(k) - slack, at + radius(k) + slack));
            }
            all
        })
    };
    let axis = m.z_axis;
    let disc = |r: f64| move |k: usize| r * (1.0 - axis[k] * axis[k]).max(0.0).sqrt() + r * 1e-12;
    match &p.shape {
        Shape::Sphere(s) => around(&[DVec3::ZERO], &|_| grown(s.radius)),
        Shape::Cylinder(c) => {
            let end = DVec3::Z * grown(c.half_height);
            around(&[end, -end], &disc(grown(c.radius)))
        }
        Shape::Cone(c) => {
            // The middle of the axis: from the side it is half of both radii, as the side leans.
            let slant = (2.0 * c.half_height).hypot(c.bottom - c.top);
            let k = scale(c.half_height.min((c.bottom + c.top) * c.half_height / slant));
            let top = around(&[DVec3::Z * (k * c.half_height)], &disc(k * c.top));
            let bottom = around(&[-DVec3::Z * (k * c.half_height)], &disc(k * c.bottom));
            std::array::from_fn(|k| top[k].hull(bottom[k]))
        }
        Shape::Cuboid(c) => {
            let sign = |i: u32, bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let corners: Vec<DVec3> =
                (0..8).map(|i| DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2)) * c.half.map(grown)).collect();
            around(&corners, &|_| 0.0)
        }
        Shape::Polyhedron(p) => {
            let middle = p.vertices.iter().sum::<DVec3>() / p.vertices.len() as f64;
            let rho = p.planes.iter().map(|(n, d)| d - n.dot(middle)).fold(f64::INFINITY, f64::min);
            let all: Vec<DVec3> = p.vertices.iter().map(|v| middle + (*v - middle) * scale(rho)).collect();
            around(&all, &|_| 0.0)
        }
        // The planes along its axes that the whole formula is and-ed with.
        Shape::TriangleMesh(m) => {
            let Formula::And(all) = formula_of(p) else { return [EVERYWHERE; 3] };
            let (mut least, mut most) = (DVec3::splat(f64::NEG_INFINITY), DVec3::splat(f64::INFINITY));
            let own = m.faces();
            for e in &all {
                let Formula::One(face, false) = e else { continue };
                let Some((n, d)) = own[*face as usize].flat() else { continue };
                for k in 0..3 {
                    if n == DVec3::AXES[k] {
                        most[k] = most[k].min(grown(d));
                    } else if n == -DVec3::AXES[k] {
                        least[k] = least[k].max(-grown(d));
                    }
                }
            }
            let at = |i: u32, k: usize| if i >> k & 1 == 0 { least[k] } else { most[k] };
            let corners: Vec<DVec3> = (0..8).map(|i| DVec3::new(at(i, 0), at(i, 1), at(i, 2))).collect();
            around(&corners, &|_| 0.0)
        }
        // Its psi is the exact distance.
        Shape::Torus(t) => around(&[DVec3::ZERO], &|k| disc(t.major)(k) + grown(t.minor)),
        Shape::Capsule(c) => around(&[DVec3::Z * c.half, -DVec3::Z * c.half], &|_| grown(c.radius)),
        // |B x| = r + psi, which is r at the end of the shortest semi-axis.
        Shape::Ellipsoid(e) => {
            let k = scale(e.semi.min_element());
            around(&[DVec3::ZERO], &|i| (m.row(i) * e.semi).length() * k * (1.0 + 1e-12))
        }
        // s N = s + psi.
        Shape::Superellipsoid(s) => {
            let k = scale(s.semi.min_element());
            let reach = |i: usize| norm::reach(s.semi, s.exponents, vector(m.row(i).to_array())).hi;
            around(&[DVec3::ZERO], &|i| reach(i) * k * (1.0 + 1e-12))
        }
        // About the middle of its axis as a cone. With n and m the rows of what is a circle on its ends, psi of the side is there no
        // higher than −(mean of both sizes)/√(|n|² + |m|² + slope²).
        Shape::EllipticFrustum(c) => {
            let mean = 0.5 * (c.bottom + c.top);
            let steep = (1.0 + c.lean.x * c.lean.x) / (c.semi.x * c.semi.x)
                + (1.0 + c.lean.y * c.lean.y) / (c.semi.y * c.semi.y)
                + ((c.bottom - c.top) / (2.0 * c.half_height)).powi(2);
            let k = scale(c.half_height.min(mean / steep.sqrt()));
            let end = |z: f64, size: f64| {
                let middle = (c.lean * z).extend(z) * k;
                let rim = |i: usize| {
                    let row = m.row(i);
                    k * size * (row.x * c.semi.x).hypot(row.y * c.semi.y) * (1.0 + 1e-12)
                };
                around(&[middle], &rim)
            };
            let (top, bottom) = (end(c.half_height, c.top), end(-c.half_height, c.bottom));
            std::array::from_fn(|k| top[k].hull(bottom[k]))
        }
        Shape::HalfSpace(_) => [EVERYWHERE; 3],
        Shape::Quadric(q) => match crate::quadrics::checked_box(q, level) {
            Some(held) => around(&held.corners(), &|_| 0.0),
            None => [EVERYWHERE; 3],
        },
    }
}
