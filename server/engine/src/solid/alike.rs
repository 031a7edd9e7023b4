//! Faces of one solid that lie on each other, and what they leave of its tree.
//!
//! Two literals of one solid hold at the same point or not, whatever moves. Where a face stands twice in a tree (A − A, A ∪ A,
//! A ∩ A, at any depth), psi <= −delta and −psi <= −delta contradict each other and the same literal twice is one: the normal
//! form is simplified by that once, when the solid is made (`Alike::simplified`). What has no volume goes, so do operands that
//! say nothing more; nothing that is deep in the solid anywhere changes, since each step is an identity of the sets
//! {psi <= −delta}, delta > 0. Faces and their ids stay; of equals the first in file order does.
//!
//! Faces count as the same where they are so to the bit, or within `SAME` roundings over the solid's ball; what the second kind
//! leaves to rounding is told by `Alike::slack`.
//!
//! Of faces that are not the same `above` bounds how far one psi lies above another: a wall between them of at most
//! twice a depth holds no point of that depth.

use super::local::{self, Expression, LiteralId, Token, Truth};
use super::surface::NUMBERS;
use super::{Face, Faces, Sense};
use crate::math::Aabb;
use glam::DVec3;
use std::cell::RefCell;
use std::collections::HashMap;

/// Units in the last place by which two faces may differ over a solid, beside what rounding hides, and still be the same one.
const SAME: f64 = 16.0;
/// Units in the last place that the computed bound of `above` gives away to rounding.
const LOST: f64 = 32.0;
/// Wall between two curved faces, in radii of the solid, up to which they are kept as near each other.
const NEAR: f64 = 1e-3;
/// Faces that a face is compared with, of those next to it in order.
const MOST_NEIGHBOURS: usize = 256;
/// Tokens that the simplification of one normal form may look at, for each of its own …
const WORK: usize = 64;
/// … and beside that; no more in all, or the formula of a mesh of thousands of facets would take longer than all else.
const LEAST_WORK: usize = 100_000;
const MOST_WORK: usize = 4_000_000;
/// Operands of one operator up to which each is compared with each.
const FEW: usize = 64;

/// The ball in which the faces of a solid matter.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Centre, the solid's frame.
    pub center: DVec3,
    /// Radius; infinite for an unbounded solid.
    pub radius: f64,
}

impl Ball {
    /// The ball round a box.
    pub fn round(aabb: &Aabb) -> Self {
        if aabb.is_empty() {
            return Self { center: DVec3::ZERO, radius: 0.0 };
        }
        let radius = aabb.half().length() * (1.0 + 1e-9);
        if radius.is_finite() {
            Self { center: aabb.center(), radius }
        } else {
            Self { center: DVec3::ZERO, radius: f64::INFINITY }
        }
    }
}

/// Lower bound of psi_p − psi_q over a ball, right after all rounding; `None` for faces of two kinds. A wall {psi_p <= 0 <= psi_q} is
/// at most as thick as the negative of it. Each kind has a formula of its own: `Surface::above`.
pub fn above(p: &Face, q: &Face, ball: &Ball) -> Option<f64> {
    let (c, r) = (ball.center, ball.radius);
    let (value, size) = p.above(q, c, r)?;
    let lost = if p == q { 0.0 } else { LOST * f64::EPSILON * (size + c.length() + r) };
    let least = if p == q { 0.0 } else { value - lost };
    (!least.is_nan()).then_some(least)
}

/// A number that differs by at most a few times what two faces of one kind differ over the ball.
fn key(face: &Face, ball: &Ball) -> (u32, f64) {
    let r = if ball.radius.is_finite() { ball.radius } else { 0.0 };
    (face.rank(), face.key(ball.center, r))
}

/// The bits of a face: what is the same to the bit is one.
fn bits(face: &Face) -> (u32, [u64; NUMBERS]) {
    (face.rank(), face.numbers().map(|v| (v + 0.0).to_bits()))
}

/// What is known of the faces of a solid that lie on or near each other.
#[derive(Clone, Debug, Default)]
pub struct Alike {
    /// Of each face the one that stands for all that are the same; empty where no two are.
    first: Vec<u32>,
    /// Pairs of curved faces, the first positive and the second subtracted, near each other: with `above` of the pair.
    near: Vec<(u32, u32, f64)>,
    /// Pairs with a wall up to this are in `near`, a length.
    reach: f64,
    /// The solid's ball.
    ball: Option<Ball>,
    /// What the faces taken for the same differ by at most, a length; 0 where all are so to the bit.
    pub slack: f64,
}

