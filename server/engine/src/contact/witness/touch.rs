//! From a confirmed witness of depth delta back to where the surfaces touch.

use super::extent::{ACTIVE, INCIDENT};
use super::features::{Features, Seen};
use super::found::SAME_POINT;
use super::known::Known;
use super::newton::{Actives, Constraint, MAX_ACTIVE, Problem, SETTLED, Solution, Weights};
use super::retreat::{BACK, Climber, ON_SURFACE, held};
use super::sides::{deciding, has_both_sides};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::depth;
use crate::contact::query::task::{Task, witness_level};
use crate::motion::Instant;
use crate::octree::Model;
use glam::DVec3;
use std::cell::Cell;

/// Halvings of the depth on the way from a witness back to its touch.
const CONTINUATIONS: usize = 40;

/// What a climb's end counts as: settled, and no better than that.
pub(in crate::contact) const CLIMBED: f64 = 0.5 * SETTLED;

/// |Σ λ g| that is small enough for either body's normal to be told.
const BALANCED: f64 = 1e-7;

/// The same that is not worth another solution.
const SHARP: f64 = 1e-9;

/// Size of a small feature against its body.
const FEATURE: f64 = 1e-3;

/// Exchanges of faces at one depth.
const MENDS: usize = 8;

/// How far from either surface the end of a climb may lie that is told as a touch, relative to the bodies. Where none
/// lies so near the witness alone is told (`Outcome::not_continued`).
const TOUCHES: f64 = 1e-11;

/// A continuation that leads farther from its witness than this, in scales of the pair, is another contact's.
const NOT_FAR: f64 = 1e-2;

/// The way back to the touch.
pub(in crate::contact) struct Touch<'t, 'a> {
    task: &'t Task<'a>,
    known: Known<'t>,
    /// The faces of the touch that was looked at last.
    seen: Cell<Option<Seen>>,
}

impl<'t, 'a> Touch<'t, 'a> {
    pub(in crate::contact) fn new(task: &'t Task<'a>, known: Known<'t>) -> Self {
        Self { task, known, seen: Cell::new(None) }
    }

