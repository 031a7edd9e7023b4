//! From a cell's bounds to a confirmed contact.
//!
//! Where the weakest clause of a cell runs out of time, the faces that hold it point to a contact: Newton solves for it
//! (`newton`), the set of faces is mended by what the trees say, and nothing counts before both whole trees confirm it at
//! depth delta. From there it is continued back to where the surfaces touch. Of several the earliest is kept, and of
//! those in one bracket the one that touches first.
//! The search asks for proposals and uses their time; it never believes one that is not confirmed here.

use super::cell::Cell;
use super::search::Search;
use crate::contact::exclusion::clause::{Advance, Hint};
use crate::contact::exclusion::fit;
use crate::contact::exclusion::literal::{Faces, Side};
use crate::contact::instant::depth;
use crate::contact::instant::separation;
use crate::contact::instant::work::Work;
use crate::contact::query::task::witness_level;
use crate::contact::witness::found::{Found, SAME_TIME};
use crate::contact::witness::newton::{Actives, Constraint, MAX_ACTIVE, Problem, SETTLED, Solution, Weights};
use crate::motion::Instant;
use crate::octree::Model;
use crate::solid::Sense;
use crate::solid::local::{self, LiteralId};
use crate::solid::surface::Apex;
use glam::DVec3;

/// Witnesses this close, in scales of the pair, are one point.
const SAME_POINT: f64 = 1e-6;

/// A cell thinner than this part of the pair's scale may be held by one body alone.
const THIN: f64 = 1e-6;

/// Halvings of the depth on the way from a witness back to its touch.
const CONTINUATIONS: usize = 40;

/// Size of a small feature against its body.
const FEATURE: f64 = 1e-3;

/// Exchanges of faces at one depth.
const MENDS: usize = 8;

/// A continuation that leads farther from its witness than this, in scales of the pair, is another contact's.
const NOT_FAR: f64 = 1e-2;
/// When a witness is first looked for beside a point, a part of the step; ten times later each time after …
const FIRST_WAIT: f64 = 1e-12;
/// … as often.
const LATER: i32 = 11;

/// Points kept at which curved faces are touched.
const MAX_HINTS: usize = 8;

