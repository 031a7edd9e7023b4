//! What is left of two trees beside a point: a climb that stays there looks at no other face.
//!
//! F changes no faster than the distance (`separation`). So over a box beside a point whose F is known, F is no farther from that than the
//! box's radius: literals that hold all over the box below all of that, or nowhere in it up to there, fold away. What is left has F's own
//! value, to the bit; and a body's own f where that is within the same reach.

use super::separation;
use crate::contact::exclusion::literal::{Side, View};
use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::Solid;
use crate::solid::local::{self, LiteralId, Token, Truth};
use glam::DVec3;

/// How far it reaches, in half sides of the box that is asked for: a climb takes several steps before it leaves.
const REACH: f64 = 8.0;

/// It is made anew for a box so much smaller.
const SMALLER: f64 = 4.0;

/// Both trees, or what is left of them over a box.
pub(super) struct Near<'t, 'a> {
    task: &'t Task<'a>,
    at: &'t Instant,
    center: DVec3,
    /// Half the box's sides: infinite for the whole trees.
    half: f64,
    /// No F in the box is lower, none higher.
    levels: (f64, f64),
    /// What is left of each, empty where it holds all over the box; `None` for a whole tree.
    left: [Option<Vec<Token>>; 2],
}

impl<'t, 'a> Near<'t, 'a> {
    /// Both trees.
    pub fn new(task: &'t Task<'a>, at: &'t Instant) -> Self {
        let levels = (f64::NEG_INFINITY, f64::INFINITY);
        Self { task, at, center: DVec3::ZERO, half: f64::INFINITY, levels, left: [None, None] }
    }