    /// The faces of the touch that was looked at last, if they were asked for.
    pub(super) fn seen(self) -> Option<Seen> {
        self.seen.into_inner()
    }
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
        let touch = touch.and_then(|s| if self.is_touch(&s, deep) { Some(s) } else { self.touch_beside(s, deep) });
        let climbed = || self.back(deep, &Climber::new(self.task, BACK));
        match touch {
            Some(s) if self.is_held(&s) => {
                let s = self.sharpened(s, deep);
                // Between like faces multipliers may hardly miss their balance far from where they have it.
                let misses = continues && s.stationarity > BALANCED;
                Some(if misses { climbed().unwrap_or(s) } else { s })
            }
            other if continues => {
                self.continued_by_steps(deep).or_else(climbed).or(other.filter(|s| !pulls(s) && self.is_there(s)))
            }
            other => other,
        }
    }

    /// A touch whose multipliers balance no better than may be for a guess, as they may at features that are small against
    /// the pair: solved for once more in units of these, where that helps.
    fn sharpened(&self, s: Solution, deep: &Solution) -> Solution {
        if s.stationarity <= SHARP {
            return s;
        }
        let better = self.scales().into_iter().filter_map(|p| p.solve(&s.active, s.x, s.t, &s.lambda, 0.0, true));
        let near = |o: &Solution| (o.x - s.x).length() <= NOT_FAR * self.task.scale;
        let mut better = better.filter(|o| o.stationarity < 0.5 * s.stationarity && near(o));
        better.find(|o| self.is_held(o) && self.is_touch(o, deep)).unwrap_or(s)
    }

    /// The equations in units of the pair, of its smaller body and of a small feature of that. Beside a far larger body,
    /// and at small round features, those in units of the pair's scale lose all digits.
    fn scales(&self) -> [Problem<'_>; 3] {
        let own = self.task.model_a.radius.min(self.task.model_b.radius).min(self.task.scale);
        [self.task.scale, own, FEATURE * own].map(|scale| {
            let problem = Problem::of(self.task);
            Problem { scale, time_scale: problem.time_scale * (scale / self.task.scale), ..problem }
        })
    }

    /// True when the surfaces meet in a solution, as both whole trees say, no later than the witness.
    fn is_touch(&self, s: &Solution, deep: &Solution) -> bool {
        let at = self.task.relative.at(s.t);
        let tol = 16.0 * self.task.rounding;
        let touches = |model: &Model, x: DVec3| model.value_within(x, tol).abs() <= tol;
        s.t <= deep.t && touches(self.task.model_a, s.x) && touches(self.task.model_b, at.b_point(s.x))
    }

    /// True when a solution's multipliers balance, none pulls, no apex is pressed from within, and its faces are there.
    fn is_held(&self, s: &Solution) -> bool {
        let on_apexes = s.active.iter().any(|c| matches!(c, Constraint::Apex(..)));
        let tips = || Problem::of(self.task).holds_at_apexes(s, &self.task.relative.at(s.t));
        holds(s) && (!on_apexes || tips()) && self.is_there(s)
    }

    /// True when f depends on each face that pushes, or on another one in its plane. In a thin wall a face that decides
    /// at depth delta may be passed by long before the surfaces meet.
    fn is_there(&self, s: &Solution) -> bool {
        if self.task.a.primitives.len() + self.task.b.primitives.len() <= 2 {
            return true;
        }
        let at = self.task.relative.at(s.t);
        let features = Features::at(self.task, s.x, &at, Some(INCIDENT * self.task.rounding));
        let unknown = features.active.iter().any(|ids| ids.is_empty());
        let is_there = unknown
            || s.active.iter().zip(&s.lambda).all(|(c, l)| match *c {
                Constraint::Literal(side, id) if *l > ACTIVE => {
                    features.has(side, id) || features.in_plane_of(side, id).is_some()
                }
                Constraint::Literal(..) | Constraint::Apex(..) => true,
            });
        self.seen.set(Some(features.seen()));
        is_there
    }

    /// The touch of a witness that its own equations do not lead to: because other faces decide where the bodies are less
    /// deep, or because they bend too much on the way. The depth is taken back by halves, the set of faces mended by what
    /// both trees say at each; from every depth the last step is tried.
    fn continued_by_steps(&self, deep: &Solution) -> Option<Solution> {
        let mut from = deep.clone();
        let mut level = witness_level(self.task.delta, self.task.rounding);
        for _ in 0..CONTINUATIONS {
            let last = self.mended(&from, 0.0).filter(|s| self.is_held(s) && self.is_touch(s, deep));
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

    /// The touch that climbs lead back to. Solved for where its faces' equations have a solution there; else the
    /// climb's own end, if that lies on both surfaces or at the start.
    pub(in crate::contact) fn back(&self, deep: &Solution, climber: &Climber) -> Option<Solution> {
        let level = witness_level(self.task.delta, self.task.rounding);
        let solve = |t: f64, held: &depth::Held| {
            let near = |s: &Solution| (s.x - held.0).length() <= NOT_FAR * self.task.scale;
            let balances = |s: &Solution| s.stationarity < BALANCED;
            let touches = |s: &Solution| near(s) && balances(s) && self.is_held(s) && self.is_touch(s, deep);
            self.mended(&self.climbed(t, held), 0.0).filter(touches)
        };
        let (t, held) = match climber.back((deep.t, deep.x, level), solve)? {
            Ok(solved) => return Some(solved),
            Err(end) => end,
        };
        // A climb may end on one of the surfaces.
        let at = self.task.relative.at(t);
        let values = [self.task.model_a.value(held.0), self.task.model_b.value(at.b_point(held.0))];
        let off = values[0].abs().max(values[1].abs());
        let most = TOUCHES * self.task.scale + self.task.rounding;
        let is_deep_at_start = t == 0.0 && held.1 > ON_SURFACE * self.task.rounding;
        ((is_deep_at_start || off <= most) && self.is_balanced(held.0, &at, off)).then(|| self.climbed(t, &held))
    }

    /// True when faces of both bodies oppose each other at the end of a climb that lies `off` their surfaces. Where none
    /// do the climb has come to rest beside the touch.
    fn is_balanced(&self, x: DVec3, at: &Instant, off: f64) -> bool {
        // Bodies whose common depth is ignored in part show no faces in one point.
        self.task.ignored_depth > 0.0
            || Features::at(self.task, x, at, Some(off + INCIDENT * self.task.rounding)).is_balanced(BALANCED)
    }

    /// Where a climb has ended, as a solution of the faces that hold it.
    pub(in crate::contact) fn climbed(&self, t: f64, (x, _, support): &depth::Held) -> Solution {
        let (mut active, mut lambda): (Actives, Weights) = held(support).filter(|(_, l)| *l > ACTIVE).unzip();
        if !has_both_sides(&active) {
            // What is no thicker than rounding holds itself.
            let at = self.task.relative.at(t);
            let (a, b) = (self.task.model_a.deciding(*x).1, self.task.model_b.deciding(at.b_point(*x)).1);
            active = [Constraint::Literal(Side::A, a), Constraint::Literal(Side::B, b)].into_iter().collect();
            lambda = [0.5; 2].into_iter().collect();
        }
        Solution { x: *x, t, active, lambda, stationarity: CLIMBED }
    }

    /// The contact at a depth from one at another, its faces exchanged until both trees have that depth at its point.
    pub(in crate::contact) fn mended(&self, from: &Solution, level: f64) -> Option<Solution> {
        let near = self.scales();
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
    fn touch_beside(&self, s: Solution, deep: &Solution) -> Option<Solution> {
        let beside = deciding(self.task, s.x, &self.task.relative.at(s.t));
        let full = s.active.len() == MAX_ACTIVE;
        if full || s.active.contains(&beside) || !self.known.holds(self.task, &beside) {
            return None;
        }
        let active: Vec<_> = s.active.iter().copied().chain([beside]).collect();
        let lambda: Vec<_> = s.lambda.iter().copied().chain([0.0]).collect();
        Problem::of(self.task).solve(&active, s.x, s.t, &lambda, 0.0, true).filter(|s| self.is_touch(s, deep))
    }
}

/// True when a solution's multipliers balance but one pulls by more than such a balance leaves open.
fn pulls(s: &Solution) -> bool {
    s.stationarity < SETTLED && !holds(s)
}

/// True when a solution's multipliers balance and none pulls.
fn holds(s: &Solution) -> bool {
    let pushes = |(c, l): (&Constraint, &f64)| matches!(c, Constraint::Apex(..)) || *l >= -1e-6;
    s.stationarity < SETTLED && s.active.iter().zip(&s.lambda).all(pushes)
}