impl Alike {
    /// Compares the faces of a solid within its box; `senses` are those of the faces. The planes of large meshes are not compared:
    /// what they share with other faces has no volume either way.
    pub fn of(faces: &Faces, senses: impl Fn(u32) -> Sense, aabb: &Aabb) -> Self {
        let ball = Ball::round(aabb);
        let kept = faces.kept().count();
        // Faces that stand for others are kept: beyond the last of those each stands for itself.
        let numbers = faces.kept().last().map_or(0, |(i, _)| i + 1) as u32;
        let mut first: Vec<u32> = (0..numbers).collect();
        let mut seen: HashMap<(u32, [u64; NUMBERS]), u32> = HashMap::with_capacity(kept);
        let mut distinct = Vec::with_capacity(kept);
        let mut any = false;
        for (i, face) in faces.kept() {
            match seen.entry(bits(face)) {
                std::collections::hash_map::Entry::Occupied(e) => (first[i], any) = (*e.get(), true),
                std::collections::hash_map::Entry::Vacant(e) => {
                    e.insert(i as u32);
                    distinct.push(i as u32);
                }
            }
        }
        let (mut near, mut slack) = (Vec::new(), 0.0_f64);
        let reach = if ball.radius.is_finite() { NEAR * ball.radius } else { 0.0 };
        if ball.radius.is_finite() {
            let mut keys: Vec<_> = distinct.iter().map(|f| (key(&faces[*f as usize], &ball), *f)).collect();
            keys.sort_unstable_by(|a, b| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)).then(a.1.cmp(&b.1)));
            let size = ball.center.length() + ball.radius;
            let mut stands_for: Vec<u32> = (0..numbers).collect();
            for i in 0..keys.len() {
                let ((kind, at), f) = keys[i];
                let one = &faces[f as usize];
                let same = SAME * f64::EPSILON * (size + one.reach());
                for &((other_kind, other_at), g) in keys[..i].iter().rev().take(MOST_NEIGHBOURS) {
                    if other_kind != kind || at - other_at > 8.0 * same {
                        break;
                    }
                    // The one that stands for all that are the same: no chains.
                    let g = stands_for[g as usize];
                    let other = &faces[g as usize];
                    let off = |p, q| above(p, q, &ball).map_or(f64::INFINITY, |least| -least);
                    let lost = LOST * f64::EPSILON * (4.0 * size + 2.0 * one.reach());
                    let apart = off(one, other).max(off(other, one));
                    if apart <= same + lost {
                        (stands_for[f as usize], any) = (g, true);
                        slack = slack.max(2.0 * apart);
                        break;
                    }
                }
            }
            first.iter_mut().for_each(|f| *f = stands_for[*f as usize]);
            near = near_pairs(faces, &senses, &ball, reach);
        }
        if !any {
            first.clear();
        }
        Self { first, near, reach, ball: Some(ball), slack }
    }

    /// True where faces lie on each other.
    pub fn any_same(&self) -> bool {
        !self.first.is_empty()
    }

    /// True where two curved faces, one of them subtracted, are near each other.
    pub fn any_near(&self) -> bool {
        !self.near.is_empty()
    }

    /// The walls between near faces: lower bounds of psi_p − psi_q as `wall` tells them.
    pub fn walls(&self) -> impl Iterator<Item = f64> + '_ {
        self.near.iter().map(|n| n.2)
    }

    /// The face that stands for all that are the same as this one.
    fn one(&self, face: u32) -> u32 {
        self.first.get(face as usize).copied().unwrap_or(face)
    }

    /// A literal by the face that stands for all that are the same.
    fn named(&self, id: LiteralId) -> LiteralId {
        LiteralId::new(self.one(id.face()), id.sense())
    }

    /// Lower bound of psi_p − psi_q over the solid, p positive and q subtracted, both curved alike, where it may be above
    /// −2·`delta`, or where they are near each other anyway.
    pub fn wall(&self, faces: &Faces, p: u32, q: u32, delta: f64) -> Option<f64> {
        if let Ok(i) = self.near.binary_search_by(|n| (n.0, n.1).cmp(&(p, q))) {
            return Some(self.near[i].2);
        }
        if 2.0 * delta < self.reach || self.reach == 0.0 {
            return None;
        }
        let (one, other) = (faces.get(p as usize)?, faces.get(q as usize)?);
        if one.is_flat() {
            return None;
        }
        above(one, other, self.ball.as_ref()?).filter(|least| *least > -2.0 * delta)
    }

    /// True where `wall` may know anything at a depth (a length).
    pub fn has_walls(&self, delta: f64) -> bool {
        !self.near.is_empty() || (self.reach > 0.0 && 2.0 * delta >= self.reach)
    }

    /// What is left of a normal form where faces that lie on each other are one.
    pub fn simplified(&self, tokens: &[Token], out: &mut Vec<Token>) -> Truth {
        if self.first.is_empty() || tokens.is_empty() {
            out.extend_from_slice(tokens);
            return if tokens.is_empty() { Truth::True } else { Truth::Open };
        }
        SEATS.with_borrow_mut(|seats| {
            if !self.any_twice(tokens, seats) {
                out.extend_from_slice(tokens);
                return Truth::Open;
            }
            self.simplified_with(seats, tokens, out).0
        })
    }

    /// True where two literals of an expression have faces that are the same; makes room for all faces that it has.
    fn any_twice(&self, tokens: &[Token], seats: &mut Seats) -> bool {
        let mut twice = false;
        seats.next();
        for id in local::literals(tokens) {
            twice |= seats.mark(self.one(id.face()));
        }
        twice
    }

    /// `simplified` of an expression in which faces stand twice, and the tokens that were looked at.
    fn simplified_with(&self, seats: &mut Seats, tokens: &[Token], out: &mut Vec<Token>) -> (Truth, usize) {
        let left = (WORK * tokens.len() + LEAST_WORK).min(MOST_WORK);
        let mut s = Simplifier { alike: self, state: &mut seats.assumed, trail: Vec::new(), left, look: true };
        let mut tree = Tree::of(tokens);
        for _ in 0..4 {
            let before = tree.size();
            tree = s.simplify(tree);
            if tree.size() == before {
                break;
            }
        }
        let looked = left - s.left;
        let truth = match tree {
            Tree::Known(true) => Truth::True,
            Tree::Known(false) => Truth::False,
            tree => {
                tree.write(out);
                Truth::Open
            }
        };
        (truth, looked)
    }
}

