//! Earliest contact of one pair over one step: from the question to the answer.

use super::front;
use super::report::{DEPTHS, NEAR_DEPTH, contact_of, fill_overlap};
use super::unbounded;
use crate::contact::ball;
use crate::contact::cavity;
use crate::contact::convex::{self, Quick};
use crate::contact::facets::Front;
use crate::contact::instant::depth;
use crate::contact::instant::separation;
use crate::contact::instant::work::Work;
use crate::contact::query::outcome::{Counters, Outcome, Penetration, Status, Verdict};
use crate::contact::query::question::PairQuery;
use crate::contact::query::task::{NEARLY_DEEP, RAISES, SUNK, Task, clear_of_walls, raised};
use crate::contact::queue::clock::Stage;
use crate::contact::queue::scratch::Scratch;
use crate::contact::queue::search::Search;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::extent::INCIDENT;
use crate::contact::witness::found::{Ending, Found};
use crate::contact::witness::known::Known;
use crate::contact::witness::newton::Solution;
use crate::contact::witness::retreat::{BACK, Climber};
use crate::contact::witness::touch::Touch;
use crate::math::halt;
use crate::motion::Placed;
use glam::DVec3;

/// The resolution that a question's answer will tell: its own, or the least that its rounding allows.
pub fn resolution_of(query: &PairQuery) -> f64 {
    unbounded::resolution(query).unwrap_or_else(|| Task::of(query).0.delta)
}

/// Searches a pair to its end.
pub fn earliest_contact(query: &PairQuery, scratch: &mut Scratch) -> Outcome {
    let mut outcome = clear(query);
    find_earliest(query, scratch, &mut outcome);
    outcome
}

/// The same, written to a place: of thousands of pairs copies would take as long as the easiest of them.
pub fn find_earliest(query: &PairQuery, scratch: &mut Scratch, outcome: &mut Outcome) {
    scratch.enter(Stage::Front);
    match convex::balls(query) {
        Some(passage) => *outcome = passage.outcome(query),
        None => earliest(query, scratch, outcome),
    }
    scratch.enter(None);
}

/// The same for what is no pair of balls. A function of its own, so that what is told stays where it was written.
#[inline(never)]
fn earliest(query: &PairQuery, scratch: &mut Scratch, outcome: &mut Outcome) {
    *outcome = clear(query);
    let quick = whole(query, outcome);
    if !matches!(quick, Quick::Reported) {
        search(query, quick, outcome, scratch);
    }
}

/// What is told without a search of a pair that is no pair of balls; `outcome` is clear before.
fn whole(query: &PairQuery, outcome: &mut Outcome) -> Quick {
    if let Some(reported) = unbounded::reported(query) {
        *outcome = reported;
        return Quick::Reported;
    }
    convex::quick(query, outcome)
}

/// Answers what is not told without a search.
#[inline(never)]
fn search(query: &PairQuery, quick: Quick, outcome: &mut Outcome, scratch: &mut Scratch) {
    let (task, swapped) = Task::of(query);
    let mut search = PairSearch::of_task(query, task, swapped, (quick, outcome), std::mem::take(scratch));
    *outcome = search.run(f64::INFINITY).expect("a search without a horizon ends");
    *scratch = search.into_scratch();
}

/// What is told of two bodies that do not meet, so far.
fn clear(query: &PairQuery) -> Outcome {
    let resolution = query.resolution;
    let counters = Counters { primitives: 2, ..Counters::default() };
    Outcome { resolution, depth: resolution, counters, ..Outcome::default() }
}

/// What is told of two whole primitives without a search; `outcome` is clear before.
fn quick(query: &PairQuery, outcome: &mut Outcome) -> Quick {
    match convex::balls(query) {
        Some(passage) => {
            *outcome = passage.outcome(query);
            Quick::Reported
        }
        None => whole(query, outcome),
    }
}

/// Roundings about twice the resolution within which a start is just that deep. A search could neither exclude nor confirm it until
/// its cells are as small as rounding lets a bound tell them apart: along a rim these are thousands.
const JUST: f64 = 16.0;

/// Effort (`Counters::effort`) after which a coarser resolution is tried.
const PATIENCE: u64 = 100_000;

/// How much coarser, and how often.
const COARSER: f64 = 32.0;
const COARSENINGS: usize = 3;

