//! Which literals of two bodies decide, and whether some are of both.

use super::newton::Constraint;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::motion::Instant;
use glam::DVec3;

/// The literal that keeps x from being deep in both bodies.
pub(super) fn deciding(task: &Task, x: DVec3, at: &Instant) -> Constraint {
    let mut worst: Option<(f64, Constraint)> = None;
    for (side, model, y) in [(Side::A, task.model_a, x), (Side::B, task.model_b, at.b_point(x))] {
        let (v, id) = model.deciding(y);
        if worst.as_ref().is_none_or(|w| v > w.0) {
            worst = Some((v, Constraint::Literal(side, id)));
        }
    }
    worst.expect("two bodies").1
}

/// True when some constraints are of both bodies.
pub(super) fn has_both_sides(active: &[Constraint]) -> bool {
    let side = |c: &Constraint| match c {
        Constraint::Literal(s, _) | Constraint::Apex(s, _, _) => *s,
    };
    active.iter().any(|c| side(c) == Side::A) && active.iter().any(|c| side(c) == Side::B)
}