/// The pairs of like curved faces with a wall of at most `reach` between them.
fn near_pairs(faces: &Faces, senses: &impl Fn(u32) -> Sense, ball: &Ball, reach: f64) -> Vec<(u32, u32, f64)> {
    let curved = || faces.kept().filter(|(_, face)| !face.is_flat()).map(|(i, _)| i as u32);
    let all = |sense: Sense| curved().filter(|f| senses(*f) == sense).collect::<Vec<_>>();
    let (positive, negative) = (all(Sense::Positive), all(Sense::Negative));
    if positive.is_empty() || negative.is_empty() {
        return Vec::new();
    }
    let mut keys: Vec<_> = negative.iter().map(|f| (key(&faces[*f as usize], ball), *f)).collect();
    keys.sort_unstable_by(|a, b| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)).then(a.1.cmp(&b.1)));
    let mut near = Vec::new();
    for p in positive {
        let (kind, at) = key(&faces[p as usize], ball);
        let from = keys.partition_point(|k| (k.0.0, k.0.1) < (kind, at - 8.0 * reach));
        let within = keys[from..].iter().take_while(|k| k.0.0 == kind && k.0.1 <= at + 8.0 * reach);
        for &(_, q) in within.take(MOST_NEIGHBOURS) {
            if let Some(least) = above(&faces[p as usize], &faces[q as usize], ball)
                && least >= -reach
            {
                near.push((p, q, least));
            }
        }
    }
    near.sort_unstable_by_key(|n| (n.0, n.1));
    near
}

/// An expression with room to change.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Tree {
    Known(bool),
    One(LiteralId),
    /// A part of a large mesh.
    Part(LiteralId),
    /// True for a conjunction.
    Many(bool, Vec<Tree>),
}

impl Tree {
    fn of(tokens: &[Token]) -> Self {
        let all = |body| local::operands(body).map(Self::of_expression).collect();
        match local::first(tokens).0 {
            Expression::Literal(id) => Tree::One(id),
            Expression::And(body) => Tree::Many(true, all(body)),
            Expression::Or(body) => Tree::Many(false, all(body)),
            Expression::Part(id) => Tree::Part(id),
        }
    }