    fn solid(&self, side: Side) -> &'a Solid {
        if side == Side::A { self.task.a } else { self.task.b }
    }

    /// What is left of a body's tree.
    pub fn tokens(&self, side: Side) -> &[Token] {
        self.left[usize::from(side == Side::B)].as_deref().unwrap_or(&self.solid(side).normal_form)
    }

    /// Appends what is left of a body's tree over a smaller box yet; nothing unless the result is `Open`.
    pub fn prune(&self, side: Side, view: &View, out: &mut Vec<Token>) -> Truth {
        self.prune_by(side, out, |id| view.truth(side, id))
    }

    fn prune_by(&self, side: Side, out: &mut Vec<Token>, mut classify: impl FnMut(LiteralId) -> Truth) -> Truth {
        match self.tokens(side) {
            [] => Truth::True,
            tokens => self.solid(side).prune(tokens, out, &mut classify),
        }
    }

    /// F at a point: by what is left, in its box.
    pub fn value(&self, x: DVec3) -> f64 {
        if (x - self.center).abs().max_element() > self.half {
            return separation::value(self.task, self.at, x);
        }
        let of = |side: Side, x: DVec3| {
            let solid = self.solid(side);
            match self.left[usize::from(side == Side::B)].as_deref() {
                None => solid.value(x),
                Some([]) => f64::NEG_INFINITY,
                Some(tokens) => local::value(tokens, &mut |face| solid.faces[face as usize].value(x)),
            }
        };
        of(Side::A, x).max(of(Side::B, self.at.b_point(x)))
    }

    /// A body's f at a point of A's frame, and the literal that decides it.
    pub fn deciding(&self, side: Side, x: DVec3) -> (f64, LiteralId) {
        let (model, y) = match side {
            Side::A => (self.task.model_a, x),
            Side::B => (self.task.model_b, self.at.b_point(x)),
        };
        let is_within = (x - self.center).abs().max_element() <= self.half;
        let left = self.left[usize::from(side == Side::B)].as_deref().filter(|tokens| is_within && !tokens.is_empty());
        let of_left = left.map(|tokens| local::deciding(tokens, &mut |face| model.solid.faces[face as usize].value(y)));
        of_left.filter(|(f, _)| self.levels.0 < *f && *f <= self.levels.1).unwrap_or_else(|| model.deciding(y))
    }

    /// Comes to the box about x with half sides `size`, where F(x) = `value`.
    pub fn come_to(&mut self, x: DVec3, size: f64, value: f64) {
        let holds = |half: f64| ((x - self.center).abs() + half).max_element() <= self.half;
        let half = REACH * size;
        let is_small = self.half <= SMALLER * half;
        if self.half.is_finite() && holds(size) && is_small {
            return;
        }
        // What folds away in a box may hold, or not, beyond it.
        if !holds(half) {
            self.half = f64::INFINITY;
            self.left = [None, None];
        }
        if SMALLER * half <= self.half.min(self.task.scale) {
            self.shrink(x, half, value);
        }
    }

    fn shrink(&mut self, x: DVec3, half: f64, value: f64) {
        let radius = half * 3f64.sqrt();
        let still = self.task.relative.bounds(0.0, 0.0, 0.0);
        let at_value = |f: f64| View {
            radius,
            velocity: DVec3::ZERO,
            delta: -f,
            wall: f64::NEG_INFINITY,
            fits: false,
            curved: false,
            ..self.task.view((x, DVec3::splat(half)), self.at, still, &[])
        };
        let levels = (value - radius, value + radius);
        let (lowest, highest) = (at_value(levels.0), at_value(levels.1));
        let left = [Side::A, Side::B].map(|side| {
            let mut out = Vec::new();
            let truth = self.prune_by(side, &mut out, |id| separation::between(&lowest, &highest, side, id));
            // Of a part that is not written out no value is told, and a tree whose like faces were made one has another.
            let is_whole = self.solid(side).simplified || out.iter().any(|token| local::is_part(*token));
            (truth, (!is_whole).then_some(out))
        });
        let [(truth_a, a), (truth_b, b)] = left;
        // Rounding alone makes both hold everywhere, or one nowhere.
        if truth_a == Truth::False || truth_b == Truth::False || (truth_a, truth_b) == (Truth::True, Truth::True) {
            return;
        }
        (self.center, self.half, self.levels, self.left) = (x, half, levels, [a, b]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::testing::random_query;
    use crate::math::random::Random;
    use crate::octree::testing::random_tree;

    /// A climb that goes down by chance: what is left has F's value, and the bodies' own values and deciding literals, to the bit, within
    /// the box and beyond.
    #[test]
    fn what_is_left_beside_a_point_has_the_value_of_the_trees() {
        let mut r = Random(10);
        let (mut whole, mut left, mut lower, mut beyond) = (0, 0, 0, 0);
        for _ in 0..60 {
            let (a, b) = (random_tree(&mut r, 3), random_tree(&mut r, 3));
            if a.solid.is_empty() || b.solid.is_empty() {
                continue;
            }
            let query = random_query(&a, &b, &mut r);
            let (task, _) = Task::of(&query);
            let at = task.relative.at(r.unit());
            let f = |x: DVec3| separation::value(&task, &at, x);
            let mut near = Near::new(&task, &at);
            let (mut x, mut size) = (r.vector(0.8), 0.5 * task.scale);
            while size > 1e-6 {
                near.come_to(x, size, f(x));
                for side in [Side::A, Side::B] {
                    whole += near.solid(side).normal_form.len();
                    left += near.tokens(side).len();
                }
                let mut next = x;
                for k in 0..16 {
                    // The last ones lie outside of the box that was asked for: in the one that is kept, and mostly beyond that.
                    let y = match k {
                        0..8 => x + r.vector(size),
                        8..12 if near.half.is_finite() => near.center + r.vector(near.half),
                        _ => x + r.vector(60.0 * size),
                    };
                    let (own, kept) = (f(y), near.value(y));
                    let is_beyond = (y - near.center).abs().max_element() > near.half;
                    assert!(kept == own, "{kept} for {own}");
                    assert_eq!(near.deciding(Side::A, y), task.model_a.deciding(y));
                    assert_eq!(near.deciding(Side::B, y), task.model_b.deciding(at.b_point(y)));
                    lower += usize::from(own <= f(x));
                    beyond += usize::from(is_beyond);
                    if k < 8 && own < f(next) {
                        next = y;
                    }
                }
                (x, size) = (next, size * r.within(0.5, 1.0));
            }
        }
        assert!(3 * left < whole, "{left} tokens of {whole} are left");
        assert!(lower > 3_000 && beyond > 1_000, "{lower} points are lower, {beyond} beyond");
    }
}
