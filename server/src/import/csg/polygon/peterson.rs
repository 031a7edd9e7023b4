//! Peterson's formula: a monotone formula of half-planes for a chain of edges, each edge's half-plane once.
//!
//! Source: D. Dobkin, L. Guibas, J. Hershberger, J. Snoeyink, "An efficient algorithm for finding the CSG representation of a
//! simple polygon", Algorithmica 10, 1993. The first and the last edge of a chain are taken as reaching to infinity; what lies
//! on its left is wanted. A corner that is the farthest of the chain along some direction splits it: the two edges there,
//! lengthened beyond it, meet nothing. Where the chain turns left at it both halves must hold, else one of them.

use super::turn;
use glam::DVec2;

/// A formula over numbered half-planes.
#[derive(Clone, Debug, PartialEq)]
pub enum Formula {
    /// A half-plane.
    Edge(usize),
    /// All (true) or one (false) of some must hold.
    Many(bool, Vec<Formula>),
}

impl Formula {
    /// All or one of some formulas; those of the same kind are taken apart.
    pub fn of_many(all: bool, of: impl IntoIterator<Item = Formula>) -> Self {
        let mut list = Vec::new();
        for f in of {
            match f {
                Formula::Many(kind, inner) if kind == all => list.extend(inner),
                other => list.push(other),
            }
        }
        Self::Many(all, list)
    }

    /// Its value: the largest of all, or the least of one.
    #[cfg(test)]
    pub fn value(&self, edge: &mut impl FnMut(usize) -> f64) -> f64 {
        match self {
            Formula::Edge(e) => edge(*e),
            Formula::Many(true, list) => list.iter().map(|f| f.value(edge)).fold(f64::NEG_INFINITY, f64::max),
            Formula::Many(false, list) => list.iter().map(|f| f.value(edge)).fold(f64::INFINITY, f64::min),
        }
    }
}

/// An operator under construction: operands that are edges, and those that are operators, by their index; and how deep it lies.
struct Operator {
    all: bool,
    edges: Vec<usize>,
    operators: Vec<usize>,
    level: usize,
}

/// What making formulas may take.
pub struct Effort {
    /// Corners that may be looked at yet: a chain is looked through once for each corner that splits it.
    pub looks: usize,
    /// Levels of nesting.
    pub levels: usize,
}

/// The formula of what lies left of a chain of corners; its edges are numbered from `first` on. `None` where it takes more.
pub fn formula(corners: &[DVec2], first: usize, left: &mut Effort) -> Option<Formula> {
    let last = corners.len() - 1;
    let new = |all: bool, level: usize| Operator { all, edges: Vec::new(), operators: Vec::new(), level };
    let mut operators = vec![new(true, 1)];
    let mut work = vec![(0, last, 0)];
    while let Some((from, to, parent)) = work.pop() {
        if to == from + 1 {
            operators[parent].edges.push(first + from);
            continue;
        }
        left.looks = left.looks.checked_sub(to - from)?;
        let at = split(corners, from, to);
        let all = turn(corners[at - 1], corners[at], corners[at + 1]) >= 0.0;
        let target = if operators[parent].all == all {
            parent
        } else {
            let level = operators[parent].level + 1;
            if level >= left.levels {
                return None;
            }
            operators.push(new(all, level));
            let new = operators.len() - 1;
            operators[parent].operators.push(new);
            new
        };
        work.push((at, to, target));
        work.push((from, at, target));
    }
    // Operands come after their operator: from the end on each is whole when it is asked for.
    let mut done: Vec<Option<Formula>> = operators.iter().map(|_| None).collect();
    for (k, operator) in operators.iter().enumerate().rev() {
        let edges = operator.edges.iter().map(|e| Formula::Edge(*e));
        let mut list: Vec<Formula> = edges.collect();
        list.extend(operator.operators.iter().filter_map(|o| done[*o].take()));
        done[k] = Some(if list.len() == 1 { list.remove(0) } else { Formula::Many(operator.all, list) });
    }
    Some(done.swap_remove(0).unwrap_or(Formula::Many(true, Vec::new())))
}

/// The corner at which the chain `from..=to` is split: the farthest along a direction in which neither end goes.
fn split(corners: &[DVec2], from: usize, to: usize) -> usize {
    let back = (corners[from] - corners[from + 1]).normalize();
    let ahead = (corners[to] - corners[to - 1]).normalize();
    let farthest = |along: DVec2, aside: DVec2| {
        let height = |i: usize| (along.dot(corners[i] - corners[from]), aside.dot(corners[i] - corners[from]));
        let higher = |a: (f64, f64), b: (f64, f64)| a.0 > b.0 || a.0 == b.0 && a.1 > b.1;
        (from + 2..to).fold(from + 1, |best, i| if higher(height(i), height(best)) { i } else { best })
    };
    let both = back + ahead;
    if both.length() > 1e-9 {
        let along = -both.normalize();
        return farthest(along, along.perp());
    }
    // Straight through: on the side where the chain lies farther out than both of its ends.
    let side = back.perp();
    let height = |i: usize| side.dot(corners[i] - corners[from]);
    let ends = [0.0, height(to)];
    let (up, down) = (farthest(side, back), farthest(-side, ahead));
    let over = height(up) - ends[0].max(ends[1]);
    let under = ends[0].min(ends[1]) - height(down);
    if over >= under {
        farthest(side, if ends[1] >= ends[0] { back } else { ahead })
    } else {
        farthest(-side, if ends[1] <= ends[0] { back } else { ahead })
    }
}