/// The largest that a resolution becomes by that, relative to the smallest primitive.
const LARGEST_COARSE: f64 = 1e-3;

/// Resolutions that the thinnest primitive is thick at least, where rounding raises them: deeper than that it has no inside left.
const LEAST_THICKNESS: f64 = 4.0;
/// What a raise is a multiple of the resolution before it by at least, where it is rounding that is large.
const SWALLOWED: f64 = 1.5;

/// What a search that took too long has proven: no point is `depth` deep in both bodies before `free_until`, or before the contact found's
/// own goal.
#[derive(Debug)]
struct Open {
    resolution: f64,
    depth: f64,
    free_until: f64,
    /// A contact that is known, much later.
    found: Option<Found>,
}

/// How far a pair has come.
#[expect(
    clippy::large_enum_variant,
    reason = "one a pair, which stays in its place: a box would be an allocation more"
)]
enum State<'a> {
    /// Not begun; perhaps a direction (world axes) that separates the bodies at the start.
    Posed(Option<DVec3>, Scratch),
    /// Not begun, of bodies that overlap at the start: a common point, and what was told of it.
    Overlap(DVec3, Outcome, Scratch),
    /// Answered without a search, whose memory is given back.
    Reported(Outcome, Scratch),
    /// Ended by a kernel in front of the search: how, until it is told; its work; the memory of the search that was not needed.
    Ended(Option<Ending>, Counters, Scratch),
    /// Searched. In a place of its own: what a kernel answers is not to be moved with room for a search.
    Searching(Box<Search<'a>>),
}

impl State<'_> {
    fn into_scratch(self) -> Scratch {
        match self {
            State::Posed(_, scratch)
            | State::Overlap(_, _, scratch)
            | State::Reported(_, scratch)
            | State::Ended(_, _, scratch) => scratch,
            State::Searching(search) => search.into_scratch(),
        }
    }
}

/// The search of one pair, to be run piece by piece: a scene that asks only for its first contact runs each pair no
/// further than the earliest contact known.
pub struct PairSearch<'a> {
    task: Task<'a>,
    /// The query's b carries the cells.
    swapped: bool,
    /// 1 or 2: the depth that is searched, in resolutions.
    level: f64,
    state: State<'a>,
    /// The answer as far as it is known; its counters are of the searches that have ended.
    outcome: Outcome,
    resolution: f64,
    /// How often the resolution was raised since rounding left its depth untold.
    raised: usize,
    /// How often the resolution was made coarser since a search took too long, and what the first of these had proven.
    coarser: usize,
    /// No coarser resolution is to be tried: the search goes on until its work limit.
    insists: bool,
    open: Option<Box<Open>>,
    /// The bodies of the question as they move, where the search leaves out a spin that moves nothing: what closes in along a normal is
    /// told of these.
    spun: Option<Box<[Placed; 2]>>,
    /// Cells that the question allows.
    limit: u64,
    /// Cells' worth of work of the searches that have ended: at other depths.
    spent: u64,
}

impl<'a> PairSearch<'a> {
    /// Runs as `run` does, but refines at most `cells` more cells: a search that would need more is undecided.
    pub fn run_within(&mut self, until: f64, cells: u64) -> Option<Outcome> {
        if !matches!(self.state, State::Reported(..)) {
            let done = self.under_way().map_or(0, |counters| counters.spent(self.limit));
            let limit = self.limit.saturating_sub(self.spent).min(done.saturating_add(cells));
            if let State::Searching(search) = &mut self.state {
                search.limit_to(limit);
            }
            self.task.limit = limit;
        }
        self.run(until)
    }

    /// Prepares the search of a pair.
    pub fn new(query: &PairQuery<'a>, scratch: Scratch) -> Self {
        let (task, swapped) = Task::of(query);
        let mut outcome = clear(query);
        let quick = quick(query, &mut outcome);
        Self::of_task(query, task, swapped, (quick, &outcome), scratch)
    }

