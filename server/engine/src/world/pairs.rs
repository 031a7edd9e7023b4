//! Which pairs of a step are searched: those that neither path lengths, nor a direction, nor swept boxes keep apart.

use super::boxes::SweptBoxes;
use super::neighbours::{Neighbours, PairHint};
use super::notes::{Decided, Notes};
use super::options::StepOptions;
use super::plan::PairPlan;
use super::roster::Roster;
use super::search::PairJob;
use super::state::StepState;
use super::swept_shapes::SweptShapes;
use crate::contact::{AxisSearch, SeparatingAxisTest};
use crate::solid::Shape;

/// Fills the jobs: the pairs to ask about, plan by plan in the order of their ids; every pair when all are to be told.
pub(super) fn find(roster: &Roster, state: &mut StepState, options: &StepOptions) {
    let StepState { neighbours, boxes, swept_shapes, near, jobs, notes, serial, glanced, .. } = state;
    if let Some(notes) = notes {
        notes.begin(*options);
    }
    neighbours.update(&roster.bodies, |body, way| roster.reach(body, way), |i, j| roster.pair(i, j));
    boxes.begin(*serial, roster.bodies.len());
    jobs.clear();
    let mut sieve = Sieve { roster, neighbours, boxes, swept_shapes, notes: notes.as_deref_mut(), glanced: 0 };
    if options.clear {
        sieve.all_pairs(0..roster.bodies.len() as u32, |_| true, jobs)
    } else {
        sieve.near_pairs(near, jobs);
        if roster.plans.measures() {
            let is_measured = |i: &u32| roster.plans.is_measured(roster.bodies[*i as usize].group);
            sieve.all_pairs((0..roster.bodies.len() as u32).filter(is_measured), PairPlan::reports_clearance, jobs);
        }
    }
    *glanced = sieve.glanced;
}

/// What met mostly does so again: no look is worth its while before it is known what a search finds.
fn is_asked_unseen(hint: &PairHint) -> bool {
    hint.met && !hint.discrete
}

/// What tells pairs that are apart from those to ask about.
pub(super) struct Sieve<'a> {
    pub(super) roster: &'a Roster,
    pub(super) neighbours: &'a mut Neighbours,
    pub(super) boxes: &'a mut SweptBoxes,
    pub(super) swept_shapes: &'a mut SweptShapes,
    pub(super) notes: Option<&'a mut Notes>,
    /// How many pairs a direction has proved apart.
    pub(super) glanced: u32,
}

