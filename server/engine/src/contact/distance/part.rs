//! A part of a body: a box, what is left of the tree in it, and convex sets that hold all of it.
//!
//! A part's tree is an *and* of literals and of alternatives. Its literals alone say what holds everything of it, alternatives
//! being left out: planes around (`hull`), and spines of round faces (`spines`).
//!
//! * A convex face's tangents hold it: psi(x) >= psi(y) + g·(x − y) for every y.
//! * Of a subtracted face −psi <= 0, and psi rises above its tangent at c by k D²/(2ρ) at most within D of c; a face that is not
//!   convex falls below it by no more than its `dip`.
//!
//! Parts are kept in one list and taken apart at most once in each way: many pairs of parts have one in common.

use super::polytope::Polytope;
use crate::math::Aabb;
use crate::octree::span::face_span;
use crate::solid::local::{self, Expression, LiteralId, Token, Truth};
use crate::solid::surface::{Spine, Under};
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;
use smallvec::SmallVec;
use std::collections::HashMap;

/// Tangents that a curved face is given at first.
const TANGENTS: usize = 10;
/// Where no corner is farther outside of a face than this part of the hull's size, no more of its tangents are taken at first.
const CLOSE: f64 = 0.02;
/// A plane of a face that is flatter than this is not taken: what rounding may do to it is divided by its slope.
const LEAST_SLOPE: f64 = 1e-3;
/// Planes kept free for what candidates ask for.
const SPARE_PLANES: u32 = 24;

/// A literal's value and gradient as if it were psi <= 0.
pub fn literal_at(face: &Face, sense: Sense, x: DVec3) -> (f64, DVec3) {
    let at = face.at(x);
    if sense == Sense::Positive { (at.value, at.normal) } else { (-at.value, -at.normal) }
}

/// How a part may be taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cut {
    /// Its box halved across an axis.
    Halves(usize),
    /// One alternative after the other of its group of that number.
    Alternatives(usize),
}

/// See the module's head.
#[derive(Debug)]
pub struct Part {
    /// Box of its points, the model's frame.
    pub aabb: Aabb,
    /// What the tree depends on in it; nothing where all of the box is inside.
    pub tokens: Vec<Token>,
    /// The literals that all its points satisfy.
    pub literals: SmallVec<[LiteralId; 8]>,
    /// Its groups of alternatives, each a stretch of its tokens; of large meshes parts that are not written out.
    pub groups: SmallVec<[(usize, usize); 4]>,
    /// A polytope around it.
    pub hull: Polytope,
    /// Spines of its round faces: each holds all of it.
    pub spines: SmallVec<[Spine; 2]>,
    cut: HashMap<Cut, Vec<u32>>,
}

/// All parts of one body that were made.
#[derive(Debug)]
pub struct Parts<'a> {
    /// The body's solid.
    pub solid: &'a Solid,
    /// What rounding may do to a face's tangent, a length.
    rounding: f64,
    all: Vec<Part>,
}

impl std::ops::Index<u32> for Parts<'_> {
    type Output = Part;

    fn index(&self, part: u32) -> &Part {
        &self.all[part as usize]
    }
}

impl<'a> Parts<'a> {
    /// The body as one part in a finite box that holds it, or that holds of it what matters; `None` where nothing is in the box.
    pub fn new(solid: &'a Solid, aabb: &Aabb, rounding: f64) -> Option<Self> {
        let mut parts = Self::none(solid, rounding);
        let whole = solid.normal_form.clone();
        parts.add(&whole, *aabb).map(|_| parts)
    }

    /// No parts yet of what is told by literals of a solid.
    pub fn none(solid: &'a Solid, rounding: f64) -> Self {
        Self { solid, rounding, all: Vec::new() }
    }