    /// Prepares the search of a task, of which a quick look has told something.
    fn of_task(
        query: &PairQuery<'a>,
        task: Task<'a>,
        swapped: bool,
        (quick, before): (Quick, &Outcome),
        scratch: Scratch,
    ) -> Self {
        let counters = Counters {
            primitives: (task.a.primitives.len() + task.b.primitives.len()) as u64,
            closed_forms: before.counters.closed_forms,
            ..Counters::default()
        };
        let outcome = Outcome { resolution: task.delta, depth: task.delta, counters, ..Outcome::default() };
        // Far out, or on the way there, rounding may take more than there is of a body: then no depth tells anything of it.
        let is_raised = task.delta > query.resolution;
        let state = match quick {
            Quick::Open(_) if is_raised && task.thinnest() <= LEAST_THICKNESS * task.delta => {
                let verdict = Verdict::Undecided { time_lower: 0.0 };
                State::Reported(Outcome { verdict, resolution: task.delta, ..*before }, scratch)
            }
            Quick::Overlap(x) => State::Overlap(x, *before, scratch),
            Quick::Open(along) => State::Posed(along, scratch),
            Quick::Reported => State::Reported(*before, scratch),
        };
        let spins = |(a, b): (Placed, Placed)| [a.motion.spin, b.motion.spin];
        let moving = if swapped { (query.b.placed, query.a.placed) } else { (query.a.placed, query.b.placed) };
        let spun = (spins(moving) != spins(task.relative.placed())).then(|| Box::new([query.a.placed, query.b.placed]));
        Self {
            task,
            swapped,
            level: 1.0,
            state,
            outcome,
            resolution: task.delta,
            raised: 0,
            coarser: 0,
            insists: false,
            open: None,
            spun,
            limit: query.cell_limit,
            spent: 0,
        }
    }

    /// Begins: with what a quick look has told, or by asking the kernels in front of the queue.
    fn begin(&mut self) {
        match &mut self.state {
            State::Posed(along, scratch) => {
                let (along, scratch) = (*along, std::mem::take(scratch));
                self.state = self.begun(along, scratch);
            }
            State::Overlap(x, before, _) => {
                let (x, before) = (*x, *before);
                if !self.goes_past(x, 0) {
                    self.state = State::Reported(self.overlaps(x, Some(&before)), self.take_scratch());
                }
            }
            _ => {}
        }
    }