    fn of_expression(e: Expression) -> Self {
        let all = |body| local::operands(body).map(Self::of_expression).collect();
        match e {
            Expression::Literal(id) => Tree::One(id),
            Expression::And(body) => Tree::Many(true, all(body)),
            Expression::Or(body) => Tree::Many(false, all(body)),
            Expression::Part(id) => Tree::Part(id),
        }
    }

    fn size(&self) -> usize {
        match self {
            Tree::Many(_, all) => 1 + all.iter().map(Tree::size).sum::<usize>(),
            _ => 1,
        }
    }

    fn write(&self, out: &mut Vec<Token>) {
        match self {
            Tree::Known(_) => unreachable!("constants are folded away"),
            Tree::One(id) => out.push(local::literal_token(*id)),
            Tree::Part(id) => out.push(local::part_token(*id)),
            Tree::Many(and, all) => {
                let kind = if *and { local::AND } else { local::OR };
                let truth = local::fold(kind, all.iter(), out, |e, out| {
                    e.write(out);
                    Truth::Open
                });
                debug_assert_eq!(truth, Truth::Open);
            }
        }
    }
}

/// What is assumed of a face's literals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Assumed {
    /// psi <= −delta.
    positive: Option<bool>,
    /// −psi <= −delta; never true together with the other.
    negative: Option<bool>,
}

/// What a thread keeps of each face while it simplifies: no formula of a voxel is worth an allocation.
#[derive(Default)]
struct Seats {
    /// By face; nothing is assumed of any between two formulas.
    assumed: Vec<Assumed>,
    /// By face, the last formula that has it.
    seen: Vec<u32>,
    formula: u32,
}

thread_local! {
    static SEATS: RefCell<Seats> = RefCell::default();
}

impl Seats {
    /// Another formula begins.
    fn next(&mut self) {
        if self.formula == u32::MAX {
            (self.formula, self.seen) = (0, Vec::new());
        }
        self.formula += 1;
    }

    /// Notes that the formula has a face; true where that is known.
    fn mark(&mut self, face: u32) -> bool {
        let i = face as usize;
        if i >= self.seen.len() {
            self.seen.resize(i + 1, 0);
            self.assumed.resize(i + 1, Assumed::default());
        }
        std::mem::replace(&mut self.seen[i], self.formula) == self.formula
    }
}

/// Where among the operands of a conjunction each literal stands.
struct Occurrences {
    /// Literals, each face by the first that is the same, and operands, in order.
    all: Vec<(LiteralId, usize)>,
}

impl Occurrences {
    fn of(alike: &Alike, operands: &[Tree]) -> Self {
        fn add(alike: &Alike, e: &Tree, i: usize, all: &mut Vec<(LiteralId, usize)>) {
            match e {
                Tree::Known(_) | Tree::Part(_) => {}
                Tree::One(id) => all.push((alike.named(*id), i)),
                Tree::Many(_, inner) => inner.iter().for_each(|e| add(alike, e, i, all)),
            }
        }
        let mut all = Vec::new();
        operands.iter().enumerate().for_each(|(i, e)| add(alike, e, i, &mut all));
        all.sort_unstable();
        all.dedup();
        Self { all }
    }

    /// The operands that have a literal, of a face that stands for all that are the same.
    fn with(&self, id: LiteralId) -> impl Iterator<Item = usize> + '_ {
        let from = self.all.partition_point(|o| o.0 < id);
        self.all[from..].iter().take_while(move |o| o.0 == id).map(|o| o.1)
    }
}

struct Simplifier<'a> {
    alike: &'a Alike,
    /// By face; all that a formula has are there.
    state: &'a mut [Assumed],
    /// What was assumed before, to be restored.
    trail: Vec<(u32, Assumed)>,
    left: usize,
    /// Alternatives may be tried against what stands beside them.
    look: bool,
}