    fn face(&self, id: LiteralId) -> &'a Face {
        &self.solid.faces[id.face() as usize]
    }

    /// A new part of what of `tokens` is in the finite box; `None` where nothing is.
    pub fn add(&mut self, tokens: &[Token], aabb: Aabb) -> Option<u32> {
        let (mut left, (c, e)) = (Vec::new(), (aabb.center(), aabb.half()));
        if !tokens.is_empty() {
            let truth = |id: LiteralId| local::truth_of(id.sense(), face_span(self.face(id), c, e), 0.0, 0.0);
            if self.solid.prune(tokens, &mut left, &mut { truth }) == Truth::False {
                return None;
            }
        }
        let extent = aabb.min.abs().max(aabb.max.abs()).max_element();
        let hull = Polytope::of_box(&aabb, extent);
        let (literals, groups) = taken_apart(&left);
        let mut part =
            Part { aabb, tokens: left, literals, groups, hull, spines: SmallVec::new(), cut: HashMap::new() };
        self.surround(&mut part);
        if part.hull.is_empty() {
            return None;
        }
        part.aabb = part.hull.aabb().grown(part.hull.outward()).intersection(&aabb);
        part.spines = part.literals.iter().filter_map(|id| self.spine(*id, &part)).collect();
        self.all.push(part);
        Some(self.all.len() as u32 - 1)
    }

    fn spine(&self, id: LiteralId, part: &Part) -> Option<Spine> {
        (id.sense() == Sense::Positive).then(|| self.face(id).spine(&part.hull.corners)).flatten()
    }

    /// Cuts a part's hull with planes of its literals.
    fn surround(&self, part: &mut Part) {
        let literals = part.literals.clone();
        // Flat ones first: they leave less to be looked at.
        for flat in [true, false] {
            for id in literals.iter().filter(|id| self.face(**id).is_flat() == flat) {
                if part.hull.is_empty() {
                    return;
                }
                if part.hull.takes_more_than(SPARE_PLANES) {
                    self.fit(*id, &mut part.hull);
                }
            }
        }
    }

    /// Planes of one literal around a hull.
    fn fit(&self, id: LiteralId, hull: &mut Polytope) {
        let (face, positive) = (self.face(id), id.sense() == Sense::Positive);
        let middle = hull.aabb().center();
        if face.is_flat() || !(positive && face.is_convex()) {
            self.cut_at(id, middle, hull);
            return;
        }
        let close = CLOSE * hull.aabb().half().length();
        for _ in 0..TANGENTS {
            let each = hull.corners.iter().map(|x| (face.value(*x), *x));
            let Some((most, x)) = each.max_by(|p, q| p.0.total_cmp(&q.0)) else { return };
            if most <= close {
                return;
            }
            self.cut_at(id, x, hull);
        }
    }

    /// Cuts a hull that holds a part with the plane that one of its literals has at a point.
    fn cut_at(&self, id: LiteralId, x: DVec3, hull: &mut Polytope) {
        let face = self.face(id);
        let at = face.at(x);
        let far = || hull.corners.iter().map(|y| (*y - x).length_squared()).fold(0.0, f64::max).sqrt();
        let (normal, value) = match id.sense() {
            Sense::Positive => match if face.is_convex() { None } else { face.under(x, x) } {
                Some(u) => (u.normal, u.value - Under::dip(u.k, u.rho, far())),
                None => (at.normal, at.value),
            },
            Sense::Negative => {
                let bulge = if at.k == 0.0 { 0.0 } else { at.k * off_axis(face, x, hull) / (2.0 * at.rho) };
                (-at.normal, -at.value - bulge)
            }
        };
        let slope = normal.length();
        if slope > LEAST_SLOPE && value.is_finite() {
            let n = normal / slope;
            hull.cut(n, n.dot(x) - (value - self.rounding) / slope);
        }
    }

    /// Cuts a part with the tangent of a convex literal at a point in or near its box: what holds all of the part stays. False where it
    /// takes no more, or the point is so far off that rounding would move the tangent.
    pub fn refine(&mut self, part: u32, id: LiteralId, x: DVec3) -> bool {
        let number = part as usize;
        let part = &self.all[number];
        let mut hull = part.hull.clone();
        if hull.takes_more() && part.aabb.grown(part.aabb.half().length()).contains(x) {
            self.cut_at(id, x, &mut hull);
        }
        let changed = hull.planes() > part.hull.planes();
        self.all[number].hull = hull;
        changed
    }

    /// What a part is taken apart into.
    pub fn cut(&mut self, part: u32, cut: Cut) -> Vec<u32> {
        if let Some(known) = self.all[part as usize].cut.get(&cut) {
            return known.clone();
        }
        let Part { aabb, tokens, groups, .. } = &self.all[part as usize];
        let (aabb, tokens, groups) = (*aabb, tokens.clone(), groups.clone());
        let made: Vec<u32> = match cut {
            Cut::Halves(axis) => {
                let middle = aabb.center()[axis];
                let (mut low, mut high) = (aabb, aabb);
                (low.max[axis], high.min[axis]) = (middle, middle);
                [low, high].into_iter().filter_map(|half| self.add(&tokens, half)).collect()
            }
            Cut::Alternatives(group) => {
                let (from, to) = groups[group];
                let body = &tokens[from + 1..to];
                let mut made = Vec::new();
                let mut at = 0;
                while at < body.len() {
                    let n = local::first(&body[at..]).1;
                    let mut all = Vec::new();
                    let rest = operands_but(&tokens, (from, to));
                    local::write_and(rest.into_iter().chain([&body[at..at + n]]), &mut all);
                    made.extend(self.add(&all, aabb));
                    at += n;
                }
                made
            }
        };
        self.all[part as usize].cut.insert(cut, made.clone());
        made
    }

    /// f of a group of a part at a point; `None` where that is a large mesh's part.
    pub fn group_value(&self, part: &Part, group: usize, x: DVec3) -> Option<f64> {
        let (from, to) = part.groups[group];
        let v = local::value(&part.tokens[from..to], &mut |f| self.solid.faces[f as usize].value(x));
        (!v.is_nan()).then_some(v)
    }

    /// How many alternatives a group has; `None` where it has parts of a mesh among them.
    pub fn alternatives(&self, part: &Part, group: usize) -> Option<usize> {
        let (from, to) = part.groups[group];
        match local::first(&part.tokens[from..to]).0 {
            Expression::Or(body) => Some(local::operands(body).count()),
            Expression::And(_) | Expression::Literal(_) | Expression::Part(_) => None,
        }
    }
}

