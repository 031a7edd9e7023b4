//! From a confirmed witness of depth delta back to where the surfaces touch.

use super::found::SAME_POINT;
use super::known::Known;
use super::newton::{Constraint, MAX_ACTIVE, Problem, SETTLED, Solution};
use super::sides::{deciding, has_both_sides};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::{Task, witness_level};
use crate::octree::Model;
use glam::DVec3;

/// Halvings of the depth on the way from a witness back to its touch.
const CONTINUATIONS: usize = 40;

/// Size of a small feature against its body.
const FEATURE: f64 = 1e-3;

/// Exchanges of faces at one depth.
const MENDS: usize = 8;

/// A continuation that leads farther from its witness than this, in scales of the pair, is another contact's.
const NOT_FAR: f64 = 1e-2;

/// The way back to the touch.
pub(super) struct Touch<'t, 'a> {
    pub(super) task: &'t Task<'a>,
    pub(super) known: Known<'t>,
}

impl Touch<'_, '_> {
    /// The contact of a settled witness where the surfaces meet, as both whole trees say; `None` where it could not be continued
    /// back.
    pub(super) fn of(&self, deep: &Solution) -> Option<Solution> {
        let problem = Problem::of(self.task);
        let continues = self.task.continues();
        // A whole primitive's contact is regular as a rule: a plain step or two.
        let plain = (continues && matches!(self.known, Known::All))
            .then(|| problem.refine(&deep.active, deep.x, deep.t, deep.lambda.clone(), 0.0));
        let touch = match plain {
            Some(Ok(s)) if (s.x - deep.x).length() <= SAME_POINT * self.task.scale => Some(s),
            Some(Err(true)) => problem.along(&deep.active, deep.x, deep.t, deep.lambda.clone(), 0.0),
            _ => None,
        };
        let touch = touch.filter(|s| s.stationarity < SETTLED).or_else(|| {
            if continues { problem.solve(&deep.active, deep.x, deep.t, &deep.lambda, 0.0, true) } else { None }
        });
        let touch = touch.and_then(|s| if self.is_touch(&s, deep.t) { Some(s) } else { self.touch_beside(s, deep.t) });
        match touch {
            Some(s) if holds(&s) => Some(s),
            other if continues => self.continued_by_steps(deep).or(other),
            other => other,
        }
    }

    /// True when the surfaces meet in a solution, as both whole trees say, no later than the witness.
    fn is_touch(&self, s: &Solution, latest: f64) -> bool {
        let at = self.task.relative.at(s.t);
        let tol = 16.0 * self.task.rounding;
        let touches = |model: &Model, x: DVec3| model.value_within(x, tol).abs() <= tol;
        s.t <= latest && touches(self.task.model_a, s.x) && touches(self.task.model_b, at.b_point(s.x))
    }

    /// The touch of a witness that its own equations do not lead to: because other faces decide where the bodies are less
    /// deep, or because they bend too much on the way. The depth is taken back by halves, the set of faces mended by what
    /// both trees say at each; from every depth the last step is tried.
    fn continued_by_steps(&self, deep: &Solution) -> Option<Solution> {
        let mut from = deep.clone();
        let mut level = witness_level(self.task.delta, self.task.rounding);
        for _ in 0..CONTINUATIONS {
            let last = self.mended(&from, 0.0).filter(|s| holds(s) && self.is_touch(s, deep.t));
            if last.is_some() || level < self.task.rounding {
                return last;
            }
            level *= 0.5;
            let next = self.mended(&from, level)?;
            // Backwards, and not to another contact far away.
            if next.t > deep.t || (next.x - deep.x).length() > NOT_FAR * self.task.scale {
                return None;
            }
            from = next;
        }
        None
    }