impl Simplifier<'_> {
    fn known(&self, id: LiteralId) -> Option<bool> {
        let s = &self.state[self.alike.one(id.face()) as usize];
        if id.sense() == Sense::Positive { s.positive } else { s.negative }
    }

    /// Assumes a literal to hold or not, until the trail is taken back.
    fn assume(&mut self, id: LiteralId, holds: bool) {
        let face = self.alike.one(id.face());
        let before = self.state[face as usize];
        let mut s = before;
        let (own, other) = if id.sense() == Sense::Positive {
            (&mut s.positive, &mut s.negative)
        } else {
            (&mut s.negative, &mut s.positive)
        };
        *own = Some(holds);
        if holds {
            *other = Some(false);
        }
        self.trail.push((face, before));
        self.state[face as usize] = s;
    }

    fn back(&mut self, to: usize) {
        while self.trail.len() > to {
            let (face, before) = self.trail.pop().expect("longer than that");
            self.state[face as usize] = before;
        }
    }

    /// What is left of an expression under what is assumed.
    fn simplify(&mut self, e: Tree) -> Tree {
        self.left = self.left.saturating_sub(1);
        match e {
            Tree::Known(_) | Tree::Part(_) => e,
            Tree::One(id) => self.known(id).map_or(e, Tree::Known),
            Tree::Many(and, all) => self.operator(and, all),
        }
    }

    /// A conjunction (or, the other way round in all, a disjunction): its own literals hold (do not hold) in what stands
    /// beside them.
    fn operator(&mut self, and: bool, all: Vec<Tree>) -> Tree {
        let mark = self.trail.len();
        let mut literals: Vec<LiteralId> = Vec::new();
        let mut rest = all;
        let decided = loop {
            let (mut next, mut news) = (Vec::new(), false);
            let mut queue: std::collections::VecDeque<Tree> = std::mem::take(&mut rest).into();
            // Literals first: the others are seen under them.
            let mut others = Vec::new();
            let mut decided = false;
            while let Some(e) = queue.pop_front() {
                match e {
                    Tree::Known(v) if v == and => {}
                    Tree::Known(_) => decided = true,
                    Tree::One(id) => match self.known(id) {
                        Some(v) if v == and => {}
                        Some(_) => decided = true,
                        None => {
                            self.assume(id, and);
                            literals.push(id);
                        }
                    },
                    Tree::Many(kind, inner) if kind == and => queue.extend(inner),
                    e => others.push(e),
                }
            }
            if decided {
                break true;
            }
            for e in others {
                let e = if self.left > 0 { self.simplify(e) } else { e };
                match e {
                    Tree::Known(v) if v == and => {}
                    Tree::Known(_) => {
                        decided = true;
                        break;
                    }
                    Tree::Many(kind, _) if kind != and => next.push(e),
                    Tree::Part(_) => next.push(e),
                    e => {
                        news = true;
                        next.push(e);
                    }
                }
            }
            if decided {
                break true;
            }
            rest = next;
            if news {
                continue;
            }
            if and && self.look && self.try_alternatives(&mut rest) {
                continue;
            }
            break false;
        };
        self.back(mark);
        if decided {
            return Tree::Known(!and);
        }
        let mut kept: Vec<Tree> = literals.into_iter().map(Tree::One).collect();
        kept.extend(self.without_dominated(and, rest));
        match kept.len() {
            0 => Tree::Known(and),
            1 => kept.pop().expect("one"),
            _ => Tree::Many(and, kept),
        }
    }

    /// Drops the alternatives of a conjunction's disjunctions that contradict what stands beside them; true when any did.
    fn try_alternatives(&mut self, rest: &mut [Tree]) -> bool {
        let size: usize = rest.iter().map(Tree::size).sum();
        if rest.len() < 2 || self.left < size {
            return false;
        }
        self.left -= size;
        let has = Occurrences::of(self.alike, rest);
        let mut any = false;
        self.look = false;
        for i in 0..rest.len() {
            let Tree::Many(false, alternatives) = &mut rest[i] else { continue };
            let alternatives = std::mem::take(alternatives);
            let (mut kept, mut clash) = (Vec::with_capacity(alternatives.len()), false);
            for e in alternatives {
                if self.left > 0 && self.contradicts(&e, rest, i, &has) { clash = true } else { kept.push(e) }
            }
            any |= clash;
            rest[i] = match kept.len() {
                0 => Tree::Known(false),
                1 => kept.pop().expect("one"),
                _ => Tree::Many(false, kept),
            };
        }
        self.look = true;
        any
    }

    /// True where an expression contradicts one of `rest`, all but one of them, by what each literal in turn leaves of those
    /// that have it the other way round.
    fn contradicts(&mut self, e: &Tree, rest: &[Tree], except: usize, has: &Occurrences) -> bool {
        let mark = self.trail.len();
        let mut news = vec![e.clone()];
        // What is open of the expression itself, and what is left of those beside it that its literals are in.
        let (mut own, mut left): (Vec<Tree>, Vec<(usize, Tree)>) = (Vec::new(), Vec::new());
        let mut drawn = mark;
        let clash = 'all: loop {
            let before = self.trail.len();
            while let Some(e) = news.pop() {
                match e {
                    Tree::Known(true) => {}
                    Tree::Known(false) => break 'all true,
                    Tree::One(id) => match self.known(id) {
                        Some(true) => {}
                        Some(false) => break 'all true,
                        None => self.assume(id, true),
                    },
                    Tree::Many(true, inner) => news.extend(inner),
                    e => own.push(e),
                }
            }
            if self.trail.len() > before {
                news = std::mem::take(&mut own).into_iter().map(|e| self.simplify(e)).collect();
                own.extend(news.extract_if(.., |e| matches!(e, Tree::Many(false, _) | Tree::Part(_))));
                if !news.is_empty() {
                    continue;
                }
            }
            let Some(&(face, before)) = self.trail.get(drawn) else { break false };
            if self.left == 0 {
                break false;
            }
            drawn += 1;
            let now = self.state[face as usize];
            for (sense, before, now) in
                [(Sense::Positive, before.positive, now.positive), (Sense::Negative, before.negative, now.negative)]
            {
                if now != Some(false) || before == now {
                    continue;
                }
                for j in has.with(LiteralId::new(face, sense)).filter(|j| *j != except) {
                    let known = left.iter().position(|(k, _)| *k == j);
                    let beside = known.map_or(&rest[j], |at| &left[at].1).clone();
                    self.left = self.left.saturating_sub(beside.size());
                    let mut beside = self.simplify(beside);
                    if !matches!(beside, Tree::Many(false, _) | Tree::Part(_)) {
                        news.push(std::mem::replace(&mut beside, Tree::Known(true)));
                    }
                    match known {
                        Some(at) => left[at].1 = beside,
                        None => left.push((j, beside)),
                    }
                }
            }
        };
        self.back(mark);
        clash
    }

    /// Leaves out operands that say nothing beside others: the same again, and of those that hold some operands in common one
    /// that has more of them (A ∪ (A ∩ B) = A, A ∩ (A ∪ B) = A).
    fn without_dominated(&mut self, and: bool, all: Vec<Tree>) -> Vec<Tree> {
        let looked: usize = all.iter().map(Tree::size).sum();
        if all.len() < 2 || self.left < looked {
            return all;
        }
        self.left -= looked;
        let names: Vec<Vec<Tree>> = all.iter().map(|e| self.operands(and, e)).collect();
        let mut seen: HashMap<&[Tree], usize> = HashMap::new();
        let mut keep = vec![true; all.len()];
        for (i, name) in names.iter().enumerate() {
            keep[i] = *seen.entry(name).or_insert(i) == i;
        }
        if all.len() <= FEW {
            for i in 0..all.len() {
                let within = |small: &[Tree], large: &[Tree]| small.iter().all(|e| large.binary_search(e).is_ok());
                let dominated = (0..all.len())
                    .any(|j| j != i && keep[j] && names[j].len() < names[i].len() && within(&names[j], &names[i]));
                keep[i] &= !dominated;
            }
        }
        all.into_iter().zip(keep).filter(|(_, keep)| *keep).map(|(e, _)| e).collect()
    }

    /// The operands of an operand, each face by the first that is the same, in one order.
    fn operands(&self, and: bool, e: &Tree) -> Vec<Tree> {
        let mut list = match self.named(e) {
            Tree::Many(kind, inner) if kind != and => inner,
            e => vec![e],
        };
        list.sort_unstable();
        list.dedup();
        list
    }

    fn named(&self, e: &Tree) -> Tree {
        match e {
            Tree::Known(_) | Tree::Part(_) => e.clone(),
            Tree::One(id) => Tree::One(self.alike.named(*id)),
            Tree::Many(and, all) => {
                let mut all: Vec<Tree> = all.iter().map(|e| self.named(e)).collect();
                all.sort_unstable();
                all.dedup();
                if all.len() == 1 { all.pop().expect("one") } else { Tree::Many(*and, all) }
            }
        }
    }
}

#[cfg(test)]
mod tests;
