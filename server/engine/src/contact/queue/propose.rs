//! From a cell's bounds to guesses of a contact.
//!
//! Where the weakest clause of a cell runs out of time, the faces that hold it point to a contact: it is solved for from there
//! (`contacts`), with what else passes nearby.

use super::cell::Cell;
use super::items::Items;
use crate::contact::exclusion::clause::Advance;
use crate::contact::exclusion::fit;
use crate::contact::exclusion::literal::{Faces, Side};
use crate::contact::witness::contacts::{Contacts, Guess, Visited};
use crate::contact::witness::known::Known;
use crate::contact::witness::newton::{Constraint, MAX_ACTIVE};
use crate::motion::Instant;
use crate::solid::local::{self, LiteralId};
use crate::solid::{Face, Sense};
use glam::DVec3;

/// A cell thinner than this part of the pair's scale may be held by one body alone.
const THIN: f64 = 1e-6;

/// A literal of a body and its weight in a clause.
type Weighed = (Side, LiteralId, f64);

/// What proposes contacts: the cells' expressions, and what confirms them.
pub(super) struct Proposals<'s, 'a> {
    pub(super) items: &'s mut Items,
    pub(super) contacts: &'s mut Contacts<'a>,
    /// Guesses that do not converge steadily are followed to their ends.
    pub(super) patient: bool,
    /// From where the guesses of this attempt came to nothing.
    pub(super) visited: Visited,
}

impl Proposals<'_, '_> {
    /// Tries to find the contact that a cell's weakest clause points to.
    pub(super) fn attempt(&mut self, cell: &Cell, advance: &Advance, at: &Instant) {
        let level = advance.cost.element_sum().log2().floor() as i32;
        let x = cell.center + advance.y;
        let Some(support) = self.support(cell, advance, x, at) else { return };
        let mut key: Vec<_> = support.iter().map(|l| (l.0, l.1)).collect();
        key.sort_unstable();
        if self.items.scratch.tried.iter().any(|(k, l, patient)| *l == level && *patient >= self.patient && *k == key) {
            return;
        }
        self.items.scratch.tried.push((key, level, self.patient));
        let t = cell.t + advance.dt.max(0.0);
        let active: Vec<_> = support.iter().map(|l| Constraint::Literal(l.0, l.1)).collect();
        // A fit weighs both of its literals: together they are 1 again.
        let total: f64 = support.iter().map(|l| l.2).sum();
        let lambda: Vec<_> = support.iter().map(|l| l.2 / total).collect();
        // What leads to the contact that is known already leads to no other.
        let _ = self.solve(active.clone(), x, t, lambda.clone())
            || self.contacts.again
            || self.attempt_fit(&advance.support, x, t, (&active, &lambda))
            || self.attempt_with_others(cell, x, t, (&active, &lambda))
            || self.attempt_apexes(cell, &support, t, at);
    }

    /// The literals of a cell's weakest clause: of both bodies. A thin cell is held by one body alone: what decides of the other
    /// there stands beside it. `None` where a body has none.
    fn support(&self, cell: &Cell, advance: &Advance, x: DVec3, at: &Instant) -> Option<Vec<Weighed>> {
        let mut support = advance.support.clone();
        let bodies = [
            (Side::A, Faces { solid: self.contacts.task.a, clip_planes: &[] }, cell.a, x),
            (
                Side::B,
                Faces { solid: self.contacts.task.b, clip_planes: &self.items.scratch.clip_planes_b },
                cell.b,
                at.b_point(x),
            ),
        ];
        for (side, faces, range, y) in bodies {
            if support.iter().all(|l| l.0 != side) {
                if cell.half.min_element() > THIN * self.contacts.task.scale {
                    return None;
                }
                let tokens = &self.items.scratch.pool[range.0 as usize..range.1 as usize];
                if tokens.is_empty() {
                    return None;
                }
                let (_, id) = local::decided(tokens, &mut |f| faces.get(f).value(y))?;
                if faces.is_guard(id.face()) {
                    return None;
                }
                support.push((side, id, 1.0));
            }
        }
        // Fits weigh two literals each, so that more may hold a cell than a system takes: then those that weigh most, of both bodies.
        if support.len() > MAX_ACTIVE {
            support.sort_by(|l, m| m.2.total_cmp(&l.2));
            if let Some(other) = support.iter().position(|l| l.0 != support[0].0) {
                support.swap(other.max(MAX_ACTIVE - 1), MAX_ACTIVE - 1);
            }
            support.truncate(MAX_ACTIVE);
        }
        Some(support)
    }