impl Sieve<'_> {
    /// True when a pair that a limit left open is apart, as a session that does not know that it met before would have seen without a
    /// search; it is clear then.
    pub(super) fn sees_apart(&mut self, job: &mut PairJob, options: &StepOptions) -> bool {
        // A pair of which something is told in any case is asked about by boxes alone.
        if options.clear || job.plan.reports_clearance() {
            return false;
        }
        let Some(pair) = job.pair else { return false };
        let hint = *self.neighbours.pair_hint(pair);
        let apart = is_asked_unseen(&hint) && !self.seems_to_meet(pair, &hint);
        if apart {
            job.take_for_apart();
        }
        apart
    }

    /// A job for every pair of some bodies that has a plan of which something is told in any case; the excluded ones are listed too.
    fn all_pairs(
        &mut self,
        of: impl Iterator<Item = u32> + Clone,
        is_told: impl Fn(&PairPlan) -> bool,
        jobs: &mut Vec<PairJob>,
    ) {
        let rest = of.clone();
        for (i, j) in of.flat_map(|i| rest.clone().filter(move |j| *j > i).map(move |j| (i, j))) {
            let Some((index, plan, resolution)) = self.roster.pair(i, j) else { continue };
            if !is_told(&plan) {
                continue;
            }
            // Side by side: bodies whose corners are farther apart may be within it.
            let reach = 0.5 * plan.reach();
            let boxes = [i, j].map(|k| self.boxes.of(k, self.roster));
            let near = boxes[0].grown(reach).meets(&boxes[1].grown(reach));
            let found = self.neighbours.find(i, j);
            let pair = found.filter(|pair| near && !self.neighbours.is_apart(*pair));
            if let (Some(notes), None) = (&mut self.notes, pair) {
                let apart = found.is_some_and(|pair| self.neighbours.is_apart(pair));
                notes.decided((i, j), if apart { Decided::Clearance } else { Decided::boxes(boxes[0], boxes[1]) });
            }
            let pair = pair.map(|pair| (pair, self.neighbours.lend(pair).1));
            jobs.push(PairJob::new((i, j), (index, plan), resolution, near, pair));
        }
        if self.roster.plans.count() > 1 {
            jobs.sort_unstable_by_key(|job| (job.plan_index, job.a, job.b));
        }
    }

    /// A job for each pair that is to be asked about; `near` is room for their places in the list of neighbours.
    fn near_pairs(&mut self, near: &mut Vec<usize>, jobs: &mut Vec<PairJob>) {
        near.clear();
        self.neighbours.each_near(|pair| near.push(pair));
        if self.roster.plans.measures() {
            // Something is told of these wherever they are.
            near.retain(|pair| !self.roster.plans.plan(self.neighbours.plan(*pair)).reports_clearance());
        }
        if self.roster.plans.count() > 1 {
            near.sort_unstable_by_key(|pair| (self.neighbours.plan(*pair), *pair));
        }
        near.retain(|&pair| self.may_meet(pair));
        // In a loop of its own: what is known of pairs lies all over the memory, which answers several at a time.
        for &pair in near.iter() {
            let plan_index = self.neighbours.plan(pair);
            let plan = (plan_index, *self.roster.plans.plan(plan_index));
            let (resolution, pair_cache) = self.neighbours.lend(pair);
            let bodies = self.neighbours.bodies(pair);
            jobs.push(PairJob::new(bodies, plan, resolution, true, Some((pair, pair_cache))));
        }
    }

    /// False where a direction or the swept boxes prove a pair apart.
    #[inline]
    fn may_meet(&mut self, pair: usize) -> bool {
        let hint = *self.neighbours.pair_hint(pair);
        is_asked_unseen(&hint) && self.goes_unseen(pair, &hint) || self.seems_to_meet(pair, &hint)
    }

    /// True when nothing shows whether a pair that met before is apart, but what is known of it or a search. Where nothing is glanced at
    /// the swept boxes decide what is asked about, whether the bodies have met or not: trees are near each other by f, whose levels
    /// reach beyond turned boxes, and what is told of that must not depend on what is remembered. Without a margin or regions nothing is.
    fn goes_unseen(&self, pair: usize, hint: &PairHint) -> bool {
        let plan = self.roster.plans.plan(self.neighbours.plan(pair));
        !plan.reports_nearness() || self.can_glance(self.neighbours.bodies(pair), hint)
    }

    /// False where a direction or, of bodies without a hull, the swept boxes prove a pair apart. Of discrete pairs those are counted that
    /// may have passed through each other: by their boxes alone.
    #[inline]
    fn seems_to_meet(&mut self, pair: usize, hint: &PairHint) -> bool {
        let bodies = self.neighbours.bodies(pair);
        if !hint.discrete
            && let Some(axis_test) = self.axis_test(bodies, hint)
        {
            self.take_axis_test(pair, hint, &axis_test);
            return !axis_test.apart;
        }
        let plan = self.roster.plans.plan(self.neighbours.plan(pair));
        self.boxes_meet(pair, plan.reach(), hint.discrete)
    }

    /// Takes what a direction has told of a pair.
    #[inline]
    fn take_axis_test(&mut self, pair: usize, hint: &PairHint, axis_test: &SeparatingAxisTest) {
        if self.notes.is_some() {
            self.note_axis_test(pair, hint, axis_test);
        }
        self.neighbours.noticed(pair, axis_test);
        self.glanced += u32::from(axis_test.apart);
    }

    #[cold]
    fn note_axis_test(&mut self, pair: usize, hint: &PairHint, axis_test: &SeparatingAxisTest) {
        let bodies = self.neighbours.bodies(pair);
        // The directions by which the test keeps the pair apart.
        let last = if axis_test.apart { self.glancing(bodies, hint).map(|g| g.directions(hint.along)) } else { None };
        if let Some(notes) = &mut self.notes {
            notes.glanced(bodies, &self.roster.bodies, axis_test);
            if axis_test.apart {
                let last = last.flatten().unwrap_or([axis_test.along; 2]);
                notes.decided(bodies, Decided::Directions(last));
            }
        }
    }

    /// False when the swept boxes of a pair are farther apart than `reach`; how far is noted.
    #[inline]
    fn boxes_meet(&mut self, pair: usize, reach: f64, discrete: bool) -> bool {
        self.neighbours.box_tests += 1;
        let (i, j) = self.neighbours.bodies(pair);
        let boxes = [i, j].map(|k| self.boxes.of(k, self.roster));
        if boxes[0].grown(0.5 * reach).meets(&boxes[1].grown(0.5 * reach)) {
            return true;
        }
        // Side by side, as they are compared: boxes whose corners are farther apart may meet sooner.
        let clearance = boxes[0].gap(&boxes[1]) - reach;
        if let Some(notes) = &mut self.notes {
            notes.decided((i, j), Decided::boxes(boxes[0], boxes[1]));
            if !discrete {
                notes.apart_by((i, j), &self.roster.bodies, clearance, boxes);
            }
        }
        if !discrete {
            self.neighbours.note(pair, clearance);
        }
        false
    }

    /// True when a pair is one that is glanced at: both bodies have hulls, out as far as they matter to each other.
    fn can_glance(&self, (i, j): (u32, u32), hint: &PairHint) -> bool {
        let bodies = &self.roster.bodies;
        let holds = |k: u32| bodies[k as usize].hull.as_ref().is_some_and(|hull| hull.holds(hint.touch));
        !hint.discrete && holds(i) && holds(j)
    }

    /// What a direction tells of a pair of convex bodies.
    #[inline]
    fn axis_test(&mut self, bodies: (u32, u32), hint: &PairHint) -> Option<SeparatingAxisTest> {
        Some(self.glancing(bodies, hint)?.look(hint.along))
    }

    /// A look at two convex bodies; `None` where one of them has no hull.
    #[inline]
    fn glancing<'b>(
        &'b mut self,
        (i, j): (u32, u32),
        hint: &PairHint,
    ) -> Option<AxisSearch<'b, impl Fn(usize) -> Option<&'b Shape>>> {
        let (indices, bodies) = ([i as usize, j as usize], &self.roster.bodies);
        let seen = self.swept_shapes.look(indices, bodies)?;
        let shapes = move |k: usize| {
            let body = &bodies[indices[k]];
            body.hull.as_ref()?.shape(&body.part.model)
        };
        AxisSearch::new(seen, shapes, hint.touch)
    }
}
