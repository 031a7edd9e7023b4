//! The deepest common point at the start, for pairs that overlap there (the paper's point of greatest interpenetration).
//!
//! From a common point, sequential linear programming on the tree's own linear bounds: linearise every literal that can
//! matter within a trust box, find the box's lowest point of the weakest alternative, move there if max(f_A, f_B) falls,
//! shrink the box otherwise. The result is a local optimum; its depth is a proven lower bound of the separating
//! translation whatever it is, since a ball of that radius is common to both bodies.

use super::clause::{self, Pair};
use super::literal::{Faces, Side, View};
use super::search::Task;
use crate::motion::Instant;
use crate::solid::Sense;
use crate::solid::local::{self, LiteralId, Token, Truth};
use glam::DVec3;

/// Trust boxes tried before the climb ends.
const ROUNDS: usize = 200;

/// (point in A's frame, unit normal from a to b along A's axes, depth, deciding literals).
pub fn deepest(task: &Task, at: &Instant, start: DVec3) -> (DVec3, DVec3, f64, Vec<(Side, LiteralId)>) {
    let f = |x: DVec3| task.a.value(x).max(task.b.value(at.b_point(x)));
    let (mut x, mut best) = (start, f(start));
    let mut size = 0.5 * task.scale;
    let mut scratch = clause::Scratch::default();
    let mut support: Vec<(Side, LiteralId, f64)> = Vec::new();
    for _ in 0..ROUNDS {
        if size < 1e-13 * task.scale {
            break;
        }
        // Literals decided against the present depth over the trust box fold away.
        let view = View {
            a: Faces { solid: task.a, guards: &[] },
            b: Faces { solid: task.b, guards: &[] },
            at,
            motion: task.relative.bounds(0.0, 0.0, 0.0),
            center: x,
            half: DVec3::splat(size),
            radius: size * 3f64.sqrt(),
            center_b: at.b_point(x),
            velocity: DVec3::ZERO,
            delta: -best,
            rounding: 0.0,
            fits: false,
            curved: false,
        };
        let mut pool: Vec<Token> = Vec::new();
        let truth_a = local::prune(&task.a.normal_form, &mut pool, &mut |id| view.truth(Side::A, id));
        let middle = pool.len() as u32;
        let truth_b = local::prune(&task.b.normal_form, &mut pool, &mut |id| view.truth(Side::B, id));
        let end = pool.len() as u32;
        if truth_a == Truth::False || truth_b == Truth::False || end == 0 {
            size *= 0.5;
            continue;
        }
        let pair = Pair { pool: &pool, a: (0, middle), b: (middle, end) };
        let step = clause::advance(&view, &pair, &[], 0.0, f64::INFINITY, &mut scratch);
        if !step.support.is_empty() {
            support = step.support.clone();
        }
        if step.dt >= 0.0 {
            // The whole box is proven no deeper.
            size *= 0.5;
            continue;
        }
        let next = x + step.y;
        let value = f(next);
        if value < best - 1e-3 * task.rounding {
            (x, best) = (next, value);
        } else {
            size *= 0.5;
        }
    }
    (x, normal(task, at, x, &support), -best, support.iter().map(|s| (s.0, s.1)).collect())
}

/// Direction from a to b: the multiplied normals of a, else of b, else the deciding face's.
fn normal(task: &Task, at: &Instant, x: DVec3, support: &[(Side, LiteralId, f64)]) -> DVec3 {
    let gradient = |side: Side, id: LiteralId| {
        let n = match side {
            Side::A => task.a.faces[id.face() as usize].at(x).normal,
            Side::B => at.a_vector(task.b.faces[id.face() as usize].at(at.b_point(x)).normal),
        };
        if id.sense() == Sense::Positive { n } else { -n }
    };
    let sum = |side: Side| support.iter().filter(|s| s.0 == side).map(|s| gradient(s.0, s.1) * s.2).sum::<DVec3>();
    let from_a = local::deciding(&task.a.normal_form, &mut |f| task.a.faces[f as usize].value(x)).1;
    (sum(Side::A) - sum(Side::B)).try_normalize().unwrap_or_else(|| gradient(Side::A, from_a))
}