    /// Two like faces in a fit: their bound leaves open in which direction they meet.
    fn attempt_fit(&mut self, support: &[Weighed], x: DVec3, t: f64, guess: (&[Constraint], &[f64])) -> bool {
        let &[p, q] = support else { return false };
        let (p, q) = if p.1.sense() == Sense::Positive { (p, q) } else { (q, p) };
        if q.1.sense() != Sense::Negative || p.0 == q.0 {
            return false;
        }
        let later = self.contacts.task.relative.at(t);
        let off = fit::first_off_axis(&later, (p.0, self.face(&p)), self.face(&q), x);
        off.is_some_and(|x| self.solve(guess.0.to_vec(), x, t, guess.1.to_vec()))
    }

    /// A surface that touches there too with next to no weight (a rim that lies almost in a face) is not in the support, but
    /// without it the system has its solution elsewhere.
    fn attempt_with_others(&mut self, cell: &Cell, x: DVec3, t: f64, guess: (&[Constraint], &[f64])) -> bool {
        let (active, lambda) = guess;
        if active.len() >= MAX_ACTIVE {
            return false;
        }
        let close = self.closest_others(cell, active, x, &self.contacts.task.relative.at(t));
        close.into_iter().flatten().any(|close| {
            let more = active.iter().copied().chain([close]).collect();
            self.solve(more, x, t, lambda.iter().copied().chain([0.0]).collect())
        })
    }

    /// A cone whose apex is near: the apex is a vertex of its own.
    fn attempt_apexes(&mut self, cell: &Cell, support: &[Weighed], t: f64, at: &Instant) -> bool {
        let apex_of = |l: &Weighed| {
            let apex = self.face(l).apex()?.point;
            let apex = if l.0 == Side::A { apex } else { at.a_point(apex) };
            let near = (apex - cell.center).length() <= 4.0 * cell.half.length();
            (l.1.sense() == Sense::Positive && near).then_some(apex)
        };
        let apexes: Vec<_> = support.iter().filter_map(|l| Some((*l, apex_of(l)?))).collect();
        let vertex = |l: &Weighed| {
            let (side, id, weight) = *l;
            (0..3).map(move |k| (Constraint::Apex(side, id, k), if k == 0 { -weight } else { 0.0 }))
        };
        for (l, apex) in &apexes {
            let others = support.iter().filter(|o| o.0 != l.0);
            let others = others.map(|o| (Constraint::Literal(o.0, o.1), o.2));
            let (active, lambda) = vertex(l).chain(others).take(MAX_ACTIVE).unzip();
            if self.solve(active, *apex, t, lambda) {
                return true;
            }
        }
        if let [(l, apex), (m, _)] = apexes[..]
            && l.0 != m.0
        {
            let (active, lambda) = vertex(&l).chain(vertex(&m)).unzip();
            return self.solve(active, apex, t, lambda);
        }
        false
    }

    fn face(&self, l: &Weighed) -> &'_ Face {
        let solid = if l.0 == Side::A { self.contacts.task.a } else { self.contacts.task.b };
        &solid.faces[l.1.face() as usize]
    }

    /// The two literals of a cell, other than `active`, whose surfaces are nearest to x: no farther than the cell is large.
    fn closest_others(&self, cell: &Cell, active: &[Constraint], x: DVec3, at: &Instant) -> [Option<Constraint>; 2] {
        let mut nearest = [(2.0 * cell.half.length(), None); 2];
        for (side, solid, range, y) in
            [(Side::A, self.contacts.task.a, cell.a, x), (Side::B, self.contacts.task.b, cell.b, at.b_point(x))]
        {
            for id in local::literals(&self.items.scratch.pool[range.0 as usize..range.1 as usize]) {
                let constraint = Constraint::Literal(side, id);
                let Some(face) = solid.faces.get(id.face() as usize) else { continue };
                if active.contains(&constraint) || nearest.iter().any(|n| n.1 == Some(constraint)) {
                    continue;
                }
                let distance = face.value(y).abs();
                if distance < nearest[0].0 {
                    nearest = [(distance, Some(constraint)), nearest[0]];
                } else if distance < nearest[1].0 {
                    nearest[1] = (distance, Some(constraint));
                }
            }
        }
        [nearest[0].1, nearest[1].1]
    }

    fn solve(&mut self, active: Vec<Constraint>, x: DVec3, t: f64, lambda: Vec<f64>) -> bool {
        let guess = Guess { active, x, t, lambda };
        self.contacts.polish_beside(&mut self.visited, Known::Handed(&self.items.handed), self.patient, guess)
    }
}