    /// The contact at a depth from one at another, its faces exchanged until both trees have that depth at its point.
    fn mended(&self, from: &Solution, level: f64) -> Option<Solution> {
        // Beside a far larger body, and at small round features, equations in units of the pair's scale lose all digits.
        let own = self.task.model_a.radius.min(self.task.model_b.radius).min(self.task.scale);
        let near = [self.task.scale, own, FEATURE * own].map(|scale| {
            let problem = Problem::of(self.task);
            Problem { scale, time_scale: problem.time_scale * (scale / self.task.scale), ..problem }
        });
        let tol = 16.0 * self.task.rounding;
        let (mut active, mut lambda) = (from.active.to_vec(), from.lambda.to_vec());
        let (mut x, mut t) = (from.x, from.t);
        for _ in 0..MENDS {
            let s = near.iter().find_map(|p| {
                let s = p.solve(&active, x, t, &lambda, level, true);
                s.filter(|s| s.stationarity < SETTLED)
            })?;
            let weakest = (0..active.len())
                .filter(|i| matches!(active[*i], Constraint::Literal(..)))
                .min_by(|i, j| s.lambda[*i].total_cmp(&s.lambda[*j]));
            if let Some(i) = weakest.filter(|i| s.lambda[*i] < -1e-9) {
                if active.len() <= 2 {
                    return None;
                }
                active.remove(i);
                lambda = s.lambda.to_vec();
                lambda.remove(i);
                if !has_both_sides(&active) {
                    return None;
                }
                continue;
            }
            let at = self.task.relative.at(s.t);
            let mut entering = None;
            for (side, model, y) in [(Side::A, self.task.model_a, s.x), (Side::B, self.task.model_b, at.b_point(s.x))] {
                let (value, id) = model.deciding(y);
                if (value + level).abs() > tol {
                    entering = Some((value + level > 0.0, Constraint::Literal(side, id)));
                    break;
                }
            }
            let Some((is_outside, entering)) = entering else { return Some(s) };
            if active.contains(&entering) {
                return None;
            }
            if !is_outside {
                // The body is deeper there than its faces say: it has others.
                let Constraint::Literal(side, _) = entering else { unreachable!("a literal decides") };
                let of_other =
                    |c: &Constraint| !matches!(*c, Constraint::Literal(s, _) | Constraint::Apex(s, _, _) if s == side);
                let kept: Vec<bool> = active.iter().map(of_other).collect();
                let mut keep = kept.iter();
                active.retain(|_| *keep.next().expect("one each"));
                let mut keep = kept.iter();
                lambda.retain(|_| *keep.next().expect("one each"));
            } else if active.len() >= 4 {
                active.remove(weakest?);
                lambda.remove(weakest?);
            }
            active.push(entering);
            lambda.push(0.25);
            if !has_both_sides(&active) {
                return None;
            }
            // From where the faces meet now, unless that led away.
            if (s.x - from.x).length() <= NOT_FAR * self.task.scale {
                (x, t) = (s.x, s.t);
            }
        }
        None
    }

    /// A touch along a line or over a patch, at a point that the faces beside it have left meanwhile: moved to their edge.
    fn touch_beside(&self, s: Solution, latest: f64) -> Option<Solution> {
        let beside = deciding(self.task, s.x, &self.task.relative.at(s.t));
        let full = s.active.len() == MAX_ACTIVE;
        if full || s.active.contains(&beside) || !self.known.holds(self.task, &beside) {
            return None;
        }
        let active: Vec<_> = s.active.iter().copied().chain([beside]).collect();
        let lambda: Vec<_> = s.lambda.iter().copied().chain([0.0]).collect();
        Problem::of(self.task).solve(&active, s.x, s.t, &lambda, 0.0, true).filter(|s| self.is_touch(s, latest))
    }
}

/// True when a solution's multipliers balance and none pulls.
fn holds(s: &Solution) -> bool {
    let pushes = |(c, l): (&Constraint, &f64)| matches!(c, Constraint::Apex(..)) || *l >= -1e-6;
    s.stationarity < SETTLED && s.active.iter().zip(&s.lambda).all(pushes)
}