    /// How far the kernels come; `along` separates the bodies at the start.
    fn begun(&self, along: Option<DVec3>, mut scratch: Scratch) -> State<'a> {
        let mut contacts = Contacts::new(self.task);
        let told = halt::attempt(|| front::kernels(&mut contacts, along, &mut scratch));
        let from = match told.unwrap_or(Front::Ended(Ending::Limit(0.0))) {
            Front::Ended(ending) => return State::Ended(Some(ending), contacts.counters, scratch),
            Front::Free(until) => until,
            Front::Open => 0.0,
        };
        let mut search = Box::new(Search::new(contacts, scratch));
        search.start(from);
        if self.task.strategies.coarser {
            search.patience = PATIENCE;
        }
        State::Searching(search)
    }

    /// The answer for an overlap at the start with the common point x, of which something may have been told.
    fn overlaps(&self, x: DVec3, reported: Option<&Outcome>) -> Outcome {
        let (task, mut outcome) = (&self.task, self.outcome);
        if let Some(reported) = reported {
            let counters = outcome.counters;
            outcome = Outcome { resolution: outcome.resolution, counters: reported.counters, ..*reported };
            outcome.counters += Counters { primitives: 0, closed_forms: 0, ..counters };
        } else {
            fill_overlap(&mut outcome, task, x);
            if self.swapped {
                outcome.swap_sides();
            }
        }
        if task.query_options.penetration {
            let at = task.relative.at(0.0);
            let work = Work::new(task.limit.min(depth::MOST_CELLS));
            let Some((deepest, direction, depth, _)) = halt::attempt(|| depth::deepest(task, &at, x, &work)) else {
                return outcome;
            };
            let sign = if self.swapped { -1.0 } else { 1.0 };
            let penetration = Penetration {
                depth: 2.0 * depth,
                point: task.relative.world_point(&at, deepest),
                direction: (at.world_from_a * direction * sign).normalize(),
            };
            if let Verdict::Overlap(overlap) = &mut outcome.verdict {
                overlap.penetration = Some(penetration);
            }
            outcome.counters.instant_cells += work.cells();
            outcome.counters.penetrations += 1;
        }
        outcome
    }

    /// Searches on past an overlap at the start with the common point x, where that is asked for: for a contact deeper
    /// than the start by delta; `cells` were spent. False when it is not, or when the work allowed does not prove how deep the
    /// start is.
    fn goes_past(&mut self, x: DVec3, cells: u64) -> bool {
        if !self.task.query_options.past_overlap || self.task.ignored_depth > 0.0 {
            return false;
        }
        let work = Work::new(self.task.limit.min(depth::MOST_CELLS));
        let deepest = depth::at_most(&self.task, &self.task.relative.at(0.0), x, &work);
        self.outcome.counters.instant_cells += work.cells();
        // Of the question's limit, too: a search that is run piece by piece works out anew what it may still spend.
        self.spent += work.cells();
        let Some(deepest) = deepest else { return false };
        self.outcome.counters.past_overlaps += 1;
        (self.outcome.touching, self.outcome.past) = (true, true);
        self.task.ignored_depth = deepest;
        // What fits say holds for depths that are small against the bodies.
        self.task.strategies.fits = false;
        self.task.start_tolerance = 0.0;
        self.level = 1.0;
        self.restart(cells + work.cells());
        true
    }

    /// The depth that is searched for now: what is free until `earliest` is so of this depth.
    pub fn depth(&self) -> f64 {
        match &self.state {
            State::Reported(reported, _) => reported.depth,
            _ => self.task.delta,
        }
    }

    /// The resolution that the search has come to by now.
    pub fn resolution(&self) -> f64 {
        match &self.state {
            State::Reported(reported, _) => reported.resolution,
            _ => self.resolution,
        }
    }

    /// True when an overlap at the start is searched past.
    pub fn is_past(&self) -> bool {
        self.task.ignored_depth > 0.0
    }

    /// No contact of this pair is earlier; infinite when nothing is left to search.
    pub fn earliest(&self) -> f64 {
        match &self.state {
            State::Posed(..) | State::Overlap(..) => 0.0,
            State::Reported(Outcome { verdict: Verdict::Clear { .. }, .. }, _) => f64::INFINITY,
            State::Reported(reported, _) => reported.time_lower(),
            State::Ended(Some(Ending::Contact(found)), ..) => found.goal,
            State::Ended(Some(Ending::Deep(_)), ..) => 0.0,
            State::Ended(..) => f64::INFINITY,
            State::Searching(search) => search.earliest(),
        }
    }

    /// Runs until the answer is found, or until no contact before or at `until` is left to find: then `None`.
    pub fn run(&mut self, until: f64) -> Option<Outcome> {
        self.begin();
        if let State::Reported(reported, _) = &self.state {
            return (reported.status() == Status::Clear || reported.time_lower() <= until).then_some(*reported);
        }
        loop {
            let (ending, cells) = self.ending(until)?;
            let open = self.open_at(ending.proven());
            let answer = halt::attempt(|| self.answer(ending, cells)).unwrap_or_else(|| Some(self.unwound(&open)));
            if answer.is_some() {
                return answer;
            }
        }
    }

    /// What is proven where a search has found nothing before `t`, or what a finer one has.
    fn open_at(&self, t: f64) -> Open {
        let (resolution, depth, free_until) = match &self.open {
            Some(open) => (open.resolution, open.depth, open.free_until),
            None => (self.resolution, self.task.delta, t),
        };
        Open { resolution, depth, free_until, found: None }
    }

    /// The answer where the time of the step was up before an ending was told.
    fn unwound(&mut self, open: &Open) -> Outcome {
        self.open = None;
        self.outcome.verdict = Verdict::Undecided { time_lower: open.free_until };
        Outcome { resolution: open.resolution, depth: open.depth, ..self.outcome }
    }

    /// How the search ends, and the cells' worth of work that it took; `None` where it comes to `until` first.
    fn ending(&mut self, until: f64) -> Option<(Ending, u64)> {
        let is_last = self.raised >= SUNK || self.next_raise().is_none();
        let (ending, counters) = match &mut self.state {
            State::Posed(..) | State::Overlap(..) | State::Reported(..) => return None,
            State::Ended(Some(Ending::Contact(found)), ..) if found.goal > until => return None,
            State::Ended(ending, counters, _) => (ending.take()?, std::mem::take(counters)),
            State::Searching(search) => {
                let ending = search.run(until)?;
                // Rounding that no larger depth helps against: what is proven and a witness behind it are the answer.
                let last = matches!(ending, Ending::Rounding(_)) && is_last;
                let ending = if last { search.rescue().unwrap_or(ending) } else { ending };
                (ending, search.take_counters())
            }
        };
        let cells = counters.spent(self.limit);
        self.spent += cells;
        self.outcome.counters += counters;
        Some((ending, cells))
    }

    /// The answer that an ending is, `cells` after its search began; `None` where a search begins anew, at another depth.
    fn answer(&mut self, ending: Ending, cells: u64) -> Option<Outcome> {
        let anew = match ending {
            Ending::Deep(x) => return self.answer_within(x, cells),
            Ending::Contact(found) => {
                self.meets(&found);
                false
            }
            Ending::Clear => {
                // What a finer search has found is there all the same.
                if self.open.as_ref().is_some_and(|open| open.found.is_some()) {
                    self.leave_open(0.0);
                }
                false
            }
            Ending::Limit(t) => {
                self.leave_open(t);
                false
            }
            Ending::Long(t, found) => {
                let anew = self.coarsen(t, found) || !std::mem::replace(&mut self.insists, true);
                self.leave_open_unless(anew, t)
            }
            Ending::Rounding(t) => {
                // A depth that the motion comes to and stays at is told apart from a slightly larger one.
                let anew = self.raised < SUNK && self.raise() || self.coarsen(t, None);
                self.leave_open_unless(anew, t)
            }
        };
        if anew {
            self.restart(cells);
            return None;
        }
        if self.swapped {
            self.outcome.swap_sides();
        }
        self.outcome.depth = self.task.delta;
        Some(self.outcome)
    }

    /// The answer where x is deep in both bodies at the start: `None` where a search begins anew, at a larger depth.
    fn answer_within(&mut self, x: DVec3, cells: u64) -> Option<Outcome> {
        self.outcome.touching = true;
        let doubled = self.doubles_depth();
        if doubled {
            self.task.delta = self.level * self.resolution;
        }
        let at = self.task.relative.at(0.0);
        // What is as deep as is searched, of no tolerance at the start, tells what a search for it would.
        let is_deep = self.task.is_deep(x, &at, 0.0) || !doubled && self.task.start_tolerance == 0.0;
        let is_just = is_deep || self.task.is_deep(x, &at, -self.just());
        let raises = is_just && self.raises_depth(x, is_deep);
        if raises || !is_deep {
            if is_just && !raises {
                // What is as deep is all that is left to look for.
                self.task.start_tolerance = 0.0;
            }
            self.restart(cells);
            return None;
        }
        (!self.goes_past(x, cells)).then(|| self.overlaps(x, None))
    }

    /// A body that was stopped at its contact starts at depth 0 ± rounding: the search is for twice the depth, and what is just
    /// that deep ends it. False when it was, or when an overlap is searched past.
    fn doubles_depth(&mut self) -> bool {
        if self.level != 1.0 || self.task.ignored_depth != 0.0 {
            return false;
        }
        self.level = 2.0;
        self.task.start_tolerance = JUST / NEARLY_DEEP * self.task.rounding;
        true
    }

    /// By how much a start may be off 2 delta to count as just that deep: what is asked of a start there, too.
    fn just(&self) -> f64 {
        (JUST * self.task.rounding).min(0.5 * self.task.delta)
    }

    /// A step that raised the resolution may have left the bodies a little deeper than 2 delta: raises it, too, where x is no
    /// deeper than that, and where x is just 2 delta deep. At once by as much as leaves x clearly less deep. False where no raise is
    /// as much.
    fn raises_depth(&mut self, x: DVec3, is_deep: bool) -> bool {
        if self.task.ignored_depth > 0.0 {
            return false;
        }
        let rounding = self.task.rounding;
        let depth = -separation::value(&self.task, &self.task.relative.at(0.0), x);
        let left = RAISES.get(self.raised..).unwrap_or_default();
        let sunk = left.iter().take(SUNK.saturating_sub(self.raised));
        if is_deep && depth > 2.0 * sunk.fold(self.resolution, |r, more| raised(r, *more, rounding)) {
            return false;
        }
        let (enough, mut resolution) = (depth + self.just(), self.resolution);
        let is_enough = |more: &f64| {
            resolution = raised(resolution, *more, rounding);
            2.0 * resolution >= enough
        };
        let Some(skipped) = left.iter().position(is_enough) else { return false };
        !self.swallows(resolution) && (0..=skipped).all(|_| self.raise())
    }

    /// Leaves open what comes after `t`, unless the search begins `anew`; says whether it does.
    fn leave_open_unless(&mut self, anew: bool, t: f64) -> bool {
        if !anew {
            self.leave_open(t);
        }
        anew
    }

    /// The answer that a contact was found.
    fn meets(&mut self, found: &Found) {
        let continued = (found.touch.is_none() && self.task.continues()).then(|| self.continued(found));
        let found = continued.as_ref().unwrap_or(found);
        let mut contact = contact_of(&self.task, self.outcome.resolution, found);
        let x = found.witness;
        let x = if self.swapped { self.task.relative.at(found.upper).b_point(x) } else { x };
        contact.witness = Some(x);
        if let (Some(bodies), Some(o)) = (&self.spun, &mut contact.point) {
            let velocity = |body: &Placed| {
                let motion = &body.motion;
                motion.velocity + motion.spin.cross(o.point - motion.at(contact.time).position)
            };
            // The normal still points from the reference body.
            let sign = if self.swapped { -1.0 } else { 1.0 };
            o.normal_speed = sign * (velocity(&bodies[0]) - velocity(&bodies[1])).dot(o.normal);
        }
        self.outcome.counters.times += u64::from(self.task.query_options.time());
        self.outcome.counters.contacts += u64::from(contact.point.is_some());
        self.outcome.verdict = Verdict::Contact(contact);
    }

    /// A contact whose witness was kept for its time alone, with its touch. Where it has none: with the deepest point
    /// beside the witness, which lies as deep in the one body as in the other.
    fn continued(&mut self, found: &Found) -> Found {
        let climber = Climber::new(&self.task, BACK);
        let back = Touch::new(&self.task, Known::All);
        let touch = back.back(&found.deep, &climber);
        let mut deep = found.deep.clone();
        if touch.is_none() && deep.t == found.upper {
            let held = climber.deepest(deep.t, deep.x);
            if held.1 >= self.task.delta {
                deep = self.balanced(&back, back.climbed(deep.t, &held), held.1);
            }
        }
        self.outcome.counters.instant_cells += climber.cells();
        Found { touch, deep, ..found.clone() }
    }

    /// Where a climb to a depth has ended, or where its faces' equations have their solution then, which is about as deep:
    /// on a flat top rounding keeps a climb from the point where the faces oppose each other.
    fn balanced(&self, back: &Touch, climbed: Solution, depth: f64) -> Solution {
        let at = self.task.relative.at(climbed.t);
        let level_for = |t: f64| -> Option<Solution> {
            // Secants on the level whose contact comes at the time.
            let (mut level, mut s) = (depth * (1.0 - NEAR_DEPTH), back.mended(&climbed, depth)?);
            let mut last = (depth, s.t);
            for _ in 0..DEPTHS {
                if (s.t - t).abs() <= f64::EPSILON {
                    break;
                }
                s = back.mended(&s, level)?;
                let slope = (level - last.0) / (s.t - last.1);
                last = (level, s.t);
                level += (t - s.t) * slope;
                if level.is_nan() || (level - depth).abs() > 0.5 * depth {
                    break;
                }
            }
            Some(s)
        };
        let deep = |s: &Solution| -separation::value(&self.task, &at, s.x) >= depth - INCIDENT * self.task.rounding;
        let solved = level_for(climbed.t).filter(deep);
        solved.map_or(climbed.clone(), |s| Solution { t: climbed.t, ..s })
    }

    /// The answer that nothing more is known than that nothing is met before `t`, or what a finer search has proven and found.
    fn leave_open(&mut self, t: f64) {
        let here = Open { resolution: self.resolution, depth: self.task.delta, free_until: t, found: None };
        let open = self.open.take().map_or(here, |open| *open);
        self.outcome.resolution = open.resolution;
        self.task.delta = open.depth;
        match open.found {
            Some(found) => self.meets(&found),
            None => self.outcome.verdict = Verdict::Undecided { time_lower: open.free_until },
        }
    }

    /// Makes the resolution coarser, where a search has proven that nothing is met before `t` and would take too long to tell more.
    /// False where that was done often enough, and where a primitive would be hardly more than that large.
    fn coarsen(&mut self, t: f64, found: Option<Found>) -> bool {
        let models = [self.task.model_a, self.task.model_b];
        let resolution = clear_of_walls(COARSER * self.resolution, self.task.rounding, models);
        // What is proven at the finest resolution is worth most, but for a contact that was found.
        if self.open.as_ref().is_none_or(|open| open.found.is_none() && found.is_some()) {
            let (resolution, depth) = (self.resolution, self.task.delta);
            self.open = Some(Box::new(Open { resolution, depth, free_until: t, found }));
        }
        let allowed = self.task.strategies.coarser && self.coarser < COARSENINGS;
        if !allowed || resolution > LARGEST_COARSE * self.task.thinnest() {
            return false;
        }
        self.coarser += 1;
        self.raised = 0;
        self.resolution = resolution;
        self.outcome.resolution = resolution;
        if self.task.ignored_depth == 0.0 {
            (self.level, self.task.start_tolerance) = (1.0, self.task.rounding);
        }
        true
    }

    /// The resolution after the next raise; `None` where that was done often enough, and where rounding would take more than there is of a
    /// body.
    fn next_raise(&self) -> Option<f64> {
        let more = RAISES.get(self.raised)?;
        Some(raised(self.resolution, *more, self.task.rounding)).filter(|resolution| !self.swallows(*resolution))
    }

    /// True for a raised resolution that is so by rounding, not because it was asked for, and that leaves a primitive no inside.
    fn swallows(&self, resolution: f64) -> bool {
        resolution > SWALLOWED * self.resolution && self.task.thinnest() <= LEAST_THICKNESS * resolution
    }

    /// Raises the resolution, unless that was done often enough.
    fn raise(&mut self) -> bool {
        let Some(resolution) = self.next_raise() else { return false };
        self.raised += 1;
        self.resolution = resolution;
        self.outcome.resolution = self.resolution;
        // What was twice as deep as the resolution may be less than that now: then the promise is one for once.
        if self.task.ignored_depth == 0.0 {
            (self.level, self.task.start_tolerance) = (1.0, self.task.rounding);
        }
        true
    }

    /// Searches anew, at the depth that is to be searched by now; `cells` were spent.
    fn restart(&mut self, cells: u64) {
        self.task.delta = self.task.ignored_depth + self.level * self.resolution;
        self.task.limit = self.task.limit.saturating_sub(cells);
        let mut contacts = Contacts::new(self.task);
        let again = self.coarser > 0 && self.task.strategies.cavities;
        let balls = self.task.strategies.balls;
        let told = halt::attempt(|| {
            let ending = if again { cavity::answer(&mut contacts) } else { None };
            ending.or_else(|| if balls { ball::answer(&mut contacts) } else { None })
        });
        let ending = told.unwrap_or(Some(Ending::Limit(0.0)));
        let scratch = self.take_scratch();
        if ending.is_some() {
            self.state = State::Ended(ending, contacts.counters, scratch);
            return;
        }
        let mut search = Box::new(Search::new(contacts, scratch));
        search.start(0.0);
        let tries = self.task.strategies.coarser && self.coarser < COARSENINGS && !self.insists;
        search.patience = if tries { PATIENCE } else { u64::MAX };
        self.state = State::Searching(search);
    }

    /// The memory of what has ended; the state is to be set anew.
    fn take_scratch(&mut self) -> Scratch {
        std::mem::replace(&mut self.state, State::Posed(None, Scratch::default())).into_scratch()
    }

    /// Cells' worth of work done so far.
    pub fn spent(&self) -> u64 {
        self.spent + self.under_way().map_or(0, |counters| counters.spent(self.limit))
    }

    /// Work done so far.
    pub fn counters(&self) -> Counters {
        if let State::Reported(reported, _) = &self.state {
            return reported.counters;
        }
        let mut counters = self.outcome.counters;
        if let Some(more) = self.under_way() {
            counters += *more;
        }
        counters
    }

    /// Work whose ending is not told yet.
    fn under_way(&self) -> Option<&Counters> {
        match &self.state {
            State::Posed(..) | State::Overlap(..) | State::Reported(..) => None,
            State::Ended(_, counters, _) => Some(counters),
            State::Searching(search) => Some(search.counters()),
        }
    }

    /// Ends the search and gives its memory back.
    pub fn into_scratch(self) -> Scratch {
        self.state.into_scratch()
    }
}