/// The largest square of the distance of a hull's corners from a point, across the lines that a face is straight along.
fn off_axis(face: &Face, x: DVec3, hull: &Polytope) -> f64 {
    let axis = face.developable().unwrap_or(DVec3::ZERO);
    let across = |y: &DVec3| {
        let d = *y - x;
        (d - axis * d.dot(axis)).length_squared()
    };
    hull.corners.iter().map(across).fold(0.0, f64::max)
}

/// The literals that stand in an expression's top *and*, and the stretches of its other operands.
type Top = (SmallVec<[LiteralId; 8]>, SmallVec<[(usize, usize); 4]>);

fn taken_apart(tokens: &[Token]) -> Top {
    let (mut literals, mut groups): Top = Default::default();
    if tokens.is_empty() {
        return (literals, groups);
    }
    let (mut at, end) = match local::first(tokens).0 {
        Expression::And(body) => (tokens.len() - body.len(), tokens.len()),
        Expression::Or(_) | Expression::Literal(_) | Expression::Part(_) => (0, tokens.len()),
    };
    while at < end {
        let (e, n) = local::first(&tokens[at..]);
        match e {
            Expression::Literal(id) => literals.push(id),
            Expression::And(_) | Expression::Or(_) | Expression::Part(_) => groups.push((at, at + n)),
        }
        at += n;
    }
    (literals, groups)
}

/// The operands of an expression's top *and* but the one in a stretch.
fn operands_but(tokens: &[Token], without: (usize, usize)) -> Vec<&[Token]> {
    let mut at = match local::first(tokens).0 {
        Expression::And(body) => tokens.len() - body.len(),
        Expression::Or(_) | Expression::Literal(_) | Expression::Part(_) => 0,
    };
    let mut all = Vec::new();
    while at < tokens.len() {
        let n = local::first(&tokens[at..]).1;
        if (at, at + n) != without {
            all.push(&tokens[at..at + n]);
        }
        at += n;
    }
    all
}