impl Search<'_> {
    pub(super) fn problem(&self) -> Problem<'_> {
        Problem::of(&self.task)
    }

    /// Tries to find the contact that a cell's weakest clause points to.
    pub(super) fn attempt(&mut self, cell: &Cell, advance: &Advance, at: &Instant) {
        let level = advance.cost.element_sum().log2().floor() as i32;
        let x = cell.center + advance.y;
        let mut support = advance.support.clone();
        // A thin cell is held by one body alone: what decides of the other there stands beside it.
        let bodies = [
            (Side::A, Faces { solid: self.task.a, clip_planes: &[] }, cell.a, x),
            (Side::B, Faces { solid: self.task.b, clip_planes: &self.scratch.clip_planes_b }, cell.b, at.b_point(x)),
        ];
        for (side, faces, range, y) in bodies {
            if support.iter().all(|l| l.0 != side) {
                if cell.half.min_element() > THIN * self.task.scale {
                    return;
                }
                let tokens = &self.scratch.pool[range.0 as usize..range.1 as usize];
                if tokens.is_empty() {
                    return;
                }
                let (_, id) = local::deciding(tokens, &mut |f| faces.get(f).value(y));
                if faces.is_guard(id.face()) {
                    return;
                }
                support.push((side, id, 1.0));
            }
        }
        let mut key: Vec<_> = support.iter().map(|l| (l.0, l.1)).collect();
        key.sort_unstable();
        if self.scratch.tried.iter().any(|(k, l)| *l == level && *k == key) {
            return;
        }
        self.scratch.tried.push((key, level));
        let t = cell.t + advance.dt.max(0.0);
        let active: Vec<_> = support.iter().map(|l| Constraint::Literal(l.0, l.1)).collect();
        // A fit weighs both of its literals: together they are 1 again.
        let total: f64 = support.iter().map(|l| l.2).sum();
        let lambda: Vec<_> = support.iter().map(|l| l.2 / total).collect();
        if self.polish(active.clone(), x, t, lambda.clone()) {
            return;
        }
        // Two like faces in a fit: their bound leaves open in which direction they meet.
        if let [p, q] = advance.support[..] {
            let (p, q) = if p.1.sense() == Sense::Positive { (p, q) } else { (q, p) };
            let face = |l: &(Side, LiteralId, f64)| {
                let solid = if l.0 == Side::A { self.task.a } else { self.task.b };
                &solid.faces[l.1.face() as usize]
            };
            let later = self.task.relative.at(t);
            if q.1.sense() == Sense::Negative
                && p.0 != q.0
                && let Some(x) = fit::first_off_axis(&later, (p.0, face(&p)), face(&q), x)
                && self.polish(active.clone(), x, t, lambda.clone())
            {
                return;
            }
        }
        // A surface that touches there too with next to no weight (a rim that lies almost in a face) is not in the
        // support, but without it the system has its solution elsewhere.
        if active.len() < MAX_ACTIVE {
            for close in self.closest_others(cell, &active, x, &self.task.relative.at(t)).into_iter().flatten() {
                let more = active.iter().copied().chain([close]).collect();
                if self.polish(more, x, t, lambda.iter().copied().chain([0.0]).collect()) {
                    return;
                }
            }
        }
        // A cone whose apex is near: the apex is a vertex of its own.
        let apex_of = |l: &(Side, LiteralId, f64)| {
            let solid = if l.0 == Side::A { self.task.a } else { self.task.b };
            let apex = solid.faces[l.1.face() as usize].apex()?.point;
            let apex = if l.0 == Side::A { apex } else { at.a_point(apex) };
            let near = (apex - cell.center).length() <= 4.0 * cell.half.length();
            (l.1.sense() == Sense::Positive && near).then_some(apex)
        };
        let apexes: Vec<_> = support.iter().filter_map(|l| Some((*l, apex_of(l)?))).collect();
        let vertex = |l: &(Side, LiteralId, f64)| {
            let (side, id, weight) = *l;
            (0..3).map(move |k| (Constraint::Apex(side, id, k), if k == 0 { -weight } else { 0.0 }))
        };
        for (l, apex) in &apexes {
            let others = support.iter().filter(|o| o.0 != l.0);
            let others = others.map(|o| (Constraint::Literal(o.0, o.1), o.2));
            let (active, lambda) = vertex(l).chain(others).take(MAX_ACTIVE).unzip();
            if self.polish(active, *apex, t, lambda) {
                return;
            }
        }
        if let [(l, apex), (m, _)] = apexes[..]
            && l.0 != m.0
        {
            let (active, lambda) = vertex(&l).chain(vertex(&m)).unzip();
            self.polish(active, apex, t, lambda);
        }
    }

    /// The two literals of a cell, other than `active`, whose surfaces are nearest to x: no farther than the cell is large.
    fn closest_others(&self, cell: &Cell, active: &[Constraint], x: DVec3, at: &Instant) -> [Option<Constraint>; 2] {
        let mut nearest = [(2.0 * cell.half.length(), None); 2];
        for (side, solid, range, y) in
            [(Side::A, self.task.a, cell.a, x), (Side::B, self.task.b, cell.b, at.b_point(x))]
        {
            for id in local::literals(&self.scratch.pool[range.0 as usize..range.1 as usize]) {
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

    /// True when the multiplied normals of every apex in a solution lie in its normal cone: within the right angle less
    /// the half angle of the direction away from the cone.
    fn holds_at_apexes(&self, s: &Solution, at: &Instant) -> bool {
        let problem = self.problem();
        s.active.iter().all(|c| {
            let Constraint::Apex(side, id, 0) = *c else { return true };
            let solid = if side == Side::A { self.task.a } else { self.task.b };
            let Some(Apex { axis, sin, .. }) = solid.faces[id.face() as usize].apex() else { return false };
            let axis = if side == Side::A { axis } else { at.a_vector(axis) };
            let same = s
                .active
                .iter()
                .zip(&s.lambda)
                .filter(|(o, _)| matches!(**o, Constraint::Apex(os, oid, _) if (os, oid) == (side, id)));
            let sum: DVec3 = same.map(|(o, l)| problem.row(o, s.x, at, 0.0).gradient * *l).sum();
            -sum.dot(axis) >= sum.length() * (sin - 1e-6)
        })
    }

    /// Newton from a guess of a whole-primitive shortcut, which needs no stage 2: true when a contact was confirmed. With
    /// `mend` an active set that does not hold is mended as the search does it, which costs many times more.
    pub(in crate::contact) fn confirm(
        &mut self,
        active: Actives,
        x: DVec3,
        t: f64,
        lambda: Weights,
        mend: bool,
    ) -> bool {
        if !has_both_sides(&active) {
            return false;
        }
        self.counters.newton += 1;
        self.handed.all = true;
        let confirmed = match self.problem().refine(
            &active,
            x,
            t,
            lambda.clone(),
            witness_level(self.task.delta, self.task.rounding),
        ) {
            Ok(s) if !(0.0..=1.0).contains(&s.t) || s.t >= self.goal() => false,
            Ok(s) => {
                let at = self.task.relative.at(s.t);
                let holds = |(c, l): (&Constraint, &f64)| matches!(c, Constraint::Apex(..)) || *l >= -1e-9;
                if s.active.iter().zip(&s.lambda).all(holds) && self.task.is_deep(s.x, &at, self.task.rounding) {
                    self.holds_at_apexes(&s, &at) && self.accept(s)
                } else {
                    mend && self.polish(active.into_vec(), s.x, s.t, s.lambda.into_vec())
                }
            }
            // A line or patch of contacts leaves x open: where the guess' multipliers hold, the surfaces alone tell the rest.
            Err(true) => match self.problem().along(
                &active,
                x,
                t,
                lambda.clone(),
                witness_level(self.task.delta, self.task.rounding),
            ) {
                Some(s) if (0.0..=1.0).contains(&s.t) && s.t < self.goal() && s.stationarity < SETTLED => {
                    let at = self.task.relative.at(s.t);
                    if self.task.is_deep(s.x, &at, self.task.rounding) {
                        self.holds_at_apexes(&s, &at) && self.accept(s)
                    } else {
                        mend && self.polish(active.into_vec(), x, t, lambda.into_vec())
                    }
                }
                // What turns into a line of contact has other multipliers there.
                _ => (mend || self.task.relative.turns()) && self.polish(active.into_vec(), x, t, lambda.into_vec()),
            },
            Err(false) => false,
        };
        self.handed.all = false;
        confirmed
    }

    /// The unit normal of a solution, from A, along A's axes.
    pub(in crate::contact) fn normal(&self, s: &Solution) -> Option<DVec3> {
        let at = self.task.relative.at(s.t);
        let problem = self.problem();
        let mut sum = DVec3::ZERO;
        for (c, l) in s.active.iter().zip(&s.lambda) {
            let (Constraint::Literal(side, _) | Constraint::Apex(side, _, _)) = *c;
            let sign = if side == Side::A { *l } else { -*l };
            sum += problem.row(c, s.x, &at, 0.0).gradient * sign;
        }
        sum.try_normalize()
    }

    /// Newton from a guess, with the active set mended by what the trees say; true when a contact with settled
    /// multipliers was confirmed.
    fn polish(&mut self, active: Vec<Constraint>, x: DVec3, t: f64, lambda: Vec<f64>) -> bool {
        // A whole-primitive guess that leads nowhere is given up early: the next one is from nearer.
        let patient = !self.handed.all;
        self.polish_for(patient, active, x, t, lambda)
    }

    /// The same, patient or not.
    pub(super) fn polish_for(
        &mut self,
        patient: bool,
        mut active: Vec<Constraint>,
        x: DVec3,
        t: f64,
        mut lambda: Vec<f64>,
    ) -> bool {
        let level = witness_level(self.task.delta, self.task.rounding);
        for _ in 0..7 {
            debug_assert!(
                active.iter().all(|c| self.handed.knows(&self.task, c)),
                "stage 3 asks for a primitive that stage 2 has not handed over: {active:?}"
            );
            self.counters.newton += 1;
            let Some(s) = self.problem().solve(&active, x, t, &lambda, level, patient) else { return false };
            // Where only an unsettled witness is known, a settled one of the same time is still worth having.
            let settled = self.found.as_ref().is_none_or(|f| f.deep.stationarity < SETTLED);
            let latest = match &self.found {
                Some(f) if settled => f.latest_rival(),
                _ => self.goal() + SAME_TIME,
            };
            if s.t < 0.0 || s.t > 1.0 || s.t >= latest || self.is_found(&s) {
                return false;
            }
            // A negative multiplier: that literal holds nothing back.
            let worst = (0..active.len())
                .filter(|i| matches!(active[*i], Constraint::Literal(..)))
                .min_by(|i, j| s.lambda[*i].total_cmp(&s.lambda[*j]));
            if let Some(i) = worst.filter(|i| s.lambda[*i] < -1e-9 && s.stationarity < SETTLED) {
                if active.len() <= 2 {
                    return false;
                }
                active.remove(i);
                lambda.remove(i);
                if !has_both_sides(&active) {
                    return false;
                }
                continue;
            }
            let at = self.task.relative.at(s.t);
            // Whatever rounding did: a witness of depth delta.
            if self.task.is_deep(s.x, &at, self.task.rounding) {
                return self.holds_at_apexes(&s, &at) && self.accept(s);
            }
            // Something else decides there: it enters, the smallest multiplier leaves. A primitive that the walk has not
            // handed over is not asked.
            let entering = self.deciding(s.x, &at);
            if active.contains(&entering) || !self.handed.knows(&self.task, &entering) {
                return false;
            }
            if active.len() >= 4 {
                let weakest = (0..active.len())
                    .filter(|i| matches!(active[*i], Constraint::Literal(..)))
                    .min_by(|i, j| s.lambda[*i].total_cmp(&s.lambda[*j]));
                let Some(i) = weakest else { return false };
                active.remove(i);
                lambda.remove(i);
            }
            active.push(entering);
            lambda.push(0.25);
            if !has_both_sides(&active) {
                return false;
            }
        }
        false
    }

    /// Looks for a witness where the equations of a contact are too ill-conditioned to be solved, at the edge of a crescent: the
    /// deepest common point beside x, a little later than `t`. What it tells is a bound on the time and no more: everything
    /// before is still searched.
    pub(super) fn deepen(&mut self, x: DVec3, t: f64, support: &[(Side, LiteralId, f64)]) {
        let level = witness_level(self.task.delta, self.task.rounding) + self.task.rounding;
        let climbed = |later: f64| {
            let at = self.task.relative.at(later);
            let (x, ..) = depth::climb(&self.task, &at, x, &Work::new(u64::MAX));
            (separation::value(&self.task, &at, x) <= -level).then_some(x)
        };
        let (mut before, mut after) = (0.0, None);
        for k in 0..LATER {
            let wait = FIRST_WAIT * 10f64.powi(k);
            if t + wait > 1.0 {
                break;
            }
            if let Some(x) = climbed(t + wait) {
                after = Some((wait, x));
                break;
            }
            before = wait;
        }
        let Some((mut wait, mut deepest)) = after else { return };
        while wait > 1.1 * before + 1e-2 * FIRST_WAIT {
            let middle = 0.5 * (before + wait);
            match climbed(t + middle) {
                Some(x) => (wait, deepest) = (middle, x),
                None => before = middle,
            }
        }
        let total: f64 = support.iter().map(|l| l.2).sum();
        let active: Actives = support.iter().take(MAX_ACTIVE).map(|l| Constraint::Literal(l.0, l.1)).collect();
        let lambda: Weights = support.iter().take(MAX_ACTIVE).map(|l| l.2 / total).collect();
        // From so near the equations may still be solved.
        if has_both_sides(&active) && self.polish(active.to_vec(), deepest, t + wait, lambda.to_vec()) {
            return;
        }
        let witness = Solution { x: deepest, t: t + wait, active, lambda, stationarity: f64::INFINITY };
        if self.task.is_deep(deepest, &self.task.relative.at(t + wait), self.task.rounding) && witness.t < self.goal() {
            self.accept(witness);
        }
    }

    /// The literal that keeps x from being deep in both bodies.
    fn deciding(&self, x: DVec3, at: &Instant) -> Constraint {
        let mut worst: Option<(f64, Constraint)> = None;
        for (side, model, y) in [(Side::A, self.task.model_a, x), (Side::B, self.task.model_b, at.b_point(x))] {
            let (v, id) = model.deciding(y);
            if worst.as_ref().is_none_or(|w| v > w.0) {
                worst = Some((v, Constraint::Literal(side, id)));
            }
        }
        worst.expect("two bodies").1
    }

    /// Remembers where the curved convex faces of a solution are touched.
    fn hint(&mut self, s: &Solution) {
        let at = self.task.relative.at(s.t);
        for c in &s.active {
            let Constraint::Literal(side, id) = *c else { continue };
            let (solid, point) = if side == Side::A { (self.task.a, s.x) } else { (self.task.b, at.b_point(s.x)) };
            if id.sense() == Sense::Negative || solid.faces[id.face() as usize].is_flat() {
                continue;
            }
            if self.scratch.hints.len() == MAX_HINTS {
                self.scratch.hints.remove(0);
            }
            self.scratch.hints.push(Hint { side, id, point });
        }
    }

    /// True for the contact that is known already.
    fn is_found(&self, s: &Solution) -> bool {
        self.found.as_ref().is_some_and(|f| {
            f.deep.stationarity < SETTLED
                && (f.deep.t - s.t).abs() <= SAME_TIME
                && (f.deep.x - s.x).length() <= SAME_POINT * self.task.scale
        })
    }

    /// Keeps a confirmed witness if it is the earliest; continues it back to the touch.
    fn accept(&mut self, deep: Solution) -> bool {
        self.hint(&deep);
        if !self.task.query_options.time() {
            // A witness is all of a hit, once the start is known to be free: what is left to refine is what lies there.
            let goal = self.now().max(f64::MIN_POSITIVE);
            self.found = Some(Found { upper: deep.t, witness: deep.x, deep, touch: None, goal });
            return true;
        }
        let settled = deep.stationarity < SETTLED;
        if !settled {
            // A witness, but an earlier one lies beside it: everything before it is still searched, and so is the start.
            let goal = deep.t.max(f64::MIN_POSITIVE);
            if goal < self.goal() {
                self.found = Some(Found { upper: deep.t, witness: deep.x, deep, touch: None, goal });
            }
            return false;
        }
        let problem = self.problem();
        let continues = self.task.continues();
        // A whole primitive's contact is regular as a rule: a plain step or two.
        let plain = (continues && self.handed.all)
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
        let touch = match touch {
            Some(s) if holds(&s) => Some(s),
            other if continues => self.continued_by_steps(&deep).or(other),
            other => other,
        };
        let at = self.task.relative.at(deep.t);
        let rates = deep.active.iter().zip(&deep.lambda).map(|(c, l)| l * problem.row(c, deep.x, &at, 0.0).rate);
        let speed = rates.sum::<f64>().abs().max(f64::MIN_POSITIVE);
        // The depth delta itself is reached a little before the witness, which a slow pair takes its time for.
        let crossing = deep.t - (witness_level(self.task.delta, self.task.rounding) - self.task.delta) / speed;
        // Rounding forbids to prove what is nearer to the crossing.
        let reserve = 4.0 * self.task.rounding / speed;
        let goal = match &touch {
            Some(s) if s.t > 0.0 => 0.5 * (s.t + deep.t),
            // Touching at the start: nothing but the start needs a proof.
            Some(_) => (0.5 * crossing).min(crossing - reserve),
            None => crossing - (0.25 * self.task.delta / speed).clamp(1e-15, 1e-9).max(reserve),
        };
        let goal = goal.max(f64::MIN_POSITIVE);
        let new = Found { upper: deep.t, witness: deep.x, deep, touch, goal };
        self.found = Some(match self.found.take() {
            // One that has not settled is only a bound on the time.
            Some(old) if old.deep.stationarity >= SETTLED => {
                let (upper, witness) = new.earlier_witness(&old);
                Found { upper, witness, goal: new.goal.min(old.goal), ..new }
            }
            Some(old) => old.or(new),
            None => new,
        });
        true
    }

    /// True when the surfaces meet in a solution, as both whole trees say, no later than the witness.
    pub(super) fn is_touch(&self, s: &Solution, latest: f64) -> bool {
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
            let problem = self.problem();
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
        let beside = self.deciding(s.x, &self.task.relative.at(s.t));
        let full = s.active.len() == MAX_ACTIVE;
        if full || s.active.contains(&beside) || !self.handed.knows(&self.task, &beside) {
            return None;
        }
        let active: Vec<_> = s.active.iter().copied().chain([beside]).collect();
        let lambda: Vec<_> = s.lambda.iter().copied().chain([0.0]).collect();
        self.problem().solve(&active, s.x, s.t, &lambda, 0.0, true).filter(|s| self.is_touch(s, latest))
    }
}

/// True when a solution's multipliers balance and none pulls.
fn holds(s: &Solution) -> bool {
    let pushes = |(c, l): (&Constraint, &f64)| matches!(c, Constraint::Apex(..)) || *l >= -1e-6;
    s.stationarity < SETTLED && s.active.iter().zip(&s.lambda).all(pushes)
}

pub(super) fn has_both_sides(active: &[Constraint]) -> bool {
    let side = |c: &Constraint| match c {
        Constraint::Literal(s, _) | Constraint::Apex(s, _, _) => *s,
    };
    active.iter().any(|c| side(c) == Side::A) && active.iter().any(|c| side(c) == Side::B)
}
